r"""The gear mesh: a spring and a damper between two shafts along the line of action, or the ideal rigid mesh.

With t the direction of the driver's velocity at the pitch point P, c the unit vector from driver to driven centre and
the working pressure angle :math:`\alpha_w`, the driven gear feels the force

.. math::
    F\,n,\quad n = \cos\alpha_w\,t + \sin\alpha_w\,c,\qquad F = k(\varphi)\,\delta + d\,\dot\delta,\qquad
    \delta = n\cdot\big(u_1(P) - u_2(P)\big) ,

the driver its opposite, u the displacements at P beside rolling: from rotations, housing motion and tilt. F > 0
presses. The phase :math:`\varphi` follows the driver's actual rotation in its driving sense; the derivative of k makes
no force. P lies in the middle of the face that both gears share. A rigid mesh is the constraint :math:`\delta = 0`, F
its multiplier.

Of helical gears F and :math:`\delta` are those of the transverse section, :math:`F = T/r_b`. The normal of the flanks
has the base helix angle :math:`\beta_b` against it, so

.. math:: n = \cos\alpha_w\,t + \sin\alpha_w\,c - h\,s\tan\beta_b\,a

with the axis a, the driver's sense of rotation s about it, and h = 1 of a right-handed driver, -1 of a left-handed one
(a force on a gear has the axial part :math:`-\kappa` times its torque about a, :math:`\kappa = h\tan\beta_b/r_b`).
On the back flanks the axial part has the other sign. Phases are those of the section at coordinate 0 along the axis.

A mesh with given data has an unloaded static transmission error e over the phase beside k,

.. math:: F = k(\varphi)\,(\delta - e(\varphi)) + d\,(\dot\delta - \dot e) ,

positive where the driven gear stays behind; on the back flanks, behind the backlash, e counts with the other sign.

A spring whose load varies along the face width (`gears.gearmesh.mesh_table.Tilting`) acts at P moved along the axis by
:math:`\ell(\varphi)`, whose mean is in the rows, and has a moment and a stiffness against the tilt
:math:`\gamma = (\theta_1 - \theta_2)\cdot(a\times n)` of the gears. A law over the width (`gears.gearmesh.width_law`)
counts approach and moment about the mean lever of its tangent under :math:`F_0`, too. Its back flanks, as those of a
spring, are the mirror image in the middle of the width, which tilts do not move.

A mesh law (`gears.gearmesh.law`) replaces :math:`k\,\delta`. Its phase is the driver's rotation relative to the
line of centres, whose turn is :math:`t\cdot(u_2 - u_1)/a` with the displacements of the gears' centres, and its moment
M acts on that: on the driver, and across the line of centres. The back flanks, where a backlash j is known, have the
line of action :math:`n_b = -\cos\alpha_w\,t + \sin\alpha_w\,c` and bear behind j. Friction acts across the line of
action, see `gearfe.drivetrain.train.friction`.

In a mesh with an internal gear, the driven one, c points from the driver's centre to P, and a is negative. In a
planetary stage all members move in the frame of their carrier, in which the lines of action of the mean motion stand
still; phases follow the rotations against the line of centres, which turns with the carrier.

The damper of a mesh acts always, :math:`d\,\dot\delta` along the driving line of action (Kahraman & Singh, J. Sound
Vib. 142, 1990), or in contact only. With a curve that is :math:`d\,\dot\delta\,H(\delta)`, on each flank along its own
line of action; with a mesh law it grows with the force, :math:`d\,\dot\delta\,F/F_0`, and never pulls (Hunt & Crossley,
J. Appl. Mech. 42, 1975); :math:`F_0` is the force in steady running.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...base.typing import Array, IntArray
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.periodic import PeriodicInterpolant, on_common_nodes
from ...gears.gearmesh.width_law import Linearised, WidthLaw
from ...gears.geometry.pair import GearPair, gear_pair
from ...multibody import Element, LinearJoint
from .elements import Gyration, LinearForce, ShaftBody
from .forces import CurveFlank, Flank, LawFlank, WidthFlank
from .friction import CREEP, NEAR, Lubrication, Sliding
from .gear_train import GearMesh, GearTrain, common_face
from .kinematics import fastest

#: Least force F0 of a mesh's damping, in parts of the largest that its law is known for.
LEAST_REFERENCE = 0.01
#: Phases at which the mean stiffness of a law is taken.
PHASES = 72


@dataclass(frozen=True, eq=False)
class MeshLine:
    """A gear mesh in its train: where it acts, and the flanks that act there.

    The compiled series (`gearfe.drivetrain.train.series`) has the numbers of the flanks as the columns of its tables.

    Attributes
    ----------
    given
        The mesh as described.
    pair
        Its gears, the driver as pinion.
    driver
        Number of the driver's shaft.
    direction, point : ndarray, shape (3,)
        n of the transverse section, and P (m).
    axial
        Axial force on the driven gear, along the axis, per force of the driving flanks; 0 of spur gears.
    row : ndarray, shape (system size,)
        Approach of the driving flanks for unit coordinates of the system.
    columns : tuple of ndarray, shape (system size,)
        Directions that its flanks count: approaches, then the driver's turn (of a law, and where its shaft is elastic),
        then those of friction.
    spin : ndarray, shape (system size,)
        Rotation of the driver about its axis beside rolling.
    tilt : ndarray, shape (system size,)
        Tilt of the gears in the plane of action, > 0 where it closes the driving flanks towards larger coordinates
        along the axis.
    flanks
        Driving flanks, and the back flanks behind a backlash; none of a rigid mesh.
    rayleigh
        Rayleigh part of its damping (N s/m). For a damper that acts in contact only it is in the constant part,
        which then is damped alike in all modes, and the forces of the flanks take it off again.
    reference
        F0 (N) of a law.
    along
        Stiffness, lever, moment and stiffness against tilting, means over the mesh cycle; None of a rigid mesh.
    """

    given: GearMesh
    pair: GearPair
    driver: int
    direction: Array
    point: Array
    axial: float
    row: Array
    columns: tuple[Array, ...]
    spin: Array
    tilt: Array
    flanks: tuple[Flank, ...]
    rayleigh: float
    reference: float
    along: Linearised | None

    @property
    def name(self) -> str:
        """``driver-driven``."""
        return self.given.name

    @property
    def module(self) -> float:
        """Of the gears (m)."""
        return self.pair.pinion.module

    @property
    def rigid(self) -> bool:
        """Whether the mesh is a constraint."""
        return not self.flanks

    @property
    def curve(self) -> PeriodicInterpolant | None:
        """Stiffness over the driver's rotation; None for a rigid mesh, and for one with a law."""
        return next((flank.curve for flank in self.flanks if isinstance(flank, CurveFlank)), None)

    @property
    def law(self) -> MeshLaw | WidthLaw | None:
        """Mesh law of the driving flanks, or None."""
        return next((flank.law for flank in self.flanks if isinstance(flank, LawFlank | WidthFlank)), None)

    @property
    def backlash(self) -> float | None:
        """Normal backlash j (m); None: without back flanks, a curve then acts both ways."""
        return self.flanks[1].gap if len(self.flanks) > 1 else None

    @property
    def mean(self) -> float:
        """Mean of k (N/m), infinite for a rigid mesh."""
        return self.flanks[0].mean if self.flanks else math.inf

    @property
    def damping(self) -> float:
        """d (N s/m), the Rayleigh part included."""
        return self.given.damping + self.rayleigh

    @property
    def in_contact(self) -> bool:
        """Whether the damper acts in contact only, the Rayleigh part included."""
        return self.given.damps_in_contact

    @property
    def ratio(self) -> float:
        """Ratio of the driver's shaft to the drive, of a mesh that is not rigid."""
        return self.flanks[0].ratio

    @property
    def sense(self) -> float:
        """Driving sense (+1 or -1) of the driver, of a mesh that is not rigid."""
        return self.flanks[0].sense

    @property
    def phase(self) -> float:
        """Phase at the start (rad) of a mesh that is not rigid."""
        return self.flanks[0].phase

    @property
    def sliding(self) -> Sliding | None:
        """Friction of the driving flanks; None without."""
        return self.flanks[0].sliding if self.flanks else None

    @property
    def pulls(self) -> bool:
        """Whether its spring acts both ways."""
        return self.curve is not None and self.backlash is None

    @property
    def description(self) -> str:
        """Which flanks bear, in words."""
        if self.rigid:
            return "rigid"
        if self.pulls:
            return "a spring that acts both ways"
        if self.backlash is None:
            return "driving flanks only: the gears have no backlash, and backlash_um is not given"
        normal = self.backlash * math.cos(self.pair.pinion.base_helix_angle)
        return f"both flanks, {1e6 * normal:.6g} um of normal backlash"

    def stiffness(self, angle: Array, rest: Array | float = 0.0) -> Array:
        """k (N/m) at rotations `angle` (rad) of the drive, the driver's rotation beside rolling being `rest` (rad)."""
        assert self.curve is not None
        return np.asarray(self.curve(self.sense * (self.ratio * angle + rest) + self.phase).value)

    def element(self, bodies: Sequence[Element]) -> Element:
        """The constant part for the core: mean spring and damper, or the constraint."""
        if self.rigid:
            return LinearJoint(tuple(bodies), self.row[None, :], np.zeros(1), name=f"mesh {self.name}")
        square = np.outer(self.row, self.row)
        damping = self.rayleigh if self.in_contact else self.damping
        C, K = damping * square, self.mean * square
        if self.along is not None and self.along.against > 0.0:
            against = self.along.against * np.outer(self.tilt, self.tilt)
            C, K = C + self.rayleigh / self.mean * against, K + against
        return LinearForce(tuple(bodies), C, K, f"mesh {self.name}")

    @property
    def preload(self) -> Array:
        """Generalised force (system size,) of the mean moment that its spring has along the face width without tilt."""
        return np.zeros_like(self.tilt) if self.along is None else -self.along.moment * self.tilt


