"""exudyn: a mechanism file as rigid bodies and joints in the plane.

Generalized-alpha steps of fixed length with spectral radius 0.9 (index 3), or its trapezoidal rule (index 2), which
alone gets
over the fold of the slider crank; the tolerance of the table is the step as a part of the run. What it does that the
toolkit does not: three-dimensional multibody systems,
contact, control, a viewer.
"""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np

from tests.places import GEOMETRY

from ..timing import measured
from .process import serve


def answer(task: dict[str, Any]) -> dict[str, Any]:
    """Build, integrate, measure; building the system counts."""
    times = np.array(task["times"])

    def run() -> np.ndarray:
        return _run(task, times)

    angles, cost = measured(run, runs=3, most_s=30.0)
    if task["mechanism"] == "andrews":
        a = angles
        columns = [a[:, 0], a[:, 1] - a[:, 0], a[:, 2], a[:, 3] - a[:, 4], a[:, 4], a[:, 5] - a[:, 6], a[:, 6]]
        found = np.stack(columns, axis=1).tolist()
    else:
        found = angles[:, 0].tolist()
    return {"angles": found, **cost.columns, "steps": _steps(task, times), "status": "done"}


def _steps(task: dict[str, Any], times: np.ndarray) -> int:
    """Whole steps, a multiple of the output intervals."""
    intervals = len(times) - 1
    return intervals * max(1, round(1.0 / (task["tolerance"] * intervals)))


def _run(task: dict[str, Any], times: np.ndarray) -> np.ndarray:
    import exudyn
    import exudyn.itemInterface as items

    with (GEOMETRY / f"{task['mechanism']}.toml").open("rb") as stream:
        file = tomllib.load(stream)
    container = exudyn.SystemContainer()
    system: Any = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())
    bodies, sensors = {}, []
    gravity = next((f["acceleration_m_per_s2"] for f in file["forces"].values() if f["type"] == "gravity"), [0.0, 0.0])
    starts = _starts(task["mechanism"], file)
    for name, body in file["bodies"].items():
        angle, centre, velocity = starts[name]
        node = system.AddNode(
            items.NodeRigidBody2D(
                referenceCoordinates=[*centre, angle], initialCoordinates=[0.0] * 3, initialVelocities=velocity
            )
        )
        bodies[name] = system.AddObject(
            items.ObjectRigidBody2D(nodeNumber=node, mass=body["mass_kg"], inertia=body["inertia_kg_m2"])
        )
        if any(gravity):
            whole = system.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[name]))
            system.AddLoad(items.LoadMassProportional(markerNumber=whole, loadVector=[*gravity, 0.0]))
        sensors.append(
            system.AddSensor(
                items.SensorNode(
                    nodeNumber=node, storeInternal=True, outputVariableType=exudyn.OutputVariableType.Coordinates
                )
            )
        )

    def marker(name: str, point: str) -> int:
        if name == "ground":
            place = file["ground"]["points_m"][point]
            return int(system.AddMarker(items.MarkerBodyRigid(bodyNumber=ground, localPosition=[*place, 0.0])))
        body = file["bodies"][name]
        place = np.subtract(body["points_m"][point], body["centre_m"])
        return int(system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[name], localPosition=[*place, 0.0])))

    for joint in file["joints"].values():
        other = joint.get("to", "ground")
        ends = [marker(other, joint["to_point"]), marker(joint["body"], joint["point"])]
        if joint["type"] == "hinge":
            system.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
        else:
            system.AddObject(
                items.ObjectJointPrismatic2D(
                    markerNumbers=ends,
                    axisMarker0=[1.0, 0.0, 0.0],
                    normalMarker1=[0.0, 1.0, 0.0],
                    constrainRotation=False,
                )
            )
    for force in file["forces"].values():
        if force["type"] == "spring":
            ends = [marker(force.get("to", "ground"), force["to_point"]), marker(force["body"], force["point"])]
            system.AddObject(
                items.ObjectConnectorSpringDamper(
                    markerNumbers=ends, referenceLength=force["free_length_m"], stiffness=force["stiffness"]
                )
            )
        elif force["type"] == "moment":
            place = system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[force["body"]]))
            system.AddLoad(items.LoadTorqueVector(markerNumber=place, loadVector=[0.0, 0.0, force["moment_N_m"]]))
    system.Assemble()
    settings: Any = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = _steps(task, times)
    settings.timeIntegration.endTime = float(times[-1])
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.newton.relativeTolerance = 1e-9
    settings.timeIntegration.newton.absoluteTolerance = 1e-10
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = float(times[1] - times[0])
    settings.solutionSettings.sensorsStoreAndWriteFiles = True
    kinds = exudyn.DynamicSolverType
    kind = kinds.TrapezoidalIndex2 if task["method"] == "trapezoidal" else kinds.GeneralizedAlpha
    system.SolveDynamic(settings, solverType=kind)
    columns = []
    for sensor, name in zip(sensors, bodies, strict=True):
        columns.append(system.GetSensorStoredData(sensor)[:, 3] + starts[name][0])
    return np.stack(columns, axis=1)


def _starts(mechanism: str, file: dict[str, Any]) -> dict[str, tuple[float, list[float], list[float]]]:
    """Angle, place and velocity of each body's mass centre at the start."""
    found = {}
    for name, body in file["bodies"].items():
        angle = body["angle_rad"] if "angle_rad" in body else np.radians(body["angle_deg"])
        c, s = np.cos(angle), np.sin(angle)
        x, y = body["centre_m"]
        origin = np.array(body.get("position_m", [0.0, 0.0]))
        arm = np.array([c * x - s * y, s * x + c * y])
        velocity = [0.0, 0.0, 0.0]
        if mechanism == "slider_crank":
            rate = 4.0 / (2.0 * np.sin(np.pi / 4.0)) * (1.0 if name == "crank" else -1.0)
            base = np.zeros(2)
            if name == "rod":
                base = 4.0 / (2.0 * np.sin(np.pi / 4.0)) * np.array([-origin[1], origin[0]])
            velocity = [float(base[0] - rate * arm[1]), float(base[1] + rate * arm[0]), float(rate)]
        found[name] = (float(angle), (origin + arm).tolist(), velocity)
    return found


if __name__ == "__main__":
    serve(answer)
