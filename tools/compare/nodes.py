"""Values of Cycles' shader nodes at points: the truth of a test in tests/pictures/shader_nodes.rs. Writes tests/references/nodes/points.json.

    python -m venv blender && blender/bin/pip install bpy==5.0.1
    blender/bin/python tools/compare/nodes.py [PART OF A KIND]

A plane shows each output of each node in every mode in a picture of its own, whose pixels are exact: inputs are numbers, or the letters P (a
point), X, Y, Z (its coordinates), C (their absolute values), U and V (the fractions of the first and the last) and F (whole numbers).
"""

import json
import os
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from raw_exr import channels, set_up  # noqa: E402

FILE = Path(__file__).parents[2] / "tests" / "references" / "nodes" / "points.json"
SIZE, POINTS, BATCH = 12, 12, 60
POINT, TRIPLE = (0.6, -1.3, 0.8), (-0.4, 0.9, 0.3)

# By Blender's type: our kind, the identifiers of Blender's inputs and outputs in the order of ours.
KINDS = {
    "ShaderNodeMath": ("math", ["Value", "Value_001", "Value_002"], ["Value"]),
    "ShaderNodeVectorMath": ("vector_math", ["Vector", "Vector_001", "Vector_002", "Scale"], ["Vector", "Value"]),
    "ShaderNodeClamp": ("clamp", ["Value", "Min", "Max"], ["Result"]),
    "ShaderNodeMapping": ("mapping", ["Vector", "Location", "Rotation", "Scale"], ["Vector"]),
    "ShaderNodeVectorRotate": ("vector_rotate", ["Vector", "Center", "Axis", "Angle", "Rotation"], ["Vector"]),
    "ShaderNodeCombineColor": ("combine_color", ["Red", "Green", "Blue"], ["Color"]),
    "ShaderNodeSeparateColor": ("separate_color", ["Color"], ["Red", "Green", "Blue"]),
    "ShaderNodeHueSaturation": ("hue_saturation", ["Hue", "Saturation", "Value", "Fac", "Color"], ["Color"]),
    "ShaderNodeBrightContrast": ("brightness_contrast", ["Color", "Bright", "Contrast"], ["Color"]),
    "ShaderNodeGamma": ("gamma", ["Color", "Gamma"], ["Color"]),
    "ShaderNodeInvert": ("invert", ["Fac", "Color"], ["Color"]),
    "ShaderNodeRGBToBW": ("rgb_to_bw", ["Color"], ["Val"]),
    "ShaderNodeTexNoise": ("noise_texture", ["Vector", "W", "Scale", "Detail", "Roughness", "Lacunarity", "Offset", "Gain", "Distortion"], ["Fac", "Color"]),
    "ShaderNodeTexVoronoi": ("voronoi_texture", ["Vector", "W", "Scale", "Detail", "Roughness", "Lacunarity", "Smoothness", "Exponent", "Randomness"], ["Distance", "Color", "Position", "W", "Radius"]),
    "ShaderNodeTexWave": ("wave_texture", ["Vector", "Scale", "Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset"], ["Color", "Fac"]),
    "ShaderNodeTexMagic": ("magic_texture", ["Vector", "Scale", "Distortion"], ["Color", "Fac"]),
    "ShaderNodeTexGradient": ("gradient_texture", ["Vector"], ["Color", "Fac"]),
    "ShaderNodeTexChecker": ("checker_texture", ["Vector", "Color1", "Color2", "Scale"], ["Color", "Fac"]),
    "ShaderNodeTexBrick": ("brick_texture", ["Vector", "Color1", "Color2", "Mortar", "Scale", "Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height"], ["Color", "Fac"]),
    "ShaderNodeTexWhiteNoise": ("white_noise", ["Vector", "W"], ["Value", "Color"]),
    "ShaderNodeBlackbody": ("blackbody", ["Temperature"], ["Color"]),
    "ShaderNodeWavelength": ("wavelength", ["Wavelength"], ["Color"]),
    "ShaderNodeTexGabor": ("gabor_texture", ["Vector", "Scale", "Frequency", "Anisotropy", "Orientation 2D", "Orientation 3D"], ["Value", "Phase", "Intensity"]),
    "ShaderNodeMix": ("mix", None, None),
    "ShaderNodeMapRange": ("map_range", None, None),
}
RENAMED = {"noise_dimensions": "dimensions", "voronoi_dimensions": "dimensions", "gabor_type": "dimensions"}

