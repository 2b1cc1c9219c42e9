//! All lights of a scene and the choice of one of them.

use super::{
    AreaLight, Descent, EnvironmentLight, EvenRectangle, LightBounds, LightMotions, LightSample, LightTree,
    PunctualLight, RECTANGLE_NUMBERS, Receiver, Sun,
};
use crate::math::Vec3;
use crate::sampling::AliasTable;
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// All lights; their indices run through the area lights, the punctual ones, then the environment.
///
/// First it is chosen between the lights at some place and those infinitely far away, by estimates of the irradiance that
/// they bring to the receiver; then among the former by a [`LightTree`], among the latter by their irradiance.
#[derive(Clone, Debug)]
pub struct Lights {
    area: Vec<AreaLight>,
    punctual: Vec<PunctualLight>,
    environment: Option<EnvironmentLight>,
    /// Over the lights at some place.
    tree: LightTree,
    /// Is there any such light?
    has_near: bool,
    /// The lights infinitely far away.
    far: Vec<u32>,
    /// By their irradiance.
    far_table: AliasTable,
    /// Luminance of the irradiance that all of these bring.
    far_irradiance: f32,
    suns: Vec<SelectedSun>,
    /// All lights, if they are nothing but such rectangles; else empty.
    rectangles: Vec<[f32; RECTANGLE_NUMBERS]>,
    motions: LightMotions,
}

/// A sun among the lights.
#[derive(Clone, Copy, Debug)]
pub struct SelectedSun {
    /// The sun.
    pub sun: Sun,
    /// Its index and the probability of choosing it among the lights infinitely far away.
    pub selected: Selected,
    /// Do cameras see it?
    pub is_seen: bool,
}

/// Lights at some place, and lights infinitely far away, are chosen with at least this probability where they may bring light: how
/// much of it something is in the way of, the estimates don't know.
const LEAST_SHARE: f32 = 0.25;

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

    /// Of the lights at some place, which are chosen with a probability of `share`.
    #[inline(always)]
    fn near(share: f32, chosen: Option<(u32, f32)>) -> Selected {
        chosen.map_or(Selected::NONE, |(index, pdf)| Selected { index, pdf_discrete: share * pdf })
    }
}

