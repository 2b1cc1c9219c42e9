//! Meshes and their instances, parallelograms, analytic shapes and curves, and their motion.

use super::{MaterialId, MeshId, ObjectInfo, ObjectTraits};
use crate::math::{DAffine3, DQuat, DVec3};
pub use half::f16;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Triangles with one set of vertices, or Gaussian splats around them. Front faces are counter-clockwise.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// For reports.
    pub name: String,
    /// Vertex positions in object space.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of each triangle, all below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Unit shading normals, one a vertex; empty means flat shading.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinate sets, each empty or one a vertex; v grows downwards (glTF).
    pub uv_sets: Vec<Vec<[f32; 2]>>,
    /// Unit tangents with handedness, one a vertex; empty when there are none.
    pub tangents: Vec<[f32; 4]>,
    /// Linear RGBA vertex colours, one a vertex; empty when there are none.
    pub colors: Vec<[f32; 4]>,
    /// Attributes by name, which graphs of nodes read; the names differ.
    pub attributes: Vec<VertexAttribute>,
    /// Gaussian splats around the vertices, in place of triangles; the first part has their material.
    pub splats: Option<Arc<Splats>>,
    /// Runs of triangles with their materials, in order and covering all triangles.
    pub parts: Vec<MeshPart>,
}

/// A run of triangles with one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshPart {
    /// First triangle.
    pub first_triangle: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Their material.
    pub material: MaterialId,
}

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// For reports: the node's path.
    pub name: String,
    /// Which mesh.
    pub mesh: MeshId,
    /// Placement; may mirror, shear and scale. A mirroring one keeps front faces in front.
    pub world_from_object: DAffine3,
    /// Replaces all materials of the mesh.
    pub material: Option<MaterialId>,
    /// Its motion.
    pub motion: Motion,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
    /// The light group of its emission, in place of those of its materials; empty for the default group.
    pub light_group: Option<String>,
}

/// How an instance differs between the times of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// It does not.
    #[default]
    Still,
    /// It stands elsewhere.
    Moves,
    /// Its mesh is another, too.
    Deforms,
    /// It moves while the picture is taken, or its mesh changes then: the number of its motion in
    /// [`SceneMotion::instances`](super::SceneMotion::instances).
    Keyed(u32),
}

/// A parallelogram in world space; its front is on the side of `edge_u x edge_v`.
#[derive(Clone, Debug)]
pub struct Quad {
    /// For reports.
    pub name: String,
    /// One corner.
    pub corner: DVec3,
    /// From the corner along u.
    pub edge_u: DVec3,
    /// From the corner along v.
    pub edge_v: DVec3,
    /// Its material.
    pub material: MaterialId,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
}

/// An analytic shape, in world space.
#[derive(Clone, Debug)]
pub struct Shape {
    /// For reports.
    pub name: String,
    /// Which shape it is.
    pub kind: ShapeKind,
    /// Its middle.
    pub center: DVec3,
    /// Radius, above 0.
    pub radius: f64,
    /// Turns the shape with its texture coordinates and object-space textures; the identity for most spheres.
    pub rotation: DQuat,
    /// Its material.
    pub material: MaterialId,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
}

