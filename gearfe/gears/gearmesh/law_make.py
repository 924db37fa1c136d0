"""A mesh law from contact solutions of the half-plane law: which positions, and the pair forces in them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from ..contact.half_plane import HalfPlanePair, coupling_compliances, solve_half_plane
from ..contact.position import Positions, joined, taken, together
from ..geometry.first_contact import FirstContacts
from .law import NO_CONTACT, MeshLaw
from .law_fit import LEAST_FORCE, Couple, PairForces, TouchCurve, fit_law, touch_cubics

#: Initial cells of the phase in a mesh cycle, and places in each (parts of its width) of the solutions it is fitted to.
CELLS, PLACES = 12, (0.25, 0.75)
#: Their approaches beyond the first touch, in parts of the largest: small ones show how a pair comes into contact.
DEPTHS = (0.0025, 0.008, 0.025, 0.06, 0.12, 0.2, 0.32, 0.5, 0.75, 1.0)
#: Contact solutions in each new cell that check the law. In each cell of the final law: evenly spread ones, and those
#: of so many samples where the last fit, to checks of the former law, changes the force most: errors are large there.
CHECKS, FINAL_CHECKS, GUIDED_CHECKS, SAMPLES = 18, 6, 4, 100
#: Least approach of checks, in parts of that of the asked force; the logarithm of the others falls to it by this power
#: of an even distribution, as errors at less than a tenth of the asked force count less.
LEAST_CHECK, DEEP = 0.0015, 1.5
#: The points i (s, s^2) mod 1, 1/s the root of x^3 = x + 1, fill the unit square of place and approach evenly in any
#: stretch of the sequence (M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018): checks of
#: neighbouring cells differ, so that no error lies between the places and approaches of all of them.
SPREAD = (0.7548776662466927, 0.5698402909980532)
#: Further checks of this number at each angle where a further pair touches by these parts of the reach after the first
#: one, found among so many samples of each cell.
CHANGE_CHECKS, LATE, CHANGE_SAMPLES = 6, (0.01, 0.1, 0.4, 0.9), 100
#: Relative error of force and torque in a check from which on its cell is halved: that of contacts on elements of the
#: default sizes (0.11 % in the shipped pair).
TOLERANCE = 1e-3
#: Error of the first-contact curve's cubics (parts of the reach) from which on a cell is halved, a tenth of
#: `TOLERANCE`, as forces of a tenth of the largest count; and how often: a few cells at the ends of the path need it.
CLOSE, TOUCH_HALVINGS = 1e-4, 8
#: Where in a cell (parts of its width) the first-contact curve's cubics are compared with the curve.
TOUCH_PLACES = (0.25, 0.5, 0.75)
#: How often a cell is halved for its forces.
HALVINGS = 3
#: Least reach (m): what contact solutions are off by (`gearfe.gears.gearmesh.law_fit.NOISE`) is then 1 % of it.
LEAST_REACH = 1e-7
#: The law's tables go on to where pairs touch at this many times its reach, so that no pair is loaded at their ends.
BEYOND = 1.1
#: Pinion angles at which the approach is searched for that makes the largest force, and most steps of that search:
#: internal pairs, stiffer than the first approach is made for, take more than external ones.
ANGLES, REACH_STEPS = 6, 12
#: Corners of the first-contact curve are nodes; others are left out so near to them, and of corners so near to each
#: other one stays (parts of a cell).
NEAR, SAME = 0.4, 0.02


def mesh_law(pair: HalfPlanePair, force: float, *, tolerance: float = TOLERANCE) -> MeshLaw:
    """Fit a law for mesh forces up to `force` (N); its error is from contact solutions that it was not fitted to.

    Cells of the phase where that is more than `tolerance` are halved, and fitted to the solutions that showed it, too.

    Raises
    ------
    InputError
        For forces that contact solutions do not reach.
    """
    geometry = pair.pair
    radius = geometry.wheel.base_radius
    needed = _reach(pair, force)
    reach = max(needed, LEAST_REACH)
    nodes, slots = _nodes(pair, reach)
    C = coupling_curve(pair, _phases(nodes, slots), reach)
    known: list[PairForces] = []
    solutions: list[Positions] = []
    points = itertools.count(1)

    def solve(angles: Array, depths: Array) -> Positions:
        """Contacts at pinion angles and parts of the reach; their pair forces are fitted from now on."""
        different, index = np.unique(angles, return_inverse=True)
        touches, first = _first_contacts(pair, different)
        solved = solve_half_plane(pair, angles, first[index] + reach * depths / radius)
        # pair forces of smaller approaches are those of their errors (`gearfe.gears.gearmesh.law_fit.NOISE`)
        fitted = taken(solved.contacts, depths[solved.contacts.position] >= DEPTHS[0])
        known.append(_pair_forces(pair, replace(solved, contacts=fitted), touches, C))
        solutions.append(solved.without_loads())
        return solved

    def largest_errors(law: MeshLaw, solved: Positions) -> Array:
        """Largest relative error in contact solutions, cell by cell."""
        largest = np.zeros(len(law.nodes) - 1)
        np.maximum.at(largest, law.locate(solved.pinion_angle)[1], _errors(law, pair, solved, LEAST_FORCE * force))
        return largest

    def depths_of(parts: Array) -> Array:
        """Approaches of checks (parts of the reach), from the least (0) to the needed one (1)."""
        depths: Array = (LEAST_CHECK * needed / reach) ** ((1.0 - parts) ** DEEP)
        return depths

    def spread(law: MeshLaw, number: IntArray) -> tuple[Array, Array]:
        """Pinion angles (rad) and approaches (parts of the reach) of so many checks of each cell, cell by cell."""
        cell = np.repeat(np.arange(len(number)), number)
        places, parts = _spread(points, len(cell))
        return law.nodes[cell] + places * np.diff(law.nodes)[cell], depths_of(parts)

    def fit() -> MeshLaw:
        """The law of all contacts so far."""
        return fit_law(
            joined(known),
            touch_curve(pair, _phases(nodes, slots)),
            C,
            cells=len(nodes) - 1,
            hertz=0.5 * pair.compliance / pair.width,
            base_radii=(geometry.pinion.base_radius, radius),
            reach=reach,
            force=force,
        )

    def final_checks(law: MeshLaw, former: MeshLaw) -> tuple[Array, Array]:
        """Places as of `spread` in all cells, among them those where the force changes most from a former law."""
        every = np.ones(len(law.nodes) - 1, dtype=np.int64)
        evenly, samples = spread(law, FINAL_CHECKS * every), spread(law, SAMPLES * every)
        guided = _largest_changes(law, former, *samples, LEAST_FORCE * force)
        angles, depths = (np.append(even, sampled[guided]) for even, sampled in zip(evenly, samples, strict=True))
        return angles, depths

    begin, width = nodes[:-1], np.diff(nodes)
    for halvings_left in range(HALVINGS, -1, -1):
        angles = _places(begin, width, PLACES)
        solve(np.repeat(angles, len(DEPTHS)), np.tile(np.array(DEPTHS), len(angles)))
        law = fit()
        new = np.isin(nodes[:-1], begin)
        angles, depths = spread(law, CHECKS * new)
        changes = np.repeat(_changes(law), CHANGE_CHECKS)
        changes = changes[new[law.locate(changes)[1]]]
        _, parts = _spread(points, len(changes))
        solved = solve(np.append(angles, changes), np.append(depths, depths_of(parts)))
        errors = largest_errors(law, solved)
        if halvings_left == 0 or errors.max() <= tolerance:
            # checks that accept a cell are the lucky ones: others see the law that is fitted to all of these, too
            former, law = law, fit()
            solved = solve(*final_checks(law, former))
            errors = np.maximum(largest_errors(former, together(solutions[:-1])), largest_errors(law, solved))
        coarse = np.flatnonzero(errors > tolerance)
        if halvings_left == 0 or not len(coarse):
            break
        width = np.tile(0.5 * np.diff(nodes)[coarse], 2)
        begin = np.append(nodes[coarse], nodes[coarse] + width[: len(coarse)])
        nodes = np.union1d(nodes, begin)
    return replace(law, backlash=geometry.base_backlash, error=float(errors.max()))


def _largest_changes(law: MeshLaw, former: MeshLaw, angles: Array, depths: Array, least: float) -> IntArray:
    """Numbers of `GUIDED_CHECKS` of `SAMPLES` samples in each cell where two laws' forces differ most.

    Parameters
    ----------
    law, former : MeshLaw
        With the same cells.
    angles, depths : ndarray, shape (cells SAMPLES,)
        Pinion angles (rad) and approaches beyond the first touch (parts of the reach), cell by cell.
    least : float
        Forces count as this (N) or more.
    """
    approaches = law.first_contact(angles) + law.reach * depths
    force = law(angles, approaches).force
    change = np.abs(former(angles, approaches).force - force) / np.maximum(force, least)
    order = np.argsort(change.reshape(-1, SAMPLES), axis=1)[:, -GUIDED_CHECKS:]
    return np.asarray((order + SAMPLES * np.arange(len(order))[:, None]).ravel())


def _spread(points: Iterator[int], count: int) -> Array:
    """The next points of the sequence of `SPREAD`, shape (2, count), from 0 to 1."""
    numbers = np.fromiter(itertools.islice(points, count), dtype=float, count=count)
    return np.multiply.outer(SPREAD, numbers) % 1.0


def _places(begin: Array, width: Array, parts: Sequence[float] | Array) -> Array:
    """Angles (rad) at these parts of the width of each cell, cell by cell."""
    angles: Array = (begin[:, None] + width[:, None] * np.array(parts)).ravel()
    return angles


def _changes(law: MeshLaw) -> Array:
    """Angles (rad) of one mesh cycle at which a further pair touches at `LATE` parts of the reach after the first one.

    Between these the loaded pairs change; under light loads that is a small part of a cell.
    """
    angles = _places(law.nodes[:-1], np.diff(law.nodes), np.arange(CHANGE_SAMPLES) / CHANGE_SAMPLES)
    touch = law.pair_touches(angles)
    late = (touch - touch.min(axis=1, keepdims=True)) / law.reach
    changes = []
    for part in LATE:
        sample, _ = np.nonzero((late[1:] > part) != (late[:-1] > part))
        changes.append(0.5 * (angles[sample] + angles[sample + 1]))
    return np.unique(np.concatenate(changes))


def _errors(law: MeshLaw, pair: HalfPlanePair, solved: Positions, least: float) -> Array:
    """Larger relative error of force and driver's torque in contact solutions; forces count as `least` (N) or more."""
    r1, r2 = law.base_radii
    forces = law(solved.pinion_angle, r2 * (solved.twist - pair.pair.contact_twist))
    force = solved.torque_wheel / r2
    moment = solved.torque_pinion - r1 * force
    error = np.maximum(np.abs(forces.force - force), np.abs(forces.moment - moment) / r1) / np.maximum(force, least)
    # a force that the law lacks is an infinite error: NaN would pass every comparison
    error = np.where(np.isnan(forces.force), math.inf, error)
    return np.where(np.isfinite(force), error, 0.0)  # some contacts are not solved, as of flanks with short waves


