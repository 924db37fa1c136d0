"""Gears, belts and racks on carriers that move, and motions prescribed in the frame of a body that moves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.errors import InputError
from gearfe.base.tables.kinds import UNIT_OF
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.mechanisms.model import Mechanism, make_mechanism
from gearfe.mechanisms.results import reactions
from gearfe.mechanisms.solve import solve
from gearfe.multibody import Trajectory

ARM = 0.1125
SUN, PLANET, RING = 18, 12, 42


def body(x: float = 0.0, y: float = 0.0, **keys: Any) -> dict[str, Any]:
    return {"mass_kg": 0.5, "inertia_kg_m2": 0.001, "position_m": [x, y], **keys}


def hinge(name: str, to: str = "ground", **keys: Any) -> dict[str, Any]:
    return {"type": "hinge", "body": name, "to": to, **keys}


def drive(name: str, rate: float, **keys: Any) -> dict[str, Any]:
    return {"type": "prescribed", "body": name, "coordinate": "rate", "motion_rad_per_s": rate, **keys}


def planetary() -> dict[str, Any]:
    return {
        "run": {"end_s": 1.0, "step_s": 0.05},
        "bodies": {"sun": body(), "carrier": body(points_m={"P": [ARM, 0.0]}), "planet": body(ARM)},
        "joints": {
            "O_sun": hinge("sun"),
            "O_carrier": hinge("carrier"),
            "P": hinge("planet", "carrier", to_point="P"),
            "mesh": {"type": "gear", "body": "sun", "to": "planet", "ratio": -SUN / PLANET},
        },
    }


def made(raw: dict[str, Any]) -> Mechanism:
    return make_mechanism(build(MechanismFile, raw, ""), Path("job.toml"))


def run(raw: dict[str, Any]) -> Trajectory:
    trajectory = solve(made(raw)).results.trajectory
    assert trajectory.status == 0
    return trajectory


def rates(trajectory: Trajectory) -> dict[str, np.ndarray]:
    names = [name.removesuffix("_angle_rad") for name in trajectory.system.coordinate_names()[2::3]]
    return dict(zip(names, trajectory.v[:, 2::3].T, strict=True))


def test_a_planet_on_a_carrier_that_turns() -> None:
    """Willis: (w_p - w_c) = -z_s/z_p (w_s - w_c); sun 10 and carrier 3 rad/s give -7.5 rad/s."""
    raw = planetary()
    raw["joints"] |= {"arm": drive("carrier", 3.0), "drive": drive("sun", 10.0)}
    np.testing.assert_allclose(rates(run(raw))["planet"], -7.5, rtol=1e-12)


@pytest.mark.parametrize("moving", [False, True])
def test_a_ring_at_rest_and_one_that_turns(moving: bool) -> None:
    """Carrier: (z_s w_s + z_r w_r)/(z_s + z_r); planet by the ring: (w_p - w_c) = z_r/z_p (w_r - w_c)."""
    raw, ring = planetary(), 2.0 if moving else 0.0
    raw["joints"] |= {
        "drive": drive("sun", 10.0),
        "inner": {
            "type": "gear",
            "body": "planet",
            "to": "ring" if moving else "ground",
            "ratio": PLANET / RING,
        },
    }
    if moving:
        raw["bodies"]["ring"] = body()
        raw["joints"] |= {"O_ring": hinge("ring"), "turn": drive("ring", ring)}
    found = rates(run(raw))
    carrier = (SUN * 10.0 + RING * ring) / (SUN + RING)
    np.testing.assert_allclose(found["carrier"], carrier, rtol=1e-10)
    np.testing.assert_allclose(found["planet"], carrier + RING / PLANET * (ring - carrier), rtol=1e-10)


def test_teeth_of_sun_and_planet_have_one_velocity_and_no_loss() -> None:
    """Under torque and weight: equal velocities at the pitch point along the teeth, and energy less work stays."""
    raw = planetary()
    raw["forces"] = {
        "weight": {"type": "gravity", "acceleration_m_per_s2": [0.0, -9.81]},
        "torque": {"type": "moment", "body": "sun", "moment_N_m": {"constant": 0.2, "sine": 0.1, "frequency_hz": 2.0}},
    }
    mechanism = made(raw)
    solved = solve(mechanism)
    q, v = solved.results.trajectory.q, solved.results.trajectory.v
    along = q[:, 6:8] - q[:, 0:2]  # from the sun's centre to the planet's
    pitch = SUN / (SUN + PLANET) * along
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]

    def speed(first: int, arm: np.ndarray) -> np.ndarray:
        at = v[:, first : first + 2] + v[:, first + 2, None] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        return np.asarray((at * across).sum(axis=1))

    np.testing.assert_allclose(speed(0, pitch), speed(6, pitch - along), atol=1e-9)
    assert np.ptp(v[:, 5]) > 0.5  # the carrier swings
    assert np.ptp(solved.results.energy["total_J"]) < 1e-9


def test_two_stages_of_which_one_carrier_is_the_next_sun() -> None:
    """Each stage with its ring at rest turns its carrier by z_s/(z_s + z_r) of its sun."""
    raw = planetary()
    raw["bodies"] |= {"sun2": body(), "carrier2": body(), "planet2": body(0.0, ARM)}
    raw["joints"] |= {
        "drive": drive("sun", 10.0),
        "inner": {"type": "gear", "body": "planet", "to": "ground", "ratio": PLANET / RING},
        "one": {"type": "fixed", "body": "sun2", "to": "carrier"},
        "O_2": hinge("carrier2"),
        "P2": hinge("planet2", "carrier2", to_point=[0.0, ARM]),
        "mesh2": {"type": "gear", "body": "sun2", "to": "planet2", "ratio": -SUN / PLANET},
        "inner2": {"type": "gear", "body": "planet2", "to": "ground", "ratio": PLANET / RING},
    }
    np.testing.assert_allclose(rates(run(raw))["carrier2"], 10.0 * 0.3**2, rtol=1e-9)


@pytest.mark.parametrize("crossed", [False, True])
def test_a_belt_along_an_arm(crossed: bool) -> None:
    """A pulley at rest, as large as the one at the elbow: an open belt keeps the elbow's pulley from turning."""
    raw = planetary()
    raw["joints"].pop("mesh")
    raw["joints"] |= {
        "arm": drive("carrier", 3.0),
        "belt": {"type": "belt", "body": "planet", "to": "ground", "radius_m": 0.02, "to_radius_m": 0.02,
                 "crossed": crossed},
    }  # fmt: skip
    raw["bodies"].pop("sun")
    raw["joints"].pop("O_sun")
    np.testing.assert_allclose(rates(run(raw))["planet"], 6.0 if crossed else 0.0, atol=1e-9)


