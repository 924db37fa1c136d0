"""Every mistake in a train is named, with its cure."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.train import Bearing, Damping, Drive, GearMesh, GearTrain, Load, build_train, simulate
from gearfe.gears.gearmesh.curve import StiffnessCurve
from gearfe.gears.gearmesh.periodic import periodic_interpolant
from gearfe.multibody import constant
from tests.makers.trains import SHIPPED, changed, curve, elastic, gear, train


def gears(gear_train: GearTrain, number: int, **changes: Any) -> GearTrain:
    made = list(gear_train.gears)
    made[number] = dataclasses.replace(made[number], **changes)
    return changed(gear_train, gears=tuple(made))


def shafts(gear_train: GearTrain, number: int, **changes: Any) -> GearTrain:
    made = list(gear_train.shafts)
    made[number] = dataclasses.replace(made[number], **changes)
    return changed(gear_train, shafts=tuple(made))


def meshes(gear_train: GearTrain, **changes: Any) -> GearTrain:
    return changed(gear_train, meshes=(dataclasses.replace(gear_train.meshes[0], **changes), *gear_train.meshes[1:]))


BASE = train(SHIPPED)
MODULE_3 = dataclasses.replace(gear(30), module=3e-3)
MOVED = {**BASE.rigid_bores, "s2+": (0.126, 0.033, 0.0), "s2-": (0.126, -0.033, 0.0)}
ALPHA_20 = dataclasses.replace(gear(30), pressure_angle=math.radians(20.0))

CASES = [
    (lambda: shafts(BASE, 1, point=(0.063, 0.0, 0.0), bores=()), "no bearing carries"),
    (lambda: changed(shafts(BASE, 2, point=(0.126, 0.0, 0.0)), rigid_bores=MOVED), "the gears need 62.5 mm"),
    (lambda: shafts(BASE, 2, point=(0.126, 0.0, 0.0)), "off the axis of shaft 's2'"),
    (lambda: gears(BASE, 1, gear=MODULE_3), "wheel.module_mm = 3.0: gears that differ in module, 3 mm and 2.5 mm"),
    (lambda: gears(BASE, 1, gear=ALPHA_20), "differ in pressure angle, 20 deg and 25 deg"),
    (lambda: gears(BASE, 2, along=0.008), "overlaps gear"),
    (lambda: gears(BASE, 1, along=-0.03), "do not face each other"),
    (lambda: gears(BASE, 1, along=0.05), "beyond the end of shaft"),
    (lambda: shafts(BASE, 0, length=0.05), "attachment 's0.'.*lies .* mm beyond the end of shaft 's0'.*lengthen"),
    (lambda: gears(BASE, 1, shaft="s9"), "unknown shaft 's9'; known names"),
    (lambda: changed(BASE, drive=None), "nothing holds the train"),
    (lambda: changed(BASE, meshes=()), "no gear is driven"),
    (lambda: changed(gears(BASE, 3, along=-0.03), meshes=BASE.meshes[:1]), "shaft 's2'.*held by nothing"),
    (lambda: changed(BASE, drive=Drive("s0", "s7+", constant(1.0))), "unknown attachment 's7\\+'"),
    (lambda: changed(BASE, drive=Drive("s0", "s1+", constant(1.0))), "does not carry shaft 's0'"),
    (lambda: changed(BASE, loads=(Load("s8", None, constant(1.0)),)), "unknown shaft 's8'"),
    (lambda: shafts(BASE, 0, bores=("s0+", "nine")), "unknown attachment 'nine'"),
    (lambda: shafts(BASE, 0, bores=("s0+", "s0+")), "holds shaft"),
    (lambda: shafts(BASE, 0, radius=-1.0), "must be finite and > 0"),
    (lambda: shafts(BASE, 0, radius=0.0222), "reaches the teeth"),
    (lambda: changed(BASE, gears=(*BASE.gears, BASE.gears[0])), "is named twice"),
    (lambda: meshes(BASE, driver="q"), "unknown gear 'q'"),
    (lambda: meshes(BASE, damping=-1.0), "feeds energy in"),
    (lambda: meshes(BASE, stiffness=-1e8), "must be finite and > 0 N/m"),
    (lambda: meshes(BASE, stiffness=curve(30)), "period of 12 deg, the driver of 20 teeth needs 18 deg"),
    (lambda: changed(BASE, damping=Damping(ratio=-0.1)), "damping ratio.*feeds energy in"),
    (lambda: changed(BASE, damping=Damping(ratio=(0.1, 1.0))), "must be < 1"),
    (lambda: changed(BASE, damping=Damping(beta=-1e-6)), "damping beta"),
    (lambda: changed(BASE, bearings=(Bearing("s0+", (1e8, -1.0, 1e8, 0.0, 0.0)),)), "five numbers >= 0"),
    (lambda: changed(BASE, bearings=(Bearing("nowhere", (1e8,) * 5),)), "nowhere"),
    (lambda: changed(BASE, drive=Drive("s0", "s0+", constant(1.0), -5.0)), "drive stiffness"),
]  # fmt: skip


@pytest.mark.parametrize(("made", "words"), CASES, ids=[c[1][:30] for c in CASES])
def test_mistakes_are_named(made: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        build_train(made())


def test_axes_of_an_elastic_housing_must_fit() -> None:
    gear_train = elastic(BASE)
    body = dataclasses.replace(gear_train.housing, attachment_axes=np.tile([0.0, 0.8, 0.6], (6, 1)))  # type: ignore[type-var]
    with pytest.raises(InputError, match="not parallel"):
        build_train(changed(gear_train, housing=body))


def test_a_gear_must_not_cut_another_shaft() -> None:
    # the wheel on the middle shaft reaches the third shaft when that one is long and thick
    gear_train = train([(20, 60), (17, 20)])
    with pytest.raises(InputError, match=r"cuts .* mm into shaft 's2'"):
        build_train(gear_train)


def test_loops_of_gears_must_agree() -> None:
    """A third mesh between two shafts with another ratio would lock them."""
    extra = tuple(dataclasses.replace(g, name=g.name + "b", along=-0.02, gear=gear(25)) for g in BASE.gears[:2])
    gear_train = changed(BASE, gears=(*BASE.gears, *extra), meshes=(*BASE.meshes, GearMesh("d0b", "g0b", 1e8)))
    with pytest.raises(InputError, match="loop that cannot turn"):
        build_train(gear_train)


def table(path: Path, degrees: list[float], values: list[float], cycle: float | None = 18.0) -> StiffnessCurve:
    head = "pinion_angle_deg,k_mesh_N_per_m" + ("" if cycle is None else ",mesh_cycle_deg")
    rows = [f"{a},{k}" + ("" if cycle is None else f",{cycle}") for a, k in zip(degrees, values, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return StiffnessCurve.from_csv(path)


def test_curves_with_gaps_or_nonsense(tmp_path: Path) -> None:
    good = list(range(18))
    flat = [1e8] * 18
    build_train(meshes(BASE, stiffness=table(tmp_path / "good.csv", good, flat)))
    with pytest.raises(InputError, match=r"mesh 'd0-g0' stiffness.*(gap|cover)"):
        build_train(meshes(BASE, stiffness=table(tmp_path / "gap.csv", good[:6] + good[9:], flat[:15])))
    with pytest.raises(InputError, match=r"mesh 'd0-g0' stiffness.*(gap|cover)"):
        build_train(meshes(BASE, stiffness=table(tmp_path / "part.csv", good[:9], flat[:9])))
    with pytest.raises(InputError, match="must be > 0 N/m everywhere"):
        build_train(meshes(BASE, stiffness=table(tmp_path / "zero.csv", good, [0.0, *flat[1:]])))
    with pytest.raises(InputError, match="period of 24 deg"):
        build_train(meshes(BASE, stiffness=table(tmp_path / "other.csv", list(range(24)), [1e8] * 24, 24.0)))


def test_output_times() -> None:
    model = build_train(BASE)
    for times in ([0.0], [0.0, 2.0, 1.0], [1.0, 2.0], [0.0, math.nan]):
        with pytest.raises(InputError, match="rising numbers that begin with 0"):
            simulate(model, times)


def test_a_curve_may_come_as_an_interpolant() -> None:
    flat = periodic_interpolant(np.radians(np.arange(18.0)), np.full(18, 1e8), math.radians(18.0))
    # steps end at the corners of a curve, so the two runs differ by the tolerance of the integration
    times, given = [0.0, 1e-3, 2e-3], {"tolerance": 1e-10}
    one, two = (simulate(build_train(meshes(BASE, stiffness=s)), times, **given) for s in (flat, 1e8))
    assert one.contact_force == pytest.approx(two.contact_force, rel=1e-9, abs=1e-9)
