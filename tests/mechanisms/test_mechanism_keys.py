"""Every key that a table of a mechanism accepts acts, or is refused: from the key tables, so new keys are in."""

from __future__ import annotations

import copy
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build, read_toml
from gearfe.base.errors import InputError
from gearfe.base.tables.beam import BeamTable
from gearfe.base.tables.kinds import FORCES, JOINTS, MOTIONS, UNIT_OF
from gearfe.base.tables.mechanism import BodyTable, FunctionTable, MechanismFile, ValueTableTable
from gearfe.base.tables.plate import InterfaceTable, PlateTable
from gearfe.mechanisms.model import make_mechanism
from gearfe.mechanisms.results import reactions
from gearfe.mechanisms.solve import solve
from gearfe.mechanisms.unused import unused
from tests.places import GEOMETRY


def body(x: float, y: float, turn: float, rate: float = 0.0, speed: float = 0.0) -> dict[str, Any]:
    return {
        "mass_kg": 1.5, "inertia_kg_m2": 0.2, "centre_m": [0.1, 0.05], "position_m": [x, y], "angle_rad": turn,
        "rate_rad_per_s": rate, "velocity_m_per_s": [speed, 0.5 * speed],
    }  # fmt: skip


def hinge(name: str, to: str = "ground", at: tuple[float, float] = (0.0, 0.0)) -> dict[str, Any]:
    return {"type": "hinge", "body": name, "to": to, "to_point": list(at)}


