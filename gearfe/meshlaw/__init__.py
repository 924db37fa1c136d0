"""The law of a gear mesh: force and torque of all tooth pairs over mesh phase and approach, with a potential.

`law` holds and evaluates it, `fit` makes it from pair forces, `make` from contact solutions, `store` keeps it.
"""
