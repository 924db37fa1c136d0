r"""The spring of a mesh whose load varies along the face width: stiffness and static transmission error over a pitch.

The contact along the width is solved over a mesh cycle under the torque that the mesh carries (`gears.width`). With the
force F_0 along the line of action in the transverse section, the approach :math:`\delta_0` of the wheel against the
pinion and the tangent k at each position, the mesh is the spring

.. math:: F = k(\varphi)\,\big(\delta - e(\varphi)\big), \qquad e = \delta_0 - F_0/k ,

which has the force and the tangent of the contact at that torque: its static transmission error under the torque is
that of the contact. A mean stiffness :math:`k_m` has :math:`e = \delta_0 - F_0/k_m`.

**Tilting.** With the approach at y from the middle of the common width, :math:`\delta + y\gamma` under a tilt
:math:`\gamma` in the plane of action, the tangent of force and moment is :math:`k, k\ell, k_{\gamma\gamma}`. So the
spring acts at the lever :math:`\ell`. Against tilting about that point it has the stiffness
:math:`\kappa = k_{\gamma\gamma} - k\ell^2`, whose mean over the positions is taken, and the moment
:math:`m = M_0 - \ell F_0` (`.mesh_table.Tilting`). Tilts across the plane of action do nothing to involutes.
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
from .mesh_table import MeshTable, Tilting
from .periodic import periodic_interpolant
from .width_job import axial_sense, check_width_job, wide_flanks, wide_mesh


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
    lever : ndarray, shape (n,)
        y of that stiffness from the middle of the common width (m), along the axes of the job file.
    moment : ndarray, shape (n,)
        Moment of the force about the middle of the common width (N m), > 0 for a force at larger y.
    against_tilting : ndarray, shape (n,)
        Stiffness against tilts in the plane of action about the lever (N m/rad).
    """

    angle: Array
    force: Array
    approach: Array
    stiffness: Array
    lever: Array
    moment: Array
    against_tilting: Array


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
        radius, sense, points = mesh.sections.wheel.base_radius, axial_sense(job), sweep.points
        solved = sweep.status[0] == CONVERGED
        tangent = sweep.tangent[0]
        forces = points.line_load * points.weight * (points.z - 0.5 * sum(mesh.zone))
        states = {
            "force": sweep.torque[0] / radius,
            "approach": sweep.transmission_error[0],
            "stiffness": tangent[:, 0, 0] / radius**2,
            "lever": sense * radius * tangent[:, 0, 1] / tangent[:, 0, 0],
            "moment": sense * np.bincount(points.position, forces, len(angles)),
            "against_tilting": tangent[:, 1, 1] - tangent[:, 0, 1] ** 2 / tangent[:, 0, 0],
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
        problem = f"is {stiffness.values.min():.4g} N/m at a driver's angle of {at:.6g} deg: the flanks carry no load"
        raise InputError("mesh stiffness", None, problem, "use more load, or less modification")
    softness: Array | float = 1.0 / states.stiffness
    if mean:
        stiffness = float(stiffness.mean)
        softness = 1.0 / stiffness
    error = states.approach - states.force * softness
    moment = states.moment - states.lever * states.force
    error_, lever, moment_ = (
        periodic_interpolant(states.angle, values, pitch, method=method) for values in (error, states.lever, moment)
    )
    against = float(periodic_interpolant(states.angle, states.against_tilting, pitch, method=method).mean)
    return MeshTable(stiffness, error_, Tilting(lever, moment_, max(0.0, against)))
