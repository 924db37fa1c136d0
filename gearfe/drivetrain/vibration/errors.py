"""One estimate of the error for each number that a run is read for: housing's mesh and reduction, start, curve, steps.

The number is computed again with what may be wrong changed by its own estimate:

- *mesh*: what the estimate of the mesh's error allows the housing to be softer (`housing.mesh_error`). The true error
  softens each mode by a share of its own. Modes that are softened together may change a number in opposite directions,
  which hides the changes. A resonance may also pass a line and leave its height unchanged. So random halves of the
  modes are softened, each half and the other one, `PAIRS` times. To first order the changes by two halves add up to
  that by all, so the larger one times two covers that, too;
- *curve*: each computed stiffness larger by the worst relative error of its curve; given ones are taken as exact;
- *reduction*: its bound on the response, relative, of the vibrating part of the number (statics are exact);
- *start*: a load that is there at once accelerates an elastic body as fast as its finest element lets it. The
  acceleration of the first instant is known to its own size only, and so is a peak;
- *integration*: its estimate, relative, of the signal's largest value.

The parts are added. Each part covers its own source for either sign. Because the signs may agree, only the sum covers
all parts. The mesh is by far the largest part, so the sum is not much too large.

**Differences of two runs.** What may be wrong in the housing's mesh and in the curves is the same in two runs of one
housing. ``headline_error_changes`` holds the signed change of each number in each changed run, with the factor of its
part. `gearfe.output.differences` takes the largest difference of these changes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.typing import Array
from ...fem.reduction.error import response_error
from ...fem.reduction.modal_body import ModalBody
from ...gears.gearmesh.curve import StiffnessCurve
from ...gears.gearmesh.law import MeshLaw
from ...gears.gearmesh.width_law import WidthLaw
from ..train import build_train
from ..train.gear_train import GearTrain
from ..train.model import TrainModel, on_body
from .spectra import TrainSpectra

#: How often the modes are parted into halves: two runs each.
PAIRS = 2
#: Frequencies of a band at which the reduction's bound is taken.
POINTS = 50
#: Numbers of the summary that have an estimate, and the signal whose vibration they contain.
FORCES = ("mean_contact_forces_N", "smallest_contact_forces_under_load_N", "largest_contact_forces_N")
PEAKS, STARTS = "peak_attachment_accelerations_m_per_s2", "start_attachment_accelerations_m_per_s2"


@dataclass(frozen=True, eq=False)
class Run:
    """What a run is read for: its summary, and its spectra where it was long enough."""

    summary: Mapping[str, Any]
    spectra: TrainSpectra | None


def with_errors(
    run: Run, model: TrainModel, again: Callable[[TrainModel], Run], *, band_hz: float = 5000.0
) -> dict[str, Any]:
    """The summary of a run with an estimate of the error beside each number that it is read for.

    Parameters
    ----------
    run
        The run; its summary holds the estimates of integration and reduction.
    model
        Its train.
    again
        Repeats it with a changed train.
    band_hz
        Upper end of the band (Hz) for which the reduction's bound holds.

    Returns
    -------
    dict
        The summary with ``headline_errors`` (name -> estimates like the numbers, NaN where unknown),
        ``headline_error_parts`` (the same of each source) and ``headline_error_changes`` (signed, of each changed run).
        Each dominant line has ``error_estimate``, ``error_parts`` and ``error_changes``.
    """
    summary = dict(run.summary)
    if summary.get("status") != "done" or FORCES[0] not in summary:
        return summary
    base = _numbers(run, run)
    parts, changes = _parts(run, model, again, base, band_hz)
    total = {name: np.sum([part[name] for part in parts.values()], axis=0) for name in base}
    summary["headline_errors"] = _named(total, summary)
    summary["headline_error_parts"] = {source: _named(part, summary) for source, part in parts.items()}
    summary["headline_error_changes"] = {source: _by_run(change, summary) for source, change in changes.items()}
    if run.spectra is not None:
        numbers = iter(range(len(total["lines"])))
        summary["dominant_lines"] = {
            name: [{**line, **_line_error(next(numbers), total, parts, changes)} for line in found]
            for name, found in summary["dominant_lines"].items()
        }
    return summary


def _by_run(change: Mapping[str, Array], summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Changes of the numbers by each changed run, as the summary names them."""
    runs = range(len(change[FORCES[0]]))
    return [_named({name: rows[number] for name, rows in change.items()}, summary) for number in runs]


