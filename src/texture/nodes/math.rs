//! Functions of Cycles' shader nodes: scalar and vector math (defined for all arguments), normal and bump maps, and the
//! projections of image and environment textures. The axis of spheres and tubes is z.

use crate::math::{Vec3, poly};
use crate::scene::nodes::{
    EnvironmentProjection, ImageProjection, MappingType, MathOperation, NormalSpace, RangeInterpolation,
    RotationType, VectorOperation,
};
use std::f32::consts::PI;

type Vector = [f32; 3];

fn divide(a: f32, b: f32) -> f32 {
    if b == 0.0 { 0.0 } else { a / b }
}

/// `a` to the power of `b`; 0 for fractional powers of negative numbers.
pub fn power(a: f32, b: f32) -> f32 {
    if b == 0.0 {
        return 1.0;
    }
    if a == 0.0 {
        return 0.0;
    }
    if a < 0.0 && b != b.trunc() {
        return 0.0;
    }
    // Small integer powers are computed as products.
    if b == b.trunc() && b.abs() <= 8.0 {
        let product = (0..b.abs() as u32).fold(1.0, |p, _| p * a);
        return if b < 0.0 { 1.0 / product } else { product };
    }
    let magnitude = poly::exp(b * poly::ln(a.abs()));
    if a < 0.0 && b % 2.0 != 0.0 { -magnitude } else { magnitude }
}

fn wrap(x: f32, max: f32, min: f32) -> f32 {
    let range = max - min;
    if range == 0.0 { min } else { x - range * ((x - min) / range).floor() }
}

fn sign(x: f32) -> f32 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// Cubic smooth minimum with blend distance `k` (Quilez 2013, "Smooth minimum").
fn smooth_min(a: f32, b: f32, k: f32) -> f32 {
    if k == 0.0 {
        return a.min(b);
    }
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * h * k * (1.0 / 6.0)
}

fn sin(x: f32) -> f32 {
    poly::sin_cos(x).0
}

fn cos(x: f32) -> f32 {
    poly::sin_cos(x).1
}

fn sinh_cosh(x: f32) -> (f32, f32) {
    let (up, down) = (poly::exp(x), poly::exp(-x));
    // Taylor series near 0, where the difference of the exponentials cancels.
    let sinh = if x.abs() < 0.1 { x + x * x * x / 6.0 * (1.0 + x * x / 20.0) } else { (up - down) / 2.0 };
    (sinh, (up + down) / 2.0)
}

/// The math node.
#[inline(always)]
pub fn scalar(operation: MathOperation, a: f32, b: f32, c: f32) -> f32 {
    let flag = |condition: bool| if condition { 1.0 } else { 0.0 };
    match operation {
        MathOperation::Add => a + b,
        MathOperation::Subtract => a - b,
        MathOperation::Multiply => a * b,
        MathOperation::Divide => divide(a, b),
        MathOperation::MultiplyAdd => a * b + c,
        MathOperation::Power => power(a, b),
        MathOperation::Logarithm if a > 0.0 && b > 0.0 => divide(poly::ln(a), poly::ln(b)),
        MathOperation::Logarithm => 0.0,
        MathOperation::Sqrt => a.max(0.0).sqrt(),
        MathOperation::InverseSqrt => {
            if a > 0.0 {
                1.0 / a.sqrt()
            } else {
                0.0
            }
        }
        MathOperation::Absolute => a.abs(),
        MathOperation::Exponent => poly::exp(a),
        MathOperation::Minimum => a.min(b),
        MathOperation::Maximum => a.max(b),
        MathOperation::LessThan => flag(a < b),
        MathOperation::GreaterThan => flag(a > b),
        MathOperation::Sign => sign(a),
        MathOperation::Compare => flag(a == b || (a - b).abs() <= c.max(f32::EPSILON)),
        MathOperation::SmoothMin => smooth_min(a, b, c),
        MathOperation::SmoothMax => -smooth_min(-a, -b, c),
        MathOperation::Radians => a * (PI / 180.0),
        MathOperation::Degrees => a * (180.0 / PI),
        _ => rounding(operation, a, b, c),
    }
}

