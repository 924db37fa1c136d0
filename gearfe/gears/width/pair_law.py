r"""One tooth pair in the transverse section: where it touches, and how its contact yields, over angle and load.

**Pair angle.** A twist :math:`\theta` of the wheel overlaps the flanks, whose rolls on both gears then sum up to more
than the length of the path of contact. The pair angle counts the half of it on either gear, so that the place on the
path belongs to both and gears may be exchanged: the section at z of the pair k, pinion tooth k, has

.. math:: \psi = \varphi + \kappa z + \frac{2\pi k}{z_1} - \tfrac12\,i\,\theta, \qquad i = |z_2/z_1| .

A twist turns the wheel of an internal pair the other way, in which it drives its flank too.

Both gears turned by their halves of :math:`t(\psi)` touch first. From there a twist approaches the flanks by
:math:`\bar r(\theta - t)`, :math:`\bar r = \tfrac12(r_2 + i\,r_1)` with the arms of both gears, which are the base
radii on the path of contact.

**Load.** A pair that carries the force f per width by itself, in plane strain, approaches by

.. math:: \bar r(\psi)\,\big(\theta - t(\psi)\big) = T_0(\psi)\,f + C(\psi, f)\,f,

with the far field :math:`T_0 = w\,nHn` where the rigid flanks touch. The rest C is the contact's own: half-planes,
wedge, tip rounds within the contact, the normal that turns and the place that moves under load. The panels of
`gearfe.gears.contact.half_plane` solve it once for many pair angles and loads. C is nearly straight in ln f, as of
Hertz's contacts, and is interpolated so.

**Moments.** At a given pair angle the twist turns both gears by halves, so that the derivative of the energy with it is
the mean :math:`\tfrac12(M_2 + i\,M_1)` of the moments on wheel and pinion. The force f above is this mean over
:math:`\bar r`. The normal turns under load, and its place moves, so that the arms differ from those at first contact:

.. math:: M_2 = r_2\,f\,(1 + \delta), \qquad i\,M_1 = i\,r_1\,f - r_2\,f\,\delta .

The excess :math:`\delta(\psi, f)` comes from the same positions as C. At 300 N/mm on a module of 2.5 mm it is
up to 0.6 % beyond the path of contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from ...base.cache import cached_arrays, source_hash, versions
from ...base.errors import InputError
from ...base.progress import one_thread
from ...base.typing import Array, ComplexArray
from ..contact.half_plane import far_field_compliance, hertz, solve_half_plane, unloaded
from ..contact.half_plane_pair import HalfPlanePair
from ..geometry.face import ToothDeviations
from ..geometry.first_contact import FirstContacts, ToothFlanks
from ..geometry.validity import MOST_YIELD
from .compliance import SOURCES, TIPS, WideCompliance
from .mesh import WideMesh

#: Intervals of the table over the pair angle. Linear between its marks, 501 err by 0.04 % of the transmission error,
#: 2,001 do not.
ANGLES = 2000
#: Loads per width at which contacts are solved, in E' times module: from light ones, of 0.4 N/mm on steel of module 2,
#: to where linear elasticity ends. With a ratio of 4 instead of 2.5, the torque of one pair errs by 0.02 %.
LOADS = 1e-6 * 2.5 ** np.arange(12)
#: Distances of solved pair angles from ends of the path and kinks, in mesh cycles: contacts are up to 0.04 cycles wide.
NEAR = np.array([0.0, 0.001, 0.003, 0.005, 0.008, 0.012, 0.017, 0.024, 0.034, 0.048, 0.07, 0.11])
#: Largest distance of solved pair angles (mesh cycles): twice as far errs by 0.09 % near a kink of a flank.
COARSE = 0.02
#: Distance of pair angles that are the same (mesh cycles).
SAME = 1e-6
#: Step of an arm between two marks of the table (base radii) from which on it jumps: edges jump by 0.04 and more, arms
#: on tip rounds change by 0.004. Bisections to where: to 3e-6 mesh cycles.
JUMP, BISECTIONS = 0.01, 8
#: Solved loads of a pair angle below which it is left out.
ENOUGH = 4
#: Secant steps until both gears are turned by their halves of the twist at first contact.
CENTRED = 4


@dataclass(frozen=True)
class PairLaw:
    """Tables over the rising pair angle, n marks; linear in between.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        psi (rad).
    touch : ndarray, shape (n,)
        Twist at first contact (rad), from where unmodified flanks touch.
    arm, pinion_arm : ndarray, shape (n,)
        Moments on the wheel and on the pinion per force (m).
    normal : ndarray of complex, shape (n,)
        Common normal out of the pinion, global axes.
    point : ndarray of complex, shape (n,)
        Where it touches (m), global axes.
    roll, arc : ndarray, shape (n, 2)
        Roll lengths on both flanks, and arc lengths (m).
    tooth_normal : ndarray, shape (n, 2, 2)
        The normal in the axes of both teeth: gear, xy.
    yields : ndarray, shape (n, loads)
        C (m2/N) at the forces per width `forces`.
    excess : ndarray, shape (n, loads)
        delta (-) at the same forces.
    forces : ndarray, shape (loads,)
        Rising forces per width (N/m), evenly spaced in their logarithms.
    path : tuple of float
        Pair angles of the ends A and E of the path of contact (rad).
    marks : ndarray, shape (marks,)
        Rising pair angles of these, of kinks of the flanks, and of jumps of the normal (rad), where the tables have
        kinks.
    forward : complex
        Normal on the path of contact.
    """

    angle: Array
    touch: Array
    arm: Array
    pinion_arm: Array
    normal: ComplexArray
    point: ComplexArray
    roll: Array
    arc: Array
    tooth_normal: Array
    yields: Array
    excess: Array
    forces: Array
    path: tuple[float, float]
    marks: Array
    forward: complex

    @cached_property
    def packed(self) -> Array:
        """Touch, arms, normal, point, roll, arc, normals in the teeth's axes, C, delta side by side, shape (n, c)."""
        n = len(self.angle)
        columns = [self.touch, self.arm, self.pinion_arm, self.normal.real, self.normal.imag]
        columns += [self.point.real, self.point.imag]
        return np.concatenate(
            [np.stack(columns, axis=1), self.roll, self.arc, self.tooth_normal.reshape(n, 4), self.yields, self.excess],
            axis=1,
        )


