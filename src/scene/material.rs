//! Materials as the user described them; `compile` turns each into the cheapest equivalent BSDF.

use super::TextureId;

/// A colour: a constant, or a texture times the constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorSlot {
    /// Constant factor, linear RGB.
    pub factor: [f32; 3],
    /// Texture whose RGB is multiplied by it.
    pub texture: Option<TextureId>,
}

impl ColorSlot {
    /// A constant.
    pub const fn constant(rgb: [f32; 3]) -> ColorSlot {
        ColorSlot { factor: rgb, texture: None }
    }

    /// A texture as it is.
    pub const fn texture(id: TextureId) -> ColorSlot {
        ColorSlot { factor: [1.0; 3], texture: Some(id) }
    }
}

/// A number: a constant, or one channel of a texture times the constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloatSlot {
    /// Constant factor.
    pub factor: f32,
    /// Texture and which of its channels (0 red .. 3 alpha).
    pub texture: Option<(TextureId, u8)>,
}

impl FloatSlot {
    /// A constant.
    pub const fn constant(value: f32) -> FloatSlot {
        FloatSlot { factor: value, texture: None }
    }
}

/// Which Fresnel term a dielectric uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FresnelModel {
    /// The Fresnel equations.
    #[default]
    Exact,
    /// Schlick's approximation, as in the thesis and in the glTF specification.
    Schlick,
}

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq)]
pub enum Model {
    /// Absorbs everything (pure emitters).
    Black,
    /// Ideal diffuse reflection.
    Lambert {
        /// Share of light reflected, 0..1.
        albedo: ColorSlot,
    },
    /// A metal: GGX microfacets with Schlick's Fresnel term.
    SchlickMetal {
        /// Reflectance at normal incidence.
        color: ColorSlot,
        /// Perceptual roughness 0..1; the GGX alpha is its square. The thesis's fuzz maps to the roughness of
        /// the same mean deviation (see the scene-file loader).
        roughness: FloatSlot,
    },
    /// A smooth solid dielectric: reflects and refracts.
    Dielectric {
        /// Index of refraction relative to the outside, at least 1.
        ior: f32,
        /// Factor on transmitted light at each crossing; white for clear glass.
        tint: ColorSlot,
        /// Fresnel term.
        fresnel: FresnelModel,
    },
    /// Rough diffuse reflection (energy-preserving Oren-Nayar).
    OrenNayar {
        /// Share of light reflected by each facet, 0..1.
        color: ColorSlot,
        /// 0 is Lambert's law, 1 the roughest.
        roughness: FloatSlot,
    },
    /// The modified Phong model: diffuse reflection and a cosine lobe around the mirror direction.
    Phong {
        /// Diffuse share 0..1.
        diffuse: ColorSlot,
        /// Specular share 0..1; where both add up to more than 1, both are scaled down.
        specular: ColorSlot,
        /// Exponent of the cosine, from 0.
        exponent: f32,
    },
    /// A metal of a measured complex index of refraction.
    Conductor {
        /// Real part by channel.
        eta: [f32; 3],
        /// Extinction coefficient by channel.
        k: [f32; 3],
        /// Perceptual roughness 0..1.
        roughness: FloatSlot,
    },
    /// Glass of any roughness.
    Glass {
        /// Index of refraction relative to the outside, at least 1.
        ior: f32,
        /// Factor on transmitted light at each crossing; white for clear glass.
        tint: ColorSlot,
        /// Perceptual roughness 0..1.
        roughness: FloatSlot,
        /// A thin sheet instead of a solid.
        is_thin: bool,
    },
    /// The glTF 2.0 material.
    Pbr(Box<PbrMaterial>),
}

/// The glTF 2.0 material with its extensions, as the file says.
#[derive(Clone, Debug, PartialEq)]
pub struct PbrMaterial {
    /// Base colour.
    pub base_color: ColorSlot,
    /// Metalness 0..1.
    pub metallic: FloatSlot,
    /// Perceptual roughness 0..1.
    pub roughness: FloatSlot,
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

/// All places of a glTF material where textures may stand.
#[derive(Debug)]
pub struct SlotsMut<'a> {
    /// Slots of colours.
    pub colors: Vec<&'a mut ColorSlot>,
    /// Slots of numbers.
    pub numbers: Vec<&'a mut FloatSlot>,
    /// Textures in no slot.
    pub others: Vec<&'a mut TextureId>,
}

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
            ior: 1.5,
            specular: FloatSlot::constant(1.0),
            specular_color: ColorSlot::constant([1.0; 3]),
            transmission: FloatSlot::constant(0.0),
            has_volume: false,
            tints_once: false,
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

