"""``gearfe rating``: files, several meshes, options, and jobs that are refused."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from gearfe.base.tables.examples import job_file
from gearfe.cli.main import main
from tests.makers.job_texts import BARE_TRAIN, BORES, pair_job
from tests.places import GEOMETRY

FZG = GEOMETRY / "fzg_c.toml"


def test_the_shipped_pair(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rating", str(FZG), "--out", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"rating.csv", "rating.json", "rating.png"}
    made = json.loads((tmp_path / "rating.json").read_text())
    printed = capsys.readouterr().out
    assert f"{made['safety']['S_H']['pinion']:.6g}" in printed
    rows = list(csv.DictReader((tmp_path / "rating.csv").open()))
    by_name = {row["name"]: row for row in rows}
    assert float(by_name["S_F"]["gear_2"]) == made["safety"]["S_F"]["wheel"] == made["root"]["S_F"]["value"]["wheel"]
    assert all(
        row["formula"].startswith(("ISO 6336", "ISO/TR 15144", "ISO/TS 6336", "ASTM D341", "P mu_m H_V"))
        for row in rows
    )
    assert f"{made['safety']['S_B']:.6g}" in printed
    path = made["scuffing_path"]
    assert max(path["theta_B_C"]) == pytest.approx(made["scuffing"]["theta_B_C"]["value"], rel=1e-3)
    assert len(path["Gamma"]) == len(path["X_Gamma"])
    assert made["measures"]["pinion"]["tolerances_um"]["f_pT"] == 7.0
    assert len(made["measures"]["backlash"]["circumferential_mm"]) == 2


def test_the_gear_command_prints_what_rating_gives(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["gear", str(FZG), "--out", str(tmp_path), "--no-pictures"]) == 0
    printed = capsys.readouterr().out
    made = json.loads((tmp_path / "gear_pair.json").read_text())
    assert "F_betaT" in printed
    assert made["pinion"]["over_balls_mm"] == made["measures"]["pinion"]["over_balls_mm"]
    assert made["pinion"]["active_root_diameter_mm"] > made["pinion"]["form_diameter_mm"]


def test_all_meshes_of_a_gearbox(tmp_path: Path) -> None:
    """Torques are those of [stiffness] of each mesh, at the driven gear; one mesh has keys of its own."""
    job = tmp_path / "box.toml"
    job.write_text(
        job_file("gearbox")
        + "\n[rating]\nspeed_rpm = 900.0\nhardness = 700.0\n"
        + "[rating.gears.input_wheel]\nmaterial = 'GGG'\nhardness = 250.0\n"
        + "yield_strength_MPa = 500.0\n[rating.meshes.second]\nspeed_rpm = 440.0\napplication_factor = 1.5\n"
    )
    assert main(["rating", str(job), "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    first, second = (json.loads((tmp_path / "out" / name / "rating.json").read_text()) for name in ("first", "second"))
    assert first["load"]["torque"] == pytest.approx(60.0 * 20 / 41)
    assert (first["influence"]["K_A"]["value"], second["influence"]["K_A"]["value"]) == (1.0, 1.5)
    assert second["load"]["speed"] == 440.0
    assert first["strength"]["input_wheel"]["material"] == "GGG"


def test_options_win_over_the_file(tmp_path: Path) -> None:
    line = [
        "rating",
        str(FZG),
        "--torque-driver-Nm",
        "200",
        "--edition",
        "2006",
        "--out",
        str(tmp_path),
        "--no-pictures",
    ]
    assert main(line) == 0
    made = json.loads((tmp_path / "rating.json").read_text())
    assert (made["load"]["torque"], made["edition"]) == (200.0, "ISO 6336:2006")


def test_options_win_over_the_keys_of_single_gears_and_meshes(tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    job.write_text(
        FZG.read_text() + "quality = 8\n\n[rating.meshes.pinion-wheel]\ntorque_driver_Nm = 90.0\nlife_h = 7.0\n"
    )
    options = ["--torque-driver-Nm", "200", "--quality", "4", "--life-h", "900"]
    assert main(["rating", str(job), *options, "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    rating = json.loads((tmp_path / "out" / "rating.json").read_text())
    assert (rating["load"]["torque"], rating["load"]["hours"]) == (200.0, 900.0)
    assert [strength["quality"] for strength in rating["strength"].values()] == [4, 4]
    assert rating["measures"]["wheel"]["quality"] == 4
    assert rating["strength"]["wheel"]["flank_roughness"] == 2.5  # no option of it was given


def test_the_written_example_runs(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_text(job_file("rating"))
    assert main(["rating", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out"), "--no-pictures"]) == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["rating.speed_rmp=3"], "speed_rpm"),
        (["rating.gears.pinon.quality=5"], "pinion"),
        (["rating.gears.wheel.hardness=300"], "rating.gears.wheel.hardness = 300"),
        (["rating.speed_rpm=-3"], "rating.speed_rpm"),
        (["rating.thickness_allowances_um=[-90,-60]"], "upper allowance"),
        (["rating.ball_diameter_mm=2"], "ball_diameter_mm = 2"),
        (["rating.spectrum=[{torque_driver_Nm=1,speed_rpm=1}]"], "hours"),
        (["rating.edition=2010"], "2006 or 2019"),
        (["rating.quality=12"], "1 to 11"),
        (["rating.material=V"], "yield_strength_MPa"),
        (["rating.tip_relief_factor=1.3"], "tip_relief_factor"),
    ],
)
def test_jobs_that_are_refused(
    changes: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["rating", str(FZG), "--out", str(tmp_path / "out"), "--no-pictures"]
    for change in changes:
        line += ["--set", change]
    assert main(line) == 2
    told = capsys.readouterr().err
    assert message in told
    assert "Traceback" not in told
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_files_without_the_table_or_the_speed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "pair.toml"
    job.write_text(pair_job())
    assert main(["rating", str(job), "--out", str(tmp_path / "out")]) == 2
    assert "[rating]" in capsys.readouterr().err
    assert main(["rating", str(job), "--set", "rating.quality=6", "--out", str(tmp_path / "out")]) == 2
    assert "speed_rpm" in capsys.readouterr().err


def test_internal_gears(tmp_path: Path) -> None:
    job = FZG.with_name("internal.toml")
    line = ["rating", str(job), "--set", "rating.speed_rpm=1000", "--set", "rating.torque_driver_Nm=100"]
    assert main([*line, "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    made = json.loads((tmp_path / "out" / "rating.json").read_text())
    assert made["gears"] == {"gear_1": "planet", "gear_2": "ring"}
    assert made["root"]["d_en_mm"]["value"]["ring"] < 0.0
    assert main(["gear", *line[1:], "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    made = json.loads((tmp_path / "out" / "gear_pair.json").read_text())
    assert made["measures"]["ring"]["over_balls_mm"] < 0.0


def test_loads_of_a_planetary_train(tmp_path: Path) -> None:
    """Sun 17, planets 22, ring -61 with 7302 N m at the carrier at 1500 per minute: torques and speeds by Willis."""
    job = tmp_path / "stage.toml"
    text = (GEOMETRY / "planetary.toml").read_text().replace("torque_Nm = 530.0", "coarsen = 2.0")
    job.write_text(text + "\n[rating]\nhardness = 700.0\n[rating.gears.planet]\nalternating_factor = 0.8\n")
    assert main(["rating", str(job), "--out", str(tmp_path / "out"), "--no-pictures"]) == 0
    sun, ring = (
        json.loads((tmp_path / "out" / name / "rating.json").read_text()) for name in ("sun_planet", "planet_ring")
    )
    torque, carrier = 7302.0 / (1.0 + 61.0 / 17.0), 1500.0 / (1.0 + 61.0 / 17.0)
    assert sun["load"]["torque"] == pytest.approx(torque)
    assert sun["load"]["speed"] == pytest.approx(1500.0 - carrier)
    assert ring["load"]["torque"] == pytest.approx(torque / 3.0 * 22.0 / 17.0)
    assert ring["load"]["speed"] == pytest.approx((1500.0 - carrier) * 17.0 / 22.0)
    turns = 60.0 * 20_000.0
    assert sun["flank"]["N_L"]["value"]["sun"] == pytest.approx(3.0 * turns * (1500.0 - carrier))
    assert ring["flank"]["N_L"]["value"]["planet"] == pytest.approx(turns * (1500.0 - carrier) * 17.0 / 22.0)
    assert ring["flank"]["N_L"]["value"]["ring"] == pytest.approx(3.0 * turns * carrier)
    assert [sun["strength"][name]["alternating"] for name in ("sun", "planet")] == [1.0, 0.8]
    assert ring["strength"]["ring"]["fixed"]
    assert not ring["strength"]["planet"]["fixed"]


def test_computed_values_beside_the_standard(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At C one pair carries all, where the standard's stress holds Z_eps for two; the rest is near."""
    assert main(["rating", str(FZG), "--computed", "--out", str(tmp_path)]) == 0
    made = json.loads((tmp_path / "rating.json").read_text())
    rows = {row["name"]: row for row in made["computed"]}
    at_C, Z_eps = rows["pressure at C"], made["flank"]["Z_eps"]["value"]
    assert at_C["computed"] * Z_eps == pytest.approx(at_C["standard"], rel=2e-3)
    assert "carries 1 of the load" in at_C["meaning"]
    near = {"c_prime": 0.08, "c_gamma": 0.08, "root stress pinion": 0.13, "root stress wheel": 0.13, "H_V": 0.05}
    for name, most in near.items():
        assert abs(rows[name]["difference"]) < most
    for name in ("pressure at B", "pressure at D"):
        assert rows[name]["computed"] < at_C["computed"]  # a second pair carries there already
    assert "+8.2 %" in capsys.readouterr().out


