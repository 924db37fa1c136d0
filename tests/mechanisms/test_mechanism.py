"""Mechanism files: expressions, errors, outputs, energies, reactions, the command, the examples."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.expressions import compute, parse, quantities
from gearfe.cli.main import main
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.mechanisms.quantities import quantity_names
from gearfe.mechanisms.results import reactions, wrapped
from gearfe.multibody import integrate
from tests.makers.files import mechanism_file
from tests.makers.rigid_cases import reference
from tests.places import EXAMPLES, GEOMETRY, ROOT

PENDULUM = """
[run]
end_s = 1.0
step_s = 0.1
[ground.points_m]
O = [0.0, 0.0]
[bodies.rod]
mass_kg = 2.0
inertia_kg_m2 = 0.1
centre_m = [0.5, 0.0]
angle_deg = -60.0
points_m = { O = [0.0, 0.0], tip = [1.0, 0.0] }
[joints.O]
type = "hinge"
body = "rod"
point = "O"
to_point = "O"
[forces.gravity]
type = "gravity"
acceleration_m_per_s2 = [0.0, -9.81]
[[outputs]]
name = "tip_height_m"
value = "y(rod.tip) + 1"
"""


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3 - 4 / 2", 5.0),
        ("-2 ** 2", -4.0),
        ("2 ** 3 ** 2", 512.0),
        ("(1 + 2) * -3", -9.0),
        ("sqrt(16) + hypot(3, 4) - abs(-2)", 7.0),
        ("atan2(1, 0) * 2 / pi", 1.0),
        ("1.5e1 + .5", 15.5),
        ("sin(time) ** 2 + cos(time) ** 2", 1.0),
    ],
)
def test_arithmetic(text, value):
    assert compute(parse(text, "x", quantity_names()), {("time", None): 0.7}) == pytest.approx(value, rel=1e-15)


def test_quantities_of_an_expression():
    assert quantities(parse("angle(rod) - 2 * ax(rod.tip) + kinetic", "x", quantity_names())) == {
        ("angle", "rod"),
        ("ax", "rod.tip"),
        ("kinetic", None),
    }


@pytest.mark.parametrize(
    "text",
    ["", "1 +", "(1", "1 2", "__import__('os')", "angle()", "angle(1)", "f(x)", "sin(1, 2)", "a = 1", "lambda: 1",
     "x(rod).real", "kinetics", "(" * 250 + "1" + ")" * 250, "'a'", "[1]", "1 if 1 else 2",
     "1" + "+1" * 900],
)  # fmt: skip
def test_what_is_not_arithmetic_is_refused(text):
    with pytest.raises(InputError):
        parse(text, "outputs[0].value", quantity_names())


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("mass_kg = 2.0", "mass_kg = -2.0", "mass_kg = -2.0"),
        ("mass_kg = 2.0", "mas_kg = 2.0", "did you mean 'mass_kg'"),
        ("[forces.gravity]", "[force.gravity]", "did you mean 'forces'"),
        ('body = "rod"', 'body = "rot"', "did you mean 'rod'"),
        ('point = "O"\nto_point', 'point = "tipp"\nto_point', "did you mean 'tip'"),
        ("y(rod.tip)", "y(rod.tap)", "did you mean 'tip'"),
        ("y(rod.tip)", "y(rot.tip)", "did you mean 'rod'"),
        ("y(rod.tip) + 1", "y(rod.tip) +", "is not an expression"),
        ('to_point = "O"', 'to_point = "O"\nto = "rod"', "joins a body to itself"),
        ('type = "hinge"', 'type = "hinge"\ndirection = [1.0, 0.0]', "does not belong to type 'hinge'"),
        ("end_s = 1.0", "end_s = 0.0", "end_s = 0.0"),
        ("step_s = 0.1", "step_s = 0.1\ntolerance = 2.0", "tolerance = 2.0"),
        ('type = "hinge"', 'type = "fixed"', "does not belong|nothing is free"),
        ('name = "tip_height_m"', 'name = "tip height"', "without spaces"),
    ],
)
def test_errors_name_the_entry_and_the_cure(tmp_path, old, new, text):
    assert old in PENDULUM
    with pytest.raises(InputError, match=text):
        load_mechanism(mechanism_file(tmp_path, PENDULUM.replace(old, new))).start()


def test_nothing_free_to_move(tmp_path):
    fixed = PENDULUM.replace(
        'type = "hinge"\nbody = "rod"\npoint = "O"\nto_point = "O"', 'type = "fixed"\nbody = "rod"'
    )
    with pytest.raises(InputError, match="nothing is free to move"):
        load_mechanism(mechanism_file(tmp_path, fixed)).start()


def test_forced_values_and_contradictions(tmp_path):
    forced = PENDULUM + '[start.velocities]\n"vx(rod.tip)" = 1.0\n[start.positions]\n"angle(rod)" = -1.2\n'
    start = load_mechanism(mechanism_file(tmp_path, forced)).start()
    assert start.q[2] == pytest.approx(-1.2, abs=1e-12)
    assert start.v[2] == pytest.approx(1.0 / -np.sin(-1.2), rel=1e-10)  # vx of the tip = -sin(angle) rate
    wrong = PENDULUM + '[start.velocities]\n"vx(rod.O)" = 1.0\n'
    with pytest.raises(InputError, match=r"start velocity .*vx\(rod.O\).* = 1.0: contradicts hinge O"):
        load_mechanism(mechanism_file(tmp_path, wrong)).start()
    far = PENDULUM + '[start.positions]\n"x(rod.tip)" = 3.0\n'
    with pytest.raises(InputError, match="contradicts hinge O"):
        load_mechanism(mechanism_file(tmp_path, far)).start()


def test_reactions_balance_the_weight_and_the_motion(tmp_path):
    """Force of the hinge = m (a + g): a = acceleration of the mass centre."""
    mechanism = load_mechanism(mechanism_file(tmp_path, PENDULUM))
    made = integrate(mechanism.system, np.linspace(0, 1, 11), start=mechanism.start())
    table = reactions(mechanism, made)
    assert np.abs(table["O_x_N"] - 2.0 * made.a[:, 0]).max() <= 1e-7
    assert np.abs(table["O_y_N"] - 2.0 * (made.a[:, 1] + 9.81)).max() <= 1e-7
    assert np.abs(table["O_moment_N_m"]).max() <= 1e-7


def test_work_closes_the_energy_balance(tmp_path):
    """Drive, damper and a moving force: kinetic + potential - work stays at its start value."""
    extra = """
