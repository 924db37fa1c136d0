"""One record per gear mesh: forces and compiled tables take its flanks as they are."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gearfe.drivetrain.train import build_train
from gearfe.drivetrain.train.forces import LawFlank
from gearfe.drivetrain.train.model import TrainModel
from gearfe.drivetrain.train.program import train_program
from tests.makers.mesh_laws import hertzian_law
from tests.makers.trains import ALPHA, changed, train

J = 20e-6


@pytest.fixture(scope="module")
def model() -> TrainModel:
    """Two meshes with laws, back flanks, friction and dampers in contact."""
    base, law = train([(20, 30), (20, 30)]), hertzian_law()
    meshes = tuple(
        dataclasses.replace(mesh, stiffness=law, backlash=J, friction=0.05, damping=300.0) for mesh in base.meshes
    )
    return build_train(changed(base, meshes=meshes))


def test_forces_have_the_flanks_of_the_records(model: TrainModel) -> None:
    flanks = [flank for line in model.meshes for flank in line.flanks]
    assert len(flanks) == 4
    assert all(one is two for one, two in zip(model.forces.flanks, flanks, strict=True))
    for given, line in zip(model.train.meshes, model.meshes, strict=True):
        assert line.given is given
        assert line.backlash == J


def test_compiled_tables_are_columns_of_the_records(model: TrainModel) -> None:
    program, _, _ = train_program(model.forces)
    flanks = [flank for line in model.meshes for flank in line.flanks]
    for table, records in ((program.flanks, flanks), (program.slides, [flank.sliding for flank in flanks])):
        for name, column in table._asdict().items():
            assert column.tolist() == [getattr(record, name) for record in records], name


def test_directions_are_what_the_flanks_take_them_for(model: TrainModel) -> None:
    """Approach along both lines of action, the driver's turn, sliding: by rigid motions of the driver."""
    spins = [int(first) + 5 for first in model.first]
    for number, line in enumerate(model.meshes):
        driving, back = line.flanks
        assert isinstance(driving, LawFlank)
        assert model.directions[:, driving.direction] == pytest.approx(line.row)
        radius = line.pair.pinion.base_radius
        driver, driven = spins[line.driver], spins[number + 1]
        for flank in line.flanks:
            assert model.directions[driver, flank.direction] == pytest.approx(flank.sense * radius)
            assert model.directions[driver, flank.turn] == pytest.approx(1.0)
            assert flank.sliding is not None
            turning = model.directions[:, flank.sliding.spin]
            assert (turning[driver], turning[driven], np.abs(turning).sum()) == (1.0, -1.0, 2.0)
            # across the line of action P moves by the rest of its circle's radius
            arm = radius * math.tan(ALPHA)
            assert abs(model.directions[driver, flank.sliding.across]) == pytest.approx(arm)
            assert flank.sliding.arm == pytest.approx(arm)
        assert back.gap == J
        assert back.sense == -driving.sense
        assert back.phase == -driving.phase
