//! The data of a hit that node programs read.

use crate::math::{DVec3, Mat3, Vec2, Vec3};
use crate::scene::TextureId;
use crate::scene::nodes::Axis;
use crate::texture::{AttributeValue, HitAttributes, HitData, TexturePoint};

/// Data of a point or its hit that a program reads. Attributes are given by index, and world space is that of the graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The point, world space, metres.
    Position,
    /// Geometric normal on the viewer's side, world space.
    TrueNormal,
    /// Shading normal on the viewer's side, world space.
    Normal,
    /// Direction towards the viewer, world space.
    Incoming,
    /// Mirror direction of the direction towards the viewer, world space.
    Reflection,
    /// The first UV set, v upwards.
    Uv,
    /// Width of the ray footprint in the texture coordinates of an attribute, or of the first UV set.
    Footprint(u16),
    /// An attribute: red, green, blue, alpha, factor; 0, with alpha 1, if the surface lacks it.
    Attribute(u16),
    /// An attribute as texture coordinates; the first UV set if the surface lacks it.
    UvMap(u16),
    /// An attribute with generated coordinates; the position in the object's bounding box, 0..1, if the surface lacks it.
    Generated(u16),
    /// The point in object space.
    ObjectPoint,
    /// The shading normal in object space.
    ObjectNormal,
    /// The point in camera space, metres, z along the viewing axis.
    CameraPoint,
    /// Image coordinates of the point, 0..1, y upwards.
    Window,
    /// The object's location, red, green, blue, alpha, object index, material index, random number.
    Object,
    /// Tangent around an axis through the centre of the generated coordinates, which are given by an attribute.
    Radial(Axis, u16),
    /// Tangent of the first UV set, world space.
    UvTangent,
    /// Tangent, bitangent and normal of the UVs of an attribute or of the first UV set, and 1 if they exist.
    Frame(u16),
    /// Two finite-difference steps along the surface, world space, as long as the ray footprint is wide.
    Steps,
    /// Barycentric weights of the first two vertices of a triangle.
    Parametric,
    /// 1 on back faces.
    Backfacing,
    /// Absolute cosine between the viewing direction and the shading normal.
    Cosine,
    /// Flags of the ray type (8), length of the ray, number of bounces.
    Path,
    /// 1 on a strand, position along it, length, thickness, tangent, random number.
    Strand,
    /// Squared distance from the nearest edge of the triangle, square metres, and the width of a pixel, metres.
    Edge,
    /// Rows of the transform from world to object space.
    ObjectFromWorld,
    /// Rows of its inverse.
    WorldFromObject,
    /// Rows of the transform from world to camera space, with z along the viewing axis.
    CameraFromWorld,
    /// Rows of its inverse.
    WorldFromCamera,
    /// Linear RGBA of another texture.
    Texture(TextureId),
}

/// An attribute index that stands for the first UV set.
pub const FIRST_UV_SET: u16 = u16::MAX;

/// Values of a source, padded with zeros to the maximum number.
pub type SourceValues = [f32; 12];

