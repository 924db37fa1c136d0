"""Craig-Bampton with corrections: exact statics, exact bending, frequencies from above, bounds that bound."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from gearfe.base.errors import InputError
from gearfe.drivetrain.housing.attachments import Attachment, Plane
from gearfe.drivetrain.housing.model import Housing
from gearfe.fem.plane import Material
from gearfe.fem.reduction.craig_bampton import reduce_model
from gearfe.fem.reduction.error import reduction_error
from gearfe.fem.reduction.modal_body import ModalBody
from tests.makers.full_model import full_model
from tests.makers.housing_meshes import box
from tests.makers.newmark import newmark, smooth_ramp

SIZE = (0.4, 0.08, 0.06)
E, RHO = 200e9, 7850.0


def beam(nu: float = 0.3, cells: tuple[int, int, int] = (6, 2, 2), *, ends: int = 1, free: bool = False) -> Housing:
    """A beam along x, clamped at x = 0 unless free, rigid attachments at its right (and left) end."""
    nodes, tets = box(cells, SIZE)
    middle = np.array([0.0, SIZE[1] / 2, SIZE[2] / 2])
    names = ["right", "left"][:ends]
    places = [SIZE[0], 0.0][:ends]
    attachments = [
        Attachment(
            name, middle + np.array([x, 0, 0]), np.array([1.0, 0, 0]), np.flatnonzero(np.abs(nodes[:, 0] - x) < 1e-9)
        )
        for name, x in zip(names, places, strict=True)
    ]
    fixed = None if free or ends == 2 else Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    return Housing.from_arrays(nodes, tets, (), fixed, material=Material(E, nu, RHO), attachments=attachments)


@pytest.fixture(scope="module")
def body() -> ModalBody:
    return beam().reduce(6)


def test_beam_between_rigid_ends_bends_exactly() -> None:
    """Pure tension and bending of a bar with nu = 0 are exact in second-order elements: EA/L, M L/EI, M L^2/(2 EI)."""
    k = beam(nu=0.0, cells=(3, 1, 1)).reduce(0).stiffness[:6, :6]
    length, width, height = SIZE
    iy, iz, area = width * height**3 / 12, height * width**3 / 12, width * height
    flexibility = np.linalg.inv(k)
    assert flexibility[0, 0] == pytest.approx(length / (E * area), rel=1e-9)
    assert flexibility[4, 4] == pytest.approx(length / (E * iy), rel=1e-9)
    assert flexibility[5, 5] == pytest.approx(length / (E * iz), rel=1e-9)
    assert flexibility[2, 4] == pytest.approx(-(length**2) / (2 * E * iy), rel=1e-9)
    assert flexibility[1, 5] == pytest.approx(length**2 / (2 * E * iz), rel=1e-9)


def test_cantilever_under_a_transverse_force() -> None:
    """Timoshenko's beam, P L^3/(3 E I) + P L/(k G A) with k = 5/6; a slender bar, rigid end sections."""
    k = beam(nu=0.0, cells=(16, 2, 2)).reduce(0).stiffness[:6, :6]
    length, width, height = SIZE
    inertia, area = height * width**3 / 12, width * height
    theory = length**3 / (3 * E * inertia) + length / (5 / 6 * E / 2 * area)
    assert np.linalg.inv(k)[1, 1] == pytest.approx(theory, rel=2e-3)


def test_statics_are_those_of_the_full_model(body: ModalBody) -> None:
    full = full_model(beam())
    truth = full.static(np.eye(6))
    loads = np.zeros((body.size, 6))
    loads[:6] = np.eye(6)
    reduced = np.linalg.solve(body.stiffness, loads)
    scale = np.sqrt(np.outer(np.diag(truth[:6]), np.diag(truth[:6])))
    assert np.max(np.abs(reduced[:6] - truth[:6]) / scale) < 1e-10
    for column in range(6):
        field = full.reconstruct(truth[:, column])
        np.testing.assert_allclose(body.reconstruct(reduced[:, column]), field, atol=1e-10 * np.abs(field).max())


