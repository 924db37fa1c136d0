"""Bearings of a train by matrix and by geometry: balance at the operating point, stiffness there, files, mistakes."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.text import toml_document
from gearfe.base.tables.train import TrainBearingTable
from gearfe.cli.main import main
from gearfe.drivetrain.bearings import BallBearing, RollerBearing, Row, carrying
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.gearbox.rolling import rolling_bearing
from gearfe.drivetrain.train import Bearing, Damping, GearTrain, ShaftGear, TrainModel, build_train, simulate
from gearfe.drivetrain.train.gear_train import as_matrix
from gearfe.multibody import constant
from tests.makers.gearboxes import tables
from tests.makers.trains import base_radius, changed, elastic, gear, train

BALL = BallBearing(8, 7.9e-3, 33.5e-3)
ANGULAR = BallBearing(12, 7.5e-3, 34e-3, math.radians(25.0), preload=2e-6)
TAPERED = RollerBearing(17, 5e-3, 30e-3, math.radians(15.0), length=9e-3, preload=2e-6)
CYLINDER = RollerBearing(13, 6e-3, 32e-3, length=7e-3)


def carried(bearings: list[Any], torque: float = 60.0, **changes: Any) -> GearTrain:
    """Two shafts on four rolling bearings, under a constant load."""
    made = train([(20, 30)], **changes)
    names = [bore for shaft in made.shafts for bore in shaft.bores]
    springs = tuple(Bearing(name, item) for name, item in zip(names, bearings, strict=True))
    loads = (dataclasses.replace(made.loads[0], torque=constant(torque)),)
    return changed(made, loads=loads, bearings=springs)


def facing(bearing: Any) -> list[Any]:
    """Back to back on each shaft, whose first bore is that of higher y."""
    return [dataclasses.replace(bearing, rows=(Row(0.0, sense),)) for sense in (-1, 1, -1, 1)]


CASES = {
    "balls": [BALL] * 4,
    "angular": facing(ANGULAR),
    "tapered": facing(TAPERED),
    "one fixed, one floating": [BALL, CYLINDER] * 2,
}


def on_bore(model: TrainModel, bore: str) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment of a shaft on a bore, along x, y, z."""
    e1, e2, axis = model.train.frame
    load = model.operating.bearings[bore].load
    return load[:3] @ np.array([e1, axis, e2]), load[3:] @ np.array([e1, e2])


@pytest.mark.parametrize("housing", ["rigid", "elastic"])
@pytest.mark.parametrize("name", CASES)
def test_bearings_carry_what_the_mesh_puts_on_their_shaft(name: str, housing: str) -> None:
    made = carried(CASES[name])
    model = build_train(elastic(made, uneven=0.2, skew=0.5) if housing == "elastic" else made)
    line = model.meshes[0]
    force = 60.0 / base_radius(30) * line.direction
    for i, shaft in enumerate(model.train.shafts):
        acting = force if i else -force
        loads = {bore: on_bore(model, bore) for bore in shaft.bores}
        points = model.train.bore_points
        np.testing.assert_allclose(sum(f for f, _ in loads.values()), acting, atol=1e-6 * np.abs(force).max())
        moment = np.sum([m + np.cross(points[bore] - line.point, f) for bore, (f, m) in loads.items()], axis=0)
        # about the axis the drive and the load hold the shaft
        np.testing.assert_allclose(moment[[0, 2]], 0.0, atol=1e-6 * np.abs(force).max())
    assert model.operating.residual < 1e-9
    assert not model.operating.warnings


@pytest.mark.parametrize("housing", ["rigid", "elastic"])
def test_shafts_move_as_rigid_bodies_against_their_bores(housing: str) -> None:
    """Displacements in the bearings, and of the housing under their loads, are one motion of each rigid shaft."""
    made = carried(CASES["angular"])
    made = elastic(made, uneven=0.2, skew=0.5) if housing == "elastic" else made
    model = build_train(made)
    frame, points = model.train.frame, model.train.bore_points
    e1, e2, axis = frame
    bores = list(model.operating.bearings)
    moved: dict[str, np.ndarray] = {bore: np.zeros(6) for bore in bores}
    if made.housing is not None:
        body, load = made.housing, np.zeros(made.housing.size)
        for bore in bores:
            force, moment = on_bore(model, bore)
            load[body.attachment(bore)] += np.concatenate([force, moment])
        # reactions of the load and, by the ratio of the teeth, of the drive
        for bore, torque in (("s1+", 60.0), ("s0+", 40.0)):
            load[np.arange(body.size)[body.attachment(bore)][3:]] -= torque * axis
        q = np.linalg.solve(body.stiffness, load)
        moved = {bore: q[body.attachment(bore)] for bore in bores}
    for shaft in model.train.shafts:
        whole = {}
        for bore in shaft.bores:
            u = model.operating.bearings[bore].displacement
            place = u[:3] @ np.array([e1, axis, e2]) + moved[bore][:3]
            tilt = u[3:] @ np.array([e1, e2]) + moved[bore][3:] - (moved[bore][3:] @ axis) * axis
            whole[bore] = place, tilt
        (one, first), (two, second) = whole.values()
        arm = points[shaft.bores[1]] - points[shaft.bores[0]]
        size = np.abs(one).max()
        np.testing.assert_allclose(first, second, atol=1e-6 * size / 0.033)
        np.testing.assert_allclose(two, one + np.cross(first, arm), atol=1e-6 * size)


