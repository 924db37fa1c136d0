"""Draw docs/andrews_angles.png: the seven angles of Andrews' mechanism. Run: python scripts/build/andrews_angles.py"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gearfe.figures.style import BLUE, ORANGE, fixed, save
from gearfe.mechanisms import load_mechanism
from gearfe.multibody import integrate

ROOT = Path(__file__).resolve().parents[2]
#: Time of the drawn position (s): all angles are wide enough to see.
TIME = 0.0102
#: Symbol -> vertex, reference direction (of a body, None: the ground) and the end of the angle, in the frames' axes.
ANGLES: dict[str, tuple[str, str | None, tuple[float, float], str]] = {
    "β": ("b1.O", None, (1.0, 0.0), "b1.P"),
    "Θ": ("b2.P", "b1", (-1.0, 0.0), "b2.E"),
    "γ": ("b3.B", None, (0.0, -1.0), "b3.E"),
    "δ": ("b5.A", None, (1.0, 0.0), "b5.Q"),
    "ε": ("b7.A", None, (0.0, -1.0), "b7.R"),
    "Φ": ("b4.Q", "b5", (0.0, -1.0), "b4.E"),
    "Ω": ("b6.R", "b7", (1.0, 0.0), "b6.E"),
}
#: Radius of the arcs and length of the reference lines (mm).
RADIUS, LINE = {"β": 12.0, "Θ": 9.0, "ε": 13.0}, 1.3


def main() -> None:
    """Compute the position and draw it."""
    mechanism = load_mechanism(ROOT / "geometry" / "andrews.toml")
    q = integrate(mechanism.system, [0.0, TIME]).q[-1:]

    def at(where: str) -> np.ndarray:
        found = mechanism.values({("x", where), ("y", where)}, q)
        return 1e3 * np.array([found["x", where][0], found["y", where][0]])

    figure = fixed(8, 5.2)
    axes = figure.add_axes((0.09, 0.1, 0.89, 0.89))
    lines = [("b1", "OP"), ("b2", "PE"), ("b3", "BED"), ("b4", "QE"), ("b5", "AQ"), ("b6", "RE"), ("b7", "AR")]
    for body, points in lines:
        ends = np.array([at(f"{body}.{name}") for name in points])
        closed = np.vstack([ends, ends[:1]])
        axes.plot(*(closed if len(points) > 2 else ends).T, color="#9ca3af", lw=3, zorder=1, solid_capstyle="round")
        middle = ends[:2].mean(axis=0)
        axes.annotate(
            body,
            middle,
            (-24, -4) if body in ("b4", "b6") else (6, 6),
            textcoords="offset points",
            color="#6b7280",
            fontsize=9,
        )
    fixed_end = 1e3 * np.array(mechanism.file.ground.points_m["C"])
    spring = at("b3.D") + np.array([[0.0], [0.22]]) * (fixed_end - at("b3.D"))
    axes.plot(*spring.T, color="#9ca3af", lw=1.2, ls=":", zorder=1)
    named = {"O": "b1.O", "P": "b1.P", "E": "b2.E", "B": "b3.B", "D": "b3.D", "Q": "b4.Q", "A": "b5.A", "R": "b6.R"}
    for name, where in named.items():
        axes.plot(*at(where), "o", ms=5, color=BLUE, zorder=3)
        axes.annotate(name, at(where), (-12, 4), textcoords="offset points", color=BLUE, fontsize=11)
    axes.annotate("spring to C", spring.mean(axis=0), (8, 0), textcoords="offset points", color="#6b7280", fontsize=9)
    for symbol, (vertex, body, direction, end) in ANGLES.items():
        _angle(axes, symbol, at(vertex), _turned(mechanism, q, body, direction), at(end) - at(vertex))
    axes.set_aspect("equal")
    axes.margins(0.08)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    save(figure, ROOT / "docs" / "andrews_angles.png")


def _turned(mechanism: Any, q: np.ndarray, body: str | None, direction: tuple[float, float]) -> np.ndarray:
    angle = 0.0 if body is None else float(mechanism.values({("angle", body)}, q)["angle", body][0])
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]]) @ direction


def _angle(axes: Any, symbol: str, vertex: np.ndarray, reference: np.ndarray, way: np.ndarray) -> None:
    """Draw an arc with an arrow from the reference direction (dashed) to a link."""
    radius = RADIUS.get(symbol, 9.0)
    first = np.arctan2(reference[1], reference[0])
    turn = (np.arctan2(way[1], way[0]) - first) % (2 * np.pi)
    if symbol in "ΦΩ":  # these change their signs; β and Θ pass all turns
        turn -= 2 * np.pi * (turn > np.pi)
    line = np.array([vertex, vertex + LINE * radius * reference])
    axes.plot(*line.T, color=ORANGE, lw=1.0, ls="--", zorder=2)
    arc = first + np.linspace(0.0, turn, 40)
    places = vertex[:, None] + radius * np.array([np.cos(arc), np.sin(arc)])
    axes.plot(*places[:, :-3], color=ORANGE, lw=1.3, zorder=2)
    arrow = {"arrowstyle": "-|>", "color": ORANGE, "lw": 1.3, "mutation_scale": 10}
    axes.annotate("", places[:, -1], places[:, -5], arrowprops=arrow)
    label = vertex + 1.35 * radius * np.array([np.cos(first + 0.5 * turn), np.sin(first + 0.5 * turn)])
    label = label + (np.array([-2.5, 1.5]) if symbol == "γ" else 0.0)  # beside the narrow angle
    axes.annotate(symbol, label, color=ORANGE, fontsize=15, ha="center", va="center")


if __name__ == "__main__":
    main()
