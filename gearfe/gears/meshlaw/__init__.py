"""The law of a gear mesh: force and torque of all tooth pairs over mesh phase and approach, with a potential.

`law` holds it and evaluates it by `kernel`, `fit` makes it from pair forces, `make` from contacts, `store` keeps it.
"""
