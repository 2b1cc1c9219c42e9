//! Colours of materials as spectra, where pictures are rendered by wavelength. Greys stay as they are.

use super::fold::fold_color;
use crate::color::Rgb;
use crate::color::spectral::Spectrum;
use crate::scene::{ColorSlot, Material, ParameterMut, Parameters};
use crate::texture::CompiledTextures;
use std::sync::Arc;

/// A material whose constant colours are spectra among the textures.
pub(super) fn with_spectra(material: &Material, textures: &mut CompiledTextures) -> Material {
    let mut uplifted = material.clone();
    uplifted.model.visit_mut("", &mut |_, parameter| {
        if let ParameterMut::Color(slot) = parameter {
            let folded = fold_color(*slot, textures);
            let spectrum = Spectrum::of_share(Rgb::from_array(folded.factor));
            *slot = match (folded.texture, spectrum) {
                (None, spectrum @ Spectrum::Uplifted { .. }) => {
                    ColorSlot::texture(textures.add_spectrum(spectrum))
                }
                _ => folded,
            };
        }
    });
    uplifted
}

/// What shines: the slot with a constant colour in place of a spectrum, and the spectrum.
pub(super) fn of_light(slot: ColorSlot, textures: &CompiledTextures) -> (ColorSlot, Option<Arc<Spectrum>>) {
    let slot = fold_color(slot, textures);
    match slot.texture {
        Some(id) => match textures.spectrum(id) {
            Some(spectrum) => {
                let look = spectrum.rgb().max(Rgb::ZERO) * Rgb::from_array(slot.factor);
                (ColorSlot::constant(look.to_array()), Some(Arc::new(spectrum.clone())))
            }
            None => (slot, None),
        },
        None => match Spectrum::of_light(Rgb::from_array(slot.factor)) {
            Spectrum::Grey(_) => (slot, None),
            spectrum => (slot, Some(Arc::new(spectrum))),
        },
    }
}
