//! Files that OBJ and MTL files name: relative to their folder, with the names of other systems forgiven.

use crate::error::Choice;
use crate::load::LoadOptions;
use std::path::{Component, Path, PathBuf};

/// The file that `name` means beside `file`: as written, with `\` for `/`, its last part alone (for paths of another
/// machine), and each of these in other capitals.
///
/// # Errors
/// Says why there is none.
pub(in crate::load) fn find(file: &Path, name: &str, options: &LoadOptions) -> Result<PathBuf, String> {
    let found = look_for(file, name, options.allow_external);
    match &found {
        Ok(path) => options.files.note(path),
        // It may come.
        Err(_) => options.files.note(file.parent().unwrap_or(Path::new("")).join(name.replace('\\', "/"))),
    }
    found
}

fn look_for(file: &Path, name: &str, allow_external: bool) -> Result<PathBuf, String> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let slashed = name.replace('\\', "/");
    let last = slashed.rsplit('/').next().unwrap_or_default();
    let mut leads_out = false;
    for wanted in [name, slashed.as_str(), last] {
        let relative = Path::new(wanted);
        if wanted.is_empty() || wanted.contains('\0') {
            continue;
        }
        if !allow_external && leaves(relative) {
            leads_out |= folder.join(relative).is_file();
            continue;
        }
        let path = folder.join(relative);
        if path.is_file() {
            return Ok(path);
        }
        if let Some(path) = in_other_capitals(&path) {
            return Ok(path);
        }
    }
    Err(if leads_out {
        format!("'{name}' leads out of the folder; permit it by {}", Choice::AllowExternal)
    } else {
        format!("'{name}' does not exist")
    })
}

/// Does a relative path climb above where it starts, or start elsewhere?
fn leaves(path: &Path) -> bool {
    let mut depth = 0i64;
    path.components().any(|part| {
        match part {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => depth = -1,
        }
        depth < 0
    })
}

/// The only file of that name if capitals don't count.
fn in_other_capitals(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?.to_lowercase();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let mut same = entries.filter(|e| e.file_name().to_str().is_some_and(|n| n.to_lowercase() == name));
    let found = same.next()?.path();
    (same.next().is_none() && found.is_file()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_systems_are_found_and_the_folder_is_not_left() {
        let outer = tempfile::tempdir().expect("a folder");
        let folder = outer.path().join("model");
        std::fs::create_dir_all(folder.join("maps")).expect("made");
        for name in ["model/a b.png", "model/maps/C.png", "secret.png", "model/back\\slash.png"] {
            std::fs::write(outer.path().join(name), "").expect("written");
        }
        let obj = folder.join("a.obj");
        let options = LoadOptions::default();
        let found = |name: &str| find(&obj, name, &options);
        let inside = |name: &str| folder.join(name);
        assert_eq!(found("a b.png"), Ok(inside("a b.png")));
        assert_eq!(found("maps\\c.PNG"), Ok(inside("maps/C.png")));
        assert_eq!(found("D:\\work\\A B.png"), Ok(inside("a b.png")));
        assert_eq!(found("back\\slash.png"), Ok(inside("back\\slash.png")));
        assert!(found("../secret.png").expect_err("outside").contains(&Choice::AllowExternal.to_string()));
        assert!(found("nothing.png").is_err() && found("").is_err());
        let options = LoadOptions { allow_external: true, ..LoadOptions::default() };
        let outside = find(&obj, "../secret.png", &options).expect("permitted");
        assert!(outside.ends_with("../secret.png"));
    }
}
