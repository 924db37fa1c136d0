"""The finite-strain share of the torque: its formula against the energy, its effect against a finite-strain program."""

from __future__ import annotations

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.fem.plane import Material, physical_gradients, triangle_shapes
from gearfe.gears.contact.compliance import MeshingPair, finite_strain_shares, gear_body, sector_displacements
from gearfe.gears.contact.laws import Nitsche, PairModel
from gearfe.gears.contact.position import Positions
from gearfe.gears.gearmesh.positions import at_torques, at_twists, position_solver
from gearfe.gears.gearmesh.sweep import sweep_stiffness
from gearfe.gears.geometry.pair import Gear, GearPair
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from tests.makers.solving import solve_position, solve_positions
from tests.places import DATA

REFERENCE = DATA / "gear_pair_20_30.csv"


def meshing_pair(coarsen: float) -> MeshingPair:
    """The 20/30 pair of the reference data: sharp tips, bores of 0.35 times the pitch diameter, 10 mm wide."""
    form = {"module": 2.5e-3, "pressure_angle": math.radians(25), "face_width": 10e-3}
    pinion = Gear(teeth=20, bore_diameter=17.5e-3, **form)
    wheel = Gear(teeth=30, bore_diameter=26.25e-3, **form)
    pair = GearPair(pinion, wheel)
    bodies = [
        gear_body(sector_mesh(gear, recipe, cache=False), Material(), "strain", gear.face_width)
        for gear, recipe in zip((pinion, wheel), sector_recipes(pair, coarsen=coarsen), strict=True)
    ]
    return MeshingPair(pair, bodies[0], bodies[1], PairModel(law=Nitsche()))


def extra_energy(pair: MeshingPair, position: Positions) -> float:
    """First-order part of W_SVK - W_linear: the integral of sigma:eta over both gears (J), full tensors."""
    total = 0.0
    for gear, body in enumerate(pair.bodies):
        every = np.arange(body.teeth)
        fields = sector_displacements(body, position.loads[gear], np.zeros_like(every), every)
        r, s = np.array([1, 4, 1]) / 6, np.array([1, 1, 4]) / 6
        triangles = body.mesh.triangles
        gradients, det = physical_gradients(body.mesh.points[triangles], triangle_shapes(r, s)[1])
        h = np.einsum("maic,mqaj->mqcij", fields[triangles], gradients)
        strain = 0.5 * (h + np.swapaxes(h, -1, -2))
        eta = 0.5 * np.einsum("mqcki,mqckj->mqcij", h, h)
        lam, mu = body.material.lame(body.plane)

        stress = 2.0 * mu * strain + lam * np.trace(strain, axis1=-2, axis2=-1)[..., None, None] * np.eye(2)
        total += body.thickness * np.einsum("mq,mqcij,mqcij->", det / 6, stress, eta)
    return total


@pytest.mark.parametrize("angle_deg", [4.0, 13.0])
def test_share_is_the_rate_of_the_extra_energy(angle_deg: float) -> None:
    """Delta T is the rate of the first-order energy, by central differences, with every sector taken along."""
    pair = meshing_pair(coarsen=2.0)
    angle, twist = math.radians(angle_deg), math.radians(0.05)
    step = 0.02 * twist
    energies = [extra_energy(pair, solve_position(pair, angle, twist + sign * step)) for sign in (-1, 1)]
    found = solve_positions(pair, [angle], twist)
    share = finite_strain_shares(pair, found, neighbours=15)
    assert share * found.torque_wheel == pytest.approx((energies[1] - energies[0]) / (2 * step), rel=3e-3)


def test_few_neighbours_suffice() -> None:
    """The effect is cubic in the strain: the loaded teeth and their neighbours carry all but a few parts in 1e5."""
    pair = meshing_pair(coarsen=2.0)
    found = solve_positions(pair, [math.radians(13)], math.radians(0.05))
    near = finite_strain_shares(pair, found)
    assert near == pytest.approx(finite_strain_shares(pair, found, neighbours=15), abs=5e-5)


