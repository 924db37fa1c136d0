"""Poisson's ratios near 0.5: error estimates hold against elements that do not lock; refusals beyond."""

from __future__ import annotations

import math

import numpy as np
import pytest
from skfem.quadrature import get_quadrature_tri

from gearfe.base.errors import InputError
from gearfe.base.typing import Array
from gearfe.fem.plane import Material, Plane, triangle_shapes
from gearfe.gears.contact import compliance
from gearfe.gears.contact.laws import MOST_POISSON, PairModel, law_named
from gearfe.gears.gearmesh.job import read_stiffness_job
from gearfe.gears.gearmesh.sweep import sweep_stiffness
from gearfe.gears.geometry.pair import Gear, GearPair


def mixed_stiffness(coordinates: Array, material: Material, plane: Plane, thickness: float) -> Array:
    """Triangles of order 2 with a bubble and a linear pressure of their own (Crouzeix, Raviart, RAIRO R3, 1973).

    They do not lock: the pressure is lambda times the projection of div u onto linear functions, and the bubble makes
    the pair stable. Both are eliminated element by element.
    """
    lam, mu = material.lame(plane)
    (r, s), weights = get_quadrature_tri(8)
    t = 1.0 - r - s
    slopes = triangle_shapes(r, s)[1]
    bubble = 27.0 * np.stack([s * (t - r), r * (t - s)], axis=-1)
    jacobian = np.einsum("mai,qar->mqir", coordinates, slopes)
    volume = thickness * weights * np.linalg.det(jacobian)
    gradient = np.concatenate([slopes, bubble[:, None]], axis=1) @ np.linalg.inv(jacobian)
    flat = gradient.reshape(len(coordinates), len(weights), 14)
    product = np.einsum("mq,mqk,mql->mkl", volume, flat, flat, optimize=True).reshape(-1, 7, 2, 7, 2)
    whole = mu * product.transpose(0, 1, 4, 3, 2)
    laplace = mu * np.einsum("makbk->mab", product)
    whole[:, :, 0, :, 0] += laplace
    whole[:, :, 1, :, 1] += laplace
    pressure = np.stack([np.ones_like(r), r, s])
    mass = np.einsum("mq,aq,bq->mab", volume, pressure, pressure)
    div = np.einsum("mq,aq,mqk->mak", volume, pressure, flat)
    whole = whole.reshape(-1, 14, 14) + lam * div.transpose(0, 2, 1) @ np.linalg.solve(mass, div)
    nodes, inner = whole[:, :12, :12], whole[:, :12, 12:]
    return np.asarray(nodes - inner @ np.linalg.solve(whole[:, 12:, 12:], inner.transpose(0, 2, 1)))


def pair() -> GearPair:
    form = {"module": 2.5e-3, "pressure_angle": math.radians(25), "face_width": 10e-3, "tip_round": 0.1e-3}
    return GearPair(Gear(20, bore_diameter=10e-3, **form), Gear(30, bore_diameter=15e-3, **form))


def curve(law: str, poisson_ratio: float, **changes: float) -> tuple[Array, Array]:
    model = PairModel((Material(poisson_ratio=poisson_ratio),) * 2, law=law_named(law), **changes)
    angles = np.radians([1.0, 5.0, 9.0])
    found = sweep_stiffness(pair(), model, torque=100.0, angles=angles, kinematics="small", estimate_error=True)
    return found.k_mesh, found.relative_error


@pytest.mark.parametrize("poisson_ratio", [0.45, MOST_POISSON])
def test_estimates_hold_up_to_the_bound(poisson_ratio: float, monkeypatch: pytest.MonkeyPatch) -> None:
    found = {law: curve(law, poisson_ratio) for law in ("half_plane", "nitsche", "penalty")}
    monkeypatch.setattr(compliance, "element_stiffness", mixed_stiffness)
    exact, _ = curve("half_plane", poisson_ratio, coarsen=0.6)
    for law, (stiffness, estimate) in found.items():
        assert np.all(np.abs(stiffness / exact - 1.0) < estimate), law


def test_beyond_the_bound_it_is_refused() -> None:
    rubber = Material(poisson_ratio=0.4995)
    with pytest.raises(InputError, match=r"poisson_ratio = 0.4995: must be <= 0.499 in plane strain.*give 0.499"):
        PairModel((Material(), rubber))
    assert PairModel((Material(), rubber), plane="stress").materials[1] == rubber


@pytest.mark.parametrize(("table", "field"), [("material", "material"), ("wheel.material", "wheel.material")])
def test_the_message_names_the_key(tmp_path, table: str, field: str) -> None:
    job = tmp_path / "job.toml"
    text = "[pair]\nmodule_mm = 2.0\npressure_angle_deg = 20.0\nface_width_mm = 10.0\n"
    text += "[pair.pinion]\nteeth = 20\nbore_diameter_mm = 10.0\n[pair.wheel]\nteeth = 30\nbore_diameter_mm = 10.0\n"
    job.write_text(f"{text}[pair.{table}]\npoisson_ratio = 0.4999\n")
    made = read_stiffness_job(job)
    with pytest.raises(InputError, match=rf"^pair\.{field}\.poisson_ratio = 0.4999"):
        _ = made.model
