//! Participating media: `fog` of `[environment]` around all solids, `medium` of a material within its
//! solids, with densities on a grid or by textures if it has some.
//!
//! | Medium | Default | Meaning |
//! |---|---|---|
//! | `density` | 1 | extinction coefficient per metre: the mean free path is 1 / `density` metres; a number, one for each channel, or in solids a texture |
//! | `color` | 1 | share of that light that is scattered, 0 to 1; the rest is absorbed; in solids also a texture |
//! | `anisotropy` | 0 | mean cosine of the scattering angle, above -1 and below 1: 0 scatters to all sides, 0.8 forward as haze does |
//! | `emission` | 0 | radiance that each metre adds; in solids also a texture |
//! | `nodes` | none | nodes by name, as of textures of `type = "nodes"`: `density`, `color` and `emission` may be outputs of these, `"NODE.OUTPUT"` |
//! | `resolution` | 2 million voxels in all | voxels along the longest edge of the box around a solid on which textures are evaluated, 1 to 1024 |
//! | `grid` | none | `.vdb` or `.vol` file of factors on the density, and on the emission, in solids only; with `density = 0` the grid shines without hiding anything |
//! | `grid_name` | `density`, or the only one | which grid of a `.vdb` file |
//! | `emission_grid` | none | another grid of the `.vdb` file, such as `flame` (next to a `.vol` file, another such file): factors on the emission in place of those of `grid` |
//! | `temperature_grid` | none | another grid, likewise, such as `temperature`: it emits as a black body; `emission` is what each metre of 1500 K adds, and hotter ones more: by Planck's law some 15 times as much at 1800 K |
//! | `temperature` | 1 | kelvins where `temperature_grid` is 1, which is right for grids of kelvins; for those of 0 to 1, such as Blender's, 1500 to 2500 |
//! | `temperature_law` | `planck` | how what is seen grows with the temperature; `stefan-boltzmann`: as all of the power does, which goes by its fourth power (twice as much at 1800 K as at 1500 K): Blender's fire |
//! | `up` | `y` | axis of a `.vdb` file that points up: `z` in those of Blender, and for `nodes` with Blender's vectors |
//! | `min`, `max` | the file's | corners of the box along the axes that the grid is fitted to; outside it nothing is |
//! | `transform` | none | moves, turns, scales, mirrors or shears the grid (with what glows) from there to its place in the world, see `transform`; the solid around it is not moved |
//!
//! Files of OpenVDB hold one or more grids of floats (f32, f64 or f16; plain, zlib or Blosc with LZ4, as OpenVDB, Blender and Houdini write
//! them), in boxes of up to 2^29 voxels, which may stand anyhow. Values fall to nothing over a voxel beyond the outermost ones,
//! unless `min` or `max` say where the box ends. Level sets, vectors and NanoVDB's own files are not read.
//! The solid that has the medium must enclose the grid: a box, say. A grid stands in the world: a solid that moves doesn't take it along.
//!
//! Textures are evaluated in space, in the world or in the coordinates of the object, when the scene is loaded: noise makes clouds, a gradient
//! ground fog. Quads and meshes of several materials share a grid in the space of the world; each other object has a grid of its own, with at most
//! 2^26 voxels for all objects of a material. In pictures by wavelength an extinction whose colour differs from place to place is the mean
//! of its channels.
//!
//! Media of solids without a surface (`type = "medium"`) add up where they overlap, with each other and with the fog, up to eight at a
//! place; a `priority` above those of others displaces them, and a solid of `density = 0` that emits light nowhere is a hole in them. Solids of
//! one material that overlap are one.
//!
//! A `.vol` file is a grid as Mitsuba reads it: `VOL` and the byte 3, then little-endian u32: 1 (for 32-bit floats), voxels along
//! x, y and z, 1 (channel); six f32: the least and the greatest corner of the box; then the values as f32, x fastest, z
//! slowest. Values lie in the middles of voxels, linear in between.
//!
//! Fog may end at a ball of `radius` metres around `center` ([0, 0, 0]). Without a `radius` it has no end, and nothing
//! infinitely far away is seen through it or lights the scene: no sky, no sun.
//!
//! | Subsurface | Default | Meaning |
//! |---|---|---|
//! | `color` | 0.8 | colour of a thick body in white light, 0 to 1 |
//! | `radius` | 1 | mean free path, metres; a number or one for each channel (of Blender's Random Walk: its radius times its scale times 1 - anisotropy, over 4 pi) |
//! | `scale` | 1 | factor on it |
//! | `anisotropy` | 0 | mean cosine of the scattering angle, above -1 and below 1 |
//!
//! Light enters and leaves such a body diffusely, by Lambert's law, whatever its index of refraction; in white light a body
//! much thicker than `radius` has its `color` wherever it is seen. Cycles' Random Walk lets light in as a refracted ray
//! and out diffusely: means over a ball agree, but its middle is darker there and its rim brighter (in a half space of
//! colours 0.9, 0.6, 0.35 that is seen head on 0.877, 0.539, 0.294 without refraction; Chandrasekhar's H functions).
//! Beside a model whose material transmits diffusely (KHR_materials_diffuse_transmission) its colour and picture tint light on its
//! way in and out: a skin that is painted by the root of its colour over that of the body.
//! A mesh with edges has no inside: it gets a diffuse base of the `color`, and a warning says so.

