"""The campaigns' own checks: each can fail, and does where what it looks for is not there."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearfe.drivetrain.train import Bearing, Damping, build_train, simulate
from tests.makers.trains import changed, train

from .campaign import Case, campaign_named
from .faults import disk_run, read_only_run
from .frames import symmetric_frame
from .trains import _order, _settled, _symmetry

POINTS = np.array([[0.0, 0.03, 0.0], [0.0, -0.03, 0.0], [0.06, 0.03, 0.0], [0.06, -0.03, 0.0], [0.0, 0.0, 0.0]])


def test_a_symmetric_frame_is_its_own_mirror_image() -> None:
    body, reflect = symmetric_frame(np.random.default_rng(3), tuple("abcde"), POINTS)
    assert (reflect @ reflect == np.eye(body.size)).all()
    assert (
        reflect[6, 0] == reflect[9, 3] * -1 == 1.0
    )  # bore b is the image of a: x keeps its sign, a tilt about x turns
    for matrix in (body.mass, body.stiffness):
        np.testing.assert_allclose(reflect @ matrix @ reflect, matrix, atol=1e-12 * np.abs(matrix).max())
        assert np.linalg.eigvalsh(matrix).min() > 0.0
    coupled = body.stiffness[:6, :6]
    assert (np.abs(coupled) > 1e-6 * np.sqrt(np.outer(np.diag(coupled), np.diag(coupled)))).all()


@pytest.mark.parametrize(("bore", "symmetric"), [("s{} middle", True), ("s{}+", False)])
def test_only_symmetric_loads_leave_a_symmetric_train_in_its_plane(bore: str, symmetric: bool) -> None:
    gear_train = train([(20, 30)], ys=[0.0])
    bores = {**gear_train.rigid_bores, **{f"{s.name} middle": s.point for s in gear_train.shafts}}
    names = tuple(bores)
    body, reflect = symmetric_frame(np.random.default_rng(5), names, np.array(list(bores.values())))
    shafts = tuple(replace(s, bores=(*s.bores, f"{s.name} middle")) for s in gear_train.shafts)
    assert gear_train.drive is not None
    drive = replace(gear_train.drive, bore=bore.format(0))
    loads = tuple(replace(load, bore=bore.format(1)) for load in gear_train.loads)
    made = changed(gear_train, shafts=shafts, drive=drive, loads=loads, housing=body, rigid_bores={})
    response = simulate(build_train(made), np.linspace(0.0, 2e-3, 41), tolerance=1e-8)
    checks = _symmetry(response, reflect)
    assert [check.name for check in checks] == ["axial", "tilt", "mirror"]
    assert all((check.share < 0.1) == symmetric for check in checks)


def test_an_order_that_is_missing_is_seen() -> None:
    model = build_train(train([(20, 30)]))
    times = np.linspace(0.0, 1e-3, 21)
    truth = simulate(model, times, tolerance=1e-11, method="taylor").contact_force
    for method in ("taylor", "implicit"):
        (good,) = _order(model, times, method, truth)
        assert good.value < 0.6
        (bad,) = _order(model, times, method, truth * 1.01)  # an error that no smaller step makes smaller
        assert bad.share > 1.0


def test_a_train_that_has_not_settled_is_seen() -> None:
    stiff = tuple(Bearing(f"s{i}{s}", (1e9, 1e9, 1e9, 1e5, 1e5)) for i in range(2) for s in "+-")
    model = build_train(changed(train([(20, 30)]), bearings=stiff, damping=Damping(alpha=2000.0)))
    made = simulate(model, np.linspace(0.0, 25e-3, 51), tolerance=1e-6)
    measures = {"tolerance": 1e-6}
    (check,) = _settled(model, made, measures)
    assert check.share < 1.0
    assert measures["step_rad"] > 1.0  # rad of the fastest vibration in a step
    (check,) = _settled(model, replace(made, contact_force=1.001 * made.contact_force), measures)
    assert check.share > 1.0


@pytest.mark.parametrize("run", [disk_run, read_only_run])
def test_without_the_right_to_mount_a_disk_is_not_tried(
    run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,  # type: ignore[no-untyped-def]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    case: Case = campaign_named("files").case(1, 300)
    found = run(case, tmp_path)
    assert (found.outcome, found.checks) == ("stopped", ())
    assert "root" in found.reason
