//! Bodies that refract the light of small lights so that light samples can't reach through them: frosted glass, water with waves, single
//! sheets of glass. See `integrator::refracted_lights`.

use super::material::CompiledMaterial;
use super::objects;
use crate::bsdf::BsdfClass;
use crate::light::{Lights, SmallLight};
use crate::math::{Bounds3, DMat3, DVec3, Vec3};
use crate::scene::{Instance, Mesh, Scene};
use crate::texture::CompiledTextures;

/// Maximum number of bodies.
const MAX_BODIES: usize = 64;

/// Maximum number of sides of a body.
const MAX_SIDES: usize = 6;

/// Minimum cosine between the normals of triangles of the same side.
const SIDE_COSINE: f64 = 0.75;

/// Minimum share of a body's area in a side.
const MIN_SHARE: f64 = 0.08;

/// Maximum root mean square of the angles between the normals of a side and their mean, radians.
const MAX_SPREAD: f64 = 0.25;

/// So many triangles show whether a body is round.
const PROBES: usize = 64;

/// Margin of boxes, relative to their size.
const MARGIN: f32 = 0.01;

/// Small bright lights and the bodies that refract their light.
#[derive(Clone, Debug, Default)]
pub struct RefractedLights {
    /// The lights.
    pub lights: Vec<SmallLight>,
    /// The bodies.
    pub bodies: Vec<Refractor>,
    /// Do some refract light to points outside of all solids?
    pub from_outside: bool,
}

/// A body that refracts light.
#[derive(Clone, Debug)]
pub struct Refractor {
    /// It lies within.
    pub bounds: Bounds3,
    /// What fills it; 0 for an open sheet.
    pub medium: u16,
    /// Its facets spread light.
    pub is_rough: bool,
    /// Index of refraction.
    pub ior: f32,
    /// Its sides that are flat but for waves.
    pub sides: Vec<Side>,
}

/// A side of a body.
#[derive(Clone, Copy, Debug)]
pub struct Side {
    /// Mean normal.
    pub normal: Vec3,
    /// Root mean square of the angles to it, radians.
    pub spread: f32,
}

impl RefractedLights {
    /// None, if there are no such bodies or no such lights.
    pub(super) fn find(
        scene: &Scene,
        materials: &[CompiledMaterial],
        anchor: DVec3,
        (lights, textures): (&Lights, &CompiledTextures),
    ) -> RefractedLights {
        if !materials.iter().any(|material| material.face_of_refractor().is_some()) {
            return RefractedLights::default();
        }
        let lights = lights.small_lights(textures);
        let mut bodies = Vec::new();
        for instance in scene.instances.iter().filter(|_| !lights.is_empty()) {
            let mesh = &scene.meshes[instance.mesh.index()];
            for (part, material) in mesh.parts.iter().zip(objects::part_materials(mesh, instance)) {
                let first = part.first_triangle as usize;
                let triangles = mesh.triangles.get(first..first + part.triangle_count as usize);
                let place = Place { mesh, instance, anchor };
                bodies.extend(triangles.and_then(|list| place.body(list, &materials[material.index()])));
            }
        }
        for quad in &scene.quads {
            let corner = quad.corner - anchor;
            let corners = [DVec3::ZERO, quad.edge_u, quad.edge_v, quad.edge_u + quad.edge_v];
            let bounds = Bounds3::of(corners.map(|edge| (corner + edge).as_vec3()));
            let face = Face::new(quad.edge_u.cross(quad.edge_v));
            bodies.extend(body(bounds, sides_of(&[face]), &materials[quad.material.index()]));
        }
        // Where there are so many, most rays would be tested in vain.
        match bodies.is_empty() || bodies.len() > MAX_BODIES {
            true => RefractedLights::default(),
            false => {
                let from_outside = bodies.iter().any(|body| body.is_rough || body.medium == 0);
                RefractedLights { lights, bodies, from_outside }
            }
        }
    }

    /// Are there none?
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }
}

impl CompiledMaterial {
    /// Index of refraction and GGX alpha, if it is glass or water that bends light.
    pub fn face_of_refractor(&self) -> Option<(f32, f32)> {
        let is_glass = matches!(self.class, BsdfClass::Dielectric | BsdfClass::RoughDielectric);
        let is_plain = is_glass
            && !self.is_boundary
            && self.alpha.is_none()
            && self.emission.is_none()
            && self.components.is_empty();
        self.alike().filter(|_| is_plain).and_then(|bsdf| bsdf.solid_face())
    }
}