def pair_law(compliance: WideCompliance, profiles: tuple[ToothDeviations, ToothDeviations]) -> PairLaw:
    """Return the law of a tooth pair whose flanks have the profiles of the first teeth; from the cache if it is there.

    Parameters
    ----------
    compliance : WideCompliance
        The gears.
    profiles : pair of ToothDeviations
        Profiles of pinion and wheel.

    Raises
    ------
    InputError
        For flanks whose contact is not solved at most loads.
    """
    names = [entry.name for entry in fields(PairLaw)]
    recipe = {
        "mesh": compliance.mesh,
        "profiles": profiles,
        "influence": [side.influence for side in compliance.sides],
        "code": [source_hash(*SOURCES, "gears/width/pair_law"), versions()],
    }

    def make() -> dict[str, Array]:
        law = _solved_law(compliance, profiles)
        return {name: np.asarray(getattr(law, name)) for name in names}

    arrays = cached_arrays("pair-law", recipe, make)
    low, high = arrays["path"].tolist()
    return PairLaw(**arrays | {"path": (low, high), "forward": complex(arrays["forward"])})


def _solved_law(compliance: WideCompliance, profiles: tuple[ToothDeviations, ToothDeviations]) -> PairLaw:
    mesh = compliance.mesh
    pair, cycle = mesh.sections, mesh.sections.mesh_cycle
    teeth = first_teeth(mesh, profiles)
    sides = compliance.sides[0].local, compliance.sides[1].local
    model = HalfPlanePair(pair, teeth, sides, mesh.width)
    path = pair.path["A"].pinion_angle, pair.path["E"].pinion_angle
    low, high = path[0] - TIPS * cycle, path[1] + TIPS * cycle
    marks = np.unique(np.concatenate([path, _kinks(model)]))
    marks = marks[(marks > low) & (marks < high)]
    table = np.linspace(low, high, ANGLES + 1)
    before, behind = _jumps(teeth, np.unique(np.concatenate([table, marks])))
    marks = np.unique(np.concatenate([marks, before]))
    both = np.unique(np.concatenate([marks, behind]))
    angles, contacts = pair_contacts(teeth, np.unique(np.concatenate([table, both])))
    solved_angles, solved = pair_contacts(teeth, _solved_angles(low, high, both, cycle))
    modulus = 2 / sum(side.inverse_modulus for side in sides)
    forces = LOADS * modulus * mesh.module
    with one_thread():
        at_marks = _solved_contacts(compliance, model, solved_angles, solved, forces)
    known = np.isfinite(at_marks).all(axis=(1, 2))
    if np.count_nonzero(known) < ENOUGH:
        problem = "the contact of a tooth pair is not solved at most pair angles"
        raise InputError("profiles", None, problem, "use smaller modifications, without short waves")
    known_angles = solved_angles[known]
    tables = PchipInterpolator(known_angles, at_marks[known])(np.clip(angles, known_angles[0], known_angles[-1]))
    arc, tooth_normal = _on_teeth(model, contacts)
    radius = np.abs(np.stack([contacts.point, contacts.point - pair.wheel_centre], axis=1))
    base = np.array([gear.base_radius for gear in mesh.gears])
    return PairLaw(
        angle=angles,
        touch=contacts.twist - pair.contact_twist,
        arm=contacts.arm[:, 1],
        pinion_arm=contacts.arm[:, 0],
        normal=contacts.normal,
        point=contacts.point,
        roll=np.sqrt(np.maximum(radius**2 - base**2, 0.0)) * [1, pair.sign],
        arc=arc,
        tooth_normal=tooth_normal,
        yields=tables[:, 0],
        excess=tables[:, 1],
        forces=forces,
        path=path,
        marks=marks,
        forward=complex(np.exp(1j * (0.5 * math.pi - pair.working_pressure_angle))),
    )


