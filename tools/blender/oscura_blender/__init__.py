"""Exports scenes of Blender 4.2 and newer: a scene file, and its meshes, images, strands and grids."""
