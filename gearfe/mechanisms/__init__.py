"""Mechanism files: TOML to a rigid system, named outputs, energies, joint reactions."""

from .model import Mechanism, load_mechanism
from .results import Results, evaluate

__all__ = ["Mechanism", "Results", "evaluate", "load_mechanism"]
