"""Sections of shafts in job files: lists and named tables, what follows from them, and mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.examples import job_file as example
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.train import GearTrain
from tests.makers.files import csv_rows, job_file
from tests.makers.job_texts import BARE_TRAIN, BORES
from tests.places import GEOMETRY

RIGID = "length_mm = 60.0\nradius_mm = 8.0\nattachments = [1, 2]\n"
STEPPED = """attachments = [1, 2]
damping_ratio = 0.005
highest_frequency_Hz = 8000.0
[[train.shafts.sections]]
length_mm = 24.0
outer_diameter_mm = 16.0
inner_diameter_mm = 6.0
[[train.shafts.sections]]
length_mm = 12.0
outer_diameter_mm = 20.0
[[train.shafts.sections]]
length_mm = 24.0
outer_diameter_start_mm = 18.0
outer_diameter_end_mm = 14.0
material = { youngs_modulus_GPa = 110.0, poisson_ratio = 0.3, density_kg_per_m3 = 4500.0 }
"""
JOB = BARE_TRAIN + BORES


def read(folder: Path, text: str) -> GearTrain:
    return job_train(read_train_job(job_file(folder, text)))


def test_sections_of_a_list(tmp_path: Path) -> None:
    shaft, other = read(tmp_path, JOB.replace(RIGID, STEPPED)).shafts
    assert (shaft.length, shaft.radius) == pytest.approx((0.06, 0.01))
    assert (shaft.damping_ratio, shaft.highest_hz) == (0.005, 8000.0)
    hollow, thick, cone = shaft.sections
    assert (hollow.outer_start, hollow.inner_start, hollow.inner_end) == pytest.approx((0.016, 0.006, 0.006))
    assert (hollow.young, hollow.density) == pytest.approx((200e9, 7850.0))
    assert (cone.outer_start, cone.outer_end, cone.young, cone.density) == pytest.approx((0.018, 0.014, 110e9, 4500.0))
    assert thick.inner_start == 0.0
    assert shaft.radius_within(-0.001, 0.001) == pytest.approx(0.01)
    for low, high, first, last in shaft.outline:  # a gear between two shoulders, by rounding beyond them
        within = shaft.radius_within(low * (1.0 - 4e-16) - 1e-17, high * (1.0 + 4e-16) + 1e-17)
        assert within == pytest.approx(max(first, last), rel=1e-12)
    assert shaft.radius_within(0.018, 0.03) == pytest.approx(0.008)  # the cone half way on
    assert other.sections == ()


def test_materials_by_name(tmp_path: Path) -> None:
    text = example("gearbox")
    named = text.replace(
        "[shafts.intermediate]\nx_mm",
        '[shafts.intermediate]\nmaterial = "cast_iron"\n'
        "sections = [{ length_mm = 40.0, outer_diameter_mm = 24.0 }, "
        '{ length_mm = 60.0, outer_diameter_mm = 20.0, material = "case_hardened_steel" }]\nx_mm',
    )
    lines = [line for line in named.splitlines() if not line.startswith(("length_mm = 100.0", "radius_mm = 12.0"))]
    whole = "\n".join(lines).replace("[shafts.input]", "[shafts.input]\nlength_mm = 100.0")
    whole = whole.replace("[shafts.output]", "[shafts.output]\nlength_mm = 100.0")
    shaft = read(tmp_path, whole).shaft("intermediate")
    assert [part.young for part in shaft.sections] == pytest.approx([175e9, 206e9])
    assert [part.density for part in shaft.sections] == pytest.approx([7200.0, 7830.0])
    with pytest.raises(InputError, match=r"shafts.intermediate.material.*did you mean 'cast_iron'"):
        read(tmp_path, whole.replace('material = "cast_iron"\nsections', 'material = "cast_irn"\nsections'))


def test_material_of_a_rigid_shaft(tmp_path: Path) -> None:
    brass = "material = { youngs_modulus_GPa = 100.0, poisson_ratio = 0.35, density_kg_per_m3 = 8500.0 }\n"
    assert read(tmp_path, JOB.replace(RIGID, brass + RIGID)).shafts[0].density == 8500.0
    assert read(tmp_path, JOB).shafts[0].density == 7850.0


@pytest.mark.parametrize(
    ("old", "new", "field", "text"),
    [
        ("attachments = [1, 2]", "length_mm = 61.0\nattachments = [1, 2]", "shafts[0].length_mm", "60 mm"),
        ("attachments = [1, 2]", "radius_mm = 9.0\nattachments = [1, 2]", "shafts[0].radius_mm", "10 mm"),
        ("attachments = [1, 2]", "mass_kg = 1.0\nattachments = [1, 2]", "shafts[0].mass_kg", "leave it out"),
        ("attachments = [1, 2]", 'material = "iron"\nattachments = [1, 2]', "shafts[0].material", "this file has none"),
        ("attachments = [1, 2]", "elements = 0\nattachments = [1, 2]", "shafts[0].elements", ">= 1"),
        ("outer_diameter_mm = 20.0", "", "sections[1].outer_diameter_mm", "is required"),
        ("outer_diameter_mm = 20.0", "outer_diameter_mm = -20.0", "sections[1].outer_diameter_mm", "> 0"),
        ("outer_diameter_end_mm = 14.0", "", "sections[2].outer_diameter_end_mm", "is required with"),
        (
            "outer_diameter_end_mm = 14.0",
            "outer_diameter_end_mm = 14.0\nouter_diameter_mm = 1.0",
            "sections[2].outer_diameter_start_mm",
            "leave one out",
        ),
        ("inner_diameter_mm = 6.0", "inner_diameter_mm = 16.0", "sections[0].inner_diameter_mm", "16 mm"),
        ("length_mm = 24.0", "length_mm = 0.0", "sections[0].length_mm", "> 0"),
        ("length_mm = 24.0", "length_mm = 8.0", "attachment '1'", "sections reach from -14 to 14 mm"),
        ("y_mm = 0.0\nteeth = 18", "y_mm = 17.0\nteeth = 18", "attachment '1'", "within gear 'a' from 11 to 23 mm"),
        ("outer_diameter_mm = 20.0", "outer_diameter_mm = 31.5", "shaft 'in'", "root radius"),
        ("attachment = 1\nspeed", "attachment = 1\ny_mm = 40.0\nspeed", "drive y_mm", "from -30 to 30 mm"),
    ],
)
def test_mistakes(tmp_path: Path, old: str, new: str, field: str, text: str) -> None:
    job = JOB.replace(RIGID, STEPPED)
    assert old in job
    with pytest.raises(InputError) as error:
        read(tmp_path, job.replace(old, new))
    assert field in error.value.field, str(error.value)
    assert text in str(error.value)
    assert error.value.cure


def test_keys_of_elastic_shafts_need_sections(tmp_path: Path) -> None:
    for key in ("elements = 4", "highest_frequency_Hz = 1e4", "damping_ratio = 0.01"):
        with pytest.raises(InputError, match="add sections"):
            read(tmp_path, JOB.replace(RIGID, f"{key}\n{RIGID}"))
    for key in ("length_mm", "radius_mm"):
        lines = [line for line in RIGID.splitlines(keepends=True) if not line.startswith(key)]
        with pytest.raises(InputError, match=rf"shafts\[0\].{key}: is required"):
            read(tmp_path, JOB.replace(RIGID, "".join(lines)))
    both = "material = { density_kg_per_m3 = 7000.0 }\ndensity_kg_per_m3 = 7100.0\n"
    with pytest.raises(InputError, match="leave one out"):
        read(tmp_path, JOB.replace(RIGID, both + RIGID))


def test_a_shaft_fits_its_bore(tmp_path: Path) -> None:
    """The shipped housing's bores have radii of 10 mm, bosses included from y = 25 mm on."""
    text = (GEOMETRY / "gear_train.toml").read_text(encoding="utf-8")
    sections = "\n".join(
        f"[[train.shafts.sections]]\nlength_mm = {length}\nouter_diameter_mm = {diameter}"
        for length, diameter in ((16.0, 20.0), (50.0, 22.0), (16.0, "END"))
    )
    rigid = 'length_mm = 82.0\nradius_mm = 10.0\nattachments = ["1", "2"]'
    assert rigid in text
    elastic = text.replace(rigid, f'attachments = ["1", "2"]\n{sections}')
    assert read(tmp_path, elastic.replace("END", "20.0")).shafts[0].radius == pytest.approx(0.011)
    with pytest.raises(InputError, match=r"wider than attachment '1' from y = 25 to 41 mm: must be <= 20 mm"):
        read(tmp_path, elastic.replace("END", "20.5"))


