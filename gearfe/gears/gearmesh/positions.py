r"""Positions of a sweep at given twists or at given torques, and their discretisation error.

**The twist of a torque** is searched for by `.load_search`, on many positions at once.

**Discretisation error of the half-plane law**, from the same positions and twists with coarser gears, whose torque is
another by :math:`\delta T`. They are solved: the change to first order, from the energy, is cheaper, but misses two
thirds of it where a sharp edge bears.

With sizes larger by the factor c and errors of order p, one position's error is
:math:`d_i = |\delta T_i/T_i|/(c^p-1)`. Alone that is not to be trusted: both meshes often agree by chance. The
errors are alike at all n positions of a sweep, hence

.. math:: e_i = \max\Big(d_i,\; 2\,\big(\tfrac1n\sum_j d_j^2\big)^{1/2}\Big),

twice the standard deviation, which covers 95 % of what is normally distributed (JCGM 100:2008, *Guide to the
expression of uncertainty in measurement*, 6.2.2). p is 1, the lowest order that was measured.

The signed change :math:`(1 - (T_i + \delta T_i)/T_i)/(c^p-1)` is the **correction** by Richardson's extrapolation.
Alone it says little of one curve. The corrections of two curves on meshes of one kind nearly agree, and their
difference estimates the error of the curves' difference (`gearfe.output.differences`).

**Laws on the elements** start from the half-plane law's solution :math:`T^{HP}` of the same gears, whose contact is on
no mesh. From the truth they are as far as from that, and that from the truth, at most:

.. math:: e_i = |T_i/T_i^{HP} - 1| + e_i^{HP} .

What a law yields by itself (the overlap of a soft penalty) is in it.

Not in it are the errors of the model (plane, no friction, rigid bores, small strain with its first-order correction),
and errors that no refinement of one mesh family shows. In the half-plane law that is the wedge at a sharp tip, 0.2
to 0.4 % where a tip carries load (docs/contact_laws.md). `scripts/benchmarks/measure_curve_accuracy.py` measures
over random pairs how often it covers the true error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, IntArray
from ..contact.compliance import MeshingPair, finite_strain_shares, flank_loads, panel_pressures
from ..contact.elements import solve_elements
from ..contact.half_plane import HalfPlanePair, expected_twists, half_plane_pair, solve_half_plane
from ..contact.laws import COARSENING, HalfPlane
from ..contact.position import ANGLE_ROUNDING, TORQUES, Positions, in_batches, taken
from ..geometry.mesh_geometry import MeshGeometry
from .load_search import Response, newton_twist, search_load

#: Solutions of a position in search of its torque; random pairs, laws and torques took three at most.
MAX_SOLUTIONS = 12
#: Relative miss of a torque from which one step leads to it.
NEARLY = 1e-4
#: Status of a position whose torque was not found although single solutions converged.
NOT_REACHED = "torque_not_reached"


def twists_for_torque(
    solve: Callable[[IntArray, Array], Positions], found: Positions, goal: Array, *, first_contact: Array, most: float
) -> Positions:
    """Return positions that nearly (`NEARLY`) carry given torques; iterations are those of all solutions.

    Parameters
    ----------
    solve
        ``solve(numbers, twists)`` gives the positions of these numbers.
    found
        Solutions at first guesses of the twist.
    goal : ndarray, shape (n,)
        Torques at the wheel (N m), > 0.
    first_contact : ndarray, shape (n,)
        Twists (rad) at which the rigid flanks touch.
    most
        Largest twist tried (rad).
    """
    solved = found

    def evaluate(numbers: IntArray, twists: Array) -> Response:
        nonlocal solved
        again = solve(numbers, twists)
        iterations = again.iterations + solved.iterations[numbers]
        solved = solved.replaced(numbers, replace(again, iterations=iterations))
        return Response(again.torque_wheel, again.tangent)

    _, _, missed = search_load(
        evaluate,
        found.twist,
        Response(found.torque_wheel, found.tangent),
        goal,
        first_contact=first_contact,
        most=most,
        near=NEARLY,
        rounding=ANGLE_ROUNDING,
        evaluations=MAX_SOLUTIONS,
    )
    status = np.where(np.isin(np.arange(len(goal)), missed), NOT_REACHED, solved.status)
    return solved.with_status(status) if len(missed) else solved


NONE: IntArray = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class PositionSolver:
    """Positions of one pair of gears by a contact law.

    Attributes
    ----------
    elastic
        The gears.
    contact_model
        The gears as the half-plane law sees them.
    on_elements
        Whether the law is one on the finite elements of the flanks; it starts from the half-plane law's loads.
    """

    elastic: MeshingPair
    contact_model: HalfPlanePair
    on_elements: bool

    @property
    def pair(self) -> MeshGeometry:
        """Geometry of the gears."""
        return self.contact_model.pair

    @property
    def half_plane(self) -> PositionSolver:
        """The solver of the same gears by the half-plane law."""
        return replace(self, on_elements=False)

    def solve(self, angles: Array, twists: Array, kept: IntArray = NONE) -> Positions:
        r"""Positions at pinion angles and twists (rad), both of shape (n,); those numbered `kept` with loads.

        For laws on elements the half-plane law tells which tooth pairs bear, with the forces :math:`F_k`, and how wide
        their contacts are (:math:`2b_k`). Where

        .. math:: \sum_k F_k\,\frac{h_k}{2b_k} > \sum_k F_k

        with the longer of both flanks' elements there, :math:`h_k`, the contact is narrower than an element. The torque
        then swings with the place of the nodes (docs/contact_laws.md), and the position is ``under_resolved``.
        """
        every = np.arange(len(angles))
        if not self.on_elements:
            return self._with_loads(solve_half_plane(self.contact_model, angles, twists), kept)
        expected = self.half_plane.solve(angles, twists, every)
        thin = (expected.status == "converged") & (self.elements_per_contact(expected) < 1.0)
        expected = expected.with_status(np.where(thin, "under_resolved", expected.status))
        found = in_batches(lambda part: solve_elements(self.elastic, expected.take(part)), len(angles))
        return found.with_loads(np.isin(every, kept))

    def _with_loads(self, found: Positions, kept: IntArray) -> Positions:
        """Positions of the half-plane law, those numbered `kept` with loads."""
        if len(kept) == 0:
            return found
        loaded = taken(found.contacts, np.isin(found.contacts.position, kept))
        loads = flank_loads(self.elastic, loaded, found.pinion_angle, found.twist)
        return replace(found, loads=loads, points=panel_pressures(self.elastic, loaded))

    def elements_per_contact(self, found: Positions) -> Array:
        """Elements that see the contact of positions of `half_plane`, shape (n,): harmonic means, by force, over their
        tooth pairs; NaN without contact.
        """
        contacts = found.contacts
        sizes = np.zeros(len(contacts))
        for gear, body in enumerate(self.elastic.bodies):
            edge, _ = body.flank.place(contacts.arc[:, gear])
            sizes = np.maximum(sizes, body.flank.sizes[edge])
        weights = contacts.force, contacts.force * sizes / (2 * contacts.half_width)
        force, spread = (np.bincount(contacts.position, weight, len(found)) for weight in weights)
        return np.divide(force, spread, out=np.full(len(found), np.nan), where=spread > 0)


def position_solver(elastic: MeshingPair) -> PositionSolver:
    """The solver of the elastic pair's law."""
    return PositionSolver(elastic, half_plane_pair(elastic), not isinstance(elastic.law, HalfPlane))


