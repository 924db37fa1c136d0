r"""The sweep of gears with face widths over pinion angle and load, and what follows from the load over the flanks.

**Load factors** of the computed load, in the sense of ISO 6336-1. The line load at a point is the force per width in
the transverse section, :math:`f = M/r`. With the load per width of all tooth pairs averaged over the angles,
:math:`\bar f(z)`,

.. math:: K_{H\beta} = \max_z \bar f / \mathrm{mean}_z \bar f, \qquad
          K_{H\beta} K_{H\alpha} = \max f / f_0,

where :math:`f_0` is the largest line load, over the angles, of the same torque spread evenly over the lines of contact
within the path of contact.

**Forces in space.** A force f per width on the wheel's section has the axial part :math:`-\kappa_2\,x\times f`, so the
axial force on the wheel is :math:`\kappa_2` times the torque. Moments are about the gears' centres at z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import InputError
from ...base.progress import Stopwatch, one_thread
from ...base.typing import Array, IntArray
from ..geometry.validity import MOST_YIELD
from .lines import ContactLines, Solution, line_loads, look_at, solve_positions

#: Pinion angles of a mesh cycle where none are given; places along the width of the mean load.
ANGLES, ALONG = 24, 65
#: Kinds of status of a position.
CONVERGED, NOT_CONVERGED, NO_CONTACT = "converged", "not_converged", "no_contact"


@dataclass(frozen=True)
class LinePoints:
    """Points on the loaded parts of all lines, p of them, by load, position, tooth pair and z.

    Gauss points carry the forces. Places between them, at ends and kinks too, have no length: they show the line load.

    Attributes
    ----------
    load, position : ndarray, shape (p,)
        Numbers of the load and of the angle.
    pair : ndarray, shape (p,)
        Tooth pair k: pinion tooth k, wheel tooth -1 - k.
    z, weight : ndarray, shape (p,)
        Axial coordinate, and the length along z whose force the point carries, or 0 (m).
    roll : ndarray, shape (p, 2)
        Roll lengths on pinion and wheel (m).
    line_load : ndarray, shape (p,)
        Force per width in the transverse section (N/m).
    """

    load: IntArray
    position: IntArray
    pair: IntArray
    z: Array
    weight: Array
    roll: Array
    line_load: Array


@dataclass(frozen=True)
class WidthSweep:
    """Contact of gears with face widths over m loads and n pinion angles.

    A position that failed has its status, and NaN.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        Pinion angles (rad).
    status : ndarray of str, shape (m, n)
        ``converged``, ``not_converged`` or ``no_contact``.
    torque : ndarray, shape (m, n)
        At the wheel (N m).
    twist, transmission_error : ndarray, shape (m, n)
        Twist of the wheel from where unmodified flanks touch (rad), and times its base radius (m).
    tangent : ndarray, shape (m, n, 3, 3)
        Torque and moments of the tilts by twist, tilt in the plane of action and tilt across it (N m/rad).
    force : ndarray, shape (m, n, 3)
        On the wheel: transverse parts in global axes, and axial (N).
    moment : ndarray, shape (m, n, 2, 3)
        Of the contact on pinion and wheel about their centres at z = 0, global axes (N m).
    peak_line_load : ndarray, shape (m, n)
        Largest line load (N/m).
    peak_z, peak_pair, peak_roll : ndarray, shapes (m, n), (m, n), (m, n, 2)
        Where it is: axial coordinate (m), tooth pair (-1 without load), roll lengths (m).
    k_h_beta, k_h_alpha : ndarray, shape (m,)
        Face load factor and transverse load factor of the computed load (-).
    points : LinePoints
        Load over the flanks.
    timings
        Seconds by stage.
    """

    angle: Array
    status: NDArray[np.str_]
    torque: Array
    twist: Array
    transmission_error: Array
    tangent: Array
    force: Array
    moment: Array
    peak_line_load: Array
    peak_z: Array
    peak_pair: IntArray
    peak_roll: Array
    k_h_beta: Array
    k_h_alpha: Array
    points: LinePoints
    timings: dict[str, float] = field(default_factory=dict)

    @property
    def axial_force(self) -> Array:
        """Axial force on the wheel (N), shape (m, n)."""
        return np.asarray(self.force[..., 2])

    @property
    def secant(self) -> Array:
        """Secant stiffness T/twist (N m/rad), shape (m, n); NaN where the twist is not positive."""
        return np.asarray(
            np.divide(self.torque, self.twist, out=np.full_like(self.twist, np.nan), where=self.twist > 0)
        )

    @property
    def stiffness(self) -> Array:
        """Tangent stiffness dT/dtwist (N m/rad), shape (m, n)."""
        return np.asarray(self.tangent[..., 0, 0])


def sweep_width(
    lines: ContactLines,
    torques: ArrayLike | None = None,
    *,
    twists: ArrayLike | None = None,
    angles: ArrayLike | None = None,
    positions: int = ANGLES,
    watch: Stopwatch | None = None,
) -> WidthSweep:
    """Solve the contact over pinion angles at several torques, or at several twists.

    Parameters
    ----------
    lines : ContactLines
        The gears, see `gearfe.gears.width.lines.contact_lines`.
    torques : array_like, shape (m,)
        At the wheel's hub (N m), > 0.
    twists : array_like, shape (m,)
        Of the wheel from where unmodified flanks touch (rad), instead of `torques`.
    angles : array_like, shape (n,)
        Pinion angles (rad); without them those of one mesh cycle.
    positions : int
        Number of angles of a mesh cycle where none are given.
    watch
        Takes the time of the stages.

    Raises
    ------
    InputError
        For neither or both of torques and twists, values out of range, torques beyond linear elasticity, and teeth that
        differ without angles.
    """
    loads, by_torque = _loads(torques, twists)
    at = _angles(lines, angles, positions)
    if by_torque:
        lines.compliance.mesh.check_torque(max(loads), "torques")
    else:
        _check_twist(lines, at, max(loads))
    watch = watch or Stopwatch()
    with watch.stage("positions"), one_thread():
        load, name = np.repeat(loads, len(at)), "torque" if by_torque else "twist"
        every = solve_positions(lines, np.tile(at, len(loads)), **{name: load})
        solved = [every[i : i + len(at)] for i in range(0, len(every), len(at))]
    return _assembled(lines, at, solved, dict(watch.seconds))


def _loads(torques: ArrayLike | None, twists: ArrayLike | None) -> tuple[list[float], bool]:
    if (torques is None) == (twists is None):
        raise InputError("torques, twists", None, "exactly one of them must be given", "leave the other out")
    name, given = ("torques", torques) if twists is None else ("twists", twists)
    loads = np.atleast_1d(np.asarray(given, dtype=float))
    unit = "N m" if twists is None else "rad"
    if loads.ndim != 1 or len(loads) == 0 or not (np.isfinite(loads).all() and (twists is not None or loads.min() > 0)):
        raise InputError(name, given, f"must be finite{' and > 0' if twists is None else ''} ({unit})", "correct them")
    return loads.tolist(), twists is None


def _check_twist(lines: ContactLines, angles: Array, twist: float) -> None:
    """Raise `InputError` for a twist (rad) that overlaps the flanks by more than linear elasticity holds for."""
    mesh = lines.compliance.mesh
    first = float(look_at(lines, angles).least.min(initial=math.inf))
    most = first + MOST_YIELD * mesh.module / mesh.sections.wheel.base_radius
    if twist > most:
        problem = f"must be <= {most:.4g} rad: the teeth would deflect by more than {MOST_YIELD:g} modules"
        raise InputError("twists", twist, problem, "linear elasticity does not reach so far; give less")


def _angles(lines: ContactLines, angles: ArrayLike | None, positions: int) -> Array:
    if angles is None:
        if positions < 1:
            raise InputError("positions", positions, "must be >= 1", "24 are usual")
        if not all(own.alike for own in lines.flanks.profiles):
            problem = "must be given where teeth differ: one mesh cycle is not enough"
            raise InputError("angles", None, problem, "give the pinion angles of the cycles of interest")
        return np.arange(positions) * lines.compliance.mesh.sections.mesh_cycle / positions
    at = np.atleast_1d(np.asarray(angles, dtype=float))
    if at.ndim != 1 or len(at) == 0 or not np.isfinite(at).all():
        raise InputError("angles", angles, "must be a list of finite angles (rad)", "give at least one angle")
    return at


def _assembled(
    lines: ContactLines, angles: Array, solved: Sequence[Sequence[Solution]], timings: dict[str, float]
) -> WidthSweep:
    mesh = lines.compliance.mesh
    shape = len(solved), len(angles)
    status = np.full(shape, CONVERGED, dtype="<U13")
    torque, twist, peak, peak_z = (np.full(shape, np.nan) for _ in range(4))
    tangent, force, moment = (np.full((*shape, *more), np.nan) for more in ((3, 3), (3,), (2, 3)))
    peak_pair, peak_roll = np.full(shape, -1), np.full((*shape, 2), np.nan)
    loaded = []
    for cell in np.ndindex(shape):
        solution = solved[cell[0]][cell[1]]
        if not solution.converged:
            status[cell] = NOT_CONVERGED if math.isfinite(solution.twist) else NO_CONTACT
            continue
        torque[cell], twist[cell], tangent[cell] = solution.torque, solution.twist, solution.tangent
        force[cell], moment[cell] = resultants(lines, solution)
        if (solution.moment > 0).any():
            loaded.append(cell)
        else:
            status[cell], peak[cell] = NO_CONTACT, 0.0
    points = _along_lines(lines, angles, solved, np.reshape(loaded, (-1, 2)))
    begin = np.flatnonzero(np.diff(points.load * len(angles) + points.position, prepend=-1))
    for of in map(slice, begin.tolist(), [*begin[1:].tolist(), len(points.z)]):
        most = of.start + int(np.argmax(points.line_load[of]))
        cell = points.load[most], points.position[most]
        peak[cell], peak_z[cell], peak_pair[cell] = points.line_load[most], points.z[most], points.pair[most]
        peak_roll[cell] = points.roll[most]
    factors = [_load_factors(lines, angles, points, number) for number in range(len(solved))]
    return WidthSweep(
        angle=angles,
        status=status,
        torque=torque,
        twist=twist,
        transmission_error=twist * mesh.sections.wheel.base_radius,
        tangent=tangent,
        force=force,
        moment=moment,
        peak_line_load=peak,
        peak_z=peak_z,
        peak_pair=peak_pair,
        peak_roll=peak_roll,
        k_h_beta=np.array([beta for beta, _ in factors]),
        k_h_alpha=np.array([alpha for _, alpha in factors]),
        points=points,
        timings=timings,
    )


def _along_lines(
    lines: ContactLines, angles: Array, solved: Sequence[Sequence[Solution]], cells: IntArray
) -> LinePoints:
    """Points of solved positions, and places between them; `cells`: numbers of load and angle, shape (m, 2)."""
    solutions = [solved[load][position] for load, position in cells.tolist()]
    if not solutions:
        none, nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
        return LinePoints(none, none, none, nothing, nothing, np.zeros((0, 2)), nothing)
    between = line_loads(lines, angles[cells[:, 1]], solutions)
    points, counts = [one.points for one in solutions], [len(one.points) for one in solutions]
    number = np.concatenate([np.repeat(np.arange(len(counts)), counts), between.position])
    pair = np.concatenate([*(one.pair for one in points), between.pair])
    z = np.concatenate([*(one.z for one in points), between.z])
    weight = np.concatenate([*(one.weight for one in points), np.zeros(len(between.z))])
    roll = np.concatenate([*(one.rows.roll for one in points), between.roll])
    loads = [one.moment / (one.points.weight * one.points.rows.arm) for one in solutions]
    order = np.lexsort((z, pair, number))
    load, position = cells[number[order]].T
    line_load = np.concatenate([*loads, between.load])[order]
    return LinePoints(load, position, pair[order], z[order], weight[order], roll[order], line_load)


def resultants(lines: ContactLines, solution: Solution) -> tuple[Array, Array]:
    """Return the force on the wheel (N), shape (3,), and the moments on both gears (N m), shape (2, 3)."""
    mesh, points = lines.compliance.mesh, solution.points
    rows, z = points.rows, points.z
    size, sign = solution.moment / rows.arm, mesh.sections.sign
    transverse = size * rows.normal
    force = np.stack([transverse.real, transverse.imag, sign * mesh.turns[1] * solution.wheel_moment], axis=1)
    moments = []
    excess = solution.torque - solution.moment.sum()  # of the wheel's moment as the arms change under load
    for side, centre, more in (
        (-1.0, 0.0, excess / mesh.ratio), (1.0, mesh.sections.wheel_centre, -sign * excess)
    ):  # fmt: skip
        place = np.stack([rows.point.real - centre, rows.point.imag, z], axis=1)
        moments.append(side * np.cross(place, force).sum(axis=0) + [0.0, 0.0, more])
    return force.sum(axis=0), np.array(moments)


def mean_line_load(points: LinePoints, load: int, along: Array, positions: int) -> Array:
    """Return the load per width of all tooth pairs at places along z, the mean of positions (N/m), shape (k,).

    It runs straight between the points of each line.

    Parameters
    ----------
    points : LinePoints
        Loaded points of a sweep.
    load : int
        Number of the load.
    along : ndarray, shape (k,)
        Places z (m).
    positions : int
        Number of positions at this load that have converged.
    """
    mean = np.zeros(len(along))
    of_load = np.flatnonzero(points.load == load)
    line = np.stack([points.position[of_load], points.pair[of_load]])
    for one in np.unique(line, axis=1).T:
        chosen = of_load[(line == one[:, None]).all(axis=0)]
        mean += load_along(points.z[chosen], points.line_load[chosen], along)
    return mean / max(1, positions)


def load_along(z: Array, line_load: Array, along: Array) -> Array:
    """Return the line load of one line of contact at places along the width (N/m), shape (k,).

    It runs straight between the points, and is zero beyond.

    Parameters
    ----------
    z, line_load : ndarray, shape (n,)
        Rising places of the points (m), and their loads (N/m).
    along : ndarray, shape (k,)
        Places (m).
    """
    return np.interp(along, z, line_load, left=0.0, right=0.0)


def _load_factors(lines: ContactLines, angles: Array, points: LinePoints, load: int) -> tuple[float, float]:
    """K_Hbeta and K_Halpha over the loaded positions of a load; NaN without any."""
    mesh, of_load = lines.compliance.mesh, points.load == load
    if not of_load.any():
        return math.nan, math.nan
    along = np.linspace(*mesh.zone, ALONG)
    loaded = np.unique(points.position[of_load])
    mean = mean_line_load(points, load, along, len(loaded))
    force = np.bincount(points.position[of_load], (points.line_load * points.weight)[of_load], len(angles))[loaded]
    face = float(mean.max() * mesh.width / force.mean())
    length = np.array([_line_length(lines, angle) for angle in angles[loaded].tolist()])
    even = float(np.divide(force, length, out=np.zeros_like(force), where=length > 0.0).max())
    return face, float(points.line_load[of_load].max()) / even / face if even > 0.0 else math.nan


def _line_length(lines: ContactLines, angle: float) -> float:
    """Length along z of all lines within the path of contact at a pinion angle (m)."""
    mesh, (first, last) = lines.compliance.mesh, lines.law.path
    cycle, turn = mesh.sections.mesh_cycle, mesh.turns[0]
    ends = sorted(angle + turn * z for z in mesh.zone)
    numbers = np.arange(math.ceil((first - ends[1]) / cycle), math.floor((last - ends[0]) / cycle) + 1)
    if turn == 0.0:
        return mesh.width * len(numbers)
    low, high = np.maximum(ends[0] + numbers * cycle, first), np.minimum(ends[1] + numbers * cycle, last)
    return float(np.maximum(high - low, 0.0).sum() / abs(turn))
