#!/usr/bin/env python3
"""Compare gears over the face width with a resolved contact of finite elements in space.

One segment of each gear, its cuts and bore held: wedges of 18 nodes in space, fine where the flanks bear; the pressure
is constant on cells of the contact surface, whose mean gap closes (a mortar contact). Nothing is shared with
`gearfe.gears.width` except the sections' meshes and the exact flanks: no turning axes, no line of contact, no
half-plane.

One tooth pair bears. Both are solved at the twist that the lines of contact find for the torque. docs/face_width.md has
the results.

Usage: python scripts/benchmarks/measure_helical_contact.py [--helix 0 15] [--torque 60] [--fine 0.1] [--layers 6]
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

from gearfe.base.typing import Array, IntArray
from gearfe.fem.multifrontal import BlockRows, Factor, eliminate, elimination_order, unknowns_of
from gearfe.fem.plane import Material, triangle_rule, triangle_shapes
from gearfe.gears.contact.flank import edge_nodes, edge_shapes, flank_of
from gearfe.gears.contact.laws import STEEL
from gearfe.gears.geometry.face import face_of
from gearfe.gears.geometry.first_contact import ToothFlanks
from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.geometry.spur_gear import Gear
from gearfe.gears.teeth.tooth_sector import SectorMesh, sector_mesh, sector_recipes
from gearfe.gears.width import WideMesh, contact_lines, wide_compliance
from gearfe.gears.width.lines import solve_position

#: Normal module and face width (m), teeth.
MODULE, WIDTH, TEETH = 2.5e-3, 6e-3, (20, 30)
#: Half width of the cells' window in that of Hertz's contact, and a radius of curvature (m) and modulus (Pa) for it.
WINDOW, RADIUS, MODULUS = 1.5, 8e-3, 1.15e11
#: Functions of the load along the width.
FUNCTIONS = 7
#: Elements of the flank away from the contact (m), and what the fine ones reach beyond the window (m).
COARSE, BEYOND = 3e-4, 2e-4


def helical_pair(helix: float) -> MeshGeometry:
    """Transverse sections of gears of a normal module and 20 degrees, at a helix angle (rad)."""
    c = math.cos(helix)
    form = {"addendum": c, "dedendum": 1.25 * c, "rack_tip_radius": 0.3 * c, "tip_round": 1e-4}
    angle = math.atan(math.tan(math.radians(20.0)) / c)
    gears = [Gear(z, MODULE / c, angle, WIDTH, 0.6 * z * MODULE, **form) for z in TEETH]
    return MeshGeometry(gears[0], gears[1])


def line_shapes(t: Array) -> tuple[Array, Array]:
    """Values and slopes of the three quadratic functions on 0 to 1."""
    value, slope, _ = edge_shapes(t)
    return value, slope


def elasticity(material: Material) -> Array:
    """Stresses xx, yy, zz, yz, xz, xy of strains (Pa)."""
    lam, mu = material.lame()
    matrix = np.diag([2 * mu] * 3 + [mu] * 3)
    matrix[:3, :3] += lam
    return matrix


class Segment:
    """One tooth of a gear in space, in the axes of its tooth at z = 0, factorised.

    Parameters
    ----------
    sector : SectorMesh
        Section.
    turn : float
        Turn of the section along z (rad/m).
    layers : int
        Number of layers over the width, graded to the ends.
    material : Material
        Elasticity.
    """

    def __init__(self, sector: SectorMesh, turn: float, layers: int, material: Material) -> None:
        self.sector, self.flank = sector, flank_of(sector, 4)
        self.ends = 0.5 * WIDTH * np.sin(0.5 * math.pi * np.linspace(-1.0, 1.0, layers + 1))
        levels = np.interp(np.arange(2 * layers + 1) / 2, np.arange(layers + 1), self.ends)
        plane = sector.points @ [1, 1j]
        at = plane * np.exp(1j * turn * levels[:, None])
        self.points = np.stack([at.real, at.imag, np.broadcast_to(levels[:, None], at.shape)], axis=-1).reshape(-1, 3)
        self.count = len(plane)
        nodes = [
            np.concatenate([sector.triangles + (2 * e + j) * self.count for j in range(3)], axis=1)
            for e in range(layers)
        ]
        elements = np.concatenate(nodes)
        held = np.unique(np.concatenate([sector.cut_left, sector.cut_right, np.unique(sector.boundaries["bore"])]))
        fixed = (held + self.count * np.arange(2 * layers + 1)[:, None]).ravel()
        matrix = sum(self._stiffness(part, material) for part in nodes)
        centres = self.points[elements].mean(axis=1)
        order, ends = elimination_order(
            elements, centres, nodes=len(self.points), retained=np.zeros(0, dtype=np.int64), fixed=fixed, width=12
        )
        chosen = unknowns_of(order, 3)
        whole = sparse.csr_matrix(matrix)[chosen][:, chosen]
        blocks = (sparse.triu(whole) + sparse.tril(_diagonal_blocks(whole), -1)).tobsr((3, 3))
        blocks.sort_indices()
        rows = BlockRows(blocks.indptr.astype(np.int64), blocks.indices.astype(np.int64), blocks.data)
        self.factor: Factor = eliminate(rows, ends, order, len(self.points))

    def _stiffness(self, elements: IntArray, material: Material) -> Any:
        """Sum of the stiffness of elements of 18 nodes, in scipy's rows."""
        r, s, area, *_ = triangle_rule(4)
        t, length = np.polynomial.legendre.leggauss(3)
        plane, plane_slopes = triangle_shapes(r, s)
        axial, axial_slopes = line_shapes(0.5 * (t + 1))
        law, m = elasticity(material), len(elements)
        places, total = self.points[elements], np.zeros((m, 54, 54))
        for q in range(len(r)):
            for p in range(3):
                slopes = np.concatenate([
                    np.einsum("ai,b->bai", plane_slopes[q], axial[p]),
                    np.einsum("a,b->ba", plane[q], axial_slopes[p])[..., None],
                ], axis=-1).reshape(18, 3)  # fmt: skip
                jacobian = np.einsum("ai,max->mix", slopes, places)
                gradient = np.einsum("mxi,ai->max", np.linalg.inv(jacobian), slopes)
                b = np.zeros((m, 6, 18, 3))
                x, y, z = np.moveaxis(gradient, -1, 0)
                b[:, 0, :, 0] = b[:, 5, :, 1] = b[:, 4, :, 2] = x
                b[:, 1, :, 1] = b[:, 5, :, 0] = b[:, 3, :, 2] = y
                b[:, 2, :, 2] = b[:, 4, :, 0] = b[:, 3, :, 1] = z
                b = b.reshape(m, 6, 54)
                weight = area[q] * 0.5 * length[p] * np.linalg.det(jacobian)
                total += b.transpose(0, 2, 1) @ (weight[:, None, None] * (law @ b))
        unknown = unknowns_of(elements.ravel(), 3).reshape(m, 54)
        row, column = (np.broadcast_to(a, total.shape).ravel() for a in (unknown[:, :, None], unknown[:, None, :]))
        size = 3 * len(self.points)
        return sparse.coo_matrix((total.ravel(), (row, column)), shape=(size, size)).tocsr()

    def loads(self, arcs: Array, z: Array, weights: Array, normal: Array) -> Array:
        """Nodal loads of c cells by q points each, with a direction in the axes of the tooth, shape (3 n, c).

        Parameters
        ----------
        arcs, z, weights : ndarray, shape (c, q)
            Arc lengths on the flank and places along z (m), and shares of a unit force.
        normal : ndarray, shape (3,)
            Direction of the force.
        """
        edge, xi = self.flank.place(arcs)
        layer = np.clip(np.searchsorted(self.ends, z, side="right") - 1, 0, len(self.ends) - 2)
        t = (z - self.ends[layer]) / np.diff(self.ends)[layer]
        along, over = edge_shapes(xi)[0], line_shapes(t)[0]
        nodes = self.flank.nodes[edge_nodes(edge)]
        found = np.zeros((len(self.points), 3, len(arcs)))
        cell = np.broadcast_to(np.arange(len(arcs))[:, None], arcs.shape)
        for i in range(3):
            for j in range(3):
                number = nodes[..., i] + self.count * (2 * layer + j)
                share = weights * along[..., i] * over[..., j]
                for axis in range(3):
                    np.add.at(found, (number, axis, cell), share * normal[axis])
        return found.reshape(-1, len(arcs))

    def compliance(self, loads: Array) -> Array:
        """Displacements along loads by loads (m/N)."""
        touched = np.intersect1d(np.flatnonzero(np.abs(loads).max(axis=1) > 0), self.factor.order)
        reduced, _ = self.factor.reduced_loads(touched, loads[touched])
        return np.asarray(reduced.T @ reduced)


