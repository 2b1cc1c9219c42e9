//! Typed records that the parser fills property by property.

use crate::color::linear_from_srgb;
use ply_rs::ply::{Property, PropertyAccess};

/// One vertex; what the file lacks keeps its default.
pub(super) struct Vertex {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    /// As in the file: v grows upwards.
    pub uv: [f32; 2],
    /// Linear RGBA.
    pub color: [f32; 4],
}

impl PropertyAccess for Vertex {
    fn new() -> Vertex {
        Vertex { position: [0.0; 3], normal: [0.0; 3], uv: [0.0; 2], color: [1.0; 4] }
    }

    fn set_property(&mut self, name: String, value: Property) {
        match name.as_str() {
            "x" => self.position[0] = number(&value),
            "y" => self.position[1] = number(&value),
            "z" => self.position[2] = number(&value),
            "nx" => self.normal[0] = number(&value),
            "ny" => self.normal[1] = number(&value),
            "nz" => self.normal[2] = number(&value),
            "s" | "u" | "texture_u" => self.uv[0] = number(&value),
            "t" | "v" | "texture_v" => self.uv[1] = number(&value),
            "red" | "r" => self.color[0] = color(&value),
            "green" | "g" => self.color[1] = color(&value),
            "blue" | "b" => self.color[2] = color(&value),
            "alpha" | "a" => self.color[3] = unit(&value),
            _ => {}
        }
    }
}

/// One polygon or strip: indices as the file says, not yet checked.
pub(super) struct Face {
    pub indices: Vec<i64>,
}

impl PropertyAccess for Face {
    fn new() -> Face {
        Face { indices: Vec::new() }
    }

    fn set_property(&mut self, name: String, value: Property) {
        if name != "vertex_index" && name != "vertex_indices" {
            return;
        }
        self.indices = match value {
            Property::ListChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListInt(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUInt(v) => v.into_iter().map(i64::from).collect(),
            // The header check refuses other types.
            _ => Vec::new(),
        };
    }
}

/// An element that nothing is taken from.
pub(super) struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Skipped {
        Skipped
    }
}

/// A scalar as it is; lists (refused by the header check) give NaN.
fn number(value: &Property) -> f32 {
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
        Property::UChar(_) | Property::UShort(_) => linear_from_srgb(unit(value)),
        _ => number(value),
    }
}
