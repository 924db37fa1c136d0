"""Load along the face width from a job file: what its keys mean, which way they count, and what takes them."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.examples import job_file
from gearfe.base.tables.gearbox import pair_gearbox
from gearfe.base.tables.microgeometry import MicrogeometryTable
from gearfe.base.tables.pair import PairTable, StiffnessTable
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import read_train_job
from gearfe.drivetrain.gearbox.mesh_stiffness import law_over_width
from gearfe.gears.gearmesh import width_job
from gearfe.gears.gearmesh.job import StiffnessJob, stiffness_job
from gearfe.gears.gearmesh.width_job import job_lines, stiffness_sweep, wide_flanks, wide_mesh
from gearfe.gears.gearmesh.width_report import FlankLoad, load_columns, sweep_columns, width_summary, write_flank
from gearfe.gears.width import WideMesh
from gearfe.output.exchange.tables import read_csv
from gearfe.study.kinds import Shared, solve
from tests.makers.job_texts import pair_job

PAIR: dict[str, Any] = {
    "module_mm": 2.5, "pressure_angle_deg": 20.0, "face_width_mm": 10.0, "tip_round_mm": 0.1,
    "pinion": {"teeth": 20, "bore_diameter_mm": 20.0}, "wheel": {"teeth": 30, "bore_diameter_mm": 30.0},
}  # fmt: skip
#: Positions of the computed cases: few, for their elements are coarse and their physics is what is looked at.
COARSE: dict[str, Any] = {"torque_Nm": 60.0, "angle_step_deg": 4.5, "coarsen": 2.0}


def job(micro: dict[str, Any] | None = None, stiffness: dict[str, Any] | None = None, **pair: Any) -> StiffnessJob:
    """A job of a spur pair, its microgeometry and changes of its tables, as a file would give it."""
    table = {**PAIR, **{key: {**PAIR[key], **value} if key in PAIR and isinstance(value, dict) else value
                        for key, value in pair.items()}}  # fmt: skip
    uneven = None if micro is None else build(MicrogeometryTable, micro, "microgeometry")
    (mesh,) = pair_gearbox(build(PairTable, table, "pair"), uneven).meshes.values()
    table_ = build(StiffnessTable, {**COARSE, **(stiffness or {})}, "stiffness")
    return stiffness_job(replace(mesh, stiffness=table_))


def columns(one: StiffnessJob) -> dict[str, Any]:
    lines = job_lines(one)
    return sweep_columns(one, lines.compliance.mesh, stiffness_sweep(one, lines))


MICRO: dict[str, Any] = {
    "helix_crowning_um": 4.0, "helix_slope_um": 6.0, "bias_um": 8.0,
    "end_relief_low_um": 10.0, "end_relief_low_length_mm": 2.0,
    "end_relief_high_um": 20.0, "end_relief_high_length_mm": 4.0,
    "triangular_reliefs": [{"corner": "tip_high", "amount_um": 5.0, "width_mm": 2.0, "roll_length_mm": 1.0}],
}  # fmt: skip


@pytest.mark.parametrize(("flank", "sense"), [("left", 1.0), ("right", -1.0)])
def test_material_of_all_lead_keys(flank: str, sense: float) -> None:
    """-C_beta at both ends, f_Hbeta/2 and bias/4 with the sign of end and profile, reliefs at their ends and corner."""
    one = job({"torques_Nm": [60.0], "flank": flank, "pinion": MICRO})
    mesh = wide_mesh(one)
    flanks, gear = wide_flanks(one, mesh), one.pair.pinion
    form, tip, b = gear.form_roll, gear.profile.tip_roll, 10e-3

    def material(roll: float, y: float) -> float:
        made = flanks.material(0, np.array([roll]), np.array([sense * y]), np.zeros(1, int), mesh.faces[0])
        return 1e6 * float(made[0])

    middle = 0.5 * (form + tip)
    assert material(middle, 0.0) == pytest.approx(0.0, abs=1e-9)
    assert material(tip, 0.0) == pytest.approx(0.0, abs=1e-9)
    assert material(tip, -0.5 * b) == pytest.approx(-4 - 3 - 2 - 10, abs=1e-9)
    assert material(form, -0.5 * b) == pytest.approx(-4 - 3 + 2 - 10, abs=1e-9)
    assert material(form, 0.5 * b) == pytest.approx(-4 + 3 - 2 - 20, abs=1e-9)
    assert material(tip, 0.5 * b) == pytest.approx(-4 + 3 + 2 - 20 - 5, abs=1e-9)
    # half way along each relief; beyond them nothing
    assert material(middle, 0.3 * b) == pytest.approx(-4 * 0.36 + 3 * 0.6 - 10, abs=1e-9)
    assert material(middle, -0.3 * b) == pytest.approx(-4 * 0.36 - 3 * 0.6, abs=1e-9)
    # in the middle of the line from edge to edge of the triangle it is nothing, half way to the corner a half
    assert material(tip - 0.25e-3, 0.5 * b - 0.5e-3) == pytest.approx(
        -4 * 0.81 + 3 * 0.9 + 2 * 0.9 * (tip - 0.25e-3 - middle) / (tip - middle) - 17.5 - 2.5, abs=1e-9
    )
    assert flanks.material(1, np.array([form]), np.zeros(1), np.zeros(1, int), mesh.faces[1])[0] == 0.0


def test_parabolic_end_relief() -> None:
    one = job({"torques_Nm": [60.0], "wheel": {
        "end_relief_high_um": 8.0, "end_relief_high_length_mm": 4.0, "end_relief_shape": "parabolic"}})  # fmt: skip
    mesh = wide_mesh(one)
    made = wide_flanks(one, mesh).material(
        1, np.full(3, 0.01), np.array([1e-3, 3e-3, 5e-3]), np.zeros(3, int), mesh.faces[1]
    )
    assert 1e6 * made == pytest.approx([0.0, -2.0, -8.0], abs=1e-9)


def test_nothing_along_the_width_is_the_plane_problem() -> None:
    """Keys that are 0 and equal places do not make the load vary; one that is not does, and is named."""
    none = {"helix_crowning_um": 0.0, "end_relief_low_um": 0.0, "end_relief_low_length_mm": 1.0}
    plane = job({"torques_Nm": [60.0], "pinion": none}, helix_angle_deg=0.0, misalignment_um=0.0)
    assert plane.mesh.along_width() is None
    assert job(pinion={"y_mm": 3.0}, wheel={"y_mm": 3.0}).mesh.along_width() is None
    for changes, key in (
        ({"helix_angle_deg": 5.0}, "pair.helix_angle_deg"),
        ({"misalignment_um": 5.0}, "pair.misalignment_um"),
        ({"misalignment_across_um": 5.0}, "pair.misalignment_across_um"),
        ({"wheel": {"y_mm": 1.0}}, "pair.wheel.y_mm"),
    ):
        found = job(**changes).mesh.along_width()
        assert found is not None
        assert found[0] == key
    back = {"torques_Nm": [60.0], "pinion": {"right": {"helix_slope_um": 3.0}}}
    assert job(back).mesh.along_width() is None  # of flanks that do not drive, as modifications of the profile
    assert job(back).mesh.along_width(("left", "right")) == ("microgeometry.pinion.helix_slope_um", 3.0)


def test_what_closes_larger_y_carries_there_whichever_flanks_drive() -> None:
    """Slope and tilt of equal size give the same gap on a spur pair; right flanks are left ones seen from behind."""
    cases = {
        "slope": job({"torques_Nm": [60.0], "pinion": {"helix_slope_um": 12.0}}),
        "tilt": job(misalignment_um=12.0),
        "behind": job({"torques_Nm": [60.0], "flank": "right", "pinion": {"helix_slope_um": 12.0}}),
    }
    found = {name: columns(one) for name, one in cases.items()}
    for table in found.values():
        assert (np.array(table["status"]) == "converged").all()
        assert np.min(table["peak_y_mm"]) > 0.0
    for name in ("transmission_error_um", "peak_line_load_N_per_mm", "peak_y_mm"):
        assert np.array(found["tilt"][name]) == pytest.approx(np.array(found["slope"][name]), rel=1e-6)
        assert np.array(found["behind"][name]) == pytest.approx(np.array(found["slope"][name]), rel=1e-6)
    about = [np.array(found[name]["tilting_moment_wheel_about_centre_line_Nm"]) for name in ("slope", "behind")]
    # from behind the wheel is pushed the other way across the line of centres, at the same arm y
    assert np.abs(about[0]).min() > 0.01
    assert about[1] == pytest.approx(-about[0], rel=1e-6)


@pytest.mark.parametrize(("hand", "sign"), [("right", -1.0), ("left", 1.0)])
def test_axial_force_of_a_helical_pair(hand: str, sign: float) -> None:
    """F_a = T tan(beta)/r; a right-handed pinion that drives with left flanks pushes the wheel to smaller y."""
    one = job(helix_angle_deg=20.0, pinion={"helix_hand": hand})
    lines = job_lines(one)
    sweep = stiffness_sweep(one, lines)
    table, wheel = sweep_columns(one, lines.compliance.mesh, sweep), one.pair.wheel
    expected = sign * 60.0 * math.tan(math.radians(20.0)) / wheel.reference_radius
    assert np.array(table["axial_force_wheel_N"]) == pytest.approx(np.full(4, expected), rel=1e-9)
    points = load_columns(one, sweep)
    for angle in np.unique(points["pinion_angle_deg"]):
        there = points["pinion_angle_deg"] == angle
        force = float(np.sum(points["line_load_N_per_mm"][there] * points["length_mm"][there]))
        assert force == pytest.approx(60.0 / wheel.base_radius, rel=2e-3)  # tips bear with another arm
    summary = width_summary(one, lines.compliance.mesh, sweep, {})
    assert summary["by_torque"]["K_H_beta"][0] >= 1.0
    assert summary["along_the_width"]["because_of"] == "pair.helix_angle_deg"


def test_places_leave_a_common_width() -> None:
    one = job(pinion={"y_mm": 2.0}, wheel={"y_mm": -1.0, "face_width_mm": 12.0})
    mesh = wide_mesh(one)
    assert mesh.zone == pytest.approx((-3e-3, 5e-3))
    with pytest.raises(InputError, match=r"pair\.wheel\.y_mm = 12\.0: leaves a common width of -2 mm"):
        wide_mesh(job(wheel={"y_mm": 12.0}))


JOB = pair_job()
TILTED = ["--set", "pair.misalignment_um=5"]


def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, *line: str) -> str:
    path = tmp_path / "job.toml"
    path.write_text(text)
    assert main([line[0], str(path), *line[1:]]) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (["stiffness", "--check", "1"], "--check = [1]: is for loads alike along the face width"),
        (["stiffness", "--fields", "77"], "--fields = 77.0: is outside of the computed pinion angles"),
        (["stiffness", "--animation"], "--animation = 40: is for loads alike along the face width"),
        (["stiffness", "--law", "nitsche"], "stiffness.law = 'nitsche': is for loads alike along the face width"),
        (["stiffness", "--plane", "stress"], "stiffness.plane = 'stress': is for loads alike"),
        (["stiffness", "--points-per-edge", "5"], "stiffness.points_per_edge = 5: is for loads alike"),
        (["stiffness", "--torque-Nm", "1e6"], "stiffness.torque_Nm = 1000000.0: must be <="),
        (["mesh", "--layers", "0"], "--layers = 0: must be >= 1"),
        (["mesh", "--deck", "--set", "stiffness.plane='stress'"], "stiffness.plane = 'stress': is for loads alike"),
    ],
)
def test_what_does_not_take_a_load_along_the_width(
    line: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in refused(tmp_path, capsys, JOB, *line, *TILTED)


LEADS = [
    "helix_crowning_um = 4.0", "helix_slope_um = 4.0", "bias_um = 4.0",
    "end_relief_low_um = 4.0\nend_relief_low_length_mm = 2.0",
    "end_relief_high_um = 4.0\nend_relief_high_length_mm = 2.0",
    'triangular_reliefs = [{ corner = "tip_low", amount_um = 4.0, width_mm = 2.0, roll_length_mm = 1.0 }]',
]  # fmt: skip


def over_width(tmp_path: Path, text: str) -> list[bool]:
    """Which meshes of a gearbox have a mesh law over the face width."""
    path = tmp_path / "job.toml"
    path.write_text(text)
    job = read_train_job(path)
    return [law_over_width(job, number) for number in range(len(job.meshes))]


@pytest.mark.parametrize("lead", LEADS)
@pytest.mark.parametrize("side", ["", ".right"])
def test_lead_modifications_make_mesh_laws_over_the_width(lead: str, side: str, tmp_path: Path) -> None:
    """Of either flank, in the mesh of that gear alone."""
    text = job_file("gearbox")
    assert over_width(tmp_path, text) == [False, False]
    assert over_width(tmp_path, text + f"\n[gears.input_wheel.microgeometry{side}]\n{lead}\n") == [True, False]


@pytest.mark.parametrize("key", ["misalignment_um", "misalignment_across_um"])
def test_misalignment_makes_mesh_laws_over_the_width(key: str, tmp_path: Path) -> None:
    text = job_file("gearbox").replace("[meshes.second]", f"[meshes.second]\n{key} = 3.0", 1)
    assert over_width(tmp_path, text) == [False, True]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("end_relief_low_um = 4.0", "end_relief_low_length_mm: is required with end_relief_low_um"),
        ("end_relief_high_length_mm = 4.0", "end_relief_high_um: is required with end_relief_high_length_mm"),
        ("end_relief_high_um = -4.0", "end_relief_high_um = -4.0: must be"),
        ('triangular_reliefs = [{ corner = "top", amount_um = 4.0, width_mm = 2.0, roll_length_mm = 1.0 }]', "tip_low"),
        ("lead_crowning_um = 4.0", "helix_crowning_um"),
        ("crowning_um = 4.0", "write profile_crowning_um"),
    ],
)
def test_mistakes_in_lead_modifications(
    lines: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"{JOB}\n[microgeometry.pinion]\n{lines}\n"
    assert message in refused(tmp_path, capsys, text, "stiffness")


def test_the_commands_write_the_load_over_the_flank(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "job.toml"
    path.write_text(JOB)
    sets = ["--set", "pair.misalignment_um=8", "--set", "stiffness.coarsen=2.0"]
    line = ["stiffness", str(path), "--out", str(tmp_path / "out"), "--torque-Nm", "50", "--angles", "0", "6", "12"]
    assert main([*line, *sets]) == 0
    names = {one.name for one in (tmp_path / "out").iterdir()}
    assert names == {
        "stiffness.csv", "stiffness_load.csv", "stiffness_pattern.csv", "stiffness_load.png",
        "stiffness_flank.vtkhdf", "summary.json",
    }  # fmt: skip
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["along_the_width"]["because_of"] == "pair.misalignment_um"
    table = summary["by_torque"]
    load = read_csv(tmp_path / "out" / "stiffness_load.csv")
    most = int(np.argmax(load["line_load_N_per_mm"]))
    assert table["largest_line_load_N_per_mm"][0] == pytest.approx(load["line_load_N_per_mm"][most], rel=1e-12)
    assert table["largest_line_load_y_mm"][0] == pytest.approx(load["y_mm"][most], rel=1e-12)
    assert table["K_H_beta"][0] > 1.05
    printed = capsys.readouterr().out
    assert "K_Hbeta" in printed
    assert "load along the face width, by pair.misalignment_um" in printed
    # secant and tangent stiffness as of plane gears: F over the transmission error, and the slope, which is larger
    curve, radius = (
        read_csv(tmp_path / "out" / "stiffness.csv"),
        summary["derived_geometry"]["wheel"]["base_diameter_mm"],
    )
    force = curve["torque_wheel_Nm"] / (0.5e-3 * radius)
    assert curve["k_mesh_N_per_m"] == pytest.approx(1e6 * force / curve["transmission_error_um"], rel=1e-9)
    assert (curve["k_mesh_N_per_m"] < curve["k_tangent_N_per_m"]).all()
    secant = 1e-6 * table["k_mesh_mean_N_per_m"][0]
    assert f"mean mesh stiffness {secant:.4g} N/um (secant)" in printed
    # a map in the same folder, of two torques; then a plane curve leaves none of these files behind
    line[0] = "loadmap"
    assert main([*line[:4], "--torques-Nm", "20", "50", "--positions", "3", *sets]) == 0
    written = json.loads((tmp_path / "out" / "loadmap.json").read_text())
    rows = written["by_torque"]
    for name, errors in written["error_estimate"].items():
        assert len(errors) == 2, name
        assert max(errors) < (0.05 if "peak" in name else 0.03), name
    assert rows["torque_wheel_Nm"] == pytest.approx([20.0, 50.0], rel=1e-9)
    assert rows["K_H_beta"][0] > rows["K_H_beta"][1]  # a larger load spreads


def test_studies_take_lead_modifications(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cases that differ in the flanks alone share the elastic gears, and crowning raises the face load factor."""
    shared, found, condensed = Shared(), [], []
    make = width_job.wide_compliance
    monkeypatch.setattr(width_job, "wide_compliance", lambda *one, **more: condensed.append(1) or make(*one, **more))
    for crowning in (0.0, 15.0):
        raw = {
            "pair": {**PAIR, "misalignment_um": 2.0},
            "stiffness": COARSE,
            "microgeometry": {"torques_Nm": [60.0], "pinion": {"helix_crowning_um": crowning}},
        }
        answer = solve("stiffness", raw, Path("job.toml"), shared)
        assert answer.problem == ""
        found.append(answer)
    factors = [answer.summary["by_torque"]["K_H_beta"][0] for answer in found]
    assert factors[1] > 1.2 * factors[0]
    assert len(condensed) == 1
    raw["stiffness"] = {**COARSE, "law": "nitsche"}
    with pytest.raises(InputError, match=r"stiffness\.law = 'nitsche': is for loads alike"):
        solve("stiffness", raw, Path("job.toml"), shared)


