r"""One tooth pair in the transverse section: where it touches, and how its contact yields, over angle and load.

Both are functions of the pair angle :math:`\psi` alone, the pinion angle at which tooth 0 is so: the section at z of
the pair k has :math:`\psi = \varphi + \kappa z + 2\pi k/z_1`. Loads count as moments on the wheel per width,
:math:`M = f\,r` with the arm r of the rigid flanks, and approaches as twists of the wheel, so that what belongs
together has the energy :math:`M\,d\theta`.

A pair that carries M per width by itself, in plane strain, is twisted by

.. math:: \theta(\psi, M) = t(\psi) + T_0(\psi)\,M + c(\psi, M),

with the first contact t of the rigid flanks and the far field :math:`T_0 = w\,nHn/r^2` where they touch. The rest c is
the contact's own: half-planes, wedge, tip rounds within the contact, the normal that turns and the place that moves
under load. The panels of `gearfe.gears.contact.half_plane` solve :math:`\theta(\psi, M)` once for many angles and
loads. c/M is nearly straight in ln M, as of Hertz's contacts, and is interpolated so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from ...base.errors import InputError
from ...base.progress import one_thread
from ...base.typing import Array, ComplexArray
from ..contact.half_plane import expected_twists, solve_half_plane
from ..contact.half_plane_pair import HalfPlanePair
from ..contact.position import of_positions
from ..geometry.face import ToothDeviations
from ..geometry.first_contact import FirstContacts, ToothFlanks
from .compliance import TIPS, WideCompliance

#: Intervals of the table over the pair angle. Linear between its marks, 501 err by 0.04 % of the transmission error,
#: 2,001 do not.
ANGLES = 2000
#: Loads per width at which contacts are solved, in E' times module: from light ones, of 0.4 N/mm on steel of module 2,
#: to where elasticity ends.
LOADS = 1e-6 * 4.0 ** np.arange(7)
#: Distances of solved pair angles from ends of the path and kinks, in mesh cycles: contacts are up to 0.04 cycles wide.
NEAR = np.array([0.0, 0.001, 0.003, 0.005, 0.008, 0.012, 0.017, 0.024, 0.034, 0.048, 0.07, 0.11])
#: Largest distance of solved pair angles (mesh cycles).
COARSE = 0.04
#: Solved share of the cells of a pair angle below which it is left out.
ENOUGH = 4


@dataclass(frozen=True)
class PairLaw:
    """Tables over the rising pair angle, n marks; linear in between.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        psi (rad).
    touch : ndarray, shape (n,)
        Twist at first contact (rad), from where unmodified flanks touch.
    arm : ndarray, shape (n,)
        Moment on the wheel per force (m).
    normal : ndarray of complex, shape (n,)
        Common normal out of the pinion, global axes.
    point : ndarray of complex, shape (n,)
        Where it touches (m), global axes.
    roll, arc : ndarray, shape (n, 2)
        Roll lengths on both flanks, and arc lengths (m).
    tooth_normal : ndarray, shape (n, 2, 2)
        The normal in the axes of both teeth: gear, xy.
    yields : ndarray, shape (n, loads)
        c/M (rad per N) at the moments per width `moments`.
    moments : ndarray, shape (loads,)
        Rising moments per width (N), evenly spaced in their logarithms.
    path : tuple of float
        Pair angles of the ends A and E of the path of contact (rad).
    forward : complex
        Normal on the path of contact.
    """

    angle: Array
    touch: Array
    arm: Array
    normal: ComplexArray
    point: ComplexArray
    roll: Array
    arc: Array
    tooth_normal: Array
    yields: Array
    moments: Array
    path: tuple[float, float]
    forward: complex

    @cached_property
    def packed(self) -> Array:
        """Touch, arm, normal, point, roll, arc, normals in the teeth's axes and yields side by side, shape (n, c)."""
        n = len(self.angle)
        columns = [self.touch, self.arm, self.normal.real, self.normal.imag, self.point.real, self.point.imag]
        return np.concatenate(
            [np.stack(columns, axis=1), self.roll, self.arc, self.tooth_normal.reshape(n, 4), self.yields], axis=1
        )