@dataclass(frozen=True)
class Shafts:
    """Shafts of a train, and where their coordinates stand in those of the system.

    Attributes
    ----------
    bodies
        The shafts.
    first : ndarray, shape (shafts,)
        Number of the first coordinate of each.
    ratios
        Their speeds over that of the drive.
    size
        Number of the system's coordinates.
    """

    bodies: tuple[ShaftBody, ...]
    first: IntArray
    ratios: tuple[float, ...]
    size: int

    def whole(self, number: int, rows: Array) -> Array:
        """Rows (..., size of a shaft) on the coordinates of a shaft as rows on those of the system, (..., size)."""
        made = np.zeros((*rows.shape[:-1], self.size))
        made[..., self.first[number] : self.first[number] + rows.shape[-1]] = rows
        return made

    @cached_property
    def gyrations(self) -> tuple[tuple[Gyration, ...], ...]:
        """Gyroscopic couples of each."""
        return tuple(body.gyrations() for body in self.bodies)

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of directions of each: two tilts a gyroscopic couple, then the spin."""
        return tuple(2 * len(couples) + 1 for couples in self.gyrations)

    @property
    def spins(self) -> tuple[int, ...]:
        """Number of the direction of each one's spin."""
        return tuple(int(end) - 1 for end in np.cumsum(self.counts))


