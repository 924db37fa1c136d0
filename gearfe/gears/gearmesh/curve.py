r"""The mesh-stiffness curve of a gear pair: plain arrays, periodic interpolation, CSV in and out. SI units.

With the twist :math:`\vartheta` of the wheel, its hub torque T and its base radius :math:`r_b` (the reference one,
d cos(alpha)/2),

.. math::
    k_\mathrm{torsional} = T/\vartheta, \quad k_\mathrm{mesh} = T/(\vartheta r_b^2), \quad
    k_\mathrm{tangent} = (dT/d\vartheta)/r_b^2, \quad \mathrm{TE} = \vartheta r_b .

Tables hold units of their columns' names, to 15 digits: a table read and written again is the same text.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import InputError, shown, unknown_name
from ...base.files import read_csv, write_csv
from ...base.shown import ShownTable
from ...base.typing import Array, BoolArray, IntArray
from .periodic import AGREEING, PeriodicInterpolant, ValueAndSlope, check_repeats, periodic_interpolant

#: Suffix of a column name -> factor from SI to that unit; other columns are in SI.
_FACTORS = {"_deg": 180.0 / math.pi, "_um": 1e6, "_mm": 1e3, "_MPa": 1e-6}


def _factor(column: str) -> float:
    """Factor from SI to the unit in a column's name."""
    return next((factor for suffix, factor in _FACTORS.items() if column.endswith(suffix)), 1.0)


def as_text(values: ArrayLike, column: str) -> list[str]:
    """SI values as the cells of a column, in its unit to 15 digits; whole numbers below 0 are unknown."""
    values = np.asarray(values)
    if values.dtype.kind == "U":
        return [str(v) for v in values]
    if values.dtype.kind == "i":
        return [str(v) if v >= 0 else "nan" for v in values]
    return [f"{v:.15g}" if math.isfinite(v) else "nan" for v in (values * _factor(column)).tolist()]


def numbers(columns: Mapping[str, Sequence[str]], name: str, path: str | Path) -> Array:
    """Column `name` in SI; NaN where a cell is empty, or the file has no such column."""
    made, factor = np.full(len(next(iter(columns.values()))), np.nan), _factor(name)
    for row, cell in enumerate(columns.get(name, ())):
        with suppress(ValueError):
            made[row] = float(cell.strip() or "nan") / factor
            if not math.isinf(made[row]):
                continue
        problem = f"column {name} holds {shown(cell.strip())}, which is no finite number"
        raise InputError("stiffness curve", str(path), problem, "write a number, or leave the cell empty")
    return made


#: Statuses that stand for a result; every other one marks a failed position, whose numbers are NaN.
SOLVED = ("converged", "no_contact")
#: Status of a cell whose back flanks would be loaded, too: gears that jam.
BACK = "back_flanks_bear"

#: What bears besides smooth flanks: nothing; a rounded tip edge; a sharp edge, under which the pressure of linear
#: elasticity is singular. Then the places of the last two.
EDGES = ("none", "rounded", "singular")
ROUNDED, SINGULAR = 1, 2

#: Largest whole number up to which all are doubles (-): IEEE 754.
LARGEST_COUNT = 2.0**53
#: Constants of a table differ by no more than rounding to 12 digits (-).
SAME = 1e-11
#: Problem of a table without a mesh cycle.
NO_CYCLE = "does not say what its mesh cycle is"

#: Columns that a table has where there are estimates, and those of the pairs' shares.
ESTIMATE, CORRECTION, SHARE = "k_mesh_relative_error", "k_mesh_relative_correction", "load_share_"


class Column(NamedTuple):
    """Column of a field, and what stands where nothing is known; one of a `constant` repeats it on every row."""

    name: str
    unknown: float | str
    constant: bool


def _column(name: str, unknown: float | str = math.nan, *, constant: bool = False) -> Any:
    """Field of numbers, whole numbers or words as `unknown` is: for each position, or one constant of the curve."""
    return field(default=unknown if constant else (), metadata={"column": Column(name, unknown, constant)})


#: Largest estimate of a curve's positions -> its worst error: 97 % of 78 curves of random pairs were within it (94 %
#: of them without it), as each covers 19 of 20 positions only.
OUTLIER = 2.0


