//! `--show`: shows the finished picture in the terminal.

use super::args::RenderArgs;
use super::parsers::ShowArg;
use super::pixels::{Pixels, downscaled, fitted_size};
use super::progress::ProgressArg;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use oscura::error::{Error, Result};
use oscura::film::Film;
use oscura::output::{PngOptions, encode_png, rgba8};
use std::env;
use std::fmt::Write as _;
use std::io::{IsTerminal, Write as _};

/// Default terminal size, characters.
const DEFAULT_SIZE: (u32, u32) = (80, 24);

/// Rows reserved for the text after the picture.
const RESERVED_ROWS: u32 = 2;

/// Checks that pictures can be shown.
///
/// # Errors
/// A usage error if standard output is not a terminal with colours, or is used for JSON or progress.
pub(super) fn check(args: &RenderArgs) -> Result<()> {
    if args.show.is_none() {
        return Ok(());
    }
    if args.json || matches!(args.long.progress, Some(ProgressArg::Json | ProgressArg::Openjd)) {
        let message = "--show, --json and --progress json or openjd all write to standard output";
        return Err(Error::usage(message).with_help("use only one of them"));
    }
    if !std::io::stdout().is_terminal() {
        let message = "--show needs a terminal as standard output";
        return Err(Error::usage(message).with_help("write a file with -o instead"));
    }
    if args.show == Some(ShowArg::Auto) && variable("TERM").is_empty_or("dumb") {
        let message = "--show needs a terminal with colours (TERM is not set, or dumb)";
        return Err(Error::usage(message).with_help("choose --show=blocks, kitty or sixel"));
    }
    Ok(())
}

/// Draws a picture with the display options of PNGs.
pub(super) fn draw(args: &RenderArgs, film: &Film, png: &PngOptions) {
    let Some(protocol) = args.show else { return };
    let size = terminal_size::terminal_size().map(|(w, h)| (u32::from(w.0), u32::from(h.0)));
    let (columns, rows) = size.filter(|(w, h)| *w > 0 && *h > RESERVED_ROWS).unwrap_or(DEFAULT_SIZE);
    let max_cells = (columns, rows - RESERVED_ROWS);
    let picture = || Pixels { size: (film.width(), film.height()), rgba: rgba8(film, png) };
    let blocks =
        || block_text(&downscaled(&picture(), (max_cells.0, max_cells.1 * 2)), supports_true_color());
    let text = match resolved_protocol(protocol) {
        // Pictures too large for PNG are drawn as blocks.
        ShowArg::Kitty => match encode_png(film, &PngOptions { deep: false, ..png.clone() }) {
            Ok(encoded) => kitty_text(&encoded.bytes, cells((film.width(), film.height()), max_cells)),
            Err(_) => blocks(),
        },
        ShowArg::Sixel => sixel_text(&downscaled(&picture(), (max_cells.0 * CELL.0, max_cells.1 * CELL.1))),
        ShowArg::Blocks | ShowArg::Auto => blocks(),
    };
    let mut output = std::io::stdout().lock();
    // A closed terminal is not an error.
    let _ = output.write_all(text.as_bytes()).and_then(|()| output.flush());
}

/// Size of a picture in character cells, which are twice as high as wide.
fn cells(picture: (u32, u32), max_cells: (u32, u32)) -> (u32, u32) {
    let (width, height) = fitted_size(picture, (max_cells.0, max_cells.1 * 2));
    (width, height.div_ceil(2))
}

/// Value of an environment variable; empty if not set.
fn variable(name: &str) -> Variable {
    Variable(env::var(name).unwrap_or_default())
}

struct Variable(String);

impl Variable {
    fn is_empty_or(&self, other: &str) -> bool {
        self.0.is_empty() || self.0 == other
    }

    fn starts_with_any(&self, prefixes: &[&str]) -> bool {
        prefixes.iter().any(|prefix| self.0.starts_with(prefix))
    }
}

/// Resolves `Auto` to the graphics protocol of the terminal. Multiplexers don't pass graphics through.
fn resolved_protocol(protocol: ShowArg) -> ShowArg {
    let (term, program) = (variable("TERM"), variable("TERM_PROGRAM"));
    let is_multiplexed = !variable("TMUX").0.is_empty() || term.starts_with_any(&["screen", "tmux"]);
    let is_kitty = !variable("KITTY_WINDOW_ID").0.is_empty()
        || term.starts_with_any(&["xterm-kitty", "xterm-ghostty"])
        || program.starts_with_any(&["ghostty", "WezTerm"]);
    match protocol {
        ShowArg::Auto if is_multiplexed => ShowArg::Blocks,
        ShowArg::Auto if is_kitty => ShowArg::Kitty,
        ShowArg::Auto if term.starts_with_any(&["foot", "mlterm", "yaft"]) => ShowArg::Sixel,
        ShowArg::Auto => ShowArg::Blocks,
        protocol => protocol,
    }
}

/// Whether the terminal supports 24-bit colour, as nearly all do. COLORTERM is not tested: SSH doesn't pass it on.
fn supports_true_color() -> bool {
    !variable("TERM_PROGRAM").starts_with_any(&["Apple_Terminal"]) && variable("TERM").0 != "linux"
}

// The terminal graphics protocol of kitty.

/// Maximum number of base64 characters in a chunk.
const MAX_CHUNK: usize = 4096;

/// Escape sequences that draw a PNG over `columns` and `rows`, without a response from the terminal.
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

/// Minimum alpha of drawn pixels.
const MIN_ALPHA: u8 = 128;

// Half blocks: two pixels per character, in foreground and background colour.

