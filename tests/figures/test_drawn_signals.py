"""What pictures of spectra show: accelerations, and forces where the housing does not move."""

from __future__ import annotations

import pytest

from gearfe.figures.spectra import drawn_signal

NAMES = ("contact_force_1_N", "attachment_A_acceleration_m_per_s2")


@pytest.mark.parametrize(("moves", "name", "unit"), [(True, NAMES[1], "m/s²"), (False, NAMES[0], "N")])
def test_a_housing_that_does_not_move_shows_the_contact_force(moves: bool, name: str, unit: str) -> None:
    signal = drawn_signal(NAMES, "A", lambda _: moves)
    assert (signal.name, signal.unit) == (name, unit)


def test_a_train_without_meshes_shows_the_acceleration() -> None:
    assert drawn_signal(NAMES[1:], "A", lambda _: False).name == NAMES[1]
