"""The language in which systems are handed to compiled loops, and Taylor series of what is written in it.

Read in this order:

- `tape`: registers, rows and forces; `timefunctions`: functions of time.
- `ordering`, `row_tables`: the order of elimination, and constant tables of the rows.
- `work_space`: arrays that one run changes.
- `recurrences`: the compiled loops over registers, rows and orders of the motion. They call each other in every order
  of every step.
"""
