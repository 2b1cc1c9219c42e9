//! Two pixels a character: the upper half block in one colour on a ground of another.

use super::scaled::{OPAQUE, Pixels};
use std::fmt::Write;

/// The picture in characters; in 256 colours where the terminal hasn't all.
pub(super) fn text(picture: &Pixels, has_all_colors: bool) -> String {
    let color = |layer: u8, [r, g, b, _]: [u8; 4]| match has_all_colors {
        true => format!("{layer};2;{r};{g};{b}"),
        false => format!("{layer};5;{}", cube([r, g, b])),
    };
    let (width, height) = picture.size;
    let mut text = String::new();
    for y in (0..height).step_by(2) {
        let mut last = String::new();
        for x in 0..width {
            let (upper, lower) = (picture.at(x, y), picture.at(x, y + 1));
            let (code, character) = match (upper[3] >= OPAQUE, lower[3] >= OPAQUE) {
                (true, true) => (format!("{};{}", color(38, upper), color(48, lower)), '▀'),
                (true, false) => (format!("0;{}", color(38, upper)), '▀'),
                (false, true) => (format!("0;{}", color(38, lower)), '▄'),
                (false, false) => ("0".to_string(), ' '),
            };
            if code != last {
                // Text that grows can't fail.
                let _ = write!(text, "\x1b[{code}m");
                last = code;
            }
            text.push(character);
        }
        text.push_str("\x1b[0m\n");
    }
    text
}

/// The nearest of xterm's 256 colours: in the cube of 6 x 6 x 6, or among the greys.
fn cube(rgb: [u8; 3]) -> u8 {
    const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
    let near = |code: u8| (0..6u8).min_by_key(|&i| LEVELS[usize::from(i)].abs_diff(code)).unwrap_or(0);
    let [r, g, b] = rgb.map(near);
    let grey = ((u32::from(rgb[0]) + u32::from(rgb[1]) + u32::from(rgb[2])) / 3).saturating_sub(3) / 10;
    let grey = (grey as u8).min(23);
    let far =
        |other: [u8; 3]| -> u32 { rgb.iter().zip(other).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum() };
    let in_cube = [r, g, b].map(|i| LEVELS[usize::from(i)]);
    match far([8 + 10 * grey; 3]) < far(in_cube) {
        true => 232 + grey,
        false => 16 + 36 * r + 6 * g + b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_have_two_pixels() {
        let rgba = [[255, 0, 0, 255], [0, 0, 0, 0], [0, 0, 255, 255], [0, 255, 0, 255]].concat();
        let picture = Pixels { size: (2, 2), rgba };
        let expected = "\x1b[38;2;255;0;0;48;2;0;0;255m▀\x1b[0;38;2;0;255;0m▄\x1b[0m\n";
        assert_eq!(text(&picture, true), expected);
        assert_eq!(text(&picture, false), "\x1b[38;5;196;48;5;21m▀\x1b[0;38;5;46m▄\x1b[0m\n");
        assert_eq!((cube([128; 3]), cube([0; 3]), cube([255; 3])), (244, 16, 231));
    }
}
