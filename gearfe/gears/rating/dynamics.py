r"""Dynamic factor by ISO 6336-1:2006, clause 6, method B.

With :math:`N = n_1/n_{E1}` (9), :math:`n_{E1}` the speed at which teeth mesh as often as
:math:`\sqrt{c_{\gamma\alpha}/m_{red}}` swings (6),

.. math::
    B_p = \frac{c' f_{pb,eff}}{K_A F_t/b},\quad B_f = \frac{c' f_{f\alpha,eff}}{K_A F_t/b},\quad
    B_k = \Big|1 - \frac{c' C_a}{K_A F_t/b}\Big|

(15) to (17), and with the coefficients :math:`C_v` of the table of 6.5.4

.. math::
    K_v = \begin{cases}
    1 + N\,(C_{v1}B_p + C_{v2}B_f + C_{v3}B_k) & N \le N_S\\
    1 + C_{v1}B_p + C_{v2}B_f + C_{v4}B_k & N_S < N \le 1.15\\
    C_{v5}B_p + C_{v6}B_f + C_{v7} & N \ge 1.5
    \end{cases}

(13), (14), (20), (21) and straight between 1.15 and 1.5 (22); :math:`N_S` is 0.85, less below 100 N/mm (11), (12).
Gears of grade 6 and coarser have :math:`B_k = 1` (6.4.3, footnote).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ...base.typing import Array
from ..geometry.mesh_geometry import MeshGeometry

#: Ends of the main resonance and of the intermediate range, in resonance ratios.
RESONANCE_END, FAST = 1.15, 1.5


def coefficients(ratio: float) -> tuple[float, float, float, float, float, float, float]:
    """C_v1 to C_v7 of a total contact ratio eps_gamma."""
    seven = 0.125 * math.sin(math.pi * (min(max(ratio, 1.5), 2.5) - 2.0)) + 0.875
    if ratio <= 2.0:
        return 0.32, 0.34, 0.23, 0.90, 0.47, 0.47, seven
    return (
        0.32,
        0.57 / (ratio - 0.3),
        0.096 / (ratio - 1.56),
        (0.57 - 0.05 * ratio) / (ratio - 1.44),
        0.47,
        0.12 / (ratio - 1.74),
        seven,
    )


def first_limit(line_load: float) -> float:
    """N_S, where the main resonance begins, of a line load F_t K_A/b (N/mm), (11) and (12)."""
    return 0.85 if line_load >= 100.0 else 0.5 + 0.35 * math.sqrt(line_load / 100.0)


def factor_at(N: ArrayLike, deviations: tuple[float, float, float], ratio: float, line_load: float) -> Array:
    """Return K_v at resonance ratios.

    Parameters
    ----------
    N : array_like, shape (n,)
        Resonance ratios.
    deviations
        B_p, B_f, B_k.
    ratio : float
        Total contact ratio.
    line_load : float
        F_t K_A/b (N/mm).
    """
    N, (p, f, k) = np.asarray(N, dtype=float), deviations
    v1, v2, v3, v4, v5, v6, v7 = coefficients(ratio)
    whole = v1 * p + v2 * f
    resonant, fast = 1.0 + whole + v4 * k, v5 * p + v6 * f + v7
    later = fast + (resonant - fast) * np.clip((FAST - N) / (FAST - RESONANCE_END), 0.0, 1.0)
    return np.where(N <= first_limit(line_load), 1.0 + N * (whole + v3 * k), later)


def dynamic_factor(
    pair: MeshGeometry, speeds: ArrayLike, *, stiffness: float, mass: float, force: float, relief: float = 0.0,
    deviations: tuple[float, float] = (0.0, 0.0),
) -> Array:  # fmt: skip
    """Compute K_v of a spur pair at speeds of its pinion from a mesh stiffness and a mass that are known.

    Parameters
    ----------
    pair : MeshGeometry
        The gears.
    speeds : array_like, shape (n,)
        rad/s.
    stiffness
        Mean stiffness of the mesh, c_gamma b (N/m).
    mass
        Reduced mass of pinion and wheel, and of what turns with them, on the line of action (kg).
    force
        Along the line of action, K_A included (N).
    relief, deviations
        C_a; effective deviations of pitch and profile, f_pb,eff and f_falpha,eff (m).
    """
    pitch, profile = deviations
    N = np.abs(np.asarray(speeds, dtype=float)) * abs(pair.pinion.teeth) / math.sqrt(stiffness / mass)
    ratio, width = pair.contact_ratio, min(pair.pinion.face_width, pair.wheel.face_width)
    load = force * math.cos(pair.pinion.transverse_pressure_angle) / width
    single = stiffness / width / (0.75 * ratio + 0.25)
    of_load = single * pitch / load, single * profile / load, abs(1.0 - single * relief / load)
    return factor_at(N, of_load, ratio, 1e-3 * load)
