//! The architecture, checked: modules import lower ranks only, and only certain modules print, open files or are unsafe.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules by rank. A module may import those of lower ranks.
const RANKS: &[(u32, &[&str])] = &[
    (0, &["error", "math", "simd", "color"]),
    (1, &["image", "sampling"]),
    (2, &["scene", "metrics"]),
    (3, &["load", "texture", "bsdf", "camera"]),
    (4, &["accel"]),
    (5, &["light"]),
    (6, &["compile", "film"]),
    (7, &["integrator"]),
    (8, &["render"]),
    (9, &["output"]),
    (10, &["cli"]),
];

/// Imports inside one rank that are meant.
const WITHIN_RANK: &[(&str, &str)] = &[("compile", "film")];

fn rank(module: &str) -> Option<u32> {
    RANKS.iter().find(|(_, modules)| modules.contains(&module)).map(|&(rank, _)| rank)
}

struct Source {
    path: PathBuf,
    /// The first folder or file under `src`.
    module: String,
    /// Without comments, and without the unit tests at the end of the file.
    code: String,
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut list = Vec::new();
    collect(&root, &root, &mut list);
    assert!(list.len() > 20, "found only {} source files under {}", list.len(), root.display());
    list
}

fn collect(root: &Path, folder: &Path, list: &mut Vec<Source>) {
    for entry in fs::read_dir(folder).expect("src can be read") {
        let path = entry.expect("an entry of src").path();
        if path.is_dir() {
            collect(root, &path, list);
        } else if path.extension().is_some_and(|e| e == "rs") && !is_test_file(&path) {
            let text = fs::read_to_string(&path).expect("a source file is UTF-8");
            let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            let uncommented = |l: &str| l.split("//").next().unwrap_or_default().to_string();
            let code = text.lines().map(uncommented).collect::<Vec<_>>().join("\n");
            let inside = path.strip_prefix(root).expect("under src");
            let first = inside.iter().next().expect("a name").to_string_lossy();
            list.push(Source { module: first.trim_end_matches(".rs").to_string(), path, code });
        }
    }
}

/// Is it a `tests.rs` that the module file beside it includes for tests only?
fn is_test_file(path: &Path) -> bool {
    if path.file_name().is_none_or(|name| name != "tests.rs") {
        return false;
    }
    let parent = path.with_file_name("mod.rs");
    let declared = fs::read_to_string(&parent).unwrap_or_default().contains("#[cfg(test)]\nmod tests;");
    assert!(declared, "{}: not declared as '#[cfg(test)] mod tests;'", path.display());
    declared
}

/// Names of modules that follow `crate::` (or `oscura::` in the command line), also in braces.
fn imports(source: &Source) -> Vec<String> {
    let mut names = Vec::new();
    for start in ["crate::", "oscura::"] {
        for (at, _) in source.code.match_indices(start) {
            let rest = &source.code[at + start.len()..];
            let word =
                |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
            match rest.strip_prefix('{') {
                Some(group) => names.extend(top_level_names(group).iter().map(|n| word(n))),
                None => names.push(word(rest)),
            }
        }
    }
    names
}

/// The comma-separated entries of a brace group, nested groups left out.
fn top_level_names(group: &str) -> Vec<String> {
    let (mut depth, mut names) = (0, vec![String::new()]);
    for c in group.chars() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => names.push(String::new()),
            c if depth == 0 && !c.is_whitespace() => names.last_mut().expect("one at least").push(c),
            _ => {}
        }
    }
    names
}

#[test]
fn modules_import_lower_ranks_only() {
    let mut wrong = Vec::new();
    for source in sources() {
        if source.module == "lib" || source.module == "main" {
            continue;
        }
        let Some(own) = rank(&source.module) else {
            wrong.push(format!("{}: module '{}' has no rank", source.path.display(), source.module));
            continue;
        };
        for import in imports(&source) {
            let Some(other) = rank(&import) else { continue };
            let within = WITHIN_RANK.contains(&(source.module.as_str(), import.as_str()));
            if import != source.module && other >= own && !within {
                wrong.push(format!("{} (rank {own}) imports {import} (rank {other})", source.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Fails if a file outside `allowed` contains one of the words.
fn only(allowed: &[&str], words: &[&str]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    let mut seen = 0;
    for source in sources() {
        let found: Vec<&&str> = words.iter().filter(|w| source.code.contains(**w)).collect();
        if found.is_empty() {
            continue;
        }
        seen += 1;
        if !allowed.iter().any(|a| source.path.starts_with(root.join(a))) {
            wrong.push(format!("{}: {found:?}", source.path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(seen > 0, "none of {words:?} is anywhere: is the test still right?");
}

#[test]
fn unsafe_code_lives_in_simd_only() {
    only(&["simd"], &["unsafe {", "unsafe fn", "unsafe impl", "allow(unsafe_code)"]);
}

#[test]
fn only_the_command_line_prints() {
    only(&["cli"], &["println!", "eprintln!", "print!(", "eprint!(", "dbg!(", "io::stdout", "io::stderr"]);
}

#[test]
fn only_load_and_output_open_files() {
    // The command line reads its own memory use from the system.
    only(
        &["load", "output", "cli/process.rs"],
        &["std::fs", "File::open", "File::create", "OpenOptions", "fs::read"],
    );
}

#[test]
fn main_is_a_door() {
    let main = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/main.rs");
    let lines = fs::read_to_string(main).expect("main.rs").lines().count();
    assert!(lines <= 60, "main.rs has {lines} lines");
}

#[test]
fn brace_groups_are_understood() {
    let source = Source {
        path: PathBuf::new(),
        module: String::new(),
        code: "use crate::{film::{Film, x}, math}; crate::scene::Scene".into(),
    };
    assert_eq!(imports(&source), ["film", "math", "scene"]);
}
