"""Pairs that tests of the half-plane law use, and their laws."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gearfe.gears.contact.half_plane import HalfPlanePair, half_plane_pair
from gearfe.gears.contact.position import Contacts
from gearfe.gears.gearmesh.pair_loads import marks_met
from gearfe.gears.gearmesh.sweep import elastic_pair
from gearfe.gears.geometry.pair import GearPair, TipRelief

from .gears import pair as gear_pair

PAIRS = {
    "rounded": gear_pair(tip_round=1e-4),
    "sharp": gear_pair(),
    "shifted": gear_pair(
        19, 48, pressure_angle=20.0, tip_round=5e-5, pinion={"profile_shift": 0.4}, wheel={"profile_shift": -0.2}
    ),
    "relieved": gear_pair(25, 25, pressure_angle=20.0, tip_relief=TipRelief(20e-6, 1.5e-3, 2.0), tip_round=5e-5),
}
#: Pairs whose contacts reach a corner that goes on as another face.
KINKED = {
    "kinked": gear_pair(18, 24, pressure_angle=20.0, tip_relief=TipRelief(60e-6, 1.5e-3, 1.0), tip_round=5e-5),
    "undercut": gear_pair(12, 51, module=1.5e-3, pressure_angle=20.0, width=6e-3, bore=0.25),
}


@lru_cache
def law_of(name: str, flank_coarsen: float = 4.0) -> HalfPlanePair:
    return half_plane_pair(elastic_pair(PAIRS[name], law="penalty", flank_coarsen=flank_coarsen))


def angles_of(pair: GearPair, count: int) -> np.ndarray:
    return (np.arange(count) + 0.37) * pair.mesh_cycle / count


def reached_marks(contact_model: HalfPlanePair, contacts: Contacts) -> NDArray[np.str_]:
    """The highest of the marks that the pressure of each contact reaches, or nothing, shape (m,).

    A pressure ends within a panel beside the middle of its last one.
    """
    bears = (contacts.pressure > 0)[:, None]
    low = np.where(bears, contacts.panel_arc - contacts.width[:, None], np.inf).min(axis=2, keepdims=True)
    high = np.where(bears, contacts.panel_arc + contacts.width[:, None], -np.inf).max(axis=2, keepdims=True)
    met = marks_met(contact_model, contact_model.teeth.flank(contacts.pair), low, high)
    names = np.append("", contact_model.marks[0])
    return np.asarray(names[(met * np.arange(1, len(names))).max(axis=1)])
