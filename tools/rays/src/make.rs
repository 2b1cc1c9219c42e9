//! Generated scenes.

use crate::world::{Random, World};
use oscura::accel::{AccelInstance, Geometry};
use oscura::math::{DAffine3, DQuat, DVec3, Vec3};

/// Names of generated scenes.
pub const SCENES: [&str; 4] = ["cornell", "rocks", "terrain", "field"];

/// A generated scene by name.
pub fn scene(name: &str) -> Option<World> {
    match name {
        "cornell" => Some(World::flat(cornell())),
        "rocks" => Some(World::flat(rocks())),
        "terrain" => Some(World::flat(terrain())),
        "field" => Some(field()),
        _ => None,
    }
}

/// 32 triangles: a room without its front, a light under the ceiling and two blocks, similar to the Cornell box.
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

/// About 100,000 triangles: sixteen dented spheres on a floor, in a room of five walls.
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

/// A thousand instances of one boulder of 100,000 triangles on a plain: 100 million triangles in total.
fn field() -> World {
    let (mut plain, mut boulder) = (Geometry::default(), Geometry::default());
    sheet(&mut plain, 2, 2, |u, v| Vec3::new(u * 80.0 - 40.0, 0.0, v * 80.0 - 40.0));
    sheet(&mut boulder, 320, 160, |u, v| {
        let (phi, theta) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
        let d = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        d * (1.0
            + 0.1 * (d * 7.0).map(f32::sin).element_sum()
            + 0.01 * (d * 90.0).map(f32::sin).element_sum())
    });
    let mut random = Random(3);
    let mut number = |low: f64, high: f64| low + (high - low) * f64::from(random.unit());
    let instances = (0..1000).map(|_| {
        let at = DVec3::new(number(-38.0, 38.0), number(0.0, 0.5), number(-38.0, 38.0));
        let turn = DQuat::from_rotation_y(number(0.0, 6.3)) * DQuat::from_rotation_x(number(0.0, 6.3));
        let scale = DVec3::new(number(0.5, 1.5), number(0.5, 1.5), number(0.5, 1.5));
        let world_from_object = DAffine3::from_scale_rotation_translation(scale, turn, at);
        AccelInstance { geometry: 1, world_from_object }
    });
    World { instances: instances.collect(), geometries: vec![plain, boulder] }
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
