"""A gearbox of three meshes by name, as a REXS table lists it: two stages, an idler, a shared gear, three materials."""

from __future__ import annotations

import copy
from typing import Any

from gearfe.base.tables.text import toml_document

#: name: teeth, module (mm), width (mm), bore (mm), material, shaft, y (mm)
GEARS = {
    "sun": (21, 2.0, 14.0, 16.0, "steel", "s1", 15.0),
    "idler": (34, 2.0, 12.0, 24.0, "iron", "s2", 15.0),
    "wheel_1": (45, 2.0, 15.0, 34.0, "bronze", "s3", 15.0),
    "pinion_2": (17, 3.0, 20.0, 20.0, "steel", "s3", -15.0),
    "wheel_2": (29, 3.0, 22.0, 30.0, "iron", "s4", -15.0),
}
#: driver, driven
MESHES = {"in": ("sun", "idler"), "through": ("idler", "wheel_1"), "out": ("pinion_2", "wheel_2")}
MATERIALS = {"steel": (206.0, 0.30, 7830.0), "iron": (175.0, 0.26, 7200.0), "bronze": (110.0, 0.34, 8800.0)}
#: x of the axes (mm): half the sum of the pitch diameters apart.
AXES = {"s1": 0.0, "s2": 55.0, "s3": 134.0, "s4": 203.0}
ANGLE = 20.0
TORQUE, SPEED = 60.0, 100.0


def tables(**changes: Any) -> dict[str, Any]:
    """Tables of the job; dotted keys of `changes` (with __ for the dots) win, None takes a key out."""
    made: dict[str, Any] = {
        "gears": {
            name: {
                "teeth": z, "module_mm": m, "face_width_mm": b, "bore_diameter_mm": bore, "pressure_angle_deg": ANGLE,
                "tip_round_mm": 0.1, "tooth_thinning_um": 30.0, "material": material, "shaft": shaft, "y_mm": y,
            }
            for name, (z, m, b, bore, material, shaft, y) in GEARS.items()
        },
        "meshes": {name: {"driver": one, "driven": two} for name, (one, two) in MESHES.items()},
        "materials": {
            name: {"youngs_modulus_GPa": e, "poisson_ratio": nu, "density_kg_per_m3": rho}
            for name, (e, nu, rho) in MATERIALS.items()
        },
        "shafts": {name: {"x_mm": x, "length_mm": 90.0, "radius_mm": 8.0} for name, x in AXES.items()},
        "bearings": {
            f"{name}_{side}": {"shaft": name, "y_mm": y}
            for name in AXES
            for side, y in (("left", -40.0), ("right", 40.0))
        },
        "stiffness": {"torque_Nm": 30.0, "coarsen": 3.0, "kinematics": "small", "angle_step_deg": 4.0},
        "train": {
            "housing": "rigid", "duration_ms": 1.0, "step_us": 50.0,
            "drive": {"shaft": "s1", "attachment": "s1_left", "speed_rad_per_s": SPEED},
            "loads": [{"shaft": "s4", "torque_Nm": TORQUE}],
            "curves": {"mesh_model": "variable_stiffness", "load": "torque", "positions": 8},
        },
    }  # fmt: skip
    for name, value in changes.items():
        *way, last = name.split("__")
        place = made
        for step in way:
            place = place.setdefault(step, {})
        if value is None:
            place.pop(last, None)
        else:
            place[last] = copy.deepcopy(value)
    return made


def text(**changes: Any) -> str:
    """The job as TOML."""
    return toml_document(tables(**changes))


def pair_text(mesh: str, torque: float) -> str:
    """A [pair] job of one mesh at a torque (N m) of its driven gear."""
    job: dict[str, Any] = {"stiffness": {**tables()["stiffness"], "torque_Nm": torque}, "pair": {}}
    for side, name in zip(("pinion", "wheel"), MESHES[mesh], strict=True):
        keys = {k: v for k, v in tables()["gears"][name].items() if k not in ("shaft", "y_mm")}
        job["pair"][side] = {**keys, "material": tables()["materials"][keys["material"]]}
    return toml_document(job)
