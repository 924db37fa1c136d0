r"""The mesh-stiffness curve of a gear pair: plain arrays, periodic interpolation, CSV in and out. SI units.

With the twist :math:`\vartheta` of the wheel, its hub torque T and its base radius :math:`r_b` (the reference one,
d cos(alpha)/2),

.. math::
    k_\mathrm{torsional} = T/\vartheta, \quad k_\mathrm{mesh} = T/(\vartheta r_b^2), \quad
    k_\mathrm{tangent} = (dT/d\vartheta)/r_b^2, \quad \mathrm{TE} = \vartheta r_b .

Tables hold units of their columns' names. Numbers are scaled in decimal arithmetic, so 17 significant digits in the
file's unit bring back the same double in SI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Context, Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, shown, unknown_name
from ..output.files import write_csv
from ..shown import ShownTable
from ..textfile import read_csv
from ..typing import Array, BoolArray, IntArray
from .periodic import PeriodicInterpolant, ValueAndSlope, periodic_interpolant

#: Far more digits than any double needs, so that a product is rounded once.
_EXACT = Context(prec=50)
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582")
#: Suffix of a column name -> factor from SI to that unit; other columns are in SI.
_FACTORS: dict[str, Decimal] = {
    "_deg": _EXACT.divide(Decimal(180), _PI),
    "_um": Decimal(10) ** 6,
    "_mm": Decimal(10) ** 3,
    "_MPa": Decimal(10) ** -6,
}


def factor_of(column: str) -> Decimal:
    """Factor from SI to the unit in a column's name."""
    return next((f for suffix, f in _FACTORS.items() if column.endswith(suffix)), Decimal(1))


def to_text(value: float, column: str) -> str:
    """Decimal text of an SI value in the column's unit: `from_text` gives the same double back."""
    if not np.isfinite(value):
        return "nan"
    exact = _EXACT.multiply(Decimal(float(value)), factor_of(column))
    short = _plain(Context(prec=15).plus(exact).normalize())  # where 15 digits are enough: 0.5 reads 0.5
    return short if from_text(short, column) == value else _plain(Context(prec=17).plus(exact))


def _plain(number: Decimal) -> str:
    """Without an exponent for numbers of everyday size."""
    return f"{number:f}" if -5 <= number.adjusted() < 17 else f"{number:e}"


def from_text(text: str, column: str) -> float:
    """SI value of a cell; an empty cell is not a number.

    Raises
    ------
    ValueError
        When the cell holds no number.
    """
    text = text.strip()
    if text.lower() in ("", "nan"):
        return float("nan")
    try:
        value = float(_EXACT.divide(Decimal(text), factor_of(column)))
    except (ArithmeticError, ValueError) as error:
        raise ValueError(text) from error
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def numbers(columns: Mapping[str, Sequence[str]], name: str, path: str | Path) -> Array:
    """Column `name` in SI; all not-a-number where the file has no such column."""
    if name not in columns:
        return np.full(len(next(iter(columns.values()))), np.nan)
    try:
        return np.array([from_text(cell, name) for cell in columns[name]])
    except ValueError as error:
        problem = f"column {name} holds {shown(str(error))}, which is no finite number"
        raise InputError("stiffness curve", str(path), problem, "write a number, or leave the cell empty") from None


#: Statuses that stand for a result; every other one marks a failed position, whose numbers are not-a-number.
SOLVED = ("converged", "no_contact")

