//! What a filter works on.

use super::planes::Planes;

/// Albedo, normal, depth.
pub(super) const MOST_GUIDES: usize = 7;

/// What is filtered, and by what.
pub(super) struct Filter<'a> {
    /// Red, green and blue whose patches are compared.
    pub color: &'a Planes,
    /// Variances of their values.
    pub variance: &'a Planes,
    /// How many standard deviations patches may differ by.
    pub bandwidth: f32,
    /// What colours are taken to be linear in.
    pub guides: &'a Planes,
    /// One over the squared difference from which on pixels are strangers, for each guide.
    pub sharpness: &'a [f32],
    /// What is filtered; any number of planes.
    pub data: &'a Planes,
}
