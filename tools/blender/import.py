"""Exports a file of another program (USD, FBX, Alembic, ...) by Blender's importers.

    blender --background --python import.py -- FILE.usdz FOLDER NAME ANSWER.json [...]
    python import.py -- ...                      with a Python that has the module bpy

The same as export.py for the imported scene; messages of the import go to imported.json beside ANSWER.json.
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from oscura_blender import importers  # noqa: E402
from oscura_blender.export import main  # noqa: E402

if __name__ == "__main__":
    main(importers.as_blend(sys.argv[sys.argv.index("--") + 1 :]))
