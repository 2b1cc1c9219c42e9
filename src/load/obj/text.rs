//! Text of OBJ and MTL files made fit for the parser: byte order marks, Latin-1, continued lines and several material
//! libraries, none of which `tobj` takes.

/// The text of a file: UTF-8, else Latin-1, without a byte order mark. A line that ends in `\` goes on in the next;
/// empty lines make up for it, so that line numbers stay.
pub(super) fn clean(bytes: &[u8]) -> String {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text.to_string(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
    };
    if !text.contains('\\') {
        return text;
    }
    let (mut out, mut joined) = (String::with_capacity(text.len()), 0);
    for line in text.lines() {
        match line.trim_end().strip_suffix('\\') {
            Some(start) => {
                out.push_str(start);
                out.push(' ');
                joined += 1;
            }
            None => {
                out.push_str(line);
                out.extend(std::iter::repeat_n('\n', joined + 1));
                joined = 0;
            }
        }
    }
    out
}

/// Takes the material libraries out of an OBJ text and returns the rests of their lines; the first such line becomes
/// one that names all of them together.
pub(super) fn take_libraries(text: &str) -> (String, Vec<String>) {
    let (mut out, mut libraries) = (String::with_capacity(text.len()), Vec::new());
    for line in text.lines() {
        match line.trim_start().strip_prefix("mtllib") {
            Some(rest) if rest.starts_with([' ', '\t']) => {
                if libraries.is_empty() {
                    out.push_str("mtllib all");
                }
                libraries.push(rest.trim().to_string());
            }
            _ => out.push_str(line),
        }
        out.push('\n');
    }
    (out, libraries)
}

/// The file name at the end of a texture statement, behind its options (`-s 1 1 1 name.png`).
pub(super) fn texture_file(statement: &str) -> &str {
    let mut rest = statement.trim();
    while rest.starts_with('-') {
        let (option, mut after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        let most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            "-blendu" | "-blendv" | "-bm" | "-boost" | "-cc" | "-clamp" | "-imfchan" | "-texres"
            | "-type" => 1,
            _ => break,
        };
        for _ in 0..most {
            let (value, next) = after.trim_start().split_once(char::is_whitespace).unwrap_or((after, ""));
            if most > 1 && value.parse::<f32>().is_err() {
                break;
            }
            after = next;
        }
        rest = after.trim_start();
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_made_fit() {
        assert_eq!(clean(b"\xef\xbb\xbfv 1 \\\n2 3\nf 1"), "v 1  2 3\n\nf 1\n");
        assert_eq!(clean(b"# caf\xe9"), "# caf\u{e9}");
        let (text, libraries) = take_libraries("mtllib a.mtl\nv 0 0 0\nmtllib b c.mtl\n");
        assert_eq!(text, "mtllib all\nv 0 0 0\n\n");
        assert_eq!(libraries, ["a.mtl", "b c.mtl"]);
        assert_eq!(texture_file("-s 2 2 -clamp on wood grain.png"), "wood grain.png");
        assert_eq!(texture_file("-o"), "");
    }
}
