//! Words and integers in text files.

/// The next whitespace-separated word of a text, and the rest.
#[inline]
pub(super) fn next_word(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let start = text.iter().position(|b| !b.is_ascii_whitespace())?;
    let text = &text[start..];
    let length = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    Some(text.split_at(length))
}

/// Whether a word is a spelling of NaN or infinity: `nan`, or one of the Windows runtime (`1.#IND`, `-nan(ind)`, `1.#QNAN`,
/// `1.#INF`).
pub(super) fn is_nan_word(word: &[u8]) -> bool {
    let word = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word).to_ascii_lowercase();
    let rest = word.strip_prefix(b"nan");
    let is_nan = rest.is_some_and(|r| r.is_empty() || r.starts_with(b"(") && r.ends_with(b")"));
    let mark = word.iter().position(|&b| b == b'#').map(|at| &word[at..]);
    let is_of_windows =
        |mark: &[u8]| [&b"#ind"[..], b"#qnan", b"#snan", b"#inf"].iter().any(|m| mark.starts_with(m));
    is_nan || word.starts_with(b"1.#") && mark.is_some_and(is_of_windows)
}

/// Help for a message if numbers of a line have decimal commas; else empty.
pub(super) fn decimal_commas(line: &[u8]) -> &'static str {
    let is_between = |w: &[u8]| w[1] == b',' && w[0].is_ascii_digit() && w[2].is_ascii_digit();
    match line.windows(3).any(is_between) {
        true => ": these have decimal commas; export the file with decimal points (LC_NUMERIC=C)",
        false => "",
    }
}

/// Whether text is UTF-16: it starts with a byte order mark, or alternate bytes are zero.
pub(super) fn is_utf_16(start: &[u8]) -> bool {
    let is_letter = |pair: &[u8]| matches!(pair, [0, 1..=127] | [1..=127, 0]);
    matches!(start, [0xff, 0xfe, ..] | [0xfe, 0xff, ..])
        || start.len() >= 4 && start[..start.len().min(16)].chunks_exact(2).all(is_letter)
}

/// An integer of at most 18 digits, with or without a sign.
#[inline]
pub(super) fn integer(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let mut value = 0;
    for b in digits {
        value = value * 10 + i64::from(b.is_ascii_digit().then(|| b - b'0')?);
    }
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_nan_are_recognized() {
        for word in ["nan", "-NaN", "1.#IND", "-1.#IND00", "1.#QNAN", "-nan(ind)", "1.#INF"] {
            assert!(is_nan_word(word.as_bytes()), "{word}");
        }
        for word in ["1.5", "nano", "1.#X", "#IND", "inf", ""] {
            assert!(!is_nan_word(word.as_bytes()), "{word}");
        }
    }

    #[test]
    fn signs_and_lengths() {
        for (text, expected) in [
            ("0", Some(0)),
            ("+12", Some(12)),
            ("-999999999999999999", Some(-999_999_999_999_999_999)),
            ("1000000000000000000", None),
            ("", None),
            ("-", None),
            ("1.0", None),
            ("--1", None),
        ] {
            assert_eq!(integer(text.as_bytes()), expected, "{text}");
        }
    }
}
