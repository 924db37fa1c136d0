"""Meshes with given stiffness and static transmission error: closed forms, an integration by scipy, tables."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearfe.base.errors import InputError
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import build_train, simulate
from gearfe.drivetrain.train.model import TrainModel
from gearfe.drivetrain.train.statics import static_errors
from gearfe.gears.gearmesh.mesh_table import read_mesh_table
from gearfe.gears.gearmesh.periodic import PeriodicInterpolant, on_common_nodes, periodic_interpolant
from gearfe.multibody import constant
from tests.makers.trains import base_radius, changed, curve, train

K, TEETH, ERROR, TORQUE = 2e8, 20, 3e-6, -80.0
PITCH = 2.0 * math.pi / TEETH


def sinusoid(amplitude: float = ERROR, mean: float = 0.0, count: int = 400) -> PeriodicInterpolant:
    phase = PITCH * np.arange(count) / count
    return periodic_interpolant(phase, mean + amplitude * np.cos(TEETH * phase), PITCH)


def model(speed: float, ratio: float, error: PeriodicInterpolant | None, **mesh: object) -> tuple[TrainModel, float]:
    """One mesh, prescribed driver, driven gear on rigid axes, and its mass on the line of action (kg)."""
    gear_train = train([(TEETH, 30)], stiffness=mesh.pop("stiffness", K))
    gear_train = changed(gear_train, drive=dataclasses.replace(gear_train.drive, speed=constant(speed)))
    load = dataclasses.replace(gear_train.loads[0], torque=constant(-TORQUE))
    gear_train = changed(gear_train, loads=(load,))
    mass = build_train(gear_train).shafts[1].rotor.polar / base_radius(30) ** 2
    damping = 2.0 * ratio * math.sqrt(K * mass)
    given = dataclasses.replace(gear_train.meshes[0], damping=damping, transmission_error=error, **mesh)
    return build_train(changed(gear_train, meshes=(given,))), mass


def closed_form(speed: float, ratio: float, mass: float) -> complex:
    """Amplitude of m x'' + c (x' - e') + k (x - e) = F under e = Re E exp(i omega t): E (k + i omega c)/(k - m omega^2
    + i omega c)."""
    omega, c = TEETH * speed, 2.0 * ratio * math.sqrt(K * mass)
    return ERROR * (K + 1j * omega * c) / (K - mass * omega**2 + 1j * omega * c)


@pytest.mark.parametrize("part", [0.4, 0.97, 1.8])
def test_a_sinusoidal_error_of_a_constant_stiffness_is_base_excitation(part: float) -> None:
    """Amplitude and phase in the transient's steady state and in harmonic balance; the mean is F/k."""
    ratio = 0.08
    _, mass = model(100.0, ratio, None)
    speed = part * math.sqrt(K / mass) / TEETH
    made, _ = model(speed, ratio, sinusoid())
    expected, static = closed_form(speed, ratio, mass), -TORQUE / base_radius(30) / K
    period = PITCH / speed
    times = (60 + np.arange(65) / 64) * period
    run = simulate(made, np.concatenate([[0.0], times]), tolerance=1e-9)
    moved = run.transmission_error[1:-1, 0]
    amplitude = 2.0 * np.mean(moved * np.exp(-1j * TEETH * speed * times[:-1]))
    assert abs(amplitude - expected) < 2e-4 * abs(expected)
    assert moved.mean() == pytest.approx(static, rel=2e-4)
    state = steady_state(made, speed, tolerance=1e-6)
    line = state.lines(state.transmission_error[:, 0])[1]
    assert abs(line - expected) < 2e-5 * abs(expected)
    # the contact force balances inertia and load: F = F0 - m x''
    force = state.lines(state.force[:, 0])[:2]
    assert force[1] == pytest.approx(mass * (TEETH * speed) ** 2 * expected, rel=1e-4)
    assert force[0] == pytest.approx(-TORQUE / base_radius(30), rel=1e-5)
    n = round(len(run.contact_force[1:-1]))
    assert 2.0 * np.mean(run.contact_force[1:-1, 0] * np.exp(-1j * TEETH * speed * times[:n])) == pytest.approx(
        mass * (TEETH * speed) ** 2 * expected, rel=1e-3
    )


