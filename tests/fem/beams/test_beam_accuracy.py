"""Frequencies and statics of beams against closed forms and exact solutions of the differential equations."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from scipy import integrate, linalg

from gearfe.fem.beams import BeamShaft, Disc, ReducedShaft, Section, Station, full_shaft, reduce_shaft
from gearfe.fem.beams.elements import beam_matrices, cowper, divide
from tests.makers.exact_beam import bar_determinant, bending_determinant, properties, zeros

E, NU, RHO = 2.1e11, 0.3, 7850.0
FRAME = np.eye(3)


def section(length: float, outer: float, inner: float = 0.0, **other: float) -> Section:
    """Steel, uniform unless `other` says otherwise."""
    return Section(length, outer, other.get("outer_end", outer), inner, other.get("inner_end", inner), E, NU, RHO)


def modes(reduced: ReducedShaft, kind: str) -> np.ndarray:
    """Frequencies (Hz) of the modes of a kind."""
    return reduced.frequencies_hz[(np.array(reduced.kinds) == kind) & ~reduced.residual]


STEPPED = BeamShaft(0.1, (section(0.15, 0.03), section(0.35, 0.06), section(0.2, 0.05, 0.02), section(0.1, 0.025)))
ROTOR = BeamShaft(
    0.0,
    (section(0.4, 0.04), section(0.2, 0.03)),
    (Disc(0.6, 12.0, 0.09, 0.048), Disc(0.25, 3.0, 0.01, 0.006)),
    (Station(0.05, "left", ("radial",)), Station(0.4, "right", ("radial",))),
)


@pytest.mark.parametrize("slenderness", [10.0, 20.0, 100.0])
@pytest.mark.parametrize("ratio", [0.0, 0.6])
def test_free_uniform_beam_bends_as_huang_says(slenderness: float, ratio: float) -> None:
    """Huang, J. Appl. Mech. 28 (1961), 579: frequency equation of the free-free Timoshenko beam, first ten zeros."""
    outer = 0.05
    length = slenderness * outer
    part = section(length, outer, ratio * outer)
    p = properties(part)
    r2, s2 = p.bend / (part.young * p.tension / part.young * length**2), p.bend / (p.shear * length**2)

    def equation(w: np.ndarray) -> np.ndarray:
        b = w * length**2 * math.sqrt(p.mass / p.bend)
        root = np.sqrt((r2 - s2) ** 2 + 4.0 / b**2)
        alpha, beta = np.sqrt((root - r2 - s2) / 2.0), np.sqrt((root + r2 + s2) / 2.0)
        factor = b / np.sqrt(1.0 - b * b * r2 * s2) * (b * b * r2 * (r2 - s2) ** 2 + 3.0 * r2 - s2)
        # divided by cosh(b alpha), so that high modes do not cancel
        sech = 1.0 / np.cosh(b * alpha)
        return 2.0 * sech - 2.0 * np.cos(b * beta) + factor * np.tanh(b * alpha) * np.sin(b * beta)

    # the equation holds below the cut-off frequency of the second spectrum
    cut_off = math.sqrt(p.shear / p.inertia)
    lowest = 10.0 * math.sqrt(p.bend / p.mass) / length**2
    exact = zeros(equation, lowest, 0.99999 * cut_off, 4000)[:10] / (2.0 * math.pi)
    assert len(exact) >= 6
    found = modes(reduce_shaft(BeamShaft(0.0, (part,)), FRAME, 1.001 * exact[-1]), "bending e1")
    np.testing.assert_allclose(found, exact, rtol=1e-6)


@pytest.mark.parametrize(("kind", "modulus"), [("axial", E), ("torsion", E / (2.0 * (1.0 + NU)))])
def test_free_uniform_bar_has_the_frequencies_of_the_wave_equation(kind: str, modulus: float) -> None:
    """n c / (2 L)."""
    exact = math.sqrt(modulus / RHO) / 2.0 * np.arange(1, 11)
    reduced = reduce_shaft(BeamShaft(-0.3, (section(1.0, 0.05, 0.01),)), FRAME, 1.001 * exact[-1])
    np.testing.assert_allclose(modes(reduced, kind), exact, rtol=1e-6)


@pytest.mark.parametrize("shaft", [STEPPED, ROTOR])
def test_stepped_shafts_have_the_frequencies_of_the_exact_solution(shaft: BeamShaft) -> None:
    """First ten of bending, axial, torsion, with the discs' inertia."""
    bending = zeros(partial(bending_determinant, shaft, {}, 0.0), 300.0, 2e5, 600)[:10]
    axial, torsion = (
        zeros(partial(bar_determinant, shaft, kind), 300.0, 6e5, 1000)[:10] for kind in ("axial", "torsion")
    )
    exact = np.array([bending, axial, torsion]) / (2.0 * math.pi)
    assert exact.shape == (3, 10)
    reduced = reduce_shaft(shaft, FRAME, 1.001 * exact.max())
    for kind, values in zip(("bending e1", "axial", "torsion"), exact, strict=True):
        np.testing.assert_allclose(modes(reduced, kind)[:10], values, rtol=1e-6)
    np.testing.assert_array_equal(modes(reduced, "bending e1"), modes(reduced, "bending e2"))


