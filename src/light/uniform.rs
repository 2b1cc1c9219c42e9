//! Emissive surfaces of constant radiance, with the data for vectorised sampling: rectangles, triangles and facing disks.

use super::area::{AreaLight, AreaShape, Beam, Radiance};
use super::traits::{LightDirection, direction_to_point, is_in_plane};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::shape::{Analytic, FacingDisk, LightPoint, Shape, SphericalRectangle, SphericalTriangle};
use std::marker::PhantomData;

/// Length of a packed [`UniformLight`].
pub const PACKED_LENGTH: usize = 19;

/// The shapes of uniform lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UniformKind {
    Rectangle,
    Triangle,
    FacingDisk,
}

/// The lights of a scene that are [`UniformLight`]s.
#[derive(Clone, Debug, Default)]
pub struct UniformLights {
    /// By index of the area light; `None` for other lights.
    kinds: Vec<Option<UniformKind>>,
    /// By index of the area light; zeros for other lights.
    packed: Vec<[f32; PACKED_LENGTH]>,
    /// Are all area lights rectangles?
    are_rectangles: bool,
}

impl UniformLights {
    /// The static lights of a list; empty if there is none.
    pub fn new(lights: &[AreaLight]) -> UniformLights {
        let packed: Vec<_> = lights.iter().map(pack).collect();
        if packed.iter().all(Option::is_none) {
            return UniformLights::default();
        }
        let kind = |light: &Option<_>| light.map(|(kind, _)| kind);
        let values = |light: &Option<_>| light.map_or([0.0; PACKED_LENGTH], |(_, values)| values);
        UniformLights {
            kinds: packed.iter().map(kind).collect(),
            packed: packed.iter().map(values).collect(),
            are_rectangles: packed.iter().all(|light| kind(light) == Some(UniformKind::Rectangle)),
        }
    }

    /// The kind of a light.
    #[inline(always)]
    pub fn kind(&self, light: u32) -> Option<UniformKind> {
        self.kinds.get(light as usize).copied().flatten()
    }

    /// Packed lights, by index of the area light.
    pub fn packed(&self) -> &[[f32; PACKED_LENGTH]] {
        &self.packed
    }

    /// Are there area lights, all of them rectangles?
    pub fn are_rectangles(&self) -> bool {
        self.are_rectangles
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.kinds[..]) + size_of_val(&self.packed[..])
    }
}

/// The kind and the packed values of a light, if it is a [`UniformLight`].
fn pack(light: &AreaLight) -> Option<(UniformKind, [f32; PACKED_LENGTH])> {
    let radiance = match light.radiance {
        Radiance::Constant(radiance) => radiance,
        Radiance::AtHit { .. } => Rgb::ONE,
        Radiance::Flat { .. } | Radiance::Analytic { .. } => return None,
    };
    if light.beam != Beam::Lambertian {
        return None;
    }
    let (kind, [a, b, c]) = match light.shape {
        AreaShape::Rectangle(e) => (UniformKind::Rectangle, [e.corner, e.edge_u, e.edge_v]),
        AreaShape::Triangle(e) => (UniformKind::Triangle, [e.corner, e.edge_u, e.edge_v]),
        AreaShape::Analytic(Analytic::FacingDisk(disk)) => {
            (UniformKind::FacingDisk, [disk.center, Vec3::splat(disk.radius), Vec3::ZERO])
        }
        AreaShape::Parallelogram(_) | AreaShape::Analytic(_) => return None,
    };
    let (n, e, [r, g, blue]) = (light.normal, light.point_error(), radiance.to_array());
    let sides = f32::from(u8::from(light.two_sided));
    let packed =
        [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z, n.x, n.y, n.z, e.x, e.y, e.z, r, g, blue, sides];
    Some((kind, packed))
}

/// A shape of uniform lights, given by three vectors.
pub trait UniformShape {
    /// Is the shape flat, so that no light arrives at points in its plane?
    const IS_FLAT: bool;

