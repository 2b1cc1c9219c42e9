//! Typed records that are filled property by property: from text by `ascii`, from bytes by `binary`.

use crate::color::{linear_from_srgb, srgb_table};
use ply_rs::ply::{Property, PropertyAccess};

/// What a row of an element becomes.
pub(super) trait Record {
    /// A record with defaults for what the file lacks.
    fn new() -> Self;
    /// Where a scalar property goes, if anywhere.
    fn slot(name: &str) -> Option<Slot>;
    /// Stores a scalar property.
    fn set(&mut self, slot: Slot, value: &Property);
    /// Where the list property of that name goes, if anywhere.
    fn list(&mut self, name: &str) -> Option<List<'_>>;
}

/// What a list becomes.
pub(super) enum List<'a> {
    Integers(&'a mut Vec<i64>),
    Numbers(&'a mut Vec<f32>),
}

/// Which number of a vertex.
#[derive(Clone, Copy)]
pub(super) enum Slot {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Color(usize),
    Alpha,
    /// The number of a face's picture.
    Picture,
}

/// One vertex; what the file lacks keeps its default.
pub(super) struct Vertex {
    pub position: [f64; 3],
    pub normal: [f32; 3],
    /// As in the file: v grows upwards.
    pub uv: [f32; 2],
    /// Linear RGBA.
    pub color: [f32; 4],
}

impl Record for Vertex {
    fn new() -> Vertex {
        Vertex { position: [0.0; 3], normal: [0.0; 3], uv: [0.0; 2], color: [1.0; 4] }
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
            _ => return None,
        })
    }

    #[inline]
    fn set(&mut self, slot: Slot, value: &Property) {
        match slot {
            Slot::Position(i) => self.position[i] = exact(value),
            Slot::Normal(i) => self.normal[i] = number(value),
            Slot::Uv(i) => self.uv[i] = number(value),
            Slot::Color(i) => self.color[i] = color(value),
            Slot::Alpha => self.color[3] = unit(value),
            Slot::Picture => {}
        }
    }

    fn list(&mut self, _: &str) -> Option<List<'_>> {
        None
    }
}

/// One polygon or strip: indices as the file says, not yet checked.
#[derive(Clone)]
pub(super) struct Face {
    pub indices: Vec<i64>,
    /// Texture coordinates of its corners, u and v in turn, as in the file: v grows upwards.
    pub wedges: Vec<f32>,
    /// Which of the file's pictures is on it.
    pub picture: i64,
}

impl Record for Face {
    fn new() -> Face {
        Face { indices: Vec::new(), wedges: Vec::new(), picture: 0 }
    }

    fn slot(name: &str) -> Option<Slot> {
        (name == "texnumber").then_some(Slot::Picture)
    }

    fn set(&mut self, slot: Slot, value: &Property) {
        if matches!(slot, Slot::Picture) {
            // `as` saturates; what is no number is the first.
            self.picture = exact(value) as i64;
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

/// An element that nothing is taken from.
pub(super) struct Skipped;

impl Record for Skipped {
    fn new() -> Skipped {
        Skipped
    }

    fn slot(_: &str) -> Option<Slot> {
        None
    }

    fn set(&mut self, _: Slot, _: &Property) {}

    fn list(&mut self, _: &str) -> Option<List<'_>> {
        None
    }
}

/// The parser of the header wants a type of rows.
impl PropertyAccess for Skipped {
    fn new() -> Skipped {
        Skipped
    }
}

/// A scalar as it is; lists (refused by the header check) give NaN.
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

/// The same, as exact as it is in the file.
#[inline]
fn exact(value: &Property) -> f64 {
    match *value {
        Property::Int(v) => f64::from(v),
        Property::UInt(v) => f64::from(v),
        Property::Double(v) => v,
        _ => f64::from(number(value)),
    }
}

/// A share of 1: integers count in their type's maximum.
fn unit(value: &Property) -> f32 {
    match *value {
        Property::UChar(v) => f32::from(v) / 255.0,
        Property::UShort(v) => f32::from(v) / 65535.0,
        _ => number(value),
    }
}

/// A linear colour channel: integers are sRGB-encoded, as every common exporter writes them.
fn color(value: &Property) -> f32 {
    match value {
        Property::UChar(v) => srgb_table()[usize::from(*v)],
        Property::UShort(_) => linear_from_srgb(unit(value)),
        _ => number(value),
    }
}