@pytest.mark.parametrize(
    ("micro", "pair", "message"),
    [
        ({"helix_crowning_um": 300.0}, {}, r"microgeometry\.pinion\.helix_crowning_um = 300\.0: leaves the range"),
        ({"bias_um": 2.0, "end_relief_low_um": 900.0, "end_relief_low_length_mm": 2.0}, {}, r"end_relief_low_um = 900"),
        (
            {"triangular_reliefs": [{"corner": "tip_low", "amount_um": 400.0, "width_mm": 2.0, "roll_length_mm": 2.0}]},
            {},
            r"microgeometry\.pinion\.triangular_reliefs\[0\]\.amount_um = 400\.0: leaves the range",
        ),
        ({}, {"misalignment_um": -300.0}, r"pair\.misalignment_um = -300\.0: leaves the range.*<= 250 um, 0\.1 module"),
        (
            {},
            {"face_width_mm": 400.0, "helix_angle_deg": 5.0},
            r"pair\.face_width_mm = 400\.0: must be <= 87\.5 m",
        ),
    ],
)
def test_what_is_no_microgeometry(micro: dict[str, Any], pair: dict[str, Any], message: str) -> None:
    one = job({"torques_Nm": [60.0], "pinion": micro}, **pair)
    with pytest.raises(InputError, match=message):
        wide_flanks(one, wide_mesh(one))


