"""Pressures of the sweep's own solver: patch and Hertz problems through it, pressures on flanks and at edges of gears.

The bodies are condensed to their surfaces as gears are (`tests.makers.condensed_bodies`); the whole-body route has the
same problems in `tests.gears.test_patch` and `tests.gears.test_hertz`.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from gearfe import Material, sweep_stiffness
from gearfe.gears.contact.elements import half_widths
from gearfe.gears.contact.laws import ContactLaw, Nitsche, Penalty
from gearfe.gears.contact.position import Positions
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.gear_data import TipRelief
from tests.makers.condensed_bodies import condensed_body, pressed, pressed_pair
from tests.makers.gears import pair
from tests.makers.solving import peak_pressure
from tests.makers.structured import block, mapped_grid

SOFT, HARD = Material(70e9, 0.30), Material(210e9, 0.25)


def solved(lower, upper, law: ContactLaw, overlap: float, low: float, high: float, guess) -> Positions:
    """From a guessed pressure (Pa) as a function of x between `low` and `high` (m)."""
    found = pressed(pressed_pair(lower, upper, law, overlap), low, high, guess)
    assert found.status == "converged"
    return found


def normal_force(found: Positions) -> float:
    """Of the upper body on the lower one (N per m of thickness)."""
    return -float(found.loads[0].force[0, 1::2].sum())


# ---- patch test ------------------------------------------------------------------------------------------------------

HEIGHTS, OVERLAP = (0.6, 0.5), 1e-4


@cache
def confined(height: float, cells: int, up: bool, material: Material):
    """A block between smooth rigid walls, held at its back, 4 or 3 cells wide."""
    walls = {"left": (True, False), "right": (True, False)}
    if up:
        made = block((0, 1), (0, height), 4 * cells, 2 * cells, material)
        return condensed_body(made, "bottom", walls | {"top": (False, True)}, 4)
    made = block((0, 1), (-height, 0), 3 * cells, 2 * cells, material)
    return condensed_body(made, "top", walls | {"bottom": (False, True)}, 4)


@pytest.mark.parametrize("law", [Nitsche(), Penalty(1e15, sides="wheel")], ids=["nitsche", "penalty"])
def test_patch_force_converges_through_the_sweeps_solver(law: ContactLaw) -> None:
    """Uniform pressure p = overlap/sum(h/(lam + 2 mu)); penalty adds 1/gamma. Plain points on edges that do not match
    pass it in the limit (Nitsche: order 1.5), not exactly as segments do (`tests.gears.test_patch`)."""
    moduli = [m.lame("strain")[0] + 2 * m.lame("strain")[1] for m in (SOFT, HARD)]
    compliance = sum(h / m for h, m in zip(HEIGHTS, moduli, strict=True))
    compliance += 1 / 1e15 if law.name == "penalty" else 0.0
    off = []
    for cells in (1, 2, 4):
        bodies = confined(HEIGHTS[1], cells, False, HARD), confined(HEIGHTS[0], cells, True, SOFT)
        found = solved(*bodies, law, OVERLAP, 0.0, 1.0, lambda x: np.full(len(x), 0.3 * OVERLAP * 70e9))
        off.append(abs(normal_force(found) * compliance / OVERLAP - 1))
    assert off[2] < 3e-4
    assert law.name == "penalty" or 0.5 * math.log2(off[0] / off[2]) > 1.4


# ---- Hertz -----------------------------------------------------------------------------------------------------------

UPPER, LOWER = Material(110e9, 0.26), Material(200e9, 0.30)
MODULUS = 1 / (UPPER.contact_compliance("strain") + LOWER.contact_compliance("strain"))
#: Relative radius and size of the bodies in half widths; the fine part ends beside a node on no mesh.
RADIUS, SIZE, FINE = 1000.0, 20.0, 1.37


@cache
def hertz_bodies(n: int):
    """A plane and a parabola on it, held far away; edges along the contact in the ratio 3 to 2."""

    def spaced(k: int):
        fine, coarse = np.linspace(0, FINE, 3 * k + 1), FINE * (SIZE / FINE) ** np.linspace(0, 1, 3 * k + 1)[1:]
        return np.concatenate([fine, coarse])

    def both(k: int):
        return np.concatenate([-spaced(k)[:0:-1], spaced(k)])

    def parabola(s, t):
        return s, t + s * s / (2 * RADIUS) * (1 - t / SIZE)

    upper = mapped_grid(both(2 * n), spaced(2 * n), parabola, UPPER)
    lower = mapped_grid(both(3 * n), -spaced(3 * n)[::-1], lambda s, t: (s, t), LOWER)
    held = {"left": (True, True), "right": (True, True)}
    return (
        condensed_body(lower, "top", held | {"bottom": (True, True)}, 4),
        condensed_body(upper, "bottom", held | {"top": (True, True)}, 4),
    )


def hertz_errors(n: int, law: ContactLaw) -> tuple[float, float]:
    """Relative errors of the half width by the second moment, and of the largest pressure at a contact point."""
    guess = SIZE - 0.8, SIZE + 0.8, lambda x: np.full(len(x), 1e8)
    found = solved(*hertz_bodies(n), law, 3.2 / (2 * RADIUS), *guess)
    force = normal_force(found)
    b = math.sqrt(4 * force * RADIUS / (math.pi * MODULUS))  # Johnson, eq. 4.43
    assert 0.5 < b < FINE
    return abs(found.contacts.half_width[0] / b - 1), abs(peak_pressure(found) / (2 * force / (math.pi * b)) - 1)


@pytest.mark.parametrize("n", [1, 2])
def test_hertz_through_the_sweeps_solver(n: int) -> None:
    """The half width by the second moment is Hertz's (bodies of 20 half widths: 0.1 %), the largest pressure is not."""
    width, _ = hertz_errors(n, Nitsche())
    assert width < 2e-3


