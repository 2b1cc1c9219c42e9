//! The project's sources as tokens: without comments and test-only items.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// An identifier, a number, a string (as `""`), a lifetime, `::`, or one character of punctuation.
#[derive(Clone, Debug, PartialEq)]
pub struct Word {
    pub text: String,
    /// 1-based.
    pub line: usize,
}

impl Word {
    pub fn is_name(&self) -> bool {
        self.text.starts_with(|c: char| c.is_alphabetic() || c == '_')
    }
}

/// A file under `src`.
pub struct Source {
    /// Relative to `src`, with `/`.
    pub path: String,
    /// The module path from the crate's root: `["load", "gltf"]` for `load/gltf/mod.rs`.
    pub module: Vec<String>,
    /// Without items under `#[cfg(test)]`.
    pub words: Vec<Word>,
    /// Number of lines before the first item under `#[cfg(test)]`, or all.
    pub lines: usize,
}

/// The source folder.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// All files of the crate, sorted by name, without those declared under `#[cfg(test)]`.
pub fn sources() -> &'static [Source] {
    static SOURCES: LazyLock<Vec<Source>> = LazyLock::new(read);
    &SOURCES
}

fn read() -> Vec<Source> {
    let mut paths = Vec::new();
    collect(&root(), &mut paths);
    paths.sort();
    assert!(paths.len() > 100, "found only {} source files under {}", paths.len(), root().display());
    let mut for_tests = BTreeSet::new();
    let mut list = Vec::new();
    for path in paths {
        let text = fs::read_to_string(&path).expect("a source file is UTF-8");
        let inside = path.strip_prefix(root()).expect("under src");
        let (source, children) = parse(&inside.to_string_lossy().replace('\\', "/"), &text);
        for_tests.extend(children.into_iter().map(|child| [source.module.clone(), vec![child]].concat()));
        list.push(source);
    }
    list.retain(|source| !for_tests.contains(&source.module));
    list
}

fn collect(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("src can be read") {
        let path = entry.expect("an entry of src").path();
        if path.is_dir() {
            collect(&path, paths);
        } else if path.extension().is_some_and(|e| e == "rs") {
            paths.push(path);
        }
    }
}

/// A file, and the modules that it declares for tests only.
pub fn parse(path: &str, text: &str) -> (Source, Vec<String>) {
    let mut module: Vec<String> = path.trim_end_matches(".rs").split('/').map(str::to_string).collect();
    if ["mod", "lib", "main"].contains(&module.last().expect("a name").as_str()) {
        module.pop();
    }
    let all = words(text);
    let mut first_test_line = None;
    let (mut kept, mut children, mut at) = (Vec::new(), Vec::new(), 0);
    while at < all.len() {
        if !starts(&all[at..], &["#", "[", "cfg", "(", "test", ")", "]"]) {
            kept.push(all[at].clone());
            at += 1;
            continue;
        }
        first_test_line = first_test_line.or(Some(all[at].line));
        at += 7;
        if starts(&all[at..], &["mod"]) && all[at + 2].text == ";" {
            children.push(all[at + 1].text.clone());
        }
        at += item_length(&all[at..]);
    }
    let lines = first_test_line.map_or(text.lines().count(), |line| line - 1);
    (Source { path: path.to_string(), module, words: kept, lines }, children)
}

/// Do the words start with these?
pub fn starts(words: &[Word], with: &[&str]) -> bool {
    words.len() >= with.len() && words.iter().zip(with).all(|(a, b)| a.text == *b)
}

/// Number of words up to the `;` or the `}` that ends an item.
fn item_length(words: &[Word]) -> usize {
    let mut depth = 0;
    for (i, word) in words.iter().enumerate() {
        match word.text.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        if depth == 0 && (word.text == ";" || word.text == "}") {
            return i + 1;
        }
    }
    words.len()
}

