//! Inputs of programs at a hit.

use crate::math::{DVec3, Mat3, Vec2, Vec3};
use crate::scene::TextureId;
use crate::scene::nodes::Axis;
use crate::texture::{AttributeValue, HitAttributes, HitData, TexturePoint};

/// Inputs of a program at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// World space, metres.
    Position,
    /// Geometric normal on the viewer's side, world space.
    TrueNormal,
    /// Shading normal on the viewer's side, world space.
    Normal,
    /// Towards the viewer, world space.
    Incoming,
    /// The mirror direction of that, world space.
    Reflection,
    /// The first set of texture coordinates; v grows upwards.
    Uv,
    /// Width of the path's footprint in texture coordinates: an attribute by its number, or the first set.
    Footprint(u16),
    /// The attribute of a number: red, green, blue, alpha, factor; 0 without one.
    Attribute(u16),
    /// The attribute of a number as texture coordinates; the first set without one.
    UvMap(u16),
    /// The attribute of a number; without one the place in the object's box, from 0 to 1.
    Generated(u16),
    /// The point in the object's space.
    ObjectPoint,
    /// The shading normal there.
    ObjectNormal,
    /// The point in the camera's space, z along its axis.
    CameraPoint,
    /// The place in the picture, from 0 to 1 upwards.
    Window,
    /// Location, red, green, blue, alpha, index, number of the material, random number of the object.
    Object,
    /// Tangent around an axis of the object, by the attribute of a number as its generated coordinates or the object's box.
    Radial(Axis, u16),
    /// Where the first texture coordinates grow.
    UvTangent,
    /// Tangent, bitangent and normal of the texture coordinates of an attribute, or of the first set; and 1 where there are some.
    Frame(u16),
    /// Two steps over the surface, as long as the path's footprint is wide.
    Steps,
    /// Weights of the first two vertices of a triangle.
    Parametric,
    /// 1 where the back is seen.
    Backfacing,
    /// Cosine of the angle between the view and the shading normal.
    Cosine,
    /// Kinds of the path, length of the ray, bounces.
    Path,
    /// Is there a strand, place along it, length, thickness, tangent, random number.
    Strand,
    /// Squared distance from the nearest edge of the triangle, metres, and the width of a pixel.
    Edge,
    /// Rows of the transforms between the spaces of the world, of the object and of the camera.
    ObjectFromWorld,
    /// The inverse.
    WorldFromObject,
    /// The transform into camera space, with z along the camera's axis.
    CameraFromWorld,
    /// The inverse.
    WorldFromCamera,
    /// Linear RGBA.
    Texture(TextureId),
}

/// In place of the number of an attribute: the first set of texture coordinates.
pub const FIRST_SET: u16 = u16::MAX;

/// Numbers of a source.
pub type Numbers = [f32; 12];