def test_shapes_of_the_reduced_matrices(body: ModalBody) -> None:
    inner = slice(6, None)
    np.testing.assert_allclose(body.mass, body.mass.T)
    np.testing.assert_allclose(body.mass[inner, inner], np.eye(body.size - 6), atol=1e-10)
    np.testing.assert_allclose(body.stiffness[inner, inner], np.diag((2 * np.pi * body.internal_hz) ** 2))
    assert not body.stiffness[:6, inner].any()
    assert np.all(np.linalg.eigvalsh(body.mass) > 0.0)


def test_reduced_matrices_are_projections_of_the_full_ones(body: ModalBody) -> None:
    housing = beam()
    for reduced, full in ((body.mass, housing.matrices().mass), (body.stiffness, housing.matrices().stiffness)):
        projected = body.shapes.T @ (full @ body.shapes)
        scale = np.sqrt(np.outer(np.diag(reduced), np.diag(reduced)))
        np.testing.assert_allclose(projected / scale, reduced / scale, atol=1e-9)


@pytest.mark.parametrize("corrections", [0, 1, 2])
def test_frequencies_come_from_above(corrections: int) -> None:
    """Each reduction is a Galerkin projection on a larger space than the one before."""
    housing = beam()
    truth = full_model(housing).frequencies_hz(8)
    before = np.full(8, np.inf)
    for modes in (2, 4, 8, 16):
        reduced = housing.reduce(modes, quasi_static=corrections).coupled.frequencies_hz[:8]
        assert np.all(reduced >= truth * (1 - 1e-9))
        assert np.all(reduced <= before * (1 + 1e-9))
        before = reduced


def test_corrections_help() -> None:
    housing = beam()
    truth = full_model(housing).frequencies_hz(6)
    errors = [np.max(housing.reduce(6, quasi_static=n).coupled.frequencies_hz[:6] / truth - 1.0) for n in (0, 1, 2, 3)]
    assert errors[1] < 1e-2 * errors[0]
    assert errors[2] < 1e-1 * errors[1]
    assert errors[3] <= errors[2] * (1 + 1e-6) + 1e-11


def test_full_model_against_a_dense_solver() -> None:
    full = full_model(beam(cells=(3, 1, 1)))
    values = eigh(full.stiffness.toarray(), full.mass.toarray(), eigvals_only=True)
    np.testing.assert_allclose(full.frequencies_hz(10), np.sqrt(values[:10]) / (2 * np.pi), rtol=1e-9)


@pytest.mark.parametrize("corrections", [0, 1, 2])
def test_error_bound_bounds(corrections: int) -> None:
    housing = beam()
    body = housing.reduce(6, quasi_static=corrections)
    band = 0.8 * body.next_hz
    found = reduction_error(body, band)
    own = body.coupled.frequencies_hz
    inside = own <= band
    errors, own = found.frequency_errors[inside], own[inside]
    true = own / full_model(housing).frequencies_hz(len(own)) - 1.0
    assert len(true) >= 5
    assert np.all(true <= errors * 1.05 + 1e-10)
    assert np.all(errors < 0.5)
    clear = true > 1e-9  # what A >= (1 - w^2/w_next^2) K gives away, and not more
    assert np.all(errors[clear] <= true[clear] / (1.0 - 0.8**2) * 1.01)
    assert np.isinf(found.frequency_errors[body.coupled.frequencies_hz >= body.next_hz]).all()
    fine = housing.reduce(60, quasi_static=2)
    difference = response_difference(body, fine, band)
    assert difference <= found.response <= 10.0 * difference
    assert np.isinf(reduction_error(body, 1.01 * body.next_hz).response)


def response_difference(first: ModalBody, second: ModalBody, band_hz: float) -> float:
    """Relative rms difference of the attachments' accelerations under forces on them, 1 % modal damping."""
    lost = total = 0.0
    for w in 2 * np.pi * band_hz * (np.arange(200) + 0.5) / 200:
        found = []
        for body in (first, second):
            damped = body.with_damping(ratio=0.01)
            dynamic = damped.stiffness - w**2 * damped.mass + 1j * w * damped.damping
            found.append(np.linalg.inv(dynamic)[:3, :3])
        lost += float(np.sum(np.abs(w**2 * (found[0] - found[1])) ** 2))
        total += float(np.sum(np.abs(w**2 * found[1]) ** 2))
    return float(np.sqrt(lost / total))


