"""Integration by collocation at Radau and Gauss points.

`run` chooses the steps, `scheme` holds the coefficients. `kernel_collocation` is one step: `kernel_equations` evaluates
the stages, `kernel_elastic` flexible links, `kernel_matrices` solves, `kernel_stages` updates. `numpy_equations` does
the same for elements that are not written on a tape.
"""
