"""All contact laws on whole gears: the monolithic route against the condensed one, and against each other."""

import math

import pytest

from gearfe.contact.compliance import gear_body
from gearfe.contact.laws import ContactLaw, Exact, Nitsche
from gearfe.contact.scene import MeshingPair
from gearfe.contact.solver import solve_position
from gearfe.elasticity import Plane
from gearfe.verification.monolithic import solve_monolithic

from .contact_cases import IRON, STEEL, WIDTH, gears, meshes, oracle_law, whole

COARSE = 5.0
CASES = [
    # pair, plane, law, pinion angle, twist (deg)
    ("sharp", "strain", Nitsche(20.0, theta=1), 9.0, 0.05),
    ("modified", "stress", Nitsche(theta=-1, sides="wheel"), 5.0, 0.05),
    ("modified", "stress", Exact(), 5.0, 0.05),
]


@pytest.mark.parametrize(("name", "plane", "law", "angle", "twist"), CASES)
def test_both_routes_give_the_same_position(
    name: str, plane: Plane, law: ContactLaw, angle: float, twist: float
) -> None:
    place = math.radians(angle), math.radians(twist)
    made = [
        gear_body(mesh, material, plane, WIDTH, with_stress=law.uses_stress, law=law, gear=gear)
        for gear, (mesh, material) in enumerate(zip(meshes(name, COARSE), (STEEL, IRON), strict=True))
    ]
    pair = MeshingPair(made[0], made[1], gears(name).working_centre_distance, WIDTH, law)
    small = solve_position(pair, *place, tolerance=1e-11)
    full = solve_monolithic(whole(name, COARSE, plane), oracle_law(law), *place)
    assert small.status == full.status == "converged"
    for quantity in ("torque_wheel", "torque_pinion", "torque_wheel_reaction", "peak_pressure"):
        assert getattr(full, quantity) == pytest.approx(getattr(small, quantity), rel=1e-8), quantity
