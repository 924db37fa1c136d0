"""Random spur and helical gears with face widths: each position must converge with closed gaps.

A case is a pair with 50 random flanks, torques and angles: helix angles of 0 to 30 degrees, widths of 2 to 20 modules,
crowning of -5 to 30 um, tilts of -60 to 60 um over the width, end reliefs up to 30 um, 1 to 500 N m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
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
from gearfe.gears.width.sweep import resultants

from .campaign import Campaign, Case
from .outcome import Check, Finding
from .pairs import log_uniform
from .toml_text import toml_text

#: Positions of a pair; largest gap of a loaded point and overlap of another (m).
POSITIONS, CLOSED = 50, 1e-9
#: Deviation of torque and axial force (-), and that which tables of arms and points, linear between angles, cause:
#: up to 8e-5 of the arm on tip rounds, which carry a tenth of a light load.
BALANCED, TABLES = 1e-8, 1e-5


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


@dataclass(frozen=True)
class Violation:
    """By how much a solved position violates the conditions of its contact.

    Attributes
    ----------
    solved
        Whether the iteration settled.
    gap
        Largest gap of a loaded point, or overlap of another (m).
    pull
        Largest tensile force of a point (N).
    torque
        Deviation from the given torque in parts of it (-).
    moment
        Deviation of the wheel's moment about its axis, by the forces in space, from the torque in parts of it (-).
    axial
        Deviation of the axial force from torque times tan(beta_b) over the base radius, in parts of it or of the
        circumferential force (-).
    """

    solved: bool
    gap: float = 0.0
    pull: float = 0.0
    torque: float = 0.0
    moment: float = 0.0
    axial: float = 0.0


def violation(lines: ContactLines, angle: float, torque: float) -> Violation:
    """Solve a position at a pinion angle (rad) and a torque (N m), and measure what its contact violates."""
    solution = solve_position(lines, angle, torque=torque)
    if not solution.converged:
        return Violation(False)
    points, mesh, moment = solution.points, lines.compliance.mesh, solution.moment
    own = own_twists(lines.law, points.rows, moment / points.weight)[0]
    gap = (points.touch + own + points.influence @ moment - solution.twist) * points.rows.arm
    force, moments = resultants(lines, solution)
    radius = mesh.sections.wheel.base_radius
    axial = -torque / radius * math.tan(mesh.base_helix_angle)
    return Violation(
        True,
        gap=float(max(np.abs(gap[moment > 0]).max(), -gap.min())),
        pull=float(max(0.0, -moment.min() / radius)),
        torque=abs(solution.torque / torque - 1.0),
        moment=abs(abs(float(moments[1, 2])) / torque - 1.0),
        axial=float(abs(force[2] - axial)) / max(abs(axial), torque / radius),
    )


def run(case: Case, folder: Path) -> Finding:
    """Solve the positions of a pair."""
    mesh, random = mesh_of(case.data), np.random.default_rng(case.data["seed"])
    lines = contact_lines(wide_compliance(mesh))
    found = []
    for _ in range(POSITIONS):
        flanked = lines.with_flanks(random_flanks(random, mesh.width))
        torque = log_uniform(random, 1.0, min(500.0, mesh.most_torque))
        found.append(violation(flanked, float(random.uniform(0.0, mesh.sections.mesh_cycle)), float(torque)))
    checks = [
        Check("positions not solved", float(sum(not one.solved for one in found)), 0.0),
        Check("largest gap or overlap (m)", max(one.gap for one in found), CLOSED),
        Check("largest tensile force (N)", max(one.pull for one in found), 0.0),
        Check("torque", max(one.torque for one in found), BALANCED),
        Check("moment of the forces in space", max(one.moment for one in found), TABLES),
        Check("axial force", max(one.axial for one in found), BALANCED),
    ]
    return Finding("done", "", checks, {"functions": mesh.count, "helix_deg": round(case.data["helix"], 2)})


CAMPAIGN = Campaign("width", 20, (0, 1), 900.0, draw, run)
