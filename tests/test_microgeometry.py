"""Microgeometry: modifications and pitch errors in closed form, rigid and loaded pairs with them, the command."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from gearfe import InputError
from gearfe.cli import main
from gearfe.config import build
from gearfe.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gear import pitch_errors
from gearfe.gear.deviation import NOMINAL, Deviation, ToothDeviations
from gearfe.gear.modifications import FlankModification, Relief, Waviness, tooth_deviations
from gearfe.gear.pair import GearPair, TipRelief
from gearfe.microgeometry.job import active_rolls, deviations_of
from gearfe.microgeometry.loaded_mesh import full_period
from gearfe.microgeometry.solve import load_mesh
from gearfe.stiffness.sweep import elastic_pair, sweep_stiffness
from gearfe.tables.microgeometry import (
    VARIABLES,
    GearMicrogeometryTable,
    MicrogeometryTable,
    ReliefTable,
    VariableTable,
    WavinessTable,
)

from .gears import pair as gear_pair

PAIR = gear_pair(tip_round=1e-4)
PINION, WHEEL = PAIR.pinion, PAIR.wheel
LOW, HIGH = PINION.form_roll, PINION.profile.tip_roll


@pytest.fixture(scope="module")
def law():
    return half_plane_pair(PAIR, elastic_pair(PAIR))


def profile(**made) -> Deviation:
    found = tooth_deviations(PINION, FlankModification(**made)).profiles[0]
    assert found is not None
    return found


# ---- modifications -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["linear", "parabolic", "arc"])
@pytest.mark.parametrize("tip", [True, False])
def test_reliefs(shape, tip) -> None:
    amount, length = 20e-6, 3e-3
    start, end, sign = (HIGH - length, HIGH, 1) if tip else (LOW + length, LOW, -1)
    made = profile(**{"tip_relief" if tip else "root_relief": Relief(amount, start, shape)})
    x = np.linspace(0, length, 50)
    radius = (length**2 + amount**2) / (2 * amount)  # the circle tangent at x = 0 through (length, amount)
    depth = {
        "linear": amount * x / length,
        "parabolic": amount * (x / length) ** 2,
        "arc": radius - np.sqrt(radius**2 - x**2),
    }[shape]
    assert -made.at(start + sign * x)[0] == pytest.approx(depth, abs=1e-13)
    assert abs(made.at(np.array(start - sign * 1e-3))[0]) < 1e-20
    assert -made.at(np.array(end))[0] == pytest.approx(amount)
    assert bool(set(made.kinks) & {start}) == (shape == "linear")


def test_crowning_and_slope() -> None:
    s = np.array([LOW, 0.5 * (LOW + HIGH), HIGH])
    assert profile(crowning=5e-6).at(s)[0] == pytest.approx([-5e-6, 0, -5e-6], abs=1e-18)
    assert profile(slope=4e-6).at(s)[0] == pytest.approx([-2e-6, 0, 2e-6], abs=1e-18)


def test_a_wave_goes_on_from_tooth_to_tooth() -> None:
    """On the path of contact s/r_b = angle + 2 pi k/z: every tooth has the phase n times the angle there."""
    wave = Waviness(2e-6, 11, 0.3)
    made = tooth_deviations(PINION, FlankModification(waviness=(wave,)))
    assert len(made.profiles) == 20
    angle = 0.37
    for tooth in range(20):
        turn = angle + 2 * math.pi * tooth / 20
        turn -= 2 * math.pi * round((turn - 0.4) / (2 * math.pi))  # the turn in which the tooth has that roll length
        s = PINION.base_radius * turn
        if LOW < s < HIGH:
            found = made.profiles[made.profile[tooth]]
            assert found.at(np.array(s))[0] == pytest.approx(2e-6 * math.sin(11 * angle + 0.3), abs=1e-11)
    assert len(tooth_deviations(PINION, FlankModification(waviness=(replace(wave, waves=40),))).profiles) == 1


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (
            {"tip_relief": Relief(1e-5, HIGH - 6e-3), "root_relief": Relief(1e-5, LOW + 7e-3)},
            "overlaps the root relief",
        ),
        ({"tip_relief": Relief(1e-5, HIGH + 1e-3)}, "leaves the flank"),
        ({"root_relief": Relief(1e-5, LOW - 1e-3)}, "leaves the flank"),
        ({"tip_relief": Relief(-1e-6, HIGH - 1e-3)}, "must be >= 0"),
        ({"tip_relief": Relief(1e-6, HIGH - 1e-3, end=HIGH - 2e-3)}, "must be between"),
        ({"tip_relief": Relief(10e-6, HIGH - 4e-5, end=HIGH)}, "too steep"),
        ({"crowning": 2e-4}, "0.05 module"),
        ({"measured": (Deviation.straight([0, 1], [0, 0]),) * 3}, "each of the 20 teeth"),
    ],
)
def test_modifications_that_are_refused(made, told) -> None:
    with pytest.raises(InputError, match=told):
        tooth_deviations(PINION, FlankModification(**made))


# ---- pitch errors --------------------------------------------------------------------------------------------------


def test_tolerances_of_the_standard() -> None:
    """d = 50 mm, m = 2.5 mm in class 5 by hand; two classes double."""
    five, seven = (pitch_errors.tolerances(PINION, c) for c in (5, 7))
    assert 1e6 * five.single == pytest.approx(0.05 + 1.0 + 5)
    assert 1e6 * five.cumulative == pytest.approx(0.1 + 0.55 * 50**0.5 + 1.75 + 12)
    assert 1e6 * five.slope == pytest.approx(5.05)
    assert 1e6 * five.form == pytest.approx(6.375)
    assert seven.cumulative == pytest.approx(2 * five.cumulative)


def test_drawn_gears_are_as_bad_as_the_class_and_come_again() -> None:
    allowed = pitch_errors.tolerances(PINION, 7)
    reached = []
    for seed in range(12):
        index = pitch_errors.drawn(PINION, 7, seed)
        assert (index == pitch_errors.drawn(PINION, 7, seed)).all()
        shares = np.ptp(index) / allowed.cumulative, np.abs(pitch_errors.single_of(index)).max() / allowed.single
        reached.append(max(shares))
    assert reached == pytest.approx([1.0] * 12)
    assert (pitch_errors.drawn(PINION, 7, 0) != pitch_errors.drawn(PINION, 7, 1)).all()


def test_single_pitch_deviations() -> None:
    index = np.array([0.0, 3e-6, -1e-6, 2e-6])
    assert pitch_errors.from_single(pitch_errors.single_of(index)) == pytest.approx(index, abs=1e-18)
    with pytest.raises(InputError, match="add up to 0"):
        pitch_errors.from_single([1e-6, 2e-6])
    with pytest.raises(InputError, match="each of the 20 teeth"):
        pitch_errors.turns(PINION, index)


# ---- rigid and loaded pairs ------------------------------------------------------------------------------------------


def test_a_pitch_error_sine_is_the_unloaded_error(law) -> None:
    """On the path the wheel leads by F_j cos(alpha) of the tooth that touches: to 1e-12 m."""
    index = pitch_errors.sine(20, 20e-6, 0.3)
    bad = law.deviated((ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]))
    assert full_period(PAIR) == 60
    angles = np.arange(60 * 8) * PAIR.mesh_cycle / 8
    found = bad.teeth.touching(angles)
    first = np.full(len(angles), np.inf)
    np.minimum.at(first, found.position, found.twist)
    leads = found.take(np.flatnonzero(found.twist == first[found.position]))
    on = ((leads.place > 0.02) & (leads.place < 0.98)).all(axis=1)
    assert on.mean() > 0.7
    error = (leads.twist - PAIR.contact_twist)[on] * WHEEL.base_radius
    assert error == pytest.approx(-index[leads.pair[on] % 20] * math.cos(PINION.pressure_angle), abs=1e-12)


def test_a_pitch_error_sine_under_load_stays_within_that_of_its_pairs(law) -> None:
    """Turning every tooth that bears by the largest or the least of their turns brackets the loaded error."""
    index = pitch_errors.sine(20, 20e-6, 0.3)
    bad = law.deviated((ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]))
    angles = np.arange(60) * PAIR.mesh_cycle / 3
    plain, made = (load_mesh(one, [100.0], angles=angles) for one in (law, bad))
    assert made.statuses == {"converged": 60}
    change = (made.transmission_error - plain.transmission_error)[0]
    moved = -index * math.cos(PINION.pressure_angle)
    for i in range(60):
        pairs = {int(k) for one in (plain, made) for k in one.pairs.pair[one.pairs.angle == i]}
        of_pairs = [moved[k % 20] for k in pairs]
        assert min(of_pairs) - 2e-8 <= change[i] <= max(of_pairs) + 2e-8
    assert np.ptp(change) > 1.5 * 20e-6 * math.cos(PINION.pressure_angle)


def test_eleven_waves_round_the_pinion_are_order_eleven(law) -> None:
    """At light load the amplitude of the wave along the normal, within 1 %; nothing else beside mesh orders."""
    wave = tooth_deviations(PINION, FlankModification(waviness=(Waviness(1e-6, 11, 0.4),)))
    made = load_mesh(law.deviated((wave, NOMINAL[1])), [2.0], positions=8)
    order, amplitude = made.spectrum()
    _, unloaded = made.spectrum(unloaded=True)
    at = int(np.searchsorted(order, 11))
    assert order[at] == pytest.approx(11)
    assert amplitude[0, at] == pytest.approx(1e-6, rel=0.01)
    assert unloaded[at] == pytest.approx(1e-6, rel=0.01)
    others = np.isclose(order % 20, 0) | (np.abs(order - 11) < 1e-9)
    assert amplitude[0][~others].max() < 0.02e-6


def test_gears_exchanged(law) -> None:
    """Seen from the wheel: its torque is the pinion's and the contact forces are the same."""
    rng = np.random.default_rng(7)
    index = [2e-6 * rng.standard_normal(z) for z in (20, 30)]
    relief = [
        FlankModification(tip_relief=Relief(8e-6, g.profile.tip_roll - 2e-3, "parabolic")) for g in (PINION, WHEEL)
    ]
    turns = [pitch_errors.turns(g, i) for g, i in zip((PINION, WHEEL), index, strict=True)]
    here = law.deviated(
        tuple(tooth_deviations(g, r, t) for g, r, t in zip((PINION, WHEEL), relief, turns, strict=True))
    )
    other_pair = GearPair(WHEEL, PINION)
    # the wheel's tooth -1, between the centres with the pinion's tooth 0, is its tooth 0 as a pinion
    as_pinion = tooth_deviations(WHEEL, relief[1], np.roll(turns[1], 1))
    as_wheel = tooth_deviations(PINION, relief[0], np.roll(turns[0], -1))
    there = half_plane_pair(other_pair, elastic_pair(other_pair), deviations=(as_pinion, as_wheel))
    angles, twist = np.linspace(0, 3, 12), np.full(12, math.radians(0.05))
    one = solve_half_plane(here, angles, twist)
    turned = -angles / PAIR.gear_ratio - math.pi / 30 + twist
    # the wheel at this angle of the pinion that is nominal there, and the twist from it
    nominal = -turned / other_pair.gear_ratio + math.pi / 20 * 1
    behind = np.angle(np.exp(1j * 20 * (angles - nominal))) / 20
    other = solve_half_plane(there, turned, behind)
    assert other.torque_wheel == pytest.approx(one.torque_pinion, rel=1e-4)
    assert other.torque_pinion == pytest.approx(one.torque_wheel, rel=1e-4)