def test_largest_pressures_at_points_do_not_converge() -> None:
    """What the second moment is for: points on edges that do not match keep an error of several per cent."""
    assert min(hertz_errors(n, Nitsche())[1] for n in (1, 2)) > 0.03


def test_hertz_by_a_penalty_converges() -> None:
    """With a parameter of order E/h^2 the half width has rate 1 at least."""
    off = [hertz_errors(n, Penalty(30 * UPPER.youngs_modulus * n**2, sides="both"))[0] for n in (1, 2)]
    assert off[1] < 0.5 * off[0]


def test_half_width_of_an_ellipse_and_of_nothing() -> None:
    """Gauss-Chebyshev points of the second kind integrate an elliptic pressure exactly: b comes back to rounding."""
    t = math.pi * np.arange(1, 30) / 30
    across = np.array([math.cos(0.3), math.sin(0.3)])
    place = (7e-5 * np.cos(t)[:, None] * across + [3e-3, -2e-3]) @ [1, 1j]
    found = half_widths(np.zeros(29, dtype=np.int64), place, 1e3 * np.sin(t) ** 2, 2)
    assert found[0] == pytest.approx(7e-5, rel=1e-9)
    assert np.isnan(found[1])


# ---- gears -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rounded():
    gears = pair(tip_round=0.1e-3)
    return gears, {law: elastic_pair(gears, law=law, coarsen=2.0) for law in ("half_plane", "nitsche", "penalty")}


@pytest.mark.parametrize(
    ("law", "degrees"), [("half_plane", 0.002), ("half_plane", 0.05), ("nitsche", 0.05), ("penalty", 0.05)]
)
def test_pressure_of_the_path_is_hertzs(rounded, law, degrees) -> None:
    """p = sqrt(F E*/(pi w rho)) with the radii of the involutes on the line of action."""
    gears, elastic = rounded[0], rounded[1][law]
    angles = gears.mesh_cycle * np.linspace(0.62, 0.92, 7)  # one pair in the middle of its path
    curve = sweep_stiffness(
        gears, twist=math.radians(degrees), angles=angles, elastic=elastic, kinematics="small", coarsen=2.0
    )
    assert (curve.teeth_in_contact == 1).all()
    force = curve.torque_wheel / gears.wheel.base_radius / 10e-3
    modulus = 200e9 / (2 * (1 - 0.3**2))
    rho1 = np.array([gears.pinion_roll_at(a - gears.mesh_cycle) for a in angles])  # the pair -1 bears
    rho = rho1 * (gears.tangent_length - rho1) / gears.tangent_length
    np.testing.assert_allclose(curve.peak_pressure, np.sqrt(force * modulus / (math.pi * rho)), rtol=5e-3)
    assert (curve.edge == "none").all()
    assert np.isnan(curve.edge_pressure).all()
    assert np.median(curve.peak_pressure_error) < 0.05  # a mesh twice as coarse as the default


@pytest.mark.parametrize(
    ("form", "kind", "angle"),
    [
        ({"bore": 0.35}, "singular", 0.0),
        ({"bore": 0.35}, "singular", 17.0),
        ({"tip_round": 0.1e-3}, "rounded", 9.0),
        ({"tip_round": 0.1e-3, "tip_relief": TipRelief(20e-6, 2e-3, 1.0)}, "singular", 3.0),
    ],
)
def test_an_edge_that_bears_is_told_apart_and_no_mesh_decides_its_figure(form, kind, angle) -> None:
    gears = pair(**form)
    made = [
        sweep_stiffness(gears, twist=math.radians(0.05), angles=[math.radians(angle)], flank_coarsen=size)
        for size in (1.0, 0.5)
    ]
    one, other = (curve.edge_pressure[0] for curve in made)
    assert [str(curve.edge[0]) for curve in made] == [kind, kind]
    assert one == pytest.approx(other, rel=0.04)


def test_a_linear_relief_makes_no_jump_in_the_pressure_of_the_path() -> None:
    """Hertz's pressure grows with the root of the force while one pair bears, also when its contact passes the kink."""
    gears = pair(tip_round=0.1e-3, tip_relief=TipRelief(10e-6, 1.5e-3, 1.0))
    body, angle = elastic_pair(gears, coarsen=2.0), [math.radians(12.0)]
    torques = np.array([5.0, 20.0, 80.0])
    curves = [sweep_stiffness(gears, torque=t, angles=angle, elastic=body, coarsen=2.0) for t in torques]
    assert all(c.teeth_in_contact[0] == 1 for c in curves)
    per_root = np.array([c.peak_pressure[0] for c in curves]) / np.sqrt(torques)
    np.testing.assert_allclose(per_root, per_root[0], rtol=2e-3)
