"""Planar mechanisms: every integrator x tolerance, chains of bodies, first and later calls; other programs beside.

Andrews' mechanism is held against its trajectory in binary128 (seven angles, 0..0.03 s), the slider crank against its
exact equation in binary128 (crank angle, 0..10 s, eleven passages through the fold).
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gearfe.mechanisms import load_mechanism
from gearfe.multibody import Body, Gravity, Hinge, Linkage, Start, System, integrate
from tests.makers.rigid_cases import chain, folding_angle, seven_angles
from tests.places import DATA, GEOMETRY, ROOT

from .flexible_study import flexible
from .peers.process import PeerError, missing, run_python
from .record import Record
from .subject import given_file
from .timing import measured

TOLERANCES, QUICK_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12), (1e-5,)
#: The methods that are not made for these mechanisms run to fewer digits: plain Python, constraints at every stage.
SLOW_TOLERANCES, QUICK_SLOW = (1e-3, 1e-5, 1e-7), (1e-3,)
CHAINS, QUICK_CHAINS = (10, 20, 40, 80, 160, 320), (4, 8)
ANGLES = ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon")
PEERS = ("sundials", "exudyn", "scipy_ivp")


class Subject(NamedTuple):
    """A mechanism with its exact trajectory."""

    system: System
    start: Start
    times: np.ndarray
    truth: np.ndarray

    def error(self, q: np.ndarray) -> float:
        """Largest error of all angles over the run (rad); nan when it ended early."""
        if len(q) != len(self.truth):
            return float("nan")
        found = q[:, 2::3] if self.truth.ndim == 1 else seven_angles(q)
        return float(np.abs((found[:, 0] if self.truth.ndim == 1 else found) - self.truth).max())


@lru_cache(maxsize=2)
def subject(name: str) -> Subject:
    """``andrews`` or ``slider_crank``."""
    mechanism = load_mechanism(given_file(GEOMETRY / f"{name}.toml"))
    table = np.genfromtxt(given_file(DATA / f"{name}_reference.csv"), delimiter=",", names=True, skip_header=1)
    truth = np.stack([table[n] for n in ANGLES], 1) if name == "andrews" else table["theta"]
    return Subject(mechanism.system, mechanism.start(), table["t"], truth)


def run_mechanism(record: Record) -> None:
    """All tables of the mechanisms."""
    tolerances(record)
    starts(record)
    if record.peers:
        others(record)
    flexible(record)
    chains(record)
    calls(record)


def tolerances(record: Record) -> None:
    """Error against processor time for every integrator and tolerance."""
    table = record.table("mechanism_tolerance", "mechanism", "program", "method", "tolerance")
    for name in ("andrews", "slider_crank"):
        for method in ("taylor", "implicit"):
            asked: tuple[float, ...]
            if method == "taylor":
                asked = QUICK_TOLERANCES if record.quick else TOLERANCES
            else:
                asked = SLOW_TOLERANCES if not record.quick else QUICK_SLOW if name == "andrews" else ()
            for tolerance in asked:
                key = {"mechanism": name, "program": "gearfe", "method": method, "tolerance": tolerance}
                record.row(table, key, partial(_ours, name, method, tolerance, record.quick))


def _ours(name: str, method: str, tolerance: float, quick: bool) -> Mapping[str, Any]:
    case = subject(name)

    def run() -> tuple[Any, np.ndarray]:
        made = integrate(case.system, case.times, method=method, tolerance=tolerance, start=case.start)
        return made, made.q

    if method == "taylor" and not quick:
        run()  # loads the kernels
    (made, q), cost = measured(run, runs=1 if quick or method != "taylor" else 5, least_s=0.1 if not quick else 0.0)
    return {"error": case.error(q), **cost.columns, "steps": int(made.statistics["steps"]), "status": made.message}


def starts(record: Record) -> None:
    """The slider crank from random starts on the true branch: worst and median over all of them."""
    table = record.table("mechanism_starts", "starts")
    count = 2 if record.quick else 60

    def make() -> Mapping[str, Any]:
        random = np.random.default_rng(7)
        times = np.linspace(0.0, 1.0 if record.quick else 10.0, 21 if record.quick else 201)
        seconds, worst, wrong = [], [], 0
        for _ in range(count):
            theta, omega = _start_with_passage(random)
            system = folding_links(theta, omega)
            run = lambda s=system: integrate(s, times, tolerance=1e-9)  # noqa: E731
            run()
            made, cost = measured(run, runs=1 if record.quick else 5)
            other = made.q[:, 5] + made.q[:, 2]
            wrong += int(np.abs(other).max() > 1e-3 or made.status != 0)
            seconds.append(cost.cpu_s)
            worst.append(float(np.abs(made.q[:, 2] - folding_angle(theta, omega, times)).max()))
        return {
            "median_ms": 1e3 * float(np.median(seconds)),
            "largest_ms": 1e3 * max(seconds),
            "largest_error": max(worst),
            "wrong_branch": wrong,
        }

    record.row(table, {"starts": count}, make)


def _start_with_passage(random: np.random.Generator) -> tuple[float, float]:
    """A start with at least 0.5 rad/s at the fold."""
    while True:
        theta, omega = float(random.uniform(0.0, 2.0 * math.pi)), float(random.uniform(-5.0, 5.0))
        energy = (1 / 3 + math.sin(theta) ** 2) * omega**2 + 9.81 * math.sin(theta)
        squares = [(energy - 9.81 * s) / (4 / 3) for s in (1.0, -1.0)]
        if all(x <= 0.0 or x >= 0.25 for x in squares):
            return theta, omega


def folding_links(theta: float, omega: float) -> System:
    """Crank and rod, 1 m and 1 kg each, the rod's end on the x axis, on the branch theta2 = -theta1."""
    from gearfe.multibody import Slot

    c, s = math.cos(theta), math.sin(theta)
    bodies = (
        Body("crank", 1.0, 1 / 12, (0.5, 0.0), (0.0, 0.0), theta, (0.0, 0.0), omega),
        Body("rod", 1.0, 1 / 12, (0.5, 0.0), (c, s), -theta, (-s * omega, c * omega), -omega),
    )
    joints = (
        Hinge("crank", "ground", name="O"),
        Hinge("crank", "rod", (1.0, 0.0), (0.0, 0.0), name="A"),
        Slot("rod", "ground", (1.0, 0.0), name="B"),
    )
    return System([Linkage(bodies, joints, (Gravity((0.0, -9.81)),))])


