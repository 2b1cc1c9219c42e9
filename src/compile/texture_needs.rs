//! The finest mip level needed of each texture image, estimated before decoding from the smallest footprint of rays on each
//! surface.
//!
//! The footprint of a path is at least that of a camera ray at the same distance: footprints increase along a path, and no
//! path is shorter than the direct one. Lookups filter over the footprint times the UV density (`TexturePoint`), and read the
//! next finer mip level. These are estimates: other levels are decoded on demand.

use super::objects::part_materials;
use super::scene::{CompileOptions, ExpectedPicture};
use crate::camera::Camera;
use crate::math::{DAffine3, DVec3, Vec2};
use crate::scene::{
    AlphaMode, Instance, Interpolation, Mapping, Material, Mesh, MeshPart, Motion, Scene, ShapeKind, Texture,
    TextureId,
};
use crate::texture::TextureNeeds;
use rayon::prelude::*;
use std::f64::consts::{PI, SQRT_2};

/// Maximum number of triangles of all instances for exact footprints; beyond, full resolution is kept.
const MAX_EXACT_TRIANGLES: u64 = 1 << 24;

/// Default memory limit of texture images for a picture, bytes: 1 KiB per pixel (2 GB for full HD), at least 192 MiB.
pub fn texture_memory_for(width: u32, height: u32) -> u64 {
    (u64::from(width) * u64::from(height) * 1024).max(192 << 20)
}

/// The needed mip levels of a scene's images.
pub(super) fn of(scene: &Scene, options: &CompileOptions) -> TextureNeeds {
    let by_picture =
        options.picture.as_ref().map(|picture| texture_memory_for(picture.width, picture.height));
    let limit = options.texture_memory.or(by_picture);
    if !scene.images.iter().any(|image| image.is_encoded()) {
        return TextureNeeds { finest: Vec::new(), limit };
    }
    let footprints = footprints(scene, options.picture.as_ref());
    // Unused textures have no footprint.
    let mut min_footprints = vec![None::<f32>; scene.textures.len()];
    for (material, smallest) in scene.materials.iter().zip(&footprints).filter(|(_, f)| f.is_used) {
        let mut note = |id: TextureId, footprint: &dyn Fn(&Mapping) -> f32| {
            for id in Texture::images_of(&scene.textures, id) {
                let Texture::Image { mapping, .. } = &scene.textures[id.index()] else { continue };
                let (footprint, min) = (footprint(mapping), &mut min_footprints[id.index()]);
                *min = Some(min.map_or(footprint, |min| min.min(footprint)));
            }
        };
        material.textures().for_each(|id| note(id, &|mapping| smallest.footprint(mapping)));
        // Light samples and shadow rays have no footprint.
        unfiltered(material).for_each(|id| note(id, &|_| 0.0));
    }
    let mut finest = vec![None::<u32>; scene.images.len()];
    for (texture, footprint) in scene.textures.iter().zip(min_footprints) {
        if let Texture::Image { image, interpolation, .. } = texture
            && let Some(finest) = finest.get_mut(image.index())
            && let Some(footprint) = footprint
        {
            let image = &scene.images[image.index()];
            let texels = footprint * (f64::from(image.width) * f64::from(image.height)).sqrt() as f32;
            let level = match interpolation {
                // With a margin for rounding.
                Interpolation::Trilinear if texels > 1.0 => (texels * 0.999).log2().max(0.0) as u32,
                _ => 0,
            };
            *finest = Some(finest.map_or(level, |finest_yet: u32| finest_yet.min(level)));
        }
    }
    TextureNeeds { finest, limit }
}

/// The textures of a material with unfiltered lookups: emission and alpha.
fn unfiltered(material: &Material) -> impl Iterator<Item = TextureId> {
    let radiance = material.emission.map(|emission| emission.radiance);
    let emissive = radiance.filter(|slot| slot.factor != [0.0; 3]).and_then(|slot| slot.texture);
    let is_partial = material.alpha_mode != AlphaMode::Opaque;
    let alpha = material.alpha.texture.filter(|_| is_partial).map(|(id, _)| id);
    let transparent_color = material.transparent_color.texture.filter(|_| is_partial);
    emissive.into_iter().chain(alpha).chain(transparent_color)
}

