"""Names of columns in words with their units: ``peak_pressure_MPa`` is the Hertzian pressure in MPa.

Every column that the program writes ends with its unit. `unit_of` and `words` are what pictures, comparisons, reports
and universal files say of it.
"""

from __future__ import annotations

import re
from typing import NamedTuple


class Unit(NamedTuple):
    """A unit at the end of a column's name.

    Attributes
    ----------
    key
        As it ends the name: ``N_per_m``.
    symbol
        As texts have it: N/m.
    si
        Key of the SI unit of the same quantity; itself for an SI unit.
    factor
        Factor to that.
    quantity
        Kind of quantity: "force", "length", ...
    """

    key: str
    symbol: str
    si: str
    factor: float
    quantity: str


_DEGREE = 0.017453292519943295
#: Key -> symbol, key of the SI unit, factor to it, kind of quantity (ISO 80000).
_UNITS: dict[str, tuple[str, str, float, str]] = {
    "s": ("s", "s", 1.0, "time"),
    "ms": ("ms", "s", 1e-3, "time"),
    "us": ("µs", "s", 1e-6, "time"),
    "h": ("h", "s", 3600.0, "time"),
    "Hz": ("Hz", "Hz", 1.0, "frequency"),
    "kHz": ("kHz", "Hz", 1e3, "frequency"),
    "m": ("m", "m", 1.0, "length"),
    "mm": ("mm", "m", 1e-3, "length"),
    "um": ("µm", "m", 1e-6, "length"),
    "rad": ("rad", "rad", 1.0, "angle"),
    "urad": ("µrad", "rad", 1e-6, "angle"),
    "deg": ("°", "rad", _DEGREE, "angle"),
    "m_per_s": ("m/s", "m_per_s", 1.0, "velocity"),
    "m_per_s2": ("m/s²", "m_per_s2", 1.0, "acceleration"),
    "rad_per_s": ("rad/s", "rad_per_s", 1.0, "angular velocity"),
    "rad_per_s2": ("rad/s²", "rad_per_s2", 1.0, "angular acceleration"),
    "rpm": ("1/min", "rad_per_s", 6.0 * _DEGREE, "angular velocity"),
    "per_s": ("1/s", "per_s", 1.0, "rate"),
    "kg": ("kg", "kg", 1.0, "mass"),
    "N": ("N", "N", 1.0, "force"),
    "kN": ("kN", "N", 1e3, "force"),
    "Nm": ("N m", "Nm", 1.0, "moment"),
    "N_m": ("N m", "Nm", 1.0, "moment"),
    "Pa": ("Pa", "Pa", 1.0, "pressure"),
    "MPa": ("MPa", "Pa", 1e6, "pressure"),
    "GPa": ("GPa", "Pa", 1e9, "pressure"),
    "N_per_m": ("N/m", "N_per_m", 1.0, "stiffness"),
    "N_per_um": ("N/µm", "N_per_m", 1e6, "stiffness"),
    "N_per_mm": ("N/mm", "N_per_m", 1e3, "stiffness"),
    "Nm_per_rad": ("N m/rad", "Nm_per_rad", 1.0, "rotational stiffness"),
    "W": ("W", "W", 1.0, "power"),
    "J": ("J", "J", 1.0, "energy"),
    "dB": ("dB", "dB", 1.0, "level"),
    "dBA": ("dB(A)", "dBA", 1.0, "level"),
}
UNITS = {key: Unit(key, *entry) for key, entry in _UNITS.items()}
_LONGEST_FIRST = sorted(UNITS, key=len, reverse=True)
NUMBER = Unit("", "", "", 1.0, "number")


def parted(column: str) -> tuple[str, Unit]:
    """The name of a column without its unit, and the unit; `NUMBER` for one without."""
    for key in _LONGEST_FIRST:
        if column.endswith("_" + key) and len(column) > len(key) + 1:
            return column[: -len(key) - 1], UNITS[key]
    return column, NUMBER


def unit_of(column: str) -> Unit:
    """Unit of a column, by the end of its name."""
    return parted(column)[1]


