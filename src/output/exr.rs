//! OpenEXR: by default one part, scan lines, ZIP. Colour is R, G, B, A (premultiplied), half or float; the film's further
//! channels stand in the same part, under the names and in the types that the film gives them. [`ExrOptions`] has what else
//! there is.

use super::encoded::Encoded;
use super::exr_colors::is_color;
use super::exr_header::sort_attributes;
use super::exr_options::ExrOptions;
use super::exr_planes::planes;
use super::exr_zip::{self, AnyImage};
use super::matte::Matte;
use crate::error::{Choice, Warning};
use crate::film::{AovSpace, Film, PixelType, Plane, Values};
use crate::load::image::Layered;
use crate::math::{DAffine3, DMat4, DVec3};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, FlatSamples, Image, ImageAttributes, Layer, LayerAttributes,
    Text, Vec2, WritableImage, f16,
};
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::fmt::Write;
use std::io::Cursor;
use std::time::SystemTime;

/// What the header says about how the picture was made. What is `None` is left out.
#[derive(Clone, Debug, Default)]
pub struct Metadata {
    /// Samples a pixel; a fraction if rendering was stopped and pixels differ.
    pub samples: f64,
    /// Seed of all randomness.
    pub seed: u32,
    /// Whose picture it is.
    pub owner: Option<String>,
    /// Time spent rendering, seconds; differs from run to run.
    pub render_s: Option<f64>,
    /// When it was made (written in UTC); differs from run to run.
    pub captured: Option<SystemTime>,
    /// From world to camera space (right-handed, y up, looking down -z), column vectors.
    pub world_to_camera: Option<DMat4>,
    /// From world to normalized device coordinates of the frame: see [`ndc_from_world`](crate::camera::ndc_from_world).
    pub world_to_ndc: Option<DMat4>,
    /// Width over height of a pixel; square without.
    pub pixel_aspect: Option<f64>,
    /// Which space AOVs of places and directions are in.
    pub aov_space: AovSpace,
    /// What took the noise out of the picture, if something did.
    pub denoised: Option<String>,
    /// The mattes that the picture holds.
    pub mattes: Vec<Matte>,
    /// How far from the world's origin the scene's coordinates have theirs; `world_to_camera` is relative to it.
    pub world_offset: Option<DVec3>,
    /// What stopped rendering before all samples were done.
    pub stopped_by: Option<String>,
    /// What was ignored, approximated or repaired on the way to the picture.
    pub warnings: Vec<String>,
}

/// Encodes a film. Values beyond the range of half floats are clamped and counted in a warning, which the header holds
/// too.
///
/// # Errors
/// What the encoder objects to.
pub fn encode_exr(
    film: &Film,
    float: bool,
    options: &ExrOptions,
    metadata: &Metadata,
) -> Result<Encoded, String> {
    let mut clamped = 0u64;
    let parts = parts(film, float, options, &mut clamped);
    let mut warnings = if clamped == 0 { vec![] } else { vec![overflow(clamped)] };
    let names: Vec<&str> = film.names().collect();
    warnings.extend(options.unknown(&names).map(|name| {
        Warning::general(format!(
            "there is no channel or layer '{name}' in the picture, whose type was chosen"
        ))
    }));
    let mut metadata = metadata.clone();
    metadata.warnings.extend(warnings.iter().map(Warning::to_string));
    let size = Vec2(film.width() as usize, film.height() as usize);
    let is_multipart = parts.len() > 1;
    let layer = |(index, (name, channels)): (usize, (String, Vec<AnyChannel<FlatSamples>>))| {
        let mut attributes = attributes(&metadata, &name, index == 0, options);
        if names.iter().any(|n| AovSpace::concerns(n) && options.part_of(n) == name) {
            let space = AttributeValue::Text(text(metadata.aov_space.name()));
            attributes.other.insert(text("aovSpace"), space);
        }
        if is_multipart {
            attributes.layer_name = Some(text(&name));
        }
        let (x, y) = options.window.map_or((0, 0), |window| window.origin);
        attributes.layer_position = Vec2(x, y);
        Layer::new(size, attributes, options.encoding(), AnyChannels::sort(channels.into_iter().collect()))
    };
    let layers: Vec<_> = parts.into_iter().enumerate().map(layer).collect();
    let (width, height) = options.window.map_or((film.width(), film.height()), |window| window.frame);
    let mut shared = ImageAttributes::with_size(Vec2(width as usize, height as usize));
    shared.pixel_aspect = metadata.pixel_aspect.unwrap_or(1.0) as f32;
    shared.chromaticities = Some(options.space.chromaticities());
    let image = Image::from_layers(shared, layers);
    let bytes = encode_image(&image)?;
    Ok(Encoded { bytes, warnings })
}

