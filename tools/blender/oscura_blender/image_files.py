"""The files of the images of a scene, which its node trees read: packed and generated ones, tiles, sequences."""

import os
import shutil

import bpy

# Endings of the formats of images that oscura reads.
ENDINGS = {
    "PNG": ".png", "JPEG": ".jpg", "OPEN_EXR": ".exr", "OPEN_EXR_MULTILAYER": ".exr", "HDR": ".hdr", "TARGA": ".tga", "TARGA_RAW": ".tga",
    "TIFF": ".tif", "BMP": ".bmp", "WEBP": ".webp",
}  # fmt: skip


class Images:
    """The files of images: those that are packed or made by Blender are written to a folder, others stay where they are or are copied."""

    def __init__(self, folder, name, has_links):
        self.folder, self.name, self.has_links = folder, name, has_links
        self._files, self._count = {}, 0

    def file(self, image):
        """The name of an image's file; None for one that can't be read."""
        if image not in self._files:
            self._files[image] = self._written(image)
        return self._files[image]

    def magenta(self):
        """An image of one magenta texel, which Blender has for those without a file."""
        if "" not in self._files:
            image = bpy.data.images.new("missing", 1, 1, alpha=True)
            image.pixels[:] = (1.0, 0.0, 1.0, 1.0)
            self._files[""] = self._saved(image)
            bpy.data.images.remove(image)
        return self._files[""]

    def frame(self, image, user):
        """The file of an image of a sequence at this frame."""
        return self._placed(bpy.path.abspath(image.filepath_from_user(image_user=user), library=image.library))

    def tiles(self, image):
        """Numbers and files of the tiles of an image, as far as they are there."""
        packed = {os.path.basename(bpy.path.abspath(one.filepath)): one for one in getattr(image, "packed_files", ())}
        for tile in image.tiles:
            path = bpy.path.abspath(image.filepath_raw.replace("<UDIM>", str(tile.number)), library=image.library)
            held = packed.get(os.path.basename(path))
            if held is not None and path not in self._files:
                self._files[path] = self._kept(held.data, path)
            file = self._files[path] if held is not None else self._placed(path)
            if file is not None:
                yield tile.number, file

    def _named(self, path, ending=None):
        number, self._count = self._count, self._count + 1
        return f"{self.name}.image{number}{ending or os.path.splitext(path)[1].lower()}"

    def _kept(self, data, path, ending=None):
        file = self._named(path, ending)
        with open(os.path.join(self.folder, file), "wb") as stream:
            stream.write(data)
        return file

    def _placed(self, path, ending=None):
        if not os.path.isfile(path):
            return None
        if self.has_links and ending is None:
            return path
        if path not in self._files:
            self._files[path] = self._named(path, ending)
            shutil.copyfile(path, os.path.join(self.folder, self._files[path]))
        return self._files[path]

    def _written(self, image):
        path = bpy.path.abspath(image.filepath_raw, library=image.library) if image.filepath_raw else ""
        own = os.path.splitext(path or image.name)[1].lower()
        ending = None if own in ENDINGS.values() or own == ".jpeg" else ENDINGS.get(image.file_format, "")
        if image.source == "GENERATED" or image.is_dirty or ending == "":
            # Of formats that oscura doesn't read as well.
            return self._saved(image)
        if image.packed_file is not None:
            return self._kept(image.packed_file.data, path or image.name, ending)
        return self._placed(path, ending)

    def _saved(self, image):
        file = self._named("", ".exr" if image.is_float else ".png")
        own = image.file_format
        image.file_format = "OPEN_EXR" if image.is_float else "PNG"
        try:
            image.save(filepath=os.path.join(self.folder, file), save_copy=True)
        except RuntimeError:
            return None
        finally:
            image.file_format = own
        return file


def is_missing(image):
    """Has an image lost its file?"""
    is_own = image.packed_file is not None or image.source != "FILE" or image.is_dirty
    return not is_own and not os.path.isfile(bpy.path.abspath(image.filepath_raw, library=image.library))
