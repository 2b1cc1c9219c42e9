//! The glTF 2.0 material with the layers that its extensions add.

use super::TextureId;
use super::slot::{ColorSlot, FloatSlot, NormalMap, Parameters, parameters_of_fields};

/// The glTF 2.0 material with its extensions, as the file says.
#[derive(Clone, Debug, PartialEq)]
pub struct PbrMaterial {
    /// Base colour.
    pub base_color: ColorSlot,
    /// Metalness 0..1.
    pub metallic: FloatSlot,
    /// Perceptual roughness 0..1.
    pub roughness: FloatSlot,
    /// Roughness 0..1 of the diffuse part by the model of Oren and Nayar (KHR_materials_diffuse_roughness); 0 is Lambert's
    /// law.
    pub diffuse_roughness: FloatSlot,
    /// Index of refraction (KHR_materials_ior); 1.5 by default, 0 means total reflection.
    pub ior: f32,
    /// Strength of the dielectric reflection (KHR_materials_specular).
    pub specular: FloatSlot,
    /// Its colour at normal incidence.
    pub specular_color: ColorSlot,
    /// Share of light that passes instead of scattering diffusely (KHR_materials_transmission).
    pub transmission: FloatSlot,
    /// Is there a volume behind the surface (KHR_materials_volume with thickness above 0)? Otherwise it is thin-walled.
    pub has_volume: bool,
    /// The base colour is what a solid lets pass from its front to its back, as Blender understands it: each crossing of
    /// its surface takes the square root. Otherwise it is the factor of each crossing (KHR_materials_transmission).
    pub tints_once: bool,
    /// Light that is refracted keeps its radiance, as in Cycles, where by physics that is divided by the square of the index
    /// towards the side of the viewer. A surface without a volume is then no thin wall, but one sheet that bends light by
    /// the sides of its normal, as the surface of a solid does, with nothing behind.
    pub keeps_radiance: bool,
    /// Colour of what the interface reflects where light may pass it.
    pub glass_reflection: GlassReflection,
    /// Colour of white light after `attenuation_distance` in the volume.
    pub attenuation_color: [f32; 3],
    /// Metres; infinite means no absorption.
    pub attenuation_distance: f32,
    /// Spread of the index of refraction over the spectrum, 20 / Abbe number (KHR_materials_dispersion); 0 is none.
    pub dispersion: f32,
    /// A clear layer on top; `None` where there is none.
    pub clearcoat: Option<Clearcoat>,
    /// Fibres on top; `None` where there are none.
    pub sheen: Option<Sheen>,
    /// Stretched highlights; `None` for the same roughness in all directions.
    pub anisotropy: Option<Anisotropy>,
    /// A thin film; `None` where there is none.
    pub iridescence: Option<Iridescence>,
    /// Light scattered through the surface; `None` where there is none.
    pub diffuse_transmission: Option<DiffuseTransmission>,
}

/// Colour of what glass reflects, total reflection included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GlassReflection {
    /// White, as physics has it.
    #[default]
    White,
    /// That of light that crosses the surface once, as of the Glass BSDF of Cycles.
    Tinted,
    /// Nothing is reflected, and all light passes that can, as of the Refraction BSDF of Cycles.
    None,
}

impl GlassReflection {
    /// All of them with their names in scene files.
    pub const ALL: [(&str, GlassReflection); 3] = [
        ("white", GlassReflection::White),
        ("tinted", GlassReflection::Tinted),
        ("none", GlassReflection::None),
    ];
}

impl Parameters for GlassReflection {}

/// A clear dielectric layer of index of refraction 1.5 on top of all others (KHR_materials_clearcoat).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat {
    /// Its strength 0..1, above 0 somewhere.
    pub factor: FloatSlot,
    /// Its perceptual roughness 0..1.
    pub roughness: FloatSlot,
    /// Its own normal map; without one it follows the geometry, not the base's map.
    pub normal_map: Option<NormalMap>,
}

/// Scattering by fibres, like velvet (KHR_materials_sheen).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// Its colour 0..1, above 0 somewhere.
    pub color: ColorSlot,
    /// Its perceptual roughness 0..1.
    pub roughness: FloatSlot,
}

/// Different roughness along two directions (KHR_materials_anisotropy): alpha along the direction is
/// mix(alpha, 1, strength^2), across it alpha.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anisotropy {
    /// Strength 0..1, above 0; times the texture's blue.
    pub strength: f32,
    /// Counter-clockwise from the tangent to the direction of the larger roughness, radians; added to the texture's.
    pub rotation_rad: f32,
    /// Direction in the tangent plane in red and green as (d + 1) / 2, strength in blue; linear.
    pub texture: Option<TextureId>,
}

/// A thin film that interferes with the light (KHR_materials_iridescence).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iridescence {
    /// Its strength 0..1, above 0 somewhere.
    pub factor: FloatSlot,
    /// The film's index of refraction, at least 1.
    pub ior: f32,
    /// Thickness in nanometres where the texture is 0.
    pub thickness_min_nm: f32,
    /// Thickness in nanometres where the texture is 1, and without a texture.
    pub thickness_max_nm: f32,
    /// Blends between the two; which of its channels.
    pub thickness_texture: Option<(TextureId, u8)>,
}

/// Diffuse light that leaves on the other side (KHR_materials_diffuse_transmission).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Share 0..1 of the diffuse light that passes, above 0 somewhere.
    pub factor: FloatSlot,
    /// Its colour, in place of the base colour.
    pub color: ColorSlot,
}

impl Default for PbrMaterial {
    fn default() -> PbrMaterial {
        PbrMaterial {
            base_color: ColorSlot::constant([1.0; 3]),
            metallic: FloatSlot::constant(1.0),
            roughness: FloatSlot::constant(1.0),
            diffuse_roughness: FloatSlot::constant(0.0),
            ior: 1.5,
            specular: FloatSlot::constant(1.0),
            specular_color: ColorSlot::constant([1.0; 3]),
            transmission: FloatSlot::constant(0.0),
            has_volume: false,
            tints_once: false,
            keeps_radiance: false,
            glass_reflection: GlassReflection::White,
            attenuation_color: [1.0; 3],
            attenuation_distance: f32::INFINITY,
            dispersion: 0.0,
            clearcoat: None,
            sheen: None,
            anisotropy: None,
            iridescence: None,
            diffuse_transmission: None,
        }
    }
}

parameters_of_fields! {
    PbrMaterial {
        base_color, metallic, roughness, diffuse_roughness, ior, specular, specular_color, transmission, has_volume,
        tints_once, keeps_radiance, glass_reflection, attenuation_color, attenuation_distance, dispersion, clearcoat, sheen, anisotropy,
        iridescence, diffuse_transmission,
    }
    Clearcoat { factor, roughness, normal_map }
    Sheen { color, roughness }
    Anisotropy { strength, rotation_rad, texture }
    Iridescence { factor, ior, thickness_min_nm, thickness_max_nm, thickness_texture }
    DiffuseTransmission { factor, color }
}
