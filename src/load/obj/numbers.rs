//! Numbers of vertices and corners of faces: what nearly all are like is told without converting it.

use super::lines::float;
use std::io::Write;

/// Indices of a corner's position, texture coordinates and normal, from 1; 0 for none.
pub(super) type Corner = [u32; 3];

/// Is a word a number? Plain decimals are told without being converted, which `tobj` does once more.
pub(super) fn is_number(word: &[u8]) -> bool {
    let digits = word.strip_prefix(b"-").unwrap_or(word);
    let dots = digits.iter().filter(|&&b| b == b'.').count();
    let is_decimal = digits.iter().all(|b| b.is_ascii_digit() || *b == b'.');
    is_decimal && dots < 2 && dots < digits.len() || float(word).is_some()
}

/// Has a number three digits before its point, or an exponent?
pub(super) fn is_large(number: &[u8]) -> bool {
    let digits = number.iter().take_while(|b| **b != b'.').filter(|b| b.is_ascii_digit()).count();
    digits > 2 || number.last().is_some_and(|b| !b.is_ascii_digit() && *b != b'.') || has_exponent(number)
}

fn has_exponent(number: &[u8]) -> bool {
    number.iter().any(|b| b | 0x20 == b'e')
}

/// Plain decimals, as nearly all numbers of vertices are.
#[derive(Clone, Copy)]
pub(super) struct PlainNumbers {
    pub count: usize,
    /// One has three digits before its point.
    pub has_large: bool,
}

/// What the numbers of a text are; `None` where some are no plain decimals.
pub(super) fn plain_numbers(mut text: &[u8]) -> Option<PlainNumbers> {
    let mut numbers = PlainNumbers { count: 0, has_large: false };
    while let [first, rest @ ..] = text {
        if matches!(first, b' ' | b'\t') {
            text = rest;
            continue;
        }
        let digits = if *first == b'-' { rest } else { text };
        let whole = digits.iter().take_while(|b| b.is_ascii_digit()).count();
        let (mut length, mut parts) = (whole, 0);
        if digits.get(whole) == Some(&b'.') {
            parts = digits[whole + 1..].iter().take_while(|b| b.is_ascii_digit()).count();
            length += 1 + parts;
        }
        text = &digits[length..];
        if whole + parts == 0 || !matches!(text.first(), None | Some(b' ' | b'\t')) {
            return None;
        }
        numbers.count += 1;
        numbers.has_large |= whole > 2;
    }
    Some(numbers)
}

/// The indices of a corner without signs and zeros, which is what nearly all are, up to a blank; and what follows.
#[inline]
pub(super) fn plain_corner(text: &[u8]) -> Option<(Corner, &[u8])> {
    let (mut corner, mut kind) = ([0u32; 3], 0);
    for (at, &b) in text.iter().enumerate() {
        match b {
            b'/' if kind < 2 && corner[0] > 0 => kind += 1,
            b'1'..=b'9' => corner[kind] = corner[kind].checked_mul(10)?.checked_add(u32::from(b - b'0'))?,
            b'0' if corner[kind] > 0 => corner[kind] = corner[kind].checked_mul(10)?,
            b' ' | b'\t' if corner[0] > 0 => return Some((corner, &text[at..])),
            _ => return None,
        }
    }
    (corner[0] > 0).then_some((corner, &[]))
}

/// ` v`, ` v/t`, ` v//n` or ` v/t/n`.
pub(super) fn write_corner([position, uv, normal]: Corner, out: &mut Vec<u8>) {
    // Writing to memory doesn't fail.
    let _ = match (uv, normal) {
        (0, 0) => write!(out, " {position}"),
        (_, 0) => write!(out, " {position}/{uv}"),
        (0, _) => write!(out, " {position}//{normal}"),
        _ => write!(out, " {position}/{uv}/{normal}"),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_numbers_are_told_at_a_glance() {
        for (text, expected) in [
            (" 1 -2.5\t.5 3.", Some((4, false))),
            (" 123 4", Some((2, true))),
            ("", Some((0, false))),
            (" 1e3", None),
            (" 1 # 2", None),
            (" -", None),
            (" .", None),
            (" 1.2.3", None),
            (" +1", None),
        ] {
            let found = plain_numbers(text.as_bytes()).map(|found| (found.count, found.has_large));
            assert_eq!(found, expected, "{text}");
        }
    }
}
