"""What each constant of the packages around the contact changes in the answers of short jobs, halved and doubled.

Every number in a module-level constant is a candidate; those that number table columns, scale pictures or bound memory
and messages are left out by module or name. An answer counts in parts of its largest value, and in parts of what its
job tells of its own error (the tolerance asked for, or its estimate): a constant that moves an answer by more than that
chooses between answers. Mechanisms and trains run as plain Python, so that their kernels' constants count too.

    python scripts/benchmarks/measure_package_constants.py [PACKAGE ...]      # a Markdown table
"""

from __future__ import annotations

import ast
import importlib
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

PACKAGE = ROOT / "gearfe"
#: Answers of a job with what it tells of the error of each, relative to its largest value.
Answers = dict[str, tuple[np.ndarray, float]]


def mechanisms() -> Answers:
    """Folding links, a chain, a stiff pendulum; series, Radau IIA and Runge-Kutta; a four-bar at rest."""
    from gearfe.multibody import Body, CoordinateSpring, Gravity, Hinge, Linkage, System, integrate
    from tests.makers.rigid_cases import chain, folding_links

    rod = Linkage(
        (Body("rod", 2.0, 0.1, (0.4, 0.0), (0.0, 0.0), 1.0),), (Hinge("rod", "ground"),),
        (Gravity(), CoordinateSpring("rod", "angle", 300.0, 2.0)),
    )  # fmt: skip
    made: Answers = {}
    for name, system, method, end in (
        ("folding links, series", folding_links(), "taylor", 1.0),
        ("chain, series", chain(3), "taylor", 0.3),
        ("chain, Radau IIA", chain(3), "implicit", 0.3),
        ("pendulum on a spring, Radau IIA", System([rod]), "implicit", 0.5),
    ):
        run = integrate(system, [0.0, end], method=method, tolerance=1e-8)
        made[name] = np.concatenate([run.q[-1], run.v[-1]]), 1e-8
    return made


def trains() -> Answers:
    """A train of two stages in a frame, with damping: forces and accelerations by two methods, multipliers."""
    from gearfe.drivetrain.runup.train_stability import train_stability
    from gearfe.drivetrain.train import build_train, simulate
    from gearfe.drivetrain.train.gear_train import Damping
    from tests.makers.trains import SHIPPED, curve, elastic, train

    one = elastic(train(SHIPPED, stiffness=curve, damping=Damping(ratio=0.02)), uneven=0.2, skew=0.3)
    model, made = build_train(one), {}
    for method in ("taylor", "implicit"):
        run = simulate(model, np.linspace(0.0, 1e-3, 41), method=method, tolerance=1e-6)
        made |= {f"forces, {method}": (run.contact_force, 1e-6), f"speeds, {method}": (run.speed, 1e-6)}
    found = train_stability(model).multipliers
    assert found is not None
    made["multipliers"] = np.sort(np.abs(found)), 1e-6
    return made


def laws() -> Answers:
    """The mesh law of a coarse pair: force, torque and tangent over phase and approach."""
    from gearfe.gears.contact.half_plane import half_plane_pair
    from gearfe.gears.contact.laws import HalfPlane
    from gearfe.gears.gearmesh.law_make import mesh_law

    law = mesh_law(half_plane_pair(coarse_gears(HalfPlane())), 2000.0)
    angle, depth = np.tile(law.cycle * np.linspace(0.0, 1.0, 40), 3), np.repeat([0.7e-6, 5e-6, 20e-6], 40)
    found = law(angle, law.first_contact(angle) + depth)
    return {
        "force": (found.force, law.error),
        "torque": (law.base_radii[0] * found.force + found.moment, law.error),
        "tangent": (found.tangent[40:], 1e-2),
    }


def run_ups() -> Answers:
    """Steady states of one stage with a mesh law, teeth in contact and apart."""
    from gearfe.drivetrain.runup.run_up import run_up
    from gearfe.drivetrain.train import build_train
    from tests.makers.mesh_laws import hertzian_law
    from tests.makers.trains import loaded

    model = build_train(loaded([(20, 30)], lambda _: hertzian_law(relief=4e-6), speed=700.0, flexible=False))
    speeds = np.linspace(500.0, 1100.0, 7)
    run = run_up(model, speeds, tolerance=1e-3)
    first = {round(s.speed, 6): s for s in reversed(run.states)}  # of several branches the first one
    found = np.array([np.ptp(first[x].transmission_error) if x in first else 0.0 for x in speeds.round(6)])
    return {"transmission errors": (found, max(s.error for s in run.states))}


