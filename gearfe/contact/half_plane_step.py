"""One step of the half-plane law's balance: its equations are in `gearfe.contact.half_plane`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..gear.deviation import NOMINAL, ToothDeviations
from ..gear.flank_curve import FlankCurve, FlankTables, flank_curve, flank_tables
from ..gear.pair import GearPair
from ..gear.tooth_flanks import ToothFlanks
from ..gear.touching import Flanks
from .flank_compliance import FlankCompliance, Shapes, corner_of, flank_compliances, shapes_of
from .moved_faces import WAY, Faces, Windows, windows
from .panels import MIDDLES, WIDTHS, Couplings, Pressed, first_guess, influence, pressed
from .scene import MeshingPair

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]

#: Gap at the window's ends in units of that at the ends of Hertz's contact of the same force, and what it grows by
#: where the pressure reaches an end: beside edges contacts are wider.
WINDOW, WIDER = 1.25, 1.6
#: Force, of all pairs of a position, and half width in modules below which a window is not made smaller.
LEAST_FORCE, LEAST_WIDTH = 1e-4, 1e-6
#: Distance (m) from an edge that is none.
LEAST_DISTANCE = 1e-9
#: Directions of the forces of a contact on pinion and wheel along n.
_SIGN = np.array([-1.0, 1.0])


@dataclass(frozen=True)
class HalfPlanePair:
    """A gear pair as the half-plane law sees it.

    Attributes
    ----------
    pair
        Geometry.
    teeth
        Working flanks of all teeth, where their first touch is searched for.
    sides
        Compliance of pinion's and wheel's flank, without deviations.
    width
        Width of the contact (m).
    """

    pair: GearPair
    teeth: ToothFlanks
    sides: tuple[FlankCompliance, FlankCompliance]
    width: float

    @property
    def flanks(self) -> Flanks:
        """The first profiles of both gears."""
        return self.teeth.first

    @cached_property
    def curves(self) -> tuple[FlankCurve, ...]:
        """Exact flanks, f of them: the faces of `teeth`."""
        gears = (self.pair.pinion, self.pair.wheel)
        return tuple(flank_curve(gears[self.teeth.gear_of(i)], face) for i, face in enumerate(self.teeth.faces))

    @cached_property
    def tables(self) -> FlankTables:
        """These in one table."""
        return flank_tables(self.curves)

    def arc_at(self, flank: IntArray, parameter: Array) -> Array:
        """Arc lengths (m) of parameters u on the flanks `flank`, both of shape (p, 2)."""
        made = np.empty(np.shape(parameter))
        for i in np.unique(flank):
            made[flank == i] = self.curves[i].arc_at(parameter[flank == i])
        return made

    def parameter_at(self, flank: IntArray, arc: Array) -> Array:
        """Parameters u of arc lengths (m) on the flanks `flank`, both of shape (p, 2)."""
        made = np.empty(np.shape(arc))
        for i in np.unique(flank):
            made[flank == i] = self.curves[i].parameter_at(arc[flank == i])
        return made

    @cached_property
    def shapes(self) -> Shapes:
        """Shape functions of the stations."""
        return shapes_of([side.stations for side in self.sides])

    @cached_property
    def inverse_modulus(self) -> Array:
        """1/E' (1/Pa), shape (2,)."""
        return np.array([side.inverse_modulus for side in self.sides])

    @cached_property
    def compliance(self) -> float:
        """2/pi (1/E_1' + 1/E_2') (1/Pa)."""
        return float(2 / np.pi * self.inverse_modulus.sum())

    @cached_property
    def hub(self) -> Array:
        """x of the gears' centres (m), shape (2,)."""
        return np.array([0.0, self.pair.working_centre_distance])

    @cached_property
    def corner(self) -> ComplexArray:
        """Corners of flanks and tip circles (m), shape (f,)."""
        return np.array([corner_of(curve)[0] for curve in self.curves])

    @cached_property
    def wedge(self) -> tuple[Array, ComplexArray]:
        """W of both gears as W v = a v + b conj(v), both of shape (2,) (-)."""
        W = np.array([side.wedge for side in self.sides])
        return 0.5 * (W[:, 0, 0] + W[:, 1, 1]), 0.5 * (W[:, 0, 0] - W[:, 1, 1]) + 1j * W[:, 0, 1]

    @cached_property
    def undercut(self) -> Array:
        """1 where the working flank starts with the edge of an undercut, shape (2,)."""
        return np.array([float(side.curve.face.fall > 0.0) for side in self.sides])

    @cached_property
    def marks(self) -> list[tuple[str, int, float]]:
        """Name, flank and arc length (m) of the flanks' marks, see `half_plane_result.PairContacts`, by rising rank."""
        found = []
        for name in ("undercut", "relief", "round", "tip"):
            for flank, curve in enumerate(self.curves):
                face = curve.face
                places = {
                    "undercut": [0.0] if face.fall > 0.0 else [],
                    "relief": face.kinks.tolist(),
                    "round": [] if face.sharp else [1.0],
                    "tip": [face.end] if face.sharp else [],
                }[name]
                found += [(name, flank, float(curve.arc_at(at))) for at in places]
        return found

    @cached_property
    def bump_squares(self) -> Array:
        """Mean squares a^2/4 of the stations' bumps (m2), shape (2, k)."""
        made = np.zeros_like(self.shapes.stations)
        for gear, side in enumerate(self.sides):
            made[gear, : len(side.bumps)] = 0.25 * side.bumps**2
        return made

    def influence(self, steps: int) -> Array:
        """w H between the stations of teeth -steps ... steps apart, shape (2, 2k, (2 steps + 1) 2k) (m2/N)."""
        if steps not in self._influences:
            k = self.shapes.stations.shape[1]
            made = np.zeros((2, k, 2, 2 * steps + 1, k, 2))
            for gear, side in enumerate(self.sides):
                n = len(side.stations)
                for step in range(-steps, steps + 1):
                    smooth = side.smooth[step if gear == 0 else -step]
                    made[gear, :n, :, step + steps, :n] = self.width * smooth.T.reshape(n, 2, n, 2)
            self._influences[steps] = made.reshape(2, 2 * k, -1)
        return self._influences[steps]

    @cached_property
    def _influences(self) -> dict[int, Array]:
        return {}

    def deviated(self, deviations: tuple[ToothDeviations, ToothDeviations]) -> HalfPlanePair:
        """The same elastic gears with other deviations of micrometres, which are in the flanks' curves alone."""
        return HalfPlanePair(self.pair, ToothFlanks(self.pair, deviations), self.sides, self.width)


