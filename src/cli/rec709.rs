//! Colours of files as views take them.

use oscura::color::converted;
use oscura::load::image::Layered;

/// Colours of another space, which the file names, become linear Rec. 709, which views are for.
pub(super) fn to_rec709(file: &Layered, rgb: &mut [Vec<f32>; 3]) {
    let Some(matrix) = file.primaries().and_then(|primaries| primaries.to_rec709()) else { return };
    for i in 0..rgb[0].len() {
        let color = converted(&matrix, [0, 1, 2].map(|c| rgb[c][i]));
        rgb.iter_mut().zip(color).for_each(|(plane, value)| plane[i] = value);
    }
}
