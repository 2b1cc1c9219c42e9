"""Exports scenes of Blender 4.2 and newer for oscura: a scene file with meshes, hair, grids and pictures beside it."""
