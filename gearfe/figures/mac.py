"""Picture of the modal assurance criterion of two sets of modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..housing.modal_test import Comparison
from .style import new_figure, save


def mac_figure(path: str | Path, made: Comparison, name: str) -> None:
    """A table of squares, test modes upwards, those of the housing to the right; partners are framed.

    Parameters
    ----------
    name
        What the test is called.
    """
    rows, count = made.mac.shape
    figure = new_figure(max(6.0, 2.2 + 0.52 * count), max(4.0, 1.9 + 0.42 * rows))
    axes = figure.subplots()
    image = axes.pcolormesh(np.arange(count + 1), np.arange(rows + 1), made.mac, cmap="Blues", vmin=0.0, vmax=1.0)
    for i, j in np.argwhere(made.mac >= 0.1):
        value = made.mac[i, j]
        axes.text(
            j + 0.5,
            i + 0.5,
            f"{value:.2f}",
            ha="center",
            va="center",
            fontsize=8,
            color="white" if value > 0.6 else "k",
        )
    for i, j in enumerate(made.pairs):
        if j >= 0:
            axes.plot([j, j + 1, j + 1, j, j], [i, i, i + 1, i + 1, i], color="#d9730d", linewidth=1.4)
    axes.set_xticks(np.arange(count) + 0.5, [f"{f:.0f}" for f in made.frequencies], rotation=90, fontsize=8)
    axes.set_yticks(np.arange(rows) + 0.5, [f"{f:.0f}" for f in made.test.frequencies], fontsize=8)
    axes.set_xlabel("housing: frequency (Hz)")
    axes.set_ylabel(f"{name}: frequency (Hz)")
    axes.set_title("Modal assurance criterion", loc="left", fontsize=11)
    figure.colorbar(image, ax=axes, pad=0.02, label="MAC (-)")
    save(figure, path)
