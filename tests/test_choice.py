"""Choosing among integrators and changing over, with costs that the tests set; no times are measured."""

from __future__ import annotations

import importlib
import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfe.progress import shown
from gearfe.rigid import Body, CoordinateSpring, Gravity, Hinge, Linkage, ModalBlocks, System
from gearfe.rigid.choice import Choice, Leg, Way, joined, joined_statistics
from gearfe.rigid.contract import Array
from gearfe.rigid.integrate import _dropped_rows_hold, integrate, ways_of
from gearfe.rigid.start import Freedoms, Start, consistent_start
from gearfe.rigid.steps import Status, Watch
from gearfe.train import build_train, simulate

from .rigid_cases import pendulum
from .trains import train

Cost = Callable[[float], float]
START = Start(0.0, np.zeros(1), np.zeros(1), Freedoms(1, 0), np.zeros(0, dtype=bool))
TIMES = np.linspace(0.0, 1.0, 5)


class Clock:
    """Seconds that the ways say they take."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass(frozen=True)
class Line:
    """q = t as the dense output of a stub."""

    times: Array

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        return np.array([t, np.ones_like(t), np.zeros_like(t)])[derivative][:, None]


def stub(name: str, clock: Clock, cost: Cost, step: Callable[[float], float], **more: Any) -> Way:
    """A way whose steps from t have the length step(t) and take cost(t) seconds."""

    def run(start: Start, times: Array, most: int, watch: Watch | None) -> tuple[Line, int, dict[str, Any]]:
        t, ends, status = start.time, [start.time], 0
        while t < times[-1] and len(ends) <= most:
            if watch is not None and not watch(t, len(ends) - 1, lambda t=t: (np.array([t]), np.ones(1))):
                status = Status.STOPPED
                break
            clock.now += cost(t)
            t = min(t + step(t), float(times[-1]))
            ends.append(t)
        return Line(np.array(ends)), status, {"steps": len(ends) - 1}

    return Way(name, "", run, **more)


def chosen(*ways: Way, clock: Clock) -> tuple[list[Leg], list[str]]:
    choice = Choice(ways, START, TIMES, clock=clock)
    return choice.run(), choice.said


def names(legs: list[Leg]) -> list[str]:
    return [leg.way.method for leg in legs]


def test_the_way_with_the_fewest_seconds_does_all_of_the_run() -> None:
    clock = Clock()
    one = stub("one", clock, lambda _: 0.1, lambda _: 1e-4)  # 1000 s
    two = stub("two", clock, lambda _: 1.0, lambda _: 1e-2)  # 100 s
    legs, said = chosen(one, two, clock=clock)
    assert names(legs) == ["two"]
    assert legs[0].dense.times[0] == 0.0
    assert legs[0].predicted == pytest.approx(100.0, rel=0.1)
    assert said == ["method two: about 99 s"]
    assert clock.now < 2 * 100.0
    assert names(chosen(two, one, clock=clock)[0]) == ["two"]


def test_a_trial_that_costs_more_than_the_run_is_not_made() -> None:
    clock = Clock()
    one = stub("one", clock, lambda _: 1e-3, lambda _: 0.01)
    two = stub("two", clock, lambda _: pytest.fail("was tried"), lambda _: 1.0, trial=1.0)
    assert names(chosen(one, two, clock=clock)[0]) == ["one"]


def test_steps_that_grow_are_given_time() -> None:
    """100 steps through what decays fast, then large ones: 1.2 s, where the first way takes 2 s."""
    clock = Clock()
    one = stub("one", clock, lambda _: 2e-3, lambda _: 1e-3)
    two = stub("two", clock, lambda _: 1e-2, lambda t: 1e-6 + 0.1 * t)
    legs, _ = chosen(one, two, clock=clock)
    assert names(legs) == ["two"]
    assert clock.now < 2 * 1.3


def test_a_first_step_guessed_with_care_says_nothing_of_the_pace() -> None:
    """Steps from 1e-12 s on, six times as long each, up to those of a run of 10 s; the other way takes 20 s."""
    clock = Clock()
    one = stub("one", clock, lambda _: 1e-2, lambda t: min(1e-3, 1e-12 + 5.0 * t))
    two = stub("two", clock, lambda _: 0.1, lambda _: 5e-3)
    legs, _ = chosen(one, two, clock=clock)
    assert names(legs) == ["one"]
    assert clock.now < 1.3 * 10.0


def test_steps_that_do_not_grow_are_given_up_early() -> None:
    clock = Clock()
    one = stub("one", clock, lambda _: 2e-3, lambda _: 1e-3)
    two = stub("two", clock, lambda _: 1e-2, lambda _: 1e-4)
    assert names(chosen(one, two, clock=clock)[0]) == ["one"]
    assert clock.now < 1.25 * 2.0


def test_a_trial_whose_steps_are_too_dear_for_a_run_is_given_up() -> None:
    """A run takes sixteen steps at least: 3.2 s of the second way, where the first needs 2 s."""
    clock = Clock()
    one = stub("one", clock, lambda _: 2e-3, lambda _: 1e-3)
    two = stub("two", clock, lambda _: 0.2, lambda _: 1e-6)
    assert names(chosen(one, two, clock=clock)[0]) == ["one"]
    assert clock.now < 2.0 + 3 * 0.2


def test_a_prediction_that_proves_wrong_changes_the_way_over() -> None:
    """The first way is fast for the first third and far slower than predicted from then on."""
    clock = Clock()
    one = stub("one", clock, lambda t: 1e-3 if t < 0.33 else 1.0, lambda _: 1e-3)
    two = stub("two", clock, lambda _: 0.1, lambda _: 1e-2)
    legs, said = chosen(one, two, clock=clock)
    assert names(legs) == ["one", "two"]
    assert len(said) == 2
    assert "from 0.3" in said[1]
    assert clock.now < 2 * (0.33 + 6.7) + 2.0
    dense = joined(legs)
    assert dense.times[0] == 0.0
    assert dense.times[-1] == 1.0
    assert (np.diff(dense.times) > 0).all()
    ask = np.array([0.9, 0.1, dense.times[331], 0.0, 1.0])
    np.testing.assert_array_equal(dense(ask, 0)[:, 0], ask)
    told = joined_statistics(legs, said)
    assert told["steps"] == len(dense.times) - 1
    assert [leg["method"] for leg in told["choice"]] == ["one", "two"]


def test_a_faster_backend_takes_over_when_loading_it_pays() -> None:
    clock = Clock()
    plain = stub("series", clock, lambda _: 1e-2, lambda _: 1e-3)  # 10 s
    for loading, backends in ((1.0, [180.0]), (20.0, [1.0])):
        quick = stub("series", clock, lambda _: 1e-4, lambda _: 1e-3, trial=loading, loading=loading, ratio=180.0)
        legs, _ = chosen(plain, quick, clock=clock)
        assert [leg.way.ratio for leg in legs] == backends


def test_the_largest_number_of_steps_counts_all_ways() -> None:
    clock = Clock()
    one = stub("one", clock, lambda t: 1e-3 if t < 0.33 else 1.0, lambda _: 1e-3)
    two = stub("two", clock, lambda _: 0.1, lambda _: 1e-2)
    legs = Choice((one, two), START, TIMES, most=360, clock=clock).run()
    assert sum(leg.statistics["steps"] for leg in legs) == 360


def slowed(way: Way, clock: Clock, cost: Cost) -> Way:
    """A real way whose steps from t take cost(t) seconds of the clock."""

    def run(start: Start, times: Array, most: int, watch: Watch | None) -> Any:
        last = [0]

        def told(t: float, steps: int, state: Any) -> bool:
            clock.now += cost(t) * (steps - last[0])
            last[0] = steps
            return watch is None or watch(t, steps, state)

        return way.run(start, times, most, told)

    return replace(way, run=run)


def rotor() -> tuple[System, Callable[[Array], Array]]:
    """A rod on a torsion spring, damped to a tenth, in closed form."""
    inertia, k, zeta = 0.1 + 0.25, 400.0, 0.1
    omega = np.sqrt(k / inertia)
    c, fast = 2 * zeta * omega * inertia, omega * np.sqrt(1 - zeta**2)
    rod = Body("rod", 1.0, 0.1, (0.5, 0.0), (0.0, 0.0), 0.3)
    parts = (Hinge("rod", "ground"),), (CoordinateSpring("rod", "angle", k, c),)

    def exact(t: Array) -> Array:
        return np.asarray(0.3 * np.exp(-zeta * omega * t) * (np.cos(fast * t) + zeta * omega / fast * np.sin(fast * t)))

    return System([Linkage((rod,), *parts)]), exact


@pytest.mark.parametrize("first", ["taylor", "implicit"])
@pytest.mark.parametrize("back", [False, True])
def test_a_change_over_between_series_and_radau_keeps_the_motion(first: str, back: bool) -> None:
    system, exact = rotor()
    start = consistent_start(system)
    times = np.linspace(0.0, 2.0, 41)
    if back:  # from the state at 2 s to the start
        made = integrate(system, times, method="taylor", tolerance=1e-12, start=start, backend="plain")
        start, times = Start(2.0, made.q[-1], made.v[-1], start.freedoms, start.active), times[::-1]
    ways = ways_of(system, start, times, "auto", "plain", {"tolerance": 1e-8, "longest": np.inf})
    clock = Clock()
    slow: Cost = lambda t: 1e-3 if (t > 1.0) == back else 1e3  # noqa: E731
    made_ways = [slowed(w, clock, slow if w.method == first else lambda _: 1.0) for w in ways]
    made_ways = [replace(w, rate=None) for w in sorted(made_ways, key=lambda w: w.method != first)]
    legs = Choice(made_ways, start, times, clock=clock).run()
    assert [leg.way.method for leg in legs] == [first, "implicit" if first == "taylor" else "taylor"]
    dense = joined(legs)
    angle = dense(times, 0)[:, 2]
    np.testing.assert_allclose(angle, exact(times), atol=2e-6)
    joint = legs[0].dense.times[-1]
    beside = joint + np.array([-1e-9, 1e-9])
    np.testing.assert_allclose(np.diff(dense(beside, 1)[:, 2]), 0.0, atol=1e-5)


def test_a_change_over_of_modal_coordinates_keeps_the_motion() -> None:
    body = ModalBlocks(np.eye(2), np.diag([0.4, 1.0]), np.diag([100.0, 900.0]), q0=np.array([1.0, -1.0]))
    system = System([body])
    start, times, clock = consistent_start(system), np.linspace(0.0, 2.0, 21), Clock()
    one, two = ways_of(system, start, times, "auto", "plain", {"tolerance": 1e-8, "longest": np.inf})
    one = slowed(one, clock, lambda t: 1e-3 if t < 1.0 else 1e3)
    two = replace(slowed(two, clock, lambda _: 1.0), rate=None)
    legs = Choice([one, two], start, times, clock=clock).run()
    assert [leg.way.method for leg in legs] == ["explicit", "implicit"]
    for i, (c, k, q) in enumerate(((0.4, 100.0, 1.0), (1.0, 900.0, -1.0))):
        fast = np.sqrt(k - c * c / 4)
        exact = q * np.exp(-c * times / 2) * (np.cos(fast * times) + c / 2 / fast * np.sin(fast * times))
        np.testing.assert_allclose(joined(legs)(times, 0)[:, i], exact, atol=1e-5)


def test_only_series_pass_singular_positions_so_springs_must_set_the_steps() -> None:
    """Without springs and dampers nothing is stiff: Radau's method is not tried, however slow the series are."""
    soft = Linkage(
        (Body("rod", 1.0, 0.1, (0.5, 0.0), (0.0, 0.0), 1.0),),
        (Hinge("rod", "ground"),),
        (Gravity((0.0, -9.81)), CoordinateSpring("rod", "angle", 0.1, 0.0)),
    )
    for system in (pendulum(), System([soft])):
        start, times, clock = consistent_start(system), np.array([0.0, 40.0]), Clock()
        ways = ways_of(system, start, times, "auto", "plain", {"tolerance": 1e-6, "longest": np.inf})
        assert [w.method for w in ways] == ["taylor", "implicit"]
        made = [slowed(w, clock, (lambda _: 1e3) if w.method == "taylor" else (lambda _: 1e-3)) for w in ways]
        assert [leg.way.method for leg in Choice(made, start, times, clock=clock).run()] == ["taylor"]


