//! What decides on mutations, and takes down which were made.

use oscura::sampling::chi2::Random;

/// With numbers of at most this magnitude nothing overflows on the way to a picture.
const TAME: f64 = 1e6;

/// A stream of decisions with the trail of what they changed.
pub struct Dice {
    random: Random,
    path: Vec<String>,
    /// A number beyond [`TAME`] came up.
    pub is_wild: bool,
    /// Each change: where, and what is there now.
    pub trail: Vec<String>,
}

impl Dice {
    /// A stream.
    pub fn new(seed: u64) -> Dice {
        Dice { random: Random::new(seed), path: Vec::new(), is_wild: false, trail: Vec::new() }
    }

    /// A number below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        ((f64::from(self.random.next()) * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// True once in so many times.
    pub fn once_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }

    /// One of a list.
    pub fn pick<T: Clone>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())].clone()
    }

    /// A number in -2..2.
    pub fn tame(&mut self) -> f32 {
        4.0 * self.random.next() - 2.0
    }

    /// Takes down whether a number is wild.
    pub fn weigh(&mut self, number: f64) {
        self.is_wild |= number.abs() > TAME;
    }

    /// Works on a part of what is being changed.
    pub fn at<R>(&mut self, part: impl Into<String>, work: impl FnOnce(&mut Dice) -> R) -> R {
        self.path.push(part.into());
        let result = work(self);
        self.path.pop();
        result
    }

    /// Takes down a change.
    pub fn note(&mut self, change: impl std::fmt::Display) {
        self.trail.push(format!("{} {change}", self.path.concat()));
    }
}
