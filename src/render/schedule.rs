//! How many samples each pass takes: a wave's worth a tile, or what fits into the time that is left.

use crate::integrator::WAVE;
use crate::integrator::reuse::INTERVAL;
use std::ops::Range;
use std::time::Duration;

/// Samples of a full pass.
const MOST: u32 = INTERVAL;
/// Share of the time left that a pass may take: a wrong forecast then costs little.
const SHARE: f64 = 0.1;

/// Decides passes. With a time limit, the first has one sample a pixel and tells what a sample costs; later ones take at
/// most a tenth of the time that is left (but at least one sample), and none begins that would not end in time.
pub(super) struct Schedule {
    limit: Option<Duration>,
    end: u32,
    next: u32,
    /// Take whole passes, whatever time they take.
    whole_passes: bool,
    /// Seconds of one sample of every pixel, as the last pass found.
    sample_s: Option<f64>,
}

/// A range of samples of every pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pass {
    pub first_sample: u32,
    pub samples: u32,
}

impl Pass {
    /// Width and height of tiles in pixels: with the pass's samples they fill about one wave, so that passes of few
    /// samples are not slower.
    pub fn tile(self) -> (u32, u32) {
        let (width, height) = match self.samples {
            1 => (64, 32),
            2 | 3 => (32, 32),
            4..MOST => (32, 16),
            _ => (16, 16),
        };
        debug_assert!(width * height * self.samples.min(MOST) <= 2 * WAVE as u32);
        (width, height)
    }

    /// The same where pixels share paths within square regions with this edge, and how many samples of all pixels of a
    /// tile are a wave: tiles consist of whole regions.
    pub fn tile_of_regions(self, edge: u32) -> ((u32, u32), u32) {
        let pixels = edge * edge;
        let samples = self.samples.min(WAVE as u32 / pixels);
        let regions = WAVE as u32 / (pixels * samples);
        // As many as fit, in a row or a square.
        let (columns, rows) = match regions {
            8.. => (4, 2),
            4.. => (2, 2),
            2.. => (2, 1),
            _ => (1, 1),
        };
        ((columns * edge, rows * edge), samples)
    }
}

impl Schedule {
    /// For these samples of every pixel.
    pub fn new(samples: Range<u32>, limit: Option<Duration>) -> Schedule {
        Schedule { limit, end: samples.end, next: samples.start, whole_passes: false, sample_s: None }
    }

    /// The same with whole passes, whatever time they take: none begins when the time is over.
    pub fn with_whole_passes(self) -> Schedule {
        Schedule { whole_passes: true, ..self }
    }

    /// Goes on from this sample, which was reached when `spent` was spent: the limit is for what follows.
    pub fn go_on_from(&mut self, sample: u32, spent: Duration) {
        self.next = sample;
        self.limit = self.limit.map(|limit| limit.saturating_add(spent));
    }

    /// The first sample that is not planned yet.
    pub fn next_sample(&self) -> u32 {
        self.next
    }

    /// Is the time over when `elapsed` was spent?
    pub fn is_late(&self, elapsed: Duration) -> bool {
        self.limit.is_some_and(|limit| elapsed >= limit)
    }

    /// The next pass when `elapsed` was spent; `None` if all samples are planned or no pass fits
    /// any more.
    pub fn next(&mut self, elapsed: Duration) -> Option<Pass> {
        let left = self.end - self.next;
        if self.whole_passes && self.is_late(elapsed) {
            return None;
        }
        let samples = match (self.limit, self.sample_s) {
            (None, _) => MOST,
            _ if self.whole_passes => MOST,
            (Some(_), None) => 1,
            (Some(limit), Some(sample_s)) => {
                let left_s = limit.saturating_sub(elapsed).as_secs_f64();
                if sample_s > left_s {
                    return None;
                }
                // `as` saturates.
                ((SHARE * left_s / sample_s) as u32).clamp(1, MOST)
            }
        };
        // Passes don't straddle multiples of a full one: which pixels share paths changes there.
        let samples = samples.min(left).min(MOST - self.next % MOST);
        let pass = Pass { first_sample: self.next, samples };
        self.next += pass.samples;
        (pass.samples > 0).then_some(pass)
    }

    /// Goes back to this sample: what was planned from there on is not taken yet.
    pub fn go_back_to(&mut self, sample: u32) {
        self.next = sample;
    }

    /// Takes down how long a pass took.
    pub fn finished(&mut self, pass: Pass, took: Duration) {
        self.sample_s = Some(took.as_secs_f64() / f64::from(pass.samples));
    }

    /// Are all samples planned?
    pub fn is_complete(&self) -> bool {
        self.next == self.end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Plays a machine that takes `sample_s` a sample; returns the passes' sizes and the time at the end.
    fn play(mut schedule: Schedule, sample_s: f64) -> (Vec<u32>, f64) {
        let (mut sizes, mut now) = (Vec::new(), 0.0);
        while let Some(pass) = schedule.next(Duration::from_secs_f64(now)) {
            let took = sample_s * f64::from(pass.samples);
            assert_eq!(pass.first_sample, sizes.iter().sum::<u32>());
            sizes.push(pass.samples);
            now += took;
            schedule.finished(pass, Duration::from_secs_f64(took));
        }
        (sizes, now)
    }

    #[test]
    fn without_a_limit_passes_are_full() {
        assert_eq!(play(Schedule::new(0..20, None), 1.0).0, [8, 8, 4]);
    }

    #[test]
    fn passes_stay_within_the_limit_and_use_most_of_it() {
        for sample_s in [0.011, 0.11, 0.4] {
            let (sizes, end) = play(Schedule::new(0..1 << 20, Some(Duration::from_secs(10))), sample_s);
            assert_eq!(sizes[0], 1);
            assert!(end <= 10.0 + 1e-9 && end > 10.0 - 1.5 * sample_s, "{sample_s}: {end}");
            assert!(sizes.iter().all(|&n| n == 1 || f64::from(n) * sample_s <= 1.0), "{sizes:?}");
        }
        // All samples done long before.
        assert_eq!(play(Schedule::new(0..12, Some(Duration::from_secs(10))), 0.001).0, [1, 7, 4]);
    }

    #[test]
    fn tiles_fill_a_wave() {
        for (samples, paths) in [(1, WAVE), (2, WAVE), (4, WAVE), (8, WAVE)] {
            let (w, h) = Pass { first_sample: 0, samples }.tile();
            assert_eq!((w * h * samples) as usize, paths);
        }
    }
}
