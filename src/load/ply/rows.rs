//! Decodes rows of elements, ascii and binary, into typed records.

use crate::color::{linear_from_srgb, srgb_table};
use crate::error::Problem;
use crate::load::words::{decimal_commas, integer, is_nan_word, next_word};
use ply_rs::ply::{ElementDef, Property, PropertyAccess, PropertyType, ScalarType};

/// A decoded row of an element.
pub(super) trait Record {
    /// A record with default values.
    fn new() -> Self;
    /// The field of a scalar property; `None` skips the property.
    fn slot(name: &str) -> Option<Slot>;
    /// Stores a scalar property.
    fn set(&mut self, slot: Slot, value: &Property);
    /// The field of a list property; `None` skips the property.
    fn list(&mut self, name: &str) -> Option<List<'_>>;
}

/// The field of a list property.
pub(super) enum List<'a> {
    Integers(&'a mut Vec<i64>),
    Numbers(&'a mut Vec<f32>),
}

/// A field of a record.
#[derive(Clone, Copy)]
pub(super) enum Slot {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Color(usize),
    Alpha,
    /// INDEX and component of a named attribute.
    Attribute(u8, u8),
    /// Texture index of a face.
    Texture,
    /// Material index of a face.
    Material,
    /// Index into the values of a row of splats or point instances.
    Value(u8),
}

/// One vertex; properties missing in the file keep their defaults.
pub(super) struct Vertex {
    pub position: [f64; 3],
    pub normal: [f32; 3],
    /// As in the file: v grows upwards.
    pub uv: [f32; 2],
    /// Linear RGBA.
    pub color: [f32; 4],
    /// Named attributes by INDEX of the header.
    pub attributes: Vec<[f32; 4]>,
}

impl Record for Vertex {
    fn new() -> Vertex {
        Vertex { position: [0.0; 3], normal: [0.0; 3], uv: [0.0; 2], color: [1.0; 4], attributes: Vec::new() }
    }

    fn slot(name: &str) -> Option<Slot> {
        Some(match name {
            "x" => Slot::Position(0),
            "y" => Slot::Position(1),
            "z" => Slot::Position(2),
            "nx" => Slot::Normal(0),
            "ny" => Slot::Normal(1),
            "nz" => Slot::Normal(2),
            "s" | "u" | "texture_u" | "texture_s" => Slot::Uv(0),
            "t" | "v" | "texture_v" | "texture_t" => Slot::Uv(1),
            "red" | "r" | "diffuse_red" => Slot::Color(0),
            "green" | "g" | "diffuse_green" => Slot::Color(1),
            "blue" | "b" | "diffuse_blue" => Slot::Color(2),
            "alpha" | "a" => Slot::Alpha,
            _ => return attribute_slot(name),
        })
    }

    #[inline]
    fn set(&mut self, slot: Slot, value: &Property) {
        match slot {
            Slot::Position(i) => self.position[i] = to_f64(value),
            Slot::Normal(i) => self.normal[i] = number(value),
            Slot::Uv(i) => self.uv[i] = number(value),
            Slot::Color(i) => self.color[i] = color(value),
            Slot::Alpha => self.color[3] = unit(value),
            Slot::Attribute(i, component) => {
                let i = usize::from(i);
                if i >= self.attributes.len() {
                    self.attributes.resize(i + 1, [0.0; 4]);
                }
                self.attributes[i][usize::from(component)] = unit(value);
            }
            Slot::Texture | Slot::Material | Slot::Value(_) => {}
        }
    }

    fn list(&mut self, _: &str) -> Option<List<'_>> {
        None
    }
}

/// One polygon or strip.
#[derive(Clone)]
pub(super) struct Face {
    /// Vertex indices, unchecked.
    pub indices: Vec<i64>,
    /// Per-corner texture coordinates, u and v alternating, as in the file: v grows upwards.
    pub wedges: Vec<f32>,
    /// Texture index.
    pub texture: i64,
    /// Material index.
    pub material: i64,
    /// Linear RGBA.
    pub color: [f32; 4],
}

/// The field of the property `aINDEX_COMPONENT` of a vertex.
fn attribute_slot(name: &str) -> Option<Slot> {
    let (index, component) = name.strip_prefix('a')?.split_once('_')?;
    let component = component.parse().ok().filter(|component| *component < 4)?;
    Some(Slot::Attribute(index.parse().ok()?, component))
}

impl Record for Face {
    fn new() -> Face {
        Face { indices: Vec::new(), wedges: Vec::new(), texture: 0, material: 0, color: [1.0; 4] }
    }

