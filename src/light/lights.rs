//! The lights of a scene, light selection, and lights with motion.

use super::{
    AreaLight, Descent, EnvironmentLight, LIGHT_GROUPS, LightBounds, LightSample, LightSource, LightTree,
    PunctualLight, PunctualSource, Receiver, Sun, UniformLight, UniformLights, UniformRectangle, VolumeLight,
};
use crate::math::{Vec3, gamma, offset_ray_origin, segment};
use crate::sampling::AliasTable;
use crate::texture::CompiledTextures;
use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::PI;

/// All lights; indices run through the area lights, the punctual lights, the emissive media, then the environment. See `LightSampler` for
/// light selection.
#[derive(Clone, Debug)]
pub struct Lights {
    area: Vec<AreaLight>,
    punctual: Vec<PunctualLight>,
    /// Sorted by medium index.
    volumes: Vec<VolumeLight>,
    environment: Option<EnvironmentLight>,
    /// For receivers of class 0: all lights, unless light linking excludes some.
    sampler: LightSampler,
    /// For receivers of classes 1 and up (light linking).
    linked: Vec<LightSampler>,
    suns: Vec<SelectedSun>,
    /// For vectorised sampling; empty if lights move.
    uniform: UniformLights,
    motions: LightMotions,
    /// Does the emission of any area light depend on the hit?
    emits_by_hit: bool,
}

/// A sun among the lights.
#[derive(Clone, Debug)]
pub struct SelectedSun {
    pub sun: Sun,
    /// Index of the light.
    pub index: u32,
    /// By receiver class: selection probability among the lights at infinity.
    pub pdf_discrete: Vec<f32>,
    /// Is it visible to camera rays?
    pub is_visible_to_camera: bool,
}

impl Lights {
    /// Static lights.
    pub fn new(
        area: Vec<AreaLight>,
        punctual: Vec<PunctualLight>,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
    ) -> Lights {
        Lights::moving((area, punctual, Vec::new()), LightMotions::default(), environment, textures)
    }

    /// Lights, some with motion.
    pub fn moving(
        (area, punctual, volumes): (Vec<AreaLight>, Vec<PunctualLight>, Vec<VolumeLight>),
        motions: LightMotions,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
    ) -> Lights {
        let (suns, linked) = (Vec::new(), Vec::new());
        let uniform = if motions.is_empty() { UniformLights::new(&area) } else { UniformLights::default() };
        let sampler = LightSampler::new(&[], 0, &[], false);
        let emits_by_hit = area.iter().any(AreaLight::emits_by_hit);
        let mut lights = Lights {
            area,
            punctual,
            volumes,
            environment,
            sampler,
            linked,
            suns,
            uniform,
            motions,
            emits_by_hit,
        };
        lights.sampler = lights.sampler_of(textures, |_| true);
        lights.suns = lights.find_suns();
        lights
    }

    /// Memory of lights, light trees and the environment, bytes.
    pub fn bytes(&self) -> usize {
        let samplers = std::iter::once(&self.sampler).chain(&self.linked);
        size_of_val(&self.area[..])
            + size_of_val(&self.punctual[..])
            + self.volumes.iter().map(VolumeLight::bytes).sum::<usize>()
            + self.uniform.bytes()
            + samplers.map(|sampler| sampler.tree.bytes()).sum::<usize>()
            + self.environment.as_ref().map_or(0, EnvironmentLight::bytes)
    }

    /// Does the emission of any area light depend on the hit?
    #[inline(always)]
    pub fn emits_by_hit(&self) -> bool {
        self.emits_by_hit
    }

    /// Does the emission of a light depend on the hit?
    #[inline(always)]
    pub fn light_emits_by_hit(&self, index: u32) -> bool {
        self.emits_by_hit && self.area.get(index as usize).is_some_and(AreaLight::emits_by_hit)
    }

