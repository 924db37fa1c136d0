"""Every joint and every force against a closed form or an equation written down independently."""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from gearfe.base.errors import InputError
from gearfe.multibody import (
    Body,
    CoordinateSpring,
    Fixed,
    Gravity,
    Hinge,
    IntegrationError,
    Linkage,
    Moment,
    PointForce,
    Prescribed,
    Prismatic,
    Slot,
    Spring,
    Status,
    System,
    consistent_start,
    constant,
    integrate,
    polynomial,
    sine,
    smoothed_step,
)
from tests.makers.rigid_cases import G, by_scipy, chain, pendulum, residuals, total_energy

GRAVITY = Gravity((0.0, -G))


def run(linkage: Linkage, times, **options):  # type: ignore[no-untyped-def]
    made = integrate(System([linkage]), times, **{"tolerance": 1e-11, **options})
    assert made.status == 0
    return made


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_pendulum_period(method):
    """Period 4 sqrt(2 l / 3 g) K(sin^2(a/2)) of a rod swinging by a = 1 about the vertical."""
    length, swing = 0.8, 1.0
    period = 4 * sqrt(2 * length / (3 * G)) * ellipk(sin(swing / 2) ** 2)
    system = pendulum(-pi / 2 + swing, length)
    made = integrate(system, [0.0, period], method=method, tolerance=1e-9)
    assert made.status == 0
    assert abs(made.q[-1, 2] - (-pi / 2 + swing)) <= 1e-7
    assert abs(made.v[-1, 2]) <= 1e-6


def test_hinge_reaction_of_a_hanging_rod():
    """At rest the hinge carries the weight: its multipliers are (0, m g)."""
    system = pendulum(-pi / 2)
    start = consistent_start(system)
    _, multipliers = system.acceleration(0.0, start.q, start.v)
    assert np.allclose(np.abs(multipliers), [0.0, 2.0 * G], atol=1e-12)


def test_chain_energy_and_reversal():
    system = chain(4)
    there = integrate(system, np.linspace(0, 1, 11), tolerance=1e-12)
    assert np.ptp(total_energy(there)) <= 1e-9
    assert max(residuals(there)) <= 1e-9
    back = integrate(
        system, [1.0, 0.0], tolerance=1e-12,
        start=consistent_start(system, 1.0, q=there.q[-1], v=there.v[-1]),
    )  # fmt: skip
    assert np.abs(back.q[-1] - system.start_q).max() <= 1e-9


