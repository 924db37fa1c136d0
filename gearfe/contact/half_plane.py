r"""One contact law for every load: finite elements for the teeth, half-planes for the contacts, exact moved flanks.

Teeth and rims move the faces by the smooth influence H of `.flank_compliance`; the contact itself is that of
half-planes and wedges on panels, which no mesh resolves. (Vijayakar, *Int. J. Numer. Meth. Eng.* 31, 1991, joins a
finite-element and a half-space solution at a depth below the contact; here they join in the influence function.)

**One position.** Every contact has a centre O with the common normal n, and panels at x along the tangent over the
window in which the gap may close; a tooth pair has as many contacts as it bears on stretches of its flanks (`.zones`;
`.half_plane_pair` has their mutual terms). With the pressure p, its force per width :math:`F=\int p`, the gap g
between the faces as moved by the loads :math:`F_0` of the step before (`gearfe.gear.flank_curve`),

.. math::
    p \ge 0,\qquad g(x) + \frac{2}{\pi}\Big(\frac1{E_1'}+\frac1{E_2'}\Big)\int -\ln|x-\xi|\,p\,d\xi
    + \sum_i \frac{n W_i n}{E_i'}\int -\ln(y_i+\eta_i)\,p + \sum_l T_l\,(F_l-F_{0,l}) \ge 0,

complementary, :math:`T = w\, n H n` over all contacts l of the position. Then O moves to the mean place of p, n to
the mean normal of the deformed faces under p (of the face that is further from its edges), H is taken at the material
that is at O now, and so on until F stays.

**Why this is an equilibrium.** H is symmetric, and with O at the mean place of p the energy does not change to first
order with the arcs at which H is taken; with n the mean normal under p, it does not change with n either. What is left
is the work of the twist, so that the torque F times lever is the derivative of the energy (a test).

The gap of a panel is that at its middle; where a kink of a face lies in it (start of a linear relief, edge of an
undercut) it is the mean over the panel.

The faces' displacement is taken at O with its slope. Across n it includes the wedge's part; along n that is in the
equation above. The influence at the stations is a mean over bumps and the contact has a width of its own: together they
add :math:`(\langle x^2\rangle - a^2/4)\,H_{ss}`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

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
from .half_plane_step import WINDOW, Setting, State, Step, moved_on, reference_approach, smooth_influence, step
from .panels import PANELS, forces_of_overlaps
from .position import STATUS, Positions, joined, of_positions, taken, together
from .zones import completed

__all__ = ["HalfPlanePair", "PairContacts", "half_plane_pair", "solve_half_plane"]

#: Positions solved side by side.
BATCH = 128
#: Newton steps for the twist; rounds for the forces; sharpest edge (modules) that the curvature of a contact knows.
TWIST_STEPS, FORCE_ROUNDS, SHARPEST = 10, 2, 0.02
#: Force per width (N/m) that is none.
SMALL = 1e-6


def unloaded(law: HalfPlanePair, numbers: IntArray, twists: Array, found: Touching) -> tuple[Setting, State]:
    """Tooth pairs where their rigid flanks touch, at twists (rad) of their positions, without forces.

    Parameters
    ----------
    numbers : ndarray, shape (m,)
        Of the positions, in rising order.
    twists : ndarray, shape (n,)
        Of all positions that are numbered.
    """
    frames = found.frames + twists[found.position, None] * np.arange(2)
    setting = Setting(law, numbers, found, np.exp(1j * frames))
    nothing, count = np.zeros(len(found)), len(found)
    return setting, State(
        centre=found.point,
        normal=found.normal,
        arc=law.arc_at(found.flank, found.place),
        ends=law.tables.ends[found.flank],
        force=nothing,
        variance=nothing,
        low=nothing,
        high=nothing,
        bearing=np.zeros((count, PANELS), dtype=bool),
        reach=np.full(count, WINDOW),
    )


@dataclass(frozen=True)
class _Yield:
    """What Hertz's approach of p contacts needs: C (1/Pa), kappa (1/m), n W n/E' (1/Pa) and y (m), shape (p, 2)."""

    compliance: float
    curvature: Array
    along: Array
    distance: Array

    def half_width(self, force: Array) -> Array:
        """b (m) of forces per width (N/m), shape (p,)."""
        return np.asarray(np.sqrt(2 * self.compliance * np.maximum(force, SMALL) / self.curvature))

    def at(self, force: Array) -> Array:
        """c (m2/N) at the half width of these forces."""
        b = self.half_width(force)
        wedge = (self.along * np.log(2 * np.maximum(self.distance, b[:, None]))).sum(axis=1)
        return np.asarray(self.compliance * (0.5 - np.log(0.5 * b)) - wedge)


def _yields(setting: Setting, state: State) -> tuple[_Yield, Array]:
    """How contacts yield by themselves, and T by couple."""
    law, normal = setting.law, state.normal[:, None] / setting.turn
    tension, shear = law.wedge
    along = law.inverse_modulus * (tension + (shear * normal.conj() ** 2).real)
    blunt = np.minimum(setting.found.curvature, 1 / (SHARPEST * law.pair.pinion.module))
    T = smooth_influence(law, normal, state.arc, setting.couples).compliance
    return _Yield(law.compliance, blunt, along, setting.distances(state.arc[:, :, None])[:, :, 0]), T


def first_state(law: HalfPlanePair, twists: Array, found: Touching) -> tuple[Setting, State]:
    """What the iteration for all tooth pairs begins with at twists (rad) of the positions."""
    setting, state = unloaded(law, np.unique(found.position), twists, found)
    yields, T = _yields(setting, state)
    overlap = found.arm[:, 1] * (twists[found.position] - found.twist)
    force = np.maximum(overlap, 0.0) / reference_approach(law)
    for _ in range(FORCE_ROUNDS):
        force = forces_of_overlaps(overlap, yields.at(force), T, setting.couples)
    return setting, replace(state, force=force, variance=0.25 * yields.half_width(force) ** 2)


def expected_twists(law: HalfPlanePair, torques: Array, touching: Touching) -> Array:
    """Twists (rad) at which n positions are expected to carry torques (N m) > 0, shape (n,); infinite where nothing can
    touch.

    Parameters
    ----------
    touching
        What `law.teeth.touching` says of their angles.
    """
    made, touched = np.full(len(torques), np.inf), np.unique(touching.position)
    for start in range(0, len(touched), BATCH):
        chosen = touched[start : start + BATCH]
        made[chosen] = _expected(law, torques[chosen], of_positions(touching, chosen))
    return made


def _expected(law: HalfPlanePair, torques: Array, found: Touching) -> Array:
    count, arm, position = len(torques), found.arm[:, 1], found.position
    touch = np.full(count, np.inf)
    np.minimum.at(touch, position, found.twist)
    setting, state = unloaded(law, np.arange(count), touch, found)
    couples, (yields, T) = setting.couples, _yields(setting, state)
    force = torques[position] / (arm * law.width)
    twist = np.full(count, np.inf)
    alone = touch[position] + force * (yields.at(force) + T[couples.own]) / arm
    np.minimum.at(twist, position, np.maximum(alone, touch[position]))
    for _ in range(TWIST_STEPS):
        c, overlap = yields.at(force), arm * (twist[position] - found.twist)
        force = forces_of_overlaps(overlap, c, T, couples)
        weight = (force > 0) / c
        rate = couples.solved(weight * arm, couples.diagonal(weight), T)
        torque, slope = (couples.total(one * arm) * law.width for one in (force, rate))
        twist = np.maximum(twist + (torques - torque) / np.maximum(slope, 1e-300), touch + 0.1 * (twist - touch))
    return twist


#: How often positions are taken up again, where contacts were missing.
ROUNDS = 10
#: Most steps each time; change of the forces, in units of their sum, from which on windows and bearing panels are held.
STEPS, NEAR = 30, 2e-5
#: What moves of contacts by their width count as changes of force: they are of second order there (see above).
MOVED = 0.1
#: Change from which on windows grow that cut a pressure: sooner, what a pressure reaches on its way would decide.
WIDENED_BELOW = 1e-3
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
    angles = np.array(pinion_angles, dtype=float, ndmin=1)
    twist = np.array(np.broadcast_to(np.asarray(twists, dtype=float), angles.shape))
    met = law.teeth.touching(angles) if touching is None else touching
    touch, made = np.flatnonzero(met.twist < twist[met.position]), []
    for start in range(0, max(1, len(angles)), BATCH):
        part = slice(start, start + BATCH)
        found = met.take(touch[slice(*np.searchsorted(met.position[touch], [start, start + BATCH]))])
        made.append(_batch(law, angles[part], twist[part], replace(found, position=found.position - start)))
    return together(made)


def _kept(setting: Setting, state: State, positions: BoolArray) -> tuple[Setting, State]:
    """Only some of the positions, shape (m,)."""
    if positions.all():
        return setting, state
    index = np.flatnonzero(positions[setting.couples.position])
    return setting.take(index, setting.numbers[positions]), taken(state, index)


def _joined(parts: Sequence[tuple[Setting, State]]) -> tuple[Setting, State]:
    """One after the other, in rising order."""
    if len(parts) == 1:
        return parts[0]
    settings, states = zip(*parts, strict=True)
    whole = replace(
        settings[0],
        numbers=np.sort(np.concatenate([one.numbers for one in settings])),
        found=joined([one.found for one in settings]),
        turn=np.concatenate([one.turn for one in settings]),
    )
    order = np.lexsort((whole.found.pair, whole.found.position))
    return whole.take(order), taken(joined(states), order)


def change(setting: Setting, state: State, made: Step) -> Array:
    """What a step changed, shape (m,): the forces in units of their sum, and weighted by them the places and widths of
    the contacts, in units of these.
    """
    new, variance, couples = made.solution.force, made.variance, setting.couples
    safe = np.where(variance > 0, variance, 1.0)
    moved = (variance > 0) * (0.5 * np.abs(made.place) / np.sqrt(safe) + np.abs(1 - state.variance / safe))
    all_ = np.abs(new - state.force) + MOVED * new * moved
    return couples.total(all_) / np.maximum(couples.total(new), TINY)


def _batch(law: HalfPlanePair, angles: Array, twists: Array, found: Touching) -> Positions:
    status, iterations = np.full(len(angles), "no_contact", dtype=STATUS), np.zeros(len(angles), dtype=np.int64)
    names = (*SUMS, "tangent")
    numbers: dict[str, Any] = {name: np.zeros(len(angles)) for name in names}
    contacts: list[PairContacts] = []
    open_ = [first_state(law, twists, found)] if len(found) else []  # positions to be solved, together or none
    for _ in range(ROUNDS):
        done: list[tuple[Setting, State]] = []
        for number in range(STEPS):
            if not open_:
                break
            setting, state = open_.pop()
            couples = setting.couples
            made = step(setting, state, search=number < SEARCHES)
            iterations[setting.numbers] += 1
            unsettled = couples.total(~made.solution.settled | made.outgrown) > 0
            changed = change(setting, state, made)
            near = (changed <= NEAR) & ~unsettled & (number > 0)
            bears = couples.total(made.solution.force) > 0
            state = moved_on(setting, state, made, near=(changed <= WIDENED_BELOW)[couples.position])
            if (near & bears).any():
                done.append(_kept(setting, state, near & bears))
            if not near.all():
                open_.append(_kept(setting, state, ~near))
        if not done:
            break
        ended = _finished(*_joined(done), twists)
        iterations[ended.numbers] += HELD_STEPS
        solved = ended.numbers[ended.settled]
        status[solved] = "converged"
        for name in names:
            numbers[name][solved] = ended.sums[name][ended.settled]
        contacts.append(ended.contacts)
        if ended.settled.all():
            break
        contacts[-1] = taken(ended.contacts, status[ended.contacts.position] == "converged")
        open_ = [_joined([*open_, _kept(*ended.now, ~ended.settled)])]
    for setting, _ in open_:
        status[setting.numbers] = "not_converged"
        for name in names:
            numbers[name][setting.numbers] = np.nan
    found_ = joined(contacts) if contacts else no_contacts()
    if len(contacts) > 1:
        found_ = taken(found_, np.lexsort((found_.arc[:, 0], found_.pair, found_.position)))
    return Positions(
        pinion_angle=angles, twist=twists, status=status, iterations=iterations, contacts=found_, **numbers
    )


class _Ended(NamedTuple):
    """Positions after their last steps.

    Attributes
    ----------
    numbers : ndarray, shape (m,)
        Theirs.
    settled : ndarray of bool, shape (m,)
        Whether that is their solution.
    sums : dict of str to ndarray, shape (m,)
        Sums over their contacts.
    contacts
        Their loaded contacts.
    now
        Where they go on from.
    """

    numbers: IntArray
    settled: BoolArray
    sums: dict[str, Array]
    contacts: PairContacts
    now: tuple[Setting, State]


def _finished(setting: Setting, start: State, twists: Array) -> _Ended:
    """Last steps of positions that are near their solution, there and at a slightly larger twist.

    Windows and bearing panels are held, so that the differences are derivatives.
    """
    found, couples, numbers = setting.found, setting.couples, setting.numbers
    touch = np.full(len(numbers), np.inf)
    np.minimum.at(touch, couples.position, found.twist)
    ahead = np.maximum(AHEAD * (twists[numbers] - touch), LEAST_AHEAD)
    further = setting.turn * np.exp(1j * ahead[couples.position, None] * np.arange(2))
    both = replace(
        setting,
        numbers=np.concatenate([numbers, numbers + len(twists)]),
        found=joined([found, replace(found, position=found.position + len(twists))]),
        turn=np.concatenate([setting.turn, further]),
    )
    state = joined([start, start])
    made = step(both, state, search=False, held=True)
    for _ in range(HELD_STEPS - 1):
        state = moved_on(both, state, made)
        made = step(both, state, search=False, held=True)
    here, on = slice(0, len(found)), slice(len(found), None)
    changed, of_both = change(both, state, made)[: len(numbers)], pair_sums(both, state, made)
    after = taken(moved_on(both, state, made), here)
    one, two = ((taken(state, part), taken(made, part)) for part in (here, on))
    of_pairs = {name: values[here] for name, values in of_both.items()}
    sums = {name: couples.total(of_pairs[name]) for name in SUMS}
    sums["tangent"] = couples.total(of_both["torque_wheel"][on] - of_pairs["torque_wheel"]) / ahead
    right = couples.total(~one[1].solution.settled) == 0
    settled = right & (changed <= TOLERANCE) & (sums["tangent"] > 0)
    known = contact_rates(setting.law, one, two, ahead[couples.position])
    known["torque_wheel"] = of_pairs["torque_wheel"]
    contacts = contacts_of(setting, *one, known)
    now, whole = (setting, after), completed(setting, *one)
    if whole is not None:  # tooth pairs have more contacts
        settled &= ~whole[2]
        now = _joined([_kept(setting, after, ~whole[2]), _kept(*whole)])
    return _Ended(numbers, settled, sums, contacts, now)


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
    setting, state = unloaded(law, np.arange(len(twists)), twists, met)
    couples, normal = setting.couples, state.normal[:, None] / setting.turn
    arm = met.arm[:, 1] / law.pair.wheel.base_radius
    found = smooth_influence(law, normal, state.arc, couples).compliance / law.width
    found = found / (arm[couples.first] * arm[couples.second])
    upper, own = couples.step > 0, met.angle + met.pair * law.pair.mesh_cycle
    return own[couples.second[upper]], couples.step[upper], found[upper]
