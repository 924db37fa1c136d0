"""Gears with face widths: elastic teeth, lines of contact, helices, lead modifications, misalignment."""

from .compliance import WideCompliance, wide_compliance
from .flanks import EndRelief, LeadModification, Misalignment, WideFlanks
from .lines import ContactLines, contact_lines
from .mesh import WideMesh
from .sweep import WidthSweep, sweep_width

__all__ = [
    "ContactLines",
    "EndRelief",
    "LeadModification",
    "Misalignment",
    "WideCompliance",
    "WideFlanks",
    "WideMesh",
    "WidthSweep",
    "contact_lines",
    "sweep_width",
    "wide_compliance",
]
