r"""Pitch errors of a gear: lists, the run-out of its mounting, or drawn at random for a class of ISO 1328-1.

The index deviation :math:`F_j` of tooth j is how far its flank is off its place along the reference circle, > 0: out of
the material of that flank. It turns the flank by :math:`F_j/r` and moves it along the line of action by
:math:`F_j \cos\alpha`. The single pitch deviations are :math:`f_j = F_j - F_{j-1}`, the cumulative pitch deviation is
the range of F.

**Both sides of a tooth.** A tooth that stands off its place by :math:`F_j`, counter-clockwise, has :math:`F_j` on its
left flank and :math:`-F_j` on its right one: it is displaced, not thicker. With teeth counted counter-clockwise
:math:`f_j > 0` is then a pitch that is too large, on both sides.

**Run-out.** Teeth that are cut about an axis off the one they run about are all displaced by the same vector, of length
e in the direction :math:`\beta`; the radial run-out of ISO 1328-1, the range of a ball's radial places in the tooth
spaces, is :math:`F_r = 2e`. At the reference circle the flanks of tooth j stand at :math:`\theta_j \pm \tau`,
:math:`\theta_j = 2\pi j/z`, :math:`\tau` half the tooth thickness angle, and their normals lie at the pressure angle
to the tangent, both outwards. The vector along these normals, over :math:`\cos\alpha`, is

.. math::
    F_j = \frac{e}{\cos\alpha}\sin(\beta - \theta_j - \tau + \alpha) \text{ (left)}, \quad
    -\frac{e}{\cos\alpha}\sin(\beta - \theta_j + \tau - \alpha) \text{ (right)} :

both sides of a place on the circle differ in phase by twice the pressure angle, besides the opposite sign, and the
backlash varies with the distance of the centres. One value a tooth leaves out that the vector turns while it meets.

Tolerances in um (ISO 1328-1:2013, 5.3, formulae 5 to 9), for the diameter d and the module m in mm and class A:

.. math::
    f_{pT} = (0.001\,d + 0.4\,m + 5)\,\sqrt2^{\,A-5}, \quad
    F_{pT} = (0.002\,d + 0.55\sqrt{d} + 0.7\,m + 12)\,\sqrt2^{\,A-5}, \\
    f_{H\alpha T} = (0.001\,d + 0.4\,m + 4)\,\sqrt2^{\,A-5}, \quad
    f_{f\alpha T} = (0.55\,m + 5)\,\sqrt2^{\,A-5}, \quad
    F_{\alpha T} = \sqrt{f_{H\alpha T}^2 + f_{f\alpha T}^2} .

and of the helix, for the face width b in mm,
:math:`f_{H\beta T} = (0.05\sqrt d + 0.35\sqrt b + 4)\,\sqrt2^{\,A-5}`. They hold for 5 to 1000 teeth, d from 5 to
15,000 mm, m from 0.5 to 70 mm, b from 4 to 1200 mm, and are not extrapolated (5.2.1).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.typing import Array
from .spur_gear import Gear

Value = TypeVar("Value")

#: Classes of the standard.
CLASSES = (1, 11)
#: Teeth, diameters (mm) and modules (mm) that it is for.
SCOPE = ((5, 1000), (5.0, 15_000.0), (0.5, 70.0))
#: Face widths (mm) that its tolerances of the helix are for.
WIDTHS = (4.0, 1200.0)
#: Sum of single pitch deviations (m) that is rounding of a list in um.
CLOSED = 1e-6


@dataclass(frozen=True)
class PitchTolerances:
    """Tolerances of a class, not rounded (m): single and cumulative pitch; slope, form and whole of the profile."""

    single: float
    cumulative: float
    slope: float
    form: float

    @property
    def total(self) -> float:
        """Of the whole profile (m)."""
        return math.hypot(self.slope, self.form)

    @property
    def rounded_um(self) -> dict[str, float]:
        """All of them by the standard's names, rounded by its rules (5.2.3), in um."""
        named = {
            "f_pT": self.single,
            "F_pT": self.cumulative,
            "f_HalphaT": self.slope,
            "f_falphaT": self.form,
            "F_alphaT": self.total,
        }
        return {name: rounded(1e6 * value) for name, value in named.items()}


def rounded(value: float) -> float:
    """A tolerance (um) rounded by the rules of the standard (5.2.3): to 1 above 10, to 0.5 from 5 on, to 0.1 below."""
    step = 1.0 if value > 10 else 0.5 if value >= 5 else 0.1
    return round(math.floor(value / step + 0.5 + 1e-9) * step, 1)


def tolerances(gear: Gear, class_: int) -> PitchTolerances:
    """Tolerances of a gear in a class of ISO 1328-1.

    Raises
    ------
    InputError
        For a class or a gear that the standard does not have.
    """
    if not CLASSES[0] <= class_ <= CLASSES[1]:
        raise InputError("class", class_, f"must be {CLASSES[0]} to {CLASSES[1]}", "5 to 8 are usual")
    d, m, step = 1e3 * gear.pitch_diameter, 1e3 * gear.module, 1e-6 * math.sqrt(2.0) ** (class_ - 5)
    given = {"teeth": gear.teeth, "pitch_diameter_mm": d, "module_mm": m}
    for (name, value), (low, high) in zip(given.items(), SCOPE, strict=True):
        if not low * (1 - 1e-12) <= value <= high * (1 + 1e-12):
            problem = f"must be {low:g} to {high:g} for a class of ISO 1328-1: its formulas are not extrapolated"
            raise InputError(name, value, problem, "give the deviations themselves")
    return PitchTolerances(
        single=(0.001 * d + 0.4 * m + 5) * step,
        cumulative=(0.002 * d + 0.55 * math.sqrt(d) + 0.7 * m + 12) * step,
        slope=(0.001 * d + 0.4 * m + 4) * step,
        form=(0.55 * m + 5) * step,
    )


