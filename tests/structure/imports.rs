//! No import cycles between files.
//!
//! A file imports another where it names an item that the other defines: in a `use` or by a path. Names that a file only re-
//! exports (`pub use` without a use of its own) create no dependency, and whoever uses such a name depends on the file that
//! defines it. Declaring a module is no dependency.

use crate::source::{Source, Word, parse, sources, starts};
use std::collections::{BTreeMap, BTreeSet};

/// Known cycles to be removed, by one of their files. Don't add new ones.
const KNOWN: &[&str] = &[];

/// Names joined by `::`.
type Path = Vec<String>;

/// What a file declares and imports.
struct Names {
    /// Modules that it declares.
    children: BTreeSet<String>,
    imports: Vec<Import>,
    /// Paths in its code, `use` aside.
    paths: BTreeSet<Path>,
    /// Single words in its code, `use` aside.
    mentioned: BTreeSet<String>,
}

struct Import {
    path: Path,
    /// The local name.
    name: String,
    /// Re-exported by `pub use`.
    passes_on: bool,
}

/// The crate, by module.
struct Crate {
    /// The file of a module.
    files: BTreeMap<Path, String>,
    names: BTreeMap<Path, Names>,
}

impl Crate {
    /// Library and command line as one: `main.rs`, which nobody imports, is excluded.
    fn new(sources: &[Source]) -> Self {
        let sources = || sources.iter().filter(|s| s.path != "main.rs");
        let files = sources().map(|s| (s.module.clone(), s.path.clone())).collect();
        let mut names: BTreeMap<Path, Names> = sources().map(|s| (s.module.clone(), names(s))).collect();
        names.get_mut(&Path::new()).expect("lib.rs").children.insert("cli".into());
        Crate { files, names }
    }

    /// The module that defines the item of a path, as written in `from`. `None` for a module itself and for other crates.
    fn defined_in(&self, from: &Path, path: &[String], depth: usize) -> Option<Path> {
        assert!(depth < 20, "{path:?} in {from:?} goes round in circles");
        let (mut module, rest) = self.start(from, path)?;
        for (i, name) in rest.iter().enumerate() {
            let here = &self.names[&module];
            if here.children.contains(name) {
                module.push(name.clone());
                self.files.get(&module)?;
            } else if let Some(import) = here.imports.iter().find(|import| import.name == *name) {
                if import.path[0] == *name {
                    // Another crate of the same name.
                    return None;
                }
                let further = [import.path.clone(), rest[i + 1..].to_vec()].concat();
                return self.defined_in(&module, &further, depth + 1);
            } else {
                return Some(module);
            }
        }
        None
    }

    /// The module at which a path starts, and the rest of the path.
    fn start<'a>(&self, from: &Path, path: &'a [String]) -> Option<(Path, &'a [String])> {
        let mut module = match path[0].as_str() {
            "crate" | "oscura" => return Some((Path::new(), &path[1..])),
            "self" => from.clone(),
            "super" => from[..from.len() - 1].to_vec(),
            first => {
                let here = &self.names[from];
                let known = here.children.contains(first) || here.imports.iter().any(|i| i.name == first);
                return known.then(|| (from.clone(), path));
            }
        };
        let mut rest = &path[1..];
        while rest.first().is_some_and(|name| name == "super") {
            module.pop();
            rest = &rest[1..];
        }
        Some((module, rest))
    }

    /// For each file, the files that it imports, with one of the names.
    fn edges(&self) -> BTreeMap<String, BTreeMap<String, String>> {
        let mut edges: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
        for (module, names) in &self.names {
            let taken = names.imports.iter().filter(|i| !i.passes_on || names.mentioned.contains(&i.name));
            for path in taken.map(|import| &import.path).chain(&names.paths) {
                // An import's own name would resolve to itself.
                let from = if path.len() == 1 { continue } else { module };
                if let Some(definer) = self.defined_in(from, path, 0).filter(|definer| definer != module) {
                    let name = path.last().expect("a name").clone();
                    edges
                        .entry(self.files[module].clone())
                        .or_default()
                        .insert(self.files[&definer].clone(), name);
                }
            }
        }
        edges
    }
}

/// The names that a file declares, imports and mentions.
fn names(source: &Source) -> Names {
    let words = &source.words;
    let mut names = Names {
        children: BTreeSet::new(),
        imports: Vec::new(),
        paths: BTreeSet::new(),
        mentioned: BTreeSet::new(),
    };
    let mut at = 0;
    while at < words.len() {
        if starts(&words[at..], &["mod"]) && words.get(at + 2).is_some_and(|w| w.text == ";") {
            names.children.insert(words[at + 1].text.clone());
            at += 3;
        } else if words[at].text == "use" && !starts(&words[at + 1..], &["<"]) {
            let end = at + words[at..].iter().position(|w| w.text == ";").expect("'use' ends");
            let passes_on = at > 0 && ["pub", ")"].contains(&words[at - 1].text.as_str());
            let mut group = &words[at + 1..end];
            for (path, name) in tree(&mut group, &[], source) {
                names.imports.push(Import { path, name, passes_on });
            }
            at = end + 1;
        } else if words[at].is_name() {
            let path = path_at(&words[at..]);
            at += 2 * path.len() - 1;
            names.mentioned.insert(path[0].clone());
            if path.len() > 1 {
                names.paths.insert(path);
            }
        } else {
            // Names after a stray '::', as of a generic type, belong to the preceding path.
            at += if words[at].text == "::" { 2 } else { 1 };
        }
    }
    names
}

