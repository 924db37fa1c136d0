"""Spectra over short times, orders, the steady part and measured spectra, against closed forms."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.drivetrain.train.response import TrainResponse
from gearfe.drivetrain.vibration.measured import read_universal
from gearfe.drivetrain.vibration.short_time import Tracked, averaged, order_tracks, short_time, steady_from
from tests.makers.job_texts import SMALL_TRAIN

STEP = 2e-5
TIME = STEP * np.arange(25_001)  # 0.5 s


def ramp(start: float, rate: float):
    """Angle of a shaft whose speed is start + rate t."""
    return start * TIME + 0.5 * rate * TIME**2


# -------------------------------------------------------------------------------------------------- spectra, orders


@pytest.mark.parametrize(("start", "rate"), [(100.0, 1000.0), (700.0, -1000.0), (-100.0, -1000.0), (300.0, 0.0)])
def test_orders_of_a_run_up_have_constant_amplitudes(start, rate):
    """Orders 20 and 20.5, half an order apart, and a resonance that does not move, in parts of eight turns."""
    angle = ramp(start, rate)
    waves = 3.0 * np.cos(20.0 * angle + 0.7) + 0.2 * np.sin(20.5 * angle)
    tracks = order_tracks(TIME, angle, np.stack([waves, np.full(len(TIME), 5.0)], axis=1), np.array([20.0, 20.5]), 8.0)
    sense = math.copysign(1.0, start)
    found = tracks.amplitude[:, 0, 0]
    np.testing.assert_allclose(np.abs(found), 3.0, rtol=2e-5)
    np.testing.assert_allclose(np.angle(found) * sense, 0.7, atol=2e-5)
    np.testing.assert_allclose(np.abs(tracks.amplitude[:, 1, 0]), 0.2, rtol=3e-4)
    np.testing.assert_allclose(np.abs(tracks.amplitude[:, :, 1]), 0.0, atol=2e-4)  # a constant is no order
    np.testing.assert_allclose(tracks.speed, start + rate * tracks.time, rtol=1e-4)
    assert np.all(np.diff(tracks.time) > 0.0)


def test_an_order_above_the_band_has_no_value():
    angle = ramp(100.0, 1000.0)
    tracks = order_tracks(TIME, angle, np.cos(20.0 * angle)[:, None], np.array([20.0]), 4.0, highest=1000.0)
    frequency = 20.0 * tracks.speed / (2.0 * math.pi)
    assert (np.isnan(tracks.amplitude[:, 0, 0]) == (frequency > 1000.0)).all()
    assert 0 < np.isnan(tracks.amplitude[:, 0, 0]).sum() < len(tracks.time)


def test_the_stretch_that_turns_one_way_counts():
    """0.1 s at rest, then up; a shaft that goes back counts in its longer stretch."""
    angle = np.where(TIME < 0.1, 0.0, 500.0 * (TIME - 0.1))
    tracks = order_tracks(TIME, angle, np.cos(10.0 * angle)[:, None], np.array([10.0]), 4.0)
    assert tracks.time[0] > 0.1
    np.testing.assert_allclose(np.abs(tracks.amplitude), 1.0, rtol=1e-4)
    with pytest.raises(InputError, match=r"order_turns = 100.*makes 31\.8.* turns"):
        order_tracks(TIME, angle, angle[:, None], np.array([10.0]), 100.0)


def test_parseval_in_each_part():
    """Mean square of the windowed samples: the constant's square and half of those of all other lines."""
    values = np.random.default_rng(4).standard_normal((3000, 2))
    for signal, fall in enumerate(short_time(values, STEP, 200 * STEP)):
        window = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.arange(200) / 200)
        for row, start in enumerate(range(0, 2801, 50)):
            square = np.mean((window * values[start : start + 200, signal]) ** 2) / window.mean() ** 2
            lines = fall.amplitude[row] ** 2
            assert lines[0] + 0.5 * lines[1:-1].sum() + lines[-1] == pytest.approx(square, rel=1e-12)


