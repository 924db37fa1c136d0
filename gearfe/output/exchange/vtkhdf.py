"""Write VTKHDF files: unstructured grids, one or a series in time, in one HDF5 file for ParaView and VTK.

The layout is that of VTK (VTK file formats, section "VTKHDF", type UnstructuredGrid, version 2.x). Arrays of all steps
follow each other, and ``Steps`` gives the beginning of each step. All steps share the cells of the first; points that
do not change are stored once.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.files import whole_file
from ...base.typing import Array

#: VTK's numbers of the cell types used here, and how many points each has.
CELL_TYPES: dict[str, tuple[int, int]] = {
    "vertex": (1, 1),
    "line": (3, 2),
    "triangle": (5, 3),
    "quad": (9, 4),
    "tetra": (10, 4),
    "wedge": (13, 6),
    "triangle6": (22, 6),
    "tetra10": (24, 10),
    "wedge18": (32, 18),
}

#: Values of one step: (points,) or (points, k) arrays by name.
Fields = Mapping[str, NDArray[Any]]


class VtkHdfSeries:
    """Writer of a grid file; use it in a ``with`` statement, the file appears whole at its end.

        with VtkHdfSeries("waves.vtkhdf") as series:
            series.add(0.0, points, {"tetra10": tets}, point_data={"displacement": u0})
            series.add(1e-3, point_data={"displacement": u1})

    Parameters
    ----------
    path
        File to write, ``.vtkhdf``.
    series
        ``False`` writes one grid without times.
    """

    def __init__(self, path: str | Path, *, series: bool = True) -> None:
        self._series = series
        self._whole = whole_file(path)
        self._columns: dict[str, Any] = {}
        self._steps: dict[str, list[Any]] = {"Values": [], "PointOffsets": []}
        self._field_names: tuple[frozenset[str], frozenset[str]] | None = None
        self._points = self._cells = 0

    def __enter__(self) -> VtkHdfSeries:
        import h5py

        self._temporary = self._whole.__enter__()
        self._file = h5py.File(self._temporary, "w")
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 2], dtype=np.int64)
        kind = b"UnstructuredGrid"
        root.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))
        self._root = root
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._finish()
        except BaseException as failed:
            self._file.close()
            self._whole.__exit__(type(failed), failed, failed.__traceback__)
            raise
        self._file.close()
        self._whole.__exit__(kind, error, trace)

    def add(
        self,
        time: float,
        points: Array | None = None,
        cells: Mapping[str, NDArray[Any]] | None = None,
        *,
        point_data: Fields | None = None,
        cell_data: Fields | None = None,
    ) -> None:
        """Add a step.

        Parameters
        ----------
        time
            Its time (s), larger than the one before.
        points : (n, 2) or (n, 3)
            Coordinates; ``None`` for those of the step before.
        cells
            Cell type (see `CELL_TYPES`) to (m, points a cell) point numbers; of the first step alone.
        point_data, cell_data
            Name to values, (n,) or (n, k); every step has the same names. Cell data follow the order of `cells`.
        """
        times, offsets = self._steps["Values"], self._steps["PointOffsets"]
        if times and not time > times[-1]:
            raise InputError("time", time, f"must be larger than the step before, {times[-1]:g}", "add steps in order")
        if times and not self._series:
            raise InputError("time", time, "a file without times holds one grid", "pass series=True")
        if bool(times) != (cells is None) or (not times and points is None):
            raise InputError("points", None, "the first step needs points and cells, others no cells", "give both")
        names = (frozenset(point_data or {}), frozenset(cell_data or {}))
        if self._field_names not in (None, names):
            raise InputError(
                "fields", None, "every step must have the same fields as the first", "add the missing ones"
            )
        self._field_names = names
        offsets.append(offsets[-1] if points is None else self._length("Points"))
        if points is not None:
            self._add_points(points)
        if cells is not None:
            self._add_cells(cells)
        times.append(float(time))
        for group, fields, count in (("PointData", point_data, self._points), ("CellData", cell_data, self._cells)):
            for name, values in (fields or {}).items():
                self._add_field(group, name, np.asarray(values), count)

    def _add_points(self, points: Array) -> None:
        coordinates = np.asarray(points, dtype=float)
        if coordinates.ndim != 2 or coordinates.shape[1] not in (2, 3):
            raise InputError("points", coordinates.shape, "must have the shape (n, 2) or (n, 3)", "")
        if self._cells and len(coordinates) != self._points:
            raise InputError("points", len(coordinates), f"another number than before ({self._points})", "give as many")
        self._points = len(coordinates)
        self._append("Points", np.pad(coordinates, ((0, 0), (0, 3 - coordinates.shape[1]))))

    def _add_cells(self, cells: Mapping[str, NDArray[Any]]) -> None:
        kinds, sizes, links = [], [], []
        for name, given in cells.items():
            if name not in CELL_TYPES:
                known = ", ".join(CELL_TYPES)
                raise InputError("cells", name, "is not a cell type that is known here", f"known types: {known}")
            number, width = CELL_TYPES[name]
            table = np.asarray(given)
            if table.ndim != 2 or table.shape[1] != width:
                raise InputError(f"cells.{name}", table.shape, f"must have {width} columns", "")
            if table.size and (table.min() < 0 or table.max() >= self._points):
                raise InputError(f"cells.{name}", int(table.max()), f"point numbers lie in 0..{self._points - 1}", "")
            kinds += [number] * len(table)
            sizes += [width] * len(table)
            links.append(table.astype(np.int64).ravel())
        self._cells = len(kinds)
        connectivity = np.concatenate(links) if links else np.zeros(0, dtype=np.int64)
        counts = {"Points": self._points, "Cells": self._cells, "ConnectivityIds": len(connectivity)}
        for key, count in counts.items():
            self._append(f"NumberOf{key}", np.array([count], dtype=np.int64))
        self._append("Types", np.array(kinds, dtype=np.uint8))
        self._append("Connectivity", connectivity)
        self._append("Offsets", np.cumsum([0, *sizes], dtype=np.int64))

    def _add_field(self, group: str, name: str, values: NDArray[Any], count: int) -> None:
        if len(values) != count or values.ndim > 2:
            raise InputError(f"{group}.{name}", values.shape, f"must have {count} rows", "one for each point or cell")
        if values.ndim == 2 and values.shape[1] == 2:
            values = np.column_stack([values, np.zeros(len(values), dtype=values.dtype)])
        path = f"{group}/{name}"
        self._steps.setdefault(f"{group}Offsets/{name}", []).append(self._length(path))
        self._append(path, values)

    def _append(self, path: str, values: NDArray[Any]) -> None:
        """Add rows at the end of a data set, which is made on first use."""
        if path not in self._columns:
            row = max(1, int(np.prod(values.shape[1:])) * values.dtype.itemsize)
            chunk = (max(1, min(max(len(values), 64), (1 << 20) // row)), *values.shape[1:])
            shape, most = (0, *values.shape[1:]), (None, *values.shape[1:])
            self._columns[path] = self._root.create_dataset(
                path, shape=shape, maxshape=most, chunks=chunk, dtype=values.dtype
            )
        data = self._columns[path]
        if data.shape[1:] != values.shape[1:]:
            raise InputError(path, values.shape, f"must have the row shape {data.shape[1:]} of the step before", "")
        start = data.shape[0]
        data.resize(start + len(values), axis=0)
        data[start:] = values

    def _length(self, path: str) -> int:
        return int(self._columns[path].shape[0]) if path in self._columns else 0

    def _finish(self) -> None:
        count = len(self._steps["Values"])
        if not count:
            raise InputError("steps", 0, "nothing was added to the file", "add one step at least")
        if not self._series:
            return
        steps = self._root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(count)
        steps.create_dataset("NumberOfParts", data=np.ones(count, dtype=np.int64))
        steps.create_dataset("PartOffsets", data=np.zeros(count, dtype=np.int64))
        for key in ("CellOffsets", "ConnectivityIdOffsets"):
            steps.create_dataset(key, data=np.zeros((count, 1), dtype=np.int64))
        for key, values in self._steps.items():
            steps.create_dataset(key, data=np.array(values))


def write_vtkhdf(
    path: str | Path,
    points: Array,
    cells: Mapping[str, NDArray[Any]],
    *,
    point_data: Fields | None = None,
) -> None:
    """Write one grid without times.

    Parameters
    ----------
    path : path
        The file.
    points : ndarray, shape (n, 3)
        Points (m).
    cells : mapping
        Type of cells -> their points, see `VtkHdfSeries.add`.
    point_data : mapping, optional
        Name -> values at the points.
    """
    with VtkHdfSeries(path, series=False) as file:
        file.add(0.0, points, cells, point_data=point_data)
