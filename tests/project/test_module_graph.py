"""What modules of the package import, wherever the import stands: for types alone, or within a function."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.places import ROOT

COMMANDS = (ROOT / "gearfe" / "commands").glob("*.py")
#: Modules that load what a job needs only when it runs: the package itself, the commands, the kinds of a study.
LAZY = ("gearfe", "gearfe.cli.main", "gearfe.study.kinds", *(f"gearfe.cli.{path.stem}" for path in COMMANDS))
#: Other imports of the package within functions: what is heavy behind them.
HEAVY = {
    (
        "gearfe.drivetrain.housing.body",
        "gearfe.drivetrain.housing.build",
    ): "sparse matrices; a reduced body is read from the cache",
    ("gearfe.drivetrain.housing.body", "gearfe.drivetrain.housing.superelement"): "sparse matrices",
    ("gearfe.drivetrain.housing.body", "gearfe.fem.meshing.mesh_file"): "readers of meshes",
    ("gearfe.drivetrain.gearbox.job", "gearfe.fem.beams"): "beams; for elastic shafts only",
    ("gearfe.drivetrain.train.model", "gearfe.drivetrain.train.elastic_shaft"): "beams; for elastic shafts only",
    ("gearfe.mechanisms.plates", "gearfe.fem.plane"): "finite elements",
    ("gearfe.mechanisms.plates", "gearfe.fem.meshing.mesh_file"): "readers of meshes",
    ("gearfe.mechanisms.plates", "gearfe.fem.reduction.plate"): "finite elements",
    ("gearfe.mechanisms.plates", "gearfe.fem.reduction.plate_data"): "the package of finite elements",
    ("gearfe.mechanisms.plates", "gearfe.fem.meshing.plate_mesh"): "the mesher",
    ("gearfe.gears.gearmesh.law_store", "gearfe.gears.contact.half_plane"): "scipy; a law is read from the cache",
    ("gearfe.gears.gearmesh.law_store", "gearfe.gears.gearmesh.law_make"): "scipy; a law is read from the cache",
    ("gearfe.gears.gearmesh.law_store", "gearfe.gears.gearmesh.sweep"): "scipy; a law is read from the cache",
    ("gearfe.multibody.compiled.kernels", "gearfe.multibody.compiled.packed_type"): "numba",
    ("gearfe.gears.gearmesh.check", "gearfe.gears.contact.whole_gears.pair"): "finite elements of whole gears",
    ("gearfe.gears.gearmesh.check", "gearfe.gears.contact.whole_gears.position"): "finite elements of whole gears",
    ("gearfe.gears.gearmesh.job", "gearfe.gears.gearmesh.sweep"): "scipy; a curve is read from the cache",
    ("gearfe.drivetrain.gearbox.fields", "gearfe.fem.bodies.mesh_checks"): "sparse matrices",
    (
        "gearfe.drivetrain.gearbox.mesh_stiffness",
        "gearfe.gears.gearmesh.width_spring",
    ): "elastic teeth in space; for loads that vary along the width only",
    (
        "gearfe.drivetrain.gearbox.mesh_stiffness",
        "gearfe.gears.gearmesh.width_job",
    ): "elastic teeth in space; for loads that vary along the width only",
    (
        "gearfe.drivetrain.gearbox.mesh_stiffness",
        "gearfe.gears.gearmesh.width_law_store",
    ): "the same",
    (
        "gearfe.drivetrain.gearbox.mesh_stiffness",
        "gearfe.drivetrain.gearbox.springs_train",
    ): "statics and ratings; for such loads only",
    ("gearfe.gears.gearmesh.width_law_store", "gearfe.gears.width"): "scipy; a law is read from the cache",
    (
        "gearfe.gears.gearmesh.width_law_store",
        "gearfe.gears.gearmesh.width_law_make",
    ): "scipy; a law is read from the cache",
    (
        "gearfe.figures.flanks",
        "gearfe.gears.gearmesh.width_job",
    ): "elastic teeth; for modifications along the width only",
    ("gearfe.drivetrain.runup.train_stability", "gearfe.drivetrain.runup.condensed"): "run-ups; where they apply",
    ("gearfe.drivetrain.runup.train_stability", "gearfe.drivetrain.runup.run_up"): "the same",
    ("gearfe.drivetrain.runup.train_stability", "gearfe.drivetrain.runup.stability"): "the same",
    ("gearfe.figures.style", "gearfe.figures.canvas"): "matplotlib's axes; imported when the first picture is drawn",
    ("gearfe.base.tables.parameters", "gearfe.base.expressions"): "numpy; for files with expressions only",
    ("gearfe.base.tables.jobs", "gearfe.base.tables.carrier"): "40 ms for the tables of trains; for trains only",
    ("gearfe.base.tables.jobs", "gearfe.base.tables.train_gearbox"): "the same; for trains only",
}
#: Modules that import by name, and what they name: parts of their own package, of packages below, of other programs.
BY_NAME = {
    "gearfe": "public names, which load at their first use",
    "gearfe.cli.arguments": "the modules of the commands, beside it",
    "gearfe.gears.contact.laws": "contact laws: its own, and those of other programs",
    "gearfe.figures.results": "pictures, beside it",
    "gearfe.base.isolation": "libraries that read settings from the working folder",
    "gearfe.mechanisms.parts": "joints and forces of gearfe.multibody",
    "gearfe.base.shown": "pandas and xarray",
    "gearfe.study.journal": "msvcrt, of Windows",
    "gearfe.base.tables.jobs": "tables, beside it",
}


class Import(NamedTuple):
    """An import of a module of the package."""

    name: str
    line: int
    in_function: bool


def sources() -> dict[str, Path]:
    """Module -> its file."""
    found = {}
    for path in sorted((ROOT / "gearfe").rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


SOURCES = sources()
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in SOURCES.items()}


def statements(tree: ast.AST, in_function: bool = False) -> Iterator[tuple[ast.AST, bool]]:
    """All nodes, and whether they stand in a function."""
    for node in ast.iter_child_nodes(tree):
        yield node, in_function
        yield from statements(
            node, in_function or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        )


def imports(module: str) -> Iterator[Import]:
    """What a module imports of the package, type-checking imports and those in functions included."""
    is_package = SOURCES[module].name == "__init__.py"
    package = module.split(".") if is_package else module.split(".")[:-1]
    for node, in_function in statements(TREES[module]):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            # a name imported from a package is a module of it, or of the package itself
            names = [full if (full := f"{source}.{a.name}") in SOURCES else source for a in node.names]
        else:
            continue
        yield from (Import(name, node.lineno, in_function) for name in names if name in SOURCES and name != module)


GRAPH = {module: list(imports(module)) for module in SOURCES}


def test_no_module_comes_back_to_itself() -> None:
    order = graphlib.TopologicalSorter({module: {one.name for one in found} for module, found in GRAPH.items()})
    try:
        order.prepare()
    except graphlib.CycleError as error:
        pytest.fail(" <- ".join(error.args[1]))


def test_nothing_but_the_commands_imports_the_whole_package() -> None:
    users = {module for module, found in GRAPH.items() for one in found if one.name == "gearfe"}
    assert users <= {"gearfe.cli.main"}


def test_functions_import_only_what_is_heavy() -> None:
    lazy = {
        (module, one.name)
        for module, found in GRAPH.items()
        for one in found
        if one.in_function and module not in LAZY and not module.startswith("gearfe.cli.")
    }
    assert lazy == set(HEAVY)


def test_modules_that_import_by_name_are_known() -> None:
    users = {
        module
        for module, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and getattr(node.func, "attr", getattr(node.func, "id", "")) in ("import_module", "__import__")
    }
    assert users == set(BY_NAME)


def test_names_of_joints_and_forces_are_those_of_a_package_below() -> None:
    from gearfe.base.tables.kinds import FORCES, JOINTS

    for kind in (*JOINTS.values(), *FORCES.values()):
        assert kind.reference.startswith("gearfe.multibody.planar.")
