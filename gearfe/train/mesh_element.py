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

A mesh law (`gearfe.meshlaw`) takes the place of :math:`k\,\delta`. Its phase is the driver's rotation relative to the
line of centres, whose turn is :math:`t\cdot(u_2 - u_1)/a` with the displacements of the gears' centres, and its moment
M acts on that: on the driver, and across the line of centres. The back flanks, where a backlash j is known, have the
line of action :math:`n_b = -\cos\alpha_w\,t + \sin\alpha_w\,c` and bear behind j. Friction acts across the line of
action, see `gearfe.train.friction`.

The damper of a mesh acts always, :math:`d\,\dot\delta` along the driving line of action (Kahraman & Singh, J. Sound
Vib. 142, 1990), or in contact only. With a curve that is :math:`d\,\dot\delta\,H(\delta)`, on each flank along its own
line of action; with a mesh law it grows with the force, :math:`d\,\dot\delta\,F/F_0`, and never pulls (Hunt & Crossley,
J. Appl. Mech. 42, 1975); :math:`F_0` is the force in steady running.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..gear.pair import GearPair, gear_pair
from ..meshlaw.law import MeshLaw
from ..multibody import Element, LinearJoint
from ..stiffness.periodic import PeriodicInterpolant
from ..typing import Array, IntArray
from .elements import LinearForce, RigidShaft
from .forces import CurveFlank, Flank, LawFlank
from .friction import CREEP, NEAR, Lubrication, Sliding
from .gear_train import GearMesh, GearTrain

#: Least force F0 of a mesh's damping, in parts of the largest that its law is known for.
LEAST_REFERENCE = 0.01
#: Phases at which the mean stiffness of a law is taken.
PHASES = 72


@dataclass(frozen=True, eq=False)
class MeshLine:
    """Where and how a mesh acts.

    Attributes
    ----------
    name
        ``driver-driven``.
    row, back : (system size,)
        Approach of the driving and of the back flanks for unit coordinates of the system.
    turn : (system size,)
        Rotation of the driver that the phase follows.
    direction, point : (3,)
        n and P (m).
    curve
        Stiffness over the driver's rotation; None for a rigid mesh, and for one with a law.
    law
        Mesh law, or None.
    backlash
        j (m); None: without back flanks, a curve then acts both ways.
    mean, damping
        Mean of k (N/m), infinite for a rigid mesh; d (N s/m), the Rayleigh part included.
    rayleigh
        The Rayleigh part (N s/m). Of a damper that acts in contact only it stands in the constant part, which then is
        damped alike in all modes, and the forces of the flanks take it off again.
    in_contact
        Whether the damper acts in contact only, the Rayleigh part included.
    reference
        F0 (N) of a law.
    driver
        Number of the driver's shaft.
    ratio, sense, phase
        Ratio of the driver's shaft to the drive, its driving sense (+1 or -1), start of the curve (rad).
    module
        m.
    slides : (3, system size)
        Displacement of the driver against the driven gear at P across both lines of action, a x n and a x n_b, and the
        driver's turn against the driven gear's.
    shifts : (two arrays)
        How much later the pairs of the driving and of the back flanks touch (m), see `gearfe.train.phases.pair_shifts`.
    sliding
        Friction, the numbers of its directions still to be filled in; None without.
    """

    name: str
    row: Array
    back: Array
    turn: Array
    direction: Array
    point: Array
    curve: PeriodicInterpolant | None
    law: MeshLaw | None
    backlash: float | None
    mean: float
    damping: float
    rayleigh: float
    in_contact: bool
    reference: float
    driver: int
    ratio: float
    sense: float
    phase: float
    module: float
    slides: Array
    sliding: Sliding | None
    shifts: tuple[Array, Array]

    @property
    def columns(self) -> list[Array]:
        """Directions of its flanks: approaches, then of a law the driver's turn, then those of friction."""
        if self.rigid:
            return []
        made = [self.row] + ([] if self.backlash is None else [self.back])
        if self.law is not None:
            made.append(self.turn)
        if self.sliding is not None:
            made += [self.slides[0], self.slides[2]] + ([] if self.backlash is None else [self.slides[1]])
        return made

    @property
    def rigid(self) -> bool:
        """Whether the mesh is a constraint."""
        return self.curve is None and self.law is None

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
        return f"both flanks, {1e6 * self.backlash:.6g} um of normal backlash"

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
        return LinearForce(tuple(bodies), damping * square, self.mean * square, f"mesh {self.name}")

    def flanks(self, first: int) -> tuple[Flank, ...]:
        """Driving and back flanks, `first` the number of their first direction, see `columns`."""
        ends = [(1.0, self.mean, 0.0)] + ([] if self.backlash is None else [(-1.0, 0.0, self.backlash)])
        turn = first + len(ends) if self.law is not None else 3 * self.driver + 2
        made: list[Flank] = []
        for number, (side, mean, gap) in enumerate(ends):
            place = (first + number, turn, self.ratio, side * self.sense, side * self.phase, mean, gap)
            damping = self.damping if self.in_contact else 0.0
            mean_damping = self.rayleigh if self.in_contact and number == 0 else 0.0
            if self.law is not None:
                sliding = self.sliding
                if sliding is not None:
                    sliding = replace(sliding, across=turn + 1 + 2 * number, spin=turn + 2)
                law, chi = self.law.sides[number], damping / self.reference
                made.append(LawFlank(*place, law, chi, sliding, self.shifts[number], mean_damping))
            elif self.curve is not None:
                made.append(CurveFlank(*place, self.curve, not self.pulls, damping, mean_damping))
        return tuple(made)


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

    bodies: tuple[RigidShaft, ...]
    first: IntArray
    ratios: tuple[float, ...]
    size: int


