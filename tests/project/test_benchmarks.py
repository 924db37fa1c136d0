"""The benchmark: rows that stay, measuring, the equations given to other programs, a smoke run of the studies."""

import math
import time
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.tables.pair import LAWS
from scripts.benchmarks.jobs import command
from scripts.benchmarks.jobs import record as record_module
from scripts.benchmarks.jobs.page import write_page
from scripts.benchmarks.jobs.pictures import exponent
from scripts.benchmarks.jobs.record import Table, open_record, read_rows
from scripts.benchmarks.jobs.tables import SECTIONS
from scripts.benchmarks.jobs.timing import measured
from scripts.benchmarks.script import answered

QUICK = ("--quick", "--no-peers")


def benchmark(*arguments: str) -> int:
    """Exit code of ``python scripts/benchmarks/benchmark.py``."""
    return answered(command, "scripts/benchmarks/benchmark.py", list(arguments))


def test_finished_rows_are_not_made_again(tmp_path):
    said = []
    made = []

    def work(value):
        made.append(value)
        return {"seconds": 0.1 * value, "text": "a, b"}

    for _ in range(2):
        record = open_record(tmp_path, say=said.append)
        table = record.table("numbers", "value")
        rows = [record.row(table, {"value": v}, lambda v=v: work(v)) for v in (1, 2)]
    assert made == [1, 2]
    assert (
        rows
        == read_rows(tmp_path / "numbers.csv")
        == [
            {"value": 1, "seconds": 0.1, "text": "a; b"},
            {"value": 2, "seconds": 0.2, "text": "a; b"},
        ]
    )


def test_a_row_that_fails_is_told_and_the_next_ones_go_on(tmp_path):
    said = []
    record = open_record(tmp_path, say=said.append)
    table = record.table("numbers", "value")
    assert record.row(table, {"value": 0}, lambda: {"inverse": 1 / 0}) is None
    assert record.row(table, {"value": 2}, lambda: {"inverse": 0.5})["inverse"] == 0.5
    assert len(record.failures) == 1
    assert "ZeroDivisionError" in said[0]
    assert [r["value"] for r in Table(tmp_path / "numbers.csv", ("value",)).rows] == [2]


def test_interrupted_while_writing_the_old_table_stays(tmp_path, monkeypatch):
    record = open_record(tmp_path, say=lambda _: None)
    table = record.table("numbers", "value")
    record.row(table, {"value": 1}, lambda: {"x": 1.0})
    before = (tmp_path / "numbers.csv").read_text()

    def interrupted(value):
        raise KeyboardInterrupt

    monkeypatch.setattr("gearfe.base.files._cell", interrupted)
    with pytest.raises(KeyboardInterrupt):
        record.row(table, {"value": 2}, lambda: {"x": 2.0})
    assert (tmp_path / "numbers.csv").read_text() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["numbers.csv", "run.json"]


def test_rows_of_another_program_are_begun_anew(tmp_path, monkeypatch):
    record = open_record(tmp_path, say=lambda _: None)
    record.row(record.table("numbers", "value"), {"value": 1}, lambda: {"x": 1.0})
    (tmp_path / "pairs_outcomes.csv").write_text("outcome,count\nconverged,3\n")
    monkeypatch.setattr(record_module, "sources_hash", lambda: "others")
    said = []
    again = open_record(tmp_path, say=said.append)
    assert "other sources" in said[0]
    assert again.table("numbers", "value").rows == []
    assert (tmp_path / "pairs_outcomes.csv").exists()


def test_measured_tells_work_from_waiting():
    _, waiting = measured(lambda: time.sleep(0.03), runs=2)
    assert waiting.wall_s >= 0.03
    assert waiting.cpu_s < 0.5 * waiting.wall_s
    result, cost = measured(lambda: sum(range(200_000)), runs=3)
    assert result == 200_000 * 199_999 // 2
    assert cost.runs == 3
    assert 0 < cost.cpu_s <= cost.cpu_median_s
    _, large = measured(lambda: np.ones(20_000_000).sum(), runs=1)
    assert large.peak_MB - cost.peak_MB > 100 or math.isnan(large.peak_MB)  # 160 MB were touched
    if Path("/proc/self/clear_refs").exists():  # elsewhere the peak is that of the whole process
        assert measured(lambda: np.zeros(10), runs=1)[1].peak_MB < large.peak_MB - 100


