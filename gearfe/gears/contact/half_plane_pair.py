r"""A gear pair as the half-plane law sees it: its flanks, what loads on them do, and tables of both.

**Neighbours.** Two contacts i and j on the same two teeth have, besides the far-field influence H
(`.flank_compliance`), the half-plane and the wedge between them. A load :math:`f_j n_j` at the arc t moves the face
at s by

.. math:: u(s) = -\tfrac1{E'}\Big(\tfrac2\pi\ln|s-t|\,n_j + W n_j\ln(y(s)+y(t))\Big) f_j .

Its part along :math:`n_i` acts between the panels of both. It is integrated exactly over each panel, so that two
windows may lie side by side. Its part across moves the face as a whole.

Arrays are over the q couples of `.panels.Couplings.beside`, a contact with itself among them, then over pinion and
wheel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.typing import Array, ComplexArray, IntArray
from ..geometry.face import NOMINAL, FlankTables, ToothDeviations, flank_tables
from ..geometry.first_contact import FirstContacts, ToothFlanks
from ..geometry.mesh_geometry import MeshGeometry
from .compliance import MeshingPair
from .flank_compliance import FlankCompliance, Shapes, corner_of, flank_compliance, shapes_of
from .panels import Couplings, log_integral
from .position import BATCH, joined, of_positions

#: Places at which both faces of a contact are compared where they have no deviations, and besides for each piece of a
#: deviation.
PLACES, PER_PIECE = 32, 2
#: Pinion angles of a mesh cycle at which flanks with deviations are looked at for their first contact.
LOOKS = 24
#: Distance (m) from a kink at which its sides' tangents are taken.
BESIDE = 1e-9


@dataclass(frozen=True)
class HalfPlanePair:
    """A gear pair as the half-plane law sees it.

    Attributes
    ----------
    pair
        Geometry.
    teeth
        Working flanks of all teeth, where their first contact is searched for.
    sides
        Compliance of pinion's and wheel's flank, without deviations.
    width
        Width of the contact (m).
    """

    pair: MeshGeometry
    teeth: ToothFlanks
    sides: tuple[FlankCompliance, FlankCompliance]
    width: float

    @property
    def mesh_cycles(self) -> int:
        """Mesh cycles after which the same teeth meet again: 1 where all teeth of each gear are alike."""
        alike = all(one.alike for one in self.teeth.deviations)
        return 1 if alike else math.lcm(self.pair.pinion.teeth, self.pair.wheel.teeth)

    def first_contacts(self, angles: Array) -> FirstContacts:
        """First contacts of the tooth pairs at pinion angles (rad), by position; searched for once per angle."""
        known = self._known_contacts
        new = np.setdiff1d(angles, np.concatenate([np.zeros(0), *(at for at, _ in known)]))
        for start in range(0, len(new) if known else max(1, len(new)), BATCH):
            part = new[start : start + BATCH]
            found, before = self.teeth.first_contacts(part), sum(len(at) for at, _ in known)
            known.append((part, replace(found, position=found.position + before)))
        every = np.concatenate([at for at, _ in known])
        known[:] = [(every, joined([met for _, met in known]))]
        order = np.argsort(every)
        return of_positions(known[0][1], order[np.searchsorted(every, angles, sorter=order)])

    @cached_property
    def _known_contacts(self) -> list[tuple[Array, FirstContacts]]:
        return []

    def first_contact_twists(self, angles: Array) -> Array:
        """Twists (rad) at which the rigid gears just touch, infinite where they never do, shape (n,)."""
        found = self.first_contacts(angles)
        made = np.full(len(angles), np.inf)
        np.minimum.at(made, found.position, found.twist)
        return made

    def first_contact_twist(self, angles: Array) -> float:
        """Twist (rad) that stiffness counts from: where unmodified flanks touch, or before, what stands out of them.

        The first contact of the mesh cycle, these pinion angles (rad) among it.
        """
        free = self.pair.contact_twist
        if self.teeth.deviations == NOMINAL:
            return free
        every = np.concatenate([angles, self.pair.mesh_cycle * np.arange(LOOKS) / LOOKS])
        return float(min(free, self.first_contact_twists(every).min()))

    @cached_property
    def tables(self) -> FlankTables:
        """The exact flanks, f of them, in one table: the faces of `teeth`."""
        return flank_tables(self.teeth.faces)

    def arc_at(self, flank: IntArray, parameter: Array) -> Array:
        """Arc lengths (m) of parameters u on the flanks `flank`, both of shape (p, 2)."""
        made = np.empty(np.shape(parameter))
        for i in np.unique(flank):
            made[flank == i] = self.teeth.faces[i].arc_at(parameter[flank == i])
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
        return np.array([0.0, self.pair.wheel_centre])

    @cached_property
    def turning(self) -> Array:
        """Angles by which a unit of twist turns pinion and wheel (-), shape (2,)."""
        return np.array([0, self.pair.sign])

    @cached_property
    def corner(self) -> ComplexArray:
        """Corners of flanks and tip circles (m), shape (f,)."""
        return np.array([corner_of(face)[0] for face in self.teeth.faces])

    @cached_property
    def _wedge(self) -> tuple[Array, ComplexArray]:
        W = np.array([side.wedge for side in self.sides])
        return 0.5 * (W[:, 0, 0] + W[:, 1, 1]), 0.5 * (W[:, 0, 0] - W[:, 1, 1]) + 1j * W[:, 0, 1]

    def wedge(self, load: ComplexArray) -> ComplexArray:
        """W of both gears times vectors, shape (..., 2)."""
        mean, deviator = self._wedge
        return np.asarray(mean * load + deviator * load.conj())

    @cached_property
    def undercut(self) -> Array:
        """1 where the working flank starts with the edge of an undercut, shape (2,)."""
        return np.array([float(side.face.undercut) for side in self.sides])

    @cached_property
    def marks(self) -> tuple[NDArray[np.str_], IntArray, Array]:
        """Marks of the flanks beside which a pressure is not elliptic, by rising rank: names, flanks, and first and
        last arc lengths (m), shape (2, k).

        ``undercut`` (its edge), ``relief`` (kink of a linear relief), ``round`` (from the start of a tip round on),
        ``tip`` (a sharp end).
        """
        found = []
        for name in ("undercut", "relief", "round", "tip"):
            for flank, face in enumerate(self.teeth.faces):
                places = {
                    "undercut": [0.0] if face.undercut else [],
                    "relief": face.kinks.tolist(),
                    "round": [] if face.sharp else [1.0],
                    "tip": [face.end] if face.sharp else [],
                }[name]
                found += [(name, flank, at, face.end if name == "round" else at) for at in places]
        names, flanks, *ends = zip(*found, strict=True)
        numbers = np.array(flanks)
        return np.array(names, dtype="<U8"), numbers, np.stack([self.arc_at(numbers, np.array(end)) for end in ends])

    @cached_property
    def kinks(self) -> tuple[Array, Array]:
        """Arc lengths (m) of the kinks of each flank, the edge of an undercut among them, and by how much its normal
        turns away there (rad). Both have the shape (f, k); a kink at infinity stands for none.
        """
        places = [face.arc_at([*([0.0] if face.undercut else []), *face.kinks]) for face in self.teeth.faces]
        arcs, angles = np.zeros((2, len(places), max(map(len, places))))
        arcs[:] = np.inf
        for i, (face, at) in enumerate(zip(self.teeth.faces, places, strict=True)):
            before, after = (face.at(at + side)[1] for side in (-BESIDE, BESIDE))
            arcs[i, : len(at)], angles[i, : len(at)] = at, np.angle(before / after)
        return arcs, angles

    @cached_property
    def looked_at(self) -> Array:
        """Places at which both faces of a contact are compared, in parts of the length that they share."""
        deviations = [face.flank.deviation for face in self.teeth.faces]
        pieces = max((len(one.pieces) for one in deviations if one is not None), default=0)
        return np.linspace(0.0, 1.0, PLACES + PER_PIECE * pieces)

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
                    far_field = side.far_field[step if gear == 0 else -step]
                    made[gear, :n, :, step + steps, :n] = self.width * far_field.T.reshape(n, 2, n, 2)
            self._influences[steps] = made.reshape(2, 2 * k, -1)
        return self._influences[steps]

    @cached_property
    def _influences(self) -> dict[int, Array]:
        return {}

    def deviated(self, deviations: tuple[ToothDeviations, ToothDeviations]) -> HalfPlanePair:
        """The same elastic gears with other deviations of micrometres, which are in the flanks' curves alone."""
        return HalfPlanePair(self.pair, ToothFlanks(self.pair, deviations), self.sides, self.width)


