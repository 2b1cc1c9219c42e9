//! Participating media: `fog` of `[environment]` around all solids, and the `medium` of a material inside its
//! solids, homogeneous or with coefficients from a grid or textures.
//!
//! | Medium | Default | Meaning |
//! |---|---|---|
//! | `density` | 1 | extinction coefficient per metre: the mean free path is 1 / `density` metres; a number, one for each channel, or in solids a texture |
//! | `color` | 1 | single-scattering albedo, 0 to 1; in solids also a texture |
//! | `anisotropy` | 0 | mean cosine of the scattering angle, above -1 and below 1: 0 is isotropic, 0.8 forward as in haze |
//! | `emission` | 0 | emitted radiance per metre; in solids also a texture |
//! | `nodes` | none | nodes by name, as in textures of `type = "nodes"`: `density`, `color` and `emission` may be their outputs, `"NODE.OUTPUT"` |
//! | `resolution` | 2 million voxels in total | voxels along the longest edge of the solid's bounding box for the evaluation of textures, 1 to 1024 |
//! | `grid` | none | `.vdb` or `.vol` file of factors on density and emission, in solids only; with `density = 0` the grid emits without extinction |
//! | `grid_name` | `density`, or the only one | name of a grid of the `.vdb` file |
//! | `emission_grid` | none | another grid of the `.vdb` file, such as `flame` (with a `.vol` file: another `.vol` file): factors on the emission instead of those of `grid` |
//! | `temperature_grid` | none | another grid, likewise, such as `temperature`: black-body emission; `emission` is the radiance per metre at 1500 K, and grows with the temperature: by Planck's law about 15 times at 1800 K |
//! | `temperature` | 1 | kelvins per unit of `temperature_grid`: 1 for grids in kelvins; 1500 to 2500 for grids of 0 to 1, such as Blender's |
//! | `temperature_law` | `planck` | growth of the visible radiance with the temperature; `stefan-boltzmann`: with its fourth power, as the total power (twice at 1800 K of that at 1500 K), as in Blender |
//! | `up` | `y` | up axis of a `.vdb` file: `z` for files from Blender, and for `nodes` with vectors in Blender's axes |
//! | `min`, `max` | the file's | corners of the axis-aligned box that the grid is fitted to; the medium ends there |
//! | `transform` | none | transform of the grids from there to world space, see `transform`; the solid is not moved |
//!
//! OpenVDB files hold one or more grids of floats (f32, f64 or f16; uncompressed, zlib or Blosc with LZ4, as written by OpenVDB, Blender and
//! Houdini), with bounding boxes of up to 2^29 voxels and any affine transform. Values fall to 0 over one voxel beyond the outermost ones,
//! unless `min` or `max` set the box. Level sets, vector grids and NanoVDB files are not supported.
//! The solid with the medium, such as a box, must enclose the grid. Grids are in world space: they don't follow the motion of a solid.
//!
//! Textures are evaluated at load time, in world or object space: noise makes clouds, a gradient
//! ground fog. Quads and meshes of several materials share one grid in world space; each other object has its own grid, with at most
//! 2^26 voxels for all objects of a material. Spectral rendering uses the mean of the channels for an extinction whose hue varies
//! in space.
//!
//! Media of solids without a surface (`type = "medium"`) add up where they overlap, with each other and with the fog, up to eight at a
//! point; one with a higher `priority` replaces the others, and a solid of `density = 0` without emission is a hole in them. Overlapping solids of
//! one material count once.
//!
//! A `.vol` file is Mitsuba's grid format: `VOL` and the byte 3, then little-endian u32: 1 (for 32-bit floats), voxels along
//! x, y and z, 1 (channel); six f32: the minimum and the maximum corner of the box; then the values as f32, x fastest, z
//! slowest. Values are at voxel centres, with linear interpolation.
//!
//! Fog may be limited to a sphere of `radius` metres around `center` ([0, 0, 0]). Without a `radius` it is unbounded, and blocks all light
//! from infinity: sky and sun.
//!
//! | Subsurface | Default | Meaning |
//! |---|---|---|
//! | `color` | 0.8 | multiple-scattering albedo of a thick body, 0 to 1 |
//! | `radius` | 1 | mean free path, metres; a number or one for each channel (from Blender's Random Walk: radius times scale times (1 - anisotropy) / (4 pi)) |
//! | `scale` | 1 | factor on `radius` |
//! | `anisotropy` | 0 | mean cosine of the scattering angle, above -1 and below 1 |
//!
//! Light enters and leaves the body diffusely, by Lambert's law, whatever its index of refraction; under white light a body
//! much thicker than `radius` has its `color` at all viewing angles. Cycles' Random Walk refracts light on entry
//! and lets it exit diffusely: the mean over a sphere agrees, but its centre is darker in Cycles and its rim brighter (a half space of
//! colours 0.9, 0.6, 0.35 at normal incidence has 0.877, 0.539, 0.294 without refraction; Chandrasekhar's H functions).
//! In a sidecar, for model materials with diffuse transmission (KHR_materials_diffuse_transmission), their colour and texture tint light on
//! entry and exit, as a coat of paint with the square root of the colour.
//! A mesh with open edges has no inside: it gets a diffuse base of the `color`, with a warning.

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

