//! Gaussian splats: code shared by all formats. Invalid or invisible splats are left out or repaired, and counted.
//!
//! SPZ: compressed Gaussian splats of Niantic Labs (format described in its README, versions 2 to 4). Versions 2 and 3
//! are one gzip stream; version 4 has an uncompressed header and a Zstandard stream for each attribute. Positions have 24-bit
//! fixed-point coordinates, other attributes 8 or 10 bits. x points right, y up and z back.

use super::mesh_tools::NAMELESS;
use super::{LoadOptions, Loaded, Up, UpHint, files, mesh_tools};
use crate::error::{Error, Problem, Result, Warning};
use crate::math::{DAffine3, DVec3, Quat, Vec3, poly};
use crate::scene::{
    ColorSlot, Emission, Instance, Material, MaterialId, Mesh, MeshId, MeshPart, Model, Splats,
};
use half::f16;
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

/// Minimum ratio of the shortest to the longest axis of a splat, limited by single precision.
const MIN_AXIS_RATIO: f32 = 1e-4;

/// A splat of a file, with linear scales and opacity.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileSplat<'a> {
    pub center: DVec3,
    /// Standard deviations along the splat's axes.
    pub scales: [f32; 3],
    /// Quaternion x, y, z, w of any length.
    pub rotation: [f32; 4],
    /// 0 to 1.
    pub opacity: f32,
    /// RGB coefficients of spherical harmonics: (degree + 1)^2.
    pub coefficients: &'a [[f32; 3]],
}

/// Splats of a file, and counts of invalid ones.
#[derive(Default)]
pub(super) struct SplatList {
    /// Relative to the origin.
    centers: Vec<[f32; 3]>,
    splats: Splats,
    /// Origin of the centers, in file space.
    origin: DVec3,
    not_finite: usize,
    invisible: usize,
    zero_rotations: usize,
}

impl SplatList {
    /// An empty list with capacity for `count`.
    ///
    /// # Errors
    /// Not enough memory.
    pub fn new(count: usize, degree: u8, origin: DVec3) -> std::result::Result<SplatList, Problem> {
        let mut list = SplatList { origin, ..SplatList::default() };
        list.splats.degree = degree;
        let coefficients = count.saturating_mul(Splats::coefficients_of(degree));
        let reserved = list.centers.try_reserve_exact(count).is_ok()
            && list.splats.scales.try_reserve_exact(count).is_ok()
            && list.splats.rotations.try_reserve_exact(count).is_ok()
            && list.splats.opacities.try_reserve_exact(count).is_ok()
            && list.splats.coefficients.try_reserve_exact(coefficients).is_ok();
        match reserved {
            true => Ok(list),
            false => Err(Problem::new("", format!("there is no memory for {count} splats"))),
        }
    }

    /// Adds a splat if it is valid and visible.
    pub fn push(&mut self, splat: &FileSplat<'_>) {
        let FileSplat { center, scales, rotation, opacity, coefficients } = splat;
        let center = (*center - self.origin).as_vec3();
        let are_finite = scales.iter().chain(rotation).chain([opacity]).all(|x| x.is_finite());
        let has_color = coefficients.as_flattened().iter().all(|c| c.is_finite());
        let longest = Vec3::from_array(*scales).abs().max_element();
        if !(center.is_finite() && are_finite && has_color) {
            self.not_finite += 1;
            return;
        }
        if *opacity < Splats::MIN_OPACITY || longest <= f32::MIN_POSITIVE {
            self.invisible += 1;
            return;
        }
        let min_scale = longest * MIN_AXIS_RATIO;
        let quaternion = Quat::from_array(*rotation);
        let length = quaternion.length();
        // The length may overflow.
        let is_rotation = length > 0.0 && length.is_finite();
        self.zero_rotations += usize::from(!is_rotation);
        let rotation = if is_rotation { quaternion / length } else { Quat::IDENTITY };
        self.centers.push(center.to_array());
        self.splats.scales.push(scales.map(|scale| scale.abs().max(min_scale)));
        self.splats.rotations.push(rotation.to_array());
        self.splats.opacities.push(opacity.min(1.0));
        let limit = f16::MAX.to_f32();
        let half = |c: &[f32; 3]| c.map(|x| f16::from_f32(x.clamp(-limit, limit)));
        self.splats.coefficients.extend(coefficients.iter().map(half));
    }

