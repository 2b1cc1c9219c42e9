"""Exports scenes of Blender 4.2 and newer for oscura: glTF by Blender's own exporter, and a file of settings beside it
that holds what glTF can't carry."""