def test_averages_hold_sines_and_lower_noise():
    """Rms over parts: a sine keeps its amplitude; lines of noise of variance 1 are sqrt(4 B / n) high, B = 1.5."""
    rng = np.random.default_rng(5)
    values = np.stack([2.0 * np.cos(2.0 * math.pi * 1000.0 * TIME), rng.standard_normal(len(TIME))], axis=1)
    sine, noise = short_time(values, STEP, 500 * STEP)
    mean, parts = averaged(sine, 0.1)
    assert parts == sum(t - 250 * STEP >= 0.1 - 1e-9 for t in sine.time)
    assert mean[10] == pytest.approx(2.0, rel=1e-9)  # 1000 Hz
    level = averaged(noise, 0.0)[0]
    assert np.sqrt((level[5:-5] ** 2).mean()) == pytest.approx(math.sqrt(4.0 * 1.5 / 500), rel=0.03)


def test_parts_that_do_not_fit_are_told():
    for length in (1.0, 4 * STEP):
        with pytest.raises(InputError, match="short_time_ms"):
            short_time(np.zeros((100, 1)), STEP, length)


# ------------------------------------------------------------------------------------------------------ steady part


def test_the_steady_part_begins_where_the_start_has_died_away():
    """4 exp(-t/0.02) beside a vibration of 1: the rms is within 1 % where 8 exp(-2t/0.02) < 0.01, from 0.067 s on."""
    period = 1e-3
    force = 10.0 + np.cos(2.0 * math.pi * TIME / period) + 4.0 * np.exp(-TIME / 0.02) * np.sin(5e3 * TIME)
    found = steady_from(TIME, [force[:, None]], period)
    assert 0.067 < found < 0.067 + 2 * 0.025
    assert found * 1e3 == pytest.approx(round(found * 1e3), abs=1e-6)  # parts of whole periods that end with the run
    still = 10.0 + 4.0 * np.exp(-TIME / 0.02) * np.sin(5e3 * TIME)  # nothing vibrates in the end
    assert 0.1 < steady_from(TIME, [still[:, None]], None) < 0.25
    small = np.stack([20.0 * np.cos(2.0 * math.pi * TIME / period), 1.0 + force], axis=1)  # a group: each by itself
    assert steady_from(TIME, [small], period) == pytest.approx(found)


def test_a_run_that_is_not_steady_is_told():
    with pytest.raises(
        InputError, match=r"not steady: .* still change by .* % in its last quarter; compute for longer"
    ):
        steady_from(TIME, [(1.0 + 9.0 * TIME)[:, None] * np.cos(3e3 * TIME)[:, None]], None)
    with pytest.raises(InputError, match="at least 4"):
        steady_from(TIME, [np.ones((len(TIME), 1))], 0.2)


# ------------------------------------------------------------------------------------------------ samples that go by


def piece(time, force) -> TrainResponse:
    """A piece of a response with one mesh and one attachment."""
    from dataclasses import fields

    given = {
        "time": time, "drive_angle": 40.0 * time, "contact_force": force[:, None], "attachment_names": ("a",),
        "transmission_error": 1e-6 * force[:, None], "apart": force[:, None] == 0.0,
        "attachment_acceleration": -force[:, None],
    }  # fmt: skip
    return TrainResponse(**{f.name: given.get(f.name) for f in fields(TrainResponse)})


