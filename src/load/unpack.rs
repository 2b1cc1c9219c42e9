//! Models inside ZIP archives: unpacked to a temporary folder, which exists as long as images may be decoded from it.

use super::zip::{Archive, MAX_BYTES};
use super::{Loaded, files, formats};
use crate::error::{Error, Result, Warning};
use crate::image::{Damage, Encoded, Image, ImageSource, Pixels};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// The contents of an archive in a temporary folder, which is deleted with the last reference.
#[derive(Debug)]
pub(super) struct Unpacked {
    folder: Arc<TempDir>,
    /// Path of the model in the folder.
    pub model: PathBuf,
}

/// Maximum number of names in a message.
const MAX_NAMES: usize = 3;

impl Unpacked {
    /// Unpacks an archive and picks its model: by the rank of its format (glTF first), then by the depth of its path.
    ///
    /// # Errors
    /// An input error if the archive is damaged, protected, or holds no model.
    pub fn new(path: &Path) -> Result<Unpacked> {
        let fail = |message: String| Error::input(path, message);
        let archive = Archive::open(path)?;
        let folder = tempfile::Builder::new()
            .prefix(".oscura-")
            .tempdir()
            .map_err(|e| fail(format!("can't be unpacked: {e}")))?;
        let (mut total, mut models) = (0, Vec::new());
        for entry in archive.entries().iter().filter(|e| !e.name.ends_with('/')) {
            let relative = entry.name.replace('\\', "/");
            if relative.is_empty() || files::leads_outside(Path::new(&relative)) {
                let message = format!("holds a file with a path outside the archive: '{}'", entry.name);
                return Err(fail(message).with_code("path-outside"));
            }
            let data = archive
                .data(entry, MAX_BYTES - total)
                .map_err(|why| fail(format!("'{}' {why}", entry.name)))?;
            total += data.len() as u64;
            let target = folder.path().join(&relative);
            let made = target.parent().map_or(Ok(()), std::fs::create_dir_all);
            made.and_then(|()| std::fs::write(&target, data))
                .map_err(|e| fail(format!("can't be unpacked: {e}")))?;
            if let Some(rank) = formats::rank_in_archives(Path::new(&relative)) {
                models.push((rank, relative.matches('/').count(), relative));
            }
        }
        models.sort();
        let Some((.., model)) = models.first() else {
            let names = archive.entries().iter().map(|entry| &entry.name).filter(|name| !name.ends_with('/'));
            let names: Vec<String> = names.take(MAX_NAMES).map(|name| format!("'{name}'")).collect();
            let models = formats::models_in_words();
            let help = match names.is_empty() {
                true => "it is empty".to_string(),
                false => format!("it should hold one of {models}, and holds {}", names.join(", ")),
            };
            return Err(fail("is an archive without a model".into())
                .with_help(help)
                .with_code("zip-without-model"));
        };
        Ok(Unpacked { model: folder.path().join(model), folder: Arc::new(folder) })
    }

    /// Whether a file belongs to the archive.
    pub fn contains(&self, file: Option<&PathBuf>) -> bool {
        file.is_some_and(|file| file.starts_with(self.folder.path()))
    }

    /// Keeps the folder while the scene has images that are not decoded yet.
    pub fn keep_for(&self, loaded: &mut Loaded) {
        keep_for(&self.folder, loaded);
    }
}

/// Keeps a folder while a scene has images that are not decoded yet.
pub(super) fn keep_for(folder: &Arc<TempDir>, loaded: &mut Loaded) {
    for image in &mut loaded.scene.images {
        if let Pixels::Encoded(encoded) = &*image.pixels {
            let source = Arc::new(TemporaryImage { source: encoded.source.clone(), _folder: folder.clone() });
            image.pixels = Arc::new(Pixels::Encoded(Encoded { source, ..encoded.clone() }));
        }
    }
}

/// An image file in a temporary folder, with a reference that keeps the folder.
#[derive(Debug)]
struct TemporaryImage {
    source: Arc<dyn ImageSource>,
    _folder: Arc<TempDir>,
}

impl ImageSource for TemporaryImage {
    fn decode(&self, warnings: &mut Vec<Warning>) -> std::result::Result<Image, Damage> {
        self.source.decode(warnings)
    }

    fn bytes_by_rows(&self) -> Option<usize> {
        self.source.bytes_by_rows()
    }

    fn decode_rows(
        &self,
        in_parallel: bool,
        warnings: &mut Vec<Warning>,
        take: &mut dyn FnMut(&[f32]),
    ) -> std::result::Result<(), Damage> {
        self.source.decode_rows(in_parallel, warnings, take)
    }

    fn with_bytes(&self, take: &mut dyn FnMut(&[u8])) {
        self.source.with_bytes(take);
    }
}
