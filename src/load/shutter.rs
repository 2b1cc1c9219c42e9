//! Shutter interval and number of motion keys.

use crate::math::{DAffine3, DVec3, mix};

/// Options of the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShutterOptions {
    /// Shutter time, frames; `None`: as the scene says, else 0 (no motion blur).
    pub frames: Option<f64>,
    /// When it is open; `None`: as the scene says, else centred at the picture's time.
    pub position: Option<ShutterPosition>,
    /// Frames per second, for animations in seconds.
    pub fps: f64,
    /// Number of motion keys, 2 or more; `None`: as many as the trajectories need.
    pub keys: Option<u32>,
    /// Sample the previous and the next frame, too, for motion vectors.
    pub vectors: bool,
}

impl Default for ShutterOptions {
    fn default() -> ShutterOptions {
        ShutterOptions { frames: None, position: None, fps: 24.0, keys: None, vectors: false }
    }
}

/// When the shutter is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShutterPosition {
    /// It opens at the picture's time.
    Start,
    /// The picture's time is the middle of the interval.
    #[default]
    Centre,
    /// It closes at the picture's time.
    End,
}

impl ShutterPosition {
    /// All of them, by name.
    pub const ALL: [(&str, ShutterPosition); 3] = [
        ("start", ShutterPosition::Start),
        ("centre", ShutterPosition::Centre),
        ("end", ShutterPosition::End),
    ];
}

/// Maximum shutter time, frames.
pub const LONGEST_SHUTTER: f64 = 1000.0;

/// Maximum number of keys chosen automatically.
const MAX_KEYS: usize = 65;

/// Tolerance of interpolated transforms: axes relative to their length, positions relative to the whole trajectory.
const TOLERANCE: f64 = 1e-3;

/// The tolerance at the maximum number of keys; beyond, a warning is given.
const LAST_TOLERANCE: f64 = 1e-2;

impl ShutterOptions {
    /// With the scene's settings where the user has none.
    #[must_use]
    pub fn or(self, frames: Option<f64>, position: Option<ShutterPosition>) -> ShutterOptions {
        ShutterOptions { frames: self.frames.or(frames), position: self.position.or(position), ..self }
    }

    /// Is the shutter time above 0?
    pub fn is_open(&self) -> bool {
        self.frames.is_some_and(|frames| frames > 0.0)
    }

    /// Are samples at other times needed?
    pub fn wants_motion(&self) -> bool {
        self.is_open() || self.vectors
    }

    /// A time in the shutter interval (`share` 0 to 1), frames relative to the picture's time.
    pub fn frame_at(&self, share: f64) -> f64 {
        let frames = self.frames.unwrap_or(0.0);
        match self.position.unwrap_or_default() {
            ShutterPosition::Start => frames * share,
            ShutterPosition::Centre => frames * (share - 0.5),
            ShutterPosition::End => frames * (share - 1.0),
        }
    }

    /// The times of `keys` keys, frames relative to the picture's time.
    pub fn key_frames(&self, keys: usize) -> impl Iterator<Item = f64> + use<> {
        let options = *self;
        let last = keys.saturating_sub(1).max(1) as f64;
        (0..keys).map(move |key| options.frame_at(key as f64 / last))
    }

    /// Number of keys that objects need whose transforms at a frame are `places(frame)` (always as many): so many that they are between
    /// keys where interpolation has them, within the tolerance. And are these enough?
    pub fn keys_for(&self, places: &mut dyn FnMut(f64) -> Vec<DAffine3>) -> (usize, bool) {
        if !self.is_open() {
            return (0, true);
        }
        if let Some(keys) = self.keys {
            return (keys as usize, true);
        }
        let ways = self.ways(places);
        let mut steps = 1;
        while steps + 1 < MAX_KEYS {
            if self.is_even(steps, places, &ways, TOLERANCE) {
                return (steps + 1, true);
            }
            steps *= 2;
        }
        (steps + 1, self.is_even(steps, places, &ways, LAST_TOLERANCE))
    }

