"""exudyn: mechanisms with one flexible link, by its ANCF cable elements (Bernoulli, without rotary inertia).

    python -m scripts.benchmarks.jobs.peers.exudyn_flexible

writes the references in tests/data: two runs of generalised alpha (spectral radius 0.9) with steps in the ratio of 2,
extrapolated for its order 2; the errors in the header are the share of that order, and what half the elements change.
"""

from __future__ import annotations

import math
import sys
import time
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tests.places import DATA, GEOMETRY

from .process import serve

#: Elements, steps of the finer run, rows and end (s) of the reference of each mechanism. Steps of 20 s / 2^n are exact
#: in binary: others write some rows a step late.
REFERENCES = {
    "elastic_slider_crank": (8, 12800, 81, 0.2),
    "elastic_andrews": (8, 19200, 61, 0.03),
    "spin_up": (8, 16384, 65, 20.0),
}
#: Newton's relative tolerance: below, rounding of axial forces stops it; at 1e-6 Andrews' crank would be off by 1e-4.
NEWTON = {"elastic_slider_crank": 1e-6, "elastic_andrews": 1e-8, "spin_up": 1e-6}


def tables(mechanism: str) -> dict[str, Any]:
    """Tables of a mechanism file.

    The shipped slider crank; Andrews' with a spring-steel strip as the coupler b2; the beam of Simo & Vu-Quoc (J. Appl.
    Mech. 53 (1986) 855-863: EI = 1.4e4 N m2, EA = 2.8e7 N, 1.2 kg/m, 10 m), turned to 6 rad/s within 15 s.
    """
    if mechanism == "spin_up":
        return {
            "run": {"end_s": 20.0, "step_s": 0.25},
            "ground": {"points_m": {"O": [0.0, 0.0]}},
            "bodies": {
                "rod": {
                    "points_m": {"root": [0.0, 0.0], "middle": [5.0, 0.0], "tip": [10.0, 0.0]},
                    "beam": {
                        "length_m": 10.0, "width_m": 0.006 / math.sqrt(6e-3), "height_m": math.sqrt(6e-3),
                        "youngs_modulus_GPa": 2.8 / 0.6, "density_kg_per_m3": 200.0, "damping_s": 0.0,
                    },
                }
            },
            "joints": {
                "O": {"type": "hinge", "body": "rod", "point": "root", "to_point": "O"},
                "drive": {
                    "type": "prescribed", "body": "rod", "coordinate": "rate",
                    "motion_rad_per_s": {"step": 6.0, "step_centre_s": 7.5, "step_width_s": 15.0},
                },
            },
            "outputs": [
                {"name": "position", "value": "x(rod.tip)"},
                {"name": "deflection_m", "value": "deflection(rod.middle)"},
            ],
        }  # fmt: skip
    if mechanism == "elastic_slider_crank":
        with (GEOMETRY / "elastic_slider_crank.toml").open("rb") as stream:
            return tomllib.load(stream)
    with (GEOMETRY / "andrews.toml").open("rb") as stream:
        made = tomllib.load(stream)
    rigid, length = made["bodies"]["b2"], 0.028
    angle, (x, y) = rigid["angle_rad"], rigid["position_m"]
    made["bodies"]["b2"] = {
        "angle_rad": angle,
        "position_m": [x - length * math.cos(angle), y - length * math.sin(angle)],
        "points_m": {"E": [0.0, 0.0], "middle": [length / 2, 0.0], "P": [length, 0.0]},
        "beam": {
            "length_m": length, "width_m": 0.02, "height_m": 2e-4, "youngs_modulus_GPa": 200.0,
            "density_kg_per_m3": 7850.0, "damping_s": 1e-5,
        },
    }  # fmt: skip
    made["outputs"] = [
        {"name": "position", "value": "angle(b1)"},
        {"name": "deflection_m", "value": "deflection(b2.middle)"},
    ]
    return {key: made[key] for key in ("run", "ground", "bodies", "joints", "forces", "outputs")}


class Motion(NamedTuple):
    """Angle of Andrews' crank (rad) or place of the slider or tip (m), deflection in the middle (m), seconds."""

    position: np.ndarray
    deflection: np.ndarray
    cpu_s: float


