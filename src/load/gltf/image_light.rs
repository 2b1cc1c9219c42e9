//! EXT_lights_image_based: a cube map as the environment, resampled here to an equirectangular image in world space. The
//! prefiltered mip levels and the irradiance coefficients are not needed.
//!
//! The faces are +x, -x, +y, -y, +z, -z, each as seen from inside the cube: mirrored against the usual convention for cube
//! maps. PNGs with alpha are RGBD: sRGB-encoded colour divided by alpha.

use super::document::{Document, index_of, number_of, numbers_of, pointer, required};
use super::report::{Report, Valid};
use super::scene_builder::SharedAssets;
use super::textures;
use super::textures::ImageNeed;
use crate::image::{Encoding, Image, Pixels};
use crate::math::{DQuat, DVec3};
use crate::scene::{Environment, Scene};
use rayon::prelude::*;
use serde_json::Value;
use std::f64::consts::{PI, TAU};

const LIGHTS: &str = "extensions/EXT_lights_image_based/lights";
/// Maximum width of the equirectangular image, pixels (400 MB).
const MAX_WIDTH: u32 = 8192;
/// Samples per pixel of the image, along each axis.
const SAMPLES: u32 = 2;

/// Sets the environment to the image-based light of the glTF scene at an index, if it has one.
pub(super) fn light(
    doc: &Document,
    index: Option<usize>,
    (scene, shared): (&mut Scene, &mut SharedAssets),
    report: &mut Report,
) {
    let Some(at) = index.map(|index| pointer("scenes", index)) else { return };
    let at = format!("{at}/extensions/EXT_lights_image_based");
    let Some(raw) = doc.json.pointer(&at) else { return };
    let cached = shared.environment_image.take();
    let image = cached.unwrap_or_else(|| report.lasting(|report| read(doc, raw, &at, report)));
    if let Ok(image) = &image {
        let image = scene.add_image(image.clone());
        scene.environment = Environment::Image { image, strength: 1.0, rotation_rad: 0.0 };
    }
    shared.environment_image = Some(image);
}

/// The equirectangular image of the light that a scene refers to, radiance.
fn read(doc: &Document, reference: &Value, from: &str, report: &mut Report) -> Valid<Image> {
    let index = required(index_of(reference, "light", from, report), "light", from, report)?;
    let raw = doc.raw(LIGHTS, index, &format!("{from}/light"), report)?;
    let at = format!("/{LIGHTS}/{index}");
    let intensity = number_of(raw, "intensity", &at, report)?.unwrap_or(1.0);
    if !(intensity >= 0.0 && (intensity as f32).is_finite()) {
        return Err(
            report.problem(format!("{at}/intensity"), format!("{intensity} is not a number from 0 up"))
        );
    }
    let rotation = numbers_of(raw, "rotation", &at, report)?.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = DQuat::from_array(rotation);
    if !(rotation.length() > 1e-6 && rotation.is_finite()) {
        return Err(report.problem(format!("{at}/rotation"), "is not a quaternion of length 1"));
    }
    let faces = faces(doc, raw, &at, report)?;
    let size = faces[0].width;
    if raw.get("specularImageSize").and_then(Value::as_u64).is_some_and(|stated| stated != u64::from(size)) {
        let message = format!("is not {size}, the size of the images, which is used");
        report.warn(format!("{at}/specularImageSize"), message);
    }
    let name = raw.get("name").and_then(Value::as_str).unwrap_or("environment");
    Ok(Cube { faces: &faces, rotation: rotation.normalize(), intensity: intensity as f32 }
        .equirectangular(name))
}

/// Indices of the images of a scene's environment.
pub(super) fn images_of(doc: &Document, scene: Option<usize>) -> Vec<usize> {
    let index = scene.and_then(|scene| {
        let at = format!("{}/extensions/EXT_lights_image_based/light", pointer("scenes", scene));
        doc.json.pointer(&at)?.as_u64()
    });
    let raw = index.and_then(|index| doc.json.pointer(&format!("/{LIGHTS}/{index}")));
    raw.and_then(base_level).unwrap_or_default()
}

/// Indices of the images of a light's mip level 0.
fn base_level(raw: &Value) -> Option<Vec<usize>> {
    let index = |v: &Value| v.as_u64().and_then(|i| usize::try_from(i).ok());
    raw.get("specularImages")?.get(0)?.as_array()?.iter().map(index).collect()
}

/// The six faces of mip level 0, squares of one size.
fn faces(doc: &Document, raw: &Value, at: &str, report: &mut Report) -> Valid<Vec<Image>> {
    let at = format!("{at}/specularImages");
    let Some(list) = base_level(raw).filter(|list| list.len() == 6) else {
        return Err(report.problem(format!("{at}/0"), "is not a list of six images, the faces of a cube map"));
    };
    let need = |&index: &usize| ImageNeed { index, encoding: Encoding::Srgb, gloss: None };
    let needs: Vec<ImageNeed> = list.iter().map(need).collect();
    let images = textures::read(doc, &needs, report);
    if images.len() < needs.len() {
        return Err(report.problem(at, "holds an image that can't be read"));
    }
    let size = images[0].width;
    if images.iter().any(|image| (image.width, image.height) != (size, size)) {
        return Err(report.problem(format!("{at}/0"), "are not six squares of the same size"));
    }
    Ok(images)
}

/// A cube map.
struct Cube<'i> {
    faces: &'i [Image],
    /// Rotation from the space of the cube map to world space.
    rotation: DQuat,
    intensity: f32,
}

