//! The light of stages: small generated environment images, which cause little noise and are independent of the model's size.

use super::options::{StageLight, StageOptions};
use crate::color::luminance;
use crate::image::Image;
use crate::math::DVec3;
use crate::scene::{
    ColorSlot, Environment, MaterialId, Scene, ShapeKind, Texture, TextureId, instance_extents, scene_extent,
};
use std::f64::consts::PI;

/// Width of the environment image, texels.
const WIDTH: u32 = 256;
/// Height of the environment image, texels.
const HEIGHT: u32 = 128;

type Rgb = [f64; 3];

/// A distant softbox.
struct SoftBox {
    /// From the direction of the camera towards the camera's right, degrees.
    azimuth: f64,
    /// Above the horizon, degrees.
    elevation: f64,
    /// Half angles of width and height, degrees.
    half: [f64; 2],
    /// Radiance at the centre, W/sr/m2.
    radiance: f64,
}

/// Key, fill and rim light, and a weak top light. A white diffuse surface that faces the key light has a radiance of about 1.2
/// (tested), which the filmic view displays as 0.73.
const STUDIO: [SoftBox; 4] = [
    SoftBox { azimuth: -54.0, elevation: 45.0, half: [25.0, 25.0], radiance: 5.8 },
    SoftBox { azimuth: 75.0, elevation: 20.0, half: [22.0, 30.0], radiance: 0.4 },
    SoftBox { azimuth: 156.0, elevation: 42.0, half: [30.0, 16.0], radiance: 4.6 },
    SoftBox { azimuth: 0.0, elevation: 90.0, half: [30.0, 30.0], radiance: 0.4 },
];

/// Generates the environment and adds its image to the scene.
pub(super) fn environment(scene: &mut Scene, options: &StageOptions) -> Environment {
    if options.light == StageLight::White {
        return Environment::Constant([1.0; 3]);
    }
    let image = scene.add_image(picture(options));
    Environment::Image { image, strength: 1.0, rotation_rad: 0.0 }
}

/// The environment image of a stage, rotated to the camera's azimuth.
fn picture(options: &StageOptions) -> Image {
    let camera_azimuth = options.view.azimuth_degrees.to_radians();
    let horizon = options.backdrop();
    let mut rgb = Vec::with_capacity((WIDTH * HEIGHT * 3) as usize);
    for row in 0..HEIGHT {
        let (sin, y) = ((f64::from(row) + 0.5) / f64::from(HEIGHT) * PI).sin_cos();
        for column in 0..WIDTH {
            // In the convention of `Environment::Image`.
            let phi = ((f64::from(column) + 0.5) / f64::from(WIDTH) - 0.5) * 2.0 * PI;
            let azimuth = (PI / 2.0 - phi) - camera_azimuth;
            let direction = DVec3::new(sin * azimuth.sin(), y, sin * azimuth.cos());
            rgb.extend(radiance(options.light, horizon, direction).map(|v| v as f32));
        }
    }
    Image::from_linear_rgb("stage", WIDTH, HEIGHT, rgb)
}

/// Radiance from a direction, with the camera at +z. The horizon and everything below have the background's colour, for
/// reflections at grazing angles and light from the ground.
fn radiance(light: StageLight, horizon: [f32; 3], direction: DVec3) -> Rgb {
    let horizon = horizon.map(f64::from);
    let elevation = elevation_degrees(direction);
    let gradient = |zenith: Rgb, low: f64, high: f64| {
        let up = smoothstep(low, high, elevation);
        std::array::from_fn(|c| mix(horizon[c], zenith[c], up))
    };
    let add = |base: Rgb, tint: Rgb, light: f64| std::array::from_fn(|c| base[c] + tint[c] * light);
    match light {
        StageLight::Studio => {
            let boxes = STUDIO.iter().map(|b| b.radiance * b.coverage(direction)).sum();
            add(gradient([0.08; 3], 3.0, 18.0), [1.0; 3], boxes)
        }
        StageLight::Sky => {
            let sun = disk(direction, -50.0, 46.0, 11.0);
            add(gradient([0.07, 0.13, 0.27], 0.0, 40.0), [1.0, 0.93, 0.82], 48.0 * sun)
        }
        StageLight::Sunset => {
            let (sun, glow) = (disk(direction, -62.0, 22.0, 11.0), disk(direction, -62.0, 14.0, 50.0));
            add(gradient([0.06, 0.08, 0.17], 0.0, 36.0), [1.0, 0.6, 0.3], 38.0 * sun + 0.5 * glow)
        }
        _ => [0.0; 3],
    }
}

