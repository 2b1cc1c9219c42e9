//! Temporal denoising of sequences: a denoised frame is averaged with its reprojected neighbours.
//!
//! Motion vectors give the position of each pixel's surface in a neighbouring frame, which is sampled there by Catmull-Rom splines, as
//! in temporal antialiasing (Yang, Liu, Salvi 2020, "A Survey of Temporal Antialiasing Techniques", section 4). Disocclusion is
//! detected by motion vectors that don't lead back to the pixel, or by different normals.
//!
//! Changes of lighting (shadows, reflections, refractions) are detected in the noisy pictures: where the difference of two frames,
//! averaged over a large or a small square, exceeds its noise, the neighbour's weight is reduced; also where the denoised pictures
//! differ by more than the pixels' noise, as at resampled edges. Errors of denoised frames are about independent, so flicker falls
//! with the number of averaged frames. A frame depends only on near frames, so parts of a sequence can be denoised separately.

use super::residual::{Color, slices, smoothed};
use super::{Denoised, NoisyLayers, Planes, add_up};
use rayon::prelude::*;
use std::collections::{BTreeSet, VecDeque};
use std::ops::RangeInclusive;

/// Number of frames before and after that are averaged.
pub const RADIUS: usize = 2;

/// Maximum distance between a pixel and its position after motion to the neighbour and back, pixels.
const MAX_RETURN_DISTANCE: f32 = 0.75;
/// Minimum cosine between the normals of a pixel and of its sample in the neighbour.
const MIN_COSINE: f32 = 0.8;
/// Radii of the squares over which differences are averaged, pixels.
const RADII: [usize; 2] = [5, 1];
/// Ratio of the power of a difference to that of its noise above which a neighbour's weight is reduced.
const MAX_NOISE_RATIO: f32 = 2.0;
/// Assumed variance of the differences of denoised pixels relative to that of noisy pixels.
const DENOISED_VARIANCE: f32 = 0.25;
/// Relative differences per channel that don't count as a change: for squares, and for pixels of the denoised picture.
const MIN_CHANGE: f32 = 0.01;
const MIN_CHANGE_OF_PIXELS: f32 = 0.01;

/// A frame of a sequence, denoised without its neighbours.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The noisy picture.
    pub noisy: [Vec<f32>; 3],
    /// Variance of the noisy values, if known.
    pub variance: Option<[Vec<f32>; 3]>,
    /// Normal of the first surface.
    pub normal: Option<[Vec<f32>; 3]>,
    /// Motion vectors of the first surface, pixels to the right and up: to the previous frame (0, 1), to the next (2, 3).
    pub motion: [Vec<f32>; 4],
    /// The denoised picture.
    pub denoised: Denoised,
}

impl NoisyLayers<'_> {
    /// Denoises the layers as a frame of a sequence with motion vectors.
    pub fn frame(&self, motion: [Vec<f32>; 4]) -> Frame {
        let [width, height] = self.size;
        let squared = |planes: &Planes| {
            planes.each_ref().map(|plane| plane.iter().map(|v| v * v).collect::<Vec<f32>>())
        };
        let owned = |planes: &Planes| planes.each_ref().map(|plane| plane.to_vec());
        Frame {
            width,
            height,
            noisy: owned(&self.color),
            variance: self.deviations.as_ref().map(squared).or_else(|| self.variance.as_ref().map(owned)),
            normal: self.normal.as_ref().map(owned),
            motion,
            denoised: self.denoised(),
        }
    }
}

impl Frame {
    fn len(&self) -> usize {
        self.width * self.height
    }

    fn center_of(&self, pixel: usize) -> [f32; 2] {
        [(pixel % self.width) as f32 + 0.5, (pixel / self.width) as f32 + 0.5]
    }

    fn pixel_at(&self, [x, y]: [f32; 2]) -> Option<usize> {
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32;
        is_inside.then(|| y as usize * self.width + x as usize)
    }

    /// Reprojects a position in pixels to the next frame, or to the previous one.
    fn reprojected(&self, position: [f32; 2], is_forward: bool) -> Option<[f32; 2]> {
        let pixel = self.pixel_at(position)?;
        let first = if is_forward { 2 } else { 0 };
        Some([position[0] + self.motion[first][pixel], position[1] - self.motion[first + 1][pixel]])
    }

