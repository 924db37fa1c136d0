"""Steady states with several phases: sampling, one phase against two, long transients, multipliers, the command."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.drivetrain.runup import torus
from gearfe.drivetrain.runup.balance import Orbit, Oscillator, settled, solve
from gearfe.drivetrain.runup.condensed import CondensedTrain, condense
from gearfe.drivetrain.runup.instability import instability_map
from gearfe.drivetrain.runup.linear import Linear
from gearfe.drivetrain.runup.orders import order_columns, orders
from gearfe.drivetrain.runup.report import phases, warnings, waterfall
from gearfe.drivetrain.runup.results import SteadyState, steady_result
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.runup.stability import multipliers, window
from gearfe.drivetrain.train import TrainModel, build_train, simulate
from gearfe.drivetrain.train.kinematics import mesh_phases
from tests.makers.mesh_laws import hertzian_law
from tests.makers.oscillators import pushes
from tests.makers.trains import loaded, smooth

HUNTING = [(17, 53), (19, 61)]


@pytest.mark.parametrize("periods", [(1.0,), (1.0, 2.79), (1.0, 0.4), (1.0, 2.8, 7.9)])
@pytest.mark.parametrize("count", [16, 61, 150])
def test_samples_hold_the_harmonics(periods: tuple[float, ...], count: int) -> None:
    """Values at the places are the sum of the waves, and give the amplitudes back; with one phase also beside waves of
    less than thrice the order.
    """
    rng = np.random.default_rng(1)
    phases = torus.Phases.of(periods, (1,) * len(periods))
    waves, order = torus.harmonics(phases, count)
    made = torus.lattice(phases, count)
    a = rng.normal(size=(count + 1, 2)) + 1j * rng.normal(size=(count + 1, 2))
    a[0] = a[0].real
    values = (np.exp(1j * made.theta @ waves.T) @ a).real
    assert made.synthesis(a) == pytest.approx(values, abs=1e-9)
    others = torus.below(phases, 3.0 * order[-1] if len(periods) == 1 else 0.0).waves[count + 1 :]
    more = (np.exp(1j * made.theta @ others.T) @ rng.normal(size=(len(others), 2))).real
    assert made.analysis(values + more)[: count + 1] == pytest.approx(a, abs=1e-9)
    assert (np.diff(order) >= -1e-9).all()
    assert (waves / np.array(periods)).sum(axis=1).min() == 0.0
    assert len({tuple(k) for k in waves.tolist()} | {tuple(k) for k in (-waves).tolist()}) == 2 * count + 1


def test_slow_meshes_make_multiples_but_few_combinations() -> None:
    """Stages 23/67, 13/76, 14/87: all multiples up to eight of the fastest, and pairs of the first few of each mesh."""
    cycles = [23.0, 23.0 * 13.0 / 67.0, 23.0 * 13.0 * 14.0 / 67.0 / 76.0]
    phases = torus.Phases.of(tuple(cycles[0] / each for each in cycles), (1, 1, 1))
    waves = {tuple(k) for k in torus.below(phases, 8.0).waves.tolist()}
    for axis, period in enumerate(phases.periods):
        for k in range(1, math.ceil(8.0 * period)):
            assert tuple(k * (i == axis) for i in range(3)) in waves
    assert {(1, 1, 0), (1, -1, 0), (0, 1, 1), (1, 0, -1), (2, 1, 0), (1, 2, 0), (0, 1, 2)} <= waves
    assert len(waves) < 1.2 * 8.0 * sum(phases.periods)


def test_phases_of_meshes() -> None:
    """Meshes of one frequency or a small ratio share a phase, hunting teeth have their own."""
    shipped = [Fraction(20), Fraction(40, 3)]
    assert mesh_phases(shipped, 12) == [(Fraction(3, 20), [0, 1])]
    assert mesh_phases(shipped, 2) == [(Fraction(1, 20), [0]), (Fraction(3, 40), [1])]
    assert mesh_phases([Fraction(17), Fraction(17 * 19, 53), Fraction(17)], 12) == [
        (Fraction(1, 17), [0, 2]), (Fraction(53, 17 * 19), [1]),
    ]  # fmt: skip


def driven(load: float, cubic: float, damping: float, swings: tuple[float, float], slow: float) -> Oscillator:
    """``x'' + 2 z x' + x + c x^3 = load + a cos(theta_1) + b cos(theta_2)``, the second phase `slow` times slower."""

    def forces(theta, speed, u, du):  # type: ignore[no-untyped-def]
        x = u[:, 0]
        push = np.cos(theta) @ np.array(swings) - cubic * x**3
        return pushes(push, -3.0 * cubic * x**2)

    one = np.ones((1, 1))
    linear = Linear(np.ones(1), 2.0 * damping * one, one, load * np.ones(1))
    return Oscillator(linear, forces, (1.0, slow), np.ones(1), ((1, 0), (0, 1)))


