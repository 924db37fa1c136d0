"""Integration by collocation at Radau and Gauss points.

Read in this order:

- `scheme`: coefficients of the stages.
- `kernels`: one step, compiled; `numpy_equations`: the same for elements that are not written on a tape.
- `work_space`: state, tables and scratch arrays of a step.
- `run`: chooses the steps and keeps what they pass through.
"""
