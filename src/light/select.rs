//! All lights of a scene and the choice of one of them.

use super::choice::{Choice, Distance, Selected};
use super::{
    AreaLight, Descent, EnvironmentLight, EvenRectangle, LightBounds, LightMotions, LightSample,
    PunctualLight, RECTANGLE_NUMBERS, Receiver, Sun,
};
use crate::math::Vec3;
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// All lights; their indices run through the area lights, the punctual ones, then the environment.
///
/// One is chosen among those that light a receiver: first between the lights at some place and those infinitely far away, by
/// estimates of the irradiance that they bring to it; then among the former by a [`LightTree`](super::LightTree), among the latter by their
/// irradiance.
#[derive(Clone, Debug)]
pub struct Lights {
    area: Vec<AreaLight>,
    punctual: Vec<PunctualLight>,
    environment: Option<EnvironmentLight>,
    /// The choice that receivers of class 0 have: among all lights, unless some are linked.
    choice: Choice,
    /// Those of further classes, of which each has lights of its own linked to it.
    linked: Vec<Choice>,
    suns: Vec<SelectedSun>,
    /// All lights, if they are nothing but such rectangles; else empty.
    rectangles: Vec<[f32; RECTANGLE_NUMBERS]>,
    motions: LightMotions,
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
    /// Prepares the choice.
    pub fn new(
        area: Vec<AreaLight>,
        punctual: Vec<PunctualLight>,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
    ) -> Lights {
        Lights::moving((area, punctual), LightMotions::default(), environment, textures)
    }

    /// The same with lights some of which move.
    pub fn moving(
        (area, punctual): (Vec<AreaLight>, Vec<PunctualLight>),
        motions: LightMotions,
        environment: Option<EnvironmentLight>,
        textures: &CompiledTextures,
    ) -> Lights {
        let (suns, rectangles, linked) = (Vec::new(), Vec::new(), Vec::new());
        let choice = Choice::new(&[], 0, &[], false);
        let mut lights = Lights { area, punctual, environment, choice, linked, suns, rectangles, motions };
        lights.choice = lights.choice_among(textures, |_| true);
        lights.suns = lights.find_suns();
        lights.rectangles = lights.find_rectangles();
        lights
    }

    /// Bytes that lights, the trees over them and the environment take.
    pub fn bytes(&self) -> usize {
        let choices = std::iter::once(&self.choice).chain(&self.linked);
        size_of_val(&self.area[..])
            + size_of_val(&self.punctual[..])
            + size_of_val(&self.rectangles[..])
            + choices.map(|choice| choice.tree.bytes()).sum::<usize>()
            + self.environment.as_ref().map_or(0, EnvironmentLight::bytes)
    }

    /// Lets the receivers of each class choose among the lights that are linked to it; of class and light.
    pub fn link(
        &mut self,
        classes: usize,
        textures: &CompiledTextures,
        is_linked: impl Fn(usize, u32) -> bool,
    ) {
        let mut choices = (0..classes).map(|c| self.choice_among(textures, |light| is_linked(c, light)));
        let (choice, linked) = (choices.next(), choices.collect());
        (self.choice, self.linked) = (choice.unwrap_or_else(|| self.choice.clone()), linked);
        self.suns = self.find_suns();
    }

    /// The choice among some of the lights.
    fn choice_among(&self, textures: &CompiledTextures, has: impl Fn(u32) -> bool) -> Choice {
        let (mut bounds, mut far, mut near) = (Vec::new(), Vec::new(), 0);
        for (i, light) in self.area.iter().enumerate() {
            let of_light =
                || self.motions.area.get(&i).map_or_else(|| light.bounds(textures), |m| m.bounds(textures));
            let is_there = has(i as u32);
            bounds.push(if is_there { of_light() } else { LightBounds::DARK });
            near += usize::from(is_there);
        }
        for (i, light) in self.punctual.iter().enumerate() {
            let index = (self.area.len() + i) as u32;
            let is_there = has(index);
            let of_light = self.motions.punctual.get(&i).map_or_else(|| light.bounds(), |m| m.bounds());
            // The place in the tree of one that is infinitely far away stays dark.
            bounds.push(of_light.filter(|_| is_there).unwrap_or(LightBounds::DARK));
            match light.irradiance() {
                Some(irradiance) if is_there => far.push((index, irradiance)),
                None if is_there => near += 1,
                _ => {}
            }
        }
        // Of a hemisphere of its mean radiance.
        let index = (self.area.len() + self.punctual.len()) as u32;
        let sampled = self.environment.iter().filter(|e| e.is_sampled() && has(index));
        far.extend(sampled.map(|e| (index, e.mean_luminance() * PI)));
        Choice::new(&bounds, near, &far, self.len() == 1)
    }

    /// The choice that receivers of a class have.
    #[inline(always)]
    fn choice_of(&self, class: u32) -> &Choice {
        if class == 0 { &self.choice } else { &self.linked[class as usize - 1] }
    }

    fn choices(&self) -> impl Iterator<Item = &Choice> {
        std::iter::once(&self.choice).chain(&self.linked)
    }

    fn find_suns(&self) -> Vec<SelectedSun> {
        let sun = |(i, light): (usize, &PunctualLight)| {
            let (sun, index) = (*light.sun()?, (self.area.len() + i) as u32);
            let pdf_discrete = self.choices().map(|choice| choice.pdf_among_far(index)).collect();
            Some(SelectedSun { sun, index, pdf_discrete, is_seen: false })
        };
        self.punctual.iter().enumerate().filter_map(sun).collect()
    }