cases = []


def case(kind, settings, inputs, *outputs):
    cases.extend((kind, settings, inputs, output) for output in outputs)


def arithmetic():
    operations = "ADD SUBTRACT MULTIPLY DIVIDE MULTIPLY_ADD POWER LOGARITHM SQRT INVERSE_SQRT ABSOLUTE EXPONENT MINIMUM MAXIMUM LESS_THAN GREATER_THAN SIGN COMPARE SMOOTH_MIN SMOOTH_MAX ROUND FLOOR CEIL TRUNC FRACT MODULO FLOORED_MODULO WRAP SNAP PINGPONG SINE COSINE TANGENT ARCSINE ARCCOSINE ARCTANGENT ARCTAN2 SINH COSH TANH RADIANS DEGREES"
    given = {"Value": "X", "Value_001": "Y", "Value_002": 0.7}
    for operation in operations.split():
        case("ShaderNodeMath", {"operation": operation}, given, "Value")
    case("ShaderNodeMath", {"operation": "POWER"}, {**given, "Value_001": 3.0}, "Value")
    case("ShaderNodeMath", {"operation": "ADD", "use_clamp": True}, given, "Value")
    operations = "ADD SUBTRACT MULTIPLY DIVIDE MULTIPLY_ADD CROSS_PRODUCT PROJECT REFLECT REFRACT FACEFORWARD SCALE NORMALIZE ABSOLUTE POWER SIGN MINIMUM MAXIMUM FLOOR CEIL FRACTION MODULO WRAP SNAP SINE COSINE TANGENT"
    given = {"Vector": "P", "Vector_001": POINT, "Vector_002": TRIPLE, "Scale": 0.8}
    for operation in operations.split():
        case("ShaderNodeVectorMath", {"operation": operation}, given, "Vector")
    for operation in "DOT_PRODUCT DISTANCE LENGTH".split():
        case("ShaderNodeVectorMath", {"operation": operation}, {"Vector": "P", "Vector_001": POINT}, "Value")
    for kind in "LINEAR STEPPED SMOOTHSTEP SMOOTHERSTEP".split():
        numbers = {"Value": "X", "From Min": -1.0, "From Max": 1.5, "To Min": 0.2, "To Max": 3.0, "Steps": 3.0}
        for clamp in (True, False):
            case("ShaderNodeMapRange", {"interpolation_type": kind, "clamp": clamp}, numbers, "Result")
        vectors = {"Vector": "P", "From_Min_FLOAT3": (-1, -1, -1), "From_Max_FLOAT3": (1, 1.5, 2), "To_Min_FLOAT3": (3, 0, 1), "To_Max_FLOAT3": (0, 1, 2), "Steps_FLOAT3": (3, 4, 5)}
        case("ShaderNodeMapRange", {"interpolation_type": kind, "data_type": "FLOAT_VECTOR"}, vectors, "Vector")
    for kind in ("MINMAX", "RANGE"):
        case("ShaderNodeClamp", {"clamp_type": kind}, {"Value": "X", "Min": 0.8, "Max": -0.4}, "Result")
    turned = {"Location": (0.1, 0.2, 0.3), "Rotation": (0.4, -0.7, 1.2), "Scale": (2, 0.5, -1)}
    for kind in "POINT TEXTURE VECTOR NORMAL".split():
        case("ShaderNodeMapping", {"vector_type": kind}, {"Vector": "P", **turned}, "Vector")
    turned = {"Center": (0.1, 0.2, 0.3), "Axis": (1, -0.5, 0.3), "Angle": 0.9, "Rotation": (0.4, -0.7, 1.2)}
    for kind in "AXIS_ANGLE X_AXIS Y_AXIS Z_AXIS EULER_XYZ".split():
        for invert in (False, True):
            case("ShaderNodeVectorRotate", {"rotation_type": kind, "invert": invert}, {"Vector": "P", **turned}, "Vector")


