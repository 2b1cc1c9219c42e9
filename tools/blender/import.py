"""Exports a file of another program for oscura, by Blender's importers.

    blender --background --python import.py -- FILE.usdz FOLDER NAME ANSWER.json [...]
    python import.py -- ...                      where Python has the module bpy

The same as export.py for what the file becomes in Blender; imported.json beside the answer says what the import has to say.
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from oscura_blender import foreign  # noqa: E402  (the path comes first)
from oscura_blender.export import main  # noqa: E402

if __name__ == "__main__":
    main(foreign.as_blend(sys.argv[sys.argv.index("--") + 1 :]))
