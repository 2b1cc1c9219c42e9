//! What AOVs show of the first surface that a camera ray hits. Each has one line here; `film/channel.rs` has the table.

use crate::color::Rgb;
use crate::compile::{CompiledScene, View};
use crate::film::{Aov, AovSet};
use crate::math::Vec3;

/// The first surface of a sample.
pub(super) struct FirstHit<A: Fn() -> Rgb> {
    /// Where it is, in the compiled scene's space.
    pub p: Vec3,
    /// Geometric normal, on the surface's front or towards the camera.
    pub ng: Vec3,
    /// Shading normal, on the side of the geometric one.
    pub ns: Vec3,
    /// Towards the camera.
    pub wo: Vec3,
    /// Gives its reflectance; asked only if someone wants to know.
    pub albedo: A,
    /// Index of its material.
    pub material: u32,
}

impl<A: Fn() -> Rgb> FirstHit<A> {
    /// The components of an AOV, from the first; channels of fewer than three use as many as they have.
    #[inline(always)]
    fn values(&self, aov: Aov, scene: &CompiledScene, view: &View) -> [f32; MOST_COMPONENTS] {
        let one = |value: f32| [value, 0.0, 0.0];
        match aov {
            Aov::Depth | Aov::Nearest => one(view.camera.depth(self.p)),
            Aov::Position => (scene.anchor + self.p.as_dvec3()).as_vec3().to_array(),
            Aov::Normal => (self.ns * if self.ng.dot(self.wo) < 0.0 { -1.0 } else { 1.0 }).to_array(),
            Aov::Albedo => (self.albedo)().to_array(),
            // Integers travel as bits.
            Aov::Material => one(f32::from_bits(self.material + 1)),
            // These show no surface.
            Aov::Samples | Aov::Variance => [0.0; MOST_COMPONENTS],
        }
    }
}

const MOST_COMPONENTS: usize = 3;

// What shows a first surface fits.
const _: () = {
    let mut i = 0;
    while i < Aov::ALL.len() {
        assert!(Aov::ALL[i].info().components() <= MOST_COMPONENTS, "an AOV has more components");
        i += 1;
    }
};

/// What the samples of a wave show of their first surfaces: for each sample the components of the AOVs asked for, one
/// after another in the order of their table.
#[derive(Default)]
pub(super) struct FirstHits {
    aovs: AovSet,
    /// Components of a sample.
    width: usize,
    values: Vec<f32>,
    is_hit: Vec<bool>,
}

impl FirstHits {
    /// Empties it for `count` samples; without AOVs it stays empty and [`record`](FirstHits::record) does nothing.
    pub fn reset(&mut self, count: usize, aovs: AovSet) {
        let aovs = aovs.of_first_hits();
        let components = |aov: Aov| aov.info().components();
        (self.aovs, self.width) = (aovs, aovs.iter().map(components).sum());
        self.values.clear();
        self.values.resize(count * self.width, 0.0);
        self.is_hit.clear();
        self.is_hit.resize(if aovs.any() { count } else { 0 }, false);
    }

    /// Takes down the first surface of a sample.
    pub fn record(
        &mut self,
        sample: usize,
        hit: &FirstHit<impl Fn() -> Rgb>,
        scene: &CompiledScene,
        view: &View,
    ) {
        let Some(is_hit) = self.is_hit.get_mut(sample) else { return };
        *is_hit = true;
        let mut at = sample * self.width;
        for aov in self.aovs.iter() {
            let values = &hit.values(aov, scene, view)[..aov.info().components()];
            self.values[at..at + values.len()].copy_from_slice(values);
            at += values.len();
        }
    }

    /// The components of a sample, if it hit something.
    pub fn get(&self, sample: usize) -> Option<&[f32]> {
        let is_hit = self.is_hit.get(sample).is_some_and(|&is_hit| is_hit);
        is_hit.then(|| &self.values[sample * self.width..][..self.width])
    }
}
