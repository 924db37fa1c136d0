"""Links given by the positions of their joints, against the same mechanisms with lengths, poses and masses."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.config import read_toml
from gearfe.base.errors import InputError
from gearfe.base.tables.mechanism import mechanism_tables
from gearfe.base.typing import Array
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.solve import solve, sweep
from tests.makers.files import mechanism_file
from tests.makers.four_bar import COUPLER, CRANK, GROUND, PHI, ROCKER, closure, unit
from tests.places import GEOMETRY

RUN = """
[run]
end_s = {end}
step_s = 0.01
tolerance = 1e-13
[forces.gravity]
type = "gravity"
acceleration_m_per_s2 = [0.0, -9.81]
"""
ANGLES, LENGTHS = (PHI, *closure(PHI)[:2]), (CRANK, COUPLER, ROCKER)
A = CRANK * unit(PHI)
B = A + COUPLER * unit(ANGLES[1])
OUTPUTS = """
[start.velocities]
"rate(crank)" = 5.0
""" + "".join(
    f'[[outputs]]\nname = "{name}"\nvalue = "{value}"\n'
    for name, value in (
        ("crank_rad", "angle(crank)"), ("coupler_rad", "angle(coupler)"), ("rocker_rad_per_s", "rate(rocker)"),
        ("x_B_m", "x(coupler.B)"), ("y_B_m", "y(rocker.B)"), ("a_A_m_per_s2", "ax(crank.A)"),
        ("load_N", "reaction_y(O)"), ("joint_rad", "angle(B)"),
    )
)  # fmt: skip
FOUR_BAR = f"""
links = {{ mass_per_length_kg_per_m = 2.5 }}
[joints]
O = {{ at_m = [0, 0], links = ["ground", "crank"] }}
A = {{ at_m = {A.tolist()}, links = ["coupler", "crank"] }}
B = {{ at_m = {B.tolist()}, links = ["coupler", "rocker"] }}
C = {{ at_m = [{GROUND}, 0.0], links = ["rocker", "ground"] }}
"""


def rod(name: str, length: float, at: Array, angle: float, points: str) -> str:
    """Table of a uniform slender rod of 2.5 kg/m."""
    mass = 2.5 * length
    return (
        f"[bodies.{name}]\nmass_kg = {mass}\ninertia_kg_m2 = {mass * length**2 / 12.0}\n"
        f"centre_m = [{length / 2}, 0.0]\nposition_m = {list(map(float, at))}\nangle_rad = {angle}\n"
        f"points_m = {points}\n"
    )


def hinge(name: str, body: str, to: str) -> str:
    return f'[joints.{name}]\ntype = "hinge"\nbody = "{body}"\nto = "{to}"\npoint = "{name}"\nto_point = "{name}"\n'


def values(folder: Path, text: str) -> dict[str, Array]:
    """Outputs of a file over time."""
    folder.mkdir(exist_ok=True)
    results = solve(load_mechanism(mechanism_file(folder, text))).results
    assert results is not None
    return dict(results.outputs)


def assert_same(found: dict[str, Array], expected: dict[str, Array]) -> None:
    assert found.keys() == expected.keys()
    for name, column in expected.items():
        np.testing.assert_allclose(found[name], column, rtol=0.0, atol=1e-11 * np.abs(column).max(), err_msg=name)


def test_a_four_bar_is_the_one_with_lengths(tmp_path: Path) -> None:
    """Rods of 2.5 kg/m: m = 2.5 L, m L^2 / 12, closed by the law of cosines."""
    with_lengths = (
        f"[ground.points_m]\nO = [0.0, 0.0]\nC = [{GROUND}, 0.0]\n"
        + rod("crank", CRANK, np.zeros(2), PHI, f"{{ O = [0, 0], A = [{CRANK}, 0] }}")
        + rod("coupler", COUPLER, A, ANGLES[1], f"{{ A = [0, 0], B = [{COUPLER}, 0] }}")
        # the frame of the rocker begins in B, the first of its joints, and its axis points to C
        + rod("rocker", ROCKER, B, ANGLES[2] - math.pi, f"{{ B = [0, 0], C = [{ROCKER}, 0] }}")
        + hinge("O", "crank", "ground")
        + hinge("A", "coupler", "crank")
        + hinge("B", "coupler", "rocker")
        + hinge("C", "rocker", "ground")
    )
    run = RUN.format(end=0.8)
    assert_same(values(tmp_path / "a", FOUR_BAR + run + OUTPUTS), values(tmp_path / "b", with_lengths + run + OUTPUTS))


def test_a_slider_crank_is_the_shipped_one(tmp_path: Path) -> None:
    """Two rods of 1 m and 1 kg at 45 degrees, which the shipped file writes with lengths, poses and inertias."""
    raw = (GEOMETRY / "slider_crank.toml").read_text(encoding="utf-8")
    shipped = raw[: raw.index("[[paths]]")].replace("end_s = 10.0", "end_s = 0.3").replace("1e-9", "1e-13")
    rest = shipped[shipped.index("[forces.gravity]") :]
    run = shipped[shipped.index("[run]") : shipped.index("[ground.points_m]")].replace("picture_s = 10.0\n", "")
    half = math.sqrt(0.5)
    by_joints = f"""