/// The smallest footprint of rays on the surfaces of a material.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    /// Does any surface have the material?
    is_used: bool,
    /// Width, metres.
    width: f32,
    /// Width in texture space, by UV set.
    uv_widths: [f32; 2],
}

impl Footprint {
    /// Without surfaces.
    const UNUSED: Footprint =
        Footprint { is_used: false, width: f32::INFINITY, uv_widths: [f32::INFINITY; 2] };
    /// Unknown: the finest mip level is needed.
    const ZERO: Footprint = Footprint { is_used: true, width: 0.0, uv_widths: [0.0; 2] };

    /// The footprint on a surface with a constant UV density.
    fn at(width: f64, uv_per_metre: f64) -> Footprint {
        let uv_widths = [(width * uv_per_metre) as f32; 2];
        Footprint { is_used: true, width: width as f32, uv_widths }
    }

    fn min(self, other: Footprint) -> Footprint {
        let uv_widths = [0, 1].map(|set| self.uv_widths[set].min(other.uv_widths[set]));
        Footprint { is_used: self.is_used || other.is_used, width: self.width.min(other.width), uv_widths }
    }

    /// The minimum footprint of lookups, texture space.
    fn footprint(&self, mapping: &Mapping) -> f32 {
        match mapping {
            Mapping::Uv { set, transform } => {
                let Vec2 { x, y } = transform.scale;
                self.uv_widths[(*set as usize).min(1)] * (x * y).abs().sqrt()
            }
            Mapping::World => self.width,
            Mapping::Triplanar { size } => self.width / size,
        }
    }
}

/// The smallest footprint on the surfaces of each material.
fn footprints(scene: &Scene, picture: Option<&ExpectedPicture>) -> Vec<Footprint> {
    let nothing = || vec![Footprint::UNUSED; scene.materials.len()];
    let eye = picture.map(Viewpoint::new);
    let needs_footprint: Vec<bool> = scene.materials.iter().map(|m| has_large_pyramid(scene, m)).collect();
    let triangles = scene.instances.iter().map(|i| scene.meshes[i.mesh.index()].triangles.len() as u64);
    let is_exact = triangles.sum::<u64>() <= MAX_EXACT_TRIANGLES;
    let with_instance = |mut all: Vec<Footprint>, instance: &Instance| {
        let mesh = &scene.meshes[instance.mesh.index()];
        for (part, material) in mesh.parts.iter().zip(part_materials(mesh, instance)) {
            let of_part = match &eye {
                Some(eye) if needs_footprint[material.index()] && is_exact => eye.part(mesh, part, instance),
                _ => Footprint::ZERO,
            };
            all[material.index()] = all[material.index()].min(of_part);
        }
        all
    };
    let join = |a: Vec<Footprint>, b: Vec<Footprint>| a.into_iter().zip(b).map(|(a, b)| a.min(b)).collect();
    let mut all =
        scene.instances.par_iter().with_min_len(64).fold(nothing, with_instance).reduce(nothing, join);
    let mut add = |material: usize, footprint: Option<Footprint>| {
        all[material] = all[material].min(footprint.unwrap_or(Footprint::ZERO));
    };
    for quad in &scene.quads {
        let corners = [quad.corner, quad.corner + quad.edge_u, quad.corner + quad.edge_v];
        let fourth = quad.corner + quad.edge_u + quad.edge_v;
        let density = quad.edge_u.cross(quad.edge_v).length().sqrt().recip();
        let footprint =
            eye.as_ref().map(|eye| Footprint::at(eye.width(corners.into_iter().chain([fourth])), density));
        add(quad.material.index(), footprint);
    }
    for shape in &scene.shapes {
        let density = match shape.kind {
            ShapeKind::Sphere => Some(1.0 / (SQRT_2 * PI * shape.radius)),
            ShapeKind::Disk => Some(0.5 / shape.radius),
            _ => None,
        };
        let radius = DVec3::splat(shape.radius);
        let corners = [shape.center - radius, shape.center + radius];
        add(
            shape.material.index(),
            eye.as_ref().zip(density).map(|(eye, density)| Footprint::at(eye.width(corners), density)),
        );
    }
    scene.curves.iter().for_each(|curves| add(curves.material.index(), None));
    all
}

