//! `--quality`: how many samples a picture gets and whether it is denoised, in one word.

use super::args::RenderArgs;
use super::pictures::is_part;
use clap::ValueEnum;
use oscura::render::Adaptive;
use oscura::scene::Settings;

/// A quality. Without `--quality` it is `Normal`, unless the user or the scene says how many samples to take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Quality {
    /// 8 samples per pixel, denoised: a look at composition and light.
    Draft,
    /// Noise below 12 % before denoising.
    Normal,
    /// Noise below 3 % before denoising.
    High,
    /// Noise below 1 %, not denoised: the error is that of the samples alone.
    Final,
}

/// What a quality stands for.
struct Preset {
    /// Noise threshold, percent; without one, all samples are taken.
    noise: Option<f32>,
    /// Most samples per pixel.
    samples: u32,
    denoise: bool,
}

impl Quality {
    fn preset(self) -> Preset {
        match self {
            Quality::Draft => Preset { noise: None, samples: 8, denoise: true },
            Quality::Normal => Preset { noise: Some(12.0), samples: 256, denoise: true },
            Quality::High => Preset { noise: Some(3.0), samples: 2048, denoise: true },
            Quality::Final => Preset { noise: Some(1.0), samples: 65_536, denoise: false },
        }
    }

    /// The word of `--quality`.
    pub fn name(self) -> &'static str {
        match self {
            Quality::Draft => "draft",
            Quality::Normal => "normal",
            Quality::High => "high",
            Quality::Final => "final",
        }
    }

    /// True if the picture's error is promised to be below the noise threshold.
    pub fn promises_error(self) -> bool {
        !self.preset().denoise
    }
}

/// The quality of a render: what `--quality` says, or `Normal` where neither the user nor the scene says how many samples to take. Parts
/// of pictures have none, since all parts need the same number of samples.
fn quality_of(args: &RenderArgs, settings: &Settings) -> Option<Quality> {
    let long = &args.long;
    let is_counted = args.spp.is_some() || long.noise.is_some() || args.adaptive == Adaptive::Auto;
    let of_scene = settings.samples.is_some() || settings.noise.is_some();
    let of_part = long.sample_range.is_some() || long.region.is_some() || long.plan.is_some();
    let has_parts = of_part || args.output.iter().any(|path| is_part(path));
    args.quality.or((!is_counted && !of_scene && !has_parts).then_some(Quality::Normal))
}

/// Puts what the quality stands for into the arguments.
pub(super) fn apply(args: &mut RenderArgs, settings: &Settings) {
    args.quality = quality_of(args, settings);
    let Some(Preset { noise, samples, denoise }) = args.quality.map(Quality::preset) else { return };
    args.picture.denoise |= denoise && !args.picture.no_denoise;
    args.long.noise = noise;
    match noise {
        Some(_) => args.long.max_spp = args.long.max_spp.or(Some(samples)),
        None => args.spp = Some(samples),
    }
}
