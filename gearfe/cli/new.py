"""``gearfe new KIND|JOB.toml [FILE]``, ``gearfe new --from MODEL.rexs [FILE]``: write a commented job to start from.

A kind of job with all its keys, a shipped job with its files, or the gearbox of a REXS file.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from ..base.tables.examples import JOBS, RUN_BY, job_file

#: Command that runs a job with these tables, the first one that is there.
RUNS = {
    "bodies": "mechanism",
    "study": "study",
    "rating": "rating",
    "microgeometry": "loadmap",
    "train": "vibration",
    "housing": "housing",
}

#: Endings of REXS files, not of version numbers in a name.
ENDING = re.compile(r"(\.(rexs[jz]?|xml|json|zip))+$", re.IGNORECASE)
#: Parts of one kind without a key that are printed each with its reason.
MOST_LEFT = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("kind", nargs="?", metavar="KIND", help=f"{', '.join(JOBS)}, or a shipped job, as housing.toml")
    parser.add_argument("file", nargs="?", metavar="FILE", help="file to write (default: KIND.toml)")
    parser.add_argument("--list", action="store_true", help="list the kinds and the shipped jobs")
    parser.add_argument(
        "--from",
        dest="source",
        metavar="MODEL",
        help="instead of a kind: gearbox of a REXS file (.rexs, .rexsj, .rexsz)",
    )
    parser.add_argument(
        "--load-case",
        type=int,
        metavar="N",
        help="load case of that file whose loads and speeds are used (default: the first)",
    )
    parser.add_argument("--force", action="store_true", help="replace files that exist")


def run(args: argparse.Namespace) -> int:
    """Write the file."""
    from ..base.errors import InputError, unknown_name
    from ..base.files import whole_file

    if args.source is not None:
        return _from_rexs(args)
    if args.load_case is not None:
        raise InputError("--load-case", args.load_case, "is of a REXS file", "add --from MODEL.rexs")
    shipped = {path.name: path for folder in _folders() for path in sorted(folder.glob("*.toml"))}
    if args.list or args.kind is None:
        for name, (about, *_) in JOBS.items():
            print(f"  {name:<26} {about}")
        for name, path in shipped.items():
            print(f"  {name:<26} {_first_line(path)}")
        return 0
    if args.kind not in (*JOBS, *shipped):
        raise unknown_name("kind of job", args.kind, (*JOBS, *shipped))
    target = Path(args.file or (args.kind if args.kind in shipped else f"{args.kind}.toml"))
    if target.is_dir():
        raise InputError("file", str(target), "is a folder", f"name a file in it, as {target / args.kind}.toml")
    source = shipped.get(args.kind)
    text = job_file(args.kind) if source is None else source.read_text(encoding="utf-8")
    named = [] if source is None else [p for p in source.parent.iterdir() if p != source and _names(text, p.name)]
    files = {target: text.encode(), **{target.parent / path.name: path.read_bytes() for path in named}}
    for path, content in files.items():
        if path == target or (path.exists() and path.read_bytes() != content):
            _check_free(path, args.force)
    for path, content in files.items():
        with whole_file(path) as temporary:
            temporary.write_bytes(content)
    print("written: " + ", ".join(map(str, files)))
    print(f"run it:  gearfe {_command(args.kind, text)} {target}")
    return 0


def _check_free(path: Path, force: bool) -> None:
    """Raise `InputError` for a file that exists and may not be replaced."""
    from ..base.errors import InputError

    if path.exists() and not force:
        raise InputError("file", str(path), "exists", "choose another name, or give --force to replace it")


def _from_rexs(args: argparse.Namespace) -> int:
    """Write the job of a REXS file, and print what became of its values."""
    from ..base.errors import InputError
    from ..base.files import whole_file
    from ..output.exchange.rexs import rexs_job
    from ..output.exchange.rexs.ledger import KINDS

    if args.file is not None or args.list:
        given = args.file if args.file is not None else "--list"
        raise InputError("file", given, "conflicts with --from", "write gearfe new --from MODEL.rexs [FILE]")
    source = Path(args.source)
    target = Path(args.kind or f"{re.sub(ENDING, '', source.name) or 'rexs'}.toml")
    if target.is_dir():
        raise InputError("file", str(target), "is a folder", f"name a file in it, as {target / 'gearbox.toml'}")
    job = rexs_job(source, load_case=args.load_case)
    _check_free(target, args.force)
    with whole_file(target) as temporary:
        temporary.write_text(job.text(source.name), encoding="utf-8", newline="\n")
    print(f"written: {target}")
    print("values of the model: " + ", ".join(f"{job.count(kind)} {kind}" for kind in KINDS) + " (listed in the file)")
    for kind in dict.fromkeys(kind for kind, _ in job.left):
        reasons = {name: reason for (table, name), (_, reason) in job.left.items() if table == kind}
        for name, reason in list(reasons.items())[:MOST_LEFT]:
            print(f"not in the job, a comment in the file: {kind} {name}: {reason}".replace(" :", ":"))
        if len(reasons) > MOST_LEFT:
            print(f"... and {len(reasons) - MOST_LEFT} more {kind}, comments in the file")
    print(f"look at it:  gearfe gear {target}")
    return 0


def _names(text: str, name: str) -> bool:
    """Whether a job names a file: the whole of its name, not the end of another one's."""
    import re

    return re.search(rf"(?<![\w.-]){re.escape(name)}(?![\w-])", text) is not None


def _command(kind: str, text: str) -> str:
    """Command that runs a job."""
    import tomllib

    tables = tomllib.loads(text)
    return (
        RUN_BY.get(kind, kind) if kind in JOBS else next((RUNS[name] for name in RUNS if name in tables), "stiffness")
    )


def _folders() -> list[Path]:
    """Folders of the shipped jobs: in the installed package, or beside it in a copy of the repository."""
    package = Path(__file__).parents[1]
    found = (
        [package / "examples"]
        if (package / "examples").is_dir()
        else [package.parent / n for n in ("geometry", "meshes")]
    )
    return [folder for folder in found if folder.is_dir()]


def _first_line(path: Path) -> str:
    """What a job says of itself in its first line."""
    with path.open(encoding="utf-8") as stream:
        return stream.readline().lstrip("# ").rstrip()