def half_plane_pair(elastic: MeshingPair) -> HalfPlanePair:
    """Prepare the law for meshed and condensed gears; their flanks may be coarse (a tenth of a module)."""
    pair = elastic.gears
    pinion, wheel = flank_compliance(pair.pinion, elastic.pinion), flank_compliance(pair.wheel, elastic.wheel)
    return HalfPlanePair(pair, ToothFlanks(pair, elastic.deviations), (pinion, wheel), elastic.width)


def local_influence(
    contact_model: HalfPlanePair, couples: Couplings, normal: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return what a unit force per width along the normal of the second contact does to the face at the first. That is
    by the half-plane, per ln of their distance, and by the wedge, per ln(y + y), both of shape (q, 2) (m2/N).

    Displacements in units of the first contact's normal, real along it and imaginary across.

    Parameters
    ----------
    normal : ndarray of complex, shape (p, 2)
        n in the teeth's axes.
    """
    seen, load = -contact_model.inverse_modulus * normal[couples.first].conj(), normal[couples.second]
    return 2 / np.pi * seen * load, seen * contact_model.wedge(load)


def panel_influence(
    influence: tuple[ComplexArray, ComplexArray],
    couples: Couplings,
    places: tuple[Array, Array],
    panels: tuple[Array, Array, Array],
) -> Array:
    """Return the displacement of each face into its material at places on the first contact of each couple.

    It is that by pressures on panels of the second contact, without that of the half-plane by the contact itself.

    Parameters
    ----------
    influence : pair of ndarray of complex, shape (q, 2)
        `local_influence`.
    couples : Couplings
        Couples (i, j) of contacts.
    places : pair of ndarray, shape (p, 2, m)
        Arcs of the places and their distances from the corners (m).
    panels : (ndarray, ndarray, ndarray), shapes (p, 2, n), (p, 2, n), (p, n)
        The same of the panels' middles, and the panels' widths (m).

    Returns
    -------
    displacement : ndarray, shape (q, 2, m, n)
        Per pressure (m/Pa).
    """
    i, j = couples.first, couples.second
    (arcs, y), (panel_arcs, panel_y, widths) = places, panels
    plane, wedge = (one.real[..., None, None] for one in influence)
    made: Array = y[i][..., None] + panel_y[j][:, :, None]
    np.log(made, out=made)
    made *= wedge * widths[j][:, None, None]
    other = np.flatnonzero(i != j)
    if len(other):
        i, j = i[other], j[other]
        half = 0.5 * widths[j][:, None, None]
        apart = arcs[i][..., None] - panel_arcs[j][:, :, None]
        made[other] += plane[other] * (log_integral(apart + half) - log_integral(apart - half))
    return made