    /// Light linking: receivers of each class select among the lights for which `is_linked(class, light)` holds.
    pub fn link(
        &mut self,
        classes: usize,
        textures: &CompiledTextures,
        is_linked: impl Fn(usize, u32) -> bool,
    ) {
        let mut samplers = (0..classes).map(|c| self.sampler_of(textures, |light| is_linked(c, light)));
        let (sampler, linked) = (samplers.next(), samplers.collect());
        (self.sampler, self.linked) = (sampler.unwrap_or_else(|| self.sampler.clone()), linked);
        self.suns = self.find_suns();
    }

    /// A sampler of the lights for which `has` holds.
    fn sampler_of(&self, textures: &CompiledTextures, has: impl Fn(u32) -> bool) -> LightSampler {
        let (mut bounds, mut far, mut near) = (Vec::new(), Vec::new(), 0);
        for (i, light) in self.area.iter().enumerate() {
            let moving = self.motions.area.get(&i);
            let of_light = || moving.map_or_else(|| light.bounds(textures), |m| m.bounds(textures));
            let is_included = has(i as u32);
            bounds.push(is_included.then(of_light).flatten().unwrap_or(LightBounds::DARK));
            near += usize::from(is_included);
        }
        for (i, light) in self.punctual.iter().enumerate() {
            let index = (self.area.len() + i) as u32;
            let is_included = has(index);
            let moving = self.motions.punctual.get(&i);
            let of_light = || moving.map_or_else(|| light.bounds(textures), |m| m.bounds(textures));
            // Lights at infinity are dark in the tree.
            bounds.push(is_included.then(of_light).flatten().unwrap_or(LightBounds::DARK));
            match light.irradiance() {
                Some(irradiance) if is_included => far.push((index, irradiance)),
                None if is_included => near += 1,
                _ => {}
            }
        }
        for (i, volume) in self.volumes.iter().enumerate() {
            let is_included = has(self.first_volume() + i as u32);
            bounds.push(is_included.then(|| volume.bounds(textures)).flatten().unwrap_or(LightBounds::DARK));
            near += usize::from(is_included);
        }
        // Irradiance of a hemisphere of the mean radiance.
        let index = self.first_volume() + self.volumes.len() as u32;
        let sampled = self.environment.iter().filter(|e| e.is_sampled() && has(index));
        far.extend(sampled.map(|e| (index, e.mean_luminance() * PI)));
        LightSampler::new(&bounds, near, &far, self.count_sampled() == 1)
    }

    /// The group of a light, for [`LightWeights`](super::LightWeights) of receivers of class 0.
    pub fn group_of(&self, light: u32) -> u8 {
        self.sampler.tree.group(light).unwrap_or(LIGHT_GROUPS - 1) as u8
    }

    /// Number of groups of lights of class 0 between which light selection chooses.
    pub fn count_groups(&self) -> usize {
        let groups: BTreeSet<u8> = (0..self.len() as u32).map(|light| self.group_of(light)).collect();
        groups.len()
    }

    /// The sampler for receivers of a class.
    #[inline(always)]
    fn sampler_of_class(&self, class: u32) -> &LightSampler {
        if class == 0 { &self.sampler } else { &self.linked[class as usize - 1] }
    }

    fn samplers(&self) -> impl Iterator<Item = &LightSampler> {
        std::iter::once(&self.sampler).chain(&self.linked)
    }

    fn find_suns(&self) -> Vec<SelectedSun> {
        let sun = |(i, light): (usize, &PunctualLight)| {
            let (sun, index) = (*light.sun()?, (self.area.len() + i) as u32);
            let pdf_discrete = self.samplers().map(|sampler| sampler.pdf_among_far(index)).collect();
            Some(SelectedSun { sun, index, pdf_discrete, is_visible_to_camera: false })
        };
        self.punctual.iter().enumerate().filter_map(sun).collect()
    }

    /// For closed scenes: lights at infinity are selected only where no other light arrives.
    pub fn exclude_infinite_lights(&mut self) {
        self.sampler.exclude_infinite_lights();
        self.linked.iter_mut().for_each(LightSampler::exclude_infinite_lights);
    }

    /// Makes a sun, given by its index among the punctual lights, visible to camera rays.
    pub fn show_sun_to_camera(&mut self, punctual: u32) {
        let index = self.area.len() as u32 + punctual;
        self.suns.iter_mut().filter(|s| s.index == index).for_each(|s| s.is_visible_to_camera = true);
    }