def test_modes_by_frequency_are_all_there() -> None:
    housing = beam(cells=(4, 1, 1))
    many = housing.reduce(40).internal_hz[:40]
    limit = 0.5 * (many[16] + many[17])
    found = housing.reduce(below_hz=limit, least_modes=0)
    assert found.modes == 17
    np.testing.assert_allclose(found.internal_hz[:17], many[:17], rtol=1e-9)
    assert found.next_hz == pytest.approx(many[17], rel=1e-3)
    assert housing.reduce(below_hz=limit, least_modes=25).modes == 25


def test_free_body_has_six_rigid_modes() -> None:
    for housing in (beam(free=True, ends=0), beam(ends=2)):
        assert any("six rigid-body modes" in note for note in housing.notes)
        body = housing.reduce(12)
        frequencies = body.coupled.frequencies_hz
        assert not body.held
        np.testing.assert_array_equal(frequencies[:6], 0.0)
        assert frequencies[6] > 100.0
        # rigid motions carry all of the mass and its inertia
        momentum = body.momentum @ body.coupled.vectors[:, :6]
        np.testing.assert_allclose(momentum @ momentum.T, body.rigid_mass, rtol=1e-6, atol=1e-6)
        assert body.rigid_mass[0, 0] == pytest.approx(RHO * np.prod(SIZE), rel=1e-12)
    free, ends = beam(free=True, ends=0), full_model(beam(ends=0, free=True))
    np.testing.assert_allclose(free.reduce(10).coupled.frequencies_hz[6:10], ends.frequencies_hz(10)[6:], rtol=1e-6)
    np.testing.assert_array_equal(ends.frequencies_hz(10)[:6], 0.0)


def test_free_bar_vibrates_at_c_over_2l() -> None:
    """First longitudinal mode of a free bar with nu = 0, exact in three dimensions: f = sqrt(E/rho)/(2 L)."""
    body = beam(nu=0.0, ends=0, free=True, cells=(8, 1, 1)).reduce(30)
    exact = np.sqrt(E / RHO) / (2 * SIZE[0])
    fields = body.reconstruct(body.coupled.vectors.T)
    along = np.abs(fields[:, :, 0]).max(axis=1) > 100.0 * np.abs(fields[:, :, 1:]).max(axis=(1, 2))
    found = body.coupled.frequencies_hz[along & (body.coupled.frequencies_hz > 1.0)]
    assert found[0] == pytest.approx(exact, rel=1e-4)


def test_reconstruction_equals_the_full_transient() -> None:
    """All modes kept: the reduced transient is the full one, node by node."""
    housing = beam(cells=(2, 1, 1))
    full = full_model(housing)
    body = housing.reduce(10_000, quasi_static=0)
    assert body.size == full.mass.shape[0]

    def load(t: float) -> np.ndarray:
        return np.array([0, 0, 1000.0 * smooth_ramp(t, 2e-4), 5.0, 0, 0])

    beta = 1e-6
    run = {"step": 1e-5, "steps": 40}
    a = newmark(full.mass, beta * full.mass, full.stiffness, load, **run)  # type: ignore[arg-type]
    b = newmark(body.mass, beta * body.mass, body.stiffness, load, **run)  # type: ignore[arg-type]
    for history_a, history_b in ((a.displacement, b.displacement), (a.acceleration, b.acceleration)):
        field = np.array([full.reconstruct(u) for u in history_a])
        np.testing.assert_allclose(body.reconstruct(history_b), field, atol=1e-7 * np.abs(field).max())


def test_newmark_against_an_oscillator() -> None:
    """One mass on a spring under a constant force: x = F/k (1 - cos wt), with the method's second order."""
    w = 2 * np.pi * 50.0
    errors = []
    for steps in (200, 400):
        step = 0.02 / steps
        found = newmark(np.eye(1), np.zeros((1, 1)), w**2 * np.eye(1), lambda t: np.ones(1), step=step, steps=steps)
        errors.append(np.abs(found.displacement[:, 0] - (1 - np.cos(w * found.time)) / w**2).max() * w**2)
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)


