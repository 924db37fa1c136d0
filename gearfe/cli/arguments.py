"""What commands share: their parser, options, and what they print. What follows an option belongs to it where it can.

``argparse`` hands everything up to the next option to one that takes any number of values, so that
``--fields JOB.toml`` leaves no job. Here such an option takes the values that its type accepts. An option for any text
returns its last values while a positional argument is missing.
"""

from __future__ import annotations

import argparse
import importlib
import re
import sys
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..base.config import JobFile, check_range, fields_of, type_hints
from ..base.errors import InputError, MissingLibraryError, nearest, unknown_name
from ..base.other_units import RADIANS, RPM, as_written, partner
from ..base.tables.report import ReportTable

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from ..base.tables.gearbox import NamedMesh

Table = TypeVar("Table", bound="DataclassInstance")
#: What a help calls the value of an option.
METAVARS = {float: "X", int: "N", str: "NAME"}
#: Shortest stage that is printed (s).
SHORTEST_S = 0.1
#: What a help calls a job file.
METAVARS_OF_FILES = {"job": "JOB.toml", "study": "STUDY.toml"}
#: Formats of ``--format`` beside CSV; their writers are in `gearfe.output.exchange.tables`.
FORMATS = ("npz", "h5", "mat", "uff")
REPORT = "report.html"
#: Keys of [report] that options stand for: option -> key.
HEADING = {"report_title": "title", "author": "author", "remark": "remark", "report_date": "date"}

_NUMBER = re.compile(r"-(\d|\.\d|inf|nan)", re.IGNORECASE)


