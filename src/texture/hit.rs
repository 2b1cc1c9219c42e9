//! Inputs of node graphs at a hit beyond those of other textures: named vertex attributes, the object and its transform, the
//! camera, the path.
//!
//! Texture coordinates: UV sets with affine maps, world space, triplanar projection, and ray footprints.

use super::ray_queries::RayOrigin;
use crate::math::{DAffine3, DMat4, DVec3, Mat3, Vec2, Vec3};
use crate::sampling::hash::mix64;
use crate::scene::{Curves, Instance, Mapping, Mesh, ObjectInfo, Quad, Shape, TextureId, TextureTransform};

/// An attribute of all vertices; NaN at vertices of meshes without it.
#[derive(Clone, Debug, Default)]
pub struct AttributeList {
    /// Components per vertex: 1 to 4 if all meshes have the same number, else [`CANONICAL`].
    stride: usize,
    values: Vec<f32>,
}

/// Number of components of an attribute in canonical form: red, green, blue, alpha, factor.
const CANONICAL: usize = 5;

/// An attribute at a point, with the type conversions of Cycles: a scalar becomes a vector of three equal components; a 2D vector gets z = 0
/// and becomes the scalar x; 3D vectors and colours become the scalar mean of their components.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AttributeValue {
    /// Value as a vector or linear RGB colour.
    pub vector: [f32; 3],
    /// Alpha of a colour; 1 for attributes without alpha.
    pub alpha: f32,
    /// Value as a scalar.
    pub factor: f32,
}

impl AttributeValue {
    fn of(components: &[f32]) -> AttributeValue {
        let mean = |[x, y, z]: [f32; 3]| (x + y + z) / 3.0;
        match *components {
            [x] => AttributeValue { vector: [x; 3], alpha: 1.0, factor: x },
            [x, y] => AttributeValue { vector: [x, y, 0.0], alpha: 1.0, factor: x },
            [x, y, z] => AttributeValue { vector: [x, y, z], alpha: 1.0, factor: mean([x, y, z]) },
            [x, y, z, alpha] => AttributeValue { vector: [x, y, z], alpha, factor: mean([x, y, z]) },
            [x, y, z, alpha, factor] => AttributeValue { vector: [x, y, z], alpha, factor },
            _ => AttributeValue::default(),
        }
    }

    fn components(self) -> [f32; CANONICAL] {
        let [x, y, z] = self.vector;
        [x, y, z, self.alpha, self.factor]
    }
}

impl AttributeList {
    /// Appends the values of a mesh, given with their number of components per vertex, after `before` vertices; fills the list with NaN
    /// up to `total` vertices.
    pub fn append(&mut self, attribute: Option<(usize, &[f32])>, before: usize, total: usize) {
        match attribute {
            None if self.values.is_empty() => return,
            Some((width, _)) if self.values.is_empty() => self.stride = width,
            Some((width, _)) if self.stride != width => self.convert_to_canonical(),
            _ => {}
        }
        self.values.resize(before * self.stride, f32::NAN);
        match attribute {
            Some((width, values)) if width == self.stride => self.values.extend_from_slice(values),
            Some((width, values)) => {
                let canonical =
                    values.chunks_exact(width).map(|components| AttributeValue::of(components).components());
                self.values.extend(canonical.flatten());
            }
            None => {}
        }
        self.values.resize(total * self.stride, f32::NAN);
    }

    fn convert_to_canonical(&mut self) {
        if self.stride == CANONICAL {
            return;
        }
        let all = self.values.chunks_exact(self.stride).map(|components| match components[0].is_nan() {
            true => [f32::NAN; CANONICAL],
            false => AttributeValue::of(components).components(),
        });
        self.values = all.flatten().collect();
        self.stride = CANONICAL;
    }

