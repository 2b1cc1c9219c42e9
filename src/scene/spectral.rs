//! What scenes hold that pictures by wavelength can't show.

use super::Scene;
use crate::error::Problem;

impl Scene {
    /// What of it can't be rendered by wavelength.
    pub(crate) fn spectral_problems(&self) -> Vec<Problem> {
        let of_catchers = || {
            Problem::new("", "shadow catchers can't be rendered by wavelength")
                .with_help("render without spectral, or without shadow catchers")
        };
        self.has_catchers().then(of_catchers).into_iter().collect()
    }
}
