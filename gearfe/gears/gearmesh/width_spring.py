r"""The spring of a mesh whose load varies along the face width: stiffness and static transmission error over a pitch.

The contact along the width is solved over a mesh cycle under the torque that the mesh carries (`gears.width`). With the
force F_0 along the line of action in the transverse section, the approach :math:`\delta_0` of the wheel against the
pinion and the tangent k at each position, the mesh is the spring

.. math:: F = k(\varphi)\,\big(\delta - e(\varphi)\big), \qquad e = \delta_0 - F_0/k ,

which has the force and the tangent of the contact at that torque: its static transmission error under the torque is
that of the contact. A mean stiffness :math:`k_m` has :math:`e = \delta_0 - F_0/k_m`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.cache import cached_arrays, source_hash, versions
from ...base.errors import InputError
from ...base.typing import Array
from ..contact.laws import check_alike
from ..width import contact_lines, sweep_width, wide_compliance
from ..width.sweep import CONVERGED
from .job import PACKAGES, StiffnessJob
from .mesh_table import MeshTable
from .periodic import periodic_interpolant
from .width_job import check_width_job, wide_flanks, wide_mesh


@dataclass(frozen=True, eq=False)
class WidthStates:
    """Contact along the face width at n positions under one load; NaN where it was not solved.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        Rotation of the driver (rad).
    force : ndarray, shape (n,)
        Along the line of action in the transverse section (N).
    approach : ndarray, shape (n,)
        Along the line of action, from where unmodified flanks touch (m).
    stiffness : ndarray, shape (n,)
        dF/d approach (N/m).
    """

    angle: Array
    force: Array
    approach: Array
    stiffness: Array


def width_states(
    job: StiffnessJob, angles: Array, *, torque: float | None = None, twist: float | None = None
) -> WidthStates:
    """Solve the contact of a mesh along its face width over angles, from disk where it was solved before.

    Parameters
    ----------
    job : StiffnessJob
        Gears, flanks and materials.
    angles : ndarray, shape (n,)
        Rotations of the driver (rad).
    torque, twist : float, optional
        At the driven gear (N m), or of it (rad): one of both.

    Raises
    ------
    InputError
        For keys of [stiffness] that a load along the width does not take, teeth that differ, and loads out of range.
    """
    check_width_job(job)
    mesh = wide_mesh(job)
    flanks = wide_flanks(job, mesh)
    check_alike(flanks.profiles)
    load: dict[str, Any] = {"torques": torque} if twist is None else {"twists": twist}

    def solve() -> dict[str, Array]:
        sweep = sweep_width(contact_lines(wide_compliance(mesh), flanks), **load, angles=angles)
        radius = mesh.sections.wheel.base_radius
        solved = sweep.status[0] == CONVERGED
        states = {
            "force": sweep.torque[0] / radius,
            "approach": sweep.transmission_error[0],
            "stiffness": sweep.stiffness[0] / radius**2,
        }
        return {name: np.where(solved, values, np.nan) for name, values in states.items()}

    code = [source_hash("gears/width", *PACKAGES), versions()]
    recipe = {"mesh": mesh, "flanks": flanks, "load": load, "angles": angles, "code": code}
    return WidthStates(angles, **cached_arrays("width", recipe, solve))


def mesh_spring(states: WidthStates, pitch: float, *, mean: bool, method: str = "cubic") -> MeshTable:
    """Return stiffness and unloaded transmission error of a mesh over a pitch.

    Parameters
    ----------
    states : WidthStates
        Contact over a mesh cycle under the load that the mesh carries.
    pitch : float
        Of the driver (rad).
    mean : bool
        Whether the stiffness is its mean over the pitch.
    method : str
        ``cubic`` (monotone) or ``linear``.

    Raises
    ------
    InputError
        For positions that do not cover the pitch, or where the flanks do not bear.
    """
    stiffness: Any = periodic_interpolant(states.angle, states.stiffness, pitch, method=method)
    if not stiffness.values.min() > 0.0:
        at = float(np.degrees(states.angle[int(np.nanargmin(states.stiffness))]))
        problem = f"is {stiffness.values.min():.4g} N/m at a driver's angle of {at:.6g} deg: the flanks do not bear"
        raise InputError("mesh stiffness", None, problem, "use more load, or less modification")
    softness: Array | float = 1.0 / states.stiffness
    if mean:
        stiffness = float(stiffness.mean)
        softness = 1.0 / stiffness
    error = states.approach - states.force * softness
    return MeshTable(stiffness, periodic_interpolant(states.angle, error, pitch, method=method))
