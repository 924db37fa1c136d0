r"""Equivalent radiated power: an estimate of the sound that a vibrating surface sends into air.

Each piece of the surface is taken to radiate like a piston in a plane wave (radiation efficiency 1). With the normal
velocity :math:`v_n` of the outer surface S and the impedance :math:`\rho c` of the air

.. math::
    P(t) = \rho c \int_S v_n^2\,dA = \rho c\; \dot q^T R\, \dot q , \qquad
    P(f) = \tfrac12 \rho c \int_S |\hat v_n|^2 dA = \tfrac12\rho c\; \hat{\dot q}^H R\, \hat{\dot q} ,

where R is the surface matrix of the reduced body (`gearfe.ModalBody.radiation`) and a hat marks complex amplitudes: no
field is needed. The constant and, with an even number of samples, the Nyquist line count twice, because their mean
square is the square of the amplitude. Without a window the lines therefore sum to the mean power. Levels are
:math:`10\lg(P/10^{-12}\,\mathrm W)` (ISO 3744). At low frequencies a surface radiates less than this: the estimate is
an upper one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...base.typing import Array

#: Impedance of air (Pa s/m) at 20 degrees Celsius, 101325 Pa: density (kg/m3) times speed of sound (m/s).
AIR_IMPEDANCE = 1.2041 * 343.21
#: Power of 0 dB (W), ISO 3744.
REFERENCE_POWER = 1e-12


@dataclass(frozen=True, eq=False)
class RadiatedPower:
    """Equivalent radiated power.

    Attributes
    ----------
    frequency : ndarray, shape (m,)
        Frequencies (Hz).
    power : ndarray, shape (m,)
        Power of each line (W).
    mean
        Mean of the power over the samples (W).
    """

    frequency: Array
    power: Array
    mean: float

    @property
    def level(self) -> Array:
        """(m,) levels of the lines (dB re 1e-12 W); minus infinity where nothing is radiated."""
        return power_level(self.power)

    @property
    def mean_level(self) -> float:
        """Level of the mean power (dB re 1e-12 W)."""
        return float(power_level(self.mean))


def power_level(power: ArrayLike) -> Array:
    """Level (dB re 1e-12 W) of a power (W)."""
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(np.asarray(power, dtype=float) / REFERENCE_POWER))


def instantaneous_power(radiation: Array, velocity: ArrayLike) -> Array:
    """Power (W) at each time: () or (n,).

    Parameters
    ----------
    radiation : (N, N)
        Surface matrix R (m4/s2 for unit rates): ``qdot^T R qdot`` is the integral of the squared normal velocity.
    velocity : (..., N)
        Rates of the body's coordinates.
    """
    v = np.asarray(velocity, dtype=float)
    return np.asarray(AIR_IMPEDANCE * np.einsum("...i,...i->...", v @ radiation, v))
