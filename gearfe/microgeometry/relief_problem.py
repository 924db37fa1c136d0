"""What the search for a relief minimises: variables, the objective of `gearfe.microgeometry.relief`, one evaluation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..contact.half_plane_step import HalfPlanePair
from ..errors import InputError
from ..gear.deviation_job import GEARS
from ..gear.modifications import FlankModification, Relief, ends_of, tooth_deviations
from ..gear.pair import Gear
from ..loadmap.root_stress import PairRoots
from ..typing import Array
from .loaded_mesh import LoadedMesh
from .solve import load_mesh

QUANTITIES = ("tip_relief.amount", "tip_relief.length", "root_relief.amount", "root_relief.length", "crowning", "slope")


@dataclass(frozen=True)
class Variable:
    """A number that is varied.

    Attributes
    ----------
    quantity
        One of `QUANTITIES`; lengths are roll lengths from the tip or form circle.
    low, high
        Bounds (m).
    gear
        ``pinion``, ``wheel`` or ``both``.
    tolerance
        +- of manufacture (m).
    """

    quantity: str
    low: float
    high: float
    gear: str = "both"
    tolerance: float = 0.0

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise InputError("quantity", self.quantity, "must be one of " + ", ".join(QUANTITIES))
        if self.gear not in (*GEARS, "both"):
            raise InputError("gear", self.gear, "must be pinion, wheel or both")
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError("high", self.high, f"must be finite and > low = {self.low:g}", "swap them")

    @property
    def name(self) -> str:
        """Quantity and gear."""
        return f"{self.quantity} ({self.gear})"

    @property
    def absent(self) -> float:
        """No amount, whatever length (m)."""
        return 0.5 * (self.low + self.high) if self.quantity.endswith(".length") else 0.0

    def applied(self, made: FlankModification, gear: Gear, value: float) -> FlankModification:
        """The modification with another value (m)."""
        name, _, part = self.quantity.partition(".")
        change: Any = value
        if part:
            change = self._relieved(getattr(made, name) or Relief(0.0, 0.5 * sum(ends_of(gear))), gear, value)
        return replace(made, **{name: change})

    def _relieved(self, own: Relief, gear: Gear, value: float) -> Relief:
        """The relief with another amount or length (m)."""
        low, high = ends_of(gear)
        if self.quantity.endswith(".amount"):
            return replace(own, amount=value)
        return replace(own, start=high - value if self.quantity.startswith("tip_relief") else low + value)


@dataclass(frozen=True)
class Evaluation:
    """One choice of the variables.

    Attributes
    ----------
    value
        Objective; infinite where there is no such gear (`problem`) or a position failed.
    peak_to_peak, pressure, root_stress : ndarray, shape (m,)
        Of each torque: m, Pa, Pa; root stress not-a-number where it has no weight.
    problem
        Why there is no such gear.
    """

    value: float
    peak_to_peak: Array
    pressure: Array
    root_stress: Array
    problem: str = ""


@dataclass(frozen=True)
class ReliefProblem:
    """What is minimised; can be sent to other processes.

    Attributes
    ----------
    law
        The elastic pair, from `gearfe.contact.half_plane.half_plane_pair`; its own deviations do not count.
    base
        Modifications of pinion and wheel that the variables change.
    variables, torques
        Variables, and torques at the wheel's hub (N m).
    weights
        Of the torques; empty: all 1.
    peak_to_peak_weight, pressure_weight, root_stress_weight
        W above.
    turns
        Pitch errors of pinion and wheel (rad), see `gearfe.gear.pitch_errors`.
    positions, mesh_cycles
        Pinion angles in a mesh cycle, and how many; see `gearfe.microgeometry.solve.load_mesh`.
    roots
        For root stresses, see `gearfe.microgeometry.solve.load_mesh`.
    """

    law: HalfPlanePair
    base: tuple[FlankModification, FlankModification]
    variables: tuple[Variable, ...]
    torques: tuple[float, ...]
    weights: tuple[float, ...] = ()
    peak_to_peak_weight: float = 1.0
    pressure_weight: float = 0.0
    root_stress_weight: float = 0.0
    turns: tuple[tuple[float, ...], tuple[float, ...]] = ((0.0,), (0.0,))
    positions: int = 20
    mesh_cycles: int | None = None
    roots: PairRoots | None = None

    def modifications(self, x: Sequence[float] | Array) -> tuple[FlankModification, FlankModification]:
        """Of pinion and wheel, with the values x (m) of the variables."""
        made = list(self.base)
        gears = (self.law.pair.pinion, self.law.pair.wheel)
        for variable, value in zip(self.variables, x, strict=True):
            for g, name in enumerate(GEARS):
                if variable.gear in (name, "both"):
                    made[g] = variable.applied(made[g], gears[g], float(value))
        return made[0], made[1]

    def mesh(self, x: Sequence[float] | Array, torques: ArrayLike) -> LoadedMesh:
        """The pair with the values x at other torques.

        Raises
        ------
        InputError
            Where there is no such gear.
        """
        gears = (self.law.pair.pinion, self.law.pair.wheel)
        pinion, wheel = (
            tooth_deviations(gear, made, turn)
            for gear, made, turn in zip(gears, self.modifications(x), self.turns, strict=True)
        )
        roots = self.roots if self.root_stress_weight else None
        law = self.law.deviated((pinion, wheel))
        return load_mesh(law, torques, positions=self.positions, mesh_cycles=self.mesh_cycles, roots=roots)

    def evaluate(self, x: Sequence[float] | Array) -> Evaluation:
        """Objective and what it is made of."""
        goals = np.array(self.torques)
        nothing = np.full(len(goals), np.nan)
        try:
            made = self.mesh(x, self.torques)
        except InputError as error:
            return Evaluation(math.inf, nothing, nothing, nothing, str(error))
        order = np.searchsorted(made.torque, goals)  # results are sorted
        both = np.stack(made.largest_pressure())
        pressure = np.where(np.isfinite(both), both, 0.0).max(axis=(0, 2))[order]
        root = nothing if made.root_stress is None else np.nanmax(made.root_stress, axis=(1, 2))[order]
        peaks = made.peak_to_peak[order]
        sums = self.peak_to_peak_weight * 1e6 * peaks + self.pressure_weight * 1e-9 * pressure
        if self.root_stress_weight:
            sums = sums + self.root_stress_weight * 1e-8 * root
        weights = np.array(self.weights or (1.0,) * len(goals))
        value = float(weights @ sums / weights.sum())
        return Evaluation(value if np.isfinite(value) else math.inf, peaks, pressure, root)

    def value(self, x: Sequence[float] | Array) -> float:
        """Objective alone."""
        return self.evaluate(x).value
