r"""Factors of general influence, ISO 6336-1:2006: dynamic factor, face load factors, transverse load factors.

**Dynamic factor**, clause 6, method B: see `gears.rating.dynamics`. The reduced mass of two discs without shafts is
:math:`m_{red} = 1/(1/m_1^* + 1/m_2^*)`, :math:`m^* = 4J^*/d_b^2` (30) to (32). :math:`J^*` is the moment of inertia per
width of a ring from the bore to the mean of tip and root circle. A gear whose torque p mates share, as planets at a
sun, counts with :math:`m^*/p`, and a ring that the casing holds does not count (6.4.7).

**Face load factors**, clause 7, method C:

.. math::
    F_{\beta x} = 1.33\,B_1 f_{sh} + B_2 f_{ma} \ge \max(0.005\,F_m/b,\ 0.5\,f_{H\beta}), \quad
    F_{\beta y} = F_{\beta x} - y_\beta,

(52), (55), (56), (43), with :math:`f_{sh}` by (57), and with :math:`q = F_{\beta y}c_{\gamma\beta}/(2F_m/b)`

.. math::
    K_{H\beta} = 1 + q \ (q < 1), \quad 2\sqrt{q} \ (q \ge 1), \qquad
    K_{F\beta} = K_{H\beta}^{N_F}, \quad N_F = \frac{1}{1 + h/b + (h/b)^2},

(39), (41), (69), (70), h/b at most 1/3.

**Transverse load factors**, clause 8, method B, with :math:`q_\alpha = c_{\gamma\alpha}(f - y_\alpha)/(F_{tH}/b)` and
f the larger of :math:`f_{pb}` and :math:`f_{f\alpha}`. The allowance :math:`y_\alpha` is that of :math:`f_{pb}` in
either case, as in the published rating of a helical stage in the tests:

.. math::
    K_\alpha = \tfrac{\varepsilon_\gamma}{2}(0.9 + 0.4\,q_\alpha) \ (\varepsilon_\gamma \le 2), \quad
    0.9 + 0.4\,q_\alpha\sqrt{2(\varepsilon_\gamma - 1)/\varepsilon_\gamma} \ (\varepsilon_\gamma > 2),

(71), (72), at least 1, at most :math:`\varepsilon_\gamma/(\varepsilon_\alpha Z_\varepsilon^2)` for the flank and
:math:`\varepsilon_\gamma/(0.25\,\varepsilon_\alpha + 0.75)` for the root (73), (74).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from . import materials
from .data import Load, PairData, Strength
from .dynamics import FAST, RESONANCE_END, factor_at, first_limit
from .ledger import cited
from .stiffness import blank_factor

_PART = "ISO 6336-1:2006"
#: Constants K' of Figure 13 with and without stiffening by the pinion.
FIGURE_13 = {"a": (0.48, 0.80), "b": (-0.48, -0.80), "c": (1.33, 1.33), "d": (-0.36, -0.60), "e": (-0.60, -1.00)}
#: Diameter of the pinion over that of its shaft from which it stiffens the shaft.
STIFFENING = 1.15
#: Constants B_1 and B_2 of Table 8.
TABLE_8 = {
    "none": (1.0, 1.0),
    "crowning": (1.0, 0.5),
    "crowning_of_load": (0.5, 0.5),
    "correction": (0.1, 1.0),
    "correction_and_crowning": (0.1, 0.5),
    "end_relief": (0.7, 0.7),
}
#: Accuracy grade from which on B_k = 1.
COARSE = 6


@dataclass(frozen=True)
class Influence:
    """Factors of general influence with what they are made of."""

    F_t_N: float = cited("nominal tangential load at the reference circle", f"{_PART}, 4.2", "N")
    v_m_per_s: float = cited("velocity of the reference circle", f"{_PART}, 4.2", "m/s")
    line_load_N_per_mm: float = cited("line load F_t K_A K_gamma/b", f"{_PART}, 6.4.3", "N/mm")
    K_A: float = cited("application factor", f"{_PART}, 5")
    K_gamma: float = cited("mesh load factor", f"{_PART}, 4.2.2")
    C_R: float = cited("gear blank factor", f"{_PART}, (84), (85)")
    c_prime_N_per_mm_um: float = cited("single stiffness c'", f"{_PART}, (80)", "N/(mm um)")
    c_gamma_alpha_N_per_mm_um: float = cited("mesh stiffness for K_v, K_alpha", f"{_PART}, (91)", "N/(mm um)")
    c_gamma_beta_N_per_mm_um: float = cited("mesh stiffness for K_beta", f"{_PART}, (92)", "N/(mm um)")
    f_pb_um: float = cited("base pitch deviation, the larger one", f"{_PART}, 6.4.3; ISO 1328-1", "um")
    f_falpha_um: float = cited("profile form deviation, the larger one", f"{_PART}, 6.4.3; ISO 1328-1", "um")
    y_p_um: float = cited("running-in allowance of the pitch", f"{_PART}, (18), (75) to (77)", "um")
    y_f_um: float = cited("running-in allowance of the profile", f"{_PART}, (19), (75) to (77)", "um")
    C_a_um: float = cited("tip relief, of design or of running-in", f"{_PART}, 6.4.3, Table 4", "um")
    B_p: float | None = cited("pitch deviation effect", f"{_PART}, (15)")
    B_f: float | None = cited("profile deviation effect", f"{_PART}, (16)")
    B_k: float | None = cited("tip relief effect", f"{_PART}, (17), footnote")
    m_red_kg_per_mm: float | None = cited("reduced mass per face width", f"{_PART}, (30)", "kg/mm")
    n_E1_per_min: float | None = cited("resonance speed of the pinion", f"{_PART}, (6)", "1/min")
    N: float | None = cited("resonance ratio", f"{_PART}, (9)")
    K_v: float = cited("dynamic factor", f"{_PART}, (14), (20) to (22)")
    f_sh_um: float | None = cited("misalignment by deflection", f"{_PART}, (57)", "um")
    f_ma_um: float | None = cited("misalignment of manufacture", f"{_PART}, 7.5.3", "um")
    F_betax_um: float | None = cited("initial equivalent misalignment", f"{_PART}, (52), (55), (56)", "um")
    y_beta_um: float | None = cited("running-in allowance of the misalignment", f"{_PART}, (44) to (48)", "um")
    F_betay_um: float | None = cited("effective equivalent misalignment", f"{_PART}, (43)", "um")
    K_Hbeta: float = cited("face load factor of the flank", f"{_PART}, (39), (41)")
    N_F: float = cited("exponent of K_Fbeta", f"{_PART}, (70)")
    K_Fbeta: float = cited("face load factor of the root", f"{_PART}, (69)")
    y_alpha_um: float = cited("running-in allowance of the base pitch", f"{_PART}, (75) to (77)", "um")
    K_Halpha: float = cited("transverse load factor of the flank", f"{_PART}, (71) to (73)")
    K_Falpha: float = cited("transverse load factor of the root", f"{_PART}, (71), (72), (74)")


def running_in(strength: Strength, deviation: float, v: float) -> float:
    """y_alpha (um) of a material for a deviation (um) at a velocity (m/s), (75) to (77)."""
    if strength.hardened:
        return min(0.075 * deviation, 3.0)
    if strength.material in materials.SOFT_IRON:
        limit = math.inf if v <= 5.0 else 22.0 if v <= 10.0 else 11.0
        return min(0.275 * deviation, limit)
    limit = math.inf if v <= 5.0 else 12_800.0 if v <= 10.0 else 6_400.0
    return min(160.0 * deviation, limit) / strength.sigma_H_lim


def running_in_beta(strength: Strength, misalignment: float, v: float) -> float:
    """y_beta (um) of a material for a misalignment F_betax (um) at a velocity (m/s), (44) to (48)."""
    if strength.hardened:
        return min(0.15 * misalignment, 6.0)
    if strength.material in materials.SOFT_IRON:
        limit = math.inf if v <= 5.0 else 45.0 if v <= 10.0 else 22.0
        return min(0.55 * misalignment, limit)
    limit = math.inf if v <= 5.0 else 25_600.0 if v <= 10.0 else 12_800.0
    return min(320.0 * misalignment / strength.sigma_H_lim, limit / strength.sigma_H_lim, misalignment)


def run_in_relief(sigma_H_lim: float) -> float:
    """C_ay (um) that running-in makes of a material, Table 4."""
    return (sigma_H_lim / 97.0 - 18.45) ** 2 / 18.0 + 1.5


def reduced_mass(
    pair: PairData,
    bores: tuple[float, float],
    density: tuple[float, float],
    mates: tuple[int, int],
    fixed: tuple[bool, bool] = (False, False),
) -> float:
    """Return the reduced mass per face width of two discs (kg/mm), (30) to (32), with shared torques by 6.4.7.

    Parameters
    ----------
    pair : PairData
        The gears.
    bores : (float, float)
        Bore diameters; outer diameter of the ring of an internal gear (mm).
    density : (float, float)
        Densities (kg/mm^3).
    mates : (int, int)
        Mates that share the torque of each gear.
    fixed : (bool, bool)
        Gears that the casing holds: their mass is infinite.
    """
    inverse = 0.0
    for i in (0, 1):
        if fixed[i]:
            continue
        mean = 0.5 * abs(pair.d_a[i] + pair.d_f[i])
        inertia = math.pi / 32.0 * density[i] * abs(mean**4 - bores[i] ** 4)
        inverse += mates[i] / (4.0 * inertia / pair.d_b[i] ** 2)
    return 1.0 / inverse


def deflection(pair: PairData, load: Load, mean_load: float) -> float:
    """f_sh (um) by (57) at a mean load F_m/b (N/mm); 0 for a shaft that is not described."""
    if load.shaft_misalignment is not None:
        return load.shaft_misalignment
    if load.bearing_span is None or load.shaft_diameter is None:
        return 0.0
    d1, ratio = pair.d[0], pair.d[0] / load.shaft_diameter
    constant = FIGURE_13[load.arrangement][0 if ratio >= STIFFENING else 1]
    bending = constant * load.bearing_span * load.pinion_offset / d1**2 * ratio**4
    return mean_load * 0.023 * (abs(1.0 + bending - 0.3) + 0.3) * (pair.b / d1) ** 2


def influence(
    pair: PairData,
    strengths: tuple[Strength, Strength],
    load: Load,
    *,
    torque: float,
    speed: float,
    single: float,
    bores: tuple[float, float],
    density: tuple[float, float],
    contact_factor: float,
) -> Influence:
    """Return the factors of general influence.

    Parameters
    ----------
    pair : PairData
        The gears.
    strengths : (Strength, Strength)
        Their strength and accuracy.
    load : Load
        What the user prescribes.
    torque, speed : float
        Torque (N m) that gear 1 has in this mesh, and its speed (1/min).
    single : float
        c' of solid discs under at least 100 N/mm (N/(mm um)).
    bores : (float, float)
        Bore diameters (mm).
    density : (float, float)
        Densities (kg/mm^3).
    contact_factor : float
        Z_eps, for the limit of K_Halpha.
    """
    one, two = strengths
    F_t = 2000.0 * torque / pair.d[0]
    v = math.pi * pair.d[0] * speed / 60_000.0
    line_load = F_t * load.application_factor * load.mesh_load_factor / pair.b
    C_R = load.blank_factor if load.blank_factor is not None else _blank(pair, strengths)
    c_prime = single * C_R * min(line_load / 100.0, 1.0) ** 0.25
    c_alpha = c_prime * (0.75 * pair.eps_alpha + 0.25)
    c_beta = 0.85 * c_alpha
    f_pb = max(s.f_pt for s in strengths) * math.cos(pair.alpha_t)
    f_falpha = max(s.f_falpha for s in strengths)
    y_p, y_f = (0.5 * sum(running_in(s, f, v) for s in strengths) for f in (f_pb, f_falpha))
    relief = _relief(strengths)

    effects: dict[str, float | None] = dict.fromkeys(("B_p", "B_f", "B_k", "m_red_kg_per_mm", "n_E1_per_min", "N"))
    K_v = load.dynamic_factor
    if K_v is None:
        B_k = 1.0 if max(s.quality for s in strengths) >= COARSE else abs(1.0 - c_prime * relief / line_load)
        B_p, B_f = c_prime * (f_pb - y_p) / line_load, c_prime * (f_falpha - y_f) / line_load
        mass = reduced_mass(pair, bores, density, (one.mates, two.mates), (one.fixed, two.fixed))
        n_E1 = 30_000.0 / (math.pi * pair.z[0]) * math.sqrt(c_alpha / mass)
        N = speed / n_E1
        K_v = max(1.0, float(factor_at(N, (B_p, B_f, B_k), pair.eps_gamma, line_load)))
        effects = {"B_p": B_p, "B_f": B_f, "B_k": B_k, "m_red_kg_per_mm": mass, "n_E1_per_min": n_E1, "N": N}

    mean_load = line_load * K_v
    parts: dict[str, float | None] = dict.fromkeys(("f_sh_um", "f_ma_um", "F_betax_um", "y_beta_um", "F_betay_um"))
    K_Hbeta = load.face_load_factor
    if K_Hbeta is None:
        B_1, B_2 = TABLE_8[load.helix_modification]
        f_sh = deflection(pair, load, mean_load)
        f_ma = math.hypot(one.f_Hbeta, two.f_Hbeta) if load.misalignment is None else load.misalignment
        least = max(0.005 * mean_load, 0.5 * max(one.f_Hbeta, two.f_Hbeta))
        F_x = max(1.33 * B_1 * f_sh + B_2 * f_ma, least)
        y_beta = 0.5 * sum(running_in_beta(s, F_x, v) for s in strengths)
        q = (F_x - y_beta) * c_beta / (2.0 * mean_load)
        K_Hbeta = 1.0 + q if q < 1.0 else 2.0 * math.sqrt(q)
        parts = {
            "f_sh_um": f_sh,
            "f_ma_um": f_ma,
            "F_betax_um": F_x,
            "y_beta_um": y_beta,
            "F_betay_um": F_x - y_beta,
        }
    height = max(0.5 * abs(pair.d_a[i] - pair.d_f[i]) for i in (0, 1))
    share = min(height / pair.b, 1.0 / 3.0)
    N_F = 1.0 / (1.0 + share + share**2)

    if load.transverse_load_factor is not None:
        K_Halpha = K_Falpha = load.transverse_load_factor
    else:
        q = c_alpha * (max(f_pb, f_falpha) - y_p) / (mean_load * K_Hbeta)
        gamma = pair.eps_gamma
        if gamma <= 2.0:
            K = 0.5 * gamma * (0.9 + 0.4 * q)
        else:
            K = 0.9 + 0.4 * math.sqrt(2.0 * (gamma - 1.0) / gamma) * q
        K_Halpha = max(1.0, min(K, gamma / (pair.eps_alpha * contact_factor**2)))
        K_Falpha = max(1.0, min(K, gamma / (0.25 * pair.eps_alpha + 0.75)))
    return Influence(
        F_t_N=F_t,
        v_m_per_s=v,
        line_load_N_per_mm=line_load,
        K_A=load.application_factor,
        K_gamma=load.mesh_load_factor,
        C_R=C_R,
        c_prime_N_per_mm_um=c_prime,
        c_gamma_alpha_N_per_mm_um=c_alpha,
        c_gamma_beta_N_per_mm_um=c_beta,
        f_pb_um=f_pb,
        f_falpha_um=f_falpha,
        y_p_um=y_p,
        y_f_um=y_f,
        C_a_um=relief,
        **effects,
        K_v=K_v,
        **parts,
        K_Hbeta=K_Hbeta,
        N_F=N_F,
        K_Fbeta=K_Hbeta**N_F,
        y_alpha_um=y_p,
        K_Halpha=K_Halpha,
        K_Falpha=K_Falpha,
    )


def _blank(pair: PairData, strengths: tuple[Strength, Strength]) -> float:
    """C_R of both gears, the mean."""
    factors = []
    for strength in strengths:
        if strength.web is None:
            factors.append(1.0)
        else:
            rim = math.inf if strength.rim is None else strength.rim
            factors.append(blank_factor(strength.web / pair.b, rim / pair.m_n))
    return 0.5 * sum(factors)


def _relief(strengths: tuple[Strength, Strength]) -> float:
    """C_a (um): the smaller design relief; where a gear has none, that of running-in, the mean of both (Table 4).

    Teeth come into contact at the tip of one gear and leave it at that of the other. A design relief of one tip alone
    leaves the other one as running-in makes it.
    """
    given = [s.C_a for s in strengths if s.C_a is not None]
    return min(given) if len(given) == 2 else 0.5 * sum(run_in_relief(s.sigma_H_lim) for s in strengths)


def design_reliefs(strengths: tuple[Strength, Strength]) -> tuple[float, float] | None:
    """Design relief of both gears (um), 0 for a gear without one; None if neither has any."""
    given = [s.C_a for s in strengths]
    return None if given == [None, None] else (given[0] or 0.0, given[1] or 0.0)


def speed_range(N: float | None, line_load: float) -> str:
    """Name of the speed range of a resonance ratio: subcritical, main resonance, intermediate, supercritical."""
    if N is None:
        return ""
    if first_limit(line_load) >= N:
        return "subcritical"
    return "main resonance" if N <= RESONANCE_END else "intermediate" if N < FAST else "supercritical"