    fn find_rectangles(&self) -> Vec<[f32; RECTANGLE_NUMBERS]> {
        if self.area.len() < self.len() || self.are_moving() {
            return Vec::new();
        }
        let rectangles = self.area.iter().map(|light| Some(EvenRectangle::of(light)?.pack()));
        rectangles.collect::<Option<_>>().unwrap_or_default()
    }

    /// Nothing arrives from infinitely far away: it is chosen only where no other light arrives either.
    pub fn hide_far(&mut self) {
        self.choice.hide_far();
        self.linked.iter_mut().for_each(Choice::hide_far);
    }

    /// Lets cameras see one of the punctual lights, a sun.
    pub fn show_sun(&mut self, punctual: u32) {
        let index = self.area.len() as u32 + punctual;
        self.suns.iter_mut().filter(|s| s.index == index).for_each(|s| s.is_seen = true);
    }

    /// Gives up all but the environment.
    pub fn into_environment(self) -> Option<EnvironmentLight> {
        self.environment
    }

    /// Is there nothing to sample?
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.area.is_empty() && self.punctual.is_empty() && !self.samples_environment()
    }

    /// How many there are, the environment included.
    pub fn len(&self) -> usize {
        self.area.len() + self.punctual.len() + usize::from(self.environment.is_some())
    }

    /// Is there nothing but an environment that is no picture, and without portals?
    pub fn are_an_even_sky(&self) -> bool {
        let is_even = |e: &EnvironmentLight| e.image_map().is_none() && !e.has_portals();
        self.len() == 1 && self.environment.as_ref().is_some_and(is_even)
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

    /// The numbers of all lights, by index, if all are [`EvenRectangle`]s that stand still.
    #[inline(always)]
    pub fn rectangles(&self) -> Option<&[[f32; RECTANGLE_NUMBERS]]> {
        (!self.rectangles.is_empty()).then_some(&self.rectangles)
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
        self.len() > 1 && self.choices().any(|choice| choice.has_near)
    }

    /// Chooses a light for a receiver of a class by two numbers in 0..1.
    #[inline(always)]
    pub fn select(&self, class: u32, receiver: &Receiver, u: [f32; 2]) -> Selected {
        let choice = self.choice_of(class);
        match choice.choose_distance(receiver, u) {
            Distance::Near { share, u } => Selected::near(share, choice.tree.sample(receiver, u)),
            Distance::Far(selected) => selected,
        }
    }

    /// [`Lights::select`] for many receivers of class 0, the first `count` of the lists, side by side.
    #[inline(always)]
    pub fn select_together<const N: usize>(
        &self,
        receivers: &[Receiver; N],
        numbers: &[[f32; 2]; N],
        count: usize,
    ) -> [Selected; N] {
        let (mut selected, mut shares) = ([Selected::NONE; N], [0.0; N]);
        let mut descents = [Descent::ENDED; N];
        for i in 0..count.min(N) {
            match self.choice.choose_distance(&receivers[i], numbers[i]) {
                Distance::Near { share, u } => (shares[i], descents[i]) = (share, Descent::new(u)),
                Distance::Far(of_far) => selected[i] = of_far,
            }
        }
        self.choice.tree.descend_together(receivers, &mut descents);
        for i in 0..count.min(N) {
            if shares[i] > 0.0 {
                selected[i] = Selected::near(shares[i], descents[i].chosen());
            }
        }
        selected
    }

    /// The same of receivers of several classes, one after the other.
    pub fn select_by_class<const N: usize>(
        &self,
        class: impl Fn(usize) -> u32,
        receivers: &[Receiver; N],
        numbers: &[[f32; 2]; N],
        count: usize,
    ) -> [Selected; N] {
        std::array::from_fn(|i| match i < count {
            true => self.select(class(i), &receivers[i], numbers[i]),
            false => Selected::NONE,
        })
    }

    /// The probability of choosing an area light for a receiver of a class.
    #[inline(always)]
    pub fn pdf_discrete(&self, class: u32, receiver: &Receiver, index: u32) -> f32 {
        self.choice_of(class).pdf_discrete(receiver, index)
    }

    /// The probability of choosing among the lights infinitely far away.
    #[inline(always)]
    pub fn far_pdf_discrete(&self, class: u32, receiver: &Receiver) -> f32 {
        self.choice_of(class).far_pdf_discrete(receiver)
    }

    /// The probability of choosing the environment among the lights infinitely far away, for receivers of
    /// a class.
    #[inline(always)]
    pub fn environment_pdf_discrete(&self, class: u32) -> f32 {
        if self.samples_environment() { self.choice_of(class).pdf_of_last_far() } else { 0.0 }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;
    use crate::light::{AreaShape, Edges, Radiance};
    use crate::math::DVec3;
    use crate::sampling::chi2::Random;
    use crate::scene::{Environment, Light, LightKind};

    /// Lamps on a ceiling, a distant light and an even sky.
    fn mixed() -> Lights {
        let lamp = |x: f32| {
            let edges =
                Edges { corner: Vec3::new(x, 3.0, 0.0), edge_u: Vec3::X * 0.2, edge_v: Vec3::Z * 0.2 };
            AreaLight::new(AreaShape::Rectangle(edges), true, Radiance::Constant(Rgb::splat(40.0)))
        };
        let sun = Light::new(LightKind::Directional { direction: DVec3::NEG_Y }, [2.0; 3]);
        let sky = EnvironmentLight::new(&Environment::Constant([0.5; 3]), &[], true);
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let area = (0..5).map(|i| lamp(i as f32)).collect();
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
            assert!(far >= crate::light::choice::LEAST_SHARE - 1e-6);
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
