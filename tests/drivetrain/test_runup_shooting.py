"""Steady states by harmonic balance against periodic orbits by shooting with the transient's own integrator, and
their error estimate against finer ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from gearfe.drivetrain.runup.balance import size_of, widened
from gearfe.drivetrain.runup.condensed import condense
from gearfe.drivetrain.runup.report import warnings
from gearfe.drivetrain.runup.results import SteadyState
from gearfe.drivetrain.runup.run_up import run_up, steady_state
from gearfe.drivetrain.train import TrainModel, build_train
from gearfe.drivetrain.train.states import train_states
from gearfe.multibody import constant, integrate
from tests.makers.mesh_laws import hertzian_law
from tests.makers.trains import Array, curve, loaded, modal_start, smooth


def at_speed(model: TrainModel, speed: float) -> TrainModel:
    return build_train(
        dataclasses.replace(model.train, drive=dataclasses.replace(model.train.driven, speed=constant(speed)))
    )


def shot(model: TrainModel, start: Array, period: float, samples: int = 2) -> tuple[Array, Array]:
    """State after a period, and the contact forces on the way."""
    modal, n = model.modal, len(start) // 2
    begin = dataclasses.replace(model.start, q=modal.origin + modal.T @ start[:n], v=modal.T @ start[n:])
    times = np.linspace(0.0, period, samples)
    run = integrate(model.system, times, method="taylor", tolerance=1e-10, start=begin)
    moved = train_states(model, run)
    return np.concatenate(modal.reduce(moved.q[-1], moved.v[-1])), moved.contact_force


def orbit(model: TrainModel, start: Array, period: float) -> tuple[Array, Array]:
    """The start of a periodic motion by Newton's method, and the monodromy matrix by central differences."""
    n = len(start) // 2
    size = np.repeat([np.abs(start[:n]).max(), np.abs(start[n:]).max()], n)

    def away(x: Array) -> Array:
        return shot(model, x, period)[0] - x

    for _ in range(8):
        steps = 1e-5 * size * np.eye(2 * n)
        round_ = np.array([(away(start + h) - away(start - h)) / (2.0 * h.max()) for h in steps]).T
        change = np.linalg.solve(round_, -away(start))
        start = start + change
        if (np.abs(change) < 1e-8 * size).all():
            return start, round_ + np.eye(2 * n)
    raise AssertionError("no periodic motion by shooting")


def compared(model: TrainModel, state: SteadyState, bound: float) -> None:
    """Start, forces over the period, and multipliers of a state against the orbit."""
    model = at_speed(model, state.speed)
    guess = modal_start(model, state)
    exact, monodromy = orbit(model, guess, state.period)
    n = len(guess) // 2
    for part in (slice(None, n), slice(n, None)):
        assert np.abs(guess[part] - exact[part]).max() < bound * np.abs(exact[part]).max()
    samples = len(state.force)
    _, force = shot(model, exact, state.period, samples + 1)
    assert np.abs(state.force - force[:-1]).max() < bound * np.abs(force).max()
    largest = np.abs(np.linalg.eigvals(monodromy)).max()
    assert state.multipliers is not None
    assert abs(state.multipliers[0]) == pytest.approx(largest, rel=20 * bound)
    assert bool(largest > 1.0) is not state.stable


@pytest.mark.parametrize(
    ("stiffness", "speed", "backlash"),
    [(smooth, 600.0, None), (lambda teeth: hertzian_law(relief=4e-6), 700.0, 30e-6)],
)
def test_an_elastic_train(stiffness: Callable[[int], object], speed: float, backlash: float | None) -> None:
    model = build_train(loaded([(20, 30)], stiffness, speed=speed, backlash=backlash))
    compared(model, steady_state(model, speed, tolerance=1e-4), 1e-3)


def test_all_three_motions_at_one_speed() -> None:
    """Teeth part in the resonance: two stable motions and the unstable one between them."""
    law = hertzian_law(relief=6e-6)
    model = build_train(loaded([(20, 30)], lambda teeth: law, speed=1500.0, torque=15.0, ratio=0.05, flexible=False))
    run = run_up(model, np.linspace(700.0, 900.0, 21), tolerance=1e-3)
    assert len(run.turning_speeds) == 2
    speeds = [s.speed for s in run.states if s.branch == 1 and s.speed in run.speeds.tolist()]
    three = [s for s in run.states if s.speed == speeds[len(speeds) // 2]]
    assert [s.stable for s in three] == [True, False, True]
    for state in three:
        compared(model, steady_state(model, state.speed, state, tolerance=2e-4), 2e-3)


def random_train(rng: np.random.Generator) -> TrainModel:
    """One or two stages, laws and curves, with parting teeth or back flanks, in stiff or soft bores."""
    stages = [(int(rng.integers(18, 30)), int(rng.integers(20, 40)))] if rng.random() < 0.6 else [(20, 30), (20, 30)]
    relief, swing, law = rng.uniform(0.0, 8e-6), rng.uniform(0.05, 0.3), rng.random() < 0.6

    def stiffness(teeth: int) -> object:
        return hertzian_law(2 * np.pi / teeth, relief=relief) if law else curve(teeth, mean=1e8, swing=swing)

    return build_train(
        loaded(
            stages,
            stiffness,
            speed=rng.uniform(300.0, 1600.0),
            torque=rng.uniform(10.0, 90.0),
            ratio=rng.uniform(0.02, 0.08),
            backlash=30e-6 if rng.random() < 0.5 else None,
            flexible=rng.random() < 0.5,
        )
    )


def test_the_estimate_covers_the_error_of_random_trains() -> None:
    """A thousandth of the tolerance as truth; the estimate is twice the error in the median."""
    rng, factors = np.random.default_rng(8), []
    for _ in range(20):
        model, tolerance = random_train(rng), 10.0 ** rng.uniform(-3.0, -1.5)
        state = steady_state(model, model.steady_speed, tolerance=tolerance, stability=False)
        fine = steady_state(model, model.steady_speed, state, tolerance=1e-3 * tolerance, stability=False)
        off = fine.orbit.places - widened(state.orbit.places, fine.orbit.harmonics)
        factors.append(state.error / size_of(off, condense(model).system.scale))
    assert (np.array(factors) > 1.0).sum() >= 19
    assert np.median(factors) < 10.0


def test_too_few_harmonics_for_the_asked_error_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The state says its error, and the run a warning."""
    monkeypatch.setattr("gearfe.drivetrain.runup.balance.MOST_HARMONICS", 32)
    law = hertzian_law(relief=6e-6)
    model = build_train(loaded([(20, 30)], lambda teeth: law, torque=15.0, flexible=False))
    run = run_up(model, np.array([300.0, 310.0]), tolerance=1e-6, stability=False)
    assert all(state.error > 1e-6 for state in run.states)
    assert any("of 2 states miss the tolerance" in sentence for sentence in warnings(run))
