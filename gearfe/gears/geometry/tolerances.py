r"""Tolerances of gears by class: ISO 1328-1:2013, and ISO 1328-1:1995 for reports by that edition.

The reference diameter d, the normal module m and the face width b are in mm, A is the class, and the tolerances are in
um (ISO 1328-1:2013, 5.3, formulae 5 to 14, and annex for the run-out):

.. math::
    f_{pT} = 0.001\,d + 0.4\,m + 5, \quad F_{pT} = 0.002\,d + 0.55\sqrt{d} + 0.7\,m + 12, \quad F_{rT} = 0.9\,F_{pT}, \\
    f_{H\alpha T} = 0.001\,d + 0.4\,m + 4, \quad f_{f\alpha T} = 0.55\,m + 5, \quad
    F_{\alpha T} = \sqrt{f_{H\alpha T}^2 + f_{f\alpha T}^2}, \\
    f_{H\beta T} = 0.05\sqrt d + 0.35\sqrt b + 4, \quad f_{f\beta T} = 0.07\sqrt d + 0.45\sqrt b + 4, \quad
    F_{\beta T} = \sqrt{f_{H\beta T}^2 + f_{f\beta T}^2},

each times :math:`\sqrt2^{\,A-5}`. They hold for 5 to 1000 teeth, d from 5 to 15,000 mm, m from 0.5 to 70 mm, b from 4
to 1200 mm, and are not extrapolated (5.2.1).

ISO 1328-1:1995 (and ISO 1328-2:1997 for the run-out) has, with the geometric means of the ends of the ranges that hold
d, m and b (`RANGES`) and the accuracy grade Q,

.. math::
    f_{pt} = 0.3\,(m + 0.4\sqrt d) + 4, \quad F_p = 0.3\,m + 1.25\sqrt d + 7, \quad F_r = 0.8\,F_p, \\
    f_{H\alpha} = 2\sqrt m + 0.14\sqrt d + 0.5, \quad f_{f\alpha} = 2.5\sqrt m + 0.17\sqrt d + 0.5, \quad
    F_\alpha = 3.2\sqrt m + 0.22\sqrt d + 0.7, \\
    f_{H\beta} = f_{f\beta} = 0.07\sqrt d + 0.45\sqrt b + 3, \quad F_\beta = 0.1\sqrt d + 0.63\sqrt b + 4.2,

each times :math:`\sqrt2^{\,Q-5}`. Checked against the values of a published report (tests/gears/test_tolerances.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from ...base.errors import InputError
from .spur_gear import Gear

#: Classes of ISO 1328-1:2013, and accuracy grades of ISO 1328-1:1995.
CLASSES, GRADES = (1, 11), (0, 12)
#: Editions.
EDITIONS = (1995, 2013)
#: Teeth, diameters (mm) and modules (mm) that ISO 1328-1:2013 is for.
SCOPE = ((5, 1000), (5.0, 15_000.0), (0.5, 70.0))
#: Face widths (mm) that its tolerances of the helix are for.
WIDTHS = (4.0, 1200.0)
#: Ends (mm) of the ranges of ISO 1328-1:1995 for diameter, module and face width.
RANGES: dict[str, tuple[float, ...]] = {
    "pitch_diameter_mm": (5, 20, 50, 125, 280, 560, 1000, 1600, 2500, 4000, 6000, 8000, 10000),
    "module_mm": (0.5, 2, 3.5, 6, 10, 16, 25, 40, 70),
    "face_width_mm": (4, 10, 20, 40, 80, 160, 250, 400, 650, 1000),
}


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of pitch, profile and run-out, not rounded (m).

    Attributes
    ----------
    single, cumulative
        Single and cumulative (total) pitch, f_p and F_p.
    slope, form, total
        Of the profile, f_Halpha, f_falpha, F_alpha.
    run_out
        F_r.
    """

    single: float
    cumulative: float
    slope: float
    form: float
    total: float
    run_out: float

    @property
    def rounded_um(self) -> dict[str, float]:
        """All of them by the standard's names, rounded by its rules (5.2.3), in um."""
        return {SYMBOLS[name]: rounded(1e6 * value) for name, value in _plain(self).items()}


@dataclass(frozen=True)
class HelixTolerances:
    """Tolerances of the helix, not rounded (m): f_Hbeta, f_fbeta, F_beta."""

    helix_slope: float
    helix_form: float
    helix_total: float

    @property
    def rounded_um(self) -> dict[str, float]:
        """All of them by the standard's names, rounded by its rules (5.2.3), in um."""
        return {SYMBOLS[name]: rounded(1e6 * value) for name, value in _plain(self).items()}


#: Attribute -> symbol of ISO 1328-1.
SYMBOLS = {
    "single": "f_pT",
    "cumulative": "F_pT",
    "slope": "f_HalphaT",
    "form": "f_falphaT",
    "total": "F_alphaT",
    "run_out": "F_rT",
    "helix_slope": "f_HbetaT",
    "helix_form": "f_fbetaT",
    "helix_total": "F_betaT",
}


def _plain(made: Tolerances | HelixTolerances) -> dict[str, float]:
    return {field.name: getattr(made, field.name) for field in fields(made)}


