"""Words and units of column names."""

from __future__ import annotations

import math

import pytest

from gearfe.base.quantities import UNITS, label, parted, scaled, unit_of, words


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("k_mesh_N_per_m", "mesh stiffness (N/m)"),
        ("transmission_error_2_um", "transmission error of mesh 2 (µm)"),
        ("speed_out_rad_per_s", 'speed of shaft "out" (rad/s)'),
        ("speed_absolute_in_rad_per_s", 'absolute speed of shaft "in" (rad/s)'),
        ("speed_rad_per_s", "speed of the drive (rad/s)"),
        ("acceleration_out_rad_per_s2", 'angular acceleration of shaft "out" (rad/s²)'),
        ("acceleration_rms_A_m_per_s2", 'rms acceleration at attachment "A" (m/s²)'),
        ("attachment_a_b_acceleration_m_per_s2", 'acceleration at attachment "a_b" (m/s²)'),
        ("bearing_5_moment_z_Nm", 'moment on bearing "5" along z (N m)'),
        ("radiated_power_level_dBA", "radiated power (dB(A))"),
        ("a_x_A_m_per_s2", "a x A (m/s²)"),
        ("status", "status"),
    ],
)
def test_labels(column: str, text: str) -> None:
    assert label(column) == text


def test_the_longest_unit_wins_and_a_name_alone_has_none() -> None:
    assert parted("k_mesh_N_per_m") == ("k_mesh", UNITS["N_per_m"])
    assert parted("length_m")[1].quantity == "length"
    assert parted("m") == ("m", unit_of("m"))
    assert unit_of("m").quantity == "number"


def test_units_lead_to_si() -> None:
    """Factors of the SI brochure; each unit's SI unit is known and has the factor 1 and the same quantity."""
    for unit in UNITS.values():
        si = UNITS[unit.si]
        assert (si.factor, si.quantity) == (1.0, unit.quantity), unit.key
    assert UNITS["deg"].factor == pytest.approx(math.pi / 180.0, rel=1e-15)
    assert UNITS["rpm"].factor == pytest.approx(math.pi / 30.0, rel=1e-15)
    assert [UNITS[key].factor for key in ("um", "MPa", "N_per_um", "ms")] == [1e-6, 1e6, 1e6, 1e-3]


def test_large_numbers_get_larger_units() -> None:
    assert scaled("k_mesh_N_per_m", 1e8) == ("mesh stiffness (N/µm)", 1e-6)
    assert scaled("time_s", 0.007) == ("time (ms)", 1e3)
    assert scaled("time_s", 10.0) == ("time (s)", 1.0)
    assert words("time_s") == "time"
