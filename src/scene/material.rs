//! Materials of the scene description; `compile` turns each into the cheapest equivalent BSDF. The macro `models` defines all
//! scattering models, from which scene-file readers, reports and the visitor over parameters are generated.

use super::light::SpotFalloff;
use super::medium::Medium;
use super::object_traits::RayKinds;
use super::slot::{
    ColorSlot, FloatSlot, NormalMap, Parameter, ParameterMut, Parameters, parameters_of_fields,
};
use super::{ProfileId, TextureId};
use crate::color::spectral::Metal;
use crate::math::{DQuat, DVec3, poly};

/// Emitted radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Radiance: factor and optional texture.
    pub radiance: ColorSlot,
    /// Emits from both sides. Otherwise the back emits nothing; it exists only if [`Material::double_sided`] is set.
    pub two_sided: bool,
}

/// Alpha mode (glTF).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Opaque where alpha is at least the cutoff, fully transparent elsewhere.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// Opaque with probability alpha (stochastic transparency).
    Blend,
}

/// Special properties of an emissive surface: ray visibility, whether it blocks rays (Blender's lights don't), and beam shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterTraits {
    /// Ray kinds that the surface is visible to; others pass through it and receive no light from it.
    pub visible_to: RayKinds,
    /// Blocks rays. Otherwise rays that hit it add its emission and continue.
    pub is_obstacle: bool,
    /// Angular distribution of its emission.
    pub beam: Beam,
}

impl Default for EmitterTraits {
    /// An ordinary surface.
    fn default() -> EmitterTraits {
        EmitterTraits { visible_to: RayKinds::ALL, is_obstacle: true, beam: Beam::Lambertian }
    }
}

/// Angular distribution of the radiance of an emissive surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Beam {
    /// Equal radiance in all directions.
    #[default]
    Lambertian,
    /// A grid in front of the light, as on a soft box: the radiance decreases linearly with the tangent of the angle to the surface
    /// normal, to 0 at the half angle. Its peak is scaled such that the power is unchanged.
    Grid {
        /// Half angle of the beam, radians, from 1e-4 to below pi / 2.
        half_angle_rad: f64,
    },
    /// A cone about an axis, as that of [`LightKind::Spot`](super::LightKind::Spot).
    Cone {
        /// Unit axis in world space.
        direction: DVec3,
        /// Half angle up to which the radiance is constant, radians.
        inner_angle_rad: f64,
        /// Half angle from which on it is 0, radians.
        outer_angle_rad: f64,
        /// Falloff in between.
        falloff: SpotFalloff,
    },
    /// A measured profile; the emission's radiance is that in the direction of its maximum.
    Profile {
        /// The profile, normalised to a maximum of 1.
        profile: ProfileId,
        /// Rotation from profile to world space: vertical angle 0 is -z, horizontal angles are measured from x towards y.
        rotation: DQuat,
        /// Inner and outer half angle (radians) of an additional cone with smoothstep falloff.
        cone: Option<[f64; 2]>,
    },
}

/// Displacement of meshes while a file is loaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Texture and its channel, which vectors ignore.
    pub texture: (TextureId, u8),
    /// Meaning of the texture.
    pub kind: DisplacementKind,
}

/// How a texture displaces vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DisplacementKind {
    /// By heights along the normals; the mesh is subdivided first.
    Heights {
        /// Distance between the heights 0 and 1 in mesh units.
        scale: f32,
        /// Height of zero displacement.
        midlevel: f32,
        /// Maximum edge length of the subdivided triangles in mesh units; 0 is 1/256 of the diagonal of the mesh's bounding box.
        edge: f32,
    },
    /// By the vectors of a node graph, world space, metres.
    Vectors {
        /// Keep the normals of the undisplaced surface.
        keeps_normals: bool,
    },
}

