//! Arguments shared by all commands that load scenes.

use super::parsers::{integer, named, number};
use clap::builder::TypedValueParser;
use clap::{Args, ValueEnum};
use oscura::color::linear_from_srgb;
use oscura::error::{Error, Result, Warning};
use oscura::load::blender::{BlenderOptions, default_cache};
use oscura::load::gltf::{Glass, GltfOptions, LightUnits};
use oscura::load::image::load_picture;
use oscura::load::stage::{Background, Ground, StageLight, StageOptions, ViewFrom};
use oscura::load::subdivide::{MAX_LEVELS, Subdivision};
use oscura::load::{Up, extensions, file_names_in, is_named_as_scene, is_scene};
use std::path::{Path, PathBuf};

/// Parser of `--light-units`.
fn light_units() -> impl TypedValueParser<Value = LightUnits> {
    named(&LightUnits::ALL, LightUnits::name, |units| match units {
        LightUnits::Auto => "As in the glTF specification and by default in Blender's exporter",
        LightUnits::Spec => "Candela and lux, divided by 683 lm/W",
        LightUnits::Compat => "Watts per steradian (Blender's mode Unitless)",
        LightUnits::Raw => "Total power in watts (Blender's mode Raw)",
    })
}

/// Parser of `--glass`.
fn glass() -> impl TypedValueParser<Value = Glass> {
    named(&Glass::ALL, Glass::name, |glass| match glass {
        Glass::Auto => "Solid for closed meshes from Blender's exporter, else thin",
        Glass::Solid => "Solid, with refraction",
        Glass::Panes => "As auto, but flat window panes become single sheets, which do not block shadow rays",
        Glass::Thin => "Thin-walled, as in the glTF specification",
    })
}

/// Parser of `--ground`.
fn ground() -> impl TypedValueParser<Value = Ground> {
    named(&Ground::ALL, Ground::name, |ground| match ground {
        Ground::None => "No ground",
        Ground::Shadow => {
            "Ground in the colour of the background that receives shadows and faint reflections"
        }
        Ground::Floor => "Glossy floor",
    })
}

// Arguments about reading files.
#[derive(Args, Clone, Debug)]
pub(crate) struct SourceArgs {
    /// Let glTF and OBJ files refer to files outside their folder.
    #[arg(long)]
    pub allow_external: bool,
    /// Radius of the spheres that the points of a point cloud are rendered as, metres.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub point_radius: Option<f64>,
    /// Ignore the model's sidecar file (model.oscura.toml next to model.glb).
    #[arg(long)]
    pub no_sidecar: bool,
}

// Arguments about glTF files.
#[derive(Args, Clone, Debug)]
pub(crate) struct AssetArgs {
    /// Time of the animation, seconds [default: the rest pose].
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = moment)]
    pub time: Option<f64>,
    /// Scene by name or by index from 0 [default: the file's default].
    #[arg(long = "scene", value_name = "SCENE")]
    pub scene_name: Option<String>,
    /// Render only this node, by name or index, and its descendants.
    #[arg(long, value_name = "NODE")]
    pub node: Option<String>,
    /// Material variant by name or index.
    #[arg(long, value_name = "VARIANT")]
    pub variant: Option<String>,
    /// Units of light intensities.
    #[arg(long, value_name = "UNITS", default_value = "auto", value_parser = light_units())]
    pub light_units: LightUnits,
    /// Interpretation of transmissive materials without a volume.
    #[arg(long, value_name = "KIND", default_value = "auto", value_parser = glass())]
    pub glass: Glass,
    /// Ignore required glTF extensions that are not supported.
    #[arg(long)]
    pub force: bool,
}

impl AssetArgs {
    pub(crate) fn options(&self) -> GltfOptions {
        GltfOptions {
            time_s: self.time,
            scene: self.scene_name.clone(),
            node: self.node.clone(),
            variant: self.variant.clone(),
            light_units: self.light_units,
            glass: self.glass,
            force: self.force,
        }
    }
}