def half_plane_pair(
    pair: GearPair, elastic: MeshingPair, *, deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL
) -> HalfPlanePair:
    """Prepare the law for meshed and condensed gears; their flanks may be coarse (a tenth of a module)."""
    return HalfPlanePair(pair, ToothFlanks(pair, deviations), flank_compliances(pair, elastic), elastic.width)


@dataclass(frozen=True)
class State:
    """What a step of the balance of p tooth pairs starts from; pinion and wheel in the second axis.

    Attributes
    ----------
    centre, normal : ndarray of complex, shape (p,)
        O (m) and n, global axes.
    turn : ndarray of complex, shape (p, 2)
        Turn of the teeth: tooth axes to global ones.
    flank : ndarray, shape (p, 2)
        Numbers of their flanks in `HalfPlanePair.curves`.
    arc : ndarray, shape (p, 2)
        The material at O (m).
    force, spread : ndarray, shape (p,)
        Force per width (N/m) that displaces the faces, and the variance of its pressure (m2).
    low, high : ndarray, shape (p,)
        Ends of the windows of the step before along the tangent from O (m).
    bearing : ndarray of bool, shape (p, n)
        Panels that bore then; none at first.
    reach : ndarray, shape (p,)
        Gap at the window's ends, in units of that at the ends of Hertz's contact.
    """

    centre: ComplexArray
    normal: ComplexArray
    turn: ComplexArray
    flank: IntArray
    arc: Array
    force: Array
    spread: Array
    low: Array
    high: Array
    bearing: BoolArray
    reach: Array


@dataclass(frozen=True)
class Smooth:
    """Influence of the loads of p tooth pairs along n on the smooth displacements of the faces, in c couples.

    Attributes
    ----------
    normal : ndarray of complex, shape (p, 2)
        n in the teeth's axes.
    values, bends : ndarray, shape (p, 2, k)
        Shape functions of the stations at the arcs, and their curvatures (1/m2).
    moved : ndarray of complex, shape (c, 2, 3)
        Displacement, its slope and curvature of the first face of each couple by a unit force per width on the second,
        tooth axes (m2/N, m/N, 1/N).
    compliance : ndarray, shape (c,)
        T = w n H n (m2/N).
    """

    normal: ComplexArray
    values: Array
    bends: Array
    moved: ComplexArray
    compliance: Array


