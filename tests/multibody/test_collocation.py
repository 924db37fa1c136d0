"""Collocation: coefficients, and the kernels' loops against NumPy on the same step."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from gearfe.base.config import build
from gearfe.base.tables.mechanism import MechanismFile
from gearfe.mechanisms.model import make_mechanism
from gearfe.mechanisms.tables import ValueTable
from gearfe.multibody import (
    Body,
    Gravity,
    Hinge,
    Linkage,
    Prescribed,
    QuadraticJoint,
    Spring,
    System,
    consistent_start,
    smoothed_step,
)
from gearfe.multibody.compiled.simd import simd_copy, simd_zeros
from gearfe.multibody.core.start import Start
from gearfe.multibody.core.steps import Status, StepControl, StepLaw
from gearfe.multibody.integrators.collocation.numpy_equations import saddle_solver
from gearfe.multibody.integrators.collocation.run import KERNELS, Stepper, equations, narrow_band
from gearfe.multibody.integrators.collocation.scheme import GAUSS, RADAU, path_matrix, scheme
from gearfe.multibody.planar.beam import Beam
from gearfe.multibody.planar.beam_link import BeamLink, Section
from gearfe.multibody.planar.couplings import Cam
from gearfe.multibody.planar.floating import Floating, FloatingBody, frame_joint
from gearfe.multibody.planar.turning import TurningFrame
from gearfe.multibody.series.ordering import narrow_order


@pytest.mark.parametrize(("family", "order"), [(RADAU, 9), (GAUSS, 10)])
def test_coefficients_integrate_polynomials(family: str, order: int) -> None:
    """Five stages: t^k at the end up to the order; at the stages up to s (Hairer & Wanner II, Sec. IV.5)."""
    tab = scheme(family, 5)
    A = np.linalg.inv(tab.inverse)
    b = tab.ends[0] @ A
    for k in range(order):
        assert b @ tab.c**k == pytest.approx(1.0 / (k + 1), abs=1e-13)
    assert abs(b @ tab.c**order - 1.0 / (order + 1)) > 1e-7
    for k in range(5):
        np.testing.assert_allclose(A @ tab.c**k, tab.c ** (k + 1) / (k + 1), atol=1e-13)
    mu = tab.values @ [1.0, 1j]
    for k in range(2):
        y = tab.back[2 * k + 1] + 1j * tab.back[2 * k + 2]
        np.testing.assert_allclose(y @ tab.inverse, mu[k + 1] * y, atol=1e-10)


def test_paths_go_through_what_they_are_given() -> None:
    """A polynomial of degree 7, also by its second derivatives at both ends."""
    made = np.polynomial.Polynomial(np.arange(1.0, 9.0))
    c = scheme(RADAU, 3).c[:2]
    known = [
        made(0.0),
        made.deriv()(0.0),
        *made(c),
        made(1.0),
        made.deriv()(1.0),
        made.deriv(2)(0.0),
        made.deriv(2)(1.0),
    ]
    np.testing.assert_allclose(path_matrix(c, accelerations=True) @ known, made.coef, atol=1e-9)


def test_a_narrow_order_of_a_shuffled_chain() -> None:
    """Next to each other again: the band of a chain is 1."""
    shuffled = np.random.default_rng(3).permutation(40)
    graph = np.zeros((40, 40), dtype=bool)
    for i, j in itertools.pairwise(shuffled):
        graph[i, j] = graph[j, i] = True
    order = narrow_order(graph)
    place = np.argsort(order)
    assert sorted(order) == list(range(40))
    assert all(abs(place[i] - place[j]) == 1 for i, j in np.argwhere(graph))


@pytest.mark.parametrize("seed", range(6))
def test_saddle_matrices_side_by_side(seed: int) -> None:
    """Four complex matrices of one band, some of whose diagonals are none, against dense solutions."""
    rng = np.random.default_rng(seed)
    size, width = 24, 4
    near = np.abs(np.subtract.outer(np.arange(size), np.arange(size))) <= width
    A = near * (rng.standard_normal((4, size, size)) + 1j * rng.standard_normal((4, size, size)))
    without = rng.permutation(size)[:6]
    A[:, without[:, None], without] = 0.0
    b = rng.standard_normal((4, size)) + 1j * rng.standard_normal((4, size))
    B = simd_copy(np.stack([A.real, A.imag]).transpose(3, 2, 0, 1))
    x = simd_copy(np.stack([b.real, b.imag]).transpose(2, 0, 1))
    places = np.arange(size)
    over, right = simd_zeros(size, 2, 4), np.minimum(places + width, size - 1)
    pivot, low, top = np.zeros((3, size), dtype=np.int64)
    names = KERNELS.python
    assert names.factorise_band(B, over, right.copy(), pivot, low, top, right.copy())
    names.solve_band(B, over, pivot, low, top, x)
    found = x[:, 0] + 1j * x[:, 1]
    for k in range(4):
        np.testing.assert_allclose(A[k] @ found[:, k], b[k], atol=1e-10 * np.abs(found).max())
    B[...] = 0.0
    assert not names.factorise_band(B, over, right.copy(), pivot, low, top, right.copy())


def bent_rod() -> System:
    """A damped beam, hinged and driven, in a turning frame, with a spring to a body that slides on a quadratic row."""
    link = BeamLink("rod", 1.0, Section.rectangle(0.05, 0.05), 1e9, 1000.0, elements=2, damping=1e-3)
    bob = Body("bob", 2.0, 0.3, (0.1, 0.0), position=(1.2, 0.5), rate=0.4)
    joints = (Hinge("rod", "ground"), Prescribed("rod", "rate", smoothed_step(0.1, 0.2, 2.0)))
    spring = Spring(link.node_names[-1], "bob", point_b=(0.0, 0.1), stiffness=300.0, damping=2.0, free_length=0.3)
    linkage = Linkage((*link.nodes(), bob), joints, (Gravity(), spring, TurningFrame(0.7)))
    k = linkage.size
    linear = np.zeros((1, k + 2))
    linear[0, k - 3] = 1.0  # x cos(theta) + x = constant
    row = QuadraticJoint((linkage,), linear, ((0, k - 3, k, 1.0),), np.array([-2.4]), angles=(k - 1,))
    return System([linkage, Beam(linkage, link), row])


def floating_bar() -> System:
    """A body in a floating frame with two modes, hinged at its first interface, a rigid one fixed to its second."""
    rng = np.random.default_rng(5)
    N = rng.standard_normal((6, 4)) + 1j * rng.standard_normal((6, 4))
    quadratic = rng.standard_normal((3, 2, 2))
    body = FloatingBody(
        N.conj().T @ N + 4.0 * np.eye(4), 40.0 * rng.standard_normal((3, 2)), quadratic + quadratic.transpose(0, 2, 1),
        np.array([0.0, 1.0 + 0.0j]), np.array([[0.0, 0.0], [0.1 + 0.02j, 0.3j]]), np.array([[0.0, 0.0], [0.1j, 0.4j]]),
        1e-3, 1.0,
    )  # fmt: skip
    ends = (Body("first", 0.0, 0.0), Body("last", 1.0, 0.2, position=(1.0, 0.0)))
    linkage = Linkage(ends, (Hinge("first", "ground"),), (Gravity(), TurningFrame(0.5)))
    element = Floating(body, linkage, "bar", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return System([element, linkage, frame_joint(element, linkage, ("first", "last"))])


def expression_load() -> System:
    """A double pendulum whose motor brakes, with a stop by max()."""
    raw: dict[str, Any] = {
        "run": {"end_s": 1.0, "step_s": 0.1},
        "bodies": {
            name: {
                "mass_kg": 1.0, "inertia_kg_m2": 0.2, "centre_m": [0.5, 0.0], "position_m": [x, 0.0],
                "points_m": {"tip": [1.0, 0.0]}, "rate_rad_per_s": 0.5,
            }
            for name, x in (("one", 0.0), ("two", 1.0))
        },
        "joints": {
            "O": {"type": "hinge", "body": "one"},
            "P": {"type": "hinge", "body": "two", "to": "one", "to_point": "tip"},
        },
        "forces": {
            "weight": {"type": "gravity", "acceleration_m_per_s2": [0.0, -9.81]},
            "motor": {
                "type": "moment", "body": "two",
                "moment_N_m": "3*sin(angle(one)) - rate(two)*vx(two.tip) + max(0, 2 - y(two.tip)*time)",
            },
        },
    }  # fmt: skip
    return make_mechanism(build(MechanismFile, raw, "")).system


def cam() -> System:
    """A pendulum whose angle is a table of another one's, under a spring."""
    x = np.linspace(0.0, 2 * np.pi, 9)
    profile = ValueTable(x, 0.4 * np.cos(x) + 0.1 * np.sin(2 * x), "periodic")
    bodies = (Body("cam", 1.0, 0.2, centre=(0.1, 0.0), rate=-3.0), Body("arm", 1.0, 0.2, centre=(0.5, 0.0)))
    joints = (Hinge("cam", "ground"), Hinge("arm", "ground"), Cam("arm", "cam", "angle", profile))
    forces = (Gravity((0.0, -9.81)), Spring("arm", "ground", (1.0, 0.0), (1.0, 1.0), 50.0))
    return System([Linkage(bodies, joints, forces)])


