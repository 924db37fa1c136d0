"""One step of the half-plane law's balance: its equations are in `gearfe.contact.half_plane`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..gear.flank_curve import FlankCurve
from ..gear.pair import GearPair
from ..gear.touching import Flanks
from .flank_compliance import FlankCompliance, flank_compliances
from .moved_faces import WAY, Frames, Windows, windows
from .panels import MIDDLES, WIDTHS, Couplings, Pressed, first_guess, influence, pressed
from .scene import MeshingPair

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

#: Gap at the window's ends in units of that at the ends of Hertz's contact of the same force, and what it grows by
#: where the pressure reaches an end: beside edges contacts are wider.
WINDOW, WIDER = 1.25, 1.6
#: Force, of all pairs of a position, below which a window is not made smaller.
LEAST_FORCE = 1e-4


@dataclass(frozen=True)
class HalfPlanePair:
    """A gear pair as the half-plane law sees it.

    Attributes
    ----------
    pair
        Geometry.
    flanks
        Working flanks of both gears, where their first touch is searched for.
    sides
        Compliance of pinion's and wheel's flank.
    width
        Width of the contact (m).
    """

    pair: GearPair
    flanks: Flanks
    sides: tuple[FlankCompliance, FlankCompliance]
    width: float

    @cached_property
    def curves(self) -> tuple[FlankCurve, FlankCurve]:
        """Exact flanks."""
        return self.sides[0].curve, self.sides[1].curve

    @cached_property
    def compliance(self) -> float:
        """2/pi (1/E_1' + 1/E_2') (1/Pa)."""
        return 2 / np.pi * sum(side.inverse_modulus for side in self.sides)

    @cached_property
    def hub(self) -> Array:
        """x of the gears' centres (m), shape (2,)."""
        return np.array([0.0, self.pair.working_centre_distance])


def half_plane_pair(pair: GearPair, elastic: MeshingPair) -> HalfPlanePair:
    """Prepare the law for meshed and condensed gears; their flanks may be coarse (a tenth of a module)."""
    return HalfPlanePair(pair, Flanks(pair), flank_compliances(pair, elastic), elastic.width)


@dataclass(frozen=True)
class Smooth:
    """Influence of loads along the normals on the smooth displacements of p faces.

    Attributes
    ----------
    compliance : ndarray, shape (c,)
        T = w n H n, by couple (m2/N).
    values, slopes, bends : tuple of ndarray, shape (p, k)
        Shape functions of the stations at the arcs, for pinion and wheel.
    moved : tuple of dict of int to ndarray, shape (p, 2k)
        For each gear: step -> displacements of the stations so many teeth on for a force per width along n (m2/N).
    """

    compliance: Array
    values: tuple[Array, Array]
    slopes: tuple[Array, Array]
    bends: tuple[Array, Array]
    moved: tuple[dict[int, Array], dict[int, Array]]


@dataclass(frozen=True)
class Step:
    """One step of the balance of p tooth pairs: the problem that was solved, its solution, and what follows from it.

    Attributes
    ----------
    frames
        Frames in which it was solved.
    window
        Where the panels are.
    solution
        Pressures and forces.
    x, width, gap : ndarray, shape (p, n)
        Panels' middles, widths and the gap there (m).
    arcs : ndarray, shape (p, 2, n)
        Arc lengths of the panels' middles (m).
    place, spread : ndarray, shape (p,)
        Mean place of the pressure (m) and its variance about it (m2).
    slope : ndarray, shape (p,)
        Mean slope of the deformed faces under the pressure (-).
    energy : ndarray, shape (p,)
        Elastic energy of each pair per width (J/m).
    """

    frames: Frames
    window: Windows
    solution: Pressed
    x: Array
    width: Array
    gap: Array
    arcs: Array
    place: Array
    spread: Array
    slope: Array
    energy: Array


@dataclass(frozen=True)
class Before:
    """What a step takes from the step before.

    Attributes
    ----------
    window
        Windows, seen from where the pressure was then.
    bearing : ndarray of bool, shape (p, n)
        Panels that bore.
    reach : ndarray, shape (p,)
        Gap at the next windows' ends, in units of that at the ends of Hertz's contact.
    """

    window: Windows
    bearing: NDArray[np.bool_]
    reach: Array


def cross(a: ComplexArray, b: ComplexArray) -> Array:
    """a_x b_y - a_y b_x."""
    return np.asarray((np.conj(a) * b).imag)


def _components(vectors: ComplexArray) -> Array:
    return np.stack([vectors.real, vectors.imag], axis=-1)


