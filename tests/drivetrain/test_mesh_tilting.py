"""Mesh springs that act along the face width: lever, moment and stiffness against tilting, by statics and balances."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.runup.condensed import condense
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import GearTrain, TrainModel, build_train, simulate
from gearfe.drivetrain.train.misalignment import misalignments, static_state
from gearfe.drivetrain.train.states import train_states
from gearfe.drivetrain.train.statics import static_errors
from gearfe.gears.gearmesh.mesh_table import Tilting
from gearfe.gears.gearmesh.periodic import PeriodicInterpolant, periodic_interpolant
from gearfe.multibody import constant, integrate
from tests.makers.helical_trains import HIGH, LOW, helical_pair
from tests.makers.pushes import slopes_of

TEETH, K, TORQUE, AGAINST = 20, 2e8, 60.0, 8e3
PITCH = 2.0 * math.pi / TEETH
SPAN = HIGH - LOW


def wave(mean: float, swing: float, shift: float = 0.0, count: int = 60) -> PeriodicInterpolant:
    phase = PITCH * np.arange(count) / count
    return periodic_interpolant(phase, mean + swing * np.cos(TEETH * phase + shift), PITCH)


def tilting_pair(
    lever: tuple[float, float] = (2e-3, 1e-3), moment: tuple[float, float] = (5.0, 3.0), **changes: object
) -> GearTrain:
    """The helical pair with a spring of varying stiffness, error, lever (m) and moment (N m): means and swings."""
    tilting = Tilting(wave(*lever, 0.4), wave(*moment, 1.1), AGAINST)
    mesh = {"stiffness": wave(K, 0.2 * K), "transmission_error": wave(0.0, 2e-6, 0.7), "tilting": tilting}
    return helical_pair(**{**mesh, **changes})  # type: ignore[arg-type]


def bearing_forces(model: TrainModel, q: np.ndarray) -> dict[str, np.ndarray]:
    """Forces of shafts on bearings (springs) in a state."""
    still = np.zeros((1, len(q)))
    found = model.bearings(q[None], still, still, still, 0.0)[0]
    return {bore: load[:3] for bore, load in zip(model.bores, found, strict=True)}


def settled(model: TrainModel) -> np.ndarray:
    """Place of equilibrium of a train whose spring does not vary, from its forces alone, by Newton's method."""
    forces, modal = model.forces, model.modal
    W = modal.T.T @ model.directions
    y, t, h = np.zeros(len(modal.eigenvalues)), np.array([0.0]), 1e-9

    def residual(y: np.ndarray) -> np.ndarray:
        u = (modal.origin + modal.T @ y) @ model.directions
        return modal.constant - modal.eigenvalues * y + W @ forces(t, u[None], np.zeros((1, len(u))))[0]

    for _ in range(8):
        J = np.array([(residual(y + h * e) - residual(y - h * e)) / (2.0 * h) for e in np.eye(len(y))]).T
        y = y - np.linalg.solve(J, residual(y))
    return modal.origin + modal.T @ y


