"""Blender interiors lit through glass, by mirrors or water: default shaders, solid panes, sun and sky."""

import math

import bpy

from blend_parts import add, camera, light, link, material, shader, world


def _wall(of, low, high, name, holes=()):
    """A box between two corners; holes are cut by boolean boxes."""
    wall = add("cube", of, [(a + b) / 2 for a, b in zip(low, high)], name, size=1)
    wall.scale = [b - a for a, b in zip(low, high)]
    for number, (near, far) in enumerate(holes):
        cutter = _wall(None, near, far, f"{name} hole {number}")
        cutter.hide_render, cutter.display_type = True, "WIRE"
        cut = wall.modifiers.new("Hole", "BOOLEAN")
        cut.object, cut.operation = cutter, "DIFFERENCE"
    return wall


def _cushion(of, low, high, name, turn=0.0):
    """A box with rounded edges."""
    box = _wall(of, low, high, name)
    box.rotation_euler = (0, 0, turn)
    bpy.context.view_layer.objects.active = box
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    bevel = box.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = 0.05, 3
    return box


WINDOW = ((1.95, -0.9, 0.8), (2.25, 0.9, 2.1))


def _lounge():
    """A room with a sofa and a window in its right wall, seen from its corner; sunlight reaches the floor."""
    world((0.5, 0.65, 0.9), 1.5)
    paint = material("paint", Base_Color=(0.8, 0.78, 0.74, 1))
    boards = material("boards", Base_Color=(0.35, 0.2, 0.1, 1), Roughness=0.35)
    _wall(boards, (-2.2, -2.2, -0.1), (2.2, 2.2, 0), "Floor")
    _wall(paint, (-2.2, -2.2, 2.6), (2.2, 2.2, 2.7), "Ceiling")
    _wall(paint, (-2.2, 2.0, -0.1), (2.2, 2.2, 2.7), "Back")
    _wall(paint, (-2.2, -2.2, -0.1), (2.2, -2.0, 2.7), "Front")
    _wall(paint, (-2.2, -2.2, -0.1), (-2.0, 2.2, 2.7), "Left")
    _wall(paint, (2.0, -2.2, -0.1), (2.2, 2.2, 2.7), "Right", [WINDOW])
    cloth = material("cloth", Base_Color=(0.15, 0.3, 0.4, 1), Roughness=0.9, Sheen_Weight=0.3)
    _cushion(cloth, (-1.9, 0.2, 0.05), (-1.0, 1.8, 0.45), "Seat")
    _cushion(cloth, (-1.95, 0.2, 0.35), (-1.65, 1.8, 0.95), "Rest")
    _cushion(cloth, (-1.7, 0.25, 0.42), (-1.1, 0.75, 0.6), "Cushion", 0.2)
    _cushion(material("rug", Base_Color=(0.6, 0.5, 0.4, 1), Roughness=1.0), (-0.9, -0.6, 0.001), (0.9, 0.9, 0.02), "Rug")
    light("SUN", "Sun", 5, rotation=(0.15, 0.85, 0), color=(1, 0.93, 0.82))
    camera((0.9, -1.85, 1.5), (1.35, 0, 0.35), lens=20)


def _glass():
    return shader("glass", "BsdfGlass")[0]


def _pane(of, x, thickness=0.006, turn=0.004):
    """A pane in the window, slightly rotated, with its edges inside the wall."""
    pane = _wall(of, (x, -0.93, 0.77), (x + thickness, 0.93, 2.13), "Pane")
    pane.rotation_euler = (0, 0, turn)
    return pane


def lounge_pane():
    _lounge()
    _pane(_glass(), 2.1)


def lounge_sheet():
    _lounge()
    sheet = add("plane", _glass(), (2.1, 0, 1.45), "Pane", size=1)
    sheet.rotation_euler, sheet.scale = (0, math.pi / 2, 0.004), (1.36, 1.86, 1)


def lounge_double():
    _lounge()
    clear = material("clear", Transmission_Weight=1, Roughness=0, IOR=1.45, Base_Color=(0.95, 1, 0.97, 1))
    for x, turn in ((2.08, 0.004), (2.1, -0.003)):
        pane = _pane(clear, x, 0.004, turn)
        bevel = pane.modifiers.new("Bevel", "BEVEL")
        bevel.width = 0.001