/// Where a light is to be chosen.
enum Distance {
    /// Among those at some place, by a number in 0..1; the probability of getting there.
    Near { share: f32, u: f64 },
    /// It was: it is infinitely far away, or the only one.
    Far(Selected),
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
        let (mut bounds, mut far, mut irradiances) = (Vec::new(), Vec::new(), Vec::new());
        for (i, light) in area.iter().enumerate() {
            let moving = motions.area.get(&i);
            bounds.push(moving.map_or_else(|| light.bounds(textures), |m| m.bounds(textures)));
        }
        for (i, light) in punctual.iter().enumerate() {
            let of_light = motions.punctual.get(&i).map_or_else(|| light.bounds(), |m| m.bounds());
            // The place in the tree of one that is infinitely far away stays dark.
            bounds.push(of_light.unwrap_or(LightBounds::DARK));
            if let Some(irradiance) = light.irradiance() {
                far.push((area.len() + i) as u32);
                irradiances.push(irradiance);
            }
        }
        let has_near = far.len() < bounds.len();
        // Of a hemisphere of its mean radiance.
        irradiances.extend(environment.iter().map(|e| e.mean_luminance() * PI));
        far.extend(environment.iter().map(|_| (area.len() + punctual.len()) as u32));
        let tree = LightTree::new(&bounds);
        let far_table = AliasTable::new(if far.is_empty() { &[1.0] } else { &irradiances });
        let far_irradiance = irradiances.iter().sum();
        let (suns, rectangles) = (Vec::new(), Vec::new());
        let mut lights = Lights {
            area,
            punctual,
            environment,
            tree,
            has_near,
            far,
            far_table,
            far_irradiance,
            suns,
            rectangles,
            motions,
        };
        lights.suns = lights.find_suns();
        lights.rectangles = lights.find_rectangles();
        lights
    }

    fn find_suns(&self) -> Vec<SelectedSun> {
        let sun = |(i, light): (usize, &PunctualLight)| {
            let (sun, index) = (*light.sun()?, (self.area.len() + i) as u32);
            let entry = self.far.iter().position(|&far| far == index)?;
            let selected = Selected { index, pdf_discrete: self.far_table.pdf_discrete(entry) };
            Some(SelectedSun { sun, selected, is_seen: false })
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
        self.far_irradiance = 0.0;
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
        self.len() == 0
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

    /// Does the choice depend on the receiver? It doesn't for a single light.
    pub fn use_tree(&self) -> bool {
        self.len() > 1 && self.has_near
    }

    /// Chooses a light by two numbers in 0..1.
    #[inline(always)]
    pub fn select(&self, receiver: &Receiver, u: [f32; 2]) -> Selected {
        match self.choose_distance(receiver, u) {
            Distance::Near { share, u } => Selected::near(share, self.tree.sample(receiver, u)),
            Distance::Far(selected) => selected,
        }
    }

    /// [`Lights::select`] for many receivers, the first `count` of the lists, side by side.
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
            match self.choose_distance(&receivers[i], numbers[i]) {
                Distance::Near { share, u } => (shares[i], descents[i]) = (share, Descent::new(u)),
                Distance::Far(of_far) => selected[i] = of_far,
            }
        }
        self.tree.descend_together(receivers, &mut descents);
        for i in 0..count.min(N) {
            if shares[i] > 0.0 {
                selected[i] = Selected::near(shares[i], descents[i].chosen());
            }
        }
        selected
    }

    /// Chooses between the lights at some place and those infinitely far away, and among the latter.
    #[inline(always)]
    fn choose_distance(&self, receiver: &Receiver, u: [f32; 2]) -> Distance {
        if self.len() == 1 {
            return Distance::Far(Selected { index: 0, pdf_discrete: 1.0 });
        }
        let share = self.near_share(receiver);
        if u[1] < share {
            // The second number adds digits below the first one's 24.
            let rest = (u[1] / share).min(1.0f32.next_down());
            return Distance::Near { share, u: f64::from(u[0]) + f64::from(rest) * 2f64.powi(-24) };
        }
        let chosen = self.far_table.sample(((u[1] - share) / (1.0 - share)).min(1.0f32.next_down()));
        Distance::Far(Selected {
            index: self.far[chosen.index],
            pdf_discrete: (1.0 - share) * chosen.pdf_discrete,
        })
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
                let share = if share > LEAST_SHARE { share } else { LEAST_SHARE };
                if share < 1.0 - LEAST_SHARE { share } else { 1.0 - LEAST_SHARE }
            }
        }
    }

    /// The probability of choosing an area light.
    #[inline(always)]
    pub fn pdf_discrete(&self, receiver: &Receiver, index: u32) -> f32 {
        if self.len() == 1 {
            return 1.0;
        }
        self.near_share(receiver) * self.tree.pdf_discrete(receiver, index)
    }

    /// The probability of choosing among the lights infinitely far away.
    #[inline(always)]
    pub fn far_pdf_discrete(&self, receiver: &Receiver) -> f32 {
        1.0 - self.near_share(receiver)
    }

    /// The probability of choosing the environment among the lights infinitely far away.
    #[inline(always)]
    pub fn environment_pdf_discrete(&self) -> f32 {
        self.far_table.pdf_discrete(self.far_table.len() - 1)
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
        let textures = CompiledTextures::new(&[], &[], Vec3::ZERO);
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
            let far = lights.far_pdf_discrete(&receiver);
            let expected = |index: u32| match index {
                6 => far * lights.environment_pdf_discrete(),
                5 => far * (1.0 - lights.environment_pdf_discrete()),
                _ => lights.pdf_discrete(&receiver, index),
            };
            let mut counts = [0; 7];
            for _ in 0..N {
                let chosen = lights.select(&receiver, [random.next(), random.next()]);
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
            assert!(far >= LEAST_SHARE - 1e-6);
        }
    }

    #[test]
    fn hidden_lights_are_not_asked_where_others_arrive() {
        let mut lights = mixed();
        lights.hide_far();
        let below = Receiver { p: Vec3::new(2.0, 0.0, 0.0), normal: Vec3::Y };
        assert_eq!(lights.far_pdf_discrete(&below), 0.0);
        assert!((0..100).all(|i| lights.select(&below, [0.5, i as f32 / 100.0]).index < 5));
    }
}
