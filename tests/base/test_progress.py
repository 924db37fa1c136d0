"""What a long run tells about itself: nothing at first, then its stages; a library call tells nothing at all."""

from __future__ import annotations

import io
import math
import threading
import time

import pytest

from gearfe.base import progress
from gearfe.base.progress import Display, Stopwatch, _Stage, count, shown, stage
from gearfe.base.tables.examples import job_file
from gearfe.cli.main import main
from gearfe.multibody import integrate
from gearfe.multibody.compiled.kernels import COMPILING, Kernels
from gearfe.multibody.integrators.collocation.run import KERNELS as COLLOCATION
from gearfe.multibody.integrators.taylor.run import KERNELS as TAYLOR
from tests.makers.rigid_cases import pendulum


def waited(stream: io.StringIO, text: str) -> str:
    """What the stream holds as soon as it holds `text`, or after some seconds."""
    end = time.monotonic() + 5.0
    while text not in stream.getvalue() and time.monotonic() < end:
        time.sleep(0.01)
    return stream.getvalue()


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_stages_are_lines_where_lines_stay():
    display = Display(stream := io.StringIO(), rewritten=False, silent=0.0)
    for _ in range(3):
        display.enter("reducing")
        display.enter("modes")
        for done in range(1, 200):
            display.count(done, 200, "")
        waited(stream, "modes")
        display.leave()
        time.sleep(2.5 * progress.LOOK)  # back in the outer stage: no further line
    display.close()
    lines = stream.getvalue().splitlines()
    assert 1 <= len(lines) <= 3
    assert all(line.startswith("gearfe: ") for line in lines)
    assert "reducing: modes: 199 of 200" in lines[0]
    assert "\r" not in stream.getvalue()


def test_a_stage_apart_is_told_inside_of_a_count_and_is_none_of_its_time(monkeypatch):
    """Kernels are compiled in the middle of a run: 20 s of ten parts, 30 s of compiling, eight parts are left."""
    clock = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    display = Display(stream := io.StringIO(), rewritten=False, silent=0.0, each=True)
    display.enter("integrating")
    display.count(0, 100, "implicit")
    for done in (10, 20):
        clock[0] += 10.0
        display.count(done, 100, "implicit")
    display.enter("compiling the kernels", apart=True)
    clock[0] += 30.0
    display.leave()
    assert display._stages[-1].text(clock[0]) == "integrating: implicit 20 of 100, 1/s, 80 s left"
    display.enter("a part of the count")
    display.close()
    lines = [line.split(": ", 2)[2] for line in stream.getvalue().splitlines()]
    assert "integrating: compiling the kernels" in lines
    assert not any("a part of the count" in line for line in lines)


@pytest.mark.parametrize("method", ["taylor", "implicit", "symplectic"])
def test_every_method_reports_that_it_compiles(method, monkeypatch):
    system = pendulum()
    integrate(system, [0.0, 0.1], method=method)  # the kernels are there now
    monkeypatch.setattr(Kernels, "ready", False)
    for kernels in (TAYLOR, COLLOCATION):
        monkeypatch.setattr(kernels, "loaded", False)
    with shown(stream := io.StringIO(), verbose=True):
        integrate(system, [0.0, 0.1], method=method)
    assert stream.getvalue().count(COMPILING) == 1


def test_a_terminal_has_one_line_that_is_cleared():
    display = Display(stream := Terminal(), rewritten=True, silent=0.0)
    display.enter("meshing")
    display.enter("pinion")
    display.leave()
    display.leave()
    display.close()
    told = stream.getvalue()
    assert "meshing: pinion" in told
    assert "\n" not in told
    assert told.endswith("\r\033[K")


def test_short_runs_are_silent():
    stream = io.StringIO()
    with shown(stream), stage("meshing"):
        count(1, 2)
        time.sleep(2 * progress.LOOK)
    assert stream.getvalue() == ""


def test_rate_and_remaining_time():
    assert _Stage("positions", 30, 120, "positions", 10.0).text(20.0) == "positions: 30 of 120, 3/s, 30 s left"
    assert _Stage("integrating", 0.25, 1.0, "ms", 0.0).text(100.0) == "integrating: ms 25 %, 5 min 00 s left"
    unsteady = _Stage("integrating", 0.25, 1.0, "", 0.0, steps=(1000, 5000.0))  # steps take equal times
    assert unsteady.text(10.0) == "integrating: 25 %, 1000 of about 5000 steps, about 40 s left"
    gone_on = _Stage("cases", 930, 1000, "cases", 10.0, 900.0)  # 900 stood there before
    assert gone_on.text(20.0) == "cases: 930 of 1000, 3/s, 23 s left"
    assert _Stage("meshing").text(50.0) == "meshing"
    assert _Stage("a", 5, 5, "", 0.0).text(9.0) == "a: 5 of 5"
    assert _Stage("search", 30, None, "points", 10.0).text(20.0) == "search: 30 points, 3/s"
    assert _Stage("positions", 15000, 60000, "positions", 10.0).text(20.0).endswith("60000, 1500/s, 30 s left")
    assert _Stage("search", 12300, None, "points", 10.0).text(20.0) == "search: 12300 points, 1230/s"


