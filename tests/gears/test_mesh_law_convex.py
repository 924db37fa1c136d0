"""Pair forces of a mesh law are the only solution of their conditions, and settle from any initial forces."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.law import MeshLaw
from gearfe.gears.gearmesh.law_fit import Couple, PairForces, TouchCurve, fit_law
from gearfe.gears.gearmesh.law_make import _pair_forces as pair_forces
from gearfe.gears.gearmesh.law_make import coupling_curve
from gearfe.gears.gearmesh.law_store import load_law, save_law
from gearfe.gears.geometry.first_contact import ToothFlanks
from tests.makers.mesh_laws import couplings, hertzian_law, pair_energies, powers, times

#: 105 teeth on a wheel whose undercut leaves an edge, which meets the pinion's tip (case 66 of the campaign mesh_laws).
UNDERCUT = """
[pair]
module_mm = 0.635
pressure_angle_deg = 15.5
face_width_mm = 3.18
addendum = 1.08
dedendum = 1.3
rack_tip_radius = 0.214
pinion = {teeth = 105, bore_diameter_mm = 49.76, profile_shift = -0.343, tip_round_mm = 0.0498}
wheel = {teeth = 29, bore_diameter_mm = 4.275, profile_shift = -0.307}

[microgeometry]
torques_Nm = [1.84]
pinion = {profile_slope_um = 1.66}
"""


@pytest.fixture(scope="module")
def undercut(tmp_path_factory):
    path = tmp_path_factory.mktemp("undercut") / "job.toml"
    path.write_text(UNDERCUT, encoding="utf-8")
    return read_stiffness_job(path).elastic()


def test_an_edge_of_an_undercut_is_seen_between_the_points_of_the_search(undercut):
    """The least twist of 40,001 places of the pinion's flank, by the wheel's polar angle at their radii."""
    teeth = ToothFlanks(undercut.gears, undercut.deviations)
    pinion, wheel = teeth.faces[0], teeth.faces[-1]
    angles = undercut.gears.mesh_cycle * np.linspace(1.12, 1.16, 81)
    zero = np.zeros(len(angles), dtype=np.int64)
    found = teeth.first_contacts_of(np.arange(len(angles)), angles, zero)
    frames = teeth.frames(angles, zero, 0.0)
    mate = wheel.points(np.linspace(wheel.start, wheel.end, 200_001))
    order = np.argsort(np.abs(mate))
    points = pinion.points(np.linspace(0.9, 1.1, 40_001))
    for frame, twist in zip(frames, found.twist, strict=True):
        seen = points * np.exp(1j * frame[0]) - undercut.gears.working_centre_distance
        turned = np.angle(seen * np.exp(-1j * frame[1]))
        turned -= np.interp(np.abs(seen), np.abs(mate)[order], np.angle(mate)[order])
        inside = (np.abs(seen) >= np.abs(mate).min()) & (np.abs(seen) <= np.abs(mate).max())
        least = ((turned[inside] + math.pi) % (2 * math.pi) - math.pi).min()
        assert undercut.gears.wheel.base_radius * (twist - least) == pytest.approx(0.0, abs=1e-9)


def test_the_force_of_a_pair_is_that_of_all_stretches_of_its_flanks(undercut):
    """A pair that is loaded on its flank and on its edge counts once, with both forces."""
    pair = half_plane_pair(undercut)
    radius, cycle = pair.pair.wheel.base_radius, pair.pair.mesh_cycle
    angles = cycle * np.array([1.1800, 1.1836, 1.1907])
    met = pair.teeth.first_contacts(angles)
    first = np.full(len(angles), np.inf)
    np.minimum.at(first, met.position, met.twist)
    depth = np.array([1.5e-6, 1.5e-6, 0.83e-6])
    solved = solve_half_plane(pair, angles, first + depth / radius)
    contacts = solved.contacts
    pairs = set(zip(contacts.position.tolist(), contacts.pair.tolist(), strict=True))
    assert len(contacts.pair) > len(pairs)
    phases = cycle * np.linspace(-2.0, 2.0, 33)
    found = pair_forces(pair, solved, met, coupling_curve(pair, phases, 2e-6))
    assert len(found.force) == len(pairs)
    assert found.force.sum() * radius == pytest.approx(solved.torque_wheel.sum(), rel=1e-12)
    assert found.share.sum() == pytest.approx(len(angles), rel=1e-12)
    steady = found.force > 1.0
    assert np.ptp((found.approach / found.force)[steady]) < 0.5 * (found.approach / found.force)[steady].mean()


def steep_law(slots: int, couple: float, random: np.random.Generator) -> MeshLaw:
    """A law of one cell of the phase, whose compliances change up to tenfold from one force to the next (nm/N)."""
    forces = np.array([0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 200.0])
    energies = np.zeros((slots, 1, 6, 4, 5))
    for slot in range(slots):
        slope = 1e-9 * couple * (1.05 + 12.0 * random.uniform(0.0, 1.0, 7) ** 3)
        slope[-1] = slope[-2]
        energy = approach = 0.0
        for part, h in enumerate(np.diff(forces)):  # Lambda quadratic: its slope is linear
            c = [energy, approach, 0.5 * slope[part], (slope[part + 1] - slope[part]) / (6.0 * h), 0.0]
            energies[slot, 0, part, 0] = c
            energy = float(np.polyval(c[::-1], h))
            approach += 0.5 * h * (slope[part] + slope[part + 1])
    coupling = np.zeros((slots - 1, slots - 1, 1, 4))
    for apart in range(1, slots):
        coupling[apart - 1, : slots - apart, 0, 0] = 1e-9 * couple * 0.93**apart
    touch = np.zeros((slots, 1, 4))
    touch[:, 0, 0] = 1e-7 * random.uniform(0.0, 3.0, slots)
    return MeshLaw(np.array([0.0, 0.1]), forces, touch, energies, coupling, (0.03, 0.04), 0.0, 1e-4)


@pytest.mark.parametrize("slots", [2, 3, 5])
def test_pair_forces_settle_wherever_the_energy_is_convex(slots):
    """Karush, Kuhn and Tucker: gaps of loaded pairs are closed, others open; from zero and from random forces."""
    random = np.random.default_rng(slots)
    for _ in range(40):
        law = steep_law(slots, 9.0, random)
        approaches = 1e-6 * np.exp(random.uniform(-5.0, 2.5, 200))
        begin = np.exp(random.uniform(-3.0, 5.0, (200, slots))) * (random.uniform(0.0, 1.0, (200, slots)) < 0.7)
        found, again = law(np.zeros(200), approaches), law(np.zeros(200), approaches, begin=begin)
        force = found.pair_forces
        assert again.pair_forces == pytest.approx(force, rel=1e-9, abs=1e-9)
        _, cell, z = law.locate(np.zeros(200))
        gap = approaches[:, None] - powers(law.touch[:, cell], z[None])[0].T
        made = pair_energies(law, cell, z, force)
        lacks = made.approach + times(couplings(law, cell, z)[0], force) - gap
        assert np.abs(lacks[force > 0.0]).max() < 1e-9 * 1e-6
        assert lacks[force == 0.0].min(initial=0.0) > -1e-15
        energy = (force * (gap - 0.5 * times(couplings(law, cell, z)[0], force)) - made.energy).sum(axis=1)
        assert found.energy == pytest.approx(energy, rel=1e-9)


def test_a_fitted_law_has_unique_pair_forces_whatever_it_is_made_from():
    """Forces of pairs that yield less and less up to nothing: J = diag(dLambda/dF) + C stays positive definite, at all
    forces up to beyond those of the law.
    """
    angle = np.linspace(-0.3, 0.33, 25)
    psi, force = np.meshgrid(np.linspace(-0.3, 0.33, 60), np.geomspace(1.0, 1e3, 9), indexing="ij")
    approach = 1e-8 * force * (1.0 - 0.9 * force / 1e3)
    found = PairForces(psi.ravel(), force.ravel(), np.ones(psi.size), approach.ravel())
    couple = Couple(np.linspace(-0.4, 0.4, 9), np.full(9, 5e-9))
    touch = TouchCurve(angle, 1e-4 * angle**2, 2e-4 * angle)
    law = fit_law(found, touch, [couple], cells=12, hertz=3e-10, base_radii=(0.02, 0.03), reach=1e-5, force=1e3)
    cells = np.arange(12)
    for z in np.linspace(0.0, 1.0, 5)[:, None] * np.diff(law.nodes):
        for pair_force in np.array([0.0, 1.0, 30.0, 300.0, 999.0, 1500.0, 1e5]):
            made = pair_energies(law, cells, z, np.full((12, law.slots), pair_force))
            J = couplings(law, cells, z)[0] + made.slope[:, :, None] * np.eye(law.slots)
            assert np.linalg.eigvalsh(J).min() > 0.0
    assert np.isfinite(law(angle, np.full(25, 1e-2)).force).all()  # far beyond its range


def test_a_file_with_a_law_that_is_not_convex_is_refused(tmp_path):
    law = hertzian_law()
    assert law.convex
    save_law(law, tmp_path / "law.npz")
    assert load_law(tmp_path / "law.npz").convex
    save_law(replace(law, coupling=10.0 * law.coupling), tmp_path / "law.npz")
    with pytest.raises(InputError, match="not unique"):
        load_law(tmp_path / "law.npz")


def test_without_a_finite_angle_or_approach_there_is_no_force():
    forces = hertzian_law()(np.array([math.nan, 0.0, 0.0]), np.array([1e-5, math.nan, 1e-5])).force
    assert np.isnan(forces).tolist() == [True, True, False]
