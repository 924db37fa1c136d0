"""Exact transverse profile of an involute gear tooth as a rack cuts it, or a pinion-type cutter an internal gear.

The half profile of a tooth centred on the +x axis runs from the middle of the space (polar angle pi/z) to the tip
centreline (polar angle 0). It has up to five curves: root circle, trochoid, involute, tip round, tip circle. That of an
internal gear is at y > 0 of the -x axis, from which its polar angles count. Names after ISO 21771; the curves
themselves are in `gears.geometry.curves`. What a rack leaves at the root, the trochoid, the form point and the
undercut, stands first.
"""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .curves import Arc, Involute, Root, Segment, Trochoid, bisect, inverse_inv
from .cutter import ring_root
from .deviation import Deviation
from .gear_data import GearData, rounding

#: Arcs of a smaller polar angle (rad) are taken for none: below 1e-9 mm on a gear of 1 m radius.
NIL_ANGLE = 1e-12
#: No tip round of an internal gear is larger (modules).
LARGEST_ROUND = 3.0


def largest_rack_tip_radius(gear: GearData) -> float:
    """Rack tip radius (times normal module) at which the land of the rack's tip vanishes, and with it such racks."""
    alpha = gear.pressure_angle
    land = math.pi / 4 + 0.5 * gear.tooth_thinning / gear.module - gear.dedendum * math.tan(alpha)
    return land * math.cos(alpha) / (1.0 - math.sin(alpha))


def least_shift(gear: GearData) -> float:
    """Profile shift coefficient from which on the rack does not undercut: h_F/m_n - r sin^2(alpha_t)/m_n (-)."""
    height = gear.dedendum - gear.rack_tip_radius * (1.0 - math.sin(gear.pressure_angle))
    return height - gear.reference_modules * math.sin(gear.transverse_pressure_angle) ** 2


def tooth_root(gear: GearData) -> tuple[Trochoid, float, bool]:
    """Trochoid up to the involute, roll length (m) of the form point, and whether it is undercut."""
    m, alpha = gear.module, gear.pressure_angle
    largest = largest_rack_tip_radius(gear)
    r, rho = gear.reference_radius, min(gear.rack_tip_radius, largest) * m
    depth = gear.dedendum * m - rho
    if largest < 0.0 or (gear.rack_tip_radius - largest) * m > rounding(m):
        limit = math.floor(1e4 * max(largest, 0.0)) / 1e4
        if largest < 0.0:
            most = (math.pi / 4 + 0.5 * gear.tooth_thinning / m) / math.tan(alpha)
            problem = "leaves no land at the tip of a rack of this pressure angle"
            raise InputError("dedendum", gear.dedendum, problem, "use less dedendum", ("<", most, ""))
        problem = f"exceeds the land of the rack's tip: at this pressure angle and dedendum it must be <= {limit:g}"
        raise InputError("rack_tip_radius", gear.rack_tip_radius, problem, "use a smaller radius or less dedendum")
    offset = max(0.0, math.pi * m / 4 + 0.5 * gear.tooth_thinning - depth * math.tan(alpha) - rho / math.cos(alpha))
    # from the rack's normal section to its transverse one
    stretch, alpha = 1.0 / math.cos(gear.helix_angle), gear.transverse_pressure_angle
    offset = stretch * offset
    if offset < NIL_ANGLE * r:
        offset = 0.0
    d = depth - gear.profile_shift * m
    whole = Trochoid(r, d, rho, offset, math.pi / gear.teeth, math.pi / 2 - alpha, stretch)
    form_height = d + rho * math.sin(gear.pressure_angle)  # where the rack's straight flank ends below the pitch line
    form_roll = r * math.sin(alpha) - form_height / math.sin(alpha)
    if form_roll >= -NIL_ANGLE * r:
        return whole, max(0.0, form_roll), False
    end, form_roll = _crossing(gear, whole)
    cut = replace(whole, end=end)
    if cut.point(np.linspace(0.0, 1.0, 257)).imag.min() <= 0.0:
        problem = f"the undercut root cuts the tooth through; there is no undercut from {least_shift(gear):.4g} on"
        raise InputError("profile_shift", gear.profile_shift, problem, "use more profile shift or more teeth")
    return cut, form_roll, True


