//! The scene file reference against the parser: each key of the parser is documented, and each documented key exists.

mod keys;
mod tables;

use crate::files::load_files;
use oscura::load::scene_file::{CHAPTERS, Chapter};
use std::collections::BTreeSet;
use std::path::Path;

/// An unknown key that resembles no other.
const WRONG: &str = "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx";

/// All messages and hints about a scene file.
fn complaints(text: &str) -> Vec<(String, String)> {
    let error = load_files(&[("scene.toml", text)]).expect_err("the scene has a wrong key");
    error.problems.into_iter().map(|p| (p.message, p.help.unwrap_or_default())).collect()
}

fn list_after(help: &str, words: &str) -> Option<BTreeSet<String>> {
    Some(help.strip_prefix(words)?.split(", ").map(str::to_string).collect())
}

/// The keys that the parser lists for an unknown key.
fn known_keys(text: &str) -> BTreeSet<String> {
    assert!(text.contains(WRONG));
    let found = complaints(text);
    let keys = found
        .iter()
        .filter(|(message, _)| message.contains(WRONG))
        .find_map(|(_, help)| list_after(help, "known keys: "));
    keys.unwrap_or_else(|| panic!("{text}\n{found:?}"))
}

/// The types of a texture or material that the parser lists.
fn known_types(part: &str) -> BTreeSet<String> {
    let found = complaints(&format!("[{part}.a]\ntype = \"{WRONG}\"\n[[objects]]\n"));
    found.iter().find_map(|(_, help)| list_after(help, "one of: ")).unwrap_or_else(|| panic!("{found:?}"))
}

/// Words in inline code, split at characters that no key contains.
fn code_words(markdown: &str) -> BTreeSet<String> {
    let code = markdown.split('`').skip(1).step_by(2);
    let words = code.flat_map(|c| c.split(|c: char| !(c.is_alphanumeric() || "_-".contains(c))));
    words.filter(|w| !w.is_empty()).map(str::to_string).collect()
}

/// The words in inline code of the first column of tables with the header `head`.
fn first_column(markdown: &str, head: &str) -> BTreeSet<String> {
    let mut words = BTreeSet::new();
    let mut is_inside = false;
    for line in markdown.lines() {
        let cell = line.strip_prefix('|').and_then(|l| l.split(" |").next()).map(str::trim);
        match cell {
            None => is_inside = false,
            Some(cell) if cell == head || cell == format!("`{head}`") => is_inside = true,
            Some(cell) if is_inside => words.extend(code_words(cell)),
            Some(_) => {}
        }
    }
    words
}

fn chapter(name: &str) -> String {
    Chapter::find(name).unwrap_or_else(|| panic!("no chapter {name}")).markdown()
}

fn assert_documented(keys: &BTreeSet<String>, chapter_name: &str, about: &str) {
    let words = code_words(&chapter(chapter_name));
    let missing: Vec<_> = keys.difference(&words).collect();
    assert!(missing.is_empty(), "'{chapter_name}' doesn't explain {missing:?} of {about}");
}

#[test]
fn all_sections_and_keys_are_documented() {
    let parts = known_keys(&format!("{WRONG} = 1\n[[objects]]\n"));
    assert!(parts.contains("camera") && parts.contains("objects"), "{parts:?}");
    for part in &parts {
        assert!(Chapter::find(part).is_some(), "no chapter on '{part}'");
    }
    // The lens is read with a placed camera only, and each projection has its own keys.
    let placed = |projection: &str| format!("look_from = [0, 0, 1]\nlook_at = [0, 0, 0]\n{projection}");
    let panorama = |kind: &str| placed(&format!("type = \"panorama\"\nprojection = \"{kind}\"\n"));
    let cameras = [placed(""), placed("type = \"orthographic\"\n")]
        .into_iter()
        .chain(["equirectangular", "fisheye_equidistant", "fisheye_equisolid"].map(panorama));
    let plain = || vec![String::new()];
    for (part, heads) in [("camera", cameras.collect()), ("environment", plain()), ("render", plain())] {
        let of_head = |head: &String| known_keys(&format!("[{part}]\n{head}{WRONG} = 1\n[[objects]]\n"));
        let keys: BTreeSet<String> = heads.iter().flat_map(of_head).collect();
        assert_documented(&keys, part, part);
        let listed = first_column(&chapter(part), "Key");
        let unknown: Vec<_> = listed.difference(&keys).collect();
        assert!(unknown.is_empty(), "'{part}' explains {unknown:?}, which the parser doesn't know: {keys:?}");
    }
}

