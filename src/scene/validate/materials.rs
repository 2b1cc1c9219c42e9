//! Checks of materials, media, images and textures.

use super::findings::{DECODED, Entry, Findings};
use super::lights::check_profile_cone;
use crate::image::{Image, Pixels};
use crate::math::DVec3;
use crate::scene::{
    AlphaMode, Backdrop, Beam, ColorSlot, EmissionGrid, FloatSlot, Fog, Grid, MAX_TEXTURE_NESTING, Mapping,
    Material, Medium, Model, Parameter, PbrMaterial, Scene, Texture, TextureId, coefficients,
};
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Display;

const FINITE: &str = "a finite number";
const FROM_ZERO: &str = "a finite number from 0 up";
/// Maximum index of refraction of metals: the Fresnel equations contain its fourth power.
const MAX_INDEX: f32 = 1e4;
const INDEX: &str = "numbers from 0 to 10,000";
const CHANNEL: &str = "a channel from 0 to 3";

pub(super) fn check_materials(scene: &Scene, findings: &mut Findings) {
    for (index, material) in scene.materials.iter().enumerate() {
        let place = Entry { list: "materials", index, name: &material.name };
        material.parameters(&mut |field, parameter| {
            check_parameter(field, parameter, scene.textures.len(), place, findings);
        });
        check_alpha(material, place, findings);
        check_model(&material.model, place, findings);
        if let Some(medium) = &material.medium {
            check_medium(medium, &scene.grids, place, findings);
            check_attenuation(medium, &material.model, place, findings);
        }
        let heights = material.displacement.map(|displacement| displacement.texture);
        check_channel(&heights, "displacement", place, findings);
        check_beam(material.emitter_traits.map(|traits| traits.beam), scene.profiles.len(), place, findings);
    }
}

/// Attenuation can't be combined with a density grid, which scales the extinction of all channels equally.
fn check_attenuation(medium: &Medium, model: &Model, place: Entry, findings: &mut Findings) {
    let Some(pbr) = model.pbr().filter(|pbr| pbr.has_volume && medium.grid.is_some()) else { return };
    let is_valid = coefficients(pbr.attenuation_color, pbr.attenuation_distance).is_none();
    let allowed = "infinite if the medium has a grid: set the medium's 'color' instead";
    findings.require(is_valid, place, "attenuation_distance", pbr.attenuation_distance, allowed);
}

/// Minimum half angle of beams: the peak radiance of narrower ones overflows f32.
const MIN_BEAM_RAD: f64 = 1e-4;

fn check_beam(beam: Option<Beam>, profiles: usize, place: Entry, findings: &mut Findings) {
    match beam {
        None | Some(Beam::Lambertian) => {}
        Some(Beam::Grid { half_angle_rad: half }) => {
            let is_valid = (MIN_BEAM_RAD..FRAC_PI_2).contains(&half);
            findings.require(is_valid, place, "half_angle_rad", half, "from 1e-4 to below pi / 2");
        }
        Some(Beam::Cone { direction, inner_angle_rad: inner, outer_angle_rad: outer, .. }) => {
            let is_valid = direction.try_normalize().is_some();
            findings.require(is_valid, place, "direction", direction, "a finite vector other than 0");
            let is_cone = outer > 0.0 && outer <= PI;
            findings.require(is_cone, place, "outer_angle_rad", outer, "above 0 and at most pi");
            let is_inside = (0.0..=if is_cone { outer } else { PI }).contains(&inner);
            findings.require(is_inside, place, "inner_angle_rad", inner, "from 0 to the outer angle");
        }
        Some(Beam::Profile { profile, rotation, cone }) => {
            let is_valid = profile.index() < profiles;
            findings.require(is_valid, place, "profile", profile, "one of the scene's profiles");
            check_profile_cone(rotation, cone, place, findings);
        }
    }
}