@dataclass(frozen=True)
class Step:
    """One step of the balance of p tooth pairs: the problem that was solved, its solution, and what follows from it.

    Attributes
    ----------
    solution
        Pressures and forces.
    low, high : ndarray, shape (p,)
        Ends of the windows (m).
    outgrown : ndarray of bool, shape (p,)
        Pairs whose pressure reaches an end of its window beyond which both faces go on.
    x, width : ndarray, shape (p, n)
        Panels' middles and widths (m).
    arcs : ndarray, shape (p, 2, n)
        Arc lengths of the panels' middles (m).
    arc, height : ndarray, shape (p, 2), (p,)
        The material at O, and the height of the faces' middle there (m).
    place, spread : ndarray, shape (p,)
        Mean place of the pressure (m) and its variance about it (m2).
    slope : ndarray, shape (p,)
        Mean slope of the deformed faces under the pressure (-).
    energy : ndarray, shape (p,)
        Elastic energy of each pair per width (J/m).
    """

    solution: Pressed
    low: Array
    high: Array
    outgrown: BoolArray
    x: Array
    width: Array
    arcs: Array
    arc: Array
    height: Array
    place: Array
    spread: Array
    slope: Array
    energy: Array


def cross(a: ComplexArray, b: ComplexArray) -> Array:
    """a_x b_y - a_y b_x."""
    return np.asarray((np.conj(a) * b).imag)


def smooth_influence(law: HalfPlanePair, state: State, couples: Couplings) -> Smooth:
    """H at the arcs and along the normals of all pairs."""
    normal = state.normal[:, None] / state.turn
    shapes = law.shapes.at(state.arc)
    values = shapes[:, :, 0]
    pairs, k = len(normal), values.shape[2]
    load = (values[..., None] * normal.view(float).reshape(pairs, 2, 1, 2)).reshape(pairs, 2, 2 * k)
    most = int(np.abs(couples.step).max(initial=0))
    answer = np.matmul(load.swapaxes(0, 1), law.influence(most)).reshape(2, pairs, 2 * most + 1, k, 2)
    at_stations = answer[:, couples.second, couples.step + most].swapaxes(0, 1)
    moved = (shapes.take(couples.first, axis=0) @ at_stations).view(complex)[..., 0]
    compliance = (moved[:, :, 0] * normal.take(couples.first, axis=0).conj()).real.sum(axis=1)
    return Smooth(normal, values, shapes[:, :, 2], moved, compliance)


