"""Studies: one job in many cases, on any number of processes, with nothing lost."""
