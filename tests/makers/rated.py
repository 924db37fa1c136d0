"""Gears and tables of published ratings: two stages of a gearbox report, and an example of a technical report.

The stages are the sun and planet, and the helical output stage, of the NREL 5 MW reference gearbox as a commercial
program rates them by ISO 6336:2006 method B (release 03/2017; reports stage_02 and stage_03 in the repository
gfsReboucas/Drivetrain). Example 1 of ISO/TR 6336-30:2017 as two open programs quote it.
"""

from __future__ import annotations

import math
from typing import Any

from gearfe import Gear, rate
from gearfe.gears.geometry.curves import inv
from gearfe.gears.geometry.mesh_geometry import MeshGeometry

ANGLE = math.radians(20.0)
#: What both stages of the report have.
STAGES: dict[str, Any] = {
    "edition": 2006,
    "life_h": 175_200.0,
    "application_factor": 1.25,
    "viscosity_40_mm2_per_s": 220.0,
    "sigma_h_lim_MPa": 1500.0,
    "sigma_f_lim_MPa": 430.0,
    "quality": 6,
    "flank_roughness_um": 4.8,
    "root_roughness_um": 20.0,
    "least_flank_safety": 1.25,
    "least_root_safety": 1.56,
}
#: Spur stage: K_v and K_Hbeta as the report prescribes them, speed relative to the carrier.
SPUR: dict[str, Any] = STAGES | {
    "torque_driver_Nm": 162_105.5,
    "speed_rpm": 294.5 - 47.8,
    "mesh_load_factor": 1.10,
    "blank_factor": 0.862,
    "dynamic_factor": 1.06,
    "face_load_factor": 2.06,
    "gears": {"pinion": {"mates": 3}, "wheel": {"alternating_factor": 0.7}},
}
#: Ring of both planetary stages: through-hardened steel, R_z 8 um.
RING: dict[str, Any] = {
    "mates": 3,
    "fixed": True,
    "material": "V",
    "hardness": 240.0 / 0.95,  # HBW 240
    "sigma_h_lim_MPa": 700.0,
    "sigma_f_lim_MPa": 290.0,
    "yield_strength_MPa": 1000.0,
    "flank_roughness_um": 8.0,
}
#: Planet and ring of the spur stage: the force of its sun, 285,900.438 N, at the planet; K_v of the report.
SPUR_RING: dict[str, Any] = STAGES | {
    "torque_driver_Nm": 285.900438 * 0.5 * 756.0,
    "speed_rpm": (294.5 - 47.8) * 18.0 / 36.0,
    "mesh_load_factor": 1.10,
    "blank_factor": 0.862,
    "dynamic_factor": 1.06,
    "face_load_factor": 1.15,
    "gears": {"pinion": {"alternating_factor": 0.7}, "wheel": RING},
}
#: Planet and ring of the first stage: sun of 19 teeth at 47.8 - 12.1 per minute with 999,650.9 N m.
FIRST_RING: dict[str, Any] = STAGES | {
    "torque_driver_Nm": 999_650.9 / 3.0 * 17.0 / 19.0,
    "speed_rpm": (47.8 - 12.1) * 19.0 / 17.0,
    "mesh_load_factor": 1.10,
    "blank_factor": 0.862,
    "dynamic_factor": 1.05,
    "face_load_factor": 1.15,
    "gears": {"pinion": {"alternating_factor": 0.7}, "wheel": RING},
}
#: Helical stage: K_Hbeta is prescribed, the gears have webs of a quarter of the width and rims of five modules.
HELICAL: dict[str, Any] = STAGES | {
    "torque_driver_Nm": 40_953.0,
    "speed_rpm": 1165.9,
    "face_load_factor": 1.15,
    "web_thickness_mm": 90.0,
    "rim_thickness_mm": 70.0,
}
#: What the report of the helical stage has for scuffing: R_a, oil at 80 C, load stage 14.
HELICAL_OIL: dict[str, Any] = {
    "flank_ra_um": 0.6,
    "oil_temperature_C": 80.0,
    "viscosity_100_mm2_per_s": 19.0,
    "oil_density_kg_per_m3": 890.0,
    "scuffing_load_stage": 14,
}
#: FZG pairs as an open program rates them by DIN 3990 B: mineral oil of class 32, polyalphaolefin of class 320; their
#: viscosities at 40 C follow from the constants of Walther's line in that program.
FZG_C14: dict[str, Any] = {
    "edition": 2006,
    "torque_driver_Nm": 200.0,
    "speed_rpm": 1500.0,
    "viscosity_40_mm2_per_s": 31.81,
}
FZG_C40: dict[str, Any] = {
    "edition": 2006,
    "torque_driver_Nm": 215.513,
    "speed_rpm": 1800.0,
    "viscosity_40_mm2_per_s": 311.57,
}
#: Pair of plastics; the rating of steel is of no use for it, its geometry is.
POLYMER: dict[str, Any] = {"edition": 2006, "torque_driver_Nm": 10.0, "speed_rpm": 1000.0}
#: Example 1: K_Hbeta is quoted, R_a 1 um is R_z 6 um.
EXAMPLE_1: dict[str, Any] = {
    "edition": 2006,
    "torque_driver_Nm": 9000.0,
    "speed_rpm": 360.0,
    "life_h": 50_000.0,
    "viscosity_40_mm2_per_s": 320.0,
    "quality": 5,
    "tip_relief_um": 70.0,
    "flank_roughness_um": 6.0,
    "sigma_h_lim_MPa": 1500.0,
    "sigma_f_lim_MPa": 500.0,
    "face_load_factor": 1.16,
}


