r"""What loads on the flanks of a gear with a face width do to its flanks.

A load on a flank is a force f per width in the transverse section at z. A helix that is displaced by w along z shows a
section turned by :math:`-\kappa w`, so that contact is that of plane sections and f acts in space as

.. math:: (f,\; -\kappa\, x \times f),

and displacements are measured by the same vector. Over the width loads are sums of Legendre functions :math:`P_a`,
orthonormal on the common width of both gears, along the flank of the elliptic bumps of
`gearfe.gears.contact.flank_compliance`. Between the stations i, j of two teeth k steps apart

.. math::
    H_k(i a; j b) = b_i^T C^{FE}_{k,ab}\, b_j + \delta_{k0}\,\delta_{ab}\,\frac{1}{E'\cos\beta_b}
    \Big\langle \tfrac2\pi\ln\frac{|s-t|}{l} I + W \ln\frac{y+y}{l} \Big\rangle_{ij} ,

where :math:`\cos\beta_b` makes the half-plane that of the normal section. In the plane the length l cancels. Here it is
that of a half-space under a line load that varies as the first function that is left out, with the wave number
:math:`q = \pi n/b`: its surface moves by :math:`\tfrac{2}{\pi E'} K_0(q r)`, which near the load is
:math:`-\tfrac{2}{\pi E'} \ln(r/l)` with :math:`l = 2 e^{-\gamma}/q` (K. L. Johnson, Contact Mechanics, 1985, eq. 3.19,
integrated along the line), and half a module at least.

The finite elements are those of one tooth sector (`gearfe.fem.extruded`), factorised down to its two cut sides; cyclic
symmetry makes the gear, as in `gearfe.gears.contact.compliance`. Loads go forward through the fronts, so no node of the
flank is retained: with Y the loads at the eliminated unknowns, F those at the sides and :math:`K_n` the stiffness of
the harmonic n,

.. math:: C_k = \delta_{k0}\, Y^T Y + \frac1z \sum_n e^{2\pi i n k/z}\, F_n^* K_n^{-1} F_n .

Spur gears that are symmetric about the middle of the common width part into two systems of half the size.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from ...base.cache import cached_arrays, source_hash, versions
from ...base.progress import Stopwatch, one_thread
from ...base.typing import Array
from ...fem.extruded import (
    AxialFunctions,
    Layers,
    condense_extruded,
    lobatto_functions,
    lobatto_functions_at,
    section_integrals,
)
from ...fem.multifrontal import unknowns_of
from ..contact.flank import flank_of
from ..contact.flank_compliance import FlankCompliance, Shapes, corner_of, local_bracket, shapes_of, stations_of
from ..geometry.face import face_of
from ..teeth.tooth_sector import SectorMesh, sector_mesh, sector_recipes, web_triangles
from .mesh import WideMesh

#: Length beyond the common width (modules) up to which it is no element of its own.
NO_ELEMENT = 0.1
#: Polynomial order of the finite elements beyond that of the load.
HIGHER = 2
#: Polynomial order of the elements beyond the common width, and one more for each so many modules, up to that on it.
BEYOND_ORDER, BEYOND_MODULES = 3, 1.0
#: Least l in the logarithms (modules): the half-plane of a contact has to yield more under more load, so that l is
#: longer than half of any contact's half width.
LEAST_LENGTH = 0.5
#: Order of a part of an element that the end of a web divides, beyond its share of the element's order.
DIVIDED = 2
#: Mesh cycles beyond both ends of the path of contact within which tips may bear.
TIPS = 0.7
#: Packages and modules whose text decides kept gears and laws of pairs.
SOURCES = ("fem", "gears/contact", "gears/geometry", "gears/teeth", "gears/width/compliance", "gears/width/mesh")


@dataclass(frozen=True)
class WideFlank:
    """The working flank of one gear over its width: H between its stations.

    Attributes
    ----------
    local
        Flank, half-plane and wedge; its far field is that of loads that are even over the width (m/N).
    influence : ndarray, shape (steps, k, 2, n, k, 2, n)
        H_0, H_1, ...: station, axis of the tooth and function of both places (m/N); H_-k is the transpose of H_k.
    length
        l in the logarithms (m).
    """

    local: FlankCompliance
    influence: Array
    length: float

    @cached_property
    def usual_bump(self) -> float:
        """Median of the bumps' half widths (m)."""
        return float(np.median(self.local.bumps))


