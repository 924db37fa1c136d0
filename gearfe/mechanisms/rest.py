"""``gearfe mechanism --analysis equilibrium | modes``: the state of rest, and small vibrations about it."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.files import output_folder, whole_set, write_csv, write_json
from ..base.progress import announce, stage
from ..base.shown import percent
from ..base.typing import Array
from ..multibody import Start, Status, Trajectory
from ..multibody.core.dense import Polynomials
from ..multibody.core.equilibrium import Equilibrium, equilibrium
from ..multibody.core.modes import Modes, modes
from .job import MAY_WRITE, Outcome, write_elastic
from .model import Mechanism
from .results import Results, Sensitivities, evaluate, reactions
from .start_moves import contradictions


def run_rest(
    mechanism: Mechanism,
    out: str | Path,
    *,
    draw: Callable[[Path, Results, Modes | None], None] | None = None,
    slopes: Sensitivities | None = None,
) -> Outcome:
    """Find the equilibrium, and modes if the file asks for them, and write all files or none.

    ``equilibrium.csv`` has the outputs, ``bodies.csv`` the poses, ``reactions.csv`` the forces of the joints,
    ``modes.csv`` frequencies and damping, ``shapes.csv`` the motions.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    out : path
        Folder of the files.
    draw : callable, optional
        ``draw(folder, results, modes)`` adds pictures to the folder; modes is None for an equilibrium alone.
    slopes : Sensitivities, optional
        Written to ``sensitivities.csv``.

    Raises
    ------
    InputError
        If no stable equilibrium is found downhill from the start, or joints prescribe a motion.
    """
    began = clock.perf_counter()
    folder = output_folder(out)
    start = mechanism.start()
    contradicted = contradictions(mechanism, start)
    for sentence in contradicted:
        announce(f"warning: {sentence}")
    with stage("equilibrium"):
        rest = equilibrium(mechanism.system, start)
    results = evaluate(mechanism, at_rest(mechanism, start, rest))
    with_modes = mechanism.file.run.analysis == "modes"
    vibrations = modes(mechanism.system, start, rest, mechanism.file.run.modes) if with_modes else None
    with whole_set(folder, MAY_WRITE) as draft:
        warned = write_csv(draft / "equilibrium.csv", dict(results.outputs), gaps=False) if results.outputs else []
        write_csv(draft / "bodies.csv", _poses(mechanism, rest.q))
        write_csv(draft / "reactions.csv", dict(reactions(mechanism, results.trajectory)))
        if vibrations is not None:
            _write_modes(draft, mechanism, vibrations)
        write_elastic(draft, mechanism, results.trajectory)
        if slopes is not None:
            write_csv(draft / "sensitivities.csv", slopes.table())
        if draw is not None:
            draw(draft, results, vibrations)
        summary = summarise_rest(mechanism, start, rest, results, vibrations)
        summary["timings"] = {"whole_s": clock.perf_counter() - began}
        summary["warnings"] = [*contradicted, *warned]
        write_json(draft / "summary.json", summary)
    return Outcome(not warned, _text(summary), summary, tuple(warned))


def at_rest(mechanism: Mechanism, start: Start, rest: Equilibrium) -> Trajectory:
    """The state of rest as a trajectory of one time."""
    still = replace(start, q=rest.q, v=np.zeros_like(rest.q))
    dense = Polynomials(np.array([start.time, start.time + 1.0]), rest.q[None, None, :])
    statistics = {"scheme": "Newton's method", "steps": rest.steps}
    return Trajectory(mechanism.system, still, np.array([start.time]), Status.DONE, "equilibrium", statistics, dense)


def _poses(mechanism: Mechanism, q: Array) -> dict[str, Any]:
    """Place of the frame's origin and angle of every body, of flexible links at their starts."""
    names = list(mechanism.file.bodies)
    x, y, angle = [], [], []
    for name in names:
        values = mechanism.values({("x", name), ("y", name), ("angle", name)}, q[None, :])
        x.append(float(values["x", name][0]))
        y.append(float(values["y", name][0]))
        angle.append(float(values["angle", name][0]))
    return {"body": names, "x_m": np.array(x), "y_m": np.array(y), "angle_rad": np.array(angle)}


def mode_columns(vibrations: Modes) -> dict[str, Any]:
    """Columns of modes.csv."""
    return {
        "mode": np.arange(1, len(vibrations.rates) + 1),
        "frequency_Hz": vibrations.frequencies,
        "damping_ratio": vibrations.damping_ratios,
        "damped_frequency_Hz": vibrations.rates.imag / (2 * np.pi),
        "decay_per_s": -vibrations.rates.real,
    }


def _write_modes(folder: Path, mechanism: Mechanism, vibrations: Modes) -> None:
    columns = mode_columns(vibrations)
    number, count = columns["mode"], len(vibrations.rates)
    write_csv(folder / "modes.csv", columns)
    bodies = [body.name for body in mechanism.linkage.bodies]
    shapes = vibrations.shapes[:, : mechanism.linkage.size].reshape(count, -1, 3)
    rows: dict[str, Any] = {"mode": np.repeat(number, len(bodies)), "body": bodies * count}
    for k, name in enumerate(("x_m", "y_m", "angle_rad")):
        rows[name] = shapes[:, :, k].real.ravel()
        rows[f"{name}_a_quarter_later"] = shapes[:, :, k].imag.ravel()
    write_csv(folder / "shapes.csv", rows)


def summarise_rest(
    mechanism: Mechanism, start: Start, rest: Equilibrium, results: Results, vibrations: Modes | None
) -> dict[str, Any]:
    """Return the content of summary.json.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    start : Start
        Start, with the count of degrees of freedom.
    rest : Equilibrium
        The state of rest.
    results : Results
        Its outputs and energies.
    vibrations : Modes or None
        Vibrations about it; None for an equilibrium alone.
    """
    summary: dict[str, Any] = {
        "title": mechanism.file.title,
        "analysis": mechanism.file.run.analysis,
        "steps": rest.steps,
        "residual_N": rest.residual,
        "net_freedoms": start.freedoms.net,
        "potential_J": float(results.energy["potential_J"][0]),
        "outputs": {name: float(column[0]) for name, column in results.outputs.items()},
    }
    if vibrations is not None:
        summary["frequencies_Hz"] = vibrations.frequencies
        summary["damping_ratios"] = vibrations.damping_ratios
    return summary


def _text(summary: dict[str, Any]) -> str:
    steps = f"{summary['steps']} step{'' if summary['steps'] == 1 else 's'}"
    lines = [f"equilibrium found in {steps}, residual force {summary['residual_N']:.2g} N"]
    lines += [f"{name} = {value:.9g}" for name, value in summary["outputs"].items()]
    for k, (f, d) in enumerate(zip(summary.get("frequencies_Hz", ()), summary.get("damping_ratios", ()), strict=True)):
        lines.append(f"mode {k + 1}: {f:.6g} Hz, damping {percent(d, 3)}")
    return "\n".join(lines)
