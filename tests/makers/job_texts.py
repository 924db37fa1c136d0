"""Texts of small job files."""

from __future__ import annotations

from gearfe.base.tables.examples import PAIR
from gearfe.base.tables.jobs import table_class
from gearfe.base.tables.text import table_text

BARE_TRAIN = """
[train]
housing = "rigid"
duration_ms = 2.0
step_us = 100.0
[[train.shafts]]
name = "in"
x_mm = 0.0
length_mm = 60.0
radius_mm = 8.0
attachments = [1, 2]
[[train.shafts]]
name = "out"
x_mm = 45.0
length_mm = 60.0
radius_mm = 8.0
attachments = [3, 4]
[[train.gears]]
name = "a"
shaft = "in"
y_mm = 0.0
teeth = 18
module_mm = 2.0
pressure_angle_deg = 20.0
face_width_mm = 12.0
[[train.gears]]
name = "b"
shaft = "out"
y_mm = 0.0
teeth = 27
module_mm = 2.0
pressure_angle_deg = 20.0
face_width_mm = 12.0
[[train.meshes]]
driver = "a"
driven = "b"
stiffness_N_per_m = 2e8
[train.drive]
shaft = "in"
attachment = 1
speed_rad_per_s = -300.0
[[train.loads]]
shaft = "out"
attachment = 3
torque_Nm = -30.0
ramp_centre_ms = 0.5
ramp_width_ms = 1.0
[train.damping]
ratio = 0.05
"""


BORES = "".join(
    f"[[train.rigid_bores]]\nattachment = {i + 1}\nx_mm = {45.0 * (i // 2)}\ny_mm = {20.0 - 40.0 * (i % 2)}\n"
    for i in range(4)
)


#: Two shafts in a rigid housing, a constant stiffness: no finite elements.
SMALL_TRAIN = """
[pair]
module_mm = 2.5
pressure_angle_deg = 25.0
face_width_mm = 10.0
[pair.pinion]
teeth = 20
bore_diameter_mm = 10.0
[pair.wheel]
teeth = 30
bore_diameter_mm = 15.0
[train]
housing = "rigid"
duration_ms = 2.0
step_us = 20.0
[[train.shafts]]
name = "one"
x_mm = 0.0
length_mm = 82.0
radius_mm = 10.0
attachments = ["a", "b"]
[[train.shafts]]
name = "two"
x_mm = 62.5
length_mm = 82.0
radius_mm = 10.0
attachments = ["c", "d"]
[[train.gears]]
name = "pinion"
shaft = "one"
y_mm = 0.0
gear = "pinion"
[[train.gears]]
name = "wheel"
shaft = "two"
y_mm = 0.0
gear = "wheel"
[[train.meshes]]
driver = "pinion"
driven = "wheel"
stiffness_N_per_m = 1e8
damping_N_s_per_m = 2000.0
[train.drive]
shaft = "one"
attachment = "a"
speed_rad_per_s = 600.0
[[train.loads]]
shaft = "two"
attachment = "c"
torque_Nm = 75.0
ramp_centre_ms = 0.25
ramp_width_ms = 0.5
[[train.rigid_bores]]
attachment = "a"
x_mm = 0.0
y_mm = 30.0
[[train.rigid_bores]]
attachment = "b"
x_mm = 0.0
y_mm = -30.0
[[train.rigid_bores]]
attachment = "c"
x_mm = 62.5
y_mm = 30.0
[[train.rigid_bores]]
attachment = "d"
x_mm = 62.5
y_mm = -30.0
"""


ROD = """
[run]
end_s = 1.0
step_s = 0.01
[ground.points_m]
O = [0.0, 0.0]
[bodies.rod]
mass_kg = 2.0
inertia_kg_m2 = 0.5
points_m = { tip = [0.7, 0.2] }
angle_deg = 30.0
rate_rad_per_s = 1.0
[joints.O]
type = "hinge"
body = "rod"
to_point = "O"
"""


MOMENT = '[forces.drive]\ntype = "moment"\nbody = "rod"\nmoment_N_m = "{}"\n'


def pair_job() -> str:
    """A commented job of 20 and 30 teeth by pitch diameters, 25 degrees, at 100 N m over two mesh cycles."""
    load = {"torque_Nm": 100.0, "angle_start_deg": 1.0, "angle_step_deg": 1.0, "angle_stop_deg": 40.0}
    tables = {"pair": PAIR, "stiffness": load}
    return "\n".join(table_text(table_class(name), example, name) for name, example in tables.items())
