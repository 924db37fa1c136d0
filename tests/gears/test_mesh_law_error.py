"""The stated error of a mesh law covers its true one, on relieved pairs of the campaign mesh_laws (seed 1)."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.law_fit import LEAST_FORCE, force_cells
from gearfe.gears.gearmesh.law_make import mesh_law

#: Case 11: smooth reliefs, one loaded pair. What is left is the error of the cubics over the force.
SMOOTH = """
[pair]
module_mm = 2.61
pressure_angle_deg = 20.0
face_width_mm = 27.8
dedendum = 1.34
rack_tip_radius = 0.321
wheel = {teeth = 106, bore_diameter_mm = 143.9, tip_relief_amount_um = 5.79, tip_relief_length_mm = 0.795, \
tip_relief_exponent = 1.5, tooth_thinning_um = 96.2}
pinion = {teeth = 36, bore_diameter_mm = 57.33, tip_relief_amount_um = 2.23, tip_relief_length_mm = 1.91, \
tip_relief_exponent = 1.5}

[microgeometry]
torques_Nm = [7.071]
pinion = {profile_slope_um = -2.87}
wheel = {profile_crowning_um = 3.58}
"""

#: Case 21: 0.015 N/mm, of which an overlap of 2 nm is enough.
LIGHT = """
[pair]
module_mm = 0.373
pressure_angle_deg = 22.47
face_width_mm = 3.62
addendum = 0.819
dedendum = 1.09
rack_tip_radius = 0.138
centre_distance_mm = 17.2573
pinion = {teeth = 49, bore_diameter_mm = 2.47, profile_shift = -0.383, tip_round_mm = 0.0146, tooth_thinning_um = 14.0}
wheel = {teeth = 45, bore_diameter_mm = 3.347, profile_shift = -0.404, tip_round_mm = 0.016, \
tip_relief_amount_um = 6.24, tip_relief_length_mm = 0.0881, tip_relief_exponent = 1.0}

[microgeometry]
torques_Nm = [0.0004225]
pinion = {profile_slope_um = 0.384}
wheel = {profile_crowning_um = 0.806}
"""

#: Case 155: kinks of linear reliefs pass through the contact in a small part of the mesh cycle.
KINKED = """
[pair]
module_mm = 0.428
pressure_angle_deg = 20.0
face_width_mm = 3.07
dedendum = 1.28
rack_tip_radius = 0.266
tip_shortening = 0.0915
centre_distance_mm = 7.86025
pinion = {teeth = 23, bore_diameter_mm = 3.861, tip_round_mm = 0.0284, tip_relief_amount_um = 43.7, \
tip_relief_length_mm = 0.487, tip_relief_exponent = 2.0}
wheel = {teeth = 13, bore_diameter_mm = 1.05, profile_shift = 0.345}

[microgeometry]
torques_Nm = [0.4371]
wheel = {tip_relief_um = 8.8, tip_relief_length_mm = 0.371, tip_relief_shape = "linear"}
"""


@pytest.mark.parametrize(
    ("text", "part"),
    [(SMOOTH, (0.0, 1.0)), (LIGHT, (0.0, 1.0)), (KINKED, (0.72, 0.77))],
    ids=["smooth", "light", "kinked"],
)
def test_the_stated_error_covers_random_places(tmp_path, text, part):
    """The largest error at 300 random places in a part of the mesh cycle is at most 1.3 times the stated one."""
    (tmp_path / "job.toml").write_text(text, encoding="utf-8")
    job = read_stiffness_job(tmp_path / "job.toml")
    force = float(job.mesh.loads.torques()[0]) / job.pair.wheel.base_radius
    pair = half_plane_pair(job.elastic())
    law = mesh_law(pair, force)
    random = np.random.default_rng(7)
    angles = law.nodes[0] + law.cycle * random.uniform(*part, 300)
    approaches = law.first_contact(angles) + law.reach * np.exp(random.uniform(math.log(1e-4), 0.0, 300))
    twists = approaches / job.pair.wheel.base_radius + job.pair.contact_twist
    true = solve_half_plane(pair, angles, twists).torque_wheel / job.pair.wheel.base_radius
    errors = np.abs(law(angles, approaches).force - true) / np.maximum(true, LEAST_FORCE * force)
    assert errors.max() < 1.3 * law.error


@pytest.mark.parametrize("largest", [0.8, 1.3, 40.0, 2000.0])
def test_cubics_over_the_force_follow_line_contact(largest):
    """Lambda of Hertz's line contact, F (30 - ln F) for an asked force of 1: Hermite's cubics err by 1e-4 of it, or of
    that of a tenth of the asked force where the force is smaller. (30 is that of the shipped pair, about.)
    """
    ends = force_cells(largest, 1.0)
    assert ends[0] == 0.0
    assert ends[-1] == largest
    for low, high in itertools.pairwise(ends[1:].tolist()):
        h, x = high - low, np.linspace(0.0, 1.0, 101)
        values = [end * (30.0 - math.log(end)) for end in (low, high)]
        slopes = [h * (29.0 - math.log(end)) for end in (low, high)]
        basis = [(1 + 2 * x) * (1 - x) ** 2, x**2 * (3 - 2 * x), x * (1 - x) ** 2, -(x**2) * (1 - x)]
        cubic = np.array([*values, *slopes]) @ np.array(basis)
        force = low + h * x
        true = force * (30.0 - np.log(force))
        floor = LEAST_FORCE * (30.0 - math.log(LEAST_FORCE))
        assert (np.abs(cubic - true) / np.maximum(true, floor)).max() < 1.5e-4
