"""Gears for CAD, read back by the libraries that read such files, against the exact profile."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gearfe.cli.main import main
from gearfe.fem.meshing.session import gmsh_session
from gearfe.gears.geometry.curves import coordinates
from gearfe.gears.geometry.deviation import Deviation
from gearfe.gears.geometry.face import ToothDeviations
from gearfe.gears.geometry.outline import tooth_outline, whole_outline
from gearfe.gears.geometry.pair import Gear
from gearfe.gears.teeth.gear_solid import write_solid
from gearfe.output.exchange.tables import read_csv
from tests.makers.gears import gear, pair
from tests.makers.job_texts import pair_job


def area(wheel: Gear) -> float:
    """Area of a gear with its bore (mm2), by the divergence theorem over a fine outline."""
    points = 1e3 * np.concatenate([piece.points[:-1] for piece in tooth_outline(wheel, 1500)])
    step = 2.0 * math.pi / wheel.teeth
    turned = points[0] @ np.array([[math.cos(step), math.sin(step)], [-math.sin(step), math.cos(step)]])
    x, y = np.vstack([points, turned]).T
    sector = 0.5 * float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
    return wheel.teeth * sector - math.pi * (0.5e3 * wheel.bore_diameter) ** 2


FORMS = {
    "rounded": {"tip_round": 1e-4},
    "undercut": {"profile_shift": -0.3},
    "shifted": {"profile_shift": 0.5, "rack_tip_radius": 0.1},
}


def test_pieces_of_a_tooth_join_and_have_outward_normals():
    pieces = tooth_outline(gear(17, tip_round=1e-4, profile_shift=0.2))
    for one, two in pairwise(pieces):
        np.testing.assert_allclose(one.points[-1], two.points[0], rtol=0, atol=1e-15)
    for piece in pieces:  # counter-clockwise: the outside is on the right
        along = np.diff(piece.points, axis=0)
        normal = 0.5 * (piece.normals[1:] + piece.normals[:-1])
        assert (along[:, 0] * normal[:, 1] - along[:, 1] * normal[:, 0] < 0).all(), piece.name


@pytest.mark.parametrize(("suffix", "form"), [("step", "rounded"), ("step", "undercut"), ("brep", "shifted")])
def test_solids_have_the_volume_and_the_flanks_of_the_gear(suffix, form, tmp_path):
    made = gear(13, **FORMS[form])
    path = tmp_path / f"gear.{suffix}"
    heights = [0.0, 0.0, -20e-6] if form == "rounded" else [0.0, 0.0, 0.0]
    rolls = [made.profile.form_roll, 0.5 * (made.profile.form_roll + made.profile.tip_roll), made.profile.tip_roll]
    own = ToothDeviations((Deviation.straight(rolls, heights),))
    write_solid(path, made, (own, own))
    flank = 1e3 * displaced(made, np.linspace(made.profile.form_roll, made.profile.round_roll, 37), own, 0)
    with gmsh_session() as gmsh:
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        ((_, solid),) = gmsh.model.getEntities(3)
        volume = gmsh.model.occ.getMass(3, solid)
        places = np.column_stack([flank, np.zeros(len(flank))]).ravel()
        off = np.full(len(flank), np.inf)
        for _, face in gmsh.model.getEntities(2):
            found, _ = gmsh.model.getClosestPoint(2, face, places)
            off = np.minimum(off, np.abs(found - places).reshape(-1, 3).max(axis=1))
    # what the reliefs take away: h along the flank's arc, ds = (s / r_b) d(roll), of 13 teeth with two flanks
    roll = np.linspace(rolls[0], made.profile.round_roll, 2001)
    taken = 26 * 1e9 * made.face_width * np.trapezoid(own.profiles[0].at(roll)[0] * roll / made.base_radius, roll)
    assert volume == pytest.approx(area(made) * 1e3 * made.face_width + taken, rel=2e-4 if taken else 1e-5)
    assert off.max() < 1e-5  # mm


def test_a_helical_solid_has_the_flanks_of_its_turned_sections(tmp_path):
    made = gear(13, helix_angle=math.radians(20.0), hand="left", tip_round=1e-4)
    path = tmp_path / "gear.step"
    write_solid(path, made)
    roll = np.linspace(made.profile.form_roll, made.profile.round_roll, 9)
    places = []
    for share in (-0.5, -0.31, 0.02, 0.43):  # not the places of the sections alone
        z = 1e3 * made.face_width * share
        turn = math.radians(20.0)
        point = 1e3 * made.profile.flank.at(roll) * np.exp(-1j * math.tan(turn) * z / (1e3 * made.reference_radius))
        places.append(np.column_stack([point.real, point.imag, np.full(len(roll), z)]))
    places = np.concatenate(places)
    with gmsh_session() as gmsh:
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        ((_, solid),) = gmsh.model.getEntities(3)
        volume = gmsh.model.occ.getMass(3, solid)
        off = np.full(len(places), np.inf)
        for _, face in gmsh.model.getEntities(2):
            found, _ = gmsh.model.getClosestPoint(2, face, places.ravel())
            off = np.minimum(off, np.abs(found - places.ravel()).reshape(-1, 3).max(axis=1))
    assert volume == pytest.approx(area(made) * 1e3 * made.face_width, rel=1e-5)
    assert off.max() < 1e-5  # mm


def test_the_command_exports_both_gears(tmp_path, capfd):
    (tmp_path / "pair.toml").write_text(pair_job())
    line = ["gear", str(tmp_path / "pair.toml"), "--out", str(tmp_path / "out"), "--export"]
    assert main([*line, "csv,step"]) == 0
    out = capfd.readouterr().out
    assert "pinion.csv, pinion.step, wheel.csv, wheel.step" in out
    assert "*****" not in out  # the CAD kernel's own words
    table = read_csv(tmp_path / "out" / "wheel.csv")
    assert table["radius_mm"].max() == pytest.approx(0.5 * (75.0 + 2 * 2.5), abs=1e-9)  # 30 teeth, 2.5 mm
    assert table["radius_mm"].min() == pytest.approx(0.5 * (75.0 - 2 * 1.25 * 2.5), abs=1e-9)
    assert set(table["piece"]) >= {"involute_left", "tip_right", "trochoid_left"}
    assert main([*line, "iges"]) == 2
    assert "csv, dxf, step, brep" in capfd.readouterr().err
    # a later run keeps the solids of the same gears
    assert main([*line[:-1], "--no-pictures"]) == 0
    assert (tmp_path / "out" / "wheel.step").exists()
    # and leaves none of other gears; one gear by its file's name, without a picture
    capfd.readouterr()
    other = ["--no-pictures", "--set", "pair.wheel.bore_diameter_mm=12"]
    assert main([*line, "pinion.csv", *other]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"gear_pair.json", "pinion.csv"}
    assert "pinion.step, wheel.csv, wheel.step" in capfd.readouterr().out.splitlines()[-1]
    assert main([*line, "pinon.csv"]) == 2
    assert "did you mean 'pinion.csv'" in capfd.readouterr().err


def test_deviations_stand_in_the_table(tmp_path, capsys):
    """Crowning of 4 um is 0 in the middle between form and tip circle and -4 um at both ends; the slope adds a line."""
    (tmp_path / "pair.toml").write_text(
        pair_job() + "\n[microgeometry]\ntorques_Nm = [100.0]\n[microgeometry.pinion]\nprofile_crowning_um = 4.0\n"
        "[microgeometry.pinion.right]\nprofile_slope_um = 6.0\n"
    )
    line = ["gear", str(tmp_path / "pair.toml"), "--out", str(tmp_path / "out"), "--no-pictures", "--export"]
    assert main([*line, "csv"]) == 0
    assert "flanks with the deviations of [microgeometry]" in capsys.readouterr().out
    table = read_csv(tmp_path / "out" / "pinion.csv")
    pinion = pair(20, 30, tip_round=1e-4).pinion
    low, high = pinion.form_roll, pinion.profile.tip_roll
    for side, slope in (("left", 0.0), ("right", 6.0)):
        there = table["piece"] == f"involute_{side}"
        x = (np.sqrt((1e-3 * table["radius_mm"][there]) ** 2 - pinion.base_radius**2) - low) / (high - low) - 0.5
        assert table["deviation_um"][there] == pytest.approx(-16.0 * x**2 + slope * x, abs=1e-6)
    assert np.isnan(table["deviation_um"][table["piece"] == "tip_left"]).all()


def displaced(made: Gear, roll: np.ndarray, own: ToothDeviations, tooth: int) -> np.ndarray:
    """Points (m) of a left flank: the involute's, moved by h along its normal (s e_r + r_b e_phi)/r, and turned."""
    points = coordinates(made.profile.flank.at(roll))
    out = points / np.hypot(*points.T)[:, None]
    round_ = np.column_stack([-out[:, 1], out[:, 0]])
    normal = (roll[:, None] * out + made.base_radius * round_) / np.hypot(roll, made.base_radius)[:, None]
    height = own.profiles[int(own.profile_of(np.array(tooth)))].at(roll)[0]
    moved = points + height[:, None] * normal
    turn = np.exp(1j * (float(own.turn_of(np.array(tooth))) + 2.0 * math.pi * tooth / made.teeth))
    turned = (moved[:, 0] + 1j * moved[:, 1]) * turn
    return np.column_stack([turned.real, turned.imag])