/// Does a material read mip levels of an image that is not decoded yet?
fn has_large_pyramid(scene: &Scene, material: &Material) -> bool {
    material.textures().flat_map(|id| Texture::images_of(&scene.textures, id)).any(|id| {
        match &scene.textures[id.index()] {
            Texture::Image { image, interpolation: Interpolation::Trilinear, .. } => {
                scene.images.get(image.index()).is_some_and(|image| image.is_encoded())
            }
            _ => false,
        }
    })
}

/// The positions of a picture's camera, and the footprint of its rays.
struct Viewpoint {
    positions: Vec<DVec3>,
    /// Radius of the lens, metres.
    lens_radius: f64,
    /// Footprint of a camera ray at its origin, metres, and its growth per metre.
    cone: [f64; 2],
}

impl Viewpoint {
    fn new(picture: &ExpectedPicture) -> Viewpoint {
        let ExpectedPicture { camera, width, height } = picture;
        let (start, growth) = Camera::new(camera, *width, *height, DVec3::ZERO).pixel_cone();
        let keys = camera.motion.iter().flat_map(|motion| &motion.keys);
        let positions = keys.chain([&camera.world_from_camera]).map(|m| m.translation).collect();
        let lens_radius = camera.lens.map_or(0.0, |l| l.focus_distance * (l.defocus_angle_rad * 0.5).tan());
        Viewpoint { positions, lens_radius, cone: [start.into(), growth.into()] }
    }

    /// Minimum footprint width in the bounding box of points, metres.
    fn width(&self, points: impl IntoIterator<Item = DVec3>) -> f64 {
        let empty = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] = points.into_iter().fold(empty, |[low, high], p| [low.min(p), high.max(p)]);
        let distance = |eye: &DVec3| (low - *eye).max(*eye - high).max(DVec3::ZERO).length();
        let nearest = self.positions.iter().map(distance).fold(f64::INFINITY, f64::min);
        self.cone[0] + self.cone[1] * (nearest - self.lens_radius).max(0.0)
    }

    /// The smallest footprint on a part of an instance.
    fn part(&self, mesh: &Mesh, part: &MeshPart, instance: &Instance) -> Footprint {
        if matches!(instance.motion, Motion::Keyed(_)) {
            return Footprint::ZERO;
        }
        let world: &DAffine3 = &instance.world_from_object;
        let triangles = &mesh.triangles[part.triangles()];
        let mut footprint = Footprint { is_used: true, ..Footprint::UNUSED };
        for triangle in triangles {
            let corners = mesh.corners_f64(*triangle).map(|p| world.transform_point3(p));
            let width = self.width(corners);
            let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            footprint.width = footprint.width.min(width as f32);
            for (set, smallest) in mesh.uv_sets.iter().zip(&mut footprint.uv_widths) {
                let Some([a, b, c]) = corners_of(set, triangle) else { continue };
                let density = (f64::from((b - a).perp_dot(c - a)).abs() / area).sqrt();
                // Constant texture coordinates read a single texel.
                if density > 0.0 {
                    *smallest = smallest.min((width * density) as f32);
                }
            }
        }
        footprint
    }
}

fn corners_of(set: &[[f32; 2]], triangle: &[u32; 3]) -> Option<[Vec2; 3]> {
    let at = |i: u32| set.get(i as usize).copied().map(Vec2::from_array);
    let [a, b, c] = triangle.map(at);
    Some([a?, b?, c?])
}
