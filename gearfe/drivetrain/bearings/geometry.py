r"""Inner geometry of rolling bearings, and the contacts of their rolling elements.

A bearing moves by :math:`u = (u_1, u_a, u_2, \theta_1, \theta_2)`: the inner ring (shaft) relative to the outer ring
(bore). These are displacements (m) along the transverse direction e1, the axis a and the transverse direction e2, and
small tilts (rad) about e1 and e2. e1, e2, a are right-handed. The element at the angle :math:`\varphi` from e1 towards
e2 sees the point of the inner ring at the radius R and the axial place x move by

.. math::
    d_r = u_1\cos\varphi + u_2\sin\varphi + x(\theta_2\cos\varphi - \theta_1\sin\varphi),\quad
    d_a = u_a + R(\theta_1\sin\varphi - \theta_2\cos\varphi)

along the radius and along the axis.

**Ball.** The centres of the two grooves lie :math:`A = (f_i + f_o - 1) D` apart, at the contact angle :math:`\alpha`.
The ball is pressed by :math:`s = |(A\cos\alpha - P_d/2 + d_r,\ \sigma(A\sin\alpha + p) + d_a)| - A` with the diametral
clearance :math:`P_d`, the axial preload p, and the sense :math:`\sigma` (Harris and Kotzalas, Essential Concepts,
ch. 7; A. B. Jones, J. Basic Eng. 82, 1960). So the contact angle changes with the load.

**Roller.** Slice k at the place t along the roller is pressed by
:math:`s = (d_r - P_d/2)\cos\alpha + \sigma(d_a + \sigma p)\sin\alpha - 2P(t)` (ISO/TS 16281:2008, eq. 38 to 41), P the
profile of the roller. Left out: the taper of a tapered roller, whose raceways both have the contact angle of the outer
ring here. With the angle 2 nu between them the inner raceway carries cos(2 nu) of the load of the outer one. The rib
carries sin(2 nu) of it: 7 % for 4 degrees.

Without speed: centrifugal forces and gyroscopic moments of the elements are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.typing import Array, IntArray
from .hertz import LINE, LINE_CONSTANT, POINT, groove_constant, in_series

#: Young's modulus (Pa) and Poisson's ratio of bearing steel, as in Harris and Kotzalas.
STEEL = 207e9, 0.3
#: Slices of a roller: at least 30, ISO/TS 16281:2008.
SLICES = 30
#: Profiles of rollers.
LOGARITHMIC, STRAIGHT = PROFILES = ("logarithmic", "straight")


@dataclass(frozen=True)
class Row:
    """One row of rolling elements.

    Parameters
    ----------
    offset
        Place of the row's middle along the axis from the bearing's reference point (m).
    sense
        +1: its contact angle carries an axial force that pushes the shaft along +a; -1: along -a.
    """

    offset: float = 0.0
    sense: int = 1


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a bearing as functions of its displacement u.

    Attributes
    ----------
    radial, axial : ndarray, shape (n, 5)
        Displacement of the inner raceway along radius and axis per unit of u.
    begin : ndarray, shape (n, 2)
        Balls: vector between the centres of the grooves at u = 0 (m). Rollers: approach at u = 0 along the normal (m).
    normal : ndarray, shape (n, 2), or None
        Constant direction of the contact of rollers, (radial, axial); None for balls.
    distance
        Of the centres of the grooves of a ball that just touches both (m); 0 for rollers.
    constant
        Force at unit approach (N/m^exponent).
    exponent
        Of the force over the approach.
    element : ndarray, shape (n,)
        Number of the rolling element of each contact.
    """

    radial: Array
    axial: Array
    begin: Array
    normal: Array | None
    distance: float
    constant: float
    exponent: float
    element: IntArray


@dataclass(frozen=True)
class _Rolling:
    """What all rolling bearings have.

    Parameters
    ----------
    elements
        Number of rolling elements in a row.
    diameter
        Of the rolling elements, mean diameter of tapered rollers (m).
    pitch_diameter
        Of the circle through the middles of the rolling elements (m).
    contact_angle
        Between the contact's normal and the radial plane, free of load (rad).
    clearance
        Diametral internal clearance in running (m); negative: radial preload.
    preload
        Axial displacement (m) by which the rings are pressed together along the contact angle at u = 0; negative: play.
    rows
        Its rows.
    first_element
        Angle of the first rolling element of each row from e1 towards e2 (rad).
    """

    elements: int
    diameter: float
    pitch_diameter: float
    contact_angle: float = 0.0
    clearance: float = 0.0
    preload: float = 0.0
    rows: tuple[Row, ...] = (Row(),)
    first_element: float = 0.0

    @property
    def angles(self) -> Array:
        """Angle of each rolling element of a row (rad)."""
        return self.first_element + 2.0 * math.pi * np.arange(self.elements) / self.elements

    @property
    def count(self) -> int:
        """Number of rolling elements of all rows."""
        return self.elements * len(self.rows)

    def _width(self, across: float) -> float:
        """Length along the axis that rolling elements of a width take with their rows (m)."""
        offsets = [row.offset for row in self.rows]
        return across + max(offsets) - min(offsets)


