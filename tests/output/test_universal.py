"""Universal files as pyuff, another program, writes them: nodes, modes and functions, as text and in binary."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.output.exchange.universal import read_function, read_shapes

pyuff = pytest.importorskip("pyuff", reason="pip install 'gearfe[exchange]'")

LABELS = [11, 12, 40]
GENERATOR = np.random.default_rng(0)
PLACES = GENERATOR.normal(size=(3, 3))


def mode(number: int, values: np.ndarray, *, complex_: bool) -> dict[str, Any]:
    """Data set 55 of values (nodes, 3 or 6)."""
    common = {f"id{i}": "a" for i in range(1, 6)}
    common |= {"type": 55, "model_type": 1, "data_ch": 2, "spec_data_type": 8, "load_case": 1, "mode_n": number}
    common |= {"n_data_per_node": values.shape[1], "data_type": 5 if complex_ else 2, "node_nums": LABELS}
    common |= {f"r{i + 1}": column for i, column in enumerate(values.T)}
    if complex_:
        return common | {"analysis_type": 3, "eig": -3.0 + 400j, "modal_a": 1.0 + 0j, "modal_b": 2.0 + 0j}
    damping = {"modal_damp_vis": 0.01, "modal_damp_his": 0.02}
    return common | {"analysis_type": 2, "freq": 123.5, "modal_m": 1.0} | damping


def written(path: Path, *sets: dict[str, Any]) -> Path:
    for one in sets:
        pyuff.UFF(str(path)).write_sets(one, mode="add")
    return path


def nodes(kind: int) -> dict[str, Any]:
    ones, (x, y, z) = [1] * len(LABELS), 1e3 * PLACES
    make = pyuff.prepare_15 if kind == 15 else pyuff.prepare_2411
    return make(node_nums=LABELS, def_cs=ones, disp_cs=ones, color=ones, x=x, y=y, z=z)


def units() -> dict[str, Any]:
    return pyuff.prepare_164(
        units_code=5, units_description="mm", temp_mode=1, length=1e3, force=1.0, temp=1.0, temp_offset=273.15
    )


@pytest.mark.parametrize(("kind", "digits"), [(15, 1e-5), (2411, 1e-15)])
def test_nodes_in_their_unit(kind: int, digits: float, tmp_path: Path) -> None:
    shapes = read_shapes(written(tmp_path / "a.uff", units(), nodes(kind)), "f")
    assert list(shapes.nodes) == LABELS
    np.testing.assert_allclose(np.array(list(shapes.nodes.values())), PLACES.T, rtol=digits)


@pytest.mark.parametrize(("per_node", "complex_"), [(3, False), (6, False), (3, True)])
def test_modes(per_node: int, complex_: bool, tmp_path: Path) -> None:
    """Real ones with rotations, too, and complex ones, to the six digits of the format."""
    values = GENERATOR.normal(size=(3, per_node)) * (1 - 0.5j if complex_ else 1.0)
    shapes = read_shapes(written(tmp_path / "a.uff", nodes(15), mode(1, values, complex_=complex_)), "f")
    (read,) = shapes.modes
    assert read.nodes == tuple(LABELS)
    np.testing.assert_allclose(read.values, values[:, :3], rtol=1e-5)
    expected = [-3.0, 400.0, 1.0, 0.0, 2.0, 0.0] if complex_ else [123.5, 1.0, 0.01, 0.02]
    np.testing.assert_allclose(read.numbers, expected)


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("even", [0, 1])
@pytest.mark.parametrize("complex_", [False, True])
def test_functions(complex_: bool, even: int, binary: int, tmp_path: Path) -> None:
    """Bytes of binary data may look like the end of a line or of a data set."""
    x = np.arange(8.0) if even else np.cumsum(np.arange(1.0, 9.0))
    y = GENERATOR.normal(size=8) * (1 + 2j if complex_ else 1.0)
    y[2] = np.frombuffer(b"\n-1\n\r\n-1", dtype=float)[0]
    function = pyuff.prepare_58(
        binary=binary, func_type=1, rsp_node=1, rsp_dir=1, ref_dir=1, ref_node=1, data=y, x=x, abscissa_spacing=even,
        ordinate_spec_data_type=12, orddenom_spec_data_type=0, abscissa_spec_data_type=17, z_axis_spec_data_type=0,
        id1="a", id2="b", load_case_id=0, rsp_ent_name="NONE", ref_ent_name="NONE",
    )  # fmt: skip
    path = written(tmp_path / "a.uff", nodes(15), function, {**function, "data": 2 * y})
    one, two = (read_function(path.read_bytes(), number, "f") for number in (1, 2))
    assert one.kind == 1
    np.testing.assert_allclose(one.abscissa, x, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(one.ordinates, y, rtol=0 if binary else 1e-11)
    np.testing.assert_allclose(two.ordinates, 2 * y, rtol=0 if binary else 1e-11)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("E+", "F+", "is not a row of numbers"),
        ("    -1\n    55", "    55", "ends within"),
        ("        40", "        4x", "data set 55"),
        ("         2         8         2         3", "         2         8         9         3", "values of type 9"),
    ],
)
def test_damaged_files_are_refused(old: str, new: str, problem: str, tmp_path: Path) -> None:
    text = written(tmp_path / "a.uff", nodes(15), mode(1, np.ones((3, 3)), complex_=False)).read_text()
    assert old in text
    (tmp_path / "b.uff").write_text(text.replace(old, new) if old != "        40" else new.join(text.rsplit(old, 1)))
    with pytest.raises(InputError, match=problem):
        read_shapes(tmp_path / "b.uff", "f")


def test_a_file_that_is_cut_short_is_refused(tmp_path: Path) -> None:
    text = written(tmp_path / "a.uff", nodes(15), mode(1, np.ones((3, 3)), complex_=False)).read_text()
    for end in range(20, len(text) - 5, 37):
        (tmp_path / "b.uff").write_text(text[:end])
        with pytest.raises(InputError, match="ends within") if text[:end].count("    -1\n") % 2 else nullcontext():
            read_shapes(tmp_path / "b.uff", "f")


@pytest.mark.parametrize(
    ("heads", "size", "says"), [(0, -60, "-60 bytes"), (10**12, 0, "1000000000000 lines"), (-1, 0, "-1 lines")]
)
def test_counts_of_binary_functions_that_lead_nowhere(heads: int, size: int, says: str) -> None:
    """60 bytes back is the mark before the data set itself, read again and again; so many heads fill the memory."""
    mark, head = "    -1\n", f"{f'   58b 1 2 {heads} {size}':<45}\n"
    with pytest.raises(InputError, match=says):
        read_function(f"{mark}    15\n{mark}{mark}{head}{mark}".encode(), 1, "f")
