"""A mesh law in closed form, without contact solutions."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from gearfe import Gear, GearPair
from gearfe.fem.plane import Material
from gearfe.gears.gearmesh.law import MeshLaw
from gearfe.gears.gearmesh.law_fit import Couple, PairForces, TouchCurve, fit_law

CYCLE = 2 * math.pi / 20


def hertzian_law(cycle: float = CYCLE, *, relief: float = 0.0, backlash: float = 0.0, cells: int = 12) -> MeshLaw:
    """Pairs that yield as Hertz's contacts on springs that vary with the angle, 1.6 of them on average.

    Flanks touch late beside the middle part of their path, and by `relief` (m) within it.
    """
    half = 0.5333 * cycle
    angle = 0.9333 * cycle * -1.0 + cycle * np.arange(2 * cells + 1) / cells
    middle = -0.0
    beyond = np.maximum(np.abs(angle - middle) - half, 0.0)
    swing = 2 * math.pi / cycle
    touch = TouchCurve(
        angle,
        2e-3 * beyond**2 + 0.5 * relief * (1 - np.cos(swing * angle)),
        4e-3 * beyond * np.sign(angle) + 0.5 * relief * swing * np.sin(swing * angle),
    )
    psi, force = np.meshgrid(np.linspace(angle[0], angle[-1], 90), np.geomspace(2.0, 8e3, 9), indexing="ij")
    made = force * (1.3e-8 + 2e-9 * np.cos(9 * psi) - 2.9e-10 * np.log(force / 1e3))
    found = PairForces(psi.ravel(), force.ravel(), np.ones(psi.size), made.ravel())
    couple = Couple(np.linspace(-0.3, 0.1, 9), 5.4e-9 + 2e-10 * np.linspace(-1, 1, 9) ** 2)
    radii = (0.5 * 20 * 2.5e-3 * math.cos(math.radians(25)), 0.5 * 30 * 2.5e-3 * math.cos(math.radians(25)))
    law = fit_law(found, touch, [couple], cells=cells, hertz=2.9e-10, base_radii=radii, reach=6e-5, force=8e3)
    return replace(law, backlash=backlash)


def numpy_law(law: MeshLaw, angles, approaches, shifts=0.0):  # type: ignore[no-untyped-def]
    """F, M, dF/d approach, W and F_k of a law at places (n,): all places at once, by matrices, a second formulation."""
    angle, delta = np.asarray(angles, dtype=float), np.asarray(approaches, dtype=float)
    _, cell, z = law.locate(angle)
    t, slope = (x.T for x in powers(law.touch[:, cell], z[None]))
    gap = delta[:, None] - t - np.asarray(shifts, dtype=float)
    C, C_slope = couplings(law, cell, z)
    F = np.zeros_like(gap)
    largest = np.zeros(len(angle))
    for _ in range(60):
        compliance = pair_energies(law, cell, z, F)
        off = compliance.approach + times(C, F) - gap
        bears = (F > 0.0) | (off < 0.0)
        J = np.where(bears[:, :, None] & bears[:, None, :], C, 0.0)
        diagonal = np.arange(law.slots)
        J[:, diagonal, diagonal] = np.where(bears, compliance.slope, 1.0)
        step = np.linalg.solve(J, np.where(bears, -off, -F)[..., None])[..., 0]
        new = np.maximum(F + step, 0.0)
        largest = np.maximum(new.max(axis=1), 1e-300)
        done = np.abs(new - F).max(axis=1) <= 1e-10 * largest
        F = new
        if done.all():
            break
    else:
        raise ArithmeticError("the pair forces of the mesh law do not settle")
    made = pair_energies(law, cell, z, F)
    bears = F > 0.0
    J = np.where(bears[:, :, None] & bears[:, None, :], C, 0.0)
    J[:, diagonal, diagonal] = np.where(bears, made.slope, 1.0)
    tangent = np.linalg.solve(J, bears[..., None].astype(float))[..., 0].sum(axis=1)
    energy = (F * (gap - 0.5 * times(C, F)) - made.energy).sum(axis=1)
    moment = -(F * (slope + 0.5 * times(C_slope, F)) + made.turn).sum(axis=1)
    return F.sum(axis=1), moment, tangent, energy, F


def couplings(law: MeshLaw, cell, z):  # type: ignore[no-untyped-def]
    """C between all slots and its slope, shape (n, s, s)."""
    made = np.zeros((2, len(z), law.slots, law.slots))
    for apart in range(1, law.slots):
        for low in range(law.slots - apart):
            found = powers(law.coupling[apart - 1, low, cell], z)
            for value, one in zip(made, found, strict=True):
                value[:, low, low + apart] = value[:, low + apart, low] = one
    return made[0], made[1]


def times(matrices, vectors):
    """(n, s, s) times (n, s)."""
    return (matrices @ vectors[..., None])[..., 0]


def powers(c, z):
    """Value and slope of cubics at z."""
    value = c[..., 0] + z * (c[..., 1] + z * (c[..., 2] + z * c[..., 3]))
    return value, c[..., 1] + z * (2 * c[..., 2] + 3 * z * c[..., 3])


def pair_energies(law: MeshLaw, cell, z, F):
    """Complementary energy of all pairs and its derivatives at forces (n, slots)."""
    part = np.clip(np.searchsorted(law.forces, F, side="right") - 1, 0, len(law.forces) - 2)
    f = F - law.forces[part]
    c = law.energies[np.arange(law.slots), cell[:, None], part]
    value, turn = powers(np.moveaxis(c, 3, 2), z[:, None, None])
    e = [value[..., b] for b in range(5)]
    g = [turn[..., b] for b in range(5)]
    return SimpleNamespace(
        energy=e[0] + f * (e[1] + f * (e[2] + f * (e[3] + f * e[4]))),
        turn=g[0] + f * (g[1] + f * (g[2] + f * (g[3] + f * g[4]))),
        approach=e[1] + f * (2 * e[2] + f * (3 * e[3] + f * 4 * e[4])),
        slope=2 * e[2] + f * (6 * e[3] + f * 12 * e[4]),
    )


FORM = {"module": 2.5e-3, "pressure_angle": math.radians(25), "face_width": 10e-3, "tip_round": 0.1e-3}


PAIR = GearPair(Gear(20, bore_diameter=10e-3, **FORM), Gear(30, bore_diameter=15e-3, **FORM))


#: 100 N m at the wheel: the force that accuracy is asked for against.
DESIGN = 100.0 / PAIR.wheel.base_radius


STEEL = Material(200e9, 0.3)
