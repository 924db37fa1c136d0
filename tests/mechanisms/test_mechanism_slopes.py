"""Sweeps over a mechanism's keys and slopes of its outputs, against closed forms of a mass on a spring."""

from __future__ import annotations

import csv
import math
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.mechanism import RunTable
from gearfe.cli.main import main
from gearfe.mechanisms import sensitivities, sweep
from gearfe.mechanisms.sensitivity import extrapolated
from gearfe.study.expressions import Answer
from gearfe.study.kinds import Shared, solve

MASS, STIFFNESS, GRAVITY = 2.0, 50.0, 9.81
#: A mass on a vertical spring, let go where the spring is free.
MECHANISM = f"""
[run]
end_s = 1.5
step_s = 0.05
tolerance = 1e-11
[bodies.block]
mass_kg = {MASS}
inertia_kg_m2 = 1.0
[joints.guide]
type = "prismatic"
body = "block"
direction = [0.0, 1.0]
[forces.gravity]
type = "gravity"
acceleration_m_per_s2 = [0.0, -{GRAVITY}]
[forces.spring]
type = "coordinate_spring"
body = "block"
coordinate = "y"
stiffness_N_per_m = {STIFFNESS}
[[outputs]]
name = "y_m"
value = "y(block)"
"""
KEYS = ("bodies.block.mass_kg", "forces.spring.stiffness_N_per_m")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mass.toml"
    path.write_text(MECHANISM, encoding="utf-8")
    return path


def with_analysis(file: Path, analysis: str) -> Path:
    file.write_text(MECHANISM.replace("[bodies", f'analysis = "{analysis}"\n[bodies', 1), encoding="utf-8")
    return file


def fall(t: np.ndarray, mass: float, stiffness: float) -> np.ndarray:
    """y(t) = -(m g / k) (1 - cos(sqrt(k/m) t))."""
    return -mass * GRAVITY / stiffness * (1.0 - np.cos(np.sqrt(stiffness / mass) * t))


@pytest.mark.parametrize(
    ("tolerance", "method", "allowed"),
    [(1e-11, "taylor", 1e-6), (1e-4, "taylor", 0.05), (1e-5, "implicit", 0.05)],
)
def test_slopes_of_a_motion_and_their_errors(file: Path, tolerance: float, method: str, allowed: float) -> None:
    """The estimate holds the integrator's part: runs that take the same steps make the same error."""
    run = RunTable(end_s=0.75, step_s=0.05, tolerance=tolerance, method=method)
    made = sensitivities(file, KEYS, run=run)
    t = made.at["y_m"]
    w = math.sqrt(STIFFNESS / MASS)
    np.testing.assert_allclose(made.outputs["y_m"], fall(t, MASS, STIFFNESS), atol=100 * tolerance)
    drop = MASS * GRAVITY / STIFFNESS
    by_mass = fall(t, MASS, STIFFNESS) / MASS + drop * np.sin(w * t) * w * t / (2 * MASS)
    by_stiffness = -fall(t, MASS, STIFFNESS) / STIFFNESS - drop * np.sin(w * t) * w * t / (2 * STIFFNESS)
    for key, exact in zip(KEYS, (by_mass, by_stiffness), strict=True):
        off = float(np.abs(made.slopes[key, "y_m"] - exact).max())
        assert off <= made.errors[key, "y_m"] <= allowed * float(np.abs(exact).max())


def test_slopes_of_rest_and_of_frequencies(file: Path) -> None:
    rest = sensitivities(with_analysis(file, "equilibrium"), KEYS)
    assert rest.slopes[KEYS[0], "y_m"][0] == pytest.approx(-GRAVITY / STIFFNESS, rel=1e-10)
    assert rest.slopes[KEYS[1], "y_m"][0] == pytest.approx(MASS * GRAVITY / STIFFNESS**2, rel=1e-8)
    modes = sensitivities(with_analysis(file, "modes"), KEYS)
    frequency = math.sqrt(STIFFNESS / MASS) / (2 * math.pi)
    assert modes.outputs["frequency_Hz"] == pytest.approx([frequency])
    assert modes.slopes[KEYS[0], "frequency_Hz"] == pytest.approx([-frequency / (2 * MASS)], rel=1e-8)
    assert modes.slopes[KEYS[1], "frequency_Hz"] == pytest.approx([frequency / (2 * STIFFNESS)], rel=1e-8)
    assert "y_m" in modes.outputs


def test_the_table_of_differences_takes_powers_away_and_sees_noise() -> None:
    """Of sin at 1: exact to rounding; with noise of 1e-8 in the values, an error of its size over the step, told."""
    h = 0.1 / 2.0 ** np.arange(5)
    clean = [np.array([(math.sin(1 + x) - math.sin(1 - x)) / (2 * x)]) for x in h]
    slope, error = extrapolated(clean)
    assert abs(slope[0] - math.cos(1.0)) <= error < 1e-12
    noise = 1e-8 * np.random.default_rng(3).uniform(-1, 1, 5)
    slope, error = extrapolated([d + n / x for d, n, x in zip(clean, noise, h, strict=True)])
    assert abs(slope[0] - math.cos(1.0)) <= error < 1e-6