def colors():
    modes = "MIX DARKEN MULTIPLY BURN LIGHTEN SCREEN DODGE ADD OVERLAY SOFT_LIGHT LINEAR_LIGHT DIFFERENCE EXCLUSION SUBTRACT DIVIDE HUE SATURATION COLOR VALUE"
    for mode in modes.split():
        case("ShaderNodeMix", {"data_type": "RGBA", "blend_type": mode}, {"Factor_Float": 0.65, "A_Color": "P", "B_Color": (0.9, 0.4, 0.2, 1)}, "Result_Color")
    case("ShaderNodeMix", {"data_type": "FLOAT"}, {"Factor_Float": "X", "A_Float": 0.3, "B_Float": "Y"}, "Result_Float")
    case("ShaderNodeMix", {"data_type": "VECTOR", "factor_mode": "NON_UNIFORM", "clamp_factor": False}, {"Factor_Vector": "P", "A_Vector": (0.3, 0.1, 0.2), "B_Vector": (1, 2, 3)}, "Result_Vector")
    for mode in "RGB HSV HSL".split():
        case("ShaderNodeCombineColor", {"mode": mode}, {"Red": "U", "Green": 0.6, "Blue": "V"}, "Color")
        case("ShaderNodeSeparateColor", {"mode": mode}, {"Color": "C"}, "Red", "Green", "Blue")
    case("ShaderNodeHueSaturation", {}, {"Hue": 0.7, "Saturation": 1.3, "Value": 0.8, "Fac": 0.7, "Color": "C"}, "Color")
    case("ShaderNodeBrightContrast", {}, {"Color": "C", "Bright": 0.2, "Contrast": 0.4}, "Color")
    case("ShaderNodeGamma", {}, {"Color": "C", "Gamma": 2.2}, "Color")
    case("ShaderNodeInvert", {}, {"Fac": 0.8, "Color": "C"}, "Color")
    case("ShaderNodeRGBToBW", {}, {"Color": "C"}, "Val")
    for kelvin in (800, 1500, 3000, 5500, 6500, 9000, 15000):
        case("ShaderNodeBlackbody", {}, {"Temperature": float(kelvin)}, "Color")
    for nanometres in (350, 410, 470, 530, 590, 650, 710, 800):
        case("ShaderNodeWavelength", {}, {"Wavelength": float(nanometres)}, "Color")


