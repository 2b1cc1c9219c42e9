//! EXT_meshopt_compression and KHR_meshopt_compression: compressed buffer views. The bit streams follow the specification
//! of KHR_meshopt_compression (appendix A; filters in appendix B); the EXT extension has version 0 only.
//!
//! Decoders check each read: damaged streams are errors.

use super::document::{index_of, required};
use super::report::{Report, Valid};
use crate::error::Problem;
use serde_json::Value;

/// Names of the extensions, which have the same JSON.
const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// JSON pointer and value of the extension of the buffer view at a pointer.
pub(super) fn packed<'v>(json: &'v Value, at: &str) -> Option<(String, &'v Value)> {
    let extensions = json.pointer(&format!("{at}/extensions"))?;
    let name = NAMES.iter().find(|name| extensions.get(name).is_some())?;
    Some((format!("{at}/extensions/{name}"), extensions.get(name)?))
}

/// Bit stream format.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// Filter to apply after decoding.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Parameters of a compressed view.
pub(super) struct Layout {
    /// Index of the buffer with the stream.
    pub buffer: usize,
    /// Offset of the stream, bytes.
    pub offset: u64,
    /// Length of the stream, bytes.
    pub length: u64,
    /// Number of elements.
    pub count: usize,
    stride: usize,
    mode: Mode,
    filter: Filter,
}

impl Layout {
    /// Parses and validates the extension.
    pub fn new(packed: &Value, at: &str, report: &mut Report) -> Valid<Layout> {
        let mut integer = |key: &str| required(index_of(packed, key, at, report), key, at, report);
        let (buffer, length) = (integer("buffer"), integer("byteLength"));
        let (stride, count) = (integer("byteStride"), integer("count"));
        let offset = index_of(packed, "byteOffset", at, report);
        let mode = match packed.get("mode").and_then(Value::as_str) {
            Some("ATTRIBUTES") => Mode::Attributes,
            Some("TRIANGLES") => Mode::Triangles,
            Some("INDICES") => Mode::Indices,
            _ => {
                return Err(report.problem(format!("{at}/mode"), "must be ATTRIBUTES, TRIANGLES or INDICES"));
            }
        };
        let filter = match packed.get("filter").map(|f| f.as_str().unwrap_or_default()) {
            None | Some("NONE") => Filter::None,
            Some("OCTAHEDRAL") => Filter::Octahedral,
            Some("QUATERNION") => Filter::Quaternion,
            Some("EXPONENTIAL") => Filter::Exponential,
            Some("COLOR") => Filter::Color,
            Some(other) => {
                let problem = Problem::new(format!("{at}/filter"), format!("'{other}' is not known"));
                return Err(report.add(problem.with_help("export the model without mesh compression")));
            }
        };
        let (stride, count) = (stride?, count?);
        let (offset, length) = (offset?.unwrap_or(0) as u64, length? as u64);
        let layout = Layout { buffer: buffer?, offset, length, count, stride, mode, filter };
        if !layout.is_valid() {
            return Err(report
                .problem(at, format!("{count} elements of {stride} bytes don't fit its mode and filter")));
        }
        Ok(layout)
    }

    /// Whether stride and count are valid for the mode and the filter.
    fn is_valid(&self) -> bool {
        let stride = self.stride;
        let by_mode = match self.mode {
            Mode::Attributes => stride.is_multiple_of(4) && (4..=256).contains(&stride),
            Mode::Triangles => matches!(stride, 2 | 4) && self.count.is_multiple_of(3),
            Mode::Indices => matches!(stride, 2 | 4),
        };
        let by_filter = match self.filter {
            Filter::None => true,
            Filter::Octahedral | Filter::Color => matches!(stride, 4 | 8),
            Filter::Quaternion => stride == 8,
            Filter::Exponential => stride.is_multiple_of(4),
        };
        by_mode && by_filter && (self.filter == Filter::None || self.mode == Mode::Attributes)
    }

