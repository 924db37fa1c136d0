r"""Tooth bending strength, ISO 6336-3:2006, method B, with what the edition of 2019 changes.

.. math::
    \sigma_{F0} = \frac{F_t}{b m_n} Y_F Y_S Y_\beta Y_B Y_{DT}, \quad
    \sigma_F = \sigma_{F0} K_A K_\gamma K_v K_{F\beta} K_{F\alpha}, \\
    \sigma_{FG} = \sigma_{F\,lim} Y_{ST} Y_{NT} Y_{\delta\,rel\,T} Y_{R\,rel\,T} Y_X Y_M, \quad
    S_F = \sigma_{FG}/\sigma_F.

**Tooth form**, clause 6: the chord :math:`s_{Fn}` is where tangents of 30 degrees touch the fillet of the virtual spur
gear that the rack generates. The lever :math:`h_{Fe}` is that of the load at the outer point of single pair contact
(:math:`d_{en}`), (9) to (31). :math:`Y_S` is by (36) to (38).

**Edition of 2019**: :math:`Y_F` has the factor :math:`f_\varepsilon` of the load distribution, 1 for spur gears,
:math:`\sqrt{1 - \varepsilon_\beta + \varepsilon_\beta/\varepsilon_{\alpha n}}` for :math:`\varepsilon_\beta < 1`,
:math:`\sqrt{1/\varepsilon_{\alpha n}}` beyond, and :math:`Y_\beta` the divisor :math:`\cos^3\beta`.

**Strength**: :math:`Y_{\delta\,rel\,T} = (1 + \sqrt{\rho'\chi^*})/(1 + \sqrt{\rho'\chi^*_T})`,
:math:`\chi^* = (1 + 2q_s)/5`, :math:`q_{sT} = 2.5`, with the slip-layer thickness :math:`\rho'` of Table 3; for static
load its own formulas, :math:`Y_{R\,rel\,T} = Y_X = 1`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

from ...base.errors import InputError
from ..geometry.curves import inv, inverse_inv
from . import materials
from .data import Load, PairData, Strength
from .ledger import cited
from .life import FatigueCurve, root_life
from .load_factors import Influence

_PART = "ISO 6336-3:2006"
_PAIR = tuple[float, float]
#: Stress correction factor of the test gears.
Y_ST = 2.0
#: Notch parameter of the test gears, and the range of Y_S.
TEST_NOTCH, NOTCHES = 2.5, (1.0, 8.0)
#: Slip-layer thickness (mm) over the yield point or 0.2 % proof stress, or the tensile strength of iron (N/mm^2).
SLIP_LAYER = {
    "iron": ((150.0, 0.3124), (300.0, 0.3095)),
    "normalised": ((300.0, 0.0833), (400.0, 0.0445)),
    "through_hardened": ((500.0, 0.0281), (600.0, 0.0194), (800.0, 0.0064), (1000.0, 0.0014)),
}


@dataclass(frozen=True)
class Root:
    """Stresses, strength and safety of the roots, of gear 1 and gear 2."""

    b_F_mm: _PAIR = cited("face width that bears at the root", f"{_PART}, 5.2", "mm")
    eps_alphan: float = cited("transverse contact ratio of the virtual gear", f"{_PART}, (23)")
    d_en_mm: _PAIR = cited("diameter of the outer point of single pair contact", f"{_PART}, (28)", "mm")
    alpha_Fen_deg: _PAIR = cited("angle of the load there", f"{_PART}, (31)", "deg")
    h_Fe_mm: _PAIR = cited("bending moment arm", f"{_PART}, (18)", "mm")
    s_Fn_mm: _PAIR = cited("chord at the critical section", f"{_PART}, (15)", "mm")
    rho_F_mm: _PAIR = cited("fillet radius at the critical section", f"{_PART}, (17)", "mm")
    q_s: _PAIR = cited("notch parameter", f"{_PART}, (38)")
    f_eps: float = cited("load distribution influence factor", "ISO 6336-3:2019, 6.2")
    Y_F: _PAIR = cited("form factor", f"{_PART}, (9); 2019, 6.2")
    Y_S: _PAIR = cited("stress correction factor", f"{_PART}, (36)")
    Y_beta: float = cited("helix angle factor", f"{_PART}, 8; 2019, 8")
    Y_B: _PAIR = cited("rim thickness factor", f"{_PART}, 9")
    Y_DT: float = cited("deep tooth factor", f"{_PART}, 10")
    sigma_F0_MPa: _PAIR = cited("nominal root stress", f"{_PART}, 5.2", "MPa")
    sigma_F_MPa: _PAIR = cited("root stress", f"{_PART}, 5.2", "MPa")
    sigma_F_lim_MPa: _PAIR = cited("allowable stress number", "ISO 6336-5:2016, Table 1", "MPa")
    Y_NT: _PAIR = cited("life factor", f"{_PART}, Table 1")
    rho_slip_mm: _PAIR = cited("slip-layer thickness", f"{_PART}, Table 3", "mm")
    Y_delta_rel_T: _PAIR = cited("relative notch sensitivity factor", f"{_PART}, (49)")
    Y_R_rel_T: _PAIR = cited("relative surface factor", f"{_PART}, (51) to (56)")
    Y_X: _PAIR = cited("size factor", f"{_PART}, Table 5")
    Y_M: _PAIR = cited("mean stress influence factor", f"{_PART}, annex B")
    sigma_FG_MPa: _PAIR = cited("root stress limit", f"{_PART}, 5.4", "MPa")
    sigma_FP_MPa: _PAIR = cited("permissible root stress", f"{_PART}, 5.4", "MPa")
    S_F: _PAIR = cited("safety factor of the root", f"{_PART}, 5.1")
    curves: tuple[FatigueCurve, FatigueCurve] = field(kw_only=True)


@dataclass(frozen=True)
class ToothForm:
    """Critical section of a tooth of the virtual spur gear: mm, rad."""

    d_en: float
    alpha_Fen: float
    h_Fe: float
    s_Fn: float
    rho_F: float

    @property
    def q_s(self) -> float:
        """Notch parameter s_Fn/(2 rho_F), (38)."""
        return self.s_Fn / (2.0 * self.rho_F)

    @property
    def Y_S(self) -> float:
        """Stress correction factor, (36), (37)."""
        L = self.s_Fn / self.h_Fe
        return (1.2 + 0.13 * L) * self.q_s ** (1.0 / (1.21 + 2.3 / L))

    def Y_F(self, m_n: float, alpha_n: float) -> float:
        """Form factor, (9), without load distribution."""
        lever, chord = self.h_Fe / m_n, self.s_Fn / m_n
        return 6.0 * lever * math.cos(self.alpha_Fen) / (chord**2 * math.cos(alpha_n))


def contact_ratio_normal(pair: PairData) -> float:
    """eps_alphan of the virtual spur gears, (23)."""
    return pair.eps_alpha / math.cos(pair.beta_b) ** 2


def tooth_form(pair: PairData, i: int, edition: int = 2019) -> ToothForm:
    """Return the critical section of the teeth of gear i (0 or 1) of the virtual spur gears.

    A rack without protuberance generates external gears. An internal gear has the root of its pinion-type cutter, or,
    in the edition of 2006, that of an equivalent rack.

    Raises
    ------
    InputError
        For a tooth whose load at the outer point of single pair contact has no lever.
    """
    m, alpha, z, x = pair.m_n, pair.alpha_n, pair.z_n[i], pair.x[i]
    if pair.z[i] < 0 and edition != 2006:
        section = _cut_section(pair, i)
    else:
        section = _rack_section(pair, i)
    d_n = m * z  # (24)
    d_bn, d_an = d_n * math.cos(alpha), d_n + pair.d_a[i] - pair.d[i]  # (26), (27)
    step = math.copysign(math.pi * m, z) * math.cos(alpha) * (contact_ratio_normal(pair) - 1.0)
    roll = 0.5 * math.sqrt(max(0.0, d_an**2 - d_bn**2)) - step
    d_en = math.copysign(2.0 * math.hypot(roll, 0.5 * d_bn), z)  # (28)
    alpha_en = math.acos(d_bn / d_en)  # (29)
    half = (0.5 * math.pi + 2.0 * math.tan(alpha) * x) / z  # (30)
    gamma = half + math.tan(alpha) - alpha - math.tan(alpha_en) + alpha_en
    alpha_F = alpha_en - gamma  # (31)
    # (18): from the section to where the load meets the middle of the tooth
    lever = 0.5 * d_en * (math.cos(gamma) - math.sin(gamma) * math.tan(alpha_F)) - section.place
    if not (lever > 0.0 and section.chord > 0.0 and section.fillet > 0.0):
        problem = f"gives a lever of {lever:.4g} mm and a chord of {section.chord:.4g} mm at the root of gear {i + 1}"
        raise InputError("tooth form", None, f"{problem}: both must be > 0", "use a usual rack and tip diameter")
    return ToothForm(d_en, alpha_F, lever, section.chord, section.fillet)


@dataclass(frozen=True)
class _Section:
    """Critical section: its chord, its fillet radius and its distance from the axis (mm), < 0 for internal gears."""

    chord: float
    fillet: float
    place: float


def _rack_section(pair: PairData, i: int) -> _Section:
    """Section of the root that a rack generates, (10) to (18); of an internal gear that of an equivalent rack.

    The rack of an internal gear has the tip radius rho_fPv, which its cutter has in effect, and tangents of 60 degrees.
    """
    m, alpha, z, x = pair.m_n, pair.alpha_n, pair.z_n[i], pair.x[i]
    h, rho, tangent = pair.h_fP[i], pair.rho_fP[i], math.pi / 3.0
    if pair.z[i] < 0 and pair.cutter is not None:
        z_0, x_0 = pair.cutter
        tangent = math.pi / 6.0
        rho += m * max(0.0, x_0 + (h - rho) / m) ** 1.95 / (3.156 * 1.036**z_0)
    E = 0.25 * math.pi * m - h * math.tan(alpha) - (1.0 - math.sin(alpha)) * rho / math.cos(alpha)  # (10)
    G = rho / m - h / m + x  # (12)
    H = 2.0 / z * (0.5 * math.pi - E / m) - tangent  # (13)
    theta = _angle(2.0 * G / z, H)
    bracket = G / math.cos(theta) - rho / m
    chord = m * (z * math.sin(tangent - theta) + 2.0 * math.sin(tangent) * bracket)  # (15), (16)
    place = 0.5 * m * (z * math.cos(tangent - theta) + 2.0 * math.cos(tangent) * bracket)
    fillet = rho + 2.0 * m * G**2 / (math.cos(theta) * (abs(z) * math.cos(theta) ** 2 - 2.0 * G))  # (17)
    return _Section(chord, fillet, place)


def _cut_section(pair: PairData, i: int) -> _Section:
    """Section of the root that the pinion-type cutter of an internal gear generates, with tangents of 60 degrees.

    Gear and cutter roll on circles of R and R_0 about centres on one side of the pitch point P. The normal at the angle
    g to the line of centres passes through P and the centre of the cutter's tip round. This centre lies L = D - R_0
    cos(g) from P, with D^2 = r_c^2 - R_0^2 sin^2(g). The gear turns chi' = R_0 L/(R D) times as fast as g grows (Litvin
    & Fuentes, *Gear Geometry and Applied Theory*, ch. 6).
    """
    m, alpha, z, x = pair.m_n, pair.alpha_n, abs(pair.z_n[i]), pair.x[i]
    z_0, x_0 = pair.cutter or (0.5 * z, 0.0)
    rho = pair.rho_fP[i] / m
    working = inverse_inv(inv(alpha) + 2.0 * math.tan(alpha) * (x_0 + x) / (z_0 - z))
    R, R_0 = (0.5 * number * math.cos(alpha) / math.cos(working) for number in (z, z_0))
    centre = (
        0.5 * z + pair.h_fP[i] / m - x - (R - R_0) - rho
    )  # radius of the centre of the round, from the cutter's axis
    space = (0.5 * math.pi - 2.0 * math.tan(alpha) * x) / z + inv(alpha) - inv(working)  # half of the space at R
    base = 0.5 * z_0 * math.cos(alpha)
    along = math.sqrt(max(0.0, centre**2 - base**2))
    theta = inv(working) + R / R_0 * space - (along + rho) / base + math.atan2(along, base)

    def at(g: float) -> tuple[float, float, float]:
        """Distance D and L, and the turn of the gear (rad)."""
        D = math.sqrt(centre**2 - (R_0 * math.sin(g)) ** 2)
        L = D - R_0 * math.cos(g)
        return D, L, R_0 / R * (math.atan2(L * math.sin(g), R_0 + L * math.cos(g)) - theta)

    low, high = 0.0, 0.5 * math.pi - working
    for _ in range(100):  # the normal is 30 degrees from the middle of the tooth, half a pitch from that of the space
        middle = 0.5 * (low + high)
        steep = middle - math.pi / z - at(middle)[2] >= math.pi / 6.0
        low, high = (low, middle) if steep else (middle, high)
    D, L, turn = at(high)
    reach, turning = L + rho, R_0 * L / (R * D)
    angle = -math.pi / z - turn
    chord = 2.0 * abs(R * math.sin(angle) + reach * math.sin(high + angle))
    place = R * math.cos(angle) + reach * math.cos(high + angle)
    fillet = (reach - turning * (R * math.cos(high) + reach)) / (1.0 - turning)
    return _Section(m * chord, m * fillet, -m * place)


def _angle(slope: float, H: float) -> float:
    """theta = slope tan(theta) - H, (14), by bisection between 0 and 90 degrees.

    The difference theta - slope tan(theta) + H is negative at 0 for H < 0; its first root is taken.
    """

    def off(theta: float) -> float:
        return theta - slope * math.tan(theta) + H

    low, high = 0.0, 0.4999 * math.pi
    if slope > 0.0:  # the difference has its largest value where slope = cos^2
        high = math.acos(min(1.0, math.sqrt(slope)))
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if off(middle) < 0.0 else (low, middle)
    if off(high) < -1e-9:
        problem = "has no place where tangents of 30 degrees touch it"
        raise InputError("root fillet", None, problem, "use less profile shift, or a smaller rack_tip_radius")
    return 0.5 * (low + high)


def load_distribution(pair: PairData, edition: int) -> float:
    """f_eps, ISO 6336-3:2019, 6.2; 1 in the edition of 2006."""
    if edition == 2006:
        return 1.0
    ratio, share = contact_ratio_normal(pair), min(pair.eps_beta, 1.0)
    if ratio < 2.0:
        return math.sqrt(1.0 - share + share / ratio)
    return math.sqrt(0.5 * (1.0 - share) + share / ratio) if share else 0.7


def helix_factor(pair: PairData, edition: int) -> float:
    """Y_beta, clause 8."""
    made = 1.0 - min(pair.eps_beta, 1.0) * min(math.degrees(pair.beta), 30.0) / 120.0
    return made if edition == 2006 else made / math.cos(pair.beta) ** 3


def rim_factor(pair: PairData, i: int, rim: float | None) -> float:
    """Return Y_B of a rim (mm) of gear i; None: a thick one; clause 9.

    Raises
    ------
    InputError
        For a rim below half the tooth depth (internal gears: below 1.75 modules), which the standard excludes.
    """
    if rim is None:
        return 1.0
    if pair.z[i] < 0:
        share, least, whole = rim / pair.m_n, 1.75, 3.5
        value = 1.15 * math.log(8.324 / share)
    else:
        share, least, whole = rim / (0.5 * (pair.d_a[i] - pair.d_f[i])), 0.5, 1.2
        value = 1.6 * math.log(2.242 / share)
    if share <= least:
        unit = "modules" if pair.z[i] < 0 else "tooth depths"
        problem = f"of gear {i + 1} is {share:.3g} {unit}: must be > {least:g} (ISO 6336-3, clause 9)"
        raise InputError("rim_thickness_mm", rim, problem, "use a thicker rim")
    return 1.0 if share >= whole else max(1.0, value)


def deep_tooth_factor(ratio: float, quality: int) -> float:
    """Y_DT of eps_alphan, for accuracy grades 4 and finer, clause 10."""
    if quality > 4 or ratio <= 2.05:
        return 1.0
    return max(0.7, 2.366 - 0.666 * ratio)


def slip_layer(strength: Strength) -> float:
    """rho' (mm) of Table 3."""
    material = strength.material
    if material in ("Eh", "IF"):
        return 0.0030
    if material in ("NT", "NV", "NV_nitrocar"):
        return 0.1005
    kind = "iron" if material in materials.SOFT_IRON else "through_hardened"
    knots = SLIP_LAYER["normalised" if material in materials.NORMALISED else kind]
    sigma = strength.yield_strength or knots[0][0]
    if sigma <= knots[0][0]:
        return knots[0][1]
    for (s0, r0), (s1, r1) in pairwise(knots):
        if sigma <= s1:
            return r0 + (r1 - r0) * (sigma - s0) / (s1 - s0)
    return knots[-1][1]


