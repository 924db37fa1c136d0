"""Compute the mesh law of gears whose load varies along the face width from their lines of contact.

Contacts are solved on a grid of phases, approaches beyond the first contact and tilts (`.width_law`). Approaches are
square steps up to the reach, closer where the flanks begin to bear. The law is compared with contacts half way between
its nodes. Where it misses them by more than the tolerance in one of the three directions, that direction gets twice as
many nodes. Contacts at places all over the law then say its error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.progress import count, one_thread
from ...base.typing import Array
from ..width import ContactLines
from ..width.lines import look_at, solve_positions, stored_energy
from .width_law import WidthLaw, WidthTable, law_coefficients

#: Cells of the phase and of the approach to begin with, and how often a direction is halved at most.
PHASES, PARTS, HALVINGS = 24, 8, (3, 2, 1)
#: Width of a cell of the tilt to begin with, over the face width, in parts of the reach; most cells. Energies of
#: neighbouring tilts have rounding by the placing of points, which counts the more the closer the tilts are.
TILT_PART, MOST_TILTS = 0.05, 16
#: Root of the mean square error, in parts of the force, above which a direction is halved.
TOLERANCE = 4e-3
#: Most contacts of a grid.
MOST = 12_000
#: Contacts half way between the nodes of each direction, and contacts that say the error.
HALF_WAY, CHECKS = 32, 160
#: Least root of the part of the reach at which errors are checked.
LEAST_CHECKED = 0.1
#: Force in parts of the largest of the law below which errors are parts of this one, as for other mesh laws.
LEAST_PART = 0.1
#: Phases at which the reach is looked for, and what it is beyond the approach of the largest force there.
REACH_PHASES, ROOM = 8, 1.02


class Contacts(NamedTuple):
    """Contacts at n places: energy (J), force (N), tangent (N/m), moment on the tilt (N m), dF/d tilt (N/rad)."""

    energy: Array
    force: Array
    tangent: Array
    couple: Array
    by_tilt: Array

    def counted(self, sense: float) -> Contacts:
        """The same with tilts counted in a sense (1 or -1)."""
        return self._replace(couple=sense * self.couple, by_tilt=sense * self.by_tilt)


@dataclass
class _Grid:
    """Contacts of a pair by whole numbers: a phase, a root of the part of the reach and a tilt on the finest grid."""

    lines: ContactLines
    sense: float
    reach: float
    tilt: float
    cells: tuple[int, int, int]
    known: dict[tuple[int, ...], Array] = field(default_factory=dict)

    @property
    def finest(self) -> tuple[int, int, int]:
        """Cells of the finest grid in each direction; none of a tilt that does not vary."""
        a, b, c = (cells << halvings for cells, halvings in zip(self.cells, HALVINGS, strict=True))
        return a, b, c

    def angle(self, number: Array) -> Array:
        return np.asarray(self.lines.compliance.mesh.sections.mesh_cycle * number / self.finest[0])

    def overlap(self, number: Array) -> Array:
        return np.asarray(self.reach * (number / self.finest[1]) ** 2)

    def tilted(self, number: Array) -> Array:
        return np.asarray(self.tilt * (2.0 * number / self.finest[2] - 1.0) if self.finest[2] else 0.0 * number)

    def solved(self, places: Array) -> tuple[Array, Contacts]:
        """Return the approach at the first contact (m) and the contact at places, shape (n, 3); each is solved once."""
        keys = [(phase % self.finest[0], part, tilt) for phase, part, tilt in places.tolist()]
        if unknown := [key for key in dict.fromkeys(keys) if key not in self.known]:
            phase, part, tilt = np.transpose(unknown)
            angle, tilted = self.angle(phase), self.sense * self.tilted(tilt)
            touch = first_contact(self.lines, angle, tilted)
            contacts = contacts_at(self.lines, angle, touch + self.overlap(part), tilted).counted(self.sense)
            self.known |= zip(unknown, np.stack([touch, *contacts], axis=1), strict=True)
        touch, *values = np.transpose([self.known[key] for key in keys])
        return touch, Contacts(*values)


def first_contact(lines: ContactLines, angle: ArrayLike, tilt: ArrayLike = 0.0) -> Array:
    """Return the approaches (m), shape (n,), at which rigid flanks touch, at pinion angles and further tilts (rad)."""
    least = look_at(lines, angle, tilt=tilt).least
    if not np.isfinite(least).all():
        at = math.degrees(float(np.broadcast_to(angle, least.shape)[~np.isfinite(least)][0]))
        problem = f"leave no flanks that meet at a driver's angle of {at:.6g} deg"
        raise InputError("flanks", None, problem, "use less modification")
    return least * lines.compliance.mesh.sections.wheel.base_radius


def contacts_at(lines: ContactLines, angle: Array, approach: Array, tilt: Array) -> Contacts:
    """Solve the contact at n places.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle, approach : ndarray, shape (n,)
        Pinion angles (rad), and approaches in the middle of the width (m).
    tilt : ndarray, shape (n,)
        Tilts in the plane of action beside that of the lines (rad), > 0 where they close the gap towards larger z.

    Raises
    ------
    InputError
        Where a contact is not solved.
    """
    radius = lines.compliance.mesh.sections.wheel.base_radius
    solutions = solve_positions(lines, angle, twist=approach / radius, tilt=tilt)
    for solution, *place in zip(solutions, angle, approach, tilt, strict=True):
        if not solution.converged:
            problem = (
                f"are not solved at a driver's angle of {math.degrees(place[0]):.6g} deg, an approach of "
                f"{1e6 * place[1]:.6g} um and a tilt of {1e6 * place[2]:.6g} um/m"
            )
            raise InputError("contacts", None, problem, "ask for a law up to smaller forces")
    tangent = np.array([one.tangent[0] for one in solutions])
    return Contacts(
        energy=np.array([stored_energy(lines.law, one) for one in solutions]),
        force=np.array([one.torque for one in solutions]) / radius,
        tangent=tangent[:, 0] / radius**2,
        couple=np.array([one.points.levers[:, 1] @ one.moment for one in solutions]),
        by_tilt=tangent[:, 1] / radius,
    )


def reach_of(lines: ContactLines, force: float) -> float:
    """Return the approach beyond the first contact (m) at which the force is the given one (N), the largest over the
    phases.

    Raises
    ------
    InputError
        For a force that no contact carries.
    """
    sections = lines.compliance.mesh.sections
    angles = sections.mesh_cycle * np.arange(REACH_PHASES) / REACH_PHASES
    torques = np.full(REACH_PHASES, force * sections.wheel.base_radius)
    solutions = solve_positions(lines, angles, torque=torques)
    if not all(one.converged for one in solutions):
        problem = f"no contact solution of this pair makes a mesh force of {force:.6g} N at all phases"
        raise InputError("force", force, problem, "ask for a law up to smaller forces")
    approach = sections.wheel.base_radius * np.array([one.twist for one in solutions])
    return ROOM * float((approach - first_contact(lines, angles)).max(initial=0.0))


def width_law(
    lines: ContactLines, force: float, tilt: float, *, sense: float = 1.0, tolerance: float = TOLERANCE
) -> WidthLaw:
    """Compute the law of a pair from its lines of contact.

    Parameters
    ----------
    lines : ContactLines
        Gears, flanks and the tilt of their axes, beside which the law counts tilts.
    force : float
        Mesh force (N) up to which the law is asked for.
    tilt : float
        Largest tilt (rad) either way; 0: for gears that cannot tilt.
    sense : float
        -1 where tilts are counted towards smaller z of the lines, else 1.
    tolerance : float
        Root of the mean square error above which nodes are added.

    Raises
    ------
    InputError
        For forces that the pair does not carry, and contacts that are not solved.
    """
    with one_thread():
        reach = reach_of(lines, force)
        span = tilt * lines.compliance.mesh.width / (TILT_PART * reach)
        tilts = 2 * min(math.ceil(span), MOST_TILTS // 2)
        grid = _Grid(lines, sense, reach, tilt, (PHASES, PARTS, tilts))
        cells = list(grid.cells)
        rng = np.random.default_rng(7)
        while True:
            law = _law(grid, cells, force)
            errors = [_half_way(grid, law, cells, d, rng) for d in range(3)]
            size = [_size(cells, d) for d in range(3)]
            order = [d for d in np.argsort(errors)[::-1].tolist() if errors[d] > tolerance]
            halved = next((d for d in order if 2 * cells[d] <= grid.finest[d] and size[d] <= MOST), None)
            if halved is None:
                break
            cells[halved] *= 2
        ends = ((0.0, grid.finest[0]), (LEAST_CHECKED * grid.finest[1], grid.finest[1]), (0.0, grid.finest[2]))
        phase, part, across = np.array([[rng.uniform(*end) for end in ends] for _ in range(CHECKS)]).T
        angle, tilted = grid.angle(phase), grid.tilted(across)
        approach = law.first_contact(angle, tilted) + grid.overlap(part)
        contacts = contacts_at(grid.lines, angle, approach, sense * tilted).counted(sense)
        found = _errors(law, angle, approach, tilted, contacts)
    return replace(law, error=float(found.max()), rms_error=float(np.sqrt(np.mean(found**2))))


def _size(cells: Sequence[int], halved: int) -> int:
    """Contacts of a grid with one direction halved."""
    a, b, c = (2 * n if d == halved else n for d, n in enumerate(cells))
    return a * b * (c + 1)


def _law(grid: _Grid, cells: Sequence[int], force: float) -> WidthLaw:
    """The law of the contacts on a grid of cells."""
    numbers = [
        np.arange(n + (d > 0)) * (finest // max(n, 1))
        for d, (n, finest) in enumerate(zip(cells, grid.finest, strict=True))
    ]
    shape = len(numbers[0]), len(numbers[1]), len(numbers[2])
    touch, contacts = np.zeros((shape[0], shape[2])), np.zeros((*shape, len(Contacts._fields)))
    beyond = np.stack(np.meshgrid(*numbers[1:], indexing="ij"), axis=-1)[1:]  # the first contact
    for i, phase in enumerate(numbers[0].tolist()):
        count(i, shape[0], "phases")
        places = np.insert(beyond.reshape(-1, 2), 0, phase, axis=1)
        first, solved = grid.solved(places)
        touch[i] = first[: shape[2]]
        contacts[i, 1:] = np.stack(solved, axis=1).reshape(shape[1] - 1, shape[2], -1)
    overlaps = grid.overlap(numbers[1])
    # the parabola through no force at the first contact with force and tangent of the first node
    begin = contacts[:, 1, :, 1] / overlaps[1]
    contacts[:, 0, :, 2] = np.clip(2.0 * begin - contacts[:, 1, :, 2], 0.0, 3.0 * begin)
    angles, tilted = grid.angle(numbers[0]), grid.tilted(numbers[2])
    mesh = grid.lines.compliance.mesh
    cycle = mesh.sections.mesh_cycle
    coefficients = law_coefficients(WidthTable(angles, overlaps, tilted, touch, *np.moveaxis(contacts, -1, 0)), cycle)
    radii = mesh.gears[0].base_radius, mesh.gears[1].base_radius
    return WidthLaw(
        np.append(angles, cycle), overlaps, tilted, *coefficients, radii, mesh.width, mesh.sections.base_backlash, force
    )


def _half_way(grid: _Grid, law: WidthLaw, cells: Sequence[int], direction: int, rng: np.random.Generator) -> float:
    """Root of the mean square error half way between the nodes of one direction, at nodes of the others."""
    if 2 * cells[direction] > grid.finest[direction] or not cells[direction]:
        return 0.0
    places = []
    for _ in range(HALF_WAY):
        place = []
        for d, (n, finest) in enumerate(zip(cells, grid.finest, strict=True)):
            step = finest // max(n, 1)
            if d == direction:
                place.append(step * int(rng.integers(0, n)) + step // 2)
            else:
                place.append(step * int(rng.integers(d == 1, n + 1)) if n else 0)
        places.append(place)
    phase, part, tilt = np.transpose(places)
    touch, contacts = grid.solved(np.array(places))
    errors = _errors(law, grid.angle(phase), touch + grid.overlap(part), grid.tilted(tilt), contacts)
    return math.sqrt(float(np.mean(errors**2)))


def _errors(law: WidthLaw, angle: Array, approach: Array, tilt: Array, contacts: Contacts) -> Array:
    """Errors of force, or of the moment over half the width, in parts of the force or of a part of the largest one."""
    at = law(angle, approach, tilt)
    off = np.maximum(np.abs(at.force - contacts.force), np.abs(at.couple - contacts.couple) / (0.5 * law.width))
    return np.asarray(off / np.maximum(contacts.force, LEAST_PART * law.largest_force))