    /// The value interpolated in a triangle with barycentric weights; `None` if its mesh lacks the attribute.
    pub fn at(&self, triangle: [u32; 3], weights: [f32; 3]) -> Option<AttributeValue> {
        let mut sum = [0.0; CANONICAL];
        for (vertex, weight) in triangle.into_iter().zip(weights) {
            let first = vertex as usize * self.stride;
            let components = self
                .values
                .get(first..first + self.stride)
                .filter(|components| !components.is_empty() && !components[0].is_nan())?;
            for (sum, value) in sum.iter_mut().zip(components) {
                *sum += weight * value;
            }
        }
        Some(AttributeValue::of(&sum[..self.stride]))
    }

    /// Size of the values in memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }
}

/// The attributes at a hit, by their indices in [`CompiledTextures::attributes`](super::CompiledTextures::attributes).
#[derive(Clone, Copy, Debug, Default)]
pub struct HitAttributes<'a> {
    /// All attributes, by vertex index of the hit mesh's space.
    pub lists: &'a [AttributeList],
    /// The vertex indices of the hit triangle, and the barycentric weights.
    pub triangle: Option<([u32; 3], [f32; 3])>,
}

impl HitAttributes<'_> {
    /// The value that Cycles takes for an attribute that a surface lacks.
    pub const MISSING: AttributeValue = AttributeValue { vector: [0.0; 3], alpha: 1.0, factor: 0.0 };

    /// The attribute with an index; `None` if the surface lacks it.
    pub fn get(&self, number: u16) -> Option<AttributeValue> {
        let (triangle, weights) = self.triangle?;
        self.lists.get(usize::from(number))?.at(triangle, weights)
    }

    /// The values at the triangle's vertices.
    pub fn corners(&self, number: u16) -> Option<[AttributeValue; 3]> {
        let (triangle, _) = self.triangle?;
        let list = self.lists.get(usize::from(number))?;
        let corner = |i: usize| list.at(triangle, std::array::from_fn(|k| f32::from(u8::from(i == k))));
        Some([corner(0)?, corner(1)?, corner(2)?])
    }
}

/// The results of a material's node graphs at a hit.
#[derive(Clone, Copy, Debug)]
pub struct GraphResults<'a> {
    /// The graphs.
    pub textures: &'a [TextureId],
    /// The unclamped result of each graph.
    pub values: &'a [[f32; 3]],
    /// Is the hit on a back face?
    pub is_back: bool,
}

impl GraphResults<'_> {
    /// The result of the texture with an index, if it is known.
    #[inline]
    pub fn get(&self, index: usize) -> Option<[f32; 3]> {
        let known = self.textures.iter().position(|texture| texture.index() == index)?;
        self.values.get(known).copied()
    }
}

/// Data of an object that shader nodes read.
#[derive(Clone, Copy, Debug)]
pub struct ObjectData {
    /// Transform from object space to the compiled scene's world space.
    pub world_from_object: DAffine3,
    /// Its inverse.
    pub object_from_world: DAffine3,
    /// Scale and offset per axis from object space to generated coordinates, which are 0..1 in the bounding box.
    pub generated: [Vec3; 2],
    /// Origin of the object in the original scene's world space, metres.
    pub location: Vec3,
    /// Object colour, linear RGBA.
    pub color: [f32; 4],
    /// Object index ("pass index" in Blender), set by the user.
    pub index: f32,
    /// A random number per object, 0..1.
    pub random: f32,
}

impl ObjectData {
    /// An object with its transform and its bounding box in object space; the world's origin moves to `anchor`.
    fn new(
        (name, info): (&str, &ObjectInfo),
        transform: DAffine3,
        [low, high]: [Vec3; 2],
        anchor: DVec3,
    ) -> ObjectData {
        let world_from_object = DAffine3 { translation: transform.translation - anchor, ..transform };
        let is_flat = transform.matrix3.determinant() == 0.0;
        ObjectData {
            world_from_object,
            object_from_world: if is_flat { DAffine3::IDENTITY } else { world_from_object.inverse() },
            location: transform.translation.as_vec3(),
            generated: ObjectData::generated(low, high),
            color: info.color,
            index: info.index,
            random: info.random.unwrap_or_else(|| random(name)),
        }
    }

