"""The mesh of two gears over rotation and load: sweep, curve and map, error estimate, fields, root stress, report.

``sweep`` solves; ``curve`` and ``load_map`` are the results and need no finite elements; ``job`` and ``report`` belong
to the commands.
"""
