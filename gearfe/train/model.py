r"""From a `TrainScene` to a system of the rigid core, with all hinges eliminated at set-up.

The rotation of shaft i is :math:`\varphi_i = g_i\psi(t) + u_i`: rolling with the drive, :math:`\psi = \int\Omega\,dt`, and a small
coordinate. So every constraint is linear and constant, the drive's too: :math:`u_d - a\cdot\theta_b = 0` makes the rotation
relative to the bore b equal to psi, and its multiplier is the torque that reacts on that bore. A drive of changing speed
adds :math:`-J_p g_i\ddot\psi` on every shaft.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..periodic import PeriodicInterpolant
from ..rigid import Element, LinearJoint, LocalForce, ModalBlocks, Start, System, TimeFunction, consistent_start
from ..rigid.elimination import Minimal, minimal
from .checks import check_scene, interpolant
from .elements import LinearForce, MeshForce, RigidShaft, bearing, bore_rows, gyroscopic, hinge, torque
from .inertia import rotor
from .kinematics import Rolling, rolling
from .law import MESH, derivative, mesh_numbers, packed, python_law, train_law
from .scene import GearMesh, TrainScene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeshLine:
    """Where and how a mesh acts.

    Attributes
    ----------
    name
    row : (system size,)
        Approach for unit coordinates of the system.
    curve
        Stiffness over the driver's rotation; None for a rigid mesh.
    damping
        N s/m, the Rayleigh part included.
    driver
        Number of the driver's shaft.
    ratio, sense, phase
        Ratio of the driver's shaft to the drive, its driving sense (+1, -1), start of the curve (rad).
    module
        m.
    """

    name: str
    row: Array
    curve: PeriodicInterpolant | None
    mean: float
    damping: float
    driver: int
    ratio: float
    sense: float
    phase: float
    module: float


@dataclass(frozen=True, eq=False)
class TrainModel:
    """A train ready to be simulated.

    Attributes
    ----------
    scene, rolling
        What it was made from; its kinematics.
    system, core, start
        System of the rigid core, its minimal coordinates, its start.
    angle
        psi(t), rotation of the drive (rad).
    shafts, housing
        Bodies.
    meshes
        Lines of action.
    torques
        Pairs (direction in the system, torque over time): loads, and the shafts' inertia under a changing drive.
    first : (shafts,)
        Number of each shaft's first coordinate in the system.
    spin_reference : (shafts, system size)
        Rotation of each shaft relative to the bore it is measured against, beside rolling.
    axial : (bores, system size)
        Displacement along the axis of each bore's reference point.
    bores
        Names of the bores that carry shafts, in the housing's order.
    """

    scene: TrainScene
    rolling: Rolling
    system: System
    core: Minimal
    start: Start
    angle: TimeFunction
    shafts: tuple[RigidShaft, ...]
    housing: ModalBlocks | None
    meshes: tuple[MeshLine, ...]
    torques: tuple[tuple[Array, TimeFunction], ...]
    first: NDArray[np.int64]
    spin_reference: Array
    axial: Array
    bores: tuple[str, ...]

    @property
    def ratios(self) -> Array:
        """Speed of each shaft for unit speed of the drive."""
        return np.array([float(r) for r in self.rolling.ratios])

    @property
    def steady_speed(self) -> float:
        """Speed of the drive once its function of time has ended (rad/s)."""
        assert self.scene.drive is not None
        breaks = self.scene.drive.speed.breaks
        return float(self.scene.drive.speed(max(breaks, default=0.0)))

    @property
    def load_end(self) -> float:
        """Time at which all ramps have ended (s)."""
        return max((b for load in self.scene.loads for b in load.torque.breaks), default=0.0)

    @property
    def coupled_frequencies_hz(self) -> Array:
        """Natural frequencies with mean mesh stiffness (Hz)."""
        return np.sqrt(np.maximum(self.core.squares, 0.0)) / (2.0 * math.pi)


def build_train(scene: TrainScene) -> TrainModel:
    """Check a scene and set up its system.

    Raises
    ------
    InputError
        For the first thing in the scene that does not fit, with the cure.
    """
    check_scene(scene)
    kinematics = rolling(scene)
    assert scene.drive is not None
    frame = scene.frame
    angle = scene.drive.speed.integral(0.0, 0.0)
    housing = _housing(scene)
    ratios = [float(r) for r in kinematics.ratios]
    begin = float(scene.drive.speed(0.0))
    shafts = tuple(
        RigidShaft(
            rotor(shaft, tuple(g for g in scene.gears if g.shaft == shaft.name), frame[2]),
            0.0 if shaft.initial_speed is None else shaft.initial_speed - g * begin,
            name=f"shaft {shaft.name}",
        )
        for shaft, g in zip(scene.shafts, ratios, strict=True)
    )
    bodies: list[Element] = [*shafts] if housing is None else [housing, *shafts]
    first = np.array([0 if housing is None else housing.size] + [6] * (len(shafts) - 1)).cumsum()
    size = sum(b.size for b in bodies)
    joints, meshes = _supports(scene, shafts, housing), []
    lines = []
    for mesh in scene.meshes:
        element, line = _mesh(scene, mesh, shafts, first, ratios, angle, size)
        meshes.append(element)
        lines.append(line)
    moving = derivative(derivative(angle))
    torques = []
    for shaft, g in zip(shafts, ratios, strict=True):
        if any(any(row) for row in moving.coefficients) or moving.sines:
            function = -g * shaft.rotor.polar * moving
            torques.append((torque(shaft, function, None, f"inertia of {shaft.name} under the drive"), function))
    for load in scene.loads:
        shaft = shafts[[s.name for s in scene.shafts].index(load.shaft)]
        reaction = None
        if housing is not None and load.bore is not None:
            reaction = (housing, bore_selector(scene, load.bore)[:, 3:] @ frame[2])
        torques.append((torque(shaft, load.torque, reaction, f"load on {shaft.name}"), load.torque))
    turning = [gyroscopic(shaft, g, angle) for shaft, g in zip(shafts, ratios, strict=True)]
    turning = turning if scene.damping.gyroscopic else []
    elements = [*bodies, *joints, *meshes, *turning, *(element for element, _ in torques)]
    system, core = _damped(scene, elements, bodies)
    return TrainModel(
        scene=scene,
        rolling=kinematics,
        system=system,
        core=core,
        start=consistent_start(system, 0.0),
        angle=angle,
        shafts=shafts,
        housing=housing,
        meshes=tuple(lines),
        torques=tuple((_direction(system, element), function) for element, function in torques),
        first=first,
        spin_reference=_spin_reference(scene, size, first),
        axial=_axial(scene, size),
        bores=_used_bores(scene),
    )


def _direction(system: System, element: LocalForce) -> Array:
    """Direction of a force on the whole system's coordinates."""
    found = np.zeros(system.size)
    np.add.at(found, system.index[system.elements.index(element)], element.W[:, 0])
    return found


