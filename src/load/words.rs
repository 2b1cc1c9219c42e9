//! Words and whole numbers in text files.

/// The next word of a text, between blanks, and what is behind it.
#[inline]
pub(super) fn next_word(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let start = text.iter().position(|b| !b.is_ascii_whitespace())?;
    let text = &text[start..];
    let length = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    Some(text.split_at(length))
}

/// Does UTF-16 text begin like that: with a byte order mark, or with a zero byte after each letter?
pub(super) fn is_utf_16(start: &[u8]) -> bool {
    let is_letter = |pair: &[u8]| matches!(pair, [0, 1..=127] | [1..=127, 0]);
    matches!(start, [0xff, 0xfe, ..] | [0xfe, 0xff, ..])
        || start.len() >= 4 && start[..start.len().min(16)].chunks_exact(2).all(is_letter)
}

/// A whole number of at most 18 digits, with or without a sign.
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
    use super::integer;

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