/// Pads values with zeros.
fn padded<const N: usize>(values: [f32; N]) -> SourceValues {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

impl Source {
    /// Number of values.
    pub fn width(self) -> u32 {
        match self {
            Source::Cosine | Source::Backfacing | Source::Footprint(_) => 1,
            Source::Edge => 2,
            Source::Texture(_) => 4,
            Source::Attribute(_) => 5,
            Source::Strand => 8,
            Source::Steps => 6,
            Source::Object | Source::Path | Source::Frame(_) => 10,
            Source::ObjectFromWorld
            | Source::WorldFromObject
            | Source::CameraFromWorld
            | Source::WorldFromCamera => 12,
            _ => 3,
        }
    }

    /// Does it depend on the viewer or the incident path?
    pub fn depends_on_viewer(self) -> bool {
        !matches!(
            self,
            Source::Position
                | Source::Uv
                | Source::Footprint(_)
                | Source::Attribute(_)
                | Source::UvMap(_)
                | Source::Generated(_)
                | Source::ObjectPoint
                | Source::Object
                | Source::UvTangent
                | Source::Parametric
                | Source::ObjectFromWorld
                | Source::WorldFromObject
                | Source::Strand
                | Source::Texture(_)
        )
    }

    /// Is it evaluated at offsets along the surface for the derivatives of bump nodes?
    pub fn varies_along_surface(self) -> bool {
        matches!(
            self,
            Source::Position
                | Source::Uv
                | Source::Attribute(_)
                | Source::UvMap(_)
                | Source::Generated(_)
                | Source::ObjectPoint
                | Source::CameraPoint
                | Source::Window
                | Source::Parametric
                | Source::Texture(_)
        )
    }

    /// Does it read data beyond [`TexturePoint`]?
    pub fn reads_hit(self) -> bool {
        match self {
            Source::Footprint(attribute) => attribute != FIRST_UV_SET,
            Source::Position | Source::Uv | Source::Cosine | Source::Texture(_) => false,
            _ => true,
        }
    }

    /// Its values at a point; world-space vectors have z up, as in Blender, if `is_z_up`.
    pub fn read(
        self,
        point: &TexturePoint,
        hit: Option<&HitData<'_>>,
        is_z_up: bool,
        texture: impl Fn(TextureId) -> [f32; 4],
    ) -> SourceValues {
        let vector = |v: Vec3| padded(to_node_world(v, is_z_up).to_array());
        let (footprint, uv) = (|| footprint(point), || first_uv(point));
        let Some(hit) = hit else { return self.without_hit(point, is_z_up, texture) };
        match self {
            Source::Position => vector(point.world),
            Source::TrueNormal => vector(hit.true_normal),
            Source::Normal => vector(hit.shading_normal),
            Source::Incoming => vector(hit.incoming),
            Source::Reflection => {
                let (n, wo) = (hit.shading_normal, hit.incoming);
                vector(n * (2.0 * n.dot(wo)) - wo)
            }
            Source::Uv => uv(),
            Source::Footprint(attribute) => match uv_per_metre(hit, attribute) {
                Some(density) => padded([point.width * density]),
                None => footprint(),
            },
            Source::Attribute(attribute) => {
                let AttributeValue { vector: [x, y, z], alpha, factor } =
                    hit.attributes.get(attribute).unwrap_or(HitAttributes::MISSING);
                padded([x, y, z, alpha, factor])
            }
            Source::UvMap(index) => hit.attributes.get(index).map_or_else(uv, |value| padded(value.vector)),
            Source::Generated(attribute) => padded(generated(hit, attribute).to_array()),
            Source::ObjectPoint => padded(hit.object_point.to_array()),
            Source::ObjectNormal => padded(to_object_normal(hit, hit.shading_normal).to_array()),
            Source::CameraPoint => padded(camera_point(point, hit).to_array()),
            Source::Window => window(point, hit),
            Source::Object => object(hit, is_z_up),
            Source::Radial(axis, attribute) => vector(radial(hit, axis, attribute)),
            Source::UvTangent => vector(hit.tangent_frame.map_or(Vec3::ZERO, |own| tangent(hit, own.x_axis))),
            Source::Frame(attribute) => frame(hit, attribute, is_z_up),
            Source::Steps => steps(point, hit, is_z_up),
            Source::Parametric => padded(hit.parametric),
            Source::Backfacing => padded([f32::from(u8::from(hit.is_back))]),
            Source::Cosine => padded([point.cosine]),
            Source::Path => {
                let mut values = padded(hit.path.kinds);
                (values[8], values[9]) = (hit.path.length, hit.path.depth);
                values
            }
            Source::Strand => strand(hit, is_z_up),
            Source::Edge => padded([squared_distance_from_edge(hit), 2.0 * point.width]),
            Source::ObjectFromWorld
            | Source::WorldFromObject
            | Source::CameraFromWorld
            | Source::WorldFromCamera => self.transform(point, hit, is_z_up),
            Source::Texture(id) => padded(texture(id)),
        }
    }

    /// Its values at a point without hit data.
    fn without_hit(
        self,
        point: &TexturePoint,
        is_z_up: bool,
        texture: impl Fn(TextureId) -> [f32; 4],
    ) -> SourceValues {
        let vector = |v: Vec3| padded(to_node_world(v, is_z_up).to_array());
        match self {
            Source::Position => vector(point.world),
            Source::TrueNormal | Source::Normal => vector(point.normal),
            Source::Uv | Source::UvMap(_) => first_uv(point),
            Source::Footprint(_) => footprint(point),
            Source::Cosine => padded([point.cosine]),
            Source::Texture(id) => padded(texture(id)),
            _ => [0.0; 12],
        }
    }

    /// Rows of a transform between spaces.
    fn transform(self, point: &TexturePoint, hit: &HitData<'_>, is_z_up: bool) -> SourceValues {
        // From the original scene's world space to the compiled scene's.
        let scene_offset = (hit.point - point.world).as_dvec3();
        let transform_rows = |to: &dyn Fn(DVec3) -> DVec3| {
            let origin = to(DVec3::ZERO);
            let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| to(axis) - origin);
            let row = |i: usize| [columns[0][i], columns[1][i], columns[2][i], origin[i]];
            let [a, b, c] = [0, 1, 2].map(row);
            std::array::from_fn(|i| [a, b, c][i / 4][i % 4] as f32)
        };
        // From the graph's world space to the scene's, and back.
        let to_scene = |v: DVec3| if is_z_up { DVec3::new(v.x, v.z, -v.y) } else { v };
        let to_nodes = |v: DVec3| if is_z_up { DVec3::new(v.x, -v.z, v.y) } else { v };
        let flip = |v: DVec3| DVec3::new(v.x, v.y, -v.z);
        let camera = hit.camera.camera_from_world;
        match self {
            Source::ObjectFromWorld => {
                transform_rows(&|v| hit.object.object_from_world.transform_point3(to_scene(v) + scene_offset))
            }
            Source::WorldFromObject => {
                transform_rows(&|v| to_nodes(hit.object.world_from_object.transform_point3(v) - scene_offset))
            }
            Source::CameraFromWorld => transform_rows(&|v| flip(camera.transform_point3(to_scene(v)))),
            _ => transform_rows(&|v| to_nodes(camera.inverse().transform_point3(flip(v)))),
        }
    }
}

