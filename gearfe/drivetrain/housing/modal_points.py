r"""How each measured point of a modal test moves beside the model: points that are exchanged or reversed show there.

a are the shapes of a test and b those of its partners in the model, each scaled to the test's mode (least squares), and
all modes to one size. The amplitudes of a point over all modes and its directions agree by

.. math:: c = 1 - |a - b|^2 \,/\, (|a|^2 + |b|^2 + s^2),

That is 1 where the point moves as the model does, -1 where its sign is wrong, and about 0 where it belongs to another
point. s is the part `STILL` of the mean motion of a point, below which noise decides. Without s it is twice the real
part of a correlation over the modes, as in the coordinate modal assurance criterion (Lieven, N. A. J., & Ewins, D. J.,
"Spatial correlation of mode shapes, the coordinate modal assurance criterion", Proc. 6th IMAC, 1988), but with sign and
size.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.typing import Array, IntArray
from .modal_test import Comparison

#: Agreement below which a point is reported, and that from which another place explains it.
LOW, HIGH = 0.5, 0.85
#: Part of the mean motion of a point below which noise decides.
STILL = 0.2
#: Points that are reported at most.
LISTED = 6


def point_columns(made: Comparison) -> dict[str, Array]:
    """Table of the measured directions: point, place (mm), direction, agreement of the point."""
    point, own = _points(made), np.full(len(made.test.points), np.nan)
    for rows, value in zip(*_own(made), strict=True):
        own[rows] = value
    names = ("x", "y", "z")
    return {
        "point": point + 1,
        **{f"{n}_mm": 1e3 * made.test.points[:, i] for i, n in enumerate(names)},
        **{f"direction_{n}": made.test.directions[:, i] for i, n in enumerate(names)},
        "agreement": own,
    }


def point_lines(made: Comparison) -> list[str]:
    """Remarks on points that do not move as the model does: exchanged, reversed, elsewhere."""
    rows, own = _own(made)
    bad = [int(p) for p in np.flatnonzero(np.array(own) < LOW)] if (made.pairs >= 0).sum() > 1 else []
    names = {p: f"point {p + 1} ({', '.join(f'{1e3 * x:.4g}' for x in made.test.points[rows[p][0]])} mm)" for p in bad}
    lines, explained = [], {p for p in bad if own[p] <= -HIGH}
    lines += [f"{names[p]} moves against the model: its sensor the other way round?" for p in sorted(explained)]
    test, mine, still = _motions(made)
    for p in bad:
        for q in bad:
            one, two = (made.test.directions[rows[k]] for k in (p, q))
            if not (p < q and not explained & {p, q} and one.shape == two.shape and np.allclose(one, two)):
                continue
            if min(_agreement(test[:, rows[a]], mine[:, rows[b]], still) for a, b in ((p, q), (q, p))) >= HIGH:
                lines.append(f"{names[p]} and {names[q]} fit when they are exchanged")
                explained |= {p, q}
    left = [names[p] for p in bad if p not in explained]
    if left:
        more = f" and {len(left) - LISTED} more" if len(left) > LISTED else ""
        lines.append("other points that do not move as the model: " + "; ".join(left[:LISTED]) + more + " (points.csv)")
    return lines


def _points(made: Comparison) -> IntArray:
    """Number of the point of each measured direction, in the order of the file."""
    _, first, which = np.unique(made.test.points.round(9), axis=0, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[which.ravel()])


def _own(made: Comparison) -> tuple[list[IntArray], list[float]]:
    """Rows of each point, and its agreement."""
    point = _points(made)
    rows = [np.flatnonzero(point == p) for p in range(point.max() + 1)]
    test, mine, still = _motions(made)
    return rows, [_agreement(test[:, one], mine[:, one], still) for one in rows]


def _agreement(one: Any, other: Any, still: float) -> float:
    sizes = np.sum(np.abs(one) ** 2) + np.sum(np.abs(other) ** 2) + still**2
    return float(1.0 - np.sum(np.abs(one - other) ** 2) / sizes)


def _motions(made: Comparison) -> tuple[Any, Any, float]:
    """Shapes (m, d) of modes with a partner, of test and model, all of one size; the least motion that counts.

    The factors are those of the points that agree: wrong ones would draw them down.
    """
    there = made.pairs >= 0
    test = np.asarray(made.test.shapes)[there]
    test = test / np.maximum(np.linalg.norm(test, axis=1, keepdims=True), 1e-300)
    mine, point = made.shapes[made.pairs[there]], _points(made)
    still = STILL * float(np.sqrt(len(test) / (point.max() + 1)))
    scaled, rows = mine, np.arange(len(point))
    for _ in range(2):
        factor = np.sum(mine[:, rows].conj() * test[:, rows], axis=1) / np.maximum(
            np.sum(np.abs(mine[:, rows]) ** 2, axis=1), 1e-300
        )
        scaled = factor[:, None] * mine
        good = [
            p for p in range(point.max() + 1) if _agreement(test[:, point == p], scaled[:, point == p], still) > LOW
        ]
        rows = np.flatnonzero(np.isin(point, good)) if good else rows
    return test, scaled, still
