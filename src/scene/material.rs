//! Materials as the user described them, and how surfaces scatter light: `compile` turns each into the cheapest equivalent BSDF. One table holds
//! every model: a row is all that readers of scene files, reports and the search for textures need.

use super::light::SpotFade;
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
    /// Emits from the back as well; else the back is dark, where [`Material::double_sided`] says that there is one.
    pub two_sided: bool,
}

/// Use of alpha below 1.
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

/// Special properties of an emitting surface: ray visibility, whether it blocks rays (lights of Blender don't), and a beam shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterTraits {
    /// Visible to rays of these kinds; others pass and get no light from it.
    pub visible_to: RayKinds,
    /// Rays end at it; else they add its emission and pass.
    pub is_obstacle: bool,
    /// Angular distribution of its emission.
    pub beam: Beam,
}

impl Default for EmitterTraits {
    /// A surface like others.
    fn default() -> EmitterTraits {
        EmitterTraits { visible_to: RayKinds::ALL, is_obstacle: true, beam: Beam::Even }
    }
}

/// How the radiance of a [`EmitterTraits`] depends on the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Beam {
    /// It doesn't.
    #[default]
    Even,
    /// Slats in front of the light hide part of it, as in a soft box: with the tangent of the angle to the surface's normal
    /// the radiance falls in a line to 0 at this half angle (radians, from 1e-4 to below pi / 2); its peak rises so that the
    /// power stays.
    Grid {
        /// Half the angle of the beam.
        half_angle_rad: f64,
    },
    /// A cone about an axis, as that of [`LightKind::Spot`](super::LightKind::Spot).
    Cone {
        /// The axis, of unit length, in the world.
        direction: DVec3,
        /// Half angle of the full radiance, radians.
        inner_angle_rad: f64,
        /// Half angle where it ends, radians.
        outer_angle_rad: f64,
        /// How it fades in between.
        fade: SpotFade,
    },
    /// A measured profile, of which the radiance is the peak's.
    Profile {
        /// The profile; its largest value is 1.
        profile: ProfileId,
        /// Turns it into world space: it emits along -z, and its horizontal angles turn from x to y.
        rotation: DQuat,
        /// Half angles, radians, between which a cone about its axis fades by a smooth step, if there is one.
        cone: Option<[f64; 2]>,
    },
}

/// Displacement of a mesh along its normals by a height map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// An image by texture coordinates, and the channel that holds the heights.
    pub texture: (TextureId, u8),
    /// How far a height of 1 lies above one of 0, in the units of the mesh.
    pub scale: f32,
    /// The height that stays where the mesh is.
    pub midlevel: f32,
    /// Longest edge of triangles, in the units of the mesh; 0 is 1/256 of the diagonal of the mesh's box.
    pub edge: f32,
}

