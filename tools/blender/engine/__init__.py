"""The render engine "Oscura" in Blender: it hands scenes to the program oscura and its pictures back to Blender."""

from . import engine, export, panels, preferences, properties

# In the order in which they need each other.
MODULES = (preferences, properties, engine, panels, export)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