class CommandParser(argparse.ArgumentParser):
    """Parser of one command; mistakes are `InputError`. The help ends with the `example`, a line that can be copied."""

    def __init__(self, *, example: str = "", **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)
        self._example = example
        self._refused: dict[str, str] = {}  # word -> option that could not take it

    def format_help(self) -> str:
        """Text of the help; ``argparse`` itself would break the example's line."""
        return super().format_help() + (self._example and f"\nexample: {self._example}\n")

    def print_help(self, file: Any = None) -> None:
        """Print the help; ``argparse`` itself keeps silent where it cannot be written."""
        print(self.format_help(), end="", file=file)

    def error(self, message: str) -> Any:
        """Tell a mistake in the words of ``argparse``."""
        raise InputError("command line", None, message, f"{self.prog} --help lists the options")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Namespace of the arguments.

        Raises
        ------
        InputError
            For an unknown option, a missing argument, or a value that cannot be read.
        """
        made, rest = self.parse_known_args(self._sorted(args), namespace)
        if rest:
            if rest[0].startswith("-"):
                raise unknown_name("command line", rest[0].split("=")[0], self._option_string_actions)
            word, option = next(iter(self._refused.items()), (rest[0], ""))
            problem = f"is no value of {option}" if option else "is one argument too many"
            raise InputError("command line", word, problem, f"{self.prog} --help shows the usage")
        return made

    def _sorted(self, args: Sequence[str]) -> list[str]:
        """Options with their values first, then ``--`` and the positional arguments."""
        groups: list[tuple[list[str], int]] = []  # an option with its values, and how many it keeps
        positionals: list[str] = []
        left = list(args)
        while left:
            word = left.pop(0)
            if word == "--":
                positionals += left
                break
            if not _is_option(word):
                positionals.append(word)
                continue
            action = self._option_string_actions.get(word)  # one with =VALUE, or unknown, stands alone
            least, most = (0, 0) if action is None else _counts(action)
            group = [word]
            while left and len(group) <= most and left[0] != "--" and not _is_option(left[0]):
                if len(group) > least and not self._accepts(action, left[0]):
                    self._refused[left[0]] = word
                    break
                group.append(left.pop(0))
            groups.append((group, least if action is None or action.type is None else len(group)))
        needed = sum(not action.option_strings and action.nargs is None for action in self._actions)
        for group, least in reversed(groups):
            while len(positionals) < needed and len(group) - 1 > least:
                positionals.insert(0, group.pop())
        return [*(word for group, _ in groups for word in group), *(["--", *positionals] if positionals else [])]

    def _accepts(self, action: Any, word: str) -> bool:
        try:
            self._get_values(action, [word])
        except argparse.ArgumentError:
            return False
        return True


def _is_option(word: str) -> bool:
    return len(word) > 1 and word.startswith("-") and word != "--" and not _NUMBER.match(word)


def _counts(action: argparse.Action) -> tuple[int, float]:
    """Least and largest number of values of an option."""
    several: dict[Any, tuple[int, float]] = {"?": (0, 1), "*": (0, float("inf")), "+": (1, float("inf")), None: (1, 1)}
    return several[action.nargs] if action.nargs in several else (count := int(action.nargs or 0), count)


def check_option(option: str, value: Any, table: type, key: str) -> None:
    """Check the value of an option against a key of a table.

    Parameters
    ----------
    option : str
        Option, for messages.
    value : Any
        Its value.
    table : type
        Class of the table.
    key : str
        Key of the table.

    Raises
    ------
    InputError
        If the key does not allow the value.
    """
    known = fields_of(table)[key].metadata
    if isinstance(value, (int, float)):
        check_range(value, option, known)
    elif (choices := known["choices"]) and value not in choices:
        cure = (known.get("gone") or {}).get(value) or nearest(value, choices)
        raise InputError(option, value, "must be one of " + ", ".join(choices), cure)


def add_keys(parser: Any, table: type, *keys: str, **renamed: str) -> None:
    """Options that stand for keys of a table: kind, choices and text are those of the key.

    Parameters
    ----------
    parser
        A parser, or a group of one.
    table
        Dataclass whose fields are made with `gearfe.base.config.quantity`.
    keys
        Keys whose option has their name, ``a_key`` as ``--a-key``.
    renamed
        Option -> key, where the names differ.
    """
    hints = type_hints(table)
    for name, key in ({k: k for k in keys} | renamed).items():
        known = fields_of(table)[key].metadata
        instead = known["doc"].removeprefix("true: ") + _default_of(fields_of(table)[key])
        options: dict[str, Any] = {"dest": name, "help": instead.replace("%", "%%")}
        kinds = [kind for kind in typing.get_args(hints[key]) or (hints[key],) if kind is not type(None)]
        if kinds == [bool]:
            options |= {"action": "store_const", "const": True}
        else:
            options |= {"type": kinds[0], "metavar": "|".join(known["choices"] or ()) or METAVARS[kinds[0]]}
        if other := partner(name):
            place = parser.add_mutually_exclusive_group() if isinstance(parser, argparse.ArgumentParser) else parser
            place.add_argument(_option(name), **options)
            unit, factor = ("1/min", RPM) if name.endswith(RADIANS) else ("rad/s", 1.0 / RPM)
            help_ = f"the same in {unit}, instead of {_option(name)}"
            place.add_argument(
                _option(other), dest=name, type=_converter(_option(other), factor), metavar="X", help=help_
            )
            continue
        parser.add_argument(_option(name), **options)


class _Converted(float):
    """Hold a speed in the unit of a key, with the option and number given in the other unit."""

    option = ""
    written = 0.0


def _converter(option: str, factor: float) -> Callable[[str], float]:
    """Return the type of an option whose numbers times a factor are those of a key."""

    def convert(text: str) -> float:
        try:
            written = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} must be a number") from None
        value = _Converted(factor * written)
        value.option, value.written = option, written
        return value

    return convert


def _default_of(field: Any) -> str:
    """The default of a key, for a help; an option that is not given leaves the file's value."""
    default = field.default
    plain = isinstance(default, (int, float, str)) and not isinstance(default, bool) and default != ""
    return f" (default: the file's, or {default})" if plain and "default" not in field.metadata["doc"] else ""


def add_job(parser: argparse.ArgumentParser, dest: str, help_: str) -> None:
    """The job file as an argument, and ``--set`` for any key of it."""
    parser.add_argument(dest, metavar=METAVARS_OF_FILES.get(dest, "FILE.toml"), type=JobFile, help=help_)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="changes",
        metavar="KEY=VALUE",
        help="another value for a key of the file, as table.key=21; may be given several times",
    )