/// Makes [`ShapeKind`] and [`ShapeTag`] of a table: each kind with the numbers that it needs beside a radius, what one
/// and many of it are called, whether it encloses anything, and half the size of the box around one of radius 1 by its
/// rotation.
macro_rules! kinds {
    ($(
        $(#[$about:meta])*
        $kind:ident $({ $($(#[$about_number:meta])* $number:ident),* $(,)? })?
        $one:literal $many:literal closed: $closed:literal half_extent: $half_extent:expr;
    )*) => {
        /// Kinds of shapes that are no meshes. Axes x, y and z are those before the shape is rotated.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum ShapeKind {
            $($(#[$about])* $kind $({ $($(#[$about_number])* $number: f64),* })?,)*
        }

        /// Which of the kinds of shapes, without its numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum ShapeTag {
            $($(#[$about])* $kind,)*
        }

        impl ShapeKind {
            /// Which kind it is.
            pub fn tag(&self) -> ShapeTag {
                match self {
                    $(ShapeKind::$kind { .. } => ShapeTag::$kind,)*
                }
            }

            /// Its parameters apart from the radius.
            pub fn numbers(&self) -> Vec<f64> {
                match *self {
                    $(ShapeKind::$kind $({ $($number),* })? => vec![$($($number),*)?],)*
                }
            }

            /// Half the size of the box around one of radius 1.
            #[allow(unused_variables)]
            fn half_extent(&self, rotation: DQuat) -> DVec3 {
                match *self {
                    $(ShapeKind::$kind $({ $($number),* })? => ($half_extent)(rotation),)*
                }
            }
        }

        impl ShapeTag {
            /// All of them; each is in the place that its number says.
            pub const ALL: &[ShapeTag] = &[$(ShapeTag::$kind),*];

            /// Name of one.
            pub fn name(self) -> &'static str {
                match self {
                    $(ShapeTag::$kind => $one,)*
                }
            }

            /// Name of several.
            pub fn plural(self) -> &'static str {
                match self {
                    $(ShapeTag::$kind => $many,)*
                }
            }

            /// Does it enclose anything?
            pub fn is_closed(self) -> bool {
                match self {
                    $(ShapeTag::$kind => $closed,)*
                }
            }
        }
    };
}

kinds! {
    /// A sphere. Textures go around the y axis.
    Sphere "sphere" "spheres" closed: true half_extent: |_| DVec3::ONE;
    /// A flat disk whose front faces z. Textures have x to the right and y up, and touch its edge.
    Disk "disk" "disks" closed: false half_extent: around_flat_disk;
    /// A disk that turns its front to the origin of each ray: a light with a soft falloff. It has no textures.
    FacingDisk "facing disk" "facing disks" closed: false half_extent: |_| DVec3::ONE;
    /// A sphere that each ray intersects once, from outside its near side and from inside its far one: a light that rays pass.
    Shell "shell" "shells" closed: false half_extent: |_| DVec3::ONE;
}

/// How far a flat disk of radius 1 reaches along each axis.
fn around_flat_disk(rotation: DQuat) -> DVec3 {
    let normal = rotation * DVec3::Z;
    (DVec3::ONE - normal * normal).max(DVec3::ZERO).map(f64::sqrt)
}

impl Shape {
    /// Half the size of the box around it.
    pub fn half_extent(&self) -> DVec3 {
        self.kind.half_extent(self.rotation) * self.radius
    }
}

/// How a strand runs between its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveBasis {
    /// Straight from point to point.
    Linear,
    /// Cubic Bezier curves end to end: every third point lies on the strand.
    Bezier,
    /// A uniform cubic B-spline that begins near its first and ends near its last point.
    BSpline,
    /// A cubic curve through all points.
    #[default]
    CatmullRom,
}

impl CurveBasis {
    /// All of them.
    pub const ALL: [CurveBasis; 4] =
        [CurveBasis::Linear, CurveBasis::Bezier, CurveBasis::BSpline, CurveBasis::CatmullRom];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            CurveBasis::Linear => "linear",
            CurveBasis::Bezier => "bezier",
            CurveBasis::BSpline => "bspline",
            CurveBasis::CatmullRom => "catmull-rom",
        }
    }

    /// The basis of a name.
    pub fn of_name(name: &str) -> Option<CurveBasis> {
        CurveBasis::ALL.into_iter().find(|basis| basis.name() == name)
    }

    /// May a strand have this number of points?
    pub fn takes(self, points: usize) -> bool {
        match self {
            CurveBasis::Linear | CurveBasis::CatmullRom => points >= 2,
            CurveBasis::Bezier => points >= 4 && points % 3 == 1,
            CurveBasis::BSpline => points >= 4,
        }
    }

    /// The requirement of [`CurveBasis::takes`], in words.
    pub fn asks_for(self) -> &'static str {
        match self {
            CurveBasis::Linear | CurveBasis::CatmullRom => "2 or more",
            CurveBasis::Bezier => "4, 7, 10, ...",
            CurveBasis::BSpline => "4 or more",
        }
    }
}

/// Strands of one material, placed in the world.
#[derive(Clone, Debug)]
pub struct Curves {
    /// For reports.
    pub name: String,
    /// How strands run between their points.
    pub basis: CurveBasis,
    /// How many points each strand has, one strand after the other.
    pub strands: Vec<u32>,
    /// The points of all strands, in object space.
    pub points: Vec<[f32; 3]>,
    /// The radius at each point, from 0 up; between points it runs as the strand does.
    pub radii: Vec<f32>,
    /// Linear colours by point, which the material's colour is multiplied with if it uses the colours of vertices; empty
    /// where there are none.
    pub colors: Vec<[f32; 3]>,
    /// Placement; radii grow with the cube root of its determinant.
    pub world_from_object: DAffine3,
    /// Their material.
    pub material: MaterialId,
    /// Ray visibility and other traits.
    pub traits: ObjectTraits,
    /// Properties for node graphs.
    pub info: ObjectInfo,
}

impl Curves {
    /// The factor that the placement scales radii by.
    pub fn radius_scale(&self) -> f64 {
        self.world_from_object.matrix3.determinant().abs().cbrt()
    }

    /// Hands each point to `each`, in world space, with its radius there.
    pub fn visit(&self, each: &mut dyn FnMut(DVec3, f64)) {
        let scale = self.radius_scale();
        for (point, radius) in self.points.iter().zip(&self.radii) {
            let point = DVec3::from(point.map(f64::from));
            each(self.world_from_object.transform_point3(point), f64::from(*radius) * scale);
        }
    }
}

// Named attributes of vertices, which graphs of nodes read.

/// Up to four numbers for each vertex of a mesh, by a name: further texture coordinates, colours, weights, vectors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VertexAttribute {
    /// By which nodes find it.
    pub name: String,
    /// Numbers a vertex, 1 to 4.
    pub width: u32,
    /// The numbers of all vertices, one vertex after the other.
    pub values: Vec<f32>,
}

