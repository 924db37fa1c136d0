r"""Timoshenko beam elements of high degree: division of a shaft, stiffness, mass and polar inertia.

In a bending plane, w is the deflection (m) and theta the rotation of the cross-section (rad), ``theta = w'`` where no
shear acts. Axial displacement and twist are bars of their own. Energies per length are

.. math::
    U' = \tfrac12 EI\,\theta'^2 + \tfrac12\kappa GA\,(w' - \theta)^2,\qquad
    T' = \tfrac12\rho A\,\dot w^2 + \tfrac12\rho I\,\dot\theta^2 ,

with Cowper's shear factor of a hollow circle, m the ratio of inner and outer diameter:

.. math:: \kappa = \frac{6(1+\nu)(1+m^2)^2}{(7+6\nu)(1+m^2)^2 + (20+12\nu)m^2} .

**Shape functions.** In an element w has the degree p >= 3 and theta the degree p - 1: linear functions and integrals of
Legendre polynomials. They contain the exact static solution of a uniform beam between loaded ends, for every ratio of
shear to bending stiffness: w is cubic, theta quadratic, w' minus theta constant. Statics are therefore exact at the
nodes, and elements do not lock. Mass and polar inertia are consistent. Cones are integrated by Gauss's rule.

**Division.** There is a node at every end of a section, disc and station. The degree of an element follows from two
rates. A wave of wave number k in elements of length h and degree q errs by the part (Ainsworth, SIAM J. Numer. Anal.
42, 2004)

.. math:: \frac{1}{2(2q+1)}\Bigl[\frac{q!}{(2q)!}\Bigr]^2 (kh)^{2q} ,

and the varying compliance of a cone, which has a fourfold pole at its apex, is approximated up to the part

.. math:: \Bigl[\frac{q^3}{3}\Bigl(\frac{r^2+1}{r^2-1}\Bigr)^4 r^{-q}\Bigr]^2 ,

r the sum of the half-axes of the largest Bernstein ellipse over the element that holds no zero of ``EI``. Elements that
would need more than `HIGHEST_DEGREE` are halved.

Cowper, J. Appl. Mech. 33 (1966), 335. Szabo and Babuska, Finite Element Analysis (1991), for the hierarchic functions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from .section import SAME_PLACE, BeamShaft, Section

#: Degree of the deflection: the lowest contains the static solution; above the highest, halving costs less.
LOWEST_DEGREE, HIGHEST_DEGREE = 3, 12

#: Degrees beyond an element's own whose functions estimate its error: an even one and an odd one.
EXTRA = 2

#: Half-axes of an ellipse (in half element lengths) beyond which a section is uniform.
NO_POLE = 1e6

#: Elements of a shaft, and unknowns of its bending in one plane, whose matrices are dense (8 N^2 bytes each); more are
#: a wrong frequency or a wrong number of elements.
MOST_ELEMENTS, MOST_UNKNOWNS = 2000, 3000
#: Lowest frequency that is tried (Hz), and halvings in the search for the highest frequency that a shaft can have.
LEAST_HZ, SEARCH = 1.0, 12


def cowper(poisson: Array | float, ratio: Array) -> Array:
    """Shear factor of a hollow circle with the ratio of inner and outer diameter (Cowper 1966, table 1)."""
    square = (1.0 + ratio**2) ** 2
    return 6.0 * (1.0 + poisson) * square / ((7.0 + 6.0 * poisson) * square + (20.0 + 12.0 * poisson) * ratio**2)


@dataclass(frozen=True, eq=False)
class Division:
    """Elements of a shaft.

    Attributes
    ----------
    nodes : (E + 1,)
        Axial positions (m), ascending.
    section : (E,)
        Number of each element's section.
    degrees : (E,)
        Degree of the deflection in each element.
    """

    nodes: Array
    section: IntArray
    degrees: IntArray

    def node(self, along: float) -> int:
        """Number of the node at an axial position (m) that was asked for as one."""
        return int(np.argmin(np.abs(self.nodes - along)))


@dataclass(frozen=True, eq=False)
class Family:
    """Matrices of one kind of motion: bending in one plane, axial, or torsion.

    The first `own` unknowns are those of the model. The others are the functions of `EXTRA` more degrees.

    Attributes
    ----------
    stiffness, mass : (N, N)
        SI units; own and extra unknowns.
    polar : (N, N)
        Polar inertia over the rotations; of bending alone, otherwise empty.
    own
        Unknowns of the model.
    fields : tuple of (E, functions) arrays of int
        For each field (w and theta, or the one of a bar) the unknown of each function of each element, -1 for none.
    """

    stiffness: Array
    mass: Array
    polar: Array
    own: int
    fields: tuple[IntArray, ...]


def divide(
    shaft: BeamShaft, highest_hz: float, tolerance: float = 1e-7, elements: int | None = None, degree: int | None = None
) -> Division:
    """Divide a shaft into elements that carry vibrations up to a frequency.

    Parameters
    ----------
    shaft : BeamShaft
        The shaft.
    highest_hz : float
        Highest frequency wanted (Hz).
    tolerance : float
        Error of the wave number at that frequency, as a part of it.
    elements : int, optional
        Elements that the length would have if all were equal: no element is longer.
    degree : int, optional
        Degree of all elements; otherwise it follows from the tolerance.

    Raises
    ------
    InputError
        Values out of range; more than `MOST_ELEMENTS` or `MOST_UNKNOWNS`, with the highest frequency that fits.
    """
    _check(highest_hz, tolerance, elements, degree)
    division = _divided(shaft, highest_hz, tolerance, elements, degree)
    if division is not None:
        return division
    problem = f"takes more than {MOST_ELEMENTS} elements, or {MOST_UNKNOWNS} unknowns, of shaft {shaft.name!r}"
    least = _divided(shaft, LEAST_HZ, tolerance, elements, degree)
    if least is None:
        key, value = ("elements", elements) if degree is None else ("degree", degree)
        raise InputError(key, value, problem, "give less, or leave it out")
    low, high = math.log(LEAST_HZ), math.log(highest_hz)
    for _ in range(SEARCH):
        middle = 0.5 * (low + high)
        fits = _divided(shaft, math.exp(middle), tolerance, elements, degree) is not None
        low, high = (middle, high) if fits else (low, middle)
    problem += f": must be <= {math.exp(low):.2g} Hz"
    raise InputError("highest frequency (Hz)", highest_hz, problem, "give a lower one: 10 to 50 kHz are usual")


def _divided(
    shaft: BeamShaft, highest_hz: float, tolerance: float, elements: int | None, degree: int | None
) -> Division | None:
    """Return the elements, None where they would be too many; see `divide`."""
    ends = shaft.ends
    wanted = [*ends, *(disc.along for disc in shaft.discs), *(station.along for station in shaft.stations)]
    slack = SAME_PLACE * shaft.length
    places = sorted(min(max(along, ends[0]), ends[-1]) for along in wanted)
    # the ends of sections stay where they are, so that no element reaches over one
    kept = list(ends)
    for along in places:
        if min(abs(along - other) for other in kept) > slack:
            kept.append(along)
    kept.sort()
    longest = math.inf if elements is None else shaft.length / elements * (1.0 + SAME_PLACE)
    nodes, sections, degrees, unknowns = [kept[0]], list[int](), list[int](), 0
    for left, right in pairwise(kept):
        number = int(np.clip(np.searchsorted(ends, 0.5 * (left + right)) - 1, 0, len(shaft.sections) - 1))
        section = shaft.sections[number]
        first = (left - ends[number]) / section.length, (right - ends[number]) / section.length
        pieces = max(1, math.ceil((right - left) / longest))
        cuts = np.linspace(*first, pieces + 1)
        spans = list(pairwise(cuts.tolist()))
        while spans:
            span = spans.pop(0)
            p = needed_degree(section, span, highest_hz, tolerance) if degree is None else degree
            if p > HIGHEST_DEGREE and degree is None:
                middle = 0.5 * (span[0] + span[1])
                spans[:0] = [(span[0], middle), (middle, span[1])]
            else:
                nodes.append(ends[number] + float(span[1]) * section.length)
                sections.append(number)
                degrees.append(p)
                unknowns += 2 * p - 1  # deflections and rotations
            if len(nodes) + len(spans) > MOST_ELEMENTS or unknowns > MOST_UNKNOWNS:
                return None
        nodes[-1] = right
    return Division(np.array(nodes), np.array(sections), np.array(degrees))


def _check(highest_hz: float, tolerance: float, elements: int | None, degree: int | None) -> None:
    if not 0.0 < highest_hz < math.inf:
        raise InputError("highest frequency (Hz)", highest_hz, "must be > 0 and finite", "give the highest one wanted")
    if not 1e-12 <= tolerance <= 1e-2:
        raise InputError("tolerance", tolerance, "must be from 1e-12 to 1e-2", "give 1e-7")
    if elements is not None and not 1 <= elements <= MOST_ELEMENTS:
        raise InputError("elements", elements, f"must be from 1 to {MOST_ELEMENTS}", "leave it out")
    if degree is not None and not LOWEST_DEGREE <= degree <= HIGHEST_DEGREE:
        problem = f"must be from {LOWEST_DEGREE} to {HIGHEST_DEGREE}"
        raise InputError("degree", degree, problem, "leave it out: it follows from the frequency")


def needed_degree(section: Section, span: tuple[float, float], highest_hz: float, tolerance: float) -> int:
    """Return the degree that an element needs, or one above `HIGHEST_DEGREE` if none suffices.

    Parameters
    ----------
    section : Section
        The section.
    span : tuple of float
        Begin and end of the element, in parts of the section's length.
    highest_hz : float
        Highest frequency wanted (Hz).
    tolerance : float
        Of the frequency, relative.
    """
    length = (span[1] - span[0]) * section.length
    phase = max(wave_number(section, part, highest_hz) for part in span) * length
    rate = _ellipse(section, span)
    for q in range(LOWEST_DEGREE - 1, HIGHEST_DEGREE):
        logarithm = 2.0 * (math.lgamma(q + 1) - math.lgamma(2 * q + 1)) - math.log(2.0 * (2 * q + 1))
        wave = logarithm + 2.0 * q * math.log(max(phase, 1e-300))
        pole = math.log(q**3 / 3.0) + 4.0 * math.log((rate**2 + 1.0) / (rate**2 - 1.0)) - q * math.log(rate)
        if max(wave, 2.0 * pole) <= math.log(tolerance):
            return q + 1
    return HIGHEST_DEGREE + 1


def wave_number(section: Section, part: float, frequency_hz: float) -> float:
    """Largest wave number (1/m) of a uniform Timoshenko beam with the section at a part of its length."""
    outer, inner = _diameters(section, np.array([part]))
    square = (2.0 * math.pi * frequency_hz) ** 2
    shear = square * section.density / (float(cowper(section.poisson, inner / outer)[0]) * section.shear_modulus)
    bend = square * section.density / section.young
    coupling = 16.0 * bend / float((outer**2 + inner**2)[0])
    return math.sqrt(0.5 * (shear + bend) + math.sqrt(0.25 * (shear - bend) ** 2 + coupling))


def _ellipse(section: Section, span: tuple[float, float]) -> float:
    """Sum of the half-axes of the largest Bernstein ellipse over a span in which D^4 - d^4 has no zero."""
    outer, inner = _diameters(section, np.array(span))
    nearest = NO_POLE
    for turn in (1.0, -1.0, 1j, -1j):
        at_left, at_right = outer - turn * inner
        if abs(at_right - at_left) > 1e-9 * abs(at_left):
            zero = complex((at_left + at_right) / (at_left - at_right))
            root = (zero - 1.0) ** 0.5 * (zero + 1.0) ** 0.5
            nearest = min(nearest, max(abs(zero + root), abs(zero - root)))
    return nearest


def _diameters(section: Section, part: Array) -> tuple[Array, Array]:
    """Outer and inner diameter (m) at parts of a section's length."""
    outer = section.outer_start + part * (section.outer_end - section.outer_start)
    return outer, section.inner_start + part * (section.inner_end - section.inner_start)


