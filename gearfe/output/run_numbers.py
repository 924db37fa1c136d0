"""Read the numbers of each kind of run, with the sources of their errors, from summary and tables."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base.quantities import parted, unit_of, words
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
#: Safety factors of a rating.
SAFETY = ("S_H", "S_F")
#: Ends of the names of a rating's numbers.
GEARS = " (gear 1)", " (gear 2)"


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


def finite(value: Any) -> float:
    """Return a number of a summary as a float; NaN for null and anything else."""
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan


def mapping(value: Any) -> Mapping[str, Any]:
    """Return an entry of a summary that is a table; an empty one for anything else."""
    return value if isinstance(value, Mapping) else {}


def entries(value: Any) -> list[Any]:
    """Return an entry of a summary that is a list; an empty one for anything else."""
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
    levels = mapping(run.summary.get("mesh_stiffness"))
    found = []
    for text, own, size in (
        ("mean", k.mean(), (error * k).mean()),
        ("least", k.min(), (error * k)[k.argmin()]),
        ("largest", k.max(), (error * k)[k.argmax()]),
    ):
        value = 1e-6 * finite(levels.get(f"{text}_N_per_m", float(own)))
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
    table = mapping(run.summary.get("by_torque"))
    key = next((name for name in ("torque_Nm", "torque_wheel_Nm") if name in table), None)
    if key is None:
        return []
    found, errors = [], mapping(run.summary.get("error_estimate"))
    root = finite(run.summary.get("root_stress_error_estimate"))
    for i, torque in enumerate(entries(table[key])):
        for column, values in table.items():
            if column == key or _COUNTS.match(column) or column.endswith("_error_estimate"):
                continue
            value, stem = finite(entries(values)[i]), parted(column)[0]
            parts = {}
            if "root_stress" in column:
                own = table.get(f"{stem}_error_estimate")
                relative = finite(entries(own)[i]) if own is not None else root
                parts = {"root mesh": abs(relative * value)}
            elif stem in errors:
                given = errors[stem]
                parts = {"gear mesh": abs(finite(entries(given)[i] if isinstance(given, list) else given) * value)}
            unit = unit_of(column)
            factor, symbol = (1e-6, "N/µm") if unit.key == "N_per_m" else (1.0, unit.symbol)
            scaled = {source: factor * size for source, size in parts.items()}
            found.append(Number(f"{words(column)} at {torque:.6g} N m", symbol, factor * value, scaled))
    return found


def _vibration_numbers(run: Results) -> list[Number]:
    """Forces, natural frequencies, accelerations, radiated power and lines of a response, as its summary has them."""
    summary = run.summary
    parts, changes = mapping(summary.get("headline_error_parts")), mapping(summary.get("headline_error_changes"))

    def entry(name: str, place: int | str | None = None) -> tuple[dict[str, float], dict[str, Array]]:
        """Parts and changes of a number of the summary, or of one entry of it."""

        def pick(values: Any) -> float:
            return finite(values if place is None else values[place])

        sizes = {source: pick(part[name]) for source, part in parts.items() if name in part}
        moves = {
            source: np.array([pick(one[name]) for one in runs])
            for source, runs in changes.items()
            if runs and name in runs[0]
        }
        return sizes, moves

    found: list[Number] = []
    meshes = [str(name) for name in entries(summary.get("meshes"))]
    for name, text in (
        ("mean_contact_forces_N", "mean contact force"),
        ("smallest_contact_forces_under_load_N", "smallest contact force under load"),
        ("largest_contact_forces_N", "largest contact force"),
    ):
        for i, (mesh, value) in enumerate(zip(meshes, entries(summary.get(name)), strict=False)):
            found.append(Number(f"{text} of {mesh}", "N", finite(value), *entry(name, i)))
    name = "coupled_frequencies_Hz"
    for i, value in enumerate(entries(summary.get(name))[:MOST]):
        text = f"natural frequency {i + 1} of the coupled system"
        found.append(Number(text, "Hz", finite(value), *entry(name, i)))
    name = "peak_attachment_accelerations_m_per_s2"
    for bore, value in mapping(summary.get(name)).items():
        if value == 0.0:  # of a rigid housing
            continue
        text = f'largest acceleration at attachment "{bore}"'
        found.append(Number(text, "m/s²", finite(value), *entry(name, bore)))
    power = mapping(summary.get("radiated_power"))
    mean = finite(power.get("mean_W"))
    if mean > 0.0:
        sizes, moves = entry("radiated_power_mean_W")
        factor = DECIBELS / mean
        found.append(
            Number(
                "mean radiated power (re 1e-12 W)",
                "dB",
                finite(power.get("mean_level_dB")),
                {s: factor * x for s, x in sizes.items()},
                {s: factor * x for s, x in moves.items()},
            )
        )
    for signal, lines in mapping(summary.get("dominant_lines")).items():
        found += _line_numbers(signal, entries(lines))
    return found


def _line_numbers(signal: str, lines: Sequence[Any]) -> Iterator[Number]:
    """The largest lines of a signal: by the multiple that they belong to, else by their frequency."""
    text, unit = words(signal), unit_of(signal).symbol
    if not (signal.startswith(("attachment_", "transmission_error_", "contact_force_"))):
        return
    seen: set[str] = set()
    for line in map(mapping, lines):
        near = line.get("near") or f"{finite(line.get('frequency_Hz')):.6g} Hz"
        if near in seen or len(seen) == MOST:
            continue
        seen.add(str(near))
        sizes = {source: finite(size) for source, size in mapping(line.get("error_parts")).items()}
        if not sizes and "error_estimate" in line:
            sizes = {"all": finite(line["error_estimate"])}
        moves = {s: np.array([finite(x) for x in rows]) for s, rows in mapping(line.get("error_changes")).items()}
        yield Number(f"{text}, line {near}", unit, finite(line.get("amplitude")), sizes, moves)


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
    for i, turn in enumerate(entries(summary.get("turning_speeds_rad_per_s"))[:MOST]):
        found.append(Number(f"turning point {i + 1}", "rad/s", finite(turn)))
    for i, mode in enumerate(entries(summary.get("modes"))[:MOST]):
        frequency = finite(mapping(mode).get("frequency_Hz"))
        found.append(Number(f"natural frequency {i + 1} of the coupled system", "Hz", frequency))
    return found


def _modes_numbers(run: Results) -> list[Number]:
    """Natural frequencies at the slowest speed, and speeds at which excitations meet them."""
    found = []
    for mode in map(mapping, entries(run.summary.get("modes"))[: 2 * MOST]):
        text = f"natural frequency {mode.get('name')}, {mode.get('label')}"
        found.append(Number(text, "Hz", finite(mode.get("frequency_Hz"))))
    excited = [c for c in map(mapping, entries(run.summary.get("critical_speeds"))) if c.get("excited")]
    for critical in excited[: 2 * MOST]:
        text = f"critical speed: {critical.get('order')} meets mode {critical.get('mode')}, {critical.get('label')}"
        found.append(Number(text, "rad/s", finite(critical.get("speed_rad_per_s"))))
    return found


def _rating_numbers(run: Results) -> list[Number]:
    """All values of a rating, safety factors first; they are formulas, without an error of a discretisation."""
    table = run.main
    rows = zip(
        table["name"], table["unit"], table["meaning"], texts(table["gear_1"]), texts(table["gear_2"]), strict=True
    )
    found = []
    for key, unit, meaning, *values in rows:
        text = f"{key}, {meaning}" if meaning else f"{key}"
        for gear, value in zip(GEARS, values, strict=True):
            found.append(Number(text + gear, "" if unit == "-" else str(unit), number_of(value), {"formula": 0.0}))
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


def texts(values: Array) -> list[str]:
    """Return the cells of a column as texts."""
    return [str(value) for value in values.tolist()]


def number_of(text: str) -> float:
    """Return the number that a cell holds; NaN for a text."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _mechanism_numbers(run: Results) -> list[Number]:
    """Last, least and largest value of each output."""
    errors = mapping(mapping(run.summary.get("error_estimate")).get("outputs"))
    found = []
    for column, values in run.main.items():
        if column == "time_s" or values.dtype.kind != "f" or not len(values):
            continue
        parts = {"integration": finite(errors[column])} if column in errors else {}
        for text, value in (("at the end", values[-1]), ("least", np.nanmin(values)), ("largest", np.nanmax(values))):
            found.append(Number(f"{words(column)}, {text}", unit_of(column).symbol, float(value), parts))
    return found


def _each(read: Callable[[Results], list[Number]]) -> Reader:
    """Read each run by itself."""
    return lambda results: [{number.name: number for number in read(run)} for run in results]


def _ratings(results: Sequence[Results]) -> list[dict[str, Number]]:
    """Values of ratings, with one for both gears where these are alike in all runs."""
    return _of_both_gears(_each(_rating_numbers)(results))


#: Reads runs of one kind: for each run, name -> number.
Reader = Callable[[Sequence[Results]], list[dict[str, Number]]]
#: Kind -> the numbers of its results.
NUMBERS: dict[str, Reader] = {
    "stiffness": _each(_curve_numbers),
    "loadmap": _each(_torque_numbers),
    "vibration": _each(_vibration_numbers),
    "runup": _each(_runup_numbers),
    "rating": _ratings,
    "modes": _each(_modes_numbers),
    "mechanism": _each(_mechanism_numbers),
}
