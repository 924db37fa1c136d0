"""Steady states of a gear train over its speed, by harmonic balance: run-ups, both branches, stability.

The path of a job: `gearbox.job` and `drivetrain.train` make a `TrainModel`. `condensed.condense` keeps the few freedoms
at its meshes, with everything linear behind them as a dynamic flexibility. `balance` finds periodic motions, `follow`
continues them over the speed, and `stability` computes their Floquet multipliers. `run_up` makes a `RunUp` of them,
which `files` writes.
"""
