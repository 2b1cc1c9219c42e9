"""What Cycles' shader nodes give on surfaces: the truth of tests/pictures/shader_nodes.rs. Writes tests/references/nodes/surface.json, the meshes
and pictures beside it.

    python -m venv blender && blender/bin/pip install bpy==5.0.1
    blender/bin/python tools/compare/nodes_surface.py [PART OF A LABEL]

A ball and a plane, both turned and stretched, with attributes of every width, fill the camera's view. Each case is an output of a node; its
picture is the mean of Cycles' samples in blocks of 6x6 pixels, left to right, top to bottom.
"""

import json
import math
import os
import struct
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

sys.path.insert(0, str(Path(__file__).parent))
from raw_exr import channels, set_up  # noqa: E402

FOLDER = Path(__file__).parents[2] / "tests" / "references" / "nodes"
SIZE, BLOCK, SAMPLES = 48, 6, 256
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))
OTHER = Matrix.LocRotScale(Vector((0.4, -0.2, 0.3)), Euler((0.3, 0.2, 0.5)), Vector((1.5, 0.7, 1.1)))


def node(identifier, output, settings=None, inputs=None):
    """A Blender node with its settings, input values, and the selected output."""
    return {"node": identifier, "output": output, "settings": settings or {}, "inputs": inputs or {}}


def texture_coordinate(output):
    return node("ShaderNodeTexCoord", output)


def cases():
    """By label: a Blender node, and its counterpart in a scene file (its output, its table)."""
    all_cases = {}

    def add(label, blender, output, **table):
        all_cases[label] = (blender, output, table)

    for output in ("UV", "Generated", "Normal", "Object", "Camera", "Window", "Reflection"):
        add(f"texture_coordinate {output}", texture_coordinate(output), output.lower(), type="texture_coordinate")
    inverse = [x for row in OTHER.inverted() for x in row]
    other = node("ShaderNodeTexCoord", "Object", {"object": "other"})
    add("texture_coordinate of another object", other, "object", type="texture_coordinate", object_matrix=inverse)
    for output in ("Position", "Normal", "Tangent", "True Normal", "Incoming", "Parametric", "Backfacing"):
        name = output.lower().replace(" ", "_")
        add(f"geometry {output}", node("ShaderNodeNewGeometry", output), name, type="geometry")
    for name in ("weight", "pair", "arrow", "tint", "missing"):
        for output in ("Color", "Vector", "Fac", "Alpha"):
            blender = node("ShaderNodeAttribute", output, {"attribute_name": name})
            ours = {"Fac": "factor"}.get(output, output.lower())
            add(f"attribute {name} {output}", blender, ours, type="attribute", name=name)
    for name in ("", "second map"):
        add(f"uv_map '{name}'", node("ShaderNodeUVMap", "UV", {"uv_map": name}), "uv", type="uv_map", name=name)
    for output in ("Color", "Alpha"):
        blender = node("ShaderNodeVertexColor", output, {"layer_name": "tint"})
        add(f"color_attribute {output}", blender, output.lower(), type="color_attribute", name="tint")
    for output in ("Location", "Color", "Alpha", "Object Index", "Material Index"):
        name = output.lower().replace(" ", "_")
        add(f"object_info {output}", node("ShaderNodeObjectInfo", output), name, type="object_info")
    for output in ("View Vector", "View Z Depth", "View Distance"):
        name = output.lower().replace(" ", "_")
        add(f"camera_data {output}", node("ShaderNodeCameraData", output), name, type="camera_data")
    for output in ("Is Camera Ray", "Is Shadow Ray", "Is Diffuse Ray", "Is Glossy Ray", "Is Singular Ray", "Is Reflection Ray", "Is Transmission Ray", "Ray Length", "Ray Depth"):
        name = output.lower().replace(" ", "_")
        add(f"light_path {output}", node("ShaderNodeLightPath", output), name, type="light_path")
    add("fresnel", node("ShaderNodeFresnel", "Fac", inputs={"IOR": 1.7}), "factor", type="fresnel", ior=1.7)
    bent = node("ShaderNodeFresnel", "Fac", inputs={"IOR": 1.7, "Normal": "object coordinates"})
    add("fresnel Normal", bent, "factor", type="fresnel", ior=1.7, normal="given.vector")
    for output in ("Fresnel", "Facing"):
        for blend in (0.3, 0.8):
            plain = node("ShaderNodeLayerWeight", output, inputs={"Blend": blend})
            add(f"layer_weight {output} {blend}", plain, output.lower(), type="layer_weight", blend=blend)
        bent = node("ShaderNodeLayerWeight", output, inputs={"Blend": 0.4, "Normal": "object coordinates"})
        add(f"layer_weight {output} Normal", bent, output.lower(), type="layer_weight", blend=0.4, normal="given.vector")
    for axis in "XYZ":
        blender = node("ShaderNodeTangent", "Tangent", {"direction_type": "RADIAL", "axis": axis})
        add(f"tangent {axis}", blender, "tangent", type="tangent", axis=axis.lower())
    add("tangent uv_map", node("ShaderNodeTangent", "Tangent", {"direction_type": "UV_MAP"}), "tangent", type="tangent", direction_type="uv_map")
    add("wireframe", node("ShaderNodeWireframe", "Fac", inputs={"Size": 0.08}), "factor", type="wireframe", size=0.08)
    for kind in ("VECTOR", "POINT", "NORMAL"):
        for source in ("WORLD", "OBJECT", "CAMERA"):
            for target in ("WORLD", "OBJECT", "CAMERA"):
                if source != target:
                    settings = {"vector_type": kind, "convert_from": source, "convert_to": target}
                    blender = node("ShaderNodeVectorTransform", "Vector", settings, {"Vector": "object coordinates"})
                    ours = {k: v.lower() for k, v in settings.items()}
                    add(f"vector_transform {kind} {source} {target}", blender, "vector", type="vector_transform", vector="given.vector", **ours)
    normals(add)
    images(add)
    return all_cases


