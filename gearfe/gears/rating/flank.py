r"""Surface durability (pitting), ISO 6336-2:2006, with what the edition of 2019 changes.

.. math::
    \sigma_{H0} = Z_H Z_E Z_\varepsilon Z_\beta\sqrt{\frac{F_t}{d_1 b}\frac{u + 1}{u}}, \quad
    \sigma_{H1,2} = Z_{B,D}\,\sigma_{H0}\sqrt{K_A K_\gamma K_v K_{H\beta} K_{H\alpha}}, \\
    \sigma_{HG} = \sigma_{H\,lim} Z_{NT} Z_L Z_v Z_R Z_W Z_X, \quad S_H = \sigma_{HG}/\sigma_H.

**Single pair contact factors**, clause 6: :math:`Z_B = \max(1, M_1)`, :math:`Z_D = \max(1, M_2)` for spur gears, with
:math:`M` by (17), (18). For helical gears with :math:`\varepsilon_\beta \ge 1` the edition of 2006 has 1, that of 2019
:math:`\sqrt{f_{ZCa}}`. In between, both editions interpolate over :math:`\varepsilon_\beta`. :math:`f_{ZCa}` is 1 for
modifications that a load distribution has proven, and 1.2 without modifications.

**Contact ratios from 2 to 2.5**: :math:`M_{1,2}` are those of the inner points of double pair contact, and
:math:`Z_\varepsilon` is unchanged. Its square is 1/2 at 2.5, the share of each of two pairs, and larger below: this
choice of the program is on the safe side.

**Helix angle factor**: :math:`Z_\beta = 1/\sqrt{\cos\beta}`, as ISO 6336-2:2006/Cor 1:2008 and the edition of 2019 have
it; the text of 2006 had the reciprocal.

**Work hardening factor**, clause 13: of the wheel; the pinion has at most 1.

**Static load**: :math:`Z_L = Z_v = Z_R = 1` (5.4), and Z_W of a through-hardened wheel with a surface-hardened pinion
:math:`1.05 - (HB - 130)/6800`, HB from 130 to 470, else 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ...base.errors import InputError
from .data import Load, PairData, Strength
from .ledger import cited
from .life import FatigueCurve, flank_life
from .load_factors import Influence

_PART = "ISO 6336-2:2006"
_PAIR = tuple[float, float]
#: Transverse contact ratio from which on two pairs always touch, and the largest one of ISO 6336-1, 1.
TWO_PAIRS, HIGHEST_RATIO = 2.0, 2.5
#: K_Hbeta from which on the load is on a part of the width, ISO 6336-1, (39).
NOTABLE = 2.0


@dataclass(frozen=True)
class Flank:
    """Stresses, strength and safety against pitting, of gear 1 and gear 2."""

    Z_H: float = cited("zone factor", f"{_PART}, 6.1")
    Z_E: float = cited("elasticity factor", f"{_PART}, (19)", "sqrt(N/mm2)")
    Z_eps: float = cited("contact ratio factor", f"{_PART}, 8")
    Z_beta: float = cited("helix angle factor", f"{_PART}/Cor 1:2008, 9; 2019, 9")
    M: _PAIR = cited("auxiliary factors M_1, M_2", f"{_PART}, (17), (18)")
    Z_BD: _PAIR = cited("single pair contact factors Z_B, Z_D", f"{_PART}, 6.2; 2019, 6.2")
    rho_red_mm: float = cited("radius of relative curvature at the pitch point", f"{_PART}, (46), (47)", "mm")
    sigma_H0_MPa: float = cited("nominal contact stress at the pitch point", f"{_PART}, 5.2", "MPa")
    sigma_H_MPa: _PAIR = cited("contact stress", f"{_PART}, 5.2", "MPa")
    sigma_H_lim_MPa: _PAIR = cited("allowable stress number", "ISO 6336-5:2016, Table 1", "MPa")
    N_L: _PAIR = cited("number of load cycles", f"{_PART}, 11")
    Z_NT: _PAIR = cited("life factor", f"{_PART}, Table 2")
    C_ZL: float = cited("constant of the lubricant factor", f"{_PART}, (38) to (40)")
    Z_L: float = cited("lubricant factor", f"{_PART}, (37)")
    Z_v: float = cited("velocity factor", f"{_PART}, (42), (43)")
    R_z10_um: float = cited("mean relative roughness", f"{_PART}, (44), (45)", "um")
    Z_R: float = cited("roughness factor", f"{_PART}, (48) to (51)")
    Z_W: _PAIR = cited("work hardening factor", f"{_PART}, 13")
    Z_X: _PAIR = cited("size factor", f"{_PART}, 14")
    sigma_HG_MPa: _PAIR = cited("pitting stress limit", f"{_PART}, 5.4", "MPa")
    sigma_HP_MPa: _PAIR = cited("permissible contact stress", f"{_PART}, 5.4", "MPa")
    S_H: _PAIR = cited("safety factor against pitting", f"{_PART}, 5.1")
    curves: tuple[FatigueCurve, FatigueCurve] = field(kw_only=True)


def zone_factor(pair: PairData) -> float:
    """Z_H, 6.1."""
    return math.sqrt(2.0 * math.cos(pair.beta_b) / math.tan(pair.alpha_wt)) / math.cos(pair.alpha_t)


def elasticity_factor(modulus: _PAIR, poisson: _PAIR) -> float:
    """Z_E (sqrt(N/mm^2)) of Young's moduli (N/mm^2) and Poisson's ratios, (19)."""
    return math.sqrt(1.0 / (math.pi * sum((1.0 - nu**2) / E for E, nu in zip(modulus, poisson, strict=True))))


def contact_ratio_factor(pair: PairData) -> float:
    """Z_eps, clause 8."""
    of_spur, share = (4.0 - pair.eps_alpha) / 3.0, min(pair.eps_beta, 1.0)
    return math.sqrt(of_spur * (1.0 - share) + share / pair.eps_alpha)


def auxiliary_factors(pair: PairData) -> _PAIR:
    """M_1 and M_2, (17) and (18): signed tooth numbers give those of internal gears.

    From a contact ratio of 2 on they are those of the inner points of double pair contact. These are two base pitches
    from the end of contact instead of one.
    """
    tips = [math.sqrt((a / b) ** 2 - 1.0) for a, b in zip(pair.d_a, pair.d_b, strict=True)]
    steps = [2.0 * math.pi / z for z in pair.z]
    pitches = 1.0 if pair.eps_alpha < TWO_PAIRS else 2.0

    def of(i: int, j: int) -> float:
        product = (tips[i] - pitches * steps[i]) * (tips[j] - (pair.eps_alpha - pitches) * steps[j])
        return math.tan(pair.alpha_wt) / math.sqrt(product) if product > 0.0 else math.inf

    return of(0, 1), of(1, 0)


def single_pair_factors(pair: PairData, edition: int, relief: float) -> _PAIR:
    """Z_B and Z_D, 6.2; `relief`: f_ZCa of the edition of 2019."""
    share = min(pair.eps_beta, 1.0)
    helical = math.sqrt(relief) if edition == 2019 else 1.0
    made = [max(1.0, M) if not share else max(1.0, M - share * (M - helical)) for M in auxiliary_factors(pair)]
    if pair.z[1] < 0:
        made[1] = helical if share >= 1.0 else 1.0
    return made[0], made[1]


def lubricant_constants(sigma: float) -> tuple[float, float]:
    """C_ZL and C_ZR of the allowable stress number of the softer gear (N/mm^2), (38) to (40), (49) to (51)."""
    if sigma < 850.0:
        return 0.83, 0.15
    return (0.91, 0.08) if sigma > 1200.0 else (sigma / 4375.0 + 0.6357, 0.32 - 0.0002 * sigma)


def work_hardening(strength: Strength, mate: Strength, u: float, v: float, rho_red: float, viscosity: float) -> float:
    """Return Z_W of a gear, clause 13.

    Parameters
    ----------
    strength, mate : Strength
        Of the gear, and of its mate.
    u : float
        Gear ratio, at least 1.
    v : float
        Velocity of the reference circle (m/s).
    rho_red : float
        Radius of relative curvature (mm).
    viscosity : float
        At 40 C (mm^2/s).
    """
    if strength.hardened or strength.brinell is None:
        return 1.0
    if mate.hardened:
        equivalent = mate.flank_roughness * (10.0 / rho_red) ** 0.33
        equivalent *= (mate.flank_roughness / strength.flank_roughness) ** 0.66 / (viscosity * v / 1500.0) ** 0.33
        rough = (3.0 / min(max(equivalent, 3.0), 16.0)) ** 0.15
        return (1.2 - (min(max(strength.brinell, 130.0), 470.0) - 130.0) / 1700.0) * rough
    if mate.brinell is None:
        return 1.0
    ratio = min(mate.brinell / strength.brinell, 1.7)
    if ratio < 1.2:
        return 1.0
    return 1.0 + (0.00898 * ratio - 0.00829) * (min(u, 20.0) - 1.0)


def static_work_hardening(strength: Strength, mate: Strength) -> float:
    """Z_W of a gear for static load, clause 13."""
    if strength.hardened or strength.brinell is None or not mate.hardened:
        return 1.0
    return 1.05 - (min(max(strength.brinell, 130.0), 470.0) - 130.0) / 6800.0


def flank(
    pair: PairData,
    strengths: tuple[Strength, Strength],
    load: Load,
    general: Influence,
    *,
    edition: int,
    modulus: _PAIR,
    poisson: _PAIR,
    cycles: _PAIR,
) -> Flank:
    """Return stresses, strength and safety against pitting.

    Parameters
    ----------
    pair : PairData
        The gears.
    strengths : (Strength, Strength)
        Their strength.
    load : Load
        Load and lubricant.
    general : Influence
        Factors of general influence.
    edition : int
        2006 or 2019.
    modulus, poisson : (float, float)
        Young's moduli (N/mm^2) and Poisson's ratios.
    cycles : (float, float)
        Numbers of load cycles.

    Raises
    ------
    InputError
        For a transverse contact ratio above 2.5, which the standard excludes.
    """
    if pair.eps_alpha > HIGHEST_RATIO:
        problem = f"is {pair.eps_alpha:.4g}: must be <= {HIGHEST_RATIO:g}, the range of ISO 6336-1"
        raise InputError("contact ratio", None, problem, "use a smaller addendum or a larger pressure angle")
    Z_H, Z_E, Z_eps = zone_factor(pair), elasticity_factor(modulus, poisson), contact_ratio_factor(pair)
    Z_beta = 1.0 / math.sqrt(math.cos(pair.beta))
    sigma_H0 = Z_H * Z_E * Z_eps * Z_beta
    sigma_H0 *= math.sqrt(general.F_t_N / (pair.d[0] * pair.b) * (pair.u + 1.0) / pair.u)
    Z_BD = single_pair_factors(pair, edition, load.tip_relief_factor)
    factors = general.K_A * general.K_gamma * general.K_v * general.K_Hbeta * general.K_Halpha
    sigma_H = Z_BD[0] * sigma_H0 * math.sqrt(factors), Z_BD[1] * sigma_H0 * math.sqrt(factors)

    limits = strengths[0].sigma_H_lim, strengths[1].sigma_H_lim
    C_ZL, C_ZR = lubricant_constants(min(limits))
    Z_L = C_ZL + 4.0 * (1.0 - C_ZL) / (1.2 + 134.0 / load.viscosity_40) ** 2
    C_Zv = C_ZL + 0.02
    Z_v = C_Zv + 2.0 * (1.0 - C_Zv) / math.sqrt(0.8 + 32.0 / general.v_m_per_s)
    R_z10 = 0.5 * sum(s.flank_roughness for s in strengths) * (10.0 / abs(pair.rho_red)) ** (1.0 / 3.0)
    Z_R = (3.0 / R_z10) ** C_ZR
    viscosity = load.viscosity_40
    of_pinion, of_wheel = (
        work_hardening(s, mate, abs(pair.u), general.v_m_per_s, abs(pair.rho_red), viscosity)
        for s, mate in (strengths, strengths[::-1])
    )
    Z_W = min(of_pinion, 1.0), of_wheel
    static_Z_W = 1.0, static_work_hardening(strengths[1], strengths[0])
    Z_NT, sigma_HG, curves = [], [], []
    for strength, n, hardening, of_static in zip(strengths, cycles, Z_W, static_Z_W, strict=True):
        curve = flank_life(strength.material, load.long_life, pitting=load.pitting_allowed)
        static = strength.sigma_H_lim * curve.static * of_static
        reference = strength.sigma_H_lim * Z_L * Z_v * Z_R * hardening
        curves.append(FatigueCurve(curve, static, reference))
        Z_NT.append(curve.at(n))
        sigma_HG.append(curve.strength(n, static, reference))
    return Flank(
        Z_H=Z_H,
        Z_E=Z_E,
        Z_eps=Z_eps,
        Z_beta=Z_beta,
        M=auxiliary_factors(pair),
        Z_BD=Z_BD,
        rho_red_mm=pair.rho_red,
        sigma_H0_MPa=sigma_H0,
        sigma_H_MPa=sigma_H,
        sigma_H_lim_MPa=limits,
        N_L=cycles,
        Z_NT=(Z_NT[0], Z_NT[1]),
        C_ZL=C_ZL,
        Z_L=Z_L,
        Z_v=Z_v,
        R_z10_um=R_z10,
        Z_R=Z_R,
        Z_W=Z_W,
        Z_X=(1.0, 1.0),
        sigma_HG_MPa=(sigma_HG[0], sigma_HG[1]),
        sigma_HP_MPa=(sigma_HG[0] / load.flank_safety, sigma_HG[1] / load.flank_safety),
        S_H=(sigma_HG[0] / sigma_H[0], sigma_HG[1] / sigma_H[1]),
        curves=(curves[0], curves[1]),
    )
