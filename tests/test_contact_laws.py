"""Nitsche's family with theta = 1, 0, -1 and the exact law, on the condensed route."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.sparse import coo_matrix, csc_matrix, diags_array
from scipy.sparse.linalg import splu

from gearfe.contact.compliance import GearBody, gear_body
from gearfe.contact.flank import normal_stress_rows
from gearfe.contact.laws import ContactLaw, Exact, Nitsche, Penalty, side_share
from gearfe.contact.multiplier import hats_on
from gearfe.contact.recovery import position_loads, sector_displacements
from gearfe.contact.scene import MeshingPair
from gearfe.contact.solver import Position, solve_position, solve_positions
from gearfe.elasticity import Plane, element_stiffness
from gearfe.errors import InputError
from gearfe.meshing.whole_gear import whole_gear

from .contact_cases import IRON, STEEL, WIDTH, gears, meshes

TWIST = math.radians(0.05)
SYMMETRIC, SKEW = Nitsche(20.0, theta=1), Nitsche(1.0, theta=-1)


@cache
def body(name: str, coarsen: float, gear: int, law: ContactLaw, plane: Plane = "strain") -> GearBody:
    mesh, material = meshes(name, coarsen)[gear], (STEEL, IRON)[gear]
    return gear_body(mesh, material, plane, WIDTH, with_stress=law.uses_stress, law=law, gear=gear)


@cache
def pair(name: str, coarsen: float, law: ContactLaw, plane: Plane = "strain") -> MeshingPair:
    pinion, wheel = (body(name, coarsen, gear, law, plane) for gear in (0, 1))
    return MeshingPair(pinion, wheel, gears(name).working_centre_distance, WIDTH, law)


def _unknowns(nodes: np.ndarray) -> np.ndarray:
    return (2 * np.asarray(nodes)[:, None] + np.arange(2)).ravel()


@pytest.mark.parametrize(("law", "gear"), [(SYMMETRIC, 0), (SKEW, 1), (Nitsche(3.0, "wheel", -1), 1)])
def test_stress_loads_on_a_whole_gear(law: Nitsche, gear: int) -> None:
    """(K - theta sum over all teeth of B^T W/gamma B) u = f + B^T z by a sparse solve on the whole gear: flank and
    surface stress of several teeth, and the recovered field."""
    found, material = body("sharp", 5.0, gear, law), (STEEL, IRON)[gear]
    whole = whole_gear(found.mesh)
    count = 2 * len(whole.points)
    blocks = element_stiffness(whole.points[whole.triangles], material, "strain", WIDTH)
    unknowns = (2 * whole.triangles[:, :, None] + np.arange(2)).reshape(len(whole.triangles), 12)
    rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
    stiffness = coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count)).tocsc()
    own, values = normal_stress_rows(found.mesh, material, "strain", 4)
    points = values.shape[0] * values.shape[1]
    gamma = law.gamma0 * material.youngs_modulus / found.flank.sizes
    term = (law.theta * side_share(law, gear) * WIDTH * found.flank.weights / gamma[:, None]).ravel()
    stress = []
    for tooth in range(found.teeth):
        angle = 2 * np.pi * tooth / found.teeth
        c, s = np.cos(angle), np.sin(angle)
        turned = values.reshape(*values.shape[:2], 6, 2) @ np.array([[c, s], [-s, c]])
        nodes = whole.numbers[tooth][own[:, ::2] // 2]
        place = 2 * nodes[:, None, :, None] + np.arange(2)
        point = np.arange(points).reshape(*values.shape[:2], 1, 1)
        point, place = np.broadcast_arrays(point, place)
        stress.append(coo_matrix((turned.ravel(), (point.ravel(), place.ravel())), shape=(points, count)).tocsc())
    for one in stress:
        stiffness = stiffness - one.T @ diags_array(term) @ one
    free = np.setdiff1d(np.arange(count), _unknowns(np.unique(whole.boundaries["bore"])))
    rng = np.random.default_rng(4)
    force, load = rng.normal(size=2 * len(found.flank.nodes)), 1e-4 * rng.normal(size=points)
    right = stress[0].T @ load
    right[_unknowns(whole.numbers[0][found.flank.nodes])] += force
    u = np.zeros(count)
    u[free] = splu(csc_matrix(stiffness)[free][:, free]).solve(right[free])
    loads = found.stress_loads
    assert loads is not None
    for tooth in (0, 1, found.teeth - 1):
        angle = 2 * np.pi * tooth / found.teeth
        c, s = np.cos(angle), np.sin(angle)
        local = u[_unknowns(whole.numbers[tooth])].reshape(-1, 2) @ np.array([[c, -s], [s, c]])
        field = sector_displacements(found, [({0: np.concatenate([force, load])}, tooth)])[:, :, 0]
        np.testing.assert_allclose(field, local, rtol=0, atol=1e-10 * np.abs(u).max())
        k = tooth if tooth < 2 else tooth - found.teeth
        moved = found.far.flank @ (found.far.driven[k] @ force + loads.driven[k] @ load)
        assert found.far.stress is not None
        assert found.stress_own is not None
        tension = found.far.stress @ (found.far.driven[k] @ force + loads.driven[k] @ load)
        if tooth == 0:
            moved = moved + found.own @ force + found.stress_own.T @ load
            tension = tension + found.stress_own @ force + loads.own @ load
        np.testing.assert_allclose(moved, local[found.flank.nodes].ravel(), rtol=0, atol=1e-10 * np.abs(u).max())
        expected = stress[tooth] @ u
        np.testing.assert_allclose(tension, expected, rtol=0, atol=1e-8 * np.abs(stress[0] @ u).max())