def test_exponent_of_a_power_law():
    assert exponent([{"n": n, "t": 3e-6 * n**1.37} for n in (10, 20, 80, 300)], "n", "t") == pytest.approx(1.37)


def test_equations_for_other_programs_are_those_of_the_mechanisms():
    """Angular accelerations from seven angles and six closures against the general core with 21 coordinates."""
    from gearfe.multibody import integrate
    from scripts.benchmarks.jobs.mechanism_study import folding_angle, subject
    from scripts.benchmarks.jobs.peers.mechanism_equations import equations

    start, andrews_rhs, andrews_residual, _ = equations("andrews", jit=False)
    _, slider_rhs, slider_residual, _ = equations("slider_crank", jit=False)
    case = subject("andrews")
    np.testing.assert_allclose(start[:7], case.start.q[2::3], atol=1e-15)
    made = integrate(case.system, [0.0, 0.004, 0.011], tolerance=1e-9, start=case.start)
    for q, v, a in zip(made.q, made.v, made.a, strict=True):
        state, slope = np.concatenate([q[2::3], v[2::3]]), np.empty(14)
        andrews_rhs(0.0, state, slope)
        size = np.abs(a[2::3]).max()
        np.testing.assert_allclose(slope[7:], a[2::3], atol=1e-8 * size)
        # index 2: with the multipliers of a least-squares balance nothing is left over
        y, dy = np.concatenate([state, np.zeros(12)]), np.concatenate([slope, np.zeros(12)])
        columns, out = [], np.empty(26)
        andrews_residual(0.0, y, dy, out)
        base = out.copy()
        for r in range(6):
            one = y.copy()
            one[14 + r] = 1.0
            andrews_residual(0.0, one, dy, out)
            columns.append((out - base)[7:14])
        y[14:20] = np.linalg.lstsq(np.array(columns).T, -base[7:14], rcond=None)[0]
        andrews_residual(0.0, y, dy, out)
        assert np.abs(out[7:14]).max() < 1e-9 * np.abs(base[7:14]).max()
        assert np.abs(out[14:20]).max() < 1e-12
        assert np.abs(out[20:]).max() < 1e-9
    # slider crank: the exact equation of the branch
    theta, omega, h = 0.7, 2.0, 1e-4
    slope, out = np.empty(4), np.empty(6)
    state = np.array([theta, -theta, omega, -omega])
    slider_rhs(0.0, state, slope)
    ahead, here, back = (folding_angle(theta, omega, np.array([0.0, d]))[-1] if d else theta for d in (h, 0.0, -h))
    assert slope[2] == pytest.approx((ahead - 2 * here + back) / h**2, rel=1e-6)
    assert slope[3] == pytest.approx(-slope[2])
    slider_residual(0.0, np.concatenate([state, np.zeros(2)]), np.concatenate([slope, np.zeros(2)]), out)
    pull = (out[2] / math.cos(theta), out[3] / math.cos(theta))
    assert pull[0] == pytest.approx(pull[1])  # what is left lies along the closure's gradient
    np.testing.assert_allclose(out[[0, 1, 4, 5]], 0.0, atol=1e-12)


def test_compiled_equations_of_the_train_for_other_programs_are_the_plain_ones():
    import dataclasses

    from gearfe.drivetrain.train import build_train
    from scripts.benchmarks.jobs.peers.train_transient import compiled_rhs, plain_rhs
    from tests.makers.trains import loaded, smooth

    model = build_train(loaded([(20, 30), (20, 30)], smooth, backlash=30e-6, flexible=False))
    modal = dataclasses.replace(model.modal, damping=np.diag(np.diagonal(model.modal.damping)))
    y = 1e-5 * np.random.default_rng(3).normal(size=2 * len(modal.eigenvalues))
    plain, compiled = np.empty_like(y), np.empty_like(y)
    plain_rhs(modal)(1e-3, y, plain)
    compiled_rhs(modal, model.forces)(1e-3, y, compiled)
    assert compiled == pytest.approx(plain, rel=1e-12, abs=1e-12 * np.abs(plain).max())