def test_each_bearing_is_in_the_state_of_its_load() -> None:
    model = build_train(carried(CASES["angular"]))
    for bore, state in model.operating.bearings.items():
        alone = carrying(model.operating.geometry[bore], state.load)
        np.testing.assert_allclose(alone.stiffness, state.stiffness, rtol=1e-5, atol=1e-6 * state.stiffness.max())
        assert alone.loaded == state.loaded
        used = next(item for item in model.train.bearings if item.bore == bore)
        np.testing.assert_array_equal(used.stiffness_matrix, state.stiffness)


def test_stiffness_grows_with_the_load_as_hertz_says() -> None:
    """Radial stiffness of balls goes with the cube root of the load."""
    stiff = [
        build_train(carried([BALL] * 4, torque)).operating.bearings["s1+"].stiffness[0, 0] for torque in (10.0, 80.0)
    ]
    assert stiff[1] / stiff[0] == pytest.approx(2.0, rel=2e-3)


def test_a_diagonal_and_its_matrix_give_the_same_digits() -> None:
    numbers = (2e8, 1e8, 3e8, 1e4, 2e4), (300.0, 200.0, 300.0, 0.1, 0.2)
    made = train([(20, 30)], damping=Damping(beta=1e-6))
    names = [bore for shaft in made.shafts for bore in shaft.bores]
    responses = []
    for form in (lambda x: x, lambda x: as_matrix(np.diag(x))):
        springs = tuple(Bearing(name, *map(form, numbers)) for name in names)
        model = build_train(changed(made, bearings=springs))
        responses.append(simulate(model, np.linspace(0.0, 1e-3, 21), tolerance=1e-8))
    one, two = responses
    assert one.bearing_load is not None
    np.testing.assert_array_equal(two.contact_force, one.contact_force)
    np.testing.assert_array_equal(two.bearing_load, one.bearing_load)


def test_a_matrix_couples_the_directions_of_its_shaft() -> None:
    """Frequencies of a shaft on one bearing are those of its 5 x 5 matrix."""
    random = np.random.default_rng(3)
    root = random.normal(size=(5, 5)) * np.sqrt([1e8, 5e7, 2e8, 2e4, 3e4])
    matrix = root.T @ root
    made = train([])
    shaft = dataclasses.replace(made.shafts[0], bores=("middle",))
    made = changed(
        made, shafts=(shaft,), gears=(ShaftGear("disc", "s0", 0.0, gear(20)),), loads=(),
        rigid_bores={"middle": (0.0, 0.0, 0.0)}, drive=dataclasses.replace(made.driven, bore="middle"),
        bearings=(Bearing("middle", as_matrix(matrix)),),
    )  # fmt: skip
    model = build_train(made)
    body = model.shafts[0].rotor
    mass = np.diag([body.mass] * 3 + [body.transverse] * 2)
    expected = np.sort(np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, matrix)).real)) / (2.0 * math.pi)
    np.testing.assert_allclose(model.coupled_frequencies_hz, expected, rtol=1e-9)


def test_a_bearing_between_others_with_clearance_is_flagged() -> None:
    made = carried([BALL] * 4)
    shaft = made.shafts[0]
    middle = dataclasses.replace(shaft, bores=(*shaft.bores, "middle"))
    loose = Bearing("middle", dataclasses.replace(BALL, clearance=500e-6))
    bores = {**made.rigid_bores, "middle": (0.0, -0.012, 0.0)}
    made = changed(made, shafts=(middle, *made.shafts[1:]), rigid_bores=bores, bearings=(*made.bearings, loose))
    model = build_train(made)
    assert len(model.operating.warnings) == 1
    assert "bearing middle: 0 of 8 rolling elements are loaded" in model.operating.warnings[0]
    response = simulate(model, [0.0, 1e-4])
    assert model.operating.warnings[0] in response.warnings