def found(system: Oscillator, speed: float, tolerance: float) -> Orbit:
    guess = np.zeros((system.harmonics(speed, 0.0) + 1, system.linear.size), dtype=complex)
    guess[0] = system.linear.rest()
    return settled(system, *solve(system, speed, guess, tolerance), tolerance)


def at_times(system: Oscillator, orbit: Orbit, times: np.ndarray) -> np.ndarray:
    """Freedoms of an orbit."""
    return (np.exp(1j * np.outer(times, system.omega(orbit.speed, orbit.harmonics))) @ orbit.places).real


def test_duffing_under_two_forces_whose_frequencies_share_no_period() -> None:
    """Against DOP853 after the start has died out."""
    slow, speed = math.sqrt(5.0), 1.7
    system = driven(0.2, 0.1, 0.1, (0.8, 0.5), slow)
    orbit = found(system, speed, 1e-6)
    times = np.linspace(300.0, 400.0, 2001)

    def rhs(t, y):  # type: ignore[no-untyped-def]
        push = 0.2 + 0.8 * math.cos(speed * t) + 0.5 * math.cos(speed * t / slow)
        return [y[1], push - 0.2 * y[1] - y[0] - 0.1 * y[0] ** 3]

    run = solve_ivp(rhs, (0.0, 400.0), [0.0, 0.0], "DOP853", t_eval=times, rtol=1e-11, atol=1e-12)
    assert np.abs(at_times(system, orbit, times)[:, 0] - run.y[0]).max() < 1e-6
    combined = torus.numbers(system.phases, orbit.harmonics)[(1, 2)]
    assert abs(orbit.places[combined, 0]) > 1e-3


def test_growth_of_a_motion_that_never_repeats() -> None:
    """Divergence of a linear system is -2 z: growths of both exponents sum up to it, and DOP853 grows alike."""
    slow, e, z = math.sqrt(2.0), 0.4, 0.02

    def forces(theta, speed, u, du):  # type: ignore[no-untyped-def]
        k = e * np.cos(theta[:, 0]) + 0.1 * np.cos(theta[:, 1])
        return pushes(-k * u[:, 0], -k)

    one = np.ones((1, 1))
    system = Oscillator(
        Linear(np.ones(1), 2.0 * z * one, one, np.zeros(1)), forces, (1.0, slow), np.ones(1), ((1, 0), (0, 1))
    )
    span = window(system)
    assert span.half is not None
    calm, speed = 1.4, 2.05
    made = multipliers(system, found(system, calm, 1e-6))
    assert np.log(np.abs(made)).sum() * calm / (2.0 * math.pi * span.turns) == pytest.approx(-2.0 * z, rel=1e-6)
    made = multipliers(system, found(system, speed, 1e-6))
    time = span.turns * 2.0 * math.pi / speed

    def rhs(t, y):  # type: ignore[no-untyped-def]
        return [y[1], -2.0 * z * y[1] - (1.0 + e * math.cos(speed * t) + 0.1 * math.cos(speed * t / slow)) * y[0]]

    run = solve_ivp(rhs, (0.0, 400.0), [1.0, 0.0], "DOP853", t_eval=np.linspace(100.0, 400.0, 6001), rtol=1e-10)
    size = np.log(np.hypot(*run.y)).reshape(-1)
    grown = np.polyfit(run.t, size, 1)[0]
    assert abs(made[0]) > 1.0
    assert np.log(abs(made[0])) / time == pytest.approx(grown, rel=0.05)


