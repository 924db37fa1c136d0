r"""Positions of a sweep solved in batches, at given twists or at given torques.

**The twist of a torque** by safeguarded Newton's method on many positions at once. The torque T rises with the twist,
from nothing where the rigid flanks just touch. With the deflection :math:`\delta` beyond that, :math:`\ln\delta` is
nearly straight over :math:`\ln T` for line contacts; Newton's step there,

.. math:: \delta^+ = \delta\,(T_0/T)^{T/(\delta\,T')},

is taken with the solver's own tangent T' where it stays between the largest twist that was too little and the smallest
that was too much; otherwise the interval is halved, or the deflection doubled while nothing has been too much yet.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..contact.compliance import MeshingPair, finite_strain_shares, flank_loads, panel_pressures
from ..contact.elements import solve_elements
from ..contact.half_plane import HalfPlanePair, expected_twists, half_plane_pair, solve_half_plane
from ..contact.laws import HalfPlane
from ..contact.position import ANGLE_ROUNDING, TORQUES, Positions, joined, of_positions, taken, together
from ..errors import InputError
from ..gear.derived import mesh_stiffness
from ..gear.face import NOMINAL
from ..gear.touching import Touching
from ..gear.validity import MOST_YIELD
from ..progress import count
from ..typing import Array, IntArray

#: Solutions of a position in search of its torque; random pairs, laws and torques took three at most.
MAX_SOLUTIONS = 12
#: Relative miss of a torque from which one step leads to it.
NEARLY = 1e-4
#: Status of a position whose torque was not found although single solutions converged.
NOT_REACHED = "torque_not_reached"


def newton_twist(twist: Array, touching: Array, torque: Array, tangent: Array, goal: Array) -> Array:
    """Newton's step above, shape (n,) (rad); not-a-number without a torque."""
    with np.errstate(all="ignore"):
        delta = twist - touching
        return np.asarray(touching + delta * (goal / torque) ** (torque / (delta * tangent)))


def twists_for_torque(
    solve: Callable[[IntArray, Array], Positions], found: Positions, goal: Array, *, touching: Array, most: float
) -> Positions:
    """Bring positions nearly (`NEARLY`) to the torques `goal`, shape (n,), > 0 (N m); iterations are those of all.

    Parameters
    ----------
    solve
        ``solve(numbers, twists)`` gives the positions of these numbers.
    found
        Solutions at first guesses of the twist.
    touching : ndarray, shape (n,)
        Twists (rad) at which the rigid flanks touch.
    most
        Largest twist tried (rad).
    """
    low, high = touching.copy(), np.full(len(goal), np.inf)
    for solutions in range(MAX_SOLUTIONS + 1):
        twist, torque = found.twist, found.torque_wheel
        miss, seen = torque - goal, np.nan_to_num(ANGLE_ROUNDING * found.tangent)
        open_ = np.flatnonzero(np.abs(miss) > np.maximum(NEARLY * goal, seen))  # none that failed
        if len(open_) == 0 or solutions == MAX_SOLUTIONS:
            break
        low, high = np.where(miss < 0, twist, low), np.where(miss > 0, twist, high)
        step = newton_twist(twist, touching, torque, found.tangent, goal)
        between = np.where(np.isfinite(high), 0.5 * (low + high), np.clip(2 * twist - touching, twist, most))
        step = np.where((low < step) & (step < high), np.minimum(step, most), between)
        made = solve(open_, step[open_])
        found = found.replaced(open_, replace(made, iterations=made.iterations + found.iterations[open_]))
    status = np.where(np.isin(np.arange(len(goal)), open_), NOT_REACHED, found.status)
    return found.with_status(status) if len(open_) else found


NONE: IntArray = np.zeros(0, dtype=np.int64)


def position_solver(elastic: MeshingPair) -> PositionSolver:
    """The solver of the elastic pair's law."""
    half_plane = HalfPlaneSolver(half_plane_pair(elastic), elastic)
    return half_plane if isinstance(elastic.law, HalfPlane) else ElementSolver(half_plane)


#: Pinion angles of a mesh cycle at which flanks with deviations are looked at for their first touch.
LOOKS = 24
#: Angles whose first touch is searched for at once: that takes kilobytes for each.
AT_ONCE = 512


