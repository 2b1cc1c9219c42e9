//! Emissive surfaces: rectangles, parallelograms, triangles and analytic shapes, with the angular distribution of radiance ([`Beam`]).

use super::punctual::{Aim, SpotCone, relative_mean};
use super::traits::{direction_to_point, is_in_plane};
use super::{LightBounds, LightSample, LightSource};
use crate::color::Rgb;
use crate::math::{Bounds3, Frame, Mat3, Ray, Vec2, Vec3, gamma};
use crate::scene::{self, LightProfile, TextureId};
use crate::shape::{
    Analytic, LightPoint, Packed, Shape, SphericalParallelogram, SphericalRectangle, SphericalTriangle,
};
use crate::texture::{CompiledTextures, TexturePoint};
use std::f32::consts::PI;
use std::sync::Arc;

/// The shape of an [`AreaLight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AreaShape {
    /// A parallelogram with a right angle.
    Rectangle(Edges),
    Parallelogram(Edges),
    /// The half of the parallelogram at the corner.
    Triangle(Edges),
    /// An analytic shape: a sphere, a disk and so on.
    Analytic(Analytic),
}

/// A corner and two edges from it; the front is on the side of `edge_u x edge_v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edges {
    pub corner: Vec3,
    /// First edge.
    pub edge_u: Vec3,
    /// Second edge.
    pub edge_v: Vec3,
}

/// Emitted radiance of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radiance {
    /// Constant over the surface.
    Constant(Rgb),
    /// A texture on a flat light.
    Flat {
        texture: TextureId,
        /// Factor on the texture.
        factor: Rgb,
        /// Both sets of texture coordinates: at the corner and at the ends of the edges.
        uv: [[Vec2; 3]; 2],
    },
    /// A texture on an analytic shape.
    Analytic {
        texture: TextureId,
        /// Factor on the texture.
        factor: Rgb,
        /// Orientation of the texture coordinates.
        object_from_world: Mat3,
    },
    /// Evaluated at the hit primitive: depends on the direction, or on more than the position. Light samples have a radiance of 1, which is
    /// multiplied by the emission at the hit.
    AtHit {
        /// Index of the primitive in world geometry.
        primitive: u32,
        /// Estimated mean luminance.
        luminance: f32,
    },
}

/// An emissive surface, one-sided or two-sided.
#[derive(Clone, Copy, Debug)]
pub struct AreaLight {
    pub shape: AreaShape,
    /// Unit normal of the front; unused for round shapes.
    pub normal: Vec3,
    /// Does the back emit too (for spheres the inside)?
    pub two_sided: bool,
    /// Emitted radiance.
    pub radiance: Radiance,
    /// Angular distribution.
    pub beam: Beam,
    /// Bound on the rounding error of points on the light, metres.
    point_error: Vec3,
}

