//! An image before it is decoded: its bytes, where they come from, and what it is for.

use crate::error::{Error, Problem, Warning};
use crate::load::decoders::Decoder;
use std::path::Path;

/// What an image is for, which decides how its numbers are understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Use {
    /// Colour: integers are sRGB-encoded, floats linear.
    Color,
    /// Numbers such as roughness or normals: linear, whatever their type.
    Data,
    /// Environment: integers are sRGB-encoded, floats radiance; no texel may be negative.
    Environment,
}

/// Where the bytes come from, for messages.
pub(super) struct Source<'a> {
    pub bytes: &'a [u8],
    pub file: &'a Path,
    pub pointer: &'a str,
}

impl Source<'_> {
    pub fn error(&self, message: impl Into<String>) -> Error {
        Error::input_problems(self.file, vec![Problem::new(self.pointer, message)])
    }

    /// The build lacks what it takes to decode the image.
    pub fn lacks(&self, decoder: Decoder) -> Error {
        let message = format!("can't be read: {}", decoder.lack());
        self.error(message).with_help(format!("{}, or convert the image to PNG", decoder.remedy()))
    }

    pub fn warning(&self, message: impl Into<String>) -> Warning {
        Warning::new(self.file, self.pointer, message)
    }

    /// The image's name for reports.
    pub fn name(&self) -> String {
        let file = self.file.display();
        if self.pointer.is_empty() { file.to_string() } else { format!("{file}#{}", self.pointer) }
    }
}
