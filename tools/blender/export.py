"""Exports a .blend file for oscura.

    blender --background --python export.py -- FILE.blend FOLDER NAME ANSWER.json [--frame N] [--scene NAME] [...]
    python export.py -- ...                      with a Python that has the module bpy

Writes NAME.toml and its files to FOLDER, and warnings, notes and a possible error to ANSWER.json.
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from oscura_blender.export import main  # noqa: E402

if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :])
