"""The shipped gear train by general-purpose integrators: SUNDIALS (scikit-sundae), scipy, exudyn.

All get the same right-hand side in the same modal coordinates, y'' = -w^2 y - D y' + W^T f(t, W y, W y'), compiled by
numba; they return the state at the output times and the study evaluates the same signals. exudyn holds mass, damping
and
stiffness itself (ObjectGenericODE2) and calls the compiled forces from a Python function, which is the only way it
offers for
forces that depend on all coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gearfe.drivetrain.train.forces import CurveFlank
from gearfe.gears.gearmesh.periodic import Curves, curve_arrays
from gearfe.multibody.compiled.packed import Packed
from gearfe.multibody.series.recurrences import time_series
from gearfe.multibody.series.timefunctions import Times, time_arrays

from ..subject import train_model, train_times
from ..timing import measured
from .process import PeerError, serve

Rhs = Callable[[float, Any, Any], None]
States = tuple[np.ndarray, np.ndarray]


class Law(NamedTuple):
    """Functions of time with the directions of the torques, flanks and their curves, gyroscopic moments."""

    times: Times
    now: np.ndarray
    torques: np.ndarray
    flanks: np.ndarray
    curves: Curves
    gyros: np.ndarray


class Equations(NamedTuple):
    """A right-hand side and the state that it is asked for at."""

    eigenvalues: np.ndarray
    diagonal: np.ndarray
    constant: np.ndarray
    W: np.ndarray
    offset: np.ndarray
    law: Law
    t: np.ndarray  # (1,)
    y: np.ndarray
    dy: np.ndarray
    u: np.ndarray
    du: np.ndarray
    out: np.ndarray


def answer(task: dict[str, Any]) -> dict[str, Any]:
    """Integrate and measure; making the solver counts, the model and compiling do not.

    With ``speed`` and ``times``, a step and their number, another speed and other times; ``last``: so many of them
    come back.
    """
    model = train_model(task["variant"], quick=task["quick"], speed=task.get("speed"))
    times = train_times(task["quick"])
    if "times" in task:
        step, count = task["times"]
        times = step * np.arange(count)
    modal = model.modal
    start = np.concatenate(modal.reduce(model.start.q, model.start.v))
    rhs = plain_rhs(modal) if task["quick"] else compiled_rhs(modal, model.forces)
    rhs(0.0, start, np.empty_like(start))
    runs: dict[str, Callable[..., States]] = {
        "sundials": _sundials,
        "scipy_ivp": partial(_scipy, _approaches(model)),
        "exudyn": _exudyn,
    }
    (at, states), cost = measured(lambda: runs[task["peer"]](task, modal, rhs, start, times), runs=3, most_s=30.0)
    at, states = at[-task.get("last", 0) :], states[-task.get("last", 0) :]
    return {"times": at.tolist(), "states": states.tolist(), **cost.columns, "unknowns": len(modal.eigenvalues)}


def plain_rhs(modal: Any) -> Rhs:
    """Right-hand side in NumPy."""
    n = len(modal.eigenvalues)

    def rhs(t: float, y: Any, dy: Any) -> None:
        dy[:n] = y[n:]
        dy[n:] = modal.constant - modal.eigenvalues * y[:n] - modal.damping @ y[n:] + modal.force(t, y[:n], y[n:])

    return rhs


def compiled_rhs(modal: Any, forces: Any) -> Rhs:
    """The same in compiled code; `forces` are those of a train whose meshes have stiffness curves."""
    from gearfe.multibody.compiled import kernels as compiled

    [(force, index)] = modal.system.forces
    names = {"np": np, "math": math}
    functions = (modal_rhs, time_series, train_law)
    kernels = compiled.bind(functions, names, entries=("modal_rhs",))
    W = np.ascontiguousarray((modal.T[index].T @ force.W).T)
    offset = np.atleast_1d(modal.origin[index] @ force.W)
    diagonal = np.diagonal(modal.damping).copy()
    if not np.array_equal(modal.damping, np.diag(diagonal)):
        raise PeerError("the damping of the shipped train is modal")
    state, rate, now = np.zeros(2 * len(diagonal)), np.zeros(2 * len(diagonal)), np.zeros(1)
    u, du, out = (np.zeros(len(W)) for _ in range(3))
    eigenvalues, push = np.ascontiguousarray(modal.eigenvalues), np.ascontiguousarray(modal.constant)
    law = law_parameters(forces)
    made = Equations(eigenvalues, diagonal, push, W, np.ascontiguousarray(offset), law, now, state, rate, u, du, out)
    packed = Packed(made)

    def rhs(t: float, y: Any, dy: Any) -> None:
        now[0], state[:] = t, y
        kernels.modal_rhs(packed)
        dy[:] = rate

    return rhs


def law_parameters(forces: Any) -> Law:
    """Those of a train whose meshes have stiffness curves."""
    if not all(isinstance(flank, CurveFlank) for flank in forces.flanks):
        raise PeerError("peers know stiffness curves only")
    names = ("direction", "turn", "ratio", "sense", "phase", "mean", "gap", "parts")
    flanks = np.array([[getattr(flank, name) for name in names] for flank in forces.flanks])
    gyros = np.array([[g.direction, g.ratio, g.polar] for g in forces.gyros]).reshape(-1, 3)
    functions = [forces.angle, *(torque for _, torque in forces.torques)]
    torques = np.array([direction for direction, _ in forces.torques], dtype=np.int64)
    curves = curve_arrays([flank.curve for flank in forces.flanks])
    return Law(time_arrays(functions), np.zeros((len(functions), 2)), torques, flanks, curves, gyros)


def train_law(t, u, du, law, out):  # type: ignore[no-untyped-def]
    """Forces along all directions into `out`: the equations of `drivetrain.train.forces`, written out for one time."""
    times, now, torques, flanks, curves, gyros = law.times, law.now, law.torques, law.flanks, law.curves, law.gyros
    time_series(times, t, True, 2, now)
    for i in range(out.shape[0]):
        out[i] = 0.0
    for k in range(torques.shape[0]):
        out[torques[k]] += now[k + 1, 0]
    for k in range(flanks.shape[0]):
        d = int(flanks[k, 0])
        phase = flanks[k, 3] * (flanks[k, 2] * now[0, 0] + u[int(flanks[k, 1])]) + flanks[k, 4]
        low = curves.first[k]
        high = curves.first[k + 1] - 1
        period = curves.nodes[high] - curves.nodes[low]
        place = phase - math.floor((phase - curves.nodes[low]) / period) * period
        while high - low > 1:
            middle = (low + high) // 2
            if curves.nodes[middle] <= place:
                low = middle
            else:
                high = middle
        x = place - curves.nodes[low]
        c0, c1, c2, c3 = curves.cubics[low, 0], curves.cubics[low, 1], curves.cubics[low, 2], curves.cubics[low, 3]
        out[d] += flanks[k, 5] * u[d]
        approach = u[d] - flanks[k, 6]
        if approach > 0.0 or flanks[k, 7] == 0.0:
            out[d] -= (c0 + x * (c1 + x * (c2 + x * c3))) * approach
    for k in range(gyros.shape[0]):
        d = int(gyros[k, 0])
        momentum = gyros[k, 2] * (gyros[k, 1] * now[0, 1] + du[d + 2])
        out[d] -= momentum * du[d + 1]
        out[d + 1] += momentum * du[d]


def modal_rhs(at):  # type: ignore[no-untyped-def]
    """dy of the state y = (coordinates, velocities); four directions at a time, so that y is read once for all."""
    eigenvalues, diagonal, constant, W, offset = at.eigenvalues, at.diagonal, at.constant, at.W, at.offset
    y, dy, u, du, out = at.y, at.dy, at.u, at.du, at.out
    n = eigenvalues.shape[0]
    rows = W.shape[0]
    p = 0
    while p < rows:
        q1, q2, q3 = min(p + 1, rows - 1), min(p + 2, rows - 1), min(p + 3, rows - 1)
        a0, a1, a2, a3 = 0.0, 0.0, 0.0, 0.0
        b0, b1, b2, b3 = 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            value, rate = y[i], y[n + i]
            a0 += W[p, i] * value
            a1 += W[q1, i] * value
            a2 += W[q2, i] * value
            a3 += W[q3, i] * value
            b0 += W[p, i] * rate
            b1 += W[q1, i] * rate
            b2 += W[q2, i] * rate
            b3 += W[q3, i] * rate
        u[p], u[q1], u[q2], u[q3] = a0, a1, a2, a3
        du[p], du[q1], du[q2], du[q3] = b0, b1, b2, b3
        p += 4
    for k in range(rows):
        u[k] += offset[k]
    train_law(at.t[0], u, du, at.law, out)
    for i in range(n):
        dy[i] = y[n + i]
        dy[n + i] = constant[i] - eigenvalues[i] * y[i] - diagonal[i] * y[n + i]
    p = 0
    while p < rows:
        f0 = out[p]
        f1 = out[p + 1] if p + 1 < rows else 0.0
        f2 = out[p + 2] if p + 2 < rows else 0.0
        f3 = out[p + 3] if p + 3 < rows else 0.0
        q1, q2, q3 = min(p + 1, rows - 1), min(p + 2, rows - 1), min(p + 3, rows - 1)
        for i in range(n):
            dy[n + i] += W[p, i] * f0 + W[q1, i] * f1 + W[q2, i] * f2 + W[q3, i] * f3
        p += 4
    return 0


def _sundials(task: dict[str, Any], modal: Any, rhs: Rhs, start: np.ndarray, times: np.ndarray) -> States:
    from sksundae.cvode import CVODE

    scale = _scale(modal)
    solver = CVODE(
        lambda t, y, dy: rhs(t, y.copy(), dy),
        method=task["method"].split("-")[1],
        rtol=task["tolerance"],
        atol=task["tolerance"] * scale,
        max_num_steps=1_000_000,
    )
    made = solver.solve(times, start)
    return times, np.asarray(made.y)


def _scale(modal: Any) -> np.ndarray:
    """Sizes of coordinates and rates (the absolute tolerance's unit): a displacement of a micrometre of unit mass."""
    omega = np.sqrt(np.maximum(modal.eigenvalues, 1.0))
    rate = 1e-2
    return np.concatenate([rate / omega, np.full(len(omega), rate)])


def _scipy(
    approaches: list[Any], task: dict[str, Any], modal: Any, rhs: Rhs, start: np.ndarray, times: np.ndarray
) -> States:
    from scipy.integrate import solve_ivp

    work = np.empty_like(start)

    def right(t: float, y: np.ndarray) -> np.ndarray:
        rhs(t, y, work)
        return work.copy()

    method, *events = task["method"].split(", ")
    flanks = approaches if events else []
    bears = [flank(times[0], start) > 0.0 for flank in flanks]
    t, y, found = times[0], start, np.zeros((len(times), len(start)))
    while t < times[-1]:
        for flank, closed in zip(flanks, bears, strict=True):
            flank.terminal, flank.direction = True, -1.0 if closed else 1.0
        asked = (times >= t) if t == times[0] else (times > t)
        made = solve_ivp(
            right, (t, times[-1]), y, method, t_eval=times[asked], rtol=task["tolerance"],
            atol=task["tolerance"] * _scale(modal), events=flanks or None,
        )  # fmt: skip
        if not made.success:
            raise PeerError(made.message)
        found[np.flatnonzero(asked)[: len(made.t)]] = np.reshape(made.y, (len(start), -1)).T
        if made.status == 0:
            break
        k = next(i for i, at in enumerate(made.t_events) if len(at))
        t, y, bears[k] = made.t_events[k][0], made.y_events[k][0], not bears[k]
    return times, found


def _approaches(model: Any) -> list[Any]:
    """For each flank that may part a function of time and state whose zeros are where it meets and parts."""
    modal, made = model.modal, []
    for flank in model.forces.flanks:
        row = modal.T.T @ model.directions[:, flank.direction]
        rest = float(modal.origin @ model.directions[:, flank.direction]) - flank.gap
        if flank.parts:
            made.append(lambda _, y, row=row, rest=rest: row @ y[: len(row)] + rest)
    return made


def _exudyn(task: dict[str, Any], modal: Any, rhs: Rhs, start: np.ndarray, times: np.ndarray) -> States:
    """Its explicit solvers choose their own steps and do not meet the output times: theirs come back."""
    import exudyn
    import exudyn.itemInterface as items

    n = len(modal.eigenvalues)
    y, dy = np.zeros(2 * n), np.zeros(2 * n)
    container = exudyn.SystemContainer()
    system: Any = container.AddSystem()
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=np.zeros(n),
            initialCoordinates=start[:n],
            initialCoordinates_t=start[n:],
            numberOfODE2Coordinates=n,
        )
    )
    stiffness, damping = modal.eigenvalues, modal.damping

    def forces(_system: Any, t: float, _number: int, q: Any, v: Any) -> Any:
        y[:n], y[n:] = q, v
        rhs(t, y, dy)
        return dy[n:] + stiffness * y[:n] + damping @ y[n:]

    system.AddObject(
        items.ObjectGenericODE2(
            nodeNumbers=[node],
            massMatrix=np.eye(n),
            stiffnessMatrix=np.diag(stiffness),
            dampingMatrix=damping,
            forceUserFunction=forces,
        )
    )
    kinds = exudyn.OutputVariableType
    sensors = [
        system.AddSensor(items.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind))
        for kind in (kinds.Coordinates, kinds.Coordinates_t)
    ]
    system.Assemble()
    settings: Any = exudyn.SimulationSettings()
    time = settings.timeIntegration
    time.endTime, time.verboseMode = float(times[-1]), 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = float(times[1] - times[0])
    intervals = len(times) - 1
    if task["method"] == "generalized-alpha":
        kind = exudyn.DynamicSolverType.GeneralizedAlpha
        time.numberOfSteps = intervals * max(1, round(1.0 / (task["tolerance"] * intervals)))
        time.generalizedAlpha.spectralRadius = 1.0
    else:
        kind = getattr(exudyn.DynamicSolverType, task["method"])
        time.numberOfSteps = intervals
        time.relativeTolerance = task["tolerance"]
        time.absoluteTolerance = task["tolerance"] * float(np.median(_scale(modal)))
        time.minimumStepSize = 1e-12
    system.SolveDynamic(settings, solverType=kind)
    data = [np.asarray(system.GetSensorStoredData(s)) for s in sensors]
    at = data[0][:, 0].copy()
    keep = np.concatenate([[True], np.diff(at) > 1e-12])
    return at[keep], np.hstack([d[keep, 1 : n + 1] for d in data])


if __name__ == "__main__":
    serve(answer)
