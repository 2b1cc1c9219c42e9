//! Letters of 8 x 8 pixels.

use font8x8::legacy::BASIC_LEGACY;

/// Width of a letter, pixels.
pub(super) const WIDTH: usize = 8;

/// Hands on the points of a line of text, in pixels to the right and down from its corner. What is not ASCII is a question mark.
pub(super) fn points(text: &str, mut point: impl FnMut(usize, usize)) {
    for (i, c) in text.chars().enumerate() {
        let glyph = BASIC_LEGACY.get(c as usize).unwrap_or(&BASIC_LEGACY[usize::from(b'?')]);
        for (y, bits) in glyph.iter().enumerate() {
            (0..WIDTH).filter(|x| bits >> x & 1 == 1).for_each(|x| point(WIDTH * i + x, y));
        }
    }
}
