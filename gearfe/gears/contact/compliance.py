r"""Exact compliance between the flanks of a whole elastic gear with a rigid bore or rim, from one meshed tooth.

One sector is condensed onto its flank nodes F and its two cut sides B. With :math:`A = S_{FF}^{-1}` and
:math:`P = -A S_{FB}`, flank forces f and side displacements b give :math:`u_F = A f + P b`. The sides of neighbouring
sectors coincide, so the side displacements of all sectors follow from a block-circulant system. A discrete Fourier
transform over the teeth splits it into one small system per harmonic (Thomas, Int. J. Numer. Meth. Eng. 14, 1979). The
compliance between the loads on tooth i and the flank of tooth j is

.. math:: C_{ji} = \delta_{ij} A + P\,X_{j-i}\,P^T .

Everything is expressed in the frame of the tooth that it belongs to.

**Free rims.** The nodes of a free rim belong to B, too. Nothing holds them; the mean displacement and the mean turn of
the rim are zero, as even tractions on it keep them. These three conditions are of the harmonics 0 (the turn) and
:math:`\pm1` (the displacement) alone, where they border the small system.

**In mesh.** The pinion's centre is the origin, the wheel's centre lies at (a, 0), a < 0 for an internal gear. At pinion
angle 0 the pinion tooth 0 is centred on the line of centres and a wheel space faces it; angles are counter-clockwise.
Pair k joins the left flanks of the pinion tooth k and of the wheel tooth -1 - k (tooth 0 of the wheel is the one below
the line of centres then). Places are global; displacements and forces refer to the axes of the tooth they belong to, in
which compliances are the same at every position.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

from ...base.cache import cached_arrays, source_hash
from ...base.errors import InputError
from ...base.typing import Array, ComplexArray, IntArray
from ...fem.multifrontal import Factor, condense
from ...fem.plane import Material, Plane, element_stiffness, finite_strain_rates
from ..geometry.face import ToothDeviations
from ..geometry.first_contact import WAY
from ..geometry.pair import GearPair
from ..geometry.spur_gear import Gear
from ..teeth.tooth_sector import SectorMesh
from .flank import Flank, edge_shapes, flank_of, gauss_rule, normal_stress_rows
from .laws import DEFAULT_MODEL, ContactLaw, PairModel
from .position import Contacts, FlankLoads, PointPressures, Positions

#: Sectors on either side of a loaded tooth whose finite strain counts: the effect is cubic in the strain. Six instead
#: of one change the torque of the shipped pair by 2.4e-4 at 0.5 deg, and by less than 5e-5 at 0.05 deg.
NEIGHBOURS = 1
#: Positions whose fields are in memory together for it.
TOGETHER = 24
#: Contact points on each element edge of a flank.
POINTS_PER_EDGE = 4


@dataclass(frozen=True)
class GearBody:
    """An elastic gear as its mate sees it: flank geometry, compliance and, where a law asks for it, surface stress.

    Attributes
    ----------
    mesh
        Mesh of one tooth sector.
    flank
        Contact surface of one tooth.
    own : ndarray, shape (f, f)
        A: flank displacements for flank forces with the cut sides held (m/N).
    interface : ndarray, shape (f, b)
        P: flank displacements for displacements of the cut sides, and of a free rim (-).
    coupling : ndarray, shape (z, b, b)
        X_k: displacements of these of tooth k for forces on those of tooth 0 (m/N).
    width
        Width of the contact (m): the mate may be narrower.
    stress_own, stress_interface : ndarray, shapes (e q, f), (e q, b)
        Normal stress at the quadrature points for the same two (Pa/N, Pa/m), per area of contact. It is the body's own
        times thickness/width, as a pressure on the width of the contact spreads over the thickness. No rows where no
        law asks for it.
    condensed
        The way back to the full field.
    """

    mesh: SectorMesh
    flank: Flank
    material: Material
    plane: Plane
    thickness: float
    own: Array
    interface: Array
    coupling: Array
    stress_own: Array
    stress_interface: Array
    condensed: Factor
    width: float

    @property
    def teeth(self) -> int:
        """Number of teeth."""
        return self.mesh.teeth

    def driven(self, step: int) -> Array:
        """X_k P^T: displacements of the cut sides of the tooth `step` on, for flank forces, shape (b, f) (m/N)."""
        k = step % self.teeth
        if k not in self._driven:
            self._driven[k] = self.coupling[k] @ self.interface.T
        return self._driven[k]

    @cached_property
    def _driven(self) -> dict[int, Array]:
        return {}

    @cached_property
    def compliances(self) -> dict[Gear, Any]:
        """What `gears.contact.flank_compliance` made of it for the exact flank of a gear: it is kept with the body."""
        return {}

    @property
    def surface_modulus(self) -> float:
        """Young's modulus seen per area of contact (Pa): a gear wider than its contact is stiffer by that ratio."""
        return self.material.youngs_modulus * self.thickness / self.width

    @property
    def contact_compliance(self) -> float:
        """1/E' (1/Pa) per width of the contact: a body wider than that counts with the ratio."""
        return self.material.contact_compliance(self.plane) * self.width / self.thickness


