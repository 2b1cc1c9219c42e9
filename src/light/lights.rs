//! All lights of a scene, the choice of one of them, and lights that move while the shutter is open.

use super::{
    AreaLight, Descent, EnvironmentLight, LightBounds, LightSample, LightSource, LightTree, PunctualLight,
    PunctualSource, RECTANGLE_NUMBERS, Receiver, Sun, UniformRectangle, VolumeLight,
};
use crate::math::{Vec3, gamma, offset_ray_origin, segment};
use crate::sampling::AliasTable;
use crate::texture::CompiledTextures;
use std::collections::BTreeMap;
use std::f32::consts::PI;

/// All lights; their indices run through the area lights, the punctual lights, the emissive media, then the environment.
///
/// See `LightSampler` for the choice of one of them.
#[derive(Clone, Debug)]
pub struct Lights {
    area: Vec<AreaLight>,
    punctual: Vec<PunctualLight>,
    /// In the order of their media.
    volumes: Vec<VolumeLight>,
    environment: Option<EnvironmentLight>,
    /// Chooses for receivers of class 0: among all lights, unless some are linked.
    sampler: LightSampler,
    /// Choose for receivers of further classes, each of which has lights of its own linked to it.
    linked: Vec<LightSampler>,
    suns: Vec<SelectedSun>,
    /// All lights if they are static [`UniformRectangle`]s; else empty.
    rectangles: Vec<[f32; RECTANGLE_NUMBERS]>,
    motions: LightMotions,
    /// The emission of some area lights depends on the hit.
    emits_by_hit: bool,
}

/// A sun among the lights.
#[derive(Clone, Debug)]
pub struct SelectedSun {
    /// The sun.
    pub sun: Sun,
    /// Its index.
    pub index: u32,
    /// For each class of receivers the probability of choosing it among the lights infinitely far away.
    pub pdf_discrete: Vec<f32>,
    /// Do cameras see it?
    pub is_seen: bool,
}

impl Lights {
    /// Lights that stand still.
    pub fn new(
        area: Vec<AreaLight>,
        punctual: Vec<PunctualLight>,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
    ) -> Lights {
        Lights::moving((area, punctual, Vec::new()), LightMotions::default(), environment, textures)
    }

