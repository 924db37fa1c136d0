"""Loads by expression: values as those of outputs, slopes and corners by their series on a tape."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, given
from ..rigid import SpanFunction, StateFunction
from ..rigid.linkage_tape import BodyVariables
from ..rigid.tape import Program, Tape
from ..rigid.taylor import KERNELS
from ..typing import Array
from .expressions import OF_POINT, Node, compute, quantities, value_of, without_value
from .load_series import clock, quantity, write_expression
from .tables import ValueTable

if TYPE_CHECKING:
    from .model import Mechanism

#: What a load may depend on.
ALLOWED = ("time", "angle", "rate", "x", "y", "vx", "vy")
#: What the tension of a spring may depend on.
OF_SPAN = ("time", "length", "length_rate")


class Formula:
    """An expression as a function of the values of its quantities.

    Parameters
    ----------
    text, label
        The expression as written, and its place in the file.
    node
        The expression parsed.
    names
        Its quantities, in order.
    """

    def __init__(self, text: str, label: str, node: Node, names: Sequence[tuple[str, str | None]]) -> None:
        self.text, self.label, self.node, self.names = text, label, node, list(names)
        self.complaint, self._corners = "", corners(node)
        for base in constant_bases(node):
            if not base > 0.0:
                raise InputError(label, text, f"raises {base:g} to a power that varies", "give a base > 0")

    def at(self, t: float | Array, values: Sequence[Any]) -> Any:
        """Value at a time, or at many; not-a-number where it has none, the complaint then says why."""
        known = dict(zip(self.names, values, strict=True))
        try:
            with np.errstate(divide="raise", invalid="raise", over="raise", under="ignore"):
                made = value_of(self.node, known)
        except FloatingPointError:
            made = np.nan
        if np.isfinite(made).all():
            return made
        if np.ndim(t):
            return np.array([self.at(*one) for one in zip(np.asarray(t), zip(*values, strict=True), strict=True)])
        self.complaint = f"{self.label} = {self.text!r} at {t:.6g} s: {without_value(self.node, known)}"
        return math.nan

    @cached_property
    def _program(self) -> tuple[int, Program]:
        """Its register, and the tape of which the quantities are the variables."""
        tape = Tape(len(self.names))
        register = write_expression(self.node, tape, lambda name: tape.linear({self.names.index(name): 1.0}))
        none = np.zeros((tape.size, tape.size))
        return register, tape.program(none, none, none, np.ones(tape.size))

    def slopes_at(self, t: float, values: Sequence[float]) -> Array:
        """Slopes by the quantities; 0 where there is no value, and in corners such as that of a root at 0."""
        slopes, (register, program), plain = np.zeros(len(values)), self._program, KERNELS.plain
        if not math.isfinite(self.at(t, values)):
            return slopes
        Z, R = np.zeros((len(values), 3)), np.zeros((len(program.code.op), 2))
        Z[:, 0], pieces = values, np.zeros(len(program.switches.register), dtype=np.int64)
        with np.errstate(all="ignore"):
            plain.set_pieces(program, Z, R, Z, pieces)
            plain.tape_order(program, Z, R, Z, pieces, 0)
            for k in range(len(values)):
                Z[:, 1] = np.eye(len(values))[k]
                plain.tape_order(program, Z, R, Z, pieces, 1)
                slopes[k] = R[register, 1]
        return np.where(np.isfinite(slopes), slopes, 0.0)

    def pieces_at(self, values: Sequence[float]) -> tuple[int | None, ...]:
        """Numbers of the pieces of tables and signs of what has corners; None where these have no value."""
        known = dict(zip(self.names, values, strict=True))
        with np.errstate(all="ignore"):
            found = [(value_of(node, known), table) for node, table in self._corners]
        return tuple(
            None if not math.isfinite(x) else int(x >= 0.0) if table is None else table.piece(x) for x, table in found
        )


def corners(node: Node) -> list[tuple[Node, ValueTable | None]]:
    """Parts on whose signs, or places in a table, depends which smooth piece an expression is on."""
    found = [corner for part in node.parts for corner in corners(part)]
    below = (
        node.parts[1] if node.kind == "/" else node if node.kind == "**" and node.parts[1].kind == "negative" else None
    )
    while below is not None and below.kind in ("**", "negative"):  # what must not pass zero
        below = below.parts[0]
    if node.kind == "table":
        found.append((node.parts[0], node.value[1]))
    elif node.kind == "call" and node.value in ("abs", "tan"):
        found.append((node.parts[0] if node.value == "abs" else Node("call", "cos", node.parts), None))
    elif node.kind == "call" and node.value in ("min", "max"):
        found.append((Node("-", parts=node.parts), None))
    elif below is not None and quantities(below):
        found.append((below, None))
    return found


def constant_bases(node: Node) -> list[float]:
    """Numbers that are raised to powers that vary."""
    found = [base for part in node.parts for base in constant_bases(part)]
    if node.kind == "**" and quantities(node.parts[1]) and not quantities(node.parts[0]):
        found.append(float(compute(node.parts[0], {})))
    return found


class ExpressionLoad(Formula, StateFunction):
    """A load given by an expression; `bind` tells it the mechanism whose quantities it names.

    Parameters
    ----------
    text, label
        The expression as written, and its place in the file.
    node
        The expression parsed.
    """

    def __init__(self, text: str, label: str, node: Node) -> None:
        super().__init__(text, label, node, sorted(quantities(node), key=str))
        for kind, _ in self.names:
            if kind not in ALLOWED:
                problem = f"uses {kind}; a load may depend on {', '.join(ALLOWED)}"
                raise InputError(label, text, problem, "use one of these")

    def bind(self, mechanism: Mechanism) -> None:
        """Look up bodies and points."""
        self.size, label = mechanism.linkage.size, self.label
        self.places: list[tuple[str, list[tuple[int, float, float, float]]]] = []
        for kind, what in self.names:
            where: list[tuple[int, float, float, float]] = []  # body, sign, place in its frame
            if kind in ("angle", "rate"):
                for body, sign in mechanism.angle_of(given(what, label), label):
                    where.append((body, sign, 0.0, 0.0))
            elif kind in OF_POINT:
                body, (x, y) = mechanism.point(given(what, label), label)
                where.append((body, 1.0, x, y))
            self.places.append((kind, where))

    def value(self, t: float, q: Array, v: Array) -> float:
        """Value at a state."""
        return float(self.values(t, q, v))

    def values(self, t: float | Array, q: Array, v: Array) -> Any:
        """Value at a state, or at many."""
        return self.at(t, self._quantities(t, q, v))

    def slopes(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Slopes by coordinates and velocities."""
        by_q, by_v = np.zeros(self.size), np.zeros(self.size)
        slopes = self.slopes_at(t, self._quantities(t, q, v))
        for slope, (kind, where) in zip(slopes, self.places, strict=True):
            for body, sign, x, y in where:
                k = 3 * body
                if slope == 0.0 or k >= self.size:
                    continue
                if kind == "angle":
                    by_q[k + 2] += slope * sign
                elif kind == "rate":
                    by_v[k + 2] += slope * sign
                else:
                    c, s = math.cos(q[k + 2]), math.sin(q[k + 2])
                    arm = c * x - s * y, s * x + c * y
                    along = kind[-1] == "y"
                    turned = arm[0] if along else -arm[1]
                    held = by_v if kind[0] == "v" else by_q
                    held[k + along] += slope
                    held[k + 2] += slope * turned
                    if kind[0] == "v":
                        by_q[k + 2] -= slope * v[k + 2] * arm[along]
        return by_q, by_v

    def pole(self, t: float, value: float) -> str:
        """Expression, time and value."""
        why = " (a division by zero)" if self._corners else ""
        return f"{self.label} = {self.text!r} at {t:.6g} s: grows beyond {value:.0e}{why}"

    def pieces(self, t: float, q: Array, v: Array) -> tuple[int | None, ...]:
        """Pieces of all corners; None where there is no value."""
        return self.pieces_at(self._quantities(t, q, v))

    def write(self, bodies: BodyVariables) -> int:
        """Its register on a tape."""
        places = dict(zip(self.names, self.places, strict=True))
        return write_expression(self.node, bodies.tape, lambda name: quantity(bodies, *places[name]))

    def _quantities(self, t: float | Array, q: Array, v: Array) -> list[Any]:
        """Values of its quantities at a state, or at many."""
        return [t if kind == "time" else self._quantity(kind, where, q, v) for kind, where in self.places]

    def _quantity(self, kind: str, where: list[tuple[int, float, float, float]], q: Array, v: Array) -> Any:
        total: Any = np.zeros(q.shape[:-1])
        for body, sign, x, y in where:
            k = 3 * body
            if k >= self.size:
                total = total + {"x": x, "y": y}.get(kind, 0.0)
            elif kind in ("angle", "rate"):
                total = total + sign * (q if kind == "angle" else v)[..., k + 2]
            else:
                c, s, along = np.cos(q[..., k + 2]), np.sin(q[..., k + 2]), int(kind[-1] == "y")
                arm = c * x - s * y, s * x + c * y
                moves = v[..., k + along] + v[..., k + 2] * (arm[0] if along else -arm[1])
                total = moves if kind[0] == "v" else q[..., k + along] + arm[along]
        return total


