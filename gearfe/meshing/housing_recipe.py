"""Which meshes of housings `gearfe.meshing.housing_mesh` makes: for the cache, without loading the mesher."""

#: Raised when anything there changes the meshes that come out.
RECIPE = 3