def run(mechanism: str, elements: int, steps: int, rows: int, end: float) -> Motion:
    """Integrate with that many cables in the link and steps."""
    import exudyn
    import exudyn.itemInterface as items

    file = tables(mechanism)
    container = exudyn.SystemContainer()
    system: Any = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())
    nodes: dict[str, Any] = {}
    bodies: dict[str, Any] = {}
    for name, body in file["bodies"].items():
        angle, origin = body.get("angle_rad", 0.0), np.array(body.get("position_m", [0.0, 0.0]))
        c, s = math.cos(angle), math.sin(angle)
        if "beam" in body:
            link, bar = name, body["beam"]
            part, area = bar["length_m"] / elements, bar["width_m"] * bar["height_m"]
            axial, bending = (1e9 * bar["youngs_modulus_GPa"] * k for k in (area, area * bar["height_m"] ** 2 / 12))
            nodes[name] = [
                system.AddNode(
                    items.NodePoint2DSlope1(referenceCoordinates=[*(origin + i * part * np.array([c, s])), c, s])
                )
                for i in range(elements + 1)
            ]
            for pair in zip(nodes[name], nodes[name][1:], strict=False):
                system.AddObject(
                    items.ObjectANCFCable2D(
                        length=part, massPerLength=bar["density_kg_per_m3"] * area, nodeNumbers=list(pair),
                        axialStiffness=axial, axialDamping=bar["damping_s"] * axial,
                        bendingStiffness=bending, bendingDamping=bar["damping_s"] * bending,
                    )
                )  # fmt: skip
            continue
        x, y = body.get("centre_m", [0.0, 0.0])
        centre = (origin[0] + c * x - s * y, origin[1] + s * x + c * y)
        nodes[name] = system.AddNode(items.NodeRigidBody2D(referenceCoordinates=[*centre, angle]))
        bodies[name] = system.AddObject(
            items.ObjectRigidBody2D(nodeNumber=nodes[name], mass=body["mass_kg"], inertia=body["inertia_kg_m2"])
        )

    def marker(name: str, point: str | None) -> Any:
        if name == "ground":
            place = file["ground"]["points_m"][point]
            return system.AddMarker(items.MarkerBodyRigid(bodyNumber=ground, localPosition=[*place, 0.0]))
        body = file["bodies"][name]
        place = body["points_m"][point] if point else [0.0, 0.0]
        if name == link:
            at = round(place[0] / body["beam"]["length_m"] * elements)
            return system.AddMarker(items.MarkerNodePosition(nodeNumber=nodes[name][at]))
        place = np.subtract(place, body.get("centre_m", [0.0, 0.0]))
        return system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[name], localPosition=[*place, 0.0]))

    fixed = system.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
    )

    def hold(node: Any, coordinate: int, **more: Any) -> None:
        moving = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
        system.AddObject(items.CoordinateConstraint(markerNumbers=[fixed, moving], **more))

    for joint in file["joints"].values():
        if joint["type"] == "hinge":
            ends = [
                marker(joint.get("to", "ground"), joint.get("to_point")),
                marker(joint["body"], joint.get("point")),
            ]
            system.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
        elif joint["type"] == "prismatic":  # the slider's guide along x
            hold(nodes[joint["body"]], 1)
            hold(nodes[joint["body"]], 2)
        elif joint["body"] == link:  # the slope at the root has the length 1, but for a stretch of 8e-5
            for k, slope in enumerate(_direction(joint["motion"])):
                hold(nodes[link][0], 2 + k, offsetUserFunction=slope)
        else:
            hold(nodes[joint["body"]], 2, offsetUserFunction=_turned(joint["motion"]))
    for force in file.get("forces", {}).values():
        if force["type"] == "spring":
            ends = [marker(force.get("to", "ground"), force["to_point"]), marker(force["body"], force["point"])]
            system.AddObject(
                items.ObjectConnectorSpringDamper(
                    markerNumbers=ends, referenceLength=force["free_length_m"], stiffness=force["stiffness"]
                )
            )
        else:
            place = system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[force["body"]]))
            system.AddLoad(items.LoadTorqueVector(markerNumber=place, loadVector=[0.0, 0.0, force["moment_N_m"]]))
    kinds = exudyn.OutputVariableType
    first = next((name for name in ("slider", "b1") if name in bodies), "")
    watched = [(nodes[link][k], kinds.Position) for k in (0, elements // 2, elements)]
    watched += [(nodes[first], kinds.Coordinates)] if first else []
    sensors = [
        system.AddSensor(items.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind))
        for node, kind in watched
    ]
    system.Assemble()
    settings: Any = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = end
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.newton.relativeTolerance = NEWTON[mechanism]
    settings.timeIntegration.newton.absoluteTolerance = 0.1 * NEWTON[mechanism]
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = end / (rows - 1)
    settings.solutionSettings.sensorsStoreAndWriteFiles = True
    began = time.process_time()
    system.SolveDynamic(settings)
    spent = time.process_time() - began
    late = system.GetSensorStoredData(sensors[0])[:, 0] - np.linspace(0.0, end, rows)
    if np.abs(late).max() > 1e-9 * end:
        raise RuntimeError(f"rows are late by up to {late.max():.1e} s: other steps")
    stored = [system.GetSensorStoredData(sensor)[:, 1:] for sensor in sensors]
    start, middle, tip = (one[:, :2] for one in stored[:3])
    position = tip[:, 0]
    if first:
        here = file["bodies"][first]
        moved = stored[3]
        position = moved[:, 0] + here["position_m"][0] if first == "slider" else moved[:, 2] + here["angle_rad"]
    chord = (tip - start) / np.hypot(*(tip - start).T)[:, None]
    arm = middle - start
    return Motion(position, chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0], spent)


