//! Options of pictures: `--quality`, view transform, EXR layout, crop and overscan; arguments of the commands that read pictures.

use super::parsers::{FRAME_RATE, Frames, frames_per_second, integer, named, number, region, stops};
use clap::builder::{PossibleValue, PossibleValuesParser, StringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use oscura::error::{Error, Result, Warning};
use oscura::film::PixelType;
use oscura::output::part::Region;
use oscura::output::{
    ExrCompression, ExrLayout, ExrOptions, ExrWindow, ViewTransform, WorkingSpace, read_view,
};
use oscura::render::{Caustics, setting_help};
use oscura::scene::{Backdrop, Camera, Projection};
use serde::Serialize;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Parser of view transforms: a name, or the file of a lookup table.
pub(super) fn views() -> Views {
    Views
}

#[derive(Clone)]
pub(super) struct Views;

impl TypedValueParser for Views {
    type Value = ViewTransform;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> std::result::Result<ViewTransform, clap::Error> {
        let is_file = value.to_str().is_some_and(ViewTransform::is_file);
        match is_file {
            true => {
                let read = |name: String| read_view(Path::new(&name));
                StringValueParser::new().try_map(read).parse_ref(command, argument, value)
            }
            false => {
                let named = |name: String| ViewTransform::from_name(&name).ok_or("unknown view transform");
                PossibleValuesParser::new(named_views()).try_map(named).parse_ref(command, argument, value)
            }
        }
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(named_views()))
    }
}

fn named_views() -> impl Iterator<Item = PossibleValue> {
    ViewTransform::NAMED.into_iter().map(|(_, name, about)| PossibleValue::new(name).help(about))
}

#[derive(Args, Clone, Debug)]
pub(crate) struct PictureArgs {
    #[arg(long, help = setting_help("caustics"), value_name = "C", default_value = "auto")]
    pub caustics: Caustics,
    /// Denoise the finished image, its light passes and light groups.
    ///
    /// Images of --save-every stay noisy and contain the guides for 'oscura denoise'; .part files are denoised by 'oscura
    /// merge'.
    #[arg(long)]
    pub denoise: bool,
    /// Do not denoise, even if the scene file enables it.
    #[arg(long, conflicts_with = "denoise")]
    pub no_denoise: bool,
    /// Denoise each frame of a sequence on its own, without the two frames before and after it.
    #[arg(long, conflicts_with = "no_denoise")]
    pub denoise_alone: bool,
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// White balance of PNG and other display-referred output: colour temperature that looks white, kelvin (1667 to
    /// 25000; daylight is 6500).
    #[arg(long, value_name = "K", value_parser = kelvin, allow_negative_numbers = true)]
    pub white_balance: Option<f32>,
    /// Write PNGs and TIFFs with 16 bits per channel.
    #[arg(long)]
    pub deep: bool,
}

fn kelvin(text: &str) -> std::result::Result<f32, String> {
    let fits = |v| (1667.0..=25_000.0).contains(&v);
    number(text, fits, "a number of kelvin from 1667 to 25000").map(|v| v as f32)
}

