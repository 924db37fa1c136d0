"""Closest points and gaps against theory.

Quadratic edges with nodes on one parabola are that parabola, and displacements that are quadratic in the parabola's
parameter keep it one: there are no kinks between edges, and blended and own normals agree.
"""

import numpy as np
import pytest

from gearfe.gears.contact.flank import OFF_END, Projection, edge_nodes, edge_shapes, project
from gearfe.gears.contact.whole_gears.problem import nearest_places

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
    field = np.zeros_like(nodes)  # another quadratic on each body, for both displacement components
    for body in (slice(0, len(nodes) // 2), slice(len(nodes) // 2, None)):
        field[body] = np.stack([t[body] ** 0, t[body], t[body] ** 2], axis=1) @ rng.normal(size=(3, 2)) * 1e-3
    angles = np.repeat([0.3, -1.1], len(nodes) // 2)  # displacements are given in the axes of each body's tooth
    rotation = np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]).transpose(2, 0, 1)
    return {
        "rotation": rotation,
        "nodes": nodes,
        "slave_nodes": slave_nodes,
        "shapes": edge_shapes(xi)[0],
        "u": np.einsum("nji,nj->ni", rotation, field),
    }


def _project(scene: dict[str, np.ndarray], nodes: np.ndarray) -> Projection:
    half = len(nodes) // 2
    slave = np.einsum("qa,qai->qi", scene["shapes"], nodes[scene["slave_nodes"]])
    return onto(slave @ [1, 1j], nodes[:half] @ [1, 1j])


def onto(points: np.ndarray, nodes: np.ndarray) -> Projection:
    """Points projected onto one chain, both as complex numbers."""
    one = np.array([len(nodes) // 2]), np.zeros(len(points), dtype=np.int64)
    return project(points, nodes, *one, nearest_places(points, nodes))


def _moved(scene: dict[str, np.ndarray], step: float) -> Projection:
    return _project(scene, scene["nodes"] + step * np.einsum("nij,nj->ni", scene["rotation"], scene["u"]))


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
    np.testing.assert_allclose(slave @ [1, 1j] - p.gap * p.normal, foot @ [1, 1j], rtol=0, atol=1e-16)


def test_variation_of_the_gap(scene: dict[str, np.ndarray]) -> None:
    """n . (slave - master): what the contact forces are virtual work of."""
    p, moved = _project(scene, scene["nodes"]), np.einsum("nij,nj->ni", scene["rotation"], scene["u"])
    slave = np.einsum("qa,qai->qi", scene["shapes"], moved[scene["slave_nodes"]])
    master = np.einsum("qa,qai->qi", p.shapes, moved[p.edge[:, None] + np.arange(3)])
    gap = (p.normal.conj() * ((slave - master) @ [1, 1j])).real
    after, before = _moved(scene, STEP), _moved(scene, -STEP)
    np.testing.assert_allclose(gap, (after.gap - before.gap) / (2 * STEP), rtol=1e-8)


def test_gap_is_continuous_past_a_kinked_vertex_and_off_beyond_the_ends() -> None:
    nodes = np.array([[1.0, 0.0], [0.5, 0.0], [0.0, 0.0], [-0.5, -0.1], [-1.0, -0.2]])
    line = np.linspace(-0.6, 0.6, 241)
    points, nodes = line + 0.05j, nodes @ [1, 1j]
    p = onto(points, nodes)
    steps = np.abs(np.diff(points - p.gap * p.normal))
    assert np.max(np.abs(np.diff(p.gap))) < 0.3 * np.diff(line)[0]
    assert steps.max() < 3 * np.diff(line)[0]
    turn = np.abs(np.diff(p.normal))
    assert turn.max() < 0.05 * 0.2
    beyond = onto(np.array([1.2 + 0.1j, -1.3 + 0.1j]), nodes)
    assert (beyond.gap == OFF_END).all()
