r"""Contact pressure of solved positions: Hertz's on smooth flanks, and apart from it where an edge bears.

A tooth pair that carries the force F over the width w, on flanks of relative curvature :math:`1/\rho` where they touch,
has Hertz's peak pressure (Johnson, *Contact Mechanics*, 1985, eq. 4.45)

.. math:: p_H = \sqrt{\frac{F E^*}{\pi\rho w}} = \frac{2F}{\pi b_H w} .

The computed pressure has a half width b of its own, by its second moment (`gearfe.contact.elements.half_widths`), so
:math:`|b/b_H - 1|` tells how far from Hertz's the contact is: the discretisation, flanks whose curvature changes along
the contact, teeth that are no half-planes. On flanks with deviations of micrometres, whose curvature where they touch
may be that of a wave shorter than the contact, :math:`2F/(\pi b w)` itself stands for the pressure.

Where the contact reaches an edge of a face, the pressure of linear elasticity has no bound (a sharp tip, the kink where
a linear relief starts, the edge of an undercut), or the radius of a tip round decides it. What stands for it there is

.. math:: p_e = \frac{2F}{\pi w \sqrt{b^2 + \epsilon^2}}, \qquad \epsilon = 0.01\,m,

the peak of a Hertzian contact with the same force and second moment, blunted by a hundredth of a module: a figure to
compare designs with, which neither the mesh nor a contact of some micrometres decides. It is no stress of the material.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..contact.compliance import MeshingPair
from ..contact.flank import Flank, edge_nodes, edge_shapes
from ..contact.half_plane_pair import HalfPlanePair
from ..contact.half_plane_result import PairContacts
from ..contact.position import Positions
from ..gear.deviation import NOMINAL
from ..typing import Array, BoolArray, IntArray
from .positions import PositionSolver

#: What bears besides smooth flanks, by number: nothing; a rounded tip edge; a sharp edge, under which the pressure of
#: linear elasticity is singular.
EDGES = ("none", "rounded", "singular")
_ROUNDED, _SINGULAR = 1, 2
#: Blunting length of edges (modules).
BLUNTING = 0.01

#: Of each position: largest Hertzian pressure of smooth flanks (Pa), its relative error, largest pressure where an edge
#: bears (Pa), both not-a-number where there is none; which edge bears, the place in `EDGES`.
QUANTITIES = ("peak_pressure", "peak_pressure_error", "edge_pressure", "edge")


@dataclass(frozen=True)
class PairLoads:
    """Tooth pairs that carry load, q of them over all positions, by position.

    Attributes
    ----------
    position, pair : ndarray, shape (q,)
        Number of the position; pair number k: pinion tooth k, wheel tooth -1 - k, counted on round the gears.
    force : ndarray, shape (q,)
        On the whole width (N).
    share : ndarray, shape (q,)
        Share of the wheel's torque (-).
    roll : ndarray, shape (q, 2)
        Roll lengths of the middle of the contact on pinion and wheel (m), without load for laws on elements;
        not-a-number off the involutes.
    half_width, pressure, error : ndarray, shape (q,)
        Half width (m), pressure of the module's docstring (Pa), and how far the contact is from Hertz's (-).
    edge : ndarray, shape (q,)
        Which edge bears, the place in `EDGES`.
    """

    position: IntArray
    pair: IntArray
    force: Array
    share: Array
    roll: Array
    half_width: Array
    pressure: Array
    error: Array
    edge: IntArray


def pair_loads(solver: PositionSolver, found: Positions) -> PairLoads:
    """Loaded tooth pairs of positions."""
    elastic, contacts, touching = solver.elastic, found.contacts, solver.touching(found.pinion_angle)
    met, pairs = ((np.stack([one.position, one.pair], axis=1) @ [1 << 32, 1]) for one in (touching, contacts))
    k = np.minimum(np.searchsorted(met, pairs), len(met) - 1)
    known = np.flatnonzero((contacts.torque_wheel > 0) & (met[k] == pairs))
    k, position, width = k[known], contacts.position[known], contacts.half_width[known]
    force = contacts.torque_wheel[known] / (touching.arm[k, 1] * elastic.width)
    curvature, flat = touching.curvature[k], np.isfinite(touching.curvature[k])
    flank, arc = touching.flank[k], solver.law.arc_at(touching.flank[k], touching.place[k])
    middle, half = arc[:, :, None], width[:, None, None]
    met = marks_met(solver.law, flank, middle - half, middle + half)
    rounded = solver.law.marks[0] == "round"
    bears = np.where(met[:, ~rounded].any(axis=1), _SINGULAR, np.where(met[:, rounded].any(axis=1), _ROUNDED, 0))
    several = np.unique(pairs[known], return_inverse=True, return_counts=True)
    bears[several[2][several[1]] > 1] = _ROUNDED  # not where the rigid flanks touch first, nor with one ellipse
    bears[~flat] = _SINGULAR  # it touches at the corner itself, however narrow the contact
    hertz = np.sqrt(force / solver.law.inverse_modulus.sum() * np.where(flat, curvature, 0.0) / math.pi)
    blunted = 2 * force / (math.pi * np.hypot(width, BLUNTING * solver.pair.pinion.module))
    off = np.abs(width * math.pi * hertz / (2 * force) - 1)
    if elastic.deviations != NOMINAL:  # waves shorter than the contact say nothing of its pressure; its width does
        hertz = 2 * force / (math.pi * width)
    return PairLoads(
        position=position,
        pair=contacts.pair[known],
        force=force * elastic.width,
        share=contacts.torque_wheel[known] / found.torque_wheel[position],
        roll=_rolls(solver.law, flank, contacts.arc[known] if isinstance(contacts, PairContacts) else arc),
        half_width=width,
        pressure=np.where(bears > 0, blunted, hertz),
        error=off,
        edge=bears,
    )


def _rolls(law: HalfPlanePair, flank: IntArray, arc: Array) -> Array:
    """Roll lengths (m) at arcs (m) of the flanks `flank`, all of shape (q, 2); not-a-number off the involutes."""
    made = np.full(arc.shape, np.nan)
    for i in np.unique(flank):
        curve, here = law.curves[i], np.nonzero(flank == i)
        u = curve.parameter_at(arc[here])
        on = (u >= 0) & (u <= 1)
        made[tuple(one[on] for one in here)] = curve.face.flank.roll(u[on])
    return made


def contact_pressures(found: Positions, loads: PairLoads) -> dict[str, Array]:
    """The `QUANTITIES` of n positions, each of shape (n,), from their loaded pairs."""
    made = {name: np.where(found.status == "no_contact", 0.0, np.nan) for name in QUANTITIES[:2]}
    made["edge_pressure"], edge = np.full(len(found), np.nan), np.zeros(len(found), dtype=np.int64)
    np.maximum.at(edge, loads.position, loads.edge)
    sharp, smooth = np.flatnonzero(loads.edge > 0), np.flatnonzero(loads.edge == 0)
    np.fmax.at(made["edge_pressure"], loads.position[sharp], loads.pressure[sharp])
    smooth = smooth[np.argsort(loads.pressure[smooth], kind="stable")]  # the largest of a position comes last and stays
    made["peak_pressure"][loads.position[smooth]] = loads.pressure[smooth]
    made["peak_pressure_error"][loads.position[smooth]] = loads.error[smooth]
    return {**made, "edge": edge}


def marks_met(law: HalfPlanePair, flank: IntArray, low: Array, high: Array) -> BoolArray:
    """Which of `HalfPlanePair.marks` lie between the arcs low and high (m), shape (m, 2, 1), of contacts on the flanks
    `flank`, shape (m, 2): shape (m, k).
    """
    _, of, (first, last) = law.marks
    return np.asarray(((flank[:, :, None] == of) & (low <= last) & (high >= first)).any(axis=1))


@dataclass(frozen=True)
class FlankPressure:
    """Pressure along one tooth's contact surface; arrays have one entry per contact point or panel, from root to tip.

    Attributes
    ----------
    gear
        0 pinion, 1 wheel.
    pair, tooth
        Number of the tooth pair, and of the tooth.
    place : ndarray, shape (q,)
        Edge number plus position in the edge, along the tooth's whole contact surface.
    radius : ndarray, shape (q,)
        Distance of the undeformed point from the gear's centre (m).
    pressure : ndarray, shape (q,)
        Pa.
    """

    gear: int
    pair: int
    tooth: int
    place: Array
    radius: Array
    pressure: Array

    @property
    def shown(self) -> IntArray:
        """Contact points with pressure and one neighbour on either side."""
        carries = self.pressure > 0
        near = carries.copy()
        near[1:] |= carries[:-1]
        near[:-1] |= carries[1:]
        return np.flatnonzero(near)

    def at_nodes(self, count: int) -> Array:
        """Pressure (Pa) at the `count` nodes of the tooth's contact surface, linear between the contact points."""
        return np.asarray(np.interp(0.5 * np.arange(count), self.place, self.pressure, left=0.0, right=0.0))


def flank_pressures(pair: MeshingPair, position: Positions) -> list[FlankPressure]:
    """Pressure on each loaded flank of one solved position."""
    made: list[FlankPressure] = []
    points = position.points
    assert points is not None
    for gear, number in dict.fromkeys(zip(points.gear.tolist(), points.pair.tolist(), strict=True)):
        mine = np.flatnonzero((points.gear == gear) & (points.pair == number))
        mine = mine[np.argsort(points.place[mine], kind="stable")]
        radius = np.linalg.norm(_points(pair.bodies[gear].flank, points.place[mine]), axis=1)
        tooth = number if gear == 0 else -1 - number
        made.append(FlankPressure(gear, number, tooth, points.place[mine], radius, points.pressure[mine]))
    return made


def _points(flank: Flank, place: Array) -> Array:
    """Points (m) of a tooth's contact surface, shape (q, 2)."""
    edge = np.clip(place.astype(np.int64), 0, flank.edges - 1)
    shapes = edge_shapes(place - edge)[0]
    return np.asarray(np.einsum("qa,qai->qi", shapes, flank.points[edge_nodes(edge)]))
