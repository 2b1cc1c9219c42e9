//! The choice of one light among those that light a receiver.

use super::{LightBounds, LightTree, Receiver};
use crate::sampling::AliasTable;

/// Lights at some place, and lights infinitely far away, are chosen with at least this probability where they may bring light: how
/// much of it something is in the way of, the estimates don't know.
pub(super) const LEAST_SHARE: f32 = 0.25;

/// First it is chosen between the lights at some place and those infinitely far away, by estimates of the irradiance that
/// they bring to the receiver; then among the former by a [`LightTree`], among the latter by their irradiance.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    /// Over the lights at some place.
    pub tree: LightTree,
    /// Is there any such light?
    pub has_near: bool,
    /// The lights infinitely far away.
    far: Vec<u32>,
    /// By their irradiance.
    far_table: AliasTable,
    /// Luminance of the irradiance that all of these bring.
    far_irradiance: f32,
    /// There is one light only, chosen in any case.
    is_single: bool,
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
    pub(super) const NONE: Selected = Selected { index: 0, pdf_discrete: 0.0 };

    /// Of the lights at some place, which are chosen with a probability of `share`.
    #[inline(always)]
    pub fn near(share: f32, chosen: Option<(u32, f32)>) -> Selected {
        chosen.map_or(Selected::NONE, |(index, pdf)| Selected { index, pdf_discrete: share * pdf })
    }
}

/// Where a light is to be chosen.
pub(super) enum Distance {
    /// Among those at some place, by a number in 0..1; the probability of getting there.
    Near { share: f32, u: f64 },
    /// It was: it is infinitely far away, or the only one.
    Far(Selected),
}

impl Choice {
    /// Among lights with such bounds, of which `near` are at some place, and lights infinitely far away with their irradiances;
    /// `is_single` if that is one light in all.
    pub fn new(bounds: &[LightBounds], near: usize, far: &[(u32, f32)], is_single: bool) -> Choice {
        let irradiances: Vec<f32> = far.iter().map(|&(_, irradiance)| irradiance).collect();
        Choice {
            tree: LightTree::new(bounds),
            has_near: near > 0,
            far: far.iter().map(|&(light, _)| light).collect(),
            far_table: AliasTable::new(if far.is_empty() { &[1.0] } else { &irradiances }),
            far_irradiance: irradiances.iter().sum(),
            is_single,
        }
    }

    /// Nothing arrives from infinitely far away: it is chosen only where no other light arrives either.
    pub fn hide_far(&mut self) {
        self.far_irradiance = 0.0;
    }

    /// Chooses between the lights at some place and those infinitely far away, and among the latter.
    #[inline(always)]
    pub fn choose_distance(&self, receiver: &Receiver, u: [f32; 2]) -> Distance {
        if self.is_single {
            return Distance::Far(Selected { index: 0, pdf_discrete: 1.0 });
        }
        let share = self.near_share(receiver);
        if u[1] < share {
            // The second number adds digits below the first one's 24.
            let rest = (u[1] / share).min(1.0f32.next_down());
            return Distance::Near { share, u: f64::from(u[0]) + f64::from(rest) * 2f64.powi(-24) };
        }
        let chosen = self.far_table.sample(((u[1] - share) / (1.0 - share)).min(1.0f32.next_down()));
        // Objects that no light is linked to have none.
        let Some(&index) = self.far.get(chosen.index) else { return Distance::Far(Selected::NONE) };
        Distance::Far(Selected { index, pdf_discrete: (1.0 - share) * chosen.pdf_discrete })
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