[forces.push]
type = "force"
body = "rod"
point = "tip"
x_N = { sine = 3.0, frequency_hz = 0.7 }
[forces.turn]
type = "moment"
body = "rod"
moment_N_m = { step = 2.0, step_centre_s = 0.4, step_width_s = 0.3, constant = 0.5 }
[forces.brake]
type = "coordinate_spring"
body = "rod"
coordinate = "angle"
stiffness_Nm_per_rad = 1.0
damping_Nm_s_per_rad = 0.3
"""
    mechanism = load_mechanism(mechanism_file(tmp_path, PENDULUM + extra))
    times = np.linspace(0, 1, 41)
    made = integrate(mechanism.system, times, start=mechanism.start(), tolerance=1e-11)
    results = evaluate(mechanism, made)
    assert np.ptp(results.energy["total_J"]) <= 1e-7
    assert np.abs(results.energy["work_J"]).max() > 0.1


def test_driven_crank_closes_the_energy_balance(tmp_path):
    """The work of a prescribed motion is the multiplier times the rate."""
    driven = (
        PENDULUM + '[joints.drive]\ntype = "prescribed"\nbody = "rod"\ncoordinate = "rate"\nmotion_rad_per_s = 4.0\n'
    )
    mechanism = load_mechanism(mechanism_file(tmp_path, driven))
    made = integrate(mechanism.system, np.linspace(0, 1, 41), start=mechanism.start(), tolerance=1e-11)
    results = evaluate(mechanism, made)
    assert np.abs(made.v[:, 2] - 4.0).max() <= 1e-10
    assert np.ptp(results.energy["total_J"]) <= 1e-8


def test_command_on_the_folding_links(tmp_path, capsys):
    arguments = [
        "mechanism",
        str(GEOMETRY / "slider_crank.toml"),
        "--out",
        str(tmp_path),
        "--until",
        "2",
        "--reactions",
    ]
    assert main([*arguments, "--no-pictures"]) == 0
    out = capsys.readouterr().out
    assert "2 bodies: 6 coordinates - 5 joint constraints = 1 degree of freedom\n" in out
    assert "; 2 change points passed" in out
    table = np.genfromtxt(tmp_path / "trajectory.csv", delimiter=",", names=True)
    header = (tmp_path / "trajectory.csv").read_text().splitlines()[0].split(",")
    assert header[0] == "time_s"
    assert next(h for h in header if h.startswith("a_")) == "a_x_A_m_per_s2"
    truth = reference("slider_crank_reference.csv")[:41]
    rows = table[::10]
    for name, column, allowed in (
        ("crank_angle_rad", "theta", 1e-8),
        ("crank_rate_rad_per_s", "omega", 1e-7),
        ("a_x_A_m_per_s2", "axA", 1e-6),
        ("x_B_m", "xB", 1e-8),
        ("v_B_m_per_s", "vxB", 1e-7),
    ):
        assert np.abs(rows[name] - truth[column]).max() <= allowed
    energy = np.genfromtxt(tmp_path / "energy.csv", delimiter=",", names=True)
    assert energy.dtype.names == ("time_s", "kinetic_J", "potential_J", "work_J", "total_J")
    assert np.abs(energy["total_J"] - truth["E"][0]).max() <= 1e-8
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["freedoms"]["net"] == 1
    assert summary["change_points"]["count"] == 2
    assert (tmp_path / "reactions.csv").exists()


def test_command_on_andrews(tmp_path):
    assert main(["mechanism", str(GEOMETRY / "andrews.toml"), "--out", str(tmp_path), "--no-pictures"]) == 0
    table = np.genfromtxt(tmp_path / "trajectory.csv", delimiter=",", names=True)
    names = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
    expected = ("time_s", *(f"{n}_rad" for n in names), "beta_wrapped_rad", "theta_wrapped_rad")
    assert table.dtype.names == expected
    truth = reference("andrews_reference.csv")
    columns = dict(zip(names, ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon"), strict=True))
    for name, column in columns.items():
        assert np.abs(table[f"{name}_rad"][::5] - truth[column]).max() <= 1e-9
    wrapped = np.mod(table["beta_rad"], 2 * np.pi)
    assert np.abs(table["beta_wrapped_rad"] - wrapped).max() <= 1e-12


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_command_runs_other_methods_to_the_end(tmp_path, method):
    file = mechanism_file(tmp_path, PENDULUM)
    arguments = ["mechanism", str(file), "--out", str(tmp_path), "--no-pictures", "--method", method]
    assert main([*arguments, "--tolerance", "1e-6"]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["reached_s"] == 1.0
    assert summary["method"] == method


def test_a_tolerance_of_zero_is_refused(tmp_path, capsys):
    file = mechanism_file(tmp_path, PENDULUM)
    assert main(["mechanism", str(file), "--out", str(tmp_path), "--no-pictures", "--tolerance", "0"]) == 2
    assert ">= 1e-13 and <= 0.1" in capsys.readouterr().err


@pytest.mark.parametrize(("text", "rate"), [("rate(rod) + 3", -1.0), ("2 * (rate(rod) - 1)", 2.0)])
def test_forced_velocity_with_an_offset(tmp_path, text, rate):
    start = load_mechanism(mechanism_file(tmp_path, PENDULUM + f'[start.velocities]\n"{text}" = 2.0\n')).start()
    assert start.v[2] == pytest.approx(rate, abs=1e-12)


@pytest.mark.parametrize("text", ["rate(rod) ** 2", "abs(rate(rod))", "sqrt(rate(rod))"])
def test_forced_velocity_that_is_not_linear(tmp_path, text):
    with pytest.raises(InputError, match="not linear"):
        load_mechanism(mechanism_file(tmp_path, PENDULUM + f'[start.velocities]\n"{text}" = 2.0\n')).start()


@pytest.mark.parametrize(
    ("old", "new"),
    [("[joints.O]", '[joints."O,1"]'), ("[forces.gravity]", '[forces."g g"]'), ("[joints.O]", "[joints.rod]"),
     ("tip = [1.0", '"ti p" = [1.0')],
)  # fmt: skip
def test_names_fit_into_headers(tmp_path, old, new):
    with pytest.raises(InputError, match=r"must be a word|is the name of a body"):
        load_mechanism(mechanism_file(tmp_path, PENDULUM.replace(old, new)))


def test_wrapped_angles_stay_below_the_period():
    period = 2 * np.pi
    values = np.array([-7e-17, period, period * (1 - 1e-14), 7.0, -1.0])
    assert np.allclose(wrapped(values, period), [0.0, 0.0, 0.0, 7.0 - period, period - 1.0], rtol=0, atol=1e-15)


@pytest.mark.slow
def test_figures_and_animation(tmp_path):
    assert main(["mechanism", str(GEOMETRY / "andrews.toml"), "--out", str(tmp_path), "--animation"]) == 0
    from PIL import Image

    with Image.open(tmp_path / "animation.gif") as picture:
        assert picture.n_frames == 100
    for name in ("curves.png", "picture.png"):
        with Image.open(tmp_path / name) as picture:
            assert min(picture.size) > 500


def test_bad_file_is_one_line_and_exit_code_two(tmp_path, capsys):
    bad = mechanism_file(tmp_path, PENDULUM.replace("mass_kg = 2.0", "mass_kg = -1.0"))
    assert main(["mechanism", str(bad), "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "mass_kg = -1.0" in message


@pytest.mark.parametrize("script", ["andrews.py", "slider_crank.py"])
def test_examples(script, tmp_path):
    path = EXAMPLES / script
    assert len(path.read_text().splitlines()) < 60
    made = subprocess.run([sys.executable, str(path)], cwd=ROOT, capture_output=True, text=True, check=False,
                          env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"})  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert "rad" in made.stdout


def test_a_planar_run_loads_no_heavy_library(tmp_path):
    arguments = [
        "mechanism",
        str(GEOMETRY / "andrews.toml"),
        "--out",
        str(tmp_path),
        "--no-pictures",
        "--until",
        "0.002",
    ]
    code = (
        "import sys; from gearfe.cli.main import main; "
        f"main({arguments!r}); "
        "heavy = {'skfem', 'gmsh', 'meshio', 'pyvista', 'matplotlib', 'vtk', 'h5py'} & set(sys.modules); "
        "print('HEAVY', heavy)"
    )
    made = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "HEAVY set()" in made.stdout


def test_the_core_knows_no_mechanism():
    """The names of the benchmarks stand in no name and no string of what computes: in docstrings and comments only."""
    import ast
    import io
    import tokenize

    names = re.compile(r"andrews|slider.?crank", re.IGNORECASE)  # "slider" alone is a joint's name elsewhere
    for path in (ROOT / "gearfe").rglob("*.py"):
        text = path.read_text()
        if not names.search(text):
            continue
        tree = ast.parse(text)
        prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        used = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in prose]
        used += [t.string for t in tokenize.generate_tokens(io.StringIO(text).readline) if t.type == tokenize.NAME]
        assert not [word for word in used if isinstance(word, str) and names.search(word)], path


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("1 / (time - 0.1)", "column odd: 1 of 11 values are not finite (inf or nan), the first in row 2"),
        ("sqrt(0.45 - time)", "column odd: 6 of 11 values"),
        ("10**(400*time)", "column odd: 3 of 11 values"),
    ],
)
def test_outputs_that_are_not_finite_are_no_success(tmp_path, capsys, value, message):
    text = PENDULUM + f'[[outputs]]\nname = "odd"\nvalue = "{value}"\n'
    out = tmp_path / "out"
    assert main(["mechanism", str(mechanism_file(tmp_path, text)), "--out", str(out), "--until", "1"]) == 1
    assert capsys.readouterr().err.count(f"gearfe: warning: trajectory.csv: {message}") == 1
    assert message in json.loads((out / "summary.json").read_text())["warnings"][0]


def test_a_wrong_type_is_told_what_exists(tmp_path, capsys):
    """Also where the wrong type brings keys of its own."""
    gear = '[joints.g]\ntype = "worm"\nstarts = 2\nbody = "rod"\n'
    assert main(["mechanism", str(mechanism_file(tmp_path, PENDULUM + gear)), "--out", str(tmp_path)]) == 2
    known = "hinge, slot, prismatic, distance, fixed, gear, belt, rack, rolling, cam, prescribed"
    assert f"joints.g.type = 'worm': must be one of {known}" in capsys.readouterr().err
