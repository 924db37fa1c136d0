"""Modes of a turning train with what they are: frequency, damping, sense of whirl, shares of energy, a label."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.shown import ShownTable
from ...base.typing import Array, ComplexArray, IntArray
from ..train.kinematics import drive_sense
from ..train.model import TrainModel
from .energies import BENDING, HOUSING, KINDS, MESH, Part, train_forms
from .follow import follow_modes
from .stages import stage_kinds
from .turning import turning_train

#: Orbits that are flatter are planar: the sense of whirl of an ellipse whose axes are as 1 to 40.
PLANAR = 0.05
#: Shafts whose bending has a smaller share of a mode's energy do not whirl in it.
STILL = 0.01
#: The meshes swing in a mode where so much of its strain energy is in them.
STRONG = 0.03
#: Modes that the prompt shows.
SHOWN = 4
#: Directions of whirl.
FORWARD, BACKWARD, PLANE, MIXED, NONE = "forward", "backward", "planar", "mixed", "none"
#: Label of a mode at a speed at which it does not swing.
OVERDAMPED = "overdamped"
#: Names of the kinds of motion in labels.
LABELS = {BENDING: "whirl", "torsion": "torsional", "axial": "axial", HOUSING: "housing"}


@dataclass(frozen=True, eq=False, repr=False)
class WhirlModes(ShownTable):
    """Modes of a train at s speeds, n of them, followed by their shapes; sorted at the slowest speed.

    Attributes
    ----------
    speeds : (s,)
        Of the drive (rad/s).
    frequency, damping_ratio : (s, n)
        Hz, and parts of the critical damping; NaN where a mode does not swing.
    slope : (s, n)
        Derivative of the frequency with the speed (Hz s/rad).
    parts
        Parts of the train that have energy.
    kinetic, strain : (s, n, parts)
        Mean energies, in parts of the mode's.
    whirl : (s, n, shafts)
        Sense of whirl of each shaft against its own spin: 1 forward in circles, -1 backward, 0 planar.
    whirl_weight : (s, n, shafts)
        What the orbits of each shaft weigh.
    shapes : (s, n, size)
        Coordinates of the system.
    shafts
        Names of the shafts.
    free
        Number of motions at rest that nothing holds, at 0 Hz; they are no modes of the table.
    stages : (s, n)
        What the modes of planetary stages are, see `gearfe.drivetrain.modes.stages`; empty texts for others.
    """

    speeds: Array
    frequency: Array
    damping_ratio: Array
    slope: Array
    parts: tuple[Part, ...]
    kinetic: Array
    strain: Array
    whirl: Array
    whirl_weight: Array
    shapes: ComplexArray
    shafts: tuple[str, ...]
    free: int
    stages: Array

    @property
    def shares(self) -> Array:
        """(s, n, parts) share of each part in the energy of a mode."""
        return self.kinetic + self.strain

    @property
    def fastest(self) -> int:
        """Number of the fastest speed, at which modes are named."""
        return int(np.argmax(np.abs(self.speeds)))

    def share(self, kind: str, name: str | None = None) -> Array:
        """(s, n) share of a kind of parts, or of the one of a shaft or mesh."""
        chosen = [i for i, part in enumerate(self.parts) if part.kind == kind and name in (None, part.name)]
        return np.asarray(self.shares[:, :, chosen].sum(axis=2))

    @cached_property
    def mesh_strain(self) -> Array:
        """(s, n, meshes) share of the strain energy in each mesh."""
        chosen = [i for i, part in enumerate(self.parts) if part.kind == MESH]
        whole = self.strain.sum(axis=2, keepdims=True)
        return np.divide(
            self.strain[:, :, chosen], whole, out=np.zeros_like(self.strain[:, :, chosen]), where=whole > 0.0
        )

    @cached_property
    def direction(self) -> list[list[str]]:
        """Direction of whirl of each mode at each speed: that of all orbits together, weighted by kinetic energy."""
        turned = (self.whirl * self.whirl_weight).sum(axis=2)
        apart, whole = (np.abs(self.whirl) * self.whirl_weight).sum(axis=2), self.whirl_weight.sum(axis=2)
        bends = self.share(BENDING)
        return [
            [_direction(*values) for values in zip(*rows, strict=True)]
            for rows in zip(turned, apart, whole, bends, strict=True)
        ]

    @cached_property
    def kinds(self) -> list[list[str]]:
        """Kind of motion of each mode at each speed: the one with the largest share, all shafts together."""
        kinds = [kind for kind in (*KINDS, HOUSING) if any(part.kind == kind for part in self.parts)]
        shares = np.array([self.share(kind) for kind in kinds])
        most = np.nan_to_num(shares).argmax(axis=0)
        return [[kinds[i] for i in row] for row in most]

    @cached_property
    def labels(self) -> list[list[str]]:
        """Label of each mode at each speed, such as ``forward whirl of shaft a`` or ``torsional, mesh a-b``."""
        return [[self._label(s, n) for n in range(self.frequency.shape[1])] for s in range(len(self.speeds))]

    @property
    def names(self) -> tuple[str, ...]:
        """Number and label of each mode at the fastest speed, with the shares of its energy."""
        row = self.fastest
        made = []
        for n, (label, kind) in enumerate(zip(self.labels[row], self.kinds[row], strict=True)):
            share, (motion, *mesh) = float(self.share(kind)[row, n]), label.split(", mesh ", 1)
            shares = [f"{motion} ({100.0 * share:.0f} %)"]
            shares += [f"mesh {name} ({100.0 * float(self.share(MESH, name)[row, n]):.0f} %)" for name in mesh]
            made.append(f"mode {n + 1}: " + ", ".join(shares))
        return tuple(made)

    def _label(self, row: int, mode: int) -> str:
        if not np.isfinite(self.frequency[row, mode]):
            return OVERDAMPED
        kind, direction = self.kinds[row][mode], self.direction[row][mode]
        label = self.stages[row, mode] or LABELS[kind]
        if kind == BENDING and not self.stages[row, mode]:
            shares = [float(self.share(BENDING, name)[row, mode]) for name in self.shafts]
            label = f"{direction} whirl of shaft {self.shafts[int(np.argmax(shares))]}"
        strained = self.mesh_strain[row, mode]
        if len(strained) and strained.sum() >= 0.5:
            names = [part.name for part in self.parts if part.kind == MESH]
            label += f", mesh {names[int(strained.argmax())]}"
        return label

    def facts(self) -> dict[str, str]:
        """Speeds and modes."""
        count = self.frequency.shape[1]
        lowest = [f"{label}, {hertz:.5g} Hz" for label, hertz in zip(self.labels[-1], self.frequency[-1], strict=True)]
        more = ["..."] if count > SHOWN else []
        return {
            "speeds": f"{len(self.speeds)}, {self.speeds[0]:.4g} to {self.speeds[-1]:.4g} rad/s",
            "free motions": str(self.free),
            "modes": f"{count}; at the last speed " + "; ".join([*lowest[:SHOWN], *more]),
        }

    def columns(self) -> dict[str, Any]:
        """The table modes.csv: each mode at each speed."""
        speeds, count = self.frequency.shape
        shares = self.shares
        made: dict[str, Any] = {
            "mode": np.repeat(np.arange(count) + 1, speeds),
            "speed_rad_per_s": np.tile(self.speeds, count),
            "frequency_Hz": self.frequency.T.ravel(),
            "damping_ratio": self.damping_ratio.T.ravel(),
            "direction": [self.direction[s][n] for n in range(count) for s in range(speeds)],
            "label": [self.labels[s][n] for n in range(count) for s in range(speeds)],
        }
        made |= {f"share_{'_'.join(part).strip('_')}": shares[:, :, i].T.ravel() for i, part in enumerate(self.parts)}
        made |= {f"whirl_{name}": self.whirl[:, :, i].T.ravel() for i, name in enumerate(self.shafts)}
        return made

    def at(self, speed: float) -> Array | None:
        """(n,) frequencies (Hz) at a speed (rad/s), by cubics between the speeds; None beyond them."""
        rising = np.argsort(self.speeds)
        x = self.speeds[rising]
        if not x[0] <= speed <= x[-1]:
            return None
        if len(x) == 1:
            return np.asarray(self.frequency[0])
        k = min(int(np.searchsorted(x, speed, side="right")) - 1, len(x) - 2)
        step, (one, two) = x[k + 1] - x[k], rising[k : k + 2]
        part = (speed - x[k]) / step
        ends = part**2 * (3.0 - 2.0 * part), part * (1.0 - part) ** 2 * step, part**2 * (part - 1.0) * step
        f, rate = self.frequency, self.slope
        return np.asarray(f[one] + ends[0] * (f[two] - f[one]) + ends[1] * rate[one] + ends[2] * rate[two])

    def below(self, highest_hz: float) -> WhirlModes:
        """Those that come below a frequency at some of the speeds."""
        return self.select(self.inside(highest_hz))

    def inside(self, highest_hz: float) -> IntArray:
        """Numbers, from 0, of the modes that come below a frequency at some of the speeds."""
        return np.flatnonzero((np.where(np.isnan(self.frequency), np.inf, self.frequency) <= highest_hz).any(axis=0))

    def select(self, numbers: IntArray) -> WhirlModes:
        """Modes of these numbers, from 0, in this order."""
        fields = (
            "frequency",
            "damping_ratio",
            "slope",
            "kinetic",
            "strain",
            "whirl",
            "whirl_weight",
            "shapes",
            "stages",
        )
        return replace(self, **{name: getattr(self, name)[:, numbers] for name in fields})


def train_modes(model: TrainModel, speeds: ArrayLike, highest_hz: float = 5000.0) -> WhirlModes:
    """Find the modes of a train with the mean stiffness of its meshes, with gyroscopic moments and damping.

    With carriers that turn in an elastic housing the train changes as they turn. Its modes are those with the carriers
    where they are at the start, seen from axes that stand still.

    Parameters
    ----------
    model : TrainModel
        From `gearfe.drivetrain.train.build_train`.
    speeds : array_like, shape (s,)
        Of the drive (rad/s), rising or falling in size, of one sense; 0 is the limit of slow turning.
    highest_hz : float
        Highest frequency (Hz): modes that lie below it at some speed are returned.

    Raises
    ------
    InputError
        For speeds that change sign, are not sorted, or turn against the drive of the model, and for a train that
        cannot vibrate.
    """
    given = _checked(model, speeds)
    sense = float(np.sign(given[np.argmax(np.abs(given))])) or drive_sense(model.train.driven.speed) or 1.0
    forms = train_forms(model, sense)
    turning = turning_train(model, forms.weights())
    tracks = follow_modes(turning, given, highest_hz)
    count = tracks.values.shape[1]
    kinetic, strain, whirl, weight, shapes = (list[Array]() for _ in range(5))
    for values, vectors in zip(tracks.values, tracks.vectors, strict=True):
        y, rate = turning.coordinates(np.nan_to_num(values), np.nan_to_num(vectors))
        for found, made in zip((kinetic, strain), forms.shares(y, rate), strict=True):
            found.append(made)
        for found, made in zip((whirl, weight), forms.whirl(rate), strict=True):
            found.append(made)
        shapes.append((model.modal.T @ y).T)
    size, whole = np.abs(tracks.values), np.array(shapes).reshape(len(given), count, model.system.size)
    slope = (tracks.values.conj() * tracks.slopes).real / size
    return WhirlModes(
        speeds=given,
        frequency=size / (2.0 * math.pi),
        damping_ratio=-tracks.values.real / size,
        slope=slope / (2.0 * math.pi),
        parts=forms.parts,
        kinetic=np.array(kinetic).reshape(len(given), count, len(forms.parts)),
        strain=np.array(strain).reshape(len(given), count, len(forms.parts)),
        whirl=np.array(whirl).reshape(len(given), count, len(forms.orbits)),
        whirl_weight=np.array(weight).reshape(len(given), count, len(forms.orbits)),
        shapes=whole,
        shafts=tuple(shaft.name for shaft in model.train.shafts),
        free=turning.free,
        stages=stage_kinds(model, whole),
    )


def _direction(turned: float, apart: float, whole: float, bends: float) -> str:
    """Direction of orbits that turn by so much in all and each by itself, of so much weight and share of energy."""
    if not whole > 0.0 or bends < STILL:
        return NONE
    if abs(turned) > PLANAR * whole:
        return FORWARD if turned > 0.0 else BACKWARD
    return MIXED if apart > PLANAR * whole else PLANE


def _checked(model: TrainModel, speeds: ArrayLike | Sequence[float]) -> Array:
    given = np.atleast_1d(np.asarray(speeds, dtype=float))
    if not len(given) or not np.isfinite(given).all() or given.min() * given.max() < 0.0:
        shown = f"{given.min():.6g} to {given.max():.6g}" if len(given) else "none"
        raise InputError("speeds", None, f"change sign or are not finite: {shown} rad/s", "ask for speeds of one sense")
    sizes = np.diff(np.abs(given))
    if not ((sizes > 0.0).all() or (sizes < 0.0).all()):
        raise InputError("speeds", None, "do not rise or fall all the way", "sort them, each once")
    fastest = float(given[np.argmax(np.abs(given))])
    if drive_sense(model.train.driven.speed) * fastest < 0.0:
        problem = "turns against the drive of the model, whose driving flanks are others"
        raise InputError("speeds", fastest, problem, "build the model with a drive of this sense")
    if not len(model.modal.eigenvalues):
        problem = "cannot vibrate: rigid meshes and bearings in a rigid housing follow the drive"
        raise InputError("train", None, problem, "give a mesh or a bearing a stiffness, or take an elastic housing")
    return given
