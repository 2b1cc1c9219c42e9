//! Radiance HDR (Ward 1994, "The RADIANCE Lighting Simulation and Rendering System"; `src/common/color.h` and the file format
//! document of Radiance). Adds exposure factors, XYZ and all pixel orders to the decoder of the crate `image`.
//!
//! Pixels were multiplied by `EXPOSURE` and `COLORCORR`, which may occur repeatedly. The header's last line is the pixel order:
//! scan lines along either axis in either direction, usually `-Y h +X w`. `FORMAT=32-bit_rle_xyze` is CIE XYZ.

use super::source::{self, Layout, Source};
use crate::color::converted;
use crate::error::{Result, Warning};
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageError};
use std::io::{ErrorKind, Read};

/// The pixels of a file, linear Rec. 709, interleaved.
pub(super) struct Radiance {
    pub width: u32,
    pub height: u32,
    pub rgb: Vec<f32>,
}

/// Size of a decoded pixel, bytes: three floats.
const BYTES_PER_PIXEL: u64 = 12;

/// Maximum size of a header, bytes.
const MAX_HEADER: usize = 1 << 20;

/// CIE XYZ to linear Rec. 709, whose white is D65 (IEC 61966-2-1).
const REC709_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

struct Header {
    /// Product of all exposure factors, per channel.
    factors: [f32; 3],
    is_xyz: bool,
    /// Slow and fast axis: whether it is x, whether it increases, and its number of pixels.
    axes: [(bool, bool, u32); 2],
    /// Size of the header, bytes.
    length: usize,
}

/// Size of a chunk of decoded rows, bytes.
const CHUNK_BYTES: usize = 1 << 23;

/// The layout of the image that [`decode`] returns, from the header.
pub(super) fn layout(source: &Source) -> Result<Layout> {
    let header = Header::checked(source)?;
    let rows = header.is_top_down().then_some(1);
    Ok(Layout { size: header.size(), channels: 3, bits: 32, rows })
}

/// Decodes a file, with warnings about factors in its header.
///
/// # Errors
/// An input error for a damaged file.
pub(super) fn decode(source: &Source, warnings: &mut Vec<Warning>) -> Result<Radiance> {
    let header = Header::checked(source)?;
    let [width, height] = header.size();
    let mut rgb = Vec::with_capacity(width as usize * height as usize * 3);
    header.each(source, &mut |rows| rgb.extend(rows))?;
    header.warn(source, warnings);
    Ok(header.in_order(rgb))
}

/// Decodes a file with the pixel order `-Y h +X w` and calls `take` with chunks of rows, from the top.
///
/// # Errors
/// An input error for a damaged file.
pub(super) fn rows(
    source: &Source,
    warnings: &mut Vec<Warning>,
    take: &mut dyn FnMut(Vec<f32>),
) -> Result<()> {
    let header = Header::checked(source)?;
    header.each(source, take)?;
    header.warn(source, warnings);
    Ok(())
}

/// The error of a decoder, with a remedy for truncated files.
pub(super) fn broken(source: &Source, error: &ImageError) -> crate::error::Error {
    match error {
        ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => source
            .error("is truncated: it ends before its last pixel")
            .with_help("download or export the file again"),
        other => source.error(format!("can't be read as an image: {other}")),
    }
}

impl Header {
    /// Reads the header and checks the size.
    fn checked(source: &Source) -> Result<Header> {
        let header = Header::read(source)?;
        let [width, height] = header.size().map(u64::from);
        source::check(source, width, height)?;
        source::check_memory(source, width, height, width * height * BYTES_PER_PIXEL)?;
        Ok(header)
    }

    /// Width and height.
    fn size(&self) -> [u32; 2] {
        let [(first_is_x, _, rows), (_, _, columns)] = self.axes;
        if first_is_x { [rows, columns] } else { [columns, rows] }
    }

    /// Calls `take` with chunks of scan lines, in the order of the file.
    fn each(&self, source: &Source, take: &mut dyn FnMut(Vec<f32>)) -> Result<()> {
        let [rows, columns] = self.axes.map(|axis| axis.2);
        let mut file = source.reader(self.length as u64);
        let step = (CHUNK_BYTES as u64 / (u64::from(columns) * BYTES_PER_PIXEL)).max(1);
        for first in (0..rows).step_by(step as usize) {
            let some = u64::from(rows - first).min(step);
            // The crate's decoder ignores most of the header, so it gets a minimal one. It reads no bytes beyond its rows.
            let plain = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {some} +X {columns}\n");
            let decoder = HdrDecoder::new_nonstrict(plain.as_bytes().chain(&mut file));
            let decoded = decoder.and_then(DynamicImage::from_decoder).map_err(|e| broken(source, &e))?;
            let mut rgb = decoded.into_rgb32f().into_raw();
            if self.factors != [1.0; 3] {
                let [r, g, b] = self.factors;
                rgb.as_chunks_mut::<3>().0.iter_mut().for_each(|p| *p = [p[0] / r, p[1] / g, p[2] / b]);
            }
            if self.is_xyz {
                rgb.as_chunks_mut::<3>().0.iter_mut().for_each(|p| *p = converted(&REC709_FROM_XYZ, *p));
            }
            take(rgb);
        }
        Ok(())
    }

