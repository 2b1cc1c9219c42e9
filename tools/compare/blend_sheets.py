"""Scenes of Blender with glass and water of one sheet."""

import math

from blend_parts import add, camera, floor, light, material, shader, world


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
    """A basin whose water is one level sheet over the floor."""
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
