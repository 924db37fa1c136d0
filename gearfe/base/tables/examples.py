"""Examples that ``gearfe new`` writes out: plain data for the tables of each kind of job."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

from .jobs import NAMED, table_class
from .mechanism import MechanismFile
from .text import table_text

OPTIONAL_KEYS = "Keys behind a # are optional and show their defaults; those without a value have none."

PAIR: dict[str, Any] = {
    "pressure_angle_deg": 25.0,
    "face_width_mm": 10.0,
    "addendum": 1.0,
    "dedendum": 1.25,
    "rack_tip_radius": 0.3,
    "tip_round_mm": 0.1,
    "pinion": {"teeth": 20, "bore_diameter_mm": 10.0, "pitch_diameter_mm": 50.0},
    "wheel": {"teeth": 30, "bore_diameter_mm": 15.0, "pitch_diameter_mm": 75.0},
    "material": {"youngs_modulus_GPa": 200.0, "poisson_ratio": 0.3, "density_kg_per_m3": 7850.0},
}

#: A pair as a drawing has it: module, 20 degrees, tip diameters, and the middles of the tolerances of the span sizes.
DRAWN: dict[str, Any] = {
    "module_mm": 2.5,
    "pressure_angle_deg": 20.0,
    "face_width_mm": 20.0,
    "tip_round_mm": 0.1,
    "centre_distance_mm": 82.5,
    "pinion": {
        "teeth": 23, "profile_shift": 0.3, "bore_diameter_mm": 25.0, "tip_diameter_mm": 64.0,
        "span_teeth": 4, "span_mm": 27.112,
    },
    "wheel": {
        "teeth": 42, "profile_shift": 0.2276, "bore_diameter_mm": 35.0, "tip_diameter_mm": 111.1,
        "span_teeth": 6, "span_mm": 42.414,
    },
    "material": {"youngs_modulus_GPa": 206.0, "poisson_ratio": 0.3, "density_kg_per_m3": 7830.0},
}  # fmt: skip

RELIEFS: dict[str, Any] = {
    "pinion": {"tip_relief_um": 15.0, "tip_relief_length_mm": 2.7},
    "wheel": {"tip_relief_um": 15.0, "tip_relief_length_mm": 2.7},
}

STUDY: dict[str, Any] = {
    "job": "loadmap",
    "design": "sobol",
    "cases": 128,
    "parameters": {
        "microgeometry.pinion.tip_relief_um": {"low": 0.0, "high": 30.0},
        "microgeometry.pinion.tip_relief_length_mm": {"low": 1.0, "high": 4.0},
        "microgeometry.pinion.profile_slope_um": {"mean": 0.0, "standard_deviation": 3.0},
        "microgeometry.wheel.tip_relief_um": {"low": 0.0, "high": 30.0},
    },
    "outputs": {
        "peak_to_peak_um": "torques.transmission_error_peak_to_peak_um[0]",
        "pressure_MPa": "max(peak_pressure_MPa)",
    },
    "limits": {"peak_to_peak_um": {"high": 3.0}},
    "minimise": ["peak_to_peak_um", "pressure_MPa"],
}

TRAIN: dict[str, Any] = {
    "duration_ms": 7.0,
    "step_us": 35.0,
    "shafts": [
        {"name": "drive", "x_mm": 0.0, "length_mm": 82.0, "radius_mm": 10.0, "attachments": ["1", "2"]},
        {"name": "output", "x_mm": 62.5, "length_mm": 82.0, "radius_mm": 10.0, "attachments": ["3", "4"]},
    ],
    "gears": [
        {"name": "pinion", "shaft": "drive", "y_mm": 5.0, "gear": "pinion"},
        {"name": "wheel", "shaft": "output", "y_mm": 5.0, "gear": "wheel"},
    ],
    "meshes": [{"driver": "pinion", "driven": "wheel"}],
    "drive": {"shaft": "drive", "attachment": "1", "speed_rad_per_s": 600.0},
    "loads": [
        {
            "shaft": "output", "attachment": "3", "torque_Nm": 75.0, "ramp_centre_ms": 0.5, "ramp_width_ms": 1.0,
        },
    ],
    "curves": {"mesh_model": "potential"},
    "damping": {"ratio": 0.01},
}  # fmt: skip

HOUSING: dict[str, Any] = {
    "wall_x_mm": [-45.0, 117.5],
    "wall_z_mm": [-72.0, 25.0],
    "inner_gap_mm": 50.0,
    "wall_thickness_mm": [6.0, 4.5],
    "base_thickness_mm": 18.0,
    "shafts": [{"x_mm": 0.0, "bore_radius_mm": 10.0}, {"x_mm": 62.5, "bore_radius_mm": 10.0}],
    "feet": {"length_x_mm": 30.0, "width_y_mm": 22.0, "height_mm": 15.0},
}

#: A two-stage gearbox of three materials, every part by its name.
GEARBOX: dict[str, dict[str, Any]] = {
    "materials": {
        "case_hardened_steel": {"youngs_modulus_GPa": 206.0, "poisson_ratio": 0.3, "density_kg_per_m3": 7830.0},
        "cast_iron": {"youngs_modulus_GPa": 175.0, "poisson_ratio": 0.27, "density_kg_per_m3": 7200.0},
    },
    "gears": {
        "input_pinion": {
            "teeth": 20, "bore_diameter_mm": 20.0, "module_mm": 2.0, "pressure_angle_deg": 20.0, "face_width_mm": 18.0,
            "tip_round_mm": 0.1, "tooth_thinning_um": 40.0, "material": "case_hardened_steel", "shaft": "input",
            "y_mm": 20.0, "microgeometry": {"tip_relief_um": 10.0, "tip_relief_length_mm": 1.5},
        },
        "input_wheel": {
            "teeth": 41, "bore_diameter_mm": 40.0, "module_mm": 2.0, "pressure_angle_deg": 20.0, "face_width_mm": 18.0,
            "tip_round_mm": 0.1, "tooth_thinning_um": 40.0, "material": "cast_iron", "shaft": "intermediate",
            "y_mm": 20.0,
        },
        "output_pinion": {
            "teeth": 18, "bore_diameter_mm": 24.0, "module_mm": 2.5, "pressure_angle_deg": 20.0, "face_width_mm": 25.0,
            "tip_round_mm": 0.1, "tooth_thinning_um": 50.0, "material": "case_hardened_steel",
            "shaft": "intermediate", "y_mm": -15.0,
        },
        "output_wheel": {
            "teeth": 43, "bore_diameter_mm": 60.0, "module_mm": 2.5, "pressure_angle_deg": 20.0, "face_width_mm": 25.0,
            "tip_round_mm": 0.1, "tooth_thinning_um": 50.0, "shaft": "output", "y_mm": -15.0,
        },
    },
    "meshes": {
        "first": {"driver": "input_pinion", "driven": "input_wheel", "stiffness": {"torque_Nm": 60.0}},
        "second": {"driver": "output_pinion", "driven": "output_wheel", "stiffness": {"torque_Nm": 145.0}},
    },
    "shafts": {
        "input": {"x_mm": 0.0, "length_mm": 100.0, "radius_mm": 10.0},
        "intermediate": {"x_mm": 61.0, "length_mm": 100.0, "radius_mm": 12.0},
        "output": {"x_mm": 137.25, "length_mm": 100.0, "radius_mm": 15.0},
    },
    "bearings": {
        name: {
            "shaft": shaft, "y_mm": y, "stiffness_N_per_m": [1e8, 1e8, 1e8], "tilt_stiffness_Nm_per_rad": [2e4, 2e4],
            "damping_N_s_per_m": [200.0, 50.0, 200.0], "tilt_damping_Nm_s_per_rad": [1.0, 1.0],
        }
        for name, shaft, y in (
            ("A", "input", 40.0), ("B", "input", -40.0), ("C", "intermediate", 40.0), ("D", "intermediate", -40.0),
            ("E", "output", 40.0), ("F", "output", -40.0),
        )
    },
}  # fmt: skip

GEARBOX_TRAIN: dict[str, Any] = {
    "housing": "rigid",
    "duration_ms": 10.0,
    "step_us": 20.0,
    "drive": {"shaft": "input", "attachment": "A", "speed_rad_per_s": 150.0},
    "loads": [
        {
            "shaft": "output", "attachment": "E", "torque_Nm": -145.0, "ramp_centre_ms": 1.0, "ramp_width_ms": 2.0,
        },
    ],
    "curves": {"mesh_model": "potential"},
    "damping": {"rayleigh_beta_s": 2e-6},
}  # fmt: skip

#: Optional tables at the end of a gearbox, commented out; they run when the marks are removed.
EXTENSION = """\
# An elastic input shaft: sections along +y, with the total length of the shaft above.
[[shafts.input.sections]]
length_mm = 30.0
outer_diameter_mm = 18.0