def normals(add):
    """Normal maps and bumps."""
    color = (0.7, 0.35, 0.85, 1)
    for space in ("TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"):
        for strength in (1.0, 0.4):
            blender = node("ShaderNodeNormalMap", "Normal", {"space": space}, {"Strength": strength, "Color": color})
            add(f"normal_map {space} {strength}", blender, "normal", type="normal_map", space=space.lower(), strength=strength, color=list(color[:3]))
    blender = node("ShaderNodeNormalMap", "Normal", {"uv_map": "second map"}, {"Color": color})
    add("normal_map of the second map", blender, "normal", type="normal_map", uv_map="second map", color=list(color[:3]))
    for label, settings, inputs in (
        ("", {}, {"Strength": 1.0, "Distance": 0.2}),
        ("strength", {}, {"Strength": 0.4, "Distance": 0.2}),
        ("invert", {"invert": True}, {"Strength": 1.0, "Distance": 0.1}),
    ):
        blender = node("ShaderNodeBump", "Normal", settings, {**inputs, "Height": "noise"})
        ours = {k.lower(): v for k, v in {**settings, **inputs}.items()}
        add(f"bump {label}", blender, "normal", type="bump", height="noise.factor", **ours)
    blender = node("ShaderNodeBump", "Normal", {}, {"Distance": 0.3, "Height": "picture"})
    add("bump of a picture", blender, "normal", type="bump", distance=0.3, height="picture.color")
    dot = node("ShaderNodeNormal", "Dot", {}, {"Normal": "object coordinates"})
    add("normal Dot", dot, "dot", type="normal", normal="given.vector")


