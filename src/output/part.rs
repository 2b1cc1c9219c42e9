//! Part files (`.part`): exact sums of a partial or unfinished picture. EXR can't store them, since sums are pairs of an f64 and an f32,
//! and lists of ids.
//!
//! Format: 16 bytes magic number; length of the header as a u64; header, JSON; the film's sums; the background image, if any; state
//! for resuming; and the CRC-32 of all that. Numbers are little-endian.

use super::atomic::write_with;
use crate::error::{Error, Problem, Result};
use crate::film::{Aov, AovSet, Channel, Film, Layout};
use crate::image::{Encoding, Image, Pixels};
use crate::scene::{Backdrop, CatcherOutput, is_group_name};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

// Reading and writing.

/// Magic number with the version of the format.
const MAGIC: &[u8; 16] = b"oscura part 0003";

/// Maximum length of the header, bytes.
const MAX_HEADER: u64 = 64 << 20;

/// Contents of a partial render or checkpoint.
pub struct PartFile {
    /// Header.
    pub header: PartHeader,
    /// Film, at its position in the picture.
    pub film: Film,
    /// Background image.
    pub backdrop: Option<Backdrop>,
    /// State of the noise estimate, for resuming.
    pub resume_state: Vec<u8>,
}

/// Writer that computes a checksum.
struct Checked<T> {
    inner: T,
    checksum: crc32fast::Hasher,
}

impl<T> Checked<T> {
    fn new(inner: T) -> Checked<T> {
        Checked { inner, checksum: crc32fast::Hasher::new() }
    }
}

impl<T: Write> Write for Checked<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.checksum.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<T: Read> Read for Checked<T> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(bytes)?;
        self.checksum.update(&bytes[..count]);
        Ok(count)
    }
}

/// Writes a part file atomically. Sets the header's fields about background and state for resuming.
///
/// # Errors
/// An output error; an existing file is then unchanged.
pub fn write_part(
    path: &Path,
    mut header: PartHeader,
    film: &Film,
    backdrop: Option<&Backdrop>,
    resume_state: &[u8],
) -> Result<()> {
    header.resume_bytes = resume_state.len() as u64;
    header.output.background = match backdrop {
        None => StoredBackground::Nothing,
        Some(Backdrop::Color(color)) => StoredBackground::Color(color.map(f32::to_bits)),
        Some(Backdrop::Picture(image)) => StoredBackground::Picture(image.width, image.height),
    };
    let head = serde_json::to_vec(&header).map_err(|e| Error::output(path, e.to_string()))?;
    write_with(path, &mut |writer| {
        let mut writer = Checked::new(writer);
        writer.write_all(MAGIC)?;
        writer.write_all(&(head.len() as u64).to_le_bytes())?;
        writer.write_all(&head)?;
        film.write_sums(&mut writer)?;
        if let Some(Backdrop::Picture(image)) = backdrop {
            let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
            pixels.map(|(x, y)| image.rgba(x, y)).try_for_each(|rgba| {
                let bytes: [[u8; 4]; 4] = rgba.map(f32::to_le_bytes);
                writer.write_all(bytes.as_flattened())
            })?;
        }
        writer.write_all(resume_state)?;
        let checksum = writer.checksum.clone().finalize();
        writer.write_all(&checksum.to_le_bytes())
    })
}

/// Reads only the header of a part file.
///
/// # Errors
/// An input error if it is not a part file.
pub fn read_header(path: &Path) -> Result<PartHeader> {
    let opened = open(path)?;
    Ok(opened.header)
}

