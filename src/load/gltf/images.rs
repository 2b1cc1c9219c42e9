//! The images that textures need: fetched one after the other, decoded in parallel, each once.

use super::buffers::Fetched;
use super::document::{Document, name_of, pointer};
use super::report::{Report, Sound};
use super::textures::ImageNeed;
use crate::error::{Problem, Warning};
use crate::image::{Encoding, Image, Pixels};
use crate::load::image::{Use, decode, unused};
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// An image before decoding.
struct Source<'d> {
    /// Its first need; another may differ in the encoding alone.
    need: ImageNeed,
    name: String,
    fetched: Fetched<'d>,
}

/// Decodes what is needed, in the order of the needs. Problems are noted; the list is complete only without any.
pub(super) fn read(doc: &Document, needs: &[ImageNeed], report: &mut Report) -> Vec<Image> {
    let (images, unreadable) = read_what_can_be(doc, needs, report);
    unreadable.into_iter().for_each(|(_, problem)| {
        report.add(problem);
    });
    images.into_iter().flatten().collect()
}

/// Decodes the images of textures, in the order of the needs. A white pixel stands for those whose bytes are no image, which
/// come with what is said of them. Other problems are noted.
pub(super) fn read_textures(
    doc: &Document,
    needs: &[ImageNeed],
    report: &mut Report,
) -> (Vec<Image>, Vec<(usize, String)>) {
    let (images, unreadable) = read_what_can_be(doc, needs, report);
    let blank = || Image {
        name: String::new(),
        width: 1,
        height: 1,
        channels: 1,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::U8(vec![255])),
    };
    let images = images.into_iter().map(|image| image.unwrap_or_else(blank)).collect();
    let mut lost = Vec::new();
    for (index, problem) in unreadable {
        // What this build or a setting is to blame for has a remedy.
        match problem.help {
            Some(_) => drop(report.add(problem)),
            None => lost.push((index, problem.message)),
        }
    }
    (images, lost)
}

/// Decodes what is needed, in the order of the needs, and gives the problems of what can't be decoded by its index.
fn read_what_can_be(
    doc: &Document,
    needs: &[ImageNeed],
    report: &mut Report,
) -> (Vec<Option<Image>>, Vec<(usize, Problem)>) {
    let mut sources: Vec<Source> = Vec::new();
    for &need in needs {
        if !sources.iter().any(|s| s.need.index == need.index) {
            sources.extend(fetch(doc, need, report));
        }
    }
    let path = doc.path;
    let decoded: Vec<_> = sources.par_iter().map(|source| decode_source(path, source)).collect();
    let mut unreadable = Vec::new();
    for (source, Decoded { image, warnings, notes }) in sources.iter().zip(&decoded) {
        report.extend(warnings);
        report.extend_notes(notes);
        if let Err(problem) = image {
            unreadable.push((source.need.index, problem.clone()));
        }
    }
    let image = |need: &ImageNeed| {
        let at = sources.iter().position(|s| s.need.index == need.index)?;
        let image = decoded.get(at)?.image.as_ref().ok()?;
        let encoding = match *image.pixels {
            Pixels::F32(_) => Encoding::Linear,
            Pixels::U8(_) | Pixels::U16(_) => need.encoding,
        };
        let image = Image { encoding, ..image.clone() };
        Some(match need.gloss {
            Some(gloss) => roughness(&image, gloss.factor()),
            None => image,
        })
    };
    (needs.iter().map(image).collect(), unreadable)
}

/// The roughness 1 - factor * alpha of an image of glossiness, as an image of one channel.
fn roughness(image: &Image, factor: f32) -> Image {
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let rough = |(x, y)| {
        let [.., alpha] = image.rgba(x, y);
        ((1.0 - factor * alpha) * 65535.0).round().clamp(0.0, 65535.0) as u16
    };
    Image {
        name: format!("{} (roughness)", image.name),
        channels: 1,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::U16(pixels.map(rough).collect())),
        ..image.clone()
    }
}

fn fetch<'d>(doc: &'d Document, need: ImageNeed, report: &mut Report) -> Sound<Source<'d>> {
    let at = pointer("images", need.index);
    let json: gltf::json::Image = doc.entry("images", need.index, &at, report)?;
    let name = name_of(doc.raw("images", need.index, &at, report)?, "image", need.index);
    let mut fetched = match (json.uri, json.buffer_view) {
        (Some(uri), _) => doc.fetch(&uri, &format!("{at}/uri"), report)?,
        (None, Some(view)) => match doc.view(view.value(), &format!("{at}/bufferView"), report) {
            Ok(view) => Fetched { bytes: view.bytes.into(), mime: None, file: None },
            Err(_) => {
                return Err(report.problem(at, "has no bytes that can be read"));
            }
        },
        (None, None) => {
            return Err(report.problem(at, "has neither a uri nor a bufferView"));
        }
    };
    fetched.mime = json.mime_type.map(|m| m.0).or(fetched.mime);
    Ok(Source { need, name, fetched })
}

/// An image, or the problem of the asset that it is, and what is to be said of it.
struct Decoded {
    image: Result<Image, Problem>,
    warnings: Vec<Warning>,
    /// What is left aside as glTF demands.
    notes: Vec<Warning>,
}

fn decode_source(asset: &Path, source: &Source) -> Decoded {
    let Fetched { bytes, mime, file } = &source.fetched;
    let purpose = if source.need.encoding == Encoding::Srgb { Use::Color } else { Use::Data };
    let at = pointer("images", source.need.index);
    let mut warnings = Vec::new();
    let (place, inside) = match file {
        Some(file) => (file.as_path(), ""),
        None => (asset, at.as_str()),
    };
    let image = match decode(bytes, place, inside, mime.as_deref(), purpose, &mut warnings) {
        Ok(image) => Ok(Image { name: source.name.clone(), ..image }),
        Err(error) => {
            let messages: Vec<String> = error.problems.iter().map(|p| p.message.clone()).collect();
            let help = error.problems.into_iter().find_map(|p| p.help);
            Err(Problem {
                help,
                ..Problem::new(at.as_str(), format!("'{}' {}", source.name, messages.join("; ")))
            })
        }
    };
    let notes = if image.is_ok() { unused(bytes, place, inside, purpose) } else { Vec::new() };
    Decoded { image, warnings, notes }
}
