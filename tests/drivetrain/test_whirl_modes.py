"""Whirl modes of turning trains: closed forms of rigid rotors, labels, modes that cross, symmetries."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.modes import energies
from gearfe.drivetrain.modes.critical import campbell, crossings
from gearfe.drivetrain.modes.job import ModesResult
from gearfe.drivetrain.modes.orders import train_orders
from gearfe.drivetrain.modes.report import warnings
from gearfe.drivetrain.modes.swinging import swinging, write_modes
from gearfe.drivetrain.modes.whirl import WhirlModes, train_modes
from gearfe.drivetrain.train import Bearing, Damping, Drive, GearTrain, Load, Shaft, ShaftGear, TrainModel, build_train
from gearfe.fem.beams import Section
from gearfe.multibody import constant
from tests.makers.trains import base_radius, elastic, gear, smooth, train

MASS, POLAR, TRANSVERSE, ARM = 8.0, 0.03, 0.09, 0.1
RADIAL, AXIAL = 4e7, 1e7
TWO_PI = 2.0 * math.pi
SPEEDS = np.linspace(0.0, 3000.0, 13)


def rotor(first: float = RADIAL, second: float = RADIAL, speed: float = 100.0, **changes: float) -> TrainModel:
    """A rigid rotor with its mass centre midway between two bearings, whose radial stiffnesses are given."""
    masses = {"mass": MASS, "polar_inertia": POLAR, "transverse_inertia": TRANSVERSE} | changes
    shaft = Shaft("rotor", (0.0, 0.0, 0.0), 0.3, 0.02, ("+", "-"), **masses)
    bearings = tuple(Bearing(name, (first, AXIAL, second, 0.0, 0.0)) for name in "+-")
    places = {"+": (0.0, ARM, 0.0), "-": (0.0, -ARM, 0.0)}
    drive = Drive("rotor", "+", constant(speed))
    return build_train(
        GearTrain((shaft,), (ShaftGear("disc", "rotor", 0.0, gear(40)),), (), drive, (), None, places, bearings)
    )


def tilting(speeds: np.ndarray, first: float = RADIAL, second: float = RADIAL, polar: float = POLAR) -> np.ndarray:
    """Tilt frequencies (Hz), the lower first: roots of J_t^2 w^4 - (J_t (K1 + K2) + J_p^2 W^2) w^2 + K1 K2."""
    K1, K2 = 2.0 * ARM**2 * first, 2.0 * ARM**2 * second
    b = TRANSVERSE * (K1 + K2) + (polar * speeds) ** 2
    root = np.sqrt(np.maximum(b**2 - 4.0 * TRANSVERSE**2 * K1 * K2, 0.0))
    return np.sqrt(np.array([b - root, b + root]) / (2.0 * TRANSVERSE**2)) / TWO_PI


def number_of(modes: WhirlModes, frequency: float) -> int:
    """Number of the mode whose frequency at the last speed is the given one."""
    return int(np.nanargmin(np.abs(modes.frequency[-1] - frequency)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_tilts_of_a_rigid_rotor_on_isotropic_bearings_split_by_the_gyroscopic_moment(sign: float) -> None:
    modes = train_modes(rotor(speed=100.0 * sign), sign * SPEEDS, 1e4)
    lower, upper = tilting(SPEEDS)
    half, still = POLAR * SPEEDS / (2 * TRANSVERSE), 2.0 * ARM**2 * RADIAL / TRANSVERSE
    np.testing.assert_allclose(upper, (half + np.sqrt(half**2 + still)) / TWO_PI, rtol=1e-12)
    assert modes.free == 0
    for curve, direction in ((lower, "backward"), (upper, "forward")):
        n = number_of(modes, curve[-1])
        np.testing.assert_allclose(modes.frequency[:, n], curve, rtol=1e-9)
        assert [row[n] for row in modes.direction] == [direction] * len(SPEEDS)
        assert modes.whirl[:, n, 0] == pytest.approx(1.0 if direction == "forward" else -1.0, abs=1e-6)
        assert modes.labels[-1][n] == f"{direction} whirl of shaft rotor"
        slope = np.gradient(curve, SPEEDS, edge_order=2)
        np.testing.assert_allclose(sign * modes.slope[1:-1, n], slope[1:-1], rtol=0.02)


def test_translation_and_axial_modes_stay_and_are_labelled() -> None:
    """The forward tilt crosses the two translations: each keeps its shape, and so its frequency."""
    modes = train_modes(rotor(), SPEEDS, 1e4)
    across, along = (math.sqrt(2.0 * k / MASS) / TWO_PI for k in (RADIAL, AXIAL))
    upper = tilting(SPEEDS)[1]
    assert upper[0] < across < upper[-1]
    constant_ones = np.flatnonzero(np.ptp(modes.frequency, axis=0) < 1e-6)
    np.testing.assert_allclose(sorted(modes.frequency[0, constant_ones]), sorted([along, across, across]), rtol=1e-9)
    axial = number_of(modes, along)
    assert modes.labels[-1][axial] == "axial"
    assert modes.direction[-1][axial] == "none"
    assert modes.share("axial")[:, axial] == pytest.approx(1.0, abs=1e-9)
    assert modes.shares.sum(axis=2) == pytest.approx(1.0)


@pytest.mark.parametrize("second", [1.5 * RADIAL, 1.02 * RADIAL])
def test_on_anisotropic_bearings_the_rotor_is_planar_at_rest(second: float) -> None:
    modes = train_modes(rotor(RADIAL, second), SPEEDS, 1e4)
    for curve, direction in zip(tilting(SPEEDS, RADIAL, second), ("backward", "forward"), strict=True):
        n = number_of(modes, curve[-1])
        np.testing.assert_allclose(modes.frequency[:, n], curve, rtol=1e-9)
        assert modes.direction[0][n] == "planar"
        assert modes.direction[-1][n] == direction
        assert modes.labels[0][n] == "planar whirl of shaft rotor"


def test_the_critical_speed_of_forward_synchronous_whirl() -> None:
    """J_t w^2 - J_p W w - K = 0 with w = W: W^2 = K / (J_t - J_p); backward W^2 = K / (J_t + J_p)."""
    model, K = rotor(), 2.0 * ARM**2 * RADIAL
    found = campbell(train_modes(model, np.linspace(0.0, 6000.0, 25), 1e4), train_orders(model, 5, 1), 1e4)
    assert [order.name for order in found.orders] == ["1 x shaft rotor"]
    speeds = {}
    for c in found.met:
        speeds.setdefault(found.modes.labels[-1][c.mode], []).append(c.speed)
        assert c.frequency == pytest.approx(c.speed / TWO_PI, rel=1e-12)
    exact = {"forward": K / (TRANSVERSE - POLAR), "backward": K / (TRANSVERSE + POLAR)}
    for direction, square in exact.items():
        met = speeds[f"{direction} whirl of shaft rotor"]
        assert min(abs(s / math.sqrt(square) - 1.0) for s in met) < 1e-6
    table = found.columns()
    assert table["speed_rad_per_s"] == pytest.approx([c.speed for c in found.met])
    assert len(table["label"]) == len(found.met)


@pytest.mark.parametrize("count", [2, 3, 4, 13])
def test_an_order_that_meets_a_mode_at_a_speed_of_the_table_is_found_once(count: int) -> None:
    """The translations do not follow the speed; the middle speeds and the ends are met exactly."""
    model = rotor()
    critical = math.sqrt(2.0 * RADIAL / MASS)
    for low, high in ((0.5, 1.5), (1.0, 2.0), (0.0, 1.0)):
        modes = train_modes(model, critical * np.linspace(low, high, count), 1e4)
        met = crossings(modes, train_orders(model, 1, 1))
        assert sum(abs(c.speed / critical - 1.0) < 1e-9 for c in met) == 2


def test_a_disc_has_no_forward_synchronous_critical_speed() -> None:
    """J_p > J_t: the forward tilt stays above the order of the turns at all speeds."""
    model = rotor(polar_inertia=0.15)
    modes = train_modes(model, np.linspace(0.0, 6000.0, 25), 1e4)
    (order,) = train_orders(model, 5, 1)
    forward = number_of(modes, tilting(np.array([6000.0]), polar=0.15)[1, 0])
    assert modes.direction[-1][forward] == "forward"
    assert forward not in {c.mode for c in crossings(modes, [order])}


def test_a_torsional_chain_of_two_inertias() -> None:
    """Two shafts in hinges with an elastic mesh and an elastic coupling of the drive."""
    coupling, mesh = 2e4, 1e8
    made = train([(20, 30)], stiffness=mesh)
    drive = dataclasses.replace(made.drive, stiffness=coupling)
    model = build_train(dataclasses.replace(made, drive=drive))
    one, two = (shaft.rotor.polar for shaft in model.shafts)
    r1, r2 = base_radius(20), base_radius(30)
    K = np.array([[coupling + mesh * r1**2, mesh * r1 * r2], [mesh * r1 * r2, mesh * r2**2]])
    squares, shapes = np.linalg.eigh(K / np.sqrt(np.outer([one, two], [one, two])))
    modes = train_modes(model, [0.0, 800.0], 1e5)
    np.testing.assert_allclose(modes.frequency[-1], np.sqrt(squares) / TWO_PI, rtol=1e-9)
    assert {label.split(",")[0] for label in modes.labels[-1]} == {"torsional"}
    for n in range(2):
        x = shapes[:, n] / np.sqrt([one, two])
        strain = mesh * (r1 * x[0] + r2 * x[1]) ** 2
        assert modes.mesh_strain[-1, n, 0] == pytest.approx(strain / squares[n], rel=1e-9)
        assert modes.share("torsion", "s0")[-1, n] == pytest.approx(
            0.5 * (one * x[0] ** 2 + coupling * x[0] ** 2 / squares[n]), rel=1e-9
        )
        assert modes.labels[-1][n].endswith(", mesh d0-g0") == (strain >= 0.5 * squares[n])
        assert modes.direction[-1][n] == "none"


def bearing_train(turn: float = 0.0, mirror: bool = False) -> GearTrain:
    """Two shafts on bearings, the second at an angle about the first; mirrored at a plane through the axis."""
    sign = -1.0 if mirror else 1.0
    made = train([(20, 30)], stiffness=smooth)
    reach = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])

    def moved(point: tuple[float, float, float]) -> tuple[float, float, float]:
        x, z = reach @ [sign * point[0], point[2]]
        return float(x), point[1], float(z)

    shafts = tuple(dataclasses.replace(shaft, point=moved(shaft.point)) for shaft in made.shafts)
    bores = {name: moved(point) for name, point in made.rigid_bores.items()}
    stiff = {"s0+": 6e7, "s0-": 5e7, "s1+": 9e7, "s1-": 7e7}
    bearings = tuple(Bearing(name, (k, 0.4 * k, k, 3e3, 3e3)) for name, k in stiff.items())
    return dataclasses.replace(
        made, shafts=shafts, rigid_bores=bores, bearings=bearings,
        drive=dataclasses.replace(made.drive, speed=constant(sign * 600.0)),
        loads=(Load("s1", "s1+", constant(sign * 100.0)),),
    )  # fmt: skip


@pytest.mark.parametrize(("turn", "mirror"), [(0.7, False), (math.pi / 2, False), (0.0, True), (-1.9, True)])
def test_turned_and_mirrored_trains_have_the_same_modes(turn: float, mirror: bool) -> None:
    speeds = np.linspace(0.0, 4000.0, 9)
    one = train_modes(build_train(bearing_train()), speeds, 3e4)
    sense = -1.0 if mirror else 1.0
    two = train_modes(build_train(bearing_train(turn, mirror)), sense * speeds, 3e4)
    np.testing.assert_allclose(two.frequency, one.frequency, rtol=1e-8)
    np.testing.assert_allclose(two.shares, one.shares, atol=1e-6)
    assert two.labels == one.labels
    assert two.direction == one.direction
    np.testing.assert_allclose(two.whirl[1:], one.whirl[1:], atol=1e-5)
    assert {"forward", "backward"} <= set(two.direction[-1])


def test_energies_are_those_of_the_whole_and_damping_that_of_the_modes() -> None:
    model = build_train(dataclasses.replace(elastic(bearing_train()), damping=Damping(ratio=0.03, gyroscopic=False)))
    modes = train_modes(model, [500.0], 6e3)
    count = modes.frequency.shape[1]
    np.testing.assert_allclose(modes.frequency[0], model.coupled_frequencies_hz[:count], rtol=1e-6)
    assert modes.damping_ratio == pytest.approx(0.03, rel=1e-6)
    assert modes.shares.sum(axis=2) == pytest.approx(1.0)
    assert modes.kinetic.sum(axis=2) == pytest.approx(0.5, abs=1e-6)
    assert set(modes.direction[0]) <= {"planar", "none"}


def test_a_forward_mode_swings_forward() -> None:
    """The axis of the rotor goes round in the sense of the spin, which is that of the drive."""
    for sign in (1.0, -1.0):
        model = rotor(speed=sign)
        modes = train_modes(model, sign * SPEEDS, 1e4)
        upper = number_of(modes, tilting(SPEEDS)[1, -1])
        shape = modes.shapes[-1, upper]
        tilt = np.array([shape[3], shape[4]])[:, None] * np.exp(1j * np.linspace(0.0, 1.0, 5))
        angle = np.unwrap(np.arctan2(tilt[1].real, tilt[0].real))
        assert (sign * np.diff(angle) > 0.0).all()


def test_four_modes_that_agree_at_rest_come_apart() -> None:
    """J_t = m b^2: both translations and both tilts have one frequency at rest."""
    modes = train_modes(rotor(transverse_inertia=MASS * ARM**2), SPEEDS, 1e4)
    across = math.sqrt(2.0 * RADIAL / MASS) / TWO_PI
    half = POLAR * SPEEDS / (2.0 * MASS * ARM**2)
    root = np.sqrt(half**2 + (TWO_PI * across) ** 2)
    for curve in (across + 0.0 * half, (root + half) / TWO_PI, (root - half) / TWO_PI):
        assert np.abs(modes.frequency - curve[:, None]).max(axis=0).min() < 1e-6 * across
    assert set(modes.direction[0]) >= {"forward", "backward"}


def test_free_rotation_is_no_mode_of_the_table() -> None:
    """The drive's coupling is so soft that all shafts turn freely."""
    made = bearing_train()
    soft = dataclasses.replace(made.drive, stiffness=1e-9)
    modes = train_modes(build_train(dataclasses.replace(made, drive=soft)), [0.0, 500.0], 3e4)
    assert modes.free == 1
    assert np.isfinite(modes.frequency).all()
    assert modes.frequency.min() > 10.0


