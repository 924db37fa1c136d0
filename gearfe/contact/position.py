"""A solved position: its torques, its tangent, and what recovering fields needs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closest import unreached
from .half_plane_result import PairContacts
from .half_width import half_widths
from .linearised import Linearised, linearise
from .newton import Outcome
from .scene import Scene

Array = NDArray[Any]


@dataclass(frozen=True)
class Position:
    """Solution of one position.

    Attributes
    ----------
    status
        ``converged``, ``no_contact`` (the undeformed gears are clear of each other), ``under_resolved`` (the
        contact is narrower than the elements, or none of their points sees it) or ``not_converged``. Torques are 0
        without contact, not-a-number when not solved.
    torque_wheel, torque_pinion
        Moments that the hubs need, energy-conjugate: sum of (x - c) x f over the current places (N m).
    torque_wheel_reaction
        Moment of the reactions at the wheel's bore: sum of (x - u - c) x f (N m).
    tangent
        d torque_wheel / d twist (N m/rad).
    pair_numbers : tuple of int
        Pair k joins pinion tooth k and wheel tooth -1 - k.
    pair_torques : ndarray
        Share of each pair in `torque_wheel` (N m).
    pair_widths : ndarray
        Half width of each pair's contact by the second moment of its pressure (m), see `gearfe.contact.half_width`.
    peak_pressure
        Largest pressure at a contact point (Pa): it oscillates with the mesh, and a sharp edge gives it no bound.
    iterations
        Newton steps.
    scene, forces, force_rate
        Pieces of flank (without their matrices), the nodal forces on them in tooth axes (N) and their derivatives with
        respect to the twist (N/rad), for recovering fields; None without a solution.
    pressure : ndarray, shape (q,)
        Pressure at the scene's contact points (Pa); None without a solution.
    contacts
        Loaded tooth pairs of the half-plane law with their panels; None for other laws.
    stress_loads, stress_load_rate
        Loads on the normal stress at the contact points (N m2) and their derivatives (N m2/rad); empty with theta = 0.
    """

    status: str
    torque_wheel: float
    torque_pinion: float
    torque_wheel_reaction: float
    tangent: float
    pair_numbers: tuple[int, ...]
    pair_torques: Array
    peak_pressure: float
    iterations: int
    pair_widths: Array = field(default_factory=lambda: np.zeros(0))
    scene: Scene | None = None
    forces: Array | None = None
    force_rate: Array | None = None
    pressure: Array | None = None
    stress_loads: Array | None = None
    stress_load_rate: Array | None = None
    contacts: PairContacts | None = None


def finish(scene: Scene, outcome: Outcome, iterations: int) -> Position:
    """The position that a converged outcome of the general iteration is."""
    state = outcome.state
    active = np.flatnonzero(state.unknown > 0)
    placed = scene.placed(state.displacement)
    lin = linearise(scene, outcome.projection, active, state.pressure, placed)
    forces = np.zeros(2 * len(scene.points))
    forces[lin.unknowns] = lin.weighted @ state.unknown[active]
    force = np.matmul(scene.rotation, forces.reshape(-1, 2, 1))[:, :, 0]
    wheel = scene.of_wheel
    about_wheel = -_moment(placed - scene.wheel_centre, force)
    reaction = -_moment(scene.points - scene.wheel_centre, force)
    of_pair = scene.windows[1::2]
    # laws of multipliers bear on one side
    grown = lin.weighted @ (state.unknown * scene.growth)[active] if scene.hats is None else np.zeros(len(lin.unknowns))
    tangent, force_rate, solved = _tangent(scene, lin, forces, grown, placed)
    load_rate = np.zeros(len(scene.weight) if scene.theta else 0)
    if scene.theta:
        load_rate[active] = lin.relief * solved
    return Position(
        status="converged",
        torque_wheel=float(about_wheel[wheel].sum()),
        torque_pinion=-float(_moment(placed, force)[~wheel].sum()),
        torque_wheel_reaction=float(reaction[wheel].sum()),
        tangent=tangent,
        pair_numbers=tuple(-1 - w.tooth for w in of_pair),
        pair_torques=np.array([about_wheel[w.nodes].sum() for w in of_pair]),
        peak_pressure=float(state.pressure[~unreached(outcome.projection.gap)].max()),
        iterations=iterations,
        pair_widths=half_widths(
            scene.pair,
            scene.slaves(scene.points),
            scene.weight * np.where(unreached(outcome.projection.gap), 0.0, state.pressure),
            scene.pairs,
        ),
        scene=replace(  # without the megabytes
            scene, compliance=np.zeros((0, 0)), stress=np.zeros((0, 0)), stress_stress=np.zeros((0, 0))
        ),
        forces=forces,
        force_rate=force_rate,
        pressure=np.where(unreached(outcome.projection.gap), 0.0, state.pressure),
        stress_loads=state.stress_loads,
        stress_load_rate=load_rate,
    )


def _moment(arm: Array, force: Array) -> Array:
    return arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]


def _tangent(scene: Scene, lin: Linearised, forces: Array, grown: Array, placed: Array) -> tuple[float, Array, Array]:
    """d torque / d twist, d forces / d twist and d (active unknowns) / d twist.

    In the axes of the wheel's teeth the wheel's nodes are carried by e_z x (x - c) dphi, and
    df = G^T (W dp + dW p) + H dx - dphi e_z x f,  dx = carried + C df,  dp = -gamma dg - S df,
    where the areas W grow only with the shares of corners: `grown` is G^T dW p/dphi.
    """
    nodes = lin.unknowns[::2] // 2
    wheel = scene.of_wheel[nodes][:, None]
    axes = scene.rotation[nodes]
    arm = np.matmul((placed - scene.wheel_centre)[nodes][:, None, :], axes)[:, 0, :]
    force = forces[lin.unknowns].reshape(-1, 2)
    carried = np.where(wheel, _quarter_turn(arm), 0.0).ravel()
    frame = np.where(wheel, _quarter_turn(force), 0.0).ravel() - grown
    right = lin.response @ frame - lin.parameter * (lin.opening @ carried)
    solved, rate = lin.solve(right, carried - lin.compliance @ frame)
    moved = carried + lin.moved(solved, rate - frame)
    change = _moment(arm, (rate - frame).reshape(-1, 2)) + _moment((moved - carried).reshape(-1, 2), force)
    spread = np.zeros_like(forces)
    spread[lin.unknowns] = rate - frame
    return -float(change[wheel[:, 0]].sum()), spread, solved


def _quarter_turn(vectors: Array) -> Array:
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


def unsolved(status: str, iterations: int = 0) -> Position:
    """A position without a solution: torques are 0 without contact, not-a-number otherwise."""
    nothing = 0.0 if status == "no_contact" else float("nan")
    return Position(status, nothing, nothing, nothing, nothing, (), np.zeros(0), nothing, iterations)
