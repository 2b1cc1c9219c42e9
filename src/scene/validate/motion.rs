//! What moves while the picture is taken: objects. (Cameras and lights are checked with their motion.)

use super::findings::{Findings, Place};
use crate::math::DAffine3;
use crate::scene::{Motion, Scene};

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let motion = &scene.motion;
    for (index, instance) in scene.instances.iter().enumerate() {
        if let Motion::Keyed(number) = instance.motion {
            let place = Place { list: "instances", index, name: &instance.name };
            let exists = (number as usize) < motion.instances.len();
            findings.require(exists, place, "motion", number, "the number of one of the scene's motions");
        }
    }
    let lists = [("motion.quads", &motion.quads), ("motion.shapes", &motion.shapes)];
    let listed = lists.iter().flat_map(|(list, all)| all.iter().map(move |(i, moving)| (*list, *i, moving)));
    let instances = motion.instances.iter().enumerate().map(|(i, moving)| ("motion.instances", i, moving));
    for (list, index, moving) in listed.chain(instances) {
        let place = Place { list, index, name: "" };
        findings.require(
            moving.all().all(DAffine3::is_finite),
            place,
            "keys",
            moving.keys.len(),
            "finite transforms",
        );
    }
    for (&index, moving) in &motion.meshes {
        let mesh = scene.meshes.get(index);
        let place = Place { list: "motion.meshes", index, name: mesh.map_or("", |m| &m.name) };
        findings.require(mesh.is_some(), place, "mesh", index, "one of the scene's meshes");
        let Some(mesh) = mesh else { continue };
        let counts = (mesh.positions.len(), mesh.normals.len());
        let fits = moving.all().all(|key| (key.positions.len(), key.normals.len()) == counts);
        findings.require(
            fits,
            place,
            "keys",
            moving.keys.len(),
            "as many positions and normals as the mesh has",
        );
    }
}
