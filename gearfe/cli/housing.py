"""``gearfe housing JOB.toml``: mesh, reduce, and show the housing of a job file."""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.progress import stage
from ..base.shown import percent
from .arguments import add_folder, add_job, print_results

if TYPE_CHECKING:
    from ..base.tables.housing import HousingMeshTable
    from ..drivetrain.housing.modal_test import Comparison
    from ..fem.reduction.modal_body import ModalBody


#: Why a frequency has no estimate.
_COARSE, _FEW = "the mesh is too coarse for one", "keep more modes (modes_below_Hz)"
_UNKNOWN = "there is none for matrices"
#: Share of an estimated error above which the report says what makes it smaller.
_LARGE = 0.1
#: Modes drawn.
_DRAWN = 6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_job(parser, "job", "job file with a table [housing]")
    add_folder(parser)
    parser.add_argument(
        "--modes", type=int, default=20, metavar="N", help="modes to list and to write (default: %(default)s)"
    )
    parser.add_argument(
        "--compare",
        metavar="FILE",
        help="modes of a test (.csv, .uff) or another reduced body (.npz): comparison of frequencies, MAC, damping",
    )


def run(args: argparse.Namespace) -> int:
    from ..base.errors import InputError
    from ..base.tables.jobs import load_job

    # mistakes in the file show before NumPy, SciPy and the finite elements load
    table = load_job(args.job, ("housing",))["housing"]
    if args.modes < 1:
        raise InputError("--modes", args.modes, "must be 1 or more", "20 is the default")

    import numpy as np

    from ..base.files import output_folder, whole_set
    from ..drivetrain.housing.body import reduced_housing
    from ..fem.reduction.error import mesh_error, reduction_error

    test = None
    if args.compare is not None:
        from ..drivetrain.housing.modal_test import compare, read_modes

        test = read_modes(args.compare)
    folder = output_folder(args.out)
    started = time.perf_counter()
    body = reduced_housing(table, Path(args.job).parent)
    seconds = time.perf_counter() - started
    shown = min(args.modes, body.size)
    with stage("error estimates"):
        fields = body.reconstruct(body.coupled.vectors[:, :shown].T)
        band = table.reduction.band_Hz
        mesh, left_out = mesh_error(body, band), reduction_error(body, band)
        both = {"mesh": mesh.frequency_errors[:shown], "reduction": left_out.frequency_errors[:shown]}
        errors = {name: np.where(np.isfinite(one), one, np.nan) for name, one in both.items()}
        errors["all"] = errors["mesh"] + errors["reduction"]
        response = {
            "band_Hz": band,
            "response_error_estimate": mesh.response + left_out.response,
            "mesh_response_error_estimate": mesh.response,
            "reduction_response_error_bound": left_out.response,
        }
    compared = None if test is None else compare(body, test, args.modes)
    _report(body, errors, response)
    if response["response_error_estimate"] > _LARGE and body.has_mesh:
        cure = cure_of_error(table.mesh, body.nodes.size, by_reduction=mesh.response < left_out.response)
        print(f"the estimated error is large: {cure}")
    with whole_set(folder, ("housing.png", "modes.png", "comparison.csv", "points.csv", "mac.csv", "mac.png")) as made:
        with stage("tables"):
            _write(made, body, fields, errors, response)
        if compared is not None:
            _compare(made, compared, args)
        with stage("pictures"):
            problem = "" if args.no_pictures or not body.has_mesh else _draw(made, body, fields)
        names = sorted(path.name for path in made.iterdir())
    print_results((), folder, names, {"reduced body": seconds}, () if not problem else (f"no pictures: {problem}",))
    failed = not np.all(np.isfinite(body.coupled.frequencies_hz))
    if problem:
        from ..figures.offscreen import MISSING

        failed = failed or problem != MISSING  # who installs no VTK wants no pictures of it
    return int(failed)


