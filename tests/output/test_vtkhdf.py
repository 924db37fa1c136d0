"""VTKHDF files are what VTK's own reader reads back, step by step (in a process of its own)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.output.exchange.vtkhdf import VtkHdfSeries, write_vtkhdf
from tests.makers.housing_meshes import box

READER = """
import json, sys, vtk
from vtk.util.numpy_support import vtk_to_numpy
reader = vtk.vtkHDFReader()
reader.SetFileName(sys.argv[1])
reader.UpdateInformation()
key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
information = reader.GetOutputInformation(0)
times = list(information.Get(key)) if information.Has(key) else []
found = []
for step in range(max(1, len(times))):
    if times:
        reader.SetStep(step)
    reader.Update()
    grid = reader.GetOutputDataObject(0)
    if not grid.IsA("vtkUnstructuredGrid"):
        grid = grid.GetPartition(0)
    point, cell = grid.GetPointData(), grid.GetCellData()
    found.append({
        "points": vtk_to_numpy(grid.GetPoints().GetData()).tolist(),
        "types": [grid.GetCellType(i) for i in range(grid.GetNumberOfCells())],
        "cells": [[grid.GetCell(i).GetPointId(k) for k in range(grid.GetCell(i).GetNumberOfPoints())]
                  for i in range(grid.GetNumberOfCells())],
        "point": {d.GetArrayName(i): vtk_to_numpy(d.GetArray(i)).tolist()
                  for d in [point] for i in range(d.GetNumberOfArrays())},
        "cell": {d.GetArrayName(i): vtk_to_numpy(d.GetArray(i)).tolist()
                 for d in [cell] for i in range(d.GetNumberOfArrays())},
    })
json.dump({"times": times, "steps": found}, open(sys.argv[2], "w"))
"""


def read_with_vtk(path: Path) -> dict:  # type: ignore[type-arg]
    target = path.with_suffix(".json")
    done = subprocess.run(
        [sys.executable, "-c", READER, str(path), str(target)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(target.read_text())


def test_series_with_points_that_stay_and_move(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    nodes, tets = box((1, 1, 1), (1.0, 1.0, 1.0))
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    steps = [
        (0.0, nodes, {"tetra10": tets, "triangle": triangles}),
        (0.5, None, None),
        (0.75, nodes + 0.1, None),
        (2.0, None, None),
    ]
    expected = []
    now_points, now_cells = nodes, {"tetra10": tets, "triangle": triangles}
    with VtkHdfSeries(tmp_path / "a.vtkhdf") as series:
        for time, points, cells in steps:
            now_points = now_points if points is None else points
            count = sum(len(c) for c in now_cells.values())
            data = {"u": rng.random((len(now_points), 3)), "p": rng.random(len(now_points))}
            cell_data = {"part": np.arange(count), "stress": rng.random((count, 6))}
            series.add(time, points, cells, point_data=data, cell_data=cell_data)
            expected.append((time, now_points, now_cells, data, cell_data))
    found = read_with_vtk(tmp_path / "a.vtkhdf")
    assert found["times"] == [e[0] for e in expected]
    numbers = {"tetra10": 24, "triangle": 5}
    for got, (_, points, cells, data, cell_data) in zip(found["steps"], expected, strict=True):
        np.testing.assert_array_equal(got["points"], points)
        assert got["types"] == [numbers[name] for name, table in cells.items() for _ in table]
        assert got["cells"] == [row for table in cells.values() for row in table.tolist()]
        assert set(got["point"]) == {"u", "p"}
        for name, values in data.items():
            np.testing.assert_array_equal(got["point"][name], values)
        for name, values in cell_data.items():
            np.testing.assert_array_equal(got["cell"][name], values)
    assert list(tmp_path.glob(".*")) == []


def test_one_grid_without_times_and_flat_points(tmp_path: Path) -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
    write_vtkhdf(tmp_path / "b.vtkhdf", points, {"triangle6": np.arange(6)[None]}, point_data={"u": 2 * points})
    found = read_with_vtk(tmp_path / "b.vtkhdf")
    assert found["times"] == []
    np.testing.assert_array_equal(np.array(found["steps"][0]["points"])[:, :2], points)
    np.testing.assert_array_equal(found["steps"][0]["point"]["u"], np.column_stack([2 * points, np.zeros(6)]))
    assert found["steps"][0]["types"] == [22]


def test_points_that_stay_are_stored_once(tmp_path: Path) -> None:
    nodes, tets = box((2, 2, 2), (1.0, 1.0, 1.0))
    with VtkHdfSeries(tmp_path / "c.vtkhdf") as series:
        for step in range(20):
            mesh = (nodes, {"tetra10": tets}) if step == 0 else (None, None)
            series.add(float(step), *mesh, point_data={"u": step * nodes})
    with h5py.File(tmp_path / "c.vtkhdf") as file:
        assert file["VTKHDF/Points"].shape == nodes.shape
        assert file["VTKHDF/PointData/u"].shape == (20 * len(nodes), 3)
        assert file["VTKHDF"].attrs["Type"] == b"UnstructuredGrid"


def test_a_picture_from_the_file(tmp_path: Path) -> None:
    nodes, tets = box((1, 1, 1), (1.0, 1.0, 1.0))
    write_vtkhdf(tmp_path / "d.vtkhdf", nodes, {"tetra10": tets}, point_data={"x": nodes[:, 0]})
    code = (
        "import sys, pyvista\n"
        "mesh = pyvista.read(sys.argv[1])\n"
        "assert mesh.n_cells == 6 and mesh['x'].max() == 1.0\n"
        "plotter = pyvista.Plotter(off_screen=True, window_size=(80, 80))\n"
        "plotter.add_mesh(mesh)\n"
        "plotter.screenshot(sys.argv[2])\n"
    )
    environment = os.environ | {"VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow"}
    command = [sys.executable, "-c", code, str(tmp_path / "d.vtkhdf"), str(tmp_path / "d.png")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "d.png").stat().st_size > 200


def test_wrong_use_is_named_and_leaves_no_file(tmp_path: Path) -> None:
    nodes, tets = box((1, 1, 1), (1.0, 1.0, 1.0))
    cells = {"tetra10": tets}
    path = tmp_path / "e.vtkhdf"

    def write(*steps: dict) -> None:  # type: ignore[type-arg]
        with VtkHdfSeries(path) as series:
            for step in steps:
                series.add(**step)

    first = {"time": 0.0, "points": nodes, "cells": cells, "point_data": {"u": nodes}}
    for steps, message in (
        ((), "nothing was added"),
        (({"time": 0.0, "points": nodes},), "first step"),
        ((first, first), "larger than the step before"),
        ((first, {"time": 1.0}), "same fields"),
        ((first, {"time": 1.0, "points": nodes[:3], "point_data": {"u": nodes[:3]}}), "another number"),
        ((first, {"time": 1.0, "point_data": {"u": nodes[:3]}}), "rows"),
        ((first, {**first, "time": 1.0}), "others no cells"),
        (({"time": 0.0, "points": nodes, "cells": {"tet": tets}},), "known types"),
        (({"time": 0.0, "points": nodes, "cells": {"tetra": tets}},), "columns"),
        (({"time": 0.0, "points": nodes[:4], "cells": cells},), "point numbers"),
        (({"time": 0.0, "points": nodes[:, :1], "cells": cells},), "shape"),
    ):
        with pytest.raises(InputError, match=message):
            write(*steps)
        assert list(tmp_path.iterdir()) == []