class HalfPlaneSolver:
    """Positions of one pair by the half-plane law; without the elastic gears there are no loads on nodes."""

    def __init__(self, law: HalfPlanePair, elastic: MeshingPair | None = None) -> None:
        self.pair, self._elastic, self.law = law.pair, elastic, law
        self._angles = np.zeros(0)
        self._known: list[Touching] = []

    @property
    def elastic(self) -> MeshingPair:
        """The elastic gears."""
        assert self._elastic is not None
        return self._elastic

    def solve(self, angles: Array, twists: Array, kept: IntArray = NONE) -> Positions:
        """Positions at pinion angles and twists (rad), both of shape (n,); those numbered `kept` with loads."""
        found = solve_half_plane(self.law, angles, twists, touching=self.touching(angles))
        if len(kept) == 0:
            return found
        loaded = taken(found.contacts, np.isin(found.contacts.position, kept))
        loads = flank_loads(self.elastic, loaded, found.pinion_angle, found.twist)
        return replace(found, loads=loads, points=panel_pressures(self.elastic, loaded))

    def touching_twists(self, angles: Array) -> Array:
        """Twists (rad) at which the rigid gears just touch."""
        found = self.touching(angles)
        made = np.full(len(angles), math.inf)
        np.minimum.at(made, found.position, found.twist)
        return made

    def first_touch(self, angles: Array) -> float:
        """Twist (rad) that stiffness counts from: where unmodified flanks touch, or before, what stands out of them.

        The first touch of the mesh cycle, these pinion angles (rad) among it.
        """
        free = self.pair.contact_twist
        if self.elastic.deviations == NOMINAL:
            return free
        every = np.concatenate([angles, self.pair.mesh_cycle * np.arange(LOOKS) / LOOKS])
        return float(min(free, self.touching_twists(every).min()))

    def touching(self, angles: Array) -> Touching:
        """Tooth pairs whose rigid flanks can meet at pinion angles (rad), by position; searched for once an angle."""
        every = np.setdiff1d(angles, self._angles)
        for start in range(0, len(every) if self._known else max(1, len(every)), AT_ONCE):
            new = every[start : start + AT_ONCE]
            found = self.law.teeth.touching(new)
            self._known.append(replace(found, position=found.position + len(self._angles)))
            self._angles = np.concatenate([self._angles, new])
        self._known = [joined(self._known)]
        order = np.argsort(self._angles)
        return of_positions(self._known[0], order[np.searchsorted(self._angles, angles, sorter=order)])


class ElementSolver:
    r"""Positions of one pair by a law on the finite elements of its flanks, where these resolve the contact.

    The half-plane law of the same gears tells beforehand which tooth pairs bear, with the forces :math:`F_k`, and how
    wide their contacts are (:math:`2b_k`). Where

    .. math:: \sum_k F_k\,\frac{h_k}{2b_k} > \sum_k F_k

    with the longer of both flanks' elements there, :math:`h_k`, the contact is narrower than an element. The torque
    then swings with the place of the nodes (docs/contact_laws.md), and the position is ``under_resolved``.
    """

    def __init__(self, half_plane: HalfPlaneSolver) -> None:
        self.half_plane, self.elastic = half_plane, half_plane.elastic
        self.pair, self.law = half_plane.pair, half_plane.law
        self.touching, self.touching_twists = half_plane.touching, half_plane.touching_twists
        self.first_touch = half_plane.first_touch

    def solve(self, angles: Array, twists: Array, kept: IntArray = NONE) -> Positions:
        """Positions at pinion angles and twists (rad), both of shape (n,); those numbered `kept` with loads."""
        expected = self.half_plane.solve(angles, twists, kept=np.arange(len(angles)))
        thin = (expected.status == "converged") & (self.elements_per_contact(expected) < 1.0)
        expected = expected.with_status(np.where(thin, "under_resolved", expected.status))
        return solve_elements(self.elastic, expected).with_loads(np.isin(np.arange(len(angles)), kept))

    def elements_per_contact(self, found: Positions) -> Array:
        """Elements that see the contact of positions of `half_plane`, shape (n,): harmonic means, by force, over their
        tooth pairs; not-a-number without contact.
        """
        contacts = found.contacts
        sizes = np.zeros(len(contacts))
        for gear, body in enumerate(self.elastic.bodies):
            edge, _ = body.flank.place(contacts.arc[:, gear])
            sizes = np.maximum(sizes, body.flank.sizes[edge])
        weights = contacts.force, contacts.force * sizes / (2 * contacts.half_width)
        force, spread = (np.bincount(contacts.position, weight, len(found)) for weight in weights)
        return np.divide(force, spread, out=np.full(len(found), np.nan), where=spread > 0)


PositionSolver = HalfPlaneSolver | ElementSolver


#: Positions handed to the solver at once: enough to work side by side, few enough to stay small in memory.
BATCH = 128


def in_batches(solver: PositionSolver, angles: Array, twists: Array, kept: IntArray = NONE) -> Positions:
    """Positions at pinion angles and twists, both of shape (n,) (rad); those numbered `kept` with loads."""
    made = []
    for start in range(0, max(1, len(angles)), BATCH):
        part = slice(start, start + BATCH)
        made.append(solver.solve(angles[part], twists[part], kept - start))
        count(min(start + BATCH, len(angles)), len(angles), "positions")
    return together(made)


def at_twists(solver: PositionSolver, angles: Array, twists: Array, *, finite: bool = False) -> Positions:
    """Positions at pinion angles and twists, both of shape (n,) (rad); with or without finite strain."""
    found = in_batches(solver, angles, twists, np.arange(len(angles)) if finite else NONE)
    return found.raised(finite_strain_shares(solver.elastic, found)) if finite else found


