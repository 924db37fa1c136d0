r"""What loads on a flank do to it: finite elements for tooth and gear, half-plane and wedge near the load.

A line load f per width at the arc t of a tooth moves the flank of the tooth k steps on at s by

.. math::
    u(s) = w\,H_k(s,t)\,f - \delta_{k0}\,\tfrac{1}{E'}\Big(\tfrac2\pi\ln|s-t|\,I + W\ln(y(s)+y(t))\Big) f

with the width w and the surface of a half-plane and of a wedge (`.panels`). y is the distance from the corner of flank
and tip circle, which is virtual under a tip round. What is left, the far-field influence H, is smooth: no load is near
it any more. It is known from the finite-element answers to elliptic bumps of pressure at some fifteen stations, less
the bracket under the same bumps,

.. math::
    H_k(s_i, s_j) = b_i^T C^{FE}_k b_j
    + \delta_{k0}\,\tfrac{1}{w E'}\,\langle\tfrac2\pi\ln|s-t|\,I + W\ln(y+y)\rangle_{ij},

and runs between them on cubic splines, as a parabola beyond the last station. Bumps average over their half width a,
which adds a^2/8 of the second derivative on either side. Where H is evaluated at a contact, that is corrected to the
contact's width (`gearfe.gears.contact.half_plane`).

The bumps are two elements wide, so a mesh whose flank elements are 0.1 module serves as well as a fine one. They are at
least 0.2 module wide, since second derivatives of H magnify the noise of the elements.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, ComplexArray
from ..geometry.face import Face, face_of
from ..geometry.spur_gear import Gear
from .compliance import GearBody
from .flank import Flank, edge_shapes, gauss_rule
from .panels import ELLIPSE_W, ELLIPSE_X, LEAST_DISTANCE, mean_log, wedge_tensor

#: Half width of a bump, in elements and at least in modules; distance of two stations in half widths.
BUMP_ELEMENTS, BUMP_MODULES, SPACING = 2.0, 0.2, 0.8
#: Nearer to an end of the flank than this share of an element there is no station.
TOO_NEAR = 0.75


class FarFields(dict[int, Array]):
    """H between the stations of teeth so many steps apart, each made when it is first asked for.

    Parameters
    ----------
    sides : ndarray, shape (2k, b)
        Displacements of the stations by those of a tooth's interface (-).
    body : GearBody
        The gear.
    """

    def __init__(self, sides: Array, body: GearBody) -> None:
        super().__init__()
        self.sides, self.body = sides, body

    def __missing__(self, step: int) -> Array:
        made: Array = self.sides @ self.body.coupling[step % self.body.teeth] @ self.sides.T
        self[step] = made
        return made


@dataclass(frozen=True)
class FlankCompliance:
    """The working flank of one elastic gear: where it is, and what loads on it do to it.

    Attributes
    ----------
    face
        The exact flank.
    inverse_modulus
        1/E' (1/Pa) per width of the contact.
    corner
        Where flank and tip circle meet, or would without the tip round, in the tooth's frame (m).
    wedge : ndarray, shape (2, 2)
        W in the tooth's axes (-).
    stations, bumps : ndarray, shape (k,)
        Arc lengths of the stations and half widths of their bumps (m).
    far_field : mapping of int to ndarray, shape (2k, 2k)
        Step -> H between the stations of teeth so many steps apart, tooth axes, xy by station (m/N).
    """

    face: Face
    inverse_modulus: float
    corner: complex
    wedge: Array
    stations: Array
    bumps: Array
    far_field: dict[int, Array]

    def distance(self, s: Array) -> Array:
        """Distance y (m) of the flank at arc lengths s (m) from the corner."""
        here = np.maximum(s, self.face.arc[0])
        return np.maximum(np.abs(self.face.at(here)[0] - self.corner), LEAST_DISTANCE) + (here - s)


@dataclass(frozen=True)
class Shapes:
    """Shape functions of the stations of pinion and wheel, k each: cubic splines, a parabola beyond the last station.

    Without the parabola the curvature of the influence would jump at the last station, and with it the equations.

    Attributes
    ----------
    stations : ndarray, shape (2, k)
        Arc lengths (m), infinite where a gear has fewer.
    origin : ndarray, shape (2 (k + 1),)
        Arc lengths from which the pieces count, one before the first station and one behind each (m).
    powers : ndarray, shape (2 (k + 1), 3 k, 4)
        Coefficients of the rising powers of the arc length from there: of the functions, slopes and curvatures.
    """

    stations: Array
    origin: Array
    powers: Array

    def at(self, s: Array) -> Array:
        """At arc lengths s (m) of shape (p, 2): shape functions, slopes (1/m) and curvatures (1/m2), (p, 2, 3, k)."""
        count = self.stations.shape[1]
        piece = (s[:, :, None] >= self.stations).sum(axis=2) + np.array([0, count + 1])
        t = s - self.origin.take(piece)
        powers = t[:, :, None, None] ** np.arange(4)[:, None]
        return np.asarray((self.powers.take(piece, axis=0) @ powers).reshape(*s.shape, 3, count))

    def values_at(self, s: Array) -> Array:
        """Return the shape functions at arc lengths s (m) of shape (p, 2), shape (p, 2, k)."""
        count = self.stations.shape[1]
        piece = (s[:, :, None] >= self.stations).sum(axis=2) + np.array([0, count + 1])
        powers = (s - self.origin.take(piece))[:, :, None, None] ** np.arange(4)[:, None]
        return np.asarray((self.powers[:, :count].take(piece, axis=0) @ powers)[..., 0])

    def along(self, values: ComplexArray, s: Array) -> ComplexArray:
        """What has the values at the stations, shape (p, 2, k), at many arc lengths s (m), shape (p, 2, m)."""
        count = self.stations.shape[1]
        powers = self.powers.reshape(2, count + 1, 3, count, 4)[:, :, 0].transpose(0, 2, 1, 3).reshape(2, count, -1)
        cubics = np.matmul(values.swapaxes(0, 1), powers).reshape(2, len(s), count + 1, 4)
        gear, contact = np.arange(2)[:, None], np.arange(len(s))[:, None, None]
        piece = (s[..., None] >= self.stations[:, None]).sum(axis=3)
        t = s - self.origin.reshape(2, -1)[gear, piece]
        a, b, c, d = np.moveaxis(cubics[gear, contact, piece], -1, 0)
        return np.asarray(((d * t + c) * t + b) * t + a)


def shapes_of(stations: Sequence[Array]) -> Shapes:
    """Shape functions of the stations (m) of pinion and wheel."""
    most = max(len(one) for one in stations)
    padded, origin = np.full((2, most), np.inf), np.zeros((2, most + 1))
    powers = np.zeros((2, most + 1, 3, most, 4))
    for gear, at in enumerate(stations):
        k = len(at)
        padded[gear, :k] = at
        origin[gear, : k + 1] = at[[0, *range(k)]]
        value = np.zeros((k + 1, k, 4))
        value[1:k] = cubic_spline(at)
        t = at[-1] - at[-2]
        value[0, :, :3] = value[1, :, :3]
        value[k, :, :3] = value[k - 1] @ [[1, 0, 0], [t, 1, 0], [t**2, 2 * t, 1], [t**3, 3 * t**2, 3 * t]]
        slope = value[..., 1:] * np.array([1, 2, 3])
        for order, made in enumerate((value, slope, slope[..., 1:] * np.array([1, 2]))):
            powers[gear, : k + 1, order, :k, : made.shape[-1]] = made
    return Shapes(padded, origin.ravel(), powers.reshape(2 * (most + 1), 3 * most, 4))


def cubic_spline(at: Array) -> Array:
    """Cubic splines of the unit vectors, their third derivative continuous at the last station but one at both ends.

    Their slopes at the stations follow from continuous second derivatives (C. de Boor, A Practical Guide to Splines,
    1978, chapter IV, "not a knot"). Through fewer than four stations runs the polynomial. Written out, since the
    interpolation of a library costs a third of a second to load.

    Parameters
    ----------
    at : ndarray, shape (k,)
        Rising stations, two at least.

    Returns
    -------
    ndarray, shape (k - 1, k, 4)
        Coefficients of the rising powers of the distance from the beginning of the piece: piece, vector, power.
    """
    h, eye = np.diff(at)[:, None], np.eye(len(at))
    d, begin, end = np.diff(eye, axis=0) / h, eye[:-1], eye[1:]
    # the last two coefficients of each piece: what the slopes and what the values do to them
    square = np.stack([-(2 * begin + end), 3 * d]) / h
    cube = np.stack([begin + end, -2 * d]) / h**2
    kinks, jumps = square[:, :-1] + 3 * h[:-1] * cube[:, :-1] - square[:, 1:], np.diff(cube, axis=1) * h[1:]
    few = np.concatenate([jumps, cube[:, :1] * h[0], square[:, :1]], axis=1)[:, :2]
    of_slopes, of_values = np.concatenate([kinks, jumps[:, [0, -1]] if len(at) > 3 else few], axis=1)
    m = -np.linalg.solve(of_slopes, of_values)
    return np.stack([begin, m[:-1], square[0] @ m + square[1], cube[0] @ m + cube[1]], axis=-1)


def flank_compliance(gear: Gear, body: GearBody) -> FlankCompliance:
    """Reduce the finite-element flank of a gear to its stations; once for each body and gear."""
    if gear in body.compliances:
        known: FlankCompliance = body.compliances[gear]
        return known
    face, inverse_modulus, module = face_of(gear), body.contact_compliance, gear.module
    corner, wedge = corner_of(face)
    stations, bumps, nodal = stations_of(body.flank, float(face.arc[0]), module)
    loads = np.kron(nodal, np.eye(2))
    sides = loads @ body.interface
    far_field = FarFields(sides, body)
    made = FlankCompliance(face, inverse_modulus, corner, wedge, stations, bumps, far_field)
    far_field[0] = far_field[0] + loads @ body.own @ loads.T + inverse_modulus / body.width * local_bracket(made)
    body.compliances[gear] = made
    return made


def corner_of(face: Face) -> tuple[complex, Array]:
    """Corner (m) of flank and tip circle, and the tensor W of the wedge there in the tooth's axes."""
    end = np.array(1.0)
    point, normal = complex(face.points(end)), complex(face.normals(end))
    tangent, tip = -1j * normal, abs(complex(face.points(np.array(face.end))))
    along = (point * tangent.conjugate()).real
    sign = -1 if face.internal else 1  # the tip circle's normal points inwards
    if not face.sharp:  # straight on to the tip circle
        point = point + tangent * (sign * math.sqrt(along**2 - abs(point) ** 2 + tip**2) - along)
    half_angle = 0.5 * (math.pi - math.acos(sign * (normal * point.conjugate()).real / abs(point)))
    middle = -tangent * np.exp(1j * half_angle)
    direction = np.array([middle.real, middle.imag])
    along_middle = np.outer(direction, direction)
    one, two = wedge_tensor(half_angle)
    return point, one * along_middle + two * (np.eye(2) - along_middle)