/// A material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// For reports and overrides.
    pub name: String,
    /// Scattering model.
    pub model: Model,
    /// Emission.
    pub emission: Option<Emission>,
    /// If false, back faces are culled (glTF 2.0, section 3.9.5): invisible to camera paths, including their shadow rays, that
    /// arrive from behind. Ignored for transmissive materials.
    pub double_sided: bool,
    /// Alpha mode.
    pub alpha_mode: AlphaMode,
    /// Opacity, used unless the mode is opaque.
    pub alpha: FloatSlot,
    /// Colour factor on light through the transparent parts (1 - alpha), from 0; white for cutouts.
    pub transparent_color: ColorSlot,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
    /// Node graph of the shading normal in world space, on the viewer's side; replaces a normal map.
    pub normal: Option<TextureId>,
    /// Node graph of the normal with only the bumps of a displacement, without those of `normal`.
    pub bumped_normal: Option<TextureId>,
    /// Vertex colours multiply the base colour.
    pub use_vertex_colors: bool,
    /// Medium inside, in addition to the model's absorption. Requires a transmissive model.
    pub medium: Option<Medium>,
    /// Displacement. Applied while a file is loaded; ignored in scenes built in code.
    pub displacement: Option<Displacement>,
    /// Nested dielectrics: of overlapping solids the one of highest priority applies, and among equals the one entered last.
    pub priority: i32,
    /// Special properties of an emissive surface; only without alpha.
    pub emitter_traits: Option<EmitterTraits>,
    /// Material index, an output of the `object_info` node.
    pub index: u32,
    /// Light group of the emission; empty for the default group.
    pub light_group: String,
    /// Generated for an area light of the file and named after it; not a material of the file.
    pub is_light: bool,
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
            transparent_color: ColorSlot::constant([1.0; 3]),
            normal_map: None,
            normal: None,
            bumped_normal: None,
            use_vertex_colors: false,
            medium: None,
            displacement: None,
            priority: 0,
            emitter_traits: None,
            index: 0,
            light_group: String::new(),
            is_light: false,
        }
    }

    /// Ideal diffuse reflection of a constant albedo.
    pub fn lambert(name: impl Into<String>, albedo: [f32; 3]) -> Material {
        Material::new(name, Model::Lambert { albedo: ColorSlot::constant(albedo) })
    }

    /// A glTF material.
    pub fn gltf(name: impl Into<String>, parameters: PbrMaterial) -> Material {
        Material::new(name, Model::Pbr(Box::new(parameters)))
    }

    /// A black emitter of constant radiance. A back that does not emit still blocks light.
    pub fn emitter(name: impl Into<String>, radiance: [f32; 3], two_sided: bool) -> Material {
        let emission = Some(Emission { radiance: ColorSlot::constant(radiance), two_sided });
        Material { emission, ..Material::new(name, Model::Black) }
    }
}

impl Parameters for AlphaMode {}
impl Parameters for DisplacementKind {}
impl Parameters for EmitterTraits {}

parameters_of_fields! {
    Material {
        name, model, emission, double_sided, alpha_mode, alpha, transparent_color, normal_map, normal, bumped_normal, use_vertex_colors,
        medium, displacement, priority, emitter_traits, index, light_group, is_light,
    }
    Displacement { texture, kind }
    Emission { radiance, two_sided }
}

impl Material {
    /// Visits all parameters.
    pub fn parameters(&self, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
        self.visit("", visitor);
    }

    /// Visits all parameters mutably.
    pub fn parameters_mut(&mut self, visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {
        self.visit_mut("", visitor);
    }

    /// All textures of the material, with repetitions.
    pub fn textures(&self) -> impl Iterator<Item = TextureId> + use<> {
        let mut found = Vec::new();
        self.parameters(&mut |_, parameter| found.extend(parameter.texture()));
        found.into_iter()
    }
}

// Scattering models.

named_enum! {
    /// Compensation for the energy loss of single-scattering microfacet models.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    EnergyCompensation {
        /// By a factor (Turquin 2019), or in solid glass by a multiple-scattering lobe (see [`crate::bsdf::RoughDielectric`]).
        #[default]
        On = "multi",
        /// None, for comparison with single-scattering renderers.
        Off = "single",
    }
}

named_enum! {
    /// Fresnel term of dielectrics.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    FresnelModel {
        /// The Fresnel equations.
        #[default]
        Exact = "exact",
        /// Schlick's approximation, as in the thesis and in the glTF specification.
        Schlick = "schlick",
    }
}

impl Parameters for FresnelModel {}
impl Parameters for Metal {}