/// Reads a part file.
///
/// # Errors
/// An input error if it is not a part file or damaged, a usage error if memory runs out.
pub fn read_part(path: &Path) -> Result<PartFile> {
    let Opened { mut reader, header, remaining } = open(path)?;
    let region = header.region;
    let layout = header.channels.layout().ok_or_else(|| damaged(path, "its channels are unknown"))?;
    let pixels = u64::from(region.width()) * u64::from(region.height());
    let background_bytes = match header.output.background {
        StoredBackground::Picture(width, height) => (u64::from(width) * u64::from(height)).checked_mul(16),
        _ => Some(0),
    };
    // Check sizes of the header before allocating memory.
    let needed = pixels.checked_mul(layout.bytes_per_pixel()).and_then(|n| n.checked_add(background_bytes?));
    let needed = needed.and_then(|n| n.checked_add(header.resume_bytes));
    if needed.is_none_or(|needed| needed > remaining) {
        return Err(damaged(path, "it ends early"));
    }
    let mut film = Film::of_layout(region.width(), region.height(), layout)?.at(region.x0, region.y0);
    let rest = film.read_sums(&mut reader).and_then(|()| {
        let backdrop = read_backdrop(&mut reader, &header.output.background)?;
        let mut resume_state = Vec::new();
        Read::by_ref(&mut reader).take(header.resume_bytes).read_to_end(&mut resume_state)?;
        let checksum = reader.checksum.clone().finalize();
        let mut end = Vec::new();
        Read::by_ref(&mut reader).take(5).read_to_end(&mut end)?;
        Ok((backdrop, resume_state, end == checksum.to_le_bytes()))
    });
    match rest {
        Ok((backdrop, resume_state, true)) => Ok(PartFile { header, film, backdrop, resume_state }),
        Ok(_) => Err(damaged(path, "its checksum is wrong")),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(damaged(path, "it ends early")),
        Err(error) => Err(damaged(path, &error.to_string())),
    }
}

/// A part file after its header.
struct Opened {
    reader: Checked<BufReader<File>>,
    header: PartHeader,
    /// Remaining bytes of the file.
    remaining: u64,
}

fn open(path: &Path) -> Result<Opened> {
    let unreadable = |e: io::Error| match e.kind() {
        io::ErrorKind::NotFound => Error::input(path, "there is no such file"),
        _ => Error::input(path, format!("can't be read: {e}")),
    };
    let file = File::open(path).map_err(unreadable)?;
    let size = file.metadata().map_err(unreadable)?.len();
    let mut reader = Checked::new(BufReader::new(file));
    let (mut magic, mut length) = ([0; 16], [0; 8]);
    let begun = reader.read_exact(&mut magic).and_then(|()| reader.read_exact(&mut length));
    let is_part = begun.is_ok() && magic[..12] == MAGIC[..12];
    if !is_part {
        let help = "part files are written by rendering a part of a picture, and as checkpoints";
        return Err(Error::input(path, "is not a .part file").with_help(help).with_code("not-a-part"));
    }
    if &magic != MAGIC {
        let message = "is a part file of another program version";
        return Err(Error::input(path, message).with_help("render it again"));
    }
    let length = u64::from_le_bytes(length);
    let remaining = size.saturating_sub(24).checked_sub(length);
    let remaining =
        remaining.filter(|_| length <= MAX_HEADER).ok_or_else(|| damaged(path, "it ends early"))?;
    let mut head = Vec::new();
    Read::by_ref(&mut reader).take(length).read_to_end(&mut head).map_err(unreadable)?;
    let header: PartHeader = serde_json::from_slice(&head)
        .map_err(|e| damaged(path, &format!("its header can't be parsed: {e}")))?;
    check(&header).map_err(|what| damaged(path, what))?;
    Ok(Opened { reader, header, remaining })
}

/// Checks that the numbers of a header are consistent.
fn check(header: &PartHeader) -> std::result::Result<(), &'static str> {
    let PartHeader { width, height, samples, region, first_sample, end_sample, .. } = header;
    let is_within =
        region.x0 <= region.x1 && region.x1 <= *width && region.y0 <= region.y1 && region.y1 <= *height;
    let has_samples = first_sample <= end_sample && end_sample <= samples;
    let has_valid_background = match header.output.background {
        StoredBackground::Picture(width, height) => width > 0 && height > 0,
        _ => true,
    };
    if is_within && has_samples && has_valid_background {
        Ok(())
    } else {
        Err("the numbers of its header are inconsistent")
    }
}

