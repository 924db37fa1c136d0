r"""Allowable stress numbers and groups of materials, ISO 6336-5:2016, Table 1.

:math:`\sigma_{H\,lim},\ \sigma_{F\,lim} = A\,x + B` for the surface hardness x in HBW or HV, within the range of the
row. The table was compared entry by entry with a second program that quotes it.

The bending number of case-hardened steel of grade MQ depends on the hardness of the core. It is 425 (at least 25 HRC),
461 (at least 25 HRC and 28 HRC in the Jominy test at 12 mm) or 500 N/mm^2 (at least 30 HRC). Induction-hardened steel
of grade MQ has 0.138 x + 290 up to 570 HV and 369 N/mm^2 from there to 615 HV.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...base.errors import InputError
from ...base.tables.rating import CORES, GRADES, MATERIALS

#: Stresses: of contact and of bending.
CONTACT, BENDING = "contact", "bending"


@dataclass(frozen=True)
class Row:
    """A row of the table: A, B, the hardness scale, and the ends of its range."""

    A: float
    B: float
    scale: str
    low: float
    high: float

    def at(self, hardness: float) -> float:
        """Stress number (N/mm^2) at a hardness."""
        return self.A * hardness + self.B


def _rows(scale: str, contact: str, bending: str) -> dict[str, dict[str, Row]]:
    """Rows of a material by stress and grade, written as ``A B low high`` for ML, MQ and ME, parted by commas."""

    def of(text: str) -> dict[str, Row]:
        numbers = [[float(word) for word in row.split()] for row in text.split(",")]
        return {grade: Row(a, b, scale, low, high) for grade, (a, b, low, high) in zip(GRADES, numbers, strict=True)}

    return {CONTACT: of(contact), BENDING: of(bending)}


#: Material -> stress -> grade -> row.
TABLE: dict[str, dict[str, dict[str, Row]]] = {
    "St": _rows(
        "HBW",
        "1.000 190 110 210, 1.000 190 110 210, 1.520 250 110 210",
        "0.455 69 110 210, 0.455 69 110 210, 0.386 147 110 210",
    ),
    "St_cast": _rows(
        "HBW",
        "0.986 131 140 210, 0.986 131 140 210, 1.143 237 140 210",
        "0.313 62 140 210, 0.313 62 140 210, 0.254 137 140 210",
    ),
    "GTS": _rows(
        "HBW",
        "1.371 143 135 250, 1.371 143 135 250, 1.333 267 175 250",
        "0.345 77 135 250, 0.345 77 135 250, 0.403 128 175 250",
    ),
    "GGG": _rows(
        "HBW",
        "1.434 211 175 300, 1.434 211 175 300, 1.500 250 200 300",
        "0.350 119 175 300, 0.350 119 175 300, 0.380 134 200 300",
    ),
    "GG": _rows(
        "HBW",
        "1.033 132 150 240, 1.033 132 150 240, 1.465 122 175 275",
        "0.256 8 150 240, 0.256 8 150 240, 0.200 53 175 275",
    ),
    "V_carbon": _rows(
        "HV",
        "0.963 283 135 210, 0.925 360 135 210, 0.838 432 135 210",
        "0.250 108 115 215, 0.240 163 115 215, 0.283 202 115 215",
    ),
    "V": _rows(
        "HV",
        "1.313 188 200 360, 1.313 373 200 360, 2.213 260 200 390",
        "0.423 104 200 360, 0.425 187 200 360, 0.358 231 200 390",
    ),
    "V_cast_carbon": _rows(
        "HV",
        "0.831 300 130 215, 0.831 300 130 215, 0.951 345 130 215",
        "0.224 117 130 215, 0.224 117 130 215, 0.286 167 130 215",
    ),
    "V_cast": _rows(
        "HV",
        "1.276 298 200 360, 1.276 298 200 360, 1.350 356 200 360",
        "0.364 161 200 360, 0.364 161 200 360, 0.356 186 200 360",
    ),
    "Eh": _rows("HV", "0 1300 600 800, 0 1500 660 800, 0 1650 660 800", "0 312 600 800, 0 425 660 800, 0 525 660 800"),
    "IF": _rows(
        "HV",
        "0.740 602 485 615, 0.541 882 500 615, 0.505 1013 500 615",
        "0.305 76 485 615, 0.138 290 500 570, 0.271 237 500 615",
    ),
    "NT": _rows("HV", "0 1125 650 900, 0 1250 650 900, 0 1450 650 900", "0 270 650 900, 0 420 650 900, 0 468 650 900"),
    "NV": _rows("HV", "0 788 450 650, 0 998 450 650, 0 1217 450 650", "0 258 450 650, 0 363 450 650, 0 432 450 650"),
    "NV_nitrocar": _rows(
        "HV", "0 650 300 650, 1.167 425 300 450, 1.167 425 300 450", "0 224 300 650, 0.653 94 300 450, 0.653 94 300 450"
    ),
}
TABLE["GGG_ferritic"] = TABLE["GGG"]
#: Bending numbers (N/mm^2) of case-hardened steel of grade MQ by the hardness of its core.
CORE = {"25": 425.0, "25_jominy": 461.0, "30": 500.0}
#: Bending number (N/mm^2) of induction-hardened steel of grade MQ from this hardness (HV) on, up to another.
INDUCTION = (570.0, 369.0, 615.0)

#: Materials whose surface is harder than their core.
SURFACE_HARDENED = ("Eh", "IF", "NT", "NV", "NV_nitrocar")
#: Grey and ferritic nodular cast iron.
SOFT_IRON = ("GG", "GGG_ferritic")
#: Normalised steel.
NORMALISED = ("St", "St_cast")


def stress_number(
    material: str, stress: str, grade: str, hardness: float | None, *, core: str = "25", field: str = "hardness"
) -> float:
    """Return the allowable stress number of a material, ISO 6336-5:2016, Table 1 (N/mm^2).

    Parameters
    ----------
    material : str
        Key of `TABLE`.
    stress : str
        ``contact`` or ``bending``.
    grade : str
        ML, MQ or ME.
    hardness : float, optional
        Of the surface, in the scale of the row; not needed where the number does not depend on it.
    core : str
        Key of `CORE`, for bending of case-hardened steel of grade MQ.
    field : str
        What gives the hardness, for messages.

    Raises
    ------
    InputError
        For an unknown material or grade, and a hardness out of the range of the row, or a missing one.
    """
    for name, value, known in (("material", material, MATERIALS), ("grade", grade, GRADES), ("core", core, CORES)):
        if value not in known:
            raise InputError(name, value, "must be one of " + ", ".join(known), "see docs/rating.md")
    row = TABLE[material][stress][grade]
    high = INDUCTION[2] if (material, grade) == ("IF", "MQ") else row.high
    what = "contact" if stress == CONTACT else "bending"
    if hardness is None:
        if row.A:
            problem = f"is required: the {what} number of {material} of grade {grade} depends on it"
            raise InputError(field, None, problem, f"give {row.low:g} to {high:g} {row.scale}, or the number itself")
    elif not row.low <= hardness <= high:
        problem = f"must be {row.low:g} to {high:g} {row.scale} for the {what} number of {material} of grade {grade}"
        raise InputError(field, hardness, problem, "give the stress number itself for other hardness")
    if stress == BENDING and (material, grade) == ("Eh", "MQ"):
        return CORE[core]
    if stress == BENDING and (material, grade) == ("IF", "MQ") and hardness is not None and hardness > INDUCTION[0]:
        return INDUCTION[1]
    return row.at(hardness or 0.0)