def test_a_sweep_is_the_same_wherever_it_runs(file: Path) -> None:
    cases = [{KEYS[0]: m, KEYS[1]: k} for m in (1.0, 2.0) for k in (10.0, 1000.0)]
    here = sweep(file, cases)
    for case in here:
        exact = fall(case["time_s"], *case.values.values())
        np.testing.assert_allclose(case["y_m"], exact, atol=1e-8 * np.abs(exact).max())
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        for executor in (threads, processes):
            there = sweep(file, cases, executor=executor)
            for one, other in zip(here, there, strict=True):
                assert one.values == other.values
                assert np.array_equal(one["y_m"], other["y_m"])


def test_a_case_without_an_answer_says_why_and_stops_nothing(file: Path) -> None:
    bad, good = sweep(file, [{KEYS[0]: -1.0}, {KEYS[0]: 1.0}])
    assert "mass_kg" in bad.problem
    assert not bad.tables
    with pytest.raises(KeyError, match="mass_kg"):
        bad["y_m"]
    assert good.problem == ""


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["bodies.block.mass"], "mass_kg"),
        (["bodies.brick.mass_kg"], "brick"),
        (["run.step_s"], "is no number of the mechanism"),
        (["forces.spring.coordinate"], "is no number"),
        (["bodies.block"], "is no number"),
        (["forces.gravity.acceleration_m_per_s2.0"], "is 0"),
        (["forces.gravity.acceleration_m_per_s2.2"], "2 entries"),
        ({KEYS[0]: 5.0}, "has no answer"),
        ({KEYS[0]: 0.0}, "must be a step > 0"),
        ({KEYS[0]: -1e-3}, "must be a step > 0"),
        ({KEYS[0]: math.inf}, "must be a step > 0"),
        ({KEYS[0]: math.nan}, "must be a step > 0"),
    ],
)
def test_wrong_parameters(file: Path, names: list[str] | dict[str, float], told: str) -> None:
    with pytest.raises(InputError, match=told):
        sensitivities(file, names)


def test_a_value_of_zero_with_its_step(file: Path) -> None:
    """A push of g along the guide does nothing, and one across adds g_y m / k."""
    made = sensitivities(
        with_analysis(file, "equilibrium"),
        {"forces.gravity.acceleration_m_per_s2.0": 1.0, "forces.gravity.acceleration_m_per_s2.1": 1.0},
    )
    assert made.slopes["forces.gravity.acceleration_m_per_s2.0", "y_m"][0] == pytest.approx(0.0, abs=1e-14)
    assert made.slopes["forces.gravity.acceleration_m_per_s2.1", "y_m"][0] == pytest.approx(MASS / STIFFNESS, rel=1e-10)


@pytest.mark.parametrize("analysis", ["transient", "equilibrium", "modes"])
def test_the_command_writes_slopes(file: Path, tmp_path: Path, analysis: str) -> None:
    out = tmp_path / "out"
    options = ["--out", str(out), "--no-pictures", "--sensitivity", KEYS[0], "--analysis", analysis]
    assert main(["mechanism", str(file), *options, "--set", "bodies.block.mass_kg=4.0"]) == 0
    with (out / "sensitivities.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["parameter"] for row in rows} == {KEYS[0]}
    last = [row for row in rows if row["output"] == "y_m"][-1]
    if analysis != "transient":
        assert float(last["slope"]) == pytest.approx(-GRAVITY / STIFFNESS, rel=1e-9)
        assert float(last["value"]) == pytest.approx(-4.0 * GRAVITY / STIFFNESS, rel=1e-9)
    assert main(["mechanism", str(file), "--out", str(out), "--no-pictures"]) == 0
    assert not (out / "sensitivities.csv").exists()


@pytest.mark.parametrize(
    ("analysis", "main_table"), [("transient", "trajectory"), ("equilibrium", "equilibrium"), ("modes", "modes")]
)
def test_studies_know_the_analyses(file: Path, analysis: str, main_table: str) -> None:
    from gearfe.base.config import read_toml

    answer: Answer = solve("mechanism", read_toml(with_analysis(file, analysis)), file, Shared())
    assert next(iter(answer.tables)) == main_table
    if analysis == "modes":
        assert answer.tables["modes"]["frequency_Hz"][0] == pytest.approx(5.0 / (2 * math.pi), rel=1e-9)
        assert answer.summary["frequencies_Hz"][0] == pytest.approx(5.0 / (2 * math.pi), rel=1e-9)