impl AreaLight {
    pub fn new(shape: AreaShape, two_sided: bool, radiance: Radiance) -> AreaLight {
        let (normal, extent) = match shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) | AreaShape::Triangle(e) => {
                (e.edge_u.cross(e.edge_v), e.corner.abs() + e.edge_u.abs() + e.edge_v.abs())
            }
            AreaShape::Analytic(shape) => {
                let (center, radius) = shape.center_and_radius();
                (shape.normal().unwrap_or(Vec3::Z), center.abs() + Vec3::splat(radius))
            }
        };
        let point_error = extent * gamma(6);
        let (normal, beam) = (normal.normalize_or_zero(), Beam::Lambertian);
        AreaLight { shape, normal, two_sided, radiance, beam, point_error }
    }

    /// With an angular distribution.
    pub fn with_beam(self, beam: Beam) -> AreaLight {
        AreaLight { beam, ..self }
    }

    /// Surface area of one side, m^2.
    pub fn area(&self) -> f32 {
        let parallelogram = |e: &Edges| e.edge_u.cross(e.edge_v).length();
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) => parallelogram(e),
            AreaShape::Triangle(e) => 0.5 * parallelogram(e),
            AreaShape::Analytic(shape) => shape.area(),
        }
    }

    /// Interpolates to another light of the same shape, with weight `t` in 0..1: corners move along straight lines, like the surface's.
    pub fn interpolate(&self, other: &AreaLight, t: f32) -> AreaLight {
        let shape = interpolate_shape(&self.shape, &other.shape, t);
        AreaLight::new(shape, self.two_sided, self.radiance).with_beam(self.beam)
    }

    /// The center, or a point near it.
    pub fn center(&self) -> Vec3 {
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) => e.corner + (e.edge_u + e.edge_v) * 0.5,
            AreaShape::Triangle(e) => e.corner + (e.edge_u + e.edge_v) / 3.0,
            AreaShape::Analytic(shape) => {
                let bounds = shape.bounds();
                (bounds.min + bounds.max) * 0.5
            }
        }
    }

    /// Is the radiance evaluated at the hit ([`Radiance::AtHit`])?
    pub fn emits_by_hit(&self) -> bool {
        matches!(self.radiance, Radiance::AtHit { .. })
    }

    fn mean_luminance(&self, textures: &CompiledTextures) -> f32 {
        const GRID: usize = 8;
        let cell = |i: usize| (i as f32 + 0.5) / GRID as f32;
        let points = (0..GRID * GRID).map(|i| [cell(i % GRID), cell(i / GRID)]);
        match self.radiance {
            Radiance::Constant(c) => c.luminance(),
            Radiance::AtHit { luminance, .. } => luminance,
            _ => {
                let sum: f32 =
                    points.map(|u| self.radiance_at(textures, self.point_by_area(u)).luminance()).sum();
                sum / (GRID * GRID) as f32
            }
        }
    }

    /// Emitted radiance at a point of the light.
    #[inline]
    pub fn radiance_at(&self, textures: &CompiledTextures, point: Vec3) -> Rgb {
        let (texture, factor, uv) = match &self.radiance {
            Radiance::Constant(c) => return *c,
            Radiance::AtHit { .. } => return Rgb::ONE,
            Radiance::Flat { texture, factor, uv } => {
                let [a, b] = self.edge_coordinates(point);
                let mix = |c: [Vec2; 3]| c[0] * (1.0 - a - b) + c[1] * a + c[2] * b;
                (texture, factor, uv.map(mix))
            }
            Radiance::Analytic { texture, factor, object_from_world } => {
                let uv = match &self.shape {
                    AreaShape::Analytic(shape) => {
                        shape.texture_coordinates(point, self.normal_at(point, point), object_from_world)
                    }
                    _ => Vec2::ZERO,
                };
                (texture, factor, [uv, uv])
            }
        };
        let [r, g, b, _] = textures.eval_at(
            *texture,
            &TexturePoint {
                uv,
                world: point,
                normal: self.normal_at(point, point),
                ..TexturePoint::default()
            },
        );
        *factor * Rgb::new(r, g, b)
    }

    /// Samples a point uniformly by area; two-sided lights count once.
    pub fn point_by_area(&self, [a, b]: [f32; 2]) -> Vec3 {
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) => e.corner + e.edge_u * a + e.edge_v * b,
            // Mirrors the square onto the triangle.
            AreaShape::Triangle(e) if a + b > 1.0 => e.corner + e.edge_u * (1.0 - a) + e.edge_v * (1.0 - b),
            AreaShape::Triangle(e) => e.corner + e.edge_u * a + e.edge_v * b,
            AreaShape::Analytic(shape) => shape.point_by_area([a, b]),
        }
    }

    /// Unit normal of the front at a point; shapes that face the viewer depend on `reference`.
    #[inline(always)]
    pub fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3 {
        match self.shape {
            AreaShape::Analytic(shape) => shape.normal_at(point, reference),
            _ => self.normal,
        }
    }

    /// Is a point in the plane of a flat light, up to rounding? Then no light arrives, although the light would subtend a hemisphere from
    /// points on it.
    #[inline(always)]
    pub fn is_in_plane(&self, reference: Vec3) -> bool {
        let center = match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) | AreaShape::Triangle(e) => e.corner,
            AreaShape::Analytic(shape) => {
                let (center, _) = shape.center_and_radius();
                return shape.normal().is_some()
                    && is_in_plane(reference, center, self.normal, self.point_error);
            }
        };
        is_in_plane(reference, center, self.normal, self.point_error)
    }

    /// For a receiver on an emitted ray, the distance from the emitter to the ray's origin, if the ray is emitted towards the receiver: see
    /// [`Shape::emission_offset`].
    pub fn emission_offset(&self, receiver: Vec3, ray: &Ray) -> Option<f32> {
        match &self.shape {
            AreaShape::Analytic(shape) => shape.emission_offset(receiver, ray),
            _ => Some(0.0),
        }
    }

    /// Coordinates of a point of a flat light along the edges, 0..1.
    #[inline]
    pub fn edge_coordinates(&self, point: Vec3) -> [f32; 2] {
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) | AreaShape::Triangle(e) => {
                let (d, n) = (point - e.corner, e.edge_u.cross(e.edge_v));
                let scale = 1.0 / n.length_squared();
                [d.cross(e.edge_v).dot(n) * scale, e.edge_u.cross(d).dot(n) * scale]
            }
            AreaShape::Analytic(_) => [0.0; 2],
        }
    }

    /// Bound on the rounding error of points on the light, metres: shadow rays end that far before it.
    #[inline(always)]
    pub fn point_error(&self) -> Vec3 {
        self.point_error
    }
}

