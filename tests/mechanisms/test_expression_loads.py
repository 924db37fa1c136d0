"""Loads by expression and table: against closed forms and the forces that they repeat; slopes; what wrong ones get."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.base.tables.kinds import UNIT_OF
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.mechanisms.error_estimate import finer_run
from gearfe.mechanisms.job import run_mechanism
from gearfe.mechanisms.loads import ExpressionLoad
from gearfe.multibody import IntegrationError, Status, integrate
from gearfe.multibody.core.inverse import prescribed_motion
from tests.makers.files import mechanism_file
from tests.makers.job_texts import MOMENT, ROD
from tests.places import GEOMETRY


def ran(folder: Path, text: str, end: float = 1.0, **options):  # type: ignore[no-untyped-def]
    mechanism = load_mechanism(mechanism_file(folder, text))
    times = np.linspace(0.0, end, 21)
    return mechanism, integrate(mechanism.system, times, start=mechanism.start(), **options)


def test_a_controller_is_the_damped_oscillator(tmp_path: Path) -> None:
    """I a'' = -k (a - a0) - c a': decay and frequency in closed form."""
    _, run = ran(tmp_path, ROD + MOMENT.format("-(20*(angle(O) - 0.2) + 0.5*rate(rod))"), tolerance=1e-10)
    k, c, inertia = 20.0, 0.5, 0.5
    decay, u0 = c / (2 * inertia), math.radians(30.0) - 0.2
    omega = math.sqrt(k / inertia - decay**2)
    t = run.time
    u = np.exp(-decay * t) * (u0 * np.cos(omega * t) + (1.0 + decay * u0) / omega * np.sin(omega * t))
    np.testing.assert_allclose(run.q[:, 2], 0.2 + u, atol=1e-9)


@pytest.mark.parametrize(("method", "allowed"), [("taylor", 1e-8), ("implicit", 1e-6)])
def test_an_expression_of_places_is_the_spring_that_it_says(tmp_path: Path, method: str, allowed: float) -> None:
    spring = '[forces.s]\ntype = "spring"\nbody = "rod"\npoint = "tip"\n'
    spring += "stiffness_N_per_m = 30.0\ndamping_N_s_per_m = 2.0\n"
    force = '[forces.s]\ntype = "force"\nbody = "rod"\npoint = "tip"\n'
    force += 'x_N = "-30*x(rod.tip) - 2*vx(rod.tip)"\ny_N = "-30*y(rod.tip) - 2*vy(rod.tip)"\n'
    # a spring damps along its line only: of a hinged tip about O nothing; so the damping is left out there
    spring = spring.replace("damping_N_s_per_m = 2.0", "damping_N_s_per_m = 0.0").replace(
        'point = "tip"', 'point = "tip"\nto_point = [0.3, 0.1]'
    )
    force = force.replace(" - 2*vx(rod.tip)", "").replace(" - 2*vy(rod.tip)", "")
    force = force.replace("-30*x(rod.tip)", "-30*(x(rod.tip) - 0.3)").replace(
        "-30*y(rod.tip)", "-30*(y(rod.tip) - 0.1)"
    )
    _, one = ran(tmp_path, ROD + spring, tolerance=1e-11)
    _, two = ran(tmp_path, ROD + force, tolerance=1e-10 if method == "taylor" else 1e-8, method=method)
    assert one.method == "taylor"
    assert two.method == method
    np.testing.assert_allclose(two.q, one.q, atol=allowed)


def test_work_of_an_expression_balances_the_energy(tmp_path: Path) -> None:
    mechanism, run = ran(tmp_path, ROD + MOMENT.format("3*sin(5*time) - 0.3*tanh(rate(rod)/0.1)"), tolerance=1e-10)
    energy = evaluate(mechanism, run).energy
    assert np.ptp(energy["total_J"]) < 1e-8
    assert abs(energy["work_J"]).max() > 0.1