def _turned(motion: dict[str, float]) -> Any:
    """Integral of the smoothed step of a rate, as exudyn calls it."""
    rate, width = motion["step"], motion["step_width_s"]

    def turned(_system: Any, t: float, _item: int, _offset: float) -> float:
        x = min(t / width, 1.0)
        return rate * (width * (2.5 * x**4 - 3.0 * x**5 + x**6) + max(0.0, t - width))

    return turned


def _direction(motion: dict[str, float]) -> tuple[Any, Any]:
    """Displacements of a slope's components that is (1, 0) at the start and turns."""
    turned = _turned(motion)

    def along(system: Any, t: float, item: int, offset: float) -> float:
        return math.cos(turned(system, t, item, offset)) - 1.0

    def across(system: Any, t: float, item: int, offset: float) -> float:
        return math.sin(turned(system, t, item, offset))

    return along, across


def write(mechanism: str) -> Path:
    """Reference of a mechanism."""
    elements, steps, rows, end = REFERENCES[mechanism]
    fine, coarse = (np.stack(run(mechanism, elements, n, rows, end)[:2]) for n in (steps, steps // 2))
    halved = np.stack(run(mechanism, elements // 2, steps, rows, end)[:2])
    share, mesh = (np.abs(d).max(axis=1) for d in ((fine - coarse) / 3.0, fine - halved))
    path = DATA / f"{mechanism}_exudyn.csv"
    head = (
        f"exudyn 1.13.6, {elements} ANCF cables, generalised alpha with {steps} and {steps // 2} steps extrapolated\n"
        f"share of the steps: position {share[0]:.1e}, deflection {share[1]:.1e} m;"
        f" of half the elements: {mesh[0]:.1e}, {mesh[1]:.1e} m\ntime_s,position,deflection_m"
    )
    data = np.column_stack([np.linspace(0.0, end, rows), *(fine + (fine - coarse) / 3.0)])
    np.savetxt(path, data, delimiter=",", header=head, fmt="%.10g")
    return path


def answer(task: dict[str, Any]) -> dict[str, Any]:
    """Position, deflection and the smallest processor time of three runs, for `flexible_study`."""
    runs = [run(*(task[key] for key in ("mechanism", "elements", "steps", "rows", "end"))) for _ in range(3)]
    made = min(runs, key=lambda motion: motion.cpu_s)
    return {"position": made.position.tolist(), "deflection": made.deflection.tolist(), "cpu_s": made.cpu_s}


if __name__ == "__main__":
    if sys.argv[1:2] == ["task.json"]:
        serve(answer)
    else:
        for known in sys.argv[1:] or REFERENCES:
            print(write(known))
