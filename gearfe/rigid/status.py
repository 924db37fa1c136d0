"""Why a run ended."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Why a run ended; the compiled loops return these numbers, too."""

    STOPPED = -1
    DONE = 0
    STEP_TOO_SMALL = 1
    MOST_STEPS = 2
    NO_BRANCH = 3
    NOT_FINITE = 4
    NOT_SOLVED = 5
    SINGULAR_START = 6
    REDUNDANT_NOT_MET = 7

    @property
    def message(self) -> str:
        """The status in words."""
        return _MESSAGES[self]

    def __str__(self) -> str:
        return self.name.lower()


_MESSAGES = {
    Status.STOPPED: "ended by its watch",
    Status.DONE: "done",
    Status.STEP_TOO_SMALL: "the step became too small for the tolerance",
    Status.MOST_STEPS: "the largest number of steps was reached",
    Status.NO_BRANCH: "the start is a singular position and its velocity selects no branch",
    Status.NOT_FINITE: "the state is not finite",
    Status.NOT_SOLVED: "the equations could not be solved in a step",
    Status.SINGULAR_START: "the start is beside a singular position",
    Status.REDUNDANT_NOT_MET: "constraints that were taken for redundant at the start are not met by the motion",
}
