//! The points of OBJ files (`p`), which `tobj` knows nothing of: the file's positions are read once more for them.

use super::lines::{Clean, Words, each_line, float};
use crate::color::linear_from_srgb;
use crate::error::{Error, Result};
use crate::load::points::Cloud;
use crate::load::{LoadOptions, Loaded};
use crate::math::DVec3;
use std::fs::File;
use std::path::Path;

/// All positions of a file with their colours.
struct Positions {
    origin: DVec3,
    positions: Vec<[f32; 3]>,
    /// Linear; white where a position has none.
    colors: Vec<[f32; 4]>,
    has_colors: bool,
}

impl Clean for Positions {
    fn line(&mut self, _: usize, text: &[u8], _: &mut Vec<u8>) {
        let mut words = Words(text);
        if words.next() != Some(b"v") {
            return;
        }
        let mut position = [f64::NAN; 3];
        for (number, word) in position.iter_mut().zip(words.by_ref()) {
            *number = super::lines::double(word).unwrap_or(f64::NAN);
        }
        let rgb: Vec<f32> = words.filter_map(float).collect();
        self.has_colors |= rgb.len() == 3;
        let [r, g, b] = match rgb[..] {
            [r, g, b] => [r, g, b].map(linear_from_srgb),
            _ => [1.0; 3],
        };
        self.positions.push((DVec3::from_array(position) - self.origin).as_vec3().to_array());
        self.colors.push([r, g, b, 1.0]);
    }
}

/// Adds the points with these numbers, from 0, as spheres.
///
/// # Errors
/// An input error if the file can no longer be read, a usage error for a radius that is none.
pub(super) fn add(
    path: &Path,
    numbers: &[u32],
    origin: DVec3,
    options: &LoadOptions,
    loaded: &mut Loaded,
) -> Result<()> {
    let unreadable = |e| Error::input(path, format!("can't be read: {e}"));
    let file = File::open(path).map_err(unreadable)?;
    let empty = Positions { origin, positions: Vec::new(), colors: Vec::new(), has_colors: false };
    let all = each_line(file, empty).map_err(unreadable)?;
    let of_points = numbers.iter().map(|&n| n as usize).filter(|&n| n < all.positions.len());
    let positions: Vec<[f32; 3]> = of_points.clone().map(|n| all.positions[n]).collect();
    let colors = of_points.filter(|_| all.has_colors).map(|n| all.colors[n]).collect::<Vec<_>>();
    Cloud { positions: &positions, colors: &colors, origin }.add(path, options, loaded)
}

/// Where the points of a file without faces need their origin: see [`crate::load::far::origin`].
pub(super) fn positions(path: &Path, numbers: &[u32]) -> Result<Vec<[f32; 3]>> {
    let unreadable = |e| Error::input(path, format!("can't be read: {e}"));
    let file = File::open(path).map_err(unreadable)?;
    let empty =
        Positions { origin: DVec3::ZERO, positions: Vec::new(), colors: Vec::new(), has_colors: false };
    let all = each_line(file, empty).map_err(unreadable)?;
    Ok(numbers.iter().filter_map(|&n| all.positions.get(n as usize).copied()).collect())
}
