"""Planar mechanisms: bodies, joints and forces as plain data, and what they write for the integrators.

Read in this order:

- `forms`: the algebra of affine and quadratic forms in which joints and forces are written.
- `bodies`, `joints`, `couplings`, `forces`, `turning`: the data. A new joint or force is one class here.
- `variables`: what loads and the linkage write of bodies on a tape.
- `assembly`, `linkage`: all of them as one element of the contract.
- `quadratic`: joints between any elements whose rows are quadratic.
- `beam_link`, `beam`, `floating`: flexible links as beams and as bodies with a floating frame.
"""
