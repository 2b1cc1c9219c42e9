//! Schedule of a rendering: sample range and region of a partial render, passes, tiles, and the two halves of samples.

use super::options::RenderOptions;
use crate::compile::View;
use crate::error::{Error, Result};
use crate::integrator::reuse::{INTERVAL, Tiling};
use crate::integrator::{Block, WAVE};
use crate::output::part::Region;
use crate::sampling::MAX_Z_ORDER_SPP;
use std::ops::Range;
use std::time::Duration;

/// Samples per pixel of a full pass.
const FULL: u32 = INTERVAL;
/// Maximum fraction of the remaining time for a pass, so that a wrong prediction costs little.
const MAX_TIME_FRACTION: f64 = 0.1;

/// Plans passes. With a time limit, the first pass has one sample per pixel and measures the time of a sample. Later passes have at most as
/// many samples as all earlier ones and take at most a tenth of the remaining time (but have at least one sample); a pass that is
/// predicted to end too late does not begin.
pub(super) struct Schedule {
    /// Time limit.
    limit: Option<Duration>,
    /// End of the range of samples.
    end: u32,
    /// First sample that is not planned yet.
    next: u32,
    /// Are all passes full, regardless of time?
    full_passes: bool,
    /// Seconds per sample of every pixel in the last pass.
    sample_s: Option<f64>,
}

/// A range of samples of every pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pass {
    pub first_sample: u32,
    pub samples: u32,
}

impl Pass {
    /// Width and height of tiles, pixels, such that a tile fills about one wave with the pass's samples.
    pub fn tile(self) -> (u32, u32) {
        let (width, height) = match self.samples {
            1 => (64, 32),
            2 | 3 => (32, 32),
            4..FULL => (32, 16),
            _ => (16, 16),
        };
        debug_assert!(width * height * self.samples.min(FULL) <= 2 * WAVE as u32);
        (width, height)
    }

    /// Tile size, pixels, and samples per pixel of a wave, for path reuse within square regions of this edge. Tiles consist of whole
    /// regions.
    pub fn tile_of_regions(self, edge: u32) -> ((u32, u32), u32) {
        let pixels = edge * edge;
        let samples = self.samples.min(WAVE as u32 / pixels);
        let regions = WAVE as u32 / (pixels * samples);
        // As many as fit into a wave, in a row or a square.
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
    /// A schedule for a range of samples of every pixel.
    pub fn new(samples: Range<u32>, limit: Option<Duration>) -> Schedule {
        Schedule { limit, end: samples.end, next: samples.start, full_passes: false, sample_s: None }
    }

    /// Makes all passes full, regardless of time; none begins after the time limit.
    pub fn with_full_passes(self) -> Schedule {
        Schedule { full_passes: true, ..self }
    }

    /// Resumes at a sample, reached after the time `spent`, which the time limit doesn't include.
    pub fn resume_at(&mut self, sample: u32, spent: Duration) {
        self.next = sample;
        self.limit = self.limit.map(|limit| limit.saturating_add(spent));
    }

    /// The first sample that is not planned yet.
    pub fn next_sample(&self) -> u32 {
        self.next
    }

    /// Is `elapsed` past the time limit?
    pub fn is_late(&self, elapsed: Duration) -> bool {
        self.limit.is_some_and(|limit| elapsed >= limit)
    }

    /// The next pass, at time `elapsed`; `None` if all samples are planned or the time left is too short.
    pub fn next(&mut self, elapsed: Duration) -> Option<Pass> {
        let left = self.end - self.next;
        if self.full_passes && self.is_late(elapsed) {
            return None;
        }
        let samples = match (self.limit, self.sample_s) {
            (None, _) => FULL,
            _ if self.full_passes => FULL,
            (Some(_), None) => 1,
            (Some(limit), Some(sample_s)) => {
                let left_s = limit.saturating_sub(elapsed).as_secs_f64();
                if sample_s > left_s {
                    return None;
                }
                // `as` saturates. At first the number of samples doubles, so that the preview improves steadily.
                ((MAX_TIME_FRACTION * left_s / sample_s) as u32).min(self.next).clamp(1, FULL)
            }
        };
        // Passes don't cross multiples of a full pass, where the groups of path reuse change.
        let samples = samples.min(left).min(FULL - self.next % FULL);
        let pass = Pass { first_sample: self.next, samples };
        self.next += pass.samples;
        (pass.samples > 0).then_some(pass)
    }

    /// Returns to a sample: later ones were planned, but not rendered.
    pub fn go_back_to(&mut self, sample: u32) {
        self.next = sample;
    }

    /// Records the time of a pass.
    pub fn finished(&mut self, pass: Pass, took: Duration) {
        self.sample_s = Some(took.as_secs_f64() / f64::from(pass.samples));
    }

    /// Are all samples planned?
    pub fn is_complete(&self) -> bool {
        self.next == self.end
    }
}

// Partial renders: some pixels, or some samples of each.

/// Samples per block, the unit of sample ranges.
pub const SAMPLE_BLOCK: u32 = INTERVAL;

/// The number of samples rounded up to whole blocks.
pub(super) fn whole_blocks(samples: u32) -> u32 {
    samples.checked_next_multiple_of(SAMPLE_BLOCK).unwrap_or(u32::MAX)
}

impl RenderOptions {
    /// The rendered region.
    pub(super) fn pixels(&self) -> Region {
        self.region.unwrap_or(Region { x0: 0, y0: 0, x1: self.width, y1: self.height })
    }

