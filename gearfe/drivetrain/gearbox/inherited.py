"""Values that gears and meshes of a train take from elsewhere: other tables, the gears themselves, defaults.

A gear with its own teeth takes missing keys from [pair]. A mesh takes its model, material, damping and backlash from
other tables or its gears. The summary names each such value with its source, so that nothing is inherited unseen.
"""

from __future__ import annotations

from typing import Any

from ...base.tables.gearbox import BORE, DEFAULT, NamedGear, NamedMesh
from ...base.tables.train import POTENTIAL, VARIABLE, TrainMeshTable
from ...gears.geometry.pair import gear_pair
from ..train.gear_train import GearMesh, GearTrain
from .job import TrainJob

Source = dict[str, Any]


def inherited(job: TrainJob, train: GearTrain) -> dict[str, dict[str, dict[str, Source]]]:
    """Values of gears and meshes that their own entries do not give: gear or mesh -> key -> value, from."""
    meshes = zip(job.table.meshes, job.meshes, train.meshes, strict=True)
    return {
        "gears": {name: _of_gear(gear) for name, gear in job.gearbox.gears.items()},
        "meshes": {made.name: _of_mesh(job, train, table, named, made) for table, named, made in meshes},
    }


def _value(value: Any, source: str) -> Source:
    return {"value": value, "from": source}


def _bracketed(place: str) -> str:
    return place if place == DEFAULT else f"[{place}]"


def _of_gear(gear: NamedGear) -> dict[str, Source]:
    """What a gear takes from [pair], and its defaults."""
    found: dict[str, Source] = {}
    if gear.like:
        found["gear"] = _value(gear.where.removeprefix("pair."), f"{gear.like}: teeth, tooth form, deviations")
    else:
        found = {key: _value(gear.form[key], _bracketed(place)) for key, place in gear.places.items()}
        if gear.places.get("bore_diameter_mm") == DEFAULT:
            found["bore_diameter_mm"]["from"] = f"{DEFAULT}: {BORE:g} times the pitch diameter"
    if gear.density_where:
        found["density_kg_per_m3"] = _value(gear.density_kg_per_m3, _bracketed(gear.density_where))
    return found


def _of_mesh(
    job: TrainJob, train: GearTrain, table: TrainMeshTable, named: NamedMesh, mesh: GearMesh
) -> dict[str, Source]:
    """What a mesh takes from other tables and its gears, and its defaults."""
    found: dict[str, Source] = {}
    model = job.table.model_of(table)
    curves = f"[train.variants.{job.table.variant}.curves]" if job.table.variant else "[train.curves]"
    pair = gear_pair(train.gear(mesh.driver).gear, train.gear(mesh.driven).gear, mesh.centre_distance)
    if model and table.mesh_model is None:
        found["mesh_model"] = _value(model, curves)
    if model == VARIABLE or table.curve or table.mesh_table:
        found["interpolation"] = _value(job.table.curves.interpolation, curves)
    if model:
        for role, gear in zip(("driver", "driven"), named.gears, strict=True):
            if gear.material is not None:
                source = _bracketed(gear.material_where)
                found[f"youngs_modulus_GPa of {role}"] = _value(gear.material.youngs_modulus_GPa, source)
        found["plane"] = _value(named.stiffness.plane, _stiffness_source(job))
    if table.centre_distance_mm is None:
        source = "the gears, without backlash" if mesh.centre_distance is None else "[pair]"
        found["centre_distance_mm"] = _value(1e3 * pair.working_centre_distance, source)
    if table.backlash_um is None and not table.rigid:
        if model == POTENTIAL:
            source = "tooth_thinning_um of the gears and the centre distance"
            found["backlash_um"] = _value(1e6 * max(pair.base_backlash, 0.0), source)
        else:
            found["backlash_um"] = _value(None, f"{DEFAULT}: a spring that acts both ways")
    if table.damping_acts is None and not table.rigid:
        found["damping_acts"] = _value("in_contact" if mesh.damps_in_contact else "always", DEFAULT)
    damping = f"[train.variants.{job.table.variant}.damping]" if job.table.variant else "[train.damping]"
    if job.table.damping.rayleigh_beta_s > 0.0 and not table.rigid:
        found["rayleigh_beta_s"] = _value(job.table.damping.rayleigh_beta_s, damping)
    return found


def _stiffness_source(job: TrainJob) -> str:
    """Tables that the keys of [stiffness] come from."""
    name = job.table.variant
    own = bool(name) and job.table.variants[name].stiffness is not None
    return f"[stiffness] and [train.variants.{name}.stiffness]" if own else "[stiffness]"


def inherited_lines(entries: dict[str, dict[str, dict[str, Source]]]) -> list[str]:
    """Lines for the terminal: what gears with teeth of their own take from [pair], and meshes from their gears."""
    lines: list[str] = []
    taken: dict[str, list[str]] = {}
    for name, found in entries.get("gears", {}).items():
        values = [f"{key} = {x['value']:g}" for key, x in found.items() if x["from"] == "[pair]"]
        if values:
            taken.setdefault(", ".join(values), []).append(name)
    for text, names in taken.items():
        lines.append(f"gear{'s' * (len(names) > 1)} {', '.join(names)}: from [pair] {text}")
    for name, found in entries.get("meshes", {}).items():
        clearance = found.get("backlash_um", {}).get("value")
        if clearance:
            lines.append(f"mesh {name}: backlash_um = {clearance:.6g} from {found['backlash_um']['from']}")
    return lines
