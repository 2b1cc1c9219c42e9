//! What AOVs show of the first surface that a camera ray hits. Each has one line here; `film/channel.rs` has the table.

use crate::bsdf::Bsdf;
use crate::compile::{CompiledScene, View};
use crate::film::{Aov, AovSet, AovSpace, MatteIds};
use crate::math::{Hit, Vec3};
use crate::shape::Surface;

/// The first surface of a sample.
pub(super) struct FirstHit<'a> {
    /// The hit.
    pub hit: Hit,
    /// When, where something moves.
    pub time: f32,
    /// Where it is, in the compiled scene's space, with normals on its front or towards the camera, and its material.
    pub surface: Surface,
    /// Towards the camera.
    pub wo: Vec3,
    /// How it scatters.
    pub bsdf: &'a Bsdf,
}

/// What first surfaces are part of.
pub(super) struct Shown<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub mattes: &'a MatteIds,
    pub space: AovSpace,
}

impl FirstHit<'_> {
    /// The components of an AOV, from the first; channels of fewer than three use as many as they have.
    fn values(&self, aov: Aov, &Shown { scene, view, mattes, space }: &Shown) -> [f32; MOST_COMPONENTS] {
        let one = |value: f32| [value, 0.0, 0.0, 0.0];
        let three = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        let Surface { p, ng, ns, .. } = self.surface;
        let material = scene.described_material(self.surface.material);
        let side = if ng.dot(self.wo) < 0.0 { -1.0 } else { 1.0 };
        let object = || scene.object_at(&self.hit).0;
        let normal = |n: Vec3| match space {
            AovSpace::World => three((n * side).to_array()),
            AovSpace::Camera => three(view.camera.along_axes(n * side).to_array()),
        };
        // Numbers travel as bits.
        let id = |ids: &[u32], index: u32| one(f32::from_bits(ids.get(index as usize).copied().unwrap_or(0)));
        match aov {
            Aov::Depth | Aov::DepthMin => one(view.camera.depth(p)),
            Aov::Position => match space {
                AovSpace::World => three((scene.anchor + p.as_dvec3()).as_vec3().to_array()),
                AovSpace::Camera => three(view.camera.seen_from(p).to_array()),
            },
            Aov::Normal => normal(ns),
            Aov::GeometricNormal => normal(ng),
            Aov::Facing => one((ns * side).dot(self.wo).clamp(0.0, 1.0)),
            Aov::Uv => {
                let [u, v] =
                    scene.geometries.coordinates(&self.surface, &self.hit, false, self.time).uv[0].to_array();
                [u, v, 0.0, 0.0]
            }
            Aov::Motion => self.motion(scene, view),
            Aov::Albedo => three(self.bsdf.albedo().to_array()),
            Aov::Roughness => one(self.bsdf.look().roughness),
            Aov::DiffuseColor => three(self.bsdf.look().diffuse.to_array()),
            Aov::GlossyColor => three(self.bsdf.look().glossy.to_array()),
            Aov::TransmissionColor => three(self.bsdf.look().transmission.to_array()),
            Aov::ObjectId => one(f32::from_bits(object() + 1)),
            Aov::MaterialId => one(f32::from_bits(material + 1)),
            Aov::CryptoObject => id(&mattes.objects, object()),
            Aov::CryptoMaterial => id(&mattes.materials, material),
            Aov::CryptoAsset => id(&mattes.assets, object()),
            // Others show no surface, or what is found there later.
            _ => [0.0; MOST_COMPONENTS],
        }
    }

    /// How far what is seen goes in the picture, in pixels to the right and up: from here to where it was a frame before, and to
    /// where it will be a frame after. What lies beside the camera then has nowhere to go.
    fn motion(&self, scene: &CompiledScene, view: &View) -> [f32; 4] {
        let way = scene.vectors.way(&scene.geometries, &self.hit, self.surface.p, self.time);
        let [x, y] = view.camera.film_point(way.now);
        let to = |k: usize| {
            let [x1, y1] = view.neighbours[k].film_point(way.neighbours[k]);
            let [right, down] = view.camera.film_way([x, y], [x1, y1]);
            [right, -down]
        };
        let ([a, b], [c, d]) = (to(0), to(1));
        [a, b, c, d].map(|v| if v.is_finite() { v } else { 0.0 })
    }
}

const MOST_COMPONENTS: usize = 4;

// What shows a first surface fits.
const _: () = {
    let mut i = 0;
    while i < Aov::ALL.len() {
        let info = Aov::ALL[i].info();
        assert!(info.components() <= MOST_COMPONENTS, "an AOV has more components");
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
    /// Empties it for `count` samples and AOVs that show first hits; without any it stays empty and
    /// [`record`](FirstHits::record) does nothing.
    pub fn reset(&mut self, count: usize, aovs: AovSet) {
        let components = |aov: Aov| aov.info().components();
        (self.aovs, self.width) = (aovs, aovs.iter().map(components).sum());
        self.values.clear();
        self.values.resize(count * self.width, 0.0);
        self.is_hit.clear();
        self.is_hit.resize(if aovs.any() { count } else { 0 }, false);
    }

    /// Takes down the first surface of a sample.
    pub fn record(&mut self, sample: usize, hit: &FirstHit, shown: &Shown) {
        let Some(is_hit) = self.is_hit.get_mut(sample) else { return };
        *is_hit = true;
        let mut at = sample * self.width;
        for aov in self.aovs.iter() {
            let values = &hit.values(aov, shown)[..aov.info().components()];
            self.values[at..at + values.len()].copy_from_slice(values);
            at += values.len();
        }
    }

    /// Adds to the components of an AOV, if that is asked for and the sample hit something.
    pub fn add(&mut self, sample: usize, aov: Aov, values: [f32; 2]) {
        if !self.aovs.contains(aov) || !self.is_hit.get(sample).is_some_and(|&is_hit| is_hit) {
            return;
        }
        let before = self.aovs.iter().take_while(|&other| other != aov);
        let at = sample * self.width + before.map(|aov| aov.info().components()).sum::<usize>();
        self.values[at..].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }

    /// The components of a sample, if it hit something.
    pub fn get(&self, sample: usize) -> Option<&[f32]> {
        let is_hit = self.is_hit.get(sample).is_some_and(|&is_hit| is_hit);
        is_hit.then(|| &self.values[sample * self.width..][..self.width])
    }
}
