"""Beams of elastic shafts: errors against exact solutions, seconds, and ROSS on the same rotor if it is installed.

    python scripts/benchmarks/measure_shafts.py --runs 5

The exact solutions integrate the differential equations of Timoshenko's beam (tests/makers/exact_beam.py). Seconds
are of the processor, the least of the runs, the model built anew in each. ROSS (ross-rotordynamics on PyPI) takes its
defaults; its elements double until no error of the ten lowest whirl frequencies exceeds 1e-6 or there are too many.
Prints tables in Markdown.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from gearfe.base.typing import Array
from gearfe.fem.beams import BeamShaft, Disc, Section, Support, reduce_shaft, whirl_frequencies
from gearfe.fem.beams.elements import divide
from tests.makers.exact_beam import bar_determinant, bending_determinant, zeros

YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0

#: Error that counts as exact enough (relative), and the most elements that ROSS is given.
BOUND, MOST = 1e-6, 100

#: Spins of the rotor (rad/s), and how many of its whirl frequencies count.
SPEEDS, WHIRLS = (0.0, 100.0, 300.0, 600.0, 1200.0), 10


def section(length: float, outer: float, inner: float = 0.0) -> Section:
    """A steel cylinder."""
    return Section(length, outer, outer, inner, inner, YOUNG, POISSON, DENSITY)


UNIFORM = BeamShaft(0.0, (section(1.0, 0.05),))
STEPPED = BeamShaft(0.0, (section(0.15, 0.03), section(0.35, 0.06), section(0.2, 0.05, 0.02), section(0.1, 0.025)))
OVERHUNG = BeamShaft(
    0.0, (section(0.4, 0.04), section(0.2, 0.03)), (Disc(0.6, 12.0, 0.09, 0.048), Disc(0.25, 3.0, 0.01, 0.006))
)
SUPPORTS = (Support(0.05, 5e7), Support(0.4, 8e7))


def least_seconds(action: Callable[[], Any], runs: int) -> tuple[Any, float]:
    """Result of an action and the least processor seconds of the runs, after one that is not counted."""
    result, spent = action(), math.inf
    for _ in range(runs):
        began = time.process_time()
        result = action()
        spent = min(spent, time.process_time() - began)
    return result, spent


def free_beams(runs: int) -> list[str]:
    """Table of the first ten frequencies of free beams in bending, axial motion and torsion."""
    lines = ["| free beam | bending | axial | torsion | elements | s |", "|---|---|---|---|---|---|"]
    for name, shaft in (("uniform, 50 mm, 1 m", UNIFORM), ("stepped, one section hollow, 0.8 m", STEPPED)):
        exact = {"bending e1": zeros(partial(bending_determinant, shaft, {}, 0.0), 300.0, 2e5, 600)[:10]}
        for kind in ("axial", "torsion"):
            exact[kind] = zeros(partial(bar_determinant, shaft, kind), 300.0, 6e5, 1000)[:10]
        highest = 1.001 * max(values[-1] for values in exact.values()) / (2.0 * math.pi)
        reduced, spent = least_seconds(partial(reduce_shaft, shaft, np.eye(3), highest), runs)
        errors = []
        for kind, values in exact.items():
            ours = reduced.frequencies_hz[np.array(reduced.kinds) == kind][:10]
            errors.append(f"{np.abs(2.0 * math.pi * ours / values - 1.0).max():.0e}")
        lines.append(f"| {name} | {' | '.join(errors)} | {reduced.elements} | {spent:.3f} |")
    return lines


def whirl_determinant(springs: dict[float, tuple[float, float]], speed: float, sense: float, w: Array) -> Array:
    """Determinants of the rotor that whirls at w (rad/s) in one sense."""
    return bending_determinant(OVERHUNG, springs, speed, sense * w)


def exact_whirls() -> list[Array]:
    """The lowest whirl frequencies of the overhung rotor at all speeds, without their senses (rad/s)."""
    springs = {support.along: (support.radial, support.tilt) for support in SUPPORTS}
    found = []
    for speed in SPEEDS:
        both = [zeros(partial(whirl_determinant, springs, speed, sense), 50.0, 2e4, 600) for sense in (1.0, -1.0)]
        found.append(np.sort(np.concatenate(both))[:WHIRLS])
    return found


def ross_whirls(ross: Any, count: int) -> list[Array]:
    """Frequencies of ROSS's model with about `count` elements at all speeds (rad/s)."""
    steel = ross.Material(name="steel", rho=DENSITY, E=YOUNG, Poisson=POISSON)
    cuts, diameters = (0.0, 0.05, 0.25, 0.4, 0.6), (0.04, 0.04, 0.04, 0.03)
    elements, nodes = [], [0]
    for left, right, diameter in zip(cuts[:-1], cuts[1:], diameters, strict=True):
        pieces = max(1, round(count * (right - left) / 0.6))
        elements += [ross.ShaftElement((right - left) / pieces, 0.0, diameter, material=steel) for _ in range(pieces)]
        nodes.append(len(elements))
    discs = [ross.DiskElement(nodes[4], 12.0, 0.048, 0.09), ross.DiskElement(nodes[2], 3.0, 0.006, 0.01)]
    # the axial spring keeps its matrices regular
    bearings = [
        ross.BearingElement(nodes[1], kxx=5e7, cxx=0.0, kzz=1e6),
        ross.BearingElement(nodes[3], kxx=8e7, cxx=0.0),
    ]
    rotor = ross.Rotor(elements, discs, bearings)
    return [np.abs(rotor.run_modal(speed, num_modes=40).evalues.imag) for speed in SPEEDS]


def worst(found: list[Array], exact: list[Array]) -> float:
    """Largest relative distance of an exact frequency from the nearest one found."""
    return max(
        float(np.abs(np.abs(values)[:, None] / wanted - 1.0).min(axis=0).max())
        for values, wanted in zip(found, exact, strict=True)
    )


def overhung_rotor(runs: int) -> Iterator[str]:
    """Table of the overhung rotor: this program, then ROSS with more and more elements."""
    exact = exact_whirls()
    highest = 1.001 * max(values[-1] for values in exact) / (2.0 * math.pi)
    ours, spent = least_seconds(partial(whirl_frequencies, OVERHUNG, SUPPORTS, SPEEDS, highest), runs)
    error = worst([2.0 * math.pi * values for values in ours], exact)
    yield from ("| program | elements | largest error | s | times ours |", "|---|---|---|---|---|")
    yield f"| gearfe | {len(divide(OVERHUNG, highest).degrees)} | {error:.0e} | {spent:.4f} | 1 |"
    if importlib.util.find_spec("ross") is None:
        yield "\nROSS is not installed (ross-rotordynamics): not compared."
        return
    ross = importlib.import_module("ross")
    count, error = 12, math.inf
    while error > BOUND and count <= MOST:
        found, theirs = least_seconds(partial(ross_whirls, ross, count), 2)
        error = worst(found, exact)
        yield f"| ROSS {ross.__version__} | {count} | {error:.0e} | {theirs:.2f} | {theirs / spent:.0f} |"
        count *= 2


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="how often each model is built and solved")
    args = parser.parse_args()
    for line in (*free_beams(args.runs), ""):
        print(line)
    for line in overhung_rotor(args.runs):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
