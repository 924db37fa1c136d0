"""``python scripts/benchmarks/benchmark.py [JOB] --out DIR``: run time against error of every job, beside others."""

from __future__ import annotations

import argparse
import sys
import time

HELP = "run time against error of all jobs, beside other programs; the accuracy page"

#: Jobs by name; `all` is all of them.
JOBS = ("sweep", "mechanism", "housing", "transient", "runup", "skipped", "references", "cold")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("job", nargs="?", default="all", metavar="JOB", help=", ".join(JOBS) + " or all (default)")
    parser.add_argument("--out", default="out/benchmark", metavar="DIR", help="results (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="small settings: proves that it works, not how fast")
    parser.add_argument(
        "--peers",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="run the other programs that are there (default: yes)",
    )
    parser.add_argument("--against", default="", metavar="REV", help="cold: another commit to run beside this state")
    parser.add_argument("--page", metavar="FILE.md", help="write the accuracy page from the results and stop")


def run(args: argparse.Namespace) -> int:
    """Measure and draw, or write the page; 1 when a row failed."""
    from gearfe.base.errors import unknown_name

    if args.job not in (*JOBS, "all"):
        raise unknown_name("benchmark job", args.job, (*JOBS, "all"))
    if args.page:
        from .page import write_page

        for path in write_page(args.out, args.page):
            print(f"written: {path}")
        return 0
    from .run import run_jobs

    begin = time.perf_counter()
    record = run_jobs(
        JOBS if args.job == "all" else (args.job,), args.out, quick=args.quick, peers=args.peers, against=args.against
    )
    print(f"results in {record.folder}; {time.perf_counter() - begin:.0f} s")
    for failure in record.failures:
        print(f"gearfe: warning: {failure}", file=sys.stderr)
    return int(bool(record.failures))
