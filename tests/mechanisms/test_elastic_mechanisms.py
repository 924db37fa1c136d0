"""Mechanisms with a flexible link against exudyn.

The references are in tests/data, written by scripts/benchmarks/jobs/peers/exudyn_flexible.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.mechanisms import evaluate
from gearfe.mechanisms.model import make_mechanism
from gearfe.multibody import integrate
from scripts.benchmarks.jobs.peers.exudyn_flexible import tables
from tests.places import DATA


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

    The strip is 140 times as long as thick: shear and rotary inertia, which the cable lacks, are 2e-5 of it. Single
    errors scatter by up to six times with where the steps happen to end, so that the order is taken over many.
    """
    angle, deflection, largest = off("elastic_andrews", 1e-6)
    assert angle < 2e-6
    assert deflection < 4e-8
    assert largest == pytest.approx(8.1e-5, rel=0.02)
    powers = np.arange(-2.0, -4.1, -0.25)  # below, exudyn's errors are in the difference
    errors = np.array([off("elastic_andrews", 10.0**power)[:2] for power in powers])
    assert np.polyfit(powers, np.log10(errors[:, 0]), 1)[0] > 0.8  # the error follows the tolerance
    assert errors[:3, 1].min() > 5 * deflection


def test_slider_crank_with_an_elastic_rod() -> None:
    """Up to 150 rad/s; shear and rotary inertia, which the cable leaves out, are 0.3 % of the bending of this rod.

    The first frequency of a hinged beam falls by (pi h / L)^2 / 24 (1 + E / k G) = 0.12 %; its compliance grows by
    twice that.
    """
    place, deflection, largest = off("elastic_slider_crank", 1e-6)
    assert place < 5e-7
    assert deflection < 0.0025 * largest


def test_a_beam_spins_up_within_a_hundred_thousandth_of_its_length() -> None:
    """To 6 rad/s within 15 s; the tip (m) over 20 s, of a length of 10 m: exudyn's steps leave 1e-5 m."""
    errors = [off("spin_up", tolerance)[:2] for tolerance in (1e-4, 1e-5)]
    assert errors[0][0] < 1e-4 * 10.0
    assert errors[1][0] < 2.5e-5 * 10.0
    assert errors[1][1] < 3e-5


def test_two_elements_do() -> None:
    """They bend as exudyn's eight within 0.2 %."""
    raw: dict[str, Any] = tables("elastic_andrews")
    raw["bodies"]["b2"]["beam"]["elements"] = 2
    time, _, deflection = np.loadtxt(DATA / "elastic_andrews_exudyn.csv", delimiter=",").T
    made = make_mechanism(build(MechanismFile, raw, ""))
    found = evaluate(made, integrate(made.system, time, start=made.start(), tolerance=1e-5)).outputs["deflection_m"]
    assert np.abs(found - deflection).max() < 0.002 * np.abs(deflection).max()


def crank(length: float = 1.0, mass: float = 1.0, *, turned_round: bool = False) -> dict[str, Any]:
    """Slider crank with every length and mass times a factor, times as they are; entries in the opposite order."""
    raw = tables("elastic_slider_crank")
    raw["run"] |= {"end_s": 0.03, "step_s": 1e-3}
    for body in raw["bodies"].values():
        for key in ("position_m", "centre_m"):
            if key in body:
                body[key] = [length * x for x in body[key]]
        body["points_m"] = {name: [length * x for x in at] for name, at in body.get("points_m", {}).items()}
        if "mass_kg" in body:
            body["mass_kg"] *= mass
            body["inertia_kg_m2"] *= mass * length**2
        for key in ("length_m", "width_m", "height_m"):
            if "beam" in body:
                body["beam"][key] *= length
    raw["bodies"]["rod"]["beam"]["density_kg_per_m3"] *= mass / length**3
    raw["bodies"]["rod"]["beam"]["youngs_modulus_GPa"] *= mass / length
    if turned_round:
        raw |= {key: dict(reversed(raw[key].items())) for key in ("bodies", "joints")}
    return raw


def test_neither_units_nor_order_count() -> None:
    """Lengths and masses in other units, bodies and joints in another order: the same motion and forces."""
    times = np.linspace(0.0, 0.03, 31)

    def found(length: float = 1.0, mass: float = 1.0, *, turned_round: bool = False) -> np.ndarray:
        made = make_mechanism(build(MechanismFile, crank(length, mass, turned_round=turned_round), ""))
        run = integrate(made.system, times, start=made.start(), tolerance=1e-5)
        out = evaluate(made, run).outputs
        units = {"slider_x_m": length, "deflection_m": length, "axial_force_N": mass * length}
        return np.stack([out[name] / unit for name, unit in units.items()])

    base = found()
    size = np.abs(base).max(axis=1, keepdims=True)
    for other in (found(1e3, 1.0), found(1e-6, 1e9), found(turned_round=True)):
        assert (np.abs(other - base) < 1e-5 * size).all()


def test_undamped_links_keep_their_energy() -> None:
    """A steel rod falls on its hinge: 1,000 periods of its bending, of (3.9266)^2 (E I / rho A)^0.5 / L^2 rad/s.

    Energies are those of the elements, apart from the integrator's own numbers.
    """
    raw: dict[str, Any] = {
        "run": {"end_s": 1.0, "step_s": 0.01},
        "bodies": {
            "rod": {
                "angle_deg": -30.0,
                "beam": {
                    "length_m": 1.0, "width_m": 0.02, "height_m": 0.02, "youngs_modulus_GPa": 200.0,
                    "density_kg_per_m3": 7850.0, "elements": 2,
                },
            }
        },
        "joints": {"O": {"type": "hinge", "body": "rod"}},
        "forces": {"gravity": {"type": "gravity", "acceleration_m_per_s2": [0.0, -9.81]}},
    }  # fmt: skip
    made = make_mechanism(build(MechanismFile, raw, ""))
    period = 2.0 * np.pi / (3.9266**2 * np.sqrt(200e9 / 7850.0 / 12.0) * 0.02)
    times = np.linspace(0.0, 1000.0 * period, 1001)
    run = integrate(made.system, times, start=made.start(), tolerance=1e-6, method="symplectic")
    kinetic, potential = made.system.energy(run.q, run.v)
    off = np.abs(kinetic + potential - kinetic[0] - potential[0])
    assert kinetic.max() > 7.0  # J
    assert off.max() < 1e-8 * kinetic.max()
    assert off[500:].max() < 3.0 * off[:500].max()  # and no more later than before
