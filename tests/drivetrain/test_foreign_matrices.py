"""Matrices as other programs write them: substructures of Abaqus, lost rows, damaged files."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.housing import SuperelementTable
from gearfe.drivetrain.housing.modal_test import read_modes
from gearfe.drivetrain.housing.superelement import rigid_shapes, superelement
from gearfe.fem.reduction.modal_body import ModalBody
from gearfe.output.exchange.matrix_file import read_matrix
from gearfe.output.exchange.matrix_market import write_market
from tests.makers.files import damaged
from tests.makers.nastran import Output2, output4_binary, output4_text

POINTS = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.01]])
#: Node and freedom of each row: two attachments and three modes at a node of its own.
LABELS = [(11 + i // 6, 1 + i % 6) if i < 12 else (1001, i - 11) for i in range(15)]


@pytest.fixture(scope="module")
def matrices() -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass of a free body: any positive matrices without energy, or with the mass, of rigid motions."""
    rng = np.random.default_rng(4)
    rigid = np.vstack([rigid_shapes(POINTS), np.zeros((3, 6))])
    q = np.linalg.qr(np.column_stack([rigid, rng.normal(size=(15, 9))]))[0]
    K = q[:, 6:] @ np.diag(rng.uniform(1e6, 1e9, 9)) @ q[:, 6:].T
    left = np.linalg.pinv(rigid[:12])
    whole = np.diag([2.0, 2.0, 2.0, 1e-3, 2e-3, 3e-3])
    M = np.zeros((15, 15))
    M[:12, :12] = left.T @ whole @ left + q[:12, 6:] @ np.diag(rng.uniform(0.01, 0.02, 9)) @ q[:12, 6:].T
    M[12:, 12:] = np.eye(3)
    P = np.eye(15)
    P[:12, :12] -= rigid[:12] @ left
    M = np.zeros((15, 15))
    M[:12, :12] = left.T @ whole @ left
    M += P.T @ np.diag(rng.uniform(0.01, 0.02, 15)) @ P
    return 0.5 * (K + K.T), 0.5 * (M + M.T)


def substructure(K: np.ndarray, M: np.ndarray, *, nodes: str = "** ELEMENT NODES\n** 11, 12, 1001\n") -> str:
    """As *SUBSTRUCTURE MATRIX OUTPUT writes it: lower triangles, rows of four numbers a line."""
    text = "** ABAQUS substructure matrix output\n*USER ELEMENT, NODES=3, LINEAR, TYPE=U101\n" + nodes
    text += "1,2,3,4,5,6\n3,1,2,3\n"  # the second node has the freedoms of the first
    for kind, values in (("STIFFNESS", K), ("MASS", M)):
        text += f"*MATRIX, TYPE={kind}\n"
        for i, row in enumerate(values):
            cells = [f"{value:.16E}" for value in row[: i + 1]]
            text += "".join(", ".join(cells[j : j + 4]) + (",\n" if j + 4 <= i else "\n") for j in range(0, i + 1, 4))
    return text


def table(name: str, *, by_node: bool = True, mass: str = "") -> SuperelementTable:
    places: list[dict[str, Any]] = [{"node": 11}, {"node": 12}]
    if not by_node:
        places = [{"rows": [1, 2, 3, 4, 5, 6]}, {"rows": [7, 8, 9, 10, 11, 12]}]
    rows = [{"point_mm": (1e3 * point).tolist(), **place} for point, place in zip(POINTS, places, strict=True)]
    return build(SuperelementTable, {"stiffness": name, "mass": mass or name, "attachments": rows}, "housing")


def dmig(K: np.ndarray, M: np.ndarray) -> str:
    text = ""
    for name, values in (("KAAX", K), ("MAAX", M)):
        text += f"DMIG,{name},0,6,2,0\n"
        for j, (node, freedom) in enumerate(LABELS):
            entries = [f"{LABELS[i][0]},{LABELS[i][1]},{values[i, j]:.15e}" for i in range(j, 15)]
            text += f"DMIG,{name},{node},{freedom},,{entries[0]}\n" + "".join(f",{one}\n" for one in entries[1:])
    return text


