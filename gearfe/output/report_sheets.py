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
#: Columns of numbers of a table, and meshes with a column of a quantity over the speed, at most.
MOST_COLUMNS, MOST_MESHES = 6, 3
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
#: Contact forces of a run: a column for each.
FORCES = ("mean contact force", "smallest contact force under load", "largest contact force")
#: Columns over the speed.
OVER_SPEED = ("dynamic_factor", "share_without_contact", "peak_to_peak_transmission_error", "radiated_power")
#: Those that are left out where they are 0 at all speeds.
UNLESS_ZERO = ("share_without_contact", "acceleration_rms_")


def gear_sheets(gears: Mapping[str, Mapping[str, Any]], meshes: Mapping[str, Mapping[str, Any]]) -> list[Sheet]:
    """Tables of the data of gears and meshes, a column for each.

    Parameters
    ----------
    gears : mapping
        Name of a gear -> its data.
    meshes : mapping
        Name of a mesh -> derived geometry of its pair.
    """
    sheets = [Sheet("Gears", ("", *names), _data_rows(OF_GEAR, data)) for names, data in _parts(gears)]
    return sheets + [Sheet("Meshes", ("", *names), _data_rows(OF_MESH, data)) for names, data in _parts(meshes)]


def _parts(data: Mapping[str, Mapping[str, Any]]) -> list[tuple[list[str], list[Mapping[str, Any]]]]:
    """Names and data, as many at a time as a table is wide."""
    names = list(data)
    chosen = [names[i : i + MOST_COLUMNS] for i in range(0, len(names), MOST_COLUMNS)]
    return [(some, [data[name] for name in some]) for some in chosen]