def bore_selector(scene: TrainScene, bore: str) -> Array:
    """Columns that pick a bore's six coordinates from the housing's, shape (N, 6)."""
    assert scene.housing is not None
    return np.eye(scene.housing.size)[:, scene.housing.attachment(bore)]


def _housing(scene: TrainScene) -> ModalBlocks | None:
    body = scene.housing
    if body is None:
        return None
    damping = body.damping + scene.damping.alpha * body.mass + scene.damping.beta * body.stiffness
    return ModalBlocks(body.mass, damping, body.stiffness, name="housing")


def _supports(scene: TrainScene, shafts: tuple[RigidShaft, ...], housing: ModalBlocks | None) -> list[Element]:
    """Hinges or bearings of all bores, and the drive."""
    assert scene.drive is not None
    made: list[Element] = []
    bearings = {b.bore: b for b in scene.bearings}
    for shaft, body in zip(scene.shafts, shafts, strict=True):
        for bore in shaft.bores:
            chosen = None if housing is None else bore_selector(scene, bore)
            rows = bore_rows(body, scene.bore_points[bore], scene.frame, chosen)
            if bore in bearings:
                stiffness, damping = (np.array(x, dtype=float) for x in (bearings[bore].stiffness, bearings[bore].damping))
                damping = damping + scene.damping.beta * stiffness
                made.append(bearing(body, housing, rows, stiffness, damping, f"bearing {bore}"))
            else:
                made.append(hinge(body, housing, rows, f"hinge {bore}"))
        if scene.damping.alpha > 0.0:
            made.append(LinearForce((body,), scene.damping.alpha * body.mass(), np.zeros((6, 6)), f"damping of {body.name}"))
        if shaft.name == scene.drive.shaft:
            row = np.eye(6)[5:]
            touches: tuple[Element, ...] = (body,)
            if housing is not None:
                row = np.hstack([row, -(bore_selector(scene, scene.drive.bore)[:, 3:] @ scene.frame[2])[None, :]])
                touches = (body, housing)
            made.append(LinearJoint(touches, row, np.zeros(1), name="drive"))
    return made


