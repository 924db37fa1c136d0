"""Slopes of a mechanism's outputs by its keys: central differences, extrapolated to a step of zero, with their errors.

With D(h) = (y(p + h) - y(p - h)) / (2 h) = y' + c2 h^2 + c4 h^4 + ... at h, h/2, h/4, ... the table

    A_j0 = D(h / 2^j),        A_ji = A_j,i-1 + (A_j,i-1 - A_j-1,i-1) / (4^i - 1)

removes one power of h after the other. The error of an entry is the larger of its differences to the two entries from
which it follows. Large steps leave powers of h, small ones the integrator's errors divided by h; the entry with the
least error is taken. Twice its error is the estimate (Ridders, Adv. Eng. Software 4 (1982) 75-76; Press et al.,
Numerical Recipes, Sec. 5.7).

Runs with the same steps have the same error, and its slope does not show in their differences. The largest step is
therefore solved again with a thirtieth of the tolerance; the change is a part of the estimate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.config import read_toml
from ..base.errors import InputError, unknown_name
from ..base.progress import stage
from ..base.tables.mechanism import RunTable
from ..base.typing import Array
from .error_estimate import LEAST_TOLERANCE, SHARPER
from .model import load_mechanism
from .results import Sensitivities
from .solve import Case, sweep

#: Largest step as a share of the value, and how many steps there are, each half of the one before.
LARGEST, STEPS = 1e-2, 5
#: Factor of the differences in the estimate, for what they share.
SAFETY = 2.0


@stage("sensitivities")
def sensitivities(
    file: str | Path,
    parameters: Sequence[str] | Mapping[str, float],
    *,
    executor: Executor | None = None,
    run: RunTable | None = None,
) -> Sensitivities:
    """Slopes of all outputs of a mechanism file, and of its frequencies where the analysis is `modes`.

    Parameters
    ----------
    file
        The mechanism file.
    parameters
        Dotted names of keys that the file gives as numbers, ``"bodies.rod.mass_kg"``; as a mapping, with the largest
        step of each (by default 1 % of the value).
    executor
        Runs the cases, twelve for each parameter.
    run
        Instead of the file's [run].

    Raises
    ------
    InputError
        For a key that is not there, is no number, or is 0 without a step, and for cases without an answer.
    """
    raw = read_toml(file)
    values = {name: _number(raw, name) for name in parameters}
    steps = {name: _step(parameters, name, value) for name, value in values.items()}
    cases: list[dict[str, float]] = [{}]
    for name, value in values.items():
        cases += [{name: value + sign * steps[name] / 2**j} for j in range(STEPS) for sign in (1.0, -1.0)]
    solved = sweep(file, cases, executor=executor, run=run)
    ends = [case for k in range(len(steps)) for case in cases[1 + 2 * STEPS * k :][:2]]
    finer = sweep(file, ends, executor=executor, run=_finer(file, run))
    for case in (*solved, *finer):
        if case.problem:
            name, at = next(iter(case.values.items()), ("mechanism file", None))
            raise InputError(name, at, f"has no answer: {case.problem}", "fix that, or give a smaller step")
    at, outputs = _columns(solved[0])
    slopes, errors = {}, {}
    for k, (name, h) in enumerate(steps.items()):
        around = solved[1 + 2 * STEPS * k : 1 + 2 * STEPS * (k + 1)]
        for output, base in outputs.items():
            shifted = [_columns(case)[1][output] for case in around]
            if any(len(column) != len(base) for column in shifted):
                raise InputError(name, values[name], f"changes how many values {output} has", "leave it out")
            differences = [(shifted[2 * j] - shifted[2 * j + 1]) * 2**j / (2.0 * h) for j in range(STEPS)]
            slopes[name, output], error = extrapolated(differences)
            sharp = [_columns(case)[1][output] for case in finer[2 * k : 2 * k + 2]]
            integrated = np.abs((sharp[0] - sharp[1]) / (2.0 * h) - differences[0]).max(initial=0.0)
            errors[name, output] = error + SAFETY * float(integrated)
    return Sensitivities(values, at, outputs, slopes, errors)


def _finer(file: str | Path, run: RunTable | None) -> RunTable:
    """[run] with a finer tolerance."""
    mechanism = load_mechanism(file)
    kept = mechanism.file.run if run is None else run
    used = mechanism.tolerance if kept.tolerance is None else kept.tolerance
    return replace(kept, tolerance=max(used / SHARPER, LEAST_TOLERANCE))


def extrapolated(differences: Sequence[Array]) -> tuple[Array, float]:
    """The best entry of the table above for D at h, h/2, h/4, ..., and the estimate of its largest error."""
    rows = [differences[0]]
    best, least = differences[0], np.inf
    for one in differences[1:]:
        column = [one]
        for i, above in enumerate(rows, start=1):
            column.append(column[-1] + (column[-1] - above) / (4.0**i - 1.0))
            error = max(float(np.abs(column[-1] - other).max(initial=0.0)) for other in (column[-2], above))
            if error < least:
                best, least = column[-1], error
        rows = column
    return best, SAFETY * least


def _columns(case: Case) -> tuple[dict[str, Array], dict[str, Array]]:
    """Times, or numbers of modes, and values of every output."""
    at: dict[str, Array] = {}
    outputs: dict[str, Array] = {}
    for table, columns in case.tables.items():
        if table == "energy":
            continue
        index = columns.get("time_s", columns.get("mode"))
        for name, column in columns.items():
            if name not in ("time_s", "mode"):
                outputs[name] = np.asarray(column, dtype=float)
                at[name] = np.zeros(1) if index is None else np.asarray(index, dtype=float)
    return at, outputs


def _number(raw: Mapping[str, Any], name: str) -> float:
    """Value of a key as the file gives it."""
    place: Any = raw
    known = ""
    for part in name.split("."):
        if isinstance(place, list):
            if not (part.isdigit() and int(part) < len(place)):
                problem = f"{known} has {len(place)} entries, from 0 on"
                raise InputError("sensitivities", name, problem, "choose one")
            place = place[int(part)]
        elif not isinstance(place, Mapping) or part not in place:
            raise unknown_name(f"sensitivities {name!r}: {known or 'keys of the file'}", part, _keys(place))
        else:
            place = place[part]
        known = f"{known}.{part}".strip(".")
    if name.split(".", maxsplit=1)[0] == "run" or isinstance(place, bool) or not isinstance(place, (int, float)):
        raise InputError("sensitivities", name, "is no number of the mechanism", "name a key with a number")
    return float(place)


def _keys(place: Any) -> Sequence[str]:
    return list(place) if isinstance(place, Mapping) else []


def _step(parameters: Sequence[str] | Mapping[str, float], name: str, value: float) -> float:
    if isinstance(parameters, Mapping):
        step = float(parameters[name])
        if not 0.0 < step < np.inf:
            raise InputError(
                f"sensitivities.{name}", step, "must be a step > 0", "give a hundredth of the key's usual size"
            )
        return step
    if value == 0.0:
        problem = "is 0, of which no step is a share"
        raise InputError(
            "sensitivities", name, problem, "give its step: gearfe.mechanisms.sensitivities(file, {key: step})"
        )
    return LARGEST * abs(value)