/// The path at the start of the words.
fn path_at(words: &[Word]) -> Path {
    let mut path = vec![words[0].text.clone()];
    while starts(&words[2 * path.len() - 1..], &["::"])
        && words.get(2 * path.len()).is_some_and(Word::is_name)
    {
        path.push(words[2 * path.len()].text.clone());
    }
    path
}

/// The paths of a use tree, each with its local name; consumes the tree.
fn tree(words: &mut &[Word], before: &[String], source: &Source) -> Vec<(Path, String)> {
    let mut path = before.to_vec();
    loop {
        let word = take(words);
        match word.text.as_str() {
            "{" => {
                let mut list = Vec::new();
                while !starts(words, &["}"]) {
                    list.extend(tree(words, &path, source));
                    if starts(words, &[","]) {
                        take(words);
                    }
                }
                take(words);
                return list;
            }
            "*" => {
                let own = ["crate", "self", "super", "oscura"].contains(&path[0].as_str());
                assert!(!own, "{}:{}: imports say which names they mean", source.path, word.line);
                return Vec::new();
            }
            "self" if !path.is_empty() => {}
            name => path.push(name.to_string()),
        }
        if !starts(words, &["::"]) {
            break;
        }
        take(words);
    }
    let name = if starts(words, &["as"]) { &words[1].text } else { path.last().expect("a name") };
    let name = name.clone();
    if starts(words, &["as"]) {
        *words = &words[2..];
    }
    vec![(path, name)]
}

fn take<'a>(words: &mut &'a [Word]) -> &'a Word {
    let (first, rest) = words.split_first().expect("an import ends");
    *words = rest;
    first
}

/// Strongly connected components of more than one file.
fn cycles(edges: &BTreeMap<String, BTreeMap<String, String>>) -> Vec<BTreeSet<String>> {
    let reached: BTreeMap<&String, BTreeSet<&String>> =
        edges.keys().map(|file| (file, reach(edges, file))).collect();
    let mut found: BTreeSet<BTreeSet<String>> = BTreeSet::new();
    for (file, targets) in &reached {
        let back = |other: &&&String| reached.get(**other).is_some_and(|r| r.contains(file));
        let group: BTreeSet<String> = targets.iter().filter(back).map(|f| f.to_string()).collect();
        if !group.is_empty() {
            found.insert(group);
        }
    }
    found.into_iter().collect()
}

fn reach<'a>(edges: &'a BTreeMap<String, BTreeMap<String, String>>, file: &String) -> BTreeSet<&'a String> {
    let mut reached = BTreeSet::new();
    let mut waiting: Vec<&String> = edges[file].keys().collect();
    while let Some(next) = waiting.pop() {
        if reached.insert(next) {
            waiting.extend(edges.get(next).into_iter().flat_map(|targets| targets.keys()));
        }
    }
    reached
}

/// The edges inside a component, as text.
fn explain(edges: &BTreeMap<String, BTreeMap<String, String>>, group: &BTreeSet<String>) -> String {
    let mut lines = format!("a cycle of {} files:\n", group.len());
    for file in group {
        for (other, name) in edges[file].iter().filter(|(other, _)| group.contains(*other)) {
            lines += &format!("  {file} takes from {other}: {name}, ...\n");
        }
    }
    lines
}

#[test]
fn no_import_cycles() {
    let edges = Crate::new(sources()).edges();
    let ties: usize = edges.values().map(BTreeMap::len).sum();
    assert!(ties > 500, "only {ties} imports between files were found: is the test still right?");
    let (mut known, mut wrong) = (BTreeSet::new(), Vec::new());
    for group in cycles(&edges) {
        match KNOWN.iter().find(|file| group.contains(**file)) {
            Some(file) => _ = known.insert(file),
            None => wrong.push(explain(&edges, &group)),
        }
    }
    assert!(wrong.is_empty(), "{} cycles\n{}", wrong.len(), wrong.join("\n"));
    let gone: Vec<_> = KNOWN.iter().filter(|file| !known.contains(file)).collect();
    assert!(gone.is_empty(), "no cycle any more, and to be taken off the list: {gone:?}");
}

#[test]
fn imports_are_parsed() {
    let files = [
        ("lib.rs", "pub mod a; pub mod b; pub use a::deep::Thing;"),
        ("a/mod.rs", "mod deep; mod user; pub(crate) use deep::{Thing, other as another};"),
        (
            "a/deep.rs",
            "use std::fmt; pub struct Thing; fn f() -> fmt::Result { crate::b::g::<super::Thing>() }",
        ),
        ("a/user.rs", "use super::{Thing as T, another::{self}};"),
        ("b.rs", "use crate::{Thing, a}; fn g() { a::another() }"),
    ];
    let sources: Vec<Source> = files.iter().map(|(path, text)| parse(path, text).0).collect();
    let edges = Crate::new(&sources).edges();
    let found: Vec<(&str, Vec<&str>)> =
        edges.iter().map(|(file, to)| (file.as_str(), to.keys().map(String::as_str).collect())).collect();
    let expected =
        [("a/deep.rs", vec!["b.rs"]), ("a/user.rs", vec!["a/deep.rs"]), ("b.rs", vec!["a/deep.rs"])];
    assert_eq!(found, expected);
    let groups: Vec<Vec<String>> = cycles(&edges).into_iter().map(|g| g.into_iter().collect()).collect();
    assert_eq!(groups, [["a/deep.rs", "b.rs"]]);
}
