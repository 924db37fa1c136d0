r"""One contact law for every load: finite elements for the teeth, half-planes for the contacts, exact moved flanks.

Teeth and rims move the faces by the far-field influence H of `.flank_compliance`. The contact itself is that of
half-planes and wedges on panels, so no mesh has to resolve it. (Vijayakar, *Int. J. Numer. Meth. Eng.* 31, 1991, joins
a finite-element and a half-space solution at a depth below the contact; here they join in the influence function.)

**One position.** Every contact has a centre O with the common normal n, and panels at x along the tangent over the
window in which the gap may close. A tooth pair has a contact for each stretch of its flanks that carries load
(`.zones`); `.half_plane_pair` has their mutual terms. With the pressure p, its force per width :math:`F=\int p`, the
gap g between the faces as moved by the loads :math:`F_0` of the step before (`gearfe.gears.geometry.first_contact`),

.. math::
    p \ge 0,\qquad g(x) + \frac{2}{\pi}\Big(\frac1{E_1'}+\frac1{E_2'}\Big)\int -\ln|x-\xi|\,p\,d\xi
    + \sum_i \frac{n W_i n}{E_i'}\int -\ln(y_i+\eta_i)\,p + \sum_l T_l\,(F_l-F_{0,l}) \ge 0,

complementary, :math:`T = w\, n H n` over all contacts l of the position. Then O moves to the mean place of p, and n to
the mean normal of the deformed faces under p (of the face that is further from its edges). H is taken at the material
that is at O now. This is repeated until F no longer changes.

**Why this is an equilibrium.** H is symmetric. With O at the mean place of p, the energy does not change to first order
with the arcs at which H is taken. With n the mean normal under p, it does not change with n either. What is left is the
work of the twist, so that the torque F times lever is the derivative of the energy (a test).

The gap of a panel is that at its middle. Where the panel has a kink of a face (start of a linear relief, edge of an
undercut), it is the mean over the panel.

The faces' displacement is taken at O with its slope. Across n it includes the wedge's part; along n that is in the
equation above. The influence at the stations is a mean over bumps and the contact has a width of its own: together they
add :math:`(\langle x^2\rangle - a^2/4)\,H_{ss}`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.typing import Array, BoolArray, IntArray
from ..geometry.first_contact import FirstContacts
from .half_plane_pair import HalfPlanePair, half_plane_pair
from .half_plane_step import SMALL, WINDOW, Setting, State, Step, cross, far_field_influence, reference_approach, step
from .panels import PANELS, Couplings, unilateral
from .position import STATUS, TORQUES, Contacts, Positions, in_batches, joined, of_positions, taken
from .zones import completed

__all__ = ["HalfPlanePair", "half_plane_pair", "solve_half_plane"]

#: Newton steps for the twist; rounds for the forces; sharpest edge (modules) that the curvature of a contact knows.
TWIST_STEPS, FORCE_ROUNDS, SHARPEST = 7, 2, 0.02


def unloaded(contact_model: HalfPlanePair, twists: Array, found: FirstContacts) -> tuple[Setting, State]:
    """Return the unloaded state of all candidate tooth pairs at the twists (rad) of their positions."""
    frames = found.frames + twists[found.position, None] * contact_model.turning
    nothing, count = np.zeros(len(found)), len(found)
    return Setting(contact_model, found, np.exp(1j * frames)), State(
        centre=found.point,
        normal=found.normal,
        arc=contact_model.arc_at(found.flank, found.place),
        ends=contact_model.tables.ends[found.flank],
        force=nothing,
        variance=nothing,
        low=nothing,
        high=nothing,
        bearing=np.zeros((count, PANELS), dtype=bool),
        reach=np.full(count, WINDOW),
    )


def far_field_compliance(setting: Setting, state: State) -> Array:
    """Return the far-field compliance T of all couples of contacts (m2/N)."""
    normal = state.normal[:, None] / setting.turn
    return far_field_influence(setting.contact_model, setting.couples, normal, state.arc, state.variance).compliance


def hertz(setting: Setting, state: State, force: Array) -> tuple[Array, Array]:
    """How contacts yield by themselves (m2/N) and half widths (m) for forces per width (N/m), all of shape (p,)."""
    contact_model, normal = setting.contact_model, state.normal[:, None] / setting.turn
    blunt = np.minimum(setting.found.curvature, 1 / (SHARPEST * contact_model.pair.pinion.module))
    b = np.sqrt(2 * contact_model.compliance * np.maximum(force, SMALL) / blunt)
    along = contact_model.inverse_modulus * (contact_model.wedge(normal) * normal.conj()).real
    y = np.maximum(setting.distances(state.arc[:, :, None])[:, :, 0], b[:, None])
    return contact_model.compliance * (0.5 - np.log(0.5 * b)) - (along * np.log(2 * y)).sum(axis=1), b


def _shared(couples: Couplings, T: Array, own: Array, overlap: Array, on: BoolArray, *, held: bool = False) -> Array:
    """Return the forces per width (N/m) that take up overlaps (m), both of shape (p,).

    Contacts yield by `own` (m2/N) as well as by T; `on` and `held` as in `unilateral`.
    """
    width = np.ones((len(own), 1))
    return unilateral(couples, own[:, None, None], T, width, -overlap[:, None], on[:, None], held=held)[0][:, 0]


def first_state(contact_model: HalfPlanePair, twists: Array, found: FirstContacts) -> tuple[Setting, State]:
    """Return the initial state of the iteration: Hertzian forces that take up the overlap at the twists (rad)."""
    setting, state = unloaded(contact_model, twists, found)
    T = far_field_compliance(setting, state)
    overlap = found.arm[:, 1] * (twists[found.position] - found.twist)
    force = np.maximum(overlap, 0.0) / reference_approach(contact_model)
    for _ in range(FORCE_ROUNDS):
        own, b = hertz(setting, state, force)
        force = np.maximum(_shared(setting.couples, T, own, overlap, overlap > 0), 0.0)
    return setting, replace(state, force=force, variance=0.25 * b**2)


def expected_twists(contact_model: HalfPlanePair, torques: Array, first_contact: FirstContacts) -> Array:
    """Return the twists (rad) at which n positions should carry torques (N m) > 0, shape (n,).

    They are infinite where no flanks can touch.

    Parameters
    ----------
    first_contact
        `HalfPlanePair.first_contacts` of their angles.
    """
    numbers, position = np.unique(first_contact.position, return_inverse=True)
    found, goal, arm = replace(first_contact, position=position), torques[numbers], first_contact.arm[:, 1]
    touch, twist = np.full((2, len(numbers)), np.inf)
    np.minimum.at(touch, position, found.twist)
    setting, state = unloaded(contact_model, touch, found)
    couples, T = setting.couples, far_field_compliance(setting, state)
    force = goal[position] / (arm * contact_model.width)
    alone = touch[position] + force * (hertz(setting, state, force)[0] + T[couples.own]) / arm
    np.minimum.at(twist, position, np.maximum(alone, touch[position]))
    for _ in range(TWIST_STEPS):
        own, _ = hertz(setting, state, force)
        overlap = arm * (twist[position] - found.twist)
        force = _shared(couples, T, own, overlap, overlap > 0)
        rate = _shared(couples, T, own, arm, force > 0, held=True)
        torque, slope = (couples.total(one * arm) * contact_model.width for one in (force, rate))
        twist = np.maximum(twist + (goal - torque) / np.maximum(slope, 1e-300), touch + 0.1 * (twist - touch))
    made = np.full(len(torques), np.inf)
    made[numbers] = twist
    return made


#: How often positions are taken up again, where contacts were missing.
ROUNDS = 10
#: Most steps each time; change of the forces, in units of their sum, from which on windows and bearing panels are held.
STEPS, NEAR = 30, 2e-5
#: Steps in which windows are searched for: where the pressure moves by what one panel makes of its end, a window that
#: follows it might do so for ever.
SEARCHES = 12
#: Steps with windows and bearing panels held, after which derivatives err by 1e-3, and the change in the last of them
#: with which a position is solved.
HELD_STEPS, TOLERANCE = 3, 1e-6
#: What the twist is ahead for derivatives: share of its way since the touch, and at least (rad).
AHEAD, LEAST_AHEAD = 1e-3, 1e-10


def solve_half_plane(
    contact_model: HalfPlanePair,
    pinion_angles: ArrayLike,
    twists: ArrayLike,
    first_contacts: FirstContacts | None = None,
) -> Positions:
    """Solve the contact of a gear pair at several positions.

    Parameters
    ----------
    contact_model : HalfPlanePair
        The gears.
    pinion_angles : array_like, shape (n,)
        rad.
    twists : array_like, shape (n,) or ()
        Twist of the wheel (rad), from where a wheel space faces the pinion tooth.
    first_contacts : FirstContacts, optional
        First contacts of the tooth pairs that may carry; of all pairs without it.
    """
    angles = np.array(pinion_angles, dtype=float, ndmin=1)
    twist = np.array(np.broadcast_to(np.asarray(twists, dtype=float), angles.shape))
    met = contact_model.first_contacts(angles) if first_contacts is None else first_contacts
    met = taken(met, met.twist < twist[met.position])
    return in_batches(
        lambda part: _batch(contact_model, angles[part], twist[part], of_positions(met, part)), len(angles)
    )


def _kept(setting: Setting, state: State, positions: BoolArray) -> tuple[Setting, State]:
    """Only some of the positions, shape (m,)."""
    if positions.all():
        return setting, state
    index = np.flatnonzero(positions[setting.couples.position])
    return setting.take(index), taken(state, index)


def _joined(parts: Sequence[tuple[Setting, State]]) -> tuple[Setting, State]:
    """One after the other, in rising order."""
    parts = [part for part in parts if len(part[0].found)] or parts[:1]
    if len(parts) == 1:
        return parts[0]
    settings, states = zip(*parts, strict=True)
    found, turn = joined([one.found for one in settings]), np.concatenate([one.turn for one in settings])
    order = np.lexsort((found.pair, found.position))
    return Setting(settings[0].contact_model, found, turn).take(order), taken(joined(states), order)


def _batch(contact_model: HalfPlanePair, angles: Array, twists: Array, found: FirstContacts) -> Positions:
    status, iterations = np.full(len(angles), "no_contact", dtype=STATUS), np.zeros(len(angles), dtype=np.int64)
    numbers: dict[str, Any] = {name: np.zeros(len(angles)) for name in (*TORQUES, "energy")}
    solved: list[Contacts] = []
    open_ = first_state(contact_model, twists, found)  # positions to be solved
    for _ in range(ROUNDS):
        near, open_ = _approached(*open_, iterations)
        iterations[near[0].numbers] += HELD_STEPS
        done, again = _finished(*near, twists, numbers)
        solved.append(done)
        open_ = _joined([open_, again])
        if len(again[0].found) == 0:
            break
    contacts = joined(solved)
    if len(solved) > 1:
        contacts = taken(contacts, np.lexsort((contacts.arc[:, 0], contacts.pair, contacts.position)))
    status[contacts.position], status[open_[0].numbers] = "converged", "not_converged"
    for values in numbers.values():
        values[open_[0].numbers] = np.nan
    return Positions(
        pinion_angle=angles, twist=twists, status=status, iterations=iterations, contacts=contacts, **numbers
    )


def _approached(setting: Setting, state: State, iterations: IntArray) -> tuple[tuple[Setting, State], ...]:
    """Steps until positions are near their solution; those that are, and those that are not. Counts steps."""
    near = []
    for number in range(STEPS):
        couples = setting.couples
        made = step(setting, state, search=number < SEARCHES)
        iterations[setting.numbers] += 1
        there = couples.total(~made.settled | made.outgrown | (made.changed > NEAR)) == 0
        there &= number > 0
        state = made.next
        if there.any():
            near.append(_kept(setting, state, there & (couples.total(state.force) > 0)))
            setting, state = _kept(setting, state, ~there)
        if len(setting.found) == 0:
            break
    return _joined(near or [_kept(setting, state, np.zeros(len(setting.numbers), dtype=bool))]), (setting, state)


def _finished(
    setting: Setting, start: State, twists: Array, solved: dict[str, Array]
) -> tuple[Contacts, tuple[Setting, State]]:
    """Last steps of positions that are near their solution, there and at a slightly larger twist.

    Windows and bearing panels are held, so that the differences are derivatives. Writes the numbers of those that are
    solved; returns their loaded contacts, and from where the others go on.
    """
    found, couples, numbers = setting.found, setting.couples, setting.numbers
    touch = np.full(len(numbers), np.inf)
    np.minimum.at(touch, couples.position, found.twist)
    ahead = np.maximum(AHEAD * (twists[numbers] - touch), LEAST_AHEAD)
    further = setting.turn * np.exp(1j * ahead[couples.position, None] * setting.contact_model.turning)
    later = replace(found, position=found.position + len(twists))
    both = Setting(setting.contact_model, joined([found, later]), np.concatenate([setting.turn, further]))
    after = joined([start, start])
    for _ in range(HELD_STEPS):
        state, made = after, step(both, after, search=False, held=True)
        after = made.next
    parts = slice(0, len(found)), slice(len(found), None)
    one, two = ((taken(state, part), taken(made, part)) for part in parts)
    here, there = (_contacts(setting, *at) for at in (one, two))
    sums = _sums(setting, here, one[1].energy)
    sums["tangent"] = (couples.total(there.torque_wheel) - sums["torque_wheel"]) / ahead
    settled = (couples.total(~one[1].settled | (one[1].changed > TOLERANCE)) == 0) & (sums["tangent"] > 0)
    now, whole, lacking = completed(setting, *one)
    rest = _joined([_kept(setting, one[1].next, ~settled & ~lacking), _kept(now, whole, lacking)])
    settled &= ~lacking
    for name, values in sums.items():
        solved[name][numbers[settled]] = values[settled]
    contacts = here.with_rates(there, ahead[couples.position])
    return taken(contacts, (contacts.force > 0) & settled[couples.position]), rest


def _contacts(setting: Setting, state: State, made: Step) -> Contacts:
    """All contacts of a step, also those without load; their rates are not known yet."""
    contact_model, one = setting.contact_model, made.next
    force, unknown = one.force * contact_model.width, np.full(len(one.force), np.nan)
    return Contacts(
        position=setting.found.position,
        pair=setting.found.pair,
        force=force,
        torque_wheel=-contact_model.pair.sign * force * cross(one.centre - contact_model.hub[1], state.normal),
        point=one.centre,
        normal=state.normal,
        arc=one.arc,
        half_width=2 * np.sqrt(one.variance),
        force_rate=unknown,
        normal_rate=unknown,
        growth=unknown,
        arc_rate=np.full_like(one.arc, np.nan),
        x=made.x - made.place[:, None],
        width=made.width,
        pressure=made.pressure,
        panel_arc=made.arcs,
    )


def _sums(setting: Setting, contacts: Contacts, energy: Array) -> dict[str, Array]:
    """Torques (N m) and energies (J) of the positions, shape (m,), from energies of contacts per width (J/m)."""
    couples, force, normal, sign = setting.couples, contacts.force, contacts.normal, setting.contact_model.pair.sign
    wheel = setting.tables.at(contacts.arc[:, :, None])[0][:, 1, 0] * setting.turn[:, 1]
    return {
        "torque_wheel": couples.total(contacts.torque_wheel),
        "torque_pinion": couples.total(force * cross(contacts.point, normal)),
        "torque_wheel_reaction": couples.total(-sign * force * cross(wheel, normal)),
        "energy": couples.total(energy * setting.contact_model.width),
    }


def coupling_compliances(
    contact_model: HalfPlanePair, pinion_angles: Array, twists: Array
) -> tuple[Array, IntArray, Array]:
    """Compliance between tooth pairs through the gear bodies, for all couples of pairs that touch at given twists.

    Returns
    -------
    angle, apart, compliance : ndarray, shape (c,)
        Pinion angle of the tooth of the couple's lower pair (rad), teeth between both pairs, and the approach of the
        gears at one pair by a unit force on the other (m/N). Forces are moments on the wheel over its base radius.
    """
    met = contact_model.first_contacts(pinion_angles)
    met = met.take(np.flatnonzero(met.twist < twists[met.position]))
    setting, state = unloaded(contact_model, twists, met)
    couples, arm = setting.couples, met.arm[:, 1] / contact_model.pair.wheel.base_radius
    found = far_field_compliance(setting, state) / (contact_model.width * arm[couples.first] * arm[couples.second])
    upper, own = couples.step > 0, met.angle + met.pair * contact_model.pair.mesh_cycle
    return own[couples.second[upper]], couples.step[upper], found[upper]
