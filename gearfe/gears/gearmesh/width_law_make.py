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

from ...base.errors import InputError
from ...base.progress import count, one_thread
from ..width import ContactLines, Misalignment
from ..width.lines import look_at, solve_position, stored_energy
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


class Contact(NamedTuple):
    """Contact at one place: energy (J), force (N), tangent (N/m), moment on the tilt (N m), dF/d tilt (N/rad)."""

    energy: float
    force: float
    tangent: float
    couple: float
    by_tilt: float

    def counted(self, sense: float) -> Contact:
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
    touches: dict[tuple[int, int], float] = field(default_factory=dict)
    contacts: dict[tuple[int, int, int], Contact] = field(default_factory=dict)

    @property
    def finest(self) -> tuple[int, int, int]:
        """Cells of the finest grid in each direction; none of a tilt that does not vary."""
        a, b, c = (cells << halvings for cells, halvings in zip(self.cells, HALVINGS, strict=True))
        return a, b, c

    @property
    def radius(self) -> float:
        return self.lines.compliance.mesh.sections.wheel.base_radius

    def angle(self, number: float) -> float:
        return self.lines.compliance.mesh.sections.mesh_cycle * number / self.finest[0]

    def overlap(self, number: float) -> float:
        return self.reach * (number / self.finest[1]) ** 2

    def tilted(self, number: float) -> float:
        return self.tilt * (2.0 * number / self.finest[2] - 1.0) if self.finest[2] else 0.0

    def touch(self, phase: int, tilt: int) -> float:
        key = phase % self.finest[0], tilt
        if key not in self.touches:
            self.touches[key] = first_contact(self.lines, self.angle(key[0]), self.sense * self.tilted(tilt))
        return self.touches[key]

    def contact(self, phase: int, part: int, tilt: int) -> Contact:
        key = phase % self.finest[0], part, tilt
        if key not in self.contacts:
            approach = self.touch(phase, tilt) + self.overlap(part)
            at = contact_at(self.lines, self.angle(key[0]), approach, self.sense * self.tilted(tilt))
            self.contacts[key] = at.counted(self.sense)
        return self.contacts[key]


def tilted_lines(lines: ContactLines, tilt: float) -> ContactLines:
    """Return the same gears with a further tilt in the plane of action (rad)."""
    given = lines.flanks.misalignment
    return lines.with_flanks(replace(lines.flanks, misalignment=Misalignment(given.in_plane + tilt, given.across)))


def first_contact(lines: ContactLines, angle: float, tilt: float = 0.0) -> float:
    """Return the approach (m) at which the rigid flanks touch, at a pinion angle and a further tilt (rad)."""
    least = look_at(tilted_lines(lines, tilt), angle).least
    if not math.isfinite(least):
        problem = f"leave no flanks that meet at a driver's angle of {math.degrees(angle):.6g} deg"
        raise InputError("flanks", None, problem, "use less modification")
    return least * lines.compliance.mesh.sections.wheel.base_radius


def contact_at(lines: ContactLines, angle: float, approach: float, tilt: float = 0.0) -> Contact:
    """Solve the contact at one place.

    Parameters
    ----------
    lines : ContactLines
        The gears.
    angle, approach : float
        Pinion angle (rad), and approach in the middle of the width (m).
    tilt : float
        Tilt in the plane of action beside that of the lines (rad), > 0 where it closes the gap towards larger z.

    Raises
    ------
    InputError
        Where the contact is not solved.
    """
    radius = lines.compliance.mesh.sections.wheel.base_radius
    solution = solve_position(tilted_lines(lines, tilt), angle, twist=approach / radius)
    if not solution.converged:
        problem = (
            f"are not solved at a driver's angle of {math.degrees(angle):.6g} deg, an approach of "
            f"{1e6 * approach:.6g} um and a tilt of {1e6 * tilt:.6g} um/m"
        )
        raise InputError("contacts", None, problem, "ask for a law up to smaller forces")
    tangent = solution.tangent[0]
    return Contact(
        stored_energy(lines.law, solution),
        solution.torque / radius,
        float(tangent[0]) / radius**2,
        float(solution.points.levers[:, 1] @ solution.moment),
        float(tangent[1]) / radius,
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
    reach = 0.0
    for angle in sections.mesh_cycle * np.arange(REACH_PHASES) / REACH_PHASES:
        solution = solve_position(lines, float(angle), torque=force * sections.wheel.base_radius)
        if not solution.converged:
            problem = f"no contact solution of this pair makes a mesh force of {force:.6g} N at all phases"
            raise InputError("force", force, problem, "ask for a law up to smaller forces")
        way = solution.twist * sections.wheel.base_radius - first_contact(lines, float(angle))
        reach = max(reach, way)
    return ROOM * reach


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
        places = [[rng.uniform(*end) for end in ends] for _ in range(CHECKS)]
        found = np.array([_error(grid, law, *place) for place in places])
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
    phases, parts, tilts = (values.tolist() for values in numbers)
    shape = len(phases), len(parts), len(tilts)
    touch, contacts = np.zeros((shape[0], shape[2])), np.zeros((*shape, len(Contact._fields)))
    for i, phase in enumerate(phases):
        count(i, len(phases), "phases")
        for k, tilt in enumerate(tilts):
            touch[i, k] = grid.touch(phase, tilt)
            for j, part in enumerate(parts[1:], start=1):
                contacts[i, j, k] = grid.contact(phase, part, tilt)
    overlaps = np.array([grid.overlap(part) for part in parts])
    # the parabola through no force at the first contact with force and tangent of the first node
    begin = contacts[:, 1, :, 1] / overlaps[1]
    contacts[:, 0, :, 2] = np.clip(2.0 * begin - contacts[:, 1, :, 2], 0.0, 3.0 * begin)
    angles = np.array([grid.angle(phase) for phase in phases])
    tilted = np.array([grid.tilted(tilt) for tilt in tilts])
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
    squares = []
    for _ in range(HALF_WAY):
        place = []
        for d, (n, finest) in enumerate(zip(cells, grid.finest, strict=True)):
            step = finest // max(n, 1)
            if d == direction:
                place.append(step * int(rng.integers(0, n)) + step // 2)
            else:
                place.append(step * int(rng.integers(d == 1, n + 1)) if n else 0)
        squares.append(_error(grid, law, *place) ** 2)
    return math.sqrt(float(np.mean(squares)))


def _error(grid: _Grid, law: WidthLaw, phase: float, part: float, tilt: float) -> float:
    """Error of force, or of the moment over half the width, in parts of the force, or of a part of the largest one."""
    angle, tilted, overlap = grid.angle(phase), grid.tilted(tilt), grid.overlap(part)
    if all(float(number).is_integer() for number in (phase, part, tilt)):
        contact = grid.contact(int(phase), int(part), int(tilt))
        approach = grid.touch(int(phase), int(tilt)) + overlap
    else:
        approach = float(law.first_contact([angle], [tilted])[0]) + overlap
        solved = contact_at(grid.lines, angle, approach, grid.sense * tilted)
        contact = solved.counted(grid.sense)
    at = law(np.array([angle]), np.array([approach]), np.array([tilted]))
    off = max(abs(at.force[0] - contact.force), abs(at.couple[0] - contact.couple) / (0.5 * law.width))
    return float(off / max(contact.force, LEAST_PART * law.largest_force))
