//! Readable JSON: indented by two spaces, short lists on one line, keys in alphabetical order.

use serde_json::Value;

/// The text of a value, with a trailing newline.
pub fn pretty(value: &Value) -> String {
    let mut out = String::new();
    write(value, 0, &mut out);
    out.push('\n');
    out
}

fn write(value: &Value, depth: usize, out: &mut String) {
    let plain = |v: &Value| !v.is_array() && !v.is_object();
    match value {
        Value::Array(items) if !items.iter().all(plain) => {
            block('[', ']', depth, out, items.iter(), |item, out| write(item, depth + 1, out));
        }
        Value::Array(items) => {
            let texts: Vec<String> = items.iter().map(ToString::to_string).collect();
            out.push_str(&format!("[{}]", texts.join(", ")));
        }
        Value::Object(map) if !map.is_empty() => {
            block('{', '}', depth, out, map.iter(), |(key, value), out| {
                out.push_str(&format!("{}: ", Value::from(key.as_str())));
                write(value, depth + 1, out);
            });
        }
        other => out.push_str(&other.to_string()),
    }
}

fn block<T>(
    open: char,
    close: char,
    depth: usize,
    out: &mut String,
    items: impl Iterator<Item = T>,
    mut each: impl FnMut(T, &mut String),
) {
    let line = |depth: usize| format!("\n{}", "  ".repeat(depth));
    out.push(open);
    for (i, item) in items.enumerate() {
        out.push_str(if i > 0 { "," } else { "" });
        out.push_str(&line(depth + 1));
        each(item, out);
    }
    out.push_str(&line(depth));
    out.push(close);
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    #[test]
    fn short_lists_stay_on_one_line_and_values_round_trip() {
        let value = json!({ "b": [1, 2.5, "x"], "a": [{ "c": {} }, [1]], "e": [] });
        let text = super::pretty(&value);
        assert!(text.contains("\"b\": [1, 2.5, \"x\"]"), "{text}");
        assert!(text.starts_with("{\n  \"a\": [\n    {\n      \"c\": {}\n    },\n"), "{text}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).expect("valid"), value);
    }
}