    /// Lights some of which move.
    pub fn moving(
        (area, punctual, volumes): (Vec<AreaLight>, Vec<PunctualLight>, Vec<VolumeLight>),
        motions: LightMotions,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
    ) -> Lights {
        let (suns, rectangles, linked) = (Vec::new(), Vec::new(), Vec::new());
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
            rectangles,
            motions,
            emits_by_hit,
        };
        lights.sampler = lights.sampler_of(textures, |_| true);
        lights.suns = lights.find_suns();
        lights.rectangles = lights.find_rectangles();
        lights
    }

    /// Bytes that lights, the trees over them and the environment take.
    pub fn bytes(&self) -> usize {
        let samplers = std::iter::once(&self.sampler).chain(&self.linked);
        size_of_val(&self.area[..])
            + size_of_val(&self.punctual[..])
            + self.volumes.iter().map(VolumeLight::bytes).sum::<usize>()
            + size_of_val(&self.rectangles[..])
            + samplers.map(|sampler| sampler.tree.bytes()).sum::<usize>()
            + self.environment.as_ref().map_or(0, EnvironmentLight::bytes)
    }

    /// Does the emission of some area lights depend on the hit?
    #[inline(always)]
    pub fn emits_by_hit(&self) -> bool {
        self.emits_by_hit
    }

    /// Does the emission of a light depend on the hit?
    #[inline(always)]
    pub fn light_emits_by_hit(&self, index: u32) -> bool {
        self.emits_by_hit && self.area.get(index as usize).is_some_and(AreaLight::emits_by_hit)
    }

    /// Lets receivers of each class choose among the lights for which `is_linked(class, light)` holds.
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
            let is_there = has(i as u32);
            bounds.push(is_there.then(of_light).flatten().unwrap_or(LightBounds::DARK));
            near += usize::from(is_there);
        }
        for (i, light) in self.punctual.iter().enumerate() {
            let index = (self.area.len() + i) as u32;
            let is_there = has(index);
            let moving = self.motions.punctual.get(&i);
            let of_light = || moving.map_or_else(|| light.bounds(textures), |m| m.bounds(textures));
            // The tree has a dark entry for a light at infinity.
            bounds.push(is_there.then(of_light).flatten().unwrap_or(LightBounds::DARK));
            match light.irradiance() {
                Some(irradiance) if is_there => far.push((index, irradiance)),
                None if is_there => near += 1,
                _ => {}
            }
        }
        for (i, volume) in self.volumes.iter().enumerate() {
            let is_there = has(self.first_volume() + i as u32);
            bounds.push(is_there.then(|| volume.bounds(textures)).flatten().unwrap_or(LightBounds::DARK));
            near += usize::from(is_there);
        }
        // The irradiance of a hemisphere of its mean radiance.
        let index = self.first_volume() + self.volumes.len() as u32;
        let sampled = self.environment.iter().filter(|e| e.is_sampled() && has(index));
        far.extend(sampled.map(|e| (index, e.mean_luminance() * PI)));
        LightSampler::new(&bounds, near, &far, self.count_sampled() == 1)
    }

    /// The sampler of a class of receivers.
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
            Some(SelectedSun { sun, index, pdf_discrete, is_seen: false })
        };
        self.punctual.iter().enumerate().filter_map(sun).collect()
    }

    fn find_rectangles(&self) -> Vec<[f32; RECTANGLE_NUMBERS]> {
        if self.area.len() < self.count_sampled() || self.are_moving() {
            return Vec::new();
        }
        let rectangles = self.area.iter().map(|light| Some(UniformRectangle::of(light)?.pack()));
        rectangles.collect::<Option<_>>().unwrap_or_default()
    }

    /// No light from infinity arrives: it is chosen only where no other light arrives either.
    pub fn hide_far(&mut self) {
        self.sampler.hide_far();
        self.linked.iter_mut().for_each(LightSampler::hide_far);
    }

    /// Makes a sun visible to cameras; an index of the punctual lights.
    pub fn show_sun(&mut self, punctual: u32) {
        let index = self.area.len() as u32 + punctual;
        self.suns.iter_mut().filter(|s| s.index == index).for_each(|s| s.is_seen = true);
    }

    /// Drops all but the environment.
    pub fn into_environment(self) -> Option<EnvironmentLight> {
        self.environment
    }

    /// Is there nothing to sample?
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.count_sampled() == 0
    }

    /// How many there are, the environment included.
    pub fn len(&self) -> usize {
        self.area.len() + self.punctual.len() + self.volumes.len() + usize::from(self.environment.is_some())
    }

    /// Number of lights that light samples are taken of.
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

    /// The light that a medium is, with its index.
    #[inline]
    pub fn volume_of_medium(&self, medium: u16) -> Option<(u32, &VolumeLight)> {
        let at = self.volumes.binary_search_by_key(&medium, VolumeLight::medium).ok()?;
        Some((self.first_volume() + at as u32, &self.volumes[at]))
    }

    /// The emissive medium of this index; `None` for other lights.
    #[inline(always)]
    pub fn volume(&self, index: u32) -> Option<&VolumeLight> {
        self.volumes.get(index.checked_sub(self.first_volume())? as usize)
    }

    /// The suns among the punctual lights.
    #[inline(always)]
    pub fn suns(&self) -> &[SelectedSun] {
        &self.suns
    }

    /// All lights, packed, if all are static [`UniformRectangle`]s.
    #[inline(always)]
    pub fn rectangles(&self) -> Option<&[[f32; RECTANGLE_NUMBERS]]> {
        (!self.rectangles.is_empty()).then_some(&self.rectangles)
    }

    /// The scene's light, if there is one alone and it is a [`UniformRectangle`] that stands still.
    pub fn single_rectangle(&self) -> Option<UniformRectangle> {
        match self.rectangles()? {
            [numbers] => Some(UniformRectangle::unpack(*numbers)),
            _ => None,
        }
    }

    /// The scene's light, if there is one alone and it is an environment image that is sampled, without portals.
    pub fn single_environment_image(&self) -> Option<&super::ImageMap> {
        let is_single = |e: &&EnvironmentLight| self.len() == 1 && e.is_sampled() && !e.has_portals();
        self.environment().filter(is_single).and_then(EnvironmentLight::image_map)
    }

    /// Is there one light alone, of a kind that is sampled at many vertices at a time?
    pub fn is_vectorised(&self) -> bool {
        self.single_rectangle().is_some() || self.single_environment_image().is_some()
    }

    /// The environment.
    #[inline(always)]
    pub fn environment(&self) -> Option<&EnvironmentLight> {
        self.environment.as_ref()
    }

    /// Are light samples taken of the environment, if there is one?
    #[inline(always)]
    pub fn samples_environment(&self) -> bool {
        self.environment.as_ref().is_some_and(EnvironmentLight::is_sampled)
    }

    /// Does the choice depend on the receiver? It doesn't for a single light.
    pub fn use_tree(&self) -> bool {
        self.count_sampled() > 1 && self.samplers().any(|sampler| sampler.has_near)
    }

    /// Chooses a light for a receiver of a class by two numbers in 0..1.
    #[inline(always)]
    pub fn select(&self, class: u32, receiver: &Receiver, u: [f32; 2]) -> SelectedLight {
        let sampler = self.sampler_of_class(class);
        match sampler.select_group(receiver, u) {
            SelectedGroup::Near { share, u } => SelectedLight::near(share, sampler.tree.sample(receiver, u)),
            SelectedGroup::Far(selected) => selected,
        }
    }

    /// [`Lights::select`] for the first `count` receivers, all of class 0, together.
    #[inline(always)]
    pub fn select_together<const N: usize>(
        &self,
        receivers: &[Receiver; N],
        numbers: &[[f32; 2]; N],
        count: usize,
    ) -> [SelectedLight; N] {
        let (mut selected, mut shares) = ([SelectedLight::NONE; N], [0.0; N]);
        let mut descents = [Descent::ENDED; N];
        for i in 0..count.min(N) {
            match self.sampler.select_group(&receivers[i], numbers[i]) {
                SelectedGroup::Near { share, u } => (shares[i], descents[i]) = (share, Descent::new(u)),
                SelectedGroup::Far(of_far) => selected[i] = of_far,
            }
        }
        self.sampler.tree.descend_together(receivers, &mut descents);
        for i in 0..count.min(N) {
            if shares[i] > 0.0 {
                selected[i] = SelectedLight::near(shares[i], descents[i].chosen());
            }
        }
        selected
    }

    /// [`Lights::select`] for receivers of several classes, one after another.
    pub fn select_by_class<const N: usize>(
        &self,
        class: impl Fn(usize) -> u32,
        receivers: &[Receiver; N],
        numbers: &[[f32; 2]; N],
        count: usize,
    ) -> [SelectedLight; N] {
        std::array::from_fn(|i| match i < count {
            true => self.select(class(i), &receivers[i], numbers[i]),
            false => SelectedLight::NONE,
        })
    }

    /// The probability of choosing an area light or an emissive medium for a receiver of a class.
    #[inline(always)]
    pub fn pdf_discrete(&self, class: u32, receiver: &Receiver, index: u32) -> f32 {
        self.sampler_of_class(class).pdf_discrete(receiver, index)
    }

    /// The probability of choosing among the lights infinitely far away.
    #[inline(always)]
    pub fn far_pdf_discrete(&self, class: u32, receiver: &Receiver) -> f32 {
        self.sampler_of_class(class).far_pdf_discrete(receiver)
    }

    /// The probability of choosing the environment among the lights infinitely far away, for receivers of
    /// a class.
    #[inline(always)]
    pub fn environment_pdf_discrete(&self, class: u32) -> f32 {
        if self.samples_environment() { self.sampler_of_class(class).pdf_of_last_far() } else { 0.0 }
    }

    /// The middle of a light; `None` for one infinitely far away.
    pub fn middle(&self, index: u32) -> Option<Vec3> {
        let index = index as usize;
        match self.area.get(index) {
            Some(light) => Some(light.middle()),
            None => match self.volume(index as u32) {
                Some(volume) => Some(volume.middle()),
                None => self.punctual.get(index - self.area.len())?.position(),
            },
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
            Some(moving) => moving.at(time).sample(textures, reference, u),
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
            return light.sample(textures, reference, u);
        }
        if let Some(volume) = self.volume(index as u32) {
            return volume.sample(textures, reference, u);
        }
        let Some(environment) = &self.environment else { return LightSample::NONE };
        LightSource::sample(environment, textures, reference, u)
    }
}

