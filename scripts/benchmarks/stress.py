#!/usr/bin/env python3
"""Random campaigns that look for crashes, hangs and wrong results: docs/development/campaigns.md.

Usage:
    python scripts/benchmarks/stress.py [gears|laws|mesh_laws|width|mechanisms|trains|files|estimates|all] [--seed N]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.benchmarks.script import answered
from tests.campaigns import command

if __name__ == "__main__":
    sys.exit(answered(command, "scripts/benchmarks/stress.py"))
