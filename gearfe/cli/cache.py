"""``gearfe cache``: what is kept on disk, how large it is, and away with it."""

from __future__ import annotations

import argparse
import contextlib
import math
import os

from .arguments import add_json

#: Groups of kernels: both integrators of mechanisms, the series of a train, a mesh law and Floquet multipliers; the
#: longest first.
KERNELS = ("taylor", "implicit", "train", "mesh law", "multipliers")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    one = parser.add_mutually_exclusive_group()
    one.add_argument(
        "--clean",
        nargs="?",
        const="all",
        metavar="KIND",
        help="remove all entries, or those of a kind",
    )
    one.add_argument(
        "--compile",
        action="store_true",
        help="compile all kernels now, on all cores, about a minute: later runs load them",
    )
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """List the entries, and remove the chosen ones; 1 when something could not be removed."""
    from ..base.cache import cache_folder, entries, remove
    from ..base.environment import CACHE_VARIABLE, LIMIT_VARIABLE, limit
    from ..base.errors import unknown_name

    folder = cache_folder()
    if folder is None:
        print(f"nothing is kept: {CACHE_VARIABLE} is off, or the user has no home folder")
        return 0
    there = entries(folder)
    kinds = sorted({entry.kind for entry in there})
    failed = 0
    if args.clean is not None:
        if args.clean not in ("all", *kinds):
            raise unknown_name("--clean", args.clean, ["all", *kinds])
        chosen = [entry for entry in there if args.clean in ("all", entry.kind)]
        gone = [entry for entry in chosen if remove(entry)]
        failed = len(chosen) - len(gone)
        print(f"removed: {len(gone)} entries, {_size(sum(entry.size for entry in gone))}")
    elif args.compile:
        _compile()
    there = entries(folder)
    args.summary = {"folder": str(folder), "limit_bytes": limit(), "kinds": {}}
    for kind in sorted({entry.kind for entry in there}):
        some = [entry.size for entry in there if entry.kind == kind]
        args.summary["kinds"][kind] = {"entries": len(some), "bytes": sum(some)}
        print(f"  {kind:<14} {len(some):>6}  {_size(sum(some)):>10}")
    total = _size(sum(entry.size for entry in there))
    print(f"{folder}: {len(there)} entries, {total}; limit {_size(limit())} ({LIMIT_VARIABLE})")
    return 1 if failed else 0


def _compile() -> None:
    """Compile all kernels into the cache, each in its own process, on all cores.

    Raises
    ------
    InputError
        If a process ends before its kernels are compiled.
    """
    from concurrent.futures import BrokenExecutor, as_completed

    from ..base.errors import InputError
    from ..base.progress import count, stage
    from ..study.run import processes

    with stage("compiling the kernels"), processes(min(len(KERNELS), os.cpu_count() or 1)) as pool:
        running = [pool.submit(compile_kernels, name) for name in KERNELS]
        try:
            for done, future in enumerate(as_completed(running), start=1):
                future.result()
                count(done, len(KERNELS), "groups of kernels")
        except BrokenExecutor:
            problem = "ended before all kernels were compiled: a process was killed"
            raise InputError("--compile", None, problem, "is memory short? compiled kernels are kept: again") from None


def compile_kernels(name: str) -> None:
    """Leave the kernels of one of `KERNELS` in the cache, without a word: the command reports them all."""
    with contextlib.redirect_stderr(None):
        _use(name)


def _use(name: str) -> None:
    """Run the kernels of one of `KERNELS` as briefly as possible, which compiles them."""
    import numpy as np

    if name == "mesh law":
        from ..gears.gearmesh.law_kernel import load_kernel

        load_kernel()
        return
    if name == "multipliers":
        from ..drivetrain.runup import monodromy_kernel

        monodromy_kernel.load_kernel()
        return
    from ..multibody import Body, Hinge, Linkage, System, constant, integrate

    if name != "train":
        rod, hinge = Body("rod", 1.0, 1.0, (1.0, 0.0)), Hinge("rod", "ground")
        integrate(System([Linkage((rod,), (hinge,))]), [0.0, 1e-3], method=name)
        return
    from ..drivetrain.train import build_train
    from ..drivetrain.train.gear_train import Drive, GearMesh, GearTrain, Load, Shaft, ShaftGear
    from ..drivetrain.train.simulate import simulate
    from ..gears.geometry import Gear

    gear, axes = Gear(20, 2e-3, math.radians(20.0), 0.02, bore_diameter=0.01), {"one": 0.0, "two": 0.04}
    train = GearTrain(
        tuple(Shaft(name, (x, 0.0, 0.0), 0.1, 5e-3, (f"{name}_1", f"{name}_2")) for name, x in axes.items()),
        tuple(ShaftGear(f"gear_{name}", name, 0.0, gear, 7850.0) for name in axes),
        (GearMesh("gear_one", "gear_two", 1e8),),
        Drive("one", "one_1", constant(100.0)),
        (Load("two", None, constant(10.0)),),
        rigid_bores={f"{name}_{k}": (x, y, 0.0) for name, x in axes.items() for k, y in ((1, 0.03), (2, -0.03))},
    )
    simulate(build_train(train), np.array([0.0, 1e-5]))


def _size(count: int) -> str:
    return f"{1e-6 * count:.1f} MB"
