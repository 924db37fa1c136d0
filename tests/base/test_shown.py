"""Results at the prompt, in a notebook, as a table and as a picture."""

from __future__ import annotations

import dataclasses
import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe import (
    Search,
    build_train,
    housing_from_job,
    rate,
    read_study,
    run_study,
    run_up,
    simulate,
    sweep_loads,
    train_modes,
)
from gearfe.base.errors import MissingLibraryError
from gearfe.base.shown import Shown, as_numbers, percent
from gearfe.base.spectrum import amplitude_spectrum
from gearfe.drivetrain.train import Damping, Load
from gearfe.figures.results import PICTURES
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.mechanisms import load_mechanism
from gearfe.multibody import constant, integrate
from tests.makers import gears, rated, trains
from tests.makers.studies import written
from tests.places import GEOMETRY, MESHES, ROOT


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """One result of each class that has a picture."""
    pair = gears.pair(tip_round=1e-4)
    elastic = elastic_pair(pair, coarsen=4.0)
    torques, angles = [50.0, 100.0], np.arange(3) * pair.mesh_cycle / 3
    loads = sweep_loads(pair, torques, angles=angles, elastic=elastic)
    steady = dataclasses.replace(
        trains.elastic(
            trains.train([(20, 30)], stiffness=trains.curve, damping=Damping(ratio=0.05)), uneven=0.2, skew=0.5
        ),
        loads=(Load("s1", "s1+", constant(60.0)),),
    )
    model = build_train(steady)
    trial = tmp_path_factory.mktemp("study")
    crank = load_mechanism(str(GEOMETRY / "slider_crank.toml"))
    tone = np.sin(2 * np.pi * 125.0 * 1e-3 * np.arange(64))
    made: list[Any] = [
        pair,
        loads.curves[0],
        loads,
        simulate(model, np.linspace(0.0, 1e-4, 5)),
        steady.housing,
        run_up(model, [500.0, 510.0, 520.0], tolerance=1e-2),
        train_modes(model, [0.0, 400.0]),
        rate(rated.spur_stage(), rated.SPUR),
        integrate(crank.system, np.linspace(0.0, 0.01, 3)),
        run_study(read_study(written(trial, cases=8)), trial / "out", jobs=1),
        amplitude_spectrum(np.column_stack([tone, 2.0 * tone]), 1e-3),
    ]
    return {type(one).__name__: one for one in made}


@pytest.mark.parametrize("name", PICTURES)
def test_prompt_notebook_and_picture(name: str, results: dict[str, Any]) -> None:
    result = results[name]
    assert isinstance(result, Shown)
    assert len(repr(result)) < 800
    assert "array(" not in repr(result)
    page = result._repr_html_()
    assert all(value.replace("<", "&lt;") in page for value in result.facts().values())
    assert page.count("<tr>") == len(result.facts()) >= 3
    figure = result.plot()
    figure.savefig(io.BytesIO(), format="png", dpi=60)
    drawn = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    assert len(np.unique(drawn.reshape(-1, 3), axis=0)) > 20  # curves and labels, not an empty frame
    assert (drawn < 250).any(axis=-1).mean() > 0.01


def test_models_tell_what_they_are(tmp_path: Path) -> None:
    train = build_train(trains.train([(20, 30)]))
    with Search(read_study(written(tmp_path, cases=8))) as search:
        search.solve([dict.fromkeys(search.study.task.names, 1.0)])
    assert "points 1, 1 done" in repr(search)
    assert repr(train.train).startswith("GearTrain: shafts s0, s1, gears ")
    housing = housing_from_job(str(MESHES / "box.toml"))
    assert repr(train).startswith("TrainModel: shafts s0, s1, ")
    assert f"held nodes {len(housing.fixed)}" in repr(housing)
    for one in (train, train.train, search, housing):
        assert len(repr(one)) < 300
        assert one._repr_html_().count("<tr>") == len(one.facts())


def test_tables(results: dict[str, Any]) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    curve, loads, response = (results[name] for name in ("StiffnessCurve", "LoadMap", "TrainResponse"))
    frame = curve.to_pandas()
    digits = 5e-15  # half of the fifteenth digit, to which tables are written
    np.testing.assert_allclose(frame["k_mesh_N_per_m"], curve.k_mesh, rtol=digits)
    assert set(frame["status"]) == {"converged"}
    data = loads.to_xarray()
    assert data["k_mesh_N_per_m"].dims == ("torque_Nm", "pinion_angle_deg")
    np.testing.assert_allclose(data["k_mesh_N_per_m"], loads.quantity("k_mesh"), rtol=digits)
    np.testing.assert_array_equal(response.to_xarray()["contact_force_1_N"], response.contact_force[:, 0])


def test_tables_of_run_ups_studies_and_spectra(results: dict[str, Any]) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    run, study, lines = (results[name] for name in ("RunUp", "StudyResult", "Spectrum"))
    frame = run.to_pandas()
    assert frame["speed_rad_per_s"].tolist() == [state.speed for state in run.states]
    assert run.to_xarray()["dynamic_factor_1"].dims == ("row",)
    np.testing.assert_array_equal(study.to_pandas()["y"], study.output("y"))
    assert study.to_xarray()["y"].dims == ("case",)
    data = lines.to_xarray()  # sines of 125 Hz with the amplitudes 1 and 2, on a line
    assert float(data["amplitude_1"].sel(frequency_Hz=125.0)) == pytest.approx(1.0)
    assert float(data["amplitude_2"].sel(frequency_Hz=125.0)) == pytest.approx(2.0)


def test_columns_of_numbers_and_of_words() -> None:
    assert as_numbers(["1", "nan"])[0] == 1.0
    assert as_numbers(["1", "converged"]).tolist() == ["1", "converged"]


def test_a_missing_library_is_named_with_its_line(results: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'gearfe\[study\]'"):
        results["StiffnessCurve"].to_pandas()


@pytest.mark.parametrize(
    ("share", "text"),
    [(1.2, "120 %"), (12.34, "1200 %"), (0.0996, "10 %"), (0.031, "3.1 %"), (0.5, "50 %"), (0.0, "0 %"),
     (2.9e-6, "0.00029 %"), (2.9e-9, "2.9e-07 %"), (-0.25, "-25 %"), (math.nan, "unknown")],
)  # fmt: skip
def test_percentages_have_no_powers_of_ten_that_people_write_out(share: float, text: str) -> None:
    assert percent(share) == text


def test_every_computed_percentage_is_written_by_percent() -> None:
    """Rounded to digits by a format of its own, 120 % is 1.2e+02 %."""
    own = re.compile(r"\.\dg\} ?%")
    found = [
        path.name
        for path in sorted((ROOT / "gearfe").rglob("*.py"))
        if path.name != "shown.py" and own.search(path.read_text(encoding="utf-8"))
    ]
    assert found == []
