r"""Compute the differences of two or three runs of one kind, with the errors of the differences.

An error of a number n is known as *changes*: the signed changes of n when a source of error is changed by its estimate.
An example is the housing softened by the error of its mesh. If two runs a and b have the same source, the difference
n_b - n_a changes by the difference of the changes, so

.. math:: e(n_b - n_a) = \sum_s \max_r |\Delta_{s,r} n_b - \Delta_{s,r} n_a|

over the sources s and the changed runs r. A mesh that is 1 % too stiff in both runs hardly changes a difference of 5 %;
the sum of both errors would be 2 %. By source:

- changes of both runs, and a common source: the largest difference of the changes;
- a common source of which only sizes are known (bounds of a reduction, files of older versions): the larger of both
  errors. It covers the difference of two errors of one sign;
- other sources (integration, start; housings or meshes that differ): the sum of both.

The source ``gear mesh`` of stiffness curves is always common in this sense. Its changes are corrections by Richardson's
extrapolation (`gearfe.gears.gearmesh.positions`), each on the meshes of its run. The error of the difference is twice
their largest difference over the phases of the mesh cycle. If an error is unknown in either run, that of the difference
is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.quantities import parted, unit_of
from ..base.shown import percent
from .results import Results
from .run_curves import PANELS, Panel
from .run_numbers import MOST, NUMBERS, Number, mapping

#: What tells two bodies of a housing apart in a summary.
OF_HOUSING = ("mass_kg", "coordinates", "modes", "unknowns")
#: Keys of [stiffness] that decide the discretisation of the gears.
OF_CURVES = ("law", "coarsen", "flank_coarsen", "points_per_edge", "plane")
#: Sources of error that are in a housing's body, and those in the curves.
HOUSING, CURVE = ("mesh", "reduction"), ("curve",)


@dataclass(frozen=True)
class Row:
    """A number of all runs.

    Attributes
    ----------
    name, unit
        In words.
    values, errors
        Of each run; NaN where a run has none.
    differences, difference_errors
        Of each further run to the first one.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    differences: tuple[float, ...]
    difference_errors: tuple[float, ...]


@dataclass(frozen=True)
class Comparison:
    """Results side by side.

    Attributes
    ----------
    results
        Of the runs; differences are to the first one.
    rows
        Their numbers.
    panels
        Their curves.
    notes
        How errors were taken together, and what was left out.
    """

    results: tuple[Results, ...]
    rows: tuple[Row, ...]
    panels: tuple[Panel, ...]
    notes: tuple[str, ...]

    def columns(self) -> dict[str, list[Any]]:
        """Columns of the table of differences.

        Raises
        ------
        InputError
            For a run with the name of another column.
        """
        names = [run.name for run in self.results]
        columns: list[tuple[str, list[Any]]] = [
            ("quantity", [row.name for row in self.rows]),
            ("unit", [row.unit for row in self.rows]),
        ]
        for i, name in enumerate(names):
            columns.append((name, [row.values[i] for row in self.rows]))
            columns.append((f"error of {name}", [row.errors[i] for row in self.rows]))
        for i, name in enumerate(names[1:]):
            head = f"{name} - {names[0]}"
            columns.append((head, [row.differences[i] for row in self.rows]))
            columns.append((f"{head}, relative", [_ratio(row.differences[i], row.values[0]) for row in self.rows]))
            columns.append((f"error of {head}", [row.difference_errors[i] for row in self.rows]))
        heads = [head for head, _ in columns]
        for head in heads:
            if heads.count(head) > 1:
                problem = f"give two columns of the table the head {head!r}"
                raise InputError("names of the runs", ", ".join(names), problem, "give other names with --names")
        return dict(columns)


def _ratio(difference: float, value: float) -> float:
    return difference / abs(value) if value else math.nan


# ---- comparing -------------------------------------------------------------------------------------------------------