def test_a_constant_error_moves_the_static_position_alone() -> None:
    shape = curve(TEETH, mean=K, swing=0.15)
    flat = sinusoid(0.0, 7e-6, 8)
    with_error, _ = model(400.0, 0.06, flat, stiffness=lambda _: shape)
    without, _ = model(400.0, 0.06, None, stiffness=lambda _: shape)
    one, two = (steady_state(made, 400.0, tolerance=1e-8) for made in (with_error, without))
    np.testing.assert_allclose(one.transmission_error, two.transmission_error + 7e-6, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(one.force, two.force, rtol=1e-6)
    assert abs(one.multipliers[0]) == pytest.approx(abs(two.multipliers[0]), rel=1e-9)
    angle = np.linspace(0.0, 1.0, 40)
    (static,), (nominal,) = (static_errors(made.train, angle) for made in (with_error, without))
    np.testing.assert_allclose(static, nominal + 7e-6, rtol=1e-12)


def test_the_error_brings_in_what_the_damper_takes() -> None:
    """From m x'' = F0 - F: the mean of -F e' is that of c (x' - e')^2."""
    speed, ratio = 900.0, 0.07
    made, mass = model(speed, ratio, sinusoid())
    state = steady_state(made, speed, tolerance=1e-7)
    c, omega, expected = 2.0 * ratio * math.sqrt(K * mass), TEETH * speed, closed_form(speed, ratio, mass)
    lost = 0.5 * c * omega**2 * abs(expected - ERROR) ** 2
    force, theta = state.force[:, 0], state.lattice.theta[:, 0]
    entering = np.mean(force * ERROR * omega * np.sin(theta))
    assert entering == pytest.approx(lost, rel=1e-4)


@pytest.mark.parametrize("acts", ["always", "in_contact"])
def test_teeth_that_part_under_an_error_against_scipy(acts: str) -> None:
    """x = delta - e with a clearance: m x'' = F - k g(x) - c x' - m e'' (Kahraman & Singh, J. Sound Vib. 142, 1990)."""
    backlash, ratio = 20e-6, 0.03
    _, mass = model(100.0, ratio, None)
    speed = 0.8 * math.sqrt(K / mass) / TEETH
    error = sinusoid(9e-6)
    shape = curve(TEETH, mean=K, swing=0.1)
    made, _ = model(speed, ratio, error, stiffness=lambda _: shape, backlash=backlash, damping_acts=acts)
    c, load = made.meshes[0].given.damping, -TORQUE / base_radius(30)
    end = 12 * PITCH / speed
    times = np.linspace(0.0, end, 400)
    run = simulate(made, times, tolerance=1e-9)
    start = run.transmission_error[0, 0]

    def rhs(t: float, y: np.ndarray) -> list[float]:
        phase = speed * t
        late, rise = (float(v) for v in error(phase))
        x, rate = y[0] - late, y[1] - speed * rise
        side = 1 if x > 0.0 else -1 if x < -backlash else 0
        force = float(shape(phase).value) * x if side > 0 else 0.0
        if side < 0:
            force = float(shape(-phase).value) * (x + backlash)
        damper = c * rate if acts == "always" or side else 0.0
        return [y[1], (load - force - damper) / mass]

    true = solve_ivp(rhs, (0, end), [start, 0.0], "DOP853", t_eval=times, rtol=1e-11, atol=1e-15, max_step=2e-7).y[0]
    assert (run.contact_force[:, 0] == 0.0).any() or acts == "always"
    assert run.statistics["share_without_contact"][0] > 0.01
    assert np.abs(run.transmission_error[:, 0] - true).max() < 2e-3 * np.abs(true).max()


def test_parting_teeth_in_harmonic_balance_are_those_of_the_transient() -> None:
    _, mass = model(100.0, 0.05, None)
    for acts in ("always", "in_contact"):
        speed = 0.55 * math.sqrt(K / mass) / TEETH
        made, _ = model(speed, 0.05, sinusoid(6e-6), backlash=100e-6, damping_acts=acts)
        state = steady_state(made, speed, tolerance=1e-5)
        theta = state.lattice.theta[:, 0]
        times = (150 + np.append(theta, theta[-1] + theta[1]) / (2.0 * math.pi)) * PITCH / speed
        run = simulate(made, np.concatenate([[0.0], times]), tolerance=1e-9)
        moved = run.transmission_error[1:-1, 0]
        np.testing.assert_allclose(moved, state.transmission_error[:, 0], atol=1e-3 * np.ptp(moved))
        assert state.apart[0] == pytest.approx(np.mean(run.contact_force[1:-1, 0] == 0.0), abs=0.02) or acts == "always"


def test_the_methods_agree() -> None:
    made, _ = model(700.0, 0.05, sinusoid(), backlash=50e-6)
    times = np.linspace(0.0, 2e-3, 60)
    one, two = (simulate(made, times, tolerance=1e-9, method=method) for method in ("taylor", "implicit"))
    np.testing.assert_allclose(one.transmission_error, two.transmission_error, atol=1e-10)


def test_interpolants_on_common_nodes_are_the_same_functions() -> None:
    rng = np.random.default_rng(4)
    one = periodic_interpolant(np.sort(rng.uniform(0.0, PITCH, 17)), rng.normal(size=17), PITCH, widest_gap=1.0)
    two = periodic_interpolant(np.sort(rng.uniform(0.0, PITCH, 9)), rng.normal(size=9), PITCH, widest_gap=1.0)
    phase = rng.uniform(-2.0, 2.0, 500)
    for a, b in zip((one, two.reversed()), on_common_nodes(one, two.reversed()), strict=True):
        np.testing.assert_allclose(b(phase).value, a(phase).value, atol=1e-12)
        np.testing.assert_allclose(b(phase).slope, a(phase).slope, atol=1e-9)
    np.testing.assert_allclose(two.reversed()(phase).value, -np.asarray(two(-phase).value), atol=1e-12)


def table(tmp_path: Path, header: str, rows: np.ndarray) -> Path:
    file = tmp_path / "mesh.csv"
    file.write_text(header + "\n" + "\n".join(",".join(repr(float(x)) for x in row) for row in rows) + "\n")
    return file


def test_a_loaded_error_and_an_unloaded_one_make_the_same_mesh(tmp_path: Path) -> None:
    """e = TE - F0/k, with the load as a force or as a torque; degrees and parts of the pitch, N/m and N/um."""
    part = np.arange(40) / 40
    k, e, force = 2e8 * (1 + 0.1 * np.cos(2 * np.pi * part)), 1e-6 * (2 + np.sin(2 * np.pi * part)), 1500.0
    one = np.column_stack([part, k, 1e6 * e])
    first = read_mesh_table(
        table(tmp_path, "fraction_of_pitch,k_mesh_N_per_m,transmission_error_unloaded_um", one), PITCH, 0.03
    )
    loaded = np.column_stack([360.0 / TEETH * part, 1e-6 * k, 1e6 * (e + force / k), np.full(40, 0.03 * force)])
    header = "driver_angle_deg,k_mesh_N_per_um,transmission_error_loaded_um,torque_driven_Nm"
    second = read_mesh_table(table(tmp_path, header, loaded), PITCH, 0.03)
    phase = np.linspace(-1.0, 1.0, 200)
    np.testing.assert_allclose(first.stiffness(phase).value, second.stiffness(phase).value, rtol=1e-9)
    np.testing.assert_allclose(
        first.transmission_error(phase).value, second.transmission_error(phase).value, atol=1e-14
    )


GOOD = "fraction_of_pitch,k_mesh_N_per_m,transmission_error_unloaded_um"
PART = np.linspace(0.0, 1.0, 21)
ROWS = np.column_stack([PART, 2e8 + 1e7 * np.cos(2 * np.pi * PART), np.sin(2 * np.pi * PART)])


@pytest.mark.parametrize(
    ("header", "rows", "says"),
    [
        (GOOD, ROWS + np.outer(PART > 0.99, [0.0, 0.0, 0.5]), "contradicts itself"),
        (GOOD, ROWS + np.outer(PART > 0.99, [0.0, 9e7, 0.0]), "contradicts itself"),
        (GOOD, ROWS * [1.0, -1.0, 1.0], "must be > 0"),
        (GOOD, ROWS[:9], "does not cover the mesh cycle"),
        (GOOD.replace("fraction_of_pitch", "angle"), ROWS, "unknown name 'angle'"),
        (GOOD.replace("_unloaded", "_loaded"), ROWS, "has no column mesh_force_N or torque_driven_Nm"),
        (GOOD + ",mesh_force_N", np.column_stack([ROWS, 0 * PART + 9.0]), "has no load"),
        (GOOD + ",transmission_error_loaded_um", np.column_stack([ROWS, PART]), "has both"),
        (GOOD.replace("k_mesh_N_per_m,", ""), ROWS[:, [0, 2]], "has no column k_mesh_N_per_m or k_mesh_N_per_um"),
        (GOOD, np.where(ROWS > 2.05e8, np.nan, ROWS), "has k_mesh_N_per_m = 'nan' in row 1"),
        (
            GOOD.replace("_unloaded", "_loaded") + ",mesh_force_N",
            np.column_stack([ROWS, 900.0 + PART]),
            "must have one mesh_force_N > 0 on all rows",
        ),
    ],
)
def test_mistakes_in_tables(header: str, rows: np.ndarray, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=says):
        read_mesh_table(table(tmp_path, header, rows), PITCH, 0.03)


def test_errors_of_another_pitch_or_beside_a_rigid_mesh_are_refused() -> None:
    made, _ = model(500.0, 0.05, sinusoid())
    wrong = periodic_interpolant([0.0, 0.1, 0.2, 0.3], [0.0, 1e-6, 0.0, 1e-6], 0.4)
    for changes, says in (
        ({"transmission_error": wrong}, "has a period of"),
        ({"stiffness": None, "damping": 0.0}, "rigid"),
    ):
        mesh = dataclasses.replace(made.train.meshes[0], **changes)
        with pytest.raises(InputError, match=says):
            build_train(changed(made.train, meshes=(mesh,)))


JOB = """
[pair]
module_mm = 2.5
pressure_angle_deg = 25.0
face_width_mm = 10.0
[pair.pinion]
teeth = 20
bore_diameter_mm = 10.0
[pair.wheel]
teeth = 30
bore_diameter_mm = 15.0
[train]
housing = "rigid"
shafts = [
    {{name = "in", x_mm = 0.0, length_mm = 60.0, radius_mm = 10.0, attachments = ["1", "2"]}},
    {{name = "out", x_mm = 62.5, length_mm = 60.0, radius_mm = 10.0, attachments = ["3", "4"]}},
]
gears = [
    {{name = "a", shaft = "in", gear = "pinion", y_mm = 0.0}},
    {{name = "b", shaft = "out", gear = "wheel", y_mm = 0.0}},
]
meshes = [{{driver = "a", driven = "b", {keys}}}]
drive = {{shaft = "in", attachment = "1", speed_rad_per_s = 100.0}}
rigid_bores = [
    {{attachment = "1", x_mm = 0.0, y_mm = 30.0}}, {{attachment = "2", x_mm = 0.0, y_mm = -30.0}},
    {{attachment = "3", x_mm = 62.5, y_mm = 30.0}}, {{attachment = "4", x_mm = 62.5, y_mm = -30.0}},
]
"""


def test_the_key_of_a_mesh_names_the_table(tmp_path: Path) -> None:
    table(tmp_path, GOOD, ROWS)
    job = tmp_path / "job.toml"
    job.write_text(JOB.format(keys='mesh_table = "mesh.csv"'))
    read = read_train_job(job)
    line = build_train(job_train(read, train_curves(read))).meshes[0]
    assert line.mean == pytest.approx(2e8, rel=1e-9)
    error = line.flanks[0].error
    assert float(error(PITCH / 4).value) == pytest.approx(1e-6, rel=1e-9)
    job.write_text(JOB.format(keys='mesh_table = "mesh.csv", stiffness_N_per_m = 1e8'))
    with pytest.raises(InputError, match="conflicts with mesh_table"):
        read_train_job(job)
