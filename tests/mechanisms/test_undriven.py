"""Degrees of freedom that no joint prescribes are reported with the bodies that have them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from gearfe.base.config import build, read_toml
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.mechanisms.job import Outcome, run_mechanism
from gearfe.mechanisms.model import make_mechanism
from tests.places import GEOMETRY


def four_bar() -> dict[str, Any]:
    def link(x: float, y: float, turn: float, length: float) -> dict[str, Any]:
        ends = {"A": [0.0, 0.0], "B": [length, 0.0]}
        return {"mass_kg": 1.0, "inertia_kg_m2": 0.1, "position_m": [x, y], "angle_rad": turn, "points_m": ends}

    def hinge(body: str, point: str, to: str, at: Any) -> dict[str, Any]:
        return {"type": "hinge", "body": body, "point": point, "to": to, "to_point": at}

    return {
        "run": {"end_s": 0.02, "step_s": 0.01},
        "bodies": {
            "crank": link(0.0, 0.0, 1.0, 0.3),
            "coupler": link(0.16, 0.25, 0.3, 0.8),
            "rocker": link(1.0, 0.0, 1.6, 0.5),
        },
        "joints": {
            "O": hinge("crank", "A", "ground", [0.0, 0.0]),
            "P": hinge("coupler", "A", "crank", "B"),
            "Q": hinge("coupler", "B", "rocker", "B"),
            "C": hinge("rocker", "A", "ground", [1.0, 0.0]),
            "drive": {"type": "prescribed", "body": "crank", "coordinate": "rate", "motion_rad_per_s": 2.0},
        },
    }


def report(raw: dict[str, Any], folder: Path) -> Outcome:
    return run_mechanism(make_mechanism(build(MechanismFile, raw, "")), folder, estimate=False)


@pytest.mark.parametrize(
    ("missing", "net", "bodies", "text"),
    [
        ((), 0, [], None),
        (("drive",), 1, ["crank", "coupler", "rocker"], "1 degree of freedom\nforces and start velocities move crank"),
        (("Q",), 2, ["coupler", "rocker"], "2 degrees of freedom are not .* rocker; check that no joint"),
        (("P", "Q"), 4, ["coupler", "rocker"], "5 degrees .*, 1 of them prescribed\n4 degrees .* not prescribed:"),
        (("Q", "drive"), 3, ["crank", "coupler", "rocker"], "3 degrees of freedom\nforces and"),
    ],
)  # fmt: skip
def test_what_no_joint_drives(
    missing: tuple[str, ...], net: int, bodies: list[str], text: str | None, tmp_path: Path
) -> None:
    raw = four_bar()
    for name in missing:
        raw["joints"].pop(name)
    outcome = report(raw, tmp_path)
    freedoms = outcome.summary["freedoms"]
    assert (freedoms["net"], freedoms["undriven_bodies"]) == (net, bodies)
    assert freedoms["prescribed"] == int("drive" not in missing)
    if text is None:
        assert "9 coordinates - 8 joint constraints = 1 degree of freedom, which is prescribed\n" in outcome.text
        assert "forces and start velocities" not in outcome.text
    else:
        assert re.search(text, outcome.text), outcome.text


def test_a_third_crank_leaves_one_freedom(tmp_path: Path) -> None:
    """A redundant joint changes nothing in what is undriven."""
    raw = four_bar()
    raw["joints"].pop("drive")
    raw["bodies"]["crank"]["angle_rad"] = 1.0
    raw["joints"]["again"] = {"type": "hinge", "body": "crank", "point": "A"}
    freedoms = report(raw, tmp_path).summary["freedoms"]
    assert (freedoms["net"], freedoms["redundant"]) == (1, 2)
    assert freedoms["undriven_bodies"] == ["crank", "coupler", "rocker"]


def test_degrees_of_freedom_are_those_of_gruebler(tmp_path: Path) -> None:
    """3 (n - 1) - 2 j = 1 for the four-bar, also where a joint or a second motion is redundant."""
    raw = four_bar()
    raw["joints"]["again"] = {"type": "hinge", "body": "crank", "point": "A"}
    text = report(raw, tmp_path).text
    assert "9 coordinates - 10 joint constraints + 2 redundant = 1 degree of freedom, which is prescribed" in text
    raw = four_bar()
    raw["joints"]["twice"] = dict(raw["joints"]["drive"])
    assert "9 coordinates - 8 joint constraints = 1 degree of freedom, which is pre" in report(raw, tmp_path).text


def test_flexible_links_do_not_suggest_a_missing_joint(tmp_path: Path) -> None:
    """A driven slider crank whose rod bends has all its joints; its freedoms are the shapes of the rod."""
    raw = read_toml(GEOMETRY / "elastic_slider_crank.toml")
    raw["run"] |= {"end_s": 1e-4, "step_s": 1e-4}
    raw["run"].pop("picture_s", None)
    outcome = report(raw, tmp_path)
    freedoms = outcome.summary["freedoms"]
    assert (freedoms["prescribed"], freedoms["net_with_rigid_links"]) == (1, 0)
    assert "not prescribed (deformations of flexible links among them): forces" in outcome.text
    assert "joint is missing" not in outcome.text


@pytest.mark.parametrize(("joint", "left"), [("B", 2), ("guide", 2)])
def test_a_missing_joint_shows_beside_flexible_links(joint: str, left: int, tmp_path: Path) -> None:
    """Taken as rigid, rod and slider (3 each) less a hinge of the rod (2), and a guide (2) or a hinge (2): 2 free."""
    raw = read_toml(GEOMETRY / "elastic_slider_crank.toml")
    raw["run"] |= {"end_s": 1e-4, "step_s": 1e-4}
    raw["run"].pop("picture_s", None)
    raw["joints"].pop(joint)
    outcome = report(raw, tmp_path)
    assert outcome.summary["freedoms"]["net_with_rigid_links"] == left
    assert f"{left} of them with rigid links" in outcome.text
    assert outcome.text.splitlines()[1].endswith("; check that no joint is missing")
