"""Teeth and whole gears as bodies: meshes of tooth sectors and of whole gears, and solids for CAD."""
