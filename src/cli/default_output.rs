//! Pictures whose names nobody gave: `scan.png` of `oscura scan.ply`, `scan.thumb.png` of `oscura thumb scan.ply`. Each holds a
//! mark of the command and the scene that it was made of, and only a picture with the same mark is replaced.

use oscura::error::{Error, Result};
use oscura::output::{is_same_target, png_text, with_png_text};
use std::path::{Path, PathBuf};

/// Keyword of the mark among a PNG's texts.
const KEYWORD: &str = "oscura";

/// The mark of a command's picture of a scene: the command, the scene's name, and a hash of where it lies, as scenes of one name
/// may lie in several folders.
pub(super) fn mark(command: &str, scene: &Path) -> String {
    let whole = scene.canonicalize().unwrap_or_else(|_| scene.to_path_buf());
    // PNG's texts are Latin-1.
    let name = scene.file_name().unwrap_or_default().to_string_lossy().replace(|c: char| !c.is_ascii(), "?");
    format!("{command} {name} {:016x}", fnv1a(whole.as_os_str().as_encoded_bytes()))
}

/// FNV-1a of 64 bits (Fowler, Noll, Vo).
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}

/// A PNG with a mark.
pub(super) fn marked(png: Vec<u8>, mark: &str) -> Vec<u8> {
    with_png_text(png, KEYWORD, mark)
}

/// Refuses to replace a file without this mark; `remedy` says what else to do.
///
/// # Errors
/// A usage error.
pub(super) fn check(target: &Path, mark: &str, remedy: &str) -> Result<()> {
    if !target.exists() || png_text(target, KEYWORD).as_deref() == Some(mark) {
        return Ok(());
    }
    let message = format!("{} exists, and this command did not write it", target.display());
    Err(Error::usage(message).with_help(remedy))
}

/// Refuses a picture that would replace its scene or a file that the scene is made of, such as a texture of its name. A texture that is
/// missing counts as well: the picture would become it.
///
/// # Errors
/// A usage error.
pub(super) fn refuse_part(scene: &Path, target: &Path, parts: &[PathBuf], remedy: &str) -> Result<()> {
    if !parts.iter().any(|part| is_same_target(part, target)) {
        return Ok(());
    }
    let scene = scene.display();
    let message = format!("the picture would be {}, which {scene} is made of", target.display());
    Err(Error::usage(message).with_help(remedy))
}