def test_wide_meshes_take_helix_and_places_of_the_gears() -> None:
    gears = job(helix_angle_deg=15.0, pinion={"helix_hand": "left"}, wheel={"y_mm": 2.0}).pair
    mesh = WideMesh(gears)
    assert mesh.base_helix_angle == -gears.pinion.base_helix_angle
    assert mesh.centres == (0.0, 2e-3)
    assert mesh.turns[0] == pytest.approx(gears.pinion.twist_rate, rel=1e-12)
    assert mesh.turns[1] == pytest.approx(gears.wheel.twist_rate, rel=1e-12)
    assert mesh.overlap_ratio == pytest.approx(gears.overlap_ratio, rel=1e-12)
    with pytest.raises(InputError, match=r"base_helix_angle = 0\.1: is not that of the gears"):
        WideMesh(gears, 0.1)


def test_the_picture_of_the_flanks_shows_modifications_along_the_width() -> None:
    from gearfe.figures.flanks import flank_picture

    one = job({"torques_Nm": [60.0], "pinion": {"bias_um": 8.0, "right": {"helix_slope_um": 4.0}}})
    axes = flank_picture(one.mesh, one.pair, Path()).axes
    assert len(axes) == 8  # four charts over roll length, four along the width
    left, right = ([line.get_ydata() for line in axes[4 + i].lines] for i in (0, 1))
    assert [(line[0], line[-1]) for line in left] == [pytest.approx((-2.0, 2.0)), pytest.approx((2.0, -2.0))]
    assert [(line[0], line[-1]) for line in right] == [pytest.approx((-4.0, 4.0)), pytest.approx((0.0, 0.0))]
    assert not axes[6].get_visible()
    assert len(flank_picture(job({"torques_Nm": [60.0]}).mesh, one.pair, Path()).axes) == 4