/// A material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// For reports and overrides.
    pub name: String,
    /// How it scatters.
    pub model: Model,
    /// Emission.
    pub emission: Option<Emission>,
    /// False: seen from behind the surface isn't there (glTF 2.0, section 3.9.5: back faces are culled). What counts is the
    /// direction in which paths from the eye arrive, those that ask whether a light is hidden included. Transmissive
    /// materials scatter on both sides whatever this says.
    pub double_sided: bool,
    /// Alpha mode.
    pub alpha_mode: AlphaMode,
    /// Opacity, used unless the mode is opaque.
    pub alpha: FloatSlot,
    /// Factor on light that passes where the surface is absent by its alpha, from 0; white for holes.
    pub passing: ColorSlot,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
    /// A graph of nodes that gives the shading normal in world space, on the viewer's side, in place of a normal map.
    pub normal: Option<TextureId>,
    /// A graph that gives the normal of the surface with the bumps of a displacement, on which those of `normal` are.
    pub bumped_normal: Option<TextureId>,
    /// Vertex colours multiply the base colour.
    pub use_vertex_colors: bool,
    /// Medium of its solids, in addition to the absorption of the model; only where the model transmits light.
    pub medium: Option<Medium>,
    /// Moves the surface. Loading a file applies it; a scene that is built in code is rendered without.
    pub displacement: Option<Displacement>,
    /// Which of several solids counts where they overlap: the one of the highest priority, and among equals the one that light
    /// entered last.
    pub priority: i32,
    /// Ray visibility of an emissive surface; only without alpha.
    pub emitter_traits: Option<EmitterTraits>,
    /// A number that graphs of nodes know it by.
    pub index: u32,
    /// The light group of its emission; empty for the default group.
    pub light_group: String,
    /// It is the surface of a light of the file, whose name it has, and none of the file's materials.
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
            passing: ColorSlot::constant([1.0; 3]),
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

    /// A black emitter of constant radiance. Its back, where that is dark, is there all the same.
    pub fn emitter(name: impl Into<String>, radiance: [f32; 3], two_sided: bool) -> Material {
        let emission = Some(Emission { radiance: ColorSlot::constant(radiance), two_sided });
        Material { emission, ..Material::new(name, Model::Black) }
    }
}

impl Parameters for AlphaMode {}
impl Parameters for EmitterTraits {}

parameters_of_fields! {
    Material {
        name, model, emission, double_sided, alpha_mode, alpha, passing, normal_map, normal, bumped_normal, use_vertex_colors,
        medium, displacement, priority, emitter_traits, index, light_group, is_light,
    }
    Displacement { texture, scale, midlevel, edge }
    Emission { radiance, two_sided }
}

impl Material {
    /// Visits every parameter of the material.
    pub fn parameters(&self, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
        self.visit("", visitor);
    }

