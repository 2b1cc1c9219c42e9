//! All lights of a scene and the choice of one of them.

use super::{
    AreaLight, EnvironmentLight, LightBounds, LightMotions, LightSample, LightTree, PunctualLight, Receiver,
    Sun,
};
use crate::math::Vec3;
use crate::sampling::AliasTable;
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// All lights; their indices run through the area lights, the punctual ones, then the environment.
///
/// First it is chosen by power between the lights at some place, all together, and each of those infinitely far away;
/// among the former then by a [`LightTree`].
#[derive(Clone, Debug)]
pub struct Lights {
    area: Vec<AreaLight>,
    punctual: Vec<PunctualLight>,
    environment: Option<EnvironmentLight>,
    /// Over the lights at some place.
    tree: LightTree,
    /// The tree (if there are such lights), then each light infinitely far away.
    table: AliasTable,
    /// What the table's entries are.
    entries: Vec<Entry>,
    suns: Vec<SelectedSun>,
    motions: LightMotions,
}

/// A sun among the lights.
#[derive(Clone, Copy, Debug)]
pub struct SelectedSun {
    /// The sun.
    pub sun: Sun,
    /// Its index and the probability of choosing it.
    pub selected: Selected,
    /// Do cameras see it?
    pub is_seen: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Entry {
    Tree,
    Light(u32),
}

/// A chosen light.
#[derive(Clone, Copy, Debug)]
pub struct Selected {
    /// Its index.
    pub index: u32,
    /// The probability of choosing it; 0 if none was found to choose.
    pub pdf_discrete: f32,
}

impl Selected {
    const NONE: Selected = Selected { index: 0, pdf_discrete: 0.0 };
}

impl Lights {
    /// Prepares the choice. The power of environments and directional lights is what falls on a disk of `scene_radius`.
    pub fn new(
        area: Vec<AreaLight>,
        punctual: Vec<PunctualLight>,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
        scene_radius: f32,
    ) -> Lights {
        Lights::moving((area, punctual), LightMotions::default(), environment, textures, scene_radius)
    }

    /// The same with lights some of which move.
    pub fn moving(
        (area, punctual): (Vec<AreaLight>, Vec<PunctualLight>),
        motions: LightMotions,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
        scene_radius: f32,
    ) -> Lights {
        let (mut bounds, mut power_of_tree) = (Vec::new(), 0.0);
        let mut far: Vec<(Entry, f32)> = Vec::new();
        for (i, light) in area.iter().enumerate() {
            let moving = motions.area.get(&i);
            bounds.push(moving.map_or_else(|| light.bounds(textures), |m| m.bounds(textures)));
            power_of_tree += moving.map_or_else(|| light.power(textures), |m| m.power(textures));
        }
        for (i, light) in punctual.iter().enumerate() {
            let power = light.power(scene_radius);
            match motions.punctual.get(&i).map_or_else(|| light.bounds(), |m| m.bounds()) {
                Some(b) => {
                    bounds.push(b);
                    power_of_tree += power;
                }
                None => {
                    // Its place in the tree stays dark.
                    bounds.push(LightBounds::DARK);
                    far.push((Entry::Light((area.len() + i) as u32), power));
                }
            }
        }
        let index = (area.len() + punctual.len()) as u32;
        let disk = PI * scene_radius * scene_radius;
        far.extend(environment.iter().map(|e| (Entry::Light(index), e.mean_luminance() * 4.0 * PI * disk)));
        if far.len() < bounds.len() + usize::from(environment.is_some()) {
            far.insert(0, (Entry::Tree, power_of_tree));
        }
        let (entries, powers): (Vec<Entry>, Vec<f32>) = far.into_iter().unzip();
        let tree = LightTree::new(&bounds);
        let table = AliasTable::new(if powers.is_empty() { &[1.0] } else { &powers });
        let mut lights =
            Lights { area, punctual, environment, tree, table, entries, suns: Vec::new(), motions };
        lights.suns = lights.find_suns();
        lights
    }

    fn find_suns(&self) -> Vec<SelectedSun> {
        let sun = |(i, light): (usize, &PunctualLight)| {
            let (sun, index) = (*light.sun()?, (self.area.len() + i) as u32);
            let entry = self.entries.iter().position(|e| *e == Entry::Light(index))?;
            let pdf_discrete = if self.len() == 1 { 1.0 } else { self.table.pdf_discrete(entry) };
            Some(SelectedSun { sun, selected: Selected { index, pdf_discrete }, is_seen: false })
        };
        self.punctual.iter().enumerate().filter_map(sun).collect()
    }

