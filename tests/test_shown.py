"""Results at the prompt, in a notebook, as a table and as a picture."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe import build_train, load_mesh, run_up, simulate, sweep_loads
from gearfe.contact.half_plane import half_plane_pair
from gearfe.errors import MissingLibraryError
from gearfe.figures.results import PICTURES
from gearfe.mechanisms import load_mechanism
from gearfe.rigid import constant, integrate
from gearfe.shown import Shown, numbers
from gearfe.stiffness.sweep import elastic_pair
from gearfe.train import Damping, Load

from . import gears, trains

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
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
    crank = load_mechanism(str(ROOT / "geometry" / "slider_crank.toml"))
    made: list[Any] = [
        pair,
        loads.curves[0],
        loads,
        load_mesh(half_plane_pair(pair, elastic), torques, positions=4),
        simulate(model, np.linspace(0.0, 1e-4, 5)),
        steady.housing,
        run_up(model, [500.0, 510.0, 520.0], tolerance=1e-2),
        integrate(crank.system, np.linspace(0.0, 0.01, 3)),
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
    kept = io.BytesIO()
    result.plot().savefig(kept, format="png", dpi=60)
    assert len(kept.getvalue()) > 5000


def test_tables(results: dict[str, Any]) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    curve, loads, response = (results[name] for name in ("StiffnessCurve", "LoadMap", "TrainResponse"))
    frame = curve.to_pandas()
    assert frame["k_mesh_N_per_m"].tolist() == curve.k_mesh.tolist()
    assert set(frame["status"]) == {"converged"}
    data = loads.to_xarray()
    assert data["k_mesh_N_per_m"].dims == ("torque_Nm", "pinion_angle_deg")
    np.testing.assert_array_equal(data["k_mesh_N_per_m"], loads.quantity("k_mesh"))
    np.testing.assert_array_equal(response.to_xarray()["contact_force_1_N"], response.contact_force[:, 0])


def test_columns_of_numbers_and_of_words() -> None:
    assert numbers(["1", "nan"])[0] == 1.0
    assert numbers(["1", "converged"]) == ["1", "converged"]


def test_a_missing_library_is_named_with_its_line(results: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'gearfe\[study\]'"):
        results["StiffnessCurve"].to_pandas()
