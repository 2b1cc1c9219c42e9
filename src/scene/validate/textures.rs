//! Textures: what they refer to, and how they lie on surfaces.

use super::findings::{Findings, Place};
use crate::scene::{MOST_NESTED_TEXTURES, Mapping, Scene, Texture, TextureId};

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    // How many textures lie one in the other, up to each one.
    let mut depths: Vec<u32> = Vec::with_capacity(scene.textures.len());
    // How many are looked up for each one.
    let mut lookups: Vec<u64> = Vec::with_capacity(scene.textures.len());
    let of = |lookups: &[u64], part: TextureId| lookups.get(part.index()).copied().unwrap_or(1);
    for (index, texture) in scene.textures.iter().enumerate() {
        let place = Place { list: "textures", index, name: "" };
        let (mut depth, mut looked_up) = (1, 1);
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
                looked_up = of(&lookups, *even).max(of(&lookups, *odd));
                let is_met = depth <= MOST_NESTED_TEXTURES;
                findings.require(is_met, place, "nesting", depth, NESTING);
            }
            Texture::Mix { a, b, factor } => {
                for (field, part) in [("a", *a), ("b", *b), ("factor", *factor)] {
                    depth = depth.max(1 + check_part(part, field, &depths, place, findings));
                }
                looked_up =
                    [*a, *b, *factor].map(|part| of(&lookups, part)).into_iter().fold(0, u64::saturating_add);
                findings.require(depth <= MOST_NESTED_TEXTURES, place, "nesting", depth, NESTING);
                let is_met = looked_up <= MOST_LOOKUPS;
                findings.require(
                    is_met,
                    place,
                    "mixes",
                    looked_up,
                    "made of at most 4096 textures that are no mixes",
                );
            }
            Texture::Normal | Texture::Spectrum(_) => {}
            Texture::Facing(colors) => {
                let count = colors.len();
                findings.require(count > 0, place, "Facing", count, "at least one colour");
                colors.iter().for_each(|rgb| findings.require_color(rgb, place, "Facing"));
            }
            Texture::Noise { frequency, low, high, .. } => {
                findings.require(frequency.is_finite(), place, "frequency", frequency, "a finite number");
                findings.require_color(low, place, "low");
                findings.require_color(high, place, "high");
            }
        }
        depths.push(depth);
        lookups.push(looked_up);
    }
}

/// Of one texture at one place.
const MOST_LOOKUPS: u64 = 4096;

const NESTING: &str = "at most 64 textures, one in the other";

/// The depth of a part of a texture; 0 where there is none.
fn check_part(
    part: TextureId,
    field: &'static str,
    depths: &[u32],
    place: Place,
    findings: &mut Findings,
) -> u32 {
    let depth = depths.get(part.index()).copied();
    // This also rules out circles.
    findings.require(depth.is_some(), place, field, part, "a texture that comes before this one");
    depth.unwrap_or(0)
}

fn check_mapping(mapping: &Mapping, place: Place, findings: &mut Findings) {
    match mapping {
        Mapping::Uv { set, transform } => {
            findings.require(*set <= 1, place, "set", set, "0 or 1: materials use at most two sets");
            let numbers = [transform.offset.to_array(), transform.scale.to_array()];
            let is_finite = numbers.as_flattened().iter().all(|x| x.is_finite());
            let is_met = is_finite && transform.rotation_rad.is_finite();
            findings.require(is_met, place, "transform", transform, "made of finite numbers");
        }
        Mapping::World => {}
        Mapping::Triplanar { size } => findings.require_length(f64::from(*size), place, "size", size),
    }
}