fn check_parameter(
    field: &'static str,
    parameter: Parameter<'_>,
    textures: usize,
    place: Entry,
    findings: &mut Findings,
) {
    if let Some(id) = parameter.texture() {
        let is_valid = id.index() < textures;
        findings.require(is_valid, place, field, id, "one of the scene's textures");
    }
    match parameter {
        Parameter::Color(ColorSlot { factor, .. }) => {
            findings.require_color(factor, place, field);
        }
        Parameter::Number(FloatSlot { factor, texture }) => {
            findings.require(factor.is_finite(), place, field, factor, FINITE);
            check_channel(texture, field, place, findings);
        }
        Parameter::Constant(&x) => {
            let (is_valid, allowed) = match field {
                "attenuation_distance" => (x > 0.0, "above 0, or infinite"),
                "rotation_rad" | "tilt_rad" | "scale" | "midlevel" => (x.is_finite(), FINITE),
                _ => (x.is_finite() && x >= 0.0, FROM_ZERO),
            };
            findings.require(is_valid, place, field, x, allowed);
        }
        Parameter::Texture(_) => {}
    }
}

fn check_channel(
    texture: &Option<(TextureId, u8)>,
    field: &'static str,
    place: Entry,
    findings: &mut Findings,
) {
    if let Some((_, channel)) = *texture {
        findings.require(channel < 4, place, field, channel, CHANNEL);
    }
}

fn check_alpha(material: &Material, place: Entry, findings: &mut Findings) {
    if let AlphaMode::Mask { cutoff } = material.alpha_mode {
        findings.require(!cutoff.is_nan(), place, "cutoff", cutoff, "a number");
    }
}

/// Checks fields that are not parameters or have special ranges. All parameters are checked by `check_parameter`.
fn check_model(model: &Model, place: Entry, findings: &mut Findings) {
    match model {
        Model::Conductor { eta, k, .. } => {
            let is_index = |rgb: &[f32; 3]| rgb.iter().all(|c| (0.0..=MAX_INDEX).contains(c));
            findings.require(is_index(eta), place, "eta", eta, INDEX);
            findings.require(is_index(k), place, "k", k, INDEX);
        }
        Model::Dielectric { ior, .. } | Model::Glass { ior, .. } => {
            findings.require(*ior != 0.0, place, "ior", ior, "a finite number above 0");
        }
        Model::Hair { ior, .. } => {
            findings.require(*ior >= 1.0, place, "ior", ior, "a finite number from 1 up")
        }
        Model::Pbr(pbr) => check_pbr(pbr, place, findings),
        Model::Mix { components } => {
            findings.require(!components.is_empty(), place, "components", 0, "at least one material");
            components.iter().for_each(|component| check_component(&component.material, place, findings));
        }
        _ => {}
    }
}

fn check_component(material: &Material, place: Entry, findings: &mut Findings) {
    let name = &material.name;
    let has_own = material.emission.is_some() || material.alpha_mode != AlphaMode::Opaque;
    let allowed = "without emission and alpha: set them on the mix";
    findings.require(!has_own, place, "components", name, allowed);
    let is_leaf = material.model.components().is_empty();
    findings.require(is_leaf, place, "components", name, "a material other than a mix");
    let is_boundary = matches!(material.model, Model::Boundary {});
    findings.require(!is_boundary, place, "components", name, "a material with a surface");
    if is_leaf {
        check_model(&material.model, place, findings);
    }
}

fn check_pbr(pbr: &PbrMaterial, place: Entry, findings: &mut Findings) {
    findings.require_color(&pbr.attenuation_color, place, "attenuation_color");
    if let Some(film) = &pbr.iridescence {
        check_channel(&film.thickness_texture, "thickness_texture", place, findings);
    }
}

// Media.

/// Maximum extinction, per metre: shorter mean free paths are below the precision of positions.
const MAX_EXTINCTION: f32 = 1e9;

