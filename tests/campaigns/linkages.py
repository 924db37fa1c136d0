"""Random planar linkages as tables of a mechanism file."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .pairs import chosen, log_uniform, rounded

Table = dict[str, Any]
Made = tuple[Table, dict[str, Any]]

GRAVITY = 9.81
#: Tolerance of mechanisms, as `gearfe.base.tables.mechanism` has it.
DEFAULT = 1e-9


def bar(length: float, mass: float, start: tuple[float, float], angle: float, **more: Any) -> Table:
    """A uniform rod from its frame's origin along x."""
    return {
        "mass_kg": mass,
        "inertia_kg_m2": mass * length**2 / 12,
        "centre_m": [0.5 * length, 0.0],
        "position_m": list(start),
        "angle_rad": angle,
        "points_m": {"A": [0.0, 0.0], "B": [length, 0.0]},
        **more,
    }


def hinge(body: str, point: str, to: str = "ground", to_point: Any = None) -> Table:
    """A hinge between named points."""
    return {"type": "hinge", "body": body, "point": point, "to": to, "to_point": to_point}


def job(bodies: Table, joints: Table, end: float, step: float, tolerance: float, **more: Any) -> Table:
    """A whole file, with gravity."""
    forces = {"gravity": {"type": "gravity", "acceleration_m_per_s2": [0.0, -GRAVITY]}, **more.pop("forces", {})}
    run = {"end_s": end, "step_s": step, "tolerance": tolerance, **more.pop("run", {})}
    return {"run": run, "bodies": bodies, "joints": joints, "forces": forces, **more}


def some_tolerance(random: np.random.Generator, low: float, high: float) -> float:
    """The default in nine of ten cases."""
    return float(chosen(random, DEFAULT, lambda: rounded(log_uniform(random, low, high), 2)))


def folding(random: np.random.Generator, *, end: float = 4.0, tolerance: float | None = None) -> Made:
    """Two equal links that fold: a random start that passes the fold with at least 0.5 rad/s, or never reaches it."""
    while True:
        theta, omega = random.uniform(0, 2 * math.pi), random.uniform(-8, 8)
        energy = (1 / 3 + math.sin(theta) ** 2) * omega**2 + GRAVITY * math.sin(theta)
        if (energy - GRAVITY) / (4 / 3) > 0.25 and abs(math.cos(theta)) > 1e-3:
            break
    tolerance = some_tolerance(random, 1e-13, 1e-4) if tolerance is None else tolerance
    c, s = math.cos(theta), math.sin(theta)
    bodies = {
        "crank": bar(1.0, 1.0, (0.0, 0.0), theta, rate_rad_per_s=omega),
        "rod": bar(1.0, 1.0, (c, s), -theta, velocity_m_per_s=[-s * omega, c * omega], rate_rad_per_s=-omega),
    }
    joints = {
        "O": hinge("crank", "A"),
        "A": hinge("rod", "A", "crank", "B"),
        "B": {"type": "slot", "body": "rod", "point": "B", "direction": [1.0, 0.0]},
    }
    start = {"positions": {"angle(crank)": theta}, "velocities": {"rate(crank)": omega}}
    tables = job(bodies, joints, end, end / 80, tolerance, start=start)
    return tables, {"theta": theta, "omega": omega, "amplification": 3.0}


def long_run(random: np.random.Generator) -> Made:
    """Folding links for 1000 s: the error of the angle grows with the time, the energy may not."""
    tables, data = folding(random, end=1000.0, tolerance=some_tolerance(random, 1e-12, 1e-8))
    tables["run"]["step_s"] = 2.0
    return tables, {**data, "amplification": 100.0}


def loops(random: np.random.Generator) -> Made:
    """A coupler on parallel cranks: each after the second adds a redundant constraint."""
    count = int(random.integers(3, 8))
    angle, rate = random.uniform(0.3, 1.2), float(random.choice([-1, 1])) * random.uniform(0.5, 2.0)
    length = rounded(random.uniform(0.5, 1.5), 3)
    c, s = length * math.cos(angle), length * math.sin(angle)
    bodies: Table = {}
    joints: Table = {}
    for i in range(count):
        place = (float(i), 0.0)
        bodies[f"c{i}"] = bar(length, rounded(random.uniform(0.5, 3.0), 3), place, angle, rate_rad_per_s=rate)
        joints[f"g{i}"] = hinge(f"c{i}", "A", "ground", list(place))
        joints[f"k{i}"] = {"type": "hinge", "body": f"c{i}", "point": "B", "to": "k", "to_point": [float(i), 0.0]}
    bodies["k"] = bar(count - 1.0, 2.0, (c, s), 0.0, velocity_m_per_s=[-s * rate, c * rate])
    tolerance = some_tolerance(random, 1e-11, 1e-5)
    return job(bodies, joints, 0.5, 0.01, tolerance), {"expected_redundant": count - 2}