def test_a_mode_that_damping_keeps_from_swinging_is_labelled_so() -> None:
    """Bearings whose dampers hold the tilts at rest: C > 2 sqrt(J_t K); gyroscopic moments let one swing at speed."""
    K = 2.0 * ARM**2 * RADIAL
    damper = 1.05 * math.sqrt(TRANSVERSE * K) / ARM**2
    soft = [(k.bore, k.stiffness) for k in rotor().train.bearings]
    bearings = tuple(Bearing(name, stiffness, (damper, 0.0, damper, 0.0, 0.0)) for name, stiffness in soft)
    model = build_train(dataclasses.replace(rotor().train, bearings=bearings))
    modes = train_modes(model, np.linspace(0.0, 4000.0, 9), 1e4)
    exact = []
    for speed in modes.speeds:  # J_t r'' + (C - i J_p W) r' + K r = 0 with r = r1 + i r2
        roots = np.roots([TRANSVERSE, 2.0 * ARM**2 * damper - 1j * POLAR * speed, K])
        exact.append(np.abs(roots[np.abs(roots.imag) > 1e-3]))
    assert len(exact[0]) == 0
    assert len(exact[-1]) == 2
    for row, known in enumerate(exact):
        labels = [label for label in modes.labels[row] if "whirl" in label]
        for square in known:
            assert np.nanmin(np.abs(modes.frequency[row] - square / TWO_PI)) < 1e-6 * square
        assert all(label == "overdamped" for label, f in zip(modes.labels[row], modes.frequency[row], strict=True)
                   if not np.isfinite(f))  # fmt: skip
        assert len(labels) >= len(known)