def _diagonal_blocks(matrix: Any) -> Any:
    """The 3 by 3 blocks on the diagonal."""
    part = matrix.tocoo()
    kept = part.row // 3 == part.col // 3
    return sparse.csr_matrix((part.data[kept], (part.row[kept], part.col[kept])), shape=matrix.shape)


def unilateral(compliance: Array, gap: Array) -> Array:
    """Forces >= 0 on cells that close the gaps: gap + C F >= 0, complementary."""
    loaded = gap < 0
    for _ in range(200):
        force = np.zeros(len(gap))
        i = np.flatnonzero(loaded)
        force[i] = np.linalg.solve(compliance[np.ix_(i, i)], -gap[i])
        left = gap + compliance @ force
        new = (loaded & (force > 0)) | (~loaded & (left < -1e-13))
        if (new == loaded).all():
            return force
        loaded = new
    raise RuntimeError("the contact of the cells does not settle")


class Cells:
    """Cells of the contact surface, c across times d along the width, with q points each.

    Parameters
    ----------
    half : float
        Half width of their window (m).
    count : pair of int
        Cells across and along the width.
    """

    def __init__(self, half: float, count: tuple[int, int]) -> None:
        tau = np.linspace(-half, half, count[0] + 1)
        self.count = count
        self.ends = 0.5 * WIDTH * np.sin(0.5 * math.pi * np.linspace(-1.0, 1.0, count[1] + 1))
        rule, weight = np.polynomial.legendre.leggauss(3)
        rule, shape = 0.5 * (rule + 1), (*count, 3, 3)
        across, along = ((ends[:-1, None] + np.diff(ends)[:, None] * rule) for ends in (tau, self.ends))
        self.tau = np.broadcast_to(across[:, None, :, None], shape).reshape(-1, 9)
        self.z = np.broadcast_to(along[None, :, None, :], shape).reshape(-1, 9)
        self.weights = np.broadcast_to(0.25 * weight[:, None] * weight, shape).reshape(-1, 9)