@dataclass(frozen=True)
class WideCompliance:
    """Two elastic gears in mesh, as their contact sees them; `wide_compliance` makes it."""

    mesh: WideMesh
    sides: tuple[WideFlank, WideFlank]

    @property
    def steps(self) -> int:
        """Largest distance, in teeth, of two tooth pairs whose coupling is known."""
        return len(self.sides[0].influence) - 1

    @cached_property
    def shapes(self) -> Shapes:
        """Shape functions of the stations of both flanks."""
        return shapes_of([side.local.stations for side in self.sides])

    @property
    def length(self) -> float:
        """l in the logarithms (m)."""
        return self.sides[0].length


def wide_compliance(mesh: WideMesh, *, whole: bool = True, watch: Stopwatch | None = None) -> WideCompliance:
    """Mesh the sections of both gears and condense their teeth over the width to the flanks.

    Parameters
    ----------
    mesh : WideMesh
        The gears.
    whole
        ``False``: one sector of each gear with its cut sides held, as models of one tooth have it.
    watch
        Takes the time of the stages.
    """
    watch = watch or Stopwatch()
    with watch.stage("meshes"):
        recipes = sector_recipes(mesh.sections, coarsen=mesh.coarsen, flank_coarsen=mesh.flank_coarsen)
        meshes = [sector_mesh(gear, recipe) for gear, recipe in zip(mesh.gears, recipes, strict=True)]
    with watch.stage("condensation"), one_thread():
        pinion, wheel = (_wide_flank(mesh, gear, meshes[gear], whole) for gear in (0, 1))
    return WideCompliance(mesh, (pinion, wheel))


def legendre(z: Array, zone: tuple[float, float], count: int) -> Array:
    """Legendre functions at z (m), orthonormal on the zone and zero beyond, shape (..., count) (1/sqrt(m))."""
    low, high = zone
    x = (2 * z - low - high) / (high - low)
    values = np.empty((count, *x.shape))
    values[0] = np.abs(x) <= 1 + 1e-9
    if count > 1:
        values[1] = x * values[0]
    for n in range(2, count):
        values[n] = ((2 * n - 1) * x * values[n - 1] - (n - 1) * values[n - 2]) / n
    return np.moveaxis(values, 0, -1) * np.sqrt((2 * np.arange(count) + 1) / (high - low))


def _steps(mesh: WideMesh) -> int:
    """Largest distance of two tooth pairs that can touch at the same time, in teeth."""
    path = mesh.sections.path
    length = (path["E"].pinion_angle - path["A"].pinion_angle) / mesh.sections.mesh_cycle
    return math.ceil(length + 2 * TIPS + mesh.overlap_ratio)


def _axial_elements(mesh: WideMesh, gear: int, higher: int) -> tuple[list[float], list[int]]:
    """Ends (m) and orders of the elements along a face: one on the common width, others beyond its ends.

    The ends of a web divide them.
    """
    (low, high), face = mesh.zone, mesh.faces[gear]
    if mesh.count == 1:
        return list(face), [0]
    order = mesh.count - 1 + higher
    ends, orders = [low, high], [order]
    for beyond, at in ((low - face[0], 0), (face[1] - high, len(orders))):
        if beyond <= NO_ELEMENT * mesh.module:
            ends[0 if at == 0 else -1] = face[0 if at == 0 else 1]
            continue
        more = BEYOND_ORDER + math.ceil(beyond / (BEYOND_MODULES * mesh.module))
        orders.insert(0 if at == 0 else len(orders), min(order, more))
        ends.insert(0 if at == 0 else len(ends), face[0 if at == 0 else 1])
    marks = [at for at in mesh.web_ends(gear) or () if min(abs(at - end) for end in ends) > NO_ELEMENT * mesh.module]
    divided = [ends[0]]
    new_orders: list[int] = []
    for (first, last), order in zip(itertools.pairwise(ends), orders, strict=True):
        places = [first, *(at for at in marks if first < at < last), last]
        shares = [(b - a) / (last - first) for a, b in itertools.pairwise(places)]
        new_orders += [order if share == 1.0 else min(order, DIVIDED + math.ceil(order * share)) for share in shares]
        divided += places[1:]
    return divided, new_orders


#: Functions of v and of w along the axis; of w none where it is zero.
FunctionPair = tuple[AxialFunctions, AxialFunctions | None]


@dataclass(frozen=True)
class AxialSystem:
    """Functions along a gear's axis that part from the others.

    Attributes
    ----------
    functions
        Of v and w on a quadrature rule.
    at
        The same functions at places that were asked for.
    loads
        The Legendre functions of the loads that act on them.
    """

    functions: FunctionPair
    at: FunctionPair
    loads: slice

    @property
    def width(self) -> int:
        """Unknowns of a node."""
        plane, axial = self.functions
        return 2 * plane.count + (0 if axial is None else axial.count)


