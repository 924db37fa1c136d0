"""What a run of a mechanism yields: named outputs, energies, joint reactions."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeGuard

import numpy as np

from ..errors import InputError
from ..progress import stage
from ..rigid import CoordinateSpring, Moment, PointForce, Spring, StateFunction, TimeFunction, Trajectory
from ..textfile import read_text
from ..typing import Array
from .expressions import PLAIN, compute, quantities
from .model import Mechanism

#: States that are evaluated at once: links of some dozen points take 6 kB each for their strains.
BLOCK = 4096


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
        prescribed motions, from the start), total_J = kinetic + potential - work; elastic_J of flexible links, a part
        of the potential energy.
    sections : dict
        Flexible link -> axial force (N), shear force (N), bending moment (N m) at its nodes, shape (n, nodes, 3); of
        finite elements the stresses of the core, shape (n, s), see `PlateLink.von_mises`.
    """

    trajectory: Trajectory
    outputs: dict[str, Array] = field(repr=False)
    energy: dict[str, Array] = field(repr=False)
    sections: dict[str, Array] = field(default_factory=dict, repr=False)


@stage("outputs")
def evaluate(mechanism: Mechanism, trajectory: Trajectory) -> Results:
    """Outputs and energies at the times of the trajectory."""
    energy = energies(mechanism, trajectory)
    needed = set().union(*(quantities(node) for node in mechanism.outputs.values())) if mechanism.outputs else set()
    needs = {kind for kind, _ in needed}
    v = trajectory.v if needs - {"angle", "x", "y", *PLAIN} else None
    a = trajectory.a if needs & {"angular_acceleration", "ax", "ay"} else None
    sections = {
        name: link.beam.at_nodes(trajectory.stress_at(link.beam, trajectory.time))
        for name, link in mechanism.links.items()
    } | {name: trajectory.stress_at(link.element, trajectory.time) for name, link in mechanism.plates.items()}
    values = mechanism.values(needed, trajectory.q, v, a, sections)
    values["time", None] = trajectory.time
    for name in ("kinetic", "potential", "work", "total"):
        values[name, None] = energy[f"{name}_J"]
    outputs = {}
    for table in mechanism.file.outputs:
        column = np.broadcast_to(compute(mechanism.outputs[table.name], values), trajectory.time.shape).astype(float)
        outputs[table.name] = column if table.wrap is None else wrapped(column, table.wrap)
    return Results(trajectory, outputs, energy, sections)


def in_blocks(function: Callable[..., Array], *states: Array) -> Array:
    """A function of many states (times, ...) by blocks of times, which bounds the memory that it needs."""
    parts = [function(*(x[k : k + BLOCK] for x in states)) for k in range(0, len(states[0]), BLOCK)]
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
    """Work since the start: closed form for constant moments, else Gauss quadrature of the power between output times
    and ends of steps.
    """
    linkage = mechanism.linkage
    time = trajectory.time
    work = np.zeros(len(time))
    index = linkage.body_index
    varying = False
    for force in linkage.forces:
        if isinstance(force, Moment) and _is_polynomial(force.function):
            row = force.function.coefficients[0]
            if len(row) == 1:
                for body, sign in ((force.body, 1.0), (force.reaction, -1.0)):
                    if index[body] < len(linkage.bodies):
                        angle = trajectory.q[:, 3 * index[body] + 2]
                        work += sign * row[0] * (angle - angle[0])
                continue
        loses = isinstance(force, Spring | CoordinateSpring) and force.damping
        if isinstance(force, Moment | PointForce) or loses or (isinstance(force, Spring) and force.law is not None):
            varying = True
    damped = [link for link in mechanism.elastic.values() if link.damping]
    if not (varying or damped or linkage.driven) or len(time) < 2:
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
        power = linkage.power(at, *planar) - _steady_power(mechanism, states[1])
        for link in damped:
            power = power - link.loss(*states)
        if linkage.driven:
            multipliers = trajectory.multipliers_at(at)[:, : linkage.rows]
            power = power + (multipliers * linkage.rate(at, planar[0])).sum(axis=1)
        return power

    gained = (in_blocks(varying_power, at).reshape(len(half), -1) @ weights) * half
    return np.asarray(work + np.append(0.0, np.cumsum(gained))[np.searchsorted(way * edges, way * time)])


def _is_polynomial(load: TimeFunction | StateFunction) -> TypeGuard[TimeFunction]:
    return isinstance(load, TimeFunction) and not load.breaks and not load.sines


def _steady_power(mechanism: Mechanism, v: Array) -> Array:
    """Power of the constant moments, which have a closed form."""
    linkage = mechanism.linkage
    index = linkage.body_index
    power = np.zeros(len(v))
    for force in linkage.forces:
        if isinstance(force, Moment) and _is_polynomial(force.function):
            row = force.function.coefficients[0]
            if len(row) == 1:
                for body, sign in ((force.body, 1.0), (force.reaction, -1.0)):
                    if index[body] < len(linkage.bodies):
                        power += sign * row[0] * v[:, 3 * index[body] + 2]
    return power


def reactions(mechanism: Mechanism, trajectory: Trajectory) -> dict[str, Array]:
    """Force (N) and moment (N m) of every joint on its first body, at the joint's point.

    Columns are ``JOINT_x_N, JOINT_y_N, JOINT_moment_N_m``. Redundant rows carry nothing: where there are some,
    the share of
    the joints is not unique.
    """
    linkage = mechanism.linkage
    names = list(mechanism.file.joints)
    bodies = linkage.assembly.tables.forms.bodies
    owner = np.array(linkage.assembly.row_joint)
    out = {f"{n}_{c}": np.zeros(len(trajectory.time)) for n in names for c in ("x_N", "y_N", "moment_N_m")}
    q = trajectory.q[:, : linkage.size]
    for i, multipliers in enumerate(trajectory.multipliers):
        G = linkage.gradients(q[i])
        for j, name in enumerate(names):
            joint = linkage.joints[j]
            body = linkage.body_index[getattr(joint, "a", "") or getattr(joint, "body", "")]
            wrench = np.zeros(3)
            for r in np.flatnonzero(owner == j):
                side = 0 if bodies[r, 0] == body else 1
                wrench -= multipliers[r] * G[r, side]
            at = getattr(joint, "point_a", getattr(joint, "point", (0.0, 0.0)))
            centre = linkage.assembly.centre[body]
            angle = q[i, 3 * body + 2] if body < len(linkage.bodies) else 0.0
            c, s = np.cos(angle), np.sin(angle)
            dx, dy = at[0] - centre[0], at[1] - centre[1]
            arm = c * dx - s * dy, s * dx + c * dy
            out[f"{name}_x_N"][i], out[f"{name}_y_N"][i] = wrench[:2]
            out[f"{name}_moment_N_m"][i] = wrench[2] - (arm[0] * wrench[1] - arm[1] * wrench[0])
    return out


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
        made = {name: np.array([float(row[name]) for row in rows]) for name in (rows[0] if rows else {})}
    except (ValueError, TypeError, csv.Error) as error:
        raise InputError("figure.reference", str(source), f"is no table of numbers ({error})", "mend it") from None
    if "time_s" in made:  # as trajectory.csv has it
        made.setdefault("t", made["time_s"])
    for name in ("t", *table.reference_columns.values()):
        if name not in made:
            problem = "has no column 't' or 'time_s' (s)" if name == "t" else f"has no column {name!r}"
            raise InputError("figure.reference", str(source), problem, "check its header")
    return made
