r"""Stiffness, transmission error, load share, peak pressure and root stress over pinion angle and torque. SI units.

A map holds one stiffness curve for each of its torques, all at the same angles. A curve at a torque between two of them
comes from the twist :math:`\vartheta(T)` at each angle: with :math:`\delta = \vartheta - \vartheta_0` counted from
where the rigid flanks touch,

.. math::
    y = \ln\delta, \quad x = \ln T, \qquad \frac{dy}{dx} = \frac{T}{\delta\, dT/d\vartheta},

a cubic Hermite interpolant with the computed tangents as slopes. A line contact makes y(x) nearly straight; where a
further pair of teeth comes into contact it bends. `LoadMap.interpolation_error` is the leave-one-out error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.position import ANGLE_ROUNDING
from ..errors import InputError
from ..gear.deviation_job import GEARS
from ..output.files import write_csv
from ..shown import ShownTable
from ..stiffness.curve import COLUMNS, WHOLE, StiffnessCurve, numbers, to_text
from ..textfile import read_csv
from ..typing import Array, BoolArray

#: Column of the torque that a row belongs to.
TORQUE = "torque_Nm"
#: A curve between the torques is refused when the map predicts its own curves worse than this (relative twist). The
#: miss between the torques is a quarter of that or less: the gap is half as wide there.
TOLERANCE = 1e-2


@dataclass(frozen=True)
class RootMap:
    """Root stress over torque and angle; the third axis is the gear (pinion, wheel).

    Attributes
    ----------
    stress : ndarray, shape (m, n, 2, p)
        Largest tension along the loaded side's fillet of the teeth of pairs `leading_pair`, `leading_pair` - 1, ...
        (Pa); not-a-number where the pair carries nothing.
    diameter : ndarray, shape (m, n, 2)
        Where the largest one of them acts (m).
    error : ndarray, shape (m, n, 2)
        Its estimated relative error (-), see `gearfe.loadmap.root_stress`.
    """

    stress: Array
    diameter: Array
    error: Array

    @property
    def largest(self) -> Array:
        """Largest root stress of each gear over its loaded teeth, shape (m, n, 2) (Pa)."""
        known = np.where(np.isfinite(self.stress), self.stress, -np.inf).max(axis=3)
        return np.where(np.isfinite(known), known, np.nan)


def root_columns(root: RootMap) -> dict[str, Array]:
    """Columns of the root stresses, each of shape (m, n)."""
    columns: dict[str, Array] = {}
    for g, gear in enumerate(GEARS):
        columns[f"root_stress_{gear}_MPa"] = root.largest[:, :, g]
        columns[f"root_diameter_{gear}_mm"] = root.diameter[:, :, g]
        columns[f"root_stress_error_{gear}"] = root.error[:, :, g]
    for g, gear in enumerate(GEARS):
        for j in range(root.stress.shape[3]):
            columns[f"root_stress_{gear}_{j + 1}_MPa"] = root.stress[:, :, g, j]
    return columns


def root_of(columns: Mapping[str, Sequence[str]], shape: tuple[int, int], path: str | Path) -> RootMap | None:
    """The root stresses that a table holds as text, or None; `shape` is (m, n), `path` is named in messages."""
    if f"root_stress_{GEARS[0]}_MPa" not in columns:
        return None

    def read(name: str) -> Array:
        return np.stack([numbers(columns, name.format(g), path).reshape(shape) for g in GEARS], axis=2)

    count = 0
    while f"root_stress_{GEARS[0]}_{count + 1}_MPa" in columns:
        count += 1
    parts = [read(f"root_stress_{{}}_{j + 1}_MPa") for j in range(count)]
    return RootMap(np.stack(parts, axis=3), read("root_diameter_{}_mm"), read("root_stress_error_{}"))


@dataclass(frozen=True, repr=False)
class LoadMap(ShownTable):
    """A gear pair's behaviour over torque and angle.

    Attributes
    ----------
    torque : ndarray, shape (m,)
        Torques at the wheel's hub, rising (N m).
    curves
        The curve of each torque; all have the same angles, shape (n,).
    root
        Root stresses, where they were computed.
    timings
        Seconds by stage; not in the CSV file.
    """

    torque: Array
    curves: tuple[StiffnessCurve, ...]
    root: RootMap | None = None
    timings: Mapping[str, float] = field(default_factory=dict)

    @property
    def pinion_angle(self) -> Array:
        """Pinion angles, shape (n,) (rad)."""
        return self.curves[0].pinion_angle

    @property
    def mesh_cycle(self) -> float:
        """Pinion angle after which everything repeats (rad)."""
        return self.curves[0].mesh_cycle

    @property
    def status(self) -> NDArray[np.str_]:
        """Status of each cell, shape (m, n)."""
        return self.quantity("status")

    @property
    def failed(self) -> BoolArray:
        """Cells without a solution, shape (m, n)."""
        return np.stack([curve.failed for curve in self.curves])

    def quantity(self, name: str) -> Any:
        """A field of `StiffnessCurve` over torque and angle, shape (m, n)."""
        return np.stack([getattr(curve, name) for curve in self.curves])

    @property
    def peak_to_peak(self) -> Array:
        """Peak-to-peak transmission error of each torque, shape (m,) (m); not-a-number where a position failed."""
        return np.ptp(self.quantity("transmission_error"), axis=1)

    # ---- between the torques -----------------------------------------------------------------------------------------

    def interpolation_error(self) -> Array:
        """How far the map misses its own twists when one torque is left out, shape (m,), relative.

        The largest over the angles; not-a-number at the ends and where too little is solved. The error of a curve
        halfway between two torques is smaller: the gap is half as wide there.
        """
        missed = np.full(len(self.torque), np.nan)
        touching = self._touching
        for i in range(1, len(self.torque) - 1):
            without = [i - 1, i + 1]
            guess = _twist_between(self.torque[i], self.torque[without], *self._delta(without, touching))
            relative = np.abs(guess / (self.curves[i].twist - touching) - 1)
            if np.isfinite(relative).any():
                missed[i] = np.nanmax(relative)
        return missed

    def curve_at(self, torque: float, *, tolerance: float = TOLERANCE) -> StiffnessCurve:
        """The curve at any torque (N m) inside the map; failed cells beside it leave their positions failed.

        Parameters
        ----------
        tolerance
            Largest `interpolation_error` (-) of the neighbouring torques that is accepted.

        Raises
        ------
        InputError
            Outside the map, or when the torques are too far apart to know the curve between them.
        """
        known = self.torque
        if not (np.isfinite(torque) and known[0] * (1 - 1e-9) <= torque <= known[-1] * (1 + 1e-9)):
            problem = f"lies outside the load map, {known[0]:.6g} to {known[-1]:.6g} N m"
            raise InputError("torque", torque, problem, "choose a torque inside, or make a map with a wider range")
        nearest = int(np.argmin(np.abs(known - torque)))
        if abs(known[nearest] - torque) <= 1e-9 * torque:
            return self.curves[nearest]
        after = int(np.searchsorted(known, torque))
        missed = self.interpolation_error()[[after - 1, after]]
        worst = float(np.nanmax(missed)) if np.isfinite(missed).any() else float("inf")
        if not worst <= tolerance:
            problem = f"the map's torques are too far apart there: left out, one is missed by {100 * worst:.2g} %"
            if not np.isfinite(worst):
                problem = "the map has too few solved torques to know how well it interpolates"
            raise InputError("torque", torque, problem, "make a map with more torques (20 are usual)")
        return self._between(torque, after)

    @property
    def _touching(self) -> Array:
        """Twist, shape (n,), at which the rigid flanks touch, counted as `StiffnessCurve.twist` is (rad)."""
        return np.asarray(self.curves[0].transmission_error_unloaded / self.curves[0].base_radius)

    def _delta(self, rows: Sequence[int], touching: Array) -> tuple[Array, Array]:
        """Twists beyond touching (rad), and tangents (N m/rad), shape (rows, n)."""
        chosen = [self.curves[i] for i in rows]
        return np.stack([c.twist - touching for c in chosen]), np.stack(
            [c.k_tangent * c.base_radius**2 for c in chosen]
        )

    def _between(self, torque: float, after: int) -> StiffnessCurve:
        from scipy.interpolate import PchipInterpolator

        pair = [after - 1, after]
        touching = self._touching
        twist = touching + _twist_between(torque, self.torque[pair], *self._delta(pair, touching))
        bad = self.failed[pair]
        status = np.where(bad[1], self.status[after], self.status[after - 1])
        lost: BoolArray = np.any(bad, axis=0)
        twist = np.where(lost, np.nan, twist)
        x = np.log(self.torque)

        def along(values: Array) -> Array:
            """Monotone cubic over ln T, column by column, from the solved cells."""
            flat = values.reshape(len(x), -1)
            made = np.full(flat.shape[1], np.nan)
            for j in range(flat.shape[1]):
                known = np.isfinite(flat[:, j])
                if known.sum() >= 2:
                    made[j] = PchipInterpolator(x[known], flat[known, j], extrapolate=False)(np.log(torque))
            return made.reshape(values.shape[1:])

        first, radius = self.curves[after - 1], self.curves[0].base_radius
        counted = (first.twist - first.torque_wheel / first.k_torsional)[~first.failed]  # where stiffness counts from
        start = float(np.median(counted)) if len(counted) else 0.0
        deflection = twist - (start if abs(start) > ANGLE_ROUNDING else 0.0)
        leading, shares = self._shares_between(pair, along)
        values = {name: along(self.quantity(name) / self.torque[:, None]) * torque for name in _PER_TORQUE}
        smooth = {name: np.exp(along(np.log(self.quantity(name)))) for name in _POWER_LAWS}
        # a pressure is known between torques that know it
        for name in ("peak_pressure", "edge_pressure"):
            smooth[name][~np.isfinite(self.quantity(name)[pair]).all(axis=0)] = np.nan
        made: dict[str, Any] = {name: np.where(lost, np.nan, v) for name, v in {**values, **smooth}.items()}
        return replace(
            first,
            wheel_angle=first.wheel_angle + (twist - first.twist),
            twist=twist,
            torque_wheel=np.where(lost, np.nan, torque),
            k_torsional=torque / deflection,
            k_mesh=torque / deflection / radius**2,
            transmission_error=twist * radius,
            leading_pair=np.where(lost, np.nan, leading),
            load_share=np.where(lost[:, None], np.nan, shares),
            teeth_in_contact=np.where(lost, -1, (shares > 0).sum(axis=1)),
            iterations=np.full(len(twist), -1),
            status=status,
            peak_pressure_error=self.quantity("peak_pressure_error")[pair].max(axis=0),
            edge=np.where(np.isfinite(smooth["edge_pressure"]), self.quantity("edge")[after], "none"),
            relative_error=np.zeros(0),
            timings={},
            **made,
        )

    def _shares_between(self, pair: Sequence[int], along: Any) -> tuple[Array, Array]:
        """Leading pair, shape (n,), and shares, shape (n, p), interpolated pair by pair."""
        leading = self.quantity("leading_pair")
        front = np.nanmax(np.where(np.isfinite(leading), leading, -np.inf)[pair], axis=0)
        most = max(c.load_share.shape[1] for c in self.curves) + 1
        every = np.zeros((*leading.shape, most))
        for i, curve in enumerate(self.curves):
            for j in range(curve.load_share.shape[1]):
                column = front - (curve.leading_pair - j)
                inside = np.isfinite(column) & (column >= 0) & (column < most)
                every[i, np.flatnonzero(inside), column[inside].astype(int)] = curve.load_share[inside, j]
        every[self.failed] = np.nan
        # a pair that carries nothing at both neighbours carries nothing between them either
        carries = (every[pair] > 0).any(axis=0)
        shares = np.where(carries, along(every), 0.0)
        total = shares.sum(axis=1, keepdims=True)
        shares = shares / np.where(total > 0, total, 1.0)
        used = max(1, int(np.max(np.flatnonzero((shares > 0).any(axis=0)), initial=0)) + 1)
        return front, shares[:, :used]

    # ---- tables ------------------------------------------------------------------------------------------------------

    AXES = (TORQUE, "pinion_angle_deg")

    def facts(self) -> dict[str, str]:
        """Torques, angles, stiffness and transmission error."""
        k, error = 1e-6 * self.quantity("k_mesh").mean(axis=1), 1e6 * self.peak_to_peak
        return {
            "torques": f"{len(self.torque)}, {self.torque[0]:.4g} to {self.torque[-1]:.4g} N m at the wheel",
            "pinion angles": f"{len(self.pinion_angle)}, {int(self.failed.sum())} cells failed",
            "mean stiffness": f"{k[0]:.4g} to {k[-1]:.4g} N/um",
            "transmission error": f"peak to peak {error[0]:.3g} to {error[-1]:.3g} um",
            "root stress": "no" if self.root is None else f"up to {1e-6 * np.nanmax(self.root.largest):.4g} MPa",
        }

    def columns(self) -> dict[str, list[str]]:
        """Columns of the CSV file as text, one row per cell: torque by torque, angle by angle."""
        tables = [curve.columns() for curve in self.curves]
        names = list(dict.fromkeys(name for one in tables for name in one))
        rows = len(self.pinion_angle)
        columns: dict[str, list[str]] = {TORQUE: []}
        columns.update({name: [] for name in names})
        for torque, one in zip(self.torque, tables, strict=True):
            columns[TORQUE] += [to_text(torque, TORQUE)] * rows
            for name in names:
                columns[name] += one.get(name, ["0"] * rows)  # a share of a pair that this torque does not know
        if self.root is not None:
            for name, values in root_columns(self.root).items():
                columns[name] = [to_text(v, name) for v in values.ravel()]
        return columns

    def to_csv(self, path: str | Path) -> None:
        """Write the table; `from_csv` gives back every number exactly."""
        write_csv(path, self.columns())

    @classmethod
    def from_csv(cls, path: str | Path) -> LoadMap:
        """Read a map that `to_csv` wrote.

        Raises
        ------
        InputError
            When the file is not such a table.
        """
        columns = read_csv(path, "stiffness curve")
        if TORQUE not in columns:
            cure = "write one with gearfe loadmap"
            raise InputError("load map", str(path), f"has no column {TORQUE}", cure)
        torque = numbers(columns, TORQUE, path)
        starts = np.flatnonzero(np.concatenate([[True], torque[1:] != torque[:-1]]))
        counts = np.diff(np.append(starts, len(torque)))
        if len(set(counts.tolist())) > 1 or not (np.diff(torque[starts]) > 0).all():
            problem = "is not a table of rising torques with the same number of angles each"
            raise InputError("load map", str(path), problem, "write one with gearfe loadmap")
        curves = []
        for start, count in zip(starts, counts, strict=True):
            part = {name: cells[start : start + count] for name, cells in columns.items()}
            curves.append(StiffnessCurve.from_columns(part, path))
        if any(not np.array_equal(c.pinion_angle, curves[0].pinion_angle) for c in curves):
            raise InputError(
                "load map", str(path), "has other angles at other torques", "write one with gearfe loadmap"
            )
        return cls(torque[starts], tuple(curves), root_of(columns, (len(starts), int(counts[0])), path))


#: Quantities that nearly follow a power of the torque, and those that are nearly proportional to it.
_POWER_LAWS = ("k_tangent", "peak_pressure", "edge_pressure")
_PER_TORQUE = ("torque_pinion", "torque_wheel_reaction")
assert set(_PER_TORQUE) <= set(COLUMNS.values()) - set(WHOLE)


def _twist_between(torque: float, torques: Array, delta: Array, tangent: Array) -> Array:
    """Twist beyond touching (rad), shape (n,), between two torques; `delta` and `tangent` have the shape (2, n)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        y = np.log(delta)
        slope = torques[:, None] / (delta * tangent)
    h = float(np.log(torques[1] / torques[0]))
    t = float(np.log(torque / torques[0])) / h
    low, high = h * slope[0], h * slope[1]
    rise = y[1] - y[0]
    value = y[0] + t * (low + t * (3 * rise - 2 * low - high + t * (low + high - 2 * rise)))
    return np.asarray(np.exp(value))