use super::builder::SceneFileBuilder;
use super::fields::{Fields, Located};
use super::nodes::Value;
use super::textures::Textures;
use super::transform;
use crate::load::grid;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::{
    ColorSlot, DiffuseTransmission, EmissionGrid, FloatSlot, Fog, Grid, Medium, MediumTextures, PbrMaterial,
    SubsurfaceEntry,
};
use std::path::Path;

/// Largest extinction coefficient: flights in denser media are shorter than positions are precise.
const MAX_DENSITY: f32 = 1e9;

/// The keys of a medium that fills a solid.
pub(super) fn filling<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
) -> Medium {
    let varying = medium_textures(build, textures, fields);
    let medium = Medium { textures: varying, ..medium(fields) };
    if !varying.is_empty() && fields.has("grid") {
        let message = "'grid' and textures exclude each other: leave one out";
        fields.problems.push(fields.span(), ("grid-and-texture", message));
    }
    let corners = [fields.vector("min"), fields.vector("max")];
    let name = fields.string("grid_name").map(|name| name.value);
    let is_z_up = fields.choice("up", &[("y", false), ("z", true)]).unwrap_or(false);
    let glow = GlowKeys::read(fields);
    let moved = transform::read(fields);
    let Some(file) = fields.string("grid") else {
        let is_fitted = corners.iter().any(Option::is_some) || fields.has("transform");
        if is_fitted || name.is_some() || is_z_up && !fields.has("nodes") || glow.is_given() {
            let message = "'min', 'max', 'transform', 'grid_name', 'up', 'emission_grid' and 'temperature_grid' are about a \
                           'grid'";
            fields.problems.push(fields.span(), message);
        }
        return medium;
    };
    let Some(path) = build.readable_path(file.value, file.span.clone()) else { return medium };
    let [min, max] = corners.map(|c| c.map(|c| c.value));
    let has_margin = min.is_none() && max.is_none();
    build.options.files.note(&path);
    match grid::read(&path, grid::GridChoice { name, is_z_up, has_margin }) {
        Ok(grid) => {
            let own = grid.bounds();
            let fitted = between(own, (min.unwrap_or(own.0), max.unwrap_or(own.1)));
            let place = GridTransform { moved: moved * fitted, is_z_up, has_margin };
            let grid = Some(build.loaded.scene.add_grid(place.put(grid)));
            Medium { grid, glow: glow.of_file(build, fields, &path, place), ..medium }
        }
        Err(e) => {
            fields.problems.push(file.span, e);
            medium
        }
    }
}

/// The transform from one axis-aligned box to another.
fn between(from: (DVec3, DVec3), to: (DVec3, DVec3)) -> DAffine3 {
    if from == to {
        return DAffine3::IDENTITY;
    }
    let scale = (to.1 - to.0) / (from.1 - from.0);
    DAffine3::from_mat3_translation(DMat3::from_diagonal(scale), to.0 - from.0 * scale)
}

/// The keys of emission by a grid of its own.
struct GlowKeys<'a> {
    factors: Option<Located<&'a str>>,
    heat: Option<Located<&'a str>>,
    kelvin: Option<f32>,
    scales_with_power: Option<bool>,
}

/// Transform of a file's grids to world space.
struct GridTransform {
    /// The transform from the grids of the file to the scene.
    moved: DAffine3,
    is_z_up: bool,
    has_margin: bool,
}

impl GridTransform {
    fn put(&self, grid: Grid) -> Grid {
        Grid { world_from_voxels: self.moved * grid.world_from_voxels, ..grid }
    }
}

