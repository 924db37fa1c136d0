"""Steady states of trains: against their own long transients, energy, modes, mistakes, the command."""

from __future__ import annotations

import dataclasses
import json
import math
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.drivetrain.modes.critical import crossings
from gearfe.drivetrain.modes.swinging import mesh_modes, swinging, write_modes
from gearfe.drivetrain.modes.whirl import train_modes
from gearfe.drivetrain.runup.condensed import condense
from gearfe.drivetrain.runup.orders import OrderCut
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.runup.stability import multipliers
from gearfe.drivetrain.train import Damping, build_train, simulate
from gearfe.drivetrain.train.friction import Lubrication
from gearfe.figures.campbell import signal_of
from gearfe.multibody import constant
from tests.makers.job_texts import SMALL_TRAIN
from tests.makers.mesh_laws import hertzian_law, numpy_law
from tests.makers.oscillators import analysis, rates, synthesis
from tests.makers.trains import loaded, smooth, train


def settled_transient(model, state, periods, samples=256, tolerance=1e-7):  # type: ignore[no-untyped-def]
    """Forces, approaches and accelerations over the last of many periods, from the same place as the state."""
    times = np.arange(periods * samples + 1) * state.period / samples
    made = simulate(model, times, tolerance=tolerance)
    last = slice(-samples - 1, -1)
    return made.contact_force[last], made.transmission_error[last], made.attachment_acceleration[last]