def rounded(value: float) -> float:
    """Round a tolerance (um) by the rules of the standard (5.2.3): to 1 above 10, to 0.5 from 5 on, to 0.1 below."""
    step = 1.0 if value > 10 else 0.5 if value >= 5 else 0.1
    return round(math.floor(value / step + 0.5 + 1e-9) * step, 1)


def tolerances(gear: Gear, class_: int, edition: int = 2013) -> Tolerances:
    """Return the tolerances of pitch, profile and run-out of a gear in a class of ISO 1328-1.

    Raises
    ------
    InputError
        For a class or a gear that the standard does not have.
    """
    step = _step(class_, edition)
    d, m = 1e3 * gear.pitch_diameter, 1e3 * gear.module
    if edition == 2013:
        given = {"teeth": abs(gear.teeth), "pitch_diameter_mm": d, "module_mm": m}
        for (name, value), limits in zip(given.items(), SCOPE, strict=True):
            _check_scope(name, value, limits, edition)
        slope, form = (0.001 * d + 0.4 * m + 4) * step, (0.55 * m + 5) * step
        cumulative = (0.002 * d + 0.55 * math.sqrt(d) + 0.7 * m + 12) * step
        single = (0.001 * d + 0.4 * m + 5) * step
        return Tolerances(single, cumulative, slope, form, math.hypot(slope, form), 0.9 * cumulative)
    d, m = _mean_of_range("pitch_diameter_mm", d), _mean_of_range("module_mm", m)
    cumulative = (0.3 * m + 1.25 * math.sqrt(d) + 7) * step
    return Tolerances(
        single=(0.3 * (m + 0.4 * math.sqrt(d)) + 4) * step,
        cumulative=cumulative,
        slope=(2.0 * math.sqrt(m) + 0.14 * math.sqrt(d) + 0.5) * step,
        form=(2.5 * math.sqrt(m) + 0.17 * math.sqrt(d) + 0.5) * step,
        total=(3.2 * math.sqrt(m) + 0.22 * math.sqrt(d) + 0.7) * step,
        run_out=0.8 * cumulative,
    )


def helix_tolerances(gear: Gear, class_: int, edition: int = 2013) -> HelixTolerances:
    """Return the tolerances of the helix of a gear in a class of ISO 1328-1.

    Raises
    ------
    InputError
        For a class or a gear that the standard does not have.
    """
    tolerances(gear, class_, edition)  # refuses what it does not have
    step, d, b = _step(class_, edition), 1e3 * gear.pitch_diameter, 1e3 * gear.face_width
    if edition == 2013:
        _check_scope("face_width_mm", b, WIDTHS, edition)
        slope = (0.05 * math.sqrt(d) + 0.35 * math.sqrt(b) + 4) * step
        form = (0.07 * math.sqrt(d) + 0.45 * math.sqrt(b) + 4) * step
        return HelixTolerances(slope, form, math.hypot(slope, form))
    d, b = _mean_of_range("pitch_diameter_mm", d), _mean_of_range("face_width_mm", b)
    slope = (0.07 * math.sqrt(d) + 0.45 * math.sqrt(b) + 3) * step
    return HelixTolerances(slope, slope, (0.1 * math.sqrt(d) + 0.63 * math.sqrt(b) + 4.2) * step)


def tolerances_um(gear: Gear, class_: int, edition: int = 2013) -> dict[str, float]:
    """Return all rounded tolerances (um) by symbol; those of the helix only for face widths that the standard has."""
    made = tolerances(gear, class_, edition).rounded_um
    low, high = WIDTHS if edition == 2013 else (RANGES["face_width_mm"][0], RANGES["face_width_mm"][-1])
    if low <= 1e3 * gear.face_width <= high:
        made |= helix_tolerances(gear, class_, edition).rounded_um
    return made


def _step(class_: int, edition: int) -> float:
    """Factor of a class to class 5, in m per um."""
    if edition not in EDITIONS:
        raise InputError("edition", edition, f"must be one of {', '.join(map(str, EDITIONS))}", "2013 is the newer one")
    low, high = CLASSES if edition == 2013 else GRADES
    if not low <= class_ <= high:
        raise InputError("class", class_, f"must be {low} to {high}", "5 to 8 are usual")
    return 1e-6 * math.sqrt(2.0) ** (class_ - 5)


def _check_scope(name: str, value: float, limits: tuple[float, float], edition: int) -> None:
    low, high = limits
    if not low * (1 - 1e-12) <= value <= high * (1 + 1e-12):
        year = "" if edition == 2013 else f":{edition}"
        problem = f"must be {low:g} to {high:g} for a class of ISO 1328-1{year}: its formulas are not extrapolated"
        deviations = "give the deviation itself" if name == "face_width_mm" else "give the deviations themselves"
        raise InputError(name, value, problem, deviations)


def _mean_of_range(name: str, value: float) -> float:
    """Geometric mean (mm) of the ends of the range of ISO 1328-1:1995 that holds a value; its upper end belongs to it.

    The first range holds its lower end, too.
    """
    ends = RANGES[name]
    _check_scope(name, value, (ends[0], ends[-1]), 1995)
    upper = next((i for i in range(1, len(ends)) if value <= ends[i] * (1 + 1e-12)), len(ends) - 1)
    return math.sqrt(ends[upper - 1] * ends[upper])
