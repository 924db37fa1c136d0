"""Flexible links in mechanism files: keys, names, outputs, files, and what wrong files get."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.cli.main import main
from gearfe.mechanisms import evaluate, load_mechanism, solve
from gearfe.mechanisms.job import run_mechanism
from gearfe.mechanisms.results import reactions
from gearfe.multibody import integrate
from tests.makers.files import mechanism_file
from tests.places import GEOMETRY

CANTILEVER = """
[run]
end_s = 0.2
step_s = 0.01
frames = 5
[bodies.arm]
points_m = { root = [0.0, 0.0], middle = [0.5, 0.0], tip = [1.0, 0.0], lug = [1.0, 0.1] }
[bodies.arm.beam]
length_m = 1.0
width_m = 0.02
height_m = 0.02
youngs_modulus_GPa = 2.0
density_kg_per_m3 = 1000.0
elements = 2
damping_s = 0.1
frame = "start"
[joints.clamp]
type = "fixed"
body = "arm"
[forces.load]
type = "force"
body = "arm"
point = "tip"
y_N = { step = 1.0, step_centre_s = 0.05, step_width_s = 0.1 }
[[outputs]]
name = "deflection_m"
value = "deflection(arm.tip)"
[[outputs]]
name = "moment_N_m"
value = "bending_moment(arm.root)"
[[outputs]]
name = "stress_Pa"
value = "edge_stress(arm.root)"
[[outputs]]
name = "largest_Pa"
value = "largest_edge_stress(arm)"
[[outputs]]
name = "angle_rad"
value = "angle(arm.tip) - angle(arm)"
[[outputs]]
name = "lug_m"
value = "y(arm.lug) - y(arm.tip)"
[[outputs]]
name = "energy_J"
value = "elastic_energy(arm)"
"""


def test_a_cantilever_with_an_end_load_creeps_to_its_static_state(tmp_path: Path) -> None:
    """With damping above the critical one the end is static: P L^3/(3 EI), P L^2/(2 EI), P L, P L e / I."""
    second = 0.02**4 / 12
    slope = 1.0 / (2e9 * second)
    mechanism = load_mechanism(mechanism_file(tmp_path, CANTILEVER.replace("end_s = 0.2", "end_s = 3.0")))
    run = integrate(mechanism.system, [0.0, 3.0], start=mechanism.start(), tolerance=1e-6)
    assert run.method == "implicit"
    found = {k: v[-1] for k, v in evaluate(mechanism, run).outputs.items()}
    assert found["deflection_m"] == pytest.approx(slope / 3.0, rel=1e-3)  # shear adds 0.03 %
    assert found["angle_rad"] == pytest.approx(slope / 2.0, rel=1e-3)
    assert found["moment_N_m"] == pytest.approx(1.0, rel=1e-3)
    assert found["stress_Pa"] == pytest.approx(0.01 / second, rel=1e-3)
    assert found["largest_Pa"] == pytest.approx(0.01 / second, rel=1e-3)
    assert found["lug_m"] == pytest.approx(0.1 * np.cos(slope / 2.0), rel=1e-6)
    assert found["energy_J"] == pytest.approx(0.5 * slope / 3.0, rel=2e-3)
    forces = reactions(mechanism, run)
    assert forces["clamp_y_N"][-1] == pytest.approx(-1.0, rel=1e-3)
    assert forces["clamp_moment_N_m"][-1] == pytest.approx(-1.0, rel=1e-3)


def test_strains_beyond_linear_elasticity_are_reported(tmp_path: Path) -> None:
    """A strip of 2 GPa, 20 mm by 2 mm and 1 m under 1 N: its root would bend by P L e / (E I) = 3.75 %."""
    thin = CANTILEVER.replace("height_m = 0.02", "height_m = 0.002").replace("end_s = 0.2", "end_s = 0.5")
    small, large = (
        run_mechanism(
            load_mechanism(mechanism_file(tmp_path, thin.replace("step = 1.0", f"step = {load}"))), tmp_path / "out",
            estimate=False,
        )
        for load in ("1e-3", "1.0")
    )  # fmt: skip
    assert "linear elasticity" not in small.text
    assert "linear elasticity holds to about 2 %" in large.text
    link = large.summary["flexible_links"][0]
    assert link["largest_strain"] == pytest.approx(link["largest_edge_stress_Pa"] / 2e9)


def test_energies_balance_with_damping_and_work(tmp_path: Path) -> None:
    mechanism = load_mechanism(mechanism_file(tmp_path, CANTILEVER.replace("damping_s = 0.1", "damping_s = 0.01")))
    run = integrate(mechanism.system, np.linspace(0.0, 0.2, 41), start=mechanism.start(), tolerance=1e-6)
    energy = evaluate(mechanism, run).energy
    assert np.abs(energy["total_J"]).max() < 2e-3 * energy["work_J"].max()
    assert energy["elastic_J"].max() > 0.0


def test_reactions_of_the_running_slider_crank_are_newtons_second_law() -> None:
    """The force of the rod on the slider is its mass times its acceleration, the guide has no friction."""
    mechanism = load_mechanism(GEOMETRY / "elastic_slider_crank.toml")
    times = np.linspace(0.0, 0.04, 41)
    run = integrate(mechanism.system, times, start=mechanism.start(), tolerance=1e-6)
    index = mechanism.linkage.body_index["slider"]
    force = reactions(mechanism, run)["B_x_N"]
    pull = mechanism.file.bodies["slider"].mass_kg * run.a[:, 3 * index]
    assert np.abs(force - pull).max() < 0.01 * np.abs(pull).max()
    energy = evaluate(mechanism, run).energy
    assert np.abs(energy["total_J"]).max() < 1e-3 * energy["kinetic_J"].max()


def test_flexible_false_is_the_rigid_link(tmp_path: Path) -> None:
    text = CANTILEVER.replace('type = "fixed"', 'type = "hinge"').replace(
        "[bodies.arm.beam]", "flexible = false\n[bodies.arm.beam]"
    )
    text = text.split("[[outputs]]")[0]
    mechanism = load_mechanism(mechanism_file(tmp_path, text))
    assert not mechanism.links
    body = mechanism.linkage.bodies[0]
    assert body.mass == pytest.approx(0.4)
    assert body.inertia == pytest.approx(0.4 * (1.0 + 0.02**2) / 12)
    assert body.centre == (0.5, 0.0)


def test_joints_hold_points_beside_the_axis_and_sections(tmp_path: Path) -> None:
    """A motor that turns the tip's section, and a hinge at a lug, at rest: nothing moves, names reach the nodes."""
    text = (
        CANTILEVER.split("[joints.clamp]", maxsplit=1)[0]
        + """
[ground.points_m]
pin = [1.0, 0.1]
[joints.hold]
type = "hinge"
body = "arm"
point = "lug"
to_point = "pin"
[joints.turn]
type = "prescribed"
body = "arm.tip"
coordinate = "angle"
motion_rad = 0.0
[forces.twist]
type = "moment"
body = "arm.middle"
moment_N_m = 0.0
"""
    )
    mechanism = load_mechanism(mechanism_file(tmp_path, text))
    run = integrate(mechanism.system, [0.0, 0.05], start=mechanism.start(), tolerance=1e-6)
    assert np.abs(run.q[-1] - run.q[0]).max() < 1e-12


