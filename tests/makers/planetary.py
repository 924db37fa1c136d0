"""Planetary stages with given stiffnesses for tests."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from gearfe.drivetrain.train import (
    Bearing,
    Carrier,
    Drive,
    GearMesh,
    GearTrain,
    Guide,
    Load,
    Pin,
    Shaft,
    ShaftGear,
)
from gearfe.gears.geometry.pair import Gear
from gearfe.multibody import constant

MODULE, ALPHA, WIDTH = 3e-3, math.radians(24.6), 0.02
#: Mass (kg) and I/r^2 (kg) of sun, ring, carrier and planet: Lin & Parker, J. Vib. Acoust. 121 (1999) 316, table 1.
LIN_PARKER = {"sun": (0.4, 0.39), "ring": (2.35, 3.0), "carrier": (5.43, 6.29), "planet": (0.66, 0.61)}
SPEED, TORQUE = 200.0, 10.0
#: Bearings along the axis (N/m) and against tilts (N m/rad): no frequency below 20 kHz, and no part of plane motion.
ALONG, TILT = 1e12, 1e9


def gear(teeth: int) -> Gear:
    """A gear with short teeth, so that no tip reaches a root."""
    rim = {"rim_diameter": (abs(teeth) + 12) * MODULE} if teeth < 0 else {"bore_diameter": 0.2 * teeth * MODULE}
    return Gear(teeth, MODULE, ALPHA, WIDTH, **rim, addendum=0.9, dedendum=1.2)


def stage(
    count: int = 3,
    teeth: tuple[int, int] = (30, 36),
    *,
    mesh: Any = 5e8,
    pin: float | None = 1e8,
    bearing: float | None = 1e8,
    ring: float | None = 1e9,
    angles: list[float] | None = None,
    errors: list[float] | None = None,
    **changes: Any,
) -> GearTrain:
    """The stage of Lin and Parker: masses over squares of radii are theirs, and with them the frequencies.

    Parameters
    ----------
    count, teeth
        Number of planets; teeth of sun and planets.
    mesh, pin, bearing
        Stiffness of the meshes, the pins and the bearings (N/m); None: hinges.
    ring
        Torsional stiffness of the ring to the ground over the square of its base radius (N/m); None: fixed.
    angles
        Places of the planets (rad); None: equally spaced.
    errors
        Tangential errors of the pins (m).
    """
    sun, planet = teeth
    z = {"sun": sun, "planet": planet, "ring": -(sun + 2 * planet)}
    arm = 0.5 * MODULE * (sun + planet)
    radius = {name: 0.5 * MODULE * abs(n) * math.cos(ALPHA) for name, n in z.items()} | {"carrier": arm}

    def shaft(name: str, kind: str, point: tuple[float, float, float], bores: tuple[str, ...]) -> Shaft:
        mass, inertia = LIN_PARKER[kind]
        return Shaft(
            name, point, 0.03, 0.005, bores, mass=mass, polar_inertia=inertia * radius[kind] ** 2,
            transverse_inertia=1e-3,
        )  # fmt: skip

    shafts = [shaft(name, name, (0.0, 0.0, 0.0), (name,)) for name in ("sun", "ring", "carrier")]
    gears = [ShaftGear(name, name, 0.0, gear(z[name])) for name in ("sun", "ring")]
    angles = [2.0 * math.pi * k / count for k in range(count)] if angles is None else angles
    names = [f"planet{k}" for k in range(len(angles))]
    for name, angle in zip(names, angles, strict=True):
        shafts.append(shaft(name, "planet", (arm * math.cos(angle), 0.0, -arm * math.sin(angle)), ()))
        gears.append(ShaftGear(name, name, 0.0, gear(planet)))

    def spring(driver: int) -> Any:
        return mesh(driver) if callable(mesh) else mesh

    meshes = [GearMesh("sun", name, spring(sun)) for name in names]
    meshes += [GearMesh(name, "ring", spring(planet)) for name in names]
    moved = errors or [0.0] * len(names)
    pins = tuple(Pin(name, pin, error=(0.0, error)) for name, error in zip(names, moved, strict=True))
    springs = () if bearing is None else tuple(
        Bearing(name, (bearing, ALONG, bearing, TILT, TILT)) for name in ("sun", "ring", "carrier")
    )  # fmt: skip
    made = GearTrain(
        shafts=tuple(shafts),
        gears=tuple(gears),
        meshes=tuple(meshes),
        drive=Drive("sun", "sun", constant(SPEED)),
        loads=(Load("carrier", "carrier", constant(-TORQUE * (1.0 - z["ring"] / sun))),),
        rigid_bores=dict.fromkeys(("sun", "ring", "carrier"), (0.0, 0.0, 0.0)),
        bearings=springs,
        carriers=(Carrier("arm", "carrier", pins),),
        guides=(Guide("ring", stiffness=None if ring is None else ring * radius["ring"] ** 2),),
    )  # fmt: skip
    return dataclasses.replace(made, **changes)