    /// Warns that values were divided by exposure factors.
    fn warn(&self, source: &Source, warnings: &mut Vec<Warning>) {
        let [r, g, b] = self.factors;
        if self.factors != [1.0; 3] {
            let shown = if r == g && g == b { r.to_string() } else { format!("{r} {g} {b}") };
            let message =
                format!("its values are divided by the factors of its header (EXPOSURE, COLORCORR): {shown}");
            warnings.push(source.warning(message));
        }
    }

    /// Whether the pixel order is `-Y h +X w`: top to bottom, left to right. The file's y axis points up.
    fn is_top_down(&self) -> bool {
        let [(first_is_x, first_grows, _), (_, second_grows, _)] = self.axes;
        !first_is_x && !first_grows && second_grows
    }

    fn read(source: &Source) -> Result<Header> {
        let fail = |what: &str| source.error(format!("can't be read as an image: {what}"));
        let mut header = Header { factors: [1.0; 3], is_xyz: false, axes: [(false, false, 0); 2], length: 0 };
        let head = &source.bytes[..source.bytes.len().min(MAX_HEADER)];
        let mut is_over = false;
        for line in head.split_inclusive(|&b| b == b'\n') {
            header.length += line.len();
            let line = String::from_utf8_lossy(line);
            let line = line.trim();
            if is_over {
                header.axes = axes(line).ok_or_else(|| fail("its header lacks the size of the image"))?;
                return Ok(header);
            }
            is_over = line.is_empty();
            header.parse_variable(line);
        }
        Err(fail("it ends inside its header"))
    }

    /// Parses a variable of the header; unknown ones are skipped.
    fn parse_variable(&mut self, line: &str) {
        let Some((name, value)) = line.split_once('=') else { return };
        let numbers = || value.split_whitespace().filter_map(|word| word.parse::<f32>().ok());
        let usable = |factor: &f32| *factor > 0.0 && factor.is_finite();
        match name.trim() {
            "EXPOSURE" => {
                let factor = numbers().next().filter(usable).unwrap_or(1.0);
                self.factors.iter_mut().for_each(|f| *f *= factor);
            }
            "COLORCORR" => {
                let factors: Vec<f32> = numbers().filter(usable).collect();
                if let [r, g, b] = factors[..] {
                    self.factors.iter_mut().zip([r, g, b]).for_each(|(f, factor)| *f *= factor);
                }
            }
            "FORMAT" => self.is_xyz = value.trim() == "32-bit_rle_xyze",
            _ => {}
        }
    }

    /// The pixels reordered from top to bottom, left to right.
    fn in_order(&self, rgb: Vec<f32>) -> Radiance {
        let [(first_is_x, first_grows, rows), (_, second_grows, columns)] = self.axes;
        let [width, height] = self.size();
        if self.is_top_down() {
            return Radiance { width, height, rgb };
        }
        let mut out = vec![0.0; rgb.len()];
        let pixels = rgb.as_chunks::<3>().0;
        let position = |i: u32, count: u32, is_reversed: bool| if is_reversed { count - 1 - i } else { i };
        for (at, pixel) in pixels.iter().enumerate() {
            let (i, j) = (at as u32 / columns, at as u32 % columns);
            let (x, y) = match first_is_x {
                true => (position(i, rows, !first_grows), position(j, columns, second_grows)),
                false => (position(j, columns, !second_grows), position(i, rows, first_grows)),
            };
            let place = (y as usize * width as usize + x as usize) * 3;
            out[place..place + 3].copy_from_slice(pixel);
        }
        Radiance { width, height, rgb: out }
    }
}

