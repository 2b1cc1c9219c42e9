//! Shared by all targets: bytes are written to files, which are loaded and compiled as by the command line.

use oscura::compile::{CompileOptions, compile};
use oscura::film::Film;
use oscura::load::{LoadOptions, load};
use oscura::output::part::{PartFile, PartHeader, check_parts, read_part};
use oscura::output::{ExrOptions, Metadata, encode_exr};
use oscura::scene::CatcherOutput;
use std::cell::OnceCell;
use std::path::Path;
use tempfile::TempDir;

/// Pixels of the largest picture that a part is merged into.
const MAX_PIXELS: u64 = 1 << 14;

thread_local! {
    static FOLDER: OnceCell<TempDir> = const { OnceCell::new() };
}

/// Writes files into a folder and loads the first. Errors must have a message; a scene must be consistent, and compiling it must
/// not panic.
pub fn check(files: &[(&str, &[u8])]) {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| memory_folder().expect("a temporary folder"));
        for (name, bytes) in files {
            std::fs::write(folder.path().join(name), bytes).expect("written");
        }
        load_and_compile(&folder.path().join(files[0].0));
    });
}

/// Reads bytes as a partial render, once unchanged and once with a valid checksum.
pub fn check_part(bytes: &[u8]) {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| memory_folder().expect("a temporary folder"));
        let file = folder.path().join("a.part");
        let summed = [bytes, &crc32fast::hash(bytes).to_le_bytes()].concat();
        for bytes in [bytes, &summed] {
            std::fs::write(&file, bytes).expect("written");
            match read_part(&file) {
                Err(error) => {
                    assert!(error.problems.iter().all(|p| !p.message.is_empty()), "a problem without words")
                }
                Ok(part) => {
                    assert!(part.film.planes().count() >= 4, "a film without colour");
                    let _ = check_parts(&[(file.clone(), part.header.clone())]);
                    merge_and_encode(part);
                }
            }
        }
    });
}

/// Merges a single part into a picture, unless it is large.
fn merge_and_encode(part: PartFile) {
    let PartHeader { width, height, .. } = part.header;
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return;
    }
    let layout = part.header.channels.layout().expect("it has been read");
    let Ok(mut film) = Film::of_layout(width, height, layout) else { return };
    film.merge_film(&part.film);
    film.resolve_catchers(CatcherOutput::All);
    part.backdrop.iter().for_each(|backdrop| film.composite_over(backdrop));
    let encoded = encode_exr(&film, false, &ExrOptions::default(), &Metadata::default());
    assert!(encoded.is_ok_and(|encoded| !encoded.bytes.is_empty()), "a picture that can't be encoded");
}

/// A folder on a RAM disk where available: thousands of files per second are written.
fn memory_folder() -> std::io::Result<TempDir> {
    let shared_memory = Path::new("/dev/shm");
    if shared_memory.is_dir() { TempDir::new_in(shared_memory) } else { TempDir::new() }
}

fn load_and_compile(path: &Path) {
    let options = LoadOptions { point_radius: Some(0.01), ..LoadOptions::default() };
    match load(path, &options) {
        Err(error) => {
            assert!(!error.problems.is_empty(), "an error without a problem");
            assert!(error.problems.iter().all(|p| !p.message.is_empty()), "a problem without words");
        }
        Ok(loaded) => {
            assert_eq!(loaded.scene.validate(), [], "the scene is inconsistent");
            // A scene may be refused here, with reasons.
            let _ = compile(&loaded.scene, &CompileOptions::default());
        }
    }
}

/// The text before a separator, and the text after it (empty without one).
pub fn split<'a>(bytes: &'a [u8], separator: &[u8]) -> (&'a [u8], &'a [u8]) {
    match bytes.windows(separator.len()).position(|w| w == separator) {
        Some(at) => (&bytes[..at], &bytes[at + separator.len()..]),
        None => (bytes, &[]),
    }
}

/// A ZIP archive that stores one file.
pub fn stored(name: &str, content: &[u8]) -> Vec<u8> {
    let size = (content.len() as u32).to_le_bytes();
    let common =
        [&[20, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &crc32fast::hash(content).to_le_bytes(), &size, &size]
            .concat();
    let length = (name.len() as u16).to_le_bytes();
    let mut archive = [&b"PK\x03\x04"[..], &common, &length, &[0; 2], name.as_bytes(), content].concat();
    let at = (archive.len() as u32).to_le_bytes();
    let entry = [&b"PK\x01\x02\x14\0"[..], &common, &length, &[0; 16], name.as_bytes()].concat();
    archive.extend(&entry);
    archive.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    archive.extend((entry.len() as u32).to_le_bytes());
    archive.extend(at);
    archive.extend([0, 0]);
    archive
}