@pytest.mark.parametrize(
    ("speeds", "words"),
    [([-1.0, 1.0], "change sign"), ([0.0, 2.0, 1.0], "do not rise"), ([-5.0, -9.0], "turns against"), ([], "none")],
)
def test_speeds_that_are_none_are_refused(speeds: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        train_modes(rotor(), speeds)


def test_a_train_that_cannot_vibrate_is_refused() -> None:
    with pytest.raises(InputError, match="cannot vibrate"):
        train_modes(build_train(train([(20, 30)], stiffness=None)), [0.0, 100.0])


def test_fields_of_a_whirl_mode_go_round() -> None:
    model = build_train(bearing_train())
    modes = train_modes(model, [0.0, 4000.0], 3e4)
    number = modes.direction[-1].index("forward")
    made = swinging(model, modes, [number], 4000.0, 8)
    shaft = next(i for i, name in enumerate(modes.shafts) if f"shaft {name}" in modes.labels[-1][number])
    sense = math.copysign(1.0, float(model.ratios[shaft]))
    frame = model.train.frame
    gear = next(i for i, gear in enumerate(model.train.gears) if gear.shaft == modes.shafts[shaft])
    x, y = (made.gear_pose[:, gear, :3] @ frame[k] + made.gear_pose[:, gear, 3:] @ frame[k] * 0.01 for k in (0, 1))
    area = 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    assert sense * area > 0.0


def bent_train() -> TrainModel:
    """Two elastic shafts of 20 mm on soft isotropic bearings."""
    steel = Section(0.09, 0.02, 0.02, young=200e9, poisson=0.3, density=7850.0)
    made = train([(20, 30)])
    shafts = tuple(dataclasses.replace(shaft, sections=(steel,), highest_hz=2e4) for shaft in made.shafts)
    bearings = tuple(Bearing(bore, (1e8, 1e8, 1e8, 0.0, 0.0)) for bore in made.rigid_bores)
    return build_train(dataclasses.replace(made, shafts=shafts, bearings=bearings))


def test_coordinates_of_elastic_shafts_move_their_sections_as_their_kinds_say() -> None:
    """A quarter of a turn about the axis takes bending along e1 to that along e2, and a tilt about e2 to -e1."""
    model = bent_train()
    frame = model.train.frame
    moves = {"bending e1": (0, 4), "bending e2": (1, 3), "axial": (2,), "torsion": (5,)}
    for number, body in enumerate(model.shafts):
        middle = float(np.array(model.train.shafts[number].point) @ frame[2])
        rows = body.section_rows(middle + np.linspace(-0.04, 0.04, 5), frame)
        motion = np.concatenate([frame @ rows[:, :3], frame @ rows[:, 3:]], axis=1)
        for coordinate, kind in enumerate(body.kinds, start=6):
            others = np.setdiff1d(np.arange(6), moves[kind])
            assert np.abs(motion[:, others, coordinate]).max() < 1e-9 * np.abs(motion[:, :, coordinate]).max()
        whirl = energies._coordinates(model, number)
        assert (sum(whirl.kinds) == np.eye(body.size)).all()
        for first, second in zip(whirl.first[2:], whirl.second[2:], strict=True):
            one, two = motion @ first, motion @ second
            assert two[:, (1, 3)] == pytest.approx(one[:, (0, 4)] * (1.0, -1.0), rel=1e-12)


def test_a_band_beyond_the_modes_of_elastic_shafts_is_a_warning() -> None:
    """Their own modes are kept up to 20 kHz, which serves a band up to 1 / 1.5 of that."""
    model = bent_train()
    for band, names in ((13e3, 0), (15e3, 2)):
        diagram = campbell(train_modes(model, [100.0, 600.0], band), train_orders(model, 1, 0), band)
        found = warnings(ModesResult(model, diagram, 600.0))
        assert sum("highest_frequency_Hz = 22500" in sentence for sentence in found) == names


def test_elastic_shafts_whirl_forward_faster_and_backward_slower() -> None:
    """Bending, twist and the bearings share the energy; gyroscopic moments raise forward whirl and lower backward."""
    modes = train_modes(bent_train(), [0.0, 1000.0, 2000.0, 3000.0], 2e4)
    assert modes.shares.sum(axis=2) == pytest.approx(1.0)
    assert modes.strain.sum(axis=2)[0] == pytest.approx(0.5, abs=1e-6)
    rises = modes.frequency[-1] - modes.frequency[0]
    whirling = {"forward": [], "backward": []}
    for n, direction in enumerate(modes.direction[-1]):
        if direction in whirling and abs(modes.whirl[-1, n]).max() > 0.9:
            whirling[direction].append(rises[n])
    assert len(whirling["forward"]) >= 4
    assert min(whirling["forward"]) > 0.0
    assert max(whirling["backward"]) < 0.0
    twist = int(np.argmax(modes.share("torsion")[-1]))
    assert modes.labels[-1][twist].startswith("torsional")


def test_fields_of_modes_bend_the_shafts(tmp_path: Path) -> None:
    """The lines of the sections are those of the mode's shape, enlarged."""
    h5py = pytest.importorskip("h5py")
    model = bent_train()
    modes = train_modes(model, [0.0, 3000.0], 6e3)
    number = next(n for n, label in enumerate(modes.labels[-1]) if "whirl" in label)
    made = swinging(model, modes, [number], 3000.0, 4)
    moved = made.sections.rows @ made.section_coordinates[0]
    assert np.ptp(moved[:, :3], axis=0).max() > 1e-4
    write_modes(tmp_path, model, modes, [number], 3000.0)
    with h5py.File(tmp_path / "mode_gears.vtkhdf") as file:
        moves = np.linalg.norm(file["VTKHDF"]["PointData"]["displacement_m"][:], axis=1)
    assert moves.max() > 1e-3
