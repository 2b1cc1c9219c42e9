//! `type = "pbr"`: the glTF material in a scene file.
//!
//! | Key | Default | Meaning |
//! |---|---|---|
//! | `base_color` | 1 | colour of the diffuse base, of metals and of transmitted light |
//! | `metallic` | 0 | 0 to 1, or the red channel of a texture |
//! | `roughness` | 1 | 0 to 1, or the red channel of a texture |
//! | `diffuse_roughness` | 0 | roughness of the diffuse base (Oren-Nayar), 0 to 1; 0 is Lambert's law |
//! | `ior` | 1.5 | index of refraction, 0.1 to 10 |
//! | `specular`, `specular_color` | 1 | factors on the dielectric reflection; both may be textures |
//! | `transmission` | 0 | fraction of specular transmission, 0 to 1, or a texture |
//! | `opacity` | 1 | coverage (alpha), 0 to 1, or a texture |
//! | `volume` | false | the surface bounds a solid; otherwise it is a thin sheet |
//! | `keeps_radiance` | false | refraction doesn't scale radiance, as in Blender's Cycles; physically it is divided by the squared relative index. Media without a surface continue within the solid, unless its `priority` is higher. Without `volume` the surface is an open sheet that refracts like the boundary of a solid, with the inside behind its normal |
//! | `glass_reflection` | "white" | colour of reflections of transmissive surfaces: `"white"`, `"tinted"` (as light transmitted once, as in Blender's Glass node) or `"none"` (no reflection, and full transmission, as in Blender's Refraction node) |
//! | `attenuation_color`, `attenuation_distance` | 1, none | colour of white light after this distance in the solid, metres |
//! | `medium` | none | the medium inside a transmissive solid, see `media` |
//! | `subsurface` | none | subsurface scattering instead of the diffuse base, for wax, skin, marble: `{ color, radius, scale, anisotropy }`, see `media` |
//! | `dispersion` | 0 | 20 / Abbe number of the solid |
//! | `clearcoat`, `clearcoat_roughness` | 0 | a clear layer on top, 0 to 1 |
//! | `sheen_color`, `sheen_roughness` | 0 | a layer of fibres on top |
//! | `anisotropy`, `anisotropy_rotation` | 0 | strength of anisotropic reflection, 0 to 1; degrees from the tangent |
//! | `iridescence` | 0 | strength of a thin film, 0 to 1 |
//! | `iridescence_ior`, `iridescence_thickness` | 1.3, 400 | the film's index of refraction and its thickness in nanometres |
//! | `diffuse_transmission`, `diffuse_transmission_color` | 0, 1 | fraction and colour of diffuse transmission |
//! | `emission` | none | emitted radiance, W/sr/m2 |
//! | `two_sided` | true | the back scatters (and emits) like the front; false: back faces are culled |

use super::builder::SceneFileBuilder;
use super::fields::Fields;
use super::media;
use super::textures::Textures;
use crate::load::gltf::Glass;
use crate::scene::{
    AlphaMode, Anisotropy, Clearcoat, ColorSlot, DiffuseTransmission, Emission, FloatSlot, GlassReflection,
    Iridescence, Material, Medium, Model, PbrMaterial, Sheen,
};

/// Reads material parameters: colours, numbers and names of textures, with defaults.
pub(super) struct Slots<'s, 'a, 'b> {
    pub build: &'s mut SceneFileBuilder<'b>,
    pub textures: &'s mut Textures<'a>,
    pub fields: &'s Fields<'a>,
    /// The defaults are the parameters of a model's material, which textures may refer to.
    pub adjusts_model: bool,
}

impl Slots<'_, '_, '_> {
    fn color(&mut self, key: &'static str, default: ColorSlot) -> ColorSlot {
        match self.adjusts_model {
            true => self.textures.adjust_color(self.build, self.fields, key, default),
            false => self.textures.slot(self.build, self.fields, key).unwrap_or(default),
        }
    }

    /// A number from 0 to 1, or the red channel of a texture.
    fn number(&mut self, key: &'static str, default: FloatSlot) -> FloatSlot {
        self.number_or(key, default, default)
    }

    /// As `number`; textures may refer to `model_value`, the model's parameter.
    fn number_or(&mut self, key: &'static str, default: FloatSlot, model_value: FloatSlot) -> FloatSlot {
        if self.fields.raw(key).is_none_or(|value| value.get_ref().as_str().is_none()) {
            return fraction(self.fields, key, default);
        }
        let found = match self.adjusts_model {
            true => self.textures.adjust_number(self.build, self.fields, key, model_value),
            false => {
                let texture = self.textures.slot(self.build, self.fields, key).and_then(|slot| slot.texture);
                texture.map(|id| FloatSlot::texture(id, 0))
            }
        };
        found.unwrap_or(default)
    }
}