def test_a_rack_on_a_frame_that_turns() -> None:
    """The rack slides along the frame by the radius times what the pinion turns against the frame."""
    raw: dict[str, Any] = {
        "run": {"end_s": 1.0, "step_s": 0.05},
        "bodies": {"frame": body(centre_m=[0.2, 0.1]), "pinion": body(), "rack": body(0.1, 0.05)},
        "joints": {
            "O": hinge("frame"),
            "p": hinge("pinion", "frame"),
            "guide": {
                "type": "prismatic",
                "body": "rack",
                "to": "frame",
                "to_point": [0.0, 0.05],
                "direction": [1, 0],
            },
            "teeth": {"type": "rack", "body": "rack", "to": "pinion", "radius_m": 0.05},
            "turn": drive("frame", 2.0),
            "drive": drive("pinion", 3.0),
        },
        "outputs": [{"name": "x_m", "value": "cos(angle(frame))*x(rack) + sin(angle(frame))*y(rack)"}],
    }
    solved = solve(made(raw))
    time = solved.results.trajectory.time
    np.testing.assert_allclose(solved.results.outputs["x_m"], 0.1 + 0.05 * (3.0 - 2.0) * time, atol=1e-9)


def test_a_cylinder_of_given_length_raises_a_boom() -> None:
    """x of the rod in the barrel's frame is the length L; the boom's angle closes the triangle of O, P and C."""
    raw: dict[str, Any] = {
        "run": {"end_s": 2.0, "step_s": 0.1},
        "ground": {"points_m": {"P": [0.8, -0.4]}},
        "bodies": {
            "boom": body(centre_m=[2.0, 0.0], angle_deg=10.0, points_m={"C": [1.6, 0.0]}),
            "barrel": body(0.8, -0.4, centre_m=[0.3, 0.0], angle_deg=45.0),
            "rod": body(1.5, 0.3, centre_m=[-0.3, 0.0], angle_deg=45.0),
        },
        "joints": {
            "O": hinge("boom"),
            "P": hinge("barrel", to_point="P"),
            "C": hinge("rod", "boom", to_point="C"),
            "stroke": {"type": "prismatic", "body": "rod", "to": "barrel", "direction": [1.0, 0.0], "angle_deg": 0.0},
            "cylinder": {
                "type": "prescribed",
                "body": "rod",
                "to": "barrel",
                "coordinate": "x",
                "motion_m": {"constant": 1.0, "step": 0.4, "step_centre_s": 1.0, "step_width_s": 1.6},
            },
        },
    }
    trajectory = run(raw)
    x = np.clip((trajectory.time - 0.2) / 1.6, 0.0, 1.0)
    length = 1.0 + 0.4 * (10 * x**3 - 15 * x**4 + 6 * x**5)
    base = math.hypot(0.8, 0.4)
    angle = np.arccos((1.6**2 + base**2 - length**2) / (2 * 1.6 * base)) - math.atan2(0.4, 0.8)
    np.testing.assert_allclose(trajectory.q[:, 2], angle, atol=1e-8)
    assert angle[[0, -1]] == pytest.approx([0.1378, 0.5961], abs=1e-4)