/// Splits Rust source into words.
pub fn words(text: &str) -> Vec<Word> {
    let mut list = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while let Some(first) = rest.chars().next() {
        let (length, text) = next_word(rest, first);
        if let Some(text) = text {
            list.push(Word { text, line });
        }
        line += rest[..length].matches('\n').count();
        rest = &rest[length..];
    }
    list
}

/// The length of the next token in bytes, and the word unless it is a comment or whitespace.
fn next_word(rest: &str, first: char) -> (usize, Option<String>) {
    if first.is_whitespace() {
        return (first.len_utf8(), None);
    }
    if rest.starts_with("//") {
        return (rest.find('\n').unwrap_or(rest.len()), None);
    }
    if rest.starts_with("/*") {
        return (block_comment(rest), None);
    }
    if let Some(length) = string(rest) {
        return (length, Some("\"\"".into()));
    }
    if first == '\'' {
        return quoted(rest);
    }
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let length = match first {
        c if is_part(c) => rest.find(|c| !is_part(c)).unwrap_or(rest.len()),
        ':' if rest.starts_with("::") => 2,
        c => c.len_utf8(),
    };
    (length, Some(rest[..length].to_string()))
}

/// Length of a block comment in bytes; they nest.
fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        match &rest.as_bytes()[at..] {
            [b'/', b'*', ..] => (depth, at) = (depth + 1, at + 2),
            [b'*', b'/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at
}

/// Length of the string literal that starts here in bytes: plain, byte or raw.
fn string(rest: &str) -> Option<usize> {
    let prefix = rest.find(|c: char| !matches!(c, 'b' | 'r' | 'c')).filter(|&n| n <= 2)?;
    let hashes = rest[prefix..].bytes().take_while(|&b| b == b'#').count();
    let open = prefix + hashes;
    if rest.as_bytes().get(open) != Some(&b'"') {
        return None;
    }
    if rest[..prefix].contains('r') {
        let end = format!("\"{}", "#".repeat(hashes));
        return Some(open + 1 + rest[open + 1..].find(&end)? + end.len());
    }
    if hashes > 0 {
        return None;
    }
    let mut escaped = false;
    for (i, b) in rest.bytes().enumerate().skip(open + 1) {
        match b {
            b'"' if !escaped => return Some(i + 1),
            b'\\' => escaped = !escaped,
            _ => escaped = false,
        }
    }
    None
}

/// A character literal or a lifetime.
fn quoted(rest: &str) -> (usize, Option<String>) {
    let mut characters = rest.char_indices().skip(1);
    let (_, first) = characters.next().expect("a quote is followed by something");
    if first == '\\' {
        let close = rest[3..].find('\'').expect("a character ends") + 4;
        return (close, Some("''".into()));
    }
    match characters.next() {
        Some((at, '\'')) => (at + 1, Some("''".into())),
        _ => {
            let end =
                rest[1..].find(|c: char| !c.is_alphanumeric() && c != '_').map_or(rest.len(), |n| n + 1);
            (end, Some(rest[..end].to_string()))
        }
    }
}

#[test]
fn sources_are_split_into_words() {
    let text = "fn f<'a>(x: &'a str) -> char { // c\n /* a /* b */ */ g::h(r#\"}\"#, \"\\\"}\", b\"x\", '}', '\\'') }";
    let found: Vec<String> = words(text).into_iter().map(|w| w.text).collect();
    let expected =
        "fn f < 'a > ( x : & 'a str ) - > char { g :: h ( \"\" , \"\" , \"\" , '' , '' ) }".split(' ');
    assert_eq!(found, expected.collect::<Vec<_>>());
    let (source, children) =
        parse("a/b.rs", "use x;\n#[cfg(test)]\nmod t;\n#[cfg(test)]\nmod tests { fn f() {} }\n");
    assert_eq!((source.words.len(), source.lines, source.module.join("::")), (3, 1, "a::b".to_string()));
    assert_eq!(children, ["t"]);
}
