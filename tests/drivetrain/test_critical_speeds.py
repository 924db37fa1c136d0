"""Critical speeds: a peak names an order and a mode that meet near its speed, or says that none does."""

import dataclasses
import math

import numpy as np
import pytest

from gearfe.cli.runup import _report_lines
from gearfe.drivetrain.runup import critical
from gearfe.drivetrain.runup.report import summary
from gearfe.drivetrain.runup.run_up import run_up
from gearfe.drivetrain.train import Damping, Load, build_train
from gearfe.gears.gearmesh.periodic import periodic_interpolant
from gearfe.multibody import constant
from tests.makers.trains import train

TEETH = 20


@pytest.fixture(scope="module")
def run():
    """One degree of freedom whose mode lies above the band; orders 2 and 7 of its stiffness pass it."""
    fine = 2.0 * math.pi / TEETH * np.arange(80) / 80
    ripple = 1e8 * (1.0 + 0.02 * np.cos(2 * TEETH * fine) + 0.02 * np.cos(7 * TEETH * fine))
    shape = periodic_interpolant(fine, ripple, 2.0 * math.pi / TEETH)
    made = train([(TEETH, 30)], stiffness=lambda _: shape, damping=Damping(ratio=0.02))
    model = build_train(dataclasses.replace(made, drive=dataclasses.replace(made.drive, speed=constant(100.0))))
    mode = float(model.coupled_frequencies_hz[0])
    resonance = 2.0 * math.pi * mode / TEETH
    speeds = resonance * np.concatenate([np.linspace(0.9, 1.1, 20) / 7, np.linspace(0.9, 1.1, 20) / 2])
    return run_up(model, speeds, band_hz=0.8 * mode, stability=False), mode, resonance


@pytest.mark.parametrize("multiples", [1, 5, 9])
def test_each_peak_names_the_order_and_the_mode_that_meet_there(run, multiples):
    """Also with modes above the band, and orders beyond the multiples of orders.csv."""
    made, mode, resonance = run
    peaks = critical.peaks_of(made, critical.critical_speeds(made, multiples))
    assert {peak["order"] for peak in peaks} == {"2 x mesh 1", "7 x mesh 1"}
    for peak in peaks:
        order = int(peak["order"].split()[0])
        assert peak["frequency_Hz"] == pytest.approx(mode, rel=0.02)
        assert peak["mode_frequency_Hz"] == pytest.approx(mode, rel=1e-9)
        assert peak["critical_speed_rad_per_s"] == pytest.approx(resonance / order, rel=1e-6)
        assert peak["speed_rad_per_s"] == pytest.approx(resonance / order, rel=0.02)
        assert peak["mode"].endswith("above band_Hz")


def test_the_table_has_those_of_the_band_and_the_multiples(run):
    made, mode, resonance = run
    assert critical.critical_speeds(made, 7).campbell.met == []
    wide = critical.critical_speeds(dataclasses.replace(made, band_hz=1.2 * mode), 5)
    assert [(c.cut.name, round(c.speed / resonance, 6)) for c in wide.campbell.met] == [
        ("5 x mesh 1", 0.2),
        ("4 x mesh 1", 0.25),
        ("3 x mesh 1", 0.333333),
        ("2 x mesh 1", 0.5),
    ]


def test_peaks_and_the_table_have_the_same_critical_speeds(run):
    made, mode, _ = run
    found = critical.critical_speeds(dataclasses.replace(made, band_hz=1.2 * mode), 9)
    table = {(c.cut.name, c.speed) for c in found.campbell.met}
    peaks = critical.peaks_of(made, found)
    assert {(peak["order"], peak["critical_speed_rad_per_s"]) for peak in peaks} <= table


def test_a_peak_without_a_mode_near_says_so(run, monkeypatch):
    """As where teeth part and the resonance bends over by more than the distance."""
    made, _, _ = run
    monkeypatch.setattr(critical, "NEAR", 1e-9)
    told = summary(made, critical.critical_speeds(made, 5))
    assert all(peak["mode"] is None and peak["mode_frequency_Hz"] is None for peak in told["peaks"])
    lines = [line for line in _report_lines(told) if line.startswith("peak at")]
    assert len(lines) == len(told["peaks"]) > 0
    assert all("meets no mode within 1e-07 % of the speed" in line for line in lines)


@pytest.mark.parametrize(
    ("orders", "mesh", "name"),
    [(((7.0, 2.0, 0.0),), "", "7 x load on s0"), (((0.5, 2.0, 0.0),), "d0-g0", "0.5 x load on s0")],
)
def test_a_peak_of_a_shaft_order_names_it(orders, mesh, name):
    """A torque on the driver's shaft, 7 times a turn or once in two mesh cycles, passes the mode; the mesh does not."""
    made = train([(TEETH, 30)], damping=Damping(ratio=0.02))
    drive = dataclasses.replace(made.drive, speed=constant(100.0), stiffness=2e4)
    loads = (*made.loads, Load("s0", "s0+", constant(0.0), orders, mesh))
    model = build_train(dataclasses.replace(made, drive=drive, loads=loads))
    mode = float(model.coupled_frequencies_hz[0])
    cycles = orders[0][0] * (TEETH if mesh else 1.0)
    resonance = 2.0 * math.pi * mode / cycles
    made_run = run_up(model, resonance * np.linspace(0.93, 1.07, 29), band_hz=1.5 * mode, stability=False)
    peaks = critical.peaks_of(made_run, critical.critical_speeds(made_run, 5))
    assert {peak["order"].split(" = ")[0] for peak in peaks} == {name}
    for peak in peaks:
        assert peak["frequency_Hz"] == pytest.approx(mode, rel=0.02)
        assert peak["mode_frequency_Hz"] == pytest.approx(mode, rel=1e-9)
        assert abs(peak["mode_distance_Hz"]) <= peak["searched_within"] * mode
        assert peak["critical_speed_rad_per_s"] == pytest.approx(resonance, rel=1e-6)
        assert peak["mode"].startswith("mode 1: torsional")


def test_orders_of_shafts_are_in_the_table(run):
    """At speeds at which the turns of the shafts reach the mode."""
    made, mode, resonance = run
    wide = dataclasses.replace(made, band_hz=1.2 * mode, speeds=made.speeds * 20.0)
    found = critical.critical_speeds(wide, 1, 3)
    names = {c.cut.name: c.speed / resonance for c in found.campbell.met}
    cycles = {"2 x shaft s0 = 3 x shaft s1": 2.0, "3 x shaft s0": 3.0, "2 x shaft s1": 4.0 / 3.0, "1 x shaft s0": 1.0}
    inside = {name: TEETH / c for name, c in cycles.items() if 0.9 * 20 / 7 <= TEETH / c <= 1.1 * 20 / 2}
    assert names == pytest.approx(inside)
    assert found.campbell.columns()["excited"].tolist() == [1] * len(names)
