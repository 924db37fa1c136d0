"""Mesh laws of random relieved pairs: each must be built, have forces everywhere in its range, and state its error.

Pairs have reliefs of `[pair]` or of `[microgeometry]` at tips and roots, crowning, shifts and thinned teeth, and loads
from a ten-thousandth of what the material bears up to all of it. The truth is the half-plane law at places that the law
was not made from.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.gears.contact.half_plane import half_plane_pair, solve_half_plane
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.law_fit import LEAST_FORCE
from gearfe.gears.gearmesh.law_make import mesh_law

from .campaign import Campaign, Case, Columns
from .outcome import Check, Finding, Outcome
from .pairs import Table, borne_torque, log_uniform, rounded, running_pair
from .toml_text import toml_text

#: Random places of the contact solutions that the law is held against, and of the law by itself.
TRUTHS, PLACES = 300, 2000
#: Torques at the driven gear, as shares of what the material bears.
TORQUES = (1e-4, 1.0)
#: Largest error (of the force, or of a tenth of the largest one that the law is asked for) over the stated one.
FAR_OFF = 1.3
#: Loads (N/mm) that part the rows of the table, and its quantiles.
LOADS, QUANTILES = (0.0, 1.0, 10.0, math.inf), (0.5, 0.9, 1.0)


def draw(random: np.random.Generator, number: int) -> Case:
    """A pair with the torque its law is made for."""
    pair = running_pair(random, most_teeth=110)
    table: Table = {}
    module = float(pair["module_mm"])
    for side in ("pinion", "wheel"):
        own: Table = {}
        if random.random() < 0.5 and "tip_relief_amount_um" not in pair[side]:
            own |= _relief(random, "tip", module)
        if random.random() < 0.3:
            own |= _relief(random, "root", module)
        if random.random() < 0.3:
            own["profile_crowning_um"] = rounded(log_uniform(random, 0.5, 8.0) * math.sqrt(module), 3)
        if random.random() < 0.2:
            own["profile_slope_um"] = rounded(random.normal(0.0, 3.0) * math.sqrt(module), 3)
        table[side] = own
    torque = rounded(borne_torque(pair) * log_uniform(random, *TORQUES))
    tables = {"pair": pair, "microgeometry": {"torques_Nm": [torque], **table}}
    return Case(number, "relieved", {"job.toml": toml_text(tables)}, "gearfe loadmap job.toml --out out")


def _relief(random: np.random.Generator, end: str, module: float) -> Table:
    return {
        f"{end}_relief_um": rounded(log_uniform(random, 1.0, 30.0) * math.sqrt(module), 3),
        f"{end}_relief_length_mm": rounded(random.uniform(0.1, 1.0) * module, 3),
        f"{end}_relief_shape": str(random.choice(["linear", "arc", "parabolic"])),
    }


def run(case: Case, folder: Path) -> Finding:
    """Build the law, evaluate it everywhere, and compare it with contact solutions."""
    job = read_stiffness_job(case.write(folder))
    assert job.mesh.deviates
    random = np.random.default_rng(case.number)
    pair = half_plane_pair(job.elastic())
    force = float(job.mesh.loads.torques()[0]) / job.pair.wheel.base_radius
    law = mesh_law(pair, force)
    angles = law.nodes[0] + law.cycle * random.uniform(0.0, 1.0, PLACES)
    depths = law.reach * np.exp(random.uniform(math.log(1e-4), 0.0, PLACES))
    first = law.first_contact(angles)
    forces = law(angles, first + depths).force
    angles, approach = angles[:TRUTHS], (first + depths)[:TRUTHS]
    truth = solve_half_plane(pair, angles, approach / job.pair.wheel.base_radius + job.pair.contact_twist)
    true = truth.torque_wheel / job.pair.wheel.base_radius
    solved = np.isfinite(true)
    off = np.abs(forces[:TRUTHS] - true)[solved] / np.maximum(true[solved], LEAST_FORCE * force)
    worst = float(off.max())
    measures = {
        "load_N_per_mm": float(f"{1e-3 * force / pair.width:.4g}"),
        "cells": len(law.nodes) - 1,
        "slots": law.slots,
        "stated_error": float(f"{law.error:.3g}"),
        "true_error": float(f"{worst:.3g}"),
        "true_error_95": float(f"{np.quantile(off, 0.95):.3g}"),
        "unsolved": int((~solved).sum()),
    }
    checks = [Check("places without forces", float((~(forces > 0.0)).sum()), 0.0)]
    checks.append(Check("error over stated", worst / law.error, FAR_OFF))
    return Finding("done", "", checks, measures)


def tables(outcomes: Sequence[Outcome]) -> dict[str, Columns]:
    """Stated and true largest errors (%) of the laws: median, nine of ten, largest, by the load (N/mm)."""
    rows = [row.measures for row in outcomes if row.measures]
    columns: dict[str, list[Any]] = {"load_from_N_per_mm": [], "pairs": [], "quantile": []}
    for low, high in itertools.pairwise(LOADS):
        chosen = [row for row in rows if low <= row["load_N_per_mm"] < high]
        for share in QUANTILES if chosen else ():
            columns["load_from_N_per_mm"].append(low)
            columns["pairs"].append(len(chosen))
            columns["quantile"].append(share)
            for name in ("stated_error", "true_error", "true_error_95"):
                value = 100.0 * np.quantile([row[name] for row in chosen], share)
                columns.setdefault(f"{name}_percent", []).append(float(f"{value:.3g}"))
            ratio = np.quantile([row["true_error"] / row["stated_error"] for row in chosen], share)
            columns.setdefault("true_over_stated", []).append(float(f"{ratio:.3g}"))
    return {"mesh_laws_errors": columns} if rows else {}


CAMPAIGN = Campaign("mesh_laws", 200, (0, 1, 2, 3), 120.0, draw, run, tables)
