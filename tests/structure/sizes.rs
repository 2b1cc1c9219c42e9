//! Functions of at most 60 lines.

use crate::source::{Source, Word, parse, sources};
use std::collections::BTreeSet;

/// Maximum lines of a function, from `fn` to its closing brace, without blank and comment lines.
const FUNCTION: usize = 60;

/// Known longer functions, as the test prints them. Don't add new ones.
const KNOWN: &[&str] = &[];

/// Name, first line and length of each function.
fn functions(source: &Source) -> Vec<(String, usize, usize)> {
    let words = &source.words;
    let mut list = Vec::new();
    for (at, word) in words.iter().enumerate() {
        // Not the type 'fn(...)'.
        let is_function = word.text == "fn" && words.get(at + 1).is_some_and(Word::is_name);
        if let Some(body) = is_function.then(|| body(&words[at..])).flatten() {
            let lines: BTreeSet<usize> = words[at..at + body].iter().map(|w| w.line).collect();
            list.push((words[at + 1].text.clone(), word.line, lines.len()));
        }
    }
    list
}

/// The number of words of a function, its closing brace included; `None` where it has no body.
fn body(words: &[Word]) -> Option<usize> {
    let (mut depth, mut inside) = (0, false);
    for (i, word) in words.iter().enumerate() {
        match word.text.as_str() {
            "{" if depth == 0 => (depth, inside) = (1, true),
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            ";" if depth == 0 => return None,
            _ => {}
        }
        if inside && depth == 0 {
            return Some(i + 1);
        }
    }
    None
}

#[test]
fn functions_are_short() {
    let (mut long, mut count) = (Vec::new(), 0);
    for source in sources() {
        for (name, line, length) in functions(source) {
            count += 1;
            if length > FUNCTION {
                let place = format!("{}: fn {name}", source.path);
                long.push((place, format!("{length} lines from line {line} on")));
            }
        }
    }
    assert!(count > 1000, "only {count} functions were found: is the test still right?");
    let new: Vec<_> = long.iter().filter(|(place, _)| !KNOWN.contains(&place.as_str())).collect();
    assert!(new.is_empty(), "{new:#?}");
    let gone: Vec<_> = KNOWN.iter().filter(|known| !long.iter().any(|(place, _)| place == **known)).collect();
    assert!(gone.is_empty(), "short now, and to be taken off the list: {gone:?}");
}

#[test]
fn lines_of_functions_are_counted() {
    let text = "trait T { fn none(&self) -> [u8; 3]; }\nfn a(f: fn(u8)) -> [u8; 2] {\n // one\n\n  [f(1); 2]\n}\nfn b() {}\n";
    let (source, _) = parse("a.rs", text);
    assert_eq!(functions(&source), [("a".to_string(), 2, 3), ("b".to_string(), 7, 1)]);
}
