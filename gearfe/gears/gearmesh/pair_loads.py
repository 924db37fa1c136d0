r"""Loaded tooth pairs of solved positions: forces, shares, and the pressures of their contacts.

Pressures are Hertz's on smooth flanks, and separate from it at an edge. A tooth pair that carries the force F over the
width w, on flanks of relative curvature :math:`1/\rho` at first contact, has Hertz's peak pressure (Johnson, *Contact
Mechanics*, 1985, eq. 4.45)

.. math:: p_H = \sqrt{\frac{F E^*}{\pi\rho w}} = \frac{2F}{\pi b_H w} .

The computed pressure has a half width b by its own second moment (`gears.contact.elements.half_widths`). So
:math:`|b/b_H - 1|` is how far the contact is from Hertz's. Causes are the discretisation, flanks whose curvature
changes along the contact, and teeth that are no half-planes. On flanks with deviations of micrometres the curvature at
first contact may be that of a wave shorter than the contact; there :math:`2F/(\pi b w)` is the pressure.

If the contact reaches an edge of a face, the pressure of linear elasticity has no bound, or depends on the radius of a
tip round. Unbounded are sharp tips, the kink where a linear relief starts, and the edge of an undercut. The pressure
given there is

.. math:: p_e = \frac{2F}{\pi w \sqrt{b^2 + \epsilon^2}}, \qquad \epsilon = 0.01\,m,

the peak of a Hertzian contact with the same force and second moment, blunted by a hundredth of a module. This figure
compares designs; it depends neither on the mesh nor on contacts of some micrometres. It is no stress of the material.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.typing import Array, BoolArray, IntArray
from ..geometry.face import NOMINAL
from ..geometry.validity import CONFORMING
from .curve import EDGES, ROUNDED, SINGULAR, SOLVED

if TYPE_CHECKING:
    from ..contact.half_plane_pair import HalfPlanePair
    from ..contact.position import Positions
    from .positions import PositionSolver

#: Blunting length of edges (modules).
BLUNTING = 0.01


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
        Roll lengths of the middle of the contact on pinion and wheel (m); NaN off the involutes.
    half_width, pressure, error : ndarray, shape (q,)
        Half width (m), pressure above (Pa), and how far the contact is from Hertz's (-).
    edge : ndarray, shape (q,)
        Which edge is loaded, the place in `EDGES`.
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


def pair_loads(solver: PositionSolver, solved: Positions) -> PairLoads:
    """Return the loaded tooth pairs of positions."""
    elastic, contacts, contact_model = solver.elastic, solved.contacts, solver.contact_model
    first_contact = contact_model.first_contacts(solved.pinion_angle)
    met, pairs = ((np.stack([one.position, one.pair], axis=1) @ [1 << 32, 1]) for one in (first_contact, contacts))
    k = np.minimum(np.searchsorted(met, pairs), len(met) - 1)
    known = np.flatnonzero((contacts.torque_wheel > 0) & (met[k] == pairs))
    k, position, width = k[known], contacts.position[known], contacts.half_width[known]
    force = contacts.torque_wheel[known] / (first_contact.arm[k, 1] * elastic.width)
    curvature, flat = first_contact.curvature[k], np.isfinite(first_contact.curvature[k])
    flank, half = first_contact.flank[k], width[:, None, None]
    middle = contact_model.arc_at(flank, first_contact.place[k])[:, :, None]
    reached = marks_met(contact_model, flank, middle - half, middle + half)
    rounded = contact_model.marks[0] == "round"
    edge = np.where(reached[:, rounded].any(axis=1), ROUNDED, 0)
    edge[reached[:, ~rounded].any(axis=1)] = SINGULAR
    several = np.unique(pairs[known], return_inverse=True, return_counts=True)
    edge[several[2][several[1]] > 1] = ROUNDED  # not where the rigid flanks touch first, nor with one ellipse
    edge[~flat] = SINGULAR  # it touches at the corner itself, however narrow the contact
    hertz = np.sqrt(force / contact_model.inverse_modulus.sum() * np.where(flat, curvature, 0.0) / math.pi)
    blunted = 2 * force / (math.pi * np.hypot(width, BLUNTING * solver.pair.pinion.module))
    error = np.abs(width * math.pi * hertz / (2 * force) - 1)
    if elastic.deviations != NOMINAL:  # waves shorter than the contact say nothing of its pressure; its width does
        hertz = 2 * force / (math.pi * width)
    return PairLoads(
        position=position,
        pair=contacts.pair[known],
        force=force * elastic.width,
        share=contacts.torque_wheel[known] / solved.torque_wheel[position],
        roll=_rolls(contact_model, flank, contacts.arc[known]),
        half_width=width,
        pressure=np.where(edge > 0, blunted, hertz),
        error=error,
        edge=edge,
    )


def _rolls(contact_model: HalfPlanePair, flank: IntArray, arc: Array) -> Array:
    """Roll lengths (m) at arcs (m) of the flanks `flank`, all of shape (q, 2); NaN off the involutes."""
    rolls = np.full(arc.shape, np.nan)
    for i in np.unique(flank):
        face, places = contact_model.teeth.faces[i], np.nonzero(flank == i)
        u = face.parameter_at(arc[places])
        on = (u >= 0) & (u <= 1)
        rolls[tuple(axis[on] for axis in places)] = face.flank.roll(u[on])
    return rolls


def conforms(loads: PairLoads, count: int) -> BoolArray:
    """Return which of `count` positions have contacts wider than `CONFORMING` allows, shape (count,)."""
    radius = np.fmin(*np.abs(loads.roll).T)
    wide = np.flatnonzero(loads.half_width > CONFORMING * radius)
    return np.bincount(loads.position[wide], minlength=count) > 0


def marks_met(contact_model: HalfPlanePair, flank: IntArray, low: Array, high: Array) -> BoolArray:
    """Return which of `HalfPlanePair.marks` lie between two arcs of contacts.

    Parameters
    ----------
    contact_model : HalfPlanePair
        The pair.
    flank : ndarray of int, shape (m, 2)
        Flanks of the contacts.
    low, high : ndarray, shape (m, 2, 1)
        Arcs (m).

    Returns
    -------
    met : ndarray of bool, shape (m, k)
        For each contact and mark.
    """
    _, of, (first, last) = contact_model.marks
    return np.asarray(((flank[:, :, None] == of) & (low <= last) & (high >= first)).any(axis=1))


def contact_pressures(solved: Positions, loads: PairLoads) -> dict[str, Any]:
    """Return the fields of a `StiffnessCurve` about pressures and edges at n positions, from their loaded pairs."""
    edge, at_edges = np.zeros(len(solved), dtype=np.int64), np.full(len(solved), np.nan)
    pressure, error = np.where(solved.status == "no_contact", 0.0, np.full((2, len(solved)), np.nan))
    np.maximum.at(edge, loads.position, loads.edge)
    sharp, smooth = np.flatnonzero(loads.edge > 0), np.flatnonzero(loads.edge == 0)
    np.fmax.at(at_edges, loads.position[sharp], loads.pressure[sharp])
    smooth = smooth[np.argsort(loads.pressure[smooth], kind="stable")]  # the largest of a position comes last and stays
    pressure[loads.position[smooth]], error[loads.position[smooth]] = loads.pressure[smooth], loads.error[smooth]
    words = np.array(EDGES)[np.where(np.isin(solved.status, SOLVED), edge, 0)]
    return {"peak_pressure": pressure, "peak_pressure_error": error, "edge_pressure": at_edges, "edge": words}
