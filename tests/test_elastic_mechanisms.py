"""Mechanisms with a flexible link against exudyn (tests/data, written by benchmarks/peers/exudyn_flexible)."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearfe.config import build
from gearfe.mechanisms import evaluate
from gearfe.mechanisms.model import make_mechanism
from gearfe.rigid import integrate
from gearfe.tables.mechanism import MechanismFile
from tests.benchmarks.peers.exudyn_flexible import tables
from tests.benchmarks.subject import DATA


def off(mechanism: str, tolerance: float) -> tuple[float, float, float]:
    """Largest differences of position and deflection over the run, and the largest deflection."""
    raw: dict[str, Any] = tables(mechanism)
    time, position, deflection = np.loadtxt(DATA / f"{mechanism}_exudyn.csv", delimiter=",").T
    made = make_mechanism(build(MechanismFile, raw, ""))
    run = integrate(made.system, time, start=made.start(), tolerance=tolerance)
    found = evaluate(made, run).outputs
    place = found["position" if "position" in found else "slider_x_m"]
    largest = np.abs(deflection).max()
    return (
        float(np.abs(place - position).max()),
        float(np.abs(found["deflection_m"] - deflection).max()),
        float(largest),
    )


def test_andrews_with_a_steel_strip_as_coupler() -> None:
    """Within exudyn's own errors, 2e-6 rad of its steps and 4e-8 m of its elements; the crank turns by 16.4 rad.

    The strip is 140 times as long as thick: shear and rotary inertia, which the cable lacks, are 2e-5 of it.
    """
    angles, deflections = [], []
    for tolerance in (1e-4, 1e-5, 1e-6):
        angle, deflection, largest = off("elastic_andrews", tolerance)
        angles.append(angle)
        deflections.append(deflection / largest)
    assert angles[-1] < 2e-6
    assert deflections[-1] < 4e-8 / 8.1e-5
    assert np.polyfit([-4.0, -5.0, -6.0], np.log10(angles), 1)[0] > 0.8  # the error follows the tolerance
    assert deflections[0] > 5 * deflections[-1]


def test_slider_crank_with_an_elastic_rod() -> None:
    """Up to 150 rad/s; shear and rotary inertia, which the cable leaves out, are 0.3 % of the bending of this rod.

    The first frequency of a hinged beam falls by (pi h / L)^2 / 24 (1 + E / k G) = 0.12 %; its compliance grows by
    twice that.
    """
    place, deflection, largest = off("elastic_slider_crank", 1e-6)
    assert place < 5e-7
    assert deflection < 0.0025 * largest


def test_two_elements_do() -> None:
    """They bend as exudyn's eight within 0.2 %."""
    raw: dict[str, Any] = tables("elastic_andrews")
    raw["bodies"]["b2"]["beam"]["elements"] = 2
    time, _, deflection = np.loadtxt(DATA / "elastic_andrews_exudyn.csv", delimiter=",").T
    made = make_mechanism(build(MechanismFile, raw, ""))
    found = evaluate(made, integrate(made.system, time, start=made.start(), tolerance=1e-5)).outputs["deflection_m"]
    assert np.abs(found - deflection).max() < 0.002 * np.abs(deflection).max()
