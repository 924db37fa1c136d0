"""Measured topographies of flanks: places, signs and teeth of a file's grid, and mistakes in it."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.gears.gearmesh.job import StiffnessJob, stiffness_job
from gearfe.gears.gearmesh.topography import measured_topography
from gearfe.gears.gearmesh.width_job import job_lines, stiffness_sweep, wide_flanks, wide_mesh
from gearfe.gears.geometry.deviation_job import active_rolls
from gearfe.gears.geometry.pair import Gear, GearPair
from tests.gears.test_width_job import job


def grid(tmp_path: Path, rows: list[tuple[float, ...]], header: str = "roll_length_mm,y_mm,deviation_um") -> str:
    lines = [",".join(f"{value:.12g}" for value in row) for row in rows]
    (tmp_path / "flank.csv").write_text("\n".join([header, *lines]) + "\n")
    return "flank.csv"


def measured(tmp_path: Path, *, flank: str = "left", gear: str = "pinion", **changes: Any) -> StiffnessJob:
    table = {"torques_Nm": [60.0], "flank": flank, gear: {"topography_csv": "flank.csv"}}
    return stiffness_job(job(table, **changes).mesh, tmp_path)


ROLLS, WIDTHS = (2.0, 9.0, 16.0), (-5.0, 0.0, 5.0)


@pytest.mark.parametrize(("flank", "sense"), [("left", 1.0), ("right", -1.0)])
def test_material_of_a_grid(flank: str, sense: float, tmp_path: Path) -> None:
    """A function of both places without curvature is itself, also where the gear stands elsewhere; then it stays."""
    grid(tmp_path, [(s, y, 3.0 + 0.5 * s - 0.8 * y + 0.1 * s * y) for s in ROLLS for y in WIDTHS][::-1])
    one = measured(tmp_path, flank=flank, pinion={"y_mm": 1.0}, wheel={"y_mm": 1.0})
    mesh = wide_mesh(one)
    flanks = wide_flanks(one, mesh)
    assert flanks.alike
    roll, y = np.array([2.5, 8.0, 12.0]), np.array([-4.0, 1.0, 4.5])
    made = flanks.material(0, 1e-3 * roll, 1e-3 * sense * (y + 1.0), np.zeros(3, int), mesh.faces[0])
    assert 1e6 * made == pytest.approx(3.0 + 0.5 * roll - 0.8 * y + 0.1 * roll * y, abs=1e-9)
    ends = flanks.material(0, np.array([20e-3]), np.array([1e-3 * sense * 6.0]), np.zeros(1, int), mesh.faces[0])
    assert 1e6 * ends == pytest.approx([3.0 + 8.0 - 4.0 + 8.0], abs=1e-9)


@pytest.mark.parametrize(("flank", "gear"), [("left", "pinion"), ("right", "pinion"), ("right", "wheel")])
def test_teeth_that_were_not_measured_have_the_mean(flank: str, gear: str, tmp_path: Path) -> None:
    """Seen from behind, tooth j of the pinion is -j and that of the wheel -1 - j."""
    rows = [(s, y, tooth, 2.0 * tooth) for tooth in (0, 3, 6) for s in (1.0, 16.0) for y in (-5.0, 5.0)]
    grid(tmp_path, rows, "roll_length_mm,y_mm,tooth,deviation_um")
    one = measured(tmp_path, flank=flank, gear=gear)
    mesh, number = wide_mesh(one), 0 if gear == "pinion" else 1
    flanks = wide_flanks(one, mesh)
    assert not flanks.alike
    teeth = np.arange(8)
    solver = teeth if flank == "left" else -teeth - number
    found = flanks.material(number, np.full(8, 9e-3), np.zeros(8), solver, mesh.faces[number])
    assert 1e6 * found == pytest.approx(np.where(np.isin(teeth, (0, 3, 6)), 2.0 * teeth, 6.0), abs=1e-9)


def test_a_measured_slope_is_the_helix_slope(tmp_path: Path) -> None:
    """Transmission error and largest line load of a grid that is f_Hbeta = 12 um, and of the key."""
    grid(tmp_path, [(s, y, 1.2 * y) for s in ROLLS for y in WIDTHS])
    jobs = measured(tmp_path), job({"torques_Nm": [60.0], "pinion": {"helix_slope_um": 12.0}})
    assert jobs[0].mesh.along_width() == ("microgeometry.pinion.topography_csv", "flank.csv")
    lines = job_lines(jobs[1])
    sweeps = [stiffness_sweep(one, lines.with_flanks(wide_flanks(one, wide_mesh(one)))) for one in jobs]
    assert sweeps[0].transmission_error == pytest.approx(sweeps[1].transmission_error, rel=1e-9)
    assert sweeps[0].peak_line_load == pytest.approx(sweeps[1].peak_line_load, rel=1e-9)


WHOLE = [(s, y, 1.0) for s in (2.0, 16.0) for y in (-5.0, 5.0)]


@pytest.mark.parametrize(
    ("rows", "header", "message"),
    [
        (WHOLE[:-1], "roll_length_mm,y_mm,deviation_um", "is no whole grid: 3 rows"),
        ([*WHOLE, WHOLE[0]], "roll_length_mm,y_mm,deviation_um", "is no whole grid: 5 rows"),
        (WHOLE[:2], "roll_length_mm,y_mm,deviation_um", "is no whole grid: 2 rows"),
        ([(s, y, 900.0) for s, y, _ in WHOLE], "roll_length_mm,y_mm,deviation_um", "deviation_um = 900"),
        ([(s, 0.1 * y, h) for s, y, h in WHOLE], "roll_length_mm,y_mm,deviation_um", "face width"),
        ([(0.1 * s, y, h) for s, y, h in WHOLE], "roll_length_mm,y_mm,deviation_um", "active profile"),
        ([(*row, 20.0) for row in WHOLE], "roll_length_mm,y_mm,deviation_um,tooth", "must be whole, >= 0 and < 20"),
        ([(*row, 0.5) for row in WHOLE], "roll_length_mm,y_mm,deviation_um,tooth", "must be whole"),
        ([row[1:] for row in WHOLE], "y_mm,deviation_um", "roll_length_mm"),
        (
            [(d, y, 1.0) for d in (30.0, 52.0) for y in (-5.0, 5.0)],
            "diameter_mm,y_mm,deviation_um",
            "no involute there",
        ),
        ([(-d, y, 1.0) for d in (48.0, 52.0) for y in (-5.0, 5.0)], "diameter_mm,y_mm,deviation_um", "no involute"),
    ],
)
def test_mistakes_in_a_grid(rows: list[tuple[float, ...]], header: str, message: str, tmp_path: Path) -> None:
    grid(tmp_path, rows, header)
    one = measured(tmp_path)
    with pytest.raises(InputError, match=message) as error:
        wide_flanks(one, wide_mesh(one))
    assert error.value.field.startswith("microgeometry.pinion.topography_csv")


PLANET = Gear(22, 4e-3, math.radians(20.0), 0.05, 0.0432, rack_tip_radius=0.25)
RING = Gear(-61, 4e-3, math.radians(20.0), 0.05, rim_diameter=0.28, cutter_teeth=23, rack_tip_radius=0.0, addendum=0.9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("places", ["diameter_mm", "roll_length_mm"])
def test_a_ring_has_as_many_teeth_as_its_number_without_sign(places: str, sign: float, tmp_path: Path) -> None:
    """Diameters and roll lengths with the sign of an internal gear or without; tooth 60 is the last one."""
    rolls = np.sort(np.abs(active_rolls(GearPair(PLANET, RING))[1]))
    sizes = 1e3 * rolls if places == "roll_length_mm" else 2e3 * np.hypot(RING.base_radius, rolls)
    half = 0.5e3 * RING.face_width
    rows = [(sign * s, y, tooth, 1.0 + tooth) for tooth in (0, 60) for s in sizes for y in (-half, half)]
    name = grid(tmp_path, rows, f"{places},y_mm,tooth,deviation_um")
    flank: Any = SimpleNamespace(
        own=SimpleNamespace(topography_csv=name), where="microgeometry.wheel", folder=tmp_path, gear=RING, number=1,
        active=active_rolls(GearPair(PLANET, RING))[1],
    )  # fmt: skip
    made = measured_topography(flank, (-1e-3 * half, 1e-3 * half), 1.0, 1e-3)
    assert made is not None
    assert len(made.flank) == 61
    assert np.abs(made.roll) == pytest.approx(rolls[::-1], rel=1e-9)
    assert (made.roll < 0.0).all()
    material = made(np.full(3, made.roll[0]), np.zeros(3), np.array([0, 30, 60]))
    assert 1e6 * material == pytest.approx([1.0, 31.0, 61.0])
