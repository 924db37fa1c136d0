"""Equations of the documentation site as MathML, which browsers show without a script: nothing is fetched.

`mkdocs.yml` names this file as a hook. Pages write ``$...$`` and ``$$...$$``, as GitHub reads them.
"""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

#: What the Markdown extensions make of an equation: pattern, and how it is shown.
WRITTEN = (
    (re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL), "inline"),
    (re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL), "block"),
)


def on_page_content(content: str, **_: Any) -> str:
    """The page with its equations as MathML; mkdocs calls it."""
    for pattern, display in WRITTEN:
        content = pattern.sub(lambda found, display=display: mathml(found[1], display), content)
    return content


def mathml(written: str, display: str) -> str:
    """An equation of LaTeX, as HTML has it, as MathML."""
    return str(convert(html.unescape(written).strip(), display=display))