    /// Decoded size, bytes.
    pub fn size(&self) -> u64 {
        (self.count as u64).saturating_mul(self.stride as u64)
    }

    /// Decodes a stream into `count` elements.
    ///
    /// # Errors
    /// A message for damaged streams.
    pub fn decode(&self, stream: &[u8]) -> Result<Vec<u8>, String> {
        let mut bytes = match self.mode {
            Mode::Attributes => decode(stream, self.count, self.stride)?,
            Mode::Triangles => narrowed(triangles(stream, self.count)?, self.stride),
            Mode::Indices => narrowed(indices(stream, self.count)?, self.stride),
        };
        match (self.filter, self.stride) {
            (Filter::None, _) => {}
            (Filter::Octahedral, 4) => octahedral8(&mut bytes),
            (Filter::Octahedral, _) => octahedral16(&mut bytes),
            (Filter::Quaternion, _) => quaternion(&mut bytes),
            (Filter::Exponential, _) => exponential(&mut bytes),
            (Filter::Color, 4) => color8(&mut bytes),
            (Filter::Color, _) => color16(&mut bytes),
        }
        Ok(bytes)
    }
}

/// Indices as bytes, 2 or 4 each; larger indices wrap around in 16 bits, as the specification requires.
fn narrowed(indices: Vec<u32>, stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes().into_iter().take(stride)).collect()
}

/// A compressed stream; reading beyond its end is an error.
struct Stream<'s> {
    /// The remaining bytes.
    pub bytes: &'s [u8],
}

impl<'s> Stream<'s> {
    /// The next bytes.
    pub fn take(&mut self, count: usize) -> Result<&'s [u8], String> {
        let (head, rest) = self.bytes.split_at_checked(count).ok_or("the stream ends too early")?;
        self.bytes = rest;
        Ok(head)
    }

    /// The next byte.
    pub fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    /// An unsigned LEB128 number of at most five bytes.
    pub fn varint(&mut self) -> Result<u32, String> {
        let mut value = 0u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err("a number is longer than five bytes".to_string())
    }

    /// Removes and returns the last bytes.
    pub fn tail(&mut self, count: usize) -> Result<&'s [u8], String> {
        let at = self.bytes.len().checked_sub(count).ok_or("the stream is too short")?;
        let (rest, tail) = self.bytes.split_at(at);
        self.bytes = rest;
        Ok(tail)
    }

    /// Fails unless the whole stream has been read.
    pub fn finish(self) -> Result<(), String> {
        match self.bytes.len() {
            0 => Ok(()),
            left => Err(format!("{left} bytes are left")),
        }
    }
}

// Mode "attributes": elements as byte-wise differences from their predecessors, in groups of 16.

/// Elements per group.
const GROUP: usize = 16;
/// Maximum size of a block, bytes and elements.
const BLOCK_BYTES: usize = 8192;
const BLOCK_ELEMENTS: usize = 256;

/// Encoding of the differences of four bytes (low four bits of a channel's mode).
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Words,
    /// XOR of 32 bits, the difference rotated left by a number of bits.
    Xor(u32),
}

