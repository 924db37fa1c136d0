r"""Fit a mesh law to forces of tooth pairs by linear least squares.

The pair law is :math:`\Lambda/F = 2b + b_y + a_0 - B\,(y - y_0)` with :math:`y = \ln F`, b a tensor of cubic splines
over :math:`(\psi, y)`: so :math:`\Phi = F^2 [b + a_0/2 + B/4 - B(y - y_0)/2]` is its energy. :math:`B = 1/(\pi E^* w)`
is Hertz's line contact, which makes b smooth where a pair comes into contact and where it leaves. Each contact solution
gives :math:`\Lambda = \delta - t(\psi_k) - \sum_l C F_l` for its loaded pairs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline, PchipInterpolator
from scipy.sparse.linalg import spsolve

from ...base.typing import Array
from .law import NO_CONTACT, MeshLaw, indefinite

#: Weights of the second derivative of b over the phase (in mesh cycles), and of the second and first over ln F (nm/N).
#: Squares are integrated, so that they mean the same on any nodes: they decide where no pair force was found.
SMOOTH_PHASE, SMOOTH_FORCE, LEVEL_FORCE = 1e-4, 0.25, 0.1
#: Pairs with less than this share of the mesh force count less: what they yield is divided by their force.
SHARE = 0.5
#: What the approach of a contact solution is off by (m) where flanks have kinks: smaller approaches count less.
NOISE = 1e-9
#: Least dLambda/dF, in parts of the least Lambda/F of contact solutions: b may be anything where none are near; and in
#: parts of what makes J = diag(dLambda/dF) + C positive definite.
LEAST_COMPLIANCE, DEFINITE = 0.7, 1.05
#: Width of the cells of the pair force, in parts of the geometric mean of their ends: Hermite's cubic of B F ln F errs
#: by B h^4/(192 F^3) in a cell of width h, which is then 1e-4 of Lambda. End of the first cell, in parts of the asked
#: mesh force; and the part of it below which an error counts as of that, so that cells may be wider.
FORCE_CELL, FIRST_CELL, LEAST_FORCE = 0.9, 0.0025, 0.1
#: Data determine the coefficient of a cubic B-spline if they reach the node beside its middle, where it has this value.
EDGE = 1.0 / 6.0
#: Largest distance of nodes of b over ln F: closer ones would lie between the forces of contact solutions.
FORCE_STEP = 1.6
NANO = 1e-9


@dataclass(frozen=True)
class PairForces:
    """Forces of p tooth pairs in contact solutions, all of shape (p,).

    Attributes
    ----------
    angle
        psi_k, pinion angle of the pair's own tooth (rad).
    force
        F_k (N).
    share
        F_k over the mesh force.
    approach
        Approach less that of the rigid touch of this pair, less what the other pairs' forces make (m).
    """

    angle: Array
    force: Array
    share: Array
    approach: Array


@dataclass(frozen=True)
class TouchCurve:
    """t and its slope at all nodes of the phase of a pair (rad, m, m/rad); `NO_CONTACT` where its flanks never meet."""

    angle: Array
    value: Array
    slope: Array


@dataclass(frozen=True)
class Couple:
    """C (m/N) over the pinion angle (rad) of the lower pair's tooth, from values at rising angles; constant outside."""

    angle: Array
    compliance: Array

    def __call__(self, angle: Array, derivative: int = 0) -> Array:
        """C or its slope (m/(N rad))."""
        inside = np.clip(angle, self.angle[0], self.angle[-1])
        made: Array = PchipInterpolator(self.angle, self.compliance)(inside, derivative)
        return made if derivative == 0 else np.where(inside == angle, made, 0.0)