    /// Samples a point as seen from `p`, uniformly by solid angle, by two random numbers in 0..1. Without branches, so that loops vectorise.
    fn sample(vectors: [Vec3; 3], p: Vec3, u: [f32; 2]) -> LightPoint;

    /// Unit normal towards the front at a point as seen from `p`; `normal` is that of flat lights.
    #[inline(always)]
    fn normal(_vectors: [Vec3; 3], normal: Vec3, _p: Vec3) -> Vec3 {
        normal
    }
}

/// A corner and two edges.
#[derive(Clone, Copy, Debug)]
pub struct UniformRectangle;

impl UniformShape for UniformRectangle {
    const IS_FLAT: bool = true;

    #[inline(always)]
    fn sample([corner, edge_u, edge_v]: [Vec3; 3], p: Vec3, u: [f32; 2]) -> LightPoint {
        SphericalRectangle::new(corner, edge_u, edge_v, p).sample(u)
    }
}

/// A corner and two edges.
#[derive(Clone, Copy, Debug)]
pub struct UniformTriangle;

impl UniformShape for UniformTriangle {
    const IS_FLAT: bool = true;

    #[inline(always)]
    fn sample([corner, edge_u, edge_v]: [Vec3; 3], p: Vec3, u: [f32; 2]) -> LightPoint {
        SphericalTriangle::new(corner, corner + edge_u, corner + edge_v, p).sample(u)
    }
}

/// The centre of a facing disk, and its radius in each coordinate.
#[derive(Clone, Copy, Debug)]
pub struct UniformDisk;

impl UniformShape for UniformDisk {
    const IS_FLAT: bool = false;

    #[inline(always)]
    fn sample([center, radius, _]: [Vec3; 3], p: Vec3, u: [f32; 2]) -> LightPoint {
        FacingDisk { center, radius: radius.x }.sample(p, u)
    }

    #[inline(always)]
    fn normal([center, radius, _]: [Vec3; 3], _normal: Vec3, p: Vec3) -> Vec3 {
        FacingDisk { center, radius: radius.x }.normal_at(center, p)
    }
}

/// A static emissive surface of constant radiance in all directions.
#[derive(Clone, Copy, Debug)]
pub struct UniformLight<S> {
    /// Emitted radiance.
    pub radiance: Rgb,
    vectors: [Vec3; 3],
    normal: Vec3,
    point_error: Vec3,
    two_sided: bool,
    shape: PhantomData<S>,
}

impl<S: UniformShape> UniformLight<S> {
    /// Unpacks a light.
    #[inline(always)]
    pub fn unpack(packed: [f32; PACKED_LENGTH]) -> UniformLight<S> {
        let [ax, ay, az, bx, by, bz, cx, cy, cz, nx, ny, nz, ex, ey, ez, r, g, b, two_sided] = packed;
        UniformLight {
            radiance: Rgb::new(r, g, b),
            vectors: [Vec3::new(ax, ay, az), Vec3::new(bx, by, bz), Vec3::new(cx, cy, cz)],
            normal: Vec3::new(nx, ny, nz),
            point_error: Vec3::new(ex, ey, ez),
            two_sided: two_sided != 0.0,
            shape: PhantomData,
        }
    }

    /// Samples a direction from `p`, uniformly by solid angle, by two random numbers in 0..1.
    #[inline(always)]
    pub fn direction(&self, p: Vec3, u: [f32; 2]) -> LightDirection {
        let s = S::sample(self.vectors, p, u);
        let normal = S::normal(self.vectors, self.normal, p);
        let is_in_plane = S::IS_FLAT && is_in_plane(p, self.vectors[0], normal, self.point_error);
        let pdf_solid_angle = if is_in_plane { 0.0 } else { s.pdf_solid_angle };
        direction_to_point(p, s.point, pdf_solid_angle, (normal, self.point_error, self.two_sided))
    }
}