    /// Calls `add` with the pixels of a `2 N` by `2 N` kernel around a position and their weights; pixels are clamped to the border.
    #[inline]
    fn sum_around<const N: usize>(
        &self,
        position: [f32; 2],
        weights: impl Fn(f32) -> [[f32; 2]; N],
        mut add: impl FnMut(usize, f32),
    ) {
        let [(column, across), (row, down)] = position.map(|v| {
            let v = v - 0.5;
            (v.floor() as i64 - (N as i64 - 1), weights(v - v.floor()))
        });
        let clamped = |v: i64, length: usize| v.clamp(0, length as i64 - 1) as usize;
        for (j, down) in (0i64..).zip(down.as_flattened()) {
            let start = clamped(row + j, self.height) * self.width;
            for (i, across) in (0i64..).zip(across.as_flattened()) {
                add(start + clamped(column + i, self.width), across * down);
            }
        }
    }

    /// Bilinear interpolation at a position.
    fn bilinear<const K: usize>(&self, position: [f32; 2], value: impl Fn(usize) -> [f32; K]) -> [f32; K] {
        let mut sums = [0.0; K];
        self.sum_around(
            position,
            |t| [[1.0 - t, t]],
            |pixel, weight| {
                sums.iter_mut().zip(value(pixel)).for_each(|(sum, v)| *sum += weight * v);
            },
        );
        sums
    }

    /// Catmull-Rom interpolation of a plane at a position, clamped to the range of the four nearest pixels.
    fn catmull_rom(&self, position: [f32; 2], plane: &[f32]) -> f32 {
        let weights = |t: f32| {
            let (t2, t3) = (t * t, t * t * t);
            [
                [-0.5 * t + t2 - 0.5 * t3, 1.0 - 2.5 * t2 + 1.5 * t3],
                [0.5 * t + 2.0 * t2 - 1.5 * t3, -0.5 * t2 + 0.5 * t3],
            ]
        };
        let (mut sum, mut min, mut max) = (0.0, f32::INFINITY, f32::NEG_INFINITY);
        self.sum_around(position, weights, |pixel, weight| sum += weight * plane[pixel]);
        self.sum_around(
            position,
            |t| [[1.0 - t, t]],
            |pixel, _| {
                (min, max) = (min.min(plane[pixel]), max.max(plane[pixel]));
            },
        );
        sum.clamp(min, max)
    }
}

/// A neighbouring frame reprojected to a frame.
struct Neighbour<'f> {
    frame: &'f Frame,
    /// Position of each pixel in the neighbour, pixels.
    positions: Vec<[f32; 2]>,
    /// Weight of each pixel, 0..1.
    weights: Vec<f32>,
}

/// Averages frame `at` with its neighbours among consecutive frames of a sequence.
///
/// # Panics
/// If there is no frame at that index.
pub fn averaged_frame(frames: &[Frame], at: usize) -> Denoised {
    let frame = &frames[at];
    let has_same_size = |other: &Frame| (other.width, other.height) == (frame.width, frame.height);
    let near = at.saturating_sub(RADIUS)..frames.len().min(at + RADIUS + 1);
    let others =
        near.filter(|&other| other != at && frames[at.min(other)..=at.max(other)].iter().all(has_same_size));
    let neighbours: Vec<Neighbour> = others
        .map(|other| {
            let (positions, is_visible) = reproject(frames, at, other);
            let weights = weights(frame, &frames[other], &positions, &is_visible);
            Neighbour { frame: &frames[other], positions, weights }
        })
        .collect();
    let blend = |own: Color, of: &(dyn for<'f> Fn(&'f Denoised) -> Color<'f> + Sync)| {
        [0, 1, 2].map(|c| {
            let at_pixel = |i: usize| {
                let (mut sum, mut all) = (own[c][i], 1.0);
                for Neighbour { frame, positions, weights } in
                    neighbours.iter().filter(|n| n.weights[i] > 0.0)
                {
                    sum += weights[i] * frame.catmull_rom(positions[i], of(&frame.denoised)[c]);
                    all += weights[i];
                }
                sum / all
            };
            (0..own[c].len()).into_par_iter().with_min_len(1024).map(at_pixel).collect::<Vec<f32>>()
        })
    };
    let own = &frame.denoised;
    let color = blend(slices(&own.color), &|denoised| slices(&denoised.color));
    let mut parts = own.parts.clone();
    for (s, set) in parts.iter_mut().enumerate() {
        let has_set =
            |other: &Neighbour| other.frame.denoised.parts.get(s).is_some_and(|of| of.len() == set.len());
        if neighbours.iter().all(has_set) {
            for (p, part) in set.iter_mut().enumerate() {
                *part = blend(slices(&own.parts[s][p]), &|denoised| slices(&denoised.parts[s][p]));
            }
            let before: Vec<Color> = own.parts[s].iter().map(slices).collect();
            add_up(slices(&own.color), &before, &color, set);
        }
    }
    Denoised { color, parts }
}

