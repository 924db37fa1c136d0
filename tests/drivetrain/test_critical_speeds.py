"""Critical speeds: a peak names an order and a mode that meet near its speed, or says that none does."""

import dataclasses
import math

import numpy as np
import pytest

from gearfe.cli.runup import _report_lines
from gearfe.drivetrain.runup import critical
from gearfe.drivetrain.runup.report import summary
from gearfe.drivetrain.runup.run_up import run_up
from gearfe.drivetrain.train import Damping, build_train
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
    assert critical.critical_speeds(made, 7).met == []
    wide = critical.critical_speeds(dataclasses.replace(made, band_hz=1.2 * mode), 5)
    assert [(c.cut.multiple, round(c.speed / resonance, 6)) for c in wide.met] == [
        (5, 0.2),
        (4, 0.25),
        (3, 0.333333),
        (2, 0.5),
    ]
    inside = {(c.speed, c.cut.names) for c in wide.wider}
    assert all((c.speed, c.cut.names) in inside for c in wide.met)


def test_a_peak_without_a_mode_near_says_so(run, monkeypatch):
    """As where teeth part and the resonance bends over by more than the distance."""
    made, _, _ = run
    monkeypatch.setattr(critical, "NEAR", 1e-9)
    told = summary(made, critical.critical_speeds(made, 5))
    assert all(peak["mode"] is None and peak["mode_frequency_Hz"] is None for peak in told["peaks"])
    lines = [line for line in _report_lines(told) if line.startswith("peak at")]
    assert len(lines) == len(told["peaks"]) > 0
    assert all("meets no mode within 1e-07 % of the speed" in line for line in lines)