fn read_backdrop(reader: &mut dyn Read, background: &StoredBackground) -> io::Result<Option<Backdrop>> {
    Ok(match *background {
        StoredBackground::Nothing => None,
        StoredBackground::Color(bits) => Some(Backdrop::Color(bits.map(f32::from_bits))),
        StoredBackground::Picture(width, height) => {
            let mut pixels = vec![0.0f32; width as usize * height as usize * 4];
            reader.read_exact(bytemuck::cast_slice_mut(&mut pixels))?;
            let pixels = Arc::new(Pixels::F32(pixels));
            let name = String::new();
            Some(Backdrop::Picture(Image {
                name,
                width,
                height,
                channels: 4,
                encoding: Encoding::Linear,
                pixels,
            }))
        }
    })
}

fn damaged(path: &Path, what: &str) -> Error {
    Error::input(path, ("part-damaged", format!("is damaged: {what}"))).with_help("render it again")
}

// Header of part files.

/// Everything that samples depend on, by name: values of settings, fingerprints of scene data.
pub type Identity = BTreeMap<String, String>;

/// Prefix of fingerprints among the values of an [`Identity`].
pub const FINGERPRINT_PREFIX: &str = "#";

/// Messages about the differences of two identities: `ours` is "here", `theirs` is "there".
pub fn differences(ours: &Identity, theirs: &Identity) -> Vec<String> {
    let names = ours.keys().chain(theirs.keys().filter(|name| !ours.contains_key(*name)));
    let differing = names.filter(|name| ours.get(*name) != theirs.get(*name));
    let shown = |value: Option<&String>| value.map_or("missing", String::as_str).to_string();
    let messages = differing.map(|name| {
        let (ours, theirs) = (shown(ours.get(name)), shown(theirs.get(name)));
        match ours.starts_with(FINGERPRINT_PREFIX) || theirs.starts_with(FINGERPRINT_PREFIX) {
            true => format!("{name} changed"),
            false => format!("{name} is {ours} here and {theirs} there"),
        }
    });
    messages.collect()
}

/// A rectangle of pixels; right and bottom exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// Left column.
    pub x0: u32,
    /// Top row.
    pub y0: u32,
    /// Right column, exclusive.
    pub x1: u32,
    /// Bottom row, exclusive.
    pub y1: u32,
}

impl Region {
    /// Width, pixels.
    pub fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Height, pixels.
    pub fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }
}

impl std::fmt::Display for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{},{},{},{}", self.x0, self.y0, self.x1, self.y1)
    }
}

/// The path strategy of a render, as stored in the header.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredStrategy {
    /// Path splitting: number of paths from the first hit of each camera ray.
    pub branches: u32,
    /// Path reuse: block of pixels that share paths, by name.
    pub shared: Option<String>,
}

/// Time, paths and rays of rendering.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RenderCost {
    /// Wall-clock time of rendering, seconds.
    pub wall_s: f64,
    /// CPU time of rendering, seconds.
    pub cpu_s: f64,
    /// Number of paths.
    pub paths: u64,
    /// Number of rays.
    pub rays: u64,
}

/// Channels of the film.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Channels {
    /// AOVs by option name.
    pub aovs: Vec<String>,
    /// Number of levels of Cryptomattes.
    pub matte_levels: u32,
    /// Names of the light groups.
    pub light_groups: Vec<String>,
    /// Does the film have half buffers?
    pub halves: bool,
    /// Does the film have channels of shadow catchers?
    #[serde(default)]
    pub catchers: bool,
    /// Is the output [`CatcherOutput::Shadows`]?
    #[serde(default)]
    pub shadows_only: bool,
}

impl Channels {
    /// The output of shadow catchers.
    pub fn catcher_output(&self) -> CatcherOutput {
        if self.shadows_only { CatcherOutput::Shadows } else { CatcherOutput::All }
    }

    /// The AOVs; `None` if one is unknown.
    pub fn aovs(&self) -> Option<AovSet> {
        self.aovs.iter().map(|name| Aov::from_option(name)).collect()
    }

