"""Gear pairs, legal and illegal: each is answered, and then obeys statics and symmetry, or is refused with a reason.

Checks of an answer, at every position that was solved:

- *balance*: the contact forces on both gears cancel, and so do their moments: T_wheel + T_pinion = a F_y about current
  places, and those at undeformed places make the reactions at the wheel's bore, relative to the wheel's torque;
- *ratio*: while all loaded pairs touch on their involutes, T_wheel/T_pinion = z_wheel/z_pinion, but for what the
  bending of the teeth makes of their normals;
- *period*: one mesh cycle further the torque is the same;
- *swap*: with the gears in each other's role, in the same place, the torques are the same;
- *tangent*: d T/d twist is positive.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.base.tables.pair import DEFAULT_LAW, LAWS
from gearfe.gears.contact.compliance import MeshingPair
from gearfe.gears.contact.laws import HalfPlane
from gearfe.gears.contact.position import Positions
from gearfe.gears.gearmesh.curve import SOLVED
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.positions import ANGLE_ROUNDING, PositionSolver, position_solver
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.geometry.pair import GearPair

from .campaign import Campaign, Case
from .outcome import Check, Finding
from .pairs import (
    LARGEST_OVERLAP,
    TORQUES,
    borne_torque,
    chosen,
    invalid,
    log_uniform,
    random_pair,
    rounded,
    running_pair,
    twist_of_overlap,
)
from .toml_text import toml_text

#: Limits of the checks. These hold to the solvers' residuals, which the softest contacts amplify.
BALANCE, PERIOD, SWAP = 1e-7, 1e-7, 1e-6
#: The ratio holds as the normals at the contact do: they lean with the elements that carry it, and with the bending of
#: the teeth. That is known from another formulation, the half-plane law, whose faces are exact, and taken off for laws
#: on elements. What remains is of the second order in the faces' rotation, about 0.3 times the overlap in modules; for
#: the half-plane law itself that of first order stays.
RATIO, BENT, RATIO_BENT = 1.5e-3, 0.1, 0.3**2
#: Least overlaps (modules) that are drawn: of the half-plane law, and of laws whose elements must resolve the contact.
LIGHTEST, RESOLVED = 1e-6, 0.01


def draw(random: np.random.Generator, number: int) -> Case:
    """A random [pair] and [stiffness]: most pairs can run, one in eight jobs has a value without sense."""
    pair = random_pair(random) if random.random() < 0.15 else running_pair(random)
    cycle = 360.0 / max(8, pair["pinion"]["teeth"])
    start = rounded(random.uniform(0.0, cycle))
    sweep: dict[str, Any] = {
        "angle_start_deg": start,
        "angle_step_deg": cycle / 3,
        "angle_stop_deg": start + cycle,
        "solve_all": True,
        "twist_from": str(random.choice(["contact", "contact", "centred"])),
        "law": str(random.choice(sorted(LAWS))),
        "plane": str(random.choice(["strain", "stress"])),
        "kinematics": chosen(random, None, lambda: "small"),
        "coarsen": chosen(random, None, lambda: rounded(log_uniform(random, 0.7, 3.0), 2)),
        "flank_coarsen": chosen(random, None, lambda: rounded(log_uniform(random, 0.5, 2.0), 2)),
        "points_per_edge": chosen(random, None, lambda: int(random.choice([2, 3, 6]))),
    }
    if random.random() < 0.5:
        least = LIGHTEST if sweep["law"] == DEFAULT_LAW else RESOLVED
        sweep["twist_deg"] = twist_of_overlap(pair, log_uniform(random, least, LARGEST_OVERLAP))
    else:
        sweep["torque_Nm"] = rounded(log_uniform(random, *TORQUES) * borne_torque(pair))
    tables = {"pair": pair, "stiffness": sweep}
    kind = "random"
    if random.random() < 0.125:
        kind = "invalid"
        if random.random() < 0.7:
            tables["pair"] = invalid(random, pair)
        else:
            tables["stiffness"] = invalid(random, {k: v for k, v in sweep.items() if v is not None})
    return Case(number, kind, {"job.toml": toml_text(tables)}, "gearfe stiffness job.toml --out out --no-estimate")


def run(case: Case, folder: Path) -> Finding:
    """The sweep of the job, and the checks."""
    job = read_stiffness_job(case.write(folder))
    sweep = job.sweep
    elastic = elastic_pair(job.pair, job.model)
    curve = sweep_stiffness(job.pair, elastic=elastic, **sweep)
    counts = Counter(str(s) for s in curve.status)
    total = np.where(np.isfinite(curve.twist), curve.twist, 0.0) + curve.lost_motion
    loaded = np.flatnonzero(curve.status == "converged")
    checks: list[Check] = []
    found: Positions | None = None
    measures: dict[str, Any] = {"positions": len(curve.status), "converged": len(loaded), "law": job.table.law}
    measures["iterations"] = int(curve.iterations.max(initial=0))
    if len(loaded):
        checks.append(Check("tangent", float((~(curve.k_tangent[loaded] > 0)).sum()), 0.5))
        solver = position_solver(elastic)
        found = solver.solve(curve.pinion_angle[loaded], total[loaded], np.arange(len(loaded)))
        places = zip(found, curve.pinion_angle[loaded].tolist(), total[loaded].tolist(), strict=True)
        balances = [c for c in (balance(elastic, *place) for place in places) if c is not None]
        checks += [max(balances, key=lambda c: c.share)] if balances else []
        checks += ratio_checks(solver, curve.pinion_angle[loaded], total[loaded], found)
        checks += swap_checks(solver, curve.pinion_angle[loaded], total[loaded], found)
    checks += period_checks(curve, found)
    bad = {s: n for s, n in counts.items() if s not in SOLVED}
    told = ", ".join(f"{n} of {len(curve.status)} positions {s}" for s, n in bad.items())
    return Finding("stopped" if bad else "done", told, checks, measures)


def period_checks(curve: Any, found: Positions | None) -> list[Check]:
    """Whether the last position, one cycle after the first, repeats it, up to the rounding of angles."""
    if not math.isclose(curve.pinion_angle[-1] - curve.pinion_angle[0], curve.mesh_cycle, rel_tol=1e-9):
        return []
    if curve.status[0] != curve.status[-1]:
        return [Check("period", math.inf, PERIOD)]
    if curve.status[0] != "converged" or found is None:
        return []
    apart = abs(float(curve.torque_wheel[-1] / curve.torque_wheel[0]) - 1)
    return [Check("period", apart, max(PERIOD, _rounding(found[0])))]


def _rounding(found: Positions) -> float:
    """Relative change of the torque by the rounding of two angles."""
    return float(2 * ANGLE_ROUNDING * found.tangent / found.torque_wheel)


def balance(elastic: MeshingPair, found: Positions, angle: float, twist: float) -> Check | None:
    """Resultants of the contact forces on both gears; the half-plane law has one force for both."""
    if isinstance(elastic.law, HalfPlane):
        return None
    resultant, on_wheel, moment = 0.0 + 0.0j, 0.0 + 0.0j, 0.0
    for gear, loads in enumerate(found.loads):
        turn = np.exp(1j * elastic.tooth_angle(gear, loads.tooth, angle, twist))[:, None]
        force = turn * loads.force.view(complex)
        resultant += force.sum()
        if gear == 1:
            arm = turn * (elastic.wheel.flank.points @ [1, 1j])
            on_wheel += force.sum()
            moment -= float((arm.conj() * force).imag.sum())
    wrong = found.torque_wheel + found.torque_pinion - elastic.wheel_centre * on_wheel.imag
    reaction = found.torque_wheel_reaction - moment
    off = float(np.abs([wrong, reaction]).max() / found.torque_wheel)
    return Check("balance", max(abs(resultant) / abs(on_wheel), off), BALANCE)


def on_path(pair: MeshGeometry, angle: float, twist: float, found: Positions) -> bool:
    """Whether all loaded pairs touch well within the involutes, clear of tips, rounds, reliefs and form points."""
    start, end = pair.path_limits(relieved=True)
    margin = 0.08 * pair.base_pitch + 3.0 * abs(twist) * pair.wheel.base_radius
    loaded = found.contacts.pair[found.contacts.torque_wheel > 1e-9 * found.torque_wheel]
    rolls = [pair.pinion_roll_at(angle + int(k) * pair.mesh_cycle) for k in loaded]
    return all(start + margin < s < end - margin for s in rolls)


def ratio_checks(solver: PositionSolver, angles: Any, twists: Any, found: Positions) -> list[Check]:
    """The torque ratio on the path, where it is worst against its limit."""
    pair, known = solver.pair, solver.half_plane if solver.on_elements else None
    checks = []
    for angle, twist, p in zip(angles, twists, found, strict=True):
        if p.status != "converged" or not on_path(pair, angle, twist, p):
            continue
        ratio = p.torque_wheel / p.torque_pinion
        expected: Any = pair.wheel.teeth / pair.pinion.teeth
        if known is not None:
            same = known.solve(np.array([angle]), np.array([twist]))[0]
            expected = same.torque_wheel / same.torque_pinion
        overlap = abs(twist - pair.contact_twist) * pair.wheel.base_radius / pair.pinion.module
        bent = BENT * overlap if known is None else RATIO_BENT * overlap**2
        checks.append(Check("ratio", float(abs(ratio / expected - 1)), RATIO + bent))
    return [max(checks, key=lambda c: c.share)] if checks else []


def swap_checks(here: PositionSolver, angles: Any, twists: Any, found: Positions) -> list[Check]:
    """The same place seen from the other gear: turned by half a turn, the wheel is the pinion.

    Its tooth 0 then stands at the wheel's angle + pi/z2, and the twist of the other gear is twist z2/z1.
    """
    pair, elastic = here.pair, here.elastic
    sides = getattr(elastic.law, "sides", "both")
    other_side = {"pinion": "wheel", "wheel": "pinion"}.get(sides, sides)
    law: Any = elastic.law if sides == other_side else replace(elastic.law, sides=other_side)  # type: ignore[type-var]
    mirrored = GearPair(pair.wheel, pair.pinion, pair.centre_distance)
    model = elastic.model.changed(law=law, materials=elastic.model.materials[::-1])
    other = MeshingPair(mirrored, elastic.wheel, elastic.pinion, model)
    turned = (twists - angles * elastic.pinion.teeth / elastic.wheel.teeth) + math.pi / elastic.wheel.teeth
    turns = twists * elastic.wheel.teeth / elastic.pinion.teeth
    checks = []
    for p, q in zip(found, position_solver(other).solve(turned, turns), strict=True):
        if p.status == q.status == "converged":
            apart = float(max(abs(q.torque_pinion / p.torque_wheel - 1), abs(q.torque_wheel / p.torque_pinion - 1)))
            checks.append(Check("swap", apart, max(SWAP, _rounding(p))))
    return [max(checks, key=lambda c: c.share)] if checks else []


CAMPAIGN = Campaign("gears", 1000, tuple(range(6)), 120.0, draw, run)
