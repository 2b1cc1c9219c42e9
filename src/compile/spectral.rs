//! What of a scene pictures by wavelength need.

use super::emitters::Emitters;
use super::geometry::Geometries;
use super::material::CompiledMaterial;
use crate::color::Rgb;
use crate::color::spectral::Spectrum;
use crate::error::Warning;
use crate::scene::{Environment, Model, Scene, ShadingModel};
use std::sync::Arc;

/// What pictures by wavelength show otherwise than it may be meant.
pub(super) fn warn(scene: &Scene, shading: ShadingModel, warnings: &mut Vec<Warning>) {
    for material in scene.materials.iter().filter(|_| shading.spectral) {
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
