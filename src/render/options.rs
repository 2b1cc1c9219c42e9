//! Render settings: one [table](render_settings) of all, the enums among their types, and the resolution of options from the user's
//! choices, the scene's settings and the defaults.

use crate::color::ViewTransform;
use crate::compile::{BvhPolicy, choose_camera};
use crate::error::{Error, Result};
use crate::film::{Aov, AovSet, AovSpace, MATTE_LEVELS};
use crate::integrator::reuse::GroupShape;
use crate::output::part::Region;
use crate::scene::{
    BounceLimits, Camera, CatcherOutput, Clamp, Filter, Scene, Settings, ShadingModel, ShadowTerminator,
    SkippedCaustics,
};
use std::str::FromStr;
use std::time::Duration;

/// Path reuse between neighbouring pixels. The mean of the picture doesn't depend on it; reuse lowers the noise of indirect light in
/// pixels, but not in averages over more pixels than a group has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PathReuse {
    /// If it lowers the noise, by trials on some squares of the first pass with two samples or more (within the first eight samples, and
    /// in pictures of some 200 x 200 pixels or more).
    #[default]
    Auto,
    /// Never.
    Off,
    /// Always, in groups of this shape.
    Groups(GroupShape),
}

/// Path splitting: several paths continue from the first surface of each sample, which lowers the noise of later bounces at less cost
/// than more samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Splitting {
    /// The most efficient number of branches, by trials on some squares of the first pass, if that is more efficient than path reuse: see
    /// [`PathReuse::Auto`].
    #[default]
    Auto,
    /// A number of branches: 1, or 2, 4, 8 or 16, which excludes path reuse.
    Into(u32),
}

impl Splitting {
    /// A single path per sample.
    pub const OFF: Splitting = Splitting::Into(1);

    /// Maximum number of branches.
    pub const MAX: u32 = 16;
}

/// Light tracing of caustics: light via smooth glass, mirrors or polished metal to diffuse surfaces, and from these to others, up to one
/// that is directly visible. The mean of the picture doesn't depend on it, except for lights without a size (points, spots, suns without
/// an angle), whose light via smooth glass and mirrors nothing else samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Caustics {
    /// If it lowers the noise, by a trial of some light paths before the first pass, or if nothing else samples the light. Not in scenes
    /// with scattering media, thin sheets of glass, motion, objects or lights visible to some ray kinds only, holdouts or shadow catchers.
    #[default]
    Auto,
    /// Wherever possible.
    On,
    /// Never.
    Off,
}

/// Path guiding at diffuse surfaces, with Russian roulette by expected contribution. Training before the first pass takes a fifth of the
/// planned samples. The mean of the picture doesn't depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Guiding {
    /// If indirect light at diffuse surfaces is noisy and training lowers the noise, by a trial before the first pass (a three-hundredth
    /// of the planned samples, more if it is noisy).
    #[default]
    Auto,
    /// If there are diffuse surfaces and enough samples for training.
    On,
    /// Never.
    Off,
}

/// Selection of lights for light samples. The mean of the picture doesn't depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum LightSelection {
    /// Learned where that lowers the noise, by a trial before the first pass (a 128th of the planned samples, or less).
    #[default]
    Auto,
    /// By estimates times learned fractions of unoccluded samples, by place.
    Learned,
    /// By estimates of unoccluded irradiance.
    Estimated,
}

named_enum! {
    /// Build quality of the BVH over a scene's triangles. Pictures don't depend on it; a full build takes longer and makes rays faster.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    #[non_exhaustive]
    BvhQuality {
        /// Fast for 130,000 triangles or more and fewer than four camera rays per triangle, else full. (With a time limit, at most a million
        /// camera rays per second are assumed.)
        #[default]
        Auto = "auto",
        /// Fast build.
        Fast = "fast",
        /// The fastest traversal.
        Full = "full",
    }
}

