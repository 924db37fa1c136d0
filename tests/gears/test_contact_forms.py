"""The contact forms of whole gears: tangents are derivatives, energies give symmetric ones."""

from __future__ import annotations

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.fem.plane import Material
from gearfe.gears.contact.laws import ElementLaw, Nitsche, Penalty
from gearfe.gears.contact.whole_gears import forms
from gearfe.gears.contact.whole_gears.bodies import Bodies
from gearfe.gears.contact.whole_gears.contact_state import contact_at
from gearfe.gears.contact.whole_gears.problem import ContactProblem
from tests.makers.contact_problems import contact_problem
from tests.makers.structured import block

LAWS = [Nitsche(sides="pinion"), Penalty(1e12, "pinion")]


def pressed(law: ElementLaw, right: float) -> tuple[ContactProblem, np.ndarray, np.ndarray]:
    """Two cells pressed onto a single one, all bent; a displacement that presses every point, and a direction.

    A single edge has no neighbours, so its normal does not turn with them; the mate's sharp end is at x = 1.
    """
    bodies = Bodies((block((0.2, right), (0, 0.5), 2, 1, Material(70e9)), block((0, 1), (-0.5, 0), 1, 1, Material())))
    held = {(0, "top"): (0.0, 0.0), (1, "bottom"): (0.0, 0.0)}
    problem = contact_problem(bodies, (((0, "bottom"), (1, "top")),), law, prescribed=held)
    made = np.random.default_rng(1)
    u, d = (1e-2 * made.standard_normal(problem.unknowns.size) for _ in range(2))
    u[problem.unknowns[bodies.node_of[0], 1]] -= 0.05
    return problem, u, d


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("right", [0.9, 1.02], ids=["inside", "past the end"])
def test_tangent_is_the_derivative_of_the_contact_forces(law: ElementLaw, right: float) -> None:
    problem, u, d = pressed(law, right)
    state, step = contact_at(problem, u), 1e-6
    assert np.count_nonzero(state.pressure) >= 7
    assert ((state.share > 0) & (state.share < 1)).any() == (right > 1)
    ahead, behind = (contact_at(problem, u + way * step * d).forces for way in (1, -1))
    rate = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(state.tangent() @ d, rate, rtol=0, atol=1e-6 * np.abs(rate).max())


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_only_laws_with_an_energy_have_a_symmetric_tangent(law: ElementLaw) -> None:
    problem, u, _ = pressed(law, 0.9)
    tangent = contact_at(problem, u).tangent()
    skew = abs(tangent - tangent.T).max() / abs(tangent).max()
    assert (skew < 1e-12) == (law.name == "penalty")


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_one_call_assembles_what_scikit_fem_assembles(law: ElementLaw) -> None:
    problem, u, _ = pressed(law, 1.02)
    state = contact_at(problem, u)
    expected = forms.contact_tangent.assemble(state.pairs, **state.fields)
    assert abs(state.tangent() - expected).max() < 1e-13 * abs(expected).max()


def test_contact_forces_carry_no_resultant() -> None:
    """[v] of a rigid translation is zero."""
    problem, u, _ = pressed(Nitsche(sides="pinion"), 0.9)
    forces = contact_at(problem, u).forces[problem.unknowns]
    assert np.abs(forces.sum(axis=0)).max() < 1e-12 * np.abs(forces).sum()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Nitsche(gamma0=0.0), "gamma0 = 0.0: must be finite and > 0"),
        (lambda: Penalty(-1.0), "stiffness = -1.0: must be finite and > 0"),
    ],
)
def test_laws_that_do_not_exist(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
