r"""Modes of the coupled train: frequencies over the speed (Campbell diagram), damping, where their energy is.

Meshes count with their mean stiffness, and with the damper that they are in steady running; gyroscopic moments make
frequencies follow the speed. Where the orders of the meshes meet a mode lies a critical speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.typing import Array
from .condensed import CondensedTrain

#: The meshes swing in a mode where so much of its strain energy is in them.
STRONG = 0.03


@dataclass(frozen=True, eq=False)
class CoupledModes:
    """Modes below a frequency, n of them, at s speeds.

    Attributes
    ----------
    names
        Where most of the strain energy of each mode is, and of what kind its motion is.
    speeds : (s,)
        Of the drive (rad/s).
    frequency, damping_ratio : (s, n)
        Hz, and parts of the critical damping.
    strain : (n, parts), kinetic : (n, 2)
        Shares of the energy of each mode at rest: strain in each of `strain_in`; motion of shafts and of the housing.
    strain_in
        Meshes by name, bearings and coupling of the drive, housing.
    """

    names: tuple[str, ...]
    speeds: Array
    frequency: Array
    damping_ratio: Array
    strain: Array
    kinetic: Array
    strain_in: tuple[str, ...]


def coupled_modes(train: CondensedTrain, speeds: Array, highest_hz: float) -> CoupledModes:
    """Modes with natural frequencies up to `highest_hz` at rest, followed over the speeds in the order of frequency."""
    model, linear = train.model, train.system.linear
    modal = model.modal
    count = count_below(train, highest_hz)
    damping = linear.damping.copy()
    for line in model.meshes:
        if line.in_contact:
            along = modal.T.T @ line.row
            damping += line.damping * np.outer(along, along)
    gyro = linear.tilts @ linear.gyroscopic @ linear.tilts.T
    n, rates = len(linear.squares), np.sqrt(linear.squares)
    found = []
    for speed in speeds:
        A = np.block([[np.zeros((n, n)), np.diag(rates)], [-np.diag(rates), speed * gyro - damping]])
        values = np.linalg.eigvals(A)
        values = values[values.imag > 0.0]
        values = values[np.argsort(np.abs(values), kind="stable")][:count]
        found.append(np.pad(values, (0, count - len(values)), constant_values=np.nan))
    poles = np.array(found).reshape(len(speeds), count)
    strain, kinetic, parts = _shares(train, count)
    names = tuple(_name(i, strain[i], kinetic[i], parts) for i in range(count))
    frequency = np.abs(poles) / (2.0 * math.pi)
    return CoupledModes(names, np.asarray(speeds), frequency, -poles.real / np.abs(poles), strain, kinetic, parts)


def modes_below(train: CondensedTrain, modes: CoupledModes, highest_hz: float) -> CoupledModes:
    """Those of the modes with natural frequencies up to `highest_hz` at rest."""
    count = count_below(train, highest_hz)
    strain, kinetic, parts = _shares(train, count)
    frequency, damping = modes.frequency[:, :count], modes.damping_ratio[:, :count]
    return CoupledModes(modes.names[:count], modes.speeds, frequency, damping, strain, kinetic, parts)


def count_below(train: CondensedTrain, highest_hz: float) -> int:
    """Number of modes with natural frequencies up to `highest_hz` at rest."""
    return int((train.model.modal.eigenvalues <= (2.0 * math.pi * highest_hz) ** 2).sum())


def _shares(train: CondensedTrain, count: int) -> tuple[Array, Array, tuple[str, ...]]:
    model = train.model
    modal, housing = model.modal, model.train.housing
    shapes = modal.T[:, :count]
    whole = np.maximum(modal.eigenvalues[:count], 1e-300)
    rows = [line.mean * (line.row @ shapes) ** 2 / whole for line in model.meshes]
    size = 0 if housing is None else housing.size
    body = np.zeros(count) if housing is None else _quadratic(housing.stiffness, shapes[:size]) / whole
    rows += [np.maximum(1.0 - sum(rows) - body, 0.0), body]
    moving = np.zeros(count) if housing is None else _quadratic(housing.mass, shapes[:size])
    kinetic = np.stack([1.0 - moving, moving], axis=1)
    return np.array(rows).T, kinetic, (*(line.name for line in model.meshes), "bearings and drive", "housing")


def _quadratic(matrix: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("ij,ik,kj->j", vectors, matrix, vectors, optimize=True))


def _name(number: int, strain: Array, kinetic: Array, parts: tuple[str, ...]) -> str:
    at = int(strain.argmax())
    moving = "shafts" if kinetic[0] > 0.5 else "housing"
    return f"mode {number + 1}: strain in {parts[at]} ({100.0 * strain[at]:.0f} %), {moving} moving"
