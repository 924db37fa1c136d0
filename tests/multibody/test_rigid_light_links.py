"""Links of next to no mass, and of none: against equations of motion in one coordinate, and their limit without mass.

A four-bar has the kinetic energy m(phi) phi'^2 / 2 and the potential V(phi) of its crank's angle, so
m phi'' + m' phi'^2 / 2 + V' = 0; joint forces follow from the coupler's and the rocker's balances.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearfe.base.errors import InputError
from gearfe.multibody import Body, Gravity, Hinge, Linkage, Prescribed, Prismatic, System, constant, integrate
from tests.makers.four_bar import COUPLER, CRANK, M1, M3, PHI, RATE, ROCKER, closure, four_bar, normal, unit
from tests.makers.rigid_cases import G, folding_links, total_energy

#: (mass of the coupler, moment of inertia over that of a rod of 1 kg)
SHARES = [
    (1.0, 1.0), *((s, s) for s in (1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.0)), (1e-9, 1.0), (0.0, 1.0), (1.0, 1e-9),
    (1.0, 0.0),
]  # fmt: skip


def accelerations(phi: float, rate: float, mass: float, share: float) -> tuple[float, np.ndarray, float, float]:
    """phi'', and accelerations of the coupler's centre, of its angle and of the rocker's."""
    coupler, rocker, first, second = closure(phi)
    c1 = CRANK * normal(phi) + COUPLER / 2 * normal(coupler) * first[0]
    c2 = COUPLER / 2 * (normal(coupler) * second[0] - unit(coupler) * first[0] ** 2) - CRANK * unit(phi)
    I1, I2, I3 = M1 * CRANK**2 / 3, share * COUPLER**2 / 12, M3 * ROCKER**2 / 3
    m = I1 + I2 * first[0] ** 2 + mass * c1 @ c1 + I3 * first[1] ** 2
    half = I2 * first[0] * second[0] + mass * c1 @ c2 + I3 * first[1] * second[1]
    weight = G * (M1 * CRANK / 2 * cos(phi) + mass * c1[1] + M3 * ROCKER / 2 * cos(rocker) * first[1])
    a = -(weight + half * rate**2) / m
    return a, c1 * a + c2 * rate**2, first[0] * a + second[0] * rate**2, first[1] * a + second[1] * rate**2


def motion(mass: float, share: float, times: np.ndarray) -> np.ndarray:
    """Angle and rate of the crank (scipy, 3e-14)."""

    def rhs(_t: float, y: np.ndarray) -> list[float]:
        return [y[1], accelerations(y[0], y[1], mass, share)[0]]

    made = solve_ivp(rhs, (times[0], times[-1]), [PHI, RATE], "DOP853", t_eval=times, rtol=3e-14, atol=1e-14)
    return made.y


def joint_forces(phi: float, rate: float, mass: float, share: float) -> np.ndarray:
    """Forces on the coupler at A and on the rocker at B, from the balances of coupler and rocker about C."""
    coupler, rocker, _, _ = closure(phi)
    _, centre, turn, swing = accelerations(phi, rate, mass, share)
    u, r = COUPLER / 2 * unit(coupler), ROCKER * unit(rocker)
    balances = [[1, 0, -1, 0], [0, 1, 0, -1], [u[1], -u[0], u[1], -u[0]], [0, 0, -r[1], r[0]]]
    inertia = [mass * centre[0], mass * (centre[1] + G), share * COUPLER**2 / 12 * turn]
    return np.linalg.solve(balances, [*inertia, M3 * (ROCKER**2 / 3 * swing + G * r[0] / 2)])


@pytest.mark.parametrize(("mass", "share"), SHARES)
def test_four_bar_with_a_light_coupler(mass, share):
    times = np.linspace(0.0, 1.0, 6)
    exact = motion(mass, share, times)
    run = integrate(four_bar(mass, share), times, method="taylor", tolerance=1e-12)
    np.testing.assert_allclose(run.q[:, 2], exact[0], atol=2e-12)
    names = run.system.row_names()
    places = [names.index(f"hinge {name} ({k})") for name in "AB" for k in "xy"]
    forces = run.multipliers[:, places] * [-1.0, -1.0, 1.0, 1.0]
    for force, phi, rate in zip(forces, *exact, strict=True):
        truth = joint_forces(phi, rate, mass, share)
        np.testing.assert_allclose(force, truth, atol=2e-11 * np.abs(truth).max())


def test_the_difference_from_no_mass_is_as_the_mass():
    times = np.array([0.0, 1.0])
    limit = motion(0.0, 0.0, times)[0, -1]
    shares = np.array([1e-3, 1e-5, 1e-7, 1e-9])
    options = {"method": "taylor", "tolerance": 1e-13}
    off = [abs(integrate(four_bar(s, s), times, **options).q[-1, 2] - limit) for s in shares]
    slope = np.polyfit(np.log10(shares), np.log10(off), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("method", "tolerance", "allowed"), [("taylor", 1e-10, 1e-9), ("implicit", 1e-6, 1e-5)])
@pytest.mark.parametrize("share", [1e-12, 0.0])
def test_other_methods_with_a_light_coupler(method, tolerance, allowed, share):
    times = np.linspace(0.0, 0.5, 3)
    run = integrate(four_bar(share, share), times, method=method, tolerance=tolerance)
    exact = motion(share, share, times)
    assert np.abs(run.q[:, 2] - exact[0]).max() <= allowed
    a = accelerations(*exact[:, -1], share, share)[0]
    assert run.a[-1, 2] == pytest.approx(a, rel=1e3 * tolerance)


def test_auto_takes_the_series_with_a_light_coupler():
    assert integrate(four_bar(1e-12, 1e-12), [0.0, 1.0]).method == "taylor"


def with_rod(mass: float, inertia: float, theta: float, omega: float) -> System:
    """Links with a change point whose rod has another mass."""
    linkage = folding_links(theta, omega).elements[0]
    bodies = (linkage.bodies[0], replace(linkage.bodies[1], mass=mass, inertia=inertia / 12))
    return System([Linkage(bodies, linkage.joints, linkage.forces)])


@pytest.mark.parametrize("theta", [pi / 4, pi / 2])
@pytest.mark.parametrize(("mass", "share"), [(1e-6, 1e-6), (1e-9, 1e-9), (1e-15, 1e-15), (0.0, 0.0), (1.0, 0.0)])
def test_folding_links_with_a_light_rod(mass, share, theta):
    """Through the singular positions, and from one of them."""
    times, omega = np.linspace(0.0, 3.0, 7), 2.0 * 2.0**0.5

    def rhs(_t: float, y: np.ndarray) -> list[float]:
        s, c = sin(y[0]), cos(y[0])
        m = 1 / 3 + share / 12 + mass * (2.25 * s * s + 0.25 * c * c)
        return [y[1], -(2 * mass * s * c * y[1] ** 2 + G / 2 * (1 + mass) * c) / m]

    exact = solve_ivp(rhs, (0.0, times[-1]), [theta, omega], "DOP853", t_eval=times, rtol=3e-14, atol=1e-14).y[0]
    run = integrate(with_rod(mass, share, theta, omega), times, method="taylor", tolerance=1e-11)
    np.testing.assert_allclose(run.q[:, 2], exact, atol=1e-9)
    turns = np.abs(np.diff(np.floor(run.dense(np.linspace(1e-6, 3.0, 500), 0)[:, 2] / pi - 0.5))).sum()
    assert len(run.statistics["change_points"]) == turns + (theta == pi / 2)


@pytest.mark.parametrize("share", [1e-6, 1e-12, 1e-15, 1e-40])
def test_a_light_pendulum_on_a_light_coupler_keeps_its_own_mass(share):
    """It swings from the crank's end, which moves as if neither were there."""
    length, times = 0.3, np.linspace(0.0, 1.0, 6)

    def rhs(_t: float, y: np.ndarray) -> list[float]:
        phi, rate, angle, spin = y
        a = accelerations(phi, rate, 0.0, 0.0)[0]
        end = CRANK * (normal(phi) * a - unit(phi) * rate**2) + [0.0, G]
        return [rate, a, spin, -1.5 / length * float(normal(angle) @ end)]

    exact = solve_ivp(rhs, (0.0, 1.0), [PHI, RATE, -0.3, 0.0], "DOP853", t_eval=times, rtol=3e-14, atol=1e-14).y
    place, speed = tuple(CRANK * unit(PHI)), tuple(RATE * CRANK * normal(PHI))
    rod = Body("pendulum", share, share * length**2 / 12, (length / 2, 0.0), place, -0.3, speed)
    linkage = four_bar(0.0, 0.0).elements[0]
    system = System([Linkage((*linkage.bodies, rod), (*linkage.joints, Hinge("pendulum", "coupler")),
                                       linkage.forces)])  # fmt: skip
    run = integrate(system, times, method="taylor", tolerance=1e-12)
    assert np.abs(run.q[:, 2] - exact[0]).max() <= 10 * share + 1e-12
    assert np.abs(run.q[:, 11] - exact[2]).max() <= 100 * share + 2e-11