@dataclass(frozen=True)
class OperatingPoint:
    """Of a mesh: driving sense of its driver, phase of its teeth (rad), force in steady running (N), largest speed of
    the drive (rad/s), and the shifts of its tooth pairs.
    """

    sense: float
    phase: float
    force: float
    speed: float
    shifts: tuple[Array, Array]


def mesh_line(train: GearTrain, mesh: GearMesh, shafts: Shafts, running: OperatingPoint) -> MeshLine:
    """Return the line of action of a mesh in a train, with its constant stiffness and damping.

    Parameters
    ----------
    train : GearTrain
        The train.
    mesh : GearMesh
        One of its meshes.
    shafts : Shafts
        Bodies, and the numbers of their coordinates.
    running : OperatingPoint
        Driving sense, phase, force, speed and pitch errors of the mesh.

    Raises
    ------
    InputError
        If friction follows from the lubrication and the gears stand still.
    """
    first, size, ratios, sense, force = shafts.first, shafts.size, shafts.ratios, running.sense, running.force
    driver, driven = train.gear(mesh.driver), train.gear(mesh.driven)
    i, j = train.shaft_number(driver.shaft), train.shaft_number(driven.shaft)
    a = train.frame[2]
    pair = gear_pair(driver.gear, driven.gear, mesh.centre_distance)
    alpha = pair.working_pressure_angle
    base = np.array(train.shaft(driver.shaft).point)
    arm = np.array(train.shaft(driven.shaft).point) - base
    arm = arm - (arm @ a) * a
    distance = float(np.linalg.norm(arm))
    across = arm / distance
    along = np.cross(a, across)
    low = max(g.along - 0.5 * g.gear.face_width for g in (driver, driven))
    high = min(g.along + 0.5 * g.gear.face_width for g in (driver, driven))
    centre = base + (0.5 * (low + high) - float(base @ a)) * a
    point = centre + pair.pinion_working_radius * across

    def relative(line: Array, on_driver: Array, on_driven: Array) -> Array:
        row = np.zeros(size)
        row[first[i] : first[i] + 6] += line @ shafts.bodies[i].point_rows(on_driver, train.frame)
        row[first[j] : first[j] + 6] -= line @ shafts.bodies[j].point_rows(on_driven, train.frame)
        return row

    line = math.cos(alpha) * sense * along + math.sin(alpha) * across
    back = -math.cos(alpha) * sense * along + math.sin(alpha) * across
    turn = np.zeros(size)
    curve, law, backlash, mean, rayleigh, reference = None, None, mesh.backlash, math.inf, 0.0, 1.0
    if isinstance(mesh.stiffness, MeshLaw):
        law = mesh.stiffness
        turn = relative(along / distance, centre, centre + arm)
        reference = min(max(abs(force), LEAST_REFERENCE * law.largest_force), law.largest_force)
        mean = mean_tangent(law, reference)
        if backlash is None and law.backlash > 0.0:
            backlash = law.backlash
    elif mesh.stiffness is not None:
        curve = mesh.interpolant()
        mean = curve.mean
    turn[first[i] + 5] += 1.0
    if mesh.stiffness is not None:
        rayleigh = train.damping.beta * mean
    spin = np.zeros(size)
    spin[first[i] + 5], spin[first[j] + 5] = 1.0, -1.0
    slides = np.array([*(relative(np.cross(a, n), point, point) for n in (line, back)), spin])
    return MeshLine(
        name=mesh.name,
        row=relative(line, point, point),
        back=relative(back, point, point),
        turn=turn,
        direction=line,
        point=point,
        curve=curve,
        law=law,
        backlash=backlash,
        mean=mean,
        damping=mesh.damping + rayleigh,
        rayleigh=rayleigh,
        in_contact=mesh.damps_in_contact,
        reference=reference,
        driver=i,
        ratio=ratios[i],
        sense=sense,
        phase=running.phase,
        module=driver.gear.module,
        slides=slides,
        sliding=_sliding(mesh, pair, force, (ratios[i], ratios[j]), running.speed),
        shifts=running.shifts,
    )


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
