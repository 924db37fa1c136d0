"""Gears that their shafts tilt: the load along the face width of a mesh in a train."""

import json
import math
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.jobs import meshes_of
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.shaft_tilts import ShaftTilts, TiltedSweep, contact_moments, shaft_tilts, tilted_sweep
from gearfe.drivetrain.train import build_train
from gearfe.drivetrain.train.misalignment import TiltingTrain, misalignments
from gearfe.gears.gearmesh.job import StiffnessJob, stiffness_job
from gearfe.gears.gearmesh.width_job import job_lines, stiffness_angles
from gearfe.gears.width import ContactLines, Misalignment, sweep_width
from tests.drivetrain.test_rolling_train import CASES, carried

#: An overhung pinion on a steel shaft of 20 mm, bearings at -40 and 0, the gear at 30 mm; a wheel that nothing tilts.
SPAN, OVERHANG, DIAMETER, WIDTH, TORQUE = 0.04, 0.03, 0.02, 0.016, 60.0
YOUNG, POISSON = 206e9, 0.3


def text(*, sense: float = 1.0, mirrored: bool = False, extra: str = "") -> str:
    """The job; `sense`: of the drive's rotation, `mirrored`: y and -y exchanged."""
    side = -1.0 if mirrored else 1.0
    gear = "module_mm = 2.0\npressure_angle_deg = 20.0\nface_width_mm = 16.0\nbore_diameter_mm = 20.0\n"
    gear += f"tip_round_mm = 0.1\ntooth_thinning_um = 40.0\ny_mm = {side * 30.0}\n"
    return f"""
[gears.pinion]
teeth = 20
shaft = "input"
{gear}
[gears.wheel]
teeth = 30
shaft = "output"
{gear}
[meshes.only]
driver = "pinion"
driven = "wheel"
misalignment_from_shafts = true
{extra}
[meshes.only.stiffness]
torque_Nm = {TORQUE}
angle_step_deg = 4.5
coarsen = 3.0

[loadmap]
torques_Nm = [{TORQUE}, {2 * TORQUE}]
positions = 4

[shafts.input]
x_mm = 0.0
y_mm = {side * -5.0}
sections = [{{ length_mm = 90.0, outer_diameter_mm = 20.0 }}]
material = {{ youngs_modulus_GPa = 206.0, poisson_ratio = 0.3 }}

[shafts.output]
x_mm = 50.0
length_mm = 100.0
radius_mm = 15.0

[bearings]
A = {{ shaft = "input", y_mm = {side * -40.0}, stiffness_N_per_m = [1e13, 1e13, 1e13] }}
B = {{ shaft = "input", y_mm = 0.0, stiffness_N_per_m = [1e13, 1e13, 1e13] }}
C = {{ shaft = "output", y_mm = -40.0 }}
D = {{ shaft = "output", y_mm = {side * 10.0} }}

[train]
housing = "rigid"
drive = {{ shaft = "input", attachment = "A", speed_rad_per_s = {sense * 150.0} }}
loads = [{{ shaft = "output", attachment = "C", torque_Nm = {sense * TORQUE} }}]
"""


def prepared(content: str) -> tuple[StiffnessJob, ContactLines, ShaftTilts]:
    raw = tomllib.loads(content)
    (mesh,) = meshes_of(raw, "job.toml", None)
    shafts = shaft_tilts(raw, "job.toml", mesh)
    job = stiffness_job(shafts.mesh)
    return job, job_lines(job), shafts


@cache
def solved(content: str) -> TiltedSweep:
    job, lines, shafts = prepared(content)
    return tilted_sweep(job, lines, shafts, [TORQUE], stiffness_angles(job))