    fn slot(name: &str) -> Option<Slot> {
        match name {
            "texnumber" => Some(Slot::Texture),
            "material_index" => Some(Slot::Material),
            _ => Vertex::slot(name).filter(|slot| matches!(slot, Slot::Color(_) | Slot::Alpha)),
        }
    }

    fn set(&mut self, slot: Slot, value: &Property) {
        // `as` saturates; NaN becomes 0.
        match slot {
            Slot::Texture => self.texture = to_f64(value) as i64,
            Slot::Material => self.material = to_f64(value) as i64,
            Slot::Color(channel) => self.color[channel] = color(value),
            Slot::Alpha => self.color[3] = unit(value),
            _ => {}
        }
    }

    #[inline]
    fn list(&mut self, name: &str) -> Option<List<'_>> {
        match name {
            "vertex_index" | "vertex_indices" => Some(List::Integers(&mut self.indices)),
            "texcoord" => Some(List::Numbers(&mut self.wedges)),
            _ => None,
        }
    }
}

/// The record of skipped elements.
pub(super) struct SkippedElement;

impl Record for SkippedElement {
    fn new() -> SkippedElement {
        SkippedElement
    }

    fn slot(_: &str) -> Option<Slot> {
        None
    }

    fn set(&mut self, _: Slot, _: &Property) {}

    fn list(&mut self, _: &str) -> Option<List<'_>> {
        None
    }
}

/// `ply-rs` needs a row type, even for parsing the header alone.
impl PropertyAccess for SkippedElement {
    fn new() -> SkippedElement {
        SkippedElement
    }
}

/// A scalar in single precision; NaN for lists, which the header check refuses.
#[inline]
pub(super) fn number(value: &Property) -> f32 {
    match *value {
        Property::Char(v) => f32::from(v),
        Property::UChar(v) => f32::from(v),
        Property::Short(v) => f32::from(v),
        Property::UShort(v) => f32::from(v),
        Property::Int(v) => v as f32,
        Property::UInt(v) => v as f32,
        Property::Float(v) => v,
        Property::Double(v) => v as f32,
        _ => f32::NAN,
    }
}

/// A scalar in double precision; NaN for lists.
#[inline]
pub(super) fn to_f64(value: &Property) -> f64 {
    match *value {
        Property::Int(v) => f64::from(v),
        Property::UInt(v) => f64::from(v),
        Property::Double(v) => v,
        _ => f64::from(number(value)),
    }
}

/// A value in 0..1: integers are divided by their type's maximum.
pub(super) fn unit(value: &Property) -> f32 {
    match *value {
        Property::UChar(v) => f32::from(v) / 255.0,
        Property::UShort(v) => f32::from(v) / 65535.0,
        _ => number(value),
    }
}

/// A linear colour channel: integers are sRGB-encoded, as every common exporter writes them.
pub(super) fn color(value: &Property) -> f32 {
    match value {
        Property::UChar(v) => srgb_table()[usize::from(*v)],
        Property::UShort(_) => linear_from_srgb(unit(value)),
        _ => number(value),
    }
}

/// The lines of an ascii payload.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    /// Number of the current line in the file, from 1.
    number: usize,
}

impl<'a> Lines<'a> {
    /// The lines of `bytes`; `before` is the number of header lines.
    pub fn new(bytes: &'a [u8], before: usize) -> Lines<'a> {
        Lines { rest: bytes, number: before }
    }

    /// The next line that isn't blank.
    fn next(&mut self) -> Option<&'a [u8]> {
        while !self.rest.is_empty() {
            let (line, next) = split_line(self.rest);
            self.rest = &self.rest[next..];
            self.number += 1;
            let line = line.trim_ascii();
            if !line.is_empty() {
                return Some(line);
            }
        }
        None
    }
}