    /// Approximate lengths of the trajectories in the shutter interval.
    fn ways(&self, places: &mut dyn FnMut(f64) -> Vec<DAffine3>) -> Vec<f64> {
        const STEPS: u32 = 8;
        let mut before = places(self.frame_at(0.0));
        let mut ways = vec![0.0; before.len()];
        for step in 1..=STEPS {
            let next = places(self.frame_at(f64::from(step) / f64::from(STEPS)));
            for (way, (from, to)) in ways.iter_mut().zip(before.iter().zip(&next)) {
                *way += from.translation.distance(to.translation);
            }
            before = next;
        }
        ways
    }

    /// Is interpolation between this number of steps within the tolerance?
    fn is_even(
        &self,
        steps: usize,
        places: &mut dyn FnMut(f64) -> Vec<DAffine3>,
        ways: &[f64],
        tolerance: f64,
    ) -> bool {
        // Some per step, at irregular times: periodic motion must not alias.
        let between = (7 / steps).max(2);
        let inner = |k: usize| (k as f64 + 0.9) / (between as f64 + 0.8);
        let (mut from, mut is_even) = (places(self.frame_at(0.0)), true);
        for step in 0..steps {
            let at = |inner: f64| self.frame_at((step as f64 + inner) / steps as f64);
            let to = places(at(1.0));
            for share in (0..between).map(inner) {
                let met = places(at(share));
                let all = from.iter().zip(&to).zip(met.iter().zip(ways));
                is_even &= all
                    .into_iter()
                    .all(|((from, to), (met, way))| is_near(&mix(from, to, share), met, tolerance, *way));
            }
            if !is_even {
                return false;
            }
            from = to;
        }
        true
    }
}

/// Does a transform approximate another within the tolerance? `way` is the length of the trajectory.
fn is_near(found: &DAffine3, met: &DAffine3, tolerance: f64, way: f64) -> bool {
    let axes = |m: &DAffine3| [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let is_near = |(found, met): (DVec3, DVec3)| (found - met).length() <= tolerance * met.length();
    // Motion below the precision of f64 counts as none.
    let distance = tolerance * way + 1e-12 * met.translation.length();
    let is_placed = found.translation.distance(met.translation) <= distance;
    is_placed && axes(found).into_iter().zip(axes(met)).all(is_near)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(frames: f64) -> ShutterOptions {
        ShutterOptions { frames: Some(frames), ..ShutterOptions::default() }
    }

    #[test]
    fn straight_ways_need_two_keys_and_turns_as_many_as_their_angle() {
        let shift = |frame: f64| vec![DAffine3::from_translation(DVec3::X * frame)];
        assert_eq!(open(0.5).keys_for(&mut |f| shift(f)), (2, true));
        assert_eq!(open(0.0).keys_for(&mut |f| shift(f)), (0, true));
        let turn = |speed: f64| move |frame: f64| vec![DAffine3::from_rotation_y(speed * frame)];
        let keys = |speed: f64| open(1.0).keys_for(&mut turn(speed));
        assert_eq!(keys(0.05), (2, true));
        // 1 - cos(a / 2) is a thousandth at 5.1 degrees.
        assert_eq!(keys(1.0), (17, true));
        assert_eq!(keys(std::f64::consts::TAU), (65, true));
        assert_eq!(keys(20.0), (65, false));
        assert_eq!(ShutterOptions { keys: Some(3), ..open(1.0) }.keys_for(&mut turn(9.0)), (3, true));
    }

    #[test]
    fn the_shutter_opens_before_at_and_after_the_moment() {
        let frames = |position| {
            let options = ShutterOptions { position: Some(position), ..open(0.5) };
            options.key_frames(3).collect::<Vec<_>>()
        };
        assert_eq!(frames(ShutterPosition::Start), [0.0, 0.25, 0.5]);
        assert_eq!(frames(ShutterPosition::Centre), [-0.25, 0.0, 0.25]);
        assert_eq!(frames(ShutterPosition::End), [-0.5, -0.25, 0.0]);
    }
}
