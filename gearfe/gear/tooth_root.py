"""What a rack leaves at the root of a tooth: the trochoid, the form point and the undercut."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from ..errors import InputError
from .curves import Trochoid, bisect, inv

#: Arcs of a smaller polar angle (rad) are taken for none: below 1e-9 mm on a gear of 1 m radius.
NIL_ANGLE = 1e-12


class Relief(Protocol):
    """Tip relief amount * ((s - s0)/length)^exponent (m, m, -)."""

    @property
    def amount(self) -> float: ...
    @property
    def length(self) -> float: ...
    @property
    def exponent(self) -> float: ...


class ToothForm(Protocol):
    """What of a gear decides its profile; units as in `gearfe.gear.pair.Gear`."""

    @property
    def teeth(self) -> int: ...
    @property
    def module(self) -> float: ...
    @property
    def pressure_angle(self) -> float: ...
    @property
    def profile_shift(self) -> float: ...
    @property
    def addendum(self) -> float: ...
    @property
    def dedendum(self) -> float: ...
    @property
    def rack_tip_radius(self) -> float: ...
    @property
    def tip_round(self) -> float: ...
    @property
    def tip_shortening(self) -> float: ...
    @property
    def tip_relief(self) -> Relief | None: ...
    @property
    def tooth_thinning(self) -> float: ...


def half_tooth_angle(gear: ToothForm) -> float:
    """Half the angular tooth thickness at the reference circle (rad).

    psi = pi/(2z) + 2 x tan(alpha)/z - thinning/(2r).
    """
    z = gear.teeth
    return (
        math.pi / (2 * z)
        + 2.0 * gear.profile_shift * math.tan(gear.pressure_angle) / z
        - gear.tooth_thinning / (z * gear.module)
    )


def largest_rack_tip_radius(gear: ToothForm) -> float:
    """Rack tip radius (times module) at which the land of the rack's tip vanishes; beyond it no such rack exists."""
    alpha = gear.pressure_angle
    land = math.pi / 4 + 0.5 * gear.tooth_thinning / gear.module - gear.dedendum * math.tan(alpha)
    return land * math.cos(alpha) / (1.0 - math.sin(alpha))


def tip_radius(gear: ToothForm) -> float:
    """Tip radius r_a = r + (h_aP + x - k) m (m)."""
    return gear.module * (gear.teeth / 2 + gear.addendum + gear.profile_shift - gear.tip_shortening)


def least_shift(gear: ToothForm) -> float:
    """Profile shift coefficient from which on the rack does not undercut: h_F/m - z sin^2(alpha)/2 (-)."""
    sine = math.sin(gear.pressure_angle)
    return gear.dedendum - gear.rack_tip_radius * (1.0 - sine) - 0.5 * gear.teeth * sine**2


def tooth_root(gear: ToothForm) -> tuple[Trochoid, float, bool]:
    """Trochoid up to the involute, roll length (m) of the form point, and whether it is undercut."""
    m, alpha = gear.module, gear.pressure_angle
    r, rho = 0.5 * m * gear.teeth, gear.rack_tip_radius * m
    depth = gear.dedendum * m - rho
    largest = largest_rack_tip_radius(gear)
    if gear.rack_tip_radius > largest * (1.0 + 1e-12):
        limit = math.floor(1e4 * max(largest, 0.0)) / 1e4
        if largest < 0.0:
            most = (math.pi / 4 + 0.5 * gear.tooth_thinning / m) / math.tan(alpha)
            problem = f"leaves no land at the tip of a rack of this pressure angle: must be < {most:.4g}"
            raise InputError("dedendum", gear.dedendum, problem, "use less dedendum")
        problem = f"exceeds the land of the rack's tip: at this pressure angle and dedendum it must be <= {limit:g}"
        raise InputError("rack_tip_radius", gear.rack_tip_radius, problem, "use a smaller radius or less dedendum")
    offset = max(0.0, math.pi * m / 4 + 0.5 * gear.tooth_thinning - depth * math.tan(alpha) - rho / math.cos(alpha))
    if offset < NIL_ANGLE * r:
        offset = 0.0
    d = depth - gear.profile_shift * m
    whole = Trochoid(r, d, rho, offset, math.pi / gear.teeth, math.pi / 2 - alpha)
    form_roll = r * math.sin(alpha) - (d + rho * math.sin(alpha)) / math.sin(alpha)
    if form_roll >= -NIL_ANGLE * r:
        return whole, max(0.0, form_roll), False
    end, form_roll = _crossing(gear, whole)
    cut = Trochoid(r, d, rho, offset, math.pi / gear.teeth, end)
    if cut.point(np.linspace(0.0, 1.0, 257))[:, 1].min() <= 0.0:
        problem = f"the undercut root cuts the tooth through; there is no undercut from {least_shift(gear):.4g} on"
        raise InputError("profile_shift", gear.profile_shift, problem, "use more profile shift or more teeth")
    return cut, form_roll, True


def _crossing(gear: ToothForm, root: Trochoid) -> tuple[float, float]:
    """Normal angle (rad) and roll length (m) where an undercutting trochoid leaves the tooth through the involute."""
    base = root.reference_radius * math.cos(gear.pressure_angle)
    base_angle = half_tooth_angle(gear) + inv(gear.pressure_angle)

    def radius(g: float) -> float:
        return float(np.hypot(*root.at(np.array(g))))

    def roll(g: float) -> float:
        return math.sqrt(max(0.0, (radius(g) - base) * (radius(g) + base)))

    def outside(g: float) -> float:
        x, y = root.at(np.array(g))
        u = roll(g) / base
        return math.atan2(y, x) - (base_angle - u + math.atan(u))

    lowest = bisect(lambda g: radius(g) - base, 0.0, root.end)
    if outside(lowest) >= 0.0:
        return lowest, roll(lowest)
    scan = np.linspace(lowest, root.end, 65)
    first = next((i for i, g in enumerate(scan) if i and outside(float(g)) >= 0.0), 64)
    end = bisect(outside, float(scan[first - 1]), float(scan[first]))
    return end, roll(end)
