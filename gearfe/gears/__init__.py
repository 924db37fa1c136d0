"""Gear pairs: geometry of the teeth, elastic contact, mesh stiffness, load maps, and the law of a gear mesh."""
