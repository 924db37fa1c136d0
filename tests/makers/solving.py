"""Positions of a gear pair by the law of its elastic pair, whether the mesh resolves the contact or not."""

from __future__ import annotations

import numpy as np

from gearfe.gears.contact.compliance import MeshingPair
from gearfe.gears.contact.elements import solve_elements
from gearfe.gears.contact.laws import HalfPlane
from gearfe.gears.contact.position import NO_LOADS, STATUS, TORQUES, Contacts, FlankLoads, Positions
from gearfe.gears.gearmesh.positions import position_solver


def solve_positions(elastic: MeshingPair, angles, twists) -> Positions:
    """At pinion angles and twists (rad), with what fields need."""
    angles = np.atleast_1d(np.asarray(angles, dtype=float))
    solver, twists = position_solver(elastic), np.broadcast_to(twists, angles.shape)
    if isinstance(elastic.law, HalfPlane):
        return solver.solve(angles, twists, kept=np.arange(len(angles)))
    return solve_elements(elastic, solver.half_plane.solve(angles, twists, np.arange(len(angles))))


def given_positions(twists, loads: tuple[FlankLoads, ...] = (NO_LOADS, NO_LOADS)) -> Positions:
    """Positions at pinion angle 0 that count as solved, without numbers and contacts."""
    n, none, panels = len(twists), np.zeros(0), np.zeros((0, 0))
    pairs = np.zeros((0, 2))
    contacts = Contacts(
        np.zeros(0, int), np.zeros(0, int), none, none, none + 0j, none + 0j, pairs, none, none, none, none, pairs,
        panels, panels, panels, np.zeros((0, 2, 0)),
    )  # fmt: skip
    return Positions(
        pinion_angle=np.zeros(n),
        twist=twists,
        status=np.full(n, "converged", dtype=STATUS),
        **dict.fromkeys((*TORQUES, "energy"), np.full(n, np.nan)),
        iterations=np.zeros(n, int),
        contacts=contacts,
        loads=loads,
    )


def solve_position(elastic: MeshingPair, angle: float, twist: float) -> Positions:
    """At one."""
    return solve_positions(elastic, [angle], twist)[0]


def nodal(elastic: MeshingPair, position: Positions, angle: float, twist: float):
    """Gear, tooth, undeformed nodes (m) and forces (N) of each loaded flank, as complex numbers in global axes."""
    for gear, loads in enumerate(position.loads):
        for tooth, force in zip(loads.tooth.tolist(), loads.force, strict=True):
            turn = np.exp(1j * elastic.tooth_angle(gear, tooth, angle, twist))
            points = elastic.bodies[gear].flank.points @ [1, 1j]
            yield gear, tooth, turn * points + gear * elastic.wheel_centre, turn * force.view(complex)


def peak_pressure(position: Positions) -> float:
    """Largest pressure (Pa) at the contact points, or on the panels."""
    return float(position.points.pressure.max())
