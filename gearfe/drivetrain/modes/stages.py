r"""Kinds of the modes of planetary stages: rotational, translational, planet (Lin & Parker, J. Vib. Acoust. 121, 1999).

In a rotational mode carrier, sun and ring rotate without translation. In a translational mode they translate without
rotation. In a planet mode only planets move. Stages with equal planets at equal distances have these alone, the
translational ones in pairs, the planet modes N - 3 times; others have mixed ones. Motions count by their kinetic
energy; modes whose energy is elsewhere, along the axis or in tilts, are none of the stage.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.typing import Array, ComplexArray
from ..train.elements import planes
from ..train.model import TrainModel
from ..train.planetary import PLANET, ROTATIONAL, TRANSLATIONAL

MIXED = "mixed"
#: Part of a stage's energy below which a motion is none: pairs of equal frequency are found to some 1e-8 of amplitudes.
NONE = 1e-8
#: Part of a mode's kinetic energy that its stage has in its plane.
MOST = 0.5


class _Rows(NamedTuple):
    """Motions of a stage on the coordinates of the system, (k, size) each, times roots of their inertia."""

    name: str
    across: Array  # of carrier, sun and ring
    turning: Array
    planets: Array


def _rows(model: TrainModel) -> list[_Rows]:
    train, stages = model.train, []
    for carrier in train.carriers:
        planets = {pin.shaft for pin in carrier.pins}
        central = {carrier.shaft} | {
            train.gear(name).shaft
            for mesh in train.meshes
            if train.mesh_carrier(mesh) is carrier
            for name in (mesh.driver, mesh.driven)
        }
        parts: dict[str, list[Array]] = {"across": [], "turning": [], "planets": []}
        for name in sorted(central | planets):
            number = train.shaft_number(name)
            body = model.shafts[number]
            plane = planes(body, train.frame)[0]
            across = [np.sqrt(plane.inertia) * row for row in (plane.first, plane.second)]
            turn = np.sqrt(body.rotor.polar) * body.turn_rows(train.shaft_end(name, 0.0))[2]
            whole = [model.placed.whole(number, row) for row in (*across, turn)]
            if name in planets:
                parts["planets"] += whole
            else:
                parts["across"] += whole[:2]
                parts["turning"] += whole[2:]
        stages.append(_Rows(carrier.name, **{key: np.array(rows) for key, rows in parts.items()}))
    return stages


def stage_kinds(model: TrainModel, shapes: ComplexArray) -> Array:
    """Name the modes of planetary stages, as ``rotational mode of carrier arm``; an empty text for others.

    Parameters
    ----------
    model : TrainModel
        The train.
    shapes : ndarray, shape (s, n, size)
        Coordinates of the system in n modes at s speeds.

    Returns
    -------
    names : ndarray of str, shape (s, n)
    """
    names = np.full(shapes.shape[:2], "", dtype=object)
    if not model.train.carriers:
        return names
    whole = np.einsum("snj,jk,snk->sn", shapes.conj(), model.system.mass, shapes).real
    for stage in _rows(model):
        energies = [(np.abs(shapes @ rows.T) ** 2).sum(axis=2) for rows in (stage.across, stage.turning, stage.planets)]
        total = np.sum(energies, axis=0)
        across, turning, _ = (energy > NONE * total for energy in energies)
        kind = np.where(across & turning, MIXED, np.where(across, TRANSLATIONAL, np.where(turning, ROTATIONAL, PLANET)))
        inside = total > MOST * whole
        names[inside] = [f"{one} mode of carrier {stage.name}" for one in kind[inside]]
    return names