def test_double_pendulum_against_the_textbook_equations():
    """Two uniform rods: the equations of motion from the Lagrangian, integrated by scipy."""
    l1, l2, m1, m2 = 0.7, 0.5, 1.3, 0.9
    a1, a2 = 0.4, -0.9  # angles from the x axis
    bodies = (
        Body("a", m1, m1 * l1**2 / 12, (l1 / 2, 0.0), (0.0, 0.0), a1),
        Body("b", m2, m2 * l2**2 / 12, (l2 / 2, 0.0), (l1 * cos(a1), l1 * sin(a1)), a2),
    )
    joints = (Hinge("a", "ground"), Hinge("b", "a", (0.0, 0.0), (l1, 0.0)))
    times = np.linspace(0, 2, 41)

    def rhs(_t, y):  # type: ignore[no-untyped-def]
        p, q, dp, dq = y
        M = np.array([[m1 * l1**2 / 3 + m2 * l1**2, m2 * l1 * l2 / 2 * cos(p - q)],
                      [m2 * l1 * l2 / 2 * cos(p - q), m2 * l2**2 / 3]])  # fmt: skip
        s = m2 * l1 * l2 / 2 * sin(p - q)
        f = [-s * dq**2 - (m1 / 2 + m2) * G * l1 * cos(p), s * dp**2 - m2 * G * l2 / 2 * cos(q)]
        return [dp, dq, *np.linalg.solve(M, f)]

    exact = solve_ivp(rhs, (0, 2), [a1, a2, 0, 0], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y
    made = run(Linkage(bodies, joints, (GRAVITY,)), times)
    assert np.abs(made.q[:, [2, 5]] - exact[:2].T).max() <= 1e-9


def test_damped_spring_between_points():
    """m x'' + c x' + k x = 0 along the line of a prismatic joint, with the free length as its place of rest."""
    m, k, c, x0 = 2.0, 50.0, 3.0, 0.3
    body = Body("m", m, 1.0, position=(1.0 + x0, 0.0))
    linkage = Linkage(
        (body,),
        (Prismatic("m", "ground"),),
        (Spring("ground", "m", stiffness=k, damping=c, free_length=1.0),),
    )
    times = np.linspace(0, 3, 31)
    made = run(linkage, times)
    decay, omega = c / (2 * m), sqrt(k / m - (c / (2 * m)) ** 2)
    exact = 1.0 + x0 * np.exp(-decay * times) * (np.cos(omega * times) + decay / omega * np.sin(omega * times))
    assert np.abs(made.q[:, 0] - exact).max() <= 1e-9


def test_springs_to_ground_on_every_coordinate():
    body = Body("m", 2.0, 0.5, position=(0.1, -0.2), angle=0.3)
    forces = tuple(CoordinateSpring("m", c, stiffness=k) for c, k in (("x", 8.0), ("y", 18.0), ("angle", 8.0)))
    times = np.linspace(0, 4, 41)
    made = run(Linkage((body,), (), forces), times)
    for column, (start, omega) in enumerate(((0.1, 2.0), (-0.2, 3.0), (0.3, 4.0))):
        assert np.abs(made.q[:, column] - start * np.cos(omega * times)).max() <= 1e-9


def test_torsion_between_two_bodies_conserves_momentum():
    bodies = (Body("a", 1.0, 1.0, angle=0.5), Body("b", 1.0, 3.0))
    made = run(Linkage(bodies, (), (CoordinateSpring("a", "angle", 12.0, relative_to="b"),)), np.linspace(0, 2, 21))
    omega = sqrt(12.0 * (1 / 1.0 + 1 / 3.0))
    assert np.abs(made.q[:, 2] - made.q[:, 5] - 0.5 * np.cos(omega * made.time)).max() <= 1e-9
    assert np.abs(made.v[:, 2] + 3.0 * made.v[:, 5]).max() <= 1e-9


def test_point_force_and_moment_with_time_functions():
    """A free body: the moment of a step and of an eccentric, time-dependent force."""
    body = Body("m", 2.0, 0.5)
    forces = (
        Moment("m", smoothed_step(1.0, 0.5, 3.0)),
        PointForce("m", (0.0, 0.0), sine(4.0, 3.0), polynomial((1.0, 2.0))),
    )
    times = np.linspace(0, 3, 31)
    made = run(Linkage((body,), (), forces), times)
    x = np.clip((times - 1.0 + 0.25) / 0.5, 0, 1)
    rise = 0.5 * (2.5 * x**4 - 3 * x**5 + x**6)  # integral of 10x^3-15x^4+6x^5 over time
    exact = 3.0 / 0.5 * (rise + np.maximum(times - 1.25, 0.0))
    assert np.abs(made.v[:, 2] - exact).max() <= 1e-9
    assert np.abs(made.v[:, 0] - 4.0 / 2.0 * (1 - np.cos(3 * times)) / 3.0).max() <= 1e-9
    assert np.abs(made.v[:, 1] - (times + times**2) / 2.0).max() <= 1e-9


def test_eccentric_force_turns_a_body():
    """Constant force at a point of a hinged body: I theta'' = F_y r cos - F_x r sin, energy F . r."""
    body = Body("m", 1.0, 0.2, (0.0, 0.0))
    force = PointForce("m", (0.4, 0.0), constant(0.0), constant(5.0))
    made = run(Linkage((body,), (Hinge("m", "ground"),), (force,)), np.linspace(0, 1, 11))
    work = 5.0 * 0.4 * np.sin(made.q[:, 2])
    assert np.abs(0.5 * 0.2 * made.v[:, 2] ** 2 - work).max() <= 1e-9


def test_crank_with_prescribed_speed():
    """Crank at constant speed and rod on a line: x_B = r cos(wt) + sqrt(l^2 - r^2 sin^2(wt)); nothing is free."""
    r, length, w = 0.3, 1.0, 7.0
    bodies = (
        Body("crank", 1.0, 0.1, (r / 2, 0.0), rate=w),
        Body("rod", 1.0, 0.1, (length / 2, 0.0), (r, 0.0), 0.0),
    )
    joints = (
        Hinge("crank", "ground"),
        Hinge("crank", "rod", (r, 0.0), (0.0, 0.0)),
        Slot("rod", "ground", (length, 0.0)),
        Prescribed("crank", "rate", constant(w)),
    )
    system = System([Linkage(bodies, joints, (GRAVITY,))])
    start = consistent_start(system)
    assert start.freedoms.net == 0
    times = np.linspace(0, 2, 21)
    made = integrate(system, times, tolerance=1e-11, start=start)
    x_b = made.q[:, 3] + length / 2 * np.cos(made.q[:, 5])
    assert np.abs(x_b - r * np.cos(w * times) - np.sqrt(length**2 - (r * np.sin(w * times)) ** 2)).max() <= 1e-10
    each = [system.acceleration(t, q, v)[1] for t, q, v in zip(times, made.q, made.v, strict=True)]
    np.testing.assert_allclose(made.multipliers, each, rtol=0, atol=1e-9 * np.abs(each).max())


def test_prescribed_place_of_a_point():
    body = Body("m", 1.0, 0.3, position=(0.0, 0.0))
    joints = (Prescribed("m", "x", sine(0.2, 5.0)), Slot("m", "ground"))
    made = run(Linkage((body,), joints), np.linspace(0, 1, 11))
    assert np.abs(made.q[:, 0] - 0.2 * np.sin(5 * made.time)).max() <= 1e-11


def test_slot_on_a_turning_line():
    """Point mass in a slot that turns at constant speed: r = r0 cosh(w t)."""
    w, r0 = 2.0, 0.3
    bodies = (Body("arm", 1.0, 1.0, rate=w), Body("bead", 0.5, 1e-3, position=(r0, 0.0), velocity=(0.0, r0 * w)))
    joints = (Hinge("arm", "ground"), Slot("bead", "arm"), Prescribed("arm", "rate", constant(w)))
    made = run(Linkage(bodies, joints), np.linspace(0, 1.5, 16))
    assert np.abs(np.hypot(made.q[:, 3], made.q[:, 4]) - r0 * np.cosh(w * made.time)).max() <= 1e-10


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_prismatic_joint_between_two_moving_bodies(method):
    """A rod that slides along a free arm on a spring: the Lagrangian in arm angle and displacement, by scipy."""
    arm, rod, k, s0 = 0.7, 0.2, 40.0, 0.5
    bodies = (Body("arm", 1.0, arm), Body("rod", 1.5, rod, position=(s0, 0.0), velocity=(0.0, 0.4 * s0), rate=0.4))
    bodies = (Body("arm", 1.0, arm, rate=0.4), bodies[1])
    joints = (Hinge("arm", "ground"), Prismatic("rod", "arm"))
    forces = (Spring("arm", "rod", stiffness=k, free_length=0.4), GRAVITY)

    def rhs(_t, y):  # type: ignore[no-untyped-def]
        p, s, dp, ds = y
        inertia = arm + rod + 1.5 * s * s
        return [dp, ds, (-2 * 1.5 * s * ds * dp - 1.5 * G * s * cos(p)) / inertia,
                s * dp * dp - k / 1.5 * (s - 0.4) - G * sin(p)]  # fmt: skip

    times = np.linspace(0, 1, 11)
    exact = solve_ivp(rhs, (0, 1), [0, s0, 0.4, 0], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y
    tolerance = 1e-9 if method == "implicit" else 1e-10
    made = run(Linkage(bodies, joints, forces), times, method=method, tolerance=tolerance)
    assert np.abs(made.q[:, 2] - exact[0]).max() <= 1e-7
    assert np.abs(np.hypot(made.q[:, 3], made.q[:, 4]) - exact[1]).max() <= 1e-7


def test_fixed_joint_makes_one_body_of_two():
    """Two rods fixed at an angle swing like one body with the summed inertia."""
    bodies = (
        Body("a", 1.0, 0.1, (0.5, 0.0), angle=-1.0),
        Body("b", 2.0, 0.2, (0.0, 0.3), (cos(-1.0), sin(-1.0)), 0.4),
    )
    made = run(Linkage(bodies, (Hinge("a", "ground"), Fixed("b", "a")), (GRAVITY,)), np.linspace(0, 1, 11))
    assert np.abs(made.q[:, 5] - made.q[:, 2] - 1.4).max() <= 1e-12
    centre = np.array([cos(-1.0) - 0.3 * sin(0.4), sin(-1.0) + 0.3 * cos(0.4)])
    inertia = 0.1 + 0.25 + 0.2 + 2.0 * centre @ centre
    moment = -G * (1.0 * 0.5 * cos(-1.0) + 2.0 * centre[0])
    assert abs(made.a[0, 2] - moment / inertia) <= 1e-9
    assert np.ptp(total_energy(made)) <= 1e-10


def test_random_linkages_keep_energy_and_close():
    """Four-bar linkages from random points: series, SciPy and collocation, one answer."""
    random = np.random.default_rng(3)
    for _ in range(4):
        a, b, c, d = random.uniform(-0.3, 0.3, (4, 2)) + np.array([[0, 0], [0.2, 1.0], [1.6, 1.3], [1.5, 0.0]])
        bodies = tuple(_link(f"l{i}", p, q, random) for i, (p, q) in enumerate(((a, b), (b, c), (c, d))))
        ends = [float(np.hypot(*(q - p))) for p, q in ((a, b), (b, c), (c, d))]
        joints = (
            Hinge("l0", "ground", (0.0, 0.0), tuple(a)),
            Hinge("l1", "l0", (0.0, 0.0), (ends[0], 0.0)),
            Hinge("l2", "l1", (0.0, 0.0), (ends[1], 0.0)),
            Hinge("l2", "ground", (ends[2], 0.0), tuple(d)),
        )
        system = System([Linkage(bodies, joints, (GRAVITY,))])
        times = np.linspace(0, 1.0, 11)
        made = integrate(system, times, tolerance=1e-11)
        assert made.status == 0
        assert np.ptp(total_energy(made)) <= 1e-8
        assert max(residuals(made)) <= 1e-8
        assert np.abs(by_scipy(system, times)[0] - made.q).max() <= 1e-8
        other = integrate(system, times, method="implicit", tolerance=1e-8)
        assert np.abs(other.q - made.q).max() <= 1e-4


def _link(name: str, p, q, random) -> Body:  # type: ignore[no-untyped-def]
    length = float(np.hypot(*(q - p)))
    mass = random.uniform(0.5, 2.0)
    return Body(name, mass, mass * length**2 / 12, (length / 2, 0.0), tuple(p), float(np.arctan2(*(q - p)[::-1])))


def test_loop_that_cannot_close_is_named():
    """A gap of 1 m that three hinges share: in the least-squares sense 1/3 m each."""
    bodies = (Body("a", 1.0, 0.1, position=(0.0, 0.0)), Body("b", 1.0, 0.1, position=(3.0, 0.0)))
    joints = (
        Hinge("a", "ground"),
        Hinge("b", "ground", (0.0, 0.0), (3.0, 0.0)),
        Hinge("a", "b", (1.0, 0.0), (-1.0, 0.0), name="gap"),
    )
    with pytest.raises(InputError, match=r"cannot close: a residual of 0\.333"):
        consistent_start(System([Linkage(bodies, joints)]))


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Body("a", -1.0, 1.0), "mass = -1.0: must be finite and >= 0"),
        (lambda: Linkage((Body("a", 1, 1),), (Hinge("a", "a"),)), "joins a body to itself"),
        (lambda: Linkage((Body("rod", 1, 1),), (Hinge("rod", "grund"),)), "did you mean 'ground'"),
        (lambda: Linkage((Body("a", 1, 1), Body("a", 1, 1))), "used twice"),
        (lambda: Prescribed("a", "z", constant(0.0)), "must be one of angle, rate, x, y"),
        (lambda: integrate(pendulum(), [0.0, 1.0], tolerance=1.0), "tolerance = 1.0: must be from 1e-13 to 0.1"),
        (lambda: integrate(pendulum(), [0.0, 0.0]), "must rise"),
        (lambda: integrate(pendulum(), [0.0, 1.0], method="euler"), "must be one of auto"),
    ],
)
def test_bad_input_says_what_and_how(make, text):
    with pytest.raises(InputError, match=text):
        make()


