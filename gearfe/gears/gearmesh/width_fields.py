r"""Displacement and stress in space on whole gears with face widths, from the loads of their lines of contact.

The loads of a position go to the finite elements as in `gearfe.gears.width.compliance`, bumps along the flank times
Legendre functions along the width, on sections with finer flanks. Cyclic symmetry gives the displacements of the cut
sides of all sectors, the fronts those in between. In axes that turn with the helix the strains are those of
`gearfe.fem.extruded`; stresses are averaged over the elements that meet at a node.

**Below a contact** the section is that of a half-plane, as in `.fields`: the pressure of Hertz's line contact with the
line load f(z) stands where the elements carry bumps. These have the load :math:`f_n(z)` that n functions leave of f.
What they leave out acts evenly within the length l of the logarithms, the reach of the first function left out:

.. math::
    \sigma = \sigma^{FE} + \sigma^{HP}[\text{Hertz}, f] - \sigma^{HP}[\text{bumps}, f_n] - \sigma^{HP}[l, f - f_n] .

All are elliptic pressures, whose stresses are known in closed form (K. L. Johnson, Contact Mechanics, 1985, eq. 4.49).
With the relative curvature K of both flanks in the transverse section, and lines of contact inclined by the base helix
angle, the half width along the flank and the largest pressure are

.. math::
    a^2 = \frac{4 f}{\pi K\cos\beta_b}\sum\frac{1}{E'}, \qquad p_0 = \frac{2f}{\pi a} .
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.progress import one_thread
from ...base.typing import Array, IntArray
from ...fem.extruded import condense_extruded, elasticity, section_integrals
from ...fem.multifrontal import Factor, unknowns_of
from ...fem.plane import physical_gradients, triangle_shapes
from ..contact.flank import Flank, flank_of
from ..contact.flank_compliance import bumps
from ..contact.panels import ELLIPSE_W, ELLIPSE_X
from ..teeth.tooth_sector import SectorMesh, sector_mesh, sector_recipes
from ..teeth.whole_gear import WholeGear, whole_gear
from ..width import ContactLines, WidthSweep
from ..width.compliance import AxialSystem, axial_systems, cyclic_response, layers_of, legendre, loads_of
from ..width.lines import rows_at
from ..width.pair_law import first_teeth, pair_contacts
from ..width.sweep import CONVERGED, load_along
from .fields import flank_frame, turned_stress
from .width_root import line_loads

#: Flank elements of the sections in those of the contact's sections: contacts are narrower than these.
FINER_FLANK = 0.5
#: Least half width of a contact (modules): at sharp edges Hertz's is zero.
LEAST_HALF_WIDTH = 0.005


@dataclass(frozen=True)
class SolidField:
    """Fields of one whole gear over its face width, in the axes of the solver: n nodes of a section at l levels.

    Attributes
    ----------
    z : ndarray, shape (l,)
        Levels (m), an odd number.
    points, displacement : ndarray, shape (l, n, 3)
        m.
    triangles : ndarray, shape (m, 6)
        Elements of the section.
    stress : ndarray, shape (l, n, 6)
        Stresses xx, yy, zz, yz, xz, xy (Pa).
    pressure : ndarray, shape (l, n)
        Contact pressure, the mean over a node's share of the flank (Pa).
    """

    z: Array
    points: Array
    displacement: Array
    triangles: IntArray
    stress: Array
    pressure: Array

    @property
    def wedges(self) -> IntArray:
        """Wedges of 18 nodes between every other level, in VTK's order, shape (m (l - 1)/2, 18)."""
        n = self.points.shape[1]
        corner, edge = self.triangles[:, :3], self.triangles[:, 3:]
        parts = []
        for low in range(0, len(self.z) - 2, 2):
            below, between, above = (n * (low + i) for i in range(3))
            nodes = (corner + below, corner + above, edge + below, edge + above, corner + between, edge + between)
            parts.append(np.concatenate(nodes, axis=1))
        return np.concatenate(parts)

    @property
    def von_mises(self) -> Array:
        """Von Mises stress (Pa), shape (l, n)."""
        xx, yy, zz, yz, xz, xy = np.moveaxis(self.stress, -1, 0)
        normal = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
        return np.asarray(np.sqrt(normal + 3.0 * (xy**2 + yz**2 + xz**2)))

    @property
    def principal(self) -> Array:
        """Principal stresses (Pa), the largest first, shape (l, n, 3)."""
        tensor = self.stress[..., [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]
        return np.linalg.eigvalsh(tensor)[..., ::-1]

    def mirrored(self) -> SolidField:
        """Return the same seen from the other side: turned by half a turn about x, where y and z count backwards."""
        sign = np.array([1.0, -1.0, -1.0])
        of_stress = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
        order = self.triangles[:, [0, 2, 1, 5, 4, 3]]  # counter-clockwise again
        reverse = slice(None, None, -1)
        return SolidField(
            z=-self.z[reverse],
            points=(self.points * sign)[reverse],
            displacement=(self.displacement * sign)[reverse],
            triangles=order,
            stress=(self.stress * of_stress)[reverse],
            pressure=self.pressure[reverse],
        )

    def section(self, level: int) -> SectionField:
        """Return the section at a level."""
        at = self.points[level, :, :2], self.displacement[level, :, :2]
        return SectionField(float(self.z[level]), at[0], self.triangles, at[1], self.von_mises[level])


@dataclass(frozen=True)
class SectionField:
    """Fields of a whole gear in a section across its axis.

    Attributes
    ----------
    z
        Place of the section (m).
    points, displacement : ndarray, shape (n, 2)
        m.
    triangles : ndarray, shape (m, 6)
        Elements.
    von_mises : ndarray, shape (n,)
        Pa.
    """

    z: float
    points: Array
    triangles: IntArray
    displacement: Array
    von_mises: Array


@dataclass(frozen=True)
class FieldSystem:
    """Factorised elements of a sector, of functions along the axis that part from the others.

    Attributes
    ----------
    axial : AxialSystem
        The functions.
    factor : Factor
        Down to the cut sides.
    nodal : ndarray, shape (f width, k, 2, loads)
        Loads on the unknowns of the flank's nodes by those of the stations.
    """

    axial: AxialSystem
    factor: Factor
    nodal: Array


@dataclass(frozen=True)
class FieldGear:
    """One gear of which fields are recovered.

    Attributes
    ----------
    lines : ContactLines
        Both gears.
    gear
        0 for the pinion, 1 for the wheel.
    sector : SectorMesh
        Mesh of a tooth's section.
    flank : Flank
        Its working flank.
    z : ndarray, shape (l,)
        Levels (m).
    systems : tuple of FieldSystem
        Elastic sector.
    """

    lines: ContactLines
    gear: int
    sector: SectorMesh
    flank: Flank
    z: Array
    systems: tuple[FieldSystem, ...]

    @cached_property
    def whole(self) -> WholeGear:
        """Its whole section."""
        return whole_gear(self.sector)

    def sides(self, loads: Array) -> list[Array]:
        """Return the displacements of the cut sides of all sectors by loads on one tooth, for each system.

        Parameters
        ----------
        loads : ndarray, shape (c, k, 2, n)
            Loads of lines of contact by station, axis of the tooth and Legendre function (N).

        Returns
        -------
        list of ndarray, shape (teeth, r, c)
            Sector, counted from the loaded tooth; unknown of both sides; load (m).
        """
        found = []
        for system in self.systems:
            nodal = self.nodal(system, loads)
            at_sides = system.factor.reduced_loads(self.unknowns(system), nodal)[1]
            widths = 2 * system.axial.functions[0].count, system.axial.width
            every = np.eye(len(at_sides))
            teeth = self.sector.teeth
            found.append(cyclic_response(system.factor.schur, every, at_sides, widths, self.sector.pitch, range(teeth)))
        return found

    def nodal(self, system: FieldSystem, loads: Array) -> Array:
        """Return the nodal loads of lines of contact, see `sides`, on one system, shape (f width, c) (N)."""
        of_system = loads[..., system.axial.loads]
        return np.asarray(np.tensordot(system.nodal, of_system, axes=([1, 2, 3], [1, 2, 3])))

    def unknowns(self, system: FieldSystem) -> IntArray:
        """Numbers of the unknowns of the flank's nodes."""
        return unknowns_of(self.flank.nodes, system.axial.width)

    def displacements(self, sides: Sequence[Array], loads: Array, teeth: IntArray) -> Array:
        """Return v and w in the axes of each sector at all levels, and their slopes along z.

        Parameters
        ----------
        sides : sequence of ndarray, shape (teeth, r, c)
            Of the loads, see `sides`.
        loads : ndarray, shape (c, k, 2, n)
            Loads of lines of contact.
        teeth : ndarray of int, shape (c,)
            Teeth that they act on.

        Returns
        -------
        ndarray, shape (2, 3, s, l, teeth)
            Value (m) or slope (-), axis, node of the sector, level, sector.
        """
        count = self.sector.teeth
        found = np.zeros((2, 3, len(self.sector.points), len(self.z), count))
        every = np.arange(count)
        for system, of_system in zip(self.systems, sides, strict=True):
            at_sides = sum(of_system[(every - tooth) % count, :, c] for c, tooth in enumerate(teeth.tolist()))
            nodal = np.zeros((len(self.unknowns(system)), count))
            np.add.at(nodal.T, teeth % count, self.nodal(system, loads).T)
            moved = system.factor.recover(np.asarray(at_sides).T, self.unknowns(system), nodal)
            moved = moved.reshape(len(self.sector.points), system.axial.width, count)
            plane, axial = system.axial.at
            for axis, functions in enumerate((plane, plane, axial)):
                if functions is not None:
                    start = axis * plane.count
                    of_axis = moved[:, start : start + functions.count]
                    for i, basis in enumerate((functions.values, functions.slopes)):
                        found[i, axis] += np.einsum("spt,lp->slt", of_axis, basis, optimize=True)
        return found

    @cached_property
    def _gradients(self) -> Array:
        """Gradients of the shape functions at the six nodes of each triangle, shape (m, 6, 6, 2) (1/m)."""
        r = np.array([0.0, 1.0, 0.0, 0.5, 0.5, 0.0])
        s = np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.5])
        corners = self.sector.points[self.sector.triangles]
        return physical_gradients(corners, triangle_shapes(r, s)[1])[0]

    @cached_property
    def _at_nodes(self) -> Any:
        """Sparse matrix that sums over the elements at each node, shape (s, 6 m)."""
        from scipy.sparse import csr_array

        nodes = self.sector.triangles.ravel()
        return csr_array(
            (np.ones(len(nodes)), (nodes, np.arange(len(nodes)))), shape=(len(self.sector.points), len(nodes))
        )

    def sector_stress(self, fields: Array) -> Array:
        """Return sums over the elements at each node of stresses xx, yy, zz, yz, xz, xy, shape (s, l, 6) (Pa).

        Parameters
        ----------
        fields : ndarray, shape (2, 3, s, l)
            Of one sector, see `displacements`.
        """
        mesh = self.lines.compliance.mesh
        turn, nodes = mesh.turns[self.gear], self.sector.triangles
        (vx, vy, _), rates = (fields[i][:, nodes] for i in (0, 1))  # (m, 6, l) each
        by = np.einsum("mqad,xmal->xdmql", self._gradients, fields[0][:, nodes], optimize=True)
        x, y = np.moveaxis(self.sector.points[nodes], -1, 0)[..., None]
        along = turn * (y * by[:, 0] - x * by[:, 1])  # L of v and w
        strains = np.stack([
            by[0, 0],
            by[1, 1],
            rates[2] + along[2],
            by[2, 1] + rates[1] + along[1] + turn * vx,
            by[2, 0] + rates[0] + along[0] - turn * vy,
            by[0, 1] + by[1, 0],
        ])  # fmt: skip
        stress = np.tensordot(strains, elasticity(mesh.materials[self.gear]), axes=(0, 1))  # (m, 6, l, 6)
        sums = self._at_nodes @ stress.reshape(nodes.size, -1)
        return np.asarray(sums).reshape(len(self.sector.points), *stress.shape[2:])