    /// The same, to change them.
    pub fn parameters_mut(&mut self, visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {
        self.visit_mut("", visitor);
    }

    /// Every texture that the material refers to.
    pub fn textures(&self) -> impl Iterator<Item = TextureId> + use<> {
        let mut found = Vec::new();
        self.parameters(&mut |_, parameter| found.extend(parameter.texture()));
        found.into_iter()
    }
}

// How surfaces scatter light.

/// Compensation for the energy that single scattering between microfacets loses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnergyCompensation {
    /// The lost energy is given back: by a factor (Turquin 2019); in solid glass, distributed as multiple scattering between microfacets
    /// (see [`crate::bsdf::RoughDielectric`]).
    #[default]
    On,
    /// Single scattering only, for comparison with renderers that do so.
    Off,
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

impl Parameters for FresnelModel {}
impl Parameters for Metal {}

/// Makes [`Model`] of its rows. Rows under `plain` have a key in scene files (`type = "..."`) and for each parameter a key
/// with a default: they are read and reported as they stand here. Other rows have a reader and words of their own.
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
        /// How a surface scatters light.
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum Model {
            /// Absorbs everything (pure emitters).
            Black,
            $($(#[$plain_doc])* $plain { $($(#[$plain_field_doc])* $plain_field: $plain_type,)* },)*
            $($(#[$doc])* $other { $($(#[$field_doc])* $field: $type,)* },)*
            /// The glTF 2.0 material.
            Pbr(Box<PbrMaterial>),
        }

        impl Model {
            /// The models that scene files name by a key and read parameter by parameter, with their defaults.
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
            /// Share of light reflected, 0..1.
            albedo: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
        }
        /// Rough diffuse reflection (energy-preserving Oren-Nayar).
        "oren-nayar" OrenNayar {
            /// Share of light reflected by each facet, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// 0 is Lambert's law, 1 the roughest.
            roughness: FloatSlot = "roughness" FloatSlot::constant(1.0),
        }
        /// The modified Phong model: diffuse reflection and a cosine lobe around the mirror direction.
        "phong" Phong {
            /// Diffuse share 0..1.
            diffuse: ColorSlot = "diffuse" ColorSlot::constant([0.5; 3]),
            /// Specular share 0..1; where both add up to more than 1, both are scaled down.
            specular: ColorSlot = "specular" ColorSlot::constant([0.5; 3]),
            /// Exponent of the cosine, from 0.
            exponent: f32 = "exponent" 30.0,
        }
        /// Facets whose slopes are normally distributed.
        "beckmann" Beckmann {
            /// Reflectance of a facet, the same at all angles, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// Perceptual roughness 0..1: the root of the root mean square slope.
            roughness: FloatSlot = "roughness" FloatSlot::constant(0.2),
        }
        /// The velvet of Ashikhmin: facets whose normals lie along the surface.
        "velvet" Velvet {
            /// Factor on the scattered light, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// Standard deviation of the normals from the surface, 0.01..1.
            deviation: FloatSlot = "deviation" FloatSlot::constant(0.5),
        }
        /// Toon shading: light from within an angle of the normal counts alike.
        "toon" Toon {
            /// Factor on the scattered light, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// The angle over a right angle, 0..1.
            size: FloatSlot = "size" FloatSlot::constant(0.5),
            /// The angle over which light fades out beyond, over a right angle, 0..1.
            smooth: FloatSlot = "smooth" FloatSlot::constant(0.0),
        }
        /// The same around the mirror direction.
        "toon-highlight" ToonHighlight {
            /// Factor on the scattered light, 0..1.
            color: ColorSlot = "color" ColorSlot::constant([0.8; 3]),
            /// The angle over a right angle, 0..1.
            size: FloatSlot = "size" FloatSlot::constant(0.5),
            /// The angle over which light fades out beyond, over a right angle, 0..1.
            smooth: FloatSlot = "smooth" FloatSlot::constant(0.0),
        }
    }
    other {
        /// A metal of a colour: GGX microfacets with Schlick's Fresnel term.
        "metal" SchlickMetal {
            /// Reflectance at normal incidence.
            color: ColorSlot,
            /// Perceptual roughness 0..1; the GGX alpha is its square. The thesis's fuzz maps to the roughness of
            /// the same mean deviation (see the scene-file loader).
            roughness: FloatSlot,
        }
        /// A metal of a measured complex index of refraction.
        "metal" Conductor {
            /// Real part by channel.
            eta: [f32; 3],
            /// Extinction coefficient by channel.
            k: [f32; 3],
            /// The metal, if its index is tabulated by wavelength.
            metal: Option<Metal>,
            /// Perceptual roughness 0..1.
            roughness: FloatSlot,
        }
        /// A smooth solid dielectric: reflects and refracts.
        "dielectric" Dielectric {
            /// Index of refraction relative to the outside, at least 1.
            ior: f32,
            /// Factor on transmitted light at each crossing; white for clear glass.
            tint: ColorSlot,
            /// Fresnel term.
            fresnel: FresnelModel,
        }
        /// An index-matched interface: it only bounds the medium inside.
        "medium" Boundary {}
        /// A fibre of hair or fur.
        "hair" Hair {
            /// Colour of much of it; its absorption follows from that.
            color: ColorSlot,
            /// Roughness along the fibre, 0..1.
            roughness: FloatSlot,
            /// Roughness around the fibre, 0..1.
            radial_roughness: FloatSlot,
            /// Index of refraction, at least 1.
            ior: f32,
            /// Angle by which the scales of its surface are tilted towards the root, radians.
            tilt_rad: f32,
            /// Reduction of the roughness of its surface reflection, 0..1.
            coat: FloatSlot,
        }
        /// Glass of any roughness.
        "dielectric" Glass {
            /// Index of refraction relative to the outside, at least 1.
            ior: f32,
            /// Factor on transmitted light at each crossing; white for clear glass.
            tint: ColorSlot,
            /// Perceptual roughness 0..1.
            roughness: FloatSlot,
            /// Thin-walled instead of solid.
            is_thin: bool,
        }
        /// Several materials in one place: scatters by the weighted sum of their BSDFs.
        "mix" Mix {
            /// The materials with their weights.
            components: Vec<MixComponent>,
        }
    }
}

/// A material of a mix.
#[derive(Clone, Debug, PartialEq)]
pub struct MixComponent {
    /// Factor on its BSDF, from 0; the weights of a mix that creates no light add up to at most 1.
    pub weight: ColorSlot,
    /// How it scatters, with its normals and medium. Emission, alpha and displacement are those of the mix, and it is no mix
    /// itself.
    pub material: Material,
}

/// The interface that light passes on entering a surface.
#[derive(Clone, Copy, Debug)]
pub enum Transmission<'a> {
    /// Nothing: the surface is opaque.
    None,
    /// A thin wall, which has no inside.
    Thin,
    /// A solid of this index of refraction that absorbs nothing.
    Clear(f32),
    /// Whatever the glTF material says.
    Pbr(&'a PbrMaterial),
}

impl Model {
    /// Where light goes that enters the surface. Every model has to say.
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

    /// The components, if it is a mix.
    pub fn components(&self) -> &[MixComponent] {
        if let Model::Mix { components } = self { components } else { &[] }
    }

    /// The glTF material, if it is one.
    pub fn pbr(&self) -> Option<&PbrMaterial> {
        if let Model::Pbr(pbr) = self { Some(pbr) } else { None }
    }
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
    /// Roughness 0..1 of the diffuse part by the model of Oren and Nayar (KHR_materials_diffuse_roughness); 0 is Lambert's
    /// law.
    pub diffuse_roughness: FloatSlot,
    /// Index of refraction over that of the outside (KHR_materials_ior); 1.5 by default, below 1 for what is thinner, such as
    /// bubbles, 0 means total reflection.
    pub ior: f32,
    /// Strength of the dielectric reflection (KHR_materials_specular).
    pub specular: FloatSlot,
    /// Its colour at normal incidence.
    pub specular_color: ColorSlot,
    /// It is the same at all angles, as of the Glossy BSDF of Cycles, not white at grazing incidence.
    pub reflects_evenly: bool,
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
    /// Colour of the interface's reflection where light may pass it.
    pub glass_reflection: GlassReflection,
    /// Whether the energy that single scattering between its facets loses is given back; `None`: as in all of the picture.
    pub energy_compensation: Option<EnergyCompensation>,
    /// Glass has facets whose slopes are normally distributed (Beckmann), which lose what they mirror into each other, not GGX.
    pub is_beckmann: bool,
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

/// Colour of the reflection of glass, total reflection included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GlassReflection {
    /// White, as physics has it.
    #[default]
    White,
    /// The colour of light that crosses the surface once, as of the Glass BSDF of Cycles.
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

impl Parameters for EnergyCompensation {}

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
            reflects_evenly: false,
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
        base_color, metallic, roughness, diffuse_roughness, ior, specular, specular_color, reflects_evenly, transmission,
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

// The colour of hair by the absorption of a fibre: Chiang, Bitterli, Tappan, Burley 2016, eq. 9.

/// Hair is no less rough around its fibre.
const MIN_ROUGHNESS: f32 = 0.01;

/// Divisor of the logarithm of the colour of dense hair for the root of its absorption per radius, at a radial roughness.
pub fn hair_color_scale(radial_roughness: f32) -> f32 {
    let b = radial_roughness.clamp(MIN_ROUGHNESS, 1.0);
    ((((0.245 * b + 5.574) * b - 10.73) * b + 2.532) * b - 0.215) * b + 5.969
}

/// The colour of much hair that absorbs so much per radius.
pub fn hair_color(absorption: [f32; 3], radial_roughness: f32) -> [f32; 3] {
    let scale = hair_color_scale(radial_roughness);
    absorption.map(|a| poly::exp(-scale * a.max(0.0).sqrt()))
}
