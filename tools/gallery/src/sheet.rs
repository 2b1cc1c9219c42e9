//! The contact sheet: thumbnails of all pictures, with labels.

use crate::render::Shot;
use font8x8::legacy::BASIC_LEGACY;
use image::{Rgb, RgbImage};

/// Width and height of a thumbnail cell.
const TILE: [u32; 2] = [256, 170];
/// Height of a line of text.
const LINE: u32 = 16;
const GAP: u32 = 8;
const COLUMNS: u32 = 6;
const PAPER: Rgb<u8> = Rgb([24, 24, 26]);
const INK: Rgb<u8> = Rgb([214, 214, 208]);

/// A thumbnail with its label.
pub struct Tile {
    picture: RgbImage,
    label: String,
}

impl Tile {
    /// Downscales a picture: the mean of the pixels, in linear light. Pictures smaller than the cell are enlarged by pixel
    /// replication.
    pub fn new(shot: &Shot, label: &str) -> Tile {
        let (w, h) = (shot.picture.film().width(), shot.picture.film().height());
        let scale = (f64::from(TILE[0]) / f64::from(w)).min(f64::from(TILE[1]) / f64::from(h));
        let size = [w, h].map(|n| ((f64::from(n) * scale).round() as u32).max(1));
        let picture = RgbImage::from_fn(size[0], size[1], |x, y| {
            let columns = cover(x, size[0], w);
            let mut sum = [0.0f32; 3];
            let mut count = 0.0;
            for (px, py) in cover(y, size[1], h).flat_map(|py| columns.clone().map(move |px| (px, py))) {
                // Clipped before averaging, so that light edges don't bleed.
                let value = shot.linear(px, py).map(|v| v.min(shot.most()));
                sum = std::array::from_fn(|c| sum[c] + value[c]);
                count += 1.0;
            }
            Rgb(shot.encode(sum.map(|s| s / count)))
        });
        Tile { picture, label: label.to_string() }
    }
}

/// The pixels of `full` covered by pixel `i` of `small`; at least one.
fn cover(i: u32, small: u32, full: u32) -> std::ops::Range<u32> {
    let start = (u64::from(i) * u64::from(full) / u64::from(small)) as u32;
    let end = (u64::from(i + 1) * u64::from(full) / u64::from(small)) as u32;
    start..end.max(start + 1)
}

/// Composes the thumbnails.
pub fn contact_sheet(tiles: &[Tile]) -> RgbImage {
    let columns = COLUMNS.min(tiles.len().max(1) as u32);
    let rows = (tiles.len() as u32).div_ceil(columns).max(1);
    let step = [TILE[0] + GAP, TILE[1] + LINE + GAP];
    let mut sheet = RgbImage::from_pixel(columns * step[0] + GAP, rows * step[1] + GAP, PAPER);
    for (i, tile) in tiles.iter().enumerate() {
        let i = i as u32;
        let (left, top) = (GAP + (i % columns) * step[0], GAP + (i / columns) * step[1]);
        let (w, h) = tile.picture.dimensions();
        let (x, y) = (left + (TILE[0] - w) / 2, top + (TILE[1] - h) / 2);
        image::imageops::replace(&mut sheet, &tile.picture, i64::from(x), i64::from(y));
        let width = 8 * tile.label.chars().count() as u32;
        write(&mut sheet, &tile.label, left + TILE[0].saturating_sub(width) / 2, top + TILE[1] + 5);
    }
    sheet
}

/// Draws text in letters of 8 x 8 pixels; non-ASCII characters become question marks, text outside is clipped.
fn write(sheet: &mut RgbImage, text: &str, left: u32, top: u32) {
    for (i, c) in text.chars().enumerate() {
        let glyph = BASIC_LEGACY.get(c as usize).unwrap_or(&BASIC_LEGACY[usize::from(b'?')]);
        for (row, bits) in glyph.iter().enumerate() {
            for column in (0..8u32).filter(|b| bits >> b & 1 == 1) {
                let at = (left + i as u32 * 8 + column, top + row as u32);
                if let Some(pixel) = sheet.get_pixel_mut_checked(at.0, at.1) {
                    *pixel = INK;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_covered_once_when_shrinking() {
        for (small, full) in [(3u32, 10u32), (256, 1000), (7, 7)] {
            let all: Vec<u32> = (0..small).flat_map(|i| cover(i, small, full)).collect();
            assert_eq!(all, (0..full).collect::<Vec<u32>>());
        }
        assert_eq!(cover(5, 10, 4), 2..3);
    }

    #[test]
    fn letters_are_drawn_inside_their_box() {
        let mut sheet = RgbImage::from_pixel(40, 12, PAPER);
        write(&mut sheet, "Hi\u{20ac}", 4, 2);
        let ink: Vec<(u32, u32)> =
            sheet.enumerate_pixels().filter(|p| *p.2 == INK).map(|p| (p.0, p.1)).collect();
        assert!(!ink.is_empty() && ink.iter().all(|&(x, y)| (4..28).contains(&x) && (2..10).contains(&y)));
        write(&mut sheet, "beyond", 38, 8);
    }
}