def shift_sum(teeth: int, module: float, helix: float, distance: float) -> float:
    """Sum of the profile shifts of a centre distance, in the unit of the module."""
    transverse = math.atan(math.tan(ANGLE) / math.cos(helix))
    working = math.acos(0.5 * teeth * module / math.cos(helix) * math.cos(transverse) / distance)
    return teeth * (inv(working) - inv(transverse)) / (2.0 * math.tan(ANGLE))


def stage(
    teeth: tuple[int, int], module: float, helix_deg: float, shift: float, distance: float, **more: Any
) -> MeshGeometry:
    """Mesh of a stage (mm): rack 1.25/0.38/1.0, tips altered by ``tip_mm``, widths ``width``, bores ``bores``."""
    helix = math.radians(helix_deg)
    shifts = shift, shift_sum(sum(teeth), module, helix, distance) - shift
    gears = [
        Gear(
            z,
            1e-3 * module,
            ANGLE,
            1e-3 * more["width"],
            1e-3 * bore,
            profile_shift=x,
            rack_tip_radius=0.38,
            tip_shortening=-more["tip_mm"] / module,
            helix_angle=helix,
            hand=hand,
        )
        for z, x, bore, hand in zip(teeth, shifts, more["bores"], ("right", "left"), strict=True)
    ]
    return MeshGeometry(gears[0], gears[1], 1e-3 * distance)


def spur_stage() -> MeshGeometry:
    """Sun and planet: 18/36 teeth, module 21 mm."""
    return stage((18, 36), 21.0, 0.0, 0.3890, 584.0, width=550.0, bores=(194.32, 576.96), tip_mm=-1.750)


def helical_stage() -> MeshGeometry:
    """Output stage: 24/95 teeth, module 14 mm, 10 degrees."""
    return stage((24, 95), 14.0, 10.0, 0.4800, 861.0, width=360.0, bores=(179.10, 1193.32), tip_mm=-0.938)


def ring_stage(teeth: tuple[int, int], module: float, shift: float, distance: float, **more: Any) -> MeshGeometry:
    """Planet and ring (mm): racks 1.25/0.38 and 1.25/0.30, tips of the planet altered by ``tip_mm``.

    ``width``, ``bore`` and ``rim`` are diameters of the bodies, ``cutter`` the teeth of the ring's cutter.
    """
    planet = Gear(
        teeth[0],
        1e-3 * module,
        ANGLE,
        1e-3 * more["width"],
        1e-3 * more["bore"],
        profile_shift=shift,
        rack_tip_radius=0.38,
        tip_shortening=-more["tip_mm"] / module,
    )
    ring = Gear(
        teeth[1],
        1e-3 * module,
        ANGLE,
        1e-3 * more["width"],
        rim_diameter=1e-3 * more["rim"],
        profile_shift=shift_sum(sum(teeth), module, 0.0, -distance) - shift,
        rack_tip_radius=0.30,
        cutter_teeth=more["cutter"],
    )
    return MeshGeometry(planet, ring, 1e-3 * distance)


def spur_ring() -> MeshGeometry:
    """Planet and ring of the spur stage: 36/-93 teeth, module 21 mm."""
    return ring_stage((36, -93), 21.0, 0.5039, 584.0, width=550.0, bore=576.96, rim=2148.82, tip_mm=-1.750, cutter=30)


def first_ring() -> MeshGeometry:
    """Planet and ring of the first stage of the same gearbox: 17/-56 teeth, module 45 mm."""
    return ring_stage((17, -56), 45.0, 0.8021, 863.0, width=491.0, bore=408.99, rim=2994.24, tip_mm=-10.861, cutter=36)


