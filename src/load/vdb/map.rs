//! Where a grid is: the ways that OpenVDB writes a transform from voxels to the world.

use super::bytes::Bytes;
use crate::math::{DAffine3, DMat3, DVec3};

/// Reads the transform of a grid: from voxels, whose middles are at whole numbers, to the file's world.
pub(super) fn read(from: &mut Bytes) -> Result<DAffine3, String> {
    let kind = from.text()?;
    let scaled = |scale, origin| DAffine3::from_mat3_translation(DMat3::from_diagonal(scale), origin);
    let map = match kind.as_str() {
        "UniformScaleMap" | "ScaleMap" => {
            let scale = from.vector()?;
            skip_vectors(from, 4)?;
            scaled(scale, DVec3::ZERO)
        }
        "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
            let (origin, scale) = (from.vector()?, from.vector()?);
            skip_vectors(from, 4)?;
            scaled(scale, origin)
        }
        "TranslationMap" => DAffine3::from_translation(from.vector()?),
        "AffineMap" | "UnitaryMap" => affine(from)?,
        _ => return Err(format!("has a transform of the kind '{kind}', which is not read")),
    };
    let volume = map.matrix3.determinant();
    match map.is_finite() && volume != 0.0 && volume.is_finite() {
        true => Ok(map),
        false => Err("has a transform that flattens it or is no number".into()),
    }
}

/// What follows from the scale.
fn skip_vectors(from: &mut Bytes, count: usize) -> Result<(), String> {
    (0..count).try_for_each(|_| from.vector().map(|_| ()))
}

/// A matrix whose rows are what the axes become, and the origin.
fn affine(from: &mut Bytes) -> Result<DAffine3, String> {
    let mut rows = [[0.0; 4]; 4];
    for value in rows.as_flattened_mut() {
        *value = from.f64()?;
    }
    let [x, y, z, origin] = rows.map(|[x, y, z, _]| DVec3::new(x, y, z));
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin))
}