/// Defines [`Model`]. Models under `plain` have a key in scene files (`type = "..."`), and each of their parameters a key with a
/// default, from which their reader and report are generated. Those under `other` have hand-written ones.
macro_rules! models {
    (
        plain {$(
            $(#[$plain_doc:meta])*
            $plain_key:literal $plain:ident {
                $($(#[$plain_field_doc:meta])* $plain_field:ident: $plain_type:ty = $key:literal $default:expr,)*
            }
        )*}
        other {$(
            $(#[$doc:meta])*
            $name:literal $other:ident {
                $($(#[$field_doc:meta])* $field:ident: $type:ty,)*
            }
        )*}
    ) => {
        /// Scattering model of a surface.
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum Model {
            /// Absorbs all light (pure emitters).
            Black,
            $($(#[$plain_doc])* $plain { $($(#[$plain_field_doc])* $plain_field: $plain_type,)* },)*
            $($(#[$doc])* $other { $($(#[$field_doc])* $field: $type,)* },)*
            /// The glTF 2.0 material.
            Pbr(Box<PbrMaterial>),
        }

        impl Model {
            /// The `plain` models: scene-file key, and a constructor with the default parameters.
            pub const PLAIN: &[(&str, fn() -> Model)] = &[
                $(($plain_key, || Model::$plain { $($plain_field: $default,)* }),)*
            ];

            /// A short name for reports.
            pub fn name(&self) -> &'static str {
                match self {
                    Model::Black => "black",
                    $(Model::$plain { .. } => $plain_key,)*
                    $(Model::$other { .. } => $name,)*
                    Model::Pbr(_) => "glTF",
                }
            }
        }

        impl Parameters for Model {
            fn visit(&self, name: &'static str, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
                match self {
                    Model::Black => {}
                    $(Model::$plain { $($plain_field,)* } => { $($plain_field.visit($key, visitor);)* })*
                    $(Model::$other { $($field,)* } => { $($field.visit(stringify!($field), visitor);)* })*
                    Model::Pbr(pbr) => pbr.visit(name, visitor),
                }
            }

            fn visit_mut(
                &mut self,
                name: &'static str,
                visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>),
            ) {
                match self {
                    Model::Black => {}
                    $(Model::$plain { $($plain_field,)* } => { $($plain_field.visit_mut($key, visitor);)* })*
                    $(Model::$other { $($field,)* } => { $($field.visit_mut(stringify!($field), visitor);)* })*
                    Model::Pbr(pbr) => pbr.visit_mut(name, visitor),
                }
            }
        }
    };
}

models! {
    plain {
        /// Ideal diffuse reflection.
        "lambert" Lambert {
            /// Albedo, 0..1.
            albedo: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
        }
        /// Rough diffuse reflection (energy-preserving Oren-Nayar).
        "oren-nayar" OrenNayar {
            /// Albedo of the facets, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// 0 (Lambertian) to 1.
            roughness: FloatSlot = "roughness" FloatSlot::constant(1.0),
        }
        /// The modified Phong model: diffuse reflection and a cosine lobe around the mirror direction.
        "phong" Phong {
            /// Diffuse albedo, 0..1.
            diffuse: ColorSlot = "diffuse" ColorSlot::constant([0.5; 3]),
            /// Specular albedo, 0..1. Where the sum with `diffuse` exceeds 1, both are scaled down.
            specular: ColorSlot = "specular" ColorSlot::constant([0.5; 3]),
            /// Phong exponent, from 0.
            exponent: f32 = "exponent" 30.0,
        }
        /// Microfacet reflection with the Beckmann distribution.
        "beckmann" Beckmann {
            /// Reflectance of the facets at all angles, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// Perceptual roughness 0..1: the square root of the RMS slope.
            roughness: FloatSlot = "roughness" FloatSlot::constant(0.2),
        }
        /// Ashikhmin's velvet.
        "velvet" Velvet {
            /// Factor on the scattered light, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// Sigma of the microfacet normals' distribution about the tangent plane, 0.01..1.
            deviation: FloatSlot = "deviation" FloatSlot::constant(0.5),
        }
        /// Diffuse toon shading: constant response within an angle of the normal.
        "toon" Toon {
            /// Factor on the scattered light, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// The angle, 0..1 for 0 to pi / 2.
            size: FloatSlot = "size" FloatSlot::constant(0.5),
            /// Width of the falloff beyond it, 0..1 for 0 to pi / 2.
            smooth: FloatSlot = "smooth" FloatSlot::constant(0.0),
        }
        /// Glossy toon shading: constant response within an angle of the mirror direction.
        "toon-highlight" ToonHighlight {
            /// Factor on the scattered light, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// The angle, 0..1 for 0 to pi / 2.
            size: FloatSlot = "size" FloatSlot::constant(0.5),
            /// Width of the falloff beyond it, 0..1 for 0 to pi / 2.
            smooth: FloatSlot = "smooth" FloatSlot::constant(0.0),
        }
    }
    other {
        /// A metal by its colour: GGX microfacets with Schlick's Fresnel term.
        "metal" SchlickMetal {
            /// Reflectance at normal incidence.
            color: ColorSlot,
            /// Perceptual roughness 0..1; the GGX alpha is its square.
            roughness: FloatSlot,
        }
        /// A metal by its measured complex index of refraction.
        "metal" Conductor {
            /// Real part by channel.
            eta: [f32; 3],
            /// Extinction coefficient by channel.
            k: [f32; 3],
            /// The metal, if its index is tabulated over the spectrum.
            metal: Option<Metal>,
            /// Perceptual roughness 0..1.
            roughness: FloatSlot,
        }
        /// A smooth solid dielectric.
        "dielectric" Dielectric {
            /// Index of refraction relative to the outside, at least 1.
            ior: f32,
            /// Factor on transmitted light at each crossing; white for clear glass.
            tint: ColorSlot,
            /// Fresnel term.
            fresnel: FresnelModel,
        }
        /// An index-matched boundary of a medium.
        "medium" Boundary {}
        /// A fibre of hair or fur.
        "hair" Hair {
            /// Colour of dense hair, from which the absorption is derived.
            color: ColorSlot,
            /// Roughness along the fibre, 0..1.
            roughness: FloatSlot,
            /// Roughness around the fibre, 0..1.
            radial_roughness: FloatSlot,
            /// Index of refraction, at least 1.
            ior: f32,
            /// Tilt of the cuticle scales towards the root, radians.
            tilt_rad: f32,
            /// Reduction of the roughness of the surface reflection (R lobe), 0..1.
            coat: FloatSlot,
        }
        /// Rough glass.
        "dielectric" Glass {
            /// Index of refraction relative to the outside, at least 1.
            ior: f32,
            /// Factor on transmitted light at each crossing; white for clear glass.
            tint: ColorSlot,
            /// Perceptual roughness 0..1.
            roughness: FloatSlot,
            /// Thin-walled.
            is_thin: bool,
        }
        /// A weighted sum of the BSDFs of several materials.
        "mix" Mix {
            /// Components.
            components: Vec<MixComponent>,
        }
    }
}

/// A material of a mix.
#[derive(Clone, Debug, PartialEq)]
pub struct MixComponent {
    /// Weight of the BSDF, from 0; mixes whose weights sum to at most 1 conserve energy.
    pub weight: ColorSlot,
    /// Material with the BSDF, normals and medium. Must not be a mix; emission, alpha and displacement are those of the mix.
    pub material: Material,
}

/// Transmission through a surface.
#[derive(Clone, Copy, Debug)]
pub enum Transmission<'a> {
    /// The surface is opaque.
    None,
    /// Thin-walled.
    Thin,
    /// Into a solid of this index of refraction without absorption.
    Clear(f32),
    /// That of a glTF material.
    Pbr(&'a PbrMaterial),
}

impl Model {
    /// Transmission of the model; of a mix, that of the first transmissive component.
    pub fn transmission(&self) -> Transmission<'_> {
        match self {
            Model::Black
            | Model::Lambert { .. }
            | Model::OrenNayar { .. }
            | Model::Phong { .. }
            | Model::Beckmann { .. }
            | Model::Velvet { .. }
            | Model::Toon { .. }
            | Model::ToonHighlight { .. }
            | Model::SchlickMetal { .. }
            | Model::Conductor { .. } => Transmission::None,
            Model::Dielectric { ior, .. } | Model::Glass { ior, is_thin: false, .. } => {
                Transmission::Clear(*ior)
            }
            Model::Boundary {} => Transmission::Clear(1.0),
            Model::Glass { is_thin: true, .. } | Model::Hair { .. } => Transmission::Thin,
            Model::Pbr(pbr) => Transmission::Pbr(pbr),
            Model::Mix { components } => {
                let transmissions =
                    components.iter().map(|component| component.material.model.transmission());
                let mut transmissive = transmissions.filter(|t| !matches!(t, Transmission::None));
                transmissive.next().unwrap_or(Transmission::None)
            }
        }
    }

    /// Components of a mix.
    pub fn components(&self) -> &[MixComponent] {
        if let Model::Mix { components } = self { components } else { &[] }
    }

    /// The glTF material, if it is one.
    pub fn pbr(&self) -> Option<&PbrMaterial> {
        if let Model::Pbr(pbr) = self { Some(pbr) } else { None }
    }
}

/// The glTF 2.0 material with its extensions.
#[derive(Clone, Debug, PartialEq)]
pub struct PbrMaterial {
    /// Base colour.
    pub base_color: ColorSlot,
    /// Metalness 0..1.
    pub metallic: FloatSlot,
    /// Perceptual roughness 0..1.
    pub roughness: FloatSlot,
    /// Roughness 0..1 of the diffuse lobe (KHR_materials_diffuse_roughness, Oren-Nayar); 0 is Lambertian.
    pub diffuse_roughness: FloatSlot,
    /// Index of refraction relative to the outside (KHR_materials_ior), by default 1.5; below 1 for bubbles, and 0 for total
    /// reflection.
    pub ior: f32,
    /// Textured index of refraction of the interface, for pure glass. `ior` is then used for nested dielectrics only.
    pub varying_ior: Option<FloatSlot>,
    /// Strength of the dielectric reflection (KHR_materials_specular).
    pub specular: FloatSlot,
    /// Colour of the dielectric reflection at normal incidence.
    pub specular_color: ColorSlot,
    /// The dielectric reflection has no Fresnel increase to white at grazing angles, like Cycles' Glossy BSDF.
    pub has_constant_reflectance: bool,
    /// Fraction 0..1 of the diffuse lobe that is replaced by transmission (KHR_materials_transmission).
    pub transmission: FloatSlot,
    /// Solid (KHR_materials_volume with a thickness above 0) instead of thin-walled.
    pub has_volume: bool,
    /// The base colour is the transmittance of both interfaces of a solid together, as in Blender: each multiplies by its square
    /// root. Otherwise each multiplies by the base colour (KHR_materials_transmission).
    pub tints_once: bool,
    /// Refraction does not scale the radiance by the square of the relative index of refraction, as in Cycles. A surface without a
    /// volume is then not thin-walled: it refracts by the sides of its normal, like the surface of a solid, with no medium inside.
    pub keeps_radiance: bool,
    /// Colour of the reflection of the transmissive interface.
    pub glass_reflection: GlassReflection,
    /// Energy compensation; `None` for the render setting.
    pub energy_compensation: Option<EnergyCompensation>,
    /// Transmission has the Beckmann distribution without energy compensation, instead of GGX.
    pub is_beckmann: bool,
    /// Transmittance of the volume over `attenuation_distance`.
    pub attenuation_color: [f32; 3],
    /// Metres; infinite for no absorption.
    pub attenuation_distance: f32,
    /// Dispersion, 20 / Abbe number (KHR_materials_dispersion).
    pub dispersion: f32,
    /// Clearcoat.
    pub clearcoat: Option<Clearcoat>,
    /// Sheen.
    pub sheen: Option<Sheen>,
    /// Anisotropy.
    pub anisotropy: Option<Anisotropy>,
    /// Iridescence.
    pub iridescence: Option<Iridescence>,
    /// Diffuse transmission.
    pub diffuse_transmission: Option<DiffuseTransmission>,
}

named_enum! {
    /// Colour of the reflection of glass, including total internal reflection.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    GlassReflection {
        /// White (physical).
        #[default]
        White = "white",
        /// The transmission colour of a single interface, like Cycles' Glass BSDF.
        Tinted = "tinted",
        /// Black: refraction only, without Fresnel losses, like Cycles' Refraction BSDF.
        None = "none",
    }
}

impl Parameters for GlassReflection {}

impl Parameters for EnergyCompensation {}

/// A clear dielectric top layer of index of refraction 1.5 (KHR_materials_clearcoat).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat {
    /// Strength 0..1; not constant 0.
    pub factor: FloatSlot,
    /// Perceptual roughness 0..1.
    pub roughness: FloatSlot,
    /// Normal map of the coat; the base's normal map does not apply to it.
    pub normal_map: Option<NormalMap>,
}

/// A sheen layer (KHR_materials_sheen).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// Colour 0..1; not constant black.
    pub color: ColorSlot,
    /// Perceptual roughness 0..1.
    pub roughness: FloatSlot,
}

/// Anisotropic roughness (KHR_materials_anisotropy): alpha_t = mix(alpha, 1, strength^2), alpha_b = alpha.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anisotropy {
    /// Strength, above 0 and at most 1; multiplied by the texture's blue channel.
    pub strength: f32,
    /// Counter-clockwise angle from the tangent to the direction of alpha_t, radians; added to the texture's.
    pub rotation_rad: f32,
    /// Linear RGB: direction d in the tangent plane as (d + 1) / 2, and strength.
    pub texture: Option<TextureId>,
}

/// A thin film with interference (KHR_materials_iridescence).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iridescence {
    /// Strength 0..1; not constant 0.
    pub factor: FloatSlot,
    /// Index of refraction of the film, at least 1.
    pub ior: f32,
    /// Thickness in nanometres where the texture is 0.
    pub thickness_min_nm: f32,
    /// Thickness in nanometres where the texture is 1 or missing.
    pub thickness_max_nm: f32,
    /// Texture and channel that interpolate between the two.
    pub thickness_texture: Option<(TextureId, u8)>,
}

/// Diffuse transmission (KHR_materials_diffuse_transmission).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Fraction 0..1 of the diffuse light that is transmitted; not constant 0.
    pub factor: FloatSlot,
    /// Colour, in place of the base colour.
    pub color: ColorSlot,
    /// How light enters a solid with subsurface scattering; `None` without it.
    pub subsurface: Option<SubsurfaceEntry>,
}

/// Directions in which light enters a solid with subsurface scattering. It leaves by Lambert's law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SubsurfaceEntry {
    /// By Lambert's law.
    Diffuse,
    /// Half of it by Lambert's law, half refracted by facets of GGX alpha 1 (Cycles' Random Walk (Skin)).
    Skin {
        /// Index of refraction of the solid, above 1.
        ior: f32,
    },
    /// Refracted by the facets of the surface (Cycles' Random Walk).
    Refraction {
        /// Index of refraction of the solid, above 1.
        ior: f32,
    },
}