def at_twists(
    solver: PositionSolver, angles: Array, twists: Array, *, kept: IntArray = NONE, finite: bool = False
) -> Positions:
    """Solve positions at given twists.

    Parameters
    ----------
    solver : PositionSolver
        The gears.
    angles, twists : ndarray, shape (n,)
        Pinion angles, and twists from the centred position (rad).
    kept
        Numbers of the positions with loads; all have them where finite strain counts.
    finite : bool
        Whether the torque has the effect of finite strain.
    """
    solved = solver.solve(angles, twists, np.arange(len(angles)) if finite else kept)
    return solved.raised(finite_strain_shares(solver.elastic, solved)) if finite else solved


def at_torques(
    solver: PositionSolver,
    angles: Array,
    torques: Array,
    *,
    kept: IntArray = NONE,
    finite: bool = False,
) -> Positions:
    """Solve positions that carry given torques.

    The half-plane law predicts the twist; laws on elements start from its solution, so that their loads are near the
    goal. The twist is improved until the torque is off by no more than `NEARLY`. The last step is Newton's, whose error
    is some hundredths of the square of the step. Finite strain changes the torque by a share c, which grows about as
    the torque does: at the goal T of the whole, small strain carries T/(1 + c') with c' = c/(1 + c). What that misses
    is of the second order in c, as is what the share itself leaves out.

    Parameters
    ----------
    solver : PositionSolver
        The gears.
    angles : ndarray, shape (n,)
        Pinion angles (rad).
    torques : ndarray, shape (n,)
        At the wheel (N m), > 0.
    kept
        Numbers of the positions with loads; all have them where finite strain counts.
    finite : bool
        Whether the torque has the effect of finite strain.
    """
    kept = np.arange(len(angles)) if finite else kept
    first_contact, most = solver.contact_model.first_contact_twists(angles), math.pi / solver.pair.wheel.tooth_count

    def solve(numbers: IntArray, twists: Array) -> Positions:
        return solver.solve(angles[numbers], twists, np.flatnonzero(np.isin(numbers, kept)))

    if solver.on_elements:
        first = at_torques(solver.half_plane, angles, torques).twist
    else:
        first = expected_twists(solver.contact_model, torques, solver.contact_model.first_contacts(angles))
    found = solve(np.arange(len(angles)), np.minimum(first, most))
    found = twists_for_torque(solve, found, torques, first_contact=first_contact, most=most)
    if finite:
        share = finite_strain_shares(solver.elastic, found)
        share = share / (1 + share)
        found = twists_for_torque(solve, found, torques / (1 + share), first_contact=first_contact, most=most)
        found = found.raised(share)
    return closed(found, torques, first_contact)