fn check_medium(medium: &Medium, grids: &[Grid], place: impl Display + Copy, findings: &mut Findings) {
    let is_valid = medium.extinction.iter().all(|x| (0.0..=MAX_EXTINCTION).contains(x));
    findings.require(is_valid, place, "extinction", medium.extinction, "numbers from 0 to 1e9 per metre");
    let is_valid = medium.albedo.iter().all(|x| (0.0..=1.0).contains(x));
    findings.require(is_valid, place, "albedo", medium.albedo, "numbers from 0 to 1");
    let is_valid = medium.anisotropy.abs() < 1.0;
    findings.require(is_valid, place, "anisotropy", medium.anisotropy, "above -1 and below 1");
    findings.require_color(&medium.emission, place, "emission");
    findings.require(
        medium.textures.is_empty(),
        place,
        "textures",
        medium.textures,
        "none: the loader bakes them to grids",
    );
    let channel_grids =
        [("extinction_grids", medium.extinction_grids), ("scattering_grids", medium.scattering_grids)];
    let emission_grids =
        medium.emission_grid.into_iter().flat_map(|grid| grid.grids()).map(|id| ("emission_grid", id));
    let channels =
        channel_grids.iter().flat_map(|&(field, ids)| ids.into_iter().flatten().map(move |id| (field, id)));
    for (field, id) in channels.clone().chain(emission_grids) {
        findings.require(medium.grid.is_some(), place, field, id, "none without a density grid");
        findings.require(grids.get(id.index()).is_some(), place, field, id, "one of the scene's grids");
    }
    if let Some(EmissionGrid::Temperatures { kelvin, .. }) = medium.emission_grid {
        findings.require((1e-6..=1e6).contains(&kelvin), place, "kelvin", kelvin, "from 1e-6 to 1e6");
    }
    let Some(id) = medium.grid else { return };
    let Some(grid) = grids.get(id.index()) else {
        return findings.reject(place, "grid", id, "one of the scene's grids");
    };
    for (field, id) in channels {
        let Some(channel) = grids.get(id.index()) else { continue };
        let is_same = channel.size == grid.size && channel.world_from_voxels == grid.world_from_voxels;
        let is_valid = is_same && channel.values.iter().zip(&*grid.values).all(|(s, d)| s <= d || d.is_nan());
        findings.require(is_valid, place, field, id, "at most the values of 'grid', on the same voxels");
    }
    let [r, g, b] = medium.extinction;
    let max_extinction = r.max(g).max(b);
    let max_density = grid.values.iter().fold(0.0f32, |max, x| max.max(*x));
    let paths = f64::from(max_density) * f64::from(max_extinction) * grid.longest_diagonal();
    // NaN is reported above.
    let is_valid = paths.is_nan() || paths <= Grid::MAX_MEAN_FREE_PATHS;
    findings.require(
        is_valid,
        place,
        "grid",
        paths,
        "at most 1e5 mean free paths across at its maximum density",
    );
}

fn check_grids(grids: &[Grid], findings: &mut Findings) {
    for (index, grid) in grids.iter().enumerate() {
        let place = Entry { list: "grids", index, name: &grid.name };
        let voxels = grid.size.iter().try_fold(1usize, |product, &n| product.checked_mul(n as usize));
        let is_valid = voxels.is_some_and(|n| n > 0 && n == grid.values.len());
        findings.require(is_valid, place, "size", grid.size, "above 0, with the number of values as product");
        findings.require_finite(&grid.values, place, "values");
        let is_valid = grid.values.iter().all(|x| x.is_nan() || *x >= 0.0);
        findings.require(is_valid, place, "values", "negative", "numbers from 0 up");
        let map = grid.world_from_voxels;
        let is_invertible = map.is_finite() && map.matrix3.determinant() != 0.0;
        let voxel = DVec3::from_array([0, 1, 2].map(|k| map.matrix3.col(k).length()));
        let is_sized = !(voxel.min_element() < 1e-18 || voxel.max_element() > 1e18);
        // Rays are transformed to voxels in f32, in which the inverse of a nearly singular transform overflows.
        let has_inverse = map.matrix3.inverse().as_mat3().is_finite();
        let is_valid = is_invertible && (has_inverse || !is_sized);
        findings.require(is_valid, place, "world_from_voxels", map, "finite and invertible");
        // NaN and singular transforms are reported above.
        let is_valid = is_sized || !is_invertible;
        findings.require(is_valid, place, "world_from_voxels", voxel, "voxels between 1e-18 and 1e18 metres");
    }
}

