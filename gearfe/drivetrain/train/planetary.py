r"""Planetary stages: whether their planets can be assembled, the phases of their meshes, and what these excite.

Planets that turn about the axis of their carrier from one place to another by an angle psi find teeth and spaces there
alike if two central gears A and B, joined by a chain of n planet gears in mesh with each other, satisfy

.. math:: \frac{(z_A + (-1)^n z_B)\,\psi}{2\pi} \in \mathbb{Z}, \qquad
    \text{sun and ring: } \frac{(z_s + |z_r|)\,\psi}{2\pi} \in \mathbb{Z} .

Gears of a stepped planet are keyed on their shaft as each place needs.

Meshes of one kind differ in phase: their cycles :math:`\gamma_n` are :math:`z\,\psi_n/2\pi` apart, z the teeth of the
central gear (Parker and Lin, "Mesh phasing relationships in planetary and epicyclic gears", J. Mech. Des. 126, 2004).
Harmonic l of the mesh force excites (Parker, "A physical explanation for the effectiveness of planet phasing to
suppress planetary gear vibration", J. Sound Vib. 236, 2000)

.. math:: \text{rotational modes by } \frac1N\Big|\sum_n e^{2\pi i l\gamma_n}\Big|, \qquad
    \text{translational modes by } \frac1N\max_\pm\Big|\sum_n e^{i(2\pi l\gamma_n \pm \psi_n)}\Big| ,

and planet modes by what is left: with equal spacing it excites one kind only, by mod(l z, N) = 0, 1 or N - 1, or else.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ...base.errors import InputError
from .layout import LayoutCarrier, LayoutGear, LayoutMesh, TrainLayout

#: Part of a pitch by which teeth and spaces may miss each other: angles of planets are written with some digits.
NEAR = 1e-4
#: Sums of unit vectors that are smaller, in parts of their number, are 0: far above round-off and written angles.
NONE = 1e-3
#: Harmonics of a mesh whose effect is stated.
HARMONICS = 6
ROTATIONAL, TRANSLATIONAL, PLANET = "rotational", "translational", "planet"


class _Chain(NamedTuple):
    """Two central gears, and the number of planet gears in mesh that join them."""

    one: LayoutGear
    two: LayoutGear
    planets: int

    @property
    def teeth(self) -> int:
        """What must be whole when it is multiplied by the turns from one planet to another."""
        return abs(self.one.teeth + (-1) ** self.planets * self.two.teeth)

    @property
    def sum(self) -> str:
        """That number in words."""
        a, b = self.one.teeth, (-1) ** self.planets * self.two.teeth
        sign = "+" if a * b > 0 else "-"
        return f"{abs(a)} {sign} {abs(b)}"


def check_assembly(layout: TrainLayout) -> None:
    """Raise `InputError` for planets of a carrier that teeth do not let in."""
    for carrier in layout.carriers:
        first = {planets[0][0] for planets in carrier.sets}
        for chain in _chains(layout, carrier, first):
            for angles in ([angle for _, angle in planets] for planets in carrier.sets):
                for number, angle in enumerate(angles[1:], start=2):
                    turned = chain.teeth * (angle - angles[0]) / (2.0 * math.pi)
                    if abs(turned - round(turned)) > NEAR:
                        raise _not_assembled(carrier, chain, number, math.degrees(angle - angles[0]), turned, angles)


def _not_assembled(
    carrier: LayoutCarrier, chain: _Chain, number: int, degrees: float, turned: float, angles: Sequence[float]
) -> InputError:
    """A planet that does not find its teeth."""
    count, pitch = len(angles), 360.0 / chain.teeth
    near = [f"{whole * pitch:.9g}" for whole in (math.floor(turned), math.ceil(turned))]
    problem = (
        f"planet {number} does not mesh with gears {chain.one.name!r} and {chain.two.name!r} at once, "
        f"{degrees:.9g} deg from planet 1: ({chain.sum}) * {degrees:.9g} / 360 = {turned:.6g} must be a whole number"
    )
    step = 2.0 * math.pi / count
    if all(abs(angle - angles[0] - k * step) < 1e-9 for k, angle in enumerate(angles)):
        fitting = [str(n) for n in range(2, 13) if chain.teeth % n == 0]
        numbers = f"take {' or '.join(fitting)} equally spaced planets" if fitting else "change tooth numbers"
        cure = f"{numbers}, or write their angles: multiples of {pitch:.9g} deg from planet 1"
        return InputError(f"carriers.{carrier.name}.planets", count, problem, cure)
    cure = f"place it {near[0]} or {near[1]} deg from planet 1"
    return InputError(f"carriers.{carrier.name}.planet_angles_deg", None, problem, cure)


def _chains(layout: TrainLayout, carrier: LayoutCarrier, planets: set[int]) -> Iterator[_Chain]:
    """Central gears that the first planets join by meshes."""
    meshes = [mesh for mesh in layout.meshes if mesh.carrier == carrier.shaft]
    joined: dict[str, list[LayoutGear]] = {}
    for mesh in meshes:
        for one, two in ((mesh.driver, mesh.driven), (mesh.driven, mesh.driver)):
            joined.setdefault(one.name, []).append(two)
    carried = {shaft for row in carrier.sets for shaft, _ in row}
    central = {g.name: g for m in meshes for g in (m.driver, m.driven) if g.shaft not in carried}
    done: set[frozenset[str]] = set()
    for gear in central.values():
        ahead = [(next_, 1) for next_ in joined[gear.name] if next_.shaft in planets]
        passed = {next_.name for next_, _ in ahead}
        while ahead:
            planet, count = ahead.pop()
            for other in joined[planet.name]:
                both = frozenset((gear.name, other.name))
                if other.name in central and other.name != gear.name and both not in done:
                    done.add(both)
                    yield _Chain(gear, other, count)
                elif other.shaft in planets and other.name not in passed:
                    passed.add(other.name)
                    ahead.append((other, count + 1))


@dataclass(frozen=True)
class MeshFamily:
    """Meshes of the planets of one set with one central gear, or with planets of another set.

    Attributes
    ----------
    carrier
        Name of the carrier.
    meshes
        Numbers of the meshes, one a planet.
    names
        Of the two gears of the first mesh.
    angles
        Places of the planets about the axis of the carrier (rad).
    phases
        Part of a mesh cycle by which each mesh is ahead of the first one.
    """

    carrier: str
    meshes: tuple[int, ...]
    names: tuple[str, str]
    angles: tuple[float, ...]
    phases: tuple[float, ...]

    def carries(self, harmonic: int, passes: int) -> bool:
        """Whether a sideband of ideal planets carries anything at a point that stands still.

        Parameters
        ----------
        harmonic
            Of the mesh.
        passes
            Rotations of the carrier, about the axis of the train, that are added to the phase. The planets act there
            one after the other, with the phases of their meshes (McFadden & Smith, Proc. IMechE C 199, 1985).
        """
        turns = [
            cmath.exp(1j * (2.0 * math.pi * harmonic * phase + passes * angle))
            for phase, angle in zip(self.phases, self.angles, strict=True)
        ]
        return abs(sum(turns)) / len(turns) >= NONE

    def excites(self, harmonic: int) -> dict[str, float]:
        """How strongly a harmonic of the mesh force excites each kind of modes, 0 to 1; 0 is suppressed."""
        turns = [cmath.exp(2j * math.pi * harmonic * phase) for phase in self.phases]
        count = len(turns)
        rotational = abs(sum(turns)) / count
        both = [
            abs(sum(t * cmath.exp(sign * 1j * a) for t, a in zip(turns, self.angles, strict=True))) for sign in (1, -1)
        ]
        translational = max(both) / count
        left = 1.0 - rotational**2 - sum((x / count) ** 2 for x in both)
        found = {ROTATIONAL: rotational, TRANSLATIONAL: translational, PLANET: math.sqrt(max(0.0, left))}
        return {kind: 0.0 if value < NONE else value for kind, value in found.items()}


def mesh_families(layout: TrainLayout, phases: Sequence[float]) -> tuple[MeshFamily, ...]:
    """Meshes of all stages by what they are.

    Parameters
    ----------
    layout
        Of the train.
    phases
        For each mesh, the driver's rotation (rad) past a tooth on the line of centres at the start, in the sense in
        which it turns.
    """
    families = []
    for carrier in layout.carriers:
        place = {shaft: (row, k) for row, planets in enumerate(carrier.sets) for k, (shaft, _) in enumerate(planets)}
        groups: dict[tuple[object, object], list[tuple[int, LayoutMesh, float]]] = {}
        for number, mesh in enumerate(layout.meshes):
            if mesh.carrier != carrier.shaft:
                continue
            ends = [place.get(gear.shaft) for gear in (mesh.driver, mesh.driven)]
            row, k = next(end for end in ends if end is not None)
            key = tuple(
                (gear.shaft if end is None else ("set", end[0]), abs(gear.teeth))
                for gear, end in zip((mesh.driver, mesh.driven), ends, strict=True)
            )
            groups.setdefault((key[0], key[1]), []).append((number, mesh, carrier.sets[row][k][1]))
        for group in groups.values():
            cycles = [phases[number] * mesh.driver.teeth / (2.0 * math.pi) for number, mesh, _ in group]
            ahead = tuple(_part(cycle - cycles[0]) for cycle in cycles)
            first = group[0][1]
            families.append(
                MeshFamily(
                    carrier.name,
                    tuple(number for number, *_ in group),
                    (first.driver.name, first.driven.name),
                    tuple(angle for *_, angle in group),
                    ahead,
                )
            )
    return tuple(families)


def _part(cycles: float) -> float:
    """Part of a cycle, 0 to 1; 1 less round-off is 0."""
    part = cycles % 1.0
    return 0.0 if 1.0 - part < 1e-9 else part


def family_facts(family: MeshFamily, names: Sequence[str]) -> dict[str, object]:
    """What the summary says of meshes of one kind: their phases, and what harmonics of their forces excite."""
    return {
        "carrier": family.carrier,
        "meshes": [names[number] for number in family.meshes],
        "phases_of_a_cycle": list(family.phases),
        "harmonics": [
            {"harmonic": harmonic, "excites": kinds, "suppresses": [kind for kind in KINDS if kind not in kinds]}
            for harmonic in range(1, HARMONICS + 1)
            for kinds in [[kind for kind, value in family.excites(harmonic).items() if value]]
        ],
    }


KINDS = (ROTATIONAL, TRANSLATIONAL, PLANET)
