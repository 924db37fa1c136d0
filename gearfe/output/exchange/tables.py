"""The tables of a run in the formats of other programs: one file for all of them.

=========== ============================================================================================================
tables.npz  NumPy; arrays called ``table/column``
tables.h5   HDF5; a group a table, a dataset a column
tables.mat  MATLAB 5; a structure a table, a field a column (names of more than 63 characters are cut)
tables.uff  universal file, binary datasets 58; a function for each column over the first one, where that one rises;
            rows without a number are left out
=========== ============================================================================================================

The CSV files carry 17 significant digits, so what is read from them is what was written.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError, MissingLibraryError
from ...base.typing import Array

Tables = Mapping[str, Mapping[str, Array]]
#: Dataset 58: function type (1 time response, 0 general) and data type of the abscissa by the first column's name
#: (17 time, 18 frequency, 0 unknown).
ABSCISSAS = {"time_s": (1, 17, "s"), "frequency_Hz": (0, 18, "Hz")}
#: Unit at the end of a column's name -> ordinate's data type (8 displacement, 9 reaction force, 11 velocity,
#: 12 acceleration) and text.
ORDINATES = {"_m_per_s2": (12, "m/s^2"), "_m_per_s": (11, "m/s"), "_N": (9, "N"), "_m": (8, "m")}
#: Longest name of a field in a MATLAB file.
LONGEST = 63


def read_csv(path: str | Path) -> dict[str, Array]:
    """Columns of a table: numbers (double precision), or texts where a value is none.

    Raises
    ------
    InputError
        For a file that is no table.
    """
    with Path(path).open(encoding="utf-8-sig", newline="") as stream:
        rows = list(csv.reader(stream))
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        raise InputError("table", str(path), "must have a header and rows of its length", "write it again")
    columns: dict[str, Array] = {}
    for name, values in zip(
        rows[0], zip(*rows[1:], strict=True) if len(rows) > 1 else [()] * len(rows[0]), strict=True
    ):
        try:
            columns[name] = np.array(values, dtype=float)
        except ValueError:
            columns[name] = np.array(values)
    return columns


def write_npz(path: Path, tables: Tables) -> None:
    """One array a column."""
    np.savez(
        path,
        allow_pickle=False,
        **{f"{table}/{name}": v for table, columns in tables.items() for name, v in columns.items()},
    )


def write_hdf5(path: Path, tables: Tables) -> None:
    """One group a table."""
    import h5py

    with h5py.File(path, "w") as file:
        for table, columns in tables.items():
            group = file.create_group(table, track_order=True)
            for name, values in columns.items():
                texts = values.dtype.kind == "U"
                group.create_dataset(name, data=values.astype(object) if texts else values, dtype=_text(h5py, texts))


def _text(h5py: Any, texts: bool) -> Any:
    return h5py.string_dtype() if texts else None


def write_mat(path: Path, tables: Tables) -> None:
    """One structure a table; names as MATLAB allows them."""
    from scipy.io import savemat

    made: dict[str, dict[str, Array]] = {}
    for table, columns in tables.items():
        fields: dict[str, Array] = {}
        for name, values in columns.items():
            short = _matlab_name(name, fields)
            fields[short] = values.astype(object) if values.dtype.kind == "U" else values
        made[_matlab_name(table, made)] = fields
    savemat(path, made, long_field_names=True, oned_as="column")


def _matlab_name(name: str, taken: Mapping[str, Any]) -> str:
    """Letters, digits and underscores, a letter first, no name twice."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    plain = (plain if plain[:1].isalpha() else f"x_{plain}")[:LONGEST]
    number = 2
    while plain in taken:
        plain, number = f"{plain[: LONGEST - 4]}_{number}", number + 1
    return plain


def write_uff(path: Path, tables: Tables) -> None:
    """Datasets 58, one a numerical column of a table whose first column rises.

    Raises
    ------
    MissingLibraryError
        Without pyuff.
    InputError
        Where no table is a function of its first column.
    """
    try:
        import pyuff
    except ImportError:
        raise MissingLibraryError("universal files need pyuff: pip install 'gearfe[exchange]'") from None
    sets: list[Any] = []
    for table, columns in tables.items():
        first, *others = columns
        x = columns[first]
        if x.dtype.kind == "U" or len(x) < 2 or not (np.diff(x) > 0).all():
            continue
        kind, abscissa, unit = ABSCISSAS.get(first, (0, 0, ""))
        for name in others:
            y = columns[name]
            known = np.zeros(0, dtype=bool) if y.dtype.kind == "U" else np.isfinite(y)  # the format has no gaps
            if known.sum() < 2:
                continue
            data_type, label = next((known for end, known in ORDINATES.items() if name.endswith(end)), (0, ""))
            made = pyuff.prepare_58(
                binary=1, id1=name, id2=f"gearfe {table}.csv over {first}", func_type=kind, rsp_node=len(sets) + 1,
                rsp_dir=0, ref_node=0, ref_dir=0, data=y[known], x=x[known], abscissa_spacing=int(_even(x[known])),
                abscissa_spec_data_type=abscissa, abscissa_axis_units_lab=unit, ordinate_spec_data_type=data_type,
                ordinate_axis_units_lab=label, orddenom_spec_data_type=0, z_axis_spec_data_type=0, load_case_id=0,
                rsp_ent_name="NONE", ref_ent_name="NONE",
            )  # fmt: skip
            sets.append(made)
    if not sets:
        raise InputError("--format", "uff", "holds functions, and no table of this run is one", "take csv, h5 or mat")
    path.unlink(missing_ok=True)
    pyuff.UFF(str(path)).write_sets(sets, mode="add")


def _even(x: Array) -> bool:
    """Whether begin and step, in the six digits of the format, give all abscissas."""
    begin, step = float(f"{x[0]:.5e}"), float(f"{x[1] - x[0]:.5e}")
    return bool(np.abs(begin + step * np.arange(len(x)) - x).max() <= 1e-9 * np.abs(x).max())


#: Name of a format -> its writer; the suffix is the name.
WRITERS: dict[str, Callable[[Path, Tables], None]] = {
    "npz": write_npz, "h5": write_hdf5, "mat": write_mat, "uff": write_uff,
}  # fmt: skip


def write_tables(folder: Path, tables: Tables, formats: tuple[str, ...]) -> None:
    """Write ``tables.<format>`` for each format into a folder."""
    for name in formats:
        WRITERS[name](folder / f"tables.{name}", tables)
