"""A long run: its progress on stderr, the seconds of its stages, its threads.

Progress is a line that is rewritten on a terminal, a line for each stage elsewhere.

Work that may take long names itself with `stage` and counts with `count`. Both do nothing until a program
opens `shown`, so a library call stays silent. The first two seconds of a run stay silent too.
"""

from __future__ import annotations

import math
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TextIO

#: Seconds before the first message, between two looks at a run, and of a count before its rate is shown.
SILENT, LOOK, SETTLED = 2.0, 0.2, 1.0
#: A time left is shown where the rates of all that is counted and of its later half differ by this factor at most; how
#: much longer than the one before a stretch is whose end is remembered.
STEADY, STRETCH = 1.5, 1.2
#: Times left of more days than this are not given as a number.
MOST_DAYS = 100.0
#: Seconds after which a stage that still continues is shown again where lines stay; doubled each time.
AGAIN = 60.0


@dataclass
class _Stage:
    """A piece of work under way."""

    name: str
    done: float = 0.0
    total: float | None = 0.0  # None: nobody knows
    what: str = ""
    counted: float = 0.0  # when the count began
    first: float = 0.0  # what was done then
    apart: float = 0.0  # when it began, of what is no part of the counts outside
    marks: list[tuple[float, float]] = field(default_factory=list)  # (when, what was done then), ever farther apart
    steps: tuple[int, float] = (0, 0.0)  # made of those expected, which take equal times; (0, 0): not known

    @property
    def is_counted(self) -> bool:
        """Return whether the progress is counted."""
        return self.total is None or self.total > 0.0

    def mark(self, now: float) -> None:
        """Remember how far it is."""
        if not self.marks or self.done - self.first >= STRETCH * (self.marks[-1][1] - self.first):
            self.marks.append((now, self.done))

    def _steady(self, now: float) -> float:
        """Return the work per second; 0 if it varies too much to predict the remaining time."""
        progress = self.done - self.first
        rates = [progress / (now - self.counted)]
        halves = [mark for mark in self.marks if mark[1] - self.first <= 0.5 * progress and mark[0] < now]
        if halves and halves[-1][1] == self.first:
            return 0.0  # one stretch alone does not show whether the next ones take as long
        if halves:
            when, done = halves[-1]
            rates.append((self.done - done) / (now - when))
        return min(rates) if max(rates) <= STEADY * min(rates) else 0.0

    def text(self, now: float) -> str:
        """Name, how far it is, its rate and the time that is left."""
        if not self.is_counted:
            return self.name
        elapsed = now - self.counted
        made = self.done - self.first
        if self.total is None:
            parts = [f"{self.done} {self.what}"]
            parts += [f"{written_out(made / elapsed)}/s"] if elapsed >= SETTLED and made > 0.0 else []
            return f"{self.name}: {', '.join(parts)}"
        share = min(1.0, self.done / self.total)
        whole = isinstance(self.total, int)
        what = self.what if self.what and self.what != self.name else ""
        # rounded down: 100 % is the end alone
        far = f"{self.done} of {self.total}" if whole else f"{math.floor(100.0 * share + 1e-9)} %"
        parts = [f"{what} {far}".strip()]
        if elapsed >= SETTLED and made > 0.0 and share < 1.0:
            parts += [f"{written_out(made / elapsed)}/s"] if whole else []
            steps, expected = self.steps
            if expected > steps > 0:
                parts.append(f"{steps} of about {written_out(expected, 2)} steps")
                parts.append(f"about {duration((expected - steps) * elapsed / steps)} left")
            elif (rate := self._steady(now)) > 0.0:
                parts.append(f"{duration((self.total - self.done) / rate)} left")
        return f"{self.name}: {', '.join(parts)}"


