"""The drawing of a whole gearbox: what is in it, and that it shows what does not fit."""

from __future__ import annotations

import itertools
import math
import tomllib
from pathlib import Path

import pytest
from matplotlib.text import Text

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.layout import GearboxLayout, gearbox_layout
from gearfe.figures.gearbox import gearbox_picture
from gearfe.figures.style import RED
from tests.makers.gearboxes import AXES, GEARS, MESHES, text
from tests.places import GEOMETRY


def layout_of(job: str) -> GearboxLayout:
    layout = gearbox_layout(tomllib.loads(job), "box.toml")
    assert layout is not None
    return layout


def texts(layout: GearboxLayout) -> dict[str, str]:
    """Text -> colour of what is written in the picture."""
    found = [item for axes in gearbox_picture(layout).axes for item in axes.texts]
    return {item.get_text(): item.get_color() for item in found}


def test_names_places_and_distances() -> None:
    layout = layout_of(text())
    assert {gear.name: gear.teeth for gear in layout.gears} == {name: row[0] for name, row in GEARS.items()}
    for gear in layout.gears:
        z, module = GEARS[gear.name][:2]
        assert gear.reference_radius == pytest.approx(0.5e-3 * z * module)
        assert gear.tip_radius == pytest.approx(1e-3 * module * (0.5 * z + 1.0))  # an addendum of a module
        assert gear.centre[0] == pytest.approx(1e-3 * AXES[gear.shaft])
    for mesh in layout.meshes:
        one, two = (GEARS[name] for name in MESHES[mesh.name])
        assert mesh.centre_distance == pytest.approx(0.5e-3 * one[1] * (one[0] + two[0]))
        assert mesh.overlap == pytest.approx(1e-3 * min(one[2], two[2]))
        assert mesh.fits
    written = texts(layout)
    assert {*GEARS, *AXES} <= written.keys()
    assert "in: a = 55 mm" in written
    assert RED not in written.values()
    assert dict(layout.shafts[0].bearings) == {"s1_left": -0.04, "s1_right": 0.04}


def test_what_does_not_fit_is_red() -> None:
    """A shaft in a wrong place, and a gear beside its mate: drawn, not refused."""
    moved = layout_of(text(shafts__s4__x_mm=204.0))
    assert texts(moved)["out: a = 70 mm (gears: 69 mm)"] == RED
    assert "shafts 70 mm apart, but the gears need 69 mm" in moved.meshes[2].line()
    beside = layout_of(text(gears__wheel_2__y_mm=30.0))
    assert texts(beside)["wheel_2"] == RED
    assert "24 mm between them along the axis" in beside.meshes[2].line()


def test_names_lie_on_nothing_else() -> None:
    """A branch round a corner, shafts one behind the other: texts overlap neither each other nor circles of others."""
    places = {"s1": (0.0, 0.0), "s2": (-35.0, 42.426), "s3": (-35.0, -36.574), "s4": (-104.0, -36.574)}
    layout = layout_of(
        text(**{f"shafts__{n}__{k}_mm": v for n, at in places.items() for k, v in zip("xz", at, strict=True)})
    )
    assert all(mesh.fits for mesh in layout.meshes)
    figure = gearbox_picture(layout)
    figure.canvas.draw()
    for axes in figure.axes:
        boxes = {item.get_text(): Text.get_window_extent(item) for item in axes.texts}
        overlapping = [(a, b) for a, b in itertools.combinations(boxes, 2) if boxes[a].overlaps(boxes[b])]
        gears = {gear.name for gear in layout.gears}
        assert [pair for pair in overlapping if not gears & set(pair)] == []  # gears in mesh lie on each other
    along = figure.axes[0]
    for shaft in layout.shafts:
        (label,) = (item for item in along.texts if item.get_text().startswith(f"{shaft.name}\n"))
        (x, z), (right, top) = along.transData.inverted().transform(Text.get_window_extent(label).get_points())
        for gear in layout.gears:
            if gear.shaft != shaft.name:
                middle = 1e3 * gear.centre[0], 1e3 * gear.centre[2]
                apart = math.hypot(max(x - middle[0], middle[0] - right, 0.0), max(z - middle[1], middle[1] - top, 0.0))
                assert apart > 1e3 * gear.tip_radius


