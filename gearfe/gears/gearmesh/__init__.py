"""The mesh of two gears over rotation and load: sweep, curve and map, error estimate, fields, root stress, mesh law.

``sweep`` solves; ``curve`` and ``load_map`` are the results and need no finite elements; ``job`` and ``report`` belong
to the commands. ``law`` is the force of all tooth pairs over phase and approach, with a potential. ``law_make``
computes it from contacts by ``law_fit``, ``law_kernel`` evaluates it, ``law_store`` stores it.
"""
