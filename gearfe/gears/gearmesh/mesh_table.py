r"""Given data of a mesh over a pitch: stiffness and static transmission error, from another program or a measurement.

The mesh force is :math:`F = k(\varphi)\,(\delta - e(\varphi))` with the unloaded transmission error e. Of one under a
force :math:`F_0` along the line of action, :math:`e = e_0 - F_0/k`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError, shown, unknown_name
from ...base.files import read_csv
from ...base.typing import Array
from .periodic import PeriodicInterpolant, check_repeats, periodic_interpolant

#: Columns of the phase: in pitches of the driver, or the driver's rotation.
PHASES = ("fraction_of_pitch", "driver_angle_deg")
#: Columns of the stiffness.
STIFFNESSES = ("k_mesh_N_per_m", "k_mesh_N_per_um")
#: Columns of the transmission error: without load, and under the load of another column.
UNLOADED, LOADED = "transmission_error_unloaded_um", "transmission_error_loaded_um"
#: Columns of the load of the latter: along the line of action, or as a torque at the driven gear.
FORCE, TORQUE = "mesh_force_N", "torque_driven_Nm"
#: Columns that are not in SI -> factor to it.
FACTORS = {"driver_angle_deg": math.pi / 180.0, "k_mesh_N_per_um": 1e6, UNLOADED: 1e-6, LOADED: 1e-6}
#: Name of these tables in messages.
TABLE = "mesh table"


@dataclass(frozen=True, eq=False)
class Tilting:
    r"""How a mesh spring acts along the face width, about the middle of the common width, y from there along the axis.

    Under the approach delta in the middle and the tilt gamma in the plane of action, beside that of the data,

    .. math:: F = k\,(\delta + \ell\,\gamma - e), \qquad M = \ell\,F + m + \kappa\,\gamma .

    Attributes
    ----------
    lever : PeriodicInterpolant
        y at which the tangent stiffness acts (m) over the driver's rotation (rad).
    moment : PeriodicInterpolant
        m, the moment of the force about there (N m).
    stiffness
        kappa, against tilting about there (N m/rad).
    """

    lever: PeriodicInterpolant
    moment: PeriodicInterpolant
    stiffness: float


@dataclass(frozen=True, eq=False)
class MeshTable:
    """Stiffness k (N/m), alike or over the driver's rotation (rad), unloaded static transmission error e (m), and how
    the spring acts along the face width where that is known.
    """

    stiffness: PeriodicInterpolant | float
    transmission_error: PeriodicInterpolant
    tilting: Tilting | None = None


def read_mesh_table(
    path: str | Path,
    pitch: float,
    driven_base_radius: float,
    *,
    method: str = "cubic",
    mate_pitch: float | None = None,
    mate_phase: Callable[[Array], Array] | None = None,
) -> MeshTable:
    """Read a mesh table from a CSV file.

    Parameters
    ----------
    path : str or Path
        It has one column of `PHASES` in the driving sense, 0 where a driver's tooth stands on the line of centres, and
        one of `STIFFNESSES`. A third is of `UNLOADED` or `LOADED`, the latter beside `FORCE` or `TORQUE`.
    pitch : float
        Pitch of the driver (rad).
    driven_base_radius : float
        Base radius of the driven gear (m).
    method : str
        ``cubic`` (monotone) or ``linear``.
    mate_pitch : float, optional
        Pitch of the driven gear (rad), for an answer over its rotation: that of the external gear where a ring drives.
    mate_phase : callable, optional
        Rotation of the driven gear for that of the driver (rad), which falls as that rises.

    Raises
    ------
    InputError
        For columns that are missing, unknown or given twice, cells that are no numbers, and stiffnesses that are not >
        0. Also for tables that do not cover the pitch, or contradict themselves one pitch on.
    """
    columns = read_csv(path, TABLE)
    known = (*PHASES, *STIFFNESSES, UNLOADED, LOADED, FORCE, TORQUE)
    for name in columns:
        if name not in known:
            raise unknown_name(f"{TABLE} {path}", name, known)
    where = _one_of(columns, PHASES, path)
    phase = _values(columns, where, path) * (pitch if where == PHASES[0] else 1.0)
    name = _one_of(columns, STIFFNESSES, path)
    k = _values(columns, name, path)
    if not (k > 0.0).all():
        row = int(np.argmin(k))
        problem = f"has {name} = {k[row] / FACTORS.get(name, 1.0):g} in row {row + 1}: must be > 0"
        raise InputError(TABLE, str(path), problem, "a stiffness is positive: correct the row")
    error_name = _one_of(columns, (UNLOADED, LOADED), path)
    error = _values(columns, error_name, path)
    loads = [name for name in (FORCE, TORQUE) if name in columns]
    if error_name == UNLOADED and loads:
        problem = f"has {loads[0]} as well as {UNLOADED}, which has no load"
        raise InputError(TABLE, str(path), problem, f"leave it out, or name the error {LOADED}")
    if error_name == LOADED:
        load = _one_of(columns, (FORCE, TORQUE), path)
        force = _values(columns, load, path) / (1.0 if load == FORCE else driven_base_radius)
        if not ((force > 0.0).all() and np.ptp(force) <= 1e-9 * force.max()):
            problem = f"must have one {load} > 0 on all rows"
            raise InputError(TABLE, str(path), problem, "write the load of the transmission error, one for the table")
        error = error - force / k
    if mate_phase is not None and mate_pitch is not None:
        phase, k, error = mate_phase(phase)[::-1], k[::-1], error[::-1]
        pitch = mate_pitch
    for values, unit in ((k, 1.0), (error, 1e6)):
        try:
            check_repeats(phase, unit * values, pitch, str(path))
        except InputError as found:
            raise InputError(TABLE, str(path), found.problem, "keep the rows of one pitch, or correct them") from None
    try:
        curves = [periodic_interpolant(phase, values, pitch, method=method) for values in (k, error)]
    except InputError as found:
        raise InputError(TABLE, str(path), found.problem, "give rows over a whole pitch, in small steps") from None
    return MeshTable(curves[0], curves[1])


def _one_of(columns: Mapping[str, Sequence[str]], names: Sequence[str], path: str | Path) -> str:
    """The one column of some that a table has."""
    own = [name for name in names if name in columns]
    if len(own) == 1:
        return own[0]
    if own:
        raise InputError(TABLE, str(path), f"has both {own[0]} and {own[1]}", "leave one out")
    raise InputError(TABLE, str(path), f"has no column {' or '.join(names)}", "add it")


def _values(columns: Mapping[str, Sequence[str]], name: str, path: str | Path) -> Array:
    """A column of finite numbers in SI, none missing."""
    values = np.full(len(columns[name]), np.nan)
    for row, cell in enumerate(columns[name]):
        with suppress(ValueError):
            values[row] = float(cell) * FACTORS.get(name, 1.0)
        if not math.isfinite(values[row]):
            problem = f"has {name} = {shown(cell.strip())} in row {row + 1}: must be a finite number"
            raise InputError(TABLE, str(path), problem, "write a number in each row")
    return values
