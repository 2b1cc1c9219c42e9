//! All lights of a scene and the choice of one of them.

use super::{AreaLight, EnvironmentLight, LightSample, PunctualLight};
use crate::math::Vec3;
use crate::sampling::AliasTable;
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// All lights; their indices run through the area lights, the punctual ones, then the surroundings.
#[derive(Clone, Debug)]
pub struct Lights {
    area: Vec<AreaLight>,
    punctual: Vec<PunctualLight>,
    environment: Option<EnvironmentLight>,
    /// By power.
    table: AliasTable,
    /// No light at all.
    is_empty: bool,
}

/// A chosen light.
#[derive(Clone, Copy, Debug)]
pub struct Selected {
    /// Its index.
    pub index: u32,
    /// The chance of choosing it.
    pub pdf_discrete: f32,
}

impl Lights {
    /// Lights that are chosen by their power; the surroundings' is what falls on a disk of `scene_radius` from all
    /// directions.
    pub fn new(
        area: Vec<AreaLight>,
        punctual: Vec<PunctualLight>,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
        scene_radius: f32,
    ) -> Lights {
        let disk = PI * scene_radius * scene_radius;
        let powers: Vec<f32> = (area.iter().map(|l| l.power(textures)))
            .chain(punctual.iter().map(|l| l.power(scene_radius)))
            .chain(environment.iter().map(|e| e.mean_luminance() * 4.0 * PI * disk))
            .collect();
        Lights { is_empty: powers.is_empty(), table: AliasTable::new(&powers), area, punctual, environment }
    }

    /// Is there nothing to sample?
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.is_empty
    }

    /// How many there are, the surroundings included.
    pub fn len(&self) -> usize {
        if self.is_empty { 0 } else { self.table.len() }
    }

    /// The lights with a surface.
    #[inline(always)]
    pub fn area(&self) -> &[AreaLight] {
        &self.area
    }

    /// The surroundings.
    #[inline(always)]
    pub fn environment(&self) -> Option<&EnvironmentLight> {
        self.environment.as_ref()
    }

    /// Chooses a light.
    #[inline(always)]
    pub fn select(&self, u: f32) -> Selected {
        if self.table.len() == 1 {
            return Selected { index: 0, pdf_discrete: 1.0 };
        }
        let chosen = self.table.sample(u);
        Selected { index: chosen.index as u32, pdf_discrete: chosen.pdf_discrete }
    }

    /// The chance of choosing a light.
    #[inline(always)]
    pub fn pdf_discrete(&self, index: u32) -> f32 {
        self.table.pdf_discrete(index as usize)
    }

    /// The chance of choosing the surroundings.
    #[inline(always)]
    pub fn environment_pdf_discrete(&self) -> f32 {
        self.table.pdf_discrete(self.table.len() - 1)
    }

    /// A point or direction of light `index`, as seen from `reference`.
    #[inline]
    pub fn sample(
        &self,
        textures: &CompiledTextures,
        index: u32,
        reference: Vec3,
        u: [f32; 2],
    ) -> LightSample {
        let index = index as usize;
        if let Some(light) = self.area.get(index) {
            return light.sample(textures, reference, u);
        }
        if let Some(light) = self.punctual.get(index - self.area.len()) {
            return light.sample(reference);
        }
        let Some(environment) = &self.environment else { return LightSample::NONE };
        let s = environment.sample(u);
        LightSample {
            wi: s.direction,
            target: Vec3::ZERO,
            is_infinite: true,
            is_delta: false,
            radiance: s.radiance,
            pdf_solid_angle: s.pdf_solid_angle,
        }
    }
}
