"""A study that takes milliseconds a case: Ishigami's function of the places of two free bodies."""

from __future__ import annotations

import csv
from pathlib import Path

JOBS = Path(__file__).parents[1] / "geometry"

#: Two free bodies at rest, whose places are the outputs: a job of two milliseconds.
BASE = """
[run]
end_s = 1e-3
step_s = 1e-3
method = "explicit"
[bodies.a]
mass_kg = 1.0
inertia_kg_m2 = 1.0
position_m = [0.0, 0.0]
[bodies.b]
mass_kg = 1.0
inertia_kg_m2 = 1.0
position_m = [0.0, 0.0]
[[outputs]]
name = "x1"
value = "x(a)"
[[outputs]]
name = "x2"
value = "y(a)"
[[outputs]]
name = "x3"
value = "x(b)"
"""
ISHIGAMI = """
[study]
job = "mechanism"
base = "base.toml"
design = "{design}"
cases = {cases}
seed = 3
[study.parameters]
bodies.a.position_m.0 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
bodies.a.position_m.1 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
bodies.b.position_m.0 = {{ low = -3.141592653589793, high = 3.141592653589793 }}
[study.outputs]
y = "sin(x1[0]) + 7*sin(x2[0])**2 + 0.1*x3[0]**4*sin(x1[0])"
"""


def written(folder: Path, design: str = "sobol", cases: int = 8, **more: str) -> Path:
    """A study of Ishigami's function beside its base job."""
    (folder / "base.toml").write_text(BASE)
    text = ISHIGAMI.format(design=design, cases=cases)
    for old, new in more.items():
        text = text.replace(old.replace("__", " = "), new)
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def rows_of(folder: Path) -> list[list[str]]:
    """Rows of study.csv without the seconds."""
    with (folder / "study.csv").open(newline="") as stream:
        return [row[:-1] for row in csv.reader(stream)]