/// The first UV set, v upwards.
fn first_uv(point: &TexturePoint) -> SourceValues {
    padded([point.uv[0].x, 1.0 - point.uv[0].y])
}

/// The width of the ray footprint in the first UV set.
fn footprint(point: &TexturePoint) -> SourceValues {
    padded([point.width * point.uv_per_metre[0]])
}

/// A vector of the scene's world space in the graph's, which has z up if `is_z_up`.
pub fn to_node_world(v: Vec3, is_z_up: bool) -> Vec3 {
    if is_z_up { Vec3::new(v.x, -v.z, v.y) } else { v }
}

/// The inverse of [`to_node_world`].
pub fn from_node_world([x, y, z]: [f32; 3], is_z_up: bool) -> Vec3 {
    if is_z_up { Vec3::new(x, z, -y) } else { Vec3::new(x, y, z) }
}

fn generated(hit: &HitData<'_>, attribute: u16) -> Vec3 {
    match hit.attributes.get(attribute) {
        Some(value) => Vec3::from_array(value.vector),
        None => hit.object_point * hit.object.generated[0] + hit.object.generated[1],
    }
}

/// Change of an attribute's texture coordinates per metre; `None` if the surface lacks it.
fn uv_per_metre(hit: &HitData<'_>, attribute: u16) -> Option<f32> {
    let [a, b, c] = hit.corners?;
    let [p, q, r] =
        hit.attributes.corners(attribute)?.map(|corner| Vec2::new(corner.vector[0], corner.vector[1]));
    let ratio = (q - p).perp_dot(r - p).abs() / (b - a).cross(c - a).length();
    Some(ratio.sqrt()).filter(|density| density.is_finite())
}

fn to_object_normal(hit: &HitData<'_>, normal: Vec3) -> Vec3 {
    let transposed = hit.object.world_from_object.matrix3.transpose();
    (transposed * normal.as_dvec3()).normalize_or_zero().as_vec3()
}

fn camera_point(point: &TexturePoint, hit: &HitData<'_>) -> Vec3 {
    let p = hit.camera.camera_from_world.transform_point3(point.world.as_dvec3());
    Vec3::new(p.x as f32, p.y as f32, -p.z as f32)
}

fn window(point: &TexturePoint, hit: &HitData<'_>) -> SourceValues {
    match hit.camera.ndc_from_world {
        Some(matrix) => {
            let p = matrix.project_point3(point.world.as_dvec3());
            padded([p.x as f32, 1.0 - p.y as f32])
        }
        None => [0.0; 12],
    }
}

fn object(hit: &HitData<'_>, is_z_up: bool) -> SourceValues {
    let [x, y, z] = to_node_world(hit.object.location, is_z_up).to_array();
    let [r, g, b, alpha] = hit.object.color;
    padded([x, y, z, r, g, b, alpha, hit.object.index, hit.material_index, hit.object.random])
}