def fzg(width: float) -> MeshGeometry:
    """FZG test gears of type C without tip alteration: 16/24 teeth, module 4.5 mm, a width (mm).

    The program rates the roots of all spur gears with a rack whose tip radius is 0.375 modules.
    """
    gears = [
        Gear(
            z, 4.5e-3, ANGLE, 1e-3 * width, 0.03, profile_shift=x, rack_tip_radius=0.375, addendum=tip / 4.5 - z / 2 - x
        )
        for z, x, tip in ((16, 0.1817, 41.318), (24, 0.1715, 59.272))
    ]
    return MeshGeometry(gears[0], gears[1], 91.5e-3)


def fzg_c14() -> MeshGeometry:
    """FZG type C, 14 mm wide."""
    return fzg(14.0)


def fzg_c40() -> MeshGeometry:
    """FZG type C, 40 mm wide."""
    return fzg(40.0)


def polymer_pair() -> MeshGeometry:
    """30/30 teeth, module 2 mm, 15 mm wide."""
    gear = Gear(30, 2e-3, ANGLE, 0.015, 0.02, rack_tip_radius=0.38)
    return MeshGeometry(gear, gear, 0.06)


def example_1() -> MeshGeometry:
    """Example 1 of ISO/TR 6336-30: 17/103 teeth, module 8 mm, 15.8 degrees, tip diameters as printed."""
    helix, module = math.radians(15.8), 8.0
    gears = []
    for z, x, tip, hand in zip((17, 103), (0.145, 0.0), (159.66, 872.35), ("left", "right"), strict=True):
        addendum = 0.5 * (tip / module - z / math.cos(helix)) - x
        gears.append(
            Gear(
                z,
                8e-3,
                ANGLE,
                0.1,
                0.04,
                profile_shift=x,
                addendum=addendum,
                dedendum=1.4,
                rack_tip_radius=0.39,
                helix_angle=helix,
                hand=hand,
            )
        )
    return MeshGeometry(gears[0], gears[1], 0.5)


#: As printed; K_v and K_Hbeta are prescribed with two decimals, so stresses with them have three digits.
SPUR_PRINTED: dict[str, str] = {
    "H_V": "0.149",
    "F_t_N": "285900",
    "v_m_per_s": "4.88",
    "K_Fbeta": "1.94",
    "K_Halpha": "1.00",
    "Z_H": "2.25",
    "Z_E": "189.81",
    "Z_eps": "0.936",
    "Z_beta": "1.000",
    "Z_BD": "1.08 1.00",
    "sigma_H0_MPa": "573.40",
    "Z_L": "1.020",
    "Z_v": "0.982",
    "Z_R": "1.007",
    "Z_W": "1.000 1.000",
    "Z_NT": "0.857 0.905",
    "Z_X": "1.000 1.000",
    "sigma_HG_MPa": "1295.42 1368.61",
    "sigma_HP_MPa": "1036.34 1094.89",
    "sigma_H_MPa": "1071.17 994.13",
    "S_H": "1.21 1.38",
    "alpha_Fen_deg": "25.74 24.68",
    "d_en_mm": "408.342 794.110",
    "h_Fe_mm": "24.33 25.73",
    "s_Fn_mm": "44.78 47.70",
    "rho_F_mm": "9.52 8.69",
    "Y_F": "1.47 1.38",
    "Y_S": "2.04 2.18",
    "Y_beta": "1.00",
    "Y_B": "1.00 1.00",
    "Y_DT": "1.00",
    "sigma_F0_MPa": "73.95 74.21",
    "sigma_F_MPa": "209.38 210.14",
    "Y_delta_rel_T": "0.999 1.002",
    "Y_R_rel_T": "0.957 0.957",
    "Y_X": "0.840 0.840",
    "Y_NT": "0.854 0.886",
    "Y_M": "1.000 0.700",
    "sigma_FG_MPa": "589.60 429.38",
    "sigma_FP_MPa": "377.95 275.24",
    "S_F": "2.82 2.04",
}

