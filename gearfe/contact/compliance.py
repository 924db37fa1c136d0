r"""Exact compliance between the flanks of a whole elastic gear with a rigid bore, from one meshed tooth.

One sector is condensed onto its flank nodes F and its two cut sides B. With :math:`A = S_{FF}^{-1}` and
:math:`P = -A S_{FB}`, flank forces f and side displacements b give :math:`u_F = A f + P b`. The sides of neighbouring
sectors coincide, so the side displacements of all sectors follow from a block-circulant system, which a discrete
Fourier transform over the teeth splits into one small system per harmonic (Thomas, Int. J. Numer. Meth. Eng. 14,
1979). The compliance between the loads on tooth i and the flank of tooth j is

.. math:: C_{ji} = \delta_{ij} A + P\,X_{j-i}\,P^T .

Everything is expressed in the frame of the tooth that it belongs to.

A law with theta other than 0 (`gearfe.contact.laws`) loads the gear through the rows B of its flank's normal stress as
well, :math:`K_\theta u = f + B^T z` with :math:`K_\theta = K - \theta B^T W \gamma^{-1} B`, and asks for
:math:`B u`. B acts on the skin, the nodes of the triangles behind the flank: these are then retained too, the term is
taken off the condensed stiffness, and with R = (1_F, B) all four blocks of :math:`R\,C\,R^T` come out as above. By
symmetry :math:`u_F` for stress loads is the transpose of the stress for forces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

from ..elasticity import Material, Plane, element_stiffness
from ..errors import InputError
from ..meshing.tooth_sector import SectorMesh
from .dissection import Condensed, condense
from .flank import Flank, flank_of, normal_stress_rows
from .laws import ContactLaw, side_share

Array = NDArray[Any]


@dataclass(frozen=True)
class FarField:
    """What flank and neighbours do to each other through the cut sides, in r << b numbers (their smooth modes).

    Attributes
    ----------
    flank : ndarray, shape (f, r)
        Flank displacements for the modes of the cut sides.
    stress : ndarray, shape (e q, r), or None
        Normal stress for the same.
    driven : dict of int to ndarray, shape (r, f)
        Step k -> modes of tooth k for flank forces on tooth 0 (1/N), for the few k that can matter.
    """

    flank: Array
    stress: Array | None
    driven: dict[int, Array]


@dataclass(frozen=True)
class StressLoads:
    """What loads through the flank's normal stress cause, for laws with theta other than 0; see the module's docstring.

    Attributes
    ----------
    law, width, share
        The law whose term is in the body's stiffness, the common face width (m), and `laws.side_share` of the gear.
    own : ndarray, shape (e q, e q)
        Normal stress at the quadrature points for stress loads there with the cut sides held (Pa/(N m2)).
    driven : dict of int to ndarray, shape (r, e q)
        As in `FarField`, for stress loads on tooth 0.
    skin : ndarray, shape (s, f + e q)
        Displacements of the skin for flank forces and stress loads with the cut sides held.
    skin_interface : ndarray, shape (s, b)
        The same for displacements of the cut sides (-).
    """

    law: ContactLaw
    width: float
    share: float
    own: Array
    driven: dict[int, Array]
    skin: Array
    skin_interface: Array


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
        P: flank displacements for displacements of the cut sides (-).
    coupling : ndarray, shape (z, b, b)
        X_k: displacements of the cut sides of tooth k for forces on the cut sides of tooth 0 (m/N).
    width
        Width of the contact (m): the mate may be narrower.
    stress_own : ndarray, shape (e q, f), or None
        Normal stress at the quadrature points for flank forces with the cut sides held (Pa/N), per area of contact: the
        body's own times thickness/width, as a pressure on the width of the contact spreads over the thickness.
    stress_interface : ndarray, shape (e q, b), or None
        Normal stress for displacements of the cut sides (Pa/m).
    far : FarField
        The same cyclic part in its numerical rank.
    condensed
        The way back to the full field.
    stress_loads
        Only for a law with theta other than 0 that integrates over this gear.
    """

    mesh: SectorMesh
    flank: Flank
    material: Material
    plane: Plane
    thickness: float
    own: Array
    interface: Array
    coupling: Array
    stress_own: Array | None
    stress_interface: Array | None
    far: FarField
    condensed: Condensed
    width: float
    stress_loads: StressLoads | None = None

    @property
    def teeth(self) -> int:
        """Number of teeth."""
        return self.mesh.teeth

    @property
    def surface_modulus(self) -> float:
        """Young's modulus seen per area of contact (Pa): a gear wider than its contact is stiffer by that ratio."""
        return self.material.youngs_modulus * self.thickness / self.width


