//! Materials: every parameter that the visitor shows, and what it doesn't.

use super::findings::{Findings, Place};
use super::lights::check_aim;
use super::media::check_medium;
use crate::scene::{
    AlphaMode, Beam, ColorSlot, FloatSlot, Material, Medium, Model, Parameter, PbrMaterial, Scene, TextureId,
    coefficients,
};

use std::f64::consts::{FRAC_PI_2, PI};

const FINITE: &str = "a finite number";
const FROM_ZERO: &str = "a finite number from 0 up";
/// Larger indices of metals, whose fourth powers Fresnel's equations take, mean nothing.
const MOST_INDEX: f32 = 1e4;
const INDEX: &str = "numbers from 0 to 10,000";
const CHANNEL: &str = "a channel from 0 to 3";

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    for (index, material) in scene.materials.iter().enumerate() {
        let place = Place { list: "materials", index, name: &material.name };
        material.parameters(&mut |field, parameter| {
            check_parameter(field, parameter, scene.textures.len(), place, findings);
        });
        check_alpha(material, place, findings);
        check_model(&material.model, place, findings);
        if let Some(medium) = &material.medium {
            check_medium(medium, &scene.grids, place, findings);
            check_attenuation(medium, &material.model, place, findings);
        }
        let heights = material.displacement.map(|displacement| displacement.texture);
        check_channel(&heights, "displacement", place, findings);
        check_beam(material.lamp.map(|lamp| lamp.beam), scene.profiles.len(), place, findings);
    }
}

/// A grid makes a medium thinner and thicker for all channels alike: what a solid absorbs everywhere has no place there.
fn check_attenuation(medium: &Medium, model: &Model, place: Place, findings: &mut Findings) {
    let Some(pbr) = model.pbr().filter(|pbr| pbr.has_volume && medium.grid.is_some()) else { return };
    let is_met = coefficients(pbr.attenuation_color, pbr.attenuation_distance).is_none();
    let rule = "infinite where the medium has a grid: give the medium a 'color' instead";
    findings.require(is_met, place, "attenuation_distance", pbr.attenuation_distance, rule);
}

/// The peak of narrower beams has no place among single-precision numbers.
const LEAST_BEAM_RAD: f64 = 1e-4;

fn check_beam(beam: Option<Beam>, profiles: usize, place: Place, findings: &mut Findings) {
    match beam {
        None | Some(Beam::Even) => {}
        Some(Beam::Grid { half_angle_rad: half }) => {
            let is_met = (LEAST_BEAM_RAD..FRAC_PI_2).contains(&half);
            findings.require(is_met, place, "half_angle_rad", half, "from 1e-4 to below pi / 2");
        }
        Some(Beam::Cone { direction, inner_angle_rad: inner, outer_angle_rad: outer, .. }) => {
            let is_met = direction.try_normalize().is_some();
            findings.require(is_met, place, "direction", direction, "a finite vector of a length above 0");
            let is_cone = outer > 0.0 && outer <= PI;
            findings.require(is_cone, place, "outer_angle_rad", outer, "above 0 and at most pi");
            let is_inside = (0.0..=if is_cone { outer } else { PI }).contains(&inner);
            findings.require(is_inside, place, "inner_angle_rad", inner, "from 0 to the outer angle");
        }
        Some(Beam::Profile { profile, rotation, cone }) => {
            let is_met = profile.index() < profiles;
            findings.require(is_met, place, "profile", profile, "one of the scene's profiles");
            check_aim(rotation, cone, place, findings);
        }
    }
}

fn check_parameter(
    field: &'static str,
    parameter: Parameter<'_>,
    textures: usize,
    place: Place,
    findings: &mut Findings,
) {
    if let Some(id) = parameter.texture() {
        let is_met = id.index() < textures;
        findings.require(is_met, place, field, id, "one of the scene's textures");
    }
    match parameter {
        Parameter::Color(ColorSlot { factor, .. }) => {
            findings.require_color(factor, place, field);
        }
        Parameter::Number(FloatSlot { factor, texture }) => {
            findings.require(factor.is_finite(), place, field, factor, FINITE);
            check_channel(texture, field, place, findings);
        }
        Parameter::Constant(&x) => {
            let (is_met, allowed) = match field {
                "attenuation_distance" => (x > 0.0, "above 0, or infinite"),
                "rotation_rad" | "tilt_rad" | "scale" | "midlevel" => (x.is_finite(), FINITE),
                _ => (x.is_finite() && x >= 0.0, FROM_ZERO),
            };
            findings.require(is_met, place, field, x, allowed);
        }
        Parameter::Texture(_) => {}
    }
}

fn check_channel(
    texture: &Option<(TextureId, u8)>,
    field: &'static str,
    place: Place,
    findings: &mut Findings,
) {
    if let Some((_, channel)) = *texture {
        findings.require(channel < 4, place, field, channel, CHANNEL);
    }
}

fn check_alpha(material: &Material, place: Place, findings: &mut Findings) {
    if let AlphaMode::Mask { cutoff } = material.alpha_mode {
        findings.require(!cutoff.is_nan(), place, "cutoff", cutoff, "a number");
    }
}

/// What is no parameter, or has limits of its own. Other models need nothing here: every parameter was visited.
fn check_model(model: &Model, place: Place, findings: &mut Findings) {
    match model {
        Model::Conductor { eta, k, .. } => {
            let is_index = |rgb: &[f32; 3]| rgb.iter().all(|c| (0.0..=MOST_INDEX).contains(c));
            findings.require(is_index(eta), place, "eta", eta, INDEX);
            findings.require(is_index(k), place, "k", k, INDEX);
        }
        Model::Dielectric { ior, .. } | Model::Glass { ior, .. } => {
            findings.require(*ior != 0.0, place, "ior", ior, "a finite number above 0");
        }
        Model::Hair { ior, .. } => {
            findings.require(*ior >= 1.0, place, "ior", ior, "a finite number from 1 up")
        }
        Model::Pbr(pbr) => check_pbr(pbr, place, findings),
        _ => {}
    }
}

fn check_pbr(pbr: &PbrMaterial, place: Place, findings: &mut Findings) {
    findings.require_color(&pbr.attenuation_color, place, "attenuation_color");
    let is_index = !(pbr.ior > 0.0 && pbr.ior < 1.0);
    findings.require(is_index, place, "ior", pbr.ior, "0, or a finite number from 1 up");
    if let Some(film) = &pbr.iridescence {
        check_channel(&film.thickness_texture, "thickness_texture", place, findings);
    }
}