def housings() -> Answers:
    """A coarse housing, extruded, and a box of tetrahedra: frequencies and their estimates."""
    from gearfe.base.config import build
    from gearfe.base.tables.housing import HousingTable
    from gearfe.drivetrain.housing.build import housing_from_table
    from gearfe.drivetrain.housing.model import Housing
    from gearfe.fem.reduction.error import mesh_error, reduction_error
    from tests.makers.housing_meshes import box

    table = build(HousingTable, {"mesh": {"size_mm": 16.0}}, "housing")
    held = Housing.from_arrays(*box((8, 2, 2), (0.24, 0.03, 0.02)), fixed=((0, 0, 0), (1, 0, 0)))
    made: Answers = {}
    for name, housing in (("extruded", housing_from_table(table)), ("tetrahedra", held)):
        body = housing.with_estimate(housing.reduce(12))
        made[f"frequencies, {name}"] = body.coupled.frequencies_hz[:8], 1e-2
        made[f"estimate of the mesh, {name}"] = mesh_error(body, 2000.0).frequency_errors[:8], 1.0
        made[f"estimate of the reduction, {name}"] = np.atleast_1d(reduction_error(body, 2000.0).response), 1.0
    return made


def gears() -> Answers:
    """Rigid touch of a relieved pair and one with an undercut, ISO's stiffness, area and inertia."""
    from gearfe.drivetrain.train.elements import outline_moments
    from gearfe.gears.geometry.gear_data import TipRelief
    from gearfe.gears.geometry.pair import Gear, GearPair
    from gearfe.gears.rating.stiffness import mesh_stiffness

    form: dict[str, Any] = {"module": 2.5e-3, "pressure_angle": np.radians(20.0), "face_width": 10e-3}
    form |= {"tip_round": 1e-4, "tip_relief": TipRelief(2e-5, 2e-3)}
    made: Answers = {}
    for name, teeth, shifts in (("20/31", (20, 31), (0.2, -0.1)), ("10/43", (10, 43), (0.0, 0.0))):
        pair = GearPair(*(
            Gear(z, bore_diameter=0.25 * z * 2.5e-3, profile_shift=x, **form)
            for z, x in zip(teeth, shifts, strict=True)
        ))  # fmt: skip
        made[f"touch, {name}"] = np.array([pair.contact_twist]), 1e-9
        made[f"ISO 6336, {name}"] = np.atleast_1d(mesh_stiffness(pair, 2.06e11, 2.06e11)), 1e-6
        made[f"section, {name}"] = np.array(outline_moments(pair.pinion)), 1e-6
    return made


def curves() -> Answers:
    """Curve and load map of a coarse pair with their estimates."""
    from gearfe.gears.contact.laws import HalfPlane
    from gearfe.gears.gearmesh.sweep import sweep_loads, sweep_stiffness

    pair, law = coarse_pair(), HalfPlane()
    curve = sweep_stiffness(pair, torque=80.0, law=law, coarsen=3.0, estimate_error=True)
    loads = sweep_loads(pair, [20.0, 80.0, 200.0], law=law, coarsen=3.0, root_stress=True)
    error = curve.worst_error
    return {
        "stiffness": (curve.k_mesh, error),
        "pressure": (np.nan_to_num(curve.peak_pressure), 0.02),
        "estimate": (np.atleast_1d(error), 1.0),
        "map's stiffness": (loads.quantity("k_mesh"), error),
        "root stress": (np.nan_to_num(loads.root.largest), 0.02),
    }


@cache
def coarse_pair() -> Any:
    """20 and 30 teeth with rounds."""
    from tests.makers.gears import pair

    return pair(20, 30, tip_round=1e-4)


def coarse_gears(law: Any) -> Any:
    """Both condensed."""
    from gearfe.gears.gearmesh.sweep import elastic_pair

    return elastic_pair(coarse_pair(), law=law, coarsen=3.0)