def test_relief_as_a_gap_against_elements_on_relieved_meshes(law) -> None:
    """Linear relief in the mesh, by Nitsche's law with flanks of 0.035 mm: 0.05 um of error, 0.2 % of stiffness."""
    amount, length, torque = 15e-6, 2.7e-3, 100.0
    relieved = gear_pair(tip_round=1e-4, tip_relief=TipRelief(amount, length))
    angles = (np.arange(6) + 0.37) * PAIR.mesh_cycle / 6
    reference = sweep_stiffness(relieved, torque=torque, angles=angles, law="nitsche", kinematics="small", coarsen=0.5)
    own = [FlankModification(tip_relief=Relief(amount, g.profile.tip_roll - length)) for g in (PINION, WHEEL)]
    made = load_mesh(
        law.deviated(tuple(tooth_deviations(g, m) for g, m in zip((PINION, WHEEL), own, strict=True))),
        [torque],
        angles=angles,
    )
    assert made.transmission_error[0] == pytest.approx(reference.transmission_error, abs=0.05e-6)
    assert torque / made.twist[0] == pytest.approx(reference.k_torsional, rel=2e-3)


def test_torques_are_carried(law) -> None:
    """The twists are those of the torque search of the stiffness curve, and the pairs' shares and forces add up."""
    angles = (np.arange(10) + 0.2) * PAIR.mesh_cycle / 10
    made = load_mesh(law, [20.0, 150.0], angles=angles)
    for i, torque in enumerate((20.0, 150.0)):
        curve = sweep_stiffness(PAIR, torque=torque, angles=angles, kinematics="small")
        assert made.twist[i] == pytest.approx(curve.twist, rel=2e-6)
        assert made.torque_pinion[i] == pytest.approx(curve.torque_pinion, rel=2e-5)
        assert made.tangent[i] / WHEEL.base_radius**2 == pytest.approx(curve.k_tangent, rel=1e-3)
    leading, shares = made.load_share()
    assert shares.sum(axis=2) == pytest.approx(1.0)
    assert leading.shape == (10,)
    # force times base radius is the torque, on the path
    total = np.zeros((2, 10))
    np.add.at(total, (made.pairs.torque, made.pairs.angle), made.pairs.force * WHEEL.base_radius)
    assert total == pytest.approx(np.repeat([[20.0], [150.0]], 10, axis=1), rel=5e-3)


