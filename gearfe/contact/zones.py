r"""Where else do the flanks of tooth pairs bear, besides the contacts that are solved already?

The iteration (`.half_plane`) starts with one contact a tooth pair, where the rigid flanks first touch. Waves on a
flank, or a tip that runs along the mate's root, may let the pair bear in several places. Each stretch of pressure then
becomes a contact of its own, with its own centre, normal and window:

- *pressure with a hole*: the window of the contact is cut in the middle of the hole;
- *overlap outside of all windows*: with the solved forces, the faces must be clear of each other everywhere. Where
  they are not, a window that ends there is made wider, or, where the faces are clear in between, a contact is added and
  the flank cut where they are furthest apart.

Contacts of one pair act on each other exactly as the panels of one window do (`.half_plane_pair`), so one contact more
or less is another discretisation of the same pressure, and no other answer.

**The gap of the deformed faces** over all of their length, seen from a contact's centre along its normal n, is that of
the rigid faces (`gearfe.gear.flank_curve`) and :math:`n\cdot(u_2-u_1)`: u by the smooth influence of all pairs of the
position, by the half-planes and wedges of the pair's own contacts. It is of the first order in the displacements, which
is enough to look with: a contact that is added by mistake carries no force.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..gear.flank_curve import WAY, Faces
from ..typing import Array, BoolArray, IntArray
from .half_plane_pair import HalfPlanePair
from .half_plane_step import SIGN, WIDER, WINDOW, Setting, State, Step, answers, reference_approach
from .panels import EDGES, LEAST_DISTANCE, log_integral, mean_log
from .position import joined, taken

#: Force, in units of that of the position, up to which a missing contact is none.
MISSED = 1e-5
#: Rim of a window that counts as its own, in units of its width.
RIM = 0.02


class Stretch(NamedTuple):
    """Both faces over the stretch of flank of a contact: places (m), arcs and heights, (2, m), and deformed gap (m)."""

    x: Array
    arcs: Array
    heights: Array
    gap: Array


def completed(setting: Setting, state: State, made: Step) -> tuple[Setting, State, BoolArray] | None:
    """Contacts of tooth pairs that bear in more places than they have contacts.

    Returns
    -------
    tuple or None
        All contacts again, sorted by position, pair and place, and for each position (shape (m,)) whether it has more
        of them now; None where no pair does.
    """
    couples, found = setting.couples, setting.found
    bearing = made.pressure > 0
    cut = {int(i): _split(state, made, int(i)) for i in np.flatnonzero(_stretches(bearing) > 1)}
    x, arcs, heights, gap = _gaps(setting, state)
    total = couples.total(state.force)
    outside = _beyond(made, x)
    outside = outside[0] | outside[1]
    for i in np.flatnonzero((outside & (gap < 0)).any(axis=1)).tolist():
        exact = gap[i] + _beside_ellipse(setting.law, state, made, i, x[i])
        bound = -MISSED * reference_approach(setting.law) * total[couples.position[i]]
        if i not in cut and (outside[i] & (exact < bound)).any():
            cut[i] = _added(setting, state, made, i, Stretch(x[i], arcs[i], heights[i], exact), bound)
    if not cut:
        return None
    rest = np.setdiff1d(np.arange(len(state.force)), list(cut))
    numbers = np.concatenate([rest, *(np.full(len(part.force), i) for i, part in cut.items())])
    whole: State = joined([taken(state, rest), *cut.values()])
    order = np.lexsort((whole.arc[:, 0], found.pair[numbers], found.position[numbers]))
    changed = np.zeros(couples.positions, dtype=bool)
    changed[couples.position[list(cut)]] = True
    return setting.take(numbers[order]), taken(whole, order), changed


def _beyond(made: Step, x: Array) -> BoolArray:
    """Whether places x (m) of shape (p, m) lie before and behind the windows, shape (2, p, m)."""
    rim = RIM * (made.high - made.low)
    return np.stack([x < (made.low - rim)[:, None], x > (made.high + rim)[:, None]])


def _stretches(bearing: BoolArray) -> IntArray:
    """Numbers of stretches of panels that bear, shape (p,)."""
    return np.asarray(bearing[:, 0] + (bearing[:, 1:] & ~bearing[:, :-1]).sum(axis=1))


def _split(state: State, made: Step, i: int) -> State:
    """The contact i cut in the middle of each hole of its pressure."""
    edges = 0.5 * (made.high[i] + made.low[i]) + 0.5 * (made.high[i] - made.low[i]) * EDGES
    load = np.concatenate([[0.0], np.cumsum(made.pressure[i] * made.width[i])])
    on = np.concatenate([[False], made.pressure[i] > 0, [False]])
    first, end = np.flatnonzero(on[1:] & ~on[:-1]), np.flatnonzero(on[:-1] & ~on[1:])
    force = load[end] - load[first]
    half = 0.5 * (edges[end] - edges[first])
    parts = _copies(state, i, edges[first] + half)
    ends = parts.ends.copy()
    ends[1:, 0, 0] = ends[:-1, 0, 1] = state.arc[i, 0] + 0.5 * (edges[end[:-1]] + edges[first[1:]])
    return replace(parts, ends=ends, force=force, variance=0.25 * half**2, low=-half, high=half)


def _copies(state: State, i: int, place: Array) -> State:
    """Contacts like i about places x (m) along its tangent, without bearing panels."""
    made = taken(state, np.full(len(place), i))
    return replace(
        made,
        centre=made.centre - 1j * made.normal * place,
        arc=made.arc + place[:, None] * WAY,
        bearing=np.zeros_like(made.bearing),
    )


def _gaps(setting: Setting, state: State) -> tuple[Array, Array, Array, Array]:
    """Places x (m) over the stretches of flank of all contacts, shape (p, m), the faces' arcs and rigid heights there,
    shape (p, 2, m), and the gap of the deformed faces, shape (p, m) (m).
    """
    law, couples, tables = setting.law, setting.couples, setting.tables
    turn, seen_normal = setting.turn / state.normal[:, None], state.normal[:, None] / setting.turn
    rigid = (law.hub - state.centre[:, None]) / state.normal[:, None]
    faces = Faces(turn, rigid, np.zeros_like(turn), state.arc)
    low, high = faces.range(tables, state.ends)
    x = low[:, None] + (high - low)[:, None] * law.looked_at
    arcs = state.arc[:, :, None] + WAY[:, None] * x[:, None]  # nearly
    arcs = np.minimum(np.maximum(arcs, tables.low), tables.high)
    each = answers(law, law.shapes.at(state.arc)[:, :, 0], seen_normal, couples)[..., 0]
    load = state.force[couples.second][:, None, None] * SIGN[:, None]
    moved = law.shapes.along(np.add.reduceat(each * load, couples.starts), arcs)
    y, at = setting.distances(arcs), setting.distances(state.arc[:, :, None])
    i, j = couples.first[couples.step == 0], couples.second[couples.step == 0]
    load = state.force[:, None] * SIGN * seen_normal
    tension, shear = law.wedge
    wedge = tension * load + shear * load.conj()
    half = _half_widths(state)[j, None, None]
    local = 2 / np.pi * mean_log(arcs[i] - state.arc[j][:, :, None], half) * load[j][:, :, None]
    local += np.log(y[i] + at[j]) * wedge[j][:, :, None]
    np.add.at(moved, i, -law.inverse_modulus[:, None] * local)
    seen = moved * turn[:, :, None]
    arcs, heights, _ = faces.heights(tables, x[:, None] + seen.imag)  # of the points that come to x
    first, last = state.ends[:, :, :1], state.ends[:, :, 1:]
    past = ((arcs <= first) | (arcs >= last)).any(axis=1)
    apart = heights[:, 1] - heights[:, 0] + seen[:, 1].real - seen[:, 0].real
    return x, arcs, heights, np.where(past, np.inf, apart)


def _half_widths(state: State) -> Array:
    return np.maximum(2 * np.sqrt(state.variance), LEAST_DISTANCE)


def _beside_ellipse(law: HalfPlanePair, state: State, made: Step, i: int, x: Array) -> Array:
    """What the pressure of the contact i makes of the gap at places x (m) beside what an ellipse would (m)."""
    half = 0.5 * made.width[i]
    apart = x[:, None] - made.x[i]
    logs = (log_integral(apart + half) - log_integral(apart - half)) @ made.pressure[i]
    return np.asarray(law.compliance * (state.force[i] * mean_log(x, _half_widths(state)[i]) - logs))


def _added(setting: Setting, state: State, made: Step, i: int, stretch: Stretch, bound: float) -> State:
    """The contact i, and others where the faces overlap most beyond either end of its window, if they are clear of
    each other in between; else its window is to be wider.
    """
    law = setting.law
    own, ends, reach = taken(state, [i]), state.ends[[i]].copy(), state.reach[[i]]
    parts = []
    for way, side in enumerate(_beyond(taken(made, [i]), stretch.x[None])[:, 0]):
        beyond = np.flatnonzero(side)
        if len(beyond) == 0 or stretch.gap[beyond].min() >= bound:
            continue
        k = int(beyond[np.argmin(stretch.gap[beyond])])
        between = beyond[beyond < k] if way else beyond[beyond > k]
        if len(between) == 0 or stretch.gap[between].max() <= 0:
            reach = WIDER * state.reach[[i]]
            continue
        cut = stretch.arcs[0, between[np.argmax(stretch.gap[between])]]
        tangent = law.tables.of(setting.found.flank[i]).at(stretch.arcs[:, k, None])[1][:, 0] * setting.turn[i]
        along = 1j * (tangent[0] - tangent[1])
        new, limits, nothing = _copies(own, 0, stretch.x[[k]]), state.ends[[i]].copy(), np.zeros(1)
        limits[0, 0, 1 - way] = ends[0, 0, way] = cut
        parts.append(
            replace(
                new,
                centre=new.centre + new.normal * stretch.heights[:, k].mean(),
                normal=along[None] / np.abs(along),
                arc=stretch.arcs[None, :, k],
                ends=limits,
                force=-stretch.gap[[k]] / reference_approach(law),
                variance=nothing,
                low=nothing,
                high=nothing,
                reach=np.array([WINDOW]),
            )
        )
    return joined([replace(own, ends=ends, reach=reach), *parts])
