r"""Profile modifications of a gear's flanks as deviations: reliefs, crowning, slope, waviness (names of ISO 21771).

All are lengths along the normal over the roll length s. With the form point's :math:`s_F`, the tip circle's :math:`s_a`
and :math:`x = (s - s_0)/(s_1 - s_0)` from where a relief starts to where it has its amount C:

- relief: :math:`-C x` (linear), :math:`-C x^2` (parabolic), a circular arc that leaves the involute tangentially (arc);
  it runs on by the same law beyond :math:`s_1`;
- crowning: :math:`-C \xi^2` with :math:`\xi = -1` at the form point and 1 at the tip circle;
- slope: :math:`\tfrac12 f \xi`;
- waviness: :math:`A \sin(n (s/r_b - 2\pi k/z) + \varphi)` on tooth k: on the path of contact of all pairs, at any time,
  the same phase, n times a turn.

Roll lengths, base radii and numbers of teeth of internal gears are negative.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array
from .deviation import Deviation, total
from .face import ToothDeviations
from .spur_gear import Gear

Shape = Literal["linear", "arc", "parabolic"]
SHAPES: tuple[Shape, ...] = ("linear", "arc", "parabolic")

#: Deviations reach so far beyond form point and tip circle (modules of roll length), where flanks with deviations end.
BEYOND = 0.5
#: Pieces of an arc, and of a wave: cubics then miss it by 1e-8 of its amount, 1e-6 of its amplitude.
ARC, WAVE = 32, 48
#: Steepest flank (-) and largest deviation (modules).
STEEPEST, LARGEST = 0.2, 0.05
#: Places where they are looked for, beside the breaks.
CHECKED = 401
#: Parts of a flank's deviation by the field that they are of, with the amount in it (m), if it has one.
Parts = dict[str, tuple[float | None, Deviation]]


@dataclass(frozen=True)
class Relief:
    """Tip or root relief.

    Attributes
    ----------
    amount
        C (m) > 0 where it has run to `end`.
    start
        Roll length s_0 (m) where it starts.
    shape
        ``linear``, ``arc`` or ``parabolic``.
    end
        Roll length s_1 (m); None: the tip circle of a tip relief, the form circle of a root relief.
    """

    amount: float
    start: float
    shape: Shape = "linear"
    end: float | None = None


@dataclass(frozen=True)
class Waviness:
    """Waviness of all teeth: amplitude A (m), waves n round the gear, phase (rad)."""

    amplitude: float
    waves: int
    phase: float = 0.0


@dataclass(frozen=True)
class FlankModification:
    """Modifications of one side of all teeth of a gear; SI units, see the module.

    Attributes
    ----------
    tip_relief, root_relief
        Or None.
    crowning, slope
        Profile crowning C and profile slope f (m).
    waviness : tuple of Waviness
        Sum.
    extra : tuple of Deviation
        More, of all teeth: K-charts, a measured tooth.
    measured : tuple of Deviation
        One a tooth, or none.
    """

    tip_relief: Relief | None = None
    root_relief: Relief | None = None
    crowning: float = 0.0
    slope: float = 0.0
    waviness: tuple[Waviness, ...] = ()
    extra: tuple[Deviation, ...] = ()
    measured: tuple[Deviation, ...] = ()


def ends_of(gear: Gear) -> tuple[float, float]:
    """Roll lengths (m) of form point and tip circle."""
    return gear.form_roll, gear.profile.tip_roll


def relief(gear: Gear, made: Relief, *, tip: bool) -> Deviation:
    """A tip or root relief.

    Raises
    ------
    InputError
        For one that does not start on the flank.
    """
    low, high = ends_of(gear)
    name = "tip_relief" if tip else "root_relief"
    if made.shape not in SHAPES:
        raise InputError(f"{name}.shape", made.shape, "must be one of " + ", ".join(SHAPES))
    if not (math.isfinite(made.amount) and made.amount >= 0.0):
        raise InputError(f"{name}.amount", made.amount, "must be >= 0", "negative relief is no relief: use points")
    if not low < made.start < high:
        problem = f"leaves the flank: must be > {1e3 * low:.5g} and < {1e3 * high:.5g} mm of roll length"
        raise InputError(f"{name}.start", made.start, problem, "start it between form and tip circle")
    end = (high if tip else low) if made.end is None else made.end
    if not (made.start < end <= high if tip else low <= end < made.start):
        between = (made.start, high) if tip else (low, made.start)
        problem = f"must be between {1e3 * between[0]:.5g} and {1e3 * between[1]:.5g} mm of roll length"
        raise InputError(f"{name}.end", end, problem, "end it between its start and the end of the flank")
    length, beyond = abs(end - made.start), BEYOND * gear.module
    sign = 1.0 if tip else -1.0
    run = np.array([0.0, (high - made.start if tip else made.start - low) + beyond])
    if made.shape == "arc":  # r - sqrt(r^2 - x^2) with the radius r that gives C at the length
        run = np.linspace(0.0, run[1], ARC + 1)
        radius = (length**2 + made.amount**2) / (2 * made.amount) if made.amount else math.inf

    def depth(x: Array) -> tuple[Array, Array]:
        if made.shape == "linear" or made.amount == 0.0:
            return made.amount * x / length, np.full_like(x, made.amount / length)
        if made.shape == "parabolic":
            return made.amount * (x / length) ** 2, 2 * made.amount * x / length**2
        root = np.sqrt(np.maximum(radius**2 - x**2, 0.0))
        return x**2 / (radius + root), x / np.maximum(root, 0.1 * radius)

    def height(s: Array) -> tuple[Array, Array]:
        value, slope = depth(sign * (s - made.start))
        return -value, -sign * slope

    return Deviation.sampled(height, np.sort(made.start + sign * run))


def crowning(gear: Gear, amount: float) -> Deviation:
    """Profile crowning."""
    s, middle, half = _whole(gear)
    return Deviation.sampled(lambda x: (-amount * ((x - middle) / half) ** 2, -2 * amount * (x - middle) / half**2), s)


def slope(gear: Gear, amount: float) -> Deviation:
    """Profile slope deviation: > 0, more material at the tip."""
    s, middle, half = _whole(gear)
    return Deviation.straight(s, 0.5 * amount * (s - middle) / half)


def wave(gear: Gear, made: Waviness, tooth: int) -> Deviation:
    """Waviness on one tooth."""
    s, _, _ = _whole(gear)
    per_length = made.waves / gear.signed_base_radius
    pieces = max(WAVE, math.ceil(WAVE * abs(per_length) * (s[1] - s[0]) / (2 * math.pi)))
    # whole turns do not count: teeth with the same phase have the same profile
    phase = made.phase - 2 * math.pi * ((made.waves * tooth) % gear.teeth) / gear.teeth

    def height(x: Array) -> tuple[Array, Array]:
        angle = per_length * x + phase
        return made.amplitude * np.sin(angle), made.amplitude * per_length * np.cos(angle)

    return Deviation.sampled(height, np.linspace(s[0], s[1], pieces + 1))


def _whole(gear: Gear) -> tuple[Array, float, float]:
    """Ends of a deviation of the whole flank, its middle and half its length (m)."""
    low, high = ends_of(gear)
    beyond = BEYOND * gear.module
    first = low - beyond
    if not gear.internal:
        first = max(0.0, first)
    return np.array([first, high + beyond]), 0.5 * (low + high), 0.5 * (high - low)


def tooth_deviations(gear: Gear, made: FlankModification, turn: Sequence[float] = (0.0,)) -> ToothDeviations:
    """Profiles of all teeth, and their pitch errors as turns (rad), see `gearfe.gears.geometry.pitch_errors`.

    Raises
    ------
    InputError
        For reliefs that overlap, flanks that are too steep or deviate too far, a wrong number of teeth.
    """
    parts: Parts = {}
    tip, root = made.tip_relief, made.root_relief
    if tip is not None:
        parts["tip_relief.amount"] = tip.amount, relief(gear, tip, tip=True)
    if root is not None:
        parts["root_relief.amount"] = root.amount, relief(gear, root, tip=False)
    if tip is not None and root is not None and tip.start < root.start:
        problem = f"overlaps the root relief, which reaches up to {1e3 * root.start:.5g} mm of roll length"
        raise InputError("tip_relief.start", tip.start, problem, "shorten one of the reliefs")
    if made.crowning:
        parts["crowning"] = made.crowning, crowning(gear, made.crowning)
    if made.slope:
        parts["slope"] = made.slope, slope(gear, made.slope)
    parts |= {f"extra[{i}]": (None, one) for i, one in enumerate(made.extra)}
    if made.measured and len(made.measured) != gear.tooth_count:
        problem = f"must be one for each of the {gear.tooth_count} teeth"
        raise InputError("measured", len(made.measured), problem, "give all teeth, or one for all")
    common = total([one for _, one in parts.values()])
    waves = {f"waviness[{i}].amplitude": w for i, w in enumerate(made.waviness) if w.amplitude}
    several = bool(made.measured) or any(w.waves % gear.teeth for w in waves.values())
    profiles: dict[Any, int] = {}
    found: list[Deviation | None] = []
    numbers = []
    for tooth in range(gear.tooth_count if several else 1):
        own = made.measured[tooth] if made.measured else None
        key = (tuple((w.waves * tooth) % gear.teeth for w in waves.values()), own)
        if key not in profiles:
            profiles[key] = len(found)
            more: Parts = {name: (w.amplitude, wave(gear, w, tooth)) for name, w in waves.items()}
            more |= {} if own is None else {f"measured[{tooth}]": (None, own)}
            whole = total([one for one in (common, *(part for _, part in more.values())) if one is not None])
            found.append(_checked(gear, whole, parts | more))
        numbers.append(profiles[key])
    return ToothDeviations(tuple(found), tuple(numbers), tuple(float(one) for one in turn))


def _checked(gear: Gear, made: Deviation | None, parts: Parts) -> Deviation | None:
    """The sum of the parts, where it is no more than microgeometry."""
    if made is None:
        return None
    low, high = ends_of(gear)
    inside = [s for s in made.breaks if low < s < high]
    places = np.concatenate([np.linspace(low, high, CHECKED), inside])

    def refused(order: int, problem: str, cure: str) -> InputError:
        """Of the part that has the most of it, by its field and amount."""
        name = max(parts, key=lambda one: float(np.abs(parts[one][1].at(places)[order]).max()))
        return InputError(name, parts[name][0], problem, cure)

    height, rise = (float(np.abs(one).max()) for one in made.at(places))
    if rise > STEEPEST:
        problem = f"makes the flank too steep: a slope of {rise:.4g}, must be <= {STEEPEST:g}"
        raise refused(1, problem, "use smaller amounts or longer reliefs")
    if height > LARGEST * gear.module:
        problem = (
            f"makes the flank deviate by {1e6 * height:.4g} um, which leaves the range of microgeometry: must be <= "
            f"{1e6 * LARGEST * gear.module:.4g} um, 0.05 module"
        )
        raise refused(0, problem, "larger changes belong into the geometry: tip_relief of [pair]")
    return made
