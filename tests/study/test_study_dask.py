"""Studies on a Dask cluster, where it is installed: the same rows, and a scheduler that goes away is told."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import types

import pytest

from gearfe.cli.main import main
from gearfe.study.job import read_study, run_study
from tests.makers.studies import rows_of, written
from tests.places import DOCS

pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler and a worker with two processes, for all tests: the scheduler's process and its address."""
    folder = tmp_path_factory.mktemp("cluster")
    place = folder / "scheduler.json"
    common = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    dask = [sys.executable, "-m", "dask"]
    address = ["--scheduler-file", str(place), "--no-dashboard"]
    scheduler = subprocess.Popen([*dask, "scheduler", *address, "--host", "127.0.0.1", "--port", "0"], **common)
    workers = subprocess.Popen([*dask, "worker", *address, "--nthreads", "1", "--nworkers", "2"], **common)
    from dask.distributed import Client

    limit = time.monotonic() + 300.0
    while not place.exists() and time.monotonic() < limit:
        time.sleep(0.1)
    at = json.loads(place.read_text())["address"]
    with Client(at, timeout=30) as client:
        client.wait_for_workers(2, timeout=60)
    yield scheduler, at
    for process in (workers, scheduler):
        process.terminate()
        process.wait(timeout=20)


def test_rows_on_dask_are_those_of_one_process(cluster, tmp_path):
    path = written(tmp_path, cases=40)
    (tmp_path / "one").mkdir()
    run_study(read_study(path), tmp_path / "one", jobs=1)
    command = ["study", str(path), "--out", str(tmp_path / "dask"), "--dask", cluster[1], "--no-pictures"]
    assert main(command) == 0
    assert rows_of(tmp_path / "dask") == rows_of(tmp_path / "one")


class Cluster(str):
    """A cluster that is there already, by its address, in place of one that Slurm or Kubernetes starts."""

    def scale(self, jobs: int) -> None:
        assert jobs > 0


def test_the_page_on_clusters_runs(cluster, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, cases=8)
    for name, kind in (("dask_jobqueue", "SLURMCluster"), ("dask_kubernetes.operator", "KubeCluster")):
        module = types.ModuleType(name)
        setattr(module, kind, lambda **_: Cluster(cluster[1]))
        monkeypatch.setitem(sys.modules, name.partition(".")[0], module)
        monkeypatch.setitem(sys.modules, name, module)
    page = (DOCS / "clusters.md").read_text(encoding="utf-8")
    codes = re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert len(codes) == 2
    for code in codes:
        exec(compile(code, "clusters.md", "exec"), {})
        assert sum("done" in row for row in rows_of(tmp_path / "out" / "study")) == 8
        shutil.rmtree(tmp_path / "out")


@pytest.mark.slow
def test_a_dask_worker_that_is_killed_loses_nothing(cluster, tmp_path):
    """Its nanny starts another one; every case is a row, once, with the value of its parameters."""
    from dask.distributed import Client

    path = written(tmp_path, cases=3000)
    command = [sys.executable, "-m", "gearfe", "study", str(path), "--out", str(tmp_path / "out"), "--no-pictures"]
    run = subprocess.Popen([*command, "--dask", cluster[1]], stdout=subprocess.DEVNULL)
    table = tmp_path / "out" / "study.csv"
    limit = time.monotonic() + 300.0
    while not (table.exists() and table.stat().st_size > 2000) and time.monotonic() < limit:
        time.sleep(0.02)
    with Client(cluster[1], timeout=30) as client:
        victim = next(iter(client.run(os.getpid).values()))
    os.kill(victim, signal.SIGKILL)
    assert run.wait(timeout=180.0) == 0
    rows = rows_of(tmp_path / "out")[1:]
    assert [row[0] for row in rows] == [str(n) for n in range(3000)]
    assert {row[5] for row in rows} == {"done"}
    for row in rows:
        x1, x2, x3, y = map(float, row[1:5])
        known = math.sin(x1) + 7 * math.sin(x2) ** 2 + 0.1 * x3**4 * math.sin(x1)
        assert y == pytest.approx(known, rel=1e-12, abs=1e-12)


def test_a_scheduler_that_goes_away_is_told_and_rows_are_kept(cluster, tmp_path):
    """The last one that needs the cluster: it ends the scheduler."""
    scheduler, at = cluster
    path = written(tmp_path, cases=100_000)
    command = [sys.executable, "-m", "gearfe", "study", str(path), "--out", str(tmp_path / "out"), "--dask", at]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    table = tmp_path / "out" / "study.csv"
    limit = time.monotonic() + 300.0
    while not (table.exists() and table.stat().st_size > 2000) and time.monotonic() < limit:
        time.sleep(0.02)
    scheduler.kill()
    told = run.communicate(timeout=300.0)[1]
    assert run.returncode == 2
    assert "does not answer any more" in told
    assert "Traceback" not in told
    assert 10 < len(rows_of(tmp_path / "out")) < 100_000


def test_dask_that_is_missing_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    assert main(["study", str(written(tmp_path)), "--out", str(tmp_path / "out"), "--dask", "tcp://127.0.0.1:1"]) != 0
    assert "gearfe[cluster]" in capsys.readouterr().err


def test_a_scheduler_that_is_not_there_is_told(tmp_path, monkeypatch, capsys):
    from gearfe.cli import study as command

    monkeypatch.setattr(command, "TIMEOUT_S", 1)
    run = ["study", str(written(tmp_path)), "--out", str(tmp_path / "out"), "--dask"]
    assert main([*run, "tcp://127.0.0.1:9"]) == 2
    assert "does not answer" in capsys.readouterr().err
    assert main([*run, "nonsense"]) == 2
    assert "--dask = 'nonsense'" in capsys.readouterr().err
