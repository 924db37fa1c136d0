"""Jobs as people get them wrong: each is refused in one line that names the entry and what would be right."""

from __future__ import annotations

import pytest

from gearfe import Housing
from gearfe.base.tables.examples import job_file
from gearfe.cli.main import main
from gearfe.fem.reduction.error import reduction_error
from tests.makers.housing_meshes import box
from tests.makers.job_texts import pair_job
from tests.places import GEOMETRY

SHIPPED = GEOMETRY / "gear_train.toml"
RIGID_TRAIN = (job_file("vibration").replace('# housing = "elastic"', 'housing = "rigid" #')).replace(
    "# stiffness_N_per_m (not set):", "stiffness_N_per_m = 2e8 #"
)
PAIR = pair_job()
HOUSING = "[housing]\n[housing.material]\n"
MECHANISM = job_file("mechanism")


@pytest.mark.parametrize(
    ("command", "text", "old", "new", "message"),
    [
        ("gear", PAIR, "# profile_shift (not set):", "profile_shift = 1e200 #", "profile_shift = 1e+200: must be"),
        ("gear", PAIR, "teeth = 20 ", f"teeth = {'9' * 400} ", "teeth = 1.000e+400: must be"),
        ("stiffness", PAIR, "angle_stop_deg = 40.0", "angle_stop_deg = 1e300", "must be finite and >= -1e+06"),
        ("vibration", RIGID_TRAIN, "torque_Nm = 75.0", "torque_Nm = 1e300", "torque_Nm = 1e+300: must be"),
        ("vibration", RIGID_TRAIN, "= 2e8 ", "= 1e300 ", "stiffness_N_per_m = 1e+300: must be"),
        ("vibration", RIGID_TRAIN, "# rayleigh_beta_s = 0.0", "rayleigh_beta_s = 1e300", "of a size up to 1e+75"),
        ("vibration", RIGID_TRAIN, "length_mm = 82.0", "length_mm = 1e300", "of a size up to 1e+75"),
        (
            "vibration",
            RIGID_TRAIN,
            'name = "output" ',
            'name = "drive" ',
            "shafts[1].name = 'drive': is used twice",
        ),
        (
            "vibration",
            RIGID_TRAIN,
            'shaft = "output" ',
            'shaft = "outpt" ',
            "gears[1].shaft: unknown name 'outpt'; did",
        ),
        (
            "vibration",
            RIGID_TRAIN,
            'driven = "wheel"',
            'driven = "whel"',
            "meshes[0].driven: unknown name 'whel'",
        ),
        ("housing", HOUSING, "[housing.material]", "[housing.material]\ndensity_kg_per_m3 = 1e-300", ">= 1e-09"),
        ("housing", HOUSING, "[housing.material]", "[housing.material]\nyoungs_modulus_GPa = 210000.0", "<= 2000"),
        ("mechanism", MECHANISM, 'point = "A"', "point = [1, 2, 3]", "must have 2 entries"),
        ("mechanism", MECHANISM, '"vx(rod.B)" = -4.0', '"vx(rod.B)" = "fast"', "must be a number"),
        (
            "mechanism",
            MECHANISM,
            "[forces.gravity]",
            '[forces.m]\ntype = "moment"\nbody = "rod"\nmoment_N_m = { sin = 3.0 }\n[forces.gravity]',
            "forces.m.moment_N_m: unknown name 'sin'; did you mean 'sine'?",
        ),
    ],
)
def test_wrong_values(tmp_path, capsys, command, text, old, new, message):
    assert old in text
    (tmp_path / "job.toml").write_text(text.replace(old, new, 1))
    options = {"vibration": ["--no-pictures", "--no-floquet", "--no-estimate"]}.get(command, [])
    assert main([command, str(tmp_path / "job.toml"), "--out", str(tmp_path / "out"), *options]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if "error" in line]
    assert len(said) == 1
    assert message in said[0]