    /// Sets whether colours are linear; the default is sRGB-encoded.
    pub fn set_linear(&mut self, is_linear: bool) {
        self.splats.is_linear = is_linear;
    }

    /// Warnings about invalid splats, and a note about invisible ones.
    pub fn messages(&self) -> (Vec<(&'static str, String)>, Option<String>) {
        let mut messages = Vec::new();
        let mut add = |count: usize, code: &'static str, what: &str| {
            if count > 0 {
                messages.push((code, format!("{count} splats {what}")));
            }
        };
        add(self.not_finite, "splats-not-finite", "with values that aren't finite were left out");
        add(self.zero_rotations, "splats-not-rotated", "with a zero quaternion are not rotated");
        let faint = (self.invisible > 0)
            .then(|| format!("{} splats without size or of an opacity below 1/255", self.invisible));
        (messages, faint)
    }

    /// Centers relative to the origin.
    pub fn centers(&self) -> &[[f32; 3]] {
        &self.centers
    }

    /// Whether there are no visible splats.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// A mesh of all splats with one material.
    pub fn into_mesh(self, name: &str, material: MaterialId) -> Mesh {
        let part = MeshPart { first_triangle: 0, triangle_count: 0, material };
        Mesh {
            name: name.to_string(),
            positions: self.centers,
            splats: Some(Arc::new(self.splats)),
            parts: vec![part],
            ..Mesh::default()
        }
    }
}

/// The material of splats: emission of their colours, without scattering.
pub(super) fn material() -> Material {
    let radiance = ColorSlot::constant([1.0; 3]);
    Material {
        emission: Some(Emission { radiance, two_sided: true }),
        use_vertex_colors: true,
        ..Material::new("splats", Model::Black)
    }
}

/// The scene of a file with splats only. `up`: the up axis customary for its format, with the reason for messages.
pub(super) fn finish(path: &Path, list: SplatList, up: (Up, &'static str)) -> Result<Loaded> {
    let mut loaded = Loaded::default();
    let (messages, faint) = list.messages();
    loaded.warnings.extend(messages.into_iter().map(|what| Warning::new(path, "", what)));
    loaded.left_out.extend(faint);
    if list.is_empty() {
        return Err(Error::input(path, ("splats-invisible", "has no visible splats")));
    }
    u32::try_from(list.centers.len())
        .map_err(|_| Error::input(path, "has more than 4,294,967,295 splats"))?;
    let origin = list.origin;
    loaded.scene.materials.push(material());
    loaded.scene.meshes.push(list.into_mesh("splats", MaterialId(0)));
    let instance = Instance { name: NAMELESS.to_string(), ..Instance::new(MeshId(0), DAffine3::IDENTITY) };
    loaded.scene.instances.push(instance);
    mesh_tools::place_at_origin(path, origin, &mut loaded);
    loaded.up_hint = UpHint { writer: Some(up), is_mostly_y: true };
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(loaded)
}

/// Logistic function: opacity from its logit.
pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// e to the power x, with the same bits on all CPUs; infinity or 0 beyond the range of single precision.
pub(super) fn exp(x: f32) -> f32 {
    match x {
        x if x > 88.0 => f32::INFINITY,
        x if x < -87.0 => 0.0,
        x => poly::exp(x),
    }
}

/// First bytes of SPZ files, after decompression.
pub(crate) const MAGIC: &[u8] = b"NGSP";

/// Size of the header up to version 3, bytes.
const OLD_HEADER: usize = 16;
/// Size of the header from version 4 on, bytes.
const HEADER: usize = 32;
/// Maximum compression ratio of Zstandard streams; files with larger declared sizes are refused.
const MAX_RATIO: usize = 1024;
/// Colours are stored as 0.5 + 0.15 times their first coefficient.
const COLOR_SCALE: f32 = 0.15;

/// Reads an SPZ file.
///
/// # Errors
/// An input error for a damaged file or an unknown version.
pub(in crate::load) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let bytes = files::read_model(path)?;
    let (list, warning) = read(&bytes).map_err(|problem| Error::input_problems(path, vec![problem]))?;
    drop(bytes);
    let mut loaded = finish(path, list, (Up::Y, "convention of SPZ files"))?;
    loaded.warnings.extend(warning.map(|what| Warning::new(path, "", what)));
    Ok(loaded)
}