class ExpressionTension(Formula, SpanFunction):
    """The tension of a spring given by an expression; text, label and node as of `ExpressionLoad`."""

    def __init__(self, text: str, label: str, node: Node) -> None:
        for kind, _ in quantities(node):
            if kind not in OF_SPAN:
                problem = f"uses {kind}; a tension may depend on {', '.join(OF_SPAN)}"
                raise InputError(label, text, problem, "use one of these")
        super().__init__(text, label, node, [(name, None) for name in OF_SPAN])

    def value(self, t: float, length: float, rate: float) -> float:
        """Tension (N)."""
        return float(self.values(t, length, rate))

    def values(self, t: float | Array, length: Any, rate: Any) -> Any:
        """Tension in a state, or in many (N)."""
        return self.at(t, [t, length, rate])

    def slopes(self, t: float, length: float, rate: float) -> tuple[float, float]:
        """Slopes by length and rate."""
        _, by_length, by_rate = self.slopes_at(t, [t, length, rate])
        return float(by_length), float(by_rate)

    def pieces(self, t: float, length: float, rate: float) -> tuple[int | None, ...]:
        """Pieces of all corners; None where there is no value."""
        return self.pieces_at([t, length, rate])

    def write(self, tape: Tape, length: int, rate: int) -> int:
        """Its register on a tape."""
        known = {"length": length, "length_rate": rate}
        return write_expression(self.node, tape, lambda name: known[name[0]] if name[0] in known else clock(tape))
