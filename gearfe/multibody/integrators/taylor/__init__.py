"""Integration by Taylor series.

Read in this order:

- `kernels`: the compiled loop of systems on a tape: steps, singular positions, the state on the constraints.
- `run`: prepares and runs them.
- `modal`, `kernel_modal`: gear trains in modal coordinates, and their compiled loop.
"""
