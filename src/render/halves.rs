//! What the two halves of pixels' samples differ by: an estimate of their error.

/// Largest error that a pixel may count for, relative to its value: rare bright samples would else decide alone.
const LARGEST_ERROR: f64 = 3.0;

/// Sums of the first and the second half of a pixel's samples.
#[derive(Clone, Copy, Default)]
pub(super) struct Halves([[f64; 3]; 2]);

impl Halves {
    /// Adds a sample to a half, 0 or 1; nothing to others.
    pub fn add(&mut self, half: u32, rgb: [f32; 3]) {
        if let Some(sum) = self.0.get_mut(half as usize) {
            sum.iter_mut().zip(rgb).for_each(|(sum, v)| *sum += f64::from(v));
        }
    }

    /// Squared difference of the halves' means of `half` samples each, relative to the pixel's value in `whole`, summed
    /// over the channels.
    pub fn squared_error(&self, half: u32, whole: &Halves) -> f64 {
        let scale = 1.0 / f64::from(half);
        let of_channel = |c: usize| {
            let mean = 0.5 * scale * (whole.0[0][c] + whole.0[1][c]);
            let difference = (self.0[0][c] - self.0[1][c]) * scale;
            let squared = difference * difference / (mean * mean + 0.01);
            // NaN counts as nothing.
            if squared > 0.0 { squared.min(LARGEST_ERROR * LARGEST_ERROR) } else { 0.0 }
        };
        (0..3).map(of_channel).sum()
    }
}
