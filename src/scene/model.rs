//! How surfaces scatter light, as the user described it. One table holds every model: a row is all that readers of scene
//! files, reports and the search for textures need.

use super::pbr::PbrMaterial;
use super::slot::{ColorSlot, FloatSlot, Parameter, ParameterMut, Parameters};
use crate::color::spectral::Metal;

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
            /// Whose they are, if their values at all wavelengths are known.
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
        /// No surface: light passes as if nothing was there. It bounds the medium that fills the solid.
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
            /// How much less rough is what its surface reflects, 0..1.
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
            /// A thin sheet instead of a solid.
            is_thin: bool,
        }
    }
}

/// What light passes that enters a surface.
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
            | Model::SchlickMetal { .. }
            | Model::Conductor { .. } => Transmission::None,
            Model::Dielectric { ior, .. } | Model::Glass { ior, is_thin: false, .. } => {
                Transmission::Clear(*ior)
            }
            Model::Boundary {} => Transmission::Clear(1.0),
            Model::Glass { is_thin: true, .. } | Model::Hair { .. } => Transmission::Thin,
            Model::Pbr(pbr) => Transmission::Pbr(pbr),
        }
    }

    /// The glTF material, if it is one.
    pub fn pbr(&self) -> Option<&PbrMaterial> {
        if let Model::Pbr(pbr) = self { Some(pbr) } else { None }
    }
}