@pytest.mark.parametrize(
    ("stages", "stiffness", "speed", "backlash"),
    [
        ([(20, 30)], smooth, 600.0, None),
        ([(20, 30), (20, 30)], smooth, -500.0, None),
        pytest.param([(20, 30)], lambda teeth: hertzian_law(relief=4e-6), 700.0, 30e-6),
    ],
)
def test_steady_running_is_what_a_transient_comes_to(stages, stiffness, speed, backlash):
    """Elastic housing, gyroscopic moments, rotation that feeds back on the phase: all are in both."""
    model = build_train(loaded(stages, stiffness, speed=speed, backlash=backlash))
    state = steady_state(model, speed, tolerance=1e-4)
    force, error, acceleration = settled_transient(model, state, 60)
    samples = len(force)
    mine = synthesis(analysis(state.force)[: samples // 2], samples)
    assert np.abs(mine - force).max() < 2e-3 * np.abs(force).max()
    assert state.force.mean(axis=0) == pytest.approx(force.mean(axis=0), rel=1e-4)
    assert np.ptp(state.transmission_error, axis=0) == pytest.approx(np.ptp(error, axis=0), rel=1e-3)
    shared = slice(1, min(40, len(state.frequency)))
    lines = analysis(acceleration)[shared]
    assert np.abs(state.acceleration[shared] - lines).max() < 2e-3 * np.abs(lines).max()
    assert state.error <= 1e-4


def test_teeth_that_part_as_in_a_transient():
    law = hertzian_law(relief=6e-6)
    model = build_train(loaded([(20, 30)], lambda teeth: law, speed=1500.0, torque=15.0, ratio=0.02, flexible=False))
    peak = max(run_up(model, np.linspace(1100.0, 2200.0, 60), tolerance=1e-2).states, key=lambda s: s.apart[0])
    assert peak.apart[0] > 0.05
    state = steady_state(model, peak.speed, peak, tolerance=1e-3)
    gear_train = dataclasses.replace(
        model.train, drive=dataclasses.replace(model.train.drive, speed=constant(peak.speed))
    )
    force, error, _ = settled_transient(build_train(gear_train), state, 160)
    assert (force == 0.0).mean() == pytest.approx(state.apart[0], abs=0.01)
    assert np.ptp(state.transmission_error) == pytest.approx(np.ptp(error), rel=5e-3)
    assert state.force.max() == pytest.approx(force.max(), rel=5e-3)


def test_all_speeds_of_a_range_in_order_and_from_both_ends():
    model = build_train(loaded([(20, 30)], smooth))
    speeds = np.linspace(300.0, 900.0, 25)
    up, down = run_up(model, speeds), run_up(model, speeds[::-1])
    assert [s.speed for s in up.states] == speeds.tolist()
    assert not up.notes
    for one, two in zip(up.sweep(), down.sweep(up=False), strict=True):
        assert one.force.max() == pytest.approx(two.force.max(), rel=1e-3)


def test_pictures_of_a_housing_that_does_not_move_show_the_contact_force():
    """All its lines together are the rms of the force."""
    speeds = np.linspace(300.0, 900.0, 3)
    stiff, moving = (
        run_up(build_train(loaded([(20, 30)], smooth, flexible=x)), speeds, stability=False) for x in (False, True)
    )
    assert signal_of(moving, 0).unit == "m/s²"
    signal = signal_of(stiff, 0)
    assert signal.unit == "N"
    for state in stiff.states:
        rms = np.sqrt(0.5 * (signal.lines(state)[1:] ** 2).sum())
        assert rms == pytest.approx(state.force.std(), rel=1e-3)


def test_multipliers_by_an_executor_are_the_same():
    model, speeds = build_train(loaded([(20, 30)], smooth)), np.linspace(300.0, 900.0, 5)
    with ThreadPoolExecutor(2) as executor:
        beside = run_up(model, speeds, executor=executor)
    for one, two in zip(run_up(model, speeds).states, beside.states, strict=True):
        assert np.array_equal(one.multipliers, two.multipliers)


def test_the_work_of_the_mesh_goes_into_damping():
    """Power that the periodic forces put into the modes, against what their dampers take."""
    train_ = condense(build_train(loaded([(20, 30)], smooth)))
    system = train_.system
    state = steady_state(train_.model, 600.0, tolerance=1e-6)
    places, omega0 = state.orbit.places, 2 * math.pi / state.period
    count = state.orbit.harmonics
    samples = 16 * count
    u, du = synthesis(places, samples), synthesis(rates(places, omega0), samples)
    forces = system.forces(2 * math.pi * np.arange(samples)[:, None] / samples, 600.0, u, du).value
    omega = omega0 * np.arange(count + 1)
    modal = system.linear.modal(omega, 600.0, analysis(forces)[: count + 1])
    rate = 1j * omega[:, None] * modal
    taken = 0.5 * np.einsum("ki,ij,kj->", rate[1:].conj(), system.linear.damping, rate[1:]).real
    assert (forces * du).sum(axis=1).mean() == pytest.approx(taken, rel=1e-4)


def test_a_law_and_its_derivatives_are_those_of_its_potential():
    law = hertzian_law(relief=3e-6)
    rng = np.random.default_rng(5)
    phase, approach = rng.uniform(-2.0, 2.0, 300), rng.uniform(-2e-6, 5e-5, 300)

    shifts = rng.uniform(-1e-6, 1e-6, (300, law.slots))
    made, h = law(phase, approach, shifts), 1e-8
    force, moment, tangent, energy, pairs = numpy_law(law, phase, approach, shifts)
    assert np.allclose(made.force, force, rtol=1e-8, atol=1e-8)
    assert np.allclose(made.moment, moment, rtol=1e-8, atol=1e-10)
    assert np.allclose(made.tangent, tangent, rtol=1e-7, atol=1.0)
    assert np.allclose(made.energy, energy, rtol=1e-8, atol=1e-13)
    assert np.allclose(made.pair_forces, pairs, rtol=1e-8, atol=1e-8)
    begun = rng.uniform(0.0, 2e3, (300, law.slots))
    assert np.allclose(law(phase, approach, shifts, begin=begun).force, force, rtol=1e-8, atol=1e-8)
    assert np.allclose(begun, pairs, rtol=1e-8, atol=1e-8)  # whatever it begins with
    above, below = law(phase + h, approach, shifts), law(phase - h, approach, shifts)
    for value, slope in (("force", "cross"), ("moment", "bend")):
        true = (getattr(above, value) - getattr(below, value)) / (2 * h)
        off, size = np.abs(true - getattr(made, slope)), np.abs(getattr(made, slope)).max()
        assert np.median(off) < 1e-6 * size
        assert (off < 1e-4 * size).mean() > 0.98  # beside the places where pairs come and go


def test_campbell_frequencies_are_those_of_the_whole_train():
    """Against the eigenvalues of the train with its gyroscopic matrix, written down body by body."""
    model = build_train(loaded([(20, 30)], smooth))
    modes = train_modes(model, [200.0, 5000.0], 6000.0)
    modal = model.modal
    n = len(modal.eigenvalues)
    for speed, frequency in zip((200.0, 5000.0), modes.frequency, strict=True):
        gyro = np.zeros((len(modal.T), len(modal.T)))
        for first, ratio, shaft in zip(model.first, model.ratios, model.shafts, strict=True):
            gyro[first + 3, first + 4] = shaft.rotor.polar * ratio * speed
            gyro[first + 4, first + 3] = -shaft.rotor.polar * ratio * speed
        A = np.block(
            [[np.zeros((n, n)), np.eye(n)], [-np.diag(modal.eigenvalues), -modal.damping - modal.T.T @ gyro @ modal.T]]
        )
        exact = np.sort(np.abs(np.linalg.eigvals(A))[::1]) / (2 * math.pi)
        assert np.sort(frequency) == pytest.approx(exact[::2][: len(frequency)], rel=1e-6)
    assert np.abs(modes.frequency[0] - modes.frequency[1]).max() > 0.01
    assert modes.shares.sum(axis=2) == pytest.approx(1.0)


def test_modes_swing_as_fields(tmp_path):
    """Each mode by itself, at its natural frequency; gears stand still but for it; the size is the one that is told."""
    h5py = pytest.importorskip("h5py")
    model = build_train(loaded([(20, 30)], smooth))
    modes = train_modes(model, [1e-6], 6000.0)
    chosen = mesh_modes(modes, 0.5)
    assert (modes.mesh_strain[0, chosen, 0] >= 0.5).all()
    made = swinging(model, modes, [0, chosen[0]], 0.0, 8)
    assert made.time == pytest.approx(np.concatenate([1 + np.arange(8) / 8, chosen[0] + 1 + np.arange(8) / 8]))
    turn = made.gear_pose[:, :, 3:] @ model.train.frame[2]
    assert made.gear_pose[4] == pytest.approx(-made.gear_pose[0], abs=1e-12)
    assert made.gear_pose[9] == pytest.approx(made.gear_pose[8] / math.sqrt(2.0), abs=1e-12)
    rates = np.repeat(2 * math.pi * model.coupled_frequencies_hz[[0, chosen[0]]], 8)
    assert made.acceleration_absolute == pytest.approx(-((rates**2)[:, None]) * turn, rel=1e-9, abs=1e-6)
    write_modes(tmp_path, model, modes, chosen[:1], 0.0)
    with h5py.File(tmp_path / "mode_gears.vtkhdf") as file:
        root = file["VTKHDF"]
        assert root["Steps"]["Values"][:] == pytest.approx(chosen[0] + 1 + np.arange(16) / 16)
        moved = np.linalg.norm(root["PointData"]["displacement_m"][:], axis=1).max()
    assert 0.005 < moved / 0.2 < 0.03  # two gears of 50 and 75 mm


def test_critical_speeds_lie_where_orders_meet_modes():
    model = build_train(loaded([(20, 30)], smooth))
    modes = train_modes(model, np.linspace(200.0, 1500.0, 5), 4000.0)
    cuts = [OrderCut((a,), 20.0 * a, (f"{a} x mesh 1",), 0, a) for a in (1, 2, 3)]
    met = crossings(modes, cuts)
    assert met
    for c in met:
        assert c.frequency == pytest.approx(c.cut.multiple * 20 * c.speed / (2 * math.pi))
        assert c.frequency == pytest.approx(modes.at(c.speed)[c.mode], rel=1e-9)


@pytest.mark.parametrize(
    ("stages", "changes", "speeds", "words"),
    [
        ([(20, 30)], {}, [0.0, 100.0], "contain zero"),
        ([(20, 30)], {}, [-100.0, 100.0], "change sign"),
        ([(20, 30)], {}, [300.0, 200.0, 250.0], "do not rise or fall"),
        ([(20, 30)], {}, [-300.0], "turns against the drive"),
        ([(20, 30)], {"stiffness": None}, [300.0], "without a stiffness"),
        ([(23, 31), (29, 37), (41, 43), (47, 53)], {}, [300.0], "need 4 phases of their own, more than 3"),
    ],
)
def test_what_has_no_steady_state_is_told(stages, changes, speeds, words):
    model = build_train(train(stages, **changes))
    with pytest.raises(InputError, match=words):
        run_up(model, speeds)


def test_a_resonance_without_damping_is_told():
    """The response as far as it exists, on both sides."""
    model = build_train(loaded([(20, 30)], smooth, ratio=0.0, flexible=False))
    resonance = 2 * math.pi * model.coupled_frequencies_hz[-1] / 20
    made = run_up(model, resonance * np.array([0.8, 0.85, 0.9, 0.95, 1.0, 1.1, 1.2]))
    assert any("too little damping at a resonance" in note for note in made.notes)
    assert {0.8, 0.9, 1.1, 1.2} <= {round(s.speed / resonance, 6) for s in made.states}


def test_motions_that_turn_back_out_of_the_range_are_told_and_the_rest_is_found(monkeypatch):
    """As if the curve of the first motion left the range where it began; the way back of the next meets it there."""
    from gearfe.drivetrain.runup import run_up as module

    real, calls = module.follow, []

    def turning(system, speeds, start, **options):  # type: ignore[no-untyped-def]
        calls.append(float(speeds[0]))
        made = real(system, speeds, start, **options)
        short = {"orbits": made.orbits[:1], "branch": made.branch[:1], "turns": ()}
        return made if len(calls) > 1 else dataclasses.replace(made, **short)

    monkeypatch.setattr(module, "follow", turning)
    speeds = np.array([400.0, 450.0, 500.0])
    made = run_up(build_train(loaded([(20, 30)], smooth, ratio=0.05, flexible=False)), speeds)
    assert {s.speed for s in made.states} == set(speeds.tolist())
    assert calls == [400.0, 450.0, 450.0]
    assert [s.speed for s in made.states] == speeds.tolist()
    assert made.notes == (
        "the motions from 400 rad/s on turn back and leave the range where they began; others were looked for from "
        "450 rad/s on",
    )


def test_speeds_without_a_first_motion_are_reached_from_the_next_one_or_told(monkeypatch):
    from gearfe.drivetrain.runup import run_up as module

    real, failing = module.first_motion, {400.0, 450.0}
    monkeypatch.setattr(
        module,
        "first_motion",
        lambda system, speed, **options: None if speed in failing else real(system, speed, **options),
    )
    model = build_train(loaded([(20, 30)], smooth, ratio=0.05, flexible=False))
    made = run_up(model, [400.0, 450.0, 500.0])
    assert made.notes == ()
    assert [(s.speed, s.branch) for s in made.states] == [(400.0, 0), (450.0, 0), (500.0, 0)]
    one = steady_state(model, 400.0, made.states[1])
    assert made.states[0].force.max() == pytest.approx(one.force.max(), rel=1e-3)
    failing.add(500.0)
    (note,) = run_up(model, [400.0, 450.0, 500.0]).notes
    assert "no motion with the periods of the meshes was found at 3 speeds, 400 to 500 rad/s" in note


def test_a_light_load_within_a_resonance_is_found_on_all_its_branches():
    """Small motion from below, three motions at a time within, the large one alone above."""
    law = hertzian_law(2 * math.pi / 28, relief=4e-6)
    model = build_train(loaded([(28, 32)], lambda teeth: law, speed=340.0, torque=4.0, ratio=0.066, flexible=False))
    run = run_up(model, np.linspace(340.0, 460.0, 7))
    assert run.notes == ()
    found = {speed: [s for s in run.states if s.speed == speed] for speed in run.speeds.tolist()}
    assert [len(found[speed]) for speed in (340.0, 400.0, 460.0)] == [1, 3, 1]
    for speed, states in found.items():
        assert [s.stable for s in states] == [True, False, True][: len(states)]
        assert [bool(s.apart[0] > 0.4) for s in states] == (
            [speed > 450.0] if len(states) == 1 else [False, True, True]
        )
    force, error, _ = settled_transient(model, found[340.0][0], 40)  # from rest
    assert np.ptp(found[340.0][0].force, axis=0) == pytest.approx(np.ptp(force, axis=0), rel=2e-3)
    assert np.ptp(found[340.0][0].transmission_error) == pytest.approx(np.ptp(error), rel=2e-3)


RUNUP = """
[runup]
speed_start_rad_per_s = 500.0
speed_stop_rad_per_s = 700.0
speeds = 6
"""


@pytest.fixture
def job(tmp_path):  # type: ignore[no-untyped-def]
    rows = "\n".join(f"{18.0 * i / 12},{1e8 * (1 + 0.1 * math.cos(2 * math.pi * i / 12))}" for i in range(12))
    (tmp_path / "k.csv").write_text("pinion_angle_deg,k_mesh_N_per_m\n" + rows + "\n")
    text = SMALL_TRAIN.replace("stiffness_N_per_m = 1e8", 'curve = "k.csv"')

    def write(extra):  # type: ignore[no-untyped-def]
        path = tmp_path / "job.toml"
        path.write_text(text + extra)
        return path

    return write


def test_the_command_writes_tables_and_pictures(job, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["runup", str(job(RUNUP + "instability_loads = [0.5, 1.0]\n")), "--out", str(out), "--fields"]) == 0
    names = sorted(path.name for path in out.iterdir())
    assert names == [
        "bearing_forces.png", "campbell.png", "critical_speeds.csv", "instability.csv", "instability.png", "meshes.png",
        "mode_gears.vtkhdf", "modes.csv", "orders.csv", "orders.png",
        "runup.csv", "summary.json", "waterfall.csv", "waterfall.npz", "waterfall.png",
    ]  # fmt: skip
    table = np.genfromtxt(out / "runup.csv", delimiter=",", names=True)
    assert table["speed_rad_per_s"].tolist() == np.linspace(500.0, 700.0, 6).tolist()
    assert table["mean_force_1_N"] == pytest.approx(75.0 / (37.5e-3 * math.cos(math.radians(25.0))), rel=1e-3)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["speeds_reached"] == 6
    assert summary["largest_error_estimate"] <= 1e-3
    arrays = np.load(out / "waterfall.npz")
    assert arrays["acceleration_m_per_s2"].shape == (6, len(arrays["order"]), 4)
    lines = np.genfromtxt(out / "waterfall.csv", delimiter=",", names=True)
    means = lines[lines["order"] == 0.0]
    columns = [name for name in means.dtype.names if name.startswith("bearing_force_")]
    assert len(columns) == 3 * 4
    for name in columns:
        assert means[name] == pytest.approx(np.abs(table[f"mean_{name}"]), rel=1e-9, abs=1e-9)
        inside = (lines["order"] > 0.0) & (lines["frequency_Hz"] <= 5000.0) & (lines["speed_rad_per_s"] == 500.0)
        swings = math.sqrt(0.5 * float((lines[name][inside] ** 2).sum()))
        assert table[name.replace("force_", "force_rms_")][0] == pytest.approx(swings, rel=1e-6, abs=1e-9)
    assert "6 of 6 speeds" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("", "[runup]: is missing"),
        (RUNUP.replace("500.0", "-500.0"), "contains zero or changes sign"),
        (RUNUP.replace("500.0", "0.0"), "contains zero or changes sign"),
        (RUNUP.replace("500.0", "700.0"), "is the first speed, too"),
        (RUNUP + "tolerance = 0.5\n", "runup.tolerance"),
        (RUNUP + "harmonics = 5\n", "harmonics"),
    ],
)
def test_mistakes_in_a_job_are_told(job, capsys, extra, words):
    assert main(["runup", str(job(extra))]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(("friction", "backlash", "torque"), [(0.06, None, 60.0), (0.1, 20e-6, 2.0)])
def test_derivatives_of_the_forces(friction, backlash, torque):
    """Differences of the forces at random places, friction and both flanks included."""
    law = dataclasses.replace(hertzian_law(relief=4e-6), back=hertzian_law(relief=1e-6, cells=10))
    gear_train = loaded([(20, 30)], lambda teeth: law, torque=torque, backlash=backlash)
    gear_train = dataclasses.replace(
        gear_train, meshes=(dataclasses.replace(gear_train.meshes[0], friction=friction, damping=500.0),)
    )
    system = condense(build_train(gear_train)).system
    m, rng = system.linear.size, np.random.default_rng(2)
    assert m == (4 if backlash is None else 6)
    theta = np.linspace(0.0, 2 * math.pi, 200, endpoint=False)[:, None]
    u = system.linear.rest() + 0.5 * system.scale * rng.normal(size=(200, m))
    du = 600.0 * system.scale * rng.normal(size=(200, m))
    at = system.forces(theta, 600.0, u, du)
    for j in range(m):
        h = 1e-5 * system.scale[j]
        step = h * np.eye(m)[j]
        for rate, change in enumerate(((step, 0.0), (0.0, 600.0 * step))):
            made = np.zeros((200, m, m))
            of_rates = at.by.freedoms // m == rate
            made[:, at.by.forces[of_rates], at.by.freedoms[of_rates] % m] = at.by.values[:, of_rates]
            above = system.forces(theta, 600.0, u + change[0], du + change[1]).value
            below = system.forces(theta, 600.0, u - change[0], du - change[1]).value
            width = 2 * h * (600.0 if rate else 1.0)
            size = max(np.abs(made[:, :, j]).max(), 1e-6 * np.abs(at.value).max() / width)
            off = np.abs((above - below) / width - made[:, :, j]).max(axis=1) / size
            assert np.median(off) < 1e-6
            assert (off < 1e-3).mean() > 0.97  # beside the places where pairs come and go


def test_friction_as_in_a_transient():
    gear_train = loaded([(20, 30)], lambda teeth: hertzian_law(relief=4e-6), speed=700.0)
    gear_train = dataclasses.replace(gear_train, meshes=(dataclasses.replace(gear_train.meshes[0], friction=0.08),))
    model, free = (
        build_train(gear_train),
        build_train(loaded([(20, 30)], lambda teeth: hertzian_law(relief=4e-6), speed=700.0)),
    )
    state, without = (steady_state(m, 700.0, tolerance=3e-4) for m in (model, free))
    force, error, acceleration = settled_transient(model, state, 60)
    assert state.force.mean(axis=0) == pytest.approx(force.mean(axis=0), rel=2e-4)
    assert np.ptp(state.transmission_error) == pytest.approx(np.ptp(error), rel=3e-3)
    lines = analysis(acceleration)[1:12]
    off = np.abs(state.acceleration[1:12] - lines).max()
    assert off < 3e-3 * np.abs(lines).max()
    assert off < 0.1 * np.abs(state.acceleration[1:12] - without.acceleration[1:12]).max()  # friction shows


def test_friction_of_an_oil_follows_the_speed():
    """Models built for two speeds rub alike at the same one."""
    oil = Lubrication(viscosity=0.04, roughness=0.4e-6)
    made = []
    for built in (400.0, 800.0):
        gear_train = loaded([(20, 30)], lambda teeth: hertzian_law(), speed=built, flexible=False)
        gear_train = dataclasses.replace(gear_train, meshes=(dataclasses.replace(gear_train.meshes[0], friction=oil),))
        made.append(steady_state(build_train(gear_train), 600.0))
    assert made[0].force == pytest.approx(made[1].force, rel=1e-6)
    system = condense(build_train(gear_train)).system  # processes of an executor get it, too
    again = pickle.loads(pickle.dumps(system))
    assert np.array_equal(multipliers(again, made[1].orbit), multipliers(system, made[1].orbit))


def test_rayleigh_damping_of_a_law_as_in_a_transient():
    """It acts in contact only; the constant damper that keeps the modes apart is taken off by the forces."""
    gear_train = loaded([(20, 30)], lambda teeth: hertzian_law(relief=4e-6), speed=700.0, flexible=False)
    model = build_train(dataclasses.replace(gear_train, damping=Damping(beta=3e-6)))
    state = steady_state(model, 700.0, tolerance=1e-4)
    force, error, _ = settled_transient(model, state, 60)
    assert np.count_nonzero(model.modal.damping - np.diag(np.diag(model.modal.damping))) == 0
    assert np.ptp(state.force, axis=0) == pytest.approx(np.ptp(force, axis=0), rel=2e-3)
    assert np.ptp(state.transmission_error) == pytest.approx(np.ptp(error), rel=1e-3)


@pytest.mark.slow
def test_a_step_along_the_curve_does_not_end_on_another_one(tmp_path):
    """The template from 100 rad/s up: a long step went from 325 to 346 rad/s, and the walk to and fro without end."""
    job = tmp_path / "runup.toml"
    assert main(["new", "runup", str(job)]) == 0
    options = ["--set", "runup.speed_start_rad_per_s=100.0", "--no-pictures", "--out", str(tmp_path / "out")]
    assert main(["runup", str(job), *options]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["speeds_reached"] == 100
    rows = np.genfromtxt(tmp_path / "out" / "runup.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    turning = set(summary["turning_speeds_rad_per_s"])
    assert len(turning) == rows["branch"].max()  # branches count from 0; one between near turns may have no speed asked
    asked = np.linspace(100.0, 1200.0, 100)
    for branch in set(rows["branch"]):  # between two turning points the speed rises or falls
        speeds = rows["speed_rad_per_s"][rows["branch"] == branch]
        speeds = speeds[np.abs(speeds[:, None] - asked).min(axis=1) < 1e-6]
        assert (np.diff(speeds) > 0.0).all() or (np.diff(speeds) < 0.0).all()