def _report(body: ModalBody, errors: dict[str, Any], response: dict[str, float]) -> None:
    import numpy as np

    for note in body.notes:
        print(f"note: {note}")
    mass = body.rigid_mass[0, 0]
    print(
        f"mass            {mass:.4f} kg"
        if math.isfinite(mass)
        else "mass            unknown: matrices of a held body do not contain it"
    )
    print(f"mesh            {len(body.nodes)} nodes, {body.nodes.size} unknowns")
    kept = f"{body.modes} modes to {body.internal_hz[body.modes - 1]:.0f} Hz" if body.modes else "no modes"
    extra = len(body.internal_hz) - body.modes
    print(f"reduced to      {body.size} coordinates: {6 * len(body.attachment_names)} of attachments, {kept},")
    print(f"                {extra} quasi-static corrections")
    for name, point in zip(body.attachment_names, body.attachment_points, strict=True):
        x, y, z = np.round(1e3 * point, 6) + 0.0
        print(f"bore {name:<10} reference point x {x:8.3f}  y {y:8.3f}  z {z:8.3f} mm")
    sign = ""
    if body.has_mesh:
        sign = ", all towards too high" if body.added_kg == 0.0 else "; without that of the moved nodes, of either sign"
    print(f"frequencies, bores rigid and free to move; estimated error (mesh and reduction{sign}):")
    for number, estimate in enumerate(errors["all"]):
        frequency = body.coupled.frequencies_hz[number]
        said = f"<= {percent(estimate, 3):>7}   (reduction {percent(errors['reduction'][number])})"
        if not math.isfinite(estimate):
            said = "unknown: " + (_UNKNOWN if not body.has_mesh else _COARSE if number < body.modes else _FEW)
        print(f"  {number + 1:3d} {frequency:10.2f} Hz   {said}")
    band, bound, mesh, reduction = response.values()
    why = "keep more modes" if body.has_mesh else _UNKNOWN
    text = f"<= {percent(bound)} rms" if math.isfinite(bound) else f"unknown: {why}"
    part = f" (mesh {percent(mesh)}, reduction {percent(reduction)})"
    text += part if math.isfinite(bound) else ""
    print(f"response of the bores up to {band:.0f} Hz (1 % damping): estimated error {text}")


def cure_of_error(mesh: HousingMeshTable, unknowns: int, *, by_reduction: bool) -> str:
    """What makes the estimated error smaller: more modes, or smaller elements in the words of the job's mesh."""
    if by_reduction:
        return "keep more modes (a higher modes_below_Hz in [housing.reduction])"
    if mesh.file is None:
        return f"take a smaller size_mm in [housing.mesh] (now {mesh.size_mm:g})"
    from ..fem.meshing.mesh_file import CAD

    size = "take a smaller size_mm, or " if Path(mesh.file).suffix.lower() in CAD else ""
    more = f"refine_to_unknowns = {min(4 * unknowns, 2_000_000)}"
    return f'{size}refine the mesh where it errs most: mesh = {{ file = "{mesh.file}", {more} }} in [housing]'


def _compare(folder: Path, made: Comparison, args: argparse.Namespace) -> None:
    """Tell and write the modes of a test beside the body's."""
    from ..base.files import write_csv
    from ..drivetrain.housing.modal_points import point_columns, point_lines

    columns = made.columns()
    write_csv(folder / "comparison.csv", columns)
    write_csv(folder / "points.csv", point_columns(made))
    names = [f"mode_{n + 1}_{f:.1f}_Hz" for n, f in zip(made.numbers, made.frequencies, strict=True)]
    write_csv(
        folder / "mac.csv", {"test_frequency_Hz": made.test.frequencies, **dict(zip(names, made.mac.T, strict=True))}
    )
    if not args.no_pictures:
        from ..figures.housing import mac_figure

        mac_figure(folder / "mac.png", made, Path(args.compare).name)
    print(f"compared with {args.compare}: points within {1e3 * made.distance:.3g} mm of a node")
    for i in range(len(made.pairs)):
        hz, other = columns["test_frequency_Hz"][i], columns["frequency_Hz"][i]
        off, mac = columns["frequency_difference_percent"][i], columns["mac"][i]
        text = "no partner" if made.pairs[i] < 0 else f"{other:10.2f} Hz  {off:+6.2f} %   MAC {mac:.3f}"
        print(f"  {i + 1:3d} {hz:10.2f} Hz   {text}")
    for line in point_lines(made):
        print(line)
    ratios = made.damping_ratios()
    if ratios:
        print(
            "measured damping, for the job: [housing.damping] ratio = [" + ", ".join(f"{r:.4g}" for r in ratios) + "]"
        )


