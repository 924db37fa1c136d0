"""Studies of gearboxes by name: keys of gears and meshes, one mesh of several, tolerances of a gear."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfe.base.errors import InputError
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.sweep import sweep_stiffness
from gearfe.gears.geometry.tolerances import tolerances
from gearfe.study.job import read_study, run_study
from tests.makers.gearboxes import text

STUDY = """
[study]
job = "stiffness"
mesh = "out"
design = "factorial"
outputs = { k = "mean(k_mesh_N_per_m)" }
"""


def study_of(folder: Path, parameters: str, head: str = STUDY, **changes: object) -> Path:
    (folder / "study.toml").write_text(f"{text(**changes)}{head}[study.parameters]\n{parameters}")
    return folder / "study.toml"


def test_keys_of_gears_and_meshes_vary(tmp_path: Path) -> None:
    """Each case has the digits of the job with these keys."""
    lines = "gears.wheel_2.face_width_mm = [20.0, 22.0]\nmeshes.out.centre_distance_mm = [69.0, 69.05]\n"
    study = read_study(study_of(tmp_path, lines))
    found = run_study(study, tmp_path / "out", jobs=1).output("k")
    for (width, distance), k in zip(study.cases, found, strict=True):
        keys = {"gears__wheel_2__face_width_mm": width, "meshes__out__centre_distance_mm": distance}
        (tmp_path / "one.toml").write_text(text(**keys))
        job = read_stiffness_job(tmp_path / "one.toml", "out")
        assert sweep_stiffness(job.pair, job.model, **job.sweep).k_mesh.mean() == pytest.approx(k, rel=1e-12)
    assert len(set(found)) == 4


def test_a_tolerance_class_is_that_of_the_gear(tmp_path: Path) -> None:
    line = "gears.wheel_2.microgeometry.profile_slope_um = { iso_class = 6 }\n"
    changes = {"gears__wheel_2__microgeometry": {"profile_slope_um": 0.0}}
    (parameter,) = read_study(study_of(tmp_path, line, STUDY.replace("factorial", "sobol"), **changes)).parameters
    (tmp_path / "one.toml").write_text(text())
    gear = read_stiffness_job(tmp_path / "one.toml", "out").pair.wheel
    assert parameter.ends[1] == pytest.approx(1e6 * tolerances(gear, 6).slope)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("gears.sum.teeth = [20, 21]", r"study\.parameters\.gears: unknown name 'sum'; did you mean 'sun'"),
        ("gears.sun.tooth = [20, 21]", r"study\.parameters\.gears\.sun: unknown name 'tooth'; did you mean 'teeth'"),
        ("meshes.in.centre_distance = [55.0]", r"meshes\.in: unknown name 'centre_distance'; did you mean 'centre_dis"),
        ("gears.sun = [1]", r"study\.parameters\.gears\.sun: is a table, not a key"),
        ("gears.sun.teeth = { low = 20, high = 19 }", "high|low"),
        ("train.duration_ms = [1.0]", r"is no table that a stiffness job reads"),
        (
            "pair.pinion.profile_shift = [0.0, 0.1]",
            r"study\.parameters = 'pair': is no table of the base job.*vary keys of",
        ),
    ],
)
def test_mistakes(line: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        read_study(study_of(tmp_path, line + "\n"))


def test_several_meshes_need_a_name(tmp_path: Path) -> None:
    path = study_of(tmp_path, "gears.sun.face_width_mm = [14.0]\n", STUDY.replace('mesh = "out"\n', ""))
    with pytest.raises(InputError, match=r"the file has several: in, through, out; name one: .*mesh = \"NAME\""):
        run_study(read_study(path), tmp_path / "out", jobs=1)


def test_an_unknown_mesh_is_named_by_its_key(tmp_path: Path) -> None:
    path = study_of(tmp_path, "gears.sun.face_width_mm = [14.0]\n", STUDY.replace('mesh = "out"', 'mesh = "outt"'))
    with pytest.raises(InputError, match=r"study\.mesh: unknown name 'outt'; did you mean 'out'"):
        run_study(read_study(path), tmp_path / "out", jobs=1)
