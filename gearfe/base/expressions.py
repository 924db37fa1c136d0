"""Syntax of arithmetic expressions in job files: Python's, read into a tree and never run as code."""

from __future__ import annotations

import ast
import keyword
import re

from .errors import InputError

#: Most characters and operations of an expression: evaluations go down its tree, one call to a level.
LONGEST, OPERATIONS = 2000, 200


def syntax(text: str, label: str) -> ast.expr:
    """Syntax tree of one expression; `label` names it in messages.

    Raises
    ------
    InputError
        When it is none, or too long.
    """
    if len(text) > LONGEST:
        raise InputError(label, None, f"is longer than {LONGEST} characters", "split it into several outputs")
    if sum(text.count(sign) for sign in "+-*/(") > OPERATIONS:
        raise InputError(label, None, f"has more than {OPERATIONS} operations", "split it into several outputs")
    try:
        tree = ast.parse(text.replace("\n", " ").strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        problem, cure = str(error).partition(" (")[0], "write numbers, names and functions as in Python"
        words = [word for word in re.findall(r"\w+", text) if keyword.iskeyword(word)]
        if words:
            cure += f"; {words[0]} is one of its keywords and can be no name here"
        raise InputError(label, text, f"is not an expression: {problem}", cure) from None
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
            power = f"{ast.unparse(node.left)} ** {ast.unparse(node.right)}"
            raise InputError(label, text, "has ^, which is no power in this syntax", f"write {power}")
    return tree
