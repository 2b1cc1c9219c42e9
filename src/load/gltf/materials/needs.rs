//! What materials need from the meshes that they are on.

/// The two sets of texture coordinates that a mesh keeps for a material, of the many that a file may have.
#[derive(Clone, Copy, Default)]
pub(in crate::load::gltf) struct UvSlots {
    /// The file's set in each slot; `None` where no texture needs one.
    pub sets: [Option<u32>; 2],
}

impl UvSlots {
    /// The slot of a set, taken now if it has none yet; `None` if both hold others. The first set goes into the first
    /// slot, which is also what materials of scene files use; others rather go into the second.
    pub fn take(&mut self, set: u32) -> Option<u32> {
        let order: &[usize] = if set == 0 { &[0] } else { &[1, 0] };
        let known = self.sets.iter().position(|s| *s == Some(set));
        let slot = known.or_else(|| order.iter().copied().find(|&slot| self.sets[slot].is_none()))?;
        self.sets[slot] = Some(set);
        Some(slot as u32)
    }
}

/// What a material needs from a mesh.
#[derive(Clone, Copy, Default)]
pub(in crate::load::gltf) struct Needs {
    /// Which sets of texture coordinates its textures use.
    pub uv_slots: UvSlots,
    /// Tangents.
    pub tangents: bool,
    /// A body: it is glass that is solid where the meshes enclose one, and thin else.
    pub body: bool,
    /// To be looked at for whether they are panes: it is glass.
    pub glass: bool,
}