def _line_error(
    number: int,
    total: Mapping[str, Array],
    parts: Mapping[str, Mapping[str, Array]],
    changes: Mapping[str, Mapping[str, Array]],
) -> dict[str, Any]:
    """What a dominant line, by its number among all, says of its error."""
    return {
        "error_estimate": float(total["lines"][number]),
        "error_parts": {source: float(part["lines"][number]) for source, part in parts.items()},
        "error_changes": {source: change["lines"][:, number].tolist() for source, change in changes.items()},
    }


def _parts(
    run: Run, model: TrainModel, again: Callable[[TrainModel], Run], base: dict[str, Array], band_hz: float
) -> tuple[dict[str, dict[str, Array]], dict[str, dict[str, Array]]]:
    """Source -> number -> its share of the error; and the signed changes by each changed run, shape (runs, ...)."""
    estimates = run.summary["error_estimates"]
    body = model.train.housing
    parts, changes = {}, {}
    if body is not None:
        softer = [_numbers(again(on_body(model, half)), run) for half in _halves(body)]
        changes["mesh"] = {name: 2.0 * np.array([abs(x[name]) - abs(base[name]) for x in softer]) for name in base}
        softest = on_body(model, body.softened()).coupled_frequencies_hz  # these fall all the way
        fall = softest - base["coupled_frequencies_Hz"]
        changes["mesh"]["coupled_frequencies_Hz"] = np.broadcast_to(fall, (len(softer), *fall.shape)).copy()
        _forget(changes["mesh"], run, body.highest_hz)
        if not body.softening.any():  # no estimate is not no error
            changes["mesh"] = {name: np.full_like(values, math.nan) for name, values in changes["mesh"].items()}
        parts["mesh"] = {name: np.abs(values).max(axis=0) for name, values in changes["mesh"].items()}
        parts["reduction"] = _reduction(run, body, base, band_hz)
        parts["start"] = {name: np.zeros(values.shape) for name, values in base.items()}
        parts["start"][PEAKS] = np.array(list(run.summary[STARTS].values()), dtype=float)
    stiffer = _stiffer(model.train)
    if stiffer is not None:
        changed = _numbers(again(build_train(stiffer)), run)
        parts["curve"] = {name: np.abs(changed[name] - base[name]) for name in base}
        changes["curve"] = {name: np.array([abs(changed[name]) - abs(base[name])]) for name in base}
    parts["integration"] = {
        name: float(estimates.get("integration", math.nan)) * scale for name, scale in _largest(run, base).items()
    }
    return parts, changes


def _halves(body: ModalBody) -> Iterator[ModalBody]:
    """The body softened in a random half of its modes with free attachments, and in the other half, `PAIRS` times."""
    random = np.random.default_rng(0)
    for _ in range(PAIRS):
        half = np.asarray(random.permutation(body.size) % 2, dtype=float)
        yield body.softened(half)
        yield body.softened(1.0 - half)


def _numbers(run: Run, like: Run) -> dict[str, Array]:
    """The numbers of a run, lines with their phases at the bins of another one's; NaN where it ended early."""
    summary = run.summary
    done = summary.get("status") == "done"
    found = {name: np.asarray(summary.get(name, math.nan), dtype=float) for name in FORCES}
    found[PEAKS] = np.array(list(summary[PEAKS].values()), dtype=float)
    found["coupled_frequencies_Hz"] = np.asarray(summary["coupled_frequencies_Hz"], dtype=float)
    if like.spectra is not None:
        made = run.spectra
        lines = [complex("nan") if made is None else made.value(name)[place] for name, place in _bins(like)]
        found["lines"] = np.array(lines, dtype=complex)
        if like.spectra.power is not None:
            power = None if run.spectra is None else run.spectra.power
            found["radiated_power_mean_W"] = np.array(math.nan if power is None else power.mean)
    return found if done else {name: np.full_like(values, math.nan) for name, values in found.items()}


def _bins(run: Run) -> list[tuple[str, int]]:
    """Signal and bin of each dominant line, in the order of the summary."""
    assert run.spectra is not None
    resolution = run.spectra.spectrum.resolution
    lines = run.summary["dominant_lines"]
    return [(name, round(line["frequency_Hz"] / resolution)) for name, found in lines.items() for line in found]


