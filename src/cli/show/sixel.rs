//! Sixel graphics (DEC VT340 manual, chapter 14): bands of six rows, colour by colour.

use super::scaled::{OPAQUE, Pixels};
use std::fmt::Write;

/// Pixels of a character as far as it is known: few terminals have fewer.
pub(super) const CELL: (u32, u32) = (8, 16);

/// Levels of red, green and blue: 252 colours.
const LEVELS: [u32; 3] = [6, 7, 6];

/// Thresholds in sixteenths (Bayer 1973), which hide the steps between the levels.
const BAYER: [[u32; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];

/// The picture; what is transparent stays as it is on the screen.
pub(super) fn text(picture: &Pixels) -> String {
    let (width, height) = picture.size;
    // Ratio 1:1, transparent ground, size.
    let mut text = format!("\x1bP0;1q\"1;1;{width};{height}");
    for color in 0..LEVELS.iter().product() {
        let [r, g, b] = parts(color);
        let percent = |part: u32, levels: u32| (part * 100 + (levels - 1) / 2) / (levels - 1);
        let (r, g, b) = (percent(r, LEVELS[0]), percent(g, LEVELS[1]), percent(b, LEVELS[2]));
        let _ = write!(text, "#{color};2;{r};{g};{b}");
    }
    for top in (0..height).step_by(6) {
        band(picture, top, &mut text);
        text.push('-');
    }
    text.push_str("\x1b\\\n");
    text
}

/// Six rows.
fn band(picture: &Pixels, top: u32, text: &mut String) {
    let width = picture.size.0 as usize;
    let mut masks: Vec<Option<Vec<u8>>> = vec![None; LEVELS.iter().product::<u32>() as usize];
    for row in 0..6 {
        for x in 0..picture.size.0 {
            let pixel = picture.at(x, top + row);
            if pixel[3] >= OPAQUE {
                let color = color(pixel, x, top + row) as usize;
                masks[color].get_or_insert_with(|| vec![0; width])[x as usize] |= 1 << row;
            }
        }
    }
    for (color, mask) in masks.iter().enumerate().filter_map(|(i, mask)| Some((i, mask.as_ref()?))) {
        let _ = write!(text, "#{color}");
        for run in mask.chunk_by(|a, b| a == b) {
            let character = char::from(63 + run[0]);
            match run.len() {
                1..4 => (0..run.len()).for_each(|_| text.push(character)),
                many => drop(write!(text, "!{many}{character}")),
            }
        }
        text.push('$');
    }
}

/// The number of a pixel's colour.
fn color(pixel: [u8; 4], x: u32, y: u32) -> u32 {
    let threshold = BAYER[(y % 4) as usize][(x % 4) as usize];
    let level = |c: usize| {
        let steps = LEVELS[c] - 1;
        // (threshold + 0.5) / 16 of a step is added before cutting off.
        (u32::from(pixel[c]) * steps * 32 + (2 * threshold + 1) * 255) / (255 * 32)
    };
    (level(0) * LEVELS[1] + level(1)) * LEVELS[2] + level(2)
}

/// The levels of a colour by its number.
fn parts(color: u32) -> [u32; 3] {
    [color / (LEVELS[1] * LEVELS[2]), color / LEVELS[2] % LEVELS[1], color % LEVELS[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_hold_six_rows() {
        let rgba = [[255u8, 255, 255, 255]; 5 * 7].concat();
        let text = text(&Pixels { size: (5, 7), rgba });
        assert!(text.starts_with("\x1bP0;1q\"1;1;5;7#0;2;0;0;0") && text.ends_with("\x1b\\\n"));
        // White is the last colour: six rows of it, then one.
        assert!(text.contains("#251;2;100;100;100") && text.contains("#251!5~$-#251!5@$-"), "{text}");
    }

    #[test]
    fn colors_are_told_apart_and_keep_their_mean() {
        for number in 0..252 {
            let [r, g, b] = parts(number);
            assert_eq!((r * LEVELS[1] + g) * LEVELS[2] + b, number);
        }
        let reds = (0..16).map(|i| parts(color([128, 0, 0, 255], i % 4, i / 4))[0]);
        // 128 / 255 of five steps, in the mean of a 4 x 4 square.
        assert!((f64::from(reds.sum::<u32>()) / 16.0 - 2.51).abs() < 0.05);
    }
}
