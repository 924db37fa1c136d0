"""The rule of `method = "auto"`: what it takes, that it depends on the model alone, and what removed methods answer."""

from __future__ import annotations

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.multibody import (
    Body,
    CoordinateSpring,
    Gravity,
    Hinge,
    Linkage,
    LocalForce,
    System,
    consistent_start,
    integrate,
)
from gearfe.multibody.integrators.integrate import DECAYED, OVERDAMPED, chosen_method
from gearfe.multibody.planar.beam import Beam
from gearfe.multibody.planar.beam_link import BeamLink, Section
from tests.makers.rigid_cases import folding_links, pendulum

INERTIA = 1 / 12 + 1 / 4


def damped(decay: float, vibration: float) -> System:
    """A hinged bar with the given decay (1/s) and vibration (rad/s), without gravity."""
    body = Body("rod", 1.0, 1 / 12, (0.5, 0.0), (0.0, 0.0), 0.3)
    spring = CoordinateSpring("rod", "angle", INERTIA * vibration**2, INERTIA * decay, 0.1)
    return System([Linkage((body,), (Hinge("rod", "ground"),), (spring,))])


@pytest.mark.parametrize(
    ("over", "decayed", "method"),
    [(1.1, 1.1, "implicit"), (0.9, 1.1, "taylor"), (1.1, 0.9, "taylor"), (0.9, 0.9, "taylor")],
)
def test_collocation_takes_what_is_overdamped_for_long(over: float, decayed: float, method: str) -> None:
    decay = 1e5
    system = damped(decay, decay / (OVERDAMPED * over))
    assert chosen_method(system, consistent_start(system), DECAYED * decayed / decay) == method


def test_rigid_mechanisms_take_series_and_flexible_links_collocation() -> None:
    for system in (pendulum(), folding_links()):
        assert chosen_method(system, consistent_start(system), 1000.0) == "taylor"
    link = BeamLink("beam", 1.0, Section.rectangle(0.02, 0.02), 2e11, 7800.0, elements=2)
    linkage = Linkage(link.nodes(), (Hinge("beam", "ground"),), (Gravity((0.0, -9.81)),))
    system = System([linkage, Beam(linkage, link)])
    assert chosen_method(system, consistent_start(system), 1e-3) == "implicit"


def test_a_load_without_a_series_runs_by_collocation() -> None:
    linkage = pendulum().elements[0]
    drag = LocalForce((linkage,), np.eye(3)[:, 2:], lambda t, u, du: -du * np.abs(du))
    assert integrate(System([linkage, drag]), [0.0, 0.1]).method == "implicit"


def test_the_same_run_has_the_same_digits() -> None:
    """Whatever ran before in this process, and however long it took."""
    first = integrate(damped(1e6, 1.0), [0.0, 5.0], tolerance=1e-6)
    integrate(pendulum(), [0.0, 5.0])
    again = integrate(damped(1e6, 1.0), [0.0, 5.0], tolerance=1e-6)
    assert first.method == again.method == "implicit"
    np.testing.assert_array_equal(first.q, again.q)


def test_the_removed_method_says_what_to_write(tmp_path, capsys) -> None:  # type: ignore[no-untyped-def]
    cure = 'explicit was removed: leave the method out, or write "implicit"'
    with pytest.raises(InputError, match=cure):
        integrate(pendulum(), [0.0, 1.0], method="explicit")
    path = tmp_path / "job.toml"
    assert main(["new", "mechanism", str(path)]) == 0
    assert main(["mechanism", str(path), "--method", "explicit", "--out", str(tmp_path / "a")]) == 2
    assert cure in capsys.readouterr().err
    path.write_text(path.read_text().replace("[run]\n", '[run]\nmethod = "explicit"\n', 1))
    assert main(["mechanism", str(path), "--out", str(tmp_path / "b")]) == 2
    assert cure in capsys.readouterr().err