def test_bearings_that_carry_one_way_alone_are_refused() -> None:
    with pytest.raises(InputError, match=r"bearing 's\d[+-]': cannot carry its load.*carries"):
        build_train(carried([dataclasses.replace(ANGULAR, preload=0.0)] * 4))


def test_bearings_in_one_place_are_refused() -> None:
    made = carried([BALL] * 4)
    bores = {**made.rigid_bores, "s0-": (0.0, 0.028, 0.0)}
    with pytest.raises(InputError, match=r"lies 5 mm from bearing 's0-' on shaft 's0': they overlap.*7\.9 mm"):
        build_train(changed(made, rigid_bores=bores))
    same = changed(train([(20, 30)]), rigid_bores={**made.rigid_bores, "s0-": made.rigid_bores["s0+"]})
    with pytest.raises(InputError, match="lies 0 mm from bearing"):
        build_train(same)


# --- job files ------------------------------------------------------------------------------------------------------

DEEP = {"type": "deep_groove_ball", "elements": 8, "element_diameter_mm": 7.9, "pitch_diameter_mm": 33.5}
ANGLED = {**DEEP, "type": "angular_contact_ball", "contact_angle_deg": 25.0, "axial_preload_um": 2.0}
ROLLERS = {"elements": 13, "element_diameter_mm": 6.0, "pitch_diameter_mm": 32.0, "roller_length_mm": 7.0}
STIFFNESS, DAMPING = "stiffness_matrix_N_m_rad", "damping_matrix_N_m_s_rad"
SPRINGS = {"stiffness_N_per_m": [1.0] * 3, "damping_N_s_per_m": [1.0] * 3}
MATRIX = np.diag([1e8, 5e7, 2e8, 1e4, 1e4])


