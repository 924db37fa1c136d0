"""Optimisers over a study: closed optima, points kept on disk, any optimiser's ask and tell, the page's example."""

from __future__ import annotations

import itertools
import math
import re
import textwrap
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.study.job import read_study
from gearfe.study.search import Search
from tests.makers.studies import BASE, rows_of
from tests.places import DOCS, GEOMETRY

PAGE = (DOCS / "study.md").read_text(encoding="utf-8")

#: (x - 1)^2 + (y - 2)^2 with x + y <= 2: the foot of the perpendicular, (1/2, 3/2), where it is 1/2.
STUDY = """
[study]
job = "mechanism"
base = "base.toml"
minimise = ["f"]
[study.parameters]
bodies.a.position_m.0 = { low = -3.0, high = 3.0 }
bodies.a.position_m.1 = { low = -3.0, high = 3.0 }
[study.outputs]
f = "(x1[0] - 1)**2 + (x2[0] - 2)**2"
g = "x1[0] + x2[0]"
[study.limits]
g = { high = 2.0 }
"""
X, Y = "bodies.a.position_m.0", "bodies.a.position_m.1"


@pytest.fixture
def study(tmp_path: Path):
    (tmp_path / "base.toml").write_text(BASE)
    (tmp_path / "study.toml").write_text(STUDY)
    return read_study(tmp_path / "study.toml")


def test_evolution_finds_a_closed_optimum_on_its_bound(study, tmp_path):
    with Search(study, tmp_path / "out", jobs=1) as search:
        best = search.evolve(rounds=40, population=8)
    assert best.outputs["g"] <= 2.0
    assert best.outputs["f"] == pytest.approx(0.5, abs=5e-3)
    assert [best.point[X], best.point[Y]] == pytest.approx([0.5, 1.5], abs=0.06)
    rows = rows_of(tmp_path / "out")
    assert len(rows) == len(search) + 1
    assert rows[best.case + 1][:3] == [str(best.case), repr(best.point[X]), repr(best.point[Y])]


def test_an_interrupted_search_asks_again_and_solves_the_rest(study, tmp_path):
    with Search(study, tmp_path / "whole", jobs=1) as search:
        whole = search.evolve(rounds=3, population=4)
    with Search(study, tmp_path / "out", jobs=1) as search:
        search.evolve(rounds=1, population=4)
        first = len(search)
    with Search(study, tmp_path / "out", jobs=1) as search:
        assert len(search) == first
        assert search.evolve(rounds=3, population=4) == whole
    assert rows_of(tmp_path / "out") == rows_of(tmp_path / "whole")
    with pytest.raises(InputError, match="another study"):
        Search(read_study(GEOMETRY / "relief_search.toml"), tmp_path / "out")


class Nine:
    """Asks for a grid of 9 points, then for a finer one round the best: least of what it was told."""

    def __init__(self) -> None:
        self.middle, self.step, self.least = (0.0, 0.0), 2.0, math.inf

    def ask(self):
        grid = itertools.product((-self.step, 0.0, self.step), repeat=2)
        return [{X: self.middle[0] + a, Y: self.middle[1] + b} for a, b in grid] if self.step > 1e-3 else []

    def tell(self, points, outputs):
        best = min(range(9), key=lambda i: outputs[i]["f"] if outputs[i]["g"] <= 2.0 else math.inf)
        if outputs[best]["f"] < self.least and outputs[best]["g"] <= 2.0:
            self.least, self.middle = outputs[best]["f"], (points[best][X], points[best][Y])
        self.step *= 0.7


def test_any_optimiser_asks_and_is_told(study):
    nine = Nine()
    with Search(study, jobs=2) as search:
        best = search.run(nine)
    assert best.outputs["f"] == nine.least
    assert best.outputs["f"] == pytest.approx(0.5, abs=0.05)
    assert len(search) < 9 * 22  # the middle of each grid is known


