"""The reduced shaft: exact statics, frequencies of the coupled full model, symmetry, gyroscopic terms, bad input."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import linalg

from gearfe.base.errors import InputError
from gearfe.fem.beams import BeamShaft, Disc, ReducedShaft, Section, Station, full_shaft, reduce_shaft
from gearfe.fem.beams.elements import MOST_ELEMENTS, MOST_UNKNOWNS, divide

TURN = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.3, -1.0, 2.0], [2.0, 0.1, 1.0]]))[0]
FRAME = TURN * np.sign(np.linalg.det(TURN))
SHAFT = BeamShaft(
    -0.1,
    (
        Section(0.1, 0.02, 0.02),
        Section(0.06, 0.03, 0.025, 0.0, 0.01),
        Section(0.12, 0.025, 0.025, 0.01, 0.01),
    ),
    (Disc(0.0, 0.8, 5e-4, 3e-4), Disc(0.1, 1.5, 2e-3, 1.1e-3)),
    (
        Station(-0.09, "left bearing", ("radial", "axial")),
        Station(0.0, "small gear"),
        Station(0.1, "large gear"),
        Station(0.17, "right bearing", ("radial", "tilt")),
    ),
)


def springs(shaft: ReducedShaft) -> np.ndarray:
    """Stiffness of two bearings, a mesh at each gear (force off the axis), and a torsional spring."""
    stiffness = shaft.stiffness_matrix()

    def add(rows: np.ndarray, value: np.ndarray | float) -> None:
        nonlocal stiffness
        rows = np.atleast_2d(rows)
        stiffness = stiffness + rows.T @ (np.broadcast_to(value, len(rows))[:, None] * rows)

    e1, e2, a = shaft.frame
    add(np.array([e1, e2, a]) @ shaft.rows(-0.09)[:3], np.array([2e8, 1e8, 3e7]))
    add(np.array([e1, e2]) @ shaft.rows(0.17)[:3], 1.5e8)
    add(shaft.rows(0.17)[3:5], 2e4)
    for along, radius in ((0.0, 0.03), (0.1, 0.06)):
        rows = shaft.rows(along)
        line = 0.9 * e1 + 0.4 * e2 + 0.15 * a
        row = line @ rows[:3] + radius * rows[5] + radius * 0.15 * rows[3]
        add(row, 3e8)
    return stiffness


def test_statics_at_the_stations_are_those_of_the_full_model() -> None:
    """Forces at the stations, held by springs there: the same deflections with a few coordinates."""
    reduced, full = reduce_shaft(SHAFT, FRAME, 3000.0), full_shaft(SHAFT, FRAME, 20000.0)
    assert reduced.size < full.size / 3
    moved = []
    for shaft in (reduced, full):
        stations = np.array([shaft.rows(station.along) for station in SHAFT.stations])
        load = stations[1, 0] * 700.0 + stations[2, 5] * 20.0 + stations[3, 3] * 3.0
        moved.append(stations @ np.linalg.solve(springs(shaft), load))
    np.testing.assert_allclose(moved[0], moved[1], rtol=0.0, atol=1e-8 * np.abs(moved[1]).max())
    for place, (station, direction) in enumerate(((2, 1), (2, 3))):  # tilt and torsion at the third station
        row = reduced.rows(SHAFT.stations[station].along)[4 + place, 6:]
        assert (row**2 / reduced.squares).sum() == pytest.approx(reduced.compliance[station, direction], rel=1e-9)
    assert math.isnan(reduced.compliance[0, 1])


def test_coupled_frequencies_are_those_of_the_full_model() -> None:
    """First fifteen on springs, spinning: 1e-4."""
    found = []
    for shaft in (reduce_shaft(SHAFT, FRAME, 20000.0), full_shaft(SHAFT, FRAME, 60000.0)):
        scale = 1.0 / np.sqrt(shaft.mass_diagonal)
        k = springs(shaft) * scale * scale[:, None]
        g = 1000.0 * shaft.gyroscopic_matrix() * scale * scale[:, None]
        values = linalg.eigvals(np.block([[np.zeros_like(k), np.eye(len(k))], [-k, -g]]))
        found.append(np.sort(np.abs(values.imag))[::2][:15])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-4)


def test_a_quarter_turn_about_the_axis_changes_nothing() -> None:
    """Rows of the plane of e2 are those of e1, turned; frequencies of both are the same numbers."""
    shaft = reduce_shaft(SHAFT, FRAME, 10000.0)
    first, second = (np.flatnonzero(np.array(shaft.kinds) == kind) for kind in ("bending e1", "bending e2"))
    np.testing.assert_array_equal(first + 1, second)
    np.testing.assert_array_equal(shaft.squares[first], shaft.squares[second])
    rows = shaft.rows(np.linspace(-0.1, 0.18, 7))
    e1, e2, _ = FRAME
    np.testing.assert_allclose(
        np.einsum("j,kjn->kn", e1, rows[:, :3, 6 + first]),
        np.einsum("j,kjn->kn", e2, rows[:, :3, 6 + second]),
        atol=1e-12,
    )
    np.testing.assert_array_equal(rows[:, 4, 6 + first], -rows[:, 3, 6 + second])


def test_mass_properties_are_those_of_a_rigid_rotor() -> None:
    """Cylinders and discs, by hand."""
    shaft = BeamShaft(0.2, (Section(0.4, 0.05, 0.05, 0.02, 0.02, density=7800.0),), (Disc(0.5, 3.0, 0.02, 0.012),))
    reduced = reduce_shaft(shaft, np.eye(3), 1000.0)
    m = 7800.0 * math.pi / 4.0 * (0.05**2 - 0.02**2) * 0.4
    squares = (0.05**2 + 0.02**2) / 4.0
    centre = (m * 0.4 + 3.0 * 0.5) / (m + 3.0)
    transverse = m * (squares / 4.0 + 0.4**2 / 12.0) + m * (0.4 - centre) ** 2 + 0.012 + 3.0 * (0.5 - centre) ** 2
    np.testing.assert_allclose(
        [reduced.mass, reduced.centre, reduced.polar, reduced.transverse],
        [m + 3.0, centre, m * squares / 2.0 + 0.02, transverse],
        rtol=1e-12,
    )


@pytest.mark.parametrize("reduction", [reduce_shaft, full_shaft])
@pytest.mark.parametrize("rotor", [SHAFT, BeamShaft(-0.041, (Section(0.082, 0.02, 0.02),), (), SHAFT.stations[1:2])])
def test_elastic_coordinates_carry_no_momentum(
    reduction: Callable[[BeamShaft, np.ndarray, float], ReducedShaft], rotor: BeamShaft
) -> None:
    """Momentum, moment of momentum and kinetic energy by quadrature along the axis: M is diag(m, .., 1)."""
    shaft = reduction(rotor, FRAME, 40000.0)
    total = np.zeros((shaft.size, shaft.size))
    x, weight = np.polynomial.legendre.leggauss(30)
    for left, right in zip(shaft.nodes[:-1], shaft.nodes[1:], strict=True):
        places = 0.5 * (left + right) + 0.5 * (right - left) * x
        for along, rows, w in zip(places, shaft.rows(places), 0.5 * (right - left) * weight, strict=True):
            number = int(np.searchsorted(rotor.ends, along)) - 1
            part = rotor.sections[number]
            at = (along - rotor.ends[number]) / part.length
            outer = part.outer_start + at * (part.outer_end - part.outer_start)
            inner = part.inner_start + at * (part.inner_end - part.inner_start)
            area, second = math.pi / 4.0 * (outer**2 - inner**2), math.pi / 64.0 * (outer**4 - inner**4)
            inertia = part.density * np.array([area, area, area, second, second, 2.0 * second])
            total += w * rows.T @ (inertia[:, None] * rows)
    for disc in rotor.discs:
        rows = shaft.rows(disc.along)
        total += rows.T @ (np.array([disc.mass] * 3 + [disc.transverse] * 2 + [disc.polar])[:, None] * rows)
    scale = 1.0 / np.sqrt(shaft.mass_diagonal)
    np.testing.assert_allclose(total * scale * scale[:, None], np.eye(shaft.size), atol=1e-8)


def test_gyroscopic_matrix_is_the_integral_of_the_polar_inertia() -> None:
    """Momentum J_p S of each slice tilts with it: G = integral rho I_p (t1 t2^T - t2 t1^T)."""
    shaft = reduce_shaft(SHAFT, FRAME, 8000.0)
    total = np.zeros((shaft.size, shaft.size))
    x, weight = np.polynomial.legendre.leggauss(20)

    def add(rows: np.ndarray, inertia: float) -> None:
        nonlocal total
        term = inertia * np.outer(rows[3], rows[4])
        total = total + term - term.T

    for left, right in zip(shaft.nodes[:-1], shaft.nodes[1:], strict=True):
        places = 0.5 * (left + right) + 0.5 * (right - left) * x
        for along, rows, w in zip(places, shaft.rows(places), 0.5 * (right - left) * weight, strict=True):
            number = int(np.searchsorted(SHAFT.ends, along)) - 1
            part = SHAFT.sections[number]
            at = (along - SHAFT.ends[number]) / part.length
            outer = part.outer_start + at * (part.outer_end - part.outer_start)
            inner = part.inner_start + at * (part.inner_end - part.inner_start)
            add(rows, w * part.density * math.pi / 32.0 * (outer**4 - inner**4))
    for disc in SHAFT.discs:
        add(shaft.rows(disc.along), disc.polar)
    matrix = shaft.gyroscopic_matrix()
    np.testing.assert_allclose(matrix, total, rtol=0.0, atol=1e-7 * np.abs(total).max())
    assert matrix[3, 4] == pytest.approx(shaft.polar, rel=1e-7)
    inertias = [pair.inertia for pair in shaft.gyroscopic]
    assert inertias == sorted(inertias, reverse=True)


def test_a_stiff_rotor_tilts_as_a_rigid_one() -> None:
    """No mode below the limit and no station: one pair, the tilts themselves."""
    shaft = reduce_shaft(BeamShaft(0.0, (Section(0.2, 0.05, 0.05),), (Disc(0.1, 2.0, 0.01, 0.006),)), np.eye(3), 10.0)
    (pair,) = shaft.gyroscopic
    assert shaft.n == 0
    assert pair.inertia == pytest.approx(shaft.polar, rel=1e-12)
    np.testing.assert_allclose(np.outer(pair.first, pair.second)[3, 4], 1.0, rtol=1e-14)


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"sections": ()}, "sections"),
        ({"sections": (Section(-1.0, 0.1, 0.1),)}, r"sections\[1\].length"),
        ({"sections": (Section(1.0, 0.1, 0.0),)}, r"sections\[1\].outer_end"),
        ({"sections": (Section(1.0, math.nan, 0.1),)}, r"sections\[1\].outer_start"),
        ({"sections": (Section(1.0, 0.1, 0.1, 0.1, 0.0),)}, r"sections\[1\].inner_start"),
        ({"sections": (Section(1.0, 0.1, 0.1, 0.0, -0.01),)}, r"sections\[1\].inner_end"),
        ({"sections": (Section(1.0, 0.1, 0.1, poisson=0.5),)}, r"sections\[1\].poisson"),
        ({"discs": (Disc(1.1, 1.0),)}, r"discs\[1\]"),
        ({"discs": (Disc(0.1, -1.0),)}, r"discs\[1\].mass"),
        ({"stations": (Station(-0.1, "gear"),)}, "station 'gear'"),
        ({"stations": (Station(0.1, "gear", ("bend",)),)}, "loads"),
        ({"stations": (Station(0.1, "gear"), Station(0.2, "gear"))}, "stations"),
        ({"start": math.inf}, "start"),
    ],
)
def test_impossible_shafts_are_refused_by_field(changed: dict, field: str) -> None:
    """The field, and what to do."""
    with pytest.raises(InputError, match=field):
        BeamShaft(**{"start": 0.0, "sections": (Section(1.0, 0.1, 0.1),), **changed})


@pytest.mark.parametrize(
    "options",
    [
        {"tolerance": 0.0},
        {"elements": 0},
        {"degree": 2},
        {"degree": 99},
        {"elements": 10**6},
    ],
)
def test_impossible_divisions_are_refused_by_field(options: dict) -> None:
    """Each option names itself."""
    with pytest.raises(InputError, match=next(iter(options))):
        reduce_shaft(SHAFT, FRAME, 1000.0, **options)


def test_frequencies_that_no_division_carries_and_places_off_the_shaft_are_refused() -> None:
    """Neither a hang nor a wrong number; the range that is named can be had."""
    for hertz in (0.0, -1.0, math.nan):
        with pytest.raises(InputError, match="Hz"):
            reduce_shaft(SHAFT, FRAME, hertz)
    for hertz in (1e12, 3e8):
        with pytest.raises(InputError, match=r"must be <= .* Hz") as error:
            divide(SHAFT, hertz)
    most = float(error.value.problem.split("must be <= ")[1].split()[0])
    assert 1e5 < most < 3e8
    degrees = divide(SHAFT, 0.9 * most).degrees
    assert len(degrees) <= MOST_ELEMENTS
    assert 0.5 * MOST_UNKNOWNS < (2 * degrees - 1).sum() <= MOST_UNKNOWNS
    with pytest.raises(InputError, match="frame"):
        reduce_shaft(SHAFT, np.ones((3, 3)), 1000.0)
    with pytest.raises(InputError, match="not on shaft"):
        reduce_shaft(SHAFT, FRAME, 1000.0).rows(0.2)