def test_computed_values_of_loads_along_the_width(tmp_path: Path) -> None:
    job = ["--set", "rating.speed_rpm=1500", "--set", "rating.torque_driver_Nm=135", "--set", "stiffness.coarsen=2"]
    line = ["rating", str(FZG.with_name("helical.toml")), *job, "--with-computed", "--out", str(tmp_path)]
    assert main([*line, "--no-pictures"]) == 0
    made = json.loads((tmp_path / "rating.json").read_text())
    rows = {row["name"]: row for row in made["computed"]}
    roots = {"root stress pinion", "root stress wheel"}
    assert set(rows) == {"c_gamma", "K_Hbeta", "largest pressure", *roots}
    # the rating has the computed load factor, and the table that of the standard next to it
    assert rows["K_Hbeta"]["computed"] == made["influence"]["K_Hbeta"]["value"]
    assert rows["K_Hbeta"]["standard"] != rows["K_Hbeta"]["computed"]
    assert made["influence"]["K_Hbeta"]["formula"] == "from contact analysis"
    assert "K_Hβ from contact analysis" in made["method"]
    assert all(0.0 <= rows[name]["error"] < 1.0 for name in roots)
    assert made["influence"]["K_Fbeta"]["value"] == pytest.approx(
        rows["K_Hbeta"]["computed"] ** made["influence"]["N_F"]["value"]
    )
    assert all(abs(rows[name]["difference"]) < 0.2 for name in (*roots, "largest pressure"))
    assert rows["K_Hbeta"]["computed"] == pytest.approx(1.48, abs=0.1)
    assert rows["c_gamma"]["computed"] == pytest.approx(11.6, rel=0.05)


