#!/usr/bin/env python3
"""Time both integrators and the rule of `method = "auto"` on scenes of every kind.

Writes docs/development/integrators.md.

Of each scene: fastest decay d over fastest vibration w at the start, d times the duration T, processor seconds of
`taylor` and `implicit` at the same tolerance (kernels loaded before; the least of three runs where these are short),
and what a run by the rule ends with and takes. A run is ended after `--patience` seconds.

Usage: python scripts/benchmarks/measure_rule.py [--patience 4] [--only TEXT]
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gearfe.drivetrain.gearbox.job import job_train, read_train_job
from gearfe.drivetrain.train import Bearing, Damping, build_train
from gearfe.gears.gearmesh.periodic import periodic_interpolant
from gearfe.mechanisms import load_mechanism
from gearfe.multibody import Body, CoordinateSpring, Gravity, Hinge, Linkage, Moment, Slot, Spring, System, constant
from gearfe.multibody.core.modes import fastest_rate
from gearfe.multibody.core.start import Start, consistent_start
from gearfe.multibody.integrators.integrate import DECAYED, DECAYED_MODAL, OVERDAMPED, _run, integrate
from gearfe.multibody.planar.beam import Beam
from gearfe.multibody.planar.beam_link import BeamLink, Section

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "development" / "integrators.md"
GRAVITY = Gravity((0.0, -9.81))
#: So many runs of those below so many seconds.
RUNS, SHORT = 3, 0.1


class Scene(NamedTuple):
    """A system, its start, the duration (s), and the tolerance."""

    kind: str
    name: str
    system: System
    start: Start
    duration: float
    tolerance: float


def planar(kind: str, name: str, parts: tuple[Any, Any, Any], duration: float, tolerance: float = 1e-9) -> Scene:
    """A planar mechanism of bodies, joints and forces."""
    bodies, joints, forces = parts
    system = System([Linkage(tuple(bodies), tuple(joints), tuple(forces))])
    return Scene(kind, name, system, consistent_start(system), duration, tolerance)


def bar(name: str, angle: float, at: tuple[float, float], mass: float = 1.0, rate: float = 0.0) -> Body:
    """A uniform bar of 1 m from a point, the speed of its start zero."""
    return Body(name, mass, mass / 12, (0.5, 0.0), at, angle, (0.0, 0.0), rate)


def rod(*forces: Any) -> tuple[Any, Any, Any]:
    """A hinged bar under gravity and other forces."""
    return [bar("rod", 0.3, (0.0, 0.0))], [Hinge("rod", "ground")], [GRAVITY, *forces]


def chain(count: int, k: float = 0.0, c: float = 0.0) -> tuple[Any, Any, Any]:
    """Hanging bars with torsion springs (N m/rad) and dampers (N m s/rad) in their joints."""
    bodies, joints, forces = [], [], [GRAVITY]
    x = y = 0.0
    for i in range(count):
        angle = -math.pi / 2 + 0.3 * (-1) ** i
        bodies.append(bar(f"r{i}", angle, (x, y)))
        before = f"r{i - 1}" if i else "ground"
        joints.append(Hinge(before, f"r{i}", (1.0, 0.0) if i else (0.0, 0.0)))
        x, y = x + math.cos(angle), y + math.sin(angle)
        if k or c:
            reference = angle - (bodies[-2].angle if i else 0.0)
            forces.append(CoordinateSpring(f"r{i}", "angle", k, c, reference, before))
    return bodies, joints, forces


def loops(count: int, k: float = 0.0, c: float = 0.0) -> tuple[Any, Any, Any]:
    """`count` four-bar loops in a row, 2 count + 1 bodies; a spring and damper turn the first bar."""
    angle = 1.2
    tip = (math.cos(angle), math.sin(angle))
    bodies = [bar(f"b{i}", angle, (float(i), 0.0), rate=-1.0) for i in range(count + 1)]
    couplers = [
        Body(f"c{i}", 1.0, 1 / 12, (0.5, 0.0), (i + tip[0], tip[1]), 0.0, (tip[1], -tip[0])) for i in range(count)
    ]
    joints = [Hinge(f"b{i}", "ground", (0.0, 0.0), (float(i), 0.0)) for i in range(count + 1)]
    for i in range(count):
        joints += [Hinge(f"c{i}", f"b{i + j}", (float(j), 0.0), (1.0, 0.0)) for j in range(2)]
    forces = [GRAVITY, *([CoordinateSpring("b0", "angle", k, c, angle)] if k or c else [])]
    return [*bodies, *couplers], joints, forces


def slider_crank(k: float, c: float, mass: float = 2.0) -> tuple[Any, Any, Any]:
    """Crank and rod of 2 m, a torsion spring and damper on the crank."""
    angle, length = 0.8, 2.0
    other = -math.asin(math.sin(angle) / length)
    crank = bar("crank", angle, (0.0, 0.0))
    coupler = Body("coupler", mass, mass * 4 / 12, (1.0, 0.0), (math.cos(angle), math.sin(angle)), other)
    joints = [
        Hinge("crank", "ground"),
        Hinge("crank", "coupler", (1.0, 0.0), (0.0, 0.0)),
        Slot("coupler", "ground", (length, 0.0)),
    ]
    return [crank, coupler], joints, [GRAVITY, CoordinateSpring("crank", "angle", k, c, angle)]


ROD = """
[run]
end_s = 1.0
step_s = 0.1
[bodies.rod]
mass_kg = 2.0
inertia_kg_m2 = 0.5
angle_deg = 30.0
rate_rad_per_s = 1.0
[joints.O]
type = "hinge"
body = "rod"
[forces.drive]
type = "moment"
body = "rod"
moment_N_m = "{load}"
"""
CAM = """
[run]
end_s = 1.0
step_s = 0.1
[bodies.cam]
mass_kg = 1.0
inertia_kg_m2 = 0.01
rate_rad_per_s = 20.0
[bodies.follower]
mass_kg = 0.5
inertia_kg_m2 = 0.01
[joints.bearing]
type = "hinge"
body = "cam"
[joints.guide]
type = "prismatic"
body = "follower"
direction = [0.0, 1.0]
[joints.contact]
type = "cam"
body = "follower"
to = "cam"
coordinate = "y"
profile = "lift"
[tables.lift]
file = "lift.csv"
x = "angle"
y = "lift"
interpolation = "periodic"
[forces.spring]
type = "coordinate_spring"
body = "follower"
coordinate = "y"
stiffness_N_per_m = 400.0
damping_N_s_per_m = {damping}
"""


def written(kind: str, name: str, text: str, duration: float, tolerance: float = 1e-8) -> Scene:
    """A mechanism file."""
    with tempfile.TemporaryDirectory() as folder:
        angle = np.linspace(0.0, 2.0 * math.pi, 49)
        rows = "\n".join(f"{a},{0.02 * (1.0 - math.cos(a))}" for a in angle)
        (Path(folder) / "lift.csv").write_text("angle,lift\n" + rows + "\n", encoding="utf-8", newline="\n")
        path = Path(folder) / "mechanism.toml"
        path.write_text(text, encoding="utf-8", newline="\n")
        made = load_mechanism(path)
    return Scene(kind, name, made.system, made.start(), duration, tolerance)


def smooth() -> Iterator[Callable[[], Scene]]:
    """Rigid mechanisms without springs, and with springs that are not damped."""
    kind = "rigid, smooth"
    yield lambda: planar(kind, "swinging bar", rod(), 20.0)
    yield lambda: planar(kind, "double pendulum", chain(2), 5.0)
    yield lambda: planar(kind, "chain of 10", chain(10), 1.0)
    yield lambda: planar(kind, "bar under a constant moment", rod(Moment("rod", constant(5.0))), 10.0)
    kind = "closed loops"
    for count, duration in ((2, 4.0), (5, 2.0), (15, 1.0), (40, 0.5)):
        yield lambda count=count, duration=duration: planar(kind, f"{count} loops", loops(count), duration)
    kind = "light links"
    yield lambda: planar(kind, "slider crank, rod of 1e-9 kg", slider_crank(10.0, 0.0, 1e-9), 1.0)
    yield lambda: planar(kind, "slider crank, rod of 1e-9 kg, damper 1e5", slider_crank(10.0, 1e5, 1e-9), 10.0, 1e-6)
    kind = "stiff springs"

    yield lambda: planar(kind, "bar, torsion spring 1e6", rod(CoordinateSpring("rod", "angle", 1e6, 0.0, 0.1)), 0.5)
    yield lambda: planar(
        kind, "bar, spring 1e9 N/m", rod(Spring("rod", "ground", (1.0, 0.0), (1.0, 1.0), 1e9, 0.0, 0.7)), 0.02
    )
    yield lambda: planar(kind, "chain of 5, springs 1e4", chain(5, 1e4, 0.0), 0.2)
    yield lambda: planar(kind, "5 loops, spring 1e6", loops(5, 1e6, 0.0), 0.3)
    yield lambda: planar(
        kind, "bar, spring 1e6, damping 10 %", rod(CoordinateSpring("rod", "angle", 1e6, 115.0, 0.1)), 0.5
    )


def damped() -> Iterator[Callable[[], Scene]]:
    """From a decay over a few hundred time constants to one over many millions."""
    kind = "dampers"
    for c, duration in ((1e2, 1.0), (1e3, 10.0), (1e4, 10.0), (1e5, 10.0), (1e6, 10.0), (1e7, 10.0)):
        spring = CoordinateSpring("rod", "angle", 10.0, c, 0.1)
        yield lambda spring=spring, c=c, duration=duration: planar(
            kind, f"bar, damper {c:g}", rod(spring), duration, 1e-7
        )
    for c in (1e3, 1e5):
        yield lambda c=c: planar(kind, f"chain of 4, dampers {c:g}", chain(4, 10.0, c), 2.0, 1e-6)
    for c in (1e4, 1e6):
        yield lambda c=c: planar(kind, f"slider crank, damper {c:g}", slider_crank(100.0, c), 10.0, 1e-7)
    yield lambda: planar(kind, "15 loops, damper 1e6", loops(15, 100.0, 1e6), 10.0, 1e-6)
    yield lambda: planar(kind, "40 loops, damper 1e5", loops(40, 100.0, 1e5), 2.0, 1e-6)


def nonlinear() -> Iterator[Callable[[], Scene]]:
    """Friction, cams, stops."""
    kind = "friction"
    for width in (1e-2, 1e-4):
        text = ROD.format(load=f"10*sin(3*time) - 0.6*tanh(rate(rod)/{width:g})")
        yield lambda text=text, width=width: written(kind, f"bar, 0.6 tanh(rate/{width:g})", text, 2.0, 1e-6)
    yield lambda: written(kind, "bar, oil film 1e5", ROD.format(load="-1e5*rate(rod)"), 20.0, 1e-6)
    kind = "cams"
    yield lambda: written(kind, "free cam", CAM.format(damping=0.0), 1.0)
    yield lambda: written(kind, "free cam, damper 1e4", CAM.format(damping=1e4), 1.0)
    kind = "contact stops"
    stop = "-{k}*max(0, angle(rod) - 0.8) - {c}*rate(rod)*min(1, 100*max(0, angle(rod) - 0.8))"
    yield lambda: written(kind, "stop 1e4", ROD.format(load=stop.format(k="1e4", c="0")), 2.0, 1e-7)
    yield lambda: written(kind, "stop 1e6, damped", ROD.format(load=stop.format(k="1e6", c="300")), 2.0, 1e-7)


def flexible() -> Iterator[Callable[[], Scene]]:
    """Beams, which only collocation takes."""

    def made(name: str, damping: float, duration: float) -> Scene:
        link = BeamLink("beam", 1.0, Section.rectangle(0.02, 0.02), 2e11, 7800.0, elements=2, damping=damping)
        linkage = Linkage(link.nodes(), (Hinge("beam", "ground"),), (GRAVITY,))
        system = System([linkage, Beam(linkage, link)])
        return Scene("flexible links", name, system, consistent_start(system), duration, 1e-4)

    yield lambda: made("swinging steel bar", 0.0, 0.2)
    yield lambda: made("swinging steel bar, damped", 1e-4, 0.5)


def trains() -> Iterator[Callable[[], Scene]]:
    """Shafts and gears of the shipped train in a rigid housing, with Rayleigh damping, on bearings."""
    job = read_train_job(ROOT / "geometry" / "gear_train.toml", "operating")
    phase = 2 * math.pi / 20 * np.arange(40) / 40
    curve = periodic_interpolant(phase, 1.1e8 * (1 + 0.15 * np.cos(20 * phase)), 2 * math.pi / 20)

    def made(name: str, duration: float, *, bearing: Any = None, **more: Any) -> Scene:
        train = job_train(replace(job, table=replace(job.table, housing="rigid")), (1.1e8, 1.1e8), None)
        train = replace(train, meshes=tuple(replace(m, stiffness=curve) for m in train.meshes), **more)
        if bearing is not None:
            bores = [b for s in train.shafts for b in s.bores]
            train = replace(train, bearings=tuple(Bearing(b, *bearing) for b in bores))
        model = build_train(train)
        return Scene("trains", name, model.system, model.start, duration, 1e-6)

    def springs(k: float, c: float) -> Any:
        return (k, k, k, 1e-3 * k, 1e-3 * k), (c, c, c, 1e-3 * c, 1e-3 * c)

    yield lambda: made("rigid housing", 0.05)
    yield lambda: made("no damping", 0.02, damping=Damping())
    for beta in (1e-6, 1e-4, 1e-3, 1e-2):
        yield lambda beta=beta: made(f"Rayleigh damping {beta:g} s", 0.01, damping=Damping(beta=beta))
    yield lambda: made("bearings 1e9 N/m", 0.005, bearing=springs(1e9, 1e3))
    yield lambda: made("bearings 1e8 N/m, damping 1e6", 0.01, bearing=springs(1e8, 1e6))
    yield lambda: made("bearings 1e8 N/m, damping 1e8", 0.01, bearing=springs(1e8, 1e8))


def held_out() -> Iterator[Callable[[], Scene]]:
    """Scenes that the numbers of the rule were not chosen on."""
    kind = "held out"
    for load, rate in (
        ("-0.5*tanh(rate(rod)/1e-7)", 2.0),
        ("-0.6*tanh(rate(rod)/1e-3)", 0.0),
        ("sin(3*time) - 0.6*tanh(rate(rod)/1e-5)", 0.0),
        ("sin(3*time) - 0.6*tanh(rate(rod)/1e-9)", 0.0),
        ("-0.6*tanh((rate(rod) - 0.2)/1e-6) - 9*angle(rod)", 0.0),
        ("-2*rate(rod) - 5*rate(rod)**3", 3.0),
        ("-300*rate(rod)*abs(rate(rod))", 5.0),
        ("-1e4*rate(rod)*max(0, angle(rod) - 0.7)", 1.0),
        ("-1e3*tanh(angle(rod) - 0.5) - 20*rate(rod)", 1.0),
        ("4*cos(7*time) - 200*rate(rod)", 0.0),
        ("exp(-3*time) - 0.1*tanh(10*rate(rod))", 1.0),
        ("min(5, 40*(1 - angle(rod))) - 0.2*tanh(rate(rod)/1e-8)", 0.0),
    ):
        text = ROD.format(load=load).replace("rate_rad_per_s = 1.0", f"rate_rad_per_s = {rate}")
        yield lambda load=load, text=text: written(kind, load, text, 4.0, 1e-7)


def timed(scene: Scene, method: str, patience: float) -> tuple[float, str]:
    """Processor seconds of a method, infinite where it is refused, fails, or takes longer than `patience`; its name."""
    times, least = np.linspace(0.0, scene.duration, 21), math.inf
    options = {"tolerance": scene.tolerance, "longest": math.inf}
    for _ in range(RUNS):
        began = time.process_time()
        with np.errstate(all="ignore"):
            try:
                if method == "auto":
                    run = integrate(scene.system, times, start=scene.start, raise_on_failure=False, **options)
                    status, name = run.status, run.method
                else:
                    _, status, _ = _run(
                        scene.system, method, options, scene.start, times, 10**8,
                        lambda *_, began=began: time.process_time() - began < patience,
                    )  # fmt: skip
                    name = method
            except ValueError:
                return math.inf, method
        if status != 0:
            return math.inf, name
        least = min(least, time.process_time() - began)
        if least > SHORT:
            break
    return least, name


HEAD = """# Integrator selection: measurements

