//! The images that textures need: fetched one after the other, each once; small ones are decoded in parallel, large ones stay encoded.

use super::buffers::Fetched;
use super::document::{Document, name_of, pointer};
use super::report::{Report, Sound};
use super::textures::{ImageNeed, without_texture};
use crate::error::{Error, Problem, Warning};
use crate::image::{Damage, Encoding, Image, Pixels};
use crate::load::image::{ImageFile, OnDamage, Use, decode, for_texture, unused};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

/// An image before decoding.
struct Source<'d> {
    /// Its first need; another may differ in the encoding alone.
    need: ImageNeed,
    name: String,
    fetched: Fetched<'d>,
    /// For damage that is found later.
    on_damage: OnDamage,
}

/// Decodes what is needed, in the order of the needs. Problems are noted; the list is complete only without any.
pub(super) fn read(doc: &Document, needs: &[ImageNeed], report: &mut Report) -> Vec<Image> {
    let (images, unreadable) = read_what_can_be(doc, needs, false, report);
    unreadable.into_iter().for_each(|(_, problem)| {
        report.add(problem);
    });
    images.into_iter().flatten().collect()
}

/// Reads the images of textures, in the order of the needs. A white pixel stands for those whose bytes are no image, which
/// come with what is said of them. Other problems are noted.
pub(super) fn read_textures(
    doc: &Document,
    needs: &[ImageNeed],
    report: &mut Report,
) -> (Vec<Image>, Vec<(usize, String)>) {
    let (images, unreadable) = read_what_can_be(doc, needs, true, report);
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

/// Bytes of images that are read before they are decoded, and forgotten as far as images stay encoded.
const READ_TOGETHER: usize = 256 << 20;

/// Reads what is needed, in the order of the needs, and gives the problems of what can't be decoded by its index. Large images stay
/// encoded if `is_lazy`.
fn read_what_can_be(
    doc: &Document,
    needs: &[ImageNeed],
    is_lazy: bool,
    report: &mut Report,
) -> (Vec<Option<Image>>, Vec<(usize, Problem)>) {
    // Numbers of sources, which several needs may have in common. Roughness is made of pixels.
    let mut numbers: HashMap<usize, usize> = HashMap::new();
    let is_gloss: HashSet<usize> = needs.iter().filter(|n| n.gloss.is_some()).map(|n| n.index).collect();
    let (mut decoded, mut unreadable, mut pending, mut bytes) = (Vec::new(), Vec::new(), Vec::new(), 0);
    let path = doc.path;
    let mut decode = |sources: &mut Vec<Source>, report: &mut Report| {
        let read = |source: &Source| {
            let is_lazy = is_lazy && !is_gloss.contains(&source.need.index);
            decode_source(path, source, is_lazy)
        };
        let images: Vec<Decoded> = sources.par_iter().map(read).collect();
        for (source, Decoded { image, warnings, notes }) in sources.drain(..).zip(images) {
            report.extend(&warnings);
            report.extend_notes(&notes);
            decoded.push(image.map_err(|problem| unreadable.push((source.need.index, problem))).ok());
        }
    };
    for &need in needs {
        if !numbers.contains_key(&need.index)
            && let Ok(source) = fetch(doc, need, report)
        {
            bytes += source.fetched.bytes.len();
            pending.push(source);
            numbers.insert(need.index, numbers.len());
            if bytes > READ_TOGETHER {
                decode(&mut pending, report);
                bytes = 0;
            }
        }
    }
    decode(&mut pending, report);
    let image = |need: &ImageNeed| {
        let image = decoded.get(*numbers.get(&need.index)?)?.as_ref()?;
        let encoding = match *image.pixels {
            Pixels::F32(_) => Encoding::Linear,
            Pixels::U8(_) | Pixels::U16(_) | Pixels::Encoded(_) => need.encoding,
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
    let on_damage = on_damage(doc, name.clone(), at);
    Ok(Source { need, name, fetched, on_damage })
}

/// An image, or the problem of the asset that it is, and what is to be said of it.
struct Decoded {
    image: Result<Image, Problem>,
    warnings: Vec<Warning>,
    /// What is left aside as glTF demands.
    notes: Vec<Warning>,
}

fn decode_source(asset: &Path, source: &Source, is_lazy: bool) -> Decoded {
    let Fetched { bytes, mime, file } = &source.fetched;
    let purpose = if source.need.encoding == Encoding::Srgb { Use::Color } else { Use::Data };
    let at = pointer("images", source.need.index);
    let mut warnings = Vec::new();
    let place = match file {
        Some(file) => (file.as_path(), ""),
        None => (asset, at.as_str()),
    };
    let (own_file, mime) = (file.as_deref(), mime.as_deref());
    let image = match is_lazy {
        true => {
            let of = ImageFile { bytes: Cow::Borrowed(bytes), own_file, place, mime };
            for_texture(of, purpose, &mut warnings, source.on_damage.clone())
        }
        false => decode(bytes, place.0, place.1, mime, purpose, &mut warnings),
    };
    let image = match image {
        Ok(image) => Ok(Image { name: source.name.clone(), ..image }),
        Err(error) => Err(problem(error, &source.name, &at)),
    };
    let notes = if image.is_ok() { unused(bytes, place.0, place.1, purpose) } else { Vec::new() };
    Decoded { image, warnings, notes }
}

/// What the asset says of an image that can't be decoded.
fn problem(error: Error, name: &str, at: &str) -> Problem {
    let messages: Vec<String> = error.problems.iter().map(|p| p.message.clone()).collect();
    let help = error.problems.into_iter().find_map(|p| p.help);
    Problem { help, ..Problem::new(at, format!("'{name}' {}", messages.join("; "))) }
}

/// Later on, damaged images are told of as they are now.
fn on_damage(doc: &Document, name: String, at: String) -> OnDamage {
    let file = doc.path.to_path_buf();
    let in_names = doc.in_names(&at);
    Arc::new(move |error| match problem(error, &name, &at) {
        problem if problem.help.is_some() => Damage::Fatal(Error::input_problems(&file, vec![problem])),
        problem => Damage::LeftOut(Warning::new(&file, in_names.as_str(), without_texture(&problem.message))),
    })
}