    /// The range of rendered samples. A block of [`SAMPLE_BLOCK`] belongs to the range of its first sample, so that consecutive ranges stay
    /// consecutive.
    pub(super) fn samples_to_render(&self) -> Range<u32> {
        let (from, until) = self.sample_range.unwrap_or((0, self.samples));
        whole_blocks(from).min(self.samples)..whole_blocks(until).min(self.samples)
    }

    /// Is this a partial render?
    pub(super) fn is_part(&self) -> bool {
        self.region.is_some() || self.sample_range.is_some()
    }

    /// Checks the region and the range of samples.
    pub(super) fn check_partial_render(&self) -> Result<()> {
        let Region { x0, y0, x1, y1 } = self.pixels();
        let is_outside = x0 >= x1 || y0 >= y1 || x1 > self.width || y1 > self.height;
        if self.region.is_some() && is_outside {
            let message = format!("the region {} has no pixels in the picture", self.pixels());
            let help = format!("the picture has {} x {} pixels", self.width, self.height);
            return Err(Error::usage(message).with_help(help));
        }
        if let Some((from, until)) = self.sample_range.filter(|(a, b)| a >= b || *b > self.samples) {
            let message = format!("the range of samples {from}..{until} is not within the picture's");
            return Err(Error::usage(message).with_help(format!("it has the samples 0..{}", self.samples)));
        }
        if self.sample_range.is_some() && (self.noise.is_some() || self.time_limit.is_some()) {
            let message = "a range of samples can't be combined with a noise threshold or a time limit";
            return Err(Error::usage(message));
        }
        Ok(())
    }
}

/// The part of a block within a region, if any; the whole block with path reuse (`is_whole`).
pub(super) fn within(region: &Region, block: &Block, is_whole: bool) -> Option<Block> {
    let (x0, y0) = (block.x0.max(region.x0), block.y0.max(region.y0));
    let (x1, y1) = ((block.x0 + block.width).min(region.x1), (block.y0 + block.height).min(region.y1));
    if x0 >= x1 || y0 >= y1 {
        return None;
    }
    Some(if is_whole { *block } else { Block { x0, y0, width: x1 - x0, height: y1 - y0, ..*block } })
}

// Tiles.

/// The tiles of a pass.
pub(super) struct Tiles {
    width: u32,
    height: u32,
    /// Shift of the grid to the left and up, pixels.
    shift: (u32, u32),
    /// Samples per pixel traced together.
    samples: u32,
}

impl Tiles {
    pub fn of(pass: Pass, reuse: Option<&Tiling>) -> Tiles {
        let (samples, shift) = (pass.samples, reuse.map_or((0, 0), Tiling::shift));
        let ((width, height), samples) = match reuse {
            None => (pass.tile(), samples),
            Some(tiling) => pass.tile_of_regions(tiling.region()),
        };
        Tiles { width, height, shift, samples }
    }

