r"""Small loads: contacts that are narrower than the elements of the flank, from one reference per pinion angle.

Let the pairs k touch at the twists :math:`\varphi_k` of the rigid gears, exact ones (`gearfe.gear.touching`), with the
levers :math:`a_k`. Under the forces F they close the overlaps that the rigid gears would have at the twist
:math:`\varphi = \varphi_k + \psi_k`,

.. math::
    a_k\psi_k + \tfrac12\psi_k^2\,n_k\cdot(x_k-c) + \frac{\partial G}{\partial F_k}
    = \sum_l C_{kl} F_l + \lambda_k(F_k)\quad\text{where } F_k > 0 .

:math:`\lambda_k` is the approach of the contact itself, which knows no mesh: Hertz's law
:math:`\frac{F}{\pi E^* w}(1 - 2\ln\frac b2)` with :math:`b\sim\sqrt F` on smooth flanks, its numerical like where a
tip's edge or the start of a relief takes part (`gearfe.contact.hertz`). C is everything else, the compliance of
teeth, rims and neighbours, and independent of the load: the finite-element flanks give the mean displacement under an
elliptic pressure that spans several elements, from which that pressure's own local approach is taken off,

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
:math:`m(\theta_1-\theta_2)` adds to G, less :math:`F r(\theta_1-\theta_2)` of the elastic tilt, which C has.
:math:`\theta_i, \tau_i` are linear in F, without what a face turns under the reference pressure beside its own
edge: that is part of the local contact, as :math:`\bar\lambda` is. For the wheel's rigid motion they are linear in psi;
on the path of contact these cancel, as the law of gearing has it. What the loads make of :math:`\tau_2`,
:math:`\tau_2^F`, turns on with the wheel, which parts the faces by :math:`\psi\tau_2^F`: another
:math:`-F\psi\tau_2^F` in G. Rotations of the whole gear pair then leave G as it is, so that the moments balance.

All of it follows from one potential :math:`W(\varphi) = \max_F [\,F\cdot\text{overlap} - \frac12 F^TCF -
\Lambda(F) + G\,]`, so torques are its derivatives with respect to the rotations, and the tangent the second one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.compliance import GearBody
from ..contact.elliptic import Chain, Loads
from ..contact.hertz import LocalContact
from ..contact.scene import MeshingPair
from ..gear.pair import GearPair
from ..gear.touching import Flanks, Touching
from .local_gap import local_contact

Array = NDArray[Any]

#: Half width of the reference pressure in elements.
REFERENCE_ELEMENTS = 2.0


@dataclass(frozen=True)
class Reference:
    """One pinion angle: all pairs that may touch, for any twist (`gearfe.stiffness.small_balance.balance`).

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
        Element size of the coarser flank at each contact (m).
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

    def teeth(self, k: int) -> tuple[int, int]:
        """Tooth numbers of pinion and wheel of the pair k of this reference."""
        return _teeth(self.touching, k)


def references(
    pair: GearPair,
    elastic: MeshingPair,
    flanks: Flanks,
    touching: Sequence[Touching],
    angles: Sequence[float],
    *,
    chains: list[Chain] | None = None,
) -> list[Reference]:
    """References of n pinion angles (rad) with the pairs that touch there (`gearfe.gear.touching.Flanks.touching`).

    Parameters
    ----------
    chains
        Flanks of pinion and wheel, when they are there already.
    """
    chains = chains or [Chain(body) for body in elastic.bodies]
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
        low, high, element = _span(chains, arcs)
        sizes[k] = max(c.size_at(a) for c, a in zip(chains, arcs, strict=True))
        spans.append((low, high))
        local.append(local_contact(pair, elastic, flanks, touching, k, element))
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
        motion[k, :2, k] -= np.array(local[k].elliptic_turn(*spans[k])) / elastic.width
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


def _responses(elastic: MeshingPair, touching: Touching, unit: list[tuple[Loads, Loads]]) -> tuple[Array, Array]:
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
    far = (seen.probes @ body.far.flank[seen.unknowns]) @ (body.far.driven[step][:, loaded.unknowns] @ loaded.probes[0])
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