@pytest.mark.parametrize("spin", [0.0, 100.0, 300.0, 600.0, 1200.0])
def test_overhung_disc_whirls_as_the_exact_solution_says(spin: float) -> None:
    """Forward and backward whirl on springs, at five speeds (rad/s)."""
    springs = {0.05: (5e7, 0.0), 0.4: (8e7, 0.0)}
    reduced = full_shaft(ROTOR, FRAME, 5000.0)
    stiffness = reduced.stiffness_matrix()
    for along, (radial, _) in springs.items():
        rows = reduced.rows(along)[:2]
        stiffness += radial * rows.T @ rows
    # axial and torsion are free: leave them out
    plane = np.array(
        [i for i in range(reduced.size) if i not in (2, 5) and (i < 6 or "bending" in reduced.kinds[i - 6])]
    )
    m, k, g = (
        matrix[np.ix_(plane, plane)]
        for matrix in (reduced.mass_matrix(), stiffness, spin * reduced.gyroscopic_matrix())
    )
    scale = 1.0 / np.sqrt(np.diag(m))
    k, g = k * scale * scale[:, None], g * scale * scale[:, None]
    zero, one = np.zeros_like(k), np.eye(len(k))
    found = np.abs(linalg.eigvals(np.block([[zero, one], [-k, -g]])).imag)
    found = np.sort(found)[::2]  # conjugate pairs
    exact = np.sort(
        np.concatenate(
            [
                zeros(lambda w, sign=sign: bending_determinant(ROTOR, springs, spin, sign * w), 50.0, 2e4, 600)
                for sign in (1, -1)
            ]
        )
    )
    assert len(exact) >= 8
    np.testing.assert_allclose(found[: len(exact)], exact, rtol=1e-6)


@pytest.mark.parametrize("length", [0.05, 0.5, 5.0, 50.0])
def test_clamped_beam_bends_under_its_tip_load_with_shear_and_does_not_lock(length: float) -> None:
    """F L^3 / (3 E I) + F L / (kappa G A), from stubby to slender, one element of the lowest degree."""
    part = section(length, 0.05, 0.02)
    p = properties(part)
    tip = _clamped_tip(BeamShaft(0.0, (part,)), degree=3)
    assert tip == pytest.approx(length**3 / (3.0 * p.bend) + length / p.shear, rel=1e-9)