pub(super) fn check_media(scene: &Scene, findings: &mut Findings) {
    const PLACE: &str = "fog";
    check_grids(&scene.grids, findings);
    let Some(Fog { medium, center, radius }) = &scene.fog else { return };
    check_medium(medium, &[], PLACE, findings);
    findings.require(medium.grid.is_none(), PLACE, "grid", medium.grid, "none: only solids support grids");
    findings.require(center.is_finite(), PLACE, "center", center, "finite numbers");
    let is_valid = *radius > 0.0;
    findings.require(is_valid, PLACE, "radius", radius, "above 0, or infinite");
    let channels = medium.emission.iter().zip(&medium.extinction);
    let is_bounded = radius.is_finite() || channels.into_iter().all(|(e, x)| *e == 0.0 || *x > 0.0);
    findings.require(
        is_bounded,
        PLACE,
        "emission",
        medium.emission,
        "0 in channels where unbounded fog has no extinction",
    );
}

// Images.

pub(super) fn check_images(scene: &Scene, findings: &mut Findings) {
    // NaN texels are black in the environment, but propagate from textures.
    let mut is_texture = vec![false; scene.images.len()];
    for texture in &scene.textures {
        if let Texture::Image { image, .. } = texture
            && let Some(is_texture) = is_texture.get_mut(image.index())
        {
            *is_texture = true;
        }
    }
    for (index, image) in scene.images.iter().enumerate() {
        check_image(image, Entry { list: "images", index, name: &image.name }, is_texture[index], findings);
    }
    if let Some(Backdrop::Picture(image)) = &scene.backdrop {
        let place = Entry { list: "backdrop", index: 0, name: &image.name };
        findings.require(!image.is_encoded(), place, "pixels", "encoded", DECODED);
        check_image(image, Entry { list: "backdrop", index: 0, name: &image.name }, true, findings);
    }
}

/// Checks an image, and that its values are finite if required.
fn check_image(image: &Image, place: Entry, must_be_finite: bool, findings: &mut Findings) {
    findings.require(image.width > 0, place, "width", image.width, "at least 1");
    findings.require(image.height > 0, place, "height", image.height, "at least 1");
    let channels = image.channels;
    findings.require((1..=4).contains(&channels), place, "channels", channels, "1 to 4");
    let length = match &*image.pixels {
        Pixels::U8(list) => list.len(),
        Pixels::U16(list) => list.len(),
        Pixels::F32(list) => list.len(),
        Pixels::Encoded(encoded) => {
            let size = [image.width, image.height, image.channels];
            let is_valid = size == encoded.size;
            findings.require(is_valid, place, "width, height, channels", size, "those of the encoded image");
            return;
        }
    };
    let expected = u128::from(image.width) * u128::from(image.height) * u128::from(channels);
    let is_valid = length as u128 == expected;
    findings.require(is_valid, place, "length of pixels", length, "width * height * channels");
    if let Pixels::F32(numbers) = &*image.pixels
        && must_be_finite
    {
        findings.require_finite(numbers, place, "pixels");
    }
}

// Textures.