#: Column that a table has where there are estimates.
ESTIMATE = "k_mesh_relative_error"
#: Column of the CSV file -> field, in order; a field of whole numbers has -1 where the file has ``nan``.
COLUMNS: dict[str, str] = {
    "pinion_angle_deg": "pinion_angle",
    "wheel_angle_deg": "wheel_angle",
    "twist_deg": "twist",
    "torque_wheel_Nm": "torque_wheel",
    "torque_pinion_Nm": "torque_pinion",
    "k_torsional_Nm_per_rad": "k_torsional",
    "k_mesh_N_per_m": "k_mesh",
    "transmission_error_um": "transmission_error",
    "teeth_in_contact": "teeth_in_contact",
    "peak_pressure_MPa": "peak_pressure",
    "iterations": "iterations",
    "status": "status",
    "k_tangent_N_per_m": "k_tangent",
    "transmission_error_unloaded_um": "transmission_error_unloaded",
    "torque_wheel_reaction_Nm": "torque_wheel_reaction",
    "leading_pair": "leading_pair",
    "law": "law",
    "peak_pressure_relative_error": "peak_pressure_error",
    "edge_pressure_MPa": "edge_pressure",
    "edge": "edge",
    "beyond_validity": "beyond_validity",
    ESTIMATE: "relative_error",
}
#: Constants of the curve, repeated on every row so that the file stands alone.
CONSTANTS: dict[str, str] = {
    "mesh_cycle_deg": "mesh_cycle",
    "wheel_base_radius_mm": "base_radius",
    "lost_motion_deg": "lost_motion",
}
#: Columns of words.
WORDS = ("status", "law", "edge")
#: Numbers that a curve need not have.
UNKNOWN = ("peak_pressure_error", "edge_pressure", "relative_error")
WHOLE = ("teeth_in_contact", "iterations", "beyond_validity")
SHARE = "load_share_"


#: Largest estimate of a curve's positions -> its worst error: 97 % of 78 curves of random pairs were within it (94 %
#: of them without it), as each covers 19 of 20 positions only.
OUTLIER = 2.0