def notch_sensitivity(strength: Strength, q_s: float) -> float:
    """Y_delta_rel_T of the reference stress, (49)."""
    rho = slip_layer(strength)
    return (1.0 + math.sqrt(rho * 0.2 * (1.0 + 2.0 * q_s))) / (1.0 + math.sqrt(rho * 0.2 * (1.0 + 2.0 * TEST_NOTCH)))


def static_notch_sensitivity(strength: Strength, Y_S: float) -> float:
    """Y_delta_rel_T of static load, 12.3.2."""
    material, sigma = strength.material, strength.yield_strength or 0.0
    if material in ("Eh", "IF"):
        return 0.44 * Y_S + 0.12
    if material in ("NT", "NV", "NV_nitrocar"):
        return 0.20 * Y_S + 0.60
    if material in materials.SOFT_IRON:
        return 1.0
    if material == "St_cast":
        return 0.07 * Y_S + 0.86
    scale, reference = (0.93, 200.0) if material == "St" else (0.82, 300.0)
    factor = scale * (reference / sigma) ** 0.25
    return (1.0 + factor * (Y_S - 1.0)) / (1.0 + factor)


def surface_factor(strength: Strength) -> float:
    """Y_R_rel_T, (51) to (56)."""
    R_z, material = min(strength.root_roughness, 40.0), strength.material
    if material in materials.SOFT_IRON or material in ("NT", "NV", "NV_nitrocar"):
        return 1.025 if R_z < 1.0 else 4.299 - 3.259 * (R_z + 1.0) ** 0.0058
    if material in materials.NORMALISED:
        return 1.07 if R_z < 1.0 else 5.306 - 4.203 * (R_z + 1.0) ** 0.01
    return 1.12 if R_z < 1.0 else 1.674 - 0.529 * (R_z + 1.0) ** 0.1


