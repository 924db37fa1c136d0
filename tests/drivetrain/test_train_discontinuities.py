"""The series of a train's forces: the same law at many times, order by order, and the kinks between its cells."""

import math

import numpy as np
import pytest

from gearfe.drivetrain.train import build_train, simulate
from gearfe.drivetrain.train.discontinuities import leaves, train_discontinuity
from gearfe.drivetrain.train.forces import CurveFlank, Gyro, LawFlank, TrainForces
from gearfe.drivetrain.train.series import train_order
from gearfe.gears.gearmesh.periodic import periodic_interpolant
from gearfe.multibody import TimeFunction, constant, smoothed_step
from gearfe.multibody.compiled import kernels as compiled
from gearfe.multibody.integrators.taylor import kernel_modal
from tests.makers.mesh_laws import hertzian_law
from tests.makers.rigid_cases import by_scipy
from tests.makers.trains import SHIPPED, curve, series_at_start, train

SPEED = 600.0
NODES = np.array([0.0, 0.1, 0.25, 0.4, 0.5])


def flank(sense=1.0, method="linear", direction=0, spin=1, parts=False, gap=0.0):
    """A flank whose curve has nodes at 0, 0.1, 0.25, 0.4, 0.5 rad and the period 0.6 rad."""
    values = np.array([1e8, 1.1e8, 0.9e8, 1e8, 1.05e8])
    shape = periodic_interpolant(NODES, values, 0.6, widest_gap=0.3, method=method)
    return CurveFlank(direction, spin, 1.0, sense, 0.0, 1e8, gap, shape, parts)


@pytest.mark.parametrize("kind", ["linear", "cubic", "law"])
@pytest.mark.parametrize("s", [4e-6, -4e-6])
def test_the_series_sums_up_to_the_law(kind, s):
    """Meshes, gyroscopic moments, torques of both kinds along a motion that is a polynomial of time."""
    speed = constant(SPEED) + TimeFunction(sines=((20.0, 4e4, 0.3),))
    torque = smoothed_step(0.5e-3, 1e-3, -100.0) + TimeFunction(sines=((7.0, 3e4, 1.0),))
    if kind == "law":
        law = hertzian_law(0.3)
        flanks = (
            LawFlank(3, 2, 1.0, 1.0, 0.006, 1e8, 0.0, law, 0.2, mean_damping=500.0),
            LawFlank(4, 5, 1.0, -1.0, 0.0585, 0.0, -2e-6, law, 0.0),
        )
    else:
        flanks = (flank(1.0, kind, 3, 2), flank(-1.0, kind, 4, 2, parts=True, gap=-2e-6))
    angle = speed.integral(0.0, 0.0)
    forces = TrainForces(6, angle, (Gyro(0, 2, 1.5, 2e-4),), flanks, ((5, torque),))
    random, t, most = np.random.default_rng(4), 0.21e-3, 30
    u = np.zeros((6, most + 1))
    u[:, :5] = random.normal(size=(6, 5)) * [1e-6, 2e-7, 1e-7, 1e-7, 1e-7]
    u[3:5, 0] = 3.1e-5, 2.0e-5  # no pair leaves its cell of the force
    parameters, memory, pieces = series_at_start(forces, t, math.copysign(1.0, s), u, s)
    out, orders = np.zeros(6), np.zeros((most, 6))
    for j in range(most):
        train_order(j, t, s, u, parameters, memory, pieces, out)
        orders[j] = out
    powers = np.arange(most + 1)
    for x in (0.0, 0.3, 0.9):
        now, rate = u @ x**powers, (u[:, 1:] * powers[1:]) @ x ** powers[:-1] / s
        true = forces(np.array([t + s * x]), now[None], rate[None])[0]
        assert x ** powers[:-1] @ orders == pytest.approx(true, rel=1e-11, abs=1e-11 * np.abs(true).max())


@pytest.mark.parametrize(
    ("t", "spin", "sense", "sign", "way"),
    [
        (1e-4, 0.0, 1.0, 1.0, 0.1 - 0.06),  # ahead of the node at 0.1
        (1e-4, 0.02, 1.0, 1.0, 0.1 - 0.08),  # the shaft's own rotation counts
        (1e-4, 0.0, 1.0, -1.0, 0.06),  # backwards in time: the node at 0
        (1e-4, 0.0, -1.0, 1.0, 0.54 - 0.5),  # the other sense: -0.06 is 0.54, down to 0.5
        (0.1 / 600, 0.0, 1.0, 1.0, 0.15),  # at a node
        (0.1 / 600, 0.0, 1.0, -1.0, 0.1),  # at a node, backwards
        (1.0009, 0.0, 1.0, 1.0, 0.6 - 0.54),  # many turns later: 600.54 rad, to the end of the period
    ],
)
def test_the_way_to_the_next_discontinuity(t, spin, sense, sign, way):
    forces = TrainForces(2, constant(SPEED).integral(0.0, 0.0), (), (flank(sense),), ())
    s = sign * 0.3 / SPEED
    u, out = np.zeros((2, 11)), np.zeros(2)
    u[1, 0] = spin
    parameters, memory, pieces = series_at_start(forces, t, sign, u, s)
    for j in range(10):
        train_order(j, t, s, u, parameters, memory, pieces, out)
    before = pieces.copy()
    told = 0.3 * train_discontinuity(1, 1.0, parameters, memory, pieces, True)
    assert way * (1 + 1e-9) < told < way + 1e-3
    assert train_discontinuity(9, 0.9 * way / 0.3, parameters, memory, pieces, False) == 2.0
    assert (pieces == before).all()
    assert train_discontinuity(9, 1.0, parameters, memory, pieces, False) * 0.3 == pytest.approx(way, rel=1e-9)
    assert 5 * (pieces[0] - before[0]) + pieces[1] - before[1] == sense * sign


