"""The gap beside a contact of rigid flanks, and small loads at edges: against the curves and against meshes."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfe.contact.hertz import LocalContact
from gearfe.gear.pair import GearPair
from gearfe.gear.touching import Flanks, Touching
from gearfe.stiffness.job import read_stiffness_job
from gearfe.stiffness.local_gap import local_contact
from gearfe.stiffness.routes import Router
from gearfe.stiffness.sweep import elastic_pair

from .gears import pair

KEPT = Path(__file__).parent / "test_stress_cases" / "gears"


def job_named(name: str) -> Any:
    return read_stiffness_job(KEPT / f"{name}.toml")


def beside(flanks: Flanks, touching: Touching, k: int, *, swapped: bool = False) -> LocalContact:
    """Local contact between unlike materials, on elements so large that nothing is told from curvatures alone."""
    shares = (6.1e-12, 4.3e-12) if swapped else (4.3e-12, 6.1e-12)
    made: Any = SimpleNamespace(contact_compliances=shares)
    return local_contact(flanks.pair, made, flanks, touching, k, 1.0)


def angles_of(gears: GearPair, count: int) -> Any:
    return (np.arange(count) + 0.05) / count * gears.mesh_cycle


NAMES = ["tip_beside_an_undercut", "undercut_edge_bears", "tip_along_a_root", "light_touch_beside_a_round",
         "jump_of_the_moment", "kink_of_a_linear_relief", "sharp_tip_well_resolved"]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_both_gears_see_the_same_local_contact(name: str) -> None:
    """Edges, and the answer to a load, beside tips, rounds, undercuts and kinks of either gear."""
    gears = job_named(name).pair
    flanks, mirrored = Flanks(gears), Flanks(GearPair(gears.wheel, gears.pinion, gears.centre_distance))
    touching, seen = flanks.touching(angles_of(gears, 20)), 0
    for k in np.flatnonzero(touching.twist < touching.twist.min() + 0.01):
        number = -1 - int(touching.pair[k])
        turned = flanks.turns(touching, k)[1] - math.pi - number * mirrored.pair.mesh_cycle
        other = mirrored.touching(np.array([(turned + math.pi) % (2 * math.pi) - math.pi]))
        (j,) = np.flatnonzero(other.pair == number)
        mine, theirs = beside(flanks, touching, k), beside(mirrored, other, j, swapped=True)
        here = sorted((e.place, e.factor, e.body) for e in mine.edges)
        there = sorted((-e.place, e.factor, 1 - e.body) for e in theirs.edges)
        np.testing.assert_allclose(here, there, rtol=1e-3, atol=1e-9)
        one, two = mine.under(3e4), theirs.under(3e4)
        seen += not one.smooth or one.moment != 0.0
        assert one.approach == pytest.approx(two.approach, rel=3e-4)
        assert abs(one.moment + two.moment) < 3e-3 * 3e4 * one.width
    assert seen > 0


@pytest.mark.parametrize("name", NAMES)
def test_the_gap_is_that_of_the_curves(name: str) -> None:
    """Against both flanks as dense polylines in the axes of the common tangent and normal."""
    gears = job_named(name).pair
    flanks = Flanks(gears)
    touching, seen = flanks.touching(angles_of(gears, 20)), 0
    for k in np.flatnonzero(touching.twist < touching.twist.min() + 0.01):
        turns = flanks.turns(touching, k)
        lines = []
        for g, face in enumerate(flanks.faces):
            near = touching.place[k, g] + np.array([[-1.0], [1.0]]) * np.geomspace(1e-7, 0.3, 2000)
            u = np.unique(np.clip(np.concatenate([near.ravel(), np.linspace(0, face.end, 4001)]), 0, face.end))
            placed = face.points(u) * np.exp(1j * turns[g]) + g * gears.working_centre_distance
            seen_from = (placed - touching.point[k]) / touching.normal[k]
            order = np.argsort(-seen_from.imag)
            lines.append((-seen_from.imag[order], seen_from.real[order]))
        contact = beside(flanks, touching, k)
        x = contact.x[
            (np.abs(contact.x) > 1e-4 * gears.pinion.module) & (np.abs(contact.x) < 0.1 * gears.pinion.module)
        ]
        for line in lines:
            x = x[(x > line[0][0]) & (x < line[0][-1])]
        gap = np.interp(x, contact.x, contact.gap)
        seen += len(x)
        np.testing.assert_allclose(gap, np.interp(x, *lines[1]) - np.interp(x, *lines[0]), rtol=1e-3, atol=1e-11)
    assert seen > 400


def test_the_gap_scales_with_the_gears() -> None:
    """Rounding of the places of a gear of many metres costs no places of the gap."""
    found = []
    for module in (2.5e-3, 2.5):
        flanks = Flanks(pair(20, 30, module=module, width=4 * module))
        touching = flanks.touching(np.array([math.radians(8.2)]))
        k = int(np.argmax(touching.place[:, 0] * (touching.twist < touching.twist.min() + 0.01)))
        contact = beside(flanks, touching, k)
        found.append(np.stack([contact.x, contact.gap]) / module)
    assert found[0].shape == found[1].shape
    far = found[0][1] > 1e-7
    np.testing.assert_allclose(found[1][:, far], found[0][:, far], rtol=1e-6)


@pytest.mark.parametrize(("name", "g"), [("undercut_edge_bears", 1), ("tip_along_a_root", 0)])
def test_beyond_an_undercut_s_edge_the_gap_is_that_of_the_root(name: str, g: int) -> None:
    """Near the edge, as a wedge between the mate and the tangent of the trochoid."""
    gears = job_named(name).pair
    flanks = Flanks(gears)
    touching = flanks.touching(angles_of(gears, 20))
    trochoid = (gears.pinion, gears.wheel)[g].profile.segment("trochoid").curve.point(np.linspace(0.99, 1.0, 5001))
    at_the_edge = np.flatnonzero((touching.place[:, g] == 0.0) & (touching.twist < touching.twist.min() + 0.01))
    assert len(at_the_edge) > 1
    for k in at_the_edge:
        turns = flanks.turns(touching, k)
        mate = flanks.faces[1 - g].points(touching.place[k, 1 - g] + np.linspace(-0.01, 0.01, 5001))
        lines = []
        for gear, points in ((g, trochoid[:, 0] + 1j * trochoid[:, 1]), (1 - g, mate)):
            placed = points * np.exp(1j * turns[gear]) + gear * gears.working_centre_distance
            seen_from = (placed - touching.point[k]) / touching.normal[k]
            order = np.argsort(-seen_from.imag)
            lines.append((-seen_from.imag[order], seen_from.real[order]))
        x = np.array([-4e-5, -2e-5] if g == 0 else [2e-5, 4e-5]) * gears.pinion.module
        exact = (1 - 2 * g) * (np.interp(x, *lines[1]) - np.interp(x, *lines[0]))
        np.testing.assert_allclose(beside(flanks, touching, k).gap_at(x), exact, atol=1e-3 * abs(x).max())


def test_the_gap_ends_with_both_faces() -> None:
    """What is filled in beyond an undercut's edge ends at the mate's tip, and the pressure lies on the mate."""
    job = job_named("tip_beside_an_undercut")
    flanks = Flanks(job.pair)
    touching = flanks.touching(job.sweep["angles"][2:3])
    (k,) = np.flatnonzero(touching.place[:, 0] > 1 - 1e-9)
    assert 0 < -flanks.wheel.distance(float(touching.place[k, 1]), 0.0) < 1e-5
    contact = beside(flanks, touching, k)
    assert contact.x.max() == 0.0
    found = contact.under(5e3)
    assert -2 * found.width * 5e3 < found.moment < 0


def test_an_undercut_s_edge_bears_in_every_mesh_cycle() -> None:
    """Its place on the wheel has the rounding of angles, which must not make it a point of the smooth flank."""
    job = job_named("undercut_edge_bears")
    angles = job.sweep["angles"][0] + job.pair.mesh_cycle * np.arange(12)
    touching = Flanks(job.pair).touching(angles)
    at_the_edge = np.flatnonzero(np.abs(touching.place[:, 1]) < 1e-6)
    assert len(at_the_edge) >= 12
    assert (touching.place[at_the_edge, 1] == 0.0).all()
    assert np.isinf(touching.curvature[at_the_edge]).all()


@pytest.mark.parametrize("case", ["about the end of the path", "beside an undercut"])
def test_small_loads_at_sharp_tips_do_not_know_the_mesh(case: str) -> None:
    """The law of small loads starts from pressures that span a few elements, whatever the contact does.

    On a flank with elements a quarter as large it says the same, and so does that mesh by itself.
    """
    if case == "beside an undercut":
        job = job_named("tip_beside_an_undercut")
        gears, model, angles, twist = job.pair, job.model, job.sweep["angles"][2:3], job.sweep["twist"]
    else:
        gears, model, angles = pair(20, 30), {"coarsen": 2.0}, np.radians([8.0, 8.2])
        twist = gears.contact_twist + math.radians(0.02)
    usual, fine = elastic_pair(gears, **model), elastic_pair(gears, **{**model, "flank_coarsen": 0.25})
    law, finer_law, mesh = (
        np.array([p.torque_wheel for p in Router(gears, elastic, route).solve(angles, np.full(len(angles), twist))])
        for elastic, route in ((usual, "hertz"), (fine, "hertz"), (fine, "direct"))
    )
    np.testing.assert_allclose(finer_law, law, rtol=5e-4)
    np.testing.assert_allclose(law, mesh, rtol=1e-3)
