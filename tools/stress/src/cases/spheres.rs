//! Spheres of all sizes at all distances against a double-double solution.

use super::Row;
use super::meshes::{Random, build, closest};
use oscura::accel::Geometry;
use oscura::math::{DVec3, Ray};
use oscura::shape::{Analytic, Sphere};

/// Rays of the full run.
const RAYS: f64 = 4e6;
/// Rays per sphere.
const EACH: usize = 256;
/// Larger errors of t are failures.
const MAX_ULPS: f64 = 4.0;

pub fn run(effort: f64) -> Vec<Row> {
    let spheres = (RAYS * effort / EACH as f64).ceil() as usize;
    let mut random = Random::new(21);
    let (mut wrong_t, mut wrong_side, mut in_band) = (0, 0, 0);
    let mut errors: Vec<f64> = Vec::new();
    for _ in 0..spheres {
        let radius = random.power(-4.0, 8.0) as f32;
        let distance = random.power(-3.0, 8.0);
        let sphere = Sphere { center: (random.signed() * f64::from(radius)).as_vec3(), radius };
        let accel = build(&Geometry { analytic: vec![Analytic::Sphere(sphere)], ..Geometry::default() });
        let rays: Vec<Ray> = (0..EACH).map(|_| ray(&mut random, &sphere, distance)).collect();
        for (ray, hit) in rays.iter().zip(closest(&accel, &rays)) {
            let exact = solve(&sphere, ray);
            // Roots at the ray's origin are decided by the last bits of its origin.
            let near_start = exact.roots.is_some_and(|(a, b)| {
                let least = exact.scale * 1e-12;
                a.abs() < least || b.abs() < least
            });
            if exact.margin.abs() < 1e-12 || near_start {
                in_band += 1;
                continue;
            }
            let expected = exact.roots.and_then(|(a, b)| [a, b].into_iter().find(|t| *t > 0.0));
            let expected = expected.filter(|t| (*t as f32).is_normal());
            match (expected, hit.is_hit()) {
                (Some(t), true) => {
                    let ulp = f64::from((t as f32).next_up()) - f64::from(t as f32);
                    let error = (f64::from(hit.t) - t).abs() / ulp;
                    wrong_t += u64::from(error > MAX_ULPS);
                    errors.push(error);
                }
                (None, false) => {}
                _ => wrong_side += 1,
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    let median = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
    let worst = errors.last().copied().unwrap_or(0.0);
    vec![
        Row {
            what: "spheres: radius 1e-4 to 1e8 from 1e-3 to 1e8, error of t above 4 ulps".into(),
            tried: errors.len() as u64,
            wrong: wrong_t,
            worst: format!("median {median:.2}, worst {worst:.2} ulps"),
        },
        Row {
            what: "spheres: hit or miss against the exact discriminant".into(),
            tried: (spheres * EACH) as u64,
            wrong: wrong_side,
            worst: format!("{in_band} within 1e-12 of the silhouette or of the ray's start"),
        },
    ]
}

/// From outside, grazing, and from inside.
fn ray(random: &mut Random, sphere: &Sphere, distance: f64) -> Ray {
    let (center, r) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
    let out = random.signed().normalize();
    let tangent = out.cross(random.signed()).normalize();
    let origin = match random.bits() % 4 {
        0 => center + random.signed() * (r * 0.5),
        _ => center + out * (r + distance),
    };
    let target = match random.bits() % 3 {
        0 => center + tangent * (r * (1.0 + (random.unit() - 0.5) * random.power(-6.0, -1.0))),
        1 => center + random.signed() * r,
        _ => center + random.signed() * (r * 1.5),
    };
    let direction = (target - origin).normalize();
    Ray::new(origin.as_vec3(), direction.as_vec3())
}

struct Exact {
    /// The discriminant over the squared radius: its sign decides.
    margin: f64,
    roots: Option<(f64, f64)>,
    /// Magnitude of the coordinates, in units of t.
    scale: f64,
}

/// Both roots of the exact f32 inputs, with about 100 bits.
fn solve(sphere: &Sphere, ray: &Ray) -> Exact {
    let f: [Double; 3] =
        std::array::from_fn(|k| Double::sum(f64::from(ray.origin[k]), -f64::from(sphere.center[k])));
    let d: [Double; 3] = std::array::from_fn(|k| Double(f64::from(ray.direction[k]), 0.0));
    let dot = |a: &[Double; 3], b: &[Double; 3]| a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]));
    let r = Double(f64::from(sphere.radius), 0.0);
    let (a, b) = (dot(&d, &d), dot(&f, &d));
    let c = dot(&f, &f).add(r.mul(r).negative());
    let discriminant = b.mul(b).add(a.mul(c).negative());
    let margin = discriminant.0 / (a.0 * r.0 * r.0);
    let reach = DVec3::new(f[0].0, f[1].0, f[2].0).length() + r.0;
    let scale = reach / a.0.sqrt();
    if discriminant.0 < 0.0 {
        return Exact { margin, roots: None, scale };
    }
    let root = discriminant.sqrt();
    let q = if b.0 > 0.0 { b.add(root).negative() } else { root.add(b.negative()) };
    let (x, y) = (q.div(a), if q.0 == 0.0 { q.div(a) } else { c.div(q) });
    Exact { margin, roots: Some((x.min(y), x.max(y))), scale }
}

/// An unevaluated sum of two doubles (Dekker 1971, "A Floating-Point Technique for Extending the Available Precision").
#[derive(Clone, Copy)]
struct Double(f64, f64);

impl Double {
    fn sum(a: f64, b: f64) -> Double {
        let s = a + b;
        let bb = s - a;
        Double(s, (a - (s - bb)) + (b - bb))
    }
    fn product(a: f64, b: f64) -> Double {
        let p = a * b;
        Double(p, a.mul_add(b, -p))
    }
    fn add(self, other: Double) -> Double {
        let s = Double::sum(self.0, other.0);
        let t = Double::sum(self.1, other.1);
        let u = Double::sum(s.0, s.1 + t.0);
        Double::sum(u.0, u.1 + t.1)
    }
    fn mul(self, other: Double) -> Double {
        let p = Double::product(self.0, other.0);
        Double::sum(p.0, p.1 + (self.0 * other.1 + self.1 * other.0))
    }
    fn negative(self) -> Double {
        Double(-self.0, -self.1)
    }
    fn sqrt(self) -> Double {
        let x = self.0.sqrt();
        if x == 0.0 {
            return Double(0.0, 0.0);
        }
        let rest = self.add(Double::product(x, x).negative());
        Double::sum(x, rest.0 / (2.0 * x))
    }
    /// The quotient as a double.
    fn div(self, other: Double) -> f64 {
        let q = self.0 / other.0;
        let rest = self.add(other.mul(Double(q, 0.0)).negative());
        q + rest.0 / other.0
    }
}
