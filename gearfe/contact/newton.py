r"""Semi-smooth Newton's method for one position of two elastic gears in contact.

Unknown are the pressures p at the contact points. With the rows G = n.D of the gap's variation, the areas W, the
compliance C of the flanks and the stress rows S (stress for forces),

.. math::
    f = G(u)^T W p, \qquad u = C f, \qquad p = \max(0, -\gamma g(u) - S f).

Linearised at (u, p), with the moving normals' part H of the tangent, the active points solve

.. math::
    (I + (\gamma\, \partial_u g\, C + S) G^T W)\, p = -\gamma (g - \partial_u g\, u) - (\gamma\, \partial_u g\, C + S)
    d, \qquad d = H (u^+ - u),

where d, a small correction, is iterated within the step on one factorisation (Alart & Curnier, Comput. Methods Appl.
Mech. Eng. 92, 1991, in the few hundred unknowns that touch).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from .closest import Projection, gap_rows, unreached
from .scene import Scene

Array = NDArray[Any]
IntArray = NDArray[Any]

MAX_ITERATIONS = 40
#: Newton steps taken in full before the line search watches over them.
FREE_ITERATIONS = 3
#: Inner corrections of each step for the moving normals; each gains two to three digits.
CORRECTIONS = 3


@dataclass(frozen=True)
class State:
    """Pressures (Pa), the nodal forces (N) that they make, the displacements (m) that those cause, and foot points."""

    pressure: Array
    forces: Array
    displacement: Array
    place: Array

    def scaled(self, factor: float) -> State:
        """The state at a load `factor` times as large, were the contact linear."""
        return State(factor * self.pressure, factor * self.forces, factor * self.displacement, self.place)


@dataclass(frozen=True)
class Linearised:
    """The active points at one state, on the unknowns of the t nodes that they touch.

    Attributes
    ----------
    unknowns : ndarray, shape (2t,)
    opening : ndarray, shape (a, 2t)
        dg/du of the active points.
    weighted : ndarray, shape (2t, a)
        G^T W.
    response : ndarray, shape (a, 2t)
        gamma dg/du C + S.
    normal : ndarray, shape (a, 2t)
        G.
    cut : ndarray, shape (a,)
        Change of each point's load per unit of the foot point, where its stretch lies across a sharp end (N).
    """

    unknowns: IntArray
    opening: Array
    weighted: Array
    tilt: Array
    slide: Array
    projection: Projection
    loads: Array
    parameter: Array
    compliance: Array
    response: Array
    factor: Any
    normal: Array
    cut: Array

    def solve(self, right: Array) -> Array:
        """Pressures of the active points for a right-hand side."""
        return dgetrs(*self.factor, right, trans=1)[0]

    def bending(self, change: Array) -> Array:
        """H change: how the contact forces turn and move when the touched nodes move by `change`, shape (2t,)."""
        p = self.projection
        metric = p.tangent[:, 0] ** 2 + p.tangent[:, 1] ** 2
        tilt, slide = self.tilt @ change, self.slide @ change
        share = 1 - p.gap * p.curvature / metric
        to_slide = -share * (tilt + p.curvature * slide)
        to_tilt = -share * slide + p.gap / metric * tilt
        bent = (self.loads * to_slide) @ self.slide + (self.loads * to_tilt) @ self.tilt
        return bent + (self.cut * slide) @ self.normal if self.cut.any() else bent


def linearise(scene: Scene, projection: Projection, active: IntArray, pressure: Array) -> Linearised:
    """Rows and factorised matrix of the active points."""
    chosen = projection.take(active)
    rows = gap_rows(chosen, scene.slave_nodes[active], scene.slave_shapes[active], scene.rotation)
    touched = np.zeros(len(scene.points), dtype=bool)
    touched[rows.nodes] = True
    nodes = np.flatnonzero(touched)
    place = np.empty(len(touched), dtype=np.int64)
    place[nodes] = np.arange(len(nodes))
    # the two edges of a point belong to different teeth: no slot of the dense rows is met twice
    slot = np.arange(len(active))[:, None] * len(nodes) + place[rows.nodes]
    spread = np.zeros((3, len(active) * len(nodes), 2))
    spread[0, slot], spread[1, slot], spread[2, slot] = rows.normal, rows.tilt, rows.slide
    normal, tilt, slide = spread.reshape(3, len(active), 2 * len(nodes))
    steep = chosen.normal[:, 0] * chosen.tangent[:, 0] + chosen.normal[:, 1] * chosen.tangent[:, 1]
    opening = normal - steep[:, None] * slide
    unknowns = np.empty(2 * len(nodes), dtype=np.int64)
    unknowns[::2], unknowns[1::2] = 2 * nodes, 2 * nodes + 1
    areas, gamma = scene.areas(projection.place)[active], scene.parameter[active]
    compliance = scene.compliance.take(unknowns, axis=0).take(unknowns, axis=1)
    response = (gamma[:, None] * opening) @ compliance
    if len(scene.stress):
        response += scene.stress.take(active, axis=0).take(unknowns, axis=1)
    weighted = np.ascontiguousarray((normal * areas[:, None]).T)
    matrix = response @ weighted
    matrix.flat[:: len(matrix) + 1] += 1.0
    # the transposed matrix is what LAPACK sees in C order: factorise that, solve transposed, and nothing is copied
    factor = dgetrf(matrix.T, overwrite_a=1)[:2]
    loads = areas * pressure[active]
    across = (areas > 0) & (areas < scene.weight[active])
    cut = np.where(across, -scene.weight[active] / (2 * scene.fade[active]) * pressure[active], 0.0)
    return Linearised(
        unknowns, opening, weighted, tilt, slide, chosen, loads, gamma, compliance, response, factor, normal, cut
    )


def asked_pressure(scene: Scene, projection: Projection, forces: Array) -> Array:
    """max(0, -gamma g - S f): the pressure that the law asks for at this state (Pa)."""
    trial = -scene.parameter * projection.gap
    if len(scene.stress):
        trial -= scene.stress @ forces
    trial[unreached(projection.gap)] = 0.0
    return np.maximum(trial, 0.0)


@dataclass(frozen=True)
class Outcome:
    """End of an iteration: ``converged``, ``not_converged`` or ``under_resolved`` (no point is left in contact).

    Attributes
    ----------
    state, projection
        Last state and the closest points at its displacements.
    iterations
        Newton steps.
    """

    status: str
    state: State
    projection: Projection
    iterations: int


#: A solver yields (node places, foot points) and is sent the projection of its scene's contact points.
Dialogue = Generator[tuple[Array, Array], Projection, Outcome]


def newton(scene: Scene, state: State, tolerance: float) -> Dialogue:
    """Solve one position from `state`, asking for projections by `yield` so that several positions can share them.

    A backtracking line search on the weighted pressure residual watches over all but the first steps.
    """
    residual = np.inf
    projection = yield scene.placed(state.displacement), state.place
    wanted = state.pressure  # the guess chooses the first active set; afterwards the law does
    limit = 1e3 * float(scene.weight @ state.pressure)
    for iteration in range(1, MAX_ITERATIONS + 1):
        active = np.flatnonzero((wanted > 0) & ~unreached(projection.gap))
        if len(active) == 0:
            return Outcome("under_resolved", state, projection, iteration)
        lin = linearise(scene, projection, active, state.pressure)
        aim = _step(scene, lin, active, projection, state)
        before = scene.areas(projection.place)
        total = float(scene.weight @ np.abs(aim.pressure))
        if not np.isfinite(total) or total > limit:
            return Outcome("not_converged", state, projection, iteration)
        length, best = 1.0, None
        for _ in range(6):
            tried = _between(state, aim, length)
            found = yield scene.placed(tried.displacement), projection.place
            asked = asked_pressure(scene, found, tried.forces)
            areas = scene.areas(found.place)
            scale = max(float(areas @ asked), 1e-12 * total)
            # sliding past a sharp end changes the areas behind the forces as well
            error = float(areas @ np.abs(tried.pressure - asked) + np.abs(areas - before) @ asked) / scale
            if best is None or error < best[0]:
                best = (error, tried, found, asked)
            if error < (1 - 0.1 * length) * residual or iteration <= FREE_ITERATIONS:
                break
            length *= 0.5
        assert best is not None
        residual, state, projection, wanted = best
        if residual < max(tolerance, _rounding(scene, wanted, projection)):
            return Outcome("converged", state, projection, iteration)
    return Outcome("not_converged", state, projection, MAX_ITERATIONS)


def _rounding(scene: Scene, wanted: Array, projection: Projection) -> float:
    """Smallest residual that rounding lets a law of this stiffness reach: gamma times the last bit of a coordinate."""
    areas = scene.areas(projection.place) * (wanted > 0)
    extent = float(np.abs(scene.points).max())
    return float(np.finfo(float).eps * extent * (areas @ scene.parameter) / max(float(areas @ wanted), 1e-300))


def _between(old: State, new: State, length: float) -> State:
    if length == 1.0:
        return new
    return State(
        old.pressure + length * (new.pressure - old.pressure),
        old.forces + length * (new.forces - old.forces),
        old.displacement + length * (new.displacement - old.displacement),
        new.place,
    )


def _step(scene: Scene, lin: Linearised, active: IntArray, projection: Projection, state: State) -> State:
    """Solve the linearised contact for the active points; d is iterated on the same factorisation."""
    before = state.displacement[lin.unknowns]
    right = -lin.parameter * (projection.gap[active] - lin.opening @ before)
    turned = np.zeros(len(lin.unknowns))
    for correction in range(CORRECTIONS):
        solved = lin.solve(right - lin.response @ turned if correction else right)
        local = lin.weighted @ solved + turned
        if correction + 1 < CORRECTIONS:
            turned = lin.bending(lin.compliance @ local - before)
    pressure = np.zeros(len(scene.weight))
    pressure[active] = solved
    forces = np.zeros(2 * len(scene.points))
    forces[lin.unknowns] = local
    return State(pressure, forces, scene.compliance[:, lin.unknowns] @ local, projection.place)