@lru_cache(maxsize=32)
def legendre(degree: int, points: int) -> tuple[Array, Array, Array]:
    """Gauss weights, hierarchic functions and their derivatives on (-1, 1) at Gauss points: (g,), (g, d + 1) each."""
    x, weight = np.polynomial.legendre.leggauss(points)
    return weight, hierarchic(degree, x), hierarchic_slopes(degree, x)


def hierarchic(degree: int, x: Array) -> Array:
    """Evaluate both linear functions and the integrals of Legendre polynomials up to a degree at x in [-1, 1]: (k, d +
    1)."""
    polynomials = np.polynomial.legendre.legvander(x, max(degree, 1))
    values = np.empty((len(x), degree + 1))
    values[:, 0], values[:, 1] = 0.5 * (1.0 - x), 0.5 * (1.0 + x)
    j = np.arange(2, degree + 1)
    values[:, 2:] = (polynomials[:, 2 : degree + 1] - polynomials[:, : degree - 1]) / np.sqrt(2.0 * (2 * j - 1))
    return values


def hierarchic_slopes(degree: int, x: Array) -> Array:
    """Derivatives of `hierarchic` by x."""
    slopes = np.empty((len(x), degree + 1))
    slopes[:, 0], slopes[:, 1] = -0.5, 0.5
    j = np.arange(2, degree + 1)
    slopes[:, 2:] = np.polynomial.legendre.legvander(x, max(degree - 1, 1))[:, 1:degree] * np.sqrt((2 * j - 1) / 2.0)
    return slopes