@pytest.mark.parametrize(("method", "tolerance"), [("implicit", 1e-5), ("implicit", 1e-7), ("taylor", 1e-9)])
@pytest.mark.parametrize("kind", ["corner", "jump", "pulses"])
def test_steps_end_at_corners_and_jumps(tmp_path: Path, kind: str, method: str, tolerance: float) -> None:
    """A stop with a spring, or a constant load, gives back the speed; half waves of a sine add 2 M/w each."""
    k, inertia, rod = 800.0, 0.5, ROD.replace("angle_deg = 30.0", "angle_deg = 0.0")
    load, end, speed = {
        "corner": (f"-{k}*max(0, angle(rod) - 0.4)", 0.7 + math.pi * math.sqrt(inertia / k), -1.0),
        "jump": ("-2*(1 + abs(angle(rod) - 0.4)/(angle(rod) - 0.4))", 0.95, -1.0),
        "pulses": ("3*max(0, sin(30*time))", 7 * math.pi / 15, 1.0 + 7 * 2 * 3 / 30 / inertia),
    }[kind]
    mechanism, run = ran(tmp_path, rod + MOMENT.format(load), end, method=method, tolerance=tolerance)
    assert run.v[-1, 2] == pytest.approx(speed, abs=5 * tolerance)
    total = evaluate(mechanism, run).energy["total_J"]
    assert total[-1] == pytest.approx(total[0], abs=5 * tolerance)
    assert run.statistics["steps"] < 250
    if kind != "pulses":
        assert run.q[-1, 2] == pytest.approx(0.1, abs=5 * tolerance)


def test_a_damper_that_differs_by_direction(tmp_path: Path) -> None:
    """k a + c a', c of each direction: a whole swing from rest leaves exp(-pi (d_1/w_1 + d_2/w_2)) of it.

    The pivot lies far from the origin, so that speeds within short steps are rounded.
    """
    rod = ROD.replace("O = [0.0, 0.0]", "O = [3.0, 1.0]").replace("angle_deg = 30.0", "position_m = [3.0, 1.0]")
    rod = rod.replace("rate_rad_per_s = 1.0", "angle_rad = 0.4\ncentre_m = [0.4, 0.0]")
    k, inertia, damping = 20.0, 0.5 + 2.0 * 0.4**2, np.array([0.5, 2.0])
    load = f"-{k}*angle(rod) - {damping[0]}*max(0, rate(rod)) - {damping[1]}*min(0, rate(rod))"
    decay = damping / (2.0 * inertia)
    omega = np.sqrt(k / inertia - decay**2)
    end = math.pi * float((1.0 / omega).sum())
    _, run = ran(tmp_path, rod + MOMENT.format(load), end, method="implicit", tolerance=1e-9, most_steps=500)
    assert run.q[-1, 2] == pytest.approx(0.4 * math.exp(-math.pi * float((decay / omega).sum())), abs=2e-8)
    assert run.v[-1, 2] == pytest.approx(0.0, abs=2e-7)


def test_slopes_are_those_of_the_value(tmp_path: Path) -> None:
    text = "min(10, 2*(1 - angle(rod))) * hypot(x(rod.tip), 1 + vy(rod.tip)**2) / (2 + cos(rate(O))) + exp(-y(rod.tip))"
    mechanism = load_mechanism(
        mechanism_file(tmp_path, ROD + MOMENT.format(text + " + atan2(vx(rod.tip), 3)**3 + log(2 + time)"))
    )
    ((_, load),) = mechanism.linkage.assembly.state_loads
    assert isinstance(load, ExpressionLoad)
    rng = np.random.default_rng(0)
    q, v = rng.standard_normal((2, 3))
    for part, slopes in enumerate(mechanism.linkage.force_jacobian(0.3, q, v)):
        for j in range(3):
            step = np.zeros((2, 3))
            step[part, j] = 1e-6
            ends = [load.value(0.3, q + s * step[0], v + s * step[1]) for s in (1.0, -1.0)]
            assert slopes[2, j] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-7)


def test_a_table_holds_its_points_and_is_monotone(tmp_path: Path) -> None:
    (tmp_path / "motor.csv").write_text("speed,torque\n0,10\n1,9\n2,9\n4,0\n", encoding="utf-8")
    table = '[tables.motor]\nfile = "motor.csv"\nx = "speed"\ny = "torque"\n'
    output = '[[outputs]]\nname = "torque_N_m"\nvalue = "motor(rate(rod))"\n'
    mechanism, run = ran(tmp_path, ROD + MOMENT.format("motor(rate(rod))") + table + output, 0.3)
    torque = evaluate(mechanism, run).outputs["torque_N_m"]
    assert torque[0] == pytest.approx(9.0)
    assert (np.diff(torque) <= 1e-9).all()
    np.testing.assert_allclose(run.a[:, 2] * 0.5, torque, atol=1e-6)
    linear = load_mechanism(
        mechanism_file(tmp_path, ROD + MOMENT.format("motor(3)") + table + 'interpolation = "linear"\n')
    )
    assert linear.linkage.assembly.state_loads[0][1].value(0.0, np.zeros(3), np.zeros(3)) == pytest.approx(4.5)


