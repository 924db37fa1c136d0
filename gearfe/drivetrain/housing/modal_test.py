r"""Modes of a test, or of another model, beside those of a housing.

The modal assurance criterion of two shapes over the same points and directions (Allemang, R. J., & Brown, D. L., "A
correlation coefficient for modal vector analysis", Proc. 1st IMAC, 1982):

.. math:: \mathrm{MAC} = |\varphi^H\psi|^2 / ((\varphi^H\varphi)\,(\psi^H\psi)),

1 where they are the same up to a factor, 0 where they are at right angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.files import csv_records, read_text
from ...base.typing import Array, IntArray
from ...fem.reduction.modal_body import ModalBody
from ...output.exchange.universal import NORMAL, Mode, read_shapes

#: Columns of a table of shapes: a row for each mode and measured direction.
COLUMNS = ("frequency_Hz", "x_mm", "y_mm", "z_mm", "direction_x", "direction_y", "direction_z", "amplitude")
#: Distance of a measured point to the nearest node, in parts of the body's size, beyond which it is somewhere else.
APART = 0.05
#: Amplitude that no shape has, whatever its scale.
HUGE = 1e100
#: Points that are taken of another model.
SAMPLED = 2000


@dataclass(frozen=True)
class TestModes:
    """Modes at measured points.

    Attributes
    ----------
    frequencies, damping : ndarray, shape (m,)
        Hz, and modal damping ratio (-), NaN where none was measured.
    points, directions : ndarray, shape (d, 3)
        Place (m) and unit direction of each measured degree of freedom.
    shapes : ndarray, shape (m, d)
        Amplitudes, of any scale; real or complex.
    """

    __test__ = False  # no test of pytest's

    frequencies: Array
    damping: Array
    points: Array
    directions: Array
    shapes: Any


@dataclass(frozen=True)
class Comparison:
    """Modes of a body beside those of a test.

    Attributes
    ----------
    test
        The test.
    numbers : ndarray, shape (k,)
        Modes of the body that move, from 0.
    frequencies : ndarray, shape (k,)
        Theirs (Hz).
    shapes : ndarray, shape (k, d)
        Their amplitudes at the measured points, along the measured directions.
    mac : ndarray, shape (m, k)
        Modal assurance criterion of test and body.
    pairs : ndarray, shape (m,)
        For each mode of the test the place in `numbers` of its mode, -1 where none is left: the sum of the criteria is
        largest.
    distance
        Largest distance of a measured point to the node that was taken for it (m).
    """

    test: TestModes
    numbers: IntArray
    frequencies: Array
    shapes: Array
    mac: Array
    pairs: IntArray
    distance: float

    def columns(self) -> dict[str, Any]:
        """Table: a row for each mode of the test."""
        there = self.pairs >= 0
        mine = np.where(there, self.frequencies[self.pairs], math.nan)
        return {
            "test_mode": np.arange(1, len(self.pairs) + 1),
            "test_frequency_Hz": self.test.frequencies,
            "test_damping_ratio": self.test.damping,
            "mode": np.where(there, self.numbers[self.pairs] + 1, 0),
            "frequency_Hz": mine,
            "frequency_difference_percent": 100.0 * (mine / self.test.frequencies - 1.0),
            "mac": np.where(there, self.mac[np.arange(len(self.pairs)), self.pairs], math.nan),
        }

    def damping_ratios(self) -> list[float]:
        """Measured damping of the body's modes from the first one on, for ``[housing.damping] ratio``.

        Modes without a partner have that of the one below; those below the first partner that of this one. Empty where
        nothing was measured.
        """
        known = {
            int(self.numbers[pair]): float(ratio)
            for pair, ratio in zip(self.pairs, self.test.damping, strict=True)
            if pair >= 0 and math.isfinite(ratio)
        }
        if not known:
            return []
        made = [known[min(known)]]
        for number in range(max(known) + 1):
            made.append(known.get(number, made[-1]))
        return made[1:]


def compare(body: ModalBody, test: TestModes, modes: int = 20) -> Comparison:
    """The first `modes` modes of a body that move, beside those of a test.

    Raises
    ------
    InputError
        Where a measured point is nowhere near the body.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial import cKDTree

    hz = body.coupled.frequencies_hz
    numbers = np.flatnonzero(hz > 0.0)[:modes]
    tree = cKDTree(body.nodes)
    nearest, place = tree.query(test.points)
    size = float(np.linalg.norm(np.ptp(body.nodes, axis=0)))
    if nearest.max() > APART * size:
        far = int(nearest.argmax())
        coordinates = ", ".join(f"{1e3 * x:.4g}" for x in test.points[far])
        problem = f"the measured point ({coordinates}) mm is {1e3 * nearest[far]:.4g} mm from the nearest node"
        cure = "coordinates of test and housing must be the same, in the units that the file states"
        for factor, unit in {1e-3: "a thousandth", 1e-2: "a hundredth", 25.4e-3: "0.0254", 1e3: "a thousand"}.items():
            if tree.query(factor * test.points)[0].max() <= APART * size:
                cure = f"times {unit} all points fit: correct the unit (universal files: dataset 164; without it, m)"
        raise InputError("--compare", None, problem, cure)
    fields = body.reconstruct(body.coupled.vectors[:, numbers].T)[:, place]
    shapes = np.einsum("kdj,dj->kd", fields, test.directions)
    mac = mac_table(test.shapes, shapes)
    rows, found = linear_sum_assignment(-mac)
    pairs = np.full(len(test.shapes), -1)
    pairs[rows] = found
    return Comparison(test, numbers, hz[numbers], shapes, mac, pairs, float(nearest.max()))


