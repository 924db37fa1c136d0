"""Positions solved in lockstep against the solver of single positions, and their independence of one another.

The two share the law's equations and the condensed gears; places, linearisation, stopping rule, windows and tangent are
each written out twice.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.contact import solver
from gearfe.contact.laws import ContactLaw, Nitsche, Penalty
from gearfe.contact.overlap import CLOSE, Reach, overlaps, windows_of
from gearfe.contact.scene import MeshingPair
from gearfe.contact.solver import Position, solve_group, solve_positions

from .contact_cases import condensed

NUMBERS = ("torque_wheel", "torque_pinion", "torque_wheel_reaction", "tangent", "peak_pressure")
CASES = [
    # pair, plane, law, twist (deg)
    ("sharp", "strain", Nitsche(), 0.05),
    ("sharp", "stress", Nitsche(), 0.2),
    ("sharp", "strain", Nitsche(2.0, sides="wheel"), 0.02),
    ("sharp", "strain", Penalty(), 0.05),
    ("sharp", "strain", Penalty(), 0.3),
    ("sharp", "strain", Penalty(sides="pinion"), 0.05),
    ("modified", "strain", Nitsche(), 0.02),
    ("modified", "stress", Penalty(sides="both"), 0.3),
]


def some(pair: MeshingPair, count: int) -> np.ndarray:
    return (np.arange(count) + 0.37) * pair.pitch_angle / count


def in_lockstep(pair: MeshingPair, angles: np.ndarray, twist: float) -> list[Position]:
    """The positions as the lockstep iteration alone leaves them."""
    found = overlaps(pair, angles, np.full(len(angles), twist))
    windows = [windows_of(pair, one, a, twist, CLOSE) for one, a in zip(found, angles, strict=True)]
    return solve_group(pair, windows, found, solver.TOLERANCE, softly=not pair.law.uses_stress)


@pytest.mark.parametrize(("name", "plane", "law", "degrees"), CASES)
def test_lockstep_and_single_positions_agree(
    name: str, plane: str, law: ContactLaw, degrees: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair, twist = condensed(name, 2.0, plane, law), math.radians(degrees)  # type: ignore[arg-type]
    angles = some(pair, 10)
    quick = in_lockstep(pair, angles, twist)
    done = [i for i, p in enumerate(quick) if p.status == "converged"]
    assert len(done) >= 8  # it is meant to serve nearly all
    monkeypatch.setattr(solver, "in_lockstep", lambda law: False)
    # the single solver stops on the pressures alone, which leaves up to 1e-9 in its torques at this tighter tolerance
    single = solve_positions(pair, angles, twist, tolerance=1e-14)
    worst = dict.fromkeys((*NUMBERS, "pair_torques"), 0.0)
    for one, other in ((quick[i], single[i]) for i in done):
        assert other.status == "converged"
        assert one.pair_numbers == other.pair_numbers
        for quantity in NUMBERS:
            worst[quantity] = max(worst[quantity], abs(getattr(one, quantity) / getattr(other, quantity) - 1))
        apart = np.abs(one.pair_torques - other.pair_torques).max() / other.torque_wheel
        worst["pair_torques"] = max(worst["pair_torques"], apart)
    # a single point's pressure and the tangent feel that more
    loose = worst.pop("tangent"), worst.pop("peak_pressure")
    assert max(worst.values()) < 1e-8, worst
    assert max(loose) < 1e-6, loose


def test_company_does_not_matter() -> None:
    """A position alone, among others, in another order: the same numbers to the last bits."""
    pair, twist = condensed("sharp", 2.0, "strain", Nitsche()), math.radians(0.05)
    angles = some(pair, 9)
    together = solve_positions(pair, angles, twist)
    backwards = solve_positions(pair, angles[::-1], twist)[::-1]
    alone = [solve_positions(pair, angles[i : i + 1], twist)[0] for i in range(0, 9, 4)]
    for one, other in [*zip(together, backwards, strict=True), *zip(together[::4], alone, strict=True)]:
        assert one.status == other.status
        for quantity in NUMBERS:
            assert getattr(one, quantity) == pytest.approx(getattr(other, quantity), rel=1e-12), quantity


def test_tangent_is_the_slope_of_the_torque() -> None:
    """Central differences of the torque over a sweep of twists, at positions with one and with two pairs."""
    pair, twist = condensed("modified", 2.0, "strain", Nitsche()), math.radians(0.05)
    angles, step = some(pair, 6), 1e-3 * math.radians(0.05)
    middle, above, below = (in_lockstep(pair, angles, twist + k * step) for k in (0, 1, -1))
    for one, more, less in zip(middle, above, below, strict=True):
        slope = (more.torque_wheel - less.torque_wheel) / (2 * step)
        assert one.tangent == pytest.approx(slope, rel=3e-4)


def test_scene_forces_and_their_rates_are_those_of_the_position() -> None:
    """Forces recovered on the scene give the torques; with their rates, of a slightly larger twist."""
    pair, twist = condensed("sharp", 2.0, "strain", Nitsche()), math.radians(0.05)
    step = 1e-5 * twist
    here, there = (in_lockstep(pair, some(pair, 4), t) for t in (twist, twist + step))
    both = [(a, b) for a, b in zip(here, there, strict=True) if a.status == b.status == "converged"]
    assert len(both) >= 3
    for one, other in both:
        scene = one.scene
        assert scene is not None
        assert other.scene is not None
        assert one.force_rate is not None
        force = np.matmul(scene.rotation, one.forces.reshape(-1, 2, 1))[:, :, 0]
        assert np.abs(force.sum(axis=0)).max() < 1e-9 * np.abs(force).sum()
        arm = scene.points - scene.wheel_centre
        moment = arm[:, 1] * force[:, 0] - arm[:, 0] * force[:, 1]
        assert moment[scene.of_wheel].sum() == pytest.approx(one.torque_wheel_reaction, rel=1e-9)
        assert [w.first_node for w in scene.windows] == sorted(w.first_node for w in scene.windows)
        if [(w.first_edge, w.edges) for w in scene.windows] == [(w.first_edge, w.edges) for w in other.scene.windows]:
            change = (other.forces - one.forces) / step
            # the linearisation leaves out products of n.a, of the order of the kinks between (coarse) edges
            assert np.abs(change - one.force_rate).max() < 1e-2 * np.abs(one.force_rate).max()


def test_a_window_that_is_too_small_is_noticed() -> None:
    """Windows cut to a quarter of the contact: the lockstep iteration says that the contact outgrew them."""
    pair, twist = condensed("sharp", 2.0, "strain", Nitsche()), math.radians(0.3)
    angles = some(pair, 3)
    found = overlaps(pair, angles, np.full(3, twist))
    tight = Reach(0.02, 0, whole_tips=False)
    shallow = [[replace(one, depth=0.0) for one in overlapping] for overlapping in found]
    windows = [windows_of(pair, one, angle, twist, tight) for one, angle in zip(shallow, angles, strict=True)]
    assert "converged" not in {p.status for p in solve_group(pair, windows, found, solver.TOLERANCE)}