def _pair_forces(pair: HalfPlanePair, solved: Positions, met: FirstContacts, coupling: Sequence[Couple]) -> PairForces:
    """Forces and approaches of the loaded pairs in contact solutions; forces are the wheel's torques over r_b2."""
    radius = pair.pair.wheel.base_radius
    contacts = solved.contacts
    # a pair may be loaded on several stretches of its flanks, each of which is a contact
    (position, number), inverse = np.unique([contacts.position, contacts.pair], axis=1, return_inverse=True)
    force = np.bincount(inverse.ravel(), contacts.torque_wheel, minlength=len(position)) / radius
    k = number - number.min(initial=0)
    table = np.zeros((len(solved), int(k.max(initial=0)) + 1))
    table[position, k] = force
    angle = solved.pinion_angle[position]
    own = angle + number * pair.pair.mesh_cycle
    others = np.zeros(len(force))
    for apart, couple in enumerate(coupling, start=1):
        for other, lower in ((k - apart, own - apart * pair.pair.mesh_cycle), (k + apart, own)):
            inside = (other >= 0) & (other < table.shape[1])
            others[inside] += couple(lower[inside]) * table[position[inside], other[inside]]
    touch = _of_pairs(met, angle, number)
    approach = radius * (solved.twist[position] - touch) - others
    return PairForces(own, force, force / table.sum(axis=1)[position], approach)