def lines(values: np.ndarray) -> str:
    """As *MATRIX OUTPUT writes it, half of the matrix."""
    rows = [(LABELS[i], LABELS[j], values[i, j]) for j in range(15) for i in range(j, 15)]
    return "".join(f"{a},{b}, {c},{d}, {value:.16e}\n" for (a, b), (c, d), value in rows)


def hz(body: ModalBody) -> np.ndarray:
    return body.coupled.frequencies_hz


@pytest.fixture(scope="module")
def wanted(matrices) -> np.ndarray:
    """Frequencies (Hz) of the matrices themselves."""
    from scipy.linalg import eigh

    values = eigh(matrices[0], matrices[1], eigvals_only=True)
    return np.sqrt(np.maximum(values[6:], 0.0)) / (2 * np.pi)


@pytest.mark.parametrize("by_node", [True, False])
def test_a_substructure_of_abaqus(by_node, matrices, wanted, tmp_path) -> None:
    (tmp_path / "a.mtx").write_text(substructure(*matrices))
    assert hz(superelement(table("a.mtx", by_node=by_node), tmp_path))[6:] == pytest.approx(wanted, rel=1e-6)
    for initial, values in zip("KM", matrices, strict=True):
        np.testing.assert_array_equal(read_matrix(tmp_path / "a.mtx", "x", initial).values, values)
    assert read_matrix(tmp_path / "a.mtx", "x").labels == LABELS


def test_a_substructure_without_the_names_of_its_nodes(matrices, wanted, tmp_path) -> None:
    (tmp_path / "a.mtx").write_text(substructure(*matrices, nodes=""))
    assert hz(superelement(table("a.mtx", by_node=False), tmp_path))[6:] == pytest.approx(wanted, rel=1e-6)
    with pytest.raises(InputError, match=r"attachments\[0\]\.node"):
        superelement(table("a.mtx"), tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("*MATRIX, TYPE=MASS", "*MATRIX, TYPE=VISCOUS DAMPING", r"has no \*MATRIX, TYPE=MASS; there are: STIFFNESS"),
        ("*MATRIX, TYPE=MASS", "*MATRIX, TYPE=STIFFNESS", "STIFFNESS is there twice"),
        ("NODES=3", "NODES=4", "do not fit|names 3 nodes"),
        ("3,1,2,3\n", "3,1,2\n", "must have 105 numbers, but has 120: rows are missing|must have 105 numbers"),
        ("3,1,2,3\n", "3,1,2,2\n", "a freedom of a node twice"),
        ("11, 12, 1001", "11, 11, 1001", "each once"),
        ("NODES=3", "NODES=99999999", "has 99999999 rows"),
        ("E+", "Q+", "cannot be read"),
        ("E+", "E+9", "as its largest number|not finite"),
    ],
)
def test_substructures_that_are_refused(old, new, text, matrices, tmp_path) -> None:
    (tmp_path / "a.mtx").write_text(substructure(*matrices).replace(old, new))
    with pytest.raises(InputError, match=text):
        superelement(table("a.mtx"), tmp_path)