def textures():
    for dimensions in "1D 2D 3D 4D".split():
        w = "X" if dimensions == "1D" else 0.37
        for kind in "FBM MULTIFRACTAL RIDGED_MULTIFRACTAL HYBRID_MULTIFRACTAL HETERO_TERRAIN".split():
            for normalize in (True, False) if kind == "FBM" else (False,):
                for detail, distortion in ((0.0, 0.0), (2.4, 0.0), (3.0, 0.6)):
                    if kind == "FBM" or detail > 0:
                        settings = {"noise_dimensions": dimensions, "noise_type": kind, "normalize": normalize}
                        inputs = {"Vector": "P", "W": w, "Scale": 2.3, "Detail": detail, "Roughness": 0.6, "Lacunarity": 2.1, "Offset": 0.3, "Gain": 1.4, "Distortion": distortion}
                        case("ShaderNodeTexNoise", settings, inputs, "Color")
        for feature in "F1 F2 SMOOTH_F1 DISTANCE_TO_EDGE N_SPHERE_RADIUS".split():
            of_place = ["Distance", "Color", "W" if dimensions == "1D" else "Position"]
            outputs = {"DISTANCE_TO_EDGE": ["Distance"], "N_SPHERE_RADIUS": ["Radius"]}.get(feature, of_place)
            settings = {"voronoi_dimensions": dimensions, "feature": feature}
            inputs = {"Vector": "P", "W": w, "Scale": 1.7, "Smoothness": 0.7, "Randomness": 0.8}
            case("ShaderNodeTexVoronoi", settings, inputs, *outputs)
            if feature != "N_SPHERE_RADIUS":
                fractal = {**inputs, "Detail": 2.4, "Roughness": 0.6, "Lacunarity": 2.2}
                for normalize in (False, True):
                    case("ShaderNodeTexVoronoi", {**settings, "normalize": normalize}, fractal, *outputs)
            if feature in ("F1", "F2") and dimensions in ("2D", "3D"):
                for metric in "MANHATTAN CHEBYCHEV MINKOWSKI".split():
                    inputs = {"Vector": "P", "W": w, "Scale": 1.7, "Exponent": 0.7}
                    case("ShaderNodeTexVoronoi", {**settings, "distance": metric}, inputs, "Distance", "Color")
        case("ShaderNodeTexWhiteNoise", {"noise_dimensions": dimensions}, {"Vector": "F", "W": 3.0}, "Value", "Color")
    for kind, key, directions in (("BANDS", "bands_direction", "X Y Z DIAGONAL"), ("RINGS", "rings_direction", "X Y Z SPHERICAL")):
        for direction in directions.split():
            case("ShaderNodeTexWave", {"wave_type": kind, key: direction}, {"Vector": "P", "Scale": 0.4, "Phase Offset": 0.3}, "Fac")
    for profile in "SIN SAW TRI".split():
        inputs = {"Vector": "P", "Scale": 0.4, "Distortion": 3.0, "Detail": 2.3, "Detail Scale": 1.4, "Detail Roughness": 0.6}
        case("ShaderNodeTexWave", {"wave_profile": profile}, inputs, "Color")
    for depth in range(11):
        case("ShaderNodeTexMagic", {"turbulence_depth": depth}, {"Vector": "P", "Scale": 1.1, "Distortion": 1.3}, "Color")
    for kind in "LINEAR QUADRATIC EASING DIAGONAL SPHERICAL QUADRATIC_SPHERE RADIAL".split():
        case("ShaderNodeTexGradient", {"gradient_type": kind}, {"Vector": "P"}, "Fac")
    case("ShaderNodeTexChecker", {}, {"Vector": "P", "Scale": 2.7}, "Color", "Fac")
    case("ShaderNodeTexBrick", {}, {"Vector": "P", "Scale": 1.3}, "Color", "Fac")
    settings = {"offset": 0.3, "offset_frequency": 3, "squash": 0.6, "squash_frequency": 2}
    inputs = {"Vector": "P", "Scale": 1.3, "Mortar Size": 0.05, "Mortar Smooth": 0.5, "Bias": 0.2}
    case("ShaderNodeTexBrick", settings, inputs, "Color", "Fac")
    for kind in ("2D", "3D"):
        for anisotropy in (0.0, 0.6, 1.0):
            inputs = {"Vector": "P", "Scale": 1.7, "Frequency": 2.2, "Anisotropy": anisotropy, "Orientation 2D": 0.6, "Orientation 3D": (0.5, -0.4, 0.8)}
            case("ShaderNodeTexGabor", {"gabor_type": kind}, inputs, "Value", "Phase", "Intensity")


def plane():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    own = bpy.context.scene
    set_up(own, SIZE, samples=1, filter_width=0.01)
    bpy.ops.mesh.primitive_plane_add(size=2)
    item = bpy.context.object
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    own.collection.objects.link(camera)
    own.camera, camera.location = camera, (0, 0, 2)
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.98
    return item


def sources(tree):
    """The values of the letters."""
    new, link = tree.nodes.new, tree.links.new
    place, mapping = new("ShaderNodeTexCoord"), new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0.7, 0.4, 0.3)
    mapping.inputs["Location"].default_value = (0.13, 0.27, 0.41)
    mapping.inputs["Scale"].default_value = (2.1, 1.9, 1.0)
    link(place.outputs["Object"], mapping.inputs["Vector"])
    point = mapping.outputs["Vector"]

    def vector(operation, given):
        made = new("ShaderNodeVectorMath")
        made.operation = operation
        if operation == "SCALE":
            made.inputs["Scale"].default_value = 7.0
        link(given, made.inputs[0])
        return made.outputs[0]

    parts = new("ShaderNodeSeparateXYZ")
    link(point, parts.inputs[0])
    fractions = []
    for i in (0, 2):
        made = new("ShaderNodeMath")
        made.operation = "FRACT"
        link(parts.outputs[i], made.inputs[0])
        fractions.append(made.outputs[0])
    x, y, z = parts.outputs
    return {"P": point, "X": x, "Y": y, "Z": z, "C": vector("ABSOLUTE", point), "U": fractions[0], "V": fractions[1], "F": vector("FLOOR", vector("SCALE", point))}


