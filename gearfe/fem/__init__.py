"""Finite elements: plane and solid elasticity, sparse factorisation, reduction, and meshing (the only user of gmsh)."""
