"""Arithmetic expressions of job files, which come from strangers."""

from __future__ import annotations

import pytest

from gearfe.base.errors import InputError
from gearfe.base.expressions import Names, parse

NESTED = {
    "powers": "1" + "^1" * 900,
    "remainders": "1" + "%1" * 900,
    "negations": "not " * 400 + "1",
    "complements": "~" * 1500 + "1",
    "members": "a" + ".b" * 900,
    "conjunctions": "a" + "&a" * 900,
}


@pytest.mark.parametrize("text", NESTED.values(), ids=NESTED)
def test_deep_expressions_are_refused(text: str) -> None:
    """Signs that are not counted as operations nest as deep: an error, where Python's own recursion ended."""
    with pytest.raises(InputError, match="nested more than 200 times"):
        parse(text, "outputs[0].value", Names(plain=None))


@pytest.mark.parametrize(
    ("text", "says"),
    [("2 ^ (time + 1)", r"write 2 \*\* \(time \+ 1\)"), ("1 +\n (time // 2)", "cannot read 'time // 2'")],
)
def test_what_is_no_arithmetic_is_quoted(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        parse(text, "expression", Names(("time",)))


def test_sums_of_two_hundred_terms_are_read() -> None:
    assert parse("+".join(["time"] * 200), "expression", Names(("time",))).kind == "+"