def first_teeth(mesh: WideMesh, profiles: tuple[ToothDeviations, ToothDeviations]) -> ToothFlanks:
    """Return the flanks of gears whose teeth all have the profile of the first one."""
    first = tuple(ToothDeviations((own.profiles[own.profile[0]],)) for own in profiles)
    return ToothFlanks(mesh.sections, (first[0], first[1]))


def pair_contacts(teeth: ToothFlanks, angles: Array) -> tuple[Array, FirstContacts]:
    """Return the pair angles (rad) at which the flanks of pair 0 meet, of those asked for, and its first contacts."""
    pair = teeth.pair

    def met_at(pinion_angle: Array) -> tuple[FirstContacts, Array]:
        found = teeth.first_contacts_of(np.arange(len(pinion_angle)), pinion_angle, np.zeros(len(pinion_angle), int))
        return found, found.angle - 0.5 * abs(pair.gear_ratio) * (found.twist - pair.contact_twist)

    found, reached = met_at(angles)
    goal = angles[found.position]
    before, off_before = found.angle, reached - goal
    at = before - off_before
    for _ in range(CENTRED if np.abs(off_before).max(initial=0.0) > 0.0 else 0):  # by secants
        found, reached = met_at(at)
        kept = found.position
        goal, before, off_before = goal[kept], before[kept], off_before[kept]
        off = reached - goal
        rise = np.divide(off - off_before, found.angle - before, out=np.ones(len(off)), where=found.angle != before)
        before, off_before = found.angle, off
        at = found.angle - off / np.clip(rise, 0.5, 2.0)
    return reached, found


def _kinks(model: HalfPlanePair) -> Array:
    """Pair angles (rad) at which kinks of the flanks pass the line of action."""
    pair = model.pair
    rolls = [np.asarray(face.flank.kinks, dtype=float) for face in model.teeth.faces]
    return np.array([pair.pinion_angle_at(s) for s in (*rolls[0], *(pair.tangent_length - rolls[1]))])


def _jumps(teeth: ToothFlanks, angles: Array) -> tuple[Array, Array]:
    """Pair angles (rad) before and behind each jump of the normal, where an edge takes over the contact.

    Parameters
    ----------
    teeth : ToothFlanks
        The flanks.
    angles : ndarray, shape (n,)
        Rising pair angles between which jumps are searched for (rad).
    """
    base = np.array([gear.base_radius for gear in (teeth.pair.pinion, teeth.pair.wheel)])
    angles, contacts = pair_contacts(teeth, angles)
    arm = contacts.arm / base
    i = np.flatnonzero((np.abs(np.diff(arm, axis=0)) > JUMP).any(axis=1))
    low, high, before, behind = angles[i], angles[i + 1], arm[i], arm[i + 1]
    for _ in range(BISECTIONS if len(i) else 0):
        middle = 0.5 * (low + high)
        _, contacts = pair_contacts(teeth, middle)
        known, arm = contacts.position, contacts.arm / base
        below = np.abs(arm - before[known]).sum(axis=1) < np.abs(arm - behind[known]).sum(axis=1)
        low[known], high[known] = np.where(below, [middle[known], high[known]], [low[known], middle[known]])
    return low, high