    /// The film's layout; `None` if a name or number is invalid.
    pub fn layout(&self) -> Option<Layout> {
        const MAX_LEVELS: u32 = 64;
        let aovs = self.aovs().filter(|_| (1..=MAX_LEVELS).contains(&self.matte_levels))?;
        if !self.light_groups.iter().all(|name| is_group_name(name)) {
            return None;
        }
        let groups = self.light_groups.iter().map(|name| Channel::light_group(name));
        let catchers = self.catchers.then(Channel::of_catchers).into_iter().flatten();
        let further = aovs.channels_with(self.matte_levels).chain(groups).chain(catchers);
        Some(Layout::new(further).with_halves(self.halves))
    }
}

/// Background of transparent pixels, as stored in the header. The pixels of an image follow the film's sums in the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum StoredBackground {
    /// Nothing.
    #[default]
    Nothing,
    /// Linear colour, as bits of floats.
    Color([u32; 3]),
    /// Image of this width and height, RGBA, 32-bit floats.
    Picture(u32, u32),
}

/// Output settings. Floats are stored as bits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OutputSettings {
    /// Random seed.
    pub seed: u32,
    /// World-to-camera matrix, column-major.
    pub world_to_camera: [u64; 16],
    /// World-to-NDC matrix, if known.
    #[serde(default)]
    pub world_to_ndc: Option<[u64; 16]>,
    /// Pixel aspect ratio, width over height; 1 if `None`.
    #[serde(default)]
    pub pixel_aspect: Option<u64>,
    /// Coordinate space of AOVs, by name; world space if empty.
    #[serde(default)]
    pub aov_space: String,
    /// Offset of the scene's origin in world space, metres.
    pub world_offset: Option<[u64; 3]>,
    /// Names in the manifest, by Cryptomatte.
    pub mattes: Vec<Vec<String>>,
    /// Warnings of loading and compiling.
    pub warnings: Vec<String>,
    /// Denoise the picture and keep only these AOVs, by option name; `None`: no denoising.
    #[serde(default)]
    pub denoise: Option<Vec<String>>,
    /// Owner of the picture.
    pub owner: Option<String>,
    /// 32-bit floats for colour in EXRs.
    pub float: bool,
    /// Write no dates and render times.
    pub reproducible: bool,
    /// View transform of display-referred output, by name.
    pub view: String,
    /// White balance of display-referred output, kelvin, as bits.
    pub white_balance: Option<u32>,
    /// 16 bits per channel in display-referred output.
    pub deep: bool,
    /// Exposure of display-referred output, stops.
    pub exposure: u32,
    /// Dither display-referred output.
    pub dither: bool,
    /// Display-referred output is composited over black.
    #[serde(default)]
    pub opaque: bool,
    /// Background.
    pub background: StoredBackground,
}

/// Header of a part file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartHeader {
    /// The identity of the picture.
    pub identity: Identity,
    /// Width of the whole picture, pixels.
    pub width: u32,
    /// Height of the whole picture, pixels.
    pub height: u32,
    /// Planned samples per pixel of the whole picture.
    pub samples: u32,
    /// Pixels in this file.
    pub region: Region,
    /// First sample in this file.
    pub first_sample: u32,
    /// End of the samples in this file, exclusive.
    pub end_sample: u32,
    /// Path strategy; `None` if undecided.
    pub strategy: Option<StoredStrategy>,
    /// Channels.
    pub channels: Channels,
    /// Time, paths and rays of rendering.
    pub cost: RenderCost,
    /// Output settings.
    pub output: OutputSettings,
    /// Size of the state for resuming, bytes.
    pub resume_bytes: u64,
}

// Checking that parts are complete.

/// Maximum number of items that an error lists.
const MAX_LISTED: usize = 20;

/// Half-open ranges of columns, rows and samples.
type Bounds = [(u32, u32); 3];

