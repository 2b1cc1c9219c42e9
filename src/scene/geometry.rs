//! Meshes and their instances, parallelograms, analytic shapes and curves, and their motion.

use super::{MaterialId, MeshId, ObjectInfo, ObjectTraits};
use crate::math::{DAffine3, DQuat, DVec3};
pub use half::f16;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// An indexed triangle mesh, or Gaussian splats at its vertices. Front faces are counter-clockwise.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name, for reports.
    pub name: String,
    /// Vertex positions in object space.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of each triangle, all below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Unit shading normals per vertex; empty for flat shading.
    pub normals: Vec<[f32; 3]>,
    /// UV sets per vertex, each may be empty; v points down (glTF).
    pub uv_sets: Vec<Vec<[f32; 2]>>,
    /// Unit tangents with handedness per vertex, or empty.
    pub tangents: Vec<[f32; 4]>,
    /// Linear RGBA colours per vertex, or empty.
    pub colors: Vec<[f32; 4]>,
    /// Named attributes for node graphs; names are unique.
    pub attributes: Vec<VertexAttribute>,
    /// Gaussian splats at the vertices, in place of triangles; the first part has their material.
    pub splats: Option<Arc<Splats>>,
    /// Runs of triangles with one material, consecutive and covering all triangles.
    pub parts: Vec<MeshPart>,
}

/// A run of triangles with one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshPart {
    /// First triangle.
    pub first_triangle: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Material.
    pub material: MaterialId,
}

impl MeshPart {
    /// The indices of its triangles.
    pub fn triangles(&self) -> Range<usize> {
        let first = self.first_triangle as usize;
        first..first + self.triangle_count as usize
    }
}

/// An instance of a mesh.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name, for reports: the node's path.
    pub name: String,
    /// Mesh.
    pub mesh: MeshId,
    /// May mirror, shear and scale. Mirroring transforms keep the front side.
    pub world_from_object: DAffine3,
    /// Overrides all materials of the mesh.
    pub material: Option<MaterialId>,
    /// Motion during the exposure.
    pub motion: Motion,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
    /// Light group of its emission, overriding those of its materials; empty for the default group.
    pub light_group: Option<String>,
}

/// Motion of an instance over time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// Static.
    #[default]
    Still,
    /// Its transform changes.
    Moves,
    /// Its mesh deforms, and its transform may change.
    Deforms,
    /// It moves or deforms while the shutter is open: index into [`SceneMotion::instances`](super::SceneMotion::instances).
    Keyed(u32),
}

/// A parallelogram in world space, metres; its front is on the side of `edge_u x edge_v`.
#[derive(Clone, Debug)]
pub struct Quad {
    /// Name, for reports.
    pub name: String,
    /// Origin of texture coordinates.
    pub corner: DVec3,
    /// From the corner along u.
    pub edge_u: DVec3,
    /// From the corner along v.
    pub edge_v: DVec3,
    /// Material.
    pub material: MaterialId,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
}

/// An analytic shape in world space, metres.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Name, for reports.
    pub name: String,
    /// Kind.
    pub kind: ShapeKind,
    /// Centre, metres.
    pub center: DVec3,
    /// Radius, above 0.
    pub radius: f64,
    /// Rotation of the shape, its texture coordinates and object-space textures.
    pub rotation: DQuat,
    /// Material.
    pub material: MaterialId,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
}

named_enum! {
    /// Kinds of analytic shapes. Axes are in the local space of the shape.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[non_exhaustive]
    ShapeKind {
        /// A sphere, textured around the y axis.
        Sphere = "sphere",
        /// A flat disk whose front faces z. Its texture is the square around it, x to the right and y up.
        Disk = "disk",
        /// A disk that always faces the origin of the ray: a light with a soft falloff. Not textured.
        FacingDisk = "facing disk",
        /// A sphere that each ray intersects at most once: from outside on its near side, from inside on its far side. For lights
        /// that rays pass through.
        Shell = "shell",
    }
}

impl ShapeKind {
    /// Whether it encloses a volume.
    pub fn is_closed(self) -> bool {
        self == ShapeKind::Sphere
    }
}

/// Half the size of the bounding box of a flat disk of radius 1.
fn disk_half_extent(rotation: DQuat) -> DVec3 {
    let normal = rotation * DVec3::Z;
    (DVec3::ONE - normal * normal).max(DVec3::ZERO).map(f64::sqrt)
}

