"""The example of a two-stage gearbox in Python, and the models that its meshes own."""

from __future__ import annotations

import math
import runpy

import pytest

from gearfe import Gear, GearMesh, InputError, Material, PairModel, build_train, compute_meshes
from tests.makers.trains import train
from tests.places import ROOT

EXAMPLE = ROOT / "scripts" / "examples" / "two_stage.py"


def test_the_example_runs_and_its_forces_are_those_of_statics(capsys: pytest.CaptureFixture[str]) -> None:
    response = runpy.run_path(str(EXAMPLE))["response"]
    assert response.status == "done"
    mean = dict(zip(response.mesh_names, response.contact_force.mean(axis=0), strict=True))
    cosine = math.cos(math.radians(20.0))
    expected = {"first": 145.0 * 18 / 43 / (41e-3 * cosine), "second": 145.0 / (0.5 * 43 * 2.5e-3 * cosine)}
    assert mean == pytest.approx(expected, rel=0.02)  # a transient of 5 ms swings about them
    assert "mesh first: mean contact force" in capsys.readouterr().out


def test_the_example_has_25_lines() -> None:
    """Imports count, as do closing brackets; blank lines, comments and the docstring do not."""
    text = EXAMPLE.read_text(encoding="utf-8")
    lines = [line for line in text.split('"""')[2].splitlines() if line.strip() and not line.lstrip().startswith("#")]
    assert len(lines) <= 25
    assert max(map(len, lines)) <= 120


def test_a_model_that_is_not_computed_is_refused() -> None:
    rigid = train([(20, 31)], stiffness=PairModel())
    with pytest.raises(InputError, match=r"is a model that is not computed yet; call gearfe\.compute_meshes"):
        build_train(rigid)


def test_meshes_of_equal_gears_with_other_materials_have_laws_of_their_own() -> None:
    """And equal ones share one, for the larger force."""
    gear_train = train([(20, 31), (20, 31)], stiffness=PairModel(coarsen=4.0))
    made = compute_meshes(gear_train)
    assert made.meshes[0].stiffness is not None
    assert made.meshes[0].stiffness.largest_force == made.meshes[1].stiffness.largest_force
    soft = PairModel((Material(110e9, 0.3), Material(110e9, 0.3)), coarsen=4.0)
    first = GearMesh(gear_train.meshes[0].driver, gear_train.meshes[0].driven, soft)
    assert first.name == gear_train.meshes[0].name
    assert isinstance(gear_train.gears[0].gear, Gear)
