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

Where a law's theta makes stress loads :math:`z = \theta W \gamma^{-1} p`, they join in, :math:`u = C f + S^T z` and
:math:`\sigma_n = S f + T z`. On a multiplier space (`gearfe.contact.multiplier`) the unknowns are its multipliers,
:math:`p = \Psi \lambda`, and the active ones solve :math:`\Psi^T W g = 0`.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import Projection, unreached
from .linearised import Linearised, linearise
from .scene import Scene

__all__ = ["Dialogue", "Linearised", "Outcome", "State", "asked_pressure", "linearise", "newton"]

Array = NDArray[Any]
IntArray = NDArray[Any]

MAX_ITERATIONS = 40
#: Steps beyond are granted where the residual is below `NEAR`: stiff laws at sharp corners may settle slowly.
PATIENCE, NEAR = 120, 1e-3
#: The line search asks for less than the largest of so many residuals: an active set that is nearly settled may need
#: steps that go up before they go down (Grippo, Lampariello & Lucidi, SIAM J. Numer. Anal. 23, 1986). Later than
#: `MEMORY_UNTIL` it is the linear convergence that is left, which such steps only disturb.
MEMORY, MEMORY_UNTIL = 4, 20
#: Newton steps taken in full before the line search watches over them.
FREE_ITERATIONS = 3


@dataclass(frozen=True)
class State:
    """Pressures (Pa), the nodal forces (N) that they make, the displacements (m) that those cause, and foot points.

    Attributes
    ----------
    stress_loads : ndarray, shape (q,) or (0,)
        z at the contact points (N m2), of laws with theta other than 0.
    multipliers : ndarray, shape (m,), or None
        lambda (Pa), of laws on a multiplier space.
    """

    pressure: Array
    forces: Array
    displacement: Array
    place: Array
    stress_loads: Array = field(default_factory=lambda: np.zeros(0))
    multipliers: Array | None = None

    @property
    def unknown(self) -> Array:
        """What Newton's method solves for: the multipliers of a law that has them, else the pressures."""
        return self.pressure if self.multipliers is None else self.multipliers

    def scaled(self, factor: float) -> State:
        """The state at a load `factor` times as large, were the contact linear."""
        return State(
            factor * self.pressure,
            factor * self.forces,
            factor * self.displacement,
            self.place,
            factor * self.stress_loads,
            None if self.multipliers is None else factor * self.multipliers,
        )


def asked_pressure(scene: Scene, projection: Projection, forces: Array, stress_loads: Array | None = None) -> Array:
    """max(0, -gamma g - S f - T z): the pressure that a law at points asks for at this state (Pa)."""
    trial = -scene.parameter * projection.gap
    if len(scene.stress):
        trial -= scene.stress @ forces
    if stress_loads is not None and len(stress_loads):
        trial -= scene.stress_stress @ stress_loads
    trial[unreached(projection.gap)] = 0.0
    return np.maximum(trial, 0.0)


def asked(scene: Scene, projection: Projection, state: State) -> Array:
    """What the law asks the state's unknowns to be (Pa): pressures, or max(0, lambda - c mean gap) of each hat."""
    if scene.hats is None:
        return asked_pressure(scene, projection, state.forces, state.stress_loads)
    assert state.multipliers is not None
    areas = scene.facing(projection)
    stiffness = scene.hats.mean(areas, scene.parameter)
    return np.maximum(state.multipliers - stiffness * scene.hats.mean(areas, projection.gap), 0.0)


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


