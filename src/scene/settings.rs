//! Render settings of scene files.

use super::material::{EnergyCompensation, FresnelModel};
use crate::color::ViewTransform;

named_enum! {
    /// Reconstruction filter.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    #[non_exhaustive]
    Filter {
        /// Constant, one pixel wide.
        Box = "box",
        /// Gaussian, truncated at three standard deviations.
        Gaussian = "gaussian",
        /// Blackman-Harris window.
        #[default]
        BlackmanHarris = "blackman-harris",
    }
}

impl Filter {
    /// Radius, pixels.
    pub const fn default_radius(self) -> f32 {
        match self {
            Filter::Box => 0.5,
            Filter::Gaussian | Filter::BlackmanHarris => 1.5,
        }
    }
}

named_enum! {
    /// Output of shadow catchers.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    CatcherOutput {
        /// Shadows as alpha, and light of other objects as colour, for compositing over a plate of the real surface.
        #[default]
        All = "all",
        /// Shadows as alpha only, averaged over the channels, like Cycles.
        Shadows = "shadows",
    }
}

named_enum! {
    /// Remedy for the shadow terminator problem: hard shadow edges along triangles with interpolated normals at grazing light.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    ShadowTerminator {
        /// Light fades out smoothly towards the triangle's horizon.
        #[default]
        Soft = "soft",
        /// Shadow rays start on the interpolated curved surface, which is also lit from below the triangle's horizon; like a Geometry
        /// Offset of 0.1 in Cycles.
        Lifted = "lifted",
        /// No remedy.
        Off = "off",
    }
}

/// Scattering options of all materials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadingModel {
    /// Energy compensation of rough surfaces.
    pub energy_compensation: EnergyCompensation,
    /// Fresnel term of the dielectric layers of glTF materials.
    pub fresnel: FresnelModel,
    /// Spectral rendering: paths carry wavelengths instead of red, green and blue.
    pub spectral: bool,
}

/// Defines a struct of named limits, `$unlimited` by default, with the names for the command line, scene files, validation and
/// `oscura inspect`.
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

            /// Limits from a function of their names; `None` is unlimited.
            pub fn by_name(mut limit: impl FnMut(&'static str) -> Option<$number>) -> $limits {
                $limits { $($name: limit(stringify!($name)).unwrap_or($unlimited),)* }
            }

            /// The finite limits with their names.
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
    /// Maximum numbers of scattering events of a path by kind, `u32::MAX` for unlimited. The path ends after the event that reaches
    /// a limit, including its light sample and the emission hit by its last ray. Limits are biased. (Cycles doesn't count the last
    /// event: its 0 is 1 here.)
    #[derive(Eq)]
    BounceLimits: u32 = u32::MAX; {
        /// Diffuse reflection.
        diffuse,
        /// Glossy and mirror reflection.
        glossy,
        /// Refraction and diffuse transmission.
        transmission,
        /// Scattering in media, except subsurface scattering.
        volume,
        /// Surfaces passed by alpha transparency: after the last one, the path ends at the next surface. For shadow rays, the surfaces
        /// passed by their path count too, and the limit is one lower.
        transparent,
        /// Consecutive subsurface scattering events in a solid that contains no light.
        subsurface,
    }
}

named_limits! {
    /// Maximum contribution of a path, as the mean of its three channels after weighting, infinite without clamping; brighter ones
    /// are scaled down. Removes fireflies at the cost of bias.
    Clamp: f32 = f32::INFINITY; {
        /// Contributions with at most one scattering event.
        direct,
        /// Contributions with several scattering events.
        indirect,
    }
}

impl BounceLimits {
    /// Whether some kind other than transparent and subsurface is limited.
    pub fn limit_scattering(&self) -> bool {
        BounceLimits { transparent: u32::MAX, subsurface: u32::MAX, ..*self } != BounceLimits::NONE
    }
}

/// Disabled caustics, as by Cycles' Reflective and Refractive Caustics options: surfaces hit by rays after diffuse scattering have
/// no glossy reflection or no transmission. Removes noise at the cost of bias.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkippedCaustics {
    /// No glossy reflection.
    pub reflective: bool,
    /// No transmission.
    pub refractive: bool,
}

impl SkippedCaustics {
    /// All caustics are rendered.
    pub const NONE: SkippedCaustics = SkippedCaustics { reflective: false, refractive: false };
}

/// Defines the render settings of scene files: name, type and description.
macro_rules! scene_settings {
    ($($name:ident: $type:ty, $help:literal;)*) => {
        /// Render settings of a scene file; `None` if unset.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Settings {
            $(
                #[doc = concat!($help, ".")]
                pub $name: Option<$type>,
            )*
        }

        impl Settings {
            /// These settings, with unset ones taken from `other`.
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
    clamp: Clamp, "Clamping of path contributions";
    filter_glossy: f32, "Glossy filter: minimum roughness of surfaces after a rough bounce; 0 is off";
    skip_caustics: SkippedCaustics, "Caustics to disable";
    terminator: ShadowTerminator, "Remedy for the shadow terminator of meshes with shading normals";
    seed: u32, "Random seed";
    filter: Filter, "Reconstruction filter";
    filter_radius: f32, "Radius of the reconstruction filter in pixels";
    energy_compensation: EnergyCompensation, "Energy compensation of rough surfaces; `microfacet` in scene files";
    fresnel: FresnelModel, "Fresnel term of the dielectric layers of glTF materials";
    spectral: bool, "Spectral rendering: sample wavelengths instead of red, green and blue";
    exposure: f32, "Exposure of PNG and other display-referred output, stops";
    view: ViewTransform, "View transform of display-referred output";
    white_balance: f32, "White balance of display-referred output: colour temperature that looks white, kelvin";
    noise: f32, "Noise threshold: estimated relative error of the image to stop at, of the denoised image if it is denoised, percent; `samples` is the maximum then";
    denoise: bool, "Denoise the finished image";
    crop: [u32; 4], "Pixels to render: first column and row, and the column and row after the last";
    aovs: Vec<String>, "AOVs (render passes) to write as further EXR channels, by name";
    caught: CatcherOutput, "Output of shadow catchers";
}

impl Settings {
    /// Scattering options, with defaults for unset ones.
    pub fn shading(&self) -> ShadingModel {
        ShadingModel {
            energy_compensation: self.energy_compensation.unwrap_or_default(),
            fresnel: self.fresnel.unwrap_or_default(),
            spectral: self.spectral.unwrap_or_default(),
        }
    }
}
