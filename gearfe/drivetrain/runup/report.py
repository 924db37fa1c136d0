"""Tables and summary of a run-up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.typing import Array
from ...gears.rating.dynamics import dynamic_factor
from ..modes.report import frozen_carriers, mode_entries
from ..modes.report import tables as mode_tables
from ..train.response import XYZ
from ..train.simulate import DIVERGED
from .columns import dynamic_factors
from .critical import CriticalSpeeds, peaks_of
from .instability import InstabilityMap
from .orders import order_columns
from .results import SteadyState
from .run_up import RunUp


def tables(
    run: RunUp, critical: CriticalSpeeds, multiples: int, unstable: InstabilityMap | None = None
) -> dict[str, dict[str, Any]]:
    """Return the columns of all tables by the names of their files.

    Parameters
    ----------
    run : RunUp
        The run-up.
    critical : CriticalSpeeds
        Its modes and critical speeds.
    multiples : int
        Highest multiple of the mesh frequencies among the orders.
    unstable : InstabilityMap, optional
        Map of parametric instability.
    """
    columns = {
        "runup": run.columns(),
        "orders": order_columns(run, multiples),
        "waterfall": waterfall_columns(run),
        **mode_tables(critical.campbell),
    }
    return columns if unstable is None else {**columns, "instability": instability_columns(unstable)}


def iso_dynamic_factors(run: RunUp, mesh: int) -> Array:
    """K_v of a mesh at the given speeds by ISO 6336-1, method B, gears without deviations except the relief of `Gear`:
    with the mesh's own mean stiffness, and all that turns with its gears.
    """
    model = run.train.model
    line = model.meshes[mesh]
    one, two = (model.train.gear(name) for name in (line.given.driver, line.given.driven))
    inertia = [model.shafts[model.train.shaft_number(gear.shaft)].rotor.polar for gear in (one, two)]
    mass = 1.0 / sum(gear.gear.base_radius**2 / polar for gear, polar in zip((one, two), inertia, strict=True))
    relief = min(0.0 if g.gear.tip_relief is None else g.gear.tip_relief.amount for g in (one, two))
    force = abs(float(run.train.steady[mesh]))
    if not force > 0.0:
        return np.full(len(run.speeds), np.nan)
    return dynamic_factor(
        line.pair, line.ratio * run.speeds, stiffness=line.mean, mass=mass, force=force, relief=relief
    )


def waterfall(run: RunUp, states: Sequence[SteadyState] | None = None) -> dict[str, Array]:
    """Arrays of waterfall.npz: lines of all steady states up to the band by rising order; NaN beyond it.

    ``speed_rad_per_s`` and ``branch`` (states,), ``frequency_Hz`` (states, lines), ``order`` (lines,), ``harmonic``
    (lines, phases): multiples of the frequency of each phase, ``acceleration_m_per_s2`` (states, lines, attachments),
    ``bearing_force_N`` (states, lines, bores, 3): along x, y, z.
    """
    states = run.states if states is None else states
    count = max((len(s.frequency) for s in states), default=0)
    frequency = np.full((len(states), count), np.nan)
    moved = np.full((len(states), count, len(run.train.model.bores)), np.nan)
    forces = np.full((*moved.shape, 3), np.nan)
    for row, s in enumerate(states):
        inside = np.flatnonzero(s.frequency <= run.band_hz)
        frequency[row, inside], moved[row, inside] = s.frequency[inside], np.abs(s.acceleration[inside])
        forces[row, inside] = np.abs(s.bearing[inside, :, :3])
    waves = run.train.system.waves(max(count - 1, 0))[:count]
    order = (waves / np.array(run.train.system.turns)).sum(axis=1)
    kept = np.flatnonzero(np.isfinite(frequency).any(axis=0))
    kept = kept[np.argsort(order[kept], kind="stable")]
    return {
        "speed_rad_per_s": np.array([s.speed for s in states]),
        "branch": np.array([s.branch for s in states], dtype=np.int64),
        "order": order[kept],
        "harmonic": waves[kept],
        "frequency_Hz": frequency[:, kept],
        "acceleration_m_per_s2": moved[:, kept],
        "bearing_force_N": forces[:, kept],
    }


def waterfall_columns(run: RunUp) -> dict[str, Any]:
    """The same as rows of waterfall.csv."""
    made = waterfall(run)
    state, line = np.nonzero(np.isfinite(made["frequency_Hz"]))
    columns = {
        "speed_rad_per_s": made["speed_rad_per_s"][state],
        "branch": made["branch"][state],
        "frequency_Hz": made["frequency_Hz"][state, line],
        "order": made["order"][line],
    }
    if made["harmonic"].shape[1] > 1:
        columns |= {f"times_phase_{p + 1}": k[line] for p, k in enumerate(made["harmonic"].T)}
    for j, name in enumerate(run.train.model.bores):
        columns[f"acceleration_{name}_m_per_s2"] = made["acceleration_m_per_s2"][state, line, j]
    for j, name in enumerate(run.train.model.bores):
        for k, x in enumerate(XYZ):
            columns[f"bearing_force_{name}_{x}_N"] = made["bearing_force_N"][state, line, j, k]
    return columns


def instability_columns(made: InstabilityMap) -> dict[str, Any]:
    """Columns of instability.csv: a row for each speed and factor on the loads."""
    mu = made.multiplier.ravel()
    return {
        "load_factor": np.repeat(made.loads, len(made.speeds)),
        "speed_rad_per_s": np.tile(made.speeds, len(made.loads)),
        "largest_multiplier": np.abs(mu),
        "largest_multiplier_angle_deg": np.degrees(np.abs(np.angle(mu))),
        "growth_per_s": made.growth.ravel(),
    }


def summary(run: RunUp, critical: CriticalSpeeds) -> dict[str, Any]:
    """What summary.json says of the run-up."""
    states, model = run.states, run.train.model
    reached = {s.speed for s in states} & set(run.speeds.tolist())
    factors = [dynamic_factors(run.train, run.states, i) for i in range(len(model.meshes))]
    open_ = [np.array([s.apart[i] for s in states]) for i in range(len(model.meshes))]

    def most(values: Array) -> dict[str, float] | None:
        if not len(values) or not np.isfinite(values).any():
            return None
        at = int(np.nanargmax(values))
        return {"value": float(values[at]), "speed_rad_per_s": states[at].speed}

    return {
        "speeds": len(run.speeds),
        "speeds_reached": len(reached),
        "steady_states": len(states),
        "turning_speeds_rad_per_s": run.turning_speeds.tolist(),
        "bifurcations": [{"speed_rad_per_s": b.speed, "kind": b.kind, "branch": b.branch} for b in run.bifurcations],
        "largest_error_estimate": max((s.error for s in states if s.error == s.error), default=None),
        "phases": phases(run),
        "tolerance": run.tolerance,
        "band_Hz": run.band_hz,
        "mesh_names": [line.name for line in model.meshes],
        "flanks": [line.description for line in model.meshes],
        "steady_forces_N": run.train.steady.tolist(),
        "largest_dynamic_factor": [most(f) for f in factors],
        "largest_share_without_contact": [most(x) for x in open_],
        "peaks": peaks_of(run, critical),
        "modes": mode_entries(critical.campbell.modes),
        "notes": list(run.notes),
    }


def phases(run: RunUp) -> list[dict[str, Any]]:
    """Phases of the motion: after how many turns of the drive each repeats, and the meshes that follow it."""
    system, names = run.train.system, [line.name for line in run.train.model.meshes]
    carriers = {phase: [name.removeprefix("carrier ")] for phase, (name, _) in run.train.passes.items()}
    return [
        {"turns": turns, "meshes": [n for n, cycles in zip(names, system.orders, strict=True) if cycles[p]]}
        | ({"carriers": carriers[p]} if p in carriers else {})
        for p, turns in enumerate(system.turns)
    ]


def warnings(run: RunUp) -> list[str]:
    """Sentences about what a reader must know."""
    model = run.train.model
    found = [*model.mesh_notes, *model.operating.warnings, *frozen_carriers(model), *run.notes]
    for i, line in enumerate(run.train.model.meshes):
        if line.pulls:
            low = [(float(s.force[:, i].min()), s.speed) for s in run.states]
            least, speed = min(low, default=(0.0, 0.0))
            if least < 0.0:
                found.append(
                    f"mesh {line.name} pulls: {least:.5g} N at {speed:.6g} rad/s; the spring acts both ways, real "
                    'teeth would part there: write mesh_model = "potential" or backlash_um'
                )
    beyond = [s.speed for s in run.states if s.beyond]
    if beyond:
        found.append(
            f"at {len(beyond)} of {len(run.states)} states, the first at {beyond[0]:.6g} rad/s, a mesh goes beyond "
            "what its law is known for: write a larger mesh_model_torque_Nm, or mesh_model_tilt_um, in [[train.meshes]]"
        )
    found += far_shafts(run)
    held = {s.speed for s in run.states if s.stable is not False}
    lost = sorted({s.speed for s in run.states} & set(run.speeds.tolist()) - held, key=abs)
    if lost:
        found.append(
            f"at {len(lost)} speeds, {lost[0]:.6g} to {lost[-1]:.6g} rad/s, no motion with the period of the meshes is "
            "stable: what runs there repeats after several periods or not at all; look at a transient"
        )
    open_ = [s for s in run.states if s.multipliers is not None and s.stable is None]
    if open_:
        found.append(
            f"at {len(open_)} of {len(run.states)} states, the first at {open_[0].speed:.6g} rad/s, it is not known "
            "whether the motion is stable: the phases of the meshes repeat too late to decide it; look at a transient"
        )
    late = [s for s in run.states if s.error > run.tolerance]
    if late:
        worst = max(late, key=lambda s: s.error)
        found.append(
            f"{len(late)} of {len(run.states)} states miss the tolerance, the worst with {worst.error:.2g} at "
            f"{worst.speed:.6g} rad/s: their motion has more harmonics than the program takes"
        )
    return found


def far_shafts(run: RunUp) -> list[str]:
    """Sentences about shafts that move farther than transients may: the gears' geometry no longer holds there."""
    model = run.train.model
    limit = DIVERGED * min(line.module for line in model.meshes)
    found = []
    for number, shaft in enumerate(model.train.shafts):
        far = [(float(s.displacement[number]), s.speed) for s in run.states if not s.displacement[number] <= limit]
        if far:
            most, speed = max(far)
            found.append(
                f"shaft {shaft.name} moves by more than {DIVERGED:g} module ({1e3 * limit:.3g} mm) at {len(far)} of "
                f"{len(run.states)} states, the first at {far[0][1]:.6g} rad/s, by up to {1e3 * most:.3g} mm at "
                f"{speed:.6g} rad/s: the gears' geometry no longer holds there; lower speed or load, or stiffen "
                "bearings and pins"
            )
    return found