/// Decodes `count` elements of `stride` bytes, a multiple of 4.
fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let mut stream = Stream { bytes };
    let version = match stream.byte()? {
        0xa0 => 0,
        0xa1 => 1,
        other => return Err(format!("{other:#04x} is not the header of a stream of attributes")),
    };
    let (used, least) = if version == 0 { (stride, 32) } else { (stride + stride / 4, 24) };
    let tail = stream.tail(used.max(least))?;
    let tail = &tail[tail.len() - used..];
    let (mut previous, modes) = (tail[..stride].to_vec(), &tail[stride..]);
    let channels: Vec<Channel> = match version {
        0 => vec![Channel::Bytes; stride / 4],
        _ => modes.iter().map(|&mode| channel(mode)).collect::<Result<_, _>>()?,
    };
    let mut out = vec![0u8; count.checked_mul(stride).ok_or("it declares too many elements")?];
    let max_elements = ((BLOCK_BYTES / stride) & !(GROUP - 1)).min(BLOCK_ELEMENTS);
    let mut deltas = vec![0u8; max_elements * stride];
    for block in out.chunks_mut(max_elements * stride) {
        let elements = block.len() / stride;
        read_deltas(&mut stream, version, elements, stride, max_elements, &mut deltas)?;
        for (c, &channel) in channels.iter().enumerate() {
            let lanes: [&[u8]; 4] = std::array::from_fn(|lane| &deltas[(c * 4 + lane) * max_elements..]);
            let mut last = [0, 1, 2, 3].map(|lane| previous[c * 4 + lane]);
            for (i, element) in block.chunks_exact_mut(stride).enumerate() {
                last = restore(channel, last, lanes.map(|lane| lane[i]));
                element[c * 4..c * 4 + 4].copy_from_slice(&last);
            }
            previous[c * 4..c * 4 + 4].copy_from_slice(&last);
        }
    }
    stream.finish()?;
    Ok(out)
}

fn channel(mode: u8) -> Result<Channel, String> {
    match (mode & 15, mode >> 4) {
        (0, 0) => Ok(Channel::Bytes),
        (1, 0) => Ok(Channel::Words),
        (2, turn) => Ok(Channel::Xor(u32::from(turn))),
        _ => Err(format!("{mode:#04x} is not a channel mode")),
    }
}

/// The next four bytes from the last ones and the stored difference.
fn restore(channel: Channel, last: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
    match channel {
        Channel::Bytes => {
            let step = |v: u8| if v & 1 == 0 { v >> 1 } else { !(v >> 1) };
            std::array::from_fn(|i| last[i].wrapping_add(step(delta[i])))
        }
        Channel::Words => {
            let step = |v: u16| if v & 1 == 0 { v >> 1 } else { !(v >> 1) };
            let next = |i: usize| {
                let delta = u16::from_le_bytes([delta[i], delta[i + 1]]);
                u16::from_le_bytes([last[i], last[i + 1]]).wrapping_add(step(delta)).to_le_bytes()
            };
            let ([a, b], [c, d]) = (next(0), next(2));
            [a, b, c, d]
        }
        Channel::Xor(turn) => {
            (u32::from_le_bytes(last) ^ u32::from_le_bytes(delta).rotate_left(turn)).to_le_bytes()
        }
    }
}

/// Reads the differences of one block, planar: those of byte k of the elements start at `k * lane`.
fn read_deltas(
    stream: &mut Stream,
    version: u8,
    elements: usize,
    stride: usize,
    lane: usize,
    deltas: &mut [u8],
) -> Result<(), String> {
    let controls = if version == 0 { &[][..] } else { stream.take(stride / 4)? };
    for k in 0..stride {
        let out = &mut deltas[k * lane..][..elements.next_multiple_of(GROUP)];
        let control = controls.get(k / 4).map(|byte| byte >> (k % 4 * 2) & 3);
        let lengths = match control {
            None => [0, 2, 4, 8],
            Some(0) => [0, 1, 2, 4],
            Some(1) => [1, 2, 4, 8],
            Some(2) => {
                out.fill(0);
                continue;
            }
            Some(_) => {
                out[..elements].copy_from_slice(stream.take(elements)?);
                continue;
            }
        };
        let groups = out.len() / GROUP;
        let header = stream.take(groups.div_ceil(4))?;
        for (g, group) in out.chunks_exact_mut(GROUP).enumerate() {
            let bits = lengths[usize::from(header[g / 4] >> (g % 4 * 2) & 3)];
            read_group(stream, bits, group)?;
        }
    }
    Ok(())
}

