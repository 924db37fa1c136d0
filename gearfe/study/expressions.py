"""Evaluate the outputs of a case: arithmetic over its columns and its summary (`base.expressions`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError, unknown_name
from ..base.expressions import Names, Node, Quantity, compute, parse, quantities, without_value

#: Names of outputs: columns of the job's main table, ``table.column`` for the others, ``summary.key.key``.
COLUMNS = Names(plain=None, what="an output")


@dataclass(frozen=True)
class Answer:
    """Tables and summary of a job, as its command writes them.

    Attributes
    ----------
    tables
        Name -> column -> values; the first one is the main table.
    summary
        Content of the job's summary.
    problem
        What did not work though the job has an answer: positions that failed, a run that ended early; else empty.
    """

    tables: Mapping[str, Mapping[str, Any]]
    summary: Mapping[str, Any]
    problem: str = ""

    def names(self) -> dict[str, Any]:
        """Everything that an output may name: columns of the main table, tables, summary."""
        main = next(iter(self.tables.values()), {})
        return {**main, **self.tables, "summary": self.summary}


@dataclass(frozen=True)
class Output:
    """An output of a study: its key in messages, its text, and the expression."""

    label: str
    text: str
    node: Node


def read_output(text: str, label: str) -> Output:
    """Parse an output.

    Raises
    ------
    InputError
        If the text is no expression.
    """
    return Output(label, text, parse(text, label, COLUMNS))


def value_of(output: Output, answer: Answer) -> float:
    """Return the output's value, one number; NaN for a gap.

    Raises
    ------
    InputError
        For names that the job does not give, operations without a value, and anything but one number.
    """
    label, known = f"{output.label} = {output.text!r}", answer.names()
    for name, _ in sorted(quantities(output.node)):
        if name not in known:
            raise unknown_name(label, name, known)
    values: dict[Quantity, Any] = {(name, None): value for name, value in known.items()}
    try:
        result = compute(output.node, values, label)
        number = np.asarray(np.nan if result is None else result, dtype=float)
        problem = without_value(output.node, values) if number.size == 1 and not np.isfinite(number) else ""
    except InputError:
        raise
    except (TypeError, ValueError, IndexError, OverflowError, RecursionError) as error:
        raise InputError(label, None, f"has no value ({error})", "look at the job's own tables") from None
    if problem:
        raise InputError(label, None, f"has no value: {problem}", "look at the job's own tables")
    if number.size != 1:
        cure = "take mean(), min(), max(), ptp() of it, or choose one: [torque_Nm == 100]"
        raise InputError(label, None, f"gives {number.size} values: must be one number", cure)
    return float(number.ravel()[0])