@pytest.mark.parametrize("ends", [(0.4, 0.7), (0.51, 0.515)])
def test_a_flank_parts_where_its_approach_ends(ends):
    """u = 1e-6 (x - a) (x - b): it parts at a; a dip between two looks is seen, too."""
    forces = TrainForces(2, constant(1.0).integral(0.0, 0.0), (), (flank(1.0, "linear", 0, 1, True),), ())
    s, out, u = 1e-6, np.zeros(2), np.zeros((2, 11))
    u[0, :3] = 1e-6 * np.array([ends[0] * ends[1], -sum(ends), 1.0])
    parameters, memory, pieces = series_at_start(forces, 0.05, 1.0, u, s)
    for j in range(10):
        train_order(j, 0.05, s, u, parameters, memory, pieces, out)
    assert train_discontinuity(9, 1.0, parameters, memory, pieces, False) == pytest.approx(ends[0], rel=1e-9)
    assert pieces[2] == -1
    for j in range(10):  # open: no force but the mean stiffness's
        train_order(j, 0.05, s, u, parameters, memory, pieces, out)
        assert out[0] == pytest.approx(1e8 * u[0, j], rel=1e-12)


def test_a_constant_stiffness_has_no_discontinuity():
    forces = TrainForces(1, constant(SPEED), (), (), ())
    parameters, memory, pieces = series_at_start(forces, 0.0, 1.0, np.zeros((1, 11)), 1.0)
    assert train_discontinuity(9, 1.0, parameters, memory, pieces, False) == 2.0


def oscillators(tolerance):
    """Two free oscillators and a rigid mode by the plain kernel: (states, at 1/4 s ... 4 s)."""

    def order(j, t, s, u, parameters, memory, pieces, out):
        out[0] = 0.0

    def discontinuity(last, limit, parameters, memory, pieces, ahead):
        return 2.0

    names = {"np": np, "math": math, "LEAST": kernel_modal.LEAST}
    alias = {"order": "law_order", "discontinuity": "law_discontinuity"}
    kernels = compiled.bind((*kernel_modal.FUNCTIONS, order, discontinuity), names, alias=alias)
    eigenvalues, diagonal = np.array([0.0, 4.0, 900.0]), np.array([0.0, 0.0, 1.2])
    state, asked = np.array([0.1, 1.0, 1e-3, 0.5, 0.0, 1.0]), np.linspace(0.25, 4.0, 16)
    equations = kernel_modal.Equations(
        eigenvalues, np.diag(diagonal), diagonal, False, np.zeros(3), np.zeros((1, 3)), np.zeros(1), np.zeros(1),
        np.array([0.7]), tolerance, np.inf,
    )  # fmt: skip
    work = kernel_modal.work_space((np.zeros((1, 21)), np.zeros(1, dtype=np.int64)), state, 1)
    now, counts = np.array([0.0, 4.0, 0.1]), np.zeros(3, dtype=np.int64)
    out = kernel_modal.Output(now, counts, asked, np.zeros((16, 6)), np.zeros(999), np.zeros((999, 6)))
    status, (steps, passed, _) = kernels.modal_steps(equations, work, out), counts
    assert (status, passed) == (0, 16)
    assert 0.7 in out.ends[:steps]  # a step ends where a force may break
    return out.found, asked


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_free_response_of_modal_coordinates_in_closed_form(tolerance):
    found, t = oscillators(tolerance)
    decay, omega = 0.6, math.sqrt(900.0 - 0.36)
    fast = np.exp(-decay * t) * (1e-3 * np.cos(omega * t) + (1.0 + 1e-3 * decay) / omega * np.sin(omega * t))
    exact = np.stack([0.1 + 0.5 * t, np.cos(2 * t), fast, 0.5 + 0 * t, -2 * np.sin(2 * t)], axis=1)
    off = np.abs(found[:, :5] - exact).max(axis=0) / np.abs(exact).max(axis=0)
    assert off.max() < 5 * tolerance + 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_compiled_series_against_scipy(method):
    """Another formulation: steps of order 8 that know no kinks, short enough for them."""
    gear_train = train(SHIPPED, stiffness=lambda z: curve(z, swing=0.2, method=method, count=12))
    model, times = build_train(gear_train), np.linspace(0.0, 4e-3, 41)
    made = simulate(model, times, tolerance=1e-8)
    q, v = by_scipy(model.system, times, model.start, max_step=2e-7, rtol=1e-9, atol=1e-14)
    flanks = model.forces.of_flanks(times, q @ model.directions, v @ model.directions)
    truth = np.stack([flank.force for flank in flanks], axis=1)
    assert made.statistics["method"] == "taylor"
    assert np.abs(made.contact_force - truth).max() < 1e-7 * np.abs(truth).max()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_begins_a_slack_outside_and_comes_in_does_not_leave(sign):
    """Two pairs that part within a nanosecond: the gap of the one is still open by rounding where the other parts."""
    memory, bounds = np.array([[1.3e-15, -1.7e-5, -1.2e-5]]) * sign, (-1e300, 0.0) if sign > 0.0 else (0.0, 1e300)
    assert leaves(memory, 0, 2, *bounds, 1e-16, 7e-11) == 2.0
    assert leaves(memory, 0, 2, *bounds, 1e-16, 1.0) == 2.0
    memory[0, 2] *= -2.0  # comes back: 1.7e-5 x = 2.4e-5 x2
    assert leaves(memory, 0, 2, *bounds, 1e-16, 1.0) == pytest.approx(1.7 / 2.4, rel=1e-6)