def others(record: Record) -> None:
    """The same mechanisms by other programs, in the same table."""
    table = record.table("mechanism_tolerance", "mechanism", "program", "method", "tolerance")
    for peer in PEERS:
        why = missing(peer)
        if why:
            record.say(f"  left out: {why}")
            continue
        module = f"{peer}_mechanism"
        for name in ("andrews", "slider_crank"):
            for method, tolerance in _peer_settings(peer, name, record.quick):
                key = {"mechanism": name, "program": peer, "method": method, "tolerance": tolerance}

                def make(name: str = name, method: str = method, tolerance: float = tolerance, module: str = module):  # type: ignore[no-untyped-def]
                    case = subject(name)
                    task = {"mechanism": name, "method": method, "tolerance": tolerance, "times": case.times.tolist()}
                    try:
                        answer = run_python(module, task, limit=60.0)
                    except PeerError as failure:
                        return {"error": float("nan"), "status": str(failure)}
                    angles = np.array(answer.pop("angles"))
                    right = len(angles) == len(case.truth)
                    error = float(np.abs(angles - case.truth).max()) if right else float("nan")
                    return {"error": error, **answer}

                record.row(table, key, make)


def _peer_settings(peer: str, name: str, quick: bool) -> list[tuple[str, float]]:
    """Method and tolerance (for fixed steps: the step as a part of the run).

    On the slider crank no setting of theirs keeps to the branch for long: one a method is enough to show it.
    """
    if peer == "exudyn":
        if name == "slider_crank":
            return [("trapezoidal", 5e-4)]
        return [
            (m, s) for m in ("generalized-alpha", "trapezoidal") for s in ((1e-2,) if quick else (1e-3, 2.5e-4, 6e-5))
        ]
    if peer == "sundials":
        methods = ["CVODE-Adams", "CVODE-BDF", "IDA"]
    else:
        methods = ["DOP853", "LSODA", "Radau"]
    tolerances = (1e-5,) if quick else (1e-6,) if name == "slider_crank" else (1e-6, 1e-9, 1e-12)
    return [(m, t) for m in (methods[:1] if quick else methods) for t in tolerances if (m, t) != ("Radau", 1e-12)]


def chains(record: Record) -> None:
    """Seconds of one step against the number of bodies."""
    table = record.table("mechanism_chains", "bodies")

    def make(count: int) -> Mapping[str, Any]:
        system, times = chain(count), np.linspace(0.0, 0.02 if record.quick else 1.0, 3)
        run = lambda: integrate(system, times, method="taylor", tolerance=1e-9)  # noqa: E731
        run()
        made, cost = measured(run, runs=1 if record.quick else 5, most_s=3.0)
        steps = int(made.statistics["steps"])
        return {"steps": steps, **cost.columns, "us_a_step": 1e6 * cost.cpu_s / steps, "status": made.message}

    for count in QUICK_CHAINS if record.quick else CHAINS:
        record.row(table, {"bodies": count}, partial(make, count))


CALL = """
import sys, time
from gearfe.mechanisms import load_mechanism
from gearfe.multibody import integrate
import numpy as np
m = load_mechanism(sys.argv[1])
start, times = m.start(), np.linspace(0.0, 0.03, 301)
def call():
    t = time.process_time()
    integrate(m.system, times, tolerance=1e-9, start=start).q
    return time.process_time() - t
first = call()
print(first, min(call() for _ in range(int(sys.argv[2]))))
"""


def calls(record: Record) -> None:
    """Andrews' mechanism in a fresh process: the first call and later ones."""
    table = record.table("mechanism_calls", "state")
    cases = [("kernels in the cache", True), ("kernels compiled", False)]
    for state, keep in cases[:1] if record.quick else cases:

        def make(keep: bool = keep) -> Mapping[str, Any]:
            with tempfile.TemporaryDirectory(prefix="gearfe-cache-") as empty:
                env = dict(os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
                if not keep:
                    env["GEARFE_CACHE"] = empty
                again = "1" if record.quick else "20"
                command = [sys.executable, "-c", CALL, str(Path(GEOMETRY / "andrews.toml")), again]
                done = subprocess.run(command, check=True, capture_output=True, text=True, env=env, timeout=900)
            first, later = (float(x) for x in done.stdout.split())
            return {"first_call_cpu_s": first, "later_call_cpu_s": later}

        record.row(table, {"state": state}, make)