/// Maximum extinction coefficient, 1/m: the mean free path in denser media is below the precision of positions.
const MAX_DENSITY: f32 = 1e9;

/// Reads the medium of a solid.
pub(super) fn solid_medium<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
) -> Medium {
    let coefficient_textures = medium_textures(build, textures, fields);
    let medium = Medium { textures: coefficient_textures, ..constant_medium(fields) };
    if !coefficient_textures.is_empty() && fields.has("grid") {
        let message = "'grid' and textures exclude each other: keep one";
        fields.report(("grid-and-texture", message));
    }
    let corners = [fields.vector("min"), fields.vector("max")];
    let name = fields.string("grid_name").map(|name| name.value);
    let is_z_up = fields.choice("up", &[("y", false), ("z", true)]).unwrap_or(false);
    let emission = EmissionKeys::read(fields);
    let transform = transform::read(fields);
    let Some(file) = fields.string("grid") else {
        let is_fitted = corners.iter().any(Option::is_some) || fields.has("transform");
        if is_fitted || name.is_some() || is_z_up && !fields.has("nodes") || emission.has_grid() {
            let message = "'min', 'max', 'transform', 'grid_name', 'up', 'emission_grid' and 'temperature_grid' need a \
                           'grid'";
            fields.report(message);
        }
        return medium;
    };
    let Some(path) = build.readable_path(file.value, file.span.clone()) else { return medium };
    let [min, max] = corners.map(|c| c.map(|c| c.value));
    let has_margin = min.is_none() && max.is_none();
    build.options.files.note(&path);
    match grid::read(&path, grid::GridChoice { name, is_z_up, has_margin }) {
        Ok(grid) => {
            let bounds = grid.bounds();
            let fitted = box_from_box(bounds, (min.unwrap_or(bounds.0), max.unwrap_or(bounds.1)));
            let placement = GridPlacement { world_from_file: transform * fitted, is_z_up, has_margin };
            let grid = Some(build.loaded.scene.add_grid(placement.apply(grid)));
            Medium { grid, emission_grid: emission.read_grid(build, fields, &path, placement), ..medium }
        }
        Err(e) => {
            fields.problems.push(file.span, e);
            medium
        }
    }
}

/// The transform from one axis-aligned box to another.
fn box_from_box(from: (DVec3, DVec3), to: (DVec3, DVec3)) -> DAffine3 {
    if from == to {
        return DAffine3::IDENTITY;
    }
    let scale = (to.1 - to.0) / (from.1 - from.0);
    DAffine3::from_mat3_translation(DMat3::from_diagonal(scale), to.0 - from.0 * scale)
}

/// Keys of the emission grid.
struct EmissionKeys<'a> {
    /// `emission_grid`.
    factors: Option<Located<&'a str>>,
    /// `temperature_grid`.
    temperature: Option<Located<&'a str>>,
    /// Kelvins per unit of the temperature grid.
    kelvin: Option<f32>,
    /// `temperature_law = "stefan-boltzmann"`.
    scales_with_power: Option<bool>,
}