impl Shape {
    /// Half the size of the bounding box, metres.
    pub fn half_extent(&self) -> DVec3 {
        match self.kind {
            ShapeKind::Disk => disk_half_extent(self.rotation) * self.radius,
            _ => DVec3::splat(self.radius),
        }
    }
}

named_enum! {
    /// Basis of curves.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    CurveBasis {
        /// Piecewise linear.
        Linear = "linear",
        /// Consecutive cubic Bezier curves: every third point is interpolated.
        Bezier = "bezier",
        /// A uniform cubic B-spline, not clamped: its ends are near the first and the last point.
        BSpline = "bspline",
        /// A cubic Catmull-Rom spline, which interpolates all points.
        #[default]
        CatmullRom = "catmull-rom",
    }
}

impl CurveBasis {
    /// Whether a strand may have this number of points.
    pub fn accepts(self, points: usize) -> bool {
        match self {
            CurveBasis::Linear | CurveBasis::CatmullRom => points >= 2,
            CurveBasis::Bezier => points >= 4 && points % 3 == 1,
            CurveBasis::BSpline => points >= 4,
        }
    }

    /// The numbers of points for which [`CurveBasis::accepts`] holds, as text.
    pub fn requirement(self) -> &'static str {
        match self {
            CurveBasis::Linear | CurveBasis::CatmullRom => "2 or more",
            CurveBasis::Bezier => "4, 7, 10, ...",
            CurveBasis::BSpline => "4 or more",
        }
    }
}

/// Curves (strands) of one material.
#[derive(Clone, Debug)]
pub struct Curves {
    /// Name, for reports.
    pub name: String,
    /// Basis.
    pub basis: CurveBasis,
    /// Number of points of each strand.
    pub strands: Vec<u32>,
    /// The points of all strands, in object space.
    pub points: Vec<[f32; 3]>,
    /// Radius at each point, at least 0, interpolated by the basis.
    pub radii: Vec<f32>,
    /// Linear colours per point, vertex colours of the material; or empty.
    pub colors: Vec<[f32; 3]>,
    /// Radii scale with the cube root of the determinant.
    pub world_from_object: DAffine3,
    /// Material.
    pub material: MaterialId,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
}

impl Curves {
    /// Scale factor of radii.
    pub fn radius_scale(&self) -> f64 {
        self.world_from_object.matrix3.determinant().abs().cbrt()
    }

    /// Calls `each` with each point and its radius, in world space.
    pub fn visit(&self, each: &mut dyn FnMut(DVec3, f64)) {
        let scale = self.radius_scale();
        for (point, radius) in self.points.iter().zip(&self.radii) {
            let point = DVec3::from(point.map(f64::from));
            each(self.world_from_object.transform_point3(point), f64::from(*radius) * scale);
        }
    }
}

/// A named attribute for node graphs: up to four numbers per vertex, such as further UV sets, colours, weights, vectors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VertexAttribute {
    /// Name in node graphs.
    pub name: String,
    /// Number of values per vertex, 1 to 4.
    pub width: u32,
    /// The values of all vertices, vertex by vertex.
    pub values: Vec<f32>,
}

impl VertexAttribute {
    /// Maximum number of values per vertex.
    pub const MAX_WIDTH: u32 = 4;

    /// An attribute without vertices.
    pub fn new(name: impl Into<String>, width: u32) -> VertexAttribute {
        VertexAttribute { name: name.into(), width, values: Vec::new() }
    }

    /// The values of a vertex.
    pub fn of(&self, vertex: usize) -> &[f32] {
        let width = self.width as usize;
        &self.values[vertex * width..(vertex + 1) * width]
    }

    /// Adds a vertex with the values of another.
    pub fn push_copy(&mut self, vertex: usize) {
        let width = self.width as usize;
        self.values.extend_from_within(vertex * width..(vertex + 1) * width);
    }

    /// Adds a vertex with the mean of two others.
    pub fn push_mean(&mut self, a: usize, b: usize) {
        let width = self.width as usize;
        for k in 0..width {
            self.values.push(0.5 * self.values[a * width + k] + 0.5 * self.values[b * width + k]);
        }
    }
}

