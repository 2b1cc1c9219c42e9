//! Values of AOVs at the first hit of a camera ray, one match arm per AOV; `film/aov.rs` has the table of AOVs.
//!
//! Denoising guides are taken at the first surface that is not a smooth mirror; paths that hit only mirrors so far are marked
//! ([`super::wave::Paths`]). Guides don't follow glass: reflection and transmission alternate between samples, which would make the
//! guides noisy.

use crate::bsdf::{Appearance, Bsdf};
use crate::color::Rgb;
use crate::compile::{CompiledScene, View};
use crate::film::{Aov, AovSet, AovSpace, MatteIds};
use crate::math::{Hit, Vec3};
use crate::shape::Surface;

/// The first hit of a sample.
pub(super) struct FirstHit<'a> {
    pub hit: Hit,
    /// Time, 0 to 1.
    pub time: f32,
    /// The surface in the space of the compiled scene; normals are of the front or flipped to the camera's side.
    pub surface: Surface,
    /// Direction to the camera.
    pub wo: Vec3,
    pub bsdf: &'a Bsdf,
    /// Factor on the BSDF: 1 except for components of mixes and behind mirrors.
    pub weight: Rgb,
}

/// Scene and settings that AOV values depend on.
pub(super) struct AovContext<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub mattes: &'a MatteIds,
    pub space: AovSpace,
}

/// Values of a first hit that several AOVs use.
#[derive(Clone, Copy)]
struct Common {
    /// Index of the material.
    material: u32,
    /// Index of the object; 0 if no AOV needs it.
    object: u32,
    /// 1 if the camera is on the side of the geometric normal, else -1.
    side: f32,
    /// Black if no AOV needs it.
    appearance: Appearance,
}

/// AOVs that need a BSDF's [`Appearance`].
const OF_APPEARANCE: [Aov; 4] = [Aov::Roughness, Aov::DiffuseColor, Aov::GlossyColor, Aov::TransmissionColor];
/// AOVs that follow smooth mirrors.
const DENOISING_GUIDES: [Aov; 2] = [Aov::DenoisingAlbedo, Aov::DenoisingNormal];
/// AOVs that need the object.
const OF_OBJECTS: [Aov; 3] = [Aov::ObjectId, Aov::CryptoObject, Aov::CryptoAsset];

impl FirstHit<'_> {
    /// Values that several AOVs use.
    fn common(&self, aovs: AovSet, scene: &CompiledScene) -> Common {
        let shows = |some: &[Aov]| some.iter().any(|&aov| aovs.contains(aov));
        Common {
            material: scene.scene_material(self.surface.material),
            object: if shows(&OF_OBJECTS) { scene.object_at(&self.hit).0 } else { 0 },
            side: if self.surface.ng.dot(self.wo) < 0.0 { -1.0 } else { 1.0 },
            appearance: if shows(&OF_APPEARANCE) { self.bsdf.appearance() } else { Appearance::BLACK },
        }
    }

    /// The components of an AOV; unused ones are 0.
    #[inline(always)]
    fn values(
        &self,
        aov: Aov,
        &Common { material, object, side, appearance }: &Common,
        &AovContext { scene, view, mattes, space }: &AovContext,
    ) -> [f32; MAX_COMPONENTS] {
        let one = |value: f32| [value, 0.0, 0.0, 0.0];
        let three = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        let Surface { p, ng, ns, .. } = self.surface;
        let normal = |n: Vec3| match space {
            AovSpace::World => three((n * side).to_array()),
            AovSpace::Camera => three(view.camera.to_camera_space(n * side).to_array()),
        };
        // Integers are stored as bits.
        let id = |ids: &[u32], index: u32| one(f32::from_bits(ids.get(index as usize).copied().unwrap_or(0)));
        match aov {
            Aov::Depth | Aov::DepthMin => one(view.camera.depth(p)),
            Aov::Position => match space {
                AovSpace::World => three((scene.anchor + p.as_dvec3()).as_vec3().to_array()),
                AovSpace::Camera => three(view.camera.point_in_camera_space(p).to_array()),
            },
            Aov::Normal | Aov::DenoisingNormal => normal(ns),
            Aov::GeometricNormal => normal(ng),
            Aov::Facing => one((ns * side).dot(self.wo).clamp(0.0, 1.0)),
            Aov::Uv => {
                let [u, v] =
                    scene.geometries.coordinates(&self.surface, &self.hit, false, self.time).uv[0].to_array();
                [u, v, 0.0, 0.0]
            }
            Aov::Motion => self.motion(scene, view),
            Aov::Albedo | Aov::DenoisingAlbedo => three((self.bsdf.albedo() * self.weight).to_array()),
            Aov::Roughness => one(appearance.roughness),
            Aov::DiffuseColor => three((appearance.diffuse * self.weight).to_array()),
            Aov::GlossyColor => three((appearance.glossy * self.weight).to_array()),
            Aov::TransmissionColor => three((appearance.transmission * self.weight).to_array()),
            Aov::ObjectId => one(f32::from_bits(object + 1)),
            Aov::MaterialId => one(f32::from_bits(material + 1)),
            Aov::CryptoObject => id(&mattes.objects, object),
            Aov::CryptoMaterial => id(&mattes.materials, material),
            Aov::CryptoAsset => id(&mattes.assets, object),
            // Not values of first hits: recorded by shadow rays, the radiance buffer and the film.
            Aov::Shadow
            | Aov::DiffuseDirect
            | Aov::DiffuseIndirect
            | Aov::GlossyDirect
            | Aov::GlossyIndirect
            | Aov::TransmissionDirect
            | Aov::TransmissionIndirect
            | Aov::Emission
            | Aov::Environment
            | Aov::Samples
            | Aov::Variance => [0.0; MAX_COMPONENTS],
        }
    }

    /// Motion vectors of the surface point, in pixels to the right and up: to the film points one frame before and one frame after;
    /// 0 where the point has no finite projection then.
    fn motion(&self, scene: &CompiledScene, view: &View) -> [f32; 4] {
        let motion = scene.vectors.point_motion(&scene.geometries, &self.hit, self.surface.p, self.time);
        let [x, y] = view.camera.film_point(motion.now);
        let to = |k: usize| {
            let [x1, y1] = view.neighbours[k].film_point(motion.neighbours[k]);
            let [right, down] = view.camera.film_offset([x, y], [x1, y1]);
            [right, -down]
        };
        let ([a, b], [c, d]) = (to(0), to(1));
        [a, b, c, d].map(|v| if v.is_finite() { v } else { 0.0 })
    }
}

