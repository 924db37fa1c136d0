"""Every reference there is, held against this program: published values, binary128, other programs, theory.

A row: what is compared, with what, the largest difference, what was promised for it (nan: nothing), how many values.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from gearfe.gears.gearmesh.sweep import sweep_stiffness
from gearfe.gears.rating.stiffness import mesh_stiffness, single_stiffness
from gearfe.multibody import integrate
from tests.makers.housing_meshes import reference_housing
from tests.places import DATA

from .mechanism_study import subject
from .record import Record
from .subject import given_file, reference_pair

#: Andrews' mechanism at 0.03 s: beta, Theta, gamma, Phi, delta, Omega, epsilon (IVP test set; Hairer & Wanner II,
#: VII.7).
ANDREWS_END = (
    15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304,
    0.5347301163226948, 1.048080741042263,
)  # fmt: skip
#: Positions where a pair of teeth comes or goes on the sharp 20/30 pair (deg); 10 deg: the end of a corner's contact.
CHANGES = (0.0, 9.0, 10.0, 17.0)
#: CalculiX 2.20 at 17 deg and 0.05 deg, corner strips of 0.01 mm (docs/development/verification.md) (N/m).
CALCULIX_17 = 1.5259e8


class Found(NamedTuple):
    """Largest difference, promise, number of values, note."""

    difference: float
    promised: float
    values: int
    note: str = ""


def run_references(record: Record) -> None:
    """The table of references."""
    table = record.table("references", "what", "reference")
    for what, reference, make in comparisons(record.quick):

        def row(make: Any = make) -> Mapping[str, Any]:
            return dict(make()._asdict())

        record.row(table, {"what": what, "reference": reference}, row)


def comparisons(quick: bool) -> Iterator[tuple[str, str, Any]]:
    """What, reference, and the function that compares."""
    yield "Andrews' mechanism: end state (rad)", "published (IVP test set)", andrews_end
    for tolerance in (1e-6,) if quick else (1e-9, 1e-12):
        what = f"Andrews' mechanism: seven angles over 0..0.03 s at tolerance {tolerance:g} (rad)"
        yield what, "binary128 trajectory", lambda t=tolerance: trajectory("andrews", t)
    if not quick:
        what = "slider crank: crank angle over 0..10 s through eleven folds at tolerance 1e-9 (rad)"
        yield what, "binary128 trajectory", lambda: trajectory("slider_crank", 1e-9)
    coarsen = 2.0 if quick else 1.0
    for plane, twist in (
        (("strain", 0.05),) if quick else (("strain", 0.05), ("stress", 0.05), ("strain", 0.01), ("strain", 0.5))
    ):
        for part in ("on the path",) if quick else ("on the path", "at pair changes"):
            what = f"mesh stiffness 20/30; plane {plane}; {twist:g} deg; {part}"
            yield what, "GetFEM 5.4.2 curve", lambda p=plane, t=twist, s=part: getfem_curve(p, t, s, coarsen, quick)
    if not quick:
        yield "mesh stiffness 20/30 at 17 deg (sharp corner)", "CalculiX 2.20, corner elements of 0.01 mm", calculix_17
        for mass in ("4-point", "exact"):
            for kind in ("fixed_interface", "rigid_bore"):
                what = f"housing: {kind.replace('_', '-')} frequencies; {mass} mass"
                yield what, "CalculiX 2.20 on the same mesh", lambda k=kind, m=mass: housing_frequencies(k, m)
    yield "peak pressure of one tooth pair in contact (12 deg)", "Hertz line contact", lambda: hertz(coarsen)
    yield "mean mesh stiffness 20/30", "ISO 6336 method B c_gamma", lambda: iso(coarsen, "mean")
    yield "stiffness of one tooth pair 20/30", "ISO 6336 method B c'", lambda: iso(coarsen, "single")
    yield "rigid-body motions of the curved second-order elements", "no strain (patch test)", lambda: patch("rigid")
    yield "uniform strain on a distorted mesh of a plane plate", "constant stress (patch test)", lambda: patch("strain")


def andrews_end() -> Found:
    """Our end state at 1e-12 (binary128 stands between: the published one is the less exact of the two)."""
    case = subject("andrews")
    made = integrate(case.system, [0.0, 0.03], tolerance=1e-12, start=case.start)
    a = made.q[-1, 2::3]
    end = np.array([a[0], a[1] - a[0], a[2], a[3] - a[4], a[4], a[5] - a[6], a[6]])
    off = float(np.abs(end - ANDREWS_END).max())
    truth = float(np.abs(np.array(ANDREWS_END) - case.truth[-1]).max())
    return Found(off, float("nan"), 7, f"the published state itself is {truth:.1e} off the binary128 one")


def trajectory(name: str, tolerance: float) -> Found:
    """Largest error over the run."""
    case = subject(name)
    made = integrate(case.system, case.times, tolerance=tolerance, start=case.start)
    promised = {"andrews": tolerance, "slider_crank": 1e-8}[name]
    return Found(case.error(made.q), promised, case.truth.size)


def getfem_curve(plane: Any, twist: float, part: str, coarsen: float, quick: bool) -> Found:
    """Largest relative difference of k_mesh on a part of the mesh cycle."""
    with given_file(DATA / "gear_pair_20_30.csv").open(newline="", encoding="utf-8") as stream:
        rows = [
            r for r in csv.DictReader(stream) if r["plane_state"] == f"plane_{plane}" and float(r["twist_deg"]) == twist
        ]
    angles = np.array([float(r["pinion_angle_deg"]) for r in rows])
    k = np.array([float(r["k_mesh_N_per_m"]) for r in rows])
    keep = np.isin(angles, CHANGES) == (part == "at pair changes")
    if quick:
        keep &= np.isin(angles, (4.0, 12.0))
    curve = sweep_stiffness(
        reference_pair(), twist=math.radians(twist), angles=np.radians(angles[keep]), plane=plane, coarsen=coarsen
    )
    off = np.abs(curve.k_mesh / k[keep] - 1.0)
    worst = int(np.argmax(off))
    trust = 1e-2 * float(rows[int(np.flatnonzero(keep)[worst])]["trust_percent"])
    note = f"worst at {angles[keep][worst]:g} deg, where the reference is trusted to {100 * trust:g} %"
    resolved = plane == "strain" and twist == 0.05
    promised = (1e-3, 2.5e-3)[part == "at pair changes"] if resolved else math.nan
    return Found(float(off[worst]), promised, int(keep.sum()), note)


def calculix_17() -> Found:
    """The position that reacts most to the elements at the corner."""
    curve = sweep_stiffness(reference_pair(), twist=math.radians(0.05), angles=[math.radians(17.0)])
    return Found(abs(float(curve.k_mesh[0]) / CALCULIX_17 - 1.0), 8e-3, 1, "docs/development/verification.md")


def housing_frequencies(kind: str, mass: str) -> Found:
    """Largest relative difference of the frequencies."""
    wanted = json.loads(given_file(DATA / "gearbox_housing.json").read_text(encoding="utf-8"))[f"{kind}_hz"]
    body = reference_housing(four_point=mass == "4-point").reduce(len(wanted) + 20, quasi_static=2)
    found = body.internal_hz if kind == "fixed_interface" else body.coupled.frequencies_hz
    off = np.abs(found[: len(wanted)] / np.array(wanted) - 1.0)
    note = "CalculiX integrates its mass with 4 points" if mass == "exact" else "printed with seven digits"
    return Found(float(off.max()), {"4-point": 5e-7, "exact": 1.3e-4}[mass], len(wanted), note)


def hertz(coarsen: float) -> Found:
    """Peak pressure against p0 = sqrt(F E*/(pi b R)), E* = E/(2 (1 - nu^2)), R from the roll lengths."""
    pair, angle = reference_pair(), math.radians(12.0)
    curve = sweep_stiffness(pair, twist=math.radians(0.05), angles=[angle], coarsen=coarsen, kinematics="small")
    force = float(curve.torque_wheel[0]) / pair.wheel.base_radius
    start = pair.path["B"]
    turned = (angle - start.pinion_angle) % pair.mesh_cycle
    one = start.pinion_roll + pair.pinion.base_radius * turned
    two = start.pinion_roll + start.wheel_roll - one
    radius = one * two / (one + two)
    modulus = 200e9 / (2.0 * (1.0 - 0.3**2))
    theory = math.sqrt(force * modulus / (math.pi * pair.pinion.face_width * radius))
    off = float(curve.peak_pressure[0]) / theory - 1.0
    half = 1e3 * math.sqrt(4.0 * force * radius / (math.pi * pair.pinion.face_width * modulus))
    note = f"{1e-6 * theory:.0f} MPa by theory, half width {half:.3f} mm; teeth are no half planes"
    return Found(abs(off), math.nan, 1, note)


def iso(coarsen: float, which: str) -> Found:
    """A level, no accuracy: the standard knows no bore, and the bore decides how soft the body below the teeth is."""
    pair = reference_pair()
    curve = sweep_stiffness(pair, twist=math.radians(0.05), coarsen=coarsen)
    per_width = curve.k_mesh / pair.pinion.face_width
    if which == "mean":
        theory, found = mesh_stiffness(pair, 200e9, 200e9), float(per_width.mean())
    else:
        theory = single_stiffness(pair, 200e9, 200e9)
        found = float(per_width[np.asarray(curve.teeth_in_contact) == 1].max())
    note = f"{1e-9 * found:.1f} against {1e-9 * theory:.1f} N/(mm um): a level only; the bore decides it"
    return Found(abs(found / theory - 1.0), math.nan, 1, note)


def patch(which: str) -> Found:
    """Elements with inner nodes anywhere: a linear displacement on the boundary is met inside, to rounding."""
    from gearfe.gears.teeth.tooth_sector import sector_mesh, sector_recipes

    pair = reference_pair()
    mesh = sector_mesh(pair.pinion, sector_recipes(pair, coarsen=4.0)[0])
    return _patch(mesh.points, mesh.triangles, which)


def _patch(points: np.ndarray, triangles: np.ndarray, which: str) -> Found:
    from scipy.sparse.linalg import spsolve
    from skfem import CellBasis, ElementTriP2, ElementVector, MeshTri, MeshTri2

    from gearfe.fem.plane import Material
    from gearfe.gears.contact.whole_gears.bodies import stiffness_form

    if which == "strain":  # straight sides, distorted inside: second-order elements hold linear fields exactly there
        mesh: Any = MeshTri.init_tensor(np.linspace(0, 1, 5) ** 1.3, np.linspace(0, 1, 5) ** 0.8)
        shape = np.array([[1e-3, 2e-4], [-3e-4, 5e-4]])
    else:
        mesh = MeshTri2(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))
        shape = np.array([[0.0, -1e-3], [1e-3, 0.0]])
    basis = CellBasis(mesh, ElementVector(ElementTriP2()), intorder=6)
    stiffness = stiffness_form(Material(), "strain", 1.0).assemble(basis).tocsr()
    wanted = basis.project(lambda x: np.einsum("ij,jkl->ikl", shape, x))
    edge = basis.get_dofs().all()
    inner = np.setdiff1d(np.arange(basis.N), edge)
    found = wanted.copy()
    found[inner] = spsolve(stiffness[inner][:, inner].tocsc(), -stiffness[inner][:, edge] @ wanted[edge])
    return Found(float(np.abs(found - wanted).max() / np.abs(wanted).max()), 1e-10, len(inner))
