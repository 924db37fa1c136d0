"""Pictures of a run-up's branches over the speed: order cuts, dynamic transmission error and factor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.typing import Array, IntArray
from ..drivetrain.runup.columns import dynamic_factors
from ..drivetrain.runup.critical import CriticalSpeeds
from ..drivetrain.runup.instability import InstabilityMap
from ..drivetrain.runup.orders import orders
from ..drivetrain.runup.report import iso_dynamic_factors
from ..drivetrain.runup.run_up import RunUp
from .campbell import bearing_signal, draw_campbell, draw_instability, draw_waterfall, signal_of
from .style import CYCLE, GREY, headed, new_figure, save, tidy

#: Label of the axis of dynamic factors.
FACTOR = "dynamic factor Kv"


@dataclass(frozen=True)
class RunUpPictures:
    """All pictures of a run-up, as `gearfe.drivetrain.runup.files.write_runup` takes them; they have the same title."""

    title: str

    def __call__(self, folder: Path, run: RunUp, critical: CriticalSpeeds, multiples: int, bore: int) -> None:
        """Draw into a folder; `bore` is the number of the attachment."""
        draw_waterfall(folder / "waterfall.png", run, signal_of(run, bore), self.title, multiples=multiples)
        forces = bearing_signal(run, bore)
        draw_waterfall(folder / "bearing_forces.png", run, forces, self.title, multiples=multiples, over_order=True)
        draw_campbell(folder / "campbell.png", critical.campbell, self.title)
        _draw_orders(folder / "orders.png", run, multiples, bore, self.title)
        save(forces_picture(run, self.title), folder / "meshes.png")

    def instability(self, path: Path, made: InstabilityMap) -> None:
        """The map of parametric instability."""
        draw_instability(path, made, self.title)


class BranchCurve(NamedTuple):
    """A curve over the speed on all branches: speeds (rad/s), values, whether each is stable."""

    speed: Array
    value: Array
    branch: IntArray
    stable: Array


def _draw_orders(path: Path, run: RunUp, multiples: int, bore: int, title: str) -> None:
    """Order cuts of a signal and its rms, on all branches."""
    signal, cut = signal_of(run, bore), orders(run, multiples)
    lines = [signal.lines(s) for s in run.states]
    size: dict[str, BranchCurve] = {}
    for one in cut:
        numbers = [s.numbers.get(one.waves) for s in run.states]
        values = [math.nan if k is None else float(x[k]) for k, x in zip(numbers, lines, strict=True)]
        size[f"{one.order:.4g} ({one.names[0]})"] = _branch_curve(run, values)
    top = {name: float(np.nanmax(np.where(p.branch % 2 == 0, p.value, np.nan))) for name, p in size.items()}
    loudest = sorted(size, key=lambda name: -top[name])[:4]
    inside = [(s.frequency > 0.0) & (s.frequency <= run.band_hz) for s in run.states]
    rms = [math.sqrt(0.5 * float((x[i] ** 2).sum())) for x, i in zip(lines, inside, strict=True)]
    panels = [
        (f"amplitude  ({signal.unit})", {n: size[n] for n in size if n in loudest}),
        (f"rms  ({signal.unit})", {f"rms below {1e-3 * run.band_hz:g} kHz": _branch_curve(run, rms)}),
    ]
    save(_curves(run, panels, f"{signal.name}: orders of the drive, and rms\n{title}", logarithmic=True), path)


def forces_picture(run: RunUp, title: str = "") -> Any:
    """Dynamic transmission error, dynamic factor, and share without contact of all meshes."""
    lines = run.train.model.meshes
    states = run.states
    error, factor, open_ = {}, {}, {}
    for i, line in enumerate(lines):
        error[f"mesh {i + 1} ({line.name})"] = _branch_curve(
            run, [1e6 * np.ptp(s.transmission_error[:, i]) for s in states]
        )
        factor[f"mesh {i + 1}"] = _branch_curve(run, dynamic_factors(run.train, run.states, i))
        open_[f"mesh {i + 1}"] = _branch_curve(run, [100.0 * s.apart[i] for s in states])
    panels = [
        ("dynamic transmission error,\npeak to peak  (µm)", error),
        (FACTOR, factor),
    ]
    if max(float(p.value.max()) for p in open_.values()) > 0.0:
        panels.append(("without contact  (% of the time)", open_))
    figure = _curves(run, panels, f"Meshes in steady running\n{title}")
    (axes,) = (axes for axes in figure.axes if axes.get_ylabel() == FACTOR)
    for i, colour in zip(range(len(lines)), CYCLE, strict=False):
        label = f"mesh {i + 1}, ISO 6336-1 B"
        axes.plot(run.speeds, iso_dynamic_factors(run, i), color=colour, linewidth=1.0, dashes=(1, 1.5), label=label)
    _legend_above(axes)
    return figure


def _curves(
    run: RunUp, panels: Sequence[tuple[str, Mapping[str, BranchCurve]]], title: str, *, logarithmic: bool = False
) -> Any:
    """Curves over the speed, panel by panel; unstable stretches dashed, turning points as thin lines.

    Parameters
    ----------
    panels
        Label of the axis, and name -> curve.
    """
    figure = new_figure(10.5, 1.0 + 3.0 * len(panels))
    marks = ["dashed: unstable"] if any((~c.stable).any() for _, curves in panels for c in curves.values()) else []
    marks += ["dotted: turning points"] if len(run.turning_speeds) else []
    headed(figure, "; ".join([title, *marks]))
    for number, (label, curves) in enumerate(panels):
        axes = figure.add_subplot(len(panels), 1, number + 1)
        tidy(axes)
        for colour, (name, curve) in zip(CYCLE, curves.items(), strict=False):
            first = True
            for branch in dict.fromkeys(curve.branch.tolist()):
                at = np.flatnonzero(curve.branch == branch)
                if at[0] and curve.branch[at[0] - 1] == branch - 1:  # the turning point between them
                    at = np.append(at[0] - 1, at)
                for stable in (True, False):
                    shown = np.where(curve.stable[at] == stable, curve.value[at], np.nan)
                    if not np.isfinite(shown).any():
                        continue
                    if not stable:  # join on to the stable neighbours
                        here = curve.stable[at] == stable
                        joined = here.copy()
                        joined[1:] |= here[:-1]
                        joined[:-1] |= here[1:]
                        shown = np.where(joined, curve.value[at], np.nan)
                    axes.plot(
                        curve.speed[at], shown, color=colour, linewidth=1.5 if stable else 1.0,
                        linestyle="-" if stable else (0, (3, 2)), label=name if first else None,
                        marker="." if len(at) < 3 else None, markersize=3.0,
                    )  # fmt: skip
                    first = False
        for turn in run.turning_speeds.tolist():
            axes.axvline(turn, color=GREY, linewidth=0.6, dashes=(1, 2))
        positive = any((curve.value > 0.0).any() for curve in curves.values())
        if logarithmic and positive:
            axes.set_yscale("log")
            _plain_decades(axes)
        axes.set_ylabel(label)
        _legend_above(axes)
        axes.margins(x=0.0)
    axes.set_xlabel("speed of the drive  (rad/s)")
    return figure


def _legend_above(axes: Any) -> None:
    """Names of the curves above the panel, where none of them runs."""
    axes.legend(fontsize=8, frameon=False, ncols=6, loc="lower left", bbox_to_anchor=(0.0, 0.99), borderaxespad=0.0)


def _plain_decades(axes: Any) -> None:
    """Numbers without powers of ten where an axis spans few decades, with 2 and 5 of each."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    low, high = axes.get_ylim()
    if high < 300.0 * low and low > 1e-3 and high < 1e5:
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axes.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _branch_curve(run: RunUp, values: Sequence[float] | Array) -> BranchCurve:
    speed = np.array([s.speed for s in run.states])
    branch = np.array([s.branch for s in run.states], dtype=np.int64)
    stable = np.array([s.branch % 2 == 0 if s.stable is None else s.stable for s in run.states])
    return BranchCurve(speed, np.asarray(values, dtype=float), branch, stable)
