"""Stress campaigns: their short forms show no defect; the cases that once failed; the runner itself."""

from __future__ import annotations

import csv
import json
import os
import re
import time
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from scripts.benchmarks.script import answered
from tests.places import KEPT

from . import command
from .campaign import CAMPAIGNS, Campaign, Case, campaign_named
from .mutations import base_jobs, mutated
from .outcome import Check, Finding, Outcome, judged
from .report import by_kind
from .runner import _answer, run_campaign
from .toml_text import toml_text
from .worker import _timed, work

CASES = sorted(KEPT.glob("*.toml"))


@pytest.mark.parametrize("name", list(CAMPAIGNS))
def test_short_form_finds_no_defect(name: str, tmp_path: Path) -> None:
    ran = run_campaign(name, tmp_path, seed=1, short=True, apart=False)
    assert ran.complete
    assert [(row.case, row.reason) for row in ran.bad] == []
    assert any(row.outcome == "done" for row in ran.outcomes)
    with (tmp_path / f"{name}_cases.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(ran.outcomes)
    kept = sorted((tmp_path / "kept" / name).iterdir())
    assert kept
    assert all((folder / "job.toml").exists() and (folder / "outcome.json").exists() for folder in kept)


@pytest.mark.parametrize("path", CASES, ids=[path.stem for path in CASES])
def test_cases_that_once_failed(path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each file says its command and exit code; nothing but a line with the reason may come."""
    text = path.read_text(encoding="utf-8")
    command, *options = re.search(r"# command: (.*)", text)[1].split()  # type: ignore[index]
    code = int(re.search(r"# exit code: (\d)", text)[1])  # type: ignore[index]
    assert main([command, str(path), "--out", str(tmp_path / "out"), *options]) == code
    told = capsys.readouterr()
    if code == 2:
        assert told.err.startswith("gearfe: error: ")
        assert len(told.err) > 40


def test_both_contradicting_values_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = next(path for path in CASES if path.stem == "contradicting_values")
    assert main(["mechanism", str(path), "--out", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "angle(crank)" in told
    assert "y(crank.A)" in told


def test_a_campaign_is_taken_up_where_it_ended(tmp_path: Path) -> None:
    one = run_campaign("gears", tmp_path, seed=3, cases=2, apart=False)
    record = tmp_path / "gears.jsonl"
    cut = record.read_text(encoding="utf-8") + '{"case": 2, "kind": "dra'  # killed while it wrote
    record.write_text(cut, encoding="utf-8")
    two = run_campaign("gears", tmp_path, seed=3, cases=3, apart=False)
    assert two.outcomes[:2] == one.outcomes
    assert len(record.read_text(encoding="utf-8").splitlines()) == 1 + 3
    assert run_campaign("gears", tmp_path, seed=3, cases=3, seconds=0.0, apart=False).complete
    assert not run_campaign("gears", tmp_path, seed=3, cases=4, seconds=0.0, apart=False).complete
    with pytest.raises(InputError, match="seed 3, not 4"):
        run_campaign("gears", tmp_path, seed=4, cases=1, apart=False)


def test_a_case_is_the_same_whenever_it_is_drawn() -> None:
    for name in CAMPAIGNS:
        campaign = campaign_named(name)
        assert campaign.case(7, 5) == campaign.case(7, 5)
    assert campaign_named("gears").case(7, 5).files != campaign_named("gears").case(8, 5).files


def _campaign(run) -> Campaign:  # type: ignore[no-untyped-def]
    return Campaign("made", 1, (0,), 0.2, lambda _random, number: Case(number, "k", {}, ""), run)


def test_hangs_and_exceptions_are_told_apart() -> None:
    import signal

    from .worker import OverTime

    def late(signum, frame):  # type: ignore[no-untyped-def]
        raise OverTime

    def endless(_case, _folder):  # type: ignore[no-untyped-def]
        while True:
            time.sleep(0.01)

    def refuses(_case, _folder):  # type: ignore[no-untyped-def]
        raise InputError("key", 1, "must be 2")

    def busy(_case, _folder):  # type: ignore[no-untyped-def]
        while True:
            pass

    def slow(_case, _folder):  # type: ignore[no-untyped-def]
        time.sleep(0.4)
        raise InputError("key", 1, "must be 2")

    before = [signal.signal(number, late) for number in (signal.SIGALRM, signal.SIGPROF)]
    try:
        assert _timed(_campaign(endless), 1, 0).outcome == "hang"
        begin = time.process_time()
        assert _timed(_campaign(busy), 1, 0).outcome == "hang"
        assert time.process_time() - begin < 0.5  # its limit of 0.2 s is one of processor time
        assert _timed(_campaign(slow), 1, 0).outcome == "refused"  # waiting costs none
        assert _timed(_campaign(lambda *_: 1 / 0), 1, 0).outcome == "traceback"
        refused = _timed(_campaign(refuses), 1, 0)
    finally:
        for number, handler in zip((signal.SIGALRM, signal.SIGPROF), before, strict=True):
            signal.signal(number, handler)
    assert (refused.outcome, refused.reason) == ("refused", "key = 1: must be 2")


def test_a_process_that_dies_costs_its_case_only() -> None:
    class Gone:
        exitcode = -11

        def poll(self, _seconds: float) -> bool:
            raise EOFError

        def join(self, _seconds: float) -> None:
            pass

    row = _answer(_campaign(None), 1, 0, Gone(), Gone(), time.monotonic(), 0.0)
    assert (row.outcome, row.bad) == ("crash", True)
    assert "-11" in row.reason


def test_the_worker_answers_until_it_is_told_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    class Pipe:
        def __init__(self) -> None:
            self.asked, self.rows = [0, None], []

        def recv(self):  # type: ignore[no-untyped-def]
            return self.asked.pop(0)

        def send(self, row: Outcome) -> None:
            self.rows.append(row)

    import signal

    for name in ("GEARFE_CACHE", "MPLBACKEND"):  # a worker sets them for the rest of its process
        monkeypatch.setenv(name, os.environ.get(name, ""))
    before = [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGALRM)]
    monkeypatch.setattr("tests.campaigns.worker.campaign_named", lambda _: _campaign(lambda *_: Finding("done")))
    pipe = Pipe()
    try:
        work(pipe, "made", 1)
    finally:
        for s, handler in zip((signal.SIGINT, signal.SIGALRM), before, strict=True):
            signal.signal(s, handler)
    assert [row.outcome for row in pipe.rows] == ["done"]


def test_a_failing_check_makes_a_case_wrong() -> None:
    row = judged(0, "k", 0.1, Finding("done", "", [Check("a", 1.0, 2.0), Check("b", 3.0, 2.0)]))
    assert (row.outcome, row.worst.name) == ("wrong", "b")  # type: ignore[union-attr]
    assert judged(0, "k", 0.1, Finding("done", "", [Check("a", float("nan"), 2.0)])).outcome == "wrong"
    assert judged(0, "k", 0.1, Finding("stopped", "", [Check("a", 1.0, 2.0)])).outcome == "stopped"
    again = Outcome.from_plain(json.loads(json.dumps(row.plain())))
    assert again == row
    table = by_kind([row])
    assert table["kind"] == ["k", "all"]
    assert table["wrong"] == [1, 1]


def test_job_texts_of_drawn_cases_are_toml() -> None:
    import tomllib

    tables = {
        "a": {"x": 1e-300, "y": True, "z": 'q"\n', "none": None, "n": [1, 2.5], "t": [{"k": 1}, {"k": 2}]},
        "b": 3,
    }
    expected = {"a": {"x": 1e-300, "y": True, "z": 'q"\n', "n": [1, 2.5], "t": [{"k": 1}, {"k": 2}]}, "b": 3}
    assert tomllib.loads(toml_text(tables)) == expected


def test_mutations_change_files_and_base_jobs_run(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    for name in ("mechanism", "stiffness", "vibration"):
        job = base_jobs()[name]
        changed = [mutated(random, job.text, 1) != job.text for _ in range(40)]
        assert np.mean(changed) > 0.8
        path = tmp_path / f"{name}.toml"
        path.write_text(job.text, encoding="utf-8")
        assert main([job.arguments[0], str(path), "--out", str(tmp_path / name), *job.arguments[1:]]) == 0


def stress(*arguments: str) -> int:
    """Exit code of ``python scripts/benchmarks/stress.py``."""
    return answered(command, "scripts/benchmarks/stress.py", list(arguments))


@pytest.mark.parametrize(
    ("name", "script"), [("stress", "scripts/benchmarks/stress.py"), ("benchmark", "scripts/benchmarks/benchmark.py")]
)
def test_commands_that_left_the_program_say_where_they_went(
    name: str, script: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([name, "all"]) == 2
    told = capsys.readouterr().err
    assert script in told
    assert told.count("\n") == 1


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert stress("nothing", "--out", str(tmp_path)) == 2
    assert "known names" in capsys.readouterr().err
    assert stress("mechanisms", "--seed", "1", "--case", "3") == 0
    assert "mechanisms case 3 (loops): done" in capsys.readouterr().out
