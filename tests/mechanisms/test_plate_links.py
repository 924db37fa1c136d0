"""Links of plane finite elements: closed forms, a full mesh assembled by scikit-fem, beam links, and wrong files."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse
import skfem
from scipy.sparse.linalg import eigsh
from skfem.helpers import ddot, dot, eye, sym_grad, trace

from gearfe.base.errors import InputError
from gearfe.base.tables.mechanism import BodyTable
from gearfe.base.tables.plate import InterfaceTable, PlateTable
from gearfe.cli.main import main
from gearfe.fem.meshing.plate_mesh import mesh_outline
from gearfe.fem.plane import Material
from gearfe.fem.reduction.plate import Interface, Plate, reduce_plate
from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.mechanisms.plates import PlateLink, PlatePart, _reduced, floating_body, part_of_plate
from gearfe.multibody import (
    Body,
    Fixed,
    Gravity,
    Hinge,
    Linkage,
    PointForce,
    Prescribed,
    System,
    consistent_start,
    constant,
    integrate,
    smoothed_step,
)
from gearfe.multibody.core.equilibrium import equilibrium
from gearfe.multibody.core.modes import modes
from gearfe.multibody.planar.beam import Beam
from gearfe.multibody.planar.beam_link import BeamLink, Section
from gearfe.multibody.planar.floating import Floating, frame_joint
from gearfe.multibody.planar.turning import TurningFrame
from tests.makers.elastica import elastica
from tests.makers.files import mechanism_file
from tests.places import GEOMETRY

#: An arm 0.2 m long, held at both ends.
COARSE: dict[str, Any] = {
    "interfaces": {
        "left": InterfaceTable(edge_m=((0.0, -0.01), (0.0, 0.01))),
        "right": InterfaceTable(edge_m=((0.2, -0.01), (0.2, 0.01))),
    },
    "thickness_m": 0.01,
    "youngs_modulus_GPa": 200.0,
    "density_kg_per_m3": 7850.0,
    "outline_m": ((0.0, -0.01), (0.2, -0.01), (0.2, 0.01), (0.0, 0.01)),
    "element_size_m": 0.02,
    "modes": 2,
}


def bar(height: float, count: int, material: Material, length: float = 1.0, across: int = 1) -> Plate:
    """A bar along x whose two ends are interfaces, of unit thickness."""
    h = 0.5 * height
    mesh = mesh_outline([(0.0, -h), (length, -h), (length, h), (0.0, h)], [], height / across)
    ends = [Interface(np.array([x, 0.0]), np.flatnonzero(np.abs(mesh.points[:, 0] - x) < 1e-9)) for x in (0.0, length)]
    return reduce_plate(*mesh, 1.0, material, ends, count)


def made(plate: Plate, joints=(), forces=(), pose=(0.0, 0.0, 0.0), speed=(0.0, 0.0, 0.0), damping=0.0) -> System:  # type: ignore[no-untyped-def]
    names = [f"rod{k}" for k in range(len(plate.centres))]
    turn = np.exp(1j * pose[2])
    places = [complex(*pose[:2]) + turn * z for z in plate.centres]
    speeds = [complex(*speed[:2]) + 1j * speed[2] * turn * z for z in plate.centres]
    nodes = [
        Body(n, 0.0, 0.0, position=(z.real, z.imag), angle=pose[2], velocity=(v.real, v.imag), rate=speed[2])
        for n, z, v in zip(names, places, speeds, strict=True)
    ]
    linkage = Linkage(tuple(nodes), tuple(joints), tuple(forces))
    element = Floating(floating_body(plate, damping), linkage, "rod", pose, speed)
    return System([linkage, element, frame_joint(element, linkage, names)])


def element_of(system: System) -> Floating:
    element = system.elements[1]
    assert isinstance(element, Floating)
    return element


@pytest.fixture(scope="module")
def slender() -> Plate:
    """1 m x 10 mm without transverse contraction."""
    return bar(0.01, 4, Material(2e11, 0.0, density=7850.0))


@pytest.mark.parametrize(("load", "bound"), [(0.1, 1e-5), (0.5, 2e-5), (1.0, 5e-5)])
def test_an_end_force_bends_a_clamped_bar_into_the_elastica(slender: Plate, load: float, bound: float) -> None:
    """P L^2/EI = 1 deflects the tip by 0.3 of the length and turns it by 26 degrees. Shear adds 0.6 (h/L)^2 of that."""
    stiff = 2e11 * 0.01**3 / 12
    system = made(slender, [Fixed("rod0")], [PointForce("rod1", y=constant(load * stiff))])
    found = equilibrium(system, consistent_start(system)).q[3:6]
    assert np.abs(found - elastica(load)).max() < bound


def full_frequencies(length: float, height: float, material: Material, count: int) -> np.ndarray:
    """Plane stress by scikit-fem on a fine mesh of its own; x = 0 is held, the section at the tip stays plane (Hz)."""
    lam, mu = material.lame("stress")
    mesh = skfem.MeshTri.init_tensor(np.linspace(0, length, 161), np.linspace(-height / 2, height / 2, 5))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP2()))

    @skfem.BilinearForm
    def stiffness(u: Any, v: Any, _: Any) -> Any:
        strain = sym_grad(u)
        return ddot(2.0 * mu * strain + lam * eye(trace(strain), 2), sym_grad(v))

    @skfem.BilinearForm
    def mass(u: Any, v: Any, _: Any) -> Any:
        return material.density * dot(u, v)

    x, y = basis.doflocs
    across = np.isin(np.arange(basis.N), basis.split_indices()[1])
    tip, free = np.abs(x - length) < 1e-9, np.flatnonzero((x > 1e-9) & (np.abs(x - length) > 1e-9))
    T = scipy.sparse.lil_matrix((basis.N, len(free) + 3))
    T[free, np.arange(len(free))] = 1.0
    along = np.flatnonzero(tip & ~across)
    T[along, len(free)], T[along, len(free) + 1] = 1.0, -y[along]
    T[np.flatnonzero(tip & across), len(free) + 2] = 1.0
    T = T.tocsr()
    K, M = T.T @ stiffness.assemble(basis) @ T, T.T @ mass.assemble(basis) @ T
    return np.sqrt(np.sort(eigsh(K, count, M, sigma=0.0, return_eigenvectors=False))) / (2 * np.pi)


def test_frequencies_of_a_cantilever_are_those_of_the_full_mesh_and_of_theory(slender: Plate) -> None:
    system = made(slender, [Fixed("rod0")])
    start = consistent_start(system)
    found = modes(system, start, equilibrium(system, start), 3).frequencies
    thin = np.array([1.875104068711961, 4.694091132974174, 7.854757438237613]) ** 2  # Euler and Bernoulli
    expected = thin * math.sqrt(2e11 * 0.01**2 / 12 / 7850.0) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=2e-3)  # shear and turning inertia lower the third by 1.6e-3
    full = full_frequencies(1.0, 0.01, Material(2e11, 0.0, density=7850.0), 3)
    np.testing.assert_allclose(found, full, rtol=1e-4)


def test_frequencies_fall_to_those_of_the_full_mesh_as_modes_are_added() -> None:
    """A stubby cantilever: what is left of its second frequency, from above, with a rate."""
    material = Material(2e11, 0.3, density=7850.0)
    many = bar(0.1, 24, material, across=4)
    full = full_frequencies(1.0, 0.1, material, 5)
    np.testing.assert_allclose(many.frequencies[:4], full[:4], rtol=3e-4)
    counts = (1, 3, 6)
    off = [bar(0.1, count, material, across=4).frequencies[1] / many.frequencies[1] - 1.0 for count in counts]
    assert min(off) > 0.0
    assert off[0] < 1e-4
    assert np.polyfit(np.log(counts), np.log(off), 1)[0] < -2.0


def test_extension_of_a_rotating_bar(slender: Plate) -> None:
    """rho w^2 L^3/(3 E), and the energy of the force rho A w^2 (L^2 - s^2)/2."""
    omega = 100.0
    system = made(slender, [Fixed("rod0")], [TurningFrame(omega)])
    start = consistent_start(system)
    rest = equilibrium(system, start)
    assert rest.q[3] - 1.0 == pytest.approx(7850.0 * omega**2 / (3 * 2e11), rel=1e-3)
    stretched = element_of(system).elastic_energy(rest.q[6:])
    # E A/2 int (rho w^2 (L^2 - s^2) / 2E)^2 ds = A rho^2 w^4 L^5 / (15 E)
    assert stretched == pytest.approx(0.01 * 7850.0**2 * omega**4 / (15 * 2e11), rel=2e-3)


@pytest.mark.parametrize(("speed", "out_of_plane"), [(1.0, (3.6816, 22.1810)), (10.0, (11.2023, 33.6404))])
def test_a_rotating_bar_stiffens(slender: Plate, speed: float, out_of_plane: tuple[float, float]) -> None:
    """Wright, Smith, Thresher & Wang, J. Appl. Mech. 49 (1982) 197-202: in the plane w^2 = w_out^2 - Omega^2."""
    unit = math.sqrt(2e11 * 0.01**2 / 12 / 7850.0)
    system = made(slender, [Fixed("rod0")], [TurningFrame(speed * unit)])
    start = consistent_start(system)
    found = modes(system, start, equilibrium(system, start), 2).frequencies
    expected = np.sqrt(np.array(out_of_plane) ** 2 - speed**2)
    np.testing.assert_allclose(2 * math.pi * found / unit, expected, rtol=1.5e-3)


def test_spin_up_moves_the_tip_as_that_of_a_beam_link() -> None:
    """Simo & Vu-Quoc's bar (EA = 2.8e7 N, EI = 1.4e4 N m2, 1.2 kg/m, 10 m) to 6 rad/s within 15 s: the tip stays 0.5 m
    behind, and comes back."""
    height = math.sqrt(12 * 1.4e4 / 2.8e7)
    material = Material(2.8e7 / height, 0.0, density=1.2 / height)
    motion = Prescribed("rod0", "rate", smoothed_step(7.5, 15.0, 6.0))
    times = np.linspace(0.0, 16.0, 33)
    system = made(bar(height, 2, material, 10.0), [Hinge("rod0", "ground"), motion])
    run = integrate(system, times, tolerance=1e-4)
    assert run.method == "implicit"
    link = BeamLink(
        "rod0", 10.0, Section.rectangle(1.0, height), material.youngs_modulus, material.density, poisson_ratio=0.0
    )
    linkage = Linkage(link.nodes(), (Hinge("rod0", "ground"), motion))
    beam = integrate(System([linkage, Beam(linkage, link)]), times, tolerance=1e-5)
    assert np.abs(run.q[:, 3:5] - beam.q[:, -3:-1]).max() < 1e-4 * 10.0


def test_a_rigid_motion_leaves_no_strain_and_its_energy_is_that_of_the_rigid_body(slender: Plate) -> None:
    system = made(slender, pose=(2.0, -1.0, 0.7), speed=(3.0, 1.0, 5.0))
    element = element_of(system)
    assert np.abs(system.residual(0.0, system.start_q)).max() < 1e-12
    assert element.elastic_energy(system.start_q[6:]) == 0.0
    mass, inertia = 7850.0 * 0.01, 7850.0 * 0.01 * (1.0 + 0.01**2) / 12
    kinetic = 0.5 * mass * ((3.0 - 2.5 * math.sin(0.7)) ** 2 + (1.0 + 2.5 * math.cos(0.7)) ** 2) + 0.5 * inertia * 25.0
    assert system.energy(system.start_q, system.start_v)[0] == pytest.approx(kinetic, rel=1e-9)
    assert slender.mass == pytest.approx(mass, rel=1e-12)
    assert slender.centre == pytest.approx(0.5, abs=1e-12)
    assert slender.inertia == pytest.approx(inertia, rel=1e-9)


def test_derivatives_of_the_force() -> None:
    """Of the force by differences; of the energy: the force without rates; turning and weight are in both."""
    plate = bar(0.1, 1, Material(10.0, 0.3, density=1.0))
    system = made(plate, forces=[Gravity((1.0, -9.81)), TurningFrame(0.7)], damping=0.3)
    element = element_of(system)
    rng = np.random.default_rng(1)
    q, v = element.start()[0] + 0.1 * rng.standard_normal(element.size), rng.standard_normal(element.size)
    steps = 1e-6 * np.eye(element.size)
    by_q, by_v = element.force_jacobian(0.0, q, v)
    for j, step in enumerate(steps):
        for given, ends in (
            (by_q, [element.force(0.0, q + s * step, v) for s in (1.0, -1.0)]),
            (by_v, [element.force(0.0, q, v + s * step) for s in (1.0, -1.0)]),
        ):
            np.testing.assert_allclose(given[:, j], (ends[0] - ends[1]) / 2e-6, rtol=1e-6, atol=1e-6)
        slope = -(element.potential(q + step) - element.potential(q - step)) / 2e-6
        assert element.force(0.0, q, 0.0 * v)[j] == pytest.approx(slope, rel=1e-6, abs=1e-6)
    damped = element.force(0.0, q, v) - element.force(0.0, q, 0.0 * v)
    swing = 0.7 * 2.0 * v @ element.mass() @ np.kron(np.eye(element.size // 2), [[0.0, 1.0], [-1.0, 0.0]]) @ v
    assert element.loss(q, v) == pytest.approx(swing - damped @ v, rel=1e-10)  # Coriolis forces do no work
    many = np.stack([q, v, q - v]), np.stack([v, q, q])
    np.testing.assert_allclose(element.potential(many[0]), [element.potential(a) for a in many[0]], rtol=1e-12)
    np.testing.assert_allclose(
        element.loss(*many), [element.loss(*pair) for pair in zip(*many, strict=True)], rtol=1e-12
    )


# mechanism files -------------------------------------------------------------------------------------------------

ARM = """
[run]
end_s = 0.2
step_s = 0.01
frames = 5
[bodies.arm]
points_m = { lug = [1.0, 0.004] }
[bodies.arm.plate]
outline_m = [[0.0, -0.01], [1.0, -0.01], [1.0, 0.01], [0.0, 0.01]]
thickness_m = 0.02
youngs_modulus_GPa = 2.0
poisson_ratio = 0.0
density_kg_per_m3 = 1000.0
damping_s = 0.1
modes = 2
frame = "start"
[bodies.arm.plate.interfaces.root]
edge_m = [[0.0, -0.01], [0.0, 0.01]]
[bodies.arm.plate.interfaces.tip]
edge_m = [[1.0, -0.01], [1.0, 0.01]]
[joints.clamp]
type = "fixed"
body = "arm"
[forces.load]
type = "force"
body = "arm"
point = "tip"
y_N = { step = 1.0, step_centre_s = 0.05, step_width_s = 0.1 }
[[outputs]]
name = "deflection_m"
value = "deflection(arm.tip)"
[[outputs]]
name = "stress_Pa"
value = "largest_von_mises(arm)"
[[outputs]]
name = "angle_rad"
value = "angle(arm.tip) - angle(arm)"
[[outputs]]
name = "energy_J"
value = "elastic_energy(arm)"
[[outputs]]
name = "lug_m"
value = "x(arm.lug) - x(arm.tip)"
"""


def test_a_cantilever_with_an_end_load_creeps_to_its_static_state(tmp_path: Path) -> None:
    """P L^3/(3 EI), P L^2/(2 EI), P L e/I at the clamped edge; work, loss and energies balance."""
    second = 0.02**4 / 12
    slope = 1.0 / (2e9 * second)
    mechanism = load_mechanism(mechanism_file(tmp_path, ARM.replace("end_s = 0.2", "end_s = 3.0")))
    run = integrate(mechanism.system, np.linspace(0.0, 3.0, 61), start=mechanism.start(), tolerance=1e-6)
    results = evaluate(mechanism, run)
    found = {k: v[-1] for k, v in results.outputs.items()}
    assert found["deflection_m"] == pytest.approx(slope / 3.0, rel=1e-3)
    assert found["angle_rad"] == pytest.approx(slope / 2.0, rel=1e-3)
    assert found["stress_Pa"] == pytest.approx(0.01 / second, rel=0.02)  # at the nodes of the mesh
    assert found["energy_J"] == pytest.approx(0.5 * slope / 3.0, rel=2e-3)
    assert found["lug_m"] == pytest.approx(-0.004 * math.sin(slope / 2.0), rel=1e-3)
    assert np.abs(results.energy["total_J"]).max() < 2e-3 * results.energy["work_J"].max()


def test_modes_equilibrium_and_a_mesh_file(tmp_path: Path) -> None:
    """The same arm from triangles of the first order in millimetres hangs and vibrates as theory says."""
    import meshio

    mesh = mesh_outline([(0.0, -0.01), (1.0, -0.01), (1.0, 0.01), (0.0, 0.01)], [], 0.02)
    points = np.column_stack([1e3 * mesh.points, np.zeros(len(mesh.points))])
    meshio.write_points_cells(tmp_path / "arm.vtu", points, {"triangle": mesh.triangles[:, :3]})
    text = ARM.replace(
        "outline_m = [[0.0, -0.01], [1.0, -0.01], [1.0, 0.01], [0.0, 0.01]]", 'mesh = "arm.vtu"\nmesh_unit_m = 0.001'
    )
    text = text.replace("y_N = { step = 1.0, step_centre_s = 0.05, step_width_s = 0.1 }", "y_N = 1.0")
    text = text.replace("damping_s = 0.1", "damping_s = 0.0")
    out = tmp_path / "out"
    command = [
        "mechanism",
        str(mechanism_file(tmp_path, text)),
        "--out",
        str(out),
        "--analysis",
        "modes",
        "--modes",
        "2",
    ]
    assert main(command) == 0
    summary = json.loads((out / "summary.json").read_text())
    second = 0.02**4 / 12
    assert summary["outputs"]["deflection_m"] == pytest.approx(1.0 / (3 * 2e9 * second), rel=1e-3)
    expected = 1.875104068711961**2 * math.sqrt(2e9 * second / 0.4) / (2 * math.pi)
    assert summary["frequencies_Hz"][0] == pytest.approx(expected, rel=2e-3)  # deflected by 1 % of the length
    assert {"plates.csv", "plates.vtkhdf", "plates.png", "modes.png"} <= {p.name for p in out.iterdir()}


def test_flexible_false_is_the_rigid_link(tmp_path: Path) -> None:
    text = ARM.replace("[bodies.arm]", "[bodies.arm]\nflexible = false").split("[[outputs]]")[0]
    mechanism = load_mechanism(mechanism_file(tmp_path, text.replace('"fixed"', '"hinge"')))
    body = mechanism.linkage.bodies[0]
    assert not mechanism.elastic
    assert body.mass == pytest.approx(0.4)
    assert body.inertia == pytest.approx(0.4 * (1.0 + 0.02**2) / 12)
    assert body.centre == pytest.approx((0.5, 0.0), abs=1e-12)


def test_the_shipped_coupler_runs_and_writes_its_files(tmp_path: Path) -> None:
    """Bodies at the interfaces stand where the mesh does; a stiff coupler moves the tool as a rigid one."""
    out = tmp_path / "out"
    job = str(GEOMETRY / "elastic_coupler.toml")
    assert main(["mechanism", job, "--out", str(out), "--until", "0.01", "--no-estimate"]) == 0
    assert {"plates.csv", "plates.vtkhdf", "plates.png", "picture.png"} <= {p.name for p in out.iterdir()}
    with (out / "plates.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["point"] for row in rows} == {"A", "B", "P"}
    h5py = pytest.importorskip("h5py")
    with h5py.File(out / "plates.vtkhdf") as file:
        points = file["VTKHDF/Points"][:]
        stress = file["VTKHDF/PointData/von_mises_Pa"][:]
    nodes = json.loads((out / "summary.json").read_text())["flexible_links"][0]["nodes"]
    assert len(points) == 100 * nodes == len(stress)
    last = {row["point"]: np.array([float(row["x_m"]), float(row["y_m"])]) for row in rows if row["time_s"] == "0.01"}
    for place in last.values():  # the edge of the hole is 6 mm from the hinge
        assert np.hypot(*(points[-nodes:, :2] - place).T).min() == pytest.approx(0.006, rel=1e-4)
    text = Path(job).read_text(encoding="utf-8")
    text = text.partition('[[outputs]]\nname = "apex')[0]
    stiff = mechanism_file(tmp_path, text.replace("youngs_modulus_GPa = 70.0", "youngs_modulus_GPa = 7e4"))
    rigid = mechanism_file(out, text.replace("angle_deg = 18.0", "angle_deg = 18.0\nflexible = false"))
    tools = []
    for path in (stiff, rigid):
        mechanism = load_mechanism(path)
        run = integrate(mechanism.system, [0.0, 0.03], start=mechanism.start(), tolerance=1e-7)
        tools.append(evaluate(mechanism, run).outputs)
    assert tools[0]["tool_x_m"][-1] == pytest.approx(tools[1]["tool_x_m"][-1], abs=2e-6)
    assert tools[0]["tool_y_m"][-1] == pytest.approx(tools[1]["tool_y_m"][-1], abs=2e-6)


def test_the_frame_may_go_with_any_interface(tmp_path: Path) -> None:
    """The same motion whichever interface is the first: what is reduced differs, what it stands for does not."""
    text = (GEOMETRY / "elastic_coupler.toml").read_text(encoding="utf-8")
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("A = {"))
    turned = [*lines[:first], lines[first + 2], lines[first + 1], lines[first], *lines[first + 3 :]]
    found = []
    for given in (lines, turned):
        mechanism = load_mechanism(mechanism_file(tmp_path, "\n".join(given)))
        run = integrate(mechanism.system, [0.0, 0.03, 0.05], start=mechanism.start(), tolerance=1e-6)
        found.append(evaluate(mechanism, run).outputs)
    assert found[0]["largest_stress_MPa"].max() > 5.0
    assert found[0]["tool_x_m"] == pytest.approx(found[1]["tool_x_m"], abs=1e-6)
    assert found[0]["tool_y_m"] == pytest.approx(found[1]["tool_y_m"], abs=1e-6)
    assert found[0]["largest_stress_MPa"][1:] == pytest.approx(found[1]["largest_stress_MPa"][1:], rel=0.01)


def test_a_stiff_pendulum_on_one_interface_is_the_rigid_one(tmp_path: Path) -> None:
    text = """