def touch_curve(pair: HalfPlanePair, phases: Array) -> TouchCurve:
    """t and its slope at pinion angles of a pair's own tooth (rad), from where the rigid driving flanks touch."""
    geometry = pair.pair
    radius = geometry.wheel.base_radius
    met = pair.first_contacts(phases)
    own = np.flatnonzero(met.pair == 0)
    value, slope = np.full(len(phases), NO_CONTACT), np.zeros(len(phases))
    at = met.position[own]
    value[at] = radius * (met.twist[own] - geometry.contact_twist)
    slope[at] = radius * (1.0 / abs(geometry.gear_ratio) - met.arm[own, 0] / met.arm[own, 1])
    return TouchCurve(phases, value, slope)


def _late(pair: HalfPlanePair, phases: Array) -> Array:
    """How much later (m) than the first pair there a pair touches, at pinion angles of its own tooth (rad)."""
    met, first = _first_contacts(pair, phases)
    own = np.flatnonzero(met.pair == 0)
    late = np.full(len(phases), NO_CONTACT)
    late[met.position[own]] = pair.pair.wheel.base_radius * (met.twist[own] - first[met.position[own]])
    return late


def coupling_curve(pair: HalfPlanePair, phases: Array, reach: float) -> list[Couple]:
    """C of pairs one, two, ... teeth apart over the angle of the lower pair's tooth; 0 beyond its ends."""
    cycle, radius = pair.pair.mesh_cycle, pair.pair.wheel.base_radius
    angles = phases[phases < phases[0] + cycle * (1 - 1e-9)]
    _, first = _first_contacts(pair, angles)
    angle, apart, compliance = coupling_compliances(pair, angles, first + BEYOND * reach / radius)
    made = []
    for number in range(1, int(apart.max(initial=0)) + 1):
        here = apart == number
        order = np.argsort(angle[here])
        own, beside = angle[here][order], float(np.diff(phases).max())
        # level up to the next angle that was looked at, since pairs may touch till there; then none
        places = np.concatenate([own[0] - beside * np.array([2.0, 1.0]), own, own[-1] + beside * np.array([1.0, 2.0])])
        level = np.pad(compliance[here][order], 1, mode="edge")
        made.append(Couple(places, np.pad(level, 1)))
    return made


