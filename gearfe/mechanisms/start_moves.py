"""Compare the start of a run with the poses and positions of the file, which prescribed motions may contradict."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base.tables.kinds import UNIT_OF
from ..multibody import Start
from .model import Mechanism

#: Displacement (rad, or relative to the size of the mechanism) that rounded positions of a drawing may cause.
ROUNDED = 1e-3
#: Angle (rad) after which a body has the same pose.
TURN = 2.0 * math.pi


def contradictions(mechanism: Mechanism, start: Start) -> list[str]:
    """Return a sentence for each prescribed angle or position that the start poses of the file contradict."""
    linkage, system = mechanism.linkage, mechanism.system
    names = list(mechanism.file.joints)
    gaps = system.residual(start.time, system.start_q)
    found = []
    for number, (row, joint) in enumerate(zip(linkage.assembly.rows, linkage.assembly.row_joint, strict=True)):
        table = mechanism.file.joints[names[joint]]
        if row.motion is None or table.type != "prescribed" or table.coordinate == "rate":
            continue
        unit = UNIT_OF[str(table.coordinate)]
        gap = math.remainder(gaps[number], TURN) if unit == "rad" else float(gaps[number])
        if abs(gap) <= ROUNDED * system.row_units[number]:
            continue
        motion = getattr(table, f"motion_{unit}")
        key = f"joints.{names[joint]}.motion_{unit}" + ("" if not isinstance(motion, str | float) else f" = {motion!r}")
        wanted = round(float(row.motion(start.time)), 12)  # without the rounding of a sampled expression
        drawn = wanted + gap
        found.append(
            f"{key}: is {wanted:.6g} {unit} at the start, but the start poses of the file give {drawn:.6g} {unit}."
            f" {moved_line(mechanism, start)}; add {gap:.6g} to the motion, or change the start poses"
        )
    return found


def largest_move(mechanism: Mechanism, start: Start) -> dict[str, Any] | None:
    """Return name, displacement (m) and rotation (rad) of the body that closing the joints moved most.

    None if no body moved by more than `ROUNDED`; whole turns leave the pose as it is.
    """
    size = mechanism.linkage.size
    moved = (start.q - mechanism.system.start_q)[:size]
    moved[2::3] -= TURN * np.round(moved[2::3] / TURN)
    relative = np.abs(moved / mechanism.system.units[:size]).reshape(-1, 3).max(axis=1)
    body = int(relative.argmax())
    if relative[body] <= ROUNDED:
        return None
    x, y, angle = moved[3 * body : 3 * body + 3]
    name = mechanism.linkage.bodies[body].name
    link = next((link for link in mechanism.file.bodies if name.startswith(f"{link}.")), name)
    return {"body": link, "displacement_m": math.hypot(x, y), "rotation_rad": float(angle)}


def moved_line(mechanism: Mechanism, start: Start) -> str:
    """Describe the largest displacement from the start poses; empty if there is none."""
    move = largest_move(mechanism, start)
    if move is None:
        return ""
    turned = f"rotates it by {math.degrees(move['rotation_rad']):.3g} deg"
    return f"Closing the joints moves {move['body']} by {move['displacement_m']:.3g} m and {turned}"
