"""What the stress campaigns found in the rigid core and in the output, beside the job files in test_stress_cases."""

from __future__ import annotations

import json
import math
import os
import re
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.files import whole_set
from gearfe.cli.main import main
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.mechanisms.error_estimate import trajectory_error
from gearfe.multibody import integrate
from gearfe.multibody.series.timefunctions import smoothed_step
from tests.makers.rigid_cases import folding_angle, folding_links, pendulum
from tests.places import GEOMETRY, KEPT, ROOT

from .campaign import Case, campaign_named
from .linkages import four_bar
from .toml_text import toml_text


@pytest.mark.parametrize("method", ["taylor", "implicit"])
@pytest.mark.parametrize("back", [False, True])
def test_dense_output_does_not_leave_the_run(method: str, back: bool) -> None:
    ends = [1.0, 0.0] if back else [0.0, 1.0]
    made = integrate(pendulum(), ends, method=method, tolerance=1e-6)
    assert made.dense(np.array([0.0, 0.4, 1.0])).shape == (3, 3)
    made.dense(np.array([-1e-12, 1.0 + 1e-12]))  # rounding of output times
    for outside in (-1e-3, 1.001):
        with pytest.raises(InputError, match="outside of the run"):
            made.dense(np.array([outside]))


def test_the_stated_error_covers_the_exact_motion() -> None:
    """The folding crank's angle from its closed equation of motion, which the reference solves to about 1e-12."""
    mechanism = load_mechanism(GEOMETRY / "slider_crank.toml")
    start, times = mechanism.start(), np.linspace(0.0, 3.0, 61)
    exact = folding_angle(start.q[2], start.v[2], times)
    for tolerance in (1e-4, 1e-6, 1e-8):
        made = integrate(mechanism.system, times, tolerance=tolerance, start=start, method="taylor")
        stated = trajectory_error(mechanism, start, evaluate(mechanism, made), tolerance)
        true = float(np.abs(made.q[:, 2] - exact).max())
        assert true <= stated.outputs["crank_angle_rad"] <= 10 * true
        assert stated.coordinates >= stated.outputs["crank_angle_rad"] * (1 - 1e-9)


@pytest.mark.parametrize("tolerance", [1e-10, 1e-12, 1e-13])
def test_the_stated_error_covers_rounding(tolerance: float) -> None:
    """The exact angle to 20 digits over the first 4 s, where a finer run has the same rounding."""
    exact = np.genfromtxt(
        ROOT / "tests" / "data" / "slider_crank_reference.csv", delimiter=",", names=True, skip_header=1
    )[:81]
    mechanism = load_mechanism(GEOMETRY / "slider_crank.toml")
    start = mechanism.start()
    options = {"tolerance": tolerance, "start": start, "method": "taylor"}
    made = integrate(mechanism.system, exact["t"], **options)
    stated = trajectory_error(mechanism, start, evaluate(mechanism, made), tolerance).outputs["crank_angle_rad"]
    true = float(np.abs(made.q[:, 2] - exact["theta"]).max())
    assert true <= stated <= 10 * true


@pytest.mark.parametrize("tolerance", [1e-11, 1e-12, 1e-13])
def test_the_stated_error_covers_the_shortest_steps(tmp_path: Path, tolerance: float) -> None:
    """A four-bar linkage whose first step is the shortest, and makes the error.

    The exact angles are those of its equation of motion in the crank's angle alone, by extrapolation (Gragg, Bulirsch,
    Stoer, order 16) with 19 digits; half the steps differ by 3e-16.
    """
    exact = [2.350115252430905, 0.7870055543492263, -1.0089032122608998]
    tables, _ = four_bar(np.random.default_rng(0))
    tables["start"]["positions"] = {"angle(crank)": tables["bodies"]["crank"]["angle_rad"]}
    path = tmp_path / "four_bar.toml"
    path.write_text(toml_text(tables))
    mechanism = load_mechanism(path)
    start, times = mechanism.start(), np.linspace(0.0, 0.5, 11)
    made = integrate(mechanism.system, times, tolerance=tolerance, start=start, method="taylor")
    stated = trajectory_error(mechanism, start, evaluate(mechanism, made), tolerance).coordinates
    true = float(np.abs(made.q[-1, 2::3] - exact).max())
    assert true <= stated <= 10 * true


def test_the_summary_states_the_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["mechanism", str(GEOMETRY / "slider_crank.toml"), "--until", "0.5", "--no-pictures", "--out"]
    assert main([*command, str(tmp_path / "a")]) == 0
    stated = json.loads((tmp_path / "a" / "summary.json").read_text())["error_estimate"]
    assert 0.0 < stated["coordinates_m_or_rad"] < 1e-7
    assert set(stated["outputs"]) >= {"crank_angle_rad", "x_B_m"}
    assert "error estimate" in capsys.readouterr().out
    assert main([*command, str(tmp_path / "b"), "--no-estimate"]) == 0
    assert json.loads((tmp_path / "b" / "summary.json").read_text())["error_estimate"] is None


