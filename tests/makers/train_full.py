r"""The coupled transient with the full housing, the truth that a reduced one is held against.

Over [attachments | internal] coordinates of a housing, full (sparse) or reduced (dense), the hinges are eliminated
from the interface coordinates alone. Newmark's average acceleration with one factorisation of
:math:`A = M + \tfrac h2 C + \tfrac{h^2}4 K`, K with the mean mesh stiffnesses; what changes of them has the rank of
the number of meshes and enters by the formula of Sherman, Morrison and Woodbury. The phases are the nominal ones and
there are no gyroscopic moments, in both alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import null_space

from gearfe.drivetrain.train import TrainModel
from gearfe.fem.reduction.sparse_solver import factorize


def coupled_transient(
    model: TrainModel, mass: Any, stiffness: Any, *, beta: float, step: float, steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (s), contact forces (N) and axial accelerations of the bores (m/s2) with Rayleigh damping beta K.

    `mass` and `stiffness` are those of the housing over [attachments | internal], of any number of internal unknowns.
    """
    system, n = model.system, 6 * len(model.train.housing.attachment_names)  # type: ignore[union-attr]
    own = model.train.housing.size  # type: ignore[union-attr]
    outer = np.concatenate([np.arange(n), np.arange(own, system.size)])  # attachments and shafts
    N = null_space(system.jacobian(0.0, np.zeros(system.size))[:, outer])
    bores, shafts = sparse.csr_array(N[:n]), N[n:]
    inner = mass.shape[0] - n
    way = sparse.block_diag([bores, sparse.eye_array(inner)], format="csc")
    size = N.shape[1] + inner

    def onto(matrix: Any) -> Any:
        return sparse.csc_array(way.T @ sparse.csc_array(matrix) @ way)

    def top(matrix: np.ndarray) -> Any:
        full = sparse.lil_array((size, size))
        full[: N.shape[1], : N.shape[1]] = matrix
        return sparse.csc_array(full)

    W = np.zeros((size, len(model.meshes)))
    W[: N.shape[1]] = N.T @ np.array([line.row for line in model.meshes]).T[outer]
    means = np.array([line.mean for line in model.meshes])
    M = onto(mass) + top(shafts.T @ system.mass[own:, own:] @ shafts)
    K = onto(stiffness) + top((W * means)[: N.shape[1]] @ W[: N.shape[1]].T)
    C = beta * K
    load = np.zeros((size, len(model.torques)))
    load[: N.shape[1]] = N.T @ np.array([direction for direction, _ in model.torques]).T[outer]
    axial = np.zeros((len(model.bores), size))
    axial[:, : N.shape[1]] = model.axial[:, outer] @ N
    factor = factorize(sparse.csc_array(M + 0.5 * step * C + 0.25 * step**2 * K))
    Y = factor.solve(W)
    S = W.T @ Y
    times = step * np.arange(steps + 1)
    changes = np.array([line.stiffness(model.angle(times)) - line.mean for line in model.meshes]).T
    torques = np.array([function(times) for _, function in model.torques]).T
    u, v, a = np.zeros(size), np.zeros(size), np.zeros(size)
    forces, accelerations = np.zeros((steps + 1, len(means))), np.zeros((steps + 1, len(axial)))
    for i in range(1, steps + 1):
        free, rate = u + step * v + 0.25 * step**2 * a, v + 0.5 * step * a
        right = load @ torques[i] - C @ rate - K @ free - W @ (changes[i] * (W.T @ free))
        a = factor.solve(right)
        s = np.linalg.solve(np.eye(len(means)) + 0.25 * step**2 * S * changes[i], W.T @ a)
        a = a - 0.25 * step**2 * (Y @ (changes[i] * s))
        u, v = free + 0.25 * step**2 * a, rate + 0.5 * step * a
        forces[i] = (means + changes[i]) * (W.T @ u) + beta * means * (W.T @ v)
        accelerations[i] = axial @ a
    return times, forces, accelerations


def low_pass(signal: np.ndarray, step: float, highest: float) -> np.ndarray:
    """The part of a record below a frequency (Hz)."""
    lines = np.fft.rfft(signal, axis=0)
    lines[np.fft.rfftfreq(len(signal), step) > highest] = 0.0
    return np.fft.irfft(lines, len(signal), axis=0)