// Through a honeycomb grid, only a small part of the light is visible from a point; only that part is sampled.

impl AreaLight {
    /// Bounding rectangle of the part of a rectangle or disk that is visible from a point through its grid; the whole shape without a
    /// grid, or if the bounding rectangle isn't smaller.
    #[inline(always)]
    fn visible_part(&self, reference: Vec3) -> VisiblePart {
        match self.beam {
            Beam::Grid { tan_half, .. } => self.part_visible_through_grid(tan_half, reference),
            _ => VisiblePart::Whole,
        }
    }

    #[cold]
    fn part_visible_through_grid(&self, tan_half: f32, reference: Vec3) -> VisiblePart {
        let whole = match &self.shape {
            AreaShape::Rectangle(edges) => *edges,
            AreaShape::Analytic(disk) if disk.normal().is_some() => {
                let (center, radius) = disk.center_and_radius();
                let frame = Frame::from_normal(self.normal);
                let [u, v] =
                    [frame.to_world(Vec3::X), frame.to_world(Vec3::Y)].map(|axis| axis * (2.0 * radius));
                Edges { corner: center - 0.5 * (u + v), edge_u: u, edge_v: v }
            }
            AreaShape::Parallelogram(_) | AreaShape::Triangle(_) | AreaShape::Analytic(_) => {
                return VisiblePart::Whole;
            }
        };
        let to_reference = reference - whole.corner;
        let reach = tan_half * to_reference.dot(self.normal).abs();
        // The interval of an edge within reach of the point below the reference.
        let clipped = |edge: Vec3| {
            let at = to_reference.dot(edge) / edge.length_squared();
            let reach = reach / edge.length();
            let (start, end) = ((at - reach).max(0.0), (at + reach).min(1.0));
            (start < end).then_some((edge * start, edge * (end - start)))
        };
        let Some(((start_u, edge_u), (start_v, edge_v))) = clipped(whole.edge_u).zip(clipped(whole.edge_v))
        else {
            return VisiblePart::Nothing;
        };
        let is_round = matches!(self.shape, AreaShape::Analytic(_));
        match is_round && edge_u.cross(edge_v).length() > 0.5 * whole.edge_u.cross(whole.edge_v).length() {
            true => VisiblePart::Whole,
            false => VisiblePart::Part(Edges { corner: whole.corner + start_u + start_v, edge_u, edge_v }),
        }
    }