/// Parses the pixel order, such as `-Y 512 +X 1024`.
fn axes(line: &str) -> Option<[(bool, bool, u32); 2]> {
    let mut words = line.split_whitespace();
    let mut axis = || {
        let (name, count) = (words.next()?, words.next()?.parse().ok()?);
        let (is_x, grows) = match name {
            "+X" => (true, true),
            "-X" => (true, false),
            "+Y" => (false, true),
            "-Y" => (false, false),
            _ => return None,
        };
        Some((is_x, grows, count))
    };
    let [first, second] = [axis()?, axis()?];
    (first.0 != second.0).then_some([first, second])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// An image of 3 x 2 pixels, their red 1/128 to 6/128.
    fn decoded(header: &str) -> (Result<Radiance>, Vec<Warning>) {
        let mut bytes = header.as_bytes().to_vec();
        bytes.extend((1..=6u8).flat_map(|red| [red, 0, 0, 129]));
        let mut warnings = Vec::new();
        let image = decode(&Source::new(&bytes, (Path::new("a.hdr"), ""), None), &mut warnings);
        (image, warnings)
    }

    fn reds(size: &str) -> (u32, u32, Vec<u32>) {
        let image = decoded(&format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n")).0;
        let image = image.unwrap_or_else(|e| panic!("{e}"));
        let reds = image.rgb.iter().step_by(3).map(|r| (r * 128.0).round() as u32).collect();
        (image.width, image.height, reds)
    }

    #[test]
    fn all_pixel_orders_are_decoded() {
        for (size, expected) in [
            ("-Y 2 +X 3", (3, 2, [1, 2, 3, 4, 5, 6])),
            ("+Y 2 +X 3", (3, 2, [4, 5, 6, 1, 2, 3])),
            ("-Y 2 -X 3", (3, 2, [3, 2, 1, 6, 5, 4])),
            ("+Y 2 -X 3", (3, 2, [6, 5, 4, 3, 2, 1])),
            // Columns of three, from left to right.
            ("+X 2 -Y 3", (2, 3, [1, 4, 2, 5, 3, 6])),
            ("+X 2 +Y 3", (2, 3, [3, 6, 2, 5, 1, 4])),
            ("-X 2 -Y 3", (2, 3, [4, 1, 5, 2, 6, 3])),
            ("-X 2 +Y 3", (2, 3, [6, 3, 5, 2, 4, 1])),
        ] {
            let (width, height, order) = expected;
            assert_eq!(reds(size), (width, height, order.to_vec()), "{size}");
        }
        for size in ["-Y 2 +Y 3", "-Y 2", "+Z 2 +X 3", "-Y two +X 3", "-Y 0 +X 3"] {
            assert!(decoded(&format!("#?RADIANCE\n\n{size}\n")).0.is_err(), "{size}");
        }
    }

    #[test]
    fn rows_equal_those_of_the_whole_image() {
        let (width, height) = (9, 100_000);
        let head = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
        let mut bytes = head.into_bytes();
        for row in 0..height {
            match row % 3 {
                0 => (0..width).for_each(|x| bytes.extend([x as u8, row as u8, 7, 130])),
                // Run-length encoding, old and new.
                1 => bytes.extend([row as u8, 5, 6, 128, 1, 1, 1, 7, 9, 9, 9, 120]),
                _ => {
                    bytes.extend([2, 2, 0, 9]);
                    (0..4).for_each(|c| bytes.extend([128 + 5, row as u8, 4, c, 2, 3, 120]));
                }
            }
        }
        let expected =
            HdrDecoder::new(bytes.as_slice()).and_then(DynamicImage::from_decoder).expect("it is read");
        let source = Source::new(&bytes, (Path::new("a.hdr"), ""), None);
        let mut parts = Vec::new();
        rows(&source, &mut Vec::new(), &mut |rows| parts.push(rows)).expect("it is read");
        assert!(parts.len() > 1 && parts.iter().all(|rows| rows.len() * 4 <= CHUNK_BYTES), "{}", parts.len());
        assert!(parts.concat() == expected.into_rgb32f().into_raw());
        bytes.truncate(bytes.len() - 1);
        let source = Source::new(&bytes, (Path::new("a.hdr"), ""), None);
        assert!(rows(&source, &mut Vec::new(), &mut |_| {}).is_err());
    }

    #[test]
    fn exposure_and_xyz_are_converted() {
        let (image, warnings) = decoded("#?RGBE\nEXPOSURE=2\nEXPOSURE= 2\nCOLORCORR=1 2 4\n\n-Y 2 +X 3\n");
        assert_eq!(image.expect("it is read").rgb[0], 1.0 / 128.0 / 4.0);
        assert!(warnings[0].message.contains("4 8 16"), "{warnings:?}");
        let (image, warnings) = decoded("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 2 +X 3\n");
        let [r, g, b] = [0, 1, 2].map(|c| image.as_ref().expect("it is read").rgb[c] * 128.0);
        assert!((r - 3.24).abs() < 0.01 && (g + 0.969).abs() < 0.01 && (b - 0.0556).abs() < 0.001);
        assert!(warnings.is_empty());
        let cut = decoded("#?RADIANCE\n\n-Y 3 +X 3\n").0.err().expect("it is cut").to_string();
        assert!(cut.contains("truncated"), "{cut}");
    }
}
