//! What is read once for all moments of a file: materials, images, and the meshes that nothing deforms.

use super::ies_lights::Profiles;
use super::materials::Materials;
use super::meshes::Skipped;
use super::report::Sound;
use crate::image::Image;
use crate::scene::{Mesh, MeshId, Scene};
use std::collections::HashMap;

/// Everything that outlives a moment. Lists only grow, so that ids stay what they are.
#[derive(Default)]
pub(super) struct Kept {
    /// The materials and textures met so far.
    pub materials: Materials,
    /// The images that they need, in the order of the needs.
    pub images: Vec<Image>,
    /// Meshes of the file, by index, without the deformation by a skin or morph targets; absent while a scene has them.
    pub still: HashMap<usize, Vec<Mesh>>,
    /// The profiles of EXT_lights_ies met so far.
    pub profiles: Profiles,
    /// The picture of EXT_lights_image_based, once it was asked for.
    pub surroundings: Option<Sound<Image>>,
    /// What the meshes left out.
    pub skipped: Skipped,
    /// Images turned out to be none: materials that have been read refer to them.
    loses_textures: bool,
}

/// Where a scene has what became of a mesh of the file that nothing deforms.
pub(super) struct StillMesh {
    /// The mesh of the file.
    pub mesh: usize,
    /// The scene's meshes, in a row.
    pub meshes: Vec<MeshId>,
}

impl Kept {
    /// These images, with what is said of them, can't be read.
    pub fn lose_textures(&mut self, unreadable: Vec<(usize, String)>) {
        self.loses_textures |= !unreadable.is_empty();
        self.materials.textures.unreadable.extend(unreadable);
    }

    /// Forgets the materials if some refer to images that can't be read; then they are to be read again, without them.
    pub fn forget_lost_textures(&mut self) -> bool {
        let loses = std::mem::take(&mut self.loses_textures);
        if loses {
            self.forget_materials();
        }
        loses
    }

    /// Forgets the materials and the meshes, which refer to them by number. Images stay decoded.
    pub fn forget_materials(&mut self) {
        self.materials.forget();
        self.still.clear();
    }

    /// Takes meshes back from a scene that is not needed any more. Where it lacks any of them, they are read again.
    pub fn take_back(&mut self, scene: &mut Scene, still: Vec<StillMesh>) {
        for StillMesh { mesh, meshes } in still {
            let taken = meshes.iter().map(|id| scene.meshes.get_mut(id.index()).map(std::mem::take));
            if let Some(taken) = taken.collect() {
                self.still.insert(mesh, taken);
            }
        }
    }
}