def test_driven_links_without_mass():
    """Only the rocker has mass: the crank's moment is the power of the rocker over the crank's rate."""
    linkage = four_bar(0.0, 0.0).elements[0]
    bodies = (replace(linkage.bodies[0], mass=0.0, inertia=0.0), *linkage.bodies[1:])
    joints = (*linkage.joints, Prescribed("crank", "rate", constant(RATE), name="motor"))
    times = np.linspace(0.0, 0.4, 5)
    run = integrate(System([Linkage(bodies, joints, linkage.forces)]), times)
    motor = run.system.row_names().index("prescribed motor (angle)")
    for i, t in enumerate(times):
        _, rocker, first, second = closure(PHI + RATE * t)
        assert run.q[i, 8] == pytest.approx(rocker, abs=1e-12)
        moment = M3 * (ROCKER**2 / 3 * second[1] * RATE**2 + G * ROCKER / 2 * cos(rocker))
        assert -run.multipliers[i, motor] == pytest.approx(moment * first[1], abs=1e-10)


def slider_crank(mass: float, phi: float = 1.0) -> System:
    """Crank and rod of this mass, block of 1 kg on the x axis."""
    rod = -np.arcsin(sin(phi) / 2)
    spin = -3.0 * cos(phi) / (2 * cos(rod))
    end, speed = unit(phi), 3.0 * normal(phi)
    bodies = (
        Body("crank", mass, mass / 12, (0.5, 0.0), angle=phi, rate=3.0),
        Body("rod", mass, mass / 3, (1.0, 0.0), tuple(end), rod, tuple(speed), spin),
        Body("block", 1.0, 0.0, position=tuple(end + 2 * unit(rod)), velocity=tuple(speed + 2 * spin * normal(rod))),
    )
    joints = (
        Hinge("crank", "ground"),
        Hinge("crank", "rod", (1.0, 0.0)),
        Hinge("rod", "block", (2.0, 0.0)),
        Prismatic("block", "ground"),
    )
    return System([Linkage(bodies, joints, (Gravity((0.0, -G)),))])


