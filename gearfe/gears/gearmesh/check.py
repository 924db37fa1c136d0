"""Positions of a curve solved again on whole gears with all their unknowns, as an independent check.

The curve comes from gears condensed to their flanks. Here both whole gears are finite elements in scikit-fem forms
(`gears.contact.whole_gears`). They share only meshes, materials and the closest-point search with the curve. Each
position is solved at the twist of the curve, and torques are compared.

    >>> curve = sweep_stiffness(pair, twist=math.radians(0.05), law="nitsche")
    >>> check = check_positions(curve, pair, [3, 17], law="nitsche")  # third and seventeenth row of its table
    >>> check.relative_difference
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.files import write_csv
from ...base.progress import one_thread, stage
from ...base.shown import Facts
from ...base.typing import Array, BoolArray, IntArray
from ..contact.laws import DEFAULT_MODEL, ElementLaw, Nitsche, PairModel, law_text
from ..geometry.face import NOMINAL
from ..geometry.pair import GearPair
from .curve import SOLVED, StiffnessCurve, as_text

#: Status of a position whose twist the curve does not know: the search for its torque failed.
NO_TWIST = "twist_unknown"
#: What to do about positions without a solution on whole gears.
CURE = "check another position, or use a smaller load or a finer flank (flank_coarsen below 1)"
#: What to expect of both torques, by kind of comparison; the figures are those of docs/check.md.
EXPECTED = {
    "small": "same elements and law, so both torques agree to the tolerance of their solvers, within 1e-7",
    "finite": "same elements and law; the curve adds finite strain to first order, so both torques agree within 5e-4 "
    "up to 0.5 deg of twist",
    "half_plane": "two laws on two meshes: with coarsen = 1 both torques agree within 0.2 % on smooth flanks, within "
    "0.5 % where an edge is loaded, and less well where the contact is narrower than an element of the whole gears",
}


@dataclass(frozen=True, repr=False, kw_only=True)
class StiffnessCheck(Facts):
    """Positions of a curve and the same positions on whole gears; all arrays have one entry per position, shape (n,).

    Attributes
    ----------
    row
        Rows of the curve's table, counted from 1.
    pinion_angle, twist
        Rotation of the pinion and twist from where unmodified flanks touch (rad), of both solutions.
    status, torque_wheel, k_mesh
        Status, torque at the wheel (N m) and mesh stiffness (N/m) of the curve.
    whole_status
        ``converged``, ``no_contact``, ``not_converged``, ``under_resolved`` or ``twist_unknown``: the curve has no
        twist there.
    whole_torque_wheel, whole_k_mesh
        Torque at the wheel (N m) and mesh stiffness (N/m) of the whole gears; NaN where these failed.
    relative_difference
        Torque of the whole gears over that of the curve, minus 1 (-); 0 where neither has contact, NaN where one of
        them failed or only one has contact.
    elements_per_contact
        Length of the narrowest contact in elements of its flank on the whole gears (-).
    iterations
        Newton iterations on the whole gears.
    unknowns
        Unknowns of both whole gears.
    contact_law, whole_contact_law
        Contact laws with their parameters.
    expected
        Which difference to expect, and why.
    """

    row: IntArray
    pinion_angle: Array
    twist: Array
    status: NDArray[np.str_]
    torque_wheel: Array
    k_mesh: Array
    whole_status: NDArray[np.str_]
    whole_torque_wheel: Array
    whole_k_mesh: Array
    relative_difference: Array
    elements_per_contact: Array
    iterations: IntArray
    unknowns: int
    contact_law: str
    whole_contact_law: str
    expected: str

    def __len__(self) -> int:
        return len(self.row)

    @property
    def failed(self) -> BoolArray:
        """Positions that the whole gears have no solution of."""
        return ~np.isin(self.whole_status, SOLVED)

    def facts(self) -> dict[str, str]:
        """Positions and differences."""
        known = np.abs(self.relative_difference[np.isfinite(self.relative_difference)])
        largest = f"{known.max():.2g}" if len(known) else "unknown"
        return {"positions": f"{len(self)}, {np.count_nonzero(~self.failed)} solved", "largest difference": largest}

    def columns(self) -> dict[str, list[str]]:
        """Columns of the CSV file as text."""
        values: dict[str, Any] = {
            "row": self.row,
            "pinion_angle_deg": self.pinion_angle,
            "twist_deg": self.twist,
            "status": self.status,
            "torque_wheel_Nm": self.torque_wheel,
            "k_mesh_N_per_m": self.k_mesh,
            "whole_gears_status": self.whole_status,
            "whole_gears_torque_wheel_Nm": self.whole_torque_wheel,
            "whole_gears_k_mesh_N_per_m": self.whole_k_mesh,
            "relative_difference": self.relative_difference,
            "whole_gears_elements_per_contact": self.elements_per_contact,
            "whole_gears_iterations": self.iterations,
            "whole_gears_unknowns": np.full(len(self), self.unknowns),
            "contact_law": np.full(len(self), self.contact_law),
            "whole_gears_contact_law": np.full(len(self), self.whole_contact_law),
        }
        return {name: as_text(column, name) for name, column in values.items()}

    def to_csv(self, path: str | Path) -> None:
        """Write the table, numbers to 15 digits."""
        write_csv(path, self.columns())

    def lines(self) -> list[str]:
        """Return the lines to print: both results and their difference at each position."""
        lines = [f"check on whole gears with {self.unknowns:,} unknowns, {self.whole_contact_law}: {self.expected}"]
        for i, row in enumerate(self.row):
            angle = f"{math.degrees(self.pinion_angle[i]):.6g}"
            results = [
                f"{torque:.10g} N m, {1e-6 * k:.6g} N/um" if status in SOLVED else status
                for status, torque, k in (
                    (self.status[i], self.torque_wheel[i], self.k_mesh[i]),
                    (self.whole_status[i], self.whole_torque_wheel[i], self.whole_k_mesh[i]),
                )
            ]
            line = f"position {row} ({angle} deg): {results[0]}; whole gears {results[1]}"
            if math.isfinite(self.relative_difference[i]):
                line += f"; difference {self.relative_difference[i]:.2g}"
            if self.elements_per_contact[i] < 1.0:
                line += "; its contact is narrower than an element of the whole gears"
            lines.append(line)
        return lines

    def warnings(self) -> list[str]:
        """Return a sentence about positions that the whole gears have no solution of."""
        if not self.failed.any():
            return []
        rows = ", ".join(str(row) for row in self.row[self.failed])
        return [f"no solution on whole gears, only a status, of position {rows}: {CURE}"]


def checked_rows(rows: Sequence[int], positions: int, name: str) -> IntArray:
    """Return the rows of a table of so many `positions`, counted from 1, that the argument `name` gives.

    Raises
    ------
    InputError
        For no row, one outside of the table, and one that is given twice.
    """
    cure = "the first row below the header of the table is 1"
    if len(rows) == 0:
        raise InputError(name, None, "is empty", f"give at least one position, 1 to {positions}")
    for k, row in enumerate(rows):
        if isinstance(row, bool) or not isinstance(row, int | np.integer) or not 1 <= row <= positions:
            raise InputError(name, row, f"must be a whole number >= 1 and <= {positions}, a row of the table", cure)
        if row in rows[:k]:
            raise InputError(name, row, "is given twice", "leave one out")
    return np.array(rows, dtype=np.int64)


def whole_law(model: PairModel, name: str) -> ElementLaw:
    """Return the law that whole gears take for a model: its own, or Nitsche's for the half-plane law.

    Raises
    ------
    InputError
        For deviations of micrometres, called by `name`.
    """
    if model.deviations != NOMINAL:
        problem = "whole gears take flanks from meshes, which have no deviations of micrometres"
        raise InputError(name, None, problem, "leave the deviations ([microgeometry]) out for the check")
    return model.law if isinstance(model.law, ElementLaw) else Nitsche()


def check_positions(
    curve: StiffnessCurve,
    pair: GearPair,
    rows: Sequence[int],
    model: PairModel = DEFAULT_MODEL,
    *,
    kinematics: Literal["small", "finite"] = "finite",
    **changes: Any,
) -> StiffnessCheck:
    """Solve positions of a curve again on whole gears, with all unknowns of both.

    Parameters
    ----------
    curve
        Curve to check.
    pair
        Its gears.
    rows
        Positions to check: rows of the curve's table, counted from 1.
    model, changes
        Model of the curve, and fields of it to change, such as ``law="nitsche"``, as in `gearfe.sweep_stiffness`. The
        half-plane law is checked by Nitsche's on its elements.
    kinematics
        Strain of the curve: ``small`` or ``finite``. The whole gears take Saint Venant-Kirchhoff bodies where the curve
        adds the effect of finite strain to first order.

    Returns
    -------
    StiffnessCheck
        With every position asked for; a position that failed has its status and NaN.

    Raises
    ------
    InputError
        For rows that the curve does not have, and deviations of micrometres, which no mesh has.
    """
    from ..contact.whole_gears.pair import whole_pair
    from ..contact.whole_gears.position import WholePosition, solve_position

    if kinematics not in ("small", "finite"):
        raise InputError("kinematics", kinematics, "must be small or finite")
    numbers = checked_rows(rows, len(curve), "rows")
    model = model.changed(**changes)
    law = whole_law(model, "deviations")
    of_elements = law is model.law
    at = numbers - 1
    twist = curve.twist[at]
    positions = []
    with stage("whole gears"), one_thread():
        whole = whole_pair(pair, model.changed(law=law), kinematics)
        unknowns = whole.unknowns
        for k, (angle, deflection) in enumerate(zip(curve.pinion_angle[at], twist, strict=True)):
            if math.isnan(deflection):
                positions.append(WholePosition(NO_TWIST))
                continue
            with stage(f"position {k + 1} of {len(at)}"):
                positions.append(solve_position(whole, law, float(angle), float(deflection + curve.lost_motion)))
    status = np.array([position.status for position in positions])
    torque = np.array([position.torque_wheel for position in positions])
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = np.where(torque == 0.0, 0.0, torque / (twist * curve.base_radius**2))
        both = np.where((torque == 0.0) & (curve.torque_wheel[at] == 0.0), 0.0, torque / curve.torque_wheel[at] - 1.0)
    return StiffnessCheck(
        row=numbers,
        pinion_angle=curve.pinion_angle[at],
        twist=twist,
        status=curve.status[at],
        torque_wheel=curve.torque_wheel[at],
        k_mesh=curve.k_mesh[at],
        whole_status=status,
        whole_torque_wheel=torque,
        whole_k_mesh=stiffness,
        relative_difference=np.where(np.isfinite(both), both, np.nan),
        elements_per_contact=np.array([position.elements_per_contact for position in positions]),
        iterations=np.array([position.iterations for position in positions]),
        unknowns=unknowns,
        contact_law=curve.contact_law,
        whole_contact_law=law_text(law),
        expected=EXPECTED[kinematics if of_elements else "half_plane"],
    )
