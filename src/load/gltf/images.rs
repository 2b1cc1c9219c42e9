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
    let mut sources: Vec<Source> = Vec::new();
    for &need in needs {
        if !sources.iter().any(|s| s.need.index == need.index) {
            sources.extend(fetch(doc, need, report));
        }
    }
    let path = doc.path;
    let decoded: Vec<_> = sources.par_iter().map(|source| decode_source(path, source)).collect();
    let mut images = Vec::with_capacity(needs.len());
    for Decoded { image, warnings, notes } in &decoded {
        report.extend(warnings);
        report.extend_notes(notes);
        if let Err(problem) = image {
            report.add(problem.clone());
        }
    }
    for need in needs {
        let found = sources.iter().position(|s| s.need.index == need.index);
        if let Some(Ok(image)) = found.and_then(|at| decoded.get(at)).map(|decoded| &decoded.image) {
            let encoding = match *image.pixels {
                Pixels::F32(_) => Encoding::Linear,
                Pixels::U8(_) | Pixels::U16(_) => need.encoding,
            };
            let image = Image { encoding, ..image.clone() };
            images.push(match need.gloss {
                Some(gloss) => roughness(&image, gloss.factor()),
                None => image,
            });
        }
    }
    images
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
