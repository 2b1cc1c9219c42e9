//! Scenes and the rays that a path tracer would send into them.

use oscura::accel::{Accel, BuildOptions, Geometry};
use oscura::math::{Bounds3, Frame, Hit, Ray, Vec3};

/// The scenes that are computed rather than read.
pub const SCENES: [&str; 3] = ["cornell", "rocks", "terrain"];

/// Rays along an edge of the picture.
const SIDE: usize = 1024;

/// A small random number generator (PCG, O'Neill 2014).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        (x.rotate_right((self.0 >> 59) as u32) >> 8) as f32 / 16_777_216.0
    }
}

/// A computed scene by its name.
pub fn scene(name: &str) -> Option<Geometry> {
    match name {
        "cornell" => Some(cornell()),
        "rocks" => Some(rocks()),
        "terrain" => Some(terrain()),
        _ => None,
    }
}

/// 32 triangles: a room without its front, a lamp under the ceiling and two blocks, about as in the Cornell box.
fn cornell() -> Geometry {
    let mut mesh = Geometry::default();
    let mut wall = |corner: Vec3, u: Vec3, v: Vec3| {
        sheet(&mut mesh, 1, 1, |s, t| corner + u * s + v * t);
    };
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    wall(Vec3::ZERO, x, z);
    wall(y, z, x);
    wall(Vec3::ZERO, y, x);
    wall(Vec3::ZERO, z, y);
    wall(x, y, z);
    wall(Vec3::new(0.4, 0.998, 0.4), x * 0.2, z * 0.2);
    for (angle, corner, size) in [
        (0.3f32, Vec3::new(0.15, 0.0, 0.2), Vec3::new(0.3, 0.6, 0.3)),
        (-0.3, Vec3::new(0.52, 0.0, 0.5), Vec3::splat(0.3)),
    ] {
        let (u, v) = (Vec3::new(angle.cos(), 0.0, -angle.sin()), Vec3::new(angle.sin(), 0.0, angle.cos()));
        let (u, h, v) = (u * size.x, y * size.y, v * size.z);
        wall(corner + h, v, u);
        for (foot, side) in [(corner, u), (corner + u, v), (corner + u + v, -u), (corner + v, -v)] {
            wall(foot, h, side);
        }
    }
    mesh
}

/// About 100,000 triangles: sixteen dented balls on a floor, in a room of five walls.
fn rocks() -> Geometry {
    let mut mesh = Geometry::default();
    let mut random = Random(5);
    for i in 0..16 {
        let center = Vec3::new((i % 4) as f32 * 2.0 - 3.0, 0.8, (i / 4) as f32 * 2.0 - 3.0);
        let dents: Vec<Vec3> =
            (0..6).map(|_| Vec3::new(random.unit(), random.unit(), random.unit()) * 6.0).collect();
        sheet(&mut mesh, 80, 40, |u, v| {
            let (phi, theta) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
            let d = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            let dent: f32 = dents.iter().map(|k| (k.dot(d) * 2.0).sin()).sum();
            center + d * (0.8 + 0.05 * dent)
        });
    }
    let room = |p: Vec3| Vec3::new(p.x * 5.0, p.y * 5.0, p.z * 5.0);
    sheet(&mut mesh, 2, 2, |u, v| room(Vec3::new(u * 2.0 - 1.0, 0.0, v * 2.0 - 1.0)));
    sheet(&mut mesh, 2, 2, |u, v| room(Vec3::new(u * 2.0 - 1.0, 1.5, 1.0 - v * 2.0)));
    sheet(&mut mesh, 2, 2, |u, v| room(Vec3::new(-1.0, u * 1.5, v * 2.0 - 1.0)));
    sheet(&mut mesh, 2, 2, |u, v| room(Vec3::new(1.0, u * 1.5, v * 2.0 - 1.0)));
    sheet(&mut mesh, 2, 2, |u, v| room(Vec3::new(u * 2.0 - 1.0, v * 1.5, -1.0)));
    mesh
}

/// About 2,000,000 triangles: hills with thousands of cones on them.
fn terrain() -> Geometry {
    let height = |x: f32, z: f32| {
        (0..7).fold(0.0, |sum, octave| {
            let f = 0.35 * 2f32.powi(octave);
            sum + 1.6 / f * ((x * f + octave as f32).sin() * (z * f * 1.1 - octave as f32).cos()) * 0.35
        })
    };
    let mut mesh = Geometry::default();
    sheet(&mut mesh, 800, 800, |u, v| {
        let (x, z) = (u * 40.0 - 20.0, v * 40.0 - 20.0);
        Vec3::new(x, height(x, z), z)
    });
    let mut random = Random(9);
    for _ in 0..6000 {
        let (x, z) = (random.unit() * 38.0 - 19.0, random.unit() * 38.0 - 19.0);
        let (r, h, ground) = (0.05 + 0.15 * random.unit(), 0.4 + random.unit(), height(x, z));
        sheet(&mut mesh, 12, 5, |u, v| {
            let phi = u * std::f32::consts::TAU;
            let r = r * (1.0 - v) * (1.0 + 0.3 * (phi * 5.0).sin());
            Vec3::new(x + r * phi.cos(), ground + h * v, z + r * phi.sin())
        });
    }
    mesh
}