@pytest.mark.parametrize("flank", ["left", "right"])
def test_the_pattern_lies_on_the_flank_in_space(flank: str, tmp_path: Path) -> None:
    """Radii are those of the roll lengths, and points of one radius turn by tan(beta)/r along y on either side."""
    h5py = pytest.importorskip("h5py")
    one = job({"torques_Nm": [60.0], "flank": flank}, helix_angle_deg=12.0)
    pinion = one.pair.pinion
    roll, y = np.linspace(6e-3, 9e-3, 4), np.linspace(-5e-3, 5e-3, 3)
    load = np.arange(12.0).reshape(4, 3)
    load[0, 0] = np.nan
    write_flank(tmp_path / "flank.vtkhdf", one, FlankLoad(60.0, roll, y, load, np.zeros(3)))
    with h5py.File(tmp_path / "flank.vtkhdf") as file:
        points = np.array(file["VTKHDF/Points"]).reshape(4, 3, 3)
        found = np.array(file["VTKHDF/PointData/line_load_N_per_mm"]).reshape(4, 3)
    assert found[0, 0] == 0.0
    assert found[1:] == pytest.approx(1e-3 * load[1:])
    radius, angle = np.hypot(points[..., 0], points[..., 1]), np.arctan2(points[..., 1], points[..., 0])
    assert radius == pytest.approx(np.repeat(np.hypot(pinion.base_radius, roll)[:, None], 3, axis=1), rel=1e-6)
    assert points[..., 2] == pytest.approx(np.repeat(y[None], 4, axis=0), rel=1e-6)
    rate = np.diff(angle, axis=1) / np.diff(y)
    assert rate == pytest.approx(np.full((4, 2), math.tan(math.radians(12.0)) / pinion.reference_radius), rel=1e-4)
    side = 1.0 if flank == "left" else -1.0
    assert (side * angle[:, 1] > 0.0).all()


