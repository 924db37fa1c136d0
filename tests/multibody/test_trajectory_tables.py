"""A trajectory as text, as a pandas table and as an xarray data set."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest

from gearfe.base.errors import MissingLibraryError
from gearfe.multibody import Body, Gravity, Hinge, Linkage, System, Trajectory, integrate


def made() -> Trajectory:
    body = Body("rod", 1.0, 0.1, (0.5, 0.0))
    system = System([Linkage((body,), (Hinge("rod", "ground", name="O"),), (Gravity(),))])
    return integrate(system, np.linspace(0.0, 0.1, 3))


def test_a_trajectory_says_what_it_is_in_a_line() -> None:
    text = repr(made())
    assert "done at 0.1 s" in text
    assert "coordinates 3, constraints 2" in text
    assert "\n" not in text


def test_without_the_library_the_cure_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, call in (("pandas", Trajectory.to_pandas), ("xarray", Trajectory.to_xarray)):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(MissingLibraryError, match=f"{name} is not installed: pip install"):
            call(made())


def test_pandas() -> None:
    pytest.importorskip("pandas")
    run = made()
    table = run.to_pandas()
    assert table.index.name == "time_s"
    np.testing.assert_array_equal(table["rod_angle_rad"], run.q[:, 2])
    np.testing.assert_array_equal(table["rate of rod_y_m"], run.v[:, 1])


def test_xarray() -> None:
    pytest.importorskip("xarray")
    run = made()
    data = run.to_xarray()
    np.testing.assert_array_equal(data.q.sel(coordinate="rod_angle_rad"), run.q[:, 2])
    assert data.multipliers.dims == ("time_s", "row")
    assert data.attrs["status"] == "done"


def test_what_goes_into_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same with a stand-in for the library, so that it is tested where that is not installed."""
    seen: dict = {}

    class Frame:
        def __init__(self, values, columns):  # type: ignore[no-untyped-def]
            seen.update(values=values, columns=columns)

        def set_index(self, index):  # type: ignore[no-untyped-def]
            seen["index"] = index
            return self

    fake = types.ModuleType("pandas")
    fake.DataFrame, fake.Index = Frame, lambda values, name: (values, name)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", fake)
    run = made()
    run.to_pandas()
    assert seen["columns"][:3] == ["rod_x_m", "rod_y_m", "rod_angle_rad"]
    assert seen["values"].shape == (3, 6)
    np.testing.assert_array_equal(seen["index"][0], run.time)