[run]
end_s = 0.3
step_s = 0.01
[bodies.arm]
angle_deg = -30.0
[bodies.arm.plate]
outline_m = [[-0.02, -0.02], [0.5, -0.01], [0.5, 0.01], [-0.02, 0.02]]
thickness_m = 0.01
youngs_modulus_GPa = 200.0
density_kg_per_m3 = 7850.0
damping_s = 1e-4
modes = 1
interfaces = { O = { centre_m = [0.0, 0.0], radius_m = 0.008 } }
[joints.O]
type = "hinge"
body = "arm"
[forces.weight]
type = "gravity"
acceleration_m_per_s2 = [0.0, -9.81]
[[outputs]]
name = "angle_rad"
value = "angle(arm)"
"""
    angles = []
    for made_of in (text, text.replace("[bodies.arm]", "[bodies.arm]\nflexible = false")):
        mechanism = load_mechanism(mechanism_file(tmp_path, made_of))
        run = integrate(mechanism.system, [0.0, 0.1, 0.3], start=mechanism.start(), tolerance=1e-6)
        angles.append(evaluate(mechanism, run).outputs["angle_rad"])
    assert angles[0] == pytest.approx(angles[1], abs=2e-5)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("[1.0, 0.01], [0.0, 0.01]]", "[0.0, 0.01], [1.0, 0.01]]", "crosses itself"),
        ("outline_m = [[0.0, -0.01], [1.0, -0.01], [1.0, 0.01], [0.0, 0.01]]", "", "has no shape"),
        ("outline_m = [", 'mesh = "arm.msh"\noutline_m = [', "two shapes"),
        ("outline_m = [[0.0, -0.01], [1.0, -0.01], [1.0, 0.01], [0.0, 0.01]]", 'mesh = "no.msh"', "no such file"),
        ("outline_m = [[0.0, -0.01], [1.0, -0.01], [1.0, 0.01], [0.0, 0.01]]", "outline_m = [[0, 0], [1, 0]]", "three"),
        ("youngs_modulus_GPa = 2.0\n", "", "youngs_modulus_GPa"),
        ("density_kg_per_m3 = 1000.0", "density_kg_per_m3 = -1.0", "density_kg_per_m3"),
        ("thickness_m = 0.02", "thickness_m = 0.0", "thickness_m"),
        ("lug = [1.0, 0.004]", "lug = [0.5, 0.004]", "lies on no interface"),
        ('point = "tip"', "point = [0.3, 0.0]", "lies on no interface"),
        ("edge_m = [[1.0, -0.01], [1.0, 0.01]]", "edge_m = [[0.7, 0.5], [0.9, 0.5]]", "0 nodes of the mesh"),
        ("edge_m = [[1.0, -0.01], [1.0, 0.01]]", "edge_m = [[0.0, 0.0], [0.0, 0.01]]", "shares nodes"),
        ("edge_m = [[1.0, -0.01], [1.0, 0.01]]", "centre_m = [0.995, 0.0]\nradius_m = 0.02", "inside of the outline"),
        ("edge_m = [[1.0, -0.01], [1.0, 0.01]]", "radius_m = 0.02", "centre_m"),
        ("modes = 2", "modes = 2\nholes_m = [[0.5, 0.0, 0.004], [0.505, 0.0, 0.004]]", "meets"),
        ("modes = 2", "modes = 0", "modes"),
        ("modes = 2", "modes = 40\nelement_size_m = 0.3", "too many for a mesh"),
        ("[bodies.arm.plate]", "[bodies.arm.beam]\nlength_m = 1.0\n[bodies.arm.plate]", "youngs_modulus_GPa"),
        ("[bodies.arm]", "[bodies.arm]\nmass_kg = 1.0", "follows from the plate"),
        ("deflection(arm.tip)", "bending_moment(arm.tip)", "is no beam"),
        ("deflection(arm.tip)", "deflection(arm.top)", "top"),
        ('body = "arm"\npoint', 'body = "arm.end"\npoint', "arm.end"),
    ],
)
def test_wrong_files(tmp_path: Path, old: str, new: str, text: str) -> None:
    assert old in ARM
    with pytest.raises(InputError, match=text):
        load_mechanism(mechanism_file(tmp_path, ARM.replace(old, new, 1)))


@pytest.mark.parametrize(("modulus", "told"), [("2.1e11", True), ("2.1e5", True), ("1100.0", False)])
def test_a_modulus_in_another_unit_is_told_before_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture, modulus: str, told: bool
) -> None:
    """Pa or MPa of steel taken as GPa make sound 1.6e8 and 1.6e5 m/s fast, beyond 36.1 km/s; diamond's does not."""
    old = re.search(r"youngs_modulus_GPa = .*", ARM)
    assert old is not None
    steel = ARM.replace("density_kg_per_m3 = 1000.0", "density_kg_per_m3 = 7850.0")
    path = mechanism_file(tmp_path, steel.replace(old[0], f"youngs_modulus_GPa = {modulus}"))
    assert main(["mechanism", str(path), "--out", str(tmp_path / "out"), "--analysis", "modes", "--no-pictures"]) == 0
    assert (".plate.youngs_modulus_GPa" in capsys.readouterr().err) is told