/// Tangent around an axis through the centre of the object's generated coordinates, world space.
fn radial(hit: &HitData<'_>, axis: Axis, attribute: u16) -> Vec3 {
    let p = generated(hit, attribute) - Vec3::splat(0.5);
    let around = match axis {
        Axis::X => Vec3::new(0.0, -p.z, p.y),
        Axis::Y => Vec3::new(-p.z, 0.0, p.x),
        Axis::Z => Vec3::new(-p.y, p.x, 0.0),
    };
    let transposed = hit.object.object_from_world.matrix3.transpose();
    let around = (transposed * around.as_dvec3()).normalize_or_zero().as_vec3();
    let n = hit.shading_normal;
    n.cross(around.cross(n).normalize_or_zero())
}

fn steps(point: &TexturePoint, hit: &HitData<'_>, is_z_up: bool) -> SourceValues {
    let [a, b] = hit.steps(point).map(|step| to_node_world(step, is_z_up).to_array());
    padded([a[0], a[1], a[2], b[0], b[1], b[2]])
}

/// The tangent frame of a normal map, for the first UV set or an attribute.
fn frame(hit: &HitData<'_>, attribute: u16, is_z_up: bool) -> SourceValues {
    let of_attribute = || {
        let uv =
            hit.attributes.corners(attribute)?.map(|corner| Vec2::new(corner.vector[0], corner.vector[1]));
        uv_frame(hit.corners?, uv, hit.shading_normal * if hit.is_back { -1.0 } else { 1.0 })
    };
    let own = if attribute == FIRST_UV_SET { hit.tangent_frame } else { of_attribute() };
    let Some(own) = own else { return [0.0; 12] };
    // As in Cycles, the frame is built in object space, and transformed to world space as normals are.
    let linear = hit.object.object_from_world.matrix3;
    let side = own.determinant().signum() * linear.determinant().signum() as f32;
    let t = (linear * own.x_axis.as_dvec3()).normalize_or_zero().as_vec3();
    let n = to_object_normal(hit, own.z_axis);
    let to_world = |v: Vec3| (linear.transpose() * v.as_dvec3()).as_vec3();
    let [t, b, n] = [t, n.cross(t) * side, n].map(|v| to_node_world(to_world(v), is_z_up).to_array());
    padded([t[0], t[1], t[2], b[0], b[1], b[2], n[0], n[1], n[2], 1.0])
}

/// The tangent frame of a triangle's texture coordinates, v upwards.
fn uv_frame([a, b, c]: [Vec3; 3], uv: [Vec2; 3], n: Vec3) -> Option<Mat3> {
    let (e1, e2) = (b - a, c - a);
    let (d1, d2) = (uv[1] - uv[0], uv[2] - uv[0]);
    let sign = d1.perp_dot(d2).signum();
    let along = (e1 * d2.y - e2 * d1.y) * sign;
    let up = (e2 * d1.x - e1 * d2.x) * sign;
    let t = (along - n * n.dot(along)).try_normalize()?;
    let side = if n.cross(t).dot(up) < 0.0 { -1.0 } else { 1.0 };
    Some(Mat3::from_cols(t, n.cross(t) * side, n))
}

/// A world-space tangent as in Cycles, which transforms object-space tangents as normals.
fn tangent(hit: &HitData<'_>, own: Vec3) -> Vec3 {
    let linear = hit.object.object_from_world.matrix3;
    let along = linear.transpose() * (linear * own.as_dvec3()).normalize_or_zero();
    let n = hit.shading_normal;
    n.cross(along.as_vec3().cross(n).normalize_or_zero())
}

fn strand(hit: &HitData<'_>, is_z_up: bool) -> SourceValues {
    let Some(strand) = &hit.strand else { return [0.0; 12] };
    let [x, y, z] = to_node_world(strand.tangent, is_z_up).to_array();
    padded([1.0, strand.intercept, strand.length, strand.thickness, x, y, z, strand.random])
}

fn squared_distance_from_edge(hit: &HitData<'_>) -> f32 {
    let Some([a, b, c]) = hit.corners else { return f32::INFINITY };
    let squared = |from: Vec3, to: Vec3| {
        let edge = to - from;
        edge.cross(hit.point - from).length_squared() / edge.length_squared()
    };
    squared(a, b).min(squared(b, c)).min(squared(c, a))
}
