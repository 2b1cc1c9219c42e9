//! Surfaces that shine: rectangles, parallelograms, triangles and analytic shapes.

use super::{Beam, LightBounds, LightSample};
use crate::color::Rgb;
use crate::math::{Bounds3, Mat3, Ray, Vec2, Vec3, gamma, offset_ray_origin};
use crate::scene::TextureId;
use crate::shape::{
    Analytic, LightPoint, Shape, SphericalParallelogram, SphericalRectangle, SphericalTriangle,
};
use crate::texture::{CompiledTextures, TexturePoint};
use std::f32::consts::PI;

/// The shape of an [`AreaLight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AreaShape {
    /// A parallelogram with a right angle.
    Rectangle(Edges),
    /// A parallelogram.
    Parallelogram(Edges),
    /// The half of the parallelogram next to the corner.
    Triangle(Edges),
    /// A sphere, a disk or the like, whole.
    Analytic(Analytic),
}

/// A corner and the edges that leave it; the front is on the side of `edge_u x edge_v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edges {
    /// The corner.
    pub corner: Vec3,
    /// First edge.
    pub edge_u: Vec3,
    /// Second edge.
    pub edge_v: Vec3,
}

/// What a surface emits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radiance {
    /// The same everywhere.
    Constant(Rgb),
    /// A texture times a factor, over a flat light.
    Flat {
        /// The texture.
        texture: TextureId,
        /// Multiplied with it.
        factor: Rgb,
        /// Both sets of texture coordinates at the corner and at the ends of the edges.
        uv: [[Vec2; 3]; 2],
    },
    /// A texture times a factor, over an analytic shape.
    Analytic {
        /// The texture.
        texture: TextureId,
        /// Multiplied with it.
        factor: Rgb,
        /// Turns the shape's texture coordinates.
        object_from_world: Mat3,
    },
}

/// A surface that shines with a cosine (constant radiance in all directions), on one side or on both.
#[derive(Clone, Copy, Debug)]
pub struct AreaLight {
    /// Its shape.
    pub shape: AreaShape,
    /// Front side; unused for round shapes.
    pub normal: Vec3,
    /// The back shines too (of a sphere the inside).
    pub two_sided: bool,
    /// Emitted radiance.
    pub radiance: Radiance,
    /// How it depends on the direction.
    pub beam: Beam,
    /// Bound on the rounding error of its points.
    point_error: Vec3,
}