def _crossing(gear: GearData, root: Trochoid) -> tuple[float, float]:
    """Normal angle (rad) and roll length (m) where an undercutting trochoid leaves the tooth through the involute."""
    base, base_angle = gear.base_radius, gear.base_angle

    def radius(g: float) -> float:
        return abs(complex(root.at(np.array(g))))

    def roll(g: float) -> float:
        return gear.roll_length(radius(g))

    def outside(g: float) -> float:
        u = roll(g) / base
        return cmath.phase(root.at(np.array(g))) - (base_angle - u + math.atan(u))

    lowest = bisect(lambda g: radius(g) - base, 0.0, root.end)
    if outside(lowest) >= 0.0:
        return lowest, roll(lowest)
    scan = np.linspace(lowest, root.end, 65)
    first = next((i for i, g in enumerate(scan) if i and outside(float(g)) >= 0.0), 64)
    end = bisect(outside, float(scan[first - 1]), float(scan[first]))
    return end, roll(end)


#: Accuracy of roll lengths (m) that are searched for.
ROLL = 1e-17


@dataclass(frozen=True)
class ToothProfile:
    """Left half of a tooth centred on the +x axis, from the middle of the space to the tip centreline.

    Parameters
    ----------
    segments
        In order root_circle, trochoid (fillet, where an internal gear's form diameter is given), involute, tip_round,
        tip; a piece of zero length is left out.
    flank
        The involute with its relief, from the form point to the start of the tip round.
    root, round_
        The curves before and behind it, or None.
    tip_roll
        Roll length (m) of the tip circle on the unrelieved involute.
    undercut
        True when trochoid and involute cross instead of touching.
    tip_half_angle
        Polar angle (rad) of the flank's end on the tip circle if it were not rounded.
    """

    segments: tuple[Segment, ...]
    flank: Involute
    root: Root | None
    round_: Arc | None
    tip_roll: float
    undercut: bool
    tip_half_angle: float

    @property
    def form_roll(self) -> float:
        """Roll length (m) of the form point, where the involute starts."""
        return self.flank.start

    @property
    def round_roll(self) -> float:
        """Roll length (m) where the tip round starts, and the involute ends."""
        return self.flank.end

    @property
    def relief_roll(self) -> float:
        """Roll length (m) where the relief starts; `tip_roll` without relief."""
        return min(self.flank.relief_start, self.tip_roll)

    def segment(self, name: str) -> Segment:
        """The segment called `name`; KeyError when the profile has none."""
        for segment in self.segments:
            if segment.name == name:
                return segment
        raise KeyError(name)

    def polyline(self, per_segment: int = 40) -> Array:
        """Points (m) of the half profile, equally spaced in arc length on each segment, shape (n, 2)."""
        parts: list[Array] = []
        for segment in self.segments:
            t = segment.parameter_at(np.linspace(0.0, segment.length, per_segment + 1))
            parts.append(segment.points(t)[(1 if parts else 0) :])
        return np.concatenate(parts)


