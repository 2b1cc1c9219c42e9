//! Axis-aligned boxes.

use super::Vec3;

/// An axis-aligned box; empty when any `min` exceeds its `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds3 {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Bounds3 {
    /// The box that holds nothing.
    pub const EMPTY: Bounds3 = Bounds3 { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Bounds3 {
        points.into_iter().fold(Bounds3::EMPTY, Bounds3::with)
    }

    /// Grown to hold a point.
    #[inline(always)]
    pub fn with(self, p: Vec3) -> Bounds3 {
        Bounds3 { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box that holds both.
    #[inline(always)]
    pub fn union(self, other: Bounds3) -> Bounds3 {
        Bounds3 { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Does it hold no point?
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The middle.
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Edge lengths; zero for an empty box.
    pub fn extent(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.max - self.min }
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            Vec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}
