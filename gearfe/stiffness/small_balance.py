"""Forces of tooth pairs under small loads at one twist, from a reference (equations: `gearfe.stiffness.small_load`).

>>> table = [balance(reference, twist).torque_wheel for twist in twists]   # one reference, many loads
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.hertz import Approach
from ..contact.scene import MeshingPair, Window, assemble
from ..contact.solver import Position
from .small_load import Reference

Array = NDArray[Any]

#: Newton steps of a balance, and the change of the forces at which it is done.
MAX_ITERATIONS, TOLERANCE = 120, 1e-12
#: The moment of a pressure on panels has a rate that jumps where the contact takes in one panel more, and the residual
#: with it. Where the solution lies at such a jump Newton's steps go to and fro across it: after `PLAIN` of them, each
#: return halves what is taken of the next, and a whole step must be less than `JUMP` of the force in the end.
PLAIN, JUMP = 20, 1e-3


@dataclass(frozen=True)
class Balance:
    """Solution of a reference at one twist.

    Attributes
    ----------
    converged
        Whether the equations are met.
    force, rate : ndarray, shape (m,)
        F (N) and dF/dtwist (N/rad).
    contacts
        Local contact of each loaded pair, None for the others.
    torque_wheel, torque_pinion, tangent
        N m, N m, N m/rad.
    shares : ndarray, shape (m,)
        Torque of each pair on the wheel (N m).
    reactions : ndarray, shape (2, m)
        Moments of the reactions at the bores of pinion and wheel, pair by pair: those of the forces at undeformed
        places, while torques are those at displaced ones (N m).
    lean, lean_rate : ndarray, shape (m,)
        Angle (rad) by which the common normal of the loaded faces has turned from n, and its rate with the twist (-).
    iterations
        Newton steps.
    """

    converged: bool
    force: Array
    rate: Array
    contacts: tuple[Approach | None, ...]
    torque_wheel: float
    torque_pinion: float
    tangent: float
    shares: Array
    reactions: Array
    lean: Array
    lean_rate: Array
    iterations: int


@dataclass(frozen=True)
class _Growing:
    """Derivatives of G at given forces and twist.

    Attributes
    ----------
    force : ndarray, shape (m,)
        dG/dF (m).
    force_twice : ndarray, shape (m, m)
    force_twist : ndarray, shape (m,)
        d2G/dF dtwist (m).
    pulls : ndarray, shape (2, m)
        dG by the rotations of pinion and wheel, its parts from each contact but for the slides' (N m).
    twist_twice
        d2G/dtwist2 (N m).
    lean : ndarray, shape (m,)
        dQ/dtau_2, the angle by which the force turns: a contact that may slide to where the faces overlap more is
        pushed that way (rad).
    """

    force: Array
    force_twice: Array
    force_twist: Array
    pulls: Array
    twist_twice: float
    lean: Array


#: theta_1 - theta_2 of (theta_1, theta_2, tau_1, tau_2).
_TILT = np.array([1.0, -1.0, 0.0, 0.0])


def _growing(r: Reference, force: Array, psi: Array, answers: Sequence[Approach | None]) -> _Growing:
    v = r.motion @ force + r.rigid * psi[:, None]
    bent = (r.wander @ v[:, :, None])[:, :, 0]
    stiff = r.wander @ r.motion
    rigid = (r.wander @ r.rigid[:, :, None])[:, :, 0]
    # the moment of the contact pressure turns with the tilt of the faces. C has the elastic tilt under the reference
    # pressure: about its middle there; the rigid tilt turns about the point of contact
    moment = np.array([0.0 if a is None else a.moment * r.width for a in answers])
    moment_rate = np.array([0.0 if a is None else a.moment_rate for a in answers])
    rate, offset = moment_rate - r.middle, moment - r.middle * force
    tilts, rigid_tilt = np.einsum("i,kij->kj", _TILT, r.motion), r.rigid @ _TILT
    tilt = rate * (tilts @ force) + moment_rate * psi * rigid_tilt
    seen = np.einsum("ki,kij->kj", bent, r.motion) + rate[:, None] * tilts
    by_force = 0.5 * np.einsum("ki,ki->k", bent, v) + force @ np.einsum("ki,kij->kj", bent, r.motion)
    own = np.einsum("ki,ki->k", bent, r.rigid)
    rigids = np.stack([r.pinion_rigid, r.rigid])
    # the wheel turns on by psi with the slides that the loads gave its faces
    slid, slides = r.motion[:, 3] @ force, psi[:, None] * r.motion[:, 3]
    carried = force @ r.motion[:, 3]
    return _Growing(
        force=by_force + tilt + offset @ tilts - psi * slid - force @ slides,
        force_twice=seen + seen.T + np.einsum("k,kij,kil->jl", force, r.motion, stiff) - slides - slides.T,
        force_twist=own + np.einsum("k,ki,kij->j", force, rigid, r.motion) + moment_rate * rigid_tilt - slid - carried,
        pulls=np.einsum("gki,ki->gk", rigids, force[:, None] * bent + moment[:, None] * _TILT),
        twist_twice=float(force @ np.einsum("ki,ki->k", rigid, r.rigid)),
        lean=bent[:, 3],
    )


def balance(reference: Reference, twist: float) -> Balance:
    """Forces of the pairs at a twist (rad): Newton's method; pairs that would pull are let go."""
    r, w = reference, reference.width
    count = len(r.touching)
    psi = twist - r.touching.twist
    lever = r.touching.arm[:, 1]
    radial = (np.conj(r.touching.normal) * _from_wheel(r)).real
    overlap = np.where(psi > 0, lever * psi + 0.5 * psi**2 * radial, lever * psi)
    answers: list[Approach | None] = [None] * count
    if not (overlap > 0).any():
        none = np.zeros(count)
        return Balance(True, none, none, tuple(answers), 0.0, 0.0, 0.0, none, np.zeros((2, count)), none, none, 0)
    psi = np.maximum(psi, 0.0)
    light = 0.05 * r.local[0].modulus * w  # a stiffness that a line contact has about
    force = np.where(overlap > 0, light * overlap, 0.0)
    converged, iteration, taken, last = False, 0, 1.0, np.zeros(count)
    while not converged and iteration < MAX_ITERATIONS:
        iteration += 1
        on = np.flatnonzero(force > 0)
        answers = [r.local[k].under(force[k] / w) if force[k] > 0 else None for k in range(count)]
        given = [a for a in answers if a is not None]
        grown = _growing(r, force, psi, answers)
        matrix = (r.compliance - grown.force_twice)[np.ix_(on, on)] + np.diag([a.rate / w for a in given])
        residual = (overlap + grown.force - r.compliance @ force)[on] - [a.approach for a in given]
        step = np.zeros(count)
        step[on] = np.linalg.solve(matrix, residual)
        if iteration > PLAIN and step @ last < 0:
            taken *= 0.5
        last = step
        new = force + taken * step
        least = 0.1 * force
        light_ones = on[new[on] < least[on]]
        new[light_ones] = 0.0
        # a pair without force bears as soon as it overlaps, however lightly: lambda' is infinite at F = 0
        open_ = np.flatnonzero(new == 0.0)
        shut = [None if f == 0.0 else a for f, a in zip(new, answers, strict=True)]
        left = (overlap + _growing(r, new, psi, shut).force - r.compliance @ new)[open_]
        bears = left > 1e-12 * overlap.max()
        back = open_[bears]
        new[back] = np.where(force[back] > 0, least[back], light * left[bears])
        converged = bool(np.abs(new - force).max() <= TOLERANCE * new.max()) and not len(back)
        converged &= bool(np.abs(step).max() <= JUMP * new.max())
        force = new
    if not converged:  # the last step may have let pairs bear that have no answer yet
        answers = [r.local[k].under(force[k] / w) if force[k] > 0 else None for k in range(count)]
    return _balanced(r, force, psi, radial, tuple(answers), iteration, converged)