@pytest.mark.parametrize("every", [1, 4, 10])
def test_tracked_samples_are_band_limited_whatever_the_pieces(every):
    """A tone within the output's band comes out as it is; one above one and a half of it is gone."""
    step, fine = 1e-4, 1e-4 / every
    time = fine * np.arange(6000 + 1)
    low = np.cos(2.0 * math.pi * 4000.0 * time + 0.3)
    high = np.cos(2.0 * math.pi * 17_000.0 * time) if every > 1 else 0.0
    made = []
    for cuts in ([len(time)], [1, 7, 8, 2500, 2501, len(time)]):
        tracked = Tracked(every, step)
        for a, b in zip([0, *cuts], cuts, strict=False):
            tracked.add(piece(time[a:b], (low + high)[a:b]))
        made.append(tracked.finished())
    at, angle, values = made[0]
    for one, two in zip(*made, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)
    np.testing.assert_allclose(at, time[:: max(1, every // 2)], atol=1e-15)
    np.testing.assert_allclose(angle, 40.0 * at, atol=1e-12)
    inner = slice(30, -30)
    np.testing.assert_allclose(values[inner, 0], np.cos(2.0 * math.pi * 4000.0 * at + 0.3)[inner], atol=2e-7)
    np.testing.assert_allclose(values[:, 2], -values[:, 0], atol=1e-12)
    assert tracked.highest == pytest.approx(5000.0)


# --------------------------------------------------------------------------------------------------------- measured


def universal(function: int, kind: int, count: int, spacing: int, data: str) -> str:
    head = ["    -1", "    58", *["text"] * 5]
    head.append(f"{function:5d}{0:10d}{0:5d}{0:10d} NONE      {1:10d}{3:4d} NONE      {0:10d}{0:4d}")
    head.append(f"{kind:10d}{count:10d}{spacing:10d}{0.0:13.5e}{0.5:13.5e}{0.0:13.5e}")
    head += [f"{17:10d}{0:5d}{0:5d}{0:5d} Time                 s"] * 4
    return "\n".join([*head, data, "    -1", ""])


def test_universal_files():
    """Numbers as Fortran writes them, which may touch; even and uneven, real and complex."""
    even = "".join(f"{v:13.5E}" for v in (1.0, -2.0, -3.5, 4.0, 5.0, -6.0)) + "\n" + f"{7.0:13.5E}"
    x, y, over_time = read_universal(universal(1, 2, 7, 1, even).encode(), 1, "f")
    assert over_time
    assert x.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    assert y.tolist() == [1.0, -2.0, -3.5, 4.0, 5.0, -6.0, 7.0]
    twice = "\n".join(f"{x:13.5E}{3 * x:20.11E}{-4 * x:20.11E}" for x in (1.0, 2.0, 4.0, 8.0))
    x, y, over_time = read_universal(universal(12, 6, 4, 0, twice).encode(), 1, "f")
    assert not over_time
    assert x.tolist() == [1.0, 2.0, 4.0, 8.0]
    assert y.tolist() == [5.0, 10.0, 20.0, 40.0]
    power = read_universal(universal(2, 2, 7, 1, even.replace("-", " ")).encode(), 1, "f")[1]
    assert power[0] == pytest.approx(math.sqrt(2.0))  # mean square 1: a sine of that amplitude


@pytest.mark.parametrize(
    ("text", "number", "told"),
    [
        ("", 1, "the file has 0 data sets 58"),
        (universal(1, 2, 9, 1, "1 2 3"), 1, "cut off: 3 of 9"),
        (universal(4, 2, 3, 1, "1 2 3"), 1, "function type 4"),
        (universal(1, 2, 4, 1, "1 2 3 4"), 2, "the file has 1 data sets"),
        (universal(1, 2, 4, 1, "1 2 3 4").replace("    58", "    58b"), 1, "58b"),
        (universal(1, 2, 4, 0, "1 2 1 2 1 2 1 2"), 1, "rising"),
    ],
)
def test_universal_files_that_are_none_are_told(text, number, told):
    with pytest.raises(InputError, match=told):
        read_universal(text.encode(), number, "f")


# ------------------------------------------------------------------------------------------------------- the command


def job(tmp_path, spectrum: str, duration: float = 20.0, drive: str = "600.0"):
    text = SMALL_TRAIN.replace("duration_ms = 2.0", f"duration_ms = {duration}")
    path = tmp_path / "job.toml"
    path.write_text(text.replace("speed_rad_per_s = 600.0", f"speed_rad_per_s = {drive}") + f"[spectrum]\n{spectrum}\n")
    return path


def run(path, *more: str) -> int:
    return main(["vibration", str(path), "--out", str(path.parent / "out"), "--no-estimate", *more])


def test_a_run_up_with_all_of_it(tmp_path):
    """The rigid housing does not move: measured spectra stand beside zeros; the mesh's force follows its order."""
    t = 1e-4 * np.arange(2000)
    rows = "\n".join(
        f"{a!r},{b!r}" for a, b in zip(t.tolist(), (3.0 * np.cos(1e3 * math.pi * t)).tolist(), strict=True)
    )
    (tmp_path / "m.csv").write_text("time_s,acceleration_m_per_s2\n" + rows)
    spectrum = 'short_time_ms = 4.0\norder_turns = 1.0\n[[spectrum.measured]]\nfile = "m.csv"\nattachment = "c"'
    assert run(job(tmp_path, spectrum, drive='"600 + 2e4*time"')) == 0
    out = tmp_path / "out"
    names = {"spectrogram", "order_tracks", "measured"}
    assert {p.name for p in out.iterdir()} >= {f"{n}.{s}" for n in names for s in ("csv", "png")}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["measured"][0]["measured_rms_m_per_s2"] == pytest.approx(3.0 / math.sqrt(2.0))
    smeared = [line for lines in summary["dominant_lines"].values() for line in lines]
    assert smeared  # at a speed that changes no line is one of an order
    assert all(line["near"] is None and line["order_of_first_shaft"] is None for line in smeared)
    with (out / "order_tracks.csv").open(newline="") as stream:
        tracks = list(csv.DictReader(stream))
    assert {float(row["order"]) for row in tracks} == {20.0, 40.0, 60.0}
    for row in tracks:
        assert float(row["speed_rad_per_s"]) == pytest.approx(600.0 + 2e4 * float(row["time_s"]), rel=1e-4)
        assert float(row["frequency_Hz"]) == pytest.approx(
            float(row["order"]) * float(row["speed_rad_per_s"]) / (2.0 * math.pi)
        )
    # the option's window is that of the measured record, too: 3, and half of it in both lines beside it
    assert run(job(tmp_path, spectrum), "--no-pictures", "--window", "hann") == 0
    windowed = json.loads((out / "summary.json").read_text())["measured"][0]["measured_rms_m_per_s2"]
    assert windowed == pytest.approx(3.0 * math.sqrt(0.75))
    # without [spectrum] nothing of it is left
    assert run(job(tmp_path, ""), "--no-pictures") == 0
    assert not {p.name for p in out.iterdir()} & {f"{n}.csv" for n in names}


def test_the_start_is_left_out(tmp_path):
    """Constant stiffness: what vibrates is the start, exp(-d w t); the spectrum of the steady part holds none of it."""
    assert run(job(tmp_path, 'spectrum_from_ms = "steady"'), "--no-pictures") == 0
    steady = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert 0.5e-3 < steady["spectrum"]["start_s"] < 15e-3
    assert run(job(tmp_path, ""), "--no-pictures") == 0
    whole = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert whole["spectrum"]["start_s"] == 0.0
    lines = [x["dominant_lines"]["contact_force_1_N"] for x in (whole, steady)]
    start, later = (
        max((line["amplitude"] for line in some if line["frequency_Hz"] > 0.0), default=0.0) for some in lines
    )
    assert later < 0.02 * start


@pytest.mark.parametrize(
    ("spectrum", "told"),
    [
        ('spectrum_from_ms = "stedy"', "spectrum.spectrum_from_ms"),
        ("short_time_ms = 500.0", "spectrum.short_time_ms"),
        ("order_turns = 500.0", "makes 1.9"),
        ("orders = [20.0]", "order_turns: is required with orders"),
        ('window = "han"', "did you mean 'hann'"),
        ('[[spectrum.measured]]\nfile = "none.csv"\nattachment = "c"', "there is no such file"),
        ('[[spectrum.measured]]\nfile = "none.csv"\nattachment = "x"', "spectrum.measured[0].attachment"),
        ('[[spectrum.measured]]\nfile = "wrong.csv"\nattachment = "c"', "has no column"),
    ],
)
def test_mistakes_are_told(tmp_path, capsys, spectrum, told):
    (tmp_path / "wrong.csv").write_text("time_s,a\n0,1\n")
    assert run(job(tmp_path, spectrum), "--no-pictures") == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out" / "summary.json").exists()
