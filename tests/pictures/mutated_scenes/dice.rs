//! Random decisions for mutations, and a log of the changes.

use oscura::sampling::chi2::Random;

/// Numbers of at most this magnitude don't overflow on the way to a picture.
const TAME: f64 = 1e6;

/// A random stream with a log of what it changed.
pub struct Dice {
    random: Random,
    path: Vec<String>,
    /// A number beyond [`TAME`] occurred.
    pub is_wild: bool,
    /// Each change: where, and the new value.
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

    /// Records whether a number is beyond [`TAME`].
    pub fn weigh(&mut self, number: f64) {
        self.is_wild |= number.abs() > TAME;
    }

    /// Enters a field of the object under mutation.
    pub fn at<R>(&mut self, part: impl Into<String>, work: impl FnOnce(&mut Dice) -> R) -> R {
        self.path.push(part.into());
        let result = work(self);
        self.path.pop();
        result
    }

    /// Records a change.
    pub fn note(&mut self, change: impl std::fmt::Display) {
        self.trail.push(format!("{} {change}", self.path.concat()));
    }
}