def mac_table(one: Any, other: Any) -> Array:
    """Modal assurance criterion of shapes (m, d) and (k, d), shape (m, k)."""
    cross = np.abs(one.conj() @ other.T) ** 2
    sizes = np.outer(np.sum(np.abs(one) ** 2, axis=1), np.sum(np.abs(other) ** 2, axis=1))
    return np.asarray(np.divide(cross, sizes, out=np.zeros_like(cross), where=sizes > 0.0))


def read_modes(path: str | Path) -> TestModes:
    """Modes of a file: a table (.csv, see `COLUMNS`), a universal file (.uff, .unv), or a reduced body (.npz).

    Raises
    ------
    InputError
        For a file that holds none.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        modes = _of_table(Path(path))
    elif suffix in (".uff", ".unv"):
        modes = _of_universal(Path(path))
    elif suffix == ".npz":
        modes = _of_body(ModalBody.load(path))
    else:
        raise InputError("--compare", str(path), "must end in .csv, .uff, .unv or .npz", "see docs/modal_test.md")
    return _checked(modes, path)


def _checked(modes: TestModes, path: str | Path) -> TestModes:
    """The modes, if their numbers are finite and their frequencies above zero."""
    cure = "the file may be damaged: write it again"
    if not (np.isfinite(modes.frequencies).all() and (modes.frequencies > 0.0).all()):
        wrong = modes.frequencies[~(np.isfinite(modes.frequencies) & (modes.frequencies > 0.0))][0]
        raise InputError("--compare", str(path), f"has a mode at {wrong:.6g} Hz; it must be above zero", cure)
    for name in ("points", "directions", "shapes"):
        if not np.isfinite(getattr(modes, name)).all():
            raise InputError("--compare", str(path), f"has {name} with numbers that are not finite", cure)
    if modes.shapes.size == 0 or not np.abs(modes.shapes).max() < HUGE:
        raise InputError("--compare", str(path), "has no amplitudes, or larger ones than a shape has", cure)
    return modes


def _of_body(body: ModalBody) -> TestModes:
    """Modes of another model that move, below the highest that it keeps, at nodes spread over it."""
    hz = body.coupled.frequencies_hz
    chosen = np.flatnonzero((hz > 0.0) & (hz <= (body.highest_hz or math.inf)))
    step = max(1, len(body.nodes) // SAMPLED)
    fields = body.reconstruct(body.coupled.vectors[:, chosen].T)[:, ::step]
    points = np.repeat(body.nodes[::step], 3, axis=0)
    directions = np.tile(np.eye(3), (len(points) // 3, 1))
    unknown = np.full(len(chosen), math.nan)
    return TestModes(hz[chosen], unknown, points, directions, fields.reshape(len(chosen), -1))


def _of_table(path: Path) -> TestModes:
    rows = csv_records(read_text(path, "--compare"), path, "--compare")
    missing = [name for name in COLUMNS if not rows or name not in rows[0]]
    if missing:
        problem = f"lacks the columns {', '.join(missing)}"
        raise InputError("--compare", str(path), problem, "a row for each mode and measured direction")
    try:
        table = {name: np.array([float(row[name]) for row in rows]) for name in COLUMNS}
        more = {n: np.array([float(row.get(n) or "nan") for row in rows]) for n in ("damping_ratio", "amplitude_imag")}
    except (TypeError, ValueError) as error:
        raise InputError("--compare", str(path), f"holds a cell that is no number ({error})", "correct it") from None
    hz, first, which = np.unique(table["frequency_Hz"], return_index=True, return_inverse=True)
    counts = np.bincount(which)
    if len(set(counts.tolist())) > 1:
        problem = f"has {counts.min()} rows for one frequency and {counts.max()} for another"
        raise InputError("--compare", str(path), problem, "all modes at the same points and directions")
    order = np.lexsort((np.arange(len(rows)), which)).reshape(len(hz), -1)
    places = np.column_stack([table[name] for name in COLUMNS[1:7]])
    if not all(np.allclose(places[one], places[order[0]], rtol=0, atol=1e-6) for one in order):
        problem = "has other points, or another order of them, in one mode than in another"
        raise InputError("--compare", str(path), problem, "write all modes alike")
    directions = places[order[0], 3:]
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    if not (lengths > 0.0).all():
        raise InputError("--compare", str(path), "has a direction of no length", "as 0, 0, 1")
    amplitudes = table["amplitude"] + 1j * np.nan_to_num(more["amplitude_imag"])
    return TestModes(
        hz, more["damping_ratio"][first], 1e-3 * places[order[0], :3], directions / lengths, amplitudes[order]
    )


def _of_universal(path: Path) -> TestModes:
    """Modes of a universal file, normal or complex."""
    shapes = read_shapes(path, "--compare")
    nodes, modes = shapes.nodes, shapes.modes
    if not modes or not nodes:
        problem = f"holds {len(modes)} modes (datasets 55) and {len(nodes)} nodes (datasets 15, 2411)"
        raise InputError("--compare", str(path), problem, "export mode shapes together with the geometry")
    numbers = modes[0].nodes
    if any(mode.nodes != numbers for mode in modes) or not set(numbers) <= set(nodes):
        problem = "has modes over other nodes than the first one, or nodes without a place"
        raise InputError("--compare", str(path), problem, "export all modes over the same nodes")
    values = np.array([mode.values.ravel() for mode in modes])
    points = np.repeat([nodes[n] for n in numbers], 3, axis=0)
    directions = np.tile(np.eye(3), (len(numbers), 1))
    measured = np.abs(values).max(axis=0) > 0.0  # directions that nobody measured are zeros in all modes
    hz, damping = np.array([_frequency(mode) for mode in modes]).T
    return TestModes(hz, damping, points[measured], directions[measured], values[:, measured])


def _frequency(mode: Mode) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio; NaN where none was measured."""
    if mode.analysis == NORMAL:
        hz, _, viscous, hysteretic = mode.numbers[:4].tolist()
        return hz, viscous or 0.5 * hysteretic or math.nan
    value = complex(*mode.numbers[:2])
    return abs(value) / (2.0 * math.pi), -value.real / abs(value) if value else math.nan
