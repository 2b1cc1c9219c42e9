//! Arithmetic of numbers and vectors, with results for all arguments.

use crate::math::poly;
use crate::scene::nodes::{MappingType, MathOperation, RangeInterpolation, RotationType, VectorOperation};

type Vector = [f32; 3];

fn divide(a: f32, b: f32) -> f32 {
    if b == 0.0 { 0.0 } else { a / b }
}

/// A power; 0 for roots of negative numbers.
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
    // Small whole powers are exact products.
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

/// Quilez 2013, "Smooth minimum" (cubic).
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

fn hyperbolic(x: f32) -> (f32, f32) {
    let (up, down) = (poly::exp(x), poly::exp(-x));
    // Differences of what is nearly the same by their series.
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
        MathOperation::Radians => a * (std::f32::consts::PI / 180.0),
        MathOperation::Degrees => a * (180.0 / std::f32::consts::PI),
        _ => rounding(operation, a, b, c),
    }
}

/// Operations that round or repeat.
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

/// Functions of angles.
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
        MathOperation::SinH => hyperbolic(a).0,
        MathOperation::CosH => hyperbolic(a).1,
        _ => {
            let (sinh, cosh) = hyperbolic(a.clamp(-20.0, 20.0));
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

/// Unit length; 0 stays.
pub fn normalize(v: Vector) -> Vector {
    let length = dot(v, v).sqrt();
    if length == 0.0 { v } else { v.map(|c| c / length) }
}

/// The vector math node: a vector and a number.
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

/// Rows of the matrix that rotates about x, then y, then z.
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

/// A vector rotated about an axis of unit length (Rodrigues).
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
    let turned = match kind {
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
    each2(turned, center, |x, c| x + c)
}

/// The map range node, one component.
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
    let is_open = matches!(kind, RangeInterpolation::Linear | RangeInterpolation::Stepped);
    if clamp && is_open { result.max(to[0].min(to[1])).min(to[0].max(to[1])) } else { result }
}

/// Reflectance of unpolarised light by a dielectric, from outside.
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