fn moment(text: &str) -> std::result::Result<f64, String> {
    let value = text.parse().ok().filter(|t: &f64| t.is_finite());
    value.ok_or_else(|| "not a number of seconds".to_string())
}

// Arguments about .blend files.
#[derive(Args, Clone, Debug)]
pub(crate) struct BlenderArgs {
    /// Blender executable, or a Python with the module bpy [default: OSCURA_BLENDER, else searched].
    #[arg(long, value_name = "PATH")]
    pub blender: Option<PathBuf>,
    /// View layer by name [default: the first that is enabled for rendering].
    #[arg(long, value_name = "LAYER")]
    pub view_layer: Option<String>,
    /// Maximum size of baked textures, 16 to 16384 pixels [default: 1024].
    #[arg(long, value_name = "N", value_parser = integer::<u32>(16, 16384), allow_negative_numbers = true)]
    pub bake: Option<u32>,
    /// Cache folder of baked textures [default: see 'oscura cache'].
    #[arg(long, value_name = "FOLDER", conflicts_with = "no_cache")]
    pub cache: Option<PathBuf>,
    /// Neither read nor write the cache.
    #[arg(long)]
    pub no_cache: bool,
}

impl BlenderArgs {
    pub(crate) fn options(&self) -> BlenderOptions {
        let cache = self.cache.clone().or_else(default_cache).filter(|_| !self.no_cache);
        BlenderOptions {
            program: self.blender.clone(),
            view_layer: self.view_layer.clone(),
            bake: self.bake,
            cache,
            frame: None,
        }
    }
}

/// Lighting of scenes without lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StageArg {
    /// Studio softboxes: key, fill and rim light.
    Studio,
    /// Blue sky with a hazy sun.
    Sky,
    /// A low, warm sun.
    Sunset,
    /// Uniform white environment.
    White,
    /// No light, ground or material is added.
    None,
}

impl StageArg {
    /// Name on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_string()).unwrap_or_default()
    }

    /// Finds the variant by name.
    pub fn of(name: &str) -> Option<StageArg> {
        StageArg::from_str(name, false).ok()
    }
}

// Arguments about the presentation of models without a camera or lights.
#[derive(Args, Clone, Debug)]
pub(crate) struct StageArgs {
    /// Lighting of a scene without lights [default: studio].
    #[arg(long, value_name = "STAGE")]
    pub stage: Option<StageArg>,
    /// Ground under a model without a camera [default: shadow on a stage, none with --env].
    #[arg(long, value_name = "GROUND", value_parser = ground())]
    pub ground: Option<Ground>,
    /// Background: #rrggbb, white, grey, black, transparent, or an image file [default: the stage's, else the
    /// environment].
    #[arg(long, value_name = "COLOR|FILE", value_parser = background)]
    pub background: Option<BackgroundArg>,
    /// View direction: three-quarter, front, right, back, left, top, bottom, iso, or azimuth and elevation in degrees
    /// such as 30,20 [default: three-quarter].
    #[arg(long, value_name = "VIEW", allow_hyphen_values = true)]
    pub view_from: Option<ViewFrom>,
    /// Zoom factor of the model in the image.
    #[arg(long, value_name = "F", default_value = "1", value_parser = zoom, allow_negative_numbers = true)]
    pub zoom: f64,
    /// Vertical field of view, degrees [default: the camera's, 30 for models without one].
    #[arg(long, value_name = "DEG", value_parser = fov, allow_negative_numbers = true)]
    pub fov: Option<f64>,
    /// Up axis of OBJ and PLY files; auto guesses it from the exporter and the model's shape.
    #[arg(long, value_name = "AXIS", default_value = "auto", value_parser = up(), allow_hyphen_values = true)]
    pub up: Up,
    /// Smooth shading of OBJ and PLY meshes without normals, except at edges sharper than this crease angle, degrees [default
    /// without a value: 30].
    #[arg(long, value_name = "DEG", num_args = 0..=1, require_equals = true, default_missing_value = "30", value_parser = crease)]
    pub smooth: Option<f64>,
    /// Catmull-Clark subdivision levels of OBJ and PLY meshes.
    #[arg(long, value_name = "LEVELS", value_parser = integer::<u32>(0, MAX_LEVELS), allow_negative_numbers = true)]
    pub subdivide: Option<u32>,
}

