"""Loads that depend on the state of the mechanism: what a force may have in place of a function of time."""

from __future__ import annotations

from abc import ABC, abstractmethod

from ..typing import Array


class StateFunction(ABC):
    """A load f(t, q, v) with its slopes, of the coordinates and velocities of a whole linkage.

    A linkage with one has no Taylor series: the explicit or the implicit method integrates it. Where it has no value,
    `value` is not-a-number, which shortens the step and at last ends the run, and `complaint` says why.
    """

    breaks: tuple[float, ...] = ()
    complaint: str = ""

    @abstractmethod
    def value(self, t: float, q: Array, v: Array) -> float:
        """f."""

    @abstractmethod
    def slopes(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """(df/dq, df/dv)."""


class SpanFunction(ABC):
    """A tension T(t, L, L') between two points by their distance L (m) and its rate L' (m/s); as `StateFunction`."""

    complaint: str = ""

    @abstractmethod
    def value(self, t: float, length: float, rate: float) -> float:
        """T (N), positive where it pulls."""

    @abstractmethod
    def slopes(self, t: float, length: float, rate: float) -> tuple[float, float]:
        """(dT/dL, dT/dL')."""
