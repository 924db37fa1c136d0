"""Elastic shafts in a train, and the misalignment of gears that bend them."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.gearbox.fields import moved, solids
from gearfe.drivetrain.modes.whirl import train_modes
from gearfe.drivetrain.runup.run_up import run_up
from gearfe.drivetrain.train import (
    Bearing,
    Coupling,
    Damping,
    Drive,
    GearTrain,
    Load,
    Shaft,
    ShaftGear,
    TrainModel,
    build_train,
    elastic_shaft,
    simulate,
)
from gearfe.drivetrain.train.elements import rotor
from gearfe.drivetrain.train.gear_train import HIGHEST_HZ
from gearfe.drivetrain.train.misalignment import misalignments, static_state
from gearfe.fem.beams import LOADS, Section, full_shaft
from gearfe.fem.beams.whirl import Support, whirl_frequencies
from gearfe.multibody import constant
from tests.makers.trains import SHIPPED, base_radius, curve, elastic, gear, loaded, train

YOUNG, POISSON, DENSITY = 200e9, 0.3, 7850.0
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))


def section(length: float = 0.09, diameter: float = 0.02, young: float = YOUNG, bore: float = 0.0) -> Section:
    return Section(length, diameter, diameter, bore, bore, young=young, poisson=POISSON, density=DENSITY)


def with_sections(gear_train: GearTrain, *sections: Section, **changes: Any) -> GearTrain:
    """All shafts of a train made of the sections."""
    length = sum(part.length for part in sections)
    radius = max(0.5 * max(part.outer_start, part.outer_end) for part in sections)
    changes |= {"length": length, "radius": radius, "sections": sections}
    return dataclasses.replace(
        gear_train, shafts=tuple(dataclasses.replace(shaft, **changes) for shaft in gear_train.shafts)
    )


def on_bearings(gear_train: GearTrain, *, radial: float, axial: float = 1e8) -> GearTrain:
    """Bearings that leave the tilts free in all bores."""
    bores = [bore for shaft in gear_train.shafts for bore in shaft.bores]
    springs = tuple(Bearing(bore, (radial, axial, radial, 0.0, 0.0)) for bore in bores)
    return dataclasses.replace(gear_train, bearings=springs)


def first_frequencies(model: TrainModel, count: int) -> Any:
    return model.coupled_frequencies_hz[:count]


def test_frequencies_are_those_of_the_unreduced_beams(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two stages in an elastic frame, steel shafts of 20 mm: the first 15 to 1e-4 of all coordinates of the beams."""
    bent = with_sections(elastic(train(SHIPPED), uneven=0.2, skew=0.5), section())
    reduced = build_train(bent)
    elastic_shaft.reduced_shaft.cache_clear()
    monkeypatch.setattr(
        elastic_shaft,
        "reduce_shaft",
        lambda shaft, frame, _, elements: full_shaft(shaft, frame, 40e3, elements=elements),
    )
    whole = build_train(bent)
    elastic_shaft.reduced_shaft.cache_clear()
    assert whole.system.size > 2 * reduced.system.size
    assert first_frequencies(reduced, 15) == pytest.approx(first_frequencies(whole, 15), rel=1e-4)
    stiff = build_train(elastic(train(SHIPPED), uneven=0.2, skew=0.5))
    assert (first_frequencies(reduced, 15) < first_frequencies(stiff, 15)).all()


