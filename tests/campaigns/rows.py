"""Random gear trains as tables of a job file: shafts in a row, one mesh from each to the next."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .pairs import TORQUES, borne_torque, chosen, log_uniform, rounded

Table = dict[str, Any]
Made = tuple[Table, dict[str, str], dict[str, Any]]

#: Kinds that take turns; "order" and "stiff" choose methods and tolerances themselves.
KINDS = (
    "general",
    "resonance",
    "floquet",
    "symmetric",
    "general",
    "resonance",
    "floquet",
    "symmetric",
    "order",
    "stiff",
    "rattle",
)
#: Tolerance of trains, as `gearfe.base.tables.train` has it.
DEFAULT = 1e-6
MODULE, ALPHA = 2.5, 25.0
#: Length of a run that is to settle, times its damping per mass.
SETTLED = 50.0


def curve_text(random: np.random.Generator, teeth: int, mean: float, swing: float) -> str:
    """A random smooth curve over one mesh cycle as CSV: a few harmonics that add up to `swing`."""
    count = int(random.choice([12, 24, 40]))
    phase = np.arange(count) / count
    weights = random.uniform(0.0, 1.0, 4) / np.arange(1, 5)
    shape = sum(
        w * np.cos(2 * math.pi * (k * phase + random.random())) for k, w in zip(range(1, 5), weights, strict=True)
    )
    values = mean * (1.0 + swing * shape / max(float(np.abs(shape).max()), 1e-12))
    rows = [f"{360.0 / teeth * x:.12g},{k:.9g},{360.0 / teeth:.12g}" for x, k in zip(phase, values, strict=True)]
    return "pinion_angle_deg,k_mesh_N_per_m,mesh_cycle_deg\n" + "\n".join(rows) + "\n"


def row(random: np.random.Generator, kind: str) -> Made:
    """Tables, curve files and what the checks need to know of a random train."""
    symmetric = kind == "symmetric"
    stages = int(random.integers(1, 5)) if kind in ("general", "order", "stiff", "rattle") else 1
    smooth = kind == "stiff" or (kind == "order" and random.random() < 0.5)
    most = (40, 50) if stages == 1 else (26, 27)  # gears of longer rows must clear the shafts beside them
    teeth = [(int(random.integers(18, most[0])), int(random.integers(18, most[1]))) for _ in range(stages)]
    if kind == "housing":
        teeth = [(20, 30)]
    stiffness, swing = log_uniform(random, 1e7, 1e9), random.uniform(0.02, 0.3)
    if kind == "floquet":
        swing = random.uniform(0.2, 0.6)
    places = np.concatenate([[0.0], np.cumsum([0.5 * MODULE * (a + b) for a, b in teeth])])
    shafts: list[Table] = []
    bores: list[Table] = []
    for i, x in enumerate(places):
        names = [str(2 * i + 1), str(2 * i + 2)]
        shafts.append({"name": f"s{i}", "x_mm": float(x), "length_mm": 82.0, "radius_mm": 8.0, "attachments": names})
        bores += [{"attachment": n, "x_mm": float(x), "y_mm": y} for n, y in zip(names, (33.0, -33.0), strict=True)]
    gears: list[Table] = []
    meshes: list[Table] = []
    files = {}
    form = {"module_mm": MODULE, "pressure_angle_deg": ALPHA, "face_width_mm": 8.0}
    for i, (one, two) in enumerate(teeth):
        along = 0.0 if symmetric or kind == "housing" else 15.0 - 10.0 * i
        gears.append({"name": f"d{i}", "shaft": f"s{i}", "y_mm": along, "teeth": one, **form})
        gears.append({"name": f"g{i}", "shaft": f"s{i + 1}", "y_mm": along, "teeth": two, **form})
        mesh: Table = {"driver": f"d{i}", "driven": f"g{i}"}
        if smooth:
            mesh["stiffness_N_per_m"] = rounded(stiffness * random.uniform(0.5, 2.0), 6)
        else:
            mesh["curve"] = f"curve_{i}.csv"
            files[f"curve_{i}.csv"] = curve_text(random, one, stiffness, swing)
        if kind == "general" and random.random() < 0.15:
            mesh = {"driver": f"d{i}", "driven": f"g{i}", "rigid": True}
        if random.random() < 0.3 and "rigid" not in mesh:
            mesh["damping_N_s_per_m"] = rounded(log_uniform(random, 1.0, 3000.0), 3)
        meshes.append(mesh)
    speed = float(random.choice([-1.0, 1.0])) * rounded(log_uniform(random, 20.0, 3000.0))
    train: Table = {
        "housing": "rigid", "duration_ms": 5.0, "step_us": 20.0,
        "tolerance": chosen(random, DEFAULT, lambda: rounded(log_uniform(random, 1e-8, 1e-4), 2)),
        "shafts": shafts, "gears": gears, "meshes": meshes, "rigid_bores": bores,
        "drive": {"shaft": "s0", "attachment": "1", "speed_rad_per_s": speed},
        "curves": {"load": "stiffness", "interpolation": chosen(random, "cubic", lambda: "linear")},
        "damping": {"ratio": float(random.choice([0.0, rounded(log_uniform(random, 1e-4, 0.5), 3)]))},
    }  # fmt: skip
    last = 2 * len(teeth) + 1
    borne = borne_torque({**form, "wheel": {"teeth": min(map(min, teeth))}})
    load = rounded(log_uniform(random, *TORQUES) * borne, 3) * -math.copysign(1.0, speed) * (-1.0) ** len(teeth)
    train["loads"] = [{"shaft": f"s{len(teeth)}", "attachment": str(last), "torque_Nm": load}]
    data: dict[str, Any] = {"smooth": smooth}
    _special(random, kind, train, teeth[0], stiffness, last)
    if symmetric and random.random() < 0.5:
        data["frame"] = int(random.integers(1 << 30))
        _in_a_frame(train)
    if kind == "housing":
        del train["rigid_bores"]
        train |= {"housing": "elastic", "tolerance": 1e-6}
        return {"train": train, "housing": housing(random, float(places[-1]))}, files, data
    return {"train": train}, files, data


def _special(
    random: np.random.Generator, kind: str, train: Table, teeth: tuple[int, int], stiffness: float, last: int
) -> None:
    """What a kind asks for beside the common parts."""
    if kind == "stiff" or (kind in ("general", "order") and random.random() < 0.5):
        size = log_uniform(random, 1e6, 1e9)
        held = [[size, size, size, 1e-3 * size, 1e-3 * size][k] * random.uniform(0.5, 2.0) for k in range(5)]
        damp = [1e-5 * float(random.choice([0.0, 1.0])) * x for x in held]
        springs = {
            "stiffness_N_per_m": held[:3], "tilt_stiffness_Nm_per_rad": held[3:],
            "damping_N_s_per_m": damp[:3], "tilt_damping_Nm_s_per_rad": damp[3:],
        }  # fmt: skip
        train["bearings"] = [{"attachment": str(n), **springs} for n in range(1, last + 2)]
    if kind == "general" and random.random() < 0.3:
        width = rounded(random.uniform(0.2, 3.0), 3)
        train["drive"] |= {"ramp_centre_ms": 0.5 * width, "ramp_width_ms": width}
        train["loads"][0] |= {"ramp_centre_ms": 0.5 * width, "ramp_width_ms": width}
    if kind == "general" and random.random() < 0.3:
        train["drive"] |= {"stiffness_Nm_per_rad": rounded(log_uniform(random, 1e2, 1e6), 3)}
        train["drive"] |= {"damping_Nm_s_per_rad": rounded(log_uniform(random, 1e-3, 1.0), 3)}
    if kind == "order":
        train["method"] = str(random.choice(["taylor", "implicit"]))
        train["tolerance"] = rounded(log_uniform(random, 1e-7, 1e-2), 2)
        train["duration_ms"] = 0.5
        train["step_us"] = 5.0
    if kind == "stiff":
        # all modes, slow and fast, decay with half of alpha: e-folds enough until the end
        alpha = rounded(log_uniform(random, 200.0, 2000.0), 4)
        train["damping"] = {"rayleigh_alpha_per_s": alpha}
        train["method"] = str(random.choice(["auto", "taylor", "implicit"]))
        least = 1e-5 if train["method"] == "implicit" else 1e-7  # steps of the implicit method are costly
        train["tolerance"] = rounded(log_uniform(random, least, 1e-2), 2)
        train["duration_ms"] = 1e3 * SETTLED / alpha
        train["step_us"] = 1e3 * train["duration_ms"] / 100
    if kind == "rattle":
        # torques that change sign again and again, behind backlashes from far below to far above the deflections
        train |= {"damping": {"ratio": 0.0}, "duration_ms": 2.0}
        for mesh in train["meshes"]:
            mesh["backlash_um"] = rounded(log_uniform(random, 0.1, 300.0), 3)
            mesh["damping_N_s_per_m"] = rounded(log_uniform(random, 1.0, 3000.0), 3)
            mesh["damping_acts"] = str(random.choice(["always", "in_contact"]))
        mean = train["loads"][0]["torque_Nm"]
        waves = [
            {
                "frequency_Hz": rounded(log_uniform(random, 100.0, 2e4), 3),
                "amplitude": rounded(abs(mean) * random.uniform(0.5, 4.0), 3),
                "phase_deg": rounded(random.uniform(0.0, 360.0), 3),
            }
            for _ in range(int(random.integers(1, 3)))
        ]
        train["loads"][0]["torque_Nm"] = {"constant": mean, "sines": waves}
    if kind in ("floquet", "resonance"):
        # a driven wheel that is free to turn: the drive holds the pinion, k works on its polar inertia
        inertia = wheel_inertia(teeth[1])
        radius = 0.5e-3 * MODULE * teeth[1] * math.cos(math.radians(ALPHA))
        natural = math.sqrt(stiffness * radius**2 / inertia)  # rad/s
        order = float(random.choice([0.5, 1.0, 2.0])) if kind == "floquet" else float(random.choice([1.0, 0.5]))
        speed = natural * order * random.uniform(0.85, 1.15) / teeth[0]
        train["drive"]["speed_rad_per_s"] = rounded(speed, 6)
        train["loads"][0]["torque_Nm"] = abs(train["loads"][0]["torque_Nm"])
        train["damping"] = {"ratio": float(random.choice([0.0, 0.003, 0.02, 0.05]))}
        if kind == "resonance":
            period = (
                2 * math.pi / train["drive"]["speed_rad_per_s"]
            )  # of a turn of the drive; the mesh's is shorter by its teeth
            train["damping"]["ratio"] = rounded(random.uniform(0.02, 0.08), 3)
            train["step_us"] = 1e6 * period / teeth[0] / 40
            train["duration_ms"] = 1e3 * period / teeth[0] * 200
    if kind == "symmetric":
        side = [log_uniform(random, 1e7, 1e9) for _ in range(3)]
        springs = {"stiffness_N_per_m": side, "tilt_stiffness_Nm_per_rad": [1e4, 1e4]}
        train["bearings"] = [{"attachment": str(n), **springs} for n in range(1, last + 2)]


def _in_a_frame(train: Table) -> None:
    """A third bore for each shaft, in the mirror plane, so that drive and load act there and spoil no symmetry."""
    for shaft, part in zip(train["shafts"], (train["drive"], train["loads"][0]), strict=True):
        name = f"{shaft['name']} middle"
        shaft["attachments"] = [*shaft["attachments"], name]
        train["rigid_bores"].append({"attachment": name, "x_mm": shaft["x_mm"], "y_mm": 0.0})
        part["attachment"] = name


def wheel_inertia(teeth: int) -> float:
    """About the polar inertia (kg m2) of the driven shaft with its gear: a disc of the pitch diameter and the shaft."""
    disc = 0.5 * 7850.0 * math.pi * 8e-3 * (0.5e-3 * MODULE * teeth) ** 4
    return disc + 0.5 * 7850.0 * math.pi * 74e-3 * 8e-3**4


def housing(random: np.random.Generator, distance: float) -> Table:
    """A small random housing, coarsely meshed, for two shafts."""
    walls = [rounded(random.uniform(4.0, 12.0), 2), rounded(random.uniform(4.0, 12.0), 2)]
    made: Table = {
        "wall_x_mm": [-rounded(random.uniform(35.0, 55.0), 3), distance + rounded(random.uniform(35.0, 55.0), 3)],
        "wall_z_mm": [-rounded(random.uniform(50.0, 90.0), 3), rounded(random.uniform(22.0, 45.0), 3)],
        "inner_gap_mm": rounded(random.uniform(30.0, 60.0), 3),
        "wall_thickness_mm": walls,
        "base_thickness_mm": rounded(random.uniform(8.0, 20.0), 3),
        "shafts": [{"x_mm": 0.0, "bore_radius_mm": 10.0}, {"x_mm": distance, "bore_radius_mm": 10.0}],
        "feet": {"length_x_mm": 20.0, "width_y_mm": 15.0, "fixed": True},
        "mesh": {"size_mm": rounded(random.uniform(4.0, 13.0), 2)},
        "reduction": {"modes_below_Hz": 8000.0, "least_modes": 20, "band_Hz": 4000.0},
        "damping": {"ratio": float(random.choice([0.0, 0.01, 0.03]))},
    }
    made["feet"]["height_mm"] = min(10.0, made["base_thickness_mm"])
    return made
