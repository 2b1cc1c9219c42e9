"""Blender scenes with open glass and water surfaces."""

import math

from blend_parts import add, ball, camera, floor, light, material, shader, world


def _shed(sun=True, sky=True):
    """A white floor with a box, in front of a large opening towards the light."""
    world((0.5, 0.65, 0.9) if sky else (0, 0, 0), 0.8)
    floor(material("floor", Base_Color=(0.6, 0.6, 0.6, 1), Roughness=1.0), size=8)
    add("cube", material("box", Base_Color=(0.6, 0.3, 0.1, 1), Roughness=1.0), (0.2, 0.3, 0.25), "Box", size=0.5)
    if sun:
        light("SUN", "Sun", 3, rotation=(0, 0.7, 0.1), angle=0.35)
    camera((-3.2, -2.6, 2.4), (1.05, 0, -0.9), lens=28)


def _window(glass, solid):
    _shed()
    wall = material("wall", Base_Color=(0.5, 0.5, 0.5, 1), Roughness=1.0)
    for y in (-2.5, 2.5):
        add("cube", wall, (1.5, y, 1.5), "Side", size=1).scale = (0.1, 2, 3)
    add("cube", wall, (1.5, 0, 2.75), "Lintel", size=1).scale = (0.1, 3, 0.5)
    if solid:
        add("cube", glass, (1.5, 0, 1.25), "Pane", size=1).scale = (0.02, 3, 2.5)
    else:
        pane = add("plane", glass, (1.5, 0, 1.25), "Pane", size=1)
        pane.rotation_euler, pane.scale = (0, math.pi / 2, 0), (2.5, 3, 1)


def _principled():
    return material("glass", Transmission_Weight=1, Roughness=0, IOR=1.45, Base_Color=(1, 1, 1, 1))


def window_sheet():
    _window(_principled(), False)


def window_sheet_node():
    _window(shader("glass", "BsdfGlass", Color=(0.9, 1, 0.9, 1), Roughness=0.0, IOR=1.45)[0], False)


def window_pane():
    _window(_principled(), True)


def _pool(sun, sky):
    """A basin with a single flat water surface over the floor."""
    _shed(sun, sky)
    tiles = material("tiles", Base_Color=(0.5, 0.6, 0.6, 1), Roughness=1.0)
    for x, y, w, d in ((-1.55, 0, 0.1, 3.2), (1.55, 0, 0.1, 3.2), (0, -1.55, 3.0, 0.1), (0, 1.55, 3.0, 0.1)):
        add("cube", tiles, (x, y, 0.3), "Rim", size=1).scale = (w, d, 0.6)
    water = material("water", Transmission_Weight=1, Roughness=0, IOR=1.33, Base_Color=(1, 1, 1, 1))
    add("plane", water, (0, 0, 0.4), "Water", size=3.0)


def pool_sky():
    _pool(False, True)


def pool_sun():
    _pool(True, False)


def window_within():
    """A room seen from inside: the pane reflects at grazing angles; another one faces the other way, and one is rough."""
    world((0.5, 0.65, 0.9), 0.8)
    wall = material("wall", Base_Color=(0.5, 0.5, 0.5, 1), Roughness=1.0)
    floor(wall, size=8)
    add("plane", wall, (0, 0, 3), "Ceiling", size=8)
    add("cube", material("box", Base_Color=(0.6, 0.3, 0.1, 1), Roughness=1.0), (0.2, 0.3, 0.25), "Box", size=0.5)
    clear, frosted = _principled(), material("frosted", Transmission_Weight=1, Roughness=0.4, IOR=1.45)
    for k, (of, turn) in enumerate(((clear, 1), (clear, -1), (frosted, 1))):
        pane = add("plane", of, (1.5, 2 * k - 2, 1.5), f"Pane {k}", size=1)
        pane.rotation_euler, pane.scale = (0, turn * math.pi / 2, 0), (3, 2, 1)
    light("AREA", "Yard", 400, (4, 0.5, 2.5), (0, 1.2, 0), size=1.5)
    camera((-2.2, -2.8, 1.6), (1.45, 0, -0.75), lens=24)


def drowned():
    """A glass sphere, a mirror and a light below an open water surface."""
    _pool(False, True)
    ball(_principled(), (-0.6, -0.4, 0.22), 0.18)
    ball(material("steel", Metallic=1, Roughness=0.1), (0.6, -0.6, 0.2), 0.18)
    light("POINT", "Lamp", 6, (0.5, 0.5, 0.2), shadow_soft_size=0.1)


def glowing_glass():
    """Emissive glass, and glass around emissive or lit objects."""
    world((0.1, 0.12, 0.15))
    floor()
    light("AREA", "Key", 120, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    for x, rough in ((-2, 0.0), (0, 0.4)):
        globe = material(f"globe {rough}", Transmission_Weight=1, Roughness=rough, IOR=1.5, Emission_Color=(1, 0.8, 0.5, 1), Emission_Strength=0.8)
        ball(globe, (x, 0, 0.8), 0.7)
    ball(_principled(), (2, 0, 0.8), 0.7)
    ball(material("ember", Base_Color=(0.5, 0.2, 0.1, 1), Emission_Color=(1, 0.3, 0.1, 1), Emission_Strength=3), (2, 0, 0.8), 0.3, "Ember")
    camera()
