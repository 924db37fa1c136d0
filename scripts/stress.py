"""All stress campaigns, one after the other: the same as ``gearfe stress``, from Python."""

from __future__ import annotations

import argparse
from pathlib import Path

from gearfe.stress.campaign import CAMPAIGNS
from gearfe.stress.runner import run_campaign


def main() -> None:
    """Run and print how many cases came to what."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/stress"))
    parser.add_argument("--cases", type=int, help="of each campaign; left out: the full forms")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for name in CAMPAIGNS:
        ran = run_campaign(name, args.out, seed=args.seed, cases=args.cases, seconds=1800.0)
        print(f"{name}: {len(ran.outcomes)} cases, {len(ran.bad)} bad")


if __name__ == "__main__":
    main()