def test_the_choice_and_its_prediction_are_told_before_the_end() -> None:
    """On the stream of a program that shows progress, when a run is long; in the statistics always."""
    stream, clock = io.StringIO(), Clock()
    one = stub(
        "one", clock, lambda _: 1e-2 if not stream.getvalue() else 1e-3, lambda _: 1e-3, cure="others are faster"
    )
    with shown(stream):
        legs, said = chosen(one, clock=clock)
    assert stream.getvalue() == "gearfe: method one: about 8 s left; others are faster\n"  # after 2 of 10 s
    assert joined_statistics(legs, said)["predictions"] == said == ["method one: about 9.8 s"]  # after 16 steps
    made = integrate(pendulum(), [0.0, 20.0], tolerance=1e-6, backend="auto")
    assert made.method == "taylor"
    assert [leg["method"].split()[0] for leg in made.statistics["choice"]] == ["taylor"]
    assert made.statistics["choice"][0]["predicted_s"] > 0.0


def test_the_compiler_is_no_integration(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seconds of compiling are told apart: of 5 s that it claims, none is left in the integration's."""

    def compiling(*arguments: Any, **options: Any) -> Any:
        made = integrate(*arguments, **options)
        return replace(made, statistics={**made.statistics, "compile_seconds": 1e6})

    monkeypatch.setattr(importlib.import_module("gearfe.train.simulate"), "integrate", compiling)
    made = simulate(build_train(train([(20, 30)])), np.linspace(0.0, 1e-4, 3), backend="plain")
    assert made.statistics["compile_seconds"] == 1e6
    assert made.statistics["seconds"] < 0.0


def test_constant_rows_are_not_checked_by_another_run() -> None:
    """Two hinges of a rigid shaft share constraints; the check of what was left out integrated all of it again."""
    model = build_train(train([(20, 30)]))
    assert not model.start.active.all()

    def again(*_: Any) -> Any:
        raise AssertionError("was integrated again")

    made = integrate(model.system, [0.0, 1e-5], start=model.start, method="explicit", backend="plain")
    monkey = SimpleNamespace(times=made.dense.times, __call__=again)
    assert _dropped_rows_hold(model.system, model.start, monkey, 1e-6)


def test_a_train_that_changes_over_keeps_its_forces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces and accelerations through a change-over against the series all along: no corner, so both are smooth."""
    model, times, clock = build_train(train([(20, 30)])), np.linspace(0.0, 1e-3, 41), Clock()
    alone = simulate(model, times, tolerance=1e-9, method="explicit", backend="plain")

    def slow(*arguments: Any) -> list[Way]:
        one, two = ways_of(*arguments)
        late: Cost = lambda t: 1e-3 if t < 5e-4 else 1e3  # noqa: E731
        return [slowed(one, clock, late), replace(slowed(two, clock, lambda _: 1.0), rate=None)]

    module = importlib.import_module("gearfe.rigid.integrate")
    monkeypatch.setattr(module, "ways_of", slow)
    monkeypatch.setattr(module, "Choice", partial(Choice, clock=clock))
    made = simulate(model, times, tolerance=1e-6, backend="plain")
    assert [leg["method"] for leg in made.statistics["choice"]] == ["explicit", "implicit"]
    assert made.statistics["method"] == "auto"
    for name in ("contact_force", "acceleration", "speed"):
        one, two = getattr(alone, name), getattr(made, name)
        np.testing.assert_allclose(two, one, atol=1e-4 * np.abs(one).max())
