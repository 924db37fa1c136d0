"""Modes of tests beside those of a housing: the criterion itself, files there and back, partners, damping."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from gearfe import ModalBody, housing_from_job
from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.drivetrain.housing.modal_points import point_columns, point_lines
from gearfe.drivetrain.housing.modal_test import COLUMNS, TestModes, compare, mac_table, read_modes
from tests.places import MESHES


@pytest.fixture(scope="module")
def body() -> ModalBody:
    return housing_from_job(MESHES / "box.toml").reduce(12, estimate=False)


def measured(body: ModalBody, chosen: list[int], scale: complex = 1.0) -> TestModes:
    """What a perfect test of the body would find at some of its nodes, in the order and sign of its own."""
    rng = np.random.default_rng(4)
    place = rng.choice(len(body.nodes), 40, replace=False)
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    fields = body.reconstruct(body.coupled.vectors[:, chosen].T)[:, place]
    shapes = scale * np.einsum("kdj,dj->kd", fields, directions)
    hz = 1.02 * body.coupled.frequencies_hz[chosen]
    return TestModes(hz, np.array([0.01, 0.02, 0.03]), body.nodes[place], directions, shapes)


def test_the_criterion_of_known_vectors() -> None:
    one = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1j, 0.0]])
    expected = [[1.0, 0.5, 0.5], [0.5, 1.0, 0.5], [0.5, 0.5, 1.0]]  # |a.b|^2/(|a|^2 |b|^2) by hand
    assert mac_table(one, one) == pytest.approx(np.array(expected))
    assert mac_table(-3j * one, one) == pytest.approx(np.array(expected))
    assert mac_table(np.array([[0.0, 0.0, 1.0]]), one).max() == 0.0


def test_partners_frequencies_and_damping(body) -> None:
    found = compare(body, measured(body, [4, 0, 2], scale=-2.0 + 1j), modes=8)
    columns = found.columns()
    assert columns["mode"].tolist() == [5, 1, 3]
    assert columns["mac"] == pytest.approx(1.0)
    assert columns["frequency_difference_percent"] == pytest.approx(100.0 / 1.02 - 100.0)
    assert found.distance == pytest.approx(0.0, abs=1e-12)
    assert found.damping_ratios() == [0.02, 0.02, 0.03, 0.03, 0.01]


def write_table(path: Path, test: TestModes) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow([*COLUMNS, "damping_ratio", "amplitude_imag"])
        for f, damping, shape in zip(test.frequencies, test.damping, test.shapes, strict=True):
            for point, direction, a in zip(test.points, test.directions, shape, strict=True):
                writer.writerow([f, *(1e3 * point), *direction, a.real, damping, a.imag])


def test_a_table_and_the_command(body, tmp_path, capsys) -> None:
    test = measured(body, [0, 1, 3], scale=1j)
    write_table(tmp_path / "test.csv", test)
    again = read_modes(tmp_path / "test.csv")
    assert again.frequencies == pytest.approx(test.frequencies)
    assert again.shapes == pytest.approx(test.shapes)
    body.save(tmp_path / "box.npz")
    (tmp_path / "job.toml").write_text('[housing]\nbody = "box.npz"\n')
    line = ["housing", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out"), "--modes", "6", "--compare"]
    assert main([*line, str(tmp_path / "test.csv")]) == 0
    out = capsys.readouterr().out
    assert out.count("MAC 1.000") == 3
    assert "[housing.damping] ratio = [0.01, 0.02, 0.02, 0.03]" in out
    assert {"mac.png", "mac.csv", "comparison.csv"} <= {path.name for path in (tmp_path / "out").iterdir()}
    # the body itself as another model: a criterion of one on the diagonal
    assert main([*line, str(tmp_path / "box.npz"), "--no-pictures"]) == 0
    assert capsys.readouterr().out.count("MAC 1.000") == 6
    assert not (tmp_path / "out" / "mac.png").exists()


@pytest.mark.parametrize("kind", ["normal", "complex"])
def test_a_universal_file(kind, body, tmp_path) -> None:
    """Nodes in mm with their unit, shapes in datasets 55, read by what modal testers use."""
    pyuff = pytest.importorskip("pyuff", reason="pip install 'gearfe[exchange]'")
    place = np.arange(0, len(body.nodes), 97)
    numbers = list(range(11, 11 + len(place)))
    x, y, z = 1e3 * body.nodes[place].T
    ones = [1] * len(place)
    units = {"units_code": 5, "units_description": "mm", "temp_mode": 1, "length": 1e3, "force": 1.0, "temp": 1.0}
    sets = [pyuff.prepare_164(**units, temp_offset=273.15)]
    sets.append(pyuff.prepare_15(node_nums=numbers, def_cs=ones, disp_cs=ones, color=ones, x=x, y=y, z=z))
    fields = body.reconstruct(body.coupled.vectors[:, :3].T)[:, place]
    for k, field in enumerate(fields):
        hz = body.coupled.frequencies_hz[k]
        common = {"model_type": 1, "data_ch": 2, "spec_data_type": 8, "load_case": 1, "mode_n": k + 1}
        common |= {"id1": "a", "id2": "b", "id3": "c", "id4": "d", "id5": "e", "node_nums": numbers}
        if kind == "normal":
            r = dict(zip(("r1", "r2", "r3"), field.T, strict=True))
            more = {"analysis_type": 2, "freq": hz, "modal_m": 1.0, "modal_damp_vis": 0.015, "modal_damp_his": 0.0}
        else:
            r = dict(zip(("r1", "r2", "r3"), (1.0 + 2j) * field.T, strict=True))
            eig = 2.0 * math.pi * hz * complex(-0.015, math.sqrt(1.0 - 0.015**2))
            more = {"analysis_type": 3, "eig": eig, "modal_a": 1.0 + 0j, "modal_b": 1.0 + 0j}
        sets.append(
            {"type": 55, **common, **r, **more, "n_data_per_node": 3, "data_type": 2 if kind == "normal" else 5}
        )
    for one in sets:
        pyuff.UFF(str(tmp_path / "test.uff")).write_sets(one, mode="add")
    test = read_modes(tmp_path / "test.uff")
    assert test.frequencies == pytest.approx(body.coupled.frequencies_hz[:3], rel=1e-5)
    assert test.damping == pytest.approx(0.015, rel=1e-4)
    found = compare(body, test, modes=6)
    assert found.columns()["mode"].tolist() == [1, 2, 3]
    assert found.columns()["mac"] == pytest.approx(1.0, abs=1e-6)
    assert found.distance < 1e-5 * np.ptp(body.nodes)


def test_points_that_are_exchanged_or_reversed_are_named(body) -> None:
    """A test with noise whose sixth and tenth points are exchanged, and whose third sensor is turned round."""
    rng = np.random.default_rng(8)
    chosen, modes = list(range(6)), body.coupled.vectors[:, :6].T
    lively = np.argsort(-np.linalg.norm(body.reconstruct(modes), axis=(0, 2)))[::40][:12]
    fields = body.reconstruct(modes)[:, lively]
    fields += 0.02 * np.abs(fields).max() * rng.normal(size=fields.shape)
    wrong = fields.copy()
    wrong[:, [5, 9]] = fields[:, [9, 5]]
    wrong[:, 2] *= -1.0
    points, directions = np.repeat(body.nodes[lively], 3, axis=0), np.tile(np.eye(3), (12, 1))
    hz, unknown = body.coupled.frequencies_hz[chosen], np.full(6, math.nan)
    right, mixed = (
        compare(body, TestModes(hz, unknown, points, directions, shapes.reshape(6, -1)), modes=6)
        for shapes in (fields, wrong)
    )
    assert point_lines(right) == []
    said = point_lines(mixed)
    assert len(said) == 2
    assert said[0].startswith("point 3 (")
    assert "moves against the model" in said[0]
    assert said[1].startswith("point 6 (")
    assert "and point 10 (" in said[1]
    agreement = point_columns(mixed)["agreement"].reshape(12, 3)[:, 0]
    assert agreement[2] < -0.8
    assert np.delete(agreement, [2, 5, 9]).min() > 0.8


def test_mistakes(body, tmp_path) -> None:
    test = measured(body, [0, 1, 2])
    far = TestModes(test.frequencies, test.damping, 1e3 * test.points, test.directions, test.shapes)
    with pytest.raises(InputError, match="from the nearest node; times a thousandth all points fit: correct the unit"):
        compare(body, far)
    (tmp_path / "a.csv").write_text("frequency_Hz,x_mm\n1,2\n")
    for name, part in {"a.csv": "lacks the columns y_mm", "a.xls": "must end in", "no.csv": "no such file"}.items():
        with pytest.raises(InputError, match=part):
            read_modes(tmp_path / name)
