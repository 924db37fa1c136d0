"""One mechanism file from start to files: what ``gearfe mechanism`` does."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.files import output_folder, whole_set, write_csv, write_json
from ..base.progress import announce, stage
from ..base.shown import percent
from ..multibody import Start, Trajectory, integrate
from ..multibody.core.inverse import prescribed_motion
from ..multibody.core.mass_regularisation import free_motions
from .error_estimate import TrajectoryError, trajectory_error
from .link_files import write_links, write_plates
from .model import Mechanism
from .results import Results, Sensitivities, evaluate, in_blocks, reactions, reference_differences, reference_table
from .start_moves import contradictions, largest_move, moved_line

#: Bodies that a line of the report names.
MOST_NAMES = 8
#: Files that depend on the options: what is left of them from an earlier run is removed.
MAY_WRITE = (
    "trajectory.csv", "energy.csv", "equilibrium.csv", "bodies.csv", "modes.csv", "shapes.csv", "modes.png",
    "reactions.csv", "curves.png", "energy.png", "picture.png", "animation.gif", "links.csv", "links.vtkhdf",
    "links.png", "plates.csv", "plates.vtkhdf", "plates.png", "sensitivities.csv",
)  # fmt: skip

#: Strain up to which stress is proportional to it in engineering materials (-).
LINEAR = 0.02


@dataclass(frozen=True)
class Outcome:
    """Result of a job: completion with finite outputs, printed text, summary, warnings."""

    complete: bool
    text: str
    summary: dict[str, Any]
    warnings: tuple[str, ...] = ()
    stopped: str = ""  # why, and when, a run ended before its end


def run_mechanism(
    mechanism: Mechanism,
    out: str | Path,
    *,
    tolerance: float | None = None,
    method: str | None = None,
    until: float | None = None,
    estimate: bool = True,
    draw: Callable[[Path, Results], None] | None = None,
    slopes: Sensitivities | None = None,
) -> Outcome:
    """Integrate a mechanism and write ``trajectory.csv``, ``energy.csv``, ``summary.json`` and what else is asked.

    All files appear together, or none.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    out : path
        Folder of the files.
    tolerance : float, optional
        Relative tolerance of the integration; that of the file by default.
    method : str, optional
        ``auto``, ``taylor`` or ``implicit``; that of the file by default.
    until : float, optional
        End of the run (s); that of the file by default.
    estimate : bool
        Whether two finer runs estimate the errors.
    draw : callable, optional
        ``draw(folder, results)`` adds pictures to the folder.
    slopes : Sensitivities, optional
        Written to ``sensitivities.csv``.

    Raises
    ------
    InputError
        If the end is not positive, gives too many rows or lies after the end of a table over time. Also if the method
        does not suit flexible links, or no step is possible from the start.
    """
    began = clock.perf_counter()
    run = mechanism.file.run
    end = run.end_s if until is None else until
    if not (math.isfinite(end) and end > 0.0):
        raise InputError("--until", end, "must be finite and > 0 s", "give the end of the run")
    if end / run.step_s > 5e6:
        raise InputError("--until", end, "gives more than five million rows", "take a longer step_s or an earlier end")
    if end > mechanism.known_until * (1.0 + 1e-9):
        problem = f"is after the end of a table over time, {mechanism.known_until:g} s"
        raise InputError("run.end_s", end, problem, "end the run before, or extend the table")
    if draw is not None:
        reference_table(mechanism)  # report a mistake in it before the run
    folder = output_folder(out)
    start = mechanism.start()
    contradicted = contradictions(mechanism, start)
    for sentence in contradicted:
        announce(f"warning: {sentence}")
    read = clock.perf_counter()
    times = output_times(end, run.step_s)
    method = run.method if method is None else method
    if mechanism.elastic and method == "taylor":
        problem = "would follow the axial waves of flexible links with steps of next to no length"
        raise InputError("run.method", method, problem, "leave it out: they take the implicit method")
    if tolerance is None:
        tolerance = mechanism.tolerance
    if run.analysis == "inverse":
        trajectory, estimate = prescribed_motion(mechanism.system, start, times), False
    else:
        options: dict[str, Any] = {"method": method, "tolerance": tolerance, "raise_on_failure": False}
        trajectory = integrate(mechanism.system, times, start=start, **options)
    integrated = clock.perf_counter()
    compiling = float(trajectory.statistics.get("compile_seconds", 0.0))
    if len(trajectory.dense.times) < 2:
        raise InputError(
            "start", None, trajectory.message, "give the bodies start velocities, or another start position"
        )
    with np.errstate(over="ignore", invalid="ignore"):  # a state beyond all numbers has a status of its own
        results = evaluate(mechanism, trajectory)
    error = trajectory_error(mechanism, start, results, tolerance) if estimate else None
    estimated = clock.perf_counter()
    with whole_set(folder, MAY_WRITE) as draft:
        warnings = tuple(_write_tables(draft, mechanism, results, run.reactions))
        write_elastic(draft, mechanism, trajectory)
        if slopes is not None:
            write_csv(draft / "sensitivities.csv", slopes.table())
        written = clock.perf_counter()
        if draw is not None:
            draw(draft, results)
        timings = {
            "read_s": read - began,
            "compile_s": compiling,
            "integrate_s": integrated - read - compiling,
            "estimate_s": estimated - integrated,
            "tables_s": written - estimated,
            "pictures_s": clock.perf_counter() - written,
        }
        summary = summarise(mechanism, start, results, tolerance, timings, error)
        summary["warnings"] = [*contradicted, *warnings]
        write_json(draft / "summary.json", summary)
    done = trajectory.status == 0
    stopped = "" if done else f"the run stopped at {trajectory.reached:g} s of {end:g} s: {trajectory.message}"
    start_line = "" if contradicted or mechanism.file.start.positions else moved_line(mechanism, start)
    text = "\n".join([*([start_line] if start_line else []), _text(summary)])
    return Outcome(done and not warnings, text, summary, warnings, stopped)


def output_times(end: float, step: float) -> np.ndarray:
    """0, step, 2 step, ... and the end."""
    count = round(end / step)
    if abs(count * step - end) <= 1e-9 * end:
        times = step * np.arange(count + 1)
        times[-1] = end
        return times
    return np.append(step * np.arange(math.floor(end / step) + 1), end)


@stage("tables")
def _write_tables(folder: Path, mechanism: Mechanism, results: Results, with_reactions: bool) -> list[str]:
    """Write trajectory.csv, energy.csv and, when asked, reactions.csv; return warnings about their numbers."""
    time: Any = results.trajectory.time
    outputs: dict[str, Any] = {**results.outputs}
    energy: dict[str, Any] = {**results.energy}
    warned = write_csv(folder / "trajectory.csv", {"time_s": time, **outputs}, gaps=False)
    warned += write_csv(folder / "energy.csv", {"time_s": time, **energy}, gaps=False)
    if with_reactions:
        forces: dict[str, Any] = {**reactions(mechanism, results.trajectory)}
        warned += write_csv(folder / "reactions.csv", {"time_s": time, **forces})
    return warned


def summarise(
    mechanism: Mechanism,
    start: Start,
    results: Results,
    tolerance: float,
    timings: dict,
    error: TrajectoryError | None = None,
) -> dict[str, Any]:
    """Return the content of summary.json.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    start : Start
        Start of the run, with the count of degrees of freedom.
    results : Results
        The run with its outputs.
    tolerance : float
        Relative tolerance of the run.
    timings : dict
        Name -> time that a part of the work took (s).
    error : TrajectoryError, optional
        Estimated errors; None if they were not estimated.
    """
    linkage = mechanism.linkage
    trajectory = results.trajectory
    freedoms = start.freedoms
    label = linkage.assembly.row_label
    owner = np.array(linkage.assembly.row_joint)
    joints = [
        {
            "name": name,
            "type": table.type,
            "bodies": [table.body, table.to],
            "constraints": int((owner == j).sum()),
            "redundant": [label[r] for r in freedoms.redundant if owner[r] == j],
        }
        for j, (name, table) in enumerate(mechanism.file.joints.items())
    ]
    total = results.energy["total_J"]
    statistics = dict(trajectory.statistics)
    statistics.pop("compile_seconds", None)  # stands under timings
    passages = np.asarray(statistics.pop("change_points", []), dtype=float)
    inside = passages[passages <= trajectory.reached]
    residual = in_blocks(mechanism.system.residual, trajectory.time, trajectory.q)
    return {
        "title": mechanism.file.title,
        "status": trajectory.message,
        "reached_s": trajectory.reached,
        "method": trajectory.method,
        "tolerance": tolerance,
        **statistics,
        "freedoms": {
            "bodies": len(mechanism.file.bodies),
            "coordinates": freedoms.coordinates,
            "constraints": freedoms.constraints,
            "redundant": len(freedoms.redundant),
            "net": freedoms.net,
            "net_with_rigid_links": _net_of_rigid(mechanism, start),
            "prescribed": sum(row.motion is not None for row in linkage.assembly.rows),
            "prescribed_and_redundant": sum(linkage.assembly.rows[r].motion is not None for r in freedoms.redundant),
            "undriven_bodies": undriven_bodies(mechanism, trajectory),
            "redundant_constraints": [label[r] for r in freedoms.redundant],
            "singular_at_start": [label[r] for r in freedoms.passing],
        },
        "flexible_links": [_flexible(mechanism, results, name) for name in mechanism.links]
        + [_of_elements(mechanism, results, name) for name in mechanism.plates],
        "largest_move_to_the_start": largest_move(mechanism, start),
        "joints": joints,
        "change_points": {"count": len(inside), "first_times_s": inside[:100]},
        "constraint_residual": float(np.abs(residual).max(initial=0.0)),
        "reference_differences": reference_differences(mechanism, trajectory),
        "energy_drift_J": float(np.abs(total - total[0]).max(initial=0.0)),
        "error_estimate": None
        if error is None
        else {
            "coordinates_m_or_rad": error.coordinates,
            "outputs": dict(error.outputs),
            "tolerance_of_the_finer_runs": error.tolerance,
        },
        "timings": timings,
    }


def _net_of_rigid(mechanism: Mechanism, start: Start) -> int:
    """Net degrees of freedom of the mechanism whose links do not bend: what the joints leave."""
    if not mechanism.elastic:
        return start.freedoms.net
    return mechanism.with_rigid_links().start(start.time).freedoms.net


def undriven_bodies(mechanism: Mechanism, trajectory: Trajectory) -> list[str]:
    """Names of the bodies that can move while all prescribed motions stand still: they follow forces and the start.

    Of several states of the run, since dead centres hold some bodies for a moment.
    """
    system, linkage = mechanism.system, mechanism.linkage
    moves = np.zeros(len(linkage.bodies))
    for k in np.unique(np.linspace(0, len(trajectory.time) - 1, 5).astype(int)):
        G = system.jacobian(trajectory.time[k], trajectory.q[k]) * system.units / system.row_units[:, None]
        free = np.abs(free_motions(G)).max(axis=1, initial=0.0)[: linkage.size]
        moves = np.maximum(moves, free.reshape(-1, 3).max(axis=1))
    names = [body.name for body, size in zip(linkage.bodies, moves, strict=True) if size > 1e-9]
    links = {node: link for link in mechanism.file.bodies for node in names if node.startswith(f"{link}.")}
    return list(dict.fromkeys(links.get(name, name) for name in names))


def _flexible(mechanism: Mechanism, results: Results, name: str) -> dict[str, Any]:
    """Return the summary of a flexible link: mesh, largest deflection and stress at the output times."""
    link = mechanism.links[name]
    data = link.beam.link
    entry: dict[str, Any] = {
        "name": name,
        "elements": len(data.ends) - 1,
        "largest_deflection_m": float(np.abs(link.offsets(results.trajectory.q)[:, :, 1]).max()),
        "largest_axial_force_N": float(np.abs(results.sections[name][:, :, 0]).max()),
        "largest_bending_moment_N_m": float(np.abs(results.sections[name][:, :, 2]).max()),
    }
    if data.section.edge is not None:
        entry["largest_edge_stress_Pa"] = float(link.edge_stress(results.sections[name], name).max())
        beam = mechanism.file.bodies[name].beam
        assert beam is not None  # it makes the link flexible
        entry["largest_strain"] = entry["largest_edge_stress_Pa"] / (1e9 * beam.youngs_modulus_GPa)
    return entry


def _of_elements(mechanism: Mechanism, results: Results, name: str) -> dict[str, Any]:
    """Return the summary of a link of finite elements."""
    link, q = mechanism.plates[name], results.trajectory.q
    nodes, elements = link.mesh
    plate = link.part.plate
    largest = float(link.largest_von_mises(results.sections[name]).max())
    table = mechanism.file.bodies[name].plate
    assert table is not None  # it makes the link flexible
    return {
        "name": name,
        "nodes": nodes,
        "elements": elements,
        "modes": plate.modes.shape[1],
        "highest_frequency_Hz": float(plate.frequencies[-1]),
        "mass_kg": plate.mass,
        "largest_deflection_m": float(np.abs(link.displacements(q)).max()),
        "largest_von_mises_Pa": largest,
        "largest_strain": largest / (1e9 * table.youngs_modulus_GPa),
    }


def write_elastic(folder: Path, mechanism: Mechanism, trajectory: Trajectory) -> None:
    """Files of flexible links, where there are some."""
    if mechanism.elastic:
        if mechanism.links:
            write_links(folder, mechanism, trajectory)
        if mechanism.plates:
            write_plates(folder, mechanism, trajectory)


def _error_line(error: dict[str, Any]) -> str:
    largest = error["coordinates_m_or_rad"]
    if not math.isfinite(largest):
        return "error estimate: none, a finer run did not reach as far"
    return f"error estimate from finer runs: {largest:.2g} (m or rad) at worst"


def _link_line(link: dict[str, Any]) -> str:
    line = f"flexible link {link['name']}: deflection up to {link['largest_deflection_m']:.3g} m"
    for kind, key in (("edge stress", "largest_edge_stress_Pa"), ("von Mises' stress", "largest_von_mises_Pa")):
        if key in link:
            line += f", {kind} up to {1e-6 * link[key]:.3g} MPa"
    if link.get("largest_strain", 0.0) > LINEAR:
        strains = f"{percent(link['largest_strain'], 3)}, linear elasticity holds to about {100.0 * LINEAR:g} %"
        line += f"; strains up to {strains}: check whether the mechanism locks with this link rigid (flexible = false)"
    return line


def _undriven_line(f: dict[str, Any]) -> str:
    """Describe degrees of freedom that no joint prescribes: missing joints, free motions, and shapes of links."""
    names, drives, left = f["undriven_bodies"], f["prescribed"], f["net_with_rigid_links"]
    listed = ", ".join(names[:MOST_NAMES]) + (f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else "")
    counted = ""
    if drives or left != f["net"]:
        counted = f"{_counted(f['net'], 'degree')} of freedom {'is' if f['net'] == 1 else 'are'} not prescribed"
        if left != f["net"]:
            rigid = f", {left} of them with rigid links" if left > 0 else ""
            counted += f" (deformations of flexible links among them{rigid})"
        counted += ": "
    line = f"{counted}forces and start velocities move {listed}"
    return f"{line}; check that no joint is missing" if drives and left > 0 else line


def _counted(count: int, name: str) -> str:
    """Return a number with its noun."""
    return f"{count} {name if count == 1 else 'bodies' if name == 'body' else f'{name}s'}"


def _freedom_line(f: dict[str, Any]) -> str:
    """Describe the degrees of freedom as textbooks count them: prescribed motions are no constraints."""
    prescribed = f["prescribed"] - f["prescribed_and_redundant"]
    redundant = f["redundant"] - f["prescribed_and_redundant"]
    line = (
        f"{_counted(f['bodies'], 'body')}: {_counted(f['coordinates'], 'coordinate')}"
        f" - {_counted(f['constraints'] - f['prescribed'], 'joint constraint')}"
        f"{f' + {redundant} redundant' if redundant else ''} = {_counted(f['net'] + prescribed, 'degree')} of freedom"
    )
    if not prescribed:
        return line
    return f"{line}, {'which is' if f['net'] + prescribed == 1 else f'{prescribed} of them'} prescribed"


def _time_text(seconds: float) -> str:
    return f"{1e3 * seconds:.2g} ms" if seconds < 0.1 else f"{seconds:.2g} s"


def _text(summary: dict[str, Any]) -> str:
    f = summary["freedoms"]
    passed = summary["change_points"]["count"]
    lines = [
        _freedom_line(f),
        *([_undriven_line(f)] if f["net"] > 0 else []),
        *(f"redundant: {name}" for name in f["redundant_constraints"]),
        *(_link_line(link) for link in summary["flexible_links"]),
        f"{summary['method']}: {summary['status']} at {summary['reached_s']:g} s"
        f" in {_counted(summary['steps'], 'step')}, computing time {_time_text(summary['timings']['integrate_s'])}"
        + (f"; {_counted(passed, 'change point')} passed" if passed else ""),
        *([_error_line(summary["error_estimate"])] if summary["error_estimate"] else []),
        *([_reference_line(summary["reference_differences"])] if summary["reference_differences"] else []),
    ]
    return "\n".join(lines)


def _reference_line(found: dict[str, float]) -> str:
    differences = ", ".join(f"{name} {value:.2g}" for name, value in found.items())
    return f"largest differences from the reference: {differences}"
