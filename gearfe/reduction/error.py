r"""How far a reduced body is from the housing: what the reduction leaves out, and what the mesh does.

**Reduction.** With the bound of `gearfe.reduction.craig_bampton` on the interfaces' dynamic stiffness,
``dD(w) <= E(w)``, follow

- natural frequencies with free attachments: ``d lambda_k <= v_b^T E(w_k) v_b``, v_b the attachment part of the mode of
  unit modal mass, so ``d f_k / f_k <= v_b^T E v_b / (2 w_k^2)``;
- the response of the attachments to forces on them: ``dH = H E H`` with ``H = D^-1``, compared with H over the band.

**Mesh.** The body that carries an estimate of its mesh's error (`ModalBody.softening`) is compared with the body
softened by it: each frequency with that of the same number, and the response with those of several parts of the way,
because a resonance that moves past a frequency raises the response there before it lowers it.

Both stiffen, so frequencies err towards too high; the mesh by far the more. Joined they are added: the body that is
reduced is the mesh's, so the errors follow each other, and of two bounds only the sum is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..typing import Array, ComplexArray
from .modal_body import ModalBody

#: The response is bounded to first order: on random housings the bare figure was 0.97 to 1.15 times the true error.
SAFETY = 1.5
#: What the eigensolver leaves of the modes that are kept; it matters where next to nothing is left out.
EIGENSOLVER = 1e-6
#: Modal damping ratio of the responses.
RATIO = 0.01
#: Parts of the way to the softest body, all of it last.
PARTS = (0.25, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class ReductionError:
    """Bounds on what the left-out modes do in a band.

    Attributes
    ----------
    band_hz
        Upper end of the band (Hz).
    response
        Estimated error of the attachments' accelerations under forces on them: relative, rms over band and pairs.
    frequencies_hz : (k,)
        Natural frequencies within the band, attachments free (Hz).
    frequency_errors : (k,)
        Relative errors of these.
    """

    band_hz: float
    response: float
    frequencies_hz: Array
    frequency_errors: Array


def reduction_error(body: ModalBody, band_hz: float, *, points: int = 200) -> ReductionError:
    """Bound the error of a reduced body up to `band_hz`.

    Parameters
    ----------
    body
        The reduced body; its own damping is not used.
    band_hz
        Upper end of the band (Hz); it must lie below the first frequency that was left out.
    points
        Number of frequencies, evenly spaced in the band.
    """
    if not band_hz > 0.0:
        raise InputError("band_hz", band_hz, "must be > 0", "give a frequency in Hz")
    coupled = body.coupled
    inside = coupled.frequencies_hz <= band_hz
    own = coupled.frequencies_hz[inside]
    m = 6 * len(body.attachment_names)
    if not m:  # nothing outside sees the modes that are left out, and those that are kept are exact
        return ReductionError(band_hz, 0.0, own, np.zeros(len(own)))
    if band_hz >= body.next_hz:
        return ReductionError(band_hz, math.inf, own, np.full(len(own), math.inf))
    shapes = coupled.vectors[:m]
    omega = 2.0 * math.pi * own
    energy = np.array([v @ lost_stiffness(body, w) @ v for v, w in zip(shapes[:, inside].T, omega, strict=True)])
    errors = energy / np.maximum(2.0 * omega**2, 1e-300)
    forces = shapes.reshape(-1, 6, body.size)[:, :3].reshape(-1, body.size)
    lost = total = 0.0
    all_omega = 2.0 * math.pi * coupled.frequencies_hz
    for w in 2.0 * math.pi * band_hz * (np.arange(points) + 0.5) / points:
        gain = w**2 / (all_omega**2 - w**2 + 2j * RATIO * all_omega * w)
        response = (shapes * gain) @ forces.T
        direct = (forces * gain) @ forces.T
        change = (response.T @ lost_stiffness(body, float(w)) @ response) / w**2
        lost += float(np.sum(np.abs(change) ** 2))
        total += float(np.sum(np.abs(direct) ** 2))
    response = SAFETY * math.sqrt(lost / total) + EIGENSOLVER if lost else 0.0
    return ReductionError(band_hz, response, own, errors)


@dataclass(frozen=True, eq=False)
class MeshError:
    """Estimates of what the mesh does to a body.

    Attributes
    ----------
    band_hz
        Upper end of the band (Hz).
    response
        Estimated error of the attachments' accelerations under forces on them: relative, rms over band and pairs.
    frequency_errors : (N,)
        Relative errors of the natural frequencies with free attachments; 0 for rigid-body modes. Infinite above the
        highest mode that was kept, where the mesh's error is not estimated, and where the estimate is as large as the
        stiffness itself: such a mesh (linear tetrahedra) is too coarse for an error estimate.
    """

    band_hz: float
    response: float
    frequency_errors: Array


def mesh_error(body: ModalBody, band_hz: float) -> MeshError:
    """Estimate the mesh's error of a reduced body up to `band_hz`; arguments as those of `reduction_error`."""
    if not band_hz > 0.0:
        raise InputError("band_hz", band_hz, "must be > 0", "give a frequency in Hz")
    bodies = [body, *(body.softened(part) for part in PARTS)]
    own, vectors = body.coupled.frequencies_hz, body.coupled.vectors
    soft = np.maximum(bodies[-1].coupled.frequencies_hz, 1e-300)
    lost = np.einsum("ik,ij,jk->k", vectors, body.softening, vectors, optimize=True)
    stiffness = (2.0 * math.pi * own) ** 2
    unknown = (own > 0.0) & ((lost == 0.0) | (lost >= stiffness) | (own > body.highest_hz))
    errors = np.where(unknown, math.inf, np.where(own > 0.0, own / soft - 1.0, 0.0))
    if np.any(unknown & (own <= band_hz)):
        return MeshError(band_hz, math.inf, errors)
    direct, *softer = (accelerances(b, band_hz) for b in bodies)
    size = float(np.linalg.norm(direct))
    response = max(float(np.linalg.norm(h - direct)) for h in softer) / size if size else 0.0
    return MeshError(band_hz, response, errors)


def accelerances(body: ModalBody, band_hz: float, *, points: int = 200) -> ComplexArray:
    """Accelerations of all attachments' points for forces on them, (points, 3 a, 3 a) over a band (1/kg)."""
    m = 6 * len(body.attachment_names)
    coupled = body.coupled
    shapes = coupled.vectors[:m].reshape(-1, 6, body.size)[:, :3].reshape(-1, body.size)
    own = 2.0 * math.pi * coupled.frequencies_hz
    omega = 2.0 * math.pi * band_hz * (np.arange(points) + 0.5) / points
    gains = omega[:, None] ** 2 / (own**2 - omega[:, None] ** 2 + 2j * RATIO * own * omega[:, None])
    return np.asarray((shapes * gains[:, None, :]) @ shapes.T)


def lost_stiffness(body: ModalBody, omega: float) -> Array:
    """E of the bound ``dD <= E`` at a circular frequency (rad/s), over the attachments' coordinates, (6 a, 6 a)."""
    m = 6 * len(body.attachment_names)
    if math.isinf(body.next_hz):
        return np.zeros((m, m))
    left = 1.0 - (omega / (2.0 * math.pi * body.next_hz)) ** 2
    if body.corrections == 0:
        return np.asarray(omega**4 / left * body.truncation)
    weights = body.mass[m:, :m] / (np.diag(body.stiffness)[m:, None] - omega**2)
    return np.asarray(omega**8 / left * (weights.T @ body.truncation @ weights))
