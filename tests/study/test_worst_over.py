"""The worst of each output over values of further keys: a closed form, and the crowning that bears misalignments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.study.job import read_study, run_study
from tests.makers.studies import BASE

STUDY = """
[study]
job = "mechanism"
base = "base.toml"
design = "factorial"
{more}
[study.parameters]
bodies.a.position_m.0 = [0.0, 1.0, 2.0]
[study.worst_over]
bodies.a.position_m.1 = [-1.0, 0.5, 3.0]
bodies.b.position_m.0 = [2.0, 4.0]
[study.outputs]
far = "(x1[0] - x2[0])**2 + x3[0]"
near = "x1[0] + x2[0] * x3[0]"
kept = "x1[0] - x2[0]"
[study.limits]
kept = {{ {limit} }}
"""


def study(folder: Path, more: str = 'minimise = ["far"]\nmaximise = ["near"]', limit: str = "low = 0.0") -> Path:
    (folder / "base.toml").write_text(BASE)
    path = folder / "study.toml"
    path.write_text(STUDY.format(more=more, limit=limit))
    return path


def test_each_output_has_the_worst_of_all_combinations(tmp_path: Path) -> None:
    """Largest of what is minimised, least of what is maximised or has a lower limit."""
    made = run_study(read_study(study(tmp_path)), tmp_path / "out", jobs=1)
    assert len(made.output("far")) == 3
    x = np.array([0.0, 1.0, 2.0])
    second, third = (grid.ravel() for grid in np.meshgrid([-1.0, 0.5, 3.0], [2.0, 4.0]))
    np.testing.assert_allclose(made.output("far"), ((x[:, None] - second) ** 2 + third).max(axis=1))
    np.testing.assert_allclose(made.output("near"), (x[:, None] + second * third).min(axis=1))
    np.testing.assert_allclose(made.output("kept"), (x[:, None] - second).min(axis=1))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[-1.0, 0.5, 3.0]",
            "{ low = 0.0, high = 1.0 }",
            r"study\.worst_over\.bodies\.a\.position_m\.1.*list of values",
        ),
        (
            "bodies.b.position_m.0 = [2.0",
            "bodies.a.position_m.0 = [2.0",
            r"study\.worst_over\.bodies\.a\.position_m\.0",
        ),
        ("bodies.b.position_m.0 = [2.0", "bodies.b.mass = [2.0", r"study\.worst_over\.bodies\.b.*mass"),
        ("low = 0.0 }", "low = 0.0, high = 1.0 }", r"study\.limits\.kept.*two limits"),
        ('minimise = ["far"]', 'minimise = ["kept"]', r"study\.limits\.kept.*minimised"),
        ("kept = { low = 0.0 }", "near = { high = 0.0 }", r"study\.limits\.near.*maximised"),
        (
            "[0.0, 1.0, 2.0]",
            '{ low = 0.0, high = 2.0, count = 3, also = ["bodies.b.position_m.0"] }',
            r"study\.worst_over\.bodies\.b\.position_m\.0.*study\.parameters\.bodies\.a\.position_m\.0\.also",
        ),
        (
            "bodies.a.position_m.0 = [0.0, 1.0, 2.0]",
            "bodies.a.position_m = [[0.0, 1.0]]",
            r"is varied, too, by bodies\.a\.pos",
        ),
    ],
)
def test_what_the_worst_is_not_taken_over(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = study(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=message):
        read_study(path)


CROWNING = """
[pair]
module_mm = 2.5
pressure_angle_deg = 20.0
face_width_mm = 10.0
tip_round_mm = 0.1
[pair.pinion]
teeth = 20
bore_diameter_mm = 20.0
[pair.wheel]
teeth = 30
bore_diameter_mm = 30.0
[microgeometry.pinion]
helix_crowning_um = 1.0
[stiffness]
torque_Nm = 60.0
coarsen = 2.0
angle_start_deg = 0.0
angle_step_deg = 9.0
angle_stop_deg = 9.0
[study]
job = "stiffness"
design = "factorial"
minimise = ["peak"]
[study.parameters]
microgeometry.pinion.helix_crowning_um = [1.0, 5.0, 40.0]
[study.worst_over]
pair.misalignment_um = [-12.0, 12.0]
[study.outputs]
peak = "max(peak_line_load_N_per_mm)"
"""


def test_crowning_against_misalignments_of_both_signs(tmp_path: Path) -> None:
    """Much crowning concentrates the load in the middle, none at an end: something between is best for both tilts."""
    path = tmp_path / "crowning.toml"
    path.write_text(CROWNING)
    read = read_study(path)
    made = run_study(read, tmp_path / "out", jobs=1)
    peak = made.output("peak")
    assert peak[1] < peak[0]
    assert peak[1] < peak[2]
