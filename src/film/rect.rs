//! Rectangles of pictures, and the bands that they are divided into.

use std::ops::Range;

/// Rows of a band.
pub(super) const BAND_ROWS: u32 = 16;

/// A rectangle of a picture: left, top, right, bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub x0: u32,
    pub y0: u32,
    pub x1: u32,
    pub y1: u32,
}

impl Rect {
    /// By its corner and size.
    pub fn new((x0, y0): (u32, u32), (width, height): (u32, u32)) -> Rect {
        Rect { x0, y0, x1: x0.saturating_add(width), y1: y0.saturating_add(height) }
    }

    pub fn width(self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    pub fn height(self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    pub fn area(self) -> u64 {
        u64::from(self.width()) * u64::from(self.height())
    }

    /// What is within both.
    #[must_use]
    pub fn and(self, other: Rect) -> Rect {
        Rect {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }

    /// Its band of this number.
    #[must_use]
    pub fn band(self, number: usize) -> Rect {
        let y0 = self.y0 + number as u32 * BAND_ROWS;
        Rect { y0, y1: y0.saturating_add(BAND_ROWS).min(self.y1), ..self }
    }

    /// The numbers of its bands that have something of another one.
    pub fn bands_over(self, other: Rect) -> Range<usize> {
        let both = self.and(other);
        if both.area() == 0 {
            return 0..0;
        }
        let number = |y: u32| ((y - self.y0) / BAND_ROWS) as usize;
        number(both.y0)..number(both.y1 - 1) + 1
    }

    /// The rows of what is within both, each by its first pixel in this one and in the other, and its length.
    pub fn rows_of(self, other: Rect) -> impl Iterator<Item = (usize, usize, usize)> {
        let both = self.and(other);
        let rows = if both.x0 < both.x1 { both.y0..both.y1 } else { 0..0 };
        let place =
            move |of: Rect, y: u32| (y - of.y0) as usize * of.width() as usize + (both.x0 - of.x0) as usize;
        rows.map(move |y| (place(self, y), place(other, y), both.width() as usize))
    }
}
