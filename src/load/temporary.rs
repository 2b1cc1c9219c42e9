//! Temporary folders that scenes are read from: they stay for as long as images may be decoded from them.

use super::Loaded;
use crate::error::Warning;
use crate::image::{Damage, Encoded, Image, ImageSource, Pixels};
use std::sync::Arc;
use tempfile::TempDir;

/// Keeps a folder for as long as a scene has images that are still encoded.
pub(super) fn keep_for(folder: &Arc<TempDir>, loaded: &mut Loaded) {
    for image in &mut loaded.scene.images {
        if let Pixels::Encoded(encoded) = &*image.pixels {
            let source = Arc::new(Kept { source: encoded.source.clone(), _folder: folder.clone() });
            image.pixels = Arc::new(Pixels::Encoded(Encoded { source, ..encoded.clone() }));
        }
    }
}

/// An image whose file is in a temporary folder.
#[derive(Debug)]
struct Kept {
    source: Arc<dyn ImageSource>,
    _folder: Arc<TempDir>,
}

impl ImageSource for Kept {
    fn decode(&self, warnings: &mut Vec<Warning>) -> Result<Image, Damage> {
        self.source.decode(warnings)
    }

    fn with_bytes(&self, take: &mut dyn FnMut(&[u8])) {
        self.source.with_bytes(take);
    }
}