def forces_at(train: CondensedTrain, orbit: Orbit, times: np.ndarray) -> np.ndarray:
    """Contact forces of the driving flanks at times, and how the freedoms move there."""
    system = train.system
    turning = 1j * system.omega(orbit.speed, orbit.harmonics)[:, None]
    wave = np.exp(times[:, None] * turning.T)
    u, du = (wave @ orbit.places).real, (wave @ (turning * orbit.places)).real
    theta = times[:, None] * abs(orbit.speed) / np.array(system.turns)
    made = []
    for line, numbers in zip(train.model.meshes, train.flanks_of_mesh, strict=True):
        force = train.forces.of_flanks(theta, orbit.speed, u, du)[numbers[0]].force
        made.append(force + (line.damping * du[:, train.forces.freedoms[numbers[0], 0]] if line.law is None else 0.0))
    return np.array(made).T


def state_of(train: CondensedTrain, speed: float, tolerance: float) -> SteadyState:
    system = train.system
    guess = np.zeros((system.harmonics(speed, 2.0 * math.pi * 5000.0) + 1, system.linear.size), dtype=complex)
    guess[0] = system.linear.rest()
    orbit = settled(system, *solve(system, speed, guess, tolerance), tolerance)
    assert orbit.found
    return steady_result(train, orbit, 0, multipliers(system, orbit))


@pytest.mark.parametrize(
    ("stages", "stiffness", "torque", "backlash"),
    [
        ([(20, 30), (20, 30)], smooth, 60.0, None),  # 3 cycles
        ([(21, 35), (25, 30)], smooth, 60.0, None),  # 7 cycles
        ([(20, 30), (20, 30)], smooth, 6.0, 30e-6),  # teeth that may part
        pytest.param(
            [(20, 30), (20, 30)], lambda teeth: hertzian_law(2 * math.pi / teeth, relief=4e-6), 60.0, 30e-6,
        ),
    ],
)  # fmt: skip
def test_one_phase_and_two_agree(
    stages: list[tuple[int, int]], stiffness: Callable[[int], object], torque: float, backlash: float | None
) -> None:
    """A train whose meshes share a period, by that and by a phase for each mesh: the same motion and multipliers."""
    speed = 600.0
    model = build_train(loaded(stages, stiffness, speed=speed, torque=torque, backlash=backlash))
    trains = [condense(model), condense(model, shared=1)]
    assert [len(t.system.turns) for t in trains] == [1, 2]
    one, two = (state_of(t, speed, 2e-4) for t in trains)
    times = one.period * np.arange(500) / 500
    forces = [forces_at(t, s.orbit, times) for t, s in zip(trains, (one, two), strict=True)]
    assert np.abs(forces[0] - forces[1]).max() < 4e-3 * np.abs(forces[0]).max()
    assert forces[1].mean(axis=0) == pytest.approx(forces[0].mean(axis=0), rel=2e-4)
    assert two.span == pytest.approx(one.period)
    assert one.multipliers is not None
    assert two.multipliers is not None
    assert np.abs(two.multipliers[:6]) == pytest.approx(np.abs(one.multipliers[:6]), rel=2e-3)


def test_one_phase_and_two_agree_in_rms_and_orders() -> None:
    model = build_train(loaded([(21, 35), (25, 30)], smooth, speed=600.0))
    one, two = (state_of(condense(model, shared=n), 600.0, 1e-4) for n in (12, 1))
    assert two.rms(5000.0) == pytest.approx(one.rms(5000.0), rel=2e-3)
    assert (two.force.min(axis=0) < 1.001 * one.force.min(axis=0)).all()  # at all places of the teeth to each other
    for waves, number in (((1, 0), 7), ((0, 1), 5), ((1, -1), 2), ((1, 1), 12)):
        at = two.numbers[waves]
        assert two.order[at] == pytest.approx(one.order[number])
        assert np.abs(two.acceleration[at]) == pytest.approx(np.abs(one.acceleration[number]), rel=0.02)