def pictures(item, batch):
    """The pixels of the points and of each case."""
    layer = bpy.context.scene.view_layers[0]
    while layer.aovs:
        layer.aovs.remove(layer.aovs[0])
    shown = bpy.data.materials.new("cases")
    shown.use_nodes = True
    tree = shown.node_tree
    tree.nodes.clear()
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(emission.outputs[0], output.inputs[0])
    given = sources(tree)

    def show(name, socket):
        aov, view = tree.nodes.new("ShaderNodeOutputAOV"), layer.aovs.add()
        aov.aov_name = view.name = name
        view.type = "COLOR"
        tree.links.new(socket, aov.inputs["Color"])

    show("P", given["P"])
    known = {}
    for number, (kind, settings, inputs, output) in batch:
        key = (kind, repr(settings), repr(inputs))
        made = known.get(key)
        if made is None:
            made = known[key] = tree.nodes.new(kind)
            for name, value in settings.items():
                setattr(made, name, value)
            for name, value in inputs.items():
                socket = next(s for s in made.inputs if s.identifier == name)
                if isinstance(value, str):
                    tree.links.new(given[value], socket)
                else:
                    socket.default_value = value
        show(f"case{number}", next(s for s in made.outputs if s.identifier == output))
    item.data.materials.clear()
    item.data.materials.append(shown)
    with tempfile.TemporaryDirectory() as folder:
        bpy.context.scene.render.filepath = os.path.join(folder, "picture.exr")
        bpy.ops.render.render(write_still=True)
        found = channels(bpy.context.scene.render.filepath)
    # Every twelfth pixel and a bit, so that the points lie all over.
    chosen = [i * (SIZE * SIZE // POINTS) + i % SIZE for i in range(POINTS)]

    def values(name):
        planes = [next(p for n, p in found.items() if name in n.split(".") and n.endswith("." + c)) for c in "RGB"]
        rows = np.stack(planes, -1).reshape(-1, 3)[chosen]
        return [[float(f"{x:.8g}") for x in row] for row in rows]

    return values("P"), {number: values(f"case{number}") for number, _ in batch}


def ours(kind, settings, inputs, output):
    """A case in scene file keys."""
    name, names, outputs = KINDS[kind]
    if kind == "ShaderNodeMix":
        of = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}[settings["data_type"]]
        listed, number = [inputs.get(k) for k in ("Factor_Float", "Factor_Vector", "A_" + of, "B_" + of)], 0
    elif kind == "ShaderNodeMapRange":
        names = ("From_Min", "From_Max", "To_Min", "To_Max", "Steps")
        of_vectors = [inputs.get("Vector")] + [inputs.get(k + "_FLOAT3") for k in names]
        of_numbers = [inputs.get("Value")] + [inputs.get(k.replace("_", " ")) for k in names]
        listed, number = of_vectors if "Vector" in inputs else of_numbers, 0
        settings = {k: v for k, v in settings.items() if k != "data_type"}
    else:
        listed, number = [inputs.get(k) for k in names], outputs.index(output)
    settings = {RENAMED.get(k, k): v.lower() if isinstance(v, str) else v for k, v in settings.items()}
    return {"kind": name, "settings": settings, "inputs": [v[:3] if isinstance(v, tuple) else v for v in listed], "output": number}


def main():
    only = sys.argv[1] if len(sys.argv) > 1 else ""
    arithmetic()
    colors()
    textures()
    item = plane()
    numbered = [(i, c) for i, c in enumerate(cases) if only in KINDS[c[0]][0]]
    points, result = None, []
    for first in range(0, len(numbered), BATCH):
        batch = numbered[first : first + BATCH]
        points, values = pictures(item, batch)
        result += [{**ours(*c), "values": values[i]} for i, c in batch]
    if only:
        kept = [c for c in json.loads(FILE.read_text())["cases"] if only not in c["kind"]]
        result = kept + result
    text = json.dumps({"points": points, "cases": result}).replace('{"kind"', '\n{"kind"')
    FILE.write_text(text + "\n")
    print(len(result), "cases")


main()
