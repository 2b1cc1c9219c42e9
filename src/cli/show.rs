//! `--show`: shows the finished picture in the terminal, also over SSH.

use super::args::RenderArgs;
use super::parsers::ShowArg;
use super::progress::ProgressArg;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use oscura::color::{linear_from_srgb, srgb_from_linear};
use oscura::error::{Error, Result};
use oscura::film::Film;
use oscura::output::{PngOptions, encode_png, rgba8};
use std::env;
use std::fmt::Write as _;
use std::io::{IsTerminal, Write as _};

/// Width and height of terminals that don't report theirs, in characters.
const USUAL_SIZE: (u32, u32) = (80, 24);

/// Rows kept for the text after the picture.
const ROWS_LEFT: u32 = 2;

/// Can the picture be drawn?
///
/// # Errors
/// A usage error where standard output is not a terminal with colours, or is used for JSON or progress.
pub(super) fn check(args: &RenderArgs) -> Result<()> {
    if args.show.is_none() {
        return Ok(());
    }
    if args.json || matches!(args.long.progress, Some(ProgressArg::Json | ProgressArg::Openjd)) {
        let message = "--show writes to standard output, as JSON and progress for programs do";
        return Err(Error::usage(message).with_help("leave one of them out"));
    }
    if !std::io::stdout().is_terminal() {
        let message = "--show needs a terminal as standard output";
        return Err(Error::usage(message).with_help("leave it out, and write a picture by -o"));
    }
    if args.show == Some(ShowArg::Auto) && variable("TERM").is_empty_or("dumb") {
        let message = "--show needs a terminal that shows colours (TERM is not set, or dumb)";
        return Err(Error::usage(message).with_help("choose: --show=blocks, kitty or sixel"));
    }
    Ok(())
}

/// Draws a picture as PNGs would show it.
pub(super) fn draw(args: &RenderArgs, film: &Film, png: &PngOptions) {
    let Some(how) = args.show else { return };
    let size = terminal_size::terminal_size().map(|(w, h)| (u32::from(w.0), u32::from(h.0)));
    let (columns, rows) = size.filter(|(w, h)| *w > 0 && *h > ROWS_LEFT).unwrap_or(USUAL_SIZE);
    let room = (columns, rows - ROWS_LEFT);
    let picture = || Pixels { size: (film.width(), film.height()), rgba: rgba8(film, png) };
    let text = match chosen(how) {
        // Only for terminals known to support it; pictures that PNG can't hold are drawn as blocks.
        ShowArg::Kitty => match encode_png(film, &PngOptions { deep: false, ..png.clone() }) {
            Ok(encoded) => kitty_text(&encoded.bytes, cells((film.width(), film.height()), room)),
            Err(_) => block_text(&downscaled(&picture(), (room.0, room.1 * 2)), has_all_colors()),
        },
        ShowArg::Sixel => sixel_text(&downscaled(&picture(), (room.0 * CELL.0, room.1 * CELL.1))),
        ShowArg::Blocks | ShowArg::Auto => {
            block_text(&downscaled(&picture(), (room.0, room.1 * 2)), has_all_colors())
        }
    };
    let mut output = std::io::stdout().lock();
    // A closed terminal is not an error.
    let _ = output.write_all(text.as_bytes()).and_then(|()| output.flush());
}

/// Columns and rows of a picture in cells that are twice as high as wide.
fn cells(picture: (u32, u32), room: (u32, u32)) -> (u32, u32) {
    let (width, height) = fitted_size(picture, (room.0, room.1 * 2));
    (width, height.div_ceil(2))
}

/// A variable of the environment; empty where it is not set.
fn variable(name: &str) -> Variable {
    Variable(env::var(name).unwrap_or_default())
}

struct Variable(String);

impl Variable {
    fn is_empty_or(&self, other: &str) -> bool {
        self.0.is_empty() || self.0 == other
    }

    fn begins_with(&self, starts: &[&str]) -> bool {
        starts.iter().any(|start| self.0.starts_with(start))
    }
}

/// Graphics protocol of the terminal. Multiplexers don't pass graphics through.
fn chosen(how: ShowArg) -> ShowArg {
    let (term, program) = (variable("TERM"), variable("TERM_PROGRAM"));
    let is_multiplexed = !variable("TMUX").0.is_empty() || term.begins_with(&["screen", "tmux"]);
    let is_kitty = !variable("KITTY_WINDOW_ID").0.is_empty()
        || term.begins_with(&["xterm-kitty", "xterm-ghostty"])
        || program.begins_with(&["ghostty", "WezTerm"]);
    match how {
        ShowArg::Auto if is_multiplexed => ShowArg::Blocks,
        ShowArg::Auto if is_kitty => ShowArg::Kitty,
        ShowArg::Auto if term.begins_with(&["foot", "mlterm", "yaft"]) => ShowArg::Sixel,
        ShowArg::Auto => ShowArg::Blocks,
        how => how,
    }
}