def fit_law(
    found: PairForces,
    touch: TouchCurve,
    couples: Sequence[Couple],
    *,
    cells: int,
    hertz: float,
    base_radii: tuple[float, float],
    reach: float,
    force: float,
) -> MeshLaw:
    """Fit a law to pair forces, without backlash.

    Parameters
    ----------
    found : PairForces
        Forces of tooth pairs in contact solutions.
    touch : TouchCurve
        Rigid touch at whole mesh cycles of `cells` nodes each.
    couples
        C of pairs one, two, ... teeth apart.
    cells : int
        Cells of the phase in a mesh cycle.
    hertz
        B (m/N).
    base_radii : (float, float)
        Of pinion and wheel (m).
    reach : float
        Approach beyond the first touch (m) up to which the law is known.
    force : float
        Mesh force (N) that the law is asked for: errors below a tenth of it count as of that.
    """
    y = np.log(found.force)
    parts = force_cells(1.02 * float(found.force.max()), force)
    ends = np.log(parts[[1, -1]])
    knots = np.linspace(float(ends[0]), float(ends[1]), 1 + math.ceil(np.ptp(ends) / FORCE_STEP))
    phase, log_force = _clamped(touch.angle), _clamped(knots)
    P = BSpline.design_matrix(found.angle, phase, 3).tocsr()
    tied = _level_beyond(P)
    P = P @ tied
    at = np.clip(y, *ends)
    Y = [_columns(log_force, at, order) for order in (0, 1)]
    middle, level = float(y.mean()), float(np.average(found.approach / found.force, weights=found.share))
    right = (found.approach / found.force - level + hertz * (y - middle)) / NANO
    A = _rows_kron(P, 2 * Y[0] + Y[1])
    exact = found.approach**2 / (found.approach**2 + NOISE**2)
    # an error of Lambda/F is one of the force where that is not small
    small = np.minimum(1.0, found.force / (LEAST_FORCE * force))
    weight = sparse.diags_array(exact * small * np.minimum(1.0, found.share / SHARE))
    n, m = P.shape[1], Y[0].shape[1]
    cycle = touch.angle[cells] - touch.angle[0]
    (whole, _, bent), (along, sloped, curved) = _grams(phase, cycle), _grams(log_force, 1.0)
    penalty = (
        SMOOTH_PHASE**2 * sparse.kron(tied.T @ bent @ tied, along)
        + sparse.kron(tied.T @ whole @ tied, SMOOTH_FORCE**2 * curved + LEVEL_FORCE**2 * sloped)
        + 1e-12 * sparse.eye_array(n * m)
    )
    rows = weight @ A
    b = NANO * spsolve(sparse.csc_matrix(rows.T @ rows + penalty), rows.T @ (weight @ right)).reshape(n, m)
    b = tied @ b
    # Lambda and its slope at the forces between the cells: splines over the phase
    at = np.log(parts[1:])
    values, slopes, bends = (_columns(log_force, at, order).T for order in (0, 1, 2))
    line = level - hertz * (at - middle)
    approach = (b @ (2 * values + slopes) + line) * parts[1:]
    slope = b @ (2 * values + 3 * slopes + bends) + line - hertz
    coupling = _couplings(touch.angle, couples, cells)
    least = LEAST_COMPLIANCE * float((found.approach / found.force)[exact > 0.5].min(initial=level))
    least = max(least, DEFINITE * indefinite(coupling, np.diff(touch.angle[: cells + 1])))
    approach, slope = _rising(parts, approach, slope, least)
    # beyond the largest force Lambda is linear, so that it rises for all forces
    approach = np.column_stack([approach, approach[:, -1] + slope[:, -1] * parts[-1]])
    slope, parts = np.column_stack([slope, slope[:, -1]]), np.append(parts, 2.0 * parts[-1])
    return MeshLaw(
        nodes=touch.angle[: cells + 1],
        forces=parts,
        touch=_by_slots(touch_cubics(touch), cells),
        energies=_by_slots(_energies(phase, parts, approach, slope), cells),
        coupling=coupling,
        base_radii=base_radii,
        backlash=0.0,
        reach=reach,
    )


def force_cells(largest: float, force: float) -> Array:
    """Pair forces (N) at which Lambda's cubics end, from 0 to the largest; `force` is the asked mesh force (N)."""
    ends = [largest]
    while ends[-1] > FIRST_CELL * force:
        wider = max(1.0, 2.0 * LEAST_FORCE * force / ends[-1]) ** 0.25
        ends.append(ends[-1] * math.exp(-2.0 * math.asinh(0.5 * FORCE_CELL * wider)))
    return np.array([0.0, *reversed(ends)])


def _level_beyond(P: sparse.csr_array) -> sparse.csr_array:
    """Coefficients of all splines over the phase from those in reach of data; P has the splines at the data's places.

    Before the first and behind the last of these, where pairs touch beyond the reach, b is constant. If it went on
    rising as at the ends of contact, compliances would be negative, and there would be more than one set of pair
    forces.
    """
    n = P.shape[1]
    known = np.flatnonzero(P.max(axis=0).toarray().ravel() >= EDGE)
    low, high = int(known[0]), int(known[-1])
    columns = np.clip(np.arange(n), low, high) - low
    return sparse.csr_array((np.ones(n), (np.arange(n), columns)), shape=(n, high - low + 1))


def _clamped(x: Array) -> Array:
    return np.concatenate([[x[0]] * 3, x, [x[-1]] * 3])


def _columns(knots: Array, x: Array, order: int) -> Array:
    """All cubic B-splines, or a derivative, at x: (points, splines)."""
    made: Array = BSpline(knots, np.eye(len(knots) - 4), 3)(x, nu=order)
    return made


def _grams(knots: Array, width: float) -> list[sparse.csr_array]:
    """Integrals over x/width of the products of all cubic B-splines, of their first and of their second derivatives."""
    x, w = np.polynomial.legendre.leggauss(4)
    ends = np.unique(knots)
    half = 0.5 * np.diff(ends)[:, None]
    places, weights = (0.5 * (ends[:-1] + ends[1:])[:, None] + half * x).ravel(), (half * w).ravel() / width
    made = [width**order * _columns(knots, places, order) for order in range(3)]
    return [sparse.csr_array(B.T @ (weights[:, None] * B)) for B in made]


