"""A gear as a solid for CAD: STEP or BREP, through gmsh's OpenCASCADE kernel. Millimetres."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...fem.meshing.session import gmsh_session
from ..geometry.face import NOMINAL, ToothDeviations
from ..geometry.gear_data import Web
from ..geometry.outline import Piece, whole_outline
from ..geometry.pair import Gear

#: Largest turn between sections of a helical solid (rad), and their least number: the faces between them, splines
#: through the sections, are within 1e-5 mm of the helicoids on gears of 100 mm radius.
SECTION_TURN, LEAST_SECTIONS = 0.05, 5


def write_solid(path: Path, gear: Gear, deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL) -> None:
    """Write the gear with its bore or rim over the face width, its middle plane at z = 0, tooth 0 on +x there.

    Tooth 0 of an internal gear is on -x.

    Left and right flanks have their deviations. Spur gears are extruded, helical ones led through turned sections.

    Arcs are arcs, other pieces cubic splines through 49 points of the exact curve (within 1e-5 mm of it).
    """
    with gmsh_session("gear solid") as gmsh:
        occ = gmsh.model.occ
        width = 1e3 * gear.face_width
        teeth = whole_outline(gear, deviations)
        if gear.helical:
            _add_helical(occ, gear, teeth)
        else:
            loop = occ.addCurveLoop(_outline(occ, teeth, -0.5 * width))
            held = occ.addCurveLoop([occ.addCircle(0.0, 0.0, -0.5 * width, 1e3 * gear.held_radius)])
            loops = [held, loop] if gear.internal else [loop, held]
            occ.extrude([(2, occ.addPlaneSurface(loops))], 0.0, 0.0, width)
        if gear.narrow_web is not None:
            _cut_web(occ, gear, gear.narrow_web)
        occ.synchronize()
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        with _without_words():
            gmsh.write(str(path))


@contextmanager
def _without_words() -> Iterator[None]:
    """Send what OpenCASCADE's writer prints past every option of gmsh nowhere."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _add_helical(occ: Any, gear: Gear, teeth: list[list[Piece]]) -> None:
    """Add the solid of a helical gear: through turned sections, less the bore; an internal gear's rim less those."""
    width, rate = 1e3 * gear.face_width, 1e-3 * gear.twist_rate
    count = max(LEAST_SECTIONS, 1 + math.ceil(abs(rate) * width / SECTION_TURN))
    wires = []
    for i in range(count):
        z = width * (i / (count - 1) - 0.5)
        curves = _outline(occ, teeth, z)
        occ.rotate([(1, curve) for curve in curves], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, rate * z)
        wires.append(occ.addWire(curves))
    solid = occ.addThruSections(wires, makeSolid=True, makeRuled=False)
    cylinder = [(3, occ.addCylinder(0.0, 0.0, -0.5 * width, 0.0, 0.0, width, 1e3 * gear.held_radius))]
    sections = [pair for pair in solid if pair[0] == 3]
    occ.cut(*((cylinder, sections) if gear.internal else (sections, cylinder)))


def _cut_web(occ: Any, gear: Gear, web: Web) -> None:
    """Cut the empty rings on both sides of a web out of the gear."""
    half, outer = 0.5e3 * gear.face_width, 1e3 * web.radii[0]
    hub = 1e3 * web.radii[1] if web.radii[1:] else 0.0
    low, high = 1e3 * (web.offset - 0.5 * web.width), 1e3 * (web.offset + 0.5 * web.width)
    gears, rings = occ.getEntities(3), []
    for start, end in ((-half, low), (high, half)):
        if end - start <= 1e-9 * half:
            continue
        # longer than the groove at the open end, so that no skin is left
        begin, length = (start - half, end - start + half) if start < low else (start, end - start + half)
        ring = [(3, occ.addCylinder(0.0, 0.0, begin, 0.0, 0.0, length, outer))]
        if hub:
            ring, _ = occ.cut(ring, [(3, occ.addCylinder(0.0, 0.0, begin, 0.0, 0.0, length, hub))])
        rings += ring
    occ.cut(gears, rings)


def _outline(occ: Any, teeth: list[list[Piece]], z: float) -> list[int]:
    """Curves round the gear, each beginning at the point where the one before ends."""
    pieces = [piece for tooth in teeth for piece in tooth]
    starts = [occ.addPoint(*_placed(piece.points[0], z)) for piece in pieces]
    return [
        _curve(occ, piece, z, start, end)
        for piece, start, end in zip(pieces, starts, [*starts[1:], starts[0]], strict=True)
    ]


def _curve(occ: Any, piece: Piece, z: float, start: int, end: int) -> int:
    if piece.arc is not None:
        return int(occ.addCircleArc(start, occ.addPoint(*_placed(piece.arc[0], z)), end))
    inner = [occ.addPoint(*_placed(point, z)) for point in piece.points[1:-1]]
    return int(occ.addSpline([start, *inner, end]))


def _placed(point: Any, z: float) -> tuple[float, float, float]:
    return 1e3 * float(point[0]), 1e3 * float(point[1]), z
