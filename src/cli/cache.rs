//! `oscura cache`: what is kept of Blender files for the next time.

use super::Outcome;
use super::args::CacheArgs;
use super::report::print_line;
use oscura::error::{Error, Result};
use oscura::load::blender::cache::{clear, kept};
use oscura::load::blender::default_cache;

pub(crate) fn run(args: &CacheArgs) -> Result<Outcome> {
    let Some(folder) = args.folder.clone().or_else(default_cache) else {
        let error = Error::usage("this system names no folder for caches: nothing is kept");
        return Err(error.with_help("name a folder by --cache"));
    };
    let (found, verb) = match args.clear {
        true => (clear(&folder)?, "deleted"),
        false => (kept(&folder)?, "kept"),
    };
    let mib = found.bytes as f64 / f64::from(1 << 20);
    print_line(&format!("{}: {} files of {mib:.1} MiB {verb}", folder.display(), found.files));
    Ok(Outcome::Done)
}
