//! Render settings of scene files.

use super::material::{EnergyCompensation, FresnelModel};
use crate::color::ViewTransform;

/// Reconstruction filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Filter {
    /// One pixel wide, constant.
    Box,
    /// Truncated Gaussian, sigma 0.5 pixels, radius 1.5.
    Gaussian,
    /// Blackman-Harris window, radius 1.5.
    #[default]
    BlackmanHarris,
}

/// Output of shadow catchers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CatcherOutput {
    /// Shadows as alpha, and the light that other objects add: composited over a plate of the real surface,
    /// the picture shows that surface among the objects.
    #[default]
    All,
    /// Alpha alone, by the mean of the channels, as Cycles has it.
    Shadows,
}

/// What becomes of light near the horizon of triangles that stand for a curved surface, whose shading normals differ from the geometric one: without
/// a remedy the triangles cut it off along their edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShadowTerminator {
    /// It fades out smoothly towards the triangle's horizon.
    #[default]
    Soft,
    /// Shadow rays start at the curved surface, which also has light from below the triangle's horizon: as Cycles' Geometry Offset of 0.1.
    Lifted,
    /// It is cut off.
    Off,
}

impl ShadowTerminator {
    /// All, by the names that options and scene files have for them.
    pub const NAMED: [(&str, ShadowTerminator); 3] = [
        ("soft", ShadowTerminator::Soft),
        ("lifted", ShadowTerminator::Lifted),
        ("off", ShadowTerminator::Off),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::NAMED.iter().find(|(_, other)| *other == self).map_or("", |(name, _)| name)
    }
}

/// Scattering models that all materials of a picture share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadingModel {
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
    /// Fresnel term of the dielectric layers of glTF materials.
    pub fresnel: FresnelModel,
    /// Paths carry wavelengths instead of red, green and blue.
    pub spectral: bool,
}

/// Defines limits with names: a struct of numbers, which are `$unlimited` where there is no limit. Its names serve the command line, scene
/// files, validation and `oscura inspect`.
macro_rules! named_limits {
    ($(#[$doc:meta])* $limits:ident: $number:ty = $unlimited:expr; {$($(#[$about:meta])* $name:ident,)*}) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $limits {$($(#[$about])* pub $name: $number,)*}

        impl $limits {
            /// No limits.
            pub const NONE: $limits = $limits { $($name: $unlimited,)* };
            /// Names of the limits.
            pub const NAMES: &[&str] = &[$(stringify!($name),)*];

            /// Limits by their names; `None` is no limit.
            pub fn by_name(mut limit: impl FnMut(&'static str) -> Option<$number>) -> $limits {
                $limits { $($name: limit(stringify!($name)).unwrap_or($unlimited),)* }
            }

            /// The limits that are set, with their names.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, $number)> {
                let all = [$((stringify!($name), self.$name),)*];
                all.into_iter().filter(|(_, limit)| *limit != $unlimited)
            }
        }

        impl Default for $limits {
            fn default() -> $limits {
                $limits::NONE
            }
        }
    };
}

named_limits! {
    /// Maximum numbers of scattering events of a path by kind, `u32::MAX` without a limit: a path ends after the event that reaches
    /// one, with the light sampled there and the emission that its last ray hits. Pictures lose light by it. (Cycles' numbers of bounces
    /// don't count the last event: its 0 is 1 here.)
    #[derive(Eq)]
    BounceLimits: u32 = u32::MAX; {
        /// Diffuse reflection.
        diffuse,
        /// Glossy and mirror reflection.
        glossy,
        /// Refraction and diffuse transmission.
        transmission,
        /// Scattering in media, other than beneath the surface of solids.
        volume,
        /// Surfaces that a path passes because of their alpha: behind the last one it ends at the next surface. Shadow rays pass one
        /// less, with those that their path has passed.
        transparent,
        /// Scattering beneath the surface of a solid in a row. (Counted where no light lies within it.)
        subsurface,
    }
}

named_limits! {
    /// Clamping of the light of single paths: the weighted contribution of one is scaled down to a mean of its three channels of at
    /// most this; infinite without clamping. Removes fireflies and, with them, light.
    Clamp: f32 = f32::INFINITY; {
        /// Light that reaches the camera after at most one scattering event.
        direct,
        /// Light that reaches it after several.
        indirect,
    }
}

impl BounceLimits {
    /// Is scattering of some kind limited?
    pub fn limit_scattering(&self) -> bool {
        BounceLimits { transparent: u32::MAX, subsurface: u32::MAX, ..*self } != BounceLimits::NONE
    }
}

/// Caustics that are left out, as Cycles does where its Reflective or Refractive Caustics are off: on rays that a surface scattered
/// diffusely, surfaces have no glossy reflection, or no transmission. Removes noise and, with it, light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkippedCaustics {
    /// Caustics of glossy reflection.
    pub reflective: bool,
    /// Caustics of transmission.
    pub refractive: bool,
}

impl SkippedCaustics {
    /// All caustics are rendered.
    pub const NONE: SkippedCaustics = SkippedCaustics { reflective: false, refractive: false };
}

/// The settings that scene files may have, each with its type and meaning: makes the struct and the merge.
macro_rules! scene_settings {
    ($($name:ident: $type:ty, $help:literal;)*) => {
        /// Render settings of a scene file; `None` where it says nothing.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Settings {
            $(
                #[doc = concat!($help, ".")]
                pub $name: Option<$type>,
            )*
        }

        impl Settings {
            /// These settings, and those of `other` where these are `None`.
            #[must_use]
            pub fn or(&self, other: &Settings) -> Settings {
                Settings { $($name: self.$name.clone().or_else(|| other.$name.clone()),)* }
            }
        }
    };
}
scene_settings! {
    width: u32, "Image width in pixels";
    height: u32, "Image height in pixels";
    samples: u32, "Samples per pixel";
    depth: u32, "Maximum number of bounces of a path; 0 renders directly visible emission only";
    bounces: BounceLimits, "Maximum numbers of bounces by kind";
    clamp: Clamp, "Clamping of the light of single paths";
    filter_glossy: f32, "Glossy filter: roughens what paths hit after a rough bounce; 0 is off";
    skip_caustics: SkippedCaustics, "Caustics to leave out";
    terminator: ShadowTerminator, "Remedy for the shadow terminator of meshes with shading normals";
    seed: u32, "Random seed";
    filter: Filter, "Reconstruction filter";
    energy_compensation: EnergyCompensation, "Energy compensation of rough surfaces; `microfacet` in scene files";
    fresnel: FresnelModel, "Fresnel term of the dielectric layers of glTF materials";
    spectral: bool, "Spectral rendering: sample wavelengths instead of red, green and blue";
    exposure: f32, "Exposure of PNG and other display-referred output, stops";
    view: ViewTransform, "View transform of display-referred output";
    white_balance: f32, "White balance of display-referred output: colour temperature that looks white, kelvin";
    noise: f32, "Noise threshold: estimated relative error of the image to stop at, percent; `samples` is the maximum then";
    denoise: bool, "Denoise the finished image";
    crop: [u32; 4], "Pixels to render: first column and row, and the column and row after the last";
    aovs: Vec<String>, "AOVs (render passes) to write as further EXR channels, by name";
    caught: CatcherOutput, "What shadow catchers show";
}

impl Settings {
    /// The scattering models of the picture, defaults where these are `None`.
    pub fn shading(&self) -> ShadingModel {
        ShadingModel {
            energy_compensation: self.energy_compensation.unwrap_or_default(),
            fresnel: self.fresnel.unwrap_or_default(),
            spectral: self.spectral.unwrap_or_default(),
        }
    }
}
