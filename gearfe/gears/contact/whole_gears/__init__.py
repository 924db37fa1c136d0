"""Contact of two whole elastic gears with all their unknowns at once, written as scikit-fem forms.

The independent check of the contact laws: no compliance, no cyclic symmetry, no windows of flank. On the same mesh and
quadrature points the condensed gears have to give the same torques; what they cost differs a hundredfold.

`forms` is the weak form of the contact, and `constitution` the internal forces of the bodies. `contact_state` has the
pairs of points at one displacement, `newton` the solver, `segments` its quadrature. `bodies` and `problem` hold for any
plane bodies, `pair` and `position` for two gears. The package shares meshes, materials, the laws' parameters and the
closest-point search with the condensed gears, and nothing else: an import contract holds that.
"""