// Sequences of frames.

/// Numbers of the consecutive frames that a frame is averaged with, itself included; `all` are the sorted numbers of existing frames.
fn neighbourhood(all: &[u32], number: u32) -> RangeInclusive<u32> {
    let is_there = |number: &u32| all.binary_search(number).is_ok();
    let radius = RADIUS as u32;
    let before = (number.saturating_sub(radius)..number).rev().take_while(is_there).last();
    let after = (number + 1..=number.saturating_add(radius)).take_while(is_there).last();
    before.unwrap_or(number)..=after.unwrap_or(number)
}

/// Numbers of the wanted frames and their neighbours; `all` are the sorted numbers of existing frames.
pub fn with_neighbours(all: &[u32], is_wanted: impl Fn(u32) -> bool) -> Vec<u32> {
    let wanted = all.iter().filter(|&&number| is_wanted(number));
    wanted.flat_map(|&number| neighbourhood(all, number)).collect::<BTreeSet<u32>>().into_iter().collect()
}

/// A stream of frames in order, each of which is averaged as soon as its later neighbours have arrived; `T` is data of the caller for
/// each frame.
#[derive(Debug)]
pub struct Sequence<T> {
    /// Number of the first of `frames`.
    first: u32,
    /// Consecutive frames.
    frames: Vec<Frame>,
    /// Frames not averaged yet.
    waiting: VecDeque<(u32, T)>,
}

/// A frame averaged with its neighbours.
#[derive(Debug)]
pub struct Averaged<T> {
    /// Frame number.
    pub number: u32,
    /// Data of the caller for the frame.
    pub item: T,
    /// The averaged picture.
    pub picture: Denoised,
    /// Numbers of the frames it was averaged from.
    pub frames: RangeInclusive<u32>,
}

impl<T> Default for Sequence<T> {
    fn default() -> Sequence<T> {
        Sequence { first: 0, frames: Vec::new(), waiting: VecDeque::new() }
    }
}

impl<T> Sequence<T> {
    /// Adds a frame; one without an item only serves its neighbours. Returns the frames that are complete.
    pub fn push(&mut self, number: u32, frame: Frame, item: Option<T>) -> Vec<Averaged<T>> {
        let mut done = if number == self.end() { Vec::new() } else { self.finish() };
        if self.frames.is_empty() {
            self.first = number;
        }
        self.frames.push(frame);
        self.waiting.extend(item.map(|item| (number, item)));
        let radius = RADIUS as u32;
        while self.waiting.front().is_some_and(|(number, _)| number + radius < self.end()) {
            done.extend(self.waiting.pop_front().map(|(number, item)| self.averaged(number, item)));
        }
        let next = self.waiting.front().map_or(self.end(), |(number, _)| *number);
        let passed = next.saturating_sub(radius).saturating_sub(self.first);
        self.frames.drain(..passed as usize);
        self.first += passed;
        done
    }

    /// Ends a run of consecutive frames and returns its remaining ones.
    pub fn finish(&mut self) -> Vec<Averaged<T>> {
        let waiting = std::mem::take(&mut self.waiting);
        let done = waiting.into_iter().map(|(number, item)| self.averaged(number, item)).collect();
        self.frames.clear();
        done
    }

