"""Light linking and shadow linking: the objects that a light illuminates, and those that block it."""

import bpy

# Keys of scene files, and properties of `light_linking` in Blender.
COLLECTIONS = {"light_link": "receiver_collection", "shadow_link": "blocker_collection"}


class Links:
    """The light linking of all objects. Tables are filled in the end, when the objects in the scene file are known."""

    def __init__(self):
        collections = {collection.name: collection for obj in bpy.data.objects for _, collection in _collections(obj)}
        self.members = {name: _members(collection) for name, collection in collections.items()}
        self.linked_objects = {}  # by the name of an instance: the object that collections contain
        self.unfilled = []  # lists of names in tables, each with the objects for it
        self.of_meshes = {}  # tables of emissive meshes, by the name of an instance

    def key(self, obj):
        """A key that is the same for objects with the same light linking."""
        if not self.members:
            return ()
        contained = tuple((obj.name in include, obj.name in exclude) for include, exclude in self.members.values())
        return (*contained, *((key, collection.name) for key, collection in _collections(obj)))

    def add(self, name, obj):
        if self.members:
            self.linked_objects[name] = obj.name
            if tables := self.tables(obj):
                self.of_meshes[name] = tables

    def tables(self, obj):
        """The entries of a light or an emissive mesh."""
        tables = {}
        for key, collection in _collections(obj):
            include, exclude = self.members[collection.name]
            if include or exclude:
                names = []
                self.unfilled.append((names, include - exclude if include else exclude))
                tables[key] = {"include" if include else "exclude": names}
        return tables

    def fill(self, written):
        """Fills the tables, by the names of all objects in the scene file; the slash means the root."""
        known = [name for name in self.linked_objects if name in written]
        for names, objects in self.unfilled:
            names[:] = sorted(f"/{name}" for name in known if self.linked_objects[name] in objects)


def _collections(obj):
    """The collections that the light of an object is linked to, by key."""
    found = ((key, getattr(obj.light_linking, name)) for key, name in COLLECTIONS.items())
    return [(key, collection) for key, collection in found if collection is not None]


def _members(collection):
    """The names of the objects that a collection includes, and of those that it excludes. The state of an object has precedence over that of
    a child collection."""
    states = {}
    for child, link in zip(collection.children, collection.collection_children):
        states.update({obj.name: link.light_linking.link_state for obj in child.all_objects})
    for obj, link in zip(collection.objects, collection.collection_objects):
        states[obj.name] = link.light_linking.link_state
    return tuple({name for name, state in states.items() if state == wanted} for wanted in ("INCLUDE", "EXCLUDE"))
