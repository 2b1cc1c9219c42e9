//! Size limits of 32-bit indices and of the BVH, checked before the build.

use super::plan::{InstanceMode, Plan};
use crate::accel::{Estimate, TooLarge};
use crate::error::{Error, ErrorKind, Problem, Result};
use crate::scene::{CurveBasis, Curves, Keyframes, Scene};

/// Maximum number of elements with a 32-bit index: vertices and primitives of a space, objects, materials, lights. `u32::MAX`
/// is reserved.
const MAX_INDEX: u64 = u32::MAX as u64 - 1;

/// Fails if there are problems.
pub(super) fn check(problems: Vec<Problem>) -> Result<()> {
    match problems.is_empty() {
        true => Ok(()),
        false => Err(Error { kind: ErrorKind::Input, file: None, problems, source_text: None }),
    }
}

/// Fails if a scene with its plan is too large.
pub(super) fn check_size(scene: &Scene, plan: &Plan) -> Result<()> {
    let objects = scene.instances.len() + scene.quads.len() + scene.shapes.len() + scene.curves.len();
    // All quads and shapes may be emissive; so may triangles, which the BVH limits.
    let lights = scene.lights.len() + scene.quads.len() + scene.shapes.len();
    let curves = scene.curves.iter().map(|curves| curves.points.len() as u64).sum();
    let counts = [
        ("vertices of meshes that are copied per instance", copied(scene, plan).map(|c| c.vertices).sum()),
        ("objects (instances, quads, shapes and curves)", objects as u64),
        ("lights, quads and shapes", lights as u64),
        ("materials", scene.materials.len() as u64),
        ("points of curves", curves),
    ];
    let too_many = counts.into_iter().filter(|(_, count)| *count > MAX_INDEX);
    check(too_many.map(|(what, count)| too_many_of(what, count)).collect())?;
    estimate(scene, plan).check().map_err(too_large)
}

/// Fails if the points of subdivided curves exceed 32-bit indices.
pub(super) fn check_curve_points(count: usize) -> Result<()> {
    let is_too_many = count as u64 > MAX_INDEX;
    let problem = || too_many_of("points of subdivided curves", count as u64);
    check(is_too_many.then(problem).into_iter().collect())
}

fn too_many_of(what: &str, count: u64) -> Problem {
    Problem::new("", format!("{count} {what} exceed the maximum of {MAX_INDEX}"))
        .with_help("render parts of the scene separately, or remove some of it")
}

/// The error of a scene whose BVH exceeds its address range.
pub(super) fn too_large(error: TooLarge) -> Error {
    let problems = vec![Problem::new("", error.to_string())];
    Error { kind: ErrorKind::Input, file: None, problems, source_text: None }
}

/// Size of a merged mesh.
struct Copied {
    vertices: u64,
    triangles: usize,
}

fn copied<'a>(scene: &'a Scene, plan: &'a Plan) -> impl Iterator<Item = Copied> + 'a {
    let planned_instances = plan.instances.iter().filter(|planned| planned.mode == InstanceMode::Merged);
    planned_instances.map(|planned| {
        let mesh = &scene.meshes[scene.instances[planned.index].mesh.index()];
        Copied { vertices: mesh.positions.len() as u64, triangles: mesh.triangles.len() }
    })
}

/// Estimated numbers of primitives. Curves are not subdivided yet: each span has at least one segment.
fn estimate(scene: &Scene, plan: &Plan) -> Estimate {
    let mut estimate = Estimate::default();
    copied(scene, plan).for_each(|mesh| estimate.add_triangles(mesh.triangles, 0));
    for &mesh in &plan.meshes {
        let keys = scene.motion.meshes.get(&mesh).filter(|moving| Keyframes::blurs(moving));
        estimate.add_splats(scene.meshes[mesh].splats.as_ref().map_or(0, |splats| splats.len()));
        estimate
            .add_triangles(scene.meshes[mesh].triangles.len(), keys.map_or(0, |moving| moving.keys.len()));
    }
    estimate.add_quads(scene.quads.len());
    estimate.add_analytic(scene.shapes.len());
    estimate.add_curves(scene.curves.iter().map(spans).sum());
    estimate
        .add_instances(plan.instances.iter().filter(|planned| planned.mode != InstanceMode::Merged).count());
    estimate
}

/// A lower bound on the number of spans of curves.
fn spans(curves: &Curves) -> usize {
    let of_strand = |&points: &u32| match curves.basis {
        CurveBasis::Linear | CurveBasis::CatmullRom => points.saturating_sub(1) as usize,
        CurveBasis::Bezier => points as usize / 3,
        CurveBasis::BSpline => points.saturating_sub(3) as usize,
    };
    curves.strands.iter().map(of_strand).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::plan::PlannedInstance;
    use crate::math::DAffine3;
    use crate::scene::{Instance, Mesh, MeshId, Motion, ObjectInfo, ObjectTraits, Vertices};

    /// A plan without geometry, as scenes of this size don't fit in memory.
    fn plan(copies: usize, mode: InstanceMode) -> Plan {
        let world_from_object = DAffine3::IDENTITY;
        let planned = PlannedInstance { index: 0, mode, world_from_object, geometry: 0, motion: None };
        Plan { instances: vec![planned; copies], ..Plan::default() }
    }

    #[test]
    fn too_many_copies_are_an_error() {
        let mut scene = Scene::default();
        let mesh =
            Mesh { triangles: vec![[0, 1, 2]; 1000], positions: vec![[0.0; 3]; 9000], ..Mesh::default() };
        scene.meshes.push(mesh);
        scene.instances.push(Instance {
            name: String::new(),
            mesh: MeshId(0),
            world_from_object: DAffine3::IDENTITY,
            material: None,
            motion: Motion::default(),
            traits: ObjectTraits::default(),
            info: ObjectInfo::default(),
            light_group: None,
        });
        assert!(check_size(&scene, &plan(300_000, InstanceMode::Merged)).is_ok());
        assert!(check_size(&scene, &plan(1_000_000, InstanceMode::Shared)).is_ok());
        let message =
            check_size(&scene, &plan(400_000, InstanceMode::Merged)).expect_err("too large").to_string();
        assert!(message.contains("400000000 triangles take about 32.8 GiB"), "{message}");
        let message =
            check_size(&scene, &plan(480_000, InstanceMode::Merged)).expect_err("too large").to_string();
        assert!(message.contains("4320000000 vertices of meshes"), "{message}");
        assert!(check_curve_points(1 << 32).is_err() && check_curve_points(1 << 31).is_ok());
    }

    #[test]
    fn keys_of_motion_count() {
        let mut scene = Scene::default();
        scene.meshes.push(Mesh { triangles: vec![[0, 1, 2]; 1 << 20], ..Mesh::default() });
        let plan = Plan { meshes: vec![0; 100], ..Plan::default() };
        assert!(check_size(&scene, &plan).is_ok());
        let keys = vec![Vertices::default(); 16];
        scene.motion.meshes.insert(0, Keyframes { keys, neighbours: None });
        let message = check_size(&scene, &plan).expect_err("too large").to_string();
        assert!(message.contains("104857600 triangles take about 118"), "{message}");
    }
}