@pytest.mark.parametrize("form", list(FORMS))
def test_outlines_have_relief_and_pitch_errors_on_their_own_flanks(form):
    """Left flanks of two teeth moved along their normals; right ones are their mirror images."""
    made = gear(13, **FORMS[form])
    form_roll, tip = made.profile.form_roll, made.profile.tip_roll
    start = 0.5 * (form_roll + tip)
    relieved = Deviation.straight([form_roll, start, tip], [0.0, 0.0, -20e-6])
    crowned = Deviation.straight([form_roll, start, tip], [-5e-6, 2e-6, -10e-6])
    own = ToothDeviations((relieved, crowned), (0, 1) + (0,) * 11, (0.0, 3e-4) + (0.0,) * 11)
    teeth = whole_outline(made, (own, ToothDeviations()), per_piece=200)
    line = np.concatenate([piece.points for tooth in teeth for piece in tooth])
    assert np.hypot(*np.diff(np.vstack([line, line[:1]]), axis=0).T).max() < 0.2e-3  # closed
    radius = np.hypot(*line.T)
    assert radius.max() == pytest.approx(made.tip_radius, rel=1e-12)
    assert radius.min() == pytest.approx(made.root_radius, rel=1e-12)
    roll = np.linspace(form_roll, made.profile.round_roll, 41)[1:-1]
    for tooth in (0, 1):
        flank = [piece.points for piece in teeth[tooth] if piece.name == "involute_left"]
        assert distance(displaced(made, roll, own, tooth), np.concatenate(flank)) < 1e-8
    back = whole_outline(made, (ToothDeviations(), own), per_piece=200)
    for one, two in zip(teeth[0], reversed(back[0]), strict=True):
        np.testing.assert_allclose(one.points, two.points[::-1] * [1.0, -1.0], rtol=0, atol=1e-15)