def _first_contacts(pair: HalfPlanePair, angles: Array) -> tuple[FirstContacts, Array]:
    """All touches at pinion angles, and the first twist at each (rad)."""
    met = pair.first_contacts(angles)
    first = np.full(len(angles), np.inf)
    np.minimum.at(first, met.position, met.twist)
    return met, first


def _of_pairs(met: FirstContacts, angle: Array, number: IntArray) -> Array:
    """Twists (rad) at which pairs touch, by pinion angle and pair number."""
    known = {(a, k): t for a, k, t in zip(met.angle.tolist(), met.pair.tolist(), met.twist.tolist(), strict=True)}
    return np.array([known[a, k] for a, k in zip(angle.tolist(), number.tolist(), strict=True)])


def _reach(pair: HalfPlanePair, force: float) -> float:
    """Approach beyond the first touch (m) at which the mesh force is at least `force` at every phase."""
    geometry = pair.pair
    radius = geometry.wheel.base_radius
    angles = geometry.mesh_cycle * np.arange(ANGLES) / ANGLES
    _, first = _first_contacts(pair, angles)
    reach = 1e-2 * geometry.pinion.module
    for _ in range(REACH_STEPS):
        solved = solve_half_plane(pair, angles, first + reach / radius)
        least = float(solved.torque_wheel.min()) / radius
        if not math.isfinite(least):
            break
        if force <= least <= 1.1 * force:
            return reach
        reach *= 1.03 * (force / least) ** (0.95 if least < force else 1.0)
    problem = f"no contact solution of this pair makes a mesh force of {force:.6g} N at all phases"
    raise InputError("force", force, problem, "ask for a law up to smaller forces")


