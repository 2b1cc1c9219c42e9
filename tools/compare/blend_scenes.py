"""All Blender scenes, made with `bpy`: each is a function that fills an empty scene. See blend.py."""

from blend_light import (
    area_lights,
    area_spread,
    gobo,
    lamp_picture,
    lamp_settings,
    lamps_in_view,
    near_hard_lamps,
    near_soft_lamps,
    one_spread,
    points_and_spots,
    ray_kinds,
    sun_and_world,
    world_for_the_camera,
    world_nodes,
    world_picture,
    world_sky,
)
from blend_materials import (
    glass,
    groups,
    leaves,
    posed,
    principled,
    procedural,
    shaders,
    textured,
)
from blend_objects import (
    blades,
    depth_of_field,
    hidden_things,
    instances,
    orthographic,
    other_objects,
    portrait,
    sensor_fit,
    unseen,
    visibility,
    world_unseen,
)
from blend_motion_blur import blurred, blurred_camera
from blend_glass import jewels, splitting_glass, tinted_glass
from blend_links import light_links, linked_instances, shadow_links, shadowless
from blend_interiors import INTERIORS
from blend_panoramas import (
    equirectangular,
    equirectangular_part,
    fisheye_equidistant,
    fisheye_equisolid,
    mirror_ball,
    panorama_out_of_focus,
)
from blend_point_clouds import points
from blend_rooms import bottle, bust, kitchen, meadow, street, titles
from blend_shapes import furs, generated, keyed_materials
from blend_open_surfaces import drowned, glowing_glass, pool_sky, pool_sun, window_pane, window_sheet, window_sheet_node, window_within
from blend_facing import facing_color, facing_light, facing_mix, facing_ramp
from blend_facing_textures import places_color, places_forms, places_light, places_shaders
from blend_user_setups import clear_pictures, cut_hair, indirect_things, lampshades, stretched_lamps
from blend_layers import foggy, media_in_solids, reliefs, tinted_layers, translucent, vector_reliefs, waxen
from blend_features import catchers, libraries, mirrored, near_and_far, newer_shaders, patterns, profiles, soft_profiles, strands, udims
from blend_trees import (
    bright_bakes,
    fresnel_behind,
    instancer_attributes,
    nooks,
    object_info,
    object_noise,
    ray_tricks,
    two_sides,
    view_trees,
)
from blend_volumes import clouds, clouds_together, fire, fire_in_smoke, flames, foggy_room, made_densities, made_volumes

SCENES = [
    area_lights, area_spread, one_spread, sun_and_world, points_and_spots, near_soft_lamps, near_hard_lamps, lamps_in_view, lamp_settings, gobo, lamp_picture, world_picture,
    world_sky, world_nodes, world_for_the_camera, depth_of_field, blades, unseen, visibility, world_unseen, orthographic, portrait, sensor_fit, instances, hidden_things, other_objects, points, generated, furs, keyed_materials,
    glass, shaders, principled, procedural, textured, posed,
    groups, leaves, ray_kinds,
    blurred, blurred_camera, translucent, media_in_solids, foggy, waxen, tinted_layers, reliefs, vector_reliefs,
    object_info, object_noise, instancer_attributes, two_sides, ray_tricks, fresnel_behind, view_trees, facing_color, facing_mix, facing_light, facing_ramp, places_color, places_forms, places_shaders, places_light, bright_bakes, nooks,
    equirectangular, equirectangular_part, fisheye_equidistant, fisheye_equisolid, mirror_ball, panorama_out_of_focus,
    window_sheet, window_sheet_node, window_pane, window_within, pool_sky, pool_sun, drowned, glowing_glass,
    jewels, tinted_glass, splitting_glass,
    light_links, shadow_links, linked_instances, shadowless,
    udims, near_and_far, newer_shaders, patterns, mirrored, profiles, soft_profiles, libraries, strands, catchers,
    lampshades, clear_pictures, stretched_lamps, indirect_things, cut_hair,
    clouds, fire, flames, made_volumes, clouds_together, fire_in_smoke, foggy_room, made_densities,
    kitchen, bottle, meadow, street, bust, titles,
    *INTERIORS,
]  # fmt: skip