/// The attribute lists of all splats, in file order.
struct Streams<'a> {
    positions: Cow<'a, [u8]>,
    alphas: Cow<'a, [u8]>,
    colors: Cow<'a, [u8]>,
    scales: Cow<'a, [u8]>,
    rotations: Cow<'a, [u8]>,
    harmonics: Cow<'a, [u8]>,
}

impl<'a> Streams<'a> {
    /// Reads lists of these sizes in bytes; `next` reads the next one.
    fn of<E>(
        sizes: [usize; 6],
        mut next: impl FnMut(usize) -> std::result::Result<Cow<'a, [u8]>, E>,
    ) -> std::result::Result<Streams<'a>, E> {
        let [positions, alphas, colors, scales, rotations, harmonics] = sizes;
        Ok(Streams {
            positions: next(positions)?,
            alphas: next(alphas)?,
            colors: next(colors)?,
            scales: next(scales)?,
            rotations: next(rotations)?,
            harmonics: next(harmonics)?,
        })
    }
}

struct Header {
    version: u32,
    /// Number of splats.
    count: usize,
    /// Degree of spherical harmonics.
    degree: u8,
    /// Fractional bits of positions.
    fraction_bits: u8,
}

impl Header {
    fn of(bytes: &[u8]) -> std::result::Result<Header, Problem> {
        if !bytes.starts_with(MAGIC) || bytes.len() < OLD_HEADER {
            return Err(Problem::new("", "is not an SPZ file: its header is missing"));
        }
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k]));
        let (version, degree, fraction_bits) = (word(4), bytes[12], bytes[13]);
        if !(2..=4).contains(&version) {
            let help = "convert it to PLY, or save it with another version of the program that wrote it";
            return Err(Problem::new("", format!("is SPZ version {version}: versions 2 to 4 are supported"))
                .with_help(help));
        }
        if degree > 4 || fraction_bits > 24 {
            let message =
                format!("has spherical harmonics of degree {degree} and {fraction_bits} fractional bits");
            return Err(Problem::new("", message).with_help("the file is damaged"));
        }
        Ok(Header { version, count: word(8) as usize, degree, fraction_bits })
    }

    /// Number of coefficients per channel after the first.
    fn higher_coefficients(&self) -> usize {
        Splats::coefficients_of(self.degree) - 1
    }

    /// Size of a splat's rotation, bytes.
    fn rotation_size(&self) -> usize {
        if self.version >= 3 { 4 } else { 3 }
    }

    /// Sizes of the lists, bytes: positions, alphas, colours, scales, rotations, harmonics.
    fn sizes(&self) -> [usize; 6] {
        [9, 1, 3, 3, self.rotation_size(), 3 * self.higher_coefficients()]
            .map(|n: usize| n.saturating_mul(self.count))
    }
}

