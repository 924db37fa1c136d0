"""Runs that are handed over piece by piece: the same as at once, in the memory of a piece."""

from __future__ import annotations

import gc
import importlib
import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from gearfe.base.progress import Stopwatch
from gearfe.base.record_spectrum import finer
from gearfe.drivetrain.train import Damping, Load, build_train, simulate
from gearfe.drivetrain.train.response import SAMPLED, joined
from gearfe.drivetrain.train.simulate import simulate_in_pieces
from gearfe.drivetrain.vibration.files import OutputChoice, write_run
from gearfe.drivetrain.vibration.follow import Envelope, RunningMean, TrainRun
from gearfe.figures.spectra import largest_lines
from gearfe.multibody import smoothed_step
from tests.makers.train_responses import made_up, table
from tests.makers.trains import TORQUE, curve, train

simulation = importlib.import_module("gearfe.drivetrain.train.simulate")


@pytest.fixture(scope="module")
def model():
    return build_train(train([(20, 30)], stiffness=lambda z: curve(z, 1e8, 0.3), damping=Damping(ratio=0.02)))


@pytest.fixture
def small_pieces(monkeypatch):
    """Pieces of 300 samples."""
    monkeypatch.setattr(simulation, "PIECE_NUMBERS", 1)
    monkeypatch.setattr(simulation, "LEAST_SAMPLES", 300)


def test_pieces_are_the_run_at_once(model, monkeypatch, small_pieces):
    """Forces and accelerations within the tolerance; times, and what is counted, the same."""
    times = 4e-6 * np.arange(2001)
    pieces = list(simulate_in_pieces(model, times, tolerance=1e-9, estimate=True))
    assert len(pieces) >= 7
    together = joined(pieces)
    monkeypatch.undo()
    once = simulate(model, times, tolerance=1e-9, estimate=True)
    assert (together.time == times).all()
    for name in SAMPLED:
        one, two = getattr(together, name), getattr(once, name)
        if one is not None:
            assert one == pytest.approx(two, rel=1e-7, abs=1e-7 * np.abs(two).max(initial=0.0)), name
    assert together.status == once.status == "done"
    assert together.time_reached == times[-1]
    assert once.statistics["steps"] <= together.statistics["steps"] <= 1.5 * once.statistics["steps"]
    assert 0.0 < together.estimates["integration"] < 1e-7
    force = together.contact_force[:, 0]
    assert together.statistics["smallest_contact_force_N"] == [force.min()]


def test_what_a_run_says_is_of_all_its_pieces(small_pieces):
    """Most of the load ends at once after 3 ms, so the undamped spring pulls: the last piece tells it, and when."""
    loads = tuple(Load("s1", "s1+", smoothed_step(at, 2e-5, TORQUE * part)) for at, part in ((1e-3, -1.0), (3e-3, 0.9)))
    light = build_train(train([(20, 30)], stiffness=1e8, loads=loads))
    times = 4e-6 * np.arange(2001)
    pieces = list(simulate_in_pieces(light, times))
    whole = joined(pieces)
    force = whole.contact_force[:, 0]
    assert force.min() < 0.0
    assert not any(piece.warnings for piece in pieces[:-1])
    assert f"{force.min():.5g} N at {1e3 * times[force.argmin()]:.5g} ms" in whole.warnings[0]


def test_a_piece_holds_its_steps_too(model, small_pieces):
    """Output times that are far apart: a piece is no longer than 300 samples of the fastest mode would be."""
    times = 100.0 / float(model.coupled_frequencies_hz.max()) * np.arange(5)
    assert len(list(simulate_in_pieces(model, times))) == 4


def test_the_files_of_pieces(model, tmp_path, small_pieces):
    """Byte for byte those of the same response at hand."""
    outputs = 40e-6 * np.arange(201)
    times, every = finer(outputs, float(model.coupled_frequencies_hz.max()))
    pieces = list(simulate_in_pieces(model, times))
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()

    def written(name, parts):
        planned = TrainRun(model, outputs, lambda _: parts, every)
        return write_run(tmp_path / name, planned, OutputChoice(), watch=Stopwatch())

    one, two = written("one", pieces), written("two", [joined(pieces)])
    assert one.names == two.names == ("bearings.csv", "response.csv", "spectrum.csv", "summary.json")
    texts = [(tmp_path / folder / "response.csv").read_text() for folder in ("one", "two")]
    assert texts[0] == texts[1]
    assert table(tmp_path / "one" / "response.csv")[1].shape[0] == 201
    spectra = [table(tmp_path / folder / "spectrum.csv")[1] for folder in ("one", "two")]
    assert spectra[0] == pytest.approx(spectra[1], rel=1e-9, abs=1e-9)
    summaries = [json.loads((tmp_path / folder / "summary.json").read_text()) for folder in ("one", "two")]
    for name in ("mean_contact_forces_N", "smallest_contact_forces_under_load_N", "largest_contact_forces_N"):
        assert summaries[0][name] == pytest.approx(summaries[1][name], rel=1e-8), name


