"""Contact laws over the whole range of their parameters, flank sizes, and the noise of a densely sampled curve.

A scene is a pair and a load. On its mesh, each law with each parameter is held against the half-plane law, and so is
Nitsche's with each flank size. The tables say where a law leaves it by 0.1 % and by 1 %, and where it fails.
"""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.gears.contact.compliance import MeshingPair
from gearfe.gears.contact.laws import HalfPlane, Nitsche
from gearfe.gears.gearmesh.job import StiffnessJob, read_stiffness_job
from gearfe.gears.gearmesh.sweep import elastic_pair
from tests.makers.solving import solve_positions

from .campaign import Campaign, Case, Columns
from .outcome import Finding, Outcome
from .pairs import LARGEST_OVERLAP, log_uniform, running_pair, twist_of_overlap
from .toml_text import toml_text

#: Parameters of a scene's cases about their defaults: penalty in N/mm3, gamma0, sizes of the flanks' elements; and
#: twists (deg) of the dense curves.
PENALTY = tuple(10.0**k for k in range(5, 11))
GAMMA = tuple(10.0**k for k in range(-2, 3))
SIZES = (3.2, 2.0, 1.0, 0.5, 0.32)
NOISE = (1e-3, 1e-2, 0.05, 0.2)
#: Positions of the comparison in one mesh cycle, and the step (deg) and the most positions of the dense curve.
POSITIONS, FINE_STEP, MOST_FINE = 8, 0.05, 240


def settings() -> list[tuple[str, float]]:
    """(family, value) of a scene's cases. The order does not depend on which laws there are."""
    made = [("penalty", value) for value in PENALTY]
    made += [("nitsche", value) for value in GAMMA]
    made += [("size", value) for value in SIZES]
    made += [(family, value) for family in ("noise", "noise half_plane") for value in NOISE]
    return made


def scene_job(scene: int, seed: int) -> dict[str, Any]:
    """Tables of a scene: scene 0 is the 20/30 pair, the others are random."""
    if scene == 0:
        form = {"module_mm": 2.5, "pressure_angle_deg": 25.0, "face_width_mm": 10.0, "tip_round_mm": 0.1}
        pair: dict[str, Any] = {
            **form, "pinion": {"teeth": 20, "bore_diameter_mm": 10.0}, "wheel": {"teeth": 30, "bore_diameter_mm": 15.0},
        }  # fmt: skip
        return {"pair": pair, "stiffness": {"twist_deg": 0.05}}
    random = np.random.default_rng([seed, scene])
    pair = running_pair(random, most_teeth=60)
    twist = twist_of_overlap(pair, log_uniform(random, 0.01, LARGEST_OVERLAP))
    return {"pair": pair, "stiffness": {"twist_deg": twist, "twist_from": "contact"}}


def draw(random: np.random.Generator, number: int) -> Case:
    """Case `number` of the grid; scenes are drawn from seeds of their own, since many cases share one."""
    grid = settings()
    family, value = grid[number % len(grid)]
    scene = number // len(grid)
    # cases that share a scene may not depend on a generator of their own: the campaign's seed comes first in it
    seed = int(random.bit_generator.seed_seq.entropy[0])  # type: ignore[attr-defined]
    tables = scene_job(scene, seed)
    if family == "penalty":
        tables["stiffness"] |= {"law": "penalty", "penalty_stiffness_N_per_mm3": value}
    elif family == "nitsche":
        tables["stiffness"] |= {"law": "nitsche", "nitsche_gamma0": value}
    elif family == "size":
        tables["stiffness"] |= {"law": "nitsche", "flank_coarsen": value}
    else:
        tables["stiffness"] |= {"twist_deg": value, "angle_step_deg": FINE_STEP}
        tables["stiffness"]["law"] = "half_plane" if family == "noise half_plane" else "nitsche"
    data = {"scene": scene, "seed": seed, "family": family, "value": value}
    return Case(number, family, {"job.toml": toml_text(tables)}, "gearfe stiffness job.toml --out out", data)


@lru_cache(maxsize=6)
def _pair(key: str, size: float) -> MeshingPair:
    """Condensed gears of a scene (key: the text of its [pair]) with stress rows, so that any law can use them."""
    job = _read(key)
    return elastic_pair(job.pair, job.model, law=Nitsche(), flank_coarsen=size)


@lru_cache(maxsize=4)
def _read(key: str) -> StiffnessJob:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "job.toml"
        path.write_text(key, encoding="utf-8")
        return read_stiffness_job(path)


def _angles(job: StiffnessJob) -> Any:
    """Positions at which the laws are compared (rad)."""
    return job.pair.mesh_cycle * (np.arange(POSITIONS) + 0.37) / POSITIONS


@lru_cache(maxsize=2)
def _truth(key: str, twist: float) -> Any:
    """Torques by the half-plane law (N m): many cases of a scene are held against the same."""
    job = _read(key)
    return _torques(job, elastic_pair(job.pair, job.model, law=HalfPlane()), _angles(job), twist)[0]