def test_a_pair_that_never_bears_is_told(law) -> None:
    index = np.zeros(20)
    index[4] = -160e-6
    bad = law.deviated((ToothDeviations(turn=pitch_errors.turns(PINION, index)), NOMINAL[1]))
    with pytest.raises(InputError, match="pinion tooth 4 on wheel tooth 5") as told:
        load_mesh(bad, [10.0], positions=6, mesh_cycles=40)
    least = float(str(told.value).split("about ")[1].split(" ")[0])
    assert 40 < least < 200
    assert load_mesh(bad, [4 * least], positions=6, mesh_cycles=40).statuses == {"converged": 240}


@pytest.mark.parametrize("torques", [[], [0.0], [-1.0], [math.nan], [50.0, 1e6]])
def test_torques_out_of_range(law, torques) -> None:
    with pytest.raises(InputError, match="torques"):
        load_mesh(law, torques)


# ---- job file --------------------------------------------------------------------------------------------------------


def table(**pinion) -> MicrogeometryTable:
    return build(MicrogeometryTable, {"torques_Nm": [50.0], "pinion": pinion}, "microgeometry")


def test_measured_teeth_and_sides(tmp_path) -> None:
    """A file of all teeth; the right flanks come in the order of the pair seen from the other side."""
    low, high = (1e3 * s for s in active_rolls(PAIR)[0])
    rows = ["tooth,roll_length_mm,deviation_um"]
    rows += [f"{t},{s},{t}" for t in range(20) for s in (low - 0.1, 10, high + 0.1)]
    (tmp_path / "teeth.csv").write_text("\n".join(rows))
    (tmp_path / "pitch.csv").write_text("tooth,pitch_um\n" + "\n".join(f"{t},{0.5 * t}" for t in range(20)))
    made = table(measured_csv="teeth.csv", right={"pitch_csv": "pitch.csv"})
    left = deviations_of(made, PAIR, tmp_path)[0]
    right = deviations_of(replace(made, flank="right"), PAIR, tmp_path)[0]
    at = np.array(10e-3)
    order = np.arange(20)
    assert [float(left.profiles[left.profile[t]].at(at)[0]) for t in order] == pytest.approx(1e-6 * order)
    assert [float(right.profiles[right.profile[t]].at(at)[0]) for t in order] == pytest.approx(1e-6 * (-order % 20))
    assert left.alike is False
    assert set(left.turn) == {0.0}
    assert right.turn == pytest.approx(0.5e-6 * (-order % 20) / PINION.reference_radius)


