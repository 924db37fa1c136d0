"""Units of REXS files, converted in decimal arithmetic and rounded to a float once.

A number of a file is a decimal text. It is multiplied by an exact ratio of units, with 60 digits where that ratio has
pi, and only the result is rounded. So a number that was written with enough digits comes back as the same float.
"""

from __future__ import annotations

import decimal
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

from ....base.errors import InputError, nearest

_DIGITS = decimal.Context(prec=60)
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640629")
#: Digits of a number that is written: as many as its float needs, and at most these.
_FEWEST, _MOST = 15, 40


class Unit(NamedTuple):
    """Quantity that a unit is of, and its size in the SI unit: factor times pi to a power."""

    quantity: str
    factor: Fraction
    pi: int = 0


def _decimal(text: str) -> Fraction:
    return Fraction(text)


#: Name -> unit. Older versions write N / mm^2 and the degree sign; the names of job keys are beside those of REXS.
UNITS: dict[str, Unit] = {
    "none": Unit("number", Fraction(1)),
    "%": Unit("number", Fraction(1, 100)),
    "mm": Unit("length", _decimal("1e-3")),
    "mum": Unit("length", _decimal("1e-6")),
    "um": Unit("length", _decimal("1e-6")),
    "µm": Unit("length", _decimal("1e-6")),
    "m": Unit("length", Fraction(1)),
    "mm^2": Unit("area", _decimal("1e-6")),
    "m^2": Unit("area", Fraction(1)),
    "deg": Unit("angle", Fraction(1, 180), 1),
    "°": Unit("angle", Fraction(1, 180), 1),
    "rad": Unit("angle", Fraction(1)),
    "1 / min": Unit("angular velocity", Fraction(1, 30), 1),
    "rad / s": Unit("angular velocity", Fraction(1)),
    "N": Unit("force", Fraction(1)),
    "kN": Unit("force", Fraction(1000)),
    "N m": Unit("torque", Fraction(1)),
    "N mm": Unit("torque", _decimal("1e-3")),
    "kN m": Unit("torque", Fraction(1000)),
    "W": Unit("power", Fraction(1)),
    "kW": Unit("power", Fraction(1000)),
    "N / m": Unit("stiffness", Fraction(1)),
    "N / mm": Unit("stiffness", Fraction(1000)),
    "N / (mm mum)": Unit("stress", Fraction(10**9)),
    "N / rad": Unit("force per angle", Fraction(1)),
    "(N / mm^2)^0.5": Unit("root of a stress", Fraction(1000)),
    "kg / mm": Unit("mass per length", Fraction(1000)),
    "m / s": Unit("velocity", Fraction(1)),
    "N m / rad": Unit("tilt stiffness", Fraction(1)),
    "N mm / rad": Unit("tilt stiffness", _decimal("1e-3")),
    "Pa": Unit("stress", Fraction(1)),
    "MPa": Unit("stress", Fraction(10**6)),
    "N / mm^2": Unit("stress", Fraction(10**6)),
    "GPa": Unit("stress", Fraction(10**9)),
    "kg": Unit("mass", Fraction(1)),
    "g": Unit("mass", _decimal("1e-3")),
    "mg": Unit("mass", _decimal("1e-6")),
    "kg m^2": Unit("inertia", Fraction(1)),
    "kg / dm^3": Unit("density", Fraction(1000)),
    "kg / m^3": Unit("density", Fraction(1)),
    "mm^2 / s": Unit("kinematic viscosity", _decimal("1e-6")),
    "mPa s": Unit("dynamic viscosity", _decimal("1e-3")),
    "C": Unit("temperature", Fraction(1)),
    "K": Unit("temperature difference", Fraction(1)),
    "s": Unit("time", Fraction(1)),
    "h": Unit("time", Fraction(3600)),
    "Hz": Unit("frequency", Fraction(1)),
}


def check_unit(name: str, known: str, where: str) -> None:
    """Raise `InputError` unless a unit is known and measures what the unit of the schema measures.

    Parameters
    ----------
    name
        Unit in the file.
    known
        Unit of the attribute in the schema.
    where
        Component and attribute, for the message.
    """
    if name == known:
        return
    expected = UNITS.get(known)
    cure = f"write it in {known}" if known != "none" else 'write unit="none"'
    if name not in UNITS:
        problem = f"is no unit of REXS: must be one of {known}" if expected is None else "is no unit of REXS"
        near = nearest(name, UNITS) if name else ""
        raise InputError(f"unit of {where}", name, problem, near or cure)
    if expected is None or UNITS[name].quantity != expected.quantity:
        of = "nothing" if expected is None else f"a {expected.quantity}"
        problem = f"is a unit of {UNITS[name].quantity}: the attribute is {of} in {known}"
        raise InputError(f"unit of {where}", name, problem, cure)


def converted(number: Decimal, unit: str, target: str) -> float:
    """Return a number of one unit as a float in another unit of the same quantity."""
    return float(_scaled(number, unit, target))


def written(number: float, unit: str, target: str) -> str:
    """Return the shortest decimal text in a target unit that `converted` turns back into the same float."""
    exact = Decimal(repr(float(number)))
    scaled = _scaled(exact, unit, target)
    for digits in range(_FEWEST, _MOST):
        text = decimal.Context(prec=digits).plus(scaled)
        if converted(text, target, unit) == float(number):
            return _plain(text)
    return _plain(scaled)


def _scaled(number: Decimal, unit: str, target: str) -> Decimal:
    if unit == target:
        return number
    one, two = UNITS[unit], UNITS[target]
    ratio, pi = one.factor / two.factor, one.pi - two.pi
    if ratio == 1 and not pi:
        return number
    scaled = _DIGITS.divide(_DIGITS.multiply(number, Decimal(ratio.numerator)), Decimal(ratio.denominator))
    return _DIGITS.multiply(scaled, _PI) if pi > 0 else _DIGITS.divide(scaled, _PI) if pi < 0 else scaled


def _plain(number: Decimal) -> str:
    """Format a number for other programs: with a point, and a power of ten if it is large or small."""
    text = f"{number.normalize():f}" if number and abs(number.adjusted()) < 16 else f"{number.normalize():E}"
    return text if any(mark in text for mark in ".E") else f"{text}.0"