def field_gear(lines: ContactLines, gear: int) -> FieldGear:
    """Mesh and factorise one gear for its fields.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    gear : int
        0 for the pinion, 1 for the wheel.
    """
    mesh, side = lines.compliance.mesh, lines.compliance.sides[gear].local
    section = mesh.gears[gear]
    recipe = sector_recipes(mesh.sections, coarsen=mesh.coarsen, flank_coarsen=FINER_FLANK * mesh.flank_coarsen)[gear]
    sector = sector_mesh(section, recipe)
    flank = flank_of(sector, 4)
    integrals = section_integrals(sector.points, sector.triangles, mesh.materials[gear], mesh.turns[gear])
    nodal = bumps(flank, side.stations[:, None], side.bumps[:, None])
    sides = np.concatenate([sector.cut_right[:-1], sector.cut_left[:-1]])
    z = np.linspace(*mesh.faces[gear], 2 * mesh.count + 1)
    systems = []
    for system in axial_systems(mesh, gear, places=z):
        factor = condense_extruded(
            sector.points, sector.triangles, integrals, system.functions,
            retained=sides, fixed=np.unique(sector.held),
            layers=layers_of(mesh, gear, sector),
        )  # fmt: skip
        loads = loads_of(mesh, gear, system, sector.points[flank.nodes], nodal)
        systems.append(FieldSystem(system, factor, loads.reshape(-1, *loads.shape[2:])))
    return FieldGear(lines, gear, sector, flank, z, tuple(systems))


