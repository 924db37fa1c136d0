"""Positions of a gear pair by the law of its elastic pair, whether the mesh resolves the contact or not."""

from __future__ import annotations

import numpy as np

from gearfe import GearPair
from gearfe.contact.position import Position
from gearfe.contact.scene import MeshingPair
from gearfe.stiffness.position_solver import position_solver


def solve_positions(gears: GearPair, elastic: MeshingPair, angles, twists) -> list[Position]:
    """At pinion angles and twists (rad), with what fields need."""
    angles = np.atleast_1d(np.asarray(angles, dtype=float))
    solver = position_solver(gears, elastic, resolved_only=False)
    return solver.solve(angles, np.broadcast_to(twists, angles.shape), kept=range(len(angles)))


def solve_position(gears: GearPair, elastic: MeshingPair, angle: float, twist: float) -> Position:
    """At one."""
    return solve_positions(gears, elastic, [angle], twist)[0]


def nodal(elastic: MeshingPair, position: Position, angle: float, twist: float):
    """Window, undeformed nodes (m) and forces (N) of each piece of flank, as complex numbers in global axes."""
    for w in position.windows:
        turn = np.exp(1j * elastic.tooth_angle(w.gear, w.tooth, angle, twist))
        points = elastic.bodies[w.gear].flank.points[flank_nodes(w)] @ [1, 1j]
        yield w, turn * points + w.gear * elastic.centre_distance, turn * position.forces[w.unknowns].view(complex)


def flank_nodes(window) -> slice:
    """Nodes of a piece of flank within the tooth's contact surface."""
    return slice(window.flank_unknowns.start // 2, window.flank_unknowns.stop // 2)
