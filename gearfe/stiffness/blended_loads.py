"""Forces and pressures of a position that is the mean of two solutions, for its fields."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.scene import MeshingPair, Scene, Window, assemble
from ..contact.solver import Position

Array = NDArray[Any]


def blended_loads(
    elastic: MeshingPair, direct: Position, hertz: Position, share: float, slope: float
) -> dict[str, Any]:
    """s direct + (1 - s) hertz: scene, forces, pressures and stress loads on windows that hold those of both.

    Parameters
    ----------
    direct, hertz
        Solutions at the same angle and twist, with their scenes.
    share, slope
        s (-) and ds/dtwist (1/rad).
    """
    assert direct.scene is not None
    assert hertz.scene is not None
    scene = assemble(elastic, _common_windows(direct.scene, hertz.scene))
    scene = replace(scene, compliance=np.zeros((0, 0)), stress=np.zeros((0, 0)), stress_stress=np.zeros((0, 0)))
    forces = [_on_nodes(scene, p, "forces") for p in (direct, hertz)]
    rates = [_on_nodes(scene, p, "force_rate") for p in (direct, hertz)]
    pressure = [_on_points(scene, p, "pressure") for p in (direct, hertz)]
    # stress loads are the mesh's alone
    loads, load_rate = (_on_points(scene, direct, name) for name in ("stress_loads", "stress_load_rate"))
    return {
        "scene": scene,
        "forces": share * forces[0] + (1 - share) * forces[1],
        "force_rate": share * rates[0] + (1 - share) * rates[1] + slope * (forces[0] - forces[1]),
        "pressure": share * pressure[0] + (1 - share) * pressure[1],
        "stress_loads": share * loads,
        "stress_load_rate": share * load_rate + slope * loads,
    }


def _common_windows(*scenes: Scene) -> list[Window]:
    """For each tooth the smallest window that holds those of all scenes, in couples of pinion and wheel."""
    ranges: dict[tuple[int, int], list[int]] = {}
    seen = {(w.gear, w.tooth): w for scene in scenes for w in scene.windows}
    for scene in scenes:
        for w in scene.windows:
            low, high = ranges.get((w.gear, w.tooth), [w.first_edge, w.first_edge])
            ranges[w.gear, w.tooth] = [min(low, w.first_edge), max(high, w.first_edge + w.edges)]
    made: list[Window] = []
    node = 0
    for number, tooth in enumerate(sorted({t for gear, t in seen if gear == 0})):
        for key in ((0, tooth), (1, -1 - tooth)):
            low, high = ranges[key]
            made.append(Window(key[0], number, key[1], low, high - low, node, seen[key].angle))
            node += 2 * (high - low) + 1
    return made


def _on_nodes(scene: Scene, position: Position, name: str) -> Array:
    """What a position has at the unknowns of its windows, on those of the larger ones."""
    assert position.scene is not None
    values = getattr(position, name)
    made = np.zeros(2 * len(scene.points))
    place = {(w.gear, w.tooth): w for w in scene.windows}
    for w in position.scene.windows:
        into = place[w.gear, w.tooth]
        first = into.unknowns.start + 4 * (w.first_edge - into.first_edge)
        made[first : first + 4 * w.edges + 2] += values[w.unknowns]
    return made


def _on_points(scene: Scene, position: Position, name: str) -> Array:
    """The same at contact points; nothing where the law has none of it."""
    own, values = position.scene, getattr(position, name)
    assert own is not None
    if values is None or len(values) == 0:
        return np.zeros(0)
    made = np.zeros(len(scene.owner))
    place = {(w.gear, w.tooth): (i, w) for i, w in enumerate(scene.windows)}
    for i, w in enumerate(own.windows):
        number, into = place[w.gear, w.tooth]
        mine, points = np.flatnonzero(own.owner == i), np.flatnonzero(scene.owner == number)
        if len(mine) and len(points):
            each = len(mine) // w.edges
            first = each * (w.first_edge - into.first_edge)
            made[points[first : first + len(mine)]] += values[mine]
    return made