impl<'a> GlowKeys<'a> {
    fn read(fields: &Fields<'a>) -> GlowKeys<'a> {
        let kelvin =
            fields.has("temperature").then(|| fields.number_in("temperature", 1e-6..1e6, 1.0) as f32);
        let keys = GlowKeys {
            factors: fields.string("emission_grid"),
            heat: fields.string("temperature_grid"),
            kelvin,
            scales_with_power: fields
                .choice("temperature_law", &[("planck", false), ("stefan-boltzmann", true)]),
        };
        if keys.factors.is_some() && keys.heat.is_some() {
            let message = "'emission_grid' and 'temperature_grid' exclude each other: leave one out";
            fields.problems.push(fields.span(), message);
        }
        if (keys.kelvin.is_some() || keys.scales_with_power.is_some()) && keys.heat.is_none() {
            let message = "'temperature' and 'temperature_law' are about a 'temperature_grid'";
            fields.problems.push(fields.span(), message);
        }
        if keys.is_given() && !fields.has("emission") {
            let message =
                "'emission_grid' and 'temperature_grid' say where the medium emits light, but not how much";
            fields.problems.push_help(fields.span(), message, "add 'emission', such as 10");
        }
        keys
    }

    fn is_given(&self) -> bool {
        self.factors.is_some() || self.heat.is_some()
    }

    /// The grid of the named file; placed as in the file, with the transform of the density grid.
    fn of_file(
        self,
        build: &mut SceneFileBuilder,
        fields: &Fields,
        path: &Path,
        place: GridTransform,
    ) -> Option<EmissionGrid> {
        let kelvin = self.heat.is_some().then(|| self.kelvin.unwrap_or(1.0));
        let name = self.heat.or(self.factors)?;
        let is_vdb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("vdb"));
        let (file, choice) = match is_vdb {
            true => {
                let GridTransform { is_z_up, has_margin, .. } = place;
                (path.to_path_buf(), grid::GridChoice { name: Some(name.value), is_z_up, has_margin })
            }
            false => (build.readable_path(name.value, name.span.clone())?, grid::GridChoice::default()),
        };
        build.options.files.note(&file);
        match grid::read(&file, choice) {
            Ok(grid) => {
                let grid = build.loaded.scene.add_grid(place.put(grid));
                let scales_with_power = self.scales_with_power.unwrap_or(false);
                Some(match kelvin {
                    Some(kelvin) => EmissionGrid::Temperatures { grid, kelvin, scales_with_power },
                    None => EmissionGrid::Factors(grid),
                })
            }
            Err(e) => {
                fields.problems.push(name.span, e);
                None
            }
        }
    }
}

/// The textures that coefficients of a medium are given.
fn medium_textures<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
) -> MediumTextures {
    let is_z_up = fields.string("up").is_some_and(|up| up.value == "z");
    let nodes = fields.table("nodes").and_then(|table| {
        let (named, mut graph) = textures.value_nodes(build, &table.entries().collect::<Vec<_>>(), "")?;
        graph.is_z_up = is_z_up;
        Some((named, graph))
    });
    let mut of = |key: &'static str| {
        let (value, name) = texture_name(fields, key)?;
        let node = name.split_once('.').map_or(name, |(node, _)| node);
        match nodes.as_ref().filter(|(named, _)| named.iter().any(|(own, _)| *own == node)) {
            Some((named, graph)) => textures.output(build, fields, (named, graph), value),
            None => textures.get(build, name, value.span()),
        }
    };
    let (density, color, emission) = (of("density"), of("color"), of("emission"));
    let found = MediumTextures { density, color, emission, resolution: 0 };
    let resolution = fields.whole("resolution", 1, 1024);
    if found.is_empty() && (resolution.is_some() || nodes.is_some()) && !fields.has("grid") {
        let message =
            "'nodes' and 'resolution' are about textures: give 'density', 'color' or 'emission' one";
        fields.problems.push(fields.span(), ("medium-without-texture", message));
    }
    MediumTextures { resolution: resolution.map_or(0, |n| n as u32), ..found }
}

/// A text in the place of a coefficient.
fn texture_name<'a>(fields: &Fields<'a>, key: &'static str) -> Option<(Value<'a>, &'a str)> {
    let value = fields.raw(key)?;
    Some((value, value.get_ref().as_str()?))
}