    /// The environment alone.
    pub fn into_environment(self) -> Option<EnvironmentLight> {
        self.environment
    }

    /// Is there no light to sample?
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.count_sampled() == 0
    }

    /// Number of lights, including the environment.
    pub fn len(&self) -> usize {
        self.area.len() + self.punctual.len() + self.volumes.len() + usize::from(self.environment.is_some())
    }

    /// Number of light-sampled lights.
    fn count_sampled(&self) -> usize {
        self.area.len() + self.punctual.len() + self.volumes.len() + usize::from(self.samples_environment())
    }

    /// Emissive surfaces.
    #[inline(always)]
    pub fn area(&self) -> &[AreaLight] {
        &self.area
    }

    /// Lights without a surface.
    pub fn punctual(&self) -> &[PunctualLight] {
        &self.punctual
    }

    /// Emissive media.
    #[inline(always)]
    pub fn volumes(&self) -> &[VolumeLight] {
        &self.volumes
    }

    /// The index of the first emissive medium.
    #[inline(always)]
    pub fn first_volume(&self) -> u32 {
        (self.area.len() + self.punctual.len()) as u32
    }

    /// The light of an emissive medium, with its index.
    #[inline]
    pub fn volume_of_medium(&self, medium: u16) -> Option<(u32, &VolumeLight)> {
        let at = self.volumes.binary_search_by_key(&medium, VolumeLight::medium).ok()?;
        Some((self.first_volume() + at as u32, &self.volumes[at]))
    }

    /// The emissive medium with this light index; `None` for other lights.
    #[inline(always)]
    pub fn volume(&self, index: u32) -> Option<&VolumeLight> {
        self.volumes.get(index.checked_sub(self.first_volume())? as usize)
    }

    /// The suns among the punctual lights.
    #[inline(always)]
    pub fn suns(&self) -> &[SelectedSun] {
        &self.suns
    }

    /// The area lights for vectorised sampling; none if lights move.
    #[inline(always)]
    pub fn uniform(&self) -> &UniformLights {
        &self.uniform
    }

    /// Are all sampled lights static uniform rectangles?
    pub fn are_rectangles(&self) -> bool {
        self.uniform.are_rectangles() && self.area.len() == self.count_sampled()
    }

    /// The scene's only light, if it is a static rectangle of constant radiance.
    pub fn single_rectangle(&self) -> Option<UniformLight<UniformRectangle>> {
        match self.uniform.packed() {
            [packed] if self.are_rectangles() && !self.emits_by_hit => Some(UniformLight::unpack(*packed)),
            _ => None,
        }
    }

    /// The environment, if it is light-sampled by an image without portals.
    #[inline(always)]
    pub fn sampled_image(&self) -> Option<&super::ImageMap> {
        let is_plain = |e: &&EnvironmentLight| e.is_sampled() && !e.has_portals();
        self.environment().filter(is_plain).and_then(EnvironmentLight::image_map)
    }

    /// The scene's only light, if it is a light-sampled environment image without portals.
    pub fn single_environment_image(&self) -> Option<&super::ImageMap> {
        self.sampled_image().filter(|_| self.len() == 1)
    }

    /// Is there only one light, with a vectorised sampler?
    pub fn is_vectorised(&self) -> bool {
        self.single_rectangle().is_some() || self.single_environment_image().is_some()
    }

    #[inline(always)]
    pub fn environment(&self) -> Option<&EnvironmentLight> {
        self.environment.as_ref()
    }

    /// Is there an environment, and is it light-sampled?
    #[inline(always)]
    pub fn samples_environment(&self) -> bool {
        self.environment.as_ref().is_some_and(EnvironmentLight::is_sampled)
    }

    /// Does light selection depend on the receiver? Not with a single light.
    pub fn use_tree(&self) -> bool {
        self.count_sampled() > 1 && self.samplers().any(|sampler| sampler.has_near)
    }

    /// Selects a light for a receiver of a class by two random numbers in 0..1.
    #[inline(always)]
    pub fn select(&self, class: u32, receiver: &Receiver<'_>, u: [f32; 2]) -> SelectedLight {
        let sampler = self.sampler_of_class(class);
        match sampler.select_group(receiver, u) {
            SelectedGroup::Near { probability, u } => {
                SelectedLight::near(probability, sampler.tree.sample(receiver, u))
            }
            SelectedGroup::Far(selected) => selected,
        }
    }

    /// [`Lights::select`] for the first `count` receivers, all of class 0, interleaved.
    #[inline(always)]
    pub fn select_many<const N: usize>(
        &self,
        receivers: &[Receiver<'_>; N],
        numbers: &[[f32; 2]; N],
        count: usize,
    ) -> [SelectedLight; N] {
        let (mut selected, mut probabilities) = ([SelectedLight::NONE; N], [0.0; N]);
        let mut descents = [Descent::ENDED; N];
        for i in 0..count.min(N) {
            match self.sampler.select_group(&receivers[i], numbers[i]) {
                SelectedGroup::Near { probability, u } => {
                    (probabilities[i], descents[i]) = (probability, Descent::new(u))
                }
                SelectedGroup::Far(of_far) => selected[i] = of_far,
            }
        }
        self.sampler.tree.descend_many(receivers, &mut descents);
        for i in 0..count.min(N) {
            if probabilities[i] > 0.0 {
                selected[i] = SelectedLight::near(probabilities[i], descents[i].chosen(&self.sampler.tree));
            }
        }
        selected
    }

    /// [`Lights::select`] for receivers of several classes.
    pub fn select_by_class<const N: usize>(
        &self,
        class: impl Fn(usize) -> u32,
        receivers: &[Receiver<'_>; N],
        numbers: &[[f32; 2]; N],
        count: usize,
    ) -> [SelectedLight; N] {
        std::array::from_fn(|i| match i < count {
            true => self.select(class(i), &receivers[i], numbers[i]),
            false => SelectedLight::NONE,
        })
    }

    /// The probability of selecting an area light or an emissive medium for a receiver of a class.
    #[inline(always)]
    pub fn pdf_discrete(&self, class: u32, receiver: &Receiver<'_>, index: u32) -> f32 {
        self.sampler_of_class(class).pdf_discrete(receiver, index)
    }

    /// The probability of selecting any of the lights at infinity.
    #[inline(always)]
    pub fn far_pdf_discrete(&self, class: u32, receiver: &Receiver<'_>) -> f32 {
        self.sampler_of_class(class).far_pdf_discrete(receiver)
    }

    /// The probability of selecting the environment among the lights at infinity, for receivers of a class.
    #[inline(always)]
    pub fn environment_pdf_discrete(&self, class: u32) -> f32 {
        if self.samples_environment() { self.sampler_of_class(class).pdf_of_last_far() } else { 0.0 }
    }

    /// The center of a light; `None` for lights at infinity.
    pub fn center(&self, index: u32) -> Option<Vec3> {
        let index = index as usize;
        match self.area.get(index) {
            Some(light) => Some(light.center()),
            None => match self.volume(index as u32) {
                Some(volume) => Some(volume.center()),
                None => self.punctual.get(index - self.area.len())?.position(),
            },
        }
    }

    /// Does any light move while the shutter is open?
    #[inline(always)]
    pub fn are_moving(&self) -> bool {
        !self.motions.is_empty()
    }

    /// An area light at a shutter time in 0..1.
    #[inline(always)]
    pub fn area_at(&self, index: u32, time: f32) -> AreaLight {
        let moving = self.motions.area.get(&(index as usize));
        moving.map_or_else(|| self.area[index as usize], |moving| moving.at(time))
    }

    /// [`Lights::sample`] at a shutter time in 0..1.
    pub fn sample_at(
        &self,
        textures: &CompiledTextures,
        index: u32,
        reference: Vec3,
        u: [f32; 2],
        time: f32,
    ) -> LightSample {
        let area = index as usize;
        if let Some(moving) = self.motions.area.get(&area) {
            return moving.sample(textures, reference, u, time);
        }
        let punctual = area.checked_sub(self.area.len());
        match punctual.and_then(|punctual| self.motions.punctual.get(&punctual)) {
            Some(moving) => moving.at(time).sample(textures, reference, u),
            None => self.sample(textures, index, reference, u),
        }
    }

    /// Samples light `index` from `reference` by two random numbers in 0..1.
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
            return light.sample(textures, reference, u);
        }
        if let Some(volume) = self.volume(index as u32) {
            return volume.sample(textures, reference, u);
        }
        let Some(environment) = &self.environment else { return LightSample::NONE };
        LightSource::sample(environment, textures, reference, u)
    }
}