    /// Data of an instance of a mesh with this bounding box in object space.
    pub fn of_instance(instance: &Instance, bounds: [Vec3; 2], anchor: DVec3) -> ObjectData {
        ObjectData::new((&instance.name, &instance.info), instance.world_from_object, bounds, anchor)
    }

    /// Data of a quad; its object space is world space relative to its corner.
    pub fn of_quad(quad: &Quad, anchor: DVec3) -> ObjectData {
        let size = (quad.edge_u + quad.edge_v).as_vec3();
        let bounds = [size.min(Vec3::ZERO), size.max(Vec3::ZERO)];
        ObjectData::new((&quad.name, &quad.info), DAffine3::from_translation(quad.corner), bounds, anchor)
    }

    /// Data of a shape; its object space is in metres, rotated with it and relative to its centre.
    pub fn of_shape(shape: &Shape, anchor: DVec3) -> ObjectData {
        let half = Vec3::splat(shape.radius as f32);
        let transform = DAffine3::from_rotation_translation(shape.rotation, shape.center);
        ObjectData::new((&shape.name, &shape.info), transform, [-half, half], anchor)
    }

    /// Data of a set of curves.
    pub fn of_curves(curves: &Curves, anchor: DVec3) -> ObjectData {
        let points = curves.points.iter().map(|&p| Vec3::from_array(p));
        ObjectData::new((&curves.name, &curves.info), curves.world_from_object, bounds(points), anchor)
    }

    /// Bounding box of a mesh in object space.
    pub fn bounds_of_mesh(mesh: &Mesh) -> [Vec3; 2] {
        bounds(mesh.positions.iter().map(|&p| Vec3::from_array(p)))
    }

    /// Scale and offset that map a box to 0..1.
    pub fn generated(low: Vec3, high: Vec3) -> [Vec3; 2] {
        // As in Blender: size 2 where the box is flat, and at least 2e-5 elsewhere.
        let factor = (high - low).to_array().map(|size| match size {
            0.0 => 0.5,
            size => 1.0 / size.max(2e-5),
        });
        let factor = Vec3::from_array(factor);
        [factor, Vec3::splat(0.5) - (low + high) * 0.5 * factor]
    }
}

fn bounds(points: impl Iterator<Item = Vec3>) -> [Vec3; 2] {
    let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let [low, high] = points.fold(nothing, |[low, high], p| [low.min(p), high.max(p)]);
    if low.cmple(high).all() { [low, high] } else { [Vec3::ZERO; 2] }
}

/// A random number in 0..1 from a hash of the name.
fn random(name: &str) -> f32 {
    let hash = name.bytes().fold(name.len() as u64, |hash, byte| mix64(hash ^ u64::from(byte)));
    (hash >> 40) as f32 / (1u64 << 24) as f32
}

/// The data of a camera that shader nodes read.
#[derive(Clone, Copy, Debug)]
pub struct CameraData<'a> {
    /// From the original scene's world space to camera space: x to the right, y up, looking along -z.
    pub camera_from_world: &'a DMat4,
    /// From the original scene's world space to image coordinates 0..1, y downwards; `None` for panoramas.
    pub ndc_from_world: Option<&'a DMat4>,
}

/// Properties of the path that arrives at a hit.
#[derive(Clone, Copy, Debug, Default)]
pub struct PathData {
    /// Flags of the ray type, each 0 or 1: camera, shadow, diffuse, glossy, singular, reflection, transmission, volume scatter.
    pub kinds: [f32; 8],
    /// Length of the ray, metres.
    pub length: f32,
    /// Number of bounces before this hit.
    pub depth: f32,
}