/// Rounding and periodic operations of the math node.
#[inline(always)]
fn rounding(operation: MathOperation, a: f32, b: f32, c: f32) -> f32 {
    match operation {
        MathOperation::Round => (a + 0.5).floor(),
        MathOperation::Floor => a.floor(),
        MathOperation::Ceil => a.ceil(),
        MathOperation::Trunc => a.trunc(),
        MathOperation::Fract => a - a.floor(),
        MathOperation::Modulo => {
            if b == 0.0 {
                0.0
            } else {
                a % b
            }
        }
        MathOperation::FlooredModulo => {
            if b == 0.0 {
                0.0
            } else {
                a - (a / b).floor() * b
            }
        }
        MathOperation::Wrap => wrap(a, b, c),
        MathOperation::Snap => divide(a, b).floor() * b,
        MathOperation::PingPong => {
            let turns = divide(a - b, b * 2.0);
            if b == 0.0 { 0.0 } else { ((turns - turns.floor()) * b * 2.0 - b).abs() }
        }
        _ => trigonometry(operation, a, b),
    }
}

/// Trigonometric and hyperbolic operations of the math node.
#[inline(always)]
fn trigonometry(operation: MathOperation, a: f32, b: f32) -> f32 {
    match operation {
        MathOperation::Sine => sin(a),
        MathOperation::Cosine => cos(a),
        MathOperation::Tangent => divide(sin(a), cos(a)),
        MathOperation::ArcSine => poly::asin(a.clamp(-1.0, 1.0)),
        MathOperation::ArcCosine => poly::acos(a.clamp(-1.0, 1.0)),
        MathOperation::ArcTangent => poly::atan2(a, 1.0),
        MathOperation::ArcTan2 => poly::atan2(a, b),
        MathOperation::SinH => sinh_cosh(a).0,
        MathOperation::CosH => sinh_cosh(a).1,
        _ => {
            let (sinh, cosh) = sinh_cosh(a.clamp(-20.0, 20.0));
            sinh / cosh
        }
    }
}

fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn each2(a: Vector, b: Vector, f: impl Fn(f32, f32) -> f32) -> Vector {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])]
}

/// A vector scaled to unit length; the zero vector stays zero.
pub fn normalize(v: Vector) -> Vector {
    let length = dot(v, v).sqrt();
    if length == 0.0 { v } else { v.map(|c| c / length) }
}

