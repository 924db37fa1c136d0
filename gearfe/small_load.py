r"""Small loads: contacts that are narrower than the elements of the flank, from one reference per pinion angle.

Let the pairs k touch at the twists :math:`\varphi_k` of the rigid gears, exact ones (`gearfe.touching`), with the levers
:math:`a_k`. Under the forces F they close the overlaps that the rigid gears would have at the twist
:math:`\varphi = \varphi_k + \psi_k`,

.. math::
    a_k\psi_k + \tfrac12\psi_k^2\,n_k\cdot(x_k-c) + \frac{\partial G}{\partial F_k}
    = \sum_l C_{kl} F_l + \lambda_k(F_k)\quad\text{where } F_k > 0 .

:math:`\lambda_k` is the approach of the contact itself, which knows no mesh: Hertz's law
:math:`\frac{F}{\pi E^* w}(1 - 2\ln\frac b2)` with :math:`b\sim\sqrt F` on smooth flanks, its numerical like where a tip's
edge or the start of a relief takes part (`gearfe.contact.hertz`). C is everything else, the compliance of teeth, rims and
neighbours, and independent of the load: the finite-element flanks give the mean displacement under an elliptic pressure
that spans several elements, from which that pressure's own local approach is taken off,

.. math:: C_{kl} = q_k^T C^{FE} q_l - \delta_{kl}\,\bar\lambda_k .

For any two loads this is :math:`\Delta = F\ln(F_{ref}/F)/(\pi E^* w)`.

:math:`G = \sum_k F_k Q_k` holds what grows with the load: as teeth bend and the wheel turns on, faces rotate by
:math:`\theta_i` and slide by :math:`\tau_i`, and contact wanders over them. Two parabolas of the curvatures
:math:`\kappa_1, \kappa_2` so displaced overlap by

.. math::
    Q = \frac{(\theta_1-\theta_2)^2}{2(\kappa_1+\kappa_2)}
    - (\tau_1-\tau_2)\frac{\kappa_2\theta_1+\kappa_1\theta_2}{\kappa_1+\kappa_2}
    - \frac{(\tau_1-\tau_2)^2}{2}\frac{\kappa_1\kappa_2}{\kappa_1+\kappa_2}

more than at their first point of contact (the largest difference of the two). Where a contact is not symmetric, its
pressure has the moment m(F) about that point, the reference pressure the moment F r, and
:math:`(m - F r)(\theta_1-\theta_2)` adds to G. :math:`\theta_i, \tau_i` are linear in F and,
for the wheel's rigid motion, in psi; on the path of contact the latter cancel, as the law of gearing has it.

All of it follows from one potential :math:`W(\varphi) = \max_F [\,F\cdot\text{overlap} - \frac12 F^TCF -
\Lambda(F) + G\,]`, so torques are its derivatives with respect to the rotations, and the tangent the second one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .contact.compliance import GearBody
from .contact.elliptic import Chain, Loads
from .contact.hertz import Approach, LocalContact
from .contact.scene import MeshingPair, Window, assemble
from .contact.solver import Position
from .gear import GearPair

from .local_gap import local_contact
from .touching import Flanks, Touching

Array = NDArray[Any]

#: Half width of the reference pressure in elements.
REFERENCE_ELEMENTS = 2.0
#: Newton steps of a balance, and the change of the forces at which it is done.
MAX_ITERATIONS, TOLERANCE = 60, 1e-12


@dataclass(frozen=True)
class Reference:
    """One pinion angle: all pairs that may touch, for any twist. `solve` is what most callers want.

    Attributes
    ----------
    angle
        Pinion angle (rad).
    touching
        Where and when the m pairs touch, the earliest first.
    compliance : ndarray, shape (m, m)
        C (m/N).
    motion : ndarray, shape (m, 4, m)
        theta_1, theta_2 (rad/N), tau_1, tau_2 (m/N) at each contact for the force of each pair.
    rigid : ndarray, shape (m, 4)
        The same for the wheel's twist (-, m).
    pinion_rigid : ndarray, shape (m, 4)
        The same for a rotation of the pinion.
    wander : ndarray, shape (m, 4, 4)
        Second derivatives of Q.
    local : tuple of LocalContact
    middle : ndarray, shape (m,)
        Middle of the reference pressure beside the contact (m).
    width
        Common face width (m).
    elements : ndarray, shape (m,)
        Element size of the flanks at each contact (m).
    unit : tuple of (Loads, Loads)
        Nodal loads on pinion and wheel of the reference pressures.
    """

    angle: float
    touching: Touching
    compliance: Array
    motion: Array
    rigid: Array
    pinion_rigid: Array
    wander: Array
    local: tuple[LocalContact, ...]
    middle: Array
    width: float
    elements: Array
    unit: tuple[tuple[Loads, Loads], ...]

    @property
    def first_touch(self) -> float:
        """Twist (rad) at which the rigid gears just touch."""
        return float(self.touching.twist.min()) if len(self.touching) else math.inf


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
    bore_difference
        What the moment of the bore's reactions has more than torque_wheel, since forces act at displaced points: sum of
        u x f over the wheel (N m).
    shares : ndarray, shape (m,)
        Torque of each pair on the wheel (N m).
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
    bore_difference: float
    shares: Array
    iterations: int


def references(
    pair: GearPair, elastic: MeshingPair, flanks: Flanks, touching: Sequence[Touching], angles: Sequence[float]
) -> list[Reference]:
    """References of n pinion angles (rad) with the pairs that touch there (`gearfe.touching.Flanks.touching`)."""
    chains = [Chain(body) for body in elastic.bodies]
    return [_reference(pair, elastic, flanks, chains, t, float(a)) for t, a in zip(touching, angles, strict=True)]


def _reference(
    pair: GearPair, elastic: MeshingPair, flanks: Flanks, chains: list[Chain], touching: Touching, angle: float
) -> Reference:
    count = len(touching)
    unit: list[tuple[Loads, Loads]] = []
    local, sizes, spans = [], np.zeros(count), []
    for k in range(count):
        arcs = [chain.arc_at(float(touching.radius[k, g])) for g, chain in enumerate(chains)]
        # x runs along the pinion's flank to its tip, against the wheel's
        low, high, sizes[k] = _span(chains, arcs)
        spans.append((low, high))
        local.append(local_contact(pair, elastic, flanks, touching, k))
        normal = complex(touching.normal[k])
        axes = [elastic.tooth_angle(g, t, angle, touching.twist[k]) for g, t in enumerate(_teeth(touching, k))]
        # frictionless: the pinion is pushed against n, the wheel along it
        unit.append(
            (
                chains[0].loads(arcs[0] + low, arcs[0] + high, normal * np.exp(-1j * axes[0]), sign=-1.0),
                chains[1].loads(arcs[1] - high, arcs[1] - low, normal * np.exp(-1j * axes[1]), sign=+1.0),
            )
        )
    compliance, motion = _responses(elastic, touching, unit)
    for k in range(count):
        compliance[k, k] -= local[k].elliptic_mean(*spans[k]) / elastic.width
    tangent = -1j * touching.normal
    from_wheel = touching.point - pair.working_centre_distance
    zero, one = np.zeros(count), np.ones(count)
    rigid = np.stack([zero, one, zero, (np.conj(tangent) * 1j * from_wheel).real], axis=1)
    pinion_rigid = np.stack([one, zero, (np.conj(tangent) * 1j * touching.point).real, zero], axis=1)
    wander = _wander(flanks, touching, pair.pinion.module)
    return Reference(
        angle,
        touching,
        compliance,
        motion,
        rigid,
        pinion_rigid,
        wander,
        tuple(local),
        np.array([0.5 * (low + high) for low, high in spans]),
        elastic.width,
        sizes,
        tuple(unit),
    )


def _teeth(touching: Touching, k: int) -> tuple[int, int]:
    return int(touching.pair[k]), -1 - int(touching.pair[k])


def _span(chains: list[Chain], arcs: list[float]) -> tuple[float, float, float]:
    """Stretch of the reference pressure about a contact as far as both flanks reach, and the element size there (m)."""
    at = max(c.size_in(a, a) for c, a in zip(chains, arcs, strict=True))
    half = REFERENCE_ELEMENTS * at
    for _ in range(3):
        size = max(c.size_in(a - half, a + half) for c, a in zip(chains, arcs, strict=True))
        half = 0.5 * (half + REFERENCE_ELEMENTS * size)
    least, most = arcs[1] - chains[1].ends[-1], chains[0].ends[-1] - arcs[0]
    return max(-half, least), min(half, most), at


def _responses(
    elastic: MeshingPair, touching: Touching, unit: list[tuple[Loads, Loads]]
) -> tuple[Array, Array]:
    """C^FE between the reference pressures, and rotations and slides of the faces for them."""
    count = len(unit)
    compliance, motion = np.zeros((count, count)), np.zeros((count, 4, count))
    for g, body in enumerate(elastic.bodies):
        for k in range(count):
            for other in range(count):
                step = int(touching.pair[k] - touching.pair[other]) * (1 if g == 0 else -1)
                moved = _moved(body, unit[k][g], unit[other][g], step)
                compliance[k, other] += moved[0]
                motion[k, g, other], motion[k, 2 + g, other] = moved[1], moved[2]
    return 0.5 * (compliance + compliance.T), motion


def _moved(body: GearBody, seen: Loads, loaded: Loads, step: int) -> Array:
    """Work displacement, rotation and slide at `seen` for the unit force `loaded` on the tooth `step` away."""
    far = (seen.probes @ body.far.flank[seen.unknowns]) @ (
        body.far.driven[step][:, loaded.unknowns] @ loaded.probes[0]
    )
    if step == 0:
        far = far + seen.probes @ (body.own[seen.unknowns, loaded.unknowns] @ loaded.probes[0])
    return np.asarray(far)


def _wander(flanks: Flanks, touching: Touching, module: float) -> Array:
    """Second derivatives of Q with respect to (theta_1, theta_2, tau_1, tau_2), shape (m, 4, 4)."""
    made = np.zeros((len(touching), 4, 4))
    for k in range(len(touching)):
        one, two = (f.curvature(float(touching.place[k, g]), 1e3 / module) for g, f in enumerate(flanks.faces))
        total = one + two
        tilt, slide = np.array([1.0, -1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, -1.0])
        mixed = np.array([two, one, 0.0, 0.0]) / total
        made[k] = np.outer(tilt, tilt) / total - np.outer(slide, mixed) - np.outer(mixed, slide)
        made[k] -= np.outer(slide, slide) * one * two / total
    return made


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
    pulls : ndarray, shape (m,)
        dG/dtwist, its parts from each contact (N m).
    twist_twice
        d2G/dtwist2 (N m).
    pinion
        dG by the pinion's rotation (N m).
    """

    force: Array
    force_twice: Array
    force_twist: Array
    pulls: Array
    twist_twice: float
    pinion: float


