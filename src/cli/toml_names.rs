//! Names in TOML files.

use std::fmt::Write;

/// A name as a TOML string.
pub(super) fn quoted(name: &str) -> String {
    let mut text = String::from("\"");
    for c in name.chars() {
        match c {
            '"' | '\\' => text.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(text, "\\u{:04X}", u32::from(c));
            }
            c => text.push(c),
        }
    }
    text + "\""
}

/// A name as a key of a TOML table.
pub(super) fn key(name: &str) -> String {
    let is_bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if is_bare { name.to_string() } else { quoted(name) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_quoted_as_toml_keys() {
        assert_eq!(key("Wood_2-a"), "Wood_2-a");
        assert_eq!(key("Wood.001"), "\"Wood.001\"");
        assert_eq!(key("a \"b\"\n\\"), "\"a \\\"b\\\"\\u000A\\\\\"");
    }
}
