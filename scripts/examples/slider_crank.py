"""A slider crank that folds, built in Python: bodies, joints, gravity, forced start velocity, change points."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np

from gearfe.multibody import Body, Forced, Gravity, Hinge, Linkage, Slot, System, consistent_start, integrate


def slider_crank(angle: float) -> System:
    """Crank and rod of 1 m and 1 kg; the rod's end slides along the x axis."""
    crank = Body("crank", 1.0, 1 / 12, centre=(0.5, 0.0), angle=angle)
    rod = Body("rod", 1.0, 1 / 12, centre=(0.5, 0.0), position=(cos(angle), sin(angle)), angle=-angle)
    joints = (
        Hinge("crank", "ground", name="O"),
        Hinge("rod", "crank", (0.0, 0.0), (1.0, 0.0), name="A"),
        Slot("rod", "ground", (1.0, 0.0), name="B"),
    )
    return System([Linkage((crank, rod), joints, (Gravity((0.0, -9.81)),))])


def slider_speed(q: np.ndarray) -> np.ndarray:
    """Velocity of B in x as a row on the velocities: x of the rod's centre, less half a metre times sin times
    its rate."""
    row = np.zeros(6)
    row[3], row[5] = 1.0, -0.5 * sin(q[5])
    return row


def main() -> None:
    """Run 0..10 s from a slider speed of -4 m/s."""
    system = slider_crank(pi / 4)
    speed = Forced("slider speed", -4.0, lambda q: 0.0, slider_speed)  # noqa: ARG005
    start = consistent_start(system, velocities=[speed])
    run = integrate(system, np.linspace(0.0, 10.0, 2001), tolerance=1e-10, start=start)
    passages = run.statistics["change_points"]
    print(f"{run.message} in {run.statistics['steps']} steps")
    print(f"{len(passages)} change points, the first at {passages[0]:.6f} s")
    print(f"crank at the end: {run.q[-1, 2]:.12f} rad, {run.v[-1, 2]:.12f} rad/s")
    energy = sum(system.energy(run.q, run.v))
    print(f"energy {energy[0]:.12f} J, kept within {np.ptp(energy):.1e} J")


if __name__ == "__main__":
    main()