@dataclass(frozen=True, repr=False, kw_only=True)
class StiffnessCurve(ShownTable):
    """Mesh stiffness of a gear pair over the pinion's rotation; all arrays have one entry per position, shape (n,).

    Entries that are not given are NaN, -1 or an empty string. An array of another length is an `InputError`.

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
        counts from their first contact in the mesh cycle here and in `k_mesh`.
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
        are from Hertz's (-), see `gearfe.gears.gearmesh.pair_loads`; NaN where none does.
    edge_pressure
        Comparative pressure at a loaded edge (Pa), with the edge rounded by a hundredth of a module; NaN where no edge
        is loaded.
    edge
        ``none``; ``rounded``: a tip round bears; ``singular``: a sharp edge bears, under which the pressure of linear
        elasticity has no bound. Empty where unknown.
    beyond_validity
        1 where the overlap of the flanks is beyond what the laws hold for (`gears.geometry.validity`), else 0; -1 where
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
        `gearfe.gears.gearmesh.positions`; NaN where there is none.
    correction
        Signed relative change of k_mesh by Richardson's extrapolation (-), for the error of differences; NaN where
        there is none.
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
    correction: Array = _column(CORRECTION)
    load_share: Array = field(default_factory=lambda: np.zeros((0, 0)))
    mesh_cycle: float = _column("mesh_cycle_deg", constant=True)
    base_radius: float = _column("wheel_base_radius_mm", constant=True)
    lost_motion: float = _column("lost_motion_deg", 0.0, constant=True)
    contact_law: str = _column("contact_law", "", constant=True)
    timings: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        each = [own for own, column in COLUMNS.items() if not column.constant]
        for own in (*each, "load_share"):
            given = len(getattr(self, own))
            if given not in (0, len(self)):
                cure = "give one for each, or leave it out: it is unknown then"
                raise InputError(own, None, f"has {given} entries, the curve {len(self)} positions", cure)
            if given < len(self) and own in COLUMNS:
                object.__setattr__(self, own, np.full(len(self), COLUMNS[own].unknown))

    def __len__(self) -> int:
        return len(self.pinion_angle)

    @property
    def failed(self) -> BoolArray:
        """Positions without a solution."""
        return ~np.isin(self.status, SOLVED)

    @property
    def statuses(self) -> dict[str, int]:
        """How many positions have which status."""
        return dict(Counter(map(str, self.status)))

    def take(self, chosen: slice | IntArray) -> StiffnessCurve:
        """Return the curve of the positions `chosen`."""
        each = [name for name, column in COLUMNS.items() if not column.constant]
        return replace(self, timings={}, **{name: getattr(self, name)[chosen] for name in (*each, "load_share")})

    @property
    def typical_error(self) -> float:
        """Median of the estimates (-); NaN where there are none."""
        known = self.relative_error[np.isfinite(self.relative_error)]
        return float(np.median(known)) if len(known) else math.nan

    @property
    def worst_error(self) -> float:
        """Estimated error of the position that errs most (-): `OUTLIER` times the largest; or NaN."""
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
        known = [own for own, column in COLUMNS.items() if isinstance(column.unknown, float) and not column.constant]
        if quantity not in known:
            raise unknown_name("quantity", quantity, known)
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
        own = {column: getattr(self, name) for name, column in COLUMNS.items()}
        each = {column.name: values for column, values in own.items() if not column.constant}
        for name in (ESTIMATE, CORRECTION):
            if not np.isfinite(each[name]).any():
                del each[name]
        shares = {f"{SHARE}{j + 1}": share for j, share in enumerate(self.load_share.T)}
        whole = {column.name: np.full(len(self), value) for column, value in own.items() if column.constant}
        return {name: as_text(values, name) for name, values in (each | shares | whole).items()}

    def to_csv(self, path: str | Path) -> None:
        """Write the table; `from_csv` gives back every number to 15 digits."""
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
            If the file is no such table, the mesh cycle is unknown, or values one mesh cycle apart differ.
        """
        columns = read_csv(path, "stiffness curve")
        curve = cls.from_columns(columns, path, mesh_cycle=mesh_cycle, base_radius=base_radius)
        curve.check(str(path))
        return curve

    @classmethod
    def from_columns(
        cls, columns: Mapping[str, Sequence[str]], path: str | Path, **constants: float | None
    ) -> StiffnessCurve:
        """Return the positions that a table's columns hold as text, at one load or several, unchecked."""
        for needed in ("pinion_angle_deg", "k_mesh_N_per_m"):
            if needed not in columns:
                raise InputError("stiffness curve", str(path), f"has no column {needed}", "add it")
        values: dict[str, Any] = {own: value for own, value in constants.items() if value is not None}
        for own, column in COLUMNS.items():
            if column.name in columns and own not in values:
                found = _values(columns, column, path)
                values[own] = _constant(found, column.name, path) if column.constant else found
        cycle = values.get("mesh_cycle", math.nan)
        cure = "add a column mesh_cycle_deg (360 deg/pinion teeth), or give mesh_cycle"
        if math.isnan(cycle):
            raise InputError("stiffness curve", str(path), NO_CYCLE, cure)
        if not 0.0 < cycle < math.inf:
            problem = f"has a mesh cycle of {math.degrees(cycle):.9g} deg, which must be finite and > 0"
            raise InputError("stiffness curve", str(path), problem, "write 360 deg/pinion teeth")
        status = values.get("status", np.full(len(values["k_mesh"]), ""))
        values["status"] = np.where(
            status == "", np.where(np.isfinite(values["k_mesh"]), "converged", "missing"), status
        )
        shares = [numbers(columns, name, path) for name in columns if name.startswith(SHARE)]
        values["load_share"] = np.stack(shares, axis=1) if shares else np.zeros((len(values["k_mesh"]), 0))
        return cls(**values)

    def check(self, path: str) -> None:
        """Raise `InputError`, which names `path`, where the columns contradict each other."""
        self._check_ratio(path)
        self._check_columns(path)
        check_repeats(self.pinion_angle, self.k_mesh, self.mesh_cycle, path)

    def _check_ratio(self, path: str) -> None:
        """Raise `InputError` where k_torsional and k_mesh do not differ by the factor r_b^2 of the wheel."""
        rows = np.flatnonzero(np.isfinite(self.k_torsional) & (self.k_mesh > 0.0))
        if not len(rows):
            return
        squares = self.k_torsional[rows] / self.k_mesh[rows]
        right = self.base_radius**2 if math.isfinite(self.base_radius) else float(np.median(squares))
        off = np.abs(squares / right - 1.0) if right > 0.0 else np.full(len(rows), np.inf)
        worst = int(off.argmax())
        if off[worst] > AGREEING:
            row = rows[worst]
            problem = (
                f"contradicts itself: row {row + 1} has k_torsional {self.k_torsional[row]:.6g} N m/rad and k_mesh "
                f"{self.k_mesh[row]:.6g} N/m, whose ratio is the squared base radius of the wheel, {right:.6g} m2"
            )
            raise InputError("stiffness curve", path, problem, "correct one of the columns, or leave one out")

    def _check_columns(self, path: str) -> None:
        """Raise `InputError` where a column contradicts another one by its definition."""
        arc = self.twist * self.base_radius
        total = np.nansum(self.load_share, axis=1)
        loaded = np.isfinite(self.load_share).any(axis=1) & (total != 0.0)  # without contact all shares are 0
        largest = np.abs(arc[np.isfinite(arc)]).max(initial=0.0)
        checks = (
            (
                self.failed & np.isfinite(self.k_mesh),
                "has a stiffness and the status {status!r} of a position that failed",
                "leave the cell of k_mesh_N_per_m empty, or write the status converged",
            ),
            (
                np.abs(self.transmission_error - arc) > AGREEING * largest,
                "has transmission_error {error:.6g} um, but twist times wheel_base_radius_mm is {arc:.6g} um",
                "correct one of the columns, or leave one out",
            ),
            (
                loaded & (np.abs(total - 1.0) > AGREEING),
                "has load shares that add up to {total:.6g}, not to 1",
                "write the share of each tooth pair, or leave these columns out",
            ),
        )
        for wrong, text, cure in checks:
            if wrong.any():
                row = int(wrong.argmax())
                said = text.format(
                    status=str(self.status[row]),
                    error=1e6 * self.transmission_error[row],
                    arc=1e6 * arc[row],
                    total=total[row],
                )
                problem = f"contradicts itself: row {row + 1} {said}"
                raise InputError("stiffness curve", path, problem, cure)