/// Reads 16 numbers of `bits` bits; all bits set is an escape for a byte that follows the group.
fn read_group(stream: &mut Stream, bits: usize, out: &mut [u8]) -> Result<(), String> {
    match bits {
        0 => out.fill(0),
        8 => out.copy_from_slice(stream.take(GROUP)?),
        _ => {
            let packed = stream.take(GROUP * bits / 8)?;
            let sentinel = (1u8 << bits) - 1;
            let per_byte = 8 / bits;
            for (i, out) in out.iter_mut().enumerate() {
                // Single bits are stored from the lowest bit of a byte, wider numbers from the highest.
                let place = if bits == 1 { i % 8 } else { 8 - bits - i % per_byte * bits };
                let value = packed[i / per_byte] >> place & sentinel;
                *out = if value == sentinel { stream.byte()? } else { value };
            }
        }
    }
    Ok(())
}

// Modes "triangles" and "indices".

/// Ring buffer of the last 16 entries.
struct Fifo<T> {
    entries: [Option<T>; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn new() -> Fifo<T> {
        Fifo { entries: [None; 16], next: 0 }
    }

    fn push(&mut self, entry: T) {
        self.entries[self.next] = Some(entry);
        self.next = (self.next + 1) % 16;
    }

    /// The entry `age` pushes ago, 0 being the newest; an error if it was never written.
    fn get(&self, age: u8) -> Result<T, String> {
        let at = (self.next + 15 - usize::from(age & 15)) % 16;
        self.entries[at].ok_or_else(|| "it refers to an entry before its start".to_string())
    }
}

/// Decoder state between triangles.
struct Decoder<'s> {
    data: Stream<'s>,
    edges: Fifo<(u32, u32)>,
    vertices: Fifo<u32>,
    /// The lowest unused index.
    next: u32,
    /// The last explicitly coded index.
    last: u32,
}

/// Decodes a list of triangles of `count` indices, a multiple of 3.
fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let mut stream = Stream { bytes };
    match stream.byte()? {
        0xe1 => {}
        other => return Err(format!("{other:#04x} is not the header of a stream of triangles")),
    }
    let table: &[u8; 16] = stream.tail(16)?.try_into().map_err(|_| "its table is truncated")?;
    let codes = stream.take(count / 3)?;
    let mut decoder = Decoder { data: stream, edges: Fifo::new(), vertices: Fifo::new(), next: 0, last: 0 };
    let mut out = Vec::with_capacity(count);
    for &code in codes {
        out.extend(decoder.triangle(code, table)?);
    }
    decoder.data.finish()?;
    Ok(out)
}

