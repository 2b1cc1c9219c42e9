//! How much light the shining parts of a scene give.

use crate::color::luminance;
use crate::image::Image;
use crate::math::DVec3;
use crate::scene::{
    ColorSlot, MaterialId, MeshPart, Scene, ShapeKind, Texture, TextureId, instance_extents, scene_extent,
};

/// Parts light a scene where the light that they send out, spread evenly over the inside of the box around all, makes white
/// walls of at least this radiance. A PNG shows it as 38 of 255; the soft sky makes some 30 times of it.
const ENOUGH: f64 = 0.02;

/// Texels of an image, along each side, that its mean is taken of at most.
const TEXELS: u32 = 256;

/// What shining parts do for a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shine {
    /// There are none.
    None,
    /// They glow: they show themselves, and light nothing worth looking at. None is brighter than white paper in full
    /// light, as those of glTF are that use no `KHR_materials_emissive_strength`.
    Glow,
    /// Lamps of little power.
    Dim,
    /// They light the scene.
    Light,
}

/// What the shining parts of a scene do, which need not be valid. Materials count only where something uses them.
pub(super) fn of(scene: &Scene) -> Shine {
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
        add(s.material, &|| share * std::f64::consts::PI * s.radius * s.radius);
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
    match (strongest, power / inside(scene)) {
        (strongest, _) if strongest <= 0.0 => Shine::None,
        // Areas that are not finite are no reason to light anything.
        (_, radiance) if radiance.is_nan() || radiance >= ENOUGH => Shine::Light,
        (strongest, _) if strongest <= 1.0 => Shine::Glow,
        _ => Shine::Dim,
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

/// Mean luminance of what a slot holds; that of an image all over, wherever the surface has it.
fn mean(scene: &Scene, slot: &ColorSlot) -> f64 {
    let texture = slot.texture.map_or([1.0; 3], |id| mean_of_texture(scene, id));
    f64::from(luminance(std::array::from_fn(|c| slot.factor[c] * texture[c])))
}

fn mean_of_texture(scene: &Scene, id: TextureId) -> [f32; 3] {
    match scene.textures.get(id.index()) {
        Some(Texture::Image { image, .. }) => {
            // What can't be decoded is told of when the scene is compiled, and left out.
            let image = scene.images.get(image.index()).and_then(|image| image.decoded().ok());
            image.as_ref().map_or([1.0; 3], mean_of_image)
        }
        Some(Texture::Solid(color)) => *color,
        // Patterns are made to be seen.
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