    /// Is a point, sampled in a bounding rectangle of the light, on the light?
    #[inline(always)]
    fn contains(&self, point: Vec3) -> bool {
        match &self.shape {
            AreaShape::Analytic(disk) => {
                let (center, radius) = disk.center_and_radius();
                (point - center).length_squared() <= radius * radius
            }
            _ => true,
        }
    }
}

/// The part of a light that is visible from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
enum VisiblePart {
    Whole,
    /// A rectangle that bounds it.
    Part(Edges),
    Nothing,
}

impl LightSource for AreaLight {
    /// Uniform by solid angle for flat lights and spheres.
    #[inline]
    fn sample(&self, textures: &CompiledTextures, reference: Vec3, u: [f32; 2]) -> LightSample {
        if self.is_in_plane(reference) {
            return LightSample::NONE;
        }
        let LightPoint { point, pdf_solid_angle } = match (self.visible_part(reference), &self.shape) {
            (VisiblePart::Nothing, _) => return LightSample::NONE,
            (VisiblePart::Part(part), _) => {
                let sampled = rectangle(&part, reference).sample(u);
                if !self.contains(sampled.point) {
                    return LightSample::NONE;
                }
                sampled
            }
            (VisiblePart::Whole, AreaShape::Rectangle(e)) => rectangle(e, reference).sample(u),
            (VisiblePart::Whole, AreaShape::Parallelogram(e)) => parallelogram(e, reference).sample(u),
            (VisiblePart::Whole, AreaShape::Triangle(e)) => triangle(e, reference).sample(u),
            (VisiblePart::Whole, AreaShape::Analytic(shape)) => shape.sample(reference, u),
        };
        let normal = self.normal_at(point, reference);
        let to =
            direction_to_point(reference, point, pdf_solid_angle, (normal, self.point_error, self.two_sided));
        if to.pdf_solid_angle <= 0.0 {
            return LightSample::NONE;
        }
        LightSample {
            wi: to.wi,
            target: to.target,
            is_infinite: false,
            is_delta: false,
            radiance: self.beam.radiance(self.radiance_at(textures, point), normal, -to.wi, textures),
            pdf_solid_angle,
        }
    }

    #[inline]
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32 {
        match (self.visible_part(reference), &self.shape) {
            (VisiblePart::Nothing, _) => 0.0,
            (VisiblePart::Part(part), _) => rectangle(&part, reference).pdf_solid_angle(point),
            (VisiblePart::Whole, AreaShape::Rectangle(e)) => rectangle(e, reference).pdf_solid_angle(point),
            (VisiblePart::Whole, AreaShape::Parallelogram(e)) => {
                parallelogram(e, reference).pdf_solid_angle(point)
            }
            (VisiblePart::Whole, AreaShape::Triangle(e)) => triangle(e, reference).pdf_solid_angle(point),
            (VisiblePart::Whole, AreaShape::Analytic(shape)) => shape.pdf_solid_angle(reference, point),
        }
    }

    fn radiance(&self, textures: &CompiledTextures, reference: Vec3, to: Vec3) -> Rgb {
        let (normal, direction) = (self.normal_at(to, reference), (reference - to).normalize_or_zero());
        if !self.two_sided && direction.dot(normal) <= 0.0 {
            return Rgb::ZERO;
        }
        self.beam.radiance(self.radiance_at(textures, to), normal, direction, textures)
    }

