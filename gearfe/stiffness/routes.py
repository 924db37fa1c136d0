r"""Which way a position is solved: on the mesh, or by the law of small loads where the mesh cannot see the contact.

The half width b of each contact, as `.small_load` predicts it, decides. The mesh errs by a power of h/b, with the
element h of the coarser flank at the contact; what the small-load law leaves out grows with the load, so with the
square of b over the module m. Both are equal at a b that grows with :math:`\sqrt{h\,h_0}`, where :math:`h_0` is the
default element, 0.028 m: the mesh alone from b = `RESOLVED[1]` of it on, the small-load law alone below `RESOLVED[0]`,
and between them their mean with weights that change smoothly. Where several contacts bear, the mean of their widths
decides, weighed by their forces, so that the torque is a smooth function of the twist:

.. math:: T = s\,T_\mathrm{direct} + (1-s)\,T_\mathrm{hertz}, \qquad
          T' = s\,T_\mathrm{direct}' + (1-s)\,T_\mathrm{hertz}' + s'\,(T_\mathrm{direct} - T_\mathrm{hertz}) .
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..contact.compliance import GearBody
from ..contact.elliptic import Chain
from ..contact.hertz import half_width
from ..contact.scene import MeshingPair
from ..contact.solver import Position, solve_positions
from ..errors import InputError
from ..gear.pair import GearPair
from ..gear.touching import Flanks, Touching
from .blended_loads import blended_loads
from .small_balance import Balance, balance, position_of, with_forces
from .small_load import Reference, references

Array = NDArray[Any]
Route = Literal["auto", "direct", "hertz"]

#: Default element of the flank (modules), at which the two routes' errors were weighed.
DEFAULT_ELEMENT = 0.028
#: Half widths of a contact, in units of that length, between which the two routes are blended.
RESOLVED = (0.9, 1.3)
#: Under an edge a contact is narrow whatever it carries: it counts at least this share of what its force would make at
#: the pitch point, so that a heavy load is left to the mesh there as well.
EDGES = 0.5
#: Compliance of a tooth pair times E* w beyond which none is: with it a light load is told without a reference.
SOFTEST = 40.0
#: The same of usual teeth: where it tells that the load is not light, the mesh is asked first, and believed where its
#: forces make a contact so many times as wide as the widest that is blended.
USUAL, CLEARLY = 10.0, 1.1
#: References are made for pairs that touch up to this many times the twist asked for.
SPARE = 1.5


class Router:
    """Solves positions of one pair by the fitting route; keeps the references of its pinion angles.

    Parameters
    ----------
    pair
        Geometry.
    elastic
        The same gears, meshed and condensed.
    route
        ``auto``, or ``direct`` or ``hertz`` for all positions.
    """

    #: Relative accuracy to which torques can be searched for.
    torque_tolerance = 1e-10

    def __init__(self, pair: GearPair, elastic: MeshingPair, route: Route = "auto") -> None:
        if route not in ("auto", "direct", "hertz"):
            raise InputError("route", route, "must be auto, direct or hertz", "auto chooses by the contact's width")
        self.pair, self.elastic, self.route = pair, elastic, route
        self.flanks = Flanks(pair)
        largest = max(_largest(b, f.radii[0]) for b, f in zip(elastic.bodies, self.flanks.faces, strict=True))
        self.length = math.sqrt(largest * DEFAULT_ELEMENT * pair.pinion.module)
        teeth = pair.pinion.teeth, pair.wheel.teeth
        self._modulus = 1 / sum(elastic.contact_compliances)
        self._radius = pair.tangent_length * teeth[0] * teeth[1] / sum(teeth) ** 2  # relative, at the pitch point
        self._chains = [Chain(body) for body in elastic.bodies]
        self._references: dict[float, tuple[float, Reference]] = {}
        self._touching: dict[float, Touching] = {}

    def solve(self, angles: Array, twists: Array, kept: Collection[int] = ()) -> list[Position]:
        """Positions at pinion angles and twists (rad), both of shape (n,).

        Parameters
        ----------
        kept
            Numbers of the positions that need what fields need; the others go without, a scene holds megabytes.
        """
        twists = np.broadcast_to(np.asarray(twists, dtype=float), np.shape(angles))
        if self.route == "direct":
            made = solve_positions(self.elastic, angles, twists)
            return [p if i in kept else bare(p) for i, p in enumerate(made)]
        self._touched(angles)  # all angles in one go
        small, likely = self.light(angles, twists), self.light(angles, twists, USUAL)
        solved: dict[int, Position] = {}
        # most of what may be light is not: the mesh's own forces tell, where they are clear
        first = np.flatnonzero(small & ~likely).tolist()
        if first:
            meshed = solve_positions(self.elastic, np.asarray(angles)[first], twists[first])
            solved = dict(zip(first, meshed, strict=True))
            small[[i for i in first if self._clear(float(angles[i]), solved[i])]] = False
        found: list[Balance | None] = [None] * len(angles)
        share, slope = np.ones(len(angles)), np.zeros(len(angles))
        for i in np.flatnonzero(small):
            reference = self.reference(float(angles[i]), float(twists[i]))
            one = balance(reference, float(twists[i]))
            found[i] = one
            share[i], slope[i] = self.share(reference, one)
        direct = [i for i in np.flatnonzero(share > 0).tolist() if i not in solved]
        if direct:
            meshed = solve_positions(self.elastic, np.asarray(angles)[direct], twists[direct])
            solved |= dict(zip(direct, meshed, strict=True))
        made = []
        for n, (angle, twist) in enumerate(zip(angles, twists, strict=True)):
            joined = self._joined(
                float(angle),
                float(twist),
                solved.get(n) if share[n] > 0 else None,
                found[n],
                share[n],
                slope[n],
                fields=n in kept,
            )
            made.append(joined if n in kept else bare(joined))
        return made

    def _clear(self, angle: float, position: Position) -> bool:
        """Whether the forces that the mesh gives make contacts that are resolved beyond doubt."""
        if position.status != "converged":
            return False
        touching = self._touching[angle]
        forces, widths = np.zeros(len(position.pair_numbers)), np.zeros(len(position.pair_numbers))
        for i, (number, torque) in enumerate(zip(position.pair_numbers, position.pair_torques, strict=True)):
            mine = np.flatnonzero(touching.pair == number)
            if len(mine) != 1:
                return False
            forces[i] = max(0.0, torque / (touching.arm[mine[0], 1] * self.elastic.width))
            curved = float(touching.curvature[mine[0]])
            if math.isfinite(curved) and curved > 0:
                widths[i] = half_width(forces[i], self._modulus, 1 / curved)
        return bool(forces @ self._counted(widths, forces) > CLEARLY * RESOLVED[1] * self.length * forces.sum())

    def _counted(self, widths: Array, forces: Array) -> Array:
        """What half widths (m) of contacts under forces per width (N/m) count as: not less than an edge does."""
        return np.maximum(widths, EDGES * half_width(forces, self._modulus, self._radius))

    def light(self, angles: Array, twists: Array, softest: float = SOFTEST) -> NDArray[np.bool_]:
        """Where the load may be small: where the widest contact that teeth of the compliance `softest` let the rigid
        overlap make, were half of it another pair's, is not resolved.
        """
        if self.route == "hertz":
            return np.ones(len(angles), dtype=bool)
        found = self._touched(angles)
        made = np.ones(len(angles), dtype=bool)
        for i, (angle, twist) in enumerate(zip(angles, twists, strict=True)):
            touching = found[float(angle)]
            if len(touching) == 0:
                continue
            overlap = touching.arm[:, 1] * (twist - touching.twist)
            known = (overlap > 0) & np.isfinite(touching.curvature) & (touching.curvature > 0)
            if not known.any():
                continue
            # another pair may take load off this one; it can at most halve it while both are on the path
            width = np.sqrt(4 * 0.5 * overlap[known] / softest / (math.pi * touching.curvature[known])).max()
            made[i] = width < RESOLVED[1] * self.length
        return made

    def reference(self, angle: float, twist: float) -> Reference:
        """Reference of a pinion angle with all pairs that touch at the twist (rad)."""
        known = self._references.get(angle)
        if known is None or known[0] < twist:
            self._touched(np.array([angle]))
            touching = self._touching[angle]
            reach = SPARE * abs(twist) + 1e-6
            mine = touching.take(np.flatnonzero(touching.twist < reach))
            known = reach, references(self.pair, self.elastic, self.flanks, [mine], [angle], chains=self._chains)[0]
            self._references[angle] = known
        return known[1]

    def touching(self, angles: Array) -> list[Touching]:
        """Of each pinion angle (rad) the tooth pairs whose rigid flanks can meet."""
        found = self._touched(angles)
        return [found[float(angle)] for angle in angles]

    def touching_twists(self, angles: Array) -> Array:
        """Twists (rad) at which the rigid gears just touch."""
        found = self._touched(angles)
        return np.array([found[float(a)].twist.min(initial=math.inf) for a in angles])

    def share(self, reference: Reference, found: Balance) -> tuple[float, float]:
        """Share s of the mesh in the result and ds/dtwist (1/rad), from a balance of that reference."""
        if self.route == "hertz":
            return 0.0, 0.0
        if not found.converged or not (found.force > 0).any():
            return (0.0, 0.0) if found.converged else (1.0, 0.0)
        low, high = RESOLVED
        on, total = np.flatnonzero(found.force > 0), found.force.sum()
        widths = np.array([contact.width for contact in found.contacts if contact is not None])
        each = self._counted(widths, found.force[on] / reference.width)
        each = each / np.sqrt(reference.elements[on] * DEFAULT_ELEMENT * self.pair.pinion.module)
        b = float(found.force[on] @ each) / total
        rate = float(found.rate[on] @ (1.5 * each - b)) / total  # widths grow with the root of the forces
        x = min(1.0, max(0.0, (b - low) / (high - low)))
        return x * x * (3 - 2 * x), 6 * x * (1 - x) * rate / (high - low)

    def _touched(self, angles: Array) -> dict[float, Touching]:
        new = np.array(sorted({float(a) for a in angles} - self._touching.keys()))
        if len(new):
            found = self.flanks.touching(new)
            for number, angle in enumerate(new):
                mine = np.flatnonzero(found.position == number)
                self._touching[float(angle)] = found.take(mine[np.argsort(found.twist[mine], kind="stable")])
        return self._touching

    def _joined(
        self,
        angle: float,
        twist: float,
        direct: Position | None,
        found: Balance | None,
        share: float,
        slope: float,
        *,
        fields: bool,
    ) -> Position:
        if found is None:
            assert direct is not None
            return direct
        reference = self.reference(angle, twist)
        hertz = position_of(reference, found)
        if fields and hertz.status == "converged" and share < 1.0:
            hertz = with_forces(hertz, reference, self.elastic, found, twist)
        if direct is None or (direct.status != "converged" and hertz.status == "converged" and share < 1.0):
            return hertz
        if hertz.status != "converged" or share >= 1.0 or direct.status != "converged":
            return direct
        return blended(self.elastic, direct, hertz, share, slope)


def _largest(body: GearBody, start: float) -> float:
    """Largest edge (m) of the contact surface above the radius at which the working flank starts (m)."""
    radii = np.linalg.norm(body.flank.points[:-1:2], axis=1)
    return float(body.flank.sizes[radii >= start * (1 - 1e-9)].max())


def bare(position: Position) -> Position:
    """The position without what only fields need: a scene holds megabytes."""
    nothing: dict[str, Any] = dict.fromkeys(
        ("scene", "forces", "force_rate", "pressure", "stress_loads", "stress_load_rate")
    )
    return replace(position, **nothing)


def blended(elastic: MeshingPair, direct: Position, hertz: Position, share: float, slope: float) -> Position:
    """s direct + (1 - s) hertz, the forces too: the fields then have the moments. `slope` is ds/dtwist (1/rad)."""
    names = ("torque_wheel", "torque_pinion", "torque_wheel_reaction", "tangent", "peak_pressure")
    mean: dict[str, Any] = {n: share * getattr(direct, n) + (1 - share) * getattr(hertz, n) for n in names}
    mean["tangent"] += slope * (direct.torque_wheel - hertz.torque_wheel)
    numbers = sorted({*direct.pair_numbers, *hertz.pair_numbers})
    torques, variances = np.zeros(len(numbers)), np.zeros(len(numbers))
    for position, weight in ((direct, share), (hertz, 1 - share)):
        each = zip(position.pair_numbers, position.pair_torques, position.pair_widths, strict=True)
        for one, value, width in each:
            torques[numbers.index(one)] += weight * value
            variances[numbers.index(one)] += weight * value * width**2 if value > 0 else 0.0
    made = replace(
        direct,
        **mean,
        pair_numbers=tuple(numbers),
        pair_torques=torques,
        pair_widths=np.sqrt(np.divide(variances, torques, out=np.full(len(numbers), np.nan), where=torques > 0)),
        iterations=direct.iterations + hertz.iterations,
        route="blend",
    )
    if direct.scene is None or hertz.scene is None:
        return bare(made)
    return replace(made, **blended_loads(elastic, direct, hertz, share, slope))