@lru_cache(maxsize=256)
def tooth_profile(gear: GearData) -> ToothProfile:
    """Exact left half profile of a tooth.

    Raises
    ------
    InputError
        When the rack has no land, the tooth is pointed or cut through, or tip round or relief do not fit.
    """
    fillet, land_angle, form_roll, undercut = _root_of(gear)
    flank, tip_roll = _flank(gear, form_roll)
    end_roll = float(flank.roll_at(gear.tip_radius))
    sign = gear.sign
    tip_half_angle = sign * cmath.phase(sign * flank.at(np.array(end_roll)))
    if tip_half_angle <= 0.0:
        peak = gear.base_radius / math.cos(inverse_inv(flank.base_angle))
        problem, limit = "the tooth is pointed below its tip circle", ("<", _addendum_to(gear, peak), "")
        cure = "use less addendum or profile shift, or some tip_shortening"
        raise InputError("addendum", gear.addendum, problem, cure, limit)
    round_roll = _round_start(gear, flank, tip_roll, end_roll)
    flank = replace(flank, end=round_roll)

    pieces: list[tuple[str, Root | Involute]] = []
    space, land, round_ = math.pi / gear.teeth, sign * tip_half_angle, None
    if gear.tip_round > 0.0:
        round_ = _tip_arc(gear, flank)
        land = round_.end_angle
    if land_angle > 0.0:
        pieces.append(("root_circle", Arc((0.0, 0.0), sign * gear.root_radius, space, space - sign * land_angle)))
    if fillet is not None:
        pieces.append(("fillet" if isinstance(fillet, Arc) else "trochoid", fillet))
    pieces.append(("involute", flank))
    if round_ is not None:
        pieces.append(("tip_round", round_))
    if sign * land > NIL_ANGLE:
        pieces.append(("tip", Arc((0.0, 0.0), sign * gear.tip_radius, land, 0.0)))
    return ToothProfile(_joined(pieces), flank, fillet, round_, tip_roll, undercut, tip_half_angle)


def _root_of(gear: GearData) -> tuple[Root | None, float, float, bool]:
    """Curve between root circle and involute, polar angle (rad) of the root circle, roll length (m) of the form point,
    and whether it is undercut."""
    if gear.internal:
        made = ring_root(gear)
        return made.curve, made.land, made.form_roll, False
    root, form_roll, undercut = tooth_root(gear)
    fillet = root if root.radius > 0.0 or root.depth != 0.0 else None
    return fillet, root.offset / root.reference_radius, form_roll, undercut


def _flank(gear: GearData, form_roll: float) -> tuple[Involute, float]:
    """Flank from the form point, end still open, and the roll length (m) of the tip circle."""
    base, base_angle, tip_roll = gear.signed_base_radius, gear.base_angle, gear.roll_length(gear.tip_radius)
    if tip_roll <= form_roll:
        lowest = _addendum_to(gear, math.hypot(base, form_roll))
        problem, cure = "the tip circle lies below the start of the involute", "use more addendum or less dedendum"
        raise InputError("addendum", gear.addendum, problem, cure, (">", lowest, ""))
    flank, relief = Involute(base, base_angle, form_roll, tip_roll), gear.tip_relief
    if relief is None or relief.amount == 0.0:
        return flank, tip_roll
    start = tip_roll - relief.length
    if start < form_roll:
        problem = f"is longer than the flank: must be <= {1e3 * (tip_roll - form_roll):.6g} mm of roll length"
        raise InputError("tip_relief.length", relief.length, problem, "use a shorter relief")
    if relief.amount * relief.exponent > 0.2 * relief.length:
        problem = (
            f"is too steep: must be <= {200.0 * relief.length / relief.exponent:.6g} mm for this length and exponent"
        )
        raise InputError("tip_relief.amount", relief.amount, problem, "use less relief or a longer one")
    flank = replace(flank, amount=relief.amount, relief_start=start, length=relief.length, exponent=relief.exponent)
    return flank, tip_roll


def _round_centre(gear: GearData, flank: Involute, s: float) -> complex:
    at = np.array(s)
    return complex(flank.at(at) - gear.tip_round * flank.normal_at(at))


def _round_start(gear: GearData, flank: Involute, tip_roll: float, end_roll: float) -> float:
    """Roll length (m) where the tip round, tangent to flank and tip circle, begins; the flank's end without one."""
    rho, tip = gear.tip_round, gear.tip_radius
    if rho == 0.0:
        return end_roll
    sign = gear.sign
    inner = tip - sign * rho
    core = (inner - flank.base_radius) * (inner + flank.base_radius)
    start = rho + sign * math.sqrt(core) if core >= 0.0 else -math.inf
    if start <= flank.start:
        problem = f"would begin below the start of the involute: must be < {1e3 * _largest_round(gear, flank):.5g} mm"
        raise InputError("tip_round", rho, problem, "use a smaller tip round")
    if flank.amount > 0.0:
        if flank.relief_start >= start:
            problem = f"lies wholly inside the tip round: must be > {1e3 * (tip_roll - start):.6g} mm of roll length"
            raise InputError("tip_relief.length", flank.length, problem, "use a longer relief or a smaller tip round")
        above = np.nextafter(flank.relief_start, math.inf)
        start = bisect(lambda s: sign * (abs(_round_centre(gear, flank, s)) - inner), float(above), end_roll)
    if sign * cmath.phase(sign * _round_centre(gear, flank, start)) < -NIL_ANGLE:
        limit = 1e3 * _largest_round(gear, flank)
        problem = f"does not fit the tip, the rounds of both flanks overlap: must be < {limit:.5g} mm"
        raise InputError("tip_round", rho, problem, "use a smaller tip round, less addendum or less profile shift")
    return start