/// Does the terminal show 24-bit colour? Nearly all do; SSH doesn't pass on COLORTERM, which says so.
fn has_all_colors() -> bool {
    !variable("TERM_PROGRAM").begins_with(&["Apple_Terminal"]) && variable("TERM").0 != "linux"
}

// The terminal graphics protocol of kitty.

/// Maximum number of characters of a chunk.
const MAX_CHUNK: usize = 4096;

/// A PNG, drawn over `columns` and `rows`; the terminal's response is suppressed.
fn kitty_text(png: &[u8], (columns, rows): (u32, u32)) -> String {
    let encoded = STANDARD.encode(png);
    let chunks: Vec<&str> =
        encoded.as_bytes().chunks(MAX_CHUNK).filter_map(|chunk| std::str::from_utf8(chunk).ok()).collect();
    let mut text = String::new();
    for (i, chunk) in chunks.iter().enumerate() {
        let first = if i == 0 { format!("f=100,a=T,q=2,c={columns},r={rows},") } else { String::new() };
        let more = u8::from(i + 1 < chunks.len());
        // Writing to a string can't fail.
        let _ = write!(text, "\x1b_G{first}m={more};{chunk}\x1b\\");
    }
    text.push('\n');
    text
}

// Downscaling.

/// Minimum alpha of a pixel that is drawn.
const OPAQUE: u8 = 128;

/// Display-referred RGBA with straight alpha, row by row from the top.
struct Pixels {
    pub size: (u32, u32),
    pub rgba: Vec<u8>,
}

impl Pixels {
    /// A pixel; transparent black beyond the edge.
    pub fn at(&self, x: u32, y: u32) -> [u8; 4] {
        let (width, height) = self.size;
        if x >= width || y >= height {
            return [0; 4];
        }
        let at = (y as usize * width as usize + x as usize) * 4;
        [self.rgba[at], self.rgba[at + 1], self.rgba[at + 2], self.rgba[at + 3]]
    }
}

/// The largest size with a picture's aspect ratio that fits into `room` and doesn't enlarge it.
fn fitted_size((width, height): (u32, u32), room: (u32, u32)) -> (u32, u32) {
    let across = f64::from(room.0) / f64::from(width.max(1));
    let down = f64::from(room.1) / f64::from(height.max(1));
    let scale = across.min(down).min(1.0);
    let edge = |pixels: u32, most: u32| ((f64::from(pixels) * scale).round() as u32).clamp(1, most.max(1));
    (edge(width, room.0), edge(height, room.1))
}

/// The picture scaled down to fit into `room`: each pixel is the linear mean of those that it covers.
fn downscaled(picture: &Pixels, room: (u32, u32)) -> Pixels {
    let size = fitted_size(picture.size, room);
    let range = |at: u32, count: u32, of: u32| {
        let edge = |at: u32| (u64::from(at) * u64::from(of) / u64::from(count)) as u32;
        edge(at)..edge(at + 1).max(edge(at) + 1)
    };
    let mut rgba = Vec::with_capacity(size.0 as usize * size.1 as usize * 4);
    for y in 0..size.1 {
        for x in 0..size.0 {
            let rows = range(y, size.1, picture.size.1);
            let columns = range(x, size.0, picture.size.0);
            let pixels = rows.flat_map(|row| columns.clone().map(move |column| picture.at(column, row)));
            rgba.extend(mean(pixels));
        }
    }
    Pixels { size, rgba }
}

/// The mean of pixels, each weighted by its alpha.
fn mean(pixels: impl Iterator<Item = [u8; 4]>) -> [u8; 4] {
    let (mut sum, mut alphas, mut count) = ([0.0f32; 3], 0.0f32, 0.0f32);
    for [r, g, b, a] in pixels {
        let alpha = f32::from(a) / 255.0;
        for (sum, code) in sum.iter_mut().zip([r, g, b]) {
            *sum += linear_from_srgb(f32::from(code) / 255.0) * alpha;
        }
        alphas += alpha;
        count += 1.0;
    }
    let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
    let [r, g, b] = sum.map(|sum| byte(srgb_from_linear(sum / alphas.max(1e-6))));
    [r, g, b, byte(alphas / count.max(1.0))]
}

// Two pixels per character: the upper half block, with foreground and background colour.

