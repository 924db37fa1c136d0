#!/usr/bin/env python3
"""Default settings and their error estimate against converged curves, over random legal gear pairs.

Pairs are drawn from a seed: teeth 12 to 90, module 1 to 6 mm, pressure angle 17 to 25 deg, profile shifts, sharp and
round tips, relief, bores, face widths, materials, plane states. Positions are spread over the mesh cycle, with as
many again about the pair changes; twists count from contact. The truth is the same sweep with all sizes times
--finest, by Nitsche's law on the gear whose tip is nearer: points on both would take half of the normals from a sharp
edge's own flank. A position is at a pair change when a loaded pair stands within 4 % of a base pitch of the ends of
its path, or beyond. Twists at which twist times wheel teeth exceeds --most-load deg are left out: contacts there are
wide, and fine meshes of them take minutes a position.

Usage: python scripts/benchmarks/measure_curve_accuracy.py
           [--seed 1] [--pairs 25] [--twists 0.02 0.05 0.2 0.5] [--finest 0.4]
"""

from __future__ import annotations

import argparse
import math
import sys

import numpy as np
from numpy.typing import NDArray

from gearfe import Gear, GearPair, StiffnessCurve, sweep_stiffness
from gearfe.base.errors import InputError
from gearfe.fem.plane import Material, Plane
from gearfe.gears.contact.laws import Nitsche
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.pair import TipRelief

Case = tuple[GearPair, tuple[Material, Material], Plane]


def draw(random: np.random.Generator) -> Case:
    """A legal pair, its materials and plane state."""
    while True:
        teeth = random.integers(12, 91, 2)
        module, angle = random.uniform(1e-3, 6e-3), math.radians(random.uniform(17, 25))
        try:
            pair = GearPair(*(_gear(random, int(z), module, angle) for z in teeth))
        except InputError:
            continue
        moduli, ratios = random.choice([70e9, 110e9, 200e9, 210e9], 2), random.choice([0.26, 0.3, 0.33], 2)
        materials = Material(float(moduli[0]), float(ratios[0])), Material(float(moduli[1]), float(ratios[1]))
        return pair, materials, "strain" if random.random() < 0.6 else "stress"


def _gear(random: np.random.Generator, teeth: int, module: float, angle: float) -> Gear:
    relief = None
    if random.random() < 0.35:
        amount, length = random.uniform(0.001, 0.01) * module, random.uniform(0.3, 1.2) * module
        relief = TipRelief(amount, length, float(random.choice([1.0, 1.5, 2.0])))
    return Gear(
        teeth,
        module,
        angle,
        random.uniform(5e-3, 30e-3),
        random.uniform(0.15, 0.75) * teeth * module,
        profile_shift=random.uniform(-0.2, 0.6),
        addendum=random.uniform(0.9, 1.15) if random.random() < 0.3 else 1.0,
        rack_tip_radius=float(random.choice([0.2, 0.25, 0.3, 0.38])),
        tip_round=random.uniform(0.01, 0.12) * module if random.random() < 0.5 else 0.0,
        tip_relief=relief,
        tooth_thinning=random.uniform(0, 0.03) * module if random.random() < 0.4 else 0.0,
    )


