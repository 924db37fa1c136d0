"""What a position needs for its contact law: where the law is integrated, stress for stress loads, multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .compliance import GearBody
from .flank import Flank, edge_shapes
from .laws import ContactLaw, side_share
from .multiplier import hats_on

if TYPE_CHECKING:
    from .scene import MeshingPair, Window

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


def slave_windows(pair: MeshingPair, windows: Sequence[Window]) -> list[int]:
    """Numbers of the windows that the law is integrated on."""
    if pair.law.sides != "tip":
        return [i for i, w in enumerate(windows) if side_share(pair.law, w.gear) > 0]

    return [i + _bears(pair, windows[i], windows[i + 1]) for i in range(0, len(windows), 2)]


def _bears(pair: MeshingPair, one: Window, two: Window) -> int:
    """Which gear's tip is nearer to the contact, 0 or 1: where the gap opens towards a tip, it is the other's.

    Asked halfway between the tips, as both gears see it: the answer depends on the teeth's places alone, and does not
    change when the gears swap.
    """
    turns, flanks = [np.exp(1j * w.angle) for w in (one, two)], [pair.bodies[w.gear].flank for w in (one, two)]
    tips = [complex(*f.points[-1]) * t for f, t in zip(flanks, turns, strict=True)]
    half = 0.5 * abs(tips[1] + pair.centre_distance - tips[0])
    up, down = (_upwards(f, half) * t for f, t in zip(flanks, turns, strict=True))
    return int((up * np.conj(down)).imag > 0)


def _upwards(flank: Flank, below: float) -> complex:
    """Tangent of a flank towards its tip, `below` metres of arc from there, in the axes of its tooth."""
    ends = np.cumsum(flank.sizes)
    arc = max(0.0, ends[-1] - below)
    edge = int(min(np.searchsorted(ends, arc), flank.edges - 1))
    xi = 1 - (ends[edge] - arc) / flank.sizes[edge]
    return complex(*(edge_shapes(np.array(xi))[1] @ flank.points[2 * edge : 2 * edge + 3]))


def law_data(pair: MeshingPair, windows: Sequence[Window], slaves: list[int]) -> dict[str, Any]:
    """What only some laws ask for: stress for stress loads, the multiplier space."""
    if pair.law.theta:
        return {"theta": pair.law.theta, "stress_stress": _stress_for_stress_loads(pair.bodies, windows, slaves)}
    if pair.law.multiplier:
        edge, xi, vertex = [], [], 0
        for w in (windows[i] for i in slaves):
            shapes = pair.bodies[w.gear].flank.shapes
            if len(shapes) < 3:
                problem = "must be >= 3 with the law exact: it has two multipliers an edge"
                raise InputError("points_per_edge", len(shapes), problem, "4 are usual")
            edge.append(np.repeat(vertex + np.arange(w.edges), len(shapes)))
            xi.append(np.tile(shapes @ [0.0, 0.5, 1.0], w.edges))
            vertex += w.edges + 1
        return {"hats": hats_on(np.concatenate(edge), np.concatenate(xi))}
    return {}


def _stress_for_stress_loads(bodies: Sequence[GearBody], windows: Sequence[Window], slaves: Sequence[int]) -> Array:
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