#: Three bodies that move and turn against each other; arm is the partner of what is tried.
BODIES = {
    "link": body(0.5, 0.3, 0.4, 1.0, 0.7), "arm": body(0.0, 0.0, 0.2, -2.0), "other": body(-0.6, 0.2, -0.3, 3.0, 0.2)
}  # fmt: skip
PLANET = {"pivot": hinge("arm"), "planet": hinge("link", "arm", (0.4, 0.0)), "sun": hinge("other")}
SLIDE = {
    "pivot": hinge("arm"),
    "guide": {"type": "prismatic", "body": "link", "to": "arm", "direction": [1.0, 0.5]},
    "pinion": hinge("other", "arm", (0.1, 0.3)),
}
SHAFT = {"pivot": hinge("arm"), "sun": hinge("other", at=(-0.6, 0.2))}
#: Variants of every type: the keys of a joint or force, and the joints beside it.
Parts = dict[str, tuple[str, dict[str, Any], dict[str, Any]]]
ENDS = {"body": "link", "to": "arm", "point": [0.1, 0.2], "to_point": [0.3, -0.1]}
LINE = {**ENDS, "direction": [1.0, 0.5]}
PLACE = {"body": "link", "to": "arm", "point": [0.1, 0.2]}
JOINT_CASES: Parts = {
    "hinge": ("hinge", ENDS, {}),
    "slot": ("slot", LINE, {}),
    "prismatic": ("prismatic", {**LINE, "angle_deg": 20.0}, {}),
    "distance": ("distance", {**ENDS, "length_m": 0.4}, {}),
    "fixed": ("fixed", {"body": "link", "to": "arm"}, {}),
    "gear": ("gear", {"body": "link", "to": "other", "ratio": -0.7}, PLANET),
    "belt": ("belt", {"body": "link", "to": "other", "radius_m": 0.1, "to_radius_m": 0.15}, PLANET),
    "rack": ("rack", {"body": "link", "to": "other", "point": [0.1, 0.2], "radius_m": 0.1, "direction": [1.0, 0.5]},
             SLIDE),
    "rolling": ("rolling", {**LINE, "radius_m": 0.2}, {}),
    "cam y": ("cam", {**PLACE, "to": "other", "coordinate": "y", "profile": "lift"}, SHAFT),
    "cam angle": ("cam", {"body": "link", "to": "other", "coordinate": "angle", "profile": "lift"}, SHAFT),
    "prescribed x": ("prescribed", {**PLACE, "coordinate": "x", "motion_m": {"polynomial": [0.6, 0.3]}}, {}),
    "prescribed y": ("prescribed", {**PLACE, "coordinate": "y", "motion_m": {"polynomial": [0.1, 0.3]}}, {}),
    "prescribed angle": ("prescribed", {"body": "link", "to": "arm", "coordinate": "angle", "motion_rad": 0.3}, {}),
    "prescribed rate": ("prescribed", {"body": "link", "to": "arm", "coordinate": "rate", "motion_rad_per_s": 0.3}, {}),
}  # fmt: skip
SPRING = {
    **ENDS,
    "stiffness_N_per_m": 30.0,
    "damping_N_s_per_m": 0.5,
    "free_length_m": 0.2,
    "tension_N": "2*length_rate",
}
FORCE_CASES: Parts = {
    "gravity": ("gravity", {"acceleration_m_per_s2": [0.0, -9.81]}, {}),
    "spring": ("spring", SPRING, {}),
    "spring without stiffness": ("spring", {**ENDS, "damping_N_s_per_m": 0.5}, {}),
    "angle spring": ("coordinate_spring", {"body": "link", "to": "arm", "coordinate": "angle",
                                           "stiffness_Nm_per_rad": 9.0, "damping_Nm_s_per_rad": 0.5,
                                           "reference_rad": 0.1}, {}),
    "x spring": ("coordinate_spring", {"body": "link", "coordinate": "x", "stiffness_N_per_m": 9.0}, {}),
    "y damper": ("coordinate_spring", {"body": "link", "coordinate": "y", "damping_N_s_per_m": 9.0}, {}),
    "force": ("force", {"body": "link", "point": [0.1, 0.2], "x_N": 2.0, "y_N": "3*time"}, {}),
    "moment": ("moment", {"body": "link", "to": "arm", "moment_N_m": 0.4}, {}),
    "turning_frame": ("turning_frame", {"rate_rad_per_s": 2.0}, {}),
}  # fmt: skip
#: Another value of every key.
OTHER: dict[str, Any] = {
    "body": "other", "to": "ground", "point": [-0.2, 0.1], "to_point": [-0.1, 0.25], "direction": [0.3, 1.0],
    "angle_deg": 45.0, "length_m": 0.55, "ratio": 0.4, "radius_m": 0.14, "to_radius_m": 0.22, "crossed": True,
    "carrier": "ground", "coordinate": "y", "profile": "higher", "motion_m": {"polynomial": [0.4, 0.9]},
    "motion_rad": {"polynomial": [0.4, 0.9]}, "motion_rad_per_s": {"polynomial": [0.4, 0.9]},
    "acceleration_m_per_s2": [1.0, -3.0], "stiffness_N_per_m": 50.0, "damping_N_s_per_m": 1.5,
    "stiffness_Nm_per_rad": 50.0, "damping_Nm_s_per_rad": 1.5, "reference_rad": -0.4, "free_length_m": 0.5,
    "tension_N": "5*length", "reference_m": -0.4, "rate_rad_per_s": 3.0, "x_N": {"constant": 5.0}, "y_N": 7.0,
    "moment_N_m": "rate(link)",
}  # fmt: skip
#: What the other value of a key is refused for; everything else must act.
REFUSED = {
    ("angle spring", "coordinate"): "has another unit",
    ("rack", "body"): "is unknown|joins a body to itself",
    ("rack", "to"): "is unknown|name the other body",
    ("cam y", "body"): "to itself",
    ("cam angle", "body"): "to itself",
    ("cam y", "to"): "couples turns of two bodies",
    ("cam angle", "to"): "couples turns of two bodies",
    ("cam angle", "point"): "has no part in an angle",
    ("prescribed angle", "point"): "has no part in an angle",
    ("prescribed rate", "point"): "has no part in an angle",
    ("prescribed angle", "to_point"): "has no part in an angle",
    ("prescribed rate", "to_point"): "has no part in an angle",
    ("spring without stiffness", "free_length_m"): "says nothing without stiffness_N_per_m",
    ("y damper", "reference_m"): "says nothing without stiffness_N_per_m",
    ("x spring", "to"): "only an angle can be relative",
    ("y damper", "to"): "only an angle can be relative",
}
#: Other values where the common one says the same as the default or the case.
SPECIAL: dict[tuple[str, str], Any] = {
    ("gear", "body"): "arm", ("belt", "body"): "arm",
    ("prescribed y", "coordinate"): "x", ("cam y", "coordinate"): "x", ("y damper", "coordinate"): "x",
    ("x spring", "to"): "arm", ("y damper", "to"): "arm",
    ("cam y", "carrier"): "arm", ("cam angle", "carrier"): "arm", ("rack", "body"): "other", ("rack", "to"): "arm",
}  # fmt: skip
#: Keys with another unit than the coordinate of the case, and coordinates with another unit than its key.
REFUSED |= {
    **{
        (f"prescribed {name}", key): "has another unit"
        for name, own in UNIT_OF.items()
        for key in MOTIONS
        if key != f"motion_{own}"
    },
    **{(f"prescribed {name}", "coordinate"): "has another unit" for name in ("angle", "rate")},
    **{
        (case, f"{key}_{unit}"): "has another unit"
        for case, units in (
            ("angle spring", ("N_per_m", "N_s_per_m", "m")),
            ("x spring", ("Nm_per_rad", "Nm_s_per_rad", "rad")),
            ("y damper", ("Nm_per_rad", "Nm_s_per_rad", "rad")),
        )
        for key, unit in zip(("stiffness", "damping", "reference"), units, strict=True)
    },
    ("x spring", "reference_rad"): "says nothing without stiffness_Nm_per_rad",
    ("y damper", "reference_rad"): "says nothing without stiffness_Nm_per_rad",
    ("angle spring", "reference_m"): "says nothing without stiffness_N_per_m",
    ("cam y", "carrier"): "must be the ground",
    ("cam angle", "carrier"): "must be the ground",
}


