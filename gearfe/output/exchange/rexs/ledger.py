"""List the use of each value of a REXS file: read, derived, defaulted or ignored. Nothing is left out of the list."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

READ, DERIVED, DEFAULTED, IGNORED = KINDS = ("read", "derived", "defaulted", "ignored")
#: Numbers of components in a line of the list.
MOST_NUMBERS = 8


@dataclass(frozen=True)
class Entry:
    """One line.

    Attributes
    ----------
    kind
        ``read``, ``derived``, ``defaulted`` or ``ignored``.
    component, number
        Type and number of the component; 0: of the whole model.
    attribute
        Attribute of REXS, relation, or what else it is about.
    key
        Key of the job file; empty for what is ignored.
    rule
        How the value follows, or why it is ignored; empty: read as it is.
    """

    kind: str
    component: str
    number: int
    attribute: str
    key: str = ""
    rule: str = ""


def plain(text: str, longest: int = 300) -> str:
    """Return a text of a file on one line and without characters that cannot be shown, for comments and messages."""
    return "".join(letter if letter.isprintable() else " " for letter in " ".join(text.split()))[:longest].rstrip()


def lines_of(entries: Iterable[Entry], kind: str) -> list[str]:
    """Return the lines of one kind, entries that differ by the number of the component on one line."""
    grouped: dict[tuple[str, str, str, str], list[int]] = defaultdict(list)
    for entry in entries:
        if entry.kind == kind:
            grouped[entry.component, entry.attribute, entry.key, entry.rule].append(entry.number)
    lines = []
    for (component, attribute, key, rule), numbers in grouped.items():
        named = ", ".join(str(number) for number in numbers[:MOST_NUMBERS] if number)
        more = f", and {len(numbers) - MOST_NUMBERS} more" if len(numbers) > MOST_NUMBERS else ""
        what = " ".join(word for word in (component, f"{named}{more}", attribute) if word)
        lines.append(plain(f"{what}{' -> ' if key else ''}{key}{': ' if rule else ''}{rule}", 2000))
    return lines