/// A grid of `nu * nv` cells over a surface, two triangles each.
fn sheet(mesh: &mut Geometry, nu: u32, nv: u32, point: impl Fn(f32, f32) -> Vec3) {
    let first = mesh.positions.len() as u32;
    for j in 0..=nv {
        for i in 0..=nu {
            mesh.positions.push(point(i as f32 / nu as f32, j as f32 / nv as f32).to_array());
        }
    }
    for j in 0..nv {
        for i in 0..nu {
            let a = first + j * (nu + 1) + i;
            let (b, c, d) = (a + 1, a + nu + 1, a + nu + 2);
            mesh.triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
}

/// The ray sets of a scene by their names.
pub fn ray_sets(mesh: &Geometry) -> Vec<(&'static str, Vec<Ray>)> {
    let accel = Accel::build(std::slice::from_ref(mesh), &[], &BuildOptions::default());
    let bounds = Bounds3::of(mesh.positions.iter().map(|p| Vec3::from(*p)));
    let mut random = Random(1);
    let primary = camera_rays(&bounds);
    let points = surface(mesh, &accel, &primary);
    let first = bounce(&points, &mut random);
    let again = surface(mesh, &accel, &first);
    let second = bounce(&again, &mut random);
    let shadow = shadow_rays(&points, &bounds, &mut random);
    vec![("primary", primary), ("bounce1", first), ("bounce2", second), ("shadow", shadow)]
}

/// Rays of a camera that looks at the scene from above one side, in tiles of 32 x 32.
fn camera_rays(bounds: &Bounds3) -> Vec<Ray> {
    let extent = bounds.extent();
    let target = bounds.center() - Vec3::Y * extent.y * 0.1;
    let eye = target + Vec3::new(0.25, 0.35, 0.9) * extent.max_element() * 1.05;
    let frame = Frame::from_normal((target - eye).normalize());
    let (right, up) = {
        let right = frame.n.cross(Vec3::Y).normalize();
        (right, right.cross(frame.n))
    };
    let mut rays = Vec::with_capacity(SIDE * SIDE);
    for tile in 0..(SIDE / 32) * (SIDE / 32) {
        for pixel in 0..1024 {
            let x = (tile % (SIDE / 32)) * 32 + pixel % 32;
            let y = (tile / (SIDE / 32)) * 32 + pixel / 32;
            let film = |i: usize| (i as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0;
            let direction = frame.n + (right * film(x) - up * film(y)) * 0.45;
            rays.push(Ray::new(eye, direction.normalize()));
        }
    }
    rays
}

/// Points that rays hit, with the normal on the ray's side.
fn surface(mesh: &Geometry, accel: &Accel, rays: &[Ray]) -> Vec<(Vec3, Vec3)> {
    let mut hits = vec![Hit::MISS; rays.len()];
    accel.closest(rays, &mut hits);
    let mut points = Vec::with_capacity(rays.len());
    for (ray, hit) in rays.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
        let [a, b, c] = mesh.triangles[hit.prim as usize].map(|i| Vec3::from(mesh.positions[i as usize]));
        let n = (b - a).cross(c - a).normalize_or_zero();
        let n = if n.dot(ray.direction) > 0.0 { -n } else { n };
        let p = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
        points.push((p + n * (p.abs().max_element() * 1e-5), n));
    }
    points
}

/// A cosine-distributed direction from each point.
fn bounce(points: &[(Vec3, Vec3)], random: &mut Random) -> Vec<Ray> {
    let direction = |n: Vec3, random: &mut Random| {
        let (r, phi) = (random.unit().sqrt(), random.unit() * std::f32::consts::TAU);
        let z = (1.0 - r * r).max(1e-6).sqrt();
        Frame::from_normal(n).to_world(Vec3::new(r * phi.cos(), r * phi.sin(), z))
    };
    points.iter().map(|(p, n)| Ray::new(*p, direction(*n, random))).collect()
}

/// A segment from each point to a random one on a square above the scene.
fn shadow_rays(points: &[(Vec3, Vec3)], bounds: &Bounds3, random: &mut Random) -> Vec<Ray> {
    let (center, extent) = (bounds.center(), bounds.extent());
    let mut light = || {
        let at = Vec3::new(random.unit() - 0.5, 0.0, random.unit() - 0.5) * extent * 0.4;
        center + at + Vec3::Y * extent.y * 0.49
    };
    points.iter().map(|(p, _)| Ray::segment(*p, light() - *p)).collect()
}
