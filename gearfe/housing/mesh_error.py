r"""How far a mesh stiffens the natural frequencies, estimated from the jumps of stress between elements.

The stress of a mode, ``sigma_h``, jumps from element to element; its average at the nodes, ``sigma*``, is closer to the
truth. Zienkiewicz and Zhu (Int. J. Numer. Meth. Eng. 24, 1987) take the energy of the difference for the energy of the
error, and the error of an eigenvalue is the energy error of its mode (Strang, Fix, An Analysis of the Finite Element
Method, ch. 6):

.. math::
    \frac{\lambda_h - \lambda}{\lambda_h} \approx
    \frac{\int (\sigma^*-\sigma_h):C^{-1}:(\sigma^*-\sigma_h)}{\int \sigma_h:C^{-1}:\sigma_h},\qquad
    \frac{f_h - f}{f_h} \approx \frac12\,\frac{\lambda_h-\lambda}{\lambda_h} .

The averaged stress errs, too, most where stresses are singular and in walls that are one element thick: the plain
formula gives 0.6 to 1 of the true error on random housings, and 0.25 to 0.65 of it on clamped beams and plates
(docs/stress.md), so a factor `SAFETY` is put on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..solid import SolidMaterial, maps, node_gradients, shape_functions

#: Smallest volume ratio at a node, against the element's mean, at which its stress is used.
_SOUND = 0.02
#: Factor on the estimate that makes it cover the true error.
SAFETY = 8.0

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def frequency_errors(nodes: Floats, tets: Ints, material: SolidMaterial, fields: Floats) -> Floats:
    """Estimated relative errors (k,) of the frequencies of modes with nodal displacements `fields` (k, n, 3)."""
    a = tets.shape[1]
    gradients = node_gradients(a)  # (points, a, 3)
    det, inverse = maps(nodes, tets, gradients.transpose(1, 2, 0))
    phi, _, weights = shape_functions(a, 2)
    if det.shape[1] == 1:
        det, inverse = (np.repeat(values, a, axis=1) for values in (det, inverse))
        gradients = np.repeat(gradients, a, axis=0)
    # folded corners (see the mesh checks) have no stress to speak of: such elements take no part
    sound = (det.min(axis=1) > _SOUND * det.mean(axis=1))[:, None]
    det = np.where(sound, det, 0.0)
    share = np.bincount(tets.ravel(), weights=np.abs(det).ravel(), minlength=len(nodes))
    volume = weights * (np.abs(det) @ phi)
    errors = np.zeros(len(fields))
    for number, field in enumerate(fields):
        slope = np.einsum("eak,pam,epmj->epkj", field[tets], gradients, inverse, optimize=True)
        stress = _stress(slope, material)  # (m, points, 6)
        average = np.empty((len(nodes), 6))
        for part in range(6):
            weighted = (stress[..., part] * np.abs(det)).ravel()
            average[:, part] = np.bincount(tets.ravel(), weights=weighted, minlength=len(nodes)) / np.maximum(
                share, 1e-300
            )
        stress = np.where(sound[..., None], stress, 0.0)
        difference = np.einsum("eas,ap->eps", average[tets] - stress, phi)
        stress = np.einsum("eas,ap->eps", stress, phi)
        lost = float(np.sum(_energy(difference, material) * volume))
        errors[number] = SAFETY * 0.5 * lost / max(float(np.sum(_energy(stress, material) * volume)), 1e-300)
    return errors


def _stress(slope: Floats, material: SolidMaterial) -> Floats:
    """(..., 6) stress xx, yy, zz, yz, zx, xy (Pa) of displacement gradients (..., 3, 3)."""
    lam, mu = material.lame_lambda, material.shear_modulus
    trace = np.trace(slope, axis1=-2, axis2=-1)
    direct = [lam * trace + 2.0 * mu * slope[..., i, i] for i in range(3)]
    shear = [mu * (slope[..., i, j] + slope[..., j, i]) for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(direct + shear, axis=-1)


def _energy(stress: Floats, material: SolidMaterial) -> Floats:
    """Twice the energy density ``sigma : C^-1 : sigma`` (Pa)."""
    nu, e = material.poisson_ratio, material.youngs_modulus
    trace = stress[..., :3].sum(axis=-1)
    squares = (stress[..., :3] ** 2).sum(axis=-1) + 2.0 * (stress[..., 3:] ** 2).sum(axis=-1)
    return np.asarray(((1.0 + nu) * squares - nu * trace**2) / e)
