//! Colours of files as views take them.

use oscura::load::image::Layered;

/// Colours of another space, which the file names, become linear Rec. 709, which views are for.
pub(super) fn to_rec709(file: &Layered, rgb: &mut [Vec<f32>; 3]) {
    let Some(matrix) = file.primaries().and_then(|primaries| primaries.to_rec709()) else { return };
    for i in 0..rgb[0].len() {
        let from = [0, 1, 2].map(|c| f64::from(rgb[c][i]));
        for (plane, row) in rgb.iter_mut().zip(&matrix) {
            plane[i] = (row[0] * from[0] + row[1] * from[1] + row[2] * from[2]) as f32;
        }
    }
}