/// Data of a curve strand at a hit.
#[derive(Clone, Copy, Debug, Default)]
pub struct StrandData {
    /// Position along the strand: 0 at the root, 1 at the tip.
    pub intercept: f32,
    /// Length of the strand, metres.
    pub length: f32,
    /// Diameter of the strand, metres.
    pub thickness: f32,
    /// Unit direction towards the tip, world space.
    pub tangent: Vec3,
    /// A random number per strand, 0..1.
    pub random: f32,
}

/// All data of a hit that node graphs read.
#[derive(Clone, Copy, Debug)]
pub struct HitData<'a> {
    /// Named attributes.
    pub attributes: HitAttributes<'a>,
    /// The object that was hit.
    pub object: &'a ObjectData,
    pub camera: CameraData<'a>,
    /// Hit point in object space.
    pub object_point: Vec3,
    /// Shading normal on the viewer's side, unit length, world space.
    pub shading_normal: Vec3,
    /// Geometric normal on the viewer's side, unit length, world space.
    pub true_normal: Vec3,
    /// Direction towards the viewer, unit length, world space.
    pub incoming: Vec3,
    /// Is the hit on a back face?
    pub is_back: bool,
    /// Barycentric weights of a triangle's first and second vertex.
    pub parametric: [f32; 2],
    /// Vertices of the triangle in the compiled scene's world space, metres.
    pub corners: Option<[Vec3; 3]>,
    /// Hit point in the compiled scene's world space, metres.
    pub point: Vec3,
    /// The first UV set at the triangle's vertices, v downwards; `None` where UVs are not interpolated from vertices.
    pub corner_uv: Option<[Vec2; 3]>,
    /// Tangent, bitangent and normal of the first UV set, world space.
    pub tangent_frame: Option<Mat3>,
    /// Material index ("pass index" in Blender), set by the user.
    pub material_index: f32,
    pub path: PathData,
    /// The strand, if a curve was hit.
    pub strand: Option<StrandData>,
    /// Where rays of nodes start; `None` where none are traced.
    pub rays: Option<RayOrigin<'a>>,
}

/// Finite-difference step where the ray has no footprint, metres.
const MIN_STEP: f32 = 1e-4;

impl<'a> HitData<'a> {
    /// Two finite-difference steps along the surface, world space, metres: as long as a pixel's width there, twice [`TexturePoint::width`],
    /// and in the directions of Cycles, so that bumps finer than a pixel get the same slopes.
    pub fn steps(&self, point: &TexturePoint) -> [Vec3; 2] {
        let n = self.true_normal;
        // Diagonals of Blender's axes (z up).
        let along = Vec3::new(1.0, 1.0, -1.0).cross(n).try_normalize();
        let along = along.unwrap_or_else(|| Vec3::new(-1.0, 1.0, -1.0).cross(n).normalize_or_zero());
        let width = if point.width > 0.0 { 2.0 * point.width } else { MIN_STEP };
        [along * width, n.cross(along) * width]
    }

    /// The texture point and the hit moved by a step, world space, metres.
    pub fn moved(&self, point: &TexturePoint, step: Vec3) -> (TexturePoint, HitData<'a>) {
        let (mut point, mut hit) = (*point, *self);
        let linear = self.object.object_from_world.matrix3;
        hit.object_point += (linear * step.as_dvec3()).as_vec3();
        hit.point += step;
        point.world += step;
        if let Some(corners) = self.corners {
            let [u, v] = barycentric_step(corners, step);
            if let Some((_, weights)) = &mut hit.attributes.triangle {
                *weights = [weights[0] - u - v, weights[1] + u, weights[2] + v];
            }
            hit.parametric = [hit.parametric[0] - u - v, hit.parametric[1] + u];
            if let Some([a, b, c]) = self.corner_uv {
                point.uv[0] += (b - a) * u + (c - a) * v;
            }
        } else if let Some(frame) = self.tangent_frame {
            let along = Vec2::new(step.dot(frame.x_axis), -step.dot(frame.y_axis));
            point.uv[0] += along * point.uv_per_metre[0];
        }
        (point, hit)
    }
}