    /// Lets cameras see one of the punctual lights, a sun.
    pub fn show_sun(&mut self, punctual: u32) {
        let index = self.area.len() as u32 + punctual;
        self.suns.iter_mut().filter(|s| s.selected.index == index).for_each(|s| s.is_seen = true);
    }

    /// Gives up all but the environment.
    pub fn into_environment(self) -> Option<EnvironmentLight> {
        self.environment
    }

    /// Is there nothing to sample?
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// How many there are, the environment included.
    pub fn len(&self) -> usize {
        self.area.len() + self.punctual.len() + usize::from(self.environment.is_some())
    }

    /// The lights with a surface.
    #[inline(always)]
    pub fn area(&self) -> &[AreaLight] {
        &self.area
    }

    /// The lights without a surface.
    pub fn punctual(&self) -> &[PunctualLight] {
        &self.punctual
    }

    /// Those of the punctual lights that have a size.
    #[inline(always)]
    pub fn suns(&self) -> &[SelectedSun] {
        &self.suns
    }

    /// The environment.
    #[inline(always)]
    pub fn environment(&self) -> Option<&EnvironmentLight> {
        self.environment.as_ref()
    }

    /// Does the choice depend on the receiver? It doesn't for a single light.
    pub fn use_tree(&self) -> bool {
        self.len() > 1 && self.entries.contains(&Entry::Tree)
    }

    /// Chooses a light by two numbers in 0..1.
    #[inline(always)]
    pub fn select(&self, receiver: &Receiver, u: [f32; 2]) -> Selected {
        if self.len() == 1 {
            return Selected { index: 0, pdf_discrete: 1.0 };
        }
        let (entry, probability, rest) = match &self.entries[..] {
            [only] => (*only, 1.0, u[1]),
            entries => {
                let chosen = self.table.sample(u[1]);
                (entries[chosen.index], chosen.pdf_discrete, chosen.remapped)
            }
        };
        match entry {
            Entry::Light(index) => Selected { index, pdf_discrete: probability },
            // The second number adds digits below the first one's 24.
            Entry::Tree => {
                match self.tree.sample(receiver, f64::from(u[0]) + f64::from(rest) * 2f64.powi(-24)) {
                    Some((index, pdf)) => Selected { index, pdf_discrete: probability * pdf },
                    None => Selected::NONE,
                }
            }
        }
    }

    /// The probability of choosing an area light.
    #[inline(always)]
    pub fn pdf_discrete(&self, receiver: &Receiver, index: u32) -> f32 {
        if self.len() == 1 {
            return 1.0;
        }
        self.table.pdf_discrete(0) * self.tree.pdf_discrete(receiver, index)
    }

    /// The probability of choosing the environment.
    #[inline(always)]
    pub fn environment_pdf_discrete(&self) -> f32 {
        self.table.pdf_discrete(self.table.len() - 1)
    }

    /// The middle of a light; `None` for one infinitely far away.
    pub fn middle(&self, index: u32) -> Option<Vec3> {
        let index = index as usize;
        match self.area.get(index) {
            Some(light) => Some(light.middle()),
            None => self.punctual.get(index - self.area.len())?.position(),
        }
    }

    /// Does any move while the shutter is open?
    #[inline(always)]
    pub fn are_moving(&self) -> bool {
        !self.motions.is_empty()
    }

    /// An area light at a time in 0..1.
    #[inline(always)]
    pub fn area_at(&self, index: u32, time: f32) -> AreaLight {
        let moving = self.motions.area.get(&(index as usize));
        moving.map_or_else(|| self.area[index as usize], |moving| moving.at(time))
    }

    /// [`Lights::sample`] where lights move.
    pub fn sample_at(
        &self,
        textures: &CompiledTextures,
        index: u32,
        reference: Vec3,
        u: [f32; 2],
        time: f32,
    ) -> LightSample {
        let place = index as usize;
        if let Some(moving) = self.motions.area.get(&place) {
            return moving.sample(textures, reference, u, time);
        }
        let moving = place.checked_sub(self.area.len()).and_then(|place| self.motions.punctual.get(&place));
        match moving {
            Some(moving) => moving.at(time).sample(reference, u),
            None => self.sample(textures, index, reference, u),
        }
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
            return light.sample(reference, u);
        }
        let Some(environment) = &self.environment else { return LightSample::NONE };
        let s = environment.sample_from(reference, u);
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
