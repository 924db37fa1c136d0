"""Define the result of an integration: times, states, status, statistics, dense output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...base.shown import Shown, library
from ...base.typing import Array
from .contract import Element
from .dense import Dense
from .start import Start
from .steps import Status
from .system import System, least_norm_solution, regular

#: Numbers of the gradients that are held at once; pivots of matrices that are solved as they are.
MOST_NUMBERS, REGULAR = 1_000_000, 1e-4


class IntegrationError(RuntimeError):
    """A run that ended before the end asked for.

    Attributes
    ----------
    result
        What was computed: a `Trajectory`, or the response of a train.
    """

    def __init__(self, result: Any, why: str, reached: float, end: float) -> None:
        self.result = result
        super().__init__(
            f"the run ended at {reached:.6g} s of {end:.6g} s: {why}; raise_on_failure=False returns what was computed"
        )


@dataclass(frozen=True, repr=False)
class Trajectory(Shown):
    """Result of `integrate`.

    Parameters
    ----------
    system, start
        What was integrated, and its consistent start.
    time : ndarray, shape (n,)
        Asked times (s), up to the time reached.
    status : Status
        `Status.DONE` when the end was reached; `message` says it in words.
    method : str
        The one used.
    statistics
        Scheme, steps, order, change points, seconds to compile; the link without
        mass that ended the run.
    dense
        Coordinates at any time of the run, by derivative.
    """

    system: System
    start: Start
    time: Array
    status: Status
    method: str
    statistics: Mapping[str, Any]
    dense: Dense = field(repr=False)

    def facts(self) -> dict[str, str]:
        """Return end time, size and method of the run."""
        ends = f"{self.time[0]:g} to {self.time[-1]:g} s" if len(self.time) else "none"
        return {
            "status": f"{self.message} at {self.reached:g} s",
            "times": f"{len(self.time)}, {ends}",
            "coordinates": f"{self.system.size}, constraints {self.system.rows}",
            "method": f"{self.method}, {self.statistics.get('scheme', '')}, {self.statistics.get('steps', 0)} steps",
        }

    def to_pandas(self) -> Any:
        """Coordinates and velocities as a `pandas.DataFrame`, a row a time; names as in `System.coordinate_names`.

        Raises
        ------
        MissingLibraryError
            Where pandas is not installed.
        """
        names = self.system.coordinate_names()
        columns = [*names, *(f"rate of {name}" for name in names)]
        frame = library("pandas").DataFrame(np.hstack([self.q, self.v]), columns=columns)
        return frame.set_index(library("pandas").Index(self.time, name="time_s"))

    def to_xarray(self) -> Any:
        """Coordinates q, velocities v, accelerations a over (time_s, coordinate) and multipliers over (time_s, row).

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        MissingLibraryError
            Where xarray is not installed.
        """
        states = {name: (("time_s", "coordinate"), getattr(self, name)) for name in "qva"}
        held = {"multipliers": (("time_s", "row"), self.multipliers)}
        labels = {"time_s": self.time, "coordinate": self.system.coordinate_names(), "row": self.system.row_names()}
        attributes = {"status": str(self.status), "method": self.method}
        return library("xarray").Dataset({**states, **held}, coords=labels, attrs=attributes)

    @property
    def message(self) -> str:
        """The status in words, with its cause where one is known: a load, a locked position, a link without mass."""
        link, problem = self.statistics.get("loose_link"), self.statistics.get("load_problem")
        if problem is not None:
            return f"{self.status.message}: {problem}"
        if "locked" in self.statistics:
            return str(self.statistics["locked"])
        if "short_steps" in self.statistics:
            return f"{self.status.message}: {self.statistics['short_steps']}"
        if link is None:
            return self.status.message
        return (
            f"{self.status.message}: body {link!r} has next to no mass and came where nothing with mass holds it "
            "(a dead centre); give it mass and inertia"
        )

    @property
    def reached(self) -> float:
        """Time at which the integration ended (s)."""
        return float(self.dense.times[-1])

    @cached_property
    def q(self) -> Array:
        """Coordinates, shape (n, size)."""
        return self._at(0)

    @cached_property
    def v(self) -> Array:
        """Velocities."""
        return self._at(1)

    @cached_property
    def a(self) -> Array:
        """Accelerations."""
        return self._at(2)

    def _at(self, derivative: int) -> Array:
        if len(self.dense.times) > 1:
            return self.dense(self.time, derivative)
        state = (self.start.q, self.start.v, np.full_like(self.start.q, np.nan))[
            derivative
        ]  # not a single step was made
        return np.tile(state, (len(self.time), 1))

    def stress_at(self, element: Element, times: Array) -> Array:
        """Stresses of a flexible link at the given times, shape (times, points, 3): of the integrator's stages."""
        before = self.system.rows
        stages = getattr(self.dense, "forces", None)
        for one, index in self.system.stressed:
            here = np.asarray(one.stress(self.start.q[index], self.start.v[index]), dtype=float)
            if one is not element:
                before += here.size
            elif stages is None:  # not a single step was made
                return np.broadcast_to(here, (len(times), *here.shape))
            else:
                flat: Array = stages(times)[:, before : before + here.size]
                return flat.reshape(len(times), *here.shape)
        raise KeyError(element.name)

    @cached_property
    def multipliers(self) -> Array:
        """Constraint forces (generalised), shape (n, rows); zero for redundant rows, not unique where there are any."""
        return self.multipliers_at(self.time)

    def multipliers_at(self, times: Array) -> Array:
        """Multipliers from M a = f - G^T lambda at the given times; NaN where they are beyond all numbers.

        Of the integrator's stages where it has them, with flexible links.
        """
        stages = getattr(self.dense, "forces", None)
        if stages is not None:
            return np.asarray(stages(times)[:, : self.system.rows], dtype=float)
        size = max(1, MOST_NUMBERS // max(1, self.system.rows * self.system.size))
        parts = [self._multipliers(times[k : k + size]) for k in range(0, len(times), size)]
        return np.concatenate([np.zeros((0, self.system.rows)), *parts])

    def _multipliers(self, times: Array) -> Array:
        """The same of so many times as matrices may be held of at once."""
        added_mass, keep = self.start.added_mass, self.start.active
        inverse, light = self.system.inverse_of(added_mass), np.flatnonzero(added_mass)
        q, v, a = (self.dense(times, k) for k in range(3))
        out = np.zeros((len(times), self.system.rows))
        if not keep.any():
            return out
        G = self.system.jacobian(times, q)[:, keep]
        force = self.system.force(times, q, v)
        force[:, light] += added_mass[light] * a[:, light]
        right = G @ (force @ inverse.T - a)[..., None]
        S = G @ inverse @ G.transpose(0, 2, 1)
        if regular(S, REGULAR):
            out[:, keep] = np.linalg.solve(S, right)[..., 0]
        else:
            out[:, keep] = [least_norm_solution(*one, 1e-14)[:, 0] for one in zip(S, right, strict=True)]
        return out
