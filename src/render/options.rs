//! Everything about a picture that is settled before it is rendered.

use crate::error::{Error, Result};
use crate::film::{AovSet, AovSpace, MATTE_LEVELS};
use crate::integrator::reuse::GroupShape;
use crate::output::part::Region;
use crate::scene::{CatcherOutput, Filter};
use std::str::FromStr;
use std::time::Duration;

/// Whether neighbouring pixels share the paths that they find. Pictures have the same mean either way; sharing takes noise
/// of indirect light out of pixels, but not out of averages over more pixels than a group has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PathReuse {
    /// Where the picture gains by it, as some squares of the first pass with two samples or more tell (among the first
    /// eight samples, and in pictures of some 200 x 200 pixels or more).
    #[default]
    Auto,
    /// Never.
    Off,
    /// Everywhere, in groups of this shape.
    Groups(GroupShape),
}

/// Whether several paths go on from the first surface of each sample, which lowers the noise of what follows for less than
/// more samples would.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Splitting {
    /// As many as the picture gains most by, as some squares of the first pass tell, where it gains more than by sharing
    /// paths: see [`PathReuse::Auto`].
    #[default]
    Auto,
    /// So many: 2, 4, 8 or 16, and then paths are not shared; or 1.
    Into(u32),
}

impl Splitting {
    /// One path from each sample.
    pub const OFF: Splitting = Splitting::Into(1);

    /// Most paths.
    pub const MOST: u32 = 16;
}

/// Whether caustics are found from the lamp: light that smooth glass, mirrors or polished metal send from lamps to diffuse surfaces,
/// and these to others, up to one that the camera sees directly. Pictures have the same mean either way, but for lamps without a size (points,
/// spots, suns without an angle): only this finds what they send through smooth glass and by mirrors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Caustics {
    /// Where the picture gains by it, as some paths from lamps tell before the first pass, or where nothing else finds the
    /// light. Not in scenes with media that scatter or with thin sheets of glass, where something moves, where things are
    /// visible to some kinds of rays only, with holdouts or shadow catchers, and with [adaptive sampling](Adaptive).
    #[default]
    Auto,
    /// Wherever that is possible.
    On,
    /// Never.
    Off,
}

/// Whether paths are guided to where light came from, at diffuse surfaces, and ended where little is expected of them. Some paths
/// learn that before the first pass, for a fifth of the work that is planned. Pictures have the same mean either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Guiding {
    /// Where what diffuse surfaces receive from others is noisy, and what was learned makes it less so, as some paths tell before (a
    /// three-hundredth of the work that is planned, and more where it is noisy).
    #[default]
    Auto,
    /// Where there are diffuse surfaces and samples enough to learn.
    On,
    /// Never.
    Off,
}

/// Which pixels get how many samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Adaptive {
    /// All pixels the same number.
    #[default]
    Off,
    /// After the first eight samples of all pixels, more where neighbouring pixels are noisy and fewer elsewhere, if there
    /// are sixteen samples or more, the picture should gain by it, has no time limit, and its pixels don't share paths. The
    /// noisiest pixels gain; others lose. (A textured helmet under a sky: the mean squared error without the worst thousandth
    /// of pixels falls by a tenth to a fifth at the same processor time, the median one rises by a quarter.)
    Auto,
}

/// How good the tree over a scene's triangles is, which rays walk. Pictures don't depend on it; full trees make rays faster
/// and take longer to build.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum TreeChoice {
    /// Fast where fewer camera rays will be traced than four for each of 130,000 triangles or more, else full. (With a time
    /// limit, of which nobody knows how many samples it allows, a million camera rays a second are counted at most.)
    #[default]
    Auto,
    /// The tree that is built soon.
    Fast,
    /// The best tree.
    Full,
}

