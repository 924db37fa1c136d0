"""Dense output of the implicit method for systems with flexible links: through the stages of its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..typing import Array
from .dense import Polynomials

#: Stages of Radau IIA of order 5 on 0..1.
C = np.array([(4 - math.sqrt(6.0)) / 10, (4 + math.sqrt(6.0)) / 10, 1.0])
_P = np.arange(6.0)
#: Coefficients of powers of x from (q, q') at 0, q at the first two stages, (q, q') at 1.
QUINTIC = np.linalg.inv(np.array([_P == 0, _P == 1, C[0] ** _P, C[1] ** _P, np.ones(6), _P], dtype=float))
#: Share of each in the middle of the step.
MIDDLE = 0.5**_P @ QUINTIC
#: Coefficients from values at the stages.
PARABOLA = np.linalg.inv(np.vander(C, increasing=True))


@dataclass(frozen=True)
class Collocated(Polynomials):
    """Dense output through the stages; `forces`: multipliers of all rows, then stresses of the elements that have some.

    Both are unknowns of the stages. From the coordinates between them they would be as far off as the stiffness times
    the error of a strain, which is that of the coordinates.
    """

    forces: Polynomials | None = None


def collocated(times: Array, q: Array, v: Array, stages: Array, forces: Array) -> Collocated:
    """Polynomials of degree 5 through the stages of every step and the coordinates and velocities of its ends.

    Shapes (steps + 1,), (steps + 1, size) twice, (steps, 2, size) of the first two stages, (steps, 3, n).
    """
    h = np.diff(times)[:, None]
    known = np.stack([q[:-1], h * v[:-1], stages[:, 0], stages[:, 1], q[1:], h * v[1:]])
    scaled = np.einsum("jk,ksn->sjn", QUINTIC, known)
    parabolas = np.einsum("jk,skn->sjn", PARABOLA, forces) / h[:, :, None] ** np.arange(3)[:, None]
    coefficients = scaled / h[:, :, None] ** np.arange(6)[:, None]
    return Collocated(times, coefficients, forces=Polynomials(times, parabolas))