pub(super) fn check_textures(scene: &Scene, findings: &mut Findings) {
    // Nesting depth of each texture.
    let mut depths: Vec<u32> = Vec::with_capacity(scene.textures.len());
    // Number of lookups of each texture.
    let mut lookups: Vec<u64> = Vec::with_capacity(scene.textures.len());
    let lookups_of = |lookups: &[u64], part: TextureId| lookups.get(part.index()).copied().unwrap_or(1);
    for (index, texture) in scene.textures.iter().enumerate() {
        let place = Entry { list: "textures", index, name: "" };
        let (mut depth, mut count) = (1, 1);
        match texture {
            Texture::Solid(rgb) => findings.require_color(rgb, place, "Solid"),
            Texture::Image { image, mapping, .. } => {
                let exists = image.index() < scene.images.len();
                findings.require(exists, place, "image", image, "one of the scene's images");
                check_mapping(mapping, place, findings);
            }
            Texture::Checker { even, odd, cell_size, mapping } => {
                findings.require_length(f64::from(*cell_size), place, "cell_size", cell_size);
                check_mapping(mapping, place, findings);
                for (field, cell) in [("even", *even), ("odd", *odd)] {
                    depth = depth.max(1 + check_part(cell, field, &depths, place, findings));
                }
                count = lookups_of(&lookups, *even).max(lookups_of(&lookups, *odd));
                let is_valid = depth <= MAX_TEXTURE_NESTING;
                findings.require(is_valid, place, "nesting", depth, NESTING);
            }
            Texture::Mix { a, b, factor } => {
                for (field, part) in [("a", *a), ("b", *b), ("factor", *factor)] {
                    depth = depth.max(1 + check_part(part, field, &depths, place, findings));
                }
                count = [*a, *b, *factor]
                    .map(|part| lookups_of(&lookups, part))
                    .into_iter()
                    .fold(0, u64::saturating_add);
                check_nesting(depth, count, place, findings);
            }
            Texture::Nodes(graph) => {
                for problem in graph.problems() {
                    findings.require(false, place, "nodes", problem, "a valid graph");
                }
                for part in texture.parts() {
                    depth = depth.max(1 + check_part(part, "nodes", &depths, place, findings));
                }
                let parts = texture.parts().into_iter().map(|part| lookups_of(&lookups, part));
                count = parts.fold(1, u64::saturating_add);
                check_nesting(depth, count, place, findings);
            }
            Texture::Normal | Texture::Spectrum(_) => {}
            Texture::Facing(colors) => {
                findings.require(!colors.is_empty(), place, "Facing", colors.len(), "at least one colour");
                colors.iter().for_each(|rgb| findings.require_color(rgb, place, "Facing"));
            }
            Texture::Noise { frequency, low, high, .. } => {
                findings.require(frequency.is_finite(), place, "frequency", frequency, "a finite number");
                findings.require_color(low, place, "low");
                findings.require_color(high, place, "high");
            }
        }
        depths.push(depth);
        lookups.push(count);
    }
}

/// Maximum number of texture evaluations per lookup.
const MAX_LOOKUPS: u64 = 4096;

const NESTING: &str = "at most 64 nested textures";

/// Checks the nesting depth and the number of texture evaluations per lookup.
fn check_nesting(depth: u32, count: u64, place: Entry, findings: &mut Findings) {
    findings.require(depth <= MAX_TEXTURE_NESTING, place, "nesting", depth, NESTING);
    let expected = "made of at most 4096 textures other than mixes";
    findings.require(count <= MAX_LOOKUPS, place, "mixes", count, expected);
}

/// Checks a reference to another texture; its nesting depth, 0 if it is invalid.
fn check_part(
    part: TextureId,
    field: &'static str,
    depths: &[u32],
    place: Entry,
    findings: &mut Findings,
) -> u32 {
    let depth = depths.get(part.index()).copied();
    // Also prevents cycles.
    findings.require(depth.is_some(), place, field, part, "a texture that comes before this one");
    depth.unwrap_or(0)
}

fn check_mapping(mapping: &Mapping, place: Entry, findings: &mut Findings) {
    match mapping {
        Mapping::Uv { set, transform } => {
            findings.require(*set <= 1, place, "set", set, "0 or 1: materials use at most two sets");
            let numbers = [transform.offset.to_array(), transform.scale.to_array()];
            let is_finite = numbers.as_flattened().iter().all(|x| x.is_finite());
            let is_valid = is_finite && transform.rotation_rad.is_finite();
            findings.require(is_valid, place, "transform", transform, "made of finite numbers");
        }
        Mapping::World => {}
        Mapping::Triplanar { size } => findings.require_length(f64::from(*size), place, "size", size),
    }
}
