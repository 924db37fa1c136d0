r"""What a reduced body leaves out, bounded without the full model.

With the bound of `gearfe.reduction.craig_bampton` on the interfaces' dynamic stiffness, ``dD(w) <= e(w) S``, follow

- natural frequencies with free attachments: ``d lambda_k <= v_b^T dD(w_k) v_b``, v_b the attachment part of the mode of
  unit modal mass, so ``d f_k / f_k <= v_b^T dD v_b / (2 w_k^2)``;
- the response of the attachments to forces on them: ``dH = H dD H`` with ``H = D^-1``, compared with H over the band.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .modal_body import ModalBody

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReductionError:
    """Bounds on what the left-out modes do in a band.

    Attributes
    ----------
    band_hz
        Upper end of the band (Hz).
    response
        Error of the attachments' accelerations under forces on them, relative, rms over the band and all pairs.
    frequencies_hz : (k,)
        Natural frequencies within the band, attachments free (Hz).
    frequency_errors : (k,)
        Relative errors of these.
    """

    band_hz: float
    response: float
    frequencies_hz: Floats
    frequency_errors: Floats


def reduction_error(body: ModalBody, band_hz: float, *, ratio: float = 0.01, points: int = 200) -> ReductionError:
    """Bound the error of a reduced body up to `band_hz`.

    Parameters
    ----------
    body
        The reduced body; its own damping is not used.
    band_hz
        Upper end of the band (Hz); it must lie below the first frequency that was left out.
    ratio
        Modal damping ratio for the response.
    points
        Number of frequencies, evenly spaced in the band.
    """
    if not band_hz > 0.0:
        raise InputError("band_hz", band_hz, "must be > 0", "give a frequency in Hz")
    coupled = body.coupled
    inside = coupled.frequencies_hz <= band_hz
    own = coupled.frequencies_hz[inside]
    m = 6 * len(body.attachment_names)
    if band_hz >= body.next_hz:
        return ReductionError(band_hz, math.inf, own, np.full(len(own), math.inf))
    shapes = coupled.vectors[:m]
    omega = 2.0 * math.pi * own
    energy = np.einsum("ik,ij,jk->k", shapes[:, inside], body.tail, shapes[:, inside])
    errors = np.array([_factor(w, body) for w in omega]) * energy / np.maximum(2.0 * omega**2, 1e-300)
    forces = shapes.reshape(-1, 6, body.size)[:, :3].reshape(-1, body.size)
    lost = total = 0.0
    all_omega = 2.0 * math.pi * coupled.frequencies_hz
    for w in 2.0 * math.pi * band_hz * (np.arange(points) + 0.5) / points:
        gain = w**2 / (all_omega**2 - w**2 + 2j * ratio * all_omega * w)
        response = (shapes * gain) @ forces.T
        direct = (forces * gain) @ forces.T
        change = (response.T @ body.tail @ response) * (_factor(float(w), body) / w**2)
        lost += float(np.sum(np.abs(change) ** 2))
        total += float(np.sum(np.abs(direct) ** 2))
    return ReductionError(band_hz, math.sqrt(lost / total) if total else 0.0, own, errors)


def _factor(omega: float, body: ModalBody) -> float:
    """e(w) of the bound ``dD <= e(w) S``."""
    following = (2.0 * math.pi * body.next_hz) ** 2
    if math.isinf(following):
        return 0.0
    if body.levels == 0:
        return omega**4 * following / (following - omega**2)
    return float(omega ** (4 * body.levels + 4) / (following - omega**2))
