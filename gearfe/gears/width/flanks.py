r"""The gap that modifications and misalignment put between two flanks with face widths: a plain function of roll and z.

The gap of a tooth pair at z, in the transverse section along the common normal, is

.. math:: d = -\big(h_1(s_1, z) + h_2(s_2, z)\big) - z'\,\big(\gamma\, n\cdot e - \gamma_q\, n\cdot q\big)

with the material h that each gear's modifications add at roll length s and axial coordinate z, and the tilts
:math:`\gamma` in the plane of action and :math:`\gamma_q` across it of the wheel's axis against the pinion's, which
displace the wheel's sections by so much per :math:`z'` from the middle of the common width; e is the normal on the path
of contact, q the direction to its left. On involutes the tilt across does nothing to first order, on tips it does.

Lead modifications count along the transverse base tangent, as ISO 1328-1 measures helix deviations. Profile
modifications and pitch errors are in the flanks' curves (`gearfe.gears.geometry.modifications`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import InputError
from ...base.typing import Array, IntArray
from ..geometry.face import NOMINAL, ToothDeviations

#: Material (m) that is added to a flank at roll lengths (m), axial coordinates z (m) and teeth, arrays of one shape. An
#: attribute `kinks` gives the straight lines of its kinks as `WideFlanks.kinks` does; without it there are none.
Topography = Callable[[Array, Array, IntArray], Array]


@dataclass(frozen=True)
class EndRelief:
    """Material taken off towards an end of the face width.

    Parameters
    ----------
    amount
        At the end (m), >= 0.
    length
        Length along z over which it runs out (m), > 0.
    exponent
        1: linear, 2: parabolic (-), >= 1.
    """

    amount: float
    length: float
    exponent: float = 1.0

    def __post_init__(self) -> None:
        for name, least, closed in (("amount", 0.0, True), ("length", 0.0, False), ("exponent", 1.0, True)):
            value = getattr(self, name)
            if not (math.isfinite(value) and (value >= least if closed else value > least)):
                raise InputError(name, value, f"must be finite and {'>=' if closed else '>'} {least:g}", "correct it")

    def material(self, distance: Array) -> Array:
        """Material added at distances (m) from the end, <= 0 (m)."""
        share = np.clip((self.length - distance) / self.length, 0.0, None)
        return np.asarray(-self.amount * share**self.exponent)


@dataclass(frozen=True)
class LeadModification:
    r"""Modification of a flank along its face width b: :math:`-C_\beta(2\zeta/b)^2 + f_{H\beta}\,\zeta/b`, end reliefs.

    Parameters
    ----------
    crowning
        Helix crowning C_beta (m), > 0: less material at both ends; none in the middle.
    slope
        Helix slope deviation f_Hbeta over the whole face width (m), > 0: more material towards larger z.
    relief_low, relief_high
        End reliefs at the smaller and at the larger z, or None.
    """

    crowning: float = 0.0
    slope: float = 0.0
    relief_low: EndRelief | None = None
    relief_high: EndRelief | None = None

    def __post_init__(self) -> None:
        for name in ("crowning", "slope"):
            if not math.isfinite(getattr(self, name)):
                raise InputError(name, getattr(self, name), "must be finite", "give it in m")

    def kinks(self, face: tuple[float, float]) -> list[float]:
        """Return the z (m) at which end reliefs of a gear begin whose face reaches from one z to another (m)."""
        (low, high), (first, second) = face, (self.relief_low, self.relief_high)
        ends = [] if first is None else [low + first.length]
        return ends if second is None else [*ends, high - second.length]

    def material(self, z: Array, face: tuple[float, float]) -> Array:
        """Material added (m) at z (m) of a gear whose face reaches from one z to another (m)."""
        low, high = face
        share = (2 * z - low - high) / (high - low)
        added = 0.5 * self.slope * share - self.crowning * share**2
        for relief, distance in ((self.relief_low, z - low), (self.relief_high, high - z)):
            if relief is not None:
                added = added + relief.material(distance)
        return np.asarray(added)


@dataclass(frozen=True)
class Misalignment:
    """Tilt of the wheel's axis against the pinion's about the middle of the common width.

    Parameters
    ----------
    in_plane, across
        In the plane of action (rad), > 0: closes the gap towards larger z; across it, > 0: moves the wheel's sections
        there to the left of the common normal out of the pinion.
    """

    in_plane: float = 0.0
    across: float = 0.0

    def __post_init__(self) -> None:
        for name in ("in_plane", "across"):
            if not abs(getattr(self, name)) <= 0.1:
                raise InputError(name, getattr(self, name), "must be >= -0.1 and <= 0.1 rad", "use less tilt")

    @classmethod
    def over_width(cls, length: float, width: float, across: float = 0.0) -> Misalignment:
        """The tilts that displace the ends of a width (m) against each other by lengths (m)."""
        return cls(length / width, across / width)


@dataclass(frozen=True)
class WideFlanks:
    """Flanks of pinion and wheel over roll length and width, and how the axes are tilted.

    Parameters
    ----------
    profiles
        Profile modifications and pitch errors of the driving flanks. Where the teeth of a gear have different
        profiles, that of the first is in the curves; the others' differences from it count as gaps.
    leads
        Modifications along the width.
    topographies
        Further material by roll length, z and tooth, or None: measured flanks.
    misalignment
        Tilt of the axes.
    """

    profiles: tuple[ToothDeviations, ToothDeviations] = NOMINAL
    leads: tuple[LeadModification, LeadModification] = (LeadModification(), LeadModification())
    topographies: tuple[Topography | None, Topography | None] = (None, None)
    misalignment: Misalignment = field(default_factory=Misalignment)

    @property
    def alike(self) -> bool:
        """Whether all mesh cycles are the same: topographies may differ by tooth where they do not say `alike`."""
        alike = (topography is None or getattr(topography, "alike", False) for topography in self.topographies)
        return all(own.alike for own in self.profiles) and all(alike)

    def kinks(self, gear: int, face: tuple[float, float]) -> Array:
        """Return the straight lines a z + b s = c over z and roll length s (m) along which a gear's material has kinks.

        Parameters
        ----------
        gear : int
            0 for the pinion, 1 for the wheel.
        face : pair of float
            First and last z of the gear (m).

        Returns
        -------
        ndarray, shape (lines, 3)
            a, b, c (m).
        """
        own, topography = self.profiles[gear], self.topographies[gear]
        others = [own.profiles[i] for i in set(own.profile) - {own.profile[0]}]
        rolls = {s for profile in others if profile is not None for s in profile.kinks}
        along = [(1.0, 0.0, z) for z in self.leads[gear].kinks(face)] + [(0.0, 1.0, s) for s in sorted(rolls)]
        of_topography = getattr(topography, "kinks", np.zeros((0, 3)))
        return np.concatenate([np.reshape(along, (-1, 3)), of_topography])

    def material(self, gear: int, roll: Array, z: Array, tooth: IntArray, face: tuple[float, float]) -> Array:
        """Material that a gear's modifications add beyond the first tooth's profile (m).

        Parameters
        ----------
        gear : int
            0 for the pinion, 1 for the wheel.
        roll, z : ndarray
            Roll length and axial coordinate (m).
        tooth : ndarray of int
            Numbers of the teeth.
        face : pair of float
            First and last z of the gear (m).
        """
        added = self.leads[gear].material(z, face)
        topography, profiles = self.topographies[gear], self.profiles[gear]
        if topography is not None:
            added = added + topography(roll, z, tooth)
        if len(set(profiles.profile)) > 1:
            number = profiles.profile_of(tooth)
            for i in np.unique(number).tolist():
                own = (profiles.profiles[i], 1.0), (profiles.profiles[profiles.profile[0]], -1.0)
                difference = sum(sign * one.at(roll)[0] for one, sign in own if one is not None)
                added = added + np.where(number == i, difference, 0.0)
        return np.asarray(added)