impl Decoder<'_> {
    fn triangle(&mut self, code: u8, table: &[u8; 16]) -> Result<[u32; 3], String> {
        match (code >> 4, code & 15) {
            (15, low @ (14 | 15)) => self.explicit(low == 14),
            (15, low) => {
                let entry = table[usize::from(low)];
                let a = self.new_index();
                let b = self.recent(entry >> 4)?;
                let c = self.recent(entry & 15)?;
                self.push_triangle([a, b, c], [true, entry >> 4 == 0, entry & 15 == 0])
            }
            (edge, low) => self.with_edge(edge, low),
        }
    }

    /// A triangle that shares an edge of the edge FIFO.
    fn with_edge(&mut self, edge: u8, low: u8) -> Result<[u32; 3], String> {
        let (a, b) = self.edges.get(edge)?;
        let (c, is_new) = match low {
            0 => (self.new_index(), true),
            13 | 14 => {
                self.last = if low == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                (self.last, true)
            }
            15 => (self.coded()?, true),
            _ => (self.vertices.get(low)?, false),
        };
        self.edges.push((c, b));
        self.edges.push((a, c));
        if is_new {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle with individually coded corners.
    fn explicit(&mut self, first_is_new: bool) -> Result<[u32; 3], String> {
        let entry = self.data.byte()?;
        if entry == 0 {
            self.next = 0;
        }
        let a = if first_is_new { self.new_index() } else { self.coded()? };
        let mut corner = |low: u8| if low == 15 { self.coded() } else { self.recent(low) };
        let (b, c) = (corner(entry >> 4)?, corner(entry & 15)?);
        let is_new = |low: u8| low == 0 || low == 15;
        self.push_triangle([a, b, c], [true, is_new(entry >> 4), is_new(entry & 15)])
    }

    fn push_triangle(&mut self, triangle: [u32; 3], is_new: [bool; 3]) -> Result<[u32; 3], String> {
        let [a, b, c] = triangle;
        for edge in [(b, a), (c, b), (a, c)] {
            self.edges.push(edge);
        }
        for (vertex, _) in triangle.into_iter().zip(is_new).filter(|(_, is_new)| *is_new) {
            self.vertices.push(vertex);
        }
        Ok(triangle)
    }

    /// A new index for 0, else an index from the vertex FIFO.
    fn recent(&mut self, low: u8) -> Result<u32, String> {
        if low == 0 { Ok(self.new_index()) } else { self.vertices.get(low - 1) }
    }

    fn new_index(&mut self) -> u32 {
        let index = self.next;
        self.next = index.wrapping_add(1);
        index
    }

    /// An explicitly coded index: the difference from the last one.
    fn coded(&mut self) -> Result<u32, String> {
        let v = self.data.varint()?;
        let delta = if v & 1 == 0 { v >> 1 } else { !(v >> 1) };
        self.last = self.last.wrapping_add(delta);
        Ok(self.last)
    }
}

/// Decodes `count` indices: each a difference from one of two baselines.
fn indices(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let mut stream = Stream { bytes };
    match stream.byte()? {
        0xd1 => {}
        other => return Err(format!("{other:#04x} is not the header of a stream of indices")),
    }
    stream.tail(4)?;
    if count > stream.bytes.len() {
        return Err(format!("{count} indices don't fit into {} bytes", stream.bytes.len()));
    }
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let v = stream.varint()?;
        let delta = if v & 2 == 0 { v >> 2 } else { !(v >> 2) };
        let value = &mut last[(v & 1) as usize];
        *value = value.wrapping_add(delta);
        out.push(*value);
    }
    stream.finish()?;
    Ok(out)
}

// Filters of decoded attributes (appendix B of the specification), in place. Invalid input yields unspecified values.

/// Unit vectors of signed bytes from octahedral coordinates.
fn octahedral8(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<4>().0 {
        let [x, y, one, _] = element.map(|b| f32::from(b as i8));
        let [x, y, z] = octahedral(x, y, one).map(|v| (v * 127.0).round() as i8 as u8);
        (element[0], element[1], element[2]) = (x, y, z);
    }
}

/// The octahedral filter with 16 bits.
fn octahedral16(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let words = words(element).map(|w| w as i16);
        let [x, y, one] = [words[0], words[1], words[2]].map(f32::from);
        let [x, y, z] = octahedral(x, y, one).map(|v| (v * 32767.0).round() as i16);
        store(element, [x, y, z, words[3]].map(|w| w as u16));
    }
}

