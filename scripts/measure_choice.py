#!/usr/bin/env python3
"""What `method = "auto"` costs beside each method by itself, over mechanisms and trains from soft to stiff.

A method by itself is ended when it has spent `--patience` times what auto took (and two seconds at least). Seconds of
processor time at the same tolerance, kernels and libraries loaded before; the least of three
runs where these are short. The housing of "shipped train" is that of the job; its meshes have a given stiffness.

Usage: python scripts/measure_choice.py [--patience 1.5] [--only TEXT]
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gearfe.mechanisms import load_mechanism
from gearfe.rigid import Body, CoordinateSpring, Gravity, Hinge, Linkage, ModalBlocks, Slot, Spring, System
from gearfe.rigid.integrate import integrate, ways_of
from gearfe.rigid.modal import series_force
from gearfe.rigid.start import Start, consistent_start
from gearfe.stiffness.periodic import periodic_interpolant
from gearfe.train import Bearing, Damping, build_train
from gearfe.vibration.job import job_train, read_train_job, train_body

GEOMETRY = Path(__file__).resolve().parents[1] / "geometry"
GRAVITY = Gravity((0.0, -9.81))
LEAST_PATIENCE = 2.0
#: So many runs of those below so many seconds.
RUNS, SHORT = 3, 0.5


class Case(NamedTuple):
    """A system, its start, the end of the run (s), and the tolerance."""

    name: str
    system: System
    start: Start
    end: float
    tolerance: float


def planar(name: str, bodies: Any, joints: Any, forces: Any, end: float, tolerance: float = 1e-9) -> Case:
    """A planar mechanism."""
    system = System([Linkage(tuple(bodies), tuple(joints), tuple(forces))])
    return Case(name, system, consistent_start(system), end, tolerance)


def rod(angle: float = 0.3) -> Body:
    """1 kg, 1 m."""
    return Body("rod", 1.0, 1 / 12, (0.5, 0.0), (0.0, 0.0), angle)


def sprung_rod(name: str, k: float, c: float, end: float, tolerance: float = 1e-9) -> Case:
    """A rod on a torsion spring (N m/rad) and damper (N m s/rad), under gravity."""
    forces = (GRAVITY, CoordinateSpring("rod", "angle", k, c, 0.1))
    return planar(name, [rod()], [Hinge("rod", "ground")], forces, end, tolerance)


def bar(name: str, k: float, c: float, end: float) -> Case:
    """A hinged rod held at its end by a spring (N/m) and damper (N s/m) to the ground."""
    spring = Spring("rod", "ground", (1.0, 0.0), (1.0, 1.0), k, c, 0.7)
    return planar(name, [rod()], [Hinge("rod", "ground")], [GRAVITY, spring], end)


def slider_crank(name: str, k: float, c: float, end: float) -> Case:
    """Crank and rod, a torsion spring on the crank, the slider on the ground."""
    angle, length = 0.8, 2.0
    other = -math.asin(math.sin(angle) / length)
    crank = Body("crank", 1.0, 1 / 12, (0.5, 0.0), (0.0, 0.0), angle)
    coupler = Body("coupler", 2.0, 8 / 12, (1.0, 0.0), (math.cos(angle), math.sin(angle)), other)
    joints = (
        Hinge("crank", "ground"),
        Hinge("crank", "coupler", (1.0, 0.0), (0.0, 0.0)),
        Slot("coupler", "ground", (length, 0.0)),
    )
    return planar(name, [crank, coupler], joints, (GRAVITY, CoordinateSpring("crank", "angle", k, c)), end)


def chain(name: str, count: int, k: float, c: float, end: float) -> Case:
    """Hanging rods with torsion springs and dampers in their joints."""
    bodies, joints, forces = [], [], [GRAVITY]
    x = y = 0.0
    for i in range(count):
        angle = -math.pi / 2 + 0.3 * (-1) ** i
        bodies.append(Body(f"r{i}", 1.0, 1 / 12, (0.5, 0.0), (x, y), angle))
        before = f"r{i - 1}" if i else "ground"
        joints.append(Hinge(before, f"r{i}", (1.0, 0.0) if i else (0.0, 0.0)))
        x, y = x + math.cos(angle), y + math.sin(angle)
        if k or c:
            reference = angle - (bodies[-2].angle if i else 0.0)
            forces.append(CoordinateSpring(f"r{i}", "angle", k, c, reference, before))
    return planar(name, bodies, joints, forces, end, 1e-8)


def mechanisms() -> Iterator[Callable[[], Case]]:
    """From no spring to overcritical damping."""

    def file(name: str, end: float) -> Case:
        made = load_mechanism(GEOMETRY / f"{name}.toml")
        return Case(f"{name}, {end:g} s", made.system, made.start(), end, 1e-9)

    inertia = 1 / 12 + 1 / 4
    yield lambda: file("andrews", 0.03)
    yield lambda: file("slider_crank", 10.0)
    yield lambda: sprung_rod("rod, k 10, no damping, 1000 s", 10.0, 0.0, 1000.0)
    yield lambda: sprung_rod("rod, k 1e6, no damping", 1e6, 0.0, 10.0)
    yield lambda: sprung_rod("rod, k 1e6, damping 1 %", 1e6, 0.02 * math.sqrt(1e6 * inertia), 10.0)
    yield lambda: sprung_rod("rod, k 1e6, critical damping", 1e6, 2 * math.sqrt(1e6 * inertia), 10.0)
    yield lambda: sprung_rod("rod, k 1e4, damping 1e5 (overcritical)", 1e4, 1e5, 10.0)
    yield lambda: sprung_rod("rod, k 1e9, damping 1e6 (overcritical)", 1e9, 1e6, 1.0)
    yield lambda: sprung_rod("rod, k 1, damping 1e4, loose tolerance", 1.0, 1e4, 100.0, 1e-5)
    yield lambda: bar("bar, spring 1e9 N/m, damping 10", 1e9, 10.0, 10.0)
    yield lambda: bar("bar, spring 1e9 N/m, damping 1e6", 1e9, 1e6, 10.0)
    yield lambda: slider_crank("slider crank, torsion spring 1e4", 1e4, 0.0, 1.0)
    yield lambda: slider_crank("slider crank, torsion spring 1e4, damping 1e5", 1e4, 1e5, 100.0)
    yield lambda: chain("chain of 5, no springs", 5, 0.0, 0.0, 5.0)
    yield lambda: chain("chain of 5, joints 1e5, damping 30", 5, 1e5, 30.0, 5.0)
    yield lambda: chain("chain of 3, joints 10, damping 1e4", 3, 10.0, 1e4, 10.0)


def trains() -> Iterator[Callable[[], Case]]:
    """The shipped shafts and gears in a rigid housing, in the elastic one, on bearings."""
    job = read_train_job(GEOMETRY / "gear_train.toml", "operating")
    phase = 2 * math.pi / 20 * np.arange(40) / 40
    curve = periodic_interpolant(phase, 1.1e8 * (1 + 0.15 * np.cos(20 * phase)), 2 * math.pi / 20)

    def case(
        name: str, end: float, *, elastic: bool = False, bearing: Any = None, tolerance: float = 1e-6, **more: Any
    ) -> Case:
        own = job if elastic else replace(job, table=replace(job.table, housing="rigid"))
        train = job_train(own, (1.1e8, 1.1e8), train_body(own) if elastic else None)
        train = replace(train, meshes=tuple(replace(m, stiffness=curve) for m in train.meshes), **more)
        if bearing is not None:
            bores = [b for s in train.shafts for b in s.bores]
            train = replace(train, bearings=tuple(Bearing(b, *bearing) for b in bores))
        model = build_train(train)
        return Case(name, model.system, model.start, end, tolerance)

    def springs(k: float, c: float) -> Any:
        return (k, k, k, 1e-3 * k, 1e-3 * k), (c, c, c, 1e-3 * c, 1e-3 * c)

    none = Damping()
    yield lambda: case("shipped train, 7 ms", 0.007, elastic=True)
    yield lambda: case("shipped train, 300 ms", 0.3, elastic=True)
    yield lambda: case("rigid housing, 1 s", 1.0)
    yield lambda: case("rigid housing, no damping, 0.1 s", 0.1, damping=none)
    yield lambda: case("bearings 1e8 N/m, no damping, 0.1 s", 0.1, bearing=springs(1e8, 0.0), damping=none)
    yield lambda: case("bearings 1e11 N/m, damping 1e4", 0.02, bearing=springs(1e11, 1e4))
    yield lambda: case("bearings 1e8 N/m, damping 1e7 (overcritical)", 0.01, bearing=springs(1e8, 1e7))
    yield lambda: case("bearings 1e9 N/m, damping 1e8, loose", 0.01, bearing=springs(1e9, 1e8), tolerance=1e-3)
    yield lambda: case("Rayleigh damping 1e-2 s", 0.02, damping=Damping(beta=1e-2))


def others() -> Iterator[Callable[[], Case]]:
    """Modal bodies, which no series covers."""

    def case(name: str, damping: float, stiffness: float, end: float) -> Case:
        C, K = np.diag([damping, 0.0]), np.diag([stiffness, 40.0])
        system = System([ModalBlocks(np.eye(2), C, K, q0=np.array([1.0, 1.0]))])
        return Case(name, system, consistent_start(system), end, 1e-6)

    yield lambda: case("modal body, decay 2e6 1/s", 2e6, 1e6, 3.0)
    yield lambda: case("modal body, 1 kHz, no damping", 0.0, 4e7, 1.0)


def alone(case: Case, times: np.ndarray, method: str, patience: float) -> tuple[float, bool]:
    """(seconds, whether it came to the end) of one method by itself."""
    backend = "auto" if case.system.linkage is None or method == "implicit" else "compiled"
    options = {"tolerance": case.tolerance, "longest": math.inf}
    way = ways_of(case.system, case.start, times, method, backend, options)[0]
    began = time.process_time()
    made = way.run(case.start, times, 10**9, lambda *_: time.process_time() - began < patience)
    return time.process_time() - began, made[1] == 0


def chosen(case: Case, times: np.ndarray) -> tuple[float, Any]:
    """(seconds, trajectory) of auto."""
    began = time.process_time()
    made = integrate(case.system, times, start=case.start, tolerance=case.tolerance, raise_on_failure=False)
    return time.process_time() - began, made


def least(run: Callable[[], tuple[float, Any]]) -> tuple[float, Any]:
    """The run with the fewest seconds: of three where they are short."""
    found = [run()]
    while len(found) < RUNS and found[0][0] < SHORT:
        found.append(run())
    return min(found, key=lambda one: one[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--patience", type=float, default=1.5)
    parser.add_argument("--only", default="", help="cases whose name holds this text")
    args = parser.parse_args()
    warm = planar("", [rod()], [Hinge("rod", "ground")], [GRAVITY], 1.0)
    alone(warm, np.array([0.0, 1.0]), "taylor", 1e9)
    alone(warm, np.array([0.0, 1.0]), "implicit", 1e9)
    first = next(trains())()
    alone(first, np.array([0.0, 1e-4]), "taylor", 1e9)
    print("| case | series or Runge-Kutta (s) | implicit (s) | auto (s) | auto took | times the best |")
    print("|---|---|---|---|---|---|")
    worst = 0.0
    for make in (*mechanisms(), *trains(), *others()):
        case = make()
        if args.only not in case.name:
            continue
        times = np.linspace(0.0, case.end, 51)
        auto, made = least(lambda case=case, times=times: chosen(case, times))
        patience = max(args.patience * auto, LEAST_PATIENCE)
        quick = "taylor" if case.system.linkage is not None or series_force(case.system) is not None else "explicit"
        found = [least(lambda m=m: alone(case, times, m, patience)) for m in (quick, "implicit")]  # noqa: B023
        best = min((s for s, done in found if done), default=auto)
        worst = max(worst, auto / min(best, auto))
        cells = [f"{s:.3g}" if done else f"> {s:.3g}" for s, done in found]
        took = ", ".join(leg["method"].split()[0] for leg in made.statistics["choice"])
        took += "" if made.status == 0 else f" ({made.message})"
        print(f"| {case.name} | {' | '.join(cells)} | {auto:.3g} | {took} | {auto / min(best, auto):.2f} |", flush=True)
    print(f"\nworst: {worst:.2f}")


if __name__ == "__main__":
    main()
