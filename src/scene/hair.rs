//! The colour of hair, by what a fibre absorbs: Chiang, Bitterli, Tappan, Burley 2016, eq. 9.

use crate::math::poly;

/// Hair is no less rough around its fibre.
const LEAST_ROUGHNESS: f32 = 0.01;

/// What the logarithm of the colour of much hair is divided by for the root of its absorption per radius, at a radial roughness.
pub fn hair_color_scale(radial_roughness: f32) -> f32 {
    let b = radial_roughness.clamp(LEAST_ROUGHNESS, 1.0);
    ((((0.245 * b + 5.574) * b - 10.73) * b + 2.532) * b - 0.215) * b + 5.969
}

/// The colour of much hair that absorbs so much per radius.
pub fn hair_color(absorption: [f32; 3], radial_roughness: f32) -> [f32; 3] {
    let scale = hair_color_scale(radial_roughness);
    absorption.map(|a| poly::exp(-scale * a.max(0.0).sqrt()))
}
