#!/usr/bin/env python3
"""A two-stage gearbox of three materials in 25 lines: named gears, meshes and shafts, up to contact forces."""

import numpy as np

import gearfe as gf

steel, iron = gf.Material(206e9, 0.3, 7830.0), gf.Material(175e9, 0.26, 7200.0)
bronze = gf.Material(110e9, 0.34, 8800.0)

form = {"pressure_angle": np.radians(20.0), "tip_round": 0.1e-3, "tooth_thinning": 30e-6}
first = {"module": 2e-3, "face_width": 18e-3, **form}
second = {"module": 2.5e-3, "face_width": 25e-3, **form}
gears = (  # name, shaft, place along the axis, teeth, density
    gf.ShaftGear("pinion_1", "input", 15e-3, gf.Gear(20, bore_diameter=20e-3, **first), steel.density),
    gf.ShaftGear("wheel_1", "middle", 15e-3, gf.Gear(41, bore_diameter=40e-3, **first), iron.density),
    gf.ShaftGear("pinion_2", "middle", -15e-3, gf.Gear(18, bore_diameter=24e-3, **second), steel.density),
    gf.ShaftGear("wheel_2", "output", -15e-3, gf.Gear(43, bore_diameter=60e-3, **second), bronze.density),
)
meshes = (  # coarse elements, for a first look; 1.0 is the default
    gf.GearMesh("pinion_1", "wheel_1", gf.PairModel((steel, iron), coarsen=3.0), name="first"),
    gf.GearMesh("pinion_2", "wheel_2", gf.PairModel((steel, bronze), coarsen=3.0), name="second"),
)

axes = {"input": 0.0, "middle": 61e-3, "output": 137.25e-3}
shafts = tuple(gf.Shaft(name, (x, 0.0, 0.0), 0.1, 10e-3, (f"{name}_1", f"{name}_2")) for name, x in axes.items())
bores = {f"{name}_{i}": (x, y, 0.0) for name, x in axes.items() for i, y in ((1, 40e-3), (2, -40e-3))}
drive, load = gf.Drive("input", "input_1", gf.constant(150.0)), gf.Load("output", None, gf.constant(-145.0))
train = gf.GearTrain(shafts, gears, meshes, drive, (load,), rigid_bores=bores, damping=gf.Damping(beta=2e-6))

response = gf.simulate(gf.build_train(gf.compute_meshes(train)), np.arange(0.0, 5e-3, 2e-5))
for name, force in zip(response.mesh_names, response.contact_force.T, strict=True):
    print(f"mesh {name}: mean contact force {force.mean():.5g} N, {force.min():.5g} to {force.max():.5g} N")