def bathroom():
    """Tiles, a mirror, a frosted glass door with a light behind, a frosted window facing the sun."""
    world((0.5, 0.65, 0.9), 1.5)
    paint = material("paint", Base_Color=(0.8, 0.8, 0.8, 1))
    tiles = material("tiles", Base_Color=(0.5, 0.6, 0.62, 1), Roughness=0.2)
    frosted = material("frosted", Transmission_Weight=1, Roughness=0.25, IOR=1.45, Base_Color=(0.9, 0.95, 0.95, 1))
    door, window = ((-1.7, -0.5, 0.0), (-1.3, 0.4, 2.0)), ((-0.4, 1.4, 1.3), (0.6, 1.8, 2.0))
    _wall(tiles, (-1.6, -1.7, -0.1), (1.6, 1.7, 0), "Floor")
    _wall(paint, (-1.6, -1.7, 2.4), (1.6, 1.7, 2.5), "Ceiling")
    _wall(tiles, (-1.6, 1.5, -0.1), (1.6, 1.7, 2.5), "Back", [window])
    _wall(paint, (-1.6, -1.7, -0.1), (1.6, -1.5, 2.5), "Front")
    _wall(paint, (1.4, -1.7, -0.1), (1.6, 1.7, 2.5), "Right")
    _wall(tiles, (-1.6, -1.7, -0.1), (-1.4, 1.7, 2.5), "Left", [door])
    _wall(frosted, (-1.53, -0.52, -0.02), (-1.52, 0.42, 2.02), "Door")
    _wall(frosted, (-0.42, 1.58, 1.28), (0.62, 1.586, 2.02), "Window")
    # The corridor behind the door.
    _wall(paint, (-3.2, -1.5, -0.1), (-1.6, 1.5, 0), "Corridor floor")
    _wall(paint, (-3.3, -1.5, -0.1), (-3.2, 1.5, 2.5), "Corridor wall")
    for y in (-1.5, 1.4):
        _wall(paint, (-3.2, y, -0.1), (-1.6, y + 0.1, 2.5), f"Corridor end {y}")
    _wall(paint, (-3.2, -1.5, 2.4), (-1.6, 1.5, 2.5), "Corridor ceiling")
    light("POINT", "Lamp", 40, (-2.3, -0.1, 1.9), shadow_soft_size=0.06, color=(1, 0.8, 0.55))
    mirror = material("mirror", Metallic=1, Roughness=0, Base_Color=(0.95, 0.95, 0.95, 1))
    _wall(mirror, (1.38, -0.3, 1.0), (1.4, 0.9, 1.9), "Mirror")
    china = material("china", Base_Color=(0.85, 0.85, 0.83, 1), Roughness=0.1, Coat_Weight=1)
    basin = _cushion(china, (0.95, -0.1, 0.7), (1.4, 0.7, 0.9), "Basin")
    basin.modifiers["Bevel"].width = 0.08
    light("SUN", "Sun", 5, rotation=(-0.75, 0.1, 0), color=(1, 0.93, 0.82))
    camera((0.6, -1.4, 1.5), (1.4, 0, 0.25), lens=18)


def _sky(strength=0.1):
    """A sky texture with its sun."""
    tree, background = world(strength=strength)
    sky = tree.nodes.new("ShaderNodeTexSky")
    types = [item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items]
    sky.sky_type = "MULTIPLE_SCATTERING" if "MULTIPLE_SCATTERING" in types else "NISHITA"
    sky.sun_elevation, sky.sun_rotation = 0.8, 2.4
    tree.links.new(sky.outputs[0], background.inputs["Color"])


