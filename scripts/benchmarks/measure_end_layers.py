"""Loads per layer of a spur pair along the face width against CalculiX, with layers of 0.1 mm at the ends.

One sector of each gear, its cut sides and bore held, in half of the width: the middle is a plane of symmetry. Both
programs get the same twist, from a torque of gearfe. CalculiX has elements of second order, small strain, and contact
from surface to surface with a pair for each layer, whose forces it prints.

Usage: python scripts/benchmarks/measure_end_layers.py FOLDER [--crowning-um 10] [--flank-mm 0.08]
       python scripts/benchmarks/measure_end_layers.py FOLDER --read       after: cd FOLDER && ccx pair
"""

from __future__ import annotations

import argparse
import functools
import itertools
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gearfe import Gear, GearPair
from gearfe.gears.gearmesh.solid_parts import flank_feet, modified, solid_part
from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes
from gearfe.gears.width import LeadModification, WideFlanks, WideMesh, contact_lines, sweep_width, wide_compliance
from gearfe.gears.width.lines import look_at
from gearfe.output.exchange.calculix_deck import Deck, write_deck
from gearfe.output.exchange.mesh_export import MeshPart

#: Thickness of the layers from the end of the face to its middle (mm), torque at the wheel (N m), and the width (m).
LAYERS, TORQUE, WIDTH = (0.1, 0.1, 0.1, 0.1, 0.2, 0.4, 0.8, 1.4, 1.8), 100.0, 10e-3
#: Half the length of flank with contact faces about the line of contact (m), and the play at the start (m).
REACH, APART = 0.8e-3, 1e-6


