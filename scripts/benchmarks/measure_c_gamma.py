#!/usr/bin/env python3
"""Why the mesh stiffness of a gear with a small bore is below c_gamma of ISO 6336-1: parts of its flexibility.

The flexibility 1/k of the shipped pair (mean over the mesh cycle) is parted into

- *torsion of the gear bodies* between rigid bore and root circle, by the closed form of `body_twist`;
- *bodies near the teeth*: what the rest falls by from the given bores to bores as large as the profile allows;
- *contact*: the approach of two tooth halves by Weber and Banaschek (Schriftenreihe Antriebstechnik 11, 1953), for half
  the tooth thickness at the pitch circle, with the mean number of tooth pairs;
- *teeth*: what is left.

A second table has the level over the load. With --write both tables in docs/stiffness.md are replaced.

Usage: python scripts/benchmarks/measure_c_gamma.py [--job JOB.toml] [--write]
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from gearfe import sweep_stiffness
from gearfe.gears.gearmesh.bodies import body_twist
from gearfe.gears.gearmesh.job import StiffnessJob, read_stiffness_job
from gearfe.gears.geometry.pair import GearPair
from gearfe.gears.rating.stiffness import iso_values

ROOT = Path(__file__).resolve().parents[2]
START, END = "<!-- c_gamma: begin -->", "<!-- c_gamma: end -->"
#: Bores of the thin rims: root radius less so many modules, and torques (N m).
RIM_MODULES, TORQUES = 1.5, (10.0, 30.0, 100.0, 300.0)


def flexibility(job: StiffnessJob, torque: float) -> float:
    """Mean flexibility over the mesh cycle (m/N): that of the mean stiffness."""
    return 1.0 / float(sweep_stiffness(job.pair, job.model, torque=torque).k_mesh.mean())


def bodies_twist(job: StiffnessJob) -> float:
    """Flexibility of both gear bodies in torsion (m/N)."""
    gears = (job.pair.pinion, job.pair.wheel)
    return sum(body_twist(gear, material) for gear, material in zip(gears, job.materials, strict=True))


def with_thin_rims(job: StiffnessJob) -> StiffnessJob:
    """The job with bores that leave thin rims."""
    gears = (job.pair.pinion, job.pair.wheel)
    thin = [replace(g, bore_diameter=2.0 * (g.root_radius - RIM_MODULES * g.module)) for g in gears]
    return replace(job, pair=GearPair(*thin, job.pair.centre_distance))


def contact_flexibility(job: StiffnessJob, torque: float) -> float:
    """Flexibility of the contact of one tooth pair at the pitch point (m/N), Weber and Banaschek (1953)."""
    pair, width = job.pair, min(job.pair.pinion.face_width, job.pair.wheel.face_width)
    force = torque / pair.wheel.base_radius
    radii = [gear.base_radius * math.tan(pair.working_pressure_angle) for gear in (pair.pinion, pair.wheel)]
    radius = radii[0] * radii[1] / sum(radii)
    soft = [(1.0 - m.poisson_ratio**2) / m.youngs_modulus for m in job.materials]
    half_width = math.sqrt(4.0 * force * radius * sum(soft) / (math.pi * width))
    depth = 0.25 * math.pi * pair.pinion.module / math.cos(pair.working_pressure_angle)
    parts = (
        s * (2.0 / math.pi) * (math.log(2.0 * depth / half_width) - m.poisson_ratio / (2.0 * (1.0 - m.poisson_ratio)))
        for s, m in zip(soft, job.materials, strict=True)
    )
    return sum(parts) / width


def tables(job: StiffnessJob) -> list[str]:
    """Lines of both tables."""
    torque = job.table.torque_Nm or 100.0
    whole, twist = flexibility(job, torque), bodies_twist(job)
    thin = with_thin_rims(job)
    near = (whole - twist) - (flexibility(thin, torque) - bodies_twist(thin))
    contact = contact_flexibility(job, torque) / job.pair.contact_ratio
    parts = {
        "torsion of the gear bodies between bore and root": twist,
        f"bodies near the teeth (against rims of {RIM_MODULES:g} modules)": near,
        "contact": contact,
        "teeth": whole - twist - near - contact,
    }
    moduli = [m.youngs_modulus for m in job.materials]
    name = "c_gamma_times_width_N_per_m"
    level = iso_values(job.pair, moduli[0], moduli[1])[name]
    lines = ["| part of the flexibility | nm/N | share |", "|---|---|---|"]
    lines += [f"| {name} | {1e9 * value:.2f} | {100.0 * value / whole:.0f} % |" for name, value in parts.items()]
    lines += [
        f"| total | {1e9 * whole:.2f} | 100 % |",
        f"| 1/(c_γ b) of ISO 6336-1 | {1e9 / level:.2f} | {100.0 / (level * whole):.0f} % |",
    ]
    lines += [
        "",
        "| torque (N m) | line load (N/mm) | mean k (N/µm) | k/(c_γ b) | without the torsion of the bodies |",
        "|---|---|---|---|---|",
    ]
    for value in TORQUES:
        f = flexibility(job, value)
        load = 1e-3 * value / job.pair.wheel.reference_radius / job.pair.common_width
        level = iso_values(job.pair, moduli[0], moduli[1], line_load=load)[name]
        lines.append(
            f"| {value:g} | {load:.0f} | {1e-6 / f:.1f} | {1.0 / (f * level):.2f} | {1.0 / ((f - twist) * level):.2f} |"
        )
    one, two = job.pair.pinion, job.pair.wheel
    bores = f"bores {1e3 * one.bore_diameter:g} and {1e3 * two.bore_diameter:g} mm"
    source = "by `scripts/benchmarks/measure_c_gamma.py`"
    return [*lines, "", f"{one.teeth}/{two.teeth} teeth at {torque:g} N m, {bores}, {source}."]


def main() -> None:
    """Measure and print (or write) the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--job", default=str(ROOT / "geometry" / "gear_train.toml"))
    parser.add_argument("--write", action="store_true", help="replace the tables in docs/stiffness.md")
    args = parser.parse_args()
    lines = tables(read_stiffness_job(args.job))
    print("\n".join(lines))
    if args.write:
        page = ROOT / "docs" / "stiffness.md"
        before, _, rest = page.read_text(encoding="utf-8").partition(START)
        _, _, after = rest.partition(END)
        page.write_text("\n".join([f"{before}{START}", *lines, f"{END}{after}"]), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    main()
