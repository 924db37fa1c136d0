"""Elastic shafts as Timoshenko beams of high degree, and their reduction to few coordinates."""

from .reduced import GyroscopicPair, ReducedShaft, full_shaft, reduce_shaft
from .section import LOADS, BeamShaft, Disc, Section, Station
from .whirl import Support, whirl_frequencies

__all__ = [
    "LOADS",
    "BeamShaft",
    "Disc",
    "GyroscopicPair",
    "ReducedShaft",
    "Section",
    "Station",
    "Support",
    "full_shaft",
    "reduce_shaft",
    "whirl_frequencies",
]
