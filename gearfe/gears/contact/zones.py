r"""Where else do the flanks of tooth pairs bear, besides the contacts that are solved already?

The iteration (`.half_plane`) starts with one contact a tooth pair, where the rigid flanks first touch. Waves on a
flank, or a tip that runs along the mate's root, may let the pair bear in several places. Each stretch of pressure then
becomes a contact of its own, with its own centre, normal and window:

- *pressure with a hole*: the window of the contact is cut in the middle of the hole;
- *overlap outside of all windows*: with the solved forces, the faces must be clear of each other everywhere. Where
  they are not, a window that ends there is made wider. Where the faces are clear in between, a contact is added
  instead, and the flank is cut where they are furthest apart.

Contacts of one pair act on each other exactly as the panels of one window do (`.half_plane_pair`). So one contact more
or less only changes the discretisation of the same pressure.

**The gap of the deformed faces** is seen from a contact's centre along its normal n, over the whole length of the
faces. It is the gap of the rigid faces (`geometry.first_contact`) and :math:`n\cdot(u_2-u_1)`. The displacements u come
from the far-field influence of all pairs of the position, and from the half-planes and wedges of the pair's own
contacts. It is of the first order in the displacements, which is enough to look with: a contact that is added by
mistake carries no force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.typing import Array, BoolArray, IntArray
from ..geometry.first_contact import WAY, Faces
from .half_plane_pair import local_influence
from .half_plane_step import SIGN, WIDER, WINDOW, Setting, State, Step, answers, reference_approach
from .panels import EDGES, LEAST_DISTANCE, log_integral, mean_log
from .position import joined, taken

#: Force, in units of that of the position, up to which a missing contact is none.
MISSED = 1e-5
#: Rim of a window that counts as its own, in units of its width.
RIM = 0.02


def completed(setting: Setting, state: State, made: Step) -> tuple[Setting, State, BoolArray]:
    """Contacts of tooth pairs that bear in more places than they have contacts.

    Returns
    -------
    tuple
        All contacts again, sorted by position, pair and place, and for each position (shape (m,)) whether it has more
        of them now.
    """
    couples, found = setting.couples, setting.found
    bearing = made.pressure > 0
    cut = {int(i): _split(state, made, int(i)) for i in np.flatnonzero(_stretches(bearing) > 1)}
    x, arcs, gap = _gaps(setting, state)
    bound = -MISSED * reference_approach(setting.contact_model) * couples.total(state.force)[couples.position]
    sides = _beyond(made, x)
    for i in np.flatnonzero((sides.any(axis=0) & (gap < 0)).any(axis=1)).tolist():
        exact = gap[i] + _beside_ellipses(setting, state, made, i, arcs[i, 0])
        if i not in cut and (sides[:, i].any(axis=0) & (exact < bound[i])).any():
            cut[i] = _added(setting, state, i, (x[i], arcs[i, 0], exact), sides[:, i], bound[i])
    changed = np.zeros(couples.positions, dtype=bool)
    if not cut:
        return setting, state, changed
    rest = np.setdiff1d(np.arange(len(state.force)), list(cut))
    numbers = np.concatenate([rest, *(np.full(len(part.force), i) for i, part in cut.items())])
    whole: State = joined([taken(state, rest), *cut.values()])
    order = np.lexsort((whole.arc[:, 0], found.pair[numbers], found.position[numbers]))
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


def _gaps(setting: Setting, state: State) -> tuple[Array, Array, Array]:
    """Return places x over the stretches of flank of all contacts, shape (p, m), and the faces' arcs there, shape (p,
    2, m). The third is the gap of the deformed faces under elliptic pressures, shape (p, m). All are in m.
    """
    contact_model, couples, tables = setting.contact_model, setting.couples, setting.tables
    turn, normal = setting.turn / state.normal[:, None], state.normal[:, None] / setting.turn
    rigid = (contact_model.hub - state.centre[:, None]) / state.normal[:, None]
    faces = Faces(turn, rigid, np.zeros_like(turn), state.arc)
    low, high = faces.range(tables, state.ends)
    x = low[:, None] + (high - low)[:, None] * contact_model.looked_at
    arcs = state.arc[:, :, None] + WAY[:, None] * x[:, None]  # nearly
    arcs = np.minimum(np.maximum(arcs, tables.low), tables.high)
    each = answers(contact_model, contact_model.shapes.at(state.arc)[:, :, 0], normal, couples)[..., 0]
    load = state.force[couples.second][:, None, None] * SIGN[:, None]
    moved = contact_model.shapes.along(couples.sums(each * load), arcs)
    beside = couples.beside
    i, j = beside.first, beside.second
    load = (state.force[:, None] * SIGN)[j]
    plane, wedge = ((one * load)[:, :, None] for one in local_influence(contact_model, beside, normal))
    y, at = setting.distances(arcs), setting.distances(state.arc[:, :, None])
    logs = mean_log(arcs[i] - state.arc[j][:, :, None], _half_widths(state)[j, None, None])
    seen = moved * turn[:, :, None] + beside.sums(plane * logs + wedge * np.log(y[i] + at[j]))
    arcs, heights, _ = faces.heights(tables, x[:, None] + seen.imag)  # of the points that come to x
    past = ((arcs <= state.ends[:, :, :1]) | (arcs >= state.ends[:, :, 1:])).any(axis=1)
    gap = heights[:, 1] - heights[:, 0] + seen[:, 1].real - seen[:, 0].real
    return x, arcs, np.where(past, np.inf, gap)


def _half_widths(state: State) -> Array:
    return np.maximum(2 * np.sqrt(state.variance), LEAST_DISTANCE)


def _beside_ellipses(setting: Setting, state: State, made: Step, i: int, arcs: Array) -> Array:
    """Return by how much the pressures of the contacts of i's tooth pair change the gap at arcs (m) of the pinion's
    face, against ellipses (m), shape (m,). A pressure that ends at a cut is no ellipse.
    """
    found = setting.found
    own = np.flatnonzero((found.position == found.position[i]) & (found.pair == found.pair[i]))
    half, apart = 0.5 * made.width[own], arcs[:, None, None] - made.arcs[own, 0]
    logs = ((log_integral(apart + half) - log_integral(apart - half)) * made.pressure[own]).sum(axis=2)
    ellipses = state.force[own] * mean_log(arcs[:, None] - state.arc[own, 0], _half_widths(state)[own])
    return np.asarray(setting.contact_model.compliance * (ellipses - logs).sum(axis=1))


def _added(
    setting: Setting, state: State, i: int, seen: tuple[Array, Array, Array], sides: BoolArray, bound: float
) -> State:
    """Return the contact i, and others where the faces overlap most beyond either end of its window, if they are clear
    in between. Otherwise the window of i is to be wider.

    Parameters
    ----------
    seen
        Places (m), arcs of the pinion's face and gaps there (m), shape (m,).
    sides : ndarray of bool, shape (2, m)
        Whether these lie before and behind the window.
    """
    x, arcs, gap = seen
    own, parts = taken(state, [i]), []
    for way, side in enumerate(sides):
        beyond = np.flatnonzero(side)
        if len(beyond) == 0 or gap[beyond].min() >= bound:
            continue
        k = int(beyond[np.argmin(gap[beyond])])
        between = beyond[beyond < k] if way else beyond[beyond > k]
        if len(between) == 0 or gap[between].max() <= 0:
            own = replace(own, reach=WIDER * own.reach)
            continue
        new, nothing = _copies(own, 0, x[[k]]), np.zeros(1)
        new.ends[0, 0, 1 - way] = own.ends[0, 0, way] = arcs[between[np.argmax(gap[between])]]
        force = -gap[[k]] / reference_approach(setting.contact_model)
        reach = np.array([WINDOW])
        parts.append(replace(new, force=force, variance=nothing, low=nothing, high=nothing, reach=reach))
    return joined([own, *parts])
