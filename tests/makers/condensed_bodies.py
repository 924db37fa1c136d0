"""Two plane bodies on supports at rest as a `MeshingPair`, so that the sweep's own solver presses them together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from gearfe.gears.contact.compliance import GearBody, MeshingPair, turn
from gearfe.gears.contact.elements import solve_elements
from gearfe.gears.contact.flank import flank_of, normal_stress_rows
from gearfe.gears.contact.laws import ContactLaw, PairModel
from gearfe.gears.contact.position import FlankLoads, Positions
from gearfe.gears.contact.whole_gears.bodies import Bodies, ElasticBody

from .contact_problems import chain
from .solving import given_positions

Array = NDArray[Any]

#: Teeth of the two make-believe gears, so far apart that only one pair meets, and their centre distance (m per size).
TEETH, CENTRES = 8, 40.0


def condensed_body(body: ElasticBody, surface: str, held: Mapping[str, tuple[bool, bool]], points: int) -> GearBody:
    """Compliance of the boundary `surface` with some components of other boundaries held at zero."""
    edges = chain(body, surface)
    mesh: Any = SimpleNamespace(
        points=body.points,
        triangles=body.triangles,
        contact_edges=lambda: edges,
        teeth=TEETH,
        boundaries={"flank_left": edges[::-1, ::-1]},
    )
    flank = flank_of(mesh, points)
    bodies = Bodies((body,))
    unknowns = bodies.unknowns[bodies.node_of[0]]  # of each node of the body
    fixed = np.unique(
        np.concatenate(
            [unknowns[np.unique(body.boundaries[n]), axis] for n, axes in held.items() for axis in (0, 1) if axes[axis]]
        )
    )
    free = np.setdiff1d(np.arange(bodies.unknowns.size), fixed)
    surface_unknowns = unknowns[flank.nodes].ravel()
    right = np.zeros((bodies.unknowns.size, len(surface_unknowns)))
    right[surface_unknowns, np.arange(len(surface_unknowns))] = 1.0
    right[fixed] = 0.0
    moved = np.zeros_like(right)
    stiffness = bodies.stiffness.tocsc()
    moved[free] = splu(stiffness[np.ix_(free, free)]).solve(right[free])
    where, rows = normal_stress_rows(mesh, body.material, body.plane, points)
    of_body = unknowns.ravel()  # node unknowns (2 n, 2 n + 1) of the body -> unknowns of the mesh
    stress = np.einsum("eqa,eaf->eqf", rows, moved[of_body[where]]).reshape(-1, len(surface_unknowns))
    none = np.zeros((len(surface_unknowns), 0))
    return GearBody(
        mesh, flank, body.material, body.plane, body.thickness, moved[surface_unknowns], none, np.zeros((TEETH, 0, 0)),
        stress, np.zeros((len(stress), 0)), None, body.thickness,  # type: ignore[arg-type]
    )  # fmt: skip


def turned(body: GearBody, angle: float, shift: Array) -> GearBody:
    """The body in axes turned by `angle` (rad) about a centre at `shift` (m)."""
    axes = turn(angle)
    blocks = np.kron(np.eye(len(body.flank.points)), axes)
    return replace(
        body,
        flank=replace(body.flank, points=(body.flank.points - shift) @ axes),
        own=blocks.T @ body.own @ blocks,
        stress_own=body.stress_own @ blocks,
    )


def tooth_angle(gear: int, tooth: int, angle: float, twist: float) -> float:
    """Of the frames of the bodies, as of the teeth of two gears alike (rad)."""
    return (angle if gear == 0 else np.pi - angle + twist) + (2 * tooth + gear) * np.pi / TEETH


def pressed_pair(lower: GearBody, upper: GearBody, law: ContactLaw, overlap: float) -> MeshingPair:
    """The upper body's top-down surface pressed by `overlap` (m) into the lower one's; both surfaces lie near y = 0.

    The lower body is the pinion's tooth 0, the upper one the wheel's tooth -1, both at pinion angle 0 and twist 0.
    """
    size = float(np.ptp(lower.flank.points[:, 0]))
    left = np.array([float(lower.flank.points[:, 0].min()) - 4.0 * size, 0.0])
    centre = left + np.array([CENTRES * size, 0.0])
    pinion = turned(lower, 0.0, left)
    wheel = turned(upper, np.pi - np.pi / TEETH, centre + np.array([0.0, overlap]))
    apart = CENTRES * size
    gears: Any = SimpleNamespace(working_centre_distance=apart, wheel_centre=apart, sign=1, tooth_angle=tooth_angle)
    return MeshingPair(gears, pinion, wheel, PairModel(law=law))


def pressed(pair: MeshingPair, low: float, high: float, pressure: Callable[[Array], Array]) -> Positions:
    """The pair solved from a guessed pressure (Pa) as a function of x between `low` and `high` (m)."""
    origin, zero = float(pair.pinion.flank.points[:, 0].min()), np.zeros(1, dtype=np.int64)
    loads = []
    for gear, tooth in ((0, 0), (1, -1)):
        flank, axes = pair.bodies[gear].flank, turn(pair.tooth_angle(gear, tooth, 0.0, 0.0))
        x = (flank.points @ axes.T)[:, 0] + gear * pair.wheel_centre - origin
        load = np.where((low < x) & (x < high), pressure(x), 0.0) * np.abs(np.gradient(x)) * pair.width
        force = (2 * gear - 1) * np.stack([0 * load, load], axis=1) @ axes
        loads.append(FlankLoads(zero, zero + tooth, force.reshape(1, -1), force.reshape(1, -1)))
    return solve_elements(pair, given_positions(np.zeros(1), tuple(loads)))[0]
