"""What the elastic pair is meant for: gears beyond it are refused, loads beyond it are flagged.

- *Teeth*: 8 and more. Fewer are undercut so far that their flanks end within the path of contact.
- *Rim*: a quarter of a module between bore and root circle, and a bore that holds the gear.
- *Overlap* r_b times twist, by which rigid flanks would overlap along the line of action: up to 0.12 modules. That is
  how far the contact laws were held against each other (0.5 deg of twist of the 20/30 pair, docs/contact_laws.md). Each
  tooth, 2.25 modules high and 1.8 thick at its root, then yields by d = 0.06 modules: as a cantilever it has the strain
  3 t d/(2 h^2), 3 %, there. Steel would not bear it, and linear elasticity is a first order of it. A torque that
  makes twice that by the standard's stiffness is refused.
"""

from __future__ import annotations

from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..typing import Array, IntArray

if TYPE_CHECKING:
    from .pair import GearPair

#: Numbers of teeth.
LEAST_TEETH, MOST_TEETH = 8, 1000
#: Least rim between bore and root circle, times module.
LEAST_RIM = 0.25
#: Least bore, times module: plane elasticity gives a point no stiffness, and a bore of a hundredth tears loose.
LEAST_BORE = 0.05
#: Largest overlap, times module.
MOST_OVERLAP = 0.12
#: Largest yield of a tooth pair (modules) by the standard's stiffness under a given torque.
MOST_YIELD = 0.25


def check_teeth(teeth: Any) -> None:
    """Raise `InputError` for a number of teeth that gears here do not have."""
    if isinstance(teeth, bool) or not isinstance(teeth, Integral) or not LEAST_TEETH <= int(teeth) <= MOST_TEETH:
        problem = f"must be a whole number >= {LEAST_TEETH} and <= {MOST_TEETH}"
        raise InputError("teeth", teeth, problem, "use another number of teeth")


def check_rim(gear: Any) -> None:
    """Raise `InputError` unless a `gearfe.gear.spur_gear.Gear` has a bore that holds it and a rim around it."""
    if gear.root_radius <= LEAST_RIM * gear.module:
        most = gear.teeth / 2 + gear.profile_shift - LEAST_RIM
        problem = f"leaves no material inside the root circle: must be < {most:.6g}"
        raise InputError("dedendum", gear.dedendum, problem, "use less dedendum, more teeth or more profile shift")
    if not gear.bore_diameter >= LEAST_BORE * gear.module:
        problem = f"must be >= {1e3 * LEAST_BORE * gear.module:.6g} mm, {LEAST_BORE:g} module"
        cure = "use a larger bore: the gear is held there, and a point holds nothing"
        raise InputError("bore_diameter", gear.bore_diameter, problem, cure)
    limit = 2.0 * (gear.root_radius - LEAST_RIM * gear.module)
    if not gear.bore_diameter <= limit:
        problem = (
            f"must be <= {1e3 * limit:.6g} mm, so that a rim of {LEAST_RIM:g} module is left inside the root "
            f"circle of {2e3 * gear.root_radius:.6g} mm"
        )
        raise InputError("bore_diameter", gear.bore_diameter, problem, "use a smaller bore")


def overlaps(pair: GearPair, twist: ArrayLike) -> Array:
    """Overlaps (modules) of the rigid flanks at twists (rad) from where they touch."""
    return np.asarray(twist, dtype=float) * pair.wheel.base_radius / pair.pinion.module


def overlap_warnings(pair: GearPair, twist: Array, beyond: IntArray) -> list[str]:
    """What is said of the positions flagged as beyond validity, at twists (rad) from where flanks touch."""
    found = overlaps(pair, twist[beyond == 1])
    if not found.size:
        return []
    reason = (
        f"the flanks overlap by up to {found.max():.3g} modules, beyond the {MOST_OVERLAP:g} that the laws hold for"
    )
    return [f"{found.size} positions are beyond validity (column beyond_validity): {reason}; use less load"]