/// The picture as half blocks; in 256 colours where the terminal lacks 24-bit colour.
fn block_text(picture: &Pixels, has_all_colors: bool) -> String {
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
                // Writing to a string can't fail.
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

// Sixel graphics (DEC VT340 manual, chapter 14): bands of six rows, colour by colour.

/// Assumed pixels of a character cell: few terminals have fewer.
const CELL: (u32, u32) = (8, 16);

/// Levels of red, green and blue: 252 colours.
const LEVELS: [u32; 3] = [6, 7, 6];

/// Thresholds in sixteenths (Bayer 1973), which hide the steps between the levels.
const BAYER: [[u32; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];

/// The picture as sixels; transparent pixels leave the screen unchanged.
fn sixel_text(picture: &Pixels) -> String {
    let (width, height) = picture.size;
    // Aspect ratio 1:1, transparent background, size.
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

/// Appends a band of six rows.
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
        // (threshold + 0.5) / 16 of a step is added before truncation.
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
    fn pieces_are_marked() {
        let text = kitty_text(&[7; 4000], (40, 12));
        let chunks: Vec<&str> = text.trim_end().split_inclusive("\x1b\\").collect();
        assert_eq!(chunks.len(), 2);
        assert!(chunks[0].starts_with("\x1b_Gf=100,a=T,q=2,c=40,r=12,m=1;"));
        assert!(chunks[1].starts_with("\x1b_Gm=0;"));
        let data: String = chunks.iter().map(|p| p[..p.len() - 2].split(';').next_back().unwrap()).collect();
        assert_eq!(STANDARD.decode(data).unwrap(), [7; 4000]);
    }
}

#[cfg(test)]
mod scaled_tests {
    use super::*;

    #[test]
    fn sizes_keep_their_shape_and_never_grow() {
        assert_eq!(fitted_size((1280, 720), (80, 44)), (78, 44));
        assert_eq!(fitted_size((10, 10), (80, 44)), (10, 10));
        assert_eq!(fitted_size((10_000, 10), (80, 44)), (80, 1));
    }

    #[test]
    fn small_pixels_are_means_of_light() {
        let rgba = [[255, 255, 255, 255], [0, 0, 0, 255], [255, 0, 0, 255], [9, 9, 9, 0]].concat();
        let small = downscaled(&Pixels { size: (4, 1), rgba }, (2, 9));
        // Half the light of white has the code 188; what is transparent adds no colour.
        assert_eq!((small.size, small.at(0, 0)), ((2, 1), [188, 188, 188, 255]));
        assert_eq!((small.at(1, 0), small.at(2, 0)), ([255, 0, 0, 128], [0; 4]));
    }
}

#[cfg(test)]
mod blocks_tests {
    use super::*;

    #[test]
    fn characters_have_two_pixels() {
        let rgba = [[255, 0, 0, 255], [0, 0, 0, 0], [0, 0, 255, 255], [0, 255, 0, 255]].concat();
        let picture = Pixels { size: (2, 2), rgba };
        let expected = "\x1b[38;2;255;0;0;48;2;0;0;255m▀\x1b[0;38;2;0;255;0m▄\x1b[0m\n";
        assert_eq!(block_text(&picture, true), expected);
        assert_eq!(block_text(&picture, false), "\x1b[38;5;196;48;5;21m▀\x1b[0;38;5;46m▄\x1b[0m\n");
        assert_eq!((cube([128; 3]), cube([0; 3]), cube([255; 3])), (244, 16, 231));
    }
}

#[cfg(test)]
mod sixel_tests {
    use super::*;

    #[test]
    fn bands_hold_six_rows() {
        let rgba = [[255u8, 255, 255, 255]; 5 * 7].concat();
        let text = sixel_text(&Pixels { size: (5, 7), rgba });
        assert!(text.starts_with("\x1bP0;1q\"1;1;5;7#0;2;0;0;0") && text.ends_with("\x1b\\\n"));
        // White is the last colour: six rows of it, then one.
        assert!(text.contains("#251;2;100;100;100") && text.contains("#251!5~$-#251!5@$-"), "{text}");
    }

    #[test]
    fn colors_are_distinct_and_keep_their_mean() {
        for number in 0..252 {
            let [r, g, b] = parts(number);
            assert_eq!((r * LEVELS[1] + g) * LEVELS[2] + b, number);
        }
        let reds = (0..16).map(|i| parts(color([128, 0, 0, 255], i % 4, i / 4))[0]);
        // 128 / 255 of five steps, in the mean of a 4 x 4 square.
        assert!((f64::from(reds.sum::<u32>()) / 16.0 - 2.51).abs() < 0.05);
    }
}