fn bounds(header: &PartHeader) -> Bounds {
    let Region { x0, y0, x1, y1 } = header.region;
    [(x0, x1), (y0, y1), (header.first_sample, header.end_sample)]
}

/// Number of samples.
fn volume(bounds: &Bounds) -> u128 {
    bounds.iter().map(|(from, to)| u128::from(to - from)).product()
}

/// The intersection of two boxes.
fn intersection(a: &Bounds, b: &Bounds) -> Option<Bounds> {
    let both: Bounds = std::array::from_fn(|k| (a[k].0.max(b[k].0), a[k].1.min(b[k].1)));
    both.iter().all(|(from, to)| from < to).then_some(both)
}

/// The samples and pixels of a range, for messages.
fn description(&[(x0, x1), (y0, y1), (from, to)]: &Bounds) -> String {
    format!("samples {from}..{to} of the pixels {}", Region { x0, y0, x1, y1 })
}

/// Checks that all parts belong to the same picture and do not overlap. Returns the missing samples.
///
/// # Errors
/// An input error with all problems.
pub fn check_parts(parts: &[(PathBuf, PartHeader)]) -> Result<Vec<String>> {
    let Some((first_file, first)) = most_common(parts) else { return Ok(Vec::new()) };
    let foreign = parts.iter().filter_map(|(file, header)| {
        let mut different = differences(&header.identity, &first.identity);
        if (header.width, header.height, header.samples) != (first.width, first.height, first.samples)
            || header.channels != first.channels
        {
            different.push("channels, size or number of samples differ".to_string());
        }
        // A film without samples has no path strategy.
        let is_empty = |header: &PartHeader| header.first_sample == header.end_sample;
        if header.strategy != first.strategy && !is_empty(header) && !is_empty(first) {
            different.push("the path strategy differs".to_string());
        }
        let what = format!("is of another picture than {}: {}", first_file.display(), different.join("; "));
        (!different.is_empty())
            .then(|| Problem::new(file.display().to_string(), what).with_code("part-of-another-picture"))
    });
    let mut problems: Vec<Problem> = foreign.collect();
    if problems.is_empty() {
        problems = overlaps(parts);
    }
    if !problems.is_empty() {
        let more = problems.len().saturating_sub(MAX_LISTED);
        problems.truncate(MAX_LISTED);
        if more > 0 {
            problems.push(Problem::new("", format!("and {more} more")));
        }
        return Err(Error::input_problems(first_file, problems));
    }
    Ok(missing(parts, first))
}

/// A part of the most frequent identity.
fn most_common(parts: &[(PathBuf, PartHeader)]) -> Option<&(PathBuf, PartHeader)> {
    let mut counts: Vec<(&(PathBuf, PartHeader), usize)> = Vec::new();
    for part in parts {
        match counts.iter_mut().find(|(other, _)| other.1.identity == part.1.identity) {
            Some((_, count)) => *count += 1,
            None => counts.push((part, 1)),
        }
    }
    counts.into_iter().rev().max_by_key(|(_, count)| *count).map(|(part, _)| part)
}

/// Problems of overlapping parts.
fn overlaps(parts: &[(PathBuf, PartHeader)]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for (at, (file, header)) in parts.iter().enumerate() {
        for (earlier, other) in &parts[..at] {
            if let Some(both) = intersection(&bounds(header), &bounds(other)) {
                let message = format!("has {}, which {} has as well", description(&both), earlier.display());
                problems.push(Problem::new(file.display().to_string(), message).with_code("parts-overlap"));
            }
        }
    }
    problems
}

/// The samples missing in parts that don't overlap.
fn missing(parts: &[(PathBuf, PartHeader)], first: &PartHeader) -> Vec<String> {
    let whole = [(0, first.width), (0, first.height), (0, first.samples)];
    let all: Vec<Bounds> = parts.iter().map(|(_, header)| bounds(header)).collect();
    if all.iter().map(volume).sum::<u128>() == volume(&whole) {
        return Vec::new();
    }
    // Subtract one part after another from the whole.
    let mut missing = vec![whole];
    for part in &all {
        missing = missing.iter().flat_map(|bounds| without(bounds, part)).collect();
    }
    let more = missing.len().saturating_sub(MAX_LISTED);
    let mut list: Vec<String> = missing.iter().take(MAX_LISTED).map(description).collect();
    list.extend((more > 0).then(|| format!("and {more} more")));
    list
}

