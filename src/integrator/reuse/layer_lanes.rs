//! What a wave keeps to share the layers of its paths: see [`super::layers`].

use super::super::radiance_buffer::Layers;
use super::super::wave::RgbLanes;
use bytemuck::Zeroable;

/// What a wave keeps to share the layers of its paths, by place.
#[derive(Default)]
pub struct SharedLayers {
    /// Of light passes: the diffuse parts of what pairs would get, of the throughputs of suffixes, and of what prefixes got;
    /// nothing without passes.
    pub diffuse: Option<Box<Diffuse>>,
    /// Of groups of lights.
    pub groups: Vec<Box<GroupLanes>>,
}

/// What concerns the diffuse passes.
#[derive(Zeroable)]
pub struct Diffuse {
    pub value: RgbLanes,
    pub throughput: RgbLanes,
    pub gained: RgbLanes,
}

/// What leaves suffixes of the light of a group, and what prefixes got of it.
#[derive(Zeroable)]
pub struct GroupLanes {
    pub radiance: RgbLanes,
    pub gained: RgbLanes,
}

impl SharedLayers {
    /// Empties them for a wave.
    pub fn reset(&mut self, layers: Layers) {
        self.diffuse = layers.has_passes().then(bytemuck::zeroed_box);
        self.groups.clear();
        self.groups.resize_with(layers.groups(), bytemuck::zeroed_box);
    }
}