@pytest.mark.parametrize("family", [RADAU, GAUSS])
@pytest.mark.parametrize("make", [bent_rod, floating_bar, expression_load, cam])
def test_kernels_step_as_numpy_does(make: Any, family: str) -> None:
    """Three steps of three stages: states, multipliers, stresses, errors; the loops run uncompiled here."""
    system = make()
    start: Start = consistent_start(system, 0.02)
    tab = scheme(family, 3)
    one, two = Stepper(system, start, tab), Stepper(system, start, tab)
    program = system.program
    assert program is not None
    held = program.without_redundant(start.active)
    eq = equations(held, narrow_band(held), 3, len(one.w.S))
    two._step = lambda: KERNELS.python.collocation_step(eq, two.w, tab)
    q, v, limit = start.q, start.v, np.full(system.size, 1e-9)
    for step in (one, two):
        step.restart(system, start, 0.02, q, v)
    for k in range(3):
        counts = [step(0.02 + 0.002 * k, 0.002, q, v, limit) for step in (one, two)]
        assert counts[0] == counts[1] > 0
        for name in ("qn", "vn", "Z", "V", "S", "L", "known"):
            mine, other = getattr(one.w, name), getattr(two.w, name)
            size = np.abs(mine).max(initial=0.0)
            np.testing.assert_allclose(other, mine, rtol=1e-7, atol=1e-8 * size, err_msg=name)
        assert two.w.measures[0] == pytest.approx(one.w.measures[0], rel=1e-3)
        for step in (one, two):
            step.keep(0.002)
        q, v = one.w.qn.copy(), one.w.vn.copy()