def _data_rows(texts: Mapping[str, str], data: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A row for each key that one of them has."""
    return [
        [text, *(_text(item.get(key)) for item in data)]
        for key, text in texts.items()
        if any(item.get(key) is not None for item in data)
    ]


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
        pictures={path.name: path for path in pictures[:most]},
    )


def sheets_of(results: Results) -> list[Sheet]:
    """Tables of the results of a run: over the load or the speed, else of its numbers with their errors."""
    return SHEETS.get(results.kind.name, _of_numbers)(results)


def joined(title: str, runs: Mapping[str, Run]) -> Run:
    """One run of runs of the same kind, one for each mesh: their tables as one, with columns or rows for each.

    Parameters
    ----------
    title : str
        Heading.
    runs : mapping
        Name of the mesh -> its run.
    """
    titles = dict.fromkeys(sheet.title for run in runs.values() for sheet in run.sheets)
    sheets: list[Sheet] = []
    for text in titles:
        alike = {name: sheet for name, run in runs.items() for sheet in run.sheets if sheet.title == text}
        sheets += _in_columns(text, alike) if all(_has_units(sheet) for sheet in alike.values()) else [
            _in_rows(text, alike)
        ]  # fmt: skip
    return Run(
        title,
        command="; ".join(run.command for run in runs.values() if run.command),
        said="\n".join(run.said for run in runs.values() if run.said),
        sheets=sheets,
        summary={name: run.summary for name, run in runs.items()},
        tables={f"{name}/{table}": columns for name, run in runs.items() for table, columns in run.tables.items()},
        pictures={f"{name}: {file}": path for name, run in runs.items() for file, path in run.pictures.items()},
    )


def _has_units(sheet: Sheet) -> bool:
    """Whether a table has a quantity in each row, with its unit in the last column."""
    return bool(sheet.head) and sheet.head[-1] == "unit"


def _in_columns(title: str, sheets: Mapping[str, Sheet]) -> list[Sheet]:
    """Tables of quantities as one or more with columns for each."""
    found: list[Sheet] = []
    names = list(sheets)
    wide = max(
        1, MOST_COLUMNS // max(1 if "error" in sheets[name].head else len(sheets[name].head) - 2 for name in names)
    )
    for some in (names[i : i + wide] for i in range(0, len(names), wide)):
        quantities: dict[str, str] = {row[0]: row[-1] for name in some for row in sheets[name].rows}
        head, columns = [], []
        for name in some:
            sheet = sheets[name]
            cells = {row[0]: list(row[1:-1]) for row in sheet.rows}
            if "error" in sheet.head:
                cells = {quantity: [" ".join(values).strip()] for quantity, values in cells.items()}
                head.append(name)
            else:
                head += list(sheet.head[1:-1])
            count = len(next(iter(cells.values()), []))
            columns.append([cells.get(quantity, ["-"] * count) for quantity in quantities])
        rows = [
            [quantity, *(cell for column in columns for cell in column[i]), unit]
            for i, (quantity, unit) in enumerate(quantities.items())
        ]
        found.append(Sheet(title, ("", *head, "unit"), rows, _notes({name: sheets[name] for name in some})))
    return found


def _in_rows(title: str, sheets: Mapping[str, Sheet]) -> Sheet:
    """Tables of columns as one with the rows of each."""
    heads = dict.fromkeys(cell for sheet in sheets.values() for cell in sheet.head)
    rows = []
    for name, sheet in sheets.items():
        for row in sheet.rows:
            cells = dict(zip(sheet.head, row, strict=True))
            rows.append([name, *(cells.get(head, "-") for head in heads)])
    return Sheet(title, ("mesh", *heads), rows, _notes(sheets))


def _notes(sheets: Mapping[str, Sheet]) -> str:
    """Notes of several tables; what all of them say, once."""
    notes = {name: sheet.note for name, sheet in sheets.items() if sheet.note}
    if len(notes) == len(sheets) and len(set(notes.values())) == 1:
        return next(iter(notes.values()))
    return "; ".join(f"{name}: {note}" for name, note in notes.items())


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


def _of_vibration(results: Results) -> list[Sheet]:
    """Contact forces by mesh, then the other numbers."""
    numbers = [number for number in _numbers(results) if np.isfinite(number.value)]
    forces: dict[str, dict[str, str]] = {}
    others: list[Number] = []
    lines: list[Number] = []
    for number in numbers:
        text, _, mesh = number.name.partition(" of ")
        if text in FORCES:
            forces.setdefault(mesh, {})[text] = f"{_text(number.value)} {_error(number)}".strip()
        else:
            (lines if ", line " in number.name else others).append(number)
    rows = [[mesh, *(cells.get(text, "-") for text in FORCES)] for mesh, cells in forces.items()]
    sheets = [Sheet("Contact forces", ("mesh", *(f"{text} (N)" for text in FORCES)), rows)] if rows else []
    head = ("quantity", "value", "error", "unit")
    for title, chosen in (("Results", others), ("Largest lines", lines)):
        if chosen:
            sheets.append(Sheet(title, head, _number_rows(chosen[:MOST_ROWS])))
    return [*sheets, Sheet("", (), (), _note(results, [row for sheet in sheets[1:] for row in sheet.rows]))]


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
    columns: dict[str, Array] = {name: main[name][rows] for name in ("speed_rpm", "speed_rad_per_s") if name in main}
    for begin in (*OVER_SPEED, "acceleration_rms_"):
        family = {name: main[name][rows] for name in chosen if name.startswith(begin)}
        if begin in UNLESS_ZERO and not any(np.nan_to_num(main[name]).any() for name in family):
            continue
        if len(family) > MOST_MESHES:
            unit = unit_of(next(iter(family))).key
            largest = np.nanmax(np.array(list(family.values()), dtype=float), axis=0)
            family = {f"largest_{begin}" + (f"_{unit}" if unit else ""): largest}
        columns |= family
    sheets = [
        _columns_sheet(
            "Results over the speed", columns, f"{len(rows)} of {len(main['speed_rad_per_s'])} steady states"
        )
    ]
    peaks: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for peak in results.summary.get("peaks") or ():
        if isinstance(peak, Mapping):
            excitation = f"{_short(str(peak.get('order')))} at {_text(peak.get('frequency_Hz'))} Hz"
            where = _text(peak.get("speed_rad_per_s")), excitation, str(peak.get("mode") or "no mode near")
            peaks.setdefault(where, []).append(peak)
    found = [
        [*where, f"{_text(alike[0].get('dynamic_factor'))} in {', '.join(str(peak.get('mesh')) for peak in alike)}"]
        for where, alike in list(peaks.items())[:6]
    ]
    if found:
        sheets.append(Sheet("Peaks of the dynamic factor", ("speed (rad/s)", "order", "mode", "dynamic factor"), found))
    largest = results.summary.get("largest_error_estimate")
    if largest is not None:
        note = f"error of the harmonic balance: at most {_percent(largest)} of the approach under the steady force"
        sheets.append(Sheet("", (), (), note))
    return sheets


def _short(order: str) -> str:
    """An order of meshes that coincide, "3 x mesh 1 = 3 x mesh 2 = 3 x mesh 3", as "3 x mesh 1 to mesh 3"."""
    terms = order.split(" = ")
    factors = {term.partition(" x ")[0] for term in terms}
    return order if len(terms) < 3 or len(factors) > 1 else f"{terms[0]} to {terms[-1].partition(' x ')[2]}"


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
    start = [[str(cell) for cell in row] for row in (results.summary.get("basis") or ())[1:]]  # the first has the names
    sheets = []
    if start:
        sheets.append(Sheet("Basis of the rating", ("", *names, "unit"), start, str(results.summary.get("method", ""))))
    return [*sheets, Sheet(f"Load capacity by {edition}", ("", *names, "unit"), rows, _warnings(results))]


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
        ]
        for mode in modes[:MOST_ROWS]
    ]  # fmt: skip
    if rows:
        head: tuple[str, ...] = ("mode", "first speed (Hz)", "last speed (Hz)", "damping (%)")
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
            _text(c.get("frequency_Hz")), _short(str(c.get("order"))), f"{c.get('mode')}: {c.get('label')}",
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
    "vibration": _of_vibration,
}


def date_of(path: Path) -> str:
    """Date of a file, as a report has it."""
    return datetime.fromtimestamp(path.stat().st_mtime).astimezone().strftime("%Y-%m-%d %H:%M")