def ellipse_stress(x: Array, depth: Array, half: Array | float, force: Array | float) -> Array:
    """Return the stresses xx, zz, xz in a half-plane under an elliptic pressure, shape (3, ...) (Pa).

    Positive xz as in `.fields.half_plane_stress`: z into the material.

    Parameters
    ----------
    x, depth : ndarray
        Places along the surface from the middle of the pressure, and depths (m), >= 0.
    half : ndarray or float
        Half width (m).
    force : ndarray or float
        Force per width (N/m).
    """
    square = half**2 - x**2 + depth**2
    root = np.hypot(square, 2.0 * x * depth)
    m2, n2 = np.maximum(0.5 * (root + square), 0.0), np.maximum(0.5 * (root - square), 0.0)
    m, n = np.sqrt(m2), np.copysign(np.sqrt(n2), x)
    total = np.maximum(m2 + n2, np.finfo(float).tiny)
    scale = -2.0 * force / (math.pi * np.asarray(half) ** 2)  # -p0/a
    share = (depth**2 + n2) / total
    return np.stack([
        scale * (m * (1.0 + share) - 2.0 * depth),
        scale * m * (1.0 - share),
        scale * n * (m2 - depth**2) / total,
    ])  # fmt: skip


@dataclass(frozen=True)
class LineContact:
    """A line of contact of a position at l levels.

    Attributes
    ----------
    pair
        Tooth pair.
    line_load, half_width : ndarray, shape (l,)
        Force per width (N/m), and half width along the flanks in the transverse section (m).
    arc : ndarray, shape (l, 2)
        Arc lengths on both flanks (m).
    normal : ndarray, shape (l, 2, 2)
        Normal in the axes of both teeth.
    """

    pair: int
    line_load: Array
    half_width: Array
    arc: Array
    normal: Array