@dataclass(frozen=True, eq=False)
class BeamMatrices:
    """The three families of a shaft: bending (one plane), axial, torsion; and its division."""

    division: Division
    bending: Family
    axial: Family
    torsion: Family


def beam_matrices(shaft: BeamShaft, division: Division) -> BeamMatrices:
    """Assemble the matrices of a divided shaft with its discs."""
    top = int(division.degrees.max()) + EXTRA
    points = top + 2
    weight, values, slopes = legendre(top, points)
    x = np.polynomial.legendre.leggauss(points)[0]
    nodes, lengths = division.nodes, np.diff(division.nodes)
    starts = np.array(shaft.ends)[division.section]
    along = nodes[:-1, None] + 0.5 * (x + 1.0) * lengths[:, None]
    table = np.array(
        [
            (s.length, s.outer_start, s.outer_end, s.inner_start, s.inner_end, s.young, s.poisson, s.density)
            for s in shaft.sections
        ]
    )[division.section].T[:, :, None]
    length, outer_start, outer_end, inner_start, inner_end, young, poisson, density = table
    part = (along - starts[:, None]) / length
    outer = outer_start + part * (outer_end - outer_start)
    inner = inner_start + part * (inner_end - inner_start)
    area, second = math.pi / 4.0 * (outer**2 - inner**2), math.pi / 64.0 * (outer**4 - inner**4)
    shear = young / (2.0 * (1.0 + poisson))
    half = 0.5 * weight * lengths[:, None]
    slope = 2.0 / lengths[:, None]
    shear_area = cowper(poisson, inner / outer) * shear * area * half

    def pairs(left: Array, right: Array) -> Array:
        """Products of functions at the Gauss points, (g, functions of left * functions of right)."""
        return (left[:, :, None] * right[:, None, :]).reshape(points, -1)

    def integral(left: Array, right: Array, coefficient: Array) -> Array:
        product = coefficient @ pairs(left, right)
        return product.reshape(len(lengths), left.shape[1], right.shape[1])

    turn, turn_slopes = values[:, :top], slopes[:, :top]  # theta has one degree less
    count = 2 * top + 1
    stiffness, mass, polar = (np.zeros((len(lengths), count, count)) for _ in range(3))
    w, t = slice(0, top + 1), slice(top + 1, count)
    stiffness[:, w, w] = integral(slopes, slopes, shear_area * slope**2)
    stiffness[:, w, t] = -integral(slopes, turn, shear_area * slope)
    stiffness[:, t, w] = stiffness[:, w, t].transpose(0, 2, 1)
    stiffness[:, t, t] = integral(turn_slopes, turn_slopes, young * second * half * slope**2)
    stiffness[:, t, t] += integral(turn, turn, shear_area)
    line_mass = integral(values, values, density * area * half)
    inertia = integral(values, values, density * second * half)
    mass[:, w, w] = line_mass
    mass[:, t, t] = inertia[:, :top, :top]
    polar[:, t, t] = 2.0 * mass[:, t, t]

    at = [division.node(disc.along) for disc in shaft.discs]
    number, bar_number = _numbers(division, top, fields=2), _numbers(division, top, fields=1)
    bending = _family(number, (top + 1, top), stiffness, mass, polar)
    axial = _family(bar_number, (top + 1,), integral(slopes, slopes, young * area * half * slope**2), line_mass, None)
    twist = integral(slopes, slopes, 2.0 * shear * second * half * slope**2)
    torsion = _family(bar_number, (top + 1,), twist, 2.0 * inertia, None)
    for node, disc in zip(at, shaft.discs, strict=True):
        bending.mass[2 * node, 2 * node] += disc.mass
        bending.mass[2 * node + 1, 2 * node + 1] += disc.transverse
        bending.polar[2 * node + 1, 2 * node + 1] += disc.polar
        axial.mass[node, node] += disc.mass
        torsion.mass[node, node] += disc.polar
    return BeamMatrices(division, bending, axial, torsion)


