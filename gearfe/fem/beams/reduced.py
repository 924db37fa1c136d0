r"""A shaft in few coordinates: rigid motion of the whole rotor, and elastic coordinates of unit mass orthogonal to it.

The first coordinates are the displacement of the rotor's mass centre along x, y, z (m), small tilts about e1 and e2,
and the spin about the axis a (rad). Then follow n elastic coordinates (m kg^1/2), by ascending frequency:

.. math::
    M = \mathrm{diag}(m, m, m, J_t, J_t, J_p, 1, \dots, 1),\qquad
    K = \mathrm{diag}(0, 0, 0, 0, 0, 0, \omega_1^2, \dots, \omega_n^2),\qquad
    M\ddot q + \Omega G\dot q + K q = f .

Both bending planes have the same shapes: displacement w along e1 with rotation theta about e2; displacement w along e2
with rotation -theta about e1. With the polar inertia per length and of the discs, and the rotations
:math:`\theta(s) = t(s)^T x` of a plane's tilt and elastic coordinates x,

.. math:: \Gamma = \int \rho I_p\, t\, t^T ds + \sum J_p\, t\, t^T = \sum_k J_k v_k v_k^T ,

the gyroscopic matrix per unit spin is ``G = sum J_k (a_k b_k^T - b_k a_k^T)``: ``b_k`` holds ``v_k`` at the tilt about
e2 and the elastic coordinates of the plane of e1; ``a_k`` holds it at the tilt about e1 and, with the other sign, at
the elastic ones of the plane of e2.

**How many coordinates.** With a residual vector for each load that acts on the shaft, free modes up to 1.5 times the
highest frequency of interest suffice. More of them raise the highest frequency of a train, which sets the steps of
explicit integrators. A station should list the loads that act there and no others. `docs/beams.md` has the figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...base.progress import one_thread
from ...base.typing import Array, BoolArray, IntArray
from .elements import Division, Family, beam_matrices, divide, hierarchic
from .modes import ElasticVectors, elastic_vectors
from .section import LOADS, SAME_PLACE, BeamShaft

#: Part of the largest polar inertia of a shaft's rotations below which one leaves the gyroscopic matrix.
SMALLEST_INERTIA = 1e-9

#: Kinds of elastic coordinates.
KINDS = ("bending e1", "bending e2", "axial", "torsion")


@dataclass(frozen=True, eq=False)
class GyroscopicPair:
    """Term ``J (a b^T - b a^T)`` of a gyroscopic matrix per unit spin.

    Attributes
    ----------
    inertia
        J, in kg m2 for coordinates in rad.
    first, second : (6 + n,)
        a and b, unit vectors over the coordinates of both bending planes.
    """

    inertia: float
    first: Array
    second: Array


@dataclass(frozen=True, eq=False)
class ReducedShaft:
    """A shaft with its discs in rigid and elastic coordinates, see the module.

    Attributes
    ----------
    name
        Of the shaft.
    mass, polar, transverse
        Of the rotor about its mass centre (kg, kg m2, kg m2).
    centre
        Axial position of the mass centre (m).
    frame : (3, 3)
        Rows e1, e2, a.
    squares : (n,)
        Squared angular frequencies of the free shaft (rad2/s2), ascending.
    kinds
        Kind of each elastic coordinate, of `KINDS`; the two of a bending shape are neighbours.
    residual : (n,)
        Whether a coordinate is a residual (static) vector and no mode.
    gyroscopic
        Terms of the gyroscopic matrix, largest first.
    nodes : (E + 1,)
        Axial positions of the elements' ends (m).
    degrees : (E,)
        Degree of the deflection in each element.
    frequency_errors : (n,)
        Estimated relative error of each mode's frequency by the elements; NaN for residual vectors.
    compliance : (stations, 4)
        Static compliance of the free rotor at each station along its own load, of `LOADS` (m/N or rad/(N m)); NaN where
        the station is not loaded.
    coefficients : tuple of four arrays, (E, functions, n) each
        Of deflection, rotation, axial displacement and twist over the functions of `fem.beams.elements.hierarchic`.
    """

    name: str
    mass: float
    polar: float
    transverse: float
    centre: float
    frame: Array
    squares: Array
    kinds: tuple[str, ...]
    residual: BoolArray
    gyroscopic: tuple[GyroscopicPair, ...]
    nodes: Array
    degrees: IntArray
    frequency_errors: Array
    compliance: Array
    coefficients: tuple[Array, ...]

    @property
    def n(self) -> int:
        """Number of elastic coordinates."""
        return len(self.squares)

    @property
    def size(self) -> int:
        """Number of coordinates, 6 + n."""
        return 6 + self.n

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.degrees)

    @property
    def frequencies_hz(self) -> Array:
        """Frequencies of the elastic coordinates of the free shaft (Hz), shape (n,)."""
        return np.sqrt(self.squares) / (2.0 * math.pi)

    @property
    def mass_diagonal(self) -> Array:
        """Diagonal of the mass matrix, shape (6 + n,)."""
        rigid = [self.mass, self.mass, self.mass, self.transverse, self.transverse, self.polar]
        return np.concatenate([rigid, np.ones(self.n)])

    @property
    def stiffness_diagonal(self) -> Array:
        """Diagonal of the stiffness matrix, shape (6 + n,)."""
        return np.concatenate([np.zeros(6), self.squares])

    def mass_matrix(self) -> Array:
        """M, shape (6 + n, 6 + n)."""
        return np.diag(self.mass_diagonal)

    def stiffness_matrix(self) -> Array:
        """K, shape (6 + n, 6 + n)."""
        return np.diag(self.stiffness_diagonal)

    def gyroscopic_matrix(self) -> Array:
        """G per unit spin (kg m2 for the tilts), shape (6 + n, 6 + n)."""
        total = np.zeros((self.size, self.size))
        for pair in self.gyroscopic:
            term = pair.inertia * np.outer(pair.first, pair.second)
            total += term - term.T
        return total

    def rows(self, along: float | Array) -> Array:
        """Motion of the axis at an axial position (m): displacement x, y, z, rotation about e1, e2, a.

        Returns
        -------
        rows : ndarray, shape (6, 6 + n), or (k, 6, 6 + n) for positions of shape (k,)
            m and rad per unit coordinate; interpolated by the functions of the elements.

        Raises
        ------
        InputError
            A position off the shaft.
        """
        places = np.atleast_1d(np.asarray(along, dtype=float))
        slack = SAME_PLACE * (self.nodes[-1] - self.nodes[0])
        off = (places < self.nodes[0] - slack) | (places > self.nodes[-1] + slack) | ~np.isfinite(places)
        if off.any():
            problem = f"is not on shaft {self.name!r}, which reaches from {self.nodes[0]:g} to {self.nodes[-1]:g} m"
            raise InputError("along", float(places[off][0]), problem, "give a position on it")
        element = np.clip(np.searchsorted(self.nodes, places, side="right") - 1, 0, self.elements - 1)
        left, right = self.nodes[element], self.nodes[element + 1]
        x = np.clip((2.0 * places - left - right) / (right - left), -1.0, 1.0)
        values = hierarchic(self.coefficients[0].shape[1] - 1, x)
        deflection, rotation, axial, twist = (
            np.einsum("kf,kfn->kn", values[:, : c.shape[1]], c[element]) for c in self.coefficients
        )
        kinds = np.array(self.kinds)
        first, second = kinds == KINDS[0], kinds == KINDS[1]
        rows = np.zeros((len(places), 6, self.size))
        arm = places - self.centre
        e1, e2, a = self.frame
        rows[:, :3, :3] = np.eye(3)
        rows[:, :3, 3] = np.cross(e1, a) * arm[:, None]
        rows[:, :3, 4] = np.cross(e2, a) * arm[:, None]
        rows[:, 3, 3] = rows[:, 4, 4] = rows[:, 5, 5] = 1.0
        sideways = (first * e1[:, None] + second * e2[:, None]) * deflection[:, None, :]
        rows[:, :3, 6:] = sideways + a[:, None] * axial[:, None, :]
        rows[:, 3, 6:] = -1.0 * second * rotation
        rows[:, 4, 6:] = first * rotation
        rows[:, 5, 6:] = twist
        return rows[0] if np.ndim(along) == 0 else rows


@one_thread()
def reduce_shaft(
    shaft: BeamShaft,
    frame: Array,
    modes_below_hz: float,
    *,
    elements: int | None = None,
    degree: int | None = None,
    tolerance: float = 1e-7,
) -> ReducedShaft:
    """Reduce a shaft to its rigid motion, its free modes up to a frequency and residual vectors of its stations.

    Parameters
    ----------
    shaft : BeamShaft
        The shaft, its discs and stations.
    frame : ndarray, shape (3, 3)
        Rows e1, e2, a: a right-handed frame, the axis last.
    modes_below_hz : float
        Highest frequency of the free modes (Hz).
    elements : int, optional
        Elements that the length would have if all were equal: no element is longer.
    degree : int, optional
        Degree of all elements; otherwise it follows from the frequency and the tolerance.
    tolerance : float
        Error of the wave number at the highest frequency, as a part of it.

    Raises
    ------
    InputError
        Values out of range, see `divide`.
    """
    division = divide(shaft, modes_below_hz, tolerance, elements, degree)
    return _reduced(shaft, _checked(frame), division, modes_below_hz)


@one_thread()
def full_shaft(
    shaft: BeamShaft,
    frame: Array,
    accurate_below_hz: float,
    *,
    elements: int | None = None,
    degree: int | None = None,
    tolerance: float = 1e-7,
) -> ReducedShaft:
    """Return all coordinates of the elements of a shaft, in the form of the reduced one.

    Parameters
    ----------
    shaft : BeamShaft
        The shaft, its discs and stations.
    frame : ndarray, shape (3, 3)
        Rows e1, e2, a: a right-handed frame, the axis last.
    accurate_below_hz : float
        Frequency up to which the elements reach the tolerance (Hz).
    elements : int, optional
        Elements that the length would have if all were equal: no element is longer.
    degree : int, optional
        Degree of all elements; otherwise it follows from the frequency and the tolerance.
    tolerance : float
        Error of the wave number at that frequency, as a part of it.

    Raises
    ------
    InputError
        Values out of range, see `divide`.
    """
    division = divide(shaft, accurate_below_hz, tolerance, elements, degree)
    return _reduced(shaft, _checked(frame), division, math.inf)


def _checked(frame: Array) -> Array:
    """Return a frame as an array, if it is one."""
    rows = np.asarray(frame, dtype=float)
    if rows.shape != (3, 3) or np.abs(rows @ rows.T - np.eye(3)).max() > 1e-9 or np.linalg.det(rows) < 0.0:
        raise InputError("frame", None, "must have three orthonormal right-handed rows", "give e1, e2 and e1 x e2")
    return rows


def _reduced(shaft: BeamShaft, frame: Array, division: Division, modes_below_hz: float) -> ReducedShaft:
    """Return the coordinates of a divided shaft: modes up to a frequency (Hz), and all residual vectors."""
    matrices = beam_matrices(shaft, division)
    places = division.nodes - 0.5 * (shaft.start + shaft.end)
    families: dict[str, tuple[Family, Array, Array, tuple[str, ...]]] = {
        "bending": (matrices.bending, *_plane_vectors(matrices.bending, places), ("radial", "tilt")),
        "axial": (matrices.axial, *_bar_vectors(matrices.axial, places), ("axial",)),
        "torsion": (matrices.torsion, *_bar_vectors(matrices.torsion, places), ("torsion",)),
    }
    compliance = np.full((len(shaft.stations), len(LOADS)), math.nan)
    elastic: dict[str, ElasticVectors] = {}
    for name, (family, rigid, trial, directions) in families.items():
        cells = [(i, d) for i, s in enumerate(shaft.stations) for d in directions if d in s.loads]
        loads = np.zeros((family.own, len(cells)))
        for column, (station, direction) in enumerate(cells):
            node = division.node(shaft.stations[station].along)
            loads[len(directions) * node + directions.index(direction), column] = 1.0
        vectors = elastic_vectors(family, np.diff(division.nodes), rigid, trial, loads, modes_below_hz)
        elastic[name] = vectors
        for cell, value in zip(cells, vectors.compliance, strict=True):
            compliance[cell[0], LOADS.index(cell[1])] = value

    order = sorted(
        (
            (float(square), KINDS.index(kind), kind, name, number)
            for kind, name in zip(KINDS, ("bending", "bending", "axial", "torsion"), strict=True)
            for number, square in enumerate(elastic[name].squares)
        ),
    )
    kinds = tuple(kind for _, _, kind, _, _ in order)
    family, rigid, _, _ = families["bending"]
    mass, transverse = np.diag(rigid.T @ family.mass[: family.own, : family.own] @ rigid)
    torsion, (turn,) = families["torsion"][0], families["torsion"][1].T
    polar = float(turn @ torsion.mass[: torsion.own, : torsion.own] @ turn)
    tilt = np.column_stack([rigid[:, 1], elastic["bending"].vectors])
    return ReducedShaft(
        name=shaft.name,
        mass=float(mass),
        polar=polar,
        transverse=float(transverse),
        centre=float(division.nodes[0] - rigid[0, 1]),
        frame=frame,
        squares=np.array([square for square, *_ in order]),
        kinds=kinds,
        residual=np.array([number >= elastic[name].modes for *_, name, number in order], dtype=bool),
        gyroscopic=_pairs(tilt.T @ family.polar[: family.own, : family.own] @ tilt, order),
        nodes=division.nodes,
        degrees=division.degrees,
        frequency_errors=np.array([elastic[name].errors[number] for *_, name, number in order]),
        compliance=compliance,
        coefficients=tuple(
            _coefficients(families[name][0], field, elastic[name].vectors, [(n, k) for *_, n, k in order], name)
            for name, field in (("bending", 0), ("bending", 1), ("axial", 0), ("torsion", 0))
        ),
    )


def _plane_vectors(family: Family, places: Array) -> tuple[Array, Array]:
    """Return unit displacement and unit tilt about the mass centre of a bending plane, and a parabola."""
    shift, tilt, bow = np.zeros((3, family.own))
    nodes = 2 * len(places)
    shift[0:nodes:2] = 1.0
    tilt[0:nodes:2], tilt[1:nodes:2] = places, 1.0
    bow[0:nodes:2], bow[1:nodes:2] = places**2, 2.0 * places
    bow[family.fields[0][:, 2]] = (0.5 * np.diff(places)) ** 2 * math.sqrt(6.0) / 1.5
    mass = family.mass[: family.own, : family.own]
    tilt -= float(shift @ mass @ tilt) / float(shift @ mass @ shift) * shift
    return np.column_stack([shift, tilt]), bow


def _bar_vectors(family: Family, places: Array) -> tuple[Array, Array]:
    """Return the rigid motion of a bar and its uniform stretching."""
    unit, stretch = np.zeros((2, family.own))
    unit[: len(places)], stretch[: len(places)] = 1.0, places
    return unit[:, None], stretch


def _pairs(plane: Array, order: list[tuple[float, int, str, str, int]]) -> tuple[GyroscopicPair, ...]:
    """Return the terms of the gyroscopic matrix from the polar inertia over a plane's tilt and elastic coordinates."""
    inertia, axes = np.linalg.eigh(0.5 * (plane + plane.T))
    terms = []
    for value, axis in zip(inertia[::-1], axes.T[::-1], strict=True):
        if value <= SMALLEST_INERTIA * inertia[-1]:
            break
        first, second = np.zeros((2, 6 + len(order)))
        first[3] = second[4] = axis[0]
        for place, (_, _, kind, _, number) in enumerate(order, 6):
            if kind == KINDS[0]:
                second[place] = axis[1 + number]
            elif kind == KINDS[1]:
                first[place] = -axis[1 + number]
        terms.append(GyroscopicPair(float(value), first, second))
    return tuple(terms)


def _coefficients(family: Family, field: int, vectors: Array, order: list[tuple[str, int]], name: str) -> Array:
    """Return the coefficients of a field over the functions of each element, zero for coordinates of other families."""
    number = family.fields[field]
    inner = (number >= 0) & (number < family.own)
    width = int(np.count_nonzero(inner.any(axis=0)))
    result = np.zeros((len(number), width, len(order)))
    chosen = [(place, k) for place, (own, k) in enumerate(order) if own == name]
    values = vectors[np.where(inner, number, 0)[:, :width]] * inner[:, :width, None]
    for place, k in chosen:
        result[:, :, place] = values[:, :, k]
    return result