def _rows(angle: Array, radius: Array, place: Array) -> tuple[Array, Array]:
    """Displacement along radius and axis of points at (angle, radius, axial place) per unit of u, (n, 5) each."""
    c, s = np.cos(angle), np.sin(angle)
    none, one = np.zeros_like(c), np.ones_like(c)
    radial = np.stack([c, none, s, -place * s, place * c], axis=-1)
    axial = np.stack([none, one, none, radius * s, -radius * c], axis=-1)
    return radial, axial


@dataclass(frozen=True)
class BallBearing(_Rolling):
    """Deep-groove (contact angle 0) and angular contact ball bearings.

    Parameters
    ----------
    inner_osculation, outer_osculation
        Radius of the groove over the diameter of the ball, > 0.5. ISO 76 has 0.52 and 0.53.
    ball, ring : (float, float)
        Young's modulus (Pa) and Poisson's ratio.
    """

    inner_osculation: float = 0.52
    outer_osculation: float = 0.53
    ball: tuple[float, float] = STEEL
    ring: tuple[float, float] = STEEL

    @property
    def constant(self) -> float:
        """k (N/m^1.5) of a ball between both raceways."""
        modulus = 1.0 / sum((1.0 - nu**2) / e for e, nu in (self.ball, self.ring))
        gamma = self.diameter * math.cos(self.contact_angle) / self.pitch_diameter
        inner = groove_constant(self.diameter, self.inner_osculation, gamma, modulus)
        outer = groove_constant(self.diameter, self.outer_osculation, -gamma, modulus)
        return in_series(inner, outer)

    @property
    def width(self) -> float:
        """Length along the axis that the balls take (m)."""
        return self._width(self.diameter)

    @cached_property
    def contacts(self) -> Contacts:
        """One contact a ball."""
        cos, sin = math.cos(self.contact_angle), math.sin(self.contact_angle)
        distance = (self.inner_osculation + self.outer_osculation - 1.0) * self.diameter
        arm = (self.inner_osculation - 0.5) * self.diameter
        radius = np.full(self.elements, 0.5 * self.pitch_diameter + arm * cos)
        parts, begin = [], []
        for row in self.rows:
            place = np.full(self.elements, row.offset + row.sense * arm * sin)
            parts.append(_rows(self.angles, radius, place))
            vector = distance * cos - 0.5 * self.clearance, row.sense * (distance * sin + self.preload)
            begin.append(np.tile(vector, (self.elements, 1)))
        radial, axial = (np.concatenate(rows) for rows in zip(*parts, strict=True))
        number = np.arange(self.count)
        return Contacts(radial, axial, np.concatenate(begin), None, distance, self.constant, POINT, number)


@dataclass(frozen=True)
class RollerBearing(_Rolling):
    """Cylindrical (contact angle 0) and tapered roller bearings, of steel.

    Parameters
    ----------
    length
        Effective length of a roller (m).
    profile
        ``logarithmic``: that of ISO/TS 16281; ``straight``: none, the slices touch together.
    axial_stiffness
        Of the ribs that hold the rings along the axis (N/m), in both directions; 0: none.
    """

    length: float = 0.0
    profile: str = LOGARITHMIC
    axial_stiffness: float = 0.0

    @property
    def slices(self) -> Array:
        """Middles of the slices along a roller (m)."""
        return self.length * ((np.arange(SLICES) + 0.5) / SLICES - 0.5)

    @property
    def drop(self) -> Array:
        """Profile P of a roller at its slices (m), ISO/TS 16281:2008, eq. 42 to 44."""
        t, length, diameter = np.abs(self.slices), self.length, self.diameter
        if self.profile == STRAIGHT:
            return np.zeros_like(t)
        if self.contact_angle != 0.0:
            return -0.00045 * diameter * np.log(1.0 - (2.0 * t / length) ** 2)
        if length <= 2.5 * diameter:
            return -0.00035 * diameter * np.log(1.0 - (2.0 * t / length) ** 2)
        crowned = np.maximum(0.0, 2.0 * t - (length - 2.5 * diameter)) / (2.5 * diameter)
        return np.asarray(-0.0005 * diameter * np.log(1.0 - crowned**2))

    @property
    def width(self) -> float:
        """Length along the axis that the rollers take (m)."""
        return self._width(self.length * math.cos(self.contact_angle))

    @cached_property
    def contacts(self) -> Contacts:
        """One contact a slice."""
        cos, sin = math.cos(self.contact_angle), math.sin(self.contact_angle)
        t = np.tile(self.slices, self.elements)
        angle = np.repeat(self.angles, SLICES)
        free = self.preload * sin - 0.5 * self.clearance * cos
        parts, normals = [], []
        for row in self.rows:
            radius = 0.5 * self.pitch_diameter - row.sense * sin * t
            parts.append(_rows(angle, radius, row.offset + cos * t))
            normals.append(np.tile((cos, row.sense * sin), (len(t), 1)))
        radial, axial = (np.concatenate(rows) for rows in zip(*parts, strict=True))
        normal = np.concatenate(normals)
        begin = (free - 2.0 * np.tile(self.drop, self.count))[:, None] * normal
        constant = LINE_CONSTANT * self.length ** (8.0 / 9.0) / SLICES
        number = np.repeat(np.arange(self.count), SLICES)
        return Contacts(radial, axial, begin, normal, 0.0, constant, LINE, number)
