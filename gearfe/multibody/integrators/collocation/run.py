"""Integrate implicitly by collocation: Radau IIA for stiff and flexible systems, Gauss to conserve energy.

Steps are those of `kernels`, compiled if the system can be written on a tape, otherwise with NumPy. This module chooses
their lengths and keeps the solution. The order depends on the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from ....base.progress import announce
from ....base.typing import Array
from ...compiled.kernels import Kernels, bind, packed
from ...core.contract import LocalForce
from ...core.dense import Polynomials
from ...core.elimination import in_modes, is_linear, modal_coordinates
from ...core.start import Start
from ...core.steps import Pace, Status, StepControl, StepLaw, first_step
from ...core.system import System
from ...series.tape import Program
from ..discontinuities import TRUSTED, Discontinuities, collocated_path, quiet_speeds
from . import kernels, numpy_equations
from .kernels import SOLVED
from .numpy_equations import SystemEquations
from .scheme import RADAU, Collocated, Scheme, path_matrix, powers_of_path, scheme
from .work_space import equations, narrow_band, work

KERNELS = Kernels(kernels.FUNCTIONS, kernels.NAMES, ("collocation_step",), kernels.HOT)
#: Stages of a step (measured: five and nine take as long for the same error).
STAGES = 7
#: Steps whose polynomials are made at once; bytes of a run's steps from which on they are reported.
BLOCK, REPORTED_BYTES = 1024, 1e9
#: Share of a step about which its polynomials are written.
MIDDLE = 0.5
#: Relative to the largest coordinate: a step whose path is straight within this is too short for differences of its
#: positions to give accelerations or multipliers. (Rounding of positions weighs up to 2e4 times in accelerations.)
STRAIGHT = 1e-12
#: A step more than so many times as long as the last one begins again: speeds and multipliers of a very short step are
#: rounding over powers of its length.
MOST_AHEAD = 10.0
#: Rounding of a position, relative to the largest so far.
ROUNDED = 4e-16
#: Share of a step that is tried after Newton did not converge.
NOT_SOLVED_SHARE = 0.3
#: Rate of Newton's changes with which the next step is as long as the last; it grows with the step.
EASY = 0.25
#: Asked tolerance -> that of steps in modal coordinates: accelerations weigh the fast modes more than the state does.
MODES_SHARE = 0.01


@lru_cache(maxsize=1)
def _numpy_step() -> Any:
    functions = (*numpy_equations.FUNCTIONS, kernels.collocation_step)
    return bind(functions, {**numpy_equations.NAMES, **kernels.NEWTON}).collocation_step


def run_implicit(
    system: System, start: Start, times: Array, *, tolerance: float, longest: float,
    pace: Pace | None = None, family: str = RADAU, program: Program | None = None,
) -> tuple[Polynomials, Status, dict[str, Any]]:  # fmt: skip
    """Integrate by collocation, in modal coordinates if constraints and elements are linear.

    Parameters
    ----------
    system : System
        The system.
    start : Start
        Consistent start.
    times : ndarray, shape (t,)
        Output times (s); the run goes from the start to the last.
    tolerance : float
        Of each step, relative to the largest value of each coordinate.
    longest : float
        Longest step (s).
    pace : Pace, optional
        Bounds the number of steps and reports it.
    family : str
        ``Radau IIA`` or ``Gauss``.
    program : Program, optional
        The system on a tape without its redundant rows, for compiled steps.

    Returns
    -------
    dense : Polynomials
        Coordinates over time.
    status : Status
        Why the run ended.
    statistics : dict
        Scheme, steps, iterations and rejected steps.
    """
    options: dict[str, Any] = {"longest": longest, "pace": pace}
    if system.joints and is_linear(system) and all(isinstance(e, LocalForce) for e, _ in system.forces):
        modal = modal_coordinates(system)
        if modal.T.shape[1] == 0:  # nothing is left to integrate
            still = Polynomials(np.array([start.time, times[-1]]), start.q[None, None, :])
            return still, Status.DONE, {"scheme": "at rest", "steps": 1, "free_coordinates": 0}
        inner, begin = in_modes(modal, start)
        local = max(MODES_SHARE * tolerance, 1e-13)
        within, status, statistics = run_implicit(inner, begin, times, tolerance=local, family=family, **options)
        coefficients = within.coefficients @ modal.T.T
        coefficients[:, 0] += modal.origin
        return replace(within, coefficients=coefficients), status, {**statistics, "free_coordinates": inner.size}
    nonlinear = program is not None and len(program.code.checked) > 0
    step = Stepper(system, start, scheme(family, STAGES, rates=nonlinear), program)
    return step.run(system, start, times, tolerance, options)


class Stepper:
    """Trial steps of one run, compiled for systems on a tape.

    Parameters
    ----------
    system, start
        What moves.
    tab : Scheme
        Stages.
    program : Program or None
        The system on a tape without its redundant rows, for compiled steps.
    """

    def __init__(self, system: System, start: Start, tab: Scheme, program: Program | None = None) -> None:
        self.tab = tab
        elements = SystemEquations(system, start)
        s, n, m = len(tab.c), system.size, int(start.active.sum())
        self.w = work(s, n, m, elements.stresses, tab.inner + 4)
        self.w.now[2] = SOLVED
        self.compiled, self.compile_seconds = program is not None, 0.0
        if program is None:
            self._step: Callable[[], int] = lambda: _numpy_step()(elements, self.w, tab)
        else:
            band = system.once(("band", start.active.tobytes()), lambda: narrow_band(program))
            self._held = packed(equations(program, band, s, elements.stresses)), packed(self.w), packed(tab)
            self.w.now[1] = self.w.limit[0] = 1.0
            self.compile_seconds = KERNELS.load(lambda: KERNELS.compiled.collocation_step(*self._held))
            self._step = KERNELS.compiled.collocation_step.on(*self._held)
        self._powers = np.arange(s + 1.0)
        p = self._powers[1:] + 1.0
        self._guess = tab.side.c ** p[:, None] / p[:, None]

    def restart(self, system: System, start: Start, t: float, q: Array, v: Array) -> Array:
        """Begin again at a state: the guess of the next step has a constant acceleration.

        Parameters
        ----------
        system : System
            The system.
        start : Start
            Start of the run, with the active rows and the added masses of light links.
        t : float
            Time (s).
        q, v : ndarray, shape (size,)
            Coordinates and velocities.

        Returns
        -------
        a : ndarray, shape (size,)
            The acceleration.
        """
        a, multipliers = system.acceleration(t, q, v, start.active, start.added_mass)
        self.w.multipliers[:] = multipliers[start.active]
        self.w.speeds[:] = 0.0
        self.w.speeds[1] = a
        return a

    def keep(self, h: float) -> None:
        """The step just made is the one before the next."""
        w, tab = self.w, self.tab
        found = tab.ahead @ w.V.T
        w.speeds[: len(found)] = found / h ** self._powers[: len(found), None]
        w.multipliers[:] = w.L[:, -2]

    def __call__(self, t: float, h: float, q: Array, v: Array, limit: Array) -> int:
        """See `kernels.collocation_step`."""
        w = self.w
        w.now[:2], w.q[:], w.v[:], w.limit[:] = (t, h), q, v, limit
        w.guess[1:] = self._guess * h ** (self._powers[1:, None] + 1.0)
        return self._step()

    def error(self, tolerance: float) -> float:
        """Of the step just made, over the tolerance."""
        return max(float(self.w.measures[0]), float(self.w.measures[1]) / tolerance)

    def run(
        self, system: System, start: Start, times: Array, tolerance: float, options: dict[str, Any]
    ) -> tuple[Polynomials, Status, dict[str, Any]]:
        """Step from the start to the last time with errors below the tolerance.

        Parameters
        ----------
        system : System
            The system.
        start : Start
            Consistent start.
        times : ndarray, shape (t,)
            Output times (s).
        tolerance : float
            Of each step, relative to the largest value of each coordinate.
        options : dict
            ``longest`` step (s) and ``pace``, for `StepControl`.

        Returns
        -------
        dense, status, statistics
            As of `run_implicit`.
        """
        w, tab, units = self.w, self.tab, system.units
        q, v, t, end = start.q.copy(), start.v.copy(), start.time, float(times[-1])
        a = self.restart(system, start, t, q, v)
        steady = tab.inner == len(tab.c)  # Gauss's points
        law = StepLaw(exponent=1.0 / (len(tab.c) + 1), growth=5.0, least_error=1e-8, predictive=True, steady=steady)
        reach = np.maximum(np.abs(q), 1e-300)

        def least() -> Array:
            size: Array = np.maximum(reach, 1e-3 * units * max(float((reach / units).max()), 1e-12))
            return size

        floor = least()

        def limit(h: float) -> Array:
            return tolerance * np.maximum(floor, np.abs(h * v))

        first = first_step(q / units, v / units, a / units, abs(end - t))
        if law.steady:
            w.now[2] = 0.0  # to rounding: what Newton's method leaves is a force at random, which the energy follows
            first = self._steady_step(first, tolerance, (t, float(times[1]) - t, q, v), limit, options["longest"])
            size = 16.0 * abs(end - t) / first * (w.known.size + w.L.size + w.S.size)  # as it goes, and as it is kept
            if size > REPORTED_BYTES:
                announce(f"about {abs(end - t) / first:.2g} steps will take {size / 1e9:.2g} GB of memory")
        control = StepControl(law, (t, end), first, breaks=system.breaks, **options)
        discontinuities = Discontinuities(system, control, tolerance)
        ends, known, forces, accelerations, newton = [t], [], [], [a], 0

        speeds_count, fastest = tab.level == 1 and not steady, 1e-300
        w.now[4] = ROUNDED / tolerance if system.stressed else 0.0
        while (h := control.next_step()) is not None:
            if speeds_count:
                fastest = max(fastest, float(np.abs(v / units).max()))
                w.now[3] = min(float((reach / units).max()) / fastest, control.span)
            count = self(t, h, q, v, limit(h))
            newton += abs(count)
            if count <= 0:
                control.fail(Status.NOT_SOLVED, NOT_SOLVED_SHARE)
                continue
            error = self.error(tolerance)
            if discontinuities.cutting and error <= TRUSTED:
                quiet = quiet_speeds(tab.c, w.v, w.V[:, :-1].T, w.vn, units * float((reach / units).max()) / abs(h))
                speeds = (tab.speed @ np.vstack([w.v, quiet])) / h ** self._powers[:, None]
                if discontinuities.cut(t, h, collocated_path(h, powers_of_path(tab.path, w.known, tab.inner), speeds)):
                    continue
            if not error <= 1.0:
                control.reject(error)
                continue
            if w.measures[3] > 0.0:  # and the kink there was not found
                control.fail(Status.NOT_SOLVED, NOT_SOLVED_SHARE)
                continue
            t = control.accept(error)
            if not (law.steady or discontinuities.passing(h)):
                control.trial = min(control.trial, abs(h) * EASY / max(float(w.measures[2]), 1e-3))
            known.append(w.known.copy())
            forces.append(np.concatenate((w.L, w.S)))
            ends.append(t)
            self.keep(h)
            q, v = w.qn.copy(), w.vn.copy()
            if discontinuities.passing(h) or control.trial > MOST_AHEAD * abs(h):
                accelerations.append(self.restart(system, start, t, q, v))
            elif not system.stressed:
                accelerations.append(system.acceleration(t, q, v, start.active, start.added_mass)[0])
            reach = np.maximum(reach, np.abs(q))
            floor = least()
        dense = self._dense(system, start, np.array(ends), known, forces, accelerations)
        counts: dict[str, Any] = {
            "scheme": f"{'Radau IIA' if tab.inner < len(tab.c) else 'Gauss'} of {len(tab.c)} stages"
        }
        if self.compiled:
            counts["compile_seconds"] = self.compile_seconds
        if discontinuities.load_problem and control.status is not Status.DONE:
            counts["load_problem"] = discontinuities.load_problem
        return dense, control.status, {
            **counts, "steps": control.accepted, "newton_iterations": newton, "rejected": control.rejected,
        }  # fmt: skip

    def _steady_step(
        self, first: float, tolerance: float, begin: tuple[float, float, Array, Array],
        limit: Callable[[float], Array], longest: float,
    ) -> float:  # fmt: skip
        """A part of the distance of the output times, about the longest step that the start allows."""
        t, distance, q, v = begin
        longest = min(longest, abs(distance))
        while first < longest:
            h = math.copysign(first, distance)
            if self(t, h, q, v, limit(h)) <= 0 or self.error(tolerance) > 1.0:
                first *= 0.5
                break
            first *= 2.0
        return abs(distance) / math.ceil(abs(distance) / min(first, longest))

    def _dense(
        self, system: System, start: Start, times: Array, known: list[Array], forces: list[Array],
        accelerations: list[Array],
    ) -> Polynomials:  # fmt: skip
        """Polynomials through the stages of every step and the states at its ends.

        Accelerations of stiff links at the ends are the rounding of their strains; those of others follow from the
        equations of motion there. In steps that are too short for differences of positions (`STRAIGHT`), accelerations
        are linear between the ends of the step. Stiff links keep their accelerations and forces from the step before.
        """
        inner, s = self.tab.inner, len(self.tab.c)
        if not known:
            return Polynomials(times, np.zeros((0, *self.w.known.shape)))
        h = np.diff(times)[:, None, None]
        path = path_matrix(self.tab.c[:inner], accelerations=not system.stressed, origin=MIDDLE)
        middles = times[:-1] + MIDDLE * np.diff(times)
        coefficients = np.empty((len(known), len(path), system.size))
        carried = [*np.flatnonzero(start.active), *(system.rows + np.arange(self.w.S.shape[0]))]
        parts = np.zeros((len(known), s, system.rows + self.w.S.shape[0])) if system.stressed else None
        short, known_ends = np.zeros(len(known), dtype=bool), np.zeros((len(known), 2, system.size))
        force_path = np.linalg.inv((self.tab.c[:, None] - MIDDLE) ** np.arange(s))
        for k in range(0, len(known), BLOCK):
            block = slice(k, k + BLOCK)
            whole, own = np.array(known[block]), h[block]
            short[block], known_ends[block] = self._straight(whole, system.units), whole[:, :2]
            if not system.stressed:
                a = np.array(accelerations[k : k + BLOCK + 1])[:, None, :]
                whole = np.concatenate([whole, own**2 * a[:-1], own**2 * a[1:]], axis=1)
            coefficients[block] = powers_of_path(path, whole, inner) / own ** np.arange(len(path))[:, None]
            if parts is not None:
                found = np.array(forces[block])[:, :, :s].transpose(0, 2, 1)
                parts[block, :, carried] = force_path @ found / own ** np.arange(s)[:, None]
            known[block] = forces[block] = [self.w.known[:0]] * len(whole)  # their memory is free
        ends = np.array(accelerations) if parts is None else None
        for k in map(int, np.flatnonzero(short)):
            both = ends[k : k + 2] if ends is not None else np.array([_before(coefficients, h[:, 0, 0], k, short)] * 2)
            coefficients[k] = _line_of_accelerations(len(path), h[k, 0, 0], known_ends[k], both)
            if parts is not None:
                force = _before(parts, h[:, 0, 0], k, short, 0)
                parts[k], parts[k, 0] = 0.0, force
        if parts is None:
            return Polynomials(times, coefficients, origins=middles)
        return Collocated(times, coefficients, origins=middles, forces=Polynomials(times, parts, origins=middles))

    def _straight(self, known: Array, units: Array) -> Array:
        """Return whether the stages of steps (steps, k, n) are on straight lines within rounding."""
        begin, speed = known[:, :1], known[:, 1:2]
        c = self.tab.c[: self.tab.inner, None]
        bent = np.abs((known[:, 2 : self.tab.inner + 2] - begin - c * speed) / units).max(axis=(1, 2), initial=0.0)
        return np.asarray(bent <= STRAIGHT * np.abs(begin / units).max(axis=(1, 2), initial=0.0))


def _before(coefficients: Array, h: Array, k: int, short: Array, derivative: int = 2) -> Array:
    """Evaluate a derivative of polynomials about the middles of steps h (s), just before step k.

    It is that at the end of the last earlier step without the flag `short`: Radau stages are most exact near the end of
    a step. If there is none, it is that at the start of the next such step, or zero.
    """
    before, behind = np.flatnonzero(~short[:k])[-1:], k + 1 + np.flatnonzero(~short[k + 1 :])[:1]
    for step, x in ((before, 0.5), (behind, -0.5)):
        for i in step:
            powers = [
                math.perm(j, derivative) * (x * h[i]) ** max(j - derivative, 0) for j in range(coefficients.shape[1])
            ]
            return np.asarray(powers @ coefficients[i])
    return np.zeros(coefficients.shape[2])


def _line_of_accelerations(count: int, h: float, begin: Array, a: Array | list[Array]) -> Array:
    """Compute coefficients (count, n) about the middle of a step from (q, h v) at its start and q'' at both ends."""
    middle, slope = 0.5 * (a[0] + a[1]), (a[1] - a[0]) / h
    v = begin[1] / h + 0.5 * h * (a[0] + 0.25 * h * slope)
    coefficients = np.zeros((count, len(middle)))
    coefficients[0] = begin[0] + 0.5 * begin[1] + h * h * (a[0] / 8.0 + h * slope / 48.0)
    coefficients[1:4] = v, 0.5 * middle, slope / 6.0
    return coefficients
