//! JSON for reports. Numbers are plain decimals, never with an exponent, so that any tool can read them.

use std::fmt;

/// A JSON value.
pub(crate) enum Json {
    Null,
    Bool(bool),
    Integer(u64),
    /// NaN and infinities become null.
    Decimal(f64),
    Text(String),
    List(Vec<Json>),
    Object(Vec<(&'static str, Json)>),
}

impl Json {
    /// A list of texts.
    pub fn texts(list: impl IntoIterator<Item = impl fmt::Display>) -> Json {
        Json::List(list.into_iter().map(|t| Json::Text(t.to_string())).collect())
    }

    /// A list of decimals.
    pub fn decimals(list: &[f64]) -> Json {
        Json::List(list.iter().map(|&v| Json::Decimal(v)).collect())
    }
}

fn write_text(f: &mut fmt::Formatter<'_>, text: &str) -> fmt::Result {
    let quoted = serde_json::to_string(text).map_err(|_| fmt::Error)?;
    f.write_str(&quoted)
}

impl fmt::Display for Json {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Json::Null => f.write_str("null"),
            Json::Bool(b) => write!(f, "{b}"),
            Json::Integer(n) => write!(f, "{n}"),
            // Display of floats never uses an exponent.
            Json::Decimal(v) if v.is_finite() => write!(f, "{v}"),
            Json::Decimal(_) => f.write_str("null"),
            Json::Text(t) => write_text(f, t),
            Json::List(list) => {
                f.write_str("[")?;
                for (i, value) in list.iter().enumerate() {
                    write!(f, "{}{value}", if i > 0 { ", " } else { "" })?;
                }
                f.write_str("]")
            }
            Json::Object(fields) => {
                f.write_str("{")?;
                for (i, (key, value)) in fields.iter().enumerate() {
                    f.write_str(if i > 0 { ", " } else { "" })?;
                    write_text(f, key)?;
                    write!(f, ": {value}")?;
                }
                f.write_str("}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_plain_decimals_and_the_rest_parses() {
        let value = Json::Object(vec![
            ("small", Json::Decimal(1.5e-9)),
            ("large", Json::Decimal(1e21)),
            ("none", Json::Decimal(f64::NAN)),
            ("list", Json::List(vec![Json::Integer(u64::MAX), Json::Bool(true), Json::Null])),
            ("text", Json::Text("a \"b\"\n\u{1}".into())),
        ]);
        let text = value.to_string();
        assert!(text.contains("0.0000000015") && text.contains("1000000000000000000000"), "{text}");
        let parsed: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(parsed["text"], "a \"b\"\n\u{1}");
        assert_eq!(parsed["list"][0], u64::MAX);
        assert!(parsed["none"].is_null());
    }
}