/// How to render, settled in full. [`Renderer`](super::Renderer) makes them from what is chosen there, what the scene
/// says, and the defaults given here.
///
/// ```
/// use oscura::render::RenderOptions;
/// let options = RenderOptions::default().size(640, 360).samples(16).seed(7);
/// assert_eq!((options.width, options.max_depth), (640, 100));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RenderOptions {
    /// Picture width in pixels. Default 1280.
    pub width: u32,
    /// Picture height in pixels. Default 720.
    pub height: u32,
    /// Samples per pixel. Default 128.
    pub samples: u32,
    /// Samples per pixel that rendering may go on to later. How samples are arranged over the picture depends on how many
    /// are planned, up to 256; from 257 on, any number may be gone on from to any other. Default 0: no more than `samples`.
    pub planned: u32,
    /// Take only the samples from the first to before the second of these of each pixel, in blocks of
    /// [`SAMPLE_BLOCK`](super::SAMPLE_BLOCK). Default all.
    pub sample_range: Option<(u32, u32)>,
    /// Take only these pixels. Default all.
    pub region: Option<Region>,
    /// Seed of all randomness. Default 0.
    pub seed: u32,
    /// Maximum number of scattering events of a path; 0 shows emission only. Default 100.
    pub max_depth: u32,
    /// Reconstruction filter. Default Blackman-Harris.
    pub filter: Filter,
    /// Which AOVs to record besides colour. Default none.
    pub aovs: AovSet,
    /// Which space those of places and directions are in. Default [`AovSpace::World`].
    pub aov_space: AovSpace,
    /// Ranks of ids of the mattes among the AOVs. Default [`MATTE_LEVELS`].
    pub matte_levels: u32,
    /// Record the light of each of the scene's groups of lights besides colour. Default false.
    pub light_groups: bool,
    /// Tell what shadow catchers catch: see [`Film::settle_catchers`](crate::film::Film::settle_catchers). Default false.
    pub catchers: bool,
    /// What is shown of that. Default [`CatcherOutput::All`].
    pub caught: CatcherOutput,
    /// Make the picture transparent where smooth glass is before nothing: a sample whose path passes from the camera through
    /// smooth surfaces only, by transmission, and leaves the scene there doesn't show the environment, and its alpha is 1 less
    /// the mean of the path's throughput over the three channels. Reflections stay opaque. Default false.
    pub transparent_glass: bool,
    /// Keep the colour of the first half of each pixel's samples apart: see [`Film::halves`](crate::film::Film::halves).
    /// Default false.
    pub halves: bool,
    /// Soften the shadow terminator of surfaces with shading normals, which otherwise shows their triangles. Default
    /// true.
    pub soft_terminator: bool,
    /// Whether neighbouring pixels share paths. Default [`PathReuse::Auto`].
    pub path_reuse: PathReuse,
    /// Into how many paths samples split. Default [`Splitting::Auto`].
    pub splitting: Splitting,
    /// Whether caustics are found from the lamp. Default [`Caustics::Auto`].
    pub caustics: Caustics,
    /// Whether paths are guided. Default [`Guiding::Auto`].
    pub guiding: Guiding,
    /// Whether noisy pixels get more samples. Default [`Adaptive::Off`].
    pub adaptive: Adaptive,
    /// Fewest samples of a pixel where an error decides: rendering doesn't stop by [`RenderOptions::noise`] before, and
    /// [`Adaptive::Auto`] gives none fewer (at most [`RenderOptions::samples`]). Default 0.
    pub least_samples: u32,
    /// Most samples that [`Adaptive::Auto`] gives to a pixel (at least [`RenderOptions::samples`], which are those of the average
    /// one, and at most eight times that). Default no limit of its own.
    pub most_samples: u32,
    /// Stop when the estimated relative error of the whole picture is this or less: the root of the mean over pixels and
    /// colours of `(x - r)^2 / (r^2 + 0.01)`, where `x` is the picture and `r` what it would be with all samples there are.
    /// Default none.
    pub noise: Option<f32>,
    /// Stop after rendering for this time. The number of samples then depends on the machine. Default none.
    pub time_limit: Option<Duration>,
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
            (_, Ok(branches @ (1 | 2 | 4 | 8 | Splitting::MOST))) => Ok(Splitting::Into(branches)),
            _ => Err(Error::usage(format!("'{text}' is no way to split paths"))
                .with_help("give auto, off, 2, 4, 8 or 16")),
        }
    }
}

impl FromStr for Adaptive {
    type Err = Error;

    /// Reads `auto` or `off`.
    ///
    /// # Errors
    /// A usage error.
    fn from_str(text: &str) -> Result<Adaptive> {
        match text {
            "auto" => Ok(Adaptive::Auto),
            "off" => Ok(Adaptive::Off),
            _ => Err(Error::usage(format!("'{text}' is neither auto nor off"))),
        }
    }
}

impl FromStr for Caustics {
    type Err = Error;

    /// Reads `auto`, `on` or `off`.
    ///
    /// # Errors
    /// A usage error.
    fn from_str(text: &str) -> Result<Caustics> {
        match text {
            "auto" => Ok(Caustics::Auto),
            "on" => Ok(Caustics::On),
            "off" => Ok(Caustics::Off),
            _ => Err(Error::usage(format!("'{text}' is neither auto nor on nor off"))),
        }
    }
}

impl FromStr for Guiding {
    type Err = Error;

    /// Reads `auto`, `on` or `off`.
    ///
    /// # Errors
    /// A usage error.
    fn from_str(text: &str) -> Result<Guiding> {
        match text {
            "auto" => Ok(Guiding::Auto),
            "on" => Ok(Guiding::On),
            "off" => Ok(Guiding::Off),
            _ => Err(Error::usage(format!("'{text}' is neither auto nor on nor off"))),
        }
    }
}

impl Default for RenderOptions {
    fn default() -> RenderOptions {
        RenderOptions {
            width: 1280,
            height: 720,
            samples: 128,
            planned: 0,
            sample_range: None,
            region: None,
            seed: 0,
            max_depth: 100,
            filter: Filter::default(),
            aovs: AovSet::NONE,
            aov_space: AovSpace::World,
            matte_levels: MATTE_LEVELS,
            light_groups: false,
            catchers: false,
            caught: CatcherOutput::default(),
            transparent_glass: false,
            halves: false,
            soft_terminator: true,
            path_reuse: PathReuse::default(),
            splitting: Splitting::default(),
            caustics: Caustics::default(),
            guiding: Guiding::default(),
            adaptive: Adaptive::default(),
            least_samples: 0,
            most_samples: u32::MAX,
            noise: None,
            time_limit: None,
        }
    }
}

