"""From the keys of a bearing to the bearing of a train.

Job files have the directions x, y, z and tilts about x and z. A train whose shafts run along y has its first transverse
direction along x and the second one along -z.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...base.tables.bearing import INNER_OSCULATION, OUTER_OSCULATION, BearingTable, Matrix
from ...base.typing import Array
from ..bearings import BallBearing, RollerBearing, Row
from ..train.gear_train import Bearing, as_matrix

#: Signs from x, y, z, tilts about x and z to the directions of a train, and back.
SIGNS = np.array([1.0, 1.0, -1.0, 1.0, -1.0])


def bearing_of(bore: str, table: BearingTable) -> Bearing:
    """Return the bearing at a bore that a table describes, which is no hinge."""
    damping = table.damping if table.damping_matrix_N_m_s_rad is None else in_frame(table.damping_matrix_N_m_s_rad)
    if table.type is not None:
        return Bearing(bore, rolling_bearing(table), damping)
    if table.stiffness is not None:
        return Bearing(bore, table.stiffness, damping)
    assert table.stiffness_matrix_N_m_rad is not None
    return Bearing(bore, in_frame(table.stiffness_matrix_N_m_rad), damping)


def in_frame(matrix: Matrix | Array) -> Matrix:
    """Return a symmetric matrix of x, y, z in the directions of a train, without the round-off of its digits."""
    values = np.array(matrix, dtype=float) * np.outer(SIGNS, SIGNS)
    size = np.sqrt(np.diag(values))
    size[size == 0.0] = 1.0
    eigenvalues, modes = np.linalg.eigh(0.5 * (values + values.T) / np.outer(size, size))
    if eigenvalues[0] < 0.0:
        values = (modes * np.maximum(eigenvalues, 0.0)) @ modes.T * np.outer(size, size)
    return as_matrix(0.5 * (values + values.T))


def rolling_bearing(table: BearingTable) -> BallBearing | RollerBearing:
    """Return the rolling bearing of a table with a type."""
    diameter, angle = 1e-3 * (table.element_diameter_mm or 0.0), math.radians(table.contact_angle_deg or 0.0)
    shared: dict[str, Any] = {
        "elements": table.elements or 0,
        "diameter": diameter,
        "pitch_diameter": 1e-3 * (table.pitch_diameter_mm or 0.0),
        "contact_angle": angle,
        "clearance": 1e-6 * (table.radial_clearance_um or 0.0),
        "preload": 1e-6 * (table.axial_preload_um or 0.0),
        "rows": _rows(table),
        "first_element": -math.radians(table.first_element_deg or 0.0),
    }
    if table.roller_length_mm is not None:
        more: dict[str, Any] = {} if table.roller_profile is None else {"profile": table.roller_profile}
        ribs = table.axial_stiffness_N_per_m or 0.0
        return RollerBearing(**shared, length=1e-3 * table.roller_length_mm, axial_stiffness=ribs, **more)
    inner = INNER_OSCULATION if table.inner_osculation is None else table.inner_osculation
    outer = OUTER_OSCULATION if table.outer_osculation is None else table.outer_osculation
    return BallBearing(**shared, inner_osculation=inner, outer_osculation=outer)


def _rows(table: BearingTable) -> tuple[Row, ...]:
    """Rows of a bearing; of two back to back the lower one carries along +y."""
    sense = -1 if table.carries == "-y" else 1
    if table.row_distance_mm is None:
        return (Row(0.0, sense),)
    low, high = {"O": (1, -1), "X": (-1, 1)}.get(table.arrangement or "", (sense, sense))
    half = 0.5e-3 * table.row_distance_mm
    return Row(-half, low), Row(half, high)
