"""The outline of one tooth piece by piece, for tables, drawings and solids of other programs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...base.typing import Array
from .curves import Arc, Involute
from .face import NOMINAL, ToothDeviations
from .spur_gear import Gear

#: Rounds of h(s' - h) for a point at s' = s + h(s): each leaves of the last error the flank's slope, at most 0.2.
ROUNDS = 6


@dataclass(frozen=True)
class Piece:
    """A smooth piece of a tooth's outline, counter-clockwise round the gear.

    Attributes
    ----------
    name
        ``root_circle``, ``trochoid``, ``involute``, ``tip_round`` or ``tip``, and the side, as ``involute_left``.
    points, normals : ndarray, shape (n, 2)
        Points (m), even in the curve's parameter, and outward unit normals.
    arc
        Centre (m) and radius (m) of a piece that is a circular arc.
    """

    name: str
    points: Array
    normals: Array
    arc: tuple[tuple[float, float], float] | None


def tooth_outline(gear: Gear, per_piece: int = 48, kinks: Iterable[float] = ()) -> list[Piece]:
    """Outline of tooth 0, whose centreline is +x, from the middle of the space before it to that of the space after it.

    That of an internal gear is on the -x axis, and its outline runs clockwise round the gear, material on the left.

    The flanks hold reliefs and rounds. Pieces end where the curvature jumps, so a spline through the points of one
    piece is smooth. With 48 edges it is within 1e-5 mm of the exact curve. They end at the roll lengths `kinks` (m),
    too.
    """
    left: list[Piece] = []
    for segment in gear.profile.segments:
        breaks = {0.0, *segment.breaks, 1.0}
        if isinstance(flank := segment.curve, Involute):  # its parameter is linear in the roll length
            breaks |= {flank.parameter(s) for s in kinks if flank.start < s < flank.end}
        for low, high in itertools.pairwise(sorted(breaks)):
            # even in the curve's own parameter: an involute curves sharply near its base circle, where its arc length
            # goes with the square of the roll length
            t = np.linspace(low, high, per_piece + 1)
            curve = segment.curve
            place = (curve.centre, abs(curve.radius)) if isinstance(curve, Arc) else None
            left.append(Piece(segment.name, segment.points(t), segment.normals(t), place))
    flip = np.array([1.0, -1.0])
    made = []
    for piece in left:  # the profile runs clockwise towards the tip's middle; its mirror image is the right half
        mirrored = None if piece.arc is None else ((piece.arc[0][0], -piece.arc[0][1]), piece.arc[1])
        made.append(Piece(f"{piece.name}_right", piece.points * flip, piece.normals * flip, mirrored))
    for piece in reversed(left):
        made.append(Piece(f"{piece.name}_left", piece.points[::-1], piece.normals[::-1], piece.arc))
    return made


def whole_outline(
    gear: Gear, deviations: tuple[ToothDeviations, ToothDeviations] = NOMINAL, per_piece: int = 48
) -> list[list[Piece]]:
    """Outline of all teeth in their places, with the deviations of their left and right flanks.

    A deviation h along the normal of an involute at the roll length s gives the point at s + h of the same involute,
    turned about the gear's centre by h/r_b (r_b: base radius). Both normals touch the base circle at one point. A pitch
    error turns the flank, out of its material. Root and tip round turn with the ends of the flank; towards the middles
    of space and tip circle the turn falls to zero.
    """
    curves = [curve for side in deviations for curve in side.profiles if curve is not None]
    kinks = {kink + float(curve.at(kink)[0]) for curve in curves for kink in curve.kinks}
    nominal = tooth_outline(gear, per_piece, kinks)
    half = len(nominal) // 2
    # from the middle of the space to that of the tip circle: right flanks, left ones mirrored
    sides = {"right": nominal[:half], "left": nominal[: half - 1 : -1]}
    made = []
    for tooth in range(gear.tooth_count):
        place = 2.0 * math.pi * tooth / gear.teeth
        halves = {}
        for (name, pieces), sign, own in zip(sides.items(), (-1.0, 1.0), deviations[::-1], strict=True):
            turns = [sign * turn for turn in _turns(gear, pieces, own, tooth)]
            halves[name] = [_turned(piece, place + turn) for piece, turn in zip(pieces, turns, strict=True)]
        made.append([*halves["right"], *reversed(halves["left"])])
    return made


def _turns(gear: Gear, pieces: list[Piece], own: ToothDeviations, tooth: int) -> list[Array]:
    """Turns (rad) that move the points of the left half of a tooth out of its material, root first."""
    profile = own.profiles[int(own.profile_of(np.array(tooth)))]
    made = []
    for piece in pieces:
        roll = gear.sign * np.sqrt(np.maximum((piece.points**2).sum(axis=1) - gear.base_radius**2, 0.0))
        roll = np.clip(roll, gear.profile.form_roll, gear.profile.round_roll)
        height = np.zeros(len(roll))
        if profile is not None:
            for _ in range(ROUNDS):
                height = profile.at(roll - height)[0]
        made.append(gear.sign * (height / gear.base_radius + float(own.turn_of(np.array(tooth)))))
    for end in (0, -1):  # the pieces beside the middles
        angle = np.abs(np.arctan2(*(gear.sign * pieces[end].points.T[::-1])))
        middle = math.pi / gear.tooth_count if end == 0 else 0.0
        away = np.abs(angle - middle)
        made[end] = made[end] * (away / away.max() if away.max() > 0.0 else 1.0)
    return made


def _turned(piece: Piece, angle: Array) -> Piece:
    """A piece whose points are turned about the origin, each by its angle (rad)."""
    turn = np.exp(1j * angle)

    def turned(vectors: Array) -> Array:
        made = (vectors[:, 0] + 1j * vectors[:, 1]) * turn
        return np.column_stack([made.real, made.imag])

    arc = piece.arc
    if arc is not None and arc[0] != (0.0, 0.0):
        centre = complex(*arc[0]) * turn[0]
        arc = ((centre.real, centre.imag), arc[1]) if np.ptp(angle) < 1e-12 else None
    return replace(piece, points=turned(piece.points), normals=turned(piece.normals), arc=arc)


def outline_columns(gear: Gear) -> dict[str, Array]:
    """Columns of a table of the outline: piece, place and radius (mm), outward normal."""
    pieces = tooth_outline(gear)
    points = 1e3 * np.concatenate([piece.points for piece in pieces])
    normals = np.concatenate([piece.normals for piece in pieces])
    return {
        "piece": np.repeat([piece.name for piece in pieces], [len(piece.points) for piece in pieces]),
        "x_mm": points[:, 0],
        "y_mm": points[:, 1],
        "radius_mm": np.hypot(*points.T),
        "normal_x": normals[:, 0],
        "normal_y": normals[:, 1],
    }
