"""Numbers of the planes in the arrays of the series, and of the kinds of force."""

from __future__ import annotations

#: Planes of the body series: j theta_j, sine, cosine, the sums A and B.
DT, SN, CS, AS, BS = 0, 1, 2, 3, 4
#: Planes of the series of moving lines: normal, distance vector, reaction.
NX, NY, DX, DY, FX, FY = 0, 1, 2, 3, 4, 5
#: Planes of the series of springs: span, length, 1 / length, tension / length.
EX, EY, EL, EI, EF = 0, 1, 2, 3, 4
#: Kinds of force (the fourth is a moment).
SPRING, LINEAR, LOAD = 0, 1, 2

NAMES = {
    "DT": DT, "SN": SN, "CS": CS, "AS": AS, "BS": BS,
    "NX": NX, "NY": NY, "DX": DX, "DY": DY, "FX": FX, "FY": FY,
    "EX": EX, "EY": EY, "EL": EL, "EI": EI, "EF": EF,
    "SPRING": SPRING, "LINEAR": LINEAR, "LOAD": LOAD,
}  # fmt: skip