#[test]
fn all_texture_and_material_types_are_documented() {
    for part in ["textures", "materials"] {
        let types = known_types(part);
        assert!(types.len() >= 5, "{types:?}");
        assert_documented(&types, part, "types");
        let listed = first_column(&chapter(part), "type");
        assert_eq!(listed, types, "types in the table of '{part}'");
        for kind in &types {
            let scene = format!("[{part}.a]\ntype = \"{kind}\"\n{WRONG} = 1\n[[objects]]\n");
            assert_documented(&known_keys(&scene), part, kind);
        }
    }
}

#[test]
fn objects_and_transforms_are_documented() {
    let object = known_keys(&format!("[[objects]]\n{WRONG} = 1\nmaterials = []\n"));
    assert_documented(&object, "objects", "an object");
    for shape in ["sphere", "quad", "box", "pyramid"] {
        assert!(object.contains(shape), "{object:?}");
        let scene = format!(
            "[materials]\na = {{ type = \"lambert\" }}\n[[objects]]\n{shape} = {{ {WRONG} = 1 }}\nmaterial = \"a\"\n"
        );
        assert_documented(&known_keys(&scene), "objects", shape);
    }
    let shapes = first_column(&chapter("objects"), "Shape");
    assert!(shapes.is_subset(&object), "{shapes:?} {object:?}");
    let light = known_keys(&format!("[[lights]]\n{WRONG} = 1\npoint = {{}}\n[[objects]]\n"));
    assert_documented(&light, "lights", "a light");
    let portal = known_keys(&format!("[[portals]]\n{WRONG} = 1\n[[objects]]\n"));
    assert_documented(&portal, "portals", "a portal");
    let curves = known_keys(&format!("[[curves]]\n{WRONG} = 1\n[[objects]]\n"));
    assert_documented(&curves, "curves", "curves");
    assert!(first_column(&chapter("curves"), "Key").is_subset(&curves), "{curves:?}");
    for shape in first_column(&chapter("lights"), "Shape") {
        assert!(light.contains(&shape), "{shape} {light:?}");
        let scene = format!("[[lights]]\n{shape} = {{ {WRONG} = 1 }}\n[[objects]]\n");
        assert_documented(&known_keys(&scene), "lights", &shape);
    }
    let step = known_keys(&format!("[[objects]]\ntransform = [{{ {WRONG} = 1 }}]\n"));
    assert_documented(&step, "transform", "a step");
    for (about, motion) in [
        ("a motion", format!("{WRONG} = 1, translate = [1, 0, 0]")),
        ("a rotation", format!("rotate = {{ {WRONG} = 1 }}")),
        ("a key", format!("keys = [{{ {WRONG} = 1 }}]")),
    ] {
        let known = known_keys(&format!("[[objects]]\nmotion = {{ {motion} }}"));
        assert_documented(&known, "motion", about);
    }
}

#[test]
fn media_are_documented() {
    let object = "[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n";
    let fog = known_keys(&format!(
        "[environment]\nfog = {{ {WRONG} = 1 }}\n[materials]\na = {{ type = \"lambert\" }}\n{object}"
    ));
    assert_documented(&fog, "media", "fog");
    for (key, head) in [("medium", "Medium"), ("subsurface", "Subsurface")] {
        let text =
            format!("[materials.a]\ntype = \"pbr\"\nvolume = true\n{key} = {{ {WRONG} = 1 }}\n{object}");
        assert_eq!(known_keys(&text), first_column(&chapter("media"), head), "{key}");
    }
}

/// Every row of a table in a module's documentation is part of a chapter.
#[test]
fn every_module_with_a_table_has_a_chapter() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/load/scene_file");
    let chapters: Vec<String> = CHAPTERS.iter().map(Chapter::markdown).collect();
    for entry in std::fs::read_dir(folder).expect("the parser's folder") {
        let path = entry.expect("an entry").path();
        let Ok(source) = std::fs::read_to_string(&path) else { continue };
        let rows = source.lines().filter_map(|l| l.strip_prefix("//! ")).filter(|l| l.starts_with("| `"));
        for row in rows {
            assert!(chapters.iter().any(|c| c.contains(row)), "{}: {row} is in no chapter", path.display());
        }
    }
}