/// Change of the second and third barycentric weight over a step in the triangle's plane.
fn barycentric_step([a, b, c]: [Vec3; 3], step: Vec3) -> [f32; 2] {
    let (e1, e2) = (b - a, c - a);
    let normal = e1.cross(e2);
    let scale = 1.0 / normal.length_squared();
    let weights = [step.cross(e2).dot(normal) * scale, e1.cross(step).dot(normal) * scale];
    weights.map(|w| if w.is_finite() { w } else { 0.0 })
}

/// The inputs of texture lookups at a surface point.
#[derive(Clone, Copy, Debug, Default)]
pub struct TexturePoint {
    /// The first two UV sets.
    pub uv: [Vec2; 2],
    /// The point in the scene's world space, metres.
    pub world: Vec3,
    /// Unit geometric normal in world space.
    pub normal: Vec3,
    /// Absolute cosine between the shading normal, before normal maps, and the direction towards the viewer.
    pub cosine: f32,
    /// Width of the ray footprint, metres; 0 for a point lookup.
    pub width: f32,
    /// Change of each UV set per metre along the surface.
    pub uv_per_metre: [f32; 2],
}

/// An affine map of the coordinates of a UV set.
#[derive(Clone, Copy, Debug)]
pub(super) struct UvMap {
    set: usize,
    x: Vec2,
    y: Vec2,
    offset: Vec2,
    /// Factor by which the map widens footprints.
    scale: f32,
}

impl UvMap {
    pub fn new(set: u32, t: &TextureTransform) -> UvMap {
        // KHR_texture_transform: translation * rotation * scale, its rotation matrix being (cos sin; -sin cos), that
        // is counter-clockwise in an image whose v points down.
        let (s, c) = f64::from(t.rotation_rad).sin_cos();
        let (s, c) = (s as f32, c as f32);
        UvMap {
            set: (set as usize).min(1),
            x: Vec2::new(c * t.scale.x, s * t.scale.y),
            y: Vec2::new(-s * t.scale.x, c * t.scale.y),
            offset: t.offset,
            scale: (t.scale.x * t.scale.y).abs().sqrt(),
        }
    }

    #[inline(always)]
    pub fn apply(&self, point: &TexturePoint) -> Vec2 {
        let uv = point.uv[self.set];
        self.offset + Vec2::new(self.x.dot(uv), self.y.dot(uv))
    }

    /// A key that is equal for equal maps.
    pub fn bits(&self) -> [u32; 7] {
        let numbers =
            [self.x.x, self.x.y, self.y.x, self.y.y, self.offset.x, self.offset.y].map(f32::to_bits);
        let [a, b, c, d, e, f] = numbers;
        [self.set as u32, a, b, c, d, e, f]
    }

    #[inline(always)]
    pub fn footprint(&self, point: &TexturePoint) -> f32 {
        point.width * point.uv_per_metre[self.set] * self.scale
    }
}

/// A compiled [`Mapping`].
#[derive(Clone, Copy, Debug)]
pub(super) enum TextureCoordinates {
    Uv(UvMap),
    World,
    /// With the reciprocal of the size, 1/metres.
    Triplanar(f32),
}

impl TextureCoordinates {
    pub fn new(mapping: &Mapping) -> TextureCoordinates {
        match mapping {
            Mapping::Uv { set, transform } => TextureCoordinates::Uv(UvMap::new(*set, transform)),
            Mapping::World => TextureCoordinates::World,
            Mapping::Triplanar { size } => TextureCoordinates::Triplanar(1.0 / size),
        }
    }
}