@pytest.mark.parametrize(("share", "told"), [(0.29, "29 %"), (0.996, "99 %"), (1.0 - 1e-7, "99 %"), (1.0, "100 %")])
def test_a_hundred_per_cent_is_the_end_alone(share, told):
    assert _Stage("integrating", share, 1.0, "", 10.0).text(10.5) == f"integrating: {told}"


def test_one_stretch_alone_gives_no_time_left():
    """The first of ten cases took 5 s; whether the second does is known when it is done."""
    at = _Stage("cases", 0, 10, "cases", 100.0)
    told = []
    for at.done in range(3):
        at.mark(100.0 + 5.0 * at.done)
        told.append(at.text(100.0 + 5.0 * at.done))
    assert told[1:] == ["cases: 1 of 10, 0.2/s", "cases: 2 of 10, 0.2/s, 40 s left"]


@pytest.mark.parametrize(
    ("later", "told"),
    [
        (10.0, "cases: 40 of 100, 1/s, 60 s left"),
        (200.0, "cases: 40 of 100, 0.0952/s"),  # became twenty times slower: nobody knows
        (2.5, "cases: 40 of 100, 1.6/s"),
    ],
)
def test_a_time_left_is_shown_where_the_rate_is_steady_alone(later, told):
    """Twenty cases at one a second, twenty more of which ten take `later` seconds."""
    at = _Stage("cases", 0, 100, "cases", 100.0)
    now = 100.0
    for at.done in range(41):
        at.mark(now)
        last, now = now, now + (1.0 if at.done < 20 else later / 10.0)
    assert at.text(last) == told


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (3.4, "3 s"),
        (99.0, "99 s"),
        (150.0, "2 min 30 s"),
        (7300.0, "2 h 01 min"),
        (3599.6, "1 h 00 min"),
        (3e5, "3 days"),
        (1e15, "more than 100 days"),
        (math.inf, "more than 100 days"),
        (math.nan, "more than 100 days"),
    ],
)
def test_durations(seconds, text):
    assert progress.duration(seconds) == text


def test_nobody_watches_and_other_threads():
    with stage("meshing"):  # a library call
        count(1, 2, "teeth")
    stream = io.StringIO()
    with shown(stream):
        thread = threading.Thread(target=lambda: Stopwatch().stage("work").__enter__())
        thread.start()
        thread.join()
        assert progress._displays[-1]._stages == []
    assert progress._displays == []


def test_a_closed_stream_ends_the_telling_only():
    stream = io.StringIO()
    stream.close()
    display = Display(stream, rewritten=False, silent=0.0)
    display.enter("meshing")
    time.sleep(2 * progress.LOOK)
    assert [s.name for s in display._stages] == ["meshing"]  # the work goes on
    display.close()
    display._thread.join(5.0)
    assert not display._thread.is_alive()


def test_an_exception_leaves_no_stage():
    with shown(io.StringIO()):
        with pytest.raises(KeyError), stage("a"), stage("b"):
            raise KeyError
        assert progress._displays[-1]._stages == []
    with pytest.raises(KeyError), shown(io.StringIO()):
        raise KeyError
    assert progress._displays == []


def test_a_wait_of_a_minute_is_announced_to_library_users_too(capsys):
    progress.announce("compiling")
    assert capsys.readouterr().err == "gearfe: compiling\n"
    with shown(stream := io.StringIO()):
        progress.announce("compiling")
    assert (stream.getvalue(), capsys.readouterr().err) == ("gearfe: compiling\n", "")


TRAIN = job_file("vibration").replace('# housing = "elastic"', 'housing = "rigid" #')


@pytest.mark.parametrize(
    ("command", "text", "options", "stages"),
    [
        ("gear", job_file("stiffness"), [], ["drawing"]),
        ("mesh", job_file("stiffness"), ["--gear", "pinion"], ["meshing the pinion", "writing"]),
        ("mechanism", job_file("mechanism"), ["--until", "0.1"], ["integrating", "outputs", "tables", "pictures"]),
        (
            "vibration",
            TRAIN.replace("# stiffness_N_per_m (not set):", "stiffness_N_per_m = 2e8 #"),
            ["--no-pictures"],
            ["curves", "stability of the steady motion", "transient", "integrating", "error estimates", "tables"],
        ),
    ],
)
def test_commands_name_their_stages(tmp_path, capsys, command, text, options, stages):
    (tmp_path / "job.toml").write_text(text)
    out = tmp_path / ("gear.msh" if command == "mesh" else "out")
    assert main([command, str(tmp_path / "job.toml"), "--out", str(out), *options, "-v"]) == 0
    lines = capsys.readouterr().err.splitlines()
    first = [next(i for i, line in enumerate(lines) if name in line.split(": ")) for name in stages]
    assert first == sorted(first), lines