def test_points_without_an_answer_are_told_as_such(study):
    with Search(study, jobs=2) as search:
        found = search.solve([{X: 0.1, Y: 0.0}, {X: math.inf, Y: 0.0}, {X: 0.1, Y: 0.0}])
        assert found[0] == found[2] == pytest.approx({"f": 0.81 + 4.0, "g": 0.1})
        assert math.isnan(found[1]["f"])
        assert len(search) == 2
        with pytest.raises(InputError, match="points"):
            search.solve([{X: 0.1}])


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('minimise = ["f"]', 'minimise = ["f"]\nmaximise = ["g"]', "must be one output"),
        ("position_m.1 = { low = -3.0, high = 3.0 }", "position_m.1 = [1.0, 2.0]", "no two ends"),
    ],
)
def test_what_cannot_be_searched_is_told(tmp_path, old, new, told):
    (tmp_path / "base.toml").write_text(BASE)
    (tmp_path / "study.toml").write_text(STUDY.replace(old, new))
    with Search(read_study(tmp_path / "study.toml"), jobs=1) as search, pytest.raises(InputError, match=told):
        search.evolve(rounds=1)


def page_search(folder: Path, rounds: int, monkeypatch: pytest.MonkeyPatch) -> dict:
    """Names of the page's search, run in so many rounds from a folder with geometry/relief_search.toml."""
    monkeypatch.chdir(folder)
    block = next(b for b in re.findall(r"```python\n(.*?)```", PAGE, re.S) if "evolve" in b)
    assert "rounds=40" in block
    names: dict = {}
    exec(compile(block.replace("rounds=40", f"rounds={rounds}"), "page", "exec"), names)
    return names


def relief_job(folder: Path) -> None:
    """The page's job with half as many positions."""
    (folder / "geometry").mkdir()
    job = (GEOMETRY / "relief_search.toml").read_text(encoding="utf-8")
    (folder / "geometry" / "relief_search.toml").write_text(job.replace("positions = 12", "positions = 6"))


def test_the_page_finds_a_closed_optimum(monkeypatch, tmp_path):
    """The page's lines on a study of milliseconds: its job is searched by the slow test below."""
    (tmp_path / "geometry").mkdir()
    (tmp_path / "geometry" / "base.toml").write_text(BASE)
    (tmp_path / "geometry" / "relief_search.toml").write_text(STUDY)
    best = page_search(tmp_path, 12, monkeypatch)["best"]
    assert best.outputs["g"] <= 2.0
    assert best.outputs["f"] == pytest.approx(0.5, abs=5e-3)


def test_the_bound_on_the_root_stress_costs_transmission_error(tmp_path):
    relief_job(tmp_path)
    with Search(read_study(tmp_path / "geometry" / "relief_search.toml"), jobs=1) as search:
        keys = search.study.task.names
        points = [dict(zip(keys, reliefs, strict=True)) for reliefs in ((10.0, 10.0), (15.0, 16.0))]
        kept, beyond = search.solve(points)
    assert kept["root_stress_MPa"] <= 285.0 < beyond["root_stress_MPa"]
    assert beyond["error_um"] < kept["error_um"]


@pytest.mark.slow
def test_the_page_finds_the_relief_under_a_bound_on_the_root_stress(monkeypatch, tmp_path):
    """Against all points of a grid: better than each that keeps the bound, which costs something."""
    relief_job(tmp_path)
    names = page_search(tmp_path, 3, monkeypatch)
    best, search = names["best"], names["search"]
    keys = search.study.task.names
    with Search(search.study, jobs=1) as grid:
        points = [dict(zip(keys, p, strict=True)) for p in itertools.product(np.linspace(0.0, 30.0, 4), repeat=2)]
        told = grid.solve(points)
        (beyond,) = grid.solve([dict(zip(keys, (15.0, 16.0), strict=True))])
    kept = [one["error_um"] for one in told if one["root_stress_MPa"] <= 285.0]
    assert best.outputs["root_stress_MPa"] <= 285.0
    assert best.outputs["error_um"] < min(kept)
    assert beyond["error_um"] < best.outputs["error_um"]
    assert beyond["root_stress_MPa"] > 285.0


def test_optuna_asks_and_is_told(study):
    optuna = pytest.importorskip("optuna", minversion="5.0")
    block = next(b for b in re.findall(r"```python\n(.*?)```", PAGE, re.S) if "optuna" in b)
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with Search(study, jobs=1) as search:
        names: dict = {"search": search}
        begin, _, body = block.partition("with Search(")  # on this study in place of the page's
        body = textwrap.dedent(body.partition("\n")[2]).replace("range(10)", "range(12)")
        body = body.replace('outputs["root_stress_MPa"] - 285.0', 'outputs["g"] - 2.0').replace('"error_um"', '"f"')
        exec(compile(begin + body, "page", "exec"), names)
        best = search.best()
    assert best.outputs["g"] <= 2.0
    assert best.outputs["f"] < 3.0
    assert len(search) == 12 * 8