/// Texture coordinates and weights, which add up to 1, of the three projections along the world's axes. Seen from
/// outside, images are upright on walls and not mirrored; on floors their top points towards -z.
#[inline]
pub(super) fn triplanar(point: &TexturePoint, inverse_size: f32) -> [(Vec2, f32); 3] {
    let (p, n) = (point.world * inverse_size, point.normal);
    let side = |c: f32| if c < 0.0 { -1.0f32 } else { 1.0 };
    let weights = n * n * n * n;
    let sum = weights.element_sum();
    let weights = if sum > 0.0 { weights / sum } else { Vec3::splat(1.0 / 3.0) };
    [
        (Vec2::new(-p.z * side(n.x), -p.y), weights.x),
        (Vec2::new(p.x, p.z * side(n.y)), weights.y),
        (Vec2::new(p.x * side(n.z), -p.y), weights.z),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_of_mixed_widths_convert_as_each_width_does_alone() {
        let pair = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let colors = [0.1, 0.2, 0.3, 0.4].repeat(3);
        let (mut alone, mut mixed) = (AttributeList::default(), AttributeList::default());
        alone.append(Some((2, &pair)), 0, 3);
        mixed.append(Some((2, &pair)), 0, 3);
        mixed.append(None, 3, 6);
        mixed.append(Some((4, &colors)), 6, 9);
        let weights = [0.25, 0.25, 0.5];
        let expected = AttributeValue { vector: [3.5, 4.5, 0.0], alpha: 1.0, factor: 3.5 };
        assert_eq!(alone.at([0, 1, 2], weights), Some(expected));
        assert_eq!(mixed.at([0, 1, 2], weights), Some(expected));
        assert_eq!(mixed.at([3, 4, 5], weights), None);
        assert_eq!(AttributeList::default().at([0, 1, 2], weights), None);
        let color = mixed.at([6, 7, 8], weights).expect("the third mesh has it");
        assert!((color.alpha - 0.4).abs() < 1e-6 && (color.factor - 0.2).abs() < 1e-6);
    }

    #[test]
    fn transforms_scale_then_rotate_then_move() {
        let transform = TextureTransform {
            offset: Vec2::new(0.25, 0.5),
            rotation_rad: std::f32::consts::FRAC_PI_2,
            scale: Vec2::new(2.0, 3.0),
        };
        let uv = [Vec2::ZERO, Vec2::new(0.1, 0.2)];
        let point = TexturePoint { uv, width: 0.1, uv_per_metre: [0.0, 2.0], ..TexturePoint::default() };
        // scale (0.2, 0.6); the extension's matrix for 90 degrees: (x, y) -> (y, -x); offset.
        let map = UvMap::new(1, &transform);
        let found = map.apply(&point);
        assert!((found - Vec2::new(0.85, 0.3)).length() < 1e-6, "{found}");
        assert!((map.footprint(&point) - 0.2 * 6.0f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn projections_are_upright_from_outside() {
        let at = |normal: Vec3, world: Vec3| {
            let point = TexturePoint { normal, world, ..TexturePoint::default() };
            triplanar(&point, 0.5)
        };
        for axis in [Vec3::X, Vec3::Z] {
            for normal in [axis, -axis] {
                // To the right as seen by someone who looks at the wall from outside, and up.
                let right = Vec3::Y.cross(normal);
                let [here, there, above] = [Vec3::ZERO, right, Vec3::Y].map(|p| {
                    at(normal, p).into_iter().find(|(_, w)| *w == 1.0).expect("one projection alone").0
                });
                assert_eq!(there - here, Vec2::new(0.5, 0.0), "{normal}");
                assert_eq!(above - here, Vec2::new(0.0, -0.5), "{normal}");
            }
        }
        let slanted = at(Vec3::new(0.6, 0.0, 0.8), Vec3::ZERO);
        let sum: f32 = slanted.iter().map(|s| s.1).sum();
        assert!((sum - 1.0).abs() < 1e-6 && slanted[2].1 > 0.7, "{slanted:?}");
    }
}
