"""Flexible links of the core: closed forms of statics, stability, vibration and rotation, and rates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.multibody import (
    Body,
    CoordinateSpring,
    Fixed,
    Gravity,
    Hinge,
    Linkage,
    Moment,
    PointForce,
    Prescribed,
    Slot,
    System,
    consistent_start,
    constant,
    integrate,
    smoothed_step,
)
from gearfe.multibody.core.equilibrium import equilibrium, stiffness_at
from gearfe.multibody.core.mass_regularisation import free_motions
from gearfe.multibody.planar.beam import Beam
from gearfe.multibody.planar.beam_link import BeamLink, Section
from tests.makers.elastica import elastica


def slender(elements: int, length: float = 1.0, EA: float = 1e9, EI: float = 1.0, **more) -> BeamLink:  # type: ignore[no-untyped-def]
    """A beam of given EA and EI whose shear stiffness is EA, too."""
    second = 1e-6
    section = Section(EA * second / EI, second, 0.01, shear_factor=1.0)
    return BeamLink("rod", length, section, EI / second, 1.0, poisson_ratio=-0.5, elements=elements, **more)


def made(link: BeamLink, joints=(), forces=(), bodies=()) -> System:  # type: ignore[no-untyped-def]
    linkage = Linkage((*link.nodes(), *bodies), tuple(joints), tuple(forces))
    return System([linkage, Beam(linkage, link)])


def beam_of(system: System) -> Beam:
    element = system.elements[1]
    assert isinstance(element, Beam)
    return element


def test_end_force_bends_into_the_elastica_with_order_six() -> None:
    errors = []
    for elements in (3, 4, 6, 8):
        link = slender(elements)
        system = made(link, [Fixed("rod")], [PointForce(link.node_names[-1], y=constant(10.0))])
        tip = equilibrium(system, consistent_start(system)).q[-3:]
        errors.append(float(np.abs(tip - elastica(10.0)).max()))
    assert errors[1] < 1e-5
    assert errors[3] < 1e-7
    assert np.polyfit(np.log([3, 4, 6, 8]), np.log(errors), 1)[0] < -5.5


def test_end_moment_bends_into_a_circle() -> None:
    link = slender(2)
    system = made(link, [Fixed("rod")], [Moment(link.node_names[-1], constant(2 * math.pi))])
    tip = equilibrium(system, consistent_start(system)).q[-3:]
    np.testing.assert_allclose(tip, [0.0, 0.0, 2 * math.pi], atol=1e-12)


def test_a_rigid_motion_leaves_no_strain() -> None:
    link = slender(3, angle=0.7, position=(2.0, -1.0), velocity=(3.0, 1.0), rate=5.0, damping=0.1)
    system = made(link)
    q, v = system.start_q, system.start_v
    beam = beam_of(system)
    assert np.abs(beam.stress(q, v)).max() < 1e-4  # of 1e9 N: rounding
    body = link.rigid()
    kinetic = 0.5 * body.mass * ((3.0 - 5.0 * 0.5 * math.sin(0.7)) ** 2 + (1.0 + 5.0 * 0.5 * math.cos(0.7)) ** 2)
    assert system.energy(q, v)[0] == pytest.approx(kinetic + 0.5 * body.inertia * 25.0, rel=1e-12)


def test_derivatives_of_the_force() -> None:
    link = slender(2, EA=3.0, EI=2.0, damping=0.3)
    system = made(link, forces=[Gravity((1.0, -9.81))])
    rng = np.random.default_rng(1)
    q, v = system.start_q + 0.2 * rng.standard_normal(system.size), rng.standard_normal(system.size)
    for given, part in zip(system.force_jacobian(0.0, q, v), (0, 1), strict=True):
        for j in range(system.size):
            step = np.zeros((2, system.size))
            step[part, j] = 1e-6
            ends = [system.force(0.0, q + s * step[0], v + s * step[1]) for s in (1.0, -1.0)]
            np.testing.assert_allclose(given[:, j], (ends[0] - ends[1]) / 2e-6, atol=1e-7)
    beam = beam_of(system)  # conservative part: the force is the slope of the energy
    for j in range(system.size):
        step = np.zeros(system.size)
        step[j] = 1e-6
        slope = -(beam.potential(q + step) - beam.potential(q - step)) / 2e-6
        assert beam.force(0.0, q, 0.0 * v)[j] == pytest.approx(slope, abs=1e-7)


def test_euler_buckling_of_a_hinged_rod() -> None:
    def stands(load: float) -> bool:
        link = slender(6)
        joints = [Hinge("rod", "ground"), Slot(link.node_names[-1], "ground")]
        system = made(link, joints, [PointForce(link.node_names[-1], x=constant(-load))])
        try:
            equilibrium(system, consistent_start(system))
        except InputError as error:
            if "not stable" not in str(error):
                raise
            return False
        return True

    low, high = 0.9 * math.pi**2, 1.1 * math.pi**2
    assert stands(low)
    assert not stands(high)
    while high - low > 1e-6 * low:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    assert low == pytest.approx(math.pi**2, rel=3e-6)


def test_frequencies_of_a_cantilever() -> None:
    link = BeamLink("rod", 1.0, Section(1e-4, 1e-12), 2e11, 7850.0, elements=12)
    system = made(link, [Fixed("rod")])
    q = system.start_q
    G = system.jacobian(0.0, q)
    T = free_motions(G)
    K = T.T @ stiffness_at(system, 0.0, q, np.zeros(system.rows)) @ T
    root = np.linalg.inv(np.linalg.cholesky(0.5 * (K + K.T)))  # of K: the low frequencies are not lost beside the high
    omega = np.linalg.eigvalsh(root @ T.T @ system.mass @ T @ root.T)[:-4:-1] ** -0.5
    expected = np.array([1.875104068711961, 4.694091132974174, 7.854757438237613]) ** 2  # Euler and Bernoulli
    np.testing.assert_allclose(omega, expected * math.sqrt(2e11 * 1e-12 / (7850.0 * 1e-4)), rtol=1e-5)


def test_a_beam_over_three_supports_shares_its_weight() -> None:
    link = slender(4, points=(0.5,))
    middle, end = (link.node_names[link.node(s)] for s in (0.5, 1.0))
    joints = [Hinge("rod", "ground"), Slot(middle, "ground", origin=(0.0, 0.0)), Slot(end, "ground")]
    weight = link.density * link.section.area * 1e-5
    system = made(link, joints, [Gravity((0.0, -1e-5))])
    found = equilibrium(system, consistent_start(system))
    shares = [abs(found.multipliers[i]) / weight for i, n in enumerate(system.row_names()) if "slot" in n or "(y)" in n]
    assert sorted(shares) == pytest.approx([3 / 16, 3 / 16, 5 / 8], rel=1e-6)


def test_what_has_no_equilibrium_is_told() -> None:
    link = slender(1)
    system = made(link, [Prescribed("rod", "angle", constant(0.0))], [Gravity()])
    with pytest.raises(InputError, match="equilibrium: was not found"):
        equilibrium(system, consistent_start(system))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"length": -1.0}, "length"),
        ({"density": 0.0}, "density"),
        ({"points": (1.2,)}, "outside of the link's axis"),
        ({"elements": 0}, "elements"),
        ({"damping": -1.0}, "damping"),
        ({"section": Section(0.0, 1e-8)}, "area"),
    ],
)
def test_wrong_links(change: dict, text: str) -> None:
    values = {"length": 1.0, "section": Section(1e-4, 1e-9), "young_modulus": 2e11, "density": 7850.0} | change
    with pytest.raises(InputError, match=text):
        BeamLink("rod", **values)


def test_extension_and_root_force_of_a_rotating_rod() -> None:
    """u(L) = rho w^2 L^3 / (3 E) and N(0) = rho A w^2 L^2 / 2, after a spin-up with a little damping."""
    omega, E, rho, A = 100.0, 2e10, 7850.0, 25e-4
    link = BeamLink("rod", 1.0, Section.rectangle(0.05, 0.05), E, rho, elements=2, damping=1e-4)
    motion = Prescribed("rod", "rate", smoothed_step(0.15, 0.3, omega))
    system = made(link, [Hinge("rod", "ground", name="root"), motion])
    run = integrate(system, np.array([0.0, 0.4]), tolerance=1e-5)
    assert run.method == "implicit"
    beam = beam_of(system)
    tip, strain = run.q[-1, -3:-1], rho * omega**2 / E
    assert math.hypot(*tip) - 1.0 == pytest.approx(strain / 3.0, rel=0.02)  # strain^2 terms: 1 %
    force = beam.at_nodes(run.stress_at(beam, run.time))[-1, 0, 0]
    assert force == pytest.approx(rho * A * omega**2 / 2.0, rel=0.02)
    names = system.row_names()
    pull = np.hypot(*(run.multipliers[-1][i] for i, n in enumerate(names) if "hinge root" in n))
    assert pull == pytest.approx(force, rel=0.01)


def test_a_stiff_pendulum_is_the_rigid_one_with_a_rate() -> None:
    """Quasi-static bending: the way to the rigid pendulum falls as 1/E."""
    times = np.linspace(0.0, 0.3, 4)
    section = Section.rectangle(0.02, 0.02)
    rigid_link = BeamLink("rod", 1.0, section, 1e9, 1000.0)
    rigid = System([Linkage((rigid_link.rigid(),), (Hinge("rod", "ground"),), (Gravity(),))])
    true = integrate(rigid, times, tolerance=1e-11, method="taylor")
    tip = true.q[:, :2] + 0.5 * np.stack([np.cos(true.q[:, 2]), np.sin(true.q[:, 2])], axis=1)
    off = []
    for E in (1e9, 4e9, 16e9):
        link = BeamLink("rod", 1.0, section, E, 1000.0, elements=2, damping=2e7 / E)
        system = made(link, [Hinge("rod", "ground")], [Gravity()])
        run = integrate(system, times, tolerance=1e-5)
        off.append(float(np.abs(run.q[:, -3:-1] - tip).max()))
    assert off[0] < 0.01
    assert np.diff(np.log(off)) / math.log(4.0) == pytest.approx(-1.0, abs=0.15)


def test_undamped_energy_falls_with_the_tolerance() -> None:
    """A released cantilever: what the method loses shrinks with the tolerance."""
    drift = []
    for tolerance in (1e-3, 1e-7):
        link = BeamLink("rod", 1.0, Section.rectangle(0.02, 0.02), 1e9, 1000.0, elements=2)
        system = made(link, [Fixed("rod")], [Gravity()])
        run = integrate(system, np.linspace(0.0, 0.3, 11), tolerance=tolerance)
        kinetic, potential = system.energy(run.q, run.v)
        total = kinetic + potential
        drift.append(float(np.abs(total - total[0]).max() / kinetic.max()))
    assert drift[0] < 1e-3
    assert drift[1] < 0.05 * drift[0]


def test_rigid_bodies_springs_and_nodes_work_together() -> None:
    """A mass on a massless-looking cantilever with a spring: the static deflection of both in parallel."""
    link = slender(2)
    tip = link.node_names[-1]
    mass = Body("mass", 2.0, 0.1, position=(1.0, 0.0))
    forces = [PointForce("mass", y=constant(1e-4)), CoordinateSpring("mass", "y", stiffness=5.0)]
    system = made(link, [Fixed("rod"), Fixed("mass", tip)], forces, [mass])
    found = equilibrium(system, consistent_start(system)).q.reshape(-1, 3)
    assert found[system.elements[0].body_index["mass"], 1] == pytest.approx(1e-4 / (3.0 + 5.0), rel=1e-6)