def step(law: HalfPlanePair, state: State, couples: Couplings, *, search: bool = True, held: bool = False) -> Step:
    """Solve the panels of all pairs with the faces displaced by the state's forces.

    Parameters
    ----------
    search
        Whether windows are searched for; else they stay.
    held
        Whether the bearing panels stay too, so that the step is a smooth function of its state.
    """
    smooth = smooth_influence(law, state, couples)
    normal, force = smooth.normal, state.force
    tension, shear = law.wedge
    shear = shear * normal.conj() ** 2
    tables, corner = law.tables.of(state.flank), law.corner[state.flank]
    y, far = _distances(law, tables, corner, state.arc)
    load = force[:, None] * _SIGN
    displaced = np.add.reduceat(smooth.moved * (force.take(couples.second)[:, None] * _SIGN)[..., None], couples.starts)
    # the contact's own width, and that of the bumps
    bend = smooth.moved[couples.own, :, 2] * load
    wider = (state.spread[:, None] - np.einsum("pgk,gk->pg", smooth.values, law.bump_squares)) * bend
    # across n the wedge moves the faces as a whole: n W along the tangent -i n
    edge = law.inverse_modulus * shear.imag * np.log(2 * y) * load * (-1j * normal)
    turn = state.turn / state.normal[:, None]
    offset = (law.hub - state.centre[:, None]) / state.normal[:, None] + turn * (displaced[:, :, 0] + edge + wider)
    faces = Faces(turn, offset, displaced[:, :, 1], state.arc)

    low, high, found = state.low, state.high, None
    if search:
        found = _searched(law, tables, state, faces, couples)
        low, high = found.low, found.high
    half = 0.5 * (high - low)
    x = np.empty((len(half), len(MIDDLES) + 1))
    np.add(0.5 * (high + low)[:, None], half[:, None] * MIDDLES, out=x[:, :-1])
    x[:, -1] = 0.0  # O itself
    arcs, heights, points = faces.heights(tables, x)
    arc, height = arcs[:, :, -1], 0.5 * (heights[:, 0, -1] + heights[:, 1, -1])
    x, width, arcs, heights = x[:, :-1], half[:, None] * WIDTHS, arcs[:, :, :-1], heights[:, :, :-1]
    gap = heights[:, 1] - heights[:, 0]
    y = np.maximum(np.abs(points[:, :, :-1] - corner[:, :, None]), LEAST_DISTANCE)
    along = law.inverse_modulus * (tension + shear.real)
    edges = np.log(y[:, :, :, None] + y[:, :, None, :]) * (-along[:, :, None, None] * width[:, None, None, :])
    K = influence(half, law.compliance) + edges[:, 0] + edges[:, 1]
    bearing = state.bearing if state.bearing.any() else first_guess(gap)
    solution = pressed(K, gap, width, smooth.compliance, force, couples, bearing, held=held)

    p, loaded = solution.pressure, solution.force > 0
    shares = p * width / np.where(loaded, solution.force, 1.0)[:, None]
    place = (shares * x).sum(axis=1)
    spread = (shares * ((x - place[:, None]) ** 2 + width**2 / 12)).sum(axis=1)
    between = 0.5 * (p[:, 1:] + p[:, :-1])
    # both deformed faces have the same slope; the one further from its edges changes less with where it is taken
    deformed = heights - WAY[:, None] * (edges @ p[:, None, :, None])[..., 0]
    middle = (far[:, :, None] * deformed).sum(axis=1)
    area = (between * np.diff(x)).sum(axis=1)
    slope = (between * np.diff(middle)).sum(axis=1) / np.where(area > 0, area, 1.0)
    outgrown: BoolArray = np.zeros(len(p), dtype=bool)
    if found is not None:
        place, slope = np.where(loaded, place, found.nearest), np.where(loaded, slope, found.lean)
        outgrown = np.asarray(((p[:, [0, -1]] > 0) & found.free).any(axis=1))
    energy = 0.5 * (
        (p * width * solution.approach).sum(axis=1)
        + solution.force * couples.times(smooth.compliance, solution.force)
        + ((wider * normal.conj()).real * load).sum(axis=1)
    )
    return Step(solution, low, high, outgrown, x, width, arcs, arc, height, place, spread, slope, energy)


def _distances(law: HalfPlanePair, tables: FlankTables, corner: ComplexArray, arc: Array) -> tuple[Array, Array]:
    """Distances y (m) of the faces at arcs (m) from their corners, and shares of the faces by the square of their
    distance from all edges, both of shape (p, 2).
    """
    y = np.maximum(np.abs(tables.at(arc[:, :, None])[0][:, :, 0] - corner), LEAST_DISTANCE)
    near = 1 / y**2 + law.undercut / np.maximum(np.abs(arc), LEAST_DISTANCE) ** 2
    return y, near[:, ::-1] / near.sum(axis=1, keepdims=True)


def _searched(law: HalfPlanePair, tables: FlankTables, state: State, faces: Faces, couples: Couplings) -> Windows:
    """Windows by the gap beside its least."""
    module = law.pair.pinion.module
    least = LEAST_WIDTH**2 * module / (0.2 * law.compliance)
    floor = np.maximum(state.force, LEAST_FORCE * couples.total(state.force)[couples.position] + least)
    scale = np.sqrt(0.2 * law.compliance * floor * module)
    return windows(faces, tables, scale, state.reach * law.compliance * floor)


def moved_on(law: HalfPlanePair, state: State, made: Step, *, near: BoolArray | bool) -> State:
    """What the next step starts from: frames at the mean place of the pressure, along the mean normal under it.

    Windows grow only `near` the solution, so that they do not depend on the way to it.
    """
    found, place = made.solution, made.place
    arc = made.arc + place[:, None] * WAY
    turned = 1 + 1j * made.slope
    return State(
        centre=state.centre + state.normal * (made.height - 1j * place),
        normal=state.normal * turned / np.abs(turned),
        turn=state.turn,
        flank=state.flank,
        arc=np.minimum(np.maximum(arc, law.tables.low[state.flank, 0]), law.tables.high[state.flank, 0]),
        force=found.force,
        spread=made.spread,
        low=made.low - place,
        high=made.high - place,
        bearing=found.pressure > 0,
        reach=np.where(made.outgrown & near, WIDER * state.reach, state.reach),
    )
