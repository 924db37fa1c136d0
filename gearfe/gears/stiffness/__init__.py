"""Mesh stiffness of a gear pair: the sweep over rotations, curve, error estimate, fields.

``sweep`` is the front door; ``positions`` solve; ``curve`` is the result and needs no finite
elements; ``job`` and ``report`` belong to the command.
"""