def size_factor(material: str, m_n: float) -> float:
    """Y_X, Table 5."""
    if material in materials.SOFT_IRON:
        return max(0.7, min(1.0, 1.075 - 0.015 * m_n))
    if material in materials.SURFACE_HARDENED:
        return max(0.8, min(1.0, 1.05 - 0.01 * m_n))
    return max(0.85, min(1.0, 1.03 - 0.006 * m_n))


def root(
    pair: PairData,
    strengths: tuple[Strength, Strength],
    load: Load,
    general: Influence,
    *,
    edition: int,
    cycles: _PAIR,
) -> Root:
    """Return stresses, strength and safety of the roots.

    Parameters
    ----------
    pair : PairData
        The gears.
    strengths : (Strength, Strength)
        Their strength.
    load : Load
        Load and required safety.
    general : Influence
        Factors of general influence.
    edition : int
        2006 or 2019.
    cycles : (float, float)
        Numbers of load cycles.

    Raises
    ------
    InputError
        For rims that are too thin, and teeth without a lever.
    """
    both = (0, 1)
    forms = [tooth_form(pair, i, edition) for i in both]
    f_eps, Y_beta = load_distribution(pair, edition), helix_factor(pair, edition)
    ratio = contact_ratio_normal(pair)
    Y_DT = deep_tooth_factor(ratio, max(s.quality for s in strengths))
    factors = general.K_A * general.K_gamma * general.K_v * general.K_Fbeta * general.K_Falpha
    curves: list[FatigueCurve] = []
    made: dict[str, list[float]] = {
        name: [] for name in ("Y_F", "Y_S", "Y_B", "sigma_F0", "Y_NT", "rho", "Y_delta", "Y_R", "Y_X", "sigma_FG")
    }
    for i in both:
        form, strength = forms[i], strengths[i]
        Y_F, Y_S = f_eps * form.Y_F(pair.m_n, pair.alpha_n), form.Y_S
        Y_B = rim_factor(pair, i, strength.rim)
        sigma_F0 = general.F_t_N / (pair.b_F[i] * pair.m_n) * Y_F * Y_S * Y_beta * Y_B * Y_DT
        curve = root_life(strength.material, load.long_life)
        Y_delta, Y_R = notch_sensitivity(strength, form.q_s), surface_factor(strength)
        Y_X = size_factor(strength.material, pair.m_n)
        limit = strength.sigma_F_lim * Y_ST * strength.alternating
        reference = limit * Y_delta * Y_R * Y_X
        static = limit * curve.static * static_notch_sensitivity(strength, Y_S)
        found = (
            *(Y_F, Y_S, Y_B, sigma_F0, curve.at(cycles[i]), slip_layer(strength), Y_delta, Y_R, Y_X),
            curve.strength(cycles[i], static, reference),
        )
        curves.append(FatigueCurve(curve, static, reference))
        for name, value in zip(made, found, strict=True):
            made[name].append(value)
    two = {name: (values[0], values[1]) for name, values in made.items()}
    sigma_F = two["sigma_F0"][0] * factors, two["sigma_F0"][1] * factors
    sigma_FG = two["sigma_FG"]
    return Root(
        b_F_mm=pair.b_F,
        eps_alphan=ratio,
        d_en_mm=(forms[0].d_en, forms[1].d_en),
        alpha_Fen_deg=(math.degrees(forms[0].alpha_Fen), math.degrees(forms[1].alpha_Fen)),
        h_Fe_mm=(forms[0].h_Fe, forms[1].h_Fe),
        s_Fn_mm=(forms[0].s_Fn, forms[1].s_Fn),
        rho_F_mm=(forms[0].rho_F, forms[1].rho_F),
        q_s=(forms[0].q_s, forms[1].q_s),
        f_eps=f_eps,
        Y_F=two["Y_F"],
        Y_S=two["Y_S"],
        Y_beta=Y_beta,
        Y_B=two["Y_B"],
        Y_DT=Y_DT,
        sigma_F0_MPa=two["sigma_F0"],
        sigma_F_MPa=sigma_F,
        sigma_F_lim_MPa=(strengths[0].sigma_F_lim, strengths[1].sigma_F_lim),
        Y_NT=two["Y_NT"],
        rho_slip_mm=two["rho"],
        Y_delta_rel_T=two["Y_delta"],
        Y_R_rel_T=two["Y_R"],
        Y_X=two["Y_X"],
        Y_M=(strengths[0].alternating, strengths[1].alternating),
        sigma_FG_MPa=sigma_FG,
        sigma_FP_MPa=(sigma_FG[0] / load.root_safety, sigma_FG[1] / load.root_safety),
        S_F=(sigma_FG[0] / sigma_F[0], sigma_FG[1] / sigma_F[1]),
        curves=(curves[0], curves[1]),
    )