class _Directions(NamedTuple):
    """Directions of a mesh in the coordinates of the system (system size,), and its line of action."""

    direction: Array  # n of the transverse section (3,)
    point: Array  # P (m), (3,)
    axial: float  # axial part of n
    row: Array  # approach of the driving flanks
    back: Array  # approach of the back flanks
    turn: Array  # the driver's rotation relative to the line of centres
    across: tuple[Array, Array]  # displacement of driver against driven gear at P along a x n and a x n_b
    spin: Array  # the driver's turn
    spins: Array  # the driver's turn against the driven gear's
    tilt: Array  # tilt of the gears against each other in the plane of action


def mesh_lines(train: GearTrain, shafts: Shafts) -> tuple[MeshLine, ...]:
    """Records of all meshes of a train, whose directions follow those of the shafts.

    Raises
    ------
    InputError
        If friction follows from the lubrication and the gears stand still.
    """
    lines: list[MeshLine] = []
    first = sum(shafts.counts)
    for number in range(len(train.meshes)):
        lines.append(_mesh_line(train, number, shafts, first))
        first += len(lines[-1].columns)
    return tuple(lines)


def _mesh_line(train: GearTrain, number: int, shafts: Shafts, first: int) -> MeshLine:
    """The record of one mesh, `first` the number of its first direction."""
    mesh, rolled = train.meshes[number], train.kinematics
    force, sense, shifts = float(rolled.steady_forces[number]), rolled.senses[number], rolled.shifts[number]
    driver, driven = train.gear(mesh.driver), train.gear(mesh.driven)
    i, j = train.shaft_number(driver.shaft), train.shaft_number(driven.shaft)
    ratio, pair = float(rolled.drivers[number]), gear_pair(driver.gear, driven.gear, mesh.centre_distance)
    carrier = train.mesh_carrier(mesh)
    law, backlash, spring, reference = _stiffness(mesh, force)
    mean = math.inf if spring is None else spring.stiffness
    along = _directions(train, mesh, pair, sense, shafts, 0.0 if spring is None else spring.lever)
    rayleigh = 0.0 if mesh.stiffness is None else train.damping.beta * mean
    in_contact = (mesh.damping + rayleigh, rayleigh) if mesh.damps_in_contact else (0.0, 0.0)
    turned = ratio - shafts.ratios[i]
    sliding = _sliding(mesh, pair, force, (ratio, shafts.ratios[j] + turned), fastest(train.driven.speed))
    ends = [(1.0, mean, 0.0, in_contact[1])] + ([] if backlash is None else [(-1.0, 0.0, backlash, 0.0)])
    columns, flanks = [along.row, along.back][: len(ends)], list[Flank]()
    turn = shafts.spins[i]
    if law is None and carrier is not None:  # its line of centres turns with the carrier, and with the planet's motion
        turn = first + len(columns)
        columns.append(along.turn)
    elif law is None and shafts.bodies[i].size > 6:  # a section of an elastic shaft turns by itself
        turn = first + len(columns)
        columns.append(along.spin)
    tilt = -1
    if mesh.acts_along_width:
        tilt = first + len(columns)
        columns.append(along.tilt)
    if law is not None:
        turn = first + len(columns)
        columns.append(along.turn)
        if sliding is not None:
            columns += [along.across[0], along.spins, along.across[1]][: 1 + len(ends)]
    for side, (sign, stiffness, gap, mean_damping) in enumerate(ends):
        place = (first + side, turn, ratio, sign * sense, sign * rolled.phases[number], stiffness, gap)
        if isinstance(law, WidthLaw) and spring is not None:
            chi = in_contact[0] / reference
            tilts = (tilt, spring.against) if sign > 0.0 and tilt >= 0 else (-1, 0.0)
            moved = law.about(spring.lever) if sign > 0.0 else law.sides[1]
            flanks.append(WidthFlank(*place, moved, chi, mean_damping, *tilts))
        elif isinstance(law, MeshLaw):
            rubs = None if sliding is None else replace(sliding, across=turn + 1 + 2 * side, spin=turn + 2)
            chi = in_contact[0] / reference
            flanks.append(LawFlank(*place, law.sides[side], chi, rubs, shifts[side], mean_damping))
        elif mesh.stiffness is not None:
            curve, error = mesh.interpolant(), mesh.back_error if side else mesh.transmission_error
            always = 0.0 if side or mesh.damps_in_contact else mesh.damping + rayleigh
            if error is not None:
                curve, error = on_common_nodes(curve, error)
            along_width: dict[str, Any] = {}
            if mesh.tilting is not None and sign > 0.0:
                centred = replace(mesh.tilting, lever=_without_mean(mesh.tilting.lever))
                along_width = {"tilt": tilt, "tilting": centred}
            flanks.append(
                CurveFlank(
                    *place, curve, backlash is not None, in_contact[0], mean_damping, error, always, **along_width
                )
            )
    return MeshLine(
        mesh, pair, i, along.direction, along.point, along.axial, along.row, tuple(columns) if flanks else (),
        along.spin, along.tilt, tuple(flanks), rayleigh, reference, spring,
    )  # fmt: skip


