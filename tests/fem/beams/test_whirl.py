"""Whirl of rotors on springs: closed forms of a rigid rotor, exact solutions of beams, supports that do not hold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.fem.beams import BeamShaft, Disc, Section, Support, whirl_frequencies
from tests.makers.exact_beam import bending_determinant, zeros


@pytest.mark.parametrize("spin", [0.0, 200.0, -200.0, 2000.0])
def test_rigid_rotor_whirls_as_its_four_roots_say(spin: float) -> None:
    """Symmetric springs: m w^2 = 2 k, and J_t w^2 - J_p S w = 2 k l^2 (Genta, Dynamics of Rotating Systems, 2005)."""
    k, reach = 1e6, 0.1
    # a stiff, light tube that holds a heavy disc
    tube = Section(0.2, 0.08, 0.08, 0.02, 0.02, 2e15, 0.3, 1e-4)
    rotor = BeamShaft(0.0, (tube,), (Disc(0.1, 10.0, 0.2, 0.11),))
    (found,) = whirl_frequencies(rotor, (Support(0.0, k), Support(0.2, k)), (spin,), 1000.0)
    shift = math.sqrt(2.0 * k / 10.0)
    half = 0.2 * spin / (2.0 * 0.11)
    root = math.sqrt(half**2 + 2.0 * k * reach**2 / 0.11)
    exact = np.array([shift, -shift, half + root, half - root]) / (2.0 * math.pi)
    np.testing.assert_allclose(np.sort(found), np.sort(exact), rtol=1e-6)


@pytest.mark.parametrize("spin", [0.0, 100.0, 300.0, 600.0, 1200.0])
def test_overhung_disc_whirls_as_the_exact_solution_says(spin: float) -> None:
    """Stepped and hollow, both senses of whirl: 1e-6."""
    rotor = BeamShaft(
        0.0,
        (Section(0.4, 0.04, 0.04, 0.015, 0.015), Section(0.2, 0.03, 0.03)),
        (Disc(0.6, 12.0, 0.09, 0.048), Disc(0.25, 3.0, 0.01, 0.006)),
    )
    springs = {0.05: (5e7, 2e3), 0.4: (8e7, 0.0)}
    supports = tuple(Support(along, *stiffness) for along, stiffness in springs.items())
    (found,) = whirl_frequencies(rotor, supports, (spin,), 3000.0)
    for sense in (1.0, -1.0):
        exact = zeros(lambda w, s=sense: bending_determinant(rotor, springs, spin, s * w), 50.0, 2e4, 600)  # type: ignore[misc]
        exact = exact[exact < 2.0 * math.pi * 3000.0] / (2.0 * math.pi)
        assert len(exact) >= 5
        np.testing.assert_allclose(np.sort(sense * found[sense * found > 0.0]), exact, rtol=1e-6)


@pytest.mark.parametrize(
    "supports", [(), (Support(0.1, 1e6),), (Support(0.1, 1e6), Support(0.1, 1e6)), (Support(0.1, 0.0, 1e3),)]
)
def test_supports_that_leave_the_rotor_free_are_refused(supports: tuple[Support, ...]) -> None:
    """No radial spring, or one alone."""
    with pytest.raises(InputError, match="leave the rotor free"):
        whirl_frequencies(BeamShaft(0.0, (Section(1.0, 0.1, 0.1),)), supports, (0.0,), 1000.0)


def test_supports_off_the_shaft_are_refused() -> None:
    """By number."""
    supports = (Support(0.1, 1e6), Support(1.5, 1e6))
    with pytest.raises(InputError, match="support 2"):
        whirl_frequencies(BeamShaft(0.0, (Section(1.0, 0.1, 0.1),)), supports, (0.0,), 1000.0)