@dataclass(frozen=True, repr=False)
class StiffnessCurve(ShownTable):
    """Mesh stiffness of a gear pair over the pinion's rotation; all arrays have one entry per position, shape (n,).

    Attributes
    ----------
    pinion_angle, wheel_angle
        Rotations (rad), counter-clockwise; at pinion angle 0 a pinion tooth stands on the line of centres.
    twist
        Twist of the wheel (rad) from where unmodified driving flanks touch: the deflection, negative where less than
        the lost motion was prescribed.
    torque_wheel, torque_pinion
        Moments that the hubs need (N m), energy-conjugate; positive when the driving flanks are pressed together.
    torque_wheel_reaction
        Moment of the bore reactions of the small-strain wheel (N m).
    k_torsional
        torque_wheel/twist (N m/rad); zero where nothing touches. Where deviations stand out of the flanks, the twist
        counts from their first touch in the mesh cycle here and in `k_mesh`.
    k_mesh, k_tangent
        torque_wheel/twist/r_b^2 and d torque_wheel/d twist/r_b^2, along the line of action (N/m).
    transmission_error, transmission_error_unloaded
        twist r_b under load, and r_b times the twist at which the rigid flanks just touch (m).
    leading_pair
        Number k of the pair that is farthest along the path of contact: it joins pinion tooth k and wheel tooth -1 - k,
        counted from the teeth at (pinion) or just below (wheel) the line of centres at angle 0. Without contact, nan.
    load_share : ndarray, shape (n, p)
        Share of the wheel's torque (-) that the pairs `leading_pair`, `leading_pair` - 1, ... carry.
    teeth_in_contact
        Tooth pairs that carry load; -1 where the position failed.
    peak_pressure, peak_pressure_error
        Largest Hertzian pressure of the tooth pairs that bear on smooth flanks (Pa), and how far the computed contacts
        are from Hertz's (-), see `gearfe.stiffness.contact_pressure`; not-a-number where none does.
    edge_pressure
        The like where an edge bears (Pa), blunted by a hundredth of a module; not-a-number where none bears.
    edge
        ``none``; ``rounded``: a tip round bears; ``singular``: a sharp edge bears, under which the pressure of linear
        elasticity has no bound. Empty where unknown.
    beyond_validity
        1 where the overlap of the flanks is beyond what the laws hold for (`gearfe.gear.validity`), else 0; -1 where
        unknown.
    iterations
        Newton iterations; -1 where unknown.
    status
        ``converged``, ``no_contact`` (the teeth do not reach each other, torques are zero), or what went wrong.
    law
        Name of the contact law; empty where unknown.
    mesh_cycle
        Pinion angle after which everything repeats, 2 pi/z1 (rad).
    base_radius
        r_b of the wheel (m).
    lost_motion
        Twist (rad) from the centred position, in which a wheel space faces a pinion tooth, to where `twist` counts
        from: half the backlash.
    contact_law
        Contact law with its parameters; empty where unknown.
    timings
        Seconds by stage; not in the CSV file.
    relative_error
        Estimated discretisation error of k_mesh (-), which covers the true one at about 19 of 20 positions, see
        `gearfe.stiffness.curve_error`; not-a-number where there is none.
    """

    pinion_angle: Array
    wheel_angle: Array
    twist: Array
    torque_wheel: Array
    torque_pinion: Array
    torque_wheel_reaction: Array
    k_torsional: Array
    k_mesh: Array
    k_tangent: Array
    transmission_error: Array
    transmission_error_unloaded: Array
    leading_pair: Array
    load_share: Array
    teeth_in_contact: IntArray
    peak_pressure: Array
    iterations: IntArray
    status: NDArray[np.str_]
    mesh_cycle: float
    base_radius: float
    lost_motion: float = 0.0
    contact_law: str = ""
    timings: Mapping[str, float] = field(default_factory=dict)
    law: NDArray[np.str_] = field(default_factory=lambda: np.array([], dtype=np.str_))
    peak_pressure_error: Array = field(default_factory=lambda: np.zeros(0))
    edge_pressure: Array = field(default_factory=lambda: np.zeros(0))
    edge: NDArray[np.str_] = field(default_factory=lambda: np.array([], dtype=np.str_))
    beyond_validity: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    relative_error: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        unknown = {"law": "", "edge": "", "beyond_validity": -1}
        for name, value in {**unknown, **dict.fromkeys(UNKNOWN, np.nan)}.items():
            if len(getattr(self, name)) != len(self.pinion_angle):
                object.__setattr__(self, name, np.full(len(self.pinion_angle), value))

    def __len__(self) -> int:
        return len(self.pinion_angle)

    @property
    def failed(self) -> BoolArray:
        """Positions without a solution."""
        return ~np.isin(self.status, SOLVED)

    @property
    def typical_error(self) -> float:
        """Median of the estimates (-); not-a-number where there are none."""
        known = self.relative_error[np.isfinite(self.relative_error)]
        return float(np.median(known)) if len(known) else math.nan

    @property
    def worst_error(self) -> float:
        """Estimated error of the position that errs most (-): `OUTLIER` times the largest; or not-a-number."""
        known = self.relative_error[np.isfinite(self.relative_error)]
        return OUTLIER * float(known.max()) if len(known) else math.nan

    def interpolant(self, quantity: str = "k_mesh", *, method: str = "cubic") -> PeriodicInterpolant:
        """Periodic interpolant of a quantity over the pinion angle; failed positions are left out.

        Parameters
        ----------
        quantity
            Name of any field of numbers.
        method
            ``cubic`` (monotone) or ``linear``.

        Raises
        ------
        InputError
            When the solved positions do not cover the mesh cycle.
        """
        per_position = [c for c in COLUMNS.values() if c not in (*WORDS, *WHOLE)]
        if quantity not in per_position:
            raise unknown_name("quantity", quantity, per_position)
        return periodic_interpolant(self.pinion_angle, getattr(self, quantity), self.mesh_cycle, method=method)

    def interpolate(self, phase: ArrayLike, quantity: str = "k_mesh", *, method: str = "cubic") -> ValueAndSlope:
        """Value and slope (per rad) of a quantity at any pinion angle (rad); see `interpolant`."""
        return self.interpolant(quantity, method=method)(phase)

    # ---- tables ------------------------------------------------------------------------------------------------------

    AXES = ("pinion_angle_deg",)

    def facts(self) -> dict[str, str]:
        """Positions, stiffness, transmission error and torque."""
        angle, solved = np.degrees(self.pinion_angle), ~self.failed
        counts = {"positions": f"{len(self)}, {solved.sum()} solved"}
        if not solved.any():
            return counts
        k, error, torque = 1e-6 * self.k_mesh, 1e6 * self.transmission_error, self.torque_wheel
        return counts | {
            "pinion angle": f"{angle.min():.4g} to {angle.max():.4g} deg",
            "mesh stiffness": f"{np.nanmin(k):.4g} to {np.nanmax(k):.4g} N/um, mean {np.nanmean(k):.4g}",
            "transmission error": f"{np.nanmean(error):.4g} um, peak to peak {np.ptp(error[solved]):.3g}",
            "torque at the wheel": f"{np.nanmin(torque):.4g} to {np.nanmax(torque):.4g} N m",
            "law": self.contact_law,
        }

    def columns(self) -> dict[str, list[str]]:
        """Columns of the CSV file as text."""
        columns = {name: self._cells(name, attribute) for name, attribute in COLUMNS.items()}
        if math.isnan(self.worst_error):
            del columns[ESTIMATE]
        for j in range(self.load_share.shape[1]):
            columns[f"{SHARE}{j + 1}"] = [to_text(v, SHARE) for v in self.load_share[:, j]]
        for name, attribute in CONSTANTS.items():
            columns[name] = [to_text(getattr(self, attribute), name)] * len(self)
        columns["contact_law"] = [self.contact_law] * len(self)
        return columns

    def _cells(self, name: str, attribute: str) -> list[str]:
        values = getattr(self, attribute)
        if attribute in WORDS:
            return [str(v) for v in values]
        if attribute in WHOLE:
            return [str(int(v)) if v >= 0 else "nan" for v in values]
        return [to_text(v, name) for v in values]

    def to_csv(self, path: str | Path) -> None:
        """Write the table; `from_csv` gives back every number exactly."""
        write_csv(path, self.columns())

    @classmethod
    def from_csv(
        cls, path: str | Path, *, mesh_cycle: float | None = None, base_radius: float | None = None
    ) -> StiffnessCurve:
        """Read a curve that `to_csv` wrote, or any CSV file with ``pinion_angle_deg`` and ``k_mesh_N_per_m``.

        Parameters
        ----------
        mesh_cycle, base_radius
            Mesh cycle (rad) and base radius of the wheel (m) for files that do not hold them; they win over the file's.

        Raises
        ------
        InputError
            When the file is not such a table, or says nothing of the mesh cycle.
        """
        return cls.from_columns(read_csv(path, "stiffness curve"), path, mesh_cycle=mesh_cycle, base_radius=base_radius)

    @classmethod
    def from_columns(
        cls,
        columns: Mapping[str, Sequence[str]],
        path: str | Path,
        *,
        mesh_cycle: float | None = None,
        base_radius: float | None = None,
    ) -> StiffnessCurve:
        """The curve that a table's columns hold as text; `path` is named in messages, see `from_csv`."""
        for needed in ("pinion_angle_deg", "k_mesh_N_per_m"):
            if needed not in columns:
                raise InputError("stiffness curve", str(path), f"has no column {needed}", "add it")
        given: dict[str, Any] = {"mesh_cycle": mesh_cycle, "base_radius": base_radius, "lost_motion": None}
        values: dict[str, Any] = {}
        for name, attribute in CONSTANTS.items():
            stored = float(numbers(columns, name, path)[0])
            values[attribute] = stored if given[attribute] is None else float(given[attribute])
        if not (np.isfinite(values["mesh_cycle"]) and values["mesh_cycle"] > 0):
            cure = "add a column mesh_cycle_deg (360 deg/pinion teeth), or give mesh_cycle"
            raise InputError("stiffness curve", str(path), "does not tell the mesh cycle", cure)
        values["lost_motion"] = np.nan_to_num(values["lost_motion"])
        rows = len(columns["k_mesh_N_per_m"])
        for name, attribute in COLUMNS.items():
            if attribute in WORDS:
                values[attribute] = np.array([cell.strip() for cell in columns.get(name, [""] * rows)])
                continue
            found = numbers(columns, name, path)
            values[attribute] = np.nan_to_num(found, nan=-1).astype(np.int64) if attribute in WHOLE else found
        shares = [numbers(columns, name, path) for name in columns if name.startswith(SHARE)]
        values["load_share"] = np.stack(shares, axis=1) if shares else np.zeros((rows, 0))
        values["contact_law"] = columns.get("contact_law", [""])[0].strip()
        if "status" not in columns:
            values["status"] = np.where(np.isfinite(values["k_mesh"]), "converged", "missing")
        return cls(**values)
