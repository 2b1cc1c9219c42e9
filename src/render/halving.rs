//! Which of a pixel's samples are the first half of them, where halves are kept apart.

use super::options::RenderOptions;
use crate::integrator::reuse::INTERVAL;
use crate::sampling::MOST_ARRANGED;

/// How samples are halved. Samples that follow each other are well spread together, so halves are made of runs of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Halving {
    /// The first so many are the first half.
    Before(u32),
    /// Runs take turns, so that there are two halves wherever rendering ends.
    Turns,
}

impl RenderOptions {
    /// Halves are runs up to the middle where it is known beforehand. Where samples end early or go on later, or where
    /// pixels' numbers differ (`is_allotted`), runs take turns.
    pub(super) fn halving(&self, is_allotted: bool) -> Halving {
        let is_open = self.time_limit.is_some() || self.noise.is_some() || self.planned > 0;
        match is_open || is_allotted || self.samples > MOST_ARRANGED {
            true => Halving::Turns,
            false => Halving::Before(self.samples / 2),
        }
    }
}

impl Halving {
    /// How many of `samples` from `first_sample` on belong to the first half: they come first. They lie within one block of
    /// [`INTERVAL`] samples.
    pub fn of_first_half(self, first_sample: u32, samples: u32) -> u32 {
        let left = match self {
            Halving::Before(middle) => middle.saturating_sub(first_sample),
            Halving::Turns => {
                // Shorter runs at first: pictures of few samples have halves, too.
                let turn = if first_sample < 2 * INTERVAL { INTERVAL } else { 2 * INTERVAL };
                (turn / 2).saturating_sub(first_sample % turn)
            }
        };
        left.min(samples)
    }

    /// Its name, where a picture goes on from another one.
    pub fn name(self) -> &'static str {
        match self {
            Halving::Before(_) => "at the middle",
            Halving::Turns => "by turns",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_as_large_at_multiples_of_a_block() {
        for end in (INTERVAL..400).step_by(INTERVAL as usize) {
            let of = |rule: Halving| -> u32 {
                (0..end).step_by(INTERVAL as usize).map(|first| rule.of_first_half(first, INTERVAL)).sum()
            };
            assert_eq!(of(Halving::Before(end / 2)), end / 2);
            let turns = of(Halving::Turns);
            assert!(turns.abs_diff(end - turns) <= INTERVAL, "{turns} of {end}");
        }
        // However passes divide a block.
        let parts = [(0, 1), (1, 4), (5, 3)].map(|(first, n)| Halving::Turns.of_first_half(first, n));
        assert_eq!(parts, [1, 3, 0]);
    }

    #[test]
    fn more_samples_do_not_change_halves_that_may_go_on() {
        let of = |samples| RenderOptions { samples, ..RenderOptions::default() }.halving(false);
        assert_eq!(of(MOST_ARRANGED + 8), of(4 * MOST_ARRANGED));
        assert_eq!(of(64), Halving::Before(32));
        let planned = RenderOptions { samples: 64, planned: 128, ..RenderOptions::default() };
        assert_eq!(planned.halving(false), RenderOptions { samples: 128, ..planned }.halving(false));
    }
}
