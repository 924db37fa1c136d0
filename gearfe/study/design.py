"""Make the cases of a study: values of its parameters, the same for a seed on every machine."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.config import check_size
from ..base.errors import InputError, given, shown
from ..base.files import read_csv
from ..base.tables.study import StudyTable
from ..base.typing import Array
from .parameters import Parameter, key_hint, read_parameters

#: Cases of one study at most; levels of a grid of Morris's.
MOST, LEVELS = 10_000_000, 4

#: Case by case the values of the parameters.
Cases = Sequence[tuple[Any, ...]]


def study_cases(table: StudyTable, folder: Path, base: Mapping[str, Any]) -> tuple[tuple[Parameter, ...], Cases]:
    """Parameters and cases of a study; files that it names lie in `folder`; `base` are the job's tables.

    Raises
    ------
    InputError
        For names that do not exist, values that are no distribution, and designs of too many cases.
    """
    if table.design == "rows":
        return _rows(table, folder, base)
    parameters = read_parameters(table.parameters, table.job, base)
    if table.design == "search":
        return parameters, ()
    if table.design == "factorial":
        levels = [one.levels() for one in parameters]
        count = math.prod(map(len, levels))
        if count > MOST:
            problem = f"make {shown(count)} combinations, more than {MOST}"
            raise InputError("study.parameters", None, problem, "take fewer levels, or another design")
        return parameters, list(itertools.product(*levels))
    shares = _shares(table, len(parameters))
    return parameters, list(zip(*(one.at(s) for one, s in zip(parameters, shares.T, strict=True)), strict=True))


def _shares(table: StudyTable, d: int) -> Array:
    """(n, d) points of the unit cube."""
    from scipy.stats import qmc

    n, seed = table.cases, table.seed
    if table.design == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(d, rng=np.random.default_rng(seed)).random(n))
    if table.design == "morris":
        return trajectories(n, d, np.random.default_rng(seed))
    power = max(0, math.ceil(math.log2(n)))
    if table.design == "sobol":
        return np.asarray(qmc.Sobol(d, rng=np.random.default_rng(seed)).random_base2(power)[:n])
    if n != 1 << power:
        raise InputError("study.cases", n, 'must be a power of 2 with design = "saltelli"', f"take {1 << power}")
    if n * (d + 2) > MOST:
        raise InputError("study.cases", n, f"makes {n * (d + 2)} cases, more than {MOST}", "take fewer")
    return saltelli(np.asarray(qmc.Sobol(2 * d, rng=np.random.default_rng(seed)).random_base2(power)))


def saltelli(points: Array) -> Array:
    """Return points (n (d + 2), d) for Sobol's indices from (n, 2 d) points: A, B, and A with one column of B.

    Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, table 2.
    """
    n, d = len(points), points.shape[1] // 2
    first, second = points[:, :d], points[:, d:]
    mixed = np.repeat(first[None], d, axis=0)
    for i in range(d):
        mixed[i, :, i] = second[:, i]
    return np.concatenate([first, second, mixed.reshape(n * d, d)])


def trajectories(count: int, d: int, rng: np.random.Generator) -> Array:
    """Points of Morris's trajectories in the unit cube, (count (d + 1), d).

    Each begins at a random point of a grid. It changes one coordinate after the other, in random order, by half of the
    levels (Morris, Technometrics 33 (1991) 161, section 3). Levels stand at (i + 1/2) / `LEVELS`, for distributions may
    have no ends.
    """
    points = np.empty((count, d + 1, d))
    for one in points:
        low = (rng.integers(0, LEVELS // 2, d) + 0.5) / LEVELS
        up = rng.random(d) < 0.5
        one[:] = np.where(up, low, low + 0.5)
        for step, i in enumerate(rng.permutation(d), start=1):
            one[step:, i] = low[i] + 0.5 if up[i] else low[i]
    return points.reshape(count * (d + 1), d)


def _rows(table: StudyTable, folder: Path, base: Mapping[str, Any]) -> tuple[tuple[Parameter, ...], Cases]:
    file = given(table.rows_csv, "study.rows_csv")
    columns = read_csv(folder / file, "study.rows_csv")
    columns.pop("case", None)
    hints = {name: key_hint(table.job, name, base) for name in columns}
    parameters = tuple(read_parameters({name: [0.0] for name in hints}, table.job, base))
    values = [[_cell(text, one, file, i) for i, text in enumerate(columns[one.name], start=1)] for one in parameters]
    return parameters, list(zip(*values, strict=True))


def _cell(text: str, one: Parameter, path: str, row: int) -> Any:
    """A number where it is one, else the text."""
    try:
        number = float(text)
    except ValueError:
        return text
    label = f"{path}, row {row}, {one.name}"
    check_size(number, label, "change it")
    if not (one.whole and number.is_integer()):
        return number
    check_size(int(number), label, "change it")
    return int(number)
