"""Stability of the steady motion of a train."""

from __future__ import annotations

from dataclasses import dataclass

from ...base.shown import percent
from ...base.typing import ComplexArray

#: A multiplier's modulus beyond 1 by less than this is no instability.
ROUND_OFF = 1e-6


@dataclass(frozen=True, eq=False)
class Stability:
    """Whether small motions beside the steady one of a train die out.

    Attributes
    ----------
    multipliers : (2 modes,) or None
        Floquet multipliers, largest modulus first; None where there are none, `note` says why.
    time
        Over which they are made (s): the common period of the meshes.
    note
        Why there are none, or nothing.
    """

    multipliers: ComplexArray | None = None
    time: float = 0.0
    note: str = ""

    @property
    def warnings(self) -> list[str]:
        """A sentence where the motion is unstable."""
        growth = 0.0 if self.multipliers is None else abs(self.multipliers[0]) - 1.0
        if growth <= ROUND_OFF:
            return []
        return [
            f"the train is parametrically unstable: its vibration grows by {percent(growth, 3)} every "
            f"{1e3 * self.time:.4g} ms; add damping, or change the speed"
        ]


#: Of a run without a stability analysis.
NOT_COMPUTED = Stability(note="not computed")
