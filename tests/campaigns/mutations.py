"""Whole job files that run quickly, and random mutations of their text."""

from __future__ import annotations

import random as plain_random
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from gearfe.base.tables.examples import HOUSING, MECHANISM, PAIR, TRAIN

from .toml_text import toml_text

#: What is put where a value was. The last ones would do something if they were run, opened or followed.
VALUES = (
    "0", "-1", "1", "1e-300", "1e300", "-1e300", "nan", "inf", "-inf", "true", "[]", "{}", '""', '"a"', "[1, 2, 3]",
    "99999999999999999999999", "1e400", "0.1", "3", "1000000", "1e-9", "[[1]]", "[nan, inf]", "1979-05-27T07:32:00Z",
    '"\\u0000"', '"é\\U0001F600"', '"' + "x" * 3000 + '"', "0x10", "-0.0", "5e-324", '"nan"', '"1"', "[true]",
    '"../../outside.csv"', '"/etc/passwd"', '"/dev/zero"', '"."', '"~/x"', '"http://localhost:1/x.csv"', '"a\\nb"',
    '"__import__(\'os\').system(\'touch CANARY\')"', '"$(touch CANARY)"', '"{0.__class__}"', '"%n%s"',
    '"(lambda: open(\'CANARY\', \'w\'))()"', '"; touch CANARY"', '"=cmd()"', '"<script>"',
)  # fmt: skip
#: Expressions for texts that are read as such.
EXPRESSIONS = (
    "1/0", "sqrt(-1)", "10**10**10", "angle(crank", "((((((((1))))))))", "x(rod.B)**-0.5", "log(0)", "angle(nobody)",
    "__builtins__", "().__class__", "exec('1')", "time.time", "-" * 5000 + "1", "(" * 2000 + "1" + ")" * 2000, "",
    "angle(crank) ** 1e308", "atan2(1)", "hypot(1,2,3)", "1e999", "abs", "a\0b", "x(rod.)", "pi pi", "y(ground.O)",
)  # fmt: skip


@dataclass(frozen=True)
class BaseJob:
    """A job that runs within a second.

    Parameters
    ----------
    text
        The file.
    arguments
        The command and its options.
    share
        How often it is taken.
    """

    text: str
    arguments: tuple[str, ...]
    share: float


@cache
def base_jobs() -> dict[str, BaseJob]:
    """Name of the command -> a small job."""
    sweep = {"twist_deg": 0.1, "angle_start_deg": 1.0, "angle_step_deg": 9.0, "angle_stop_deg": 10.0, "coarsen": 4.0}
    mechanism = {**MECHANISM, "run": {"end_s": 0.2, "step_s": 0.02, "tolerance": 1e-6, "reactions": True}}
    mechanism["start"] = {"positions": {"angle(crank)": 0.7854}, "velocities": {"vx(rod.B)": -4.0}}
    mechanism["forces"] = {
        **MECHANISM["forces"],
        "spring": {
            "type": "spring",
            "body": "rod",
            "point": "B",
            "to_point": "O",
            "stiffness_N_per_m": 5.0,
            "damping_N_s_per_m": 0.1,
        },
        "motor": {"type": "moment", "body": "crank", "moment_N_m": {"constant": 0.5, "sine": 1.0, "frequency_hz": 2.0}},
    }
    train = {**TRAIN, "housing": "rigid", "duration_ms": 1.0, "step_us": 50.0}
    train["meshes"] = [{"driver": "pinion", "driven": "wheel", "stiffness_N_per_m": 1e8, "damping_N_s_per_m": 100.0}]
    train["rigid_bores"] = [
        {"attachment": name, "x_mm": x, "y_mm": y}
        for name, x, y in (("1", 0.0, 33.0), ("2", 0.0, -33.0), ("3", 62.5, 33.0), ("4", 62.5, -33.0))
    ]
    train["curves"] = {"mesh_model": "variable_stiffness", "load": "stiffness"}
    housing = {**HOUSING, "mesh": {"size_mm": 20.0}, "reduction": {"modes": 5}}
    plain = ("--no-pictures", "--no-floquet", "--no-estimate")
    return {
        "mechanism": BaseJob(
            toml_text(mechanism), ("mechanism", "--no-pictures", "--reactions", "--no-estimate"), 0.45
        ),
        "stiffness": BaseJob(
            toml_text({"pair": PAIR, "stiffness": sweep}), ("stiffness", "--no-pictures", "--no-estimate"), 0.2
        ),
        "vibration": BaseJob(toml_text({"pair": PAIR, "train": train}), ("vibration", *plain), 0.25),
        "gear": BaseJob(toml_text({"pair": PAIR}), ("gear",), 0.02),
        "housing": BaseJob(toml_text({"housing": housing}), ("housing", "--no-pictures"), 0.01),
    }