def test_files_of_an_earlier_run_do_not_stay(tmp_path: Path) -> None:
    command = ["mechanism", str(GEOMETRY / "slider_crank.toml"), "--until", "0.1", "--out", str(tmp_path)]
    assert main([*command, "--reactions", "--no-estimate"]) == 0
    assert {"curves.png", "picture.png", "reactions.csv"} <= {p.name for p in tmp_path.iterdir()}
    (tmp_path / "notes.txt").write_text("mine\n")
    assert main([*command[:3], "0.2", *command[4:], "--no-pictures", "--no-estimate"]) == 0
    assert {p.name for p in tmp_path.iterdir()} == {"trajectory.csv", "energy.csv", "summary.json", "notes.txt"}


def _fail(folder: Path) -> None:
    with whole_set(folder, ("*.csv",)) as made:
        (made / "b.csv").write_text("new\n")
        raise RuntimeError


def test_a_set_that_fails_leaves_the_old_one(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("old\n")
    with pytest.raises(RuntimeError):
        _fail(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_leftovers_of_killed_runs_are_removed_after_a_day(tmp_path: Path) -> None:
    old, young = tmp_path / ".writing-old", tmp_path / ".writing-young"
    for folder in (old, young):
        folder.mkdir()
        (folder / "half.csv").write_text("1,")
    os.utime(old, (time.time() - 90_000, time.time() - 90_000))
    with whole_set(tmp_path):
        pass
    assert not old.exists()
    assert young.exists()


def test_a_start_on_a_fold_is_within_its_run() -> None:
    """There the first series is about a moment a little after the start."""
    times = np.linspace(0.0, 1.0, 11)
    made = integrate(folding_links(np.pi / 2 - 1e-6, 2.0), times, tolerance=1e-9)
    assert np.abs(made.q[:, 2] - folding_angle(np.pi / 2 - 1e-6, 2.0, times)).max() < 1e-8


@pytest.mark.parametrize(("centre", "width"), [(0.0, 1e-80), (1.0, 1e-17), (0.0, 0.0), (math.nan, 1.0)])
def test_a_step_that_takes_no_time_is_refused(centre: float, width: float) -> None:
    with pytest.raises(InputError, match="smoothed step width"):
        smoothed_step(centre, width)


@pytest.mark.parametrize(("kind", "job"), [("trajectory", "loops_that_fold"), ("response", "soft_bearings")])
def test_estimates_that_ended_without_a_reason(kind: str, job: str, tmp_path: Path) -> None:
    """At a fold of redundant loops the truth's tolerance left only rounding; what moved too far is named."""
    files = {"job.toml": (KEPT / "estimates" / f"{job}.toml").read_text(encoding="utf-8")}
    if kind == "response":
        files |= {path.name: path.read_text(encoding="utf-8") for path in (KEPT / "estimates").glob("*.csv")}
    found = campaign_named("estimates").run(Case(0, kind, files, ""), tmp_path)
    if kind == "trajectory":
        assert (found.outcome, found.measures["covered"]) == ("done", True)
    else:
        assert found.outcome == "stopped"
        assert "shaft s1 moves by" in found.reason


@pytest.mark.parametrize("share", [0.0, 1e-13, 3e-12])
def test_a_link_without_mass_does_not_stop_a_run(share: float, tmp_path: Path) -> None:
    """The pivots of so light a coupler (1.45e-14 of the other links' mass) looked like a singular position.

    What the mass of a coupler does to the motion is proportional to it, so one of 1e-8 on series is near enough.
    """
    table = (KEPT / "mechanisms" / "coupler_without_mass.toml").read_text(encoding="utf-8")
    made = {}
    for factor in (share, 1e-8):
        light = re.compile(r"(mass_kg|inertia_kg_m2) = (\S*e-1[0-9])")
        scaled, count = light.subn(partial(_rescaled, factor / 1.45e-14), table)
        assert count == 2
        (tmp_path / "job.toml").write_text(scaled, encoding="utf-8")
        mechanism = load_mechanism(tmp_path / "job.toml")
        times = np.linspace(0.0, mechanism.file.run.end_s, 11)
        made[factor] = integrate(mechanism.system, times, tolerance=1e-8, start=mechanism.start())
    assert [m.method for m in made.values()] == ["taylor", "taylor"]
    assert [m.status for m in made.values()] == [0, 0]
    np.testing.assert_allclose(made[share].q, made[1e-8].q, atol=3e-6)


def _rescaled(factor: float, found: re.Match[str]) -> str:
    return f"{found[1]} = {float(found[2]) * factor}"
