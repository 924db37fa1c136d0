"""Nitsche's family with theta = 1, 0, -1 and the exact law, on the condensed route."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.sparse import coo_matrix, csc_matrix, diags_array
from scipy.sparse.linalg import splu

from gearfe.contact.compliance import GearBody, gear_body
from gearfe.contact.flank import edge_shapes, gauss_rule, normal_stress_rows
from gearfe.contact.laws import ContactLaw, Exact, Nitsche, Penalty, law_text, side_share
from gearfe.contact.multiplier import hats_on
from gearfe.contact.recovery import flank_forces, sector_displacements
from gearfe.contact.scene import MeshingPair, assemble
from gearfe.contact.solver import Position, solve_position, solve_positions
from gearfe.elasticity import Plane, element_stiffness
from gearfe.errors import InputError
from gearfe.meshing.whole_gear import whole_gear
from gearfe.stiffness.curve import StiffnessCurve
from gearfe.stiffness.sweep import sweep_stiffness
from gearfe.verification.monolithic import solve_monolithic

from .contact_cases import IRON, STEEL, WIDTH, gears, meshes, oracle_law, whole

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


# ---- balance and derivatives ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [SYMMETRIC, Nitsche(1.0, "wheel", -1), Exact(), Penalty(sides="tip")], ids=law_text)
@pytest.mark.parametrize(("name", "angle", "twist"), [("reference", 9.0, 0.05), ("modified", 13.75, 0.3)])
def test_forces_and_torques_are_in_equilibrium(law: ContactLaw, name: str, angle: float, twist: float) -> None:
    """Stress loads have no resultant: the contact forces alone cancel, and T_wheel + T_pinion = a F_y."""
    two = pair(name, 4.0, law)
    found = solve_position(two, math.radians(angle), math.radians(twist))
    assert found.scene is not None
    assert found.forces is not None
    force = np.einsum("nij,nj->ni", found.scene.rotation, found.forces.reshape(-1, 2))
    on_wheel = force[found.scene.of_wheel].sum(axis=0)
    assert np.linalg.norm(force.sum(axis=0)) < 1e-12 * np.linalg.norm(on_wheel)
    lever = two.centre_distance * on_wheel[1]
    assert found.torque_wheel + found.torque_pinion == pytest.approx(lever, rel=1e-8)
    assert found.torque_wheel_reaction == pytest.approx(found.torque_wheel, rel=2e-3)


def _energy(two: MeshingPair, found: Position) -> float:
    """u K_theta u/2 + sum W p^2/(2 gamma) = (f u + z sigma)/2 + ..., of a law with theta = 1 (J)."""
    assert found.scene is not None
    assert found.forces is not None
    assert found.stress_loads is not None
    scene, f, z = assemble(two, found.scene.windows), found.forces, found.stress_loads
    displacement, stress = scene.compliance @ f + z @ scene.stress, scene.stress @ f + scene.stress_stress @ z
    pressure = z * scene.parameter / scene.weight
    return float(0.5 * (f @ displacement + z @ stress) + np.sum(scene.weight * pressure**2 / (2 * scene.parameter)))


def test_torque_of_the_symmetric_law_is_the_derivative_of_its_energy() -> None:
    """What is left are the kinks between edges, which the forces leave out: it falls with the element size."""
    step, errors = 1e-3 * TWIST, []
    for coarsen in (4.0, 2.0):
        two, off = pair("reference", coarsen, SYMMETRIC), []
        for angle in np.radians([4.0, 14.0]):
            before, here, after = (solve_position(two, angle, TWIST + s * step, tolerance=1e-12) for s in (-1, 0, 1))
            off.append((_energy(two, after) - _energy(two, before)) / (2 * step) / here.torque_wheel - 1)
        errors.append(np.linalg.norm(off))
    assert errors[0] < 1e-4
    assert errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize("law", [SYMMETRIC, SKEW, Exact()], ids=law_text)
@pytest.mark.parametrize(("name", "angle"), [("reference", 4.0), ("modified", 20.0)])
def test_tangent_is_the_derivative_of_the_torque(law: ContactLaw, name: str, angle: float) -> None:
    two, step = pair(name, 2.0, law), 1e-4 * TWIST
    after, here, before = (
        solve_position(two, math.radians(angle), TWIST + s * step, tolerance=1e-12) for s in (1, 0, -1)
    )
    difference = (after.torque_wheel - before.torque_wheel) / (2 * step)
    assert here.tangent == pytest.approx(difference, rel=1e-4)


# ---- the exact law and the distance of the others from it -----------------------------------------------------------


def _singular_values(count: int, space: str) -> np.ndarray:
    """Of int psi_i N_j on a line of `count` quadratic edges, in the L2 norms of both spaces."""
    xi, weight = gauss_rule(12)
    xi, weight = np.concatenate([0.5 * xi, 0.5 + 0.5 * xi]), np.tile(0.5 * weight, 2)
    edge, along = np.repeat(np.arange(count), len(xi)), np.tile(xi, count)
    rows = np.arange(len(edge))
    trace = np.zeros((len(edge), 2 * count + 1))
    trace[rows[:, None], 2 * edge[:, None] + np.arange(3)] = edge_shapes(along)[0]
    if space == "hats":
        hats = hats_on(edge, along)
        psi = hats.matrix(np.arange(2 * count + 1), rows)
        assert np.allclose(psi.sum(axis=1), 1)
        assert (psi >= 0).all()
    else:  # linear on each edge, not continuous
        psi = np.zeros((len(edge), 2 * count))
        psi[rows, 2 * edge], psi[rows, 2 * edge + 1] = 1 - along, along
    areas = np.tile(weight, count)[:, None]
    of_psi, of_trace = (np.linalg.cholesky(a.T @ (areas * a)) for a in (psi, trace))
    return np.linalg.svd(np.linalg.solve(of_psi, np.linalg.solve(of_trace, trace.T @ (areas * psi)).T))[1]


def test_multiplier_space_is_stable() -> None:
    """Inf-sup constant: the same for every number of edges; with discontinuous linear multipliers it runs to zero."""
    least = [_singular_values(n, "hats")[-1] for n in (4, 16, 64)]
    assert min(least) > 0.7
    assert least[2] == pytest.approx(least[1], rel=0.01)
    other = [_singular_values(n, "discontinuous")[-1] for n in (4, 16, 64)]
    assert other[2] < 0.3 * other[1] < 0.1 * other[0]


#: Away from the changes of the number of tooth pairs.
ON_PATH = np.radians([1.0, 3.0, 4.0, 6.0, 7.0, 12.0, 14.0, 16.0])


def _torques(coarsen: float, law: ContactLaw, angles: np.ndarray = ON_PATH, twist: float = TWIST) -> np.ndarray:
    found = solve_positions(pair("reference", coarsen, law), angles, twist)
    assert {p.status for p in found} == {"converged"}
    return np.array([p.torque_wheel for p in found])


def _apart(one: np.ndarray, two: np.ndarray) -> float:
    return float(np.sqrt(np.mean((one / two - 1) ** 2)))


@pytest.mark.parametrize("sizes", [(4.0, 2.0), pytest.param((4.0, 2.0, 1.0, 0.5), marks=pytest.mark.slow)])
def test_nitsche_and_exact_law_meet_under_refinement(sizes: tuple[float, ...]) -> None:
    """Faster than first order, and always nearer than the estimated error of the mesh (errors of order 1.5)."""
    distances = []
    for size in sizes:
        nitsche = _torques(size, Nitsche())
        distances.append(_apart(nitsche, _torques(size, Exact())))
        assert distances[-1] < _apart(_torques(1.6 * size, Nitsche()), nitsche) / (1.6**1.5 - 1)
    assert np.polyfit(np.log(sizes), np.log(distances), 1)[0] > 1.2


@pytest.mark.parametrize("angle", [4.0, 14.0])
def test_penalty_nears_the_exact_law_with_its_inverse_stiffness_down_to_a_plateau(angle: float) -> None:
    """Stiff penalty at points holds an edge at more places than it can move: not the exact law, for any stiffness."""
    at, coarsen = np.radians([angle]), 2.0
    exact = _torques(coarsen, Exact("pinion"), at)[0]
    stiffness = np.array([1e14, 3e14, 1e15, 3e15])
    softness = np.array([1 - _torques(coarsen, Penalty(k), at)[0] / exact for k in stiffness])
    slopes = np.diff(np.log(softness)) / np.diff(np.log(stiffness))
    assert slopes[-2:] == pytest.approx([-1, -1], abs=0.15)
    stiff = np.array([1 - _torques(coarsen, Penalty(k), at)[0] / exact for k in (1e18, 1e19)])
    assert stiff[1] == pytest.approx(stiff[0], rel=0.1)
    assert 1e-4 < abs(stiff[1]) < 3e-3


def test_theta_minus_one_holds_for_nine_decades_of_gamma() -> None:
    """Two places on the path, two where a sharp corner bears and the pressure is singular."""
    angles = np.radians([4.0, 14.0, 9.0, 17.0])
    exact = _torques(3.0, Exact(), angles)
    for decade in (-5, -3, -1, 1, 3, 4):
        off = np.abs(_torques(3.0, Nitsche(10.0**decade, theta=-1), angles) / exact - 1)
        assert off[:2].max() < 5e-3
        assert off[2:].max() < 2e-2


def test_a_corner_that_digs_in_is_integrated_and_not_cut() -> None:
    """0.5 deg, sharp tips: with multipliers on the gear whose tip bears, wherever that is."""
    angles = np.radians([0.0, 5.0, 10.0, 12.0, 15.0, 16.0])
    exact = _torques(2.0, Exact(), angles, math.radians(0.5))
    np.testing.assert_allclose(_torques(2.0, Nitsche(), angles, math.radians(0.5)), exact, rtol=4e-3)


# ---- what cannot be -------------------------------------------------------------------------------------------------


def test_bound_on_gamma_of_the_symmetric_law() -> None:
    """The bound that the error names (an eigenvalue) is where the factorisation of the stiffness begins to exist."""
    with pytest.raises(InputError, match=r"gamma0 = 0\.5: with theta = 1 it must be > ") as error:
        body("sharp", 5.0, 0, Nitsche(0.5, theta=1))
    bound = float(error.value.problem.split("> ")[1].split(" ")[0])
    body("sharp", 5.0, 0, Nitsche(1.01 * bound, theta=1))
    with pytest.raises(InputError, match="theta = 1"):
        body("sharp", 5.0, 0, Nitsche(0.99 * bound, theta=1))
    body("sharp", 5.0, 1, Nitsche(0.5, "pinion", 1))  # nothing is integrated on the wheel


def test_gears_of_another_law_are_refused() -> None:
    made = {law: [body("sharp", 5.0, g, law) for g in (0, 1)] for law in (Nitsche(), SKEW)}
    with pytest.raises(InputError, match="no terms of its theta"):
        MeshingPair(*made[Nitsche()], 0.03, WIDTH, SKEW)
    for law in (Nitsche(), SYMMETRIC, Exact(), Nitsche(1.0, "pinion", -1)):
        with pytest.raises(InputError, match="made for another"):
            MeshingPair(*made[SKEW], 0.03, WIDTH, law)
    with pytest.raises(InputError, match="made for another"):
        MeshingPair(*made[SKEW], 0.03, 0.5 * WIDTH, SKEW)
    with pytest.raises(ValueError, match="use position_loads"):
        flank_forces(made[SKEW][0], 0, (), np.zeros(0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Nitsche(theta=2), "theta = 2: must be 1, 0 or -1"),
        (lambda: Nitsche(-1.0), "gamma0 = -1.0: must be finite and > 0"),
        (lambda: Nitsche(sides="tip"), "sides = 'tip': must be one of both, pinion, wheel"),
        (lambda: Exact(sides="both"), "sides = 'both': must be one of tip, pinion, wheel"),
        (lambda: Penalty(math.nan), "stiffness = nan: must be finite"),
    ],
)
def test_laws_that_do_not_exist(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("law", [Exact(), SYMMETRIC], ids=law_text)
def test_the_curve_names_its_law(law: ContactLaw, tmp_path) -> None:
    curve = sweep_stiffness(gears("sharp"), twist=TWIST, angles=[0.1], law=law, coarsen=4.0)
    assert curve.contact_law == law_text(law)
    curve.to_csv(tmp_path / "curve.csv")
    assert StiffnessCurve.from_csv(tmp_path / "curve.csv").contact_law == curve.contact_law


# ---- the other route ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [SYMMETRIC, SKEW, Nitsche(1.0, "pinion", -1), Exact("pinion")], ids=law_text)
@pytest.mark.parametrize(("name", "angle"), [("sharp", 15.0), ("modified", 20.0)])
def test_monolithic_route_agrees(law: ContactLaw, name: str, angle: float) -> None:
    place = math.radians(angle), TWIST
    small = solve_position(pair(name, 5.0, law), *place, tolerance=1e-11)
    full = solve_monolithic(whole(name, 5.0, "strain"), oracle_law(law), *place)
    assert small.status == full.status == "converged"
    for quantity in ("torque_wheel", "torque_pinion", "torque_wheel_reaction"):
        assert getattr(full, quantity) == pytest.approx(getattr(small, quantity), rel=1e-8), quantity