def _without_mean(curve: PeriodicInterpolant) -> PeriodicInterpolant:
    """Return a function less its mean."""
    return replace(curve, cubics=curve.cubics - curve.mean * np.array([1.0, 0.0, 0.0, 0.0]))


def _stiffness(
    mesh: GearMesh, force: float
) -> tuple[MeshLaw | WidthLaw | None, float | None, Linearised | None, float]:
    """Law and backlash (m) of a mesh, or None; its mean spring, None if rigid; F0 (N) under a steady force (N)."""
    law, tilting = mesh.stiffness, mesh.tilting
    if law is None:
        return None, mesh.backlash, None, 1.0
    if not isinstance(law, MeshLaw | WidthLaw):
        lever, moment, against = (0.0, 0.0, 0.0)
        if tilting is not None:
            lever, moment, against = tilting.lever.mean, tilting.moment.mean, tilting.stiffness
        return None, mesh.backlash, Linearised(mesh.interpolant().mean, lever, moment, against), 1.0
    reference = min(max(abs(force), LEAST_REFERENCE * law.largest_force), law.largest_force)
    backlash = law.backlash if mesh.backlash is None and law.backlash > 0.0 else mesh.backlash
    if isinstance(law, WidthLaw):
        return law, backlash, law.linearised(reference), reference
    return law, backlash, Linearised(mean_tangent(law, reference), 0.0, 0.0, 0.0), reference


