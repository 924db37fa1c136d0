"""What a run counts: the display that a test opens in place of the program's."""

import io
from collections.abc import Iterator
from contextlib import contextmanager

from gearfe.base import progress


class _Counts(progress.Display):
    """Keeps what it is told."""

    def __init__(self) -> None:
        super().__init__(io.StringIO(), rewritten=False)
        self.seen: list[tuple[float, float | None, str]] = []

    def count(self, done: float, total: float | None, what: str, steps: tuple[int, float] = (0, 0.0)) -> None:
        """How far the innermost stage is."""
        self.seen.append((done, total, what))


@contextmanager
def counted() -> Iterator[list[tuple[float, float | None, str]]]:
    """Yield the list of what is counted inside."""
    display = _Counts()
    progress._displays.append(display)
    try:
        yield display.seen
    finally:
        progress._displays.pop().close()