#: Package or module -> its job, and modules or names that are left out.
PARTS: dict[str, tuple[Callable[[], Answers], tuple[str, ...]]] = {
    "multibody": (mechanisms, ("packed", "LARGEST", "MOST_STEPS", "FIRST_")),
    "drivetrain.train": (trains, ("program",)),
    "gears.gearmesh.law": (laws, ("NO_CONTACT",)),
    "gears.gearmesh.law_fit": (laws, ("NANO",)),
    "gears.gearmesh.law_kernel": (laws, ("law_kernel.FORCE",)),
    "gears.gearmesh.law_make": (laws, ()),
    "drivetrain.runup": (run_ups, ("swinging", "report")),
    "drivetrain.housing": (housings, ("modal_test", "superelement", "_NEW", "_OLD", "_ALL", "_FOURTH")),
    "fem.reduction": (housings, ("FORMAT",)),
    "fem.solid": (housings, ()),
    "fem.prisms": (housings, ()),
    "fem.meshing.housing_mesh": (housings, ()),
    "gears.geometry": (
        gears,
        ("pitch_", "modif", "deviation", "face", "first_contact", "derived", "validity", "spur_gear"),
    ),
    "gears.geometry.face": (curves, ()),
    "gears.geometry.first_contact": (curves, ()),
    "gears.gearmesh": (curves, ("SIDE_BY_SIDE", "report", "MOST_CELLS", "gearmesh.law")),
    "gears.teeth.tooth_sector": (curves, ("RECIPE",)),
}


def sources(part: str) -> list[Path]:
    """Files of a package, or of a module."""
    path = PACKAGE / part.replace(".", "/")
    return sorted(path.rglob("*.py")) or [path.with_suffix(".py")]


def constants(part: str, left_out: tuple[str, ...]) -> Iterator[tuple[str, str, float]]:
    """(module, name, value) of the numbers of a package or module."""
    for path in sources(part):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            target = node.targets[0] if isinstance(node, ast.Assign) else None
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            if isinstance(node, ast.Assign) and any(isinstance(x, ast.Call) for x in ast.walk(node.value)):
                continue
            for name in (n.id for n in names if isinstance(n, ast.Name)):
                value = getattr(importlib.import_module(module), name)
                label = f"{module.removeprefix('gearfe.')}.{name}"
                if type(value) in (int, float) and not any(x in label for x in left_out):
                    yield module, name, value


@cache
def defined(module: str) -> frozenset[str]:
    """Names that a module assigns itself."""
    source = sys.modules[module].__file__ or ""
    found = ast.walk(ast.parse(Path(source).read_text(encoding="utf-8"))) if source.endswith(".py") else ()
    return frozenset(n.id for n in found if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))


def holders(module: str, name: str, value: float) -> list[Any]:
    """The module, and those that import the constant from it."""
    loaded = [m for key, m in sys.modules.items() if key.startswith("gearfe.")]
    copies = [m for m in loaded if getattr(m, name, None) is value and name not in defined(m.__name__)]
    return [sys.modules[module], *copies]


def main(parts: list[str]) -> int:
    """Print the table."""
    warnings.simplefilter("ignore")
    print("| constant | value | others | largest change | in parts of the told error | of |\n|---|---|---|---|---|---|")
    for part in parts or list(PARTS):
        job, left_out = PARTS[part]
        # meshes differ a little from run to run: one for all, except where they are what changes
        os.environ["GEARFE_CACHE"] = tempfile.mkdtemp() if job is housings and "mesh" not in part else "off"
        before = job()
        for module, name, value in list(constants(part, left_out)):
            where = holders(module, name, value)
            others = (max(1, value // 2), 2 * value) if isinstance(value, int) else (0.5 * value, 2.0 * value)
            worst = (0.0, 0.0, "")
            for other in others:
                for one in where:
                    setattr(one, name, other)
                try:
                    after = job()
                except Exception as error:  # the table tells it
                    worst = max(worst, (np.inf, np.inf, f"{other:g}: {type(error).__name__}"))
                    after = {}
                for key, (values, told) in after.items():
                    size, old = np.abs(before[key][0]).max(), before[key][0]
                    off = float(np.abs(values - old).max() / size) if values.shape == old.shape else np.inf
                    worst = max(worst, (off / told, off, key))
                for one in where:
                    setattr(one, name, value)
            label, text = f"{module.removeprefix('gearfe.')}.{name}", ", ".join(f"{x:g}" for x in others)
            print(f"| `{label}` | {value:g} | {text} | {worst[1]:.1e} | {worst[0]:.1e} | {worst[2]} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