def test_share_has_a_limit_where_the_volume_is_kept() -> None:
    """Elasticity has a limit for nu -> 0.5, from which it differs by the order of 1 - 2 nu; meshes add some %.

    With the energy's second-order term the share at 0.4999 has the other sign and 15 times the amount.
    """
    shares = []
    for nu in (0.499, 0.4999):
        rubber, pair = Material(poisson_ratio=nu), replace(meshing_pair(coarsen=2.0), model=PairModel())
        pinion, wheel = (gear_body(body.mesh, rubber, "strain", body.thickness) for body in pair.bodies)
        pair = replace(pair, pinion=pinion, wheel=wheel)
        shares.append(finite_strain_shares(pair, solve_positions(pair, [math.radians(4)], math.radians(0.05)))[0])
    assert shares[1] == pytest.approx(shares[0], rel=0.1)


@pytest.mark.parametrize("law", ["half_plane", "nitsche"])
def test_curves_take_the_share_of_every_position(law: str) -> None:
    """At pair changes, too, where the share jumps with the load sharing: 0.5 deg, as the energy's rate has it there."""
    pair = meshing_pair(coarsen=2.0)
    if law == "half_plane":
        pair = replace(pair, model=PairModel())
    angles, twist = np.linspace(0, pair.gears.mesh_cycle, 25)[:-1], math.radians(0.5)
    shares = finite_strain_shares(pair, solve_positions(pair, angles, twist))
    small, finite = (
        sweep_stiffness(pair.gears, elastic=pair, twist=twist, angles=angles, kinematics=kinematics)
        for kinematics in ("small", "finite")
    )
    solved = small.status == "converged"
    assert solved.sum() > 20
    np.testing.assert_allclose((finite.torque_wheel / small.torque_wheel - 1)[solved], shares[solved], atol=1e-9)


@pytest.mark.parametrize("torque", [100.0, 1000.0])
def test_torques_with_finite_strain_are_met(torque: float) -> None:
    """The twist found for a torque carries it, but for what is of the second order in the share."""
    pair = meshing_pair(coarsen=2.0)
    pair = replace(pair, model=PairModel())
    solver, angles = position_solver(pair), np.linspace(0, pair.gears.mesh_cycle, 7)[:-1]
    found = at_torques(solver, angles, np.full(6, torque), finite=True)
    share = finite_strain_shares(pair, solve_positions(pair, angles, found.twist))
    again = at_twists(solver, angles, found.twist, finite=True)
    assert np.abs(again.torque_wheel / torque - 1).max() < max(1e-7, float((share**2).max()))


def test_energy_of_a_given_torque_is_that_of_its_twist() -> None:
    pair = replace(meshing_pair(coarsen=2.0), model=PairModel())
    solver, angles = position_solver(pair), np.linspace(0, pair.gears.mesh_cycle, 7)[:-1]
    found = at_torques(solver, angles, np.full(6, 100.0))
    np.testing.assert_allclose(found.energy, at_twists(solver, angles, found.twist).energy, rtol=1e-7)


def test_against_a_finite_strain_program() -> None:
    """On the path, small strain plus its share meets the finite-strain curve of GetFEM within its trust and our mesh's
    0.1 %, at 0.05 deg and at ten times that load, where the share alone is ten times larger (about 1 %)."""
    pair = meshing_pair(coarsen=1.0)
    rows = [row for row in csv.DictReader(REFERENCE.open()) if row["plane_state"] == "plane_strain"]
    for twist_deg, angles in ((0.05, (2.0, 4.0, 6.0, 12.0, 13.0, 15.0)), (0.5, (4.0, 6.0))):
        expected = {float(r["pinion_angle_deg"]): r for r in rows if float(r["twist_deg"]) == twist_deg}
        twist = math.radians(twist_deg)
        positions = solve_positions(pair, np.radians(angles), twist)
        shares = finite_strain_shares(pair, positions)
        for angle, position, share in zip(angles, positions, shares, strict=True):
            stiffness = position.torque_wheel * (1 + share) / twist / pair.gears.wheel.base_radius**2
            trust = float(expected[angle]["trust_percent"]) / 100
            assert stiffness == pytest.approx(float(expected[angle]["k_mesh_N_per_m"]), rel=trust + 1e-3)