def overhung() -> tuple[float, float]:
    """Slope of the shaft at the gear per force and per moment there: Timoshenko's beam on two supports, overhung."""
    bending, area = YOUNG * math.pi / 64.0 * DIAMETER**4, math.pi / 4.0 * DIAMETER**2
    shear = YOUNG / (2.0 * (1.0 + POISSON)) * 6.0 * (1.0 + POISSON) / (7.0 + 6.0 * POISSON) * area
    by_force = OVERHANG * (2.0 * SPAN + 3.0 * OVERHANG) / (6.0 * bending) + OVERHANG / (shear * SPAN)
    by_moment = (SPAN + 3.0 * OVERHANG) / (3.0 * bending) + 1.0 / (shear * SPAN)
    return by_force, by_moment


def test_an_overhung_pinion_bears_next_to_its_bearing() -> None:
    """The free end is pushed away, the load moves towards the bearing, and its moment takes some of the tilt back."""
    job, lines, _ = prepared(text())
    found = solved(text())
    force = TORQUE / job.pair.wheel.base_radius
    by_force, by_moment = overhung()
    assert found.before[0] == pytest.approx([-by_force * force, 0.0], rel=2e-4, abs=1e-12)
    assert found.moments[0, 0] < 0.0
    expected = -by_force * force - by_moment * found.moments[0, 0]
    assert found.tilts[0, 0] == pytest.approx(expected, rel=2e-3)
    assert found.before[0, 0] < found.tilts[0, 0] < 0.0
    assert found.residual[0] <= 1e-3 * abs(found.tilts[0, 0])
    points = found.sweep.points
    place = np.average(points.z, weights=points.line_load * points.weight)
    assert place < 0.030
    assert found.moments[0, 0] == pytest.approx((place - 0.030) * force, rel=1e-2)
    # the same contact at that tilt, given as a number
    tilt = Misalignment(float(found.tilts[0, 0]), float(found.tilts[0, 1]))
    alone = lines.with_flanks(replace(lines.flanks, misalignment=tilt))
    again = sweep_width(alone, [TORQUE], angles=stiffness_angles(job))
    assert again.k_h_beta == pytest.approx(found.sweep.k_h_beta, rel=1e-9)
    assert found.sweep.k_h_beta[0] > 1.5


def test_moments_are_derivatives_of_the_energy_with_the_tilts() -> None:
    """At a constant torque dV*/dt, V* = V - T theta, whose derivative with the torque is -theta: by differences."""
    job, lines, _ = prepared(text())
    angles, step = stiffness_angles(job)[:2], 2e-5

    def contact(tilt: float, torque: float) -> Any:
        flanks = replace(lines.flanks, misalignment=Misalignment(tilt, 0.0))
        return sweep_width(lines.with_flanks(flanks), [torque], angles=angles)

    moments = [contact_moments(job, lines, contact(3e-4 + sign * step, TORQUE))[0][0] for sign in (-1.0, 1.0)]
    _, tangent = contact_moments(job, lines, contact(3e-4, TORQUE))
    assert tangent[0, 0] == pytest.approx((moments[1] - moments[0]) / (2.0 * step), rel=2e-2)
    # dM/dT = -dtheta/dt: Maxwell's reciprocity
    more = [contact_moments(job, lines, contact(3e-4, TORQUE + sign))[0][0] for sign in (-1.0, 1.0)]
    twists = [contact(3e-4 + sign * step, TORQUE).twist.mean() for sign in (-1.0, 1.0)]
    assert 0.5 * (more[1] - more[0]) == pytest.approx(-(twists[1] - twists[0]) / (2.0 * step), rel=2e-2)


@pytest.mark.parametrize(("changes", "flank", "sign"), [
    ({"sense": -1.0}, "right", 1.0),  # the other flanks drive: the same side of the width bears
    ({"mirrored": True}, "left", -1.0),  # the pinion overhangs towards smaller y
])  # fmt: skip
def test_turned_and_mirrored_trains(changes: dict[str, Any], flank: str, sign: float) -> None:
    job, _, shafts = prepared(text(**changes))
    found, first = solved(text(**changes)), solved(text())
    assert shafts.mesh.flank == flank
    assert job.mesh.flank == flank
    assert found.tilts[0, 0] == pytest.approx(sign * first.tilts[0, 0], rel=1e-3)
    assert found.moments[0, 0] == pytest.approx(sign * first.moments[0, 0], rel=1e-3)
    assert found.sweep.k_h_beta == pytest.approx(first.sweep.k_h_beta, rel=1e-3)


