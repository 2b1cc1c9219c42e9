//! What headers say about a Cryptomatte (Psyop's specification 1.2.0).

use crate::film::{matte_id, matte_key};
use std::collections::BTreeMap;

/// A matte: the name that its layers have in common, and the names of all that it may show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matte {
    kind: &'static str,
    /// Ids by names.
    manifest: BTreeMap<String, u32>,
}

impl Matte {
    /// Of a kind (`CryptoObject`) for things of these names.
    pub fn new(kind: &'static str, names: Vec<String>) -> Matte {
        let manifest = names
            .into_iter()
            .map(|name| {
                let id = matte_id(&name);
                (name, id)
            })
            .collect();
        Matte { kind, manifest }
    }

    /// The names of all that it may show.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.manifest.keys().map(String::as_str)
    }

    /// The name that its layers have in common.
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// The attributes of the header: names and texts. The names of its layers in the file start with `prefix`.
    pub fn attributes(&self, prefix: &str) -> [(String, String); 4] {
        let name = format!("{prefix}{}", self.kind);
        let key = matte_key(&name);
        let named = |what: &str, text: String| (format!("cryptomatte/{key}/{what}"), text);
        [
            named("name", name.clone()),
            named("hash", "MurmurHash3_32".to_string()),
            named("conversion", "uint32_to_float32".to_string()),
            named("manifest", self.manifest()),
        ]
    }

    /// The manifest: a JSON object of ids, as eight hexadecimal digits, by names.
    fn manifest(&self) -> String {
        let entry = |(name, id): (&String, &u32)| format!("\"{}\":\"{id:08x}\"", escaped(name));
        let entries: Vec<String> = self.manifest.iter().map(entry).collect();
        format!("{{{}}}", entries.join(","))
    }
}

/// A text as JSON has it, with ASCII characters only: the header's text has no others.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for unit in text.encode_utf16() {
        match u8::try_from(unit).map(char::from) {
            Ok(c @ ('"' | '\\')) => escaped.extend(['\\', c]),
            Ok(c) if c.is_ascii() && !c.is_ascii_control() => escaped.push(c),
            _ => escaped.push_str(&format!("\\u{unit:04x}")),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_say_what_the_specification_asks_for() {
        let names = ["hello", "a \"b\"\\", "Würfel\u{1f600}"].map(String::from);
        let matte = Matte::new("crypto_asset", names.to_vec());
        let attributes = matte.attributes("");
        assert_eq!(attributes[0], ("cryptomatte/28322e9/name".into(), "crypto_asset".into()));
        let manifest: serde_json::Value = serde_json::from_str(&attributes[3].1).expect("JSON");
        assert!(attributes[3].1.is_ascii());
        for name in names {
            assert_eq!(manifest[&name], format!("{:08x}", matte_id(&name)), "{name}");
        }
        assert_eq!(manifest["hello"], "248bfa47");
    }
}
