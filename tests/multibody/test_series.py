"""Taylor series of general systems: registers against their functions, motions against closed forms and angles."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gearfe.base.expressions import FUNCTIONS, compute, parse
from gearfe.mechanisms import load_mechanism
from gearfe.mechanisms.loads import CALLS, write_expression
from gearfe.mechanisms.quantities import quantity_names
from gearfe.multibody import (
    Body,
    Gravity,
    Hinge,
    Linkage,
    ModalBlocks,
    QuadraticJoint,
    Status,
    System,
    consistent_start,
    integrate,
)
from gearfe.multibody.integrators.taylor import run as route
from gearfe.multibody.series.tape import Tape
from tests.makers.files import mechanism_file
from tests.makers.job_texts import MOMENT, ROD
from tests.places import GEOMETRY

ORDER = 14


def test_every_function_of_expressions_can_be_written() -> None:
    assert {name for name, _ in FUNCTIONS} <= set(CALLS)


@pytest.mark.parametrize(
    "text",
    [
        "angle(a)*rate(a) - 2*angle(a) + 3", "(2 + angle(a))/(3 - rate(a))", "(1 + angle(a))**4", "(2 + angle(a))**-2",
        "(2 + angle(a))**1.5", "(2 + angle(a))**angle(a)", "sqrt(2 + angle(a))", "exp(angle(a))", "log(2 + angle(a))",
        "log10(2 + angle(a))",

        "sin(angle(a))", "cos(3*angle(a))", "tan(angle(a))", "asin(0.5*angle(a))", "acos(0.5*angle(a))",
        "atan(2*angle(a))", "atan2(angle(a), rate(a))", "atan2(angle(a), -2)", "hypot(angle(a), rate(a))",
        "tanh(3*angle(a))", "abs(angle(a) - 2)", "abs(angle(a))", "min(angle(a), 1)", "max(angle(a), 1)", "5",
        "max(min(angle(a), 3), -abs(rate(a)))",
    ],
)  # fmt: skip
def test_the_series_of_a_register_is_its_function(text: str) -> None:
    """At a distance h the sum of the series of f(a(t)) against f at a(t + h), for a(t) = 0.3 + 0.4 t - 0.2 t^2."""
    tape = Tape(1)
    leaf = {"angle": tape.linear({0: 1.0}), "rate": tape.rate({0: 1.0})}
    node = parse(text, "text", quantity_names())
    register = write_expression(node, tape, lambda name: leaf[name[0]])
    program = tape.program(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), np.ones(1))
    kernels = route.KERNELS.python
    Z, R = np.zeros((1, ORDER + 2)), np.zeros((len(program.code.op), ORDER + 1))
    Z[0, :3] = 0.3, 0.4, -0.2
    pieces, TF = np.zeros(len(program.switches.register), dtype=np.int64), np.zeros((1, ORDER + 1))
    for s, watched in enumerate(program.switches.register):
        kernels.tape_order(program, Z, R, TF, pieces, 0)
        pieces[s] = kernels.piece_at(program.switches, s, R[watched, 0])
    for k in range(ORDER + 1):
        kernels.tape_order(program, Z, R, TF, pieces, k)
    for h in (-0.05, 0.05):
        values = {("angle", "a"): 0.3 + 0.4 * h - 0.2 * h * h, ("rate", "a"): 0.4 - 0.4 * h}
        assert kernels.horner(R, register, ORDER, h) == pytest.approx(
            float(compute(node, values)), rel=1e-12, abs=1e-13
        )


def moved(folder: Path, load: str, times: list[float], tolerance: float = 1e-10, extra: str = ""):  # type: ignore[no-untyped-def]
    mechanism = load_mechanism(
        mechanism_file(folder, ROD.replace("angle_deg = 30.0", "angle_deg = 0.0") + MOMENT.format(load) + extra)
    )
    return integrate(mechanism.system, times, start=mechanism.start(), method="taylor", tolerance=tolerance)


def test_dry_friction_that_sets_in_unseen(tmp_path: Path) -> None:
    """I w' = -M tanh(w/w0): sinh(w/w0) falls as exp(-M t/(I w0)); tanh is 1 to the last digit for most of the way."""
    w0, friction, inertia = 0.01, 0.5, 0.5
    times = [0.0, 0.5, 0.95, 0.98, 1.0, 1.02]
    run = moved(tmp_path, f"-{friction}*tanh(rate(rod)/{w0})", times)
    t = np.array(times)
    # asinh(sinh(100) exp(-100 t)), without the large number
    exact = w0 * np.where(t < 0.9, 1.0 / w0 - t * friction / inertia / w0, np.arcsinh(0.5 * np.exp(100.0 - 100.0 * t)))
    np.testing.assert_allclose(run.v[:, 2], exact, atol=1e-8)


