"""``gearfe cache``: what is kept on disk, how large it is, and away with it."""

from __future__ import annotations

import argparse

from .arguments import add_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    one = parser.add_mutually_exclusive_group()
    one.add_argument(
        "--clean",
        nargs="?",
        const="all",
        metavar="KIND",
        help="remove all entries, or those of a kind",
    )
    one.add_argument(
        "--compile",
        action="store_true",
        help="compile the kernels of mechanisms now, half a minute: single runs are over before that pays",
    )
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """List the entries, and remove the chosen ones; 1 when something could not be removed."""
    from ..base.cache import cache_folder, entries, remove
    from ..base.environment import CACHE_VARIABLE, LIMIT_VARIABLE, limit
    from ..base.errors import unknown_name

    folder = cache_folder()
    if folder is None:
        print(f"nothing is kept: {CACHE_VARIABLE} is off, or the user has no home folder")
        return 0
    there = entries(folder)
    kinds = sorted({entry.kind for entry in there})
    failed = 0
    if args.clean is not None:
        if args.clean not in ("all", *kinds):
            raise unknown_name("--clean", args.clean, ["all", *kinds])
        chosen = [entry for entry in there if args.clean in ("all", entry.kind)]
        gone = [entry for entry in chosen if remove(entry)]
        failed = len(chosen) - len(gone)
        print(f"removed: {len(gone)} entries, {_size(sum(entry.size for entry in gone))}")
    elif args.compile:
        _compile()
    there = entries(folder)
    args.summary = {"folder": str(folder), "limit_bytes": limit(), "kinds": {}}
    for kind in sorted({entry.kind for entry in there}):
        some = [entry.size for entry in there if entry.kind == kind]
        args.summary["kinds"][kind] = {"entries": len(some), "bytes": sum(some)}
        print(f"  {kind:<14} {len(some):>6}  {_size(sum(some)):>10}")
    total = _size(sum(entry.size for entry in there))
    print(f"{folder}: {len(there)} entries, {total}; limit {_size(limit())} ({LIMIT_VARIABLE})")
    return 1 if failed else 0


def _compile() -> None:
    """Any compiled run leaves the kernels in the cache."""
    from ..multibody import Body, Hinge, Linkage, System, integrate

    rod, hinge = Body("rod", 1.0, 1.0, (1.0, 0.0)), Hinge("rod", "ground")
    system = System([Linkage((rod,), (hinge,))])
    for method in ("taylor", "implicit"):
        integrate(system, [0.0, 1e-3], method=method)


def _size(count: int) -> str:
    return f"{1e-6 * count:.1f} MB"