def axial_systems(
    mesh: WideMesh, gear: int, *, higher: int = HIGHER, places: Array | None = None
) -> Iterator[AxialSystem]:
    """Yield the systems along the axis of a gear that part: two for spur gears that are symmetric, or one.

    Parameters
    ----------
    mesh : WideMesh
        The gears.
    gear : int
        0 for the pinion, 1 for the wheel.
    higher
        Order of the elements beyond that of the load.
    places : ndarray, shape (c,)
        Places (m) at which the functions are wanted besides.
    """
    ends, orders = _axial_elements(mesh, gear, higher)
    web = mesh.web_ends(gear)
    functions = lobatto_functions(ends, orders, (*mesh.zone, *(web or ())))
    at = lobatto_functions_at(ends, orders, np.zeros(0) if places is None else places)
    if mesh.count == 1:
        yield AxialSystem((functions, None), (at, None), slice(0, 1))
        return
    (low, high), (first, last) = mesh.zone, mesh.faces[gear]
    margins = [(low - first, last - high), *([] if web is None else [(web[0] - first, last - web[1])])]
    symmetric = all(math.isclose(one, other, abs_tol=1e-9 * mesh.width) for one, other in margins)
    if mesh.base_helix_angle == 0.0 and symmetric:
        (even, odd), (even_at, odd_at) = functions.by_parity(), at.by_parity()
        yield AxialSystem((even, odd), (even_at, odd_at), slice(0, None, 2))
        yield AxialSystem((odd, even), (odd_at, even_at), slice(1, None, 2))
        return
    yield AxialSystem((functions, functions), (at, at), slice(0, None))


def layers_of(mesh: WideMesh, gear: int, sector: SectorMesh) -> Layers | None:
    """Return where the web of a gear has material, of a mesh of its sector; None without a web."""
    web, ends = mesh.webs[gear], mesh.web_ends(gear)
    return None if web is None or ends is None else Layers(web_triangles(sector.points, sector.triangles, web), ends)


def loads_of(mesh: WideMesh, gear: int, system: AxialSystem, points: Array, nodal: Array) -> Array:
    """Return the nodal loads of one system of loads on the flank.

    Parameters
    ----------
    mesh : WideMesh
        The gears.
    gear : int
        0 for the pinion, 1 for the wheel.
    system : AxialSystem
        Functions along the axis.
    points : ndarray, shape (n, 2)
        Nodes of the flank (m).
    nodal : ndarray, shape (k, n)
        Shares of the stations' loads on them.

    Returns
    -------
    ndarray, shape (n, width, k, 2, loads)
        Node, unknown, station, axis of the tooth, Legendre function.
    """
    plane, axial = system.functions
    x, y = points.T
    over, count, turn = _over_width(mesh, plane)[system.loads], plane.count, mesh.turns[gear]
    loads = np.zeros((len(points), system.width, len(nodal), 2, len(over)))
    for axis in (0, 1):
        loads[:, axis * count : (axis + 1) * count, :, axis] = np.einsum("in,bp->npib", nodal, over)
        if axial is not None and turn:
            arm = turn * (y, -x)[axis]
            along = _over_width(mesh, axial)[system.loads]
            loads[:, 2 * count :, :, axis] = np.einsum("in,n,bp->npib", nodal, arm, along)
    return loads


def _wide_flank(mesh: WideMesh, gear: int, sector: SectorMesh, whole: bool) -> WideFlank:
    section, material = mesh.gears[gear], mesh.materials[gear]
    flank, n = flank_of(sector, 4), mesh.count
    face = face_of(section)
    stations, bumps, nodal = stations_of(flank, float(face.arc[0]), section.module)
    k = len(stations)
    recipe = {"mesh": mesh, "gear": gear, "whole": whole, "code": [source_hash(*SOURCES), versions()]}
    influence: Array = cached_arrays(
        "wide-gear", recipe, lambda: {"influence": _condensed(mesh, gear, sector, nodal, whole)}
    )["influence"]
    inverse = material.contact_compliance("strain") / math.cos(mesh.base_helix_angle)
    corner, wedge = corner_of(face)
    length = max(2 * math.exp(-np.euler_gamma) * mesh.width / (math.pi * n), LEAST_LENGTH * mesh.module)
    bare = FlankCompliance(face, inverse, corner, wedge, stations, bumps, {})
    every = np.kron(np.ones((k, k)), 2 / math.pi * np.eye(2) + wedge)
    bracket = inverse * (local_bracket(bare) - math.log(length) * every)
    for a in range(n):
        influence[0, :, :, a, :, :, a] += bracket.reshape(k, 2, k, 2)
    even = influence[0, :, :, 0, :, :, 0].reshape(2 * k, 2 * k) + inverse * math.log(length) * every
    local = FlankCompliance(face, inverse, corner, wedge, stations, bumps, {0: even / mesh.width})
    return WideFlank(local, influence, length)


