//! Loader, being written.

use super::{LoadOptions, Loaded};
use crate::error::{Error, Result};
use std::path::Path;

pub(super) fn load(path: &Path, _options: &LoadOptions) -> Result<Loaded> {
    Err(Error::input(path, "not written yet"))
}
