"""The tables of a run in the formats of other programs: one file for all of them.

=========== ============================================================================================================
tables.npz  NumPy; arrays called ``table/column``
tables.h5   HDF5; a group a table, a dataset a column
tables.mat  MATLAB 5; a structure a table, a field a column (names of more than 63 characters are cut)
tables.uff  universal file, binary datasets 58 in SI units with kind of quantity and unit; a function for each column
            over the first one, where that one rises; rows without a number are left out
=========== ============================================================================================================

The CSV files carry 17 significant digits, so what is read from them is what was written.
"""

from __future__ import annotations

import csv
import itertools
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError, MissingLibraryError
from ...base.quantities import UNITS, parted, unit_of, words
from ...base.typing import Array

Tables = Mapping[str, Mapping[str, Array]]
#: Dataset 58, specific data types: kind of quantity -> code, exponents of length and force (the Universal File Format's
#: addendum A; general, 1, where it has no code of its own). Values are in SI, as dataset 164 of the file says.
QUANTITIES = {
    "length": (8, 1, 0), "angle": (8, 0, 0), "velocity": (11, 1, 0), "angular velocity": (11, 0, 0),
    "acceleration": (12, 1, 0), "angular acceleration": (12, 0, 0), "force": (9, 0, 1), "moment": (9, 1, 1),
    "pressure": (15, -2, 1), "stiffness": (1, -1, 1), "rotational stiffness": (1, 1, 1), "power": (1, 1, 1),
    "energy": (1, 1, 1), "mass": (16, -1, 1), "time": (17, 0, 0), "frequency": (18, 0, 0), "rate": (1, 0, 0),
}  # fmt: skip
#: Columns without a unit that are kinds of their own: order 20.
ORDER = ("order", 20)
#: Function types: time response, and general.
TIME_RESPONSE, GENERAL = 1, 0
#: Longest name of a field in a MATLAB file.
LONGEST = 63


def read_csv(path: str | Path) -> dict[str, Array]:
    """Read the columns of a CSV table: numbers (double precision), or texts where a value is none.

    Lines above the header that begin with ``#`` are comments.

    Raises
    ------
    InputError
        For a file that is no table.
    """
    with Path(path).open(encoding="utf-8-sig", newline="") as stream:
        rows = list(csv.reader(itertools.dropwhile(lambda line: line.startswith("#"), stream)))
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        problem = "must have a header, and rows with as many cells"
        raise InputError("table", str(path), problem, "correct the file, or run the command again that wrote it")
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
        kind = TIME_RESPONSE if unit_of(first).quantity == "time" else GENERAL
        for name in others:
            y = columns[name]
            known = np.zeros(0, dtype=bool) if y.dtype.kind == "U" else np.isfinite(y)  # the format has no gaps
            if known.sum() < 2:
                continue
            places = unit_of(first).factor * x[known]
            made = pyuff.prepare_58(
                binary=1, id1=_si_name(name), id2=_ascii(words(name)), id3=f"gearfe {table}.csv over {first}",
                func_type=kind, rsp_node=len(sets) + 1, rsp_dir=0, ref_node=0, ref_dir=0,
                data=unit_of(name).factor * y[known], x=places, abscissa_spacing=int(_even(places)), load_case_id=0,
                rsp_ent_name="NONE", ref_ent_name="NONE", orddenom_spec_data_type=0, z_axis_spec_data_type=0,
                **_axis("abscissa", first), **_axis("ordinate", name),
            )  # fmt: skip
            sets.append(made)
    if not sets:
        raise InputError("--format", "uff", "holds functions, and no table of this run is one", "take csv, h5 or mat")
    units = pyuff.prepare_164(
        units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=273.15
    )
    path.unlink(missing_ok=True)
    pyuff.UFF(str(path)).write_sets([units, *sets], mode="add")


def _ascii(text: str) -> str:
    """A text as a line of the file holds it."""
    return text.encode("ascii", "replace").decode()[:80]


def _si_name(column: str) -> str:
    """Name of a column in SI units: transmission_error_um -> transmission_error_m."""
    stem, unit = parted(column)
    return f"{stem}_{unit.si}" if unit.si else stem


def _axis(axis: str, column: str) -> dict[str, Any]:
    """Kind of quantity and unit of an axis: records 8 and 9 of data set 58."""
    unit = unit_of(column)
    code, length, force = QUANTITIES.get(unit.quantity, (ORDER[1], 0, 0) if column == ORDER[0] else (0, 0, 0))
    symbol = UNITS[unit.si].symbol.replace("²", "^2") if unit.si else "NONE"  # the file is ASCII
    return {
        f"{axis}_spec_data_type": code,
        f"{axis}_len_unit_exp": length,
        f"{axis}_force_unit_exp": force,
        f"{axis}_temp_unit_exp": 0,
        f"{axis}_axis_units_lab": symbol[:20],
    }


def _even(x: Array) -> bool:
    """Return whether begin and step, in the six digits of the format, give all abscissas."""
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
