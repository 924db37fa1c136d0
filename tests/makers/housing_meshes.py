"""Structured tetrahedral meshes for tests: boxes, and anything that a smooth map makes of a box."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

from gearfe.drivetrain.housing.model import Housing
from gearfe.fem.bodies.meshes import Tetrahedra
from gearfe.fem.bodies.surface import triangle_functions
from gearfe.fem.plane import Material
from gearfe.fem.solid import EDGES, SolidMatrices, maps, shape_functions
from tests.places import DATA

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


class FourPoint(Tetrahedra):
    """Tetrahedra of the second order whose mass is integrated with 4 points, as CalculiX and others do."""

    def assemble(self, material: Material) -> SolidMatrices:
        own, exact = shape_functions(10, 2), super().assemble(material)
        weights = material.density * maps(self.nodes, self.cells, own.slopes)[0] * own.weights
        mass = np.einsum("ap,bp,ep->eab", own.values, own.values, weights)
        at = (np.repeat(self.cells, 10, axis=1).ravel(), np.tile(self.cells, (1, 10)).ravel())
        return exact._replace(nodal_mass=sparse.csr_array((mass.ravel(), at), shape=exact.nodal_mass.shape))


def reference_housing(*, four_point: bool = False) -> Housing:
    """The stored mesh with its six bores (odd on the +y wall) and its clamped feet."""
    p = json.loads((DATA / "gearbox_housing.json").read_text(encoding="utf-8"))["params"]
    with np.load(DATA / "gearbox_housing_mesh.npz") as stored:
        nodes, tets = stored["points_p2"], stored["tets_p2"]
    inner, outer = p["yin"] / 2, p["yin"] / 2 + p["tw"] + p["hb"]
    bores = []
    for x, z in zip(p["xs"], p["zs"], strict=True):
        bores += [((x, 0.0, z), (0.0, 1.0, 0.0), p["rb"], side) for side in ((inner, outer), (-outer, -inner))]
    # the base's underside lies in the same plane as the bottoms of the feet, which stand outboard of its ends
    bottom = np.abs(nodes[:, 2] - (p["z0"] - p["tb"])) < 1e-9
    feet = bottom & ((nodes[:, 0] < p["x0"] + 1e-9) | (nodes[:, 0] > p["x1"] - 1e-9))
    made = Housing.from_arrays(nodes, tets, bores, feet, material=Material(p["E"], p["nu"], p["rho"]))
    return replace(made, mesh=FourPoint(made.mesh.nodes, made.mesh.cells)) if four_point else made


REFERENCE: dict[str, Any] = json.loads((DATA / "gearbox_housing.json").read_text())


def bent(points: np.ndarray) -> np.ndarray:
    x, y, z = points.T
    return np.column_stack([x + 0.05 * np.sin(3.0 * y), y + 0.04 * x * z, z + 0.03 * x**2])
