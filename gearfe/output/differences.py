r"""Differences of the results of two or three runs of one kind, with the errors of the differences.

An error of a number n is known as *changes*: by how much n moves, signed, where a source of error is changed by its
estimate, e.g. the housing softened by what its mesh is too stiff. Of two runs a and b with the same source, the
difference n_b - n_a moves by the difference of the changes, so

.. math:: e(n_b - n_a) = \sum_s \max_r |\Delta_{s,r} n_b - \Delta_{s,r} n_a|

over the sources s and the changed runs r. A mesh that is 1 % too stiff in both leaves a difference of 5 % nearly alone,
where the sum of both errors would be 2 %. By source:

- changes of both runs, and a common source: the largest difference of the changes;
- a common source, but only sizes are known (bounds of a reduction, files of older versions): the larger of both errors,
  which covers the difference of two errors of one sign;
- other sources (integration, start; housings or meshes that differ): the sum of both.

The source ``gear mesh`` of a stiffness curve is common in this sense always: the changes are corrections by
Richardson's extrapolation (`gearfe.gears.gearmesh.positions`), those of each run on meshes of its own, twice, on phases
of the mesh cycle. An error that is unknown in either run leaves that of the difference unknown.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.quantities import label, parted, scaled, unit_of, words
from ..base.shown import percent
from ..base.typing import Array
from .results import Results

#: Phases of the mesh cycle at which corrections of curves are compared.
PHASES = 72
#: Standard deviations that cover 95 %, as in the estimate of a curve's error.
COVERAGE = 2.0
#: Decibels of a relative change of a power, to first order.
DECIBELS = 10.0 / math.log(10.0)
#: Natural frequencies, and lines of a signal, that are compared at most.
MOST = 6
#: What tells two bodies of a housing apart in a summary.
OF_HOUSING = ("mass_kg", "coordinates", "modes", "unknowns")
#: Keys of [stiffness] that decide the discretisation of the gears.
OF_CURVES = ("law", "coarsen", "flank_coarsen", "points_per_edge", "plane")
#: Safety factors of a rating.
SAFETY = ("S_H", "S_F")
#: Ends of the names of a rating's numbers.
GEARS = " (gear 1)", " (gear 2)"
#: Sources of error that are in a housing's body, and those in the curves.
HOUSING, CURVE = ("mesh", "reduction"), ("curve",)


@dataclass(frozen=True)
class Number:
    """A number that a run is read for.

    Attributes
    ----------
    name, unit
        In words.
    value
        The number.
    parts
        Source of error -> its size; without any source the error is unknown.
    changes
        Source -> signed changes, shape (runs,).
    """

    name: str
    unit: str
    value: float
    parts: Mapping[str, float] = field(default_factory=dict)
    changes: Mapping[str, Array] = field(default_factory=dict)

    @property
    def error(self) -> float:
        """Sum of the parts; NaN without any."""
        return sum(self.parts.values()) if self.parts else math.nan


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
class Line:
    """A curve of one run in a panel: name, places, values, sizes of errors or None."""

    run: int
    name: str
    x: Array
    y: Array
    error: Array | None = None


@dataclass(frozen=True)
class Panel:
    """Curves of one quantity: labels of the axes, the curves, and how they are drawn.

    The kind is ``curve``, ``lines`` of a spectrum, or ``bars``.
    """

    below: str
    beside: str
    lines: tuple[Line, ...]
    kind: str = "curve"


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
    read = NUMBERS[first.kind.name]
    numbers = [{number.name: number for number in read(run)} for run in results]
    if read is _rating_numbers:
        numbers = _of_both_gears(numbers)
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
        gears = _mapping(run.summary.get("gears"))
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


# ---- numbers of each kind --------------------------------------------------------------------------------------------


def _finite(value: Any) -> float:
    """A number of a summary as a float; NaN for null and anything else."""
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _curve_numbers(run: Results) -> list[Number]:
    """Stiffness, transmission error and pressure of a curve."""
    if "by_torque" in run.summary:  # a load that varies along the face width
        return _torque_numbers(run)
    table = run.main
    if not {"pinion_angle_deg", "k_mesh_N_per_m"} <= table.keys():
        return []
    solved = np.isfinite(table["k_mesh_N_per_m"])
    k, correction = table["k_mesh_N_per_m"][solved], _column(table, "k_mesh_relative_correction")[solved]
    error = _column(table, "k_mesh_relative_error")[solved]
    if not len(k):
        return []
    known = bool(np.isfinite(error).all())

    def number(name: str, unit: str, value: float, size: float, changes: Array | None) -> Number:
        given = known and changes is not None and np.isfinite(changes).all()
        moves = {"gear mesh": changes} if given and changes is not None else {}
        return Number(name, unit, value, {"gear mesh": size} if known else {}, moves)

    phases = _on_phases(table, solved, COVERAGE * 1e-6 * correction * k)
    levels = _mapping(run.summary.get("mesh_stiffness"))
    found = []
    for text, own, size in (
        ("mean", k.mean(), (error * k).mean()),
        ("least", k.min(), (error * k)[k.argmin()]),
        ("largest", k.max(), (error * k)[k.argmax()]),
    ):
        value = 1e-6 * _finite(levels.get(f"{text}_N_per_m", float(own)))
        found.append(number(f"{text} mesh stiffness", "N/µm", value, 1e-6 * float(size), phases))
    yielded, torque = _column(table, "transmission_error_um")[solved], _column(table, "torque_wheel_Nm")[solved]
    if np.isfinite(yielded).all() and np.ptp(torque) < 1e-6 * np.abs(torque).max():  # at a torque the twist is found
        high, low, moved = yielded.argmax(), yielded.argmin(), -COVERAGE * correction * yielded
        swing = np.ptp(yielded)
        change = np.array([moved[high] - moved[low]])
        size = max(float(np.abs(change[0])), float(np.median(error)) * swing) if np.isfinite(change[0]) else math.nan
        found += [
            number("transmission error, mean", "µm", yielded.mean(), float((error * yielded).mean()),
                   _on_phases(table, solved, moved)),
            number("transmission error, peak to peak", "µm", swing, size, change),
        ]  # fmt: skip
    for name in ("peak_pressure_MPa", "edge_pressure_MPa"):
        values = _column(table, name)
        if np.isfinite(values).any():
            found.append(Number(f"largest {words(name)}", "MPa", float(np.nanmax(values))))
    return found


def _column(table: Mapping[str, Array], name: str) -> Array:
    """A column of numbers; NaN where the table has none."""
    values = table.get(name)
    count = len(next(iter(table.values()), ()))
    return np.full(count, np.nan) if values is None or values.dtype.kind != "f" else values


def _on_phases(table: Mapping[str, Array], solved: Array, values: Array) -> Array | None:
    """Values at `PHASES` phases of the mesh cycle; None where the table does not say it."""
    cycle = _column(table, "mesh_cycle_deg")
    if not np.isfinite(cycle).all() or not len(values):
        return None
    phase = np.mod(table["pinion_angle_deg"][solved] / cycle[0], 1.0)
    phase, first = np.unique(np.round(phase, 9), return_index=True)
    return np.interp(np.arange(PHASES) / PHASES, phase, values[first], period=1.0)


#: Columns of a table by torque that are no results.
_COUNTS = re.compile(
    r"positions_|failed_|.*_(y|roll_length_pinion|roll_length_wheel|pinion_angle|root_diameter\w*)_(mm|deg)\Z"
)


def _torque_numbers(run: Results) -> list[Number]:
    """Numbers of a table by torque, at each torque."""
    table = _mapping(run.summary.get("by_torque"))
    key = next((name for name in ("torque_Nm", "torque_wheel_Nm") if name in table), None)
    if key is None:
        return []
    found, errors = [], _mapping(run.summary.get("error_estimate"))
    root = _finite(run.summary.get("root_stress_error_estimate"))
    for i, torque in enumerate(_list(table[key])):
        for column, values in table.items():
            if column == key or _COUNTS.match(column) or column.endswith("_error_estimate"):
                continue
            value, stem = _finite(_list(values)[i]), parted(column)[0]
            parts = {}
            if "root_stress" in column:
                own = table.get(f"{stem}_error_estimate")
                relative = _finite(_list(own)[i]) if own is not None else root
                parts = {"root mesh": abs(relative * value)}
            elif stem in errors:
                given = errors[stem]
                parts = {"gear mesh": abs(_finite(_list(given)[i] if isinstance(given, list) else given) * value)}
            unit = unit_of(column)
            factor, symbol = (1e-6, "N/µm") if unit.key == "N_per_m" else (1.0, unit.symbol)
            scaled = {source: factor * size for source, size in parts.items()}
            found.append(Number(f"{words(column)} at {torque:.6g} N m", symbol, factor * value, scaled))
    return found


def _vibration_numbers(run: Results) -> list[Number]:
    """Forces, natural frequencies, accelerations, radiated power and lines of a response, as its summary has them."""
    summary = run.summary
    parts, changes = _mapping(summary.get("headline_error_parts")), _mapping(summary.get("headline_error_changes"))

    def entry(name: str, place: int | str | None = None) -> tuple[dict[str, float], dict[str, Array]]:
        """Parts and changes of a number of the summary, or of one entry of it."""

        def pick(values: Any) -> float:
            return _finite(values if place is None else values[place])

        sizes = {source: pick(part[name]) for source, part in parts.items() if name in part}
        moves = {
            source: np.array([pick(one[name]) for one in runs])
            for source, runs in changes.items()
            if runs and name in runs[0]
        }
        return sizes, moves

    found: list[Number] = []
    meshes = [str(name) for name in _list(summary.get("meshes"))]
    for name, text in (
        ("mean_contact_forces_N", "mean contact force"),
        ("smallest_contact_forces_under_load_N", "smallest contact force under load"),
        ("largest_contact_forces_N", "largest contact force"),
    ):
        for i, (mesh, value) in enumerate(zip(meshes, _list(summary.get(name)), strict=False)):
            found.append(Number(f"{text} of {mesh}", "N", _finite(value), *entry(name, i)))
    name = "coupled_frequencies_Hz"
    for i, value in enumerate(_list(summary.get(name))[:MOST]):
        text = f"natural frequency {i + 1} of the coupled system"
        found.append(Number(text, "Hz", _finite(value), *entry(name, i)))
    name = "peak_attachment_accelerations_m_per_s2"
    for bore, value in _mapping(summary.get(name)).items():
        text = f'largest acceleration at attachment "{bore}"'
        found.append(Number(text, "m/s²", _finite(value), *entry(name, bore)))
    power = _mapping(summary.get("radiated_power"))
    mean = _finite(power.get("mean_W"))
    if mean > 0.0:
        sizes, moves = entry("radiated_power_mean_W")
        factor = DECIBELS / mean
        found.append(
            Number(
                "mean radiated power (re 1 pW)",
                "dB",
                _finite(power.get("mean_level_dB")),
                {s: factor * x for s, x in sizes.items()},
                {s: factor * x for s, x in moves.items()},
            )
        )
    for signal, lines in _mapping(summary.get("dominant_lines")).items():
        found += _line_numbers(signal, _list(lines))
    return found


def _line_numbers(signal: str, lines: Sequence[Any]) -> Iterator[Number]:
    """The largest lines of a signal: by the multiple that they belong to, else by their frequency."""
    text, unit = words(signal), unit_of(signal).symbol
    if not (signal.startswith(("attachment_", "transmission_error_", "contact_force_"))):
        return
    seen: set[str] = set()
    for line in map(_mapping, lines):
        near = line.get("near") or f"{_finite(line.get('frequency_Hz')):.6g} Hz"
        if near in seen or len(seen) == MOST:
            continue
        seen.add(str(near))
        sizes = {source: _finite(size) for source, size in _mapping(line.get("error_parts")).items()}
        if not sizes and "error_estimate" in line:
            sizes = {"all": _finite(line["error_estimate"])}
        moves = {s: np.array([_finite(x) for x in rows]) for s, rows in _mapping(line.get("error_changes")).items()}
        yield Number(f"{text}, line {near}", unit, _finite(line.get("amplitude")), sizes, moves)


def _runup_numbers(run: Results) -> list[Number]:
    """Largest factors and levels of a run-up with their speeds, turning points and natural frequencies."""
    table, summary = run.main, run.summary
    speed, found = _column(table, "speed_rad_per_s"), []
    for column, values in table.items():
        stem, unit = parted(column)
        if not stem.startswith(
            ("dynamic_factor", "peak_to_peak_transmission", "share_without", "acceleration_rms", "radiated")
        ):
            continue
        if values.dtype.kind != "f" or not np.isfinite(values).any():
            continue
        at = int(np.nanargmax(np.where(np.isinf(values), np.nan, values)))
        found.append(Number(f"largest {words(column)}", unit.symbol, float(values[at])))
        if values[at] > 0.0:
            found.append(Number(f"its speed: largest {words(column)}", "rad/s", float(speed[at])))
    for i, turn in enumerate(_list(summary.get("turning_speeds_rad_per_s"))[:MOST]):
        found.append(Number(f"turning point {i + 1}", "rad/s", _finite(turn)))
    for i, mode in enumerate(_list(summary.get("modes"))[:MOST]):
        frequency = _finite(_mapping(mode).get("frequency_Hz"))
        found.append(Number(f"natural frequency {i + 1} of the coupled system", "Hz", frequency))
    return found


def _rating_numbers(run: Results) -> list[Number]:
    """All values of a rating, safety factors first; they are formulas, without an error of a discretisation."""
    table = run.main
    rows = zip(
        table["name"], table["unit"], table["meaning"], _texts(table["gear_1"]), _texts(table["gear_2"]), strict=True
    )
    found = []
    for key, unit, meaning, *values in rows:
        text = f"{key}, {meaning}" if meaning else f"{key}"
        for gear, value in zip(GEARS, values, strict=True):
            found.append(Number(text + gear, "" if unit == "-" else str(unit), _number(value), {"formula": 0.0}))
    return sorted(found, key=lambda number: not number.name.startswith(SAFETY))


def _of_both_gears(numbers: Sequence[Mapping[str, Number]]) -> list[dict[str, Number]]:
    """Return the numbers of ratings, with one for both gears where these have the same value in every run."""
    stems = {name.removesuffix(GEARS[0]) for run in numbers for name in run if name.endswith(GEARS[0])}
    alike = {stem for stem in stems if all(_alike_values(*(run.get(stem + gear) for gear in GEARS)) for run in numbers)}
    joined = []
    for run in numbers:
        found: dict[str, Number] = {}
        for name, number in run.items():
            stem = name.removesuffix(GEARS[0]).removesuffix(GEARS[1])
            text = stem if stem in alike else name
            found.setdefault(text, replace(number, name=text))
        joined.append(found)
    return joined


def _alike_values(one: Number | None, two: Number | None) -> bool:
    if one is None or two is None:
        return one is two
    return one.value == two.value or (math.isnan(one.value) and math.isnan(two.value))


def _texts(values: Array) -> list[str]:
    return [str(value) for value in values.tolist()]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _mechanism_numbers(run: Results) -> list[Number]:
    """Last, least and largest value of each output."""
    errors = _mapping(_mapping(run.summary.get("error_estimate")).get("outputs"))
    found = []
    for column, values in run.main.items():
        if column == "time_s" or values.dtype.kind != "f" or not len(values):
            continue
        parts = {"integration": _finite(errors[column])} if column in errors else {}
        for text, value in (("at the end", values[-1]), ("least", np.nanmin(values)), ("largest", np.nanmax(values))):
            found.append(Number(f"{words(column)}, {text}", unit_of(column).symbol, float(value), parts))
    return found


#: Kind -> the numbers of its results.
NUMBERS: dict[str, Callable[[Results], list[Number]]] = {
    "stiffness": _curve_numbers,
    "loadmap": _torque_numbers,
    "vibration": _vibration_numbers,
    "runup": _runup_numbers,
    "rating": _rating_numbers,
    "mechanism": _mechanism_numbers,
}


# ---- curves of each kind ---------------------------------------------------------------------------------------------


def _panels(
    results: Sequence[Results], file: str, over: str, chosen: Sequence[str], *, kind: str = "curve", title: str = ""
) -> Iterator[Panel]:
    """Panels of the columns that fit each pattern, over a column; those of one quantity share a panel.

    Parameters
    ----------
    results
        The runs.
    file
        Table; empty for the main one.
    over
        Column of the abscissa.
    chosen
        Patterns of the columns: one panel each for all columns of a run that fit it.
    kind
        How they are drawn, see `Panel`.
    title
        What a panel with several columns shows.
    """
    tables = [run.table(file) if file else run.main for run in results]
    for pattern in chosen:
        lines = []
        for number, (run, table) in enumerate(zip(results, tables, strict=True)):
            for column in (name for name in table if re.fullmatch(pattern, name) and over in table):
                x, y = table[over], table[column]
                if y.dtype.kind != "f" or not np.isfinite(y).any():
                    continue
                error = table.get("k_mesh_relative_error") if column.startswith("k_mesh_N") else None
                size = None if error is None else error * y
                lines.append((column, Line(number, f"{run.name}: {words(column)}", x, y, size)))
        if not lines:
            continue
        columns = list(dict.fromkeys(column for column, _ in lines))
        below, along = scaled(over, _largest([line.x for _, line in lines]))
        beside, factor = scaled(columns[0], _largest([line.y for _, line in lines]))
        if len(columns) > 1:  # the legend says which
            beside = beside.replace(words(columns[0]), title or words(columns[0]))
        yield Panel(
            below,
            beside,
            tuple(
                replace(
                    line,
                    name=line.name if len(columns) > 1 else results[line.run].name,
                    x=along * line.x,
                    y=factor * line.y,
                    error=None if line.error is None else factor * line.error,
                )
                for _, line in lines
            ),
            kind,
        )


def _largest(values: Sequence[Array]) -> float:
    return max((float(np.nanmax(np.abs(one), initial=0.0)) for one in values), default=0.0)


def _curve_panels(results: Sequence[Results]) -> Iterator[Panel]:
    chosen: tuple[str, ...] = ("k_tangent_N_per_m", "transmission_error_um", "peak_line_load_N_per_mm")
    if all("k_mesh_N_per_m" in run.main for run in results):
        chosen = ("k_mesh_N_per_m", "k_tangent_N_per_m", "transmission_error_um", "peak_pressure_MPa")
    yield from _panels(results, "", "pinion_angle_deg", chosen)


def _map_panels(results: Sequence[Results]) -> Iterator[Panel]:
    if all(run.table("loadmap_torques.csv") for run in results):
        yield from _panels(
            results, "loadmap_torques.csv", "torque_Nm",
            ("k_mesh_mean_N_per_m", "transmission_error_peak_to_peak_um", "peak_pressure_largest_MPa",
             "root_stress_largest_pinion_MPa", "root_stress_largest_wheel_MPa"),
        )  # fmt: skip
        return
    for column in ("transmission_error_peak_to_peak_um", "k_tangent_mean_N_per_m", "K_H_beta"):
        lines = []
        for number, run in enumerate(results):
            table = _mapping(run.summary.get("by_torque"))
            if {column, "torque_wheel_Nm"} <= table.keys():
                x, y = (np.array(table[name], dtype=float) for name in ("torque_wheel_Nm", column))
                lines.append(Line(number, run.name, x, y))
        if lines:
            yield Panel(label("torque_wheel_Nm"), label(column), tuple(lines))


def _vibration_panels(results: Sequence[Results]) -> Iterator[Panel]:
    meshes = sorted({name for run in results for name in run.main if re.fullmatch(r"contact_force_\d+_N", name)})
    loudest = _loudest(results)
    yield from _panels(results, "", "time_s", [*meshes[:2], *loudest])
    yield from _panels(results, "spectrum.csv", "frequency_Hz", loudest, kind="lines")
    yield from _panels(results, "spectrum.csv", "frequency_Hz", ["radiated_power_level_dB"])
    yield from _panels(results, "third_octaves.csv", "nominal_frequency_Hz", ["radiated_power_level_dBA"], kind="bars")


def _loudest(results: Sequence[Results]) -> list[str]:
    """Pattern of the attachment of the first run with the largest acceleration, if all runs have it."""
    peaks = {
        name: float(np.abs(values).max())
        for name, values in results[0].main.items()
        if re.fullmatch(r"attachment_.+_acceleration_m_per_s2", name) and all(name in run.main for run in results)
    }
    return [re.escape(max(peaks, key=lambda name: peaks[name]))] if peaks else []


def _runup_panels(results: Sequence[Results]) -> Iterator[Panel]:
    names = [
        name
        for name in results[0].main
        if re.fullmatch(r"(dynamic_factor|peak_to_peak_transmission_error)_\d+.*", name)
    ]
    rms = {
        name: float(np.nanmax(values))
        for name, values in results[0].main.items()
        if name.startswith("acceleration_rms_") and np.isfinite(values).any()
    }
    loudest = [max(rms, key=lambda name: rms[name])] if rms else []
    chosen = [re.escape(name) for name in (*names[:4], *loudest)]
    yield from _panels(results, "", "speed_rad_per_s", [*chosen, "radiated_power_level_dB"])


def _rating_panels(results: Sequence[Results]) -> Iterator[Panel]:
    """Safety factors of each run, side by side."""
    lines = []
    for number, run in enumerate(results):
        rows = zip(run.main["name"], _texts(run.main["gear_1"]), _texts(run.main["gear_2"]), strict=True)
        values = np.array([_number(value) for name, *both in rows if name in SAFETY for value in both])
        if len(values):
            lines.append(Line(number, run.name, np.arange(1.0, len(values) + 1.0), values))
    if lines:
        yield Panel("S_H of both gears, then S_F of both", "safety factor", tuple(lines), "bars")


def _mechanism_panels(results: Sequence[Results]) -> Iterator[Panel]:
    names = [name for name, values in results[0].main.items() if name != "time_s" and values.dtype.kind == "f"]
    yield from _panels(results, "", "time_s", [re.escape(name) for name in names[:MOST]])


#: Kind -> the curves of its results.
PANELS: dict[str, Callable[[Sequence[Results]], Iterator[Panel]]] = {
    "stiffness": _curve_panels,
    "loadmap": _map_panels,
    "vibration": _vibration_panels,
    "runup": _runup_panels,
    "rating": _rating_panels,
    "mechanism": _mechanism_panels,
}


# ---- printing --------------------------------------------------------------------------------------------------------


def comparison_lines(made: Comparison, most: int = 24) -> list[str]:
    """Lines to print: the first `most` numbers with their differences, and the notes."""
    names = [run.name for run in made.results]
    lines = [f"{made.results[0].kind.title}: " + "; ".join(f"{run.name} ({run.path})" for run in made.results)]
    for row in made.rows[:most]:
        text = f"{row.name}: {_with(row.values[0], row.errors[0])} in {names[0]}"
        for i, name in enumerate(names[1:]):
            text += f"; {name}: {_difference(row, i)}"
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
        text += f", {'+' if relative > 0.0 else ''}{percent(relative, 3)}"
    return text + (" (within its error)" if abs(difference) <= error else "")


def _with(value: float, error: float) -> str:
    return "-" if math.isnan(value) else f"{value:.5g}{_error(error)}"


def _error(error: float) -> str:
    """Text of an error; none of a formula."""
    if error == 0.0:
        return ""
    return f" +- {error:.2g}" if math.isfinite(error) else " +- ?"