/// The vector math node: its vector and its scalar output.
#[inline(always)]
pub fn vector(operation: VectorOperation, a: Vector, b: Vector, c: Vector, scale: f32) -> (Vector, f32) {
    let value = match operation {
        VectorOperation::Dot => dot(a, b),
        VectorOperation::Distance => {
            let d = each2(a, b, |x, y| x - y);
            dot(d, d).sqrt()
        }
        VectorOperation::Length => dot(a, a).sqrt(),
        _ => 0.0,
    };
    let vector = match operation {
        VectorOperation::Dot | VectorOperation::Distance | VectorOperation::Length => [0.0; 3],
        VectorOperation::Add => each2(a, b, |x, y| x + y),
        VectorOperation::Subtract => each2(a, b, |x, y| x - y),
        VectorOperation::Multiply => each2(a, b, |x, y| x * y),
        VectorOperation::Divide => each2(a, b, divide),
        VectorOperation::MultiplyAdd => each2(each2(a, b, |x, y| x * y), c, |x, y| x + y),
        VectorOperation::Cross => {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        }
        VectorOperation::Project => {
            let squared = dot(b, b);
            if squared == 0.0 { [0.0; 3] } else { b.map(|x| x * (dot(a, b) / squared)) }
        }
        VectorOperation::Reflect => {
            let n = normalize(b);
            each2(a, n, |x, n| x - 2.0 * n * dot(a, normalize(b)))
        }
        VectorOperation::Refract => {
            let n = normalize(b);
            let cosine = dot(n, a);
            let k = 1.0 - scale * scale * (1.0 - cosine * cosine);
            if k < 0.0 { [0.0; 3] } else { each2(a, n, |x, n| scale * x - (scale * cosine + k.sqrt()) * n) }
        }
        VectorOperation::FaceForward => {
            if dot(b, c) < 0.0 {
                a
            } else {
                a.map(|x| -x)
            }
        }
        VectorOperation::Scale => a.map(|x| x * scale),
        VectorOperation::Normalize => normalize(a),
        VectorOperation::Absolute => a.map(f32::abs),
        VectorOperation::Power => each2(a, b, power),
        VectorOperation::Sign => a.map(sign),
        VectorOperation::Minimum => each2(a, b, f32::min),
        VectorOperation::Maximum => each2(a, b, f32::max),
        VectorOperation::Floor => a.map(f32::floor),
        VectorOperation::Ceil => a.map(f32::ceil),
        VectorOperation::Fraction => a.map(|x| x - x.floor()),
        VectorOperation::Modulo => each2(a, b, |x, y| if y == 0.0 { 0.0 } else { x % y }),
        VectorOperation::Wrap => [0, 1, 2].map(|i| wrap(a[i], b[i], c[i])),
        VectorOperation::Snap => each2(a, b, |x, y| divide(x, y).floor() * y),
        VectorOperation::Sine => a.map(sin),
        VectorOperation::Cosine => a.map(cos),
        VectorOperation::Tangent => a.map(|x| divide(sin(x), cos(x))),
    };
    (vector, value)
}

/// Rows of the matrix that rotates about x, then y, then z by angles in radians.
fn euler(angles: Vector) -> [Vector; 3] {
    let [(si, ci), (sj, cj), (sk, ck)] = angles.map(poly::sin_cos);
    [
        [cj * ck, sj * si * ck - ci * sk, sj * ci * ck + si * sk],
        [cj * sk, sj * si * sk + ci * ck, sj * ci * sk - si * ck],
        [-sj, cj * si, cj * ci],
    ]
}

fn transform(rows: &[Vector; 3], v: Vector) -> Vector {
    rows.map(|row| dot(row, v))
}

