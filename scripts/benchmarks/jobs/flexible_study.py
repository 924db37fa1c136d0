"""Mechanisms with one flexible link: tolerances here, steps and cables of exudyn, against its extrapolated references.

The references (tests/data, `peers.exudyn_flexible`) are exudyn's own, so its rows show how it converges, and those of
gearfe how far the two formulations are apart: cables know no shear and no rotary inertia.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np

from gearfe.base.config import build
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.mechanisms import evaluate
from gearfe.mechanisms.model import Mechanism, make_mechanism
from gearfe.multibody import integrate
from tests.places import DATA

from .peers.exudyn_flexible import REFERENCES, tables
from .peers.process import PeerError, missing, run_python
from .record import Record
from .subject import given_file
from .timing import measured

TOLERANCES, QUICK_TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6), (1e-2,)
#: Cables of exudyn, and its steps as parts of those of the reference.
SETTINGS = ((4, 16), (4, 4), (8, 4), (8, 1))


@lru_cache(maxsize=3)
def subject(name: str) -> tuple[Mechanism, np.ndarray]:
    """The mechanism, and time, position and deflection of its reference, shape (3, n)."""
    raw: Any = tables(name)
    table = np.loadtxt(given_file(DATA / f"{name}_exudyn.csv"), delimiter=",").T
    return make_mechanism(build(MechanismFile, raw, "")), table


def flexible(record: Record) -> None:
    """Error and time of every mechanism with a flexible link."""
    table = record.table("mechanism_flexible", "mechanism", "program", "setting")
    for name in ("spin_up",) if record.quick else REFERENCES:
        for tolerance in QUICK_TOLERANCES if record.quick else TOLERANCES:
            key = {"mechanism": name, "program": "gearfe", "setting": f"tolerance {tolerance:g}"}
            record.row(table, key, partial(_ours, name, tolerance, record.quick))
        if not record.peers:
            continue
        why = missing("exudyn")
        if why:
            record.say(f"  left out: {why}")
            continue
        for cables, part in SETTINGS[:1] if record.quick else SETTINGS:
            steps = REFERENCES[name][1] // part
            key = {"mechanism": name, "program": "exudyn", "setting": f"{cables} cables, {steps} steps"}
            record.row(table, key, partial(_exudyn, name, cables, steps))


def _off(name: str, position: np.ndarray, deflection: np.ndarray) -> dict[str, float]:
    """Largest differences to the reference: position in its own unit, deflection as a part of the largest."""
    _, (_, place, bend) = subject(name)
    return {
        "position_error": float(np.abs(position - place).max()),
        "deflection_error": float(np.abs(deflection - bend).max() / np.abs(bend).max()),
    }


def _ours(name: str, tolerance: float, quick: bool) -> Mapping[str, Any]:
    mechanism, (times, *_) = subject(name)
    start = mechanism.start()

    def run() -> Any:
        made = integrate(mechanism.system, times, start=start, tolerance=tolerance)
        return made, made.q

    (made, _), cost = measured(run, runs=1 if quick else 3)
    found = evaluate(mechanism, made).outputs
    place = found["position" if "position" in found else "slider_x_m"]
    return {**_off(name, place, found["deflection_m"]), **cost.columns, "steps": int(made.statistics["steps"])}


def _exudyn(name: str, cables: int, steps: int) -> Mapping[str, Any]:
    rows, end = REFERENCES[name][2:]
    task = {"mechanism": name, "elements": cables, "steps": steps, "rows": rows, "end": end}
    try:
        answer = run_python("exudyn_flexible", task, limit=120.0)
    except PeerError as failure:
        return {"status": str(failure)}
    position, deflection = np.array(answer.pop("position")), np.array(answer.pop("deflection"))
    return {**_off(name, position, deflection), **answer, "steps": steps}