def test_a_long_run_needs_the_memory_of_a_piece(model, tmp_path, small_pieces):
    """Four times the samples, less than a quarter more memory."""

    def peak(count):
        outputs = 40e-6 * np.arange(count + 1)
        every = finer(outputs, float(model.coupled_frequencies_hz.max()))[1]

        def pieces(times):
            return simulate_in_pieces(model, finer(times, float(model.coupled_frequencies_hz.max()))[0])

        gc.collect()
        tracemalloc.start()
        write_run(tmp_path, TrainRun(model, outputs, pieces, every), OutputChoice(), watch=Stopwatch())
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(100)
    short = peak(250)
    one_by_one = 8 * 20 * 750  # kept for the spectra: twice the outputs for each signal
    assert peak(1000) < 1.25 * short + 4 * one_by_one


def test_a_run_that_ends_early_is_made_again(tmp_path, model):
    """Its spectra are those of the time that it reached."""
    whole = made_up()
    asked = []

    def pieces(times):
        asked.append(len(times))
        status = "diverged" if len(times) > 121 else "done"
        return [replace(whole.at(np.arange(121)), status=status, time_reached=float(whole.time[120]))]

    choice = OutputChoice(spectrum_start=6e-3)
    written = write_run(tmp_path, TrainRun(model, whole.time, pieces), choice, watch=Stopwatch())
    assert asked == [201, 121]
    assert written.response.status == "diverged"
    assert written.spectra.spectrum.resolution == pytest.approx(1 / (120 * 35e-6))
    assert len(table(tmp_path / "response.csv")[1]) == 121
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "diverged"


def test_the_mean_of_pieces():
    """A parabola from 0.2 s on, whatever the pieces; the splines are exact for it."""
    time = np.linspace(0.0, 1.0, 201)
    for pieces in (1, 3, 50, 101):
        mean = RunningMean(time, 0.1, 0.4)
        for part in np.array_split(time, pieces):
            mean.add(part, (part**2)[:, None])
        assert mean.periods == 2
        assert mean.value == pytest.approx([(1 - 0.2**3) / 3 / 0.8], rel=1e-9), pieces


@pytest.mark.parametrize("pieces", [1, 7, 40])
def test_envelopes(pieces):
    """Least and largest values of each part of the run, wherever it is cut; few samples stay as they are."""
    values = np.random.default_rng(2).standard_normal((1003, 2))
    whole, few = Envelope(1003, 100), Envelope(1003, 1003)
    at = 0
    for part in np.array_split(values, pieces):
        whole.add(at, part)
        few.add(at, part)
        at += len(part)
    assert (few.values() == values).all()
    rows = whole.values()
    parts = [values[i : i + 11] for i in range(0, 1003, 11)]
    assert (rows[::2] == [part.min(axis=0) for part in parts]).all()
    assert (rows[1::2] == [part.max(axis=0) for part in parts]).all()


def test_the_largest_of_many_lines():
    """No line is lost to the eye: each group of neighbours shows its largest; few lines are shown as they are."""
    value = np.abs(np.random.default_rng(3).standard_normal(50_001))
    value[[7, 12_345, 40_000]] = 50.0, 60.0, 70.0
    frequency = 1e-3 * np.arange(50_001)
    shown, height = largest_lines(frequency, value, 45.0)
    assert len(shown) <= 2001
    assert height[0] == value[0]
    tall = shown[1:][height[1:] > 10.0]
    assert tall == pytest.approx([0.007, 12.345, 40.0], abs=0.5 * 45.0 / 1999)
    assert np.diff(shown).min() > 0.0
    few = largest_lines(frequency[:101], value[:101], 1.0)
    assert (few[1] == value[:101]).all()
