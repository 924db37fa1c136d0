"""Operating deflection shapes: against steady motions by harmonic balance, fields, mistakes."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import build_train, simulate
from gearfe.drivetrain.vibration.deflection import DeflectionRecord, enlargement, nearest_lines, write_deflections
from gearfe.fem.beams import Section
from tests.makers.job_texts import BARE_TRAIN, BORES
from tests.makers.trains import loaded, smooth

SPEED, SAMPLES = 600.0, 64


def test_the_shape_of_a_steady_motion_is_that_of_harmonic_balance(tmp_path: Path) -> None:
    """Bores and approach of the flanks at once and twice the mesh frequency, after 60 periods of decay."""
    h5py = pytest.importorskip("h5py")
    model = build_train(loaded([(20, 30)], smooth, speed=SPEED, ratio=0.08))
    state = steady_state(model, SPEED, tolerance=1e-5)
    step = state.period / SAMPLES
    times = np.arange(80 * SAMPLES + 1) * step
    options = {"start": 60 * SAMPLES * step, "length": 20 * SAMPLES * step}
    mesh = 1.0 / state.period
    made = DeflectionRecord(model.train, times, 1, [1.02 * mesh, 2.0 * mesh], **options)
    run = simulate(model, times, tolerance=1e-8)
    for first in range(0, len(times), 777):  # piece by piece
        made.add(run.at(np.arange(first, min(first + 777, len(times)))))
    shapes = made.deflections()
    assert [shape.frequency for shape in shapes] == pytest.approx([mesh, 2.0 * mesh])
    line, size = model.meshes[0], model.train.housing.size
    for shape, harmonic in zip(shapes, (1, 2), strict=True):
        along = (2.0 * math.pi * shape.frequency) ** 2 * np.abs(model.axial[:, :size] @ shape.modal)
        known = np.abs(state.acceleration[harmonic])
        assert along == pytest.approx(known, rel=2e-3, abs=2e-3 * known.max())
        one, two = (
            pose[:3] + np.cross(pose[3:], line.point - centre)
            for pose, centre in zip(shape.pose, run.gear_centres, strict=True)
        )
        approach = abs(line.direction @ (one - two))
        error = abs(state.lines(state.transmission_error)[harmonic, 0])
        assert approach == pytest.approx(error, rel=2e-3)
    write_deflections(tmp_path, model.train, run, shapes)
    with h5py.File(tmp_path / "deflection_gears.vtkhdf") as file:
        root = file["VTKHDF"]
        frames = np.concatenate([number + np.arange(16) / 16 for number in (1, 2)])
        assert root["Steps"]["Values"][:] == pytest.approx(frames)
        moved = np.linalg.norm(root["PointData"]["displacement_m"][:], axis=1).max()
    assert 0.005 < moved / 0.2 < 0.03  # two gears of 50 and 75 mm
    assert enlargement(model.train, shapes[0]) > 1.0


def test_rolling_is_no_vibration() -> None:
    """A train that starts in steady motion turns by many radians: nothing of that is in the shape."""
    model = build_train(loaded([(20, 30)], 1e8, speed=SPEED, flexible=False))
    times = np.linspace(0.0, 0.02, 401)
    run = simulate(model, times)
    still = dataclasses.replace(
        run, gear_pose=np.zeros_like(run.gear_pose) + np.einsum(
            "n,g,k->ngk", run.drive_angle,
            [float(model.ratios[model.train.shaft_number(gear.shaft)]) for gear in model.train.gears],
            np.concatenate([np.zeros(3), model.train.frame[2]]),
        ),
    )  # fmt: skip
    made = DeflectionRecord(model.train, times, 1, [500.0])
    made.add(still)
    assert np.abs(made.deflections()[0].pose).max() < 1e-12


def test_what_the_load_deflects_does_not_leak_into_the_shape() -> None:
    """A deflection of 20 um that comes within 2 ms, and 0.05 um of vibration: the shape is the vibration's."""
    model = build_train(loaded([(20, 30)], 1e8, speed=SPEED, flexible=False))
    times = np.linspace(0.0, 0.0075, 1501)
    run = simulate(model, times)
    part = np.clip(times / 2e-3, 0.0, 1.0)
    pose = np.zeros_like(run.gear_pose)
    pose[:, 1, 2] = 20e-6 * part**3 * (10.0 - 15.0 * part + 6.0 * part**2) + 5e-8 * np.cos(
        2.0 * math.pi * 2000.0 * times
    )
    made = DeflectionRecord(model.train, times, 1, [2000.0])
    made.add(dataclasses.replace(run, gear_pose=pose, drive_angle=0.0 * times))
    (shape,) = made.deflections()
    assert abs(shape.pose[1, 2]) == pytest.approx(5e-8, rel=0.1)
    assert abs(2.0 / 1500 * np.fft.fft(pose[:1500, 1, 2])[15]) > 1e-7  # the line of the displacement itself


