#!/usr/bin/env python3
"""The stiffness curve of a job file in a few lines of Python: what ``gearfe stiffness`` does, without its options.

Usage: python scripts/examples/stiffness_sweep.py [JOB.toml [OUT.csv]]
"""

from __future__ import annotations

import sys
from pathlib import Path

from gearfe import sweep_stiffness
from gearfe.gears.gearmesh.job import read_stiffness_job


def main(job_file: str = "geometry/gear_train.toml", out: str = "stiffness.csv") -> int:
    """Sweep, print the curve and write it as CSV."""
    job = read_stiffness_job(job_file)
    curve = sweep_stiffness(job.pair, job.model, **job.sweep)
    curve.to_csv(out)
    for row in zip(*(curve.columns()[name] for name in ("pinion_angle_deg", "k_mesh_N_per_m", "status")), strict=True):
        print("{:>8} deg  {:.10} N/m  {}".format(*row))
    print(f"written to {Path(out)}")
    return int(curve.failed.any())


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
