//! How much is done for the trees that rays walk.

use crate::accel::TreeQuality;

/// How good the trees over a scene's shapes are. Rays meet the same shapes either way (see [`TreeQuality`]), so pictures don't
/// depend on it: a full tree takes longer to build and makes rays faster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tree {
    /// Built soon.
    Fast,
    /// The fewest steps a ray.
    #[default]
    Full,
    /// What takes less time in all for so many camera rays (and what follows them): by numbers alone, so that the same
    /// command always builds the same tree.
    For {
        /// Pixels times samples.
        camera_rays: u64,
    },
}

/// Scenes of fewer triangles have full trees: they take less than a third of a second.
const MIN_TRIANGLES: u64 = 1 << 17;

/// So many camera rays a triangle pay for a full tree. (Measured: see the README of `tools/rays`.)
const RAYS_A_TRIANGLE: u64 = 4;

impl Tree {
    /// The quality for so many triangles.
    pub fn quality(self, triangles: u64) -> TreeQuality {
        match self {
            Tree::Fast => TreeQuality::Fast,
            Tree::For { camera_rays }
                if triangles >= MIN_TRIANGLES && camera_rays < triangles.saturating_mul(RAYS_A_TRIANGLE) =>
            {
                TreeQuality::Fast
            }
            _ => TreeQuality::Full,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_rays_into_many_triangles_ask_for_a_fast_tree() {
        let quality = |camera_rays, triangles| Tree::For { camera_rays }.quality(triangles);
        assert_eq!(quality(1, 100_000), TreeQuality::Full);
        assert_eq!(quality(7_999_999, 2_000_000), TreeQuality::Fast);
        assert_eq!(quality(8_000_000, 2_000_000), TreeQuality::Full);
        assert_eq!(quality(u64::MAX, u64::MAX), TreeQuality::Full);
        assert_eq!(Tree::Fast.quality(1), TreeQuality::Fast);
        assert_eq!(Tree::default().quality(u64::MAX), TreeQuality::Full);
    }
}
