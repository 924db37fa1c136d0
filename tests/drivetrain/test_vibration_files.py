"""Files and fields of a vibration job: what is written is what was computed."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.base.errors import InputError, NotFiniteWarning
from gearfe.base.progress import Stopwatch
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.fields import frames, gear_surface, moved, solids, write_gears, write_housing
from gearfe.drivetrain.gearbox.stability import Stability
from gearfe.drivetrain.housing.attachments import Attachment
from gearfe.drivetrain.housing.model import Housing
from gearfe.drivetrain.train import Drive, GearMesh, GearTrain, Shaft, ShaftGear, build_train
from gearfe.drivetrain.vibration.files import OutputChoice, write_run
from gearfe.drivetrain.vibration.follow import RunningMean, TrainRun
from gearfe.drivetrain.vibration.report import lines_of
from gearfe.drivetrain.vibration.spectra import response_columns, spectra
from gearfe.figures.train import TrainPictures
from gearfe.figures.train_scene import draw_scene, sharp_edges
from gearfe.multibody import constant
from tests.makers.gears import pair
from tests.makers.housing_meshes import box
from tests.makers.job_texts import BARE_TRAIN, BORES
from tests.makers.train_responses import COLUMNS, COUNT, STEP, made_up, table, tone
from tests.places import GEOMETRY

JOB = GEOMETRY / "gear_train.toml"


@pytest.fixture
def train():
    gears = pair(20, 30)
    shafts = tuple(
        Shaft(name, (1e-3 * x, 0.0, 0.0), 82e-3, 10e-3, bores)
        for name, x, bores in (
            ("drive", 0, ("1", "2")),
            ("intermediate", 62.5, ("3", "4")),
            ("output", 125, ("5", "6")),
        )
    )
    on = (
        ShaftGear("gear1", "drive", 10e-3, gears.pinion),
        ShaftGear("gear2", "intermediate", 10e-3, gears.wheel),
        ShaftGear("gear3", "intermediate", -2e-3, gears.pinion),
        ShaftGear("gear4", "output", -2e-3, gears.wheel),
    )
    meshes = (GearMesh("gear1", "gear2", 1e8), GearMesh("gear3", "gear4", 1e8, phase=0.1))
    bores = {
        bore: (*shaft.point[:1], y, 0.0)
        for shaft in shafts
        for bore, y in zip(shaft.bores, (-0.041, 0.041), strict=True)
    }
    return GearTrain(shafts, on, meshes, Drive("drive", "1", constant(600.0)), rigid_bores=bores)


# ---- files of a known response ---------------------------------------------------------------------------------------


def write_all(folder, train, response, choice, **options):
    """The files of a response at hand."""
    if response.status != "done":
        choice = replace(choice, spectrum_start=0.0, spectrum_length=None)
    stability = Stability(np.array([0.98 + 0.05j, 0.98 - 0.05j]), response.common_period_s or 0.0)
    planned = TrainRun(build_train(train), response.time, lambda _: [response], stability=stability)
    return write_run(folder, planned, choice, watch=Stopwatch(), **options)


def test_columns_and_digits(tmp_path, train):
    response = made_up()
    written = write_all(tmp_path, train, response, OutputChoice(), draw=TrainPictures("made up"))
    names, values = table(tmp_path / "response.csv")
    assert names[: len(COLUMNS)] == COLUMNS
    assert values.shape == (COUNT, len(names))
    by_name = dict(zip(names, values.T, strict=True))
    assert (by_name["contact_force_2_N"] == response.contact_force[:, 1]).all()  # 17 digits bring every double back
    assert (by_name["speed_intermediate_rad_per_s"] == response.speed[:, 1]).all()
    assert (by_name["attachment_5_acceleration_m_per_s2"] == response.attachment_acceleration[:, 4]).all()
    assert by_name["drive_angle_deg"] == pytest.approx(np.degrees(600.0 * response.time), rel=1e-15)
    assert (by_name["band_limited"] == 0).all()  # points of the motion
    lines, _ = table(tmp_path / "spectrum.csv")
    assert "band_limited" not in lines
    assert lines[0] == "frequency_Hz"
    assert lines[1 : len(COLUMNS) - 1] == COLUMNS[2:]
    assert set(written.names) >= {"response.png", "spectrum.png", "summary.json"}
    for name in ("response.png", "spectrum.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_a_response_with_numbers_that_are_none_is_told(tmp_path, train):
    made = made_up()
    made.drive_angle[7] = math.nan
    with pytest.warns(NotFiniteWarning, match=r"response.csv: column drive_angle_deg: 1 of .* the first in row 8"):
        write_all(tmp_path, train, made, OutputChoice())


def test_spectrum_of_known_lines(tmp_path, train):
    write_all(tmp_path, train, made_up(), OutputChoice())
    names, values = table(tmp_path / "spectrum.csv")
    by_name = dict(zip(names, values.T, strict=True))
    assert by_name["frequency_Hz"] == pytest.approx(np.arange(101) / 7e-3, rel=1e-13)
    side = by_name["attachment_5_acceleration_m_per_s2"]
    assert side[[4, 14]] == pytest.approx([10.7, 9.7], rel=1e-12)
    assert np.delete(side, [4, 14]).max() < 1e-12
    assert by_name["contact_force_1_N"][[0, 13]] == pytest.approx([2000.0, 150.0], rel=1e-12)
    summary = json.loads((tmp_path / "summary.json").read_text())
    first, second = summary["dominant_lines"]["attachment_5_acceleration_m_per_s2"]
    assert (first["frequency_Hz"], first["amplitude"]) == pytest.approx((571.4286, 10.7), rel=1e-6)
    assert first["near"] is None
    assert second["frequency_Hz"] == pytest.approx(2000.0)
    assert second["near"] == "mesh 1 x 1"
    assert summary["spectrum"]["resolution_Hz"] == pytest.approx(142.857, abs=1e-3)


def test_summary_of_a_known_response(tmp_path, train):
    write_all(tmp_path, train, made_up(), OutputChoice())
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["mean_over_common_periods"] == 3
    # bins 13 and 9 of 7 ms leave a known rest over 3 periods of 1.5708 ms at the end
    low, high = 7e-3 - 3 * made_up().common_period_s, 7e-3
    for i, (line, size, mean) in enumerate(((13, 150.0, 2000.0), (9, 200.0, 3000.0))):
        omega = 2 * math.pi * line / 7e-3
        exact = mean + size * (math.sin(omega * high) - math.sin(omega * low)) / (omega * (high - low))
        assert summary["mean_contact_forces_N"][i] == pytest.approx(exact, rel=1e-6)
    assert summary["floquet"]["largest_multiplier"] == pytest.approx(math.hypot(0.98, 0.05))
    assert summary["status"] == "done"
    assert summary["mesh_frequencies_Hz"] == pytest.approx([1909.859, 1273.240], abs=1e-3)
    assert summary["error_estimates"] == {"integration": 1e-7}


def test_curves_of_a_long_run_have_the_lines_of_its_meshes():
    """They are the least and largest values of parts, of which the last may be one sample: two rows at one time."""
    whole = made_up()
    rows = np.append(np.arange(COUNT), COUNT - 1)
    envelope = made_up(time=whole.time[rows], drive_angle=whole.drive_angle[rows])
    lines = lines_of(envelope, 5000.0)
    assert [line.frequency for line in lines] == [line.frequency for line in lines_of(whole, 5000.0)]
    assert lines[0].frequency == pytest.approx(20 * 400.0 / (2 * math.pi), rel=1e-12)  # of mesh 2, the lower one
    speeding = made_up(time=whole.time[rows], drive_angle=whole.time[rows] ** 2)
    assert lines_of(speeding, 5000.0) == ()


def test_a_mean_without_a_period():
    time = np.linspace(0.0, 1.0, 201)
    mean = RunningMean(time, 0.5, None)
    mean.add(time, np.column_stack([time, 3 + 0 * time]))
    assert mean.periods == 0
    assert mean.value == pytest.approx([0.75, 3.0], rel=1e-12)
    mean = RunningMean(time, 0.1, 0.4)
    mean.add(time, (time**2)[:, None])
    assert mean.periods == 2
    assert mean.value == pytest.approx([(1 - 0.2**3) / 3 / 0.8], rel=1e-12)


def test_a_run_that_ends_within_the_ramp_has_the_mean_of_its_last_step():
    """No whole period, never a negative number of them, and a mean all the same."""
    time = np.linspace(0.0, 1.0, 201)
    mean = RunningMean(time, 1.5, 0.4)
    mean.add(time, time[:, None])
    assert mean.periods == 0
    assert mean.value == pytest.approx([1.0 - 0.5 * 0.005], rel=1e-9)


def test_the_radiated_power_of_one_coordinate(tmp_path, train):
    """Housing with one coordinate and R = 2e-3 m4/s2: P = rho c R v^2/2 on its line."""
    time = STEP * np.arange(COUNT)
    rate = tone(time, 14, 0.01)[:, None]
    response = made_up(modal=rate, modal_velocity=rate, modal_acceleration=rate)
    made = spectra(response, np.array([[2e-3]]))
    power = made.columns()["radiated_power_W"]
    assert power[14] == pytest.approx(0.5 * 1.2041 * 343.21 * 2e-3 * 0.01**2, rel=1e-12)
    assert np.delete(power, 14).max() < 1e-20 * power[14]
    assert made.columns()["radiated_power_level_dB"][14] == pytest.approx(10 * math.log10(power[14] / 1e-12))
    assert response_columns(response, np.array([[2e-3]]))["instantaneous_radiated_power_W"][0] == pytest.approx(
        2 * power[14], rel=1e-12
    )


def test_a_run_that_ended_early_is_written(tmp_path, train):
    short = {
        name: getattr(made_up(), name)[:40]
        for name in (
            "time",
            "drive_angle",
            "drive_torque",
            "mesh_power",
            "apart",
            "friction_power",
            "contact_force",
            "speed",
            "speed_absolute",
            "acceleration",
        )
    }
    short |= {
        name: getattr(made_up(), name)[:40]
        for name in ("acceleration_absolute", "attachment_acceleration", "gear_pose", "transmission_error")
    }
    response = made_up(**short, status="diverged", time_reached=39 * STEP)
    choice = OutputChoice(spectrum_start=5e-3)  # beyond what was reached
    written = write_all(tmp_path, train, response, choice)
    assert {"response.csv", "spectrum.csv", "summary.json"} <= set(written.names)
    assert len(table(tmp_path / "response.csv")[1]) == 40
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "diverged"
    assert summary["time_reached_s"] == pytest.approx(39 * STEP)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"length": 7.1e-3}, "the window is longer than the signal"),
        ({"start": 5e-3, "length": 3e-3}, "which has 0.001995 s"),  # 57 whole steps are left
        ({"start": 8e-3}, "begin earlier"),
        ({"length": 1e-6}, "less than two steps"),
        ({"window": "box"}, "must be one of none, hann"),
    ],
)
def test_records_that_do_not_fit(options, message):
    with pytest.raises(InputError, match=message):
        spectra(made_up(), **options)


# ---- fields ----------------------------------------------------------------------------------------------------------


def test_a_gear_is_a_closed_solid():
    """Volume by the divergence theorem: outline times width, less the bore."""
    gear = pair(20, 30).pinion
    points, quads = gear_surface(gear, 0.3, per_segment=12)
    a, b, c, d = (points[quads[:, k]] for k in range(4))
    volume = sum(np.einsum("ij,ij->i", p, np.cross(q, r)).sum() / 6 for p, q, r in ((a, b, c), (a, c, d)))
    k = len(points) // 4
    x, y = points[k : 2 * k, :2].T
    outline = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
    u, v = points[:k, :2].T
    bore = 0.5 * (u @ np.roll(v, -1) - v @ np.roll(u, -1))
    assert volume == pytest.approx((outline - bore) * gear.face_width, rel=1e-10)
    assert bore == pytest.approx(math.pi * (0.5 * gear.bore_diameter) ** 2, rel=1e-3)
    edges = np.sort(np.concatenate([quads[:, [i, (i + 1) % 4]] for i in range(4)]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    tip = np.hypot(*points[:, :2].T).max()
    assert tip == pytest.approx(gear.tip_radius, rel=1e-9)


def test_gears_turn_and_move_as_told(train):
    """A quarter turn about y takes z to x; tilt and displacement add to it."""
    response = made_up()
    pose = np.zeros((COUNT, 4, 6))
    pose[1, :, 4] = 0.5 * math.pi
    pose[2] = [1e-4, 2e-4, 3e-4, 1e-3, 0.5 * math.pi, -2e-3]
    response = made_up(gear_pose=pose)
    part, centre = solids(train, response)[0], response.gear_centres[0]
    before = part.points - centre
    after = moved(part, response, train.frame, 1) - centre
    assert after == pytest.approx(np.column_stack([before[:, 2], before[:, 1], -before[:, 0]]), abs=1e-15)
    both = moved(part, response, train.frame, 2) - centre
    assert both == pytest.approx(np.array([1e-4, 2e-4, 3e-4]) + after + np.cross([1e-3, 0.0, -2e-3], after), abs=1e-15)


def test_smooth_rolling_is_no_vibration(train):
    """What is left is the displacement, and the radius times what a gear turns further than the drive makes it."""
    angle = np.zeros(COUNT)
    angle[3] = 0.7
    pose = np.zeros((COUNT, 4, 6))
    ratios = train.kinematics.ratios
    shafts = [shaft.name for shaft in train.shafts]
    for g, gear in enumerate(train.gears):
        pose[:, g, 3:] = np.outer(float(ratios[shafts.index(gear.shaft)]) * angle, train.frame[2])
    pose[3, :, :3] = [1e-6, 2e-6, 2e-6]
    shown = frames(train, made_up(gear_pose=pose, drive_angle=angle), [3], exaggeration=1.0)
    assert shown["gear_values"] == pytest.approx(3.0, rel=1e-5)  # um
    pose[3, :, :3] = 0.0
    pose[3, 0, 3:] += 1e-6 * train.frame[2]
    turned = frames(train, made_up(gear_pose=pose, drive_angle=angle), [3], exaggeration=1.0)["gear_values"]
    assert turned.max() == pytest.approx(1e3 * 1e3 * train.gears[0].gear.tip_radius * 1e-6, rel=1e-4)


def test_the_series_of_the_gears(tmp_path, train):
    import h5py

    response = made_up()
    write_gears(tmp_path / "gears.vtkhdf", train, response, [0, 100, 200])
    with h5py.File(tmp_path / "gears.vtkhdf") as file:
        assert list(file["VTKHDF/Steps/Values"]) == pytest.approx(response.time[[0, 100, 200]])
        count = int(file["VTKHDF/NumberOfPoints"][0])
        points = file["VTKHDF/Points"][...].reshape(-1, count, 3)
        shift = file["VTKHDF/PointData/displacement_m"][...].reshape(-1, count, 3)
        assert shift[0] == pytest.approx(0.0, abs=0)
        assert shift[2] == pytest.approx(points[2] - points[0], abs=1e-8)
        assert set(file["VTKHDF/PointData/gear"][:count]) == {1, 2, 3, 4}


@pytest.fixture(scope="module")
def block():
    """A free block, two ends of which are attachments, reduced."""
    size = np.array([0.15, 0.06, 0.03])
    nodes, tets = box((4, 2, 1), tuple(size))
    ends = [
        Attachment(name, np.array([x, 0.03, 0.015]), np.array([1.0, 0.0, 0.0]), np.flatnonzero(nodes[:, 0] == x))
        for name, x in (("1", nodes[:, 0].min()), ("2", nodes[:, 0].max()))
    ]
    return Housing.from_arrays(nodes, tets, attachments=ends).reduce(4)


def test_the_series_of_the_housing(tmp_path, block):
    """Displacement and acceleration of all nodes; on the upper side the normal acceleration is the one along z."""
    import h5py

    rng = np.random.default_rng(2)
    q, a = (1e-6 * rng.standard_normal((COUNT, block.size)) for _ in range(2))
    response = made_up(modal=q, modal_velocity=q, modal_acceleration=a)
    write_housing(tmp_path / "housing.vtkhdf", block, response, [0, 7, 200])
    with h5py.File(tmp_path / "housing.vtkhdf") as file:
        assert list(file["VTKHDF/Steps/Values"]) == list(response.time[[0, 7, 200]])
        shift = file["VTKHDF/PointData/displacement_m"][...].reshape(3, -1, 3)
        normal = file["VTKHDF/PointData/normal_acceleration_m_per_s2"][...].reshape(3, -1)
    nodes = block.nodes
    for i, step in enumerate((0, 7, 200)):
        field = (block.shapes @ q[step]).reshape(-1, 3)
        assert shift[i] == pytest.approx(field, rel=1e-6, abs=1e-7 * np.abs(field).max())
        push = (block.shapes @ a[step]).reshape(-1, 3)
        inside = (nodes[:, 0] > 0) & (nodes[:, 0] < 0.15) & (nodes[:, 1] > 0) & (nodes[:, 1] < 0.06)
        for side, sign in ((nodes[:, 2] == nodes[:, 2].max(), 1.0), (nodes[:, 2] == 0.0, -1.0)):
            there = side & inside
            assert normal[i][there] == pytest.approx(sign * push[there, 2], rel=1e-5, abs=1e-6 * np.abs(push).max())


def test_a_picture_and_a_film(tmp_path, train, block):
    from PIL import Image

    rng = np.random.default_rng(2)
    q, a = (1e-6 * rng.standard_normal((COUNT, block.size)) for _ in range(2))
    response = made_up(modal=q, modal_velocity=q, modal_acceleration=a)
    housed = replace(train, housing=block)
    assert draw_scene(tmp_path / "one.png", frames(housed, response, [130]), "a block") == ""
    assert draw_scene(tmp_path / "film.gif", frames(housed, response, [0, 50, 100]), "a block") == ""
    with Image.open(tmp_path / "one.png") as picture:
        colours = np.asarray(picture.convert("RGB").resize((100, 72))).reshape(-1, 3)
        assert len(np.unique(colours, axis=0)) > 50  # something was drawn
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 3


def test_a_scene_that_cannot_be_drawn_says_why(tmp_path):
    assert "apt-get install" in draw_scene(tmp_path / "none.png", {"time": np.zeros(1)}, "nothing")
    assert not list(tmp_path.iterdir())


def test_sharp_edges_of_a_tent():
    """Two triangles at a right angle: their common edge is sharp, the rim is an edge; in one plane only the rim is."""
    points = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1.0]])
    assert len(sharp_edges(points, np.array([[0, 1, 2], [0, 3, 1]]))) == 5
    flat = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0.0]])
    assert len(sharp_edges(flat, np.array([[0, 1, 2], [0, 3, 1]]))) == 4


def test_a_run_within_the_ramp_says_so(tmp_path, capsys):
    """Never means over -1 periods."""
    job = tmp_path / "job.toml"
    job.write_text(
        (BARE_TRAIN + BORES)
        .replace("duration_ms = 2.0", "duration_ms = 0.4")
        .replace("centre_ms = 0.5", "centre_ms = 5.0")
    )
    assert main(["vibration", str(job), "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    said = capsys.readouterr().out
    assert "it is shorter than the ramp and one period" in said
    assert "over the last" not in said
    assert "nan" not in said