def _directions(
    train: GearTrain, mesh: GearMesh, pair: GearPair, sense: float, shafts: Shafts, lever: float
) -> _Directions:
    """Directions of a mesh whose driver pushes in a sense (+1 or -1), so far from the middle of the width (m)."""
    driver, driven = train.gear(mesh.driver), train.gear(mesh.driven)
    i, j = train.shaft_number(driver.shaft), train.shaft_number(driven.shaft)
    a, alpha = train.frame[2], pair.working_pressure_angle
    base = np.array(train.shaft(driver.shaft).point)
    arm = np.array(train.shaft(driven.shaft).point) - base
    arm = arm - (arm @ a) * a
    distance = math.copysign(float(np.linalg.norm(arm)), driver.gear.teeth * driven.gear.teeth)
    across = arm / distance  # towards the pitch point, which lies beyond the driver in a mesh with an internal gear
    along = np.cross(a, across)
    low, high = common_face(driver, driven)
    centre = base + (0.5 * (low + high) - float(base @ a)) * a
    point = centre + pair.pinion_working_radius * across

    def relative(line: Array, on_driver: Array, on_driven: Array) -> Array:
        row = shafts.whole(i, line @ shafts.bodies[i].point_rows(on_driver, train.frame, driver.along))
        return row - shafts.whole(j, line @ shafts.bodies[j].point_rows(on_driven, train.frame, driven.along))

    line = math.cos(alpha) * sense * along + math.sin(alpha) * across
    back = -math.cos(alpha) * sense * along + math.sin(alpha) * across
    spin = shafts.whole(i, shafts.bodies[i].turn_rows(driver.along)[2])
    spins = spin - shafts.whole(j, shafts.bodies[j].turn_rows(driven.along)[2])
    turn = relative(along / distance, centre, centre + arm) + spin
    slides = relative(np.cross(a, line), point, point), relative(np.cross(a, back), point, point)
    axial = -sense * pair.pinion.twist_rate * pair.pinion.base_radius
    tilt = relative(line, point + a, point + a) - relative(line, point, point)
    place = point + lever * a
    rows = relative(line + axial * a, place, place), relative(back - axial * a, point, point)
    return _Directions(line, point, axial, *rows, turn, slides, spin, spins, tilt)


def _sliding(mesh: GearMesh, pair: GearPair, force: float, ratios: tuple[float, float], speed: float) -> Sliding | None:
    """Friction of a mesh under a force (N), the drive turning with a speed (rad/s)."""
    given = mesh.friction
    if isinstance(given, Lubrication):
        given = given.coefficient(pair, force, ratios[0] * speed)
    if not given > 0.0:
        return None
    relative = ratios[0] - ratios[1]
    slow = NEAR * pair.base_pitch * abs(relative * speed) or CREEP
    arm = pair.pinion.base_radius * math.tan(pair.working_pressure_angle)
    pitch = pair.pinion_angle_at(arm)
    return Sliding(given, slow, 0, 0, relative, pair.pinion.base_radius, pitch, arm)


def mean_tangent(law: MeshLaw, force: float) -> float:
    """Mean over a mesh cycle of the law's dF/d approach (N/m) under a constant force (N)."""
    angles = law.nodes[0] + law.cycle * (np.arange(PHASES) + 0.5) / PHASES
    return float(law(angles, law.approach(angles, force)).tangent.mean())
