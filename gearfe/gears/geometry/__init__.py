"""Gears and gear pairs: exact profiles, checks, geometry of the mesh (ISO 21771), ISO 1328-1 tolerances. NumPy only."""

from .pair import Gear, GearPair, PathPoint, TipRelief

__all__ = ["Gear", "GearPair", "PathPoint", "TipRelief"]
