//! Planes of floats, row by row from the top.

use rayon::prelude::*;

/// Red, green and blue of all pixels, row by row from the top.
pub type Color<'a> = [&'a [f32]; 3];

/// Three planes as a [`Color`].
pub fn slices(planes: &[Vec<f32>; 3]) -> [&[f32]; 3] {
    planes.each_ref().map(Vec::as_slice)
}

/// Box blur: means over squares of a radius, of the pixels inside of the picture.
pub(super) fn smoothed(width: usize, height: usize, plane: &[f32], radius: usize) -> Vec<f32> {
    let mut out = vec![0.0; width * height];
    out.par_chunks_mut(width).enumerate().for_each_init(
        || vec![0.0f32; width],
        |sums, (y, row)| {
            let (y0, y1) = (y.saturating_sub(radius), (y + radius + 1).min(height));
            sums.fill(0.0);
            for from in plane[y0 * width..y1 * width].chunks_exact(width) {
                sums.iter_mut().zip(from).for_each(|(sum, v)| *sum += v);
            }
            for (x, to) in row.iter_mut().enumerate() {
                let inside = &sums[x.saturating_sub(radius)..(x + radius + 1).min(width)];
                *to = inside.iter().sum::<f32>() / (inside.len() * (y1 - y0)) as f32;
            }
        },
    );
    out
}
