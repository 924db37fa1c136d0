r"""Pitch errors of a gear: lists, the run-out of its mounting, or drawn at random for a class of ISO 1328-1.

The index deviation :math:`F_j` of tooth j is the distance of its flank from its nominal place along the reference
circle, > 0 out of the material of that flank. It turns the flank by :math:`F_j/r` and moves it along the line of action
by :math:`F_j \cos\alpha`. The single pitch deviations are :math:`f_j = F_j - F_{j-1}`, the cumulative pitch deviation
is the range of F.

**Both sides of a tooth.** A tooth that is displaced by :math:`F_j`, counter-clockwise, has :math:`F_j` on its left
flank and :math:`-F_j` on its right one. Its thickness does not change. With teeth counted counter-clockwise
:math:`f_j > 0` is then a pitch that is too large, on both sides.

**Run-out.** If the axis of cutting is not the axis of rotation, all teeth are displaced by the same vector, of length e
in the direction :math:`\beta`. The radial run-out of ISO 1328-1, the range of a ball's radial places in the tooth
spaces, is :math:`F_r = 2e`. At the reference circle the flanks of tooth j are at :math:`\theta_j \pm \tau`, with
:math:`\theta_j = 2\pi j/z` and :math:`\tau` half the tooth thickness angle. Their normals lie at the pressure angle to
the tangent, both outwards. The vector along these normals, over :math:`\cos\alpha`, is

.. math::
    F_j = \frac{e}{\cos\alpha}\sin(\beta - \theta_j - \tau + \alpha) \text{ (left)}, \quad
    -\frac{e}{\cos\alpha}\sin(\beta - \theta_j + \tau - \alpha) \text{ (right)} :

both sides of a place on the circle have opposite signs and differ in phase by twice the pressure angle. The backlash
varies with the distance of the centres. One value a tooth leaves out that the vector turns while it meets. Teeth of an
internal gear are counted clockwise, its :math:`\theta_j` and :math:`\tau` are negative, and > 0 is towards the next
tooth, as elsewhere.

Tolerances by class are in `gears.geometry.tolerances`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.typing import Array
from .spur_gear import Gear
from .tolerances import tolerances

Value = TypeVar("Value")

#: Sum of single pitch deviations (m) that is rounding of a list in um.
CLOSED = 1e-6


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
    sign, z = gear.sign, gear.tooth_count
    apart = sign * 2.0 * (gear.transverse_pressure_angle - sign * gear.half_thickness_angle)
    return sine(z, amplitude, phase), -sine(z, amplitude, phase + apart)


def sampled(gear: Gear, class_: int, seed: int) -> Array:
    """Index deviations (m) drawn at random, as large as the class allows.

    They are a sine over one rotation with a range of F_pT and a random phase, plus independent errors of the teeth with
    the standard deviation f_pT/4. All are scaled so that neither tolerance is exceeded and one of them is reached. The
    same seed gives the same gear.
    """
    allowed, rng = tolerances(gear, class_), np.random.default_rng(seed)
    made = sine(gear.tooth_count, 0.5 * allowed.cumulative, rng.uniform(0, 2 * math.pi))
    made = made + rng.normal(0.0, 0.25 * allowed.single, gear.tooth_count)
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
    if F.shape != (gear.tooth_count,):
        problem = f"must have one entry for each of the {gear.tooth_count} teeth"
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
    """Return the turns (rad) of the back flanks of displaced teeth from those of their driving flanks. They are in the
    order of the pair seen from the other side, as ``sweep_loads(..., back=...)`` takes them.

    What turns a driving flank out of its material turns the back flank of the same tooth into it.
    """
    return tuple(-turn for turn in seen_from_behind(turns, wheel=wheel))