/// Minimum probability of each group, lights at a position and lights at infinity, if both may contribute.
const MIN_GROUP_PROBABILITY: f32 = 0.02;

/// Selects a light for a receiver: first between lights at a position and lights at infinity, by the square root of their estimated
/// irradiance; then among the former by a [`LightTree`], among the latter by irradiance.
#[derive(Clone, Debug)]
struct LightSampler {
    /// Over the lights at a position.
    pub tree: LightTree,
    /// Are there lights at a position?
    pub has_near: bool,
    /// The lights at infinity.
    far: Vec<u32>,
    /// Distribution over `far` by irradiance.
    far_table: AliasTable,
    /// Luminance of the total irradiance of `far`.
    far_irradiance: f32,
    /// Is there only one light?
    is_single: bool,
}

#[derive(Clone, Copy, Debug)]
pub struct SelectedLight {
    /// Index of the light.
    pub index: u32,
    /// Selection probability; 0 if no light was selected.
    pub pdf_discrete: f32,
}

impl SelectedLight {
    const NONE: SelectedLight = SelectedLight { index: 0, pdf_discrete: 0.0 };

    /// A selection from the tree of a group with this probability.
    #[inline(always)]
    pub fn near(probability: f32, (index, pdf): (u32, f32)) -> SelectedLight {
        SelectedLight { index, pdf_discrete: probability * pdf }
    }
}

