"""The rigid core: bodies, joints and forces (data), a system, a consistent start, integrators, a trajectory.

Nothing here knows which mechanism it runs. The component contract is in `gearfe.rigid.contract`.
"""

from .contract import Element, LinearJoint, LocalForce, ModalBlocks, SeriesLaw
from .forces import CoordinateSpring, Gravity, Moment, PointForce, SpanFunction, Spring, StateFunction
from .forms import GROUND
from .integrate import integrate
from .joints import Distance, Fixed, Hinge, Prescribed, Prismatic, Slot
from .linkage import Linkage
from .planar import Body
from .quadratic import QuadraticJoint
from .start import Forced, Freedoms, Start, consistent_start, count_freedoms
from .steps import Status
from .system import System
from .timefunctions import TimeFunction, constant, polynomial, sine, smoothed_step
from .trajectory import IntegrationError, Trajectory

__all__ = [
    "GROUND",
    "Body",
    "CoordinateSpring",
    "Distance",
    "Element",
    "Fixed",
    "Forced",
    "Freedoms",
    "Gravity",
    "Hinge",
    "IntegrationError",
    "LinearJoint",
    "Linkage",
    "LocalForce",
    "ModalBlocks",
    "Moment",
    "PointForce",
    "Prescribed",
    "Prismatic",
    "QuadraticJoint",
    "SeriesLaw",
    "Slot",
    "SpanFunction",
    "Spring",
    "Start",
    "StateFunction",
    "Status",
    "System",
    "TimeFunction",
    "Trajectory",
    "consistent_start",
    "constant",
    "count_freedoms",
    "integrate",
    "polynomial",
    "sine",
    "smoothed_step",
]
