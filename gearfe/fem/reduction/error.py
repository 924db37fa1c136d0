r"""Estimate the errors of a reduced body: those of the reduction and of the mesh.

**Reduction.** With the bound of `gearfe.fem.reduction.craig_bampton` on the interfaces' dynamic stiffness,
``dD(w) <= E(w)``, follow

- natural frequencies with free attachments: ``d lambda_k <= v_b^T E(w_k) v_b``, v_b the attachment part of the mode of
  unit modal mass, so ``d f_k / f_k <= v_b^T E v_b / (2 w_k^2)``;
- the response of the attachments to forces on them: ``dH = H E H`` with ``H = D^-1``, compared with H over the band.

**Mesh.** A body with an estimate of its mesh error (`ModalBody.softening`) is compared with the softened body. Each
frequency is compared with that of the same number. The response is compared with those of several partly softened
bodies, because a resonance that passes a frequency first raises the response there and then lowers it.

Both errors make the body too stiff, so frequencies are too high; that of the mesh is much larger. Both bounds are
added: the reduction starts from the mesh, so only the sum bounds the whole error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, ComplexArray
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
class BodyError:
    """Estimated errors of a reduced body, by its mesh or by its reduction.

    Attributes
    ----------
    response
        Of the attachments' accelerations under forces on them, up to the end of a band: relative, rms over band and
        pairs.
    frequency_errors : (N,)
        Relative ones of the natural frequencies with free attachments; 0 for rigid-body modes. Infinite where there is
        no estimate. For the reduction that is beyond the first frequency that was left out. For the mesh it is above
        the highest mode kept, and where the estimate is as large as the stiffness itself: such a mesh (linear
        tetrahedra) is too coarse.
    """

    response: float
    frequency_errors: Array


def reduction_error(body: ModalBody, band_hz: float, *, points: int = 200) -> BodyError:
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
    own, shapes = body.coupled.frequencies_hz, _at_attachments(body)
    errors = np.zeros(len(own))
    omega = 2.0 * math.pi * own
    if len(shapes):  # else nothing outside sees the modes that are left out, and those that are kept are exact
        errors[own >= body.next_hz] = math.inf
        for k in np.flatnonzero(own < body.next_hz):
            energy = lost_stiffness(body, float(omega[k]), shapes[:, k : k + 1]).item()
            errors[k] = energy / max(2.0 * omega[k] ** 2, 1e-300)
    return BodyError(response_error(body, band_hz, points=points), errors)


def response_error(body: ModalBody, band_hz: float, *, points: int = 200) -> float:
    """Bound the relative error of a reduced body's response up to `band_hz`; arguments as those of `reduction_error`.

    It is that of the accelerations of the attachments' points under forces on them, rms over band and pairs.
    """
    shapes = _at_attachments(body)
    if not len(shapes):
        return 0.0
    if band_hz >= body.next_hz:
        return math.inf
    forces = shapes.reshape(-1, 6, body.size)[:, :3].reshape(-1, body.size)
    lost = total = 0.0
    for w, gain in zip(*_gains(body, band_hz, points), strict=True):
        response = (shapes * (gain / w**2)) @ forces.T
        lost += float(np.sum(np.abs(w**2 * lost_stiffness(body, float(w), response)) ** 2))
        total += float(np.sum(np.abs((forces * gain) @ forces.T) ** 2))
    return SAFETY * math.sqrt(lost / total) + EIGENSOLVER if lost else 0.0


def mesh_error(body: ModalBody, band_hz: float) -> BodyError:
    """Estimate the mesh's error of a reduced body up to `band_hz`; arguments as those of `reduction_error`."""
    bodies = [body, *(body.softened(part) for part in PARTS)]
    own, vectors = body.coupled.frequencies_hz, body.coupled.vectors
    soft = np.maximum(bodies[-1].coupled.frequencies_hz, 1e-300)
    lost = np.einsum("ik,ij,jk->k", vectors, body.softening, vectors, optimize=True)
    stiffness = (2.0 * math.pi * own) ** 2
    unknown = (own > 0.0) & ((lost == 0.0) | (lost >= stiffness) | (own > body.highest_hz))
    errors = np.where(unknown, math.inf, np.where(own > 0.0, own / soft - 1.0, 0.0))
    if np.any(unknown & (own <= band_hz)):
        return BodyError(math.inf, errors)
    direct, *softer = (accelerances(b, band_hz) for b in bodies)
    size = float(np.linalg.norm(direct))
    return BodyError(max(float(np.linalg.norm(h - direct)) for h in softer) / size if size else 0.0, errors)


def accelerances(body: ModalBody, band_hz: float, *, points: int = 200) -> ComplexArray:
    """Accelerations of all attachments' points for forces on them, (points, 3 a, 3 a) over a band (1/kg)."""
    shapes = _at_attachments(body).reshape(-1, 6, body.size)[:, :3].reshape(-1, body.size)
    return np.asarray((shapes * _gains(body, band_hz, points)[1][:, None, :]) @ shapes.T)


def _at_attachments(body: ModalBody) -> Array:
    """(6 a, N) the modes with free attachments in their coordinates."""
    return body.coupled.vectors[: 6 * len(body.attachment_names)]


def _gains(body: ModalBody, band_hz: float, points: int) -> tuple[Array, ComplexArray]:
    """Circular frequencies (points,) in a band, and accelerations (points, N) of the modes for unit modal forces.

    Raises
    ------
    InputError
        For a band that is none.
    """
    if not band_hz > 0.0:
        raise InputError("band_hz", band_hz, "must be > 0", "give a frequency in Hz")
    own = 2.0 * math.pi * body.coupled.frequencies_hz
    omega = 2.0 * math.pi * band_hz * (np.arange(points) + 0.5) / points
    square = omega[:, None] ** 2
    return omega, np.asarray(square / (own**2 - square + 2j * RATIO * own * omega[:, None]), dtype=complex)


def lost_stiffness(body: ModalBody, omega: float, shapes: ComplexArray | Array) -> Any:
    """``x^T E y`` of the bound ``dD <= E`` at a circular frequency (rad/s), x and y columns of `shapes` (6 a, p)."""
    if math.isinf(body.next_hz):
        return np.zeros((shapes.shape[1],) * 2)
    left = 1.0 - (omega / (2.0 * math.pi * body.next_hz)) ** 2
    if body.corrections == 0:
        return omega**4 / left * (shapes.T @ body.truncation @ shapes)
    m = len(shapes)
    weights = (body.mass[m:, :m] @ shapes) / (np.diag(body.stiffness)[m:, None] - omega**2)
    return omega**8 / left * (weights.T @ body.truncation @ weights)