/// The group from which a light is selected.
enum SelectedGroup {
    /// Lights at a position: probability of the group, and a random number in 0..1 for the selection from it.
    Near { probability: f32, u: f64 },
    /// A selected light at infinity, or the only light.
    Far(SelectedLight),
}

impl LightSampler {
    /// A sampler from the `bounds` of all lights, the number of lights at a position (`near`), and the indices and irradiances of
    /// those at infinity (`far`); `is_single`: there is only one light in all.
    pub fn new(bounds: &[LightBounds], near: usize, far: &[(u32, f32)], is_single: bool) -> LightSampler {
        let irradiances: Vec<f32> = far.iter().map(|&(_, irradiance)| irradiance).collect();
        LightSampler {
            tree: LightTree::new(bounds),
            has_near: near > 0,
            far: far.iter().map(|&(light, _)| light).collect(),
            far_table: AliasTable::new(if far.is_empty() { &[1.0] } else { &irradiances }),
            far_irradiance: irradiances.iter().sum(),
            is_single,
        }
    }

    /// See [`Lights::exclude_infinite_lights`].
    pub fn exclude_infinite_lights(&mut self) {
        self.far_irradiance = 0.0;
    }

    /// Selects between lights at a position and at infinity, and among the latter.
    #[inline(always)]
    pub fn select_group(&self, receiver: &Receiver<'_>, u: [f32; 2]) -> SelectedGroup {
        if self.is_single {
            return SelectedGroup::Far(SelectedLight { index: 0, pdf_discrete: 1.0 });
        }
        let probability = self.near_probability(receiver);
        if u[1] < probability {
            // The second number adds bits below the 24 of the first.
            let rest = (u[1] / probability).min(1.0f32.next_down());
            return SelectedGroup::Near {
                probability,
                u: f64::from(u[0]) + f64::from(rest) * 2f64.powi(-24),
            };
        }
        let chosen =
            self.far_table.sample(((u[1] - probability) / (1.0 - probability)).min(1.0f32.next_down()));
        // Empty for receivers to which no light is linked.
        let Some(&index) = self.far.get(chosen.index) else { return SelectedGroup::Far(SelectedLight::NONE) };
        SelectedGroup::Far(SelectedLight { index, pdf_discrete: (1.0 - probability) * chosen.pdf_discrete })
    }

