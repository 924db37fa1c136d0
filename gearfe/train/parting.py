"""What a run tells of the contact of its teeth: when they part, and whether a mesh law reaches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..typing import Array, BoolArray
from .forces import LawFlank
from .model import TrainModel
from .motion import Motion


@dataclass
class Parting:
    """When the teeth of a mesh are apart, from samples."""

    lost: int = 0
    regained: int = 0
    open_time: float = 0.0
    whole_time: float = 0.0
    longest: float = 0.0
    since: float | None = None
    before: tuple[float, bool] | None = None
    touched: bool = False

    def add(self, time: Array, apart: BoolArray) -> None:
        """Further samples; before the first contact nothing is lost."""
        for t, open_ in zip(time.tolist(), apart.tolist(), strict=True):
            last, was = self.before if self.before is not None else (t, open_)
            self.whole_time += t - last
            self.open_time += 0.5 * (open_ + was) * (t - last)
            if open_ and not was:
                self.lost, self.since = self.lost + 1, t
            elif was and not open_:
                self.regained += self.touched
                self.since = None
            self.touched = self.touched or not open_
            if self.since is not None:
                self.longest = max(self.longest, t - self.since)
            self.before = t, open_


def parted(parting: Sequence[Parting], never: Sequence[bool]) -> dict[str, list[float | None]]:
    """Statistics of all meshes; None for those that do not part."""

    def told(value: Callable[[Parting], float]) -> list[float | None]:
        return [None if whole else value(one) for one, whole in zip(parting, never, strict=True)]

    return {
        "contacts_lost": told(lambda one: one.lost),
        "contacts_regained": told(lambda one: one.regained),
        "share_without_contact": told(lambda one: one.open_time / max(one.whole_time, 1e-300)),
        "longest_without_contact_s": told(lambda one: one.longest),
    }


def beyond_law(model: TrainModel, moved: Motion) -> tuple[int, str] | None:
    """The first sample at which a mesh goes beyond what its law is known for, and what to ask for."""
    first: tuple[int, str] | None = None
    flanks, u = iter(model.forces.flanks), moved.q @ model.directions
    for i, line in enumerate(model.meshes):
        sides = [] if line.rigid else [next(flanks)] + ([] if line.backlash is None else [next(flanks)])
        for flank in sides:
            if not isinstance(flank, LawFlank):
                continue
            phase, approach = flank.place(model.angle(moved.time), u)
            past = approach > flank.law.touching(phase, flank.shifts_at(phase)) + flank.law.reach
            if past.any() and (first is None or int(np.argmax(past)) < first[0]):
                at = int(np.argmax(past))
                force, most = abs(float(moved.contact_force[at, i])), flank.law.largest_force
                radius = flank.law.base_radii[1]
                why = (
                    f"; at {1e3 * moved.time[at]:.6g} ms mesh {line.name} reaches {force:.4g} N, which is "
                    f"{force * radius:.4g} N m at the driven gear, and its law is known up to {most:.4g} N and "
                    f"{most * radius:.4g} N m: write law_torque_Nm = {1.5 * force * radius:.3g} in [[train.meshes]]"
                )
                first = at, why
    return first
