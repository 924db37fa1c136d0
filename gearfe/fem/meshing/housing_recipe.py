"""Version of the meshes that `housing_mesh` and `cad` make: for the cache, without loading the mesher."""

#: Raised when anything there changes the meshes that come out (element sizes, the order of surface algorithms).
RECIPE = 4