def distance(points: np.ndarray, line: np.ndarray) -> float:
    """Largest distance of points from a polygon."""
    a, b = line[:-1], line[1:]
    along = b - a
    share = ((points[:, None] - a) * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-300)
    nearest = a + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return float(np.hypot(*np.moveaxis(points[:, None] - nearest, 2, 0)).min(axis=1).max())


def test_a_drawing_in_layers(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="pip install 'gearfe[exchange]'")
    (tmp_path / "pair.toml").write_text(pair_job())
    assert main(["gear", str(tmp_path / "pair.toml"), "--out", str(tmp_path), "--export", "dxf", "-q"]) == 0
    drawing = ezdxf.readfile(Path(tmp_path / "pinion.dxf"))
    assert drawing.units == ezdxf.units.MM
    (outline,) = drawing.modelspace().query('LWPOLYLINE[layer=="outline"]')
    x, y = np.array(outline.get_points("xy")).T
    assert outline.closed
    radii = {circle.dxf.layer: circle.dxf.radius for circle in drawing.modelspace().query("CIRCLE")}
    assert radii == pytest.approx(
        {"bore": 5.0, "reference_circle": 25.0, "base_circle": 25.0 * math.cos(math.radians(25))}
    )
    made = gear(20, tip_round=1e-4)
    enclosed = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    assert enclosed - math.pi * 25.0 == pytest.approx(area(made), rel=1e-5)