/// The splats of a file, and a warning about unread data.
pub(in crate::load) fn read(bytes: &[u8]) -> std::result::Result<(SplatList, Option<String>), Problem> {
    let header = Header::of(bytes)?;
    let streams = if header.version >= 4 {
        zstd_streams(&header, bytes)?
    } else {
        uncompressed_streams(&header, bytes)?
    };
    let degree = header.degree.min(Splats::MAX_DEGREE);
    let mut list = SplatList::new(header.count, degree, DVec3::ZERO)?;
    let unit = f64::from(1u32 << header.fraction_bits).recip();
    let (rotation_size, higher_coefficients) = (header.rotation_size(), header.higher_coefficients());
    let mut coefficients: Vec<[f32; 3]> = Vec::new();
    for i in 0..header.count {
        let three = |list: &[u8]| -> [f32; 3] { std::array::from_fn(|k| f32::from(list[3 * i + k])) };
        let coordinate = |axis: usize| {
            let at = 9 * i + 3 * axis;
            let [a, b, c] = [0, 1, 2].map(|k: usize| streams.positions[at + k]);
            // The shift sign-extends 24 bits.
            f64::from(i32::from_le_bytes([0, a, b, c]) >> 8) * unit
        };
        coefficients.clear();
        coefficients.push(three(&streams.colors).map(|c| (c / 255.0 - 0.5) / COLOR_SCALE));
        let own = &streams.harmonics[3 * higher_coefficients * i..3 * higher_coefficients * (i + 1)];
        let byte = |b: u8| (f32::from(b) - 128.0) / 128.0;
        let rest = own.chunks_exact(3).take(Splats::coefficients_of(degree) - 1);
        coefficients.extend(rest.map(|c| [byte(c[0]), byte(c[1]), byte(c[2])]));
        let rotation = &streams.rotations[rotation_size * i..rotation_size * (i + 1)];
        list.push(&FileSplat {
            center: DVec3::new(coordinate(0), coordinate(1), coordinate(2)),
            scales: three(&streams.scales).map(|s| exp(s / 16.0 - 10.0)),
            rotation: if rotation_size == 4 { smallest_three(rotation) } else { first_three(rotation) },
            opacity: f32::from(streams.alphas[i]) / 255.0,
            coefficients: &coefficients,
        });
    }
    let left_out = header.degree > Splats::MAX_DEGREE;
    Ok((list, left_out.then(|| "spherical harmonics of degree 4 are left out".to_string())))
}

fn truncated(header: &Header) -> Problem {
    let message = format!("is truncated or damaged: data of its {} splats is missing", header.count);
    Problem::new("", message).with_help("export or download the file again")
}

/// Uncompressed lists after the header.
fn uncompressed_streams<'a>(header: &Header, bytes: &'a [u8]) -> std::result::Result<Streams<'a>, Problem> {
    let mut rest = &bytes[OLD_HEADER..];
    let next = |size: usize| {
        let (list, after) = rest.split_at_checked(size).ok_or_else(|| truncated(header))?;
        rest = after;
        Ok(Cow::Borrowed(list))
    };
    Streams::of(header.sizes(), next)
}

/// Lists in one Zstandard stream each; empty ones have none.
fn zstd_streams<'a>(header: &Header, bytes: &'a [u8]) -> std::result::Result<Streams<'a>, Problem> {
    let sizes = header.sizes();
    let stream_count = sizes.iter().filter(|size| **size > 0).count();
    let word = |at: usize| {
        let bytes: [u8; 8] = bytes.get(at..at.checked_add(8)?)?.try_into().ok()?;
        usize::try_from(u64::from_le_bytes(bytes)).ok()
    };
    if bytes.len() < HEADER || usize::from(bytes[15]) != stream_count {
        return Err(truncated(header));
    }
    let table = word(16).map_or(0, |word| word & 0xffff_ffff);
    let mut at = table.saturating_add(16 * stream_count);
    let mut number = 0;
    let next = |size: usize| {
        if size == 0 {
            return Ok(Cow::Borrowed(&[][..]));
        }
        let entry = table.saturating_add(16 * number);
        number += 1;
        let compressed = word(entry)
            .and_then(|length| bytes.get(at..at.checked_add(length)?))
            .ok_or_else(|| truncated(header))?;
        at += compressed.len();
        if size > compressed.len().saturating_mul(MAX_RATIO) {
            return Err(truncated(header));
        }
        let list = unzstd(compressed, size)?;
        if list.len() == size { Ok(Cow::Owned(list)) } else { Err(truncated(header)) }
    };
    Streams::of(sizes, next)
}

/// Decompresses at most `size` bytes of a Zstandard stream.
#[cfg(feature = "ktx2")]
fn unzstd(compressed: &[u8], size: usize) -> std::result::Result<Vec<u8>, Problem> {
    use std::io::Read;
    let invalid = |e: String| Problem::new("", format!("has invalid Zstandard data: {e}"));
    let decoder = ruzstd::StreamingDecoder::new(compressed).map_err(|e| invalid(e.to_string()))?;
    let mut list = Vec::new();
    decoder.take(size as u64).read_to_end(&mut list).map_err(|e| invalid(e.to_string()))?;
    Ok(list)
}