/// Encodes a file that was read, with all its parts, channels and attributes.
///
/// # Errors
/// What the encoder objects to.
pub fn encode_layered(layered: &Layered) -> Result<Vec<u8>, String> {
    encode_image(layered.file())
}

/// Encodes all that a file holds.
fn encode_image(image: &AnyImage) -> Result<Vec<u8>, String> {
    let mut bytes = match exr_zip::suits(image) {
        true => exr_zip::encode(image).map_err(|e| e.to_string())?,
        false => {
            let mut bytes = Cursor::new(Vec::new());
            let write = image.write();
            // The encoder brings a pool of its own with all cores.
            let write = if rayon::current_num_threads() == 1 { write.non_parallel() } else { write };
            write.to_buffered(&mut bytes).map_err(|e| e.to_string())?;
            bytes.into_inner()
        }
    };
    sort_attributes(&mut bytes).ok_or("the encoder wrote a header that can't be read")?;
    Ok(bytes)
}

/// All planes of the film by the parts that they belong to, in the order of the film; adds to `clamped` how many values
/// didn't fit. `float` makes half floats floats, where no type is chosen.
fn parts(
    film: &Film,
    float: bool,
    options: &ExrOptions,
    clamped: &mut u64,
) -> Vec<(String, Vec<AnyChannel<FlatSamples>>)> {
    let samples = |plane: Plane<'_>| {
        let own =
            if float && plane.pixel_type == PixelType::Half { PixelType::Float } else { plane.pixel_type };
        match plane.values {
            Values::Uint(values) => (FlatSamples::U32(values), 0),
            Values::Float(values) if options.type_of(plane.name, own) == PixelType::Half => to_half(values),
            Values::Float(values) => (FlatSamples::F32(values), 0),
        }
    };
    let planes: Vec<_> =
        planes(film, options).into_par_iter().map(|plane| (plane.name, samples(plane))).collect();
    let mut parts: Vec<(String, Vec<_>)> = Vec::new();
    for (name, (samples, count)) in planes {
        *clamped += count;
        let channel = AnyChannel::new(text(&options.name_of(name)), samples);
        let part = options.part_of(name);
        match parts.iter_mut().find(|(name, _)| *name == part) {
            Some((_, channels)) => channels.push(channel),
            None => parts.push((part, vec![channel])),
        }
    }
    parts
}

/// Half floats, and how many values were beyond their range.
fn to_half(mut values: Vec<f32>) -> (FlatSamples, u64) {
    let limit = f16::MAX.to_f32();
    let mut clamped = 0u64;
    for v in &mut values {
        clamped += u64::from(v.abs() > limit);
        *v = v.clamp(-limit, limit);
    }
    let mut halves = vec![f16::ZERO; values.len()];
    halves.convert_from_f32_slice(&values);
    (FlatSamples::F16(halves), clamped)
}

fn overflow(clamped: u64) -> Warning {
    Warning::general(format!(
        "{clamped} values above 65504 don't fit into half floats and were clamped; {} keeps them",
        Choice::Float
    ))
}

/// The attribute that says what took the noise out of a picture.
pub const DENOISED: &str = "denoised";