@pytest.mark.parametrize("how", [{}, {"method": "implicit"}])
def test_a_run_out_of_the_table_tells_where(tmp_path: Path, how: dict[str, str]) -> None:
    (tmp_path / "motor.csv").write_text("speed,torque\n0,10\n1.5,9\n", encoding="utf-8")
    table = '[tables.motor]\nfile = "motor.csv"\nx = "speed"\ny = "torque"\n'
    with pytest.raises(IntegrationError, match=r"table 'motor' goes from 0 to 1\.5 and is asked at 1\.5") as caught:
        ran(tmp_path, ROD + MOMENT.format("motor(rate(rod))") + table, **how)
    # I w' = 10 - w/1.5 from 1 to 1.5 rad/s
    assert caught.value.result.reached == pytest.approx(0.75 * math.log(14.0 / 13.5), rel=1e-8)


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        ("2*angle(crank)", "crank"),
        ("speed(rod)", "speed"),
        ("kinetic", "uses kinetic"),
        ("1 + ", "is not an expression"),
        ("1/(rate(rod) - 1)", "has no value at the start|have no value at the start"),
        ("sqrt(-angle(rod))", "have no value at the start"),
        ("(-1 - angle(rod))**0.5", "have no value at the start"),
        ("__import__('os')", "unknown name"),
        ("1 + 1e400", r"a number in it is larger than 1.8e\+308"),
        ("0**time", r"raises 0 to a power that varies"),
        ("(-1)**angle(rod)", r"raises -1 to a power that varies"),
        ("1/(time*rate(rod))", r"1 / 0 has no value"),
        ("time**(-1 - time)", r"0 \*\* -1 has no value"),
        ("(time - 1)**(time + 0.5)", r"-1 \*\* 0.5 has no value"),
        ("exp(1000 + time)", r"exp\(1000\) has no value"),
        ("-log(time)", r"log\(0\) has no value"),
    ],
)
def test_wrong_expressions(tmp_path: Path, expression: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        load_mechanism(mechanism_file(tmp_path, ROD + MOMENT.format(expression))).start()


SPRING = '\n[forces.spring]\ntype = "spring"\nbody = "rod"\npoint = "tip"\nto_point = [1.0, 1.0]\ntension_N = "{}"\n'
OUTPUT = '\n[[outputs]]\nname = "more"\nvalue = "{}"\n'


@pytest.mark.parametrize(
    ("added", "known", "unknown"),
    [
        (MOMENT.format("foo(rod)"), "rate, sin, .* vx, vy, x, y$", "deflection"),
        (MOMENT.format("foo"), r"angle\(...\), pi, rate\(...\), time, vx", "kinetic"),
        (SPRING.format("zzz"), "length, length_rate, pi, time$", "rate\\("),
        (OUTPUT.format("zzz"), r"angle\(...\), .*kinetic.* y\(...\)$", "deflection"),
    ],
)
def test_messages_offer_what_the_place_knows(tmp_path: Path, added: str, known: str, unknown: str) -> None:
    """Not the quantities of flexible links where there is none, nor those that no load depends on."""
    with pytest.raises(InputError, match=f"known names: .*{known}") as caught:
        load_mechanism(mechanism_file(tmp_path, ROD + added))
    assert not re.search(unknown, str(caught.value))


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("speed,torque\n0,1\n", "two rows"),
        ("speed,torque\n0,1\n0,2\n", "must rise"),
        ("speed,moment\n0,1\n1,2\n", "no column"),
        ("speed,torque\n0,1\nx,2\n", "no column of numbers"),
    ],
)
def test_wrong_tables(tmp_path: Path, content: str, text: str) -> None:
    (tmp_path / "motor.csv").write_text(content, encoding="utf-8")
    table = '[tables.motor]\nfile = "motor.csv"\nx = "speed"\ny = "torque"\n'
    with pytest.raises(InputError, match=text):
        load_mechanism(mechanism_file(tmp_path, ROD + MOMENT.format("motor(1)") + table))


def test_a_division_by_zero_on_the_way_tells_time_and_values(tmp_path: Path) -> None:
    with pytest.raises(IntegrationError, match=r"forces.drive.moment_N_m = .* at 0\.5.* s"):
        ran(tmp_path, ROD + MOMENT.format("sqrt(0.5 - time)"))