def line_contacts(lines: ContactLines, sweep: WidthSweep, cell: tuple[int, int], z: Array) -> list[LineContact]:
    """Return the lines of contact of a position at levels.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    sweep : WidthSweep
        Their loads.
    cell : pair of int
        Numbers of load and angle.
    z : ndarray, shape (l,)
        Levels (m).
    """
    mesh, law, points = lines.compliance.mesh, lines.law, sweep.points
    here = np.flatnonzero((points.load == cell[0]) & (points.position == cell[1]))
    middle = sweep.angle[cell[1]] - 0.5 * mesh.ratio * sweep.twist[cell]
    teeth = first_teeth(mesh, lines.flanks.profiles)
    soft = sum(side.local.inverse_modulus for side in lines.compliance.sides)
    found = []
    for pair in np.unique(points.pair[here]).tolist():
        of_pair = here[points.pair[here] == pair]
        line_load = load_along(points.z[of_pair], points.line_load[of_pair], z)
        angle = np.clip(middle + mesh.turns[0] * z + pair * mesh.sections.mesh_cycle, law.angle[0], law.angle[-1])
        rows = rows_at(law, angle)
        order = np.argsort(angle)
        reached, contacts = pair_contacts(teeth, angle[order])
        curvature = np.interp(angle, reached, contacts.curvature) if len(reached) else np.full(len(z), np.inf)
        with np.errstate(divide="ignore"):
            half = np.sqrt(4.0 * line_load * soft / (math.pi * np.maximum(curvature, 1e-300)))
        half = np.maximum(half, LEAST_HALF_WIDTH * mesh.module)
        found.append(LineContact(pair, line_load, half, rows.arc, rows.tooth_normal))
    return found