def answer(raw: dict[str, Any], folder: Path) -> np.ndarray:
    """All numbers of the run."""
    mechanism = make_mechanism(build(MechanismFile, copy.deepcopy(raw), ""), folder / "job.toml")
    solved = solve(mechanism)
    numbers = [np.ravel(column) for table in solved.tables().values() for column in table.values()]
    if solved.rest is None:
        numbers += [solved.results.trajectory.q.ravel(), *reactions(mechanism, solved.results.trajectory).values()]
    return np.concatenate(numbers)


def check(raw: dict[str, Any], where: list[str], key: str, value: Any, folder: Path, refused: str | None) -> None:
    """Another value of one key changes numbers, or is refused for the reason given."""
    before = answer(raw, folder)
    changed = copy.deepcopy(raw)
    table = changed
    for name in where:
        table = table[name]
    assert table.get(key) != value, "the other value must differ"
    table[key] = value
    if refused is not None:
        with pytest.raises(InputError, match=refused):
            answer(changed, folder)
        return
    after = answer(changed, folder)
    assert after.shape != before.shape or np.nanmax(np.abs(after - before)) > 1e-9 * np.nanmax(np.abs(before))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    for name, height in (("lift", 0.05), ("higher", 0.09)):
        lines = [f"{a!r},{float(height * (1.0 - np.cos(a)))!r},{a!r}" for a in map(float, angle)]
        (tmp_path / f"{name}.csv").write_text("angle,lift,copy\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path


def tables(**parts: Any) -> dict[str, Any]:
    cams = {n: {"file": f"{n}.csv", "x": "angle", "y": "lift", "interpolation": "periodic"} for n in ("lift", "higher")}
    run = {"end_s": 0.05, "step_s": 0.025}
    return copy.deepcopy({"run": run, "bodies": BODIES, "tables": cams, **parts})


JOINT_KEYS = [(case, key) for case, (kind, *_) in JOINT_CASES.items() for key in JOINTS[kind].fields]
FORCE_KEYS = [(case, key) for case, (kind, *_) in FORCE_CASES.items() for key in FORCES[kind].fields]


def test_every_type_has_a_case() -> None:
    assert {kind for kind, *_ in JOINT_CASES.values()} == JOINTS.keys()
    assert {kind for kind, *_ in FORCE_CASES.values()} == FORCES.keys()


@pytest.mark.parametrize(("case", "key"), JOINT_KEYS)
def test_keys_of_joints(case: str, key: str, folder: Path) -> None:
    kind, keys, beside = JOINT_CASES[case]
    raw = tables(joints={**beside, "tried": {"type": kind, **keys}})
    value = SPECIAL.get((case, key), OTHER[key])
    check(raw, ["joints", "tried"], key, value, folder, REFUSED.get((case, key)))


@pytest.mark.parametrize(("case", "key"), FORCE_KEYS)
def test_keys_of_forces(case: str, key: str, folder: Path) -> None:
    kind, keys, _ = FORCE_CASES[case]
    raw = tables(joints={"pivot": hinge("arm")}, forces={"tried": {"type": kind, **keys}})
    value = SPECIAL.get((case, key), OTHER[key])
    check(raw, ["forces", "tried"], key, value, folder, REFUSED.get((case, key)))


OTHER_OF_BODY: dict[str, tuple[Any, str | None]] = {
    "mass_kg": (3.0, None), "inertia_kg_m2": (0.7, None), "centre_m": ([0.3, -0.1], None),
    "position_m": ([0.7, 0.3], None), "angle_deg": (30.0, "angle_deg and angle_rad"), "angle_rad": (0.9, None),
    "velocity_m_per_s": ([0.1, 2.0], None), "rate_rad_per_s": (4.0, None), "points_m": ({"P": [0.5, 0.0]}, None),
    "flexible": (True, "needs a beam or a plate"), "beam": ({}, "is required"), "plate": ({}, "is required"),
}  # fmt: skip


@pytest.mark.parametrize("key", [field.name for field in fields(BodyTable)])
def test_keys_of_bodies(key: str, folder: Path) -> None:
    """A body on a spring at its point P, under gravity."""
    spring = {"type": "spring", "body": "link", "point": "P", "stiffness_N_per_m": 30.0}
    raw = tables(forces={"spring": spring, "gravity": {"type": "gravity", "acceleration_m_per_s2": [0.0, -9.81]}})
    raw["bodies"]["link"]["points_m"] = {"P": [0.2, 0.1]}
    value, refused = OTHER_OF_BODY[key]
    check(raw, ["bodies", "link"], key, value, folder, refused)


def force_over_time(**function: Any) -> dict[str, Any]:
    return tables(forces={"tried": {"type": "force", "body": "link", "x_N": function}})


WAVE = {"constant": 1.0, "polynomial": [1.0, 2.0], "origin_s": 0.01, "step": 3.0, "step_centre_s": 0.02,
        "step_width_s": 0.03, "sine": 2.0, "frequency_hz": 9.0, "phase_deg": 10.0, "table": "early"}  # fmt: skip
OTHER_WAVE = {"constant": 2.0, "polynomial": [1.0, 3.0], "origin_s": 0.02, "step": 4.0, "step_centre_s": 0.03,
              "step_width_s": 0.05, "sine": 3.0, "frequency_hz": 5.0, "phase_deg": 50.0, "table": "later"}  # fmt: skip


def with_tables(raw: dict[str, Any]) -> dict[str, Any]:
    raw["tables"] = {
        "early": {"file": "lift.csv", "x": "angle", "y": "lift"},
        "later": {"file": "higher.csv", "x": "angle", "y": "lift"},
    }
    return raw


@pytest.mark.parametrize("key", [field.name for field in fields(FunctionTable)])
def test_keys_of_functions_of_time(key: str, folder: Path) -> None:
    raw = with_tables(force_over_time(**WAVE))
    check(raw, ["forces", "tried", "x_N"], key, OTHER_WAVE[key], folder, None)
    alone = {"origin_s": "polynomial", "step_centre_s": "step", "step_width_s": "step", "frequency_hz": "sine",
             "phase_deg": "sine"}  # fmt: skip
    if key in alone:
        lonely = force_over_time(constant=1.0)
        check(lonely, ["forces", "tried", "x_N"], key, 0.01, folder, f"says nothing without {alone[key]}")


@pytest.mark.parametrize("key", [field.name for field in fields(ValueTableTable)])
def test_keys_of_tables(key: str, folder: Path) -> None:
    """A force by a table of the time."""
    raw = tables(forces={"tried": {"type": "force", "body": "link", "x_N": "1e3*known(0.3 + 20*time)"}})
    raw["tables"] = {"known": {"file": "lift.csv", "x": "angle", "y": "lift"}}
    values = {"file": "higher.csv", "x": "copy", "y": "copy", "interpolation": "linear"}
    if key == "x":  # another argument with the same values: one that does not rise is refused
        check(raw, ["tables", "known"], key, "lift", folder, "must rise")
        return
    check(raw, ["tables", "known"], key, values[key], folder, None)


MATERIAL = {"youngs_modulus_GPa": 0.5, "density_kg_per_m3": 1200.0, "damping_s": 1e-3}
OTHER_MATERIAL = {
    "youngs_modulus_GPa": 0.8, "density_kg_per_m3": 2000.0, "damping_s": 3e-3, "poisson_ratio": 0.45, "frame": "start",
}  # fmt: skip
SECTIONS: dict[str, dict[str, float]] = {
    "rectangle": {"width_m": 0.02, "height_m": 0.03},
    "tube": {"diameter_m": 0.03, "inner_diameter_m": 0.01},
    "any": {"area_m2": 6e-4, "second_moment_m4": 4e-8, "edge_m": 0.015},
}
BEAM_KEYS = [
    (section, field.name)
    for section, keys in SECTIONS.items()
    for field in fields(BeamTable)
    if field.name in keys or section == "rectangle"
]


def flexible(kind: str, table: dict[str, Any], point: str, outputs: tuple[str, ...]) -> dict[str, Any]:
    """A link clamped at its start under its weight and an inclined force: rest and vibrations."""
    link: dict[str, Any] = {kind: table}
    if kind == "beam":
        link["points_m"] = {"end": [0.4, 0.0], "middle": [0.2, 0.0]}
    return {
        "run": {"end_s": 1.0, "step_s": 1.0, "analysis": "modes", "modes": 3},
        "bodies": {"link": link},
        "joints": {"clamp": {"type": "fixed", "body": "link" if kind == "beam" else f"link.{point}"}},
        "forces": {
            "gravity": {"type": "gravity", "acceleration_m_per_s2": [0.0, -9.81]},
            "pull": {"type": "force", "body": "link", "point": "end", "x_N": 1.0, "y_N": -2.0},
        },
        "outputs": [{"name": f"u{k}", "value": value} for k, value in enumerate(outputs)],
    }


@pytest.mark.parametrize(("section", "key"), BEAM_KEYS)
def test_keys_of_beams(section: str, key: str, folder: Path) -> None:
    table = {"length_m": 0.4, **MATERIAL, **SECTIONS[section]}
    raw = flexible("beam", table, "start", ("deflection(link.middle)", "edge_stress(link.middle)", "y(link.end)"))
    other = {"length_m": 0.5, "elements": 9, **OTHER_MATERIAL}
    value = other.get(key) or 1.2 * SECTIONS[section].get(key, 0.01)
    refused = None
    if key not in table and key not in other:
        refused = "has two sections|belongs to a section"
    check(raw, ["bodies", "link", "beam"], key, value, folder, refused)


OUTLINE = [[0.0, -0.03], [0.4, -0.03], [0.4, 0.03], [0.0, 0.03]]
OTHER_PLATE: dict[str, tuple[Any, str | None]] = {
    "interfaces": ({"start": {"edge_m": [[0.0, -0.03], [0.0, 0.03]]}, "end": {"centre_m": [0.3, 0.0], "radius_m": 0.01},
                    "middle": {"centre_m": [0.2, 0.0], "radius_m": 0.01}}, None),
    "thickness_m": (0.02, None), "outline_m": ([*OUTLINE[:3], [0.0, 0.04]], None),
    "holes_m": ([[0.1, 0.0, 0.012]], None), "mesh": ("part.msh", "has two shapes"),
    "mesh_unit_m": (0.001, "belongs to a mesh"), "element_size_m": (0.012, None), "modes": (1, None),
    **{key: (value, None) for key, value in OTHER_MATERIAL.items()},
}  # fmt: skip


def plate() -> dict[str, Any]:
    held = {
        "start": {"edge_m": [[0.0, -0.03], [0.0, 0.03]]},
        "end": {"centre_m": [0.38, 0.0], "radius_m": 0.01},
        "middle": {"centre_m": [0.2, 0.0], "radius_m": 0.01},
    }
    table = {**MATERIAL, "thickness_m": 0.01, "outline_m": OUTLINE, "element_size_m": 0.03, "interfaces": held}
    return flexible("plate", table, "start", ("deflection(link.middle)", "largest_von_mises(link)", "y(link.end)"))


@pytest.mark.parametrize("key", [field.name for field in fields(PlateTable)])
def test_keys_of_plates(key: str, folder: Path) -> None:
    value, refused = OTHER_PLATE[key]
    check(plate(), ["bodies", "link", "plate"], key, value, folder, refused)


@pytest.mark.parametrize("key", [field.name for field in fields(InterfaceTable)])
def test_keys_of_interfaces(key: str, folder: Path) -> None:
    where = ["bodies", "link", "plate", "interfaces", "end"]
    other = {"centre_m": [0.35, 0.0], "radius_m": 0.015, "edge_m": [[0.4, -0.03], [0.4, 0.03]]}
    check(plate(), where, key, other[key], folder, "belongs to a hole" if key == "edge_m" else None)


def test_required_keys_are_required() -> None:
    """Fields without a default are those that the reader asks for."""
    for table in (BodyTable, FunctionTable):
        assert all(f.default is not MISSING or f.default_factory is not MISSING for f in fields(table))


@pytest.mark.parametrize(
    ("where", "key", "value", "remark"),
    [
        ("run", "modes", 4, "run.modes = 4 has no effect"),
        ("run", "picture_s", 9.0, "run.picture_s = 9 is after the end of the run"),
        ("figure", "every", 5, "figure.every has no effect"),
        ("figure", "magnification", 20.0, "figure.magnification has no effect"),
        ("tables", "spare", {"file": "lift.csv", "x": "angle", "y": "lift"}, "tables.spare has no effect"),
    ],
)
def test_keys_without_effect_get_a_remark(where: str, key: str, value: Any, remark: str) -> None:
    raw = tables(forces={"tried": {"type": "force", "body": "link", "x_N": "lift(time) + higher(time)"}})
    assert unused(build(MechanismFile, copy.deepcopy(raw), "")) == []
    raw.setdefault(where, {})[key] = value
    assert [text[: len(remark)] for text in unused(build(MechanismFile, raw, ""))] == [remark]


@pytest.mark.parametrize("analysis", ["equilibrium", "modes", "inverse"])
def test_keys_of_a_run_over_time_get_a_remark_without_one(analysis: str) -> None:
    raw = tables(forces={"tried": {"type": "force", "body": "link", "x_N": "lift(time) + higher(time)"}})
    raw["run"] |= {"analysis": analysis, "method": "taylor", "tolerance": 1e-7}
    remarks = unused(build(MechanismFile, raw, ""))
    assert remarks == [f"run.{key} has no effect: analysis is {analysis}" for key in ("method", "tolerance")]


@pytest.mark.parametrize("job", sorted(GEOMETRY.glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_mechanisms_have_no_keys_without_effect(job: Path) -> None:
    raw = read_toml(job)
    if "bodies" in raw:
        assert unused(build(MechanismFile, raw, "")) == []