def _numbers(division: Division, top: int, fields: int) -> tuple[IntArray, int, int]:
    """Unknowns of each element's functions, (E, functions of all fields), -1 for none; own and all unknowns.

    Nodes come first, their fields side by side, then the inner functions of the elements, then the extra ones.
    """
    elements = len(division.degrees)
    number = []
    own = size = fields * (elements + 1)
    for field in range(fields):
        functions = np.full((elements, top + 1 - field), -1)
        functions[:, 0] = fields * np.arange(elements) + field
        functions[:, 1] = functions[:, 0] + fields
        number.append(functions)
    for extra in (False, True):
        own = size
        for field, functions in enumerate(number):
            degree = np.arange(functions.shape[1])
            last = division.degrees[:, None] - field
            inner = (degree > last) & (degree <= last + EXTRA) if extra else (degree >= 2) & (degree <= last)
            functions[inner] = size + np.arange(np.count_nonzero(inner))
            size += int(np.count_nonzero(inner))
    return np.hstack(number), own, size


def _family(
    numbers: tuple[IntArray, int, int], widths: tuple[int, ...], stiffness: Array, mass: Array, polar: Array | None
) -> Family:
    """Sum the matrices of elements, (E, functions, functions) each, into those of a family."""
    number, own, size = numbers
    used = number >= 0
    chosen = used[:, :, None] & used[:, None, :]
    place = (number[:, :, None] * size + number[:, None, :])[chosen]

    def sum_up(parts: Array) -> Array:
        return np.bincount(place, parts[chosen], size * size).reshape(size, size)

    fields = tuple(np.split(number, np.cumsum(widths)[:-1], axis=1))
    full_polar = np.zeros((0, 0)) if polar is None else sum_up(polar)
    return Family(sum_up(stiffness), sum_up(mass), full_polar, own, fields)
