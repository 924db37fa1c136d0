"""Values that gears and meshes take from elsewhere are in the summary, with their sources."""

import pytest

from gearfe.drivetrain.gearbox.inherited import inherited, inherited_lines
from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.train import build_train

JOB = """
[pair]
module_mm = 2.0
pressure_angle_deg = 22.0
face_width_mm = 10.0
tooth_thinning_um = 40.0
[pair.pinion]
teeth = 20
bore_diameter_mm = 8.0
[pair.wheel]
teeth = 30
bore_diameter_mm = 12.0
[pair.wheel.material]
youngs_modulus_GPa = 110.0
[train]
housing = "rigid"
duration_ms = 1.0
shafts = [
  { name = "a", x_mm = 0.0, length_mm = 60.0, radius_mm = 4.0, attachments = [1, 2] },
  { name = "b", x_mm = 50.0, length_mm = 60.0, radius_mm = 5.0, attachments = [3, 4] },
  { name = "c", x_mm = 98.0, length_mm = 60.0, radius_mm = 5.0, attachments = [5, 6] },
]
gears = [
  { name = "g1", shaft = "a", gear = "pinion", y_mm = 8.0 },
  { name = "g2", shaft = "b", gear = "wheel", y_mm = 8.0 },
  { name = "g3", shaft = "b", teeth = 18, y_mm = -8.0 },
  { name = "g4", shaft = "c", teeth = 30, y_mm = -8.0, face_width_mm = 12.0 },
]
meshes = [{ driver = "g1", driven = "g2", stiffness_N_per_m = 1e8 }, { driver = "g3", driven = "g4" }]
drive = { shaft = "a", attachment = 1, speed_rad_per_s = 100.0 }
loads = [{ shaft = "c", torque_Nm = -5.0 }]
rigid_bores = [
  { attachment = 1, x_mm = 0.0, y_mm = 25.0 }, { attachment = 2, x_mm = 0.0, y_mm = -25.0 },
  { attachment = 3, x_mm = 50.0, y_mm = 25.0 }, { attachment = 4, x_mm = 50.0, y_mm = -25.0 },
  { attachment = 5, x_mm = 98.0, y_mm = 25.0 }, { attachment = 6, x_mm = 98.0, y_mm = -25.0 },
]
[train.damping]
rayleigh_beta_s = 1e-6
"""


@pytest.fixture
def entries(tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(JOB)
    job = read_train_job(path)
    train = job_train(job, (1e8, 1e8))
    build_train(train)
    return inherited(job, train)


def test_a_gear_of_its_own_says_what_it_takes_from_the_pair(entries):
    third, fourth = entries["gears"]["g3"], entries["gears"]["g4"]
    for key, value in (("module_mm", 2.0), ("pressure_angle_deg", 22.0), ("tooth_thinning_um", 40.0)):
        assert third[key] == fourth[key] == {"value": value, "from": "[pair]"}
    assert third["face_width_mm"]["from"] == "[pair]"
    assert "face_width_mm" not in fourth
    assert third["dedendum"]["from"] == "default"
    assert third["bore_diameter_mm"]["value"] == pytest.approx(0.2 * 2.0 * 18)
    assert third["density_kg_per_m3"]["from"] == "[pair.material]"
    assert entries["gears"]["g2"]["density_kg_per_m3"]["from"] == "[pair.wheel.material]"
    assert entries["gears"]["g1"]["gear"]["from"].startswith("[pair.pinion] and [pair]")


def test_a_mesh_says_where_law_material_damping_and_backlash_come_from(entries):
    second = entries["meshes"]["g3-g4"]
    assert second["mesh_model"] == {"value": "potential", "from": "[train.curves]"}
    assert second["youngs_modulus_GPa of driver"]["from"] == "[pair.material]"
    assert second["rayleigh_beta_s"] == {"value": 1e-6, "from": "[train.damping]"}
    # 40 um off the arc of both gears' teeth, along the line of action
    assert second["backlash_um"]["value"] == pytest.approx(80.0 * 0.92718385456678740, rel=1e-6)
    assert second["backlash_um"]["from"].startswith("tooth_thinning_um of the gears")
    first = entries["meshes"]["g1-g2"]
    assert first["backlash_um"]["value"] is None
    assert "acts both ways" in first["backlash_um"]["from"]
    assert {"law", "plane"}.isdisjoint(first)
    assert first["damping_acts"]["value"] == "always"


def test_the_terminal_names_them(entries):
    lines = inherited_lines(entries)
    assert any(
        line.startswith("gear g3: from [pair] module_mm = 2, ") and "pressure_angle_deg = 22" in line for line in lines
    )
    assert any(line.startswith("mesh g3-g4: backlash_um = 74.17") for line in lines)