def springs(random: np.random.Generator) -> Made:
    """A pendulum of two rods whose second joint is a stiff, short spring instead of a hinge."""
    stiffness = rounded(log_uniform(random, 1e2, 1e8), 3)
    one, two, gap = random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), rounded(random.uniform(0.05, 0.2), 3)
    place = (math.cos(one) + gap * math.cos(two), math.sin(one) + gap * math.sin(two))
    bodies = {
        "a": bar(1.0, 1.0, (0.0, 0.0), one),
        "b": bar(1.0, rounded(random.uniform(0.1, 5.0), 3), place, two),
    }
    joints = {"O": hinge("a", "A")}
    spring = {
        "type": "spring", "body": "b", "point": "A", "to": "a", "to_point": "B", "stiffness_N_per_m": stiffness,
        "free_length_m": gap, "damping_N_s_per_m": float(random.choice([0.0, 0.0, 1.0, 1e3])),
    }  # fmt: skip
    tolerance = some_tolerance(random, 1e-9, 1e-4)
    tables = job(bodies, joints, 0.3, 0.01, tolerance, forces={"joint": spring})
    return tables, {"amplification": 10.0}


def light(random: np.random.Generator) -> Made:
    """A four-bar linkage with a light coupler."""
    tables, data = four_bar(random)
    share = rounded(log_uniform(random, 1e-4, 1e-1), 3)
    for key in ("mass_kg", "inertia_kg_m2"):
        tables["bodies"]["coupler"][key] *= share
    return tables, {**data, "mass_share": share}


def four_bar(random: np.random.Generator) -> Made:
    """Crank, coupler and rocker that close, by construction from a random pose."""
    crank = rounded(random.uniform(0.2, 0.6), 3)
    angle, far = random.uniform(0.3, 2.8), (rounded(random.uniform(1.0, 1.6), 3), 0.0)
    elbow = np.array([crank * math.cos(angle), crank * math.sin(angle)])
    top = np.array([rounded(random.uniform(0.8, 1.6), 3), rounded(random.uniform(0.7, 1.3), 3)])
    reach, down = top - elbow, np.array(far) - top
    rate = float(random.choice([-1, 1])) * random.uniform(1.0, 6.0)
    bodies = {
        "crank": bar(crank, 1.0, (0.0, 0.0), angle, rate_rad_per_s=rate),
        "coupler": bar(float(np.hypot(*reach)), 1.0, tuple(elbow), math.atan2(reach[1], reach[0])),
        "rocker": bar(float(np.hypot(*down)), 1.0, tuple(top), math.atan2(down[1], down[0])),
    }
    joints = {
        "O": hinge("crank", "A"),
        "A": hinge("coupler", "A", "crank", "B"),
        "B": hinge("rocker", "A", "coupler", "B"),
        "C": hinge("rocker", "B", "ground", list(far)),
    }
    tolerance = some_tolerance(random, 1e-11, 1e-5)
    start = {"velocities": {"rate(crank)": rate}}
    return job(bodies, joints, 0.5, 0.01, tolerance, start=start), {"amplification": 10.0}


def chain(random: np.random.Generator) -> Made:
    """A closed chain: rods along a random polygon from one point of the ground to another, 4 to 40 of them."""
    count = round(log_uniform(random, 4, 40))
    turns = np.cumsum(random.normal(0.0, 0.9, count))
    lengths = random.uniform(0.3, 1.0, count)
    bodies: Table = {}
    joints: Table = {}
    place, before, point = np.zeros(2), "ground", "O"
    for i in range(count):
        name = f"b{i}"
        bodies[name] = bar(
            float(lengths[i]), rounded(random.uniform(0.5, 2.0), 3), (float(place[0]), float(place[1])), float(turns[i])
        )
        joints[f"j{i}"] = hinge(name, "A", before, point)
        place = place + lengths[i] * np.array([math.cos(turns[i]), math.sin(turns[i])])
        before, point = name, "B"
    joints["end"] = hinge(before, "B", "ground", "E")
    tolerance = some_tolerance(random, 1e-11, 1e-5)
    points = {"O": [0.0, 0.0], "E": [float(x) for x in place]}
    tables = job(bodies, joints, 0.5, 0.01, tolerance, ground={"points_m": points})
    return tables, {"links": count, "growth_per_s": 12.0, "amplification": 10.0}


#: Kinds beside the folding links, in the order in which they take turns.
KINDS = ("chain", "loops", "springs", "light", "long", "chain", "loops", "springs", "light", "chain")
MAKERS: dict[str, Callable[[np.random.Generator], Made]] = {
    "folding": folding,
    "long": long_run,
    "loops": loops,
    "springs": springs,
    "light": light,
    "chain": chain,
}


def linkage(random: np.random.Generator, kind: str) -> Made:
    """Tables of a random linkage of that kind, and what its checks need to know."""
    return MAKERS[kind](random)
