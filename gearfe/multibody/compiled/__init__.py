"""Compiled kernels: how functions in the subset of numba become machine code that starts in milliseconds.

Read in this order:

- `kernels`: binds the functions of a loop together, compiles them once and keeps their code in the cache folder.
- `packed`, `packed_type`, `parts`: records of arrays handed over as one block of addresses.
- `object_code`: links the kept code without loading numba; the module names the private parts of numba that it uses.
- `simd`, `simd_type`: numbers side by side in the vectors of the processor.
"""