def test_damping() -> None:
    body = beam().reduce(6)
    omega = 2 * np.pi * body.coupled.frequencies_hz
    v = body.coupled.vectors
    modal = v.T @ body.with_damping(ratio=0.02).damping @ v
    np.testing.assert_allclose(np.diag(modal), 0.04 * omega, rtol=1e-9)
    assert np.abs(modal - np.diag(np.diag(modal))).max() < 1e-9 * modal.max()
    each = v.T @ body.with_damping(ratio=np.array([0.01, 0.03])).damping @ v
    np.testing.assert_allclose(np.diag(each)[:4] / (2 * omega[:4]), [0.01, 0.03, 0.03, 0.03], rtol=1e-9)
    rayleigh = body.with_damping(alpha=3.0, beta=1e-6)
    np.testing.assert_allclose(rayleigh.damping, 3.0 * body.mass + 1e-6 * body.stiffness)
    for wrong in ({"ratio": -0.1}, {"alpha": -1.0}, {"beta": -1.0}):
        with pytest.raises(InputError, match="damping"):
            body.with_damping(**wrong)  # type: ignore[arg-type]


def test_save_and_load_give_the_same_body(body: ModalBody, tmp_path: Path) -> None:
    damped = body.with_damping(ratio=0.01)
    damped.save(tmp_path / "body.npz")
    again = ModalBody.load(tmp_path / "body.npz")
    for name, value in vars(damped).items():
        if name == "coupled":
            continue
        other = getattr(again, name)
        assert type(other) is type(value) or isinstance(value, (int, np.integer, np.floating)), name
        np.testing.assert_array_equal(np.asarray(other), np.asarray(value))
    q = np.linspace(0, 1, body.size)
    np.testing.assert_array_equal(again.reconstruct(q), damped.reconstruct(q))


def test_loading_is_light(tmp_path: Path) -> None:
    beam(cells=(20, 5, 5)).reduce(40).save(tmp_path / "body.npz")
    code = (
        "import sys, numpy\n"
        "from gearfe.fem.reduction.modal_body import ModalBody\n"
        "body = ModalBody.load(sys.argv[1])\n"
        "heavy = {'gmsh', 'skfem', 'meshio', 'pyvista', 'matplotlib', 'h5py'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "assert body.reconstruct(numpy.ones(body.size)).shape == (len(body.nodes), 3)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "body.npz")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("damage", ["missing", "cut", "rubbish", "other", "flip"])
def test_damaged_files_are_named(body: ModalBody, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "body.npz"
    body.save(path)
    data = bytearray(path.read_bytes())
    if damage == "missing":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(bytes(data[: len(data) // 2]))
    elif damage == "rubbish":
        path.write_bytes(b"rubbish")
    elif damage == "other":
        np.savez(path, x=np.zeros(3))
    else:
        data[len(data) // 2] ^= 0xFF
        path.write_bytes(bytes(data))
    with pytest.raises(InputError):
        ModalBody.load(path)


def test_bad_requests_are_named(body: ModalBody) -> None:
    with pytest.raises(InputError, match="modes"):
        beam(cells=(1, 1, 1)).reduce(-1)
    with pytest.raises(InputError, match="below_hz"):
        beam(cells=(1, 1, 1)).reduce(below_hz=-5.0)
    with pytest.raises(InputError, match="corrections"):
        beam(cells=(1, 1, 1)).reduce(3, quasi_static=-1)
    with pytest.raises(InputError, match="did you mean 'right'"):
        body.attachment("rihgt")
    with pytest.raises(InputError, match="coordinates"):
        body.reconstruct(np.zeros(3))
    housing = beam(cells=(1, 1, 1))
    with pytest.raises(InputError, match="neither"):
        reduce_model(housing.partition(housing.matrices()))
    assert body.attachment("right") == slice(0, 6)


def test_reduction_is_quick(body: ModalBody) -> None:
    """Nothing in the small model costs more than milliseconds."""
    started = time.process_time()
    for _ in range(20):
        body.with_damping(ratio=0.01)
    assert time.process_time() - started < 2.0
