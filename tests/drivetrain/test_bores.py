"""Bores whose nodes are no sound cylinder: remarks with figures, and refusals. Amounts are those put into the nodes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gearfe.base.errors import InputError
from gearfe.drivetrain.housing.attachments import Bore, bore_attachment
from gearfe.drivetrain.housing.model import Housing
from tests.makers.housing_meshes import box

RADIUS, LENGTH = 0.02, 0.03
AXIS = Bore((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), RADIUS, name="a")


def ring(radial: Any = None, turn: float = 2.0 * math.pi, heights: int = 5) -> np.ndarray:
    """(n, 3) nodes round the y axis: 24 angles of a turn times heights, at the radii of ``radial(angle, part)``."""
    angle, part = np.meshgrid(np.arange(24) * turn / 24, np.linspace(0.0, 1.0, heights) if heights > 1 else [0.0])
    angle, part = angle.ravel(), part.ravel()
    r = np.full(len(angle), RADIUS) if radial is None else radial(angle, part)
    far = np.array([[0.1, 0.0, 0.1], [-0.1, LENGTH, -0.1]])
    return np.concatenate([np.column_stack([r * np.cos(angle), LENGTH * part, r * np.sin(angle)]), far])


def notes_of(nodes: np.ndarray, bore: Bore = AXIS) -> tuple[str, ...]:
    return bore_attachment(bore, 1, nodes)[1]


def test_a_sound_bore_has_no_remark() -> None:
    assert notes_of(ring()) == ()
    few_digits = ring(lambda angle, part: RADIUS + 0.8e-3 * RADIUS * np.sin(17.0 * angle + part))
    assert notes_of(few_digits) == ()


@pytest.mark.parametrize(
    ("radial", "words"),
    [  # 0.4 mm between the nearest and the furthest node, all of them within the radius
        (lambda angle, part: RADIUS - 0.2e-3 + 0.2e-3 * np.cos(2.0 * angle), "oval by 0.4 mm"),
        (lambda angle, part: RADIUS - 0.2e-3 + 0.2e-3 * np.cos(angle), "off the axis by 0.2 mm"),
        (
            lambda angle, part: RADIUS - 0.2e-3 + 0.4e-3 * (part - 0.5) * np.cos(angle),
            "tilted over its length by 0.4 mm",
        ),
        (lambda angle, part: RADIUS - 0.4e-3 * part, "wider at one end by 0.4 mm"),
        (lambda angle, part: RADIUS - 0.4e-3 * (part > 0.5), "wider at one end by"),  # walls of two radii
        (lambda angle, part: RADIUS - 0.4e-3 * np.random.default_rng(1).random(len(angle)), "scattered by 0.2"),
    ],
)
def test_bores_out_of_round_are_named(radial: Any, words: str) -> None:
    (note,) = notes_of(ring(radial))
    assert words in note
    assert "nodes lie 19.6" in note
    assert "to 20 mm" in note


@pytest.mark.parametrize(
    "radial",
    [
        lambda angle, part: 0.9 * RADIUS + 0.1 * RADIUS * np.cos(2.0 * angle),  # oval by a fifth
        lambda angle, part: RADIUS - 0.1 * RADIUS * (part > 0.5),  # walls of two radii
        lambda angle, part: RADIUS - 0.1 * RADIUS * np.random.default_rng(2).random(len(angle)),
    ],
)
def test_nodes_far_from_a_cylinder_are_refused(radial: Any) -> None:
    with pytest.raises(InputError, match=r"out of round by \S+ % of the radius, more than 5 %.*point_mm beside group"):
        notes_of(ring(radial))


def test_an_oval_bore_within_its_smaller_radius_is_open() -> None:
    """Only nodes near the smaller diameter lie within it."""
    (note,) = notes_of(ring(lambda angle, part: RADIUS * (1.1 - 0.1 * np.cos(2.0 * angle))))
    assert "leave 180 of 360 deg" in note


@pytest.mark.parametrize(("turn", "gap"), [(math.pi, 188), (0.5 * math.pi, 274)])
def test_a_part_of_the_circumference_is_named(turn: float, gap: int) -> None:
    (note,) = notes_of(ring(turn=turn))
    assert f"leave {gap} of 360 deg" in note


def test_one_ring_of_nodes_is_named() -> None:
    (note,) = notes_of(ring(heights=1))
    assert "one ring without length" in note


def test_another_radius_is_named() -> None:
    (note,) = notes_of(ring(), Bore((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.05 * RADIUS, name="a"))
    assert "lie 20 to 20 mm from the axis, its radius is 21 mm" in note


def test_midside_nodes_on_chords_are_no_scatter() -> None:
    """Straight edges, eight a half circle: their middles lie 2 % of the radius within, the corners on the cylinder."""
    nodes, tets = box((2, 8, 2), (0.015, math.pi, LENGTH), mapped=lambda p: p)
    corners = np.unique(tets[:, :4])
    bent = nodes.copy()
    radius, angle = RADIUS + nodes[:, 0], nodes[:, 1]
    bent[corners] = np.column_stack([radius * np.cos(angle), nodes[:, 2], -radius * np.sin(angle)])[corners]
    for tet in tets:
        for k, (a, b) in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]):
            bent[tet[4 + k]] = 0.5 * (bent[tet[a]] + bent[tet[b]])
    housing = Housing.from_arrays(bent, tets, [AXIS])
    assert [note for note in housing.notes if note.startswith("bore")] == [
        "bore a: its nodes leave 180 of 360 deg round the axis open; if it is a whole bore, check its point and radius"
    ]