def pair_law(compliance: WideCompliance, profiles: tuple[ToothDeviations, ToothDeviations]) -> PairLaw:
    """Return the law of a tooth pair whose flanks have the profiles of the first teeth.

    Raises
    ------
    InputError
        For flanks whose contact is not solved at most loads.
    """
    mesh = compliance.mesh
    pair, cycle = mesh.sections, mesh.sections.mesh_cycle
    first = tuple(ToothDeviations((own.profiles[own.profile[0]],)) for own in profiles)
    teeth = ToothFlanks(pair, (first[0], first[1]))
    sides = compliance.sides[0].local, compliance.sides[1].local
    model = HalfPlanePair(pair, teeth, sides, mesh.width)
    path = pair.path["A"].pinion_angle, pair.path["E"].pinion_angle
    low, high = path[0] - TIPS * cycle, path[1] + TIPS * cycle
    marks = np.unique(np.concatenate([path, _kinks(model)]))
    marks = marks[(marks > low) & (marks < high)]
    contacts = _contacts(teeth, np.unique(np.concatenate([np.linspace(low, high, ANGLES + 1), marks])))
    solved = _contacts(teeth, _solved_angles(low, high, marks, cycle))
    modulus = 2 / sum(side.inverse_modulus for side in sides)
    moments = LOADS * modulus * mesh.module * pair.wheel.base_radius
    with one_thread():
        at_marks = _yields(compliance, model, solved, moments)
    known = np.isfinite(at_marks).all(axis=1)
    if np.count_nonzero(known) < ENOUGH:
        problem = "the contact of a tooth pair is not solved at most pair angles"
        raise InputError("profiles", None, problem, "use smaller modifications, without short waves")
    yields = PchipInterpolator(solved.angle[known], at_marks[known])(
        np.clip(contacts.angle, solved.angle[known][0], solved.angle[known][-1])
    )
    arc, tooth_normal = _on_teeth(model, contacts)
    radius = np.abs(np.stack([contacts.point, contacts.point - pair.working_centre_distance], axis=1))
    base = np.array([gear.base_radius for gear in mesh.gears])
    return PairLaw(
        angle=contacts.angle,
        touch=contacts.twist - pair.contact_twist,
        arm=contacts.arm[:, 1],
        normal=contacts.normal,
        point=contacts.point,
        roll=np.sqrt(np.maximum(radius**2 - base**2, 0.0)),
        arc=arc,
        tooth_normal=tooth_normal,
        yields=yields,
        moments=moments,
        path=path,
        forward=complex(np.exp(1j * (0.5 * math.pi - pair.working_pressure_angle))),
    )


def _contacts(teeth: ToothFlanks, angles: Array) -> FirstContacts:
    """First contacts of the pair 0 at pair angles (rad), where its flanks meet."""
    return teeth.first_contacts_of(np.arange(len(angles)), angles, np.zeros(len(angles), dtype=np.int64))


def _kinks(model: HalfPlanePair) -> Array:
    """Pair angles (rad) at which kinks of the flanks pass the line of action."""
    pair = model.pair
    rolls = [np.asarray(face.flank.kinks, dtype=float) for face in model.teeth.faces]
    return np.array([pair.pinion_angle_at(s) for s in (*rolls[0], *(pair.tangent_length - rolls[1]))])


def _solved_angles(low: float, high: float, marks: Array, cycle: float) -> Array:
    """Pair angles (rad), close to each other beside marks."""
    near = (marks[:, None] + cycle * np.concatenate([-NEAR, NEAR])).ravel()
    near = np.unique(np.concatenate([[low, high], near[(near > low) & (near < high)]]))
    gaps = np.maximum(np.ceil(np.diff(near) / (COARSE * cycle)).astype(int), 1)
    between = [a + (b - a) * np.arange(n) / n for a, b, n in zip(near[:-1], near[1:], gaps, strict=True)]
    angles = np.concatenate([*between, [high]])
    return np.asarray(angles[np.diff(angles, prepend=-np.inf) > 1e-6 * cycle])


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


def _yields(compliance: WideCompliance, model: HalfPlanePair, contacts: FirstContacts, moments: Array) -> Array:
    """c/M (rad per N) of first contacts at moments per width (N), shape (n, loads); NaN where it is not known."""
    n, width = len(contacts), model.width
    arc, tooth_normal = _on_teeth(model, contacts)
    far_field = plane_far_field(compliance, arc, tooth_normal) / contacts.arm[:, 1] ** 2
    position = np.arange(n)
    of_cells = of_positions(FirstContacts(**{**vars(contacts), "position": position}), np.tile(position, len(moments)))
    torques = np.repeat(moments * width, n)
    twists = expected_twists(model, torques, of_cells)
    solved = solve_half_plane(model, of_cells.angle, twists, of_cells)
    good = (solved.status == "converged") & (solved.torque_wheel > 0)
    moment = np.where(good, solved.torque_wheel / width, np.nan).reshape(-1, n)
    yields = (twists - of_cells.twist).reshape(-1, n) / moment - far_field
    found = np.full((n, len(moments)), np.nan)
    for i in range(n):
        known = np.flatnonzero(np.isfinite(yields[:, i]))
        if len(known) >= ENOUGH:
            x = np.log(moment[known, i])
            order = np.argsort(x)
            spline = CubicSpline(x[order], yields[known, i][order])
            at = np.log(moments)
            inside = np.clip(at, x.min(), x.max())
            found[i] = spline(inside) + (at - inside) * spline(inside, 1)
    return found
