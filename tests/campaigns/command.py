"""``python scripts/benchmarks/stress.py CAMPAIGN``: random cases in great number, each answered, refused or told."""

from __future__ import annotations

import argparse
from pathlib import Path

from gearfe.base.progress import stage

HELP = "random campaigns that look for crashes, hangs and wrong results"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument(
        "campaign",
        nargs="?",
        default="all",
        help="gears, laws, mesh_laws, width, mechanisms, trains, files, estimates or all (default)",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the random cases (default: 1)")
    parser.add_argument("--out", metavar="DIR", default=None, help="results folder (default: out/stress)")
    parser.add_argument("--cases", type=int, metavar="N", help="how many of each campaign (default: its full form)")
    parser.add_argument("--short", action="store_true", help="the short forms: a minute or two in all")
    parser.add_argument("--minutes", type=float, metavar="M", help="time for each campaign (default: 30)")
    parser.add_argument("--case", type=int, metavar="K", help="run case K alone and tell what came out")


def run(args: argparse.Namespace) -> int:
    """Run; 1 when a case crashed, hung, ended with a traceback or gave a wrong result."""
    from gearfe.base.errors import InputError
    from gearfe.base.files import output_folder

    from .campaign import CAMPAIGNS, campaign_named
    from .outcome import CLASSES
    from .runner import run_campaign

    if args.seed < 0:
        raise InputError("--seed", args.seed, "must be >= 0", "any whole number will do")
    for option, value in (("--cases", args.cases), ("--minutes", args.minutes)):
        if value is not None and not value > 0:
            raise InputError(option, value, "must be > 0", "leave it out for the full form")
    names = list(CAMPAIGNS) if args.campaign == "all" else [campaign_named(args.campaign).name]
    if args.case is not None:
        return _alone(names, args.seed, args.case)
    folder = output_folder(args.out or Path("out") / "stress")
    seconds = 60.0 * (30.0 if args.minutes is None else args.minutes)
    failed = False
    for name in names:
        with stage(name):
            ran = run_campaign(name, folder, seed=args.seed, cases=args.cases, short=args.short, seconds=seconds)
        counts = {kind: sum(row.outcome == kind for row in ran.outcomes) for kind in CLASSES}
        told = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
        rest = "" if ran.complete else f" (of {ran.asked}: the time is over; run again to go on)"
        print(f"{name}: {len(ran.outcomes)} cases{rest}: {told}")
        for row in ran.bad[:10]:
            print(f"  case {row.case} ({row.kind}) {row.outcome}: {row.reason[:200]}")
        failed = failed or bool(ran.bad)
    print(f"tables and kept cases in {folder}")
    return 1 if failed else 0


def _alone(names: list[str], seed: int, number: int) -> int:
    """One case in this process."""
    from gearfe.base.errors import InputError

    from .campaign import campaign_named
    from .worker import run_case

    if len(names) != 1:
        raise InputError("--case", number, "needs the name of one campaign", "write it before the options")
    if number < 0:
        raise InputError("--case", number, "must be >= 0", "take it from the table of outcomes")
    row = run_case(campaign_named(names[0]), seed, number)
    print(f"{names[0]} case {number} ({row.kind}): {row.outcome} in {row.seconds:.3g} s")
    if row.reason:
        print(f"  {row.reason}")
    for check in row.checks:
        print(f"  {check.name}: {check.value:.3g} (limit {check.limit:.3g})")
    for name, value in row.measures.items():
        print(f"  {name}: {value}")
    return 1 if row.bad else 0
