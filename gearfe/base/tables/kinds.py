"""List the types of joints and forces of a mechanism file, with their classes and the keys of their fields.

And integrators that jobs of mechanisms and of trains may not name any more.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

#: What to write for integrators that exist no more.
GONE_METHODS = {"explicit": 'explicit was removed: leave the method out, or write "implicit"'}


class Kind(NamedTuple):
    """Keys of a type of joint or force."""

    reference: str  # "module:Class"
    fields: Mapping[str, str]  # key of the table -> field of the class
    required: tuple[str, ...] = ()
    needs: Mapping[str, str] = {}  # key that says nothing alone -> the key that it goes with


#: Keys of a prescribed motion, by the unit of its coordinate.
MOTIONS = ("motion_rad", "motion_rad_per_s", "motion_m")
#: Coordinate of a prescribed motion or a spring -> the end of the keys that have its unit.
UNIT_OF = {"angle": "rad", "rate": "rad_per_s", "x": "m", "y": "m"}
#: Types of joints. A new one is a class (`gearfe.multibody.planar.joints` says what it provides), and a line here.
JOINTS: dict[str, Kind] = {
    "hinge": Kind(
        "gearfe.multibody.planar.joints:Hinge", {"body": "a", "to": "b", "point": "point_a", "to_point": "point_b"}
    ),
    "slot": Kind(
        "gearfe.multibody.planar.joints:Slot",
        {"body": "body", "to": "line", "point": "point", "to_point": "origin", "direction": "direction"},
        ("direction",),
    ),
    "prismatic": Kind(
        "gearfe.multibody.planar.joints:Prismatic",
        {
            "body": "body", "to": "line", "point": "point", "to_point": "origin", "direction": "direction",
            "angle_deg": "angle",
        },
        ("direction",),
    ),
    "distance": Kind(
        "gearfe.multibody.planar.joints:Distance",
        {"body": "a", "to": "b", "point": "point_a", "to_point": "point_b", "length_m": "length"},
    ),
    "fixed": Kind("gearfe.multibody.planar.joints:Fixed", {"body": "a", "to": "b"}),
    "gear": Kind(
        "gearfe.multibody.planar.couplings:GearRatio",
        {"body": "a", "to": "b", "ratio": "ratio", "carrier": "carrier"},
        ("ratio",),
    ),
    "belt": Kind(
        "gearfe.multibody.planar.couplings:Belt",
        {
            "body": "a", "to": "b", "radius_m": "radius_a", "to_radius_m": "radius_b", "crossed": "crossed",
            "carrier": "carrier",
        },
        ("radius_m", "to_radius_m"),
    ),
    "rack": Kind(
        "gearfe.multibody.planar.couplings:Rack",
        {
            "body": "a", "to": "b", "point": "point", "direction": "direction", "radius_m": "radius",
            "carrier": "carrier",
        },
        ("radius_m",),
    ),
    "rolling": Kind(
        "gearfe.multibody.planar.joints:Rolling",
        {
            "body": "body", "to": "line", "point": "point", "to_point": "origin", "direction": "direction",
            "radius_m": "radius",
        },
        ("radius_m",),
    ),
    "cam": Kind(
        "gearfe.multibody.planar.couplings:Cam",
        {
            "body": "a", "to": "b", "point": "point", "coordinate": "coordinate", "profile": "profile",
            "carrier": "carrier",
        },
        ("coordinate", "profile"),
    ),
    "prescribed": Kind(
        "gearfe.multibody.planar.joints:Prescribed",
        {
            "body": "body", "to": "relative_to", "point": "point", "to_point": "origin", "coordinate": "coordinate",
            **dict.fromkeys(MOTIONS, "function"),
        },
        ("coordinate",),
    ),
}  # fmt: skip
#: Types of forces, likewise (`gearfe.multibody.planar.forces`).
FORCES: dict[str, Kind] = {
    "gravity": Kind(
        "gearfe.multibody.planar.forces:Gravity", {"acceleration_m_per_s2": "acceleration"}, ("acceleration_m_per_s2",)
    ),
    "spring": Kind(
        "gearfe.multibody.planar.forces:Spring",
        {
            "body": "a", "to": "b", "point": "point_a", "to_point": "point_b", "stiffness_N_per_m": "stiffness",
            "damping_N_s_per_m": "damping", "free_length_m": "free_length", "tension_N": "law",
        },
        ("body",),
        {"free_length_m": "stiffness_N_per_m"},
    ),
    "coordinate_spring": Kind(
        "gearfe.multibody.planar.forces:CoordinateSpring",
        {
            "body": "body", "to": "relative_to", "coordinate": "coordinate",
            "stiffness_N_per_m": "stiffness", "damping_N_s_per_m": "damping", "reference_m": "reference",
            "stiffness_Nm_per_rad": "stiffness", "damping_Nm_s_per_rad": "damping", "reference_rad": "reference",
        },
        ("body", "coordinate"),
        {"reference_m": "stiffness_N_per_m", "reference_rad": "stiffness_Nm_per_rad"},
    ),
    "force": Kind(
        "gearfe.multibody.planar.forces:PointForce",
        {"body": "body", "point": "point", "x_N": "x", "y_N": "y"},
        ("body",),
    ),
    "moment": Kind(
        "gearfe.multibody.planar.forces:Moment",
        {"body": "body", "to": "reaction", "moment_N_m": "function"},
        ("body", "moment_N_m"),
    ),
    "turning_frame": Kind(
        "gearfe.multibody.planar.turning:TurningFrame", {"rate_rad_per_s": "rate"}, ("rate_rad_per_s",)
    ),
}  # fmt: skip
