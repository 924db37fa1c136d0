"""Springs by any law, one-sided stops and cables, dry friction, bushings: against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import gamma

from gearfe.base.errors import InputError
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.multibody import IntegrationError, integrate
from gearfe.multibody.core.equilibrium import equilibrium
from tests.makers.files import mechanism_file

#: A block of 2 kg on a guide along x; the wall is at 0.
BLOCK = """
[run]
end_s = 1.0
step_s = 0.01
[bodies.block]
mass_kg = 2.0
inertia_kg_m2 = 0.5
position_m = [{x}, 0.0]
velocity_m_per_s = [{v}, 0.0]
[joints.guide]
type = "prismatic"
body = "block"
direction = [1.0, 0.0]
[forces.law]
type = "spring"
body = "block"
tension_N = "{law}"
"""


def ran(folder: Path, text: str, times: np.ndarray, **options):  # type: ignore[no-untyped-def]
    mechanism = load_mechanism(mechanism_file(folder, text))
    return mechanism, integrate(mechanism.system, times, start=mechanism.start(), **options)


PENDULUM = """
[run]
end_s = 1.0
step_s = 0.01
[bodies.rod]
mass_kg = 2.0
inertia_kg_m2 = 0.5
points_m = { tip = [0.7, 0.2] }
rate_rad_per_s = 1.0
[bodies.bob]
mass_kg = 1.0
inertia_kg_m2 = 0.1
position_m = [1.5, 0.4]
velocity_m_per_s = [0.2, -1.0]
[joints.O]
type = "hinge"
body = "rod"
[forces.s]
type = "spring"
body = "rod"
point = "tip"
to = "bob"
to_point = [0.1, 0.1]
"""


@pytest.mark.parametrize(("method", "tolerance", "allowed"), [("taylor", 1e-10, 1e-8), ("implicit", 1e-8, 1e-6)])
def test_a_linear_law_is_the_spring(tmp_path: Path, method: str, tolerance: float, allowed: float) -> None:
    times = np.linspace(0.0, 1.0, 11)
    spring = PENDULUM + "stiffness_N_per_m = 30.0\ndamping_N_s_per_m = 2.0\nfree_length_m = 0.5\n"
    law = PENDULUM + 'tension_N = "30*(length - 0.5) + 2*length_rate"\n'
    one, other = (
        ran(tmp_path, spring, times, tolerance=1e-11),
        ran(tmp_path, law, times, method=method, tolerance=tolerance),
    )
    np.testing.assert_allclose(other[1].q, one[1].q, atol=allowed)
    work = [evaluate(*pair).energy for pair in (one, other)]
    assert np.ptp(work[1]["total_J"]) < 1e-5
    rng = np.random.default_rng(1)
    q, v = rng.standard_normal((2, 6))
    for a, b in zip(*(made[0].system.force_jacobian(0.0, q, v) for made in (one, other)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_slopes_of_a_law_are_those_of_its_force(tmp_path: Path) -> None:
    mechanism = load_mechanism(
        mechanism_file(
            tmp_path,
            PENDULUM + 'tension_N = "5*length**3 - exp(-length)*length_rate**2 + time"\nstiffness_N_per_m = 3.0\n',
        )
    )
    rng = np.random.default_rng(2)
    q, v = rng.standard_normal((2, 6))
    made = mechanism.system.force_jacobian(0.3, q, v)
    for j in range(6):
        step = np.zeros(6)
        step[j] = 1e-6
        by_q = (mechanism.system.force(0.3, q + step, v) - mechanism.system.force(0.3, q - step, v)) / 2e-6
        by_v = (mechanism.system.force(0.3, q, v + step) - mechanism.system.force(0.3, q, v - step)) / 2e-6
        np.testing.assert_allclose(made[0][:, j], by_q, atol=1e-5)
        np.testing.assert_allclose(made[1][:, j], by_v, atol=1e-6)


def test_a_cubic_spring_swings_with_the_period_of_the_lemniscate(tmp_path: Path) -> None:
    """m u'' = -k u^3 from rest at A: T = sqrt(m/k) / A gamma(1/4)^2 / sqrt(pi)."""
    period = math.sqrt(2.0 / 900.0) / 0.3 * gamma(0.25) ** 2 / math.sqrt(math.pi)
    times = np.array([0.0, period / 4, period / 2, 5 * period])
    text = BLOCK.format(x=2.3, v=0.0, law="900*(length - 2)**3")
    _, run = ran(tmp_path, text, times, tolerance=1e-11)
    np.testing.assert_allclose(run.q[:, 0], [2.3, 2.0, 1.7, 2.3], atol=1e-8)


def test_a_one_sided_stop_gives_back_what_its_damping_leaves(tmp_path: Path) -> None:
    """Hits at 1 m/s; leaves when the stop's spring is free again, with exp(-pi D/sqrt(1 - D^2)) of the speed."""
    k, damping = 2e4, 0.2
    c = 2 * damping * math.sqrt(k * 2.0)
    law = f"-{k}*max(0, 0.5 - length) + {c}*length_rate*min(1, max(0, 1e12*(0.5 - length)))"
    _, run = ran(
        tmp_path, BLOCK.format(x=0.6, v=-1.0, law=law), np.linspace(0.0, 0.3, 31), tolerance=1e-9, method="implicit"
    )
    contact = math.pi / (math.sqrt(k / 2.0) * math.sqrt(1 - damping**2))
    left = math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
    assert run.v[-1, 0] == pytest.approx(left, rel=1e-6)
    assert run.q[-1, 0] == pytest.approx(0.5 + left * (0.3 - 0.1 - contact), rel=1e-6)


