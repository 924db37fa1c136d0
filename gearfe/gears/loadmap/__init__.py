"""Mesh stiffness and tooth-root stress over twist and rotation: sweep, map, report."""