def add_mesh(parser: argparse.ArgumentParser) -> None:
    """``--mesh``, for commands that compute single meshes."""
    parser.add_argument(
        "--mesh",
        metavar="NAME",
        help="one mesh of the file, in a folder of its name (default: that of [pair], or all)",
    )


def each_mesh(
    args: argparse.Namespace, run_mesh: Callable[[argparse.Namespace, NamedMesh], int], variant: str | None = None
) -> int:
    """Run a command for the mesh of ``--mesh``, or for all meshes of the file, each in its own folder.

    Parameters
    ----------
    args : Namespace
        Parsed command line.
    run_mesh : callable
        What computes a mesh, with the arguments whose ``out`` is its folder; returns 0, or 1 where a part failed.
    variant : str, optional
        Variant of [train] whose keys override [stiffness].

    Returns
    -------
    int
        Largest of what `run_mesh` returns.
    """
    from ..base.config import read_toml
    from ..base.tables.jobs import meshes_of
    from ..base.tables.names import check_folders

    # mistakes in the file show before NumPy, SciPy and the finite elements load
    meshes = meshes_of(read_toml(args.job), args.job, args.mesh, variant)
    if len(meshes) == 1 and args.mesh is None:
        return run_mesh(args, meshes[0])
    check_folders([mesh.name for mesh in meshes])
    if len(meshes) > 1:
        from ..gears.geometry.pair import pair_of

        for mesh in meshes:  # mistakes in the last one show before the first is computed
            pair_of(mesh)
    codes = []
    for mesh in meshes:
        if len(meshes) > 1:
            print(mesh.described)
        codes.append(run_mesh(argparse.Namespace(**{**vars(args), "out": str(Path(args.out) / mesh.name)}), mesh))
    return max(codes)


def add_folder(parser: argparse.ArgumentParser) -> None:
    """``--out``, and how the results in that folder are kept and printed."""
    command = parser.prog.split()[-1]
    parser.add_argument("--out", metavar="DIR", default=None, help=f"output folder (default: out/JOB/{command})")
    parser.set_defaults(folder_of=command)
    parser.add_argument(
        "--format",
        metavar="NAME",
        default="csv",
        help=f"tables also as tables.NAME: {', '.join(FORMATS)}, or several, as mat,h5 (default: only csv)",
    )
    parser.add_argument(
        "--report", action="store_true", help=f"gears, results, errors, pictures and job in one page, {REPORT}"
    )
    add_heading(parser)
    add_json(parser)
    add_pictures(parser)


def add_heading(parser: argparse.ArgumentParser) -> None:
    """Options of the heading of a report."""
    add_keys(parser, ReportTable, **HEADING)


def add_pictures(parser: argparse.ArgumentParser) -> None:
    """``--no-pictures``."""
    parser.add_argument("--no-pictures", action="store_true", help="leave out the pictures")


def add_json(parser: argparse.ArgumentParser) -> None:
    """``--json``: the summary in the output folder, or what a command that has none leaves in ``args.summary``."""
    parser.add_argument("--json", action="store_true", help="print only the summary, as JSON")


def command_module(name: str) -> Any:
    """Module of a command (its contract is in `gearfe.cli`)."""
    return importlib.import_module(f".{name}", __package__)


def parser_of(module: Any, name: str, summary: str, example: str) -> CommandParser:
    """Return the parser of a command module, with the options that all commands have.

    Parameters
    ----------
    module : module
        Command module, see `gearfe.cli`.
    name : str
        Words by which the command is called.
    summary : str
        One line of help.
    example : str
        An example call.
    """
    parser = CommandParser(prog=name, description=summary, example=example)
    module.add_arguments(parser)
    group = parser.add_mutually_exclusive_group()
    group.add_argument("-q", "--quiet", action="store_true", help="print warnings and errors only")
    group.add_argument("-v", "--verbose", action="store_true", help="print a line for each stage of the work")
    return parser


def job_of(parsed: argparse.Namespace) -> JobFile | None:
    """The job file among the arguments, if any."""
    return next((value for value in vars(parsed).values() if isinstance(value, JobFile)), None)


