//! PLY files of Gaussian splats: the layout of Kerbl et al. 2023 (reference implementation), and the compressed layout of
//! PlayCanvas's SuperSplat.
//!
//! Plain: `x y z`, logarithms of standard deviations `scale_0..2` (2D splats lack `scale_2`), the quaternion `rot_0..3`
//! (w first), the logit `opacity`, and spherical harmonics coefficients `f_dc_0..2` and `f_rest_*`, channel by channel.
//! Compressed: the element `chunk` has bounds for every 256 splats; `packed_position`, `packed_scale` (11, 10 and 11 bits)
//! and `packed_color` (8 bits, opacity last) are fractions between them; `packed_rotation` has the index of the largest
//! component of the quaternion and 10 bits for each of the others; the element `sh` has one byte per coefficient.

use super::header::Source;
use super::rows::{List, Record, Slot, to_f64};
use crate::error::{Error, Problem, Result, Warning};
use crate::load::splats::{FileSplat, SplatList, exp, finish, sigmoid};
use crate::load::{LoadOptions, Loaded, Up, mesh_tools};
use crate::math::DVec3;
use crate::scene::Splats;
use ply_rs::ply::Property;
use std::path::Path;

/// Names of the supported properties except `f_rest_*`, in the order of a row's values.
const NAMES: [&str; 36] = [
    "x",
    "y",
    "z",
    "scale_0",
    "scale_1",
    "scale_2",
    "rot_0",
    "rot_1",
    "rot_2",
    "rot_3",
    "opacity",
    "f_dc_0",
    "f_dc_1",
    "f_dc_2",
    "packed_position",
    "packed_rotation",
    "packed_scale",
    "packed_color",
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];
const SCALES: usize = 3;
const ROTATION: usize = 6;
const OPACITY: usize = 10;
const COLOR: usize = 11;
const PACKED: usize = 14;
const CHUNK: usize = 18;
const CHUNK_COLORS: usize = 30;
const REST: usize = NAMES.len();
/// Number of coefficients `f_rest_*` at degree 4, the highest that programs write.
const MAX_REST: usize = 72;

/// Splats per chunk.
const CHUNK_SIZE: usize = 256;

/// A row of any of the elements: values by index of `NAMES`, then `f_rest_*`.
struct Row {
    values: [f64; REST + MAX_REST],
}

impl Record for Row {
    fn new() -> Row {
        Row { values: [0.0; REST + MAX_REST] }
    }

    fn slot(name: &str) -> Option<Slot> {
        let rest = || {
            let number: usize = name.strip_prefix("f_rest_")?.parse().ok()?;
            (number < MAX_REST).then_some(REST + number)
        };
        NAMES.iter().position(|known| *known == name).or_else(rest).map(|place| Slot::Value(place as u8))
    }

    #[inline]
    fn set(&mut self, slot: Slot, value: &Property) {
        if let Slot::Value(place) = slot
            && let Some(to) = self.values.get_mut(usize::from(place))
        {
            *to = to_f64(value);
        }
    }

    fn list(&mut self, _: &str) -> Option<List<'_>> {
        None
    }
}

impl Row {
    fn at<const N: usize>(&self, first: usize) -> [f32; N] {
        std::array::from_fn(|k| self.values[first + k] as f32)
    }

    fn center(&self) -> DVec3 {
        DVec3::new(self.values[0], self.values[1], self.values[2])
    }
}

/// Spherical harmonics of the file.
#[derive(Clone, Copy)]
struct Harmonics {
    /// Coefficients per channel in the file, without the first (`f_dc`).
    count_in_file: usize,
    /// The degree that is loaded.
    degree: u8,
}

impl Harmonics {
    /// The harmonics among the properties of an element.
    fn of(source: &Source, element: &str) -> Harmonics {
        let has = |number: &usize| source.has(element, &format!("f_rest_{number}"));
        let count_in_file = (0..MAX_REST).take_while(has).count() / 3;
        let fits = |degree: &u8| Splats::coefficients_of(*degree) - 1 <= count_in_file;
        let degree = (0..=Splats::MAX_DEGREE).rev().find(fits).unwrap_or(0);
        Harmonics { count_in_file, degree }
    }