    /// Samples per pixel traced together.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// The tiles of the picture.
    pub fn blocks(&self, view: &View, pass: Pass) -> Vec<Block> {
        let Pass { first_sample, samples } = pass;
        let all = Block { x0: 0, y0: 0, width: view.width, height: view.height, first_sample, samples };
        self.divide(all).collect()
    }

    /// Divides a block, whose corner is that of a tile, into tiles, row-major.
    pub fn divide(&self, block: Block) -> impl Iterator<Item = Block> {
        let (left, top) = self.shift;
        let width = self.width;
        let row = move |(y, height)| {
            let columns = starts(block.width, width, left);
            columns.map(move |(x, width)| Block {
                x0: block.x0 + x,
                y0: block.y0 + y,
                width,
                height,
                ..block
            })
        };
        starts(block.height, self.height, top).flat_map(row)
    }
}

/// Divides a length into steps, the first one shorter by `shift`; returns starts and lengths.
fn starts(length: u32, step: u32, shift: u32) -> impl Iterator<Item = (u32, u32)> {
    let ends = (step - shift..length + step).step_by(step as usize);
    ends.map(move |end| {
        let start = end.saturating_sub(step);
        (start, end.min(length) - start)
    })
}

/// Divides a block into blocks of at most `samples` samples per pixel.
pub(super) fn parts(block: &Block, samples: u32) -> impl Iterator<Item = Block> {
    let block = *block;
    (0..block.samples).step_by(samples as usize).map(move |skipped| Block {
        first_sample: block.first_sample + skipped,
        samples: samples.min(block.samples - skipped),
        ..block
    })
}

// The two halves of a pixel's samples, by whose difference denoising estimates noise.

/// Assignment of samples to halves, in runs of consecutive samples, which have low discrepancy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Halving {
    /// Samples before this one are the first half.
    Before(u32),
    /// Runs alternate, so that there are two halves at any number of samples.
    Alternating,
}

impl RenderOptions {
    /// In the middle if the number of samples is known; alternating if rendering may end early or be resumed.
    pub(super) fn halving(&self) -> Halving {
        let may_end_early = self.time_limit.is_some() || self.noise.is_some() || self.planned > 0;
        match may_end_early || self.samples > MAX_Z_ORDER_SPP {
            true => Halving::Alternating,
            false => Halving::Before(self.samples / 2),
        }
    }
}

impl Halving {
    /// Number of `samples` from `first_sample` on, within one block of [`INTERVAL`] samples, that belong to the first half. They come first.
    pub fn of_first_half(self, first_sample: u32, samples: u32) -> u32 {
        let left = match self {
            Halving::Before(middle) => middle.saturating_sub(first_sample),
            Halving::Alternating => {
                // Shorter runs at first, so that pictures of few samples have two halves.
                let period = if first_sample < 2 * INTERVAL { INTERVAL } else { 2 * INTERVAL };
                (period / 2).saturating_sub(first_sample % period)
            }
        };
        left.min(samples)
    }