/// A body, if its material and its form are those of one.
fn body(bounds: Bounds3, sides: Vec<Side>, material: &CompiledMaterial) -> Option<Refractor> {
    let (ior, alpha) = material.face_of_refractor()?;
    let margin = Vec3::splat(MARGIN * bounds.extent().length());
    let bounds = Bounds3 { min: bounds.min - margin, max: bounds.max + margin };
    let (medium, is_rough) = (material.medium_index, alpha > 0.0);
    // Lobes from outside of solids are for frosted ones.
    (is_rough || !sides.is_empty()).then_some(Refractor { bounds, medium, is_rough, ior, sides })
}

/// Where a mesh is.
struct Place<'a> {
    mesh: &'a Mesh,
    instance: &'a Instance,
    anchor: DVec3,
}

impl Place<'_> {
    fn body(&self, triangles: &[[u32; 3]], material: &CompiledMaterial) -> Option<Refractor> {
        let (_, alpha) = material.face_of_refractor()?;
        // Most smooth bodies are round, which few of their triangles show.
        let step = triangles.len().div_ceil(PROBES).max(1);
        let few: Vec<Face> = triangles.iter().step_by(step).map(|triangle| self.face(triangle)).collect();
        if alpha <= 0.0 && sides_of(&few).is_empty() {
            return None;
        }
        let place = &self.instance.world_from_object;
        let corners = triangles.iter().flat_map(|triangle| self.mesh.corners_f64(*triangle));
        let bounds = Bounds3::of(corners.map(|p| (place.transform_point3(p) - self.anchor).as_vec3()));
        let faces: Vec<Face> = triangles.iter().map(|triangle| self.face(triangle)).collect();
        body(bounds, sides_of(&faces), material)
    }

    fn face(&self, triangle: &[u32; 3]) -> Face {
        let matrix: DMat3 = self.instance.world_from_object.matrix3;
        let [a, b, c] = self.mesh.corners_f64(*triangle);
        Face::new((matrix * (b - a)).cross(matrix * (c - a)) * matrix.determinant().signum())
    }
}

/// A triangle of a body.
struct Face {
    normal: DVec3,
    /// In proportion to its area.
    size: f64,
}

impl Face {
    fn new(area: DVec3) -> Face {
        Face { normal: area.normalize_or_zero(), size: area.length() }
    }
}

/// The sides of a body.
fn sides_of(faces: &[Face]) -> Vec<Side> {
    let mut normals: Vec<DVec3> = Vec::new();
    while normals.len() < MAX_SIDES {
        let rest = faces.iter().filter(|face| !normals.iter().any(|n| face.normal.dot(*n) >= SIDE_COSINE));
        let Some(largest) = rest.max_by(|a, b| a.size.total_cmp(&b.size)).filter(|face| face.size > 0.0)
        else {
            break;
        };
        let own = faces.iter().filter(|face| face.normal.dot(largest.normal) >= SIDE_COSINE);
        normals.push(own.map(|face| face.normal * face.size).sum::<DVec3>().normalize_or(largest.normal));
    }
    let total: f64 = faces.iter().map(|face| face.size).sum();
    let side = |normal: &DVec3| {
        let own = || faces.iter().filter(|face| face.normal.dot(*normal) >= SIDE_COSINE);
        let area: f64 = own().map(|face| face.size).sum();
        let squares = own().map(|face| (face.normal - *normal).length_squared() * face.size).sum::<f64>();
        let spread = (squares / area).sqrt();
        (area >= MIN_SHARE * total && spread <= MAX_SPREAD)
            .then(|| Side { normal: normal.as_vec3(), spread: spread as f32 })
    };
    normals.iter().filter_map(side).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sides(normals: impl IntoIterator<Item = DVec3>) -> Vec<Side> {
        sides_of(&normals.into_iter().map(Face::new).collect::<Vec<Face>>())
    }

    #[test]
    fn flat_and_wavy_sides_are_found_and_round_ones_are_not() {
        let of_box = sides([DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|n| [n, -n]));
        assert_eq!((of_box.len(), of_box[0].spread), (6, 0.0));
        let slope = |k: i32| DVec3::new(0.1 * f64::from(k % 3 - 1), 1.0, 0.0);
        let waves = sides((0..30).map(slope));
        assert_eq!(waves.len(), 1);
        assert!((waves[0].spread - 0.1 * (2.0f32 / 3.0).sqrt()).abs() < 2e-3, "{waves:?}");
        let around = |k: i32| {
            let (z, turn) = (2.0 * (f64::from(k) + 0.5) / 500.0 - 1.0, 2.399963 * f64::from(k));
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * turn.cos(), r * turn.sin(), z)
        };
        assert!(sides((0..500).map(around)).is_empty());
    }
}