/// Octahedral coordinates with the scale `one` as a unit vector.
fn octahedral(x: f32, y: f32, one: f32) -> [f32; 3] {
    let (x, y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    // Unfold the lower hemisphere.
    let fold = z.min(0.0);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// Unit quaternions from three components; the last two bits are the index of the omitted largest component.
fn quaternion(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let words = words(element).map(|w| w as i16);
        let one = f32::from(words[3] | 3);
        let [x, y, z] =
            [words[0], words[1], words[2]].map(|c| f32::from(c) / one * std::f32::consts::FRAC_1_SQRT_2);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let largest = (words[3] & 3) as usize;
        let mut out = [0u16; 4];
        for (turn, value) in [w, x, y, z].into_iter().enumerate() {
            out[(largest + turn) % 4] = (value * 32767.0).round() as i16 as u16;
        }
        store(element, out);
    }
}

/// Floats from a signed 8-bit exponent and a signed 24-bit mantissa.
fn exponential(bytes: &mut [u8]) {
    for word in bytes.as_chunks_mut::<4>().0 {
        let packed = i32::from_le_bytes(*word);
        // Exponents lie in -100..100, so that the product is exact.
        let (exponent, mantissa) = ((packed >> 24).clamp(-126, 127), packed << 8 >> 8);
        let scale = f32::from_bits(((exponent + 127) as u32) << 23);
        *word = (scale * mantissa as f32).to_le_bytes();
    }
}

/// RGBA from YCoCg; alpha also encodes the number of bits.
fn color8(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<4>().0 {
        let [y, co, cg, a] = *element;
        let rgba = color([y.into(), (co as i8).into(), (cg as i8).into(), a.into()], 255.0);
        *element = rgba.map(|v| v as u8);
    }
}

/// The colour filter with 16 bits.
fn color16(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let [y, co, cg, a] = words(element);
        let rgba = color([y.into(), (co as i16).into(), (cg as i16).into(), a.into()], 65535.0);
        store(element, rgba.map(|v| v as u16));
    }
}

fn color([y, co, cg, a]: [i32; 4], most: f32) -> [f32; 4] {
    // The highest set bit of alpha is the number of bits.
    let scale = (1i64 << (32 - a.max(1).leading_zeros())) as i32 - 1;
    let alpha = a & (scale >> 1);
    let alpha = alpha << 1 | alpha & 1;
    let rgb = [y + co - cg, y + cg, y - co - cg];
    [rgb[0], rgb[1], rgb[2], alpha].map(|v| (v as f32 * (most / scale as f32)).round())
}

fn words(element: &[u8; 8]) -> [u16; 4] {
    std::array::from_fn(|i| u16::from_le_bytes([element[2 * i], element[2 * i + 1]]))
}

