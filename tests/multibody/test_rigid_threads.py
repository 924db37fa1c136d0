"""A model can be shared by threads: runs of one system at the same time are those made one after the other."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from gearfe.mechanisms import load_mechanism
from gearfe.multibody import Start, Trajectory, consistent_start, integrate
from tests.places import GEOMETRY

TIMES = np.linspace(0.0, 0.03, 31)


@pytest.mark.parametrize("method", ["taylor", "implicit"])
def test_runs_of_one_system_at_once_have_the_digits_of_runs_in_turn(method: str) -> None:
    """Andrews' mechanism from four starts, twice at once in four threads."""
    system = load_mechanism(GEOMETRY / "andrews.toml").system
    one = consistent_start(system, 0.0)
    starts = [consistent_start(system, 0.0, v=one.v + k) for k in range(4)]

    def run(start: Start) -> Trajectory:
        return integrate(system, TIMES, start=start, method=method, tolerance=1e-7, raise_on_failure=False)

    in_turn = [run(start).q for start in starts]
    with ThreadPoolExecutor(4) as threads:
        at_once = [made.q for made in threads.map(run, starts + starts)]
    for k, q in enumerate(at_once):
        np.testing.assert_array_equal(q, in_turn[k % 4])
    assert not np.array_equal(in_turn[0], in_turn[1])


def test_a_load_without_a_value_in_one_run_leaves_no_trace_in_another(tmp_path: Path) -> None:
    text = """
[run]
end_s = 1.0
step_s = 0.1
[bodies.block]
mass_kg = 1.0
inertia_kg_m2 = 1.0
[joints.bearing]
type = "hinge"
body = "block"
[forces.load]
type = "moment"
body = "block"
moment_N_m = "sqrt(1.0 - angle(block))"
"""
    path = tmp_path / "mechanism.toml"
    path.write_text(text, encoding="utf-8")
    system = load_mechanism(path).system
    begin = consistent_start(system, 0.0)
    fast = consistent_start(system, 0.0, v=begin.v + np.array([0.0, 0.0, 5.0]))
    stopped = integrate(system, [0.0, 1.0], start=fast, raise_on_failure=False)
    assert "sqrt" in stopped.message
    done = integrate(system, [0.0, 0.1], start=begin)
    assert done.message == "done"
