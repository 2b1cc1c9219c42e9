//! `type = "pbr"`: the glTF material in a scene file.
//!
//! | Key | Default | Meaning |
//! |---|---|---|
//! | `base_color` | 1 | colour of the diffuse base, of metal and of transmitted light |
//! | `metallic` | 0 | 0 to 1 |
//! | `roughness` | 1 | 0 to 1 |
//! | `ior` | 1.5 | index of refraction, 1 to 10 |
//! | `specular`, `specular_color` | 1 | factors on the dielectric's reflection |
//! | `transmission` | 0 | share of light that passes |
//! | `volume` | false | the surface bounds a solid; otherwise it is a thin sheet |
//! | `attenuation_color`, `attenuation_distance` | 1, none | colour of white light after so many metres in the solid |
//! | `dispersion` | 0 | 20 / Abbe number of the solid |
//! | `clearcoat`, `clearcoat_roughness` | 0 | a clear layer on top, 0 to 1 |
//! | `sheen_color`, `sheen_roughness` | 0 | fibres on top |
//! | `anisotropy`, `anisotropy_rotation` | 0 | stretched highlights, 0 to 1; degrees from the tangent |
//! | `iridescence` | 0 | strength of a thin film |
//! | `iridescence_ior`, `iridescence_thickness` | 1.3, 400 | the film's index of refraction and its thickness in nanometres |
//! | `diffuse_transmission`, `diffuse_transmission_color` | 0, 1 | share and colour of diffuse light that passes |
//! | `emission` | none | radiance |
//! | `two_sided` | true | the back scatters (and shines) as the front does; false: seen from behind the surface is not there |

use super::fields::Fields;
use crate::scene::{
    Anisotropy, Clearcoat, ColorSlot, DiffuseTransmission, Emission, FloatSlot, Iridescence, Material, Model,
    PbrMaterial, Sheen,
};

/// Reads the material; `slot` reads a colour or the name of a texture, with a default.
pub(super) fn material(
    fields: &Fields,
    name: &str,
    mut slot: impl FnMut(&'static str, f32) -> ColorSlot,
) -> Material {
    let mut model = PbrMaterial {
        base_color: slot("base_color", 1.0),
        metallic: share(fields, "metallic", 0.0),
        roughness: share(fields, "roughness", 1.0),
        ior: fields.number_in("ior", 1.0..10.0, 1.5) as f32,
        specular: share(fields, "specular", 1.0),
        specular_color: slot("specular_color", 1.0),
        transmission: share(fields, "transmission", 0.0),
        ..PbrMaterial::default()
    };
    check_layers(fields);
    volume(fields, &mut model);
    layers(fields, &mut model, &mut slot);
    let two_sided = fields.flag("two_sided", true);
    let emission = fields.has("emission").then(|| Emission { radiance: slot("emission", 0.0), two_sided });
    Material { emission, double_sided: two_sided, ..Material::new(name, Model::Pbr(Box::new(model))) }
}

fn share(fields: &Fields, key: &'static str, default: f64) -> FloatSlot {
    FloatSlot::constant(fields.number_in(key, 0.0..1.0, default) as f32)
}

fn volume(fields: &Fields, model: &mut PbrMaterial) {
    model.has_volume = fields.flag("volume", false);
    if let Some(color) = fields.color("attenuation_color") {
        if color.value.iter().any(|c| *c > 1.0) {
            fields.problems.push(color.span, "'attenuation_color' must be from 0 to 1: it can't add light");
        }
        model.attenuation_color = color.value.map(|c| c.min(1.0));
    }
    if fields.has("attenuation_distance") {
        let distance = fields.number_in("attenuation_distance", 1e-9..f64::INFINITY, 1.0);
        model.attenuation_distance = distance as f32;
    }
    model.dispersion = fields.number_in("dispersion", 0.0..100.0, 0.0) as f32;
    let inside = ["attenuation_color", "attenuation_distance", "dispersion"];
    if !model.has_volume && inside.iter().any(|key| fields.has(key)) {
        let message = "attenuation and dispersion need the inside of a solid: add 'volume = true'";
        fields.problems.push(fields.span(), message);
    }
}

/// Complains of keys that say how a layer is, without the one that says that it is there.
fn check_layers(fields: &Fields) {
    let needs: [(&'static str, &[&'static str]); 5] = [
        ("clearcoat", &["clearcoat_roughness"]),
        ("sheen_color", &["sheen_roughness"]),
        ("anisotropy", &["anisotropy_rotation"]),
        ("iridescence", &["iridescence_ior", "iridescence_thickness"]),
        ("diffuse_transmission", &["diffuse_transmission_color"]),
    ];
    for (layer, keys) in needs {
        for key in keys.iter().filter(|key| fields.has(key) && !fields.has(layer)) {
            fields.problems.push(fields.span(), format!("'{key}' does nothing without '{layer}'"));
        }
    }
}

fn layers(fields: &Fields, model: &mut PbrMaterial, slot: &mut impl FnMut(&'static str, f32) -> ColorSlot) {
    let coat = Clearcoat {
        factor: share(fields, "clearcoat", 0.0),
        roughness: share(fields, "clearcoat_roughness", 0.0),
        normal_map: None,
    };
    model.clearcoat = (coat.factor.factor > 0.0).then_some(coat);
    let sheen = Sheen { color: slot("sheen_color", 0.0), roughness: share(fields, "sheen_roughness", 0.0) };
    model.sheen = (sheen.color.factor != [0.0; 3]).then_some(sheen);
    let anisotropy = Anisotropy {
        strength: fields.number_in("anisotropy", 0.0..1.0, 0.0) as f32,
        rotation_rad: fields.number_in("anisotropy_rotation", -1e4..1e4, 0.0).to_radians() as f32,
        texture: None,
    };
    model.anisotropy = (anisotropy.strength > 0.0).then_some(anisotropy);
    let thickness_nm = fields.number_in("iridescence_thickness", 0.0..1e5, 400.0) as f32;
    let film = Iridescence {
        factor: share(fields, "iridescence", 0.0),
        ior: fields.number_in("iridescence_ior", 1.0..10.0, 1.3) as f32,
        thickness_min_nm: thickness_nm,
        thickness_max_nm: thickness_nm,
        thickness_texture: None,
    };
    model.iridescence = (film.factor.factor > 0.0).then_some(film);
    let through = DiffuseTransmission {
        factor: share(fields, "diffuse_transmission", 0.0),
        color: slot("diffuse_transmission_color", 1.0),
    };
    model.diffuse_transmission = (through.factor.factor > 0.0).then_some(through);
}
