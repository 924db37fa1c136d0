"""Suns, rings and carriers without bearings: meshes and pins alone hold them across the axis."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.modes.whirl import train_modes
from gearfe.drivetrain.runup.run_up import steady_state
from gearfe.drivetrain.train import Bearing, Damping, Drive, GearTrain, build_train, simulate
from gearfe.drivetrain.train.misalignment import static_state
from gearfe.multibody import constant
from tests.makers.planetary import ALONG, TILT, stage
from tests.makers.trains import curve

MESH = 5e8
SLOW = Drive("sun", "sun", constant(1e-3))  # no centrifugal forces


def afloat(train: GearTrain, member: str = "sun") -> GearTrain:
    """The same train with a member without bearings."""
    shafts = tuple(dataclasses.replace(s, bores=()) if s.name == member else s for s in train.shafts)
    bearings = tuple(b for b in train.bearings if b.bore != member)
    drive = train.driven if member != "sun" else dataclasses.replace(train.driven, bore=None)
    loads = tuple(dataclasses.replace(x, bore=None) if x.shaft == member else x for x in train.loads)
    return dataclasses.replace(train, shafts=shafts, bearings=bearings, drive=drive, loads=loads)


def sun_forces(train: GearTrain, count: int) -> np.ndarray:
    """Static forces of the meshes of the sun (N)."""
    model = build_train(train)
    q = static_state(model)
    assert q is not None
    return np.array([MESH * line.row @ q for line in model.meshes])[:count]


@pytest.mark.parametrize("count", [3, 4, 5])
def test_a_floating_sun_shares_as_its_equilibrium_demands(count: int) -> None:
    """A sun takes from the pin errors e what its motions span: rotation, if it floats translations, too.

    The force of planet i is F + B e_i + A u_i, with u_i of the span of the sun's motions along its lines of action: 1,
    cos psi_i and sin psi_i. In equilibrium the forces are orthogonal to them, so what differs is B (1 - P) e, with the
    projection P onto the span: three planets share equally, of four the opposed ones (Singh, Mech. Mach. Theory 40,
    2005).
    """
    psi = 2.0 * math.pi * np.arange(count) / count
    error = np.zeros(count)
    error[0] = 2e-6
    teeth = (30, 30) if count < 5 else (35, 30)
    held = stage(count, teeth, mesh=MESH, bearing=None, ring=None, errors=error.tolist(), drive=SLOW)
    forces = [sun_forces(train, count) for train in (held, afloat(held))]
    spans = [np.ones((count, 1)), np.column_stack([np.ones(count), np.cos(psi), np.sin(psi)])]
    left = [error - span @ np.linalg.lstsq(span, error, rcond=None)[0] for span in spans]
    factor = (forces[0] - forces[0].mean())[0] / left[0][0]
    for force, residual in zip(forces, left, strict=True):
        np.testing.assert_allclose(force - force.mean(), factor * residual, rtol=0.0, atol=1e-9 * abs(force.mean()))
    assert np.ptp(forces[1]) < np.ptp(forces[0])


@pytest.mark.parametrize("member", ["sun", "ring", "carrier"])
def test_ideal_planets_share_equally_with_a_member_afloat(member: str) -> None:
    """In statics, in a transient and in a steady state, with meshes in phase whose stiffness varies."""
    train = afloat(stage(3, (30, 36), mesh=lambda teeth: curve(teeth, mean=MESH, swing=0.15)), member)
    train = dataclasses.replace(train, damping=Damping(beta=2e-6))
    model = build_train(train)
    response = simulate(model, np.linspace(0.0, 2e-3, 101), tolerance=1e-10, method="taylor")
    state = steady_state(model, 200.0, stability=False)
    for force in (response.contact_force, state.force):
        mean = np.abs(force).mean()
        for kind in (force[:, :3], force[:, 3:]):
            assert np.ptp(kind, axis=1).max() < 1e-9 * mean


@pytest.mark.parametrize("member", ["sun", "ring", "carrier"])
def test_modes_are_those_of_a_bearing_without_stiffness_across_the_axis(member: str) -> None:
    """A bearing that is stiff along the axis and against tilts, and takes nothing across it, is the second way."""
    given = stage(damping=Damping())
    free = Bearing(member, (0.0, ALONG, 0.0, TILT, TILT))
    second = dataclasses.replace(
        given, bearings=tuple(free if b.bore == member else b for b in given.bearings)
    )  # fmt: skip
    found = [train_modes(build_train(train), [100.0], 15e3).frequency[0] for train in (afloat(given, member), second)]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-3)


def test_a_sun_between_two_planets_cannot_float() -> None:
    """Both lines of action of opposed planets are parallel: across them nothing holds it."""
    with pytest.raises(InputError, match=r"shaft 'sun' bearings: has no bearings, and its gears let it move.*three"):
        build_train(afloat(stage(2, (30, 36))))
