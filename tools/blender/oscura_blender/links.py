"""Light linking and shadow linking: which objects a light lights, and which cast shadows in its light."""

KEYS = (("light_link", "receiver_collection"), ("shadow_link", "blocker_collection"))


class Links:
    """The collections that lights are linked to, and the objects that they hold."""

    def __init__(self, objects):
        self.members = {}  # by the name of a collection: names of objects that it includes, and of those that it excludes
        self.objects = {}  # by the name of a placement: that of the object that collections hold
        self.unsettled = []  # lists of nodes, each with the names of the objects that it is for
        self.shining = {}  # entries by the name of a placement
        for obj in objects:
            for _, collection in _collections(obj):
                if collection.name not in self.members:
                    self.members[collection.name] = _members(collection)

    def key(self, obj):
        """What tells an object from others that are linked otherwise."""
        if not self.members:
            return ()
        held = tuple((obj.name in include, obj.name in exclude) for include, exclude in self.members.values())
        return (*held, *((key, collection.name) for key, collection in _collections(obj)))

    def place(self, name, obj):
        """Takes down that an object is placed by that name."""
        if self.members:
            self.objects[name] = obj.name
            if entries := self.entries(obj):
                self.shining[name] = entries

    def entries(self, obj):
        """What the light of an object, a lamp or one that shines, is linked to; the nodes' names are known in the end only."""
        found = {}
        for key, collection in _collections(obj):
            include, exclude = self.members[collection.name]
            if include:
                found[key] = {"include": self._later(include - exclude)}
            elif exclude:
                found[key] = {"exclude": self._later(exclude)}
        return found

    def _later(self, names):
        nodes = []
        self.unsettled.append((nodes, names))
        return nodes

    def settle(self, names):
        """Fills in the names of objects, of all that there are."""
        written = [name for name in self.objects if name in names]
        for named, wanted in self.unsettled:
            # From the root, so that nothing else is meant.
            named[:] = sorted(f"/{name}" for name in written if self.objects[name] in wanted)


def _collections(obj):
    """The collections that the light of an object is linked to, by the keys of files."""
    linking = getattr(obj, "light_linking", None)
    found = [] if linking is None else [(key, getattr(linking, of)) for key, of in KEYS]
    return [(key, collection) for key, collection in found if collection is not None]


def _members(collection):
    """The names of the objects that a collection of links includes, and of those that it excludes. What is said of an object itself
    goes before what is said of a collection with it."""
    states = {}
    for child, link in zip(collection.children, collection.collection_children):
        states.update({obj.name: link.light_linking.link_state for obj in child.all_objects})
    for obj, link in zip(collection.objects, collection.collection_objects):
        states[obj.name] = link.light_linking.link_state
    return tuple({name for name, of in states.items() if of == state} for state in ("INCLUDE", "EXCLUDE"))
