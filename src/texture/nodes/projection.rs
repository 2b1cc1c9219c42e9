//! How images lie on surfaces and on the sphere of directions, as in Cycles. The axis of spheres and tubes is z.

use crate::math::poly;
use crate::scene::nodes::{EnvironmentProjection, ImageProjection};
use std::f32::consts::PI;

/// Linear RGBA of an image at a vector: `v` is that, the footprint, and the normal in the object's space; `at` looks up coordinates.
pub fn image(
    lies: ImageProjection,
    blend: f32,
    [x, y, z, footprint, nx, ny, nz]: [f32; 7],
    at: impl Fn([f32; 2], f32) -> [f32; 4],
) -> [f32; 4] {
    let around = [x, y, z].map(|c| 2.0 * c - 1.0);
    match lies {
        ImageProjection::Flat => at([x, y], footprint),
        ImageProjection::Sphere => at(on_sphere(around), 0.0),
        ImageProjection::Tube => at(on_tube(around), 0.0),
        ImageProjection::Box => {
            let side = |c: f32, is_mirrored: bool| if is_mirrored { 1.0 - c } else { c };
            let sides = [[side(y, nx < 0.0), z], [side(x, ny > 0.0), z], [side(y, nz > 0.0), x]];
            let mut sum = [0.0; 4];
            for (uv, weight) in sides.into_iter().zip(box_weights([nx, ny, nz].map(f32::abs), blend)) {
                if weight > 0.0 {
                    let value = at(uv, 0.0);
                    sum = std::array::from_fn(|i| sum[i] + weight * value[i]);
                }
            }
            sum
        }
    }
}

fn on_sphere([x, y, z]: [f32; 3]) -> [f32; 2] {
    let length = (x * x + y * y + z * z).sqrt();
    if length == 0.0 {
        return [0.0; 2];
    }
    let u = if x == 0.0 && y == 0.0 { 0.0 } else { 0.5 * (1.0 - poly::atan2(x, y) / PI) };
    [u, 1.0 - poly::acos((z / length).clamp(-1.0, 1.0)) / PI]
}

fn on_tube([x, y, z]: [f32; 3]) -> [f32; 2] {
    match x == 0.0 && y == 0.0 {
        true => [0.0; 2],
        false => [0.5 * (1.0 - poly::atan2(x, y) / PI), 0.5 * (z + 1.0)],
    }
}

/// The shares of the sides along x, y and z by the parts of a normal: one side alone, or two or three where they meet.
fn box_weights(n: [f32; 3], blend: f32) -> [f32; 3] {
    let sum = n[0] + n[1] + n[2];
    let [x, y, z] = n.map(|c| c / sum);
    let limit = 0.5 * (1.0 + blend);
    if x > limit * (x + y) && x > limit * (x + z) {
        return [1.0, 0.0, 0.0];
    }
    if y > limit * (x + y) && y > limit * (y + z) {
        return [0.0, 1.0, 0.0];
    }
    if z > limit * (x + z) && z > limit * (y + z) {
        return [0.0, 0.0, 1.0];
    }
    if blend <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let share = |a: f32, b: f32| ((a / (a + b) - 0.5 * (1.0 - blend)) / blend).clamp(0.0, 1.0);
    if z < (1.0 - limit) * (y + x) {
        let first = share(x, y);
        return [first, 1.0 - first, 0.0];
    }
    if x < (1.0 - limit) * (y + z) {
        let first = share(y, z);
        return [0.0, first, 1.0 - first];
    }
    if y < (1.0 - limit) * (x + z) {
        let first = share(x, z);
        return [first, 0.0, 1.0 - first];
    }
    [x, y, z].map(|c| ((2.0 - limit) * c + (limit - 1.0)) / (2.0 * limit - 1.0))
}

/// Coordinates of a direction in an image of surroundings.
pub fn environment(lies: EnvironmentProjection, direction: [f32; 3]) -> [f32; 2] {
    let [x, y, z] = super::math::normalize(direction);
    match lies {
        EnvironmentProjection::Equirectangular => {
            let level = (x * x + y * y).sqrt();
            [0.5 - poly::atan2(y, x) / (2.0 * PI), poly::atan2(z, level) / PI + 0.5]
        }
        EnvironmentProjection::MirrorBall => {
            let y = y - 1.0;
            let length = 2.0 * (-0.5 * y).max(0.0).sqrt();
            let scale = if length > 0.0 { 1.0 / length } else { 1.0 };
            [0.5 * (x * scale + 1.0), 0.5 * (z * scale + 1.0)]
        }
    }
}
