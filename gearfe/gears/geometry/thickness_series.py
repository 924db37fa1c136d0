"""Tooth thickness allowances by DIN 3967:1978: upper allowance A_sne of a series a to h, tolerance T_sn of 21 to 30.

A designation as cd25 gives A_sne and A_sni = A_sne - T_sn by the reference diameter (Tables 1 and 2).
"""

from __future__ import annotations

import re

from ...base.errors import InputError

#: Series of allowances and of tolerances, in the order of the columns.
SERIES = ("a", "ab", "b", "bc", "c", "cd", "d", "e", "f", "g", "h")
TOLERANCES = tuple(range(21, 31))
#: Upper end of the range of reference diameters (mm) -> -A_sne (um) of the series, and T_sn (um) of the tolerances.
TABLE = {
    10.0: ("100 85 70 58 48 40 33 22 10 5 0", "3 5 8 12 20 30 50 80 130 200"),
    50.0: ("135 110 95 75 65 54 44 30 14 7 0", "5 8 12 20 30 50 80 130 200 300"),
    125.0: ("180 150 125 105 85 70 60 40 19 9 0", "6 10 16 25 40 60 100 160 250 400"),
    280.0: ("250 200 170 140 115 95 80 56 26 12 0", "8 12 20 30 50 80 130 200 300 500"),
    560.0: ("330 280 230 190 155 130 110 75 35 17 0", "10 16 25 40 60 100 160 250 400 600"),
    1000.0: ("450 370 310 260 210 175 145 100 48 22 0", "12 20 30 50 80 130 200 300 500 800"),
    1600.0: ("600 500 420 340 290 240 200 135 64 30 0", "16 25 40 60 100 160 250 400 600 1000"),
    2500.0: ("820 680 560 460 390 320 270 180 85 41 0", "20 30 50 80 130 200 300 500 800 1300"),
    4000.0: ("1100 920 760 620 520 430 360 250 115 56 0", "25 40 60 100 160 250 400 600 1000 1600"),
    6300.0: ("1500 1250 1020 840 700 580 480 330 155 75 0", "30 50 80 130 200 300 500 800 1300 2000"),
    10000.0: ("2000 1650 1350 1150 940 780 640 450 210 100 0", "40 60 100 160 250 400 600 1000 1600 2400"),
}


def thickness_allowances(series: str, diameter_mm: float, field: str = "thickness_series") -> tuple[float, float]:
    """Return upper and lower allowance (um) of the normal tooth thickness.

    Parameters
    ----------
    series : str
        Designation, as cd25 or 25cd.
    diameter_mm : float
        Reference diameter, without sign.
    field : str
        Key that has the series, for messages.

    Raises
    ------
    InputError
        For a series that DIN 3967 does not have, and diameters above 10 m.
    """
    parts = re.fullmatch(r"([a-h]{1,2})\s*(\d\d)|(\d\d)\s*([a-h]{1,2})", series.strip())
    letters, number = ("", 0) if parts is None else (parts[1] or parts[4], int(parts[2] or parts[3]))
    if letters not in SERIES or number not in TOLERANCES:
        problem = f"must be one of {', '.join(SERIES)} with a tolerance from 21 to 30 (DIN 3967)"
        raise InputError(field, series, problem, 'write for example "cd25"')
    row = next((columns for end, columns in TABLE.items() if diameter_mm <= end), None)
    if row is None:
        problem = f"is for reference diameters up to 10 m, not {diameter_mm:.6g} mm"
        raise InputError(field, series, problem, "write thickness_allowances_um")
    upper = -float(row[0].split()[SERIES.index(letters)])
    return upper, upper - float(row[1].split()[TOLERANCES.index(number)])
