"""Bodies of solid elements: meshes with their matrices and surfaces, checks, error estimates and refinement."""
