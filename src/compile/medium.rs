//! What solids are filled with: indices of refraction and absorption.

use super::closed::{Outline, outline};
use super::material::{CompiledMaterial, lets_light_in};
use crate::bsdf::BsdfClass;
use crate::color::Rgb;
use crate::error::Warning;
use crate::math::poly;
use crate::scene::{MaterialId, Model, PbrMaterial, Scene};

/// The inside of a solid that light passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Index of refraction of the red, green and blue channel, relative to air; `None` where the surface reflects all
    /// light or none, whatever is beside it.
    pub iors: Option<[f32; 3]>,
    /// Extinction coefficient by channel, per metre; `None` for clear media.
    pub absorption: Option<Rgb>,
}

impl Medium {
    /// What surrounds the scene.
    pub const AIR: Medium = Medium { iors: Some([1.0; 3]), absorption: None };

    /// What a material's solids are filled with; `None` for opaque and thin-walled ones.
    pub(super) fn of(model: &Model, class: BsdfClass) -> Option<Medium> {
        let refracts =
            matches!(class, BsdfClass::Dielectric | BsdfClass::RoughDielectric | BsdfClass::Layered);
        match model {
            _ if !refracts => None,
            Model::Dielectric { ior, .. } | Model::Glass { ior, is_thin: false, .. } => {
                Some(Medium { iors: relative_to_air([*ior; 3]), absorption: None })
            }
            Model::Pbr(pbr) if pbr.has_volume && lets_light_in(pbr) => {
                let iors = dispersion(pbr).unwrap_or([pbr.ior; 3]);
                Some(Medium { iors: relative_to_air(iors), absorption: absorption(pbr) })
            }
            _ => None,
        }
    }

    /// Does its index of refraction differ between channels?
    #[inline]
    pub fn is_dispersive(&self) -> bool {
        self.iors.is_some_and(|[r, g, b]| r != g || g != b)
    }

    /// What is left of light after a way through the medium, in metres.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        let Some(absorption) = self.absorption else { return Rgb::ONE };
        let optical = absorption * -distance;
        optical.map(poly::exp)
    }
}

/// Gathers the media of a scene's materials after that of the environment, and tells the materials their numbers.
///
/// Materials that nothing has get none. Neither do clear media of open surfaces: a pane that is a single sheet is meant as
/// a window, and would fill the room behind it with glass.
pub(super) fn number(
    scene: &Scene,
    materials: &mut [CompiledMaterial],
    warnings: &mut Vec<Warning>,
) -> Vec<Medium> {
    let mut media = vec![Medium::AIR];
    let mut left_out = 0;
    for (id, material) in materials.iter_mut().enumerate() {
        let Some(medium) = material.medium else { continue };
        let is_kept = match outline(scene, MaterialId(id as u32)) {
            Outline::None => false,
            Outline::Open => medium.absorption.is_some() || medium.is_dispersive(),
            Outline::Closed => true,
        };
        if !is_kept {
            continue;
        }
        match u16::try_from(media.len()) {
            Ok(index) => {
                material.medium_index = index;
                media.push(medium);
            }
            Err(_) => left_out += 1,
        }
    }
    if left_out > 0 {
        let most = u16::MAX;
        warnings.push(Warning::general(format!(
            "{left_out} materials of solids are more than the {most} whose insides are kept apart: the others neither \
             absorb nor show what is around them"
        )));
    }
    media
}

/// An index of 0 stands for total reflection in KHR_materials_ior: it relates to no other.
fn relative_to_air(iors: [f32; 3]) -> Option<[f32; 3]> {
    iors.iter().all(|&ior| ior >= 1.0).then_some(iors)
}

/// The extinction coefficient of Beer's law from colour and distance (KHR_materials_volume).
fn absorption(pbr: &PbrMaterial) -> Option<Rgb> {
    let is_clear = pbr.attenuation_color == [1.0; 3] || !pbr.attenuation_distance.is_finite();
    if is_clear || pbr.attenuation_distance <= 0.0 {
        return None;
    }
    // Black would be infinite; f32's smallest normal number is black enough.
    let sigma =
        |c: f32| -f64::from(c.clamp(f32::MIN_POSITIVE, 1.0)).ln() / f64::from(pbr.attenuation_distance);
    Some(Rgb::from_array(pbr.attenuation_color.map(|c| sigma(c) as f32)))
}

/// Indices of refraction by channel of a dispersive solid (KHR_materials_dispersion).
///
/// Cauchy's n(l) = A + B / l^2 has index `ior` at the d line (587.6 nm) and the Abbe number 20 / dispersion between the
/// F and C lines (486.1 and 656.3 nm). The channels stand for the wavelengths at which the primaries of
/// Rec.709 dominate: 611.4, 549.1 and 464.2 nm.
fn dispersion(pbr: &PbrMaterial) -> Option<[f32; 3]> {
    if pbr.transmission.factor <= 0.0 || pbr.dispersion <= 0.0 || pbr.ior <= 0.0 {
        return None;
    }
    let inverse_square = |nm: f64| 1e6 / (nm * nm);
    let spread = (f64::from(pbr.ior) - 1.0) * f64::from(pbr.dispersion) / 20.0;
    let b = spread / (inverse_square(486.1) - inverse_square(656.3));
    let at = |nm: f64| f64::from(pbr.ior) + b * (inverse_square(nm) - inverse_square(587.6));
    Some([611.4, 549.1, 464.2].map(|nm| at(nm).max(1.0) as f32))
}