def test_methods_with_tiny_steps_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = mechanism_file(tmp_path, ARM)
    assert main(["mechanism", str(path), "--out", str(tmp_path / "out"), "--method", "taylor"]) == 2
    assert "flexible links" in capsys.readouterr().err


def test_a_stored_plate_is_the_reduced_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second process reads it; another table or another text of the mesh file has an entry of its own."""
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path / "cache"))
    table, folder = PlateTable(**COARSE), tmp_path
    _reduced.cache_clear()
    first = part_of_plate("arm", BodyTable(plate=table), folder).plate
    _reduced.cache_clear()
    monkeypatch.setattr("gearfe.fem.reduction.plate.reduce_plate", None)
    second = part_of_plate("arm", BodyTable(plate=table), folder).plate
    for own in fields(Plate):
        np.testing.assert_array_equal(getattr(second, own.name), getattr(first, own.name))
        assert type(getattr(second, own.name)) is type(getattr(first, own.name))
    monkeypatch.undo()
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path / "cache"))
    part_of_plate("arm", BodyTable(plate=replace(table, thickness_m=0.02)), folder)
    turned = replace(table, interfaces=dict(reversed(table.interfaces.items())))
    assert part_of_plate("arm", BodyTable(plate=turned), folder).plate.centres[0] == pytest.approx(0.2)
    assert len(list((tmp_path / "cache").glob("plate-*"))) == 3
    _reduced.cache_clear()


def test_a_file_that_the_mesh_includes_is_in_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two triangles of an Abaqus file whose nodes stand in another one, which becomes narrower."""
    monkeypatch.setenv("GEARFE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "m.inp").write_text(
        "*INCLUDE, INPUT=n.inp\n*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n2, 1, 3, 4\n3, 2, 5, 6\n4, 2, 6, 3\n", encoding="utf-8"
    )
    table = replace(PlateTable(**COARSE), outline_m=None, element_size_m=None, mesh="m.inp", modes=1)
    masses = []
    for height in (0.02, 0.01):
        nodes = ((0, 0), (0.1, 0), (0.1, height), (0, height), (0.2, 0), (0.2, height))
        lines = [f"{k}, {x}, {y - 0.5 * height}\n" for k, (x, y) in enumerate(nodes, start=1)]
        (tmp_path / "n.inp").write_text("*NODE\n" + "".join(lines), encoding="utf-8")
        _reduced.cache_clear()
        masses.append(part_of_plate("arm", BodyTable(plate=table), tmp_path).plate.mass)
    _reduced.cache_clear()
    assert masses[1] == pytest.approx(0.5 * masses[0], rel=1e-9)


def test_nodal_stresses_of_many_times_are_those_of_each(slender: Plate) -> None:
    part = PlatePart("rod", PlateTable(**COARSE), slender, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    link = PlateLink(part, None, None, {}, slice(0, 0), np.zeros((2, 3), dtype=np.int64))  # type: ignore[arg-type]
    stress = np.random.default_rng(1).standard_normal((150, slender.stresses.shape[2]))
    nodal = np.einsum("ncs,ts->tnc", slender.stresses, stress)
    np.testing.assert_allclose(link.nodal_stresses(stress), nodal, rtol=1e-9, atol=1e-12 * np.abs(nodal).max())
    xx, yy, xy = np.moveaxis(nodal, -1, 0)
    largest = np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2).max(axis=1)
    np.testing.assert_allclose(link.largest_von_mises(stress), largest, rtol=1e-12)