/// Gaussian splats (Kerbl, Kopanas, Leimkuehler, Drettakis 2023, "3D Gaussian Splatting for Real-Time Radiance Field
/// Rendering"), one per vertex of a mesh. With the vertex `c`, rotation `R` and diagonal matrix of scales `S`, the opacity at a
/// point `p` is `opacity exp(-|S^-1 R^T (p - c)|^2 / 2)`. The alpha for a ray is the maximum opacity along it, and the emitted
/// radiance is that of the spherical harmonics in its direction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Standard deviations along the splat's axes, in object space, above 0.
    pub scales: Vec<[f32; 3]>,
    /// Rotations from the splat's axes to object space: unit quaternions (x, y, z, w).
    pub rotations: Vec<[f32; 4]>,
    /// Opacities at the centres, 0 to 1.
    pub opacities: Vec<f32>,
    /// Degree of the spherical harmonics, 0 to [`Splats::MAX_DEGREE`].
    pub degree: u8,
    /// Coefficients of the real spherical harmonics, splat by splat ([`Splats::coefficients_of`] the degree), in the order of l,
    /// then m = -l to l. Their relative error is at most 2^-11, less than 1/10 of an 8-bit step for a channel near 1.
    pub coefficients: Vec<[f16; 3]>,
    /// Whether the sum of the spherical harmonics plus 0.5 is linear. Otherwise it is sRGB-encoded, as photographs are.
    pub is_linear: bool,
}

impl Splats {
    /// The spherical harmonic of degree 0, sqrt(1 / pi) / 2. Times the first coefficient it is the colour minus 0.5.
    pub const FIRST_HARMONIC: f32 = 0.282_094_8;

    /// The highest degree of spherical harmonics.
    pub const MAX_DEGREE: u8 = 3;

    /// Minimum opacity, which bounds a splat: 1/255, as in the optimisation of the paper. It cuts off the fraction
    /// 1 / (255 opacity) of the projection, 0.4 % for opaque splats.
    pub const MIN_OPACITY: f32 = 1.0 / 255.0;

    /// Number of coefficients of a splat, for a degree of spherical harmonics.
    pub fn coefficients_of(degree: u8) -> usize {
        (usize::from(degree) + 1).pow(2)
    }

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.opacities.len()
    }

    /// Whether there are no splats.
    pub fn is_empty(&self) -> bool {
        self.opacities.is_empty()
    }
}

/// Keys of a quantity that changes while the shutter is open.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframes<T> {
    /// Values at equal steps from shutter open to shutter close, interpolated linearly. Fewer than two mean no motion blur.
    pub keys: Vec<T>,
    /// Values a frame before and a frame after, for motion vectors.
    pub neighbours: Option<[T; 2]>,
}

impl<T> Keyframes<T> {
    /// Whether there is motion blur.
    pub fn blurs(&self) -> bool {
        self.keys.len() > 1
    }

    /// The values at all times.
    pub fn all(&self) -> impl Iterator<Item = &T> {
        self.keys.iter().chain(self.neighbours.iter().flatten())
    }

    /// Applies a function to the value at each time.
    pub fn map<U>(&self, of: impl Fn(&T) -> U) -> Keyframes<U> {
        Keyframes {
            keys: self.keys.iter().map(&of).collect(),
            neighbours: self.neighbours.as_ref().map(|neighbours| neighbours.each_ref().map(of)),
        }
    }
}

/// The vertices of a deforming mesh at one key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// As [`Mesh::positions`](Mesh::positions), of equal length.
    pub positions: Vec<[f32; 3]>,
    /// As [`Mesh::normals`](Mesh::normals), of equal length.
    pub normals: Vec<[f32; 3]>,
}

/// Motion of objects during the exposure. For cameras and lights without a surface see
/// [`Camera::motion`](super::Camera::motion), [`Light::motion`](super::Light::motion).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMotion {
    /// `world_from_object` of instances, by the index in [`Motion::Keyed`](Motion::Keyed).
    pub instances: Vec<Keyframes<DAffine3>>,
    /// Vertices of deforming meshes, by mesh index.
    pub meshes: BTreeMap<usize, Keyframes<Vertices>>,
    /// World-space transforms of quads relative to [`Scene::quads`](super::Scene::quads), by index.
    pub quads: BTreeMap<usize, Keyframes<DAffine3>>,
    /// World-space transforms of shapes relative to [`Scene::shapes`](super::Scene::shapes), by index. (Emissive spheres stay
    /// spheres: only their centre and volume change.)
    pub shapes: BTreeMap<usize, Keyframes<DAffine3>>,
}

impl SceneMotion {
    /// Adds the keys of an instance.
    pub(crate) fn add_instance(&mut self, keys: Keyframes<DAffine3>) -> Motion {
        self.instances.push(keys);
        Motion::Keyed(self.instances.len() as u32 - 1)
    }
}