impl SoftBox {
    /// Coverage in a direction, 0 to 1, with soft edges.
    fn coverage(&self, direction: DVec3) -> f64 {
        let axis = direction_of(self.azimuth, self.elevation);
        let forward = direction.dot(axis);
        if forward <= 0.0 {
            return 0.0;
        }
        let (sin, cos) = self.azimuth.to_radians().sin_cos();
        let right = DVec3::new(cos, 0.0, -sin);
        let up = axis.cross(right);
        let along = |side: DVec3, half: f64| (direction.dot(side) / forward).atan().abs().to_degrees() / half;
        let edge = |v: f64| 1.0 - smoothstep(0.7, 1.0, v);
        edge(along(right, self.half[0])) * edge(along(up, self.half[1]))
    }
}

/// Coverage of a disk with a soft edge, 0 to 1; angles in degrees.
fn disk(direction: DVec3, azimuth: f64, elevation: f64, radius: f64) -> f64 {
    let angle = direction.dot(direction_of(azimuth, elevation)).clamp(-1.0, 1.0).acos().to_degrees();
    1.0 - smoothstep(0.5 * radius, radius, angle)
}

fn direction_of(azimuth: f64, elevation: f64) -> DVec3 {
    let (sin, cos) = elevation.to_radians().sin_cos();
    let (x, z) = azimuth.to_radians().sin_cos();
    DVec3::new(x * cos, sin, z * cos)
}

fn elevation_degrees(direction: DVec3) -> f64 {
    direction.y.clamp(-1.0, 1.0).asin().to_degrees()
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Smoothstep from 0 at `low` to 1 at `high`.
pub(super) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Radiance of a white diffuse surface in a stage's light (irradiance over pi). The camera is at +z.
pub(super) fn reflected(light: StageLight, horizon: [f32; 3], normal: DVec3) -> Rgb {
    const STEPS: u32 = 64;
    if light == StageLight::White {
        return [1.0; 3];
    }
    let mut sum = [0.0; 3];
    for row in 0..STEPS {
        let (sin, y) = ((f64::from(row) + 0.5) / f64::from(STEPS) * PI).sin_cos();
        for column in 0..2 * STEPS {
            let (x, z) = ((f64::from(column) + 0.5) / f64::from(STEPS) * PI).sin_cos();
            let direction = DVec3::new(sin * x, y, sin * z);
            let cos = direction.dot(normal);
            if cos > 0.0 {
                let from = radiance(light, horizon, direction);
                (0..3).for_each(|c| sum[c] += from[c] * cos * sin);
            }
        }
    }
    let cell = (PI / f64::from(STEPS)).powi(2);
    sum.map(|v| v * cell / PI)
}

/// Emissive surfaces light the scene if their power, spread evenly over the faces of the scene's bounding box, gives white
/// walls at least this radiance, W/sr/m2. A PNG shows it as 38 of 255; the soft sky gives 30 times as much.
const MIN_WALL_RADIANCE: f64 = 0.02;

/// Maximum number of texels along each side of an image for its mean.
const MAX_TEXELS: u32 = 256;

/// Classification of a scene's emissive surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EmittedLight {
    /// No emissive surfaces.
    None,
    /// Too dim to light the scene, with factors of at most 1, as in glTF without `KHR_materials_emissive_strength`.
    Glow,
    /// Too dim to light the scene, with factors above 1.
    Dim,
    /// Light sources.
    Light,
}

