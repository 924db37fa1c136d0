"""exudyn: Hurty-Craig-Bampton modes of a housing from given matrices (its FEMinterface, rigid boundaries RBE2).

Its own way to a reduced body starts from the matrices of another finite-element program, so assembling them is not
counted against it. What it does that the toolkit does not: flexible bodies that move and turn as a whole.
"""

from __future__ import annotations

import contextlib
import io
from typing import Any

import numpy as np

from tests.makers.housing_meshes import reference_housing

from ..housing_study import small_housing
from ..timing import measured
from .process import serve


def answer(task: dict[str, Any]) -> dict[str, Any]:
    """Reduce and measure."""
    from exudyn.FEM import FEMinterface, HCBstaticModeSelection
    from scipy.sparse import csr_matrix

    housing = small_housing() if task["quick"] else reference_housing()
    free = np.ones(len(housing.nodes), dtype=bool)
    free[housing.fixed] = False
    number = np.cumsum(free) - 1
    rows = (3 * np.flatnonzero(free)[:, None] + np.arange(3)).ravel()
    stiffness = csr_matrix(csr_matrix(housing.matrices().stiffness)[rows][:, rows])
    mass = csr_matrix(csr_matrix(housing.matrices().mass)[rows][:, rows])
    bores = [[int(number[n]) for n in a.nodes] for a in housing.attachments]

    def run() -> np.ndarray:
        fem = FEMinterface()
        fem.nodes = {"Position": housing.nodes[free]}
        fem.stiffnessMatrix = stiffness
        fem.massMatrix = mass
        with contextlib.redirect_stdout(io.StringIO()):
            fem.ComputeHurtyCraigBamptonModes(
                bores,
                task["modes"],
                useSparseSolver=True,
                computationMode=HCBstaticModeSelection.RBE2,
                excludeRigidBodyMotion=False,
            )
        return np.sort(np.abs(np.asarray(fem.eigenValues))) ** 0.5 / (2.0 * np.pi)

    found, cost = measured(run, runs=1)
    return {"frequencies_hz": found[-task["modes"] :].tolist(), **cost.columns}


if __name__ == "__main__":
    serve(answer)