@pytest.mark.parametrize("method", ["auto", "implicit"])
def test_no_method_steps_over_a_pole(tmp_path: Path, method: str) -> None:
    with pytest.raises(IntegrationError, match=r"forces.drive.moment_N_m = '1/\(time - 0.5\)' at 0\.5 s") as caught:
        ran(tmp_path, ROD + MOMENT.format("1/(time - 0.5)"), method=method, tolerance=1e-6)
    assert caught.value.result.reached == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("load", ["log(0.5 - time)", "sqrt(0.5 - time)", "1/(0.5 - time)**0.5", "1e-4/(time - 0.5)"])
@pytest.mark.parametrize("link", ["rigid", "flexible"])
def test_a_load_without_value_on_the_way_is_named_with_all_links(tmp_path: Path, load: str, link: str) -> None:
    beam = "[bodies.rod.beam]\nlength_m = 0.7\ndiameter_m = 0.02\nyoungs_modulus_GPa = 2\ndensity_kg_per_m3 = 7800\n"
    beam += "elements = 2\ndamping_s = 0.01\n"  # without damping a run takes a hundred times the steps
    bends = ROD.replace("mass_kg = 2.0\ninertia_kg_m2 = 0.5\n", "") + beam
    with pytest.raises(IntegrationError, match=r"forces\.drive\.moment_N_m = '.*' at 0\.5 s: .*(no value|zero|\*\*)"):
        ran(tmp_path, (ROD if link == "rigid" else bends) + MOMENT.format(load))


@pytest.mark.parametrize("load", ["1e-6/(time - 0.5)", "1e-8/(time - 0.5)**3", "1e-6*tan(pi*time)"])
def test_a_pole_that_is_seen_from_afar_is_named_by_taylor(tmp_path: Path, load: str) -> None:
    """The series tells of the pole a step before it, where the load is still small."""
    with pytest.raises(IntegrationError, match=r"forces\.drive\.moment_N_m = '.*' at 0\.5 s: .*division by zero"):
        ran(tmp_path, ROD + MOMENT.format(load), method="taylor", tolerance=1e-6)


def test_a_load_that_grows_without_bound_ends_the_run_and_is_named(tmp_path: Path) -> None:
    """The rod turns ever faster, twice as many times every 70 microseconds; no number of steps gets it to the end."""
    with pytest.raises(IntegrationError, match=r"would take more .*'exp\(10000\*time\)' at 0\.00.*: grows") as caught:
        ran(tmp_path, ROD + MOMENT.format("exp(10000*time)"), method="taylor", tolerance=1e-6)
    assert caught.value.result.statistics["steps"] < 100_000


def test_output_times_by_rounding_beyond_the_end_of_a_stopped_run_are_left_out(tmp_path: Path) -> None:
    mechanism = load_mechanism(mechanism_file(tmp_path, ROD + MOMENT.format("log(0.5 - time)")))
    options = {"start": mechanism.start(), "method": "taylor", "raise_on_failure": False}
    end = integrate(mechanism.system, [0.0, 10.0], **options).dense.times[-1]  # type: ignore[arg-type]
    run = integrate(mechanism.system, [0.0, end + 5e-12, 10.0], **options)  # type: ignore[arg-type]
    np.testing.assert_array_equal(run.time, [0.0])


@pytest.mark.parametrize(("load", "text"), [("1/(time - 0.5)", "1 / 0"), ("motor(time)", "from 0 to 0.4")])
def test_a_prescribed_motion_under_a_load_without_value_is_refused(tmp_path: Path, load: str, text: str) -> None:
    (tmp_path / "motor.csv").write_text("t,torque\n0,1\n0.4,2\n", encoding="utf-8")
    drive = '[joints.d]\ntype = "prescribed"\nbody = "rod"\ncoordinate = "rate"\nmotion_rad_per_s = 1.0\n'
    table = '[tables.motor]\nfile = "motor.csv"\nx = "t"\ny = "torque"\n'
    mechanism = load_mechanism(mechanism_file(tmp_path, ROD + drive + MOMENT.format(load) + table))
    with pytest.raises(InputError, match=text):
        prescribed_motion(mechanism.system, mechanism.start(), np.linspace(0.0, 1.0, 21))


TABLED = """
[joints.motor]
type = "prescribed"
body = "rod"
coordinate = "{coordinate}"
motion_{unit} = {{ table = "drive" }}
[tables.drive]
file = "drive.csv"
x = "t"
y = "value"
"""