def test_a_cable_that_goes_slack(tmp_path: Path) -> None:
    """A bob thrown up from the taut length falls back after 2 v/g; then the cable is a spring about m g/k below."""
    text = BLOCK.format(x=1.0, v=0.0, law="max(0, 400*(length - 1))").replace("[1.0, 0.0]", "[0.0, -1.0]", 1)
    text = text.replace("[1.0, 0.0]", "[0.0, 1.0]").replace("[0.0, 0.0]", "[0.0, 3.0]")
    text += '[forces.gravity]\ntype = "gravity"\nacceleration_m_per_s2 = [0.0, -9.81]\n'
    w = math.sqrt(400.0 / 2.0)
    flight = 6.0 / 9.81
    # back at the taut length with -3 m/s: y = -1 - g/w^2 + g/w^2 cos(w t) - 3/w sin(w t)
    later = np.linspace(0.0, 0.1, 5)
    fall = -1.0 - 9.81 / w**2 * (1 - np.cos(w * later)) - 3.0 / w * np.sin(w * later)
    _, run = ran(tmp_path, text, np.concatenate([[0.0, flight / 2], flight + later]), tolerance=1e-10)
    assert run.q[1, 1] == pytest.approx(-1.0 + 4.5 / 9.81, abs=1e-8)
    np.testing.assert_allclose(run.q[2:, 1], fall, atol=1e-7)


def test_dry_friction_in_a_joint_stops_a_rotor(tmp_path: Path) -> None:
    """-M tanh(w/w0): M t = I (w_0 - w) while w >> w0; ln sinh(w/w0) falls by M t/(I w0) exactly."""
    text = PENDULUM.split("[bodies.bob]", maxsplit=1)[0] + (
        '[joints.O]\ntype = "hinge"\nbody = "rod"\n'
        '[forces.friction]\ntype = "moment"\nbody = "rod"\nmoment_N_m = "-2.0*tanh(rate(O)/0.05)"\n'
    )
    times = np.array([0.0, 0.1, 0.2, 0.3])
    _, run = ran(tmp_path, text, times, tolerance=1e-10)
    inertia = 0.5
    exact = 0.05 * np.arcsinh(np.sinh(1.0 / 0.05) * np.exp(-2.0 * times / (inertia * 0.05)))
    np.testing.assert_allclose(run.v[:, 2], exact, atol=1e-8)


def test_a_bushing_is_two_springs(tmp_path: Path) -> None:
    """Between points that coincide: k dx, k dy, k_t da; static deflections F/k and M/k_t."""
    text = """
[run]
end_s = 1.0
step_s = 0.1
[bodies.arm]
mass_kg = 2.0
inertia_kg_m2 = 0.5
[forces.bushing]
type = "spring"
body = "arm"
stiffness_N_per_m = 400.0
[forces.twist]
type = "coordinate_spring"
body = "arm"
coordinate = "angle"
stiffness_Nm_per_rad = 30.0
[forces.load]
type = "force"
body = "arm"
x_N = 4.0
y_N = -8.0
[forces.moment]
type = "moment"
body = "arm"
moment_N_m = 3.0
"""
    mechanism = load_mechanism(mechanism_file(tmp_path, text))
    found = equilibrium(mechanism.system, mechanism.start())
    np.testing.assert_allclose(found.q, [0.01, -0.02, 0.1], rtol=1e-10)


def test_equilibrium_of_a_law_is_least_energy(tmp_path: Path) -> None:
    text = BLOCK.format(x=2.1, v=0.0, law="900*(length - 2)**3").replace("[1.0, 0.0]", "[0.0, 1.0]")
    text = text.replace("[2.1, 0.0]", "[0.0, -2.1]")
    text += '[forces.gravity]\ntype = "gravity"\nacceleration_m_per_s2 = [0.0, -9.81]\n'
    mechanism = load_mechanism(mechanism_file(tmp_path, text))
    found = equilibrium(mechanism.system, mechanism.start())
    assert found.q[1] == pytest.approx(-2.0 - (2.0 * 9.81 / 900.0) ** (1 / 3), rel=1e-10)


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ("angle(block)", "uses angle; a tension may depend on"),
        ("2*distance", "distance"),
        ("kinetic", "kinetic"),
        ("1/(length - 0.5)", "no value at the start"),
    ],
)
def test_wrong_laws(tmp_path: Path, law: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        load_mechanism(mechanism_file(tmp_path, BLOCK.format(x=0.5, v=0.0, law=law))).start()


def test_a_law_without_a_value_on_the_way_tells_where(tmp_path: Path) -> None:
    with pytest.raises(IntegrationError, match=r"tension_N = .* at 0\.2"):
        ran(tmp_path, BLOCK.format(x=0.7, v=-1.0, law="0*sqrt(length - 0.5)"), np.array([0.0, 1.0]))


def test_a_law_needs_points_apart(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="coincide"):
        load_mechanism(mechanism_file(tmp_path, BLOCK.format(x=0.0, v=0.0, law="length"))).start()