/// Placement of a file's grids in world space.
struct GridPlacement {
    world_from_file: DAffine3,
    is_z_up: bool,
    /// Values fall to 0 over one voxel beyond the box.
    has_margin: bool,
}

impl GridPlacement {
    fn apply(&self, grid: Grid) -> Grid {
        Grid { world_from_voxels: self.world_from_file * grid.world_from_voxels, ..grid }
    }
}

impl<'a> EmissionKeys<'a> {
    fn read(fields: &Fields<'a>) -> EmissionKeys<'a> {
        let kelvin =
            fields.has("temperature").then(|| fields.number_in("temperature", 1e-6..1e6, 1.0) as f32);
        let keys = EmissionKeys {
            factors: fields.string("emission_grid"),
            temperature: fields.string("temperature_grid"),
            kelvin,
            scales_with_power: fields
                .choice("temperature_law", &[("planck", false), ("stefan-boltzmann", true)]),
        };
        fields.exclusive(["emission_grid", "temperature_grid"]);
        if (keys.kelvin.is_some() || keys.scales_with_power.is_some()) && keys.temperature.is_none() {
            fields.report("'temperature' and 'temperature_law' need a 'temperature_grid'");
        }
        if keys.has_grid() && !fields.has("emission") {
            let message =
                "'emission_grid' and 'temperature_grid' need 'emission', the emitted radiance per metre";
            fields.report_help(message, "add 'emission', such as 10");
        }
        keys
    }

    fn has_grid(&self) -> bool {
        self.factors.is_some() || self.temperature.is_some()
    }

    /// Reads the emission grid, placed as the density grid of the file `path`.
    fn read_grid(
        self,
        build: &mut SceneFileBuilder,
        fields: &Fields,
        path: &Path,
        placement: GridPlacement,
    ) -> Option<EmissionGrid> {
        let kelvin = self.temperature.is_some().then(|| self.kelvin.unwrap_or(1.0));
        let name = self.temperature.or(self.factors)?;
        let is_vdb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("vdb"));
        let (file, choice) = match is_vdb {
            true => {
                let GridPlacement { is_z_up, has_margin, .. } = placement;
                (path.to_path_buf(), grid::GridChoice { name: Some(name.value), is_z_up, has_margin })
            }
            false => (build.readable_path(name.value, name.span.clone())?, grid::GridChoice::default()),
        };
        build.options.files.note(&file);
        match grid::read(&file, choice) {
            Ok(grid) => {
                let grid = build.loaded.scene.add_grid(placement.apply(grid));
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

/// Textures of the coefficients.
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
    let mut texture = |key: &'static str| {
        let (value, name) = texture_name(fields, key)?;
        let node = name.split_once('.').map_or(name, |(node, _)| node);
        match nodes.as_ref().filter(|(named, _)| named.iter().any(|(name, _)| *name == node)) {
            Some((named, graph)) => textures.output_texture(build, fields, (named, graph), value),
            None => textures.get(build, name, value.span()),
        }
    };
    let (density, color, emission) = (texture("density"), texture("color"), texture("emission"));
    let found = MediumTextures { density, color, emission, resolution: 0 };
    let resolution = fields.integer("resolution", 1, 1024);
    if found.is_empty() && (resolution.is_some() || nodes.is_some()) && !fields.has("grid") {
        let message = "'nodes' and 'resolution' need a texture: set one as 'density', 'color' or 'emission'";
        fields.report(("medium-without-texture", message));
    }
    MediumTextures { resolution: resolution.map_or(0, |n| n as u32), ..found }
}

/// The texture name given as a coefficient, if any.
fn texture_name<'a>(fields: &Fields<'a>, key: &'static str) -> Option<(Value<'a>, &'a str)> {
    let value = fields.raw(key)?;
    Some((value, value.get_ref().as_str()?))
}

/// A constant coefficient; `None` for textures.
fn constant(fields: &Fields, key: &'static str) -> Option<Located<[f32; 3]>> {
    if texture_name(fields, key).is_some() { None } else { fields.color(key) }
}

/// Reads the constant coefficients; those with textures are 1.
fn constant_medium(fields: &Fields) -> Medium {
    let emission = if texture_name(fields, "emission").is_some() { [1.0; 3] } else { [0.0; 3] };
    let extinction = constant(fields, "density").map_or([1.0; 3], |d| {
        if d.value.iter().any(|x| *x > MAX_DENSITY) {
            fields.problems.push(d.span, format!("'density' must be at most {MAX_DENSITY:e} per metre"));
        }
        d.value.map(|x| x.min(MAX_DENSITY))
    });
    Medium {
        albedo: albedo(fields, "color", 1.0),
        anisotropy: anisotropy(fields),
        emission: constant(fields, "emission").map_or(emission, |c| c.value),
        ..Medium::scattering(extinction)
    }
}

fn albedo(fields: &Fields, key: &'static str, default: f32) -> [f32; 3] {
    let Some(color) = constant(fields, key) else { return [default; 3] };
    if color.value.iter().any(|c| *c > 1.0) {
        fields.problems.push(
            color.span,
            format!("'{key}' must be from 0 to 1: a medium can't scatter more light than it receives"),
        );
    }
    color.value.map(|c| c.min(1.0))
}

fn anisotropy(fields: &Fields) -> f32 {
    let Some(anisotropy) = fields.number("anisotropy") else { return 0.0 };
    let g = anisotropy.value as f32;
    if g.abs() >= 1.0 {
        let message = format!("'anisotropy' is {}, but must be above -1 and below 1", anisotropy.value);
        fields.problems.push(anisotropy.span, message);
        return 0.0;
    }
    g
}

/// Reads the medium of the table `key`.
pub(super) fn read<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    key: &'static str,
) -> Option<Medium> {
    let table = fields.table(key)?;
    let medium = solid_medium(build, textures, &table);
    table.finish();
    Some(medium)
}