    /// Name in the identity of a picture.
    pub fn name(self) -> &'static str {
        match self {
            Halving::Before(_) => "at the middle",
            Halving::Alternating => "by turns",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::reuse::GroupShape;

    /// Simulates rendering with `sample_s` seconds per sample; returns the passes' sizes and the final time.
    fn simulate(mut schedule: Schedule, sample_s: f64) -> (Vec<u32>, f64) {
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
        assert_eq!(simulate(Schedule::new(0..20, None), 1.0).0, [8, 8, 4]);
    }

    #[test]
    fn passes_stay_within_the_limit_and_use_most_of_it() {
        for sample_s in [0.011, 0.11, 0.4] {
            let (sizes, end) = simulate(Schedule::new(0..1 << 20, Some(Duration::from_secs(10))), sample_s);
            assert_eq!(sizes[0], 1);
            assert!(end <= 10.0 + 1e-9 && end > 10.0 - 1.5 * sample_s, "{sample_s}: {end}");
            assert!(sizes.iter().all(|&n| n == 1 || f64::from(n) * sample_s <= 1.0), "{sizes:?}");
        }
        // All samples are finished long before the limit.
        assert_eq!(simulate(Schedule::new(0..12, Some(Duration::from_secs(10))), 0.001).0, [1, 1, 2, 4, 4]);
    }

    #[test]
    fn tiles_fill_a_wave() {
        for (samples, paths) in [(1, WAVE), (2, WAVE), (4, WAVE), (8, WAVE)] {
            let (w, h) = Pass { first_sample: 0, samples }.tile();
            assert_eq!((w * h * samples) as usize, paths);
        }
    }

    /// Each block is in exactly one of consecutive ranges.
    #[test]
    fn consecutive_ranges_stay_consecutive() {
        let options = RenderOptions::default().samples(100);
        let rendered =
            |from, until| RenderOptions { sample_range: Some((from, until)), ..options }.samples_to_render();
        let cuts = [0, 3, 8, 9, 30, 33, 64, 97, 100];
        let ranges: Vec<_> = cuts.windows(2).map(|w| rendered(w[0], w[1])).collect();
        assert_eq!((ranges[0].start, ranges.last().unwrap().end), (0, 100));
        assert!(ranges.windows(2).all(|w| w[0].end == w[1].start && (w[0].end % 8 == 0 || w[0].end == 100)));
        assert_eq!((rendered(3, 8), rendered(96, 97), options.samples_to_render()), (8..8, 96..100, 0..100));
    }

    #[test]
    fn tiles_cover_every_pixel_once() {
        let shapes = [None, Some("2x2/1"), Some("4x4/4"), Some("8x8/4")];
        let passes = [(0, 8), (8, 1), (16, 2), (40, 3), (80, 5), (800, 7)];
        let sizes = [(1, 1), (31, 50), (64, 64), (100, 33)];
        for ((first_sample, samples), shape) in passes.iter().flat_map(|p| shapes.map(|s| (*p, s))) {
            let pass = Pass { first_sample, samples };
            let reuse = shape.map(|s| Tiling::new(s.parse::<GroupShape>().unwrap(), first_sample));
            let tiles = Tiles::of(pass, reuse.as_ref());
            for (width, height) in sizes {
                let mut counts = vec![0; (width * height) as usize];
                for tile in tiles.divide(Block { x0: 0, y0: 0, width, height, first_sample, samples }) {
                    let of_parts: u32 = parts(&tile, tiles.samples()).map(|part| part.samples).sum();
                    assert_eq!(of_parts, samples);
                    let is_wave = tile.width * tile.height * tiles.samples() <= WAVE as u32;
                    assert!(is_wave || reuse.is_none(), "{shape:?} {pass:?}");
                    for (x, y) in (0..tile.height).flat_map(|y| (0..tile.width).map(move |x| (x, y))) {
                        counts[((tile.y0 + y) * width + tile.x0 + x) as usize] += 1;
                    }
                }
                assert!(counts.iter().all(|&n| n == 1), "{shape:?} {pass:?} {width} {height}");
            }
        }
    }

    #[test]
    fn halves_are_equal_at_multiples_of_a_block() {
        for end in (INTERVAL..400).step_by(INTERVAL as usize) {
            let of = |rule: Halving| -> u32 {
                (0..end).step_by(INTERVAL as usize).map(|first| rule.of_first_half(first, INTERVAL)).sum()
            };
            assert_eq!(of(Halving::Before(end / 2)), end / 2);
            let turns = of(Halving::Alternating);
            assert!(turns.abs_diff(end - turns) <= INTERVAL, "{turns} of {end}");
        }
        // Independent of how passes divide a block.
        let parts = [(0, 1), (1, 4), (5, 3)].map(|(first, n)| Halving::Alternating.of_first_half(first, n));
        assert_eq!(parts, [1, 3, 0]);
    }

    #[test]
    fn halves_of_resumable_renders_are_independent_of_the_sample_count() {
        let of = |samples| RenderOptions { samples, ..RenderOptions::default() }.halving();
        assert_eq!(of(MAX_Z_ORDER_SPP + 8), of(4 * MAX_Z_ORDER_SPP));
        assert_eq!(of(64), Halving::Before(32));
        let planned = RenderOptions { samples: 64, planned: 128, ..RenderOptions::default() };
        assert_eq!(planned.halving(), RenderOptions { samples: 128, ..planned }.halving());
    }
}