Mutation = Callable[[plain_random.Random, str], str]


def mutated(random: np.random.Generator, text: str, count: int) -> str:
    """The text after `count` random mutations."""
    own = plain_random.Random(int(random.integers(1 << 62)))
    for _ in range(count):
        text = own.choices(list(MUTATIONS), weights=list(MUTATIONS.values()))[0](own, text)
    return text


def _value(random: plain_random.Random, text: str) -> str:
    """Another value for one key, or for one number or text within a list."""
    places = [m.span() for m in re.finditer(r'(?<== )[^\n]+|(?<=[\[, ])-?\d[\d.e+-]*|"[^"\n]*"', text)]
    if not places:
        return text
    first, last = random.choice(places)
    return text[:first] + random.choice(VALUES) + text[last:]


def _number(random: plain_random.Random, text: str) -> str:
    """A number that is off by orders of magnitude, or has another sign."""
    places = [m.span() for m in re.finditer(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)]
    if not places:
        return text
    first, last = random.choice(places)
    try:
        value = float(text[first:last]) * random.choice([-1.0, 0.5, 0.1, 2.0, 1e-3, 1e-9, 1e9, 1e-30, 1e30])
    except ValueError:
        return text
    return text[:first] + repr(value) + text[last:]


def _expression(random: plain_random.Random, text: str) -> str:
    """Another text in quotes."""
    places = [m.span() for m in re.finditer(r'"[^"\n]*"', text)]
    if not places:
        return text
    first, last = random.choice(places)
    said = random.choice(EXPRESSIONS).replace("\0", "\\u0000")
    return text[:first] + f'"{said}"' + text[last:]


def _swapped(random: plain_random.Random, text: str) -> str:
    """Two lines in each other's place."""
    lines = text.splitlines()
    i, j = random.randrange(len(lines)), random.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return "\n".join(lines) + "\n"


def _dropped(random: plain_random.Random, text: str) -> str:
    """Without a line or a few."""
    lines = text.splitlines()
    first = random.randrange(len(lines))
    del lines[first : first + random.choice([1, 1, 1, 3, 8])]
    return "\n".join(lines or [""]) + "\n"


def _repeated(random: plain_random.Random, text: str) -> str:
    """A line, or a stretch of lines, twice."""
    lines = text.splitlines()
    first = random.randrange(len(lines))
    part = lines[first : first + random.choice([1, 2, 6])]
    where = random.randrange(len(lines) + 1)
    return "\n".join(lines[:where] + part + lines[where:]) + "\n"


def _renamed(random: plain_random.Random, text: str) -> str:
    """A key or name with a letter more, less or other."""
    places = [m.span() for m in re.finditer(r"[A-Za-z_]{2,}", text)]
    if not places:
        return text
    first, last = random.choice(places)
    word, at = text[first:last], random.randrange(last - first)
    made = random.choice([word[:at] + word[at + 1 :], word[:at] + "x" + word[at:], word.upper(), word + "_"])
    return text[:first] + made + text[last:]


def _characters(random: plain_random.Random, text: str) -> str:
    """Some characters replaced by any others."""
    made = list(text)
    for _ in range(random.choice([1, 2, 5, 20])):
        made[random.randrange(len(made))] = chr(random.choice([0, 7, 10, 34, 39, 61, 91, 93, 123, 255, 0x2028, 0xFFFD]))
    return "".join(made)


def _cut(random: plain_random.Random, text: str) -> str:
    """Only the beginning."""
    return text[: random.randrange(len(text) + 1)] or "\n"


def _nested(random: plain_random.Random, text: str) -> str:
    """A deeply nested value at the end."""
    depth = random.choice([10, 200, 3000])
    return text + "\nzz = " + "[" * depth + "]" * depth + "\n"


#: Mutation -> how often it is taken.
MUTATIONS: dict[Mutation, float] = {
    _value: 8, _number: 6, _expression: 2, _swapped: 1, _dropped: 2, _repeated: 1, _renamed: 2, _characters: 1,
    _cut: 0.3, _nested: 0.1,
}  # fmt: skip