[[shafts.input.sections]]
length_mm = 40.0
outer_diameter_mm = 20.0

[[shafts.input.sections]]
length_mm = 30.0
outer_diameter_mm = 18.0

# A motor shaft on ball bearings, coaxial with the input shaft and joined to it by a clutch.
[shafts.motor_shaft]
x_mm = 0.0
y_mm = 85.0

[[shafts.motor_shaft.sections]]
length_mm = 60.0
outer_diameter_mm = 20.0
inner_diameter_mm = 6.0

[bearings.M1]
shaft = "motor_shaft"
y_mm = 65.0
type = "deep_groove_ball"
elements = 8
element_diameter_mm = 7.9
pitch_diameter_mm = 33.5
radial_clearance_um = -4.0               # diametral; negative: preloaded
damping_N_s_per_m = [200.0, 50.0, 200.0]
tilt_damping_Nm_s_per_rad = [1.0, 1.0]

[bearings.M2]
shaft = "motor_shaft"
y_mm = 100.0
type = "deep_groove_ball"
elements = 8
element_diameter_mm = 7.9
pitch_diameter_mm = 33.5
radial_clearance_um = -4.0
damping_N_s_per_m = [200.0, 50.0, 200.0]
tilt_damping_Nm_s_per_rad = [1.0, 1.0]