def test_a_run_that_comes_within_rounding_of_its_end_is_done() -> None:
    """Ten steps of 0.1 from 0 add up to 0.9999999999999999: the last one is stretched to the end."""
    control = StepControl(StepLaw(0.25, 1.0, 1e-8), (0.0, 1.0), 0.1, breaks=np.zeros(0), longest=0.1)
    for _ in range(10):
        assert control.next_step() is not None
        control.accept(0.0)
    assert control.t == 1.0
    assert control.next_step() is None
    assert control.status is Status.DONE


@pytest.mark.parametrize("size", [4, 200])
def test_a_singular_matrix_of_a_step_has_no_solver(size: int) -> None:
    """Dense or sparse; with one row x_1 = 1 in place of two alike, x = f elsewhere and lambda = f - 1."""
    rows = np.zeros((2, size))
    rows[:, 0] = 1.0
    assert saddle_solver(np.eye(size), rows, np.ones(size), np.ones(2)) is None
    made = saddle_solver(np.eye(size), rows[:1], np.ones(size), np.ones(1))
    assert made is not None
    x, multiplier = made(np.full(size, 3.0), np.ones(1))
    np.testing.assert_allclose(x, [1.0, *[3.0] * (size - 1)], atol=1e-14)
    assert multiplier == pytest.approx(3.0 - 1.0, rel=1e-14)