impl AreaLight {
    /// A light of a shape.
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
        let (normal, beam) = (normal.normalize_or_zero(), Beam::Even);
        AreaLight { shape, normal, two_sided, radiance, beam, point_error }
    }

    /// With its light in a beam.
    pub fn with_beam(self, beam: Beam) -> AreaLight {
        AreaLight { beam, ..self }
    }

    /// Surface area of one side.
    pub fn area(&self) -> f32 {
        let parallelogram = |e: &Edges| e.edge_u.cross(e.edge_v).length();
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) => parallelogram(e),
            AreaShape::Triangle(e) => 0.5 * parallelogram(e),
            AreaShape::Analytic(shape) => shape.area(),
        }
    }

    /// Luminous power in relative units: mean luminance times area times pi, for each side. Textures count with their
    /// mean over a grid of points.
    pub fn power(&self, textures: &CompiledTextures) -> f32 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        self.mean_luminance(textures) * self.area() * PI * sides * self.beam.share_of_power()
    }

    /// Its middle, or a point near it.
    pub fn middle(&self) -> Vec3 {
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) => e.corner + (e.edge_u + e.edge_v) * 0.5,
            AreaShape::Triangle(e) => e.corner + (e.edge_u + e.edge_v) / 3.0,
            AreaShape::Analytic(shape) => {
                let bounds = shape.bounds();
                (bounds.min + bounds.max) * 0.5
            }
        }
    }

    /// Where its light comes from and goes.
    pub fn bounds(&self, textures: &CompiledTextures) -> LightBounds {
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
            return LightBounds { bounds, weight, axis, normals_rad: 0.0, emission_rad };
        }
        LightBounds {
            bounds,
            weight,
            axis: self.normal,
            normals_rad: if is_round || self.two_sided { PI } else { 0.0 },
            emission_rad: 0.5 * PI,
        }
    }

    fn mean_luminance(&self, textures: &CompiledTextures) -> f32 {
        const GRID: usize = 8;
        let cell = |i: usize| (i as f32 + 0.5) / GRID as f32;
        let points = (0..GRID * GRID).map(|i| [cell(i % GRID), cell(i / GRID)]);
        match self.radiance {
            Radiance::Constant(c) => c.luminance(),
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

    /// A point of it, uniform by area; of two-sided ones the same for both sides.
    pub fn point_by_area(&self, [a, b]: [f32; 2]) -> Vec3 {
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) => e.corner + e.edge_u * a + e.edge_v * b,
            // Folds the square onto the triangle.
            AreaShape::Triangle(e) if a + b > 1.0 => e.corner + e.edge_u * (1.0 - a) + e.edge_v * (1.0 - b),
            AreaShape::Triangle(e) => e.corner + e.edge_u * a + e.edge_v * b,
            AreaShape::Analytic(shape) => shape.point_by_area([a, b]),
        }
    }

    /// The front's unit normal at a point; `reference`, from where it is seen, counts for lights that turn.
    #[inline(always)]
    pub fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3 {
        match self.shape {
            AreaShape::Analytic(shape) => shape.normal_at(point, reference),
            _ => self.normal,
        }
    }

    /// A point of the light as seen from `reference`, with what it sends there.
    #[inline]
    pub fn sample(&self, textures: &CompiledTextures, reference: Vec3, u: [f32; 2]) -> LightSample {
        if self.is_level_with(reference) {
            return LightSample::NONE;
        }
        let LightPoint { point, pdf_solid_angle } = match &self.shape {
            AreaShape::Rectangle(e) => rectangle(e, reference).sample(u),
            AreaShape::Parallelogram(e) => parallelogram(e, reference).sample(u),
            AreaShape::Triangle(e) => triangle(e, reference).sample(u),
            AreaShape::Analytic(shape) => shape.sample(reference, u),
        };
        let normal = self.normal_at(point, reference);
        let to_light = point - reference;
        let distance = to_light.length();
        let is_lit = self.two_sided || to_light.dot(normal) < 0.0;
        if !is_lit || pdf_solid_angle <= 0.0 || distance <= 0.0 {
            return LightSample::NONE;
        }
        let wi = to_light / distance;
        LightSample {
            wi,
            target: offset_ray_origin(point, self.point_error, normal, -to_light),
            is_infinite: false,
            is_delta: false,
            radiance: self.beam.of(self.radiance_at(textures, point), normal, -wi, textures),
            pdf_solid_angle,
        }
    }

    /// Is a point in the plane of a flat light, as far as rounding tells? It sees nothing of the light, though from a point
    /// of the light itself the light would seem to fill half of all directions.
    #[inline(always)]
    pub fn is_level_with(&self, reference: Vec3) -> bool {
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) | AreaShape::Triangle(e) => {
                let height = (reference - e.corner).dot(self.normal).abs();
                height <= 4.0 * self.point_error.dot(self.normal.abs())
            }
            AreaShape::Analytic(shape) => {
                let (center, _) = shape.center_and_radius();
                let height = (reference - center).dot(self.normal).abs();
                shape.normal().is_some() && height <= 4.0 * self.point_error.dot(self.normal.abs())
            }
        }
    }

    /// Density per solid angle with which [`AreaLight::sample`] finds a point of the light from `reference`.
    #[inline]
    pub fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32 {
        match &self.shape {
            AreaShape::Rectangle(e) => rectangle(e, reference).pdf_solid_angle(point),
            AreaShape::Parallelogram(e) => parallelogram(e, reference).pdf_solid_angle(point),
            AreaShape::Triangle(e) => triangle(e, reference).pdf_solid_angle(point),
            AreaShape::Analytic(shape) => shape.pdf_solid_angle(reference, point),
        }
    }

    /// How far behind its origin a ray of its light starts for a receiver on the ray, if it does: see [`Shape::starts_behind`].
    pub fn starts_behind(&self, receiver: Vec3, ray: &Ray) -> Option<f32> {
        match &self.shape {
            AreaShape::Analytic(shape) => shape.starts_behind(receiver, ray),
            _ => Some(0.0),
        }
    }

    /// Where a point of a flat light lies along the edges.
    #[inline]
    fn edge_coordinates(&self, point: Vec3) -> [f32; 2] {
        match &self.shape {
            AreaShape::Rectangle(e) | AreaShape::Parallelogram(e) | AreaShape::Triangle(e) => {
                let (d, n) = (point - e.corner, e.edge_u.cross(e.edge_v));
                let scale = 1.0 / n.length_squared();
                [d.cross(e.edge_v).dot(n) * scale, e.edge_u.cross(d).dot(n) * scale]
            }
            AreaShape::Analytic(_) => [0.0; 2],
        }
    }

    /// Bound on the rounding error of its points: shadow rays end that far before it.
    #[inline(always)]
    pub fn point_error(&self) -> Vec3 {
        self.point_error
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
