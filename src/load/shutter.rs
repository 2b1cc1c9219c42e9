//! When the shutter of the camera is open, and at how many moments of that time to look at what moves.

use crate::math::{DAffine3, DVec3, mix};

/// What the user may choose about the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShutterOptions {
    /// How long it is open, frames; `None`: as the scene says, and else not at all.
    pub frames: Option<f64>,
    /// When it is open; `None`: as the scene says, and else around the picture's moment.
    pub position: Option<ShutterPosition>,
    /// Frames a second, for what moves by seconds.
    pub fps: f64,
    /// At how many moments to look at what moves, 2 or more; `None`: as many as its paths need.
    pub keys: Option<u32>,
    /// Look a frame back and a frame ahead, too, for motion vectors.
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
    /// It opens at the picture's moment.
    Start,
    /// The picture's moment is in the middle.
    #[default]
    Centre,
    /// It closes at the picture's moment.
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

/// Longest time that the shutter is open, frames.
pub const LONGEST_SHUTTER: f64 = 1000.0;

/// Most keys that are chosen for something.
const MOST_KEYS: usize = 65;

/// Interpolated axes may be off by this part of their length, and places by this part of the whole way.
const TOLERANCE: f64 = 1e-3;

/// The same where there can't be more keys: beyond, it is said.
const LAST_TOLERANCE: f64 = 1e-2;

impl ShutterOptions {
    /// With what a scene says, where the user has not chosen.
    #[must_use]
    pub fn or(self, frames: Option<f64>, position: Option<ShutterPosition>) -> ShutterOptions {
        ShutterOptions { frames: self.frames.or(frames), position: self.position.or(position), ..self }
    }

    /// Is it open for a while?
    pub fn is_open(&self) -> bool {
        self.frames.is_some_and(|frames| frames > 0.0)
    }

    /// Is anything to be known of other moments?
    pub fn wants_motion(&self) -> bool {
        self.is_open() || self.vectors
    }

    /// A moment of the time that it is open, by a share of it: frames from the picture's moment on.
    pub fn frame_at(&self, share: f64) -> f64 {
        let frames = self.frames.unwrap_or(0.0);
        match self.position.unwrap_or_default() {
            ShutterPosition::Start => frames * share,
            ShutterPosition::Centre => frames * (share - 0.5),
            ShutterPosition::End => frames * (share - 1.0),
        }
    }

    /// The moments of so many keys, frames from the picture's moment on.
    pub fn key_frames(&self, keys: usize) -> impl Iterator<Item = f64> + use<> {
        let options = *self;
        let last = keys.saturating_sub(1).max(1) as f64;
        (0..keys).map(move |key| options.frame_at(key as f64 / last))
    }

    /// How many keys things need whose places at a moment `places` tells, always as many: so many that they are between
    /// keys where interpolation has them. And are these enough?
    pub fn keys_for(&self, places: &mut dyn FnMut(f64) -> Vec<DAffine3>) -> (usize, bool) {
        if !self.is_open() {
            return (0, true);
        }
        if let Some(keys) = self.keys {
            return (keys as usize, true);
        }
        let ways = self.ways(places);
        let mut steps = 1;
        while steps + 1 < MOST_KEYS {
            if self.is_even(steps, places, &ways, TOLERANCE) {
                return (steps + 1, true);
            }
            steps *= 2;
        }
        (steps + 1, self.is_even(steps, places, &ways, LAST_TOLERANCE))
    }

    /// How far things go while it is open, roughly.
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

    /// Does interpolation between so many steps meet the places in between?
    fn is_even(
        &self,
        steps: usize,
        places: &mut dyn FnMut(f64) -> Vec<DAffine3>,
        ways: &[f64],
        tolerance: f64,
    ) -> bool {
        // Some on each step; uneven numbers, that what goes round and round is not always met at the same place.
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

/// Is a place near another, of something that goes a certain way in all?
fn is_near(found: &DAffine3, met: &DAffine3, tolerance: f64, way: f64) -> bool {
    let axes = |m: &DAffine3| [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let is_near = |(found, met): (DVec3, DVec3)| (found - met).length() <= tolerance * met.length();
    // What moves by less than numbers can tell stands still.
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
