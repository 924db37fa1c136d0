"""Integrators, and the rule that chooses between them.

Read in this order:

- `integrate`: the one call for all methods, with the rule of ``method="auto"``.
- `taylor`: Taylor series, for smooth systems that are written on a tape and for gear trains in modal coordinates.
- `collocation`: Radau IIA and Gauss points, for stiff systems, flexible links and elements without a series.
- `discontinuities`: where steps of collocation end at corners, jumps and knots.

docs/integrators.md explains the rule.
"""