@pytest.mark.parametrize("place", ['body = "arm.tip"', 'body = "arm"\npoint = "lug"'])
@pytest.mark.parametrize("flexible", ["true", "false"])
def test_a_point_says_which_section_an_angle_is_of(tmp_path: Path, place: str, flexible: str) -> None:
    """Where the link is rigid, all sections turn alike."""
    swing = "{ polynomial = [0.0, 0.0, 0.5] }"
    text = CANTILEVER.split("[joints.clamp]", maxsplit=1)[0].replace(
        "[bodies.arm]", f"[bodies.arm]\nflexible = {flexible}"
    )
    text += f"""
[joints.hold]
type = "hinge"
body = "arm"
[joints.turn]
type = "prescribed"
{place}
coordinate = "angle"
motion_rad = {swing}
[[outputs]]
name = "tip_rad"
value = "angle(arm.tip)"
[[outputs]]
name = "root_rad"
value = "angle(arm)"
"""
    if flexible == "false":
        text = text.replace('"angle(arm.tip)"', '"angle(arm)"')
    results = solve(load_mechanism(mechanism_file(tmp_path, text))).results
    time = results.trajectory.time
    np.testing.assert_allclose(results.outputs["tip_rad"], 0.5 * time**2, atol=1e-6)
    bent = float(np.abs(results.outputs["root_rad"] - results.outputs["tip_rad"]).max())
    assert bent == 0.0 if flexible == "false" else bent > 1e-4


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("width_m = 0.02\nheight_m = 0.02\n", "", "has no section"),
        ("height_m = 0.02\n", "", "height_m: is required"),
        ("width_m = 0.02\n", "width_m = 0.02\ndiameter_m = 0.1\n", "two sections"),
        ("width_m = 0.02", "width_m = -0.02", "width_m"),
        ("density_kg_per_m3 = 1000.0\n", "", "density_kg_per_m3"),
        ("youngs_modulus_GPa = 2.0", "youngs_modulus_GPa = 0.0", "youngs_modulus_GPa"),
        ("tip = [1.0, 0.0]", "tip = [1.1, 0.0]", "lies outside of the link"),
        ('point = "tip"', "point = [-0.2, 0.0]", "lies outside of the link"),
        ("elements = 2", "elements = 0", "elements"),
        ("[bodies.arm]", "[bodies.arm]\nmass_kg = 1.0", "follows from the beam"),
        (
            "[bodies.arm.beam]",
            "[bodies.other]\nflexible = true\nmass_kg = 1.0\ninertia_kg_m2 = 1.0\n[bodies.arm.beam]",
            "needs a beam",
        ),
        ("deflection(arm.tip)", "deflection(arm.top)", "top"),
        ("deflection(arm.tip)", "deflection(crank.tip)", "crank"),
        ("[bodies.arm]", "[bodies.arm]\nflexible = false", r"deflection.*'arm' is taken as rigid \(flexible = false\)"),
        ("largest_edge_stress(arm)", "largest_von_mises(arm)", "is a beam"),
        ('body = "arm"\npoint = "tip"', 'body = "arm.tip"\npoint = "tip"', "has a point already"),
        ('body = "arm"\npoint = "tip"', 'body = "arm.end"', "arm.end"),
    ],
)
def test_wrong_files(tmp_path: Path, old: str, new: str, text: str) -> None:
    assert old in CANTILEVER
    with pytest.raises(InputError, match=text):
        load_mechanism(mechanism_file(tmp_path, CANTILEVER.replace(old, new, 1)))


