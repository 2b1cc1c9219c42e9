//! What a wave keeps to share the layers of its paths: see [`super::layers`].

use super::super::lanes::{LENGTH, RgbLanes};
use super::super::layers::Layers;

const BLACK: RgbLanes = [[0.0; LENGTH]; 3];

/// What a wave keeps to share the layers of its paths, by place.
#[derive(Default)]
pub struct SharedLayers {
    /// Of light passes: the diffuse parts of what pairs would get, of the throughputs of suffixes, and of what prefixes got;
    /// nothing without passes.
    pub diffuse: Option<Box<Diffuse>>,
    /// Of groups of lights.
    pub groups: Vec<GroupLanes>,
}

/// What concerns the diffuse passes.
pub struct Diffuse {
    pub value: RgbLanes,
    pub throughput: RgbLanes,
    pub gained: RgbLanes,
}

/// What leaves suffixes of the light of a group, and what prefixes got of it.
pub struct GroupLanes {
    pub radiance: RgbLanes,
    pub gained: RgbLanes,
}

impl SharedLayers {
    /// Empties them for a wave.
    pub fn reset(&mut self, layers: Layers) {
        self.diffuse =
            layers.has_passes().then(|| Box::new(Diffuse { value: BLACK, throughput: BLACK, gained: BLACK }));
        self.groups.clear();
        self.groups.resize_with(layers.groups(), || GroupLanes { radiance: BLACK, gained: BLACK });
    }
}