def test_a_k_chart_and_a_relief_are_the_same() -> None:
    one = deviations_of(table(tip_relief_um=20.0, tip_relief_length_mm=3.0), PAIR)[0].profiles[0]
    points = [[0.0, 0.0], [1e3 * (HIGH - 3e-3), 0.0], [1e3 * HIGH, -20.0]]
    other = deviations_of(table(points=points), PAIR)[0].profiles[0]
    diameter = 2e3 * math.hypot(PINION.base_radius, HIGH - 3e-3)
    third = deviations_of(table(tip_relief_um=20.0, tip_relief_start_diameter_mm=diameter), PAIR)[0].profiles[0]
    s = np.linspace(LOW, HIGH, 99)
    assert one.at(s)[0] == pytest.approx(other.at(s)[0], abs=1e-15)
    assert one.at(s)[0] == pytest.approx(third.at(s)[0], abs=1e-15)


@pytest.mark.parametrize(
    ("pinion", "told"),
    [
        ({"tip_relief_um": 5.0}, r"tip_relief_length_mm: is required"),
        ({"tip_relief_length_mm": 2.0}, r"tip_relief_um: is required"),
        ({"tip_relief_um": 5.0, "tip_relief_length_mm": 20.0}, r"tip_relief_length_mm = 20.*on the active flank"),
        ({"tip_relief_um": 5.0, "tip_relief_length_mm": 2.0, "tip_relief_start_mm": 9.0}, "stands beside"),
        ({"points": [[6.0, 0.0], [9.0, 1.0]]}, r"points: covers 6 to 9 mm.*must cover"),
        ({"points": [[9.0, 0.0], [9.0, 1.0]]}, "rising"),
        ({"pitch_um": [1.0, 2.0]}, r"pinion.pitch_um = 2: must have one entry for each of the 20 teeth"),
        ({"pitch_um": [1.0], "pitch_class": 5}, "stands beside pitch_um"),
        ({"pitch_class": 12}, "<= 11"),
        ({"measured_csv": "none.csv"}, "there is no such file"),
        ({"crowning_um": 300.0}, r"pinion.deviation = 300.*0.05 module"),
        ({"tip_releif_um": 1.0}, "tip_relief_um"),
    ],
)
def test_mistakes_in_the_table(pinion, told, tmp_path) -> None:
    with pytest.raises(InputError, match=told):
        deviations_of(table(**pinion), PAIR, tmp_path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("roll_length_mm,deviation_um\n5,0\n8,1", "must cover"),
        ("roll_length_mm\n5", "no column deviation_um"),
        ("deviation_um\n5", "neither of the columns"),
        ("roll_length_mm,deviation_um\n5,a", "row 1 must have 2 numbers"),
        ("roll_length_mm,deviation_um,colour\n5,1,2", "unknown name"),
        ("tooth,roll_length_mm,deviation_um\n0,5,0\n0,16,0", "teeth 0 to 19"),
        ("", "no column"),
    ],
)
def test_mistakes_in_measured_files(text, told, tmp_path) -> None:
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(InputError, match=told):
        deviations_of(table(measured_csv="m.csv"), PAIR, tmp_path)