/// A coefficient that is no texture.
fn constant(fields: &Fields, key: &'static str) -> Option<Located<[f32; 3]>> {
    if texture_name(fields, key).is_some() { None } else { fields.color(key) }
}

/// The keys of a medium in a table; coefficients with textures are 1.
fn medium(fields: &Fields) -> Medium {
    let emission = if texture_name(fields, "emission").is_some() { [1.0; 3] } else { [0.0; 3] };
    let extinction = constant(fields, "density").map_or([1.0; 3], |d| {
        if d.value.iter().any(|x| *x > MAX_DENSITY) {
            fields.problems.push(d.span, format!("'density' must be at most {MAX_DENSITY:e} per metre"));
        }
        d.value.map(|x| x.min(MAX_DENSITY))
    });
    Medium {
        albedo: share(fields, "color", 1.0),
        anisotropy: anisotropy(fields),
        emission: constant(fields, "emission").map_or(emission, |c| c.value),
        ..Medium::scattering(extinction)
    }
}

fn share(fields: &Fields, key: &'static str, otherwise: f32) -> [f32; 3] {
    let Some(color) = constant(fields, key) else { return [otherwise; 3] };
    if color.value.iter().any(|c| *c > 1.0) {
        fields
            .problems
            .push(color.span, format!("'{key}' must be from 0 to 1: a medium can't add light by it"));
    }
    color.value.map(|c| c.min(1.0))
}

fn anisotropy(fields: &Fields) -> f32 {
    let Some(given) = fields.number("anisotropy") else { return 0.0 };
    let g = given.value as f32;
    if g.abs() >= 1.0 {
        let message = format!("'anisotropy' is {}, but must be above -1 and below 1", given.value);
        fields.problems.push(given.span, message);
        return 0.0;
    }
    g
}

/// The table of a medium under a key.
pub(super) fn table<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    key: &'static str,
) -> Option<Medium> {
    let table = fields.table(key)?;
    let medium = filling(build, textures, &table);
    table.finish();
    Some(medium)
}

/// Which of several solids counts where they overlap.
pub(super) fn priority(fields: &Fields) -> Option<i32> {
    fields.has("priority").then(|| fields.whole("priority", -1000, 1000).map_or(0, |n| n as i32))
}

/// The keys of a medium that is the same everywhere.
fn even(fields: &Fields) -> Medium {
    for key in ["density", "color", "emission"] {
        if let Some((value, _)) = texture_name(fields, key) {
            let message =
                format!("'{key}' of fog can't be a texture: only solids have boxes to evaluate it in");
            fields.problems.push(value.span(), ("fog-with-texture", message));
        }
    }
    medium(fields)
}

/// `fog` of the environment.
pub(super) fn fog(fields: &Fields) -> Option<Fog> {
    let table = fields.table("fog")?;
    let fog = Fog {
        medium: even(&table),
        center: table.vector("center").map_or(DVec3::ZERO, |c| c.value),
        radius: table.number_in("radius", 1e-9..1e18, f64::INFINITY),
    };
    table.finish();
    Some(fog)
}

/// `subsurface` of a glTF material: what is diffuse goes in, walks through the solid at random and comes out diffusely.
pub(super) fn subsurface(fields: &Fields, model: &mut PbrMaterial) -> Option<Medium> {
    let table = fields.table("subsurface")?;
    let color = share(&table, "color", 0.8);
    let scale = table.number_in("scale", 1e-9..1e9, 1.0);
    let radius = table.color("radius").map_or([1.0; 3], |r| {
        if r.value.iter().any(|x| *x <= 0.0) {
            table.problems.push(r.span, "'radius' must be above 0");
        }
        r.value
    });
    let anisotropy = anisotropy(&table);
    table.finish();
    if fields.has("transmission") || fields.has("diffuse_transmission") || fields.has("medium") {
        let message = "'subsurface' says what light does that enters: leave transmission and 'medium' out";
        fields.problems.push(fields.span(), message);
    }
    model.has_volume = true;
    // The tint by a model's material on light's way in and out.
    let tint = model.diffuse_transmission.map_or(ColorSlot::constant([1.0; 3]), |through| through.color);
    let subsurface = Some(SubsurfaceEntry::Diffuse);
    model.diffuse_transmission =
        Some(DiffuseTransmission { factor: FloatSlot::constant(1.0), color: tint, subsurface });
    let radius = radius.map(|r| (f64::from(r) * scale).clamp(1e-9, 1e9) as f32);
    Some(Medium::subsurface(color, radius, anisotropy))
}
