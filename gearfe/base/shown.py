"""Display results: a line at the prompt, a table in a notebook, a data frame, a picture."""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, ClassVar

from . import drawing
from .errors import MissingLibraryError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .typing import Array


def percent(share: float, digits: int = 2) -> str:
    """Share as text in per cent with so many significant digits: 120 %, 0.031 %; powers of ten only below 0.001 %."""
    value = 100.0 * share
    if not math.isfinite(value):
        return "unknown"
    if value == 0.0 or not 1e-3 <= abs(value) < 1e15:
        return f"{value:.{digits}g} %"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text) + " %"


class Facts:
    """Mix-in for results that describe themselves by the class's own `facts`."""

    def facts(self) -> Mapping[str, str]:
        """Describe the result in a few words: name -> value with its unit."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}: " + ", ".join(f"{name} {value}" for name, value in self.facts().items())

    def _repr_html_(self) -> str:
        """Return the table that a notebook shows."""
        import html

        cell = '<td style="text-align:left">{}</td>'
        rows = "".join(
            f"<tr>{cell.format(html.escape(name))}{cell.format(html.escape(value))}</tr>"
            for name, value in self.facts().items()
        )
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"


class Shown(Facts):
    """A result that has a picture, too."""

    def plot(self) -> Figure:
        """A picture of the result, which a notebook shows; ``.savefig("name.png")`` keeps it."""
        figure: Figure = drawing.draw(self)
        return figure


class ShownTable(Shown):
    """A result that is a table, too: `columns` are a class's own."""

    #: Columns that number the rows: the dimensions of `to_xarray`; without any these are ``row``.
    AXES: ClassVar[tuple[str, ...]] = ()

    def columns(self) -> Mapping[str, Iterable[Any]]:
        """The result as a table: name with unit -> values, all of one length."""
        raise NotImplementedError

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame`: numbers where all cells of a column are.

        Raises
        ------
        MissingLibraryError
            Where pandas is not installed.
        """
        return library("pandas").DataFrame({name: as_numbers(cells) for name, cells in self.columns().items()})

    def to_xarray(self) -> Any:
        """The table as an `xarray.Dataset` over `AXES`; needs pandas, too."""
        library("xarray")
        frame = self.to_pandas()
        return (frame.set_index(list(self.AXES)) if self.AXES else frame.rename_axis("row")).to_xarray()


def as_numbers(cells: Iterable[Any]) -> Array:
    """Return the cells of a column as an array: of numbers if all are, of whole ones if possible."""
    import numpy as np

    values = np.asarray(list(cells))
    if values.dtype.kind != "U":
        return values
    for kind in (np.int64, np.float64):
        with suppress(ValueError, OverflowError):
            return values.astype(kind)
    return values.astype(object)


def library(name: str) -> Any:
    """A library of the extra ``study``.

    Raises
    ------
    MissingLibraryError
        Where it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingLibraryError(f"{name} is not installed: pip install 'gearfe[study]'") from None
