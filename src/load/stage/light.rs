//! The light of stages: small generated environment images, which are sampled with little noise and don't depend on the
//! model's size.

use super::options::{StageLight, StageOptions};
use crate::color::luminance;
use crate::image::Image;
use crate::math::DVec3;
use crate::scene::{
    ColorSlot, Environment, MaterialId, MeshPart, Scene, ShapeKind, Texture, TextureId, instance_extents,
    scene_extent,
};
use std::f64::consts::PI;

/// Texels around the horizon.
const WIDTH: u32 = 256;
/// Texels from straight up to straight down.
const HEIGHT: u32 = 128;

type Rgb = [f64; 3];

/// A soft box far away.
struct SoftBox {
    /// From the camera's side of the model towards its right, degrees.
    azimuth: f64,
    /// Above the horizon, degrees.
    elevation: f64,
    /// Half its width and height, as angles in degrees.
    half: [f64; 2],
    /// Radiance at its centre.
    radiance: f64,
}

/// Key, fill and rim light, and a weak one above. White that faces the key reflects about 1.2 in all (tested), which the
/// filmic view shows as 0.73.
const STUDIO: [SoftBox; 4] = [
    SoftBox { azimuth: -54.0, elevation: 45.0, half: [25.0, 25.0], radiance: 5.8 },
    SoftBox { azimuth: 75.0, elevation: 20.0, half: [22.0, 30.0], radiance: 0.4 },
    SoftBox { azimuth: 156.0, elevation: 42.0, half: [30.0, 16.0], radiance: 4.6 },
    SoftBox { azimuth: 0.0, elevation: 90.0, half: [30.0, 30.0], radiance: 0.4 },
];

/// Generates the environment and adds its picture to the scene.
pub(super) fn environment(scene: &mut Scene, options: &StageOptions) -> Environment {
    if options.light == StageLight::White {
        return Environment::Constant([1.0; 3]);
    }
    let image = scene.add_image(picture(options));
    Environment::Image { image, strength: 1.0, rotation_rad: 0.0 }
}

/// The picture of a stage's light, turned to the camera's side.
fn picture(options: &StageOptions) -> Image {
    let facing = options.view.azimuth_degrees.to_radians();
    let horizon = options.backdrop();
    let mut rgb = Vec::with_capacity((WIDTH * HEIGHT * 3) as usize);
    for row in 0..HEIGHT {
        let (sin, y) = ((f64::from(row) + 0.5) / f64::from(HEIGHT) * PI).sin_cos();
        for column in 0..WIDTH {
            // The mapping of `Environment::Image`.
            let around = ((f64::from(column) + 0.5) / f64::from(WIDTH) - 0.5) * 2.0 * PI;
            let azimuth = (PI / 2.0 - around) - facing;
            let direction = DVec3::new(sin * azimuth.sin(), y, sin * azimuth.cos());
            rgb.extend(radiance(options.light, horizon, direction).map(|v| v as f32));
        }
    }
    Image::from_linear_rgb("stage", WIDTH, HEIGHT, rgb)
}

/// Radiance from a direction; the camera is on the side of z. The horizon and everything below it have the background's colour,
/// for reflections at grazing angles and light from the ground.
fn radiance(light: StageLight, horizon: [f32; 3], direction: DVec3) -> Rgb {
    let horizon = horizon.map(f64::from);
    let elevation = elevation_degrees(direction);
    let room = |zenith: Rgb, low: f64, high: f64| {
        let up = smooth(low, high, elevation);
        std::array::from_fn(|c| mix(horizon[c], zenith[c], up))
    };
    let add = |room: Rgb, tint: Rgb, light: f64| std::array::from_fn(|c| room[c] + tint[c] * light);
    match light {
        StageLight::Studio => {
            let boxes = STUDIO.iter().map(|b| b.radiance * b.coverage(direction)).sum();
            add(room([0.08; 3], 3.0, 18.0), [1.0; 3], boxes)
        }
        StageLight::Sky => {
            let sun = disk(direction, -50.0, 46.0, 11.0);
            add(room([0.07, 0.13, 0.27], 0.0, 40.0), [1.0, 0.93, 0.82], 48.0 * sun)
        }
        StageLight::Sunset => {
            let (sun, glow) = (disk(direction, -62.0, 22.0, 11.0), disk(direction, -62.0, 14.0, 50.0));
            add(room([0.06, 0.08, 0.17], 0.0, 36.0), [1.0, 0.6, 0.3], 38.0 * sun + 0.5 * glow)
        }
        _ => [0.0; 3],
    }
}

impl SoftBox {
    /// Its weight in a direction, 0..1, with soft edges.
    fn coverage(&self, direction: DVec3) -> f64 {
        let axis = toward(self.azimuth, self.elevation);
        let forward = direction.dot(axis);
        if forward <= 0.0 {
            return 0.0;
        }
        let (sin, cos) = self.azimuth.to_radians().sin_cos();
        let right = DVec3::new(cos, 0.0, -sin);
        let up = axis.cross(right);
        let along = |side: DVec3, half: f64| (direction.dot(side) / forward).atan().abs().to_degrees() / half;
        let edge = |v: f64| 1.0 - smooth(0.7, 1.0, v);
        edge(along(right, self.half[0])) * edge(along(up, self.half[1]))
    }
}

