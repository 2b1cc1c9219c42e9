//! Samplers of rectangles, triangles, parallelograms, spheres and disks against the chi-square harness and closed forms.

use oscura::math::{DVec3, Vec3};
use oscura::sampling::chi2::{Chi2, Random};
use oscura::shape::{
    Disk, LightPoint, Shape, SphereSampler, SphericalParallelogram, SphericalRectangle, SphericalTriangle,
};

/// A flat light: corner and edges, seen from `reference`.
#[derive(Clone, Copy)]
struct Flat {
    corner: Vec3,
    e1: Vec3,
    e2: Vec3,
    reference: Vec3,
}

const fn flat(corner: [f32; 3], e1: [f32; 3], e2: [f32; 3], reference: [f32; 3]) -> Flat {
    Flat {
        corner: Vec3::from_array(corner),
        e1: Vec3::from_array(e1),
        e2: Vec3::from_array(e2),
        reference: Vec3::from_array(reference),
    }
}

/// Overhead, off to the side, grazing, very near, above the corner, far (sampled by area), tiny, elongated and rotated.
const RECTANGLES: [Flat; 10] = [
    flat([-1.0, 2.0, -0.5], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
    flat([5.0, 2.0, -0.5], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
    flat([1.0, 0.01, -0.5], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
    flat([-1.0, 0.01, -0.5], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
    flat([0.0, 0.3, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
    flat([-3.0, 90.0, 2.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
    flat([-3.0, 25.0, 2.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
    flat([-1e-4, 1e-3, -2e-4], [2e-4, 0.0, 0.0], [0.0, 0.0, 3e-4], [0.0, 0.0, 0.0]),
    flat([-50.0, 1.0, -0.05], [100.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0]),
    flat([3.0, 4.0, 5.0], [1.2, 1.6, 0.0], [-0.8, 0.6, 0.5], [2.0, 4.5, 7.0]),
];

/// Pdf with respect to the unit square of plane coordinates.
fn density(f: &Flat, p: [f64; 2], pdf_solid_angle: impl Fn(Vec3) -> f32) -> f64 {
    let (e1, e2) = (f.e1.as_dvec3(), f.e2.as_dvec3());
    let point = f.corner.as_dvec3() + e1 * p[0] + e2 * p[1];
    let to_point = point - f.reference.as_dvec3();
    let projected = to_point.dot(e1.cross(e2)).abs() / to_point.length().powi(3);
    f64::from(pdf_solid_angle(point.as_vec3())) * projected
}

/// Plane coordinates of a sampled point.
fn coordinates(f: &Flat, sample: LightPoint) -> Option<[f64; 2]> {
    let (e1, e2) = (f.e1.as_dvec3(), f.e2.as_dvec3());
    let d = sample.point.as_dvec3() - f.corner.as_dvec3();
    let n = e1.cross(e2);
    let s = 1.0 / n.length_squared();
    Some([d.cross(e2).dot(n) * s, e1.cross(d).dot(n) * s])
}

/// Solid angle of a triangle in f64 (Van Oosterom, Strackee 1983).
fn exact_solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let (a, b, c) = (a.normalize(), b.normalize(), c.normalize());
    2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

fn corners(f: &Flat) -> [DVec3; 4] {
    let (p, e1, e2) = (f.corner.as_dvec3() - f.reference.as_dvec3(), f.e1.as_dvec3(), f.e2.as_dvec3());
    [p, p + e1, p + e1 + e2, p + e2]
}

#[test]
fn rectangles_pass_chi_square() {
    for (i, f) in RECTANGLES.iter().enumerate() {
        let r = SphericalRectangle::new(f.corner, f.e1, f.e2, f.reference);
        Chi2::new(&format!("rectangle {i}"), RECTANGLES.len()).assert(
            |u| coordinates(f, r.sample([u[0], u[1]])),
            |p| density(f, p, |point| r.pdf_solid_angle(point)),
        );
    }
}

#[test]
fn rectangles_subtend_the_exact_solid_angle() {
    for (i, f) in RECTANGLES.iter().enumerate() {
        let [a, b, c, d] = corners(f);
        let exact = exact_solid_angle(a, b, c) + exact_solid_angle(a, c, d);
        let found = f64::from(SphericalRectangle::new(f.corner, f.e1, f.e2, f.reference).solid_angle());
        assert!((found / exact - 1.0).abs() < 1e-5, "{i}: {found} {exact}");
    }
}

fn parallelogram_cases() -> Vec<Flat> {
    let mut cases = RECTANGLES.to_vec();
    for f in RECTANGLES {
        cases.push(Flat { e2: f.e2 + f.e1 * 0.7, ..f });
    }
    cases
}

#[test]
fn parallelograms_pass_chi_square() {
    let cases = parallelogram_cases();
    for (i, f) in cases.iter().enumerate() {
        let r = SphericalParallelogram::new(f.corner, f.e1, f.e2, f.reference);
        let [a, b, c, d] = corners(f);
        let exact = exact_solid_angle(a, b, c) + exact_solid_angle(a, c, d);
        assert!((f64::from(r.solid_angle()) / exact - 1.0).abs() < 1e-5, "{i}");
        Chi2::new(&format!("parallelogram {i}"), cases.len()).assert(
            |u| coordinates(f, r.sample([u[0], u[1]])),
            |p| density(f, p, |point| r.pdf_solid_angle(point)),
        );
    }
}

#[test]
fn triangles_pass_chi_square() {
    let cases = parallelogram_cases();
    for (i, f) in cases.iter().enumerate() {
        let t = SphericalTriangle::new(f.corner, f.corner + f.e1, f.corner + f.e2, f.reference);
        let [a, b, _, d] = corners(f);
        let exact = exact_solid_angle(a, b, d);
        assert!((f64::from(t.solid_angle()) / exact - 1.0).abs() < 1e-5, "{i}");
        // The unit square folds onto the triangle: (x, y) -> weights (x (1 - y), y), Jacobian 1 - y.
        Chi2::new(&format!("triangle {i}"), cases.len()).assert(
            |u| {
                let [w1, w2] = coordinates(f, t.sample([u[0], u[1]]))?;
                Some([if w2 < 1.0 { w1 / (1.0 - w2) } else { 0.0 }, w2])
            },
            |p| density(f, [p[0] * (1.0 - p[1]), p[1]], |point| t.pdf_solid_angle(point)) * (1.0 - p[1]),
        );
    }
}

#[test]
fn spheres_pass_chi_square() {
    // (distance of the reference point from the centre) / radius: from inside, just above the surface, near, far, tiny.
    let distances = [0.0f32, 0.5, 0.999, 1.0001, 1.01, 1.5, 4.0, 300.0, 1e6];
    for d in distances {
        let (center, radius) = (Vec3::new(0.1, -0.2, 0.3), 0.5f32);
        let axis = Vec3::new(0.48, 0.6, -0.64);
        let s = SphereSampler::new(center, radius, center - axis * (d * radius));
        let reference = (center - axis * (d * radius)).as_dvec3();
        let real = (center.as_dvec3() - reference).length() / f64::from(radius);
        let toward = (reference - center.as_dvec3()).normalize_or(DVec3::Z);
        let x = toward.any_orthonormal_vector();
        let y = toward.cross(x);
        // Points by azimuth and height 1 - cos alpha on the visible cap, or the whole sphere.
        let height = if real <= 1.0 { 2.0 } else { 1.0 - 1.0 / real };
        let measure = std::f64::consts::TAU * height * f64::from(radius * radius);
        Chi2::new(&format!("sphere from {d} radii"), distances.len()).assert(
            |u| {
                let n = (s.sample([u[0], u[1]]).point - center).as_dvec3() / f64::from(radius);
                let (a, b, c) = (n.dot(x), n.dot(y), n.dot(toward));
                Some([b.atan2(a) / std::f64::consts::TAU + 0.5, (1.0 - c / n.length()) / height])
            },
            |p| {
                let c = 1.0 - p[1] * height;
                let r = (1.0 - c * c).max(0.0).sqrt();
                let (sin, cos) = ((p[0] - 0.5) * std::f64::consts::TAU).sin_cos();
                let n = x * (r * cos) + y * (r * sin) + toward * c;
                let point = center.as_dvec3() + n * f64::from(radius);
                let to = point - reference;
                let pdf = f64::from(s.pdf_solid_angle());
                pdf * to.dot(n).abs() / to.length().powi(3) * measure
            },
        );
    }
}

#[test]
fn disks_pass_chi_square() {
    // Overhead, to the side, grazing, hardly above the disk, far.
    let references =
        [[0.0, 2.0, 0.0], [3.0, 1.0, 0.5], [4.0, 0.05, 1.0], [0.2, 1e-3, 0.1], [30.0, 90.0, 1.0]];
    for (i, reference) in references.into_iter().enumerate() {
        let disk = Disk { center: Vec3::new(0.1, -0.2, 0.3), axis: Vec3::new(0.48, 0.6, -0.64) * 0.7 };
        let normal = disk.axis.as_dvec3().normalize();
        let x = normal.any_orthonormal_vector();
        let y = normal.cross(x);
        let [a, h, b] = reference.map(f64::from);
        let from = disk.center.as_dvec3() + x * a + y * b + normal * h;
        let radius = disk.axis.as_dvec3().length();
        // Points by azimuth and squared distance from the centre: uniform by area.
        Chi2::new(&format!("disk {i}"), references.len()).assert(
            |u| {
                let d = disk.sample(from.as_vec3(), [u[0], u[1]]).point.as_dvec3() - disk.center.as_dvec3();
                let azimuth = d.dot(y).atan2(d.dot(x)) / std::f64::consts::TAU + 0.5;
                Some([azimuth, d.length_squared() / (radius * radius)])
            },
            |p| {
                let (sin, cos) = ((p[0] - 0.5) * std::f64::consts::TAU).sin_cos();
                let point = disk.center.as_dvec3() + (x * cos + y * sin) * (p[1].sqrt() * radius);
                let to = point - from;
                let pdf = f64::from(disk.pdf_solid_angle(from.as_vec3(), point.as_vec3()));
                let area = std::f64::consts::PI * radius * radius;
                pdf * to.dot(normal).abs() / to.length().powi(3) * area
            },
        );
    }
}

#[test]
fn sphere_solid_angle_is_exact_for_near_and_far() {
    for d in [1.00001f64, 1.5, 10.0, 1e4, 1e9] {
        let found = f64::from(SphereSampler::new(Vec3::ZERO, 1.0, Vec3::X * d as f32).solid_angle());
        let sin2 = 1.0 / (f64::from(d as f32) * f64::from(d as f32));
        let exact = std::f64::consts::TAU * sin2 / (1.0 + (1.0 - sin2).sqrt());
        assert!((found / exact - 1.0).abs() < 1e-5, "{d}: {found} {exact}");
    }
}

/// Points lie on the light and pdfs are finite, for any reference point.
#[test]
fn extreme_positions_give_points_on_the_light() {
    let mut random = Random::new(11);
    let below_one = 1.0f32.next_down();
    for i in 0..200_000 {
        let scale = 10f32.powf(random.next() * 12.0 - 6.0);
        let f = RECTANGLES[i % RECTANGLES.len()];
        let mut reference =
            f.corner + f.e1 * (3.0 * random.next() - 1.0) + f.e2 * (3.0 * random.next() - 1.0);
        // In the plane, hardly above it, anywhere.
        reference += random.direction() * [0.0, 1e-7, 1e-3, scale][i / 7 % 4];
        let u = [[0.0, below_one, random.next()][i % 3], [random.next(), 0.0, below_one][i / 3 % 3]];
        let r = SphericalRectangle::new(f.corner, f.e1, f.e2, reference).sample(u);
        let p = SphericalParallelogram::new(f.corner, f.e1, f.e2, reference).sample(u);
        let t = SphericalTriangle::new(f.corner, f.corner + f.e1, f.corner + f.e2, reference).sample(u);
        for s in [r, p, t] {
            assert!(s.pdf_solid_angle >= 0.0 && s.pdf_solid_angle.is_finite(), "{i}: {s:?}");
            let c = coordinates(&f, s).unwrap();
            let slack = 1e-3;
            assert!(c.iter().all(|x| (-slack..=1.0 + slack).contains(x)), "{i}: {c:?} {s:?}");
        }
        let sphere = SphereSampler::new(f.corner, f.e1.length(), reference).sample(u);
        assert!(sphere.pdf_solid_angle >= 0.0 && sphere.pdf_solid_angle.is_finite(), "{i}: {sphere:?}");
        let away = (sphere.point - f.corner).length() / f.e1.length();
        assert!((away - 1.0).abs() < 1e-3, "{i}: {away}");
    }
}

#[test]
fn a_point_in_the_plane_has_zero_solid_angle() {
    let f = RECTANGLES[0];
    for reference in [f.corner - f.e1, f.corner + f.e1 * 0.5 + f.e2 * 0.5] {
        let r = SphericalRectangle::new(f.corner, f.e1, f.e2, reference);
        let t = SphericalTriangle::new(f.corner, f.corner + f.e1, f.corner + f.e2, f.corner - f.e1);
        assert_eq!(t.sample([0.3, 0.4]).pdf_solid_angle, 0.0);
        let pdf = r.sample([0.3, 0.4]).pdf_solid_angle;
        // Inside the rectangle the limit of the solid angle is 2 pi.
        assert!(pdf == 0.0 || (pdf * std::f32::consts::TAU - 1.0).abs() < 1e-4, "{pdf}");
    }
}