[links]
mass_per_length_kg_per_m = 1.0
[joints]
O = {{ at_m = [0.0, 0.0], links = ["ground", "crank"] }}
A = {{ at_m = [{half}, {half}], links = ["rod", "crank"] }}
B = {{ at_m = [{2.0 * half}, 0.0], links = ["rod", "ground"], type = "slot", direction = [1.0, 0.0] }}
"""
    shipped = shipped.replace("picture_s = 10.0\n", "")
    assert_same(values(tmp_path / "a", run + by_joints + rest), values(tmp_path / "b", shipped))


#: A beam of three joints off a line with a mass of its own, three links in one joint, and a slot in a moving link.
MANY = """
[bodies.swing]
mass_kg = 1.5
inertia_kg_m2 = 0.2
centre_m = [0.3, 0.1]
[bodies.block]
mass_kg = 0.4
inertia_kg_m2 = 0.01
[links]
mass_per_length_kg_per_m = 2.0
[joints]
P = { at_m = [0.0, 0.0], links = ["ground", "swing"] }
Q = { at_m = [0.6, 0.8], links = ["swing", "left", "right"] }
R = { at_m = [1.0, 0.1], links = ["right"] }
S = { at_m = [-0.2, 0.5], links = ["swing"] }
T = { at_m = [0.3, 0.4], links = ["block", "swing"], type = "prismatic", direction = [0.6, 0.8] }
U = { at_m = [0.5, 0.2], links = ["left"] }
[start.velocities]
"rate(swing)" = 1.0
"""
WRITTEN_OUT = """
[ground.points_m]
P = [0.0, 0.0]
[bodies.swing]
mass_kg = 1.5
inertia_kg_m2 = 0.2
centre_m = [0.3, 0.1]
angle_rad = 0.9272952180016122
points_m = { P = [0, 0], Q = [1.0, 0.0], S = [0.28, 0.46], T = [0.5, 0.0] }
[bodies.left]
mass_kg = 1.2165525060596438
inertia_kg_m2 = 0.0375103689368390
centre_m = [0.3041381265149110, 0.0]
position_m = [0.6, 0.8]
angle_rad = -1.7359450042095235
points_m = { Q = [0, 0], U = [0.6082762530298219, 0] }
[bodies.right]
mass_kg = 1.6124515496597099
inertia_kg_m2 = 0.0873411256065676
centre_m = [0.4031128874149275, 0.0]
position_m = [0.6, 0.8]
angle_rad = -1.0516502125483738
points_m = { Q = [0, 0], R = [0.8062257748298550, 0] }
[bodies.block]
mass_kg = 0.4
inertia_kg_m2 = 0.01
position_m = [0.3, 0.4]
points_m = { T = [0, 0] }
[joints.T]
type = "prismatic"
body = "block"
to = "swing"
point = "T"
to_point = "T"
direction = [1.0, 0.0]
[start.velocities]
"rate(swing)" = 1.0
"""


def test_links_of_many_joints_and_joints_of_many_links(tmp_path: Path) -> None:
    twins = "".join(
        hinge("Q", "swing", link).replace("[joints.Q]", f"[joints.Q_{k}]") for k, link in ((1, "left"), (2, "right"))
    )
    written = WRITTEN_OUT + hinge("P", "swing", "ground") + twins
    outputs = "".join(
        f'[[outputs]]\nname = "n{k}"\nvalue = "{value}"\n'
        for k, value in enumerate(("x(right.R)", "y(left.U)", "x(block.T)", "vy(swing.S)", "angle(Q_2)", "rate(block)"))
    )
    run = RUN.format(end=0.6)
    assert_same(values(tmp_path / "a", MANY + run + outputs), values(tmp_path / "b", written + run + outputs))


def test_parameters_and_studies_move_a_joint(tmp_path: Path) -> None:
    """A crank twice as long makes a point of it twice as fast at the same rate."""
    text = (
        "parameters = { r = 0.1 }\nlinks = { mass_per_length_kg_per_m = 1.0 }\n"
        'joints = { O = { at_m = [0, 0], links = ["ground", "crank"] }, '
        'A = { at_m = ["r", 0], links = ["crank"] } }\n'
        '[start.velocities]\n"rate(crank)" = 3.0\n[[outputs]]\nname = "v_m_per_s"\nvalue = "vy(crank.A)"\n'
    )
    text = text.replace("[start.vel", "run = { end_s = 0.1, step_s = 0.1 }\n[start.vel")
    one, two = sweep(mechanism_file(tmp_path, text), [{}, {"parameters.r": 0.2}])
    for case, speed in ((one, 0.3), (two, 0.6)):
        assert not case.problem
        np.testing.assert_allclose(case["v_m_per_s"][0], speed, rtol=1e-14)


def test_ten_lines_are_a_mechanism(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "mechanisms.md").read_text(encoding="utf-8")
    text = page.split("## Links by joint coordinates")[1].split("```toml\n")[1].split("```")[0]
    assert len(text.splitlines()) <= 10
    assert len(mechanism_tables(read_toml(mechanism_file(tmp_path, text))).bodies) == 3
    assert solve(load_mechanism(mechanism_file(tmp_path, text))).results is not None


CRANKS = """
[run]
end_s = 0.1
step_s = 0.1
[links]
mass_per_length_kg_per_m = 1.0
[joints]
O = { at_m = [0, 0], links = ["ground", "crank"] }
A = { at_m = [1, 0], links = ["crank", "rod"] }
B = { at_m = [2, 0], links = ["rod"] }
"""
WRONG = [
    (('B = { at_m = [2, 0], links', "B = { links"), "joints.B.at_m: is required with links"),
    ((", links = [\"rod\"] }", " }"), "joints.B.links: is required with at_m"),
    (("[2, 0]", "[2]"), r"joints.B.at_m = \[2\]: must be two finite numbers"),
    (("[2, 0]", "[2, inf]"), "must be two finite numbers"),
    (('["rod"]', '"rod"'), "joints.B.links = 'rod': must be a list"),
    (('["rod"]', '["rod", "rod"]'), "joins a link to itself"),
    (('["rod"]', '["a rod"]'), "must be a word"),
    (('["rod"] }', '["rod"], type = "hinge" }'), "is a point of it"),
    (('["rod"] }', '["rod"], body = "rod" }'), "joints.B.body = 'rod': conflicts with at_m and links"),
    (('["rod"] }', '["rod", "ground"], type = "gear" }'), "must be one of hinge, slot, prismatic"),
    (('["rod"] }', '["rod", "ground"], type = "slot" }'), "direction"),
    (('["rod"] }', '["rod", "ground"], direction = [1, 0] }'), "write type = \"slot\""),
    (
        ('["rod"] }', '["rod", "ground"], type = "prismatic", direction = [1, 0], angle_deg = 30 }'),
        "joints.B.angle_deg = 30: conflicts with at_m",
    ),
    (('["rod"] }', '["rod", "crank", "ground"], type = "slot", direction = [1, 0] }'), "must be two links"),
    (('["rod"] }', '["rod", "other"] }'), "it has no length.*give mass_kg, inertia_kg_m2"),
    (("[joints]", "[bodies.rod]\nposition_m = [1, 0]\n[joints]"), "bodies.rod.position_m.*follows from the joints"),
    (("[joints]", "[bodies.rod]\nangle_deg = 3\n[joints]"), "bodies.rod.angle_deg.*follows from the joints"),
    (("[joints]", "[bodies.rod]\npoints_m = { B = [3, 0] }\n[joints]"), r"points_m\.B.*position of joint 'B'"),
    (("[joints]", "[ground.points_m]\nO = [3, 0]\n[joints]"), r"ground\.points_m\.O.*position of joint 'O'"),
    (("[joints]", "[bodies.rod]\ninertia_kg_m2 = 1.0\n[joints]"), "mass_kg: is required.*belong together"),
    (("mass_per_length_kg_per_m = 1.0", ""), r"bodies\.crank\.mass_kg: is required.*mass_per_length_kg_per_m"),
    (("mass_per_length_kg_per_m = 1.0", "mass_per_length_kg_per_m = -1.0"), "mass_per_length_kg_per_m = -1"),
    (("B = {", 'C = { at_m = [0, 1], links = ["crank"] }\nB = {'), "O, A, C.*are not on one line"),
    (("[joints]", "[bodies.crank]\nmass_kg = 1\n[bodies.rod]\nmass_kg = 1\n[joints]"), "is used by no link"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), WRONG, ids=[words for _, words in WRONG])
def test_what_contradicts_the_positions_is_named(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    assert change[0] in CRANKS
    with pytest.raises(InputError, match=words):
        mechanism_tables(read_toml(mechanism_file(tmp_path, CRANKS.replace(*change))))


def test_links_without_positions_are_named(tmp_path: Path) -> None:
    text = CRANKS[: CRANKS.index("[joints]")] + "[bodies.rod]\nmass_kg = 1.0\ninertia_kg_m2 = 1.0\n"
    with pytest.raises(InputError, match=r"\[links\].*there are none"):
        mechanism_tables(read_toml(mechanism_file(tmp_path, text)))


@pytest.mark.parametrize("name", ["joints", "bodies"])
def test_what_is_no_table_is_named_before_links(name: str) -> None:
    raw = tomllib.loads(CRANKS)
    with pytest.raises(InputError, match=rf"{name} = \[1\]: must be a table"):
        mechanism_tables({"bodies": {}, **raw, name: [1]})
