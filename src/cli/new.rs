//! `oscura new`: a commented scene to start from, or settings for a model ([`beside`]).

use super::args::NewArgs;
use super::{Outcome, beside};
use oscura::error::{Error, Result};
use oscura::output::{check_target, write_atomically};

/// The scene that is written.
const STARTER: &str = include_str!("starter.toml");

pub(crate) fn run(args: &NewArgs) -> Result<Outcome> {
    let path = match (&args.beside, &args.scene) {
        (Some(model), _) => return beside::run(model, args),
        (None, Some(path)) => path,
        (None, None) => return Err(Error::usage("name the file to write")),
    };
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("toml")) {
        return Err(Error::usage(format!("{}: scene files end in .toml", path.display())));
    }
    if path.exists() && !args.force {
        let message = format!("{} exists already", path.display());
        return Err(Error::usage(message).with_help("choose another name, or replace it by --force"));
    }
    check_target(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    write_atomically(path, STARTER.replace("THIS-FILE.toml", &name).as_bytes())?;
    if !args.quiet {
        say!("wrote    {}", path.display());
        say!("next     oscura render {0} -o {1}.png", path.display(), name.trim_end_matches(".toml"));
    }
    Ok(Outcome::Done)
}
