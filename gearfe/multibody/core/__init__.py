"""The core of a multibody system, which knows no linkage, no gear and no integrator.

Read in this order:

- `contract`: what a body, a joint or a force provides. Everything else follows from it.
- `system`: elements stacked into one state; sums of their masses, forces and constraints.
- `start`, `second_order`: a consistent start, and how many degrees of freedom the constraints leave.
- `elimination`, `mass_regularisation`: minimal coordinates of linear constraints; links of next to no mass.
- `tape_evaluation`: values and derivatives, in NumPy, of what elements write on a tape.
- `steps`, `dense`, `trajectory`: where steps end, what lies between them, and the result of a run.
- `stopped`: why a run ended early. `equilibrium`, `modes`, `inverse`: analyses without integration.
"""