impl PbrMaterial {
    /// Minimum index of refraction of glass: it transmits only within a thousandth of a radian of the normal.
    pub const MIN_GLASS_IOR: f32 = 1e-3;
}

impl Default for PbrMaterial {
    fn default() -> PbrMaterial {
        PbrMaterial {
            base_color: ColorSlot::constant([1.0; 3]),
            metallic: FloatSlot::constant(1.0),
            roughness: FloatSlot::constant(1.0),
            diffuse_roughness: FloatSlot::constant(0.0),
            ior: 1.5,
            varying_ior: None,
            specular: FloatSlot::constant(1.0),
            specular_color: ColorSlot::constant([1.0; 3]),
            has_constant_reflectance: false,
            transmission: FloatSlot::constant(0.0),
            has_volume: false,
            tints_once: false,
            keeps_radiance: false,
            glass_reflection: GlassReflection::White,
            energy_compensation: None,
            is_beckmann: false,
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
    MixComponent { weight, material }
    PbrMaterial {
        base_color, metallic, roughness, diffuse_roughness, ior, varying_ior, specular, specular_color, has_constant_reflectance, transmission,
        has_volume, tints_once, keeps_radiance, glass_reflection, energy_compensation, is_beckmann, attenuation_color, attenuation_distance, dispersion, clearcoat,
        sheen, anisotropy, iridescence, diffuse_transmission,
    }
    Clearcoat { factor, roughness, normal_map }
    Sheen { color, roughness }
    Anisotropy { strength, rotation_rad, texture }
    Iridescence { factor, ior, thickness_min_nm, thickness_max_nm, thickness_texture }
    DiffuseTransmission { factor, color, subsurface }
}

impl Parameters for SubsurfaceEntry {}

// Colour of dense hair from the absorption of a fibre: Chiang, Bitterli, Tappan, Burley 2016, eq. 9.

/// Minimum radial roughness of hair.
const MIN_ROUGHNESS: f32 = 0.01;

/// Denominator of eq. 9 at a radial roughness: the square root of the absorption per fibre radius is -ln(colour) over it.
pub fn hair_color_scale(radial_roughness: f32) -> f32 {
    let b = radial_roughness.clamp(MIN_ROUGHNESS, 1.0);
    ((((0.245 * b + 5.574) * b - 10.73) * b + 2.532) * b - 0.215) * b + 5.969
}

/// Colour of dense hair by its absorption per fibre radius: the inverse of eq. 9.
pub fn hair_color(absorption: [f32; 3], radial_roughness: f32) -> [f32; 3] {
    let scale = hair_color_scale(radial_roughness);
    absorption.map(|a| poly::exp(-scale * a.max(0.0).sqrt()))
}
