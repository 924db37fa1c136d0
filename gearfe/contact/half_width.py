r"""Half width of a contact from its pressure's second moment, and what pressure Hertz's contact of that width has.

Contact points show the largest pressure of a finite-element contact badly: where the two surfaces' edges do not match,
it oscillates from point to point by some per cent on every mesh, and under a sharp edge it has no bound. Force and
second moment of the pressure converge. Hertz's elliptic pressure has the variance :math:`b^2/4` about its mean, so that

.. math:: b = 2\sqrt{\operatorname{var}_p(x)}, \qquad \hat p = \frac{2 F}{\pi b w}

are its half width and its peak (Johnson, *Contact Mechanics*, 1985, eq. 4.43 to 4.45); any other contact with the same
force and the same variance gets a finite figure that no mesh decides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def half_widths(pair: NDArray[np.int64], place: Array, load: Array, count: int) -> Array:
    """Half widths b (m) of `count` contacts, shape (count,); not-a-number for a contact without load.

    Parameters
    ----------
    pair : ndarray, shape (q,)
        Contact that each point belongs to.
    place : ndarray, shape (q, 2)
        Its place (m): the contact is nearly straight, so the largest principal variance is that along it.
    load : ndarray, shape (q,)
        Pressure times area (N), >= 0.
    """

    def mean(values: Array) -> Array:
        return np.bincount(pair, load * values, count) / total

    total = np.bincount(pair, load, count)
    total = np.where(total > 0, total, np.nan)
    x, y = place[:, 0], place[:, 1]
    x, y = x - mean(x)[pair], y - mean(y)[pair]
    xx, yy, xy = mean(x * x), mean(y * y), mean(x * y)
    largest = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
    return np.asarray(2.0 * np.sqrt(largest))