def images(add):
    """Image nodes in all their modes. Vectors other than texture coordinates are sampled without filtering,
    as in Cycles."""

    def image(label, output, vector="object coordinates", alpha="", space="sRGB", **settings):
        blender = node("ShaderNodeTexImage", output, {"image": "picture.png", **settings}, {"Vector": vector})
        blender["alpha_mode"], blender["color_space"] = alpha or "STRAIGHT", space
        ours = {"projection_blend": "blend"}
        table = {ours.get(k, k): v.lower() if isinstance(v, str) else v for k, v in settings.items()}
        table["vector"] = {"object coordinates": "given.vector", "uv": "geometry.uv", "generated": "geometry.generated"}[vector]
        if alpha:
            table["alpha_mode"] = alpha.lower()
        if space != "sRGB":
            table["color_space"] = space.lower()
        add(f"image_texture {label} {output}", blender, output.lower(), type="image_texture", file="picture.png", **table)

    for interpolation in ("Linear", "Closest", "Cubic"):
        for extension in ("REPEAT", "EXTEND", "CLIP", "MIRROR"):
            image(f"{interpolation} {extension}", "Color", interpolation=interpolation, extension=extension)
            image(f"{interpolation} {extension}", "Alpha", interpolation=interpolation, extension=extension)
    for alpha in ("STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"):
        for output in ("Color", "Alpha", "Both"):
            image(alpha, output, alpha=alpha)
            image(f"{alpha} Non-Color", output, alpha=alpha, space="Non-Color")
    for projection, blend in (("BOX", 0.0), ("BOX", 0.3), ("SPHERE", 0.0), ("TUBE", 0.0)):
        image(f"{projection} {blend}", "Color", vector="generated", projection=projection, projection_blend=blend)
    image("of texture coordinates", "Color", vector="uv")
    for projection in ("EQUIRECTANGULAR", "MIRROR_BALL"):
        blender = node("ShaderNodeTexEnvironment", "Color", {"image": "picture.png", "projection": projection}, {"Vector": "object coordinates"})
        add(f"environment_texture {projection}", blender, "color", type="environment_texture", file="picture.png", projection=projection.lower(), vector="given.vector")