def on_flank(curve: Any, turned: Any, origin: Any, normal: complex, tau: Array, arcs: Array) -> tuple[Array, Array]:
    """Heights along the normal (m) and arc lengths (m) of the points of a flank across from places of the cells.

    Parameters
    ----------
    curve : ndarray of complex, shape (k,)
        Points of the flank about its gear's centre, less the centre's place (m).
    turned, origin : ndarray of complex, shape (c, q)
        Turn of the section, and the place in it from which `tau` counts, seen from the gear's centre (m).
    normal : complex
        Normal of the contact.
    tau : ndarray, shape (c, q)
        Places along the common tangent (m).
    arcs : ndarray, shape (k,)
        Arc lengths of `curve` (m).
    """
    height, arc = np.zeros(tau.shape), np.zeros(tau.shape)
    for i in np.ndindex(tau.shape):
        seen = (curve * turned[i] - origin[i]) / normal
        order = np.argsort(-seen.imag)
        height[i], arc[i] = (np.interp(tau[i], -seen.imag[order], of[order]) for of in (seen.real, arcs))
    return height, arc


def compare(helix: float, torque: float, fine: float, layers: int, count: tuple[int, int]) -> None:
    """Print the loads along the width of both (N/mm), and the ratio of their forces."""
    pair = helical_pair(helix)
    base = math.atan(math.tan(helix) * math.cos(pair.pinion.transverse_pressure_angle))
    mesh = WideMesh(pair, base, coarsen=1.0, functions=FUNCTIONS)
    lines = contact_lines(wide_compliance(mesh, whole=False), density=4.0)
    angle = 0.5 * (pair.path["B"].pinion_angle + pair.path["D"].pinion_angle)  # where one pair bears
    solution = solve_position(lines, angle, torque=torque)
    assert solution.converged
    assert len(np.unique(solution.points.pair[solution.moment > 0])) == 1
    force = solution.moment / solution.points.rows.arm
    cells = Cells(WINDOW * 2 * math.sqrt(force.sum() / WIDTH * RADIUS / (math.pi * MODULUS)), count)

    normal = complex(np.exp(1j * (0.5 * math.pi - pair.working_pressure_angle)))
    frames = ToothFlanks(pair).frames(np.array([angle]), np.array([0]), 0.0)[0] + [0.0, pair.contact_twist]
    roll = pair.pinion_roll_at(angle + mesh.turns[0] * cells.z)
    origin = pair.pinion.base_radius * np.exp(-1j * pair.working_pressure_angle) + roll * normal
    rolls = pair.pinion_roll_at(angle), pair.tangent_length - pair.pinion_roll_at(angle)
    compliance, heights = np.zeros((count[0] * count[1],) * 2), []
    for g, (gear, recipe) in enumerate(zip(mesh.gears, sector_recipes(pair), strict=True)):
        way, started = 1.0 - 2.0 * g, time.perf_counter()
        face = face_of(gear)
        s = np.linspace(*face.arc_at(np.array([0.0, 1.0])), 6001)
        curve, centre = face.at(s)[0] * np.exp(1j * frames[g]), g * pair.working_centre_distance
        height, arc = on_flank(curve, np.exp(1j * mesh.turns[g] * cells.z), origin - centre, normal, cells.tau, s)
        sizes = {"flank": COARSE, "strip": fine, "strip_length": 0.5 * float(np.ptp(arc)) + BEYOND, "growth": 0.5}
        sector = sector_mesh(gear, replace(recipe, active_start=rolls[g], **sizes))
        segment = Segment(sector, mesh.turns[g], layers, STEEL)
        into = -way * normal / np.exp(1j * frames[g])
        direction = np.array([*(math.cos(base) * np.array([into.real, into.imag])), way * math.sin(base)])
        compliance += segment.compliance(segment.loads(arc, cells.z, cells.weights, direction))
        heights.append(height)
        print(f"gear {g}: {len(segment.points)} nodes, {time.perf_counter() - started:.0f} s", flush=True)
    overlap = solution.twist * pair.wheel.base_radius
    gap = (((heights[1] - heights[0]) * cells.weights).sum(axis=1) - overlap) * math.cos(base)
    of_cells = unilateral(compliance, gap).reshape(count) * math.cos(base)
    order = np.argsort(solution.points.z)
    per_width = (force / solution.points.weight)[order]
    places = [np.linspace(*ends, 101) for ends in itertools.pairwise(cells.ends)]
    of_lines = [np.interp(at, solution.points.z[order], per_width).mean() for at in places]
    print(f"helix {math.degrees(helix):g} deg, {torque:g} N m; ends of the layers (mm):", np.round(1e3 * cells.ends, 2))
    print("  elements (N/mm):", np.round(1e-3 * of_cells.sum(axis=0) / np.diff(cells.ends), 1))
    print("  lines (N/mm):   ", np.round(1e-3 * np.array(of_lines), 1))
    across = np.count_nonzero((of_cells > 0).any(axis=1))
    print(f"  {across} cells across the contact; force of elements over that of lines "
          f"{of_cells.sum() / force.sum():.4f}", flush=True)  # fmt: skip


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--helix", type=float, nargs="+", default=[0.0, 15.0], help="helix angles (deg)")
    parser.add_argument("--torque", type=float, default=60.0, help="at the wheel (N m)")
    parser.add_argument("--fine", type=float, default=0.1, help="elements where the flanks bear (mm)")
    parser.add_argument("--layers", type=int, default=6, help="layers over the width")
    parser.add_argument("--cells", type=int, nargs=2, default=[12, 10], help="cells across the contact and along it")
    args = parser.parse_args()
    for helix in args.helix:
        compare(math.radians(helix), args.torque, 1e-3 * args.fine, args.layers, (args.cells[0], args.cells[1]))


if __name__ == "__main__":
    main()
