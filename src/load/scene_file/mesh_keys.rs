//! `mesh_keys` of objects: meshes that deform, by files with the same vertices at other frames.

use super::assets::Assets;
use super::builder::SceneFileBuilder;
use super::fields::Fields;
use super::transform::{read_keys, segment};
use crate::math::{DAffine3, DMat3, DVec3, Vec3};
use crate::scene::{MeshId, Motion, Moving, Vertices};

/// The vertices of a mesh at frames, in the order of time.
pub(super) struct MeshKeys {
    keys: Vec<(f64, Vertices)>,
    /// The table's frames and files, by which two objects have the same keys.
    label: String,
}

impl MeshKeys {
    /// Reads the key `mesh_keys` of an object; `None` without it or after a problem.
    pub fn read(build: &mut SceneFileBuilder, object: &Fields, assets: &mut Assets) -> Option<MeshKeys> {
        let files =
            read_keys(object, "mesh_keys", "mesh_keys", |key| key.require("mesh", key.string("mesh")))?;
        let (mut keys, mut label) = (Vec::new(), String::new());
        for (frame, file) in files {
            label += &format!("{frame} {}\n", file.value);
            keys.push((frame, assets.vertices(build, file.value, file.span)?));
        }
        Some(MeshKeys { keys, label })
    }

    /// Gives a mesh its shape at the picture's time and at the keys of the shutter interval, and its instance the keys that a mesh
    /// that deforms must have.
    ///
    /// # Errors
    /// A message, where the files have other vertices than the mesh.
    pub fn give(
        &self,
        build: &mut SceneFileBuilder,
        assets: &mut Assets,
        (id, motion, place): (MeshId, Motion, DAffine3),
    ) -> Result<Motion, String> {
        let mesh = &build.loaded.scene.meshes[id.index()];
        let count = (mesh.positions.len(), mesh.normals.len());
        for (frame, key) in &self.keys {
            let found = (key.positions.len(), key.normals.len());
            if found != count {
                let what = |(positions, normals)| format!("{positions} vertices and {normals} normals");
                let (found, own) = (what(found), what(count));
                return Err(format!("'mesh_keys' has {found} at frame {frame}, but the mesh has {own}"));
            }
        }
        let is_known = assets.has_mesh_keys(id, &self.label)?;
        let (now, shutter) = (build.frame(), build.shutter);
        let still = Moving { keys: vec![place; 2], neighbours: shutter.vectors.then_some([place; 2]) };
        if !is_known {
            let (keys, _) = shutter.keys_for(&mut |frames| self.shares(now + frames));
            let keys: Vec<Vertices> = shutter.key_frames(keys).map(|f| self.at(now + f)).collect();
            let neighbours = shutter.vectors.then(|| [self.at(now - 1.0), self.at(now + 1.0)]);
            let shape = self.at(now);
            let scene = &mut build.loaded.scene;
            let mesh = &mut scene.meshes[id.index()];
            (mesh.positions, mesh.normals) = (shape.positions, shape.normals);
            if shutter.wants_motion() {
                scene.motion.meshes.insert(id.index(), Moving { keys, neighbours });
            }
        }
        if !shutter.wants_motion() || matches!(motion, Motion::Keyed(_)) {
            return Ok(motion);
        }
        let instances = &mut build.loaded.scene.motion.instances;
        instances.push(still);
        Ok(Motion::Keyed(instances.len() as u32 - 1))
    }

    /// The share of each key at a frame, as shears, so that the tolerance of transforms applies to them.
    fn shares(&self, frame: f64) -> Vec<DAffine3> {
        let (before, share) = segment(&self.keys, frame);
        let share = share.unwrap_or(0.0);
        let of = |key: usize| match key {
            key if key == before => 1.0 - share,
            key if key == before + 1 => share,
            _ => 0.0,
        };
        let shear = |share: f64| DMat3::from_cols(DVec3::new(1.0, share, 0.0), DVec3::Y, DVec3::Z);
        (0..self.keys.len()).map(|key| DAffine3::from_mat3(shear(of(key)))).collect()
    }

    /// The vertices at a frame.
    fn at(&self, frame: f64) -> Vertices {
        let (before, share) = segment(&self.keys, frame);
        let from = &self.keys[before].1;
        let Some(share) = share.filter(|share| *share > 0.0) else { return from.clone() };
        let to = &self.keys[before + 1].1;
        let mix = |a: &[f32; 3], b: &[f32; 3]| Vec3::from(*a).lerp(Vec3::from(*b), share as f32);
        let positions = from.positions.iter().zip(&to.positions).map(|(a, b)| mix(a, b).to_array());
        let normals = from.normals.iter().zip(&to.normals);
        let normals = normals.map(|(a, b)| mix(a, b).normalize_or(Vec3::from(*a)).to_array());
        Vertices { positions: positions.collect(), normals: normals.collect() }
    }
}