#: Field -> its column, in the order of the table, without the shares.
COLUMNS: dict[str, Column] = {own.name: own.metadata["column"] for own in fields(StiffnessCurve) if own.metadata}


def _constant(values: Array, name: str, path: str | Path) -> Any:
    """The value that all rows of a column of a constant have; rows without one say nothing."""
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values[values != ""]
    if not len(known):
        return values[0]
    other = known != known[0] if values.dtype.kind == "U" else np.abs(known - known[0]) > SAME * np.abs(known[0])
    if other.any():
        said = as_text(np.array([known[0], known[int(other.argmax())]]), name)
        problem = f"column {name} holds {said[0]} and {said[1]}, but the whole curve has one value"
        raise InputError("stiffness curve", str(path), problem, "write one value on all rows, or split the table")
    return known[0]


def _values(columns: Mapping[str, Sequence[str]], column: Column, path: str | Path) -> Any:
    """Values of a column in SI, of the type of what is unknown."""
    if isinstance(column.unknown, str):
        return np.array([cell.strip() for cell in columns[column.name]])
    found = numbers(columns, column.name, path)
    values = np.where(np.isnan(found), column.unknown, found)
    if isinstance(column.unknown, int):
        other = (values != np.floor(values)) | (np.abs(values) > LARGEST_COUNT)
        if other.any():
            problem = f"column {column.name} holds {values[int(other.argmax())]:g}, which is no whole number below 2^53"
            raise InputError("stiffness curve", str(path), problem, "write a whole number, or leave the cell empty")
    return values.astype(type(column.unknown))
