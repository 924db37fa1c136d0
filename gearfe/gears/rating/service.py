r"""Service life under a load spectrum by Miner's rule, ISO 6336-6:2006.

Each part of the spectrum has its own stress :math:`\sigma_i` with its own factors of influence, and its number of
cycles :math:`n_i`. The S-N curve of the gear gives the permissible number of cycles :math:`N_i` at :math:`S\sigma_i`,
and

.. math:: U = \sum_i n_i/N_i.

The damage and the life are those of the required safety S; the safety factor of the spectrum is the S with
:math:`U = 1`. A load without a spectrum is one of one part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .ledger import cited
from .life import FatigueCurve

_PART = "ISO 6336-6:2006"
_PAIR = tuple[float, float]
#: Longest life that is stated (h).
LONGEST = 1e6


@dataclass(frozen=True)
class Service:
    """Damage, life and safety factors under the spectrum, of gear 1 and gear 2."""

    U_H: _PAIR = cited("damage of the flank at the required safety, Miner's sum", f"{_PART}, 5")
    U_F: _PAIR = cited("damage of the root at the required safety, Miner's sum", f"{_PART}, 5")
    life_flank_h: _PAIR = cited("life of the flank at the required safety, at most 1e6 h", f"{_PART}, 5", "h")
    life_root_h: _PAIR = cited("life of the root at the required safety, at most 1e6 h", f"{_PART}, 5", "h")
    S_H_spectrum: _PAIR = cited("safety factor of the flank under the spectrum", f"{_PART}, 6")
    S_F_spectrum: _PAIR = cited("safety factor of the root under the spectrum", f"{_PART}, 6")


def miner(strength: FatigueCurve, stresses: Sequence[float], cycles: Sequence[float], safety: float) -> float:
    """Return Miner's sum of stresses (N/mm^2) times a safety with their numbers of cycles; infinite beyond static load.

    Parameters
    ----------
    strength : FatigueCurve
        S-N curve.
    stresses, cycles : sequence of float
        Stress and number of cycles of each part.
    safety : float
        Factor of all stresses.
    """
    damage = 0.0
    for stress, count in zip(stresses, cycles, strict=True):
        borne = strength.cycles(safety * stress)
        if borne == 0.0:
            return math.inf
        damage += count / borne
    return damage


def spectrum_safety(strength: FatigueCurve, stresses: Sequence[float], cycles: Sequence[float]) -> float:
    """Return the factor of all stresses with which Miner's sum is 1, or the strength at 1e10 cycles is reached."""
    top = strength.static / max(stresses)
    low, high = 1e-6 * top, top
    if miner(strength, stresses, cycles, high) <= 1.0:
        return high

    def borne(safety: float) -> bool:
        return miner(strength, stresses, cycles, safety) <= 1.0

    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if borne(middle) else (low, middle)
    # below the strength at 1e10 cycles nothing is damaged, whatever the number of cycles: the sum may jump over 1
    return low


def life_hours(damage: float, hours: float) -> float:
    """Hours until Miner's sum is 1, at most `LONGEST`, of a damage in so many hours."""
    return LONGEST if damage <= 0.0 else min(LONGEST, hours / damage)


def service(
    strengths: dict[str, tuple[FatigueCurve, FatigueCurve]],
    stresses: dict[str, Callable[[int], Sequence[float]]],
    cycles: Callable[[int], Sequence[float]],
    hours: float,
    safeties: dict[str, float],
) -> Service:
    """Return damage, life and safety factors.

    Parameters
    ----------
    strengths : dict
        ``flank`` and ``root`` -> S-N curves of both gears.
    stresses : dict
        ``flank`` and ``root`` -> stresses of all parts of a gear (N/mm^2).
    cycles : callable
        Numbers of cycles of all parts of a gear.
    hours : float
        Duration of the spectrum (h).
    safeties : dict
        Required safeties of ``flank`` and ``root``.
    """
    found: dict[str, list[float]] = {}
    for kind, curves in strengths.items():
        for i in (0, 1):
            parts, counts = stresses[kind](i), cycles(i)
            damage = miner(curves[i], parts, counts, safeties[kind])
            found.setdefault(f"U_{kind}", []).append(min(damage, 1e9))
            found.setdefault(f"life_{kind}", []).append(life_hours(damage, hours))
            found.setdefault(f"S_{kind}", []).append(spectrum_safety(curves[i], parts, counts))
    two = {name: (values[0], values[1]) for name, values in found.items()}
    return Service(
        U_H=two["U_flank"],
        U_F=two["U_root"],
        life_flank_h=two["life_flank"],
        life_root_h=two["life_root"],
        S_H_spectrum=two["S_flank"],
        S_F_spectrum=two["S_root"],
    )