impl VertexAttribute {
    /// Maximum number of values that a vertex may have.
    pub const MAX_WIDTH: u32 = 4;

    /// One without vertices.
    pub fn new(name: impl Into<String>, width: u32) -> VertexAttribute {
        VertexAttribute { name: name.into(), width, values: Vec::new() }
    }

    /// The numbers of a vertex.
    pub fn of(&self, vertex: usize) -> &[f32] {
        let width = self.width as usize;
        &self.values[vertex * width..(vertex + 1) * width]
    }

    /// Adds a vertex with the numbers of another.
    pub fn push_copy(&mut self, vertex: usize) {
        let width = self.width as usize;
        self.values.extend_from_within(vertex * width..(vertex + 1) * width);
    }

    /// Adds a vertex half way between two others.
    pub fn push_mean(&mut self, a: usize, b: usize) {
        let width = self.width as usize;
        for k in 0..width {
            self.values.push(0.5 * self.values[a * width + k] + 0.5 * self.values[b * width + k]);
        }
    }
}

// Gaussian splats, the primitives of radiance fields from photographs (Kerbl, Kopanas, Leimkuehler, Drettakis 2023, "3D Gaussian
// Splatting for Real-Time Radiance Field Rendering").

/// Gaussians around the vertices of a mesh, one a vertex. With `c` the vertex, `R` the rotation and `S` the diagonal matrix of
/// scales, a splat's opacity at the point `p` is `opacity exp(-|S^-1 R^T (p - c)|^2 / 2)`. Rays see it by its largest opacity
/// along them, and it emits the radiance that its coefficients give for their direction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Standard deviations along the splat's axes, in object space, above 0.
    pub scales: Vec<[f32; 3]>,
    /// Unit quaternions (x, y, z, w) that turn its axes to object space.
    pub rotations: Vec<[f32; 4]>,
    /// Opacities of the middles, 0 to 1.
    pub opacities: Vec<f32>,
    /// Degree of the spherical harmonics, 0 to [`Splats::MAX_DEGREE`].
    pub degree: u8,
    /// Coefficients of the real spherical harmonics, by splat: [`Splats::coefficients_of`] its degree, in the order l, then m = -l to
    /// l. Their relative error is at most 2^-11: of a colour channel near 1 less than a tenth of a step of 8 bits.
    pub coefficients: Vec<[f16; 3]>,
    /// The value of the coefficients, plus 0.5, is linear; otherwise encoded as sRGB, as photographs are.
    pub is_linear: bool,
}