def helix_slope_tolerance(gear: Gear, class_: int) -> float:
    """Tolerance f_HbetaT (m) of the helix slope of a gear in a class of ISO 1328-1.

    Raises
    ------
    InputError
        For a class or a gear that the standard does not have.
    """
    tolerances(gear, class_)  # refuses what it does not have
    d, b = 1e3 * gear.pitch_diameter, 1e3 * gear.face_width
    if not WIDTHS[0] * (1 - 1e-12) <= b <= WIDTHS[1] * (1 + 1e-12):
        problem = f"must be {WIDTHS[0]:g} to {WIDTHS[1]:g} for a class of ISO 1328-1: its formulas are not extrapolated"
        raise InputError("face_width_mm", b, problem, "give the deviation itself")
    return 1e-6 * math.sqrt(2.0) ** (class_ - 5) * (0.05 * math.sqrt(d) + 0.35 * math.sqrt(b) + 4)


def from_single(single: ArrayLike) -> Array:
    """Index deviations (m) of single pitch deviations f_j (m), tooth 0 on its place.

    Raises
    ------
    InputError
        When they do not add up to nothing round the gear.
    """
    f = np.asarray(single, dtype=float)
    left = float(f.sum())
    if abs(left) > CLOSED:
        problem = f"must add up to 0 round the gear, within {1e6 * CLOSED:g} um: the sum is {1e6 * left:.4g} um"
        raise InputError("single_pitch_um", None, problem, "subtract their mean")
    f = f - left / len(f)
    return np.cumsum(f) - f[0]


def sine(teeth: int, amplitude: float, phase: float = 0.0) -> Array:
    """Index deviations (m) of a run-out: amplitude sin(2 pi j/z + phase)."""
    return amplitude * np.sin(2 * math.pi * np.arange(teeth) / teeth + phase)


def run_out(gear: Gear, amplitude: float, phase: float = 0.0) -> tuple[Array, Array]:
    """Index deviations (m) of left and right flanks of teeth cut off the axis by amplitude cos(alpha_t).

    `amplitude` (m) is that of the index deviations, amplitude sin(2 pi j/z + phase) on the left flanks.
    """
    apart = 2.0 * (gear.transverse_pressure_angle - gear.half_thickness_angle)
    return sine(gear.teeth, amplitude, phase), -sine(gear.teeth, amplitude, phase + apart)


def sampled(gear: Gear, class_: int, seed: int) -> Array:
    """Index deviations (m) drawn at random, as large as the class allows.

    A sine of one turn with a range of F_pT and a random phase, and independent errors of the teeth of standard
    deviation f_pT/4; then all scaled so that neither tolerance is exceeded and one of them is reached. The same seed
    gives the same gear.
    """
    allowed, rng = tolerances(gear, class_), np.random.default_rng(seed)
    made = sine(gear.teeth, 0.5 * allowed.cumulative, rng.uniform(0, 2 * math.pi))
    made = made + rng.normal(0.0, 0.25 * allowed.single, gear.teeth)
    worst = max(np.ptp(made) / allowed.cumulative, np.abs(single_of(made)).max() / allowed.single)
    return np.asarray(made / worst)


def single_of(index: ArrayLike) -> Array:
    """Single pitch deviations f_j = F_j - F_(j-1) (m)."""
    F = np.asarray(index, dtype=float)
    return F - np.roll(F, 1)


def turns(gear: Gear, index: Sequence[float] | Array) -> tuple[float, ...]:
    """Turns (rad) of the flanks with index deviations (m), one a tooth.

    Raises
    ------
    InputError
        For a list of the wrong length, or numbers that are none.
    """
    F = np.asarray(index, dtype=float)
    if F.shape != (gear.teeth,):
        problem = f"must have one entry for each of the {gear.teeth} teeth"
        raise InputError("pitch errors", len(F), problem, "give as many as the gear has teeth")
    if not (np.isfinite(F).all() and np.ptp(F) <= 0.1 * gear.module):
        most = f"{1e6 * 0.1 * gear.module:.4g} um, a tenth of the module, of each other"
        problem = f"span {1e6 * np.ptp(F):.4g} um: must be finite and within {most}"
        raise InputError("pitch errors", None, problem, "are they in um?")
    return tuple((F / gear.reference_radius).tolist())


def seen_from_behind(values: Sequence[Value], *, wheel: bool = False) -> tuple[Value, ...]:
    """Values of all teeth in the order of the pair seen from the other side: j becomes -j, on the wheel -1 - j."""
    return tuple(values[(-j - wheel) % len(values)] for j in range(len(values)))


def back_turns(turns: Sequence[float], *, wheel: bool = False) -> tuple[float, ...]:
    """Turns (rad) of the back flanks of displaced teeth from those of their driving flanks, in the order of the pair
    seen from the other side, as ``sweep_loads(..., back=...)`` takes them.

    What turns a driving flank out of its material turns the back flank of the same tooth into it.
    """
    return tuple(-turn for turn in seen_from_behind(turns, wheel=wheel))
