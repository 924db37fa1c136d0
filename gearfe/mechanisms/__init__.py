"""Mechanism files: TOML to a rigid system, named outputs, energies, joint reactions, sweeps and sensitivities."""

from .model import Mechanism, load_mechanism
from .results import Results, Sensitivities, evaluate
from .sensitivity import sensitivities
from .solve import Case, Solution, solve, sweep

__all__ = [
    "Case",
    "Mechanism",
    "Results",
    "Sensitivities",
    "Solution",
    "evaluate",
    "load_mechanism",
    "sensitivities",
    "solve",
    "sweep",
]
