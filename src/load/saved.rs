//! Which files a scene may be made of, and when they were saved.

use super::is_named_as_scene;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Folders below the scene's that are looked into, and most files.
const DEPTH: u32 = 3;
const MOST_FILES: usize = 10_000;

/// What scenes are made of besides scenes.
const PARTS: [&str; 13] =
    ["bin", "mtl", "png", "jpg", "jpeg", "hdr", "exr", "ktx2", "webp", "tga", "bmp", "tif", "tiff"];

/// The files that a scene may be made of, with their sizes and when they were saved: equal as long as none was saved again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SavedFiles(BTreeMap<PathBuf, (Option<SystemTime>, u64)>);

impl SavedFiles {
    /// Those in the scene's folder, and below it, that may belong to it, and those that a scene file names.
    pub fn of(scene: impl AsRef<Path>) -> SavedFiles {
        let scene = scene.as_ref();
        let folder = scene.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut files = SavedFiles::default();
        files.add_folder(folder, DEPTH);
        for named in named_in(scene) {
            let path = folder.join(named);
            files.add(&path);
        }
        files.add(scene);
        files
    }

    fn add(&mut self, path: &Path) {
        if let Ok(data) = path.metadata()
            && data.is_file()
            && self.0.len() < MOST_FILES
        {
            self.0.insert(path.to_path_buf(), (data.modified().ok(), data.len()));
        }
    }

    fn add_folder(&mut self, folder: &Path, depth: u32) {
        for entry in folder.read_dir().into_iter().flatten().flatten() {
            let path = entry.path();
            if self.0.len() >= MOST_FILES || entry.file_name().to_string_lossy().starts_with('.') {
                continue;
            }
            match entry.file_type() {
                Ok(kind) if kind.is_dir() && depth > 0 => self.add_folder(&path, depth - 1),
                Ok(kind) if !kind.is_dir() && is_part(&path) => self.add(&path),
                _ => {}
            }
        }
    }
}

fn is_part(path: &Path) -> bool {
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    is_named_as_scene(path) || PARTS.contains(&extension.as_str())
}

/// What a scene file names that may be a file: the strings in quotation marks that end as one does.
fn named_in(scene: &Path) -> Vec<String> {
    let is_text =
        scene.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml") || e.eq_ignore_ascii_case("gltf"));
    let text = if is_text { std::fs::read_to_string(scene).unwrap_or_default() } else { String::new() };
    let strings = text.split('"').filter(|word| word.len() < 1000 && !word.contains('\n'));
    strings.filter(|word| is_part(Path::new(word))).map(str::to_string).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saved_files_are_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let model = folder.path().join("part.obj");
        let scene = folder.path().join("scenes/a.toml");
        std::fs::create_dir(folder.path().join("scenes")).unwrap();
        std::fs::write(&model, "v 0 0 0").unwrap();
        std::fs::write(&scene, "[[objects]]\nfile = \"../part.obj\"\n").unwrap();
        let before = SavedFiles::of(&scene);
        assert_eq!(before.0.len(), 2);
        assert_eq!(SavedFiles::of(&scene), before);
        std::fs::write(&model, "v 0 0 0\nv 1 0 0").unwrap();
        assert_ne!(SavedFiles::of(&scene), before);
        let before = SavedFiles::of(&scene);
        std::fs::write(folder.path().join("scenes/picture.txt"), "no part").unwrap();
        assert_eq!(SavedFiles::of(&scene), before);
    }
}