def smooth_influence(law: HalfPlanePair, frames: Frames, couples: Couplings) -> Smooth:
    """H at the arcs and along the normals of all pairs."""
    total = np.zeros(len(couples.first))
    parts: list[tuple[Array, Array, Array]] = []
    moved: list[dict[int, Array]] = []
    for gear, side in enumerate(law.sides):
        shapes = side.shapes(frames.arc[:, gear])
        normal = _components(frames.normal / frames.turn[:, gear])
        load = (shapes[0][:, :, None] * normal[:, None, :]).reshape(len(normal), -1)
        steps = couples.step if gear == 0 else -couples.step
        made = {int(k): law.width * (load @ side.smooth[int(k)].T) for k in np.unique(steps)}
        for k, answer in made.items():
            on = np.flatnonzero(steps == k)
            total[on] += np.einsum("ij,ij->i", load[couples.first[on]], answer[couples.second[on]])
        parts.append(shapes)
        moved.append(made)
    values, slopes, bends = zip(*parts, strict=True)
    return Smooth(total, values, slopes, bends, (moved[0], moved[1]))


def displaced(
    law: HalfPlanePair, frames: Frames, smooth: Smooth, force: Array, spread: Array, couples: Couplings
) -> tuple[Frames, Array]:
    """Frames with the faces displaced by the forces per width (N/m), and the energy per width (J/m) that the contacts'
    own widths make.
    """
    shift, stretch = np.zeros_like(frames.shift), np.zeros_like(frames.stretch)
    energy = np.zeros(len(force))
    for gear, side in enumerate(law.sides):
        load = (2 * gear - 1) * force
        steps = couples.step if gear == 0 else -couples.step
        stations = np.zeros((len(force), 2 * len(side.stations)))
        for k, answer in smooth.moved[gear].items():
            on = np.flatnonzero(steps == k)
            first, second = couples.first[on], couples.second[on]
            stations[first] += load[second, None] * answer[second]  # one couple at most has this step from a pair
        at_stations = stations.reshape(len(force), -1, 2) @ np.array([1, 1j])
        own = (load[:, None] * smooth.moved[gear][0]).reshape(len(force), -1, 2) @ np.array([1, 1j])
        normal = frames.normal / frames.turn[:, gear]
        across = np.einsum("pi,ij,pj->p", _components(-1j * normal), side.wedge, _components(normal))
        edge = -side.inverse_modulus * across * np.log(2 * side.distance(frames.arc[:, gear])) * load
        wider = (spread - smooth.values[gear] @ (0.25 * side.bumps**2)) * (smooth.bends[gear] * own).sum(axis=1)
        shift[:, gear] = (smooth.values[gear] * at_stations).sum(axis=1) + edge * -1j * normal + wider
        stretch[:, gear] = (smooth.slopes[gear] * at_stations).sum(axis=1)
        energy += 0.5 * load * (wider * normal.conj()).real
    return replace(frames, shift=shift, stretch=stretch), energy


def recentred(law: HalfPlanePair, frames: Frames) -> Frames:
    """Frames about the middle between both faces at x = 0, with the material that is there."""
    arc, shift, height = frames.arc.copy(), frames.shift.copy(), np.zeros(len(frames.arc))
    for gear, curve in enumerate(law.curves):
        s, h, _ = frames.heights(curve, gear, np.zeros((len(arc), 1)))
        shift[:, gear] += frames.stretch[:, gear] * (s[:, 0] - arc[:, gear])
        arc[:, gear] = s[:, 0]
        height += 0.5 * h[:, 0]
    return replace(frames, arc=arc, shift=shift, centre=frames.centre + height * frames.normal)


def _edges(law: HalfPlanePair, frames: Frames, arcs: Array, width: Array) -> list[Array]:
    """What the wedge of each gear adds to the influence of the panels, shape (p, n, n) (m/Pa)."""
    made = []
    for gear, side in enumerate(law.sides):
        v = _components(frames.normal / frames.turn[:, gear])
        along = side.inverse_modulus * np.einsum("pi,ij,pj->p", v, side.wedge, v)
        y = side.distance(arcs[:, gear])
        made.append(-along[:, None, None] * np.log(y[:, :, None] + y[:, None, :]) * width[:, None, :])
    return made