def test_the_command_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "box.toml").write_text(text())
    assert main(["gear", str(tmp_path / "box.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "mesh through: idler drives wheel_1, shafts 79 mm apart; 12 mm of width" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "gearbox.json",
        "gearbox.png",
        *sorted(MESHES),
    ]
    assert gearbox_layout(tomllib.loads((GEOMETRY / "microgeometry.toml").read_text()), "pair.toml") is None


def test_planets_that_overlap_are_named() -> None:
    """Six planets of 22 teeth on the shipped carrier are 78 mm apart, twice its radius times the sine of 30 degrees."""
    raw = tomllib.loads((GEOMETRY / "planetary.toml").read_text())
    layout = gearbox_layout(raw, "box.toml")
    assert layout is not None
    assert layout.collisions() == []
    raw["carriers"]["arm"]["planets"] = 6
    del raw["carriers"]["arm"]["pin_tangential_errors_um"]
    least = 2.0 * math.degrees(math.asin(layout.gear("planet_1").tip_radius / 0.078))
    for named in (raw, {**raw, "train": None}):
        given = {name: table for name, table in named.items() if table is not None}
        with pytest.raises(InputError, match=r"^carriers\.arm: has 6 planets, and gear 'planet_1' overlaps") as caught:
            gearbox_layout(given, "box.toml")
        assert f"axes 78 mm apart, tip circles need more than {2e3 * layout.gear('planet_1').tip_radius:.6g} mm" in str(
            caught.value
        )
        assert f"at least {least:.2f}" in str(caught.value)
        assert f"at most {math.floor(360.0 / least)} equally spaced" in str(caught.value)


def test_gears_that_overlap_without_a_carrier_are_listed() -> None:
    """A drawing may show gears that do not fit yet."""
    raw = tomllib.loads(text())
    raw["shafts"]["s3"]["x_mm"] = raw["shafts"]["s1"]["x_mm"] + 1.0
    layout = gearbox_layout(raw, "box.toml")
    assert layout is not None
    common = sum(layout.gear(name).tip_radius for name in ("sun", "wheel_1")) - 1e-3
    assert [line.partition(" over ")[0] for line in layout.collisions()] == [
        f"gears sun and wheel_1 overlap by {1e3 * common:.4g} mm"
    ]


def test_sections_of_an_elastic_shaft_are_drawn() -> None:
    """A step and a cone between the ends of the shaft, as the sections of the job file say."""
    raw = tomllib.loads(text())
    table = raw["shafts"]["s1"]
    del table["length_mm"], table["radius_mm"]
    table["sections"] = [
        {"length_mm": 60.0, "outer_diameter_mm": 20.0},
        {"length_mm": 40.0, "outer_diameter_start_mm": 16.0, "outer_diameter_end_mm": 10.0},
    ]
    layout = gearbox_layout(raw, "box.toml")
    assert layout is not None
    shaft = next(shaft for shaft in layout.shafts if shaft.name == "s1")
    assert (shaft.length, shaft.radius) == pytest.approx((0.1, 0.01))
    assert shaft.outline[0] == pytest.approx((-0.05, 0.01, 0.01, 0.01))
    assert shaft.outline[1] == pytest.approx((0.01, 0.05, 0.008, 0.005))
    side = gearbox_picture(layout).axes[1]
    ends = {
        (round(float(x), 6), round(float(y), 6)) for line in side.lines for x, y in zip(*line.get_data(), strict=True)
    }
    middle, across = 1e3 * shaft.centre[1], {1e3 * shaft.centre[0], 1e3 * shaft.centre[2]}
    assert any({(middle + 10.0, at + 8.0), (middle + 50.0, at + 5.0)} <= ends for at in across)