impl RenderOptions {
    /// Sets width and height in pixels.
    #[must_use]
    pub fn size(self, width: u32, height: u32) -> RenderOptions {
        RenderOptions { width, height, ..self }
    }

    /// Sets the number of samples per pixel.
    #[must_use]
    pub fn samples(self, samples: u32) -> RenderOptions {
        RenderOptions { samples, ..self }
    }

    /// Sets to how many samples per pixel rendering may go on later.
    #[must_use]
    pub fn planned(self, planned: u32) -> RenderOptions {
        RenderOptions { planned, ..self }
    }

    /// Sets which samples of each pixel are taken.
    #[must_use]
    pub fn sample_range(self, sample_range: impl Into<Option<(u32, u32)>>) -> RenderOptions {
        RenderOptions { sample_range: sample_range.into(), ..self }
    }

    /// Sets which pixels are taken.
    #[must_use]
    pub fn region(self, region: impl Into<Option<Region>>) -> RenderOptions {
        RenderOptions { region: region.into(), ..self }
    }

    /// Sets the seed of all randomness.
    #[must_use]
    pub fn seed(self, seed: u32) -> RenderOptions {
        RenderOptions { seed, ..self }
    }

    /// Sets the maximum number of scattering events of a path.
    #[must_use]
    pub fn max_depth(self, max_depth: u32) -> RenderOptions {
        RenderOptions { max_depth, ..self }
    }

    /// Sets the reconstruction filter.
    #[must_use]
    pub fn filter(self, filter: Filter) -> RenderOptions {
        RenderOptions { filter, ..self }
    }

    /// Sets which AOVs to record besides colour.
    #[must_use]
    pub fn aovs(self, aovs: impl Into<AovSet>) -> RenderOptions {
        RenderOptions { aovs: aovs.into(), ..self }
    }

    /// Sets which space AOVs of places and directions are in.
    #[must_use]
    pub fn aov_space(self, aov_space: AovSpace) -> RenderOptions {
        RenderOptions { aov_space, ..self }
    }

    /// Sets how many ranks of ids mattes have.
    #[must_use]
    pub fn matte_levels(self, matte_levels: u32) -> RenderOptions {
        RenderOptions { matte_levels, ..self }
    }

    /// Sets whether the light of each group of lights is recorded.
    #[must_use]
    pub fn light_groups(self, light_groups: bool) -> RenderOptions {
        RenderOptions { light_groups, ..self }
    }

    /// Sets [`catchers`](RenderOptions::catchers).
    pub fn catchers(self, catchers: bool) -> RenderOptions {
        RenderOptions { catchers, ..self }
    }

    /// Sets whether smooth glass before nothing is transparent.
    #[must_use]
    pub fn transparent_glass(self, transparent_glass: bool) -> RenderOptions {
        RenderOptions { transparent_glass, ..self }
    }

    /// Sets whether the halves of the samples are kept apart.
    #[must_use]
    pub fn halves(self, halves: bool) -> RenderOptions {
        RenderOptions { halves, ..self }
    }

    /// Sets whether the shadow terminator is softened.
    #[must_use]
    pub fn soft_terminator(self, soft_terminator: bool) -> RenderOptions {
        RenderOptions { soft_terminator, ..self }
    }

    /// Sets whether neighbouring pixels share paths.
    #[must_use]
    pub fn path_reuse(self, path_reuse: PathReuse) -> RenderOptions {
        RenderOptions { path_reuse, ..self }
    }

    /// Sets into how many paths samples split.
    #[must_use]
    pub fn splitting(self, splitting: Splitting) -> RenderOptions {
        RenderOptions { splitting, ..self }
    }

    /// Sets whether caustics are found from the lamp.
    #[must_use]
    pub fn caustics(self, caustics: Caustics) -> RenderOptions {
        RenderOptions { caustics, ..self }
    }

    /// Sets whether paths are guided.
    #[must_use]
    pub fn guiding(self, guiding: Guiding) -> RenderOptions {
        RenderOptions { guiding, ..self }
    }

    /// Sets whether noisy pixels get more samples.
    #[must_use]
    pub fn adaptive(self, adaptive: Adaptive) -> RenderOptions {
        RenderOptions { adaptive, ..self }
    }

    /// Sets the fewest and the most samples of a pixel where an error decides on their number.
    #[must_use]
    pub fn sample_limits(self, least_samples: u32, most_samples: u32) -> RenderOptions {
        RenderOptions { least_samples, most_samples, ..self }
    }

    /// Sets the relative error at which rendering stops, or removes it.
    #[must_use]
    pub fn noise(self, noise: impl Into<Option<f32>>) -> RenderOptions {
        RenderOptions { noise: noise.into(), ..self }
    }

    /// Sets the limit on rendering time, or removes it.
    #[must_use]
    pub fn time_limit(self, time_limit: impl Into<Option<Duration>>) -> RenderOptions {
        RenderOptions { time_limit: time_limit.into(), ..self }
    }
}