    /// Mean luminance times area times pi per emissive side. Textures are averaged over a grid of points.
    fn power(&self, textures: &CompiledTextures) -> f32 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        self.mean_luminance(textures) * self.area() * PI * sides * self.beam.relative_power()
    }

    fn bounds(&self, textures: &CompiledTextures) -> Option<LightBounds> {
        let corners = |e: &Edges| [e.corner, e.corner + e.edge_u, e.corner + e.edge_v];
        let (bounds, area) = match &self.shape {
            AreaShape::Triangle(e) => (Bounds3::of(corners(e)), self.area()),
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) => {
                (Bounds3::of(corners(e)).with(e.corner + e.edge_u + e.edge_v), self.area())
            }
            AreaShape::Analytic(shape) => (shape.bounds(), shape.largest_projection()),
        };
        let is_round = matches!(&self.shape, AreaShape::Analytic(shape) if shape.normal().is_none());
        let weight = self.mean_luminance(textures) * area;
        if let Some((axis, emission_rad)) = self.beam.cone() {
            return Some(LightBounds { bounds, weight, axis, normals_rad: 0.0, emission_rad });
        }
        Some(LightBounds {
            bounds,
            weight,
            axis: self.normal,
            normals_rad: if is_round || self.two_sided { PI } else { 0.0 },
            emission_rad: 0.5 * PI,
        })
    }
}

fn interpolate_shape(from: &AreaShape, to: &AreaShape, t: f32) -> AreaShape {
    let mix = |a: Vec3, b: Vec3| a + (b - a) * t;
    let edges = |a: &Edges, b: &Edges| Edges {
        corner: mix(a.corner, b.corner),
        edge_u: mix(a.edge_u, b.edge_u),
        edge_v: mix(a.edge_v, b.edge_v),
    };
    match (from, to) {
        (AreaShape::Rectangle(a), AreaShape::Rectangle(b)) => AreaShape::Rectangle(edges(a, b)),
        (AreaShape::Parallelogram(a), AreaShape::Parallelogram(b)) => AreaShape::Parallelogram(edges(a, b)),
        (AreaShape::Triangle(a), AreaShape::Triangle(b)) => AreaShape::Triangle(edges(a, b)),
        (AreaShape::Analytic(a), AreaShape::Analytic(b)) => {
            let (packed, other) = (a.pack(), b.parameters());
            let number = |i: usize| packed.parameters[i] + (other[i] - packed.parameters[i]) * t;
            let parameters = std::array::from_fn(number);
            AreaShape::Analytic(Analytic::unpack(&Packed { parameters, ..packed }).unwrap_or(*a))
        }
        _ => *from,
    }
}

#[inline(always)]
fn rectangle(e: &Edges, reference: Vec3) -> SphericalRectangle {
    SphericalRectangle::new(e.corner, e.edge_u, e.edge_v, reference)
}

#[inline(always)]
fn parallelogram(e: &Edges, reference: Vec3) -> SphericalParallelogram {
    SphericalParallelogram::new(e.corner, e.edge_u, e.edge_v, reference)
}

#[inline(always)]
fn triangle(e: &Edges, reference: Vec3) -> SphericalTriangle {
    SphericalTriangle::new(e.corner, e.corner + e.edge_u, e.corner + e.edge_v, reference)
}

/// Angular distribution of a surface's radiance; see [`scene::Beam`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Beam {
    /// Constant radiance.
    Lambertian,
    /// Honeycomb grid: factor (`tan_half` - tan t) times `scale`, with the angle t to the normal.
    Grid {
        /// Tangent of the half angle.
        tan_half: f32,
        /// 1 / (tan a - a) of the half angle a, which preserves power: the integral of (tan a - tan t) cos t over the directions is
        /// pi (tan a - a).
        scale: f32,
    },
    /// A cone around an axis.
    Cone(SpotCone),
    /// A measured profile (IES).
    Profile {
        /// Index among the scene's profiles.
        profile: u32,
        /// Orientation.
        aim: Aim,
        /// Mean over all directions, relative to the maximum.
        mean: f32,
    },
}

