r"""Stiffness, transmission error, load share, pressure and root stress over pinion angle and torque. SI units.

A stiffness curve is a map with one load, so a map holds the positions of all its torques as one curve. The angles cover
one mesh cycle, or where teeth differ the full period, after which every tooth meets the same mate again.

The transmission error is the wheel's lag on the line of action, :math:`r_{b2}` (twist - lost motion). Unloaded it is
that of the rigid flanks, :math:`\min_k t_k(\psi)`. Loaded it includes the deflection of the teeth. Material out of the
driving flanks makes the wheel lead, so it counts negative. An order is so many times a turn of the pinion; the mesh has
the order :math:`z_1`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, given
from ...base.files import read_csv, write_csv
from ...base.shown import ShownTable
from ...base.typing import Array, BoolArray
from ..contact.position import of_positions
from ..geometry.deviation_job import GEARS
from ..geometry.pair import GearPair
from .curve import StiffnessCurve, as_text, numbers
from .pair_loads import PairLoads

#: Column of the torque that a row belongs to.
TORQUE = "torque_Nm"


@dataclass(frozen=True)
class RootMap:
    """Root stress over torque and angle; the third axis is the gear (pinion, wheel).

    Attributes
    ----------
    stress : ndarray, shape (m, n, 2, p)
        Largest tension along the loaded side's fillet of the teeth of pairs `leading_pair`, `leading_pair` - 1, ...
        (Pa); NaN where the pair carries nothing.
    diameter : ndarray, shape (m, n, 2)
        Where the largest one of them acts (m).
    error : ndarray, shape (m, n, 2)
        Its estimated relative error (-), see `gearfe.gears.gearmesh.root_stress`.
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
    """A gear pair's behaviour over torque and angle: one stiffness curve for each torque, at the same angles.

    Attributes
    ----------
    torque : ndarray, shape (m,)
        Torques at the wheel's hub, rising (N m).
    cells : StiffnessCurve
        The m n positions: torque by torque, at n angles each.
    root
        Root stresses, where they were computed.
    loads
        Loaded tooth pairs, whose ``position`` is the number of the cell; None for a map from a file.
    transmission_error_unloaded_back : ndarray, shape (n,), or None
        Unloaded transmission error (m) of the back flanks, > 0 where they lie behind those without deviations.
    back_clearance : ndarray, shape (m, n), or None
        Normal clearance (m) of the back flanks, unloaded themselves; < 0 where they would touch.
    mesh_cycles
        Number of mesh cycles that the angles cover in equal steps; 0 for other angles.
    pair
        The gears; None for a map from a file.
    timings
        Seconds by stage; not in the CSV file.
    """

    torque: Array
    cells: StiffnessCurve
    root: RootMap | None = None
    loads: PairLoads | None = None
    transmission_error_unloaded_back: Array | None = None
    back_clearance: Array | None = None
    mesh_cycles: int = 0
    pair: GearPair | None = None
    timings: Mapping[str, float] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of torques m, and of angles n."""
        return len(self.torque), len(self.cells) // len(self.torque)

    @cached_property
    def curves(self) -> tuple[StiffnessCurve, ...]:
        """The curve of each torque."""
        m, n = self.shape
        return tuple(self.cells.take(slice(row * n, (row + 1) * n)) for row in range(m))

    @cached_property
    def pairs(self) -> tuple[PairLoads, ...]:
        """Loaded tooth pairs of each torque, whose ``position`` is the number of the angle; empty for a map from a
        file."""
        m, n = self.shape
        return () if self.loads is None else tuple(of_positions(self.loads, n * k + np.arange(n)) for k in range(m))

    @property
    def pinion_angle(self) -> Array:
        """Pinion angles, shape (n,) (rad)."""
        return self.cells.pinion_angle[: self.shape[1]]

    @property
    def status(self) -> NDArray[np.str_]:
        """Status of each cell, shape (m, n)."""
        return self.quantity("status")

    @property
    def failed(self) -> BoolArray:
        """Cells without a solution, shape (m, n)."""
        return self.quantity("failed")

    @property
    def statuses(self) -> dict[str, int]:
        """How many cells have which status."""
        return self.cells.statuses

    def quantity(self, name: str) -> Any:
        """A field of `StiffnessCurve` over torque and angle, shape (m, n)."""
        values = getattr(self.cells, name)
        return values.reshape(*self.shape, *values.shape[1:])

    @property
    def peak_to_peak(self) -> Array:
        """Peak-to-peak transmission error of each torque, shape (m,) (m); NaN where a position failed."""
        return np.ptp(self.quantity("transmission_error"), axis=1)

    @property
    def transmission_error_unloaded(self) -> Array:
        """That of the rigid flanks, shape (n,) (m)."""
        return self.cells.transmission_error_unloaded[: self.shape[1]]

    @property
    def span(self) -> str:
        """What the angles run over, in words."""
        known = {0: "given angles", 1: "1 mesh cycle"}
        return known.get(self.mesh_cycles, f"{self.mesh_cycles} mesh cycles")

    def spectrum(self, *, unloaded: bool = False) -> tuple[Array, Array]:
        """Orders, shape (k,), and one-sided amplitudes (m) of the transmission error, shape (m, k) or (k,).

        Raises
        ------
        InputError
            Where the angles are no equal steps over whole mesh cycles.
        """
        if not self.mesh_cycles:
            raise InputError("angles", None, "are no equal steps over whole mesh cycles", "leave angles out")
        values = self.transmission_error_unloaded if unloaded else self.quantity("transmission_error")
        count = len(self.pinion_angle)
        made = np.abs(np.fft.rfft(values, axis=-1)) / count
        made[..., 1 : (count + 1) // 2] *= 2
        teeth = given(self.pair, "pair").pinion.teeth
        return np.arange(made.shape[-1]) * (teeth / self.mesh_cycles), made

    # ---- tables ------------------------------------------------------------------------------------------------------

    AXES = (TORQUE, "pinion_angle_deg")

    def facts(self) -> dict[str, str]:
        """Torques, angles, stiffness and transmission error."""
        k, error = 1e-6 * self.quantity("k_mesh").mean(axis=1), 1e6 * self.peak_to_peak
        return {
            "torques": f"{len(self.torque)}, {self.torque[0]:.4g} to {self.torque[-1]:.4g} N m at the wheel",
            "pinion angles": f"{len(self.pinion_angle)} over {self.span}, {int(self.failed.sum())} cells failed",
            "mean stiffness": f"{k[0]:.4g} to {k[-1]:.4g} N/um",
            "transmission error": f"peak to peak {error[0]:.3g} to {error[-1]:.3g} um",
            "root stress": "no" if self.root is None else f"up to {1e-6 * np.nanmax(self.root.largest):.4g} MPa",
        }

    def columns(self) -> dict[str, list[str]]:
        """Columns of the CSV file as text, one row per cell: torque by torque, angle by angle."""
        columns = {TORQUE: as_text(np.repeat(self.torque, self.shape[1]), TORQUE), **self.cells.columns()}
        more = {} if self.root is None else root_columns(self.root)
        if self.transmission_error_unloaded_back is not None and self.back_clearance is not None:
            error = np.broadcast_to(self.transmission_error_unloaded_back, self.back_clearance.shape)
            more |= {"transmission_error_unloaded_back_um": error, "back_clearance_um": self.back_clearance}
        columns |= {name: as_text(values.ravel(), name) for name, values in more.items()}
        return columns

    def to_csv(self, path: str | Path) -> None:
        """Write the table; `from_csv` gives back every number to 15 digits."""
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
        cells = StiffnessCurve.from_columns(columns, path)
        shape = len(starts), int(counts[0])
        load_map = cls(torque[starts], cells, root_of(columns, shape, path))
        if (load_map.quantity("pinion_angle") != load_map.pinion_angle).any():
            problem = "has other angles at other torques"
            raise InputError("load map", str(path), problem, "write one with gearfe loadmap")
        for curve in load_map.curves:
            curve.check(str(path))
        return load_map