def stations_of(flank: Flank, start: float, module: float) -> tuple[Array, Array, Array]:
    """Arc lengths of the stations on the flank, half widths of their bumps, and their nodal loads, shape (k, n)."""
    ends, sizes = flank.ends.tolist(), flank.sizes.tolist()

    def largest(low: float, high: float) -> float:
        """Largest element between two arc lengths (m)."""
        first = min(max(bisect_right(ends, low) - 1, 0), len(sizes) - 1)
        return max(sizes[first : max(bisect_left(ends, high), first + 1)])

    begin, end = ends[0], ends[-1]
    places = np.sort(np.concatenate([flank.ends, 0.5 * (flank.ends[1:] + flank.ends[:-1])]))
    before = 2 * float(np.interp(start, 0.5 * (flank.ends[1:] + flank.ends[:-1]), flank.sizes))
    places = places[(places > start - before) & (places < end - 1e-9)]
    kept: list[tuple[float, float]] = []
    for s in places.tolist():
        here = largest(s, s)
        a = BUMP_ELEMENTS * here
        for _ in range(3):
            a = 0.5 * (a + BUMP_ELEMENTS * largest(max(begin, s - a), min(end, s + a)))
        a = min(max(a, BUMP_MODULES * module), end - s, s - begin)
        if a >= TOO_NEAR * here and not (kept and s - kept[-1][0] < SPACING * a):
            kept.append((s, a))
    s, a = np.array(kept).T
    return s, a, bumps(flank, s[:, None], a[:, None])


