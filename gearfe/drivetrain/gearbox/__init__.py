"""A gear train as its job file describes it: read once, for transients and for steady running alike.

`job` reads ``[train]`` and what belongs to it and makes a `train.GearTrain`, `mesh_stiffness` the stiffness of
its meshes. What both kinds of answers share lies here, too: fields of gears and housing, radiated power, stability.
"""