def actuator(length: Any) -> dict[str, Any]:
    """A boom on a hinge, raised by a rod without mass of a given length; the power of the drive is work."""
    return {
        "run": {"end_s": 2.0, "step_s": 0.1},
        "ground": {"points_m": {"P": [0.8, -0.4]}},
        "bodies": {"boom": body(centre_m=[2.0, 0.0], angle_deg=10.0, points_m={"C": [1.6, 0.0]})},
        "joints": {
            "O": hinge("boom"),
            "cylinder": {"type": "distance", "body": "boom", "point": "C", "to_point": "P", "length_m": length},
        },
        "forces": {"weight": {"type": "gravity", "acceleration_m_per_s2": [0.0, -9.81]}},
    }


@pytest.mark.parametrize("kind", ["step", "polynomial", "sines"])
def test_a_distance_over_time_is_an_actuator(kind: str) -> None:
    """The boom's angle closes the triangle; its moment about O is that of the tension, I angle'' less the weight's."""
    lengths: dict[str, dict[str, Any]] = {
        "step": {"constant": 1.0, "step": 0.4, "step_centre_s": 1.0, "step_width_s": 1.6},
        "polynomial": {"polynomial": [1.0, 0.1, 0.05]},
        "sines": {"constant": 1.2, "sine": 0.15, "frequency_hz": 0.7, "phase_deg": 20.0},
    }
    raw = actuator(lengths[kind])
    raw["run"]["method"] = "taylor"
    mechanism = made(raw)
    solved = solve(mechanism)
    trajectory = solved.results.trajectory
    t = trajectory.time
    x = np.clip((t - 0.2) / 1.6, 0.0, 1.0)
    length = {
        "step": 1.0 + 0.4 * (10 * x**3 - 15 * x**4 + 6 * x**5),
        "polynomial": 1.0 + 0.1 * t + 0.05 * t**2,
        "sines": 1.2 + 0.15 * np.sin(2 * math.pi * 0.7 * t + math.radians(20.0)),
    }[kind]
    base = math.hypot(0.8, 0.4)
    angle = np.arccos((1.6**2 + base**2 - length**2) / (2 * 1.6 * base)) - math.atan2(0.4, 0.8)
    np.testing.assert_allclose(trajectory.q[:, 2], angle, atol=1e-7)
    pull = reactions(mechanism, trajectory)
    arm = 1.6 * np.cos(angle), 1.6 * np.sin(angle)
    moment = arm[0] * pull["cylinder_y_N"] - arm[1] * pull["cylinder_x_N"]
    needed = (0.001 + 0.5 * 4.0) * trajectory.a[:, 2] + 0.5 * 9.81 * 2.0 * np.cos(angle)
    np.testing.assert_allclose(moment, needed, atol=1e-4 * np.abs(needed).max())
    assert np.ptp(solved.results.energy["total_J"]) < 1e-5