def test_a_run_that_cannot_go_on_is_an_exception_that_holds_what_it_has():
    options = {"tolerance": 1e-9, "most_steps": 5}
    with pytest.raises(IntegrationError, match=r"ended at .* s of 5 s: the largest number of steps") as raised:
        integrate(chain(2), np.linspace(0, 5, 51), **options)
    made = integrate(chain(2), np.linspace(0, 5, 51), raise_on_failure=False, **options)
    np.testing.assert_array_equal(raised.value.result.q, made.q)
    assert made.status is Status.MOST_STEPS
    assert 0.0 < made.reached < 5.0
    assert len(made.time) == len(made.q) < 51


@pytest.mark.parametrize(
    "make",
    [
        lambda: Linkage((Body("a", 1.0, 0.1),), (Slot("a", "ground", direction=(0, 0)),)),
        lambda: Linkage((Body("a", 1.0, 0.1),), (), (CoordinateSpring("a", "x", stiffness=float("nan")),)),
        lambda: Linkage((Body("a", 1.0, 0.1),), (), (Moment("a", sin),)),  # type: ignore[arg-type]
        lambda: System([]),
    ],
)
def test_what_cannot_be_a_mechanism(make):
    with pytest.raises(InputError):
        make()


def test_a_number_is_a_constant_moment():
    """Angle M t^2 / (2 I)."""
    made = run(Linkage((Body("a", 1.0, 0.1),), (), (Moment("a", 0.5),)), [0.0, 1.0])  # type: ignore[arg-type]
    assert made.q[-1, 2] == pytest.approx(2.5, abs=1e-12)


