"""Tables of a report: data of the gears, results over the load or the speed with their errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..base.quantities import parted, unit_of, words
from ..base.shown import percent
from ..base.typing import Array
from .report_page import PICTURES, Run, Sheet
from .results import Results
from .run_numbers import NUMBERS, Number, entries, finite, mapping

#: Rows of a table at most, and pictures of a kind in this order; others follow up to `PICTURES_OF_RUN`.
MOST_ROWS, PICTURES_OF_RUN, PICTURES_OF_SEVERAL = 14, 4, 2
FIRST = (
    "stiffness.png", "loadmap.png", "loadmap_load.png", "response.png", "spectrum.png", "radiated_power.png",
    "meshes.png", "waterfall.png", "campbell.png", "rating.png",
)  # fmt: skip
#: Data of a gear: key of the derived geometry -> words.
OF_GEAR = {
    "teeth": "number of teeth", "module_mm": "module (mm)", "pressure_angle_deg": "pressure angle (°)",
    "helix_angle_deg": "helix angle (°)", "profile_shift": "profile shift coefficient",
    "face_width_mm": "face width (mm)", "pitch_diameter_mm": "reference diameter (mm)",
    "tip_diameter_mm": "tip diameter (mm)", "root_diameter_mm": "root diameter (mm)",
    "bore_diameter_mm": "bore diameter (mm)", "span_teeth": "teeth of the span", "span_mm": "span (mm)",
    "youngs_modulus_GPa": "Young's modulus (GPa)",
}  # fmt: skip
#: Data of a mesh.
OF_MESH = {
    "centre_distance_mm": "centre distance (mm)", "working_pressure_angle_deg": "working pressure angle (°)",
    "contact_ratio": "contact ratio", "overlap_ratio": "overlap ratio", "backlash_mm": "backlash (mm)",
}  # fmt: skip
#: Columns by torque: beginnings of their names, in this order.
OVER_LOAD = (
    "transmission_error_peak_to_peak", "transmission_error_mean", "k_mesh_mean", "k_tangent_mean", "peak_pressure",
    "largest_hertzian", "edge_pressure", "root_stress", "largest_root_stress", "K_H_beta", "K_H_alpha",
)  # fmt: skip
#: Columns over the speed.
OVER_SPEED = ("dynamic_factor", "share_without_contact", "peak_to_peak_transmission_error", "radiated_power")


def gear_sheets(
    mesh: str, names: Sequence[str], geometry: Mapping[str, Any], gears: Sequence[Mapping[str, Any]]
) -> list[Sheet]:
    """Table of the data of two gears and their mesh.

    Parameters
    ----------
    mesh : str
        Name of the mesh, for the title.
    names : sequence of str
        Names of both gears.
    geometry : mapping
        Derived geometry of the pair.
    gears : sequence of mapping
        Data of both gears.
    """
    rows = [
        [text, *(_text(gear.get(key)) for gear in gears)]
        for key, text in OF_GEAR.items()
        if any(gear.get(key) is not None for gear in gears)
    ]
    pair = [[text, _text(geometry[key])] for key, text in OF_MESH.items() if key in geometry]
    return [Sheet(f"Gears of {mesh}", ("", *names), rows), Sheet("", (), pair)]


def _text(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return "-" if value is None else str(value)
    if isinstance(value, (int, float, np.number)):
        return "-" if not math.isfinite(value) else f"{float(value):.6g}"
    return str(value)


def run_of(results: Results, *, title: str = "", command: str = "", said: str = "", most: int = PICTURES_OF_RUN) -> Run:
    """One run of a report from its folder.

    Parameters
    ----------
    results : Results
        The results.
    title : str
        Heading; by default what the results are.
    command : str
        The line that made the run, if it is known.
    said : str
        What the command printed.
    most : int
        Pictures at most.
    """
    folder = results.path.parent
    pictures = [path for path in sorted(folder.iterdir()) if path.suffix in PICTURES]
    pictures.sort(key=lambda path: FIRST.index(path.name) if path.name in FIRST else len(FIRST))
    tables = {path.stem: results.table(path.name) for path in sorted(folder.glob("*.csv"))}
    return Run(
        title or results.kind.title[:1].upper() + results.kind.title[1:],
        command=command,
        said=said,
        sheets=sheets_of(results),
        summary=results.summary,
        tables=tables,
        pictures=pictures[:most],
    )


def sheets_of(results: Results) -> list[Sheet]:
    """Tables of the results of a run: over the load or the speed, else of its numbers with their errors."""
    return SHEETS.get(results.kind.name, _of_numbers)(results)


def merged(sheets: Sequence[Sheet]) -> list[Sheet]:
    """Tables, those with the same cells as one with both titles."""
    found: dict[tuple[tuple[str, ...], ...], list[Sheet]] = {}
    for sheet in sheets:
        found.setdefault(tuple(tuple(row) for row in sheet.rows), []).append(sheet)
    return [
        Sheet("; ".join(dict.fromkeys(one.title for one in alike if one.title)), alike[0].head, rows, alike[0].note)
        for rows, alike in found.items()
    ]


def _number_rows(numbers: Sequence[Number]) -> list[list[str]]:
    """Rows of numbers with their errors."""
    return [
        [number.name, _text(number.value), _error(number), number.unit]
        for number in numbers
        if np.isfinite(number.value)
    ]


def _error(number: Number) -> str:
    if number.error == 0.0:
        return ""
    return f"± {number.error:.2g}" if math.isfinite(number.error) else "± ?"


def _numbers(results: Results) -> list[Number]:
    return list(NUMBERS[results.kind.name]([results])[0].values())


def _of_numbers(results: Results) -> list[Sheet]:
    """The first numbers of a run."""
    rows = _number_rows(_numbers(results)[: 2 * MOST_ROWS])
    return [Sheet("Results", ("quantity", "value", "error", "unit"), rows, _note(results, rows))]


def _note(results: Results, rows: Sequence[Sequence[str]]) -> str:
    """Return notes on the numbers: warnings and the meaning of the errors."""
    warnings = [str(text) for text in results.summary.get("warnings") or ()]
    unknown = any("?" in row[2] for row in rows)
    return "; ".join([*(["± ?: no estimate of the error"] if unknown else []), *warnings])


def _of_curve(results: Results) -> list[Sheet]:
    if "by_torque" in results.summary:
        return _over_load(results)
    load = results.summary.get("load") or {}
    torque = load.get("torque_wheel_Nm") or {}
    rows = [["torque at the wheel, mean", _text(torque.get("mean")), "", "N m"]] if torque else []
    rows += _number_rows(_numbers(results))
    iso = results.summary.get("iso_6336") or {}
    if "c_gamma_times_width_N_per_m" in iso:
        rows.append(["ISO 6336-1, method B: c_γ b", _text(1e-6 * iso["c_gamma_times_width_N_per_m"]), "", "N/µm"])
    return [Sheet("Results", ("quantity", "value", "error", "unit"), rows, _note(results, rows))]


def _over_load(results: Results) -> list[Sheet]:
    """A row for each torque; errors of the root stress and of loads along the width below."""
    table = results.summary.get("by_torque") or {}
    key = next((name for name in ("torque_Nm", "torque_wheel_Nm") if name in table), None)
    if key is None:
        return []
    chosen = [
        name for begin in OVER_LOAD for name in table
        if name.startswith(begin) and "error_estimate" not in name and not name.endswith(("_deg", "_y_mm"))
        and "roll_length" not in name and "diameter" not in name
    ]  # fmt: skip
    columns = {name: np.array(table[name], dtype=float) for name in dict.fromkeys([key, *chosen])}
    estimates = results.summary.get("error_estimate") or {}
    notes = [f"{words(name)}: error {_percent(value)}" for name, value in estimates.items()]
    root = results.summary.get("root_stress_error_estimate")
    if root is not None:
        notes.append(f"root stress: error at worst {_percent(root)}")
    return [_columns_sheet("Results over the load", columns, "; ".join(notes) or "± ?: no estimate of the error")]


def _percent(value: Any) -> str:
    values = np.atleast_1d(np.array(value, dtype=float))
    return percent(float(np.nanmax(values))) if np.isfinite(values).any() else "unknown"


def _over_speed(results: Results) -> list[Sheet]:
    """Steady states at evenly spread rows, and critical speeds."""
    main = results.main
    chosen = [name for begin in OVER_SPEED for name in main if name.startswith(begin)]
    rms = [name for name in main if name.startswith("acceleration_rms_")]
    if rms:
        chosen.append(max(rms, key=lambda name: float(np.nanmax(main[name], initial=0.0))))
    rows = np.unique(np.linspace(0, len(main["speed_rad_per_s"]) - 1, MOST_ROWS).round().astype(int))
    columns = {name: main[name][rows] for name in ("speed_rpm", "speed_rad_per_s", *chosen) if name in main}
    sheets = [
        _columns_sheet(
            "Results over the speed", columns, f"{len(rows)} of {len(main['speed_rad_per_s'])} steady states"
        )
    ]
    peaks = [peak for peak in results.summary.get("peaks") or () if isinstance(peak, Mapping)]
    found = [
        [
            _text(peak.get("speed_rad_per_s")), f"{peak.get('order')} at {_text(peak.get('frequency_Hz'))} Hz",
            str(peak.get("mode") or "no mode near"), f"{_text(peak.get('dynamic_factor'))} in {peak.get('mesh')}",
        ]
        for peak in peaks[:6]
    ]  # fmt: skip
    if found:
        sheets.append(Sheet("Peaks of the dynamic factor", ("speed (rad/s)", "order", "mode", "dynamic factor"), found))
    largest = results.summary.get("largest_error_estimate")
    if largest is not None:
        note = f"error of the harmonic balance: at most {_percent(largest)} of the approach under the steady force"
        sheets.append(Sheet("", (), (), note))
    return sheets


def _columns_sheet(title: str, columns: Mapping[str, Array], note: str) -> Sheet:
    """A table of columns; their heads are words and units, stiffnesses in N/µm."""
    heads, cells = [], []
    for name, values in columns.items():
        unit = unit_of(name)
        factor, symbol = (1e-6, "N/µm") if unit.key == "N_per_m" else (1.0, unit.symbol)
        heads.append(words(name) + (f" ({symbol})" if symbol else ""))
        cells.append(
            [f"{factor * value:.5g}" if math.isfinite(value) else "-" for value in np.asarray(values, dtype=float)]
        )
    return Sheet(title, heads, [list(row) for row in zip(*cells, strict=True)], note)


def _of_rating(results: Results) -> list[Sheet]:
    """Safety factors of both gears, and the factors of the mesh."""
    main, gears = results.main, results.summary.get("gears") or {}
    names = [str(gears.get(key, key.replace("_", " "))) for key in ("gear_1", "gear_2")]
    wanted = (
        "S_H",
        "S_F",
        "S_B",
        "S_intS",
        "sigma_H",
        "sigma_F",
        "K_A",
        "K_v",
        "K_H_beta",
        "K_Hbeta",
        "K_H_alpha",
        "K_Halpha",
        "F_t_N",
        "theta_B_C",
        "H_V",
        "P_V_W",
    )
    rows = [
        [f"{key}: {meaning}", *(_cell(value) for value in values), "" if unit == "-" else str(unit)]
        for key, unit, meaning, *values in zip(
            main["name"], main["unit"], main["meaning"], main["gear_1"].tolist(), main["gear_2"].tolist(), strict=True
        )
        if parted(str(key))[0].removesuffix("_N_per_mm2") in wanted or key in wanted
    ]
    rows.sort(
        key=lambda row: wanted.index(row[0].partition(":")[0]) if row[0].partition(":")[0] in wanted else len(wanted)
    )
    edition = str(results.summary.get("edition", "ISO 6336"))
    return [Sheet(f"Load capacity by {edition}", ("", *names, "unit"), rows, _warnings(results))]


def _cell(value: Any) -> str:
    try:
        return f"{float(value):.5g}"
    except (TypeError, ValueError):
        return str(value)


def _warnings(results: Results) -> str:
    return "; ".join(str(text) for text in results.summary.get("warnings") or ())


def _of_modes(results: Results) -> list[Sheet]:
    """Natural frequencies, critical speeds by their distance to the speed of the drive, and the nearest modes."""
    summary, sheets = results.summary, []
    modes = [mapping(mode) for mode in entries(summary.get("modes"))]
    rows = [
        [
            str(mode.get("name")), _text(mode.get("frequency_Hz")),
            _text(mode.get("frequency_at_the_fastest_speed_Hz")), _text(100.0 * finite(mode.get("damping_ratio"))),
            str(mode.get("label") or ""),
        ]
        for mode in modes[: 2 * MOST_ROWS]
    ]  # fmt: skip
    if rows:
        head = ("mode", "first speed (Hz)", "last speed (Hz)", "damping (%)", "what moves")
        note = f"{len(rows)} of {len(modes)} modes" if len(rows) < len(modes) else ""
        sheets.append(Sheet("Natural frequencies", head, rows, note))
    drive = finite(summary.get("speed_of_the_drive_rad_per_s"))
    met = [c for c in map(mapping, entries(summary.get("critical_speeds"))) if c.get("excited")]
    met = [c for c in met if math.isfinite(finite(c.get("speed_rad_per_s")))]
    if math.isfinite(drive):
        met.sort(key=lambda c: abs(finite(c.get("speed_rad_per_s")) - drive))
    rows = [
        [
            _text(c.get("speed_rad_per_s")), _text(30.0 / math.pi * finite(c.get("speed_rad_per_s"))),
            _text(c.get("frequency_Hz")), str(c.get("order")), f"{c.get('mode')}: {c.get('label')}",
        ]
        for c in met[:MOST_ROWS]
    ]  # fmt: skip
    if rows:
        head = ("rad/s", "1/min", "Hz", "excitation", "mode")
        note = f"{len(rows)} of {len(met)} critical speeds"
        if math.isfinite(drive):
            note += f", nearest to that of the drive first, {_text(drive)} rad/s"
        sheets.append(Sheet("Critical speeds", head, rows, note))
    return sheets


#: Kind -> its tables; of other kinds the numbers that a comparison takes, too.
SHEETS: dict[str, Callable[[Results], list[Sheet]]] = {
    "stiffness": _of_curve,
    "loadmap": _over_load,
    "runup": _over_speed,
    "rating": _of_rating,
    "modes": _of_modes,
}


def date_of(path: Path) -> str:
    """Date of a file, as a report has it."""
    return datetime.fromtimestamp(path.stat().st_mtime).astimezone().strftime("%Y-%m-%d %H:%M")
