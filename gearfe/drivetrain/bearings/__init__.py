"""Rolling bearings from their inner geometry: contacts of the rolling elements, equilibrium, stiffness.

`BallBearing` and `RollerBearing` describe a bearing. `deflected` returns its forces and stiffness at given
displacements. `carrying` finds the displacements at which it carries a given load.
"""

from .equilibrium import carrying
from .geometry import BallBearing, RollerBearing, Row
from .state import BearingState, deflected

__all__ = ["BallBearing", "BearingState", "RollerBearing", "Row", "carrying", "deflected"]