fn transpose(m: &[Vector; 3]) -> [Vector; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// The mapping node.
pub fn mapping(kind: MappingType, v: Vector, location: Vector, rotation: Vector, scale: Vector) -> Vector {
    let rows = euler(rotation);
    let scaled = || each2(v, scale, |x, s| x * s);
    match kind {
        MappingType::Point => each2(transform(&rows, scaled()), location, |x, l| x + l),
        MappingType::Texture => {
            each2(transform(&transpose(&rows), each2(v, location, |x, l| x - l)), scale, divide)
        }
        MappingType::Vector => transform(&rows, scaled()),
        MappingType::Normal => normalize(transform(&rows, each2(v, scale, divide))),
    }
}

/// A vector rotated about an axis of unit length by an angle in radians (Rodrigues' formula).
fn about_axis(v: Vector, axis: Vector, angle: f32) -> Vector {
    let (sine, cosine) = poly::sin_cos(angle);
    let along = dot(axis, v) * (1.0 - cosine);
    let across =
        [axis[1] * v[2] - axis[2] * v[1], axis[2] * v[0] - axis[0] * v[2], axis[0] * v[1] - axis[1] * v[0]];
    std::array::from_fn(|i| v[i] * cosine + across[i] * sine + axis[i] * along)
}

/// The vector rotate node.
pub fn rotate(
    kind: RotationType,
    invert: bool,
    v: Vector,
    center: Vector,
    axis: Vector,
    angle: f32,
    angles: Vector,
) -> Vector {
    let from_center = each2(v, center, |x, c| x - c);
    let angle = if invert { -angle } else { angle };
    let rotated = match kind {
        RotationType::Euler => {
            let rows = euler(angles);
            transform(&if invert { transpose(&rows) } else { rows }, from_center)
        }
        RotationType::AxisAngle if dot(axis, axis) == 0.0 => return v,
        RotationType::AxisAngle => about_axis(from_center, normalize(axis), angle),
        RotationType::X => about_axis(from_center, [1.0, 0.0, 0.0], angle),
        RotationType::Y => about_axis(from_center, [0.0, 1.0, 0.0], angle),
        RotationType::Z => about_axis(from_center, [0.0, 0.0, 1.0], angle),
    };
    each2(rotated, center, |x, c| x + c)
}

/// The map range node for one component.
pub fn map_range(
    kind: RangeInterpolation,
    clamp: bool,
    x: f32,
    from: [f32; 2],
    to: [f32; 2],
    steps: f32,
) -> f32 {
    if from[1] == from[0] {
        return 0.0;
    }
    let linear = (x - from[0]) / (from[1] - from[0]);
    let factor = match kind {
        RangeInterpolation::Linear => linear,
        RangeInterpolation::Stepped => {
            if steps > 0.0 {
                (linear * (steps + 1.0)).floor() / steps
            } else {
                0.0
            }
        }
        RangeInterpolation::SmoothStep => {
            let t = linear.clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }
        RangeInterpolation::SmootherStep => {
            let t = linear.clamp(0.0, 1.0);
            t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
        }
    };
    let result = to[0] + factor * (to[1] - to[0]);
    let is_unbounded = matches!(kind, RangeInterpolation::Linear | RangeInterpolation::Stepped);
    if clamp && is_unbounded { result.max(to[0].min(to[1])).min(to[0].max(to[1])) } else { result }
}

/// Fresnel reflectance of a dielectric for unpolarized light; `ior` is relative to the incident side.
pub fn fresnel(cosine: f32, ior: f32) -> f32 {
    let c = cosine.abs();
    let squared = ior * ior - 1.0 + c * c;
    if squared <= 0.0 {
        return 1.0;
    }
    let g = squared.sqrt();
    let a = (g - c) / (g + c);
    let b = ((g + c) * c - 1.0) / ((g - c) * c + 1.0);
    0.5 * a * a * (1.0 + b * b)
}

/// The facing output of the layer weight node.
pub fn facing(cosine: f32, blend: f32) -> f32 {
    let blend = blend.clamp(0.0, 1.0 - 1e-5);
    let exponent = if blend < 0.5 { 2.0 * blend } else { 0.5 / (1.0 - blend) };
    1.0 - if blend == 0.5 { cosine } else { power(cosine, exponent) }
}

fn to_vec3(v: &[f32]) -> Vec3 {
    Vec3::new(v[0], v[1], v[2])
}

fn mix(a: Vec3, b: Vec3, weight: f32) -> Vec3 {
    a + (b - a) * weight
}

/// The normal map node. `v` holds the strength, the colour (3), the tangent frame (9) and a flag for it, the shading normal (3), the
/// rows of the transform from world to object space (12), and the back-face flag.
pub fn normal_map(space: NormalSpace, v: &[f32; 30]) -> [f32; 3] {
    let (strength, color, frame, shading_normal, rows) =
        (v[0], &v[1..4], &v[4..14], to_vec3(&v[14..17]), &v[17..29]);
    let side = if v[29] != 0.0 { -1.0 } else { 1.0 };
    let mut n = to_vec3(color) * 2.0 - Vec3::ONE;
    let normal = if space == NormalSpace::Tangent {
        if frame[9] == 0.0 {
            return shading_normal.to_array();
        }
        let n = Vec3::new(n.x * strength, n.y * strength, 1.0 + (n.z - 1.0) * strength.clamp(0.0, 1.0));
        let rotated = to_vec3(&frame[0..3]) * n.x + to_vec3(&frame[3..6]) * n.y + to_vec3(&frame[6..9]) * n.z;
        rotated.normalize_or_zero() * side
    } else {
        if matches!(space, NormalSpace::BlenderObject | NormalSpace::BlenderWorld) {
            (n.y, n.z) = (-n.y, -n.z);
        }
        if matches!(space, NormalSpace::Object | NormalSpace::BlenderObject) {
            // Normals are transformed to world space by the inverse transpose.
            let column = |i: usize| Vec3::new(rows[i], rows[4 + i], rows[8 + i]);
            n = Vec3::new(column(0).dot(n), column(1).dot(n), column(2).dot(n));
        }
        let n = n.normalize_or_zero() * side;
        if strength == 1.0 { n } else { mix(shading_normal, n, strength.max(0.0)).normalize_or_zero() }
    };
    if normal == Vec3::ZERO { shading_normal.to_array() } else { normal.to_array() }
}

/// The bump node (Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU"). `v` holds the strength, the distance, the heights
/// at the point and at its two offsets, the normal (3) and the two steps (3 each).
pub fn bump(invert: bool, filter_width: f32, v: &[f32; 14]) -> [f32; 3] {
    let (strength, distance) = (v[0].max(0.0), if invert { -v[1] } else { v[1] });
    let (here, along_a, along_b) = (v[2], v[3], v[4]);
    let (n, a, b) = (to_vec3(&v[5..8]), to_vec3(&v[8..11]), to_vec3(&v[11..14]));
    let (ra, rb) = (b.cross(n), n.cross(a));
    let determinant = a.dot(ra);
    let gradient = ra * (along_a - here) + rb * (along_b - here);
    let perturbed = n * (filter_width * determinant.abs()) - gradient * (distance * determinant.signum());
    let perturbed = Vec3::from_array(normalize(perturbed.to_array()));
    if perturbed == Vec3::ZERO || !perturbed.is_finite() {
        return n.to_array();
    }
    mix(n, perturbed, strength).normalize_or_zero().to_array()
}

/// The image texture node: linear RGBA for a vector (3), the footprint in texture coordinates, and the object-space normal (3). `at` looks up
/// the image at texture coordinates with a footprint.
pub fn image(
    projection: ImageProjection,
    blend: f32,
    [x, y, z, footprint, nx, ny, nz]: [f32; 7],
    at: impl Fn([f32; 2], f32) -> [f32; 4],
) -> [f32; 4] {
    let centered = [x, y, z].map(|c| 2.0 * c - 1.0);
    match projection {
        ImageProjection::Flat => at([x, y], footprint),
        ImageProjection::Sphere => at(on_sphere(centered), 0.0),
        ImageProjection::Tube => at(on_tube(centered), 0.0),
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

/// Weights of the projections along x, y and z for the absolute components of a normal; `blend`, 0..1, is the width of the transitions.
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
    let weight = |a: f32, b: f32| ((a / (a + b) - 0.5 * (1.0 - blend)) / blend).clamp(0.0, 1.0);
    if z < (1.0 - limit) * (y + x) {
        let first = weight(x, y);
        return [first, 1.0 - first, 0.0];
    }
    if x < (1.0 - limit) * (y + z) {
        let first = weight(y, z);
        return [0.0, first, 1.0 - first];
    }
    if y < (1.0 - limit) * (x + z) {
        let first = weight(x, z);
        return [first, 0.0, 1.0 - first];
    }
    [x, y, z].map(|c| ((2.0 - limit) * c + (limit - 1.0)) / (2.0 * limit - 1.0))
}

/// Texture coordinates of a direction in an environment image.
pub fn environment(projection: EnvironmentProjection, direction: [f32; 3]) -> [f32; 2] {
    let [x, y, z] = normalize(direction);
    match projection {
        EnvironmentProjection::Equirectangular => {
            let horizontal = (x * x + y * y).sqrt();
            [0.5 - poly::atan2(y, x) / (2.0 * PI), poly::atan2(z, horizontal) / PI + 0.5]
        }
        EnvironmentProjection::MirrorBall => {
            let y = y - 1.0;
            let length = 2.0 * (-0.5 * y).max(0.0).sqrt();
            let scale = if length > 0.0 { 1.0 / length } else { 1.0 };
            [0.5 * (x * scale + 1.0), 0.5 * (z * scale + 1.0)]
        }
    }
}