/// Value of `--background`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum BackgroundArg {
    Transparent,
    /// sRGB, 0..1.
    Color([f32; 3]),
    File(PathBuf),
}

impl StageArgs {
    /// Subdivision requested by `--subdivide`.
    pub fn subdivision(&self) -> Option<Subdivision> {
        self.subdivide.map(|levels| Subdivision { levels, has_round_corners: false })
    }

    /// False if a background colour or image is set: a filmic view would change it.
    pub fn allows_filmic_view(&self) -> bool {
        self.stage != Some(StageArg::White)
            && matches!(self.background, None | Some(BackgroundArg::Transparent))
    }

    /// Stage options for a picture with this width / height. Reads the background image within a memory limit, bytes.
    ///
    /// # Errors
    /// An input error if the background image can't be read.
    pub fn options(
        &self,
        aspect: Option<f64>,
        memory_limit: Option<u64>,
        warnings: &mut Vec<Warning>,
    ) -> Result<StageOptions> {
        let light = match self.stage {
            None | Some(StageArg::Studio) => StageLight::Studio,
            Some(StageArg::Sky) => StageLight::Sky,
            Some(StageArg::Sunset) => StageLight::Sunset,
            Some(StageArg::White) => StageLight::White,
            Some(StageArg::None) => StageLight::None,
        };
        let background = match &self.background {
            None => None,
            Some(BackgroundArg::Transparent) => Some(Background::Transparent),
            Some(BackgroundArg::Color(srgb)) => Some(Background::Color(srgb.map(linear_from_srgb))),
            Some(BackgroundArg::File(path)) => {
                Some(Background::Picture(load_picture(path, memory_limit, warnings)?))
            }
        };
        Ok(StageOptions {
            light,
            is_light_chosen: self.stage.is_some_and(|s| s != StageArg::None),
            ground: self.ground,
            background,
            view: self.view_from.unwrap_or_default(),
            is_view_chosen: self.view_from.is_some(),
            zoom: self.zoom,
            vfov_degrees: self.fov.unwrap_or(StageOptions::default().vfov_degrees),
            aspect,
            is_orbit: false,
            is_dry_run: false,
        })
    }
}

/// Parses a colour, `transparent`, or a file name.
fn background(text: &str) -> std::result::Result<BackgroundArg, String> {
    let named = match text {
        "" => return Err("must be a colour such as #e0e0e0, transparent, or an image file".into()),
        "transparent" | "none" => return Ok(BackgroundArg::Transparent),
        "white" => Some([1.0; 3]),
        "black" => Some([0.0; 3]),
        "grey" | "gray" => Some([0.5; 3]),
        _ => None,
    };
    if let Some(color) = named {
        return Ok(BackgroundArg::Color(color));
    }
    let Some(digits) = text.strip_prefix('#') else {
        if Path::new(text).extension().is_none() && !Path::new(text).exists() {
            return Err(
                "must be white, grey, black, a colour such as #e0e0e0, transparent, or an image file".into(),
            );
        }
        return Ok(BackgroundArg::File(text.into()));
    };
    let is_hex = digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let value = u32::from_str_radix(digits, 16).ok().filter(|_| is_hex);
    let value = value.ok_or("colours need six hexadecimal digits, such as #e0e0e0")?;
    Ok(BackgroundArg::Color([16, 8, 0].map(|shift| (value >> shift & 255) as f32 / 255.0)))
}