def _condensed(mesh: WideMesh, gear: int, sector: SectorMesh, nodal: Array, whole: bool) -> Array:
    """Return the finite-element part of the influences of a flank (m/N), as in `WideFlank`."""
    material = mesh.materials[gear]
    integrals = section_integrals(sector.points, sector.triangles, material, mesh.turns[gear])
    flank, n, steps, k = flank_of(sector, 4), mesh.count, _steps(mesh), len(nodal)
    held = np.unique(sector.held)
    sides = np.concatenate([sector.cut_right[:-1], sector.cut_left[:-1]])  # the last node of a cut is held
    influence = np.zeros((steps + 1, k, 2, n, k, 2, n))
    for system in axial_systems(mesh, gear):
        factor = condense_extruded(
            sector.points,
            sector.triangles,
            integrals,
            system.functions,
            retained=sides if whole else sides[:0],
            fixed=held if whole else np.union1d(held, sides),
            layers=layers_of(mesh, gear, sector),
        )
        loads, chosen = loads_of(mesh, gear, system, sector.points[flank.nodes], nodal), system.loads
        unknowns = unknowns_of(flank.nodes, system.width)
        eliminated, at_sides = factor.reduced_loads(unknowns, loads.reshape(len(unknowns), -1))
        of_steps = np.zeros((steps + 1, eliminated.shape[1], eliminated.shape[1]))
        if whole:
            widths = 2 * system.functions[0].count, system.width
            of_steps = cyclic_response(factor.schur, at_sides, at_sides, widths, sector.pitch, range(steps + 1))
        of_steps[0] += eliminated.T @ eliminated
        shape = k, 2, loads.shape[-1]
        influence[:, :, :, chosen, :, :, chosen] = of_steps.reshape(-1, *shape, *shape)
    return influence


def _over_width(mesh: WideMesh, functions: AxialFunctions) -> Array:
    """Integrals of the Legendre functions of the load times those of the displacement, shape (n, count) (sqrt(m))."""
    inside = (functions.points >= mesh.zone[0]) & (functions.points <= mesh.zone[1])
    values = legendre(functions.points, mesh.zone, mesh.count) * (functions.weights * inside)[:, None]
    return np.asarray(values.T @ functions.values)


def cyclic_response(
    stiffness: Array, felt: Array, loads: Array, widths: tuple[int, int], pitch: float, steps: Sequence[int]
) -> Array:
    """Linear forms of the displacement of the sector so many steps on from loads, of the whole gear, by its cut sides.

    Parameters
    ----------
    stiffness : ndarray, shape (2 h, 2 h)
        Of one sector's sides, the right one first (N/m).
    felt, loads : ndarray, shapes (2 h, r), (2 h, c)
        Forms (-) and loads (N) there.
    widths : pair of int
        Unknowns of a node that turn with the tooth, and all.
    pitch : float
        Angle from one sector to the next (rad), < 0 for an internal gear.
    steps : sequence of int
        Steps.

    Returns
    -------
    ndarray, shape (steps, r, c)
    """
    half, (plane, width) = len(stiffness) // 2, widths
    count = round(2 * math.pi / abs(pitch))
    angle = 2 * math.pi / count
    c, s = math.cos(pitch), math.sin(pitch)
    turn = np.eye(width)
    turn[:plane, :plane] = np.kron([[c, -s], [s, c]], np.eye(plane // 2))

    def turned(y: Array) -> Array:
        """R^T y, node by node."""
        return np.asarray(np.matmul(turn.T, y.reshape(-1, width, y.shape[1])).reshape(y.shape))

    rr, rl, ll = stiffness[:half, :half], stiffness[:half, half:], stiffness[half:, half:]
    to_next, beside = turned(rl.T).T, rr + turned(turned(ll).T).T
    right, left = loads[:half], turned(loads[half:])
    felt_right, felt_left = felt[:half].T, turned(felt[half:]).T
    found = np.zeros((len(steps), felt.shape[1], loads.shape[1]))
    for n in range(count // 2 + 1):
        phase = np.exp(1j * n * angle)
        root = cholesky(beside + phase * to_next + np.conj(phase) * to_next.T, check_finite=False)
        reduced = solve_triangular(root, right + np.conj(phase) * left, trans="C", check_finite=False)
        if felt is loads:
            product = reduced.conj().T @ reduced
        else:
            moved = solve_triangular(root, reduced, check_finite=False)
            product = felt_right @ moved + phase * (felt_left @ moved)
        twice = 1 if n == 0 or 2 * n == count else 2
        for i, k in enumerate(steps):
            share = twice * np.exp(1j * n * k * angle) / count
            found[i] += share.real * product.real - share.imag * product.imag
    return found
