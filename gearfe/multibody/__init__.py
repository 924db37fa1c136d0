"""Multibody dynamics: elements, a system, a consistent start, integrators, a trajectory.

`core` has the contract, the system, the start and the results, `planar` the mechanisms. `series` is the tape with its
compiled loops, `integrators` has Taylor series, collocation and the rule of choice, and `compiled` numba. Begin with
`core.contract`. The names below are the public ones.
"""

from .core.contract import Element, LinearJoint, LocalForce, ModalBlocks, SeriesLaw
from .core.start import Forced, Freedoms, Start, consistent_start, count_freedoms
from .core.steps import Status
from .core.system import System
from .core.trajectory import IntegrationError, Trajectory
from .integrators.integrate import integrate
from .planar.bodies import Body
from .planar.forces import CoordinateSpring, Gravity, Moment, PointForce, SpanFunction, Spring, StateFunction
from .planar.forms import GROUND
from .planar.joints import Distance, Fixed, Hinge, Prescribed, Prismatic, Slot
from .planar.linkage import Linkage
from .planar.quadratic import QuadraticJoint
from .series.timefunctions import TimeFunction, constant, polynomial, sine, smoothed_step

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