def test_meshes_for_other_programs_have_fine_teeth_where_they_touch():
    from scripts.benchmarks.jobs.peers.contact_mesh import contact_task
    from scripts.benchmarks.jobs.subject import reference_pair

    pair = reference_pair()
    angle = math.radians(4.0)
    task = contact_task(pair, angle, 1e-3, 5.0)
    for part, centre, gear in ((task.pinion, 0.0, pair.pinion), (task.wheel, task.centre, pair.wheel)):
        assert len(np.unique(part.triangles)) == len(part.points)  # joined, nothing loose
        radius = np.hypot(part.points[:, 0] - centre, part.points[:, 1])
        np.testing.assert_allclose(radius[np.unique(part.boundaries["bore"])], 0.5 * gear.bore_diameter, rtol=1e-9)
        assert radius.max() == pytest.approx(gear.tip_radius, rel=1e-6)
        sides = np.sort(part.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        _, owners = np.unique(sides, axis=0, return_counts=True)
        assert owners.max() == 2
        flank = part.points[np.unique(part.boundaries["contact"])]
        # the fine teeth stand about the pitch point
        assert np.abs(flank[:, 0] - pair.pinion.base_radius).max() < 6 * gear.module


@pytest.mark.parametrize("job", ["sweep", "mechanism", "housing", "transient", "runup"])
def test_smoke_of_every_job(tmp_path, job, capsys):
    """Small settings, no peers: every row is made, every table and picture written; the second run makes nothing."""
    assert benchmark(job, "--out", str(tmp_path), *QUICK) == 0
    first = capsys.readouterr().out
    assert "FAILED" not in first
    left_out = {"sweep_peers", "sweep_verification", "housing_peers", "transient_modes"}
    tables = {s.table for s in SECTIONS if s.command == job} - left_out
    assert tables <= {p.stem for p in tmp_path.glob("*.csv")}
    assert list(tmp_path.glob("*.png"))
    if job == "sweep":
        rows = read_rows(tmp_path / "sweep_sizes.csv")
        assert {r["law"] for r in rows} == set(LAWS)
        assert all(0.0 < r["error"] < 3e-3 for r in rows)
    before = {p.name: p.stat().st_mtime_ns for p in tmp_path.glob("*.csv")}
    assert benchmark(job, "--out", str(tmp_path), *QUICK) == 0
    assert {p.name: p.stat().st_mtime_ns for p in tmp_path.glob("*.csv")} == before
    (tmp_path / "pairs_outcomes.csv").write_text("outcome,count\nconverged,3\n")
    files = write_page(tmp_path, tmp_path / "accuracy.md")
    page = files[0].read_text()
    assert "smoke run" in page
    assert "Campaign: pairs" in page
    for section in SECTIONS:
        assert (f"## {section.title}\n" in page) == (tmp_path / f"{section.table}.csv").exists()
    assert all(f"accuracy/{f.name}" in page and f.exists() for f in files[1:])
    assert f"python scripts/benchmarks/benchmark.py {job} --out" in page


def test_unknown_job_and_missing_results(tmp_path, capsys):
    assert benchmark("sweeep", "--out", str(tmp_path)) == 2
    assert "sweep" in capsys.readouterr().err
    assert benchmark("--out", str(tmp_path), "--page", str(tmp_path / "p.md")) == 2
    assert "run scripts/benchmarks/benchmark.py first" in capsys.readouterr().err


def test_a_missing_peer_is_named_with_its_cure(monkeypatch):
    from scripts.benchmarks.jobs.peers import process

    monkeypatch.setattr(process.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(process.shutil, "which", lambda name: None)
    monkeypatch.setattr(process, "SYSTEM_PYTHON", "/nowhere/python3")
    peers = {
        "exudyn": "gearfe[peers]",
        "sundials": "gearfe[peers]",
        "calculix": "calculix-ccx",
        "getfem": "python3-getfem",
    }
    for peer, cure in peers.items():
        assert cure in process.missing(peer)


def test_a_peer_that_hangs_is_given_up(tmp_path):
    import sys

    from scripts.benchmarks.jobs.peers.process import PeerError, run_process

    with pytest.raises(PeerError, match="gave up"):
        run_process([sys.executable, "-c", "import time; time.sleep(60)"], tmp_path, limit=0.3)
    with pytest.raises(PeerError, match="code 3"):
        run_process([sys.executable, "-c", "raise SystemExit(3)"], tmp_path)
    spent = run_process([sys.executable, "-c", "x = sum(range(3_000_000)); print(x)"], tmp_path)
    assert spent.cpu_s > 0
    assert spent.text.strip() == str(3_000_000 * 2_999_999 // 2)


@pytest.mark.slow
def test_smoke_with_every_peer_that_is_here(tmp_path):
    assert benchmark("all", "--out", str(tmp_path), "--quick") == 0
