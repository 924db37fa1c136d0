"""Solved positions of the half-plane law: arrays over positions, and arrays over the contacts that carry load."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..gear.touching import WAY
from ..typing import Array, ComplexArray, IntArray
from .compliance import MeshingPair
from .flank import Flank, edge_shapes
from .half_plane_pair import HalfPlanePair
from .half_plane_step import Setting, State, Step, cross
from .position import FlankLoads, PointPressures


@dataclass(frozen=True)
class PairContacts:
    """Loaded contacts, m of them over all positions, by position, pair number and place on the pinion's flank.

    A tooth pair has one where it bears on one stretch of its flanks, else one for each stretch.

    Attributes
    ----------
    position : ndarray, shape (m,)
        Number of the position.
    pair : ndarray, shape (m,)
        Pair number k: pinion tooth k, wheel tooth -1 - k.
    force : ndarray, shape (m,)
        Contact force on the whole width (N).
    force_rate, normal_rate, growth : ndarray, shape (m,)
        d force/d twist (N/rad), the normal's rotation per twist (-), and d ln b/d twist (1/rad).
    arc_rate : ndarray, shape (m, 2)
        d arc/d twist (m/rad).
    torque_wheel : ndarray, shape (m,)
        Moment of the force about the wheel's hub (N m), at the deformed place.
    point, normal : ndarray of complex, shape (m,)
        Centre of pressure (m) and common normal out of the pinion, global axes.
    arc : ndarray, shape (m, 2)
        The material there on pinion and wheel: arc length from the start of the working flank (m).
    half_width : ndarray, shape (m,)
        b = 2 sqrt(variance of the pressure about its mean) (m): Hertz's where the pressure is elliptic.
    x, width, pressure : ndarray, shape (m, n)
        Panels: middles along the tangent -i n from the centre of pressure, widths (m), and pressures (Pa).
    panel_arc : ndarray, shape (m, 2, n)
        Arc lengths of the panels' middles on both faces (m).
    """

    position: IntArray
    pair: IntArray
    force: Array
    force_rate: Array
    normal_rate: Array
    growth: Array
    arc_rate: Array
    torque_wheel: Array
    point: ComplexArray
    normal: ComplexArray
    arc: Array
    half_width: Array
    x: Array
    width: Array
    pressure: Array
    panel_arc: Array

    def __len__(self) -> int:
        return len(self.pair)

    def without_panels(self) -> PairContacts:
        """These without their panels, for many positions in little memory."""
        panels = ("x", "width", "pressure", "panel_arc")
        return replace(self, **{name: getattr(self, name)[..., :0] for name in panels})

    def moved(self, by: Array, factor: Array) -> PairContacts:  # noqa: ARG002 (laws on elements move by factors)
        """These at twists larger by `by` (rad), one number a position: forces and widths."""
        here = by[self.position]
        force = np.maximum(self.force + self.force_rate * here, 0.0)
        scale = np.divide(force, self.force, out=np.ones(len(force)), where=self.force > 0)
        return replace(
            self,
            force=force,
            torque_wheel=self.torque_wheel * scale,
            half_width=self.half_width * np.exp(self.growth * here),
        )


def moment_on_wheel(law: HalfPlanePair, state: State, made: Step) -> Array:
    """Moments of the contacts' forces about the wheel's hub (N m), shape (p,)."""
    return -made.next.force * law.width * cross(made.next.centre - law.hub[1], state.normal)


def position_sums(setting: Setting, state: State, made: Step) -> dict[str, Array]:
    """Torques (N m) and energies (J) of the positions, shape (m,)."""
    law, couples, force = setting.law, setting.couples, made.next.force * setting.law.width
    wheel = setting.tables.at(made.next.arc[:, :, None])[0][:, 1, 0] * setting.turn[:, 1]
    return {
        "torque_wheel": couples.total(moment_on_wheel(law, state, made)),
        "torque_pinion": couples.total(force * cross(made.next.centre, state.normal)),
        "torque_wheel_reaction": couples.total(-force * cross(wheel, state.normal)),
        "energy": couples.total(made.energy * law.width),
    }


def contacts_of(setting: Setting, here: tuple[State, Step], ahead: tuple[State, Step], by: Array) -> PairContacts:
    """All contacts of a step, also those without load; their rates are from that at twists larger by `by` (rad), shape
    (p,).
    """
    (state, made), width = here, setting.law.width
    one, two = made.next, ahead[1].next
    wider = np.divide(two.variance, one.variance, out=np.ones(len(by)), where=one.variance > 0)
    return PairContacts(
        position=setting.found.position,
        pair=setting.found.pair,
        force=one.force * width,
        force_rate=(two.force - one.force) * width / by,
        normal_rate=np.angle(ahead[0].normal / state.normal) / by,
        growth=0.5 * (wider - 1) / by,
        arc_rate=(two.arc - one.arc) / by[:, None],
        torque_wheel=moment_on_wheel(setting.law, state, made),
        point=one.centre,
        normal=state.normal,
        arc=one.arc,
        half_width=2 * np.sqrt(one.variance),
        x=made.x - made.place[:, None],
        width=made.width,
        pressure=made.pressure,
        panel_arc=made.arcs,
    )


def flank_loads(
    elastic: MeshingPair, contacts: PairContacts, angles: Array, twists: Array
) -> tuple[FlankLoads, FlankLoads]:
    """Loads on the flanks of pinion and wheel: for fields, root stress and finite strain.

    They are the consistent ones of the pressures on the panels, at their places on the deformed flanks and along the
    common normal. Displacements recovered from them are those of the teeth; nearer to a contact than an element or two
    they show what the coarse flank makes of the pressure. Stresses there: `gearfe.stiffness.fields`.

    Parameters
    ----------
    contacts
        m loaded pairs.
    angles, twists : ndarray, shape (n,)
        Pinion angles and twists from the centred position (rad) of the positions that they are of.
    """
    place = angles[contacts.position], twists[contacts.position]
    made = []
    for g, tooth in enumerate((contacts.pair, -1 - contacts.pair)):
        shares, moved = _nodal(elastic.bodies[g].flank, contacts, g)
        along = (2 * g - 1) * contacts.normal * np.exp(-1j * elastic.tooth_angle(g, tooth, *place))
        # the wheel's axes turn on with the twist
        rate = contacts.force_rate + 1j * (contacts.normal_rate - g) * contacts.force
        force = (contacts.force * along)[:, None] * shares
        change = along[:, None] * (rate[:, None] * shares + contacts.force[:, None] * moved)
        made.append(FlankLoads(contacts.position, tooth, force.view(float), change.view(float)))
    return made[0], made[1]


def panel_pressures(elastic: MeshingPair, contacts: PairContacts) -> PointPressures:
    """Pressures on the panels of loaded pairs, at their places on both flanks."""
    places = [np.add(*body.flank.place(contacts.panel_arc[:, g])) for g, body in enumerate(elastic.bodies)]
    place, panels = np.stack(places, axis=1), contacts.pressure.shape[1]  # (m, 2, n)
    position, pair = (np.repeat(one, 2 * panels) for one in (contacts.position, contacts.pair))
    gear = np.tile(np.repeat([0, 1], panels), len(contacts))
    return PointPressures(position, gear, pair, place.ravel(), np.repeat(contacts.pressure, 2, axis=0).ravel())


def _nodal(flank: Flank, contacts: PairContacts, gear: int) -> tuple[Array, Array]:
    """Of each pair the shares of the force on the nodes of the flank, which add up to 1, and their rates with the twist
    (1/rad) as the pressure moves along the flank and widens, both of shape (m, nodes).
    """
    load = contacts.pressure * contacts.width
    edge, xi = flank.place(contacts.panel_arc[:, gear])
    value, slope, _ = edge_shapes(xi)
    share = load / load.sum(axis=1, keepdims=True)
    moves = contacts.arc_rate[:, gear, None] + WAY[gear] * contacts.x * contacts.growth[:, None]
    shape = len(load), len(flank.nodes)
    at = (np.arange(shape[0])[:, None] * shape[1] + 2 * edge)[:, :, None] + np.arange(3)
    weights = value * share[:, :, None], slope * (moves / flank.sizes[edge] * share)[:, :, None]
    shares, moved = (np.bincount(at.ravel(), w.ravel(), shape[0] * shape[1]).reshape(shape) for w in weights)
    return shares, moved
