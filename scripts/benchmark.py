#!/usr/bin/env python3
"""Run time against error, beside other programs: what ``gearfe benchmark`` does.

Usage: python scripts/benchmark.py [sweep|mechanism|housing|transient|skipped|references|all] [OUT]
"""

from __future__ import annotations

import sys

from gearfe.benchmark.run import JOBS, run_jobs


def main(job: str = "all", out: str = "out/benchmark") -> int:
    """Run, and tell what failed."""
    record = run_jobs(tuple(JOBS) if job == "all" else (job,), out)
    for failure in record.failures:
        print(f"failed: {failure}", file=sys.stderr)
    return int(bool(record.failures))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
