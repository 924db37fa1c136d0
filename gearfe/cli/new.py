"""``gearfe new KIND|JOB.toml [FILE]``: write a commented job file to start from, or a shipped job with its files."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..base.tables.examples import JOBS, RUN_BY, job_file

#: Command that runs a job with these tables, the first one that is there.
RUNS = {
    "bodies": "mechanism",
    "study": "study",
    "microgeometry": "loadmap",
    "train": "vibration",
    "housing": "housing",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("kind", nargs="?", metavar="KIND", help=f"{', '.join(JOBS)}, or a shipped job, as housing.toml")
    parser.add_argument("file", nargs="?", metavar="FILE", help="file to write (default: KIND.toml)")
    parser.add_argument("--list", action="store_true", help="tell the kinds and the shipped jobs")
    parser.add_argument("--force", action="store_true", help="replace files that exist")


def run(args: argparse.Namespace) -> int:
    """Write the file."""
    from ..base.errors import InputError, unknown_name
    from ..base.files import whole_file

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
        if path.exists() and not args.force and (path == target or path.read_bytes() != content):
            raise InputError("file", str(path), "exists", "choose another name, or give --force to replace it")
    for path, content in files.items():
        with whole_file(path) as temporary:
            temporary.write_bytes(content)
    print("written: " + ", ".join(map(str, files)))
    print(f"run it:  gearfe {_command(args.kind, text)} {target}")
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
