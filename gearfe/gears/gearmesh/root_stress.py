r"""Tension at the tooth roots from the contact forces, on separate meshes, with an error estimate.

The fillet carries no traction, so the only stress there is along the surface. It follows from the stretch of the
surface, with the arc length s and the unit tangent t

.. math::
    \sigma = E'\, t\cdot\frac{\partial u}{\partial s}, \qquad E' = E/(1-\nu^2) \text{ in plane strain, } E \text{ in
    plane stress.}

:math:`\partial u/\partial s` is taken at the two Gauss points of each second-order edge, where derivatives of such a
displacement are most accurate (Barlow, Int. J. Numer. Meth. Eng. 10, 1976), and the largest stress along the fillet
from a parabola through the three largest values that lie together.

The stress at the fillet is linear in the flank forces and hardly depends on their distribution (Saint-Venant). Each
gear therefore has two meshes with a fine fillet and a coarse flank, of sizes h and h/2. Each mesh gives the rows
"stress at the fillet for forces on the flank nodes of the contact mesh" of a loaded tooth and of its neighbours. The
value is that of h/2, and :math:`|\sigma_{h/2} - \sigma_h|` the estimate of its error. With errors of order two this is
about three times the error itself. The value is not extrapolated, because the remaining error (0.1 %) does not fall
smoothly enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...base.typing import Array, IntArray
from ..contact.compliance import GearBody, MeshingPair, gear_body
from ..contact.flank import Flank, edge_nodes, edge_shapes
from ..contact.position import FlankLoads, Positions
from ..geometry.pair import Gear
from ..teeth.tooth_sector import SectorRecipe, sector_mesh, sector_recipes
from .load_map import RootMap

#: Element size of the coarser mesh: times the smallest radius of curvature of the fillet, and at most times the module.
SIZE_OF_RADIUS, SIZE_OF_MODULE = 0.25, 0.06
#: Loaded teeth so far apart still feel each other at the root.
REACH = 3
#: Size of flank, strips and back on these meshes, times module.
FLANK_SIZE = 0.12
#: Gauss points of an edge (0 to 1).
GAUSS = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3.0)


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

    def largest(self, loads: FlankLoads, position: IntArray, tooth: IntArray, teeth: int) -> tuple[Array, Array]:
        """Return the largest tensions along the fillets of c teeth, and where they are.

        Parameters
        ----------
        loads : FlankLoads
            Loads on the gear's flanks.
        position, tooth : ndarray of int, shape (c,)
            Number of the position, and of the tooth.
        teeth : int
            Number of teeth of the gear.

        Returns
        -------
        tension, radius : ndarray, shape (c,)
            Largest tension (Pa) and its radius (m).
        """
        stress = np.zeros((len(tooth), len(self.place)))
        of, load, step = loads.felt(position, tooth, teeth)
        for k in np.intersect1d(step, list(self.rows)):
            here = step == k
            np.add.at(stress, of[here], loads.force[load[here]] @ self.rows[k].T)
        return peaks(self.place, stress, self.radius)


def peaks(place: Array, values: Array, other: Array) -> tuple[Array, Array]:
    """Largest values of curves through samples, shape (c, q), by parabolas round the largest, and `other` there."""
    row, top = np.arange(len(values)), np.argmax(values, axis=1)
    three = np.clip(top, 1, len(place) - 2) + np.array([[-1], [0], [1]])
    x, y = place[three], values[row, three]
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    at = 0.5 * (x[0] + x[1]) - 0.5 * left / np.where(bend < 0, bend, -1.0)
    inside = (bend < 0) & (x[0] <= at) & (at <= x[2])
    value = y[0] + left * (at - x[0]) + bend * (at - x[0]) * (at - x[1])
    return np.where(inside, value, values[row, top]), np.where(inside, np.interp(at, place, other), other[top])


def fillet_radius(gear: Gear) -> float:
    """Smallest radius of curvature of the root fillet (m)."""
    name = "trochoid" if gear.form_diameter is None else "fillet"
    segment = gear.profile.segment(name)
    t = np.linspace(0.0, 1.0, 201)
    normal = segment.normals(t)
    turned = np.arccos(np.clip((normal[1:] * normal[:-1]).sum(axis=1), -1.0, 1.0))
    arc = np.diff(segment.arc_length_at(t))
    return float(np.min(arc / np.maximum(turned, 1e-12)))


def root_size(gear: Gear) -> float:
    """Element size (m) on the fillet of the coarser of the two meshes."""
    return min(SIZE_OF_MODULE * gear.module, max(SIZE_OF_RADIUS * fillet_radius(gear), 0.01 * gear.module))


def root_recipe(recipe: SectorRecipe, gear: Gear, factor: float) -> SectorRecipe:
    """Return the sizes of a mesh with a fine fillet, a coarse flank and half as many edges round the bore, whose
    stiffness does not matter for this stress. `factor` multiplies every size.
    """
    flank = FLANK_SIZE * gear.module
    back, bore = max(recipe.back, flank), 2 * recipe.bore
    sizes = replace(recipe, flank=flank, strip=flank, back=back, root=root_size(gear), bore=bore)
    return sizes.scaled(factor)


def root_mesh(gear: Gear, body: GearBody, recipe: SectorRecipe) -> RootMesh:
    """Condense one mesh with the sizes of `root_recipe` and make its rows for the flank nodes of `body`."""
    mesh = sector_mesh(gear, recipe)
    fine = gear_body(mesh, body.material, body.plane, body.thickness, with_stress=False)
    edges = mesh.boundaries["root_left"]
    corners = mesh.points[edges]  # (e, 3, 2)
    shapes, slopes, _ = edge_shapes(GAUSS)
    along = np.einsum("qa,eai->eqi", slopes, corners)
    speed = np.linalg.norm(along, axis=-1)
    nu, modulus = body.material.poisson_ratio, body.material.youngs_modulus
    stiff = modulus / (1 - nu**2) if body.plane == "strain" else modulus
    stretch = stiff * slopes[None, :, :, None] * along[:, :, None, :] / speed[:, :, None, None] ** 2  # (e, q, a, i)
    unknowns = (2 * edges[:, :, None] + np.arange(2)).reshape(len(edges), 6)
    stress = fine.condensed.on_retained(stretch.reshape(-1, 6), np.repeat(unknowns, 2, axis=0))
    f = len(fine.own)
    held = stress[:, :f] @ fine.own
    free = stress[:, :f] @ fine.interface + stress[:, f:]
    spread = spread_of(fine.flank, body.flank.points)
    teeth = fine.teeth
    reach = min(REACH, (teeth - 1) // 2)
    rows = {k: (free @ fine.coupling[k % teeth] @ fine.interface.T) @ spread for k in range(-reach, reach + 1)}
    rows[0] = rows[0] + held @ spread
    ends = np.concatenate([[0.0], np.cumsum(_lengths(corners))])
    place = (ends[:-1, None] + np.diff(ends)[:, None] * GAUSS).ravel()
    radius = np.linalg.norm(np.einsum("qa,eai->eqi", shapes, corners), axis=-1).ravel()
    return RootMesh(place, radius, rows, recipe.root)


def _lengths(corners: Array) -> Array:
    slopes = edge_shapes(GAUSS)[1]
    return 0.5 * np.linalg.norm(np.einsum("qa,eai->eqi", slopes, corners), axis=-1).sum(axis=1)


def spread_of(chain: Flank, points: Array) -> Array:
    """Forces on a chain's nodes that do the same work as forces at `points` on the same profile, shape (2 c, 2 n).

    The radius of a flank rises from its root; that of an internal gear falls. So a point's place on the chain is where
    the radius is the same.
    """
    xi = np.linspace(0.0, 1.0, 65)
    corners = chain.points[edge_nodes(np.arange(chain.edges))]
    sign = -1 if np.linalg.norm(chain.points[-1]) < np.linalg.norm(chain.points[0]) else 1
    radius = sign * np.linalg.norm(np.einsum("qa,eai->eqi", edge_shapes(xi)[0], corners), axis=-1)
    radius = np.maximum.accumulate(np.append(radius[:, :-1].ravel(), radius[-1, -1]))
    place = np.append((np.arange(chain.edges)[:, None] + xi[:-1]).ravel(), chain.edges)
    at = np.interp(sign * np.linalg.norm(points, axis=1), radius, place)
    edge = np.minimum(at.astype(np.int64), chain.edges - 1)
    shapes = edge_shapes(at - edge)[0]  # (n, 3)
    spread = np.zeros((2 * len(chain.nodes), 2 * len(points)))
    nodes = edge_nodes(edge)
    for i in range(2):
        spread[2 * nodes + i, (2 * np.arange(len(points)) + i)[:, None]] = shapes
    return spread


@dataclass(frozen=True)
class ToothRoots:
    """Root stresses of c loaded tooth pairs; the second axis is the gear (pinion, wheel).

    Attributes
    ----------
    position, pair : ndarray, shape (c,)
        Number of the position, and of the tooth pair.
    stress, diameter, error : ndarray, shape (c, 2)
        Largest tension (Pa), where it acts (m), and its estimated relative error (-).
    """

    position: IntArray
    pair: IntArray
    stress: Array
    diameter: Array
    error: Array


@dataclass(frozen=True)
class PairRoots:
    """Root stresses of both gears of a pair, from the loads of any solved positions.

    Attributes
    ----------
    pair
        The elastic pair.
    meshes
        For pinion and wheel, the coarser and the finer mesh.
    """

    pair: MeshingPair
    meshes: tuple[tuple[RootMesh, RootMesh], tuple[RootMesh, RootMesh]]

    def at(self, found: Positions) -> ToothRoots:
        """Of the tooth pairs that carry load."""
        contacts = found.contacts
        carry = contacts.torque_wheel > 0
        position, pair = np.unique(np.stack([contacts.position[carry], contacts.pair[carry]]), axis=1)
        stress, radius, error = np.zeros((3, len(pair), 2))
        for g, tooth in enumerate((pair, -1 - pair)):
            of_gear = found.loads[g], position, tooth, self.pair.bodies[g].teeth
            (coarse, _), (stress[:, g], radius[:, g]) = (mesh.largest(*of_gear) for mesh in self.meshes[g])
            error[:, g] = np.abs(stress[:, g] - coarse) / np.abs(stress[:, g])
        return ToothRoots(position, pair, stress, 2 * radius, error)


def pair_roots(pair: MeshingPair, *, coarsen: float = 1.0) -> PairRoots:
    """Mesh and condense the fillets of both gears of a pair.

    Parameters
    ----------
    pair
        The elastic pair whose contact forces will be given.
    coarsen
        Factor on the element sizes of both meshes.
    """
    made, gears = [], pair.gears
    for gear, body, recipe in zip((gears.pinion, gears.wheel), pair.bodies, sector_recipes(gears), strict=True):
        both = [root_mesh(gear, body, root_recipe(recipe, gear, c)) for c in (coarsen, 0.5 * coarsen)]
        made.append((both[0], both[1]))
    return PairRoots(pair, (made[0], made[1]))


def root_map(roots: ToothRoots, shape: tuple[int, int], source: IntArray) -> RootMap:
    """The roots of the cells of a map with m torques and n angles, row by row, at all angles.

    Parameters
    ----------
    shape
        (m, n).
    source : ndarray
        Number of the solved angle behind each angle of the map.
    """
    cells = shape[0] * shape[1]
    leading = np.full(cells, -np.inf)
    np.maximum.at(leading, roots.position, roots.pair)
    behind = leading[roots.position].astype(np.int64) - roots.pair
    stress = np.full((cells, 2, int(behind.max(initial=0)) + 1), np.nan)
    diameter, error = np.full((2, cells, 2), np.nan)
    for g in range(2):
        stress[roots.position, g, behind] = roots.stress[:, g]
        order = np.argsort(roots.stress[:, g], kind="stable")  # the largest of a cell comes last and stays
        diameter[roots.position[order], g] = roots.diameter[order, g]
        error[roots.position[order], g] = roots.error[order, g]
    return RootMap(*(values.reshape(*shape, *values.shape[1:])[:, source] for values in (stress, diameter, error)))