def _nodes(pair: HalfPlanePair, reach: float) -> tuple[Array, int]:
    """Nodes of one mesh cycle (rad), and how many mesh cycles a pair's contact takes."""
    geometry = pair.pair
    cycle = geometry.mesh_cycle
    step = 0.1 * cycle / CELLS

    def bearing(places: Array) -> Array:
        """Angles at which a pair can bear, of these numbers of steps."""
        return step * places[_late(pair, step * places) < BEYOND * reach]

    found = bearing(10.0 * np.arange(-3.0 * CELLS, 3 * CELLS + 1))
    ends = np.round(found[[0, -1]] / step)[:, None] + np.arange(-10.0, 11.0)
    close = bearing(ends.ravel())
    low, high = close.min() - step, close.max() + step
    slots = math.ceil((high - low) / cycle)
    begin = 0.5 * (low + high - slots * cycle)
    width = cycle / CELLS
    limits = {s for relieved in (False, True) for s in geometry.path_limits(relieved=relieved)} | _kinks(pair)
    corners = np.sort([(geometry.pinion_angle_at(s) - begin) % cycle for s in limits])
    corners = corners[np.diff(corners, prepend=-np.inf) > SAME * width]
    corners = corners[(corners > SAME * width) & (corners < cycle - SAME * width)]
    even = width * np.arange(1, CELLS)
    even = even[np.abs(even[:, None] - corners).min(axis=1, initial=np.inf) > NEAR * width]
    nodes = begin + np.sort(np.concatenate([[0.0, cycle], corners, even]))
    for _ in range(TOUCH_HALVINGS):
        off = _touch_error(pair, nodes, slots, BEYOND * reach)
        coarse = np.flatnonzero(off > CLOSE * reach)
        if not len(coarse):
            break
        nodes = np.sort(np.append(nodes, 0.5 * (nodes[coarse] + nodes[coarse + 1])))
    return nodes, slots


def _kinks(pair: HalfPlanePair) -> set[float]:
    """Roll lengths of the pinion (m) on the path of contact at which a deviation of either gear has a kink."""
    geometry, made = pair.pair, set()
    start, end = geometry.path_limits()
    for g, own in enumerate(pair.teeth.deviations):
        for kink in (s for one in own.profiles if one is not None for s in one.kinks):
            made.add(kink if g == 0 else geometry.tangent_length - kink)
    return {s for s in made if start < s < end}


def _touch_error(pair: HalfPlanePair, nodes: Array, slots: int, reach: float) -> Array:
    """Error of the cubics of t in each cell of the phase (m), the largest over the slots.

    A cell counts where a pair can be loaded in it, within the reach of the first touch, by its true t or by its cubic.
    """
    ends = _phases(nodes, slots)
    cubics = touch_cubics(touch_curve(pair, ends)).T
    late = _late(pair, ends)
    least, largest = np.minimum(late[1:], late[:-1]), np.zeros(len(ends) - 1)
    for part in TOUCH_PLACES:
        z = part * np.diff(ends)
        phases = ends[:-1] + z
        off = cubics[0] + z * (cubics[1] + z * (cubics[2] + z * cubics[3])) - touch_curve(pair, phases).value
        late = _late(pair, phases)
        least = np.minimum(least, np.minimum(late, late + off))
        largest = np.maximum(largest, np.abs(off))
    error: Array = np.where(least < reach, largest, 0.0).reshape(slots, -1).max(axis=0)
    return error


def _phases(nodes: Array, slots: int) -> Array:
    """The nodes of so many mesh cycles."""
    cycle = nodes[-1] - nodes[0]
    return np.append((nodes[:-1] + cycle * np.arange(slots)[:, None]).ravel(), nodes[-1] + (slots - 1) * cycle)