/// Reads the material.
pub(super) fn material(name: &str, medium: Option<Medium>, slots: &mut Slots) -> Material {
    let metallic = FloatSlot::constant(0.0);
    let model = PbrMaterial { metallic, ..PbrMaterial::default() };
    check_layers(slots.fields);
    let (mut model, mut material) = (model, Material::new(name, Model::Black));
    adjust((&mut material, &mut model), medium, slots);
    Material { model: Model::Pbr(Box::new(model)), ..material }
}

/// Changes the parameters of a glTF material for which there are keys.
pub(super) fn adjust(
    (material, model): (&mut Material, &mut PbrMaterial),
    medium: Option<Medium>,
    slots: &mut Slots,
) {
    let fields = slots.fields;
    let alpha = alpha_of(material, model);
    model.base_color = slots.color("base_color", model.base_color);
    model.metallic = slots.number("metallic", model.metallic);
    model.roughness = slots.number("roughness", model.roughness);
    model.diffuse_roughness = fraction(fields, "diffuse_roughness", model.diffuse_roughness);
    model.ior = fields.number_in("ior", 0.1..10.0, model.ior.into()) as f32;
    model.specular = slots.number("specular", model.specular);
    model.specular_color = slots.color("specular_color", model.specular_color);
    model.transmission = slots.number("transmission", model.transmission);
    if let Some(reflection) = fields.choice("glass_reflection", &GlassReflection::NAMED) {
        model.glass_reflection = reflection;
    }
    if fields.has("opacity") {
        material.alpha = slots.number_or("opacity", FloatSlot::constant(1.0), alpha);
        material.alpha_mode = AlphaMode::Blend;
    }
    read_volume(slots, model);
    read_layers(model, slots);
    set_medium(fields, material, model, medium);
    material.double_sided = fields.flag("two_sided", material.double_sided);
    let two_sided = material.double_sided;
    if let Some(emission) = &mut material.emission {
        emission.two_sided = two_sided;
    }
    if fields.has("emission") {
        let default = material.emission.as_ref().map_or(ColorSlot::constant([0.0; 3]), |e| e.radiance);
        let radiance = slots.color("emission", default);
        material.emission = Some(Emission { radiance, two_sided });
    }
}

/// A number from 0 to 1.
fn fraction(fields: &Fields, key: &'static str, default: FloatSlot) -> FloatSlot {
    match fields.has(key) {
        true => FloatSlot::constant(fields.number_in(key, 0.0..1.0, default.factor.into()) as f32),
        false => default,
    }
}

/// The alpha of a material; for opaque ones the alpha of the base colour.
pub(super) fn alpha_of(material: &Material, model: &PbrMaterial) -> FloatSlot {
    match material.alpha_mode {
        AlphaMode::Opaque => {
            let texture = model.base_color.texture.map(|texture| (texture, 3));
            FloatSlot { factor: 1.0, texture }
        }
        _ => material.alpha,
    }
}

fn read_volume(slots: &Slots, model: &mut PbrMaterial) {
    let fields = slots.fields;
    model.has_volume = fields.flag("volume", model.has_volume);
    read_keeps_radiance(slots, model);
    if let Some(color) = fields.color("attenuation_color") {
        if color.value.iter().any(|c| *c > 1.0) {
            fields.problems.push(color.span, "'attenuation_color' must be from 0 to 1");
        }
        model.attenuation_color = color.value.map(|c| c.min(1.0));
    }
    if fields.has("attenuation_distance") {
        let distance = fields.number_in("attenuation_distance", 1e-9..f64::INFINITY, 1.0);
        model.attenuation_distance = distance as f32;
    }
    model.dispersion = fields.number_in("dispersion", 0.0..100.0, model.dispersion.into()) as f32;
    let volume_keys = ["attenuation_color", "attenuation_distance", "dispersion"];
    if !model.has_volume && volume_keys.iter().any(|key| fields.has(key)) {
        fields.report("attenuation and dispersion need a solid: add 'volume = true'");
    }
}

/// Reads `keeps_radiance`, which also makes surfaces without a volume refract, unless the user wants the thin sheets of a
/// model.
fn read_keeps_radiance(slots: &Slots, model: &mut PbrMaterial) {
    let fields = slots.fields;
    let refracts = fields.flag("keeps_radiance", model.keeps_radiance);
    let wants_thin =
        slots.adjusts_model && matches!(slots.build.options.gltf.glass, Glass::Panes | Glass::Thin);
    model.keeps_radiance = refracts && (model.has_volume || !wants_thin);
    if refracts && !model.keeps_radiance && fields.has("volume") {
        // Blender's glass tints by the square root of its colour at each interface.
        model.base_color.factor = model.base_color.factor.map(f32::sqrt);
    }
    // Thin sheets apply their whole colour.
    model.tints_once &= model.has_volume || model.keeps_radiance;
}