def _from_wheel(r: Reference) -> NDArray[np.complex128]:
    """Contacts seen from the wheel's centre (m): its moment arm turned back."""
    normal, arm = r.touching.normal, r.touching.arm[:, 1]
    return r.rigid[:, 3] * -normal + arm * 1j * normal


def _balanced(
    r: Reference, force: Array, psi: Array, radial: Array, contacts: Any, iteration: int, converged: bool
) -> Balance:
    on = np.flatnonzero(force > 0)
    grown = _growing(r, force, psi, contacts)
    lever = r.touching.arm[:, 1] + psi * radial
    pull = lever + grown.force_twist
    rate = np.zeros(len(force))
    local = np.diag([contacts[k].rate / r.width for k in on])
    rate[on] = np.linalg.solve((r.compliance - grown.force_twice)[np.ix_(on, on)] + local, pull[on])
    tangent = float(pull @ rate + force @ radial) + grown.twist_twice
    reactions = force * np.stack([r.touching.arm[:, 0], lever]) + grown.pulls
    pinion, shares = reactions + force * np.stack([r.motion[:, 2] @ force, -r.motion[:, 3] @ force])
    turning = np.einsum("ki,ki->k", r.wander[:, 3], r.motion @ rate + r.rigid)
    return Balance(
        converged,
        force,
        rate,
        contacts,
        float(shares.sum()),
        float(pinion.sum()),
        tangent,
        shares,
        reactions,
        grown.lean,
        turning,
        iteration,
    )