def run(case: Case, folder: Path) -> Finding:
    """Stiffness of the case against its reference, or the noise of a dense curve."""
    job = read_stiffness_job(case.write(folder))
    family, value = str(case.data["family"]), float(case.data["value"])
    plain = toml_text({"pair": scene_job(int(case.data["scene"]), int(case.data["seed"]))["pair"]})
    lost = job.pair.contact_twist if job.table.twist_from == "contact" else 0.0
    twist = job.sweep["twist"] + lost
    if family.startswith("noise"):
        return _noise(case, job, elastic_pair(job.pair, job.model), twist)
    elastic = _pair(plain, value if family == "size" else 1.0)
    elastic = replace(elastic, model=replace(elastic.model, law=job.law))
    torque, iterations, status = _torques(job, elastic, _angles(job), twist)
    truth = _truth(plain, twist)
    off = np.abs(torque / truth - 1)
    both = np.isfinite(off)
    failed = sum(n for s, n in status.items() if s != "converged")
    measures = {
        "scene": case.data["scene"],
        "value": value,
        "reference": HalfPlane().name,
        "median_deviation": _short(np.median(off[both])) if both.any() else "",
        "worst_deviation": _short(off[both].max()) if both.any() else "",
        "failed_positions": failed,
        "median_iterations": float(np.median(iterations)),
        "most_iterations": int(iterations.max()),
    }
    told = ", ".join(f"{n} of {POSITIONS} positions {s}" for s, n in status.items() if s != "converged")
    return Finding("stopped" if failed else "done", told, (), measures)


def _torques(job: StiffnessJob, elastic: MeshingPair, angles: Any, twist: float) -> tuple[Any, Any, Counter]:
    """Torques (N m), iterations and statuses, also where the elements do not resolve the contact."""
    found = solve_positions(elastic, angles, twist)
    torque = np.where(found.status == "converged", found.torque_wheel, np.nan)
    return torque, found.iterations, Counter(found.status.tolist())


def _noise(case: Case, job: StiffnessJob, elastic: MeshingPair, twist: float) -> Finding:
    """Third differences of the curve, over a mesh cycle or `MOST_FINE` positions.

    They are what a smooth function does not have at this step.

    For independent errors of standard deviation s those differences have 20 s^2 (1 + 9 + 9 + 1); the median is taken,
    because at pair changes the curve truly bends.
    """
    step = math.radians(FINE_STEP)
    angles = step * np.arange(min(MOST_FINE, round(job.pair.mesh_cycle / step)))
    torque, iterations, status = _torques(job, elastic, angles, twist)
    third = np.abs(np.diff(torque, 3)) / math.sqrt(20.0) / np.nanmedian(torque)
    failed = sum(n for s, n in status.items() if s not in ("converged", "no_contact"))
    measures = {
        "scene": case.data["scene"],
        "value": case.data["value"],
        "reference": elastic.law.name,
        "positions": len(angles),
        "median_noise": _short(np.nanmedian(third) / 0.6745) if np.isfinite(third).any() else "",
        "worst_jump": _short(np.nanmax(third)) if np.isfinite(third).any() else "",
        "failed_positions": failed,
        "median_iterations": float(np.median(iterations)),
        "most_iterations": int(iterations.max()),
    }
    return Finding("stopped" if failed else "done", f"{failed} positions failed" if failed else "", (), measures)


def _short(value: float) -> float:
    return float(f"{value:.3g}")


def tables(outcomes: Sequence[Outcome]) -> dict[str, Columns]:
    """Where each law leaves the reference, scene by scene: the parameters within 0.1 %, within 1 %, and failing."""
    columns: dict[str, list[Any]] = {
        "scene": [], "family": [], "within_0.1_percent": [], "within_1_percent": [], "failing": [],
        "worst_deviation": [], "most_iterations": [],
    }  # fmt: skip
    rows = [row for row in outcomes if not row.kind.startswith("noise") and row.measures]
    for scene, family in dict.fromkeys((row.measures["scene"], row.kind) for row in rows):
        own = [row for row in rows if (row.measures["scene"], row.kind) == (scene, family)]
        columns["scene"].append(scene)
        columns["family"].append(family)
        for name, limit in (("within_0.1_percent", 1e-3), ("within_1_percent", 1e-2)):
            good = [
                row.measures["value"]
                for row in own
                if row.measures["worst_deviation"] != ""
                and row.measures["worst_deviation"] <= limit
                and not row.measures["failed_positions"]
            ]
            columns[name].append(_listed(good))
        columns["failing"].append(_listed([r.measures["value"] for r in own if r.measures["failed_positions"]]))
        worst = [r.measures["worst_deviation"] for r in own if r.measures["worst_deviation"] != ""]
        columns["worst_deviation"].append(max(worst, default=math.nan))
        columns["most_iterations"].append(max(r.measures["most_iterations"] for r in own))
    return {"laws_limits": columns} if columns["scene"] else {}


def _listed(values: Sequence[float]) -> str:
    return " ".join(f"{v:g}" for v in sorted(values)) or "none"


CAMPAIGN = Campaign("laws", 5 * len(settings()), (3, 8, 13, 17), 300.0, draw, run, tables)
