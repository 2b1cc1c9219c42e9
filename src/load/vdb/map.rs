//! Where a grid is: the ways that OpenVDB writes a transform from voxels to the world.

use super::bytes::Bytes;
use crate::math::DVec3;

/// A box of voxels along the axes of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Map {
    /// Metres a voxel; may be below 0.
    pub scale: DVec3,
    /// Where the middle of voxel 0 is.
    pub origin: DVec3,
}

impl Map {
    /// Reads the transform of a grid.
    pub fn read(from: &mut Bytes) -> Result<Map, String> {
        let kind = from.text()?;
        let map = match kind.as_str() {
            "UniformScaleMap" | "ScaleMap" => {
                let scale = from.vector()?;
                skip_vectors(from, 4)?;
                Map { scale, origin: DVec3::ZERO }
            }
            "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
                let (origin, scale) = (from.vector()?, from.vector()?);
                skip_vectors(from, 4)?;
                Map { scale, origin }
            }
            "TranslationMap" => Map { scale: DVec3::ONE, origin: from.vector()? },
            "AffineMap" | "UnitaryMap" => affine(from)?,
            _ => return Err(format!("has a transform of the kind '{kind}', which is not read")),
        };
        let is_usable =
            map.origin.is_finite() && map.scale.is_finite() && map.scale.abs().min_element() > 0.0;
        match is_usable {
            true => Ok(map),
            false => Err("has a transform that flattens it or is no number".into()),
        }
    }
}

/// What follows from the scale.
fn skip_vectors(from: &mut Bytes, count: usize) -> Result<(), String> {
    (0..count).try_for_each(|_| from.vector().map(|_| ()))
}

/// A matrix whose rows are what the axes become, and the origin.
fn affine(from: &mut Bytes) -> Result<Map, String> {
    let mut rows = [[0.0; 4]; 4];
    for value in rows.as_flattened_mut() {
        *value = from.f64()?;
    }
    let scale = DVec3::new(rows[0][0], rows[1][1], rows[2][2]);
    let off_axis = (0..3).flat_map(|i| (0..3).filter(move |&k| k != i).map(move |k| (i, k)));
    let largest = off_axis.map(|(i, k)| rows[i][k].abs()).fold(0.0, f64::max);
    if largest > 1e-6 * scale.abs().max_element() {
        return Err("is turned: only grids along the axes of the world are read".into());
    }
    Ok(Map { scale, origin: DVec3::new(rows[3][0], rows[3][1], rows[3][2]) })
}