impl Splats {
    /// The spherical harmonic of degree 0: half the root of 1 / pi. Times the first coefficient it is the colour less 0.5.
    pub const FIRST_HARMONIC: f32 = 0.282_094_8;

    /// The highest degree of spherical harmonics.
    pub const MAX_DEGREE: u8 = 3;

    /// The opacity below which a splat is nothing, where its surface ends: 1/255, with which the splats of the paper are optimised.
    /// The outermost 1 / (255 opacity) of its projection are cut off: 0.4 % where it is opaque.
    pub const MIN_OPACITY: f32 = 1.0 / 255.0;

    /// Coefficients of a splat, for a degree of spherical harmonics.
    pub fn coefficients_of(degree: u8) -> usize {
        (usize::from(degree) + 1).pow(2)
    }

    /// The degree with this number of coefficients.
    pub fn degree_of(coefficients: usize) -> Option<u8> {
        (0..=Splats::MAX_DEGREE).find(|&degree| Splats::coefficients_of(degree) == coefficients)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.opacities.len()
    }

    /// Is there none?
    pub fn is_empty(&self) -> bool {
        self.opacities.is_empty()
    }
}

// Motion: keys of transforms and vertices over the shutter interval.

/// Keys of a quantity that changes while the shutter is open.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframes<T> {
    /// Values at equal steps from the opening of the shutter to its closing, interpolated linearly in between. Fewer
    /// than two: it stands still then.
    pub keys: Vec<T>,
    /// Values a frame before and a frame after the picture's time; for motion vectors.
    pub neighbours: Option<[T; 2]>,
}

impl<T> Keyframes<T> {
    /// Does it change while the shutter is open, so that there is motion blur?
    pub fn blurs(&self) -> bool {
        self.keys.len() > 1
    }

    /// All that is known of other times.
    pub fn all(&self) -> impl Iterator<Item = &T> {
        self.keys.iter().chain(self.neighbours.iter().flatten())
    }

    /// Maps the value at each time.
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
    /// As [`Mesh::positions`](Mesh::positions), as many.
    pub positions: Vec<[f32; 3]>,
    /// As [`Mesh::normals`](Mesh::normals), as many.
    pub normals: Vec<[f32; 3]>,
}

/// Motion of objects during the exposure. For cameras and lights without a surface it has positions:
/// [`Camera::motion`](super::Camera::motion), [`Light::motion`](super::Light::motion).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMotion {
    /// Transforms of instances, by the number in [`Motion::Keyed`](Motion::Keyed): `world_from_object`.
    pub instances: Vec<Keyframes<DAffine3>>,
    /// Vertices of meshes that change their shape, by index.
    pub meshes: BTreeMap<usize, Keyframes<Vertices>>,
    /// Transforms of quads, by index: from their place in the scene's list to where they are then.
    pub quads: BTreeMap<usize, Keyframes<DAffine3>>,
    /// Transforms of shapes, likewise. (Emissive spheres stay round: their centre moves, and their volume scales.)
    pub shapes: BTreeMap<usize, Keyframes<DAffine3>>,
}
