"""What several tests make: gears, trains, meshes, mechanisms, files."""
