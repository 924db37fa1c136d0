"""Planetary stages in job files: the shipped one, keys, and what is wrong with a file."""

from __future__ import annotations

import copy
import json
import math
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.spectrum import OrderLine
from gearfe.base.tables.jobs import train_tables
from gearfe.cli.main import main
from gearfe.drivetrain.gearbox.job import job_train, train_job
from gearfe.drivetrain.gearbox.stage_report import stage_entries
from gearfe.drivetrain.train import GearTrain, build_train
from gearfe.drivetrain.train.checks import planets_overlap
from gearfe.drivetrain.vibration.report import sideband
from tests.campaigns.toml_text import toml_text
from tests.makers.files import job_file
from tests.places import GEOMETRY

SHIPPED = GEOMETRY / "planetary.toml"


def tables(**changes: Any) -> dict[str, Any]:
    """The shipped job with given stiffnesses and some keys changed, as ``shafts__ring__speed_ratio``."""
    raw = tomllib.loads(SHIPPED.read_text(encoding="utf-8"))
    raw["meshes"]["sun_planet"] = {"driver": "sun", "driven": "planet", "stiffness_N_per_m": 8e8}
    raw["meshes"]["planet_ring"] = {"driver": "planet", "driven": "ring", "stiffness_N_per_m": 1e9}
    for key, value in changes.items():
        *path, last = key.split("__")
        table = raw
        for part in path:
            table = table.setdefault(part, {})
        if value is None:
            table.pop(last)
        else:
            table[last] = value
    return raw


def at_angles(angles: list[float]) -> dict[str, Any]:
    """Changes of the shipped job: planets at angles (deg)."""
    return {"carriers__arm__planets": None, "carriers__arm__planet_angles_deg": angles}


def made(raw: dict[str, Any]) -> GearTrain:
    return job_train(train_job(SHIPPED, train_tables(copy.deepcopy(raw), SHIPPED)), None)


def test_planets_are_written_once_and_stand_at_their_places() -> None:
    train = made(tables())
    assert [shaft.name for shaft in train.shafts] == ["sun", "planet_1", "planet_2", "planet_3", "ring", "carrier"]
    assert [mesh.name for mesh in train.meshes][:3] == ["sun_planet_1", "sun_planet_2", "sun_planet_3"]
    carrier = train.carriers[0]
    angles = np.degrees([train.pin_angle(carrier, pin) for pin in carrier.pins]) % 360.0
    np.testing.assert_allclose(angles, [0.0, 120.0, 240.0], atol=1e-9)
    np.testing.assert_allclose([pin.error for pin in carrier.pins], [[0.0, 2e-5], [0.0, 0.0], [0.0, 0.0]])


def test_angles_are_about_plus_y() -> None:
    """z = -78 mm is a quarter of a turn about +y from x = 78 mm."""
    pitch = 360.0 / 78.0
    train = made(tables(**at_angles([0.0, 20 * pitch, 50 * pitch]), carriers__arm__pin_tangential_errors_um=None))
    angle = math.radians(20 * pitch)
    np.testing.assert_allclose(train.shafts[2].point, [0.078 * math.cos(angle), 0.0, -0.078 * math.sin(angle)])


def test_a_given_phase_is_that_of_the_first_planet() -> None:
    """Teeth of sun and ring place those of the others, a third of a cycle apart as without it."""
    plain, train = made(tables()), made(tables(meshes__sun_planet__phase_deg=3.0))
    phases, before = (np.array(one.kinematics.phases[:3]) * 17 / (2.0 * math.pi) for one in (train, plain))
    assert phases[0] == pytest.approx(3.0 * 17 / 360.0)
    np.testing.assert_allclose((phases - phases[0]) % 1.0, (before - before[0]) % 1.0, atol=1e-9)


def test_the_summary_has_fractions_phases_and_sidebands() -> None:
    """17/22/-61, ring fixed: carrier 17/78, planet -17/44; 61/3 leaves 1: translational modes, sidebands."""
    train = made(tables())
    entries = stage_entries(build_train(train))["planetary"]
    assert entries["speed_ratios"]["carrier"] == "17/78"
    assert entries["speed_ratios"]["planet_1"] == "-17/44"
    assert entries["torque_ratios"]["carrier"] == {"sun": "-17/78", "ring": "-61/78"}
    ring = entries["meshes"][1]
    assert sorted(ring["phases_of_a_cycle"]) == pytest.approx([0.0, 1 / 3, 2 / 3], abs=1e-9)
    assert ring["harmonics"][0]["excites"] == ["translational"]
    assert ring["harmonics"][2]["excites"] == ["rotational"]
    order = entries["orders"][0]
    assert order["order"] == pytest.approx(17 * 61 / 78)
    assert list(order["sidebands"].values()) == pytest.approx([17 * 60 / 78, 17 * 62 / 78])


def test_lines_beside_a_mesh_frequency_are_named_by_the_turns_of_the_carrier() -> None:
    lines = (OrderLine("mesh 1", 1, 300.0), OrderLine("mesh 1", 2, 600.0))
    response: Any = SimpleNamespace(carrier_frequencies_Hz={"arm": 5.0})
    assert sideband(305.0, lines, response, 1.0) == "mesh 1 x 1 + 1 x carrier arm"
    assert sideband(585.0, lines, response, 1.0) == "mesh 1 x 2 - 3 x carrier arm"
    assert sideband(302.5, lines, response, 1.0) is None
    assert sideband(305.0, lines, response, 6.0) is None  # the spectrum does not part them
    fast: Any = SimpleNamespace(carrier_frequencies_Hz={"arm": 350.0})  # 350 - 300 Hz is the family of -300 + 350 Hz
    assert sideband(50.0, lines, fast, 1.0) == "1 x carrier arm - mesh 1 x 1"