@pytest.mark.parametrize("value", ["nan", "inf", "-1"])
@pytest.mark.parametrize("option", ["--spectrum-ms", "--spectrum-from-ms", "--picture-ms", "--tolerance"])
def test_options_of_vibration(tmp_path, capsys, option, value):
    (tmp_path / "job.toml").write_text(RIGID_TRAIN)
    assert main(["vibration", str(tmp_path / "job.toml"), "--out", str(tmp_path), option, value]) == 2
    assert f"gearfe: error: {option} = " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b"pinion_angle_deg,k_mesh_N_per_m\n0,1e8\n" + b"9" * 5000 + b",2e8\n", "no finite number"),
        (b"pinion_angle_deg,k_mesh_N_per_m\n0,inf\n9,2e8\n", "'inf', which is no finite number"),
        ("pinion_angle_deg,k_mesh_N_per_m\n0,1e8\n9,2e8\n".encode("utf-16"), "is written in UTF-16"),
    ],
)
def test_curves(tmp_path, capsys, raw, message):
    (tmp_path / "job.toml").write_text(RIGID_TRAIN)
    (tmp_path / "curve.csv").write_bytes(raw)
    job = ["vibration", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out")]
    assert main([*job, "--curve", str(tmp_path / "curve.csv")]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (None, "there is no such file"),
        (b"t,a\n0,1\n1,x\n", "is no table of numbers"),
        (b"t,b\n0,1\n", "has no column 'a'"),
        (b"time_s,b\n0,1\n", "has no column 'a'"),
        (b"zeit,a\n0,1\n", "has no column 't' or 'time_s'"),
    ],
)
def test_a_reference_is_read_before_the_run(tmp_path, capsys, monkeypatch, raw, message):
    monkeypatch.setattr("gearfe.mechanisms.job.integrate", None)
    reference = '[figure]\nreference = "ref.csv"\nreference_columns = { x_B_m = "a" }\n'
    (tmp_path / "job.toml").write_text(MECHANISM + reference)
    if raw is not None:
        (tmp_path / "ref.csv").write_bytes(raw)
    assert main(["mechanism", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err


def test_new_names_a_folder(tmp_path, capsys):
    assert main(["new", "stiffness", str(tmp_path), "--force"]) == 2
    assert "is a folder; name a file in it" in capsys.readouterr().err


def test_a_housing_without_bores_has_no_reduction_error():
    """Nothing outside sees the modes that are left out."""
    nodes, tets = box((2, 1, 1), (0.2, 0.1, 0.1))
    body = Housing.from_arrays(nodes, tets, fixed=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))).reduce(6)
    made = reduction_error(body, 1.01 * float(body.coupled.frequencies_hz[0]))
    assert made.response == 0.0
    assert (made.frequency_errors == 0.0).all()


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('route = "direct"', "stiffness.route = 'direct': is gone"),
        ('law_sides = "pinion"', "stiffness.law_sides = 'pinion': is gone"),
        ("nitsche_theta = -1", "stiffness.nitsche_theta = -1: is gone: theta is 0; leave it out"),
        ('law = "exact"', "stiffness.law = 'exact': is gone; use half_plane"),
    ],
)
def test_keys_that_are_gone_say_what_to_write_instead(tmp_path, capsys, line, said):
    (tmp_path / "job.toml").write_text(SHIPPED.read_text().replace("\n[stiffness]\n", f"\n[stiffness]\n{line}\n"))
    for command in ("stiffness", "loadmap"):
        assert main([command, str(tmp_path / "job.toml"), "--out", str(tmp_path / "out")]) == 2
        told = capsys.readouterr().err
        assert said in told
        key, _, value = line.partition(" = ")
        option = ["--" + key.replace("_", "-"), value.strip('"')]
        assert main([command, str(SHIPPED), "--out", str(tmp_path / "out"), *option]) == 2
        assert option[0] in (told := capsys.readouterr().err)
        assert said.partition(": ")[2] in told
