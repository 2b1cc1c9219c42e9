//! Architecture tests: modules import lower ranks only, and only certain modules print, open files or are unsafe.

use crate::source::{Source, Word, root, sources, starts, words};
use std::path::Path;

/// Modules by rank. A module may import those of lower ranks.
const RANKS: &[(u32, &[&str])] = &[
    (0, &["error", "named", "work_counter", "guide", "math", "simd", "color"]),
    (1, &["image", "sampling"]),
    (2, &["scene", "metrics"]),
    (3, &["load", "shape", "texture", "bsdf", "camera"]),
    (4, &["accel"]),
    (5, &["light"]),
    (6, &["compile", "film"]),
    (7, &["denoise", "integrator"]),
    (8, &["output"]),
    (9, &["render"]),
    (10, &["cli"]),
];

/// Allowed imports within one rank.
const WITHIN_RANK: &[(&str, &str)] = &[("compile", "film"), ("load", "shape"), ("load", "texture")];

fn rank(module: &str) -> Option<u32> {
    RANKS.iter().find(|(_, modules)| modules.contains(&module)).map(|&(rank, _)| rank)
}

/// The first folder or file under `src` that a file belongs to.
fn module(source: &Source) -> &str {
    source.module.first().map_or("", String::as_str)
}

/// Names of modules that follow `crate::` (or `oscura::` in the command line), also in braces.
fn imports(words: &[Word]) -> Vec<String> {
    let mut names = Vec::new();
    for at in 0..words.len() {
        if !starts(&words[at..], &["crate", "::"]) && !starts(&words[at..], &["oscura", "::"]) {
            continue;
        }
        match &words[at + 2..] {
            [open, group @ ..] if open.text == "{" => names.extend(top_level_names(group)),
            [name, ..] => names.push(name.text.clone()),
            [] => {}
        }
    }
    names
}

/// The first names of the entries of a brace group.
fn top_level_names(group: &[Word]) -> Vec<String> {
    let (mut depth, mut names, mut is_first) = (0, Vec::new(), true);
    for word in group {
        match word.text.as_str() {
            "{" => depth += 1,
            "}" if depth == 0 => break,
            "}" => depth -= 1,
            "," if depth == 0 => is_first = true,
            _ if depth == 0 && is_first => {
                names.push(word.text.clone());
                is_first = false;
            }
            _ => {}
        }
    }
    names
}

#[test]
fn modules_import_lower_ranks_only() {
    let mut wrong = Vec::new();
    for source in sources() {
        if source.module.is_empty() {
            continue;
        }
        let module = module(source);
        let Some(own) = rank(module) else {
            wrong.push(format!("{}: module '{module}' has no rank", source.path));
            continue;
        };
        for import in imports(&source.words) {
            let Some(other) = rank(&import) else { continue };
            let within = WITHIN_RANK.contains(&(module, import.as_str()));
            if import != module && other >= own && !within {
                wrong.push(format!("{} (rank {own}) imports {import} (rank {other})", source.path));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Fails if a file outside `allowed` contains one of these, each given as words with spaces between.
fn only(allowed: &[&str], wanted: &[&str]) {
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for source in sources() {
        let has = |text: &&&str| {
            let with: Vec<&str> = text.split(' ').collect();
            (0..source.words.len()).any(|at| starts(&source.words[at..], &with))
        };
        let found: Vec<&&str> = wanted.iter().filter(has).collect();
        if found.is_empty() {
            continue;
        }
        seen += 1;
        if !allowed.iter().any(|a| Path::new(&source.path).starts_with(a)) {
            wrong.push(format!("{}: {found:?}", source.path));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(seen > 0, "none of {wanted:?} is anywhere: is the test still right?");
}

#[test]
fn unsafe_code_lives_in_simd_only() {
    only(&["simd"], &["unsafe {", "unsafe fn", "unsafe impl", "allow ( unsafe_code )"]);
}

#[test]
fn only_the_command_line_prints() {
    only(
        &["cli"],
        &["println !", "eprintln !", "print !", "eprint !", "dbg !", "io :: stdout", "io :: stderr"],
    );
}

#[test]
fn only_load_and_output_open_files() {
    // The command line reads its own memory use from the system; textures that don't fit into memory are in a temporary file.
    only(
        &["load", "output", "cli/process.rs", "texture/store.rs"],
        &["std :: fs", "File :: open", "File :: create", "OpenOptions", "fs :: read"],
    );
}

/// Platform-dependent code is limited to certain files, which a port has to review.
#[test]
fn platform_dependent_code_is_in_few_files() {
    let words = ["cfg ( unix )", "target_os", "os :: unix", "os :: windows", "os :: linux", "libc ::"];
    only(&["simd/cache_line.rs", "output/video.rs", "texture/store.rs"], &words);
}

/// The library has no command-line options: its messages name choices abstractly (`error::Choice`).
#[test]
fn only_the_command_line_names_its_options() {
    // Options of other programs.
    let is_foreign = |text: &str| text.starts_with("features") || text.starts_with("version");
    let is_option = |text: &str| text.starts_with(|c: char| c.is_ascii_lowercase()) && !is_foreign(text);
    let names_option = |line: &&str| line.contains('"') && line.split("--").skip(1).any(is_option);
    let (mut wrong, mut seen) = (Vec::new(), 0);
    let runs_blender = "load/blender/process.rs";
    for source in sources().iter().filter(|source| source.path != runs_blender) {
        let text = std::fs::read_to_string(root().join(&source.path)).expect("a source file");
        let code = text.lines().take(source.lines).filter(|line| !line.trim_start().starts_with("//"));
        let found: Vec<&str> = code.filter(names_option).collect();
        match source.path.starts_with("cli/") {
            true => seen += found.len(),
            false => wrong.extend(found.iter().map(|line| format!("{}: {}", source.path, line.trim()))),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(seen > 10, "only {seen} options are named: is the test still right?");
}

#[test]
fn main_is_short() {
    let lines = std::fs::read_to_string(root().join("main.rs")).expect("main.rs").lines().count();
    assert!(lines <= 60, "main.rs has {lines} lines");
}

#[test]
fn brace_groups_are_parsed() {
    let text = "use crate::{film::{Film, x}, math}; crate::scene::Scene";
    assert_eq!(imports(&words(text)), ["film", "math", "scene"]);
}
