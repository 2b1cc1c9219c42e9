"""The add-on: oscura as a render engine in Blender. It runs the program oscura and reads its pictures."""

from . import engine, export, panels, preferences, properties

# In the order of their dependencies.
MODULES = (preferences, properties, engine, panels, export)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
