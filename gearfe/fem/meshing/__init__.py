"""Meshes from geometry: the only room that talks to gmsh and meshio. Millimetres inside gmsh, metres on the way out."""