def solid_fields(
    lines: ContactLines, sweep: WidthSweep, cells: Sequence[tuple[int, int]]
) -> Iterator[tuple[tuple[int, int], tuple[SolidField, SolidField]]]:
    """Yield the fields of both gears at converged positions.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    sweep : WidthSweep
        Their contact.
    cells : sequence of pair of int
        Numbers of load and angle; those without a solution are left out.
    """
    points, positions = sweep.points, sweep.status.shape[1]
    chosen = [cell for cell in cells if sweep.status[cell] == CONVERGED]
    numbers = [load * positions + position for load, position in chosen]
    cell_of_point = points.load * positions + points.position
    line, of_point = np.unique(np.stack([cell_of_point, points.pair]), axis=1, return_inverse=True)
    wanted = np.flatnonzero(np.isin(line[0], numbers))
    with one_thread():
        gears = [field_gear(lines, gear) for gear in (0, 1)]
        loads = [line_loads(lines, sweep, gear, of_point.ravel(), line.shape[1])[wanted] for gear in (0, 1)]
        sides = [gear.sides(of_gear) for gear, of_gear in zip(gears, loads, strict=True)]
        for cell, number in zip(chosen, numbers, strict=True):
            of_cell = np.flatnonzero(line[0, wanted] == number)
            pairs = line[1, wanted[of_cell]]
            pinion, wheel = (
                _solid_field(
                    gears[g],
                    [of_system[:, :, of_cell] for of_system in sides[g]],
                    loads[g][of_cell],
                    pairs,
                    (float(sweep.angle[cell[1]]), float(sweep.twist[cell])),
                    line_contacts(lines, sweep, cell, gears[g].z),
                )
                for g in (0, 1)
            )
            yield cell, (pinion, wheel)


def _solid_field(
    gear: FieldGear,
    sides: Sequence[Array],
    loads: Array,
    pairs: IntArray,
    place: tuple[float, float],
    contacts: Sequence[LineContact],
) -> SolidField:
    """Fields of one gear; `place`: pinion angle and twist (rad), the others by lines of contact."""
    mesh, whole, count = gear.lines.compliance.mesh, gear.whole, gear.sector.teeth
    pair, z = mesh.sections, gear.z
    teeth = pairs if gear.gear == 0 else -1 - pairs
    fields = gear.displacements(sides, loads, teeth)
    first = float(pair.tooth_angle(gear.gear, 0, place[0], pair.contact_twist + place[1]))
    n, levels = len(whole.points), len(z)
    displacement, stress = np.zeros((levels, n, 3)), np.zeros((levels, n, 6))
    pressure = np.zeros((levels, n))
    by_tooth = {int(tooth) % count: i for i, tooth in enumerate(teeth)}
    contact_of = {one.pair: one for one in contacts}
    elements = np.bincount(whole.triangles.ravel(), minlength=n)
    for tooth, numbers in enumerate(whole.numbers):
        turn = np.exp(1j * (first + gear.sector.pitch * tooth + mesh.turns[gear.gear] * z))
        moved = (fields[0, 0, :, :, tooth] + 1j * fields[0, 1, :, :, tooth]) * turn
        displacement[:, numbers] = np.stack([moved.real, moved.imag, fields[0, 2, :, :, tooth]], axis=-1).swapaxes(0, 1)
        sums = gear.sector_stress(fields[..., tooth])
        if tooth in by_tooth:
            i = by_tooth[tooth]
            contact = contact_of[int(pairs[i])]
            sums += elements[numbers][:, None, None] * _below_contact(gear, contact, loads[i])
            pressure[:, numbers[gear.flank.nodes]] = _nodal_pressure(gear.flank, contact, gear.gear)
        stress[:, numbers] += _turned(sums, turn).swapaxes(0, 1)
    place_z = np.exp(1j * (first + mesh.turns[gear.gear] * z))[:, None]
    at = (whole.points @ np.array([1, 1j])) * place_z + gear.gear * pair.wheel_centre
    points = np.stack([at.real, at.imag, np.broadcast_to(z[:, None], at.shape)], axis=-1)
    return SolidField(z, points, displacement, whole.triangles, stress / elements[:, None], pressure)


