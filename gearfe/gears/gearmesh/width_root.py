r"""Stress at the tooth roots of gears with face widths, over the width, from the loads of their lines of contact.

The fillet carries no traction, so that its stress is a plane one in its surface and follows from the surface's own
stretching. In axes that turn with the helix (`gearfe.fem.extruded`) the surface has the tangents t, of unit length in
the section, and :math:`h = \kappa J x + e_z` along the helix. With the displacement (v, w) and the arc length s,

.. math::
    E_{tt} = t\cdot v_{,s},\qquad E_{hh} = \kappa Jx\cdot(\kappa Jv + v_{,z}) + w_{,z},\qquad
    2E_{th} = t\cdot(\kappa Jv + v_{,z}) + \kappa Jx\cdot v_{,s} + w_{,s} .

With b the unit vector of the surface across t, Hooke's law for a plane stress gives the stresses along t and b, and
the root stress is the larger principal one. Loads that are even over the width leave that of
`gearfe.gears.gearmesh.root_stress`, :math:`E' t\cdot v_{,s}`.

Each gear has two meshes with a fine fillet and a coarse flank, as there. The value is that of the finer one. The
coarser has elements twice as large, and polynomials along the axis of an order two lower. The difference is the
estimate of the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.progress import one_thread
from ...base.typing import Array, IntArray
from ...fem.extruded import condense_extruded, section_integrals
from ...fem.multifrontal import unknowns_of
from ..contact.flank import edge_shapes, flank_of
from ..contact.flank_compliance import bumps
from ..teeth.tooth_sector import sector_mesh, sector_recipes
from ..width.compliance import HIGHER, AxialSystem, axial_systems, cyclic_response, layers_of, legendre, loads_of
from ..width.lines import ContactLines, rows_at
from ..width.sweep import WidthSweep
from .root_stress import GAUSS, REACH, peaks, root_recipe

#: Places along the width at which stresses are given.
PLACES = 41
#: Sizes of the finer and of the coarser mesh, and orders of their polynomials beyond that of the load.
MESHES = ((1.0, HIGHER), (2.0, 0))
#: Nodes of the fillet whose displacements are taken at a time.
NODES = 8


@dataclass(frozen=True)
class FilletSystem:
    """Displacements of a tooth's fillet by loads on the flanks, of functions along the axis that part from the others.

    Attributes
    ----------
    axial : AxialSystem
        The functions.
    response : ndarray, shape (steps, nodes, width, k, 2, loads)
        Step, node and unknown on the tooth so many steps on; station, axis and Legendre function of the load (m/N).
    """

    axial: AxialSystem
    response: Array


@dataclass(frozen=True)
class FilletMesh:
    """The loaded side's fillet of the teeth of one gear over its width.

    Attributes
    ----------
    edges : ndarray, shape (e, 3)
        Nodes of its edges among those of the fillet, from the form point inwards.
    corners : ndarray, shape (e, 3, 2)
        Their places (m).
    z : ndarray, shape (c,)
        Places along the axis (m).
    steps : tuple of int
        Distances of teeth that feel a load.
    systems : tuple of FilletSystem
        Displacements by loads.
    turn
        kappa (rad/m).
    moduli
        E/(1 - nu2) (Pa), and nu (-).
    """

    edges: IntArray
    corners: Array
    z: Array
    steps: tuple[int, ...]
    systems: tuple[FilletSystem, ...]
    turn: float
    moduli: tuple[float, float]

    def largest(self, loads: Array, source: Array, target: Array) -> tuple[Array, Array]:
        """Return the largest tension across each place of the width, and the radius where it acts.

        Parameters
        ----------
        loads : ndarray, shape (l, k, 2, n)
            Loads of lines of contact by station, axis of the tooth and Legendre function (N).
        source, target : ndarray of int, shapes (l, 2), (t, 2)
            Position and tooth of the loads, and of the fillets.

        Returns
        -------
        stress, radius : ndarray, shape (t, c)
            Pa, m.
        """
        shapes, slopes, _ = edge_shapes(GAUSS)
        along = np.einsum("qa,eai->eqi", slopes, self.corners)
        speed = np.linalg.norm(along, axis=-1)
        lengths = 0.5 * speed.sum(axis=1)
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        places = (ends[:-1, None] + np.diff(ends)[:, None] * GAUSS).ravel()
        radii = np.linalg.norm(np.einsum("qa,eai->eqi", shapes, self.corners), axis=-1).ravel()
        stress, radius = np.zeros((2, len(target), len(self.z)))
        for i, (position, tooth) in enumerate(target.tolist()):
            felt = np.flatnonzero((source[:, 0] == position) & np.isin(tooth - source[:, 1], self.steps))
            by_step = [(self.steps.index(int(tooth - source[j, 1])), loads[j]) for j in felt]
            tension = self._tension(by_step, along / speed[..., None], speed)
            stress[i], radius[i] = peaks(places, tension.reshape(-1, len(self.z)).T, radii)
        return stress, radius

    def _tension(self, loads: Sequence[tuple[int, Array]], tangent: Array, speed: Array) -> Array:
        """Larger principal stress (Pa) by loads on teeth so many steps off, shape (e, q, c)."""
        fields = np.zeros((3, 2, int(self.edges.max()) + 1, len(self.z)))  # v_x, v_y, w; value and slope along z
        for system in self.systems:
            of_system = system.axial.loads
            moved = np.zeros(system.response.shape[1:3])
            for step, load in loads:
                moved += np.tensordot(system.response[step], load[:, :, of_system], axes=3)
            plane, axial = system.axial.at
            for axis, functions in enumerate((plane, plane, axial)):
                if functions is not None:
                    start = axis * plane.count
                    of_axis = moved[:, start : start + functions.count]
                    fields[axis, 0] += of_axis @ functions.values.T
                    fields[axis, 1] += of_axis @ functions.slopes.T
        shapes, slopes, _ = edge_shapes(GAUSS)
        at_edges = fields[:, :, self.edges]  # axis, value or slope, edge, node, place
        value, rate = np.einsum("qa,xdeac->dxeqc", shapes, at_edges)
        by_arc = np.einsum("qa,xeac->xeqc", slopes, at_edges[:, 0]) / speed[..., None]
        x, y = np.moveaxis(np.einsum("qa,eai->eqi", shapes, self.corners), -1, 0)[..., None]
        tx, ty = np.moveaxis(tangent, -1, 0)[..., None]
        hx, hy = -self.turn * y, self.turn * x
        on_x, on_y = rate[0] - self.turn * value[1], rate[1] + self.turn * value[0]
        tt = tx * by_arc[0] + ty * by_arc[1]
        hh = hx * on_x + hy * on_y + rate[2]
        th = 0.5 * (tx * on_x + ty * on_y + hx * by_arc[0] + hy * by_arc[1] + by_arc[2])
        lean = hx * tx + hy * ty
        length = np.sqrt(1.0 + hx**2 + hy**2 - lean**2)
        bb, tb = (hh - 2.0 * lean * th + lean**2 * tt) / length**2, (th - lean * tt) / length
        stiff, nu = self.moduli
        mean, half = 0.5 * stiff * (1.0 + nu) * (tt + bb), 0.5 * stiff * (1.0 - nu) * (tt - bb)
        return np.asarray(mean + np.hypot(half, stiff * (1.0 - nu) * tb))


def fillet_mesh(lines: ContactLines, gear: int, size: float, higher: int) -> FilletMesh:
    """Mesh and condense the fillet of one gear.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    gear : int
        0 for the pinion, 1 for the wheel.
    size
        Factor on the sizes of `root_recipe`.
    higher
        Order of the polynomials along the axis beyond that of the load.
    """
    mesh, side = lines.compliance.mesh, lines.compliance.sides[gear].local
    section, material = mesh.gears[gear], mesh.materials[gear]
    recipe = sector_recipes(mesh.sections, coarsen=mesh.coarsen)[gear]
    sector = sector_mesh(section, root_recipe(recipe, section, size))
    integrals = section_integrals(sector.points, sector.triangles, material, mesh.turns[gear])
    flank, edges = flank_of(sector, 4), sector.boundaries["root_left"]
    nodal = bumps(flank, side.stations[:, None], side.bumps[:, None])
    nodes, of_edges = np.unique(edges, return_inverse=True)
    reach = min(REACH, (section.tooth_count - 1) // 2)
    steps = tuple(range(-reach, reach + 1))
    sides = np.concatenate([sector.cut_right[:-1], sector.cut_left[:-1]])
    z = np.linspace(*mesh.faces[gear], PLACES)
    systems = []
    for system in axial_systems(mesh, gear, higher=higher, places=z):
        factor = condense_extruded(
            sector.points, sector.triangles, integrals, system.functions,
            retained=sides, fixed=np.unique(sector.held),
            layers=layers_of(mesh, gear, sector),
        )  # fmt: skip
        loads = loads_of(mesh, gear, system, sector.points[flank.nodes], nodal)
        shape, width = loads.shape[2:], system.width
        eliminated, at_sides = factor.reduced_loads(
            unknowns_of(flank.nodes, width), loads.reshape(len(flank.nodes) * width, -1)
        )
        held, felt = [], []
        for first in range(0, len(nodes), NODES):
            unknowns = unknowns_of(nodes[first : first + NODES], width)
            forms, at = factor.reduced_loads(unknowns, np.eye(len(unknowns)))
            held.append(forms.T @ eliminated)
            felt.append(at)
        widths = 2 * system.functions[0].count, width
        response = cyclic_response(factor.schur, np.concatenate(felt, axis=1), at_sides, widths, sector.pitch, steps)
        response[reach] += np.concatenate(held)
        systems.append(FilletSystem(system, response.reshape(len(steps), len(nodes), width, *shape)))
    nu = material.poisson_ratio
    moduli = material.youngs_modulus / (1.0 - nu**2), nu
    corners = sector.points[edges]
    return FilletMesh(of_edges.reshape(edges.shape), corners, z, steps, tuple(systems), mesh.turns[gear], moduli)


@dataclass(frozen=True)
class WideRoots:
    """Root stresses of t loaded tooth pairs over the width; the second axis is the gear (pinion, wheel).

    Attributes
    ----------
    load, position, pair : ndarray of int, shape (t,)
        Numbers of load, pinion angle and tooth pair.
    z : ndarray, shape (2, c)
        Places along the axes (m).
    stress, radius : ndarray, shape (t, 2, c)
        Largest tension along the fillet at each place (Pa), and where it acts (m).
    error : ndarray, shape (t, 2)
        Estimated relative error of the largest one over the width (-).
    """

    load: IntArray
    position: IntArray
    pair: IntArray
    z: Array
    stress: Array
    radius: Array
    error: Array


def wide_roots(lines: ContactLines, sweep: WidthSweep) -> WideRoots:
    """Return the root stresses of all loaded tooth pairs of a sweep.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    sweep : WidthSweep
        Their loads.
    """
    points, positions = sweep.points, sweep.status.shape[1]
    cell = points.load * positions + points.position
    line, of_point = np.unique(np.stack([cell, points.pair]), axis=1, return_inverse=True)
    forces = [line_loads(lines, sweep, gear, of_point.ravel(), line.shape[1]) for gear in (0, 1)]
    stress, radius = np.zeros((2, line.shape[1], 2, PLACES))
    error, z = np.zeros((line.shape[1], 2)), np.zeros((2, PLACES))
    for gear in (0, 1):
        tooth = line[1] if gear == 0 else -1 - line[1]
        teeth = np.stack([line[0], tooth], axis=1)
        with one_thread():
            fine, coarse = (fillet_mesh(lines, gear, *sizes) for sizes in MESHES)
            stress[:, gear], radius[:, gear] = fine.largest(forces[gear], teeth, teeth)
            other = coarse.largest(forces[gear], teeth, teeth)[0]
        most = stress[:, gear].max(axis=1)
        error[:, gear] = np.abs(other.max(axis=1) - most) / np.abs(most)
        z[gear] = fine.z
    return WideRoots(line[0] // positions, line[0] % positions, line[1], z, stress, radius, error)


@dataclass(frozen=True)
class CellRoots:
    """Largest root stress of each position; shape (m, n, 2) with the gears last, NaN where nothing is loaded.

    Attributes
    ----------
    stress, z, radius : ndarray
        Tension (Pa), and the place along the axis and the radius where it acts (m).
    error : ndarray
        Its estimated relative error (-).
    """

    stress: Array
    z: Array
    radius: Array
    error: Array


def roots_of_cells(roots: WideRoots, shape: tuple[int, int]) -> CellRoots:
    """Return the largest root stress over the width and the loaded teeth of each load and angle."""
    cells = np.full((4, *shape, 2), np.nan)
    for gear in (0, 1):
        place = np.argmax(roots.stress[:, gear], axis=1)
        row = np.arange(len(place))
        values = roots.stress[row, gear, place], roots.z[gear, place], roots.radius[row, gear, place]
        order = np.argsort(values[0], kind="stable")  # the largest of a cell comes last and stays
        for cell, value in zip(cells, (*values, roots.error[:, gear]), strict=True):
            cell[roots.load[order], roots.position[order], gear] = value[order]
    return CellRoots(*cells)


def roots_along(roots: WideRoots, loads: int) -> tuple[Array, Array, IntArray]:
    """Return the largest root stress over the mesh cycle at places along the width, for each load and gear.

    Returns
    -------
    stress, radius : ndarray, shape (loads, 2, c)
        Tension (Pa; NaN without load), and radius where it acts (m).
    row : ndarray of int, shape (loads, 2, c)
        Number of the loaded tooth pair among `roots`, -1 without load.
    """
    stress, radius = np.full((2, loads, 2, roots.z.shape[1]), np.nan)
    row = np.full(stress.shape, -1)
    for load in np.unique(roots.load).tolist():
        of_load = np.flatnonzero(roots.load == load)
        most = np.argmax(roots.stress[of_load], axis=0)
        stress[load] = np.take_along_axis(roots.stress[of_load], most[None], axis=0)[0]
        radius[load] = np.take_along_axis(roots.radius[of_load], most[None], axis=0)[0]
        row[load] = of_load[most]
    return stress, radius, row


def line_loads(lines: ContactLines, sweep: WidthSweep, gear: int, of_point: IntArray, count: int) -> Array:
    """Return loads of lines of contact on one gear by station, axis of the tooth and Legendre function (N).

    Parameters
    ----------
    lines : ContactLines
        The gears.
    sweep : WidthSweep
        Their loaded points.
    gear : int
        0 for the pinion, 1 for the wheel.
    of_point : ndarray of int, shape (p,)
        Number of each point's line of contact.
    count : int
        Number of lines.
    """
    mesh, points = lines.compliance.mesh, sweep.points
    carries = points.weight > 0.0
    z, position = points.z[carries], points.position[carries]
    angle = sweep.angle[position] - 0.5 * mesh.ratio * sweep.twist[points.load[carries], position]
    rows = rows_at(lines.law, angle + mesh.turns[0] * z + points.pair[carries] * mesh.sections.mesh_cycle)
    force = (points.line_load * points.weight)[carries] * (-1.0 if gear == 0 else 1.0)
    k = len(lines.compliance.sides[gear].local.stations)
    values = lines.compliance.shapes.at(rows.arc)[:, gear, 0, :k]
    along = legendre(z, mesh.zone, mesh.count)
    each = np.einsum("p,pk,pi,pn->pkin", force, values, rows.tooth_normal[:, gear], along, optimize=True)
    loads = np.zeros((count, *each.shape[1:]))
    np.add.at(loads, of_point[carries], each)
    return loads