def test_through_dead_centres_on_a_light_crank():
    """There the crank's own mass holds it, and the motion is nearly as sharp as a corner."""
    run = integrate(slider_crank(1e-6), np.linspace(0.0, 2.0, 21), method="taylor", tolerance=1e-12)
    energy = total_energy(run)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


@pytest.mark.parametrize("mass", [1e-15, 0.0])
def test_a_dead_centre_that_no_mass_carries_on_through_is_told(mass):
    """Nothing that is not a number is a step, in compiled code as in plain."""
    run = integrate(slider_crank(mass), [0.0, 2.0], method="taylor", raise_on_failure=False)
    assert run.reached == pytest.approx(0.4135, abs=1e-3)
    assert "body 'crank' has next to no mass" in run.message


def without(*names: str) -> Callable[[], System]:
    """The four-bar without these joints and with a coupler without mass."""

    def make() -> System:
        linkage = four_bar(0.0, 0.0).elements[0]
        return System([Linkage(linkage.bodies, tuple(j for j in linkage.joints if j.name not in names))])

    return make


def alone() -> System:
    return System([Linkage((Body("coupler", 0.0, 0.0),), (Hinge("coupler", "ground"),))])


@pytest.mark.parametrize("make", [without("B"), without("A", "B"), alone])
def test_a_link_without_mass_that_nothing_holds_is_named(make):
    with pytest.raises(InputError, match=r"body 'coupler' mass = 0\.0: leaves its motion undetermined.*give it mass"):
        integrate(make(), [0.0, 1.0])