/// The difference of two boxes: at most six boxes.
fn without(bounds: &Bounds, other: &Bounds) -> Vec<Bounds> {
    let Some(both) = intersection(bounds, other) else { return vec![*bounds] };
    let (mut pieces, mut rest) = (Vec::new(), *bounds);
    // Samples first, so that missing samples of whole pictures are reported as such.
    for k in [2, 1, 0] {
        for (from, to) in [(rest[k].0, both[k].0), (both[k].1, rest[k].1)] {
            if from < to {
                let mut piece = rest;
                piece[k] = (from, to);
                pieces.push(piece);
            }
        }
        rest[k] = both[k];
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_name_the_settings() {
        let of = |pairs: &[(&str, &str)]| -> Identity {
            pairs.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect()
        };
        let ours = of(&[("depth", "5"), ("the meshes", "#1"), ("seed", "0"), ("version", "1")]);
        let theirs = of(&[("depth", "8"), ("the meshes", "#2"), ("seed", "0")]);
        let expected =
            ["depth is 5 here and 8 there", "the meshes changed", "version is 1 here and missing there"];
        assert_eq!(differences(&ours, &theirs), expected);
        assert!(differences(&ours, &ours).is_empty());
    }
}

#[cfg(test)]
mod cover_tests {
    use super::*;
    use crate::output::part::{Channels, Identity, OutputSettings, RenderCost};

    fn part(name: &str, region: [u32; 4], first_sample: u32, end_sample: u32) -> (PathBuf, PartHeader) {
        let [x0, y0, x1, y1] = region;
        let channels = Channels {
            aovs: Vec::new(),
            matte_levels: 6,
            light_groups: Vec::new(),
            halves: false,
            catchers: false,
            shadows_only: false,
        };
        let header = PartHeader {
            identity: Identity::from([("seed".to_string(), "0".to_string())]),
            width: 40,
            height: 30,
            samples: 32,
            region: Region { x0, y0, x1, y1 },
            first_sample,
            end_sample,
            strategy: None,
            channels,
            cost: RenderCost::default(),
            output: OutputSettings::default(),
            resume_bytes: 0,
        };
        (name.into(), header)
    }

    #[test]
    fn missing_samples_are_reported() {
        let (left, right) = ([0, 0, 20, 30], [20, 0, 40, 30]);
        let mut parts = vec![part("a", left, 0, 32), part("b", right, 8, 32), part("c", right, 0, 8)];
        assert_eq!(check_parts(&parts).unwrap(), Vec::<String>::new());
        parts.pop();
        assert_eq!(check_parts(&parts).unwrap(), ["samples 0..8 of the pixels 20,0,40,30"]);
        parts.pop();
        assert_eq!(check_parts(&parts).unwrap(), ["samples 0..32 of the pixels 20,0,40,30"]);
        assert_eq!(check_parts(&[part("d", [5, 5, 6, 6], 8, 16)]).unwrap().len(), 6);
    }

    #[test]
    fn overlapping_or_unrelated_parts_are_refused() {
        let all = [0, 0, 40, 30];
        let error = check_parts(&[part("a", all, 0, 16), part("b", [3, 3, 5, 5], 8, 32)]).unwrap_err();
        assert!(
            error.to_string().contains("b: has samples 8..16 of the pixels 3,3,5,5, which a has"),
            "{error}"
        );
        let mut other = part("b", all, 16, 32);
        other.1.identity.insert("seed".to_string(), "1".to_string());
        let error = check_parts(&[part("a", all, 0, 16), other]).unwrap_err();
        assert!(
            error.to_string().contains("b: is of another picture than a: seed is 1 here and 0 there"),
            "{error}"
        );
    }
}
