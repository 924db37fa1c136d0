"""Pictures of a run-up from its results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import unknown_name
from ..figures.runup import (
    OrderLine,
    Pieces,
    campbell_figure,
    curves_figure,
    instability_figure,
    waterfall_figure,
)
from ..typing import Array
from .instability import InstabilityMap
from .modes import CoupledModes, Crossing
from .report import dynamic_factors, orders
from .results import SteadyState
from .run_up import RunUp

#: A mode is drawn strong where so much of its strain energy is in the meshes.
STRONG = 0.03
#: Reference of the levels of accelerations (m/s2), ISO 1683.
REFERENCE = 1e-6


def attachment_to_draw(run: RunUp, asked: str | None) -> int:
    """Number of the attachment in the pictures: the asked one, else the bore that carries the load's reaction."""
    names = run.train.model.bores
    if asked is not None:
        if asked not in names:
            raise unknown_name("--attachment", asked, names)
        return names.index(asked)
    loaded = [load.bore for load in run.train.model.scene.loads if load.bore in names]
    return names.index(loaded[0]) if loaded and loaded[0] is not None else len(names) - 1


def draw_waterfall(path: Path, run: RunUp, multiples: int, bore: int, title: str) -> None:
    """Spectra of one attachment over the speed, of a slow run-up."""
    swept = sorted(run.sweep(), key=lambda s: s.speed)
    lines = max(int((s.frequency <= run.band_hz).sum()) for s in swept)
    frequency, level = np.full((len(swept), lines), np.nan), np.full((len(swept), lines), np.nan)
    for row, s in enumerate(swept):
        count = int((s.frequency <= run.band_hz).sum())
        frequency[row, :count] = 1e-3 * s.frequency[:count]
        size = np.maximum(np.abs(s.acceleration[:count, bore]), 1e-12)
        level[row, :count] = 20.0 * np.log10(size / math.sqrt(2.0) / REFERENCE)
    name = run.train.model.bores[bore]
    waterfall_figure(
        path, title=f"Normal acceleration at attachment {name} in steady running\n{title}",
        speed=np.array([s.speed for s in swept]), frequency=frequency, level=level, lines=order_lines(run, multiples),
        quantity="level of the acceleration  (dB re 1 µm/s²)", highest=1e-3 * run.band_hz,
    )  # fmt: skip


def draw_campbell(path: Path, run: RunUp, modes: CoupledModes, met: list[Crossing], multiples: int, title: str) -> None:
    """Natural frequencies and mesh orders."""
    strong = modes.strain[:, : len(run.train.model.meshes)].sum(axis=1) >= STRONG
    rising = np.argsort(modes.speeds)
    marked = [(c.speed, 1e-3 * c.frequency) for c in met if strong[c.mode]]
    names = [f"{i + 1}: {100.0 * s:.0f} % in meshes" if on else "" for i, (s, on) in enumerate(
        zip(modes.strain[:, : len(run.train.model.meshes)].sum(axis=1), strong, strict=True))]  # fmt: skip
    campbell_figure(
        path, title=f"Natural frequencies of the coupled train and orders of its meshes\n{title}",
        speed=modes.speeds[rising], frequency=1e-3 * modes.frequency[rising], damping=modes.damping_ratio[rising[-1]],
        names=names, lines=order_lines(run, multiples), crossings=marked, highest=1e-3 * run.band_hz,
    )  # fmt: skip


def draw_orders(path: Path, run: RunUp, multiples: int, bore: int, title: str) -> None:
    """Order cuts of one attachment and its rms, on all branches."""
    cut = orders(run, multiples)
    size: dict[str, Pieces] = {}
    for k, names in cut.items():
        values = [_line(s, k, bore) for s in run.states]
        size[f"{k / run.train.system.turns:.4g} ({names[0]})"] = _pieces(run, values)
    top = {name: float(np.nanmax(np.where(p.branch % 2 == 0, p.value, np.nan))) for name, p in size.items()}
    loudest = sorted(size, key=lambda name: -top[name])[:4]
    name = run.train.model.bores[bore]
    rms = {f"rms below {1e-3 * run.band_hz:g} kHz": _pieces(run, [s.rms(run.band_hz)[bore] for s in run.states])}
    curves_figure(
        path, title=f"Normal acceleration at attachment {name}: orders of the drive, and rms\n{title}",
        panels=[("amplitude  (m/s²)", {n: size[n] for n in size if n in loudest}), ("rms  (m/s²)", rms)],
        turns=run.turning_speeds.tolist(), logarithmic=True,
    )  # fmt: skip


def draw_forces(path: Path, run: RunUp, title: str) -> None:
    """Dynamic transmission error, dynamic factor, and share without contact of all meshes."""
    lines = run.train.model.meshes
    states = run.states
    error, factor, open_ = {}, {}, {}
    for i, line in enumerate(lines):
        error[f"mesh {i + 1} ({line.name})"] = _pieces(run, [1e6 * np.ptp(s.transmission_error[:, i]) for s in states])
        factor[f"mesh {i + 1}"] = _pieces(run, dynamic_factors(run, i))
        open_[f"mesh {i + 1}"] = _pieces(run, [100.0 * s.apart[i] for s in states])
    panels = [
        ("dynamic transmission error,\npeak to peak  (µm)", error),
        ("dynamic factor $K_v$", factor),
    ]
    if max(float(p.value.max()) for p in open_.values()) > 0.0:
        panels.append(("without contact  (% of the time)", open_))
    curves_figure(path, title=f"Meshes in steady running\n{title}", panels=panels, turns=run.turning_speeds.tolist())


def draw_instability(path: Path, made: InstabilityMap, title: str) -> None:
    """Growth without damping over speed and load."""
    instability_figure(
        path,
        title=f"Parametric instability without damping\n{title}",
        speed=made.speeds,
        load=made.loads,
        growth=np.maximum(made.growth, 0.0),
    )


def order_lines(run: RunUp, multiples: int) -> list[OrderLine]:
    """Lines of the meshes' orders, one for those that agree."""
    made = []
    for k, names in orders(run, multiples).items():
        slope = 1e-3 * k / run.train.system.turns / (2.0 * math.pi)
        made.append(OrderLine(names[0].replace(" x mesh ", "×m"), slope, int(names[0].rsplit(" ", 1)[1]) - 1))
    return made


def _line(state: SteadyState, harmonic: int, bore: int) -> float:
    return float(np.abs(state.acceleration[harmonic, bore])) if harmonic < len(state.order) else math.nan


def _pieces(run: RunUp, values: Sequence[float] | Array) -> Pieces:
    speed = np.array([s.speed for s in run.states])
    branch = np.array([s.branch for s in run.states], dtype=np.int64)
    stable = np.array([s.branch % 2 == 0 if s.stable is None else s.stable for s in run.states])
    return Pieces(speed, np.asarray(values, dtype=float), branch, stable)