def _mesh(
    scene: TrainScene,
    mesh: GearMesh,
    shafts: tuple[RigidShaft, ...],
    first: NDArray[np.int64],
    ratios: list[float],
    angle: TimeFunction,
    size: int,
) -> tuple[Element, MeshLine]:
    """Element and line of action of one mesh."""
    from ..gear import GearPair

    assert scene.drive is not None
    names = [s.name for s in scene.shafts]
    one, two = scene.gear(mesh.driver), scene.gear(mesh.driven)
    i, j = names.index(one.shaft), names.index(two.shaft)
    a = scene.frame[2]
    sense = math.copysign(1.0, ratios[i] * _drive_sense(scene.drive.speed))
    pair = GearPair(one.gear, two.gear, mesh.centre_distance)
    alpha = pair.working_pressure_angle
    arm = np.array(scene.shaft(two.shaft).point) - np.array(scene.shaft(one.shaft).point)
    arm = arm - (arm @ a) * a
    across = arm / np.linalg.norm(arm)
    line = math.cos(alpha) * sense * np.cross(a, across) + math.sin(alpha) * across
    low = max(g.along - 0.5 * g.gear.face_width for g in (one, two))
    high = min(g.along + 0.5 * g.gear.face_width for g in (one, two))
    base = np.array(scene.shaft(one.shaft).point)
    point = base + (0.5 * (low + high) - float(base @ a)) * a + pair.pinion_working_radius * across
    rows = [line @ shafts[i].point_rows(point, scene.frame), -line @ shafts[j].point_rows(point, scene.frame)]
    W = np.zeros((12, 2))
    W[:, 0] = np.concatenate(rows)
    W[5, 1] = 1.0
    row = np.zeros(size)
    row[first[i] : first[i] + 6] += rows[0]
    row[first[j] : first[j] + 6] += rows[1]
    bodies = (shafts[i], shafts[j])
    if mesh.stiffness is None:
        described = MeshLine(mesh.name, row, None, math.inf, 0.0, i, ratios[i], sense, 0.0, one.gear.module)
        return LinearJoint(bodies, W[:, :1].T, np.zeros(1), name=f"mesh {mesh.name}"), described
    curve = interpolant(mesh)
    mean = mean_value(curve)
    damping = mesh.damping + scene.damping.beta * mean
    described = MeshLine(mesh.name, row, curve, mean, damping, i, ratios[i], sense, mesh.phase, one.gear.module)
    parameters = packed(MESH, angle, mesh_numbers(ratios[i], sense, mesh.phase, mean, curve))
    element = MeshForce(
        bodies, W, python_law(parameters, 2), train_law, parameters, angle.breaks, f"mesh {mesh.name}", mean, damping
    )
    return element, described


def mean_value(curve: PeriodicInterpolant) -> float:
    """Mean of a curve over its period: the trapezium rule, and for cubics its correction with the slopes."""
    h = np.diff(curve.nodes)
    area = 0.5 * h @ (curve.values[:-1] + curve.values[1:])
    if curve.method == "cubic":
        area += (h * h / 12.0) @ (curve.slopes[:-1] - curve.slopes[1:])
    return float(area / curve.period)


def _drive_sense(speed: TimeFunction) -> float:
    """Sense in which the drive turns: its first speed that is not zero."""
    times = [0.0, *speed.breaks, *(0.5 * (a + b) for a, b in zip((0.0, *speed.breaks), speed.breaks, strict=False))]
    found = [float(speed(t)) for t in sorted(times)]
    return next((math.copysign(1.0, s) for s in found if s != 0.0), 1.0)


def _damped(scene: TrainScene, elements: list[Element], bodies: list[Element]) -> tuple[System, Minimal]:
    """System and minimal coordinates; modal damping is written in the modes of the coupled system itself."""
    system = System(elements)
    core = minimal(system)
    ratios = np.atleast_1d(np.asarray(scene.damping.ratio, dtype=float))
    if not ratios.any():
        return system, core
    count = len(core.squares)
    per_mode = np.append(ratios, np.full(max(0, count - len(ratios)), ratios[-1]))[:count]
    factors = 2.0 * per_mode * np.sqrt(np.maximum(core.squares, 0.0))
    back = core.T.T @ system.mass
    whole = LinearForce(tuple(bodies), back.T @ (factors[:, None] * back), np.zeros_like(system.mass), "modal damping")
    damped = System([*elements, whole])
    made = replace(core, system=damped, damping=core.damping + np.diag(factors))
    damped.__dict__["_minimal"] = made  # the modes are those without damping, and its matrix stays exactly diagonal
    return damped, made


def _used_bores(scene: TrainScene) -> tuple[str, ...]:
    used = {b for s in scene.shafts for b in s.bores}
    return tuple(name for name in scene.bore_points if name in used)


def _measured_against(scene: TrainScene, name: str) -> str:
    """Bore against which a shaft's rotation is measured: the drive's, the load's, or its first."""
    assert scene.drive is not None
    ends = [(scene.drive.shaft, scene.drive.bore), *((x.shaft, x.bore) for x in scene.loads)]
    return next((bore for shaft, bore in ends if shaft == name and bore is not None), scene.shaft(name).bores[0])


def _spin_reference(scene: TrainScene, size: int, first: NDArray[np.int64]) -> Array:
    rows = np.zeros((len(scene.shafts), size))
    for i, shaft in enumerate(scene.shafts):
        rows[i, first[i] + 5] = 1.0
        if scene.housing is not None:
            bore = bore_selector(scene, _measured_against(scene, shaft.name))
            rows[i, : len(bore)] -= bore[:, 3:] @ scene.frame[2]
    return rows


def _axial(scene: TrainScene, size: int) -> Array:
    bores = _used_bores(scene)
    rows = np.zeros((len(bores), size))
    if scene.housing is not None:
        for i, bore in enumerate(bores):
            selector = bore_selector(scene, bore)
            rows[i, : len(selector)] = selector[:, :3] @ scene.frame[2]
    return rows
