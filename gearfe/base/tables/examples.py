"""Examples that ``gearfe new`` writes out: plain data for the tables of each kind of job."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

from .jobs import table_class
from .mechanism import MechanismFile
from .text import table_text

OPTIONAL_KEYS = "Keys behind a # are optional and stand with their defaults; those that are not set have none."

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

STIFFNESS: dict[str, Any] = {"torque_Nm": 100.0, "angle_start_deg": 1.0, "angle_step_deg": 1.0, "angle_stop_deg": 40.0}

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
        "microgeometry.pinion.slope_um": {"mean": 0.0, "deviation": 3.0},
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

RUNUP: dict[str, Any] = {"speed_start_rad_per_s": 300.0, "speed_stop_rad_per_s": 1200.0, "speeds": 100}

#: Kind, which is the command that runs it -> what the file is about, its tables, and what else its head says.
JOBS: dict[str, tuple[str, dict[str, Mapping[str, Any]], str]] = {
    "stiffness": ("mesh stiffness of a gear pair", {"pair": PAIR, "stiffness": STIFFNESS}, ""),
    "loadmap": (
        "a pair with its reliefs over angle and torque: transmission error, load share, root stress",
        {"pair": PAIR, "loadmap": LOADMAP, "microgeometry": RELIEFS},
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
            "runup": RUNUP,
        },
        "Over its speed: gearfe runup FILE. Shafts run along y; speeds and torques count positive about +y. ",
    ),
    "runup": (
        "steady states of a gear train over its speed: waterfall, orders, critical speeds",
        {"pair": PAIR, "stiffness": {"twist_deg": 0.05}, "train": TRAIN, "housing": HOUSING, "runup": RUNUP},
        "",
    ),
    "housing": (
        "an elastic housing: frequencies, modes, reduced body",
        {"housing": HOUSING},
        "Your own mesh instead: gearfe new box.toml. ",
    ),
    "mechanism": ("a planar mechanism: a crank and a rod", {"": MECHANISM}, ""),
}


def job_file(kind: str) -> str:
    """Text of an example job file: a kind of `JOBS`."""
    about, tables, more = JOBS[kind]
    head = f"{about[0].upper()}{about[1:]}. Run it: gearfe {kind} FILE --out DIR. {more}{OPTIONAL_KEYS}"
    return (
        textwrap.fill(head, 118, initial_indent="# ", subsequent_indent="# ")
        + "\n\n"
        + "\n".join(
            # a mechanism is one table, the file itself
            table_text(table_class(name) if name else MechanismFile, example, name)
            for name, example in tables.items()
        )
    )