def test_a_section_without_edge_has_no_stress(tmp_path: Path) -> None:
    text = CANTILEVER.replace("width_m = 0.02\nheight_m = 0.02", "area_m2 = 4e-4\nsecond_moment_m4 = 1.3e-8")
    with pytest.raises(InputError, match="edge_m"):
        load_mechanism(mechanism_file(tmp_path, text))


def test_methods_with_tiny_steps_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = mechanism_file(tmp_path, CANTILEVER)
    assert main(["mechanism", str(path), "--out", str(tmp_path / "out"), "--method", "taylor"]) == 2
    assert "flexible links" in capsys.readouterr().err


def test_the_command_writes_shape_and_forces(tmp_path: Path) -> None:
    out = tmp_path / "out"
    text = CANTILEVER + "[[paths]]\nbody = 'arm'\npoint = 'tip'\n[figure]\nmagnification = 5.0\n"
    assert (
        main(["mechanism", str(mechanism_file(tmp_path, text)), "--out", str(out), "--no-estimate", "--reactions"]) == 0
    )
    files = {p.name for p in out.iterdir()}
    assert {"links.csv", "links.vtkhdf", "links.png", "picture.png", "curves.png", "reactions.csv"} <= files
    summary = json.loads((out / "summary.json").read_text())
    (link,) = summary["flexible_links"]
    assert summary["tolerance"] == 1e-5
    assert link["elements"] == 2
    with (out / "links.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 5 * 7
    last = [r for r in rows if r["time_s"] == rows[-1]["time_s"]]
    assert float(last[0]["x_m"]) == pytest.approx(0.0, abs=1e-12)
    assert float(last[-1]["deflection_m"]) == pytest.approx(float(last[-1]["y_m"]), rel=1e-9)
    h5py = pytest.importorskip("h5py")
    with h5py.File(out / "links.vtkhdf") as file:
        stress = file["VTKHDF/PointData/stress_Pa"][:]
        moment = file["VTKHDF/PointData/bending_moment_N_m"][:]
    assert len(stress) == 5 * 14
    root = float(last[0]["bending_moment_N_m"]) * 0.01 / (0.02**4 / 12)
    assert np.abs(stress[-14:]).max() == pytest.approx(abs(root), rel=1e-3)
    assert moment[-14] == pytest.approx(float(last[0]["bending_moment_N_m"]))