def compared(results: Sequence[Results]) -> Comparison:
    """Compare the results of two or more runs of one kind; differences are to the first one.

    Raises
    ------
    InputError
        For runs of different kinds, or without a common quantity, and for tables that hold one in different units.
    """
    first = results[0]
    for other in results[1:]:
        if other.kind is not first.kind:
            problem = f"is a {other.kind.title} ({other.kind.name}), {first.name} a {first.kind.title}"
            raise InputError(other.name, str(other.path), problem, "compare runs of one command")
    _check_units(results)
    numbers = NUMBERS[first.kind.name](results)
    names = list(dict.fromkeys(name for found in numbers for name in found if name in numbers[0]))
    common = [_common(first, other) for other in results[1:]]
    rows = [_row(name, numbers, common) for name in names]
    left_out = sorted({name for found in numbers for name in found} - {row.name for row in rows})
    compared_rows = tuple(row for row in rows if np.isfinite(row.values).sum() > 1)
    panels = tuple(PANELS[first.kind.name](results))
    if not compared_rows and not any(len({line.run for line in panel.lines}) > 1 for panel in panels):
        inside = "; ".join(f"{run.name} has {_listed(found)}" for run, found in zip(results, numbers, strict=True))
        problem = f"have no quantity in common: {inside}"
        raise InputError("runs", ", ".join(run.name for run in results), problem, "compare runs of alike jobs")
    return Comparison(
        tuple(results),
        compared_rows,
        panels,
        tuple(_notes(results, common, [*left_out, *(row.name for row in rows if np.isfinite(row.values).sum() < 2)])),
    )


def _check_units(results: Sequence[Results]) -> None:
    """Raise `InputError` where the main tables hold the same quantity in different units."""
    first = results[0]
    for other in results[1:]:
        for one, two in ((first, other), (other, first)):
            lacking = {parted(column)[0]: parted(column)[1] for column in two.main if column not in one.main}
            for stem, unit in lacking.items():
                same = next((c for c in one.main if parted(c)[0] == stem and c not in two.main), None)
                if same is None or unit_of(same).quantity != unit.quantity:
                    continue
                problem = f"holds {stem} in {unit.symbol}, and {one.path} has it in {unit_of(same).symbol}"
                raise InputError(two.name, str(two.path), problem, "write both tables in one unit")


def _row(name: str, numbers: Sequence[Mapping[str, Number]], common: Sequence[set[str]]) -> Row:
    """A number of all runs with its differences."""
    first, others = numbers[0].get(name), [found.get(name) for found in numbers[1:]]
    every = [first, *others]
    unit = next(number.unit for number in every if number is not None)
    values = [math.nan if number is None else number.value for number in every]
    errors = [math.nan if number is None else number.error for number in every]
    of_differences = [
        math.nan if first is None or other is None else difference_error(first, other, sources)
        for other, sources in zip(others, common, strict=True)
    ]
    return Row(
        name,
        unit,
        tuple(values),
        tuple(errors),
        tuple(value - values[0] for value in values[1:]),
        tuple(of_differences),
    )


def difference_error(first: Number, other: Number, common: set[str]) -> float:
    """Error of the difference of two numbers; NaN where it is unknown. See the module's docstring.

    Parameters
    ----------
    first, other
        The numbers.
    common
        Sources of error that both runs share.
    """
    if not first.parts or not other.parts:
        return math.nan
    total = 0.0
    for source in {*first.parts, *other.parts}:
        sizes = [number.parts.get(source, 0.0) for number in (first, other)]
        changes = [number.changes.get(source) for number in (first, other)]
        if source not in common:
            total += sum(sizes)
        elif changes[0] is not None and changes[1] is not None and changes[0].shape == changes[1].shape:
            total += float(np.abs(changes[1] - changes[0]).max())
        else:
            total += max(sizes, key=lambda size: math.inf if math.isnan(size) else size)
    return total


