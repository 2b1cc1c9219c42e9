//! The argument of `--show`.

use clap::ValueEnum;

/// How pictures are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShowArg {
    /// As the terminal can, by what its variables say.
    Auto,
    /// Characters of two pixels each.
    Blocks,
    /// The protocol of kitty, which others know, too.
    Kitty,
    /// Sixel graphics.
    Sixel,
}
