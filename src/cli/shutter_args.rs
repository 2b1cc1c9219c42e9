//! Arguments about motion blur.

use super::named::named;
use super::numbers::number;
use clap::Args;
use clap::builder::TypedValueParser;
use oscura::load::{LONGEST_SHUTTER, ShutterOptions, ShutterPosition};

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Motion blur")]
pub(crate) struct ShutterArgs {
    /// How long the shutter is open, in frames: what moves in that time is blurred [default: the scene's, else 0].
    #[arg(long, value_name = "FRAMES", value_parser = frames, allow_negative_numbers = true)]
    pub shutter: Option<f64>,
    /// When it is open: from the picture's moment on (start), around it (centre) or up to it (end) [default: the scene's, else
    /// centre].
    #[arg(long, value_name = "WHEN", value_parser = position(), hide_possible_values = true)]
    pub shutter_position: Option<ShutterPosition>,
    /// At how many moments of that time to look at what moves, 2 or more [default: as many as its paths need, at most 65].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1000), allow_negative_numbers = true)]
    pub motion_keys: Option<u32>,
}

impl ShutterArgs {
    /// The choices, at so many frames a second; with what motion vectors need, if they are asked for.
    pub fn options(&self, fps: f64, vectors: bool) -> ShutterOptions {
        let ShutterArgs { shutter, shutter_position, motion_keys } = *self;
        ShutterOptions { frames: shutter, position: shutter_position, fps, keys: motion_keys, vectors }
    }
}

fn frames(text: &str) -> Result<f64, String> {
    number(text, |v| (0.0..=LONGEST_SHUTTER).contains(&v), "a number of frames from 0 to 1000")
}

fn position() -> impl TypedValueParser<Value = ShutterPosition> {
    named(&ShutterPosition::ALL, |(name, _)| name, |_| "").map(|(_, position)| position)
}