def _rows_kron(A: sparse.csr_array, B: Array) -> sparse.csr_array:
    """Row by row the Kronecker product."""
    A = A.tocoo()
    width = B.shape[1]
    column = (A.col[:, None] * width + np.arange(width)).ravel()
    data = (A.data[:, None] * B[A.row]).ravel()
    return sparse.csr_array((data, (np.repeat(A.row, width), column)), shape=(A.shape[0], A.shape[1] * width))


def _cubics(x: Array, value: Array, slope: Array) -> Array:
    """Hermite's cubics between nodes, (cells, 4)."""
    h = np.diff(x)
    secant = np.diff(value) / h
    bend = (3 * secant - 2 * slope[:-1] - slope[1:]) / h
    return np.stack([value[:-1], slope[:-1], bend, (slope[:-1] + slope[1:] - 2 * secant) / h**2], axis=1)


def _couplings(angle: Array, couples: Sequence[Couple], cells: int) -> Array:
    """Cubics of C, (teeth apart, lower slot, cells, 4)."""
    slots = (len(angle) - 1) // cells
    made = np.zeros((slots - 1, slots - 1, cells, 4))
    for k, couple in enumerate(couples[: slots - 1]):
        whole = _cubics(angle, couple(angle), couple(angle, 1))
        made[k, : slots - 1 - k] = _by_slots(whole, cells)[: slots - 1 - k]
    return made


def touch_cubics(touch: TouchCurve) -> Array:
    """Cubics of t between the nodes, (cells, 4); constant at `NO_CONTACT` beside places where flanks never meet."""
    a, b = touch.value[:-1], touch.value[1:]
    made = _cubics(touch.angle, touch.value, touch.slope)
    made[(a >= NO_CONTACT) | (b >= NO_CONTACT)] = (NO_CONTACT, 0.0, 0.0, 0.0)
    return made


def _energies(phase: Array, parts: Array, approach: Array, slope: Array) -> Array:
    """Coefficients (phase cells, force cells, 4, 5) from the splines of Lambda and its slope at the cells' ends."""
    made = np.zeros((len(approach), len(parts) - 1, 5))
    for j, h in enumerate(np.diff(parts)):
        one, d1 = approach[:, j], slope[:, j]
        if j == 0:  # from no force on: what meets value and slope at the first node
            made[:, 0, 2], made[:, 0, 3] = 0.5 * (2 * one / h - d1), (d1 - one / h) / (3 * h)
            continue
        low, d0 = approach[:, j - 1], slope[:, j - 1]
        secant = (one - low) / h
        cubic = [low, d0, (3 * secant - 2 * d0 - d1) / h, (d0 + d1 - 2 * secant) / h**2]
        before = parts[j] - parts[j - 1]
        made[:, j, 0] = made[:, j - 1] @ before ** np.arange(5)
        made[:, j, 1:] = np.stack(cubic, axis=1) / np.arange(1, 5)
    spline, begin = BSpline(phase, made.reshape(len(made), -1), 3), np.unique(phase)[:-1]
    orders = np.stack([spline(begin, nu=a) / math.factorial(a) for a in range(4)], axis=1)  # cells, order, rest
    whole = orders.reshape(len(begin), 4, len(parts) - 1, 5)
    return np.ascontiguousarray(whole.transpose(0, 2, 1, 3))


def _rising(parts: Array, approach: Array, slope: Array, least: float) -> tuple[Array, Array]:
    """Lambda and its slope at the ends of the force cells, so that the slope is `least` (m/N) at least in all of them.

    Sufficient for cubics by Fritsch and Carlson (SIAM J. Numer. Anal. 17, 1980): slopes of 0 to 3 times the secants on
    both sides; for the quadratic of the first cell 0 to 2 times. What holds for the coefficients of splines over the
    phase holds between their nodes, as B-splines are positive.
    """
    h = np.diff(parts)
    secant = np.diff(approach, axis=1, prepend=0.0) / h - least
    poor = np.any(secant < 0.0, axis=1, keepdims=True)
    secant = np.maximum(secant, 0.0)
    approach = np.where(poor, np.cumsum((secant + least) * h, axis=1), approach)
    most = 3.0 * secant
    most[:, 0] = 2.0 * secant[:, 0]
    most[:, :-1] = np.minimum(most[:, :-1], 3.0 * secant[:, 1:])
    return approach, least + np.clip(slope - least, 0.0, most)


def _by_slots(cells_of_pair: Array, cells: int) -> Array:
    """From the cells that one pair passes to slots: slot k holds those of pair k while the phase runs one cycle."""
    return np.ascontiguousarray(cells_of_pair.reshape(-1, cells, *cells_of_pair.shape[1:]))
