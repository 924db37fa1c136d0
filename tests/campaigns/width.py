"""Random spur and helical gears with face widths: each position must converge with closed gaps.

A case is a pair with 50 random flanks, torques and angles: helix angles of 0 to 30 degrees, widths of 2 to 20 modules,
crowning of -5 to 30 um, tilts of -60 to 60 um over the width, end reliefs up to 30 um, 1 to 500 N m.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.gears.geometry.mesh_geometry import MeshGeometry
from gearfe.gears.geometry.spur_gear import Gear
from gearfe.gears.width import (
    EndRelief,
    LeadModification,
    Misalignment,
    WideFlanks,
    WideMesh,
    contact_lines,
    wide_compliance,
)
from gearfe.gears.width.lines import ContactLines, own_twists, solve_position

from .campaign import Campaign, Case
from .outcome import Check, Finding
from .pairs import log_uniform
from .toml_text import toml_text

#: Positions of a pair; largest gap of a loaded point and overlap of another (m).
POSITIONS, CLOSED = 50, 1e-9


def draw(random: np.random.Generator, number: int) -> Case:
    """A pair and the seed of its positions."""
    spur = bool(random.random() < 0.2)
    data = {
        "teeth": [int(random.integers(18, 40)), int(random.integers(20, 80))],
        "module": float(log_uniform(random, 1e-3, 5e-3)),
        "helix": 0.0 if spur else float(random.uniform(-30.0, 30.0)),
        "width": float(log_uniform(random, 2.0, 20.0)),
        "bore": float(random.uniform(0.2, 0.7)),
        "round": float(random.choice([0.0, 0.03])),
        "seed": int(random.integers(1 << 31)),
    }
    command = f"python scripts/benchmarks/stress.py width --case {number}"
    files = {"job.toml": toml_text({"width_case": data})}
    return Case(number, "spur" if spur else "helical", files, command, data)


def mesh_of(data: Any) -> WideMesh:
    """The gears of a case, on coarse sections."""
    helix = math.radians(data["helix"])
    c = math.cos(helix)
    module, angle = data["module"] / c, math.atan(math.tan(math.radians(20.0)) / c)
    form = {"addendum": c, "dedendum": 1.25 * c, "rack_tip_radius": 0.3 * c, "tip_round": data["round"] * module}
    gears = [
        Gear(z, module, angle, data["width"] * data["module"], data["bore"] * (z - 4) * module, **form)
        for z in data["teeth"]
    ]
    base = math.atan(math.tan(helix) * math.cos(angle))
    return WideMesh(MeshGeometry(gears[0], gears[1]), base, coarsen=3.0)


def random_flanks(random: np.random.Generator, width: float) -> WideFlanks:
    """Crowning, end reliefs and tilt."""

    def relief() -> EndRelief:
        return EndRelief(random.uniform(0.0, 30e-6), width * random.uniform(0.05, 0.4), random.choice([1.0, 2.0]))

    lead = LeadModification(random.uniform(-5e-6, 30e-6), 0.0, relief(), relief())
    return WideFlanks(
        leads=(lead, LeadModification()),
        misalignment=Misalignment.over_width(random.uniform(-60e-6, 60e-6), width, random.uniform(-60e-6, 60e-6)),
    )


def miss(lines: ContactLines, angle: float, torque: float) -> float:
    """Largest gap of a loaded point or overlap of another (m); infinite where the position is not solved."""
    solution = solve_position(lines, angle, torque=torque)
    if not solution.converged or not math.isclose(solution.torque, torque, rel_tol=1e-8):
        return math.inf
    points = solution.points
    own = own_twists(lines.law, points, solution.moment / points.weight)[0]
    gap = (points.touch + own + points.influence @ solution.moment - solution.twist) * points.rows.arm
    return float(max(np.abs(gap[solution.moment > 0]).max(), -gap.min()))


def run(case: Case, folder: Path) -> Finding:
    """Solve the positions of a pair."""
    mesh, random = mesh_of(case.data), np.random.default_rng(case.data["seed"])
    lines = contact_lines(wide_compliance(mesh))
    misses = []
    for _ in range(POSITIONS):
        flanked = lines.with_flanks(random_flanks(random, mesh.width))
        torque = log_uniform(random, 1.0, min(500.0, mesh.most_torque))
        misses.append(miss(flanked, float(random.uniform(0.0, mesh.sections.mesh_cycle)), float(torque)))
    unsolved = float(np.count_nonzero(np.isinf(misses)))
    closed = max((one for one in misses if math.isfinite(one)), default=0.0)
    checks = [Check("positions not solved", unsolved, 0.0), Check("largest gap or overlap (m)", closed, CLOSED)]
    return Finding("done", "", checks, {"functions": mesh.count, "helix_deg": round(case.data["helix"], 2)})


CAMPAIGN = Campaign("width", 20, (0, 1), 900.0, draw, run)