HELICAL_PRINTED: dict[str, str] = {
    "H_V": "0.106",
    "F_t_N": "240064",
    "v_m_per_s": "20.83",
    "C_R": "0.898",
    "c_prime_N_per_mm_um": "13.832",
    "c_gamma_alpha_N_per_mm_um": "18.632",
    "c_gamma_beta_N_per_mm_um": "15.837",
    "y_p_um": "1.2",
    "C_a_um": "2.0",
    "m_red_kg_per_mm": "0.36503",
    "n_E1_per_min": "2843",
    "N": "0.410",
    "K_v": "1.092",
    "K_Halpha": "1.069",
    "K_Falpha": "1.069",
    "Z_H": "2.307",
    "Z_E": "189.812",
    "Z_eps": "0.827",
    "Z_beta": "1.008",
    "sigma_H0_MPa": "570.79",
    "sigma_H_MPa": "739.61 739.61",
    "Z_BD": "1.00 1.00",
    "Z_L": "1.020",
    "Z_v": "1.022",
    "Z_R": "1.007",
    "Z_NT": "0.850 0.881",
    "sigma_HG_MPa": "1338.30 1387.31",
    "sigma_HP_MPa": "1070.64 1109.85",
    "S_H": "1.81 1.88",
    "d_en_mm": "369.487 1415.619",
    "s_Fn_mm": "31.18 32.75",
    "rho_F_mm": "5.95 5.39",
    "q_s": "2.620 3.036",
    "Y_F": "1.18 1.24",
    "Y_beta": "0.917",
    "Y_delta_rel_T": "1.001 1.005",
    "Y_R_rel_T": "0.957 0.957",
    "Y_X": "0.910 0.910",
    "Y_NT": "0.850 0.870",
    "sigma_FG_MPa": "637.15 654.72",
    "sigma_FP_MPa": "408.43 419.69",
    "S_F": "3.26 3.09",
}

EXAMPLE_PRINTED: dict[str, str] = {
    "F_t_N": "127352",
    "v_m_per_s": "2.664",
    "c_prime_N_per_mm_um": "12.37047",
    "K_v": "1.003",
    "K_Halpha": "1.0",
    "K_Falpha": "1.0",
    "Z_H": "2.39533",
    "Z_E": "189.81170",
    "Z_eps": "0.803",
    "Z_beta": "1.01944",
    "Z_BD": "1.0 1.0",
    "sigma_H0_MPa": "1206.58207",
    "Z_L": "1.04739",
    "Z_v": "0.96911",
    "Z_R": "0.96599",
    "Z_NT": "0.91 0.962",
    "sigma_HP_MPa": "1338.48050 1414.52551",
    "K_Fbeta": "1.12803",
    "sigma_H_MPa": "1301.35343 1301.35343",
    "S_H": "1.02853 1.08696",
}

#: Values of the helical stage that differ by more than their digits; the test says why.
HELICAL_LOOSE: dict[str, str] = {
    "alpha_Fen_deg": "23.89 22.20",
    "h_Fe_mm": "14.06 16.11",
    "Y_S": "2.28 2.35",
    "sigma_F0_MPa": "117.92 127.69",
    "sigma_F_MPa": "195.64 211.85",
    "K_Fbeta": "1.136",
}

#: Scuffing of the helical stage as printed: factors of both methods, the scuffing temperature, and all of the integral.
HELICAL_SCUFFING: dict[str, str] = {
    "K_Bgamma": "1.274",
    "eta_oil_mPa_s": "30.09",
    "C_eff_um": "44.74",
    "Gamma_A": "-0.379",
    "Gamma_E": "0.529",
    "X_alphabeta": "1.016",
    "X_L": "0.843",
    "theta_S_C": "451.98",
    "X_BE": "0.230",
    "X_eps": "0.263",
    "X_Q": "1.000",
    "X_Ca": "1.095",
    "mu_mC": "0.030",
    "theta_flaint_K": "16.25",
    "theta_int_C": "115.75",
    "theta_Sint_C": "455.17",
    "S_intS": "3.932",
}
#: Values that differ by more than their digits: w_Bt has K_v of four digits, X_M has B_M 13.780, and rounding.
HELICAL_SCUFFING_LOOSE: dict[str, str] = {
    "w_Bt_N_per_mm": "1119.632",
    "X_M": "50.058",
    "theta_MC_C": "91.37",
    "mu_m": "0.041",
}


def helical_flash() -> dict[str, Any]:
    """Return what all printed flash temperatures of the helical stage have in common, as keys of its rating.

    These are X_R = 0.6^0.25 twice in the friction, as if R_a were the product of both roughnesses, B_M 13.795 for the
    printed 13.780, and w_Bt as printed, by K_v.
    """
    rating = rate(helical_stage(), HELICAL | HELICAL_OIL)
    assert rating.scuffing is not None
    return HELICAL | HELICAL_OIL | {
        "friction_coefficient": rating.scuffing.mu_m * 0.6**0.25,
        "thermal_contact_N_per_mm_m05_s05_K": 13.795,
        "dynamic_factor": rating.general.K_v * 1119.632 / rating.scuffing.w_Bt_N_per_mm,
    }  # fmt: skip


