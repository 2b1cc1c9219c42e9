//! How `--json` prints: one line, a blank behind commas and colons, and numbers as plain decimals, never with an exponent,
//! so that any tool can read them. NaN and infinities become null.

use serde::Serialize;
use serde_json::ser::Formatter;
use std::io::{self, Write};

/// The style of the printed line.
struct OneLine;

impl Formatter for OneLine {
    // Display of floats never uses an exponent.
    fn write_f64<W: ?Sized + Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        write!(writer, "{value}")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        writer.write_all(if first { b"" } else { b", " })
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        writer.write_all(if first { b"" } else { b", " })
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b": ")
    }
}

/// Prints a value in a line of its own on standard output. Nobody listening any more is no error.
pub(crate) fn print(value: &impl Serialize) {
    let mut line = io::stdout().lock();
    let _ = write(&mut line, value).map(|()| writeln!(line));
}

fn write(writer: &mut impl Write, value: &impl Serialize) -> serde_json::Result<()> {
    value.serialize(&mut serde_json::Serializer::with_formatter(writer, OneLine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Example {
        small: f64,
        large: f64,
        none: f64,
        list: (u64, bool, Option<u8>),
        text: &'static str,
    }

    #[test]
    fn numbers_are_plain_decimals_and_the_rest_parses() {
        let value = Example {
            small: 1.5e-9,
            large: 1e21,
            none: f64::NAN,
            list: (u64::MAX, true, None),
            text: "a \"b\"\n\u{1}",
        };
        let mut line = Vec::new();
        write(&mut line, &value).unwrap();
        let expected = r#"{"small": 0.0000000015, "large": 1000000000000000000000, "none": null, "#
            .to_string()
            + r#""list": [18446744073709551615, true, null], "text": "a \"b\"\n\u0001"}"#;
        assert_eq!(String::from_utf8(line).unwrap(), expected);
    }
}