def _common(first: Results, other: Results) -> set[str]:
    """Sources of error that two runs share."""
    found = {"gear mesh", "root mesh"}
    bodies = [run.summary.get("housing") or {} for run in (first, other)]
    if all(bodies) and all(_alike(bodies[0].get(key), bodies[1].get(key)) for key in OF_HOUSING):
        found |= set(HOUSING)
    models = [(run.summary.get("job") or {}).get("stiffness") or {} for run in (first, other)]
    if all(models) and all(models[0].get(key) == models[1].get(key) for key in OF_CURVES):
        found |= set(CURVE)
    return found


def _alike(one: Any, two: Any) -> bool:
    """Return whether two entries of a summary are equal except for rounding."""
    numbers = isinstance(one, (int, float)) and isinstance(two, (int, float))
    return math.isclose(one, two, rel_tol=1e-9) if numbers else one == two


def _notes(results: Sequence[Results], common: Sequence[set[str]], left_out: Sequence[str]) -> Iterator[str]:
    """Describe the combination of errors, and list quantities of only one run."""
    if results[0].kind.name == "vibration":
        for other, shared in zip(results[1:], common, strict=True):
            same = [text for text, keys in (("housing", HOUSING), ("gear meshes", CURVE)) if set(keys) <= shared]
            yield (
                f"{other.name} and {results[0].name} share the errors of: {', '.join(same)}" if same else
                f"{other.name} and {results[0].name} share no source of error: errors are added"
            )  # fmt: skip
    for run in results:
        gears = mapping(run.summary.get("gears"))
        if results[0].kind.name == "rating" and {"gear_1", "gear_2"} <= gears.keys():
            yield f"{run.name}: gear 1 is {gears['gear_1']}, gear 2 {gears['gear_2']}"
        if not run.summary:
            yield f"{run.name}: no {run.kind.summary} next to the table, so its numbers and their errors are missing"
        status = run.summary.get("status")
        if status not in (None, "done"):
            yield f"{run.name}: the run ended early ({status})"
    if left_out:
        yield f"not in all runs: {_listed(left_out)}"


def _listed(names: Iterable[str]) -> str:
    """The first names of several, and how many more there are."""
    known = list(names)
    more = f" and {len(known) - MOST} more" if len(known) > MOST else ""
    return (", ".join(known[:MOST]) + more) or "none"


# ---- printing --------------------------------------------------------------------------------------------------------


def comparison_lines(made: Comparison, most: int = 24) -> list[str]:
    """Lines to print: the first `most` numbers with their differences, and the notes."""
    names = [run.name for run in made.results]
    lines = [f"{made.results[0].kind.title}: " + "; ".join(f"{run.name} ({run.path})" for run in made.results)]
    for row in made.rows[:most]:
        text = f"{row.name}: run {names[0]}: {_with(row.values[0], row.errors[0], row.unit)}"
        for i, name in enumerate(names[1:]):
            text += f"; run {name} minus run {names[0]}: {_difference(row, i)}"
        lines.append(text)
    if len(made.rows) > most:
        lines.append(f"{len(made.rows) - most} more in compare.csv")
    return [*lines, *made.notes]


def _difference(row: Row, number: int) -> str:
    """A difference with its error in words."""
    difference, error = row.differences[number], row.difference_errors[number]
    if math.isnan(difference):
        return "-"
    if difference == 0.0:
        return "the same"
    text = f"{difference:+.4g}{_error(error)} {row.unit}".rstrip()
    relative = _ratio(difference, row.values[0])
    if math.isfinite(relative) and row.unit != "dB":
        text += f" ({'+' if relative > 0.0 else ''}{percent(relative, 3)})"
    return text + (", within its error" if abs(difference) <= error else "")


def _with(value: float, error: float, unit: str) -> str:
    return "-" if math.isnan(value) else f"{value:.5g}{_error(error)} {unit}".rstrip()


def _error(error: float) -> str:
    """Text of an error; none of a formula."""
    if error == 0.0:
        return ""
    return f" ± {error:.2g}" if math.isfinite(error) else " ± ?"