def test_manufacturing_and_shafts_add_up() -> None:
    """A tilt of the file against that of the shafts evens the load out; the shafts' part is reported by itself."""
    found = solved(text())
    against = solved(text(extra=f"misalignment_um = {-1e6 * float(found.before[0, 0]) * WIDTH}"))
    assert against.sweep.k_h_beta[0] < 1.1
    assert against.tilts[0, 0] == pytest.approx(found.before[0, 0], rel=0.02)
    assert abs(against.moments[0, 0]) < 0.05 * abs(found.moments[0, 0])


def test_the_train_at_rest_is_that_of_the_report() -> None:
    """Without moments, at the steady torque: `misalignments`, with springs and with rolling bearings."""
    for model in (prepared(text())[2].train.model, build_train(carried(CASES["angular"], ys=[0.012]))):
        for number, mesh in enumerate(misalignments(model)):
            found = TiltingTrain(model, number).at(1.0, np.zeros(2))
            assert found.tilts == pytest.approx([mesh.in_plane, mesh.across], rel=1e-6, abs=1e-12)
            assert np.linalg.eigvalsh(found.compliance).min() > -1e-15
            moved = TiltingTrain(model, number).at(1.0, np.array([1e-2, 0.0]))
            slope = (found.tilts - moved.tilts) / 1e-2
            assert slope == pytest.approx(found.compliance[:, 0], rel=2e-2, abs=1e-12)


def test_files_of_a_load_map(tmp_path: Path) -> None:
    """Tilts grow with the torque; a train of that file runs, too, and has the same misalignment as the force alone."""
    path = tmp_path / "job.toml"
    path.write_text(text())
    assert main(["loadmap", str(path), "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    entry = json.loads((tmp_path / "out" / "loadmap.json").read_text())["misalignment_by_shafts"]
    assert entry["driving_flanks"] == "left"
    assert entry["f_sh_of_middle_force_um"][1] == pytest.approx(2.0 * entry["f_sh_of_middle_force_um"][0], rel=1e-6)
    assert 1.9 < entry["f_sh_um"][1] / entry["f_sh_um"][0] < 2.1
    rows = np.genfromtxt(tmp_path / "out" / "loadmap_misalignment.csv", delimiter=",", names=True)
    assert rows["f_sh_um"] == pytest.approx(entry["f_sh_um"], rel=1e-6)


def refused(content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str = "stiffness") -> str:
    path = tmp_path / "job.toml"
    path.write_text(content)
    assert main([command, str(path), "--out", str(tmp_path / "out")]) == 2
    return capsys.readouterr().err


def test_mistakes_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = text()
    without = whole[: whole.index("[train]")]
    assert "meshes.only.misalignment_from_shafts" in refused(without, tmp_path, capsys)
    twist = whole.replace(f"torque_Nm = {TORQUE}\nangle", "twist_deg = 0.05\nangle")
    assert "give torque_Nm instead" in refused(twist, tmp_path, capsys)
    idle = whole.replace(f'loads = [{{ shaft = "output", attachment = "C", torque_Nm = {TORQUE} }}]', "")
    assert "carries none in steady running" in refused(idle, tmp_path, capsys)
    soft = whole.replace("[1e13, 1e13, 1e13]", "[1e5, 1e5, 1e5]")
    assert "range of microgeometry" in refused(soft, tmp_path, capsys)


def test_a_mesh_without_train_is_an_input_error() -> None:
    raw = tomllib.loads(text())
    (mesh,) = meshes_of(raw, "job.toml", None)
    del raw["train"]
    with pytest.raises(InputError, match="has no table"):
        shaft_tilts(raw, "job.toml", mesh)