/// The picture as half blocks, in 24-bit colour or else in 256 colours.
fn block_text(picture: &Pixels, is_true_color: bool) -> String {
    let color = |layer: u8, [r, g, b, _]: [u8; 4]| match is_true_color {
        true => format!("{layer};2;{r};{g};{b}"),
        false => format!("{layer};5;{}", nearest_of_256([r, g, b])),
    };
    let (width, height) = picture.size;
    let mut text = String::new();
    for y in (0..height).step_by(2) {
        let mut last = String::new();
        for x in 0..width {
            let (upper, lower) = (picture.at(x, y), picture.at(x, y + 1));
            let (code, character) = match (upper[3] >= MIN_ALPHA, lower[3] >= MIN_ALPHA) {
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

/// Index of the nearest of xterm's 256 colours: in the 6 x 6 x 6 cube, or among the greys.
fn nearest_of_256(rgb: [u8; 3]) -> u8 {
    const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
    let nearest = |code: u8| (0..6u8).min_by_key(|&i| LEVELS[usize::from(i)].abs_diff(code)).unwrap_or(0);
    let [r, g, b] = rgb.map(nearest);
    let grey = ((u32::from(rgb[0]) + u32::from(rgb[1]) + u32::from(rgb[2])) / 3).saturating_sub(3) / 10;
    let grey = (grey as u8).min(23);
    let distance_squared =
        |other: [u8; 3]| -> u32 { rgb.iter().zip(other).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum() };
    let in_cube = [r, g, b].map(|i| LEVELS[usize::from(i)]);
    match distance_squared([8 + 10 * grey; 3]) < distance_squared(in_cube) {
        true => 232 + grey,
        false => 16 + 36 * r + 6 * g + b,
    }
}

// Sixel graphics (DEC VT340 manual, chapter 14): bands of six rows, colour by colour.

/// Assumed size of a character cell, pixels; few terminals have smaller cells.
const CELL: (u32, u32) = (8, 16);

/// Levels of red, green and blue; 252 colours.
const LEVELS: [u32; 3] = [6, 7, 6];

/// Dithering thresholds in sixteenths (Bayer 1973).
const BAYER: [[u32; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];

/// The picture as sixels; transparent pixels leave the screen unchanged.
fn sixel_text(picture: &Pixels) -> String {
    let (width, height) = picture.size;
    // Aspect ratio 1:1, transparent background, size.
    let mut text = format!("\x1bP0;1q\"1;1;{width};{height}");
    for color in 0..LEVELS.iter().product() {
        let [r, g, b] = levels_of(color);
        let percent = |level: u32, levels: u32| (level * 100 + (levels - 1) / 2) / (levels - 1);
        let (r, g, b) = (percent(r, LEVELS[0]), percent(g, LEVELS[1]), percent(b, LEVELS[2]));
        let _ = write!(text, "#{color};2;{r};{g};{b}");
    }
    for top in (0..height).step_by(6) {
        add_band(picture, top, &mut text);
        text.push('-');
    }
    text.push_str("\x1b\\\n");
    text
}

/// Appends a band of six rows.
fn add_band(picture: &Pixels, top: u32, text: &mut String) {
    let width = picture.size.0 as usize;
    let mut masks: Vec<Option<Vec<u8>>> = vec![None; LEVELS.iter().product::<u32>() as usize];
    for row in 0..6 {
        for x in 0..picture.size.0 {
            let pixel = picture.at(x, top + row);
            if pixel[3] >= MIN_ALPHA {
                let color = color_index(pixel, x, top + row) as usize;
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

/// Index of a pixel's colour, with dithering.
fn color_index(pixel: [u8; 4], x: u32, y: u32) -> u32 {
    let threshold = BAYER[(y % 4) as usize][(x % 4) as usize];
    let level = |c: usize| {
        let steps = LEVELS[c] - 1;
        // (threshold + 0.5) / 16 of a step is added before truncation.
        (u32::from(pixel[c]) * steps * 32 + (2 * threshold + 1) * 255) / (255 * 32)
    };
    (level(0) * LEVELS[1] + level(1)) * LEVELS[2] + level(2)
}

/// Levels of a colour, by index.
fn levels_of(color: u32) -> [u32; 3] {
    [color / (LEVELS[1] * LEVELS[2]), color / LEVELS[2] % LEVELS[1], color % LEVELS[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_chunks_but_the_last_are_marked() {
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
mod blocks_tests {
    use super::*;

    #[test]
    fn characters_have_two_pixels() {
        let rgba = [[255, 0, 0, 255], [0, 0, 0, 0], [0, 0, 255, 255], [0, 255, 0, 255]].concat();
        let picture = Pixels { size: (2, 2), rgba };
        let expected = "\x1b[38;2;255;0;0;48;2;0;0;255m▀\x1b[0;38;2;0;255;0m▄\x1b[0m\n";
        assert_eq!(block_text(&picture, true), expected);
        assert_eq!(block_text(&picture, false), "\x1b[38;5;196;48;5;21m▀\x1b[0;38;5;46m▄\x1b[0m\n");
        assert_eq!([[128; 3], [0; 3], [255; 3]].map(nearest_of_256), [244, 16, 231]);
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
            let [r, g, b] = levels_of(number);
            assert_eq!((r * LEVELS[1] + g) * LEVELS[2] + b, number);
        }
        let reds = (0..16).map(|i| levels_of(color_index([128, 0, 0, 255], i % 4, i / 4))[0]);
        // 128 / 255 of five steps, in the mean of a 4 x 4 square.
        assert!((f64::from(reds.sum::<u32>()) / 16.0 - 2.51).abs() < 0.05);
    }
}