fn store(element: &mut [u8; 8], words: [u16; 4]) {
    for (out, word) in element.as_chunks_mut::<2>().0.iter_mut().zip(words) {
        *out = word.to_le_bytes();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example in the specification for mode 0.
    #[test]
    fn specification_example_is_decoded() {
        let bytes = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let (mut stream, mut out) = (Stream { bytes: &bytes }, [0u8; 16]);
        read_group(&mut stream, 4, &mut out).expect("it is whole");
        stream.finish().expect("all is read");
        let step = |v: &u8| if v & 1 == 0 { (v >> 1) as i8 } else { !(v >> 1) as i8 };
        let deltas: Vec<i8> = out.iter().map(step).collect();
        assert_eq!(deltas, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
    }

    #[test]
    fn channels_are_decoded() {
        assert_eq!(restore(Channel::Bytes, [0, 1, 255, 9], [1, 2, 2, 0]), [255, 2, 0, 9]);
        // 0x00ff + 1 carries into the higher byte; the other word decreases by one.
        assert_eq!(restore(Channel::Words, [0xff, 0, 0, 0], [2, 0, 1, 0]), [0, 1, 0xff, 0xff]);
        assert_eq!(restore(Channel::Xor(4), [0x0f, 0, 0, 0], [0, 0, 0, 0x10]), [0x0e, 0, 0, 0]);
    }

    fn layout(mode: Mode, filter: Filter, count: usize, stride: usize) -> Layout {
        Layout { buffer: 0, offset: 0, length: 0, count, stride, mode, filter }
    }

    /// Encodes elements in version 0 or 1 with the differences as whole bytes.
    fn encode(elements: &[u8], stride: usize, version: u8) -> Vec<u8> {
        let mut stream = vec![0xa0 | version];
        let max_elements = ((8192 / stride) & !15).min(256);
        let mut last = vec![0u8; stride];
        for block in elements.chunks(max_elements * stride) {
            let count = block.len() / stride;
            if version == 1 {
                stream.extend(vec![0b1111_1111; stride / 4]);
            }
            for k in 0..stride {
                let mut deltas: Vec<u8> = Vec::new();
                for element in block.chunks(stride) {
                    let d = element[k].wrapping_sub(last[k]);
                    deltas.push(if d & 0x80 == 0 { d << 1 } else { !(d << 1) });
                    last[k] = element[k];
                }
                if version == 0 {
                    deltas.resize(count.next_multiple_of(16), 0);
                    stream.extend(vec![0xff; (deltas.len() / 16).div_ceil(4)]);
                }
                stream.extend(deltas);
            }
        }
        let used = stride + if version == 1 { stride / 4 } else { 0 };
        stream.extend(vec![0; if version == 0 { 32 } else { 24 }.max(used)]);
        stream
    }

    #[test]
    fn attributes_of_all_sizes_round_trip() {
        for version in [0, 1] {
            for (count, stride) in [(1, 4), (16, 4), (17, 12), (256, 16), (300, 64), (700, 256)] {
                let elements: Vec<u8> = (0..count * stride).map(|i| (i * i / 7 + i) as u8).collect();
                let stream = encode(&elements, stride, version);
                let decoded = layout(Mode::Attributes, Filter::None, count, stride).decode(&stream);
                assert_eq!(decoded.as_ref(), Ok(&elements), "{count} of {stride}");
                for cut in [0, 1, 5, stream.len() / 2, stream.len() - 1] {
                    assert!(
                        layout(Mode::Attributes, Filter::None, count, stride).decode(&stream[..cut]).is_err()
                    );
                }
                let mut longer = stream.clone();
                longer.push(0);
                assert!(layout(Mode::Attributes, Filter::None, count, stride).decode(&longer).is_err());
            }
        }
    }

    /// A group of version 1 with 1-bit numbers and escapes.
    #[test]
    fn groups_of_single_bits_are_decoded() {
        // Control: byte 0 mode 0, bytes 1 to 3 without data. Header: one group of 1 bit. Elements 0 and 9 escape.
        let mut stream = vec![0xa1, 0b10_10_10_00, 0b01, 0b0000_0001, 0b0000_0010, 4, 2];
        stream.extend([0; 24]);
        let decoded = layout(Mode::Attributes, Filter::None, 16, 4).decode(&stream).expect("it is whole");
        let first: Vec<u8> = decoded.chunks(4).map(|e| e[0]).collect();
        assert_eq!(first, [2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3]);
        assert!(decoded.chunks(4).all(|e| e[1..] == [0, 0, 0]));
    }

    /// A quad, a fan that uses the FIFOs, and explicit corners.
    #[test]
    fn triangle_codes_are_decoded() {
        let table =
            [0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xa9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0, 0];
        let mut stream = vec![0xe1];
        // 0 1 2 new; edge (2, 1) is the one before the last: with the new 3; then explicit 10 11 12 (differences 10, 1, 1);
        // then a new vertex and two recent ones by an explicit byte.
        stream.extend([0xf0, 0x10, 0xff, 0xfe]);
        stream.extend([0xff, 20, 2, 2]);
        stream.push(0x12);
        stream.extend(table);
        let decoded = layout(Mode::Triangles, Filter::None, 12, 4).decode(&stream).expect("it is whole");
        let indices: Vec<u32> =
            decoded.chunks(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(indices, [0, 1, 2, 2, 1, 3, 10, 11, 12, 4, 12, 11]);
        let short = layout(Mode::Triangles, Filter::None, 12, 2).decode(&stream).expect("it is whole");
        assert_eq!(short.len(), 24);
        // An edge before there is one.
        let mut broken = vec![0xe1, 0x00];
        broken.extend(table);
        assert!(layout(Mode::Triangles, Filter::None, 3, 4).decode(&broken).is_err());
    }

    #[test]
    fn indices_are_decoded() {
        // 5 from the first, 100 from the second, 6 from the first, 99 from the second.
        let zigzag = |delta: i32| ((delta << 1) ^ (delta >> 31)) as u32;
        let code = |delta: i32, baseline: u32| zigzag(delta) << 1 | baseline;
        let mut stream = vec![0xd1];
        for v in [code(5, 0), code(100, 1), code(1, 0), code(-1, 1)] {
            let mut v = v;
            while v > 0x7f {
                stream.push(v as u8 | 0x80);
                v >>= 7;
            }
            stream.push(v as u8);
        }
        stream.extend([0; 4]);
        let decoded = layout(Mode::Indices, Filter::None, 4, 2).decode(&stream).expect("it is whole");
        assert_eq!(decoded, [5, 0, 100, 0, 6, 0, 99, 0]);
        assert!(layout(Mode::Indices, Filter::None, 5, 2).decode(&stream).is_err());
        assert!(layout(Mode::Indices, Filter::None, 3, 2).decode(&stream).is_err());
    }

    #[test]
    fn octahedral_vectors_are_unit_vectors() {
        let mut up = [0u8, 0, 127, 5];
        octahedral8(&mut up);
        assert_eq!(up, [0, 0, 127, 5]);
        // (1, 1) of the octahedron is -z.
        let mut down = [127u8, 127, 127, 0];
        octahedral8(&mut down);
        assert_eq!(down, [0, 0, (-127i8) as u8, 0]);
        let ten_bits =
            [(-300i16).to_le_bytes(), 150i16.to_le_bytes(), 511i16.to_le_bytes(), 7i16.to_le_bytes()];
        let mut bytes = ten_bits.concat();
        octahedral16(&mut bytes);
        let v: Vec<f32> =
            bytes.chunks(2).map(|b| f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).collect();
        let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        assert!((length - 1.0).abs() < 1e-4 && v[0] < 0.0 && v[1] > 0.0 && v[2] > 0.0);
        assert!((v[0] / v[1] + 2.0).abs() < 1e-3);
    }

    #[test]
    fn quaternions_regain_their_largest_component() {
        // A quarter turn about z: (0, 0, s, s); the largest is taken to be w (component 3).
        let one = (1i16 << 11) - 1;
        let largest_3 = one & !3 | 3;
        let z = i16::try_from(2047).expect("it fits");
        let mut bytes = [0i16, 0, z, largest_3].map(i16::to_le_bytes).concat();
        quaternion(&mut bytes);
        let q: Vec<i16> = bytes.chunks(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect();
        let s = (32767.0 * std::f32::consts::FRAC_1_SQRT_2).round() as i16;
        assert_eq!((q[0], q[1]), (0, 0));
        assert!((q[2] - s).abs() <= 1 && (q[3] - s).abs() <= 1, "{q:?}");
    }

    #[test]
    fn exponents_scale_exactly() {
        let packed = [(-2i32 << 24) | 5, (3 << 24) | 0x00ff_ffff, 100 << 24 | 1];
        let mut bytes: Vec<u8> = packed.iter().flat_map(|v: &i32| v.to_le_bytes()).collect();
        exponential(&mut bytes);
        let floats: Vec<f32> =
            bytes.chunks(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(floats, [1.25, -8.0, 2f32.powi(100)]);
    }

    #[test]
    fn colours_round_trip_through_ycocg() {
        // RGB (200, 100, 50) in 8 bits: Co = (r - b) / 2, Cg = (g - t) / 2 with t = b + Co, Y = t + Cg.
        let (r, g, b) = (200i32, 100, 50);
        let co = (r - b) / 2;
        let t = b + co;
        let cg = (g - t) / 2;
        let y = t + cg;
        let mut bytes = [y as u8, co as i8 as u8, cg as i8 as u8, 0x80 | 64];
        color8(&mut bytes);
        assert!(
            bytes[0].abs_diff(r as u8) <= 1
                && bytes[1].abs_diff(g as u8) <= 1
                && bytes[2].abs_diff(b as u8) <= 1
        );
        assert_eq!(bytes[3], 128);
    }
}
