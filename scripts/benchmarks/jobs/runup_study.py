"""Steady running of the shipped train: harmonic balance beside transients that run until they repeat.

The error is the largest of all contact forces over one period, against the largest force, from a transient of this
program that ran `LONG` seconds at 1e-10. The others integrate the same right-hand side from rest, compiled, and are
looked at over their last period; this program does, too, once by its transient.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np

from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.train import simulate

from .peers.process import PeerError, missing, run_python
from .record import Record
from .subject import PARTING_SPEED, train_model
from .timing import measured
from .transient_study import states_signals

#: Variant and speeds of the drive (rad/s); in those of the first no teeth part.
SPEEDS = {"operating": (450.0, 600.0, 850.0), "parting": (PARTING_SPEED,)}
QUICK_SPEEDS = {"operating": (600.0,)}
TOLERANCES = (1e-2, 1e-3, 1e-4)
#: Seconds that a transient runs: for the truth, and for the comparison.
LONG, QUICK_LONG = 0.8, 0.01
SPANS, QUICK_SPANS = (0.1, 0.2), (0.005,)
#: Output times of a period: of the truth, whose forces have corners, and of the comparison.
FINE, SAMPLES = 4096, 64
#: Speeds of a run-up (rad/s); those above are among them.
RANGE = np.linspace(200.0, 1200.0, 201)


def run_runup(record: Record) -> None:
    """Both tables are one: a row for each way to a steady state."""
    table = record.table("runup_peers", "variant", "speed", "program", "method", "tolerance", "span_s")
    quick = record.quick

    def row(make: Any, variant: str, speed: float, program: str, method: str, tolerance: float, span: float) -> None:
        given = (variant, speed, program, method, tolerance, span)
        key = dict(zip(("variant", "speed", "program", "method", "tolerance", "span_s"), given, strict=True))
        record.row(table, key, partial(make, *given, quick))

    for variant, speeds in (QUICK_SPEEDS if quick else SPEEDS).items():
        for speed in speeds:
            for tolerance in TOLERANCES[:1] if quick else TOLERANCES:
                row(_balance, variant, speed, "gearfe", "harmonic balance", tolerance, 0.0)
            for span in QUICK_SPANS if quick else SPANS:
                row(_transient, variant, speed, "gearfe", "taylor", 1e-6, span)
        if not quick and variant == "operating":
            row(_run_up, variant, speeds[1], "gearfe", "harmonic balance in a run-up of 201 speeds", 1e-3, 0.0)
    if not record.peers:
        return
    for variant, speeds in SPEEDS.items():
        events = ", events" if variant == "parting" else ""
        for peer, method, spans in (("scipy_ivp", f"DOP853{events}", SPANS), ("exudyn", "DOPRI5", SPANS[:1])):
            why = missing(peer)
            if why:
                record.say(f"  left out: {why}")
                continue
            for speed in speeds if peer == "scipy_ivp" else speeds[-1:]:
                for span in spans:
                    row(_theirs, variant, speed, peer, method, 1e-6, span)


@lru_cache(maxsize=8)
def model_at(variant: str, speed: float, quick: bool) -> Any:
    """The train at a speed."""
    return train_model(variant, quick=quick, speed=speed)


def period_of(variant: str, speed: float, quick: bool) -> float:
    """Common period of the meshes (s)."""
    turns = model_at(variant, speed, quick).kinematics.common_turns
    return 2.0 * np.pi * float(turns) / speed


@lru_cache(maxsize=8)
def truth(variant: str, speed: float, quick: bool) -> np.ndarray:
    """(K + 1, meshes) harmonics of the contact forces over the period, from a long transient."""
    model, period = model_at(variant, speed, quick), period_of(variant, speed, quick)
    begin = round((QUICK_LONG if quick else LONG) / period)
    times = np.concatenate([[0.0], period * (begin + np.arange(FINE) / FINE)])
    made = simulate(model, times, tolerance=1e-10)
    lines = np.fft.rfft(made.contact_force[1:], axis=0)[: FINE // 2] * (2.0 / FINE)
    lines[0] *= 0.5
    return np.asarray(lines)


def error_of(force: np.ndarray, times: np.ndarray, variant: str, speed: float, quick: bool) -> float:
    """Of contact forces (n, meshes) at times (s) that begin with a period."""
    harmonics = truth(variant, speed, quick)
    phase = 2.0 * np.pi * times[:, None] / period_of(variant, speed, quick)
    right = (np.exp(1j * phase * np.arange(len(harmonics))) @ harmonics).real
    return float((np.abs(force - right).max(axis=0) / np.abs(right).max(axis=0)).max())


def _balance(
    variant: str, speed: float, _program: str, _method: str, tolerance: float, _span: float, quick: bool
) -> Mapping[str, Any]:
    model = model_at(variant, speed, quick)
    made, cost = measured(
        lambda: steady_state(model, speed, tolerance=tolerance, stability=False),
        runs=1 if quick else 5,
        least_s=0.0 if quick else 0.2,
    )
    times = made.period * np.arange(len(made.force)) / len(made.force)
    return {"error": error_of(made.force, times, variant, speed, quick), **cost.columns}


def _run_up(
    variant: str, speed: float, _program: str, _method: str, tolerance: float, _span: float, quick: bool
) -> Mapping[str, Any]:
    """Its time is that of one of the speeds, its error the largest at the speeds of the others."""
    model = model_at(variant, speed, quick)
    run, cost = measured(lambda: run_up(model, RANGE, tolerance=tolerance, stability=False), runs=3)
    found = []
    for state in run.states:
        if state.speed in SPEEDS[variant]:
            times = state.period * np.arange(len(state.force)) / len(state.force)
            found.append(error_of(state.force, times, variant, state.speed, quick))
    each = {name: value / len(RANGE) if name.endswith("_s") else value for name, value in cost.columns.items()}
    return {"error": max(found), **each}


def last_period(variant: str, speed: float, span: float, quick: bool) -> tuple[np.ndarray, int]:
    """Even output times from 0 on over about a span (s), whole periods of them; and how many make the last one."""
    period = period_of(variant, speed, quick)
    count = max(1, round(span / period))
    return period * np.arange(count * SAMPLES + 1) / SAMPLES, SAMPLES


def _transient(
    variant: str, speed: float, _program: str, _method: str, tolerance: float, span: float, quick: bool
) -> Mapping[str, Any]:
    model = model_at(variant, speed, quick)
    times, last = last_period(variant, speed, span, quick)
    asked = np.concatenate([times[:1], times[-last:]])
    made, cost = measured(
        lambda: simulate(model, asked, tolerance=tolerance),
        runs=1 if quick else 3,
    )
    return {"error": error_of(made.contact_force[1:], asked[1:], variant, speed, quick), **cost.columns}


def _theirs(
    variant: str, speed: float, program: str, method: str, tolerance: float, span: float, quick: bool
) -> Mapping[str, Any]:
    times, last = last_period(variant, speed, span, quick)
    task = {
        "peer": program, "variant": variant, "method": method, "tolerance": tolerance, "quick": quick,
        "speed": speed, "times": [float(times[1]), len(times)], "last": last,
    }  # fmt: skip
    try:
        answer = run_python("train_transient", task, limit=300.0)
    except PeerError as error:
        return {"error": float("nan"), "status": str(error)}
    at, states = np.array(answer.pop("times")), np.array(answer.pop("states"))
    model = model_at(variant, speed, quick)
    force = states_signals(model, at, states)[:, : len(model.meshes)]
    return {"error": error_of(force, at, variant, speed, quick), **answer}