def positions(pair: GearPair, random: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Pinion angles (rad): half of them anywhere, half within 8 % of a mesh cycle of a pair change."""
    cycle = pair.mesh_cycle
    anywhere = (np.arange(count - count // 2) + random.random()) * cycle / (count - count // 2)
    changes = np.array([pair.path[name].pinion_angle for name in ("B", "D")])
    near = np.resize(changes, count // 2) + random.uniform(-1, 1, count // 2) ** 3 * 0.08 * cycle
    return np.sort(np.mod(np.concatenate([anywhere, near]), cycle))


def at_change(pair: GearPair, curve: StiffnessCurve) -> NDArray[np.bool_]:
    """Positions with a loaded pair near or beyond an end of its path."""
    start, end = pair.path_limits()
    margin = 0.04 * pair.base_pitch
    number = curve.leading_pair[:, None] - np.arange(curve.load_share.shape[1])
    roll = pair.pinion_roll_at(curve.pinion_angle[:, None] + number * pair.mesh_cycle)  # type: ignore[arg-type]
    off = (roll < start + margin) | (roll > end - margin)
    return np.asarray((off & (curve.load_share > 0)).any(axis=1))


def main() -> None:
    """Run the campaign and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=25)
    parser.add_argument("--positions", type=int, default=18)
    parser.add_argument("--twists", type=float, nargs="+", default=[0.02, 0.05, 0.2, 0.5], help="deg")
    parser.add_argument("--law", default="half_plane", help="law that is measured; the truth is by Nitsche's")
    parser.add_argument("--finest", type=float, default=0.4, help="factor on all sizes for the truth")
    parser.add_argument("--most-load", type=float, default=6.0, help="twist (deg) times wheel teeth")
    args = parser.parse_args()
    random = np.random.default_rng(args.seed)
    rows: dict[str, list[NDArray[np.float64]]] = {"path": [], "pair change": []}
    failed = 0
    print("| pair | plane | twist (deg) | error on the path | at pair changes | estimate covers |")
    print("|---|---|---|---|---|---|")
    for _ in range(args.pairs):
        pair, materials, plane = draw(random)
        angles = positions(pair, random, args.positions)
        coarse = elastic_pair(pair, materials=materials, plane=plane, law=args.law)
        fine = elastic_pair(pair, materials=materials, plane=plane, law=Nitsche(sides="tip"), coarsen=args.finest)
        for twist in args.twists:
            if twist * pair.wheel.teeth > args.most_load:
                continue
            given = {"twist": math.radians(twist), "angles": angles, "kinematics": "small", "twist_from": "contact"}
            curve = sweep_stiffness(pair, elastic=coarse, estimate_error=True, **given)
            truth = sweep_stiffness(pair, elastic=fine, **given)
            known = np.isfinite(curve.relative_error)
            estimate = np.interp(angles, angles[known], curve.relative_error[known])
            true = np.abs(curve.k_mesh / truth.k_mesh - 1)
            good, change = np.isfinite(true) & np.isfinite(estimate), at_change(pair, curve)
            failed += int((~good & ~np.isin(curve.status, ["no_contact"])).sum())
            said = []
            for name, chosen in (("path", good & ~change), ("pair change", good & change)):
                rows[name].append(np.stack([true[chosen], estimate[chosen]]))
                said.append(f"{100 * true[chosen].max():.3f} %" if chosen.any() else "-")
            covered = f"{int((estimate >= true)[good].sum())} of {int(good.sum())}"
            teeth = f"{pair.pinion.teeth}/{pair.wheel.teeth}"
            print(f"| {teeth} | {plane} | {twist:g} | {said[0]} | {said[1]} | {covered} |", flush=True)
    every = {name: np.concatenate(parts, axis=1) for name, parts in rows.items() if parts}
    every["all"] = np.concatenate(list(every.values()), axis=1)
    print("\n| positions | number | error: median | 95 % | largest | estimate covers | estimate/error: median |")
    print("|---|---|---|---|---|---|---|")
    for name, (true, estimate) in every.items():
        if len(true):
            ratio = np.median(estimate / np.maximum(true, 1e-9))
            print(
                f"| {name} | {len(true)} | {100 * np.median(true):.3f} % | {100 * np.percentile(true, 95):.3f} % | "
                f"{100 * true.max():.3f} % | {100 * np.mean(estimate >= true):.1f} % | {ratio:.1f} |"
            )
    print(
        f"\nseed {args.seed}; {failed} positions without a value on either mesh; truth at {args.finest:g} of all sizes"
    )


if __name__ == "__main__":
    sys.exit(main())
