"""Loads that depend on the state of the mechanism: what a force may have in place of a function of time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..typing import Array

if TYPE_CHECKING:
    from .linkage_tape import BodyVariables
    from .tape import Tape


class StateFunction(ABC):
    """A load f(t, q, v) with its slopes, of the coordinates and velocities of a whole linkage.

    Where it has no value, `value` is not-a-number, which shortens the step and at last ends the run, and `complaint`
    says why.
    """

    breaks: tuple[float, ...] = ()
    complaint: str = ""

    @abstractmethod
    def value(self, t: float, q: Array, v: Array) -> float:
        """f."""

    def values(self, t: float | Array, q: Array, v: Array) -> Any:
        """f at a state, or at times (k,) of states (k, n)."""
        return over(self.value, t, q, v)

    @abstractmethod
    def slopes(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """(df/dq, df/dv)."""

    def pole(self, t: float, value: float) -> str:
        """What is to be said where it grows beyond all bounds."""
        return f"a load grows beyond {value:.1g} at {t:.6g} s"

    def pieces(self, t: float, q: Array, v: Array) -> tuple[int | None, ...]:  # noqa: ARG002
        """Numbers of the smooth pieces that it is on."""
        return ()

    def write(self, bodies: BodyVariables) -> int | None:  # noqa: ARG002
        """Its register on the tape of the bodies' variables; None where it cannot be written."""
        return None


class SpanFunction(ABC):
    """A tension T(t, L, L') between two points by their distance L (m) and its rate L' (m/s); as `StateFunction`."""

    complaint: str = ""

    @abstractmethod
    def value(self, t: float, length: float, rate: float) -> float:
        """T (N), positive where it pulls."""

    def values(self, t: float | Array, length: Any, rate: Any) -> Any:
        """T in a state, or in many."""
        return over(self.value, t, length, rate)

    @abstractmethod
    def slopes(self, t: float, length: float, rate: float) -> tuple[float, float]:
        """(dT/dL, dT/dL')."""

    def pieces(self, t: float, length: float, rate: float) -> tuple[int | None, ...]:  # noqa: ARG002
        """Numbers of the smooth pieces that it is on."""
        return ()

    def write(self, tape: Tape, length: int, rate: int) -> int | None:  # noqa: ARG002
        """Its register by those of length and rate; None where it cannot be written."""
        return None


def over(value: Callable[..., float], t: float | Array, *states: Array) -> Any:
    """A function of a state, or of those at several times; its numbers are `float`, whose divisions by zero raise."""
    if np.ndim(t) == 0:
        return value(t, *(x if np.ndim(x) else float(x) for x in states))
    return [over(value, *one) for one in zip(np.asarray(t), *states, strict=True)]