/// Sets the medium inside the solid: `medium`, or that of `subsurface`.
fn set_medium(fields: &Fields, material: &mut Material, model: &mut PbrMaterial, medium: Option<Medium>) {
    if let Some(medium) = medium {
        if !model.has_volume {
            fields.report("a 'medium' needs a solid: add 'volume = true'");
        } else if !is_transmissive(model) {
            let span = fields.raw("medium").map_or(fields.span(), |value| value.span());
            let message = ("medium-unreachable", "no light reaches this 'medium': the surface is opaque");
            let help =
                "add 'transmission' or 'diffuse_transmission', or use 'subsurface' instead of 'medium'";
            fields.problems.push_help(span, message, help);
        }
        material.medium = Some(medium);
    }
    if let Some(medium) = media::subsurface(fields, model) {
        material.medium = Some(medium);
    }
}

/// Whether the surface transmits light, specularly or diffusely.
fn is_transmissive(model: &PbrMaterial) -> bool {
    model.diffuse_transmission.is_some() || model.transmission.factor > 0.0
}

/// Reports keys of layers without the key that enables the layer.
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
            fields.report(format!("'{key}' has no effect without '{layer}'"));
        }
    }
}

fn read_layers(model: &mut PbrMaterial, slots: &mut Slots) {
    let fields = slots.fields;
    const NONE: FloatSlot = FloatSlot::constant(0.0);
    let coat = model.clearcoat.unwrap_or(Clearcoat { factor: NONE, roughness: NONE, normal_map: None });
    let factor = fraction(fields, "clearcoat", coat.factor);
    let coat =
        Clearcoat { factor, roughness: fraction(fields, "clearcoat_roughness", coat.roughness), ..coat };
    model.clearcoat = (coat.factor.factor > 0.0).then_some(coat);
    let sheen = model.sheen.unwrap_or(Sheen { color: ColorSlot::constant([0.0; 3]), roughness: NONE });
    let color = slots.color("sheen_color", sheen.color);
    let sheen = Sheen { color, roughness: fraction(fields, "sheen_roughness", sheen.roughness) };
    model.sheen = (sheen.color.factor != [0.0; 3]).then_some(sheen);
    let anisotropy =
        model.anisotropy.unwrap_or(Anisotropy { strength: 0.0, rotation_rad: 0.0, texture: None });
    let degrees = f64::from(anisotropy.rotation_rad).to_degrees();
    let anisotropy = Anisotropy {
        strength: fields.number_in("anisotropy", 0.0..1.0, anisotropy.strength.into()) as f32,
        rotation_rad: fields.number_in("anisotropy_rotation", -1e4..1e4, degrees).to_radians() as f32,
        ..anisotropy
    };
    model.anisotropy = (anisotropy.strength > 0.0).then_some(anisotropy);
    read_thin_film(fields, model);
    let white = ColorSlot::constant([1.0; 3]);
    let none = DiffuseTransmission { factor: NONE, color: white, subsurface: None };
    let transmission = model.diffuse_transmission.unwrap_or(none);
    let factor = fraction(fields, "diffuse_transmission", transmission.factor);
    let color = slots.color("diffuse_transmission_color", transmission.color);
    let transmission = DiffuseTransmission { factor, color, ..transmission };
    model.diffuse_transmission = (transmission.factor.factor > 0.0).then_some(transmission);
}

fn read_thin_film(fields: &Fields, model: &mut PbrMaterial) {
    let film = model.iridescence.unwrap_or(Iridescence {
        factor: FloatSlot::constant(0.0),
        ior: 1.3,
        thickness_min_nm: 400.0,
        thickness_max_nm: 400.0,
        thickness_texture: None,
    });
    let mut film = Iridescence {
        factor: fraction(fields, "iridescence", film.factor),
        ior: fields.number_in("iridescence_ior", 1.0..10.0, film.ior.into()) as f32,
        ..film
    };
    if fields.has("iridescence_thickness") {
        let thickness_nm = fields.number_in("iridescence_thickness", 0.0..1e5, 400.0) as f32;
        (film.thickness_min_nm, film.thickness_max_nm) = (thickness_nm, thickness_nm);
        film.thickness_texture = None;
    }
    model.iridescence = (film.factor.factor > 0.0).then_some(film);
}