#: Names without units -> words: the first pattern that fits. Names of the user's shafts and bores are quoted.
_WORDS = tuple(
    (re.compile(pattern + r"\Z"), text)
    for pattern, text in (
        (r"k_mesh", "mesh stiffness"),
        (r"k_tangent", "tangent mesh stiffness"),
        (r"k_torsional", "torsional stiffness of the mesh"),
        (r"k_mesh_mean", "mean mesh stiffness"),
        (r"k_tangent_mean", "mean tangent mesh stiffness"),
        (r"transmission_error_peak_to_peak", "transmission error, peak to peak"),
        (r"transmission_error_mean", "transmission error, mean"),
        (r"transmission_error_unloaded", "transmission error without load"),
        (r"peak_to_peak_transmission_error_(\d+)", r"transmission error of mesh \1, peak to peak"),
        (r"transmission_error_(\d+)", r"transmission error of mesh \1"),
        (r"peak_pressure(_largest)?", "Hertzian pressure"),
        (r"edge_pressure(_largest)?", "pressure at edges"),
        (r"root_stress(?:_largest)?_(pinion|wheel)", r"root stress, \1"),
        (r"mesh_order_(\d+)", r"mesh order \1 of the transmission error"),
        (r"load_share_(\d+)", r"load share of pair \1"),
        (r"torque", "torque"),
        (r"torque_(wheel|pinion)", r"torque at the \1"),
        (r"contact_force_(\d+)", r"contact force of mesh \1"),
        (r"(mean|least)_force_(\d+)", r"\1 contact force of mesh \2"),
        (r"peak_to_peak_force_(\d+)", r"contact force of mesh \1, peak to peak"),
        (r"dynamic_factor_(\d+)", r"dynamic factor of mesh \1"),
        (r"share_without_contact_(\d+)", r"share of the time without contact, mesh \1"),
        (r"attachment_(.+)_acceleration", r'acceleration at attachment "\1"'),
        (r"bearing_force_rms_(.+)_([xyz])", r'rms force on bearing "\1" along \2'),
        (r"mean_bearing_force_(.+)_([xyz])", r'mean force on bearing "\1" along \2'),
        (r"bearing_force_(.+)_([xyz])", r'force on bearing "\1" along \2'),
        (r"bearing_(.+)_(force|moment)_([xyz])", r'\2 on bearing "\1" along \3'),
        (r"rotation_(.+)", r'rotation of shaft "\1"'),
        (r"drive_torque", "torque of the drive"),
        (r"drive_angle", "rotation of the drive"),
        (r"radiated_power(_level)?", "radiated power"),
        (r"nominal_frequency", "third octave"),
        (r"instantaneous_radiated_power", "radiated power of the instant"),
        (r"speed", "speed of the drive"),
    )
)
#: The like with the kind of quantity that decides between a shaft and something else.
_OF_SHAFTS = (
    (re.compile(r"speed_absolute_(.+)\Z"), "angular velocity", r'absolute speed of shaft "\1"'),
    (
        re.compile(r"acceleration_absolute_(.+)\Z"),
        "angular acceleration",
        r'absolute angular acceleration of shaft "\1"',
    ),
    (re.compile(r"speed_(.+)\Z"), "angular velocity", r'speed of shaft "\1"'),
    (re.compile(r"acceleration_(.+)\Z"), "angular acceleration", r'angular acceleration of shaft "\1"'),
    (re.compile(r"acceleration_rms_(.+)\Z"), "acceleration", r'rms acceleration at attachment "\1"'),
    (re.compile(r"acceleration_(.+)\Z"), "acceleration", r'acceleration at attachment "\1"'),
)


def words(column: str) -> str:
    """Describe a column in words without the unit: ``speed_out_rad_per_s`` is: speed of shaft "out"."""
    stem, unit = parted(column)
    for pattern, quantity, text in _OF_SHAFTS:
        if unit.quantity == quantity and pattern.match(stem):
            return pattern.sub(text, stem)
    for pattern, text in _WORDS:
        if pattern.match(stem):
            return pattern.sub(text, stem)
    return stem.replace("_", " ")


def label(column: str) -> str:
    """Words and unit of a column, as an axis has them: mesh stiffness (N/m)."""
    symbol = unit_of(column).symbol
    return words(column) + (f" ({symbol})" if symbol else "")


def scaled(column: str, largest: float) -> tuple[str, float]:
    """Return the label of a column by its largest value, and the factor to its unit (N/µm, ms, kHz, ...).

    Parameters
    ----------
    column
        Name of the column.
    largest
        Largest size of its values, in its unit.
    """
    key = unit_of(column).key
    for of, above, below, symbol, factor in (
        ("N_per_m", 1e6, float("inf"), "N/µm", 1e-6),
        ("s", 0.0, 1.0, "ms", 1e3),
        ("Hz", 3000.0, float("inf"), "kHz", 1e-3),
        ("N", 3000.0, float("inf"), "kN", 1e-3),
    ):
        if key == of and above < largest < below:
            return f"{words(column)} ({symbol})", factor
    return label(column), 1.0
