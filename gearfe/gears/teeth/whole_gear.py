"""A whole gear from its tooth sector: turned copies whose common sides share their nodes.

Sectors whose recipes differ on the flanks only fit each other: some teeth may have fine flanks.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.typing import IntArray
from ...output.exchange.mesh_export import MeshPart
from ..geometry.pair import Gear, GearPair
from .tooth_sector import SectorMesh, SectorRecipe, sector_mesh


@dataclass(frozen=True)
class WholeGear(MeshPart):
    """A whole gear in the frame of its hub, that of tooth 0: triangles tooth by tooth, boundaries of `OUTLINE`.

    Attributes
    ----------
    contact : ndarray of shape (e, 3) for each tooth
        `SectorMesh.contact_edges`.
    numbers : ndarray of shape (s,) for each tooth
        Node of the whole gear for each node of the tooth's sector.
    """

    contact: Sequence[IntArray]
    numbers: Sequence[IntArray]


def whole_gear(mesh: SectorMesh) -> WholeGear:
    """Join `mesh.teeth` turned copies of a sector."""
    return gear_arc(mesh, mesh.teeth)


def gear_arc(mesh: SectorMesh, count: int) -> WholeGear:
    """Join `count` turned copies of a sector, tooth 0 first: an arc of the gear, or the whole gear."""
    return _joined([mesh] * count)


def _joined(sectors: Sequence[SectorMesh]) -> WholeGear:
    """Join these sectors, tooth by tooth: neighbours have the same nodes on their common side.

    Fewer sectors than the gear has teeth are an arc, whose ends stay apart.
    """
    last = len(sectors) - 1 if len(sectors) < sectors[0].teeth else None
    own = [
        np.arange(len(sector.points)) if k == last else np.setdiff1d(np.arange(len(sector.points)), sector.cut_left)
        for k, sector in enumerate(sectors)
    ]
    first = np.cumsum([0, *map(len, own)])
    numbers, points = [np.zeros(len(sector.points), dtype=np.int64) for sector in sectors], []
    for k, (sector, kept) in enumerate(zip(sectors, own, strict=True)):
        numbers[k][kept] = np.arange(first[k], first[k + 1])
        turn = k * sector.pitch
        (x, y), c, s = sector.points[kept].T, math.cos(turn), math.sin(turn)
        points.append(np.stack([c * x - s * y, s * x + c * y], axis=-1))
    for k, sector in enumerate(sectors[:last]):  # the left side of a sector is the right side of the next one
        after = (k + 1) % len(sectors)
        numbers[k][sector.cut_left] = numbers[after][sectors[after].cut_right]
    numbered = list(zip(sectors, numbers, strict=True))
    return WholeGear(
        points=np.concatenate(points),
        triangles=np.concatenate([own[sector.triangles] for sector, own in numbered]),
        boundaries={
            name: np.concatenate([own[sector.boundaries[part]] for sector, own in numbered for part in parts])
            for name, parts in OUTLINE.items()
            if parts[0] in sectors[0].boundaries
        },
        contact=[own[sector.contact_edges()] for sector, own in numbered],
        numbers=numbers,
    )


#: Flank elements of the coarse teeth (modules): nothing touches them.
FLANK = 0.28
#: Boundaries of a gear, each with the pieces that a sector has of it; a gear has a bore or a rim.
OUTLINE = {
    "bore": ("bore",), "rim": ("rim",), "root": ("root_right", "root_left"), "flank_right": ("flank_right",),
    "flank_left": ("flank_left",), "tip": ("tip",),
}  # fmt: skip


def mixed_gear(gear: Gear, recipe: SectorRecipe, fine: Collection[int]) -> WholeGear:
    """Whole gear whose teeth `fine` have the elements of `recipe`, the others the coarsest that fit.

    Parameters
    ----------
    fine
        Numbers of teeth, counter-clockwise from tooth 0 on +x; of an internal gear clockwise from -x.

    Returns
    -------
    WholeGear
        It has one boundary more, ``contact``: the driving flanks of the fine teeth with their tip rounds and the upper
        half of the fillets. Each edge is (root side, middle, tip side).
    """
    mesh, numbered = sector_mesh(gear, recipe), {k % gear.tooth_count for k in fine}
    coarse = mesh if len(numbered) == gear.tooth_count else _coarse(gear, recipe, mesh)
    made = _joined([mesh if k in numbered else coarse for k in range(gear.tooth_count)])
    contact = np.concatenate([made.contact[k] for k in sorted(numbered)])
    return replace(made, boundaries={**made.boundaries, "contact": contact})


def in_mesh(pair: GearPair) -> tuple[float, float]:
    """Angles (rad) of the frames of pinion and wheel teeth that touch in the middle of the path of contact.

    The driving flank is the left one: the wheel's tooth stands half a pitch before the space that faces the pinion's.
    """
    middle = 0.5 * (pair.path["A"].pinion_angle + pair.path["E"].pinion_angle)
    return middle, math.pi - (math.pi / pair.wheel.teeth + middle / pair.gear_ratio)


def teeth_near(gear: Gear, turned: float, towards: float, count: int) -> set[int]:
    """Return the numbers of the teeth nearest to a direction.

    Parameters
    ----------
    gear : Gear
        The gear.
    turned : float
        Angle of tooth 0 (rad).
    towards : float
        The direction (rad).
    count : int
        Number of teeth.
    """
    step = 2.0 * math.pi / gear.teeth
    off = {k: abs(math.remainder(turned + k * step - towards, 2.0 * math.pi)) for k in range(gear.tooth_count)}
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