    /// The probability of selecting from the lights at a position.
    #[inline(always)]
    fn near_probability(&self, receiver: &Receiver<'_>) -> f32 {
        match (self.has_near, self.far.is_empty()) {
            (true, true) => 1.0,
            (false, _) => 0.0,
            (true, false) => {
                let near = self.tree.irradiance(receiver);
                // The estimate is 0 only where no light arrives.
                if near <= 0.0 {
                    return 0.0;
                }
                if self.far_irradiance <= 0.0 {
                    return 1.0;
                }
                // The square root is a compromise, since the estimates ignore occlusion: selection in proportion to the estimates has no
                // noise where both groups are visible, and much where the stronger one is occluded.
                let weight = receiver.weights.map_or(1.0, |weights| weights.far);
                let (near, far) = (near.sqrt(), (self.far_irradiance * weight).sqrt());
                let probability = near / (near + far);
                let probability =
                    if probability > MIN_GROUP_PROBABILITY { probability } else { MIN_GROUP_PROBABILITY };
                if probability < 1.0 - MIN_GROUP_PROBABILITY {
                    probability
                } else {
                    1.0 - MIN_GROUP_PROBABILITY
                }
            }
        }
    }

    /// The probability of selecting a light at a position.
    #[inline(always)]
    pub fn pdf_discrete(&self, receiver: &Receiver<'_>, index: u32) -> f32 {
        if self.is_single {
            return 1.0;
        }
        self.near_probability(receiver) * self.tree.pdf_discrete(receiver, index)
    }

    /// The probability of selecting from the lights at infinity.
    #[inline(always)]
    pub fn far_pdf_discrete(&self, receiver: &Receiver<'_>) -> f32 {
        1.0 - self.near_probability(receiver)
    }

    /// The probability of selecting light `index` among the lights at infinity; 0 for other lights.
    pub fn pdf_among_far(&self, index: u32) -> f32 {
        self.far.iter().position(|&far| far == index).map_or(0.0, |entry| self.far_table.pdf_discrete(entry))
    }

    /// The probability of selecting the last of the lights at infinity among them.
    #[inline(always)]
    pub fn pdf_of_last_far(&self) -> f32 {
        self.far_table.pdf_discrete(self.far_table.len() - 1)
    }
}

/// Keyframes of a light at equal time steps.
#[derive(Clone, Debug)]
pub struct MovingLight<T>(pub Vec<T>);

/// The moving lights of a scene, by index in [`Lights::area`] and [`Lights::punctual`].
#[derive(Clone, Debug, Default)]
pub struct LightMotions {
    /// Emissive surfaces.
    pub area: BTreeMap<usize, MovingLight<AreaLight>>,
    /// Lights without a surface.
    pub punctual: BTreeMap<usize, MovingLight<PunctualLight>>,
}

impl LightMotions {
    /// Are all lights static?
    pub fn is_empty(&self) -> bool {
        self.area.is_empty() && self.punctual.is_empty()
    }
}

impl<T: LightSource> MovingLight<T> {
    /// The keys before and after a shutter time in 0..1, and the interpolation weight of the latter.
    #[inline]
    fn keys_at(&self, time: f32) -> (&T, &T, f32) {
        let (key, t) = segment(self.0.len(), time);
        (&self.0[key], &self.0[(key + 1).min(self.0.len() - 1)], t)
    }

    /// Bounds of all keys, with the mean weight; `None` for lights at infinity.
    fn bounds(&self, textures: &CompiledTextures) -> Option<LightBounds> {
        let all: Option<Vec<LightBounds>> = self.0.iter().map(|light| light.bounds(textures)).collect();
        let all = all?;
        let sum = all.iter().copied().reduce(|a, b| a.union(&b)).unwrap_or(LightBounds::DARK);
        Some(LightBounds { weight: sum.weight / (all.len() as f32).max(1.0), ..sum })
    }
}

