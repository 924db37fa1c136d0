"""Drawings as DXF (AutoCAD 2000), through ezdxf. Millimetres."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...base.errors import MissingLibraryError
from ...base.isolation import load
from ...base.typing import Array


def write_dxf(path: Path, outlines: Mapping[str, Array], circles: Mapping[str, float]) -> None:
    """Write closed outlines and circles about the origin, each on a layer of its name.

    Parameters
    ----------
    outlines
        Layer -> points (mm), shape (n, 2), without the first one again at the end.
    circles
        Layer -> radius (mm).

    Raises
    ------
    MissingLibraryError
        Without ezdxf.
    """
    try:
        ezdxf = load("ezdxf")
    except ImportError:
        raise MissingLibraryError("DXF needs ezdxf: pip install 'gearfe[exchange]'") from None
    document = ezdxf.new("R2000", units=ezdxf.units.MM)
    space = document.modelspace()
    for layer, points in outlines.items():
        document.layers.add(layer)
        line = space.add_lwpolyline([], close=True, dxfattribs={"layer": layer})
        rows = np.zeros((len(points), 5))  # x, y, widths at start and end, bulge
        rows[:, :2] = points
        line.lwpoints.extend(rows.tolist())  # all at once: its own way copies all points for each of them
    for layer, radius in circles.items():
        document.layers.add(layer)
        space.add_circle((0.0, 0.0), radius, dxfattribs={"layer": layer})
    document.saveas(path)
