//! Rectangles of pixels with some of their samples, and the order of these.

/// A rectangle of pixels and a range of their samples.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Left column.
    pub x0: u32,
    /// Top row.
    pub y0: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// First sample of each pixel.
    pub first_sample: u32,
    /// Samples of each pixel.
    pub samples: u32,
}

/// Walks through the samples of a block, pixel by pixel.
pub(super) struct Cursor {
    pub x: u32,
    pub y: u32,
    pub sample: u64,
    x0: u32,
    x1: u32,
}

impl Cursor {
    pub fn new(block: &Block, first: u64) -> Cursor {
        let samples = u64::from(block.samples);
        let (pixel, width) = (first / samples, u64::from(block.width));
        Cursor {
            x: block.x0 + (pixel % width) as u32,
            y: block.y0 + (pixel / width) as u32,
            sample: first % samples,
            x0: block.x0,
            x1: block.x0 + block.width,
        }
    }

    #[inline(always)]
    pub fn advance(&mut self, samples: u64) {
        self.sample += 1;
        if self.sample == samples {
            self.sample = 0;
            self.x += 1;
            if self.x == self.x1 {
                (self.x, self.y) = (self.x0, self.y + 1);
            }
        }
    }
}
