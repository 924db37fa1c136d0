"""``gearfe new stiffness|microgeometry|study|vibration|mechanism [FILE]``: write a commented job file to start from."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "write a commented job file to start from: stiffness, microgeometry, study, vibration or mechanism"

KINDS = ("stiffness", "microgeometry", "study", "vibration", "mechanism")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("kind", metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("file", nargs="?", metavar="FILE", help="file to write (default: KIND.toml)")
    parser.add_argument("--force", action="store_true", help="replace the file when it exists")


def run(args: argparse.Namespace) -> int:
    """Write the file."""
    from ..errors import InputError, unknown_name
    from ..output.files import whole_file
    from ..tables.examples import job_file

    if args.kind not in KINDS:
        raise unknown_name("kind of job", args.kind, KINDS)
    target = Path(args.file or f"{args.kind}.toml")
    if target.is_dir():
        raise InputError("file", str(target), "is a folder", f"name a file in it, as {target / args.kind}.toml")
    if target.exists() and not args.force:
        raise InputError("file", str(target), "exists", "choose another name, or give --force to replace it")
    text = job_file(args.kind)
    with whole_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(f"written: {target}")
    print(f"run it:  gearfe {args.kind} {target} --out out/{target.stem}")
    return 0
