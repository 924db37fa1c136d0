"""What can come of a case: its class, its checks with their limits, its measures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

#: Class -> meaning, in the order of the tables.
CLASSES: dict[str, str] = {
    "done": "answered, and every check holds",
    "refused": "refused with a reason that names the mistake",
    "stopped": "ended with a status that says what was not reached",
    "limit": "asks for more than the time limit; ended cleanly when interrupted",
    "wrong": "answered, but a check fails",
    "traceback": "ended with an exception that no user should see",
    "hang": "did not end within its time limit",
    "crash": "took its process down",
}
#: Classes that must not occur.
BAD = ("wrong", "traceback", "hang", "crash")


@dataclass(frozen=True)
class Check:
    """A number that must not exceed its limit; not-a-number fails."""

    name: str
    value: float
    limit: float

    @property
    def share(self) -> float:
        """Value over limit; above 1 the check fails."""
        if math.isnan(self.value):
            return math.inf
        return self.value / self.limit if self.limit > 0.0 else (math.inf if self.value > 0.0 else 0.0)


@dataclass(frozen=True)
class Finding:
    """What a campaign says of a case that it ran.

    Parameters
    ----------
    outcome
        ``done``, ``refused`` or ``stopped``; a failing check turns ``done`` and ``stopped`` into ``wrong``.
    reason
        Message of the refusal, or what stopped.
    checks, measures
        Checks, and numbers or words for the tables.
    """

    outcome: str
    reason: str = ""
    checks: Sequence[Check] = ()
    measures: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """One row of the table of outcomes."""

    case: int
    kind: str
    outcome: str
    seconds: float
    reason: str = ""
    checks: tuple[Check, ...] = ()
    measures: Mapping[str, Any] = field(default_factory=dict)

    @property
    def bad(self) -> bool:
        """Whether the case shows a defect."""
        return self.outcome in BAD

    @property
    def worst(self) -> Check | None:
        """The check nearest to its limit, or beyond it."""
        return max(self.checks, key=lambda c: c.share, default=None)

    def plain(self) -> dict[str, Any]:
        """JSON data of the row."""
        return {
            "case": self.case,
            "kind": self.kind,
            "outcome": self.outcome,
            "seconds": self.seconds,
            "reason": self.reason,
            "checks": [[c.name, c.value, c.limit] for c in self.checks],
            "measures": dict(self.measures),
        }

    @classmethod
    def from_plain(cls, row: Mapping[str, Any]) -> Outcome:
        """The row of `plain`."""
        checks = tuple(Check(str(n), float(v), float(m)) for n, v, m in row["checks"])
        return cls(
            row["case"], row["kind"], row["outcome"], row["seconds"], row["reason"], checks, dict(row["measures"])
        )


def judged(number: int, kind: str, seconds: float, found: Finding) -> Outcome:
    """The row of a finding: failing checks make it wrong, and say so in the reason."""
    checks = tuple(found.checks)
    failing = [c for c in checks if c.share > 1.0]
    outcome, reason = found.outcome, found.reason
    if failing:
        outcome = "wrong"
        said = ", ".join(f"{c.name} {c.value:.3g} > {c.limit:.3g}" for c in failing)
        reason = f"{said}; {reason}" if reason else said
    return Outcome(number, kind, outcome, seconds, reason, checks, dict(found.measures))