def _solved_angles(low: float, high: float, marks: Array, cycle: float) -> Array:
    """Pair angles (rad), close to each other beside marks."""
    near = (marks[:, None] + cycle * np.concatenate([-NEAR, NEAR])).ravel()
    near = np.unique(np.concatenate([[low, high], near[(near > low) & (near < high)]]))
    near = near[np.diff(near, prepend=-np.inf) > SAME * cycle]
    counts = np.maximum(np.ceil(np.diff(near) / (COARSE * cycle) - SAME).astype(int), 1)
    between = [a + (b - a) * np.arange(n) / n for a, b, n in zip(near[:-1], near[1:], counts, strict=True)]
    return np.concatenate([*between, [high]])


def _on_teeth(model: HalfPlanePair, contacts: FirstContacts) -> tuple[Array, Array]:
    """Arc lengths (m), and normals in the axes of both teeth, shapes (n, 2) and (n, 2, 2)."""
    turn = np.exp(1j * (contacts.frames + contacts.twist[:, None] * np.arange(2)))
    normal = contacts.normal[:, None] / turn
    return model.arc_at(contacts.flank, contacts.place), np.stack([normal.real, normal.imag], axis=-1)


def plane_far_field(compliance: WideCompliance, arc: Array, tooth_normal: Array) -> Array:
    """Return w n H n of both gears under loads that are even over the width, shape (n,) (m2/N), logarithms by l."""
    values = compliance.shapes.at(arc)[:, :, 0]
    total = np.zeros(len(arc))
    for gear, side in enumerate(compliance.sides):
        k = len(side.local.stations)
        load = values[:, gear, :k, None] * tooth_normal[:, gear, None]
        total += np.einsum("nia,iajb,njb->n", load, side.influence[0][:, :, 0, :, :, 0], load, optimize=True)
    return total


def _solved_contacts(
    compliance: WideCompliance, model: HalfPlanePair, angles: Array, contacts: FirstContacts, forces: Array
) -> Array:
    """C (m2/N) and delta (-) at first contacts and forces per width (N/m), shape (n, 2, loads); NaN where unknown.

    The twists that are solved are those at which Hertz's law takes the forces, up to where linear elasticity ends.

    Parameters
    ----------
    compliance : WideCompliance
        The gears.
    model : HalfPlanePair
        The same for the plane law.
    angles : ndarray, shape (n,)
        Pair angles (rad).
    contacts : FirstContacts
        First contacts there.
    forces : ndarray, shape (loads,)
        Forces per width (N/m).
    """
    n, pair = len(contacts), model.pair
    arc, tooth_normal = _on_teeth(model, contacts)
    far_field = plane_far_field(compliance, arc, tooth_normal)
    ratio, touch = compliance.mesh.ratio, contacts.twist - pair.contact_twist
    mean_arm = 0.5 * (contacts.arm[:, 1] + ratio * contacts.arm[:, 0])
    # of one curvature, so that a place between two marks of the flanks does not decide
    alone = replace(contacts, position=np.arange(n), curvature=np.full(n, 1 / compliance.mesh.module))
    setting, state = unloaded(model, contacts.twist, alone)
    of_far = far_field_compliance(setting, state)[setting.couples.own]
    twists = np.stack([touch + f * (hertz(setting, state, np.full(n, f))[0] + of_far) / mean_arm for f in forces])
    solvable = mean_arm * (twists - touch) <= MOST_YIELD * compliance.mesh.module
    at, twist = (angles + 0.5 * ratio * twists)[solvable], twists[solvable] + pair.contact_twist
    met = model.teeth.first_contacts_of(np.arange(len(at)), at, np.zeros(len(at), dtype=np.int64))
    solved = solve_half_plane(model, at, twist, met)
    good = (solved.status == "converged") & (solved.torque_wheel > 0) & (solved.torque_pinion > 0)
    wheel, pinion = np.full((2, *twists.shape), np.nan)
    wheel[solvable] = np.where(good, solved.torque_wheel, np.nan) / model.width
    pinion[solvable] = np.where(good, solved.torque_pinion, np.nan) / model.width
    force = 0.5 * (wheel + ratio * pinion) / mean_arm
    values = np.stack([mean_arm * (twists - touch) / force - far_field, wheel / (contacts.arm[:, 1] * force) - 1.0])
    found = np.full((n, 2, len(forces)), np.nan)
    for i in range(n):
        known = np.flatnonzero(np.isfinite(force[:, i]))
        if len(known) >= ENOUGH:
            x = np.log(force[known, i])
            order = np.argsort(x)
            spline = CubicSpline(x[order], values[:, known, i][:, order], axis=1)
            at = np.log(forces)
            inside = np.clip(at, x.min(), x.max())
            found[i] = spline(inside) + (at - inside) * spline(inside, 1)
    return found