JOB = """
[pair]
pressure_angle_deg = 25.0
face_width_mm = 10.0
tip_round_mm = 0.1
pinion = { teeth = 20, pitch_diameter_mm = 50.0, bore_diameter_mm = 10.0 }
wheel = { teeth = 30, pitch_diameter_mm = 75.0, bore_diameter_mm = 15.0 }
[microgeometry]
torques_Nm = [50.0, 100.0]
positions = 6
mesh_cycles = 2
tolerance_class = 6
root_stress = true
[microgeometry.pinion]
tip_relief_um = 10.0
tip_relief_length_mm = 3.0
run_out_um = 3.0
[microgeometry.wheel.left]
crowning_um = 2.0
"""


def test_the_command(tmp_path, capsys) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB)
    assert main(["microgeometry", str(job), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "2 torques x 12 positions over 2 mesh cycles: 24 converged" in told
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {
        *(f"microgeometry{part}.csv" for part in ("", "_torques", "_pairs", "_orders")),
        "microgeometry.png", "microgeometry_flanks.png", "microgeometry.json",
    }  # fmt: skip
    with (tmp_path / "out" / "microgeometry.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 24
    assert all(float(row["load_share_1"]) + float(row["load_share_2"]) == pytest.approx(1) for row in rows)
    assert all(float(row["root_stress_pinion_MPa"]) > 20 for row in rows)
    content = json.loads((tmp_path / "out" / "microgeometry.json").read_text())
    out = ["--out", str(tmp_path / "more")]
    options = ["--torques-Nm", "70", "--positions", "4", "--mesh-cycles", "1", "--flank", "right", "--no-picture"]
    assert main(["microgeometry", str(job), *out, *options]) == 0
    assert "1 torques x 4 positions over 1 mesh cycles: 4 converged" in capsys.readouterr().out
    assert not list((tmp_path / "more").glob("*.png"))
    assert content["pitch"]["pinion"]["cumulative_pitch_deviation_um"] == pytest.approx(6.0, rel=1e-3)


def test_the_command_tells_a_mistake_in_one_line(tmp_path, capsys) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB.replace("tip_relief_um = 10.0", "tip_relief_um = 300.0"))
    assert main(["microgeometry", str(job), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert "microgeometry.pinion" in told
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


PAGE = (Path(__file__).parents[1] / "docs" / "microgeometry.md").read_text(encoding="utf-8")


def test_the_page_names_every_key() -> None:
    tables = (MicrogeometryTable, GearMicrogeometryTable, WavinessTable, ReliefTable, VariableTable)
    for name in {*(f.name for table in tables for f in fields(table)), *VARIABLES}:
        assert f"`{name}`" in PAGE, name


def test_the_example_of_the_page_runs() -> None:
    names: dict = {}
    exec(compile(re.search(r"```python\n(.*?)```", PAGE, re.S).group(1), "microgeometry.md", "exec"), names)
    assert len(names["peaks"]) == 2
    assert names["problem"].value([15.3e-6, 2.73e-3]) < 1.2  # the optimum that the page tells
