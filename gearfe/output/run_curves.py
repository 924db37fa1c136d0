"""Curves that each kind of run is drawn by, next to those of other runs of its kind."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.quantities import label, scaled, words
from ..base.typing import Array
from .results import Results
from .run_numbers import MOST, SAFETY, mapping, number_of, texts


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
            table = mapping(run.summary.get("by_torque"))
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
        rows = zip(run.main["name"], texts(run.main["gear_1"]), texts(run.main["gear_2"]), strict=True)
        values = np.array([number_of(value) for name, *both in rows if name in SAFETY for value in both])
        if len(values):
            lines.append(Line(number, run.name, np.arange(1.0, len(values) + 1.0), values))
    if lines:
        yield Panel("S_H of both gears, then S_F of both", "safety factor", tuple(lines), "bars")


def _modes_panels(results: Sequence[Results]) -> Iterator[Panel]:
    """Natural frequencies at the slowest speed by their numbers, side by side."""
    lines = []
    for number, run in enumerate(results):
        modes = run.summary.get("modes")
        entries = [mapping(mode).get("frequency_Hz") for mode in modes] if isinstance(modes, list) else []
        known = [(k, value) for k, value in enumerate(entries, start=1) if isinstance(value, (int, float))]
        if known:
            numbers, values = np.array(known, dtype=np.float64).T
            lines.append(Line(number, run.name, numbers, values))
    if lines:
        yield Panel("mode", "natural frequency (Hz)", tuple(lines), "bars")


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
    "modes": _modes_panels,
    "mechanism": _mechanism_panels,
}