def write_picture(path):
    """Writes an image of 12x8 texels with smooth and hard edges and alpha."""
    picture = bpy.data.images.new("picture", 12, 8, alpha=True)
    y, x = np.mgrid[0:8, 0:12]
    color = np.stack([x / 11, y / 7, ((x // 3 + y // 2) % 2) * 0.8 + 0.1, 0.3 + 0.7 * ((x + y) % 5 > 1)], -1)
    picture.pixels.foreach_set(color.astype(np.float32).ravel())
    picture.file_format, picture.filepath_raw = "PNG", str(path)
    picture.save()
    bpy.data.images.remove(picture)


def triangles(item):
    """The mesh of an object: a row for each corner of each triangle, with the names of its columns and of its attributes."""
    mesh = item.data
    mesh.calc_loop_triangles()
    loops = np.array([loop for t in mesh.loop_triangles for loop in t.loops])
    vertices = np.array([mesh.loops[i].vertex_index for i in loops])
    normals = np.array([n.vector for n in mesh.corner_normals])[loops]
    # Cycles shades flat faces by their triangles, Blender's normals of corners are those of polygons.
    for i, triangle in enumerate(mesh.loop_triangles):
        if not mesh.polygons[triangle.polygon_index].use_smooth:
            normals[3 * i : 3 * i + 3] = triangle.normal
    columns = ["x", "y", "z", "nx", "ny", "nz", "s", "t"]
    uv = np.array([d.uv for d in mesh.uv_layers[0].data])[loops]
    parts = [np.array([v.co for v in mesh.vertices])[vertices], normals, uv]
    names = []
    for attribute in mesh.attributes:
        if attribute.name.startswith(".") or attribute.name in ("position", "UVMap", "sharp_face", "material_index"):
            continue
        key = {"FLOAT": "value", "FLOAT2": "vector", "FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color", "BYTE_COLOR": "color"}.get(attribute.data_type)
        if key is None:
            continue
        values = np.array([getattr(d, key) for d in attribute.data])
        values = values.reshape(len(values), -1)
        values = values[loops] if attribute.domain == "CORNER" else values[vertices]
        columns += [f"a{len(names)}_{k}" for k in range(values.shape[1])]
        names.append((attribute.name, values.shape[1]))
        parts.append(values)
    indices = [mesh.polygons[t.polygon_index].material_index for t in mesh.loop_triangles]
    return np.concatenate(parts, 1).astype("<f4"), columns, names, indices


def write_ply(path, item):
    rows, columns, names, indices = triangles(item)
    head = ["ply", "format binary_little_endian 1.0"]
    head += [f"comment oscura attribute {i} {width} {name}" for i, (name, width) in enumerate(names)]
    head += [f"element vertex {len(rows)}"] + [f"property float {c}" for c in columns]
    head += [f"element face {len(rows) // 3}", "property list uchar int vertex_indices", "property uchar material_index", "end_header", ""]
    with path.open("wb") as file:
        file.write("\n".join(head).encode())
        file.write(rows.tobytes())
        for i, index in enumerate(indices):
            file.write(struct.pack("<B3iB", 3, 3 * i, 3 * i + 1, 3 * i + 2, index))


def attributes(mesh):
    """Attributes of every width that vary over the surface."""
    places = [v.co.copy() for v in mesh.vertices]
    for name, kind in (("weight", "FLOAT"), ("pair", "FLOAT2"), ("arrow", "FLOAT_VECTOR"), ("tint", "FLOAT_COLOR")):
        mesh.attributes.new(name, kind, "POINT")
    mesh.uv_layers.new(name="second map", do_init=False)
    weight, pair, arrow, tint = (mesh.attributes[name] for name in ("weight", "pair", "arrow", "tint"))
    for i, p in enumerate(places):
        weight.data[i].value = 0.5 + 0.3 * p.x
        pair.data[i].vector = (0.2 + p.y, 0.7 - 0.5 * p.x)
        arrow.data[i].vector = (p.y, -0.5 * p.z, 0.3 + p.x)
        tint.data[i].color = (0.5 + 0.4 * p.x, 0.5 - 0.3 * p.y, 0.6, 0.5 + 0.4 * p.y)
    second = mesh.uv_layers["second map"]
    for loop in mesh.loops:
        p = places[loop.vertex_index]
        second.data[loop.index].uv = (0.3 * p.x + 0.5, 0.4 * p.y - 0.1 * p.x + 0.5)


def scene():
    """A sphere in front of a plane; the name of each object with its matrix."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    ball.name = "ball"
    ball.matrix_world = Matrix.LocRotScale(Vector((0.3, 0.2, -0.4)), Euler((0.4, -0.7, 1.2)), Vector((0.9, 0.6, 0.7)))
    bpy.ops.mesh.primitive_grid_add(size=2, x_subdivisions=2, y_subdivisions=2)
    plane = bpy.context.object
    plane.name = "plane"
    for vertex in plane.data.vertices:
        vertex.co.z = 0.05 * vertex.co.x * vertex.co.y + 0.02 * vertex.co.x
    plane.matrix_world = Matrix.LocRotScale(Vector((-0.2, 3.0, 0.3)), Euler((1.3, 0.2, 0.3)), Vector((6.0, 5.0, 1.0)))
    for item, index, color in ((ball, 3, (0.2, 0.5, 0.7, 0.4)), (plane, 7, (0.8, 0.3, 0.1, 0.9))):
        attributes(item.data)
        item.pass_index, item.color = index, color
    other = bpy.data.objects.new("other", None)
    bpy.context.collection.objects.link(other)
    other.matrix_world = OTHER
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0.4, -4.0, 0.6), (1.45, 0.05, 0.08)
    camera.data.sensor_width, camera.data.lens = 36, 50
    # Rays of Cycles have no length up to there.
    camera.data.clip_start = 1e-4
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    return ball, plane, camera


def material(batch, layer):
    """A material with an output for each case."""
    own = bpy.data.materials.new("cases")
    own.pass_index = 5
    own.use_nodes = True
    tree = own.node_tree
    tree.nodes.clear()
    output, emission = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(emission.outputs[0], output.inputs[0])
    sources = {}

    def source(name):
        """Vectors that inputs are linked to."""
        if name == "noise":
            made = tree.nodes.new("ShaderNodeTexNoise")
            made.inputs["Scale"].default_value = 1.5
            tree.links.new(source("object coordinates"), made.inputs["Vector"])
            return made.outputs[0]
        if name == "picture":
            made = tree.nodes.new("ShaderNodeTexImage")
            made.image, made.interpolation = bpy.data.images.load(str(FOLDER / "picture.png")), "Cubic"
            made.image.alpha_mode = "NONE"
            tree.links.new(source("uv"), made.inputs["Vector"])
            return made.outputs[0]
        if name not in sources:
            made = tree.nodes.new("ShaderNodeTexCoord")
            sources[name] = made.outputs[{"object coordinates": "Object", "uv": "UV", "generated": "Generated", "normal": "Normal"}[name]]
        return sources[name]

    for number, (label, (blender, _, _)) in enumerate(batch):
        made = tree.nodes.new(blender["node"])
        for key, value in blender["settings"].items():
            if key == "object":
                value = bpy.data.objects[value]
            if key == "image":
                value = bpy.data.images.load(str(FOLDER / value))
                value.colorspace_settings.name = blender.get("color_space", "sRGB")
                value.alpha_mode = blender.get("alpha_mode", "STRAIGHT")
            setattr(made, key, value)
        for key, value in blender["inputs"].items():
            socket = made.inputs[key]
            if isinstance(value, str):
                tree.links.new(source(value), socket)
            else:
                socket.default_value = value
        aov = tree.nodes.new("ShaderNodeOutputAOV")
        aov.aov_name = f"case{number}"
        if blender["output"] == "Both":
            both = tree.nodes.new("ShaderNodeVectorMath")
            tree.links.new(made.outputs["Color"], both.inputs[0])
            tree.links.new(made.outputs["Alpha"], both.inputs[1])
            tree.links.new(both.outputs[0], aov.inputs["Color"])
        else:
            tree.links.new(made.outputs[blender["output"]], aov.inputs["Color"])
        if "step" in blender:
            step = tree.nodes.new("ShaderNodeMath")
            step.operation, step.inputs[1].default_value = "GREATER_THAN", blender["step"]
            tree.links.new(made.outputs[blender["output"]], step.inputs[0])
            tree.links.new(step.outputs[0], aov.inputs["Color"])
        view = layer.aovs.add()
        view.name, view.type = aov.aov_name, "COLOR"
    return own


def pictures(batch, items):
    """The means of blocks of each case."""
    own = bpy.context.scene
    layer = own.view_layers[0]
    while layer.aovs:
        layer.aovs.remove(layer.aovs[0])
    shown = material(batch, layer)
    for item in items:
        item.data.materials.clear()
        item.data.materials.append(shown)
    with tempfile.TemporaryDirectory() as folder:
        own.render.filepath = os.path.join(folder, "picture.exr")
        bpy.ops.render.render(write_still=True)
        found = channels(own.render.filepath)
    result = {}
    for number, (label, _) in enumerate(batch):
        planes = []
        for color in "RGB":
            name = next(n for n in found if f"case{number}" in n.split(".") and n.endswith("." + color))
            planes.append(found[name].reshape(SIZE // BLOCK, BLOCK, SIZE // BLOCK, BLOCK).mean((1, 3)))
        result[label] = [float(f"{x:.6g}") for x in np.stack(planes, -1).ravel()]
    return result


def write_cases(path, known, values, camera, items):
    """Writes the references of a test; cases without new values keep their old ones."""
    before = json.loads(path.read_text())["cases"] if path.exists() and len(values) < len(known) else []
    kept = {case["label"]: case for case in before}
    for label, (blender, output, table) in known.items():
        if label in values:
            kept[label] = {"label": label, "output": output, "node": table, "values": values[label]}
            if "step" in blender:
                kept[label]["step"] = blender["step"]
    matrix = lambda m: [x for row in Y_UP @ m for x in row]
    angle = 2 * math.atan(camera.data.sensor_width / 2 / camera.data.lens)
    result = {
        "camera": {"matrix": matrix(camera.matrix_world), "vfov_deg": math.degrees(angle)},
        "objects": {item.name: {"matrix": matrix(item.matrix_world), "color": list(item.color), "index": item.pass_index} for item in items},
        "size": SIZE,
        "block": BLOCK,
        "cases": [kept[label] for label in known if label in kept],
    }
    lines = json.dumps(result).replace('{"label"', '\n{"label"')
    path.write_text(lines + "\n")
    print(len(values), "cases")


def main():
    only = sys.argv[1] if len(sys.argv) > 1 else ""
    FOLDER.mkdir(parents=True, exist_ok=True)
    ball, plane, camera = scene()
    set_up(bpy.context.scene, SIZE, samples=SAMPLES, filter_width=1.0)
    write_picture(FOLDER / "picture.png")
    write_ply(FOLDER / "ball.ply", ball)
    write_ply(FOLDER / "plane.ply", plane)
    known = cases()
    chosen = [(label, case) for label, case in known.items() if only in label]
    values = {}
    # Cycles makes one of nodes that are alike: those whose alpha is read would change what the others give.
    reads_alpha = lambda case: case[1][0]["node"] == "ShaderNodeTexImage" and case[1][0]["output"] != "Color"
    for part in ([c for c in chosen if not reads_alpha(c)], [c for c in chosen if reads_alpha(c)]):
        for first in range(0, len(part), 40):
            values.update(pictures(part[first : first + 40], (ball, plane)))
    write_cases(FOLDER / "surface.json", known, values, camera, (ball, plane))


if __name__ == "__main__":
    main()
