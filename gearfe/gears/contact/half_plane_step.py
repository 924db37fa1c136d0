"""One step of the half-plane law's iteration: its equations are in `gearfe.gears.contact.half_plane`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.typing import Array, BoolArray, ComplexArray, IntArray
from ..geometry.face import FlankTables
from ..geometry.first_contact import LOOK, WAY, Faces, FirstContacts, windows
from .half_plane_pair import HalfPlanePair, local_influence, panel_influence
from .panels import LEAST_DISTANCE, MIDDLES, PANELS, WIDTHS, Couplings, couplings, first_guess, influence, unilateral
from .position import ANGLE_ROUNDING, taken

#: Gap at the window's ends in units of that at the ends of Hertz's contact of the same force, and what it grows by
#: where the pressure reaches an end: beside edges contacts are wider.
WINDOW, WIDER = 1.25, 1.6
#: Change from which on windows grow that cut a pressure: sooner, what a pressure reaches on its way would decide.
WIDENED_BELOW = 1e-3
#: What moves of contacts by their width count as changes of force: they are of second order there (`.half_plane`).
MOVED = 0.1
#: Force per width (N/m) that is none.
SMALL = 1e-6
#: Force, of all pairs of a position, and half width in modules below which a window is not made smaller.
LEAST_FORCE, LEAST_WIDTH = 1e-4, 1e-6
#: Largest share of a position's force that rounding may make: what is lighter is not solved.
MOST_UNSEEN = 0.01
#: Half width (modules) of Hertz's contacts whose approach first forces are made with: a length, as T in them is what
#: the logarithms of lengths in metres leave.
REFERENCE_WIDTH = 0.01
#: Directions of the forces of a contact on pinion and wheel along n.
SIGN = np.array([-1.0, 1.0])
#: Distances of the panels' middles in a window of half width 1.
_BETWEEN = np.diff(MIDDLES)


@dataclass(frozen=True)
class Setting:
    """What no step changes: the teeth of p contacts in m positions; pinion and wheel in the second axis.

    Attributes
    ----------
    contact_model
        The pair as the half-plane law sees it.
    found
        Where the rigid flanks of the contacts' tooth pairs first touch, sorted by position, pair and place.
    turn : ndarray of complex, shape (p, 2)
        Turn of the teeth: tooth axes to global ones.
    """

    contact_model: HalfPlanePair
    found: FirstContacts
    turn: ComplexArray

    @cached_property
    def numbers(self) -> IntArray:
        """Numbers of the positions, rising, shape (m,)."""
        return np.unique(self.found.position)

    @cached_property
    def couples(self) -> Couplings:
        """Which contacts share a position."""
        return couplings(np.searchsorted(self.numbers, self.found.position), self.found.pair, len(self.numbers))

    @cached_property
    def tables(self) -> FlankTables:
        """Both flanks of each contact."""
        return self.contact_model.tables.of(self.found.flank)

    @cached_property
    def corner(self) -> ComplexArray:
        """Their corners (m), shape (p, 2)."""
        return np.asarray(self.contact_model.corner[self.found.flank])

    def distances(self, arcs: Array) -> Array:
        """Distances y (m) of the faces at arcs (m) of shape (p, 2, n) from their corners."""
        return np.maximum(np.abs(self.tables.points(arcs) - self.corner[:, :, None]), LEAST_DISTANCE)

    def take(self, contacts: IntArray) -> Setting:
        """Only some of the contacts."""
        return Setting(self.contact_model, taken(self.found, contacts), self.turn[contacts])


@dataclass(frozen=True)
class State:
    """What a step for p contacts starts from; pinion and wheel in the second axis.

    Attributes
    ----------
    centre, normal : ndarray of complex, shape (p,)
        O (m) and n, global axes.
    arc : ndarray, shape (p, 2)
        The material at O (m).
    ends : ndarray, shape (p, 2, 2)
        First and last arc (m) of both flanks that may belong to the contact. That is the whole flank of the wheel, and
        of the pinion's the stretch up to the next contacts of the tooth pair.
    force, variance : ndarray, shape (p,)
        Force per width (N/m) that displaces the faces, and the variance of its pressure (m2).
    low, high : ndarray, shape (p,)
        Ends of the windows along the tangent from O (m).
    bearing : ndarray of bool, shape (p, n)
        Panels that bore then; none at first.
    reach : ndarray, shape (p,)
        Gap at the window's ends, in units of that at the ends of Hertz's contact.
    """

    centre: ComplexArray
    normal: ComplexArray
    arc: Array
    ends: Array
    force: Array
    variance: Array
    low: Array
    high: Array
    bearing: BoolArray
    reach: Array


@dataclass(frozen=True)
class FarField:
    """Influence of the loads of contacts along n on the far-field displacements of the faces, in c couples.

    Attributes
    ----------
    moved, slope : ndarray of complex, shape (c, 2)
        Displacement and its slope of the first faces of each couple by a unit force per width on the second, tooth axes
        (m2/N, m/N).
    compliance : ndarray, shape (c,)
        T = w n H n (m2/N).
    """

    moved: ComplexArray
    slope: ComplexArray
    compliance: Array


@dataclass(frozen=True)
class Step:
    """One step for p contacts: the problem that was solved, its solution, and what follows from it.

    Attributes
    ----------
    next
        What the next step starts from: frames at the mean place of the pressure, along the mean normal under it.
    pressure : ndarray, shape (p, n)
        On the panels (Pa).
    settled : ndarray of bool, shape (p,)
        Whether it was found which panels of the position bear.
    low, high : ndarray, shape (p,)
        Ends of the windows (m).
    outgrown : ndarray of bool, shape (p,)
        Contacts whose pressure reaches an end of its window beyond which both faces go on: the next one is wider.
    x, width : ndarray, shape (p, n)
        Panels' middles and widths (m).
    arcs : ndarray, shape (p, 2, n)
        Arc lengths of the panels' middles (m).
    place : ndarray, shape (p,)
        Mean place of the pressure (m).
    energy : ndarray, shape (p,)
        Elastic energy of each contact per width (J/m); 0 while windows are searched for.
    changed : ndarray, shape (p,)
        What it changed in the contact's position, see `change`.
    """

    next: State
    pressure: Array
    settled: BoolArray
    low: Array
    high: Array
    outgrown: BoolArray
    x: Array
    width: Array
    arcs: Array
    place: Array
    energy: Array
    changed: Array


def cross(a: ComplexArray, b: ComplexArray) -> Array:
    """a_x b_y - a_y b_x."""
    return np.asarray((np.conj(a) * b).imag)


def far_field_influence(
    contact_model: HalfPlanePair, couples: Couplings, normal: ComplexArray, arc: Array, variance: Array
) -> FarField:
    r"""Return the far-field influence H between all contacts of a position, with its slope.

    The bumps average over their widths, and the contacts have other widths. With the variances v of the pressures and
    a^2/4 of the bumps, H on one tooth is larger by
    :math:`\tfrac12(v_i-\tfrac14a_i^2)\,\partial_{ss}H+\tfrac12(v_j-\tfrac14a_j^2)\,\partial_{tt}H` along the normals.

    Parameters
    ----------
    contact_model : HalfPlanePair
        The pair.
    couples : Couplings
        Which contacts share a position.
    normal : ndarray of complex, shape (p, 2)
        n in the teeth's axes.
    arc : ndarray, shape (p, 2)
        Arcs of the contacts on both flanks (m).
    variance : ndarray, shape (p,)
        Variances of the pressures (m2).
    """
    shapes = contact_model.shapes.at(arc)
    values = shapes[:, :, 0]
    at_stations = answers(contact_model, values, normal, couples)
    moved = (shapes.take(couples.first, axis=0) @ at_stations.view(float)).view(complex)[..., 0]
    excess = variance[:, None] - np.einsum("pgk,gk->pg", values, contact_model.bump_squares)
    along = normal.take(couples.first, axis=0)
    bent = moved[:, :, 2] * excess.take(couples.first, axis=0) * (couples.step == 0)[:, None]
    half = 0.5 * (bent * along.conj()).real
    here = moved[:, :, 0] + bent + along * (half.take(couples.back, axis=0) - half)
    return FarField(here, moved[:, :, 1], (here * along.conj()).real.sum(axis=1))


def answers(contact_model: HalfPlanePair, values: Array, normal: ComplexArray, couples: Couplings) -> ComplexArray:
    """Return the far-field displacements at the stations of the first tooth of each couple.

    They answer a unit force per width along the normal of the second contact.

    Parameters
    ----------
    contact_model : HalfPlanePair
        The pair.
    values : ndarray, shape (p, 2, k)
        Shape functions of the stations at the contacts.
    normal : ndarray of complex, shape (p, 2)
        n in the teeth's axes.
    couples : Couplings
        Couples (i, j) of contacts.

    Returns
    -------
    displacement : ndarray of complex, shape (c, 2, k, 1)
        In tooth axes (m2/N).
    """
    count, k = len(normal), values.shape[2]
    load = (values[..., None] * normal.view(float).reshape(count, 2, 1, 2)).reshape(count, 2, 2 * k)
    furthest = int(np.abs(couples.step).max(initial=0))
    wide = 2 * furthest + 1
    answer = np.matmul(load.swapaxes(0, 1), contact_model.influence(furthest)).reshape(2, count * wide, k, 2)
    columns = couples.second * wide + couples.step + furthest
    return answer.take(columns, axis=1).swapaxes(0, 1).view(complex)


def reference_approach(contact_model: HalfPlanePair) -> float:
    """Approach of both faces by a unit force per width of a usual contact (m2/N)."""
    return float(contact_model.compliance * (0.5 - np.log(0.5 * REFERENCE_WIDTH * contact_model.pair.pinion.module)))


def step(setting: Setting, state: State, *, search: bool = True, held: bool = False) -> Step:
    """Solve the panels of all contacts with the faces displaced by the state's forces.

    Parameters
    ----------
    setting : Setting
        Teeth and contacts, which no step changes.
    state : State
        Forces, places and windows from which the step starts.
    search : bool
        Whether windows are searched for; else they stay.
    held : bool
        Whether the loaded panels stay, so that the step is a smooth function of its state.
    """
    contact_model, couples, tables, corner = setting.contact_model, setting.couples, setting.tables, setting.corner
    normal, force = state.normal[:, None] / setting.turn, state.force
    beside = couples.beside
    far_field = far_field_influence(contact_model, couples, normal, state.arc, state.variance)
    y, far = _distances(setting, state.arc)
    load = (force[:, None] * SIGN).take(couples.second, axis=0)
    displaced, stretch = couples.sums(far_field.moved * load), couples.sums(far_field.slope * load)
    plane, wedge = near = local_influence(contact_model, beside, normal)
    i, j = beside.first, beside.second
    apart = np.maximum(np.abs(state.arc[i] - state.arc[j]), LEAST_DISTANCE)
    across = (plane.imag * np.log(apart) + wedge.imag * np.log(y[i] + y[j])) * (force[:, None] * SIGN)[j]
    turn = setting.turn / state.normal[:, None]
    offset = (
        (contact_model.hub - state.centre[:, None]) / state.normal[:, None]
        + turn * displaced
        + 1j * beside.sums(across)
    )
    faces = Faces(turn, offset, stretch, state.arc)

    low, high, found = state.low, state.high, None
    if search:
        module = contact_model.pair.pinion.module
        softness = 0.2 * contact_model.compliance  # half width squared of a usual contact
        least = LEAST_FORCE * couples.total(force)[couples.position] + LEAST_WIDTH**2 * module / softness
        floor = np.maximum(force, least)
        scale, reach = np.sqrt(softness * module * floor), faces.range(tables, state.ends)
        look = np.minimum(np.maximum(scale[:, None] * LOOK, reach[0][:, None]), reach[1][:, None])
        arcs, heights, _ = faces.heights(tables, look)
        gap = heights[:, 1] - heights[:, 0]
        if len(beside.first) > len(force):
            gap += _opened(setting, state, near, arcs)
        found = windows(look, heights, gap, state.reach * contact_model.compliance * floor)
        low, high = found.low, np.maximum(found.high, found.low + 2e-4 * scale)
    half = 0.5 * (high - low)
    x = np.zeros((len(half), PANELS + 1))  # at last O itself
    np.add(0.5 * (high + low)[:, None], half[:, None] * MIDDLES, out=x[:, :PANELS])
    arcs, heights, points = faces.heights(tables, x)
    arc, height = arcs[:, :, PANELS], 0.5 * (heights[:, 0, PANELS] + heights[:, 1, PANELS])
    x, width, arcs, heights = x[:, :PANELS], half[:, None] * WIDTHS, arcs[:, :, :PANELS], heights[:, :, :PANELS]
    gap = heights[:, 1] - heights[:, 0]
    if contact_model.kinks[0].shape[1]:
        gap += _mean_over_kinks(setting, arcs, width)
    y = np.maximum(np.abs(points[:, :, :PANELS] - corner[:, :, None]), LEAST_DISTANCE)
    local = panel_influence(near, beside, (arcs, y), (arcs, y, width))
    K = local[:, 0] + local[:, 1]
    own = slice(None) if len(K) == len(half) else beside.own  # a slice is not copied
    K[own] += influence(half, contact_model.compliance)
    bearing = state.bearing if state.bearing.any() else first_guess(gap)
    free = gap - couples.sums(far_field.compliance * force.take(couples.second))[:, None]  # the gap holds these forces
    p, approach, settled = unilateral(couples, K, far_field.compliance, width, free, bearing, held=held)
    force = (p * width).sum(axis=1)
    loaded = force > 0
    shares = p * width / np.where(loaded, force, 1.0)[:, None]
    place = (shares * x).sum(axis=1)
    # not below nothing: panels that are held may pull
    variance = np.maximum((shares * ((x - place[:, None]) ** 2 + width**2 / 12)).sum(axis=1), 0.0)
    between = 0.5 * (p[:, 1:] + p[:, :-1])
    # both deformed faces have the same slope; the one further from its edges changes less with where it is taken
    into = beside.sums((local @ p.take(beside.second, axis=0)[:, None, :, None])[..., 0])
    deformed = heights - WAY[:, None] * into
    middle = (far[:, :, None] * deformed).sum(axis=1)
    area = between @ _BETWEEN
    slope = (between * (middle[:, 1:] - middle[:, :-1])).sum(axis=1) / np.where(area > 0, half * area, 1.0)
    outgrown, energy = np.zeros(len(p), dtype=bool), np.zeros(len(p))
    if found is None:
        energy = 0.5 * (p * width * approach).sum(axis=1)
    else:
        place, slope = np.where(loaded, place, found.nearest), np.where(loaded, slope, found.mean_slope)
        outgrown = ((p[:, 0] > 0) & (low > reach[0])) | ((p[:, -1] > 0) & (high < reach[1]))
    turned = 1 + 1j * slope
    following = State(
        centre=state.centre + state.normal * (height - 1j * place),
        normal=state.normal * turned / np.abs(turned),
        arc=np.minimum(np.maximum(arc + place[:, None] * WAY, tables.low[:, :, 0]), tables.high[:, :, 0]),
        ends=state.ends,
        force=force,
        variance=variance,
        low=low - place,
        high=high - place,
        bearing=p > 0,
        reach=state.reach,
    )
    changed, settled = change(setting, state, following, place)[couples.position], settled[couples.position]
    wider = outgrown & (changed <= WIDENED_BELOW)
    following = replace(following, reach=np.where(wider, WIDER * state.reach, state.reach))
    return Step(following, p, settled, low, high, outgrown, x, width, arcs, place, energy, changed)


def unseen_force(contact_model: HalfPlanePair) -> float:
    r"""Force per width (N/m) that rounding of the gears' angles makes of none: :math:`r_b\,\Delta\varphi` over the
    approach of a usual contact.

    Gaps are differences of places and have the rounding of these, whatever the load. Places and widths of contacts, in
    units of the widths, change by about as much. With :math:`b^2\kappa = 2CF`, a gap tilted by e over b moves its place
    by :math:`e/(b\kappa)`, which is :math:`e/(2CF)` of b.
    """
    return ANGLE_ROUNDING * contact_model.pair.wheel.base_radius / reference_approach(contact_model)


def change(setting: Setting, state: State, new: State, place: Array) -> Array:
    """Return the change of a step beyond rounding, for each position.

    Changes of forces count in units of their sum; those of the contacts' places and widths, in units of these, are
    weighted by the forces.

    Parameters
    ----------
    setting : Setting
        Teeth and contacts.
    state : State
        State before the step.
    new : State
        State after it.
    place : ndarray, shape (p,)
        Mean places of the pressures from the contacts' centres, by which these move (m).

    Returns
    -------
    change : ndarray, shape (m,)
        Of the forces, and of places and widths times the forces, over the sum of the forces.
    """
    couples = setting.couples
    safe = np.where(new.variance > 0, new.variance, 1.0)
    moved = (new.variance > 0) * (0.5 * np.abs(place) / np.sqrt(safe) + np.abs(1 - state.variance / safe))
    all_ = np.abs(new.force - state.force) + MOVED * new.force * moved
    force = np.maximum(couples.total(new.force), SMALL)
    unseen = unseen_force(setting.contact_model)
    return np.maximum(couples.total(all_) - np.where(unseen < MOST_UNSEEN * force, unseen, 0.0), 0.0) / force


def _opened(setting: Setting, state: State, near: tuple[ComplexArray, ComplexArray], arcs: Array) -> Array:
    """How far the other contacts of the pair open the gap at arcs (m) of each, (p, 2, m), under even pressures (m);
    `near` is their `local_influence`.
    """
    couples = setting.couples.beside
    width = np.maximum(4 * np.sqrt(state.variance), LEAST_DISTANCE)[:, None]
    own = state.arc[:, :, None]
    panels = own, setting.distances(own), width
    by = (state.force[:, None] / width)[couples.second] * (couples.first != couples.second)[:, None]
    into = panel_influence(near, couples, (arcs, setting.distances(arcs)), panels)[..., 0]
    return couples.sums(into.sum(axis=1) * by)


def _mean_over_kinks(setting: Setting, arcs: Array, width: Array) -> Array:
    """Return how much larger the mean gap of a panel with a kink of a face is than the gap at its middle (m), shape (p,
    n). With the gap at the middle, pressures would swing with the places of the kinks among the panels.
    """
    places, angles = (values[setting.found.flank][:, :, None] for values in setting.contact_model.kinks)
    inside = np.maximum(0.5 * width[:, None, :, None] - np.abs(arcs[..., None] - places), 0.0)
    return np.asarray((angles * inside**2).sum(axis=(1, 3)) / (2 * width))


def _distances(setting: Setting, arc: Array) -> tuple[Array, Array]:
    """Return distances y (m) of the faces at arcs (m) from their corners, and shares of the faces by the square of
    their distance from all edges. Both have the shape (p, 2).
    """
    y = setting.distances(arc[:, :, None])[:, :, 0]
    near = 1 / y**2 + setting.contact_model.undercut / np.maximum(np.abs(arc), LEAST_DISTANCE) ** 2
    return y, near[:, ::-1] / near.sum(axis=1, keepdims=True)