/// The table of render settings. A row is
///
/// `"help", unit, "default" => name: type = default, identity, source; extra documentation`
///
/// where `identity` is how the setting enters the [identity](super::identity) of checkpoints and parts (`named`: an entry of its own;
/// `separate`: an entry written by `checkpoint.rs`; `hashed`: a common fingerprint of all of these; `free`: samples don't depend on it),
/// and `source` is who sets it (`scene(field)`: the user, else that field of the scene's [`Settings`](crate::scene::Settings); `user`;
/// `internal`: no method of [`Renderer`](super::Renderer)).
///
/// The table generates [`RenderOptions`] with defaults and setters, the methods of [`Renderer`](super::Renderer), the merge of the
/// user's choices with the scene's, the help of the command line ([`setting_help`]; except where that names other options) and the
/// identity.
macro_rules! render_settings {
    ($callback:ident) => {
        $callback! {
            "Image width in pixels", "from the height, else 1280" =>
                width: u32 = 1280, separate, internal;
            "Image height in pixels", "from the width and the camera's aspect ratio, else 16:9" =>
                height: u32 = 720, separate, internal;
            "Samples per pixel", "128" => samples: u32 = 128, named("samples"), scene(samples);
            "Arrange the sample pattern for N samples per pixel, so that a render of up to 256 can be resumed to N later", "" =>
                /// The sample pattern depends on this number up to 256; above, any number may be resumed to any other. 0: the
                /// number of `samples`.
                planned: u32 = 0, separate, internal;
            "Render only the samples A to B (exclusive) of each pixel, in blocks of eight, into a .part file", "" =>
                /// In blocks of [`SAMPLE_BLOCK`](super::SAMPLE_BLOCK).
                sample_range: Option<(u32, u32)> = None, free, internal [into];
            "Render only the pixels of a rectangle, its last column and row exclusive", "" =>
                region: Option<Region> = None, free, internal [into];
            "Random seed", "0" => seed: u32 = 0, named("seed"), scene(seed);
            "Maximum number of bounces of a path; 0 renders directly visible emission only", "100" =>
                max_depth: u32 = 100, named("depth"), scene(depth);
            "Maximum numbers of bounces by kind, such as diffuse=5,glossy=5,transmission=13,volume=1,transparent=9,subsurface=256 (transparent: surfaces passed by their alpha; subsurface: scattering beneath a surface in a row); the image loses the light of longer paths", "no limits" =>
                bounces: BounceLimits = BounceLimits::NONE, hashed, scene(bounces);
            "Clamp the contribution of a single path, mean of the channels, such as direct=50,indirect=10 (direct: after at most one bounce). Removes fireflies and, with them, light", "off" =>
                clamp: Clamp = Clamp::NONE, hashed, scene(clamp);
            "Glossy filter, as Cycles' Filter Glossy: roughen what paths hit after a rough bounce, which blurs caustics; 0 is off, 1 is Cycles' default", "0" =>
                filter_glossy: f32 = 0.0, hashed, scene(filter_glossy);
            "Caustics to disable, as in Cycles without Reflective or Refractive Caustics", "none" =>
                skip_caustics: SkippedCaustics = SkippedCaustics::NONE, hashed, scene(skip_caustics);
            "Reconstruction filter", "blackman-harris" =>
                filter: Filter = Filter::default(), named("the filter"), scene(filter);
            "Radius of the reconstruction filter in pixels, 0.005 to 16; Cycles' filter width is the radius of its Blackman-Harris filter", "1.5; 0.5 for box" =>
                /// 0 stands for the filter's default.
                filter_radius: f32 = 0.0, hashed, scene(filter_radius);
            "AOVs (render passes) to write as further EXR channels", "" =>
                aovs: AovSet = AovSet::NONE, separate, user [into];
            "Coordinate space of the AOVs position, normal and geometric_normal: world or camera", "" =>
                aov_space: AovSpace = AovSpace::World, hashed, user;
            "Number of Cryptomatte ranks: ids per pixel", "" =>
                matte_levels: u32 = MATTE_LEVELS, hashed, user;
            "Write the contribution of each light group as EXR channels RGBA_group", "" =>
                light_groups: bool = false, hashed, user;
            "Record shadow catchers", "" =>
                /// See [`Film::resolve_catchers`](crate::film::Film::resolve_catchers).
                catchers: bool = false, hashed, internal;
            "What shadow catchers show", "" =>
                caught: CatcherOutput = CatcherOutput::default(), hashed, internal;
            "With a transparent background, also make smooth glass in front of it transparent; its reflections stay", "" =>
                /// A sample whose path escapes after smooth transmission only doesn't show the environment, and its alpha is 1
                /// minus the mean of the path's throughput over the channels. Reflections stay opaque.
                transparent_glass: bool = false, hashed, user;
            "Keep the colour of the first half of each pixel's samples separate, as denoising needs", "" =>
                /// See [`Film::halves`](crate::film::Film::halves).
                halves: bool = false, separate, user;
            "Shadow terminator of meshes with shading normals: soft fades light out towards the horizon of a triangle, lifted starts shadow rays at the curved surface, as Cycles does", "soft" =>
                terminator: ShadowTerminator = ShadowTerminator::default(), separate, scene(terminator);
            "Path reuse between neighbouring pixels: auto, off, or a pixel block such as 4x4", "auto" =>
                path_reuse: PathReuse = PathReuse::default(), named("path reuse"), user;
            "Path splitting: number of paths that continue from the first hit of each camera ray; auto, off, 2, 4, 8 or 16", "auto" =>
                splitting: Splitting = Splitting::default(), named("splitting"), user;
            "Trace caustics from the lights: light focused by smooth glass, mirrors and polished metal onto diffuse surfaces that the camera sees directly; auto (where it lowers the noise), on or off. Caustics of point, spot and sun lights without a size are found in no other way", "" =>
                caustics: Caustics = Caustics::default(), hashed, user;
            "Path guiding at diffuse surfaces, with guided Russian roulette: on, off, or auto, where it lowers the noise of indirect light. Training takes a fifth of the samples of the whole image, also for a part of it; rooms lit through a door gain several times that", "" =>
                guiding: Guiding = Guiding::default(), named("guiding"), user;
            "Selection of lights: by estimates of their irradiance, or also learned where they are occluded, as in buildings with many lamps; auto where that lowers the noise, learned or estimated", "" =>
                light_selection: LightSelection = LightSelection::default(), named("light selection"), user;
            "Minimum samples per pixel with a noise threshold", "" =>
                /// At most `samples`.
                min_samples: u32 = 0, free, internal;
            "Noise threshold: stop when the estimated relative error of the image is below this, or after the maximum of samples", "" =>
                /// As a fraction: the root of the mean over pixels and channels of `(x - r)^2 / (r^2 + 0.01)`, with the picture
                /// `x` and the converged picture `r`.
                noise: Option<f32> = None, free, internal [into];
            "The finished picture will be denoised: the noise threshold bounds the error of the denoised picture", "" =>
                denoises: bool = false, free, internal;
            "Time limit of rendering, seconds; the image so far is written", "" =>
                /// The number of samples then depends on the machine.
                time_limit: Option<Duration> = None, free, user [into];
        }
    };
}
pub(super) use render_settings;

