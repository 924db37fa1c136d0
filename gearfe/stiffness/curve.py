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
from contextlib import suppress
from dataclasses import dataclass, field, fields
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


def _factor(column: str) -> Decimal:
    """Factor from SI to the unit in a column's name."""
    return next((f for suffix, f in _FACTORS.items() if column.endswith(suffix)), Decimal(1))


def to_text(value: float, column: str) -> str:
    """Decimal text of an SI value in the column's unit: `from_text` gives the same double back."""
    if not np.isfinite(value):
        return "nan"
    exact = _EXACT.multiply(Decimal(float(value)), _factor(column))
    short = f"{float(exact):.15g}"  # where 15 digits are enough: 0.5 reads 0.5
    return short if from_text(short, column) == value else f"{exact:.17g}"


def from_text(text: str, column: str) -> float:
    """SI value of a cell, an `ArithmeticError` where it holds no number; an empty cell is not a number."""
    return float(_EXACT.divide(Decimal(text.strip() or "nan"), _factor(column)))


def numbers(columns: Mapping[str, Sequence[str]], name: str, path: str | Path) -> Array:
    """Column `name` in SI; all not-a-number where the file has no such column."""
    made = np.full(len(next(iter(columns.values()))), np.nan)
    for row, cell in enumerate(columns.get(name, ())):
        with suppress(ArithmeticError):
            made[row] = from_text(cell, name)
            if not math.isinf(made[row]):
                continue
        problem = f"column {name} holds {shown(cell.strip())}, which is no finite number"
        raise InputError("stiffness curve", str(path), problem, "write a number, or leave the cell empty")
    return made


#: Statuses that stand for a result; every other one marks a failed position, whose numbers are not-a-number.
SOLVED = ("converged", "no_contact")

#: Column that a table has where there are estimates, and those of the pairs' shares.
ESTIMATE, SHARE = "k_mesh_relative_error", "load_share_"


def _column(name: str, unknown: float | str = math.nan) -> Any:
    """Field with an entry for each position, of numbers, whole numbers or words as `unknown` is, and its column."""
    return field(default=(), metadata={"column": name, "unknown": unknown})


def _constant(name: str, unknown: float | str = math.nan) -> Any:
    """Field of the whole curve; its column repeats it on every row, so that the file stands alone."""
    return field(default=unknown, metadata={"constant": name, "unknown": unknown})


#: Largest estimate of a curve's positions -> its worst error: 97 % of 78 curves of random pairs were within it (94 %
#: of them without it), as each covers 19 of 20 positions only.
OUTLIER = 2.0


@dataclass(frozen=True, repr=False, kw_only=True)
class StiffnessCurve(ShownTable):
    """Mesh stiffness of a gear pair over the pinion's rotation; all arrays have one entry per position, shape (n,).

    What is not given is unknown: not-a-number, -1 or an empty word.

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

    pinion_angle: Array = _column("pinion_angle_deg")
    wheel_angle: Array = _column("wheel_angle_deg")
    twist: Array = _column("twist_deg")
    torque_wheel: Array = _column("torque_wheel_Nm")
    torque_pinion: Array = _column("torque_pinion_Nm")
    k_torsional: Array = _column("k_torsional_Nm_per_rad")
    k_mesh: Array = _column("k_mesh_N_per_m")
    transmission_error: Array = _column("transmission_error_um")
    teeth_in_contact: IntArray = _column("teeth_in_contact", -1)
    peak_pressure: Array = _column("peak_pressure_MPa")
    iterations: IntArray = _column("iterations", -1)
    status: NDArray[np.str_] = _column("status", "")
    k_tangent: Array = _column("k_tangent_N_per_m")
    transmission_error_unloaded: Array = _column("transmission_error_unloaded_um")
    torque_wheel_reaction: Array = _column("torque_wheel_reaction_Nm")
    leading_pair: Array = _column("leading_pair")
    law: NDArray[np.str_] = _column("law", "")
    peak_pressure_error: Array = _column("peak_pressure_relative_error")
    edge_pressure: Array = _column("edge_pressure_MPa")
    edge: NDArray[np.str_] = _column("edge", "")
    beyond_validity: IntArray = _column("beyond_validity", -1)
    relative_error: Array = _column(ESTIMATE)
    load_share: Array = field(default_factory=lambda: np.zeros((0, 0)))
    mesh_cycle: float = _constant("mesh_cycle_deg")
    base_radius: float = _constant("wheel_base_radius_mm")
    lost_motion: float = _constant("lost_motion_deg", 0.0)
    contact_law: str = _constant("contact_law", "")
    timings: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for own, (_, unknown) in COLUMNS.items():
            if len(getattr(self, own)) != len(self):
                object.__setattr__(self, own, np.full(len(self), unknown))

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
        per_position = [own for own, (_, unknown) in COLUMNS.items() if isinstance(unknown, float)]
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
        columns = {name: _cells(getattr(self, own), name) for own, (name, _) in COLUMNS.items()}
        if math.isnan(self.worst_error):
            del columns[ESTIMATE]
        for j in range(self.load_share.shape[1]):
            columns[f"{SHARE}{j + 1}"] = _cells(self.load_share[:, j], SHARE)
        for own, (name, _) in CONSTANTS.items():
            columns[name] = _cells([getattr(self, own)], name) * len(self)
        return columns

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
        given = {"mesh_cycle": mesh_cycle, "base_radius": base_radius}
        values: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        for own, (name, unknown) in CONSTANTS.items():
            if name in columns:
                values.setdefault(own, _values(columns, name, unknown, path)[0])
        if not (math.isfinite(values.get("mesh_cycle", math.nan)) and values["mesh_cycle"] > 0):
            cure = "add a column mesh_cycle_deg (360 deg/pinion teeth), or give mesh_cycle"
            raise InputError("stiffness curve", str(path), "does not tell the mesh cycle", cure)
        for own, (name, unknown) in COLUMNS.items():
            if name in columns:
                values[own] = _values(columns, name, unknown, path)
        values.setdefault("status", np.where(np.isfinite(values["k_mesh"]), "converged", "missing"))
        shares = [numbers(columns, name, path) for name in columns if name.startswith(SHARE)]
        values["load_share"] = np.stack(shares, axis=1) if shares else np.zeros((len(values["k_mesh"]), 0))
        return cls(**values)


def _marked(kind: str) -> dict[str, tuple[str, Any]]:
    """Field -> its column and what stands for unknown, in the order of the table."""
    found = {own.name: own.metadata for own in fields(StiffnessCurve)}
    return {own: (data[kind], data["unknown"]) for own, data in found.items() if kind in data}


COLUMNS, CONSTANTS = _marked("column"), _marked("constant")


def _cells(values: Any, name: str) -> list[str]:
    """Text of the values of a column; whole numbers below 0 are unknown."""
    values = np.asarray(values)
    if values.dtype.kind == "U":
        return [str(v) for v in values]
    if values.dtype.kind == "i":
        return [str(v) if v >= 0 else "nan" for v in values]
    return [to_text(v, name) for v in values]


def _values(columns: Mapping[str, Sequence[str]], name: str, unknown: Any, path: str | Path) -> Any:
    """Values of a column in SI, of the type of `unknown`."""
    if isinstance(unknown, str):
        return np.array([cell.strip() for cell in columns[name]])
    found = numbers(columns, name, path)
    made = np.where(np.isnan(found), unknown, found)
    return made.astype(np.int64) if isinstance(unknown, int) else made
