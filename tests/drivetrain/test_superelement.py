"""Matrices of other programs as housings: there and back, units, orders of rows, and what is wrong with them."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import mmwrite
from scipy.sparse import coo_array

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.housing import HousingTable, SuperelementTable
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import bore_places, job_train, read_train_job, train_body
from gearfe.drivetrain.gearbox.mesh_stiffness import train_curves
from gearfe.drivetrain.housing.body import reduced_housing
from gearfe.drivetrain.housing.build import housing_from_job
from gearfe.drivetrain.housing.superelement import superelement
from gearfe.drivetrain.train import build_train
from gearfe.fem.reduction.error import accelerances
from gearfe.fem.reduction.modal_body import ModalBody
from gearfe.output.exchange.matrix_file import read_matrix
from gearfe.output.exchange.matrix_market import write_market
from tests.makers.nastran import Output2, output4_binary, output4_text
from tests.places import EXAMPLES, MESHES

POINTS = [(0.0, 31.0, 0.0), (0.0, -31.0, 0.0), (62.5, 31.0, 0.0), (62.5, -31.0, 0.0)]
B = 24


@pytest.fixture(scope="module")
def bodies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ModalBody]:
    """The shipped box, held by its feet and free, with six modes and corrections."""
    text = (MESHES / "box.toml").read_text()
    folder = tmp_path_factory.mktemp("box")
    (folder / "box.msh").write_bytes((MESHES / "box.msh").read_bytes())
    made = {}
    free = text[: text.index("[[housing.held]]")] + text[text.index("[housing.reduction]") :]
    for name, job in {"held": text, "free": free}.items():
        (folder / f"{name}.toml").write_text(job)
        made[name] = housing_from_job(folder / f"{name}.toml").reduce(6, estimate=False)
    return made


def write(folder: Path, K: np.ndarray, M: np.ndarray) -> None:
    mmwrite(folder / "K.mtx", K, precision=17)
    mmwrite(folder / "M.mtx", M, precision=17)


def table(**keys: Any) -> SuperelementTable:
    points = [{"point_mm": list(point)} for point in POINTS]
    return build(
        SuperelementTable, {"stiffness": "K.mtx", "mass": "M.mtx", "attachments": points, **keys}, "superelement"
    )


def same(one: ModalBody, other: ModalBody, rel: float = 1e-9) -> None:
    """Frequencies with free and with held attachments, and the response of the attachments."""
    assert other.held == one.held
    a, b = one.coupled.frequencies_hz, other.coupled.frequencies_hz
    assert b[:20] == pytest.approx(a[:20], rel=rel, abs=1e-3)
    assert np.sort(other.internal_hz) == pytest.approx(np.sort(one.internal_hz), rel=rel)
    mine, yours = (accelerances(body, 4000.0, points=7) for body in (one, other))
    assert np.abs(yours - mine).max() < 1e-7 * np.abs(mine).max()


@pytest.mark.parametrize("kind", ["held", "free"])
def test_there_and_back(kind, bodies, tmp_path) -> None:
    body = bodies[kind]
    write(tmp_path, body.stiffness, body.mass)
    made = superelement(table(), tmp_path)
    same(body, made)
    assert made.attachment_points == pytest.approx(body.attachment_points, abs=1e-9)
    if kind == "free":
        assert made.rigid_mass == pytest.approx(body.rigid_mass, rel=1e-6, abs=1e-9)
    else:
        assert np.isnan(made.rigid_mass).all()


def test_any_order_and_any_inner_coordinates(bodies, tmp_path) -> None:
    """Rows shuffled, inner coordinates mixed and scaled, one of them without mass."""
    body, rng = bodies["free"], np.random.default_rng(3)
    size = body.size
    inner = size - B
    K, M = np.zeros((size + 1, size + 1)), np.zeros((size + 1, size + 1))
    K[:size, :size], M[:size, :size] = body.stiffness, body.mass
    K[size, size] = 1e12  # a spring to nothing: carries no mass
    change = np.eye(size + 1)
    change[B:size, B:size] = rng.normal(size=(inner, inner)) * 10 ** rng.uniform(-2, 2, inner)
    shuffle = rng.permutation(size + 1)
    K, M = ((change.T @ A @ change)[np.ix_(shuffle, shuffle)] for A in (K, M))
    write(tmp_path, K, M)
    place = np.argsort(shuffle)
    rows = [[int(place[6 * i + j]) + 1 for j in range(6)] for i in range(4)]
    points = [{"point_mm": list(point), "rows": one} for point, one in zip(POINTS, rows, strict=True)]
    made = superelement(table(attachments=points), tmp_path)
    assert made.size == size
    same(body, made, rel=1e-7)


@pytest.mark.parametrize(("unit", "force", "length"), [("mm", 1.0, 1e-3), ("in", 4.4482216152605, 0.0254)])
def test_units_and_abaqus_matrix_input(unit, force, length, bodies, tmp_path) -> None:
    """The same energy in other units; lines of node, freedom, node, freedom, value, one triangle of them."""
    body = bodies["held"]
    to = np.concatenate([np.tile([length] * 3 + [1.0] * 3, 4), np.ones(body.size - B)])
    nodes = [(10 * (4 - i), k) for i in range(4) for k in range(1, 7)]  # in falling order, so that rows must be found
    nodes += [(1000 + i, 1) for i in range(body.size - B)]
    for name, A in (("K", body.stiffness), ("M", body.mass)):
        own = coo_array(np.tril(A * np.outer(to, to) / (force * length)))
        lines = [
            f"{nodes[i][0]},{nodes[i][1]}, {nodes[j][0]},{nodes[j][1]}, {value:.17g}"
            for i, j, value in zip(own.row, own.col, own.data, strict=True)
        ]
        (tmp_path / f"{name}.mtx").write_text("** a comment\n" + "\n".join(lines) + "\n")
    points = [{"point_mm": list(point), "node": 10 * (4 - i)} for i, point in enumerate(POINTS)]
    same(body, superelement(table(attachments=points, unit=unit), tmp_path))
    points[1]["node"] = 7
    with pytest.raises(
        InputError, match=r"attachments\[1\]\.node = 7: does not have its six degrees of freedom.* 10, 20, 30, 40"
    ):
        superelement(table(attachments=points, unit=unit), tmp_path)


@pytest.mark.parametrize(
    ("change", "keys", "told"),
    [
        ("unsymmetric", {}, r"stiffness = 'K\.mtx': is not symmetric: entry \(1, 2\)"),
        ("smaller", {}, r"mass = 'M\.mtx': has 53 coordinates, the stiffness 54"),
        ("nan", {}, "not finite"),
        ("", {"attachments": [{"point_mm": [0, 0, 0], "rows": [1, 2, 3, 4, 5, 99]}]}, r"rows .*must be rows 1 to 54"),
        (
            "",
            {"attachments": [{"point_mm": [0, 0, 0]}, {"point_mm": [9, 0, 0], "rows": [1, 2, 3, 4, 5, 6]}]},
            "row 1 belongs",
        ),
        (
            "",
            {"attachments": [{"point_mm": [x * 1e-3, y * 1e-3, z]} for x, y, z in POINTS]},
            "these cost some: rotation",
        ),
        ("rotations first", {}, "these cost some|differs by direction|motions"),
        ("negative mass", {}, "is not positive"),
        ("negative stiffness", {}, "is not positive"),
        ("exchanged", {}, r"mass = 'M\.mtx': .* are stiffness and mass exchanged"),
        ("massless", {}, r"mass = 'M\.mtx': is not positive: .* is all mass there"),
        ("lost rows", {}, r"has \d+ motions of the attachments without energy"),
        ("", {"stiffness": "none.mtx"}, "there is no such file"),
        ("", {"stiffness": "text.mtx"}, "neither Matrix Market nor matrices of Abaqus nor DMIG: line 1 is 'hello'"),
        ("", {"stiffness": "cut.mtx"}, "has 1 numbers, its size line asks for 9"),
        ("", {"attachments": [{"point_mm": [0, 0, 0], "node": 3}]}, "Matrix Market files name no nodes"),
    ],
)
def test_mistakes(change, keys, told, bodies, tmp_path) -> None:
    body = bodies["free"]
    K, M = body.stiffness.copy(), body.mass.copy()
    if change == "unsymmetric":
        K[0, 1] += 0.01 * K[0, 0]
    elif change == "smaller":
        M = M[:-1, :-1]
    elif change == "nan":
        M[0, 0] = np.nan
    elif change == "rotations first":
        swap = np.concatenate([np.add.outer(6 * np.arange(4), [3, 4, 5, 0, 1, 2]).ravel(), np.arange(B, len(K))])
        K, M = K[np.ix_(swap, swap)], M[np.ix_(swap, swap)]
    elif change == "negative mass":
        M = -M
    elif change == "negative stiffness":
        K[:B, :B] *= -1
    elif change == "lost rows":
        K[:7], K[:, :7] = 0.0, 0.0
    elif change == "exchanged":
        K, M = M, K
    elif change == "massless":
        M[:] = 0.0
    write(tmp_path, K, M)
    (tmp_path / "text.mtx").write_text("hello\n")
    (tmp_path / "cut.mtx").write_text("%%MatrixMarket matrix array real general\n3 3\n1\n")
    with pytest.raises(InputError, match=told):
        superelement(table(**keys), tmp_path)


@pytest.mark.parametrize(("unit", "length"), [("mm", 1.0), ("m", 1e-3)])
def test_a_held_body_in_a_wrong_unit(unit, length, bodies, tmp_path) -> None:
    """Matrices in m read as mm have rotations without energy; in mm read as m a length a thousand times too large."""
    body = bodies["held"]
    to = np.concatenate([np.tile([length] * 3 + [1.0] * 3, 4), np.ones(body.size - B)])
    write(tmp_path, *(A * np.outer(to, to) / length for A in (body.stiffness, body.mass)))
    told = "unit = 'm': rotational by translational stiffness .* is that of a length of .* mm, their points .* 88.* mm"
    with pytest.raises(InputError, match=told if unit == "m" else "motions .* without energy: .* check the unit"):
        superelement(table(unit=unit), tmp_path)


def test_exchanged_matrices_of_a_held_body(bodies, tmp_path) -> None:
    """Both are positive; their frequencies are 1 / (4 pi^2 f)."""
    write(tmp_path, bodies["held"].mass, bodies["held"].stiffness)
    with pytest.raises(InputError, match=r"no natural frequency above .*e-\d+ Hz .* are stiffness and mass exchanged"):
        superelement(table(), tmp_path)


def test_a_free_body_by_the_command(bodies, tmp_path) -> None:
    """Six modes of no frequency have no error to tell: no column holds what is infinite."""
    write(tmp_path, bodies["free"].stiffness, bodies["free"].mass)
    points = "".join(f"[[housing.superelement.attachments]]\npoint_mm = {list(point)}\n" for point in POINTS)
    (tmp_path / "free.toml").write_text('[housing.superelement]\nstiffness = "K.mtx"\nmass = "M.mtx"\n' + points)
    assert main(["housing", str(tmp_path / "free.toml"), "--out", str(tmp_path / "out")]) == 0


def test_commands(bodies, tmp_path, capsys) -> None:
    """The matrices that gearfe housing leaves are a housing again, of gearfe housing and of a train."""
    (tmp_path / "box.msh").write_bytes((MESHES / "box.msh").read_bytes())
    text = (MESHES / "box.toml").read_text()
    text = text.replace("[housing.reduction]", "[housing.reduction]\nmodes = 6")
    text = text.replace('driven = "wheel"', 'driven = "wheel"\nstiffness_N_per_m = 1e8')
    points = "".join(f"[[housing.superelement.attachments]]\npoint_mm = {list(point)}\n" for point in POINTS)
    files = 'stiffness = "first/housing_stiffness.mtx"\nmass = "first/housing_mass.mtx"\n'
    (tmp_path / "first.toml").write_text(text)
    (tmp_path / "second.toml").write_text("[housing.superelement]\n" + files + points + text[text.index("[pair]") :])
    found = {}
    for name in ("first", "second"):
        job = tmp_path / f"{name}.toml"
        quick = ["--no-pictures"] if name == "first" else []
        assert main(["housing", str(job), "--out", str(tmp_path / name), "--modes", "5", *quick]) == 0
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        train = read_train_job(job)
        model = build_train(job_train(train, train_curves(train), train_body(train)))
        found[name] = summary["frequencies_free_attachments_Hz"] + model.coupled_frequencies_hz.tolist()
        assert bore_places(train.housing, tmp_path)["3"] == pytest.approx((0.0625, 0.031, 0))
    assert found["second"] == pytest.approx(found["first"], rel=1e-9)
    told = capsys.readouterr().out
    assert "unknown: matrices of a held body do not contain it" in told
    assert "the error of their mesh and reduction is unknown" in told
    assert {p.name for p in (tmp_path / "second").iterdir()} == {
        "housing.npz", "housing_mass.mtx", "housing_stiffness.mtx", "modes.csv", "summary.json"
    }  # fmt: skip
    again = read_matrix(tmp_path / "second" / "housing_mass.mtx", "mass").values
    loaded = ModalBody.load(tmp_path / "second" / "housing.npz")
    assert (again == loaded.mass).all()
    own = build(HousingTable, {"body": "second/housing.npz", "damping": {"ratio": 0.01}}, "housing")
    assert reduced_housing(own, tmp_path).damping.any()


def card(text: str, large: bool) -> str:
    """A Nastran field."""
    return f"{text:<16}" if large else f"{text:<8}"


def dmig(name: str, values: np.ndarray, labels: list[tuple[int, int]], *, large: bool) -> str:
    """A matrix as Nastran punches it: the lower half of a symmetric one, 9 digits (small: 7 characters of a number)."""
    lines = [f"DMIG    {name:<8}0       6       2       0"]
    star = "*" if large else " "
    for j, (node, freedom) in enumerate(labels):
        cells = [(labels[i], values[i, j]) for i in range(j, len(labels)) if values[i, j]]
        head = "".join(card(x, large) for x in (name, str(node), str(freedom), ""))
        told = [(g, c, f"{x:.9E}".replace("E", "D") if large else short(x)) for (g, c), x in cells]
        rows = ["".join(card(str(x), large) for x in (*row, "")) for row in told]
        if large:
            lines += ["DMIG*   " + head, *(f"{star:<8}{row}" for row in rows)]
        else:
            lines += ["DMIG    " + head + rows[0]]
            lines += [" " * 8 + "".join(rows[i : i + 2]) for i in range(1, len(rows), 2)]
    return "\n".join(lines) + "\n"


def short(value: float) -> str:
    """A number of powers of two in eight characters, as 2.5+10."""
    digits, power = f"{value:.3e}".split("e")
    return f"{digits}{int(power):+d}"


def test_nastran_punch_file_with_both_matrices(bodies, tmp_path) -> None:
    """Grid points with six freedoms, scalar points for the modes, stiffness and mass in one file."""
    body = bodies["held"]
    size = len(body.mass)
    labels = [(101 + i // 6, 1 + i % 6) if i < B else (501 + i, 0) for i in range(size)]
    text = "$ superelement\n" + dmig("KAAX", body.stiffness, labels, large=True)
    (tmp_path / "box.pch").write_text(text + dmig("MAAX", body.mass, labels, large=True))
    points = [{"point_mm": list(point), "node": 101 + i} for i, point in enumerate(POINTS)]
    made = superelement(table(stiffness="box.pch", mass="box.pch", attachments=points), tmp_path)
    same(body, made, rel=1e-8)  # ten digits stand in the file


def test_small_fields_commas_and_freedoms_without_mass(tmp_path) -> None:
    labels = [(1, 1), (1, 2), (7, 0)]
    K = np.array([[2.5e10, -4.0, 0.0], [-4.0, 8.0, 0.125], [0.0, 0.125, 1.0]])
    (tmp_path / "K.bdf").write_text(dmig("K2GG", K, labels, large=False) + "ENDDATA\n")
    found = read_matrix(tmp_path / "K.bdf", "x")
    assert found.labels == labels
    assert (found.values == K).all()
    (tmp_path / "c.bdf").write_text("DMIG,A,0,6,1,0\nDMIG,A,1,1,,1,1,1.5,,\n,1,2,-2.5+1,\n")
    assert read_matrix(tmp_path / "c.bdf", "x").values.tolist() == [[1.5, -25.0], [-25.0, 0.0]]


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("DMIG,K,0,6,3,0\nDMIG,K,1,1,,1,1,1.5,1.0\n", "complex"),
        ("DMIG,A,0,6,2,0\nDMIG,A,1,1,,1,1,1.\nDMIG,B,0,6,2,0\nDMIG,B,1,1,,1,1,1.\n", "there are A, B"),
        ("DMIG,K,0,6,2,0\nDMIG,K,1,1,,1,1,many\n", "line 2"),
    ],
)
def test_dmig_that_cannot_be_taken(text, part, tmp_path) -> None:
    (tmp_path / "K.pch").write_text(text)
    with pytest.raises(InputError, match=part):
        read_matrix(tmp_path / "K.pch", "housing.superelement.stiffness")


def test_nastran_files_with_both_matrices(bodies, tmp_path) -> None:
    """OUTPUT4 and OUTPUT2, whose rows have no names, and DMIG entries in OUTPUT2, where they have."""
    body = bodies["held"]
    both = {"MAAX": body.mass, "KAAX": body.stiffness}
    (tmp_path / "text.op4").write_text(output4_text(both, "packed"))
    (tmp_path / "binary.op4").write_bytes(output4_binary(both, "full"))
    columns, pool = Output2(), Output2()
    for name, values in both.items():
        columns.matrix(name, values)
    (tmp_path / "columns.op2").write_bytes(columns.bytes())
    for name in ("text.op4", "binary.op4", "columns.op2"):
        same(body, superelement(table(stiffness=name, mass=name), tmp_path))
    pool.pool(both, [(101 + i // 6, 1 + i % 6) if i < B else (501 + i, 0) for i in range(len(body.mass))])
    (tmp_path / "pool.op2").write_bytes(pool.bytes())
    points = [{"point_mm": list(point), "node": 101 + i} for i, point in enumerate(POINTS)]
    same(body, superelement(table(stiffness="pool.op2", mass="pool.op2", attachments=points), tmp_path))


def test_exudyn_reads_the_matrices(bodies, tmp_path) -> None:
    pytest.importorskip("exudyn", reason="pip install 'gearfe[peers]'")
    path = EXAMPLES / "housing_in_exudyn.py"
    script = runpy.run_path(str(path))
    body = bodies["held"]
    for name, matrix in (("stiffness", body.stiffness), ("mass", body.mass)):
        write_market(tmp_path / f"housing_{name}.mtx", matrix)
    assert script["frequencies"](tmp_path) == pytest.approx(body.coupled.frequencies_hz, rel=1e-9)
