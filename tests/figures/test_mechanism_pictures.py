"""Pictures of mechanisms: paths from the solution between output times, colours of displacements and velocities."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.figures.mechanism import draw_animation, draw_figures
from gearfe.figures.mechanism_field import draw_field
from gearfe.figures.mechanism_scene import draw_paths, drawn_states, frame
from gearfe.figures.style import new_figure
from gearfe.mechanisms.model import Mechanism, make_mechanism
from gearfe.mechanisms.results import Results, reference_table
from gearfe.mechanisms.solve import solve
from tests.places import GEOMETRY

ANGLE, RATE = 0.3, 2.0


def crank(turns: float, step: float, colour: str | None = None, outputs: Any = ()) -> tuple[Mechanism, Results]:
    """A crank OA of 1.5 m that turns steadily."""
    raw: dict[str, Any] = {
        "run": {"end_s": turns * 2.0 * math.pi / RATE, "step_s": step * 2.0 * math.pi / RATE},
        "bodies": {
            "crank": {
                "mass_kg": 1.0,
                "inertia_kg_m2": 0.1,
                "centre_m": [0.4, 0.2],
                "angle_rad": ANGLE,
                "points_m": {"O": [0.0, 0.0], "A": [1.5, 0.0]},
            }
        },
        "joints": {
            "O": {"type": "hinge", "body": "crank"},
            "drive": {"type": "prescribed", "body": "crank", "coordinate": "rate", "motion_rad_per_s": RATE},
        },
        "paths": [{"body": "crank", "point": "A"}, {"body": "crank", "point": [0.0, 0.7]}],
        "figure": {} if colour is None else {"colour": colour},
        "outputs": list(outputs),
    }
    mechanism = make_mechanism(build(MechanismFile, raw, ""))
    return mechanism, solve(mechanism).results


@pytest.mark.parametrize("step", [0.5, 1.0, 0.26])
def test_paths_follow_the_solution_between_output_times(step: float) -> None:
    """Chords of circles: their middles are within 1e-3 of the picture of the circle, whatever the output times are."""
    mechanism, results = crank(2.0, step)
    states = drawn_states(mechanism, results.trajectory)
    axes = new_figure(5, 5).subplots()
    draw_paths(axes, mechanism, states)
    for line, radius in zip(axes.lines, (1.5, 0.7), strict=True):
        z = line.get_xdata() + 1j * line.get_ydata()
        assert np.abs(np.abs(z) - radius).max() < 1e-8
        assert np.abs(np.abs(0.5 * (z[1:] + z[:-1])) - radius).max() < 1e-3 * 3.0
        turned = np.abs(np.diff(np.unwrap(np.angle(z)))).sum()
        assert turned == pytest.approx(4.0 * math.pi, rel=1e-6)
    frame(axes, mechanism, states)
    assert axes.get_ylim()[0] < -1.5 + 3e-3
    assert axes.get_ylim()[1] > 1.5 - 3e-3


@pytest.mark.parametrize("kind", ["displacement", "velocity"])
def test_colours_are_displacements_and_velocities(kind: str) -> None:
    """A point at the radius r: 2 r sin(turn/2) from the start, and r w; arrows across the crank, the longest at A."""
    mechanism, results = crank(0.2, 0.05, kind)
    time = 0.5
    axes = new_figure(5, 5).subplots()
    frame(axes, mechanism, results.trajectory.q)
    draw_field(axes, mechanism, results.trajectory, time, names=True)
    edges = next(c for c in axes.collections if isinstance(c, LineCollection))
    middles = np.array([path.vertices.mean(axis=0) for path in edges.get_paths()])
    radius = np.hypot(*middles.T)
    factor = RATE if kind == "velocity" else 2.0 * math.sin(0.5 * RATE * time)
    np.testing.assert_allclose(edges.get_array(), factor * radius, rtol=1e-6)
    assert edges.norm.vmax == pytest.approx(1.5 * factor, rel=1e-6)
    arrows = [c for c in axes.collections if isinstance(c, Quiver)]
    assert len(arrows) == (kind == "velocity")
    if arrows:
        turn = ANGLE + RATE * time
        np.testing.assert_allclose([arrows[0].U[1], arrows[0].V[1]],
                                   [-1.5 * RATE * math.sin(turn), 1.5 * RATE * math.cos(turn)], rtol=1e-6)  # fmt: skip


@pytest.mark.parametrize("kind", ["displacement", "velocity"])
def test_pictures_of_links_of_every_kind_are_drawn(kind: str, tmp_path: Path) -> None:
    """Rigid bodies, beams and finite elements in colours, with paths and the animation."""
    for name, end in (("elastic_slider_crank", 0.01), ("elastic_coupler", 0.01)):
        raw = tomllib.loads((GEOMETRY / f"{name}.toml").read_text(encoding="utf-8"))
        raw["run"] |= {"end_s": end, "step_s": 0.005, "frames": 2}
        raw["figure"] = {"colour": kind, "magnification": 5.0}
        mechanism = make_mechanism(build(MechanismFile, raw, ""), GEOMETRY / f"{name}.toml")
        results = solve(mechanism).results
        draw_figures(tmp_path, mechanism, results)
        draw_animation(tmp_path, mechanism, results.trajectory)
        assert {path.name for path in tmp_path.iterdir()} >= {"picture.png", "animation.gif"}


@pytest.mark.parametrize(
    ("name", "curves", "colour"),
    [
        ("andrews", {"beta_wrapped_rad", "theta_wrapped_rad", "gamma_rad", "phi_rad", "delta_rad", "omega_rad",
                     "epsilon_rad"}, "displacement"),
        ("slider_crank", {"a_x_A_m_per_s2", "v_B_m_per_s", "crank_angle_rad", "x_B_m"}, "velocity"),
    ],
)  # fmt: skip
def test_examples_show_what_the_published_ones_do_beside_the_reference(
    name: str, curves: set[str], colour: str
) -> None:
    """All seven angles; the acceleration and velocities, within 1e-7 of their ranges of the reference."""
    raw = tomllib.loads((GEOMETRY / f"{name}.toml").read_text(encoding="utf-8"))
    assert curves <= set(raw["figure"]["curves"])
    assert curves <= raw["figure"]["reference_columns"].keys()
    assert raw["figure"]["colour"] == colour
    mechanism = make_mechanism(build(MechanismFile, raw, ""), GEOMETRY / f"{name}.toml")
    table = reference_table(mechanism)
    assert table is not None
    results = solve(mechanism).results
    at = np.searchsorted(results.trajectory.time, table["t"] - 1e-9)
    periods = {output.name: output.wrap for output in mechanism.file.outputs}
    for output, column in mechanism.file.figure.reference_columns.items():
        off = results.outputs[output][at] - table[column]
        if periods[output]:
            off = np.mod(off + 0.5 * periods[output], periods[output]) - 0.5 * periods[output]
        assert np.abs(off).max() <= 1e-6 * np.ptp(table[column])


@pytest.mark.parametrize(
    ("figure", "text"),
    [
        ({"colour": "speed"}, r"figure\.colour = 'speed'"),
        ({"reference_columns": {"a_rad": "b"}}, "says nothing without reference"),
        ({"reference": "t.csv"}, "draws nothing without reference_columns"),
        ({"curves": ["a_rad"], "reference": "t.csv", "reference_columns": {"b_rad": "b"}}, "b_rad"),
    ],
)
def test_figures_that_would_say_nothing(figure: dict[str, Any], text: str) -> None:
    raw = tomllib.loads((GEOMETRY / "slider_crank.toml").read_text(encoding="utf-8"))
    raw["figure"] = figure
    with pytest.raises(InputError, match=text):
        build(MechanismFile, raw, "")


def test_a_path_of_the_ground_is_refused() -> None:
    raw = tomllib.loads((GEOMETRY / "slider_crank.toml").read_text(encoding="utf-8"))
    raw["paths"] = [{"body": "ground", "point": "O"}]
    with pytest.raises(InputError, match=r"paths\[0\]\.body"):
        build(MechanismFile, raw, "")


@pytest.mark.parametrize("step", [1.0, 0.3, 0.01])
def test_curves_follow_the_solution_between_output_times(step: float, tmp_path: Path, monkeypatch: Any) -> None:
    """x of the crank's end is a cosine, whatever the output times are; no line joins the turns of a wrapped angle."""
    outputs = [{"name": "x", "value": "x(crank.A)"}, {"name": "turn", "value": "angle(crank)", "wrap": 2.0 * math.pi}]
    mechanism, results = crank(2.0, step, outputs=outputs)
    figures = []
    monkeypatch.setattr("gearfe.figures.mechanism.save", lambda figure, _: figures.append(figure))
    draw_figures(tmp_path, mechanism, results)
    x, turn = (axes.lines[0] for axes in figures[0].axes)
    time, value = x.get_xdata(), x.get_ydata()
    middle = 0.5 * (time[1:] + time[:-1])
    chord = 0.5 * (value[1:] + value[:-1])
    assert np.abs(chord - 1.5 * np.cos(ANGLE + RATE * middle)).max() < 1e-3
    steps = np.diff(turn.get_ydata())
    assert np.isnan(steps).sum() == 4  # on both sides of the two ends of turns
    assert np.nanmin(steps) > 0.0