/// Type and field of a scalar property, or name of a list property.
enum FieldTarget<'a> {
    Scalar(&'a ScalarType, Option<Slot>),
    List(&'a str),
}

/// Reads the rows of an ascii element, one per line, and calls `each` with row number and record.
///
/// # Errors
/// A line that doesn't match the definition, or a truncated file.
pub(super) fn read_ascii<E: Record>(
    lines: &mut Lines,
    definition: &ElementDef,
    mut each: impl FnMut(usize, &E),
) -> Result<(), Problem> {
    let targets: Vec<FieldTarget> = definition
        .properties
        .iter()
        .map(|(name, p)| match &p.data_type {
            PropertyType::Scalar(kind) => FieldTarget::Scalar(kind, E::slot(name)),
            PropertyType::List(..) => FieldTarget::List(name),
        })
        .collect();
    let mut record = E::new();
    for row in 0..definition.count {
        let line = lines.next().ok_or_else(|| truncated(definition, row))?;
        read_row(line, &targets, &mut record).ok_or_else(|| {
            let shown: String = String::from_utf8_lossy(line).chars().take(60).collect();
            let commas = decimal_commas(line);
            let message =
                format!("'{shown}' is not a '{}' as the header defines it{commas}", definition.name);
            Problem::new(format!("line {}", lines.number), message)
        })?;
        each(row, &record);
    }
    Ok(())
}

/// Fills the record from a line; `None` if the line doesn't match the definition.
#[inline]
fn read_row<E: Record>(line: &[u8], targets: &[FieldTarget], record: &mut E) -> Option<()> {
    let mut words = Words(line);
    for target in targets {
        let word = words.next()?;
        match target {
            FieldTarget::Scalar(_, None) => {}
            FieldTarget::Scalar(kind, Some(slot)) => record.set(*slot, &scalar(kind, *slot, word)?),
            FieldTarget::List(name) => {
                let length = usize::try_from(integer(word)?).ok()?;
                match record.list(name) {
                    Some(List::Integers(list)) => {
                        list.clear();
                        for _ in 0..length {
                            list.push(integer(words.next()?)?);
                        }
                    }
                    Some(List::Numbers(list)) => {
                        list.clear();
                        for _ in 0..length {
                            list.push(real(std::str::from_utf8(words.next()?).ok()?)? as f32);
                        }
                    }
                    None => {
                        for _ in 0..length {
                            words.next()?;
                        }
                    }
                }
            }
        }
    }
    words.next().is_none().then_some(())
}

/// The words of a line.
struct Words<'a>(&'a [u8]);

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let (word, rest) = next_word(self.0)?;
        self.0 = rest;
        Some(word)
    }
}

/// Parses a scalar of a type. Integers out of range are clamped; positions are parsed in double precision.
#[inline]
fn scalar(kind: &ScalarType, slot: Slot, word: &[u8]) -> Option<Property> {
    let text = std::str::from_utf8(word).ok()?;
    Some(match kind {
        ScalarType::Float if matches!(slot, Slot::Position(_)) => Property::Double(real(text)?),
        ScalarType::Float => Property::Float(text.parse().ok().or_else(|| real(text).map(|v| v as f32))?),
        ScalarType::Double => Property::Double(real(text)?),
        // `as` saturates.
        ScalarType::Char => Property::Char(finite_number(text)? as i8),
        ScalarType::UChar => Property::UChar(finite_number(text)? as u8),
        ScalarType::Short => Property::Short(finite_number(text)? as i16),
        ScalarType::UShort => Property::UShort(finite_number(text)? as u16),
        ScalarType::Int => Property::Int(finite_number(text)? as i32),
        ScalarType::UInt => Property::UInt(finite_number(text)? as u32),
    })
}

/// Parses a number; NaN for words such as `nan` that stand for a missing value.
fn real(text: &str) -> Option<f64> {
    text.parse().ok().or_else(|| is_nan_word(text.as_bytes()).then_some(f64::NAN))
}

/// Parses a finite number of an integer type, which may be written as `3.0`.
fn finite_number(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|v| v.is_finite())
}

// Binary rows are decoded into one reused record: `ply-rs` spends most of its time on allocating a string for each property
// and a list for each face.

/// A property of an element.
struct Field<'a> {
    name: &'a str,
    data: &'a PropertyType,
    slot: Option<Slot>,
}

/// Reads the rows of a binary element from the front of `rest` and calls `each` with row number and record.
///
/// # Errors
/// The number of the row where the bytes end or a list has an invalid length.
pub(super) fn read_binary<E: Record>(
    rest: &mut &[u8],
    definition: &ElementDef,
    big: bool,
    mut each: impl FnMut(usize, &E),
) -> Result<(), usize> {
    let properties = definition.properties.iter();
    let fields: Vec<Field> =
        properties.map(|(name, p)| Field { name, data: &p.data_type, slot: E::slot(name) }).collect();
    let mut record = E::new();
    for row in 0..definition.count {
        for field in &fields {
            read_field(rest, field, big, &mut record).ok_or(row)?;
        }
        each(row, &record);
    }
    Ok(())
}

