"""``gearfe gear JOB.toml``: derived geometry of a gear pair and a drawing of it in mesh."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

from ..progress import stage
from .arguments import add_job, check_option
from .common import add_folder

HELP = "derived geometry of a gear pair, and a drawing of it in mesh"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "job", "job file with the table [pair]")
    add_folder(parser)
    parser.add_argument("--angle-deg", type=float, default=0.0, metavar="X", help="pinion angle of the drawing (deg)")


def run(args: argparse.Namespace) -> int:
    """Print the geometry, write gear_pair.png and gear_pair.json."""
    from ..config import load_job
    from ..tables.stiffness import StiffnessTable

    # a mistake in the file is told before NumPy, SciPy and the finite elements load
    tables = load_job(args.job, ("pair",), ("stiffness",))
    check_option("--angle-deg", args.angle_deg, StiffnessTable, "angle_start_deg")

    from ..gear.pair import GearPair

    pair = GearPair.from_table(tables["pair"])  # gears that cannot run together: NumPy alone tells

    from ..figures.gears import pair_figure
    from ..gear.derived import derived_geometry, iso_values
    from ..output.files import output_folder, whole_set, write_json
    from ..stiffness.job import StiffnessJob

    job = StiffnessJob(tables["pair"], tables.get("stiffness", StiffnessTable()), pair)
    folder = output_folder(args.out or Path("out") / Path(args.job).stem)
    geometry = derived_geometry(pair)
    moduli = [material.youngs_modulus for material in job.materials]
    iso = iso_values(pair, moduli[0], moduli[1])
    with whole_set(folder) as made:
        with stage("drawing"):
            pair_figure(made / "gear_pair.png", pair, math.radians(args.angle_deg), _notes(geometry))
        write_json(made / "gear_pair.json", {**geometry, "iso_6336": iso, "warnings": list(pair.warnings)})
    _show(geometry)
    _show({"iso_6336": iso})
    print(f"written to {folder}: gear_pair.json, gear_pair.png")
    for sentence in pair.warnings:
        print(f"gearfe: warning: {sentence}", file=sys.stderr)
    return 0


def _notes(geometry: dict[str, Any]) -> str:
    rows = {
        "centre distance": f"{geometry['centre_distance_mm']:.6g} mm",
        "working pressure angle": f"{geometry['working_pressure_angle_deg']:.5g}°",
        "contact ratio": f"{geometry['contact_ratio']:.4g}",
        "  less tip rounds": f"{geometry['contact_ratio_active']:.4g}",
        "  less relief": f"{geometry['contact_ratio_effective']:.4g}",
        "backlash": f"{geometry['backlash_mm']:.4g} mm",
    }
    return "\n".join(f"{name:<23}{value}" for name, value in rows.items())


def _show(values: dict[str, Any], indent: str = "") -> None:
    for name, value in values.items():
        if isinstance(value, dict):
            print(f"{indent}{name}")
            _show(value, indent + "  ")
        elif isinstance(value, float):
            print(f"{indent}{name:<{34 - len(indent)}} {value:.9g}")
        else:
            print(f"{indent}{name:<{34 - len(indent)}} {value}")