def test_a_stop_is_met_and_left_at_its_corner(tmp_path: Path) -> None:
    """Free to 0.4 rad, half a period of the spring, and back at the same speed."""
    k, inertia = 800.0, 0.5
    contact = math.pi * math.sqrt(inertia / k)
    end = 0.4 + contact + 0.3
    run = moved(tmp_path, f"-{k}*max(0, angle(rod) - 0.4)", [0.0, 0.4, 0.4 + contact / 2, end])
    np.testing.assert_allclose(run.q[:, 2], [0.0, 0.4, 0.4 + math.sqrt(inertia / k), 0.1], atol=1e-11)
    np.testing.assert_allclose(run.v[:, 2], [1.0, 1.0, 0.0, -1.0], atol=1e-10)
    assert run.statistics["steps"] < 20


def test_a_stop_that_takes_speed_at_once(tmp_path: Path) -> None:
    """A load that jumps: 0.5 I w^2 = M (a - 0.4) beyond 0.4 rad, and a free return."""
    run = moved(tmp_path, "-2*(1 + abs(angle(rod) - 0.4)/(angle(rod) - 0.4))", [0.0, 0.4, 0.4 + 1.0 / 8.0], 1e-9)
    np.testing.assert_allclose(run.v[:, 2], [1.0, 1.0, 0.0], atol=1e-9)


def test_pulses_of_a_sine(tmp_path: Path) -> None:
    """I w' = M max(0, sin(w t)): every half wave gives 2 M/w, between them nothing tells of the next."""
    run = moved(tmp_path, "3*max(0, sin(30*time))", [0.0, *(k * math.pi / 15 for k in range(1, 8))])
    np.testing.assert_allclose(run.v[:, 2], 1.0 + np.arange(8) * 2 * 3 / 30 / 0.5, atol=1e-9)


@pytest.mark.parametrize("kind", ["linear", "periodic"])
def test_tables_by_their_pieces(tmp_path: Path, kind: str) -> None:
    """Straight lines: exponentials on each; a periodic table of one's own waves: the run with its spline, finely."""
    x = np.linspace(0.0, 4.0, 5)
    y = np.array([5.0, 4.0, 2.0, 1.0, 0.5]) if kind == "linear" else np.array([0.0, 1.0, 0.0, -1.0, 0.0])
    (tmp_path / "motor.csv").write_text(
        "x,y\n" + "\n".join(f"{a},{b}" for a, b in zip(x, y, strict=True)), encoding="utf-8"
    )
    table = f'[tables.motor]\nfile = "motor.csv"\nx = "x"\ny = "y"\ninterpolation = "{kind}"\n'
    times = [0.0, 0.2, 0.5, 1.0]
    if kind == "periodic":
        run = moved(tmp_path, "40*motor(angle(rod))", [0.0, 2.0, 4.0, 8.0], extra=table)
        # the energy 0.5 I w^2 - 40 int motor is constant, and whole periods give nothing
        from scipy.interpolate import CubicSpline

        level = CubicSpline(x, y, bc_type="periodic").antiderivative()
        energy = 0.25 * run.v[:, 2] ** 2 - 40 * level(np.mod(run.q[:, 2], 4.0))
        np.testing.assert_allclose(energy, energy[0], atol=1e-8)
        assert np.ptp(run.q[:, 2]) > 1.0
        return
    run = moved(tmp_path, "motor(rate(rod))", times, extra=table)
    # I w' = y_k + s_k (w - x_k)
    w, t, exact = 1.0, 0.0, [1.0]
    for goal in times[1:]:
        while True:
            k = int(np.searchsorted(x, w + 1e-12, side="right")) - 1
            slope, value = (y[k + 1] - y[k]) / (x[k + 1] - x[k]) / 0.5, y[k] / 0.5
            steady = x[k] - value / slope
            there = math.log((x[k + 1] - steady) / (w - steady)) / slope if steady > x[k + 1] else math.inf
            if t + there < goal:
                t, w = t + there, float(x[k + 1])
                continue
            w, t = steady + (w - steady) * math.exp(slope * (goal - t)), goal
            break
        exact.append(w)
    np.testing.assert_allclose(run.v[:, 2], exact, atol=1e-9)


def test_a_load_without_series_at_the_start_goes_on_otherwise(tmp_path: Path) -> None:
    """Drag from rest has a root of zero: auto still runs, a named series says that it cannot."""
    text = ROD.replace("rate_rad_per_s = 1.0", "rate_rad_per_s = 0.0") + MOMENT.format(
        "1 - 0.5*hypot(rate(rod), 0)*rate(rod)"
    )
    mechanism = load_mechanism(mechanism_file(tmp_path, text))
    options = {"start": mechanism.start(), "tolerance": 1e-10, "raise_on_failure": False}
    run = integrate(mechanism.system, [0.0, 1.0], **options)
    # I w' = 1 - 0.5 w^2: w = sqrt(2) tanh(t sqrt(2))
    assert run.status == Status.DONE
    assert run.v[-1, 2] == pytest.approx(math.sqrt(2.0) * math.tanh(math.sqrt(2.0)), abs=1e-9)
    assert integrate(mechanism.system, [0.0, 1.0], method="taylor", **options).status == Status.STEP_TOO_SMALL


