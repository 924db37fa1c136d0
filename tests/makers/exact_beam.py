"""Exact vibrations of stepped Timoshenko rotors: the differential equations solved by matrix exponentials.

State y = (w, theta, M, V): deflection, rotation, bending moment, shear force of a plane; with the whirl frequency w
(rad/s, negative backward) and the spin S (rad/s)

    w' = theta + V / (kappa G A),   theta' = M / (E I),
    M' = -V - rho I (w^2 - 2 S w) theta,   V' = -rho A w^2 w.

Frequencies are zeros of the determinant over the states at all cuts, which stays well conditioned for high modes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from gearfe.base.typing import Array
from gearfe.fem.beams import BeamShaft, Section


def shear_factor(nu: float, m: float) -> float:
    """Cowper (1966), hollow circle, m the ratio of inner and outer diameter."""
    top = 6.0 * (1.0 + nu) * (1.0 + m * m) ** 2
    return top / ((7.0 + 6.0 * nu) * (1.0 + m * m) ** 2 + (20.0 + 12.0 * nu) * m * m)


@dataclass(frozen=True)
class Properties:
    """Of a uniform section: E A, E I, kappa G A, G J, rho A, rho I."""

    tension: float
    bend: float
    shear: float
    twist: float
    mass: float
    inertia: float


def properties(section: Section) -> Properties:
    """Of a section whose diameters are constant."""
    outer, inner = section.outer_start, section.inner_start
    assert (outer, inner) == (section.outer_end, section.inner_end)
    area, second = math.pi * (outer**2 - inner**2) / 4.0, math.pi * (outer**4 - inner**4) / 64.0
    modulus = section.young / (2.0 * (1.0 + section.poisson))
    return Properties(
        section.young * area,
        section.young * second,
        shear_factor(section.poisson, inner / outer) * modulus * area,
        2.0 * modulus * second,
        section.density * area,
        section.density * second,
    )


def pieces(shaft: BeamShaft, marks: set[float]) -> list[tuple[Properties, float, float]]:
    """Uniform pieces between the ends of sections and the marked positions; each left end occurs once."""
    found = []
    for section, left, right in zip(shaft.sections, shaft.ends[:-1], shaft.ends[1:], strict=True):
        cuts = sorted({left, right} | {mark for mark in marks if left < mark < right})
        found += [(properties(section), a, b) for a, b in pairwise(cuts)]
    return found


def bending_determinant(shaft: BeamShaft, springs: dict[float, tuple[float, float]], spin: float, w: Array) -> Array:
    """Scaled determinants of a free rotor on springs: position (m) to stiffness (N/m) and tilt stiffness (N m/rad)."""
    w = np.atleast_1d(w)
    one = np.zeros((len(w), 4, 4)) + np.eye(4)
    first = properties(shaft.sections[0])
    wave = (first.mass * w * w / first.bend) ** 0.25
    # all parts of a state in units of one size
    scale = np.array([wave**0, wave, first.bend * wave**2, first.bend * wave**3]).T
    scaled = scale[:, None, :] / scale[:, :, None]

    def jump(along: float) -> Array:
        matrix = one.copy()
        for disc in shaft.discs:
            if disc.along == along:
                matrix[:, 3, 0] -= disc.mass * w * w
                matrix[:, 2, 1] -= disc.transverse * w * w - disc.polar * spin * w
        stiffness, tilt = springs.get(along, (0.0, 0.0))
        matrix[:, 3, 0] += stiffness
        matrix[:, 2, 1] += tilt
        return matrix * scaled

    steps = []
    for p, a, b in pieces(shaft, {disc.along for disc in shaft.discs} | set(springs)):
        field = 0.0 * one
        field[:, 0, 1], field[:, 0, 3], field[:, 1, 2] = 1.0, 1.0 / p.shear, 1.0 / p.bend
        field[:, 2, 1], field[:, 2, 3] = -p.inertia * (w * w - 2.0 * spin * w), -1.0
        field[:, 3, 0] = -p.mass * w * w
        field *= scaled
        count = math.ceil((b - a) * wave.max() / 4.0)
        halvings = max(0, math.ceil(math.log2((b - a) / count * np.abs(field).sum(axis=2).max())))
        step, term = one.copy(), one.copy()
        for order in range(1, 20):
            term = term @ field * ((b - a) / count / 2**halvings / order)
            step += term
        for _ in range(halvings):
            step = step @ step
        steps += [step @ jump(a), *[step] * (count - 1)]
    steps.append(jump(shaft.end))
    size = 4 * len(steps) + 4
    matrix = np.zeros((len(w), size, size))
    matrix[:, 0, 2] = matrix[:, 1, 3] = matrix[:, -2, -2] = matrix[:, -1, -1] = 1.0
    for i, step in enumerate(steps):
        matrix[:, 2 + 4 * i : 6 + 4 * i, 4 * i : 4 * i + 4] = step
        matrix[:, 2 + 4 * i : 6 + 4 * i, 4 * i + 4 : 4 * i + 8] = -one
    sign, logarithm = np.linalg.slogdet(matrix)
    return sign * np.exp(np.minimum(logarithm, 600.0))


def bar_determinant(shaft: BeamShaft, kind: str, w: Array) -> Array:
    """Forces or torques at the last end of a free shaft with unit motion of its first end."""
    moved, force = np.ones_like(w), np.zeros_like(w)

    def jump(along: float) -> Array:
        return sum(d.mass if kind == "axial" else d.polar for d in shaft.discs if d.along == along) * w * w * moved

    for p, a, b in pieces(shaft, {disc.along for disc in shaft.discs}):
        stiffness, mass = (p.tension, p.mass) if kind == "axial" else (p.twist, 2.0 * p.inertia)
        wave = w * math.sqrt(mass / stiffness)
        c, s = np.cos(wave * (b - a)), np.sin(wave * (b - a))
        force = force - jump(a)
        moved, force = c * moved + s / (wave * stiffness) * force, c * force - s * wave * stiffness * moved
    return force - jump(shaft.end)


def zeros(function: Callable[[Array], Array], start: float, end: float, points: int = 400) -> Array:
    """Zeros of a function of arrays between two positive arguments, bracketed on a grid of equal ratios."""
    grid = np.geomspace(start, end, points)
    values = np.concatenate([function(part) for part in np.array_split(grid, 20)])
    return np.array(
        [
            brentq(lambda x: float(np.squeeze(function(np.array([x])))), a, b, xtol=1e-13 * b, rtol=1e-14)
            for (a, b), (at_a, at_b) in zip(pairwise(grid), pairwise(values), strict=True)
            if at_a * at_b < 0.0
        ]
    )