class Display:
    """Shows the innermost stages of a run; a thread looks at them, so that work itself never waits."""

    def __init__(self, stream: TextIO, *, rewritten: bool, silent: float = SILENT, each: bool = False) -> None:
        self._stream, self._rewritten, self._each = stream, rewritten, each
        self._begun, self._silent = time.monotonic(), silent
        self._stages: list[_Stage] = []
        self._lock = threading.RLock()
        self._over = threading.Event()
        self._line = ""  # on the terminal now
        self._reported: tuple[str, ...] = ()  # stages of the last line that stays
        self._next = 0.0  # when they are shown again
        self._wait = AGAIN
        self._thread = threading.Thread(target=self._look, name="progress", daemon=True)
        self._thread.start()

    def enter(self, name: str, *, apart: bool = False) -> None:
        """A stage begins."""
        with self._lock:
            self._stages.append(_Stage(name, apart=time.monotonic() if apart else 0.0))
            if self._rewritten or self._each:
                self._show()

    def leave(self) -> None:
        """The innermost stage is over."""
        with self._lock:
            if self._stages and (begun := self._stages.pop().apart):
                for outer in self._stages:
                    taken = time.monotonic() - begun if outer.counted else 0.0
                    outer.counted += taken
                    outer.marks = [(when + taken, done) for when, done in outer.marks]
            if not self._stages:
                self._clear()

    def count(self, done: float, total: float | None, what: str, steps: tuple[int, float] = (0, 0.0)) -> None:
        """Show how far the innermost stage is.

        Parameters
        ----------
        done, total : float
            What is done, and of how much; None is not known.
        what : str
            What is counted.
        steps : (int, float)
            Steps made and expected in all.
        """
        with self._lock:
            if not self._stages:
                self._stages.append(_Stage(what))
            at = self._stages[-1]
            if at.what != what or done < at.done or not at.counted:
                at.counted, at.first, at.marks = time.monotonic(), done, []
            at.done, at.total, at.what, at.steps = done, total, what, steps
            at.mark(time.monotonic())

    def say(self, text: str) -> None:
        """A line that stays."""
        with self._lock:
            self._clear()
            self._write(f"gearfe: {text}\n")

    def close(self) -> None:
        """Stop looking and clear the line."""
        self._over.set()
        self._thread.join(timeout=1.0)
        with self._lock:
            self._stages.clear()
            self._clear()

    def _look(self) -> None:
        while not self._over.wait(LOOK):
            with self._lock:
                self._show()

    def _show(self) -> None:
        now = time.monotonic()
        if now - self._begun < self._silent or not self._stages:
            return
        apart = max((i for i, at in enumerate(self._stages) if at.apart), default=0)
        inner = self._stages[apart:]
        counted = next((i for i, at in enumerate(inner) if at.is_counted), len(inner) - 1)
        stages = self._stages[: apart + counted + 1]  # what continues inside of a count is a part of it
        text = ": ".join([*(s.name for s in stages[:-1]), stages[-1].text(now)])
        if self._rewritten:
            width = shutil.get_terminal_size().columns - 1
            line = f"{duration(now - self._begun)} {text}"[:width]
            if line != self._line:
                self._write(f"\r{line}\033[K")
                self._line = line
            return
        path = tuple(s.name for s in stages)
        if path != self._reported[: len(path)]:  # back in the outer stage is nothing new
            self._reported, self._wait, self._next = path, AGAIN, now + AGAIN
        elif now < self._next:
            return
        else:
            self._wait *= 2.0
            self._next = now + self._wait
        self._write(f"gearfe: {duration(now - self._begun)}: {text}\n")

    def _clear(self) -> None:
        if self._line:
            self._write("\r\033[K")
            self._line = ""

    def _write(self, text: str) -> None:
        with suppress(OSError, ValueError):  # a closed pipe ends the messages, not the run
            self._stream.write(text)
            self._stream.flush()


def duration(seconds: float) -> str:
    """Time for people."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    days = seconds / 86400.0
    if not days <= MOST_DAYS:
        return f"more than {MOST_DAYS:.0f} days"
    minutes, rest = divmod(round(seconds), 60)
    if minutes >= 48 * 60:
        return f"{days:.0f} days"
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def written_out(number: float, digits: int = 3) -> str:
    """A number > 0 with so many digits, written out (1230, 0.0952) from 1e-4 to 1e15."""
    return f"{float(f'{number:.{digits}g}'):.15g}"


_displays: list[Display] = []


def _display() -> Display | None:
    """Return the display of this thread's work."""
    return _displays[-1] if _displays and threading.current_thread() is threading.main_thread() else None


@contextmanager
def shown(stream: TextIO | None = None, *, verbose: bool = False) -> Iterator[None]:
    """Show stages inside on `stream` (stderr): as one line that is rewritten where it is a terminal.

    With `verbose` each stage is a line from the begin of the run.
    """
    stream = sys.stderr if stream is None else stream
    if stream is None or _displays:
        yield
        return
    notebook = type(stream).__module__.startswith("ipykernel")  # it rewrites lines as a terminal does
    rewritten = (stream.isatty() or notebook) and not verbose
    _displays.append(Display(stream, rewritten=rewritten, silent=0.0 if verbose else SILENT, each=verbose))
    try:
        yield
    finally:
        _displays.pop().close()


@contextmanager
def stage(name: str, *, apart: bool = False) -> Iterator[None]:
    """Name the work inside for the display; also as a decorator.

    It is a part of what a stage outside counts, unless it stands `apart`: told while it lasts, its time not of the
    count's rate.
    """
    display = _display()
    if display is None:
        yield
        return
    display.enter(name, apart=apart)
    try:
        yield
    finally:
        display.leave()


def count(done: float, total: float | None, what: str = "", *, steps: tuple[int, float] = (0, 0.0)) -> None:
    """Report how far the stage is: whole numbers of a whole number of things, or as floats a share.

    Parameters
    ----------
    done, total : float
        What is done, and of how much; a total of None is not known: no time is left then.
    what : str
        What is counted.
    steps : (int, float)
        Steps made and expected in all, where these tell the time that is left and `done` does not.
    """
    if display := _display():
        display.count(done, total, what, steps)


def announce(text: str) -> None:
    """Report a wait of a minute also without a display."""
    if _displays:
        say(text)
    elif sys.stderr is not None:
        print(f"gearfe: {text}", file=sys.stderr, flush=True)


def say(text: str) -> None:
    """Print a line that stays."""
    if display := _display():
        display.say(text)


@dataclass
class Stopwatch:
    """Seconds by stage.

    Attributes
    ----------
    begun
        When the whole began, of `time.perf_counter`.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    begun: float = field(default_factory=time.perf_counter)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent inside to the stage `name`."""
        start = time.perf_counter()
        try:
            with stage(name):
                yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold the BLAS libraries of this process at one thread, and give them back their number afterwards.

    The fronts of a tooth sector have a few hundred unknowns. At this size the threads of a BLAS library mostly wait for
    each other (measured on two busy cores: 25 times slower than one thread).
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield
