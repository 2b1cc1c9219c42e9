//! Solids with coincident interfaces, and solids with inward normals, against closed forms.

use crate::dielectric_priorities::{assert_same, glass, reflectance};
use crate::support::{assert_radiance, camera, cuboid, material, measure, options, quad, tinted_solid};
use oscura::math::{DAffine3, DQuat, DVec3};
use oscura::render::Caustics;
use oscura::scene::{Environment, Instance, Light, LightKind, Material, MaterialId, Mesh, Projection, Scene};
use std::f64::consts::PI;

/// Indices, and transmittance per metre.
const GLASS: (f64, f64) = (1.52, 0.8);
const LIQUID: (f64, f64) = (1.33, 0.3);

/// Heights of the faces of a vessel and of the liquid in it.
const FACES: [f64; 4] = [0.0, 0.5, 1.3, 1.5];
/// Half the width of the liquid, and of the vessel.
const HALF: [f64; 2] = [4.0, 4.2];

/// A box of a half width between two heights, inside out or not.
fn block(mesh: &mut Mesh, [low, high]: [f64; 2], half: f64, turned: bool) {
    let first = mesh.positions.len() as u32;
    let (positions, triangles) = cuboid([-half, low, -half], [half, high, half]);
    mesh.positions.extend(positions);
    let placed = triangles.into_iter().map(|[a, b, c]| if turned { [a, c, b] } else { [a, b, c] });
    mesh.triangles.extend(placed.map(|t| t.map(|i| i + first)));
}

fn add(scene: &mut Scene, blocks: &[([f64; 2], f64, bool)], of: MaterialId, placed: DAffine3) {
    let mut mesh = Mesh::new("solid", Vec::new(), Vec::new(), of);
    let inverse = placed.inverse();
    blocks.iter().for_each(|&(heights, half, turned)| block(&mut mesh, heights, half, turned));
    for p in &mut mesh.positions {
        *p = inverse.transform_point3(p.map(f64::from).into()).as_vec3().to_array();
    }
    mesh.parts[0].triangle_count = mesh.triangles.len() as u32;
    let mesh = scene.add_mesh(mesh);
    scene.instances.push(Instance::new(mesh, placed));
}

/// The order of the two in the scene.
#[derive(Clone, Copy, Debug)]
struct Order {
    liquid_first: bool,
    /// The liquid's vertices are rounded in another object space.
    placed: bool,
    priorities: [i32; 2],
}

/// A closed glass vessel filled up to its walls.
fn vessel(scene: &mut Scene, order: Order, overlap: f64) {
    let [of_glass, of_liquid] = order.priorities;
    let wall = glass(scene, GLASS.0 as f32, GLASS.1 as f32, of_glass);
    let liquid = glass(scene, LIQUID.0 as f32, LIQUID.1 as f32, of_liquid);
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4);
    let elsewhere =
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.7), turn, DVec3::new(9.0, -3.0, 5.0));
    let placed = if order.placed { elsewhere } else { DAffine3::IDENTITY };
    let inside = [FACES[1], FACES[2]];
    let filling = [FACES[1] - overlap, FACES[2] + overlap];
    for is_liquid in [order.liquid_first, !order.liquid_first] {
        match is_liquid {
            true => add(scene, &[(filling, HALF[0] + overlap, false)], liquid, placed),
            false => {
                let shell = [([FACES[0], FACES[3]], HALF[1], false), (inside, HALF[0], true)];
                add(scene, &shell, wall, DAffine3::IDENTITY);
            }
        }
    }
}

/// Transmittance and reflectance of plane-parallel layers in a white furnace, with all inter-reflections; adjacent faces are
/// separated by a layer thickness.
fn closed_form(sine: f64, layers: &[((f64, f64), f64)]) -> f64 {
    let air = (1.0, 1.0);
    let ior = |k: usize| layers.get(k).map_or(air, |l| l.0).0;
    let above = |k: usize| if k == 0 { 1.0 } else { ior(k - 1) };
    let last = layers.len();
    let (mut back, mut through) =
        (reflectance(above(last), 1.0, sine), 1.0 - reflectance(above(last), 1.0, sine));
    for k in (0..last).rev() {
        let ((ior, left), thickness) = layers[k];
        let left = left.powf(thickness / (1.0 - (sine / ior).powi(2)).sqrt());
        let face = reflectance(above(k), ior, sine);
        let between = 1.0 / (1.0 - face * left * left * back);
        through *= (1.0 - face) * left * between;
        back = face + (1.0 - face) * (1.0 - face) * left * left * back * between;
    }
    back + through
}

fn filled(sine: f64) -> f64 {
    let thick = |k: usize| FACES[k + 1] - FACES[k];
    closed_form(sine, &[(GLASS, thick(2)), (LIQUID, thick(1)), (GLASS, thick(0))])
}

fn orders() -> impl Iterator<Item = Order> {
    let both = [false, true];
    let of = move |liquid_first| both.map(move |placed| (liquid_first, placed));
    both.into_iter().flat_map(of).flat_map(|(liquid_first, placed)| {
        [[0, 0], [1, 0], [0, 1]].map(|priorities| Order { liquid_first, placed, priorities })
    })
}

/// Absorption by Beer's law, reflection by Fresnel's equations, from either side and in either order.
#[test]
fn touching_liquid_and_glass_share_one_interface() {
    for order in orders() {
        for (sine, from_above) in [(0.0, true), (0.0, false), (0.8, true)] {
            let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
            vessel(&mut scene, order, 0.0);
            let side = if from_above { 1.0 } else { -1.0 };
            let at = DVec3::new(0.013, if from_above { FACES[3] } else { 0.0 }, 0.007);
            let eye = DVec3::new(sine, side * (1.0f64 - sine * sine).sqrt(), 0.0) * 9.0;
            scene.cameras.push(camera(at + eye, at, DVec3::Z, 1e-3));
            // The reversed order of layers, apart from reflection, gives the same sum.
            let truth = if from_above {
                filled(sine)
            } else {
                let thick = |k: usize| FACES[k + 1] - FACES[k];
                closed_form(sine, &[(GLASS, thick(0)), (LIQUID, thick(1)), (GLASS, thick(2))])
            };
            let what = format!("{order:?}, sine {sine}, from above: {from_above}");
            assert_radiance(&what, &scene, &options(8, 32, 40), truth, 5e-3);
        }
    }
}

/// Tints of touching solids, applied once per solid, multiply.
#[test]
fn tints_of_touching_solids_multiply() {
    for liquid_first in [false, true] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let (wall, liquid) = (tinted_solid(&mut scene, 0.8), tinted_solid(&mut scene, 0.05));
        for is_liquid in [liquid_first, !liquid_first] {
            let shell = [([FACES[0], FACES[3]], HALF[1], false), ([FACES[1], FACES[2]], HALF[0], true)];
            let filling = [([FACES[1], FACES[2]], HALF[0], false)];
            let (blocks, of) = if is_liquid { (&filling[..], liquid) } else { (&shell[..], wall) };
            add(&mut scene, blocks, of, DAffine3::IDENTITY);
        }
        let at = DVec3::new(0.013, FACES[3], 0.007);
        scene.cameras.push(camera(at + DVec3::Y * 9.0, at, DVec3::Z, 1e-3));
        let what = format!("liquid first: {liquid_first}");
        assert_radiance(&what, &scene, &options(16, 256, 16), 0.05 * 0.8 * 0.8, 1e-2);
    }
}

/// A camera in the liquid starts in its medium.
#[test]
fn camera_inside_a_touching_liquid() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let order = Order { liquid_first: true, placed: true, priorities: [0, 0] };
    vessel(&mut scene, order, 0.0);
    let at = DVec3::new(0.013, 1.0, 0.007);
    scene.cameras.push(camera(at, at + DVec3::Y, DVec3::Z, 1e-3));
    let (touching, _) = measure(&scene, &options(16, 128, 40));
    scene.instances.clear();
    scene.meshes.clear();
    let order = Order { placed: false, priorities: [1, 0], ..order };
    vessel(&mut scene, order, 0.001);
    let (overlapping, error) = measure(&scene, &options(16, 128, 40));
    assert!((touching - overlapping).abs() < 0.01 * overlapping + 4.0 * error, "{touching} {overlapping}");
}

/// Two touching blocks of one material merge.
#[test]
fn touching_blocks_of_the_same_glass_merge() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let of = glass(&mut scene, 1.5, 0.5, 0);
    add(&mut scene, &[([0.0, 0.5], 4.0, false)], of, DAffine3::IDENTITY);
    add(&mut scene, &[([0.5, 1.0], 4.0, false)], of, DAffine3::IDENTITY);
    let at = DVec3::new(0.013, 0.5, 0.007);
    scene.cameras.push(camera(at + DVec3::Y * 9.0, at, DVec3::Z, 1e-3));
    let truth = closed_form(0.0, &[((1.5, 0.5), 1.0)]);
    assert_radiance("two blocks", &scene, &options(16, 256, 40), truth, 5e-3);
}

/// A point light reaches the floor below a vessel by light tracing only.
#[test]
#[ignore = "means of many pictures, which take long"]
fn light_tracing_agrees_with_a_thin_overlap() {
    let lit = |order: Order, overlap: f64| {
        let mut scene = Scene::default();
        vessel(&mut scene, order, overlap);
        let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
        quad(&mut scene, [-4.0, -0.3, 4.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0], grey);
        let mut view = camera(DVec3::new(0.0, -0.1, 0.0), DVec3::new(0.0, -0.3, 0.0), DVec3::X, 1.0);
        view.projection = Projection::Orthographic { half_height: 2.0 };
        scene.cameras.push(view);
        let kind = LightKind::Point { position: DVec3::new(0.4, 3.0, 0.0) };
        scene.lights.push(Light::new(kind, [20.0 * PI as f32; 3]));
        measure(&scene, &options(32, 64, 12).caustics(Caustics::On))
    };
    let overlapping = lit(Order { liquid_first: true, placed: false, priorities: [1, 0] }, 1e-3);
    for order in orders() {
        assert_same(&format!("{order:?}"), lit(order, 0.0), overlapping, 2e-2);
    }
}

/// Nested solids, any of them with inward normals.
#[test]
fn inside_out_solids_reflect_alike() {
    for (outer, inner) in [(1.5, 2.4), (2.4, 1.5), (1.5, 1.33)] {
        for (outer_turned, inner_turned) in [(false, true), (true, false), (true, true), (false, false)] {
            let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
            let around = glass(&mut scene, outer as f32, 0.7, 0);
            let within = glass(&mut scene, inner as f32, 0.4, 0);
            add(&mut scene, &[([0.0, 1.5], 4.2, outer_turned)], around, DAffine3::IDENTITY);
            add(&mut scene, &[([0.5, 1.2], 4.0, inner_turned)], within, DAffine3::IDENTITY);
            let at = DVec3::new(0.013, 1.5, 0.007);
            scene.cameras.push(camera(at + DVec3::Y * 9.0, at, DVec3::Z, 1e-3));
            let truth = closed_form(0.0, &[((outer, 0.7), 0.3), ((inner, 0.4), 0.7), ((outer, 0.7), 0.5)]);
            let what = format!("{outer} around {inner}, turned: {outer_turned} {inner_turned}");
            assert_radiance(&what, &scene, &options(16, 64, 40), truth, 5e-3);
        }
    }
}

/// An inside-out mesh in a solid of its own material is a hole.
#[test]
fn inside_out_meshes_are_holes() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let of = glass(&mut scene, 1.5, 0.5, 0);
    add(&mut scene, &[([0.0, 1.5], 4.2, false)], of, DAffine3::IDENTITY);
    add(&mut scene, &[([0.5, 1.2], 4.0, true)], of, DAffine3::IDENTITY);
    let at = DVec3::new(0.013, 1.5, 0.007);
    scene.cameras.push(camera(at + DVec3::Y * 9.0, at, DVec3::Z, 1e-3));
    let (clear, air) = ((1.5, 0.5), (1.0, 1.0));
    let truth = closed_form(0.0, &[(clear, 0.3), (air, 0.7), (clear, 0.5)]);
    assert_radiance("hole", &scene, &options(16, 256, 40), truth, 5e-3);
}

/// A liquid on glass that overlaps a corner only, where no triangle of either has its centroid; and its bottom as a fan of many.
#[test]
fn faces_touch_where_they_share_an_area() {
    let heights = [0.0, 0.5, 1.3];
    let shift = DVec3::new(7.0, 0.0, 7.0);
    for (is_fan, sine) in [(false, 0.0), (false, 0.5), (true, 0.5)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let wall = glass(&mut scene, GLASS.0 as f32, GLASS.1 as f32, 0);
        let liquid = glass(&mut scene, LIQUID.0 as f32, LIQUID.1 as f32, 0);
        add(&mut scene, &[([heights[0], heights[1]], 4.0, false)], wall, DAffine3::IDENTITY);
        add(&mut scene, &[([heights[1], heights[2]], 4.0, false)], liquid, DAffine3::from_translation(shift));
        if is_fan {
            bottom_of_many(&mut scene.meshes[1], 64);
        }
        let at = DVec3::new(3.51, heights[2], 3.47);
        let eye = DVec3::new(sine, (1.0 - sine * sine).sqrt(), 0.0) * 1.5;
        scene.cameras.push(camera(at + eye, at, DVec3::Z, 1e-3));
        let truth = closed_form(sine, &[(LIQUID, 0.8), (GLASS, 0.5)]);
        assert_radiance(&format!("fan: {is_fan}, sine {sine}"), &scene, &options(8, 128, 40), truth, 5e-3);
    }
}

/// Replaces the bottom of a block by a fan around its centre.
fn bottom_of_many(mesh: &mut Mesh, count: usize) {
    let corners = [0, 1, 5, 4].map(|i| mesh.positions[i]);
    let is_bottom = |t: &[u32; 3]| t.iter().all(|i| [0, 1, 4, 5].contains(i));
    mesh.triangles.retain(|t| !is_bottom(t));
    let first = mesh.positions.len() as u32;
    let mix = |a: [f32; 3], b: [f32; 3], share: f32| [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * share);
    mesh.positions.push(mix(corners[0], corners[2], 0.5));
    let along = count / 4;
    for k in 0..count {
        let (side, share) = (k / along, (k % along) as f32 / along as f32);
        mesh.positions.push(mix(corners[side], corners[(side + 1) % 4], share));
    }
    let rim = |k: usize| first + 1 + (k % count) as u32;
    mesh.triangles.extend((0..count).map(|k| [first, rim(k), rim(k + 1)]));
    mesh.parts[0].triangle_count = mesh.triangles.len() as u32;
}
