"""Structured tetrahedral meshes for tests: boxes, and anything that a smooth map makes of a box."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearfe.housing.surface import triangle_functions
from gearfe.solid import EDGES

#: Six tetrahedra that fill a cube, positive volume; corner k has the coordinates of k's three bits (x, y, z).
_KUHN = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])


def box(
    cells: tuple[int, int, int],
    size: tuple[float, float, float],
    *,
    order: int = 2,
    mapped: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and tetrahedra of the box 0..size; `mapped` takes all (n, 3) points, midside nodes too, to their places."""
    nx, ny, nz = cells
    grid = np.stack(
        np.meshgrid(*(np.linspace(0, s, c + 1) for s, c in zip(size, cells, strict=True)), indexing="ij"), -1
    )
    nodes = grid.reshape(-1, 3)

    def number(i: np.ndarray, j: np.ndarray, k: np.ndarray) -> np.ndarray:
        return (i * (ny + 1) + j) * (nz + 1) + k

    i, j, k = (a.ravel() for a in np.meshgrid(range(nx), range(ny), range(nz), indexing="ij"))
    corners = np.stack([number(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2 & 1)) for b in range(8)], axis=1)
    tets = corners[:, _KUHN].reshape(-1, 4)
    if order == 2:
        nodes, tets = second_order(nodes, tets)
    return (nodes if mapped is None else mapped(nodes)), tets


def second_order(nodes: np.ndarray, tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Straight ten-node elements from four-node ones."""
    edges = np.sort(tets[:, EDGES].reshape(-1, 2), axis=1)
    unique, place = np.unique(edges, axis=0, return_inverse=True)
    middles = nodes[unique].mean(axis=1)
    return np.concatenate([nodes, middles]), np.concatenate([tets, len(nodes) + place.reshape(-1, 6)], axis=1)


def surface_area(nodes: np.ndarray, faces: np.ndarray) -> float:
    """Area of faces (m2)."""
    return float(np.linalg.norm(triangle_functions(faces.shape[1]).areas(nodes[faces]), axis=2).sum())
