r"""Energies of a train's parts as forms of its modal coordinates, and the sense in which its shafts whirl.

A mode :math:`y(t) = \mathrm{Re}(\hat y e^{\lambda t})` has the mean energies :math:`\tfrac14\dot{\hat y}^H M_p\dot{\hat
y}` and :math:`\tfrac14\hat y^H K_p\hat y` in each part p of the train:

- *bending* of a shaft: motion across the axis and tilts; strain of its bending and of its bearings across the axis;
- *torsion* of a shaft: its spin and that of its machines; strain of its twist, of the drive's coupling, of machines'
  springs, and of couplings whose first shaft it is;
- *axial* motion of a shaft: motion along the axis; strain along it and of its bearings along it;
- *housing*; each *mesh*.

Forces of constraints do no work, so hinges and rigid meshes have no part.

The sense of whirl of a shaft is that of the angular momentum of its orbits. With the displacements u1, u2 across the
axis and the tilts r1, r2 (about e1 and e2, right-handed with the axis),

.. math:: c = \frac{-2\,\mathrm{Im}\sum (m\,\bar u_1 u_2 + J_t\,\bar r_1 r_2)}
              {\sum \big(m(|u_1|^2 + |u_2|^2) + J_t(|r_1|^2 + |r_2|^2)\big)} :

1 where all places go round in circles about the axis, -1 against it, 0 where they move to and fro. It is that of the
ellipses of Jordan's orbits weighted by kinetic energy; a coordinate of an elastic shaft, of unit mass, counts as a
place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.typing import Array, ComplexArray
from ..train.bearings import shaft_motion
from ..train.elements import planes
from ..train.mesh_element import Shafts
from ..train.model import TrainModel

#: Kinds of a shaft's motion.
BENDING, TORSION, AXIAL = "bending", "torsion", "axial"
KINDS = (BENDING, TORSION, AXIAL)
HOUSING, MESH = "housing", "mesh"
#: Orbits of a smaller part of twice the energy are round-off, which has no sense.
SMALL = 1e-10


class Part(NamedTuple):
    """A part of the train that has energy: its kind, and the name of its shaft or mesh."""

    kind: str
    name: str = ""

    def __str__(self) -> str:
        return f"{self.kind} {self.name}".strip()


class Form(NamedTuple):
    """Energy of a part: real part of the product of two sets of rows on the modal coordinates, (k, n) each."""

    part: int
    left: Array
    right: Array

    def of(self, values: ComplexArray) -> Array:
        """(k,) of modal coordinates, or rates, (n, k)."""
        return np.asarray(((self.left @ values).conj() * (self.right @ values)).sum(axis=0).real)


class Orbit(NamedTuple):
    """Places of a shaft that go round: both directions on the modal coordinates (k, n), masses, sense of its spin."""

    first: Array
    second: Array
    mass: Array
    sense: float


@dataclass(frozen=True, eq=False)
class TrainForms:
    """Energies and orbits of a train.

    Attributes
    ----------
    parts
        Parts that have energy: of each shaft its kinds, then the housing if it is elastic, and the meshes.
    kinetic, strain
        Forms of the rates, and of the coordinates.
    orbits
        Of each shaft.
    """

    parts: tuple[Part, ...]
    kinetic: tuple[Form, ...]
    strain: tuple[Form, ...]
    orbits: tuple[Orbit, ...]

    def weights(self) -> Array:
        """(n, n) kinetic energies of the parts, the first once, the second twice, and so on."""
        return np.asarray(sum((form.part + 1.0) * form.left.T @ form.right for form in self.kinetic))

    def shares(self, values: ComplexArray, rates: ComplexArray) -> tuple[Array, Array]:
        """Kinetic and strain energy of each part, (k, parts) each, in parts of the whole of a mode.

        Parameters
        ----------
        values, rates : (n, k)
            Modal coordinates of the modes, and their rates.
        """
        made = np.zeros((2, values.shape[1], len(self.parts)))
        for energy, forms, motion in zip(made, (self.kinetic, self.strain), (rates, values), strict=True):
            for form in forms:
                energy[:, form.part] += form.of(motion)
        whole = made.sum(axis=(0, 2))
        made /= np.where(whole > 0.0, whole, 1.0)[:, None]
        return made[0], made[1]

    def whirl(self, rates: ComplexArray) -> tuple[Array, Array]:
        """Sense of whirl of each shaft against its spin, -1 to 1, and what its orbits weigh; (k, shafts) each.

        `rates` (n, k) are those of modes of twice the energy 1.
        """
        senses, weights = [], []
        for orbit in self.orbits:
            one, two = orbit.first @ rates, orbit.second @ rates
            round_, mass = (one.conj() * two).imag, orbit.mass[:, None]
            weight = (mass * (np.abs(one) ** 2 + np.abs(two) ** 2)).sum(axis=0)
            turned = -2.0 * orbit.sense * (mass * round_).sum(axis=0)
            senses.append(np.divide(turned, weight, out=np.zeros_like(weight), where=weight > SMALL))
            weights.append(weight)
        return np.array(senses).T, np.array(weights).T


def train_forms(model: TrainModel, sense: float) -> TrainForms:
    """Forms of the energies of all parts of a train whose drive turns in a sense (+1 or -1)."""
    train, T = model.train, model.modal.T
    parts = [Part(kind, shaft.name) for shaft in train.shafts for kind in KINDS]
    parts += [] if model.housing is None else [Part(HOUSING)]
    parts += [Part(MESH, line.name) for line in model.meshes]
    kinetic, orbits = [], []
    for number, body in enumerate(model.shafts):
        rows, mass = T[model.first[number] : model.first[number] + body.size], body.mass()
        its = _coordinates(model, number)
        for kind, chosen in enumerate(its.kinds):
            kinetic.append(Form(3 * number + kind, chosen @ rows, chosen @ mass @ rows))
        turning = sense * float(np.sign(model.ratios[number]))
        orbits.append(Orbit(its.first @ rows, its.second @ rows, its.mass, turning))
    for machine, row in zip(train.machines, model.driveline.machines, strict=True):
        rows = row[None, :] @ T
        torsion = 3 * train.shaft_number(machine.shaft) + KINDS.index(TORSION)
        kinetic.append(Form(torsion, rows, machine.inertia * rows))
    if model.housing is not None:
        rows = T[: model.housing.size]
        kinetic.append(Form(parts.index(Part(HOUSING)), rows, model.housing.mass() @ rows))
    strain = [form for number in range(len(model.system.elements)) for form in _strain(model, parts, number)]
    return TrainForms(tuple(parts), tuple(kinetic), tuple(strain), tuple(orbits))


def _strain(model: TrainModel, parts: list[Part], number: int) -> list[Form]:  # noqa: PLR0911
    """Forms of the strain of an element of the system."""
    element = model.system.elements[number]
    blocks = element.blocks()
    if blocks is None or not blocks[1].any():
        return []
    rows = model.modal.T[model.system.index[number]]
    kind, _, name = element.name.partition(" ")
    if element is model.housing:
        return [Form(parts.index(Part(HOUSING)), rows, blocks[1] @ rows)]
    if kind == MESH:
        return [Form(parts.index(Part(MESH, name)), rows, blocks[1] @ rows)]
    touched = [i for i, body in enumerate(model.shafts) if body is element or body in element.touches]
    shaft = touched[0] if touched else model.train.shaft_number(model.train.driven.shaft)
    if element in model.shafts:
        chosen = enumerate(_coordinates(model, shaft).kinds)
        return [Form(3 * shaft + kind, pick @ rows, pick @ blocks[1] @ rows) for kind, pick in chosen]
    if kind == "bearing":
        shafts = Shafts(model.shafts, model.first, tuple(model.ratios), model.system.size)
        moved = shaft_motion(model.train, shafts, name) @ model.modal.T
        stiffness = next(bearing.stiffness_matrix for bearing in model.train.bearings if bearing.bore == name)
        along = np.array([0, 1, 0, 0, 0])  # the second row is the motion along the axis
        forces = stiffness @ moved
        return [
            Form(3 * shaft + KINDS.index(AXIAL), along[:, None] * moved, forces),
            Form(3 * shaft + KINDS.index(BENDING), (1 - along)[:, None] * moved, forces),
        ]
    if kind == "pin":
        planet = model.train.shaft_number(name)
        return [Form(3 * planet + KINDS.index(BENDING), rows, blocks[1] @ rows)]
    return [Form(3 * shaft + KINDS.index(TORSION), rows, blocks[1] @ rows)]


class _Coordinates(NamedTuple):
    """What the coordinates of a shaft are."""

    kinds: tuple[Array, ...]  # projections (size, size) on those of bending, torsion and axial motion
    first: Array  # (k, size) places along e1
    second: Array  # (k, size) along e2, those that the places along e1 come to by a quarter of a turn
    mass: Array  # (k,)


def _coordinates(model: TrainModel, number: int) -> _Coordinates:
    """Kinds of a shaft's coordinates, and the places that go round in its bending.

    Those of the mean motion are known. Each elastic one, of unit mass, is of one kind; bending comes in pairs of equal
    shapes along e1 and e2.
    """
    body, frame = model.shafts[number], model.train.frame
    bends, turns, shifts = (np.zeros((body.size, body.size)) for _ in KINDS)
    shifts[:3, :3] = np.outer(frame[2], frame[2])
    bends[:3, :3] = np.eye(3) - shifts[:3, :3]
    bends[3, 3] = bends[4, 4] = turns[5, 5] = 1.0
    for coordinate, kind in enumerate(body.kinds, start=6):
        {"bending": bends, "torsion": turns, "axial": shifts}[kind.split()[0]][coordinate, coordinate] = 1.0
    mass, first, second = zip(*planes(body, frame), strict=True)
    return _Coordinates((bends, turns, shifts), np.array(first), np.array(second), np.array(mass))