def _turned(stress: Array, turn: Array) -> Array:
    """Stresses (s, l, 6) in axes that are turned back by unit complex numbers, shape (l,)."""
    c, s = turn.real, turn.imag
    xx, yy, zz, yz, xz, xy = np.moveaxis(stress, -1, 0)
    plane = turned_stress(np.stack([xx, yy, xy]), c, s)
    return np.stack([plane[0], plane[1], zz, s * xz + c * yz, c * xz - s * yz, plane[2]], axis=-1)


def _below_contact(gear: FieldGear, contact: LineContact, loads: Array) -> Array:
    """What the pressure of a line of contact adds to the stress by the elements' bumps, shape (s, l, 6) (Pa).

    Parameters
    ----------
    gear : FieldGear
        The gear.
    contact : LineContact
        The line.
    loads : ndarray, shape (k, 2, n)
        What the elements carry (N).
    """
    lines, g = gear.lines, gear.gear
    mesh, side = lines.compliance.mesh, lines.compliance.sides[g].local
    nu = mesh.materials[g].poisson_ratio
    on_stations = np.einsum("kin,ln->lki", loads, legendre(gear.z, mesh.zone, mesh.count))
    added = np.zeros((len(gear.sector.points), len(gear.z), 6))
    for level, (load, half) in enumerate(zip(contact.line_load, contact.half_width, strict=True)):
        centre = float(contact.arc[level, g])
        if not gear.flank.ends[0] + half < centre < gear.flank.ends[-1] - half:
            continue
        force = (2 * g - 1) * (on_stations[level] @ contact.normal[level, g])  # the normal is out of the pinion
        if load == 0.0 and not force.any():
            continue
        x, depth, tangent = flank_frame(gear.flank, gear.sector.points, centre)
        apart = x[:, None] - (side.stations - centre)
        stress = ellipse_stress(x, depth, half, load)
        stress = stress - ellipse_stress(apart, depth[:, None], side.bumps, force).sum(axis=-1)
        stress = stress - ellipse_stress(x, depth, lines.compliance.length, load - force.sum())
        stress[2] = -stress[2]  # y out of the material
        xx, yy, xy = turned_stress(stress, tangent.real, tangent.imag)
        added[:, level] = np.stack([xx, yy, nu * (xx + yy), np.zeros_like(xx), np.zeros_like(xx), xy], axis=-1)
    return added


def _nodal_pressure(flank: Flank, contact: LineContact, gear: int) -> Array:
    """Contact pressure at the nodes of a flank, means over their shares of it, shape (l, f) (Pa)."""
    arcs = flank.arc(0.5 * np.arange(len(flank.nodes)))
    shares = 0.5 * np.diff(arcs, prepend=arcs[0]) + 0.5 * np.diff(arcs, append=arcs[-1])
    place = contact.arc[:, gear, None] + contact.half_width[:, None] * ELLIPSE_X
    before = np.clip(np.searchsorted(arcs, place, side="right") - 1, 0, len(arcs) - 2)
    share = np.clip((place - arcs[before]) / (arcs[before + 1] - arcs[before]), 0.0, 1.0)
    force = contact.line_load[:, None] * ELLIPSE_W
    found = np.zeros((len(place), len(arcs)))
    level = np.broadcast_to(np.arange(len(place))[:, None], place.shape)
    np.add.at(found, (level, before), force * (1.0 - share))
    np.add.at(found, (level, before + 1), force * share)
    return found / shares
