"""Planetary stages in the summaries of trains: speeds, torques, mesh phases, load shares, orders of sidebands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..train.model import TrainModel
from ..train.planetary import KINDS, MeshFamily, family_facts

#: Multiples of a mesh frequency whose sidebands are listed.
MULTIPLES = 3


def stage_entries(model: TrainModel, mean_forces: Sequence[float] | None = None) -> dict[str, Any]:
    """Entries of the summary about the planetary stages of a train; none without any.

    Parameters
    ----------
    model : TrainModel
        The train.
    mean_forces : sequence of float, optional
        Mean force of each mesh (N), of a transient.
    """
    train = model.train
    if not train.carriers:
        return {}
    rolled, names = train.kinematics, [mesh.name for mesh in train.meshes]
    shafts = [shaft.name for shaft in train.shafts]
    families = model.families
    entries: dict[str, Any] = {
        "speed_ratios": {name: str(ratio) for name, ratio in zip(shafts, rolled.ratios, strict=True)},
        "torque_ratios": {
            load.shaft: {
                shafts[holder]: str(torque)
                for holder, torque in zip(
                    rolled.rolling.holders, rolled.rolling.reactions(train.shaft_number(load.shaft)), strict=True
                )
            }
            for load in train.loads
        },
        "meshes": [family_facts(family, names) for family in families],
        "orders": [entry for family in families for entry in _orders(model, family)],
    }
    if mean_forces is not None:
        entries["mean_load_shares"] = [
            {names[i]: len(family.meshes) * float(mean_forces[i]) / total for i in family.meshes}
            for family in families
            if (total := sum(float(mean_forces[i]) for i in family.meshes)) and math.isfinite(total)
        ]
    return {"planetary": entries}


def _orders(model: TrainModel, family: MeshFamily) -> list[dict[str, Any]]:
    """Orders of a mesh, and those of its sidebands at a point that stands still, in cycles a turn of the drive.

    A force of harmonic l of the mesh acts across the axis, in the frame of the carrier. In the housing it has the
    orders l n - c and l n + c. n are the cycles of the mesh and c the turns of the carrier in a turn of the drive.
    """
    rolled = model.kinematics
    carrier = next(c for c in model.train.carriers if c.name == family.carrier)
    passes = abs(rolled.ratios[model.train.shaft_number(carrier.shaft)])
    mesh = rolled.cycles[family.meshes[0]]
    found = []
    for harmonic in range(1, MULTIPLES + 1):
        push = bool(family.excites(harmonic)[KINDS[1]])
        order, name = harmonic * mesh, f"{harmonic} x mesh {family.names[0]}-{family.names[1]}"
        turn = f"1 x carrier {carrier.name}"
        lower = f"{name} - {turn}" if order >= passes else f"{turn} - {name}"
        sides = {lower: abs(float(order - passes)), f"{name} + {turn}": float(order + passes)}
        found.append({"name": name, "order": float(order), "sidebands": sides, "sidebands_of_ideal_planets": push})
    return found


def stage_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lines for the terminal from the entries of the summary."""
    entries = summary.get("planetary")
    if not entries:
        return []
    ratios = ", ".join(f"{name} {ratio}" for name, ratio in entries["speed_ratios"].items())
    lines = [f"planetary stages: speeds over that of the drive: {ratios}"]
    for family in entries["meshes"]:
        phases = ", ".join(f"{phase:.4g}" for phase in family["phases_of_a_cycle"])
        first = family["harmonics"][0]
        excited, left = (" and ".join(first[key]) or "no" for key in ("excites", "suppresses"))
        lines.append(
            f"meshes {', '.join(family['meshes'])}: {phases} cycles apart; harmonic 1 excites {excited} modes, "
            f"suppresses {left} ones"
        )
    for shares in entries.get("mean_load_shares", ()):
        lines.append("mean load shares: " + ", ".join(f"{name} {share:.4f}" for name, share in shares.items()))
    return lines
