#!/usr/bin/env python3
"""Run time against error of every job, beside other programs: docs/development/accuracy.md.

Usage:
    python scripts/benchmarks/benchmark.py [sweep|mechanism|housing|transient|runup|skipped|references|cold|all] ...
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.benchmarks.jobs import command
from scripts.benchmarks.script import answered

if __name__ == "__main__":
    sys.exit(answered(command, "scripts/benchmarks/benchmark.py"))