const MAX_COMPONENTS: usize = 4;

const _: () = {
    let mut i = 0;
    while i < Aov::ALL.len() {
        let info = Aov::ALL[i].info();
        assert!(info.components() <= MAX_COMPONENTS, "an AOV has more components");
        i += 1;
    }
};

/// AOVs of the first hits of a wave: per sample, the components of the requested AOVs in the order of [`AovSet`].
#[derive(Default)]
pub(super) struct FirstHits {
    aovs: AovSet,
    /// The requested AOVs, each with the offset of its first component.
    offsets: Vec<(Aov, usize)>,
    /// Number of components per sample.
    width: usize,
    /// Components, padded per sample by those of the largest AOV, so that all AOVs are written with the same size.
    values: Vec<f32>,
    /// Number of recorded surfaces per sample: the first, and those that path branches hit behind mirrors.
    surfaces: Vec<u32>,
}

impl FirstHits {
    /// Clears the buffer for `count` samples; without AOVs it stays empty and [`record`](FirstHits::record) does nothing.
    pub fn reset(&mut self, count: usize, aovs: AovSet) {
        if self.aovs != aovs {
            self.aovs = aovs;
            (self.width, self.offsets) = (0, Vec::new());
            for aov in aovs.iter() {
                self.offsets.push((aov, self.width));
                self.width += aov.info().components();
            }
        }
        let count = if aovs.any() { count } else { 0 };
        // Values of samples without a hit are not read.
        let numbers = (count * self.stride()).max(self.values.len());
        self.values.resize(numbers, 0.0);
        self.surfaces.clear();
        self.surfaces.resize(count, 0);
    }

    /// Stride between samples, in components.
    fn stride(&self) -> usize {
        self.width + MAX_COMPONENTS
    }

    pub fn record(&mut self, sample: usize, hit: &FirstHit, aov_context: &AovContext) {
        let Some(surfaces) = self.surfaces.get_mut(sample) else { return };
        *surfaces = 1;
        let stride = self.stride();
        let own = &mut self.values[sample * stride..(sample + 1) * stride];
        let common = hit.common(self.aovs, aov_context.scene);
        for &(aov, offset) in &self.offsets {
            // The next AOV overwrites unused components.
            if let Some(own) = own[offset..].first_chunk_mut() {
                *own = hit.values(aov, &common, aov_context);
            }
        }
    }

    /// Replaces a sample's denoising guides by those of a surface hit after mirrors; with several path branches, by their mean.
    pub fn record_in_mirror(&mut self, sample: usize, hit: &FirstHit, aov_context: &AovContext) {
        let stride = self.stride();
        let Some(surfaces) = self.surfaces.get_mut(sample).filter(|surfaces| **surfaces > 0) else { return };
        let own = &mut self.values[sample * stride..(sample + 1) * stride];
        let common = hit.common(AovSet::NONE, aov_context.scene);
        for &(aov, offset) in self.offsets.iter().filter(|(aov, _)| DENOISING_GUIDES.contains(aov)) {
            let values = hit.values(aov, &common, aov_context);
            let means = own[offset..].iter_mut().zip(values).take(aov.info().components());
            means.for_each(|(mean, value)| *mean += (value - *mean) / *surfaces as f32);
        }
        *surfaces += 1;
    }

    /// Adds to the components of an AOV if the AOV is requested and the sample has a hit.
    pub fn add(&mut self, sample: usize, aov: Aov, values: [f32; 2]) {
        if !self.is_hit(sample) {
            return;
        }
        if let Some((_, offset)) = self.offsets.iter().find(|(other, _)| *other == aov) {
            let at = sample * self.stride() + offset;
            self.values[at..].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
    }

    fn is_hit(&self, sample: usize) -> bool {
        self.surfaces.get(sample).is_some_and(|&surfaces| surfaces > 0)
    }

    /// The components of a sample, if it has a hit.
    pub fn get(&self, sample: usize) -> Option<&[f32]> {
        self.is_hit(sample).then(|| &self.values[sample * self.stride()..][..self.width])
    }
}
