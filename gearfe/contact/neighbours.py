r"""What contacts of one tooth pair do to each other through the surfaces that they share.

Two contacts i and j on the same two teeth have, besides the smooth influence H (`.flank_compliance`), the half-plane
and the wedge between them. A load :math:`f_j n_j` at the arc t moves the face at s by

.. math:: u(s) = -\tfrac1{E'}\Big(\tfrac2\pi\ln|s-t|\,n_j + W n_j\ln(y(s)+y(t))\Big) f_j .

Its part along :math:`n_i` acts between the panels of both (exactly integrated over each, so that two windows may lie
side by side); its part across moves the face as a whole.

The bumps' and the contacts' own widths enter H between two contacts as they do within one: with the variances v of the
pressures and a^2/4 of the bumps, :math:`\tfrac12(v_i-\tfrac14a_i^2)\,\partial_{ss}H
+\tfrac12(v_j-\tfrac14a_j^2)\,\partial_{tt}H`, here along the normals.

Arrays are over the q couples of `.panels.Couplings.neighbours`, then over pinion and wheel.
"""

from __future__ import annotations

import numpy as np

from ..typing import Array, ComplexArray
from .half_plane_pair import HalfPlanePair
from .panels import Couplings
from .wedge import log_integral, mean_log

#: Distance (m) of two contacts that is none.
LEAST_DISTANCE = 1e-9


def sideways(law: HalfPlanePair, couples: Couplings, normal: ComplexArray, arc: Array, y: Array) -> ComplexArray:
    """Displacement of the faces at the first contact across its normal, by a unit force per width along the normal of
    the second, shape (q, 2), tooth axes (m2/N).

    Parameters
    ----------
    normal : ndarray of complex, shape (p, 2)
        n in the teeth's axes.
    arc, y : ndarray, shape (p, 2)
        Arcs of the contacts and their distances from the corners (m).
    """
    i, j = couples.first[couples.neighbours], couples.second[couples.neighbours]
    tension, shear = law.wedge
    apart = np.maximum(np.abs(arc[i] - arc[j]), LEAST_DISTANCE)
    wedge = (tension * normal[j] + shear * normal[j].conj()) * np.log(y[i] + y[j])
    moved = -law.inverse_modulus * (2 / np.pi * np.log(apart) * normal[j] + wedge)
    return np.asarray(1j * normal[i] * (moved * normal[i].conj()).imag)


def panel_influence(
    law: HalfPlanePair, couples: Couplings, normal: ComplexArray, arcs: Array, widths: Array, y: Array
) -> Array:
    """Displacement of each face into its material at the first contact's panels, for pressures on the second's,
    shape (q, 2, n, n) (m/Pa).

    Parameters
    ----------
    arcs, y : ndarray, shape (p, 2, n)
        Arcs of the panels' middles and their distances from the corners (m).
    widths : ndarray, shape (p, n)
        Of the panels (m).
    """
    i, j = couples.first[couples.neighbours], couples.second[couples.neighbours]
    if len(i) == 0:
        return np.zeros((0, 2, arcs.shape[2], arcs.shape[2]))
    tension, shear = law.wedge
    turned = normal[i] * normal[j].conj()
    half = 0.5 * widths[j][:, None, None, :]
    apart = arcs[i][..., None] - arcs[j][:, :, None]
    plane = (2 / np.pi * turned.real)[..., None, None] * (log_integral(apart + half) - log_integral(apart - half))
    across = tension * turned.real + (shear * (normal[i] * normal[j]).conj()).real
    wedge = across[..., None, None] * np.log(y[i][..., None] + y[j][:, :, None]) * (2 * half)
    return np.asarray(-law.inverse_modulus[:, None, None] * (plane + wedge))


def opened(
    law: HalfPlanePair, couples: Couplings, normal: ComplexArray, contacts: tuple[Array, Array, Array], arcs: Array
) -> Array:
    """How far the half-planes' displacements by the other contacts of the pair open the gap at arcs (m) of the faces of
    each contact, shape (p, 2, n) (m): under elliptic pressures.

    Parameters
    ----------
    contacts
        Arcs (m), shape (p, 2), forces per width (N/m) and variances of the pressures (m2), shape (p,).
    """
    arc, force, spread = contacts
    i, j = couples.first[couples.neighbours], couples.second[couples.neighbours]
    half = np.maximum(2 * np.sqrt(spread[j]), LEAST_DISTANCE)[:, None, None]
    turned = (normal[i] * normal[j].conj()).real * law.inverse_modulus * force[j][:, None]
    made = np.zeros((len(arcs), arcs.shape[2]))
    far = mean_log(arcs[i] - arc[j][:, :, None], half) * turned[:, :, None]
    np.add.at(made, i, -2 / np.pi * far.sum(axis=1))
    return made


def widths_in_smooth(couples: Couplings, normal: ComplexArray, bends: ComplexArray, excess: Array) -> Array:
    """What the widths add to the displacement of the first contact's faces along n by a unit force per width on the
    second, shape (q, 2) (m2/N).

    Parameters
    ----------
    bends : ndarray of complex, shape (c, 2)
        Curvature of the displacement of each couple's first face, `Smooth.moved`.
    excess : ndarray, shape (p, 2)
        Variance of the pressure less that of the bumps (m2).
    """
    there = couples.neighbours
    i, j = couples.first[there], couples.second[there]
    back = couples.couple(j, i)
    at_first = excess[i] * (bends[there] * normal[i].conj()).real
    at_second = excess[j] * (bends[back] * normal[j].conj()).real
    return np.asarray(0.5 * (at_first + at_second))
