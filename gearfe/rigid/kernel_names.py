"""Names of the places in the kernels' arrays."""

from __future__ import annotations

#: Factors of a form, `Forms.factor`.
KX, KY, KT, KC, KS = range(5)
#: Ends of a vector, `Vectors.end`: weight of the mass centre, components of the arm.
EW, EX, EY = range(3)
#: Columns of `Forces.spring` and, but for the last, of `Forces.along`.
STIFFNESS, DAMPING, FREE_LENGTH = range(3)
#: Taylor coefficients of the bodies: j theta_j, sine, cosine, and the sums A and B of the torques s A + c B.
DT, SN, CS, AS, BS = range(5)
#: Taylor coefficients of the vectors: components.
VX, VY = range(2)
#: Taylor coefficients of the springs: length, 1 / length, tension / length.
LENGTH, INVERSE, PULL = range(3)
#: State of a run: time, singular rows there, time to the next singular position, 1 once begun, last step, row of the
#: next singular position (-1 for none).
TIME, SINGULAR, AHEAD, BEGUN, LAST_STEP, ROW = range(6)

NAMES = {
    "KX": KX, "KY": KY, "KT": KT, "KC": KC, "KS": KS,
    "EW": EW, "EX": EX, "EY": EY,
    "STIFFNESS": STIFFNESS, "DAMPING": DAMPING, "FREE_LENGTH": FREE_LENGTH,
    "DT": DT, "SN": SN, "CS": CS, "AS": AS, "BS": BS,
    "VX": VX, "VY": VY,
    "LENGTH": LENGTH, "INVERSE": INVERSE, "PULL": PULL,
    "TIME": TIME, "SINGULAR": SINGULAR, "AHEAD": AHEAD, "BEGUN": BEGUN, "LAST_STEP": LAST_STEP, "ROW": ROW,
}  # fmt: skip