#[derive(Args, Debug)]
pub(crate) struct DenoiseArgs {
    /// Image to denoise (.exr) with R, G, B; better with the guides albedo.R, .G, .B and N.X, .Y, .Z (--aov albedo,normal).
    /// With #### instead of the number, all frames of a sequence, each averaged with its neighbours by motion vectors
    /// (--aov motion).
    pub picture: PathBuf,
    /// Output file (.exr; with #### for sequences): all channels of the input, with colour and light passes denoised.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Frames of the sequence to denoise, such as 7, 1-10 or 1-10x2 [default: all]. Up to two frames before and after are also
    /// read.
    #[arg(long, value_name = "A-B")]
    pub frames: Option<Frames>,
    /// The same image rendered with another seed: both are averaged, and their difference estimates the noise. Without
    /// it, the noise is estimated from the channels variance.R, .G, .B (--aov variance), else from the image itself.
    #[arg(long, value_name = "FILE")]
    pub other_seed: Option<PathBuf>,
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// Number of threads [default: one per core]. The image does not depend on it.
    #[arg(long, value_name = "N", value_parser = integer::<u16>(1, 1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// Image (.exr).
    pub picture: PathBuf,
    /// Print one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConvertArgs {
    /// Image (.exr); with #### instead of the number, all frames of a sequence.
    pub picture: PathBuf,
    /// Output file: .png, .jpg, .tif, .webp or .hdr; for sequences with ####, or one .gif, .apng, .mp4 or .webm.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Frame rate of .gif, .apng, .mp4 and .webm, frames per second.
    #[arg(long, value_name = "N", default_value_t = FRAME_RATE, value_parser = frames_per_second, allow_negative_numbers = true)]
    pub fps: f64,
    /// Layer, part or channel to convert instead of the combined image: N, DiffDir, Z, ...
    ///
    /// Depths, directions, positions, ids and mattes are scaled to their ranges or shown in false colours, as by --sheet.
    /// In .hdr files, with --deep and in animation files they keep their values.
    #[arg(long, value_name = "LAYER")]
    pub layer: Option<String>,
    /// Contact sheet: thumbnails of all layers with their names; data channels are scaled to their ranges.
    #[arg(long, conflicts_with_all = ["layer", "dither", "deep"])]
    pub sheet: bool,
    /// View transform: a name, or a lookup table (cinespace, .csp).
    #[arg(long, value_name = "VIEW", default_value = "srgb", value_parser = views())]
    pub view: ViewTransform,
    /// Exposure in stops, -100 to 100.
    #[arg(long, value_name = "STOPS", default_value = "0", allow_negative_numbers = true, value_parser = stops)]
    pub exposure: f32,
    /// White balance: colour temperature that looks white, kelvin (1667 to 25000; daylight is 6500).
    #[arg(long, value_name = "K", value_parser = kelvin, allow_negative_numbers = true)]
    pub white_balance: Option<f32>,
    /// Dither 8-bit output.
    #[arg(long)]
    pub dither: bool,
    /// Write PNGs and TIFFs with 16 bits per channel.
    #[arg(long)]
    pub deep: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

/// Values of `--denoiser`, which has no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DenoiserArg {
    /// The only denoiser.
    Own,
    /// A synonym: the network of Open Image Denoise is built in.
    Oidn,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct DenoiserArgs {
    /// Ignored: there is only one denoiser.
    #[arg(long, value_name = "DENOISER", hide = true)]
    pub denoiser: Option<DenoiserArg>,
    /// Ignored: the network of Open Image Denoise is built in.
    #[arg(long, value_name = "FILE", hide = true)]
    pub oidn_library: Option<PathBuf>,
}

impl DenoiserArgs {
    /// Notes about options that have no effect.
    pub fn notes(&self) -> Vec<Warning> {
        let is_given = self.denoiser == Some(DenoiserArg::Oidn) || self.oidn_library.is_some();
        let message =
            "the network of Open Image Denoise is built in: --denoiser and --oidn-library have no effect";
        is_given.then(|| Warning::general(message)).into_iter().collect()
    }
}

fn layouts() -> impl TypedValueParser<Value = ExrLayout> {
    named(&ExrLayout::ALL, ExrLayout::name, ExrLayout::about)
}

fn compressions() -> impl TypedValueParser<Value = ExrCompression> {
    named(&ExrCompression::ALL, ExrCompression::name, |_| "")
}

fn spaces() -> impl TypedValueParser<Value = WorkingSpace> {
    named(&WorkingSpace::ALL, WorkingSpace::name, WorkingSpace::about)
}

/// Format of EXR files.
#[derive(Args, Clone, Debug)]
pub(crate) struct ExrFormatArgs {
    /// Channel layout of EXRs.
    #[arg(long, value_name = "LAYOUT", default_value = "single", value_parser = layouts())]
    pub exr_layout: ExrLayout,
    /// Compression of EXRs; pxr24 and those after it are lossy.
    #[arg(long, value_name = "KIND", default_value = "zip", value_parser = compressions())]
    pub exr_compression: ExrCompression,
    /// Write tiled EXRs with tiles of N x N pixels.
    #[arg(long, value_name = "N", value_parser = integer::<u32>(8, 4096), allow_negative_numbers = true)]
    pub exr_tiles: Option<u32>,
    /// Colour space of EXRs.
    #[arg(long, value_name = "SPACE", default_value = "rec709", value_parser = spaces())]
    pub working_space: WorkingSpace,
    /// EXR layers or channels to write as half floats: N, Z, rgba, ...
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub exr_half: Vec<String>,
    /// EXR layers or channels to write as 32-bit floats.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub exr_float: Vec<String>,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct ExrArgs {
    #[command(flatten)]
    pub format: ExrFormatArgs,
    /// Crop: render only the pixels of a rectangle (X1 and Y1 exclusive), the data window of EXRs.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = region, conflicts_with = "region")]
    pub crop: Option<Region>,
    /// Overscan: extend the frame, or the --crop rectangle, by this percentage of the frame's width and height at each
    /// edge. The display window of EXRs stays the frame.
    #[arg(long, value_name = "PERCENT", value_parser = percent, allow_negative_numbers = true, conflicts_with = "checkpoint")]
    pub overscan: Option<f64>,
}

fn percent(text: &str) -> std::result::Result<f64, String> {
    number(text, |v| (0.0..=100.0).contains(&v), "a percentage from 0 to 100")
}

impl ExrFormatArgs {
    /// Options for writing EXRs with this window.
    pub fn options(&self, window: Option<ExrWindow>) -> ExrOptions {
        let of = |names: &[String], kind| names.iter().map(|name| (name.clone(), kind)).collect::<Vec<_>>();
        let mut types = of(&self.exr_half, PixelType::Half);
        types.extend(of(&self.exr_float, PixelType::Float));
        let (layout, compression) = (self.exr_layout, self.exr_compression);
        ExrOptions { layout, compression, tiles: self.exr_tiles, types, space: self.working_space, window }
    }