@pytest.mark.parametrize("kind", ["row", "node", "diagonal", "sign", "nan", "doubled", "matrix"])
@pytest.mark.parametrize("form", ["dmig", "lines"])
def test_lost_and_damaged_rows(form, kind, matrices, tmp_path) -> None:
    """Numbers of nodes that are damaged, entries lost from the diagonal, of the wrong sign, doubled, not finite."""
    K, M = matrices
    name = "a.pch" if form == "dmig" else "K.mtx"
    text = dmig(K, M) if form == "dmig" else lines(K)
    (tmp_path / "M.mtx").write_text(lines(M))
    entry = f"{K[6, 6]:.15e}" if form == "dmig" else f"{K[6, 6]:.16e}"
    row = ("DMIG,KAAX,12,1,,12,1," if form == "dmig" else "12,1, 12,1, ") + entry
    faults = {
        "row": (row + "\n", ""),
        "node": (row, row.replace("12,1", "72,1")),
        "diagonal": (entry, entry[:-3] + "-05"),
        "sign": (entry, "-" + entry),
        "nan": (entry, "nan" if form == "lines" else "1.e999"),
        "doubled": (row + "\n", f"{row}\n{row.replace(entry, '1.0')}\n"),
    }
    old, new = faults.get(kind, (text[text.index("KAAX" if form == "dmig" else "11,") :], ""))
    (tmp_path / name).write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=r"housing\.superelement|housing\.stiffness|stiffness"):
        superelement(table(name, mass="" if form == "dmig" else "M.mtx"), tmp_path)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 1.\n2 2 1.\n", "has 2 entries, .* says 3"),
        (
            "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 1.\n2 1 1.\n1 2 1.\n",
            "mirror image is given twice",
        ),
        ("%%MatrixMarket matrix coordinate real general\n2 2 1\n3 1 1.\n", r"there is no entry \(3, 1\)"),
        ("%%MatrixMarket matrix array real general\n2 2\n1.\n2.\n3.\n4.\n5.\n6.\n", "has 6 numbers, .* asks for 4"),
        ("%%MatrixMarket matrix coordinate real general\n99999999 99999999 0\n", "has 99999999 rows"),
        ("%%MatrixMarket matrix coordinate pattern general\n2 2 1\n1 1\n", "first line"),
        ("%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 0\n", "skew-symmetric"),
        ("%%MatrixMarket\n", "first line"),
        ("%%MatrixMarket matrix array real general\nx\n", "line 2"),
        ("%%MatrixMarket matrix array real general\n2 3\n1.\n2.\n3.\n4.\n5.\n6.\n", "square"),
    ],
)
def test_matrix_market_files_that_are_refused(text, problem, tmp_path) -> None:
    """SciPy's reader adds doubled entries up, and writes beyond its memory for the fourth."""
    (tmp_path / "K.mtx").write_text(text)
    with pytest.raises(InputError, match=problem):
        read_matrix(tmp_path / "K.mtx", "x")


@pytest.mark.parametrize("layout", ["coordinate", "array"])
@pytest.mark.parametrize("symmetry", ["general", "symmetric"])
def test_matrix_market_files(layout, symmetry, matrices, tmp_path) -> None:
    from scipy import sparse
    from scipy.io import mmwrite

    K = matrices[0]
    mmwrite(str(tmp_path / "K.mtx"), K if layout == "array" else sparse.coo_array(K), symmetry=symmetry, precision=17)
    np.testing.assert_array_equal(read_matrix(tmp_path / "K.mtx", "x").values, K)


