"""Tables of the job files, one frozen dataclass each: plain data with units in the names, no numerics, no imports."""
