"""The model of a pair: what it refuses, and what it takes for convenience."""

import pytest

from gearfe.base.errors import InputError
from gearfe.fem.plane import Material
from gearfe.gears.contact.laws import HalfPlane, Nitsche, PairModel
from gearfe.gears.geometry.face import NOMINAL, ToothDeviations

BRONZE = Material(110e9, 0.34)


def test_a_law_may_be_named_and_one_material_stands_for_both_gears():
    made = PairModel().changed(law="nitsche", materials=BRONZE)
    assert made == PairModel((BRONZE, BRONZE), law=Nitsche())
    assert made.changed(law=HalfPlane(), materials=PairModel().materials) == PairModel()


def test_flanks_of_the_half_plane_law_are_coarser():
    """Four times, but at most six default sizes: 2.4 stays below 6/1.5."""
    assert PairModel(law=Nitsche(), flank_coarsen=0.6).mesh_flank_coarsen == 0.6
    assert PairModel(coarsen=1.5, flank_coarsen=0.6).mesh_flank_coarsen == pytest.approx(2.4)
    assert PairModel(coarsen=5.0).mesh_flank_coarsen == pytest.approx(1.2)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"plane": "strained"}, "strain or stress"),
        ({"coarsen": 0.1}, ">= 0.2"),
        ({"flank_coarsen": 0.01}, ">= 0.1"),
        ({"law": "nitsche", "deviations": (ToothDeviations(turn=(1e-6,)), NOMINAL[1])}, "half_plane"),
        ({"law": "nitch"}, "nitsche"),
    ],
)
def test_what_no_model_can_have(changes, told):
    with pytest.raises(InputError, match=told):
        PairModel().changed(**changes)


def test_no_field_goes_unnoticed():
    with pytest.raises(TypeError, match="coarse"):
        PairModel().changed(coarse=2.0)
