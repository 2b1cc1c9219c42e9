"""The state that all parts of an export share: settings, messages, the cache, and the objects of the scene."""

from collections import namedtuple

from .cache import Cache
from .image_files import Images
from .light_linking import Links

# An instance of a mesh: the name of its object, its matrix, a key that identifies it at all frames, and values for the Object Info node.
Placement = namedtuple("Placement", ("name", "matrix", "key", "info"))


class MeshEntry:
    """A mesh to write: an object at the origin that owns it, its instances, and their visibility and light group."""

    def __init__(self, obj, traits):
        self.object, self.traits = obj, traits
        self.placements = []


class Export:
    """The export of a view layer of a scene."""

    def __init__(self, options, scene, layer, report):
        self.options, self.scene, self.layer, self.report = options, scene, layer, report
        self.folder, self.name = options.folder, options.name
        self.cache = Cache(options.cache)
        self.images = Images(options.folder, options.name, options.links)
        self.links = Links()
        # The factor of Cycles' film on all light.
        self.exposure = scene.cycles.film_exposure if scene.render.engine == "CYCLES" else 1.0
        self.depsgraph = None
        self.boxes = None  # corners of the bounding boxes of all visible objects in the world, shape (boxes, 8, 3)
        self.moves = None  # `motion.Moves`; None without motion blur
        self.meshes = {}  # of `MeshEntry`; None for objects without faces
        self.lights = []  # object, matrix and key
        self.cameras = []  # objects
        self.strands = []  # of `hair.StrandsEntry`
        self.media = {}  # tables of materials that are media without a surface
        self.volumes = {}  # names of volume objects by key
        self._counts = {}

    def mesh_entries(self):
        return [entry for entry in self.meshes.values() if entry is not None]

    def new_file(self, kind, extension):
        """The name of a new file beside the scene file."""
        number = self._counts[kind] = self._counts.get(kind, -1) + 1
        return f"{self.name}.{kind}{number}{extension}"