def test_gaps_of_both_flanks_and_the_tilt_count_together() -> None:
    """Each is within 0.1 module by itself; opposite ones cancel."""
    both = {"torques_Nm": [60.0], "pinion": {"helix_crowning_um": 150.0}, "wheel": {"helix_crowning_um": 140.0}}
    with pytest.raises(InputError, match=r"pinion\.helix_crowning_um = 150\.0: leaves the range"):
        wide_flanks(job(both), wide_mesh(job(both)))
    tilted = job({"torques_Nm": [60.0], "pinion": {"helix_slope_um": 240.0}}, misalignment_um=245.0)
    wide_flanks(tilted, wide_mesh(tilted))  # half of each at the ends
    tilted = job({"torques_Nm": [60.0], "pinion": {"helix_slope_um": 300.0}}, misalignment_um=245.0)
    with pytest.raises(InputError, match=r"pinion\.helix_slope_um = 300\.0: leaves the range"):
        wide_flanks(tilted, wide_mesh(tilted))
    against = job({"torques_Nm": [60.0], "pinion": {"helix_slope_um": -300.0}}, misalignment_um=245.0)
    wide_flanks(against, wide_mesh(against))


def test_loads_beyond_linear_elasticity_are_reported_by_their_keys() -> None:
    """Torques before the gears are condensed, twists from where the flanks touch."""
    heavy = job(misalignment_um=5.0, stiffness={"torque_Nm": 1e5})
    with pytest.raises(InputError, match=r"stiffness\.torque_Nm = 100000\.0: must be <="):
        width_job.check_stiffness_job(heavy)
    table = replace(heavy.mesh.stiffness, torque_Nm=None, twist_deg=2.0)
    far = stiffness_job(replace(heavy.mesh, stiffness=table))
    with pytest.raises(InputError, match=r"stiffness\.twist_deg = 2\.0: must be <="):
        stiffness_sweep(far, job_lines(far))


def test_helices_are_drawn_where_the_gears_are() -> None:
    from gearfe.figures.gears import _draw_helices
    from gearfe.figures.style import new_figure

    axes = new_figure(4.0, 4.0).subplots()
    _draw_helices(axes, job(helix_angle_deg=10.0, wheel={"y_mm": 2.0}).pair, 0.0)
    middles = [0.5 * (patch.get_xy()[:, 1].min() + patch.get_xy()[:, 1].max()) for patch in axes.patches]
    assert middles == pytest.approx([0.0, 2.0])
