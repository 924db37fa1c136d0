r"""Scuffing by flash temperature, ISO/TS 6336-20:2017, and by integral temperature, ISO/TS 6336-21:2017.

Both have the line load :math:`w_{Bt} = K_A K_\gamma K_v K_{H\beta} K_{H\alpha} F_t/b`. Places on the path of contact
are :math:`\Gamma`, the distance from the pitch point over that of the pitch point from gear 1's base circle.

**Flash temperature**:

.. math::
    \Theta_{fl} = \mu_m X_M X_J X_G (X_\Gamma w_{Bt})^{3/4} \frac{v_t^{1/2}}{a^{1/4}}, \quad
    X_G = 0.51\,X_{\alpha\beta}\sqrt{|u + 1|}\,
    \frac{|\sqrt{1 + \Gamma} - \sqrt{1 - \Gamma/u}|}{(1 + \Gamma)^{1/4}|u - \Gamma|^{1/4}}, \\
    \mu_m = 0.060\Big(\frac{w_{Bt}}{v_{g\Sigma C}\,\rho_{relC}}\Big)^{0.2} X_L X_R, \quad
    X_R = \Big(\frac{R_{a1} + R_{a2}}{2}\Big)^{1/4}, \\
    \Theta_M = \Theta_{oil} + 0.47 X_S X_{mp} \Theta_{flm}, \quad \Theta_B = \Theta_M + \Theta_{fl}, \quad
    S_B = \frac{\Theta_S - \Theta_{oil}}{\Theta_{B\,max} - \Theta_{oil}}.

This is Blok's temperature of a Hertzian line contact [#]_. On the way in,
:math:`X_J = 1 + (C_{eff} - C_a)/50\,|\Gamma|^3` with the relief of the driven gear. Load shares :math:`X_\Gamma` are
those of the technical specification for profiles without relief. Where two pairs of a spur gear touch they are 1/3 to
2/3. For helical gears they are :math:`1/\varepsilon_\alpha`, with up to 1.3 times as much at both ends. With the relief
:math:`C_{eff}` spur gears have 0 to 1 and helical ones no excess; between both the share is interpolated.

**Integral temperature**: :math:`\Theta_{int} = \Theta_{MC} + 1.5\,\Theta_{fla\,int}`,
:math:`\Theta_{MC} = \Theta_{oil} + 0.7 X_S X_{mp}\Theta_{fla\,int}`, with

.. math::
    \Theta_{fla\,int} = \mu_{mC} X_M X_{BE} X_{\alpha\beta} (K_{B\gamma} w_{Bt})^{3/4}
    \frac{v^{1/2}}{|a|^{1/4}}\frac{X_\varepsilon}{X_Q X_{Ca}}.

The friction of run-in flanks, :math:`X_E = 1`, is taken. The integral temperature needs a pitch point within the path
of contact; planets and rings may have none.

.. [#] H. Blok, Theoretical study of temperature rise at surfaces of actual contact under oiliness lubricating
   conditions, Proc. Gen. Disc. Lubrication, IMechE, 1937.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import InputError
from .data import Oil, PairData, Strength
from .ledger import cited
from .load_factors import Influence, design_reliefs

_FLASH = "ISO/TS 6336-20:2017"
_INTEGRAL = "ISO/TS 6336-21:2017"
#: Torque of gear 1 (N m) in the load stages 1 to 14 of the test A/8.3/90, ISO 14635-1.
STAGES = (3.3, 13.7, 35.3, 60.8, 94.1, 135.3, 183.4, 239.3, 302.0, 372.6, 450.1, 534.5, 626.9, 714.2)
#: Factor of the lubricant over that of mineral oil.
LUBRICANTS = {
    "mineral": 1.0,
    "polyalphaolefin": 0.8,
    "polyglycol": 0.7,
    "water_soluble_polyglycol": 0.6,
    "phosphate_ester": 1.3,
    "traction_fluid": 1.5,
}
#: X_S of the way of lubrication.
LUBRICATION = {"dip": 1.0, "spray": 1.2, "spray_and_dip": 1.0, "submerged": 0.2}
#: Speed (m/s) and line load (N/mm) up to and from which the coefficient of friction follows its formula.
FASTEST, LIGHTEST = 50.0, 150.0
#: Excess of the load at both ends of the contact of helical gears with an overlap ratio of 1 or more.
BUTTRESS = 0.3
#: Common logarithm of the largest kinematic viscosity (mm^2/s) that Walther's line is followed to.
THICKEST = 8.0
#: Points of the path of contact.
POINTS = 2001
#: Values of the integral temperature, which needs a pitch point within the path of contact.
INTEGRAL = (
    *("X_BE", "X_eps", "X_Q", "X_Ca"),
    *("theta_flaint_K", "theta_MC_C", "theta_int_C", "theta_Sint_C", "S_intS"),
)


@dataclass(frozen=True)
class Path:
    """Contact along the path.

    Attributes
    ----------
    gamma
        Places (-): -1 at the base circle of gear 1, 0 at the pitch point.
    share
        Load share X_Gamma (-).
    flash, contact
        Flash temperature, and contact temperature (deg C).
    """

    gamma: NDArray[np.float64]
    share: NDArray[np.float64]
    flash: NDArray[np.float64]
    contact: NDArray[np.float64]


@dataclass(frozen=True)
class Scuffing:
    """Temperatures and safety factors against scuffing."""

    w_Bt_N_per_mm: float = cited("transverse line load", f"{_FLASH}, w_Bt", "N/mm")
    K_Bgamma: float = cited("helical load factor", f"{_INTEGRAL}, K_Bgamma")
    eta_oil_mPa_s: float = cited("dynamic viscosity at oil temperature", "ASTM D341; ISO/TR 15144-1, density", "mPa s")
    C_eff_um: float = cited("tip relief that takes up the load's deflection", f"{_FLASH}, C_eff", "um")
    Gamma_A: float = cited("start of contact of the pinion's root", f"{_FLASH}, Gamma_A")
    Gamma_E: float = cited("contact of the pinion's tip", f"{_FLASH}, Gamma_E")
    X_alphabeta: float = cited("angle factor", f"{_FLASH}, X_alphabeta")
    X_M: float = cited("thermo-elastic factor at the pitch point", f"{_FLASH}, X_M", "K N^-3/4 s^1/2 m^-1/2 mm")
    X_L: float = cited("lubricant factor of the flash temperature", f"{_FLASH}, X_L")
    X_R: float = cited("roughness factor of the flash temperature", f"{_FLASH}, X_R")
    mu_m: float = cited("mean coefficient of friction of the flash temperature", f"{_FLASH}, mu_m")
    theta_flm_K: float = cited("mean flash temperature", f"{_FLASH}, Theta_flm", "K")
    theta_flmax_K: float = cited("highest flash temperature", f"{_FLASH}, Theta_fl", "K")
    theta_M_C: float = cited("bulk temperature", f"{_FLASH}, Theta_M", "deg C")
    theta_B_C: float = cited("highest contact temperature", f"{_FLASH}, Theta_Bmax", "deg C")
    Gamma_B_max: float = cited("place of the highest contact temperature", f"{_FLASH}, Gamma")
    theta_S_C: float = cited("scuffing temperature", f"{_FLASH}, Theta_S", "deg C")
    S_B: float = cited("safety factor against scuffing, flash temperature", f"{_FLASH}, S_B")
    X_BE: float | None = cited("geometry factor at the pinion's tip", f"{_INTEGRAL}, X_BE")
    X_eps: float | None = cited("contact ratio factor", f"{_INTEGRAL}, X_eps")
    X_Q: float | None = cited("approach factor", f"{_INTEGRAL}, X_Q")
    X_Ca: float | None = cited("tip relief factor", f"{_INTEGRAL}, X_Ca")
    mu_mC: float = cited("mean coefficient of friction of the integral temperature", f"{_INTEGRAL}, mu_mC")
    theta_flaint_K: float | None = cited("mean flash temperature", f"{_INTEGRAL}, Theta_flaint", "K")
    theta_MC_C: float | None = cited("bulk temperature", f"{_INTEGRAL}, Theta_MC", "deg C")
    theta_int_C: float | None = cited("integral temperature", f"{_INTEGRAL}, Theta_int", "deg C")
    theta_Sint_C: float | None = cited("integral scuffing temperature", f"{_INTEGRAL}, Theta_intS", "deg C")
    S_intS: float | None = cited("safety factor against scuffing, integral temperature", f"{_INTEGRAL}, S_intS")
    path: Path = field(kw_only=True)


def viscosity(oil: Oil, at_40: float) -> float:
    """Dynamic viscosity (mPa s) at oil temperature of an oil with a kinematic one at 40 C (mm^2/s).

    The kinematic one follows Walther's line through 40 and 100 C (ASTM D341, constant 0.7), the density falls by
    0.7 kg/m^3 per kelvin (ISO/TR 15144-1).

    Raises
    ------
    InputError
        For a temperature at which the line leaves the range of oils.
    """

    def double(nu: float) -> float:
        return math.log10(math.log10(nu + 0.7))

    cold, warm, at = (math.log10(theta + 273.15) for theta in (40.0, 100.0, oil.temperature))
    slope = (double(at_40) - double(oil.viscosity_100)) / (warm - cold)
    exponent = 10.0 ** (double(at_40) - slope * (at - cold))
    if exponent > THICKEST:
        problem = f"gives the oil more than 1e{THICKEST:g} mm2/s, by its viscosities at 40 and 100 C"
        raise InputError("rating.oil_temperature_C", oil.temperature, problem, "correct temperature and viscosities")
    nu = 10.0**exponent - 0.7
    return 1e-3 * nu * (oil.density - 0.7 * (oil.temperature - 16.0))


def angle_factor(pair: PairData) -> float:
    """X_alphabeta."""
    cos_w, cos_t = math.cos(pair.alpha_wt), math.cos(pair.alpha_t)
    inclination = (math.sin(pair.alpha_wt) * math.cos(pair.alpha_n) * math.cos(pair.beta)) ** 0.25
    return 1.22 * inclination / math.sqrt(cos_w * cos_t)


def ends(pair: PairData) -> tuple[float, float]:
    """Gamma_A and Gamma_E."""
    tip_1, tip_2 = (math.sqrt((a / b) ** 2 - 1.0) for a, b in zip(pair.d_a, pair.d_b, strict=True))
    slope = math.tan(pair.alpha_wt)
    return -pair.u * (tip_2 / slope - 1.0), tip_1 / slope - 1.0


def geometry_factor(pair: PairData, gamma: ArrayLike) -> NDArray[np.float64]:
    """X_G at places on the path."""
    x = np.asarray(gamma, dtype=float)
    one, two = 1.0 + x, 1.0 - x / pair.u
    lever = np.abs(np.sqrt(one) - np.sqrt(two)) / (one * abs(pair.u) * two) ** 0.25
    return np.asarray(0.51 * angle_factor(pair) * math.sqrt(abs(pair.u + 1.0)) * lever)


def thermoelastic_factor(pair: PairData, E_r: float, B_M: tuple[float, float], gamma: ArrayLike) -> NDArray[np.float64]:
    """Return X_M at places on the path.

    Parameters
    ----------
    pair : PairData
        The gears.
    E_r : float
        Reduced modulus 2/(sum of (1 - nu^2)/E) (N/mm^2).
    B_M : (float, float)
        Thermal contact coefficients (N/(mm m^1/2 s^1/2 K)).
    gamma : array_like
        Places (-).
    """
    x = np.asarray(gamma, dtype=float)
    one, two = np.sqrt(1.0 + x), np.sqrt(1.0 - x / pair.u)
    return np.asarray(math.sqrt(1e3) * E_r**0.25 * (one + two) / (B_M[0] * one + B_M[1] * two))


def load_share(pair: PairData, gamma: ArrayLike, relief: float, quality: int) -> NDArray[np.float64]:
    """Return X_Gamma at places on the path.

    Parameters
    ----------
    pair : PairData
        The gears.
    gamma : array_like
        Places (-).
    relief : float
        C_a over C_eff, at most 1 counts.
    quality : int
        Accuracy grade; from 8 on pairs share the load less evenly.
    """
    x = np.asarray(gamma, dtype=float)
    (low, high), step = ends(pair), 2.0 * math.pi / (pair.z[0] * math.tan(pair.alpha_wt))
    inner, outer = high - step, low + step
    done = min(max(relief, 0.0), 1.0)
    coarse = (max(quality, 7) - 2.0) / 15.0
    least, most = coarse * (1.0 - done), (coarse + 1.0 / 3.0) * (1.0 - done) + done
    entering = least + (most - least) * (x - low) / (inner - low)
    leaving = least + (most - least) * (high - x) / (high - outer)
    spur = np.where(x < inner, entering, np.where(x > outer, leaving, 1.0))
    # narrow helical gears share as spur ones, wide ones evenly; the load is larger where contact lines begin and end
    wide = min(max((pair.eps_beta - 0.8) / 0.4, 0.0), 1.0)
    excess = BUTTRESS * min(pair.eps_beta, 1.0) * (1.0 - done)
    width = 0.2 * math.sin(abs(pair.beta_b))
    share = spur * (1.0 - wide) + wide / pair.eps_alpha
    if not excess:
        return np.asarray(share)
    near = np.minimum(x - low, high - x)
    return np.asarray(share * (1.0 + excess * np.clip(1.0 - near / width, 0.0, 1.0)))


def helical_factor(eps_gamma: float) -> float:
    """K_Bgamma of a total contact ratio."""
    if eps_gamma <= 2.0:
        return 1.0
    return 1.3 if eps_gamma >= 3.5 else 1.0 + 0.2 * math.sqrt((eps_gamma - 2.0) * (5.0 - eps_gamma))


def contact_ratio_factor(one: float, two: float) -> float:
    """X_eps of the addendum contact ratios of gears 1 and 2, whose sum is below 2."""
    both = one + two
    if one >= 1.0:
        ratio = 0.18 * one**2 + 0.70 * two**2 + 0.82 * one - 0.52 * two - 0.30 * one * two
    elif two >= 1.0:
        ratio = 0.70 * one**2 + 0.18 * two**2 - 0.52 * one + 0.82 * two - 0.30 * one * two
    else:
        ratio = 0.70 * (one**2 + two**2) - 0.22 * both + 0.52 - 0.60 * one * two
    return ratio / (2.0 * both * one)


def tip_relief_factor(relief: float, one: float, two: float) -> float:
    """X_Ca of C_a over C_eff, at most 1 counts, and the addendum contact ratios."""
    done, larger = min(max(relief, 0.0), 1.0), max(one, two)
    return 1.0 + (0.06 + 0.18 * done) * larger + (0.02 + 0.69 * done) * larger**2


def tip_geometry_factor(pair: PairData) -> float:
    """X_BE at the tip of gear 1."""
    tip = 0.5 * math.sqrt(pair.d_a[0] ** 2 - pair.d_b[0] ** 2)
    mate = abs(pair.a * math.sin(pair.alpha_wt) - tip)
    lever = 0.51 * math.sqrt(abs(pair.u + 1.0)) * abs(math.sqrt(tip) - math.sqrt(mate / abs(pair.u)))
    return lever / (tip * mate) ** 0.25


def scuffing(
    pair: PairData,
    strengths: tuple[Strength, Strength],
    oil: Oil,
    general: Influence,
    *,
    driver: int,
    viscosity_40: float,
    modulus: tuple[float, float],
    poisson: tuple[float, float],
    eps: tuple[float, float],
) -> Scuffing:
    """Return temperatures and safety factors against scuffing.

    Parameters
    ----------
    pair : PairData
        The gears.
    strengths : (Strength, Strength)
        Their flanks.
    oil : Oil
        The lubricant.
    general : Influence
        Factors of general influence.
    driver : int
        0 where gear 1 drives, else 1.
    viscosity_40 : float
        Kinematic viscosity at 40 C (mm^2/s).
    modulus, poisson : (float, float)
        Young's moduli (N/mm^2) and Poisson's ratios.
    eps : (float, float)
        Addendum contact ratios.
    """
    low, high = ends(pair)
    loads = general.K_A * general.K_gamma * general.K_v * general.K_Hbeta * general.K_Halpha
    w = general.F_t_N / pair.b * loads
    eta, thin = viscosity(oil, viscosity_40), LUBRICANTS[oil.kind]
    E_r = 2.0 / sum((1.0 - nu**2) / E for E, nu in zip(modulus, poisson, strict=True))
    B_M = strengths[0].thermal_contact, strengths[1].thermal_contact
    stiffness = general.c_gamma_alpha_N_per_mm_um if pair.beta else general.c_prime_N_per_mm_um
    C_eff = general.K_A * general.K_gamma * general.F_t_N / (pair.b * stiffness)
    designed = design_reliefs(strengths)
    relief = (general.C_a_um if designed is None else min(designed)) / C_eff
    # relief of running-in does not change load shares; teeth come into contact with the tip of the driven gear
    shared, entering_relief = (0.0, general.C_a_um) if designed is None else (min(designed), designed[1 - driver])

    # speeds of the working circle, m/s; radii of curvature of the normal section, mm
    v_t = general.v_m_per_s * math.cos(pair.alpha_t) / math.cos(pair.alpha_wt)
    v_sum = min(2.0 * v_t * math.sin(pair.alpha_wt), FASTEST)
    rho = abs(pair.rho_red) / math.cos(pair.beta_b)
    R_a = 0.5 * sum(s.flank_ra for s in strengths)
    X_L, X_R = thin * eta**-0.05, R_a**0.25
    mu_m = 0.060 * (max(w, LIGHTEST) / (v_sum * rho)) ** 0.2 * X_L * X_R
    K_Bgamma = helical_factor(pair.eps_gamma)
    mu_mC = 0.045 * (max(w * K_Bgamma, LIGHTEST) / (v_sum * rho)) ** 0.2 * X_L * 2.2 * (R_a / rho) ** 0.25
    if oil.friction is not None:
        mu_m = mu_mC = oil.friction

    gamma = np.linspace(low, high, POINTS)
    share = load_share(pair, gamma, shared / C_eff, max(s.quality for s in strengths))
    approach = np.maximum(0.0, gamma if driver else -gamma)
    X_J = 1.0 + max(0.0, C_eff - entering_relief) / 50.0 * approach**3
    flash = thermoelastic_factor(pair, E_r, B_M, gamma) * X_J * geometry_factor(pair, gamma)
    flash *= mu_m * (share * w) ** 0.75 * math.sqrt(v_t) / abs(pair.a) ** 0.25
    mean = float(np.mean(0.5 * (flash[1:] + flash[:-1])))
    X_S, X_mp = LUBRICATION[oil.lubrication], 0.5 * (1 + max(s.mates for s in strengths))
    theta_M = oil.temperature + 0.47 * X_S * X_mp * mean
    hottest = int(np.argmax(flash))
    contact = theta_M + flash
    X_W = min(s.structure for s in strengths)
    theta_S = 80.0 + (0.85 + 1.4 * X_W) * X_L * oil.stage**2

    X_M = float(thermoelastic_factor(pair, E_r, B_M, 0.0))
    integral: dict[str, float] = {}
    if low < 0.0 < high:
        leaving, entering = eps if not driver else eps[::-1]
        ratio = entering / leaving
        integral = {
            "X_BE": tip_geometry_factor(pair),
            "X_eps": contact_ratio_factor(*eps),
            "X_Q": 1.0 if ratio <= 1.5 else 0.6 if ratio >= 3.0 else 1.4 - 4.0 / 15.0 * ratio,
            "X_Ca": tip_relief_factor(relief, *eps),
        }
        heat = mu_mC * X_M * integral["X_BE"] * angle_factor(pair) * (K_Bgamma * w) ** 0.75
        heat *= math.sqrt(general.v_m_per_s) / abs(pair.a) ** 0.25
        heat *= integral["X_eps"] / (integral["X_Q"] * integral["X_Ca"])
        theta_MC = oil.temperature + 0.7 * X_S * X_mp * heat
        T_test, thick = STAGES[oil.stage - 1], (100.0 / viscosity_40) ** 0.02
        theta_Sint = 80.0 + thin * T_test * (0.23 + 1.5 * X_W * 0.2 * thick)
        integral |= {
            "theta_flaint_K": heat,
            "theta_MC_C": theta_MC,
            "theta_int_C": theta_MC + 1.5 * heat,
            "theta_Sint_C": theta_Sint,
            "S_intS": _safety(theta_Sint, theta_MC + 1.5 * heat),
        }
    return Scuffing(
        w_Bt_N_per_mm=w,
        K_Bgamma=K_Bgamma,
        eta_oil_mPa_s=eta,
        C_eff_um=C_eff,
        Gamma_A=low,
        Gamma_E=high,
        X_alphabeta=angle_factor(pair),
        X_M=X_M,
        X_L=X_L,
        X_R=X_R,
        mu_m=mu_m,
        theta_flm_K=mean,
        theta_flmax_K=float(flash[hottest]),
        theta_M_C=theta_M,
        theta_B_C=float(contact[hottest]),
        Gamma_B_max=float(gamma[hottest]),
        theta_S_C=theta_S,
        S_B=_safety(theta_S - oil.temperature, float(contact[hottest]) - oil.temperature),
        mu_mC=mu_mC,
        **{name: integral.get(name) for name in INTEGRAL},
        path=Path(gamma, share, flash, contact),
    )


def _safety(allowed: float, value: float) -> float:
    """Ratio of an allowed temperature to the one at work; infinite for flanks that are not heated above zero."""
    return allowed / value if value > 0.0 else math.inf