def step(
    law: HalfPlanePair,
    frames: Frames,
    force: Array,
    spread: Array,
    couples: Couplings,
    before: Before | None,
    *,
    held: bool = False,
) -> Step:
    """Solve the panels of all pairs with the faces displaced by `force` (N/m) and its spread (m2).

    Parameters
    ----------
    before
        Windows and bearing panels of the step before; None at first.
    held
        Whether these stay, so that the step is a smooth function of what it starts from.
    """
    smooth = smooth_influence(law, frames, couples)
    frames, wider = displaced(law, frames, smooth, force, spread, couples)
    frames = recentred(law, frames)
    if held and before is not None:
        window = before.window
    else:
        floor = np.maximum(force, LEAST_FORCE * couples.total(force)[couples.position])
        scale = np.sqrt(0.2 * law.compliance * floor * law.pair.pinion.module)
        reach = WINDOW if before is None else before.reach
        window = windows(frames, law.curves, scale, reach * law.compliance * floor)
    x, width = window.middle[:, None] + window.half[:, None] * MIDDLES, window.half[:, None] * WIDTHS
    one, two = (frames.heights(curve, gear, x) for gear, curve in enumerate(law.curves))
    gap, arcs = two[1] - one[1], np.stack([one[0], two[0]], axis=1)
    edges = _edges(law, frames, arcs, width)
    K = influence(window.half, law.compliance) + edges[0] + edges[1]
    T = smooth.compliance
    guess = first_guess(gap) if before is None else before.bearing
    found = pressed(K, gap, width, T, force, couples, guess, held=held)
    place, variance, slope = _moments(law, window, x, width, frames.arc, (one[1], two[1]), edges, found)
    own = 0.5 * (found.pressure * width * np.einsum("pij,pj->pi", K, found.pressure)).sum(axis=1)
    energy = own + 0.5 * found.force * couples.times(T, found.force) + wider
    return Step(frames, window, found, x, width, gap, arcs, place, variance, slope, energy)


def _moments(
    law: HalfPlanePair,
    window: Windows,
    x: Array,
    width: Array,
    arc: Array,
    heights: Sequence[Array],
    edges: Sequence[Array],
    found: Pressed,
) -> tuple[Array, Array, Array]:
    """Mean place of the pressures, their variance, and the mean slope of the deformed faces under them."""
    p, loaded = found.pressure, found.force > 0
    safe = np.where(loaded, found.force, 1.0)
    place = np.where(loaded, (p * width * x).sum(axis=1) / safe, window.nearest)
    square = (x - place[:, None]) ** 2 + width**2 / 12  # a panel's pressure is constant
    variance = np.where(loaded, (p * width * square).sum(axis=1) / safe, 0.0)
    between = 0.5 * (p[:, 1:] + p[:, :-1])
    area = (between * np.diff(x, axis=1)).sum(axis=1)
    # both faces have the same, and the one further from its edges changes less with where it is taken
    far = [side.clearance(arc[:, gear]) for gear, side in enumerate(law.sides)]
    rise = np.zeros(len(x))
    for gear in (0, 1):
        deformed = heights[gear] - WAY[gear] * np.einsum("pij,pj->pi", edges[gear], p)
        rise += far[gear] / (far[0] + far[1]) * (between * np.diff(deformed, axis=1)).sum(axis=1)
    return place, variance, np.where(area > 0, rise / np.where(area > 0, area, 1.0), window.lean)


def outgrown(made: Step) -> NDArray[np.bool_]:
    """Pairs whose pressure reaches an end of its window beyond which both faces go on, shape (p,)."""
    return np.asarray(((made.solution.pressure[:, [0, -1]] > 0) & made.window.free).any(axis=1))


def moved_on(law: HalfPlanePair, made: Step, before: Before | None, *, near: bool) -> tuple[Frames, Before]:
    """What the next step starts from: frames at the mean place of the pressure, along the mean normal under it.

    Windows grow only `near` the solution, so that they do not depend on the way to it.
    """
    frames, place = made.frames, made.place
    arc = frames.arc + place[:, None] * np.array(WAY)
    for gear, curve in enumerate(law.curves):
        arc[:, gear] = np.clip(arc[:, gear], curve.low, curve.high)
    turned = 1 + 1j * made.slope
    onward = replace(
        frames,
        centre=frames.centre - 1j * frames.normal * place,
        normal=frames.normal * turned / np.abs(turned),
        arc=arc,
    )
    window = replace(made.window, middle=made.window.middle - place, nearest=made.window.nearest - place)
    reach = np.full(len(place), WINDOW) if before is None else before.reach
    reach = np.where(outgrown(made), WIDER * reach, reach) if near else reach
    return onward, Before(window, made.solution.pressure > 0, reach)
