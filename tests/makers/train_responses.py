"""A made-up response of a train, every number of which is known: for tests of what is written and drawn."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.drivetrain.train.response import TrainResponse

#: Record of the shipped job: 0..7 ms in steps of 35 us.
STEP, COUNT = 35e-6, 201
DRIVE = 600.0
SHAFTS = ("drive", "intermediate", "output")
#: Columns of the shipped job's response, in their order.
COLUMNS = [
    "time_s", "drive_angle_deg", "contact_force_1_N", "contact_force_2_N",
    *(f"speed_{s}_rad_per_s" for s in SHAFTS), *(f"acceleration_{s}_rad_per_s2" for s in SHAFTS),
    *(f"attachment_{k}_acceleration_m_per_s2" for k in range(1, 7)),
]  # fmt: skip


def tone(time: np.ndarray, line: int, amplitude: float, phase: float = 0.0) -> np.ndarray:
    """A line on bin `line` of the record."""
    return amplitude * np.cos(2 * math.pi * line * time / 7e-3 + phase)


def made_up(**changes: Any) -> TrainResponse:
    """Forces 2000 and 3000 N with lines on bins 13 and 9, attachment 5 with lines 10.7 and 9.7 on bins 4 and 14."""
    time = STEP * np.arange(COUNT)
    drive = DRIVE / (2 * math.pi)
    speed = np.column_stack([np.full(COUNT, 600.0), -400.0 + tone(time, 4, 0.8), 266.667 + tone(time, 9, 0.5)])
    omega = 2 * math.pi / 7e-3
    acceleration = np.column_stack(
        [np.zeros(COUNT), tone(time, 4, 0.8 * 4 * omega, math.pi / 2), tone(time, 9, 0.5 * 9 * omega, math.pi / 2)]
    )
    sides = np.column_stack([tone(time, 4, 0.5 + k) + tone(time, 14, 3.0 - 0.3 * k) for k in range(6)])
    sides[:, 4] = tone(time, 4, 10.7) + tone(time, 14, 9.7, 1.0)
    pose = np.zeros((COUNT, 4, 6))
    turned = np.column_stack([600 * time, -400 * time, -400 * time, 266.667 * time])
    pose[:, :, 4] = turned
    values: dict[str, Any] = {
        "time": time,
        "drive_angle": 600.0 * time,
        "drive_torque": 49.0 + tone(time, 13, 4.0),
        "mesh_power": np.full((COUNT, 2), 3e4),
        "friction_power": np.full((COUNT, 2), 150.0),
        "mesh_names": ("gear1-gear2", "gear3-gear4"),
        "transmission_error": np.column_stack([2e-5 + tone(time, 13, 1e-6), 3e-5 + tone(time, 9, 1e-6)]),
        "contact_force": np.column_stack([2000 + tone(time, 13, 150.0), 3000 + tone(time, 9, 200.0)]),
        "apart": np.zeros((COUNT, 2), dtype=bool),
        "shaft_names": ("drive", "intermediate", "output"),
        "speed": speed,
        "speed_absolute": speed + 1e-3,
        "acceleration": acceleration,
        "acceleration_absolute": acceleration + 1.0,
        "attachment_names": tuple("123456"),
        "attachment_acceleration": sides,
        "gear_names": ("gear1", "gear2", "gear3", "gear4"),
        "gear_pose": pose,
        "gear_centres": 1e-3 * np.array([[0, 10, 0], [62.5, 10, 0], [62.5, -2, 0], [125, -2, 0]]),
        "modal": None,
        "modal_velocity": None,
        "modal_acceleration": None,
        "mesh_frequencies_Hz": np.array([20 * drive, 20 * drive * 20 / 30]),
        "shaft_frequencies_Hz": drive * np.array([1.0, 2 / 3, 4 / 9]),
        "common_period_s": 1 / (20 * drive / 3),
        "coupled_frequencies_Hz": np.array([560.0, 1990.0, 13_000.0]),
        "status": "done",
        "time_reached": float(time[-1]),
        "load_end_s": 1e-3,
        "statistics": {"steps": 100},
        "estimates": {"integration": 1e-7},
        "warnings": (),
    }
    return TrainResponse(**(values | changes))


def table(path: Path) -> tuple[list[str], np.ndarray]:
    """Names and values of a table of numbers."""
    with path.open() as handle:
        names, *rows = list(csv.reader(handle))
    return names, np.array(rows, dtype=float)