def completed(parsed: argparse.Namespace) -> argparse.Namespace:
    """Complete the arguments: the job file with the changes of ``--set``, and the names of ``--format``.

    The default of ``--out`` is ``out/JOB/COMMAND``, so that no command overwrites the summary of another.
    """
    for dest, value in vars(parsed).items():
        if isinstance(value, JobFile):
            setattr(parsed, dest, JobFile(value, parsed.changes))
    parsed.default_out = getattr(parsed, "folder_of", None) is not None and parsed.out is None
    if parsed.default_out:
        parsed.out = str(Path("out") / Path(str(job_of(parsed))).stem / parsed.folder_of)
    if not getattr(parsed, "report", True):
        for dest in HEADING:
            if getattr(parsed, dest, None) is not None:
                problem = "has no effect without --report"
                raise InputError(_option(dest), getattr(parsed, dest), problem, "add --report, or leave it out")
    parsed.format = _formats(getattr(parsed, "format", "csv"))
    return parsed


def _formats(text: str) -> tuple[str, ...]:
    """Formats beside CSV that a value of ``--format`` names."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in ("csv", *FORMATS):
            raise InputError("--format", text, "must name formats of " + ", ".join(("csv", *FORMATS)), "as mat,h5")
    if "uff" in names and find_spec("pyuff") is None:  # refused before the work, not after it
        raise MissingLibraryError("universal files need pyuff: pip install 'gearfe[exchange]'")
    return tuple(dict.fromkeys(name for name in names if name != "csv"))


def with_keys(args: argparse.Namespace, table: Table, *keys: str, **renamed: str) -> Table:
    """Return a table with the values of the options that were given, each checked.

    Parameters
    ----------
    args : Namespace
        Parsed command line.
    table : dataclass
        The table.
    *keys : str
        Keys whose options have the same name.
    **renamed : str
        Name of an option = its key.

    Raises
    ------
    InputError
        For a value that a key does not allow.
    """
    changes: dict[str, Any] = {}
    for name, key in ({k: k for k in keys} | renamed).items():
        value = getattr(args, name)
        if value is not None:
            try:
                check_option(_option(name), value, type(table), key)
            except InputError as error:
                if not isinstance(value, _Converted):
                    raise
                raise as_written(error, _option(name), value.option, value.written) from None
            changes[key] = float(value) if isinstance(value, _Converted) else value
    return replace(table, **changes)


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


class _Removed(argparse.Action):
    """Option of a removed key: what to write instead."""

    def __init__(self, option_strings: Sequence[str], dest: str, instead: tuple[str, str]) -> None:
        super().__init__(option_strings, dest, nargs="?", help=argparse.SUPPRESS)
        self.instead = instead

    def __call__(self, _parser: Any, _namespace: Any, values: Any, option_string: str | None = None) -> None:
        raise InputError(str(option_string), values, *self.instead)


def add_removed(parser: argparse.ArgumentParser, removed: Mapping[str, tuple[str, str]]) -> None:
    """Options of removed keys, which the help does not show; see ``REMOVED`` in `gearfe.base.config.build`."""
    for key, instead in removed.items():
        parser.add_argument("--" + key.replace("_", "-"), action=_Removed, instead=instead)


def number(option: str, text: str) -> float:
    """The number that an option's text is."""
    try:
        return float(text)
    except ValueError:
        raise InputError(option, text, "must be a number", "write it as 1e-3 or 2") from None


def print_results(
    lines: Iterable[str], folder: Path, names: Iterable[str], seconds: Mapping[str, float], warnings: Iterable[str]
) -> None:
    """Print results, names of files and seconds of stages, and warnings to standard error.

    Parameters
    ----------
    lines : iterable of str
        What the command found.
    folder : Path
        Folder of the files.
    names : iterable of str
        Their names.
    seconds : mapping
        Stage -> seconds.
    warnings : iterable of str
        Sentences.
    """
    for line in lines:
        print(line)
    print(f"written to {folder}: " + ", ".join(names))
    if seconds:
        long = {name: value for name, value in seconds.items() if value >= SHORTEST_S or name == "total"}
        print("seconds: " + ", ".join(f"{name} {value:.2f}" for name, value in long.items()))
    for sentence in warnings:
        print(f"gearfe: warning: {sentence}", file=sys.stderr)
