r"""A load map computed: the twist at which each pinion angle carries each torque.

Torque by torque, from the middle of the range outwards, then the ones between, each level's twists are predicted from
the known levels (as in `gearfe.loadmap.load_map`: cubic in :math:`\ln\delta` over :math:`\ln T`) and solved. A cell is
accepted when its torque lies within :math:`\epsilon` = 3e-4 of the goal; the twist then takes one step along the
tangent of :math:`\ln\delta` over :math:`\ln T`, whose error is a few hundredths of :math:`\epsilon^2`, and what else
there is moves with the torque (forces as T, the peak pressure as :math:`\sqrt T`). Otherwise it is solved again, and
in the end searched for like any position at a torque.

Finite strain changes the torque by a share c. The energy that it adds is spent pair by pair, each with about the power
:math:`2 + p` of its load, so that with the pairs' shares :math:`s_k` of the torque

.. math:: c = \kappa\, T^p \sum_k s_k^{1+p}, \qquad p = 0.75,

where :math:`\kappa` hardly depends on torque and angle, also where pairs come and go (c itself varies fivefold over a
map and jumps there). It is evaluated on a few levels and interpolated, and once more directly in the cells
where c may be off by more than 5e-5.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.finite_strain import finite_strain_shares, interpolated_shares
from ..contact.laws import ContactLaw
from ..contact.position import Position
from ..contact.scene import MeshingPair
from ..elasticity import Material, Plane
from ..errors import InputError
from ..gear.iso6336 import mesh_stiffness
from ..gear.pair import GearPair
from ..stiffness.position_solver import PositionSolver, position_solver
from ..stiffness.positions import Progress, Solved, at_torque, at_twists, honest
from ..stiffness.sweep import STEEL, assembled_curve, distinct_angles, elastic_pair
from ..stopwatch import Stopwatch
from ..tables.laws import DEFAULT_LAW
from ..threads import one_thread
from .cells import closed_level, log_twist, one_cell, outward, spent_share
from .load_map import LoadMap

Array = NDArray[Any]
IntArray = NDArray[Any]

#: Relative miss of the torque at which a cell is accepted, and how often one is solved before it is searched for.
ACCEPTED, TRIES = 3e-4, 6
#: Levels on which the share of finite strain is evaluated: an odd number, with the middle one, which is solved first.
SHARE_LEVELS = 5
#: Angles on which it is evaluated there.
SHARE_ANGLES = 24
#: Relative miss of the torque at which a cell tells its level's share, and the error of a share that is left.
NEAR, SHARE_ERROR = 0.05, 5e-5
#: Largest number of cells.
MOST_CELLS = 200_000
#: Angles over one mesh cycle where none are given.
ANGLES = 18


def sweep_loads(
    pair: GearPair,
    torques: ArrayLike,
    *,
    angles: ArrayLike | None = None,
    root_stress: bool = False,
    materials: Material | tuple[Material, Material] = STEEL,
    plane: Plane = "strain",
    law: str | ContactLaw = DEFAULT_LAW,
    kinematics: Literal["small", "finite"] = "finite",
    coarsen: float = 1.0,
    flank_coarsen: float = 1.0,
    points_per_edge: int = 4,
    elastic: MeshingPair | None = None,
    progress: Progress | None = None,
) -> LoadMap:
    """Stiffness, transmission error, load share, peak pressure and root stress over pinion angle and torque.

    Parameters
    ----------
    torques : array_like, shape (m,)
        Torques at the wheel's hub (N m), > 0.
    angles : array_like, shape (n,), optional
        Pinion angles (rad); without them, 18 over one mesh cycle. Positions that differ by whole mesh cycles are
        solved once.
    root_stress
        Also the tension at the tooth roots, on refined meshes of its own, see `gearfe.loadmap.root_stress`.
    materials, plane, law, kinematics, coarsen, flank_coarsen, points_per_edge, elastic, progress
        See `gearfe.stiffness.sweep.sweep_stiffness`.

    Returns
    -------
    LoadMap
        With every cell asked for; one that failed has its status and not-a-number.

    Raises
    ------
    InputError
        For torques or angles out of range.
    """
    if kinematics not in ("small", "finite"):
        raise InputError("kinematics", kinematics, "must be small or finite")
    goals = np.unique(np.atleast_1d(np.asarray(torques, dtype=float)))
    if goals.ndim != 1 or len(goals) == 0 or not (np.isfinite(goals).all() and goals[0] > 0):
        raise InputError("torques", torques, "must be finite and > 0 N m", "give torques at the wheel's hub")
    cycle = pair.mesh_cycle
    asked = np.arange(ANGLES) * cycle / ANGLES if angles is None else np.atleast_1d(np.asarray(angles, dtype=float))
    if asked.ndim != 1 or len(asked) == 0 or not np.isfinite(asked).all():
        raise InputError("angles", angles, "must be a list of finite angles (rad)", "give at least one angle")
    watch = Stopwatch()
    if elastic is None:
        sizes: dict[str, Any] = {"coarsen": coarsen, "flank_coarsen": flank_coarsen, "points_per_edge": points_per_edge}
        elastic = elastic_pair(pair, materials, plane=plane, law=law, watch=watch, **sizes)
    solved_angles, source = distinct_angles(asked, cycle)
    if len(goals) * len(solved_angles) > MOST_CELLS:
        problem = f"makes more than {MOST_CELLS} cells with {len(solved_angles)} angles"
        raise InputError("torques", len(goals), problem, "use fewer torques or angles")
    solver = position_solver(pair, elastic)
    with watch.stage("unloaded flanks"):
        touching = solver.touching_twists(solved_angles)
    recorder = None
    if root_stress:
        from .root_stress import RootRecorder, pair_roots

        with watch.stage("root meshes"), one_thread():
            recorder = RootRecorder(pair_roots(pair, elastic))
    with watch.stage("cells"), one_thread():
        work = _Sweep(pair, solver, solved_angles, goals, touching, progress, recorder)
        levels = [honest(level, touching) for level in work.run(finite=kinematics == "finite")]
    curves = tuple(
        assembled_curve(pair, elastic.law, asked, solved_angles, source, level, touching, searched=True)
        for level in levels
    )
    failed = np.stack([curve.failed for curve in curves])
    root = None if recorder is None else recorder.gathered(goals, source, failed)
    return LoadMap(goals, curves, root, dict(watch.seconds))


@dataclass
class _Sweep:
    """The cells of a map while they are being solved; `raw` holds their last solutions, level by level."""

    pair: GearPair
    solver: PositionSolver
    angles: Array
    goals: Array
    touching: Array
    progress: Progress | None
    recorder: Any

    @property
    def elastic(self) -> MeshingPair:
        """The elastic gears."""
        return self.solver.elastic

    def run(self, *, finite: bool) -> list[Solved]:
        """Solve all levels."""
        m = len(self.goals)
        self.raw: list[list[Solved] | None] = [None] * m
        self.tally = np.zeros((m, len(self.angles)), dtype=np.int64)
        self.kappa: dict[int, Array] = {}
        self.samples: dict[int, dict[int, float]] = {}
        self.held: dict[tuple[int, int], Position] = {}
        self.direct: dict[int, dict[int, float]] = {}
        order = outward(m)
        sampled = {order[0], *np.linspace(0, m - 1, min(m, SHARE_LEVELS)).round().astype(int).tolist()}
        for done, row in enumerate(order, start=1):
            self._level(row, sample=finite and row in sampled)
            if self.progress is not None:
                self.progress(done * len(self.angles), m * len(self.angles), "cells")
        if finite:
            self._sharpen()
        return [self._finished(row) for row in range(m)]

    def _finished(self, row: int) -> Solved:
        """A level at its torque, with its share of finite strain; cells that this moves far are solved once more."""
        cells = self.raw[row]
        assert cells is not None
        spent = np.array([spent_share(c.pairs[0][1]) if len(c.pairs[0][1]) else 0.0 for c in cells])
        share = self._share(row, spent)
        for i, one in self.direct.get(row, {}).items():
            share[i] = one
        twist, torque, tangent = (
            np.array([values[0] for values in column])
            for column in zip(*((c.twist, c.numbers["torque_wheel"], c.numbers["tangent"]) for c in cells), strict=True)
        )
        miss = self.goals[row] / (1 + share) - torque
        far = np.flatnonzero((np.abs(miss) > ACCEPTED * self.goals[row]) & (tangent > 0))
        if len(far):
            again = self._solved(row, far, twist[far] + miss[far] / tangent[far])
            self.tally[row, far] += again.iterations
            for k, i in enumerate(far.tolist()):
                if again.status[k] == "converged":
                    cells[i] = one_cell(again, k)
        return closed_level(cells, self.goals[row], share, self.touching, self.tally[row])

    def _level(self, row: int, *, sample: bool) -> None:
        """Solve one torque at all angles."""
        spent = self._spent_before(row)
        twist = self._predicted(self.goals[row] / (1 + self._share(row, spent)))
        sampled = set(self._sampled_angles()) if sample else set()
        found: list[Solved | None] = [None] * len(twist)
        open_ = np.arange(len(twist))
        for _ in range(TRIES):
            made = self._solved(row, open_, twist[open_])
            near = open_[np.abs(made.numbers["torque_wheel"] / self.goals[row] - 1) < NEAR]
            self._sample_kappa(row, sorted(sampled.intersection(near.tolist())))
            sampled.difference_update(near.tolist())
            good = [k for k, status in enumerate(made.status) if status == "converged"]
            spent[open_[good]] = [spent_share(made.pairs[k][1]) for k in good]
            goal = self.goals[row] / (1 + self._share(row, spent))
            self.tally[row, open_] += made.iterations
            still = []
            for k, i in ((k, open_[k]) for k in good):
                miss = goal[i] - made.numbers["torque_wheel"][k]
                if abs(miss) <= ACCEPTED * self.goals[row]:
                    found[i] = one_cell(made, k)
                elif made.numbers["tangent"][k] > 0:
                    least = self.touching[i] + 0.5 * (twist[i] - self.touching[i])
                    twist[i] = max(twist[i] + miss / made.numbers["tangent"][k], least)
                    still.append(i)
            open_ = np.array(still, dtype=np.int64)
            if len(open_) == 0:
                break
        for i in (i for i, one in enumerate(found) if one is None):
            found[i] = self._searched(row, i, goal[i])
        self.raw[row] = [one for one in found if one is not None]

    def _spent_before(self, row: int) -> Array:
        """What `_spent` was at the nearest solved level, moved to this torque."""
        rows = [i for i, cells in enumerate(self.raw) if cells is not None]
        cells = self.raw[min(rows, key=lambda i: abs(i - row))] if rows else None
        alone = spent_share(self.goals[row : row + 1])
        if cells is None:
            return np.full(len(self.angles), alone)
        each = [spent_share(c.pairs[0][1] / c.pairs[0][1].sum()) if len(c.pairs[0][1]) else 1.0 for c in cells]
        return alone * np.array(each)

    def _solved(self, row: int, numbers: IntArray, twists: Array) -> Solved:
        """Solve some cells of a level, and keep what finite strain and root stress need of them."""

        def observe(k: int, position: Position) -> None:
            if position.status == "converged":
                self.held[row, int(numbers[k])] = replace(position, points=None)
                if self.recorder is not None:
                    self.recorder.record(row, int(numbers[k]), position)

        return at_twists(self.solver, self.angles[numbers], twists, None, observe=observe)

    def _searched(self, row: int, i: int, goal: float) -> Solved:
        """A cell that the prediction did not lead to, like any position at a torque."""
        part = slice(i, i + 1)
        made = at_torque(self.solver, self.angles[part], goal, self.touching[part], None)
        self.tally[row, i] += made.iterations[0]
        if made.status[0] == "converged":
            self._solved(row, np.array([i]), made.twist)
        return made

    # ---- predictions -------------------------------------------------------------------------------------------------

    def _predicted(self, goal: Array) -> Array:
        """Twists, shape (n,), for the torques `goal`, shape (n,), without finite strain."""
        moduli = [body.material.youngs_modulus for body in self.elastic.bodies]
        level = mesh_stiffness(self.pair, moduli[0], moduli[1]) * self.elastic.width * self.pair.wheel.base_radius**2
        cells = [c for c in self.raw if c is not None]
        made = np.empty(len(goal))
        for i, one in enumerate(np.log(goal)):
            known = [c[i] for c in cells if c[i].status[0] == "converged" and c[i].numbers["tangent"][0] > 0]
            if not known:
                made[i] = one - np.log(level)
                continue
            delta = np.array([c.twist[0] for c in known]) - self.touching[i]
            torque = np.array([c.numbers["torque_wheel"][0] for c in known])
            slope = torque / (delta * np.array([c.numbers["tangent"][0] for c in known]))
            made[i] = log_twist(float(one), np.log(torque), np.log(delta), slope)
        return np.minimum(self.touching + np.exp(made), np.pi / self.pair.wheel.teeth)

    # ---- finite strain -----------------------------------------------------------------------------------------------

    def _sampled_angles(self) -> list[int]:
        """Numbers of the angles at which kappa is evaluated: all, or enough of them."""
        order = np.argsort(np.mod(self.angles, self.elastic.pitch_angle), kind="stable")
        places = np.linspace(0, len(order) - 1, min(SHARE_ANGLES, len(order))).round().astype(np.int64)
        return [int(i) for i in order[np.unique(places)]]

    def _sample_kappa(self, row: int, numbers: list[int]) -> None:
        """Evaluate kappa at some more angles of a level."""
        if numbers:
            positions = [self.held[row, i] for i in numbers]
            found = finite_strain_shares(self.elastic, positions) / [spent_share(p.pair_torques) for p in positions]
            known = self.samples.setdefault(row, {}) | dict(zip(numbers, found.tolist(), strict=True))
            self.samples[row], at = known, self.angles[list(known)]
            kappa = np.array(list(known.values()))
            self.kappa[row] = interpolated_shares(self.angles, at, kappa, self.elastic.pitch_angle)

    def _share(self, row: int, spent: Array) -> Array:
        """Share of finite strain c = kappa spent, shape (n,); ln T interpolates kappa between its levels."""
        rows = sorted(self.kappa)
        if not rows:
            return np.zeros(len(self.angles))
        low, high, t = self._bracket(row, rows)
        return np.asarray(spent * ((1 - t) * self.kappa[low] + t * self.kappa[high]))

    def _bracket(self, row: int, rows: list[int]) -> tuple[int, int, float]:
        """Levels with kappa beside a level, and where it lies between them."""
        after = int(np.clip(np.searchsorted(rows, row), 1, max(1, len(rows) - 1)))
        low, high = rows[after - 1], rows[min(after, len(rows) - 1)]
        if low == high:
            return low, high, 0.0
        x = np.log(self.goals[[low, row, high]])
        return low, high, float(np.clip((x[1] - x[0]) / (x[2] - x[0]), 0.0, 1.0))

    def _sharpen(self) -> None:
        """Evaluate the share of finite strain where kappa changes too much from level to level to be interpolated."""
        rows = sorted(self.kappa)
        wanted = []
        for (row, i), position in self.held.items():
            if not rows or row in rows:
                continue
            low, high, _ = self._bracket(row, rows)
            carrying = {self._pairs(level, i) for level in (low, row, high)}
            doubt = abs(self.kappa[high][i] - self.kappa[low][i]) * spent_share(position.pair_torques)
            if len(carrying) > 1 or 0.5 * doubt > SHARE_ERROR:
                wanted.append((row, i))
        for first in range(0, len(wanted), SHARE_ANGLES):
            part = wanted[first : first + SHARE_ANGLES]
            shares = finite_strain_shares(self.elastic, [self.held[key] for key in part])
            for (row, i), one in zip(part, shares, strict=True):
                self.direct.setdefault(row, {})[i] = float(one)

    def _pairs(self, row: int, i: int) -> int:
        """Number of pairs of teeth that carry load in a cell."""
        cells = self.raw[row]
        assert cells is not None
        return len(cells[i].pairs[0][0])
