"""The shipped gear train: every integrator x tolerance, number of modes of the housing; other programs beside.

The error is the largest of all contact forces, shaft accelerations and attachment accelerations at the output times,
each against its own largest value, held against a run of 1e-12.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from gearfe.drivetrain.train import simulate
from gearfe.drivetrain.train.states import train_states

from .peers.process import PeerError, missing, run_python
from .record import Record
from .subject import train_model, train_times
from .timing import measured

VARIANTS = ("undamped_springs", "operating", "parting")
#: The damped ones: without damping every error of a fast mode stays for ever, and low orders never get right.
PEERS_VARIANTS = ("operating", "parting")
TOLERANCES, QUICK_TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10), (1e-3, 1e-5)
IMPLICIT, QUICK_IMPLICIT = (1e-2, 1e-3), (1e-2,)
MODES, QUICK_MODES = (10, 20, 40, 60, 80, 100), ()
#: Housing modes that count as all.
MOST_MODES = 160
#: Samples of the study of modes (s): half their frequency lies above every mode of the coupled system.
FINE_STEP = 2.5e-6


def run_transient(record: Record) -> None:
    """All tables of the transient."""
    tolerances(record)
    if record.peers:
        others(record)
    modes(record)


@lru_cache(maxsize=3)
def subject(variant: str, quick: bool) -> tuple[Any, np.ndarray, np.ndarray]:
    """Model, output times, and the signals of a run at 1e-12."""
    model, times = train_model(variant, quick=quick), train_times(quick)
    return model, times, signals_of(simulate(model, times, tolerance=1e-12))


def signals_of(response: Any) -> np.ndarray:
    """(n, s) contact forces, accelerations of shafts and attachments."""
    return np.hstack([response.contact_force, response.acceleration, response.attachment_acceleration])


def error_of(signals: np.ndarray, truth: np.ndarray) -> float:
    """Largest error of all signals, each against its own largest value (signals that stay zero are left out)."""
    if signals.shape != truth.shape:
        return float("nan")
    size = np.abs(truth).max(axis=0)
    moving = size > 1e-9 * size.max()
    return float((np.abs(signals - truth).max(axis=0)[moving] / size[moving]).max())


def errors_of(signals: np.ndarray, truth: np.ndarray, model: Any) -> dict[str, float]:
    """Largest error of all signals, and of the contact forces alone."""
    if signals.shape != truth.shape:
        return {"error": float("nan"), "force_error": float("nan")}
    count = len(model.meshes)
    return {"error": error_of(signals, truth), "force_error": error_of(signals[:, :count], truth[:, :count])}


def tolerances(record: Record) -> None:
    """Error against time, 0..7 ms; the kernels are loaded before."""
    table = record.table("transient_tolerance", "variant", "program", "method", "tolerance")
    for variant in VARIANTS[:1] if record.quick else VARIANTS:
        for method in ("taylor", "implicit"):
            asked: tuple[float, ...]
            if method != "implicit":
                asked = QUICK_TOLERANCES if record.quick else TOLERANCES
            elif variant != PEERS_VARIANTS[0] and not record.quick:
                continue
            else:
                asked = QUICK_IMPLICIT if record.quick else IMPLICIT
            for tolerance in asked:
                key = {"variant": variant, "program": "gearfe", "method": method, "tolerance": tolerance}
                record.row(table, key, partial(_ours, variant, method, tolerance, record.quick))


def _ours(variant: str, method: str, tolerance: float, quick: bool) -> Mapping[str, Any]:
    model, times, truth = subject(variant, quick)

    def run() -> Any:
        return simulate(model, times, tolerance=tolerance, method=method)

    fast = method != "implicit" and not quick
    made, cost = measured(run, runs=5 if fast else 1, least_s=0.2 if fast else 0.0)
    found, free = errors_of(signals_of(made), truth, model), model.modal.T.shape[1]
    return {**found, **cost.columns, "steps": made.statistics["steps"], "unknowns": free}


def others(record: Record) -> None:
    """The same right-hand side by other integrators, in the same table."""
    table = record.table("transient_tolerance", "variant", "program", "method", "tolerance")
    for variant, peer in itertools.product(PEERS_VARIANTS, ("sundials", "exudyn", "scipy_ivp")):
        why = missing(peer)
        if why:
            record.say(f"  left out: {why}")
            continue
        for method, tolerance in _settings(peer, variant, record.quick):
            key = {"variant": variant, "program": peer, "method": method, "tolerance": tolerance}
            record.row(table, key, partial(_theirs, variant, peer, method, tolerance, record.quick))


def _theirs(variant: str, peer: str, method: str, tolerance: float, quick: bool) -> Mapping[str, Any]:
    model, times, truth = subject(variant, quick)
    task = {"peer": peer, "variant": variant, "method": method, "tolerance": tolerance, "quick": quick}
    try:
        answer = run_python("train_transient", task, limit=150.0)
    except PeerError as error:
        return {"error": float("nan"), "status": str(error)}
    at, states = np.array(answer.pop("times")), np.array(answer.pop("states"))
    if len(at) != len(times) or np.abs(at - times).max() > 1e-12:
        truth = signals_of(simulate(model, at, tolerance=1e-12))
    found = states_signals(model, at, states)
    return {**errors_of(found, truth, model), **answer}


def _settings(peer: str, variant: str, quick: bool) -> list[tuple[str, float]]:
    if variant == "parting" and not quick:
        found = {
            "sundials": [("CVODE-Adams", 1e-7)],
            "exudyn": [("DOPRI5", 1e-6), ("DOPRI5", 1e-8)],
            "scipy_ivp": [("DOP853, events", t) for t in (1e-4, 1e-6, 1e-8)],
        }
        return found[peer]
    if quick:
        return [{"sundials": ("CVODE-Adams", 1e-4), "exudyn": ("DOPRI5", 1e-4), "scipy_ivp": ("DOP853", 1e-4)}[peer]]
    if peer == "exudyn":
        return [("DOPRI5", 1e-6), ("DOPRI5", 1e-8), ("generalized-alpha", 2e-3), ("generalized-alpha", 5e-4)]
    if peer == "sundials":
        return [
            (m, t) for m in ("CVODE-Adams", "CVODE-BDF") for t in (1e-5, 1e-7, 1e-9) if (m, t) != ("CVODE-BDF", 1e-9)
        ]
    return [("DOP853", 1e-4), ("DOP853", 1e-6), ("DOP853", 1e-8), ("LSODA", 1e-6), ("RK45", 1e-5)]


def states_signals(model: Any, times: np.ndarray, states: np.ndarray) -> np.ndarray:
    """The compared signals of states (coordinates, rates) at the output times."""
    if states.shape != (len(times), 2 * model.modal.T.shape[1]):
        return np.zeros((0, 0))
    trajectory: Any = SimpleNamespace(time=times, method="taylor", dense=SimpleNamespace(state=lambda _: states))
    moved = train_states(model, trajectory)
    push = model.angle(times, 2)[:, None] * model.ratios
    return np.hstack([moved.contact_force, push + moved.a @ model.spin_reference.T, moved.a @ model.axial.T])


def modes(record: Record) -> None:
    """Number of the housing's modes against contact forces and attachment accelerations, operating.

    Sampled finely: the corners of the stiffness curves ring modes far above the band, which the shipped job's output
    step of 35 us would fold down into it.
    """
    table = record.table("transient_modes", "modes")
    times = FINE_STEP * np.arange(round(train_times(False)[-1] / FINE_STEP) + 1)

    @lru_cache(maxsize=1)
    def truth() -> Any:
        return simulate(train_model("operating", modes=MOST_MODES), times, tolerance=1e-8)

    def make(count: int) -> Mapping[str, Any]:
        model, right = train_model("operating", modes=count), truth()
        _, cost = measured(lambda: simulate(model, train_times(False), tolerance=1e-6), runs=5, least_s=0.2)
        made = simulate(model, times, tolerance=1e-8)
        forces = np.abs(made.contact_force - right.contact_force).max(axis=0) / right.contact_force.max(axis=0)
        found = {"unknowns": model.modal.T.shape[1], "force_error": float(forces.max())}
        for name, limit in (("acceleration_error", 5e3), ("wide_error", 14e3)):
            low, true = (lines_below(x.attachment_acceleration, FINE_STEP, limit) for x in (made, right))
            found[name] = float((np.linalg.norm(low - true, axis=0) / np.linalg.norm(true, axis=0)).max())
        return {**found, **cost.columns}

    for count in QUICK_MODES if record.quick else MODES:
        record.row(table, {"modes": count}, partial(make, count))


def lines_below(signals: np.ndarray, step: float, limit_hz: float) -> np.ndarray:
    """Spectra of signals (n, s) up to a frequency, through a Hann window: the record's ends make no lines."""
    spectra = np.fft.rfft(signals * np.hanning(len(signals))[:, None], axis=0)
    return np.asarray(spectra[np.fft.rfftfreq(len(signals), step) <= limit_hz])