impl Cube<'_> {
    /// The equirectangular image, as wide as the four faces around the horizon.
    fn equirectangular(&self, name: &str) -> Image {
        let width = self.faces[0].width.saturating_mul(4).min(MAX_WIDTH);
        let height = width / 2;
        let mut rgb = vec![0.0; width as usize * height as usize * 3];
        rgb.par_chunks_mut(width as usize * 3).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                pixel.copy_from_slice(&self.pixel([x as u32, y as u32], [width, height]));
            }
        });
        Image::from_linear_rgb(name, width, height, rgb)
    }

    /// The mean radiance over a pixel of the image.
    fn pixel(&self, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for ray in 0..SAMPLES * SAMPLES {
            let within = |i: u32| (f64::from(i) + 0.5) / f64::from(SAMPLES);
            let u = (f64::from(x) + within(ray % SAMPLES)) / f64::from(width);
            let v = (f64::from(y) + within(ray / SAMPLES)) / f64::from(height);
            let (azimuth, polar) = ((u - 0.5) * TAU, v * PI);
            let (sin, cos) = polar.sin_cos();
            let direction = DVec3::new(sin * azimuth.cos(), cos, sin * azimuth.sin());
            let found = self.radiance(self.rotation.inverse() * direction);
            sum = std::array::from_fn(|c| sum[c] + found[c]);
        }
        sum.map(|s| s * self.intensity / (SAMPLES * SAMPLES) as f32)
    }

    /// Radiance from a direction in the space of the cube map, with bilinear filtering.
    fn radiance(&self, d: DVec3) -> [f32; 3] {
        let (face, right, down) = cube_face(d);
        let image = &self.faces[face];
        let last = f64::from(image.width - 1);
        let texel_at = |s: f64| ((s + 1.0) / 2.0 * f64::from(image.width) - 0.5).clamp(0.0, last);
        let (x, y) = (texel_at(right), texel_at(down));
        let [x0, y0] = [x.floor(), y.floor()];
        let mut sum = [0.0; 3];
        for (i, weight_x) in [(0.0, 1.0 - (x - x0)), (1.0, x - x0)] {
            for (j, weight_y) in [(0.0, 1.0 - (y - y0)), (1.0, y - y0)] {
                let texel = texel(image, (x0 + i).min(last) as u32, (y0 + j).min(last) as u32);
                let weight = (weight_x * weight_y) as f32;
                sum = std::array::from_fn(|c| sum[c] + texel[c] * weight);
            }
        }
        sum
    }
}

/// The face that a direction hits, and the position on it from -1 to 1, right and down as seen from inside.
fn cube_face(d: DVec3) -> (usize, f64, f64) {
    let size = d.abs();
    let (axis, largest) = if size.x >= size.y && size.x >= size.z {
        (0, size.x)
    } else if size.y >= size.z {
        (1, size.y)
    } else {
        (2, size.z)
    };
    let DVec3 { x, y, z } = d / largest;
    let is_back = d[axis] < 0.0;
    let (right, down) = match (axis, is_back) {
        (0, false) => (z, -y),
        (0, true) => (-z, -y),
        (1, false) => (-x, z),
        (1, true) => (-x, -z),
        (_, false) => (-x, -y),
        (_, true) => (x, -y),
    };
    (2 * axis + usize::from(is_back), right, down)
}

/// A texel as radiance.
fn texel(image: &Image, x: u32, y: u32) -> [f32; 3] {
    let [r, g, b, alpha] = image.rgba(x, y);
    if matches!(*image.pixels, Pixels::F32(_)) {
        return [r, g, b];
    }
    // The smallest nonzero alpha of 8 bits.
    let divisor = alpha.max(1.0 / 255.0);
    [r, g, b].map(|c| c / divisor)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cube map faces that encode their direction as colour become a smooth equirectangular image.
    #[test]
    fn faces_join_at_their_edges() {
        let size = 64;
        // The direction of a texel by the usual definition of cube maps, mirrored left to right.
        let direction = |face: usize, s: f64, t: f64| match face {
            0 => DVec3::new(1.0, -t, -s),
            1 => DVec3::new(-1.0, -t, s),
            2 => DVec3::new(s, 1.0, t),
            3 => DVec3::new(s, -1.0, -t),
            4 => DVec3::new(s, -t, 1.0),
            _ => DVec3::new(-s, -t, -1.0),
        };
        let face = |face: usize| {
            let texels = (0..size * size).flat_map(|i| {
                let at = |i: u32| (f64::from(i) + 0.5) / f64::from(size) * 2.0 - 1.0;
                let d = direction(face, -at(i % size), at(i / size)).normalize();
                [d.x, d.y, d.z].map(|c| (c + 1.0) as f32)
            });
            Image::from_linear_rgb("", size, size, texels.collect())
        };
        let faces: Vec<Image> = (0..6).map(face).collect();
        let rotation = DQuat::from_rotation_y(1.0) * DQuat::from_rotation_x(0.4);
        let cube = Cube { faces: &faces, rotation, intensity: 2.0 };
        let picture = cube.equirectangular("");
        assert_eq!((picture.width, picture.height), (256, 128));
        for (x, y) in (0..picture.width).flat_map(|x| (0..picture.height).map(move |y| (x, y))) {
            let (azimuth, polar) =
                ((f64::from(x) + 0.5) / 256.0 * TAU - PI, (f64::from(y) + 0.5) / 128.0 * PI);
            let d = DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
            let expected = (rotation.inverse() * d + DVec3::ONE) * 2.0;
            let [r, g, b, _] = picture.rgba(x, y);
            let off = (DVec3::new(r.into(), g.into(), b.into()) - expected).abs().max_element();
            assert!(off < 0.05, "{x} {y}: {off}");
        }
    }
}
