"""The other programs: one module each. Each runs in a process of its own, with one thread and a time limit.

`found` tells which are there; a study prints the reason for the others and goes on without them.
"""
