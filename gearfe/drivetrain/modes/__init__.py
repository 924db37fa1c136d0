"""Natural modes of a turning train: whirl, Campbell diagram, critical speeds, animation; no run-up is needed.

The steps are: `energies.train_forms` writes a `TrainModel` as energies of its parts. `turning` solves its eigenvalue
problem at a speed. `follow` follows the modes over the speed by their shapes. `whirl.train_modes` collects them in
`WhirlModes`. `critical` intersects these with the `orders` of meshes and shafts.
"""
