"""Normal stress for stress loads between the contact points of a position, for laws with theta other than 0."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .compliance import GearBody
from .laws import ContactLaw, side_share

if TYPE_CHECKING:
    from .scene import Window

Array = NDArray[Any]


def check_stress_loads(bodies: Sequence[GearBody], law: ContactLaw, width: float) -> None:
    """Raise `InputError` unless the bodies' stiffness has the terms of exactly this law."""
    for gear, body in enumerate(bodies):
        share = side_share(law, gear) if law.theta else 0.0
        has = body.stress_loads
        fits = share == 0.0 if has is None else share > 0 and (has.law, has.width, has.share) == (law, width, share)
        if not fits:
            problem = (
                "the gears' stiffness has no terms of its theta" if has is None else "the gears are made for another"
            )
            raise InputError(
                "law", law, problem, "make the gears with it: gear_body(..., law=law, gear=..., width=...)"
            )


def stress_for_stress_loads(bodies: Sequence[GearBody], windows: Sequence[Window], slaves: Sequence[int]) -> Array:
    """T: normal stress at all contact points for stress loads at them (Pa/(N m2)), shape (q, q)."""
    points, ends = [], [0]
    for i in slaves:
        w = windows[i]
        q = bodies[w.gear].flank.shapes.shape[0]
        points.append(slice(q * w.first_edge, q * (w.first_edge + w.edges)))
        ends.append(ends[-1] + q * w.edges)
    full = np.zeros((ends[-1], ends[-1]))
    for a, i in enumerate(slaves):
        body = bodies[windows[i].gear]
        loads = body.stress_loads
        assert loads is not None
        assert body.far.stress is not None
        for b, j in enumerate(slaves):
            if windows[j].gear != windows[i].gear:
                continue
            block = full[ends[a] : ends[a + 1], ends[b] : ends[b + 1]]
            driven = loads.driven[windows[i].tooth - windows[j].tooth][:, points[b]]
            np.matmul(body.far.stress[points[a]], driven, out=block)
            if i == j:
                block += loads.own[points[a], points[b]]
    return full
