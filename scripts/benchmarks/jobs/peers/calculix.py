"""CalculiX (``ccx``): one contact position of a gear pair, and modes of a housing, on our meshes.

Contact: CPE6, finite strain (NLGEOM) with the linear elastic law, surface to surface (mortar-free, penalty of 1e8
N/mm3: docs/development/verification.md), the bore of the pinion held and that of the wheel turned by the twist, torque
from the bore's reactions. Modes: C3D10, SPOOLES and ARPACK, bores clamped.

What it does that the toolkit does not: any geometry, friction, plasticity, heat. Its own mesher is left out of the
time,
ours too.
"""

from __future__ import annotations

import math
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from gearfe.drivetrain.housing.model import Housing

from .contact_mesh import ContactTask
from .process import PeerError, Spent, run_process

#: Contact stiffness (N/mm3): stiffer ones change the torque by less than 1e-4 and cost iterations.
PENALTY = 1e8


def contact_torque(task: ContactTask, *, youngs_modulus: float = 200e9, poisson: float = 0.3) -> tuple[float, Spent]:
    """Torque at the wheel's hub (N m) at one position, and what the process used."""
    with tempfile.TemporaryDirectory(prefix="gearfe-ccx-") as name:
        folder = Path(name)
        bore = _write_contact(folder / "pair.inp", task, youngs_modulus, poisson)
        spent = run_process(["ccx", "pair"], folder)
        path = folder / "pair.dat"
        if "*ERROR" in spent.text or not path.exists():
            raise PeerError("CalculiX did not converge: " + " ".join(re.findall(r"\*ERROR[^\n]*", spent.text))[:200])
        forces = _last_block(path, "forces")
    points = np.concatenate([task.pinion.points, task.wheel.points])
    places = points[np.array([int(n) - 1 for n in forces[:, 0]])] - [task.centre, 0.0]
    c, s = math.cos(task.twist), math.sin(task.twist)
    places = places @ np.array([[c, s], [-s, c]])  # reactions act where the twist has brought the bore
    if len(forces) != len(bore):
        raise PeerError("CalculiX printed no reactions of the bore")
    torque = np.sum(places[:, 0] * forces[:, 2] - places[:, 1] * forces[:, 1])
    return float(torque), spent


def _write_contact(path: Path, task: ContactTask, youngs_modulus: float, poisson: float) -> np.ndarray:
    """The deck (mm, N, MPa); returns the numbers of the wheel's bore nodes, from 0."""
    offset = len(task.pinion.points)
    points = 1e3 * np.concatenate([task.pinion.points, task.wheel.points])
    bores = [np.unique(task.pinion.boundaries["bore"]), np.unique(task.wheel.boundaries["bore"]) + offset]
    lines = ["*NODE, NSET=NALL", *(f"{i + 1}, {x:.12e}, {y:.12e}, 0." for i, (x, y) in enumerate(points))]
    first = 1
    for name, part, shift in (("PINION", task.pinion, 1), ("WHEEL", task.wheel, offset + 1)):
        lines.append(f"*ELEMENT, TYPE=CPE6, ELSET={name}")
        lines += [f"{first + e}, " + ", ".join(map(str, nodes + shift)) for e, nodes in enumerate(part.triangles)]
        middle = {int(node): (e, side) for side in range(3) for e, node in enumerate(part.triangles[:, 3 + side])}
        lines.append(f"*SURFACE, NAME=S_{name}, TYPE=ELEMENT")
        chosen = (middle[int(node)] for node in part.boundaries["contact"].reshape(-1, 3)[:, 1])
        lines += [f"{first + e}, S{side + 1}" for e, side in chosen]
        first += len(part.triangles)
    for name, nodes in zip(("BORE_PINION", "BORE_WHEEL"), bores, strict=True):
        lines += [f"*NSET, NSET={name}", *(f"{n + 1}," for n in nodes)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{1e-6 * youngs_modulus:.9g}, {poisson:.9g}"]
    for name in ("PINION", "WHEEL"):
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL", f"{1e3 * task.width:.9g}"]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{PENALTY:g}"]
    lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "S_WHEEL, S_PINION"]
    lines += ["*STEP, NLGEOM, INC=200", "*STATIC", "1., 1.", "*BOUNDARY", "BORE_PINION, 1, 2"]
    c, s = math.cos(task.twist) - 1.0, math.sin(task.twist)
    for n in bores[1]:
        x, y = points[n] - [1e3 * task.centre, 0.0]
        lines += [f"{n + 1}, 1, 1, {c * x - s * y:.12e}", f"{n + 1}, 2, 2, {s * x + c * y:.12e}"]
    lines += ["*NODE PRINT, NSET=BORE_WHEEL, FREQUENCY=999", "RF", "*END STEP"]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return np.asarray(bores[1])