def test_a_lever_moves_the_force_along_the_axis() -> None:
    """A spring at +3 mm without a moment is that of gears that stand 3 mm further up, on tilting shafts."""
    flat = {"stiffness": K, "transmission_error": wave(0.0, 0.0)}
    none = wave(0.0, 0.0)
    moved = build_train(helical_pair(**flat, tilting=Tilting(wave(3e-3, 0.0), none, 0.0)))
    further = build_train(helical_pair(**flat, along=0.013))
    one, two = bearing_forces(moved, settled(moved)), bearing_forces(further, settled(further))
    for bore, force in one.items():
        np.testing.assert_allclose(force, two[bore], rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_moment_loads_the_bearings_as_a_couple(sense: float) -> None:
    """m against the tilts: each bearing of a shaft has m/span along the line of action, and the tilt yields to it."""
    flat = {"stiffness": K, "transmission_error": wave(0.0, 0.0), "sense": sense}
    loads = []
    for moment in (0.0, 12.0):
        tilting = Tilting(wave(0.0, 0.0), wave(moment, 0.0), 0.0)
        model = build_train(helical_pair(**flat, tilting=tilting))
        loads.append((bearing_forces(model, settled(model)), model))
    (without, _), (with_moment, model) = loads
    n = model.meshes[0].direction
    for bore, sign in (("s0 high", -1.0), ("s0 low", 1.0), ("s1 high", 1.0), ("s1 low", -1.0)):
        change = (with_moment[bore] - without[bore])[[0, 2]]
        np.testing.assert_allclose(change, sign * 12.0 / SPAN * n[[0, 2]], rtol=1e-5, atol=1e-4)
    # the reports of misalignments have the same place
    q = static_state(model)
    assert q is not None
    for bore, force in bearing_forces(model, q).items():
        np.testing.assert_allclose(force, with_moment[bore], rtol=1e-5, atol=1e-3)


def test_a_stiffness_against_tilting_takes_its_share() -> None:
    """Misalignment under a moment: bearings and mesh are springs beside each other."""
    found = {}
    for against in (0.0, AGAINST):
        gammas = []
        for moment in (0.0, 12.0):
            tilting = Tilting(wave(0.0, 0.0), wave(moment, 0.0), against)
            train = helical_pair(
                along=0.5 * (HIGH + LOW), stiffness=K, transmission_error=wave(0.0, 0.0), tilting=tilting
            )
            (mesh,) = misalignments(build_train(train))
            gammas.append(mesh.in_plane)
        found[against] = (gammas[1] - gammas[0]) / -12.0
    # flexibilities: 1/c = 1/c_bearings, and (c_bearings + kappa) with the mesh
    assert 1.0 / found[AGAINST] - 1.0 / found[0.0] == pytest.approx(AGAINST, rel=1e-6)
    assert found[0.0] > 0.0


def test_transient_and_harmonic_balance_agree() -> None:
    """Two formulations: compiled recurrences over time, and forces with derivatives over the phases."""
    speed = 700.0
    train = tilting_pair(speed=speed, damping=3000.0)
    train = dataclasses.replace(train, damping=dataclasses.replace(train.damping, ratio=0.06))
    model = build_train(train)
    state = steady_state(model, speed, tolerance=1e-7)
    theta = state.lattice.theta[:, 0]
    times = (120 + theta / (2.0 * math.pi)) * PITCH / speed
    run = simulate(model, np.concatenate([[0.0], times]), tolerance=1e-9)
    np.testing.assert_allclose(run.contact_force[1:, 0], state.force[:, 0], rtol=2e-4)
    moved = run.transmission_error[1:, 0]
    np.testing.assert_allclose(moved, state.transmission_error[:, 0], atol=1e-4 * np.ptp(moved))
    bare = steady_state(build_train(tilting_pair((2e-3, 0.0), (5.0, 0.0), speed=speed, damping=3000.0)), speed)
    # what moves along the width shakes the bearings
    swings = [np.abs(one.bearing[1:]).max() for one in (state, bare)]
    assert swings[0] != pytest.approx(swings[1], rel=0.02)


def test_derivatives_of_the_forces() -> None:
    """By finite differences, at places on both sides of the touch."""
    model = build_train(tilting_pair(backlash=40e-6, damping=500.0, damping_acts="in_contact"))
    forces = condense(model).forces
    m = condense(model).system.linear.size
    rng = np.random.default_rng(3)
    scale = np.array([1e-5] * m)
    u, du = scale * rng.normal(size=(6, m)), np.zeros((6, m))
    theta = rng.uniform(0.0, 6.0, size=(6, 1))
    found, _ = slopes_of(forces(theta, 100.0, u, du))
    for i in range(m):
        step = 1e-10 * np.eye(m)[i]
        low, high = (forces(theta, 100.0, u + sign * step, du).value for sign in (-1.0, 1.0))
        np.testing.assert_allclose(found[:, :, i], (high - low) / 2e-10, rtol=1e-4, atol=1e-4 * np.abs(found).max())
    assert model.forces.flanks[0].tilt >= 0


def test_energy_is_kept_at_a_fixed_phase() -> None:
    """Hardly turning, undamped: 1/2 k (delta + l gamma - e)^2 + m gamma + 1/2 kappa gamma^2 beside the rest."""
    train = tilting_pair(speed=1e-6, torque=TORQUE)
    train = dataclasses.replace(
        train, bearings=tuple(dataclasses.replace(b, damping=(0.0,) * 5) for b in train.bearings),
        drive=dataclasses.replace(train.drive, speed=constant(1e-6)),
        damping=dataclasses.replace(train.damping, gyroscopic=False),
    )  # fmt: skip
    model = build_train(train)
    (line,), (given,) = model.meshes, train.meshes
    times = np.linspace(0.0, 3e-3, 12001)
    moved = train_states(model, integrate(model.system, times, method="taylor", tolerance=1e-11, start=model.start))
    assert given.tilting is not None
    assert given.transmission_error is not None
    phase = np.array([line.phase])
    lever = given.tilting.lever(phase).value - given.tilting.lever.mean
    gamma = moved.q @ line.tilt
    bent = moved.q @ line.row + lever * gamma - given.transmission_error(phase).value
    k = float(line.curve(phase).value[0]) if line.curve is not None else math.nan
    square = line.mean * np.outer(line.row, line.row)
    elastic = 0.5 * k * bent**2 + given.tilting.moment(phase).value * gamma
    elastic += 0.5 * np.einsum("ti,ij,tj->t", moved.q, model.system.stiffness - square, moved.q)  # kappa is in it
    kinetic = 0.5 * np.einsum("ti,ij,tj->t", moved.v, model.system.mass, moved.v)
    work = moved.q @ sum(direction * float(f(0.0)) for direction, f in model.torques)
    total = kinetic + elastic - work
    assert np.ptp(gamma) > 1e-7
    assert np.ptp(total) < 1e-7 * np.ptp(kinetic) + 1e-12


def test_a_spur_spring_without_tilting_has_no_direction_for_it() -> None:
    model = build_train(helical_pair(beta=0.0, stiffness=wave(K, 0.1 * K)))
    assert [flank.tilt for flank in model.forces.flanks] == [-1]


def test_tilting_needs_the_phases_of_the_error() -> None:
    tilting = Tilting(wave(0.0, 0.0, count=10), wave(0.0, 0.0, count=10), 0.0)
    with pytest.raises(InputError, match="must have the phases of the transmission error"):
        build_train(helical_pair(stiffness=K, transmission_error=wave(0.0, 0.0), tilting=tilting))


def test_back_flanks_along_the_width_are_a_mirror_image() -> None:
    """A load that presses the back flanks: the approach is that of the driving ones at the mirrored phase, behind j."""
    made = {}
    for torque in (TORQUE, -TORQUE):
        train = tilting_pair((0.0, 0.0), (0.0, 0.0), backlash=40e-6, torque=torque)
        angle = np.linspace(0.0, PITCH, 7)
        (made[torque],) = static_errors(train, angle if torque > 0.0 else -angle)
        made[torque, "force"] = build_train(train).kinematics.steady_forces[0]
    assert made[TORQUE, "force"] == pytest.approx(-made[-TORQUE, "force"])
    np.testing.assert_allclose(made[-TORQUE], -40e-6 - made[TORQUE], rtol=1e-12)
    model = build_train(tilting_pair((0.0, 0.0), (0.0, 0.0), backlash=40e-6))
    driving, back = model.meshes[0].flanks
    np.testing.assert_allclose(back.error.values, driving.error.values, rtol=1e-12)