def test_dynamic_factor_of_a_run_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Between the speeds of runup.csv it is interpolated; with --with-computed the rating has it as K_v."""
    job = tmp_path / "box.toml"
    job.write_text(job_file("gearbox"))
    (tmp_path / "run").mkdir()
    lines = ["speed_rad_per_s,dynamic_factor_1,dynamic_factor_2", "100,1.2,1.0", "120,1.6,1.1"]
    (tmp_path / "run" / "runup.csv").write_text("\n".join(lines) + "\n")
    speed = 110.0 * 30.0 / 3.141592653589793
    line = ["rating", str(job), "--set", f"rating.speed_rpm={speed}", "--set", "rating.torque_driver_Nm=50"]
    line += ["--out", str(tmp_path / "out"), "--no-pictures", "--runup", str(tmp_path / "run")]
    line += ["--mesh", "first"]
    assert main([*line, "--with-computed"]) == 0
    (path,) = (tmp_path / "out").rglob("rating.json")
    made = json.loads(path.read_text())
    row = {row["name"]: row for row in made["computed"]}["K_v"]
    assert row["computed"] == pytest.approx(1.4)
    assert made["influence"]["K_v"]["value"] == row["computed"] != row["standard"]
    assert main([*line, "--set", "rating.speed_rpm=9000"]) == 2
    assert "reaches from 100 to 120 rad/s" in capsys.readouterr().err
    assert main([*line[:-3], str(tmp_path), *line[-2:]]) == 2
    assert "has no runup.csv" in capsys.readouterr().err
    assert main(["rating", str(FZG), "--with-computed", "--out", str(tmp_path / "out"), "--no-pictures"]) == 2
    assert "alike along the face width" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        # a resonance that bends over: branch 1 between two turning points is unstable
        (["100,0,1,1.2", "118,0,1,3.0", "118,1,0,9.0", "104,1,0,5.0", "104,2,1,1.4", "120,2,1,1.0"], 2.2),
        (
            ["100,0,1,1.2", "105,0,1,1.3", "105,1,0,9.0", "102,1,0,5.0", "102,2,1,1.4", "120,2,1,1.0"],
            1.4 - 0.4 * 8 / 18,
        ),
        (["100,0,nan,1.2", "120,0,nan,1.6"], 1.4),
        (["100,0,0,1.2", "110,0,1,1.3", "120,0,0,1.6"], 1.3),
        (["100,0,0,1.2", "120,0,0,1.6"], "no stable motion at 110 rad/s"),
        (["100,0,1,1.2", "110,0,0,1.6", "120,0,1,1.2"], "no stable motion at 110 rad/s"),
        (["100,0,1,nan", "120,0,1,1.6"], "dynamic_factor_1 that is not finite"),
        (["nan,0,1,1.0", "100,0,1,1.0", "120,0,1,1.6"], "speeds that are not finite"),
    ],
)
def test_dynamic_factor_of_a_run_up_with_several_motions(
    rows: list[str], expected: float | str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The largest stable one, interpolated within its branch, at 110 rad/s."""
    job = tmp_path / "box.toml"
    job.write_text(job_file("gearbox"))
    (tmp_path / "runup.csv").write_text("\n".join(["speed_rad_per_s,branch,stable,dynamic_factor_1", *rows]) + "\n")
    line = [
        "rating",
        str(job),
        "--set",
        f"rating.speed_rpm={110.0 * 30.0 / math.pi!r}",
        "--set",
        "rating.torque_driver_Nm=50",
    ]
    line += ["--mesh", "first", "--runup", str(tmp_path), "--out", str(tmp_path / "out"), "--no-pictures"]
    code = main(line)
    if isinstance(expected, str):
        assert code == 2
        assert expected in capsys.readouterr().err
        return
    (path,) = (tmp_path / "out").rglob("rating.json")
    (row,) = json.loads(path.read_text())["computed"]
    assert row["computed"] == pytest.approx(expected)


