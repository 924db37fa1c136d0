"""``gearfe compare A B [C]``: results of two or three runs over each other, their differences with errors."""

from __future__ import annotations

import argparse
from dataclasses import replace

from .arguments import add_json, add_pictures, print_results

#: Files that a comparison can leave.
FILES = ("compare.csv", "compare.png", "compare.json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("runs", nargs="+", metavar="RUN", help="two or three folders of results, or files in them")
    parser.add_argument("--out", metavar="DIR", default="out/compare", help="output folder (default: out/compare)")
    parser.add_argument(
        "--names", nargs="+", metavar="NAME", help="short names of the runs (default: those of their folders)"
    )
    parser.set_defaults(format="csv")
    add_json(parser)
    add_pictures(parser)


def run(args: argparse.Namespace) -> int:
    """Compare the runs; write compare.csv, compare.json and compare.png."""
    from ..base.errors import InputError

    if not 2 <= len(args.runs) <= 3:
        raise InputError("command line", len(args.runs), "runs to compare", "name two or three folders of results")
    if args.names is not None and len(args.names) != len(args.runs):
        raise InputError("--names", args.names, f"must be {len(args.runs)} names", "give one for each run")
    if args.names is not None and len(set(args.names)) < len(args.names):
        raise InputError("--names", args.names, "must differ", "give each run a different name")

    from ..base.files import output_folder, whole_set, write_csv, write_json
    from ..base.progress import stage
    from ..output.differences import compared, comparison_lines
    from ..output.results import KINDS, read_all, short_names

    names = args.names or short_names(args.runs)
    every = [read_all(path, f"run {i}", name) for i, (path, name) in enumerate(zip(args.runs, names, strict=True), 1)]
    kinds = [kind for kind in KINDS if all(any(one.kind is kind for one in run) for run in every)]
    results = [next((one for one in run if one.kind in kinds[:1]), run[0]) for run in every]
    others = [f"{one.name}: {one.path.name} is left out" for run in every for one in run if one not in results]
    comparison = compared(results)
    comparison = replace(comparison, notes=(*comparison.notes, *others))
    folder = output_folder(args.out)
    with whole_set(folder, FILES) as target:
        table = comparison.columns()
        write_csv(target / "compare.csv", table)
        rows = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
        runs = [{"name": one.name, "kind": one.kind.name, "file": str(one.path)} for one in results]
        write_json(target / "compare.json", {"runs": runs, "differences": rows, "notes": list(comparison.notes)})
        if not args.no_pictures and comparison.panels:
            from ..figures.compare import comparison_picture
            from ..figures.style import save

            with stage("drawing"):
                save(comparison_picture(comparison), target / "compare.png")
        written = sorted(path.name for path in target.iterdir())
    print_results(comparison_lines(comparison), folder, written, {}, ())
    return 0