def test_the_command_reports_shafts_and_misalignment(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Terminal, summary.json and misalignment.csv say the same, in um over the common face width."""
    path, out = job_file(tmp_path, JOB.replace(RIGID, STEPPED)), tmp_path / "out"
    options = ["--no-pictures", "--no-estimate", "--no-floquet", "--out", str(out)]
    assert main(["vibration", str(path), *options]) == 0
    said = capsys.readouterr().out
    assert "shaft in: elastic" in said
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    mesh = summary["misalignment"]["a-b"]
    assert f"mesh a-b: misalignment in the plane of action, f_sh: {mesh['f_sh_um']:.3g} um over 12 mm" in said
    (row,) = csv_rows(out / "misalignment.csv")
    assert row["mesh"] == "a-b"
    assert float(row["f_sh_um"]) == pytest.approx(mesh["f_sh_um"])
    assert float(row["f_sh_um"]) == pytest.approx(12e-3 * float(row["tilt_in_plane_urad"]))
    parts = [float(row[f"f_sh_by_{part}_um"]) for part in ("shafts", "bearings", "housing")]
    assert sum(parts) == pytest.approx(mesh["f_sh_um"])
    assert parts[1:] == pytest.approx([0.0, 0.0], abs=1e-9)  # hinges in a rigid housing
    assert summary["elastic_shafts"]["in"]["highest_frequency_Hz"] == 8000.0
