"""Errors of the numbers that a run is read for: the truth is a train that differs by what the estimates allow."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.record_spectrum import finer
from gearfe.cli.main import main
from gearfe.drivetrain.train import GearTrain, build_train, simulate
from gearfe.drivetrain.train.model import TrainModel
from gearfe.drivetrain.vibration.errors import FORCES, PEAKS, STARTS, Run, with_errors
from gearfe.drivetrain.vibration.follow import follow
from gearfe.drivetrain.vibration.report import line_texts, train_summary
from gearfe.drivetrain.vibration.spectra import TrainRecord
from gearfe.gears.gearmesh.curve import StiffnessCurve
from gearfe.multibody import TimeFunction, constant
from gearfe.output.differences import difference_error
from gearfe.output.results import KINDS, Results
from gearfe.output.run_numbers import NUMBERS
from tests.makers.job_texts import SMALL_TRAIN
from tests.makers.trains import SHIPPED, base_radius, curve, elastic, train

TIMES = 20e-6 * np.arange(301)


def ran(model: TrainModel, times: np.ndarray, every: int, **options: Any) -> Run:
    """Summary and spectra of a train."""
    response = simulate(model, times, tolerance=1e-8, **options)
    made = follow([response], TIMES, every, record=TrainRecord(TIMES, every))
    return Run(train_summary(made, {}), made.spectra)


def estimated(gear_train: GearTrain) -> tuple[Run, dict[str, Any], Any]:
    """A run, its summary with errors, and how to repeat it."""
    model = build_train(gear_train)
    highest = float(model.coupled_frequencies_hz.max())
    times, every = finer(TIMES, 1.2 * highest)
    run = ran(model, times, every, estimate=True)
    return (
        run,
        with_errors(run, model, lambda one: ran(one, times, every)),
        lambda one: ran(build_train(one), times, every),
    )


def softened(gear_train: GearTrain, part: float | None, seed: int = 0) -> GearTrain:
    """In a housing whose mesh is known to err by 6 % of its stiffness, or what part of that; None: of each mode one."""
    assert gear_train.housing is not None
    body = dataclasses.replace(gear_train.housing, softening=0.06 * gear_train.housing.stiffness)
    parts = np.random.default_rng(seed).uniform(size=body.size) if part is None else part
    return dataclasses.replace(gear_train, housing=body if part == 0.0 else body.softened(parts))


def lines(summary: dict[str, Any], key: str) -> np.ndarray:
    return np.array([line[key] for found in summary["dominant_lines"].values() for line in found])


@pytest.mark.parametrize("part", [0.35, 0.6])
def test_truth_within_the_softening_is_covered(part: float) -> None:
    gear_train = elastic(train(SHIPPED, stiffness=curve), uneven=0.2, skew=0.3)
    run, summary, again = estimated(softened(gear_train, 0.0))
    truth = again(softened(gear_train, part))
    parts = summary["headline_error_parts"]
    assert set(parts) == {"mesh", "reduction", "start", "integration"}
    ratios = []
    for name in (*FORCES, "coupled_frequencies_Hz"):
        told, true = np.array(summary["headline_errors"][name]), np.abs(truth.summary[name] - run.summary[name])
        np.testing.assert_allclose(told, sum(np.array(part[name]) for part in parts.values()))
        low = np.isfinite(told) & (true > 1e-9 * np.abs(run.summary[name]))
        assert np.all(true[low] <= told[low]), name
        ratios.append(told[low] / true[low])
    for name, told in summary["headline_errors"][PEAKS].items():
        assert abs(truth.summary[PEAKS][name] - run.summary[PEAKS][name]) <= told
    bins = np.rint(lines(summary, "frequency_Hz") / run.spectra.spectrum.resolution).astype(int)
    names = [name for name, found in summary["dominant_lines"].items() for _ in found]
    there = np.array([truth.spectra.amplitude(name)[k] for name, k in zip(names, bins, strict=True)])
    true, told = np.abs(there - lines(summary, "amplitude")), lines(summary, "error_estimate")
    known = np.isfinite(told) & (true > 1e-9 * there.max())
    assert np.mean(true[known] <= told[known]) >= 0.95
    # above the highest mode of the body the mesh's error is not known, and is not none
    assert np.array_equal(np.isfinite(told), lines(summary, "frequency_Hz") <= gear_train.housing.highest_hz)
    # the whole softening is 1 / part of the true one
    assert np.median(np.concatenate([*ratios, told[known] / true[known]])) < 4.0 / part


def test_the_error_of_a_difference_in_one_housing() -> None:
    """Two loads in a housing of one error: the difference is off by what its error says, and less than by the sum."""
    train_a = softened(elastic(train(SHIPPED, stiffness=curve), uneven=0.2, skew=0.3), 0.0)

    def larger(torque: TimeFunction) -> TimeFunction:
        pieces = tuple(tuple(1.2 * number for number in piece) for piece in torque.coefficients)
        return dataclasses.replace(torque, coefficients=pieces)

    loads = tuple(dataclasses.replace(load, torque=larger(load.torque)) for load in train_a.loads)
    runs = [estimated(one) for one in (train_a, dataclasses.replace(train_a, loads=loads))]
    summaries = [{**summary, "housing": {"mass_kg": 1.0, "unknowns": 1}} for _, summary, _ in runs]
    results = [Results(KINDS[3], name, Path(), summary) for name, summary in zip("ab", summaries, strict=True)]
    numbers = NUMBERS["vibration"](results)
    part = 0.6
    truth = [
        Results(KINDS[3], "", Path(), again(softened(dataclasses.replace(train_a, loads=own), part)).summary)
        for (_, _, again), own in zip(runs, (train_a.loads, loads), strict=True)
    ]
    true = [{name: number.value for name, number in run.items()} for run in NUMBERS["vibration"](truth)]
    covered, smaller = [], []
    for name in numbers[0].keys() & numbers[1].keys() & true[0].keys() & true[1].keys():
        one, two = numbers[0][name], numbers[1][name]
        error, off = difference_error(one, two, {"mesh", "reduction"}), 0.0
        if not np.isfinite(error) or one.error < 1e-9 * abs(one.value):
            continue
        off = abs((two.value - one.value) - (true[1][name] - true[0][name]))
        covered.append(off <= error + 1e-9 * abs(one.value))
        smaller.append(error / (one.error + two.error))
    assert len(covered) > 20
    assert np.mean(covered) >= 0.95
    assert np.median(smaller) < 0.2  # the response of springs is nearly in proportion to the load
    assert max(smaller) <= 1.0 + 1e-12


def alternating(gear_train: GearTrain) -> Run:
    """A made-up run whose numbers feel the modes of the housing with alternating signs, so that all together cancel."""
    assert gear_train.housing is not None
    logarithms = np.log(gear_train.housing.coupled.frequencies_hz)
    number = [1000.0 + 100.0 * float(np.sum(logarithms[::2] - logarithms[1::2]))]
    summary: dict[str, Any] = {"status": "done", **dict.fromkeys(FORCES, number)}
    summary |= {name: dict.fromkeys(gear_train.housing.attachment_names, number[0]) for name in (PEAKS, STARTS)}
    summary["coupled_frequencies_Hz"] = build_train(gear_train).coupled_frequencies_hz
    summary["error_estimates"] = {"integration": 0.0, "reduction": 0.0}
    return Run(summary, None)


def test_modes_that_cancel_while_they_soften_together_are_covered() -> None:
    gear_train = softened(elastic(train([(20, 30)]), uneven=0.2, skew=0.3), 0.0)
    run = alternating(gear_train)
    told = with_errors(run, build_train(gear_train), lambda one: alternating(one.train))["headline_errors"][
        "largest_contact_forces_N"
    ][0]
    together = alternating(softened(gear_train, 1.0)).summary[FORCES[2]][0] - run.summary[FORCES[2]][0]
    true = [
        alternating(softened(gear_train, None, k)).summary[FORCES[2]][0] - run.summary[FORCES[2]][0] for k in range(40)
    ]
    assert abs(together) < 0.01 * np.median(np.abs(true))  # what a run in the softest housing says
    assert np.mean(np.abs(true) <= told) >= 0.95
    assert told < 5.0 * np.max(np.abs(true))


def test_a_load_that_is_there_at_once_leaves_peaks_unknown() -> None:
    """The acceleration of the first instant depends on the finest element: a lighter bore doubles it."""
    gear_train = elastic(train(SHIPPED, stiffness=curve), uneven=0.2, skew=0.3)
    assert gear_train.housing is not None
    mass = gear_train.housing.mass.copy()  # a bore that turns about its axis also moves along it, by inertia
    axial, about = 6 * np.arange(len(gear_train.housing.attachment_names)) + np.array([[1], [4]])
    mass[axial, about] = mass[about, axial] = 0.005
    gear_train = dataclasses.replace(gear_train, housing=dataclasses.replace(gear_train.housing, mass=mass))
    loads = tuple(
        dataclasses.replace(load, bore=f"{load.shaft}+", torque=constant(-100.0)) for load in gear_train.loads
    )
    run, summary, _ = estimated(dataclasses.replace(gear_train, loads=loads))
    first = np.array(list(run.summary[STARTS].values()))
    assert max(run.summary[PEAKS].values()) > 1.0  # m/s2: no round-off
    assert first.max() > 0.1 * max(run.summary[PEAKS].values())
    assert list(summary["headline_error_parts"]["start"][PEAKS].values()) == first.tolist()
    _, summary, _ = estimated(gear_train)
    assert max(summary["headline_error_parts"]["start"][PEAKS].values()) < 1e-6 * max(summary[PEAKS].values())


def test_body_without_estimate_has_unknown_errors() -> None:
    _, summary, _ = estimated(elastic(train([(20, 30)])))
    assert np.isnan(summary["headline_errors"]["mean_contact_forces_N"]).all()


def known_curve(error: float) -> StiffnessCurve:
    """k over a mesh cycle with an estimate of its error."""
    count, cycle = 24, 2.0 * math.pi / 20
    angle = cycle * np.arange(count) / count
    k = 1.2e8 * (1.0 + 0.15 * np.cos(20.0 * angle))
    numbers = {f.name: np.ones(count) for f in dataclasses.fields(StiffnessCurve) if f.type == "Array"}
    numbers |= {"pinion_angle": angle, "k_mesh": k, "relative_error": np.full(count, 0.5 * error)}
    words = {"status": np.full(count, "converged")}
    whole = {f.name: np.ones(count, dtype=int) for f in dataclasses.fields(StiffnessCurve) if f.type == "IntArray"}
    shares = {"load_share": np.ones((count, 1))}
    known = {f.name for f in dataclasses.fields(StiffnessCurve)}
    made = {**numbers, **words, **whole, **shares, "mesh_cycle": cycle, "base_radius": base_radius(30)}
    return StiffnessCurve(**{name: value for name, value in made.items() if name in known})


def test_error_of_the_curve_is_that_of_a_stiffer_one() -> None:
    gear_train = train([(20, 30)])
    given = known_curve(0.01)
    assert given.worst_error == pytest.approx(0.01)
    gear_train = dataclasses.replace(gear_train, meshes=(dataclasses.replace(gear_train.meshes[0], stiffness=given),))
    run, summary, again = estimated(gear_train)
    assert set(summary["headline_error_parts"]) == {"curve", "integration"}
    other = dataclasses.replace(given, k_mesh=0.995 * given.k_mesh)
    truth = again(dataclasses.replace(gear_train, meshes=(dataclasses.replace(gear_train.meshes[0], stiffness=other),)))
    for name in ("largest_contact_forces_N", "coupled_frequencies_Hz"):
        true = np.abs(truth.summary[name] - run.summary[name])
        assert np.all(true <= np.array(summary["headline_errors"][name]) + 1e-9)


def test_command_tells_one_error_for_each_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job, out = tmp_path / "job.toml", tmp_path / "out"
    job.write_text(SMALL_TRAIN)
    assert main(["vibration", str(job), "--out", str(out), "--no-pictures"]) == 0
    printed = capsys.readouterr().out
    assert "N, " in printed or " N" in printed
    assert "mean contact force" in printed
    assert " +- " in printed
    summary = json.loads((out / "summary.json").read_text())
    assert len(summary["headline_errors"]["mean_contact_forces_N"]) == 1
    assert all("error_estimate" in line for found in summary["dominant_lines"].values() for line in found)
    assert main(["vibration", str(job), "--out", str(out), "--no-pictures", "--no-estimate"]) == 0
    assert " +- " not in capsys.readouterr().out
    assert "headline_errors" not in json.loads((out / "summary.json").read_text())


def test_printed_lines_have_a_question_mark_if_their_error_exceeds_half_of_the_value() -> None:
    sure = {"frequency_Hz": 1857.1, "amplitude": 8.45, "near": "mesh 1 x 1", "error_estimate": 4.2}
    doubtful = {"frequency_Hz": 5714.3, "amplitude": 6.21, "near": "mesh 1 x 3", "error_estimate": 3.9}
    unknown = {"frequency_Hz": 571.4, "amplitude": 11.4, "near": None, "error_estimate": math.nan}
    without = {"frequency_Hz": 571.4, "amplitude": 11.4, "near": None}
    assert line_texts([sure, unknown]) == "1857 Hz 8.45 +- 4.2 (mesh 1 x 1), 571 Hz 11.4 +- ?"
    assert line_texts([without]) == "571 Hz 11.4"
    remark = "; ?: error estimate above half of the value"
    assert line_texts([doubtful, sure]) == (
        "5714 Hz 6.21? +- 3.9 (mesh 1 x 3), 1857 Hz 8.45 +- 4.2 (mesh 1 x 1)" + remark
    )
