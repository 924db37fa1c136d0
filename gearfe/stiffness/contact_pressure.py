r"""Contact pressure of solved positions: Hertz's on smooth flanks, and apart from it where an edge bears.

A tooth pair that carries the force F over the width w, on flanks of relative curvature :math:`1/\rho` where they touch,
has Hertz's peak pressure (Johnson, *Contact Mechanics*, 1985, eq. 4.45)

.. math:: p_H = \sqrt{\frac{F E^*}{\pi\rho w}} = \frac{2F}{\pi b_H w} .

The computed pressure has a half width b of its own, by its second moment (`gearfe.contact.half_width`), so
:math:`|b/b_H - 1|` tells how far from Hertz's the contact is: the discretisation, flanks whose curvature changes along
the contact, teeth that are no half-planes.

Where the contact reaches an edge of a face, the pressure of linear elasticity has no bound (a sharp tip, the kink where
a linear relief starts, the edge of an undercut), or the radius of a tip round decides it. What stands for it there is

.. math:: p_e = \frac{2F}{\pi w \sqrt{b^2 + \epsilon^2}}, \qquad \epsilon = 0.01\,m,

the peak of a Hertzian contact with the same force and second moment, blunted by a hundredth of a module: a figure to
compare designs with, which neither the mesh nor a contact of some micrometres decides. It is no stress of the material.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.position import Position
from ..contact.scene import MeshingPair
from ..gear.touching import Face, Flanks, Touching

Array = NDArray[Any]

#: What bears besides smooth flanks, by number: nothing; a rounded tip edge; a sharp edge, under which the pressure of
#: linear elasticity is singular.
EDGES = ("none", "rounded", "singular")
_ROUNDED, _SINGULAR = 1, 2
#: Blunting length of edges (modules).
BLUNTING = 0.01

#: Of each position: largest Hertzian pressure of smooth flanks (Pa), its relative error, largest pressure where an edge
#: bears (Pa), both not-a-number where there is none; which edge bears, the place in `EDGES`.
QUANTITIES = ("peak_pressure", "peak_pressure_error", "edge_pressure", "edge")


def contact_pressures(
    elastic: MeshingPair, flanks: Flanks, touching: Sequence[Touching], positions: Sequence[Position]
) -> dict[str, Array]:
    """The `QUANTITIES` of n positions, each of shape (n,).

    Parameters
    ----------
    touching
        Of each position the tooth pairs whose rigid flanks can meet.
    """
    lines = [_Line(face) for face in flanks.faces]
    modulus = 1.0 / sum(elastic.contact_compliances)
    blunting = BLUNTING * flanks.pair.pinion.module
    made = {name: np.full(len(positions), np.nan) for name in QUANTITIES[:3]}
    edge = np.zeros(len(positions), dtype=np.int64)
    for n, (position, met) in enumerate(zip(positions, touching, strict=True)):
        if position.status == "no_contact":
            made["peak_pressure"][n] = made["peak_pressure_error"][n] = 0.0
        if position.status != "converged":
            continue
        for number, torque, width in zip(
            position.pair_numbers, position.pair_torques, position.pair_widths, strict=True
        ):
            here = np.flatnonzero(met.pair == number)
            if torque <= 0 or len(here) == 0:
                continue
            k = int(here[0])
            force = torque / (met.arm[k, 1] * elastic.width)
            bears = max(line.bears(float(u), width) for line, u in zip(lines, met.place[k], strict=True))
            if not math.isfinite(met.curvature[k]):  # it touches at the corner itself, however narrow the contact
                bears = _SINGULAR
            if bears:
                edge[n] = max(edge[n], bears)
                blunted = 2 * force / (math.pi * math.hypot(width, blunting))
                made["edge_pressure"][n] = np.fmax(made["edge_pressure"][n], blunted)
                continue
            hertz = math.sqrt(force * modulus * met.curvature[k] / math.pi)
            if not hertz <= made["peak_pressure"][n]:
                made["peak_pressure"][n] = hertz
                made["peak_pressure_error"][n] = abs(width * math.pi * hertz / (2 * force) - 1)
    return {**made, "edge": edge}


def largest_pressures(curve: Any) -> dict[str, Any]:
    """Largest pressures of a curve's positions (Pa), with the error of the first: what summaries tell."""

    def largest(values: Array) -> float:
        return float(np.nanmax(values)) if np.isfinite(values).any() else math.nan

    path = curve.peak_pressure
    at = int(np.nanargmax(path)) if np.isfinite(path).any() else None
    return {
        "path": largest(path),
        "path_error": math.nan if at is None else float(curve.peak_pressure_error[at]),
        "edge": largest(curve.edge_pressure),
        "singular": int(np.count_nonzero(curve.edge == "singular")),
        "rounded": int(np.count_nonzero(curve.edge == "rounded")),
    }


class _Line:
    """A face by its arc length, with the places of its edges."""

    def __init__(self, face: Face) -> None:
        u = np.concatenate([np.linspace(0.0, 1.0, 257), np.linspace(1.0, face.end, 33)[1:] if face.end > 1.0 else []])
        middle, size = 0.5 * (u[1:] + u[:-1]), np.diff(u)
        self.u, self.arc = u, np.concatenate([[0.0], np.cumsum(face.speeds(middle) * size)])
        sharp = [0.0] if face.fall > 0.0 else []
        sharp += face.kinks.tolist()
        sharp += [face.end] if face.sharp else []
        self.sharp = self.at(np.array(sharp))
        self.round = math.inf if face.sharp else float(self.at(1.0))

    def at(self, u: Any) -> Any:
        """Arc length (m) at parameters u."""
        return np.interp(u, self.u, self.arc)

    def bears(self, u: float, half: float) -> int:
        """Place in `EDGES` of what a contact of the half width `half` (m) about u reaches."""
        s = float(self.at(u))
        if (np.abs(self.sharp - s) <= half).any():
            return _SINGULAR
        return _ROUNDED if s + half > self.round else 0