def main() -> None:
    """Write the deck, or compare what CalculiX made of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--crowning-um", type=float, default=10.0)
    parser.add_argument("--flank-mm", type=float, default=0.08, help="elements on the flanks")
    parser.add_argument("--read", action="store_true")
    args = parser.parse_args()
    if args.read:
        compare(args.folder)
    else:
        write(args.folder, 1e-6 * args.crowning_um, 1e-3 * args.flank_mm)


def write(folder: Path, crowning: float, size: float) -> None:
    """Solve the position with gearfe, and write the deck and what to compare with it."""
    form: dict[str, Any] = {"module": 2.5e-3, "pressure_angle": math.radians(25.0), "face_width": WIDTH}
    pinion, wheel = (Gear(z, bore_diameter=5e-4 * z, tip_round=1e-4, **form) for z in (20, 30))
    pair = GearPair(pinion, wheel)
    mesh = WideMesh(pair, functions=13, coarsen=1.0, flank_coarsen=1.0)
    flanks = WideFlanks(leads=(LeadModification(crowning=crowning), LeadModification()))
    lines = contact_lines(wide_compliance(mesh, whole=False), flanks, density=4.0)
    angle = pair.path["C"].pinion_angle
    begin = float(np.ravel(look_at(lines, angle).least)[0]) - APART / pair.wheel.base_radius
    sweep = sweep_width(lines, [TORQUE], angles=[angle])
    points = sweep.points
    if len(set(points.pair.tolist())) != 1:
        raise SystemExit("more than one tooth pair carries load at the pitch point")
    tooth, twist = int(points.pair[0]), float(sweep.twist[0, 0]) - begin
    low, high = mesh.faces[0]
    levels = high - 1e-3 * np.cumsum([0.0, *LAYERS])[::-1]
    roll = points.roll[np.argmax(points.line_load)]
    parts = {}
    for gear, (name, body) in enumerate((("pinion", pair.pinion), ("wheel", pair.wheel))):
        recipe = replace(sector_recipes(pair, coarsen=2.5)[gear], flank=size, strip=size)
        sector = sector_mesh(body, recipe)
        held = np.concatenate([sector.boundaries[part] for part in ("bore", "cut_left", "cut_right")])
        section = MeshPart(sector.points, sector.triangles, {"bore": held, "contact": sector.contact_edges()})
        turned = pair.tooth_angle(gear, tooth if gear == 0 else -1 - tooth, angle, pair.contact_twist + begin)
        centre = gear * pair.wheel_centre
        place = functools.partial(_fixed, (complex(np.exp(1j * float(turned))), complex(centre)))
        moved = modified(flank_feet(sector, mesh, gear), mesh, flanks, gear)
        part = solid_part(section, levels, place, moved)
        faces = part.boundaries["contact"]
        middles = part.points[part.wedges[faces[:, 0], :6]].mean(axis=1)
        radius = np.hypot(middles[:, 0] - centre, middles[:, 1])
        faces = faces[np.abs(radius - math.hypot(body.base_radius, roll[gear])) < REACH]
        layer = np.searchsorted(levels, part.points[part.wedges[faces[:, 0], :6], 2].mean(axis=1)) - 1
        named = {f"contact{k:02d}": faces[layer == k] for k in range(len(LAYERS))} if gear else {}
        parts[name] = replace(part, boundaries={**part.boundaries, "contact": faces, **named})
    folder.mkdir(parents=True, exist_ok=True)
    deck = folder / "pair.inp"
    materials = [(material.youngs_modulus, material.poisson_ratio) for material in mesh.materials]
    write_deck(deck, Deck(parts, materials, pair.wheel_centre, twist, 0.0))
    first, middle = 1, []
    for part in parts.values():
        middle += (np.flatnonzero(np.abs(part.points[:, 2] - levels[0]) < 1e-9) + first).tolist()
        first += len(part.points)
    text = deck.read_text(encoding="ascii").replace(", NLGEOM", "").replace("*STATIC\n0.05, 1.", "*STATIC\n0.5, 1.")
    kind, one = "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE\n", "S_wheel_contact, S_pinion_contact\n"
    names = [f"S_wheel_contact{k:02d}" for k in range(len(LAYERS))]
    text = text.replace(kind + one, "".join(f"{kind}{name}, S_pinion_contact\n" for name in names))
    text = text.replace("*BOUNDARY\n", "*BOUNDARY\n" + "".join(f"{node}, 3, 3\n" for node in middle), 1)
    printed = "".join(f"*CONTACT PRINT, SLAVE={name}, MASTER=S_pinion_contact\nCF\n" for name in names)
    deck.write_text(text[: text.index("*NODE PRINT")] + printed + "*END STEP\n", encoding="ascii", newline="\n")
    z = np.linspace(levels[0], high, 400001)
    order = np.argsort(points.z)
    load = np.interp(z, points.z[order], points.line_load[order], left=0.0, right=0.0)
    bounds = np.searchsorted(z, levels)
    ours = [np.trapezoid(load[a : b + 1], z[a : b + 1]) for a, b in itertools.pairwise(bounds.tolist())]
    centre = pair.wheel_centre
    np.savez(folder / "gearfe.npz", levels=levels - 0.5 * (low + high), force=ours, torque=TORQUE, centre=centre)


def _fixed(place: tuple[complex, complex], _: float) -> tuple[complex, complex]:
    """Turn and place of a section, the same at all z."""
    return place


def compare(folder: Path) -> None:
    """Print the line loads of both programs in each layer, and the torques."""
    kept = np.load(folder / "gearfe.npz")
    thick, text = np.diff(kept["levels"]), (folder / "pair.dat").read_text(encoding="ascii")
    force, torque = np.zeros(len(thick)), 0.0
    block = r"slave set S_WHEEL_CONTACT(\d\d), .*? time +0\.10+E\+01\s+total surface force[^\n]*\s+((?:\S+\s+){6})"
    for layer, numbers in re.findall(block, text):
        fx, fy, _, _, _, mz = map(float, numbers.split())
        force[int(layer)] = math.hypot(fx, fy)
        torque += 2e-3 * abs(mz - 1e3 * float(kept["centre"]) * fy)
    theirs, ours = 1e-3 * force / thick, 1e-3 * kept["force"] / thick
    print("| z from the middle (mm) | CalculiX (N/mm) | gearfe (N/mm) | difference, % of the largest |")
    print("|---|---|---|---|")
    for k, z in enumerate(1e3 * kept["levels"][1:]):
        off = 100.0 * (ours[k] - theirs[k]) / theirs.max()
        print(f"| ..{z:.1f} | {theirs[k]:.1f} | {ours[k]:.1f} | {off:.1f} |")
    print(f"torque: CalculiX {torque:.2f}, gearfe {float(kept['torque']):.2f} N m")


if __name__ == "__main__":
    main()