impl MovingLight<AreaLight> {
    /// The light at a shutter time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> AreaLight {
        let (from, to, t) = self.keys_at(time);
        from.interpolate(to, t)
    }

    /// [`AreaLight::sample`] at a shutter time. Shadow rays end farther before the light than for static lights, since they are transformed
    /// to the space of moving instances in single precision.
    pub fn sample(
        &self,
        textures: &CompiledTextures,
        reference: Vec3,
        u: [f32; 2],
        time: f32,
    ) -> LightSample {
        let light = self.at(time);
        let sample = light.sample(textures, reference, u);
        let error = (reference.abs() + sample.target.abs()) * gamma(8);
        let normal = light.normal_at(sample.target, reference);
        LightSample { target: offset_ray_origin(sample.target, error, normal, -sample.wi), ..sample }
    }
}

impl MovingLight<PunctualLight> {
    /// The light at a shutter time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> PunctualLight {
        let (from, to, t) = self.keys_at(time);
        from.interpolate(to, t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;
    use crate::light::{AreaShape, Edges, Radiance};
    use crate::math::DVec3;
    use crate::sampling::chi2::Random;
    use crate::scene::{Environment, Light, LightKind};

    /// Area lights on a ceiling, a directional light and a constant sky.
    fn mixed() -> Lights {
        let area_light = |x: f32| {
            let edges =
                Edges { corner: Vec3::new(x, 3.0, 0.0), edge_u: Vec3::X * 0.2, edge_v: Vec3::Z * 0.2 };
            AreaLight::new(AreaShape::Rectangle(edges), true, Radiance::Constant(Rgb::splat(40.0)))
        };
        let sun = Light::new(LightKind::Directional { direction: DVec3::NEG_Y }, [2.0; 3]);
        let sky = EnvironmentLight::new(&Environment::Constant([0.5; 3]), &[], true);
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let area = (0..5).map(|i| area_light(i as f32)).collect();
        Lights::new(area, vec![PunctualLight::new(&sun, DVec3::ZERO)], sky, &textures)
    }

    #[test]
    fn selection_frequencies_match_probabilities() {
        const N: usize = 40_000;
        let (lights, mut random) = (mixed(), Random::new(3));
        for _ in 0..20 {
            let p = Vec3::new(12.0 * random.next() - 4.0, 5.0 * random.next(), 8.0 * random.next() - 4.0);
            let receiver = Receiver::new(p, random.direction());
            let far = lights.far_pdf_discrete(0, &receiver);
            let expected = |index: u32| match index {
                6 => far * lights.environment_pdf_discrete(0),
                5 => far * (1.0 - lights.environment_pdf_discrete(0)),
                _ => lights.pdf_discrete(0, &receiver, index),
            };
            let mut counts = [0; 7];
            for _ in 0..N {
                let chosen = lights.select(0, &receiver, [random.next(), random.next()]);
                if chosen.pdf_discrete > 0.0 {
                    let pdf = expected(chosen.index);
                    assert!((chosen.pdf_discrete - pdf).abs() <= 1e-5, "{}: {pdf}", chosen.index);
                    counts[chosen.index as usize] += 1;
                }
            }
            for (index, count) in (0..).zip(counts) {
                let (pdf, fraction) = (expected(index), count as f32 / N as f32);
                let deviation = (pdf * (1.0 - pdf) / N as f32).sqrt();
                assert!((fraction - pdf).abs() <= 5.0 * deviation + 1e-4, "{index}: {fraction} {pdf}");
            }
            assert!(far >= MIN_GROUP_PROBABILITY - 1e-6);
        }
    }

    #[test]
    fn hidden_far_lights_are_not_selected_where_others_arrive() {
        let mut lights = mixed();
        lights.exclude_infinite_lights();
        let below = Receiver::new(Vec3::new(2.0, 0.0, 0.0), Vec3::Y);
        assert_eq!(lights.far_pdf_discrete(0, &below), 0.0);
        assert!((0..100).all(|i| lights.select(0, &below, [0.5, i as f32 / 100.0]).index < 5));
    }
}