def test_shipped_modes_run_from_the_command_line(tmp_path: Path) -> None:
    assert main(["modes", str(SHIPPED), "--out", str(tmp_path), "--no-pictures", "-q"]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    labels = [mode["label"] for mode in summary["modes"]]
    assert any(label.startswith("translational mode of carrier arm") for label in labels)
    assert summary["planetary"]["speed_ratios"]["carrier"] == "17/78"


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"shafts__ring__speed_ratio": None, "shafts__ring__holding_stiffness_Nm_per_rad": None}, "turns freely"),
        ({"shafts__carrier__speed_ratio": 0}, r"shaft 'carrier' speed_ratio.*is fixed, but"),
        ({"train__drive": None}, "no shaft is driven"),
        ({"carriers__arm__planets": 4, "carriers__arm__pin_tangential_errors_um": None}, "does not mesh with gears"),
        (at_angles([0.0, 30.0]), r"pin_tangential_errors_um.*3 values for 2 planets"),
        ({"carriers__arm__planets": 0}, r"carriers\.arm\.planets = 0"),
        (at_angles([0.0, 120.0, 480.0]), "each once"),
        ({"carriers__arm__shaft": "arm"}, r"carriers\.arm\.shaft.*no shaft of this file"),
        ({"carriers__arm__pin_stiffness_N_per_m": [1e8, 1e8]}, r"one number > 0, or three"),
        (
            {"carriers__arm__pin_stiffness_N_per_m": [1e8, 2e8, 1e8, 5.0, 6.0]},
            r"pin_stiffness_N_per_m = \[.*2.*\] and pin_tilt_stiffness_Nm_per_rad = \[5.0, 6.0\]",
        ),
        ({"carriers__arm__pin_tilt_stiffness_Nm_per_rad": [5.0, 6.0]}, r"needs three numbers of pin_stiffness_N_per_m"),
        ({"shafts__planet__carrier": "leg"}, r"shafts\.planet\.carrier.*write \"arm\""),
        ({"shafts__planet__carrier": None}, r"carriers\.arm.*carries nothing"),
        ({"shafts__planet__speed_ratio": 0}, "whose rotation follows from its meshes"),
        ({"shafts__ring__speed_ratio": "none"}, "is no number"),
        ({"shafts__sun__holding_stiffness_Nm_per_rad": 1e6}, "is of a shaft with speed_ratio"),
        ({"shafts__planet__attachments": [1]}, "bearings carry it: 1"),
        ({"gears__ring__module_mm": 4.5}, "modules"),
        ({"gears__ring__teeth": -62}, "mm apart"),
        ({"train__housing": "elastic"}, "housing"),
        ({"bearings__sun__stiffness_N_per_m": [1e7, 1e8, 2e7]}, "differs across the axis"),
    ],
)
def test_what_is_wrong_with_a_stage_is_named(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        build_train(made(tables(**changes)))


def test_planets_that_collide_are_named() -> None:
    """At 60 deg the tips of two planets of 22 teeth overlap: 78 mm < 2 * 48 mm."""
    raw = tables(**at_angles([0.0, 60.0]), carriers__arm__pin_tangential_errors_um=None)
    text = r"^carriers\.arm: has 2 planets, and gear 'planet_1' overlaps gear 'planet_2'.*at least 75\."
    with pytest.raises(InputError, match=text):
        build_train(made(raw))


def test_angles_that_teeth_do_not_allow_are_named_by_their_key() -> None:
    """The file has planet_angles_deg, not planets."""
    raw = tables(**at_angles([0.0, 121.0, 240.0]))
    with pytest.raises(InputError, match=r"^carriers\.arm\.planet_angles_deg: planet 2 does not mesh with gears"):
        build_train(made(raw))


def test_no_angle_is_proposed_for_planets_larger_than_their_carrier() -> None:
    """Two planets opposite each other are 2 r_c apart at most."""
    assert "deg" not in str(planets_overlap("arm", 2, ("a", "b"), needed=0.21, apart=0.2, arm=0.1))
    assert "at least 60.000" in str(planets_overlap("arm", 7, ("a", "b"), needed=0.1 - 2e-9, apart=0.09, arm=0.1))


def test_messages_have_the_tables_of_the_planets_as_written() -> None:
    """The file has [gears.planet], not one table for each planet."""
    for key, value in (("addendum", 3.0), ("module_mm", 4.5), ("rack_tip_radius", 0.9)):
        with pytest.raises(InputError, match=rf"^gears\.planet\.{key} = {value}: "):
            build_train(made(tables(**{f"gears__planet__{key}": value})))


def test_modes_are_drawn_beside_the_orders_of_shafts_that_turn(tmp_path: Path) -> None:
    """A fixed ring has no order."""
    path = job_file(tmp_path, toml_text(tables(modes__speeds=2)))
    assert main(["modes", str(path), "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "campbell.png").exists()
    assert "x shaft ring" not in (tmp_path / "out" / "critical_speeds.csv").read_text(encoding="utf-8")


def test_phases_of_a_speed_increaser_are_those_of_the_reducer() -> None:
    """The sense in which the sun turns counts, and not the one in which it pushes."""
    reducer = tables(train__damping=None)
    increaser = copy.deepcopy(reducer)
    increaser["train"]["drive"] |= {"shaft": "carrier", "attachment": "carrier", "speed_rad_per_s": 34.23}
    increaser["train"]["loads"] = [{"shaft": "sun", "attachment": "sun", "torque_Nm": -1000.0}]
    phases = [
        [family["phases_of_a_cycle"] for family in stage_entries(build_train(made(raw)))["planetary"]["meshes"]]
        for raw in (reducer, increaser)
    ]
    np.testing.assert_allclose(phases[0], phases[1], atol=1e-9)