@pytest.mark.parametrize(
    "cone",
    [
        section(0.3, 0.06, 0.0, outer_end=0.03),
        section(0.3, 0.06, 0.02, outer_end=0.024, inner_end=0.021),
        section(0.3, 0.02, 0.0, outer_end=0.1),
        section(0.3, 0.04, 0.03, outer_end=0.08, inner_end=0.0),
    ],
)
def test_cones_bend_as_quadrature_of_their_compliance_says(cone: Section) -> None:
    """F times the integral of (L - s)^2 / (E I) + 1 / (kappa G A)."""

    def compliance(s: float) -> float:
        part = s / cone.length
        outer = cone.outer_start + part * (cone.outer_end - cone.outer_start)
        inner = cone.inner_start + part * (cone.inner_end - cone.inner_start)
        p = properties(section(cone.length, outer, inner))
        return (cone.length - s) ** 2 / p.bend + 1.0 / p.shear

    exact = integrate.quad(compliance, 0.0, cone.length, epsrel=1e-12, limit=500)[0]
    assert _clamped_tip(BeamShaft(0.0, (cone,))) == pytest.approx(exact, rel=1e-6)


def _clamped_tip(shaft: BeamShaft, degree: int | None = None) -> float:
    """Deflection of the last end under a unit force there, the first end clamped."""
    division = divide(shaft, 1.0, degree=degree)
    family = beam_matrices(shaft, division).bending
    free = np.arange(2, family.own)
    tip = 2 * len(division.degrees)
    load = (np.arange(family.own) == tip).astype(float)
    return float(np.linalg.solve(family.stiffness[np.ix_(free, free)], load[free])[tip - 2])


def test_shear_factor_of_solid_and_thin_walled_circles() -> None:
    """Cowper (1966), table 1: 6(1 + nu)/(7 + 6 nu) for the circle, 2(1 + nu)/(4 + 3 nu) for the thin tube."""
    factors = cowper(0.3, np.array([0.0, 1.0]))
    np.testing.assert_allclose(factors, [6.0 * 1.3 / 8.8, 2.0 * 1.3 / 4.9], rtol=1e-14)


def test_rigid_motions_take_no_energy() -> None:
    """Displacement, tilt, turn: K R = 0 to rounding."""
    shaft = BeamShaft(
        0.2,
        (section(0.3, 0.05, 0.01), section(0.2, 0.05, 0.01, outer_end=0.1, inner_end=0.03)),
        (Disc(0.4, 3.0, 0.1, 0.06),),
    )
    division = divide(shaft, 5000.0)
    matrices = beam_matrices(shaft, division)
    nodes = len(division.nodes)
    for family, width in ((matrices.bending, 2), (matrices.axial, 1), (matrices.torsion, 1)):
        stiffness = family.stiffness[: family.own, : family.own]
        rigid = np.zeros((width, family.own))
        rigid[0, 0 : width * nodes : width] = 1.0
        if width == 2:
            rigid[1, 0 : 2 * nodes : 2], rigid[1, 1 : 2 * nodes : 2] = division.nodes, 1.0
        size = np.abs(stiffness) @ np.abs(rigid.T)
        assert np.all(np.abs(stiffness @ rigid.T) <= 1e-13 * size.max())


def test_error_estimate_is_that_of_the_frequencies() -> None:
    """Two elements of the lowest degree: the estimate is within a factor of two of the true error."""
    shaft = BeamShaft(0.0, (section(1.0, 0.05),))
    coarse, fine = reduce_shaft(shaft, FRAME, 1000.0, elements=2, degree=3), reduce_shaft(shaft, FRAME, 2000.0)
    error = modes(coarse, "bending e1")[:2] / modes(fine, "bending e1")[:2] - 1.0
    estimate = coarse.frequency_errors[[0, 2]]
    assert np.all(error > 1e-6)
    assert np.all((estimate > 0.5 * error) & (estimate < 2.0 * error))


def test_elements_follow_from_the_frequency_or_the_key() -> None:
    """Degrees and elements grow with the frequency; a given number is a least number."""
    shaft = BeamShaft(0.0, (section(1.0, 0.05),))
    low, high = divide(shaft, 100.0), divide(shaft, 1e5)
    assert low.degrees.sum() < high.degrees.sum()
    assert len(divide(shaft, 100.0, elements=7).degrees) == 7
    assert divide(shaft, 100.0, degree=5).degrees.tolist() == [5]
