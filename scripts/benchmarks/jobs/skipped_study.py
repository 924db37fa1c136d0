"""What is skipped, and what each omission saves: the same result with and without it, in processor seconds.

`tests/project/test_skipped.py` proves for each that the skipped thing is not touched and that the result is the same.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.gears.gearmesh.positions import position_solver
from gearfe.gears.gearmesh.sweep import elastic_pair, sweep_stiffness
from tests.places import GEOMETRY, ROOT

from .record import Record
from .subject import housing_of, shipped_housing, shipped_pair
from .sweep_study import assembled_pair
from .timing import measured

TWIST = math.radians(0.05)


def run_skipped(record: Record) -> None:
    """The table of omissions."""
    table = record.table("skipped", "what")
    for what, make in OMISSIONS.items():
        record.row(table, {"what": what}, partial(_measured, make, record.quick))


def _measured(make: Callable[[bool], tuple[float, float, str]], quick: bool) -> Mapping[str, Any]:
    return _saved(*make(quick))


def _saved(short: float, long: float, note: str = "") -> Mapping[str, Any]:
    return {"skipped_s": short, "not_skipped_s": long, "saved_s": long - short, "times": long / short, "note": note}


def _cpu(job: Callable[[], Any], runs: int = 2) -> float:
    return measured(job, runs=runs, most_s=15.0)[1].cpu_s


def one_sector(quick: bool) -> tuple[float, float, str]:
    """Condensing one tooth sector of each gear; assembling and factorising the whole gears once."""
    from gearfe.fem.reduction.sparse_solver import factorize

    pair, coarsen = shipped_pair(), 5.0 if quick else 2.0
    short = _cpu(lambda: elastic_pair(pair, coarsen=coarsen))

    def whole() -> None:
        gears = replace(assembled_pair(pair, coarsen), condensed=False).arcs(0.0, 1e-3)
        stiffness = gears.bodies.stiffness.tocsr()
        bores = [n[np.unique(g.mesh.boundaries["bore"])] for n, g in zip(gears.bodies.node_of, gears.arcs, strict=True)]
        free = np.setdiff1d(np.arange(stiffness.shape[0]), gears.bodies.unknowns[np.concatenate(bores)].ravel())
        factorize(stiffness[free][:, free], block=2)

    return short, _cpu(whole, 1), f"both gears at coarsen {coarsen:g}"


def one_cycle(quick: bool) -> tuple[float, float, str]:
    """40 positions over more than two mesh cycles: 18 of them differ."""
    pair = shipped_pair()
    elastic = elastic_pair(pair, coarsen=4.0 if quick else 1.0)
    at = np.radians(np.array([2.0, 20.0]) if quick else np.arange(1.0, 41.0))
    times = [
        _cpu(partial(sweep_stiffness, pair, twist=TWIST, angles=at, elastic=elastic, solve_all=s))
        for s in (False, True)
    ]
    return times[0], times[1], f"{len(at)} positions asked"


def neighbours(quick: bool) -> tuple[float, float, str]:
    """One position from the pairs of teeth that can touch; one factorisation of a dense system of all flanks."""
    from scipy.linalg import cho_factor

    pair = shipped_pair()
    elastic = elastic_pair(pair, coarsen=4.0 if quick else 1.0)
    solver = position_solver(elastic)
    short = _cpu(lambda: solver.solve(np.array([0.1]), np.array([TWIST])))
    every = sum(body.teeth * body.own.shape[0] for body in elastic.bodies)
    size = min(every, 500 if quick else 4000)
    matrix = np.eye(size) + 1e-3
    return short, _cpu(lambda: cho_factor(matrix), 1), f"{every} unknowns on all flanks; {size} of them factorised"


def fields(quick: bool) -> tuple[float, float, str]:
    """A sweep without fields; with displacement and stress of the whole gears at every position."""
    from gearfe.gears.gearmesh.fields import field_recovery

    pair = shipped_pair()
    elastic = elastic_pair(pair, coarsen=5.0 if quick else 1.0)
    at = pair.mesh_cycle * np.arange(1 if quick else 8) / 8
    short = _cpu(lambda: sweep_stiffness(pair, twist=TWIST, angles=at, elastic=elastic))
    solved = position_solver(elastic).solve(at, np.full(len(at), TWIST), np.arange(len(at)))

    def recovered() -> None:
        fields_at = field_recovery(elastic)
        for position in solved:
            fields_at(position)

    return short, short + _cpu(recovered, 1), f"{len(at)} positions"


def _process(code: str, **extra: str) -> float:
    """Processor seconds of a fresh Python that runs `code`."""
    env = {**os.environ, **extra, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    wrapped = f"{code}\nimport time\nprint('CPU', time.process_time())"
    done = subprocess.run([sys.executable, "-c", wrapped], check=True, capture_output=True, text=True, env=env)
    return float(done.stdout.rpartition("CPU")[2])


RIGID = """
from gearfe.drivetrain.train import simulate
from scripts.benchmarks.jobs.subject import train_model, train_times
simulate(train_model("undamped_springs", quick=True), train_times(True))
"""


def rigid_housing(quick: bool) -> tuple[float, float, str]:
    """A train in a rigid housing in a fresh process; the same and a housing meshed and reduced beside it."""
    short = _process(RIGID)
    housing = housing_of(24.0 if quick else 9.0, small=quick)
    more = _cpu(lambda: housing.reduce(10 if quick else 40), 1)
    loaded = _process(RIGID + "\nimport skfem, gearfe.drivetrain.housing, gearfe.fem.meshing.housing_mesh")
    return short, loaded + more, f"housing of {housing.unknowns} unknowns, assembled and reduced"


def modes_above(quick: bool) -> tuple[float, float, str]:
    """Modes to twice the band of interest; three times as many."""
    housing = housing_of(24.0 if quick else 9.0, small=quick)
    few, many = (10, 30) if quick else (60, 180)
    return _cpu(lambda: housing.reduce(few), 1), _cpu(lambda: housing.reduce(many), 1), f"{few} and {many} modes"


def cached_meshes(_quick: bool) -> tuple[float, float, str]:
    """Both tooth sectors from the cache, and from gmsh."""
    from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes

    pair = shipped_pair()
    each = list(zip((pair.pinion, pair.wheel), sector_recipes(pair), strict=True))
    sector_mesh(*each[0])
    return (
        _cpu(lambda: [sector_mesh(g, r) for g, r in each]),
        _cpu(lambda: [sector_mesh(g, r, cache=False) for g, r in each]),
        "meshes of the shipped pair",
    )


def cached_body(quick: bool) -> tuple[float, float, str]:
    """A reduced housing loaded, and made from its mesh."""
    from gearfe.fem.reduction.modal_body import ModalBody

    housing = housing_of(24.0, small=True) if quick else housing_of(shipped_housing().mesh.size_mm)
    made, cost = measured(lambda: housing.reduce(10 if quick else 60), runs=1)
    with tempfile.TemporaryDirectory() as name:
        made.save(Path(name) / "body.npz")
        return _cpu(lambda: ModalBody.load(Path(name) / "body.npz")), cost.cpu_s, f"{housing.unknowns} unknowns"


def lazy_imports(_quick: bool) -> tuple[float, float, str]:
    """``import gearfe``, and all that its jobs may need."""
    every = "import gearfe, skfem, gmsh, meshio, pyvista, matplotlib.figure, h5py, numba, scipy.sparse.linalg"
    return _process("import gearfe"), _process(every), "whole process, Python's own start included"


def compiled_kernels(quick: bool) -> tuple[float, float, str]:
    """Andrews' mechanism with the kernels in the cache; with the kernels compiled for it."""
    code = (
        "from gearfe.mechanisms import load_mechanism\nfrom gearfe.multibody import integrate\n"
        f"m = load_mechanism({str(GEOMETRY / 'andrews.toml')!r})\n"
        "integrate(m.system, [0.0, 0.03], tolerance=1e-9, start=m.start()).q"
    )
    short = _process(code)
    if quick:
        return short, short + _process("import numba"), "loading numba alone"
    with tempfile.TemporaryDirectory() as empty:
        return (
            short,
            _process(code, GEARFE_CACHE=empty),
            "compiling once; worth it for long or many runs",
        )


OMISSIONS: dict[str, Callable[[bool], tuple[float, float, str]]] = {
    "one tooth sector instead of the gears": one_sector,
    "one mesh cycle instead of two": one_cycle,
    "neighbour teeth only": neighbours,
    "fields only where asked": fields,
    "rigid housing without finite elements": rigid_housing,
    "modes above the band": modes_above,
    "cached meshes": cached_meshes,
    "cached reduced housing": cached_body,
    "lazy imports": lazy_imports,
    "compiled kernels only where they repay": compiled_kernels,
}