@pytest.mark.parametrize(
    ("length", "text"),
    [
        ({"polynomial": [1.0, -0.6]}, r"length_m = -0\.19999.*must be > 0 m at all times"),
        (
            {"constant": 1.2, "step": 0.1, "step_width_s": 1.0, "sine": 0.1, "frequency_hz": 1.0},
            "sines together with a poly",
        ),
        (-1.0, r"length_m = -1"),
    ],
)
def test_lengths_that_cannot_be(length: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        made(actuator(length))


@pytest.mark.parametrize("to_point", [None, [0.15, -0.07]])
@pytest.mark.parametrize("coordinate", ["x", "y"])
def test_a_coordinate_in_the_frame_of_a_body_that_turns(coordinate: str, to_point: list[float] | None) -> None:
    """The point's place seen from the frame's origin, not from its mass centre, or from `to_point`."""
    frame = body(0.3, 0.2, centre_m=[0.2, 0.1], angle_rad=0.4, rate_rad_per_s=1.5)
    raw: dict[str, Any] = {
        "run": {"end_s": 0.5, "step_s": 0.05},
        "bodies": {"frame": frame, "load": body(0.6, 0.5, centre_m=[0.05, 0.02])},
        "joints": {
            "given": {
                "type": "prescribed",
                "body": "load",
                "point": [0.1, -0.1],
                "to": "frame",
                "coordinate": coordinate,
                f"motion_{UNIT_OF[coordinate]}": {"polynomial": [0.4, 0.3, -0.2]},
            }
        },
    }
    raw["bodies"]["load"]["points_m"] = {"P": [0.1, -0.1]}
    raw["bodies"]["frame"]["points_m"] = {"O": to_point or [0.0, 0.0]}
    if to_point is not None:
        raw["joints"]["given"]["to_point"] = to_point
    raw["outputs"] = [
        {"name": "x", "value": "cos(angle(frame))*(x(load.P)-x(frame.O)) + sin(angle(frame))*(y(load.P)-y(frame.O))"},
        {"name": "y", "value": "cos(angle(frame))*(y(load.P)-y(frame.O)) - sin(angle(frame))*(x(load.P)-x(frame.O))"},
    ]
    solved = solve(made(raw))
    time = solved.results.trajectory.time
    np.testing.assert_allclose(solved.results.outputs[coordinate], 0.4 + 0.3 * time - 0.2 * time**2, atol=1e-8)


def test_a_gear_without_a_carrier_is_refused() -> None:
    """A rod without mass for an arm has no angle of its own; several arms, or a ring round a fixed axis."""
    raw = planetary()
    raw["joints"].pop("P")
    raw["joints"]["P"] = {"type": "distance", "body": "planet", "length_m": ARM}
    with pytest.raises(InputError, match=r"carrier: is unknown.*name the body that holds the distance"):
        made(raw)
    raw = planetary()
    raw["bodies"]["second"] = body()
    raw["joints"] |= {"O2": hinge("second"), "pin": hinge("second", "planet", point=[0.1, 0.0], to_point=[0.02, 0.0])}
    with pytest.raises(InputError, match=r"may be 'carrier' or 'second'.*carrier = \.\.\."):
        made(raw)
    raw["joints"]["mesh"]["carrier"] = "carrier"
    made(raw)
    raw["joints"]["mesh"]["carrier"] = "planet"
    with pytest.raises(InputError, match="is one of the two that are coupled"):
        made(raw)
    raw = planetary()
    raw["joints"]["mesh"] = {"type": "gear", "body": "sun", "to": "ground", "ratio": 0.5}
    with pytest.raises(InputError, match="name the other body"):
        made(raw)
    raw["joints"]["mesh"]["carrier"] = "nobody"
    with pytest.raises(InputError, match=r"joints\.mesh\.carrier"):
        made(raw)
