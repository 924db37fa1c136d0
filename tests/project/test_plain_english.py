"""Pages are plain English: short sentences, and none of the phrases that only this project ever used."""

from __future__ import annotations

import re
import statistics
from pathlib import Path

import pytest

from tests.makers.pages import sentences
from tests.places import DOCS, ROOT

PAGES = sorted([*DOCS.rglob("*.md"), ROOT / "README.md"])
#: Most words of a page's median sentence, and of any sentence (a page of a script may list versions).
MEDIAN, LONGEST = 22, 40
#: Phrase -> what to write.
BANNED = {
    r"\btold\b|\btells\b": "report, print, warn, raise",
    r"\bmended\b|\bmends\b": "fixed",
    r"\bin place of\b": "instead of",
    r"\bbut for\b": "except",
    r"\bwhat bears\b|\bthat bears?\b|\btips? bears?\b": "loaded",
    r"\bmade anew\b|\banew\b": "again",
    r"\bstands? in for\b|\bstands beside\b": "replaces; conflicts with",
    r"\bnot-a-number\b": "NaN",
    r"\b(once|a row|a column|one) an angle\b": "per angle",
    r"\bheld against\b": "compared with",
    r"\bthe house\b|\brooms\b": "architecture, packages",
    r"\bfreedoms\b": "degrees of freedom",
    r"\bis nothing but\b|\bno matter of\b": "plain negation",
    r"\bsuch as it is\b|\bas ever\b": "leave it out",
    r"\bgoes along\b|\bgo along with\b": "follows",
}


def words(sentence: str) -> int:
    return sum(1 for word in sentence.split() if re.search(r"\w", word))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_sentences_are_short(page: Path) -> None:
    counted = sorted(((words(sentence), sentence) for sentence in sentences(page)), reverse=True)
    middle = statistics.median(count for count, _ in counted) if counted else 0
    if middle > MEDIAN:
        pytest.fail(f"{page.name}: median sentence of {middle} words, at most {MEDIAN}: split the long ones", False)
    long = [
        f"{page.name}: {count} words, at most {LONGEST}: {sentence}" for count, sentence in counted if count > LONGEST
    ]
    if long:
        pytest.fail("\n".join(long), False)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_phrases_are_common_english(page: Path) -> None:
    text = re.sub(r"`[^`]*`", "", page.read_text(encoding="utf-8"))
    problems = [
        f"{page.name}:{text.count(chr(10), 0, hit.start()) + 1}: {hit[0]!r}: write {cure!r}"
        for phrase, cure in BANNED.items()
        for hit in re.finditer(phrase, text, re.IGNORECASE)
    ]
    if problems:
        pytest.fail("\n".join(problems), False)


def test_what_the_check_reads(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# Head\n\nOne two. Three `a b c`\nfour.\n\n- item one\n- item two\n\n```\ncode. More.\n```\n\n| a | b |\n"
    )
    assert sentences(page) == ["One two.", "Three Code four.", "item one", "item two"]
