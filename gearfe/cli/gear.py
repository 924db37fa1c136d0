"""``gearfe gear JOB.toml``: geometry of a gear pair by ISO 21771, and a drawing of it in mesh."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.progress import stage
from ..base.tables.microgeometry import ALONG_WIDTH
from .arguments import add_folder, add_job, add_mesh, check_option, each_mesh, print_results

if TYPE_CHECKING:
    from ..base.tables.gearbox import NamedGear, NamedMesh
    from ..gears.geometry.face import ToothDeviations
    from ..gears.geometry.pair import Gear, GearPair

#: Forms of ``--export``, and the files that they are.
EXPORTS = ("csv", "dxf", "step", "brep")
#: The whole job as REXS, beside the forms of each gear.
REXS = "rexs"
FILES = tuple(f"{side}.{form}" for side in ("pinion", "wheel") for form in EXPORTS)

#: Symbols of the printed values by ISO 21771 and ISO 6336-1, and what they are where the name leaves it open.
SYMBOLS = {
    "gear_ratio": "u = z_2/z_1",
    "centre_distance_mm": "a_w",
    "working_pressure_angle_deg": "alpha_wt",
    "base_pitch_mm": "p_bt",
    "backlash_mm": "j_wt, circumferential at the working pitch circles",
    "normal_backlash_mm": "j_bn, along the line of action",
    "lost_motion_to_contact_deg": "j_bn/(2 r_b2): wheel from centred teeth to contact",
    "contact_ratio": "eps_alpha, between the tip circles",
    "contact_ratio_active": "between the starts of the tip rounds",
    "contact_ratio_effective": "between the starts of the reliefs",
    "overlap_ratio": "eps_beta",
    "total_contact_ratio": "eps_gamma",
    "helix_angle_deg": "beta",
    "base_helix_angle_deg": "beta_b",
    "working_helix_angle_deg": "beta_w",
    "transverse_module_mm": "m_t",
    "transverse_pressure_angle_deg": "alpha_t",
    "common_face_width_mm": "b_w",
    "path_length_mm": "g_alpha",
    "mesh_cycle_deg": "360 deg/z_1",
    "teeth": "z",
    "module_mm": "m_n",
    "pitch_diameter_mm": "d, reference diameter",
    "working_pitch_diameter_mm": "d_w",
    "base_diameter_mm": "d_b",
    "tip_diameter_mm": "d_a",
    "root_diameter_mm": "d_f",
    "form_diameter_mm": "d_Ff",
    "active_tip_diameter_mm": "d_Na",
    "active_root_diameter_mm": "d_Nf",
    "tip_thickness_mm": "s_a",
    "profile_shift": "x",
    "span_teeth": "k",
    "span_mm": "W_k",
    "ball_diameter_mm": "D_M",
    "over_balls_mm": "M_dK",
    "lead_mm": "p_z",
    "virtual_teeth": "z_n",
    "pinion_specific_sliding": "zeta_1",
    "wheel_specific_sliding": "zeta_2",
    "c_prime_N_per_mm_um": "c'",
    "c_gamma_N_per_mm_um": "c_gamma",
    "c_gamma_times_width_N_per_m": "c_gamma b",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_job(parser, "job", "job file with the table [pair]")
    add_mesh(parser)
    add_folder(parser)
    parser.add_argument(
        "--export",
        metavar="NAME",
        default="",
        help=f"each gear also as {', '.join(EXPORTS)}, or several, as dxf,step, or one gear, as pinion.dxf: outline of "
        "a tooth (csv), of the gear (dxf), solid (step, brep), mm; rexs: the whole job as gearbox.rexs",
    )
    parser.add_argument(
        "--results",
        metavar="DIR",
        help="with --export rexs: folder that holds the folders of results (default: out/JOB, as of all commands)",
    )
    parser.add_argument(
        "--angle-deg", type=float, default=0.0, metavar="X", help="pinion angle of the drawing (deg, default: 0)"
    )


def run(args: argparse.Namespace) -> int:
    """Print the geometry of each mesh, write gear_pair.png and gear_pair.json; of shafts gearbox.png, too."""
    from ..base.tables.pair import StiffnessTable

    check_option("--angle-deg", args.angle_deg, StiffnessTable, "angle_start_deg")
    _exports(args.export)
    _check_results(args)
    code = each_mesh(args, _run_mesh)
    if _wants_rexs(args.export):
        _write_rexs(args)
    if args.mesh is None:
        _show_gearbox(args)
    return code


def _wants_rexs(text: str) -> bool:
    """Whether a value of ``--export`` names REXS."""
    return REXS in (word.strip() for word in text.split(","))


def _check_results(args: argparse.Namespace) -> None:
    """A folder of results that is named exists, and is used."""
    from ..base.errors import InputError

    if args.results is None:
        return
    if not _wants_rexs(args.export):
        raise InputError("--results", args.results, "is of --export rexs only", "add --export rexs, or leave it out")
    if not Path(args.results).is_dir():
        raise InputError("--results", args.results, "is no folder", "name the folder that holds the folders of results")


def _write_rexs(args: argparse.Namespace) -> None:
    """Write the whole job as REXS 2.0, with what is known of it."""
    from ..base.files import output_folder
    from ..drivetrain.gearbox.rexs_results import rexs_results
    from ..output.exchange.rexs import write_rexs

    folder = output_folder(args.out)
    with stage("writing gearbox.rexs"):
        known = rexs_results(args.job, args.results or Path("out") / Path(args.job).stem)
        write_rexs(args.job, folder / "gearbox.rexs", known.results)
    print_results([], folder, ["gearbox.rexs"], {}, known.notes)


def _show_gearbox(args: argparse.Namespace) -> None:
    """Print and draw where the gears, shafts and bearings of the whole gearbox are, of a file that has shafts."""
    from ..base.config import read_toml
    from ..base.errors import InputError

    raw = read_toml(args.job)
    if "shafts" not in raw and "train" not in raw:
        return
    from ..base.files import output_folder, whole_set, write_json
    from ..drivetrain.gearbox.layout import gearbox_layout

    try:
        layout = gearbox_layout(raw, args.job)
    except InputError as error:
        if "pair" not in raw:
            raise
        print(f"gearfe: warning: the whole gearbox is not drawn: {error}", file=sys.stderr)
        return
    if layout is None:
        return
    folder = output_folder(args.out)
    with whole_set(folder, ("gearbox.png", "gearbox.json")) as made:
        if not args.no_pictures:
            from ..figures.gearbox import gearbox_picture
            from ..figures.style import save

            with stage("drawing the gearbox"):
                save(gearbox_picture(layout), made / "gearbox.png")
        write_json(made / "gearbox.json", asdict(layout))
        names = sorted(path.name for path in made.iterdir())
    print_results([*(mesh.line() for mesh in layout.meshes), *layout.collisions()], folder, names, {}, ())


def _run_mesh(args: argparse.Namespace, mesh: NamedMesh) -> int:
    """The geometry of one mesh."""
    exports = _exports(args.export)

    from ..gears.geometry.pair import pair_of

    pair = pair_of(mesh)  # gears that cannot run together show with NumPy alone

    from ..base.files import output_folder, whole_set, write_json
    from ..gears.gearmesh.job import materials_of
    from ..gears.geometry.derived import derived_geometry
    from ..gears.rating.stiffness import iso_values

    folder = output_folder(args.out)
    spans = mesh.driver.drawn.get("span_teeth"), mesh.driven.drawn.get("span_teeth")
    geometry = derived_geometry(pair, spans)
    moduli = [material.youngs_modulus for material in materials_of(mesh)]
    iso = iso_values(pair, moduli[0], moduli[1])
    rated = _measures(args, mesh, pair)
    with whole_set(folder, ("gear_pair.png", *FILES)) as made:
        for name in exports:
            with stage(f"writing {name}"):
                _export(made / name, pair, mesh, Path(args.job).parent)
        if not args.no_pictures:
            from ..figures.gears import pair_picture
            from ..figures.style import save

            with stage("drawing"):
                save(pair_picture(pair, math.radians(args.angle_deg), _notes(geometry)), made / "gear_pair.png")
        keys = {"job": _keys_of_gears(mesh, Path(args.job).parent)}
        found = {**geometry, **rated, **keys, "iso_6336": iso, "warnings": list(pair.warnings)}
        write_json(made / "gear_pair.json", found)
        names = sorted(path.name for path in made.iterdir())
    _show(geometry)
    _show({"iso_6336": iso, **rated})
    if exports and pair.pinion.helical:
        print("csv and dxf are of the transverse section in the middle of the face width, step and brep of the helix")
    if exports and mesh.deviates and any(_along_width(gear) for gear in mesh.gears):
        print("modifications along the face width are in none of the files")
    if exports and mesh.deviates:
        print("flanks with the deviations of [microgeometry]: dxf, step and brep all teeth, csv tooth 0")
    print_results((), folder, names, {}, pair.warnings)
    return 0


def _measures(args: argparse.Namespace, mesh: NamedMesh, pair: GearPair) -> dict[str, Any]:
    """Tolerances, sizes over balls and spans with their limits, and backlash, of a file with [rating]."""
    from ..base.config import read_toml
    from ..base.tables.jobs import job_tables, whole_gearbox

    raw = read_toml(args.job)
    if "rating" not in raw:
        return {}
    from ..gears.rating.report import measures

    table, box = job_tables(raw, args.job, ("rating",))["rating"], whole_gearbox(raw, args.job)
    names = mesh.driver.name, mesh.driven.name
    keys = {name: table.of_gear(name, box.gears) for name in names}
    return {"measures": measures(pair, names, keys, table.of_mesh(mesh.name, box.meshes), table.edition)}


def _keys_of_gears(mesh: NamedMesh, folder: Path) -> dict[str, Any]:
    """Keys of both gears that exported files depend on, with check sums of the files of measured flanks."""
    import hashlib

    def with_sums(value: Any, name: str = "") -> Any:
        if isinstance(value, dict):
            return {key: with_sums(entry, key) for key, entry in value.items() if entry not in (None, (), [])}
        if name.endswith("_csv") and (folder / str(value)).is_file():
            return {"file": value, "sha256": hashlib.sha256((folder / str(value)).read_bytes()).hexdigest()}
        return value

    found: dict[str, Any] = {}
    for side, gear in zip(("pinion", "wheel"), mesh.gears, strict=True):
        flanks = {} if gear.microgeometry is None else {"microgeometry": asdict(gear.microgeometry)}
        found[side] = with_sums({**gear.form, **gear.drawn, **flanks})
    return found


def _along_width(gear: NamedGear) -> bool:
    """Whether a gear has modifications along the face width, on either side of its teeth."""
    sides = () if gear.microgeometry is None else (gear.microgeometry.flank(side) for side in ("left", "right"))
    return any(getattr(flank, key) for flank in sides for key in ALONG_WIDTH)


def _exports(text: str) -> list[str]:
    """Files that a value of ``--export`` names."""
    from ..base.errors import InputError, nearest

    made: list[str] = []
    for name in (word.strip() for word in text.split(",") if word.strip() not in ("", REXS)):
        if name not in (*EXPORTS, *FILES):
            problem = f"must be {', '.join(EXPORTS)}, {REXS}, or a file of one gear, as pinion.dxf"
            raise InputError("--export", name, problem, nearest(name, FILES) or "--out names the folder")
        made += [file for file in FILES if name in (file, Path(file).suffix[1:])]
    return sorted(set(made))


def _export(path: Path, pair: GearPair, mesh: NamedMesh, folder: Path) -> None:
    """A gear in the form that the suffix names; its deviations are looked for in `folder`."""
    import numpy as np

    from ..base.files import write_csv
    from ..gears.geometry.outline import outline_columns, whole_outline
    from ..gears.teeth.gear_solid import write_solid
    from ..output.exchange.dxf import write_dxf

    gear = pair.pinion if path.stem == "pinion" else pair.wheel
    sides = _deviations(pair, path.stem, mesh, folder)
    if path.suffix == ".csv":
        columns = outline_columns(gear)
        write_csv(path, columns if not mesh.deviates else _with_deviations(columns, gear, sides))
    elif path.suffix == ".dxf":
        held = "rim" if gear.internal else "bore"
        radii = {held: 1e3 * gear.held_radius, "reference_circle": 0.5e3 * gear.pitch_diameter}
        radii["base_circle"] = 1e3 * gear.base_radius
        teeth = whole_outline(gear, sides, per_piece=100)
        write_dxf(path, {"outline": 1e3 * np.concatenate([p.points[:-1] for tooth in teeth for p in tooth])}, radii)
    else:
        write_solid(path, gear, sides)


def _deviations(pair: GearPair, name: str, mesh: NamedMesh, folder: Path) -> tuple[ToothDeviations, ToothDeviations]:
    """Deviations of the left and the right flanks of a gear."""
    from ..gears.geometry.deviation_job import GEARS, FlankOf, flank_deviations
    from ..gears.geometry.face import NOMINAL

    if not mesh.deviates:
        return NOMINAL
    number = GEARS.index(name)
    left, right = (flank_deviations(FlankOf(mesh, pair, number, side, folder)) for side in ("left", "right"))
    return left, right


def _with_deviations(
    columns: dict[str, Any], gear: Gear, sides: tuple[ToothDeviations, ToothDeviations]
) -> dict[str, Any]:
    """The outline with the deviations of tooth 0 on its involutes, along the normals (um)."""
    import numpy as np

    roll = gear.sign * 1e-3 * np.sqrt(np.maximum(columns["radius_mm"] ** 2 - (1e3 * gear.base_radius) ** 2, 0.0))
    made = np.full(len(roll), np.nan)
    for side, own in zip(("left", "right"), sides, strict=True):
        curve = own.profiles[own.profile[0]]
        there = columns["piece"] == f"involute_{side}"
        made[there] = 0.0 if curve is None else 1e6 * curve.at(roll[there])[0]
    return {**columns, "deviation_um": made}


def _notes(geometry: dict[str, Any]) -> str:
    helix = {}
    if "helix_angle_deg" in geometry:
        names = ("overlap ratio", "total contact ratio")
        helix = {name: f"{geometry[name.replace(' ', '_')]:.4g}" for name in names}
    rows = {
        "centre distance": f"{geometry['centre_distance_mm']:.6g} mm",
        "working pressure angle": f"{geometry['working_pressure_angle_deg']:.5g}°",
        "contact ratio": f"{geometry['contact_ratio']:.4g}",
        "  between tip rounds": f"{geometry['contact_ratio_active']:.4g}",
        "  between reliefs": f"{geometry['contact_ratio_effective']:.4g}",
        **helix,
        "backlash j_wt": f"{geometry['backlash_mm']:.4g} mm",
    }
    return "\n".join(f"{name:<23}{value}" for name, value in rows.items())


def _show(values: dict[str, Any], indent: str = "") -> None:
    for name, value in values.items():
        if isinstance(value, dict):
            print(f"{indent}{name}")
            _show(value, indent + "  ")
            continue
        several = value if isinstance(value, (list, tuple)) else [value]
        texts = [f"{one:.7g}" if isinstance(one, float) else str(one) for one in several]
        print(f"{indent}{name:<{34 - len(indent)}} {', '.join(texts):<14} {SYMBOLS.get(name, '')}".rstrip())