[couplings.clutch]
shafts = ["motor_shaft", "input"]
stiffness_Nm_per_rad = 3e4
damping_Nm_s_per_rad = 0.5

# The rotor of the motor. To drive it: shaft = "motor_shaft", machine = "motor" in [train.drive], no attachment.
[machines.motor]
shaft = "motor_shaft"
y_mm = 112.0
inertia_kg_m2 = 4e-3
stiffness_Nm_per_rad = 2.5e4
damping_Nm_s_per_rad = 1.5

# A fan in addition to the load of the output shaft: its torque grows with the square of its speed.
[machines.fan]
shaft = "output"
inertia_kg_m2 = 9e-3
stiffness_Nm_per_rad = 4e4
damping_Nm_s_per_rad = 2.0

[[train.loads]]
shaft = "output"
machine = "fan"
torque_over_speed = "-0.02*speed*abs(speed)"
"""

_STAGE_GEAR: dict[str, Any] = {"module_mm": 4.0, "pressure_angle_deg": 20.0, "face_width_mm": 50.0}
_STAGE_MESH: dict[str, Any] = {"mesh_model": "variable_stiffness", "backlash_um": 100.0}

#: A planetary stage with three planets; planets and their meshes are written once.
PLANETARY: dict[str, dict[str, Any]] = {
    "gears": {
        "sun": {"teeth": 17, "bore_diameter_mm": 30.0, **_STAGE_GEAR, "shaft": "sun", "y_mm": 0.0},
        "planet": {"teeth": 22, "bore_diameter_mm": 40.0, **_STAGE_GEAR, "shaft": "planet", "y_mm": 0.0},
        "ring": {
            "teeth": -61, "rim_diameter_mm": 290.0, "addendum": 0.85, **_STAGE_GEAR, "shaft": "ring", "y_mm": 0.0,
        },
    },
    "meshes": {
        "sun_planet": {"driver": "sun", "driven": "planet", **_STAGE_MESH},
        "planet_ring": {"driver": "planet", "driven": "ring", **_STAGE_MESH},
    },
    "shafts": {
        "sun": {"x_mm": 0.0, "length_mm": 120.0, "radius_mm": 15.0},
        "planet": {"x_mm": 78.0, "length_mm": 60.0, "radius_mm": 20.0, "carrier": "arm"},
        "ring": {
            "x_mm": 0.0, "length_mm": 60.0, "radius_mm": 100.0, "mass_kg": 8.0, "polar_inertia_kg_m2": 0.14,
            "transverse_inertia_kg_m2": 0.08, "speed_ratio": 0, "holding_stiffness_Nm_per_rad": 2e7,
        },
        "carrier": {"x_mm": 0.0, "length_mm": 100.0, "radius_mm": 60.0},
    },
    "carriers": {"arm": {"shaft": "carrier", "planets": 3, "pin_stiffness_N_per_m": 4e8}},
    "bearings": {
        name: {
            "shaft": name, "y_mm": y, "stiffness_N_per_m": [across, along, across],
            "tilt_stiffness_Nm_per_rad": [tilts, tilts],
        }
        for name, y, across, along, tilts in (
            ("sun", -50.0, 1e7, 1e8, 1e6), ("ring", 0.0, 1e9, 1e9, 1e7), ("carrier", 40.0, 5e8, 5e8, 5e6),
        )
    },
}  # fmt: skip

PLANETARY_TRAIN: dict[str, Any] = {
    "housing": "rigid",
    "duration_ms": 60.0,
    "step_us": 20.0,
    "drive": {"shaft": "sun", "attachment": "sun", "speed_rad_per_s": 150.0},
    "loads": [
        {
            "shaft": "carrier", "attachment": "carrier", "torque_Nm": -3000.0, "ramp_centre_ms": 4.0,
            "ramp_width_ms": 6.0,
        },
    ],
    "damping": {"rayleigh_beta_s": 2e-6},
}  # fmt: skip

MECHANISM: dict[str, Any] = {
    "title": "Crank and rod",
    "run": {"end_s": 10.0, "step_s": 0.005, "tolerance": 1e-9},
    "ground": {"points_m": {"O": [0.0, 0.0]}},
    "bodies": {
        "crank": {
            "mass_kg": 1.0, "inertia_kg_m2": 1.0 / 12.0, "centre_m": [0.5, 0.0], "angle_deg": 45.0,
            "points_m": {"O": [0.0, 0.0], "A": [1.0, 0.0]},
        },
        "rod": {
            "mass_kg": 1.0, "inertia_kg_m2": 1.0 / 12.0, "centre_m": [0.5, 0.0], "angle_deg": -45.0,
            "position_m": [0.5**0.5, 0.5**0.5], "points_m": {"A": [0.0, 0.0], "B": [1.0, 0.0]},
        },
    },
    "joints": {
        "O": {"type": "hinge", "body": "crank", "point": "O", "to_point": "O"},
        "A": {"type": "hinge", "body": "rod", "point": "A", "to": "crank", "to_point": "A"},
        "B": {"type": "slot", "body": "rod", "point": "B", "to_point": "O", "direction": [1.0, 0.0]},
    },
    "forces": {"gravity": {"type": "gravity", "acceleration_m_per_s2": [0.0, -9.81]}},
    "start": {"velocities": {"vx(rod.B)": -4.0}},
    "outputs": [
        {"name": "crank_angle_rad", "value": "angle(crank)"},
        {"name": "x_B_m", "value": "x(rod.B)"},
    ],
    "paths": [{"body": "rod", "point": "B"}],
}  # fmt: skip

LOADMAP: dict[str, Any] = {"torques_Nm": [20.0, 50.0, 100.0, 200.0], "root_stress": True}

RATING: dict[str, Any] = {
    "torque_driver_Nm": 100.0,
    "speed_rpm": 1500.0,
    "life_h": 20_000.0,
    "application_factor": 1.25,
    "material": "Eh",
    "grade": "MQ",
    "hardness": 720.0,
    "quality": 6,
    "gears": {"wheel": {"quality": 7}},
}

RUNUP: dict[str, Any] = {"speed_start_rad_per_s": 300.0, "speed_stop_rad_per_s": 1200.0, "speeds": 100}

#: Kind, which is the command that runs it except for those of `RUN_BY`
#: -> subject of the file, its tables, and further text of its head.
JOBS: dict[str, tuple[str, dict[str, Mapping[str, Any]], str]] = {
    "stiffness": ("mesh stiffness of a gear pair", {"pair": DRAWN, "stiffness": {"torque_Nm": 200.0}}, ""),
    "loadmap": (
        "a pair with its reliefs over angle and torque: transmission error, load share, root stress",
        {"pair": PAIR, "loadmap": LOADMAP, "microgeometry": RELIEFS},
        "",
    ),
    "rating": (
        "load capacity of a gear pair by ISO 6336: safety factors of flanks and roots",
        {"pair": PAIR | {"face_width_mm": 25.0}, "rating": RATING},
        "",
    ),
    "study": (
        "many microgeometries of a pair: yield, sensitivities",
        {
            "pair": PAIR,
            "stiffness": {"torque_Nm": 100.0, "kinematics": "small"},
            "loadmap": {"torques_Nm": [100.0]},
            "microgeometry": RELIEFS,
            "study": STUDY,
        },
        "",
    ),
    "vibration": (
        "two shafts with a gear pair in a housing",
        {
            "pair": PAIR,
            "stiffness": {"twist_deg": 0.05},
            "train": TRAIN,
            "housing": HOUSING,
            "spectrum": {},
            "modes": {},
            "runup": RUNUP,
        },
        "Over its speed: gearfe runup FILE, gearfe modes FILE. Shafts run along y; speeds and torques are positive "
        "about +y. ",
    ),
    "runup": (
        "steady states of a gear train over its speed: waterfall, orders, critical speeds",
        {"pair": PAIR, "stiffness": {"twist_deg": 0.05}, "train": TRAIN, "housing": HOUSING, "runup": RUNUP},
        "",
    ),
    "gearbox": (
        "a two-stage gearbox: gears, meshes, shafts and bearings by name",
        {
            **GEARBOX,
            "stiffness": {"kinematics": "small"},
            "loadmap": {"torques_Nm": [50.0, 100.0]},
            "train": GEARBOX_TRAIN,
            "modes": {},
            "runup": {"speed_start_rad_per_s": 50.0, "speed_stop_rad_per_s": 400.0, "speeds": 50},
        },
        "Check it first: gearfe gear FILE. Its meshes only: gearfe stiffness FILE, gearfe loadmap FILE (--mesh "
        "NAME: one of them). Over its speed: gearfe runup FILE, gearfe modes FILE. Shafts run along y; speeds and "
        "torques are positive about +y. ",
    ),
    "planetary": (
        "a planetary stage: sun, three planets and a ring",
        {
            **PLANETARY,
            "stiffness": {"torque_Nm": 300.0, "kinematics": "small"},
            "train": PLANETARY_TRAIN,
            "modes": {},
            "runup": {"speed_start_rad_per_s": 40.0, "speed_stop_rad_per_s": 240.0, "speeds": 60},
        },
        "Look at it first: gearfe gear FILE. Over its speed: gearfe runup FILE, gearfe modes FILE. Planets, their "
        "gears and meshes are written once; a ring has a negative number of teeth; speed_ratio = 0 holds a shaft. ",
    ),
    "housing": (
        "an elastic housing: frequencies, modes, reduced body",
        {"housing": HOUSING},
        "Your own mesh instead: gearfe new box.toml. ",
    ),
    "mechanism": ("a planar mechanism: a crank and a rod", {"": MECHANISM}, ""),
}


#: Kinds that another command runs.
RUN_BY = {"gearbox": "vibration", "planetary": "vibration"}


def job_file(kind: str) -> str:
    """Text of an example job file: a kind of `JOBS`."""
    about, tables, more = JOBS[kind]
    seen: set[type] = set()
    run = RUN_BY.get(kind, kind)
    head = f"{about[0].upper()}{about[1:]}. Run it: gearfe {run} FILE --out DIR. {more}{OPTIONAL_KEYS}"
    return (
        textwrap.fill(head, 118, initial_indent="# ", subsequent_indent="# ")
        + "\n\n"
        + "\n".join(
            # a mechanism is one table, the file itself
            _text(name, example, seen)
            for name, example in tables.items()
        )
        + (_commented() if kind == "gearbox" else "")
    )


def _commented() -> str:
    """Further tables behind ##: a single # stands before keys of the tables above."""
    lines = [f"## {line}".rstrip() for line in EXTENSION.splitlines()]
    head = "# Optional tables: remove the ## of those that you need (docs/shafts.md, docs/bearings.md, docs/drives.md)."
    return "\n".join(["", head, *lines, ""])


def _text(name: str, example: Mapping[str, Any], seen: set[type]) -> str:
    """TOML of a table, or of the tables by name that it holds."""
    if name in NAMED:
        return "\n".join(
            table_text(table_class(name), entry, f"{name}.{key}", seen=seen) for key, entry in example.items()
        )
    return table_text(table_class(name) if name else MechanismFile, example, name)