/// Minimum probability of choosing among the lights at a position, and among those at infinity, where both may contribute: the
/// estimates ignore occlusion.
const MIN_SHARE: f32 = 0.25;

/// Chooses a light for a receiver: first between the lights at a position and those at infinity, by their estimated irradiance;
/// then among the former by a [`LightTree`], among the latter by their irradiance.
#[derive(Clone, Debug)]
struct LightSampler {
    /// Over the lights at a position.
    pub tree: LightTree,
    /// Is there any such light?
    pub has_near: bool,
    /// The lights at infinity.
    far: Vec<u32>,
    /// Chooses among them by irradiance.
    far_table: AliasTable,
    /// Luminance of their total irradiance.
    far_irradiance: f32,
    /// There is only one light.
    is_single: bool,
}

/// A chosen light.
#[derive(Clone, Copy, Debug)]
pub struct SelectedLight {
    /// Its index.
    pub index: u32,
    /// The probability of choosing it; 0 if none was found to choose.
    pub pdf_discrete: f32,
}

impl SelectedLight {
    const NONE: SelectedLight = SelectedLight { index: 0, pdf_discrete: 0.0 };

    /// A selection among the lights near a point, which has the probability `share`.
    #[inline(always)]
    pub fn near(share: f32, chosen: Option<(u32, f32)>) -> SelectedLight {
        chosen.map_or(SelectedLight::NONE, |(index, pdf)| SelectedLight { index, pdf_discrete: share * pdf })
    }
}

