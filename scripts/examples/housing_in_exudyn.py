"""A reduced housing in exudyn: the matrices that `gearfe housing` leaves, as linear coordinates of a system there.

    python scripts/examples/housing_in_exudyn.py out/box/housing      frequencies beside those of modes.csv

Coordinates 6 i to 6 i + 5 are displacement (m) and small rotation (rad) of attachment i: markers, loads and connectors
of coordinates (MarkerNodeCoordinate, LoadCoordinate) join shafts and bearings to them. Needs exudyn.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectGenericODE2
from scipy.io import mmread


def add_housing(system: Any, folder: str | Path, *, damping: float = 0.0) -> tuple[Any, Any]:
    """Add the housing of a folder to a system of exudyn; return its node and its object.

    Parameters
    ----------
    damping
        Factor on the stiffness (s), for C = damping K.
    """
    stiffness, mass = (mmread(Path(folder) / f"housing_{name}.mtx") for name in ("stiffness", "mass"))
    matrices = []
    for values in (mass, stiffness, damping * stiffness):
        held = exu.MatrixContainer()
        held.SetWithDenseMatrix(np.asarray(values), useDenseMatrix=True)
        matrices.append(held)
    count = len(stiffness)
    rest = [0.0] * count
    node = system.AddNode(
        NodeGenericODE2(
            referenceCoordinates=rest,
            initialCoordinates=rest,
            initialCoordinates_t=rest,
            numberOfODE2Coordinates=count,
        )
    )
    names = ("massMatrix", "stiffnessMatrix", "dampingMatrix")
    body = system.AddObject(ObjectGenericODE2(nodeNumbers=[node], **dict(zip(names, matrices, strict=True))))
    return node, body


def frequencies(folder: str | Path) -> Any:
    """Natural frequencies (Hz) that exudyn finds."""
    system = exu.SystemContainer().AddSystem()
    add_housing(system, folder)
    system.Assemble()
    squares = np.asarray(system.ComputeODE2Eigenvalues()[0])
    return np.sqrt(np.abs(squares)) / (2.0 * np.pi)


def main(arguments: list[str]) -> int:
    """Print the first frequencies."""
    if len(arguments) != 1:
        print(__doc__)
        return 2
    for number, frequency in enumerate(frequencies(arguments[0])[:10], start=1):
        print(f"{number:3d} {frequency:10.2f} Hz")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
