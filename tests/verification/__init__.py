"""The oracle: contact of whole elastic bodies in all unknowns at once, by scikit-fem.

`laws` what the pressure is, `forms` the weak form, `constitution` the bodies' forces, `contact_state` pairs of points
at one displacement, `newton` the solver; `bodies` and `problem` blocks, rings or Hertz' bodies, `whole_pair` and
`monolithic` two gears. It shares meshes, materials and the closest-point search with the program, and nothing else;
only tests and benchmarks use it.
"""
