//! What scenes hold that pictures by wavelength can't show.

use super::{Medium, Scene};
use crate::error::Problem;

impl Scene {
    /// What of it can't be rendered by wavelength.
    pub(crate) fn spectral_problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut refuse = |location: String, what: &str, help: &str| {
            let mut problem = Problem::new(location, format!("{what} can't be rendered by wavelength"));
            problem.help = Some(help.to_string());
            problems.push(problem);
        };
        if self.has_catchers() {
            refuse(String::new(), "shadow catchers", "render without spectral, or without shadow catchers");
        }
        let help = "make density, colour and light of the medium grey, or render without spectral";
        if self.fog.as_ref().is_some_and(|fog| is_coloured(&fog.medium)) {
            refuse("fog".to_string(), "coloured media that scatter or shine", help);
        }
        for material in &self.materials {
            let absorbs = material.model.pbr().is_some_and(|pbr| {
                let [r, g, b] = pbr.attenuation_color;
                r != g || g != b
            });
            let scatters = |medium: &Medium| scatters(medium) && (absorbs || is_coloured(medium));
            if material.medium.as_ref().is_some_and(scatters) {
                let location = format!("material '{}'", material.name);
                refuse(location, "coloured media that scatter or shine", help);
            }
        }
        problems
    }
}

fn scatters(medium: &Medium) -> bool {
    (0..3).any(|c| medium.extinction[c] * medium.albedo[c] > 0.0 || medium.emission[c] > 0.0)
        || medium.grid.is_some()
}

/// Does a medium that scatters or shines treat channels differently?
fn is_coloured(medium: &Medium) -> bool {
    let differs = |[r, g, b]: [f32; 3]| r != g || g != b;
    scatters(medium) && (differs(medium.extinction) || differs(medium.albedo) || differs(medium.emission))
}
