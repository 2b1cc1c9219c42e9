//! What of a scene pictures by wavelength need, and what they can't show.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::material::CompiledMaterial;
use crate::color::Rgb;
use crate::color::spectral::Spectrum;
use crate::error::{Problem, Warning};
use crate::scene::{Environment, Medium, Model, Scene, ShadingModel};
use std::sync::Arc;

/// What pictures by wavelength can't show.
pub(super) fn problems(scene: &Scene) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut refuse = |location: String, what: &str, help: &str| {
        let mut problem = Problem::new(location, format!("{what} can't be rendered by wavelength"));
        problem.help = Some(help.to_string());
        problems.push(problem);
    };
    if scene.has_catchers() {
        refuse(String::new(), "shadow catchers", "render without spectral, or without shadow catchers");
    }
    let help = "make density, colour and light of the medium grey, or render without spectral";
    if scene.fog.as_ref().is_some_and(|fog| is_coloured(&fog.medium)) {
        refuse("fog".to_string(), "coloured media that scatter or shine", help);
    }
    for material in &scene.materials {
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

fn scatters(medium: &Medium) -> bool {
    (0..3).any(|c| medium.extinction[c] * medium.albedo[c] > 0.0 || medium.emission[c] > 0.0)
        || medium.grid.is_some()
}

/// Does a medium that scatters or shines treat channels differently?
fn is_coloured(medium: &Medium) -> bool {
    let differs = |[r, g, b]: [f32; 3]| r != g || g != b;
    scatters(medium) && (differs(medium.extinction) || differs(medium.albedo) || differs(medium.emission))
}

/// What pictures by wavelength show otherwise than it may be meant.
pub(super) fn warn(scene: &Scene, warnings: &mut Vec<Warning>) {
    for material in &scene.materials {
        if let Model::Conductor { metal: None, .. } = material.model {
            let name = &material.name;
            warnings.push(Warning::general(format!(
                "the index of refraction of metal '{name}' is known for three wavelengths only: others lie between; name \
                 a measured metal"
            )));
        }
    }
}

/// The spectra of the lights that shine the same everywhere, by number; empty where pictures are not rendered by wavelength.
pub(super) fn of_lights(
    scene: &Scene,
    emitters: &Emitters,
    geometries: &Geometries,
    materials: &[CompiledMaterial],
    shading: ShadingModel,
) -> Vec<Option<Arc<Spectrum>>> {
    if !shading.spectral {
        return Vec::new();
    }
    let of_color = |rgb: [f32; 3]| match Spectrum::of_light(Rgb::from_array(rgb)) {
        Spectrum::Grey(_) => None,
        spectrum => Some(Arc::new(spectrum)),
    };
    let mut spectra = vec![None; emitters.lights.len()];
    for (light, _, material) in emitters.owners(geometries) {
        spectra[light].clone_from(&materials[material as usize].light_spectrum);
    }
    spectra.extend(scene.lights.iter().map(|light| of_color(light.intensity)));
    // The environment is the last one.
    spectra.extend(match scene.environment {
        Environment::Constant(rgb) => Some(of_color(rgb)),
        _ => None,
    });
    spectra
}