/// A disk of this radius in degrees with a soft edge.
fn disk(direction: DVec3, azimuth: f64, elevation: f64, radius: f64) -> f64 {
    let angle = direction.dot(toward(azimuth, elevation)).clamp(-1.0, 1.0).acos().to_degrees();
    1.0 - smooth(0.5 * radius, radius, angle)
}

fn toward(azimuth: f64, elevation: f64) -> DVec3 {
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

/// A cubic from 0 at `low` to 1 at `high`.
pub(super) fn smooth(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Irradiance over pi of a stage's light on a surface of this normal. The camera is at +z.
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

// Light emitted by the surfaces of a scene.

/// Emissive parts count as the scene's lights if their power, spread evenly over the inside of the box around all, gives white
/// walls of at least this radiance. A PNG shows it as 38 of 255; the soft sky makes some 30 times of it.
const MIN_WALL_RADIANCE: f64 = 0.02;

/// Maximum number of texels along each side of an image for its mean.
const TEXELS: u32 = 256;

/// The role of emissive surfaces in a scene's lighting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EmittedLight {
    /// There are none.
    None,
    /// They glow, without lighting the scene noticeably. None is brighter than white paper in full
    /// light, as those of glTF are that use no `KHR_materials_emissive_strength`.
    Glow,
    /// Lamps of little power.
    Dim,
    /// They light the scene.
    Light,
}

/// The role of a scene's emissive surfaces. The scene need not be valid. Unused materials don't count.
pub(super) fn of(scene: &Scene) -> EmittedLight {
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
        let share = if s.kind != ShapeKind::Disk { 4.0 } else { 1.0 };
        add(s.material, &|| share * PI * s.radius * s.radius);
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
            let triangles = run(&mesh.triangles, part);
            add(instance.material.unwrap_or(part.material), &|| triangles.iter().map(area).sum());
        }
    }
    if strongest <= 0.0 {
        return EmittedLight::None;
    }
    match power / inside(scene) {
        // Areas that are not finite don't count.
        radiance if radiance.is_nan() || radiance >= MIN_WALL_RADIANCE => EmittedLight::Light,
        _ if strongest <= 1.0 => EmittedLight::Glow,
        _ => EmittedLight::Dim,
    }
}

/// The triangles of a part.
fn run<'m>(triangles: &'m [[u32; 3]], part: &MeshPart) -> &'m [[u32; 3]] {
    let first = part.first_triangle as usize;
    triangles.get(first..first.saturating_add(part.triangle_count as usize)).unwrap_or_default()
}

/// Area of the box around a scene, above 0.
fn inside(scene: &Scene) -> f64 {
    let size = scene_extent(scene, &instance_extents(scene)).0.map_or(DVec3::ONE, |(low, high)| high - low);
    (2.0 * (size.x * size.y + size.y * size.z + size.z * size.x)).max(f64::MIN_POSITIVE)
}

/// Mean luminance of a slot; of a texture, over its whole image.
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
    let (columns, rows) = (image.width.min(TEXELS), image.height.min(TEXELS));
    let place = |i: u32, count: u32, size: u32| {
        // Below the size, which is a u32.
        ((2 * u64::from(i) + 1) * u64::from(size) / (2 * u64::from(count))) as u32
    };
    let mut sum = [0.0f64; 3];
    for y in 0..rows {
        for x in 0..columns {
            let texel = image.rgba(place(x, columns, image.width), place(y, rows, image.height));
            (0..3).for_each(|c| sum[c] += f64::from(texel[c]));
        }
    }
    let count = (u64::from(columns) * u64::from(rows)).max(1) as f64;
    sum.map(|v| (v / count) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The filmic view shows 1.35 as 0.76: white is not burnt out however it is turned; and no side is lost in the dark.
    #[test]
    fn white_stays_below_one_and_shade_is_not_black() {
        for light in [StageLight::Studio, StageLight::Sky, StageLight::Sunset, StageLight::White] {
            let mut all: Vec<f64> = Vec::new();
            for azimuth in (0..360).step_by(15) {
                for elevation in (-90..=90).step_by(15) {
                    let normal = toward(f64::from(azimuth), f64::from(elevation));
                    all.extend(reflected(light, light.background(), normal));
                }
            }
            let (least, most) = all.iter().fold((9.0f64, 0.0f64), |(l, m), &v| (l.min(v), m.max(v)));
            let limit = if light == StageLight::White { 1.01 } else { 1.35 };
            assert!(most <= limit && least > 0.08, "{light}: {least} to {most}");
            assert!(light == StageLight::White || most > 2.0 * least, "{light}: {least} to {most}");
        }
    }
}