def box(first: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """The gearbox with rolling bearings; the first one is given."""
    made = tables(**changes)
    for name, bearing in made["bearings"].items():
        bearing.update(first if name == "s1_left" else DEEP)
    return made


def built(path: Path, job: dict[str, Any]) -> TrainModel:
    path.write_text(toml_document(job))
    return build_train(job_train(read_train_job(path), (3e8, 3e8, 3e8)))


def test_rows_of_a_file_are_those_of_a_bearing(tmp_path: Path) -> None:
    row = {**ANGLED, "row_distance_mm": 12.0, "arrangement": "O"}
    model = built(tmp_path / "box.toml", box(row))
    bearing = model.operating.geometry["s1_left"]
    assert bearing.rows == (Row(-6e-3, 1), Row(6e-3, -1))
    assert bearing.contact_angle == pytest.approx(math.radians(25.0))
    assert bearing.preload == pytest.approx(2e-6)
    # back to back is stiffer against tilt than face to face by the wider span of the lines of contact
    facing = built(tmp_path / "box.toml", box({**row, "arrangement": "X"}))
    tilts = [m.operating.bearings["s1_left"].stiffness[3, 3] for m in (model, facing)]
    assert tilts[0] > 2.0 * tilts[1]


def test_matrices_of_a_file_have_its_directions(tmp_path: Path) -> None:
    """A coupling of x and z, and of z and tilt about x, in a train whose second direction is -z."""
    matrix = MATRIX.copy()
    matrix[0, 2] = matrix[2, 0] = 3e7
    matrix[2, 3] = matrix[3, 2] = 4e5
    matrix[2, 4] = matrix[4, 2] = -2e5
    model = built(
        tmp_path / "box.toml",
        box({STIFFNESS: matrix.tolist(), DAMPING: MATRIX.tolist()}),
    )
    found = next(item for item in model.train.bearings if item.bore == "s1_left").stiffness_matrix
    e1, e2, axis = model.train.frame
    turn = np.zeros((5, 5))  # x, y, z, tilts about x and z -> directions of the train
    turn[:3, :3] = np.array([e1, axis, e2])
    turn[3:, 3:] = np.array([e1, e2])[:, [0, 2]]
    np.testing.assert_allclose(found, turn @ matrix @ turn.T, rtol=1e-12, atol=1e-6)


def test_files_report_the_operating_point(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = box(ANGLED | {"carries": "+y"}, bearings__s1_right={"shaft": "s1", "y_mm": 40.0})
    job["bearings"]["s1_right"].update(ANGLED | {"carries": "-y"})
    job["train"]["curves"] = {"mesh_model": "mean_stiffness"}
    for name in job["meshes"]:
        job["meshes"][name]["stiffness_N_per_m"] = 3e8
    job["runup"] = {"speed_start_rad_per_s": 90.0, "speed_stop_rad_per_s": 100.0, "speeds": 2}
    job["train"]["damping"] = {"ratio": 0.02}
    (tmp_path / "box.toml").write_text(toml_document(job))
    model = built(tmp_path / "same.toml", job)
    for command in ("vibration", "runup"):
        folder = tmp_path / command
        assert main([command, str(tmp_path / "box.toml"), "--out", str(folder), "--no-pictures"]) == 0
        summary = json.loads((folder / "summary.json").read_text())["bearings"]
        assert list(summary) == list(model.operating.bearings)
        state = model.operating.bearings["s1_left"]
        found = summary["s1_left"]
        np.testing.assert_allclose(found["force_N"], state.load[:3] * [1, 1, -1], rtol=1e-6)
        by_force = [np.array(found[name]) for name in ("force_by_displacement_N_per_m", "force_by_tilt_N_per_rad")]
        by_moment = [np.array(found[name]) for name in ("moment_by_displacement_Nm_per_m", "moment_by_tilt_Nm_per_rad")]
        stiffness = np.block([by_force, by_moment])
        np.testing.assert_allclose(np.diag(stiffness), np.diag(state.stiffness), rtol=1e-6)
        np.testing.assert_allclose(stiffness, stiffness.T, rtol=1e-9)
        assert (found["elements"], found["loaded_elements"]) == (8, state.loaded)
        with (folder / "bearing_stiffness.csv").open() as stream:
            row = next(csv.DictReader(stream))
        assert row["bearing"] == "s1_left"
        assert float(row["force_z_N"]) == pytest.approx(found["force_N"][2])
        assert float(row["stiffness_x_z_N_per_m"]) == pytest.approx(found["force_by_displacement_N_per_m"][0][2])
        assert "bearing s1_left: carries" in capsys.readouterr().out


def test_files_without_rolling_bearings_have_no_table_of_them(tmp_path: Path) -> None:
    job = tables(train__curves={"mesh_model": "mean_stiffness"})
    for name in job["meshes"]:
        job["meshes"][name]["stiffness_N_per_m"] = 3e8
    (tmp_path / "box.toml").write_text(toml_document(job))
    arguments = [
        "vibration",
        str(tmp_path / "box.toml"),
        "--out",
        str(tmp_path / "v"),
        "--no-pictures",
        "--no-estimate",
    ]
    assert main([*arguments, "--no-floquet"]) == 0
    assert not (tmp_path / "v" / "bearing_stiffness.csv").exists()


def without(table: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in table.items() if name != key}


def entry(row: int, column: int, value: float) -> list[list[float]]:
    """The matrix with one entry changed."""
    made = MATRIX.copy()
    made[row, column] = value
    return made.tolist()


def both(row: int, column: int, value: float) -> list[list[float]]:
    made = np.array(entry(row, column, value))
    made[column, row] = value
    return made.tolist()


SIX = [[0.0] * 5] * 6
WRONG: list[tuple[dict[str, Any], str]] = [
    ({"stiffness_N_per_m": [1e8] * 3, STIFFNESS: MATRIX.tolist()}, r"matrix_N_m_rad.*conflicts with stiffness_N_per_m"),
    ({**DEEP, "stiffness_N_per_m": [1e8] * 3}, r"type = 'deep_groove_ball': conflicts with stiffness"),
    ({STIFFNESS: SIX}, r"stiffness_matrix_N_m_rad.*must have 5 entries"),
    ({STIFFNESS: [[1.0] * 4] * 5}, r"stiffness_matrix_N_m_rad\[0\].*must have 5 entries"),
    ({STIFFNESS: entry(0, 2, 1e7)}, r"must be symmetric: row 3 has 0 in column 1, row 1 has 1e\+07; write 5e"),
    ({STIFFNESS: entry(1, 1, -5e7)}, r"-5e\+07 on its diagonal, in row 2: must be >= 0"),
    ({STIFFNESS: both(0, 2, 1.5e8)}, r"1.5e\+08 in row 3, column 1: must be 1.41421e\+08 or less"),
    ({STIFFNESS: both(2, 4, 1e7)}, r"1e\+07 in row 5, column 3: must be 1.41421e\+06 or less"),
    (
        {STIFFNESS: [[2.0, 1.5, -1.5, 0.0, 0.0], [1.5, 2.0, 1.5, 0.0, 0.0], [-1.5, 1.5, 2.0, 0.0, 0.0],
                              [0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]]},
        r"must be positive semi-definite: .* least eigenvalue is -0.5",
    ),
    ({"stiffness_N_per_m": [1e8] * 3, DAMPING: entry(0, 0, -1.0)}, r"damping_matrix_N_m_s_rad: has -1"),
    ({DAMPING: MATRIX.tolist()}, r"damping_matrix_N_m_s_rad.*needs a stiffness"),
    ({**SPRINGS, DAMPING: MATRIX.tolist()}, "conflicts with damping"),
    ({"elements": 8}, r"elements = 8: conflicts with a bearing without type"),
    ({**DEEP, "type": "needle"}, r"type = 'needle': must be one of deep_groove_ball"),
    (without(DEEP, "elements"), r"elements: is required of type = 'deep_groove_ball'"),
    (without(DEEP, "pitch_diameter_mm"), r"pitch_diameter_mm: is required"),
    ({**DEEP, "elements": 2}, r"elements = 2: must be finite and >= 3"),
    ({**DEEP, "elements": 8.5}, r"elements = 8.5: must be a whole number"),
    ({**DEEP, "elements": 20}, r"elements = 20: of 7.9 mm do not fit on a circle of 33.5 mm: must be 13 or less"),
    ({**DEEP, "element_diameter_mm": 40.0}, r"element_diameter_mm = 40.0: must be smaller"),
    ({**DEEP, "element_diameter_mm": -1.0}, r"element_diameter_mm = -1.0: must be finite and > 0"),
    ({**DEEP, "inner_osculation": 0.5}, r"inner_osculation = 0.5: must be finite and > 0.5"),
    ({**DEEP, "contact_angle_deg": 15.0}, r"contact_angle_deg = 15.0: conflicts with type = 'deep_groove_ball'"),
    ({**DEEP, "roller_length_mm": 5.0}, r"roller_length_mm = 5.0: conflicts with type"),
    ({**DEEP, "carries": "+y"}, r"carries = '\+y': conflicts with type"),
    ({**DEEP, "radial_clearance_um": 900.0}, r"radial_clearance_um = 900.0: is more than the clearance.*< 790"),
    ({**DEEP, "radial_clearance_um": -900.0}, r"radial_clearance_um = -900.0: must be finite and >= -200"),
    (without(ANGLED, "contact_angle_deg"), r"contact_angle_deg: is required of type"),
    (ANGLED, r"carries: is required: such rows carry one way"),
    ({**ANGLED, "carries": "up"}, r"carries = 'up': must be one of \+y, -y"),
    ({**ANGLED, "contact_angle_deg": 0.0}, r"contact_angle_deg = 0.0: must be finite and > 0"),
    ({**ANGLED, "arrangement": "O"}, r"arrangement = 'O': is of two rows, and there is one"),
    ({**ANGLED, "row_distance_mm": 9.0}, r"arrangement: is required with row_distance_mm"),
    ({**ANGLED, "row_distance_mm": 9.0, "arrangement": "O", "carries": "+y"}, r"carries = '\+y': conflicts with arr"),
    ({**ANGLED, "row_distance_mm": 9.0, "arrangement": "tandem"}, r"carries: is required"),
    ({**ANGLED, "carries": "+y", "axial_preload_um": -500.0}, r"axial_preload_um = -500.0: is more than .*> -166.9 um"),
    ({**ROLLERS, "type": "cylindrical_roller", "axial_preload_um": 1.0}, r"axial_preload_um = 1.0: conflicts with t"),
    (without({**ROLLERS, "type": "cylindrical_roller"}, "roller_length_mm"), r"roller_length_mm: is required"),
    ({**ROLLERS, "type": "tapered_roller"}, r"contact_angle_deg: is required"),
    ({**ROLLERS, "type": "cylindrical_roller", "roller_profile": "crowned"}, r"roller_profile = 'crowned': must be"),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "message"), WRONG, ids=range(len(WRONG)))
def test_mistakes_of_a_bearing_name_key_value_and_cure(tmp_path: Path, keys: dict[str, Any], message: str) -> None:
    job = tables()
    job["bearings"]["s1_left"].update(keys)
    with pytest.raises(InputError, match=r"bearings\.s1_left.*" + message):
        built(tmp_path / "box.toml", job)


def test_lists_of_a_train_have_the_same_keys() -> None:
    table = build(TrainBearingTable, {"attachment": 1, **DEEP}, "train.bearings[0]")
    assert rolling_bearing(table) == BallBearing(8, 7.9e-3, 33.5e-3)
    with pytest.raises(InputError, match=r"train\.bearings\[1\]\.stiffness_N_per_m: is required"):
        build(TrainBearingTable, {"attachment": 1}, "train.bearings[1]")
