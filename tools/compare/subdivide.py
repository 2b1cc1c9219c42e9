"""What Blender's subdivision (OpenSubdiv) makes of a coarse sheet: the tables of tests/references/subdivision.

    python -m venv blender && blender/bin/pip install bpy==5.0.1
    blender/bin/python tools/compare/subdivide.py

Rows are position and texture coordinates of each corner that differs, on the limit surface after two steps, of
sheet.obj; sharp.csv keeps corners of open edges, round.csv doesn't.
"""

from pathlib import Path

import bpy

FOLDER = Path(__file__).parents[2] / "tests" / "references" / "subdivision"


def sheet():
    """Positions, faces and texture coordinates of corners."""
    positions, coordinates, faces = [], [], []
    for line in (FOLDER / "sheet.obj").read_text().splitlines():
        word, *rest = line.split()
        if word == "v":
            positions.append([float(x) for x in rest])
        elif word == "vt":
            coordinates.append([float(x) for x in rest])
        elif word == "f":
            faces.append([[int(x) - 1 for x in corner.split("/")] for corner in rest])
    return positions, faces, coordinates


def subdivided(boundary):
    positions, faces, coordinates = sheet()
    mesh = bpy.data.meshes.new("sheet")
    mesh.from_pydata(positions, [], [[vertex for vertex, _ in face] for face in faces])
    layer = mesh.uv_layers.new(name="uv")
    for i, (_, coordinate) in enumerate(corner for face in faces for corner in face):
        layer.data[i].uv = coordinates[coordinate]
    item = bpy.data.objects.new("sheet", mesh)
    bpy.context.collection.objects.link(item)
    modifier = item.modifiers.new("subdivision", "SUBSURF")
    modifier.levels, modifier.use_limit_surface, modifier.quality = 2, True, 10
    modifier.boundary_smooth, modifier.uv_smooth = boundary, "PRESERVE_BOUNDARIES"
    fine = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    uvs = fine.uv_layers[0].data
    corner = lambda loop: (*fine.vertices[loop.vertex_index].co, *uvs[loop.index].uv)
    return sorted({tuple(round(x, 5) for x in corner(loop)) for loop in fine.loops})


for name, boundary in ("sharp", "PRESERVE_CORNERS"), ("round", "ALL"):
    rows = (",".join(f"{x:.5f}" for x in row) for row in subdivided(boundary))
    (FOLDER / f"{name}.csv").write_text("\n".join(rows) + "\n")