    /// Whether any option differs from its default.
    pub fn is_given(&self) -> bool {
        let types = self.exr_half.len() + self.exr_float.len();
        let (layout, compression) = (ExrLayout::default(), ExrCompression::default());
        self.exr_layout != layout
            || self.exr_compression != compression
            || self.exr_tiles.is_some()
            || self.working_space != WorkingSpace::default()
            || types > 0
    }

    /// Checks that the format preserves the ids of Cryptomattes.
    ///
    /// # Errors
    /// A usage error for lossy compression or half floats of Cryptomattes.
    pub fn check(&self, has_mattes: bool) -> Result<()> {
        if !self.exr_compression.preserves_ids() && has_mattes {
            let message = "this --exr-compression would change the ids of Cryptomattes";
            return Err(Error::usage(message).with_help("use zip, zips or piz"));
        }
        if let Some(name) = self.exr_half.iter().find(|name| name.to_ascii_lowercase().starts_with("crypto"))
        {
            let message = format!("--exr-half {name} would change the ids of Cryptomattes");
            return Err(Error::usage(message).with_help("they must be 32-bit floats"));
        }
        Ok(())
    }
}

impl ExrArgs {
    /// The window of crop and overscan in a frame of width and height `frame`, pixels; `None` without either.
    ///
    /// # Errors
    /// A usage error for a crop beyond the frame, or for a backdrop picture, which fits only the whole frame.
    pub fn window(
        &self,
        frame: (u32, u32),
        cropped: Option<Region>,
        backdrop: Option<&Backdrop>,
    ) -> Result<Option<FrameWindow>> {
        let percent = self.overscan.unwrap_or(0.0);
        if cropped.is_none() && percent == 0.0 {
            return Ok(None);
        }
        if let Some(crop) = cropped.filter(|crop| crop.x1 > frame.0 || crop.y1 > frame.1) {
            let message = format!("{crop} is not within {} x {} pixels", frame.0, frame.1);
            return Err(Error::usage(message).with_help("use a smaller --crop or --region"));
        }
        if matches!(backdrop, Some(Backdrop::Picture(_))) {
            let message = "a picture as --background can't be used with --crop, --region or --overscan";
            return Err(Error::usage(message).with_help("composite it behind the finished picture"));
        }
        Ok(Some(FrameWindow::new(frame, cropped, percent)))
    }
}

/// The rendered window of a frame; with overscan, it exceeds the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameWindow {
    /// The first pixel of the file, relative to the frame.
    origin: (i32, i32),
    /// Width and height of the frame, pixels.
    frame: (u32, u32),
    /// Width and height with overscan, pixels.
    pub size: (u32, u32),
    /// The rendered region of `size`; `None` for all.
    pub region: Option<Region>,
}

impl FrameWindow {
    /// Adds overscan of `percent` percent around a frame, or around its crop rectangle.
    fn new(frame: (u32, u32), cropped: Option<Region>, percent: f64) -> FrameWindow {
        let border = |size: u32| (f64::from(size) * percent / 100.0).ceil() as u32;
        let (x, y) = (border(frame.0), border(frame.1));
        let (left, top) = cropped.map_or((0, 0), |crop| (crop.x0, crop.y0));
        FrameWindow {
            origin: (left as i32 - x as i32, top as i32 - y as i32),
            frame,
            size: (frame.0 + 2 * x, frame.1 + 2 * y),
            region: cropped.map(|crop| Region { x1: crop.x1 + 2 * x, y1: crop.y1 + 2 * y, ..crop }),
        }
    }

    /// Checks that the camera supports overscan.
    ///
    /// # Errors
    /// A usage error for panoramas.
    pub fn check_camera(self, camera: &Camera) -> Result<()> {
        let is_larger = self.size != self.frame;
        match camera.projection {
            Projection::Panorama(_) if is_larger => {
                let message = format!("--overscan is not supported for '{}', a panorama", camera.name);
                Err(Error::usage(message).with_help("leave --overscan out"))
            }
            _ => Ok(()),
        }
    }