def test_computed_values_of_a_torque_out_of_range(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = [
        "rating",
        str(FZG),
        "--computed",
        "--set",
        "rating.torque_driver_Nm=1e7",
        "--out",
        str(tmp_path),
        "--no-pictures",
    ]
    assert main(line) == 2
    assert "rating.torque_driver_Nm" in capsys.readouterr().err


def test_computed_values_where_the_larger_gear_drives(tmp_path: Path) -> None:
    """B and D change places, as M_1 and M_2 do; gear 1 is the wheel of the pair."""
    swapped = {
        "pair.pinion.teeth": 24,
        "pair.pinion.tip_diameter_mm": 118.35,
        "pair.pinion.profile_shift": 0.171481,
        "pair.wheel.teeth": 16,
        "pair.wheel.tip_diameter_mm": 82.45,
        "stiffness.torque_Nm": 135.5,
        "rating.torque_driver_Nm": 203.25,
        "rating.speed_rpm": 1000,
    }
    changes = [word for key, value in swapped.items() for word in ("--set", f"{key}={value}")]
    assert main(["rating", str(FZG), *changes, "--computed", "--out", str(tmp_path), "--no-pictures"]) == 0
    made = json.loads((tmp_path / "rating.json").read_text())
    rows = {row["name"]: row for row in made["computed"]}
    assert made["gears"]["gear_1"] == "wheel"
    assert rows["pressure at D"]["standard"] == pytest.approx(1102.1, abs=0.1)
    assert rows["pressure at B"]["standard"] == pytest.approx(1004.6, abs=0.1)
    assert rows["pressure at D"]["computed"] > rows["pressure at B"]["computed"]
    assert rows["root stress wheel"]["standard"] == pytest.approx(187.88, abs=0.01)
    assert rows["root stress wheel"]["computed"] == pytest.approx(170.0, abs=1.0)


def test_a_mesh_that_the_train_does_not_have(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message names the meshes of [train], instead of asking for a table that is there."""
    job = tmp_path / "train.toml"
    job.write_text((GEOMETRY / "gear_train.toml").read_text() + "\n[rating]\ntorque_driver_Nm = 10.0\n")
    line = ["rating", str(job), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert main(line) == 2
    message = capsys.readouterr().err
    assert "rating.meshes.pinion-wheel.speed_rpm" in message
    assert "[train], which has gear_1-gear_2, gear_3-gear_4" in message
    assert "or a table [train]" not in message
    assert main([*line, "--speed-rpm", "900"]) == 0


def test_thickness_of_a_single_gear_replaces_that_of_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Allowances of a gear and a series of all gears, and the other way round; only one table can contradict itself."""

    job = tmp_path / "job.toml"
    job.write_text(FZG.read_text().replace("thickness_allowances_um = [-60.0, -90.0]\n", ""))

    def thickness(*changes: str) -> tuple[int, list[list[float] | None]]:
        line = ["rating", str(job), "--out", str(tmp_path), "--no-pictures"]
        code = main([*line, *(word for change in changes for word in ("--set", f"rating.{change}"))])
        if code:
            return code, []
        measures = json.loads((tmp_path / "rating.json").read_text())["measures"]
        return code, [measures[name].get("span_limits_mm") for name in ("pinion", "wheel")]

    series, allowances = "thickness_series=cd25", "thickness_allowances_um=[-60,-90]"
    both_series, both_allowances = thickness(series)[1], thickness(allowances)[1]
    assert both_series != both_allowances
    assert thickness(series, f"gears.wheel.{allowances}") == (0, [both_series[0], both_allowances[1]])
    assert thickness(allowances, f"gears.wheel.{series}") == (0, [both_allowances[0], both_series[1]])
    capsys.readouterr()
    for where in ("", "gears.wheel."):
        assert thickness(where + series, where + allowances)[0] == 2
        assert "cannot be given together with thickness_allowances_um" in capsys.readouterr().err


def test_a_train_that_stands_still(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message asks for a speed, instead of for a table that is there."""
    job = tmp_path / "train.toml"
    job.write_text(BARE_TRAIN.replace("-300.0", "0.0") + BORES + "[rating]\n")
    line = ["rating", str(job), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert main(line) == 2
    message = capsys.readouterr().err
    assert "rating.meshes.a-b.speed_rpm: is required: in [train] the driver of mesh a-b does not turn" in message
    assert "or a table [train]" not in message
