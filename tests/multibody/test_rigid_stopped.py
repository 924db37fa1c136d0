"""Runs that stop early say why: locked positions against their closed form, motions that grow, steps that are short."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfe.multibody import (
    Body,
    CoordinateSpring,
    Distance,
    Hinge,
    Linkage,
    Moment,
    PointForce,
    Prescribed,
    Slot,
    System,
    Trajectory,
    integrate,
    polynomial,
)
from gearfe.multibody.core.inverse import prescribed_motion
from gearfe.multibody.core.start import consistent_start
from gearfe.multibody.core.steps import ENDLESS, Pace, Status
from gearfe.multibody.core.stopped import _steepest
from gearfe.multibody.planar.assembly import label_of
from gearfe.multibody.planar.couplings import GearRatio

CRANK, COUPLER, ROCKER, BASE = 2.5, 1.5, 2.5, 3.0


def link(name: str, length: float, begin: tuple[float, float], end: tuple[float, float]) -> Body:
    """A slender bar of 1 kg per metre whose origin is its first end."""
    angle = math.atan2(end[1] - begin[1], end[0] - begin[0])
    return Body(name, length, length**3 / 12.0, centre=(0.5 * length, 0.0), position=begin, angle=angle)


def four_bar(start: float, motion: float) -> System:
    """Crank, coupler and rocker; the crank turns from `start` (rad) at the speed `motion` (rad/s)."""
    B = CRANK * math.cos(start), CRANK * math.sin(start)
    dx, dy = BASE - B[0], -B[1]
    far = math.hypot(dx, dy)
    along = (COUPLER**2 - ROCKER**2 + far**2) / (2.0 * far)
    side = math.sqrt(COUPLER**2 - along**2)
    C = B[0] + (along * dx - side * dy) / far, B[1] + (along * dy + side * dx) / far
    bodies = (
        link("crank", CRANK, (0.0, 0.0), B),
        link("coupler", COUPLER, B, C),
        link("rocker", ROCKER, (BASE, 0.0), C),
    )
    joints = (
        Hinge("crank", "ground", name="A"),
        Hinge("coupler", "crank", point_b=(CRANK, 0.0), name="B"),
        Hinge("coupler", "rocker", point_a=(COUPLER, 0.0), point_b=(ROCKER, 0.0), name="C"),
        Hinge("rocker", "ground", point_b=(BASE, 0.0), name="D"),
        Prescribed("crank", "angle", polynomial([start, motion]), name="drive"),
    )
    return System([Linkage(bodies, joints)])


@pytest.mark.parametrize("method", ["taylor", "implicit", "inverse"])
def test_a_driven_four_bar_locks_where_coupler_and_rocker_are_in_line(method: str) -> None:
    """Law of cosines with the fourth side COUPLER + ROCKER: the largest angle of the crank."""
    system = four_bar(0.6, 1.0)
    lock = math.acos((CRANK**2 + BASE**2 - (COUPLER + ROCKER) ** 2) / (2.0 * CRANK * BASE)) - 0.6
    times = np.linspace(0.0, 2.0, 201)
    run: Trajectory
    if method == "inverse":
        run = prescribed_motion(system, consistent_start(system, 0.0), times)
    else:
        run = integrate(system, times, method=method, tolerance=1e-8, raise_on_failure=False)
    assert run.status is not Status.DONE
    assert "the mechanism locks with coupler and rocker in line (prescribed drive asks for a motion" in run.message
    assert run.reached == pytest.approx(lock, abs=1e-4)


def test_a_driven_slider_locks_where_crank_and_rod_are_in_line() -> None:
    """A piston pulled beyond the sum of crank and rod."""
    crank, rod, speed = 1.0, 2.0, 0.5
    angle = 0.7
    A = crank * math.cos(angle), crank * math.sin(angle)
    B = A[0] + math.sqrt(rod**2 - A[1] ** 2), 0.0
    bodies = (link("crank", crank, (0.0, 0.0), A), link("rod", rod, A, B), Body("piston", 1.0, 0.1, position=B))
    joints = (
        Hinge("crank", "ground", name="O"),
        Hinge("rod", "crank", point_b=(crank, 0.0), name="A"),
        Hinge("rod", "piston", point_a=(rod, 0.0), name="B"),
        Slot("piston", "ground", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0), name="guide"),
        Prescribed("piston", "x", polynomial([B[0], speed]), name="drive"),
        Prescribed("piston", "angle", polynomial([0.0]), name="upright"),
    )
    run = integrate(System([Linkage(bodies, joints)]), np.linspace(0.0, 2.0, 50), raise_on_failure=False)
    assert "the mechanism locks with crank and rod in line (prescribed drive" in run.message
    assert run.reached == pytest.approx((crank + rod - B[0]) / speed, abs=1e-4)


def test_the_same_crank_turns_where_the_linkage_can_follow() -> None:
    """Between its two locked positions, 0.318 and 1.62 rad."""
    run = integrate(four_bar(1.5, -1.0), [0.0, 1.0], raise_on_failure=False)
    assert run.status is Status.DONE


def test_steps_that_double_in_equal_times_stop_a_run() -> None:
    """exp(t) steps by the time t: 1e8 times the steps allowed at the end, known after 2**13 of them."""
    pace = Pace(0.0, math.log(1e6 * ENDLESS) + 20.0, 1_000_000)
    seen = [n for n in range(64, 1_000_000, 64) if pace.hopeless(math.log(n), n)]
    assert seen
    assert seen[0] <= 2**13


@pytest.mark.parametrize("power", [1.0, 2.0, 6.0, 10.0])
def test_steps_that_grow_by_a_power_of_time_do_not_stop_a_run(power: float) -> None:
    """t**power steps by the time t, 1e6 at its end, as where a shaft runs up."""
    end = 1e6 ** (1.0 / power)
    pace = Pace(0.0, end, 1_000_000)
    needed = []
    for n in range(64, 1_000_000, 64):
        assert not pace.hopeless(n ** (1.0 / power), n)
        needed.append(pace.needed)
    assert min(needed[512 // 64 * 8 :]) > 0.8e6
    assert max(needed[512 // 64 * 8 :]) < 1.25e6


def test_a_run_with_too_many_steps_names_what_makes_them_short() -> None:
    body = Body("rotor", 1.0, 0.1, rate=1.1e4)  # the hinge 0.1 m off its centre takes a part: 0.1 / (0.1 + 0.01)
    system = System([Linkage((body,), (Hinge("rotor", "ground", point_a=(0.1, 0.0)),), (Moment("rotor", 1.0),))])
    run = integrate(system, [0.0, 10.0], method="taylor", most_steps=100, raise_on_failure=False)
    assert run.status is Status.MOST_STEPS
    assert "rotor turns at 1e+04 rad/s" in run.message


def test_a_rod_that_is_driven_itself_is_named_among_the_links_in_line() -> None:
    """Crank 1.5 m and rod 1 m, whose end is drawn along the x axis from 2 m at 1 m/s: in line at 2.5 m."""
    cosine = (1.5**2 + 2.0**2 - 1.0) / (2.0 * 1.5 * 2.0)
    A = 1.5 * cosine, 1.5 * math.sqrt(1.0 - cosine**2)
    bodies = (link("crank", 1.5, (0.0, 0.0), A), link("rod", 1.0, A, (2.0, 0.0)))
    joints = (
        Hinge("crank", "ground", name="O"),
        Hinge("rod", "crank", point_b=(1.5, 0.0), name="A"),
        Slot("rod", "ground", (1.0, 0.0), (0.0, 0.0), (1.0, 0.0), name="guide"),
        Prescribed("rod", "x", polynomial([2.0, 1.0]), point=(1.0, 0.0), name="drive"),
    )
    run = integrate(System([Linkage(bodies, joints)]), np.linspace(0.0, 1.0, 50), raise_on_failure=False)
    assert "the mechanism locks with crank and rod in line (prescribed drive" in run.message
    assert run.reached == pytest.approx(0.5, abs=1e-4)


def test_a_rod_without_mass_is_named_among_the_links_in_line() -> None:
    """A boom of 1 m on the origin, and a cylinder from (0.5, -0.5) m to its end: longest at 1 + sqrt(0.5) m."""
    boom = link("boom", 1.0, (0.0, 0.0), (1.0, 0.0))
    cylinder = Distance("boom", "ground", (1.0, 0.0), (0.5, -0.5), polynomial([math.sqrt(0.5), 0.5]), name="cylinder")
    system = System([Linkage((boom,), (Hinge("boom", "ground", name="O"), cylinder))])
    run = integrate(system, np.linspace(0.0, 3.0, 50), raise_on_failure=False)
    assert "the mechanism locks with boom and distance cylinder in line (distance cylinder asks" in run.message
    assert run.reached == pytest.approx(2.0, abs=1e-4)


def test_messages_call_joints_and_forces_as_job_files_do() -> None:
    parts = (GearRatio("a", "b", -2.0, name="g"), CoordinateSpring("a", "angle", 1.0), PointForce("a", x=1.0, name="f"))
    assert [label_of(part, 7) for part in parts] == ["gear g", "coordinate spring 7", "force f"]


@pytest.mark.parametrize("fast", [900, 1500, 3000, 20_000])
def test_one_change_to_steps_a_hundred_times_shorter_stops_no_run(fast: int) -> None:
    """As where a part moves freely until it touches another one halfway; fewer steps than are allowed do the rest."""
    times = np.concatenate([np.linspace(0.0, 0.5, fast + 1), np.linspace(0.5, 1.0, 100 * min(fast, 3000) + 1)[1:]])
    pace = Pace(0.0, 1.0, 400_000)
    assert not [n for n, t in enumerate(times.tolist()) if pace.hopeless(t, n)]


@pytest.mark.parametrize(("needed", "stops"), [(5.0, True), (1.5, False)])
def test_a_steady_pace_beyond_the_steps_allowed_stops_early(needed: float, stops: bool) -> None:
    """Equal steps tell after some looks that the run needs more than is allowed; one that may pass goes on."""
    pace = Pace(0.0, 1.0, 1_000_000)
    seen = [n for n in range(64, 500_000, 64) if pace.hopeless(n / (needed * 1e6), n)]
    assert bool(seen) is stops
    assert not stops or seen[0] < 20_000


@pytest.mark.parametrize("width", [1e-2, 1e-6, 1e-10])
@pytest.mark.parametrize("place", [-7.0, 0.0, 0.3])
def test_the_steep_part_of_a_load_is_found(width: float, place: float) -> None:
    """tanh makes 96 % of its change within two widths on either side, 76 % within one."""
    low, high = _steepest(lambda x: math.tanh((x - place) / width), -10.0, 10.0)
    assert low < place < high
    assert 1.0 * width < high - low < 6.0 * width


def test_a_jump_is_found_to_rounding_and_a_line_is_left_whole() -> None:
    low, high = _steepest(lambda x: 1.0 if x > 0.3 else -1.0, 0.0, 1.0)
    assert low <= 0.3 <= high
    assert high - low < 1e-15
    assert _steepest(lambda x: 2.0 * x, -1.0, 4.0) == (-1.0, 4.0)