fn zoom(text: &str) -> std::result::Result<f64, String> {
    number(text, |v| (0.001..=1000.0).contains(&v), "a number from 0.001 to 1000")
}

fn fov(text: &str) -> std::result::Result<f64, String> {
    number(text, |v| (0.1..=170.0).contains(&v), "a number of degrees from 0.1 to 170")
}

fn crease(text: &str) -> std::result::Result<f64, String> {
    number(text, |v| (0.0..=180.0).contains(&v), "a number of degrees from 0 to 180")
}

/// Parser of up axes by name.
pub(crate) fn up() -> impl TypedValueParser<Value = Up> {
    named(&Up::ALL, Up::name, |_| "")
}

// Errors of the scene argument, such as a missing file or a folder.

/// Maximum number of files listed in a message.
const MAX_LISTED: usize = 8;

/// Extensions of files that were probably meant as outputs.
const OUTPUT_EXTENSIONS: [&str; 5] = ["exr", "hdr", "png", "jpg", "jpeg"];

/// Checks that there is a file. Other problems are reported by loading.
///
/// # Errors
/// An input error with help if there is no file, or if it is an image.
pub(crate) fn check_scene_path(path: &Path) -> Result<()> {
    if path == Path::new("-") {
        let error = Error::input(path, "scenes are not read from standard input");
        return Err(error.with_help("give a file name; images are found relative to the file"));
    }
    if path.to_str().is_some_and(|text| text.contains("://")) {
        let error = Error::input(path, "is a URL, which can't be read");
        return Err(error.with_help("download the file and give its path"));
    }
    if path.is_dir() {
        return Err(Error::input(path, "is a folder").with_help(scenes_in(path)));
    }
    // Other problems of the path are reported by reading the file.
    if matches!(path.try_exists(), Ok(false)) {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let (message, help) = match folder.is_dir() {
            true => ("there is no such file".to_string(), scenes_in(folder)),
            false => {
                (format!("the folder {} does not exist", folder.display()), "check the path".to_string())
            }
        };
        return Err(Error::input(path, message).with_help(help));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if OUTPUT_EXTENSIONS.contains(&extension.as_str()) {
        let message = format!("files of type '.{extension}' can't be rendered");
        let help = "to write it, use -o: oscura render scene.glb -o picture.png";
        return Err(Error::input(path, message).with_help(help));
    }
    Ok(())
}

/// Scenes in the current folder with this file stem.
pub(super) fn scenes_named(stem: &str) -> Vec<String> {
    let is_match =
        |name: &String| is_named_as_scene(name) && Path::new(name).file_stem().is_some_and(|s| s == stem);
    let mut names: Vec<String> = file_names_in(Path::new(".")).unwrap_or_default();
    names.retain(is_match);
    names.sort();
    names
}

/// Help text that lists the scenes in a folder.
fn scenes_in(folder: &Path) -> String {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| is_scene(entry.path()))
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let more = names.len().saturating_sub(MAX_LISTED);
    names.truncate(MAX_LISTED);
    match (names.is_empty(), more) {
        (true, _) => {
            let types: Vec<String> = extensions().map(|extension| format!(".{extension}")).collect();
            format!("there are no scenes ({}) in this folder", types.join(", "))
        }
        (false, 0) => format!("scenes in this folder: {}", names.join(", ")),
        (false, more) => format!("scenes in this folder: {}, and {more} more", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds() {
        assert_eq!(background("#ff8000"), Ok(BackgroundArg::Color([1.0, 128.0 / 255.0, 0.0])));
        assert_eq!(background("transparent"), Ok(BackgroundArg::Transparent));
        assert_eq!(background("sky.png"), Ok(BackgroundArg::File("sky.png".into())));
        assert!(background("#fff").is_err() && background("#+1+1+1").is_err() && background("").is_err());
    }
}