    /// Numbers of the frames that wait for later neighbours.
    pub fn waiting(&self) -> impl Iterator<Item = u32> {
        self.waiting.iter().map(|(number, _)| *number)
    }

    fn end(&self) -> u32 {
        self.first + self.frames.len() as u32
    }

    fn averaged(&self, number: u32, item: T) -> Averaged<T> {
        let (radius, last) = (RADIUS as u32, self.end() - 1);
        let frames = self.first.max(number.saturating_sub(radius))..=last.min(number + radius);
        let picture = averaged_frame(&self.frames, (number - self.first) as usize);
        Averaged { number, item, picture, frames }
    }
}

/// Positions of the pixels of frame `at` in frame `other`; NaN if they leave the picture in between.
fn positions_in(frames: &[Frame], at: usize, other: usize) -> Vec<[f32; 2]> {
    let of = |pixel: usize| {
        let start = frames[at].center_of(pixel);
        let position = (0..at.abs_diff(other)).try_fold(start, |position, step| {
            let from = if other > at { at + step } else { at - step };
            frames[from].reprojected(position, other > at)
        });
        position.unwrap_or([f32::NAN; 2])
    };
    (0..frames[at].len()).into_par_iter().with_min_len(1024).map(of).collect()
}

/// Positions of the pixels of frame `at` in frame `other`, and whether their surfaces are visible there.
fn reproject(frames: &[Frame], at: usize, other: usize) -> (Vec<[f32; 2]>, Vec<bool>) {
    let (there, back) = (positions_in(frames, at, other), positions_in(frames, other, at));
    let (frame, target) = (&frames[at], &frames[other]);
    let normal = |frame: &Frame, pixel: usize| {
        frame.normal.as_ref().map_or([0.0; 3], |normal| [0, 1, 2].map(|c| normal[c][pixel]))
    };
    let is_visible = |(pixel, &position): (usize, &[f32; 2])| {
        if target.pixel_at(position).is_none() {
            return false;
        }
        let [dx, dy, x, y, z] = target.bilinear(position, |pixel| {
            let (to, [x, y], [nx, ny, nz]) = (back[pixel], target.center_of(pixel), normal(target, pixel));
            [to[0] - x, to[1] - y, nx, ny, nz]
        });
        let start = frame.center_of(pixel);
        let returns = (position[0] + dx - start[0]).hypot(position[1] + dy - start[1]) <= MAX_RETURN_DISTANCE;
        let own = normal(frame, pixel);
        let length = |n: [f32; 3]| n.iter().map(|v| v * v).sum::<f32>().sqrt();
        let cosine = own[0] * x + own[1] * y + own[2] * z;
        returns && cosine >= MIN_COSINE * length(own) * length([x, y, z]) - 1e-6
    };
    let is_visible = there.par_iter().enumerate().with_min_len(1024).map(is_visible).collect();
    (there, is_visible)
}

/// One channel of a frame and of a neighbour reprojected to it; 0 where the surface is not visible in the neighbour.
struct Compared {
    /// The noisy frame.
    own: Vec<f32>,
    /// The noisy neighbour.
    there: Vec<f32>,
    /// Variance of their difference.
    variance: Vec<f32>,
    /// Difference of the denoised pictures.
    shift: Vec<f32>,
}

impl Compared {
    fn of(frame: &Frame, other: &Frame, positions: &[[f32; 2]], is_visible: &[bool], c: usize) -> Compared {
        let plane = |value: &(dyn Fn(usize) -> f32 + Sync)| -> Vec<f32> {
            let of = |i: usize| if is_visible[i] { value(i) } else { 0.0 };
            (0..is_visible.len()).into_par_iter().with_min_len(1024).map(of).collect()
        };
        let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
        let variance_of = |frame: &Frame, i: usize| {
            let known = frame.variance.as_ref().map(|variance| variance[c][i]).filter(|v| v.is_finite());
            // Without an estimate the standard deviation is assumed to equal the value.
            known.unwrap_or_else(|| finite(frame.noisy[c][i] * frame.noisy[c][i]))
        };
        let bilinear = |position: [f32; 2], value: &dyn Fn(usize) -> f32| {
            other.bilinear(position, |pixel| [value(pixel)])[0]
        };
        Compared {
            own: plane(&|i| finite(frame.noisy[c][i])),
            there: plane(&|i| bilinear(positions[i], &|pixel| finite(other.noisy[c][pixel]))),
            variance: plane(&|i| {
                variance_of(frame, i) + bilinear(positions[i], &|pixel| variance_of(other, pixel))
            }),
            shift: plane(&|i| {
                other.catmull_rom(positions[i], &other.denoised.color[c]) - frame.denoised.color[c][i]
            }),
        }
    }
}