def test_damaged_matrices_are_refused_in_words(matrices, tmp_path) -> None:
    """Random faults in each kind of file give a body or an `InputError`, never anything else."""
    both = dict(zip(("KAAX", "MAAX"), matrices, strict=True))
    columns, pool = Output2(), Output2()
    for name, values in both.items():
        columns.matrix(name, values)
    pool.pool(both, [(11 + i // 6, 1 + i % 6) if i < 12 else (501 + i, 0) for i in range(15)])
    files = {
        "a.mtx": substructure(*matrices).encode(),
        "a.pch": dmig(*matrices).encode(),
        **{f"{layout}.op4": output4_binary(both, layout) for layout in ("full", "packed", "wide")},
        **{f"t_{layout}.op4": output4_text(both, layout).encode() for layout in ("full", "packed", "wide")},
        "c.op2": columns.bytes(),
        "p.op2": pool.bytes(),
    }
    for name, values in both.items():
        write_market(tmp_path / f"{name}.mtx", values)
    files["market.mtx"] = (tmp_path / "KAAX.mtx").read_bytes()
    files["lines.mtx"] = lines(matrices[0]).encode()
    rng = np.random.default_rng(41)
    for name, content in files.items():
        mass = "MAAX.mtx" if name in ("market.mtx", "lines.mtx") else ""
        by_node = name in ("a.mtx", "a.pch", "p.op2")
        if name == "lines.mtx":
            (tmp_path / "MAAX.mtx").write_text(lines(matrices[1]))
        (tmp_path / name).write_bytes(content)
        superelement(table(name, by_node=by_node, mass=mass), tmp_path)
        for _ in range(60):
            (tmp_path / name).write_bytes(damaged(content, rng))
            with contextlib.suppress(InputError):
                superelement(table(name, by_node=by_node, mass=mass), tmp_path)


def test_damaged_modes_are_refused_in_words(matrices, tmp_path) -> None:
    (tmp_path / "a.mtx").write_text(substructure(*matrices))
    body = superelement(table("a.mtx"), tmp_path)
    body.save(tmp_path / "a.npz")
    rows = ["frequency_Hz,x_mm,y_mm,z_mm,direction_x,direction_y,direction_z,amplitude"]
    rows += [f"{f},{x},0,{z},1,0,0,{f * x + z + 1}" for f in (100, 200) for x, z in ((0, 0), (30, 10))]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    rng = np.random.default_rng(42)
    for name in ("a.csv", "a.npz"):
        content = (tmp_path / name).read_bytes()
        read_modes(tmp_path / name)
        for _ in range(150):
            (tmp_path / f"damaged-{name}").write_bytes(damaged(content, rng))
            try:
                modes = read_modes(tmp_path / f"damaged-{name}")
            except InputError:
                continue
            assert (modes.frequencies > 0.0).all()
            assert np.isfinite(modes.shapes).all()


@pytest.mark.parametrize(
    ("entry", "change"),
    [
        ("mass", lambda a: a[:-1]),
        ("stiffness", lambda a: a[:, :-1]),
        ("shapes", lambda a: a[:-3]),
        ("nodes", lambda a: np.where(a == a[0, 0], np.nan, a)),
        ("internal_hz", lambda a: a[:0]),
        ("modes", lambda a: a + 99),
        ("format", lambda a: np.array([a, a])),
        ("attachment_points", lambda a: a[0]),
        ("mass", lambda a: a.astype(str)),
    ],
)
def test_a_body_whose_entries_do_not_fit(entry, change, matrices, tmp_path) -> None:
    (tmp_path / "a.mtx").write_text(substructure(*matrices))
    superelement(table("a.mtx"), tmp_path).save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as stored:
        arrays = dict(stored)
    arrays[entry] = change(arrays[entry])
    np.savez(tmp_path / "b.npz", **arrays)
    with pytest.raises(InputError, match=r"reduced model = .*b\.npz.*make it again"):
        ModalBody.load(tmp_path / "b.npz")


def test_universal_files_with_damaged_datasets(tmp_path) -> None:
    pyuff = pytest.importorskip("pyuff", reason="pip install 'gearfe[exchange]'")
    nodes, zeros = np.arange(1, 3), np.zeros(2)
    names = {f"id{i}": "a" for i in range(1, 6)}
    sets = [
        {
            "type": 15,
            "node_nums": nodes,
            "def_cs": zeros,
            "disp_cs": zeros,
            "color": zeros,
            "x": zeros,
            "y": zeros,
            "z": zeros,
        },
        {
            **{
                "type": 55,
                "model_type": 1,
                **names,
                "analysis_type": 2,
                "data_ch": 2,
                "spec_data_type": 8,
                "data_type": 2,
            },
            **{"n_data_per_node": 3, "r1": zeros + 1, "r2": zeros, "r3": zeros, "node_nums": nodes, "load_case": 1},
            **{"mode_n": 1, "freq": 100.0, "modal_m": 1.0, "modal_damp_vis": 0.01, "modal_damp_his": 0.0},
        },
    ]
    path = Path(tmp_path) / "a.uff"
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")
    assert read_modes(path).frequencies.tolist() == [100.0]
    content = path.read_bytes()
    rng = np.random.default_rng(43)
    for _ in range(200):
        path.write_bytes(damaged(content, rng))
        with contextlib.suppress(InputError):
            read_modes(path)


def test_freedoms_of_a_substructure_that_fill_the_memory(tmp_path) -> None:
    """5000 nodes with 10000 freedoms each are counted before they are listed."""
    freedoms = ",".join(str(i) for i in range(1, 10_001))
    (tmp_path / "a.mtx").write_text(f"*USER ELEMENT, NODES=5000\n{freedoms}\n*MATRIX, TYPE=STIFFNESS\n1.0\n")
    with pytest.raises(InputError, match="has 50000000 rows"):
        read_matrix(tmp_path / "a.mtx", "stiffness")