/// The group from which a light is chosen.
enum SelectedGroup {
    /// Lights at a position, with the probability of the group and a number in 0..1 for the choice in it.
    Near { share: f32, u: f64 },
    /// A light at infinity, or the only one, already chosen.
    Far(SelectedLight),
}

impl LightSampler {
    /// Among lights with such bounds, of which `near` are at some place, and lights infinitely far away with their irradiances;
    /// `is_single` if that is one light in all.
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

    /// No light from infinity arrives: it is chosen only where no other light arrives either.
    pub fn hide_far(&mut self) {
        self.far_irradiance = 0.0;
    }

    /// Chooses between the lights at some place and those infinitely far away, and among the latter.
    #[inline(always)]
    pub fn select_group(&self, receiver: &Receiver, u: [f32; 2]) -> SelectedGroup {
        if self.is_single {
            return SelectedGroup::Far(SelectedLight { index: 0, pdf_discrete: 1.0 });
        }
        let share = self.near_share(receiver);
        if u[1] < share {
            // The second number adds digits below the first one's 24.
            let rest = (u[1] / share).min(1.0f32.next_down());
            return SelectedGroup::Near { share, u: f64::from(u[0]) + f64::from(rest) * 2f64.powi(-24) };
        }
        let chosen = self.far_table.sample(((u[1] - share) / (1.0 - share)).min(1.0f32.next_down()));
        // Objects that no light is linked to have none.
        let Some(&index) = self.far.get(chosen.index) else { return SelectedGroup::Far(SelectedLight::NONE) };
        SelectedGroup::Far(SelectedLight { index, pdf_discrete: (1.0 - share) * chosen.pdf_discrete })
    }

    /// The probability of choosing among the lights at some place.
    #[inline(always)]
    fn near_share(&self, receiver: &Receiver) -> f32 {
        match (self.has_near, self.far.is_empty()) {
            (true, true) => 1.0,
            (false, _) => 0.0,
            (true, false) => {
                let near = self.tree.irradiance(receiver);
                // Nothing is 0 where light arrives.
                if near <= 0.0 {
                    return 0.0;
                }
                if self.far_irradiance <= 0.0 {
                    return 1.0;
                }
                let share = near / (near + self.far_irradiance);
                let share = if share > MIN_SHARE { share } else { MIN_SHARE };
                if share < 1.0 - MIN_SHARE { share } else { 1.0 - MIN_SHARE }
            }
        }
    }

