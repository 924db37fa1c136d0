"""Evaluate a run of a mechanism: named outputs, energies, joint reactions."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.expressions import compute, quantities
from ..base.files import read_text
from ..base.progress import stage
from ..base.typing import Array
from ..multibody import Linkage, Trajectory
from .model import Mechanism
from .quantities import OF_JOINT, OF_LINK, OF_SECTION, PLAIN

#: Energies of the whole mechanism that outputs may name.
ENERGIES = ("kinetic", "potential", "work", "total")
#: States that are evaluated at once: links of some dozen points take 6 kB each for their strains.
BLOCK = 4096
#: Numbers of the gradients that are held at once.
LARGEST = 1_000_000


@dataclass(frozen=True)
class Results:
    """Columns of the result tables, one entry per output time.

    Parameters
    ----------
    trajectory : Trajectory
        The run.
    outputs : dict
        Named outputs of the file.
    energy : dict
        kinetic_J, potential_J (gravity with datum y = 0, springs), work_J (of moments, point forces, dampers and
        prescribed motions, from the start), and total_J = kinetic + potential - work. elastic_J is that of flexible
        links, a part of the potential energy.
    sections : dict
        Flexible link -> axial force (N), shear force (N), bending moment (N m) at its nodes, shape (n, nodes, 3); of
        finite elements the stresses of the core, shape (n, s), see `PlateLink.von_mises`.
    """

    trajectory: Trajectory
    outputs: dict[str, Array] = field(repr=False)
    energy: dict[str, Array] = field(repr=False)
    sections: dict[str, Array] = field(default_factory=dict, repr=False)


@dataclass(frozen=True)
class Sensitivities:
    """Slopes of outputs by parameters.

    Attributes
    ----------
    values : dict
        Dotted name of a key -> its value, in its own unit.
    at : dict
        Output -> times (s), or numbers of modes; 0 for a state of rest.
    outputs : dict
        Output -> its values.
    slopes, errors : dict
        (key, output) -> slope by the key's own unit at every time; estimate of the largest error of these.
    """

    values: Mapping[str, float]
    at: Mapping[str, Array] = field(repr=False)
    outputs: Mapping[str, Array] = field(repr=False)
    slopes: Mapping[tuple[str, str], Array] = field(repr=False)
    errors: Mapping[tuple[str, str], float] = field(repr=False)

    def table(self) -> dict[str, Any]:
        """Columns of sensitivities.csv: a row for every parameter, output and time."""
        columns: dict[str, list[Any]] = {
            name: [] for name in ("parameter", "output", "time_s_or_mode", "value", "slope", "error")
        }
        for (name, output), slope in self.slopes.items():
            count = len(slope)
            columns["parameter"] += [name] * count
            columns["output"] += [output] * count
            columns["time_s_or_mode"] += self.at[output].tolist()
            columns["value"] += self.outputs[output].tolist()
            columns["slope"] += slope.tolist()
            columns["error"] += [self.errors[name, output]] * count
        return dict(columns)


@stage("outputs")
def evaluate(mechanism: Mechanism, trajectory: Trajectory) -> Results:
    """Outputs and energies at the times of the trajectory."""
    energy, sections = energies(mechanism, trajectory), _sections(mechanism, trajectory)
    return Results(trajectory, outputs_at(mechanism, trajectory, sections, energy), energy, sections)


def outputs_at(
    mechanism: Mechanism,
    trajectory: Trajectory,
    sections: Mapping[str, Array] | None = None,
    energy: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """Return the outputs of the file at the times of a trajectory.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    trajectory : Trajectory
        Its motion.
    sections, energy : mapping of ndarray, optional
        Stresses of the elastic links and energies where they are known, as of `Results`; those that outputs need are
        computed otherwise.
    """
    needed = set().union(*(quantities(node) for node in mechanism.outputs.values())) if mechanism.outputs else set()
    needs = {kind for kind, _ in needed}
    v = trajectory.v if needs - {"angle", "x", "y", *PLAIN} else None
    a = trajectory.a if needs & {"angular_acceleration", "ax", "ay"} else None
    if sections is None and needs & {*OF_SECTION, *OF_LINK}:
        sections = _sections(mechanism, trajectory)
    values = mechanism.values(needed, trajectory.q, v, a, sections)
    if needs & set(OF_JOINT):
        forces = reactions(mechanism, trajectory)
        ends = dict(zip(OF_JOINT, ("x_N", "y_N", "moment_N_m"), strict=True))
        values |= {(kind, joint): forces[f"{joint}_{ends[kind]}"] for kind, joint in needed if kind in ends}
    values["time", None] = trajectory.time
    if needs & set(ENERGIES):
        energy = energies(mechanism, trajectory) if energy is None else energy
        values |= {(name, None): energy[f"{name}_J"] for name in ENERGIES}
    outputs = {}
    for table in mechanism.file.outputs:
        column = np.broadcast_to(compute(mechanism.outputs[table.name], values), trajectory.time.shape).astype(float)
        outputs[table.name] = column if table.wrap is None else wrapped(column, table.wrap)
    return outputs


def _sections(mechanism: Mechanism, trajectory: Trajectory) -> dict[str, Array]:
    """Stresses of the elastic links at the times of a trajectory, as of `Results`."""
    beams = {
        name: link.beam.at_nodes(trajectory.stress_at(link.beam, trajectory.time))
        for name, link in mechanism.links.items()
    }
    return beams | {
        name: trajectory.stress_at(link.element, trajectory.time) for name, link in mechanism.plates.items()
    }


def in_blocks(function: Callable[..., Array], *states: Array, size: int = BLOCK) -> Array:
    """A function of many states (times, ...) by blocks of times, which bounds the memory that it needs."""
    size = max(1, size)
    parts = [function(*(x[k : k + size] for x in states)) for k in range(0, len(states[0]), size)]
    return np.concatenate(parts)


def wrapped(values: Array, period: float) -> Array:
    """Remainder in [0, period); what rounding leaves just below the period is 0."""
    rest = np.mod(values, period)
    return np.where(rest >= period * (1.0 - 1e-12), 0.0, rest)


def energies(mechanism: Mechanism, trajectory: Trajectory) -> dict[str, Array]:
    """Kinetic, potential, work and total energy (J) at the output times."""
    system = mechanism.system
    q, v = trajectory.q, trajectory.v
    kinetic, potential = in_blocks(lambda q, v: np.array(system.energy(q, v)).T, q, v).T
    work = _work(mechanism, trajectory)
    links = mechanism.elastic.values()
    elastic = {"elastic_J": np.sum([in_blocks(link.elastic_energy, q) for link in links], axis=0)} if links else {}
    return {
        **elastic,
        "kinetic_J": kinetic,
        "potential_J": potential,
        "work_J": work,
        "total_J": kinetic + potential - work,
    }


def _work(mechanism: Mechanism, trajectory: Trajectory) -> Array:
    """Compute the work since the start.

    For constant loads it has a closed form, otherwise it is a Gauss quadrature of the power between output times and
    ends of steps.
    """
    linkage, time = mechanism.linkage, trajectory.time
    work = in_blocks(linkage.steady_work, trajectory.q[:, : linkage.size])
    work = work - work[:1]
    damped = [link for link in mechanism.elastic.values() if link.damping]
    if not (linkage.powered or damped or linkage.driven) or len(time) < 2:
        return work
    nodes, weights = np.polynomial.legendre.leggauss(8)
    # steps end at the corners of loads, between which the power is smooth
    way = 1.0 if time[-1] >= time[0] else -1.0
    ends = getattr(trajectory.dense, "times", time)
    inside = ends[(way * ends > way * time[0]) & (way * ends < way * time[-1])]
    edges = way * np.unique(way * np.concatenate([time, inside]))
    half = 0.5 * np.diff(edges)
    at = (0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * nodes).ravel()

    def varying_power(at: Array) -> Array:
        states = trajectory.dense(at, 0), trajectory.dense(at, 1)
        planar = [state[:, : linkage.size] for state in states]
        power = linkage.power(at, *planar)
        for link in damped:
            power = power - link.loss(*states)
        if linkage.driven:
            multipliers = trajectory.multipliers_at(at)[:, : linkage.rows]
            power = power + (multipliers * linkage.rate(at, planar[0])).sum(axis=1)
        return power

    gained = (in_blocks(varying_power, at).reshape(len(half), -1) @ weights) * half
    return np.asarray(work + np.append(0.0, np.cumsum(gained))[np.searchsorted(way * edges, way * time)])


def reactions(mechanism: Mechanism, trajectory: Trajectory) -> dict[str, Array]:
    """Force (N) and moment (N m) of every joint on its first body, at the joint's point.

    Columns are ``JOINT_x_N, JOINT_y_N, JOINT_moment_N_m``. Redundant rows carry nothing: where there are some,
    the share of
    the joints is not unique.
    """
    linkage, out = mechanism.linkage, {}
    if not linkage.joints:
        return {}
    q, multipliers = trajectory.q[:, : linkage.size], trajectory.multipliers[:, : linkage.rows]
    pulls = in_blocks(partial(_pulls, linkage), q, multipliers, size=LARGEST // (1 + linkage.rows * linkage.size))
    for j, (name, joint) in enumerate(zip(mechanism.file.joints, linkage.joints, strict=True)):
        body = linkage.body_index[getattr(joint, "a", "") or getattr(joint, "body", "")]
        x, y, moment = pulls[:, j, body].T
        at = getattr(joint, "point_a", getattr(joint, "point", (0.0, 0.0)))
        dx, dy = np.asarray(at) - linkage.assembly.centre[body]
        angle = q[:, 3 * body + 2] if body < len(linkage.bodies) else np.zeros(len(q))
        c, s = np.cos(angle), np.sin(angle)
        out[f"{name}_x_N"], out[f"{name}_y_N"] = x, y
        out[f"{name}_moment_N_m"] = moment - (c * dx - s * dy) * y + (s * dx + c * dy) * x
    return out


def _pulls(linkage: Linkage, q: Array, multipliers: Array) -> Array:
    """Forces and moments of the joints on the bodies at their centres, on the ground at its origin.

    Shape (times, joints, bodies + 1, 3).
    """
    held = np.array(linkage.assembly.row_joint)[:, None] == np.arange(len(linkage.joints))
    pulls = -np.einsum("tr,rj,trq->tjq", multipliers, held, linkage.jacobian(0.0, q))
    on = pulls.reshape(len(q), len(linkage.joints), -1, 3)
    place = q.reshape(len(q), 1, -1, 3)
    about = on[..., 2] + place[..., 0] * on[..., 1] - place[..., 1] * on[..., 0]  # what the ground has to balance
    ground = -np.concatenate([on[..., :2], about[..., None]], axis=-1).sum(axis=2, keepdims=True)
    return np.concatenate([on, ground], axis=2)


def reference_differences(mechanism: Mechanism, trajectory: Trajectory) -> dict[str, float]:
    """Return the largest difference of each output from its reference column, at the times of the reference.

    Outputs at these times follow from the solution between the output times. Wrapped outputs are compared within a
    period. Empty if the file has no reference, or the run ended before its second time.
    """
    reference = reference_table(mechanism)
    if reference is None:
        return {}
    first, last = sorted((float(trajectory.time[0]), trajectory.reached))
    inside = (first <= reference["t"]) & (reference["t"] <= last)
    if inside.sum() < 2:
        return {}
    results = evaluate(mechanism, replace(trajectory, time=reference["t"][inside]))
    periods = {output.name: output.wrap for output in mechanism.file.outputs}
    found = {}
    for name, column in mechanism.file.figure.reference_columns.items():
        off = np.abs(results.outputs[name] - reference[column][inside])
        period = periods[name]
        if period is not None:
            off = np.mod(off, period)
            off = np.minimum(off, period - off)
        found[name] = float(off.max())
    return found


def reference_table(mechanism: Mechanism) -> dict[str, Array] | None:
    """Columns of the file that ``figure.reference`` names; None where it names none.

    Raises
    ------
    InputError
        When it cannot be read, or lacks a column.
    """
    table = mechanism.file.figure
    if table.reference is None:
        return None
    source = mechanism.path.parent / table.reference
    lines = [line for line in read_text(source, "figure.reference").splitlines() if not line.startswith("#")]
    try:
        rows = list(csv.DictReader(lines))
        columns = {name: np.array([float(row[name]) for row in rows]) for name in (rows[0] if rows else {})}
    except (ValueError, TypeError, csv.Error) as error:
        raise InputError(
            "figure.reference", str(source), f"is no table of numbers ({error})", "correct the file"
        ) from None
    if "time_s" in columns:  # as trajectory.csv has it
        columns.setdefault("t", columns["time_s"])
    for name in ("t", *table.reference_columns.values()):
        if name not in columns:
            problem = "has no column 't' or 'time_s' (s)" if name == "t" else f"has no column {name!r}"
            raise InputError("figure.reference", str(source), problem, "check its header")
    return columns
