"""``gearfe mechanism``: integrate a planar mechanism from its TOML file and write tables, summary and pictures."""

from __future__ import annotations

import argparse
from pathlib import Path

from .arguments import check_option

HELP = "trajectories, energies and reactions of a planar mechanism"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("file", help="mechanism file (TOML, see docs/mechanisms.md)")
    parser.add_argument("--out", required=True, help="folder for the results")
    parser.add_argument("--tolerance", type=float, help="accuracy, 1e-13 to 0.1 (default: the file's, 1e-9)")
    parser.add_argument("--method", help="auto, taylor, explicit or implicit (default: the file's)")
    parser.add_argument("--until", type=float, metavar="T", help="end of the run in s (default: the file's)")
    parser.add_argument("--reactions", action="store_true", help="write reactions.csv")
    parser.add_argument("--no-figures", action="store_true", help="tables and summary only")
    parser.add_argument("--no-estimate", action="store_true", help="leave out the finer runs that estimate the error")
    parser.add_argument("--animation", action="store_true", help="write animation.gif")


def run(args: argparse.Namespace) -> int:
    """Run the command; 1 when the run stopped before its end or an output is not finite."""
    from ..tables.mechanism import RunTable, read_mechanism_file

    # a mistake in the file is told before NumPy and SciPy load
    file = read_mechanism_file(args.file)
    for name in ("tolerance", "method"):
        if getattr(args, name) is not None:
            check_option("--" + name, getattr(args, name), RunTable, name)

    from ..mechanisms.job import run_mechanism
    from ..mechanisms.model import make_mechanism

    outcome = run_mechanism(
        make_mechanism(file, Path(args.file)),
        args.out,
        tolerance=args.tolerance,
        method=args.method,
        until=args.until,
        reactions=args.reactions,
        figures=not args.no_figures,
        animation=args.animation,
        estimate=not args.no_estimate,
    )
    print(outcome.text)
    return 0 if outcome.complete else 1
