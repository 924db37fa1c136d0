r"""A random elastic body that is its own mirror image: what a symmetric train stands in.

With the mirror at y = 0, attachment i at (x, y, z) has its image i' at (x, -y, z), and coordinates reflect as

.. math::
    (P q)_{i'} = \mathrm{diag}(1, -1, 1, -1, 1, -1)\, q_i

(a rotation is an axial vector), while an internal coordinate keeps its sign or turns it. Any K becomes symmetric as
``(K + P K P) / 2``, and stays positive definite. No mesh does that: those of the mesher are not symmetric.
"""

from __future__ import annotations

import math

import numpy as np

from gearfe.base.typing import Array
from gearfe.fem.reduction.modal_body import ModalBody

from .pairs import log_uniform

#: Internal coordinates, and the lever (m) between a random body's translations and rotations.
INTERNAL, LEVER = 4, 0.05


def mirror(points: Array, internal: Array) -> Array:
    """Matrix P of the reflection at y = 0: attachments at `points` (a, 3), then internal coordinates of given signs."""
    a = len(points)
    made = np.zeros((6 * a + len(internal), 6 * a + len(internal)))
    for i, point in enumerate(points):
        image = int(np.argmin(np.linalg.norm(points - point * [1.0, -1.0, 1.0], axis=1)))
        made[6 * image : 6 * image + 6, 6 * i : 6 * i + 6] = np.diag([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    made[6 * a :, 6 * a :] = np.diag(internal)
    return made


def symmetric_frame(random: np.random.Generator, names: tuple[str, ...], points: Array) -> tuple[ModalBody, Array]:
    """A held body with these attachments that is its own mirror image, every coordinate coupled; and its mirror P."""
    a = len(points)
    m, n = 6 * a, 6 * a + INTERNAL
    signs = random.choice([-1.0, 1.0], INTERNAL)
    own_hz = np.sort([log_uniform(random, 500.0, 10_000.0) for _ in range(INTERNAL)])
    size = np.tile([1.0, 1.0, 1.0, LEVER, LEVER, LEVER], a)
    stiffness, mass = np.zeros((n, n)), np.eye(n)
    stiffness[:m, :m] = log_uniform(random, 1e7, 1e9) * _positive(random, size)
    stiffness[m:, m:] = np.diag((2.0 * math.pi * own_hz) ** 2)
    weight = log_uniform(random, 0.05, 2.0)
    coupling = 0.3 * math.sqrt(weight) * size[:, None] * random.normal(size=(m, INTERNAL))
    mass[:m, m:], mass[m:, :m] = coupling, coupling.T
    mass[:m, :m] = weight * _positive(random, size) + coupling @ coupling.T
    reflect = mirror(points, signs)
    stiffness, mass = (0.5 * (x + reflect @ x @ reflect) for x in (stiffness, mass))
    body = ModalBody(
        mass=mass, damping=np.zeros((n, n)), stiffness=stiffness, attachment_names=names, attachment_points=points,
        attachment_axes=np.tile([0.0, 1.0, 0.0], (a, 1)), internal_hz=own_hz, modes=INTERNAL, nodes=points,
        elements=np.zeros((0, 4), dtype=np.int64), shapes=np.zeros((3 * a, n)), faces=np.zeros((0, 3), dtype=np.int64),
        normals=np.zeros((a, 3)), radiation=np.zeros((n, n)), momentum=np.zeros((6, n)), rigid_mass=np.eye(6),
        truncation=np.zeros((m, m)), corrections=1, next_hz=math.inf,
        softening=np.zeros((n, n)), held=True,
    )  # fmt: skip
    return body.with_damping(ratio=float(random.choice([0.0, 0.01, 0.05]))), reflect


def _positive(random: np.random.Generator, size: Array) -> Array:
    """A full positive definite matrix whose rows and columns are scaled by `size`; eigenvalues before that 0.3 to 4."""
    g = random.normal(size=(len(size), len(size)))
    return np.asarray((g @ g.T / len(size) + 0.3 * np.eye(len(size))) * np.outer(size, size))