def closed(found: Positions, goal: Array, first_contact: Array) -> Positions:
    """Positions whose torques are nearly the goals, brought there by the last small step of their twists.

    Moments change with the torque, the energy by the work, loads and contacts of the half-plane law at their own rates.
    """
    good = found.status == "converged"
    factor = np.where(good, goal / np.where(good, found.torque_wheel, 1.0), 1.0)
    moments = {name: getattr(found, name) * factor for name in TORQUES if name != "tangent"}
    moments["torque_wheel"] = np.where(good, goal, found.torque_wheel)
    twist = newton_twist(found.twist, first_contact, Response(found.torque_wheel, found.tangent), goal)
    twist = np.where(good, twist, found.twist)
    by = twist - found.twist
    energy = found.energy + 0.5 * (found.torque_wheel + moments["torque_wheel"]) * by
    loads = tuple(replace(one, force=one.force + by[one.position, None] * one.rate) for one in found.loads)
    contacts = found.contacts.moved(by)
    whole = np.bincount(contacts.position, contacts.torque_wheel, len(found))  # up to the error of the step
    right = moments["torque_wheel"][contacts.position] / whole[contacts.position]
    contacts = replace(contacts, torque_wheel=contacts.torque_wheel * right)
    return replace(found, twist=twist, energy=energy, contacts=contacts, loads=loads, **moments)


def checked_contact(solver: PositionSolver, found: Positions) -> Positions:
    """Mark positions without contact whose exact rigid flanks overlap, and take all numbers off failed ones."""
    first_contact = solver.contact_model.first_contact_twists(found.pinion_angle)
    overlap = (found.status == "no_contact") & (found.twist > first_contact + ANGLE_ROUNDING)
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


#: Assumed order of convergence p.
ORDER = 1.0
#: Standard deviations that cover 95 %.
COVERAGE = 2.0


class CurveError(NamedTuple):
    """Relative errors of solved positions (-), and signed relative corrections of their torques; shape (n,)."""

    error: Array
    correction: Array


def curve_error(solver: PositionSolver, coarse: MeshingPair, solved: Positions, *, finite: bool) -> CurveError:
    """Estimate the relative error of solved positions by coarser gears, see the module's docstring.

    Parameters
    ----------
    solver : PositionSolver
        The gears.
    coarse : MeshingPair
        Coarser gears.
    solved : Positions
        n solved positions.
    finite : bool
        Whether the torque has the effect of finite strain.

    Returns
    -------
    CurveError
        NaN for positions that did not converge.
    """
    numbers = np.flatnonzero(solved.status == "converged")
    estimate, signed = np.full(len(solved), np.nan), np.full(len(solved), np.nan)
    if len(numbers) == 0:
        return CurveError(estimate, signed)
    own = chosen = solved.take(numbers)
    by_law = np.zeros(len(numbers))
    if solver.on_elements:
        own = at_twists(solver.half_plane, chosen.pinion_angle, chosen.twist, finite=finite)
        by_law = own.torque_wheel / chosen.torque_wheel - 1
    again = at_twists(position_solver(coarse).half_plane, own.pinion_angle, own.twist, finite=finite)
    refined = (1 - again.torque_wheel / own.torque_wheel) / (COARSENING**ORDER - 1)
    error = np.fmax(np.abs(refined), COVERAGE * np.sqrt(np.nanmean(refined**2)))
    if solver.on_elements:
        error += np.abs(chosen.torque_wheel / own.torque_wheel - 1)
    unseen = unseen_twists(solver.contact_model, own) * np.abs(chosen.tangent / chosen.torque_wheel)
    estimate[numbers], signed[numbers] = error + unseen, by_law + refined
    return CurveError(estimate, signed)


def unseen_twists(contact_model: HalfPlanePair, found: Positions) -> Array:
    """Return the twists (rad) from the first touch that are below the resolution of the half-plane law, shape (n,).
    They come from the rounding of the gears' angles, and from the difference of the tabulated flanks from the exact
    ones.
    """
    contacts, worst = found.contacts, np.zeros(len(found))
    tables = contact_model.tables.of(contact_model.teeth.flank(contacts.pair))
    missed = tables.misses.take(tables.piece_at(contacts.arc[:, :, None])).sum(axis=(1, 2))
    np.maximum.at(worst, contacts.position, missed)
    return ANGLE_ROUNDING + worst / contact_model.pair.wheel.base_radius
