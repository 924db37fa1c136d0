r"""One contact law for every load: finite elements for the teeth, half-planes for the contacts, exact moved flanks.

Teeth and rims move the faces by the smooth influence H of `.flank_compliance`; the contact itself is that of
half-planes and wedges on panels, which no mesh resolves. (Vijayakar, *Int. J. Numer. Meth. Eng.* 31, 1991, joins a
finite-element and a half-space solution at a depth below the contact; here they join in the influence function.)

**One position.** Every contact has a centre O with the common normal n, and panels at x along the tangent over the
window in which the gap may close; a tooth pair has as many contacts as it bears on stretches of its flanks (`.zones`;
`.half_plane_pair` has their mutual terms). With the pressure p, its force per width :math:`F=\int p`, the gap g
between the faces as moved by the loads :math:`F_0` of the step before (`.moved_faces`),

.. math::
    p \ge 0,\qquad g(x) + \frac{2}{\pi}\Big(\frac1{E_1'}+\frac1{E_2'}\Big)\int -\ln|x-\xi|\,p\,d\xi
    + \sum_i \frac{n W_i n}{E_i'}\int -\ln(y_i+\eta_i)\,p + \sum_l T_l\,(F_l-F_{0,l}) \ge 0,

complementary, :math:`T = w\, n H n` over all contacts l of the position. Then O moves to the mean place of p, n to
the mean normal of the deformed faces under p (of the face that is further from its edges), H is taken at the material
that is at O now, and so on until F stays.

**Why this is an equilibrium.** H is symmetric, and with O at the mean place of p the energy does not change to first
order with the arcs at which H is taken; with n the mean normal under p, it does not change with n either. What is left
is the work of the twist, so that the torque F times lever is the derivative of the energy (a test).

The faces' displacement is taken at O with its slope. Across n it includes the wedge's part; along n that is in the
equation above. The influence at the stations is a mean over bumps and the contact has a width of its own: together they
add :math:`(\langle x^2\rangle - a^2/4)\,H_{ss}`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..gear.touching import Touching
from ..typing import Array, BoolArray, IntArray
from .half_plane_pair import HalfPlanePair, half_plane_pair
from .half_plane_result import (
    SUMS,
    PairContacts,
    contact_rates,
    contacts_of,
    no_contacts,
    pair_sums,
)
from .half_plane_start import BATCH, first_state, unloaded_state
from .half_plane_step import State, Step, moved_on, smooth_influence, step
from .panels import Couplings, couplings
from .position import STATUS, Positions, joined, taken, together
from .zones import completed

__all__ = ["HalfPlanePair", "PairContacts", "half_plane_pair", "solve_half_plane"]


#: How often missing contacts are added.
ROUNDS = 10
#: Most steps; change of the forces, in units of their sum, from which on windows and bearing panels are held.
STEPS, NEAR = 30, 2e-5
#: What moves of contacts by their width count as changes of force: they are of second order there (see above).
MOVED = 0.1
#: Change from which on windows grow that cut a pressure.
WIDENED_BELOW = 5e-3
#: Steps in which windows are searched for: where the pressure moves by what one panel makes of its end, a window that
#: follows it might do so for ever.
SEARCHES = 12
#: Steps with windows and bearing panels held, after which derivatives err by 1e-3, and the change in the last of them
#: with which a position is solved.
HELD_STEPS, TOLERANCE = 3, 1e-6
#: What the twist is ahead for derivatives: share of its way since the touch, and at least (rad).
AHEAD, LEAST_AHEAD = 1e-3, 1e-10
#: Force per width (N/m) below which there is none.
TINY = 1e-300


def solve_half_plane(
    law: HalfPlanePair, pinion_angles: ArrayLike, twists: ArrayLike, *, touching: Touching | None = None
) -> Positions:
    """Solve the contact of a gear pair at several positions.

    Parameters
    ----------
    pinion_angles : array_like, shape (n,)
        rad.
    twists : array_like, shape (n,) or ()
        Twist of the wheel (rad), from where a wheel space faces the pinion tooth.
    touching
        What `law.teeth.touching` says of these angles, when it is there already.
    """
    angles = np.atleast_1d(np.asarray(pinion_angles, dtype=float))
    twist = np.broadcast_to(np.asarray(twists, dtype=float), angles.shape)
    met = law.teeth.touching(angles) if touching is None else touching
    met = met.take(np.flatnonzero(met.twist < twist[met.position]))
    made = []
    for start in range(0, max(1, len(angles)), BATCH):
        part = slice(start, start + BATCH)
        found = met.take(slice(*np.searchsorted(met.position, [start, start + BATCH])))
        made.append(_batch(law, angles[part], twist[part], replace(found, position=found.position - start)))
    return together(made)


@dataclass(frozen=True)
class _Open:
    """Positions on the way to their solution, with their p tooth pairs, sorted by position.

    Attributes
    ----------
    numbers : ndarray, shape (m,)
        Of the positions in the batch, in rising order.
    found
        Where the rigid flanks of the contacts' tooth pairs first touch.
    state
        What the next `half_plane_step.step` starts from.
    """

    numbers: IntArray
    found: Touching
    state: State

    @cached_property
    def couples(self) -> Couplings:
        """Which pairs share a position."""
        return couplings(np.searchsorted(self.numbers, self.found.position), self.found.pair, len(self.numbers))

    def kept(self, positions: BoolArray) -> _Open:
        """Only some of the positions, shape (m,)."""
        if positions.all():
            return self
        index = np.flatnonzero(positions[self.couples.position])
        return _Open(self.numbers[positions], taken(self.found, index), taken(self.state, index))

    def change(self, made: Step) -> Array:
        """What a step changed, shape (m,): the forces in units of their sum, and weighted by them the places and widths
        of the contacts, in units of these.
        """
        new, old, spread = made.solution.force, self.state, made.spread
        safe = np.where(spread > 0, spread, 1.0)
        moved = (spread > 0) * (0.5 * np.abs(made.place) / np.sqrt(safe) + np.abs(1 - old.spread / safe))
        all_ = np.abs(new - old.force) + MOVED * new * moved
        return self.couples.total(all_) / np.maximum(self.couples.total(new), TINY)

    def moved_on(self, law: HalfPlanePair, made: Step, *, near: BoolArray | bool = False) -> _Open:
        """What the next step starts from."""
        return replace(self, state=moved_on(law, self.state, made, near=near))


def _first(law: HalfPlanePair, twists: Array, found: Touching) -> _Open:
    numbers = np.unique(found.position)
    couples = couplings(np.searchsorted(numbers, found.position), found.pair, len(numbers))
    return _Open(numbers, found, first_state(law, twists, found, couples))


def _batch(law: HalfPlanePair, angles: Array, twists: Array, found: Touching) -> Positions:
    status, iterations = np.full(len(angles), "no_contact", dtype=STATUS), np.zeros(len(angles), dtype=np.int64)
    names = (*SUMS, "tangent")
    numbers: dict[str, Any] = {name: np.zeros(len(angles)) for name in names}
    contacts: list[PairContacts] = []
    open_ = _first(law, twists, found)
    number, began, rounds = 0, 0, 0
    while len(open_.numbers) and number - began < STEPS and rounds < ROUNDS:  # again for what is not settled
        done: list[_Open] = []
        while len(open_.numbers) and number - began < STEPS:
            number += 1
            couples = open_.couples
            made = step(law, open_.state, couples, search=number - began <= SEARCHES)
            iterations[open_.numbers] += 1
            unsettled = couples.total(~made.solution.settled | made.outgrown) > 0
            change = open_.change(made)
            near = (change <= NEAR) & ~unsettled & (number - began > 1)
            bears = couples.total(made.solution.force) > 0
            open_ = open_.moved_on(law, made, near=(change <= WIDENED_BELOW)[couples.position])
            if (near & bears).any():
                done.append(open_.kept(near & bears))
            if near.any():
                open_ = open_.kept(~near)
        if not done:
            break
        all_ = _joined(done)
        ended = _finished(law, all_, twists)
        iterations[all_.numbers] += HELD_STEPS
        number += HELD_STEPS
        solved = all_.numbers[ended.settled]
        status[solved] = "converged"
        for name in names:
            numbers[name][solved] = ended.sums[name][ended.settled]
        contacts.append(ended.contacts)
        if not ended.settled.all():
            contacts[-1] = taken(ended.contacts, status[ended.contacts.position] == "converged")
        if ended.more:
            began, rounds = number, rounds + 1
        if not ended.settled.all():
            open_ = _joined([open_, ended.now.kept(~ended.settled)])
    failed = open_.numbers
    status[failed] = "not_converged"
    for name in names:
        numbers[name][failed] = np.nan
    found_ = joined(contacts) if contacts else no_contacts()
    if len(contacts) > 1:
        found_ = taken(found_, np.lexsort((found_.arc[:, 0], found_.pair, found_.position)))
    return Positions(
        pinion_angle=angles, twist=twists, status=status, iterations=iterations, contacts=found_, **numbers
    )


def _joined(parts: Sequence[_Open]) -> _Open:
    """One after the other, in rising order."""
    if len(parts) == 1:
        return parts[0]
    numbers = np.sort(np.concatenate([part.numbers for part in parts]))
    found, state = joined([part.found for part in parts]), joined([part.state for part in parts])
    order = np.lexsort((found.pair, found.position))
    return _Open(numbers, taken(found, order), taken(state, order))


@dataclass(frozen=True)
class _Ended:
    """Positions after their last steps.

    Attributes
    ----------
    settled : ndarray of bool, shape (m,)
        Whether that is their solution.
    sums : dict of str to ndarray, shape (m,)
        Sums over their contacts.
    contacts
        Their loaded contacts.
    now
        Where they go on from.
    more
        Whether tooth pairs have more contacts there.
    """

    settled: BoolArray
    sums: dict[str, Array]
    contacts: PairContacts
    now: _Open
    more: bool


def _finished(law: HalfPlanePair, open_: _Open, twists: Array) -> _Ended:
    """Last steps of positions that are near their solution, there and at a slightly larger twist.

    Windows and bearing panels are held, so that the differences are derivatives.
    """
    found, couples, count = open_.found, open_.couples, len(open_.numbers)
    touch = np.full(count, np.inf)
    np.minimum.at(touch, couples.position, found.twist)
    ahead = np.maximum(AHEAD * (twists[open_.numbers] - touch), LEAST_AHEAD)
    turn = open_.state.turn.copy()
    turn[:, 1] *= np.exp(1j * ahead[couples.position])
    both = _Open(
        np.concatenate([open_.numbers, open_.numbers + len(twists)]),
        joined([found, replace(found, position=found.position + len(twists))]),
        joined([open_.state, replace(open_.state, turn=turn)]),
    )
    made = step(law, both.state, both.couples, search=False, held=True)
    for _ in range(HELD_STEPS - 1):
        both = both.moved_on(law, made)
        made = step(law, both.state, both.couples, search=False, held=True)
    here, on = slice(0, len(couples.position)), slice(len(couples.position), None)
    change, state = both.change(made)[:count], both.state
    now = replace(open_, state=taken(both.moved_on(law, made).state, here))
    one, two = (taken(state, here), taken(made, here)), (taken(state, on), taken(made, on))
    of_both = pair_sums(law, state, made)
    of_pairs = {name: values[here] for name, values in of_both.items()}
    sums = {name: couples.total(of_pairs[name]) for name in SUMS}
    sums["tangent"] = couples.total(of_both["torque_wheel"][on] - of_pairs["torque_wheel"]) / ahead
    right = couples.total(~one[1].solution.settled) == 0
    settled = right & (change <= TOLERANCE) & (sums["tangent"] > 0)
    torques = {name: of_pairs[name] for name in ("torque_wheel", "torque_pinion")}
    known = torques | contact_rates(law, one, two, ahead[couples.position])
    contacts = contacts_of(law, found, one, known)
    whole = completed(law, found, one, couples)
    if whole is None:
        return _Ended(settled, sums, contacts, now, False)
    again = _Open(open_.numbers, *whole[:2]).kept(whole[2])
    return _Ended(settled & ~whole[2], sums, contacts, _joined([now.kept(~whole[2]), again]), True)


def coupling_compliances(law: HalfPlanePair, pinion_angles: Array, twists: Array) -> tuple[Array, IntArray, Array]:
    """Compliance between tooth pairs through the gear bodies, for all couples of pairs that touch at given twists.

    Returns
    -------
    angle, apart, compliance : ndarray, shape (c,)
        Pinion angle of the tooth of the couple's lower pair (rad), teeth between both pairs, and the approach of the
        gears at one pair by a unit force on the other (m/N); forces count as moments on the wheel over its base radius.
    """
    met = law.teeth.touching(pinion_angles)
    met = met.take(np.flatnonzero(met.twist < twists[met.position]))
    couples = couplings(met.position, met.pair, len(twists))
    state = unloaded_state(law, twists, met)
    arm = met.arm[:, 1] / law.pair.wheel.base_radius
    found = smooth_influence(law, state.seen, state.arc, couples).compliance / law.width
    found = found / (arm[couples.first] * arm[couples.second])
    upper, own = couples.step > 0, met.angle + met.pair * law.pair.mesh_cycle
    return own[couples.second[upper]], couples.step[upper], found[upper]