On {count} scenes with two methods, `method = "auto"` takes at most {worst:.2f} times the time of the better method. It
selects collocation if the fastest decay rate d exceeds {over:g} times the fastest vibration w, and d times the
duration T exceeds {decayed:g}, in trains {modal:g} ([the rule](../integrators.md)).

`scripts/benchmarks/measure_rule.py` writes the table. Times are processor seconds at the same tolerance with compiled
kernels, the least of three runs if these are short. "> x" means that the run was stopped after x seconds, or ended
early. Flexible links have only one method (a dash). The scenes "held out" were not used to
choose the numbers of the rule. Times are those of whole calls.

At the limit of d T both methods take equal times on average, but not in each scene. A damped bar takes 4 ms by series
and 13 ms by collocation, a linkage of 81 bodies 0.3 s and 0.13 s.

| kind | scene | d/w | d T | taylor (s) | implicit (s) | the rule takes | times the better |
|---|---|---|---|---|---|---|---|
"""


class Row(NamedTuple):
    """What one scene gave; seconds are infinite where a method did not reach the end."""

    kind: str
    name: str
    ratio: float  # fastest decay over fastest vibration
    decayed: float  # decay times duration
    taylor: float
    implicit: float
    auto: float
    took: str
    alone: bool  # whether there is only one method

    @property
    def times_better(self) -> float:
        """Seconds of `auto` over those of the better method, at least 1."""
        best = min(self.taylor, self.implicit)
        return 1.0 if self.alone or not math.isfinite(best) else max(1.0, self.auto / best)

    def line(self, patience: float) -> str:
        """Row of the table."""
        late = f"> {patience:g}"
        series = "-" if self.alone else late if math.isinf(self.taylor) else f"{self.taylor:.2g}"
        implicit = late if math.isinf(self.implicit) else f"{self.implicit:.2g}"
        better = f"{self.times_better:.2f}" if math.isfinite(self.times_better) else f"> {patience / self.implicit:.2g}"
        name = f"`{self.name}`" if "*" in self.name else self.name  # Markdown would take the stars as emphasis
        values = [self.kind, name, f"{self.ratio:.2g}", f"{self.decayed:.2g}", series, implicit, self.took, better]
        return f"| {' | '.join(values)} |"


def measured(scene: Scene, patience: float) -> Row:
    """One scene by both methods."""
    decay, vibration = fastest_rate(scene.system, scene.start)
    alone = any(element.stiff for element in scene.system.elements)
    ratio = decay / vibration if vibration > 0.0 else math.inf if decay > 0.0 else 0.0
    taylor = math.inf if alone else timed(scene, "taylor", patience)[0]
    implicit, (auto, took) = timed(scene, "implicit", patience)[0], timed(scene, "auto", patience)
    return Row(scene.kind, scene.name, ratio, decay * scene.duration, taylor, implicit, auto, took, alone)


def page(rows: Sequence[Row], patience: float) -> str:
    """The page of the documentation."""
    both = [row.times_better for row in rows if not row.alone and math.isfinite(min(row.taylor, row.implicit))]
    head = HEAD.format(over=OVERDAMPED, decayed=DECAYED, modal=DECAYED_MODAL, count=len(both), worst=max(both))
    return head + "".join(row.line(patience) + "\n" for row in rows)


def main() -> None:
    """Measure all scenes; write the page, or print rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--patience", type=float, default=4.0)
    parser.add_argument("--only", default="", help="print the scenes whose kind or name holds this text")
    args = parser.parse_args()
    rows = []
    for family in (smooth, damped, nonlinear, flexible, trains, held_out):
        for make in family():
            scene = make()
            if args.only in f"{scene.kind} {scene.name}":
                rows.append(measured(scene, args.patience))
                print(repr(rows[-1]) if args.only else rows[-1].line(args.patience), flush=True)
    if not args.only:
        PAGE.write_text(page(rows, args.patience), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
