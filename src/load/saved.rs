//! Which files a scene was made of, and when they were saved.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::SystemTime;

/// When a file was saved and its bytes; `None` for one that isn't there.
type Stamp = Option<(Option<SystemTime>, u64)>;

/// The files that loading has read or looked for in vain. Clones are the same list.
#[derive(Clone, Debug, Default)]
pub struct SavedFiles(Arc<Mutex<BTreeMap<PathBuf, Stamp>>>);

impl SavedFiles {
    /// Notes a file as it is now, before it is read.
    pub fn note(&self, path: impl AsRef<Path>) {
        let path = path.as_ref();
        self.lock().entry(path.to_path_buf()).or_insert_with(|| stamp(path));
    }

    /// Was any of them saved, removed or made since it was noted or this was asked?
    pub fn have_changed(&self) -> bool {
        let mut has_any = false;
        for (path, known) in self.lock().iter_mut() {
            let now = stamp(path);
            has_any |= now != *known;
            *known = now;
        }
        has_any
    }

    /// Takes the files of a newer load: all in place of these, or, where that failed, besides these.
    pub fn take_over(&self, newer: &SavedFiles, has_failed: bool) {
        let newer = newer.lock().clone();
        let mut own = self.lock();
        if !has_failed {
            own.clear();
        }
        own.extend(newer);
    }

    /// Their paths.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.lock().keys().cloned().collect()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Stamp>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

fn stamp(path: &Path) -> Stamp {
    let data = path.metadata().ok()?;
    Some((data.modified().ok(), data.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::{LoadOptions, load};
    use std::fs;

    /// A grid of one voxel.
    fn grid() -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        [1u32, 1, 1, 1, 1].iter().for_each(|n| bytes.extend(n.to_le_bytes()));
        [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0, 0.5].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes
    }

    #[test]
    fn what_a_scene_is_made_of_is_watched_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        fs::create_dir(file("scenes")).unwrap();
        fs::write(file("part.obj"), "mtllib part.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        fs::write(file("smoke.vol"), grid()).unwrap();
        let scene = file("scenes/a.toml");
        let text = "[materials.smoke]\ntype = \"dielectric\"\nmedium = { density = 1.0, grid = \"../smoke.vol\" }\n\
                    [[objects]]\nmesh = \"../part.obj\"\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\n\
                    material = \"smoke\"\n";
        fs::write(&scene, text).unwrap();
        let options = LoadOptions::default();
        load(&scene, &options).unwrap();
        let files = &options.files;
        let read = files.paths();
        for name in ["a.toml", "../part.obj", "../part.mtl", "../smoke.vol"] {
            assert!(read.contains(&file("scenes").join(name)), "{name}: {read:?}");
        }
        assert!(!files.have_changed());
        for other in ["picture.png", "scenes/b.toml", "scenes/c.exr"] {
            fs::write(file(other), "no part").unwrap();
        }
        assert!(!files.have_changed(), "files that the scene isn't made of");
        for (name, text) in [("smoke.vol", ""), ("part.mtl", "newmtl a\n"), ("part.obj", "v 0 0 0")] {
            fs::write(file(name), text).unwrap();
            assert!(files.have_changed() && !files.have_changed(), "{name} was saved");
        }
        fs::remove_file(scene).unwrap();
        assert!(files.have_changed());
    }

    #[test]
    fn a_load_that_failed_is_watched_besides() {
        let (own, newer) = (SavedFiles::default(), SavedFiles::default());
        own.note("a");
        newer.note("b");
        own.take_over(&newer, true);
        assert_eq!(own.paths().len(), 2);
        own.take_over(&newer, false);
        assert_eq!(own.paths(), [PathBuf::from("b")]);
    }
}