def _largest(run: Run, base: dict[str, Array]) -> dict[str, Array]:
    """Largest value of the signal of each number."""
    largest = np.maximum(abs(base[FORCES[1]]), abs(base[FORCES[2]]))
    found = {name: np.broadcast_to(largest, values.shape) for name, values in base.items() if name in FORCES}
    found[PEAKS] = base[PEAKS]
    found["coupled_frequencies_Hz"] = np.zeros_like(base["coupled_frequencies_Hz"])
    if "lines" in base:
        assert run.spectra is not None
        tallest = {name: float(run.spectra.amplitude(name).max()) for name in run.spectra.names}
        found["lines"] = np.array([tallest[name] for name, _ in _bins(run)])
    if "radiated_power_mean_W" in base:
        found["radiated_power_mean_W"] = 2.0 * base["radiated_power_mean_W"]
    return found


def _reduction(run: Run, body: ModalBody, base: dict[str, Array], band_hz: float) -> dict[str, Array]:
    """Share of the reduction: its bound up to the band's end, for a line beyond it up to that line."""
    bound = float(run.summary["error_estimates"].get("reduction", math.nan))
    swing = 0.5 * (base[FORCES[2]] - base[FORCES[1]])
    found = dict.fromkeys(FORCES, bound * swing) | {FORCES[0]: np.zeros_like(swing), PEAKS: bound * base[PEAKS]}
    frequencies = base["coupled_frequencies_Hz"]
    found["coupled_frequencies_Hz"] = np.zeros_like(frequencies)
    if "lines" in base:
        at = _line_frequencies(run)
        bounds = {f: response_error(body, f, points=POINTS) for f in np.unique(at[at > band_hz]).tolist()}
        found["lines"] = np.array([bounds.get(f, bound) for f in at.tolist()]) * np.abs(base["lines"])
        found["lines"][~np.isfinite(found["lines"])] = math.nan
    if "radiated_power_mean_W" in base:
        found["radiated_power_mean_W"] = 2.0 * bound * base["radiated_power_mean_W"]
    return found


def _line_frequencies(run: Run) -> Array:
    """Frequency of each dominant line (Hz)."""
    lines = run.summary["dominant_lines"]
    return np.array([line["frequency_Hz"] for found in lines.values() for line in found])


def _forget(part: dict[str, Array], run: Run, highest: float) -> None:
    """Take back what is said of frequencies (Hz) above the housing's highest mode, where the mesh has no estimate."""
    frequencies = np.asarray(run.summary["coupled_frequencies_Hz"])
    part["coupled_frequencies_Hz"] = np.where(frequencies > highest, math.nan, part["coupled_frequencies_Hz"])
    if "lines" in part:
        part["lines"] = np.where(_line_frequencies(run) > highest, math.nan, part["lines"])


def _stiffer(train: GearTrain) -> GearTrain | None:
    """The train with each computed stiffness larger by its error; None where no stiffness has an estimate."""
    meshes, changed = [], False
    for mesh in train.meshes:
        curve = mesh.stiffness
        if isinstance(curve, MeshLaw | WidthLaw) and math.isfinite(curve.error):
            meshes.append(replace(mesh, stiffness=curve.stiffer(curve.error)))
            changed = True
        elif isinstance(curve, StiffnessCurve) and math.isfinite(curve.worst_error):
            stiffer = replace(curve, k_mesh=(1.0 + curve.worst_error) * curve.k_mesh)
            meshes.append(replace(mesh, stiffness=stiffer))
            changed = True
        else:
            meshes.append(mesh)
    return replace(train, meshes=tuple(meshes)) if changed else None


def _named(values: Mapping[str, Array], summary: Mapping[str, Any]) -> dict[str, Any]:
    """As the summary names them; the lines are next to their amplitudes."""
    found: dict[str, Any] = {name: value for name, value in values.items() if name not in (PEAKS, "lines")}
    found[PEAKS] = dict(zip(summary[PEAKS], values[PEAKS].tolist(), strict=True))
    return found


def with_error(error: float | None) -> str:
    """Text after a number: its error, a question mark where it is unknown, nothing without an estimate."""
    if error is None:
        return ""
    return f" +- {float(error):.2g}" if math.isfinite(error) else " +- ?"
