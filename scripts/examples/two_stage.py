#!/usr/bin/env python3
"""A two-stage gearbox of three materials in Python: gears, meshes and shafts by name, from gears to contact forces.

Usage: python scripts/examples/two_stage.py [COARSEN]
"""

from __future__ import annotations

import math
import sys

import numpy as np

from gearfe import (
    Damping,
    Drive,
    Gear,
    GearMesh,
    GearTrain,
    Load,
    Material,
    PairModel,
    Shaft,
    ShaftGear,
    build_train,
    compute_meshes,
    simulate,
)
from gearfe.multibody import constant


def main(coarsen: float = 1.0) -> int:
    """Compute the mesh laws and a transient; print forces and frequencies."""
    steel, iron, bronze = Material(206e9, 0.3, 7830.0), Material(175e9, 0.26, 7200.0), Material(110e9, 0.34, 8800.0)
    form = {"pressure_angle": math.radians(20.0), "tip_round": 0.1e-3, "tooth_thinning": 30e-6}
    parts = {  # shaft, y, gear, material
        "pinion_1": ("input", 15e-3, Gear(20, 2e-3, face_width=18e-3, bore_diameter=20e-3, **form), steel),
        "wheel_1": ("middle", 15e-3, Gear(41, 2e-3, face_width=18e-3, bore_diameter=40e-3, **form), iron),
        "pinion_2": ("middle", -15e-3, Gear(18, 2.5e-3, face_width=25e-3, bore_diameter=24e-3, **form), steel),
        "wheel_2": ("output", -15e-3, Gear(43, 2.5e-3, face_width=25e-3, bore_diameter=60e-3, **form), bronze),
    }
    axes = {"input": 0.0, "middle": 61e-3, "output": 137.25e-3}
    train = GearTrain(
        shafts=tuple(Shaft(name, (x, 0.0, 0.0), 0.1, 10e-3, (f"{name}_1", f"{name}_2")) for name, x in axes.items()),
        gears=tuple(ShaftGear(name, shaft, y, g, m.density) for name, (shaft, y, g, m) in parts.items()),
        meshes=tuple(
            GearMesh(a, b, PairModel((parts[a][3], parts[b][3]), coarsen=coarsen), name=name)
            for name, a, b in (("first", "pinion_1", "wheel_1"), ("second", "pinion_2", "wheel_2"))
        ),
        drive=Drive("input", "input_1", constant(150.0)),
        loads=(Load("output", None, constant(-145.0)),),
        rigid_bores={f"{name}_{i}": (x, y, 0.0) for name, x in axes.items() for i, y in ((1, 40e-3), (2, -40e-3))},
        damping=Damping(beta=2e-6),
    )
    model = build_train(compute_meshes(train))
    response = simulate(model, np.arange(0.0, 5e-3, 2e-5))
    for name, force in zip(response.mesh_names, response.contact_force.T, strict=True):
        print(f"mesh {name}: mean contact force {force.mean():.5g} N, {force.min():.5g} to {force.max():.5g} N")
    print("natural frequencies:", ", ".join(f"{f:.0f}" for f in model.coupled_frequencies_hz[:6]), "Hz")
    return int(response.status != "done")


if __name__ == "__main__":
    sys.exit(main(*map(float, sys.argv[1:2])))