#[cfg(not(feature = "ktx2"))]
fn unzstd(_: &[u8], _: usize) -> std::result::Result<Vec<u8>, Problem> {
    let message = "is SPZ version 4, which needs Zstandard";
    Err(Problem::new("", message).with_help("build with the feature 'ktx2', which includes Zstandard"))
}

/// A quaternion (x, y, z, w) from three bytes for x, y and z; w is not negative.
fn first_three(bytes: &[u8]) -> [f32; 4] {
    let [x, y, z] = [0, 1, 2].map(|k: usize| f32::from(bytes[k]) / 127.5 - 1.0);
    [x, y, z, (1.0 - (x * x + y * y + z * z)).max(0.0).sqrt()]
}

/// A quaternion (x, y, z, w) in smallest-three encoding: the index of the largest component in the upper two bits; each of the
/// others has a sign and nine bits, the last component in the lowest bits.
fn smallest_three(bytes: &[u8]) -> [f32; 4] {
    let mut word = u32::from_le_bytes(std::array::from_fn(|k| bytes[k]));
    let largest = (word >> 30) as usize;
    let (mut quaternion, mut squares) = ([0.0; 4], 0.0);
    for component in (0..4).rev().filter(|component| *component != largest) {
        let magnitude = (word & 511) as f32 / 511.0 * std::f32::consts::FRAC_1_SQRT_2;
        quaternion[component] = if word & 512 != 0 { -magnitude } else { magnitude };
        squares += magnitude * magnitude;
        word >>= 10;
    }
    quaternion[largest] = (1.0f32 - squares).max(0.0).sqrt();
    quaternion
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An SPZ file of version 3 with one splat of degree 1.
    fn file() -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([3, 0, 0, 0, 1, 0, 0, 0, 1, 12, 0, 0]);
        // 1, -0.5 and 2 in units of 1 / 4096.
        for coordinate in [4096i32, -2048, 8192] {
            bytes.extend(&coordinate.to_le_bytes()[..3]);
        }
        bytes.push(204);
        bytes.extend([255, 0, 128]);
        bytes.extend([160, 144, 128]);
        // The largest is w; x is -1/2, y 1/2 and z 1/2: 511 sqrt(1/2) is 361.
        let word = 3u32 << 30 | (512 | 361) << 20 | 361 << 10 | 361;
        bytes.extend(word.to_le_bytes());
        bytes.extend([128, 0, 255, 192, 128, 64, 128, 128, 128]);
        bytes
    }

    #[test]
    fn splats_are_unpacked() {
        let (list, warning) = read(&file()).expect("a complete file");
        assert!(warning.is_none());
        assert_eq!(list.centers(), [[1.0, -0.5, 2.0]]);
        let splats = &list.splats;
        assert_eq!(splats.opacities, [0.8]);
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 3e-3);
        assert!(near(&splats.scales[0], &[1.0, 0.368, 0.135]), "{:?}", splats.scales);
        assert!(near(&splats.rotations[0], &[-0.5, 0.5, 0.5, 0.5]), "{:?}", splats.rotations);
        let coefficient = |i: usize| splats.coefficients[i].map(|c| c.to_f32());
        assert!(near(&coefficient(0), &[0.5 / 0.15, -0.5 / 0.15, 0.002 / 0.15]), "{:?}", coefficient(0));
        assert!(near(&coefficient(1), &[0.0, -1.0, 0.992]) && near(&coefficient(2), &[0.5, 0.0, -0.5]));
    }

    #[test]
    fn damaged_files_are_errors() {
        let whole = file();
        for length in 0..whole.len() {
            assert!(read(&whole[..length]).is_err(), "{length}");
        }
        for (at, value) in [(4, 9), (4, 4), (8, 2), (11, 255), (12, 5), (13, 99)] {
            let mut other = whole.clone();
            other[at] = value;
            assert!(read(&other).is_err(), "{at}");
        }
    }
}