HELICAL_FLASH_PRINTED: dict[str, str] = {
    "mu_m": "0.041",
    "theta_flm_K": "30.20",
    "theta_M_C": "94.19",
    "theta_B_C": "169.50",
    "S_B": "4.156",
}

#: Planet and ring of the spur stage as printed.
SPUR_RING_PRINTED: dict[str, str] = {
    "c_prime_N_per_mm_um": "14.053",
    "c_gamma_alpha_N_per_mm_um": "20.563",
    "y_p_um": "3.142",
    "K_Fbeta": "1.14",
    "K_Halpha": "1.00",
    "Z_H": "2.85",
    "Z_E": "189.81",
    "Z_eps": "0.891",
    "Z_BD": "1.00 1.00",
    "sigma_H0_MPa": "312.44",
    "sigma_H_MPa": "404.76 404.76",
    "Z_L": "1.038",
    "Z_v": "0.961",
    "Z_R": "1.026",
    "Z_W": "1.000 1.135",
    "Z_NT": "0.905 0.901",
    "sigma_HG_MPa": "1388.39 732.21",
    "S_H": "3.43 1.81",
    "alpha_Fen_deg": "22.21 18.63",
    "h_Fe_mm": "18.48 30.32",
    "s_Fn_mm": "47.70 56.76",
    "rho_F_mm": "8.69 8.78",
    "Y_F": "1.01 1.20",
    "Y_S": "2.48 2.34",
    "sigma_F0_MPa": "61.98 69.12",
    "sigma_F_MPa": "102.77 114.61",
    "Y_delta_rel_T": "1.002 1.005",
    "Y_R_rel_T": "0.957 0.957",
    "Y_X": "0.840 0.904",
    "Y_NT": "0.886 0.883",
    "sigma_FG_MPa": "429.38 444.89",
    "S_F": "4.18 3.88",
}

#: Planet and ring of the first stage as printed.
FIRST_RING_PRINTED: dict[str, str] = {
    "c_prime_N_per_mm_um": "13.289",
    "c_gamma_alpha_N_per_mm_um": "16.063",
    "y_p_um": "5.419",
    "K_Fbeta": "1.12",
    "K_Halpha": "1.00",
    "Z_H": "2.71",
    "Z_eps": "0.952",
    "Z_BD": "1.00 1.00",
    "sigma_H0_MPa": "588.62",
    "sigma_H_MPa": "758.46 758.46",
    "Z_L": "1.038",
    "Z_v": "0.916",
    "Z_R": "1.025",
    "Z_W": "1.000 1.135",
    "Z_NT": "0.937 0.940",
    "sigma_HG_MPa": "1368.95 727.36",
    "S_H": "1.80 0.96",
    "alpha_Fen_deg": "29.87 19.59",
    "h_Fe_mm": "49.53 78.40",
    "s_Fn_mm": "104.13 129.40",
    "rho_F_mm": "17.19 22.24",
    "Y_F": "1.14 1.27",
    "Y_S": "2.38 2.13",
    "sigma_F0_MPa": "95.70 95.32",
    "sigma_F_MPa": "154.50 153.89",
    "Y_delta_rel_T": "1.005 1.003",
    "Y_R_rel_T": "0.957 0.957",
    "Y_X": "0.800 0.850",
    "Y_NT": "0.906 0.907",
    "sigma_FG_MPa": "419.35 429.14",
    "S_F": "2.71 2.79",
}

#: FZG pairs as printed.
FZG_C14_PRINTED: dict[str, str] = {
    "H_V": "0.1986",
    "Z_E": "189.812",
    "Z_H": "2.342",
    "Z_eps": "0.920",
    "Z_beta": "1.000",
    "Z_L": "0.922",
    "Z_v": "0.985",
    "Y_beta": "1.000",
    "Y_delta_rel_T": "0.994 0.996",
    "Y_R_rel_T": "0.957 0.957",
    "Y_F": "1.689 1.583",
    "Y_S": "1.851 1.917",
}
FZG_C40_PRINTED: dict[str, str] = FZG_C14_PRINTED | {"Z_L": "1.045", "Z_v": "0.990"}
#: Values that differ: the force at the working circle.
FZG_C14_LOOSE: dict[str, str] = {"sigma_H0_MPa": "1228.89"}
FZG_C40_LOOSE: dict[str, str] = {"sigma_H0_MPa": "754.69"}
POLYMER_PRINTED: dict[str, str] = {"H_V": "0.1494"}