def pendulum_in_vectors(first: tuple[float, float]) -> System:
    """Two rods of 1 kg and 1 m as points with directions: place of the end and unit vector of each, under gravity."""
    rods, rows, products, constant = [], np.zeros((6, 8)), [], np.zeros(6)
    for angle in first:
        # x0 + s a: mass integrals 1, 1/2, 1/3
        M = np.kron(np.array([[1.0, 0.5], [0.5, 1.0 / 3.0]]), np.eye(2))
        q0 = np.array([0.0, 0.0, math.cos(angle), math.sin(angle)])
        rods.append(ModalBlocks(M, np.zeros((4, 4)), np.zeros((4, 4)), q0=q0))
    rods[1].q0[:2] = rods[0].q0[2:]
    rows[:2, :2] = np.eye(2)
    rows[2:4, :2] = rows[2:4, 2:4] = np.eye(2)
    rows[2:4, 4:6] = -np.eye(2)
    for k, at in ((4, 2), (5, 6)):
        products += [(k, at, at, 0.5), (k, at + 1, at + 1, 0.5)]
        constant[k] = -0.5
    return System([*rods, QuadraticJoint(tuple(rods), rows, products, constant), *(Weight((rod,)) for rod in rods)])


class Weight(QuadraticJoint):
    """Gravity on a rod in vectors: no rows, a constant force."""

    def __init__(self, touches) -> None:  # type: ignore[no-untyped-def]
        super().__init__(touches, np.zeros((0, 4)))

    pull = 9.81 * np.array([0.0, -1.0, 0.0, -0.5])

    def force(self, t, q, v):  # type: ignore[no-untyped-def]
        return self.pull

    def write(self, tape, places) -> bool:  # type: ignore[no-untyped-def]
        tape.constant[places] += self.pull
        return True


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_a_double_pendulum_in_vectors_moves_as_in_angles(method: str) -> None:
    first = (-0.4, 0.3)
    system = pendulum_in_vectors(first)
    times = np.linspace(0.0, 1.0, 6)
    run = integrate(system, times, start=consistent_start(system), method=method, tolerance=1e-11)
    at = (math.cos(first[0]), math.sin(first[0]))
    bodies = (Body("a", 1.0, 1 / 12, (0.5, 0.0), angle=first[0]), Body("b", 1.0, 1 / 12, (0.5, 0.0), at, first[1]))
    joints = (Hinge("a", "ground"), Hinge("b", "a", (0.0, 0.0), (1.0, 0.0)))
    other = integrate(System([Linkage(bodies, joints, (Gravity(),))]), times, method="taylor", tolerance=1e-12)
    for k, turned in ((2, other.q[:, 2]), (6, other.q[:, 5])):
        np.testing.assert_allclose(run.q[:, k : k + 2], np.column_stack([np.cos(turned), np.sin(turned)]), atol=1e-9)


def test_time_runs_back(tmp_path: Path) -> None:
    text = "-30*max(0, angle(rod) - 0.2) + 2*sin(9*time) - tanh(4*rate(rod))"
    there = moved(tmp_path, text, [0.0, 1.0], 1e-12)
    mechanism = load_mechanism(tmp_path / "mechanism.toml")
    start = consistent_start(mechanism.system, 1.0, q=there.q[-1], v=there.v[-1])
    back = integrate(mechanism.system, [1.0, 0.0], start=start, method="taylor", tolerance=1e-12)
    np.testing.assert_allclose(back.q[-1], there.q[0], atol=1e-9)
    np.testing.assert_allclose(back.v[-1], there.v[0], atol=1e-8)


def test_a_load_by_expression_passes_singular_positions(tmp_path: Path) -> None:
    """The folding crank with -0.1 w + 0.3 tanh(w) on it; with s = sin, (2/3 + 2 s^2) w' + 2 s c w^2 + g c = moment."""
    text = (GEOMETRY / "slider_crank.toml").read_text(encoding="utf-8")
    text += '[forces.drive]\ntype = "moment"\nbody = "crank"\n'
    text += 'moment_N_m = "-0.1*rate(crank) + 0.3*tanh(rate(crank))"\n'
    mechanism = load_mechanism(mechanism_file(tmp_path, text))
    start, times = mechanism.start(), np.linspace(0.0, 4.0, 41)

    def slope(_t: float, y: np.ndarray) -> list[float]:
        s, c, w = math.sin(y[0]), math.cos(y[0]), y[1]
        moment = -0.1 * w + 0.3 * math.tanh(w)
        return [w, (moment - 2.0 * s * c * w * w - 9.81 * c) / (2.0 / 3.0 + 2.0 * s * s)]

    exact = solve_ivp(slope, (0.0, 4.0), [start.q[2], start.v[2]], "DOP853", times, rtol=3e-14, atol=1e-14).y[0]
    run = integrate(mechanism.system, times, start=start, method="taylor", tolerance=1e-10)
    assert len(run.statistics["change_points"]) >= 3
    assert np.abs(run.q[:, 2] - exact).max() <= 1e-8
    assert np.abs(run.q[:, 2] + run.q[:, 5]).max() <= 1e-9
