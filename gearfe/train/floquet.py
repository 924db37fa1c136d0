r"""Stability of a train: Floquet multipliers of the motion that is integrated, not of stiffnesses k(Omega t).

In steady running the train has a motion that repeats with the common mesh period, the orbit. A mesh force
:math:`-k(\varphi)\,\delta` depends on the driver's real rotation :math:`\varphi = s(g\Omega t + u) + \varphi_0`, so
small motions beside the orbit :math:`\delta^*, u^*` feel

.. math::
    -\big(k(\varphi^*)\, w^T + s\,k'(\varphi^*)\,\delta^*\, e^T\big)\, \Delta q , \qquad \delta = w^T q,\ u = e^T q ,

and the gyroscopic moments of a spin that swings. The orbit is found by Newton's method on the map over a period, whose
derivative is the monodromy matrix; steps end on the corners of the curves. All modes are kept.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..progress import stage
from ..threads import one_thread
from ..typing import Array, ComplexArray
from .model import TrainModel
from .monodromy import Flow, flow, kick_times, monodromy, multipliers, settled, walk

__all__ = ["Linearised", "multipliers", "train_multipliers"]


#: Newton steps to the orbit, and what may be left of the way round it, relative to the state.
MOST_TRIES, CLOSED = 12, 1e-9
#: Squares of frequencies below this part of the largest are round-off: the mode moves freely.
ROUND_OFF = 1e-12
#: Corners nearer than this part of the period are one.
SAME = 1e-9


@stage("stability of the steady motion")
def train_multipliers(model: TrainModel) -> tuple[ComplexArray | None, str]:
    """Multipliers of a train at its steady speed over the common period of its meshes, or the reason for none."""
    speed, note = model.steady_speed, why_not(model)
    if note:
        return None, note
    assert model.rolling.common_turns is not None
    period = float(model.rolling.common_turns) * 2 * math.pi / abs(speed)
    with one_thread():
        made = settled(Linearised(model, speed, period).matrix)
    if made is not None:
        return made, ""
    return None, f"no motion was found that repeats with the common mesh period of {1e3 * period:.4g} ms"


def why_not(model: TrainModel) -> str:
    """Why a train has no multipliers, or nothing."""
    drive = model.train.driven
    reasons = (
        (not drive.speed.ends or model.steady_speed == 0.0, "the drive has no steady speed"),
        (
            not all(load.torque.ends for load in model.train.loads),
            "a load changes all the time: no motion repeats with the meshes",
        ),
        (model.rolling.common_turns is None, model.rolling.note),
        (not len(model.modal.eigenvalues), "nothing can vibrate: rigid meshes in a rigid housing follow the drive"),
        (
            any(not (line.rigid or line.pulls) for line in model.meshes),
            "the teeth may part, and which motion they settle to is open: `gearfe runup` finds the periodic motions "
            "and the multipliers of each",
        ),
    )
    return next((note for there, note in reasons if there), "")


@dataclass(eq=False)
class Linearised:
    """Motion of a train beside its orbit, in minimal coordinates about the static place with mean stiffnesses.

    Parameters
    ----------
    model
        The train.
    speed
        Of the drive (rad/s).
    period
        Common mesh period (s).
    """

    model: TrainModel
    speed: float
    period: float

    def __post_init__(self) -> None:
        modal, model = self.model.modal, self.model
        n = len(modal.eigenvalues)
        torque = modal.constant + modal.T.T @ sum(
            (d * float(f(model.torque_end)) for d, f in model.torques), start=np.zeros(len(modal.T))
        )
        held = modal.eigenvalues > ROUND_OFF * modal.eigenvalues.max(initial=0.0)
        self.static = np.where(held, torque / np.where(held, modal.eigenvalues, 1.0), 0.0)
        self.rest = np.where(held, 0.0, torque)
        self.lines = [line for line in model.meshes if line.curve is not None]
        self.approach = np.array([line.row @ modal.T for line in self.lines]).reshape(-1, n).T
        self.spin = np.array([modal.T[model.first[line.driver] + 5] for line in self.lines]).reshape(-1, n).T
        turning = zip(model.shafts, model.first, strict=True) if model.train.damping.gyroscopic else ()
        rotors = [(body.rotor.polar, first) for body, first in turning]
        self.polar = np.array([polar for polar, _ in rotors])
        self.tilts = [np.array([modal.T[i + j] for _, i in rotors]).reshape(-1, n).T for j in (3, 4, 5)]
        self.state = np.zeros(2 * n)

    @cached_property
    def constant(self) -> Flow:
        """Mean stiffnesses, damping and the gyroscopic moments of steady spins."""
        modal, model = self.model.modal, self.model
        damping = modal.damping.copy()
        for k, polar in enumerate(self.polar):
            one, two = self.tilts[0][:, k], self.tilts[1][:, k]
            damping += polar * model.ratios[k] * self.speed * (np.outer(one, two) - np.outer(two, one))
        return flow(modal.eigenvalues, damping, self.period)

    @property
    def directions(self) -> Array:
        """Along which forces change: approaches of the meshes, both tilts of the shafts; (n, m + 2 s)."""
        return np.hstack([self.approach, *self.tilts[:2]])

    @property
    def reads(self) -> Array:
        """What they depend on: approaches and spins of drivers, rates of tilts and spins; rows (2n, 2 m + 3 s)."""
        places, rates = np.hstack([self.approach, self.spin]), np.hstack(self.tilts)
        return np.block(
            [
                [places, np.zeros((len(places), rates.shape[1]))],
                [np.zeros((len(rates), places.shape[1])), rates],
            ]
        )

    def edges(self, steps: int) -> Array:
        """Step ends over a period: the corners of the curves, and between them as many as make `steps` in all."""
        if self.constant.values is None:  # one length of steps for all
            return np.linspace(0.0, self.period, steps + 1)
        found = [np.array([0.0, self.period])]
        for line, spin in zip(self.lines, self.spin.T, strict=True):
            assert line.curve is not None
            rate = line.sense * line.ratio * self.speed
            begin = line.phase + line.sense * float(spin @ self.static)
            cycles = round(abs(rate) * self.period / line.curve.period)
            if cycles:
                nodes = (np.arange(-1, cycles + 1)[:, None] * line.curve.period + line.curve.nodes[:-1]).ravel()
                found.append(((nodes - begin) / rate) % self.period)
        corners = np.sort(np.concatenate(found))
        corners = corners[np.append(np.diff(corners) > SAME * self.period, True)]
        corners[0], corners[-1] = 0.0, self.period
        parts = [
            np.linspace(a, b, math.ceil((b - a) * steps / self.period) + 1)[:-1] for a, b in itertools.pairwise(corners)
        ]
        return np.append(np.concatenate(parts), self.period)

    def round(self, edges: Array, state: Array) -> tuple[Array, Array]:
        """State after a period, and the strengths of the linearised forces at the kicks on the way."""
        n, m, s = len(self.static), len(self.lines), len(self.polar)
        times = kick_times(edges)
        strengths = np.zeros((*times.shape, m + 2 * s, 2 * m + 3 * s))
        constant, directions = self.constant, self.directions
        into = constant.into @ np.vstack([np.zeros_like(directions), directions])
        push = constant.into @ np.concatenate([np.zeros(n), self.rest])
        rows = (self.reads.T / np.concatenate([constant.scale, np.ones(n)])) @ constant.out
        base = np.concatenate([self.approach.T @ self.static, self.spin.T @ self.static, np.zeros(3 * s)])
        across = np.hstack(self.tilts).T @ directions
        turns = np.array([x.sense * x.ratio * self.speed for x in self.lines])
        senses, phases, means = (np.array([getattr(x, k) for x in self.lines]) for k in ("sense", "phase", "mean"))
        meshes, shafts = np.arange(m), np.arange(s)

        def kick(step: int, stage: int, length: float, x: ComplexArray) -> None:
            read = base + (rows @ x[:, 0]).real
            delta, turned = read[:m], read[m : 2 * m]
            found = [
                line.curve(phase)  # type: ignore[misc]
                for line, phase in zip(self.lines, turns * times[step, stage] + senses * turned + phases, strict=True)
            ]
            k = np.array([float(f.value) for f in found]) - means
            slope = np.array([float(f.slope) for f in found])
            force = np.zeros(m + 2 * s)
            force[:m] = -k * delta
            C = strengths[step, stage]
            C[meshes, meshes] = -k
            C[meshes, m + meshes] = -senses * slope * delta
            one, two, spin = (read[2 * m :] + 0.5 * length * (across @ force)).reshape(
                3, s
            )  # in the middle of the kick
            force[m : m + s], force[m + s :] = -self.polar * spin * two, self.polar * spin * one
            C[m + shafts, 2 * m + s + shafts] = -self.polar * spin
            C[m + shafts, 2 * m + 2 * s + shafts] = -self.polar * two
            C[m + s + shafts, 2 * m + shafts] = self.polar * spin
            C[m + s + shafts, 2 * m + 2 * s + shafts] = self.polar * one
            x[:, 0] += length * (into @ force + push)

        return walk(constant, edges, state[:, None], kick)[:, 0], strengths

    def matrix(self, steps: int) -> Array | None:
        """Monodromy matrix of the orbit with so many steps; None where no orbit is found."""
        edges = self.edges(steps)
        found = None
        for _ in range(MOST_TRIES):
            after, strengths = self.round(edges, self.state)
            gap = after - self.state
            if not np.isfinite(gap).all():
                self.state = np.zeros_like(self.state)
                return None
            static = self.constant.scale * self.static
            size = max(float(np.abs(x).max(initial=0.0)) for x in (self.state, static))
            if np.abs(gap).max(initial=0.0) <= CLOSED * size:
                return monodromy(self.constant, edges, self.directions, self.reads, strengths)
            if found is None:
                found = monodromy(self.constant, edges, self.directions, self.reads, strengths)
                if not np.isfinite(found).all():
                    return None
                back = np.linalg.pinv(found - np.eye(len(found)), rcond=1e-12)
            self.state = self.state - back @ gap
        return None