def test_arguments_in_another_order_are_told():
    """Moment(body, function, reaction): a function where a body's name belongs is named, with the order."""
    with pytest.raises(InputError, match=r"no name of a body; its arguments are body, function, reaction"):
        Linkage((Body("a", 1.0, 0.1),), (), (Moment("a", "ground", constant(1.0)),))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"3.0 is no name of a body; its arguments are a, b, point_a"):
        Linkage((Body("a", 1.0, 0.1),), (Hinge("a", 3.0),))  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [{"free_length": 1.0}, {"damping": 2.0}])
def test_a_spring_between_coincident_points_is_named(given):
    """Its force has no direction: said so, instead of a division by zero somewhere below."""
    springs = (Spring("ground", "m", point_a=(1.0, 0.0), stiffness=5.0), Spring("ground", "m", name="rope", **given))
    linkage = Linkage((Body("m", 2.0, 0.1),), (), springs)
    with pytest.raises(InputError, match=r"spring 'rope': joins two points that coincide.*neither a free length"):
        integrate(System((linkage,)), [0.0, 1.0])


@pytest.mark.parametrize("method", ["taylor", "implicit"])
@pytest.mark.parametrize("start", [(0.0, 0.0), (0.3, 0.0)])
def test_a_spring_without_free_length_passes_through_zero(method, start):
    """The force is k times the span: q = q0 cos wt + v0/w sin wt, also from and through coinciding points."""
    body = Body("m", 2.0, 0.1, position=start, velocity=(0.5, 0.0))
    linkage = Linkage((body,), (), (Spring("ground", "m", stiffness=18.0),))
    times = np.linspace(0.0, 5.0, 41)
    made = integrate(System((linkage,)), times, method=method, tolerance=1e-9)
    assert made.status == 0
    exact = start[0] * np.cos(3.0 * times) + 0.5 / 3.0 * np.sin(3.0 * times)
    np.testing.assert_allclose(made.q[:, 0], exact, atol=1e-7)
    np.testing.assert_allclose(made.q[:, 1:], 0.0, atol=1e-12)


