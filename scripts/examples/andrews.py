"""Andrews' squeezing mechanism through the Python interface: read, start, integrate, compare two accuracies."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from gearfe.mechanisms import evaluate, load_mechanism
from gearfe.multibody import integrate

FILE = Path(__file__).resolve().parents[2] / "geometry" / "andrews.toml"


def main() -> None:
    """Integrate 0..0.03 s and print the seven angles at the end."""
    mechanism = load_mechanism(FILE)
    start = mechanism.start()
    free = start.freedoms
    print(f"{free.coordinates} coordinates, {free.constraints} constraints, {free.net} free")

    times = np.linspace(0.0, 0.03, 301)
    fine = integrate(mechanism.system, times, tolerance=1e-12, start=start)
    begin = time.process_time()
    quick = integrate(mechanism.system, times, tolerance=1e-9, start=start)
    spent = time.process_time() - begin
    print(f"{quick.method}, {quick.statistics['steps']} steps, {1e3 * spent:.2f} ms CPU")
    print(f"largest difference to the finer run: {np.abs(quick.q - fine.q).max():.1e} (m, rad)")

    results = evaluate(mechanism, fine)
    for name, column in results.outputs.items():
        print(f"{name:>20} {column[-1]: .12f}")
    total = results.energy["total_J"]
    print(f"energy less work of the drive stays within {np.ptp(total):.1e} J")


if __name__ == "__main__":
    main()
