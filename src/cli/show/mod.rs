//! `--show`: the finished picture in the terminal, for people who have nothing else to look at it with (SSH).

mod blocks;
mod kitty;
mod scaled;
mod sixel;

use super::args::RenderArgs;
use super::progress::ProgressArg;
use super::show_arg::ShowArg;
use oscura::error::{Error, Result};
use oscura::film::Film;
use oscura::output::{PngOptions, encode_png, rgba8};
use scaled::{Pixels, fitting};
use std::env;
use std::io::{IsTerminal, Write};

/// Width and height of terminals that don't tell theirs, in characters.
const USUAL_SIZE: (u32, u32) = (80, 24);

/// Rows left for what is printed behind the picture.
const ROWS_LEFT: u32 = 2;

/// Can the picture be drawn?
///
/// # Errors
/// A usage error where standard output is no terminal that shows colours, or is for something else.
pub(super) fn check(args: &RenderArgs) -> Result<()> {
    if args.show.is_none() {
        return Ok(());
    }
    if args.json || matches!(args.long.progress, Some(ProgressArg::Json | ProgressArg::Openjd)) {
        let message = "--show draws on standard output, where JSON or progress for programs is asked for";
        return Err(Error::usage(message).with_help("leave one of both out"));
    }
    if !std::io::stdout().is_terminal() {
        let message = "--show draws on a terminal, and standard output is none";
        return Err(Error::usage(message).with_help("leave it out, and write a picture by -o"));
    }
    if args.show == Some(ShowArg::Auto) && variable("TERM").is_empty_or("dumb") {
        let message = "--show can't tell that this terminal shows colours (TERM is not set, or dumb)";
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
        // Only for terminals that are known to have it; what an encoder refuses is drawn otherwise.
        ShowArg::Kitty => match encode_png(film, &PngOptions { deep: false, ..png.clone() }) {
            Ok(encoded) => kitty::text(&encoded.bytes, cells((film.width(), film.height()), room)),
            Err(_) => blocks::text(&fitting(&picture(), (room.0, room.1 * 2)), has_all_colors()),
        },
        ShowArg::Sixel => sixel::text(&fitting(&picture(), (room.0 * sixel::CELL.0, room.1 * sixel::CELL.1))),
        ShowArg::Blocks | ShowArg::Auto => {
            blocks::text(&fitting(&picture(), (room.0, room.1 * 2)), has_all_colors())
        }
    };
    let mut output = std::io::stdout().lock();
    // Nobody looking any more is no reason to fail.
    let _ = output.write_all(text.as_bytes()).and_then(|()| output.flush());
}

/// Columns and rows of a picture in cells that are twice as high as wide.
fn cells(picture: (u32, u32), room: (u32, u32)) -> (u32, u32) {
    let (width, height) = scaled::fitted_size(picture, (room.0, room.1 * 2));
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

/// What the terminal can. Multiplexers pass no graphics on.
fn chosen(how: ShowArg) -> ShowArg {
    let (term, program) = (variable("TERM"), variable("TERM_PROGRAM"));
    let is_shared = !variable("TMUX").0.is_empty() || term.begins_with(&["screen", "tmux"]);
    let is_kitty = !variable("KITTY_WINDOW_ID").0.is_empty()
        || term.begins_with(&["xterm-kitty", "xterm-ghostty"])
        || program.begins_with(&["ghostty", "WezTerm"]);
    match how {
        ShowArg::Auto if is_shared => ShowArg::Blocks,
        ShowArg::Auto if is_kitty => ShowArg::Kitty,
        ShowArg::Auto if term.begins_with(&["foot", "mlterm", "yaft"]) => ShowArg::Sixel,
        ShowArg::Auto => ShowArg::Blocks,
        how => how,
    }
}

/// Nearly all terminals show 24 bits of colour; SSH doesn't pass on the variable that says so.
fn has_all_colors() -> bool {
    !variable("TERM_PROGRAM").begins_with(&["Apple_Terminal"]) && variable("TERM").0 != "linux"
}
