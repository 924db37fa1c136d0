"""Both whole gears for another program: fine teeth where they mesh, coarse ones elsewhere.

Sectors whose recipes differ on the flanks only share the nodes of their cut sides, so fine and coarse ones join.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gearfe.gear.pair import Gear, GearPair
from gearfe.meshing.export import MeshPart
from gearfe.meshing.recipe import sector_recipes
from gearfe.meshing.tooth_sector import SectorMesh, SectorRecipe, sector_mesh
from gearfe.typing import Array

#: Teeth on either side of the line of centres that are fine.
REACH = 1
#: Flank elements of the coarse teeth (modules): nothing touches them.
FLANK = 0.28


@dataclass(frozen=True)
class ContactTask:
    """One position of a gear pair, in millimetres for another program.

    Attributes
    ----------
    pinion, wheel
        Meshes in their places before the twist (m), driving flanks of the fine teeth as boundary ``contact``.
    centre
        Distance of the wheel's centre from the origin (m).
    twist
        Twist of the wheel (rad).
    base_radius
        Of the wheel (m).
    width
        Face width (m).
    """

    pinion: MeshPart
    wheel: MeshPart
    centre: float
    twist: float
    base_radius: float
    width: float

    @property
    def unknowns(self) -> int:
        """Two a node."""
        return 2 * (len(self.pinion.points) + len(self.wheel.points))


def contact_task(pair: GearPair, angle: float, twist: float, coarsen: float) -> ContactTask:
    """The pair at a pinion angle (rad): fine teeth by `coarsen`, the others as coarse as their common sides allow."""
    turned = [angle, -angle * pair.pinion.teeth / pair.wheel.teeth + math.pi + math.pi / pair.wheel.teeth]
    facing = [0.0, math.pi]
    parts = []
    for number, gear in enumerate((pair.pinion, pair.wheel)):
        recipe = sector_recipes(pair, coarsen=coarsen)[number]
        step = 2.0 * math.pi / gear.teeth
        central = round((facing[number] - turned[number]) / step)
        fine = {(central + k) % gear.teeth for k in range(-REACH, REACH + 1)}
        mesh = sector_mesh(gear, recipe)
        part = joined([mesh, _rough(gear, recipe, mesh)], [0 if k in fine else 1 for k in range(gear.teeth)], fine)
        c, s = math.cos(turned[number]), math.sin(turned[number])
        place = np.array([pair.working_centre_distance * number, 0.0])
        parts.append(replace(part, points=part.points @ np.array([[c, s], [-s, c]]) + place))
    width = min(pair.pinion.face_width, pair.wheel.face_width)
    return ContactTask(parts[0], parts[1], pair.working_centre_distance, twist, pair.wheel.base_radius, width)


def _rough(gear: Gear, recipe: SectorRecipe, fine: SectorMesh) -> SectorMesh:
    """The coarsest sector whose sides have the nodes of the fine one."""
    large = max(recipe.flank, FLANK * gear.module)
    for factor in (2.0, 1.5, 1.0):
        made = replace(recipe, flank=large, strip=large, back=factor * recipe.back, root=factor * recipe.root)
        mesh = sector_mesh(gear, made)
        sides = [np.sort(np.hypot(*m.points[m.cut_left].T)) for m in (mesh, fine)]
        if len(sides[0]) == len(sides[1]) and np.allclose(sides[0], sides[1], rtol=0, atol=1e-9 * gear.module):
            return mesh
    return fine


def joined(meshes: list[SectorMesh], kinds: list[int], fine: set[int]) -> MeshPart:
    """Whole gear of turned sectors, tooth k of kind ``kinds[k]``; boundaries ``bore`` and ``contact`` (fine teeth)."""
    teeth = len(kinds)
    points: list[Array] = []
    triangles, bore, contact = [], [], []
    offset = 0
    for k, kind in enumerate(kinds):
        mesh = meshes[kind]
        angle = 2.0 * math.pi * k / teeth
        c, s = math.cos(angle), math.sin(angle)
        points.append(mesh.points @ np.array([[c, s], [-s, c]]))
        triangles.append(mesh.triangles + offset)
        bore.append(mesh.boundaries["bore"] + offset)
        if k in fine:
            contact.append(mesh.contact_edges() + offset)
        offset += len(mesh.points)
    all_points = np.concatenate(points)
    # nodes of neighbouring cut sides coincide: they become one
    key = np.round(all_points / (1e-7 * np.abs(all_points).max())).astype(np.int64)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    inverse = inverse.ravel()
    expected = sum(len(meshes[kind].points) - len(meshes[kind].cut_left) for kind in kinds)
    if len(first) != expected:
        raise ValueError("fine and coarse sectors do not share the nodes of their sides")
    parts = {"bore": inverse[np.concatenate(bore)], "contact": inverse[np.concatenate(contact)]}
    return MeshPart(all_points[first], inverse[np.concatenate(triangles)], parts)