def check_torque(law: HalfPlanePair, torque: float, name: str = "torque") -> None:
    """Raise `InputError` for a torque (N m) that small strain is not meant for."""
    pair = law.pair
    stiffness = mesh_stiffness(pair, *(1 / law.inverse_modulus)) * law.width
    most = MOST_YIELD * pair.pinion.module * stiffness * pair.wheel.base_radius
    if torque > most:
        problem = f"must be <= {most:.3g} N m: the teeth would yield by more than {MOST_YIELD:g} modules"
        raise InputError(name, torque, problem, "linear elasticity does not reach so far; give less")


def at_torques(
    solver: PositionSolver,
    angles: Array,
    torques: Array,
    *,
    kept: IntArray = NONE,
    finite: bool = False,
) -> Positions:
    """Positions at pinion angles (rad) that carry torques (N m), both of shape (n,); with or without finite strain.

    The twist is expected by the half-plane law (laws on elements start from its solution, so that they are asked for
    loads near the goal) and searched for until the torque is off by no more than `NEARLY`; the last step is Newton's,
    whose error is some hundredths of the square of the step. Finite strain changes the torque by a share c, which grows
    about as the torque does: at the goal T of the whole, small strain carries T/(1 + c') with c' = c/(1 + c). What that
    misses is of the second order in c, as is what the share itself leaves out.

    Parameters
    ----------
    kept
        Numbers of the positions with loads; all have them where finite strain counts.
    """
    kept = np.arange(len(angles)) if finite else kept
    touching, most = solver.touching_twists(angles), math.pi / solver.pair.wheel.teeth

    def solve(numbers: IntArray, twists: Array) -> Positions:
        return in_batches(solver, angles[numbers], twists, np.flatnonzero(np.isin(numbers, kept)))

    if isinstance(solver, ElementSolver):
        first = at_torques(solver.half_plane, angles, torques).twist
    else:
        first = expected_twists(solver.law, torques, solver.touching(angles))
    found = solve(np.arange(len(angles)), np.minimum(first, most))
    found = twists_for_torque(solve, found, torques, touching=touching, most=most)
    if finite:
        share = finite_strain_shares(solver.elastic, found)
        share = share / (1 + share)
        found = twists_for_torque(solve, found, torques / (1 + share), touching=touching, most=most)
        found = found.raised(share)
    return closed(found, torques, touching)


def closed(found: Positions, goal: Array, touching: Array) -> Positions:
    """Positions whose torques are nearly the goals, brought there by the last small step of their twists.

    Moments change with the torque, the energy by the work, loads and contacts of the half-plane law at their own rates.
    """
    good = found.status == "converged"
    factor = np.where(good, goal / np.where(good, found.torque_wheel, 1.0), 1.0)
    moments = {name: getattr(found, name) * factor for name in TORQUES if name != "tangent"}
    moments["torque_wheel"] = np.where(good, goal, found.torque_wheel)
    twist = newton_twist(found.twist, touching, found.torque_wheel, found.tangent, goal)
    twist = np.where(good, twist, found.twist)
    by = twist - found.twist
    energy = found.energy + 0.5 * (found.torque_wheel + moments["torque_wheel"]) * by
    loads = tuple(replace(one, force=one.force + by[one.position, None] * one.rate) for one in found.loads)
    contacts = found.contacts.moved(by)
    whole = np.bincount(contacts.position, contacts.torque_wheel, len(found))  # but for what the step errs
    right = moments["torque_wheel"][contacts.position] / whole[contacts.position]
    contacts = replace(contacts, torque_wheel=contacts.torque_wheel * right)
    return replace(found, twist=twist, energy=energy, contacts=contacts, loads=loads, **moments)


def checked_contact(solver: PositionSolver, found: Positions) -> Positions:
    """Mark positions without contact whose exact rigid flanks overlap, and take all numbers off failed ones."""
    touching = solver.touching_twists(found.pinion_angle)
    overlap = (found.status == "no_contact") & (found.twist > touching + ANGLE_ROUNDING)
    return found.with_status(np.where(overlap, "not_converged", found.status))


def load_shares(found: Positions) -> tuple[Array, Array]:
    """Number of the leading pair of each position, and the shares of it and of the pairs behind it."""
    contacts, count = found.contacts, len(found)
    carry = contacts.torque_wheel > 0
    position, pair = contacts.position[carry], contacts.pair[carry]
    leading = np.full(count, -np.inf)
    np.maximum.at(leading, position, pair)
    behind = leading[position].astype(np.int64) - pair
    shares = np.zeros((count, int(behind.max(initial=0)) + 1))
    np.add.at(shares, (position, behind), contacts.torque_wheel[carry] / found.torque_wheel[position])
    leading[np.isinf(leading)] = np.nan
    shares[np.isnan(found.torque_wheel)] = np.nan
    return leading, shares
