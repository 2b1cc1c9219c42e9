//! Texture coordinates: UV sets with affine maps, world space, triplanar projection, and ray footprints.

use crate::math::{Vec2, Vec3};
use crate::scene::{Mapping, TextureTransform};

/// The inputs of texture lookups at a surface point.
#[derive(Clone, Copy, Debug, Default)]
pub struct TexturePoint {
    /// The first two sets of texture coordinates.
    pub uv: [Vec2; 2],
    /// The point in the scene's world space.
    pub world: Vec3,
    /// Unit geometric normal in world space.
    pub normal: Vec3,
    /// Cosine between the shading normal, before normal maps, and the direction from which it is seen; of both sides alike.
    pub cosine: f32,
    /// Width of the ray footprint, metres; 0 for a point lookup.
    pub width: f32,
    /// How much each set of texture coordinates changes over a metre.
    pub uv_per_metre: [f32; 2],
}

/// An affine map of texture coordinates with its set.
#[derive(Clone, Copy, Debug)]
pub(super) struct UvMap {
    set: usize,
    x: Vec2,
    y: Vec2,
    offset: Vec2,
    /// By how much the map widens footprints.
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

    /// A key that is equal for mappings that do the same.
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
    /// With the reciprocal of the size.
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

/// The three projections along the world's axes with their weights, which add up to 1. Seen from outside, images stand
/// upright on walls and aren't mirrored; on floors their top is towards -z.
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
