"""Closest points: finite differences of gap, closest place and contact force, where theory says they are exact.

Quadratic edges with nodes on one parabola are that parabola, and displacements that are quadratic in the parabola's
parameter keep it one: there are no kinks between edges, blended and own normals agree, and the variations of the
docstring of `gearfe.contact.closest` are exact.
"""

import numpy as np
import pytest

from gearfe.contact.closest import OFF_END, Projection, Rows, chains_of, gap_rows, nearest_places, project
from gearfe.contact.exact_rows import ExactRows, exact_rows
from gearfe.contact.flank import edge_nodes, edge_shapes

EDGES = 4
STEP = 1e-5


def _chain(height: float, bend: float, direction: float) -> np.ndarray:
    """Nodes on y = height + bend t^2, t from -1 to 1, in mm-sized metres; t runs backwards for direction -1."""
    t = direction * np.linspace(-1.0, 1.0, 2 * EDGES + 1)
    return 1e-3 * np.stack([t, height + bend * t**2], axis=1)


@pytest.fixture
def scene() -> dict[str, np.ndarray]:
    """Master below (normal up), slave above it at a distance of about 0.1 mm; one point in the middle of each edge."""
    rng = np.random.default_rng(5)
    nodes = np.concatenate([_chain(0.0, 0.15, -1.0), _chain(0.08, 0.3, 1.0)])
    xi = np.array([0.3, 0.6, 0.2, 0.7])
    slave_nodes = len(nodes) // 2 + edge_nodes(np.arange(EDGES))
    t = np.concatenate([-np.linspace(-1, 1, 2 * EDGES + 1), np.linspace(-1, 1, 2 * EDGES + 1)])
    fields = []
    for _ in range(2):  # another quadratic on each body, for both displacement components
        part = np.zeros_like(nodes)
        for body in (slice(0, len(nodes) // 2), slice(len(nodes) // 2, None)):
            part[body] = np.stack([t[body] ** 0, t[body], t[body] ** 2], axis=1) @ rng.normal(size=(3, 2)) * 1e-3
        fields.append(part)
    angles = np.repeat([0.3, -1.1], len(nodes) // 2)  # displacements are given in the axes of each body's tooth
    rotation = np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]).transpose(2, 0, 1)
    fields = [np.einsum("nji,nj->ni", rotation, part) for part in fields]
    return {
        "rotation": rotation,
        "nodes": nodes,
        "slave_nodes": slave_nodes,
        "shapes": edge_shapes(xi)[0],
        "u": fields[0],
        "v": fields[1],
    }


def _project(scene: dict[str, np.ndarray], nodes: np.ndarray) -> Projection:
    half = len(nodes) // 2
    slave = np.einsum("qa,qai->qi", scene["shapes"], nodes[scene["slave_nodes"]])
    chains = chains_of(nodes[:half], np.array([EDGES]), np.zeros(len(slave), dtype=np.int64))
    return project(slave, chains, nearest_places(slave, nodes[:half]))


def _moved(scene: dict[str, np.ndarray], step: float) -> Projection:
    return _project(scene, scene["nodes"] + step * np.einsum("nij,nj->ni", scene["rotation"], scene["u"]))


def _rows(scene: dict[str, np.ndarray], p: Projection) -> Rows:
    return gap_rows(p, scene["slave_nodes"], scene["shapes"], scene["rotation"])


def _applied(coefficients: np.ndarray, rows: Rows, field: np.ndarray) -> np.ndarray:
    return np.einsum("qai,qai->q", coefficients, field[rows.nodes])


def test_closest_point_is_the_foot_of_the_normal(scene: dict[str, np.ndarray]) -> None:
    p = _project(scene, scene["nodes"])
    slave = np.einsum("qa,qai->qi", scene["shapes"], scene["nodes"][scene["slave_nodes"]])
    t = slave[:, 0] * 1e3  # foot of the normal on y = 0.15 t^2: x - t0 + 2 b t0 (y - b t0^2) ... = 0
    for _ in range(60):
        b = 0.15
        f = (t - slave[:, 0] * 1e3) + 2 * b * t * (b * t**2 - slave[:, 1] * 1e3)
        t = t - f / (1 + 2 * b * (b * t**2 - slave[:, 1] * 1e3) + 4 * b**2 * t**2)
    foot = 1e-3 * np.stack([t, 0.15 * t**2], axis=1)
    np.testing.assert_allclose(np.abs(p.gap), np.linalg.norm(slave - foot, axis=1), rtol=1e-12)
    np.testing.assert_allclose(slave - p.gap[:, None] * p.normal, foot, rtol=0, atol=1e-16)


def test_variation_of_the_gap(scene: dict[str, np.ndarray]) -> None:
    rows = _rows(scene, _project(scene, scene["nodes"]))
    after, before = _moved(scene, STEP), _moved(scene, -STEP)
    gap = _applied(rows.normal, rows, scene["u"])
    np.testing.assert_allclose(gap, (after.gap - before.gap) / (2 * STEP), rtol=1e-8)


def test_exact_variations_between_kinked_edges(scene: dict[str, np.ndarray]) -> None:
    """No parabola any more: vertices out of line, and displacements that turn every edge another way."""
    rng = np.random.default_rng(1)
    half = len(scene["nodes"]) // 2
    scene["nodes"][:half] += 2e-5 * rng.normal(size=(half, 2))
    scene["u"], scene["v"] = 1e-3 * rng.normal(size=(2, *scene["nodes"].shape))
    scene["slave_nodes"] = np.repeat(scene["slave_nodes"], 3, axis=0)
    scene["shapes"] = edge_shapes(np.tile([0.1, 0.5, 0.85], EDGES))[0]

    def at(step: float) -> tuple[Projection, ExactRows]:
        p, nodes = _moved(scene, step), scene["nodes"] + step * np.einsum("nij,nj->ni", scene["rotation"], scene["u"])
        edges = np.full(len(p.gap), EDGES)
        return p, exact_rows(p, edges, nodes, scene["slave_nodes"], scene["shapes"], scene["rotation"])

    def applied(name: str, rows: ExactRows, field: str) -> np.ndarray:
        return np.einsum("aiq,aqi->q", getattr(rows, name), scene[field][rows.nodes])

    step = 1e-6
    (p, rows), (after, rows_after), (before, rows_before) = at(0.0), at(step), at(-step)
    seen = p.gap < OFF_END
    assert seen.sum() > 8
    assert np.abs(rows.steep[seen] / rows.metric[seen]).max() > 0.1
    slide, turn = applied("slide", rows, "u"), applied("turn", rows, "u")
    gap = applied("normal", rows, "u") - rows.steep * slide
    force = (rows.bow * slide + turn) * (rows.metric * applied("slide", rows, "v") + p.gap * applied("turn", rows, "v"))
    force -= applied("lift", rows, "v") * slide
    change = applied("normal", rows_after, "v") - applied("normal", rows_before, "v")
    for exact, difference in ((gap, after.gap - before.gap), (slide, after.place - before.place), (force, change)):
        expected = difference[seen] / (2 * step)
        np.testing.assert_allclose(exact[seen], expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_gap_is_continuous_past_a_kinked_vertex_and_off_beyond_the_ends() -> None:
    nodes = np.array([[1.0, 0.0], [0.5, 0.0], [0.0, 0.0], [-0.5, -0.1], [-1.0, -0.2]])
    line = np.linspace(-0.6, 0.6, 241)
    points = np.stack([line, np.full_like(line, 0.05)], axis=1)
    chains = chains_of(nodes, np.array([2]), np.zeros(len(points), dtype=np.int64))
    p = project(points, chains, nearest_places(points, nodes))
    steps = np.linalg.norm(np.diff(points - p.gap[:, None] * p.normal, axis=0), axis=1)
    assert np.max(np.abs(np.diff(p.gap))) < 0.3 * np.diff(line)[0]
    assert steps.max() < 3 * np.diff(line)[0]
    turn = np.linalg.norm(np.diff(p.normal, axis=0), axis=1)
    assert turn.max() < 0.05 * 0.2
    beyond = project(np.array([[1.2, 0.1], [-1.3, 0.1]]), chains_of(nodes, np.array([2]), np.zeros(2, int)), np.ones(2))
    assert (beyond.gap == OFF_END).all()
