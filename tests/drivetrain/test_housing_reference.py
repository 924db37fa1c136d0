"""Against the stored three-shaft housing that CalculiX 2.20 computed on the same mesh (tests/data/gearbox_housing*).

The json holds natural frequencies with clamped bores and with rigid, free ones, printed with seven digits. CalculiX
integrates the mass of second-order tetrahedra with 4 points: 5e-7 (print precision) with that rule, 1.3e-4 with the
exact mass.
"""

from __future__ import annotations

import numpy as np
import pytest

from gearfe.drivetrain.housing.model import Housing
from tests.makers.full_model import full_model
from tests.makers.housing_meshes import REFERENCE, reference_housing
from tests.makers.newmark import below, newmark, smooth_ramp


@pytest.fixture(scope="module")
def four_point() -> Housing:
    return reference_housing(four_point=True)


@pytest.fixture(scope="module")
def exact() -> Housing:
    return reference_housing()


def test_frequencies_with_4_point_mass(four_point: Housing) -> None:
    full = full_model(four_point).frequencies_hz(20)
    np.testing.assert_allclose(full, REFERENCE["rigid_bore_hz"], rtol=5e-7)
    body = four_point.reduce(40, quasi_static=2)
    assert body.modes == 40
    np.testing.assert_allclose(body.internal_hz[:40], REFERENCE["fixed_interface_hz"], rtol=5e-7)
    np.testing.assert_allclose(body.coupled.frequencies_hz[:20], REFERENCE["rigid_bore_hz"], rtol=5e-7)


def test_exact_mass_and_statics(exact: Housing) -> None:
    body = exact.reduce(40)
    np.testing.assert_allclose(body.internal_hz[:40], REFERENCE["fixed_interface_hz"], rtol=1.3e-4)
    np.testing.assert_allclose(body.coupled.frequencies_hz[:20], REFERENCE["rigid_bore_hz"], rtol=1.3e-4)
    # the static response of the bores is that of the full model
    full = full_model(exact)
    loads = np.eye(36)
    truth = full.static(loads)
    padded = np.zeros((body.size, 36))
    padded[:36] = loads
    reduced = np.linalg.solve(body.stiffness, padded)
    size = np.sqrt(np.diag(truth[:36]))
    assert np.max(np.abs(reduced[:36] - truth[:36]) / np.outer(size, size)) < 1e-10
    field = body.reconstruct(reduced[:, 4])
    np.testing.assert_allclose(field, full.reconstruct(truth[:, 4]), atol=1e-9 * np.abs(field).max())


@pytest.mark.slow
def test_ramp_response_below_5_khz_is_that_of_the_full_model(exact: Housing) -> None:
    """Force on bore 5 along the shaft, smooth ramp of 1 ms, Rayleigh damping; same Newmark steps on both models."""
    body = exact.reduce().with_damping(alpha=60.0, beta=1.6e-6)
    full = full_model(exact)
    row = 6 * 4 + 1
    step, steps = 10e-6, 700

    def load(time: float) -> np.ndarray:
        force = np.zeros(36)
        force[row] = 100.0 * smooth_ramp(time, 1e-3)
        return force

    damping = 60.0 * full.mass + 1.6e-6 * full.stiffness
    watch = np.arange(36)
    truth = newmark(full.mass, damping, full.stiffness, load, step=step, steps=steps, watch=watch)
    small = newmark(body.mass, body.damping, body.stiffness, load, step=step, steps=steps, watch=watch)
    for at in (1, 7, row, 31):
        a, b = (below(signal.acceleration[:, at], step, 5000.0) for signal in (truth, small))
        error = np.sqrt(np.mean((a - b) ** 2) / np.mean(a**2))
        assert error < 1e-3, (at, error)
