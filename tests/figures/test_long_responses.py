"""Pictures of long responses: a band that holds the curve, and the last part by itself."""

from __future__ import annotations

import numpy as np

from gearfe.figures.train import LONG, ZOOMED, envelope, is_long, last_part
from tests.makers.train_responses import made_up


def test_the_band_holds_every_value_and_no_more() -> None:
    random = np.random.default_rng(3)
    x, y = np.linspace(0.0, 1.0, 20011), random.normal(size=20011).cumsum()
    middle, low, high = envelope(x, y, most=500)
    assert len(middle) <= 500
    assert (np.diff(middle) > 0.0).all()
    group = -(-len(x) // 500)
    for i in range(len(middle)):
        own = y[i * group : (i + 1) * group + 1]
        assert (low[i], high[i]) == (own.min(), own.max())
    assert (low[1:] <= high[:-1]).all()  # neighbours touch: no gaps in the band
    assert (high[1:] >= low[:-1]).all()


def test_the_last_periods_of_the_slowest_mesh() -> None:
    response = made_up()
    slowest = float(np.abs(response.mesh_frequencies_Hz).min())
    assert is_long(response) == ((response.time[-1] - response.time[0]) * slowest > LONG)
    part = last_part(response)
    assert part.time[-1] == response.time[-1]
    step = response.time[1] - response.time[0]
    assert abs((part.time[-1] - part.time[0]) - min(ZOOMED / slowest, response.time[-1])) <= 1.01 * step
    assert part.contact_force.shape == (len(part.time), response.contact_force.shape[1])
    np.testing.assert_array_equal(part.contact_force, response.contact_force[-len(part.time) :])
    assert part.mesh_names == response.mesh_names
