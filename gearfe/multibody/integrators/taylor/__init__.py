"""Integration by Taylor series.

`run` prepares and runs systems on a tape. `kernel_run` is its loop, `kernel_steps` the length of a step;
`kernel_singular` and `kernel_locate` pass singular positions. `modal` and `kernel_modal` integrate gear trains in modal
coordinates.
"""