/// Maximum number of values that a source has, filled up with zeros.
fn filled<const N: usize>(values: [f32; N]) -> Numbers {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

impl Source {
    /// How many numbers it has.
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

    /// Does it depend on who sees the surface?
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

    /// Does it change from point to point of a surface, as far as bumps see?
    pub fn moves(self) -> bool {
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

    /// Does it need more than a [`TexturePoint`] has?
    pub fn reads_hit(self) -> bool {
        match self {
            Source::Footprint(number) => number != FIRST_SET,
            Source::Position | Source::Uv | Source::Cosine | Source::Texture(_) => false,
            _ => true,
        }
    }

    /// Its numbers at a point; vectors of the world are those of Blender where `is_z_up`.
    pub fn read(
        self,
        point: &TexturePoint,
        hit: Option<&HitData<'_>>,
        is_z_up: bool,
        texture: impl Fn(TextureId) -> [f32; 4],
    ) -> Numbers {
        let turned = |v: Vec3| filled(turned(v, is_z_up).to_array());
        let (footprint, uv) = (|| footprint(point), || first_uv(point));
        let Some(hit) = hit else { return self.without_hit(point, is_z_up, texture) };
        match self {
            Source::Position => turned(point.world),
            Source::TrueNormal => turned(hit.true_normal),
            Source::Normal => turned(hit.shading_normal),
            Source::Incoming => turned(hit.incoming),
            Source::Reflection => {
                let (n, wo) = (hit.shading_normal, hit.incoming);
                turned(n * (2.0 * n.dot(wo)) - wo)
            }
            Source::Uv => uv(),
            Source::Footprint(number) => match density(hit, number) {
                Some(density) => filled([point.width * density]),
                None => footprint(),
            },
            Source::Attribute(number) => {
                let AttributeValue { vector: [x, y, z], alpha, factor } =
                    hit.attributes.get(number).unwrap_or(HitAttributes::MISSING);
                filled([x, y, z, alpha, factor])
            }
            Source::UvMap(number) => hit.attributes.get(number).map_or_else(uv, |value| filled(value.vector)),
            Source::Generated(number) => filled(generated(hit, number).to_array()),
            Source::ObjectPoint => filled(hit.object_point.to_array()),
            Source::ObjectNormal => filled(to_object_normal(hit, hit.shading_normal).to_array()),
            Source::CameraPoint => filled(camera_point(point, hit).to_array()),
            Source::Window => window(point, hit),
            Source::Object => object(hit, is_z_up),
            Source::Radial(axis, number) => turned(radial(hit, axis, number)),
            Source::UvTangent => turned(hit.tangent_frame.map_or(Vec3::ZERO, |own| tangent(hit, own.x_axis))),
            Source::Frame(number) => frame(hit, number, is_z_up),
            Source::Steps => steps(point, hit, is_z_up),
            Source::Parametric => filled(hit.parametric),
            Source::Backfacing => filled([f32::from(u8::from(hit.is_back))]),
            Source::Cosine => filled([point.cosine]),
            Source::Path => {
                let mut numbers = filled(hit.path.kinds);
                (numbers[8], numbers[9]) = (hit.path.length, hit.path.depth);
                numbers
            }
            Source::Strand => strand(hit, is_z_up),
            Source::Edge => filled([squared_distance_from_edge(hit), 2.0 * point.width]),
            Source::ObjectFromWorld
            | Source::WorldFromObject
            | Source::CameraFromWorld
            | Source::WorldFromCamera => self.transform(point, hit, is_z_up),
            Source::Texture(id) => filled(texture(id)),
        }
    }

    /// Its numbers where nothing but a point is known.
    fn without_hit(
        self,
        point: &TexturePoint,
        is_z_up: bool,
        texture: impl Fn(TextureId) -> [f32; 4],
    ) -> Numbers {
        let turned = |v: Vec3| filled(turned(v, is_z_up).to_array());
        match self {
            Source::Position => turned(point.world),
            Source::TrueNormal | Source::Normal => turned(point.normal),
            Source::Uv | Source::UvMap(_) => first_uv(point),
            Source::Footprint(_) => footprint(point),
            Source::Cosine => filled([point.cosine]),
            Source::Texture(id) => filled(texture(id)),
            _ => [0.0; 12],
        }
    }

    /// Rows of a transform between spaces.
    fn transform(self, point: &TexturePoint, hit: &HitData<'_>, is_z_up: bool) -> Numbers {
        // The compiled scene's world was moved away from the scene's.
        let moved = (hit.point - point.world).as_dvec3();
        let of = |to: &dyn Fn(DVec3) -> DVec3| {
            let origin = to(DVec3::ZERO);
            let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| to(axis) - origin);
            let row = |i: usize| [columns[0][i], columns[1][i], columns[2][i], origin[i]];
            let [a, b, c] = [0, 1, 2].map(row);
            std::array::from_fn(|i| [a, b, c][i / 4][i % 4] as f32)
        };
        // From the world of nodes to the scene's, and back.
        let given = |v: DVec3| if is_z_up { DVec3::new(v.x, v.z, -v.y) } else { v };
        let back = |v: DVec3| if is_z_up { DVec3::new(v.x, -v.z, v.y) } else { v };
        let flip = |v: DVec3| DVec3::new(v.x, v.y, -v.z);
        let camera = hit.camera.camera_from_world;
        match self {
            Source::ObjectFromWorld => {
                of(&|v| hit.object.object_from_world.transform_point3(given(v) + moved))
            }
            Source::WorldFromObject => {
                of(&|v| back(hit.object.world_from_object.transform_point3(v) - moved))
            }
            Source::CameraFromWorld => of(&|v| flip(camera.transform_point3(given(v)))),
            _ => of(&|v| back(camera.inverse().transform_point3(flip(v)))),
        }
    }
}

/// The first texture coordinates, v upwards.
fn first_uv(point: &TexturePoint) -> Numbers {
    filled([point.uv[0].x, 1.0 - point.uv[0].y])
}

/// The width of the path's footprint in these coordinates.
fn footprint(point: &TexturePoint) -> Numbers {
    filled([point.width * point.uv_per_metre[0]])
}

/// A vector of the world as Blender has it, whose z is up, where that is asked for.
fn turned(v: Vec3, is_z_up: bool) -> Vec3 {
    if is_z_up { Vec3::new(v.x, -v.z, v.y) } else { v }
}

fn generated(hit: &HitData<'_>, number: u16) -> Vec3 {
    match hit.attributes.get(number) {
        Some(value) => Vec3::from_array(value.vector),
        None => hit.object_point * hit.object.generated[0] + hit.object.generated[1],
    }
}

/// How much texture coordinates of an attribute change over a metre; `None` where the surface has none.
fn density(hit: &HitData<'_>, number: u16) -> Option<f32> {
    let [a, b, c] = hit.corners?;
    let [p, q, r] =
        hit.attributes.corners(number)?.map(|corner| Vec2::new(corner.vector[0], corner.vector[1]));
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

fn window(point: &TexturePoint, hit: &HitData<'_>) -> Numbers {
    match hit.camera.ndc_from_world {
        Some(matrix) => {
            let p = matrix.project_point3(point.world.as_dvec3());
            filled([p.x as f32, 1.0 - p.y as f32])
        }
        None => [0.0; 12],
    }
}

fn object(hit: &HitData<'_>, is_z_up: bool) -> Numbers {
    let [x, y, z] = turned(hit.object.location, is_z_up).to_array();
    let [r, g, b, alpha] = hit.object.color;
    filled([x, y, z, r, g, b, alpha, hit.object.index, hit.material_index, hit.object.random])
}

/// A tangent around an axis through the middle of the object's generated coordinates.
fn radial(hit: &HitData<'_>, axis: Axis, number: u16) -> Vec3 {
    let p = generated(hit, number) - Vec3::splat(0.5);
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

fn steps(point: &TexturePoint, hit: &HitData<'_>, is_z_up: bool) -> Numbers {
    let [a, b] = hit.steps(point).map(|step| turned(step, is_z_up).to_array());
    filled([a[0], a[1], a[2], b[0], b[1], b[2]])
}

/// The frame of a normal map: of the first texture coordinates, or of those of an attribute.
fn frame(hit: &HitData<'_>, number: u16, is_z_up: bool) -> Numbers {
    let of_attribute = || {
        let uv = hit.attributes.corners(number)?.map(|corner| Vec2::new(corner.vector[0], corner.vector[1]));
        uv_frame(hit.corners?, uv, hit.shading_normal * if hit.is_back { -1.0 } else { 1.0 })
    };
    let own = if number == FIRST_SET { hit.tangent_frame } else { of_attribute() };
    let Some(own) = own else { return [0.0; 12] };
    // As in Cycles, the frame is one of the object's space, and what it gives goes to the world as normals do.
    let linear = hit.object.object_from_world.matrix3;
    let side = own.determinant().signum() * linear.determinant().signum() as f32;
    let t = (linear * own.x_axis.as_dvec3()).normalize_or_zero().as_vec3();
    let n = to_object_normal(hit, own.z_axis);
    let to_world = |v: Vec3| (linear.transpose() * v.as_dvec3()).as_vec3();
    let [t, b, n] = [t, n.cross(t) * side, n].map(|v| turned(to_world(v), is_z_up).to_array());
    filled([t[0], t[1], t[2], b[0], b[1], b[2], n[0], n[1], n[2], 1.0])
}

/// Tangents where texture coordinates grow, whose v points upwards.
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

/// A tangent of the world as Cycles has it, which takes those of objects to the world as normals.
fn tangent(hit: &HitData<'_>, own: Vec3) -> Vec3 {
    let linear = hit.object.object_from_world.matrix3;
    let along = linear.transpose() * (linear * own.as_dvec3()).normalize_or_zero();
    let n = hit.shading_normal;
    n.cross(along.as_vec3().cross(n).normalize_or_zero())
}

fn strand(hit: &HitData<'_>, is_z_up: bool) -> Numbers {
    let Some(strand) = &hit.strand else { return [0.0; 12] };
    let [x, y, z] = turned(strand.tangent, is_z_up).to_array();
    filled([1.0, strand.intercept, strand.length, strand.thickness, x, y, z, strand.random])
}

fn squared_distance_from_edge(hit: &HitData<'_>) -> f32 {
    let Some([a, b, c]) = hit.corners else { return f32::INFINITY };
    let squared = |from: Vec3, to: Vec3| {
        let edge = to - from;
        edge.cross(hit.point - from).length_squared() / edge.length_squared()
    };
    squared(a, b).min(squared(b, c)).min(squared(c, a))
}
