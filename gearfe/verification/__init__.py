"""The oracle: contact of whole elastic bodies in all unknowns at once, assembled by scikit-fem.

It shares meshes, materials and the closest-point search with the program, and nothing else; only tests and benchmarks
use it.
"""
