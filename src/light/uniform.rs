//! Emissive surfaces of constant radiance, with the data for vectorised sampling: rectangles, triangles and facing disks.

use super::area::{AreaLight, AreaShape, Beam, Edges, Radiance};
use super::traits::{LightDirection, direction_to_point, is_in_plane};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::shape::{Analytic, FacingDisk, Shape, SphericalRectangle, SphericalTriangle};

/// Length of a packed [`UniformLight`].
pub const UNIFORM_NUMBERS: usize = 19;

/// The shapes of uniform lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UniformKind {
    Rectangle,
    Triangle,
    FacingDisk,
}

/// A static emissive surface of constant radiance in all directions. Its functions are free of branches, so that loops vectorise.
pub trait UniformLight: Copy {
    /// The shape.
    const KIND: UniformKind;

    /// Emitted radiance.
    fn radiance(&self) -> Rgb;

    /// Samples a direction from `p`, uniformly by solid angle, by two random numbers in 0..1.
    fn direction(&self, p: Vec3, u: [f32; 2]) -> LightDirection;

    /// The light of packed numbers.
    fn unpack(numbers: [f32; UNIFORM_NUMBERS]) -> Self;
}

/// The lights of a scene that are [`UniformLight`]s.
#[derive(Clone, Debug, Default)]
pub struct UniformLights {
    /// By index of the area light; `None` for other lights.
    kinds: Vec<Option<UniformKind>>,
    /// By index of the area light; zeros for other lights.
    numbers: Vec<[f32; UNIFORM_NUMBERS]>,
    /// Are all area lights rectangles?
    are_rectangles: bool,
}

impl UniformLights {
    /// The static lights of a list; empty if there is none.
    pub fn new(lights: &[AreaLight]) -> UniformLights {
        let packed = || lights.iter().map(pack);
        match packed().any(|light| light.is_some()) {
            true => UniformLights {
                kinds: packed().map(|light| light.map(|(kind, _)| kind)).collect(),
                numbers: packed()
                    .map(|light| light.map_or([0.0; UNIFORM_NUMBERS], |(_, numbers)| numbers))
                    .collect(),
                are_rectangles: packed()
                    .all(|light| light.is_some_and(|(kind, _)| kind == UniformKind::Rectangle)),
            },
            false => UniformLights::default(),
        }
    }

    /// Is there none?
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// The kind of a light.
    #[inline(always)]
    pub fn kind(&self, light: u32) -> Option<UniformKind> {
        self.kinds.get(light as usize).copied().flatten()
    }

    /// Packed numbers, by index of the area light.
    pub fn numbers(&self) -> &[[f32; UNIFORM_NUMBERS]] {
        &self.numbers
    }

    /// Are all area lights rectangles, of which there is at least one?
    pub fn are_rectangles(&self) -> bool {
        self.are_rectangles
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.kinds[..]) + size_of_val(&self.numbers[..])
    }
}

/// The kind and the packed numbers of a light, if it is a [`UniformLight`].
fn pack(light: &AreaLight) -> Option<(UniformKind, [f32; UNIFORM_NUMBERS])> {
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
    let numbers =
        [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z, n.x, n.y, n.z, e.x, e.y, e.z, r, g, blue, sides];
    Some((kind, numbers))
}

/// The unpacked numbers of a [`UniformLight`].
#[derive(Clone, Copy, Debug)]
struct Numbers {
    vectors: [Vec3; 3],
    normal: Vec3,
    point_error: Vec3,
    radiance: Rgb,
    two_sided: bool,
}

impl Numbers {
    #[inline(always)]
    fn unpack(numbers: [f32; UNIFORM_NUMBERS]) -> Numbers {
        let [ax, ay, az, bx, by, bz, cx, cy, cz, nx, ny, nz, ex, ey, ez, r, g, b, two_sided] = numbers;
        Numbers {
            vectors: [Vec3::new(ax, ay, az), Vec3::new(bx, by, bz), Vec3::new(cx, cy, cz)],
            normal: Vec3::new(nx, ny, nz),
            point_error: Vec3::new(ex, ey, ez),
            radiance: Rgb::new(r, g, b),
            two_sided: two_sided != 0.0,
        }
    }

    #[inline(always)]
    fn edges(&self) -> Edges {
        let [corner, edge_u, edge_v] = self.vectors;
        Edges { corner, edge_u, edge_v }
    }
}

/// A rectangle of constant radiance.
#[derive(Clone, Copy, Debug)]
pub struct UniformRectangle(Numbers);

impl UniformLight for UniformRectangle {
    const KIND: UniformKind = UniformKind::Rectangle;

    #[inline(always)]
    fn radiance(&self) -> Rgb {
        self.0.radiance
    }

    #[inline(always)]
    fn direction(&self, p: Vec3, u: [f32; 2]) -> LightDirection {
        let (Edges { corner, edge_u, edge_v }, light) = (self.0.edges(), &self.0);
        let s = SphericalRectangle::new(corner, edge_u, edge_v, p).sample(u);
        let is_in_plane = is_in_plane(p, corner, light.normal, light.point_error);
        let pdf_solid_angle = if is_in_plane { 0.0 } else { s.pdf_solid_angle };
        direction_to_point(p, s.point, pdf_solid_angle, (light.normal, light.point_error, light.two_sided))
    }

    #[inline(always)]
    fn unpack(numbers: [f32; UNIFORM_NUMBERS]) -> UniformRectangle {
        UniformRectangle(Numbers::unpack(numbers))
    }
}

/// A triangle of constant radiance.
#[derive(Clone, Copy, Debug)]
pub struct UniformTriangle(Numbers);

impl UniformLight for UniformTriangle {
    const KIND: UniformKind = UniformKind::Triangle;

    #[inline(always)]
    fn radiance(&self) -> Rgb {
        self.0.radiance
    }

    #[inline(always)]
    fn direction(&self, p: Vec3, u: [f32; 2]) -> LightDirection {
        let (Edges { corner, edge_u, edge_v }, light) = (self.0.edges(), &self.0);
        let s = SphericalTriangle::new(corner, corner + edge_u, corner + edge_v, p).sample(u);
        let is_in_plane = is_in_plane(p, corner, light.normal, light.point_error);
        let pdf_solid_angle = if is_in_plane { 0.0 } else { s.pdf_solid_angle };
        direction_to_point(p, s.point, pdf_solid_angle, (light.normal, light.point_error, light.two_sided))
    }

    #[inline(always)]
    fn unpack(numbers: [f32; UNIFORM_NUMBERS]) -> UniformTriangle {
        UniformTriangle(Numbers::unpack(numbers))
    }
}

/// A facing disk of constant radiance.
#[derive(Clone, Copy, Debug)]
pub struct UniformDisk(Numbers);

impl UniformLight for UniformDisk {
    const KIND: UniformKind = UniformKind::FacingDisk;

    #[inline(always)]
    fn radiance(&self) -> Rgb {
        self.0.radiance
    }

    #[inline(always)]
    fn direction(&self, p: Vec3, u: [f32; 2]) -> LightDirection {
        let ([center, radius, _], light) = (self.0.vectors, &self.0);
        let disk = FacingDisk { center, radius: radius.x };
        let s = disk.sample(p, u);
        let normal = disk.normal_at(s.point, p);
        direction_to_point(p, s.point, s.pdf_solid_angle, (normal, light.point_error, light.two_sided))
    }

    #[inline(always)]
    fn unpack(numbers: [f32; UNIFORM_NUMBERS]) -> UniformDisk {
        UniformDisk(Numbers::unpack(numbers))
    }
}