/// Weight of each pixel of a neighbour: less than 1 where the pictures differ by more than their noise.
fn weights(frame: &Frame, other: &Frame, positions: &[[f32; 2]], is_visible: &[bool]) -> Vec<f32> {
    let channels = [0, 1, 2].map(|c| Compared::of(frame, other, positions, is_visible, c));
    let mut weights: Vec<f32> =
        is_visible.iter().map(|&is_visible| if is_visible { 1.0 } else { 0.0 }).collect();
    let mask = weights.clone();
    let mut lower = |power: &[f32], noise: &[f32]| {
        for (weight, (power, noise)) in weights.iter_mut().zip(power.iter().zip(noise)) {
            let ratio = MAX_NOISE_RATIO * noise / power.max(1e-30);
            *weight *= (ratio * ratio).min(1.0);
        }
    };
    for radius in RADII {
        let mean = |plane: &[f32]| smoothed(frame.width, frame.height, plane, radius);
        let covered = mean(&mask);
        let pixels = ((2 * radius + 1) * (2 * radius + 1)) as f32;
        let (mut power, mut noise) = (vec![0.0f32; mask.len()], vec![0.0f32; mask.len()]);
        for channel in &channels {
            let (own, there, variance) = (mean(&channel.own), mean(&channel.there), mean(&channel.variance));
            for i in 0..mask.len() {
                let covered = covered[i].max(1e-6);
                let difference = (there[i] - own[i]) / covered;
                let scale = MIN_CHANGE * 0.5 * (there[i] + own[i]) / covered;
                power[i] += difference * difference;
                noise[i] += variance[i] / (covered * covered * pixels) + scale * scale;
            }
        }
        lower(&power, &noise);
    }
    // Differences of denoised pixels beyond their noise.
    let sum = |of: &dyn Fn(&Compared, f32, usize) -> f32| {
        let at = |i: usize| {
            channels
                .iter()
                .zip(&frame.denoised.color)
                .map(|(channel, denoised)| of(channel, denoised[i], i))
                .sum()
        };
        smoothed(frame.width, frame.height, &(0..mask.len()).map(at).collect::<Vec<f32>>(), 1)
    };
    let power = sum(&|channel, _, i| channel.shift[i] * channel.shift[i]);
    let noise = sum(&|channel, denoised, i| {
        let scale = MIN_CHANGE_OF_PIXELS * denoised * mask[i];
        DENOISED_VARIANCE * channel.variance[i] + scale * scale
    });
    lower(&power, &noise);
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    const WIDTH: usize = 64;
    const HEIGHT: usize = 48;
    /// Number of frames of the sequence.
    const COUNT: usize = 5;

    /// A wall with a smooth pattern that moves to the right by `speed` pixels per frame, with a standard deviation of 0.2 before and 0.05
    /// after denoising; `light` is the brightness of each frame. Also returns the noise-free frames.
    fn sequence(speed: f32, light: [f32; COUNT]) -> (Vec<Frame>, Vec<Vec<f32>>) {
        let mut random = SplitMix64::new(3);
        let mut gauss = || (0..12).map(|_| random.next_unit()).sum::<f64>() as f32 - 6.0;
        let mut truths = Vec::new();
        let frames = (0..COUNT).map(|frame| {
            let truth: Vec<f32> = (0..WIDTH * HEIGHT)
                .map(|i| {
                    let x = (i % WIDTH) as f32 - speed * frame as f32;
                    light[frame] * (1.0 + 0.5 * (0.3 * x).sin() * (0.2 * (i / WIDTH) as f32).cos())
                })
                .collect();
            let mut erring =
                |deviation: f32| [0; 3].map(|_| truth.iter().map(|v| v + deviation * gauss()).collect());
            let (noisy, color) = (erring(0.2), erring(0.05));
            truths.push(truth.clone());
            let plane = |v: f32| vec![v; WIDTH * HEIGHT];
            Frame {
                width: WIDTH,
                height: HEIGHT,
                noisy,
                variance: Some([0; 3].map(|_| plane(0.04))),
                normal: Some([plane(0.0), plane(0.0), plane(1.0)]),
                motion: [plane(-speed), plane(0.0), plane(speed), plane(0.0)],
                denoised: Denoised { parts: vec![vec![color.clone()]], color },
            }
        });
        let frames = frames.collect();
        (frames, truths)
    }

    /// Mean squared error without the left and right margins.
    fn error(color: &[Vec<f32>; 3], truth: &[f32]) -> f32 {
        let inside = |i: &usize| (8..WIDTH - 8).contains(&(i % WIDTH));
        let squares = (0..truth.len()).filter(inside).map(|i| (color[1][i] - truth[i]).powi(2));
        squares.clone().sum::<f32>() / squares.count() as f32
    }

    /// The average of five frames has about a fifth of the squared error of one, at any speed.
    #[test]
    fn errors_of_moving_surfaces_average_out() {
        for speed in [0.0, 0.4, 3.0] {
            let (frames, truths) = sequence(speed, [1.0; COUNT]);
            let ratio = error(&averaged_frame(&frames, 2).color, &truths[2])
                / error(&frames[2].denoised.color, &truths[2]);
            assert!(ratio < 0.35, "{speed}: {ratio}");
            // The first frame has two neighbours.
            let ratio = error(&averaged_frame(&frames, 0).color, &truths[0])
                / error(&frames[0].denoised.color, &truths[0]);
            assert!(ratio < 0.5, "{speed}: {ratio}");
        }
    }

    #[test]
    fn frames_with_different_lighting_are_not_averaged() {
        let (frames, truths) = sequence(0.4, [0.4, 0.7, 1.0, 1.4, 1.8]);
        let before = error(&frames[2].denoised.color, &truths[2]);
        let after = error(&averaged_frame(&frames, 2).color, &truths[2]);
        assert!(after < 1.05 * before, "{after} {before}");
    }

    /// Surfaces with different normals or inconsistent motion vectors are rejected.
    #[test]
    fn other_surfaces_are_not_averaged() {
        let (mut frames, _) = sequence(0.0, [1.0; COUNT]);
        let own = frames[2].denoised.clone();
        for at in [0, 1, 3, 4] {
            frames[at].normal = Some([1.0, 0.0, 0.0].map(|v| vec![v; WIDTH * HEIGHT]));
        }
        assert_eq!(averaged_frame(&frames, 2), own);
        let (mut frames, _) = sequence(0.0, [1.0; COUNT]);
        for at in [1, 3] {
            // Motion to the neighbour and back doesn't return to the pixel.
            frames[at].motion = [5.0, 0.0, 5.0, 0.0].map(|v| vec![v; WIDTH * HEIGHT]);
        }
        let stable = averaged_frame(&frames, 2);
        let near_left = |i: &usize| i % WIDTH < WIDTH - 8;
        assert!(
            (0..WIDTH * HEIGHT)
                .filter(near_left)
                .all(|i| stable.color[0][i] == frames[2].denoised.color[0][i])
        );
    }

    #[test]
    fn parts_still_add_up() {
        let (mut frames, _) = sequence(0.4, [1.0; COUNT]);
        for frame in &mut frames {
            let color = &frame.denoised.color;
            let scaled =
                |factor: f32| [0, 1, 2].map(|c| color[c].iter().map(|v| v * factor).collect::<Vec<f32>>());
            frame.denoised.parts = vec![vec![scaled(0.25), scaled(0.75)]];
        }
        let stable = averaged_frame(&frames, 2);
        for i in 0..WIDTH * HEIGHT {
            let sum = stable.parts[0][0][0][i] + stable.parts[0][1][0][i];
            assert!((sum - stable.color[0][i]).abs() < 1e-5 * stable.color[0][i]);
        }
    }
}