def _last_block(path: Path, title: str) -> np.ndarray:
    """Numbers of the last block with that title in a .dat file."""
    rows: list[list[float]] = []
    inside = False
    for line in path.read_text(encoding="ascii", errors="replace").splitlines():
        if line.strip().startswith(title):
            rows, inside = [], True
        elif inside and line.strip():
            try:
                rows.append([float(x) for x in line.split()])
            except ValueError:
                inside = False
    return np.array(rows)


def clamped_modes(housing: Housing, count: int) -> tuple[np.ndarray, Spent]:
    """Natural frequencies (Hz) with feet and bores clamped."""
    material: Any = housing.material
    held = np.unique(np.concatenate([housing.fixed, *(a.nodes for a in housing.attachments)]))
    with tempfile.TemporaryDirectory(prefix="gearfe-ccx-") as name:
        folder = Path(name)
        lines = ["*NODE, NSET=NALL"]
        lines += [f"{i + 1}, {x:.12e}, {y:.12e}, {z:.12e}" for i, (x, y, z) in enumerate(housing.nodes)]
        tets = housing.mesh.cells
        tets = tets if tets.shape[1] == 4 else _as_vtk(tets)  # CalculiX has VTK's order
        lines.append(f"*ELEMENT, TYPE=C3D{tets.shape[1]}, ELSET=ALL")
        lines += [f"{e + 1}, " + ", ".join(map(str, nodes + 1)) for e, nodes in enumerate(tets)]
        lines += ["*NSET, NSET=HELD", *(f"{n + 1}," for n in held)]
        lines += ["*BOUNDARY", "HELD, 1, 3", "*MATERIAL, NAME=STEEL", "*ELASTIC"]
        lines += [f"{material.youngs_modulus:.12g}, {material.poisson_ratio:.12g}"]
        lines += ["*DENSITY", f"{material.density:.12g}", "*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL"]
        lines += ["*STEP", "*FREQUENCY", f"{count}", "*END STEP"]
        (folder / "modes.inp").write_text("\n".join(lines) + "\n", encoding="ascii")
        spent = run_process(["ccx", "modes"], folder)
        text = (folder / "modes.dat").read_text(encoding="ascii", errors="replace")
    rows = re.findall(r"^\s+\d+\s+\S+\s+\S+\s+(\S+)\s+\S+\s*$", text.split("P A R T I C")[0], re.MULTILINE)
    if len(rows) < count:
        raise PeerError("CalculiX printed fewer modes than asked")
    return np.array([float(x) for x in rows[:count]]), spent


def _as_vtk(tets: np.ndarray) -> np.ndarray:
    """Our midside nodes (order of `gearfe.fem.solid.EDGES`) in the order of edges 01, 12, 20, 03, 13, 23."""
    from gearfe.fem.solid import EDGES

    wanted = [{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}]
    ours = [set(map(int, edge)) for edge in EDGES]
    return np.asarray(tets[:, [0, 1, 2, 3, *(4 + ours.index(edge) for edge in wanted)]])