    /// Description of the coefficients left out, for a warning.
    fn left_out(self) -> Option<String> {
        let read = Splats::coefficients_of(self.degree) - 1;
        (self.count_in_file > read).then(|| {
            format!(
                "{} of {} coefficients of spherical harmonics per channel",
                self.count_in_file - read,
                self.count_in_file
            )
        })
    }

    /// Appends the RGB coefficients of a splat after the first; `value` reads a coefficient by its `f_rest` number.
    fn read(self, value: impl Fn(usize) -> f32, to: &mut Vec<[f32; 3]>) {
        let coefficient = |k: usize| [0, 1, 2].map(|channel: usize| value(channel * self.count_in_file + k));
        to.extend((0..Splats::coefficients_of(self.degree) - 1).map(coefficient));
    }
}

/// Reads the splats of a file.
///
/// # Errors
/// An input error for a truncated file, missing properties, or a file without splats.
pub(super) fn load(path: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Loaded> {
    let fail = |problem: Problem| Error::input_problems(path, vec![problem]);
    let open = || Source::open(bytes, &options.counter);
    let is_packed = open().map_err(fail)?.has("vertex", "packed_position");
    let read = |origin: DVec3| {
        let source = open()?;
        if is_packed { read_compressed(source, origin) } else { read_uncompressed(source, origin) }
    };
    let (mut list, left_out) = read(DVec3::ZERO).map_err(fail)?;
    let origin = mesh_tools::distant_origin(list.centers().iter());
    if origin != DVec3::ZERO {
        list = read(origin).map_err(fail)?.0;
    }
    // Splats are reconstructed in the space of photographs' cameras, which have y down.
    let mut loaded = finish(path, list, (Up::NegY, "convention of Gaussian splat files"))?;
    loaded.warnings.extend(left_out.map(|what| Warning::new(path, "", format!("{what}: left out"))));
    Ok(loaded)
}

/// Reads uncompressed splats.
fn read_uncompressed(
    mut source: Source,
    origin: DVec3,
) -> std::result::Result<(SplatList, Option<String>), Problem> {
    let is_flat = !source.has("vertex", "scale_2");
    let needed = NAMES[..PACKED].iter().filter(|name| !(is_flat && **name == "scale_2"));
    let missing: Vec<&str> = needed.filter(|name| !source.has("vertex", name)).copied().collect();
    if !missing.is_empty() {
        let message =
            ("splats-incomplete", format!("lacks the properties {} of Gaussian splats", missing.join(", ")));
        return Err(Problem::new("header", message));
    }
    let harmonics = Harmonics::of(&source, "vertex");
    let mut list = SplatList::new(source.count("vertex"), harmonics.degree, origin)?;
    let mut coefficients: Vec<[f32; 3]> = Vec::new();
    for (name, definition) in source.elements() {
        let is_splats = name == "vertex";
        source.read(&definition, |_, row: &Row| {
            if !is_splats {
                return;
            }
            coefficients.clear();
            coefficients.push(row.at(COLOR));
            harmonics.read(|k| row.values[REST + k] as f32, &mut coefficients);
            let mut scales: [f32; 3] = row.at::<3>(SCALES).map(exp);
            if is_flat {
                scales[2] = 0.0;
            }
            let [w, x, y, z] = row.at(ROTATION);
            let opacity = sigmoid(row.values[OPACITY] as f32);
            let (center, rotation) = (row.center(), [x, y, z, w]);
            list.push(&FileSplat { center, scales, rotation, opacity, coefficients: &coefficients });
        })?;
    }
    Ok((list, harmonics.left_out()))
}

/// Bounds of a chunk, [minimum, maximum]: positions, logarithms of scales, colours.
#[derive(Clone, Copy)]
struct Bounds {
    position: [[f32; 3]; 2],
    scale: [[f32; 3]; 2],
    color: [[f32; 3]; 2],
}

/// Reads compressed splats.
fn read_compressed(
    mut source: Source,
    origin: DVec3,
) -> std::result::Result<(SplatList, Option<String>), Problem> {
    let needed = NAMES[PACKED..CHUNK].iter().map(|name| ("vertex", *name));
    let needed = needed.chain(NAMES[CHUNK..CHUNK_COLORS].iter().map(|name| ("chunk", *name)));
    let missing: Vec<&str> = needed.filter(|(of, name)| !source.has(of, name)).map(|n| n.1).collect();
    if !missing.is_empty() {
        let message = (
            "splats-incomplete",
            format!("lacks the properties {} of compressed splats", missing.join(", ")),
        );
        return Err(Problem::new("header", message));
    }
    let (has_colors, count) = (source.has("chunk", "max_b"), source.count("vertex"));
    let harmonics = Harmonics::of(&source, "sh");
    let (mut chunks, mut words, mut rest): (Vec<Bounds>, Vec<[u32; 4]>, Vec<u8>) = Default::default();
    let numbers_per_row = 3 * harmonics.count_in_file;
    for (name, definition) in source.elements() {
        source.read(&definition, |_, row: &Row| match name.as_str() {
            "chunk" => {
                let pair = |first: usize| [row.at(first), row.at(first + 3)];
                let color = if has_colors { pair(CHUNK_COLORS) } else { [[0.0; 3], [1.0; 3]] };
                chunks.push(Bounds { position: pair(CHUNK), scale: pair(CHUNK + 6), color });
            }
            // `as` saturates.
            "vertex" => words.push(std::array::from_fn(|k| row.values[PACKED + k] as u32)),
            "sh" => rest.extend((0..numbers_per_row).map(|k| row.values[REST + k] as u8)),
            _ => {}
        })?;
    }
    if chunks.len() < words.len().div_ceil(CHUNK_SIZE)
        || rest.len() < numbers_per_row.saturating_mul(words.len())
    {
        let message =
            ("splats-incomplete", format!("has too few rows of 'chunk' or 'sh' for its {count} splats"));
        return Err(Problem::new("header", message).with_help("export or download the file again"));
    }
    let mut list = SplatList::new(words.len(), harmonics.degree, origin)?;
    let mut coefficients: Vec<[f32; 3]> = Vec::new();
    for (i, &splat) in words.iter().enumerate() {
        let bounds = &chunks[i / CHUNK_SIZE];
        let [position, rotation, scale, color] = splat;
        let center = lerp(bounds.position, unpack_11_10_11(position)).map(f64::from).into();
        let scales = lerp(bounds.scale, unpack_11_10_11(scale)).map(exp);
        let [r, g, b, opacity] = [24, 16, 8, 0].map(|shift| unorm(color, shift, 8));
        let color = lerp(bounds.color, [r, g, b]).map(|c| (c - 0.5) / Splats::FIRST_HARMONIC);
        coefficients.clear();
        coefficients.push(color);
        let own = &rest[i * numbers_per_row..(i + 1) * numbers_per_row];
        harmonics.read(|k| f32::from(own[k]) * (8.0 / 255.0) - 4.0, &mut coefficients);
        let rotation = unpack_smallest_three(rotation);
        list.push(&FileSplat { center, scales, rotation, opacity, coefficients: &coefficients });
    }
    Ok((list, harmonics.left_out()))
}

/// A bit field as a normalized number, 0 to 1.
fn unorm(word: u32, shift: u32, bits: u32) -> f32 {
    let max = (1u32 << bits) - 1;
    (word >> shift & max) as f32 / max as f32
}

/// Three normalized numbers of 11, 10 and 11 bits.
fn unpack_11_10_11(word: u32) -> [f32; 3] {
    [unorm(word, 21, 11), unorm(word, 11, 10), unorm(word, 0, 11)]
}

fn lerp([low, high]: [[f32; 3]; 2], t: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| low[k] + (high[k] - low[k]) * t[k])
}

/// A quaternion (x, y, z, w) in smallest-three encoding: 2 bits for the index of the largest component in (w, x, y, z), 10
/// bits for each of the others.
fn unpack_smallest_three(word: u32) -> [f32; 4] {
    let [a, b, c] = [20, 10, 0].map(|shift| (unorm(word, shift, 10) - 0.5) * std::f32::consts::SQRT_2);
    let largest = (1.0 - (a * a + b * b + c * c)).max(0.0).sqrt();
    match word >> 30 {
        0 => [a, b, c, largest],
        1 => [largest, b, c, a],
        2 => [b, largest, c, a],
        _ => [b, c, largest, a],
    }
}
