r"""Plane linear elasticity of second-order triangles.

Find :math:`u` with :math:`-\nabla\cdot\sigma(u) = 0`,
:math:`\sigma = \lambda\,\mathrm{tr}(\varepsilon) I + 2\mu\,\varepsilon`,
:math:`\varepsilon = \tfrac12(\nabla u + \nabla u^T)`, where in plane stress :math:`\lambda` is replaced by
:math:`2\lambda\mu/(\lambda+2\mu)` (Zienkiewicz, Taylor & Zhu, *The Finite Element Method*, sec. 2.2). The weak form,
:math:`w\int\sigma(u):\varepsilon(v)`, is `element_stiffness`: strains and stresses of the shape functions, and their
product in space and over the quadrature points. Shape functions and quadrature are scikit-fem's.

The form itself is a batched product of arrays, because a `BilinearForm` takes 6.4 times as long. For 4,248 triangles in
both sectors of a pair it takes 0.185 s of processor time, the product 0.029 s (scikit-fem 12.0.2, NumPy 2.4.6). The
former would be half of the 0.30 s for 40 positions. Finite strain by scikit-fem's tensor products takes twice as long,
5 % of 40 positions. `tests/fem/test_plane_forms.py` compares stiffness, stresses and finite strain with forms.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from ..base.cache import cached_arrays, versions
from ..base.errors import InputError, UnitWarning
from ..base.suspects import beyond, other_unit
from ..base.typing import Array, IntArray

Plane = Literal["strain", "stress"]
#: Places in a triangle at which its Jacobian is looked at (area coordinates): det is quadratic there.
_EACH = 6
_PLACES = np.array([(i, j, _EACH - i - j) for i in range(_EACH + 1) for j in range(_EACH + 1 - i)]) / _EACH

#: Displacement gradients of finite strain that are worked on at a time, so that they stay in the processor's cache.
IN_CACHE = 40_000


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material.

    Parameters
    ----------
    youngs_modulus
        E (Pa).
    poisson_ratio
        nu (-), between -1 and 0.5.
    density
        rho (kg/m3).

    Raises
    ------
    InputError
        For values that no material has.

    Warns
    -----
    UnitWarning
        For values that are likely in another unit.
    """

    youngs_modulus: float = 200e9
    poisson_ratio: float = 0.30
    density: float = 7850.0

    def __post_init__(self) -> None:
        ranges = {"youngs_modulus": (0.0, math.inf), "poisson_ratio": (-1.0, 0.5), "density": (0.0, math.inf)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low < value < high:
                raise InputError(name, value, f"must lie between {low:g} and {high:g} (both excluded)", "use SI units")
        for key, value in (("youngs_modulus_GPa", 1e-9 * self.youngs_modulus), ("density_kg_per_m3", self.density)):
            if other_unit(key, value):
                name, unit = ("youngs_modulus", "Pa") if key.endswith("GPa") else ("density", "kg/m3")
                text = f"Material: {name} = {getattr(self, name):g} {unit}, {beyond(key, value)}: use SI units"
                warnings.warn(text, UnitWarning, stacklevel=3)

    @property
    def shear_modulus(self) -> float:
        """mu = E / (2 (1 + nu)) (Pa)."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    def lame(self, plane: Plane = "strain") -> tuple[float, float]:
        """(lambda, mu) (Pa) of the solid and of plane strain, or of the two-dimensional law of plane stress."""
        mu, nu = self.shear_modulus, self.poisson_ratio
        lam = 2 * mu * nu / (1 - 2 * nu)
        return (lam, mu) if plane == "strain" else (2 * lam * mu / (lam + 2 * mu), mu)

    def contact_compliance(self, plane: Plane) -> float:
        """(1 - nu^2)/E in plane strain, 1/E in plane stress (1/Pa): the body's share of 1/E* in a line contact."""
        nu = self.poisson_ratio
        return (1 - nu**2 if plane == "strain" else 1.0) / self.youngs_modulus


# ---- second-order triangle: nodes 0, 1, 2 at the corners, 3 on edge 01, 4 on edge 12, 5 on edge 20 -------------------


def triangle_shapes(r: Array, s: Array) -> tuple[Array, Array]:
    """Shape functions of the six-node triangle at reference points (r, s) of any shape: those of scikit-fem.

    Returns
    -------
    values : ndarray, shape (..., 6)
    gradients : ndarray, shape (..., 6, 2)
        Derivatives with respect to r and s.
    """
    from skfem import ElementTriP2  # 0.07 s, which jobs without elastic gears save

    functions = [ElementTriP2().lbasis(np.stack([r, s]), node) for node in range(6)]
    values = np.stack([value for value, _ in functions], axis=-1)
    return values, np.stack([np.moveaxis(slope, 0, -1) for _, slope in functions], axis=-2)


class TriangleRule(NamedTuple):
    """A quadrature rule on the reference triangle, and the six functions at its q points."""

    #: (q,) reference coordinates of the points
    r: Array
    s: Array
    #: (q,) sum to 1/2
    weights: Array
    #: (q, 6)
    values: Array
    #: (q, 6, 2) derivatives with respect to r and s
    slopes: Array


@cache
def triangle_rule(degree: int = 4) -> TriangleRule:
    """Quadrature rule of scikit-fem, exact to a degree, with `triangle_shapes` at its points.

    The cache keeps the table: importing scikit-fem takes 0.12 s, which a run on stored gears saves.
    """

    def make() -> dict[str, Array]:
        from skfem.quadrature import get_quadrature_tri

        (r, s), weights = get_quadrature_tri(degree)
        return TriangleRule(r, s, weights, *triangle_shapes(r, s))._asdict()

    return TriangleRule(**cached_arrays("triangle-rule", {"degree": degree} | versions(("scikit-fem",)), make))


def least_jacobian(points: Array, triangles: Array) -> Array:
    r"""Smallest :math:`\det \partial x/\partial \xi` of each triangle, in twice its straight area (-).

    It is looked at on a lattice with seven places along each edge. Where it is not positive, the element is inside out
    there; a triangle without area has NaN or infinity.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Positions (m).
    triangles : ndarray, shape (m, 6)
        Corners counter-clockwise, then the nodes in the middle of edges 01, 12, 20.
    """
    place = points[triangles]
    slopes = triangle_shapes(*_PLACES[:, 1:].T)[1]
    (u, v), (r, s) = np.einsum("nki,pkj->ijnp", place, slopes, optimize=True)
    least = (u * s - v * r).min(axis=1)
    u, v = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return least / np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def second_order(corners: Array, triangles: IntArray) -> tuple[Array, IntArray, IntArray]:
    """Add a node in the middle of each edge of straight triangles.

    Returns
    -------
    points, triangles
        With the new nodes after the corners.
    edges : ndarray, shape (e, 2)
        Corners of the edges, the smaller number first, in lexical order; edge k has the middle node len(corners) + k.
    """
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, first, inverse = np.unique(edges[:, 0] * len(corners) + edges[:, 1], return_index=True, return_inverse=True)
    pairs = edges[first]
    middles = 0.5 * (corners[pairs[:, 0]] + corners[pairs[:, 1]])
    quadratic = np.concatenate([triangles, len(corners) + inverse.reshape(-1, 3)], axis=1)
    return np.concatenate([corners, middles]), quadratic, pairs


def physical_gradients(coordinates: Array, reference_gradients: Array) -> tuple[Array, Array]:
    """Gradients in space of the shape functions of curved triangles.

    Parameters
    ----------
    coordinates : ndarray, shape (m, 6, 2)
        Node positions of each triangle (m).
    reference_gradients : ndarray, shape (q, 6, 2) or (m, q, 6, 2)

    Returns
    -------
    gradients : ndarray, shape (m, q, 6, 2)
        d N_a / d x_i (1/m).
    determinant : ndarray, shape (m, q)
        Jacobian determinant (m2).
    """
    if reference_gradients.ndim == 3:
        jac = np.einsum("mai,qar->mqir", coordinates, reference_gradients, optimize=True)
        reference_gradients = np.broadcast_to(reference_gradients, (len(coordinates), *reference_gradients.shape))
    else:
        jac = np.einsum("mai,mqar->mqir", coordinates, reference_gradients, optimize=True)
    det = jac[..., 0, 0] * jac[..., 1, 1] - jac[..., 0, 1] * jac[..., 1, 0]
    inverse = np.empty_like(jac)
    inverse[..., 0, 0], inverse[..., 1, 1] = jac[..., 1, 1], jac[..., 0, 0]
    inverse[..., 0, 1], inverse[..., 1, 0] = -jac[..., 0, 1], -jac[..., 1, 0]
    inverse /= det[..., None, None]
    return np.matmul(reference_gradients, inverse), det


def strain_rows(gradients: Array) -> Array:
    r"""Strains :math:`\varepsilon(v)` (xx, yy, twice xy) for unit displacements of the nodes (1/m).

    Parameters
    ----------
    gradients : ndarray, shape (m, q, 6, 2)
        d N_a / d x_i (1/m).

    Returns
    -------
    ndarray, shape (m, q, 3, 6, 2)
    """
    rows = np.zeros((*gradients.shape[:2], 3, 6, 2))
    x, y = np.moveaxis(gradients, -1, 0)
    rows[:, :, 0, :, 0] = rows[:, :, 2, :, 1] = x
    rows[:, :, 1, :, 1] = rows[:, :, 2, :, 0] = y
    return rows


def elasticity(material: Material, plane: Plane) -> Array:
    r"""Matrix C of :math:`\sigma = C\,\varepsilon`: stresses xx, yy, xy (Pa) of strains xx, yy, twice xy."""
    lam, mu = material.lame(plane)
    return np.array([[lam + 2 * mu, lam, 0.0], [lam, lam + 2 * mu, 0.0], [0.0, 0.0, mu]])


def stress_rows(gradients: Array, material: Material, plane: Plane) -> Array:
    r"""Stresses :math:`\sigma(v)` (xx, yy, xy) for unit displacements of the nodes (Pa/m), shape (m, q, 3, 6, 2).

    Parameters
    ----------
    gradients : ndarray, shape (m, q, 6, 2)
        d N_a / d x_i (1/m).
    """
    rows = strain_rows(gradients)
    stresses = elasticity(material, plane) @ rows.reshape(*rows.shape[:3], 12)
    return np.asarray(stresses.reshape(rows.shape))


def element_stiffness(coordinates: Array, material: Material, plane: Plane, thickness: float) -> Array:
    r"""Compute the stiffness matrices :math:`w\int\sigma(u):\varepsilon(v)` of curved six-node triangles.

    Parameters
    ----------
    coordinates : ndarray, shape (m, 6, 2)
        Node positions (m).
    material : Material
        Elasticity.
    plane : str
        ``stress`` or ``strain``.
    thickness
        w (m).

    Returns
    -------
    ndarray, shape (m, 12, 12)
        N/m; rows are node-major (node 0 x, node 0 y, node 1 x, ...).
    """
    rule = triangle_rule()
    gradients, det = physical_gradients(coordinates, rule.slopes)
    strain = strain_rows(gradients).reshape(*det.shape, 3, 12)
    stress = elasticity(material, plane) @ strain
    stress *= (thickness * rule.weights * det)[:, :, None, None]
    m = len(coordinates)
    return np.matmul(stress.reshape(m, -1, 12).transpose(0, 2, 1), strain.reshape(m, -1, 12))


def finite_strain_rates(
    points: Array, triangles: IntArray, fields: Array, material: Material, plane: Plane, thickness: float
) -> Array:
    r"""Return the rates of the energy that a small-strain solution gains by finite strain, to first order.

    With the Green strain :math:`E = \varepsilon + \eta`, :math:`\eta = \tfrac12\nabla u^T\nabla u`, a Saint
    Venant-Kirchhoff body stores :math:`\Delta W = \int \sigma(\varepsilon):\eta + \tfrac12\,\eta:C:\eta` more than the
    linear one. The second term is left out. When u adjusts to the first term, the energy falls by a term of the same
    order, and the two cancel where they are large. In a nearly incompressible body, lambda tr(eta) would be the
    pressure that keeps the volume constant. So the energy of first order is the first term alone; with
    :math:`\tau = C:\eta` and u' the rate of u,

    .. math:: \Delta W' = \int \big(\tau + \nabla u\,\sigma(\varepsilon)\big) : \nabla u'.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Nodes (m).
    triangles : ndarray, shape (m, 6)
        Curved six-node triangles.
    fields : ndarray, shape (n, 2, 2 c)
        u of c cases (m), then u' of the same (m per unit of what changes).
    material : Material
        Elasticity.
    plane : str
        ``stress`` or ``strain``.
    thickness
        w (m).

    Returns
    -------
    ndarray, shape (c,)
        J per unit of what changes.
    """
    rule = triangle_rule(2)
    gradients, det = physical_gradients(points[triangles], rule.slopes)
    volume = thickness * rule.weights * det
    lam, mu = material.lame(plane)
    m, cases = len(triangles), fields.shape[2] // 2
    at = gradients.transpose(0, 1, 3, 2).reshape(m, 6, 6)  # (point, derivative) x node
    energy = np.zeros(cases)
    step = max(1, IN_CACHE // max(1, 12 * cases))
    for first in range(0, m, step):
        part = slice(first, first + step)
        own = fields[triangles[part]]
        h = np.matmul(at[part], own.reshape(len(own), 6, -1)).reshape(len(own), 3, 2, 2, 2 * cases)
        # h[m, q, j, i] = d u_i / d x_j
        energy += volume[part].ravel() @ _finite_density(lam, mu, h[..., :cases], h[..., cases:]).reshape(-1, cases)
    return energy


def _finite_density(lam: float, mu: float, state: Array, rate: Array) -> Array:
    """(tau + grad u sigma) : grad u' with tau = C:eta."""
    a, c, b, d = (state[:, :, j, i] for j in (0, 1) for i in (0, 1))  # grad u = (a b; c d)
    xx, yy, xy = 0.5 * (a * a + c * c), 0.5 * (b * b + d * d), mu * (a * b + c * d)
    mean, strain = lam * (xx + yy), lam * (a + d)
    xx, yy = mean + 2 * mu * xx, mean + 2 * mu * yy
    s_xx, s_yy, s_xy = strain + 2 * mu * a, strain + 2 * mu * d, mu * (b + c)
    first = (xx + a * s_xx + b * s_xy) * rate[:, :, 0, 0] + (xy + a * s_xy + b * s_yy) * rate[:, :, 1, 0]
    second = (xy + c * s_xx + d * s_xy) * rate[:, :, 0, 1] + (yy + c * s_xy + d * s_yy) * rate[:, :, 1, 1]
    return np.asarray(first + second)


def von_mises(stresses: Array) -> Array:
    """Von Mises stress (Pa) of stresses (..., 4) ordered xx, yy, zz, xy."""
    xx, yy, zz, xy = np.moveaxis(stresses, -1, 0)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy**2)


def principal_stresses(stresses: Array) -> tuple[Array, Array, Array]:
    """Principal stresses sigma_1 >= sigma_2 >= sigma_3 (Pa) of stresses (..., 4) ordered xx, yy, zz, xy."""
    xx, yy, zz, xy = np.moveaxis(stresses, -1, 0)
    middle, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    high, low = middle + radius, middle - radius
    first, third = np.maximum(high, zz), np.minimum(low, zz)
    return first, np.maximum(low, np.minimum(high, zz)), third
