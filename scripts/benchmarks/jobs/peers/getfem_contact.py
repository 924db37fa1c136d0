"""GetFEM (the system's Python): one contact position of a gear pair on our mesh.

Second-order curved triangles, Saint Venant-Kirchhoff material in plane strain, frictionless large-sliding contact with
Lagrange multipliers (augmented Lagrangian, raytracing), the bore of the pinion held and that of the wheel turned.

What it does that the toolkit does not: any weak form in any dimension, friction, other materials.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from .contact_mesh import ContactTask
from .process import SYSTEM_PYTHON, Spent, run_process

SCRIPT = Path(__file__).with_name("getfem_script.py")


def contact_torque(
    task: ContactTask, *, youngs_modulus: float = 200e9, poisson: float = 0.3
) -> tuple[float, dict[str, Any], Spent]:
    """Torque at the wheel's hub (N m) at one position, what the script measured, and what the process used."""
    with tempfile.TemporaryDirectory(prefix="gearfe-getfem-") as name:
        folder = Path(name)
        arrays: dict[str, Any] = {
            "centre": task.centre,
            "twist": task.twist,
            "width": task.width,
            "youngs_modulus": youngs_modulus,
            "poisson": poisson,
        }
        for side, part in (("pinion", task.pinion), ("wheel", task.wheel)):
            arrays |= {f"{side}_points": part.points, f"{side}_triangles": part.triangles}
            arrays |= {f"{side}_{region}": part.boundaries[region] for region in ("bore", "contact")}
        np.savez(folder / "task.npz", **arrays)
        spent = run_process([SYSTEM_PYTHON, str(SCRIPT), "task.npz", "answer.json"], folder)
        answer: dict[str, Any] = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
    return float(answer["torque"]), answer, spent