impl PbrMaterial {
    /// All its slots of colours.
    pub fn color_slots(&self) -> impl Iterator<Item = &ColorSlot> {
        let sheen = self.sheen.as_ref().map(|s| &s.color);
        let through = self.diffuse_transmission.as_ref().map(|d| &d.color);
        [&self.base_color, &self.specular_color].into_iter().chain(sheen).chain(through)
    }

    /// All its slots of numbers.
    pub fn float_slots(&self) -> impl Iterator<Item = &FloatSlot> {
        [&self.metallic, &self.roughness, &self.specular, &self.transmission]
            .into_iter()
            .chain(self.clearcoat.iter().flat_map(|c| [&c.factor, &c.roughness]))
            .chain(self.sheen.as_ref().map(|s| &s.roughness))
            .chain(self.iridescence.as_ref().map(|i| &i.factor))
            .chain(self.diffuse_transmission.as_ref().map(|d| &d.factor))
    }

    /// Everything that may refer to a texture, to change it.
    pub fn slots_mut(&mut self) -> SlotsMut<'_> {
        let mut colors = vec![&mut self.base_color, &mut self.specular_color];
        let mut numbers =
            vec![&mut self.metallic, &mut self.roughness, &mut self.specular, &mut self.transmission];
        let mut others = Vec::new();
        if let Some(coat) = &mut self.clearcoat {
            numbers.extend([&mut coat.factor, &mut coat.roughness]);
            others.extend(coat.normal_map.as_mut().map(|n| &mut n.texture));
        }
        if let Some(sheen) = &mut self.sheen {
            colors.push(&mut sheen.color);
            numbers.push(&mut sheen.roughness);
        }
        if let Some(anisotropy) = &mut self.anisotropy {
            others.extend(anisotropy.texture.as_mut());
        }
        if let Some(film) = &mut self.iridescence {
            numbers.push(&mut film.factor);
            others.extend(film.thickness_texture.as_mut().map(|(id, _)| id));
        }
        if let Some(through) = &mut self.diffuse_transmission {
            colors.push(&mut through.color);
            numbers.push(&mut through.factor);
        }
        SlotsMut { colors, numbers, others }
    }

    /// Its textures that stand in no slot of a colour or number.
    pub fn other_textures(&self) -> impl Iterator<Item = TextureId> {
        let coat = self.clearcoat.and_then(|c| c.normal_map).map(|n| n.texture);
        let film = self.iridescence.and_then(|i| i.thickness_texture).map(|(id, _)| id);
        coat.into_iter().chain(self.anisotropy.and_then(|a| a.texture)).chain(film)
    }
}

/// Emitted radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Radiance: factor and optional texture.
    pub radiance: ColorSlot,
    /// Emits from the back as well.
    pub two_sided: bool,
}

/// A tangent-space normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// RGB holds the normal as (n + 1) / 2, linear.
    pub texture: TextureId,
    /// Factor on its x and y.
    pub scale: f32,
}

/// What happens where alpha is below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Present where alpha is at least the cutoff, absent elsewhere.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// Present with probability alpha.
    Blend,
}

/// A material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// For reports and overrides.
    pub name: String,
    /// How it scatters.
    pub model: Model,
    /// What it emits.
    pub emission: Option<Emission>,
    /// False: the back of the surface is black, but still stops light. Transmissive materials scatter on both sides
    /// whatever this says, and whether the back emits is decided by [`Emission::two_sided`] alone.
    pub double_sided: bool,
    /// What alpha does.
    pub alpha_mode: AlphaMode,
    /// Opacity, used unless the mode is opaque.
    pub alpha: FloatSlot,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
    /// Vertex colours multiply the base colour.
    pub use_vertex_colors: bool,
}

impl Material {
    /// A double-sided material without emission.
    pub fn new(name: impl Into<String>, model: Model) -> Material {
        Material {
            name: name.into(),
            model,
            emission: None,
            double_sided: true,
            alpha_mode: AlphaMode::Opaque,
            alpha: FloatSlot::constant(1.0),
            normal_map: None,
            use_vertex_colors: false,
        }
    }

    /// Ideal diffuse reflection of a constant albedo.
    pub fn lambert(name: impl Into<String>, albedo: [f32; 3]) -> Material {
        Material::new(name, Model::Lambert { albedo: ColorSlot::constant(albedo) })
    }

    /// A black emitter of constant radiance.
    pub fn emitter(name: impl Into<String>, radiance: [f32; 3], two_sided: bool) -> Material {
        let emission = Some(Emission { radiance: ColorSlot::constant(radiance), two_sided });
        Material { emission, double_sided: two_sided, ..Material::new(name, Model::Black) }
    }
}