/// Classifies a scene's emissive surfaces. The scene need not be valid. Unused materials don't count.
pub(super) fn classify_emission(scene: &Scene) -> EmittedLight {
    let radiances: Vec<f64> =
        scene.materials.iter().map(|m| m.emission.map_or(0.0, |e| mean(scene, &e.radiance))).collect();
    let strength = |id: MaterialId| {
        scene
            .materials
            .get(id.index())
            .and_then(|m| m.emission)
            .map(|e| f64::from(luminance(e.radiance.factor)))
    };
    let (mut power, mut strongest) = (0.0, 0.0f64);
    let mut add = |material: MaterialId, area: &dyn Fn() -> f64| {
        let Some(factor) = strength(material).filter(|&factor| factor > 0.0) else { return };
        strongest = strongest.max(factor);
        power += radiances[material.index()] * area();
    };
    for s in &scene.shapes {
        let area_factor = if s.kind != ShapeKind::Disk { 4.0 } else { 1.0 };
        add(s.material, &|| area_factor * PI * s.radius * s.radius);
    }
    for q in &scene.quads {
        add(q.material, &|| q.edge_u.cross(q.edge_v).length());
    }
    for instance in &scene.instances {
        let Some(mesh) = scene.meshes.get(instance.mesh.index()) else { continue };
        let corner = |i: u32| {
            let p = mesh.positions.get(i as usize).copied().unwrap_or_default();
            instance.world_from_object.transform_point3(DVec3::from(p.map(f64::from)))
        };
        let area =
            |&[a, b, c]: &[u32; 3]| 0.5 * (corner(b) - corner(a)).cross(corner(c) - corner(a)).length();
        for part in &mesh.parts {
            let triangles = mesh.triangles.get(part.triangles()).unwrap_or_default();
            add(instance.material.unwrap_or(part.material), &|| triangles.iter().map(area).sum());
        }
    }
    if strongest <= 0.0 {
        return EmittedLight::None;
    }
    match power / bounds_area(scene) {
        // NaN from areas that aren't finite counts as light.
        radiance if radiance.is_nan() || radiance >= MIN_WALL_RADIANCE => EmittedLight::Light,
        _ if strongest <= 1.0 => EmittedLight::Glow,
        _ => EmittedLight::Dim,
    }
}

/// Surface area of a scene's bounding box, m2, above 0.
fn bounds_area(scene: &Scene) -> f64 {
    let size = scene_extent(scene, &instance_extents(scene)).0.map_or(DVec3::ONE, |(low, high)| high - low);
    (2.0 * (size.x * size.y + size.y * size.z + size.z * size.x)).max(f64::MIN_POSITIVE)
}

/// Mean luminance of a colour parameter; of a texture, over its whole image.
fn mean(scene: &Scene, slot: &ColorSlot) -> f64 {
    let texture = slot.texture.map_or([1.0; 3], |id| mean_of_texture(scene, id));
    f64::from(luminance(std::array::from_fn(|c| slot.factor[c] * texture[c])))
}

fn mean_of_texture(scene: &Scene, id: TextureId) -> [f32; 3] {
    match scene.textures.get(id.index()) {
        Some(Texture::Image { image, .. }) => {
            // Damage is reported when the scene is compiled.
            let image = scene.images.get(image.index()).and_then(|image| image.decoded(&mut Vec::new()).ok());
            image.as_ref().map_or([1.0; 3], mean_of_image)
        }
        Some(Texture::Solid(color)) => *color,
        // Procedural textures count as white.
        _ => [1.0; 3],
    }
}

fn mean_of_image(image: &Image) -> [f32; 3] {
    let (columns, rows) = (image.width.min(MAX_TEXELS), image.height.min(MAX_TEXELS));
    let center = |i: u32, count: u32, size: u32| {
        ((2 * u64::from(i) + 1) * u64::from(size) / (2 * u64::from(count))) as u32
    };
    let mut sum = [0.0f64; 3];
    for y in 0..rows {
        for x in 0..columns {
            let texel = image.rgba(center(x, columns, image.width), center(y, rows, image.height));
            (0..3).for_each(|c| sum[c] += f64::from(texel[c]));
        }
    }
    let count = (u64::from(columns) * u64::from(rows)).max(1) as f64;
    sum.map(|v| (v / count) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White diffuse surfaces of any orientation are neither clipped (the filmic view displays 1.35 as 0.76) nor black.
    #[test]
    fn white_stays_below_one_and_shade_is_not_black() {
        for light in [StageLight::Studio, StageLight::Sky, StageLight::Sunset, StageLight::White] {
            let mut all: Vec<f64> = Vec::new();
            for azimuth in (0..360).step_by(15) {
                for elevation in (-90..=90).step_by(15) {
                    let normal = direction_of(f64::from(azimuth), f64::from(elevation));
                    all.extend(reflected(light, light.background(), normal));
                }
            }
            let (min, max) = all.iter().fold((9.0f64, 0.0f64), |(l, m), &v| (l.min(v), m.max(v)));
            let limit = if light == StageLight::White { 1.01 } else { 1.35 };
            assert!(max <= limit && min > 0.08, "{light}: {min} to {max}");
            assert!(light == StageLight::White || max > 2.0 * min, "{light}: {min} to {max}");
        }
    }
}
