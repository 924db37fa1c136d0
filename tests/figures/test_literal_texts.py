"""Names of a user's in pictures: a $ in them begins no formula."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfe.figures.spectra import label_lines
from gearfe.figures.style import fixed, headed, new_figure, save

NAME = "$\\frac{$"  # what matplotlib cannot read as a formula


@pytest.mark.parametrize("make", [new_figure, fixed])
def test_names_that_are_no_formulas(make, tmp_path: Path) -> None:
    figure = make(4.0, 3.0)
    axes = figure.add_subplot()
    axes.set_title(NAME)
    headed(figure, NAME)
    axes.plot([1.0, 1e4], [1.0, 2.0], label=NAME)
    axes.set_xscale("log")
    axes.set_xlabel(NAME)
    axes.set_yticks([1.0, 2.0], labels=[NAME, NAME])
    axes.annotate(NAME, (10.0, 1.5))
    axes.legend(title=NAME)
    label_lines(axes, [(10.0, 1.0, NAME)], np.array([10.0]), np.array([1.0]))
    save(figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 1000
    powers = [label for label in axes.get_xticklabels() if "10" in label.get_text()]
    assert powers
    assert all(label.get_parse_math() for label in powers)