def gear_body(
    mesh: SectorMesh,
    material: Material,
    plane: Plane,
    thickness: float,
    *,
    points_per_edge: int = 4,
    with_stress: bool = True,
    law: ContactLaw | None = None,
    gear: int = 0,
    width: float | None = None,
) -> GearBody:
    """Condense a meshed tooth to the compliance of the whole gear.

    Parameters
    ----------
    thickness
        Face width (m).
    points_per_edge
        Quadrature points on each contact edge.
    with_stress
        Whether the normal stress on the contact surface is wanted (Nitsche's law needs it, penalty does not).
    law, gear
        Looked at only for a law with theta other than 0: the law, and whether the gear is pinion (0) or wheel (1).
    width
        Width of the contact (m), the narrower gear's; by default `thickness`.

    Raises
    ------
    InputError
        Where theta = 1 makes the stiffness indefinite: gamma0 is too small.
    """
    flank = flank_of(mesh, points_per_edge)
    width = thickness if width is None else width
    bore = np.unique(mesh.boundaries["bore"])
    sides = np.concatenate([mesh.cut_right[:-1], mesh.cut_left[:-1]])  # the last node of a cut lies on the bore
    coordinates = mesh.points[mesh.triangles]
    share = 0.0 if law is None or law.theta == 0 else side_share(law, gear)
    row_unknowns, rows = np.zeros((0, 12), dtype=np.int64), np.zeros((0, 0, 12))
    if with_stress or share:
        row_unknowns, rows = normal_stress_rows(mesh, material, plane, points_per_edge)
        rows = rows * (thickness / width)
    skin = flank.nodes
    if share:
        behind = np.setdiff1d(row_unknowns[:, ::2] // 2, np.concatenate([flank.nodes, sides, bore]))
        skin = np.concatenate([flank.nodes, behind])
    condensed = condense(
        mesh.triangles,
        element_stiffness(coordinates, material, plane, thickness),
        coordinates[:, :3].mean(axis=1),
        nodes=len(mesh.points),
        retained=np.concatenate([skin, sides]),
        fixed=bore,
    )
    f, s = 2 * len(flank.nodes), 2 * len(skin)
    stiffness, stress = condensed.schur, None
    if share or with_stress:
        every = np.repeat(row_unknowns, rows.shape[1], axis=0)
        stress = condensed.on_retained(rows.reshape(len(every), -1), every)
    if share:
        assert law is not None
        assert stress is not None
        gamma = law.parameter(material.youngs_modulus * thickness / width, flank.sizes)
        term = (law.theta * share * width * flank.weights / gamma[:, None]).ravel()
        stiffness = stiffness - stress.T @ (term[:, None] * stress)
    factor, info = dpotrf(stiffness[:s, :s], lower=1)
    if info != 0:
        if share and law is not None and law.theta > 0:
            assert stress is not None
            raise _not_coercive(law, condensed.schur[:s, :s], stress[:, :s], term)
        raise np.linalg.LinAlgError("the tooth's stiffness is not positive definite: an element is inside out")
    on_skin = -dpotrs(factor, stiffness[:s, s:], lower=1)[0]
    inverse = dpotri(factor, lower=1)[0]
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    coupling = _cyclic_compliance(stiffness[s:, s:] + stiffness[s:, :s] @ on_skin, mesh.teeth)
    own, interface = inverse[:f, :f], on_skin[:f]
    stress_own = stress_interface = loads = None
    if stress is not None:
        stress_own = stress[:, :s] @ inverse[:, :f]
        stress_interface = stress[:, :s] @ on_skin + stress[:, s:]
    far, basis = _far_field(interface, stress_interface, coupling)
    if share and stress is not None and law is not None and far.stress is not None:
        moved = inverse @ stress[:, :s].T
        driven = _driven(basis, coupling, far.stress)
        columns = np.concatenate([inverse[:, :f], moved], axis=1)
        loads = StressLoads(law, width, share, stress[:, :s] @ moved, driven, columns, on_skin)
        own = own.copy()
    return GearBody(
        mesh,
        flank,
        material,
        plane,
        thickness,
        own,
        interface,
        coupling,
        stress_own,
        stress_interface,
        far,
        condensed,
        width,
        loads,
    )


def _not_coercive(law: ContactLaw, stiffness: Array, stress: Array, term: Array) -> InputError:
    """By what factor gamma0 is too small: the largest eigenvalue of W^1/2 gamma^-1/2 B K^-1 B^T gamma^-1/2 W^1/2."""
    scaled = np.sqrt(term)[:, None] * stress
    bound = float(np.linalg.eigvalsh(scaled @ np.linalg.solve(stiffness, scaled.T))[-1])
    gamma0 = float(getattr(law, "gamma0", 1.0))
    problem = f"with theta = 1 it must be > {bound * gamma0:.3g} on this mesh, or the bodies lose their stiffness"
    return InputError(
        "gamma0",
        gamma0,
        problem,
        "raise it (nitsche_gamma0 in a job file), or take theta = -1 or 0, which have no such bound",
    )


#: Neighbours whose coupling is kept at hand: teeth in contact at the same time are never further apart.
REACH = 12


def _far_field(interface: Array, stress: Array | None, coupling: Array) -> tuple[FarField, Array]:
    """Compress displacements and stresses onto the side motions that reach the flank (Saint-Venant: a dozen or two).

    Returns the far field and its modes, shape (b, r).
    """
    rows = interface if stress is None else np.concatenate([interface, stress * (_norm(interface) / _norm(stress))])
    triangular = np.linalg.qr(rows, mode="r")
    _, values, modes = np.linalg.svd(triangular, full_matrices=False)
    basis = modes[values > 1e-13 * values[0]].T
    flank = interface @ basis
    driven = _driven(basis, coupling, flank)
    return FarField(flank, None if stress is None else stress @ basis, driven), basis


def _driven(basis: Array, coupling: Array, rows: Array) -> dict[int, Array]:
    """Step k -> modes of tooth k for loads on tooth 0 that push its sides by the transpose of `rows`."""
    teeth = len(coupling)
    return {k: (basis.T @ coupling[k % teeth] @ basis) @ rows.T for k in range(-REACH, REACH + 1)}


def _norm(matrix: Array) -> float:
    return float(np.linalg.norm(matrix))


def _cyclic_compliance(stiffness: Array, teeth: int) -> Array:
    """X_k for k = 0 .. z - 1 from the side stiffness of one sector (right side first, then left).

    With v_j the displacement of the right side of sector j in frame j, the sides of sector j move by
    (v_j, R v_{j+1}), R the rotation by the pitch angle. A harmonic n has v_j = v exp(i n j 2 pi / z).
    """
    half = len(stiffness) // 2
    angle = 2 * np.pi / teeth
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    rotation = np.kron(np.eye(half // 2), turn)
    harmonics = np.arange(teeth // 2 + 1)
    phase = np.exp(1j * angle * harmonics)
    tie = np.concatenate([np.broadcast_to(np.eye(half), (len(phase), half, half)), phase[:, None, None] * rotation], 1)
    adjoint = tie.conj().transpose(0, 2, 1)
    per_harmonic = tie @ np.linalg.solve(adjoint @ (stiffness @ tie), adjoint)
    return np.fft.irfft(per_harmonic, n=teeth, axis=0)