def test_windows_keep_the_height_of_a_line() -> None:
    model = build_train(loaded([(20, 30)], 1e8, speed=SPEED, flexible=False))
    times = np.linspace(0.0, 0.02, 401)
    run = simulate(model, times)
    pose = np.zeros_like(run.gear_pose)
    pose[:, 0, 0] = 3e-6 * np.cos(2.0 * math.pi * 1000.0 * times + 0.3)
    for window in ("none", "hann", "flattop"):
        made = DeflectionRecord(model.train, times, 1, [990.0], window=window, start=1e-3, length=0.018)
        made.add(dataclasses.replace(run, gear_pose=pose, drive_angle=0.0 * times))
        (shape,) = made.deflections()
        assert shape.frequency == pytest.approx(1000.0)
        assert shape.pose[0, 0] == pytest.approx(3e-6 * np.exp(0.3j), rel=1e-7)


def test_the_bending_of_elastic_shafts_is_in_the_shape(tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    steel = Section(0.09, 0.02, 0.02, young=200e9, poisson=0.3, density=7850.0)
    rigid = loaded([(20, 30)], 1e8, speed=SPEED)
    bent = tuple(dataclasses.replace(shaft, sections=(steel,)) for shaft in rigid.shafts)
    model = build_train(dataclasses.replace(rigid, shafts=bent))
    times = np.linspace(0.0, 0.002, 41)
    run = simulate(model, times)
    amplitude = np.linspace(1e-7, 2e-6, run.section_coordinates.shape[1])
    wave = np.cos(2.0 * math.pi * 1000.0 * times - 0.7)
    made = DeflectionRecord(model.train, times, 1, [1000.0], start=5e-4, length=1e-3)
    made.add(dataclasses.replace(run, section_coordinates=wave[:, None] * amplitude))
    (shape,) = made.deflections()
    assert shape.sections == pytest.approx(
        -amplitude * np.exp(-0.7j), rel=1e-7
    )  # the record begins half a period later
    assert len(shape.modal) == model.train.housing.size
    write_deflections(tmp_path, model.train, run, [shape])
    assert (tmp_path / "deflection_gears.vtkhdf").exists()


@pytest.mark.parametrize("frequency", [0.0, -5.0, 24.0, 10_100.0, math.nan, math.inf])
def test_frequencies_without_a_line_are_refused(frequency: float) -> None:
    with pytest.raises(InputError, match="lines of the spectrum, 50 to 10000 Hz"):
        nearest_lines([frequency], 400, 5e-5)


def test_the_command_names_the_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("h5py")
    job, out = tmp_path / "job.toml", tmp_path / "out"
    job.write_text(BARE_TRAIN + BORES)
    options = ["--no-pictures", "--no-estimate", "--no-floquet", "--out", str(out)]
    assert main(["vibration", str(job), "--deflection-Hz", "900", "1600", *options]) == 0
    (one, two) = json.loads((out / "summary.json").read_text())["deflections"]
    assert (one["frequency_Hz"], two["frequency_Hz"]) == pytest.approx((1000.0, 1500.0))  # 2 ms: lines 500 Hz apart
    assert (out / "deflection_gears.vtkhdf").exists()
    assert "deflection shape at 1000 Hz, the line nearest to 900 Hz" in capsys.readouterr().out
    assert main(["vibration", str(job), "--deflection-Hz", "1e6", *options]) == 2
    assert "is outside the lines" in capsys.readouterr().err
