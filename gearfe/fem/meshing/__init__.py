"""Meshes from geometry: the only package that calls gmsh and meshio. Millimetres inside gmsh, metres on the way out."""
