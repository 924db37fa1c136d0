"""A contact law of another package: one class and one entry point, known to job files, command line and Python."""

from __future__ import annotations

import importlib
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from gearfe import InputError, sweep_stiffness
from gearfe.cli.main import main
from gearfe.gears.contact.laws import PairModel, Penalty, law_named
from gearfe.gears.gearmesh.curve import StiffnessCurve
from gearfe.gears.gearmesh.job import curve_key, read_stiffness_job
from tests.makers.gears import pair as gear_pair
from tests.places import GEOMETRY

JOB = GEOMETRY / "gear_train.toml"
ELSEWHERE = """
from dataclasses import dataclass
from typing import ClassVar
import numpy as np

@dataclass(frozen=True)
class Springs:
    '''A bed of springs: p = max(0, -g times bed E/h).'''

    bed: float = 100.0
    name: ClassVar[str] = "springs"
    uses_stress: ClassVar[bool] = False
    sides: ClassVar[str] = "tip"

    def parameter(self, youngs_modulus, sizes):
        return np.full(len(sizes), self.bed * youngs_modulus / sizes.max())
"""


def installed(folder: Path, name: str, law: str) -> None:
    """What pip leaves of a package that names a law: its metadata."""
    info = folder / f"package_of_{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: package_of_{name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[gearfe.laws]\n{name} = {law}\n")


@pytest.fixture
def springs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> type:
    """A package outside of this one, with an entry point that names its law."""
    (tmp_path / "package_of_springs.py").write_text(ELSEWHERE)
    installed(tmp_path, "springs", "package_of_springs:Springs")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "package_of_springs", raising=False)
    return importlib.import_module("package_of_springs").Springs


def test_in_python(springs: type) -> None:
    """With 300 E/h it is the penalty by default; softer, its overlap grows."""
    gears = gear_pair(tip_round=1e-4)
    given = {"twist": math.radians(0.1), "angles": gears.mesh_cycle * np.array([0.2, 0.7]), "kinematics": "small"}
    same, penalty = (sweep_stiffness(gears, law=law, **given) for law in (springs(300.0), Penalty()))
    np.testing.assert_allclose(same.torque_wheel, penalty.torque_wheel, rtol=1e-12)
    by_name = sweep_stiffness(gears, law="springs", **given)
    assert set(by_name.law) == {"springs"}
    assert (by_name.torque_wheel < same.torque_wheel).all()
    assert law_named("springs", bed=7.0) == springs(7.0)
    keys = {curve_key(gears, PairModel(law=law), given) for law in (springs(300.0), springs(7.0), Penalty())}
    assert len(keys) == 3


def test_in_a_job_file_and_on_the_command_line(springs: type, tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    line = 'law = "springs"\nlaw_parameters = { bed = 300.0 }'
    text = JOB.read_text().replace("\n[stiffness]\n", f"\n[stiffness]\n{line}\n")
    job.write_text(text)
    assert read_stiffness_job(job).law == springs(300.0)
    options = ["--twist-deg", "0.1", "--angles", "2", "6", "8", "--no-pictures", "--no-estimate"]
    assert main(["stiffness", str(job), "--out", str(tmp_path / "one"), *options]) == 0
    line = ["--law", "springs", "--law-parameter", "bed", "300"]
    assert main(["stiffness", str(JOB), "--out", str(tmp_path / "two"), *options, *line]) == 0
    one, two = (StiffnessCurve.from_csv(tmp_path / name / "stiffness.csv") for name in ("one", "two"))
    np.testing.assert_array_equal(one.torque_wheel, two.torque_wheel)
    assert set(one.law) == {"springs"}
    assert "bed=300" in one.contact_law
    told = json.loads((tmp_path / "one" / "summary.json").read_text())
    assert told["job"]["stiffness"]["law_parameters"] == {"bed": 300.0}


def test_mistakes_are_told(springs: type, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stiffness", str(JOB), "--law", "spring"]) == 2
    assert "must be one of half_plane, nitsche, penalty, springs; did you mean 'springs'?" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"law_parameters.bet.*is no parameter of the law springs; it has bed"):
        law_named("springs", bet=1.0)
    with pytest.raises(InputError, match=r"it has none"):
        law_named("half_plane", bed=1.0)


def test_a_law_whose_package_is_broken_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    installed(tmp_path, "lost", "no_such_module:Law")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError, match=r"law = 'lost': cannot be loaded from no_such_module:Law"):
        law_named("lost")


def test_no_package_takes_a_name_of_ours(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    installed(tmp_path, "penalty", "no_such_module:Penalty")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert isinstance(law_named("penalty"), Penalty)