#: theta_1 - theta_2 of (theta_1, theta_2, tau_1, tau_2).
_TILT = np.array([1.0, -1.0, 0.0, 0.0])


def _growing(r: Reference, force: Array, psi: Array, answers: Sequence[Approach | None]) -> _Growing:
    v = r.motion @ force + r.rigid * psi[:, None]
    bent = (r.wander @ v[:, :, None])[:, :, 0]
    stiff = r.wander @ r.motion
    rigid = (r.wander @ r.rigid[:, :, None])[:, :, 0]
    # the moment of the contact pressure about the middle of the reference pressure turns with the tilt of the faces
    moment = np.array([0.0 if a is None else a.moment * r.width for a in answers]) - r.middle * force
    rate = np.array([0.0 if a is None else a.moment_rate for a in answers]) - r.middle
    tilt, tilts = v @ _TILT, np.einsum("i,kij->kj", _TILT, r.motion)
    seen = np.einsum("ki,kij->kj", bent, r.motion) + rate[:, None] * tilts
    by_force = 0.5 * np.einsum("ki,ki->k", bent, v) + force @ np.einsum("ki,kij->kj", bent, r.motion)
    own = np.einsum("ki,ki->k", bent, r.rigid)
    return _Growing(
        force=by_force + rate * tilt + moment @ tilts,
        force_twice=seen + seen.T + np.einsum("k,kij,kil->jl", force, r.motion, stiff),
        force_twist=own + np.einsum("k,ki,kij->j", force, rigid, r.motion) + rate * (r.rigid @ _TILT),
        pulls=force * own + moment * (r.rigid @ _TILT),
        twist_twice=float(force @ np.einsum("ki,ki->k", rigid, r.rigid)),
        pinion=float(force @ np.einsum("ki,ki->k", bent, r.pinion_rigid) + moment @ (r.pinion_rigid @ _TILT)),
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
        return Balance(True, np.zeros(count), np.zeros(count), tuple(answers), 0.0, 0.0, 0.0, 0.0, np.zeros(count), 0)
    psi = np.maximum(psi, 0.0)
    light = 0.05 * r.local[0].modulus * w  # a stiffness that a line contact has about
    force = np.where(overlap > 0, light * overlap, 0.0)
    converged, iteration = False, 0
    while not converged and iteration < MAX_ITERATIONS:
        iteration += 1
        on = np.flatnonzero(force > 0)
        answers = [r.local[k].under(force[k] / w) if force[k] > 0 else None for k in range(count)]
        given = [a for a in answers if a is not None]
        grown = _growing(r, force, psi, answers)
        matrix = (r.compliance - grown.force_twice)[np.ix_(on, on)] + np.diag([a.rate / w for a in given])
        residual = (overlap + grown.force - r.compliance @ force)[on] - [a.approach for a in given]
        new = force.copy()
        new[on] += np.linalg.solve(matrix, residual)
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
        force = new
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
    shares = force * lever + grown.pulls
    tangent = float(pull @ rate + force @ radial) + grown.twist_twice
    pinion = float(r.touching.arm[:, 0] @ force) + grown.pinion
    slide = float(force @ (r.motion[:, 3] @ force))
    return Balance(converged, force, rate, contacts, float(shares.sum()), pinion, tangent, slide, shares, iteration)


def position_of(reference: Reference, found: Balance) -> Position:
    """The balance as a `Position` without fields.

    `peak_pressure` is that of the contact law, of smooth contacts where there are any: under a sharp edge linear
    elasticity has no bound.
    """
    if not found.converged:
        return Position("not_converged", *[math.nan] * 4, (), np.zeros(0), math.nan, found.iterations, route="hertz")
    on = np.flatnonzero(found.force > 0)
    if len(on) == 0:
        return Position("no_contact", *[0.0] * 4, (), np.zeros(0), 0.0, found.iterations, route="hertz")
    r = reference
    order = on[np.argsort(r.touching.pair[on])]
    smooth = [c.pressure for c in found.contacts if c is not None and c.smooth]
    every = [c.pressure for c in found.contacts if c is not None]
    return Position(
        status="converged",
        torque_wheel=found.torque_wheel,
        torque_pinion=found.torque_pinion,
        torque_wheel_reaction=found.torque_wheel + found.bore_difference,
        tangent=found.tangent,
        pair_numbers=tuple(int(k) for k in r.touching.pair[order]),
        pair_torques=found.shares[order],
        peak_pressure=max(smooth or every),
        iterations=found.iterations,
        route="hertz",
    )


def with_forces(position: Position, reference: Reference, elastic: MeshingPair, found: Balance, twist: float) -> Position:
    """The position with scene and forces, for fields and for the share of finite strain.

    The forces are the reference pressures scaled to the forces of the pairs: fields recovered from them are right beyond
    about two half widths of the reference pressure from a contact, which they show wider and with less stress than it
    has.
    """
    r = reference
    windows: list[Window] = []
    forces, rates, node = [], [], 0
    for number, k in enumerate(np.flatnonzero(found.force > 0)):
        for g, tooth in enumerate(_teeth(r.touching, k)):
            loads = r.unit[k][g]
            first, edges = loads.edges
            placed = elastic.tooth_angle(g, tooth, r.angle, twist)
            windows.append(Window(g, number, tooth, first, edges, node, placed))
            node += 2 * edges + 1
            forces.append(found.force[k] * loads.probes[0])
            rates.append(found.rate[k] * loads.probes[0])
    if not windows:
        return position
    scene = replace(assemble(elastic, windows), compliance=np.zeros((0, 0)), stress=np.zeros((0, 0)))
    return replace(position, scene=scene, forces=np.concatenate(forces), force_rate=np.concatenate(rates))