/// Type of a setter's parameter.
macro_rules! parameter {
    ($type:ty) => { $type };
    ($type:ty, into) => { impl Into<$type> };
}
pub(super) use parameter;

/// The identity entry of a `named` setting.
macro_rules! identity_entry {
    ($entries:ident, $value:expr, named, $entry:literal) => {
        $entries.push(($entry, format!("{:?}", $value)))
    };
    ($($other:tt)*) => {};
}

/// Copies a `hashed` setting.
macro_rules! copy_if_hashed {
    ($to:ident, $from:ident, $name:ident, hashed) => {
        $to.$name = $from.$name
    };
    ($($other:tt)*) => {};
}

/// Copies a setting from a scene's, if set there.
macro_rules! take_from_scene {
    ($options:ident, $settings:ident, $name:ident, scene, $field:ident) => {
        $options.$name = $settings.$field.unwrap_or($options.$name)
    };
    ($($other:tt)*) => {};
}

macro_rules! define_render_options {
    ($(
        $help:literal, $shown:literal => $(#[$more:meta])* $name:ident: $type:ty = $default:expr,
        $identity:ident $(($entry:literal))?, $source:ident $(($field:ident))? $([$into:ident])?;
    )*) => {
        /// All render settings of a picture. [`Renderer`](super::Renderer) resolves them from the user's choices, the scene's, and
        /// the defaults.
        ///
        /// ```
        /// use oscura::render::RenderOptions;
        /// let options = RenderOptions::default().size(640, 360).samples(16).seed(7);
        /// assert_eq!((options.width, options.max_depth), (640, 100));
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct RenderOptions {
            $(
                #[doc = concat!($help, ".")]
                ///
                $(#[$more])*
                #[doc = concat!("\n\nDefault: `", stringify!($default), "`.")]
                pub $name: $type,
            )*
        }

        impl Default for RenderOptions {
            fn default() -> RenderOptions {
                RenderOptions { $($name: $default,)* }
            }
        }

        impl RenderOptions {
            $(
                #[doc = concat!("Sets [`", stringify!($name), "`](RenderOptions::", stringify!($name), "): ", $help, ".")]
                #[must_use]
                pub fn $name(self, $name: parameter!($type $(, $into)?)) -> RenderOptions {
                    RenderOptions { $name: $name.into(), ..self }
                }
            )*

            /// Overridden by the settings of a scene.
            #[must_use]
            pub(super) fn with_settings(mut self, settings: &Settings) -> RenderOptions {
                $( take_from_scene!(self, settings, $name, $source $(, $field)?); )*
                self
            }

            /// The identity entries of `named` settings.
            pub(super) fn identity_entries(&self) -> Vec<(&'static str, String)> {
                let mut entries = Vec::new();
                $( identity_entry!(entries, self.$name, $identity $(, $entry)?); )*
                entries
            }

            /// The `hashed` settings; the others have their defaults.
            pub(super) fn hashed(&self) -> RenderOptions {
                let mut hashed = RenderOptions::default();
                $( copy_if_hashed!(hashed, self, $name, $identity); )*
                hashed
            }
        }

        /// Name, help text and default of each setting.
        const SETTINGS: &[(&str, &str, &str)] = &[$((stringify!($name), $help, $shown),)*];
    };
}
render_settings!(define_render_options);

/// The help text of a setting of [`RenderOptions`], with its default; empty for unknown names.
#[doc(hidden)]
pub fn setting_help(name: &str) -> String {
    let found = SETTINGS.iter().find(|(own, ..)| *own == name);
    found.map_or_else(String::new, |(_, help, default)| match *default {
        "" => (*help).to_string(),
        default => format!("{help} [default: {default}]"),
    })
}

impl RenderOptions {
    /// Sets width and height in pixels.
    #[must_use]
    pub fn size(self, width: u32, height: u32) -> RenderOptions {
        RenderOptions { width, height, ..self }
    }

    /// Is any of bounce limits by kind, clamping, glossy filter or disabled caustics in use?
    pub(super) fn limits_paths(&self) -> bool {
        self.bounces.limit_scattering()
            || self.clamp != Clamp::NONE
            || self.filter_glossy > 0.0
            || self.skip_caustics != SkippedCaustics::NONE
    }
}

impl FromStr for PathReuse {
    type Err = Error;

    /// Reads `auto`, `off`, or a shape as [`GroupShape`] is written.
    ///
    /// # Errors
    /// A usage error.
    fn from_str(text: &str) -> Result<PathReuse> {
        match text {
            "auto" => Ok(PathReuse::Auto),
            "off" => Ok(PathReuse::Off),
            _ => text.parse().map(PathReuse::Groups),
        }
    }
}

impl FromStr for Splitting {
    type Err = Error;

    /// Reads `auto`, `off`, or a number of paths.
    ///
    /// # Errors
    /// A usage error.
    fn from_str(text: &str) -> Result<Splitting> {
        match (text, text.parse()) {
            ("auto", _) => Ok(Splitting::Auto),
            ("off", _) => Ok(Splitting::OFF),
            (_, Ok(branches @ (1 | 2 | 4 | 8 | Splitting::MAX))) => Ok(Splitting::Into(branches)),
            _ => Err(Error::usage(format!("'{text}' is not a number of paths for splitting"))
                .with_help("give auto, off, 2, 4, 8 or 16")),
        }
    }
}

/// Parses enums from command-line words.
macro_rules! from_words {
    ($($type:ident: $($word:literal => $value:ident),*;)*) => {$(
        impl FromStr for $type {
            type Err = Error;

            #[doc = concat!("Reads ", $("`", $word, "` ",)* ".")]
            ///
            /// # Errors
            /// A usage error.
            fn from_str(text: &str) -> Result<$type> {
                match text {
                    $($word => Ok($type::$value),)*
                    _ => Err(Error::usage(format!("'{text}' is not one of {}", [$($word),*].join(", ")))),
                }
            }
        }
    )*};
}
from_words! {
    Caustics: "auto" => Auto, "on" => On, "off" => Off;
    Guiding: "auto" => Auto, "on" => On, "off" => Off;
    LightSelection: "auto" => Auto, "learned" => Learned, "estimated" => Estimated;
}

const DEFAULT_ASPECT: f64 = 16.0 / 9.0;
/// Maximum number of pixels of a whole picture.
const PIXEL_LIMIT: u64 = u32::MAX as u64;

/// A user's choices; others are taken from the scene, else from the defaults of [`RenderOptions`].
#[doc(hidden)]
#[derive(Clone, Debug, Default)]
pub struct RequestedOptions {
    /// Settings that override the scene's.
    pub settings: Settings,
    /// Name or index of a camera; by default the first.
    pub camera: Option<String>,
    pub bvh: BvhQuality,
    /// Settings that scenes don't have; the rest are defaults.
    pub options: RenderOptions,
}

/// All options of a picture, resolved before rendering.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct ResolvedOptions {
    /// Render settings.
    pub options: RenderOptions,
    /// Shading models common to all materials.
    pub shading: ShadingModel,
    pub bvh: BvhQuality,
    /// Index of the camera in the scene.
    pub camera: Option<usize>,
    /// Settings of display-referred pictures.
    pub display: DisplaySettings,
}

/// Settings of display-referred pictures: PNG and other formats except EXR.
#[doc(hidden)]
#[derive(Clone, Debug, Default)]
pub struct DisplaySettings {
    /// Exposure, stops.
    pub exposure: f32,
    pub view: ViewTransform,
    /// White balance: colour temperature that is displayed as white, kelvin.
    pub white_balance: Option<f32>,
}

impl RequestedOptions {
    /// Resolves the options for a scene.
    ///
    /// # Errors
    /// A usage error for a camera that the scene doesn't have and for a picture with too many pixels.
    pub fn resolve(&self, scene: &Scene) -> Result<ResolvedOptions> {
        let camera = self.camera.as_deref().map(|wanted| find_camera(scene, wanted)).transpose()?;
        let (width, height) = self.picture_size(scene, camera.unwrap_or(0))?;
        let settings = self.settings.or(&scene.settings);
        let mut options = self.options.with_settings(&settings).size(width, height);
        options.aovs = options.aovs.union(aovs_of(&settings)?);
        options.catchers = scene.has_catchers();
        options.caught = settings.caught.unwrap_or_default();
        Ok(ResolvedOptions {
            options,
            shading: settings.shading(),
            bvh: self.bvh,
            camera,
            display: DisplaySettings {
                exposure: settings.exposure.unwrap_or(0.0),
                view: settings.view.unwrap_or_default(),
                white_balance: settings.white_balance,
            },
        })
    }

    /// Checks a given size before a scene is loaded.
    ///
    /// # Errors
    /// A usage error.
    pub fn check_size(&self) -> Result<()> {
        match (self.settings.width, self.settings.height) {
            (Some(width), Some(height)) => check_pixels(width, height),
            _ => Ok(()),
        }
    }

    fn picture_size(&self, scene: &Scene, camera: usize) -> Result<(u32, u32)> {
        let (chosen, from_scene) = (&self.settings, &scene.settings);
        let camera = scene.cameras.get(camera);
        let of_camera = camera.and_then(|c| c.aspect_ratio).filter(|a| *a > 0.0 && a.is_finite());
        // Ratio of width to height in pixels.
        let aspect = match (from_scene.width, from_scene.height) {
            (Some(w), Some(h)) => f64::from(w) / f64::from(h),
            _ => of_camera.unwrap_or(DEFAULT_ASPECT) / camera.map_or(1.0, |c| c.pixel_aspect),
        };
        // If only one dimension is chosen, the other follows from the aspect ratio, not from the scene.
        let size = match (chosen.width, chosen.height) {
            (None, None) => (from_scene.width, from_scene.height),
            size => size,
        };
        let rounded = |v: f64| v.round().clamp(1.0, 65_536.0) as u32;
        let (width, height) = match size {
            (Some(w), Some(h)) => (w, h),
            (Some(w), None) => (w, rounded(f64::from(w) / aspect)),
            (None, Some(h)) => (rounded(f64::from(h) * aspect), h),
            (None, None) => {
                let width = RenderOptions::default().width;
                (width, rounded(f64::from(width) / aspect))
            }
        };
        check_pixels(width, height)?;
        Ok((width, height))
    }
}

/// The AOVs named by settings.
fn aovs_of(settings: &Settings) -> Result<AovSet> {
    let all = |name: &str| (name == ALL_AOVS).then(AovSet::all);
    let set = |name: &String| all(name).map_or_else(|| name.parse::<Aov>().map(AovSet::from), Ok);
    settings.aovs.iter().flatten().try_fold(AovSet::NONE, |sum, name| Ok(sum.union(set(name)?)))
}

/// The name for all AOVs in lists.
pub const ALL_AOVS: &str = "all";

/// Assumed camera rays per second under a time limit: about the speed of two cores in simple scenes.
const RAYS_A_SECOND: f64 = 1e6;

impl ResolvedOptions {
    /// The build quality of the BVH for rendering `pictures` pictures.
    pub fn bvh(&self, pictures: u64) -> BvhPolicy {
        let RenderOptions { width, height, samples, time_limit, .. } = self.options;
        let rays = u64::from(width) * u64::from(height) * u64::from(samples);
        let most = time_limit.map_or(u64::MAX, |limit| (limit.as_secs_f64() * RAYS_A_SECOND) as u64);
        match self.bvh {
            BvhQuality::Auto => BvhPolicy::For { camera_rays: rays.min(most).saturating_mul(pictures) },
            BvhQuality::Fast => BvhPolicy::Fast,
            BvhQuality::Full => BvhPolicy::Full,
        }
    }

    /// The camera in the scene for which options were resolved.
    ///
    /// # Errors
    /// An input error for a scene without a camera.
    pub fn camera<'a>(&self, scene: &'a Scene) -> Result<&'a Camera> {
        choose_camera(scene, self.camera)
    }
}

fn find_camera(scene: &Scene, wanted: &str) -> Result<usize> {
    let by_name = scene.cameras.iter().position(|c| c.name == wanted);
    let by_number = || wanted.parse().ok().filter(|&i: &usize| i < scene.cameras.len());
    by_name.or_else(by_number).ok_or_else(|| {
        let names: Vec<String> =
            scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} '{}'", c.name)).collect();
        Error::usage(format!("there is no camera '{wanted}'"))
            .with_help(format!("the scene has: {}", names.join(", ")))
    })
}

fn check_pixels(width: u32, height: u32) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(Error::usage(format!("a picture of {width} x {height} pixels is empty")));
    }
    if u64::from(width) * u64::from(height) > PIXEL_LIMIT {
        let message = format!("{width} x {height} pixels are more than the {PIXEL_LIMIT} possible");
        return Err(Error::usage(message).with_help("give a smaller width or height"));
    }
    Ok(())
}