def gear_body(
    mesh: SectorMesh,
    material: Material,
    plane: Plane,
    thickness: float,
    *,
    points_per_edge: int = POINTS_PER_EDGE,
    with_stress: bool = True,
    width: float | None = None,
) -> GearBody:
    """Condense a meshed tooth to the compliance of the whole gear.

    Parameters
    ----------
    mesh : SectorMesh
        Mesh of one tooth sector.
    material : Material
        Elasticity of the gear.
    plane : str
        ``stress`` or ``strain``.
    thickness : float
        Face width (m).
    points_per_edge : int
        Quadrature points on each contact edge.
    with_stress : bool
        Whether the normal stress on the contact surface is wanted (Nitsche's law needs it).
    width : float, optional
        Width of the contact (m), the narrower gear's; by default `thickness`.

    Raises
    ------
    numpy.linalg.LinAlgError
        If an element of the mesh is inside out.
    """
    flank = flank_of(mesh, points_per_edge)
    width = thickness if width is None else width
    held, last = np.unique(mesh.held), None if mesh.free else -1  # the last node of a cut lies on the bore
    sides = np.concatenate([mesh.cut_right[:last], mesh.cut_left[:last]])
    around = np.setdiff1d(held, sides) if mesh.free else held[:0]
    coordinates = mesh.points[mesh.triangles]
    condensed = condense(
        mesh.triangles,
        element_stiffness(coordinates, material, plane, thickness),
        coordinates[:, :3].mean(axis=1),
        nodes=len(mesh.points),
        retained=np.concatenate([flank.nodes, sides, around]),
        fixed=held[:0] if mesh.free else held,
    )
    f, stiffness = 2 * len(flank.nodes), condensed.schur
    factor, info = dpotrf(stiffness[:f, :f], lower=1)
    if info != 0:
        raise np.linalg.LinAlgError("the tooth's stiffness is not positive definite: an element is inside out")
    interface = -dpotrs(factor, stiffness[:f, f:], lower=1)[0]
    own = dpotri(factor, lower=1)[0]
    own = np.tril(own) + np.tril(own, -1).T
    means = _rim_means(mesh, np.concatenate([sides, around])) if mesh.free else None
    between = stiffness[f:, f:] + stiffness[f:, :f] @ interface
    coupling = _cyclic_compliance(between, mesh, len(sides), means)
    stress_own, stress_interface = np.zeros((0, f)), np.zeros((0, len(stiffness) - f))
    if with_stress:
        unknowns, rows = normal_stress_rows(mesh, material, plane, points_per_edge)
        every = np.repeat(unknowns, rows.shape[1], axis=0)
        stress = condensed.on_retained((thickness / width * rows).reshape(len(every), -1), every)
        stress_own = stress[:, :f] @ own
        stress_interface = stress[:, :f] @ interface + stress[:, f:]
    stressed = stress_own, stress_interface
    return GearBody(mesh, flank, material, plane, thickness, own, interface, coupling, *stressed, condensed, width)


#: Arrays of a gear body that are stored beside the factor's.
_STORED = ("own", "interface", "coupling", "stress_own", "stress_interface")
#: Modules whose text decides the arrays of a gear body.
_MODULES = ("fem/multifrontal", "fem/plane", "gears/contact/compliance", "gears/contact/flank")


def stored_gear_body(mesh: SectorMesh, material: Material, plane: Plane, thickness: float, **options: Any) -> GearBody:
    """Return `gear_body`, from the cache if the same gear was condensed before.

    An entry has some 20 MB and saves some 0.2 s: for jobs that a user repeats, not for the cases of a study.

    Parameters
    ----------
    mesh, material, plane, thickness, options
        See `gear_body`.
    """
    recipe = {"mesh": mesh, "material": material, "plane": plane, "thickness": thickness}

    def make() -> dict[str, Any]:
        body = gear_body(mesh, material, plane, thickness, **options)
        return {name: getattr(body, name) for name in _STORED} | body.condensed.arrays()

    arrays = cached_arrays("condensed-gear", {**recipe, "options": options, "source": source_hash(*_MODULES)}, make)
    flank, width = flank_of(mesh, options.get("points_per_edge", POINTS_PER_EDGE)), options.get("width")
    return GearBody(
        mesh,
        flank,
        material,
        plane,
        thickness,
        condensed=Factor.of_arrays(arrays),
        width=thickness if width is None else width,
        **{name: arrays[name] for name in _STORED},
    )