/// Attributes of a part. The first has all; others those that say what their channels are.
fn attributes(metadata: &Metadata, part: &str, is_first: bool, options: &ExrOptions) -> LayerAttributes {
    let mut attributes = LayerAttributes {
        software_name: Some(text(concat!("oscura ", env!("CARGO_PKG_VERSION")))),
        owner: metadata.owner.as_deref().map(text),
        capture_date: metadata.captured.and_then(exr_date).map(|date| text(&date)),
        utc_offset: metadata.captured.and_then(exr_date).map(|_| 0.0),
        // The file holds rows of a matrix for row vectors, which are the columns of ours.
        world_to_camera: metadata.world_to_camera.map(|m| camera(m, metadata.world_offset)),
        world_to_normalized_device: metadata.world_to_ndc.map(|m| camera(m, metadata.world_offset)),
        ..LayerAttributes::default()
    };
    let mut add = |name: &str, value| attributes.other.insert(text(name), value);
    let space = if is_first || is_color(part) { options.space.interop_id() } else { "data" };
    add("colorInteropID", AttributeValue::Text(text(space)));
    let samples = metadata.samples;
    let is_whole = samples.fract() == 0.0 && samples <= f64::from(i32::MAX);
    add(
        "samples",
        if is_whole { AttributeValue::I32(samples as i32) } else { AttributeValue::F32(samples as f32) },
    );
    if let Some(offset) = metadata.world_offset {
        let [x, y, z] = offset.to_array();
        add("worldOffset", AttributeValue::Text(text(&format!("{x} {y} {z}"))));
    }
    if let Some(denoiser) = &metadata.denoised {
        add(DENOISED, AttributeValue::Text(text(denoiser)));
    }
    if let Some(reason) = &metadata.stopped_by {
        add("stoppedBy", AttributeValue::Text(text(reason)));
    }
    add("seed", AttributeValue::Text(text(&metadata.seed.to_string())));
    if let Some(seconds) = metadata.render_s {
        add("renderTime", AttributeValue::F32(seconds as f32));
    }
    let here = metadata.mattes.iter().filter(|matte| is_first || matte.kind() == part);
    for (name, value) in here.flat_map(|matte| matte.attributes(options.prefix())) {
        add(&name, AttributeValue::Text(text(&value)));
    }
    if !metadata.warnings.is_empty() {
        add("warnings", AttributeValue::Text(text(&metadata.warnings.join("\n"))));
    }
    attributes
}

/// The matrix in single floats, for points relative to the offset.
fn camera(world_to_camera: DMat4, offset: Option<DVec3>) -> [f32; 16] {
    let local = match offset {
        Some(offset) => world_to_camera * DMat4::from(DAffine3::from_translation(offset)),
        None => world_to_camera,
    };
    local.to_cols_array().map(|v| v as f32)
}

/// EXR text holds the first 256 code points only; others become question marks.
fn text(s: &str) -> Text {
    let latin: String = s.chars().map(|c| if (c as u32) < 256 && c != '\0' { c } else { '?' }).collect();
    Text::new_or_none(latin).unwrap_or_default()
}

/// `YYYY:MM:DD hh:mm:ss` in UTC, the form of the capDate attribute. `None` outside the years 1970 to 9999.
fn exr_date(time: SystemTime) -> Option<String> {
    // Earlier times make the crate panic, later ones fail.
    time.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    let mut date = String::new();
    // 2024-02-29T23:59:59Z
    write!(date, "{}", humantime::format_rfc3339_seconds(time)).ok()?;
    Some(date.replace('-', ":").replace('T', " ").replace('Z', ""))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let at = |s| exr_date(SystemTime::UNIX_EPOCH + Duration::from_secs(s));
        for (seconds, date) in [
            (0, "1970:01:01 00:00:00"),
            (951_782_400, "2000:02:29 00:00:00"),
            (1_709_251_199, "2024:02:29 23:59:59"),
            (4_107_542_400, "2100:03:01 00:00:00"),
        ] {
            assert_eq!(at(seconds).as_deref(), Some(date));
        }
        assert_eq!(exr_date(SystemTime::UNIX_EPOCH - Duration::from_secs(1)), None);
        assert_eq!(at(1 << 40), None);
    }
}
