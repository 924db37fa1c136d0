"""Write a CalculiX (Abaqus) deck of a gear pair in contact, and read the torque from its output.

Elements are of second order, in the plane or in space, and linear elastic, with large rotations (NLGEOM). Contact is
surface to surface with a linear pressure of `PENALTY`. The bore of the pinion is held, that of the wheel rotated by the
twist. Of gears in space neither bore moves along the axis. Units are mm, N, MPa.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.files import read_text, whole_file
from ...base.typing import Array
from .abaqus_cards import Fault, cards, real, split
from .included import lines_of
from .mesh_export import Part, SolidPart, abaqus_mesh, boundary_elements

#: Contact stiffness (N/mm3): stiffer ones change the torque by less than 1e-4 and cost iterations.
PENALTY = 1e8
#: The first increment, in parts of the twist: with all of it at once CalculiX 2.20 does not converge on fine meshes.
FIRST = 0.05


@dataclass(frozen=True)
class Deck:
    """A pair in contact.

    Attributes
    ----------
    parts
        Pinion and wheel in their places where the flanks just touch, with boundaries ``bore`` (an internal wheel:
        ``rim``) and ``contact`` (m).
    materials
        Young's modulus (Pa) and Poisson's ratio (-) of pinion and wheel.
    centre
        x of the wheel's centre (m).
    twist
        Rotation of the wheel's bore, or rim, in the step (rad), counter-clockwise.
    width
        Thickness of gears in the plane (m).
    plane
        ``strain`` or ``stress``, of gears in the plane.
    heading
        Lines for the head of the deck.
    """

    parts: Mapping[str, Part]
    materials: Sequence[tuple[float, float]]
    centre: float
    twist: float
    width: float
    plane: str = "strain"
    heading: Sequence[str] = ()


def write_deck(path: str | Path, deck: Deck) -> None:
    """Write the deck; ``ccx NAME`` (without .inp) runs it and leaves the reactions of the wheel's bore in NAME.dat."""
    lines = ["*HEADING", "gear pair in contact, by gearfe; mm, N, MPa", *(f"** {text}" for text in deck.heading)]
    lines += abaqus_mesh(deck.parts, deck.plane)
    wheel, first = deck.parts["wheel"], len(deck.parts["pinion"].points)
    solid = isinstance(wheel, SolidPart)
    for name, (youngs_modulus, poisson_ratio) in zip(deck.parts, deck.materials, strict=True):
        lines += [f"*MATERIAL, NAME=M_{name}", "*ELASTIC", f"{1e-6 * youngs_modulus:.9g}, {poisson_ratio:.9g}"]
        lines.append(f"*SOLID SECTION, ELSET={name}, MATERIAL=M_{name}")
        lines += [] if solid else [f"{1e3 * deck.width:.9g}"]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{PENALTY:g}"]
    lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "S_wheel_contact, S_pinion_contact"]
    lines += ["*STEP, NLGEOM, INC=200", "*STATIC", f"{FIRST:g}, 1.", "*BOUNDARY"]
    lines.append(f"pinion_bore, 1, {3 if solid else 2}")
    c, s = math.cos(deck.twist) - 1.0, math.sin(deck.twist)
    held = "rim" if "rim" in wheel.boundaries else "bore"
    for node in np.unique(boundary_elements(wheel, held)[1]):
        x, y = 1e3 * (wheel.points[node, :2] - [deck.centre, 0.0])
        number = first + node + 1
        lines += [f"{number}, 1, 1, {c * x - s * y:.12e}", f"{number}, 2, 2, {s * x + c * y:.12e}"]
    lines += [f"wheel_{held}, 3, 3"] if solid else []
    lines += [f"*NODE PRINT, NSET=wheel_{held}, FREQUENCY=999", "RF"]
    lines += ["*NODE FILE, FREQUENCY=999", "U", "*EL FILE, FREQUENCY=999", "S", "*END STEP"]
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="ascii", errors="replace", newline="\n")


def deck_torque(deck: str | Path, centre: float, twist: float) -> float:
    """Torque at the wheel's hub (N m), counter-clockwise, from the reactions that CalculiX printed beside a deck.

    Parameters
    ----------
    deck
        The deck; the reactions are in the file of its name with the suffix .dat.
    centre, twist
        As in `Deck` (m, rad).

    Raises
    ------
    InputError
        When the file has no reactions: the run did not come to its end.
    """
    path = Path(deck).with_suffix(".dat")
    forces = _last_forces(path.read_text(encoding="ascii", errors="replace") if path.exists() else "")
    if not len(forces):
        raise InputError("deck", str(path), "has no reactions", f"run it to its end: ccx {Path(deck).stem}")
    nodes = dict(_nodes(Path(deck)))
    places = np.array([nodes[int(n)] for n in forces[:, 0]]) - [1e3 * centre, 0.0]
    c, s = math.cos(twist), math.sin(twist)
    places = places @ np.array([[c, s], [-s, c]])  # reactions act where the twist has brought the bore
    return float(1e-3 * np.sum(places[:, 0] * forces[:, 2] - places[:, 1] * forces[:, 1]))


def _nodes(path: Path) -> list[tuple[int, tuple[float, float]]]:
    rows = []
    for card in cards(lines_of(read_text(path, "deck"), path.name), Fault("deck", path), {}):
        for line in card.data if card.name == "NODE" else ():
            number, x, y, _ = split(line.text)
            rows.append((int(number), (real(x), real(y))))
    return rows


def _last_forces(text: str) -> Array:
    """Numbers of the last block of forces in a .dat file: node, x, y, z."""
    rows: list[list[float]] = []
    inside = False
    for line in text.splitlines():
        if line.strip().startswith("forces"):
            rows, inside = [], True
        elif inside and line.strip():
            try:
                rows.append([float(word) for word in line.split()])
            except ValueError:
                inside = False
    return np.array(rows)
