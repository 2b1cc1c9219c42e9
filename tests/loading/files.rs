//! Files in temporary folders, and damage to them.

use oscura::error::Error;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::sampling::hash::SplitMix64;
use tempfile::TempDir;

/// A folder with files; names may include folders.
pub fn folder_of(files: &[(&str, impl AsRef<[u8]>)]) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, content) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, content).expect("written");
    }
    folder
}

/// Loads the first of some files that lie in one folder.
pub fn load_files(files: &[(&str, impl AsRef<[u8]>)]) -> Result<Loaded, Error> {
    load_files_by(files, &LoadOptions::default())
}

/// The same with options.
pub fn load_files_by(files: &[(&str, impl AsRef<[u8]>)], options: &LoadOptions) -> Result<Loaded, Error> {
    load(folder_of(files).path().join(files[0].0), options)
}

/// The number of `count` damaged copies that are refused. One to three times each, bytes are replaced, inserted (some of them
/// `usual` in the format), removed or truncated; deterministic.
pub fn refused_copies(
    original: &[u8],
    usual: &[u8],
    count: usize,
    is_refused: impl Fn(&[u8]) -> bool,
) -> usize {
    let mut stream = SplitMix64::new(1);
    let mut random = |below: usize| (stream.next_bits() >> 1) as usize % below;
    let mut damaged = || {
        let mut bytes = original.to_vec();
        for _ in 0..1 + random(3) {
            let at = random(bytes.len());
            match random(6) {
                0 => bytes[at] = random(256) as u8,
                1 => bytes[at] ^= 1 << random(8),
                2 => bytes[at] = usual[random(usual.len())],
                3 => bytes.insert(at, usual[random(usual.len())]),
                4 if bytes.len() > 1 => drop(bytes.remove(at)),
                _ => bytes.truncate(at.max(1)),
            }
        }
        bytes
    };
    (0..count).filter(|_| is_refused(&damaged())).count()
}