def newton(scene: Scene, state: State, tolerance: float, most: int = MAX_ITERATIONS) -> Dialogue:
    """Solve one position from `state`, asking for projections by `yield` so that several positions can share them.

    A backtracking line search on the weighted pressure residual watches over all but the first steps.
    """
    residual, past = np.inf, [np.inf]
    projection = yield scene.placed(state.displacement), state.place
    state = _of_law(scene, projection, state)
    wanted = state.unknown  # the guess chooses the first active set; afterwards the law does
    limit = 1e3 * float(scene.weight @ state.pressure)
    for iteration in range(1, PATIENCE + 1):
        if iteration > most and residual > NEAR:
            return Outcome("not_converged", state, projection, iteration - 1)
        active = _active(scene, projection, wanted)
        if len(active) == 0:
            return Outcome("under_resolved", state, projection, iteration)
        lin = linearise(scene, projection, active, state.pressure, scene.placed(state.displacement))
        aim = _step(scene, lin, active, state, projection)
        before = scene.areas(projection.place)
        total = float(scene.weight @ np.abs(aim.pressure))
        if not np.isfinite(total) or total > limit:
            return Outcome("not_converged", state, projection, iteration)
        length, best = 1.0, None
        for _ in range(6):
            tried = _between(state, aim, length)
            found = yield scene.placed(tried.displacement), projection.place
            wish = asked(scene, found, tried)
            areas = scene.areas(found.place)
            shares = areas if scene.hats is None else scene.hats.integrated(scene.facing(found))
            scale = max(float(shares @ wish), 1e-12 * total)
            # sliding past a sharp end changes the areas behind the forces as well
            slid = np.abs(areas - before) @ (wish if scene.hats is None else scene.hats.at_points(wish))
            error = float(shares @ np.abs(tried.unknown - wish) + slid) / scale
            if best is None or error < best[0]:
                best = (error, tried, found, wish)
            if error < (1 - 0.1 * length) * max(past) or iteration <= FREE_ITERATIONS:
                break
            length *= 0.5
        assert best is not None
        residual, state, projection, wanted = best
        past = [*past[-MEMORY + 1 :], residual] if iteration < MEMORY_UNTIL else [residual]
        if residual < max(tolerance, _rounding(scene, state.pressure, projection)):
            return Outcome("converged", state, projection, iteration)
    return Outcome("not_converged", state, projection, PATIENCE)


def _of_law(scene: Scene, projection: Projection, state: State) -> State:
    """The starting state with the multipliers that its pressures make, where the law has them."""
    if scene.hats is None or state.multipliers is not None:
        return state
    return replace(state, multipliers=scene.hats.mean(scene.facing(projection), state.pressure))


def _active(scene: Scene, projection: Projection, wanted: Array) -> IntArray:
    if scene.hats is None:
        return np.flatnonzero((wanted > 0) & ~unreached(projection.gap))
    return np.flatnonzero((wanted > 0) & (scene.hats.integrated(scene.facing(projection)) > 0))


def _rounding(scene: Scene, wanted: Array, projection: Projection) -> float:
    """Smallest residual that rounding lets a law of this stiffness reach: gamma times the last bit of a coordinate."""
    areas = scene.areas(projection.place) * (wanted > 0)
    extent = float(np.abs(scene.points).max())
    return float(np.finfo(float).eps * extent * (areas @ scene.parameter) / max(float(areas @ wanted), 1e-300))


def _between(old: State, new: State, length: float) -> State:
    if length == 1.0:
        return new

    def part(a: Array, b: Array) -> Array:
        return a + length * (b - a) if len(a) else length * b

    return State(
        part(old.pressure, new.pressure),
        part(old.forces, new.forces),
        part(old.displacement, new.displacement),
        new.place,
        part(old.stress_loads, new.stress_loads),
        None if old.multipliers is None or new.multipliers is None else part(old.multipliers, new.multipliers),
    )


def _step(scene: Scene, lin: Linearised, active: IntArray, state: State, projection: Projection) -> State:
    """Solve the linearised contact for the active unknowns."""
    before = state.displacement[lin.unknowns]
    right = -lin.parameter * (lin.gap - lin.opening @ before)
    solved, local = lin.solve(right, -before)
    return assembled(scene, lin, active, solved, local, projection.place)


def assembled(scene: Scene, lin: Linearised, active: IntArray, solved: Array, local: Array, place: Array) -> State:
    """The state with the active unknowns `solved` and the forces `local`, shape (2t,), on all points and nodes."""
    unknown = np.zeros(len(scene.weight) if scene.hats is None else scene.hats.count)
    unknown[active] = solved
    forces = np.zeros(2 * len(scene.points))
    forces[lin.unknowns] = local
    displacement = scene.compliance[:, lin.unknowns] @ local
    if scene.hats is not None:
        return State(scene.hats.at_points(unknown), forces, displacement, place, multipliers=unknown)
    if not scene.theta:
        return State(unknown, forces, displacement, place)
    loads = np.zeros(len(scene.weight))
    loads[active] = lin.relief * solved
    displacement += loads[active] @ scene.stress[active]
    return State(unknown, forces, displacement, place, loads)
