"""A mechanism solved by its analysis: tables without files, the same wherever and beside whatever it runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..rigid import Start, Trajectory, integrate
from ..rigid.choice import STUCK
from ..rigid.equilibrium import Equilibrium, equilibrium
from ..rigid.integrate import use_compiled
from ..rigid.inverse import prescribed_motion
from ..rigid.modes import Modes, modes
from ..rigid.programs import tape_program
from .job import output_times
from .model import Mechanism
from .rest import at_rest, mode_columns
from .results import Results, evaluate


@dataclass(frozen=True)
class Solution:
    """What an analysis yields.

    Attributes
    ----------
    start, results, rest, modes
        The closed start; outputs and energies, of one time for a state of rest; that state; the vibrations asked for.
    """

    start: Start
    results: Results
    rest: Equilibrium | None = None
    modes: Modes | None = None

    @property
    def problem(self) -> str:
        """Why a run ended early; else empty."""
        trajectory = self.results.trajectory
        return "" if trajectory.status == 0 else trajectory.message

    def tables(self) -> dict[str, dict[str, Any]]:
        """Table -> column -> values: of the files that the command writes, the main one first."""
        time = {"time_s": self.results.trajectory.time}
        if self.rest is not None:
            rest = {"equilibrium": dict(self.results.outputs)}
            return rest if self.modes is None else {"modes": mode_columns(self.modes), **rest}
        return {"trajectory": {**time, **self.results.outputs}, "energy": {**time, **self.results.energy}}


def solve(mechanism: Mechanism) -> Solution:
    """The analysis of the file; a method that it leaves open follows from the mechanism and not from the clock.

    Raises
    ------
    InputError
        What the command would refuse.
    """
    run, start = mechanism.file.run, mechanism.start()
    if run.analysis in ("equilibrium", "modes"):
        rest = equilibrium(mechanism.system, start)
        found = modes(mechanism.system, start, rest, run.modes) if run.analysis == "modes" else None
        return Solution(start, evaluate(mechanism, at_rest(mechanism, start, rest)), rest, found)
    return Solution(start, evaluate(mechanism, _moved(mechanism, start)))


def _moved(mechanism: Mechanism, start: Start) -> Trajectory:
    run, system = mechanism.file.run, mechanism.system
    times = output_times(run.end_s, run.step_s)
    if run.analysis == "inverse":
        return prescribed_motion(system, start, times)
    method, backend = run.method, "compiled" if use_compiled("auto") else "plain"
    if method == "auto":
        stiff = any(element.stiff for element in system.elements)
        method = "implicit" if stiff else "explicit" if tape_program(system) is None else "taylor"
    options: dict[str, Any] = {"start": start, "tolerance": mechanism.tolerance, "raise_on_failure": False}
    with np.errstate(over="ignore", invalid="ignore"):
        made = integrate(system, times, method=method, backend=backend, **options)
        if made.status in STUCK and run.method == "auto" and method == "taylor" and system.linkage is None:
            return integrate(system, times, method="explicit", **options)
        return made