@pytest.mark.parametrize("coordinate", ["angle", "rate"])
def test_a_motion_from_a_table_over_time(tmp_path: Path, coordinate: str) -> None:
    """At the points the table's values; by the series, whose steps end at the points."""
    t = np.linspace(0.0, 1.0, 11)
    value = np.sin(t) if coordinate == "angle" else np.cos(t)
    rows = "\n".join(f"{a},{b}" for a, b in zip(t, value, strict=True))
    (tmp_path / "drive.csv").write_text("t,value\n" + rows + "\n", encoding="utf-8")
    text = ROD.replace("angle_deg = 30.0\nrate_rad_per_s = 1.0\n", "") + TABLED.format(
        coordinate=coordinate, unit=UNIT_OF[coordinate]
    )
    mechanism, run = ran(tmp_path, text, method="taylor")
    if coordinate == "angle":
        np.testing.assert_allclose(run.q[::2, 2], np.sin(t), atol=1e-12)
    else:
        np.testing.assert_allclose(run.v[::2, 2], np.cos(t), atol=1e-10)
        np.testing.assert_allclose(run.q[::2, 2], np.sin(t), atol=2e-3)
    assert mechanism.known_until == 1.0


@pytest.mark.parametrize(
    ("content", "extra", "text"),
    [
        ("0.1,0\n1,1\n", "", "begins at 0.1 s"),
        ("0,0\n1,1\n", 'interpolation = "linear"\n', "speed of a prescribed motion"),
        ("0,0\n0.5,1\n", "", "after the end of a table"),
    ],
)
def test_wrong_tables_over_time(tmp_path: Path, content: str, extra: str, text: str) -> None:
    (tmp_path / "drive.csv").write_text("t,value\n" + content, encoding="utf-8")
    path = mechanism_file(tmp_path, ROD + TABLED.format(coordinate="rate", unit=UNIT_OF["rate"]) + extra)
    with pytest.raises(InputError, match=text):
        run_mechanism(load_mechanism(path), tmp_path / "out")


def test_a_flexible_link_driven_by_tables_beside_the_file(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("t,value\n0,2\n1,2\n", encoding="utf-8")
    beam = (
        "[bodies.rod.beam]\nlength_m = 1.0\ndiameter_m = 0.05\nyoungs_modulus_GPa = 200.0\ndensity_kg_per_m3 = 7850.0\n"
    )
    text = ROD.replace("mass_kg = 2.0\ninertia_kg_m2 = 0.5\n", "").replace("[joints.O]", beam + "[joints.O]")
    _, run = ran(tmp_path, text + TABLED.format(coordinate="rate", unit=UNIT_OF["rate"]), 0.1)
    np.testing.assert_allclose(run.v[:, 2], 2.0, atol=1e-9)


def test_the_finer_run_of_one_that_stuck_is_not_made_of_its_last_steps(tmp_path: Path) -> None:
    """A run that sticks, as at the fold, which the implicit method need not pass, ends with many steps of next to no
    length; so does this one, with twice as many of 1e-9 s.
    """
    crank = (GEOMETRY / "slider_crank.toml").read_text(encoding="utf-8")
    load = MOMENT.replace("rod", "crank").format("sqrt(angle(crank) - 0.5)")
    mechanism, run = ran(tmp_path, crank + load, 3.0, method="implicit", tolerance=1e-9, raise_on_failure=False)
    ends = run.dense.times
    made = replace(run, dense=replace(run.dense, times=np.append(ends, ends[-1] + 1e-9 * np.arange(1, 2 * len(ends)))))
    finer = finer_run(mechanism, mechanism.start(), made, 1e-9 / 30)
    assert finer is not None
    assert finer.statistics["steps"] < 30 * len(ends)


def test_the_estimate_of_a_run_that_grew_takes_few_times_its_steps(tmp_path: Path) -> None:
    """Most steps of a motion that grows are at its end: a finer run needs 1.5 times as many, and ends there, too."""
    crank = (GEOMETRY / "elastic_slider_crank.toml").read_text(encoding="utf-8").partition("[joints.motor]")[0]
    load = MOMENT.replace("rod", "crank").format("0.01 + 50*rate(crank)")
    mechanism = load_mechanism(mechanism_file(tmp_path, crank + load))
    run = integrate(mechanism.system, np.linspace(0.0, 0.2, 801), start=mechanism.start(), tolerance=1e-5,
                    raise_on_failure=False)  # fmt: skip
    assert run.status is Status.ENDLESS
    assert "grows beyond" in run.message
    finer = finer_run(mechanism, mechanism.start(), run, 1e-5 / 30)
    assert finer is not None
    assert finer.statistics["steps"] < 2.5 * run.statistics["steps"]
