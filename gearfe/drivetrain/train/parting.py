"""Contact of the teeth in a run: when they part, and whether they go beyond a mesh law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array, BoolArray
from ...multibody import Trajectory
from .forces import LawFlank, WidthFlank
from .model import TrainModel
from .states import TrainStates


@dataclass
class Parting:
    """When the teeth of a mesh are apart, from the steps of the integration, which end where they part and meet."""

    lost: int = 0
    regained: int = 0
    open_time: float = 0.0
    whole_time: float = 0.0
    longest: float = 0.0
    since: float = 0.0
    open_: bool | None = None
    touched: bool = False

    def add(self, ends: Array, apart: BoolArray) -> None:
        """Further steps between their ends (s + 1,); before the first contact nothing is lost."""
        for begin, end, open_ in zip(ends[:-1].tolist(), ends[1:].tolist(), apart.tolist(), strict=True):
            self.whole_time += end - begin
            if open_ and not self.open_:
                self.lost, self.since = self.lost + self.touched, begin
            if self.open_ and not open_:
                self.regained += self.touched
            if open_:
                self.open_time += end - begin
                self.longest = max(self.longest, (end - self.since) * self.touched)
            self.open_, self.touched = open_, self.touched or not open_


def apart_in_steps(model: TrainModel, trajectory: Trajectory, until: float) -> tuple[Array, BoolArray]:
    """Return the ends of the steps up to a time (s + 1,), and whether the teeth of each mesh are apart in the middle of
    each step, (s, meshes). Approaches and phases in the middle follow from both ends by cubics.
    """
    dense, n = trajectory.dense, model.modal.T.shape[1]
    ends = dense.times
    count = int(np.searchsorted(ends, until, side="right"))
    ends = ends[:count]
    states = getattr(dense, "states", None)
    if states is None:
        q, v = dense(ends), dense(ends, 1)
    else:
        q, v = model.modal.origin + states[:count, :n] @ model.modal.T.T, states[:count, n:] @ model.modal.T.T
    u, du = q @ model.directions, v @ model.directions
    h = np.diff(ends)[:, None]
    middle = 0.5 * (u[:-1] + u[1:]) + 0.125 * h * (du[:-1] - du[1:])
    angle = model.angle(0.5 * (ends[:-1] + ends[1:]))
    apart = np.zeros((len(angle), len(model.meshes)), dtype=bool)
    for i, line in enumerate(model.meshes):
        if not line.rigid:
            touching = [flank.bears(*flank.phase_and_approach(angle, middle)) for flank in line.flanks]
            apart[:, i] = ~np.any(touching, axis=0)
    return ends, apart


def parted(parting: Sequence[Parting], never: Sequence[bool]) -> dict[str, list[float | None]]:
    """Statistics of all meshes; None for those that do not part."""

    def each_mesh(value: Callable[[Parting], float]) -> list[float | None]:
        return [None if whole else value(one) for one, whole in zip(parting, never, strict=True)]

    return {
        "contacts_lost": each_mesh(lambda one: one.lost),
        "contacts_regained": each_mesh(lambda one: one.regained),
        "share_without_contact": each_mesh(lambda one: one.open_time / max(one.whole_time, 1e-300)),
        "longest_without_contact_s": each_mesh(lambda one: one.longest),
    }


def beyond_law(model: TrainModel, moved: TrainStates) -> tuple[int, str] | None:
    """The first sample at which a mesh goes beyond the range of its law, and the cure."""
    first: tuple[int, str] | None = None
    u = moved.q @ model.directions
    for i, line in enumerate(model.meshes):
        for flank in line.flanks:
            phase, approach = flank.phase_and_approach(model.angle(moved.time), u)
            tilts = np.broadcast_to(flank.tilt_of(u), phase.shape)
            if isinstance(flank, LawFlank):
                past = approach > flank.law.first_contact(phase, flank.shifts_at(phase)) + flank.law.reach
            elif isinstance(flank, WidthFlank):
                past = flank.law.past(approach, tilts)
            else:
                continue
            if past.any() and (first is None or int(np.argmax(past)) < first[0]):
                at = int(np.argmax(past))
                if isinstance(flank, WidthFlank) and approach[at] <= flank.law.reach:
                    size, most = (1e6 * flank.law.width * x for x in (abs(tilts[at]), flank.law.tilts[-1]))
                    why = (
                        f"; at {1e3 * moved.time[at]:.6g} ms the gears of mesh {line.name} tilt by {size:.4g} um over "
                        f"their width, and its law is known up to {most:.4g} um: write mesh_model_tilt_um = "
                        f"{1.5 * size:.3g} in [[train.meshes]]"
                    )
                    first = at, why
                    continue
                force, most = abs(float(moved.contact_force[at, i])), flank.law.largest_force
                radius = flank.law.base_radii[1]
                why = (
                    f"; at {1e3 * moved.time[at]:.6g} ms mesh {line.name} reaches {force:.4g} N, which is "
                    f"{force * radius:.4g} N m at the driven gear, and its law is known up to {most:.4g} N and "
                    f"{most * radius:.4g} N m: write mesh_model_torque_Nm = {1.5 * force * radius:.3g} in "
                    "[[train.meshes]]"
                )
                first = at, why
    return first
