"""Matrices in Nastran's files of the kinds OUTPUT4 and OUTPUT2, in each layout that the format has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.output.exchange.matrix_file import read_matrix
from gearfe.output.exchange.nastran_output import output2, output4, read_nastran
from tests.makers.nastran import Output2, output4_binary, output4_text

LAYOUTS = ("full", "packed", "wide")


def matrices() -> dict[str, np.ndarray]:
    """A sparse one with an empty column, and a full one that is not square."""
    rng = np.random.default_rng(1)
    sparse = np.where(rng.random((9, 7)) < 0.4, 0.0, rng.normal(size=(9, 7)) * 10.0 ** rng.integers(-9, 9, (9, 7)))
    sparse[:, 3] = 0.0
    return {"KAA": sparse, "MUG1": rng.normal(size=(2, 70))}


def same(found: dict, wanted: dict) -> None:
    assert list(found) == list(wanted)
    for name, values in wanted.items():
        np.testing.assert_array_equal(found[name], values)


def test_a_file_as_the_manual_prints_it() -> None:
    """Packed heads: 196609 is a string of two words from row 1, 589826 one of eight from row 2."""
    text = (
        "       2       5       2       2LOW     1P,3E23.16\n"
        "       1       0       3\n  196609\n 1.5000000000000000E+00\n"
        "       2       0       9\n  589826\n"
        " 1.0000000000000000E+00-2.0000000000000000E+00 3.0000000000000000-101\n 4.0000000000000000E+00\n"
        "       3       1       1\n 1.0000000000000000E+00\n"
    )
    same(output4(text.encode()), {"LOW": np.array([[1.5, 0], [0, 1.0], [0, -2.0], [0, 3e-101], [0, 4.0]])})


@pytest.mark.parametrize("layout", LAYOUTS)
def test_output4(layout: str) -> None:
    same(output4(output4_text(matrices(), layout).encode()), matrices())
    for order in "<>":
        same(output4(output4_binary(matrices(), layout, order)), matrices())


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("size", [4, 8])
def test_output2(order: str, size: int) -> None:
    """Matrices between other tables, entries of superelements, words of four and of eight bytes."""
    file = Output2(order, size)
    file.begin("GEOM1", 101, 0, 0, 0, 0, 0, 0)
    file.keys(-3, 1, 0)
    file.put(4, file.ints(4501, 45, 1, 7))
    file.keys(-4, 1, 0, 0)
    for name, A in matrices().items():
        file.matrix(name, A)
    full = np.array([[2.0, -1.0], [-1.0, 4.0]])
    file.pool({"KAAX": full, "MAAX": 3 * full}, [(11, 6), (12, 0)])
    found = output2(file.bytes())
    same({name: found[name] for name in matrices()}, matrices())
    assert found["MAAX"] == {((11, 6), (11, 6)): 6.0, ((12, 0), (11, 6)): -3.0, ((12, 0), (12, 0)): 12.0}


def test_the_matrix_that_is_meant(tmp_path: Path) -> None:
    """External superelements have fillers of one row, structural damping and vectors beside stiffness and mass."""
    full, one = np.array([[2.0, -1.0], [-1.0, 4.0]]), np.ones((1, 1))
    others = {"K4XX": one, "K4AA": full, "KASMX": one, "PA": np.ones((2, 1)), "BXX": one}
    path = tmp_path / "se.op4"
    path.write_text(output4_text({"MAA": 3 * full, "KAA": full, **others}, "packed"))
    assert (read_matrix(path, "x", "K").values == full).all()
    assert (read_matrix(path, "x", "M").values == 3 * full).all()
    path.write_text(output4_text({"X": full, "Y": full}, "full"))
    with pytest.raises(InputError, match=r"begins with K: there are X, Y"):
        read_matrix(path, "x", "K")


@pytest.mark.parametrize("name", ["cut.op2", "cut.op4", "text.op4", "words.op2", "empty.op2", "empty.op4", "none.op2"])
def test_files_that_are_none(name: str, tmp_path: Path) -> None:
    file = Output2()
    file.matrix("KAA", np.eye(4))
    cut = {"cut.op2": file.bytes()[:-60], "cut.op4": output4_binary({"KAA": np.eye(4)}, "full")[:-90]}
    given = {**cut, "text.op4": b"       4       4 nothing\n", "words.op2": b"hello, this is no such file" * 9}
    if name != "none.op2":
        (tmp_path / name).write_bytes(given.get(name, b""))
    with pytest.raises(InputError, match=f"{name}.*(cannot be read as OUTPUT[24]|no such file)"):
        read_nastran(tmp_path / name, "housing.superelement.stiffness")


def record(*words: int, more: bytes = b"") -> bytes:
    data = np.array(words, dtype="<i4").tobytes() + more
    length = np.array(len(data), dtype="<i4").tobytes()
    return length + data + length


HEAD = record(2, 2, 6, 2, more=b"KAA     ")
ENDLESS = {
    "a string without words": HEAD + record(1, 0, 1, 1),  # packed: length 0, row 1
    "a string of negative length": HEAD + record(1, 0, 1, -65535),
    "a rest of a word": HEAD + record(1, 1, 1, more=b"ab"),
    "text with a negative length": b"%8d%8d%8d%8dKAA     1P,3E23.16\n%8d%8d%8d\n%8d\n" % (2, 2, 6, 2, 1, 0, 9, -655350),
    "a format of no numbers": b"%8d%8d%8d%8dKAA     1P,0E23.16\n%8d%8d%8d\n 1.0\n" % (2, 2, 6, 2, 1, 1, 4),
    "numbers of a terabyte": b"%8d%8d%8d%8dKAA     1P,3E999999999999.16\n%8d%8d%8d\n 1.0\n" % (2, 2, 6, 2, 1, 1, 4),
}


@pytest.mark.parametrize("content", ENDLESS.values(), ids=ENDLESS)
def test_counts_that_lead_nowhere(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.op4").write_bytes(content)
    with pytest.raises(InputError, match="cannot be read as OUTPUT4"):
        read_nastran(tmp_path / "a.op4", "housing.superelement.stiffness")