def settled_forces(model: TrainModel, begin: float, length: float, count: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Times after the start has died out, and contact forces of a transient there."""
    times = begin + length * np.arange(count) / count
    made = simulate(model, np.concatenate([[0.0], times]), tolerance=1e-8)
    return times, made.contact_force[1:]


@pytest.mark.parametrize(
    ("stages", "stiffness", "torque", "bound"),
    [
        (HUNTING, smooth, 60.0, 5e-4),
        (HUNTING, lambda teeth: hertzian_law(2 * math.pi / teeth, relief=4e-6), 60.0, 5e-3),
        ([*HUNTING, (23, 59)], smooth, 60.0, 2e-3),
    ],
)
def test_hunting_teeth_run_as_in_a_long_transient(
    stages: list[tuple[int, int]], stiffness: Callable[[int], object], torque: float, bound: float
) -> None:
    """Forces at all times, their spectrum at the combinations, least force."""
    speed = 600.0
    model = build_train(loaded(stages, stiffness, speed=speed, torque=torque, ratio=0.05, flexible=False))
    train = condense(model)
    assert len(train.system.turns) == len(stages)
    state = steady_state(model, speed, tolerance=5e-4)
    times, force = settled_forces(model, 0.1, 0.08)
    mine = forces_at(train, state.orbit, times)
    assert np.abs(mine - force).max() < bound * np.abs(force).max()
    assert mine.mean(axis=0) == pytest.approx(force.mean(axis=0), rel=1e-4)
    assert state.force.min(axis=0) == pytest.approx(force.min(axis=0), rel=0.02)
    assert state.stable
    # spectrum: both records at the frequencies of the combinations, by least squares over all lines
    lines = np.argsort(-np.abs(state.lines(state.force)).max(axis=1))[:40]
    omega = 2 * math.pi * state.frequency[lines]
    basis = np.hstack([np.cos(np.outer(times, omega)), np.sin(np.outer(times, omega))])
    theirs, ours = (np.linalg.lstsq(basis, x, rcond=None)[0] for x in (force, mine))
    assert np.abs(theirs - ours).max() < bound * np.abs(force).max()


def test_a_run_up_tells_its_phases_and_combinations() -> None:
    """Order cuts of hunting teeth by name; all tables are written."""
    model = build_train(loaded(HUNTING, smooth, speed=500.0, flexible=False))
    run = run_up(model, np.linspace(500.0, 600.0, 4))
    assert [x["meshes"] for x in phases(run)] == [["d0-g0"], ["d1-g1"]]
    assert [s.stable for s in run.states] == [True] * 4
    cuts = orders(run, 3)
    ratio = 19.0 / 53.0  # of the second mesh frequency to the first
    told = {cut.names[0]: cut.order / 17.0 for cut in cuts}
    assert told == {
        name: pytest.approx(abs(a + b * ratio)) for name, a, b in (
            ("1 x mesh 1", 1, 0), ("2 x mesh 1", 2, 0), ("3 x mesh 1", 3, 0),
            ("1 x mesh 2", 0, 1), ("2 x mesh 2", 0, 2), ("3 x mesh 2", 0, 3),
            ("1 x mesh 1 + 1 x mesh 2", 1, 1), ("1 x mesh 1 - 1 x mesh 2", 1, -1),
            ("2 x mesh 1 + 1 x mesh 2", 2, 1), ("2 x mesh 1 - 1 x mesh 2", 2, -1),
            ("1 x mesh 1 + 2 x mesh 2", 1, 2), ("1 x mesh 1 - 2 x mesh 2", 1, -2),
        )
    }  # fmt: skip
    assert sorted(cut.order for cut in cuts) == [cut.order for cut in cuts]
    assert not [sentence for sentence in warnings(run) if "stable" in sentence]
    columns = order_columns(run, 3)
    assert len(columns["order"]) == 12 * len(run.states)
    made = waterfall(run)
    assert (np.diff(made["order"]) > 0.0).all()
    for row, state in enumerate(run.states):
        inside = np.isfinite(made["frequency_Hz"][row])
        assert inside.sum() == (state.frequency <= run.band_hz).sum()
        assert made["frequency_Hz"][row, inside] == pytest.approx(
            state.speed / (2 * math.pi) * (made["harmonic"][inside] @ np.array([17.0, 17.0 * ratio])), abs=1e-6
        )


def test_no_map_of_instability_where_phases_never_return() -> None:
    model = build_train(loaded([(17, 53), (19, 61), (23, 59)], smooth, speed=500.0, flexible=False))
    with pytest.raises(InputError, match="share no period of up to 200 mesh cycles"):
        instability_map(condense(model), [500.0], [1.0])


SHAFT = """
[[train.shafts]]
name = "s{0}"
x_mm = {1}
length_mm = 82.0
radius_mm = 10.0
attachments = ["{0}a", "{0}b"]
[[train.rigid_bores]]
attachment = "{0}a"
x_mm = {1}
y_mm = 30.0
[[train.rigid_bores]]
attachment = "{0}b"
x_mm = {1}
y_mm = -30.0
"""
GEAR = """
[[train.gears]]
name = "{0}"
shaft = "s{1}"
y_mm = {2}
teeth = {3}
module_mm = 2.5
pressure_angle_deg = 25.0
face_width_mm = 10.0
bore_diameter_mm = 10.0
"""
MESH = """
[[train.meshes]]
driver = "d{0}"
driven = "g{0}"
curve = "k{0}.csv"
damping_N_s_per_m = 2000.0
"""
ENDS = """
[train.drive]
shaft = "s0"
attachment = "0a"
speed_rad_per_s = 500.0
[[train.loads]]
shaft = "s{0}"
attachment = "{0}a"
torque_Nm = {1}
[train.damping]
ratio = 0.03
[runup]
speed_start_rad_per_s = 500.0
speed_stop_rad_per_s = 600.0
speeds = 3
"""


def gearbox(folder: Path, stages: list[tuple[int, int]]) -> Path:
    """Job of a gearbox whose stages have own numbers of teeth, with a curve each, in a rigid housing."""
    text, x = '[train]\nhousing = "rigid"\n' + SHAFT.format(0, 0.0), 0.0
    for i, (one, two) in enumerate(stages):
        x += 0.5 * 2.5 * (one + two)
        y = 12.0 * (-1) ** i
        text += SHAFT.format(i + 1, x) + GEAR.format(f"d{i}", i, y, one) + GEAR.format(f"g{i}", i + 1, y, two)
        text += MESH.format(i)
        part = np.arange(12) / 12
        table = np.stack([360.0 / one * part, 1e8 * (1 + 0.1 * np.cos(2 * math.pi * part))], axis=1)
        np.savetxt(folder / f"k{i}.csv", table, delimiter=",", header="pinion_angle_deg,k_mesh_N_per_m", comments="")
    path = folder / "job.toml"
    path.write_text(text + ENDS.format(len(stages), -60.0 * (-1) ** len(stages)))
    return path


def test_the_command_runs_hunting_teeth(tmp_path: Path) -> None:
    """Tables, pictures, summary: all files; lines of the waterfall have the multiples of both phases."""
    out = tmp_path / "out"
    assert main(["runup", str(gearbox(tmp_path, HUNTING)), "--out", str(out)]) == 0
    assert {"waterfall.png", "campbell.png", "orders.png", "meshes.png"} <= {path.name for path in out.iterdir()}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["phases"] == [
        {"turns": pytest.approx(1 / 17), "meshes": ["d0-g0"]},
        {"turns": pytest.approx(53 / 17 / 19), "meshes": ["d1-g1"]},
    ]
    table = np.genfromtxt(out / "runup.csv", delimiter=",", names=True)
    assert table["stable"].tolist() == [1.0, 1.0, 1.0]
    lines = np.genfromtxt(out / "waterfall.csv", delimiter=",", names=True)
    order = 17.0 * lines["times_phase_1"] + 17.0 * 19.0 / 53.0 * lines["times_phase_2"]
    assert lines["order"] == pytest.approx(order, abs=1e-9)
    assert ((lines["times_phase_1"] != 0.0) & (lines["times_phase_2"] != 0.0)).any()