def bumps(flank: Flank, s: Array, a: Array) -> Array:
    """Shares on the nodes of elliptic unit forces of half widths a about arc lengths s (m), both of shape (k, 1)."""
    # with the place s - a cos t the pressure is smooth in t
    t0, t1 = (np.arccos(np.clip((s - at) / a, -1.0, 1.0)) for at in (flank.ends[:-1], flank.ends[1:]))
    xi, weight = gauss_rule(10)
    t = t0[:, :, None] + (t1 - t0)[:, :, None] * xi
    load = (t1 - t0)[:, :, None] * weight * np.sin(t) ** 2 * (2.0 / math.pi)
    place = (s[:, :, None] - a[:, :, None] * np.cos(t) - flank.ends[:-1, None]) / flank.sizes[:, None]
    parts = np.einsum("keq,keqa->kea", load, edge_shapes(np.clip(place, 0.0, 1.0))[0])
    nodal = np.zeros((len(s), len(flank.nodes)))
    for k in range(3):
        nodal[:, k : len(flank.nodes) - 2 + k : 2] += parts[:, :, k]
    return nodal


def local_bracket(flank: FlankCompliance) -> Array:
    """Means of the bracket between the bumps of all stations, shape (2k, 2k) (-)."""
    s, a = flank.stations, flank.bumps
    x = s[:, None] + a[:, None] * ELLIPSE_X
    log = np.einsum("q,iqj->ij", ELLIPSE_W, mean_log(x[:, :, None] - s, a))
    y = flank.distance(x)
    sums = np.log(y[:, :, None, None] + y[None, None])
    edge = np.einsum("q,r,iqjr->ij", ELLIPSE_W, ELLIPSE_W, sums, optimize=True)
    return np.kron((log + log.T) / math.pi, np.eye(2)) + np.kron(edge, flank.wedge)