#[inline]
fn read_field<E: Record>(rest: &mut &[u8], field: &Field, big: bool, record: &mut E) -> Option<()> {
    match field.data {
        PropertyType::Scalar(kind) => {
            let bytes = take(rest, size(kind))?;
            if let Some(slot) = field.slot {
                record.set(slot, &binary_scalar(kind, bytes, big));
            }
        }
        PropertyType::List(count, item) => {
            let length = match binary_scalar(count, take(rest, size(count))?, big) {
                Property::Char(n) => usize::try_from(n).ok()?,
                Property::UChar(n) => usize::from(n),
                Property::Short(n) => usize::try_from(n).ok()?,
                Property::UShort(n) => usize::from(n),
                Property::Int(n) => usize::try_from(n).ok()?,
                Property::UInt(n) => usize::try_from(n).ok()?,
                _ => return None,
            };
            let bytes = take(rest, length.checked_mul(size(item))?)?;
            match record.list(field.name) {
                Some(List::Integers(list)) => integers(item, bytes, big, list),
                Some(List::Numbers(list)) => {
                    list.clear();
                    list.extend(bytes.chunks_exact(size(item)).map(|b| number(&binary_scalar(item, b, big))));
                }
                None => {}
            }
        }
    }
    Some(())
}

#[inline]
fn take<'a>(rest: &mut &'a [u8], length: usize) -> Option<&'a [u8]> {
    let (bytes, after) = rest.split_at_checked(length)?;
    *rest = after;
    Some(bytes)
}

/// Size of a scalar, bytes.
pub(super) fn size(kind: &ScalarType) -> usize {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// The first `N` bytes in little-endian order; zeros if there are fewer.
#[inline]
fn ordered<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
    let mut out = bytes.first_chunk::<N>().copied().unwrap_or([0; N]);
    if big {
        out.reverse();
    }
    out
}

#[inline]
fn binary_scalar(kind: &ScalarType, bytes: &[u8], big: bool) -> Property {
    match kind {
        ScalarType::Char => Property::Char(i8::from_le_bytes(ordered(bytes, big))),
        ScalarType::UChar => Property::UChar(u8::from_le_bytes(ordered(bytes, big))),
        ScalarType::Short => Property::Short(i16::from_le_bytes(ordered(bytes, big))),
        ScalarType::UShort => Property::UShort(u16::from_le_bytes(ordered(bytes, big))),
        ScalarType::Int => Property::Int(i32::from_le_bytes(ordered(bytes, big))),
        ScalarType::UInt => Property::UInt(u32::from_le_bytes(ordered(bytes, big))),
        ScalarType::Float => Property::Float(f32::from_le_bytes(ordered(bytes, big))),
        ScalarType::Double => Property::Double(f64::from_le_bytes(ordered(bytes, big))),
    }
}

/// Decodes `bytes` into `list`; empty for float types, which the header check refuses.
fn integers(kind: &ScalarType, bytes: &[u8], big: bool, list: &mut Vec<i64>) {
    fn fill<const N: usize>(list: &mut Vec<i64>, bytes: &[u8], big: bool, value: fn([u8; N]) -> i64) {
        list.clear();
        list.extend(bytes.chunks_exact(N).map(|b| value(ordered(b, big))));
    }
    match kind {
        ScalarType::Char => fill(list, bytes, big, |b| i8::from_le_bytes(b).into()),
        ScalarType::UChar => fill(list, bytes, big, |b| u8::from_le_bytes(b).into()),
        ScalarType::Short => fill(list, bytes, big, |b| i16::from_le_bytes(b).into()),
        ScalarType::UShort => fill(list, bytes, big, |b| u16::from_le_bytes(b).into()),
        ScalarType::Int => fill(list, bytes, big, |b| i32::from_le_bytes(b).into()),
        ScalarType::UInt => fill(list, bytes, big, |b| u32::from_le_bytes(b).into()),
        ScalarType::Float | ScalarType::Double => list.clear(),
    }
}

/// The first line without its end (LF, CR LF or CR), and the offset of the next line.
pub(super) fn split_line(bytes: &[u8]) -> (&[u8], usize) {
    match bytes.iter().position(|&b| b == b'\n' || b == b'\r') {
        None => (bytes, bytes.len()),
        Some(end) => {
            let pair = bytes[end] == b'\r' && bytes.get(end + 1) == Some(&b'\n');
            (&bytes[..end], end + if pair { 2 } else { 1 })
        }
    }
}

/// The error for a file that ends inside row `i` of an element.
pub(super) fn truncated(definition: &ElementDef, i: usize) -> Problem {
    let message = format!("the file ends inside '{}' {i} of {}", definition.name, definition.count);
    Problem::new("", message).with_help("export or download the file again")
}
