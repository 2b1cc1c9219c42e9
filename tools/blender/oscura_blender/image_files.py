"""The files of images: packed and generated ones, tiles (UDIM) and sequences."""

import os
import shutil

import bpy

from . import final_render

# File name extensions of the image formats that oscura reads.
EXTENSIONS = {
    "PNG": ".png", "JPEG": ".jpg", "OPEN_EXR": ".exr", "OPEN_EXR_MULTILAYER": ".exr", "HDR": ".hdr", "TARGA": ".tga", "TARGA_RAW": ".tga",
    "TIFF": ".tif", "BMP": ".bmp", "WEBP": ".webp",
}  # fmt: skip


class Images:
    """Copies images to the folder of the scene file; with links, image files are named where they are. Methods return file names; None for
    what can't be read."""

    def __init__(self, folder, name, has_links):
        self.folder, self.name, self.has_links = folder, name, has_links
        self._files, self._count = {}, 0

    def file(self, image):
        if image not in self._files:
            self._files[image] = self._export(image)
        return self._files[image]

    def missing(self):
        """A magenta image of one pixel, as Blender shows for missing files."""
        if "" not in self._files:
            image = bpy.data.images.new("missing", 1, 1, alpha=True)
            image.pixels[:] = (1.0, 0.0, 1.0, 1.0)
            self._files[""] = self._save(image)
            bpy.data.images.remove(image)
        return self._files[""]

    def frame(self, image, user):
        """The file of a sequence at the current frame."""
        return self._copy(bpy.path.abspath(image.filepath_from_user(image_user=user), library=image.library))

    def tiles(self, image):
        """The numbers and files of the tiles of an image whose files exist."""
        packed = {os.path.basename(bpy.path.abspath(one.filepath)): one for one in image.packed_files}
        for tile in image.tiles:
            path = bpy.path.abspath(image.filepath_raw.replace("<UDIM>", str(tile.number)), library=image.library)
            content = packed.get(os.path.basename(path))
            if content is not None and path not in self._files:
                self._files[path] = self._write(content.data, path)
            file = self._files[path] if content is not None else self._copy(path)
            if file is not None:
                yield tile.number, file

    def _new_name(self, path, extension=None):
        number, self._count = self._count, self._count + 1
        return f"{self.name}.image{number}{extension or os.path.splitext(path)[1].lower()}"

    def _write(self, data, path, extension=None):
        file = self._new_name(path, extension)
        with open(os.path.join(self.folder, file), "wb") as stream:
            stream.write(data)
        return file

    def _copy(self, path, extension=None):
        if not os.path.isfile(path):
            return None
        if self.has_links and extension is None:
            return path
        if path not in self._files:
            self._files[path] = self._new_name(path, extension)
            shutil.copyfile(path, os.path.join(self.folder, self._files[path]))
        return self._files[path]

    def _export(self, image):
        path = path_of(image) if image.filepath_raw else ""
        own = os.path.splitext(path or image.name)[1].lower()
        # Names may lack an extension, or have that of another format.
        extension = None if own in EXTENSIONS.values() or own == ".jpeg" else EXTENSIONS.get(image.file_format, "")
        if image.source == "GENERATED" or image.is_dirty or extension == "":
            return self._save(image)
        if image.packed_file is not None:
            return self._write(image.packed_file.data, path or image.name, extension)
        return self._copy(path, extension)

    def _save(self, image):
        file = self._new_name("", ".exr" if image.is_float else ".png")
        with final_render.overridden(image, file_format="OPEN_EXR" if image.is_float else "PNG"):
            try:
                image.save(filepath=os.path.join(self.folder, file), save_copy=True)
            except RuntimeError:
                return None
        return file


def path_of(image):
    return bpy.path.abspath(image.filepath_raw, library=image.library)


def is_missing(image):
    needs_no_file = image.packed_file is not None or image.source != "FILE" or image.is_dirty
    return not needs_no_file and not os.path.isfile(path_of(image))