def test_shafts_keep_the_loads_that_act(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spur gears and bearings without tilt stiffness: first 15 to 1e-4.

    Tilts that nothing loads would raise the highest frequency, and with it the number of steps.
    """
    bent = with_sections(on_bearings(elastic(train(SHIPPED), uneven=0.2, skew=0.5), radial=1e9), section())
    reduced = build_train(bent)
    with monkeypatch.context() as patched:
        for name in ("_gear_loads", "_bore_loads"):
            patched.setattr(elastic_shaft, name, lambda *_: LOADS)
        loaded_all = build_train(bent)
    elastic_shaft.reduced_shaft.cache_clear()
    monkeypatch.setattr(
        elastic_shaft,
        "reduce_shaft",
        lambda shaft, frame, _, elements: full_shaft(shaft, frame, 40e3, elements=elements),
    )
    whole = build_train(bent)
    elastic_shaft.reduced_shaft.cache_clear()
    assert first_frequencies(reduced, 15) == pytest.approx(first_frequencies(whole, 15), rel=1e-4)
    assert reduced.coupled_frequencies_hz[-1] < 0.7 * loaded_all.coupled_frequencies_hz[-1]
    assert reduced.system.size < loaded_all.system.size


def test_loads_of_gears_and_bores_follow_from_what_acts_there() -> None:
    """Tilt: of helical gears, of faces that do not share their middle, of hinges and of bearings that hold it."""
    spur = with_sections(train([(20, 30)], ys=[PLACE]), section())

    def loads(gear_train: GearTrain) -> dict[str, tuple[str, ...]]:
        stations = elastic_shaft.beam_shaft(gear_train, gear_train.shafts[0]).stations
        return {station.name: station.loads for station in stations}

    assert loads(spur)["gear d0"] == ("radial", "torsion")
    assert loads(spur)["attachment s0+"] == ("radial", "tilt", "axial")
    moved = tuple(dataclasses.replace(g, along=g.along + 0.002 * (g.name == "g0")) for g in spur.gears)
    assert loads(dataclasses.replace(spur, gears=moved))["gear d0"] == ("radial", "tilt", "torsion")
    helical = tuple(dataclasses.replace(g, gear=dataclasses.replace(g.gear, helix_angle=0.3)) for g in spur.gears)
    assert loads(dataclasses.replace(spur, gears=helical))["gear d0"] == ("radial", "tilt", "axial", "torsion")
    wide = tuple(dataclasses.replace(mesh, moments=True) for mesh in spur.meshes)
    assert loads(dataclasses.replace(spur, meshes=wide))["gear d0"] == ("radial", "tilt", "torsion")
    for stiffness, expected in (
        ((1e8, 0.0, 1e8, 0.0, 0.0), ("radial",)),
        ((1e8, 1e8, 1e8, 0.0, 0.0), ("radial", "axial")),
        ((1e8, 1e8, 1e8, 1e4, 0.0), ("radial", "tilt", "axial")),
    ):
        held = dataclasses.replace(spur, bearings=(Bearing("s0+", stiffness),))
        assert loads(held)["attachment s0+"] == expected


def test_stiff_sections_make_the_rigid_shaft() -> None:
    """With a thousand times the modulus: frequencies to 1e-3 and contact forces to 1e-2 of those of rigid shafts."""
    rigid = loaded([(20, 30)], 1e8)
    stiff = with_sections(rigid, section(young=1e3 * YOUNG), highest_hz=1e5)
    models = [build_train(each) for each in (rigid, stiff)]
    assert first_frequencies(models[1], 12) == pytest.approx(first_frequencies(models[0], 12), rel=1e-3)
    times = np.linspace(0.0, 2e-3, 101)
    forces = [simulate(model, times, tolerance=1e-8).contact_force for model in models]
    assert np.abs(forces[0] - forces[1]).max() < 1e-2 * np.abs(forces[0]).max()


def test_mass_of_stepped_hollow_and_conical_sections() -> None:
    """Frustum of a cone by its closed formulas; the rotor's properties are those of the beams' mass matrix."""
    length, one, two = 0.05, 0.012, 0.02
    cone = Section(length, 2 * one, 2 * two, young=YOUNG, poisson=POISSON, density=DENSITY)
    pieces = (section(0.03, 0.024, bore=0.008), cone, section(0.02, 0.03))
    single = with_sections(train([(20, 30)]), *pieces)
    alone = dataclasses.replace(single, gears=(), meshes=())
    shaft = dataclasses.replace(single.shafts[0], sections=(cone,), length=length, radius=two)
    found = rotor(dataclasses.replace(alone, shafts=(shaft,)), shaft)
    volume = math.pi * length / 3.0 * (one**2 + one * two + two**2)
    assert found.mass == pytest.approx(DENSITY * volume, rel=1e-12)
    polar = math.pi * DENSITY * length / 10.0 * (two**5 - one**5) / (two - one)
    assert found.polar == pytest.approx(polar, rel=1e-12)
    body, whole = build_train(single).shafts[0], rotor(single, single.shafts[0])
    assert body.rotor.mass == pytest.approx(whole.mass, rel=1e-12)
    assert body.rotor.polar == pytest.approx(whole.polar, rel=1e-12)
    assert body.rotor.transverse == pytest.approx(whole.transverse, rel=1e-9)
    assert body.rotor.centre == pytest.approx(whole.centre, abs=1e-12)
    assert np.diag(body.mass())[:6] == pytest.approx([whole.mass] * 3 + [whole.transverse] * 2 + [whole.polar])


PLACE, HALF = 0.012, 0.033  # of the gears, and of the bores on both sides of the middle


def bent_slope(force: float, diameter: float) -> tuple[float, float]:
    """Deflection and slope under a load at PLACE of a simply supported Timoshenko beam between the bores.

    Roark, Formulas for Stress and Strain, table 8.1, with the shear of each span added (Cowper's factor).
    """
    a, b, span = HALF + PLACE, HALF - PLACE, 2.0 * HALF
    bending, area = YOUNG * math.pi / 64.0 * diameter**4, math.pi / 4.0 * diameter**2
    kappa = 6.0 * (1.0 + POISSON) / (7.0 + 6.0 * POISSON)
    deflection = force * a**2 * b**2 / (3.0 * bending * span) + force * a * b / (kappa * SHEAR * area * span)
    return deflection, force * a * b * (b - a) / (3.0 * bending * span)


@pytest.mark.parametrize("speed", [600.0, -600.0])
@pytest.mark.parametrize("stiffness", [2e8, None])
def test_misalignment_of_shafts_on_bearings(stiffness: float | None, speed: float) -> None:
    """Both shafts bend between their bearings, which yield: closed formulas of beams and springs, in each part."""
    diameter, radial, torque = 0.02, 5e7, 60.0
    given = with_sections(train([(20, 30)], stiffness=stiffness, ys=[PLACE]), section(diameter=diameter))
    given = on_bearings(given, radial=radial)
    load = Load("s1", "s1+", constant(math.copysign(torque, speed)))
    given = dataclasses.replace(given, loads=(load,), drive=Drive("s0", "s0+", constant(speed)))
    (found,) = misalignments(build_train(given))
    force = torque / base_radius(30)
    assert found.force == pytest.approx(force, rel=1e-9)
    deflection, slope = bent_slope(force, diameter)
    # each shaft is pushed away from the other along the line of action, the driver against n
    near, far = force * (HALF + PLACE) / (2 * HALF) / radial, force * (HALF - PLACE) / (2 * HALF) / radial
    tilt, middle = (near - far) / (2 * HALF), far + (near - far) * (HALF + PLACE) / (2 * HALF)
    assert found.width == pytest.approx(0.01)
    assert found.in_plane_parts == pytest.approx((-2.0 * slope, -2.0 * tilt, 0.0), rel=2e-4, abs=1e-9)
    assert found.apart_parts == pytest.approx((2.0 * deflection, 2.0 * middle, 0.0), rel=2e-4, abs=1e-12)
    assert found.f_sh == pytest.approx(-2e-2 * (slope + tilt), rel=2e-4)
    assert found.across == pytest.approx(0.0, abs=1e-3 * abs(found.in_plane))


def test_misalignment_of_rigid_shafts_is_that_of_bearings_and_housing() -> None:
    rigid = on_bearings(elastic(train(SHIPPED), uneven=0.2, skew=0.5), radial=5e7)
    for found in misalignments(build_train(rigid)):
        scale = abs(found.in_plane) + abs(found.across)
        assert found.in_plane_parts[0] == pytest.approx(0.0, abs=1e-9 * scale)
        assert found.in_plane_parts[1] != 0.0
        assert found.in_plane_parts[2] != 0.0
        assert sum(found.in_plane_parts) == pytest.approx(found.in_plane)


def test_misalignment_of_a_train_in_a_rigid_housing_is_zero() -> None:
    for found in misalignments(build_train(train(SHIPPED))):
        assert (found.f_sh, found.across, found.apart) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)


def test_misalignment_is_the_mean_of_the_transient() -> None:
    """Constant stiffness, damped, at rest beside rolling in the end: tilts of the gears' poses without gyroscopics."""
    damping = Damping(ratio=0.3, gyroscopic=False)
    given = with_sections(loaded([(20, 30)], 1e8), section())
    model = build_train(dataclasses.replace(given, damping=damping))
    found = misalignments(model)[0]
    response = simulate(model, np.linspace(0.0, 0.1, 11), tolerance=1e-9)
    for pose, tilt in zip(response.gear_pose[-1], (found.driver_tilt, found.driven_tilt), strict=True):
        assert pose[[3, 5]] == pytest.approx([tilt[0], tilt[2]], rel=1e-3)
        assert tilt[1] == 0.0


def test_surfaces_of_shafts_bend_with_them() -> None:
    """Rings at the middles of the gears move as the gears do; between, the line of centres is bent."""
    model = build_train(with_sections(loaded([(20, 30)], 1e8), section()))
    response = simulate(model, np.linspace(0.0, 5e-4, 6), tolerance=1e-6)
    sections, frame, step = response.sections, model.train.frame, 5
    assert sections is not None
    parts = [part for part in solids(model.train, response) if part.section is not None]
    assert [part.gear for part in parts] == [0, 1]
    for number, part in enumerate(parts):
        body, first = model.shafts[number], model.first[number]
        points = moved(part, response, frame, step)
        q = np.zeros(model.system.size)
        q[sections.columns] = response.section_coordinates[step]
        own = q[first : first + body.size]
        for ring in np.unique(part.section):
            inside, centre = part.section == ring, sections.centres[ring]
            along = float(centre @ frame[2])
            middle = points[inside].mean(axis=0)
            assert middle == pytest.approx(centre + body.point_rows(centre, frame, along) @ own, abs=1e-12)
            turned = model.ratios[number] * response.drive_angle[step] + float(body.turn_rows(along)[2] @ own)
            before, after = part.points[inside][0] - centre, points[inside][0] - middle
            if np.linalg.norm(before) > 1e-3:
                angle = math.atan2(frame[2] @ np.cross(before, after), before @ after)
                assert math.remainder(angle - turned, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("bends", [False, True])
def test_shafts_without_gears_are_shown(bends: bool) -> None:
    """A shaft behind a coupling, rigid or elastic: its rings move with its sections and turn with it."""
    made = train([(20, 30)], stiffness=1e8)
    piece = {"sections": (section(0.08, 0.024),)} if bends else {}
    shaft = Shaft("in", (0.0, -0.1, 0.0), 0.08, 0.012, ("in+", "in-"), **piece)
    bores = {**made.rigid_bores, "in+": (0.0, -0.07, 0.0), "in-": (0.0, -0.13, 0.0)}
    load = dataclasses.replace(made.loads[0], torque=constant(30.0))
    made = dataclasses.replace(
        made, shafts=(*made.shafts, shaft), rigid_bores=bores, drive=Drive("in", "in+", constant(600.0)), loads=(load,),
        couplings=(Coupling("clutch", ("in", "s0"), 3e4, 0.5),),
    )  # fmt: skip
    springs = tuple(Bearing(name, (1e8, 1e8, 1e8, 1e3, 1e3)) for name in bores)
    model = build_train(dataclasses.replace(made, bearings=springs))
    response, frame = simulate(model, np.linspace(0.0, 2e-4, 3), tolerance=1e-6), model.train.frame
    parts = [part for part in solids(model.train, response) if part.shaft == 2]
    assert len(parts) == 1
    (part,) = parts
    assert part.gear == -1
    assert part.section is not None
    assert np.ptp(part.points @ frame[2]) == pytest.approx(0.08)
    points, sections = moved(part, response, frame, 2), response.sections
    assert sections is not None
    poses = sections.rows @ response.section_coordinates[2]
    ring = part.section == part.section[0]
    centre = sections.centres[part.section[0]]
    assert points[ring].mean(axis=0) == pytest.approx(centre + poses[part.section[0], :3], abs=1e-9)
    before, after = part.points[ring][0] - centre, points[ring][0] - points[ring].mean(axis=0)
    angle = math.atan2(frame[2] @ np.cross(before, after), before @ after)
    assert angle == pytest.approx(600.0 * 2e-4, abs=1e-3)


def test_a_highest_frequency_beyond_all_beams_is_refused_with_its_range() -> None:
    with pytest.raises(InputError, match=r"shaft 's0' highest_frequency_Hz = 300000000.0: .*must be <= .* Hz"):
        build_train(with_sections(train([(20, 30)]), section(), highest_hz=3e8))


def test_torsion_between_drive_and_gear() -> None:
    """The drive at one end winds the shaft up: T L/(G J) between the bore and the gear's section."""
    torque = 60.0
    given = with_sections(train([(20, 30)], stiffness=2e8, ys=[PLACE]), section())
    load = Load("s1", "s1-", constant(torque), along=0.04)
    given = dataclasses.replace(given, loads=(load,), drive=Drive("s0", "s0-", constant(600.0), along=-0.045))
    model = build_train(given)
    q = static_state(model)
    assert q is not None
    polar = math.pi / 32.0 * 0.02**4
    for number, (end, gear_torque) in enumerate([(-0.045, torque * 2.0 / 3.0), (0.04, torque)]):
        body, first = model.shafts[number], model.first[number]
        turned = [body.turn_rows(along)[2] @ q[first : first + body.size] for along in (PLACE, end)]
        expected = gear_torque * abs(PLACE - end) / (SHEAR * polar)
        assert abs(turned[0] - turned[1]) == pytest.approx(expected, rel=1e-6)
    assert model.spin_reference[0] @ q == pytest.approx(0.0, abs=1e-15)  # the drive prescribes that section


def test_both_integrators_agree() -> None:
    """Taylor series and collocation, with a curve whose phase follows the section of the driver."""
    given = with_sections(loaded([(20, 30)], curve, ratio=0.02, backlash=5e-6), section())
    given = dataclasses.replace(given, damping=dataclasses.replace(given.damping, beta=1e-6, ratio=0.0))
    model = build_train(given)
    times = np.linspace(0.0, 1e-4, 26)
    made = [simulate(model, times, tolerance=1e-6, method=method) for method in ("taylor", "implicit")]
    for name in ("contact_force", "speed", "gear_pose"):
        one, two = (getattr(response, name) for response in made)
        assert np.abs(one - two).max() < 1e-4 * np.abs(two).max(), name


def test_the_run_up_meets_the_transient() -> None:
    given = with_sections(loaded([(20, 30)], lambda teeth: curve(teeth, swing=0.15), ratio=0.05), section())
    model = build_train(given)
    run = run_up(model, np.array([600.0]), tolerance=1e-6, band_hz=5000.0)
    force = simulate(model, np.linspace(0.0, 0.06, 24001), tolerance=1e-8).contact_force[-2400:, 0]
    columns = run.columns()
    assert columns["peak_to_peak_force_1_N"][0] == pytest.approx(np.ptp(force), rel=2e-3)


@pytest.mark.parametrize(("highest_hz", "digits"), [(40e3, 1e-6), (HIGHEST_HZ, 1e-5)])
def test_whirl_of_an_overhung_gear_at_five_speeds(highest_hz: float, digits: float) -> None:
    """A train of one shaft against the beams on springs with all coordinates: frequencies, senses and energies."""
    radial, wide, ends = 5e7, gear(60, 0.02), (-0.05, 0.03)
    sections = (section(0.12, 0.024), section(0.08, 0.02))
    shaft = Shaft("rotor", (0.0, 0.0, 0.0), 0.2, 0.012, ("one", "two"), sections=sections, highest_hz=highest_hz)
    single = GearTrain(
        (shaft,), (ShaftGear("disc", "rotor", 0.085, wide),), (), Drive("rotor", "one", constant(100.0)),
        rigid_bores={name: (0.0, y, 0.0) for name, y in zip(shaft.bores, ends, strict=True)},
    )  # fmt: skip
    model = build_train(on_bearings(single, radial=radial))
    speeds = np.array([0.0, 250.0, 500.0, 1000.0, 2000.0])
    modes = train_modes(model, speeds, 6000.0)
    bending = np.flatnonzero(modes.share("bending")[0] > 0.5)
    supports = [Support(y, radial) for y in ends]
    expected = whirl_frequencies(
        elastic_shaft.beam_shaft(model.train, shaft), supports, speeds, 6500.0, tolerance=1e-11
    )
    for row, frequencies in enumerate(expected):
        found = modes.frequency[row, bending] * (np.sign(modes.whirl[row, bending, 0]) if speeds[row] else 1.0)
        order = np.argsort(np.abs(found))
        near = frequencies[: len(bending)] if speeds[row] else np.abs(frequencies[: len(bending)])
        assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(near)), rel=digits)
        if speeds[row]:
            assert (np.sign(found[order]) == np.sign(near)).all()
            assert np.abs(modes.whirl[row, bending, 0]) == pytest.approx(1.0, abs=1e-3)
    others = np.setdiff1d(np.arange(modes.frequency.shape[1]), bending)
    assert (modes.share("axial")[0, others] + modes.share("torsion")[0, others]) == pytest.approx(1.0, abs=1e-6)
    assert modes.shares.sum(axis=2) == pytest.approx(1.0)


def test_rigid_trains_load_no_beams() -> None:
    code = (
        "import sys; from tests.makers.trains import train; from gearfe.drivetrain.train import build_train; "
        "build_train(train([(20, 30)])); assert not [m for m in sys.modules if 'beams' in m or 'elastic_shaft' in m]"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def bent(**changes: Any) -> GearTrain:
    return with_sections(train([(20, 30)]), section(), **changes)


def first_changed(gear_train: GearTrain, **changes: Any) -> GearTrain:
    """The train with the keys of its first shaft changed."""
    first, *others = gear_train.shafts
    return dataclasses.replace(gear_train, shafts=(dataclasses.replace(first, **changes), *others))


MISTAKES: dict[str, tuple[GearTrain, str, str]] = {
    "length": (first_changed(bent(), length=0.1), "shaft 's0' length", "0.09 m"),
    "radius": (first_changed(bent(), radius=0.02), "shaft 's0' radius", "0.01 m"),
    "mass": (first_changed(bent(), mass=1.0), "shaft 's0' mass", "leave one out"),
    "damping": (first_changed(bent(), damping_ratio=1.0), "shaft 's0' damping ratio", "< 1"),
    "negative": (first_changed(bent(), sections=(section(diameter=-0.02),)), "section 1 outer_start", "> 0"),
    "bore": (first_changed(bent(), sections=(section(bore=0.03),)), "section 1 inner_start", "smaller bore"),
    "root": (
        first_changed(bent(), sections=(section(0.045), section(0.045, 0.044)), radius=0.022),
        "shaft 's0'",
        "root radius",
    ),
    "gear off": (
        first_changed(bent(), sections=(section(0.02),), length=0.02, bores=("s0+",)),
        "attachment 's0+'",
        "from -10 to 10 mm",
    ),
    "gear on bearing": (
        dataclasses.replace(bent(), gears=(ShaftGear("d0", "s0", 0.031, gear(20)), bent().gears[1])),
        "attachment 's0+'",
        "within gear 'd0' from 26 to 36 mm",
    ),
    "place": (
        dataclasses.replace(bent(), loads=(Load("s1", None, constant(1.0)),)),
        "load on 's1' place",
        "y_mm",
    ),
    "off": (
        dataclasses.replace(bent(), loads=(Load("s1", "s1+", constant(1.0), along=0.1),)),
        "load on 's1' y_mm",
        "from -45 to 45 mm",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_named(name: str) -> None:
    given, field, text = MISTAKES[name]
    with pytest.raises(InputError) as error:
        build_train(given)
    assert field in error.value.field, str(error.value)
    assert text in str(error.value)
    assert error.value.cure


def test_two_bearings_at_one_place() -> None:
    given = bent()
    bores = {**given.rigid_bores, "s0-": given.rigid_bores["s0+"]}
    with pytest.raises(InputError, match=r"lies 0 mm from bearing .* they overlap"):
        build_train(dataclasses.replace(given, rigid_bores=bores))


def test_a_speed_is_measured_where_the_drive_acts() -> None:
    """A drive at a place of its own, against the ground: the section there, not the one at the first bore."""
    given = bent()
    place = given.bore_points["s0-"][1] + 5e-3
    drive = dataclasses.replace(given.driven, bore=None, along=float(place))
    model = build_train(dataclasses.replace(given, drive=drive))
    np.testing.assert_allclose(model.spin[0], model.drive_row, atol=1e-12 * np.abs(model.drive_row).max())