def _largest_round(gear: GearData, flank: Involute) -> float:
    """Largest tip round (m) that begins above the form point and leaves a tip land; relief not counted."""
    tip, base, sign = gear.tip_radius, flank.base_radius, gear.sign

    def too_large(rho: float) -> float:
        inner = tip - sign * rho
        roll = sign * math.sqrt((inner - base) * (inner + base))
        land = flank.base_angle - (rho + roll) / base + math.atan(roll / base)
        return 1.0 if sign * land < 0.0 or rho + roll < flank.start else -1.0

    return bisect(too_large, 0.0, LARGEST_ROUND * gear.module if gear.internal else tip - base)


def deviated(gear: GearData, nominal: Involute, deviation: Deviation) -> tuple[Involute, Arc | None]:
    """Flank of a gear with a deviation of micrometres from the nominal one, and the tip round that fits it.

    The flank starts at the same radius and ends on the same tip circle; its round is tangent to both as before.
    """
    tip, rho = gear.tip_radius, gear.tip_round
    flank, reach = replace(nominal, deviation=deviation), 2 * (deviation.most + nominal.amount) + 1e-12
    if abs(flank.start) > reach:  # twice as far as any point moves
        flank = replace(flank, start=float(flank.roll_at(abs(nominal.at(np.array(nominal.start))))))
    if rho == 0.0:
        return replace(flank, end=float(flank.roll_at(tip))), None
    from scipy.optimize import brentq  # only flanks with deviations need it

    slope = float(np.abs(nominal.relief(np.linspace(flank.start, flank.end, 65))[1]).max()) + deviation.steepest
    low, high = (flank.end + way * (reach + 2 * rho * slope) for way in (-1, 1))
    end = brentq(lambda s: abs(_round_centre(gear, flank, s)) - (tip - gear.sign * rho), low, high, xtol=ROLL)
    flank = replace(flank, end=float(end))
    return flank, _tip_arc(gear, flank)


def _addendum_to(gear: GearData, radius: float) -> float:
    """Addendum coefficient with which the tip circle has the given radius (m)."""
    return gear.sign * (radius / gear.module - gear.reference_modules) - gear.profile_shift + gear.tip_shortening


def _tip_arc(gear: GearData, flank: Involute) -> Arc:
    """Tip round from the end of the flank to the tip land, whose half angle has the size of that of its end."""
    centre = _round_centre(gear, flank, flank.end)
    start = cmath.phase(flank.normal_at(np.array(flank.end)))
    return Arc((centre.real, centre.imag), gear.tip_round, start, cmath.phase(gear.sign * centre))


def _joined(pieces: list[tuple[str, Root | Involute]]) -> tuple[Segment, ...]:
    """Segments that share their end points: each inner joint is where the later piece starts."""
    ends = [complex(curve.point(np.array(0.0))) for _, curve in pieces]
    ends.append(complex(pieces[-1][1].point(np.array(1.0))))
    made = []
    for (name, curve), (start, end) in zip(pieces, itertools.pairwise(ends), strict=True):
        kink = curve.parameter(curve.relief_start) if isinstance(curve, Involute) else 0.0
        breaks = (kink,) if 0.0 < kink < 1.0 else ()
        made.append(Segment(name, curve, (start.real, start.imag), (end.real, end.imag), breaks))
    return tuple(made)
