"""``gearfe mechanism``: integrate a planar mechanism from its TOML file and write tables, summary and pictures."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.tables.mechanism import RunTable, read_mechanism_file
from .arguments import add_folder, add_job, add_keys, print_results, with_keys

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..mechanisms.job import Outcome
    from ..mechanisms.model import Mechanism
    from ..mechanisms.results import Results
    from ..multibody.core.modes import Modes

#: Keys of [run] that options stand for, beside the end of the run.
KEYS = ("analysis", "tolerance", "method", "reactions", "modes")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "file", "mechanism file (TOML, see docs/mechanisms.md)")
    add_folder(parser)
    add_keys(parser, RunTable, *KEYS, until="end_s")
    parser.add_argument(
        "--sensitivity",
        action="append",
        metavar="KEY",
        help="write the slopes of all outputs by this key, as bodies.rod.mass_kg; may be given several times",
    )
    parser.add_argument("--no-estimate", action="store_true", help="leave out the finer runs that estimate the error")
    parser.add_argument(
        "--animation", action="store_true", help="write animation.gif, and animation.html with a slider over the time"
    )


def run(args: argparse.Namespace) -> int:
    """Run the command; 1 when the run stopped before its end or an output is not finite."""
    # mistakes in the file show before NumPy and SciPy load
    file = read_mechanism_file(args.file)
    file = replace(file, run=with_keys(args, file.run, *KEYS, until="end_s"))
    if args.sensitivity:
        file = replace(file, run=replace(file.run, sensitivities=tuple(args.sensitivity)))
    file.run.check("run")
    if args.default_out and file.run.analysis != "transient":  # no analysis removes the files of another one
        args.out = str(Path(args.out).with_name(file.run.analysis))

    from ..base.files import recorded
    from ..base.progress import announce
    from ..mechanisms.job import run_mechanism
    from ..mechanisms.links import doubts
    from ..mechanisms.model import make_mechanism
    from ..mechanisms.unused import unused

    for doubt in (*doubts(file), *unused(file)):  # the run may not begin, or not end
        announce(f"warning: {doubt}")
    mechanism = make_mechanism(file, Path(args.file))
    run: Callable[..., Outcome]
    folder, slopes = Path(args.out), None
    if file.run.sensitivities:
        from ..mechanisms.sensitivity import sensitivities

        slopes = sensitivities(args.file, file.run.sensitivities, run=file.run)
    if file.run.analysis in ("equilibrium", "modes"):
        from ..mechanisms.rest import run_rest

        draw = None if args.no_pictures else partial(_draw_rest, mechanism)
        run = partial(run_rest, draw=draw)
    else:
        drawn = partial(_draw, mechanism, args) if args.animation or not args.no_pictures else None
        run = partial(run_mechanism, estimate=not args.no_estimate, draw=drawn)
    with recorded() as written:
        outcome = run(mechanism, folder, slopes=slopes)
    names = sorted(name for one in written for name in one.names)
    print_results(outcome.text.splitlines(), folder, names, {}, [outcome.stopped] if outcome.stopped else ())
    return 0 if outcome.complete else 1


def _draw(mechanism: Mechanism, args: argparse.Namespace, folder: Path, results: Results) -> None:
    from ..figures.mechanism import draw_animation, draw_figures
    from ..figures.mechanism_page import write_page

    if not args.no_pictures:
        draw_figures(folder, mechanism, results)
    if args.animation:
        draw_animation(folder, mechanism, results.trajectory)
        write_page(folder, mechanism, results.trajectory)


def _draw_rest(mechanism: Mechanism, folder: Path, results: Results, modes: Modes | None) -> None:
    from ..figures.mechanism import draw_figures, draw_modes

    draw_figures(folder, mechanism, results)
    if modes is not None:
        draw_modes(folder, mechanism, results.trajectory.q[0], modes)