    /// The window for the EXR header.
    pub fn window(self) -> ExrWindow {
        ExrWindow { origin: self.origin, frame: self.frame }
    }

    /// The camera with a field of view that includes the overscan, with pixels of the same size.
    pub fn widened(self, mut camera: Camera) -> Camera {
        let factor = f64::from(self.size.1) / f64::from(self.frame.1);
        if factor > 1.0 {
            camera.projection = match camera.projection {
                Projection::Perspective { vfov_rad } => {
                    Projection::Perspective { vfov_rad: 2.0 * ((0.5 * vfov_rad).tan() * factor).atan() }
                }
                Projection::Orthographic { half_height } => {
                    Projection::Orthographic { half_height: half_height * factor }
                }
                // Refused: see `check_camera`.
                Projection::Panorama(panorama) => Projection::Panorama(panorama),
            };
            camera.shift = camera.shift.map(|shift| shift / factor);
        }
        camera
    }
}

/// Values of `--quality`. The default is `Normal`, unless the user or the scene sets the number of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Quality {
    /// 8 samples per pixel, denoised: for judging composition and light.
    Draft,
    /// An error below 6 %, denoised.
    Normal,
    /// An error below 2 %, denoised.
    High,
    /// Noise below 1 %, not denoised.
    Final,
}

/// The settings of a quality.
pub(crate) struct Preset {
    /// Noise threshold, percent, of the denoised picture if it is denoised; `None` takes all samples.
    pub noise: Option<f32>,
    /// Maximum number of samples per pixel.
    pub samples: u32,
    pub denoise: bool,
}

impl Quality {
    pub fn preset(self) -> Preset {
        match self {
            Quality::Draft => Preset { noise: None, samples: 8, denoise: true },
            Quality::Normal => Preset { noise: Some(6.0), samples: 256, denoise: true },
            Quality::High => Preset { noise: Some(2.0), samples: 2048, denoise: true },
            Quality::Final => Preset { noise: Some(1.0), samples: 65_536, denoise: false },
        }
    }

    /// Whether to warn if the threshold isn't reached.
    pub fn warns_of_noise(self) -> bool {
        self == Quality::Final
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        exr: ExrArgs,
        #[arg(long)]
        region: Option<String>,
        #[arg(long)]
        checkpoint: Option<String>,
    }

    fn args(line: &str) -> ExrArgs {
        Only::try_parse_from(line.split_whitespace()).unwrap_or_else(|e| panic!("{e}")).exr
    }

    #[test]
    fn crops_and_overscan_are_windows_of_the_frame() {
        let of = |line| args(line).window((100, 50), args(line).crop, None).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(of("x"), None);
        let crop = of("x --crop 10,20,30,40").expect("a window");
        assert_eq!((crop.window().origin, crop.size), ((10, 20), (100, 50)));
        let wide = of("x --overscan 5").expect("a window");
        assert_eq!((wide.window().origin, wide.size), ((-5, -3), (110, 56)));
        assert_eq!((wide.region, crop.region), (None, Some(Region { x0: 10, y0: 20, x1: 30, y1: 40 })));
        let both = of("x --crop 10,20,30,40 --overscan 5").expect("a window");
        assert_eq!((both.window().origin, both.size), ((5, 17), (110, 56)));
        assert_eq!(both.region, Some(Region { x0: 10, y0: 20, x1: 40, y1: 46 }));
        let beyond = args("x --crop 10,20,101,40");
        assert!(beyond.window((100, 50), beyond.crop, None).is_err());
    }

    #[test]
    fn overscan_keeps_the_rays_of_the_frame() {
        use oscura::math::DVec3;
        let framed = args("x --overscan 10").window((40, 20), None, None).ok().flatten().expect("a window");
        let camera = Camera { shift: [0.2, -0.1], ..Camera::look_at([0.0, 1.0, 5.0], [0.0; 3], 35.0) };
        let rays = |camera: &Camera, (w, h): (u32, u32), x: f32, y: f32| {
            oscura::camera::Camera::new(camera, w, h, DVec3::ZERO).ray(x, y, [0.5; 2]).direction
        };
        for (x, y) in [(0.5, 0.5), (39.5, 3.5), (20.0, 10.0)] {
            let plain = rays(&camera, (40, 20), x, y);
            let wide = rays(&framed.widened(camera.clone()), framed.size, x + 4.0, y + 2.0);
            assert!((plain - wide).length() < 1e-6, "{plain} {wide}");
        }
    }
}