def test_a_prescribed_motion_holds_between_the_steps_of_the_implicit_method():
    """Where nothing is free the error of the free motion is zero; the curve between the steps must hold."""
    turning = Prescribed("rod", "angle", polynomial((0.0, 30.0)))
    rod = Body("rod", 1.0, 0.1, (0.5, 0.0))
    system = System([Linkage((rod,), (Hinge("rod", "ground"), turning))])
    times = np.linspace(0.0, 1.0, 201)
    made = integrate(system, times, method="implicit", tolerance=1e-6)
    circle = 0.5 * np.stack([np.cos(30.0 * times), np.sin(30.0 * times)], axis=1)
    np.testing.assert_allclose(made.q[:, :2], circle, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("links", [1, 2])
def test_energy_over_a_thousand_periods(links):
    """A rod and a double pendulum swing 2,000 s without damping (a period is 1.6 to 2 s): the drift is below 1e-8."""
    bodies = [Body("a", 1.0, 1 / 12, (0.5, 0.0), rate=1.0), Body("b", 1.0, 1 / 12, (0.5, 0.0), (1.0, 0.0))][:links]
    joints = [Hinge("a", "ground"), Hinge("a", "b", (1.0, 0.0), (0.0, 0.0))][:links]
    system = System([Linkage(tuple(bodies), tuple(joints), (Gravity(),))])
    run = integrate(system, np.linspace(0.0, 2000.0, 201), tolerance=1e-12, method="taylor")
    kinetic, potential = system.energy(run.q, run.v)
    total = kinetic + potential
    assert np.abs(total - total[0]).max() < 1e-8 * kinetic.max()