    /// The probability of choosing an area light.
    #[inline(always)]
    pub fn pdf_discrete(&self, receiver: &Receiver, index: u32) -> f32 {
        if self.is_single {
            return 1.0;
        }
        self.near_share(receiver) * self.tree.pdf_discrete(receiver, index)
    }

    /// The probability of choosing among the lights infinitely far away.
    #[inline(always)]
    pub fn far_pdf_discrete(&self, receiver: &Receiver) -> f32 {
        1.0 - self.near_share(receiver)
    }

    /// The probability of choosing one of the lights infinitely far away among them; 0 if it is none of these.
    pub fn pdf_among_far(&self, index: u32) -> f32 {
        self.far.iter().position(|&far| far == index).map_or(0.0, |entry| self.far_table.pdf_discrete(entry))
    }

    /// The probability of choosing the last of them among them.
    #[inline(always)]
    pub fn pdf_of_last_far(&self) -> f32 {
        self.far_table.pdf_discrete(self.far_table.len() - 1)
    }
}

/// A light at equal steps of time; between two of them it is interpolated.
#[derive(Clone, Debug)]
pub struct MovingLight<T>(pub Vec<T>);

/// The moving lights of a scene, by their index in their lists.
#[derive(Clone, Debug, Default)]
pub struct LightMotions {
    /// Emissive surfaces.
    pub area: BTreeMap<usize, MovingLight<AreaLight>>,
    /// Lights without a surface.
    pub punctual: BTreeMap<usize, MovingLight<PunctualLight>>,
}

impl LightMotions {
    /// Does none move?
    pub fn is_empty(&self) -> bool {
        self.area.is_empty() && self.punctual.is_empty()
    }
}

impl<T: LightSource> MovingLight<T> {
    /// The keys before and after a time in 0..1, and the share of the way between them.
    #[inline]
    fn keys_at(&self, time: f32) -> (&T, &T, f32) {
        let (key, share) = segment(self.0.len(), time);
        (&self.0[key], &self.0[(key + 1).min(self.0.len() - 1)], share)
    }

    /// Bounds over all keys, with the mean weight; `None` for a light at infinity.
    fn bounds(&self, textures: &CompiledTextures) -> Option<LightBounds> {
        let all: Option<Vec<LightBounds>> = self.0.iter().map(|light| light.bounds(textures)).collect();
        let all = all?;
        let sum = all.iter().copied().reduce(|a, b| a.union(&b)).unwrap_or(LightBounds::DARK);
        Some(LightBounds { weight: sum.weight / (all.len() as f32).max(1.0), ..sum })
    }
}

impl MovingLight<AreaLight> {
    /// The light at a time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> AreaLight {
        let (from, to, share) = self.keys_at(time);
        from.interpolate(to, share)
    }

    /// [`AreaLight::sample`] at a time. Shadow rays end a little farther before it than before lights that stand still: they are
    /// transformed to the space of moving instances in single precision.
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
    /// The light at a time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> PunctualLight {
        let (from, to, share) = self.keys_at(time);
        from.interpolate(to, share)
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

    /// Area lights on a ceiling, a distant light and an even sky.
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
    fn lights_are_chosen_as_often_as_their_probabilities_say() {
        const N: usize = 40_000;
        let (lights, mut random) = (mixed(), Random::new(3));
        for _ in 0..20 {
            let p = Vec3::new(12.0 * random.next() - 4.0, 5.0 * random.next(), 8.0 * random.next() - 4.0);
            let receiver = Receiver { p, normal: random.direction() };
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
                let (pdf, share) = (expected(index), count as f32 / N as f32);
                let deviation = (pdf * (1.0 - pdf) / N as f32).sqrt();
                assert!((share - pdf).abs() <= 5.0 * deviation + 1e-4, "{index}: {share} {pdf}");
            }
            assert!(far >= MIN_SHARE - 1e-6);
        }
    }

    #[test]
    fn hidden_lights_are_not_asked_where_others_arrive() {
        let mut lights = mixed();
        lights.hide_far();
        let below = Receiver { p: Vec3::new(2.0, 0.0, 0.0), normal: Vec3::Y };
        assert_eq!(lights.far_pdf_discrete(0, &below), 0.0);
        assert!((0..100).all(|i| lights.select(0, &below, [0.5, i as f32 / 100.0]).index < 5));
    }
}
