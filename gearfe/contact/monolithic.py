r"""The verification route: contact of whole gears as plain scikit-fem forms, solved in all unknowns at once.

Find the displacements u of both gears, zero at the bores, such that for all v

.. math::
    a(u, v) = \int_{\Gamma_s} p\; n\cdot[v], \qquad [v] = v(x_s) - v(x_m), \qquad
    p = \max(0,\; -\gamma g(u) - s\,\sigma_n(u)),

with a the elastic energy's bilinear form on the undeformed gears in their present places, x_m the closest point of the
deformed mate, n its normal there and sigma_n the normal stress at x_s. Newton's tangent adds, with the variations
of `gearfe.contact.closest`,

.. math::
    \int_{\Gamma_s} H(p)\,(\gamma\,\delta g(u) + s\,\sigma_n(u))\; n\cdot[v] \;-\; p\,\Delta(n\cdot[v]).

Nothing but the closest-point search is shared with the condensed route: no compliance, no cyclic symmetry, no windows
of flank. On the same mesh and quadrature points both must give the same torques; what they cost differs a hundredfold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from .closest import Projection, chains_of, nearest_places, project, unreached
from .laws import ContactLaw
from .whole_pair import ContactPoints, WholePair, contact_points, point_basis

Array = NDArray[np.float64]

#: Out-of-balance forces relative to the contact forces at which a position counts as converged.
TOLERANCE = 1e-10
MAX_ITERATIONS = 15
#: Newton steps taken in full before the line search watches over them.
FREE_ITERATIONS = 3


@dataclass(frozen=True)
class MonolithicPosition:
    """Solution of one position on whole gears.

    Attributes
    ----------
    status, torque_wheel, torque_pinion, torque_wheel_reaction, peak_pressure, iterations
        As in `gearfe.contact.solver.Position`.
    mesh
        scikit-fem mesh of both gears in their present places (pinion's triangles first).
    displacement : ndarray
        Unknowns on ``WholePair.element`` (m).
    pressure, place : ndarray, shape (q,)
        Pressure at the contact points (Pa) and where they are (edge of the mate's flank plus xi).
    """

    status: str
    torque_wheel: float
    torque_pinion: float
    torque_wheel_reaction: float
    peak_pressure: float
    iterations: int
    mesh: Any
    displacement: Array
    pressure: Array
    place: Array


@dataclass(frozen=True)
class _State:
    """Contact at the displacement u: closest points, the mate's basis there, pressures and contact forces."""

    u: Array
    projection: Projection
    mate: Any
    fields: dict[str, Any]
    pressure: Array
    forces: Array


def solve_monolithic(
    pair: WholePair,
    law: ContactLaw,
    pinion_angle: float,
    twist: float,
    *,
    tolerance: float = TOLERANCE,
    halvings: int = 3,
) -> MonolithicPosition:
    """Solve the contact of two whole gears at one pinion angle (rad) and wheel twist (rad).

    Parameters
    ----------
    pair
        Both gears' meshes and materials.
    law
        Contact law.
    tolerance
        Out-of-balance forces relative to the contact forces.
    halvings
        How often the twist may be halved to reach a start from which Newton's method converges.
    """
    points = contact_points(pair, law, pinion_angle, twist)
    if points is None:
        return _empty("no_contact", None)
    stiffness = pair.stiffness_at(pinion_angle, twist)
    start = _contact(points, np.zeros(stiffness.shape[0]), None)
    if not (start.pressure > 0).any():
        return _empty("under_resolved" if points.rigid_overlap else "no_contact", points.mesh)
    state, iterations = _newton(points, stiffness, start, tolerance)
    if state is None and halvings:
        part = solve_monolithic(pair, law, pinion_angle, 0.5 * twist, tolerance=1e-4, halvings=halvings - 1)
        iterations += part.iterations
        if part.status == "converged":
            state, more = _newton(points, stiffness, _contact(points, 2 * part.displacement, None), tolerance)
            iterations += more
    if state is None:
        return _empty("not_converged", points.mesh, iterations)
    return _finish(points, state, stiffness, iterations)


def _newton(points: ContactPoints, stiffness: Any, state: _State, tolerance: float) -> tuple[_State | None, int]:
    """Semi-smooth Newton with a backtracking line search on the out-of-balance forces; None when it fails."""
    free = np.setdiff1d(np.arange(len(state.u)), points.fixed)
    surface = points.unknowns[points.chain_nodes].ravel()  # inside, a step leaves nothing but round-off
    residual = np.inf
    for iteration in range(1, MAX_ITERATIONS + 1):
        matrix = csc_matrix((stiffness + _tangent(points, state))[free][:, free])
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        step = np.zeros(len(state.u))
        step[free] = factor.solve((state.forces - stiffness @ state.u)[free])
        length, best = 1.0, None
        for _ in range(6):
            tried = _contact(points, state.u + length * step, state.projection.place)
            scale = float(np.sum(np.abs(tried.forces)))
            if scale > 0:
                error = float(np.sum(np.abs((tried.forces - stiffness @ tried.u)[surface]))) / scale
                if best is None or error < best[0]:
                    best = (error, tried)
                if error < (1 - 0.1 * length) * residual or iteration <= FREE_ITERATIONS:
                    break
            length *= 0.5
        if best is None:
            return None, iteration
        residual, state = best
        if residual < tolerance:
            return state, iteration
    return None, MAX_ITERATIONS


def _contact(points: ContactPoints, u: Array, place: Array | None) -> _State:
    """Closest points, pressures and contact forces at the displacement u."""
    from skfem import DiscreteField, LinearForm, asm
    from skfem.helpers import dot

    placed = points.mesh.doflocs.T + u[points.unknowns]
    nodes = placed[points.chain_nodes]
    moved = points.slave.interpolate(u)
    where = (points.slave.global_coordinates() + moved)[:, :, 0].T
    if place is None:
        place = np.empty(len(where))
        for k, chain in enumerate(points.chains):
            own = points.mate == k
            place[own] = nearest_places(where[own], nodes[chain])
    projection = project(where, chains_of(nodes, points.counts, points.mate, points.fade), place)
    elements, local, tangent = points.on_mate(projection)
    mate = point_basis(points.mesh, elements, local, points.weight)
    stress = _normal_stress(moved, points.fields)[:, 0]
    pressure = np.maximum(0.0, -points.parameter * projection.gap - points.stress_share * stress)
    pressure[unreached(projection.gap)] = 0.0
    metric = np.einsum("ni,ni->n", projection.tangent, projection.tangent)
    numbers = {
        "p": pressure,
        "g": projection.gap,
        "n": projection.normal.T,
        "a": projection.tangent.T,
        "undeformed_a": tangent,
        "kappa": projection.curvature,
        "m": metric,
        "share": points.share(projection.place),
        "gamma": points.parameter,
        "s": points.stress_share,
        "active": (pressure > 0).astype(float),
    }
    fields = {name: DiscreteField(value[..., None]) for name, value in numbers.items()} | points.fields

    @LinearForm
    def push(v: Any, w: Any) -> Any:
        return w.share * w.p * dot(w.n, _jump(v, w.idx[0]))

    return _State(u, projection, mate, fields, pressure, asm(push, [points.slave, mate], **fields))


def _jump(v: Any, side: int) -> Any:
    """[v]: v at the slave point (side 0), -v at the closest point of the mate (side 1)."""
    return v if side == 0 else -v


def _tilt(v: Any, side: int, w: Any) -> Any:
    """N = n . dv/dxi on the mate."""
    from skfem.helpers import dot, grad, mul

    return dot(w.n, mul(grad(v), w.undeformed_a)) if side == 1 else 0.0 * w.g


def _slide(v: Any, side: int, w: Any) -> Any:
    """Variation of the closest point's xi."""
    from skfem.helpers import dot

    return (dot(w.a, _jump(v, side)) + w.g * _tilt(v, side, w)) / (w.m - w.g * w.kappa)


def _normal_stress(u: Any, w: Any) -> Any:
    """n0 . sigma(u) n0 with the normal n0 of the undeformed flank."""
    from skfem.helpers import dot, grad, mul, trace

    n0, lam, mu = (w[name] for name in ("slave_normal", "lam", "mu"))
    return lam * trace(grad(u)) + 2 * mu * dot(n0, mul(grad(u), n0))


def _tangent(points: ContactPoints, state: _State) -> Any:
    """Contact part of Newton's matrix."""
    from skfem import BilinearForm, asm
    from skfem.helpers import dot

    @BilinearForm
    def form(u: Any, v: Any, w: Any) -> Any:
        of_u, of_v = w.idx
        opening = dot(w.n, _jump(u, of_u)) - dot(w.n, w.a) * _slide(u, of_u, w)
        relief = w.gamma * opening + (w.s * _normal_stress(u, w) if of_u == 0 else 0.0)
        tilt_u, tilt_v = _tilt(u, of_u, w), _tilt(v, of_v, w)
        slide_u, slide_v = _slide(u, of_u, w), _slide(v, of_v, w)
        turning = w.g / w.m * tilt_u * tilt_v - (1 - w.g * w.kappa / w.m) * (
            tilt_u * slide_v + tilt_v * slide_u + w.kappa * slide_u * slide_v
        )
        return w.share * (w.active * relief * dot(w.n, _jump(v, of_v)) - w.p * turning)

    both = [points.slave, state.mate]
    return asm(form, both, both, **state.fields)


def _finish(points: ContactPoints, state: _State, stiffness: Any, iterations: int) -> MonolithicPosition:
    placed = points.mesh.doflocs.T + state.u[points.unknowns]
    force, internal = state.forces[points.unknowns], (stiffness @ state.u)[points.unknowns]
    wheel = points.of_wheel
    bore = wheel & np.isin(points.unknowns[:, 0], points.fixed)
    return MonolithicPosition(
        status="converged",
        torque_wheel=-_moment((placed - points.wheel_centre)[wheel], force[wheel]),
        torque_pinion=-_moment(placed[~wheel], force[~wheel]),
        torque_wheel_reaction=_moment((placed - points.wheel_centre)[bore], internal[bore]),
        peak_pressure=float(state.pressure.max()),
        iterations=iterations,
        mesh=points.mesh,
        displacement=state.u,
        pressure=state.pressure,
        place=state.projection.place,
    )


def _moment(arm: Array, force: Array) -> float:
    return float(np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))


def _empty(status: str, mesh: Any, iterations: int = 0) -> MonolithicPosition:
    nothing = 0.0 if status == "no_contact" else float("nan")
    none = np.zeros(0)
    return MonolithicPosition(
        status, nothing, nothing, nothing, nothing, iterations, mesh, displacement=none, pressure=none, place=none
    )