def position_of(reference: Reference, found: Balance) -> Position:
    """The balance as a `Position` without fields.

    `peak_pressure` is that of the contact law, of smooth contacts where there are any: under a sharp edge linear
    elasticity has no bound.
    """
    if not found.converged:
        return _nothing("not_converged", math.nan, found.iterations)
    on = np.flatnonzero(found.force > 0)
    if len(on) == 0:
        return _nothing("no_contact", 0.0, found.iterations)
    r = reference
    order = on[np.argsort(r.touching.pair[on])]
    smooth = [c.pressure for c in found.contacts if c is not None and c.smooth]
    every = [c.pressure for c in found.contacts if c is not None]
    return Position(
        status="converged",
        torque_wheel=found.torque_wheel,
        torque_pinion=found.torque_pinion,
        torque_wheel_reaction=float(found.reactions[1].sum()),
        tangent=found.tangent,
        pair_numbers=tuple(int(k) for k in r.touching.pair[order]),
        pair_torques=found.shares[order],
        peak_pressure=max(smooth or every),
        iterations=found.iterations,
        pair_widths=np.array([found.contacts[k].equivalent for k in order]),
        route="hertz",
    )


def _nothing(status: str, number: float, iterations: int) -> Position:
    none = np.zeros(0)
    return Position(status, number, number, number, number, (), none, number, iterations, route="hertz")


def with_forces(
    position: Position, reference: Reference, elastic: MeshingPair, found: Balance, twist: float
) -> Position:
    """The position with scene and forces, for fields and for the share of finite strain.

    The forces are the reference pressures scaled to the forces of the pairs, turned to the normal of the loaded faces
    and moved by a couple to their line: those on both gears cancel and have the moments of the balance. Fields
    recovered from them are right beyond about two half widths of the reference pressure from a contact, which they show
    wider and with less stress than it has.
    """
    r = reference
    windows: list[Window] = []
    forces, rates, pressures, node = [], [], [], 0
    for number, k in enumerate(np.flatnonzero(found.force > 0)):
        rate = found.rate[k] + found.force[k] * 1j * found.lean_rate[k]
        for g, tooth in enumerate(r.teeth(int(k))):
            loads = r.unit[k][g]
            first, edges = loads.edges
            placed = elastic.tooth_angle(g, tooth, r.angle, twist)
            windows.append(Window(g, number, tooth, first, edges, node, placed))
            node += 2 * edges + 1
            # the wheel's axes have turned on since its tooth touched, and go on turning
            turned = np.exp(-1j * g * (twist - r.touching.twist[k]))
            unit, couple = turned * loads.probes[:2].view(complex)
            unit = unit * (1 + 1j * found.lean[k])
            arms = elastic.bodies[g].flank.points.ravel()[loads.unknowns].view(complex)
            missing = -found.reactions[g, k] / found.force[k] - _moment(arms, unit)
            unit += missing / _moment(arms, couple) * couple
            forces.append((found.force[k] * unit).view(float))
            rates.append(((rate - 1j * g * found.force[k]) * unit).view(float))
            pressures.append(found.force[k] * loads.pressure(elastic.bodies[g].flank, r.width))
    if not windows:
        return position
    scene = replace(assemble(elastic, windows), compliance=np.zeros((0, 0)), stress=np.zeros((0, 0)))
    none = np.zeros(len(scene.owner))  # laws with stress loads ask for them; these forces need none
    return replace(
        position,
        scene=scene,
        forces=np.concatenate(forces),
        force_rate=np.concatenate(rates),
        pressure=np.concatenate([pressures[i] for i in np.unique(scene.owner)]),
        stress_loads=none,
        stress_load_rate=none,
    )


def _moment(arms: NDArray[np.complex128], forces: NDArray[np.complex128]) -> float:
    """Sum of x f_y - y f_x."""
    return float((np.conj(arms) * forces).imag.sum())
