"""``gearfe study STUDY.toml --out DIR``: one job in many cases, with nothing lost."""

from __future__ import annotations

import argparse
import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from .arguments import add_folder, add_job, print_results

#: Seconds that a scheduler has to answer.
TIMEOUT_S = 20
#: Job file of the best point of a search.
BEST = "best.toml"
#: Files of a study that are written while it runs.
FILES = ("study.csv", "study.db", "study.json")
#: Processes of --jobs at most.
MOST_JOBS = 1024


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "study", "file with a table [study], and the job or its name in it")
    add_folder(parser)
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="processes (default: one per processor); 1: this process only"
    )
    parser.add_argument("--dask", metavar="ADDRESS", help="run the cases on the Dask cluster with this scheduler")
    parser.add_argument("--restart", action="store_true", help="start again, regardless of the content of the folder")
    parser.add_argument("--row", type=int, metavar="CASE", help="write the job file of a case to --write, and stop")
    parser.add_argument("--write", metavar="FILE", help="file for --row; it finds the files of the job")
    parser.add_argument("--parquet", action="store_true", help="also the rows as study.parquet")


def run(args: argparse.Namespace) -> int:
    """Solve the missing cases and write the files; return 1 if a case has no answer, except in a search."""
    started = time.perf_counter()
    from ..base.errors import InputError
    from ..base.shown import library
    from ..study.job import read_study, run_study

    if args.jobs is not None and not 1 <= args.jobs <= MOST_JOBS:
        problem = f"must be >= 1 and <= {MOST_JOBS}"
        raise InputError("--jobs", args.jobs, problem, "the number of processors is the default")
    if (args.row is None) != (args.write is None):
        raise InputError("--row", args.row, "goes with --write", "give both: --row 17 --write best.toml")
    if args.parquet:  # refused before the work, not after it
        library("pyarrow")
    study = read_study(args.study)
    if args.row is not None:
        return _write_row(study, args.row, Path(args.write))

    from ..base.files import output_folder, whole_set, write_json
    from ..base.progress import Stopwatch, announce
    from ..study import optimum, statistics
    from ..study.search import Search

    searched: bool = study.table.design == "search"
    watch = Stopwatch({"program start": time.perf_counter() - started})
    folder = output_folder(args.out)
    with _goes_on(), ExitStack() as stack, watch.stage("cases"):
        where: dict[str, Any] = {"jobs": args.jobs}
        if args.dask is not None:
            where = _cluster(args.dask, stack)
        where["restart"] = args.restart
        if searched:
            search = stack.enter_context(Search(study, folder, **where))
            try:
                best = optimum.optimum(search)
            except KeyboardInterrupt:
                announce(optimum.interrupted_line(search))
                raise
            made, summary, lines = best.result, best.summary(), optimum.report_lines
        else:
            made, lines = run_study(study, folder, **where), statistics.report_lines
            with watch.stage("statistics"):
                summary = made.summary()
    with whole_set(folder, ("study*.png", "study.parquet", BEST), FILES) as place:
        if searched:
            _write_case(study, summary["best_case"], list(summary["best"].values()), place / BEST, folder)
        if args.parquet:
            made.to_parquet(place / "study.parquet")
        if not args.no_pictures:
            from ..figures.study import study_figures

            with watch.stage("pictures"):
                title = f"{Path(args.study).stem}: {len(made.done)} cases of a {study.table.job} job"
                study_figures(place, made, summary, title)
        watch.seconds["total"] = time.perf_counter() - started
        write_json(place / "summary.json", {**summary, "timings_s": dict(watch.seconds)})
        names = sorted([*FILES, *(path.name for path in place.iterdir())])
    bad, warnings = int((~made.done).sum()), []
    if bad:
        first = next(i for i, good in enumerate(made.done) if not good)
        example = f"case {made.cells['case'][first]}: {made.cells['message'][first]}"
        warnings.append(f"{bad} of {len(made.done)} cases are not solved wholly; {example}")
    print_results(lines(summary), folder, names, watch.seconds, warnings)
    return 1 if bad and not searched else 0


@contextmanager
def _goes_on() -> Iterator[None]:
    """Say how an interrupted study is continued."""
    from ..base.progress import announce

    try:
        yield
    except KeyboardInterrupt:
        announce("finished cases are kept in the output folder: the same command continues from there")
        raise


def _cluster(address: str, stack: ExitStack) -> dict[str, Any]:
    """Where cases run on a Dask cluster."""
    from ..base.errors import InputError, MissingLibraryError

    try:
        from dask.distributed import Client
    except ImportError:
        raise MissingLibraryError("--dask needs dask.distributed: pip install 'gearfe[cluster]'") from None
    logging.disable(logging.CRITICAL)  # `check` reports a lost connection
    stack.callback(logging.disable, logging.NOTSET)
    try:
        client = stack.enter_context(Client(address, timeout=TIMEOUT_S))
    except (OSError, ValueError, TimeoutError) as error:
        problem = f"does not answer ({type(error).__name__})"
        raise InputError("--dask", address, problem, "is the scheduler running there?") from None
    workers = sum(client.nthreads().values())
    if not workers:
        raise InputError("--dask", address, "has no workers", "start some: dask worker ADDRESS")

    def check() -> None:
        if client.status != "running":
            problem = f"does not answer any more ({client.status})"
            raise InputError("--dask", address, problem, "rows are kept: restart it and give the same command")

    return {"executor": client.get_executor(pure=False), "workers": workers, "check": check}


def _write_row(study: Any, number: int, path: Path) -> int:
    from ..base.errors import InputError

    if not study.cases:
        problem = "is of no case: a search has none beforehand"
        raise InputError("--row", number, problem, f"{BEST} next to its study.csv is its best point")
    if not 0 <= number < len(study.cases):
        raise InputError("--row", number, f"must be >= 0 and <= {len(study.cases) - 1}", "see the column case")
    _write_case(study, number, study.cases[number], path, path.absolute().parent)
    print(f"written: {path}")
    print(f"run it:  gearfe {study.table.job} {path} --out out/{path.stem}")
    return 0


def _write_case(study: Any, number: int, values: Sequence[Any], path: Path, folder: Path) -> None:
    """The job file of a case; it finds the files that it names from `folder`."""
    from ..base.files import whole_file
    from ..base.tables.text import toml_document
    from ..study.case import job_beside

    named = dict(zip(study.task.names, values, strict=True))
    head = f"# Case {number} of the study {study.path.name}: " + ", ".join(f"{k} = {v!r}" for k, v in named.items())
    raw = job_beside(study.task.tables(values), study.task.path.parent, folder.absolute())
    with whole_file(path) as temporary:
        temporary.write_text(f"{head}\n\n{toml_document(raw)}", encoding="utf-8", newline="\n")