def _rim_means(mesh: SectorMesh, nodes: IntArray) -> Array:
    """Integrals along a sector's rim of the displacements x and y, and of the moment of the displacement about the
    centre, for displacements of `nodes`, shape (3, 2 n)."""
    xi, weight = gauss_rule(4)
    shapes, slopes, _ = edge_shapes(xi)
    rows, number = np.zeros((3, len(nodes), 2)), {int(node): k for k, node in enumerate(nodes)}
    for edge in mesh.held:
        corners = mesh.points[edge]
        lengths = np.linalg.norm(slopes @ corners, axis=1) * weight
        places = shapes @ corners
        for a, node in enumerate(edge.tolist()):
            share = shapes[:, a] * lengths
            rows[0, number[node], 0] += share.sum()
            rows[1, number[node], 1] += share.sum()
            rows[2, number[node]] += share @ np.stack([-places[:, 1], places[:, 0]], axis=1)
    return rows.reshape(3, -1)


def _cyclic_compliance(stiffness: Array, mesh: SectorMesh, sides: int, means: Array | None = None) -> Array:
    """X_k for k = 0 .. z - 1 from the stiffness of one sector against displacements of its interface.

    With v_j the displacement of the right side of sector j in frame j, the sides of sector j move by
    (v_j, R v_{j+1}), R the rotation by the pitch angle. A harmonic n has v_j = v exp(i n j 2 pi / z), so that the
    stiffness against it is A + B exp(i n 2 pi / z) + its adjoint, and the factor shifts answers by a tooth.

    Parameters
    ----------
    stiffness : ndarray, shape (b, b)
        Of the unknowns of the right side, of the left one, then of the nodes of a free rim between them (N/m).
    mesh : SectorMesh
        The sector.
    sides : int
        Number of nodes on both sides.
    means : ndarray, shape (3, b), optional
        Integrals of the displacements x and y of a free rim and of their moments, which are zero round the gear.
    """
    half, teeth = sides, mesh.teeth
    rotation = np.kron(np.eye(half // 2), turn(mesh.pitch))
    phase = np.exp(1j * (2 * np.pi / teeth) * np.arange(teeth // 2 + 1))[:, None, None]
    left = slice(half, 2 * half)
    to_next = stiffness[:half, left] @ rotation
    own = stiffness[:half, :half] + rotation.T @ stiffness[left, left] @ rotation
    if means is None:
        system = own + phase * to_next + phase.conj() * to_next.T
        right = np.fft.irfft(np.linalg.inv(system), n=teeth, axis=0)
        ahead = rotation @ right
        return np.block(
            [[right, np.roll(right, 1, axis=0) @ rotation.T], [np.roll(ahead, -1, axis=0), ahead @ rotation.T]]
        )
    rim = slice(2 * half, None)
    count = len(stiffness) - half
    system = np.zeros((len(phase), count, count), dtype=complex)
    system[:, :half, :half] = own + phase * to_next + phase.conj() * to_next.T
    system[:, :half, half:] = stiffness[:half, rim] + phase.conj() * (rotation.T @ stiffness[left, rim])
    system[:, half:, :half] = system[:, :half, half:].conj().swapaxes(1, 2)
    system[:, half:, half:] = stiffness[rim, rim]
    whole = np.empty_like(system)
    rows = np.concatenate([means[:, :half] + phase * (means[:, left] @ rotation), _each(means[:, rim], phase)], axis=2)
    # exp(i j pitch)(x + i y) of sector j adds up to nothing round the gear unless the harmonic turns against the pitch
    way = 1j if mesh.internal else -1j
    whole[2:] = np.linalg.inv(system[2:])
    for n in (0, 1):
        held = rows[n][2:] if n == 0 else (rows[n][0] + way * rows[n][1])[None]
        scale = np.abs(system[n]).max() / np.abs(held).max()
        border = np.block([[system[n], scale * held.conj().T], [scale * held, np.zeros((1, 1))]])
        whole[n] = np.linalg.inv(border)[:count, :count]
    found = np.fft.irfft(whole, n=teeth, axis=0)
    before, after = np.roll(found, 1, axis=0), np.roll(found, -1, axis=0)
    v, w = slice(half), slice(half, None)
    return np.block(
        [
            [found[:, v, v], before[:, v, v] @ rotation.T, found[:, v, w]],
            [rotation @ after[:, v, v], rotation @ found[:, v, v] @ rotation.T, rotation @ after[:, v, w]],
            [found[:, w, v], before[:, w, v] @ rotation.T, found[:, w, w]],
        ]
    )


def _each(rows: Array, phase: ComplexArray) -> ComplexArray:
    """The same rows for each of the harmonics."""
    return np.broadcast_to(rows.astype(complex), (len(phase), *rows.shape))


@dataclass(frozen=True)
class MeshingPair:
    """Two elastic gears in mesh.

    Parameters
    ----------
    gears
        Their geometry.
    pinion, wheel
        Elastic gears, for contacts of one width.
    model
        What they were made with.
    """

    gears: GearPair
    pinion: GearBody
    wheel: GearBody
    model: PairModel = DEFAULT_MODEL

    def __post_init__(self) -> None:
        widths = [body.width for body in self.bodies]
        if widths[0] != widths[1]:
            problem = f"the gears are made for contacts {widths} m wide"
            raise InputError("width", widths[1], problem, "make both with the same: gear_body(..., width=...)")

    @property
    def width(self) -> float:
        """Width of the contact (m)."""
        return self.pinion.width

    @property
    def wheel_centre(self) -> float:
        """x of the wheel's centre (m)."""
        return self.gears.wheel_centre

    @property
    def law(self) -> ContactLaw:
        """Contact law."""
        return self.model.law

    @property
    def deviations(self) -> tuple[ToothDeviations, ToothDeviations]:
        """Deviations of the driving flanks of pinion and wheel."""
        return self.model.deviations

    def deviated(self, deviations: tuple[ToothDeviations, ToothDeviations]) -> MeshingPair:
        """The same elastic gears with other deviations of micrometres, which cost nothing."""
        return replace(self, model=self.model.changed(deviations=deviations))

    @property
    def bodies(self) -> tuple[GearBody, GearBody]:
        """Pinion and wheel."""
        return self.pinion, self.wheel

    def tooth_angle(self, gear: int, tooth: Any, pinion_angle: Any, twist: Any) -> Any:
        """Return the angle (rad) of the frame of a tooth, see `MeshGeometry.tooth_angle`.

        Parameters
        ----------
        gear : int
            0 for the pinion, 1 for the wheel.
        tooth : int or ndarray
            Number of the tooth.
        pinion_angle : float or ndarray
            Pinion angle (rad).
        twist : float or ndarray
            Twist of the wheel from the centred position (rad).
        """
        return self.gears.tooth_angle(gear, tooth, pinion_angle, twist)


def turn(angle: float) -> Array:
    """Rotation matrix of `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def sector_displacements(
    body: GearBody, loads: FlankLoads, position: IntArray, tooth: IntArray, *, rates: bool = False
) -> Array:
    """Return the nodal displacements of c tooth sectors in the axes of their teeth.

    Parameters
    ----------
    body : GearBody
        The condensed gear.
    loads : FlankLoads
        Loads on its flanks.
    position, tooth : ndarray, shape (c,)
        Number of the position, and of the tooth.
    rates : bool
        Whether their derivatives with respect to the twist (m/rad) follow, another c.

    Returns
    -------
    displacements : ndarray, shape (nodes, 2, c or 2 c)
        In m; rates in m/rad.
    """
    of, load, step = loads.felt(position, tooth, body.teeth)
    parts = []
    for force in (loads.force, loads.rate) if rates else (loads.force,):
        on_sides = force @ body.interface
        sides, flank = np.zeros((len(position), body.interface.shape[1])), np.zeros((len(position), force.shape[1]))
        for k in np.unique(step):
            here = step == k
            np.add.at(sides, of[here], on_sides[load[here]] @ body.coupling[k].T)
            if k == 0:
                np.add.at(flank, of[here], force[load[here]] @ body.own)
        parts.append(np.concatenate([flank + sides @ body.interface.T, sides], axis=1))
    return body.condensed.recover(np.concatenate(parts).T).reshape(-1, 2, sum(len(part) for part in parts))


def finite_strain_shares(pair: MeshingPair, found: Positions, neighbours: int = NEIGHBOURS) -> Array:
    """First-order effect of finite strain on the torque: Delta T / T, shape (n,), from loads; 0 where there are none.

    The equilibrium minimises the energy. So, by the envelope theorem, the energy at given twist changes by what finite
    strain adds to that of the small-strain solution. The torque changes by the derivative of this with the twist
    (`gearfe.fem.plane.finite_strain_rates`). So many `neighbours` of a loaded tooth on either side take part.
    """
    shares = np.zeros(len(found))
    loaded = np.unique(found.loads[0].position)
    for first in range(0, len(loaded), TOGETHER):
        mine = loaded[first : first + TOGETHER]
        part = found.take(mine)
        shares[mine] = sum(_extra_torques(pair, gear, part, neighbours) for gear in (0, 1)) / part.torque_wheel
    return shares


def _extra_torques(pair: MeshingPair, gear: int, found: Positions, neighbours: int) -> Array:
    """Delta T from one gear (N m), shape (n,)."""
    body, loads = pair.bodies[gear], found.loads[gear]
    near = (loads.tooth[:, None] + np.arange(-neighbours, neighbours + 1)) % body.teeth
    sectors = np.unique(loads.position[:, None] * body.teeth + near)
    position, tooth = np.divmod(sectors, body.teeth)
    fields, mesh = sector_displacements(body, loads, position, tooth, rates=True), body.mesh
    energy = finite_strain_rates(mesh.points, mesh.triangles, fields, body.material, body.plane, body.thickness)
    return np.bincount(position, energy, len(found))


def flank_loads(
    elastic: MeshingPair, contacts: Contacts, angles: Array, twists: Array
) -> tuple[FlankLoads, FlankLoads]:
    """Return the loads on the flanks of pinion and wheel: for fields, root stress and finite strain.

    They are the consistent ones of the pressures on the panels, at their places on the deformed flanks and along the
    common normal. Displacements recovered from them are those of the teeth. Nearer to a contact than one or two
    elements they depend on the coarse mesh of the flank. Stresses there: `gearfe.gears.gearmesh.fields`.

    Parameters
    ----------
    elastic : MeshingPair
        The condensed gears.
    contacts : Contacts
        m loaded pairs.
    angles, twists : ndarray, shape (n,)
        Pinion angles and twists from the centred position (rad) of the positions that they are of.
    """
    place = angles[contacts.position], twists[contacts.position]
    made = []
    for g, tooth in enumerate((contacts.pair, -1 - contacts.pair)):
        shares, moved = _nodal(elastic.bodies[g].flank, contacts, g)
        along = (2 * g - 1) * contacts.normal * np.exp(-1j * elastic.tooth_angle(g, tooth, *place))
        # the wheel's axes turn on with the twist
        turning = g * elastic.gears.sign
        rate = contacts.force_rate + 1j * (contacts.normal_rate - turning) * contacts.force
        force = (contacts.force * along)[:, None] * shares
        change = along[:, None] * (rate[:, None] * shares + contacts.force[:, None] * moved)
        made.append(FlankLoads(contacts.position, tooth, force.view(float), change.view(float)))
    return made[0], made[1]


def panel_pressures(elastic: MeshingPair, contacts: Contacts) -> PointPressures:
    """Pressures on the panels of loaded pairs, at their places on both flanks."""
    places = [np.add(*body.flank.place(contacts.panel_arc[:, g])) for g, body in enumerate(elastic.bodies)]
    place, panels = np.stack(places, axis=1), contacts.pressure.shape[1]  # (m, 2, n)
    position, pair = (np.repeat(one, 2 * panels) for one in (contacts.position, contacts.pair))
    gear = np.tile(np.repeat([0, 1], panels), len(contacts))
    return PointPressures(position, gear, pair, place.ravel(), np.repeat(contacts.pressure, 2, axis=0).ravel())


def _nodal(flank: Flank, contacts: Contacts, gear: int) -> tuple[Array, Array]:
    """Return for each pair the shares of the force on the nodes of the flank, which add up to 1, and their rates with
    the twist (1/rad). Both have the shape (m, nodes). The rates come from the pressure, which moves along the flank and
    widens.
    """
    load = contacts.pressure * contacts.width
    edge, xi = flank.place(contacts.panel_arc[:, gear])
    value, slope, _ = edge_shapes(xi)
    share = load / load.sum(axis=1, keepdims=True)
    moves = contacts.arc_rate[:, gear, None] + WAY[gear] * contacts.x * contacts.growth[:, None]
    shape = len(load), len(flank.nodes)
    at = (np.arange(shape[0])[:, None] * shape[1] + 2 * edge)[:, :, None] + np.arange(3)
    weights = value * share[:, :, None], slope * (moves / flank.sizes[edge] * share)[:, :, None]
    shares, moved = (np.bincount(at.ravel(), w.ravel(), shape[0] * shape[1]).reshape(shape) for w in weights)
    return shares, moved