/// The priority of overlapping solids (nested dielectrics).
pub(super) fn priority(fields: &Fields) -> Option<i32> {
    fields.has("priority").then(|| fields.integer("priority", -1000, 1000).map_or(0, |n| n as i32))
}

/// Reads a homogeneous medium.
fn homogeneous(fields: &Fields) -> Medium {
    for key in ["density", "color", "emission"] {
        if let Some((value, _)) = texture_name(fields, key) {
            let message =
                format!("'{key}' of fog can't be a texture: textures need the bounding box of a solid");
            fields.problems.push(value.span(), ("fog-with-texture", message));
        }
    }
    constant_medium(fields)
}

/// `fog` of the environment.
pub(super) fn fog(fields: &Fields) -> Option<Fog> {
    let table = fields.table("fog")?;
    let fog = Fog {
        medium: homogeneous(&table),
        center: table.vector("center").map_or(DVec3::ZERO, |c| c.value),
        radius: table.number_in("radius", 1e-9..1e18, f64::INFINITY),
    };
    table.finish();
    Some(fog)
}

/// `subsurface` of a glTF material: the diffuse base becomes diffuse transmission into a scattering medium.
pub(super) fn subsurface(fields: &Fields, model: &mut PbrMaterial) -> Option<Medium> {
    let table = fields.table("subsurface")?;
    let color = albedo(&table, "color", 0.8);
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
        let message =
            "'subsurface' excludes 'transmission', 'diffuse_transmission' and 'medium': leave them out";
        fields.report(message);
    }
    model.has_volume = true;
    // A model's material tints light on entry and exit.
    let tint = model.diffuse_transmission.map_or(ColorSlot::constant([1.0; 3]), |through| through.color);
    let subsurface = Some(SubsurfaceEntry::Diffuse);
    model.diffuse_transmission =
        Some(DiffuseTransmission { factor: FloatSlot::constant(1.0), color: tint, subsurface });
    let radius = radius.map(|r| (f64::from(r) * scale).clamp(1e-9, 1e9) as f32);
    Some(Medium::subsurface(color, radius, anisotropy))
}
