r"""Tension at the tooth roots from the contact forces, on meshes of its own, with an estimate of its error.

The fillet carries no traction, so equilibrium leaves one stress there, along the surface, and it follows from the
surface's own stretching: with the arc length s and the unit tangent t

.. math::
    \sigma = E'\, t\cdot\frac{\partial u}{\partial s}, \qquad E' = E/(1-\nu^2) \text{ in plane strain, } E \text{ in
    plane stress.}

:math:`\partial u/\partial s` is taken at the two Gauss points of each second-order edge, where derivatives of such a
displacement are most accurate (Barlow, Int. J. Numer. Meth. Eng. 10, 1976), and the largest stress along the fillet
from a parabola through the three largest values that lie together.

What the fillet feels of the flank is linear in the flank forces and hardly knows how these are spread (Saint-Venant):
each gear gets two meshes with a fine fillet and a coarse flank, of sizes h and h/2, and from each the rows "stress at
the fillet for forces on the flank nodes of the contact mesh" of a loaded tooth and of its neighbours. The value is that
of h/2, and :math:`|\sigma_{h/2} - \sigma_h|` the estimate of its error: with errors of order two about three times the
error itself, because the little that is left (0.1 %) no longer falls smoothly enough to be extrapolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.compliance import GearBody, gear_body
from ..contact.flank import Flank, edge_nodes, edge_shapes
from ..contact.position import Position
from ..contact.recovery import position_forces
from ..contact.scene import MeshingPair
from ..gear.pair import Gear, GearPair
from ..meshing.recipe import sector_recipes
from ..meshing.tooth_sector import SectorRecipe, sector_mesh
from .root_map import RootMap

Array = NDArray[Any]
IntArray = NDArray[Any]

#: Element size of the coarser mesh: times the smallest radius of curvature of the fillet, and at most times the module.
SIZE_OF_RADIUS, SIZE_OF_MODULE = 0.25, 0.06
#: Loaded teeth so far apart still feel each other at the root.
REACH = 3
#: Size of flank, strips and back on these meshes, times module.
FLANK_SIZE = 0.12
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3.0)


@dataclass(frozen=True)
class RootMesh:
    """Stress along the loaded side's fillet of a tooth, for forces on flanks.

    Attributes
    ----------
    place : ndarray, shape (q,)
        Arc length of the points, from the form point inwards (m).
    radius : ndarray, shape (q,)
        Their distance from the gear's centre (m).
    rows : dict of int to ndarray, shape (q, f)
        Step k -> stress (Pa/N) on tooth k for flank forces on tooth 0; forces on the flank nodes of the contact mesh.
    size
        Element size on the fillet (m).
    """

    place: Array
    radius: Array
    rows: dict[int, Array]
    size: float

    def largest(self, tooth: int, loads: dict[int, Array], teeth: int) -> tuple[float, float]:
        """Largest tension (Pa) along the fillet of a tooth, and its radius (m)."""
        stress = np.zeros(len(self.place))
        for number, force in loads.items():
            step = (tooth - number + teeth // 2) % teeth - teeth // 2
            if step in self.rows:
                stress += self.rows[step] @ force
        return peak(self.place, stress, self.radius)


def peak(place: Array, values: Array, other: Array) -> tuple[float, float]:
    """Largest value of a curve through samples, by a parabola round the largest one, and `other` at that place."""
    k = int(np.clip(np.argmax(values), 1, len(values) - 2))
    x, y = place[k - 1 : k + 2], values[k - 1 : k + 2]
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    if bend < 0:
        at = 0.5 * (x[0] + x[1]) - 0.5 * left / bend
        if x[0] <= at <= x[2]:
            value = y[0] + left * (at - x[0]) + bend * (at - x[0]) * (at - x[1])
            return float(value), float(np.interp(at, place, other))
    k = int(np.argmax(values))
    return float(values[k]), float(other[k])


def fillet_radius(gear: Gear) -> float:
    """Smallest radius of curvature of the root fillet (m)."""
    segment = gear.profile.segment("trochoid")
    t = np.linspace(0.0, 1.0, 201)
    normal = segment.normals(t)
    turned = np.arccos(np.clip((normal[1:] * normal[:-1]).sum(axis=1), -1.0, 1.0))
    arc = np.diff(segment.arc_length_at(t))
    return float(np.min(arc / np.maximum(turned, 1e-12)))


def root_size(gear: Gear) -> float:
    """Element size (m) on the fillet of the coarser of the two meshes."""
    return min(SIZE_OF_MODULE * gear.module, max(SIZE_OF_RADIUS * fillet_radius(gear), 0.01 * gear.module))


def root_recipe(recipe: SectorRecipe, gear: Gear, factor: float) -> SectorRecipe:
    """Sizes of a mesh with a fine fillet and a coarse flank; `factor` multiplies every size."""
    flank = FLANK_SIZE * gear.module
    sizes = replace(recipe, flank=flank, strip=flank, back=max(recipe.back, flank), root=root_size(gear))
    return sizes.scaled(factor)


def root_mesh(gear: Gear, body: GearBody, recipe: SectorRecipe) -> RootMesh:
    """Condense one mesh with the sizes of `root_recipe` and make its rows for the flank nodes of `body`."""
    mesh = sector_mesh(gear, recipe)
    fine = gear_body(mesh, body.material, body.plane, body.thickness, with_stress=False)
    edges = mesh.boundaries["root_left"]
    corners = mesh.points[edges]  # (e, 3, 2)
    shapes, slopes, _ = edge_shapes(_GAUSS)
    along = np.einsum("qa,eai->eqi", slopes, corners)
    speed = np.linalg.norm(along, axis=-1)
    nu, modulus = body.material.poisson_ratio, body.material.youngs_modulus
    stiff = modulus / (1 - nu**2) if body.plane == "strain" else modulus
    stretch = stiff * slopes[None, :, :, None] * along[:, :, None, :] / speed[:, :, None, None] ** 2  # (e, q, a, i)
    unknowns = (2 * edges[:, :, None] + np.arange(2)).reshape(len(edges), 6)
    recovered = fine.condensed.recover(np.eye(len(fine.condensed.schur)), wanted=unknowns.ravel())
    stress = np.matmul(stretch.reshape(len(edges), 2, 6), recovered[unknowns]).reshape(2 * len(edges), -1)
    f = len(fine.own)
    held = stress[:, :f] @ fine.own
    free = stress[:, :f] @ fine.interface + stress[:, f:]
    spread = spread_of(fine.flank, body.flank.points)
    teeth = fine.teeth
    reach = min(REACH, (teeth - 1) // 2)
    rows = {k: (free @ fine.coupling[k % teeth] @ fine.interface.T) @ spread for k in range(-reach, reach + 1)}
    rows[0] = rows[0] + held @ spread
    ends = np.concatenate([[0.0], np.cumsum(_lengths(corners))])
    place = (ends[:-1, None] + np.diff(ends)[:, None] * _GAUSS).ravel()
    radius = np.linalg.norm(np.einsum("qa,eai->eqi", shapes, corners), axis=-1).ravel()
    return RootMesh(place, radius, rows, recipe.root)


def _lengths(corners: Array) -> Array:
    slopes = edge_shapes(_GAUSS)[1]
    return 0.5 * np.linalg.norm(np.einsum("qa,eai->eqi", slopes, corners), axis=-1).sum(axis=1)


def spread_of(chain: Flank, points: Array) -> Array:
    """Forces on a chain's nodes that do the same work as forces at `points` on the same profile, shape (2 c, 2 n).

    A flank grows outwards from its root, so a point's place on the chain is where the radius is the same.
    """
    xi = np.linspace(0.0, 1.0, 65)
    corners = chain.points[edge_nodes(np.arange(chain.edges))]
    radius = np.linalg.norm(np.einsum("qa,eai->eqi", edge_shapes(xi)[0], corners), axis=-1)
    radius = np.maximum.accumulate(np.append(radius[:, :-1].ravel(), radius[-1, -1]))
    place = np.append((np.arange(chain.edges)[:, None] + xi[:-1]).ravel(), chain.edges)
    at = np.interp(np.linalg.norm(points, axis=1), radius, place)
    edge = np.minimum(at.astype(np.int64), chain.edges - 1)
    shapes = edge_shapes(at - edge)[0]  # (n, 3)
    spread = np.zeros((2 * len(chain.nodes), 2 * len(points)))
    nodes = edge_nodes(edge)
    for i in range(2):
        spread[2 * nodes + i, (2 * np.arange(len(points)) + i)[:, None]] = shapes
    return spread


@dataclass(frozen=True)
class ToothRoot:
    """Root stress of one loaded tooth: value (Pa), where (diameter, m), estimated relative error (-)."""

    stress: float
    diameter: float
    error: float


@dataclass(frozen=True)
class PairRoots:
    """Root stresses of both gears of a pair, from the forces of any solved position.

    Attributes
    ----------
    pair
        The elastic pair.
    meshes
        For pinion and wheel, the coarser and the finer mesh.
    """

    pair: MeshingPair
    meshes: tuple[tuple[RootMesh, RootMesh], tuple[RootMesh, RootMesh]]

    def at(self, position: Position) -> dict[int, tuple[ToothRoot, ToothRoot]]:
        """Pair number -> root of its pinion tooth and of its wheel tooth, for the pairs that carry load."""
        loads = [position_forces(body, g, position) for g, body in enumerate(self.pair.bodies)]
        found = {}
        for number, torque in zip(position.pair_numbers, position.pair_torques, strict=True):
            if torque > 0:
                found[number] = (self._tooth(0, number, loads[0]), self._tooth(1, -1 - number, loads[1]))
        return found

    def _tooth(self, gear: int, tooth: int, loads: dict[int, Array]) -> ToothRoot:
        teeth = self.pair.bodies[gear].teeth
        coarse, fine = (mesh.largest(tooth % teeth, loads, teeth) for mesh in self.meshes[gear])
        return ToothRoot(fine[0], 2 * fine[1], abs(fine[0] - coarse[0]) / abs(fine[0]))


def pair_roots(gears: GearPair, pair: MeshingPair, *, coarsen: float = 1.0) -> PairRoots:
    """Mesh and condense the fillets of both gears of a pair.

    Parameters
    ----------
    gears
        Geometry.
    pair
        The elastic pair whose contact forces will be given.
    coarsen
        Factor on the element sizes of both meshes.
    """
    made = []
    for gear, body, recipe in zip((gears.pinion, gears.wheel), pair.bodies, sector_recipes(gears), strict=True):
        both = [root_mesh(gear, body, root_recipe(recipe, gear, c)) for c in (coarsen, 0.5 * coarsen)]
        made.append((both[0], both[1]))
    return PairRoots(pair, (made[0], made[1]))


class RootRecorder:
    """Collects the root stresses of a load map's cells while they are solved.

    Parameters
    ----------
    roots
        Root stresses of the pair.
    """

    def __init__(self, roots: PairRoots) -> None:
        self._roots = roots
        self._cells: dict[tuple[int, int], tuple[float, dict[int, tuple[ToothRoot, ToothRoot]]]] = {}

    def record(self, level: int, number: int, position: Position) -> None:
        """Take a cell's solution; a later one of the same cell replaces it."""
        self._cells[level, number] = (position.torque_wheel, self._roots.at(position))

    def gathered(self, torques: Array, source: IntArray, failed: Array) -> RootMap:
        """The map, at the torques, shape (m,) (N m), that the cells stand for.

        Parameters
        ----------
        source : ndarray, shape (n,)
            Number of the solved angle behind each angle of the map.
        failed : ndarray of bool, shape (m, n)
        """
        most = max((max(c) - min(c) + 1 for _, c in self._cells.values() if c), default=1)
        shape = (len(torques), len(source), 2)
        stress = np.full((*shape, most), np.nan)
        diameter, error = np.full(shape, np.nan), np.full(shape, np.nan)
        for level, goal in enumerate(torques):
            for j, number in enumerate(source):
                torque, pairs = self._cells.get((level, int(number)), (1.0, {}))
                if failed[level, j] or not pairs:
                    continue
                for g in range(2):
                    for k, roots in pairs.items():
                        stress[level, j, g, max(pairs) - k] = roots[g].stress * goal / torque
                    worst = max((roots[g] for roots in pairs.values()), key=lambda root: root.stress)
                    diameter[level, j, g], error[level, j, g] = worst.diameter, worst.error
        return RootMap(stress, diameter, error)
