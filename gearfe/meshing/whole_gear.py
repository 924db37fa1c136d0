"""A whole gear from its tooth sector: turned copies whose common sides share their nodes.

Sectors whose recipes differ on the flanks only fit each other: some teeth may have fine flanks.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..gear.pair import Gear, GearPair
from ..typing import Array, IntArray
from .export import MeshPart
from .tooth_sector import SectorMesh, SectorRecipe, sector_mesh


@dataclass(frozen=True)
class WholeGear:
    """Second-order triangles of a whole gear in the frame of its hub, which is that of tooth 0.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Node positions (m).
    triangles : ndarray, shape (m, 6)
        Corner nodes counter-clockwise, then the nodes in the middle of edges 01, 12, 20; tooth by tooth.
    boundaries : dict of str to ndarray, shape (k, 3)
        Outline edges (start, middle, end node): ``bore``, ``root``, ``flank_right``, ``flank_left``, ``tip``.
    contact : ndarray, shape (z, e, 3)
        `SectorMesh.contact_edges` of each tooth.
    numbers : ndarray, shape (z, s)
        Node of the whole gear for each tooth and each node of the sector.
    """

    points: Array
    triangles: IntArray
    boundaries: dict[str, IntArray]
    contact: IntArray
    numbers: IntArray


def whole_gear(mesh: SectorMesh) -> WholeGear:
    """Join `mesh.teeth` turned copies of a sector."""
    teeth, size = mesh.teeth, len(mesh.points)
    own = np.ones(size, dtype=bool)
    own[mesh.cut_left] = False
    local = np.cumsum(own) - 1
    count = int(own.sum())
    first = count * np.arange(teeth)
    numbers = first[:, None] + local
    # the left side of a sector is the right side of the next one
    numbers[:, mesh.cut_left] = np.roll(first, -1)[:, None] + local[mesh.cut_right]
    turns = 2 * np.pi * np.arange(teeth) / teeth
    x, y = mesh.points[own].T
    c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]
    points = np.stack([c * x - s * y, s * x + c * y], axis=-1).reshape(-1, 2)
    boundaries = {}
    for name in ("bore", "root", "flank_right", "flank_left", "tip"):
        parts = [mesh.boundaries[key] for key in (name, f"{name}_right", f"{name}_left") if key in mesh.boundaries]
        if parts:
            boundaries[name] = numbers[:, np.concatenate(parts)].reshape(-1, 3)
    contact = numbers[:, mesh.contact_edges()]
    return WholeGear(points, numbers[:, mesh.triangles].reshape(-1, 6), boundaries, contact, numbers)


#: Flank elements of the coarse teeth (modules): nothing touches them.
FLANK = 0.28
#: Boundaries of a gear, each with the pieces that a sector has of it.
OUTLINE = {
    "bore": ("bore",), "root": ("root_right", "root_left"), "flank_right": ("flank_right",),
    "flank_left": ("flank_left",), "tip": ("tip",),
}  # fmt: skip


def mixed_gear(gear: Gear, recipe: SectorRecipe, fine: Collection[int]) -> MeshPart:
    """Whole gear whose teeth `fine` have the elements of `recipe`, the others the coarsest that fit.

    Parameters
    ----------
    fine
        Numbers of teeth, counter-clockwise from tooth 0 on +x.

    Returns
    -------
    MeshPart
        With the boundaries of `OUTLINE` round all teeth, and ``contact``: the driving flanks of the fine teeth with
        their tip rounds and the upper half of the fillets, each edge (root side, middle, tip side).
    """
    mesh = sector_mesh(gear, recipe)
    fine = {k % gear.teeth for k in fine}
    return joined([mesh, _coarse(gear, recipe, mesh)], [0 if k in fine else 1 for k in range(gear.teeth)], fine)


def in_mesh(pair: GearPair) -> tuple[float, float]:
    """Directions (rad) of a pair of teeth, pinion's and wheel's, that touch in the middle of the path of contact.

    The driving flank is the left one: the wheel's tooth stands half a pitch before the space that faces the pinion's.
    """
    middle = 0.5 * (pair.path["A"].pinion_angle + pair.path["E"].pinion_angle)
    return middle, math.pi - (math.pi / pair.wheel.teeth + middle / pair.gear_ratio)


def teeth_near(gear: Gear, turned: float, towards: float, count: int) -> set[int]:
    """Numbers of the `count` teeth nearest to the direction `towards` (rad) when tooth 0 stands at `turned` (rad)."""
    step = 2.0 * math.pi / gear.teeth
    off = {k: abs(math.remainder(turned + k * step - towards, 2.0 * math.pi)) for k in range(gear.teeth)}
    return set(sorted(off, key=lambda k: (round(off[k], 9), k))[:count])


def _coarse(gear: Gear, recipe: SectorRecipe, fine: SectorMesh) -> SectorMesh:
    """The coarsest sector whose sides have the nodes of the fine one."""
    large = max(recipe.flank, FLANK * gear.module)
    for factor in (2.0, 1.5, 1.0):
        made = replace(recipe, flank=large, strip=large, back=factor * recipe.back, root=factor * recipe.root)
        mesh = sector_mesh(gear, made)
        sides = [np.sort(np.hypot(*m.points[m.cut_left].T)) for m in (mesh, fine)]
        if len(sides[0]) == len(sides[1]) and np.allclose(sides[0], sides[1], rtol=0, atol=1e-9 * gear.module):
            return mesh
    return fine


def joined(meshes: Sequence[SectorMesh], kinds: Sequence[int], fine: Collection[int]) -> MeshPart:
    """Whole gear of turned sectors, tooth k of kind ``kinds[k]``, with the boundaries of `mixed_gear`.

    Raises
    ------
    ValueError
        When the sides of the sectors do not have the same nodes.
    """
    points: list[Array] = []
    triangles: list[IntArray] = []
    pieces: dict[str, list[IntArray]] = {name: [] for name in (*OUTLINE, "contact")}
    offset = 0
    for k, kind in enumerate(kinds):
        mesh = meshes[kind]
        angle = 2.0 * math.pi * k / len(kinds)
        c, s = math.cos(angle), math.sin(angle)
        points.append(mesh.points @ np.array([[c, s], [-s, c]]))
        triangles.append(mesh.triangles + offset)
        for name, parts in OUTLINE.items():
            pieces[name] += [mesh.boundaries[part] + offset for part in parts if part in mesh.boundaries]
        if k in fine:
            pieces["contact"].append(mesh.contact_edges() + offset)
        offset += len(mesh.points)
    every = np.concatenate(points)
    # nodes of neighbouring sides coincide: they become one
    key = np.round(every / (1e-7 * np.abs(every).max())).astype(np.int64)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    inverse = inverse.ravel()
    if len(first) != sum(len(meshes[kind].points) - len(meshes[kind].cut_left) for kind in kinds):
        raise ValueError("fine and coarse sectors do not share the nodes of their sides")
    boundaries = {name: inverse[np.concatenate(parts)] for name, parts in pieces.items() if parts}
    return MeshPart(every[first], inverse[np.concatenate(triangles)], boundaries)