def _write(folder: Path, body: ModalBody, fields: Any, errors: dict[str, Any], response: dict[str, float]) -> None:
    import numpy as np

    from ..base.files import write_csv, write_json
    from ..output.exchange.matrix_market import write_market
    from ..output.exchange.vtkhdf import write_vtkhdf

    body.save(folder / "housing.npz")
    for name, matrix in (("stiffness", body.stiffness), ("mass", body.mass)):
        write_market(folder / f"housing_{name}.mtx", matrix)
    shown = len(fields)
    vectors = body.coupled.vectors[:, :shown]
    participation = body.momentum @ vectors
    columns: dict[str, Any] = {"number": np.arange(1, shown + 1), "frequency_Hz": body.coupled.frequencies_hz[:shown]}
    for axis, name in enumerate("xyz"):
        columns[f"effective_mass_{name}_kg"] = participation[axis] ** 2
    for axis, name in enumerate("xyz"):
        columns[f"effective_inertia_{name}_kg_m2"] = participation[3 + axis] ** 2
    columns["error_estimate_percent"] = 100.0 * errors["all"]
    columns["mesh_error_estimate_percent"] = 100.0 * errors["mesh"]
    columns["reduction_error_bound_percent"] = 100.0 * errors["reduction"]
    write_csv(folder / "modes.csv", columns)
    names = [f"mode_{k + 1:02d}_{body.coupled.frequencies_hz[k]:.1f}_Hz" for k in range(shown)]
    if body.has_mesh:
        write_vtkhdf(folder / "modes.vtkhdf", body.nodes, body.cells, point_data=dict(zip(names, fields, strict=True)))
    summary = {
        "mass_kg": body.rigid_mass[0, 0],
        "mass_added_by_moved_nodes_kg": body.added_kg,
        "unknowns": body.nodes.size,
        "coordinates": body.size,
        "modes": body.modes,
        "corrections": len(body.internal_hz) - body.modes,
        "fixed": body.held,
        "frequencies_free_attachments_Hz": body.coupled.frequencies_hz[:shown],
        "frequencies_held_attachments_Hz": body.internal_hz[: body.modes],
        **response,
        "frequency_error_estimates": errors["all"],
        "mesh_frequency_error_estimates": errors["mesh"],
        "attachments": {n: list(p) for n, p in zip(body.attachment_names, body.attachment_points, strict=True)},
        "notes": list(body.notes),
    }
    write_json(folder / "summary.json", summary)


def _draw(folder: Path, body: ModalBody, fields: Any) -> str:
    import numpy as np

    from ..fem.bodies.mesh_checks import boundary_faces
    from ..figures.housing import draw_bodies, picture_of_bodies

    faces = boundary_faces(body.elements)
    rigid = int(np.sum(body.coupled.frequencies_hz[: len(fields)] <= 0.0))
    chosen = range(rigid, min(rigid + _DRAWN, len(fields)))
    titles = [f"mode {k + 1}: {body.coupled.frequencies_hz[k]:.1f} Hz" for k in chosen]
    bores = np.flatnonzero(np.any(body.shapes[::3, : 6 * len(body.attachment_names) : 6] == 1.0, axis=1))
    still = np.zeros((1, len(body.nodes), 3))
    marked = {"crimson": bores}
    if body.held:
        marked["seagreen"] = np.flatnonzero(~np.any(body.shapes.reshape(len(body.nodes), -1), axis=1))
    named = {f"bore {name}": place for name, place in zip(body.attachment_names, body.attachment_points, strict=True)}
    title = f"bores (red){', held (green)' if body.held else ''}; mass {body.rigid_mass[0, 0]:.3g} kg"
    pictures = {"housing.png": picture_of_bodies(body.nodes, faces, still, [title], marked=marked, labels=named)}
    if titles:
        pictures["modes.png"] = picture_of_bodies(body.nodes, faces, fields[list(chosen)], titles)
    return draw_bodies({folder / name: picture for name, picture in pictures.items()})