impl Beam {
    /// Compiles a beam. Without the profile it refers to, it is Lambertian (`Scene::validate` reports that).
    pub fn new(beam: scene::Beam, profiles: &[Arc<LightProfile>]) -> Beam {
        match beam {
            scene::Beam::Lambertian => Beam::Lambertian,
            scene::Beam::Grid { half_angle_rad } => {
                let tan_half = half_angle_rad.tan();
                let scale = 1.0 / (tan_half - half_angle_rad);
                Beam::Grid { tan_half: tan_half as f32, scale: scale as f32 }
            }
            scene::Beam::Cone { direction, inner_angle_rad, outer_angle_rad, falloff } => {
                Beam::Cone(SpotCone::new(direction, inner_angle_rad, outer_angle_rad, falloff))
            }
            scene::Beam::Profile { profile, rotation, cone } => {
                profiles.get(profile.index()).map_or(Beam::Lambertian, |of| Beam::Profile {
                    profile: profile.0,
                    aim: Aim::new(rotation, cone),
                    mean: relative_mean(of),
                })
            }
        }
    }

    /// Radiance in a unit direction from a surface with a unit normal; `radiance` is that of a Lambertian emitter. Profiles are stored
    /// with textures.
    #[inline(always)]
    pub fn radiance(&self, radiance: Rgb, normal: Vec3, direction: Vec3, textures: &CompiledTextures) -> Rgb {
        if matches!(self, Beam::Lambertian) {
            return radiance;
        }
        radiance * self.factor(normal, direction, textures.profiles())
    }

    /// Factor on the radiance in a unit direction from a surface with a unit normal.
    #[cold]
    pub fn factor(&self, normal: Vec3, direction: Vec3, profiles: &[Arc<LightProfile>]) -> f32 {
        match self {
            Beam::Lambertian => 1.0,
            Beam::Grid { tan_half, scale } => {
                let cosine = normal.dot(direction).abs();
                let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
                ((tan_half - sine / cosine.max(1e-9)) * scale).max(0.0)
            }
            Beam::Cone(cone) => cone.attenuation(direction.dot(cone.axis)),
            Beam::Profile { profile, aim, .. } => {
                aim.attenuation(profiles.get(*profile as usize).map(|profile| &**profile), direction)
            }
        }
    }

    /// Approximate power relative to that of a Lambertian emitter, for light selection.
    pub fn relative_power(&self) -> f32 {
        match self {
            Beam::Lambertian | Beam::Grid { .. } => 1.0,
            Beam::Cone(cone) => cone.solid_angle() / (4.0 * PI),
            Beam::Profile { mean, .. } => *mean,
        }
    }

    /// Axis and half angle (radians) of a bounding cone of the emission; `None` if the emission depends on the normal.
    pub fn cone(&self) -> Option<(Vec3, f32)> {
        match self {
            Beam::Lambertian | Beam::Grid { .. } => None,
            // A little wider, for rounding.
            Beam::Cone(cone) => Some((cone.axis, (cone.angles_rad()[1] + 1e-3).min(0.5 * PI))),
            Beam::Profile { aim, .. } => {
                Some(aim.cone().map_or((Vec3::Z, PI), |(axis, angle)| (axis, (angle + 1e-3).min(0.5 * PI))))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_beam_preserves_power() {
        for half_angle_rad in [0.1f64, 0.7, 1.4] {
            let beam = Beam::new(scene::Beam::Grid { half_angle_rad }, &[]);
            let n = 20_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let t = (f64::from(i) + 0.5) / f64::from(n) * half_angle_rad;
                    let direction = Vec3::new(t.sin() as f32, 0.0, t.cos() as f32);
                    f64::from(beam.factor(Vec3::Z, direction, &[])) * t.cos() * t.sin()
                })
                .sum();
            let power = 2.0 * sum * half_angle_rad / f64::from(n);
            assert!((power - 1.0).abs() < 2e-3, "{half_angle_rad}: {power}");
            assert_eq!(beam.factor(Vec3::Z, Vec3::X, &[]), 0.0);
        }
    }
}