def _pool(height):
    """A pool in a terrace; the water is a solid that extends into the walls, its top a grid with waves."""
    _sky()
    stone = material("stone", Base_Color=(0.6, 0.55, 0.5, 1))
    tiles = material("pool tiles", Base_Color=(0.4, 0.65, 0.7, 1), Roughness=0.3)
    hole = ((-2.01, -1.21, -1.21), (2.01, 1.21, 0.2))
    _wall(stone, (-6, -6, -1.5), (6, 6, 0), "Terrace", [hole])
    _wall(tiles, (-2.05, -1.25, -1.3), (2.05, 1.25, -1.2), "Tiles")
    for x in (-2.05, 2.0):
        _wall(tiles, (x, -1.25, -1.3), (x + 0.05, 1.25, 0.01), "Tiles")
    for y in (-1.25, 1.2):
        _wall(tiles, (-2.05, y, -1.3), (2.05, y + 0.05, 0.012), "Tiles")
    _water(height)
    _wall(stone, (-1.2, 1.9, 0), (1.2, 2.1, 1.2), "Bench")
    camera((-2.6, -3.2, 2.2), (1.05, 0, -0.6), lens=26)


def _water(height, columns=80, rows=48):
    """A closed volume of water between the tiles, smooth shaded on top."""
    size_x, size_y, bottom, top = 2.005, 1.205, -1.205, -0.12
    place = lambda i, n, size: size * (2 * i / n - 1)
    wave = lambda x, y: height * (math.sin(5 * x + 2 * y) + 0.6 * math.sin(9 * y - 3 * x + 1) + 0.4 * math.sin(17 * x + 13 * y))
    verts, faces = [], []
    for level in (0, 1):
        for j in range(rows + 1):
            for i in range(columns + 1):
                x, y = place(i, columns, size_x), place(j, rows, size_y)
                verts.append((x, y, top + wave(x, y) if level else bottom))
    at = lambda level, i, j: (level * (rows + 1) + j) * (columns + 1) + i
    for j in range(rows):
        for i in range(columns):
            faces.append([at(1, i, j), at(1, i + 1, j), at(1, i + 1, j + 1), at(1, i, j + 1)])
            faces.append([at(0, i, j), at(0, i, j + 1), at(0, i + 1, j + 1), at(0, i + 1, j)])
    for i in range(columns):
        faces.append([at(0, i, 0), at(0, i + 1, 0), at(1, i + 1, 0), at(1, i, 0)])
        faces.append([at(0, i + 1, rows), at(0, i, rows), at(1, i, rows), at(1, i + 1, rows)])
    for j in range(rows):
        faces.append([at(0, 0, j + 1), at(0, 0, j), at(1, 0, j), at(1, 0, j + 1)])
        faces.append([at(0, columns, j), at(0, columns, j + 1), at(1, columns, j + 1), at(1, columns, j)])
    mesh = bpy.data.meshes.new("Water")
    mesh.from_pydata(verts, [], faces)
    mesh.polygons.foreach_set("use_smooth", [k < 2 * rows * columns for k in range(len(faces))])
    mesh.materials.append(shader("water", "BsdfGlass", IOR=1.333, Roughness=0)[0])
    link("Water", mesh)


def pool_level():
    _pool(0.0)


def pool_waves():
    _pool(0.008)


def glass_table():
    """A glass table on a glossy wooden floor, under an area light and next to a window with a pane."""
    _lounge()
    for name in ("Rug", "Seat", "Rest", "Cushion"):
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.data.materials["boards"].node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.22
    glass = _glass()
    _pane(glass, 2.1)
    top = add("cylinder", glass, (-0.1, 0.3, 0.46), "Top", radius=0.6, depth=0.015, vertices=64)
    top.data.polygons.foreach_set("use_smooth", [len(p.vertices) == 4 for p in top.data.polygons])
    steel = material("steel", Metallic=1, Roughness=0.15, Base_Color=(0.7, 0.7, 0.7, 1))
    for k in range(4):
        turn = math.pi * (0.25 + 0.5 * k)
        add("cylinder", steel, (-0.1 + 0.45 * math.cos(turn), 0.3 + 0.45 * math.sin(turn), 0.225), radius=0.02, depth=0.45, smooth=True)
    add("uv_sphere", material("fruit", Base_Color=(0.7, 0.2, 0.05, 1), Roughness=0.4), (0.05, 0.4, 0.538), "Fruit", True, radius=0.07)
    light("AREA", "Lamp", 30, (-0.2, 0.2, 2.2), size=0.3, shape="DISK", color=(1, 0.8, 0.6))


INTERIORS = [lounge_pane, lounge_sheet, lounge_double, bathroom, pool_level, pool_waves, glass_table]
